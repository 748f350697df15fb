//! The link to a host: requests in, responses and telemetry out, over any line of bytes.
//!
//! - [`frame`]: frames out of a stream of bytes, and into one
//! - [`message`]: what is said
//! - [`wire`]: how it is written; `numbers` has every number
//! - [`session`]: who says it, how often, and who is gone
//! - [`key`]: who may say it, on lines that others can reach
//!
//! Pure: bytes and times go in, bytes come out. [`device`](crate::device) is what answers.

mod clip_error;
pub mod cobs_writer;
pub mod frame;
mod gate;
pub mod key;
pub mod message;
mod numbers;
pub mod session;
pub mod wire;

#[cfg(test)]
mod examples;
#[cfg(test)]
mod page;
