//! Boards build without the command: nothing that a board's image or its build script needs leads to host-sim.
//!
//! The test reads Cargo.lock, and does not ask `cargo tree`: Cargo.lock has the dependencies of all features and of tests
//! as well, needs no network, and names whatever cargo builds.
#![allow(clippy::unwrap_used)]

use bunraku_tests::workspace;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use toml::{Table, Value};

/// For each package the packages that it depends on, by name alone: versions of one package are taken together.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let lock: Table = fs::read_to_string(workspace().join("Cargo.lock")).unwrap().parse().unwrap();
    let mut all: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for package in lock["package"].as_array().unwrap() {
        let needs = package.get("dependencies").and_then(Value::as_array).into_iter().flatten();
        // "name", or "name version" where there are several.
        let needs = needs.map(|need| need.as_str().unwrap().split(' ').next().unwrap().to_owned());
        all.entry(package["name"].as_str().unwrap().to_owned()).or_default().extend(needs);
    }
    all
}

/// The way from one package to another, both included; `None` where there is none.
fn way(all: &BTreeMap<String, BTreeSet<String>>, from: &str, to: &str) -> Option<Vec<String>> {
    let mut ways = vec![vec![from.to_owned()]];
    let mut seen = BTreeSet::from([from.to_owned()]);
    while let Some(way) = ways.pop() {
        let last = way.last().unwrap();
        if last == to {
            return Some(way);
        }
        for next in &all[last] {
            if seen.insert(next.clone()) {
                ways.push([way.as_slice(), std::slice::from_ref(next)].concat());
            }
        }
    }
    None
}

/// Names of the packages in firmware/boards, and of the other images that run on a simulator.
fn images() -> Vec<String> {
    let boards = fs::read_dir(workspace().join("firmware/boards")).unwrap();
    let boards = boards.map(|folder| folder.unwrap().path());
    let tests = ["on-target", "panic-free", "profile-image"].map(|name| workspace().join("tests").join(name));
    let manifests = boards.chain(tests).map(|folder| folder.join("Cargo.toml")).filter(|path| path.exists());
    let name = |text: String| {
        let manifest: Table = text.parse().unwrap();
        manifest["package"]["name"].as_str().unwrap().to_owned()
    };
    manifests.map(|path| name(fs::read_to_string(path).unwrap())).collect()
}

#[test]
fn no_image_needs_host_sim() {
    let (all, images) = (dependencies(), images());
    for board in
        ["rp2040", "rp2350", "stm32f411", "nrf52840", "qemu-mps2", "qemu-show", "board-support", "on-target"]
    {
        assert!(images.iter().any(|there| there == board), "{board} is not in firmware/boards");
    }
    for image in &images {
        if let Some(way) = way(&all, image, "host-sim") {
            panic!("{}: an image needs only what plays, see firmware/boards/README.md", way.join(" -> "));
        }
        // A build script opens no port, and has no arguments.
        for unfit in ["clap", "plotters", "serialport"] {
            if let Some(way) = way(&all, image, unfit) {
                panic!("{}", way.join(" -> "));
            }
        }
    }
}

/// What looks for host-sim finds it where it is.
#[test]
fn a_package_that_needs_host_sim_is_found() {
    let all = dependencies();
    assert!(way(&all, "bunraku-tests", "host-sim").is_some());
    assert!(way(&all, "rp2040", "puppet-file").is_some(), "the board's build script reads a puppet.toml");
}
