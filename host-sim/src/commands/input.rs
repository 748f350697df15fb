//! Arguments that several commands share: what is read, and how it is coded.

use super::fit_table::TOLD;
use super::frames::FrameRange;
use super::number::{above_zero, recorded_rate};
use super::same_channels;
use anyhow::{Context, Result, anyhow, bail};
use encoder::qmd::Method;
use fit::{Follows, Plan, Report};
use host_sim::clip::Clip as AnyClip;
use host_sim::files;
use host_sim::puppet::new::{FOUR_LEGS, Figure};
use mocap::Clip;
use mocap::body::{Body, goes_on_four_legs};
use mocap::import::{self, Imported, Options, Unit, Values};
use mocap::skeleton::Origin;
use mocap::survey::Survey;
use puppet_file::Puppet;
use std::path::{Path, PathBuf};

/// How a motion file is read.
#[derive(clap::Args, Clone)]
pub struct Recording {
    /// The skeleton (.asf) that an AMC needs.
    #[arg(long, value_name = "S.asf")]
    pub skeleton: Option<PathBuf>,
    /// Frames per second that are wanted: the motion is resampled. An AMC mostly has no rate of its own: there, without --rate, this is
    /// its rate.
    #[arg(long, value_name = "F", value_parser = recorded_rate)]
    pub fps: Option<f64>,
    /// Frames per second that the file's frames are, whatever it says; of an AMC without a rate 120 unless given.
    #[arg(long, value_name = "F", value_parser = recorded_rate)]
    pub rate: Option<f64>,
    /// Unit of the lengths in a BVH: m, cm, mm, inch, ft, cmu (of the CMU database, 5.64 cm), or a length such as 2.5cm. Guessed from
    /// the size of the figure unless given.
    #[arg(long, value_name = "UNIT")]
    pub unit: Option<Unit>,
    /// Only these frames of the file, from 0 on and the last one left out: `1..` leaves out the first, which is often a T-pose.
    #[arg(long, value_name = "FIRST..END")]
    frames: Option<FrameRange>,
    /// Unit of the columns of a table or a recorded move whose names say none: degrees, radians, or goals of servos. Else those of a
    /// table are degrees, and those of a move are guessed.
    #[arg(long, value_name = "UNIT")]
    values: Option<Values>,
}

/// How a motion file is read, and the puppet that it is for.
#[derive(clap::Args, Clone)]
pub struct Source {
    #[command(flatten)]
    pub recording: Recording,
    /// Fit the motion to this puppet: one channel for each of its joints, in degrees (cm for translations) within the joint's
    /// range. Such a clip needs no skeleton to be played, and is all that the puppet's controller has to hold and decode. An
    /// error of 1 cm is 1 degree of a joint.
    #[arg(long, value_name = "PUPPET.toml")]
    pub puppet: Option<PathBuf>,
    /// Bring each of the puppet's joints within its speed and acceleration first, without delay.
    #[arg(long, requires = "puppet")]
    smooth: bool,
}

impl Recording {
    /// The motion in a .amc, .bvh, .csv, .glb, .gltf or .json file.
    pub fn load(&self, path: &Path) -> Result<Clip> {
        let (clip, notes) = self.read(path)?;
        tell(path, &notes);
        Ok(clip)
    }

    /// As [`load`](Self::load), with what is to be told of it.
    fn read(&self, path: &Path) -> Result<(Clip, Vec<String>)> {
        if is_clip(path) {
            bail!(
                "{} is a compressed clip, expected a motion (.amc, .bvh, .csv, .glb, .gltf or .json)",
                path.display()
            );
        }
        let (skeleton, unit) = (self.skeleton.as_deref(), self.unit.clone());
        let options = Options { skeleton, unit, fps: self.rate, sampled_fps: self.fps, values: self.values };
        let Imported { mut clip, has_rate, mut notes } = import::read(path, &options)?;
        // Frames are those of the file: a T-pose that is left out must not be in what is resampled.
        if let Some(frames) = self.frames {
            clip.motion = frames.of(path, &clip.motion)?;
        }
        let own = clip.motion.fps;
        match self.fps {
            Some(fps) if !has_rate => clip.motion.fps = fps,
            Some(fps) if fps != own => {
                let values = clip.motion.samples.len() as f64 * (fps / own).max(1.0);
                if values > MOST_VALUES {
                    bail!(
                        "{}: at {} frames a second these {} frames of {} a second become {values:.1e} values, expected at \
                         most {MOST_VALUES:.0e}: give a lower --fps",
                        path.display(),
                        short(fps),
                        clip.motion.frames(),
                        short(own)
                    );
                }
                clip.motion = mocap::resample(&clip.skeleton, &clip.motion, fps);
                notes.push(format!("resampled from {} to {} frames a second", short(own), short(fps)));
            }
            None if !has_rate => {
                notes.push(format!(
                    "no frame rate in the file: taken as {own} frames a second (else give --rate)"
                ));
            }
            _ => {}
        }
        Ok((clip, notes))
    }
}

impl Source {
    /// The motion in a .amc, .bvh, .csv, .glb, .gltf or .json file, fitted to the puppet where there is one.
    pub fn load(&self, path: &Path) -> Result<Clip> {
        Ok(self.load_fitted(path)?.0)
    }

    /// As [`load`](Self::load), and what the puppet cannot do of it.
    pub fn load_fitted(&self, path: &Path) -> Result<(Clip, Option<Report>)> {
        let (clip, mut notes) = self.recording.read(path)?;
        let fps = clip.motion.fps;
        if self.puppet.is_some() && !(0.01..=655.35).contains(&fps) {
            bail!(
                "{}: {fps:.3e} frames a second, expected 0.01 to 655.35: give the true rate with --rate, or --fps to resample",
                path.display()
            );
        }
        if self.puppet.is_some()
            && self.recording.frames.is_none()
            && let Some(jump) = Survey::of(&clip).jump
        {
            notes.push(format!(
                "frame 0 is apart from the others ({} jumps by {:.0} degrees), perhaps a T-pose: --frames 1.. leaves it out",
                clip.skeleton.channels[jump.channel].name, jump.degrees
            ));
        }
        let Some(puppet) = &self.puppet else {
            tell(path, &notes);
            return Ok((clip, None));
        };
        let plan = Puppet::read(puppet)?.plan(&clip).map_err(|mistakes| {
            let sentences: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
            anyhow!(sentences.join("\nbunraku: "))
        })?;
        notes.extend(unfollowed(&plan, &clip));
        if goes_on_four_legs(&clip, &Body::of(&clip.figure())) {
            notes.push(FOUR_LEGS.to_owned());
        }
        tell(path, &notes);
        let fitted = fit::fit(&plan, &clip, self.smooth);
        let found: Vec<_> = fitted.report.twists.iter().filter(|twist| !twist.is_known).collect();
        if found.iter().any(|twist| twist.degrees.abs() > TOLD)
            && let Some(text) = Figure::of(&clip, &fitted.report.twists).text()
        {
            eprint!(
                "bunraku: {}: how limbs are twisted was found from these frames. With these lines at the end of {}, other recordings \
                 of this figure have the same zeros:\n{text}",
                path.display(),
                puppet.display()
            );
        }
        Ok((fitted.clip, Some(fitted.report)))
    }

    /// The motion in a .amc, .bvh, .qmd or .mclip file on the skeleton of `reference`, whose channels it must have, in any order
    /// where it names them. Also the size that counts: that of a compressed clip, or of the samples as float32.
    pub fn load_any(&self, path: &Path, reference: &Clip) -> Result<(Clip, u64)> {
        if !is_clip(path) {
            let clip = self.load(path)?;
            let bytes = clip.motion.samples.len() * 4;
            let motion = same_channels::of_motion(path, &clip, &reference.skeleton)?;
            return Ok((Clip { skeleton: reference.skeleton.clone(), motion }, bytes as u64));
        }
        let bytes = files::read(path)?;
        let clip = AnyClip::headers(path, &bytes)?;
        let places = same_channels::of_clip(path, &clip, &reference.skeleton)?;
        let (found, expected) = (clip.frames() as usize, reference.motion.frames());
        if found != expected {
            bail!("{} has {found} frames, expected {expected} as in the reference", path.display());
        }
        let mut motion = decode(path, &bytes)?.with_channels(&places);
        if motion.fps == 0.0 {
            motion.fps = self.recording.fps.unwrap_or(reference.motion.fps);
        }
        Ok((Clip { skeleton: reference.skeleton.clone(), motion }, bytes.len() as u64))
    }
}

/// Values that a recording may have after it was resampled: an hour of two hundred channels at 120 frames a second.
const MOST_VALUES: f64 = 1e8;

/// The columns of a table that no joint follows, as a sentence.
fn unfollowed(plan: &Plan, clip: &Clip) -> Option<String> {
    if clip.skeleton.origin != Origin::Table {
        return None;
    }
    let follows = |column: usize| {
        plan.joints.iter().any(|joint| match joint.follows {
            Follows::Channel(channel) | Follows::Goals { channel, .. } => channel == column,
            _ => false,
        })
    };
    let columns = clip.skeleton.channels.iter().enumerate().filter(|(column, _)| !follows(*column));
    let names: Vec<String> = columns.map(|(_, channel)| channel.name.escape_debug().to_string()).collect();
    (!names.is_empty()).then(|| format!("left out, since no joint follows them: {}", names.join(", ")))
}

/// A rate with up to three decimals.
pub fn short(rate: f64) -> String {
    format!("{rate:.3}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// What the reader of a file had to guess, mend or leave out.
pub fn tell(path: &Path, notes: &[String]) {
    for note in notes {
        eprintln!("bunraku: {}: {note}", path.display());
    }
}

/// Whether the file's name says that it is one of our compressed clips.
pub fn is_clip(path: &Path) -> bool {
    is_qmd(path) || is_mclip(path)
}

/// Whether the file's name says that it is a clip with the layout of the QMD paper.
pub fn is_qmd(path: &Path) -> bool {
    has_extension(path, "qmd")
}

/// Whether the file's name says that it is a clip in blocks.
pub fn is_mclip(path: &Path) -> bool {
    has_extension(path, "mclip")
}

fn has_extension(path: &Path, expected: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(expected))
}

/// Decodes a compressed clip of either kind.
pub fn decode(path: &Path, bytes: &[u8]) -> Result<mocap::Motion> {
    if is_mclip(path) {
        encoder::mclip::decode(bytes).with_context(|| format!("{} is not a sound mclip", path.display()))
    } else {
        encoder::qmd::decode(bytes).with_context(|| format!("{} is not a QMD clip", path.display()))
    }
}

/// Whether a clip may be much longer than its size suggests.
#[derive(clap::Args, Clone, Copy)]
pub struct Length {
    /// Take a clip that is much longer than its size suggests, whatever time and memory that needs.
    #[arg(long)]
    pub long: bool,
}

/// The quality control parameters of QMD.
#[derive(clap::Args, Clone)]
pub struct Quality {
    /// Leading channels that stay floats (QMD FDF); 6 unless given, or all where there are fewer.
    #[arg(long, value_name = "CHANNELS")]
    pub fdf: Option<u16>,
    /// Use the paper's encoder, whose errors add up, instead of ours.
    #[arg(long)]
    pub faithful: bool,
    /// The constant k of the paper's equation 1; selective averaging (its limit) unless given.
    #[arg(long, value_name = "K", requires = "faithful", value_parser = above_zero)]
    pub exponent: Option<f64>,
}

impl Quality {
    /// FDF for a motion of so many channels.
    pub fn fixed_channels(&self, channels: usize) -> u16 {
        self.fdf.unwrap_or_else(|| 6.min(channels as u16))
    }

    /// The encoder to use.
    pub const fn method(&self) -> Method {
        if self.faithful { Method::Faithful { exponent: self.exponent } } else { Method::ClosedLoop }
    }
}
