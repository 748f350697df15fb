//! What fit makes of recordings: the same of the same motion, however it is written, and bones that point where they were
//! recorded to point.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{motion, trials, workspace};
use fit::{Fitted, fit};
use mocap::{Clip, export, import, sample};
use puppet_file::Puppet;
use std::fmt::Write as _;
use std::path::Path;

/// A goal of a Dynamixel X, in degrees.
const GOAL: f64 = 360.0 / 4096.0;

fn puppet(name: &str) -> Puppet {
    Puppet::read(&workspace().join("puppets").join(name)).unwrap()
}

fn fitted(puppet: &Puppet, clip: &Clip) -> Fitted {
    fit(&puppet.plan(clip).unwrap(), clip, false)
}

/// The largest difference between two fitted clips.
fn apart(one: &Fitted, other: &Fitted) -> f64 {
    let (one, other) = (&one.clip.motion.samples, &other.clip.motion.samples);
    assert_eq!(one.len(), other.len());
    one.iter().zip(other).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
}

/// The same motion as a BVH.
fn twin(clip: &Clip) -> Clip {
    let mut bytes = Vec::new();
    export::bvh::write(&mut bytes, &clip.skeleton, &clip.motion).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("twin.bvh");
    std::fs::write(&path, bytes).unwrap();
    import::load(&path, None, None).unwrap()
}

/// Two joints below the hips; the frames have the second one's angles in the order z, x, y.
fn bvh(frames: impl Iterator<Item = [f64; 3]>) -> Clip {
    let frames: Vec<_> = frames.collect();
    let mut text = format!(
        "HIERARCHY\nROOT hips\n{{\nOFFSET 0 90 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n\
         JOINT spine\n{{\nOFFSET 0 20 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{{\nOFFSET 0 15 0\n}}\n}}\n}}\n\
         MOTION\nFrames: {}\nFrame Time: 0.0333333\n",
        frames.len()
    );
    for [z, x, y] in frames {
        writeln!(text, "0 90 0 0 0 0 {z} {x} {y}").unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip.bvh");
    std::fs::write(&path, text).unwrap();
    import::load(&path, None, None).unwrap()
}

/// A puppet whose joints follow the three channels of the spine, each within these ends.
fn spine(ranges: [[f64; 2]; 3]) -> Puppet {
    let mut text = "servo_hz = 50\nbaud = 1\n".to_owned();
    for (id, (dof, range)) in ["rz", "rx", "ry"].into_iter().zip(ranges).enumerate() {
        write!(
            text,
            "[[joint]]\nname = '{dof}'\nchannel = 'spine.{dof}'\nid = {id}\nrange = {range:?}\nmax_speed = 400\n"
        )
        .unwrap();
    }
    Puppet::parse(Path::new("puppet.toml"), text).unwrap()
}

#[test]
fn amc_and_its_bvh_twin_give_the_same_goals() {
    let mut clips = vec![("the sample".to_owned(), sample::clip())];
    for (amc, asf) in trials().unwrap_or_default() {
        let clip = import::load(&amc, Some(&asf), None).unwrap();
        // The long ones would take minutes.
        if clip.motion.frames() < 1200 {
            clips.push((amc.display().to_string(), clip));
        }
    }
    for (name, clip) in clips {
        let twin = twin(&clip);
        for puppet in ["figure-6.toml", "figure-12.toml"].map(puppet) {
            let apart = apart(&fitted(&puppet, &clip), &fitted(&puppet, &twin));
            assert!(apart < GOAL, "{name}: {apart} degrees");
        }
    }
}

#[test]
fn angles_from_0_to_360_are_the_same_wherever_they_start() {
    let puppet = spine([[-60.0, 60.0]; 3]);
    let swing = |shift: f64| (0..90).map(move |frame| (f64::from(frame) / 9.0 + shift).sin() * 20.0);
    for shift in [1.0, -1.0] {
        let plain = fitted(&puppet, &bvh(swing(shift).map(|angle| [0.0, angle, 0.0])));
        let written = fitted(&puppet, &bvh(swing(shift).map(|angle| [0.0, angle.rem_euclid(360.0), 0.0])));
        assert!(apart(&plain, &written) < 1e-6);
        assert!(plain.report.joints.iter().all(|joint| joint.out_of_range.is_none()));
        let [low, high] = plain.report.joints[1].fitted;
        assert!((-20.1..-19.0).contains(&low) && (19.0..20.1).contains(&high), "{low} {high}");
    }
}

/// Angles of a smooth rotation that crosses 90 degrees of the second axis, as a program writes them that keeps that one
/// within 90: beyond it all three flip.
#[test]
fn flips_that_the_pose_does_not_show_move_nothing() {
    let angles = |frame: u32| [5.0, 70.0 + 30.0 * (f64::from(frame) / 15.0).sin(), 3.0];
    let flipped = |angles: [f64; 3]| match angles {
        [z, x, y] if x > 90.0 => [z - 180.0, 180.0 - x, y + 180.0],
        same => same,
    };
    let ranges = [[-30.0, 30.0], [0.0, 120.0], [-30.0, 30.0]];
    let plain = fitted(&spine(ranges), &bvh((0..120).map(angles)));
    let written = fitted(&spine(ranges), &bvh((0..120).map(|frame| flipped(angles(frame)))));
    assert!(apart(&plain, &written) < 1e-6);
    assert!(
        written.report.joints.iter().all(|joint| joint.out_of_range.is_none() && joint.too_fast.is_none())
    );
    // A clip whose every frame is the flipped one: the joints together can do its twin alone.
    let all = bvh((0..120).map(|frame| {
        let [z, x, y] = angles(frame);
        [z + 180.0, 180.0 - x, y - 180.0]
    }));
    assert!(apart(&plain, &fitted(&spine(ranges), &all)) < 1e-6);
}

/// The figures of docs/RESULTS.md: where the bones of other people's recordings point.
#[test]
fn bones_point_where_they_were_recorded_to_point() {
    let Some(folder) = motion() else { return };
    let bvh = |name: &str| import::load(&folder.join("bvh").join(name), None, None).unwrap();
    let cmu = |trial: &str| {
        let (subject, _) = trial.split_once('_').unwrap();
        let asf = folder.join("cmu").join(subject).with_extension("asf");
        import::load(&folder.join("cmu").join(trial).with_extension("amc"), Some(&asf), None).unwrap()
    };
    let clips = [
        ("bandai_wave_positions", bvh("bandai_wave_positions.bvh")),
        ("cmu_02_02_cgspeed", bvh("cmu_02_02_cgspeed.bvh")),
        ("cmu_61_04_daz", bvh("cmu_61_04_daz.bvh")),
        ("games105_walk60_metres", bvh("games105_walk60_metres.bvh")),
        ("rokoko_jesse_dance_fingers", bvh("rokoko_jesse_dance_fingers.bvh")),
        ("test_freebvh_fingers", bvh("test_freebvh_fingers.bvh")),
        ("CMU 02_01", cmu("02_01")),
        ("CMU 05_03", cmu("05_03")),
        ("CMU 49_04", cmu("49_04")),
    ];
    for name in ["figure-6.toml", "figure-12.toml"] {
        for (clip_name, clip) in &clips {
            let report = fitted(&puppet(name), clip).report;
            let bones = report.bones;
            let mean = bones.iter().map(|bone| bone.mean).sum::<f64>() / bones.len() as f64;
            let worst = bones.iter().max_by(|one, other| one.worst.total_cmp(&other.worst)).unwrap();
            // What is beyond a range is told; what is within all ranges is followed.
            let short = report.joints.iter().filter(|joint| joint.out_of_range.is_some()).count();
            println!(
                "{name}, {clip_name}: mean {mean:.1}, worst {:.1} ({}), {short} joints out of range",
                worst.worst, worst.bone
            );
            assert!(mean < 10.0, "{name}, {clip_name}: {bones:#?}");
            if short == 0 {
                assert!(mean < 1.5, "{name}, {clip_name}: {bones:#?}");
            }
        }
    }
}
