//! Plays a clip that arrives block by block while it plays.
//!
//! [`Live`] takes the header, then packets of whole blocks (docs/FORMAT.md, "Blocks"). A block's header has the number of its
//! first frame: that is the packet's number, so blocks may come late, twice, in another order, or never. They wait in a
//! buffer until their time. [`Player`] plays them, and a [`Reckoner`] bridges what is missing, so a puppet never waits and
//! never jumps.
//!
//! Time goes on by the frames that are played, whether they came or not: what comes too late is left out, and the
//! puppet is in time again.

mod blocks;
mod error;
mod live;
mod memory;
mod player;
mod progress;
mod reckoner;

pub use blocks::MOST_BLOCKS;
pub use error::StreamError;
pub use live::{Live, Settings};
pub use memory::{Memory, PlayerMemory};
pub use player::{CATCH_UP_FRAMES, Player};
pub use progress::{Counters, Progress};
pub use reckoner::{AVERAGE_MILLIS, DECAY_MILLIS, EASE_MILLIS, Made, Reckoner, Reckoning};
