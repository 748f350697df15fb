//! From a player to a servo bus: one Sync Write a tick.

use crate::dynamixel::sync_write::{goal_positions, goal_positions_len, sync_write};
use crate::dynamixel::{WriteError, table::TORQUE_ENABLE};
use crate::player::{Frames, Player};
use core::fmt;
use embedded_io_async::Write;

/// Bytes that [`drive`] wants to be lent for this many servos.
pub const fn buffer_len(servos: usize) -> usize {
    goal_positions_len(servos)
}

/// Turns the servos' torque on and plays to the end; returns the number of ticks.
///
/// `wait(k)` is to return when tick `k` is due, at [`JointMap::tick_micros`](crate::map::JointMap::tick_micros).
/// Each tick is one packet, which is flushed before the next wait. `buffer`: [`buffer_len`] bytes.
///
/// # Errors
/// [`DriveError`]; the servos then hold their last goal.
pub async fn drive<F: Frames, W: Write, const N: usize>(
    player: &mut Player<'_, F, N>,
    bus: &mut W,
    buffer: &mut [u8],
    mut wait: impl AsyncFnMut(u32),
) -> Result<u32, DriveError<W::Error>> {
    let ids = player.map().joints().iter().map(|joint| (joint.id, [1]));
    let torque_on = sync_write(buffer, TORQUE_ENABLE.address, ids).map_err(DriveError::Packet)?;
    send(bus, torque_on).await?;
    let mut tick = 0;
    while let Some(goals) = player.tick() {
        wait(tick).await;
        send(bus, goal_positions(buffer, goals).map_err(DriveError::Packet)?).await?;
        tick += 1;
    }
    Ok(tick)
}

async fn send<W: Write>(bus: &mut W, packet: &[u8]) -> Result<(), DriveError<W::Error>> {
    bus.write_all(packet).await.map_err(DriveError::Bus)?;
    bus.flush().await.map_err(DriveError::Bus)
}

/// Why playing broke off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DriveError<E> {
    /// The bus took no bytes.
    Bus(E),
    /// The buffer that was lent holds no packet for all servos.
    Packet(WriteError),
}

impl<E: fmt::Debug> fmt::Display for DriveError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bus(error) => write!(f, "the servo bus failed: {error:?}"),
            Self::Packet(error) => error.fmt(f),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for DriveError<E> {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamixel::{Framer, Instruction};
    use crate::map::{Joint, JointMap};
    use crate::player::Repeat;
    use core::future::Future;
    use core::pin::pin;
    use core::task::{Context, Poll, Waker};
    use decoder_core::I16F16;

    /// One channel that counts up by one a frame.
    struct Count {
        value: [I16F16; 1],
        left: u32,
    }

    impl Frames for Count {
        fn channels(&self) -> usize {
            1
        }

        fn next_frame(&mut self) -> Option<&[I16F16]> {
            self.left = self.left.checked_sub(1)?;
            self.value[0] += I16F16::ONE;
            Some(&self.value)
        }

        fn rewind(&mut self) {}
    }

    fn ready<T>(future: impl Future<Output = T>) -> T {
        match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(value) => value,
            Poll::Pending => panic!("nothing here waits"),
        }
    }

    fn map() -> JointMap<2> {
        let joint = |id| Joint {
            channel: 0,
            id,
            zero: 0,
            scale: I16F16::from_num(if id == 7 { 256 } else { -256 }),
            min: -4096,
            max: 4096,
            max_step: 4096,
        };
        JointMap::new(50, 1_000_000, [joint(7), joint(9)].into_iter().collect()).unwrap()
    }

    #[test]
    fn every_tick_is_one_packet_with_all_goals() {
        let map = map();
        let count = Count { value: [I16F16::ZERO], left: 3 };
        let mut player = Player::new(count, 5_000, &map, Repeat::Once).unwrap();
        let mut sent = [0u8; 400];
        let mut rest: &mut [u8] = &mut sent;
        let mut waited = Vec::new();
        let mut buffer = [0; buffer_len(2)];
        let ticks = ready(drive(&mut player, &mut rest, &mut buffer, async |tick| waited.push(tick)));
        assert_eq!(ticks, Ok(3));
        assert_eq!(waited, [0, 1, 2]);

        let mut framer = Framer::<64>::new();
        let mut input: &[u8] = &sent;
        let mut packets = Vec::new();
        while let Some(packet) = framer.feed(&mut input) {
            let packet = packet.unwrap();
            assert_eq!((packet.id, packet.instruction), (254, Instruction::SyncWrite as u8));
            packets.push(packet.parameters.to_vec());
        }
        assert_eq!(packets[0], [64, 0, 1, 0, 7, 1, 9, 1]);
        assert_eq!(packets[1], [116, 0, 4, 0, 7, 0, 1, 0, 0, 9, 0, 0xff, 0xff, 0xff]);
        assert_eq!(packets[3], [116, 0, 4, 0, 7, 0, 3, 0, 0, 9, 0, 0xfd, 0xff, 0xff]);
        assert_eq!(packets.len(), 4);
    }

    #[test]
    fn a_full_bus_or_a_small_buffer_is_an_error() {
        let map = map();
        let player =
            || Player::new(Count { value: [I16F16::ZERO], left: 3 }, 5_000, &map, Repeat::Once).unwrap();
        let mut full: &mut [u8] = &mut [0; 20];
        let mut buffer = [0; buffer_len(2)];
        let result = ready(drive(&mut player(), &mut full, &mut buffer, async |_| {}));
        assert!(matches!(result, Err(DriveError::Bus(_))), "{result:?}");
        let mut sent: &mut [u8] = &mut [0; 400];
        let result = ready(drive(&mut player(), &mut sent, &mut [0; 20], async |_| {}));
        assert_eq!(result, Err(DriveError::Packet(WriteError::BufferTooSmall)));
    }
}
