//! Units of length: named by the caller, or guessed from the size of the figure.
//!
//! BVH files do not say their unit. Known programs write metres, centimetres, millimetres, inches, or the unit of the CMU
//! database (an inch / 0.45). The guess is the one that brings the figure nearest to the height of a person.

use std::str::FromStr;

use crate::clip::Clip;
use crate::kinematics::Kinematics;
use crate::skeleton::{Origin, Skeleton};

/// A unit of length.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Its name in the plural, for a sentence.
    pub name: String,
    /// Centimetres in it.
    pub cm: f64,
}

/// Names that are read, the plural, and centimetres.
const UNITS: [(&str, &str, f64); 7] = [
    ("m", "metres", 100.0),
    ("dm", "decimetres", 10.0),
    ("cm", "centimetres", 1.0),
    ("mm", "millimetres", 0.1),
    ("inch", "inches", 2.54),
    ("cmu", "units of the CMU database (5.64 cm)", 2.54 / 0.45),
    ("ft", "feet", 30.48),
];

/// The units that are guessed, and with which heights of the figure in centimetres. Metres, centimetres and millimetres are
/// far apart, and figures without legs or children are told too; inches and the CMU's unit are near the centimetre, where a
/// small puppet would be taken for a person, so that only an adult's height tells. So are decimetres, which MakeHuman has.
/// Retargeted figures in the CMU's unit are down to 1.4 m tall, and no other unit has an adult there. Feet are rare.
const GUESSED: [(&str, f64, f64); 6] = [
    ("m", 80.0, 270.0),
    ("cm", 80.0, 270.0),
    ("mm", 80.0, 270.0),
    ("dm", 142.0, 210.0),
    ("inch", 142.0, 210.0),
    ("cmu", 130.0, 210.0),
];

/// Height of a person, in centimetres, to which a guess comes nearest.
const PERSON: f64 = 170.0;

impl Unit {
    /// The centimetre.
    pub fn centimetre() -> Self {
        Self { name: "centimetres".to_string(), cm: 1.0 }
    }
}

impl FromStr for Unit {
    type Err = String;

    /// `m`, `dm`, `cm`, `mm`, `inch` or `in`, `ft`, `cmu`, and any of them with a number before: `2.5cm`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("found {text:?}, expected m, dm, cm, mm, inch, ft, cmu, or a length such as 2.5cm");
        let word = text.trim_start_matches(|letter: char| letter.is_ascii_digit() || letter == '.');
        let number = &text[..text.len() - word.len()];
        let number: f64 = if number.is_empty() { 1.0 } else { number.parse().map_err(|_| wrong())? };
        let word = if word.eq_ignore_ascii_case("in") { "inch" } else { word };
        let unit = UNITS.iter().find(|(name, _, _)| word.eq_ignore_ascii_case(name));
        let &(_, name, cm) = unit.ok_or_else(wrong)?;
        if !(number * cm).is_normal() {
            return Err(wrong());
        }
        let name = if number == 1.0 { name.to_string() } else { format!("units of {text}") };
        Ok(Self { name, cm: number * cm })
    }
}

/// The unit in which the figure has the height of a person, and that height in centimetres.
#[derive(Clone, Debug, PartialEq)]
pub struct Guess {
    /// The unit: the centimetre where no unit fits.
    pub unit: Unit,
    /// The figure's height in that unit, in centimetres.
    pub height_cm: f64,
    /// Whether the height is that of a person, and the joints those of one.
    pub sure: bool,
}

impl Guess {
    /// A sentence for a person who may know better.
    pub fn tell(&self) -> String {
        let Self { unit, height_cm, sure } = self;
        let metres = height_cm / 100.0;
        match sure {
            true => format!(
                "lengths guessed to be {}: the figure is {metres:.2} m tall (else give --unit)",
                unit.name
            ),
            false => format!(
                "no figure of a person by which to guess the unit: lengths taken as {}, {metres:.2} m tall (else give --unit)",
                unit.name
            ),
        }
    }
}

/// Height of the figure, in the unit of the clip's lengths. `root` is where the file puts its root at rest.
///
/// It is the greater of the extents along y and z (files differ in which is up, and a T-pose is as wide as it is high),
/// in the rest pose or in the first frame: some programs' rest pose has all bones along one axis, and a dancer may begin
/// on the floor. A figure without legs stands as high above the floor as its root.
pub fn height(clip: &Clip, root: [f64; 3]) -> f64 {
    let Clip { skeleton, motion } = clip;
    let mut first = motion.frame(0).to_vec();
    let start = |axis: usize| {
        let mut own = skeleton.joints[0].channels.clone();
        let channel = own.find(|&channel| {
            let dof = skeleton.channels[channel].dof;
            !dof.is_rotation() && dof.axis() == Some(axis)
        });
        channel.map_or(0.0, |channel| motion.frame(0)[channel])
    };
    let root: [f64; 3] = std::array::from_fn(|axis| if root[axis] == 0.0 { start(axis) } else { root[axis] });
    for channel in skeleton.joints[0].channels.clone() {
        if !skeleton.channels[channel].dof.is_rotation() {
            first[channel] = 0.0;
        }
    }
    let rest: Vec<f64> = (skeleton.channels.iter().zip(&first))
        .map(|(channel, &value)| if channel.dof.is_rotation() { 0.0 } else { value })
        .collect();
    let mut kinematics = Kinematics::new(skeleton);
    let mut points = vec![[0.0; 3]; kinematics.joints()];
    let mut height = 0.0_f64;
    for pose in [rest, first] {
        kinematics.positions(&pose, &mut points);
        for axis in [1, 2] {
            let along = points.iter().map(|point| point[axis] - points[0][axis]);
            let (low, high) = along.fold((0.0_f64, 0.0_f64), |(low, high), at| (low.min(at), high.max(at)));
            let legless = low > -0.2 * high;
            let floor = if legless && root[axis].abs() < 4.0 * high { root[axis].abs() } else { 0.0 };
            height = height.max(high - low.min(-floor));
        }
    }
    height
}

/// Guesses the unit of a clip whose lengths are still in the file's unit, by its [`height`].
pub fn guess(clip: &Clip, root: [f64; 3]) -> Guess {
    let height = height(clip, root);
    let off = |unit: &Unit| (height * unit.cm / PERSON).ln().abs();
    let fitting = GUESSED.iter().filter_map(|&(name, least, most)| {
        let unit: Unit = name.parse().ok()?;
        (least..=most).contains(&(height * unit.cm)).then_some(unit)
    });
    match fitting.min_by(|a, b| off(a).total_cmp(&off(b))) {
        Some(unit) if is_figure(&clip.skeleton) => Guess { height_cm: height * unit.cm, unit, sure: true },
        _ => Guess { unit: Unit::centimetre(), height_cm: height, sure: false },
    }
}

/// Whether the joints are those of a body: by a word in a name, else by their number and that of the limbs' ends.
fn is_figure(skeleton: &Skeleton) -> bool {
    const WORDS: [&str; 10] =
        ["hip", "pelvis", "spine", "chest", "torso", "neck", "head", "thigh", "leg", "foot"];
    let named = |name: &str| {
        let name = name.to_lowercase();
        WORDS.iter().any(|word| name.contains(word))
    };
    let joints = &skeleton.joints;
    let mut is_parent = vec![false; joints.len()];
    joints.iter().filter_map(|joint| joint.parent).for_each(|parent| is_parent[parent] = true);
    let ends = is_parent.iter().filter(|is_parent| !**is_parent).count();
    joints.iter().any(|joint| named(&joint.name)) || (joints.len() >= 15 && ends >= 5)
}

/// Makes centimetres of lengths that are in units of `cm` centimetres.
pub fn scale(clip: &mut Clip, cm: f64) {
    if cm == 1.0 {
        return;
    }
    let Clip { skeleton, motion } = clip;
    for joint in &mut skeleton.joints {
        joint.offset.iter_mut().chain(&mut joint.tail).for_each(|part| *part *= cm);
    }
    for (index, channel) in skeleton.channels.iter_mut().enumerate() {
        if channel.dof.is_rotation() {
            continue;
        }
        channel.limits = channel.limits.map(|(low, high)| (low * cm, high * cm));
        motion.samples.iter_mut().skip(index).step_by(motion.channels).for_each(|value| *value *= cm);
    }
    match &mut skeleton.origin {
        Origin::Asf { cm_per_unit, .. } | Origin::Bvh { cm_per_unit } => *cm_per_unit *= cm,
        Origin::Table => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::bvh;
    use crate::sample;

    #[test]
    fn units_by_name_and_by_length() {
        for (text, cm) in [
            ("m", 100.0),
            ("CM", 1.0),
            ("dm", 10.0),
            ("mm", 0.1),
            ("in", 2.54),
            ("inch", 2.54),
            ("cmu", 2.54 / 0.45),
            ("2.5cm", 2.5),
        ] {
            let unit: Unit = text.parse().expect(text);
            assert!((unit.cm - cm).abs() < 1e-12, "{text}: {unit:?}");
        }
        for text in ["", "1", "yard", "0cm", "1.2.3m", "-1m", "auto"] {
            let error = text.parse::<Unit>().expect_err(text);
            assert!(error.starts_with(&format!("found {text:?}, expected m, dm, cm")), "{error}");
        }
    }

    /// The embedded puppet, which is 60 cm high, as large as a person and in a unit of so many centimetres.
    fn person(cm_per_unit: f64) -> Clip {
        let mut clip = sample::clip();
        scale(&mut clip, 2.8 / cm_per_unit);
        clip
    }

    #[test]
    fn the_unit_in_which_the_figure_is_a_person() {
        for (name, _, _) in &GUESSED {
            let cm = name.parse::<Unit>().expect(name).cm;
            let guess = guess(&person(cm), [0.0; 3]);
            assert!(guess.sure && guess.unit.cm == cm, "{name}: {guess:?}");
            assert!((150.0..190.0).contains(&guess.height_cm), "{name}: {guess:?}");
        }
    }

    #[test]
    fn a_figure_without_legs_stands_on_the_floor() {
        let trunk = |scale: f64| {
            let [root, spine, end] = [90.0, 20.0, 15.0].map(|length| length * scale);
            let text = format!(
                "HIERARCHY\nROOT Hips\n{{\nOFFSET 0 {root} 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation \
                 Xrotation Yrotation\nJOINT Spine\n{{\nOFFSET 0 {spine} 0\nCHANNELS 1 Xrotation\nEnd Site\n{{\n\
                 OFFSET 0 {end} 0\n}}\n}}\n}}\nMOTION\nFrames: 1\nFrame Time: 0.01\n0 {root} 0 0 0 0 9\n"
            );
            bvh::parse(text.as_bytes(), "x.bvh", 1.0, None).expect("a clip").clip
        };
        for (scale, cm) in [(1.0, 1.0), (0.01, 100.0), (10.0, 0.1)] {
            let guess = guess(&trunk(scale), [0.0; 3]);
            assert!(guess.sure && guess.unit.cm == cm, "{guess:?}");
            assert!((guess.height_cm - 125.0).abs() < 1e-6, "{guess:?}");
        }
    }

    #[test]
    fn what_is_no_person_is_in_centimetres() {
        let text = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\nEnd Site\n{\nOFFSET 0 2 0\n}\n}\nMOTION\n\
            Frames: 1\nFrame Time: 0.01\n9\n";
        let clip = bvh::parse(text.as_bytes(), "x.bvh", 1.0, None).expect("a clip").clip;
        let guess = guess(&clip, [0.0; 3]);
        assert!(!guess.sure && guess.unit.cm == 1.0, "{guess:?}");
        // The embedded puppet, which is 55 cm high: as inches it would be a small adult.
        assert!(!super::guess(&sample::clip(), [0.0; 3]).sure);
    }
}
