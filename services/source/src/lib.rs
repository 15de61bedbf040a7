//! Source: bounded buffers of measurements.
//!
//! Hears every measurement of one robot, keeps the newest of each kind in the order of their stamps, and says windows
//! of them: the last fifth of a second again and again, and older ones when asked (paper, section II: Source "plays
//! the role of a buffer for the measurements"). All times are of the robot's clock; Source has none of its own. It also
//! keeps the newest position that the navigator has said, so that a navigator that starts anew goes on from there.
//!
//! When something fails: a lost sample is counted, a repeated or broken one is dropped, and when the robot restarts
//! everything of its former run is forgotten, since its stamps mean nothing any more.

use axle_schema::contract::{Bounds, Params};
use axle_schema::meta::Meta;
use axle_schema::refusal::within;
use axle_schema::window::{MAX_WINDOW, Window, WindowAsk};
use axle_schema::{Boot, EncodersData, Fix, InertialData, Message, Position, Range, Refusal, Seconds};
use serde::{Deserialize, Serialize};

mod buffer;
use buffer::{Buffer, Stamped};

/// Parameters of Source: `deploy/params/source.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SourceParams {
    /// How many of the newest wheel distances are kept, 1 to 4096.
    pub encoders: usize,
    /// How many of the newest turn rates are kept, 1 to 4096.
    pub inertial: usize,
    /// How many of the newest absolute positions are kept, 1 to 4096.
    pub fixes: usize,
    /// How many of the newest distances to known points are kept, 1 to 4096.
    pub ranges: usize,
    /// How much of the newest measurements is said without being asked, 0.001 to 60 s.
    pub recent: Seconds,
}

impl Default for SourceParams {
    fn default() -> Self {
        Self { encoders: 2048, inertial: 2048, fixes: 256, ranges: 1024, recent: Seconds(0.2) }
    }
}

impl Bounds for SourceParams {
    fn check(&self) -> Result<(), Refusal> {
        for (name, capacity) in [
            ("encoders", self.encoders),
            ("inertial", self.inertial),
            ("fixes", self.fixes),
            ("ranges", self.ranges),
        ] {
            if !(1..=MAX_WINDOW).contains(&capacity) {
                return Err(Refusal::out_of_range(name, capacity, format!("1 to {MAX_WINDOW}")));
            }
        }
        within("recent in s", self.recent.0, 1e-3, 60.0)
    }
}

impl Params for SourceParams {
    const FILE: &'static str = include_str!("../../../deploy/params/source.toml");
}

/// The service that remembers what a robot has measured.
#[derive(Clone, Debug)]
pub struct Source {
    boot: Boot,
    /// The run before this one; its last samples may still be on their way.
    former: Option<Boot>,
    encoders: Buffer<EncodersData>,
    inertial: Buffer<InertialData>,
    fixes: Buffer<Fix>,
    ranges: Buffer<Range>,
    position: Option<Position>,
}

impl Source {
    /// Empty buffers.
    ///
    /// # Errors
    /// Names the parameter that is out of its range.
    pub fn new(params: &SourceParams) -> Result<Self, Refusal> {
        params.check()?;
        Ok(Self {
            boot: Boot::default(),
            former: None,
            encoders: Buffer::new(params.encoders),
            inertial: Buffer::new(params.inertial),
            fixes: Buffer::new(params.fixes),
            ranges: Buffer::new(params.ranges),
            position: None,
        })
    }

    /// Takes wheel distances. Their publisher is the robot: its boot is the boot of the window, and when it restarts,
    /// everything that others have stamped by its former clock is forgotten too.
    pub fn take_encoders(&mut self, meta: Option<Meta>, datum: EncodersData) {
        let source = meta.map(|meta| meta.source);
        let finite = datum.stamp.is_finite() && datum.left.is_finite() && datum.right.is_finite();
        if !finite || (source.is_some() && source == self.former) {
            return;
        }
        if self.encoders.restarts(meta, &datum) {
            self.former =
                self.encoders.source.filter(|&former| source.is_some_and(|source| source != former));
            self.encoders.clear();
            // What comes from the new run already, ahead of its first wheel distances, is kept.
            if source.is_none() || self.inertial.source != source {
                self.inertial.clear();
            }
            if source.is_none() || self.fixes.source != source {
                self.fixes.clear();
            }
            if source.is_none() || self.ranges.source != source {
                self.ranges.clear();
            }
        }
        self.boot = source.unwrap_or(self.boot);
        self.encoders.insert(meta, datum);
    }

    /// Takes a turn rate. Its publisher may be another process than the robot's.
    pub fn take_inertial(&mut self, meta: Option<Meta>, datum: InertialData) {
        if datum.gyro.is_finite() {
            take(&mut self.inertial, meta, datum);
        }
    }

    /// Takes an absolute position. It may come late, and is put where its stamp belongs.
    pub fn take_fix(&mut self, meta: Option<Meta>, datum: Fix) {
        if datum.check().is_ok() && datum.x.is_finite() && datum.y.is_finite() {
            take(&mut self.fixes, meta, datum);
        }
    }

    /// Takes a distance to a known point; as a fix.
    pub fn take_range(&mut self, meta: Option<Meta>, datum: Range) {
        if datum.check().is_ok() && datum.x.is_finite() && datum.y.is_finite() && datum.distance.is_finite() {
            take(&mut self.ranges, meta, datum);
        }
    }

    /// Takes what the navigator says of the robot. It says in which run of the robot it is.
    pub fn take_position(&mut self, position: Position) {
        if position.check().is_ok() {
            self.position = Some(position);
        }
    }

    /// The measurements of the last `span` before the newest one, oldest first.
    #[must_use]
    pub fn recent(&self, span: Seconds) -> Window {
        let newest =
            [self.encoders.newest(), self.inertial.newest(), self.fixes.newest(), self.ranges.newest()];
        let newest =
            newest.into_iter().flatten().fold(f64::NEG_INFINITY, |newest, stamp| newest.max(stamp.0));
        let begin = newest - span.0;
        Window {
            boot: self.boot,
            encoders: self.encoders.since(begin),
            inertial: self.inertial.since(begin),
            fixes: self.fixes.since(begin),
            ranges: self.ranges.since(begin),
            dropped: [self.encoders.dropped, self.inertial.dropped, self.fixes.dropped, self.ranges.dropped]
                .into_iter()
                .fold(0, u64::saturating_add),
            position: None,
        }
    }

    /// Answers for a window; what is kept always fits into one. Empty lists mean that nothing has come yet.
    ///
    /// # Errors
    /// Refuses a span that is negative or not a number.
    pub fn window(&self, ask: &WindowAsk) -> Result<Window, Refusal> {
        ask.check()?;
        let window = self.recent(ask.since.unwrap_or(Seconds(f64::INFINITY)));
        // A position of a former run of the robot tells nothing of this one.
        Ok(Window { position: self.position.filter(|position| position.boot == self.boot), ..window })
    }
}

fn take<T: Stamped>(buffer: &mut Buffer<T>, meta: Option<Meta>, datum: T) {
    if !datum.stamp().is_finite() {
        return;
    }
    if buffer.restarts(meta, &datum) {
        buffer.clear();
    }
    buffer.insert(meta, datum);
}

#[cfg(test)]
mod tests;
