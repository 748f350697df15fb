//! The channels of the clips that a puppet plays.

use crate::clip::Clip;
use crate::terminal;
use anyhow::{Result, bail};
use mocap::{Motion, Skeleton};
use puppet_file::{Channels, Owner, Puppet, Unit};
use std::path::{Path, PathBuf};

/// Those that a clip names, each on one line: none of a .qmd, nor of a .mclip without names.
pub fn of_clip(clip: &Clip<'_>) -> Option<Channels> {
    let Clip::Mclip(clip) = clip else { return None };
    let channels = clip.header().channels();
    let named = channels.clone().any(|channel| !channel.joint.is_empty());
    let columns = channels
        .map(|channel| (terminal::one_line(&channel.to_string()), Unit::of(channel.kind.is_rotation())));
    named.then(|| Channels::new(Owner::Clip, columns))
}

/// Those of the clips that a puppet plays: of the skeleton in `given`, or of the one that the puppet names.
///
/// Without a skeleton, or where a joint follows something else than a channel, they are those of the puppet's own clips,
/// which `bunraku encode --puppet` makes.
///
/// # Errors
/// A sentence where the skeleton cannot be read.
pub fn of_clips(puppet: &Puppet, given: Option<PathBuf>) -> Result<Channels> {
    match given.or_else(|| puppet.skeleton()) {
        Some(path) if !puppet.needs_fit() => Ok(Channels::from(&mocap::import::load_skeleton(&path)?)),
        _ => Ok(puppet.channels()?),
    }
}

/// Those of the clip at `path`: as it names them; where it names none, as [`of_clips`].
///
/// # Errors
/// A sentence where the skeleton cannot be read, or has another number of channels.
pub fn of_played(path: &Path, clip: &Clip<'_>, puppet: &Puppet, given: Option<PathBuf>) -> Result<Channels> {
    if let Some(channels) = of_clip(clip) {
        return Ok(channels);
    }
    let channels = of_clips(puppet, given)?;
    check_clip(path, clip, &channels)?;
    Ok(channels)
}

/// Checks that a clip has these channels: as many, and the same where it names its own.
///
/// # Errors
/// A sentence that says which it has.
pub fn check_clip(path: &Path, clip: &Clip<'_>, channels: &Channels) -> Result<()> {
    let (name, owner) = (path.display(), channels.owner());
    let (found, expected) = (clip.channels(), channels.len());
    if found != expected {
        let hint = match owner {
            Owner::Puppet => ", which has no skeleton: name the clip's with --skeleton",
            Owner::Skeleton | Owner::Clip => "",
        };
        bail!("{name} has {found} channels, expected {expected} as in {owner}{hint}");
    }
    let Some(own) = of_clip(clip) else { return Ok(()) };
    for (index, (found, expected)) in own.names().zip(channels.names()).enumerate() {
        if found != expected {
            bail!("{name}: channel {index} is {found}, expected {expected} as in {owner}");
        }
    }
    Ok(())
}

/// The motion of a clip on all channels of a skeleton: by their names where the clip names them, and else in their order.
///
/// What the clip does not have is at rest.
///
/// # Errors
/// A sentence where the skeleton lacks one of them.
pub fn on_skeleton(path: &Path, bytes: &[u8], motion: &Motion, skeleton: &Skeleton) -> Result<Motion> {
    let (clip, all) = (Clip::headers(path, bytes)?, Channels::from(skeleton));
    let Some(own) = of_clip(&clip) else {
        check_clip(path, &clip, &all)?;
        return Ok(motion.clone());
    };
    let mut places = Vec::new();
    for name in own.names() {
        match all.find(name) {
            Ok((place, _)) => places.push(place),
            Err(missing) => bail!("{}: {missing}", path.display()),
        }
    }
    let mut samples = vec![0.0; motion.frames() * all.len()];
    for (row, frame) in samples.chunks_exact_mut(all.len()).zip(motion.iter()) {
        places.iter().zip(frame).for_each(|(&place, &value)| row[place] = value);
    }
    Ok(Motion { fps: motion.fps, channels: all.len(), samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::mclip::CodecId;
    use encoder::mclip::{Encoder, Encoding, Quality};

    /// A clip that names its channels says which they are, whatever skeleton there is.
    #[test]
    fn a_clip_names_its_own() {
        let sample = mocap::sample::clip();
        let kept = ["lradius.rx", "root.ty"].map(|name| sample.skeleton.channel(name).unwrap());
        let (skeleton, motion) = (sample.skeleton.with_channels(&kept), sample.motion.with_channels(&kept));
        let bytes = Encoder::new(&skeleton, &motion)
            .unwrap()
            .encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(8))
            .unwrap();
        let path = Path::new("clip.mclip");
        let clip = Clip::parse(path, &bytes).unwrap();
        let mut text = "servo_hz = 50\nbaud = 1_000_000\n".to_owned();
        for (id, channel) in ["root.ty", "lradius.rx"].iter().enumerate() {
            text += &format!(
                "[[joint]]\nname = \"{id}\"\nid = {id}\nchannel = \"{channel}\"\nrange = [-10, 10]\n"
            );
            text += "max_speed = 100\n";
        }
        let puppet = Puppet::parse(Path::new("puppet.toml"), text).unwrap();
        assert_eq!(of_clips(&puppet, None).unwrap(), puppet.channels().unwrap());
        let channels = of_played(path, &clip, &puppet, None).unwrap();
        assert_eq!(channels.names().collect::<Vec<_>>(), ["lradius.rx", "root.ty"]);
        assert!(check_clip(path, &clip, &channels).is_ok());
        let error = |channels: &Channels| format!("{:#}", check_clip(path, &clip, channels).unwrap_err());
        assert_eq!(
            error(&puppet.channels().unwrap()),
            "clip.mclip: channel 0 is lradius.rx, expected 0.tx as in the puppet"
        );
        assert_eq!(
            error(&Channels::from(&sample.skeleton)),
            "clip.mclip has 2 channels, expected 31 as in the skeleton"
        );
        let whole = on_skeleton(path, &bytes, &motion, &sample.skeleton).unwrap();
        assert_eq!((whole.channels, whole.with_channels(&kept)), (31, motion));
        let missing = channels.find("lradius.ry").unwrap_err().to_string();
        assert!(missing.contains("of the clip; its joint has lradius.rx"), "{missing}");
    }
}
