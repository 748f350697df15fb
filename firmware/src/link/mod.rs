//! The link to a host: requests in, responses and telemetry out, over any line of bytes.
//!
//! - [`frame`]: frames out of a stream of bytes, and into one
//! - [`message`]: what is said
//! - [`session`]: who says it, how often, and who is gone
//!
//! Pure: bytes and times go in, bytes come out. [`device`](crate::device) is what answers.

pub mod frame;
pub mod message;
pub mod session;

#[cfg(test)]
mod examples;
