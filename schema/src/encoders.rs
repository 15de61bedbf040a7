//! What the wheels have done: encoder readings and the spans between them.

use crate::codec::Message;
use crate::navigator::NavigatorSpan;
use crate::refusal::within;
use crate::sides::{Symmetric, same_time};
use crate::{Dwm, Metres, MetresPerSecond, Radians, Refusal, Seconds, Sides, Track, motion};
use serde::{Deserialize, Serialize};

/// The distance each wheel has covered since the robot's boot, at a stamp of the robot's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncodersData {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// Signed distance of the left wheel.
    pub left: Metres,
    /// Signed distance of the right wheel.
    pub right: Metres,
}

/// One wheel of [`EncodersData`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncodersHalf {
    /// Seconds since the boot of the robot process.
    pub stamp: Seconds,
    /// Signed distance of the wheel.
    pub distance: Metres,
}

/// The distance each wheel covers in an interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncodersSpan {
    /// Length of the interval.
    pub duration: Seconds,
    /// Signed distance of the left wheel.
    pub left: Metres,
    /// Signed distance of the right wheel.
    pub right: Metres,
}

/// One wheel of [`EncodersSpan`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncodersSpanHalf {
    /// Length of the interval.
    pub duration: Seconds,
    /// Signed distance of the wheel.
    pub distance: Metres,
}

impl EncodersData {
    /// Both distances.
    #[must_use]
    pub const fn sides(&self) -> Sides<Metres> {
        Sides::new(self.left, self.right)
    }
    /// The wheels apart.
    #[must_use]
    pub fn halves(&self) -> Sides<EncodersHalf> {
        self.sides().map(|distance| EncodersHalf { stamp: self.stamp, distance })
    }
}

impl Symmetric for EncodersData {
    type Half = EncodersHalf;
    fn split(self) -> Sides<EncodersHalf> {
        self.halves()
    }
    fn join(halves: Sides<EncodersHalf>) -> Result<Self, Refusal> {
        let Sides { left, right } = halves;
        same_time("stamp", left.stamp, right.stamp)?;
        Ok(Self { stamp: left.stamp, left: left.distance, right: right.distance })
    }
}

impl Symmetric for EncodersSpan {
    type Half = EncodersSpanHalf;
    fn split(self) -> Sides<EncodersSpanHalf> {
        self.sides().map(|distance| EncodersSpanHalf { duration: self.duration, distance })
    }
    fn join(halves: Sides<EncodersSpanHalf>) -> Result<Self, Refusal> {
        let Sides { left, right } = halves;
        same_time("duration", left.duration, right.duration)?;
        Ok(Self { duration: left.duration, left: left.distance, right: right.distance })
    }
}

impl EncodersSpan {
    /// Both distances.
    #[must_use]
    pub const fn sides(&self) -> Sides<Metres> {
        Sides::new(self.left, self.right)
    }
    /// The movement at constant speeds that covers the span: choice (a) of model.md 4.3.
    ///
    /// # Errors
    /// Refuses a span without duration that covers a distance: no finite speed does that.
    pub fn to_dwm(&self) -> Result<Dwm, Refusal> {
        match self.mean_speeds()? {
            Some(speeds) => Dwm::steady(speeds, self.duration),
            None => Ok(Dwm::rest(Seconds::ZERO)),
        }
    }
    /// The movement that covers the span and starts at the speeds `start`: `v1 = 2Δs/T − v0`, choice (b) of
    /// model.md 4.3.
    ///
    /// Whatever the start speed is wrong by, the end speed is wrong by in the other direction: made a chain, each
    /// movement starting where the last ended, the error (and the noise of every reading) rings on for ever and never
    /// dies down. For single spans, or with measured start speeds, that does not matter.
    ///
    /// # Errors
    /// As [`EncodersSpan::to_dwm`], and refuses speeds that are not finite.
    pub fn to_dwm_from(&self, start: Sides<MetresPerSecond>) -> Result<Dwm, Refusal> {
        let end = match self.mean_speeds()? {
            Some(mean) => mean.zip(start, |mean, start| mean * 2.0 - start),
            None => start,
        };
        Dwm::new(start, end, self.duration)
    }
    /// The movement that covers the span and accelerates as its neighbours, where there are any, let expect: the slope
    /// of the mean speeds (see [`motion::slope`]). It is exact if the accelerations are the same in all of them, and
    /// does not ring as a continuous chain does.
    ///
    /// # Errors
    /// As [`EncodersSpan::to_dwm`].
    pub fn to_accelerated_dwm(&self, before: Option<&Self>, after: Option<&Self>) -> Result<Dwm, Refusal> {
        let Some(mean) = self.mean_speeds()? else { return self.to_dwm() };
        // A neighbour without duration says nothing of speeds.
        let speeds = |span: Option<&Self>| {
            let span = span?;
            Some((span.mean_speeds().ok()??, span.duration.0))
        };
        let (before, after) = (speeds(before), speeds(after));
        let half_change = |side: fn(Sides<MetresPerSecond>) -> MetresPerSecond| {
            let of = |(speeds, time): (Sides<MetresPerSecond>, f64)| (side(speeds).0, time);
            let slope = motion::slope(before.map(of), of((mean, self.duration.0)), after.map(of));
            MetresPerSecond(0.5 * slope * self.duration.0)
        };
        let change = Sides::new(half_change(|speeds| speeds.left), half_change(|speeds| speeds.right));
        Dwm::new(mean.zip(change, |m, c| m - c), mean.zip(change, |m, c| m + c), self.duration)
    }
    /// The mean speed of each wheel; none for a span of no time and no distance.
    fn mean_speeds(&self) -> Result<Option<Sides<MetresPerSecond>>, Refusal> {
        if self.duration.0 > 0.0 {
            Ok(Some(self.sides().map(|distance| distance / self.duration)))
        } else if self.left == Metres::ZERO && self.right == Metres::ZERO {
            Ok(None)
        } else {
            Err(Refusal::out_of_range(
                "duration of an encoder span that moves",
                self.duration,
                "more than 0 s",
            ))
        }
    }
    /// The displacement along the arc that constant wheel speeds drive: exact for them (model.md, 1.3).
    #[must_use]
    pub fn navigator_span(&self, track: Track) -> NavigatorSpan {
        let (x, y, heading) = motion::arc(self.left.0, self.right.0, track.get());
        NavigatorSpan { duration: self.duration, x: Metres(x), y: Metres(y), heading: Radians(heading) }
    }
}

/// Movements that cover the spans one after the other without a jump of a wheel speed: choice (c) of model.md 4.3.
///
/// Spans leave one number for each wheel free, the speed at the start. It is `start` where that is known; otherwise it
/// is the one that makes `∫a² dt` least. With `m_i = Δs_i/T_i`,
///
/// ```text
/// v_i = p_i + (−1)^i·c      p_0 = 0      p_{i+1} = 2m_i − p_i      c = Σ (−1)^i (m_i − p_i)/T_i / Σ 1/T_i
/// ```
///
/// **It amplifies noise.** The recurrence has its pole at −1: the error of one reading alternates through all later
/// speeds without dying down, and errors add up. Use it where the spans are exact (those of planned movements, say);
/// for readings of real encoders use [`EncodersSpan::to_dwm`] or
/// [`to_accelerated_dwms`](crate::series::Convert::to_accelerated_dwms), which do not ring.
///
/// # Errors
/// Refuses a span without duration that covers a distance, and numbers that are not finite.
pub fn continuous(
    spans: &[EncodersSpan],
    start: Option<Sides<MetresPerSecond>>,
) -> Result<Vec<Dwm>, Refusal> {
    let mut speeds = match start {
        Some(start) => start,
        None => smoothest_start(spans)?,
    };
    spans
        .iter()
        .map(|span| {
            let dwm = span.to_dwm_from(speeds)?;
            speeds = dwm.end();
            Ok(dwm)
        })
        .collect()
}

/// The speeds `c` at the start for which `∫a² dt` over all spans is least.
fn smoothest_start(spans: &[EncodersSpan]) -> Result<Sides<MetresPerSecond>, Refusal> {
    let mut p = Sides::<MetresPerSecond>::default();
    let mut sums = Sides::new(0.0, 0.0);
    let (mut weights, mut sign) = (0.0, 1.0);
    for span in spans {
        // A span of no time changes no speed.
        let Some(mean) = span.mean_speeds()? else { continue };
        let weight = 1.0 / span.duration.0;
        let rests = mean.zip(p, |m, p| (m - p).0);
        sums = sums.zip(rests, |sum, rest| sum + sign * rest * weight);
        weights += weight;
        sign = -sign;
        p = mean.zip(p, |m, p| m * 2.0 - p);
    }
    // Without any span there is nothing to be smooth about, and 0/0 must not come out.
    Ok(sums.map(|sum| MetresPerSecond(if weights > 0.0 { sum / weights } else { 0.0 })))
}

impl Message for EncodersData {
    const NAME: &'static str = "EncodersData";
    const LIMIT: usize = 256;

    fn check(&self) -> Result<(), Refusal> {
        // No wheel turns a thousand million metres, and no robot runs for thirty years.
        within("stamp in s", self.stamp.0, -1e9, 1e9)?;
        within("distance of the left wheel in m", self.left.0, -1e9, 1e9)?;
        within("distance of the right wheel in m", self.right.0, -1e9, 1e9)
    }
}
impl Message for EncodersSpan {
    const NAME: &'static str = "EncodersSpan";
    const LIMIT: usize = 256;
}
