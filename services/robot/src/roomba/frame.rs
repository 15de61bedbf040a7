//! Frames of the Open Interface out of bytes, and what their packets say.

use crate::board::Fault;
use crate::params::Dialect;
use axle_schema::board::{Amperes, BatteryData, ContactsData, Share};
use axle_schema::{Seconds, Sides};

const HEADER: u8 = 19;
/// A frame whose bytes come with such a gap will not end.
const GAP: Seconds = Seconds(0.1);
/// The bytes of group 0: packets 7 to 26.
const GROUP: usize = 26;
/// What a robot moves between two answers at most: mm, and degrees or mm.
const MOST_MOVED: f64 = 2000.0;

/// Packets of a stream: bumps, cliffs, mode, battery, encoders.
const COUNTING: &[u8] = &[7, 9, 10, 11, 12, 35, 22, 23, 25, 26, 43, 44];
/// The same with distance and angle.
const MOVING: &[u8] = &[7, 9, 10, 11, 12, 35, 22, 23, 25, 26, 19, 20];

/// What a frame said.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Frame {
    /// 0 off, 1 passive, 2 safe, 3 full.
    pub(crate) mode: Option<u8>,
    /// What the encoders count, 16 bits each.
    pub(crate) counts: Option<Sides<i64>>,
    /// Distance in mm, and angle as the dialect has it, since the last frame.
    pub(crate) moved: Option<(f64, f64)>,
    pub(crate) contacts: Option<ContactsData>,
    pub(crate) battery: Option<BatteryData>,
}

/// The packets of a frame as they came.
#[derive(Clone, Copy, Debug, Default)]
struct Packets {
    bumps: u8,
    cliffs: (bool, bool),
    mode: Option<u8>,
    voltage: u16,
    current: i16,
    charge: u16,
    capacity: u16,
    encoders: (Option<u16>, Option<u16>),
    moved: (Option<i16>, Option<i16>),
}

/// Finds frames in a stream of bytes.
#[derive(Clone, Debug)]
pub(crate) struct Frames {
    dialect: Dialect,
    buffer: Vec<u8>,
    newest: Seconds,
    /// An answer without any frame is awaited.
    awaits_group: bool,
    /// Garbage before this frame has been told.
    told: bool,
}

/// The data bytes of a packet that is asked for.
const fn length(packet: u8) -> usize {
    match packet {
        7 | 9 | 10 | 11 | 12 | 35 => 1,
        _ => 2,
    }
}

impl Frames {
    pub(crate) const fn new(dialect: Dialect) -> Self {
        Self { dialect, buffer: Vec::new(), newest: Seconds::ZERO, awaits_group: false, told: false }
    }
    /// The packets of the stream, in their order.
    pub(crate) const fn packets(&self) -> &'static [u8] {
        match self.dialect {
            Dialect::Create2 => COUNTING,
            Dialect::Create1 => MOVING,
            Dialect::Roomba400 => &[],
        }
    }
    pub(crate) const fn name(&self) -> &'static str {
        match self.dialect {
            Dialect::Create2 => "create2",
            Dialect::Create1 => "create1",
            Dialect::Roomba400 => "roomba400",
        }
    }
    /// Bytes of a frame between its second byte and its checksum.
    fn inside(&self) -> usize {
        self.packets().iter().map(|packet| 1 + length(*packet)).sum()
    }
    /// The answer of 26 bytes that is asked for now; whether the last one never came whole.
    pub(crate) fn expect_group(&mut self) -> bool {
        let half = self.awaits_group && !self.buffer.is_empty();
        self.buffer.clear();
        self.awaits_group = true;
        half
    }

    /// Takes a byte; at the end of a frame it gives the frame, or what is wrong.
    pub(crate) fn push(&mut self, at: Seconds, byte: u8) -> Option<Result<Frame, Fault>> {
        let gap = at - self.newest > GAP;
        self.newest = at;
        if self.dialect == Dialect::Roomba400 {
            return self.push_to_group(byte);
        }
        if gap && !self.buffer.is_empty() {
            self.buffer.clear();
            // A first byte ends no frame.
            let _ = self.push_to_frame(byte);
            return Some(Err(Fault::Half));
        }
        self.push_to_frame(byte)
    }

    fn push_to_group(&mut self, byte: u8) -> Option<Result<Frame, Fault>> {
        if !self.awaits_group {
            return (!std::mem::replace(&mut self.told, true)).then_some(Err(Fault::Garbage));
        }
        self.buffer.push(byte);
        if self.buffer.len() < GROUP {
            return None;
        }
        (self.awaits_group, self.told) = (false, false);
        let bytes = std::mem::take(&mut self.buffer);
        let two = |at: usize| u16::from_be_bytes([bytes[at], bytes[at + 1]]);
        #[allow(clippy::cast_possible_wrap, reason = "two's complement is what the line carries")]
        let signed = |at: usize| two(at) as i16;
        // Bits that no robot sets, or cliffs that are neither true nor false: the answer has slipped.
        if bytes[0] > 31 || bytes[1..7].iter().any(|flag| *flag > 1) || bytes[16] > 6 {
            return Some(Err(Fault::Absurd));
        }
        let packets = Packets {
            bumps: bytes[0],
            cliffs: (bytes[2] + bytes[3] > 0, bytes[4] + bytes[5] > 0),
            mode: None,
            voltage: two(17),
            current: signed(19),
            charge: two(22),
            capacity: two(24),
            encoders: (None, None),
            moved: (Some(signed(12)), Some(signed(14))),
        };
        Some(packets.frame())
    }

    fn push_to_frame(&mut self, byte: u8) -> Option<Result<Frame, Fault>> {
        self.buffer.push(byte);
        let inside = self.inside();
        let mut fault = None;
        // Whatever cannot be the beginning of a frame is left out, until something can.
        while let Some(wrong) = self.wrong(inside) {
            self.buffer.remove(0);
            if wrong == Fault::Checksum || !std::mem::replace(&mut self.told, true) {
                fault.get_or_insert(wrong);
            }
        }
        if let Some(fault) = fault {
            return Some(Err(fault));
        }
        if self.buffer.len() < inside + 3 {
            return None;
        }
        self.told = false;
        let frame = self.packets_of().frame();
        self.buffer.clear();
        Some(frame)
    }

    /// Why the bytes that wait are not a frame or its beginning.
    fn wrong(&self, inside: usize) -> Option<Fault> {
        let bytes = &self.buffer;
        if *bytes.first()? != HEADER || bytes.get(1).is_some_and(|count| usize::from(*count) != inside) {
            return Some(Fault::Garbage);
        }
        let mut at = 2;
        for packet in self.packets() {
            if bytes.get(at).is_some_and(|id| id != packet) {
                return Some(Fault::Garbage);
            }
            at += 1 + length(*packet);
        }
        if bytes.len() < inside + 3 {
            return None;
        }
        let sum = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        (sum != 0 && sum != HEADER).then_some(Fault::Checksum)
    }

    /// The packets of a whole frame.
    fn packets_of(&self) -> Packets {
        let mut packets = Packets::default();
        let mut at = 3;
        for packet in self.packets() {
            let data = self.buffer.get(at..at + length(*packet)).unwrap_or_default();
            let one = data.first().copied().unwrap_or_default();
            let two = u16::from_be_bytes([one, data.get(1).copied().unwrap_or_default()]);
            #[allow(clippy::cast_possible_wrap, reason = "two's complement is what the line carries")]
            let signed = two as i16;
            match packet {
                7 => packets.bumps = one,
                9 | 10 => packets.cliffs.0 |= one == 1,
                11 | 12 => packets.cliffs.1 |= one == 1,
                35 => packets.mode = Some(one),
                22 => packets.voltage = two,
                23 => packets.current = signed,
                25 => packets.charge = two,
                26 => packets.capacity = two,
                43 => packets.encoders.0 = Some(two),
                44 => packets.encoders.1 = Some(two),
                19 => packets.moved.0 = Some(signed),
                20 => packets.moved.1 = Some(signed),
                _ => {}
            }
            at += 1 + length(*packet);
        }
        packets
    }
}

impl Packets {
    fn frame(self) -> Result<Frame, Fault> {
        let bit = |number: u8| self.bumps & (1 << number) != 0;
        let contacts = ContactsData {
            stamp: Seconds::ZERO,
            bump: Sides::new(bit(1), bit(0)),
            drop: Sides::new(bit(3), bit(2)),
            cliff: Sides::new(self.cliffs.0, self.cliffs.1),
        };
        let moved = match self.moved {
            (Some(distance), Some(angle)) => Some((f64::from(distance), f64::from(angle))),
            _ => None,
        };
        let counts = match self.encoders {
            (Some(left), Some(right)) => Some(Sides::new(i64::from(left), i64::from(right))),
            _ => None,
        };
        let is_absurd = moved.is_some_and(|(far, turned)| far.abs().max(turned.abs()) > MOST_MOVED);
        if is_absurd || self.mode.is_some_and(|mode| mode > 3) {
            return Err(Fault::Absurd);
        }
        let left = (self.capacity > 0).then(|| f64::from(self.charge) / f64::from(self.capacity));
        let battery = BatteryData {
            stamp: Seconds::ZERO,
            voltage: f64::from(self.voltage) / 1000.0,
            current: Some(Amperes(f64::from(self.current) / 1000.0)),
            left: left.map(|left| Share(left.min(1.0))),
        };
        Ok(Frame { mode: self.mode, counts, moved, contacts: Some(contacts), battery: Some(battery) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame with bumps left, a cliff on the right, Safe mode, 14.5 V, -0.3 A, half a charge, and two numbers.
    fn frame(ids: [u8; 2], numbers: [u16; 2], with_header: bool) -> Vec<u8> {
        let mut bytes = vec![19, 0, 7, 2, 9, 0, 10, 0, 11, 0, 12, 1, 35, 2];
        for (id, number) in
            [(22, 14_500), (23, 65_236), (25, 1000), (26, 2000), (ids[0], numbers[0]), (ids[1], numbers[1])]
        {
            bytes.push(id);
            bytes.extend_from_slice(&u16::to_be_bytes(number));
        }
        bytes[1] = u8::try_from(bytes.len() - 2).expect("short");
        let sum = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        let sum = if with_header { sum } else { sum.wrapping_sub(19) };
        bytes.push(0_u8.wrapping_sub(sum));
        bytes
    }
    fn read(frames: &mut Frames, at: f64, bytes: &[u8]) -> Vec<Result<Frame, Fault>> {
        bytes.iter().filter_map(|byte| frames.push(Seconds(at), *byte)).collect()
    }

    #[test]
    fn a_frame_says_what_its_packets_mean_with_either_checksum() {
        for with_header in [true, false] {
            let bytes = frame([43, 44], [65_530, 5], with_header);
            let read = read(&mut Frames::new(Dialect::Create2), 0.0, &bytes);
            let frame = read[0].clone().expect("a frame");
            assert_eq!((read.len(), frame.mode, frame.counts), (1, Some(2), Some(Sides::new(65_530, 5))));
            let contacts = frame.contacts.expect("bumps");
            assert_eq!((contacts.bump, contacts.cliff), (Sides::new(true, false), Sides::new(false, true)));
            let battery = frame.battery.expect("a battery");
            assert_eq!((battery.voltage, battery.current), (14.5, Some(Amperes(-0.3))));
            assert_eq!(battery.left, Some(Share(0.5)));
        }
        let bytes = frame([19, 20], [65_534, 90], true);
        let frame = read(&mut Frames::new(Dialect::Create1), 0.0, &bytes)[0].clone().expect("a frame");
        assert_eq!(frame.moved, Some((-2.0, 90.0)));
    }

    #[test]
    fn frames_are_found_again_behind_garbage_wrong_sums_and_halves() {
        let right = frame([43, 44], [1, 2], true);
        let mut wrong = right.clone();
        wrong[18] ^= 4;
        let mut frames = Frames::new(Dialect::Create2);
        let faults = |read: Vec<Result<Frame, Fault>>| read.into_iter().map(Result::err).collect::<Vec<_>>();
        let bytes = [&[1, 19, 19, 7, 255][..], &right, &wrong, &right].concat();
        let found = faults(read(&mut frames, 0.0, &bytes));
        assert_eq!(found, [Some(Fault::Garbage), None, Some(Fault::Checksum), None]);
        assert_eq!(faults(read(&mut frames, 0.1, &right[..9])), []);
        assert_eq!(faults(read(&mut frames, 0.5, &right)), [Some(Fault::Half), None]);
        read(&mut frames, 0.6, &[19; 100_000]);
        assert!(frames.buffer.len() < 40);
    }

    #[test]
    fn the_oldest_dialect_has_answers_without_any_frame() {
        let mut frames = Frames::new(Dialect::Roomba400);
        assert_eq!(read(&mut frames, 0.0, &[1, 2]), [Err(Fault::Garbage)], "nothing was asked");
        assert!(!frames.expect_group());
        let mut bytes = [0; 26];
        (bytes[0], bytes[13], bytes[15]) = (1, 20, 3);
        assert_eq!(read(&mut frames, 0.0, &bytes[..20]), []);
        assert!(frames.expect_group(), "the first one was cut off");
        let frame = read(&mut frames, 0.0, &bytes)[0].clone().expect("an answer");
        assert_eq!((frame.moved, frame.mode), (Some((20.0, 3.0)), None));
        frames.expect_group();
        bytes[3] = 7;
        assert_eq!(read(&mut frames, 0.0, &bytes), [Err(Fault::Absurd)]);
    }
}
