//! An Open Robotics board: the serial gate V1.2 and the motor driver behind it.

use super::{Body, Firmware};
use crate::params::OrfaParams;
use axle_schema::{MetresPerSecond, Seconds, Sides};

/// The address of the gate itself, for writing.
const ADDRESS: u8 = 0x40;
/// Where the motors are on this board.
const MOTORS: u8 = 0x62;
/// Its drivers: number (two bytes), version, first register, count of registers.
const DRIVERS: [[u8; 6]; 2] = [[0, 0x10, 1, 0, 1, 4], [0, 0x60, 1, 2, MOTORS, 4]];

/// The board.
#[derive(Debug)]
pub(super) struct Orfa {
    params: OrfaParams,
    line: Vec<u8>,
    /// PWM1, PWM2, DIR1, DIR2.
    motors: [u8; 4],
    /// What a read gives next: nothing, the number of drivers, or one of them.
    told: usize,
}

impl Orfa {
    pub(super) const fn new(params: OrfaParams) -> Self {
        Self { params, line: Vec::new(), motors: [0; 4], told: 0 }
    }

    /// The parts of a request, each begun by an S, and what each is answered with.
    fn transfer(&mut self, line: &str) -> String {
        let mut answer = String::new();
        for part in line.split('S').skip(1) {
            let letters: String = part.chars().filter(char::is_ascii_hexdigit).collect();
            let bytes: Vec<u8> = (0..letters.len() / 2)
                .filter_map(|at| u8::from_str_radix(&letters[2 * at..2 * at + 2], 16).ok())
                .collect();
            match bytes.as_slice() {
                [address, data @ ..] if *address == ADDRESS => {
                    answer.push_str("SW");
                    answer.push_str(&"A".repeat(1 + data.len()));
                    self.write(data);
                }
                [address, count, ..] if *address == ADDRESS | 1 => {
                    answer.push_str("SR");
                    for byte in self.read(usize::from(*count)) {
                        answer.push_str(&format!("{byte:02X}"));
                    }
                }
                // Nobody is there: the address is not acknowledged, and no error is told.
                [address, ..] => answer.push_str(if address & 1 == 0 { "SW" } else { "SR" }),
                [] => {}
            }
        }
        answer + "P\n"
    }

    fn write(&mut self, data: &[u8]) {
        match data {
            [0] => self.told = 0,
            [register, values @ ..] => {
                let first = (register & 0x7F).wrapping_sub(MOTORS);
                for (offset, value) in values.iter().enumerate() {
                    if let Some(motor) = self.motors.get_mut(usize::from(first) + offset) {
                        *motor = *value;
                    }
                }
            }
            [] => {}
        }
    }

    fn read(&mut self, count: usize) -> Vec<u8> {
        let told = self.told;
        self.told += 1;
        let all = match told.checked_sub(1) {
            None => vec![u8::try_from(DRIVERS.len()).unwrap_or_default()],
            Some(driver) => DRIVERS.get(driver).map_or_else(Vec::new, |driver| driver.to_vec()),
        };
        all.into_iter().take(count).collect()
    }
}

impl Firmware for Orfa {
    fn hear(&mut self, _now: Seconds, bytes: &[u8], out: &mut Vec<u8>) {
        for byte in bytes {
            if *byte != b'\n' {
                if self.line.len() < 128 {
                    self.line.push(byte.to_ascii_uppercase());
                }
                continue;
            }
            let line = String::from_utf8_lossy(&std::mem::take(&mut self.line)).into_owned();
            let answer = match line.trim_start().chars().next() {
                Some('V') => "V1.2\n".to_owned(),
                Some('L') => format!("L{ADDRESS:02X}\n"),
                Some('X') => "X\n".to_owned(),
                Some('C') => "C0064\n".to_owned(),
                Some('S') => self.transfer(&line),
                _ => continue,
            };
            out.extend_from_slice(answer.as_bytes());
        }
    }

    fn beat(&mut self, _now: Seconds, _body: &Body, _out: &mut Vec<u8>) -> Sides<MetresPerSecond> {
        let [left, right, left_back, right_back] = self.motors;
        let OrfaParams { full_speed, dead_band, .. } = self.params;
        // No speed is controlled here: power is power.
        Sides::new((left, left_back), (right, right_back)).map(|(pwm, back)| {
            let above = ((f64::from(pwm) / 255.0 - dead_band) / (1.0 - dead_band)).max(0.0);
            full_speed * if back == 0 { above } else { -above }
        })
    }
}
