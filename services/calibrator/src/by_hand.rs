//! Squares whose end a person measures: for robots without a gyroscope, or with one that is not to be trusted.
//!
//! This is the benchmark as its authors drove it (J. Borenstein and L. Feng, "UMBmark", 1995): the robot drives a square by
//! its odometry, to the left and to the right, and a person measures where it ends beside its start. Wheels of unequal
//! size bend the sides, and a wrong track opens or closes the corners; the first misses in opposite directions on the two
//! squares and the second in the same one, so that both are found. Instead of the approximations of the paper, the body is
//! fitted by which the counts of the wheels end where the person saw it, by the method of Gauss and Newton.

use crate::geometry::{Body, end};
use crate::statistics::least_squares;
use axle_schema::Sides;

/// What is to be asked of a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// To put the robot into the middle of its room and to mark where it stands, before a square to the left or right.
    Mark {
        /// To the left.
        left: bool,
    },
    /// Where the robot stands after the square, ahead and to the left of the mark, as it looked there.
    End {
        /// To the left.
        left: bool,
    },
}

/// A square that was driven.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Driven {
    pub(crate) left: bool,
    /// What the wheels have counted on each leg, m.
    pub(crate) legs: Vec<Sides<f64>>,
    /// Where it ended, ahead and to the left of its start, m.
    pub(crate) place: (f64, f64),
}

impl Driven {
    /// By how much odometry with this body misses the end, m.
    pub(crate) fn miss(&self, body: Body) -> (f64, f64) {
        let (x, y) = end(&self.legs, body);
        (x - self.place.0, y - self.place.1)
    }
}

/// Steps until nothing changes any more.
const STEPS: usize = 30;

/// The body by which these squares end where they did; `near` is the one that it is looked for around.
pub(crate) fn fit(squares: &[Driven], near: Body) -> Option<Body> {
    let misses = |body: Body| -> Vec<f64> {
        squares.iter().flat_map(|square| <[f64; 2]>::from(square.miss(body))).collect()
    };
    let moved =
        |body: Body, ratio: f64, track: f64| Body { ratio: body.ratio + ratio, track: body.track + track };
    let mut body = near;
    for _ in 0..STEPS {
        let step = 1e-5;
        let slopes = |high: Vec<f64>, low: Vec<f64>| -> Vec<f64> {
            high.iter().zip(low).map(|(high, low)| (high - low) / (2.0 * step)).collect()
        };
        let by_ratio = slopes(misses(moved(body, step, 0.0)), misses(moved(body, -step, 0.0)));
        let by_track = slopes(misses(moved(body, 0.0, step)), misses(moved(body, 0.0, -step)));
        let rows: Vec<[f64; 2]> =
            by_ratio.into_iter().zip(by_track).map(|(ratio, track)| [ratio, track]).collect();
        let targets: Vec<f64> = misses(body).iter().map(|miss| -miss).collect();
        let ([ratio, track], _) = least_squares(&rows, &targets)?;
        // A step that is too long leaves where the slopes are right.
        let most = 0.2 * near.track;
        body = moved(body, ratio.clamp(-0.1, 0.1), track.clamp(-most, most));
        let is_a_body = (0.5..2.0).contains(&body.ratio) && (0.5..2.0).contains(&(body.track / near.track));
        is_a_body.then_some(())?;
        if ratio.abs() < 1e-9 && track.abs() < 1e-9 {
            return Some(body);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 1 m by a robot that believes in this track.
    fn square(left: bool, believed: f64, truth: Body) -> Driven {
        let quarter = std::f64::consts::FRAC_PI_4 * believed * if left { 1.0 } else { -1.0 };
        let legs: Vec<Sides<f64>> =
            [Sides::new(1.0, 1.0), Sides::new(-quarter, quarter)].into_iter().cycle().take(8).collect();
        let place = end(&legs, truth);
        Driven { left, legs, place }
    }

    #[test]
    fn the_body_is_found_by_where_the_squares_end() {
        let near = Body { ratio: 1.0, track: 0.3 };
        for (ratio, track) in [(1.0, 0.3), (1.02, 0.3), (1.0, 0.32), (0.97, 0.285), (1.03, 0.33)] {
            let truth = Body { ratio, track };
            let squares = [square(true, 0.3, truth), square(false, 0.3, truth)];
            let found = fit(&squares, near).expect("a body");
            assert!((found.ratio - ratio).abs() < 1e-6 && (found.track - track).abs() < 1e-6, "{found:?}");
            assert!(squares[0].miss(found).0.abs() < 1e-6);
        }
    }

    #[test]
    fn the_approximation_of_the_paper_agrees_with_the_fit() {
        // E_d and E_b by the formulas of the paper, for small faults: alpha is that of the corners, beta of the sides.
        let truth = Body { ratio: 1.005, track: 0.303 };
        let [left, right] = [true, false].map(|is_left| square(is_left, 0.3, truth));
        // The paper drives clockwise and counter-clockwise, x along the first side.
        let (cw, ccw) = (right.place.0, left.place.0);
        let (alpha, beta) = ((cw + ccw) / -4.0, (cw - ccw) / -4.0);
        let radius = 0.5 / (beta / 2.0).sin();
        let unequal = (radius + 0.15) / (radius - 0.15);
        let base = std::f64::consts::FRAC_PI_2 / (std::f64::consts::FRAC_PI_2 - alpha);
        let found = fit(&[left, right], Body { ratio: 1.0, track: 0.3 }).expect("a body");
        assert!((found.track / 0.3 - base).abs() < 0.002, "{} and {base}", found.track / 0.3);
        assert!((found.ratio - unequal).abs() < 0.002, "{} and {unequal}", found.ratio);
    }

    #[test]
    fn ends_that_no_body_explains_give_none() {
        let near = Body { ratio: 1.0, track: 0.3 };
        let mut far = square(true, 0.3, near);
        far.place = (40.0, -30.0);
        assert_eq!(fit(&[far.clone(), far], near), None);
        assert_eq!(fit(&[], near), None);
        let still = Driven { left: true, legs: vec![Sides::default(); 8], place: (0.0, 0.0) };
        assert_eq!(fit(&[still], near), None);
    }
}
