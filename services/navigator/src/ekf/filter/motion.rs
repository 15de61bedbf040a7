//! What a span of motion does to the filter (model.md 6.2 and 6.3).
//!
//! Before the move the state is augmented by the noise of both wheels, written as that of the way of their middle and that
//! of their difference. The gyro corrects the difference, the accelerometer the way, and both everything that depends on
//! them; then the robot moves. The states in use are the first 4, 6 or 9, and each number has its own code: loops of
//! fixed length over matrices on the stack.

use super::{BIAS, Filter, LEFT, N, PUSH, RIGHT, SPEED, TRACK};
use crate::reckoning::bend;
use std::array::from_fn;

/// Turns and distances of one span.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ekf) struct Motion {
    /// Duration, in s.
    pub(in crate::ekf) dt: f64,
    /// What the encoders say the left wheel covered, in m.
    pub(in crate::ekf) left: f64,
    /// What they say of the right wheel.
    pub(in crate::ekf) right: f64,
    /// Whether a wheel has ticked in this span or not long before.
    pub(in crate::ekf) ticks: bool,
    /// The gyro's angle, in rad.
    pub(in crate::ekf) gyro: Option<f64>,
    /// By what the mean speed differs from that of the span before, in m/s, says the accelerometer.
    pub(in crate::ekf) push: Option<Push>,
    /// Variance of each wheel's distance beyond that of its noise, in m².
    pub(in crate::ekf) extra: f64,
    /// Variance of the way of both beyond that, in m²: they slip alike.
    pub(in crate::ekf) along: f64,
    /// Variance of the position beyond that, in m²: a path that nobody saw.
    pub(in crate::ekf) unseen: f64,
}

/// What the accelerometer sums up to between the middles of two spans.
#[derive(Clone, Copy, Debug)]
pub(in crate::ekf) struct Push {
    /// The change of speed, in m/s.
    pub(in crate::ekf) change: f64,
    /// The time from middle to middle, in s.
    pub(in crate::ekf) over: f64,
}

/// What a sensor thought of the wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::ekf) struct Innovation {
    /// Of the gyro in rad, or of the accelerometer in m/s.
    pub(in crate::ekf) nu: f64,
    /// Its variance.
    pub(in crate::ekf) s: f64,
}

impl Innovation {
    pub(in crate::ekf) fn squared(self) -> f64 {
        self.nu * self.nu / self.s
    }
}

/// Noises that do not change (model.md 6.1).
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::ekf) struct Noise {
    pub(in crate::ekf) track: f64,
    pub(in crate::ekf) k: f64,
    /// Variance of a wheel's distance after 1 s, whether it turns or not.
    pub(in crate::ekf) wheel: f64,
    /// Distance of a wheel from tick to tick of its encoder, in m.
    pub(in crate::ekf) tick: f64,
    /// Variance of the gyro's angle after 1 s.
    pub(in crate::ekf) gyro: f64,
    /// Variance of its bias after 1 s.
    pub(in crate::ekf) bias: f64,
    /// Variance of the accelerometer's speed after 1 s.
    pub(in crate::ekf) push: f64,
}

impl Filter {
    /// Moves by a span; gives what the gyro thought of it.
    pub(in crate::ekf) fn predict(&mut self, motion: &Motion, noise: &Noise) -> Option<Innovation> {
        match self.states {
            4 => self.step::<4, 6>(motion, noise),
            6 => self.step::<6, 8>(motion, noise),
            _ => self.step::<N, { N + 2 }>(motion, noise),
        }
    }

    /// With `S` states in use, and `A` of them with the noises of way and difference.
    fn step<const S: usize, const A: usize>(&mut self, motion: &Motion, noise: &Noise) -> Option<Innovation> {
        let (way, difference) = (S, S + 1);
        let &Motion { dt, left: ml, right: mr, .. } = motion;
        let mut p = self.augmented::<S, A>(motion, noise);
        let mut x = [0.0; A];
        x[..S].copy_from_slice(&self.x[..S]);
        let mut innovation = None;
        if let Some(gyro) = motion.gyro {
            let (_, turn, width) = covered::<S, A>(&x, motion, noise.track);
            let mut h = [0.0; A];
            (h[BIAS], h[difference]) = (dt, 1.0 / width);
            if S == N {
                (h[LEFT], h[RIGHT], h[TRACK]) = (-ml / width, mr / width, -turn / (1.0 + x[TRACK]));
            }
            let nu = gyro - (x[BIAS] * dt + turn);
            innovation = Some(Innovation { nu, s: correct(&mut x, &mut p, &h, nu, noise.gyro * dt) });
        }
        if let (Some(Push { change, over }), true) = (motion.push, S > SPEED) {
            let (s, ..) = covered::<S, A>(&x, motion, noise.track);
            let mut h = [0.0; A];
            (h[SPEED], h[PUSH], h[way]) = (-1.0, over, 1.0 / dt);
            if S == N {
                (h[LEFT], h[RIGHT]) = (ml / (2.0 * dt), mr / (2.0 * dt));
            }
            let nu = change - (s / dt - x[SPEED] + x[PUSH] * over);
            let _ = correct(&mut x, &mut p, &h, nu, noise.push * over);
        }
        self.travel::<S, A>(&x, &p, motion, noise.track);
        self.p[(BIAS, BIAS)] += noise.bias * dt;
        self.p[(0, 0)] += motion.unseen;
        self.p[(1, 1)] += motion.unseen;
        innovation
    }

    /// `Pa` of model.md 6.3.
    fn augmented<const S: usize, const A: usize>(&self, motion: &Motion, noise: &Noise) -> [[f64; A]; A] {
        let known = |row, column| if row < S && column < S { self.p[(row, column)] } else { 0.0 };
        let mut p: [[f64; A]; A] = from_fn(|row| from_fn(|column| known(row, column)));
        let (ql, qr) = wheels(motion, noise);
        p[S][S] = (ql + qr) / 4.0 + motion.along;
        p[S + 1][S + 1] = ql + qr;
        (p[S][S + 1], p[S + 1][S]) = ((qr - ql) / 2.0, (qr - ql) / 2.0);
        p
    }

    /// The motion itself: `X ← f`, `P ← T Pa Tᵀ`. Only pose and speed change, so only their rows are multiplied.
    fn travel<const S: usize, const A: usize>(
        &mut self,
        x: &[f64; A],
        p: &[[f64; A]; A],
        motion: &Motion,
        track: f64,
    ) {
        let (way, difference) = (S, S + 1);
        let &Motion { dt, left: ml, right: mr, .. } = motion;
        let (s, d, width) = covered::<S, A>(x, motion, track);
        let bend = bend(x[2], s, d);
        let [dx, dy] = bend.moved;
        let mut t = [[0.0; A]; 4];
        // Of x, y and heading: by the length of the way, and by the turn.
        let by_length = [bend.by_length[0], bend.by_length[1], 0.0];
        let by_turn = [bend.by_turn[0], bend.by_turn[1], 1.0];
        for row in 0..3 {
            t[row][row] = 1.0;
            t[row][way] = by_length[row];
            t[row][difference] = by_turn[row] / width;
            if S == N {
                t[row][LEFT] = ml * (by_length[row] / 2.0 - by_turn[row] / width);
                t[row][RIGHT] = mr * (by_length[row] / 2.0 + by_turn[row] / width);
                t[row][TRACK] = -by_turn[row] * d / (1.0 + x[TRACK]);
            }
        }
        (t[0][2], t[1][2]) = (-dy, dx);
        // The speed is the mean of this span, and forgets the one before.
        t[3][way] = 1.0 / dt;
        if S == N {
            (t[3][LEFT], t[3][RIGHT]) = (ml / (2.0 * dt), mr / (2.0 * dt));
        }
        let mut half = [[0.0; A]; 4];
        for row in 0..if S > SPEED { 4 } else { 3 } {
            for (inner, &weight) in t[row].iter().enumerate() {
                for column in 0..A {
                    half[row][column] += weight * p[inner][column];
                }
            }
        }
        let moved = |at: usize| if at < 3 { Some(at) } else { (at == SPEED).then_some(3) };
        for row in 0..S {
            for column in 0..=row {
                self.p[(row, column)] = match (moved(row), moved(column)) {
                    (Some(row), Some(column)) => (0..A).map(|at| half[row][at] * t[column][at]).sum(),
                    (Some(row), None) => half[row][column],
                    (None, Some(column)) => half[column][row],
                    (None, None) => p[row][column],
                };
            }
            self.p[(row, row)] = self.p[(row, row)].max(0.0);
        }
        self.x[..S].copy_from_slice(&x[..S]);
        self.x[0] += dx;
        self.x[1] += dy;
        self.x[2] += d;
        if S > SPEED {
            self.x[SPEED] = s / dt;
        }
    }

    /// What the gyro would think of the wheels.
    pub(in crate::ekf) fn doubt_turn(&self, motion: &Motion, noise: &Noise) -> Option<Innovation> {
        let gyro = motion.gyro?;
        let [left, right, track] = self.measures();
        let width = noise.track * (1.0 + track);
        let d = (motion.right * (1.0 + right) - motion.left * (1.0 + left)) / width;
        let nu = gyro - self.x[BIAS] * motion.dt - d;
        let (ql, qr) = wheels(motion, noise);
        let measures =
            motion.left.powi(2) * self.p[(LEFT, LEFT)] + motion.right.powi(2) * self.p[(RIGHT, RIGHT)];
        let s = self.p[(BIAS, BIAS)] * motion.dt.powi(2)
            + (ql + qr + measures) / noise.track.powi(2)
            + d * d * self.p[(TRACK, TRACK)]
            + noise.gyro * motion.dt;
        Some(Innovation { nu, s })
    }

    /// What the accelerometer would think of the wheels.
    pub(in crate::ekf) fn doubt_way(&self, motion: &Motion, noise: &Noise) -> Option<Innovation> {
        let Push { change, over } = motion.push.filter(|_| self.states > SPEED)?;
        let [left, right, _] = self.measures();
        let s = f64::midpoint(motion.left * (1.0 + left), motion.right * (1.0 + right));
        let nu = change - (s / motion.dt - self.x[SPEED] + self.x[PUSH] * over);
        let (ql, qr) = wheels(motion, noise);
        let speed =
            self.p[(SPEED, SPEED)] + over * (over * self.p[(PUSH, PUSH)] - 2.0 * self.p[(SPEED, PUSH)]);
        let s = speed + ((ql + qr) / 4.0 + motion.along) / motion.dt.powi(2) + noise.push * over;
        Some(Innovation { nu, s })
    }

    /// The relative errors of left radius, right radius and track.
    const fn measures(&self) -> [f64; 3] {
        [self.x[LEFT], self.x[RIGHT], self.x[TRACK]]
    }
}

/// Variances of the distances of both wheels. A distance begins and ends somewhere within a tick: without that the wheel
/// that happens to tick would take all the blame for a turn that the gyro does not feel, or the gyro itself where none ticks.
/// A robot that stands has none.
fn wheels(motion: &Motion, noise: &Noise) -> (f64, f64) {
    let (left, right) = (motion.left.abs(), motion.right.abs());
    let grain = if motion.ticks { noise.tick * noise.tick / 6.0 } else { 0.0 };
    let both = grain + noise.wheel * motion.dt + motion.extra;
    (noise.k * left + both, noise.k * right + both)
}

/// The length of the way, the turn, and the width of the robot, as far as they are known.
fn covered<const S: usize, const A: usize>(x: &[f64; A], motion: &Motion, track: f64) -> (f64, f64, f64) {
    let (mut left, mut right, mut width) = (motion.left, motion.right, track);
    if S == N {
        left *= 1.0 + x[LEFT];
        right *= 1.0 + x[RIGHT];
        width *= 1.0 + x[TRACK];
    }
    (f64::midpoint(left, right) + x[S], (right - left + x[S + 1]) / width, width)
}

/// Corrects by a measurement of one number with variance `r`, as `Covariance::correct`; gives the innovation's variance.
fn correct<const A: usize>(x: &mut [f64; A], p: &mut [[f64; A]; A], h: &[f64; A], nu: f64, r: f64) -> f64 {
    let mut ph = [0.0; A];
    for row in 0..A {
        for column in 0..A {
            ph[row] += p[row][column] * h[column];
        }
    }
    let mut s = r;
    for at in 0..A {
        s += h[at] * ph[at];
    }
    if s <= 0.0 || !s.is_finite() {
        return s;
    }
    for row in 0..A {
        let gain = ph[row] / s;
        x[row] += gain * nu;
        for column in 0..A {
            p[row][column] -= gain * ph[column];
        }
    }
    s
}
