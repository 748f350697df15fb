//! `bunraku rd` on files: the pictures and the table, and what it refuses.
#![allow(clippy::unwrap_used)]

use bunraku_tests::bunraku;
use mocap::sample;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Output;

/// The embedded clip as an AMC with its skeleton, and as a BVH.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let clip = sample::clip();
    let mut amc = Vec::new();
    let rotations = mocap::export::amc::Rotations::AsTheyAre;
    mocap::export::amc::write(&mut amc, &clip.skeleton, &clip.motion, rotations).unwrap();
    let mut bvh = Vec::new();
    mocap::export::bvh::write(&mut bvh, &clip.skeleton, &clip.motion).unwrap();
    for (name, bytes) in [("puppet.asf", sample::asf().as_bytes()), ("walk.amc", &amc), ("walk.bvh", &bvh)] {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

fn rd(folder: &Path, arguments: &[&str]) -> Output {
    bunraku().arg("rd").args(arguments).current_dir(folder).output().unwrap()
}

/// Standard output of a run that succeeds.
fn said(folder: &Path, arguments: &[&str]) -> String {
    let output = rd(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// What a run that fails says, and its code.
fn refused(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = rd(folder, arguments);
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// Width and height of a PNG: its signature, then IHDR (ISO/IEC 15948, 11.2.2).
fn png_size(path: &Path) -> (u32, u32) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(&bytes[12..16], b"IHDR");
    assert_eq!(&bytes[bytes.len() - 8..bytes.len() - 4], b"IEND");
    let word = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    (word(16), word(20))
}

/// Width and height that an SVG says it has.
fn svg_size(svg: &str) -> (u32, u32) {
    let number = |name: &str| {
        let (_, rest) = svg.split_once(&format!(" {name}=\"")).unwrap();
        rest.split_once('"').unwrap().0.parse().unwrap()
    };
    (number("width"), number("height"))
}

#[test]
fn a_sweep_is_drawn_and_tabulated() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let report = said(
        folder.path(),
        &[
            "walk.amc",
            "walk.bvh",
            "--skeleton",
            "puppet.asf",
            "--fps",
            "15",
            "--codecs",
            "pcm,dpcm,mulaw",
            "--svg",
            "rd.svg",
            "--png",
            "rd.png",
            "--csv",
            "rd.csv",
            "--json",
        ],
    );
    let report: Value = serde_json::from_str(&report).unwrap();
    let points = report["points"].as_array().unwrap();

    let svg = fs::read_to_string(at("rd.svg")).unwrap();
    for curve in ["pcm", "pcm steps", "dpcm order 1", "dpcm order 2", "dpcm order 2 steps", "mulaw"] {
        // A legend's entry on a line of its own.
        assert!(svg.lines().any(|line| line == curve), "{curve}");
    }
    assert!(!svg.contains("adpcm"));
    assert_eq!(png_size(&at("rd.png")), svg_size(&svg));

    let csv = fs::read_to_string(at("rd.csv")).unwrap();
    let mut rows = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let column = |name: &str| header.iter().position(|there| *there == name).unwrap();
    let (clip, curve, psnr, rate) =
        (column("clip"), column("curve"), column("psnr_db"), column("bits_per_s"));
    let rows: Vec<_> = rows.collect();
    assert_eq!(rows.len(), points.len());
    for name in ["walk", "pooled"] {
        let pcm: Vec<(f64, f64)> = rows
            .iter()
            .filter(|row| row[clip] == name && row[curve] == "pcm")
            .map(|row| (row[rate].parse().unwrap(), row[psnr].parse().unwrap()))
            .collect();
        // 2 to 10 bits; walk is there twice, once as AMC and once as BVH.
        assert_eq!(pcm.len(), if name == "walk" { 18 } else { 9 });
        for of_file in pcm.chunks(9) {
            assert!(of_file.windows(2).all(|pair| pair[0] < pair[1] && pair[0].1 < pair[1].1), "{of_file:?}");
        }
    }
}

#[test]
fn figures_show_what_they_are_named_after() {
    let folder = folder();
    let walk = ["walk.bvh", "--fps", "15", "--svg", "out.svg"];
    let figure = |more: &[&str]| {
        let said = said(folder.path(), &[&walk[..], more].concat());
        (said, fs::read_to_string(folder.path().join("out.svg")).unwrap())
    };
    let (said, svg) = figure(&["--figure", "7-3"]);
    assert!(svg.contains("direct quantisation: walk at 15 fps") && svg.contains("PSNR, dB"));
    assert!(said.lines().nth(1).unwrap().starts_with("pcm "), "{said}");
    let (_, svg) = figure(&["--figure", "7-6"]);
    assert!(svg.contains("dpcm order 1") && svg.contains("mulaw"));
    let (said, svg) = figure(&["--figure", "6", "--faithful"]);
    assert!(svg.contains(".qmd b 11 faithful") && svg.contains("mean joint error, cm"));
    assert_eq!(said.lines().count(), 1 + 4 * 17);
    let (said, svg) = figure(&["--figure", "7-2", "--trace", "rradius.rx"]);
    assert!(svg.contains("pcm: 8 levels") && svg.contains("pcm: 64 levels") && svg.contains("pcm: error"));
    assert!(said.starts_with("rradius.rx of walk, degrees\n"), "{said}");
}

#[test]
fn the_rate_may_be_lower_than_recorded() {
    let folder = folder();
    let rows =
        said(folder.path(), &["walk.bvh", "--fps", "20", "--codecs", "dpcm", "--errors", "0.2", "--json"]);
    let rows: Value = serde_json::from_str(&rows).unwrap();
    let row = &rows["clips"][0];
    // 8 seconds.
    let rate = row["bytes"].as_f64().unwrap();
    assert!((row["bits_per_s"].as_f64().unwrap() - rate).abs() < 1e-9, "{row}");
    assert!((row["mean_joint_cm"].as_f64().unwrap() / 0.2 - 1.0).abs() < 0.05, "{row}");
}

#[test]
fn what_cannot_be_is_said() {
    let folder = folder();
    let (code, said) = refused(folder.path(), &["walk.bvh", "--trace", "rradus.rx", "--svg", "out.svg"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("no joint \"rradus\"; the nearest channels are rradius.rx, "), "{said}");
    let (code, said) = refused(folder.path(), &["walk.bvh", "--fps", "61", "--svg", "out.svg"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("walk was recorded at 60 frames per second, expected at least 61"), "{said}");
    let (code, said) = refused(folder.path(), &["walk.amc", "--svg", "out.svg"]);
    assert_eq!(code, Some(1));
    assert!(
        said.contains("walk.amc: expected --skeleton, or a name like 02_01.amc next to 02.asf"),
        "{said}"
    );
    let (code, said) = refused(folder.path(), &["walk.bvh", "walk.bvh", "--trace", "rradius.rx"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("found 2 motions, expected one for the trace"), "{said}");
    let (code, said) = refused(folder.path(), &["walk.bvh", "--figure", "7-2", "--svg", "out.svg"]);
    assert_eq!(code, Some(2));
    assert!(said.contains("name one with --trace"), "{said}");
    let (code, _) = refused(folder.path(), &["walk.bvh", "--figure", "7-3", "--codecs", "dpcm"]);
    assert_eq!(code, Some(2));
    let (code, _) = refused(folder.path(), &["walk.bvh", "--errors", "0.1", "--svg", "out.svg"]);
    assert_eq!(code, Some(2));
    assert!(!folder.path().join("out.svg").exists());
}
