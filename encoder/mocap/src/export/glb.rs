//! GLB (binary glTF 2.0): a tree of nodes with one animation, without a mesh, for Blender and other viewers.
//!
//! What [`import::glb`](crate::import::glb) reads. Blender (File, Import, glTF) shows the nodes as empties. Lengths are in
//! metres, rotations are quaternions, numbers are 32-bit floats.

use std::io::Write;

use serde_json::{Value, json};

use super::error::{ExportError, check_channels};
use super::pose::{local_position, local_rotation};
use crate::motion::Motion;
use crate::quaternion;
use crate::skeleton::{Dof, Joint, Skeleton};

const METRES_PER_CM: f64 = 0.01;

/// Writes a node for each joint, at its origin, and one for the end of a bone that nothing hangs on.
///
/// # Errors
/// A motion that does not fit the skeleton or is longer than a file of 4 GB, an output that fails.
pub fn write(out: &mut impl Write, skeleton: &Skeleton, motion: &Motion) -> Result<(), ExportError> {
    check_channels(skeleton, motion)?;
    let mut nodes: Vec<Value> = Vec::new();
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); skeleton.joints.len()];
    for (index, joint) in skeleton.joints.iter().enumerate() {
        if let Some(parent) = joint.parent {
            children[parent].push(index);
        }
    }
    let mut ends = Vec::new();
    for (index, joint) in skeleton.joints.iter().enumerate() {
        if children[index].is_empty() && joint.tail != [0.0; 3] {
            children[index].push(skeleton.joints.len() + ends.len());
            ends.push(
                json!({ "name": format!("{}.end", joint.name), "translation": joint.tail.map(metres) }),
            );
        }
        let mut node = json!({ "name": joint.name, "translation": joint.offset.map(metres) });
        if !children[index].is_empty() {
            node["children"] = json!(children[index]);
        }
        nodes.push(node);
    }
    nodes.extend(ends);
    let mut data = Data::default();
    let times: Vec<f64> = (0..motion.frames()).map(|frame| frame as f64 / motion.fps).collect();
    let input = data.push(&times, "SCALAR", 1);
    let (mut channels, mut samplers) = (Vec::new(), Vec::new());
    let mut animate = |node: usize, path: &str, output: usize| {
        channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
        samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
    };
    for (index, joint) in skeleton.joints.iter().enumerate() {
        if moves(skeleton, joint) {
            let positions = motion.iter().flat_map(|pose| local_position(skeleton, joint, pose).map(metres));
            animate(index, "translation", data.push(&positions.collect::<Vec<_>>(), "VEC3", 3));
        }
        if !joint.rotations.is_empty() {
            let mut previous = [0.0, 0.0, 0.0, 1.0];
            let mut rotations = Vec::with_capacity(4 * motion.frames());
            for pose in motion.iter() {
                let found = quaternion::of_matrix(&local_rotation(skeleton, joint, pose));
                // Of the two ways to write a rotation the nearer: some viewers do not take the shortest way between two.
                let dot: f64 = found.iter().zip(&previous).map(|(a, b)| a * b).sum();
                previous = if dot < 0.0 { found.map(|part| -part) } else { found };
                rotations.extend(previous);
            }
            animate(index, "rotation", data.push(&rotations, "VEC4", 4));
        }
    }
    let Data { bytes, views, accessors } = data;
    let document = json!({
        "asset": { "version": "2.0", "generator": "mocap" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": nodes,
        "animations": [{ "name": "motion", "channels": channels, "samplers": samplers }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len() }],
    });
    let mut text = document.to_string().into_bytes();
    // Chunks begin at multiples of four bytes.
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + bytes.len();
    let word = |length: usize| match u32::try_from(length) {
        Ok(length) => Ok(length.to_le_bytes()),
        Err(_) => Err(ExportError::Unsupported {
            format: "GLB",
            what: format!("{length} bytes"),
            expected: "less than 4 GB",
        }),
    };
    out.write_all(b"glTF\x02\0\0\0")?;
    out.write_all(&word(length)?)?;
    out.write_all(&word(text.len())?)?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    out.write_all(&word(bytes.len())?)?;
    out.write_all(b"BIN\0")?;
    Ok(out.write_all(&bytes)?)
}

fn metres(cm: f64) -> f64 {
    cm * METRES_PER_CM
}

/// Whether a joint's origin moves in its parent's axes.
fn moves(skeleton: &Skeleton, joint: &Joint) -> bool {
    let dofs = |joint: &Joint| joint.channels.clone().map(|channel| skeleton.channels[channel].dof);
    let lengthened =
        joint.parent.is_some_and(|parent| dofs(&skeleton.joints[parent]).any(|dof| dof == Dof::Length));
    lengthened || dofs(joint).any(|dof| !dof.is_rotation() && dof != Dof::Length)
}

/// The binary chunk, and what says where each list of numbers is in it.
#[derive(Default)]
struct Data {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Data {
    /// Adds numbers in elements of `width`; the accessor's index.
    fn push(&mut self, numbers: &[f64], kind: &str, width: usize) -> usize {
        const FLOAT: u32 = 5126;
        let start = self.bytes.len();
        self.bytes.extend(numbers.iter().flat_map(|&number| (number as f32).to_le_bytes()));
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start }));
        let mut accessor = json!({
            "bufferView": self.views.len() - 1, "componentType": FLOAT, "count": numbers.len() / width, "type": kind,
        });
        // Those of times must say their range.
        if width == 1 {
            let [first, last] =
                [numbers.first(), numbers.last()].map(|time| time.map_or(0.0, |&time| time as f32));
            accessor["min"] = json!([first]);
            accessor["max"] = json!([last]);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::glb;
    use crate::kinematics::Kinematics;
    use crate::sample;

    #[test]
    fn what_is_written_is_read() {
        let mut clip = sample::clip();
        clip.motion.samples.truncate(200 * clip.motion.channels);
        let mut out = Vec::new();
        write(&mut out, &clip.skeleton, &clip.motion).expect("a Vec takes it");
        let read = glb::parse(&out, "x.glb", None, None).expect("an animation");
        assert_eq!(read.notes, Vec::<String>::new());
        let read = read.clip;
        assert_eq!((read.motion.fps, read.motion.frames()), (60.0, 200));
        // A node is at the bone's start, which is its parent's end; a bone that ends the skeleton has a node there.
        let (mut ours, mut theirs) = (Kinematics::new(&clip.skeleton), Kinematics::new(&read.skeleton));
        let (a, b) = (ours.all_positions(&clip.motion), theirs.all_positions(&read.motion));
        let place =
            |name: &str| read.skeleton.joints.iter().position(|joint| joint.name == name).expect(name);
        for (bone, node) in [("spine", "head"), ("lhand", "lhand.end"), ("rtibia", "rfoot"), ("root", "root")]
        {
            let bone = clip.skeleton.joints.iter().position(|joint| joint.name == bone).expect(bone);
            for frame in 0..200 {
                let (at, found) = (a[frame * ours.joints() + bone], b[frame * theirs.joints() + place(node)]);
                let off = (0..3).map(|k| (at[k] - found[k]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-3, "{node} in frame {frame}: {at:?} {found:?}");
            }
        }
    }
}
