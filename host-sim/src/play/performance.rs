//! What a player is asked to play: which clips, how often, from where on, how fast.

use crate::clip::{Clip, Memory};
use anyhow::{Context, Result};
use decoder_core::{Error, I16F16};
use firmware::clock::Speed;
use firmware::frames::Frames;
use firmware::library::Library;
use firmware::machine::{Command, Machine, Show, Start};
use firmware::map::MAX_SERVOS;
use firmware::play_error::PlayError;
use firmware::playback::Playback;
use puppet_file::Map;

/// Clips in their order, and how they are played.
pub struct Performance<'c> {
    /// The clips, each with its name.
    pub clips: Vec<(String, &'c Clip<'c>)>,
    /// Hundredths of a frame per second to play all of them at; each at its own rate where this is 0.
    pub centihertz: u16,
    /// How often they are played, one behind the other; 0: until somebody asks for an end.
    pub times: u32,
    /// Frame of the first clip that it begins with, each time.
    pub start: u32,
    /// How fast.
    pub speed: Speed,
    /// Whether servos that can are let go in the end, where the puppet has come to its end without a fault.
    pub torque_off: bool,
}

impl<'c> Performance<'c> {
    /// One clip, once, from its first frame on.
    pub fn of(clip: &'c Clip<'c>, centihertz: u16) -> Self {
        Self {
            clips: vec![("the clip".to_owned(), clip)],
            centihertz,
            times: 1,
            start: 0,
            speed: Speed::NORMAL,
            torque_off: false,
        }
    }

    /// Gives `play` a machine before its first tick, whose clip `n` is the `n`th.
    ///
    /// # Errors
    /// A sentence for a clip that does not fit the map, and those of `play`.
    pub(crate) fn with_machine<'m, T>(
        &'m self,
        map: &'m Map,
        play: impl for<'d> FnOnce(Machine<'d, Shelf<'d>, MAX_SERVOS>) -> Result<T>,
    ) -> Result<T> {
        // A clip that comes after itself fades into itself, so it is decoded twice at a time.
        let mut memories: Vec<[Memory; 2]> =
            self.clips.iter().map(|(_, clip)| [clip.lend(), clip.lend()]).collect();
        let mut shelf = Vec::new();
        for (number, ((name, clip), memories)) in (0..).zip(self.clips.iter().zip(&mut memories)) {
            let rate = if self.centihertz > 0 { self.centihertz } else { clip.rate_centihertz() };
            let start = if number == 0 { self.start } else { 0 };
            let staged = |memory| {
                let frames = Staged { frames: clip.decoder(memory)?, clip: number, rate, start };
                let fits = Playback::new(frames, map, false, 0).map(Playback::into_frames);
                fits.map_err(|(error, _)| error).with_context(|| name.clone())
            };
            shelf.push(memories.iter_mut().map(staged).collect::<Result<Vec<_>>>()?);
        }
        let once: Vec<u16> = (0..self.clips.len() as u16).collect();
        let playlist = once.repeat(self.times.max(1) as usize);
        let show = Show { playlist: &playlist, repeats: self.times == 0, ..Show::default() };
        let mut machine = Machine::new(map, Shelf(shelf), show, Start::Power);
        // Speed is refused by nobody.
        let _ = machine.command(Command::Speed(self.speed));
        play(machine)
    }
}

/// Clips with the decoders of each that are free.
pub(crate) struct Shelf<'d>(Vec<Vec<Staged<'d>>>);

impl<'d> Library for Shelf<'d> {
    type Frames = Staged<'d>;

    fn open(&mut self, clip: u16) -> Result<Staged<'d>, PlayError> {
        let mut frames =
            self.0.get_mut(usize::from(clip)).and_then(Vec::pop).ok_or(PlayError::NoClip { clip })?;
        frames.approach(0);
        Ok(frames)
    }

    fn has(&self, clip: u16) -> bool {
        usize::from(clip) < self.0.len()
    }

    fn close(&mut self, frames: Staged<'d>) {
        if let Some(free) = self.0.get_mut(usize::from(frames.clip)) {
            free.push(frames);
        }
    }
}

/// Frames of a clip from `start` on, at a rate of one's own.
pub(crate) struct Staged<'d> {
    frames: Box<dyn Frames + 'd>,
    clip: u16,
    rate: u16,
    start: u32,
}

impl Frames for Staged<'_> {
    fn channels(&self) -> usize {
        self.frames.channels()
    }

    fn frames(&self) -> u32 {
        self.frames.frames().saturating_sub(self.start)
    }

    fn rate_centihertz(&self) -> u16 {
        self.rate
    }

    fn position(&self) -> u32 {
        self.frames.position().saturating_sub(self.start)
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        // A computer decodes hours of a clip in a tick; a board, which does not, seeks.
        while self.frames.position() < self.start {
            if self.frames.next_frame()?.is_none() {
                return Ok(None);
            }
        }
        self.frames.next_frame()
    }

    fn approach(&mut self, frame: u32) {
        self.frames.approach(frame.saturating_add(self.start));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use encoder::qmd::{Method, Parameters, encode};
    use std::path::Path;

    #[test]
    fn frames_begin_where_they_are_asked_to() {
        let sample = mocap::sample::clip();
        let bytes = encode(&sample, Parameters::TABLE_1, Method::ClosedLoop).unwrap();
        let clip = Clip::parse(Path::new("clip.qmd"), &bytes).unwrap();
        let whole: Vec<Vec<I16F16>> = clip
            .decode(|frames| {
                Ok(std::iter::from_fn(|| frames.next_frame().unwrap().map(<[_]>::to_vec)).collect())
            })
            .unwrap();
        let mut memory = clip.lend();
        let mut staged =
            Staged { frames: clip.decoder(&mut memory).unwrap(), clip: 0, rate: 6000, start: 470 };
        for _ in 0..2 {
            staged.approach(0);
            assert_eq!((staged.frames(), staged.position()), (10, 0));
            for expected in &whole[470..] {
                assert_eq!(staged.next_frame().unwrap(), Some(expected.as_slice()));
            }
            assert!(staged.next_frame().unwrap().is_none());
        }
    }
}
