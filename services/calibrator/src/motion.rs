//! The movements of the procedure: speeds along lines of time, distances under control, slow ramps, and rest.
//!
//! All of them are setpoints of the two wheels in "nominal" metres per second: shares of the full signal.

use axle_schema::Sides;

/// A movement.
#[derive(Clone, Debug)]
pub(crate) enum Motion {
    /// Nothing for so many seconds.
    Rest(f64),
    /// Setpoints along straight lines between these times.
    Lines(Vec<(f64, Sides<f64>)>),
    /// Setpoints that grow slowly from these, at this rate, until both wheels have counted `least`, or up to `most`.
    Ramp { from: Sides<f64>, rate: f64, direction: f64, least: f64, most: f64 },
    /// A turn on the spot until the robot looks in this direction, rad; it becomes a [`Motion::Go`] when it begins.
    Face(f64),
    /// Distances to be counted by the wheels, with this speed and acceleration for the one that goes farther.
    Go { distances: Sides<f64>, speed: f64, acceleration: f64 },
}

/// What the robot shall do, in the units of its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wish {
    /// Setpoints as they are.
    Setpoints(Sides<f64>),
    /// Speeds of the wheels, by what is known of the motors.
    Speeds(Sides<f64>),
    /// It is over.
    Over,
}

/// Speed for each metre that a wheel is behind, 1/s.
const FEEDBACK: f64 = 3.0;
/// After the end of a movement its last deviation may be worked off for so long, s.
const TAIL: f64 = 0.3;

impl Motion {
    /// The wish at `time` since the movement began, when the wheels have counted `counted` since.
    pub(crate) fn at(&self, time: f64, counted: Sides<f64>) -> Wish {
        match self {
            Self::Rest(length) if time < *length => Wish::Setpoints(Sides::default()),
            Self::Lines(points) if time < points.last().map_or(0.0, |point| point.0) => {
                Wish::Setpoints(along(points, time))
            }
            Self::Ramp { from, rate, direction, least, most } => {
                let moved = counted.map(|counted| counted.abs() >= *least);
                let level = from.map(|from| (from + rate * time).min(*most));
                let is_over = (moved.left && moved.right) || level.both().iter().all(|level| level >= most);
                if is_over { Wish::Over } else { Wish::Setpoints(level.map(|level| level * direction)) }
            }
            Self::Go { distances, speed, acceleration } => {
                let longest = distances.left.abs().max(distances.right.abs());
                let (due, rate, end) = trapezoid(longest, *speed, *acceleration, time);
                if longest <= 0.0 || time >= end + TAIL {
                    return Wish::Over;
                }
                let wish = distances.zip(counted, |distance, counted| {
                    let share = distance / longest;
                    rate * share + FEEDBACK * (due * share - counted)
                });
                Wish::Speeds(wish)
            }
            Self::Rest(_) | Self::Lines(_) | Self::Face(_) => Wish::Over,
        }
    }
}

fn along(points: &[(f64, Sides<f64>)], time: f64) -> Sides<f64> {
    let after = points.partition_point(|point| point.0 <= time);
    let (Some(to), Some(from)) =
        (points.get(after), after.checked_sub(1).and_then(|before| points.get(before)))
    else {
        return Sides::default();
    };
    let share = (time - from.0) / (to.0 - from.0);
    from.1.zip(to.1, |from, to| from + (to - from) * share)
}

/// Distance, speed, and the end of a way from rest to rest with at most this speed and acceleration.
fn trapezoid(way: f64, speed: f64, acceleration: f64, time: f64) -> (f64, f64, f64) {
    let peak = speed.min((way * acceleration).sqrt());
    if peak <= 0.0 {
        return (0.0, 0.0, 0.0);
    }
    let up = peak / acceleration;
    let steady = (way / peak - up).max(0.0);
    let end = 2.0 * up + steady;
    let left = end - time;
    if time >= end {
        (way, 0.0, end)
    } else if time < up {
        (acceleration * time * time / 2.0, acceleration * time, end)
    } else if left < up {
        (way - acceleration * left * left / 2.0, acceleration * left, end)
    } else {
        (peak * (time - up / 2.0), peak, end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_ends_where_it_shall_without_a_jump() {
        for way in [0.01, 0.3, 2.0] {
            let (_, _, end) = trapezoid(way, 0.4, 0.8, 0.0);
            let mut last = (0.0, 0.0);
            for step in 0..=1000_u32 {
                let (distance, speed, _) = trapezoid(way, 0.4, 0.8, end * f64::from(step) / 1000.0);
                assert!(
                    distance >= last.0 - 1e-12 && (speed - last.1).abs() < 0.01,
                    "{way}: {distance}, {speed}"
                );
                last = (distance, speed);
            }
            assert!((last.0 - way).abs() < 1e-9 && last.1.abs() < 1e-9);
        }
    }

    #[test]
    fn a_ramp_ends_when_both_wheels_have_moved() {
        let ramp = Motion::Ramp {
            from: Sides::new(0.01, 0.02),
            rate: 0.1,
            direction: -1.0,
            least: 0.001,
            most: 0.5,
        };
        let Wish::Setpoints(level) = ramp.at(0.1, Sides::new(0.0, -0.1)) else { panic!("it goes on") };
        assert!((level.left + 0.02).abs() < 1e-12 && (level.right + 0.03).abs() < 1e-12, "{level:?}");
        assert_eq!(ramp.at(0.1, Sides::new(-0.002, -0.1)), Wish::Over);
        assert_eq!(ramp.at(60.0, Sides::default()), Wish::Over);
    }
}
