//! Clips for a stage.

use crate::frames::Frames;
use crate::library::Library;
use crate::play_error::PlayError;
use decoder_core::{Error, I16F16};
use heapless::Vec;

/// Decoders as a library of `C` clips at most: clip `n` is the `n`th. One that plays cannot fade into itself.
#[derive(Debug)]
pub struct DecoderList<F, const C: usize> {
    clips: Vec<Option<Paced<F>>, C>,
}

/// One clip, number 0.
pub type SingleClip<F> = DecoderList<F, 1>;

impl<F: Frames, const C: usize> DecoderList<F, C> {
    /// A clip, played at its own rate or at `rate_centihertz` hundredths of a frame per second.
    pub fn new(frames: F, rate_centihertz: Option<u16>) -> Self {
        let rate = rate_centihertz.unwrap_or_else(|| frames.rate_centihertz());
        let mut shelf = Self { clips: Vec::new() };
        shelf.put(frames, rate);
        shelf
    }

    /// Clips, each at its own rate; those beyond `C` are left out.
    pub fn of(clips: impl IntoIterator<Item = F>) -> Self {
        let mut shelf = Self { clips: Vec::new() };
        for frames in clips.into_iter().take(C) {
            let rate = frames.rate_centihertz();
            shelf.put(frames, rate);
        }
        shelf
    }

    fn put(&mut self, frames: F, rate: u16) {
        let clip = self.clips.len() as u16;
        // There is room: those who call see to it.
        let _ = self.clips.push(Some(Paced { frames, rate, clip }));
    }
}

impl<F: Frames, const C: usize> Library for DecoderList<F, C> {
    type Frames = Paced<F>;

    fn open(&mut self, clip: u16) -> Result<Paced<F>, PlayError> {
        let frames = self.clips.get_mut(usize::from(clip)).and_then(Option::take);
        let mut frames = frames.ok_or(PlayError::NoClip { clip })?;
        frames.approach(0);
        Ok(frames)
    }

    fn has(&self, clip: u16) -> bool {
        usize::from(clip) < self.clips.len()
    }

    fn close(&mut self, frames: Paced<F>) {
        if let Some(place) = self.clips.get_mut(usize::from(frames.clip)) {
            *place = Some(frames);
        }
    }
}

/// Frames at a rate of one's own.
#[derive(Debug)]
pub struct Paced<F> {
    frames: F,
    rate: u16,
    /// Its place on the shelf.
    clip: u16,
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

    fn names(&self) -> Option<u32> {
        self.frames.names()
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
