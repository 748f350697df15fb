//! Parts by the names of joints: one table of what naming schemes call them.
//!
//! Upper and lower case, spaces, `_`, `-`, `.` and prefixes (`mixamorig:`, `Bip01 `, `J_Bip_`) do not matter.
//! A side stands in front or behind: `LeftArm`, `lradius`, `clavicle_l`, `Bip01 L Thigh`.

use super::part::{Part, Side};
use crate::skeleton::Skeleton;

/// A part of a side, and what it is called, the surest name first.
///
/// Order matters. A name that schemes use for two parts stands with both, and the part that comes first takes it
/// where the skeleton has no surer name for it: `LeftShoulder` turns the upper arm, unless there is a `LeftArm`.
type Sided = (fn(Side) -> Part, &'static [&'static str]);

const SIDED: [Sided; 8] = [
    (
        Part::UpperArm,
        &[
            "upperarm",
            "uparm",
            "uarm",
            "arm",
            "humerus",
            "shldr",
            "shldrbend",
            "shoulder",
            "shoulderjoint",
            "bicep",
        ],
    ),
    (Part::Clavicle, &["clavicle", "collar", "collarbone", "torsoclavicle", "shoulder", "innershoulder"]),
    (
        Part::Forearm,
        &["forearm", "lowerarm", "lowarm", "loarm", "farm", "forearmbend", "radius", "elbow", "elbowjoint"],
    ),
    (Part::Hand, &["wrist", "wristjoint", "hand", "palm"]),
    (
        Part::Thigh,
        &["thigh", "upleg", "upperleg", "uleg", "femur", "thighbend", "hip", "hipjoint", "legupper"],
    ),
    (
        Part::Shin,
        &["shin", "lowerleg", "lowleg", "loleg", "calf", "tibia", "leg", "knee", "kneejoint", "leglower"],
    ),
    (Part::Foot, &["ankle", "anklejoint", "foot"]),
    (Part::Toes, &["toes", "toebase", "toe", "toe0", "toejoint", "ball", "foot"]),
];

/// What the parts of the middle are called. Of the spine only the ends: the bones between are found by what hangs on
/// them.
const MIDDLE: [(Part, &[&str]); 5] = [
    (Part::Hips, &["hips", "hip", "pelvis", "root", "rootjoint", "pelvisjoint", "waist"]),
    (
        Part::Spine,
        &[
            "spine",
            "spine0",
            "spine01",
            "spine1",
            "lowerback",
            "abdomen",
            "abdomenlower",
            "ab",
            "l5",
            "waist",
        ],
    ),
    (Part::Chest, &["chest", "upperchest", "thorax", "torso", "t8", "spine3", "spine2"]),
    (Part::Neck, &["neck", "lowerneck", "neck01", "neck1", "necklower", "neckbase"]),
    (Part::Head, &["head", "torsohead", "headjoint", "skull"]),
];

/// The joint of each part that has a known name, in the order of [`Part::ALL`].
///
/// The middle is told by structure where names would mislead: `Spine` is the lowest bone of the spine, and the
/// chest the one on which both arms hang, whatever their numbers are.
pub fn find(skeleton: &Skeleton) -> [Option<usize>; Part::ALL.len()] {
    let readings: Vec<Vec<Reading>> = skeleton.joints.iter().map(|joint| readings(&joint.name)).collect();
    let mut found = [None; Part::ALL.len()];
    for side in Side::BOTH {
        for (part, aliases) in SIDED {
            found[part(side).index()] = first(&readings, Some(side), aliases, &found);
        }
    }
    for (part, aliases) in MIDDLE {
        found[part.index()] = first(&readings, None, aliases, &found);
    }
    found
}

/// A name without its side: `arm` of `LeftArm`.
struct Reading {
    side: Option<Side>,
    name: String,
    /// How many words in front were left out, and how many characters in front of those that are no letters: helpers
    /// are called `__UpLeg_L` beside `UpLeg_L`.
    dropped: [usize; 2],
}

/// The joint that has the first of these names, and the least in front of it.
fn first(
    readings: &[Vec<Reading>],
    side: Option<Side>,
    aliases: &[&str],
    taken: &[Option<usize>],
) -> Option<usize> {
    aliases.iter().find_map(|alias| {
        let candidates = readings.iter().enumerate().flat_map(|(joint, readings)| {
            let fitting = readings.iter().filter(|reading| reading.side == side && reading.name == *alias);
            fitting.map(move |reading| (reading.dropped, joint))
        });
        let free = |&(_, joint): &([usize; 2], usize)| !taken.contains(&Some(joint));
        candidates.filter(free).min().map(|(_, joint)| joint)
    })
}

/// All ways to read a joint's name.
fn readings(name: &str) -> Vec<Reading> {
    let name = name.rsplit(':').next().unwrap_or(name);
    let words: Vec<&str> =
        name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let marks = name.chars().take_while(|c| !c.is_alphanumeric()).count();
    let mut readings = Vec::new();
    for dropped in 0..words.len() {
        let name = words[dropped..].concat().to_lowercase();
        let name = name.strip_prefix("mixamorig").unwrap_or(&name);
        let mut push = |side, name: &str| {
            if !name.is_empty() {
                readings.push(Reading { side, name: name.to_owned(), dropped: [dropped, marks] });
            }
        };
        push(None, name);
        for (side, long, short) in [(Side::Left, "left", "l"), (Side::Right, "right", "r")] {
            for mark in [long, short] {
                if let Some(rest) = name.strip_prefix(mark) {
                    push(Some(side), rest);
                }
                if let Some(rest) = name.strip_suffix(mark) {
                    push(Some(side), rest);
                }
            }
        }
    }
    readings
}
