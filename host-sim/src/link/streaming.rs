//! A clip block by block while it plays.

use super::client::{Client, Line, LinkError};
use anyhow::{Result, anyhow, bail};
use decoder_core::Limits;
use decoder_core::mclip::{Clip, PREFIX_BYTES, Prefix};
use firmware::clips::LIVE;
use firmware::link::message::{DATA_BYTES, Request, Response, Telemetry};
use firmware::machine::Command;
use firmware::stream::Progress;
use std::ops::Range;
use std::time::{Duration, Instant};

/// Time from one telemetry to the next, in ms.
const TELEMETRY_MILLIS: u16 = 50;

/// A block of a clip.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Block {
    bytes: Range<usize>,
    first_frame: u32,
    frames: u32,
    entry: bool,
}

/// A .mclip in the parts that go over a link.
#[derive(Clone, Debug)]
pub struct StreamedClip<'a> {
    clip: &'a [u8],
    header: usize,
    blocks: Vec<Block>,
    frames: u32,
    rate_centihertz: u16,
}

impl<'a> StreamedClip<'a> {
    /// Takes a clip apart.
    ///
    /// # Errors
    /// A sentence where it is no sound .mclip, or has a block that is longer than a packet.
    pub fn new(clip: &'a [u8]) -> Result<Self> {
        let parsed = Clip::parse(clip, Limits::MAX)?;
        let prefix = clip.get(..PREFIX_BYTES).unwrap_or_default();
        let header = Prefix::read(prefix)?.header_bytes;
        let mut blocks = Vec::new();
        for found in parsed.blocks() {
            let found = found?;
            let block = Block {
                bytes: found.at..found.end(),
                first_frame: found.header.first_frame,
                frames: found.header.frames.into(),
                entry: found.header.entry,
            };
            if block.bytes.len() > DATA_BYTES {
                bail!(
                    "the block of frame {} has {} bytes, at most {DATA_BYTES} are streamed: encode the clip with shorter blocks",
                    block.first_frame,
                    block.bytes.len()
                );
            }
            blocks.push(block);
        }
        let rate_centihertz = parsed.header().rate_centihertz();
        Ok(Self { clip, header, blocks, frames: parsed.frames(), rate_centihertz })
    }

    /// As many blocks from `next` on as a packet holds, `most` at most: their bytes, and how many they are.
    fn packet(&self, next: usize, most: usize) -> (&'a [u8], usize) {
        let blocks = self.blocks.get(next..).unwrap_or_default();
        let start = blocks.first().map_or(0, |block| block.bytes.start);
        let fits = |block: &&Block| block.bytes.end - start <= DATA_BYTES;
        let packet = blocks.iter().take(most).take_while(fits);
        let (end, count) = packet.fold((start, 0), |(_, count), block| (block.bytes.end, count + 1));
        (self.clip.get(start..end).unwrap_or_default(), count)
    }

    /// Bits per second of the blocks, which a line has to carry while the clip plays.
    pub fn bits_per_second(&self) -> f64 {
        let bytes = self.clip.len().saturating_sub(self.header);
        bytes as f64 * 8.0 * f64::from(self.rate_centihertz) / 100.0 / f64::from(self.frames.max(1))
    }

    /// The block to go on with after a break, of those from `next` on, which the device does not have: that one, or where it is too
    /// late by now the next entry point.
    fn resume(&self, progress: Progress, next: usize) -> usize {
        let passed = |block: &Block| block.first_frame + block.frames <= progress.position;
        if self.blocks.get(next).is_none_or(|block| !passed(block)) {
            return next;
        }
        let entry = |block: &Block| block.entry && !passed(block);
        self.blocks.iter().position(entry).unwrap_or(self.blocks.len())
    }
}

/// How a clip is streamed.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Silence in ms after which the device is to take the link for lost; 0: not the link, only the stream.
    pub hold_millis: u16,
    /// How long a new line is looked for where one breaks.
    pub patience: Duration,
    /// Whether what plays fades into the stream as soon as enough of it is there.
    pub plays: bool,
}

/// What streaming came to.
#[derive(Clone, Debug)]
pub struct Report {
    /// Blocks that were sent.
    pub blocks: usize,
    /// Lines that broke.
    pub breaks: u32,
    /// Bytes of the packets that were answered, and the time from their sending to their answers.
    pub carried: (usize, Duration),
    /// The last telemetry while it played.
    pub last: Option<Telemetry>,
}

impl Report {
    /// Bits of blocks per second that the line and the device have taken; 0 where there was none.
    pub fn bits_per_second(&self) -> f64 {
        let (bytes, time) = self.carried;
        if time.is_zero() { 0.0 } else { bytes as f64 * 8.0 / time.as_secs_f64() }
    }
}

/// Streams a clip to its end, and tells `told` all telemetry.
///
/// # Errors
/// [`LinkError`]; a sentence about the fault that ended it.
pub fn stream(
    line: Line<'_>,
    parts: &StreamedClip<'_>,
    settings: Settings,
    told: &mut dyn FnMut(&Telemetry),
) -> Result<Report> {
    let mut run = Streamer {
        parts,
        settings,
        next: 0,
        room: 0,
        full: 0,
        started: false,
        heard: Instant::now(),
        report: Report { blocks: 0, breaks: 0, carried: (0, Duration::ZERO), last: None },
    };
    let mut client = Client::open(line)?;
    run.begin(&mut client)?;
    let mut broken: Option<Instant> = None;
    loop {
        let ended = match run.send_due(&mut client, told) {
            Err(error) => match error.downcast_ref::<LinkError>() {
                Some(link) if link.is_broken() => Err(error),
                _ => return Err(error),
            },
            ended => ended,
        };
        match ended {
            Ok(true) => return Ok(run.report),
            Ok(false) => broken = None,
            Err(error) => {
                let since = *broken.get_or_insert_with(Instant::now);
                run.report.breaks += 1;
                client = loop {
                    if since.elapsed() >= settings.patience {
                        return Err(error);
                    }
                    std::thread::sleep(Duration::from_millis(50));
                    if let Ok(client) = Client::open(line) {
                        break client;
                    }
                };
                if let Err(error) = run.resume(&mut client) {
                    // A line that breaks again is looked for again.
                    if !error.downcast_ref::<LinkError>().is_some_and(LinkError::is_broken) {
                        return Err(error);
                    }
                }
            }
        }
    }
}

struct Streamer<'a> {
    parts: &'a StreamedClip<'a>,
    settings: Settings,
    /// The block that is sent next.
    next: usize,
    /// Blocks that the device has room for.
    room: u16,
    /// Blocks for which there was none.
    full: u32,
    started: bool,
    /// When the device heard of us last.
    heard: Instant,
    report: Report,
}

impl Streamer<'_> {
    fn begin(&mut self, client: &mut Client) -> Result<()> {
        let header = self.parts.clip.get(..self.parts.header).unwrap_or_default();
        let bytes = u32::try_from(header.len()).unwrap_or(u32::MAX);
        self.ask(client, &Request::Stream { bytes })?;
        for (offset, bytes) in (0..).step_by(DATA_BYTES).zip(header.chunks(DATA_BYTES)) {
            self.ask(client, &Request::Header { offset, bytes })?;
        }
        self.hold(client, self.settings.hold_millis)
    }

    fn hold(&self, client: &mut Client, millis: u16) -> Result<()> {
        if self.settings.hold_millis > 0 {
            client.request_done(&Request::Hold { millis })?;
        }
        Ok(client.request_done(&Request::Telemetry { millis: TELEMETRY_MILLIS })?)
    }

    /// Goes on over a new line.
    fn resume(&mut self, client: &mut Client) -> Result<()> {
        let status = client.status()?;
        let Some(stream) = status.stream else {
            bail!("{} has lost the stream: it has restarted", client.name())
        };
        self.next = self.parts.resume(stream.progress, self.next);
        self.room = stream.progress.free_blocks;
        self.hold(client, self.settings.hold_millis)
    }

    /// A request that is answered with the stream's progress.
    fn ask(&mut self, client: &mut Client, request: &Request<'_>) -> Result<()> {
        match client.request(request)? {
            Response::Stream(stream) => {
                self.room = stream.progress.free_blocks;
                self.full = stream.counters.overflowed;
                self.heard = Instant::now();
                Ok(())
            }
            other => Err(client.unexpected(&other).into()),
        }
    }

    /// Sends what there is room for, and takes a telemetry; true at the end.
    fn send_due(&mut self, client: &mut Client, told: &mut dyn FnMut(&Telemetry)) -> Result<bool> {
        loop {
            // Each packet waits for a tick of the device, so short blocks go together.
            let (bytes, blocks) = self.parts.packet(self.next, self.room.into());
            if blocks == 0 {
                break;
            }
            let (full, asked) = (self.full, Instant::now());
            self.ask(client, &Request::Packet { bytes })?;
            self.report.carried.0 += bytes.len();
            self.report.carried.1 += asked.elapsed();
            // What was said before the device had it says nothing of the room that there is now.
            client.forget_events();
            if self.full > full {
                break;
            }
            self.next += blocks;
            self.report.blocks += blocks;
        }
        if !self.started && self.settings.plays {
            let play = Command::Play { clip: LIVE, repeats: false };
            if let Err(error) = client.command(play) {
                // Nothing plays that our silence could harm: it is no fault.
                self.hold(client, 0)?;
                return Err(anyhow!(error).context("cannot play the stream"));
            }
        }
        self.started = true;
        // A block may be a second of motion: between them the device hears that we are here.
        if self.heard.elapsed() >= Duration::from_millis(u64::from(self.settings.hold_millis) / 4) {
            client.request_done(&Request::Alive)?;
            self.heard = Instant::now();
        }
        let silence = Duration::from_millis(u64::from(TELEMETRY_MILLIS) * 10);
        let Some(telemetry) = client.telemetry(silence)? else {
            // It says nothing by itself: is it there?
            client.request_done(&Request::Telemetry { millis: TELEMETRY_MILLIS })?;
            return Ok(false);
        };
        told(&telemetry);
        if let Some(fault) = telemetry.fault {
            bail!("{} has a fault: {fault}", client.name());
        }
        let progress = telemetry.stream.map(|stream| stream.progress);
        self.room = progress.map_or(0, |progress| progress.free_blocks);
        let all = self.next >= self.parts.blocks.len();
        let ended = all && progress.is_none_or(|progress| progress.position >= self.parts.frames);
        self.report.last = Some(telemetry);
        if ended {
            client.request_done(&Request::Telemetry { millis: 0 })?;
            client.request_done(&Request::Hold { millis: 0 })?;
        }
        Ok(ended)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::mclip::CodecId;
    use encoder::mclip::{Encoder, Encoding, Quality};

    #[test]
    fn a_clip_comes_apart_and_together() {
        let sample = mocap::sample::clip();
        let encoder = Encoder::new(&sample.skeleton, &sample.motion).unwrap();
        let clip = encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(8)).unwrap();
        let parts = StreamedClip::new(&clip).unwrap();
        let each = (0..parts.blocks.len()).map(|block| parts.packet(block, 1));
        let blocks: Vec<u8> = each.flat_map(|(bytes, _)| bytes).copied().collect();
        assert_eq!([&clip[..parts.header], &blocks].concat(), clip);
        let ends: Vec<u32> = parts.blocks.iter().map(|block| block.first_frame + block.frames).collect();
        assert_eq!(ends.last(), Some(&480));
        assert!(
            parts
                .blocks
                .iter()
                .skip(1)
                .map(|block| block.first_frame)
                .eq(ends[..ends.len() - 1].iter().copied())
        );
        assert!(parts.blocks[0].entry);

        // In time the next block follows; else the next entry point, if there is one.
        let at = |position, next| {
            parts.resume(Progress { position, received: 0, frames: 480, free_blocks: 0, blocks: 8 }, next)
        };
        let all = parts.blocks.len();
        assert_eq!((at(0, 0), at(ends[0] - 1, 0), at(ends[0], 1), at(480, all)), (0, 0, 1, all));
        let next = at(ends[0], 0);
        assert!(parts.blocks.get(next).is_none_or(|block| block.entry && block.first_frame >= ends[0]));
        assert!(StreamedClip::new(&clip[..clip.len() / 2]).is_err());
        // 480 frames at 60 fps.
        assert_eq!(parts.bits_per_second(), blocks.len() as f64);
    }

    #[test]
    fn short_blocks_go_together_as_far_as_there_is_room() {
        let sample = mocap::sample::clip();
        let encoder = Encoder::new(&sample.skeleton, &sample.motion).unwrap();
        let encoding = Encoding { block_bytes: 200, ..Encoding::new(CodecId::Dpcm) };
        let clip = encoder.encode(&encoding, Quality::Bits(8)).unwrap();
        let parts = StreamedClip::new(&clip).unwrap();
        let (mut next, mut packets, mut sent) = (0, 0, parts.clip[..parts.header].to_vec());
        loop {
            let (bytes, blocks) = parts.packet(next, 8);
            if blocks == 0 {
                break;
            }
            assert!(bytes.len() <= DATA_BYTES && blocks <= 8);
            sent.extend_from_slice(bytes);
            (next, packets) = (next + blocks, packets + 1);
        }
        assert_eq!((next, sent), (parts.blocks.len(), clip.clone()));
        assert!(packets * 4 <= next, "{packets} packets for {next} blocks");
        assert_eq!(parts.packet(0, 0).1, 0);
        assert_eq!(parts.packet(0, 2).1, 2);
    }
}
