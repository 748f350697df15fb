//! Real ports: the firmware's bus clients on serial ports of this machine.

mod bus;
mod clock;
mod end;
mod live;
mod serial;
pub mod virtual_buses;

pub use bus::{Buses, Identity, RETURN_DELAY_US, SLACK_US, SerialBus, TRIES, join, open, open_each, paths};
pub use clock::{Clock, ComputerClock, InstantClock};
pub use live::{Late, Played, Told, follow, play};
pub use serial::block_on;
