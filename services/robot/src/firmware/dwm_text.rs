//! The firmware that docs/boards/dwm-text.md describes.

use super::{Body, Firmware, Quirks, Regulator, counts};
use crate::dwm_text::{crc8, sealed};
use crate::params::DwmTextParams;
use axle_schema::{Metres, MetresPerSecond, Radians, Seconds, Sides};

/// Time from measurement to measurement.
const PERIOD: Seconds = Seconds(0.02);
/// Until the watchdog is armed, it is this.
const WATCHDOG: Seconds = Seconds(0.2);
/// How a board brakes that is left alone, m/s².
const BRAKE: f64 = 2.0;
/// The longest line.
const LONGEST: usize = 120;

/// A movement that is being driven.
#[derive(Clone, Copy, Debug)]
struct Movement {
    begun: Seconds,
    from: Sides<f64>,
    to: Sides<f64>,
    time: f64,
}

/// The board.
#[derive(Debug)]
pub(super) struct DwmText {
    tick: Sides<Metres>,
    quirks: Quirks,
    line: Vec<u8>,
    movement: Option<Movement>,
    /// Powers of the motors, as shares, since when; and the speed at full power.
    powers: Option<(Seconds, Sides<f64>)>,
    full_speed: MetresPerSecond,
    watchdog: Seconds,
    speeds: Sides<f64>,
    now: Seconds,
    due: Seconds,
    number: u16,
    said_hello: bool,
    regulator: Regulator,
    turned: Option<(u8, Radians)>,
}

impl DwmText {
    pub(super) fn new(params: DwmTextParams, quirks: Quirks) -> Self {
        Self {
            tick: params.gauge.tick(),
            quirks,
            line: Vec::new(),
            movement: None,
            powers: None,
            full_speed: params.full_speed,
            watchdog: WATCHDOG,
            speeds: Sides::default(),
            now: Seconds::ZERO,
            due: Seconds::ZERO,
            number: 0,
            said_hello: false,
            regulator: Regulator::default(),
            turned: None,
        }
    }

    fn hello(&self) -> String {
        sealed(&format!("V 1 {:X} dwm-emulated", self.quirks.run))
    }

    /// The answer to a line; none to one that is broken, since its number cannot be believed.
    fn run(&mut self, now: Seconds, line: &str) -> Option<String> {
        let (body, sum) = line.rsplit_once('*')?;
        if u8::from_str_radix(sum, 16).ok()? != crc8(body.as_bytes()) {
            return None;
        }
        let words: Vec<&str> = body.split(' ').collect();
        let (letter, seq) = (*words.first()?, *words.get(1)?);
        let numbers: Vec<i64> = words.get(2..)?.iter().filter_map(|word| word.parse().ok()).collect();
        let refused = match (letter, numbers.as_slice()) {
            ("V", []) => return Some(self.hello()),
            ("S", []) => {
                (self.movement, self.powers, self.speeds) = (None, None, Sides::default());
                None
            }
            ("W", [time]) if (50..=2000).contains(time) => {
                #[allow(clippy::cast_precision_loss, reason = "at most 2000")]
                let watchdog = Seconds(*time as f64 / 1000.0);
                self.watchdog = watchdog;
                None
            }
            ("D", [v0l, v0r, v1l, v1r, time]) => {
                let is_possible = [v0l, v0r, v1l, v1r].iter().all(|speed| speed.unsigned_abs() <= 20_000_000);
                if is_possible && (1..=2000).contains(time) {
                    #[allow(clippy::cast_precision_loss, reason = "eight digits")]
                    let metres = |speed: &i64| *speed as f64 * 1e-6;
                    let (from, to) =
                        (Sides::new(metres(v0l), metres(v0r)), Sides::new(metres(v1l), metres(v1r)));
                    #[allow(clippy::cast_precision_loss, reason = "at most 2000")]
                    let time = *time as f64 / 1000.0;
                    (self.movement, self.powers) = (Some(Movement { begun: now, from, to, time }), None);
                    None
                } else {
                    Some(2)
                }
            }
            ("P", [left, right]) if left.unsigned_abs().max(right.unsigned_abs()) <= 10_000 => {
                #[allow(clippy::cast_precision_loss, reason = "five digits")]
                let share = |power: &i64| *power as f64 / 10_000.0;
                self.powers = Some((now, Sides::new(share(left), share(right))));
                (self.movement, self.speeds) = (None, Sides::default());
                None
            }
            ("A", [pin, angle]) => {
                #[allow(clippy::cast_precision_loss, reason = "at most 3200")]
                let turned = u8::try_from(*pin).map(|pin| (pin, Radians(*angle as f64 / 1000.0)));
                match turned {
                    Ok((pin, to)) if pin < 64 && (-3200..=3200).contains(angle) => {
                        self.turned = Some((pin, to));
                        None
                    }
                    _ => Some(2),
                }
            }
            ("V" | "S" | "W" | "D" | "P" | "A", _) => Some(2),
            _ => Some(1),
        };
        Some(sealed(&refused.map_or_else(|| format!("K {seq}"), |code| format!("E {seq} {code}"))))
    }
}

impl Firmware for DwmText {
    fn hear(&mut self, now: Seconds, bytes: &[u8], out: &mut Vec<u8>) {
        for byte in bytes {
            if *byte != b'\n' {
                if self.line.len() <= LONGEST {
                    self.line.push(*byte);
                }
                continue;
            }
            let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).into_owned();
            if let Some(answer) = self.run(now, line.trim_end()) {
                out.extend_from_slice(answer.as_bytes());
            }
        }
    }

    fn beat(&mut self, now: Seconds, body: &Body, out: &mut Vec<u8>) -> Sides<MetresPerSecond> {
        if !std::mem::replace(&mut self.said_hello, true) {
            out.extend_from_slice(self.hello().as_bytes());
        }
        let span = (now - self.now).0.clamp(0.0, 0.1);
        self.now = now;
        match self.movement {
            Some(Movement { begun, from, to, time }) if now - begun <= self.watchdog => {
                let share = ((now - begun).0 / time).clamp(0.0, 1.0);
                self.speeds = from.zip(to, |from, to| from + (to - from) * share);
            }
            // Nobody says anything any more: both wheels come to rest in ratio.
            _ => {
                self.movement = None;
                let fastest = self.speeds.left.abs().max(self.speeds.right.abs());
                let kept = if fastest > BRAKE * span { 1.0 - BRAKE * span / fastest } else { 0.0 };
                self.speeds = self.speeds.map(|speed| speed * kept);
            }
        }
        if now >= self.due {
            self.due = (self.due + PERIOD).max(now);
            let Sides { left, right } = counts(body, self.tick, self.quirks.first_count);
            #[allow(clippy::cast_possible_truncation, reason = "counters of 32 bits, which wrap")]
            let (left, right) = (left as i32, right as i32);
            let touch = [body.bump.left, body.bump.right, false, false, body.cliff.left, body.cliff.right];
            let touch = touch.iter().rev().fold(0, |bits, is| bits * 2 + u8::from(*is));
            let line = format!(
                "M {} {:.0} {left} {right} {:.0} {:.0} -250 {touch}",
                self.number,
                now.0 * 1000.0,
                body.gyro.0 * 1e6,
                body.voltage * 1000.0
            );
            self.number = self.number.wrapping_add(1);
            out.extend_from_slice(sealed(&line).as_bytes());
        }
        match self.powers {
            // No speed is controlled here: power is power, and without any the wheels roll to rest.
            Some((since, powers)) if now - since <= self.watchdog => {
                powers.map(|power| self.full_speed * power)
            }
            Some(_) => Sides::default(),
            None => self.regulator.ask(now, self.speeds.map(MetresPerSecond), body),
        }
    }

    fn turned(&mut self) -> Option<(u8, Radians)> {
        self.turned.take()
    }
}
