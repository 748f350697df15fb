//! A compressed clip of either kind.

use crate::terminal;
use anyhow::{Context, Result, bail};
use decoder_core::{I16F16, Limits, mclip, qmd};
use encoder::memory::OwnedMemory;
use firmware::frames::Frames;
use std::collections::HashSet;
use std::path::Path;

/// A clip in one of our two containers, which was checked.
pub enum Clip<'a> {
    /// A .qmd.
    Qmd(qmd::Clip<'a>),
    /// A .mclip.
    Mclip(mclip::Clip<'a>),
}

/// Whether these are the bytes of a .mclip. A .qmd that began like one would have 1.3 thousand million frames.
pub fn is_mclip(bytes: &[u8]) -> bool {
    bytes.starts_with(&mclip::MAGIC)
}

/// Values that a clip may have, whatever its size: three quarters of an hour of 12 channels at 120 frames a second.
const MOST_VALUES: u64 = 4_000_000;

/// Values for each byte that a clip may have besides. A long movement has about four, a long rest has many more.
const VALUES_PER_BYTE: u64 = 64;

/// Most values of a clip of so many bytes that are decoded without being asked for. A few bytes may say that they are
/// thousands of millions, and what is decoded is to take time and memory in proportion to the file.
pub const fn most_values(bytes: usize) -> u64 {
    let of_size = VALUES_PER_BYTE.saturating_mul(bytes as u64);
    if of_size > MOST_VALUES { of_size } else { MOST_VALUES }
}

impl<'a> Clip<'a> {
    /// Checks the bytes of the file `path`, whose extension or first bytes say the container. Of a .mclip every block
    /// is decoded once, so that none is found damaged later.
    ///
    /// # Errors
    /// A sentence that names the file and the byte.
    pub fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let clip = Self::headers(path, bytes)?;
        clip.check(path, false)?;
        Ok(clip)
    }

    /// Checks all of the bytes of the file `path` but what its frames decode to: headers, names and checksums. Takes time in
    /// proportion to the file.
    ///
    /// # Errors
    /// A sentence that names the file and the byte.
    pub fn headers(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let name = path.display();
        let extension = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mclip"));
        if extension || is_mclip(bytes) {
            let clip = mclip::Clip::parse(bytes, Limits::MAX).and_then(mclip::Clip::verify);
            let clip = clip.with_context(|| format!("{name} is not a sound mclip"))?;
            if let Some(channel) = twice(&clip) {
                bail!("{name} is not a sound mclip: the channel {channel} is there twice");
            }
            return Ok(Self::Mclip(clip));
        }
        let clip = qmd::Clip::parse(bytes, Limits::MAX);
        Ok(Self::Qmd(clip.with_context(|| format!("{name} is not a QMD clip"))?))
    }

    /// Decodes every frame of the clip at `path` once. One that is much longer than its size suggests is refused, unless
    /// it may be `long`.
    ///
    /// # Errors
    /// A sentence that names the file, and the byte or what it has too much of.
    pub fn check(&self, path: &Path, long: bool) -> Result<()> {
        self.check_length(path, long)?;
        let Self::Mclip(clip) = self else { return Ok(()) };
        let all = || -> Result<(), decoder_core::Error> {
            let mut memory = OwnedMemory::new(clip.header().needs());
            let mut decoder = clip.decoder(memory.lend())?;
            while decoder.next_frame()?.is_some() {}
            Ok(())
        };
        all().with_context(|| format!("{} is not a sound mclip", path.display()))
    }

    /// Refuses a clip that is much longer than its size suggests, unless it may be `long`.
    ///
    /// # Errors
    /// A sentence that names the file and what it has too much of.
    pub fn check_length(&self, path: &Path, long: bool) -> Result<()> {
        let Self::Mclip(clip) = self else { return Ok(()) };
        let (frames, channels, bytes) = (clip.frames(), clip.channels(), clip.bytes().len());
        let (found, most) = (u64::from(frames) * channels as u64, most_values(bytes));
        if found > most && !long {
            bail!(
                "{}: {frames} frames of {channels} channels in {bytes} bytes are {found} values, expected at most {most} of a \
                 file of this size; `bunraku decode` and `bunraku play` take it with --long",
                path.display()
            );
        }
        Ok(())
    }

    /// Frames a second in hundredths; 0 where the clip does not say.
    pub fn rate_centihertz(&self) -> u16 {
        match self {
            Self::Qmd(clip) => clip.rate_centihertz(),
            Self::Mclip(clip) => clip.header().rate_centihertz(),
        }
    }

    /// Values in a frame.
    pub fn channels(&self) -> usize {
        match self {
            Self::Qmd(clip) => clip.channels(),
            Self::Mclip(clip) => clip.channels(),
        }
    }

    /// Frames.
    pub fn frames(&self) -> u32 {
        match self {
            Self::Qmd(clip) => clip.frames(),
            Self::Mclip(clip) => clip.frames(),
        }
    }

    /// Memory for a decoder.
    pub fn lend(&self) -> Memory {
        match self {
            Self::Qmd(clip) => Memory::Qmd(vec![I16F16::ZERO; clip.channels()], vec![0; clip.table_len()]),
            Self::Mclip(clip) => Memory::Mclip(OwnedMemory::new(clip.header().needs())),
        }
    }

    /// A decoder before the first frame, in memory of this clip's.
    ///
    /// # Errors
    /// Where the memory is that of another clip.
    pub fn decoder<'s>(&self, memory: &'s mut Memory) -> Result<Box<dyn Frames + 's>>
    where
        'a: 's,
    {
        match (self, memory) {
            (Self::Qmd(clip), Memory::Qmd(pose, table)) => Ok(Box::new(clip.decoder(pose, Some(table))?)),
            (Self::Mclip(clip), Memory::Mclip(memory)) => Ok(Box::new(clip.decoder(memory.lend())?)),
            _ => bail!("the decoder's memory is of another kind of clip"),
        }
    }

    /// Gives `play` a decoder that is before the first frame.
    ///
    /// # Errors
    /// Those of `play`.
    pub fn decode<T>(&self, play: impl FnOnce(&mut dyn Frames) -> Result<T>) -> Result<T> {
        play(&mut *self.decoder(&mut self.lend())?)
    }
}

/// The name of a channel that a clip has twice. A decoder, which knows channels by their places, does not see that; all who
/// look channels up by their names would take the wrong one.
fn twice(clip: &mclip::Clip<'_>) -> Option<String> {
    let mut seen = HashSet::new();
    let named = clip.header().channels().filter(|channel| !channel.joint.is_empty());
    let mut twice = named.filter(|channel| !seen.insert((channel.joint, channel.kind)));
    twice.next().map(|channel| terminal::name(&channel.to_string()))
}

/// What a clip's decoder works in.
pub enum Memory {
    /// Of a .qmd: its pose and its table.
    Qmd(Vec<I16F16>, Vec<i32>),
    /// Of a .mclip.
    Mclip(OwnedMemory),
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::mclip::CodecId;
    use encoder::mclip::{Encoder, Encoding, Quality};
    use encoder::qmd::{Method, Parameters};

    fn frames(clip: &Clip<'_>) -> Vec<Vec<I16F16>> {
        let all = clip.decode(|decoder| {
            let mut frames = Vec::new();
            while let Some(frame) = decoder.next_frame().unwrap() {
                frames.push(frame.to_vec());
            }
            Ok(frames)
        });
        all.unwrap()
    }

    #[test]
    fn both_containers_are_known_by_what_they_hold() {
        let sample = mocap::sample::clip();
        let encoder = Encoder::new(&sample.skeleton, &sample.motion).unwrap();
        let mut mclip = encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(8)).unwrap();
        let qmd = encoder::qmd::encode(&sample, Parameters::TABLE_1, Method::ClosedLoop).unwrap();
        for (bytes, in_blocks) in [(&mclip, true), (&qmd, false)] {
            let clip = Clip::parse(Path::new("clip"), bytes).unwrap();
            assert_eq!(matches!(clip, Clip::Mclip(_)), in_blocks);
            assert_eq!((clip.frames(), clip.channels(), clip.rate_centihertz()), (480, 31, 6000));
            let frames = frames(&clip);
            assert_eq!(frames.len(), 480);
            let off = |frame: usize, channel: usize| {
                (frames[frame][channel].to_num::<f64>() - sample.motion.frame(frame)[channel]).abs()
            };
            assert!((0..480).all(|frame| (6..31).all(|channel| off(frame, channel) < 3.0)));
        }
        let error = |path: &str, bytes: &[u8]| {
            format!("{:#}", Clip::parse(Path::new(path), bytes).err().expect("a wrong clip"))
        };
        assert!(error("a.mclip", &qmd).starts_with("a.mclip is not a sound mclip: "));
        assert!(error("a.qmd", &qmd[..100]).starts_with("a.qmd is not a QMD clip: "));
        // A damaged block is found before anything plays.
        let last = mclip.len() - 1;
        mclip[last] ^= 1;
        assert!(
            error("a.mclip", &mclip).contains("damage in the block's codes"),
            "{}",
            error("a.mclip", &mclip)
        );
    }
}
