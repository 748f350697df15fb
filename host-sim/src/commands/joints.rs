//! The table of a puppet's joints in a clip: what `encode`, `compare`, `play` and `puppet check` say of them.

use anyhow::{Context, Result};
use firmware::decoder_list::SingleClip;
use firmware::library::Library;
use host_sim::clip::Clip;
use host_sim::puppet::joint_errors::{Asked, JointBounds, JointError, Recorded};
use puppet_file::{Channels, Map, Puppet, Unit};
use serde::Serialize;
use std::path::Path;

/// A joint in a clip.
#[derive(Serialize)]
pub struct Row {
    /// The joint's name in puppet.toml.
    joint: String,
    /// The unit of all values.
    unit: &'static str,
    #[serde(flatten)]
    error: JointError,
    /// The errors that the limits of the joint make of the recording itself; of a clip alone there are none.
    #[serde(skip)]
    least: Option<JointError>,
}

/// A value with one digit behind the point, without a sign where that makes it 0.
pub fn tidy(value: f64) -> f64 {
    if value.abs() < 0.05 { 0.0 } else { value }
}

/// The joints of a puppet in a clip.
#[derive(Serialize)]
#[serde(transparent)]
pub struct Table {
    rows: Vec<Row>,
}

impl Table {
    fn new(puppet: &Puppet, map: &Map, channels: &Channels, errors: Vec<JointError>) -> Self {
        let rows = map.joints().iter().zip(errors).map(|(joint, error)| {
            let channel = channels.find(channels.name(joint.channel.into()));
            let unit = channel.map_or(Unit::Centimetre, |(_, unit)| unit).symbol();
            Row { joint: puppet.name_of(joint).to_owned(), unit, error, least: None }
        });
        Self { rows: rows.collect() }
    }

    /// Of a clip alone, at a rate in hundredths of a hertz: what the limits of the joints make of it.
    ///
    /// # Errors
    /// Where clip and map do not fit together.
    pub fn of_clip(
        path: &Path,
        clip: &Clip<'_>,
        centihertz: u16,
        puppet: &Puppet,
        map: &Map,
        channels: &Channels,
    ) -> Result<Self> {
        let errors = || {
            let asked = clip
                .decode(|frames| Asked::of(&mut SingleClip::new(frames, Some(centihertz)).open(0)?, map))?;
            clip.decode(|frames| asked.errors(&mut SingleClip::new(frames, Some(centihertz)).open(0)?))
        };
        let errors = errors().with_context(|| format!("cannot play {}", path.display()))?;
        Ok(Self::new(puppet, map, channels, errors))
    }

    /// Of a clip beside the motion that it was made of.
    ///
    /// # Errors
    /// Where clip or motion and the puppet do not fit together.
    pub fn of_recording(path: &Path, bytes: &[u8], puppet: &Puppet, recording: &mocap::Clip) -> Result<Self> {
        let channels = Channels::from(&recording.skeleton);
        let map = puppet.map(channels.clone())?;
        let mut motion = recording.motion.clone();
        motion.unwrap_angles(&recording.skeleton);
        let asked = Asked::of(&mut Recorded::new(&motion), &map)?;
        let errors = Clip::headers(path, bytes)?.decode(|frames| asked.errors(frames))?;
        let mut table = Self::new(puppet, &map, &channels, errors);
        let least = asked.errors(&mut Recorded::new(&motion))?;
        table.rows.iter_mut().zip(least).for_each(|(row, least)| row.least = Some(least));
        Ok(table)
    }

    /// Prints it, and what it shows of joints that never move.
    pub fn print(&self) {
        let width = self.rows.iter().map(|row| row.joint.chars().count()).max().unwrap_or(0).max(5);
        let is_fitted = self.rows.iter().all(|row| row.least.is_some());
        let recorded = if is_fitted { format!("{:>19}  ", "fitted") } else { String::new() };
        println!(
            "{:width$}  {recorded}{:>19}  {:>19}  {:>8}  {:>8}",
            "joint", "in the clip", "played", "RMS", "worst"
        );
        for Row { joint, unit, error, .. } in &self.rows {
            let range = |[low, high]: [f64; 2]| format!("{:7.1} to {:6.1} {unit}", tidy(low), tidy(high));
            let recorded = if is_fitted { format!("{:>19}  ", range(error.asked)) } else { String::new() };
            println!(
                "{joint:width$}  {recorded}{:>19}  {:>19}  {:>6.2} {unit}  {:>6.2} {unit} at {:.2} s",
                range(error.clip),
                range(error.played),
                error.rms,
                error.worst.value,
                error.worst.seconds
            );
        }
        let count = self.rows.iter().filter(|row| row.error.stands_still()).count();
        println!("{} of {} joints move", self.rows.len() - count, self.rows.len());
        for Row { joint, unit, error, .. } in self.rows.iter().filter(|row| row.error.stands_still()) {
            let (told, [low, high]) = (tidy(error.played[0]), error.asked.map(tidy));
            let source = if is_fitted { "fit asks for" } else { "the clip has" };
            println!(
                "joint \"{joint}\" never moves: its servo is told {told:.1} {unit} all the time, and {source} {low:.1} to \
                 {high:.1} {unit}"
            );
        }
    }

    /// Says on standard error which joints are beyond their bounds, what they have, and what their limits alone make of it.
    pub fn tell_beyond(&self, path: &Path, bounds: JointBounds) {
        for Row { joint, unit, error, least } in
            self.rows.iter().filter(|row| bounds.excess(&row.error) > 1.0)
        {
            let why = match least {
                Some(least) if bounds.excess(least) > 1.0 => format!(
                    "; the joint's limits alone keep it {:.2} {unit} RMS and {:.2} {unit} at worst from that",
                    least.rms, least.worst.value
                ),
                _ => String::new(),
            };
            eprintln!(
                "bunraku: {}: joint \"{joint}\" is {:.2} {unit} RMS and {:.2} {unit} at worst, at {:.2} s, from what fit asks for; \
                 expected {} and {} at most{why}",
                path.display(),
                error.rms,
                error.worst.value,
                error.worst.seconds,
                bounds.rms,
                bounds.worst
            );
        }
    }
}
