//! BVH (Biovision hierarchy): what [`import::bvh`](crate::import::bvh) reads.
//!
//! A BVH skeleton is written as it is. An ASF skeleton becomes one joint per bone at the bone's pivot, with
//! axes that are parallel to the world's at rest: the bone's C · R · C⁻¹ as Z, Y, X Euler angles.

use std::io::{self, Write};

use super::error::{ExportError, check_channels};
use super::number::write_number;
use super::pose::{length_channel, local_position, local_rotation};
use crate::angles::{self, IDENTITY};
use crate::import::bvh::CHANNEL_NAMES;
use crate::motion::Motion;
use crate::skeleton::Skeleton;
use crate::skeleton::{Dof, Origin};

/// Writes skeleton and motion.
///
/// Lengths of a BVH skeleton are in its file's unit, those of an ASF skeleton in centimetres; converted
/// values have six decimals.
///
/// # Errors
/// A motion that does not fit the skeleton, an ASF bone that changes its length where nothing hangs on it (an
/// `End Site` is fixed), an output that fails.
pub fn write(out: &mut impl Write, skeleton: &Skeleton, motion: &Motion) -> Result<(), ExportError> {
    check_channels(skeleton, motion)?;
    let children = children(skeleton);
    // A BVH's joints are along the world's axes at rest.
    let is_straight = skeleton.joints.iter().all(|joint| joint.axis == IDENTITY);
    let nodes: Vec<Node> = match skeleton.origin {
        Origin::Bvh { .. } | Origin::Table if is_straight => {
            let cm_per_unit = skeleton.origin.cm_per_unit();
            (0..skeleton.joints.len()).map(|joint| Node::direct(skeleton, joint, cm_per_unit)).collect()
        }
        Origin::Asf { .. } | Origin::Bvh { .. } | Origin::Table => {
            let nodes = (0..skeleton.joints.len())
                .map(|joint| Node::converted(skeleton, joint, children[joint].is_empty()));
            nodes.collect::<Result<_, _>>()?
        }
    };
    let mut hierarchy = Hierarchy { skeleton, nodes: &nodes, children };
    hierarchy.write(out)?;
    writeln!(out, "MOTION\nFrames: {}", motion.frames())?;
    write!(out, "Frame Time: ")?;
    write_number(out, 1.0 / motion.fps)?;
    out.write_all(b"\n")?;
    let mut values = Vec::new();
    for pose in motion.iter() {
        values.clear();
        for node in &nodes {
            node.values(skeleton, pose, &mut values);
        }
        for (index, &value) in values.iter().enumerate() {
            out.write_all(if index == 0 { b"" } else { b" " })?;
            write_number(out, value)?;
        }
        out.write_all(b"\n")?;
    }
    Ok(())
}

fn children(skeleton: &Skeleton) -> Vec<Vec<usize>> {
    let mut children = vec![Vec::new(); skeleton.joints.len()];
    for (index, joint) in skeleton.joints.iter().enumerate() {
        if let Some(parent) = joint.parent {
            children[parent].push(index);
        }
    }
    children
}

/// A joint of the file.
struct Node {
    joint: usize,
    offset: [f64; 3],
    channels: Vec<Dof>,
    /// Of an ASF leaf: where its bone ends.
    end: Option<[f64; 3]>,
    /// Centimetres in the file's unit of length.
    cm_per_unit: f64,
    converted: bool,
}

const EULER: [Dof; 3] = [Dof::Rz, Dof::Ry, Dof::Rx];
const POSITION: [Dof; 3] = [Dof::Tx, Dof::Ty, Dof::Tz];

impl Node {
    fn direct(skeleton: &Skeleton, index: usize, cm_per_unit: f64) -> Self {
        let joint = &skeleton.joints[index];
        Self {
            joint: index,
            offset: joint.offset.map(|part| part / cm_per_unit),
            channels: joint.channels.clone().map(|channel| skeleton.channels[channel].dof).collect(),
            end: None,
            cm_per_unit,
            converted: false,
        }
    }

    fn converted(skeleton: &Skeleton, index: usize, leaf: bool) -> Result<Self, ExportError> {
        let joint = &skeleton.joints[index];
        if leaf && length_channel(skeleton, joint).is_some() {
            return Err(ExportError::Unsupported {
                format: "BVH",
                what: format!("bone `{}`, which ends the skeleton and changes its length", joint.name),
                expected: "bones of a fixed length there",
            });
        }
        let lengthened =
            joint.parent.is_some_and(|parent| length_channel(skeleton, &skeleton.joints[parent]).is_some());
        let translated = joint.channels.clone().any(|channel| {
            let dof = skeleton.channels[channel].dof;
            !dof.is_rotation() && dof != Dof::Length
        });
        let moves = joint.parent.is_none() || lengthened || translated;
        let channels = if moves { [POSITION, EULER].concat() } else { EULER.to_vec() };
        Ok(Self {
            joint: index,
            // Readers differ on whether a position replaces OFFSET or adds to it: zero serves both.
            offset: if moves { [0.0; 3] } else { joint.offset.map(rounded) },
            channels,
            end: leaf.then(|| joint.tail.map(rounded)),
            cm_per_unit: 1.0,
            converted: true,
        })
    }

    fn values(&self, skeleton: &Skeleton, pose: &[f64], out: &mut Vec<f64>) {
        let joint = &skeleton.joints[self.joint];
        if self.converted {
            if self.channels.len() > EULER.len() {
                out.extend(local_position(skeleton, joint, pose).map(rounded));
            }
            out.extend(angles::euler_zyx(&local_rotation(skeleton, joint, pose)).map(rounded));
            return;
        }
        out.extend(joint.channels.clone().map(|channel| {
            let rotation = skeleton.channels[channel].dof.is_rotation();
            if rotation { pose[channel] } else { pose[channel] / self.cm_per_unit }
        }));
    }
}

fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

struct Hierarchy<'a> {
    skeleton: &'a Skeleton,
    nodes: &'a [Node],
    children: Vec<Vec<usize>>,
}

impl Hierarchy<'_> {
    /// Depth first without recursion, so that no skeleton is too deep. Channels must come in the order of the
    /// joints, which is depth-first already.
    fn write(&mut self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "HIERARCHY")?;
        let mut open: Vec<usize> = Vec::new();
        for (index, joint) in self.skeleton.joints.iter().enumerate() {
            while open.last().is_some_and(|&last| Some(last) != joint.parent) {
                open.pop();
                writeln!(out, "{}}}", "\t".repeat(open.len()))?;
            }
            self.begin(out, index, open.len())?;
            open.push(index);
        }
        for depth in (0..open.len()).rev() {
            writeln!(out, "{}}}", "\t".repeat(depth))?;
        }
        Ok(())
    }

    fn begin(&self, out: &mut impl Write, index: usize, depth: usize) -> io::Result<()> {
        let (joint, node) = (&self.skeleton.joints[index], &self.nodes[index]);
        let indent = "\t".repeat(depth);
        let end_site = node.channels.is_empty() && self.children[index].is_empty() && depth > 0;
        match depth {
            _ if end_site => writeln!(out, "{indent}End Site")?,
            0 => writeln!(out, "ROOT {}", joint.name)?,
            _ => writeln!(out, "{indent}JOINT {}", joint.name)?,
        }
        writeln!(out, "{indent}{{")?;
        self.offset(out, &indent, node.offset)?;
        if !end_site {
            write!(out, "{indent}\tCHANNELS {}", node.channels.len())?;
            for dof in &node.channels {
                let name = CHANNEL_NAMES.iter().find(|(other, _)| other == dof).map_or("", |(_, name)| name);
                write!(out, " {name}")?;
            }
            out.write_all(b"\n")?;
        }
        if let Some(end) = node.end {
            writeln!(out, "{indent}\tEnd Site\n{indent}\t{{")?;
            self.offset(out, &format!("{indent}\t"), end)?;
            writeln!(out, "{indent}\t}}")?;
        }
        Ok(())
    }

    fn offset(&self, out: &mut impl Write, indent: &str, offset: [f64; 3]) -> io::Result<()> {
        write!(out, "{indent}\tOFFSET")?;
        for part in offset {
            out.write_all(b" ")?;
            write_number(out, part)?;
        }
        out.write_all(b"\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::asf::tests::ODD;
    use crate::import::{asf, bvh};
    use crate::kinematics::Kinematics;

    fn written(skeleton: &Skeleton, motion: &Motion) -> Result<(Skeleton, Motion), ExportError> {
        let mut out = Vec::new();
        write(&mut out, skeleton, motion)?;
        let read = bvh::parse(&out, "x.bvh", 1.0, None).unwrap_or_else(|error| panic!("{error}"));
        Ok((read.clip.skeleton, read.clip.motion))
    }

    #[test]
    fn a_bvh_skeleton_comes_back_as_it_was() {
        let text = "HIERARCHY\nROOT a:b c\n{\nOFFSET 0 0 -2.5\nCHANNELS 3 Zrotation Yposition Xposition\nJOINT d\n{\n\
            OFFSET 1 2 3\nCHANNELS 0\nJOINT e\n{\nOFFSET 4 5 6\nCHANNELS 2 Yrotation Xrotation\nEnd Site\n{\nOFFSET 7 \
            8 9\n}\n}\n}\nJOINT f\n{\nOFFSET 1 1 1\nCHANNELS 1 Xrotation\n}\n}\nMOTION\nFrames: 2\nFrame Time: \
            0.0416667\n1 2.25 3 4 5 6\n7 8 9 10 11 -12.125\n";
        for cm_per_unit in [1.0, 2.54] {
            let clip = bvh::parse(text.as_bytes(), "x.bvh", cm_per_unit, None).expect("a clip").clip;
            let mut out = Vec::new();
            write(&mut out, &clip.skeleton, &clip.motion).expect("a Vec takes it");
            assert_eq!(bvh::parse(&out, "y.bvh", cm_per_unit, None).expect("a clip").clip, clip);
        }
    }

    #[test]
    fn an_asf_skeleton_keeps_its_positions() {
        // With a lengthening bone in the middle, translations below and every order of axes.
        let text =
            ODD.replace("dof tz rx l ry", "dof tz rx ry").replace("(-0.5 0.5) (-inf inf)", "(-0.5 0.5)");
        let skeleton = asf::parse(text.as_bytes(), "odd.asf").expect("a skeleton");
        let channels = skeleton.channels.len();
        let samples = (0..20 * channels).map(|index| ((index * 101) % 173) as f64 - 80.0).collect();
        let motion = Motion { fps: 24.0, channels, samples };
        let (bvh_skeleton, bvh_motion) = written(&skeleton, &motion).expect("a Vec takes it");
        assert_eq!((bvh_motion.fps, bvh_motion.frames()), (24.0, 20));
        let mut asf = Kinematics::new(&skeleton);
        let mut bvh = Kinematics::new(&bvh_skeleton);
        let (asf_at, bvh_at) = (asf.all_positions(&motion), bvh.all_positions(&bvh_motion));
        let at = |name: &str| bvh_skeleton.joints.iter().position(|joint| joint.name == name).expect(name);
        // A bone's end is where the next one starts, but for its translation, so the tip's end is compared.
        for (bone, end) in [("root", "root"), ("stiff", "stiff.end"), ("tip", "tip.end")] {
            let bone = skeleton.joints.iter().position(|joint| joint.name == bone).expect(bone);
            for frame in 0..20 {
                let (a, b) = (asf_at[frame * asf.joints() + bone], bvh_at[frame * bvh.joints() + at(end)]);
                for k in 0..3 {
                    assert!((a[k] - b[k]).abs() < 1e-4, "{end} in frame {frame}: {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn a_lengthening_leaf_is_refused() {
        let skeleton = asf::parse(ODD.as_bytes(), "odd.asf").expect("a skeleton");
        let channels = skeleton.channels.len();
        let error = written(&skeleton, &Motion { fps: 1.0, channels, samples: vec![0.0; channels] });
        assert_eq!(
            error.expect_err("a leaf with `l`").to_string(),
            "BVH cannot hold bone `tip`, which ends the skeleton and changes its length, expected bones of a \
             fixed length there"
        );
    }
}
