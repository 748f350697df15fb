//! All clips of a puppet: linked into the image, in flash, or streamed.
//!
//! ```
//! use decoder_core::{I16F16, Limits};
//! use firmware::clips::{Clips, DecoderMemory, Mailbox, Worker, decode};
//! use firmware::store::Store;
//! use firmware::stream::{Live, Memory, PlayerMemory, Settings};
//! use core::pin::pin;
//!
//! # fn with<F: firmware::store::MappedFlash>(store: Option<Store<F>>, linked: &'static [u8]) {
//! let (mut buffer, mut header, mut block) = ([0; 8192], [0; 1024], [0; 1024]);
//! let mut poses = [[I16F16::ZERO; 64]; 4];
//! let player = PlayerMemory { header: &mut header, block: &mut block, poses: poses.each_mut().map(|pose| &mut pose[..]) };
//! let limits = Limits { channels: 64, frames: u32::MAX };
//! let settings = Settings { ahead_millis: 200, lost_millis: 500, limits };
//! let live = Live::new(Memory { buffer: &mut buffer, player }, settings);
//! let (mut first, mut second) = (DecoderMemory::<64, 0, 2048, 64>::new(), DecoderMemory::<64, 0, 2048, 64>::new());
//! let (mut poses, mailboxes) = ([[I16F16::ZERO; 64]; 2], [Mailbox::new(), Mailbox::new()]);
//! let first = pin!(decode(&mailboxes[0], &mut first, &live));
//! let second = pin!(decode(&mailboxes[1], &mut second, &live));
//! let [one, other] = poses.each_mut();
//! let workers = [Worker::new(first, &mailboxes[0], one), Worker::new(second, &mailboxes[1], other)];
//! let linked = [linked];
//! let clips = Clips::new(&linked, store, &live, workers);
//! # }
//! ```

mod clip_library;
mod with_live;
mod worker;

pub use crate::library::LIVE;
pub use clip_library::{Clips, OpenClip};
pub use with_live::{ClipOrLive, WithLive};
pub use worker::{DecoderMemory, Mailbox, Worker, decode};
