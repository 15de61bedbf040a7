//! What the spans tell about the sensors: slip, a stuck encoder, silence, and a gyro of another unit.

use super::filter::Innovation;
use crate::event::{Event, Sensor, Side};
use axle_schema::{Metres, Radians, Seconds};
use std::collections::VecDeque;

/// A gyro has proved its unit when the wheels turned so far, in rad.
const PROVED: f64 = 0.3;
/// For so long, in s, the differences of wheels and gyro are summed: noise cancels, and a slip does not.
const WHILE: f64 = 0.4;
/// The most spans of that time.
const MOST: usize = 64;
/// The other wheel has covered this, in m, before an encoder counts as stuck.
const STUCK: f64 = 0.05;

/// What a span was like.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) stamp: f64,
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) track: f64,
    /// The gyro's angle without its bias.
    pub(super) gyro: Option<f64>,
    pub(super) innovation: Option<Innovation>,
}

/// Watches the sensors.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    /// Σ of the wheels' turns, squared, and times the gyro's; and of their sizes.
    products: [f64; 2],
    turned: f64,
    scale: Option<f64>,
    /// Stamps and innovations of the last spans.
    last: VecDeque<(f64, Innovation)>,
    slipping: bool,
    /// Since one encoder stays: which, what the other covered, and both turns.
    stuck: Option<(Side, f64, f64, f64)>,
    stuck_said: bool,
    /// The last stamp of encoders and gyro, and whether their silence was said.
    heard: [Option<(f64, bool)>; 2],
}

impl Watch {
    /// Whether the gyro may be asked, and whether it may be believed against the wheels.
    pub(super) fn gyro_is_usable(&self) -> bool {
        self.scale.is_none()
    }
    pub(super) fn gyro_is_proved(&self) -> bool {
        self.scale.is_none() && self.turned > PROVED && {
            let ratio = self.products[1] / self.products[0];
            (0.5..2.0).contains(&ratio)
        }
    }

    /// A sensor spoke, or at least its time has come: says who has been silent for longer than `silence`.
    pub(super) fn hear(&mut self, sensor: Sensor, stamp: f64, silence: f64) -> Option<Event> {
        let index = |sensor| usize::from(sensor == Sensor::Gyro);
        self.heard[index(sensor)] = Some((stamp, false));
        let other = if sensor == Sensor::Gyro { Sensor::Encoders } else { Sensor::Gyro };
        let (since, said) = self.heard[index(other)].as_mut()?;
        if *said || stamp - *since <= silence {
            return None;
        }
        *said = true;
        Some(Event::Silent { stamp: Seconds(stamp), sensor: other, since: Seconds(*since) })
    }

    /// A clock that begins anew.
    pub(super) fn restart(&mut self) {
        self.heard = [None; 2];
        self.last.clear();
        (self.slipping, self.stuck) = (false, None);
    }

    /// Looks at a span for the first time.
    pub(super) fn look(&mut self, seen: &Seen, raw: Option<f64>, gate: f64) -> Vec<Event> {
        let encoders = (seen.right - seen.left) / seen.track;
        let scale = raw.and_then(|raw| self.unit(seen.stamp, encoders, raw));
        let slip = self.slip(seen, encoders, gate);
        let stuck = self.stays(seen, encoders);
        [scale, slip, stuck].into_iter().flatten().collect()
    }

    fn unit(&mut self, stamp: f64, encoders: f64, raw: f64) -> Option<Event> {
        if self.scale.is_some() {
            return None;
        }
        self.products[0] += encoders * encoders;
        self.products[1] += encoders * raw;
        self.turned += encoders.abs();
        let ratio = self.products[1] / self.products[0];
        let wrong = (30.0..90.0).contains(&ratio) || (-1.5..-0.5).contains(&ratio);
        // Once proved it is right: a wheel that slips makes no gyro wrong.
        if self.turned <= PROVED || !wrong {
            return None;
        }
        self.scale = Some(ratio);
        Some(Event::GyroScale { stamp: Seconds(stamp), ratio })
    }

    fn slip(&mut self, seen: &Seen, encoders: f64, gate: f64) -> Option<Event> {
        let (Some(innovation), Some(gyro)) = (seen.innovation, seen.gyro) else { return None };
        while self.last.len() >= MOST || self.last.front().is_some_and(|first| first.0 < seen.stamp - WHILE) {
            let _ = self.last.pop_front();
        }
        self.last.push_back((seen.stamp, innovation));
        let nu: f64 = self.last.iter().map(|(_, innovation)| innovation.nu).sum();
        let s: f64 = self.last.iter().map(|(_, innovation)| innovation.s).sum();
        let squared = nu * nu / s;
        let slips = self.gyro_is_proved() && squared > gate;
        let begins = slips && !self.slipping;
        self.slipping = slips;
        begins.then_some(Event::Slip {
            stamp: Seconds(seen.stamp),
            encoders: Radians(encoders),
            gyro: Radians(gyro),
            squared,
        })
    }

    /// What a slip that lasts adds to the variance of a wheel's distance in each span, in m². Its error has one sign, so
    /// that it counts as often as there are spans of it.
    pub(super) fn slip_variance(&self, track: f64) -> f64 {
        if !self.slipping {
            return 0.0;
        }
        let nu: f64 = self.last.iter().map(|(_, innovation)| innovation.nu).sum();
        #[allow(clippy::cast_precision_loss, reason = "at most 64")]
        let n = self.last.len() as f64;
        (nu * track).powi(2) / (2.0 * n)
    }

    #[allow(clippy::float_cmp, reason = "a stuck encoder repeats the very same reading")]
    fn stays(&mut self, seen: &Seen, encoders: f64) -> Option<Event> {
        let side = match (seen.left == 0.0, seen.right == 0.0) {
            (true, false) => Side::Left,
            (false, true) => Side::Right,
            (true, true) => return None,
            (false, false) => {
                (self.stuck, self.stuck_said) = (None, false);
                return None;
            }
        };
        let (Some(gyro), true) = (seen.gyro, self.gyro_is_proved()) else { return None };
        let (_, other, by_wheels, by_gyro) =
            self.stuck.filter(|stuck| stuck.0 == side).unwrap_or((side, 0.0, 0.0, 0.0));
        let (other, by_wheels, by_gyro) =
            (other + seen.left + seen.right, by_wheels + encoders, by_gyro + gyro);
        self.stuck = Some((side, other, by_wheels, by_gyro));
        if self.stuck_said || other.abs() < STUCK || (by_wheels - by_gyro).abs() < 0.3 * by_wheels.abs() {
            return None;
        }
        self.stuck_said = true;
        Some(Event::StuckEncoder {
            stamp: Seconds(seen.stamp),
            side,
            other: Metres(other),
            encoders: Radians(by_wheels),
            gyro: Radians(by_gyro),
        })
    }
}
