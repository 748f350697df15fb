//! `bunraku profile`: what a clip costs on a microcontroller.

use super::number::{above_zero, recorded_rate};
use anyhow::{Context, Result, anyhow, bail};
use encoder::qmd::{Method, Parameters};
use host_sim::clip::Clip;
use host_sim::files;
use host_sim::profile;
use host_sim::profile::baseline::Baseline;
use host_sim::profile::parts::{PARTS, Part};
use host_sim::profile::report::{Budget, Container, Simulation, Subject, Table, Ticks};
use host_sim::profile::{CoreReport, LoadedImage, Report, html, measure};
use host_sim::puppet::channels;
use indicatif::{ProgressBar, ProgressStyle};
use puppet_file::{Channels, Map, Puppet, to_bytes};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use thumb_cycles::Core;

/// Count what decoding a clip costs on a microcontroller: cycles, stack, flash, RAM, energy.
///
/// Builds the decoder with the clip for each core and runs it on a simulated one (docs/CYCLES.md says how far its
/// cycles can be trusted). Without a clip it takes the embedded sample. With a puppet, what is counted is a whole tick of
/// its servos: decode, interpolate, limit, and write the packet; shares and energy are then those of ticks.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bunraku profile walk.qmd --core all --clock 64MHz --html walk.html\n  bunraku profile walk.qmd --part nrf52840 --budget 5%\n  bunraku profile walk.mclip --puppet puppets/cmu-20.toml --skeleton 02.asf --core cortex-m4 --budget 6000\n  bunraku profile --core cortex-m4 --json > baseline.json\n  bunraku profile --core cortex-m4 --baseline baseline.json\n\nThe exit code is 1 where the worst frame is over the budget or a frame has become slower than the baseline's."
)]
pub struct Args {
    /// The clip: .qmd or .mclip.
    clip: Option<PathBuf>,
    /// Count ticks of this puppet instead of frames.
    #[arg(long, value_name = "PUPPET.toml")]
    puppet: Option<PathBuf>,
    /// The skeleton whose channels the clip has (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf", requires = "puppet")]
    skeleton: Option<PathBuf>,
    /// Cores, separated by commas, or all. Unless given: a part's core, or cortex-m0plus and cortex-m4.
    #[arg(long, value_name = "CORES", value_delimiter = ',', value_parser = core)]
    core: Vec<Cores>,
    /// The clock, for shares of a frame's time. Unless given: a part's, or 64MHz.
    #[arg(long, value_name = "FREQUENCY", value_parser = frequency)]
    clock: Option<f64>,
    /// Frames per second, instead of the clip's own rate.
    #[arg(long, value_name = "F", value_parser = recorded_rate, conflicts_with = "puppet")]
    rate: Option<f64>,
    /// Wait states of the flash.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=15))]
    wait_states: u32,
    /// A microcontroller, for energy at the clock of its datasheet's figures.
    #[arg(long, value_name = "PART", value_parser = part)]
    part: Option<&'static Part>,
    /// The battery, with --part.
    #[arg(long, value_name = "MAH", default_value_t = 1000.0, value_parser = above_zero, requires = "part")]
    battery: f64,
    /// Whether the decoder of a .qmd is lent RAM for a converted table; lent unless given.
    #[arg(long, value_enum)]
    table: Option<Table>,
    /// Most that the worst frame may take: cycles, or a part of a frame's time (5%).
    #[arg(long, value_name = "CYCLES|PERCENT%")]
    budget: Option<Budget>,
    /// An earlier report (--json): fail where a frame has become more than 3 % slower.
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Write the report as a page with plots.
    #[arg(long, value_name = "OUT.html")]
    html: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

/// What `--core` names.
#[derive(Clone, Copy)]
enum Cores {
    All,
    One(Core),
}

/// `all`: every core that firmware is written for, the multiplier fast.
const ALL: [Core; 6] = [Core::M0, Core::M0Plus, Core::M3, Core::M4, Core::M33, Core::M7];

fn core(name: &str) -> Result<Cores, String> {
    if name == "all" {
        return Ok(Cores::All);
    }
    Core::from_name(name).map(Cores::One).ok_or_else(|| {
        let names: Vec<&str> = Core::ALL.iter().map(|core| core.name()).collect();
        format!("expected all or {}", names.join(", "))
    })
}

fn part(name: &str) -> Result<&'static Part, String> {
    Part::named(name).ok_or_else(|| {
        let names: Vec<&str> = PARTS.iter().map(|part| part.name).collect();
        format!("expected {}", names.join(", "))
    })
}

fn frequency(text: &str) -> Result<f64, String> {
    let lower = text.to_ascii_lowercase();
    let number = lower.strip_suffix("hz").unwrap_or(&lower);
    let (number, unit) = match number.strip_suffix(['k', 'm', 'g']) {
        Some(rest) if number.ends_with('k') => (rest, 1e3),
        Some(rest) if number.ends_with('m') => (rest, 1e6),
        Some(rest) => (rest, 1e9),
        None => (number, 1.0),
    };
    above_zero(number)
        .map(|number| number * unit)
        .map_err(|_| format!("found {text:?}, expected a frequency above 0, such as 64MHz"))
}

pub fn run(args: Args) -> Result<ExitCode> {
    let baseline = args.baseline.as_deref().map(Baseline::read).transpose()?;
    let (name, bytes) = match &args.clip {
        Some(path) => (path.display().to_string(), files::read(path)?),
        None => ("embedded sample".to_owned(), sample()?),
    };
    let clip = Clip::parse(Path::new(&name), &bytes)?;
    if let (Clip::Mclip(_), Some(_)) = (&clip, args.table) {
        bail!("{name} is a .mclip, whose decoder is always lent its memory: --table is for a .qmd");
    }
    let map = map(&args, &clip)?;
    let own_rate = f64::from(clip.rate_centihertz()) / 100.0;
    let Some(clip_hz) = args.rate.or((own_rate > 0.0).then_some(own_rate)) else {
        bail!("{name} does not say its frame rate: give one with --rate");
    };
    let rate_hz = map.as_ref().map_or(clip_hz, |map| f64::from(map.tick_hz()));
    if let (Some(part), Some(clock)) = (args.part, args.clock)
        && part.clock_hz != clock
    {
        bail!(
            "the currents of {} are for {} MHz, but --clock is {} MHz",
            part.name,
            part.clock_hz / 1e6,
            clock / 1e6
        );
    }
    let cores = cores(&args);
    if let Some(part) = args.part.filter(|part| !cores.contains(&part.core)) {
        bail!("{} has a {}, which is not among the cores to profile", part.name, part.core.name());
    }
    let expected = match &map {
        Some(map) => profile::ticks(&clip, map).with_context(|| format!("cannot play {name}"))?,
        None => profile::frames(&clip)?,
    };
    let table = args.table.unwrap_or(Table::Lent);
    let subject = Subject {
        clip_bytes: bytes.len(),
        frames: clip.frames(),
        channels: clip.channels(),
        container: container(&clip, table),
        wait_states: args.wait_states,
        puppet: map.as_ref().map(|map| Ticks {
            ticks: expected.frames.len(),
            servos: map.joints().len(),
            servo_hz: map.tick_hz(),
        }),
    };
    let images = build(&bytes, map.as_ref(), &cores, table)?;

    let bar = ProgressBar::new((expected.frames.len() * cores.len()) as u64);
    let template = format!("{{wide_bar}} {{pos}} of {{len}} {}s, {{msg}}", subject.unit());
    bar.set_style(ProgressStyle::with_template(&template)?);
    let mut reports = Vec::new();
    let (mut instructions, mut simulated) = (0, Duration::ZERO);
    for (&core, image) in cores.iter().zip(&images) {
        bar.set_message(core.name());
        let measured = measure::frames(core, image, args.wait_states, &expected, &mut || bar.inc(1))
            .with_context(|| format!("{name} on {}", core.name()))?;
        instructions += measured.instructions;
        simulated += measured.simulated;
        let clock_hz = args.part.map_or(args.clock.unwrap_or(64e6), |part| part.clock_hz);
        let mut report = CoreReport::new(core, image, measured, subject.samples(), clock_hz, rate_hz)?;
        let part = args.part.filter(|part| part.core == core);
        report.energy = part.map(|part| part.energy(report.cycles_mean, rate_hz, args.battery));
        reports.push(report);
    }
    bar.finish_and_clear();
    let seconds = simulated.as_secs_f64();
    let report = Report {
        clip: name,
        subject,
        rate_hz,
        cores: reports,
        simulation: Simulation {
            instructions,
            seconds,
            instructions_per_second: instructions as f64 / seconds,
        },
    };
    if let Some(path) = &args.html {
        let page = html::report_page(&report);
        files::write(path, |file| Ok(file.write_all(page.as_bytes())?))?;
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print(&report);
    }
    check(&report, args.budget, baseline.as_ref())
}

/// The embedded clip as it is encoded elsewhere: FDF 6, b 8.
fn sample() -> Result<Vec<u8>> {
    Ok(encoder::qmd::encode(&mocap::sample::clip(), Parameters::TABLE_1, Method::ClosedLoop)?)
}

fn cores(args: &Args) -> Vec<Core> {
    let mut cores: Vec<Core> = Vec::new();
    for named in &args.core {
        match named {
            Cores::All => cores.extend(ALL),
            Cores::One(core) => cores.push(*core),
        }
    }
    if cores.is_empty() {
        cores = args.part.map_or_else(|| vec![Core::M0Plus, Core::M4], |part| vec![part.core]);
    }
    let mut seen = Vec::new();
    cores.retain(|core| {
        let new = !seen.contains(core);
        seen.push(*core);
        new
    });
    cores
}

/// The joint map of the puppet that was named.
fn map(args: &Args, clip: &Clip<'_>) -> Result<Option<Map>> {
    let Some(path) = &args.puppet else { return Ok(None) };
    let puppet = Puppet::read(path)?;
    let channels = match &args.clip {
        Some(path) => channels::of_played(path, clip, &puppet, args.skeleton.clone())?,
        // The embedded sample brings its skeleton.
        None => Channels::from(&mocap::sample::clip().skeleton),
    };
    Ok(Some(puppet.map(channels)?))
}

fn container(clip: &Clip<'_>, table: Table) -> Container {
    match clip {
        Clip::Qmd(clip) => {
            let layout = clip.layout();
            Container::Qmd {
                fixed_channels: layout.fixed_channels,
                index_bits: layout.index_bits,
                segments: clip.segments(),
                table,
            }
        }
        Clip::Mclip(clip) => {
            let header = clip.header();
            Container::Mclip {
                codec: header.codec().id().name().to_owned(),
                entropy: header.entropy().name().to_owned(),
                blocks: clip.block_count(),
                lent_bytes: header.needs().bytes(),
            }
        }
    }
}

/// An image for every core.
fn build(clip: &[u8], map: Option<&Map>, cores: &[Core], table: Table) -> Result<Vec<LoadedImage>> {
    let mut targets: Vec<&str> = cores.iter().map(|core| core.target()).collect();
    targets.sort_unstable();
    targets.dedup();
    let spinner = ProgressBar::new_spinner();
    spinner.set_message(format!("building the decoder for {}", targets.join(", ")));
    spinner.enable_steady_tick(Duration::from_millis(100));
    let lent = table == Table::Lent;
    let images = match map {
        Some(map) => profile::tick_images(clip, &to_bytes(map), &targets, lent)?,
        None => profile::images(clip, &targets, lent)?,
    };
    spinner.finish_and_clear();
    let of = |core: &Core| {
        let built = targets.iter().zip(&images).find(|(target, _)| **target == core.target());
        built.map(|(_, image)| image.clone()).ok_or_else(|| anyhow!("no image was built for {}", core.name()))
    };
    cores.iter().map(of).collect()
}

fn print(report: &Report) {
    let subject = &report.subject;
    let unit = subject.unit();
    let container = match &subject.container {
        Container::Qmd { table: Table::Lent, .. } => "table lent".to_owned(),
        Container::Qmd { table: Table::None, .. } => "table not lent".to_owned(),
        Container::Mclip { codec, entropy, lent_bytes, .. } => {
            format!("{codec}, {entropy}, {lent_bytes} bytes of RAM lent")
        }
    };
    println!(
        "{}: {} frames of {} channels, {} bytes, {container}, {} wait states",
        report.clip, subject.frames, subject.channels, subject.clip_bytes, subject.wait_states
    );
    if let Some(puppet) = &subject.puppet {
        println!("  {} ticks at {} Hz on {} servos", puppet.ticks, puppet.servo_hz, puppet.servos);
    }
    let per = if subject.puppet.is_some() { "/sv" } else { "/ch" };
    println!(
        "                        cycles a {unit:<5}                 |      | bytes                       | of a {unit} at {} Hz",
        report.rate_hz
    );
    println!(
        "core              min    mean     p99   worst at {unit:<5} |  {per} | stack  code   flash     RAM | mean     worst"
    );
    for core in &report.cores {
        let name = if core.tolerance.is_none_or(|tolerance| tolerance > 0.1) {
            format!("{}*", core.core)
        } else {
            core.core.to_owned()
        };
        println!(
            "{name:<14} {:>6} {:>7.1} {:>7} {:>7} {:>8} | {:>5.1} | {:>4} {:>5} {:>7} {:>7} | {:.3} % {:.3} % at {} MHz",
            core.cycles_min,
            core.cycles_mean,
            core.cycles_p99,
            core.cycles_max,
            core.worst_frame,
            core.cycles_per_sample,
            core.stack_bytes,
            core.code_bytes,
            core.flash_bytes,
            core.ram_bytes,
            core.frame_share_mean * 100.0,
            core.frame_share_max * 100.0,
            core.clock_hz / 1e6
        );
    }
    if report.cores.iter().any(|core| core.tolerance.is_none_or(|tolerance| tolerance > 0.1)) {
        println!("* an estimate: see docs/CYCLES.md");
    }
    for core in report.cores.iter().filter_map(|core| Core::from_name(core.core)) {
        println!("{}", core.evidence());
    }
    for core in &report.cores {
        println!("\n{}: where a {unit}'s cycles go", core.core);
        for function in core.functions.iter().filter(|function| function.share >= 0.005) {
            println!(
                "  {:>5.1} % {:>9.1}  {} ({} bytes)",
                function.share * 100.0,
                function.self_cycles,
                function.name,
                function.bytes
            );
        }
        if let Some(energy) = &core.energy {
            println!(
                "{} at {} MHz and {} V, {} mA running, {} mA asleep:\n  {:.3} µJ a {unit}, {:.1} µA on average, {:.0} hours from {} mAh, {} only",
                energy.part,
                energy.clock_hz / 1e6,
                energy.volts,
                energy.run_ma,
                energy.sleep_ma,
                energy.microjoules_per_frame,
                energy.mean_microamps,
                energy.battery_hours,
                energy.battery_mah,
                if subject.puppet.is_some() { "player" } else { "decoder" }
            );
            println!("  {}", energy.source);
        }
    }
    let simulation = &report.simulation;
    println!(
        "\n{:.1} million instructions simulated in {:.2} s, {:.1} million a second",
        simulation.instructions as f64 / 1e6,
        simulation.seconds,
        simulation.instructions_per_second / 1e6
    );
}

/// Holds the report against the budget and the baseline.
fn check(report: &Report, budget: Option<Budget>, baseline: Option<&Baseline>) -> Result<ExitCode> {
    let mut complaints = Vec::new();
    if let Some(budget) = budget {
        complaints
            .extend(report.cores.iter().filter_map(|core| budget.exceeded(core, report.subject.unit())));
    }
    if let Some(baseline) = baseline {
        complaints.extend(baseline.risen(report)?);
    }
    complaints.iter().for_each(|complaint| eprintln!("bunraku: {complaint}"));
    Ok(if complaints.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
