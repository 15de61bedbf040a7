//! docs/dead-reckoning.md: what the ways of dead reckoning miss by, computed (model.md, 5).

use super::GENERATED;
use axle_schema::motion::{Motion, Wheels, accelerated, arc, half_turn, point_and_shoot};
use std::fmt::Write as _;

/// A way of dead reckoning: distances of both wheels and the track to `(x, y, theta)`.
type Reckon = fn(f64, f64, f64) -> (f64, f64, f64);

/// The distance between the wheels; the results do not depend on it.
const TRACK: f64 = 0.25;
const ANGLES: [f64; 6] = [1.0, 5.0, 10.0, 20.0, 45.0, 90.0];

/// The movements of the second table: speed of the middle of the axle at the start and at the end, and the turning
/// rates as multiples of their mean; the mean speed is 0.5 m/s and the duration 1 s.
const MOVEMENTS: [(&str, [f64; 2], [f64; 2]); 4] = [
    ("circle from rest", [0.0, 1.0], [0.0, 2.0]),
    ("spiral, v 0.25 to 0.75", [0.25, 0.75], [1.0, 1.0]),
    ("clothoid, ω from 0, v constant", [0.5, 0.5], [0.0, 2.0]),
    ("v from 0, ω to 0", [0.0, 1.0], [2.0, 0.0]),
];

/// The movement that turns by `angle` degrees.
fn wheels(v: [f64; 2], turning: [f64; 2], angle: f64) -> Wheels {
    let half = turning.map(|share| share * angle.to_radians() * TRACK / 2.0);
    let (v0l, v0r, v1l, v1r) = (v[0] - half[0], v[0] + half[0], v[1] - half[1], v[1] + half[1]);
    Wheels { v0l, v0r, v1l, v1r, duration: 1.0, track: TRACK }
}

/// What a way of dead reckoning misses by at the end of a movement cut into `samples`, as a share of the way.
fn miss(w: &Wheels, samples: u32, reckon: impl Fn(f64, f64, f64, Motion) -> (f64, f64, f64)) -> f64 {
    let distances = |t: f64| {
        let share = t / w.duration;
        let of = |v0: f64, v1: f64| (v0 + (v1 - v0) * share / 2.0) * t;
        (of(w.v0l, w.v1l), of(w.v0r, w.v1r))
    };
    let (mut x, mut y, mut theta) = (0.0, 0.0, 0.0_f64);
    for sample in 0..samples {
        let [from, to] = [sample, sample + 1].map(|k| w.duration * f64::from(k) / f64::from(samples));
        let ((l0, r0), (l1, r1)) = (distances(from), distances(to));
        let (dx, dy, turn) = reckon(l1 - l0, r1 - r0, to - from, w.at(from));
        let (sin, cos) = theta.sin_cos();
        x += cos * dx - sin * dy;
        y += sin * dx + cos * dy;
        theta += turn;
    }
    let end = w.end();
    (x - end.x).hypot(y - end.y) / end.path
}

fn simple(w: &Wheels, samples: u32, reckon: Reckon) -> f64 {
    miss(w, samples, |left, right, _, _| reckon(left, right, w.track))
}

fn with_accelerations(w: &Wheels, samples: u32) -> f64 {
    let rates = [(w.v1l - w.v0l) / w.duration, (w.v1r - w.v0r) / w.duration];
    miss(w, samples, |left, right, time, _| accelerated(left, right, rates, time, w.track))
}

/// Three digits; what is rounding error only is 0.
fn figure(miss: f64) -> String {
    if miss < 1e-14 { "0".into() } else { format!("{miss:.2e}") }
}

fn row(text: &mut String, name: &str, cells: impl Iterator<Item = String>) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "| {name} | {} |", cells.collect::<Vec<_>>().join(" | "));
}

/// The page.
pub(super) fn page() -> String {
    let mut text = format!(
        "# Dead reckoning\n\n{GENERATED}\nEncoders say how far each wheel rolled between two samples; dead reckoning says where \
         the robot is then. The tables show what each way of it misses by, as a share of the way driven.\n\n\
         - **arc**: the exact displacement at constant wheel speeds (Lucas, equation 5, without its singularity);\n\
         - **point-and-shoot**: the whole turn first, then straight (Lucas, equation 6);\n\
         - **half turn**: half of the turn, straight, the other half (Brown);\n\
         - **accelerated**: exact at constant wheel accelerations, taken from the samples before and after.\n\n\
         ## Constant speeds: one sample that turns by an angle\n\n"
    );
    let header = |text: &mut String, angles: &[f64]| {
        row(text, "", angles.iter().map(|angle| format!("{angle}°")));
        row(text, "---", angles.iter().map(|_| "---".into()));
    };
    header(&mut text, &ANGLES);
    let ways: [(&str, Reckon); 3] =
        [("point-and-shoot", point_and_shoot), ("half turn", half_turn), ("arc", arc)];
    for (name, reckon) in ways {
        let cell = |angle: &f64| figure(simple(&wheels([0.5; 2], [1.0; 2], *angle), 1, reckon));
        row(&mut text, name, ANGLES.iter().map(cell));
    }
    text.push_str(
        "\nThe error is a fixed rotation and scaling of each displacement, so that it vanishes on a closed circle: a full \
         circle proves nothing about an odometer.\n\n## Constant speeds: a quarter turn in samples of an angle\n\n",
    );
    let quarters = [(1.0, 90), (5.0, 18), (10.0, 9), (45.0, 2), (90.0, 1)];
    header(&mut text, &quarters.map(|(angle, _)| angle));
    for (name, reckon) in ways {
        let cell =
            |&(_, samples): &(f64, u32)| figure(simple(&wheels([0.5; 2], [1.0; 2], 90.0), samples, reckon));
        row(&mut text, name, quarters.iter().map(cell));
    }
    text.push_str(
        "\n## Changing speeds: one sample, fed with exact distances\n\nEach cell: arc / point-and-shoot / half turn / \
         accelerated.\n\n",
    );
    let angles = [1.0, 10.0, 45.0, 90.0];
    header(&mut text, &angles);
    for (name, v, turning) in MOVEMENTS {
        let cell = |angle: &f64| {
            let w = wheels(v, turning, *angle);
            let [a, p, h] =
                [arc as Reckon, point_and_shoot, half_turn].map(|reckon| figure(simple(&w, 1, reckon)));
            format!("{a} / {p} / {h} / {}", figure(with_accelerations(&w, 1)))
        };
        row(&mut text, name, angles.iter().map(cell));
    }
    text.push_str(
        "\nWhere speeds change within a sample the arc is only first order, and point-and-shoot may be nearer by luck of \
         sign. Sample fast, or use the accelerations. A movement cut into samples, a turn of 90° of the last row, by the \
         arc:\n\n",
    );
    let counts = [1, 2, 4, 8, 16, 32];
    row(&mut text, "samples", counts.iter().map(u32::to_string));
    row(&mut text, "---", counts.iter().map(|_| "---".into()));
    let (_, v, turning) = MOVEMENTS[3];
    let cut = |samples: &u32| figure(simple(&wheels(v, turning, 90.0), *samples, arc));
    row(&mut text, "arc", counts.iter().map(cut));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with a figure of model.md 5, to the digits that it has.
    fn check(found: f64, expected: f64, digits: i32, what: &str) {
        let allowed = if expected == 0.0 {
            1e-14
        } else {
            0.51 * 10f64.powi(1 - digits) * 10f64.powf(expected.log10().floor())
        };
        assert!((found - expected).abs() <= allowed, "{what}: {found:e} instead of {expected:e}");
    }

    #[test]
    fn constant_speeds_miss_by_what_the_model_says() {
        let shoot = [8.73e-3, 4.36e-2, 8.72e-2, 1.74e-1, 3.86e-1, 7.33e-1];
        let half = [1.27e-5, 3.17e-4, 1.27e-3, 5.07e-3, 2.55e-2, 9.97e-2];
        for (k, angle) in ANGLES.into_iter().enumerate() {
            let w = wheels([0.5; 2], [1.0; 2], angle);
            check(simple(&w, 1, point_and_shoot), shoot[k], 3, "point-and-shoot");
            check(simple(&w, 1, half_turn), half[k], 3, "half turn");
            check(simple(&w, 1, arc), 0.0, 3, "arc");
        }
        let quarter = wheels([0.5; 2], [1.0; 2], 90.0);
        for (samples, shoot, half) in [
            (90, 7.86e-3, 1.14e-5),
            (18, 3.93e-2, 2.86e-4),
            (9, 7.86e-2, 1.14e-3),
            (2, 3.57e-1, 2.36e-2),
            (1, 7.33e-1, 9.97e-2),
        ] {
            check(simple(&quarter, samples, point_and_shoot), shoot, 3, "quarter, point-and-shoot");
            check(simple(&quarter, samples, half_turn), half, 3, "quarter, half turn");
        }
    }

    #[test]
    fn changing_speeds_miss_by_what_the_model_says() {
        // The model rounds two of them generously: 0.25 for 0.24469, and 0.52 for 0.51475.
        let expected = [
            [[0.0, 8.7e-3, 1.3e-5], [0.0, 8.7e-2, 1.3e-3], [0.0, 0.39, 2.5e-2], [0.0, 0.73, 1.0e-1]],
            [[1.5e-3, 7.3e-3, 1.5e-3], [1.5e-2, 7.3e-2, 1.5e-2], [6.4e-2, 0.32, 6.9e-2], [0.12, 0.62, 0.16]],
            [[2.9e-3, 1.2e-2, 2.9e-3], [2.9e-2, 0.12, 2.9e-2], [0.13, 0.51, 0.13], [0.2447, 0.96, 0.28]],
            [[5.8e-3, 2.9e-3, 5.8e-3], [5.8e-2, 2.9e-2, 5.8e-2], [0.26, 0.13, 0.26], [0.49, 0.25, 0.5147]],
        ];
        for ((name, v, turning), rows) in MOVEMENTS.into_iter().zip(expected) {
            for (angle, cells) in [1.0, 10.0, 45.0, 90.0].into_iter().zip(rows) {
                let w = wheels(v, turning, angle);
                for (reckon, cell) in [arc as Reckon, point_and_shoot, half_turn].into_iter().zip(cells) {
                    check(simple(&w, 1, reckon), cell, 2, name);
                }
                assert!(with_accelerations(&w, 1) < 1e-14, "{name}");
            }
        }
    }

    #[test]
    fn twice_the_samples_are_four_times_as_exact() {
        let (_, v, turning) = MOVEMENTS[3];
        let w = wheels(v, turning, 90.0);
        let ratio = simple(&w, 64, arc) / simple(&w, 128, arc);
        assert!((ratio - 4.0).abs() < 0.05, "{ratio}");
    }
}
