//! What every protocol is to the bridge: bytes in and events out, setpoints in and bytes out.

use axle_schema::board::{BatteryData, ContactsData, LineFaults};
use axle_schema::{Duty, Metres, MetresPerSecond, Radians, RadiansPerSecond, Seconds, Sides};
use std::fmt::Debug;

/// One kind of board, as the end of the line that Axle is on. It reads no clock: `now` is the robot's.
pub trait Board: Debug + Send {
    /// Forgets the conversation, since the port was opened anew, and says first of all what stops the wheels, whatever
    /// the board was in the middle of.
    fn open(&mut self, now: Seconds, out: &mut Vec<u8>);

    /// Takes bytes that came at `at`, in pieces of any length, and tells what they mean.
    fn hear(&mut self, at: Seconds, bytes: &[u8], events: &mut Vec<Event>);

    /// Says what is due at `now`: the greeting, questions, and the speeds that the wheels shall run at. Until the board
    /// has been greeted it is asked for no speed.
    fn beat(
        &mut self,
        now: Seconds,
        speeds: Sides<MetresPerSecond>,
        out: &mut Vec<u8>,
        events: &mut Vec<Event>,
    );

    /// Turns a servo, on boards that have some; whether this one has.
    fn servo(&mut self, _number: usize, _angle: Radians) -> bool {
        false
    }
    /// The board was found restarted by its counters: what it was told once it has forgotten.
    fn restarted(&mut self) {}
    /// Bits of its encoder counters; they wrap.
    fn counter_bits(&self) -> u32 {
        32
    }
}

/// What bytes of a board meant.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The board is of this kind, and ready; what it said of itself.
    Hello(String),
    /// What both encoders count now.
    Counts(Sides<i64>),
    /// What both wheels have covered since the last event of this kind.
    Covered(Sides<Metres>),
    /// The turn rate of a gyroscope, counter-clockwise positive.
    Gyro(RadiansPerSecond),
    /// What the robot touches; the stamp is set by the bridge.
    Contacts(ContactsData),
    /// What the battery gives; the stamp is set by the bridge.
    Battery(BatteryData),
    /// The duty cycles that were given to the motors.
    Signals(Sides<Duty>),
    /// The board answers, but measured nothing.
    Alive,
    /// The board has begun anew: its counters too.
    Restarted,
    /// The board has taken the wheels away by itself; why.
    Halted(&'static str),
    /// It gives them back.
    Resumed,
    /// What came is of another kind of board, or of none; a short excerpt.
    Foreign(String),
    /// Something was wrong with the bytes.
    Fault(Fault),
}

/// What can be wrong with bytes. Each is counted, and moves no wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Bytes or a line that mean nothing.
    Garbage,
    /// A line longer than any of the protocol.
    Overlong,
    /// A frame with a wrong checksum.
    Checksum,
    /// A frame that did not end in its time.
    Half,
    /// A number out of its range, or that no wheel can have done.
    Absurd,
    /// A request that the board refused.
    Refused,
    /// A request that the board did not answer in its time.
    Unanswered,
    /// So many frames are missing.
    Missed(u32),
}

impl Fault {
    /// Counts it.
    pub(crate) fn count(self, in_faults: &mut LineFaults) {
        let (counter, times) = match self {
            Self::Garbage => (&mut in_faults.garbage, 1),
            Self::Overlong => (&mut in_faults.overlong, 1),
            Self::Checksum => (&mut in_faults.checksum, 1),
            Self::Half => (&mut in_faults.half, 1),
            Self::Absurd => (&mut in_faults.absurd, 1),
            Self::Refused => (&mut in_faults.refused, 1),
            Self::Unanswered => (&mut in_faults.unanswered, 1),
            Self::Missed(times) => (&mut in_faults.missed, times),
        };
        *counter = counter.saturating_add(times);
    }
}

/// Speeds as whole numbers of a coarse unit: what rounding leaves over goes into the next number, so that the mean over
/// some commands is right although none of them is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Rounding {
    rest: Sides<f64>,
}

impl Rounding {
    /// The whole numbers for `speeds` in units of `unit` m/s, at most `limit` in size. Rest is always rest.
    pub(crate) fn round(
        &mut self,
        speeds: Sides<MetresPerSecond>,
        unit: Sides<f64>,
        limit: i32,
    ) -> Sides<i32> {
        let wanted = speeds.zip(unit, |speed, unit| speed.0 / unit);
        let side = |wanted: f64, rest: &mut f64| {
            if wanted.abs() < 1e-9 || !wanted.is_finite() {
                *rest = 0.0;
                return 0;
            }
            let whole = (wanted + *rest).round().clamp(-f64::from(limit), f64::from(limit));
            *rest = (wanted + *rest - whole).clamp(-0.5, 0.5);
            #[allow(clippy::cast_possible_truncation, reason = "a whole number within the limit")]
            let number = whole as i32;
            number
        };
        let left = side(wanted.left, &mut self.rest.left);
        let right = side(wanted.right, &mut self.rest.right);
        Sides::new(left, right)
    }
}

/// The powers of motors that give these speeds as long as nothing is calibrated: shares of the speed at full power.
pub(crate) fn powers(speeds: Sides<MetresPerSecond>, full_speed: MetresPerSecond) -> Sides<Duty> {
    speeds.map(|speed| {
        let share = speed / full_speed;
        Duty::new(if share.is_finite() { share.clamp(-1.0, 1.0) } else { 0.0 }).unwrap_or_default()
    })
}

/// The powers that whole numbers stand for, of which `full` is full power: what the motors are really given.
pub(crate) fn given(whole: Sides<i32>, full: f64) -> Sides<Duty> {
    whole.map(|power| Duty::new((f64::from(power) / full).clamp(-1.0, 1.0)).unwrap_or_default())
}

/// A power as a whole number, of which `full` is full power.
pub(crate) fn whole_power(power: Duty, full: f64) -> i32 {
    #[allow(clippy::cast_possible_truncation, reason = "a share of a few digits")]
    let whole = (power.get() * full).round() as i32;
    whole
}

/// Something that is due again and again.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Every {
    period: Seconds,
    due: Seconds,
}

impl Every {
    pub(crate) const fn new(period: Seconds) -> Self {
        Self { period, due: Seconds(f64::NEG_INFINITY) }
    }
    /// Whether it is due; what was missed is not made up for.
    pub(crate) fn is_due(&mut self, now: Seconds) -> bool {
        let is_due = now >= self.due;
        if is_due {
            let next = self.due + self.period;
            self.due = if next > now { next } else { now + self.period };
        }
        is_due
    }
    /// It is due at once.
    pub(crate) const fn hurry(&mut self) {
        self.due = Seconds(f64::NEG_INFINITY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_numbers_are_right_on_average_and_rest_is_rest() {
        let mut rounding = Rounding::default();
        let speeds = Sides::new(MetresPerSecond(0.1), MetresPerSecond(-0.033));
        let unit = Sides::new(0.015, 0.015);
        let mut sum = Sides::new(0, 0);
        for _ in 0..100 {
            sum = sum.zip(rounding.round(speeds, unit, 255), |sum, number| sum + number);
        }
        assert_eq!(sum, Sides::new(667, -220));
        assert_eq!(rounding.round(Sides::default(), unit, 255), Sides::new(0, 0));
        let fast = Sides::new(MetresPerSecond(1e300), MetresPerSecond(f64::NAN));
        let powers = powers(Sides::new(fast.left, MetresPerSecond(-0.25)), MetresPerSecond(0.5));
        let whole = powers.map(|power| whole_power(power, 255.0));
        assert_eq!(whole, Sides::new(255, -128));
        assert!((given(whole, 255.0).right.get() + 128.0 / 255.0).abs() < 1e-12);
        assert_eq!(rounding.round(fast, unit, 255), Sides::new(255, 0));
    }

    #[test]
    fn what_was_missed_is_not_made_up_for() {
        let mut every = Every::new(Seconds(0.02));
        let due: Vec<bool> =
            [0.0, 0.01, 0.02, 0.2, 0.21, 0.219, 0.22].map(|now| every.is_due(Seconds(now))).to_vec();
        assert_eq!(due, [true, false, true, true, false, false, true]);
    }
}
