//! A library with a live stream beside it.

use super::worker::Worker;
use crate::frames::Frames;
use crate::library::{LIVE, Library};
use crate::play_error::PlayError;
use decoder_core::{Error, I16F16};

/// The clips of `L`, and the live stream as clip [`LIVE`].
pub struct WithLive<'t, 's, L> {
    clips: L,
    /// Out while the stream plays.
    worker: Option<Worker<'t, 's>>,
}

impl<'t, 's, L> WithLive<'t, 's, L> {
    /// A library and the decoder of the stream.
    pub const fn new(clips: L, worker: Worker<'t, 's>) -> Self {
        Self { clips, worker: Some(worker) }
    }
}

impl<'t, 's, L: Library> Library for WithLive<'t, 's, L> {
    type Frames = ClipOrLive<'t, 's, L::Frames>;

    fn open(&mut self, clip: u16) -> Result<Self::Frames, PlayError> {
        if clip != LIVE {
            return self.clips.open(clip).map(ClipOrLive::Clip);
        }
        let mut worker = self.worker.take().ok_or(PlayError::NoDecoder)?;
        match worker.open_live() {
            Ok(()) => Ok(ClipOrLive::Live(worker)),
            Err(error) => {
                self.worker = Some(worker);
                Err(error)
            }
        }
    }

    fn has(&self, clip: u16) -> bool {
        clip == LIVE || self.clips.has(clip)
    }

    fn close(&mut self, frames: Self::Frames) {
        match frames {
            ClipOrLive::Clip(frames) => self.clips.close(frames),
            ClipOrLive::Live(mut worker) => {
                worker.close();
                self.worker = Some(worker);
            }
        }
    }
}

/// What plays.
pub enum ClipOrLive<'t, 's, F> {
    /// A clip of the library.
    Clip(F),
    /// The stream.
    Live(Worker<'t, 's>),
}

impl<F: Frames> Frames for ClipOrLive<'_, '_, F> {
    fn channels(&self) -> usize {
        match self {
            Self::Clip(frames) => frames.channels(),
            Self::Live(worker) => worker.channels(),
        }
    }

    fn frames(&self) -> u32 {
        match self {
            Self::Clip(frames) => frames.frames(),
            Self::Live(worker) => worker.frames(),
        }
    }

    fn rate_centihertz(&self) -> u16 {
        match self {
            Self::Clip(frames) => frames.rate_centihertz(),
            Self::Live(worker) => worker.rate_centihertz(),
        }
    }

    fn names(&self) -> Option<u32> {
        match self {
            Self::Clip(frames) => frames.names(),
            Self::Live(worker) => worker.names(),
        }
    }

    fn position(&self) -> u32 {
        match self {
            Self::Clip(frames) => frames.position(),
            Self::Live(worker) => worker.position(),
        }
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        match self {
            Self::Clip(frames) => frames.next_frame(),
            Self::Live(worker) => worker.next_frame(),
        }
    }

    fn approach(&mut self, frame: u32) {
        match self {
            Self::Clip(frames) => frames.approach(frame),
            Self::Live(worker) => worker.approach(frame),
        }
    }
}
