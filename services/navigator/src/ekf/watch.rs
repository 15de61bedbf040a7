//! What the spans tell about the sensors: slip, a stuck encoder, and a gyro of another unit.

use super::filter::Innovation;
use axle_schema::event::{Event, Side};
use axle_schema::{Metres, MetresPerSecond, Radians, Seconds};
use std::collections::VecDeque;

/// A gyro has proved its unit when the wheels turned so far, in rad.
const PROVED: f64 = 0.3;
/// For so long, in s, the differences of wheels and gyro are summed: noise cancels, and a slip does not.
const WHILE: f64 = 0.4;
/// The most spans of that time.
const MOST: usize = 64;
/// The other wheel has covered this, in m, before an encoder counts as stuck.
const STUCK: f64 = 0.05;

/// What a span was like.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) stamp: f64,
    pub(super) dt: f64,
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) track: f64,
    /// The gyro's angle without its bias.
    pub(super) gyro: Option<f64>,
    /// What the gyro thinks of the wheels.
    pub(super) turn: Option<Innovation>,
    /// What the accelerometer thinks of them.
    pub(super) way: Option<Innovation>,
    /// By what the speed changed, by the accelerometer and in m/s.
    pub(super) change: Option<f64>,
}

/// Watches the sensors.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// Σ of the wheels' turns, squared, and times the gyro's; and of their sizes.
    products: [f64; 2],
    turned: f64,
    scale: Option<f64>,
    /// Stamps and innovations of the last spans.
    last: VecDeque<(f64, Innovation)>,
    /// Their sums: of the innovations, and of their variances.
    sums: [f64; 2],
    slipping: bool,
    /// Until when both wheels count as slipping alike.
    skids: f64,
    /// Since one encoder stays: which, what the other covered, and both turns.
    stuck: Option<(Side, f64, f64, f64)>,
    stuck_said: bool,
}

impl Watch {
    /// Whether the gyro may be asked, and whether it may be believed against the wheels.
    pub(super) fn gyro_is_usable(&self) -> bool {
        self.scale.is_none()
    }
    pub(super) fn gyro_is_proved(&self) -> bool {
        self.scale.is_none() && self.turned > PROVED && {
            let ratio = self.products[1] / self.products[0];
            (0.5..2.0).contains(&ratio)
        }
    }

    /// A clock that begins anew.
    pub(super) fn restart(&mut self) {
        self.last.clear();
        (self.sums, self.slipping, self.skids, self.stuck) = ([0.0; 2], false, 0.0, None);
    }

    /// Looks at a span for the first time.
    pub(super) fn look(
        &mut self,
        seen: &Seen,
        raw: Option<f64>,
        gate: f64,
    ) -> impl Iterator<Item = Event> + use<> {
        let encoders = (seen.right - seen.left) / seen.track;
        let scale = raw.and_then(|raw| self.unit(seen.stamp, encoders, raw));
        let slip = self.slip(seen, encoders, gate);
        let skid = self.skid(seen, gate);
        let stuck = self.stays(seen, encoders);
        [scale, slip, skid, stuck].into_iter().flatten()
    }

    fn unit(&mut self, stamp: f64, encoders: f64, raw: f64) -> Option<Event> {
        if self.scale.is_some() {
            return None;
        }
        self.products[0] += encoders * encoders;
        self.products[1] += encoders * raw;
        self.turned += encoders.abs();
        let ratio = self.products[1] / self.products[0];
        let wrong = (30.0..90.0).contains(&ratio) || (-1.5..-0.5).contains(&ratio);
        // Once proved it is right: a wheel that slips makes no gyro wrong.
        if self.turned <= PROVED || !wrong {
            return None;
        }
        self.scale = Some(ratio);
        Some(Event::GyroScale { stamp: Seconds(stamp), ratio })
    }

    fn slip(&mut self, seen: &Seen, encoders: f64, gate: f64) -> Option<Event> {
        let (Some(innovation), Some(gyro)) = (seen.turn, seen.gyro) else { return None };
        while self.last.len() >= MOST || self.last.front().is_some_and(|first| first.0 < seen.stamp - WHILE) {
            let _ = self.last.pop_front();
        }
        self.last.push_back((seen.stamp, innovation));
        let add = |[nu, s]: [f64; 2], (_, last): &(f64, Innovation)| [nu + last.nu, s + last.s];
        self.sums = self.last.iter().fold([0.0; 2], add);
        let [nu, s] = self.sums;
        let squared = nu * nu / s;
        let slips = self.gyro_is_proved() && squared > gate;
        let begins = slips && !self.slipping;
        self.slipping = slips;
        begins.then_some(Event::Slip {
            stamp: Seconds(seen.stamp),
            encoders: Radians(encoders),
            gyro: Radians(gyro),
            squared,
        })
    }

    /// What a slip that lasts adds to the variance of a wheel's distance in each span, in m². Its error has one sign, so
    /// that it counts as often as there are spans of it.
    pub(super) fn slip_variance(&self, track: f64) -> f64 {
        if !self.slipping {
            return 0.0;
        }
        #[allow(clippy::cast_precision_loss, reason = "at most 64")]
        let n = self.last.len() as f64;
        (self.sums[0] * track).powi(2) / (2.0 * n)
    }

    /// Both wheels may slip alike, and then turn nothing that a gyro would feel.
    fn skid(&mut self, seen: &Seen, gate: f64) -> Option<Event> {
        let (way, change) = (seen.way?, seen.change?);
        if way.squared() <= gate {
            return None;
        }
        let begins = seen.stamp > self.skids;
        self.skids = seen.stamp + WHILE;
        begins.then_some(Event::Skid {
            stamp: Seconds(seen.stamp),
            encoders: MetresPerSecond(f64::midpoint(seen.left, seen.right) / seen.dt),
            accelerometer: MetresPerSecond(f64::midpoint(seen.left, seen.right) / seen.dt + way.nu),
            change: MetresPerSecond(change),
            squared: way.squared(),
        })
    }

    #[allow(clippy::float_cmp, reason = "a stuck encoder repeats the very same reading")]
    fn stays(&mut self, seen: &Seen, encoders: f64) -> Option<Event> {
        let side = match (seen.left == 0.0, seen.right == 0.0) {
            (true, false) => Side::Left,
            (false, true) => Side::Right,
            (true, true) => return None,
            (false, false) => {
                (self.stuck, self.stuck_said) = (None, false);
                return None;
            }
        };
        let (Some(gyro), true) = (seen.gyro, self.gyro_is_proved()) else { return None };
        let (_, other, by_wheels, by_gyro) =
            self.stuck.filter(|stuck| stuck.0 == side).unwrap_or((side, 0.0, 0.0, 0.0));
        let (other, by_wheels, by_gyro) =
            (other + seen.left + seen.right, by_wheels + encoders, by_gyro + gyro);
        self.stuck = Some((side, other, by_wheels, by_gyro));
        if self.stuck_said || other.abs() < STUCK || (by_wheels - by_gyro).abs() < 0.3 * by_wheels.abs() {
            return None;
        }
        self.stuck_said = true;
        Some(Event::StuckEncoder {
            stamp: Seconds(seen.stamp),
            side,
            other: Metres(other),
            encoders: Radians(by_wheels),
            gyro: Radians(by_gyro),
        })
    }
}
