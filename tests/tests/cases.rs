//! The clips and recordings of ../shared/cases, each of which went wrong once, and what is right for each. Those that can be are
//! tests with inputs of their own too: see `wrong_files.rs`, `clip_files.rs`, and the importers' own tests.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, cases, workspace};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;

/// Runs the command and gives its exit code, and what it said on both streams.
fn run(arguments: &[&str], folder: &Path) -> (Option<i32>, String) {
    let Output { status, stdout, stderr } = bunraku().args(arguments).current_dir(folder).output().unwrap();
    let said = [stderr, stdout].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    assert!(!said.contains('\u{1b}') && !said.contains('\u{7}'), "{arguments:?}: {said:?}");
    (status.code(), said)
}

#[test]
fn clips() {
    let Some(cases) = cases() else { return };
    let folder = tempfile::tempdir().unwrap();
    let puppet = workspace().join("puppets/sample.toml");
    let puppet = puppet.to_str().unwrap();
    let reference = cases.join("bvh/in.bvh");
    for (name, code, part) in [
        ("kind-dup", 1, "is there twice"),
        ("real-clip-dup-channel", 1, "the channel lfemur.rz is there twice"),
        ("magic", 1, "the magic number is \"MCLQ\", expected \"MCLP\""),
        ("zero1", 1, "found 1 behind the format version, expected 0"),
        ("huf-extra", 1, "the code tables take"),
        ("rec-pad1", 0, ""),
        ("mulaw-d0", 0, ""),
        ("name-esc", 0, ""),
        ("bomb-12KB-65M-frames", 1, "expected at most"),
        ("bomb-1605B-1000ch", 1, ""),
    ] {
        let clip = cases.join(format!("clips/{name}.mclip"));
        let clip = clip.to_str().unwrap();
        let start = Instant::now();
        let (found, said) = run(&["decode", clip, "-o", "out.csv"], folder.path());
        assert!(found == Some(code) && said.contains(part), "decode {name}: {said}");
        let is_bomb = name.starts_with("bomb");
        let (found, said) = run(&["info", clip, "--channels"], folder.path());
        assert_eq!(found, Some(if is_bomb { 0 } else { code }), "info {name}: {said}");
        // No puppet and no recording has these channels, which is said before anything is decoded.
        for arguments in [
            &["play", clip, "--puppet", puppet][..],
            &["puppet", "check", puppet, "--clip", clip],
            &["compare", reference.to_str().unwrap(), clip, "--unit", "cm"],
        ] {
            let (found, said) = run(arguments, folder.path());
            assert_eq!((found, said.lines().count() < 20), (Some(1), true), "{arguments:?}: {said}");
        }
        println!("{name}: {:.2} s", start.elapsed().as_secs_f64());
    }
}

/// Six hundred thousand values cost 200 MB once; a limit of the system says that they do not.
#[cfg(unix)]
#[test]
fn bombs_take_no_memory() {
    let Some(cases) = cases() else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["bomb-12KB-65M-frames", "bomb-1605B-1000ch"] {
        let clip = cases.join(format!("clips/{name}.mclip"));
        for command in [&["info", "--json"][..], &["decode", "-o", "out.csv"]] {
            let mut limited = Command::new("sh");
            limited.args(["-c", "ulimit -d 204800; ulimit -t 5; exec \"$0\" \"$@\""]);
            limited.arg(bunraku().get_program()).arg(command[0]).arg(&clip).args(&command[1..]);
            let code = limited.current_dir(folder.path()).output().unwrap().status.code();
            assert!(code == Some(0) || code == Some(1), "{command:?} {name}: {code:?}");
        }
    }
}

#[test]
fn recordings() {
    let Some(cases) = cases() else { return };
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| -> PathBuf { cases.join("bvh").join(format!("{name}.bvh")) };
    for (name, arguments, code, part) in [
        ("angles_0_to_360_start_above", &[][..], 0, ""),
        ("angles_0_to_360_start_below", &[], 0, ""),
        ("euler_flip_same_pose", &[], 0, ""),
        ("rest_then_one_nod", &[], 0, ""),
        ("still_pose_one_metre_up", &[], 0, ""),
        ("same_motion_in_metres", &[], 0, "guessed to be metres"),
        ("same_motion_in_cm", &[], 0, "guessed to be centimetres"),
        ("frames_header_one_less", &[], 0, "the header says 39 frames, the file has 40 rows"),
        ("names_shift_jis_two", &[], 0, "2 joints with a name that is not UTF-8"),
        ("frame_time_23_976", &[], 0, "23.976 fps"),
        ("frame_time_as_fps_30", &[], 0, "looks like frames per second"),
        ("frame_time_1000fps", &[], 1, "--fps 60 thins frames out"),
        ("frame_time_1000fps", &["--fps", "50"], 0, "resampled from 1000 to 50"),
        ("cr_only", &[], 0, "carriage return"),
        ("names_dup", &[], 0, "is called `Arm_2`"),
        ("two_roots", &[], 0, "2 roots"),
        ("endsite_joined", &[], 0, "is read as `End Site`"),
        ("slimevr_interrupted_frames_0", &[], 0, "the header says 0 frames, the file has 40 rows"),
        ("endsites-5000", &[], 1, "an End Site has no children"),
        ("tr32767", &["--target-error", "0.1"], 0, ""),
    ] {
        let path = at(name);
        let line = [&["encode", path.to_str().unwrap(), "-o", "out.mclip"], arguments].concat();
        let (found, said) = run(&line, folder.path());
        assert!(found == Some(code) && said.contains(part), "{name}: {said}");
        assert!(!said.contains("nearest to"), "{name}: {said}");
    }
    // How far decoded clips are from their recordings: a nod is there, a pose that rests is exact, and so on.
    for (name, arguments, most_cm) in [
        ("still_pose_one_metre_up", &[][..], "0.001"),
        ("rest_then_one_nod", &["--target-error", "0.2"], "0.2"),
        ("same_motion_in_metres", &[], "0.1"),
        ("same_motion_in_cm", &[], "0.1"),
        ("angles_0_to_360_start_above", &[], "0.1"),
        ("euler_flip_same_pose", &[], "0.1"),
        ("tr32767", &["--target-error", "0.1"], "0.1"),
    ] {
        let path = at(name);
        let path = path.to_str().unwrap();
        let (code, said) = run(&[&["encode", path, "-o", "out.mclip"], arguments].concat(), folder.path());
        assert_eq!(code, Some(0), "{said}");
        let (code, said) = run(&["compare", path, "out.mclip", "--max-error", most_cm], folder.path());
        assert_eq!(code, Some(0), "{name}: {said}");
    }
    let (one, other) = (at("same_motion_in_metres"), at("same_motion_in_cm"));
    let (code, said) = run(&["compare", one.to_str().unwrap(), other.to_str().unwrap()], folder.path());
    assert!(code == Some(0) && said.contains("DEF, mean        0.000"), "{said}");
}

/// Channels are matched by name, or refused with their names.
#[test]
fn compared_skeletons() {
    let Some(cases) = cases() else { return };
    let folder = cases.join("bvh");
    for (one, other, part) in [
        ("in.bvh", "renamed.bvh", "has no channel a.tx"),
        ("renamed.bvh", "in.bvh", "has no channel zz.tx"),
        ("in.bvh", "sk.bvh", "has 3 channels, expected 9"),
        ("sk.bvh", "in.bvh", "has 9 channels, expected 3"),
    ] {
        let (code, said) = run(&["compare", one, other, "--unit", "cm"], &folder);
        assert!(code == Some(1) && said.contains(part), "{one} {other}: {said}");
    }
    assert_eq!(run(&["compare", "in.bvh", "in.bvh", "--max-error", "0"], &folder).0, Some(0));
}
