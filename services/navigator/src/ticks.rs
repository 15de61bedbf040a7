//! The method "ticks": a log of ticks for each wheel, brought to an instant that both wheels have reached.
//!
//! *Source*: the warehouse article's position keeping, repaired (model.md, errata 22 and 23). Its encoders tell of a
//! tick when it comes, so that a slow wheel's reading is older than it looks. Here each wheel keeps its last two ticks;
//! up to `tc`, the older of both last ticks, both readings are interpolated, and the pose is committed there from the
//! **stored** readings of the last commit. What came after is reckoned from the commit again at every reading. So the
//! spans telescope: no part of a tick is lost or counted twice, whatever the rate. There is no threshold below which
//! the robot would go straight.
//!
//! A wheel without a tick for [`REGISTER`] stands: that counts as a tick of its own.

use crate::reckoning::Reckoning;
use axle_schema::{EncodersData, EncodersSpan, Metres, Seconds, Sides};

/// A wheel that has said nothing new for so long, in s, stands: the warehouse's delay.
const REGISTER: f64 = 1.0;

/// The last two ticks of a wheel: stamp in s and reading in m.
#[derive(Clone, Copy, Debug)]
struct Encoder {
    last: (f64, f64),
    newest: (f64, f64),
}

impl Encoder {
    const fn new(tick: (f64, f64)) -> Self {
        Self { last: tick, newest: tick }
    }

    #[allow(clippy::float_cmp, reason = "a tick is any change of the reading")]
    fn hear(&mut self, stamp: f64, reading: f64) {
        if reading != self.newest.1 || stamp > self.newest.0 + REGISTER {
            self.last = std::mem::replace(&mut self.newest, (stamp, reading));
        }
    }

    /// The reading at an instant from the last tick but one to the last one.
    fn reading_at(&self, stamp: f64) -> f64 {
        let ((from, low), (to, high)) = (self.last, self.newest);
        if stamp >= to || to <= from { high } else { low + (high - low) * ((stamp - from) / (to - from)) }
    }
}

/// Dead reckoning between instants that both wheels have reached.
#[derive(Clone, Debug)]
pub(crate) struct Ticks {
    /// The pose at the anchor.
    committed: Reckoning,
    /// Stamp, and the readings that the anchor was committed with.
    anchor: Option<(f64, Sides<Metres>)>,
    encoders: Option<Sides<Encoder>>,
    newest: Reckoning,
}

impl Ticks {
    pub(crate) fn new(start: Reckoning) -> Self {
        Self { committed: start.clone(), anchor: None, encoders: None, newest: start }
    }

    /// Motion counts from this reading.
    pub(crate) fn anchor(&mut self, datum: &EncodersData) {
        let stamp = datum.stamp.0;
        self.committed = self.newest.clone();
        self.anchor = Some((stamp, datum.sides()));
        self.encoders = Some(datum.sides().map(|reading| Encoder::new((stamp, reading.0))));
    }

    pub(crate) fn advance(&mut self, datum: &EncodersData, track: f64, k: Metres) {
        let (Some(encoders), Some((from, stored))) = (&mut self.encoders, self.anchor) else {
            return self.anchor(datum);
        };
        encoders.left.hear(datum.stamp.0, datum.left.0);
        encoders.right.hear(datum.stamp.0, datum.right.0);
        // A wheel may have ticked several times since the other one did; its own last two ticks then do not reach back
        // to the common instant's beginning, but `tc` lies between them, for it is the other wheel's newest tick or ours.
        let tc = encoders.left.newest.0.min(encoders.right.newest.0);
        if tc > from && encoders.left.last.0 <= tc && encoders.right.last.0 <= tc {
            let there = encoders.map(|encoder| Metres(encoder.reading_at(tc)));
            reckon(&mut self.committed, tc - from, stored, there, track, k);
            self.anchor = Some((tc, there));
        }
        self.newest = self.committed.clone();
        if let Some((from, stored)) = self.anchor {
            reckon(&mut self.newest, datum.stamp.0 - from, stored, datum.sides(), track, k);
        }
    }

    pub(crate) const fn newest(&self) -> &Reckoning {
        &self.newest
    }
}

fn reckon(
    pose: &mut Reckoning,
    duration: f64,
    from: Sides<Metres>,
    to: Sides<Metres>,
    track: f64,
    k: Metres,
) {
    let Sides { left, right } = to.zip(from, |to, from| to - from);
    let span = EncodersSpan { duration: Seconds(duration), left, right };
    pose.advance(crate::arc::STEP(left.0, right.0, track), &span, track, k);
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::Pose;
    use nalgebra::Matrix3;

    /// Model.md, erratum 23: 60 s, wheels 39 cm apart, ticks of 1.3 cm, a poll every 80 ms.
    fn drive(left: f64, right: f64) -> (Pose, Pose) {
        const TICK: f64 = 0.013;
        let mut ticks = Ticks::new(Reckoning::new(Pose::default(), Matrix3::zeros()));
        let mut truth = Reckoning::new(Pose::default(), Matrix3::zeros());
        let mut counted = Sides::new(Metres(0.0), Metres(0.0));
        for poll in 0..=750 {
            let t = f64::from(poll) * 0.08;
            let reading = |rate: f64| Metres((rate * t).floor() * TICK);
            counted = Sides::new(reading(left), reading(right));
            ticks.advance(
                &EncodersData { stamp: Seconds(t), left: counted.left, right: counted.right },
                0.39,
                Metres(1e-4),
            );
        }
        // At constant speeds the whole is one arc; what the encoders counted is all that anybody can know.
        let whole = EncodersSpan { duration: Seconds(60.0), left: counted.left, right: counted.right };
        truth.advance(crate::arc::STEP(counted.left.0, counted.right.0, 0.39), &whole, 0.39, Metres(1e-4));
        (ticks.newest().pose(), truth.pose())
    }

    #[test]
    fn no_part_of_a_tick_is_lost() {
        for (left, right) in [(7.3, 7.6), (3.1, 3.7), (7.6, 7.3), (0.7, 5.0), (0.0, 4.0)] {
            let (ours, truth) = drive(left, right);
            // The distances telescope, so the heading is exact; the article's update misses by 25 to 115 degrees.
            let heading = (ours.heading - truth.heading).0.abs();
            assert!(heading < 1e-9, "{left}/{right} ticks/s: the heading is off by {heading} rad");
            let off = ours.distance(truth).0;
            assert!(
                off < 0.02,
                "{left}/{right} ticks/s: off by {off} m, more than the ticks that are counted in"
            );
        }
    }

    #[test]
    fn a_wheel_that_stands_does_not_hold_the_other_back() {
        let mut ticks = Ticks::new(Reckoning::new(Pose::default(), Matrix3::zeros()));
        for n in 0..100 {
            let t = f64::from(n) * 0.1;
            ticks.advance(
                &EncodersData { stamp: Seconds(t), left: Metres(0.0), right: Metres(0.05 * t) },
                0.3,
                Metres(1e-4),
            );
        }
        let (committed, _) = ticks.anchor.expect("an anchor");
        assert!(committed > 8.5, "the anchor stayed at {committed} s");
    }
}
