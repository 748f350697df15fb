//! Tests of the core as its users see it, on the golden vectors. One program, since each takes as long to link.
#![allow(clippy::unwrap_used)]

mod choose;
mod common;
mod damage;
mod golden;
mod header;
mod tables;
