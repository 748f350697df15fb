//! `bunraku push`: clips onto a device, and commands to its puppet.

use anyhow::{Context, Result, bail};
use clap::Subcommand;
use firmware::clock::Speed;
use firmware::demands::Facts;
use firmware::link::key::HmacKey;
use firmware::link::message::{Request, Response, Telemetry};
use firmware::machine::{Command, State};
use host_sim::files;
use host_sim::link::upload::{Upload, list, upload_again};
use host_sim::link::{Client, Line, PATIENCE, key_file};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Upload clips to a device, and tell its puppet what to do.
///
/// PORT is a serial port (/dev/ttyACM0, COM3), a pseudo terminal, or tcp:HOST:PORT. A device that does not answer within some seconds is an error.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku push tcp:127.0.0.1:4100 upload 3 walk.mclip\n  bunraku push tcp:127.0.0.1:4100 play 3 --wait"
)]
pub struct Args {
    #[command(flatten)]
    pub port: Port,
    /// Report as JSON.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    action: Action,
}

/// The line to a device.
#[derive(clap::Args)]
pub struct Port {
    /// The device: a serial port, or tcp:HOST:PORT.
    #[arg(value_name = "PORT")]
    pub name: String,
    /// Bits per second of a serial port.
    #[arg(long, default_value_t = 115_200)]
    pub baud: u32,
    /// Seconds for which a device that does not answer is asked again; an emulated one may be slow.
    #[arg(long, value_name = "SECONDS", default_value_t = PATIENCE.as_secs(), global = true)]
    pub patience: u64,
    /// The file with the key, where the device needs one.
    #[arg(long, value_name = "FILE", global = true)]
    pub key_file: Option<PathBuf>,
}

impl Port {
    /// The key, where one is named.
    pub fn key(&self) -> Result<Option<HmacKey>> {
        self.key_file.as_deref().map(key_file::read).transpose()
    }

    /// The line, with that key.
    pub fn line<'a>(&'a self, key: Option<&'a HmacKey>) -> Line<'a> {
        Line { name: &self.name, baud: self.baud, key, patience: Duration::from_secs(self.patience) }
    }

    /// Begins a session.
    pub fn open(&self) -> Result<Client> {
        Ok(Client::open(self.line(self.key()?.as_ref()))?)
    }
}

#[derive(Subcommand)]
enum Action {
    /// Write a clip to the device's flash; an old one of that number plays until the new one is whole and checked.
    Upload {
        /// Number of the clip, 0 to 65534.
        #[arg(value_parser = clap::value_parser!(u16).range(..=65_534))]
        clip: u16,
        /// The clip (.qmd, .mclip).
        file: PathBuf,
        /// Its name on the device, instead of the file's.
        #[arg(long)]
        name: Option<String>,
        /// Seconds for which a broken line is opened again.
        #[arg(long, value_name = "SECONDS", default_value_t = 10)]
        retry: u64,
    },
    /// List the clips on the device.
    List,
    /// Remove a clip from the flash.
    Delete {
        /// Its number.
        clip: u16,
    },
    /// Play a clip now; what plays fades into it.
    Play {
        /// Its number.
        clip: u16,
        /// Repeat the clip until another command comes.
        #[arg(long = "loop")]
        repeats: bool,
        /// Wait until the puppet rests.
        #[arg(long)]
        wait: bool,
    },
    /// Play a clip after those that play.
    Queue {
        /// Its number.
        clip: u16,
        /// Repeat the clip until another command comes.
        #[arg(long = "loop")]
        repeats: bool,
    },
    /// Slow down to a stop on the path of the clip.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Play faster or slower.
    Speed {
        /// 0.25 to 4; 1 is as recorded.
        #[arg(value_parser = super::number::speed)]
        speed: f64,
    },
    /// Fade to another frame of the clip that plays.
    Seek {
        /// Its number.
        frame: u32,
    },
    /// Tell the device at which frame an outside clock is now (audio, timecode).
    ///
    /// The clip plays a little faster or slower until it is at the same frame. Where the two are more than a sixteenth of a second apart,
    /// the clip fades to the frame. FRAME is where the clock is when this program starts; the time until the device hears of it is added.
    Sync {
        /// The frame, with a part of the next one: 120.5.
        #[arg(value_parser = frame)]
        frame: f64,
    },
    /// Slow down to a stop, and hold the pose.
    Stop,
    /// Go home slowly.
    Home,
    /// Do what the trigger input of the device does.
    Trigger,
    /// Acknowledge a fault: the device finds its servos again, and goes on.
    Acknowledge,
    /// Print the name and the state of the device.
    Status,
}

/// A frame and a part of the next one.
fn frame(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(frame) if (0.0..f64::from(u32::MAX)).contains(&frame) => Ok(frame),
        _ => Err(format!("found {text:?}, expected a frame from 0 on, such as 120.5")),
    }
}

pub fn run(args: Args) -> Result<ExitCode> {
    let start = Instant::now();
    let Args { port, json, action } = args;
    let report = match action {
        Action::Upload { clip, file, name, retry } => {
            write(&port, clip, &file, name.as_deref(), Duration::from_secs(retry), json)?
        }
        Action::Play { clip, repeats, wait } => {
            let mut client = port.open()?;
            client.command(Command::Play { clip, repeats })?;
            if wait {
                until_rest(&mut client)?;
            }
            (format!("clip {clip} plays"), json!({ "clip": clip }))
        }
        Action::List => clips(&mut port.open()?)?,
        Action::Status => status(&mut port.open()?)?,
        Action::Delete { clip } => {
            port.open()?.request_done(&Request::Remove { clip })?;
            (format!("clip {clip} is removed"), json!({ "clip": clip }))
        }
        Action::Sync { frame } => {
            let now = sync(&mut port.open()?, frame, start)?;
            (format!("follows from frame {now:.2} on"), json!({ "frame": now }))
        }
        other => {
            let (command, done) = command(&other)?;
            port.open()?.command(command)?;
            (done.to_owned(), json!({ "done": done }))
        }
    };
    let (text, value) = report;
    if json {
        println!("{value:#}");
    } else {
        println!("{text}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Tells where an outside clock is that was at `frame` when this program began: time goes by until the device hears of it. Gives
/// the frame that the device was told.
fn sync(client: &mut Client, frame: f64, start: Instant) -> Result<f64> {
    let status = client.status()?;
    if status.playing.is_some() && status.state != State::Playing {
        bail!(
            "{} is in the state {:?}, and a clip follows a clock only while it plays",
            client.name(),
            status.state
        );
    }
    let rate = match status.playing {
        Some(playing) => match client.request(&Request::Facts { clip: playing.clip })? {
            Response::Facts(Some(facts)) => f64::from(facts.rate_centihertz) / 100.0,
            _ => 0.0,
        },
        None => 0.0,
    };
    // The device answers between two ticks: what is sent right after an answer waits for the next one.
    let asked = Instant::now();
    client.request_done(&Request::Alive)?;
    let there_and_back = asked.elapsed();
    let tick = Duration::from_secs_f64(1.0 / f64::from(client.hello().tick_hz.max(1)));
    let way = there_and_back - there_and_back.saturating_sub(tick) / 2;
    let passed = (start.elapsed() + way).as_secs_f64() * rate * f64::from(status.speed) / 256.0;
    let now = frame + passed;
    let whole = now.floor();
    let fraction = ((now - whole) * 65536.0).min(65535.0) as u16;
    client.command(Command::Sync { frame: whole as u32, fraction })?;
    Ok(now)
}

/// An action that is one command, and what is said when it is done.
fn command(action: &Action) -> Result<(Command, &'static str)> {
    Ok(match *action {
        Action::Queue { clip, repeats } => (Command::Queue { clip, repeats }, "queued"),
        Action::Pause => (Command::Pause, "paused"),
        Action::Resume => (Command::Resume, "goes on"),
        Action::Seek { frame } => (Command::Seek { frame }, "fades there"),
        Action::Stop => (Command::Stop, "stops"),
        Action::Home => (Command::Home, "goes home"),
        Action::Trigger => (Command::Trigger, "triggered"),
        Action::Acknowledge => (Command::Acknowledge, "acknowledged"),
        Action::Speed { speed } => {
            if !(0.25..=4.0).contains(&speed) {
                bail!("the speed is {speed}, expected 0.25 to 4");
            }
            (Command::Speed(Speed::new((speed * 256.0).round() as u16)), "speed set")
        }
        _ => bail!("this is no command"),
    })
}

fn write(
    port: &Port,
    clip: u16,
    file: &Path,
    name: Option<&str>,
    patience: Duration,
    json: bool,
) -> Result<(String, Value)> {
    let bytes = files::read(file)?;
    // What the device would refuse after all bytes were sent is told before.
    host_sim::clip::Clip::parse(file, &bytes)?;
    let stem = file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let name = name.unwrap_or(&stem);
    if name.is_empty() || name.len() > firmware::store::NAME_BYTES {
        bail!("a clip's name has 1 to 32 bytes, and {name:?} has {}: give one with --name", name.len());
    }
    let bar = if json { ProgressBar::hidden() } else { ProgressBar::new(bytes.len() as u64) };
    bar.set_style(ProgressStyle::with_template("{bar:30} {bytes}/{total_bytes}")?);
    let start = Instant::now();
    let upload = Upload { clip, name, bytes: &bytes };
    let key = port.key()?;
    upload_again(port.line(key.as_ref()), upload, patience, &mut |bytes| bar.set_position(bytes as u64))
        .with_context(|| format!("cannot upload {}", file.display()))?;
    bar.finish_and_clear();
    let seconds = start.elapsed().as_secs_f64();
    let unnamed = match Facts::of(&bytes) {
        Ok(Facts { names: None, .. }) => {
            "; the clip does not name its channels, so that the device has compared only their number"
        }
        _ => "",
    };
    let text = format!("clip {clip} \"{name}\": {} bytes in {seconds:.1} s, checked{unnamed}", bytes.len());
    Ok((text, json!({ "clip": clip, "name": name, "bytes": bytes.len(), "seconds": seconds })))
}

fn clips(client: &mut Client) -> Result<(String, Value)> {
    let clips = list(client)?;
    let room = client.hello().clip_bytes;
    let mut lines: Vec<String> = Vec::new();
    for clip in &clips {
        let place = if clip.built_in { ", built in" } else { "" };
        lines.push(format!(
            "{:5} \"{}\": {} bytes, CRC-32 {:08x}{place}",
            clip.clip, clip.name, clip.bytes, clip.crc
        ));
    }
    lines.push(format!("{} clips, room for one of {room} bytes", clips.len()));
    Ok((lines.join("\n"), json!({ "clips": clips, "room": room })))
}

fn status(client: &mut Client) -> Result<(String, Value)> {
    let status = client.status()?;
    let hello = client.hello();
    let text = format!(
        "{} (firmware {}, link {}): {} servos at {} Hz\n{}",
        hello.name,
        hello.firmware,
        hello.version,
        hello.servos,
        hello.tick_hz,
        super::monitor::line(&status, hello.clock_hz)
    );
    Ok((text, json!({ "device": hello, "status": super::monitor::value(&status, hello.clock_hz) })))
}

/// Waits until nothing moves any more.
fn until_rest(client: &mut Client) -> Result<()> {
    client.request_done(&Request::Telemetry { millis: 200 })?;
    let mut moved = false;
    loop {
        let Some(Telemetry { state, fault, .. }) = client.telemetry(Duration::from_secs(3))? else {
            bail!("{} says nothing any more", client.name());
        };
        if let Some(fault) = fault {
            bail!("{} has a fault: {fault}", client.name());
        }
        let rests = matches!(state, State::Resting | State::Holding | State::Limp);
        if moved && rests {
            return Ok(());
        }
        moved |= !rests;
    }
}
