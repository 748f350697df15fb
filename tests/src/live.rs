//! Recorded motion as a sender of a live stream has it, and clips as a board has them.

use crate::{skip, trials};
use decoder_core::mclip::{self, CodecId, Prefix};
use decoder_core::{I16F16, Limits};
use encoder::mclip::{Encoder, Encoding, Quality};
use encoder::memory::OwnedMemory;
use firmware::clips::{Clips, DecoderMemory, Mailbox, Worker, decode};
use firmware::store::Store;
use firmware::stream::{Live, Memory, PlayerMemory, Settings};
use host_sim::flash::Flash;
use mocap::Skeleton;
use std::path::PathBuf;
use std::pin::pin;

/// Channels of a board's clips at most.
pub const CHANNELS: usize = 64;

/// A board's memory of a decoder.
pub type Space = DecoderMemory<CHANNELS, { 4 * CHANNELS }, 4096, 16>;

/// A board's streams.
pub const SETTINGS: Settings = Settings {
    ahead_millis: 200,
    lost_millis: 500,
    limits: Limits { channels: CHANNELS as u16, frames: u32::MAX },
};

/// Clips with a live stream of `buffer` bytes, as a board makes them.
pub fn with_clips<R>(
    buffer: usize,
    linked: &[&'static [u8]],
    store: Option<Store<Flash<4096>>>,
    then: impl FnOnce(Clips<'_, '_, Flash<4096>>, &Live<'_>) -> R,
) -> R {
    let (mut buffer, mut header, mut block) = (vec![0; buffer], [0; 1024], [0; 512]);
    let mut ghosts = [[I16F16::ZERO; CHANNELS]; 4];
    let poses = ghosts.each_mut().map(|pose| &mut pose[..]);
    let player = PlayerMemory { header: &mut header, block: &mut block, poses };
    let live = Live::new(Memory { buffer: &mut buffer, player }, SETTINGS);
    let (mut first, mut second) = (Space::new(), Space::new());
    let (mut poses, mailboxes) = ([[I16F16::ZERO; CHANNELS]; 2], [Mailbox::new(), Mailbox::new()]);
    let first = pin!(decode(&mailboxes[0], &mut first, &live));
    let second = pin!(decode(&mailboxes[1], &mut second, &live));
    let [one, other] = poses.each_mut();
    let workers = [Worker::new(first, &mailboxes[0], one), Worker::new(second, &mailboxes[1], other)];
    then(Clips::new(linked, store, &live, workers), &live)
}

/// A clip, encoded for a stream.
pub struct Clip {
    /// Name of the file.
    pub name: String,
    /// Its skeleton.
    pub skeleton: Skeleton,
    /// Frames per second, in hundredths.
    pub rate_centihertz: u16,
    /// The frames as a decoder gives them that has all.
    pub frames: Vec<Vec<I16F16>>,
    /// All bytes before the first block.
    pub header: Vec<u8>,
    /// The blocks.
    pub blocks: Vec<Vec<u8>>,
}

impl Clip {
    /// The file.
    pub fn bytes(&self) -> Vec<u8> {
        [&self.header[..], &self.blocks.concat()].concat()
    }

    /// Number of the first frame of a block, and of the first one behind it.
    ///
    /// # Panics
    /// Where there is no such block.
    pub fn frames_of(&self, block: usize) -> (usize, usize) {
        let first = |block: &[u8]| {
            u32::from_le_bytes([block[4], block[5], block[6], block[7]]) as usize & 0x7fff_ffff
        };
        let end = self.blocks.get(block + 1).map_or(self.frames.len(), |next| first(next));
        (first(&self.blocks[block]), end)
    }
}

/// The first `most` of the recorded clips, as dpcm with so many entry points a second; `None` where there are not so many,
/// or, for `usize::MAX`, none.
///
/// # Panics
/// Where one cannot be read.
pub fn clips(most: usize, entries: f64) -> Option<Vec<Clip>> {
    let trials = trials()?;
    if most != usize::MAX && trials.len() < most {
        skip(&format!("found {} recorded trials, expected {most} (set BUNRAKU_MOTION)", trials.len()));
        return None;
    }
    Some(trials.iter().take(most).map(|trial| clip(trial, entries)).collect())
}

fn clip((path, skeleton): &(PathBuf, PathBuf), entries: f64) -> Clip {
    let name = path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let loaded = mocap::import::load(path, Some(skeleton), None);
    let loaded = loaded.unwrap_or_else(|error| panic!("{error}"));
    let encoder = Encoder::new(&loaded.skeleton, &loaded.motion).unwrap_or_else(|error| panic!("{error}"));
    let entry_frames = (loaded.motion.fps / entries).round() as usize;
    let encoding = Encoding { entry_frames, block_bytes: 400, ..Encoding::new(CodecId::Dpcm) };
    let encoded = encoder.encode(&encoding, Quality::Step(0.25));
    let bytes = encoded.unwrap_or_else(|error| panic!("{name}: {error}"));
    let (frames, rate_centihertz) = decoded(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    let (header, mut rest) = bytes.split_at(Prefix::read(&bytes).map_or(0, |prefix| prefix.header_bytes));
    let mut blocks = vec![];
    while let [low, high, ..] = *rest {
        let (block, behind) = rest.split_at(12 + usize::from(u16::from_le_bytes([low, high])));
        blocks.push(block.to_vec());
        rest = behind;
    }
    Clip { name, skeleton: loaded.skeleton, rate_centihertz, frames, header: header.to_vec(), blocks }
}

fn decoded(bytes: &[u8]) -> Result<(Vec<Vec<I16F16>>, u16), decoder_core::Error> {
    let clip = mclip::Clip::parse(bytes, Limits::MAX)?;
    let mut memory = OwnedMemory::new(clip.header().needs());
    let mut decoder = clip.decoder(memory.lend())?;
    let mut frames = vec![];
    while let Some(frame) = decoder.next_frame()? {
        frames.push(frame.to_vec());
    }
    Ok((frames, clip.header().rate_centihertz()))
}
