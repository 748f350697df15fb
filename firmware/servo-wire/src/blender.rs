//! The live frame of the Blender Servo Animation add-on: `<`, id, position high, position low, `>`.
//!
//! The add-on sends one for each servo whose position changed, over serial or a WebSocket. Positions are 0 to 65535 in
//! units of the user's choice (the add-on's "position min" and "position max": degrees, microseconds, or steps
//! of a PCA9685); here they are goal units. There is no checksum.
//!
//! Source: timhendriks93/blender-servo-animation, `addon/utils/live_mode.py`, and the Arduino library of the same
//! author.

use crate::bus::{BusError, Goal, MAX_SERVOS, ServoBus};
use embassy_futures::select::{Either, select};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::Write;

/// First byte.
pub const START: u8 = b'<';

/// Last byte.
pub const END: u8 = b'>';

/// Bytes of a frame.
pub const FRAME_LEN: usize = 5;

/// A frame; positions beyond 0 to 65535 are clamped.
#[must_use]
pub fn frame(goal: &Goal) -> [u8; FRAME_LEN] {
    let [high, low] = (goal.position.clamp(0, u16::MAX.into()) as u16).to_be_bytes();
    [START, goal.id, high, low, END]
}

/// Finds frames in a stream of bytes.
///
/// ```
/// use servo_wire::blender::Parser;
/// let mut parser = Parser::new();
/// let goals: Vec<_> = b"x<\x07\x05\xdc>".iter().filter_map(|&byte| parser.feed(byte)).collect();
/// assert_eq!((goals[0].id, goals[0].position), (7, 1500));
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Parser {
    window: [u8; FRAME_LEN],
    len: usize,
}

impl Parser {
    /// A parser that has seen nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { window: [0; FRAME_LEN], len: 0 }
    }

    /// Takes a byte and returns the goal of the frame that it ends.
    ///
    /// A `<` within a frame does not start another one: it may be an id or half a position. Where a frame does not
    /// end with
    /// `>`, its bytes are searched again for a start.
    pub fn feed(&mut self, byte: u8) -> Option<Goal> {
        if let Some(slot) = self.window.get_mut(self.len) {
            *slot = byte;
            self.len = self.len.saturating_add(1);
        }
        if let [START, id, high, low, END] = self.window
            && self.len == FRAME_LEN
        {
            self.len = 0;
            return Some(Goal { id, position: u16::from_be_bytes([high, low]).into() });
        }
        let seen = self.window.get(..self.len).unwrap_or_default();
        let from = if self.len == FRAME_LEN || seen.first() != Some(&START) {
            let behind = seen.get(1..).unwrap_or_default();
            behind.iter().position(|&byte| byte == START).map_or(self.len, |at| at.saturating_add(1))
        } else {
            0
        };
        let kept = self.len.saturating_sub(from);
        for at in 0..kept {
            let byte = self.window.get(at.saturating_add(from)).copied().unwrap_or_default();
            if let Some(place) = self.window.get_mut(at) {
                *place = byte;
            }
        }
        self.len = kept;
        None
    }
}

/// Servos behind something that takes the add-on's frames, such as its Arduino library, as a [`ServoBus`].
///
/// A frame goes out where a goal changed, and one unasked each time, so that a lost one is made good. Nothing can be
/// read back, and torque is on by the first frame.
#[derive(Debug)]
pub struct BlenderBus<W, T> {
    output: W,
    delay: T,
    baud: u32,
    sent: [Option<i32>; MAX_SERVOS],
    refresh: usize,
}

impl<W: Write, T: DelayNs> BlenderBus<W, T> {
    /// A bus on a serial output of this many bits per second. 115,200 carry 23 frames in 10 ms.
    pub const fn new(output: W, delay: T, baud: u32) -> Self {
        Self { output, delay, baud, sent: [None; MAX_SERVOS], refresh: 0 }
    }

    /// Longest time in microseconds that [`write_goals`](ServoBus::write_goals) takes.
    #[must_use]
    pub const fn write_limit_us(baud: u32, servos: usize) -> u32 {
        let bits = (10 * FRAME_LEN).saturating_mul(servos) as u32;
        let baud = if baud == 0 { 1 } else { baud };
        bits.saturating_mul(1_000_000 / 200).div_ceil(baud).saturating_mul(200).saturating_add(20_000)
    }
}

impl<W: Write, T: DelayNs> ServoBus for BlenderBus<W, T> {
    async fn ping(&mut self, _ids: &[u8], index: usize) -> Result<(), BusError> {
        if index < MAX_SERVOS { Ok(()) } else { Err(BusError::TooMany) }
    }

    /// The frame knows no torque: on succeeds, since the first goal turns it on, off is [`BusError::Unsupported`].
    async fn set_torque(&mut self, _ids: &[u8], _index: usize, on: bool) -> Result<(), BusError> {
        if on { Ok(()) } else { Err(BusError::Unsupported) }
    }

    async fn write_goals(&mut self, goals: &[Goal]) -> Result<(), BusError> {
        if goals.len() > MAX_SERVOS {
            return Err(BusError::TooMany);
        }
        let limit = Self::write_limit_us(self.baud, goals.len());
        self.refresh = Some(self.refresh.saturating_add(1)).filter(|&next| next < goals.len()).unwrap_or(0);
        let Self { output, delay, sent, refresh, .. } = self;
        let write = async {
            for (index, (goal, sent)) in goals.iter().zip(sent).enumerate() {
                if *sent != Some(goal.position) || index == *refresh {
                    *sent = None;
                    let frame = frame(goal);
                    let mut rest = frame.as_slice();
                    // `write_all` panics where a driver takes nothing.
                    while !rest.is_empty() {
                        let taken = output.write(rest).await?;
                        match rest.get(taken..).filter(|_| taken > 0) {
                            Some(left) => rest = left,
                            None => return Ok(false),
                        }
                    }
                    *sent = Some(goal.position);
                }
            }
            output.flush().await.map(|()| true)
        };
        match select(write, delay.delay_us(limit)).await {
            Either::First(Ok(true)) => Ok(()),
            Either::First(_) | Either::Second(()) => Err(BusError::Port),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::NoTime;
    use core::future::pending;
    use embassy_futures::block_on;

    fn goals(stream: &[u8]) -> Vec<(u8, i32)> {
        let mut parser = Parser::new();
        stream.iter().filter_map(|&byte| parser.feed(byte)).map(|goal| (goal.id, goal.position)).collect()
    }

    /// What the add-on computes: `[0x3C, servo_id] + position.to_bytes(2, 'big') + [0x3E]`.
    fn written_by_the_addon(id: u8, position: u16) -> Vec<u8> {
        let mut bytes = vec![0x3C, id];
        bytes.extend(position.to_be_bytes());
        bytes.push(0x3E);
        bytes
    }

    #[test]
    fn every_id_and_position_comes_through() {
        let mut stream = Vec::new();
        let mut expected = Vec::new();
        for id in 0..=255 {
            for position in [0, 1, 0x3C, 0x3E, 0x3C3C, 0x3E3E, 0x3C3E, 0x3E3C, 1500, u16::MAX] {
                stream.extend(written_by_the_addon(id, position));
                assert_eq!(frame(&Goal { id, position: position.into() })[..], stream[stream.len() - 5..]);
                expected.push((id, i32::from(position)));
            }
        }
        assert_eq!(goals(&stream), expected);
    }

    #[test]
    fn positions_are_clamped() {
        assert_eq!(frame(&Goal { id: 9, position: -1 }), [b'<', 9, 0, 0, b'>']);
        assert_eq!(frame(&Goal { id: 9, position: i32::MAX }), [b'<', 9, 0xFF, 0xFF, b'>']);
    }

    #[test]
    fn a_cut_frame_costs_at_most_the_next() {
        let good = written_by_the_addon(1, 1500);
        for cut in 1..good.len() {
            let mut stream = good[..cut].to_vec();
            for id in [2, 3] {
                stream.extend(written_by_the_addon(id, 1600));
            }
            assert_eq!(goals(&stream), [(2, 1600), (3, 1600)], "cut at {cut}");
        }
    }

    #[derive(Default)]
    struct Sink {
        bytes: Vec<u8>,
        stuck: bool,
    }

    impl embedded_io_async::ErrorType for Sink {
        type Error = embedded_io_async::ErrorKind;
    }

    impl Write for Sink {
        async fn write(&mut self, bytes: &[u8]) -> Result<usize, Self::Error> {
            if self.stuck {
                pending::<()>().await;
            }
            self.bytes.extend(bytes);
            Ok(bytes.len())
        }

        async fn flush(&mut self) -> Result<(), Self::Error> {
            Ok(())
        }
    }

    #[test]
    fn what_changed_goes_out_and_one_more() {
        let mut sink = Sink::default();
        let mut bus = BlenderBus::new(&mut sink, NoTime, 115_200);
        let mut goal = [1, 2, 3].map(|id| Goal { id, position: 100 });
        let mut sent = |goal: &[Goal]| {
            block_on(bus.write_goals(goal)).unwrap();
            let bytes = core::mem::take(&mut bus.output.bytes);
            goals(&bytes)
        };
        assert_eq!(sent(&goal), [(1, 100), (2, 100), (3, 100)]);
        assert_eq!(sent(&goal), [(3, 100)]);
        goal[1].position = 101;
        assert_eq!(sent(&goal), [(1, 100), (2, 101)]);
        assert_eq!(sent(&goal), [(2, 101)]);
        assert_eq!(sent(&goal), [(3, 100)]);
    }

    #[test]
    fn a_stuck_output_is_an_error_and_the_goals_go_out_later() {
        let mut sink = Sink { bytes: Vec::new(), stuck: true };
        let mut bus = BlenderBus::new(&mut sink, NoTime, 9600);
        let goal = [1, 2].map(|id| Goal { id, position: 7 });
        assert_eq!(block_on(bus.write_goals(&goal)), Err(BusError::Port));
        bus.output.stuck = false;
        block_on(bus.write_goals(&goal)).unwrap();
        assert_eq!(goals(&sink.bytes), [(1, 7), (2, 7)]);
    }
}
