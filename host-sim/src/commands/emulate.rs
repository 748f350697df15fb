//! `bunraku emulate`: a Raspberry Pi Pico with a host on its line.

use super::play;
use anyhow::{Context, Result, bail};
use host_sim::board;
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::rp2040js;
use std::cell::Cell;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};
use virtual_servos::config::ServoConfig;
use virtual_servos::dynamixel_bus::{DynamixelConfig, DynamixelServos};
use virtual_servos::virtual_bus::VirtualBus;

/// Run the firmware of a Raspberry Pi Pico in the emulator rp2040js, in real time, with virtual servos.
///
/// Where this machine is too slow or was held up, simulated time falls behind and does not catch up; a pace below 95 % is printed.
/// Its host's line is a TCP port, for `bunraku push`, `stream` and `monitor`; its log goes to standard error. Runs until it is stopped with
/// Ctrl-C. Clips that are pushed are forgotten at the end.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku emulate walk.qmd --puppet puppets/cmu-12.toml --skeleton 02.asf --listen 127.0.0.1:4100\n  bunraku push tcp:127.0.0.1:4100 list"
)]
pub struct Args {
    /// The clip that is linked into the image: .qmd or .mclip.
    clip: PathBuf,
    /// The puppet: which servo follows which channel.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: PathBuf,
    /// The skeleton whose channels the clip has (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf")]
    skeleton: Option<PathBuf>,
    /// Where the host connects; port 0 takes a free one, which is printed.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:0")]
    listen: String,
    /// Hang the core for ever after so many simulated ms, so that its watchdog starts it again.
    #[arg(long, value_name = "MS")]
    hang: Option<u64>,
    /// End after so many seconds.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<u64>,
}

/// A year.
const FOR_EVER: u64 = 365 * 24 * 3600;

pub fn run(args: Args) -> Result<ExitCode> {
    let bytes = files::read(&args.clip)?;
    let clip = Clip::parse(&args.clip, &bytes)?;
    let map = play::map(&args.clip, &clip, &args.puppet, args.skeleton)?;
    let joints = map.joints().iter();
    let servos = joints.map(|joint| ServoConfig { position: joint.home, ..ServoConfig::new(joint.id) });
    let mut servos = DynamixelServos::new(&DynamixelConfig {
        servos: servos.collect(),
        ..DynamixelConfig::with_ids(&[])
    })?;
    let elf = board::RP2040.build(&bytes, &map, 0)?;
    let listener =
        TcpListener::bind(&args.listen).with_context(|| format!("cannot listen on {}", args.listen))?;
    listener.set_nonblocking(true).context("cannot listen without waiting")?;
    println!("tcp:{}", listener.local_addr().context("cannot listen")?);
    std::io::stdout().flush().context("cannot write to standard output")?;

    let began = Instant::now();
    let mut pace = Pace::default();
    // Simulated time, which servos live in.
    let millis = Cell::new(0);
    let mut line = Line { listener, host: None };
    let end = args.seconds.map(Duration::from_secs);
    let mut host = |bytes: &[u8]| {
        millis.update(|millis| millis + 1);
        let now = Duration::from_millis(millis.get());
        thread::sleep(pace.early(now, began.elapsed()));
        if let Some(percent) = pace.slow(now, began.elapsed()) {
            eprintln!("the emulator ran at {percent} % of real time in the last ten seconds");
        }
        let ended = end.is_some_and(|end| now > end);
        (!ended).then(|| line.exchange(bytes))
    };
    let mut bus = |bytes: &[u8]| servos.receive(bytes, millis.get() * 1000, &mut |_| {});
    let hang = args.hang.map(Duration::from_millis);
    let limit = Duration::from_secs(FOR_EVER);
    let log = &mut |said: &str| eprintln!("{said}");
    let world = rp2040js::World { servos: &mut bus, pins: &mut |_| {}, host: Some(&mut host), hang };
    rp2040js::run(&elf, &rp2040js::package(), world, limit, log)?;
    if end.is_none() {
        bail!("the emulator has ended");
    }
    Ok(ExitCode::SUCCESS)
}

/// How far an emulator may be behind and catch up, in which time no host loses its patience.
const BEHIND: Duration = Duration::from_millis(20);

/// How often its pace is looked at.
const LOOK: Duration = Duration::from_secs(10);

/// Keeps simulated time from going faster than real time.
///
/// An emulator that was held up does not catch up: for the image, a host that answers at once would be silent for seconds.
#[derive(Default)]
struct Pace {
    /// By how much simulated time is late for good.
    late: Duration,
    /// Simulated and real time of the last look.
    looked: (Duration, Duration),
}

impl Pace {
    /// How long to wait, where so much time has gone by in the simulation and outside.
    fn early(&mut self, simulated: Duration, real: Duration) -> Duration {
        self.late = self.late.max(real.saturating_sub(simulated + BEHIND));
        (simulated + self.late).saturating_sub(real)
    }

    /// Once in [`LOOK`], the pace since then in percent of real time, if that is below 95.
    fn slow(&mut self, simulated: Duration, real: Duration) -> Option<u128> {
        let passed = real.saturating_sub(self.looked.1);
        if passed < LOOK {
            return None;
        }
        let percent = simulated.saturating_sub(self.looked.0).as_micros() * 100 / passed.as_micros();
        self.looked = (simulated, real);
        (percent < 95).then_some(percent)
    }
}

/// The host's end of the line.
struct Line {
    listener: TcpListener,
    host: Option<TcpStream>,
}

impl Line {
    /// Gives a host what it was sent, and takes what it sends. Whoever connects takes the line over.
    fn exchange(&mut self, bytes: &[u8]) -> Vec<u8> {
        if let Ok((stream, _)) = self.listener.accept() {
            // A line that delays is slow, but works.
            let _ = stream.set_nodelay(true);
            self.host = stream.set_nonblocking(true).is_ok().then_some(stream);
        }
        let Some(host) = &mut self.host else { return Vec::new() };
        let mut buffer = [0; 4096];
        let read = match host.write_all(bytes) {
            // What a host does not read is lost, as on a serial line.
            Ok(()) => host.read(&mut buffer),
            Err(error) => Err(error),
        };
        match read {
            Ok(count) if count > 0 => buffer[..count].to_vec(),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Vec::new(),
            _ => {
                self.host = None;
                Vec::new()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    #[test]
    fn simulated_time_is_never_faster_than_real_time_for_longer_than_a_moment() {
        let mut pace = Pace::default();
        // Ahead of time, in time, and a little behind, which is caught up with.
        assert_eq!(pace.early(ms(100), ms(40)), ms(60));
        assert_eq!(pace.early(ms(101), ms(101)), ms(0));
        assert_eq!(pace.early(ms(102), ms(112)), ms(0));
        assert_eq!(pace.early(ms(113), ms(112)), ms(1));
        // Held up for 5 s: a simulated second takes a second from then on.
        assert_eq!(pace.early(ms(114), ms(5112)), ms(0));
        let real = (115..1115).fold(ms(5112), |real, now| real + pace.early(ms(now), real));
        assert_eq!(real, ms(5112 + 1000) - BEHIND);
    }

    #[test]
    fn a_slow_emulator_is_told_of() {
        let mut pace = Pace::default();
        assert_eq!(pace.slow(ms(2_000), ms(9_999)), None);
        assert_eq!(pace.slow(ms(2_000), ms(10_000)), Some(20));
        assert_eq!(pace.slow(ms(12_000), ms(20_000)), None);
    }
}
