//! The smooth driver: the turn rate follows the angle between heading and field, and the speed its cosine.

use crate::follow::{Aim, Way};
use crate::w::field::Flow;
use axle_schema::Radians;

/// model.md 4.6, with its symbols: ω = kψ·(ψ - φ), v = w·max(0, cos(ψ - φ)); the bend of the field is driven ahead of
/// the angle, since on a circle the robot would lag behind it by ω/kψ otherwise.
pub(crate) fn drive(k_psi: f64, flow: Flow, way: &Way<'_>) -> Aim {
    let off = Radians(flow.psi - way.pose.heading.0).wrapped().0;
    let most = way.rules.turn_rate();
    let v = flow.w * off.cos().max(0.0);
    Aim { v, omega: (v * flow.bend + k_psi * off).clamp(-most, most), off }
}
