//! Recordings as other programs write them, through the command: what is read, what is told, and what comes out.
#![allow(clippy::unwrap_used)]

use bunraku_tests::bunraku;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Runs in `folder`: whether it succeeded, standard output and standard error.
fn run(folder: &Path, arguments: &[&str]) -> (bool, String, String) {
    let output = bunraku().args(arguments).current_dir(folder).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.success(), text(output.stdout), text(output.stderr))
}

/// Runs in `folder` and expects success: standard output and standard error.
fn done(folder: &Path, arguments: &[&str]) -> (String, String) {
    let (success, out, error) = run(folder, arguments);
    assert!(success, "{arguments:?}: {error}");
    (out, error)
}

fn info(folder: &Path, file: &str) -> serde_json::Value {
    serde_json::from_str(&done(folder, &["info", file, "--json"]).0).unwrap()
}

/// Hips and spine without legs, that bow and turn: 90 frames, in units of so many centimetres.
fn bow(cm_per_unit: f64, frame_time: &str) -> String {
    let [hips, spine, end] = [90.0, 20.0, 15.0].map(|cm| cm / cm_per_unit);
    let mut text = format!(
        "HIERARCHY\nROOT Hips\n{{\n  OFFSET 0 {hips} 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation \
         Yrotation\n  JOINT Spine\n  {{\n    OFFSET 0 {spine} 0\n    CHANNELS 3 Zrotation Xrotation Yrotation\n    \
         End Site\n    {{\n      OFFSET 0 {end} 0\n    }}\n  }}\n}}\nMOTION\nFrames: 90\nFrame Time: {frame_time}\n"
    );
    for frame in 0..90 {
        let wave =
            |turns: f64, by: f64| (by * (TAU * turns * f64::from(frame) / 90.0).sin() * 1e4).round() / 1e4;
        let (a, b, c) = (wave(1.0, 20.0), wave(2.0, 15.0), wave(3.0, 10.0));
        writeln!(text, "0 {hips} 0 {a} {b} {c} {b} {c} {a}").unwrap();
    }
    text
}

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

#[test]
fn metres_and_centimetres_give_the_same_clip() {
    let folder = folder(&[("cm.bvh", &bow(1.0, "0.0333333")), ("m.bvh", &bow(100.0, "0.0333333"))]);
    let encode = |name: &str| {
        let (input, output) = (format!("{name}.bvh"), format!("{name}.mclip"));
        let told = done(folder.path(), &["encode", &input, "-o", &output]).1;
        (told, fs::read(folder.path().join(output)).unwrap())
    };
    let ((cm_told, cm), (m_told, m)) = (encode("cm"), encode("m"));
    assert_eq!(cm, m);
    assert!(
        cm_told.contains("cm.bvh: lengths guessed to be centimetres: the figure is 1.25 m tall"),
        "{cm_told}"
    );
    assert!(m_told.contains("m.bvh: lengths guessed to be metres: the figure is 1.25 m tall"), "{m_told}");
    // Who knows the unit is asked nothing, and told nothing.
    let (_, told) = done(folder.path(), &["encode", "m.bvh", "--unit", "m", "-o", "known.mclip"]);
    assert!(!told.contains("guessed"), "{told}");
    assert_eq!(fs::read(folder.path().join("known.mclip")).unwrap(), m);
}

#[test]
fn rates_are_kept_resampled_or_given() {
    let texts = ["0.0417083", "0.001", "30"].map(|frame_time| bow(1.0, frame_time));
    let folder = folder(&[("film.bvh", &texts[0]), ("fast.bvh", &texts[1]), ("fps.bvh", &texts[2])]);
    done(folder.path(), &["encode", "film.bvh", "-o", "film.mclip"]);
    assert_eq!(info(folder.path(), "film.mclip")["fps"], 24_000.0 / 1001.0);
    let (success, _, refused) = run(folder.path(), &["encode", "fast.bvh", "-o", "fast.mclip"]);
    assert!(
        !success && refused.contains("the rate is 1000 frames per second") && refused.contains("--fps"),
        "{refused}"
    );
    // 90 frames of a thousandth are six of a sixtieth.
    let (_, told) = done(folder.path(), &["encode", "fast.bvh", "--fps", "60", "-o", "thin.mclip"]);
    assert!(told.contains("fast.bvh: resampled from 1000 to 60 frames a second"), "{told}");
    let thin = info(folder.path(), "thin.mclip");
    assert_eq!((&thin["fps"], &thin["frames"]), (&60.0.into(), &6.into()));
    done(folder.path(), &["encode", "fast.bvh", "--rate", "100", "-o", "slow.mclip"]);
    let slow = info(folder.path(), "slow.mclip");
    assert_eq!((&slow["fps"], &slow["frames"]), (&100.0.into(), &90.into()));
    let (_, told) = done(folder.path(), &["info", "fps.bvh"]);
    assert!(
        told.contains("the frame time is 30 s, which looks like frames per second: if it is, give --rate 30"),
        "{told}"
    );
}

#[test]
fn info_says_what_a_recording_holds() {
    let mut text = bow(1.0, "0.0333333");
    // A T-pose in front, and the other way to write one joint's rotation in the middle.
    text = text.replace("0 90 0 0 0 0 0 0 0\n", "0 90 0 0 0 0 0 95 0\n");
    let rows: Vec<&str> = text.lines().collect();
    let values: Vec<f64> = rows[rows.len() - 40].split(' ').map(|value| value.parse().unwrap()).collect();
    let flipped = format!(
        "0 90 0 {} {} {} {} {} {}",
        values[3] + 180.0,
        180.0 - values[4],
        values[5] + 180.0,
        values[6],
        values[7],
        values[8]
    );
    let text = text.replace(rows[rows.len() - 40], &flipped);
    let folder = folder(&[("walk.bvh", &text)]);
    let (out, _) = done(folder.path(), &["info", "walk.bvh"]);
    assert!(out.contains("walk.bvh: motion, 90 frames at 30 fps, 3.00 s"), "{out}");
    assert!(out.contains("frame 0 is apart from the others (Spine.rx jumps by"), "{out}");
    assert!(out.contains("--frames 1.. leaves it out"), "{out}");
    assert!(out.contains("Hips: all three angles flip 2 times (first in frame 50)"), "{out}");
    let report = info(folder.path(), "walk.bvh");
    assert_eq!(report["flips"][0]["frames"], serde_json::json!([50, 51]));
    assert_eq!(report["channels"][3]["name"], "Hips.rz");
    assert_eq!(report["first_frame_jump"]["channel"], "Spine.rx");
}

#[test]
fn tables_and_moves_go_in_and_out() {
    let mut table = "time,head.ry,jaw\n".to_string();
    let mut recorded = "[".to_string();
    for frame in 0..100 {
        let angle = (TAU * f64::from(frame) / 50.0).sin();
        writeln!(table, "{},{},{}", f64::from(frame) / 50.0, 30.0 * angle, 10.0 * angle).unwrap();
        // Times that are uneven by up to a hundredth of a second.
        let time = f64::from(frame) / 50.0 + 0.003 * f64::from(frame % 4);
        let comma = if frame == 0 { "" } else { "," };
        write!(recorded, "{comma}{{\"t\": {time}, \"neck\": {}}}", 0.5 * (TAU * time).sin()).unwrap();
    }
    recorded += "]";
    let folder = folder(&[("head.csv", &table), ("nod.json", &recorded)]);
    let at = folder.path();
    let report = info(at, "head.csv");
    assert_eq!((&report["fps"], &report["frames"]), (&50.0.into(), &100.into()));
    done(at, &["encode", "head.csv", "-o", "head.mclip"]);
    let (_, told) =
        done(at, &["encode", "nod.json", "--fps", "25", "--target-error", "0.01", "-o", "nod.mclip"]);
    assert!(told.contains("nod.json: 1 values taken as radians"), "{told}");
    assert!(told.contains("uneven") && told.contains("sampled at 25 frames a second"), "{told}");
    let nod = info(at, "nod.mclip");
    assert_eq!(nod["fps"], 25.0);
    let high = nod["channels"][0]["high"].as_f64().unwrap();
    assert!((high - 0.5_f64.to_degrees()).abs() < 0.5, "{high}");
}

/// Goals in, and out again: what the servos are told is what was in the table.
#[test]
fn a_table_of_goals_goes_to_a_puppet_and_back() {
    let puppet = "servo_hz = 50\nbaud = 1\n\
        [[joint]]\nname = 'nod'\nturn = { bone = 'head', against = 'chest', axis = 'x' }\nid = 1\nzero = 1900\ndirection = -1\n\
        range = [-60, 60]\nmax_speed = 300\n\
        [[joint]]\nname = 'jaw'\nchannel = 'mouth.rx'\noffset = 5\nid = 2\nrange = [-10, 40]\nmax_speed = 300\n";
    let mut table = "time,jaw.goal,nod.goal,tail\n".to_string();
    let mut bare = "time,jaw,nod\n".to_string();
    let goals = |frame: i32| {
        let angle = (TAU * f64::from(frame) / 50.0).cos();
        [(2200.0 - 100.0 * angle).round(), (1900.0 + 300.0 * angle).round()]
    };
    for frame in 0..100 {
        let [jaw, nod] = goals(frame);
        writeln!(table, "{},{jaw},{nod},1", f64::from(frame) / 50.0).unwrap();
        writeln!(bare, "{},{jaw},{nod}", f64::from(frame) / 50.0).unwrap();
    }
    let folder = folder(&[("goals.csv", &table), ("bare.csv", &bare), ("p.toml", puppet)]);
    let at = folder.path();
    for (name, options) in [("goals.csv", &[][..]), ("bare.csv", &["--values", "goals"])] {
        let encode = ["encode", name, "--puppet", "p.toml", "--target-degrees", "0.02", "-o", "a.mclip"];
        let (_, told) = done(at, &[&encode, options].concat());
        assert!(told.contains("columns taken as goals of servos"), "{told}");
        assert_eq!(
            told.contains("left out, since no joint follows them: tail.rx"),
            name == "goals.csv",
            "{told}"
        );
        done(at, &["decode", "a.mclip", "--puppet", "p.toml", "-o", "back.csv"]);
        let back = fs::read_to_string(at.join("back.csv")).unwrap();
        let mut lines = back.lines();
        assert_eq!(lines.next(), Some("time,nod.goal,jaw.goal"));
        for (line, frame) in lines.zip(0..) {
            let values: Vec<f64> = line.split(',').map(|field| field.parse().unwrap()).collect();
            let [jaw, nod] = goals(frame);
            assert!((values[1] - nod).abs() <= 1.0 && (values[2] - jaw).abs() <= 1.0, "{name}: {line}");
        }
    }
}

#[test]
fn a_clip_comes_out_in_every_format_and_goes_in_again() {
    let folder = folder(&[("bow.bvh", &bow(1.0, "0.0333333"))]);
    let at = folder.path();
    done(at, &["encode", "bow.bvh", "--target-error", "0.005", "-o", "bow.mclip"]);
    for name in ["out.bvh", "out.glb", "out.csv", "out.json"] {
        done(at, &["decode", "bow.mclip", "--skeleton", "bow.bvh", "-o", name]);
        let report = info(at, name);
        assert_eq!((&report["frames"], &report["fps"]), (&90.into(), &30.0.into()), "{name}");
        let channels = report["channels"].as_array().unwrap();
        let spine = channels.iter().find(|channel| channel["name"] == "Spine.rx").unwrap();
        // GLB has other Euler angles.
        if name != "out.glb" {
            let high = spine["high"].as_f64().unwrap();
            assert!((high - 10.0).abs() < 0.5, "{name}: {high}");
        }
        done(at, &["encode", name, "-o", "again.mclip"]);
    }
}
