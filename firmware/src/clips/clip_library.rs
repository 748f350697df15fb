//! Clips in flash, linked in, and streamed, as one library.

use super::worker::Worker;
use crate::demands::Facts;
use crate::frames::Frames;
use crate::library::{LIVE, Library};
use crate::play_error::PlayError;
use crate::store::{Lease, MappedFlash, Store};
use crate::stream::Live;
use decoder_core::{Error, I16F16};

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

impl<'t, 's, F: MappedFlash> Clips<'t, 's, F> {
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

    /// What a clip says of itself; `None` where there is none of that number, and of the live stream. Reads its header.
    pub fn facts(&self, clip: u16) -> Option<Facts> {
        let stored = self.store.as_ref().and_then(|store| store.get(clip));
        let bytes = stored.or_else(|| self.linked.get(usize::from(clip)).copied())?;
        Facts::of(bytes).ok()
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

impl<'t, 's, F: MappedFlash> Library for Clips<'t, 's, F> {
    type Frames = OpenClip<'t, 's>;

    fn open(&mut self, clip: u16) -> Result<OpenClip<'t, 's>, PlayError> {
        let stored = match &mut self.store {
            Some(store) if clip != LIVE => store.lease(clip),
            _ => None,
        };
        let linked = self.linked.get(usize::from(clip)).filter(|_| clip != LIVE);
        let lease = stored.or(linked.map(|bytes| Lease::of_static(bytes)));
        if lease.is_none() && clip != LIVE {
            return Err(PlayError::NoClip { clip });
        }
        let Some(mut worker) = self.workers.iter_mut().find_map(Option::take) else {
            self.release(lease);
            return Err(PlayError::NoDecoder);
        };
        let opened = match lease {
            Some(lease) => worker.open(lease),
            None => worker.open_live().map_err(|error| (error, None)),
        };
        match opened {
            Ok(()) => Ok(OpenClip { worker }),
            Err((error, lease)) => {
                self.release(lease);
                self.give(worker);
                Err(error)
            }
        }
    }

    fn has(&self, clip: u16) -> bool {
        if clip == LIVE {
            return self.live.rate_centihertz() > 0;
        }
        let stored = self.store.as_ref().is_some_and(|store| store.entry(clip).is_some());
        stored || self.linked.get(usize::from(clip)).is_some()
    }

    fn close(&mut self, clip: OpenClip<'t, 's>) {
        let OpenClip { mut worker } = clip;
        let lease = worker.close();
        self.release(lease);
        self.give(worker);
    }
}

/// A clip that is open.
pub struct OpenClip<'t, 's> {
    worker: Worker<'t, 's>,
}

impl Frames for OpenClip<'_, '_> {
    fn channels(&self) -> usize {
        self.worker.channels()
    }

    fn frames(&self) -> u32 {
        self.worker.frames()
    }

    fn rate_centihertz(&self) -> u16 {
        self.worker.rate_centihertz()
    }

    fn names(&self) -> Option<u32> {
        self.worker.names()
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
