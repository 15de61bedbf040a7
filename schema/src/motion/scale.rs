//! The motion of a DWM with numbers of extreme size, through units of length and time that make them
//! moderate.
//!
//! A robot never needs this. It is here so that a wild but finite number cannot become a `NaN` that spreads.

use super::double_double::DoubleDouble;
use super::stretch::Stretch;
use super::{Motion, Wheels};

/// [`Wheels::at`] for finite numbers of any size, with `time` in `[0, duration]`.
///
/// Every power of two below is a change of units, which is exact: the unit of speed is about the largest
/// wheel speed, the unit of time about `time`, and the unit of length their product. A number that is smaller
/// than the unit of its kind by more than a factor of 2^1000 is lost.
#[cold]
pub(super) fn motion(wheels: &Wheels, time: f64) -> Motion {
    let at_end = time >= wheels.duration;
    let speeds = wheels.speeds();
    let fastest = speeds.iter().fold(0.0, |fastest, speed| speed.abs().max(fastest));
    let speed_unit = exponent(fastest);
    // At the start no time has passed and any unit will do.
    let moves = time != 0.0;
    let time_unit = if moves { exponent(time) } else { 0 };

    // A track out of this range is replaced by the limit. All headings are proportional to 1/track, and so is
    // y as long as they are tiny, as they are beyond the upper limit; beyond the lower one there are no
    // digits of the direction left.
    let track_unit = exponent(wheels.track);
    let wanted = track_unit - speed_unit - time_unit;
    let track = scaled(scaled(wheels.track, -track_unit), wanted.clamp(-400, 900));
    let excess = wanted - wanted.clamp(-400, 900);

    let speeds = speeds.map(|speed| scaled(speed, -speed_unit));
    let short = if moves { scaled(time, -time_unit) } else { 1.0 };
    let stretch = if at_end {
        Stretch::whole(speeds, short, track)
    } else {
        Stretch::part(speeds, share(time, wheels.duration), short, track)
    };
    let local = stretch.motion();
    let v = scaled(local.v, speed_unit);
    let omega = scaled(local.omega, -time_unit - excess);
    if !moves {
        return Motion { v, omega, ..Motion::default() };
    }
    let length_unit = speed_unit + time_unit;
    Motion {
        x: scaled(local.x, length_unit),
        y: scaled(local.y, length_unit - excess.max(0)),
        theta: scaled(local.theta, -excess),
        v,
        omega,
        path: scaled(local.path, length_unit),
    }
}

/// `time/duration` in double-double, for any `0 ≤ time < duration`.
fn share(time: f64, duration: f64) -> DoubleDouble {
    let (time_unit, duration_unit) = (exponent(time), exponent(duration));
    let mantissas = DoubleDouble::quotient(scaled(time, -time_unit), scaled(duration, -duration_unit));
    let unit = time_unit - duration_unit;
    DoubleDouble { hi: scaled(mantissas.hi, unit), lo: scaled(mantissas.lo, unit) }
}

/// The `e` with `2^e ≤ x < 2^(e+1)`, for finite `x > 0`; 0 for `x = 0`.
fn exponent(x: f64) -> i32 {
    if x < f64::MIN_POSITIVE {
        return if x > 0.0 { exponent(x * power_of_two(54)) - 54 } else { 0 };
    }
    i32::from((x.to_bits() >> 52) as u16 & 0x7ff) - 1023
}

/// `x·2^e`, exactly unless the result overflows or is subnormal.
fn scaled(x: f64, e: i32) -> f64 {
    // Three steps, because the exponents of two numbers may be 2100 apart while one factor reaches only to
    // 1023.
    let mut rest = e.clamp(-3000, 3000);
    let mut value = x;
    for _ in 0..3 {
        let step = rest.clamp(-1000, 1000);
        value *= power_of_two(step);
        rest -= step;
    }
    value
}

/// `2^e`, for `|e| ≤ 1022`.
fn power_of_two(e: i32) -> f64 {
    f64::from_bits(u64::from((e + 1023).cast_unsigned()) << 52)
}
