//! Builds the image of the board `qemu-show`, which plays a show.

use super::file::Program;
use crate::image::Image;
use anyhow::Result;
use firmware::machine::{After, Command};
use firmware::script::Order;
use puppet_file::to_bytes;
use std::fmt::Write as _;

/// The board: QEMU's mps2-an386, as that of `qemu-mps2`.
const PACKAGE: &str = "qemu-show";
const TARGET: &str = "thumbv7em-none-eabi";

/// Builds the image that plays a show, and gives its bytes. Servos may be late by `slack_us`.
///
/// # Errors
/// A sentence that says what is missing: the source, cargo, the target, or what cargo could not build.
pub fn build(program: &Program, slack_us: u32) -> Result<Vec<u8>> {
    let names: Vec<String> = (0..program.clips.len()).map(|index| format!("clip{index}")).collect();
    let map = to_bytes(&program.map);
    let source = show_source(program);
    let mut files = vec![
        ("BUNRAKU_MAP".to_owned(), "map.postcard", map.as_slice()),
        ("BUNRAKU_SHOW".to_owned(), "show.rs", source.as_bytes()),
    ];
    for (index, (name, (_, _, bytes))) in names.iter().zip(&program.clips).enumerate() {
        files.push((format!("BUNRAKU_CLIP{index}"), name, bytes));
    }
    let files: Vec<(&str, &str, &[u8])> =
        files.iter().map(|(variable, name, bytes)| (variable.as_str(), *name, *bytes)).collect();
    let image = Image {
        package: PACKAGE,
        source: "firmware/boards/qemu-show",
        binary: PACKAGE,
        features: "",
        targets: &[TARGET],
        folder: "show",
        files: &files,
        variables: &[
            ("BUNRAKU_CLIPS", &program.clips.len().to_string()),
            ("BUNRAKU_SLACK_US", &slack_us.to_string()),
            ("DEFMT_LOG", "info"),
        ],
    };
    Ok(image.build()?.concat())
}

/// The show as constants: what it plays by itself, and its orders.
fn show_source(program: &Program) -> String {
    let Program { playlist, repeats, idle_clip, trigger_clip, after, orders, .. } = program;
    let after = match after {
        After::Home => "After::Home",
        After::Hold => "After::Hold",
    };
    let mut source = format!(
        "/// What plays by itself.\nconst SHOW: Show<'static> = Show {{ playlist: &{playlist:?}, repeats: {repeats}, \
         idle_clip: {idle_clip:?}, trigger_clip: {trigger_clip:?}, after: {after} }};\n\
         /// What happens at which tick.\nstatic ORDERS: [(u32, Order); {}] = [\n",
        orders.len()
    );
    for (tick, order) in orders {
        let order = match order {
            Order::Command(Command::Speed(speed)) => {
                format!("Command(Command::Speed(Speed::new({})))", speed.parts())
            }
            Order::Command(command) => format!("Command(Command::{command:?})"),
            other => format!("{other:?}"),
        };
        // Writing to a string does not fail.
        let _ = writeln!(source, "    ({tick}, Order::{order}),");
    }
    source.push_str("];\n");
    source
}
