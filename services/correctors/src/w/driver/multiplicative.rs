//! The paper's driver: at every beat the speed is multiplied or divided by a factor, and the turn rate goes up or down
//! by a step.
//!
//! It is repaired in three places (model.md, erratum 13). The speed leaves rest by a floor, since no factor makes
//! anything of 0. The steps are steps of the turn rate: the paper's torsion, the quotient of the wheel speeds, has no
//! value where a wheel stands, and turns the other way when the robot drives backward. And the driver looks at the side
//! on which the field will be `foresight` later, by the turn rate of the moment: a rule that only knows the side of now
//! swings for ever, as a pendulum that is pushed towards its middle does.

use crate::follow::{Aim, Way};
use crate::w::WParams;
use crate::w::field::Flow;
use axle_schema::{Radians, Seconds};

/// The time for which the factor and the step are given, s.
const GIVEN: f64 = 0.05;

/// The driver for beats of one length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Multiplicative {
    /// c_v of the paper: the factor of the speed.
    c_v: f64,
    /// c_q: the step of the turn rate, rad/s.
    c_q: f64,
    foresight: f64,
    zone: f64,
    floor: f64,
}

impl Multiplicative {
    /// The driver with the factor and the step of a beat.
    pub(crate) fn of(params: &WParams, period: Seconds) -> Self {
        let beats = period.0 / GIVEN;
        Self {
            c_v: params.factor.powf(beats),
            c_q: params.step.0 * beats,
            foresight: params.foresight.0,
            zone: params.zone.0,
            floor: params.floor.0,
        }
    }

    /// The next speed and turn rate; with the symbols of the paper, III.C.
    pub(crate) fn drive(&self, flow: Flow, way: &Way<'_>) -> Aim {
        let (v, omega) = (way.twist.v.0, way.twist.omega.0);
        let off = Radians(flow.psi - way.pose.heading.0).wrapped().0;
        let w = flow.w * off.cos().max(0.0);
        // Not beyond the field: the paper's speed leaps to and fro around it.
        let v = if v < w { (v * self.c_v).max(self.floor).min(w) } else { (v / self.c_v).max(w) };
        let later = off - (omega - v * flow.bend) * self.foresight;
        let omega = if later.abs() <= self.zone {
            omega
        } else {
            // The last step is a short one, or the robot would tremble.
            omega + (later / self.foresight.max(GIVEN)).clamp(-self.c_q, self.c_q)
        };
        let most = way.rules.turn_rate();
        Aim { v, omega: omega.clamp(-most, most), off }
    }
}
