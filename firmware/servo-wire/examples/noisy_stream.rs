//! Writes a Sync Write packet, then finds the answers of servos in bytes that a bad line has been through.

use servo_wire::bus::Goal;
use servo_wire::dynamixel::{Framer, Instruction, PacketWriter, goal_positions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let goals = [Goal { id: 1, position: 1024 }, Goal { id: 2, position: 3072 }];
    let mut buffer = [0; 64];
    println!("sent:  {:02X?}", goal_positions(&mut buffer, &goals)?);

    // Two servos answer with their positions, among noise; a bit of the second answer is flipped.
    let mut line = vec![0xFF, 0xFF, 0xFD];
    for (id, position) in [(1, 1021_i32), (2, 3070), (3, 2048)] {
        let mut writer = PacketWriter::new(&mut buffer, id, Instruction::Status)?;
        writer.push(&[0])?;
        writer.push(&position.to_le_bytes())?;
        let start = line.len();
        line.extend(writer.finish()?);
        if id == 2 {
            line[start + 9] ^= 0x10;
        }
        line.extend([0x00, 0xFF]);
    }
    println!("heard: {line:02X?}");

    // Bytes come in pieces of any length.
    let mut framer = Framer::<64>::new();
    for mut piece in line.chunks(7) {
        while let Some(packet) = framer.feed(&mut piece) {
            match packet {
                Ok(packet) => {
                    let Some(status) = packet.status() else { continue };
                    let Ok(position) = status.parameters.try_into().map(i32::from_le_bytes) else { continue };
                    println!("servo {} is at {position}", status.id);
                }
                Err(error) => println!("lost: {error}"),
            }
        }
    }
    Ok(())
}
