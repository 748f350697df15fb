//! GLB: the animation of a binary glTF 2.0 file, as Blender and Mixamo's converters write it.
//!
//! Format: "glTF 2.0 Specification" (Khronos, 2021), sections 3.5 (nodes), 3.6 (accessors), 3.11 (animations) and 4 (GLB).
//! Lengths in it are metres. All data must be in the file itself: a `.gltf` with files beside it is not read.

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::bones::set_bones;
use super::error::ImportError;
use super::imported::Imported;
use super::names::Names;
use super::rate;
use crate::angles::{self, IDENTITY};
use crate::clip::Clip;
use crate::motion::Motion;
use crate::quaternion;
use crate::skeleton::{Channel, Dof, Joint, Origin, Skeleton};

const CM_PER_METRE: f64 = 100.0;

/// Most values in the motion that is made: a small file may say that it lasts for years.
const MOST_VALUES: f64 = 5e7;

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Document {
    nodes: Vec<Node>,
    animations: Vec<Animation>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<BufferView>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Node {
    name: Option<String>,
    children: Vec<usize>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
    matrix: Option<Value>,
    mesh: Option<usize>,
}

#[derive(Deserialize)]
struct Animation {
    name: Option<String>,
    channels: Vec<AnimationChannel>,
    samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
struct AnimationChannel {
    sampler: usize,
    target: Target,
}

#[derive(Deserialize)]
struct Target {
    node: Option<usize>,
    path: String,
}

#[derive(Deserialize)]
struct Sampler {
    input: usize,
    output: usize,
    #[serde(default)]
    interpolation: Interpolation,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Interpolation {
    #[default]
    Linear,
    Step,
    CubicSpline,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    count: usize,
    sparse: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

/// Parses a file: `file` is its name for messages. `fps` is the rate at which the animation is sampled; without it the rate
/// of its keys, or 30 where they are sparse.
///
/// The first animation is read, of the tree of nodes that its first channel is in; what is left out is told. A joint is a
/// node, its rotation is written as Z, Y, X Euler angles, and rotations of nodes that stand still are channels too, since
/// glTF has no other rest pose. Scales are applied to lengths, as their mean where they are not the same in all directions.
///
/// # Errors
/// What was found and expected in the file.
pub fn parse(bytes: &[u8], file: &str, fps: Option<f64>) -> Result<Imported, ImportError> {
    read(bytes, fps).map_err(|(found, expected)| ImportError::File {
        file: file.to_string(),
        found,
        expected: expected.to_string(),
    })
}

type Wrong = (String, &'static str);

fn read(bytes: &[u8], fps: Option<f64>) -> Result<Imported, Wrong> {
    let (json, data) = chunks(bytes).ok_or(("something else".to_string(), "a binary glTF 2.0 file (GLB)"))?;
    let document: Document = section(json)?;
    let Some(animation) = document.animations.first() else {
        return Err(("no animation".to_string(), "one (in Blender: an action, and Export, Animation)"));
    };
    let mut notes = Vec::new();
    if document.animations.len() > 1 {
        let name = animation.name.as_deref().unwrap_or("without a name").escape_debug().to_string();
        notes.push(format!("{} animations: the first ({name}) is taken", document.animations.len()));
    }
    let tracks = tracks(&document, animation, data)?;
    let parents = parents(&document.nodes)?;
    let Some(first) = tracks.iter().position(|track| track.rotation.is_some() || track.translation.is_some())
    else {
        return Err((
            "an animation that moves nothing".to_string(),
            "one with rotations or translations of nodes",
        ));
    };
    let tree = Tree::of(&document.nodes, &parents, &tracks, first, &mut notes);
    let (skeleton, sources) = tree.skeleton(&document.nodes, &tracks, &mut notes);
    if skeleton.channels.is_empty() {
        return Err(("nodes that do not turn".to_string(), "rotations"));
    }
    let (start, fps, frames) = timing(&tracks, fps, skeleton.channels.len(), &mut notes)?;
    let mut samples = Vec::with_capacity(frames * skeleton.channels.len());
    for frame in 0..frames {
        let time = start + frame as f64 / fps;
        for source in &sources {
            source.sample(&document.nodes[source.node], &tracks[source.node], time, &mut samples);
        }
    }
    let mut motion = Motion { fps, channels: skeleton.channels.len(), samples };
    motion.unflip(&skeleton);
    let mut clip = Clip { skeleton, motion };
    set_bones(&mut clip.skeleton, &mut clip.motion, &mut notes);
    Ok(Imported { clip, has_rate: true, notes })
}

fn section<T: DeserializeOwned>(json: &[u8]) -> Result<T, Wrong> {
    serde_json::from_slice(json).map_err(|error| (format!("{error}"), "the JSON of glTF 2.0"))
}

/// The JSON and the binary chunk.
fn chunks(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    if !bytes.starts_with(b"glTF") || word(4)? != 2 || bytes.get(16..20)? != b"JSON" {
        return None;
    }
    let end = 20_usize.checked_add(word(12)?)?;
    let json = bytes.get(20..end)?;
    let data = match word(end) {
        Some(length) if bytes.get(end + 4..end + 8) == Some(b"BIN\0") => {
            bytes.get(end + 8..)?.get(..length)?
        }
        _ => &[],
    };
    Some((json, data))
}

/// The numbers of an accessor, of which an element has `width`.
fn numbers(document: &Document, accessor: usize, width: usize, data: &[u8]) -> Option<Vec<f64>> {
    let accessor = document.accessors.get(accessor)?;
    let view = document.buffer_views.get(accessor.buffer_view?)?;
    if view.buffer != 0 || accessor.sparse.is_some() {
        return None;
    }
    let size = match accessor.component_type {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5126 => 4,
        _ => return None,
    };
    let view_bytes = data.get(view.byte_offset..)?.get(..view.byte_length)?.get(accessor.byte_offset..)?;
    let stride = view.byte_stride.unwrap_or(size * width);
    if stride < size * width || accessor.count > view_bytes.len() {
        return None;
    }
    let mut found = Vec::with_capacity(accessor.count * width);
    for element in 0..accessor.count {
        let element = view_bytes.get(element.checked_mul(stride)?..)?.get(..size * width)?;
        for part in element.chunks_exact(size) {
            // Whole numbers stand for -1 to 1, or 0 to 1.
            let value = match (accessor.component_type, part) {
                (5120, &[a]) => (f64::from(a as i8) / 127.0).max(-1.0),
                (5121, &[a]) => f64::from(a) / 255.0,
                (5122, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])) / 32767.0).max(-1.0),
                (5123, &[a, b]) => f64::from(u16::from_le_bytes([a, b])) / 65535.0,
                (_, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
                _ => return None,
            };
            found.push(Some(value).filter(|value| value.is_finite())?);
        }
    }
    Some(found)
}

/// Values of a node over time.
struct Keys<const N: usize> {
    times: Vec<f64>,
    /// One for each time; for a cubic spline three: tangent before, value, tangent behind.
    values: Vec<[f64; N]>,
    interpolation: Interpolation,
}

impl<const N: usize> Keys<N> {
    fn read(document: &Document, sampler: &Sampler, data: &[u8]) -> Option<Self> {
        let times = numbers(document, sampler.input, 1, data)?;
        let values = numbers(document, sampler.output, N, data)?.as_chunks::<N>().0.to_vec();
        let each = if sampler.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let sound = !times.is_empty()
            && values.len() == times.len() * each
            && times.windows(2).all(|pair| pair[0] < pair[1]);
        sound.then_some(Self { times, values, interpolation: sampler.interpolation })
    }

    /// The value at a time; between two keys `between` is asked.
    fn at(&self, time: f64, between: impl Fn(&[f64; N], &[f64; N], f64) -> [f64; N]) -> [f64; N] {
        let spline = self.interpolation == Interpolation::CubicSpline;
        let value = |key: usize| if spline { &self.values[3 * key + 1] } else { &self.values[key] };
        let behind = self.times.partition_point(|&key| key <= time);
        if behind == 0 || behind == self.times.len() {
            return *value(behind.saturating_sub(1));
        }
        let (from, to) = (behind - 1, behind);
        let step = self.times[to] - self.times[from];
        let t = (time - self.times[from]) / step;
        match self.interpolation {
            Interpolation::Step => *value(from),
            Interpolation::Linear => between(value(from), value(to), t),
            Interpolation::CubicSpline => {
                let (out, into) = (&self.values[3 * from + 2], &self.values[3 * to]);
                let (a, b) = (value(from), value(to));
                let (t2, t3) = (t * t, t * t * t);
                std::array::from_fn(|k| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * a[k]
                        + step * (t3 - 2.0 * t2 + t) * out[k]
                        + (3.0 * t2 - 2.0 * t3) * b[k]
                        + step * (t3 - t2) * into[k]
                })
            }
        }
    }
}

/// What moves a node.
#[derive(Default)]
struct Track {
    translation: Option<Keys<3>>,
    rotation: Option<Keys<4>>,
}

fn tracks(document: &Document, animation: &Animation, data: &[u8]) -> Result<Vec<Track>, Wrong> {
    let mut tracks: Vec<Track> = Vec::new();
    tracks.resize_with(document.nodes.len(), Track::default);
    for (index, channel) in animation.channels.iter().enumerate() {
        let wrong = |what: &str| {
            (format!("{what} in channel {index} of the animation"), "times that ascend and a value for each")
        };
        let Some(node) = channel.target.node else { continue };
        let track = tracks.get_mut(node).ok_or_else(|| wrong("a node that there is not"))?;
        let sampler =
            animation.samplers.get(channel.sampler).ok_or_else(|| wrong("a sampler that there is not"))?;
        match channel.target.path.as_str() {
            "translation" => {
                track.translation =
                    Some(Keys::read(document, sampler, data).ok_or_else(|| wrong("other values"))?);
            }
            "rotation" => {
                track.rotation =
                    Some(Keys::read(document, sampler, data).ok_or_else(|| wrong("other values"))?);
            }
            _ => {}
        }
    }
    Ok(tracks)
}

/// The parent of each node.
fn parents(nodes: &[Node]) -> Result<Vec<Option<usize>>, Wrong> {
    let mut parents = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            match parents.get_mut(child) {
                Some(parent @ None) if child != index => *parent = Some(index),
                _ => return Err((format!("node {child} below node {index}"), "nodes that form trees")),
            }
        }
        if node.matrix.is_some() {
            return Err((format!("node {index} with a matrix"), "translation, rotation and scale"));
        }
    }
    Ok(parents)
}

/// The nodes that become joints: each with its joint's parent and the scale of what is above it.
struct Tree {
    nodes: Vec<(usize, Option<usize>, f64)>,
}

impl Tree {
    fn of(
        nodes: &[Node],
        parents: &[Option<usize>],
        tracks: &[Track],
        first: usize,
        notes: &mut Vec<String>,
    ) -> Self {
        let moves = |node: usize| tracks[node].rotation.is_some() || tracks[node].translation.is_some();
        // At most as many steps up as there are nodes, since a circle would have no end.
        let root_of = |node: usize| (0..nodes.len()).fold(node, |node, _| parents[node].unwrap_or(node));
        let root = root_of(first);
        let mut leads = vec![false; nodes.len()];
        for node in (0..nodes.len()).filter(|&node| moves(node)) {
            let mut above = Some(node);
            while let Some(node) = above.filter(|&node| !std::mem::replace(&mut leads[node], true)) {
                above = parents[node];
            }
        }
        let mut found = Vec::new();
        let mut pending = vec![(root, None, 1.0)];
        while let Some((node, parent, scale)) = pending.pop() {
            if nodes[node].mesh.is_some() && !leads[node] && parent.is_some() {
                continue;
            }
            let joint = found.len();
            found.push((node, parent, scale));
            let [x, y, z] = nodes[node].scale.unwrap_or([1.0; 3]);
            let below = scale * (x + y + z) / 3.0;
            pending.extend(nodes[node].children.iter().rev().map(|&child| (child, Some(joint), below)));
            // A circle of nodes would come back to its start.
            if found.len() > nodes.len() {
                break;
            }
        }
        let inside = found.iter().filter(|(node, _, _)| moves(*node)).count();
        let others = (0..nodes.len()).filter(|&node| moves(node)).count() - inside.min(nodes.len());
        if others > 0 {
            notes.push(format!("{others} moving nodes are in other trees, and are left out"));
        }
        let uneven = |node: &Node| {
            node.scale.is_some_and(|[x, y, z]| (x - y).abs().max((x - z).abs()) > 0.01 * x.abs())
        };
        if found.iter().any(|(node, _, _)| uneven(&nodes[*node])) {
            notes.push("a scale that is not the same in all directions: its mean is taken".to_string());
        }
        Self { nodes: found }
    }

    fn skeleton(&self, nodes: &[Node], tracks: &[Track], notes: &mut Vec<String>) -> (Skeleton, Vec<Source>) {
        let (mut joints, mut channels, mut sources) = (Vec::new(), Vec::new(), Vec::new());
        let mut names = Names::default();
        for (joint, &(node, parent, scale)) in self.nodes.iter().enumerate() {
            let found = nodes[node].name.clone().unwrap_or_else(|| format!("node_{node}"));
            let name = names.take(found.as_bytes(), 0);
            let turned = nodes[node].rotation.is_some_and(|[x, y, z, _]| [x, y, z] != [0.0; 3]);
            let moves = tracks[node].translation.is_some();
            let turns = tracks[node].rotation.is_some() || turned;
            let source = Source { node, cm: CM_PER_METRE * scale, moves, turns };
            let start = channels.len();
            let dofs = source.dofs().map(|dof| Channel {
                name: format!("{name}.{}", dof.name()),
                dof,
                joint,
                limits: None,
            });
            channels.extend(dofs);
            let rest = nodes[node].translation.unwrap_or_default();
            let above: Option<&Joint> = parent.map(|parent: usize| &joints[parent]);
            let level = above.map_or(1, |above| above.level.saturating_add(u8::from(channels.len() > start)));
            joints.push(Joint {
                name,
                parent,
                offset: if moves { [0.0; 3] } else { rest.map(|part| part * source.cm) },
                axis: IDENTITY,
                tail: [0.0; 3],
                channels: start..channels.len(),
                rotations: (start..channels.len())
                    .filter(|&channel| channels[channel].dof.is_rotation())
                    .collect(),
                level,
            });
            sources.push(source);
        }
        names.tell(notes);
        (Skeleton { joints, channels, origin: Origin::Bvh { cm_per_unit: 1.0 } }, sources)
    }
}

/// Where the channels of a joint come from.
struct Source {
    node: usize,
    cm: f64,
    moves: bool,
    turns: bool,
}

impl Source {
    fn dofs(&self) -> impl Iterator<Item = Dof> {
        let translations = if self.moves { &[Dof::Tx, Dof::Ty, Dof::Tz][..] } else { &[] };
        let rotations = if self.turns { &[Dof::Rz, Dof::Ry, Dof::Rx][..] } else { &[] };
        translations.iter().chain(rotations).copied()
    }

    fn sample(&self, node: &Node, track: &Track, time: f64, out: &mut Vec<f64>) {
        if let Some(keys) = &track.translation {
            let line =
                |from: &[f64; 3], to: &[f64; 3], t| std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
            out.extend(keys.at(time, line).map(|part| part * self.cm));
        }
        if self.turns {
            let rest = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
            let turn = track.rotation.as_ref().map_or(rest, |keys| keys.at(time, quaternion::slerp));
            out.extend(angles::euler_zyx(&quaternion::to_matrix(turn)));
        }
    }
}

/// Start, frames per second and number of frames.
fn timing(
    tracks: &[Track],
    fps: Option<f64>,
    channels: usize,
    notes: &mut Vec<String>,
) -> Result<(f64, f64, usize), Wrong> {
    let translations = tracks.iter().filter_map(|track| Some(&track.translation.as_ref()?.times));
    let rotations = tracks.iter().filter_map(|track| Some(&track.rotation.as_ref()?.times));
    let all: Vec<&Vec<f64>> = translations.chain(rotations).collect();
    let start = all.iter().map(|times| times[0]).fold(f64::INFINITY, f64::min);
    let end = all.iter().map(|times| times[times.len() - 1]).fold(f64::NEG_INFINITY, f64::max);
    let most = all.iter().copied().max_by_key(|times| times.len()).map_or(&[][..], Vec::as_slice);
    let mut own = rate::of_times(most).map(|(fps, _)| fps);
    if fps.is_none() && own.is_none_or(|own| own < 10.0) {
        notes.push(format!(
            "at most {} keys in {:.2} s: sampled at 30 frames a second",
            most.len(),
            end - start
        ));
        own = Some(30.0);
    }
    let fps = fps.or(own).unwrap_or(30.0);
    let frames = ((end - start) * fps + 1e-3).floor() + 1.0;
    if frames * channels as f64 > MOST_VALUES {
        return Err((format!("an animation of {} s", end - start), "one of a length that can be played"));
    }
    Ok((start, fps, frames as usize))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{export, sample};
    use serde_json::json;

    /// A file of these nodes, whose animation has the times 0, 0.5 and 1 s and for each channel the node, path,
    /// interpolation and values.
    fn file(nodes: &Value, channels: &[(usize, &str, &str, &[f32])]) -> Vec<u8> {
        let mut data: Vec<u8> = [0.0_f32, 0.5, 1.0].iter().flat_map(|time| time.to_le_bytes()).collect();
        let mut views = vec![json!({ "buffer": 0, "byteOffset": 0, "byteLength": 12 })];
        let mut accessors =
            vec![json!({ "bufferView": 0, "componentType": 5126, "count": 3, "type": "SCALAR" })];
        let (mut targets, mut samplers) = (Vec::new(), Vec::new());
        for (index, &(node, path, interpolation, values)) in channels.iter().enumerate() {
            let width = if path == "rotation" { 4 } else { 3 };
            views.push(json!({ "buffer": 0, "byteOffset": data.len(), "byteLength": 4 * values.len() }));
            accessors
                .push(json!({ "bufferView": index + 1, "componentType": 5126, "count": values.len() / width,
                "type": format!("VEC{width}") }));
            data.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            targets.push(json!({ "sampler": index, "target": { "node": node, "path": path } }));
            samplers.push(json!({ "input": 0, "output": index + 1, "interpolation": interpolation }));
        }
        let animation = json!({ "channels": targets, "samplers": samplers });
        let document = json!({ "asset": { "version": "2.0" }, "nodes": nodes, "animations": [animation],
            "accessors": accessors, "bufferViews": views, "buffers": [{ "byteLength": data.len() }] });
        let mut text = document.to_string();
        text += &" ".repeat(text.len().next_multiple_of(4) - text.len());
        let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, chunk) in [(b"JSON", text.as_bytes()), (b"BIN\0", &data)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        bytes
    }

    #[test]
    fn an_armature_in_centimetres_with_a_mesh_beside_it() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let nodes = json!([
            { "name": "Armature", "scale": [0.01, 0.01, 0.01], "children": [1, 3] },
            { "name": "Hips", "translation": [0, 95, 0], "children": [2] },
            { "name": "Spine", "translation": [0, 20, 0], "rotation": [0, 0, half, half] },
            { "name": "Body", "mesh": 0 },
        ]);
        // A quarter turn about x in the first half, and a step along z.
        let turn = [0.0, 0.0, 0.0, 1.0, half, 0.0, 0.0, half, half, 0.0, 0.0, half];
        let step = [0.0, 95.0, 0.0, 0.0, 95.0, 30.0, 0.0, 95.0, 30.0];
        let bytes = file(&nodes, &[(1, "rotation", "LINEAR", &turn), (1, "translation", "STEP", &step)]);
        let read = parse(&bytes, "x.glb", Some(4.0)).expect("an animation");
        let Clip { skeleton, motion } = read.clip;
        let names: Vec<&str> = skeleton.channels.iter().map(|channel| channel.name.as_str()).collect();
        // The hips stand still along x and y: the lengths of a bone.
        assert_eq!(names, ["Hips.tz", "Hips.rz", "Hips.ry", "Hips.rx", "Spine.rz", "Spine.ry", "Spine.rx"]);
        assert!(
            (skeleton.joints[1].offset[1] - 95.0).abs() < 1e-4
                && (skeleton.joints[2].offset[1] - 20.0).abs() < 1e-4
        );
        assert_eq!(skeleton.joints.len(), 3);
        let column = |channel: usize| motion.iter().map(move |row| row[channel]).collect::<Vec<_>>();
        let close = |found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} {expected:?}");
        };
        close(&column(0), &[0.0, 0.0, 30.0, 30.0, 30.0]);
        close(&column(3), &[0.0, 45.0, 90.0, 90.0, 90.0]);
        close(&column(4), &[90.0; 5]);
        // Three keys in a second say no rate.
        let read = parse(&bytes, "x.glb", None).expect("an animation");
        assert_eq!((read.clip.motion.fps, read.clip.motion.frames()), (30.0, 31));
        assert_eq!(read.notes[0], "at most 3 keys in 1.00 s: sampled at 30 frames a second");
    }

    #[test]
    fn a_cubic_spline_goes_through_its_keys_with_its_tangents() {
        let nodes = json!([{ "name": "a" }]);
        let flat = [0.0; 3];
        let values = [flat, [0.0; 3], flat, flat, [1.0, 2.0, 0.0], flat, flat, [0.0; 3], flat];
        let bytes = file(&nodes, &[(0, "translation", "CUBICSPLINE", values.as_flattened())]);
        let clip = parse(&bytes, "x.glb", Some(4.0)).expect("an animation").clip;
        let along: Vec<f64> = clip.motion.iter().map(|row| row[1]).collect();
        // Half-way between two keys with flat tangents is the middle.
        assert_eq!(along, [0.0, 100.0, 200.0, 100.0, 0.0]);
    }

    #[test]
    fn damaged_files_are_refused_or_read() {
        let mut clip = sample::clip();
        clip.motion.samples.truncate(4 * clip.motion.channels);
        let mut whole = Vec::new();
        export::glb::write(&mut whole, &clip.skeleton, &clip.motion).expect("a Vec takes it");
        for cut in (0..whole.len() - 1).step_by(7) {
            let error = parse(&whole[..cut], "x.glb", None).expect_err("a cut file").to_string();
            assert!(error.starts_with("x.glb: found ") && error.contains(", expected "), "{error}");
        }
        let mut seed = 0x2545_f491_4f6c_dd1d_u64;
        let mut random = move |below: usize| {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed % below as u64) as usize
        };
        for _ in 0..3000 {
            let mut damaged = whole.clone();
            for _ in 0..=random(3) {
                let at = random(damaged.len());
                damaged[at] = b"0123456789,:\"-e\0\xff"[random(17)];
            }
            // Whatever it is, the reader returns.
            let _ = parse(&damaged, "x.glb", None);
        }
    }
}
