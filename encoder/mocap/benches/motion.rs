//! Speed of import and kinematics on one core: `cargo bench -p mocap`.
//!
//! Reads the trials of the folder that `BUNRAKU_MOTION` names, if it does, besides text that the embedded clip
//! makes. Each figure is the best of several runs.

use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use mocap::export::{amc as amc_out, amc::Rotations, bvh as bvh_out};
use mocap::import::{self, amc, bvh};
use mocap::kinematics::{Kinematics, sensitivity};
use mocap::metrics::Evaluator;
use mocap::sample;

/// Seconds of the fastest of at least five runs within half a second.
fn best(mut run: impl FnMut()) -> f64 {
    let start = Instant::now();
    let mut best = f64::INFINITY;
    let mut runs = 0;
    while runs < 5 || start.elapsed() < Duration::from_millis(500) {
        let begin = Instant::now();
        run();
        best = best.min(begin.elapsed().as_secs_f64());
        runs += 1;
    }
    best
}

fn report_parsing(name: &str, bytes: &[u8], run: impl FnMut()) {
    let seconds = best(run);
    let megabytes = bytes.len() as f64 / 1e6;
    println!("parse {name:30} {megabytes:7.2} MB {:7.0} MB/s", megabytes / seconds);
}

fn main() {
    let mut clip = sample::clip();
    // Digits as a recording prints them.
    for sample in &mut clip.motion.samples {
        *sample = format!("{sample:.5e}").parse().unwrap_or(*sample);
    }
    let frame = clip.motion.samples.clone();
    for _ in 0..20 {
        clip.motion.samples.extend_from_slice(&frame);
    }
    let mut text = Vec::new();
    if amc_out::write(&mut text, &clip.skeleton, &clip.motion, Rotations::AsTheyAre).is_ok() {
        report_parsing("embedded clip as AMC", &text, || {
            let _ = black_box(amc::parse(&text, "bench.amc", &clip.skeleton, None));
        });
    }
    let mut text = Vec::new();
    if bvh_out::write(&mut text, &clip.skeleton, &clip.motion).is_ok() {
        report_parsing("embedded clip as BVH", &text, || {
            let _ = black_box(bvh::parse(&text, "bench.bvh", 1.0, None));
        });
    }
    if let Some(folder) = std::env::var_os("BUNRAKU_MOTION") {
        trials(Path::new(&folder));
    }
}

fn trials(folder: &Path) {
    for name in ["02_07", "135_04"] {
        let subject = name.split('_').next().unwrap_or(name);
        let path = folder.join(format!("cmu/{name}.amc"));
        let skeleton = folder.join(format!("cmu/{subject}.asf"));
        let (Ok(bytes), Ok(clip)) = (std::fs::read(&path), import::load(&path, Some(&skeleton), None)) else {
            println!("{} is not there", path.display());
            continue;
        };
        report_parsing(&format!("{name}.amc"), &bytes, || {
            let _ = black_box(amc::parse(&bytes, name, &clip.skeleton, None));
        });
        let frames = clip.motion.frames() as f64;
        let mut kinematics = Kinematics::new(&clip.skeleton);
        let mut positions = vec![[0.0; 3]; kinematics.joints()];
        let seconds = best(|| {
            for pose in clip.motion.iter() {
                kinematics.positions(pose, black_box(&mut positions));
            }
        });
        println!("forward kinematics, 31 joints     {:7.2} us a frame", seconds / frames * 1e6);
        let seconds = best(|| {
            black_box(sensitivity(&clip.skeleton, &clip.motion));
        });
        println!("sensitivity                       {:7.2} us a frame", seconds / frames * 1e6);
        if let Ok(evaluator) = Evaluator::new(&clip.skeleton, &clip.motion) {
            let seconds = best(|| {
                black_box(evaluator.mean_joint_cm(&clip.motion.samples));
            });
            println!("mean joint error                  {:7.2} us a frame", seconds / frames * 1e6);
        }
    }
    for name in ["cmu_61_04_daz.bvh", "rokoko_jesse_dance_fingers.bvh"] {
        let Ok(bytes) = std::fs::read(folder.join("bvh").join(name)) else { continue };
        report_parsing(name, &bytes, || {
            let _ = black_box(bvh::parse(&bytes, name, 1.0, None));
        });
    }
}
