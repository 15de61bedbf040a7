//! The service as a value: checks what it hears, and asks the method.

use crate::dead::Dead;
use crate::ekf::Ekf;
use crate::event::Event;
use crate::measurement::{Counts, Measurement, Position};
use crate::params::{Method, NavigatorParams};
use axle_schema::contract::Bounds as _;
use axle_schema::refusal::within;
use axle_schema::series::Datum as _;
use axle_schema::{
    EncodersData, EncodersSpan, Fix, NavigatorData, Numbers, Pose, RadiansPerSecond, Refusal, Seconds, Twist,
};
use nalgebra::Matrix3;

/// A stamp that goes back by more than this, in s, is of a robot that has restarted; by less, of an old reading.
const RESTART: f64 = 1.0;
/// A stamp that jumps ahead by more than this, in s, is of another clock.
const LEAP: f64 = 600.0;
/// How many times its largest speed a wheel is believed, since a description of a robot is never exact.
const BELIEF: f64 = 1.5;

#[derive(Clone, Debug)]
enum Keeper {
    Dead(Box<Dead>),
    Ekf(Box<Ekf>),
}

/// What a fix or a range thought of the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation {
    /// Of the measurement.
    pub stamp: Seconds,
    /// `ν'S⁻¹ν`: of mean `degrees` for an honest covariance.
    pub squared: f64,
    /// Degrees of freedom: 2 of a fix, 1 of a range.
    pub degrees: usize,
}

/// The service that knows where the robot is.
#[derive(Clone, Debug)]
pub struct Navigator {
    params: NavigatorParams,
    keeper: Keeper,
    last: Option<EncodersData>,
    counts: Counts,
}

impl Navigator {
    /// A navigator that waits for its first reading.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(params: NavigatorParams) -> Result<Self, Refusal> {
        params.check()?;
        let keeper = if params.method == Method::Ekf {
            Keeper::Ekf(Box::new(Ekf::new(&params)))
        } else {
            Keeper::Dead(Box::new(Dead::new(&params)))
        };
        Ok(Self { params, keeper, last: None, counts: Counts::default() })
    }

    /// Takes the next measurement; says the pose after encoder readings, or nothing for whatever is dropped or waits.
    ///
    /// Dead reckoning has no use for a gyro and for ranges; of fixes it takes none but "ticks", which a fix resets.
    pub fn measure(&mut self, measurement: &Measurement) -> Option<NavigatorData> {
        if !measurement.is_sound() {
            self.counts.stale += 1;
            return None;
        }
        match (measurement, &mut self.keeper) {
            (Measurement::Encoders(datum), _) => return self.take(*datum),
            (Measurement::Inertial(data), Keeper::Ekf(ekf)) => ekf.inertial(data, &mut self.counts),
            (Measurement::Fix(fix), Keeper::Ekf(ekf)) => ekf.fix(fix, &mut self.counts),
            (Measurement::Range(range), Keeper::Ekf(ekf)) => ekf.range(range, &mut self.counts),
            (Measurement::Fix(fix), Keeper::Dead(_)) if self.params.method == Method::Ticks => {
                self.reset(fix)
            }
            (_, Keeper::Dead(_)) => {}
        }
        None
    }

    /// Takes the next reading; says the pose at its stamp, or nothing for a reading that is dropped.
    ///
    /// The first reading is the anchor: the robot is then at `start`, whatever the wheels have covered before.
    pub fn take(&mut self, datum: EncodersData) -> Option<NavigatorData> {
        if !Measurement::Encoders(datum).is_sound() {
            self.counts.stale += 1;
            return None;
        }
        let since = self.last.map(|last| last.span_to(&datum));
        let restart = match &self.keeper {
            Keeper::Dead(_) => RESTART,
            Keeper::Ekf(_) => RESTART.max(self.params.ekf.window.0),
        };
        let leaps = since.is_some_and(|span| span.duration.0 < -restart || span.duration.0 > LEAP);
        self.counts.restarts += u64::from(leaps);
        match &mut self.keeper {
            Keeper::Ekf(ekf) => {
                if leaps {
                    ekf.restart(&datum);
                } else if !ekf.encoders(&datum, &mut self.counts) {
                    self.counts.stale += 1;
                    return None;
                }
                let is_newest = leaps || since.is_none_or(|span| span.duration.0 > 0.0);
                self.last = if is_newest { Some(datum) } else { self.last };
                ekf.data()
            }
            Keeper::Dead(dead) => {
                match (self.last, since) {
                    (Some(last), Some(span)) if !leaps => {
                        if span.duration.0 <= 0.0 {
                            self.counts.stale += 1;
                            return None;
                        }
                        if believes(&self.params, &span) {
                            dead.advance(&last, &datum, twist(&self.params, &span));
                        } else {
                            self.counts.jumps += 1;
                            dead.anchor(&datum);
                        }
                    }
                    _ => dead.anchor(&datum),
                }
                self.last = Some(datum);
                dead.data()
            }
        }
    }

    /// The robot was at `pose` in `map` at `stamp`: an absolute reference, such as a person's word or a docking station.
    /// Uncertainty restarts with `covariance` of (x, y, heading), row by row, and measurements before it are obsolete.
    /// `odom` goes on as before.
    ///
    /// # Errors
    /// Refuses a pose that no robot has, a covariance that is none, and a stamp that the memory does not reach.
    pub fn set_position(
        &mut self,
        stamp: Seconds,
        pose: Pose,
        covariance: &Numbers<9>,
    ) -> Result<(), Refusal> {
        pose.check()?;
        within("stamp in s", stamp.0, -1e9, 1e9)?;
        let p = Matrix3::from_row_slice(&covariance.0);
        let p = (p + p.transpose()) / 2.0;
        for (name, index) in [("x", 0), ("y", 1), ("heading", 2)] {
            within(&format!("variance of {name}"), p[(index, index)], 0.0, 1e9)?;
        }
        // The eigenvalues of a matrix with NaN would be sought for ever.
        if !p.iter().all(|value| value.is_finite()) || p.symmetric_eigenvalues().min() < -1e-9 * p.amax() {
            return Err(Refusal::malformed("covariance", "it is not positive semidefinite"));
        }
        let is_set = match &mut self.keeper {
            Keeper::Dead(dead) => dead.set(stamp.0, pose, &p),
            Keeper::Ekf(ekf) => ekf.set(stamp.0, pose, &p),
        };
        if is_set {
            Ok(())
        } else {
            Err(Refusal::out_of_range("stamp of the position", stamp, "a stamp of the last seconds"))
        }
    }

    /// A fix resets the position of the warehouse's method; the heading too where the fix knows it.
    fn reset(&mut self, fix: &Fix) {
        let Keeper::Dead(dead) = &mut self.keeper else { return };
        let p = dead.position().map_or([0.0; 9], |position| position.map_covariance.0);
        let Numbers([xx, xy, _, yy]) = fix.covariance;
        let heading = fix.heading.map_or_else(
            || (dead.poses_at(fix.stamp.0).map_or(self.params.start, |(_, map)| map).heading, p[8]),
            |heading| (heading.angle, heading.variance),
        );
        let covariance = Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, heading.1);
        if !dead.set(fix.stamp.0, Pose { x: fix.x, y: fix.y, heading: heading.0 }, &covariance) {
            self.counts.stale += 1;
        }
    }

    /// Where the robot is in both frames; nothing before the first reading.
    #[must_use]
    pub fn position(&self) -> Option<Position> {
        match &self.keeper {
            Keeper::Dead(dead) => dead.position(),
            Keeper::Ekf(ekf) => ekf.position(),
        }
    }

    /// Where the robot was in `odom` and in `map`, at a stamp of the last seconds; before them and after them it is where it
    /// was at their end.
    #[must_use]
    pub fn poses_at(&self, stamp: Seconds) -> Option<(Pose, Pose)> {
        match &self.keeper {
            Keeper::Dead(dead) => dead.poses_at(stamp.0),
            Keeper::Ekf(ekf) => ekf.poses_at(stamp.0),
        }
    }

    /// What was noticed since the last call.
    pub fn events(&mut self) -> Vec<Event> {
        match &mut self.keeper {
            Keeper::Dead(_) => Vec::new(),
            Keeper::Ekf(ekf) => ekf.events(),
        }
    }

    /// What the fixes and ranges since the last call thought of the pose.
    pub fn innovations(&mut self) -> Vec<Innovation> {
        match &mut self.keeper {
            Keeper::Dead(_) => Vec::new(),
            Keeper::Ekf(ekf) => ekf.innovations(),
        }
    }

    /// The gyro's bias in rad/s, and the relative errors of left radius, right radius and track, as far as they are known.
    #[must_use]
    pub fn measures(&self) -> Option<[f64; 4]> {
        match &self.keeper {
            Keeper::Dead(_) => None,
            Keeper::Ekf(ekf) => ekf.measures(),
        }
    }

    /// How often a measurement was not simply the next one.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }
}

/// Whether both wheels can have come that far.
fn believes(params: &NavigatorParams, span: &EncodersSpan) -> bool {
    let reach = BELIEF * params.robot.wheel_speed.0 * span.duration.0 + params.jump.0;
    span.left.0.abs() <= reach && span.right.0.abs() <= reach
}

/// The mean twist of the span; none where the interval is too short to tell.
fn twist(params: &NavigatorParams, span: &EncodersSpan) -> Option<Twist> {
    let [left, right] = span.sides().map(|distance| distance / span.duration).both();
    let v = (left + right) / 2.0;
    let omega = RadiansPerSecond((right - left).0 / params.robot.track.get());
    (v.is_finite() && omega.is_finite()).then_some(Twist { v, omega })
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Metres;
    use axle_schema::contract::Params as _;
    use axle_schema::{Message as _, MetresPerSecond};

    fn at(stamp: f64, left: f64, right: f64) -> EncodersData {
        EncodersData { stamp: Seconds(stamp), left: Metres(left), right: Metres(right) }
    }
    fn navigator() -> Navigator {
        Navigator::new(NavigatorParams::default()).expect("the defaults are within their ranges")
    }

    #[test]
    fn the_parameter_file_holds_the_defaults() {
        let read: NavigatorParams = toml::from_str(NavigatorParams::FILE).expect("the file is valid");
        assert_eq!(read, NavigatorParams::default());
        let written = toml::Table::try_from(NavigatorParams::default()).expect("parameters are a table");
        let table: toml::Table = toml::from_str(NavigatorParams::FILE).expect("the file is a table");
        assert_eq!(table, written, "the file lists every field");
        let wrong = NavigatorParams { k: Metres(f64::NAN), ..NavigatorParams::default() };
        assert!(Navigator::new(wrong).expect_err("NaN is no noise").to_string().contains("k in m"));
    }

    #[test]
    fn the_first_reading_is_the_anchor() {
        let start = Pose::new(1.0, 2.0, 0.5);
        let mut navigator =
            Navigator::new(NavigatorParams { start, ..NavigatorParams::default() }).expect("valid");
        let first = navigator.take(at(7.0, 100.0, -30.0)).expect("a first pose");
        assert_eq!((first.pose, first.stamp, first.twist), (start, Seconds(7.0), None));
        assert_eq!(first.covariance, Some(Numbers([0.0; 9])));
    }

    #[test]
    fn a_quarter_of_a_circle_ends_where_the_arithmetic_says() {
        // Radius 0.5 m, 90 degrees to the left, track 0.3 m: wheels on 0.35 m and 0.65 m, in 20 readings of 0.1 s.
        let mut navigator = navigator();
        let mut last = None;
        for n in 0..=20 {
            let angle = f64::from(n) / 20.0 * std::f64::consts::FRAC_PI_2;
            last = navigator.take(at(f64::from(n) * 0.1, 0.35 * angle, 0.65 * angle));
        }
        let last = last.expect("a pose");
        assert!(
            (last.pose.x.0 - 0.5).abs() < 1e-12 && (last.pose.y.0 - 0.5).abs() < 1e-12,
            "{:?}",
            last.pose
        );
        let twist = last.twist.expect("a twist");
        let rate = std::f64::consts::FRAC_PI_2 / 2.0;
        assert!((twist.omega.0 - rate).abs() < 1e-9 && (twist.v.0 - 0.5 * rate).abs() < 1e-9, "{twist:?}");
        assert!(last.check().is_ok(), "the datum may be sent");
    }

    #[test]
    fn a_repeated_an_older_and_a_broken_reading_are_dropped_and_counted() {
        let mut navigator = navigator();
        assert!(navigator.take(at(5.0, 0.0, 0.0)).is_some());
        for wrong in
            [at(5.0, 0.01, 0.01), at(4.5, 0.01, 0.01), at(f64::NAN, 0.0, 0.0), at(6.0, f64::INFINITY, 0.0)]
        {
            assert_eq!(navigator.take(wrong), None, "{wrong:?}");
        }
        assert_eq!(navigator.counts(), Counts { stale: 4, ..Counts::default() });
        let next = navigator.take(at(5.1, 0.02, 0.02)).expect("the next reading counts");
        assert!((next.pose.x.0 - 0.02).abs() < 1e-15);
    }

    #[test]
    fn a_restarted_robot_goes_on_from_where_it_was() {
        let mut navigator = navigator();
        let _ = navigator.take(at(100.0, 0.0, 0.0));
        let _ = navigator.take(at(100.1, 0.05, 0.05));
        let again = navigator.take(at(0.0, 0.0, 0.0)).expect("a new anchor");
        assert!((again.pose.x.0 - 0.05).abs() < 1e-15 && again.twist.is_none());
        let next = navigator.take(at(0.1, 0.01, 0.01)).expect("motion from there");
        assert!((next.pose.x.0 - 0.06).abs() < 1e-15);
        assert_eq!(navigator.counts(), Counts { restarts: 1, ..Counts::default() });
    }

    #[test]
    fn a_reading_that_no_wheel_can_have_made_moves_nothing() {
        let mut navigator = navigator();
        let _ = navigator.take(at(0.0, 0.0, 0.0));
        // 1.5 times 1 m/s for 0.1 s and 0.05 m are 0.2 m.
        let jumped = navigator.take(at(0.1, 0.21, 0.0)).expect("a new anchor");
        assert_eq!((jumped.pose, jumped.twist), (Pose::default(), None));
        let next = navigator.take(at(0.2, 0.22, 0.01)).expect("motion from there");
        assert!((next.pose.x.0 - 0.01).abs() < 1e-15, "{:?}", next.pose);
        assert_eq!(next.twist.map(|twist| (twist.v - MetresPerSecond(0.1)).0.abs() < 1e-12), Some(true));
        assert_eq!(navigator.counts(), Counts { jumps: 1, ..Counts::default() });
    }
}
