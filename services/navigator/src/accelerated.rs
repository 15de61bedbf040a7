//! The method "accelerated": each span is the exact movement at constant accelerations of the wheels.
//!
//! The accelerations come from the spans before and after (`axle_schema::motion::slope`). The newest span has none after
//! it: it is reckoned with what is known, and again when the next reading has come; so a pose is final one reading
//! later. Where the speeds do not change this is the arc.

use axle_schema::motion::{accelerated, slope};
use axle_schema::{EncodersSpan, Metres};

use crate::reckoning::Reckoning;

/// Dead reckoning that looks one span back and one ahead.
#[derive(Clone, Debug)]
pub(crate) struct Accelerated {
    /// Up to the beginning of the newest span.
    settled: Reckoning,
    /// Up to its end.
    newest: Reckoning,
    before: Option<EncodersSpan>,
    here: Option<EncodersSpan>,
}

impl Accelerated {
    pub(crate) fn new(start: Reckoning) -> Self {
        Self { settled: start.clone(), newest: start, before: None, here: None }
    }

    pub(crate) fn advance(&mut self, span: &EncodersSpan, track: f64, k: Metres) {
        if let Some(here) = self.here {
            self.settled.advance(step(self.before.as_ref(), &here, Some(span), track), &here, track, k);
        }
        self.before = self.here.replace(*span);
        self.newest = self.settled.clone();
        self.newest.advance(step(self.before.as_ref(), span, None, track), span, track, k);
    }

    /// Motion counts from a new reading: no span is a neighbour of what came before.
    pub(crate) fn anchor(&mut self) {
        self.settled = self.newest.clone();
        (self.before, self.here) = (None, None);
    }

    pub(crate) const fn newest(&self) -> &Reckoning {
        &self.newest
    }
}

fn step(
    before: Option<&EncodersSpan>,
    here: &EncodersSpan,
    after: Option<&EncodersSpan>,
    track: f64,
) -> (f64, f64, f64) {
    let acceleration = |distance: fn(&EncodersSpan) -> Metres| {
        let mean = |span: &EncodersSpan| (distance(span).0 / span.duration.0, span.duration.0);
        slope(before.map(mean), mean(here), after.map(mean))
    };
    let accelerations = [acceleration(|span| span.left), acceleration(|span| span.right)];
    accelerated(here.left.0, here.right.0, accelerations, here.duration.0, track)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axle_schema::motion::Wheels;
    use axle_schema::{Pose, Seconds};
    use nalgebra::Matrix3;

    #[test]
    fn a_clothoid_is_followed_where_the_arc_misses() {
        let wheels = Wheels { v0l: 0.2, v0r: 0.5, v1l: 1.0, v1r: 0.6, duration: 2.0, track: 0.3 };
        let start = Reckoning::new(Pose::default(), Matrix3::zeros());
        let (mut ours, mut arc) = (Accelerated::new(start.clone()), start);
        let covered = |t: f64| [0.2 * t + 0.2 * t * t, 0.5 * t + 0.025 * t * t];
        for n in 0..10 {
            let [from, to] = [covered(f64::from(n) * 0.2), covered(f64::from(n + 1) * 0.2)];
            let span = EncodersSpan {
                duration: Seconds(0.2),
                left: Metres(to[0] - from[0]),
                right: Metres(to[1] - from[1]),
            };
            ours.advance(&span, 0.3, Metres(0.0));
            arc.advance(crate::arc::STEP(span.left.0, span.right.0, 0.3), &span, 0.3, Metres(0.0));
        }
        let end = wheels.end();
        let truth = Pose::new(end.x, end.y, end.theta);
        let (ours, arc) = (ours.newest().pose().distance(truth).0, arc.pose().distance(truth).0);
        assert!(ours < 1e-12, "missed by {ours} m");
        assert!(arc > 1e-4, "the arc misses by {arc} m: else this proves nothing");
    }
}
