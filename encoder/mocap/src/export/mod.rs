//! Export of motions: AMC, BVH, CSV, GLB, and JSON of servo positions.
//!
//! Functions write to any [`Write`](std::io::Write); it is the caller who makes files, writes them under a temporary name and
//! renames them.

pub mod amc;
pub mod bvh;
pub mod csv;
mod error;
pub mod glb;
mod number;
mod pose;
pub mod servo_json;

pub use error::ExportError;
