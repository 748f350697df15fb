//! Dynamixel protocol 2.0: the bytes on the servo bus, for the player and for the virtual servos alike.
//!
//! Source: ROBOTIS e-Manual, "DYNAMIXEL Protocol 2.0" and "XM430-W350" (control table of the X series).
//! Nothing here allocates, panics or trusts a length that came over the wire.
//!
//! - [`instruction`]: instruction codes, error numbers, ids
//! - [`table`]: addresses and sizes of the X series control table
//! - [`crc`]: the checksum
//! - [`packet`]: one packet, written into a caller's buffer with byte stuffing
//! - [`framer`]: packets out of a stream of bytes, with resynchronisation
//! - [`sync_write`]: the packet that the player sends every tick
//! - [`client`]: every instruction over a port, with its answers
//! - [`bus`]: servos of the X series as a [`ServoBus`](crate::bus::ServoBus)

pub mod bus;
pub mod client;
pub mod crc;
pub mod framer;
pub mod instruction;
pub mod packet;
pub mod sync_write;
pub mod table;

pub use bus::DynamixelBus;
pub use client::DynamixelClient;
pub use framer::{FrameError, Framer};
pub use instruction::{BROADCAST_ID, ErrorNumber, Instruction, MAX_ID};
pub use packet::{Packet, PacketWriter, Status, WriteError};
pub use sync_write::goal_positions;
