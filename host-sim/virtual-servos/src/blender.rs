//! What the live frames of Blender Servo Animation go to: a board with the add-on's Arduino library, without its
//! servos.

use crate::config::ConfigError;
use crate::virtual_bus::{Disturbance, Event, VirtualBus};
use servo_wire::blender::Parser;

/// Takes frames, and answers nothing, as such a board does. Frames with other ids than its servos' are ignored.
pub struct BlenderSink {
    ids: Vec<u8>,
    parser: Parser,
}

impl BlenderSink {
    /// A board with these servos.
    #[must_use]
    pub const fn new(ids: Vec<u8>) -> Self {
        Self { ids, parser: Parser::new() }
    }
}

impl VirtualBus for BlenderSink {
    fn receive(&mut self, bytes: &[u8], time_us: u64, tap: &mut dyn FnMut(Event)) -> Vec<u8> {
        let Self { ids, parser } = self;
        let goals = bytes.iter().filter_map(|&byte| parser.feed(byte)).filter(|goal| ids.contains(&goal.id));
        goals.for_each(|goal| tap(Event::Goal { time_us, id: goal.id, position: goal.position }));
        Vec::new()
    }

    /// Nothing can be seen of what happens to its servos.
    fn schedule(&mut self, _: u64, disturbance: Disturbance) -> Result<(), ConfigError> {
        disturbance.servo().map_or(Ok(()), |servo| Err(ConfigError::Absent(servo)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_its_servos_are_taken() {
        let mut sink = BlenderSink::new(vec![3, 7]);
        let mut taken = Vec::new();
        for (time_us, bytes) in [(5, &b"x<\x07\x05"[..]), (9, b"\xdc><\x08\x05\xdc>")] {
            assert!(sink.receive(bytes, time_us, &mut |event| taken.push(event)).is_empty());
        }
        assert_eq!(taken, [Event::Goal { time_us: 9, id: 7, position: 1500 }]);
    }
}
