//! `bunraku image`: firmware for a board.

use super::play;
use anyhow::{Context, Result, bail};
use encoder::qmd::{Method, Parameters};
use host_sim::board::{BOARDS, Board, Budget, Size};
use host_sim::clip::Clip;
use host_sim::files;
use puppet_file::{Map, Puppet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Build the firmware of a board with a clip and a puppet in it, and say what it takes of flash and RAM.
///
/// Without a clip it takes the embedded sample on puppets/sample.toml. What is to be wired is in the README of the board's folder,
/// firmware/boards/BOARD.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  bunraku image walk.qmd --puppet puppets/cmu-12.toml --skeleton 02.asf --board rp2040 -o walk.elf\n  probe-rs run --chip RP2040 walk.elf"
)]
pub struct Args {
    /// The clip: .qmd or .mclip.
    #[arg(requires = "puppet")]
    clip: Option<PathBuf>,
    /// The puppet: which servo follows which channel.
    #[arg(long, value_name = "PUPPET.toml", requires = "clip")]
    puppet: Option<PathBuf>,
    /// The skeleton whose channels the clip has (.asf, .bvh), instead of the one that the puppet names.
    #[arg(long, value_name = "S.asf", requires = "clip")]
    skeleton: Option<PathBuf>,
    /// Frames per second to play at, instead of the clip's own rate.
    #[arg(long, value_name = "F", requires = "clip", value_parser = super::number::played_rate)]
    fps: Option<f64>,
    /// The board, or `all`; may be repeated.
    #[arg(long, required = true, value_name = "BOARD", value_parser = board)]
    board: Vec<Boards>,
    /// Where the image goes, an ELF file.
    #[arg(long, short, value_name = "OUT.elf")]
    output: Option<PathBuf>,
    /// Fail where an image takes more flash or RAM than this says.
    #[arg(long, value_name = "BUDGET.toml")]
    budget: Option<PathBuf>,
    /// Report as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy)]
enum Boards {
    All,
    One(&'static Board),
}

fn board(name: &str) -> Result<Boards, String> {
    if name == "all" {
        return Ok(Boards::All);
    }
    Board::named(name).map(Boards::One).ok_or_else(|| {
        let names = BOARDS.map(|board| board.name).join(", ");
        format!("expected all or one of {names}")
    })
}

pub fn run(args: Args) -> Result<ExitCode> {
    let mut boards: Vec<&Board> = Vec::new();
    for named in &args.board {
        match named {
            Boards::All => boards.extend(&BOARDS),
            Boards::One(board) => boards.push(board),
        }
    }
    if args.output.is_some() && boards.len() > 1 {
        bail!("--output is for the image of one board, and {} are asked for", boards.len());
    }
    let budget = match &args.budget {
        Some(path) => Some(read_budget(path)?),
        None => None,
    };
    let (bytes, map, centihertz) = match (&args.clip, &args.puppet) {
        (Some(path), Some(puppet)) => {
            let bytes = files::read(path)?;
            let clip = Clip::parse(path, &bytes)?;
            let centihertz = play::rate(path, &clip, args.fps)?;
            let map = play::map(path, &clip, puppet, args.skeleton)?;
            (bytes, map, centihertz)
        }
        _ => sample()?,
    };
    let mut sizes = Vec::new();
    for board in boards {
        let elf = board.build(&bytes, &map, centihertz).with_context(|| board.name.to_owned())?;
        sizes.push(board.size(&elf)?);
        if let Some(path) = &args.output {
            files::write(path, |file| Ok(file.write_all(&elf)?))?;
        }
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&sizes)?);
    } else {
        print(&sizes);
    }
    let mut complaints = Vec::new();
    if let Some(budget) = &budget {
        for size in &sizes {
            complaints.extend(budget.exceeded(size)?);
        }
    }
    complaints.iter().for_each(|complaint| eprintln!("bunraku: {complaint}"));
    Ok(if complaints.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn read_budget(path: &Path) -> Result<Budget> {
    let text = String::from_utf8(files::read(path)?).with_context(|| path.display().to_string())?;
    Budget::parse(&text).with_context(|| path.display().to_string())
}

/// The embedded clip on its puppet.
fn sample() -> Result<(Vec<u8>, Map, u16)> {
    let clip = mocap::sample::clip();
    let bytes = encoder::qmd::encode(&clip, Parameters::TABLE_1, Method::ClosedLoop)?;
    let puppet = Path::new(env!("CARGO_MANIFEST_DIR")).join("../puppets/sample.toml");
    let map = Puppet::read(&puppet)?.map(&clip.skeleton)?;
    Ok((bytes, map, 0))
}

fn print(sizes: &[Size]) {
    println!("board           text    data     bss |   flash     RAM");
    for size in sizes {
        println!(
            "{:<12} {:>7} {:>7} {:>7} | {:>5.1} % {:>5.1} %",
            size.board,
            size.text,
            size.data,
            size.bss,
            100.0 * size.flash_share,
            100.0 * size.ram_share
        );
    }
}
