//! Bytes on the servo bus.

use crate::Random;
use servo_wire::dynamixel::packet::max_packet_len;
use servo_wire::dynamixel::{FrameError, Framer, Instruction, PacketWriter};

/// Bytes that the framer holds: little, so that packets are too long for it too.
const HOLDS: usize = 96;

type Packet = (u8, u8, Vec<u8>);

/// Packets of the manual and streams of several, with what must be stuffed.
pub fn seeds() -> Vec<Vec<u8>> {
    let status = written(7, Instruction::Status, &[0, 0xff, 0xff, 0xfd, 0xff, 0xff, 0xfd, 0xfd, 1]);
    let ping = vec![0xff, 0xff, 0xfd, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4e];
    let long = written(0xfe, Instruction::SyncWrite, &(0..80).collect::<Vec<u8>>());
    let too_long = written(3, Instruction::Write, &[0x55; 120]);
    vec![[ping.as_slice(), &[0xff, 0xff], &status].concat(), [too_long, ping].concat(), long, status]
}

fn written(id: u8, instruction: Instruction, parameters: &[u8]) -> Vec<u8> {
    let mut buffer = vec![0; max_packet_len(parameters.len())];
    let mut writer =
        PacketWriter::new(&mut buffer, id, instruction).unwrap_or_else(|error| panic!("{error}"));
    writer.push(parameters).unwrap_or_else(|error| panic!("{error}"));
    writer.finish().unwrap_or_else(|error| panic!("{error}")).to_vec()
}

/// Frames the bytes as a stream however it is cut, and carries them as parameters.
///
/// # Panics
/// Where chunks change what is found, or a packet that is written is not found again.
pub fn check(bytes: &[u8]) -> bool {
    let mut random = Random::of(bytes);
    let whole = read(&[bytes]);
    let longest = 1 << random.below(7);
    assert_eq!(whole, read(&random.chunks(bytes, longest)), "in chunks of up to {longest}");

    // With stuffing, so that the framer holds it.
    let most = bytes.len().min(HOLDS * 3 / 4 - 8);
    let parameters = &bytes[..most];
    let packet = written(most as u8, Instruction::Write, parameters);
    let expected = (most as u8, Instruction::Write as u8, parameters.to_vec());
    assert_eq!(read(&[&packet]), (vec![expected], vec![]));
    !whole.0.is_empty()
}

/// All packets and errors of a stream, which then ends.
fn read(chunks: &[&[u8]]) -> (Vec<Packet>, Vec<FrameError>) {
    let (mut packets, mut errors) = (Vec::new(), Vec::new());
    let mut sort = |event: Result<servo_wire::dynamixel::Packet<'_>, FrameError>| match event {
        Ok(packet) => {
            if let Some(status) = packet.status() {
                assert_eq!(packet.parameters.first(), Some(&status.error));
                let _ = status.error_number();
            }
            packets.push((packet.id, packet.instruction, packet.parameters.to_vec()));
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            errors.push(error);
        }
    };
    let mut framer = Framer::<HOLDS>::new();
    for mut chunk in chunks.iter().copied() {
        while let Some(event) = framer.feed(&mut chunk) {
            sort(event);
        }
        assert!(chunk.is_empty(), "all of a chunk is taken");
    }
    while let Some(event) = framer.flush() {
        sort(event);
    }
    (packets, errors)
}
