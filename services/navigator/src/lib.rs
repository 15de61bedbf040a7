//! Navigator: where the robot is.
//!
//! Hears [`EncodersData`] in the order of its stamps, says [`NavigatorData`] in the frame `odom` (REP-105): the pose,
//! the twist and the covariance at each reading (paper, section II: "simple integration or Kalman's filter").
//!
//! When something fails, the pose stays and is never made up: a reading that is old or not finite is dropped, and
//! after a restart of the robot or a reading that no wheel can have made the next motion counts from the new reading.
//! All three are counted. Each method is one file; a new one is that file, a variant of [`Method`] and a line here.

use axle_schema::contract::{Bounds, Params};
use axle_schema::refusal::within;
use axle_schema::series::Datum as _;
use axle_schema::way::MAX_COORDINATE;
use axle_schema::{
    Drivetrain, EncodersData, EncodersSpan, Metres, NavigatorData, Numbers, Pose, RadiansPerSecond, Refusal,
    Twist,
};
use serde::{Deserialize, Serialize};

mod arc;
use arc::Arc;

/// A stamp that goes back by more than this, in s, is of a robot that has restarted; by less, of an old reading.
const RESTART: f64 = 1.0;
/// How many times its largest speed a wheel is believed, since a description of a robot is never exact.
const BELIEF: f64 = 1.5;

/// How measurements become poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The exact arc between two encoder readings.
    #[default]
    Arc,
}

/// Parameters of the navigator: `deploy/params/navigator.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NavigatorParams {
    /// How measurements become poses.
    pub method: Method,
    /// Noise of a wheel: its distance has a variance of `k` for every metre it covers, 0 to 1 m (model.md 6.1).
    pub k: Metres,
    /// How much farther than its speed allows a wheel may seem to have come between two readings, 0.001 to 10 m.
    pub jump: Metres,
    /// Where the robot is at the first reading, in `odom`.
    pub start: Pose,
    /// The robot: its track and its largest wheel speed.
    pub robot: Drivetrain,
}

impl Default for NavigatorParams {
    fn default() -> Self {
        Self {
            method: Method::default(),
            k: Metres(1e-4),
            jump: Metres(0.05),
            start: Pose::default(),
            robot: Drivetrain::default(),
        }
    }
}

impl Bounds for NavigatorParams {
    fn check(&self) -> Result<(), Refusal> {
        within("k in m", self.k.0, 0.0, 1.0)?;
        within("jump in m", self.jump.0, 1e-3, 10.0)?;
        within("start.x in m", self.start.x.0, -MAX_COORDINATE, MAX_COORDINATE)?;
        within("start.y in m", self.start.y.0, -MAX_COORDINATE, MAX_COORDINATE)?;
        within("start.heading in rad", self.start.heading.0, -1e4, 1e4)?;
        self.robot.check()
    }
}

impl Params for NavigatorParams {
    const FILE: &'static str = include_str!("../../../deploy/params/navigator.toml");
}

/// How often a reading was not simply the next one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Readings that were dropped: repeated, older than the last one, or not finite.
    pub stale: u64,
    /// Stamps that went back by more than 1 s: the robot restarted.
    pub restarts: u64,
    /// Readings that no wheel can have made.
    pub jumps: u64,
}

/// The service that knows where the robot is.
#[derive(Clone, Debug)]
pub struct Navigator {
    params: NavigatorParams,
    arc: Arc,
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
        let arc = match params.method {
            Method::Arc => Arc::new(params.start),
        };
        Ok(Self { params, arc, last: None, counts: Counts::default() })
    }

    /// Takes the next reading; says the pose at its stamp, or nothing for a reading that is dropped.
    ///
    /// The first reading is the anchor: the robot is then at `start`, whatever the wheels have covered before.
    pub fn take(&mut self, datum: EncodersData) -> Option<NavigatorData> {
        if !(datum.stamp.is_finite() && datum.left.is_finite() && datum.right.is_finite()) {
            self.counts.stale += 1;
            return None;
        }
        let mut twist = None;
        if let Some(last) = self.last {
            let span = last.span_to(&datum);
            if span.duration.0 > 0.0 {
                if self.believes(&span) {
                    self.arc.advance(&span, self.params.robot.track, self.params.k);
                    twist = self.twist(&span);
                } else {
                    self.counts.jumps += 1;
                }
            } else if span.duration.0 < -RESTART {
                self.counts.restarts += 1;
            } else {
                self.counts.stale += 1;
                return None;
            }
        }
        self.last = Some(datum);
        let covariance = Some(Numbers(self.arc.covariance()));
        Some(NavigatorData { stamp: datum.stamp, pose: self.arc.pose(), twist, covariance })
    }

    /// How often a reading was not simply the next one.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether both wheels can have come that far.
    fn believes(&self, span: &EncodersSpan) -> bool {
        let reach = BELIEF * self.params.robot.wheel_speed.0 * span.duration.0 + self.params.jump.0;
        span.left.0.abs() <= reach && span.right.0.abs() <= reach
    }

    /// The mean twist of the span; none where the interval is too short to tell.
    fn twist(&self, span: &EncodersSpan) -> Option<Twist> {
        let [left, right] = span.sides().map(|distance| distance / span.duration).both();
        let v = (left + right) / 2.0;
        let omega = RadiansPerSecond((right - left).0 / self.params.robot.track.get());
        (v.is_finite() && omega.is_finite()).then_some(Twist { v, omega })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::{Message as _, MetresPerSecond, Seconds};

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
