//! Decoders that outlive the clips they decode.
//!
//! A decoder borrows a clip's header and its memory, and both differ from clip to clip. So that memory can be lent again, a
//! decoder lives in a coroutine, [`decode`], which owns the memory and borrows it to one clip after the other. It is asked
//! through a [`Mailbox`] and answers each question in one poll: it waits for nothing else.

use crate::frames::Frames;
use crate::play_error::PlayError;
use crate::store::Lease;
use crate::stream::{Live, Player};
use core::cell::Cell;
use core::convert::Infallible;
use core::future::{Future, poll_fn};
use core::pin::Pin;
use core::task::{Context, Poll, Waker};
use decoder_core::mclip::{self, EntryPoint, MAGIC, Memory, Needs, Workspace};
use decoder_core::{Error, Field, I16F16, Limits, qmd};

/// What a decoder is asked.
enum Request {
    Open(Lease),
    OpenLive,
    Next,
    Approach(u32),
    Close,
}

/// What a decoder says.
#[derive(Clone, Copy)]
struct Answer {
    /// Whether there was a frame.
    result: Result<bool, PlayError>,
    channels: usize,
    frames: u32,
    rate_centihertz: u16,
    names: Option<u32>,
    position: u32,
}

impl Answer {
    const fn none(result: Result<bool, PlayError>) -> Self {
        Self { result, channels: 0, frames: 0, rate_centihertz: 0, names: None, position: 0 }
    }

    /// `names` were asked for when the clip was opened: to read them again with each frame would take too long.
    fn of<F: Frames>(frames: &F, names: Option<u32>, result: Result<bool, PlayError>) -> Self {
        Self {
            result,
            channels: frames.channels(),
            frames: frames.frames(),
            rate_centihertz: frames.rate_centihertz(),
            names,
            position: frames.position(),
        }
    }
}

/// What a decoder and the one who plays its frames tell each other.
pub struct Mailbox<'s> {
    request: Cell<Option<Request>>,
    answer: Cell<Answer>,
    /// The bytes of the clip that was open, once it is closed.
    lease: Cell<Option<Lease>>,
    /// Where the next frame is to be written, while it is asked for.
    pose: Cell<Option<&'s mut [I16F16]>>,
}

impl Default for Mailbox<'_> {
    fn default() -> Self {
        Self::new()
    }
}

impl Mailbox<'_> {
    /// Nothing was asked.
    pub const fn new() -> Self {
        let answer = Answer::none(Err(PlayError::NoDecoder));
        Self {
            request: Cell::new(None),
            answer: Cell::new(answer),
            lease: Cell::new(None),
            pose: Cell::new(None),
        }
    }

    async fn request(&self) -> Request {
        poll_fn(|_| self.request.take().map_or(Poll::Pending, Poll::Ready)).await
    }

    /// Takes the next frame where it was asked for.
    fn deliver<F: Frames>(&self, frames: &mut F) -> Result<bool, PlayError> {
        let Some(frame) = frames.next_frame().map_err(PlayError::Clip)? else { return Ok(false) };
        let pose = self.pose.take();
        if let Some(pose) = pose {
            pose.iter_mut().zip(frame).for_each(|(place, &value)| *place = value);
            self.pose.set(Some(pose));
        }
        Ok(true)
    }
}

/// Memory of a decoder that opens one clip after the other: for clips of up to `C` channels that need up to `W` words and `H`
/// halves, with an index of up to `E` of their entry points.
///
/// An entry point takes 8 bytes. A clip with more of them has every second, third … one in the index, so that more frames
/// are decoded after a seek, in more ticks; a tick takes no longer.
#[derive(Debug)]
pub struct DecoderMemory<const C: usize, const W: usize, const H: usize, const E: usize> {
    workspace: Workspace<C, W, H>,
    entries: [EntryPoint; E],
}

impl<const C: usize, const W: usize, const H: usize, const E: usize> DecoderMemory<C, W, H, E> {
    /// What clips may need.
    pub const CAPACITY: Needs = Workspace::<C, W, H>::CAPACITY;

    /// Memory.
    pub const fn new() -> Self {
        Self { workspace: Workspace::new(), entries: [EntryPoint::EMPTY; E] }
    }

    fn lend(&mut self) -> Memory<'_> {
        self.workspace.lend()
    }
}

impl<const C: usize, const W: usize, const H: usize, const E: usize> Default for DecoderMemory<C, W, H, E> {
    fn default() -> Self {
        Self::new()
    }
}

/// Decodes whatever clip it is asked for, in its memory, for ever. For [`Worker::new`].
pub async fn decode<const C: usize, const W: usize, const H: usize, const E: usize>(
    mailbox: &Mailbox<'_>,
    memory: &mut DecoderMemory<C, W, H, E>,
    live: &Live<'_>,
) -> Infallible {
    loop {
        let opened = match mailbox.request().await {
            Request::Open(lease) => {
                let opened = serve_clip(mailbox, lease.bytes(), memory).await;
                mailbox.lease.set(Some(lease));
                opened
            }
            Request::OpenLive => match live.take() {
                Some(mut player) => {
                    let opened = match Player::new(live, &mut player, memory.lend()) {
                        Ok(player) => serve(mailbox, player).await,
                        Err(error) => Err(PlayError::Clip(error)),
                    };
                    live.give(player);
                    opened
                }
                None => Err(PlayError::NoDecoder),
            },
            Request::Next | Request::Approach(_) | Request::Close => Ok(()),
        };
        mailbox.answer.set(Answer::none(opened.map(|()| false)));
    }
}

/// Opens a clip that lies in memory, and gives its frames.
async fn serve_clip<const C: usize, const W: usize, const H: usize, const E: usize>(
    mailbox: &Mailbox<'_>,
    bytes: &[u8],
    memory: &mut DecoderMemory<C, W, H, E>,
) -> Result<(), PlayError> {
    let limits = Limits { channels: C as u16, frames: Limits::MAX.frames };
    if bytes.starts_with(&MAGIC) {
        let DecoderMemory { workspace, entries } = memory;
        let clip = mclip::Clip::parse(bytes, limits).map_err(PlayError::Clip)?.with_index(entries);
        let decoder = clip.decoder(workspace.lend()).map_err(PlayError::Clip)?;
        serve(mailbox, decoder).await
    } else {
        let clip = qmd::Clip::parse(bytes, limits);
        let decoder =
            clip.and_then(|clip| clip.decoder(memory.lend().pose, None)).map_err(PlayError::Clip)?;
        serve(mailbox, decoder).await
    }
}

/// Gives the frames of a clip until it is closed.
async fn serve<F: Frames>(mailbox: &Mailbox<'_>, mut frames: F) -> Result<(), PlayError> {
    let (mut result, names) = (Ok(false), frames.names());
    loop {
        mailbox.answer.set(Answer::of(&frames, names, result));
        result = match mailbox.request().await {
            Request::Next => mailbox.deliver(&mut frames),
            Request::Approach(frame) => {
                frames.approach(frame);
                Ok(false)
            }
            Request::Close | Request::Open(_) | Request::OpenLive => return Ok(()),
        };
    }
}

/// A decoder, and room for its frames.
pub struct Worker<'t, 's> {
    task: Pin<&'t mut (dyn Future<Output = Infallible> + 's)>,
    mailbox: &'s Mailbox<'s>,
    /// Out only while a frame is asked for.
    pose: Option<&'s mut [I16F16]>,
    answer: Answer,
}

impl<'t, 's> Worker<'t, 's> {
    /// A decoder of [`decode`], pinned, which has the same mailbox. `pose` takes a frame.
    pub fn new(
        task: Pin<&'t mut (dyn Future<Output = Infallible> + 's)>,
        mailbox: &'s Mailbox<'s>,
        pose: &'s mut [I16F16],
    ) -> Self {
        let answer = Answer::none(Err(PlayError::NoDecoder));
        Self { task, mailbox, pose: Some(pose), answer }
    }

    fn ask(&mut self, request: Request) -> Result<bool, PlayError> {
        self.mailbox.pose.set(self.pose.take());
        self.mailbox.request.set(Some(request));
        // It waits only for requests, so it has answered then.
        let _ = self.task.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        self.pose = self.mailbox.pose.take();
        self.answer = self.mailbox.answer.get();
        self.answer.result
    }

    /// Opens a clip in memory. Where it cannot be opened its bytes come back with the error, as they do when it is closed.
    pub(super) fn open(&mut self, clip: Lease) -> Result<(), (PlayError, Option<Lease>)> {
        let opened = self.ask(Request::Open(clip)).and_then(|_| self.check_room());
        opened.map_err(|error| (error, self.close()))
    }

    /// Opens the live stream.
    pub(super) fn open_live(&mut self) -> Result<(), PlayError> {
        let opened = self.ask(Request::OpenLive).and_then(|_| self.check_room());
        if opened.is_err() {
            self.close();
        }
        opened
    }

    fn check_room(&self) -> Result<(), PlayError> {
        let (needed, lent) = (self.answer.channels, self.pose.as_ref().map_or(0, |pose| pose.len()));
        if needed <= lent {
            return Ok(());
        }
        Err(PlayError::Clip(Error::OutputTooSmall { field: Field::Pose, needed, lent }))
    }

    /// Gives the clip's memory back, and its bytes.
    pub(super) fn close(&mut self) -> Option<Lease> {
        let _ = self.ask(Request::Close);
        self.mailbox.lease.take()
    }
}

impl Frames for Worker<'_, '_> {
    fn channels(&self) -> usize {
        self.answer.channels
    }

    fn frames(&self) -> u32 {
        self.answer.frames
    }

    fn rate_centihertz(&self) -> u16 {
        self.answer.rate_centihertz
    }

    fn names(&self) -> Option<u32> {
        self.answer.names
    }

    fn position(&self) -> u32 {
        self.answer.position
    }

    fn next_frame(&mut self) -> Result<Option<&[I16F16]>, Error> {
        match self.ask(Request::Next) {
            Ok(true) => Ok(self.pose.as_deref().and_then(|pose| pose.get(..self.answer.channels))),
            Err(PlayError::Clip(error)) => Err(error),
            // Frames that are asked for give no other error.
            Ok(false) | Err(_) => Ok(None),
        }
    }

    fn approach(&mut self, frame: u32) {
        let _ = self.ask(Request::Approach(frame));
    }
}
