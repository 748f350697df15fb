//! All clips of a puppet: linked into the image, in flash, or streamed.
//!
//! ```
//! use decoder_core::{I16F16, Limits};
//! use firmware::clips::{Clips, Post, Worker, Workspace, decode};
//! use firmware::store::Store;
//! use firmware::stream::{Live, Memory, PlayerMemory, Settings};
//! use core::pin::pin;
//!
//! # fn with<F: firmware::store::Mapped>(store: Option<Store<F>>, linked: &'static [u8]) {
//! let (mut buffer, mut header, mut block) = ([0; 8192], [0; 1024], [0; 1024]);
//! let mut poses = [[I16F16::ZERO; 64]; 4];
//! let player = PlayerMemory { header: &mut header, block: &mut block, poses: poses.each_mut().map(|pose| &mut pose[..]) };
//! let limits = Limits { channels: 64, frames: u32::MAX };
//! let settings = Settings { ahead_millis: 200, lost_millis: 500, limits };
//! let live = Live::new(Memory { buffer: &mut buffer, player }, settings);
//! let (mut first, mut second) = (Workspace::<64, 0, 2048>::new(), Workspace::<64, 0, 2048>::new());
//! let (mut poses, posts) = ([[I16F16::ZERO; 64]; 2], [Post::new(), Post::new()]);
//! let first = pin!(decode(&posts[0], &mut first, &live));
//! let second = pin!(decode(&posts[1], &mut second, &live));
//! let [one, other] = poses.each_mut();
//! let workers = [Worker::new(first, &posts[0], one), Worker::new(second, &posts[1], other)];
//! let linked = [linked];
//! let clips = Clips::new(&linked, store, &live, workers);
//! # }
//! ```

mod with_live;
mod worker;

pub use decoder_core::mclip::Workspace;
pub use with_live::{ClipOrLive, WithLive};
pub use worker::{Post, Worker, decode};

use crate::stage::Library;
use crate::store::{Lease, Mapped, Store};
use crate::stream::Live;
use crate::voice::{Frames, PlayError};
use decoder_core::{Error, I16F16};

/// The clip number of the live stream. A clip that is stored with this number is never played.
pub const LIVE: u16 = u16::MAX;

/// The clips, by number: those in the store, then those linked into the image (from 0), and [`LIVE`].
///
/// A clip in the store hides the linked one of its number. Clips are checked when they get into the store or the image; blocks
/// are checked again as they are decoded. `'t` is the borrow of the decoders' tasks, `'s` that of the memory.
pub struct Clips<'t, 's, F> {
    linked: &'t [&'static [u8]],
    store: Option<Store<F>>,
    live: &'s Live<'s>,
    workers: [Option<Worker<'t, 's>>; 2],
}

impl<'t, 's, F: Mapped> Clips<'t, 's, F> {
    /// The clips of a board. Without a store, no clip can be uploaded.
    pub fn new(
        linked: &'t [&'static [u8]],
        store: Option<Store<F>>,
        live: &'s Live<'s>,
        workers: [Worker<'t, 's>; 2],
    ) -> Self {
        Self { linked, store, live, workers: workers.map(Some) }
    }

    /// The clips linked into the image.
    pub const fn linked(&self) -> &'t [&'static [u8]] {
        self.linked
    }

    /// The clips in flash.
    pub const fn store(&mut self) -> Option<&mut Store<F>> {
        self.store.as_mut()
    }

    /// The live stream.
    pub const fn live(&self) -> &'s Live<'s> {
        self.live
    }

    fn release(&mut self, lease: Option<Lease>) {
        if let (Some(store), Some(lease)) = (&mut self.store, lease) {
            store.release(lease);
        }
    }

    fn give(&mut self, worker: Worker<'t, 's>) {
        if let Some(place) = self.workers.iter_mut().find(|worker| worker.is_none()) {
            *place = Some(worker);
        }
    }
}

impl<'t, 's, F: Mapped> Library for Clips<'t, 's, F> {
    type Frames = Playing<'t, 's>;

    fn open(&mut self, clip: u16) -> Result<Playing<'t, 's>, PlayError> {
        let lease = match &mut self.store {
            Some(store) if clip != LIVE => store.lease(clip),
            _ => None,
        };
        let linked = self.linked.get(usize::from(clip)).copied().filter(|_| clip != LIVE);
        let bytes = lease.as_ref().map(Lease::bytes).or(linked);
        if bytes.is_none() && clip != LIVE {
            return Err(PlayError::NoClip { clip });
        }
        let Some(mut worker) = self.workers.iter_mut().find_map(Option::take) else {
            self.release(lease);
            return Err(PlayError::NoDecoder);
        };
        let opened = match bytes {
            Some(bytes) => worker.open(bytes),
            None => worker.open_live(),
        };
        match opened {
            Ok(()) => Ok(Playing { worker, lease }),
            Err(error) => {
                self.release(lease);
                self.give(worker);
                Err(error)
            }
        }
    }

    fn close(&mut self, frames: Playing<'t, 's>) {
        let Playing { mut worker, lease } = frames;
        worker.close();
        self.release(lease);
        self.give(worker);
    }
}

/// A clip that is open.
pub struct Playing<'t, 's> {
    worker: Worker<'t, 's>,
    /// Of a clip in the store.
    lease: Option<Lease>,
}

impl Frames for Playing<'_, '_> {
    fn channels(&self) -> usize {
        self.worker.channels()
    }

    fn frames(&self) -> u32 {
        self.worker.frames()
    }

    fn rate_centihertz(&self) -> u16 {
        self.worker.rate_centihertz()
    }

    fn position(&self) -> u32 {
        self.worker.position()
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        self.worker.next_frame()
    }

    fn approach(&mut self, frame: u32) {
        self.worker.approach(frame);
    }
}
