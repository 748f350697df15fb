//! A client of protocol 2.0: one instruction out, its answers back.
//!
//! Each method is one exchange and returns within
//! [`LineConfig::exchange_limit_us`](crate::port::LineConfig::exchange_limit_us). Noise before and between answers is
//! skipped, answers of other servos and of other lengths are not taken for the one awaited, and the port's own bytes
//! never are: an instruction is no status packet.
//!
//! Servos must answer everything (Status Return Level 2, as from the factory).

mod fast;
mod group;
mod single;

pub use fast::joint_answer_len;
pub use group::BulkItem;
pub use single::{Answer, DynamixelClient, FactoryReset, Ping};
