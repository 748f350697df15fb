//! SHOW.toml.

use crate::clip::Clip;
use crate::files;
use crate::puppet::channels;
use crate::puppet_servos;
use anyhow::{Context, Result, anyhow, bail, ensure};
use decoder_core::mclip::Prefix;
use firmware::clock::Speed;
use firmware::machine::{After, Command, Show};
use firmware::script;
use firmware::sender::{STREAM, StreamMemory};
use firmware::stream::Live;
use puppet_file::{Channels, Map, Place, Puppet};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::{Spanned, Table};
use virtual_servos::virtual_bus::Disturbance;

/// Most clips of a show.
pub const MOST_CLIPS: usize = 16;

/// A show whose files were read and checked.
pub struct Program {
    /// Its name: that of the file.
    pub name: String,
    /// The puppet.
    pub map: Map,
    /// Names of the joints, in the map's order.
    pub joints: Vec<String>,
    /// Names of the buses, in the map's order.
    pub buses: Vec<String>,
    /// Clips by number: name, path and bytes.
    pub clips: Vec<(String, PathBuf, Vec<u8>)>,
    /// Numbers of the clips to play from power on.
    pub playlist: Vec<u16>,
    /// Whether the playlist begins again.
    pub repeats: bool,
    /// Clip to repeat while nothing else plays.
    pub idle_clip: Option<u16>,
    /// Clip of the trigger.
    pub trigger_clip: Option<u16>,
    /// What comes after the clips.
    pub after: After,
    /// Commands and what is streamed, with their ticks, in order.
    pub orders: Vec<(u32, script::Order)>,
    /// What happens to the servos, with its tick.
    pub disturbances: Vec<(u32, Disturbance)>,
    /// All events as they were written: seconds and what.
    pub events: Vec<(f64, String)>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    puppet: PathBuf,
    skeleton: Option<PathBuf>,
    #[serde(default)]
    playlist: Vec<Spanned<String>>,
    #[serde(default)]
    repeats: bool,
    idle: Option<Spanned<String>>,
    trigger: Option<Spanned<String>>,
    #[serde(default)]
    after: Ending,
    clip: Vec<ClipEntry>,
    #[serde(default)]
    event: Vec<Spanned<Table>>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "lowercase")]
enum Ending {
    #[default]
    Home,
    Hold,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClipEntry {
    name: Spanned<String>,
    file: PathBuf,
}

/// What a puppet can be told by a show, and what its link does.
#[derive(Deserialize)]
#[serde(tag = "what", rename_all = "kebab-case", deny_unknown_fields)]
enum Order {
    Trigger,
    Acknowledge,
    Pause,
    Resume,
    Stop,
    Home,
    LinkLost,
    Speed {
        factor: f64,
    },
    Seek {
        frame: u32,
    },
    Play {
        clip: String,
        #[serde(default)]
        repeats: bool,
    },
    Queue {
        clip: String,
        #[serde(default)]
        repeats: bool,
    },
    Stream {
        clip: String,
    },
    Gap {
        seconds: f64,
    },
}

/// Events that are done to servos.
const DISTURBANCES: [&str; 4] = ["restart", "silence", "cut", "turn"];

impl Program {
    /// Reads a show, its puppet and its clips.
    ///
    /// # Errors
    /// A sentence that names the file and the line.
    pub fn read(path: &Path) -> Result<Self> {
        let text = String::from_utf8(files::read(path)?).map_err(|error| {
            anyhow!("{}: byte {}: not text", path.display(), error.utf8_error().valid_up_to())
        })?;
        let file: File = toml::from_str(&text).map_err(|error| {
            let place = error.span().map_or(String::new(), |span| Place::of(&text, span).to_string());
            anyhow!("{}{place}: {}", path.display(), error.message().replace('\n', ", "))
        })?;
        let beside =
            |other: &Path| path.parent().map_or_else(|| other.to_owned(), |folder| folder.join(other));
        let puppet = Puppet::read(&beside(&file.puppet))?;
        let channels = channels::of_clips(&puppet, file.skeleton.as_deref().map(beside))?;
        let map = puppet.map(channels.clone())?;
        let joints = map.joints().iter().map(|joint| puppet.name_of(joint).to_owned()).collect();
        let clips = clips(&file, beside, &channels)?;
        let wrong = |span, why: &str| anyhow!("{}{}: {why}", path.display(), Place::of(&text, span));
        let number = |name: &str| clips.iter().position(|(there, ..)| there == name);
        let numbered = |name: &Spanned<String>| {
            let why = || format!("there is no [[clip]] with the name \"{}\"", name.get_ref());
            let number = number(name.get_ref()).ok_or_else(|| wrong(name.span(), &why()))?;
            Ok::<u16, anyhow::Error>(number as u16)
        };
        let (mut orders, mut disturbances, mut events) = (Vec::new(), Vec::new(), Vec::new());
        for event in &file.event {
            let context = || format!("{}{}", path.display(), Place::of(&text, event.span()));
            let mut table = event.get_ref().clone();
            let at = puppet_servos::at(&mut table).with_context(context)?;
            let tick = (at * f64::from(map.tick_hz())).round() as u32;
            events.push((at, told(&table)));
            let what = table.get("what").and_then(toml::Value::as_str).unwrap_or_default();
            if DISTURBANCES.contains(&what) {
                let disturbance = puppet_servos::disturbance(table).with_context(context)?;
                if let Some(servo) = disturbance.servo() {
                    let known = map.joints().iter().any(|joint| joint.id == servo);
                    ensure!(known, "{}: the puppet has no servo {servo}", context());
                }
                disturbances.push((tick, disturbance));
            } else {
                let order = table.try_into::<Order>();
                let order = order.map_err(|error| anyhow!("{}: {}", context(), error.message()))?;
                let order = command(order, map.tick_hz(), &clips, number);
                orders.push((tick, order.with_context(context)?));
            }
        }
        orders.sort_by_key(|(tick, _)| *tick);
        disturbances.sort_by_key(|(tick, _)| *tick);
        events.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        Ok(Self {
            name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            playlist: file.playlist.iter().map(numbered).collect::<Result<_>>()?,
            repeats: file.repeats,
            idle_clip: file.idle.as_ref().map(numbered).transpose()?,
            trigger_clip: file.trigger.as_ref().map(numbered).transpose()?,
            after: match file.after {
                Ending::Home => After::Home,
                Ending::Hold => After::Hold,
            },
            map,
            joints,
            buses: puppet.bus_names(),
            clips,
            orders,
            disturbances,
            events,
        })
    }

    /// A show of clips that play once, one behind the other.
    pub fn of_clips(name: String, map: Map, puppet: &Puppet, clips: Vec<(String, PathBuf, Vec<u8>)>) -> Self {
        Self {
            name,
            joints: map.joints().iter().map(|joint| puppet.name_of(joint).to_owned()).collect(),
            buses: puppet.bus_names(),
            map,
            playlist: (0..clips.len() as u16).collect(),
            clips,
            repeats: false,
            idle_clip: None,
            trigger_clip: None,
            after: After::default(),
            orders: Vec::new(),
            disturbances: Vec::new(),
            events: Vec::new(),
        }
    }

    /// What the puppet plays by itself.
    pub fn show(&self) -> Show<'_> {
        Show {
            playlist: &self.playlist,
            repeats: self.repeats,
            idle_clip: self.idle_clip,
            trigger_clip: self.trigger_clip,
            after: self.after,
        }
    }

    /// The clips, checked.
    ///
    /// # Errors
    /// A sentence that names the file and the byte.
    pub fn parsed(&self) -> Result<Vec<Clip<'_>>> {
        self.clips.iter().map(|(_, path, bytes)| Clip::parse(path, bytes)).collect()
    }
}

fn clips(
    file: &File,
    beside: impl Fn(&Path) -> PathBuf,
    channels: &Channels,
) -> Result<Vec<(String, PathBuf, Vec<u8>)>> {
    ensure!(
        file.clip.len() <= MOST_CLIPS,
        "a show has at most {MOST_CLIPS} clips, found {}",
        file.clip.len()
    );
    let mut clips: Vec<(String, PathBuf, Vec<u8>)> = Vec::new();
    for entry in &file.clip {
        let (name, path) = (entry.name.get_ref().clone(), beside(&entry.file));
        if clips.iter().any(|(there, ..)| *there == name) {
            bail!("two clips have the name \"{name}\"");
        }
        let bytes = files::read(&path)?;
        let clip = Clip::parse(&path, &bytes)?;
        channels::check_clip(&path, &clip, channels)?;
        ensure!(clip.rate_centihertz() > 0, "{} does not say its frame rate", path.display());
        clips.push((name, path, bytes));
    }
    Ok(clips)
}

/// Whether a stream's memory takes a clip.
fn streams(path: &Path, bytes: &[u8]) -> Result<()> {
    let refused = || format!("{} cannot be streamed", path.display());
    let header = Prefix::read(bytes).with_context(refused)?.header_bytes;
    let mut memory = Box::new(StreamMemory::new());
    let live = Live::new(memory.lend().0, STREAM);
    live.begin(u32::try_from(header)?).with_context(refused)?;
    live.header(0, bytes.get(..header).unwrap_or_default()).with_context(refused)?;
    Ok(())
}

fn command(
    order: Order,
    tick_hz: u16,
    clips: &[(String, PathBuf, Vec<u8>)],
    number: impl Fn(&str) -> Option<usize>,
) -> Result<script::Order> {
    let clip = |name: String| {
        number(&name).map(|number| number as u16).with_context(|| format!("there is no [[clip]] \"{name}\""))
    };
    Ok(script::Order::Command(match order {
        Order::Trigger => Command::Trigger,
        Order::Acknowledge => Command::Acknowledge,
        Order::Pause => Command::Pause,
        Order::Resume => Command::Resume,
        Order::Stop => Command::Stop,
        Order::Home => Command::Home,
        Order::LinkLost => Command::LinkLost,
        Order::Speed { factor } if (0.25..=4.0).contains(&factor) => {
            Command::Speed(Speed::new((factor * 256.0).round() as u16))
        }
        Order::Speed { factor } => bail!("the speed is {factor}, expected 0.25 to 4"),
        Order::Seek { frame } => Command::Seek { frame },
        Order::Play { clip: name, repeats } => Command::Play { clip: clip(name)?, repeats },
        Order::Queue { clip: name, repeats } => Command::Queue { clip: clip(name)?, repeats },
        Order::Stream { clip: name } => {
            let clip = clip(name)?;
            if let Some((_, path, bytes)) = clips.get(usize::from(clip)) {
                streams(path, bytes)?;
            }
            return Ok(script::Order::Stream { clip });
        }
        Order::Gap { seconds } if (0.0..=60.0).contains(&seconds) => {
            return Ok(script::Order::Gap { ticks: (seconds * f64::from(tick_hz)).round() as u32 });
        }
        Order::Gap { seconds } => bail!("the gap is {seconds} s, expected 0 to 60"),
    }))
}

/// An event in a few words: `restart, servo 7`.
fn told(event: &Table) -> String {
    let what = event.get("what").and_then(toml::Value::as_str).unwrap_or_default().to_owned();
    let rest = event.iter().filter(|(key, _)| *key != "what");
    let rest = rest.map(|(key, value)| match value.as_str() {
        Some(text) => text.to_owned(),
        None => format!("{key} {value}"),
    });
    std::iter::once(what).chain(rest).collect::<Vec<_>>().join(", ")
}
