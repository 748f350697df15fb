//! Packets out of a stream of bytes that may be cut anywhere and may hold noise.
//!
//! A length that came over the wire only ever says how long to wait. When the checksum does not match, only the
//! header is given up: the bytes behind it are searched again, so that a packet swallowed by a wrong length is
//! still found.

use super::crc;
use super::instruction::{BROADCAST_ID, Instruction};
use super::packet::{HEADER, OVERHEAD, PREFIX, Packet, unstuff};
use crate::receive_buffer::{ReceiveBuffer, Span};
use core::fmt;

/// Why bytes that began like a packet are not one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// The checksum does not match.
    Crc {
        /// Id that the bytes name, right or wrong.
        id: u8,
        /// Checksum that the bytes carry.
        found: u16,
        /// Checksum that the bytes have.
        expected: u16,
    },
    /// A length below 3: no room for instruction and checksum.
    TooShort {
        /// Length that the bytes name.
        length: u16,
    },
    /// A packet longer than the buffer.
    TooLong {
        /// Length that the bytes name.
        length: u16,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Crc { id, found, expected } => {
                write!(f, "the checksum of a packet of id {id} is {found:#06x}, expected {expected:#06x}")
            }
            Self::TooShort { length } => write!(f, "the length of a packet is {length}, expected at least 3"),
            Self::TooLong { length } => {
                write!(f, "the length of a packet is {length}, more than the buffer holds")
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// Finds packets in a stream, keeping at most `N` bytes; `N` at least 10, else it does not compile.
///
/// ```
/// use servo_wire::dynamixel::Framer;
/// let mut framer = Framer::<64>::new();
/// let mut bytes: &[u8] = &[0x12, 0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];
/// while let Some(packet) = framer.feed(&mut bytes) {
///     assert_eq!(packet.map(|p| (p.id, p.instruction)), Ok((1, 0x01)));
/// }
/// ```
#[derive(Debug)]
pub struct Framer<const N: usize> {
    received: ReceiveBuffer<N>,
}

impl<const N: usize> Default for Framer<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Framer<N> {
    /// An empty framer.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N >= OVERHEAD, "a framer must hold at least a packet without parameters") };
        Self { received: ReceiveBuffer::new() }
    }

    /// Forgets what is not yet given out.
    pub fn clear(&mut self) {
        self.received.clear();
    }

    /// Takes bytes from the front of `input` and returns the next packet; `None` once all bytes are taken and no
    /// packet is complete. Call until `None`.
    ///
    /// Cost: a pass over each byte for the header, one for the checksum and one for the stuffing. Noise that
    /// imitates headers costs a checksum over up to `N` bytes for each imitation.
    pub fn feed(&mut self, input: &mut &[u8]) -> Option<Result<Packet<'_>, FrameError>> {
        let found = loop {
            self.received.fill(input);
            if let Some(found) = self.scan(false) {
                break found;
            }
            if input.is_empty() {
                return None;
            }
        };
        Some(found.and_then(|span| self.packet(span)))
    }

    /// As [`feed`](Self::feed) without input, after the line was silent for longer than a packet may pause (1.5 ms
    /// by the manual): packets that are not complete are given up. Call until `None`; the framer is then empty.
    pub fn flush(&mut self) -> Option<Result<Packet<'_>, FrameError>> {
        let found = self.scan(true)?;
        Some(found.and_then(|span| self.packet(span)))
    }

    /// The next packet, which then no longer is pending. `last`: no byte will follow.
    fn scan(&mut self, last: bool) -> Option<Result<Span, FrameError>> {
        loop {
            self.received.skip(to_header(self.received.unread()));
            let pending = self.received.unread();
            let complete = match pending {
                [_, _, _, _, _, low, high, ..] => Self::check(pending, u16::from_le_bytes([*low, *high])),
                _ => None,
            };
            let left = pending.len();
            match complete {
                Some(Ok(len)) => return Some(Ok(self.received.give_out(len))),
                Some(Err(error)) => {
                    self.received.skip(HEADER.len());
                    return Some(Err(error));
                }
                None if last && left > 0 => self.received.skip(HEADER.len().min(left)),
                None => return None,
            }
        }
    }

    /// Length in bytes of the packet that `pending` starts with; `None` when more bytes are needed.
    fn check(pending: &[u8], length: u16) -> Option<Result<usize, FrameError>> {
        let len = PREFIX + usize::from(length);
        if len < OVERHEAD {
            return Some(Err(FrameError::TooShort { length }));
        }
        if len > N {
            return Some(Err(FrameError::TooLong { length }));
        }
        let (body, checksum) = pending.get(..len)?.split_last_chunk::<2>()?;
        let (found, expected) = (u16::from_le_bytes(*checksum), crc::update(0, body));
        if found != expected {
            let id = body.get(HEADER.len()).copied().unwrap_or_default();
            return Some(Err(FrameError::Crc { id, found, expected }));
        }
        Some(Ok(len))
    }

    /// The checked packet that is given out, stuffing removed.
    fn packet(&mut self, span: Span) -> Result<Packet<'_>, FrameError> {
        let bytes = self.received.given(span);
        let [_, _, _, _, id, _, _, instruction, parameters @ .., _, _] = bytes else {
            return Err(FrameError::TooShort { length: 0 });
        };
        let (id, instruction) = (*id, *instruction);
        // Only fast sync read and fast bulk read are answered from the broadcast id, and never stuffed.
        let joint_answer = id == BROADCAST_ID && instruction == Instruction::Status as u8;
        let kept = if joint_answer { parameters.len() } else { unstuff(parameters) };
        Ok(Packet { id, instruction, parameters: parameters.get(..kept).unwrap_or_default() })
    }
}

/// How many bytes to skip until a header, or until what may become one.
fn to_header(bytes: &[u8]) -> usize {
    (0..bytes.len())
        .find(|&at| bytes.iter().skip(at).zip(&HEADER).all(|(byte, expected)| byte == expected))
        .unwrap_or(bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamixel::packet::{PacketWriter, max_packet_len};

    const N: usize = 96;

    type Owned = (u8, u8, Vec<u8>);

    /// The same numbers on every run.
    struct Random(fastrand::Rng);

    impl Random {
        fn new(seed: u64) -> Self {
            Self(fastrand::Rng::with_seed(seed))
        }

        fn below(&mut self, bound: usize) -> usize {
            self.0.usize(..bound)
        }

        /// Bytes in which headers and their parts are common.
        fn bytes(&mut self, len: usize) -> Vec<u8> {
            (0..len).map(|_| [0xFF, 0xFF, 0xFF, 0xFD, 0xFD, 0x00, 0x01, 0x55][self.below(8)]).collect()
        }
    }

    fn written((id, code, parameters): &Owned) -> Vec<u8> {
        let mut buffer = vec![0; max_packet_len(parameters.len())];
        let instruction = Instruction::from_code(*code).unwrap();
        let mut writer = PacketWriter::new(&mut buffer, *id, instruction).unwrap();
        writer.push(parameters).unwrap();
        writer.finish().unwrap().to_vec()
    }

    fn random_packet(random: &mut Random) -> Owned {
        let codes = [0x01, 0x02, 0x03, 0x55, 0x83];
        let len = random.below(48);
        (random.below(253) as u8, codes[random.below(codes.len())], random.bytes(len))
    }

    fn owned(packet: Packet<'_>) -> Owned {
        (packet.id, packet.instruction, packet.parameters.to_vec())
    }

    /// Everything that a stream holds, fed in chunks of random length and flushed at its end.
    fn read(stream: &[u8], random: &mut Random, longest_chunk: usize) -> (Vec<Owned>, Vec<FrameError>) {
        let (mut packets, mut errors) = (Vec::new(), Vec::new());
        let mut sort = |event: Result<Packet<'_>, FrameError>| match event {
            Ok(packet) => packets.push(owned(packet)),
            Err(error) => errors.push(error),
        };
        let mut framer = Framer::<N>::new();
        let mut rest = stream;
        while !rest.is_empty() {
            let (mut chunk, later) = rest.split_at((1 + random.below(longest_chunk)).min(rest.len()));
            while let Some(event) = framer.feed(&mut chunk) {
                sort(event);
            }
            assert!(chunk.is_empty());
            rest = later;
        }
        while let Some(event) = framer.flush() {
            sort(event);
        }
        (packets, errors)
    }

    #[test]
    fn any_parameters_come_back_under_any_chunking() {
        let mut random = Random::new(1);
        for round in 0..2000 {
            let packets: Vec<Owned> = (0..1 + random.below(4)).map(|_| random_packet(&mut random)).collect();
            let stream: Vec<u8> = packets.iter().flat_map(written).collect();
            let longest = [1, 3, 17, 500][round % 4];
            assert_eq!(read(&stream, &mut random, longest), (packets, vec![]));
        }
    }

    #[test]
    fn packets_are_found_behind_noise() {
        let mut random = Random::new(2);
        let (mut found, mut lost) = (0, 0);
        for _ in 0..2000 {
            let mut stream = Vec::new();
            let packets: Vec<Owned> = (0..3).map(|_| random_packet(&mut random)).collect();
            for packet in &packets {
                let len = random.below(12);
                stream.extend(random.bytes(len));
                stream.extend(written(packet));
            }
            let (read, _) = read(&stream, &mut random, 40);
            found += packets.iter().filter(|packet| read.contains(packet)).count();
            lost += packets.iter().filter(|packet| !read.contains(packet)).count();
        }
        // Noise that ends in `FF` moves no header (FF FF FF FD 00 holds one), so nothing may be lost.
        assert_eq!((found, lost), (6000, 0));
    }

    #[test]
    fn chunking_changes_nothing_in_noise() {
        let mut random = Random::new(3);
        for _ in 0..500 {
            let len = random.below(400);
            let mut stream = random.bytes(len);
            stream.extend(written(&(9, 1, vec![])));
            let whole = read(&stream, &mut random, 1_000_000).0;
            assert_eq!(read(&stream, &mut random, 1).0, whole);
        }
    }

    #[test]
    fn a_flipped_bit_never_passes_and_never_hides_the_next_packet() {
        let next = (4, 0x01, vec![]);
        for packet in [(1, 0x03, vec![0x74, 0, 0xFF, 0xFF, 0xFD, 0]), (2, 0x55, vec![0x80, 1, 2, 3, 4])] {
            let good = written(&packet);
            for bit in 0..good.len() * 8 {
                let mut stream = good.clone();
                stream[bit / 8] ^= 1 << (bit % 8);
                stream.extend(written(&next));
                let (packets, _) = read(&stream, &mut Random::new(4), 7);
                assert_eq!(packets, std::slice::from_ref(&next), "bit {bit}");
            }
        }
    }

    #[test]
    fn a_cut_packet_does_not_hide_the_next() {
        let next = (4, 0x01, vec![]);
        let good = written(&(1, 0x03, vec![0x74, 0, 0xFF, 0xFF, 0xFD, 0]));
        for cut in 0..good.len() {
            let mut stream = good[..cut].to_vec();
            stream.extend(written(&next));
            assert_eq!(read(&stream, &mut Random::new(5), 7).0, std::slice::from_ref(&next), "cut at {cut}");
        }
    }

    #[test]
    fn says_what_was_wrong() {
        let events = |stream: &[u8]| read(stream, &mut Random::new(6), 100).1;
        let ping = written(&(1, 0x01, vec![]));
        let mut wrong = ping.clone();
        wrong[9] = 0;
        assert_eq!(events(&wrong), [FrameError::Crc { id: 1, found: 0x0019, expected: 0x4E19 }]);
        let mut short = ping.clone();
        short[5] = 2;
        assert_eq!(events(&short), [FrameError::TooShort { length: 2 }]);
        let mut long = ping;
        long[5] = N as u8 - 6;
        assert_eq!(events(&long), [FrameError::TooLong { length: N as u16 - 6 }]);
    }

    #[test]
    fn the_joint_answer_of_a_fast_read_is_not_stuffed() {
        // The example of the e-Manual, and one whose data would lose a byte if stuffing were removed.
        let example = [
            0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x19, 0x00, 0x55, 0x00, 0x03, 0xA6, 0x00, 0x00, 0x00, 0x84, 0x08,
            0x00, 0x07, 0x1F, 0x08, 0x00, 0x00, 0x16, 0xCA, 0x00, 0x04, 0xFF, 0x03, 0x00, 0x00, 0xD1, 0x9E,
        ];
        let (packets, errors) = read(&example, &mut Random::new(7), 5);
        assert_eq!(packets, [(0xFE, 0x55, example[8..30].to_vec())]);
        assert_eq!(errors, []);
        let mut bare = vec![0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0x09, 0x00, 0x55, 0, 1, 0xFF, 0xFF, 0xFD, 0xFD];
        bare.extend(crc::update(0, &bare).to_le_bytes());
        let (packets, _) = read(&bare, &mut Random::new(8), 5);
        assert_eq!(packets, [(0xFE, 0x55, vec![0, 1, 0xFF, 0xFF, 0xFD, 0xFD])]);
    }
}
