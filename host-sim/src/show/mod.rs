//! A show: clips, what is played when, and what happens to the servos meanwhile; run to its end here, on the simulated core
//! or under QEMU, and told on one page.
//!
//! ```toml
//! puppet = "cmu-20.toml"    # beside this file
//! skeleton = "02.asf"       # optional: the puppet's own unless given
//! playlist = ["walk", "dance"]
//! repeats = false           # whether the playlist begins again; so also the others where they are not given:
//! idle = "stand"            # clip that is repeated while nothing else plays; none
//! trigger = "wave"          # clip that the trigger starts; none
//! after = "home"            # or "hold": what the puppet does after its clips
//!
//! [[clip]]
//! name = "walk"
//! file = "walk.mclip"
//!
//! [[event]]
//! at = 3.5                  # seconds since the first goals were sent
//! what = "restart"          # of the servo: restart, silence (seconds), turn (position); of the bus: cut (seconds)
//! servo = 7
//!
//! [[event]]
//! at = 5.0
//! what = "acknowledge"      # or trigger, pause, resume, stop, home, link-lost, speed (factor), seek (frame), play, queue (clip)
//!
//! [[event]]
//! at = 7.0
//! what = "stream"           # the clip is sent live from here on, block by block, and plays as it comes (65535 in the log)
//! clip = "walk"             # a .mclip: with ten entry points a second a gap is over soonest (encode --entry 12 --block 400)
//!
//! [[event]]
//! at = 8.0
//! what = "gap"              # what is sent is lost: concealed, and after half a second a lost link
//! seconds = 0.3
//! ```
//!
//! Time counts ticks in which goals are sent, so that all three runs tell the servos the same.

mod file;
mod html;
mod images;
mod played;
mod summary;

pub use crate::play::{Note, NoteKind};
pub use file::Program;
pub use html::show_page;
pub use played::{Cost, PlayedShow, Tamper, image, on_host, on_qemu, on_sim, on_sim_wire};
pub use summary::{ServoSummary, StreamSummary, Summary};
