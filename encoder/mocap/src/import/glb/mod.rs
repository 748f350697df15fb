//! glTF 2.0: the animation of a `.glb`, `.gltf`, `.vrm` or `.vrma`, as Blender, Mixamo's converters and VRM's write it.
//!
//! Format: "glTF 2.0 Specification" (Khronos, 2021), sections 3.5 (nodes), 3.6 (accessors), 3.11 (animations) and 4 (GLB).
//! Lengths in it are metres. A `.gltf` has its data in the text, or in files beside it.

mod buffers;
mod document;
mod keys;
mod tree;

use std::path::Path;

use serde::de::DeserializeOwned;

use super::bones::set_bones;
use super::error::ImportError;
use super::imported::Imported;
use super::rate;
use crate::clip::Clip;
use crate::motion::Motion;
use document::{Document, Node, Wrong};
use keys::Track;
use tree::Tree;

/// Most values in the motion that is made: a small file may say that it lasts for years.
const MOST_VALUES: f64 = 5e7;

/// Parses a file: `file` is its name for messages, `folder` where files beside it are. `fps` is the rate at which the animation is sampled; without it the rate
/// of its keys, or 30 where they are sparse.
///
/// The first animation is read, of the tree of nodes that its first channel is in; what is left out is told. A joint is a
/// node. At rest the nodes are turned as the file has them without an animation: there all channels that are rotations are
/// 0. A rotation is written as Z, Y, X Euler angles about the node's own axes at rest. Scales are applied to lengths, as their mean where they are not the same in all directions.
///
/// # Errors
/// What was found and expected in the file.
pub fn parse(
    bytes: &[u8],
    file: &str,
    folder: Option<&Path>,
    fps: Option<f64>,
) -> Result<Imported, ImportError> {
    read(bytes, folder, fps).map_err(|(found, expected)| ImportError::File {
        file: file.to_string(),
        found,
        expected: expected.to_string(),
    })
}

fn read(bytes: &[u8], folder: Option<&Path>, fps: Option<f64>) -> Result<Imported, Wrong> {
    let (json, binary) =
        buffers::chunks(bytes).ok_or(("something else".to_string(), "a glTF 2.0 file (.glb or .gltf)"))?;
    let mut document: Document = section(json)?;
    document.nodes.iter_mut().try_for_each(Node::split_matrix)?;
    let Some(animation) = document.animations.first() else {
        return Err(("no animation".to_string(), "one (in Blender: an action, and Export, Animation)"));
    };
    let mut notes = Vec::new();
    if document.animations.len() > 1 {
        let name = animation.name.as_deref().unwrap_or("without a name").escape_debug().to_string();
        notes.push(format!("{} animations: the first ({name}) is taken", document.animations.len()));
    }
    let buffers = buffers::load(&document, binary, folder)?;
    let tracks = keys::tracks(&document, animation, &buffers)?;
    let parents = tree::parents(&document.nodes)?;
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
            source.sample(&tracks[source.node], time, &mut samples);
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
    use crate::kinematics::Kinematics;
    use crate::{angles, export, quaternion, sample};
    use serde_json::{Value, json};

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
        let read = parse(&bytes, "x.glb", None, Some(4.0)).expect("an animation");
        let Clip { skeleton, motion } = read.clip;
        let names: Vec<&str> = skeleton.channels.iter().map(|channel| channel.name.as_str()).collect();
        // The hips stand still along x and y: the lengths of a bone.
        assert_eq!(names, ["Hips.tz", "Hips.rz", "Hips.ry", "Hips.rx"]);
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
        // Three keys in a second say no rate.
        let read = parse(&bytes, "x.glb", None, None).expect("an animation");
        assert_eq!((read.clip.motion.fps, read.clip.motion.frames()), (30.0, 31));
        assert_eq!(read.notes[0], "at most 3 keys in 1.00 s: sampled at 30 frames a second");
    }

    /// A leg whose nodes are turned at rest, and lean: what moves is seen from there.
    #[test]
    fn angles_are_those_from_the_pose_at_rest() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let sloping = [0.0, 0.6, 0.0, 0.8_f32];
        let nodes = json!([
            { "name": "Root", "rotation": [0, half, 0, half], "children": [1] },
            { "name": "Shin", "translation": [0, 1, 0], "rotation": sloping, "children": [2] },
            // A quarter turn about y, as a matrix, twice as large, 3 along x.
            { "name": "Foot", "matrix": [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 3, 0, 0, 1], "children": [3] },
            { "name": "Toes", "translation": [0, 0, 0.5] },
        ]);
        // At rest, then turned by a quarter about the shin's own z, at rest again.
        let turned = [0.6 * half, 0.6 * half, 0.8 * half, 0.8 * half];
        let turn = [sloping, turned, sloping].concat();
        let step = [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
        let bytes = file(&nodes, &[(1, "rotation", "LINEAR", &turn), (1, "translation", "LINEAR", &step)]);
        let clip = parse(&bytes, "x.glb", None, Some(2.0)).expect("an animation").clip;
        let names: Vec<&str> = clip.skeleton.channels.iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(names, ["Shin.tx", "Shin.tz", "Shin.rz", "Shin.ry", "Shin.rx"]);
        let near = |found: &[f64], expected: &[f64]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} {expected:?}");
        };
        near(&clip.motion.frame(0)[2..], &[0.0; 3]);
        near(&clip.motion.frame(1)[2..], &[90.0, 0.0, 0.0]);
        // As glTF has it, node in node: root a quarter about y, shin about y by the rest of 3-4-5.
        let mut kinematics = Kinematics::new(&clip.skeleton);
        let mut found = [[0.0; 3]; 4];
        let places = |turn: [f32; 4], aside: f64| {
            let root = quaternion::to_matrix([0.0, f64::from(half), 0.0, f64::from(half)]);
            let shin = angles::multiply(&root, &quaternion::to_matrix(turn.map(f64::from)));
            let foot = angles::multiply(&shin, &angles::about([0.0, 1.0, 0.0], 90.0));
            let at = angles::apply(&root, [100.0 * aside, 100.0, 0.0]);
            let add = |a: [f64; 3], b: [f64; 3]| std::array::from_fn::<f64, 3, _>(|k| a[k] + b[k]);
            let ankle = add(at, angles::apply(&shin, [300.0, 0.0, 0.0]));
            [[0.0; 3], at, ankle, add(ankle, angles::apply(&foot, [0.0, 0.0, 100.0]))]
        };
        for (frame, turn, aside) in [(0, sloping, 0.0), (1, turned, 0.0), (2, sloping, 1.0)] {
            kinematics.positions(clip.motion.frame(frame), &mut found);
            near(found.as_flattened(), places(turn, aside).as_flattened());
        }
        // And a BVH of it stands where it stood.
        let mut text = Vec::new();
        export::bvh::write(&mut text, &clip.skeleton, &clip.motion).expect("a BVH");
        let twin = crate::import::bvh::parse(&text, "x.bvh", 1.0, None).expect("our own BVH").clip;
        let mut again = vec![[0.0; 3]; twin.skeleton.joints.len()];
        Kinematics::new(&twin.skeleton).positions(twin.motion.frame(1), &mut again);
        kinematics.positions(clip.motion.frame(1), &mut found);
        near(again[..4].as_flattened(), found.as_flattened());
    }

    #[test]
    fn a_gltf_has_its_data_in_the_text_or_in_files_beside() {
        use base64::Engine as _;
        let bytes =
            file(&json!([{ "name": "a" }]), &[(0, "translation", "LINEAR", &[0.0, 1.0, 2.0].repeat(3))]);
        let (text, data) = buffers::chunks(&bytes).expect("a file");
        let whole = parse(&bytes, "x.glb", None, Some(2.0)).expect("an animation").clip;
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("my data.bin"), data.expect("data")).expect("a file");
        let base64 = base64::engine::general_purpose::STANDARD.encode(data.expect("data"));
        for uri in ["my%20data.bin".to_owned(), format!("data:application/gltf-buffer;base64,{base64}")] {
            let mut document: Value = serde_json::from_slice(text).expect("JSON");
            document["buffers"][0]["uri"] = json!(uri);
            // A picture's buffer, which nobody reads.
            let buffers = document["buffers"].as_array_mut().expect("buffers");
            buffers.push(json!({ "byteLength": 9, "uri": "picture.bin" }));
            let path = folder.path().join("x.gltf");
            std::fs::write(&path, document.to_string()).expect("a file");
            let read =
                crate::import::read(&path, &crate::import::Options { fps: Some(2.0), ..Default::default() });
            assert_eq!(read.expect("an animation").clip, whole);
            let error = parse(document.to_string().as_bytes(), "x.gltf", None, None);
            assert_eq!(error.is_ok(), uri.starts_with("data:"));
        }
    }

    #[test]
    fn a_cubic_spline_goes_through_its_keys_with_its_tangents() {
        let nodes = json!([{ "name": "a" }]);
        let flat = [0.0; 3];
        let values = [flat, [0.0; 3], flat, flat, [1.0, 2.0, 0.0], flat, flat, [0.0; 3], flat];
        let bytes = file(&nodes, &[(0, "translation", "CUBICSPLINE", values.as_flattened())]);
        let clip = parse(&bytes, "x.glb", None, Some(4.0)).expect("an animation").clip;
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
            let error = parse(&whole[..cut], "x.glb", None, None).expect_err("a cut file").to_string();
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
            let _ = parse(&damaged, "x.glb", None, None);
        }
    }
}
