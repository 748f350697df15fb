//! Clips that say more than is in them, or say it so that it would be misread: what the commands make of them.
#![allow(clippy::unwrap_used)]

use bunraku_tests::bunraku;
use decoder_core::Limits;
use decoder_core::mclip::{BlockHeader, CodecId, Header, HeaderFields};
use encoder::mclip::{Encoder, Encoding, Quality};
use mocap::import::{self, Options};
use std::fs;
use std::path::Path;
use std::process::Output;

/// Two joints that turn about one axis each, and stand still.
const STILL: &str = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\nJOINT b\n{\nOFFSET 0 10 0\nCHANNELS 1 Xrotation\n\
    End Site\n{\nOFFSET 0 10 0\n}\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.01\n5 6\n5 6\n";

/// A clip of [`STILL`] in `folder`, which has the recording too.
fn still(folder: &Path) -> Vec<u8> {
    fs::write(folder.join("still.bvh"), STILL).unwrap();
    let options = Options { unit: Some("cm".parse().unwrap()), ..Options::default() };
    let clip = import::read(&folder.join("still.bvh"), &options).unwrap().clip;
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
    encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(5)).unwrap()
}

/// The clip with another header, and these blocks where there are some.
fn rebuilt<'b>(
    clip: &'b [u8],
    blocks: Option<Vec<u8>>,
    change: impl FnOnce(&mut HeaderFields<'b>),
) -> Vec<u8> {
    let mut fields = *Header::parse(clip, Limits::MAX).unwrap().fields();
    change(&mut fields);
    let mut out = Vec::new();
    fields.emit(&mut out);
    let start = decoder_core::mclip::Clip::parse(clip, Limits::MAX).unwrap().header_bytes();
    out.extend(blocks.unwrap_or_else(|| clip[start..].to_vec()));
    out
}

/// A clip of so many frames, which takes 12 bytes for each 65,535 of them.
fn long(clip: &[u8], frames: u32) -> Vec<u8> {
    let (mut blocks, mut first) = (Vec::new(), 0);
    while first < frames {
        let count = u16::try_from(frames - first).unwrap_or(u16::MAX);
        blocks.extend(BlockHeader::of(&[], count, first, true).unwrap().emit());
        first += u32::from(count);
    }
    rebuilt(clip, Some(blocks), |fields| fields.frames = frames)
}

fn run(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stdout, stderr } = bunraku().args(arguments).current_dir(folder).output().unwrap();
    (status.code(), [stderr, stdout].map(|bytes| String::from_utf8(bytes).unwrap()).concat())
}

/// A puppet of both joints.
const PUPPET: &str = "servo_hz = 50\nbaud = 1_000_000\n[[joint]]\nname = \"one\"\nid = 1\nchannel = \"a.rx\"\nrange = [-90, 90]\n\
    max_speed = 100\n[[joint]]\nname = \"two\"\nid = 2\nchannel = \"b.rx\"\nrange = [-90, 90]\nmax_speed = 100\n";

/// Nothing is decoded where the header alone says that it is too much or does not fit; what is truly wanted has an option.
#[test]
fn a_small_file_of_many_frames_is_told_from_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let clip = still(folder);
    fs::write(folder.join("puppet.toml"), PUPPET).unwrap();
    fs::write(folder.join("other.toml"), PUPPET.replace("b.rx", "c.rx")).unwrap();
    // A thousand hours; and 7 minutes, which is more than the size suggests but not more than any clip may have.
    fs::write(folder.join("bomb.mclip"), long(&clip, 360_000_000)).unwrap();
    fs::write(folder.join("rest.mclip"), long(&clip, 42_000)).unwrap();
    let much = "360000000 frames of 2 channels in";
    for (arguments, code, part) in [
        (&["decode", "bomb.mclip", "-o", "out.csv"][..], 1, much),
        (&["decode", "bomb.mclip", "-o", "out.csv"], 1, "with --long"),
        (&["play", "bomb.mclip", "--puppet", "puppet.toml"], 1, "--long takes them all"),
        (&["play", "bomb.mclip", "--puppet", "other.toml"], 1, "the clip has no joint \"c\""),
        (&["puppet", "check", "puppet.toml", "--clip", "bomb.mclip"], 1, much),
        (&["compare", "still.bvh", "bomb.mclip", "--unit", "cm"], 1, "has 360000000 frames, expected 2"),
        (&["info", "bomb.mclip"], 0, "only the first 2111488 frames were decoded"),
        (&["info", "rest.mclip", "--channels"], 0, "a.rx"),
        (&["decode", "rest.mclip", "-o", "out.csv"], 0, "42000 frames of 2 channels"),
        (&["play", "rest.mclip", "--puppet", "puppet.toml"], 0, ""),
    ] {
        let (found, said) = run(folder, arguments);
        assert!(found == Some(code) && said.contains(part), "{arguments:?}: {said}");
        assert!(code == 0 || said.lines().filter(|line| line.contains("bunraku")).count() == 1, "{said}");
    }
    // Longer than its size suggests, and taken where that is asked for.
    fs::write(folder.join("rest.mclip"), long(&clip, 2_100_000)).unwrap();
    assert_eq!(run(folder, &["decode", "rest.mclip", "-o", "out.csv"]).0, Some(1));
    assert_eq!(run(folder, &["decode", "rest.mclip", "-o", "out.csv", "--long"]).0, Some(0));
}

#[test]
fn a_channel_that_is_there_twice_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let clip = still(folder);
    fs::write(folder.join("puppet.toml"), PUPPET).unwrap();
    fs::write(folder.join("twice.mclip"), rebuilt(&clip, None, |fields| fields.names = b"\x01a\x01a"))
        .unwrap();
    for arguments in [
        &["info", "twice.mclip"][..],
        &["decode", "twice.mclip", "-o", "out.csv"],
        &["play", "twice.mclip", "--puppet", "puppet.toml"],
        &["compare", "still.bvh", "twice.mclip", "--unit", "cm"],
        &["puppet", "check", "puppet.toml", "--clip", "twice.mclip"],
    ] {
        let (code, said) = run(folder, arguments);
        assert!(
            code == Some(1)
                && said.contains("twice.mclip is not a sound mclip: the channel a.rx is there twice"),
            "{said}"
        );
    }
}

#[test]
fn names_out_of_a_clip_do_not_move_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let clip = still(folder);
    fs::write(folder.join("puppet.toml"), PUPPET).unwrap();
    let long = [&b"\x80\x80\x04"[..], &[b'x'; 65_536], b"\x01b"].concat();
    for names in [&b"\x08\x1b]0;pw\x07n\x01b"[..], "\x08\u{202e}a\r\nbc\x01b".as_bytes(), &long] {
        fs::write(folder.join("clip.mclip"), rebuilt(&clip, None, |fields| fields.names = names)).unwrap();
        for arguments in [
            &["info", "clip.mclip", "--channels"][..],
            &["play", "clip.mclip", "--puppet", "puppet.toml"],
            &["compare", "still.bvh", "clip.mclip", "--unit", "cm"],
            &["decode", "clip.mclip", "--skeleton", "still.bvh", "--unit", "cm", "-o", "out.bvh"],
        ] {
            let (_, said) = run(folder, arguments);
            let is_plain = |c: char| !c.is_control() && !('\u{202a}'..='\u{202e}').contains(&c);
            assert!(said.lines().all(|line| line.chars().all(is_plain) && line.len() < 1000), "{said:?}");
        }
        let (code, json) = run(folder, &["info", "clip.mclip", "--json"]);
        let json: serde_json::Value = serde_json::from_str(&json).unwrap();
        let name = String::from_utf8_lossy(names);
        let own = json["channels"][0]["name"].as_str().unwrap().strip_suffix(".rx").unwrap();
        assert!(code == Some(0) && name.contains(own), "JSON has the name as it is: {own:?}");
    }
}

#[test]
fn what_is_wrong_about_the_first_bytes_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let clip = still(folder);
    let mut magic = clip.clone();
    magic[3] = b'Q';
    let mut zero = clip.clone();
    zero[6] = 1;
    for (bytes, part) in [
        (magic, "byte 0: the magic number is \"MCLQ\", expected \"MCLP\""),
        (zero, "byte 6: found 1 behind the format version, expected 0"),
    ] {
        fs::write(folder.join("clip.mclip"), bytes).unwrap();
        let (code, said) = run(folder, &["info", "clip.mclip"]);
        assert!(code == Some(1) && said.contains(part), "{said}");
    }
    // Tables that go on: nothing is built of them before a frame is decoded, but `info` says so.
    let tables = [&b"\x01\x01\x00\x00"[..], b"\x07"].concat();
    let longer =
        rebuilt(&clip, None, |fields| (fields.entropy, fields.tables, fields.ram) = (1, &tables, u32::MAX));
    fs::write(folder.join("clip.mclip"), longer).unwrap();
    let (code, said) = run(folder, &["info", "clip.mclip"]);
    assert!(code == Some(1) && said.contains("the code tables take 4 bytes, but 5 are there"), "{said}");
}

/// A clip of a puppet's joints has none of the skeleton's channels: what it can become is said.
#[test]
fn a_fitted_clip_says_what_it_decodes_to() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let clip = still(folder);
    fs::write(
        folder.join("fitted.mclip"),
        rebuilt(&clip, None, |fields| fields.names = b"\x05elbow\x04neck"),
    )
    .unwrap();
    let line = ["decode", "fitted.mclip", "--skeleton", "still.bvh", "--unit", "cm", "-o", "out.bvh"];
    let (code, said) = run(folder, &line);
    assert!(
        code == Some(1) && said.contains("fitted with --puppet, and decodes to a .csv without --skeleton"),
        "{said}"
    );
    let (code, said) = run(folder, &["decode", "fitted.mclip", "-o", "out.bvh"]);
    assert!(code == Some(1) && said.contains("fitted to a puppet decodes to"), "{said}");
    assert_eq!(run(folder, &["decode", "fitted.mclip", "-o", "out.csv"]).0, Some(0));
}
