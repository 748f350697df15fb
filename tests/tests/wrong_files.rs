//! A wrong file gets one clear sentence, and leaves no output behind.
#![allow(clippy::unwrap_used)]

use bunraku_tests::bunraku;
use mocap::sample;
use std::fs;
use std::path::Path;
use std::process::Output;

/// Runs in `folder` and expects exit code 1, one sentence on standard error with all of `parts`, and no `out.*`.
fn refused(folder: &Path, arguments: &[&str], parts: &[&str]) {
    let Output { status, stdout, stderr } = bunraku().args(arguments).current_dir(folder).output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(1), "{arguments:?}: {said}");
    assert!(stdout.is_empty(), "{arguments:?}");
    assert_eq!(said.lines().count(), 1, "{arguments:?}: {said}");
    for part in parts {
        assert!(said.contains(part), "{arguments:?}: {part:?} is not in {said:?}");
    }
    let left: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with("out") || name.starts_with(".tmp"))
        .collect();
    assert!(left.is_empty(), "{arguments:?} left {left:?}");
}

/// A folder with the embedded clip in our formats, and files that are none of them.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let clip = sample::clip();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("puppet.asf", sample::asf().as_bytes());
    let mut amc = Vec::new();
    let rotations = mocap::export::amc::Rotations::AsTheyAre;
    mocap::export::amc::write(&mut amc, &clip.skeleton, &clip.motion, rotations).unwrap();
    write("walk.amc", &amc);
    let mut bvh = Vec::new();
    mocap::export::bvh::write(&mut bvh, &clip.skeleton, &clip.motion).unwrap();
    write("walk.bvh", &bvh);
    write("cut.bvh", &bvh[..bvh.len() / 2]);
    write("cut-early.bvh", &bvh[..200]);
    write("empty.amc", b"");
    write("empty.qmd", b"");
    write("empty.mclip", b"");
    let jpeg = b"\xff\xd8\xff\xe0\x00\x10JFIF\x00\x01\x01\x01\x00H\x00H\x00\x00\xff\xdb\x00C\x00\x08\x06\x06";
    for name in ["photo.amc", "photo.bvh", "photo.asf", "photo.qmd", "photo.mclip", "photo.jpg"] {
        write(name, jpeg);
    }
    let qmd =
        encoder::qmd::encode(&clip, encoder::qmd::Parameters::TABLE_1, encoder::qmd::Method::ClosedLoop)
            .unwrap();
    let encoder = encoder::mclip::Encoder::new(&clip.skeleton, &clip.motion).unwrap();
    let encoding = encoder::mclip::Encoding::new(decoder_core::mclip::CodecId::Dpcm);
    let mclip = encoder.encode(&encoding, encoder::mclip::Quality::Bits(5)).unwrap();
    write("walk.mclip", &mclip);
    write("cut.mclip", &mclip[..mclip.len() - 1]);
    let mut damaged = mclip;
    let last = damaged.len() - 1;
    damaged[last] ^= 64;
    write("damaged.mclip", &damaged);
    write("walk.qmd", &qmd);
    write("cut.qmd", &qmd[..qmd.len() - 1]);
    folder
}

#[test]
fn the_sound_files_are_taken() {
    let folder = folder();
    for arguments in [
        &["encode", "walk.amc", "--skeleton", "puppet.asf", "--fps", "60", "-o", "out.qmd"][..],
        &["encode", "walk.bvh", "-o", "out2.qmd"],
        &["decode", "walk.qmd", "--skeleton", "puppet.asf", "-o", "out.bvh"],
        &["info", "walk.qmd"],
        &["info", "walk.mclip", "--channels"],
        &["encode", "walk.bvh", "--target-error", "0.2", "-o", "out.mclip"],
        &["decode", "walk.mclip", "--skeleton", "puppet.asf", "-o", "out2.bvh"],
        &["decode", "walk.mclip", "-o", "out.csv"],
        &["compare", "walk.amc", "walk.qmd", "--skeleton", "puppet.asf", "--fps", "60"],
    ] {
        let output = bunraku().args(arguments).current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn motions() {
    let folder = folder();
    let encode = |input: &str, parts: &[&str]| {
        refused(folder.path(), &["encode", input, "--skeleton", "puppet.asf", "-o", "out.qmd"], parts);
    };
    encode("photo.amc", &["photo.amc", "AMC"]);
    encode("photo.bvh", &["photo.bvh", "BVH"]);
    encode("photo.jpg", &["photo.jpg", "expected"]);
    encode("empty.amc", &["empty.amc", "empty"]);
    encode("cut.bvh", &["cut.bvh", "line", "end of the file", "expected"]);
    encode("cut-early.bvh", &["cut-early.bvh", "expected"]);
    encode("none.amc", &["none.amc", "cannot read"]);
    encode("walk.qmd", &["walk.qmd", "expected a motion"]);
    refused(folder.path(), &["encode", "walk.amc", "-o", "out.qmd"], &["walk.amc", "--skeleton"]);
    refused(
        folder.path(),
        &["encode", "walk.amc", "--skeleton", "photo.asf", "-o", "out.qmd"],
        &["photo.asf", "ASF"],
    );
    refused(
        folder.path(),
        &["encode", "walk.bvh", "--unit", "cm", "--fdf", "900", "-o", "out.qmd"],
        &["walk.bvh", "FDF", "900", "expected 0 to"],
    );
    refused(
        folder.path(),
        &["encode", "walk.bvh", "--unit", "cm", "-o", "out/of/place.qmd"],
        &["cannot write out/of/place.qmd: there is no folder out/of"],
    );
}

#[test]
fn clips() {
    let folder = folder();
    let decode = |clip: &str, parts: &[&str]| {
        refused(folder.path(), &["decode", clip, "--skeleton", "puppet.asf", "-o", "out.amc"], parts);
        refused(folder.path(), &["info", clip], parts);
    };
    decode("photo.qmd", &["photo.qmd is not a QMD clip", "expected"]);
    decode("empty.qmd", &["empty.qmd is not a QMD clip", "byte 0"]);
    decode("photo.mclip", &["photo.mclip is not a sound mclip", "magic"]);
    decode("empty.mclip", &["empty.mclip is not a sound mclip", "byte 0"]);
    decode("cut.mclip", &["cut.mclip is not a sound mclip", "block's codes", "are left"]);
    decode(
        "damaged.mclip",
        &["damaged.mclip is not a sound mclip", "damage in the block's codes: its CRC-32"],
    );
    decode("cut.qmd", &["cut.qmd is not a QMD clip", "rows", "are left"]);
    refused(
        folder.path(),
        &["decode", "walk.qmd", "--skeleton", "puppet.asf", "-o", "out.txt"],
        &["out.txt", "txt", "expected amc, bvh, csv, glb or json"],
    );
    refused(
        folder.path(),
        &["decode", "walk.mclip", "-o", "out.bvh"],
        &["out.bvh", "needs the skeleton", "--skeleton"],
    );
    refused(
        folder.path(),
        &["decode", "walk.qmd", "-o", "out.csv"],
        &["walk.qmd does not name its channels", "--skeleton"],
    );
}

/// What a command reads is still there, byte for byte, where its output has the same name.
#[test]
fn outputs_do_not_take_the_place_of_inputs() {
    let folder = folder();
    let folder = folder.path();
    let sample = bunraku_tests::workspace().join("puppets/sample.toml");
    fs::copy(&sample, folder.join("puppet.toml")).unwrap();
    let log = ["play", "walk.mclip", "--puppet", "puppet.toml", "--on", "host"];
    let to_itself: [(&str, &[&str]); 4] = [
        ("walk.mclip", &["decode", "walk.mclip", "--skeleton", "puppet.asf", "-o", "walk.mclip"]),
        ("walk.bvh", &["decode", "walk.mclip", "--skeleton", "walk.bvh", "-o", "walk.bvh"]),
        ("puppet.toml", &[&log[..], &["--log", "puppet.toml"]].concat()),
        ("puppet.toml", &[&log[..], &["--log=./puppet.toml"]].concat()),
    ];
    for (name, arguments) in to_itself {
        let before = fs::read(folder.join(name)).unwrap();
        let output = bunraku().args(arguments).current_dir(folder).output().unwrap();
        assert!(!output.status.success(), "{arguments:?}");
        assert_eq!(fs::read(folder.join(name)).unwrap(), before, "{arguments:?}");
        let said = String::from_utf8(output.stderr).unwrap();
        let is_told = said.contains(&format!("{name}: the command names this file twice"));
        assert!(is_told || said.contains("expected"), "{arguments:?}: {said}");
    }
}

/// A link stays a link, and a pipe has a reader.
#[cfg(unix)]
#[test]
fn outputs_go_where_links_lead_and_into_pipes() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("there.csv"), "time,head.ry\n0,1\n").unwrap();
    std::os::unix::fs::symlink(at("there.csv"), at("link.csv")).unwrap();
    let decode = |output: &str| {
        let mut command = bunraku();
        command.args(["decode", "walk.mclip", "-o", output]).current_dir(folder.path());
        command
    };
    assert!(decode("link.csv").status().unwrap().success());
    let csv = fs::read(at("there.csv")).unwrap();
    assert!(csv.len() > 10_000 && fs::symlink_metadata(at("link.csv")).unwrap().is_symlink());
    assert!(std::process::Command::new("mkfifo").arg(at("pipe.csv")).status().unwrap().success());
    let mut writer = decode("pipe.csv").spawn().unwrap();
    assert_eq!(fs::read(at("pipe.csv")).unwrap(), csv);
    assert!(writer.wait().unwrap().success());
}

/// What is there stays where it is no earlier output: another kind of file, perhaps an input that nobody named, or one that is
/// read-only.
#[test]
fn outputs_do_not_take_the_place_of_other_files() {
    let folder = folder();
    let folder = folder.path();
    fs::copy(bunraku_tests::workspace().join("puppets/sample.toml"), folder.join("puppet.toml")).unwrap();
    fs::write(folder.join("song.mp3"), b"ID3\x03\0\0\0\0\0\xff\xfb\x90").unwrap();
    fs::write(folder.join("song.csv"), b"ID3\x03\0\0\0\0\0\xff\xfb\x90").unwrap();
    fs::write(folder.join("song.qmd"), b"ID3\x03\0\0\0\0\0\xff\xfb\x90").unwrap();
    fs::write(folder.join("takes.csv"), b"time,head.ry\n0,1\n").unwrap();
    let play = ["play", "walk.mclip", "--puppet", "puppet.toml"];
    let locked = folder.join("locked.csv");
    fs::write(&locked, b"time,head.ry\n0,1\n").unwrap();
    let mut permissions = fs::metadata(&locked).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&locked, permissions).unwrap();
    for (name, arguments, part) in [
        ("song.csv", &["decode", "walk.mclip", "-o", "song.csv"][..], "would be lost for a table (CSV)"),
        ("song.qmd", &["encode", "walk.bvh", "-o", "song.qmd"], "would be lost for a .qmd"),
        ("song.mp3", &["encode", "walk.bvh", "-o", "song.mp3"], "expected .mclip or .qmd"),
        (
            "puppet.asf",
            &["puppet", "new", "walk.amc", "--skeleton", "./puppet.asf", "--force", "-o", "puppet.asf"],
            "twice",
        ),
        (
            "takes.csv",
            &[&play[..], &["--log", "takes.csv"]].concat(),
            "is a table (CSV), and would be lost for a log",
        ),
        (
            "puppet.asf",
            &[&play[..], &["--log", "puppet.asf"]].concat(),
            "is an ASF, and would be lost for a log",
        ),
        (
            "puppet.asf",
            &[&play[..], &["--html", "puppet.asf"]].concat(),
            "is an ASF, and would be lost for an HTML page",
        ),
        ("walk.amc", &["optimize", "walk.bvh", "--step", "480", "-o", "walk.amc"], "expected .qmd"),
        ("locked.csv", &["decode", "walk.mclip", "-o", "locked.csv"], "read-only"),
        (
            "takes.csv",
            &["servos", "--config", "puppet.toml", "--log", "takes.csv"],
            "would be lost for a log",
        ),
    ] {
        let before = fs::read(folder.join(name)).unwrap();
        let output = bunraku().args(arguments).current_dir(folder).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && said.contains(part), "{arguments:?}: {said}");
        assert_eq!(fs::read(folder.join(name)).unwrap(), before, "{arguments:?}");
    }
    for output in [".", "no/folder/out.csv"] {
        let output = bunraku().args(play).args(["--log", output]).current_dir(folder).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    }
    // An output of the same kind is one that is written again.
    for _ in 0..2 {
        let output = bunraku().args(play).args(["--log", "log.csv"]).current_dir(folder).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let hidden = fs::read_dir(folder)
        .unwrap()
        .filter(|file| file.as_ref().unwrap().file_name().to_string_lossy().starts_with(".tmp"));
    assert_eq!(hidden.count(), 0, "temporary files are left");
}

/// A signal in the middle of an output leaves neither a part of it nor a temporary file.
#[cfg(unix)]
#[test]
fn signals_leave_nothing_behind() {
    use std::os::unix::process::ExitStatusExt;
    let folder = folder();
    let folder = folder.path();
    // A recording whose decoding to text takes long enough to be seen.
    let mut clip = sample::clip();
    clip.motion.samples = clip.motion.samples.repeat(100);
    let (parameters, method) = (encoder::qmd::Parameters::TABLE_1, encoder::qmd::Method::FAITHFUL);
    fs::write(folder.join("long.qmd"), encoder::qmd::encode(&clip, parameters, method).unwrap()).unwrap();
    let before = fs::read_dir(folder).unwrap().count();
    for signal in ["-INT", "-TERM", "-HUP"] {
        // Seen in the middle where the temporary file is there and its place is not taken. A quick machine may be through
        // before: then it is tried again.
        let stopped = (0..20).any(|_| {
            let mut command = bunraku();
            command.args(["decode", "long.qmd", "--skeleton", "puppet.asf", "-o", "out.amc"]);
            let mut running =
                command.current_dir(folder).stdout(std::process::Stdio::null()).spawn().unwrap();
            while running.try_wait().unwrap().is_none() && fs::read_dir(folder).unwrap().count() == before {
                std::thread::yield_now();
            }
            std::process::Command::new("kill").args([signal, &running.id().to_string()]).status().unwrap();
            let status = running.wait().unwrap();
            assert_eq!(status.signal(), None, "the command ends by itself");
            let was_stopped = status.code() == Some(130);
            assert_eq!(folder.join("out.amc").exists(), !was_stopped, "{status}");
            drop(fs::remove_file(folder.join("out.amc")));
            assert_eq!(fs::read_dir(folder).unwrap().count(), before, "{signal} left a file");
            was_stopped
        });
        assert!(stopped, "{signal} was never in time");
    }
}

#[test]
fn usage_errors_exit_with_2() {
    for arguments in [
        &["encode"][..],
        &["fly"],
        &["encode", "a.amc", "-o", "b.qmd", "--bits", "7"],
        &["encode", "a.amc", "-o", "b.txt"],
        &["encode", "a.amc", "-o", "b"],
        &["encode", "a.amc", "-o", "b.qmd", "--codec", "dpcm"],
        &["encode", "a.amc", "-o", "b.qmd", "--entry", "12"],
        &["encode", "a.amc", "-o", "b.qmd", "--block", "400"],
        &["encode", "a.amc", "-o", "b.qmd", "--entropy", "fixed"],
        &["encode", "a.amc", "-o", "b.qmd", "--levels", "gaussian"],
        &["encode", "a.amc", "-o", "b.mclip", "--target-error", "nan"],
        &["encode", "a.amc", "-o", "b.mclip", "--fps", "-30"],
        &["compare", "a.amc", "b.mclip", "--max-error", "nan"],
        &["play", "a.mclip", "--puppet", "puppet.toml", "--speed", "5"],
        &["play", "a.mclip", "--puppet", "puppet.toml", "--fps", "1000"],
        &[],
    ] {
        let output = bunraku().args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn every_command_has_help_with_an_example() {
    let output = bunraku().arg("--help").output().unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    assert!(commands.len() >= 5, "{help}");
    for command in commands {
        let output = bunraku().args([command, "--help"]).output().unwrap();
        let help = String::from_utf8(output.stdout).unwrap();
        let example = format!("\n  bunraku {command}");
        assert!(help.contains("Example") && help.contains(&example), "{help}");
    }
}
