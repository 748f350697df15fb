//! Prints where the joints of a recording are, frame by frame, as CSV in centimetres.
//!
//! `cargo run -p mocap --example positions -- walk.bvh > walk.csv`, or `-- walk.amc walker.asf`. Without a file, the
//! clip from formulas is printed.

use std::error::Error;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

use mocap::kinematics::Kinematics;
use mocap::{import, sample};

fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = std::env::args_os().skip(1).map(PathBuf::from);
    let clip = match paths.next() {
        Some(motion) => import::load(&motion, paths.next().as_deref(), None)?,
        None => sample::clip(),
    };
    let mut out = BufWriter::new(io::stdout().lock());
    write!(out, "time")?;
    for joint in &clip.skeleton.joints {
        write!(out, ",{0}.x,{0}.y,{0}.z", joint.name)?;
    }
    writeln!(out)?;
    let mut kinematics = Kinematics::new(&clip.skeleton);
    let mut positions = vec![[0.0; 3]; kinematics.joints()];
    for (frame, pose) in clip.motion.iter().enumerate() {
        kinematics.positions(pose, &mut positions);
        write!(out, "{:.4}", frame as f64 / clip.motion.fps)?;
        for [x, y, z] in &positions {
            write!(out, ",{x:.3},{y:.3},{z:.3}")?;
        }
        writeln!(out)?;
    }
    out.flush()?;
    Ok(())
}
