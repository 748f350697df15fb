//! One packet: `FF FF`, id, length, instruction (of an answer: error), parameters, checksum.
//!
//! Length counts from the instruction to the checksum; the checksum is the complement of the sum of all bytes from
//! id to the last parameter. Nothing is stuffed, so a header may appear inside a packet; the id is never `FF`, which
//! tells a longer run of `FF` from a header.

use crate::bus::BusError;
use crate::receive_buffer::{ReceiveBuffer, Span};

/// Id that addresses every servo on the bus.
pub const BROADCAST_ID: u8 = 254;

/// Bytes of a packet without parameters.
pub const OVERHEAD: usize = 6;

/// Bytes before the ones that length counts: header, id, length.
const PREFIX: usize = 4;

/// Most bytes of parameters that a packet can have.
pub const MAX_PARAMETERS: usize = 253;

/// What a packet asks for. The last three are Feetech's; of Dynamixel servos only MX know `0x92`, Bulk Read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Instruction {
    /// Is there a servo; answered without parameters.
    Ping = 0x01,
    /// Address, length; answers the bytes.
    Read = 0x02,
    /// Address, bytes.
    Write = 0x03,
    /// As write, but carried out by [`Instruction::Action`].
    RegWrite = 0x04,
    /// Carry out what [`Instruction::RegWrite`] registered.
    Action = 0x05,
    /// Back to factory values, id and baud rate too.
    FactoryReset = 0x06,
    /// Address, length, then id and bytes of each servo; no answer.
    SyncWrite = 0x83,
    /// Restart; Feetech.
    Reboot = 0x08,
    /// Address, length, ids; each servo answers in this order. Feetech STS and SMS.
    SyncRead = 0x82,
}

/// A packet whose checksum was right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet<'a> {
    /// Addressee of an instruction, sender of an answer.
    pub id: u8,
    /// Code of an instruction, or the error byte of an answer: the frame does not tell one from the other.
    pub code: u8,
    /// What follows.
    pub parameters: &'a [u8],
}

fn checksum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte))
}

/// Writes a packet whose parameters are `parts`, one behind the other, and returns it.
///
/// # Errors
/// [`BusError::TooMany`] when the buffer or 255 as the greatest length does not hold it.
pub fn write<'b>(buffer: &'b mut [u8], id: u8, code: u8, parts: &[&[u8]]) -> Result<&'b [u8], BusError> {
    let parameters: usize = parts.iter().fold(0, |sum: usize, part| sum.saturating_add(part.len()));
    if parameters > MAX_PARAMETERS {
        return Err(BusError::TooMany);
    }
    let packet = buffer.get_mut(..parameters.saturating_add(OVERHEAD)).ok_or(BusError::TooMany)?;
    let [first, second, body @ .., last] = packet else { return Err(BusError::TooMany) };
    (*first, *second) = (0xFF, 0xFF);
    let start = [id, parameters.saturating_add(2) as u8, code];
    let bytes = start.iter().chain(parts.iter().copied().flatten());
    for (slot, &byte) in body.iter_mut().zip(bytes) {
        *slot = byte;
    }
    *last = checksum(body);
    Ok(packet)
}

/// Finds packets in a stream, keeping at most `N` bytes.
///
/// A length that came over the wire only says how long to wait: where the checksum does not match, only a byte is
/// given up and the rest is searched again.
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
    /// Cost: a pass over each byte, and one more over up to `N` bytes for each header that was none.
    pub fn feed(&mut self, input: &mut &[u8]) -> Option<Packet<'_>> {
        loop {
            self.received.fill(input);
            if let Some(span) = self.scan(false) {
                return self.packet(span);
            }
            if input.is_empty() {
                return None;
            }
        }
    }

    /// As [`feed`](Self::feed) without input, when no byte will follow: packets that are not complete are given up.
    /// Call until `None`; the framer is then empty.
    pub fn flush(&mut self) -> Option<Packet<'_>> {
        let span = self.scan(true)?;
        self.packet(span)
    }

    /// The next packet, which then no longer is pending. `last`: no byte will follow.
    fn scan(&mut self, last: bool) -> Option<Span> {
        loop {
            let pending = self.received.unread();
            let len = match pending {
                [] => return None,
                // No header, an id of FF, a length below 2 or a packet that the buffer does not hold.
                [0xFF, 0xFF, 0xFF, ..] => None,
                [0xFF, 0xFF, _, length, ..] if *length >= 2 => {
                    Some(PREFIX + usize::from(*length)).filter(|&len| len <= N)
                }
                [0xFF, 0xFF, _] | [0xFF, 0xFF] | [0xFF] if !last => return None,
                _ => None,
            };
            let whole = len.map(|len| pending.get(..len));
            match (len, whole) {
                (Some(_), Some(None)) if !last => return None,
                (Some(len), Some(Some([_, _, body @ .., sum]))) if checksum(body) == *sum => {
                    return Some(self.received.give_out(len));
                }
                _ => self.received.skip(1),
            }
        }
    }

    fn packet(&mut self, span: Span) -> Option<Packet<'_>> {
        match self.received.given(span) {
            [_, _, id, _, code, parameters @ .., _] => Some(Packet { id: *id, code: *code, parameters }),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 64;

    type Owned = (u8, u8, Vec<u8>);

    fn written((id, code, parameters): &Owned) -> Vec<u8> {
        let mut buffer = [0; 300];
        write(&mut buffer, *id, *code, &[parameters]).unwrap().to_vec()
    }

    fn read(stream: &[u8], chunk: usize) -> Vec<Owned> {
        let mut framer = Framer::<N>::new();
        let mut packets = Vec::new();
        for mut bytes in stream.chunks(chunk) {
            while let Some(packet) = framer.feed(&mut bytes) {
                packets.push((packet.id, packet.code, packet.parameters.to_vec()));
            }
        }
        while let Some(packet) = framer.flush() {
            packets.push((packet.id, packet.code, packet.parameters.to_vec()));
        }
        packets
    }

    /// The examples of the e-Manual's page "DYNAMIXEL Protocol 1.0".
    #[test]
    fn writes_the_examples_of_the_manual() {
        for (id, code, parameters, packet) in [
            (1, 1, &[][..], &[0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB][..]),
            (1, 0, &[], &[0xFF, 0xFF, 0x01, 0x02, 0x00, 0xFC]),
            (1, 2, &[0x2B, 0x01], &[0xFF, 0xFF, 0x01, 0x04, 0x02, 0x2B, 0x01, 0xCC]),
            (1, 0, &[0x20], &[0xFF, 0xFF, 0x01, 0x03, 0x00, 0x20, 0xDB]),
            (0xFE, 3, &[0x03, 0x01], &[0xFF, 0xFF, 0xFE, 0x04, 0x03, 0x03, 0x01, 0xF6]),
            (0xFE, 5, &[], &[0xFF, 0xFF, 0xFE, 0x02, 0x05, 0xFA]),
            (0, 6, &[], &[0xFF, 0xFF, 0x00, 0x02, 0x06, 0xF7]),
        ] {
            assert_eq!(written(&(id, code, parameters.to_vec())), packet);
            assert_eq!(read(packet, 100), [(id, code, parameters.to_vec())]);
        }
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        assert_eq!(write(&mut [0; 7], 1, 2, &[&[1], &[2]]), Err(BusError::TooMany));
        assert!(write(&mut [0; 300], 1, 2, &[&[0; 253]]).is_ok());
        assert_eq!(write(&mut [0; 300], 1, 2, &[&[0; 254]]), Err(BusError::TooMany));
    }

    #[test]
    fn a_flipped_bit_or_a_cut_never_passes_and_never_hides_the_next_packet() {
        let next: Owned = (4, 0, vec![7]);
        let good = written(&(1, 0, vec![0xFF, 0xFF, 3, 0x20, 0]));
        for chunk in [1, 5, 100] {
            for bit in 0..good.len() * 8 {
                let mut stream = good.clone();
                stream[bit / 8] ^= 1 << (bit % 8);
                stream.extend(written(&next));
                let packets = read(&stream, chunk);
                assert!(packets.contains(&next), "bit {bit}");
                assert!(packets.iter().all(|packet| packet == &next || packet.2.len() < 5), "bit {bit}");
            }
            for cut in 0..good.len() {
                let mut stream = good[..cut].to_vec();
                stream.extend(written(&next));
                assert!(read(&stream, chunk).contains(&next), "cut at {cut}");
            }
        }
    }

    #[test]
    fn packets_are_found_behind_noise_and_under_any_chunking() {
        let packets: Vec<Owned> = vec![(1, 0, vec![]), (2, 0x24, vec![1, 2, 3]), (3, 0, vec![0xFF; 20])];
        let mut stream = vec![0xFF, 0xFF, 0xFF, 0x00, 0x13, 0xFF];
        for packet in &packets {
            stream.extend(written(packet));
            stream.extend([0xFF, 0x00, 0xFF]);
        }
        for chunk in 1..stream.len() {
            assert_eq!(read(&stream, chunk), packets, "chunks of {chunk}");
        }
    }
}
