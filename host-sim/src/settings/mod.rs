//! What servos are set to before they are armed: read, compared with a puppet, and set right.

mod fix;
mod judge;
mod read;
mod survey;
mod table;

pub use fix::{Fixed, fix};
pub use judge::{Expected, Judged, Mismatch, judge};
pub use read::{Settings, read};
pub use survey::{Found, check_before_arming, expected, survey};
pub use table::{Register, Role, address_of, register_names, registers};
