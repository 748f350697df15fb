//! The channels that a puppet's clips have: a column of their frames each.

use super::Puppet;
use crate::clip::Clip;
use anyhow::{Result, anyhow, bail};
use decoder_core::mclip::ChannelKind;
use mocap::{Clip as Recording, Motion, Skeleton};
use std::path::{Path, PathBuf};

/// The channels of a frame, in order, by their names.
#[derive(Clone, Debug, PartialEq)]
pub struct Channels {
    /// Whose they are, for what is told of them.
    of: &'static str,
    /// Each channel's name, and whether it is a rotation.
    columns: Vec<(String, bool)>,
    /// Joints without channels.
    still: Vec<String>,
}

impl From<&Skeleton> for Channels {
    fn from(skeleton: &Skeleton) -> Self {
        let still = skeleton.joints.iter().filter(|joint| joint.channels.is_empty());
        Self {
            of: "the skeleton",
            columns: skeleton
                .channels
                .iter()
                .map(|channel| (channel.name.clone(), channel.dof.is_rotation()))
                .collect(),
            still: still.map(|joint| joint.name.clone()).collect(),
        }
    }
}

impl Channels {
    /// Those that a clip names: none of a .qmd, nor of a .mclip without names.
    pub fn of_clip(clip: &Clip<'_>) -> Option<Self> {
        let Clip::Mclip(clip) = clip else { return None };
        let channels = clip.header().channels();
        let named = channels.clone().any(|channel| !channel.joint.is_empty());
        let columns = channels.map(|channel| (channel.to_string(), channel.kind.is_rotation())).collect();
        named.then_some(Self { of: "the clip", columns, still: Vec::new() })
    }

    /// Those that a puppet's joints follow, as `bunraku encode --puppet` orders them: joints as the puppet's file names them
    /// first, and the channels of each as it does.
    ///
    /// # Errors
    /// A sentence that names the file and the line of a channel that is none.
    pub fn of_puppet(puppet: &Puppet) -> Result<Self> {
        let mut names: Vec<&str> = Vec::new();
        for name in puppet.file.joint.iter().map(|entry| entry.channel.get_ref()) {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        let mut joints: Vec<&str> = names.iter().map(|name| joint(name)).collect();
        let first = joints.clone();
        joints.sort_by_key(|name| first.iter().position(|other| other == name));
        joints.dedup();
        let mut columns = Vec::new();
        for name in joints.iter().flat_map(|&of| names.iter().filter(move |name| joint(name) == of)) {
            let kind = ChannelKind::ALL.into_iter().find(|kind| name.ends_with(&format!(".{}", kind.name())));
            let Some(kind) = kind else {
                let why =
                    format!("\"{name}\" is no channel, expected joint.rx, .ry, .rz, .tx, .ty, .tz or .l");
                return Err(puppet.wrong_channel(name, &why));
            };
            columns.push(((*name).to_owned(), kind.is_rotation()));
        }
        Ok(Self { of: "the puppet", columns, still: Vec::new() })
    }

    /// Those of the clips that a puppet plays: of the skeleton in `given`, or of the one that the puppet names, or else those that
    /// its joints follow, which is what `bunraku encode --puppet` puts into a clip.
    ///
    /// # Errors
    /// A sentence where the skeleton cannot be read.
    pub fn of_clips(puppet: &Puppet, given: Option<PathBuf>) -> Result<Self> {
        match given.or_else(|| puppet.skeleton()) {
            Some(path) => Ok(Self::from(&mocap::import::load_skeleton(&path)?)),
            None => Self::of_puppet(puppet),
        }
    }

    /// Those of the clip at `path`: as it names them; where it names none, as [`of_clips`](Self::of_clips).
    ///
    /// # Errors
    /// A sentence where the skeleton cannot be read, or has another number of channels.
    pub fn of_played(path: &Path, clip: &Clip<'_>, puppet: &Puppet, given: Option<PathBuf>) -> Result<Self> {
        if let Some(channels) = Self::of_clip(clip) {
            return Ok(channels);
        }
        let channels = Self::of_clips(puppet, given)?;
        channels.fit(path, clip)?;
        Ok(channels)
    }

    /// Checks that a clip has as many, and the same where it names its own.
    ///
    /// # Errors
    /// A sentence that says which it has.
    pub fn fit(&self, path: &Path, clip: &Clip<'_>) -> Result<()> {
        let (found, expected) = (clip.channels(), self.columns.len());
        let (name, of) = (path.display(), self.of);
        if found != expected {
            let hint = if of == "the puppet" {
                ", which has no skeleton: name the clip's with --skeleton"
            } else {
                ""
            };
            bail!("{name} has {found} channels, expected {expected} as in {of}{hint}");
        }
        let Some(own) = Self::of_clip(clip) else { return Ok(()) };
        for (index, ((found, _), (expected, _))) in own.columns.iter().zip(&self.columns).enumerate() {
            if found != expected {
                bail!("{name}: channel {index} is {found}, expected {expected} as in {of}");
            }
        }
        Ok(())
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// The name of a column.
    #[must_use]
    pub fn name(&self, index: usize) -> &str {
        self.columns.get(index).map_or("", |(name, _)| name)
    }

    /// Their names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(name, _)| name.as_str())
    }

    /// The column of a channel, and whether it is a rotation.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<(usize, bool)> {
        let index = self.columns.iter().position(|(own, _)| own == name)?;
        self.columns.get(index).map(|&(_, is_rotation)| (index, is_rotation))
    }

    /// What is to be said of a channel that is none of them.
    pub(crate) fn missing(&self, name: &str) -> String {
        let (joint_name, of) = (joint(name), self.of);
        if self.still.iter().any(|still| still == joint_name) {
            return format!("\"{name}\" is no channel: {of}'s joint \"{joint_name}\" does not move");
        }
        let own: Vec<&str> = self.names().filter(|own| joint(own) == joint_name).collect();
        if !own.is_empty() {
            return format!("\"{name}\" is no channel of {of}; its joint has {}", own.join(", "));
        }
        let mut near: Vec<_> = self.names().map(|own| (strsim::levenshtein(name, own), own)).collect();
        near.sort_unstable();
        let near: Vec<_> = near.into_iter().take(3).map(|(_, name)| name).collect();
        format!("{of} has no joint \"{joint_name}\"; the nearest channels are {}", near.join(", "))
    }
}

/// The motion of a clip on all channels of a skeleton: by their names where it names them, and else in their order. What it does not
/// have is at rest.
///
/// # Errors
/// A sentence where the skeleton lacks one of them.
pub fn on_skeleton(path: &Path, bytes: &[u8], motion: &Motion, skeleton: &Skeleton) -> Result<Motion> {
    let (clip, all) = (Clip::parse(path, bytes)?, Channels::from(skeleton));
    let Some(own) = Channels::of_clip(&clip) else {
        all.fit(path, &clip)?;
        return Ok(motion.clone());
    };
    let mut places = Vec::new();
    for name in own.names() {
        match all.find(name) {
            Some((place, _)) => places.push(place),
            None => bail!("{}: {}", path.display(), all.missing(name)),
        }
    }
    let mut samples = vec![0.0; motion.frames() * all.len()];
    for (row, frame) in samples.chunks_exact_mut(all.len()).zip(motion.iter()) {
        places.iter().zip(frame).for_each(|(&place, &value)| row[place] = value);
    }
    Ok(Motion { fps: motion.fps, channels: all.len(), samples })
}

impl Puppet {
    /// The part of a recording that the puppet's joints follow, with the channels of [`Channels::of_puppet`].
    ///
    /// # Errors
    /// A sentence that names the file and the line of a channel that the recording does not have.
    pub fn followed(&self, recording: &Recording) -> Result<Recording> {
        let all = Channels::from(&recording.skeleton);
        let mut kept = Vec::new();
        for name in Channels::of_puppet(self)?.names() {
            let Some((index, _)) = all.find(name) else {
                return Err(self.wrong_channel(name, &all.missing(name)));
            };
            kept.push(index);
        }
        let motion = recording.motion.with_channels(&kept);
        Ok(Recording { skeleton: recording.skeleton.with_channels(&kept), motion })
    }

    /// A mistake in the channel that is called `name`.
    fn wrong_channel(&self, name: &str, why: &str) -> anyhow::Error {
        let entry = self.file.joint.iter().find(|entry| entry.channel.get_ref() == name);
        entry.map_or_else(|| anyhow!("{why}"), |entry| self.wrong(&entry.channel, why))
    }
}

/// The joint of a channel.
fn joint(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(joint, _)| joint)
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::mclip::CodecId;
    use encoder::mclip::{Encoder, Encoding, Quality};

    fn puppet(channels: &[&str]) -> Puppet {
        let mut text = "servo_hz = 50\nbaud = 1_000_000\n".to_owned();
        for (id, channel) in channels.iter().enumerate() {
            text += &format!(
                "[[joint]]\nname = \"{id}\"\nid = {id}\nchannel = \"{channel}\"\nrange = [-10, 10]\nmax_speed = 100\n"
            );
        }
        Puppet::parse(Path::new("puppet.toml"), text).unwrap()
    }

    #[test]
    fn a_puppets_own_channels_are_its_joints_in_order() {
        let puppet = puppet(&["a.b.rx", "c.tz", "a.b.rz", "c.tz", "d.l", "a.b.rx"]);
        let channels = Channels::of_puppet(&puppet).unwrap();
        assert_eq!(channels.names().collect::<Vec<_>>(), ["a.b.rx", "a.b.rz", "c.tz", "d.l"]);
        assert_eq!(channels.find("c.tz"), Some((2, false)));
        assert_eq!(Channels::of_clips(&puppet, None).unwrap(), channels);
        let error = format!("{:#}", Channels::of_puppet(&self::puppet(&["a.rx", "elbow"])).unwrap_err());
        assert!(
            error.starts_with("puppet.toml, line 12, key \"channel\": \"elbow\" is no channel"),
            "{error}"
        );
    }

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
        let puppet = puppet(&["root.ty", "lradius.rx"]);
        let channels = Channels::of_played(path, &clip, &puppet, None).unwrap();
        assert_eq!(channels.names().collect::<Vec<_>>(), ["lradius.rx", "root.ty"]);
        assert!(channels.fit(path, &clip).is_ok());
        let error = |channels: &Channels| format!("{:#}", channels.fit(path, &clip).unwrap_err());
        assert_eq!(
            error(&Channels::of_puppet(&puppet).unwrap()),
            "clip.mclip: channel 0 is lradius.rx, expected root.ty as in the puppet"
        );
        assert_eq!(
            error(&Channels::from(&sample.skeleton)),
            "clip.mclip has 2 channels, expected 31 as in the skeleton"
        );
        let whole = on_skeleton(path, &bytes, &motion, &sample.skeleton).unwrap();
        assert_eq!((whole.channels, whole.with_channels(&kept)), (31, motion));
        assert!(channels.missing("lradius.ry").contains("of the clip; its joint has lradius.rx"));
    }
}
