//! Puts a show into the image: `bunraku show` makes the files and names them.
//!
//! - `BUNRAKU_CLIPS`: how many clips, at least one; `BUNRAKU_CLIP0` and so on: their paths (.qmd or .mclip)
//! - `BUNRAKU_MAP`: path of a joint map, the bytes of docs/MAP.md
//! - `BUNRAKU_SHOW`: path of Rust source with the constants `SHOW` and `ORDERS`
//! - `BUNRAKU_SLACK_US`: how late servos may answer, in microseconds
//!
//! Without them the image plays nothing: it is built all the same, so that it is seen to build.

#[path = "../board_x.rs"]
mod board_x;
#[path = "../clip_sizes.rs"]
mod clip_sizes;

use clip_sizes::{Sizes, constants};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};

const NOTHING: &str = "/// What plays by itself.\nconst SHOW: Show<'static> = Show { playlist: &[], repeats: false, idle_clip: None, \
    trigger_clip: None, after: After::Home };\n/// What happens at which tick.\nstatic ORDERS: [(u32, Order); 0] = [];\n";

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let clips: usize =
        variable("BUNRAKU_CLIPS").map_or(0, |text| text.parse().expect("BUNRAKU_CLIPS is a number"));
    let clips: Vec<(PathBuf, Vec<u8>)> =
        (0..clips).map(|index| file(&format!("BUNRAKU_CLIP{index}"))).collect();
    let show = variable("BUNRAKU_SHOW").map_or(NOTHING.into(), |_| file("BUNRAKU_SHOW").1);
    let map = variable("BUNRAKU_MAP").map_or(Vec::new(), |_| file("BUNRAKU_MAP").1);
    for (name, bytes) in [("show.rs", show), ("map.postcard", map), ("clips.rs", source(&clips).into_bytes())]
    {
        fs::write(out.join(name), bytes).unwrap_or_else(|error| panic!("cannot write {name}: {error}"));
    }
    let slack = variable("BUNRAKU_SLACK_US").unwrap_or_else(|| "300".to_owned());
    println!("cargo:rustc-env=BUNRAKU_SLACK_US={slack}");

    // The map of the memory is that board's.
    board_x::lay_out(concat!(env!("CARGO_MANIFEST_DIR"), "/../qemu-mps2"));
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}

/// The clips, and how much memory a decoder of the greediest needs.
fn source(clips: &[(PathBuf, Vec<u8>)]) -> String {
    let mut most = Sizes { channels: 1, ..Sizes::default() };
    let mut list = String::new();
    for (path, clip) in clips {
        let Sizes { channels, words, halves, table } = Sizes::of(&path.display().to_string(), clip);
        most = Sizes {
            channels: most.channels.max(channels),
            words: most.words.max(words),
            halves: most.halves.max(halves),
            table: most.table.max(table),
        };
        writeln!(list, "    include_bytes!({path:?}),").expect("a string takes everything");
    }
    let sizes = [
        ("CHANNELS", most.channels),
        ("WORDS", most.words),
        ("HALVES", most.halves),
        ("TABLE", most.table),
        ("CLIPS", clips.len()),
    ];
    let room =
        format!("/// Clips that there is room for.\npub const COUNT: usize = {};\n", clips.len().max(1));
    let sizes = constants(&sizes);
    format!("{sizes}{room}/// The clips.\npub static FILES: [&[u8]; CLIPS] = [\n{list}];\n")
}

fn variable(name: &str) -> Option<String> {
    println!("cargo:rerun-if-env-changed={name}");
    env::var(name).ok()
}

/// The path in a variable, and the file there.
fn file(name: &str) -> (PathBuf, Vec<u8>) {
    let path = PathBuf::from(variable(name).unwrap_or_else(|| panic!("{name} is not set")));
    println!("cargo:rerun-if-changed={}", path.display());
    let bytes = fs::read(&path).unwrap_or_else(|error| panic!("cannot read {}: {error}", path.display()));
    (fs::canonicalize(&path).unwrap_or_else(|_| Path::new(&path).to_owned()), bytes)
}
