//! The frames of a stream, in time whatever has come.

use super::live::Live;
use super::memory::PlayerMemory;
use super::reckoner::{Made, Reckoner, Reckoning};
use crate::frames::Frames;
use decoder_core::mclip::{Header, Memory, Stream};
use decoder_core::{Error, I16F16};

/// Frames that are decoded in a call at most: the one that is played, and some that came too late but have to be
/// gone through.
pub const CATCH_UP_FRAMES: u32 = 4;

/// A stream that plays.
///
/// Before its first frame, [`next_frame`](Frames::next_frame) gives `None` until as many frames wait as
/// [`Settings::ahead_millis`](super::Settings::ahead_millis) says; from then on it gives one each time, up to the last. It takes at
/// most [`CATCH_UP_FRAMES`] times a frame's time.
pub struct Player<'l, 's, 'm> {
    live: &'l Live<'s>,
    stream: Stream<'m, 'm>,
    reckoner: Reckoner<'m>,
    /// The frame that plays next.
    position: u32,
    /// The frame that the decoder gives next.
    next: u32,
    started: bool,
    /// The decoder needs an entry point.
    broken: bool,
}

impl<'l, 's, 'm> Player<'l, 's, 'm> {
    /// Before the first frame of the stream whose header was received.
    ///
    /// # Errors
    /// As [`Header::parse`] and [`Stream::new`].
    pub(crate) fn new(
        live: &'l Live<'s>,
        player: &'m mut PlayerMemory<'s>,
        memory: Memory<'m>,
    ) -> Result<Self, Error> {
        let PlayerMemory { header, block, poses } = player;
        let length = live.copy_header(header);
        let header: &'m [u8] = header.get(..length).unwrap_or_default();
        let header = Header::parse(header, live.limits())?;
        let channels = header.channel_count();
        // The stream was refused before if there is less.
        let poses = poses.each_mut().map(|pose| pose.get_mut(..channels).unwrap_or_default());
        let reckoning = Reckoning::of(header.rate_centihertz());
        let stream = Stream::new(header, memory, block)?;
        let reckoner = Reckoner::new(poses, reckoning);
        Ok(Self { live, stream, reckoner, position: 0, next: 0, started: false, broken: true })
    }

    /// Begins with the first entry point, once enough frames wait.
    fn start(&mut self) {
        let Some(first) = self.live.start() else { return };
        (self.position, self.next) = (first, first);
        self.started = true;
    }

    /// Shows the frame at the position, if it can be decoded in time.
    fn play(&mut self) -> Made {
        let from = if self.broken { self.next } else { self.next.saturating_add(1) };
        if let Some(entry) = self.live.last_entry(from, self.position) {
            self.live.count(|counters| {
                counters.lost = counters.lost.saturating_add(entry.saturating_sub(self.next));
            });
            self.stream.resume();
            (self.next, self.broken) = (entry, false);
        }
        for _ in 0..CATCH_UP_FRAMES {
            if self.broken || self.next > self.position {
                break;
            }
            let decoded = match self.stream.next_frame(&mut &[][..]) {
                Ok(None) => {
                    // Between blocks.
                    let feed = |block: &mut &[u8]| match self.stream.next_frame(block) {
                        Ok(Some(frame)) if self.next == self.position => Ok(Some(self.reckoner.right(frame))),
                        frame => frame.map(|_| None),
                    };
                    match self.live.take_block(self.next, feed) {
                        Some(result) => result,
                        None => break,
                    }
                }
                Ok(Some(frame)) if self.next == self.position => Ok(Some(self.reckoner.right(frame))),
                frame => frame.map(|_| None),
            };
            match decoded {
                Ok(made) => {
                    self.next = self.next.saturating_add(1);
                    if let Some(made) = made {
                        return made;
                    }
                }
                Err(_) => self.broken = true,
            }
        }
        self.reckoner.missing()
    }
}

impl Frames for Player<'_, '_, '_> {
    fn channels(&self) -> usize {
        self.stream.header().channel_count()
    }

    fn frames(&self) -> u32 {
        self.stream.header().frames()
    }

    fn rate_centihertz(&self) -> u16 {
        self.stream.header().rate_centihertz()
    }

    fn names(&self) -> Option<u32> {
        self.stream.header().names_digest()
    }

    fn position(&self) -> u32 {
        self.position
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        if !self.started {
            self.start();
        }
        if !self.started || self.position >= self.frames() {
            return Ok(None);
        }
        let made = self.play();
        self.position = self.position.saturating_add(1);
        self.live.played(self.position, self.next, made);
        Ok(Some(self.reckoner.shown()))
    }

    /// A stream has no way back.
    fn approach(&mut self, _: u32) {}
}
