//! Clips for a stage.

use crate::stage::Library;
use crate::voice::{Frames, PlayError};
use decoder_core::{Error, I16F16};

/// One decoder as a library: clip 0, which cannot fade into itself.
#[derive(Debug)]
pub struct Single<F> {
    frames: Option<Paced<F>>,
}

impl<F: Frames> Single<F> {
    /// The clip, played at its own rate or at `rate_centihertz` hundredths of a frame per second.
    pub fn new(frames: F, rate_centihertz: Option<u16>) -> Self {
        let rate = rate_centihertz.unwrap_or_else(|| frames.rate_centihertz());
        Self { frames: Some(Paced { frames, rate }) }
    }
}

impl<F: Frames> Library for Single<F> {
    type Frames = Paced<F>;

    fn open(&mut self, clip: u16) -> Result<Paced<F>, PlayError> {
        let frames = if clip == 0 { self.frames.take() } else { None };
        let mut frames = frames.ok_or(PlayError::NoClip { clip })?;
        frames.approach(0);
        Ok(frames)
    }

    fn close(&mut self, frames: Paced<F>) {
        self.frames = Some(frames);
    }
}

/// Frames at a rate of one's own.
#[derive(Debug)]
pub struct Paced<F> {
    frames: F,
    rate: u16,
}

impl<F: Frames> Frames for Paced<F> {
    fn channels(&self) -> usize {
        self.frames.channels()
    }

    fn frames(&self) -> u32 {
        self.frames.frames()
    }

    fn rate_centihertz(&self) -> u16 {
        self.rate
    }

    fn position(&self) -> u32 {
        self.frames.position()
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        self.frames.next_frame()
    }

    fn approach(&mut self, frame: u32) {
        self.frames.approach(frame);
    }
}
