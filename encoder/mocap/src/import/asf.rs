//! ASF (Acclaim skeleton): units, root, bones and their hierarchy.
//!
//! Format: "Acclaim Skeleton File Definition V1.10" (M. Schafer, 1994) and "ASF line Details" (Vicon):
//! `order` and `dof` give the order of the values in AMC files and that of the rotations, the first being
//! applied first, about fixed axes; `axis` x y z ORDER is the bone's rest orientation, likewise.

use std::collections::{HashMap, HashSet};

use super::error::ImportError;
use super::text::{self, Lexer, quote};
use crate::angles::{self, Matrix};
use crate::skeleton::Skeleton;
use crate::skeleton::{Channel, Dof, Joint, Origin};

/// Centimetres in an inch: `length` in `:units` is the size of the file's unit of length, as a factor that
/// divides lengths to give inches (CMU: 0.45).
const CM_PER_INCH: f64 = 2.54;

/// Parses an ASF file: `file` is its name for messages.
///
/// Joints are in depth-first order, children in the order of `:hierarchy`; channels are the root's, then
/// those of the bones in the order of `:bonedata`. Lengths are in centimetres, angles in degrees.
///
/// # Errors
/// Names the line, what was found there and what was expected.
pub fn parse(bytes: &[u8], file: &str) -> Result<Skeleton, ImportError> {
    text::check(bytes, file, "an ASF file")?;
    let mut lexer = Lexer::new(bytes, file, Some(b'#'), b"");
    let sections = Sections::read(&mut lexer)?;
    sections.build(&lexer)
}

#[derive(Default)]
struct Sections {
    units: Units,
    root: Option<Bone>,
    bones: Vec<Bone>,
    /// Children of each bone: 0 is the root, 1 the first of `bones`.
    children: Vec<Vec<usize>>,
}

struct Units {
    length: f64,
    radians: bool,
}

impl Default for Units {
    fn default() -> Self {
        Self { length: 1.0, radians: false }
    }
}

/// A bone as the file has it, in the file's units.
#[derive(Default)]
struct Bone {
    name: String,
    direction: [f64; 3],
    length: f64,
    position: [f64; 3],
    axis: [f64; 3],
    /// Axes in which `axis` is applied, the first first.
    axis_order: [usize; 3],
    dof: Vec<Dof>,
    limits: Vec<(f64, f64)>,
}

impl Sections {
    fn read(lexer: &mut Lexer) -> Result<Self, ImportError> {
        let mut sections = Self::default();
        while lexer.find_word() {
            let section = lexer.word().to_ascii_lowercase();
            if !section.starts_with(b":") {
                return Err(lexer.error("a section such as `:root`".to_string()));
            }
            lexer.take_word();
            match section.as_slice() {
                b":units" => sections.units = read_units(lexer)?,
                b":root" => sections.root = Some(read_root(lexer)?),
                b":bonedata" => sections.bones = read_bones(lexer)?,
                b":hierarchy" => sections.children = sections.read_hierarchy(lexer)?,
                _ => skip_section(lexer),
            }
        }
        Ok(sections)
    }

    fn read_hierarchy(&self, lexer: &mut Lexer) -> Result<Vec<Vec<usize>>, ImportError> {
        let names = self.bones.iter().enumerate().map(|(index, bone)| (bone.name.as_bytes(), index + 1));
        let indices: HashMap<&[u8], usize> = names.chain([(b"root".as_slice(), 0)]).collect();
        let mut children = vec![Vec::new(); self.bones.len() + 1];
        let mut has_parent = vec![false; self.bones.len() + 1];
        has_parent[0] = true;
        lexer.expect("begin")?;
        while !lexer.accept("end") {
            let find = |lexer: &mut Lexer| {
                let found = indices.get(lexer.word()).copied();
                found.ok_or_else(|| {
                    lexer.error("`root`, or a bone of :bonedata, which comes first".to_string())
                })
            };
            let parent = find(lexer)?;
            lexer.take_word();
            while !lexer.at_line_end() {
                let child = find(lexer)?;
                if std::mem::replace(&mut has_parent[child], true) {
                    return Err(lexer.error_found(
                        format!("a second parent for {}", quote(lexer.word())),
                        "one parent for each bone, and none for the root".to_string(),
                    ));
                }
                children[parent].push(child);
                lexer.take_word();
            }
        }
        Ok(children)
    }

    fn build(mut self, lexer: &Lexer) -> Result<Skeleton, ImportError> {
        let expected = |expected: &str| lexer.error(expected.to_string());
        let root = self.root.take().ok_or_else(|| expected("a section `:root`"))?;
        if self.bones.is_empty() || self.children.is_empty() {
            return Err(expected("sections `:bonedata` and `:hierarchy` with bones"));
        }
        self.bones.insert(0, root);
        let order = self.depth_first(lexer)?;
        let mut joint_of = vec![0; self.bones.len()];
        for (joint, &(bone, _)) in order.iter().enumerate() {
            joint_of[bone] = joint;
        }
        let cm_per_unit = CM_PER_INCH / self.units.length;
        let origin = Origin::Asf { cm_per_unit, radians: self.units.radians };
        let mut skeleton = Skeleton { joints: Vec::new(), channels: Vec::new(), origin };
        let mut ranges = Vec::new();
        for (bone, &joint) in self.bones.iter().zip(&joint_of) {
            let start = skeleton.channels.len();
            skeleton.channels.extend(bone.channels(joint, &self.units, cm_per_unit));
            ranges.push(start..skeleton.channels.len());
        }
        if skeleton.channels.is_empty() {
            return Err(expected("a degree of freedom (`order` or `dof`) somewhere"));
        }
        for &(bone, parent) in &order {
            let channels = ranges[bone].clone();
            let parent = parent.map(|parent| joint_of[parent]);
            let bone = &self.bones[bone];
            let level = |above: &Joint| above.level.saturating_add(u8::from(!channels.is_empty()));
            let rotations = channels.clone().filter(|&index| skeleton.channels[index].dof.is_rotation());
            let tail = bone.direction.map(|part| part * bone.length * cm_per_unit);
            let above = parent.map(|parent| &skeleton.joints[parent]);
            let joint = Joint {
                name: bone.name.clone(),
                parent,
                offset: above.map_or(bone.position.map(|part| part * cm_per_unit), |above| above.tail),
                axis: bone.rest_orientation(&self.units),
                tail,
                // The first rotation is applied first, so it is the rightmost factor.
                rotations: rotations.rev().collect(),
                level: above.map_or(1, level),
                channels,
            };
            skeleton.joints.push(joint);
        }
        Ok(skeleton)
    }

    /// Bones with their parents, parents first.
    fn depth_first(&self, lexer: &Lexer) -> Result<Vec<(usize, Option<usize>)>, ImportError> {
        let mut order = Vec::with_capacity(self.bones.len());
        let mut pending = vec![(0, None)];
        let mut reached = vec![false; self.bones.len()];
        while let Some((bone, parent)) = pending.pop() {
            reached[bone] = true;
            order.push((bone, parent));
            pending.extend(self.children[bone].iter().rev().map(|&child| (child, Some(bone))));
        }
        match reached.iter().position(|reached| !reached) {
            None => Ok(order),
            Some(lost) => Err(lexer.error_found(
                format!("bone {}, which the root does not lead to", quote(self.bones[lost].name.as_bytes())),
                "every bone below the root in `:hierarchy`".to_string(),
            )),
        }
    }
}

impl Bone {
    fn rest_orientation(&self, units: &Units) -> Matrix {
        self.axis_order.iter().fold(angles::IDENTITY, |product, &axis| {
            angles::multiply(&angles::rotation(axis, units.degrees(self.axis[axis])), &product)
        })
    }

    fn channels(&self, joint: usize, units: &Units, cm_per_unit: f64) -> impl Iterator<Item = Channel> {
        self.dof.iter().enumerate().map(move |(index, &dof)| {
            let convert = |value| if dof.is_rotation() { units.degrees(value) } else { value * cm_per_unit };
            let limits = self.limits.get(index).map(|&(low, high)| (convert(low), convert(high)));
            Channel {
                name: format!("{}.{}", self.name, dof.name()),
                dof,
                joint,
                limits: limits.filter(|(low, high)| low.is_finite() || high.is_finite()),
            }
        })
    }
}

impl Units {
    fn degrees(&self, angle: f64) -> f64 {
        if self.radians { angle.to_degrees() } else { angle }
    }
}

fn skip_section(lexer: &mut Lexer) {
    loop {
        while !lexer.at_line_end() {
            lexer.take_word();
        }
        if !lexer.find_word() || lexer.word().starts_with(b":") {
            return;
        }
    }
}

fn read_units(lexer: &mut Lexer) -> Result<Units, ImportError> {
    let mut units = Units::default();
    loop {
        if lexer.accept("mass") {
            lexer.number(|| "the unit of mass".to_string())?;
        } else if lexer.accept("length") {
            let expected = || "the unit of length, more than 0".to_string();
            lexer.at_line_end();
            let error = lexer.error(expected());
            units.length = lexer.number(expected)?;
            if !(units.length > 0.0 && (CM_PER_INCH / units.length).is_normal()) {
                return Err(error);
            }
        } else if lexer.accept("angle") {
            units.radians = if lexer.accept("deg") || lexer.accept("degrees") {
                false
            } else if lexer.accept("rad") || lexer.accept("radians") {
                true
            } else {
                return Err(lexer.error("`deg` or `rad`".to_string()));
            };
        } else if at_section_end(lexer) {
            return Ok(units);
        } else {
            return Err(lexer.error("`mass`, `length` or `angle`".to_string()));
        }
    }
}

fn at_section_end(lexer: &mut Lexer) -> bool {
    !lexer.find_word() || lexer.word().starts_with(b":")
}

fn read_root(lexer: &mut Lexer) -> Result<Bone, ImportError> {
    let mut root = Bone { name: "root".to_string(), axis_order: [0, 1, 2], ..Bone::default() };
    loop {
        if lexer.accept("order") {
            root.dof = read_dof(lexer)?;
        } else if lexer.accept("axis") {
            root.axis_order = read_axis_order(lexer)?;
        } else if lexer.accept("position") {
            root.position = read_vector(lexer, "position")?;
        } else if lexer.accept("orientation") {
            root.axis = read_vector(lexer, "orientation")?;
        } else if at_section_end(lexer) {
            return Ok(root);
        } else {
            return Err(lexer.error("`order`, `axis`, `position` or `orientation`".to_string()));
        }
    }
}

fn read_bones(lexer: &mut Lexer) -> Result<Vec<Bone>, ImportError> {
    let mut bones = Vec::new();
    let mut names = HashSet::from(["root".to_string()]);
    while !at_section_end(lexer) {
        lexer.expect("begin")?;
        let bone = read_bone(lexer)?;
        if !names.insert(bone.name.clone()) {
            return Err(lexer.error_found(
                format!("a second bone {}", quote(bone.name.as_bytes())),
                "names that differ".to_string(),
            ));
        }
        bones.push(bone);
    }
    Ok(bones)
}

fn read_bone(lexer: &mut Lexer) -> Result<Bone, ImportError> {
    let mut bone = Bone { axis_order: [0, 1, 2], ..Bone::default() };
    let [mut has_direction, mut has_length] = [false; 2];
    loop {
        if lexer.accept("id") {
            skip_words(lexer);
        } else if lexer.accept("name") {
            if lexer.at_line_end() {
                return Err(lexer.error("the bone's name".to_string()));
            }
            bone.name = String::from_utf8_lossy(lexer.take_word()).into_owned();
        } else if lexer.accept("direction") {
            bone.direction = read_vector(lexer, "direction")?;
            has_direction = true;
        } else if lexer.accept("length") {
            bone.length = lexer.number(|| "the bone's length".to_string())?;
            has_length = true;
        } else if lexer.accept("axis") {
            bone.axis = read_vector(lexer, "axis")?;
            bone.axis_order = read_axis_order(lexer)?;
        } else if lexer.accept("dof") {
            bone.dof = read_dof(lexer)?;
        } else if lexer.accept("limits") {
            bone.limits = read_limits(lexer, bone.dof.len())?;
        } else if lexer.accept("bodymass") || lexer.accept("cofmass") {
            skip_words(lexer);
        } else if lexer.accept("end") {
            break;
        } else {
            let expected = "`id`, `name`, `direction`, `length`, `axis`, `dof`, `limits` or `end`";
            return Err(lexer.error(expected.to_string()));
        }
    }
    if bone.name.is_empty() || !has_direction || !has_length {
        return Err(lexer.error_found(
            "the end of a bone".to_string(),
            "its `name`, `direction` and `length` before that".to_string(),
        ));
    }
    let pointless = bone.length == 0.0 || bone.direction == [0.0; 3];
    if pointless && bone.dof.contains(&Dof::Length) {
        return Err(lexer.error_found(
            format!("bone {} without length or direction", quote(bone.name.as_bytes())),
            "both, since it has a degree of freedom `l`".to_string(),
        ));
    }
    Ok(bone)
}

fn skip_words(lexer: &mut Lexer) {
    while !lexer.at_line_end() {
        lexer.take_word();
    }
}

fn read_vector(lexer: &mut Lexer, name: &str) -> Result<[f64; 3], ImportError> {
    let mut vector = [0.0; 3];
    for part in &mut vector {
        *part = lexer.number(|| format!("the three numbers of `{name}`"))?;
    }
    Ok(vector)
}

fn read_axis_order(lexer: &mut Lexer) -> Result<[usize; 3], ImportError> {
    lexer.at_line_end();
    let order: Option<Vec<usize>> = (lexer.word().iter())
        .map(|letter| b"xyz".iter().position(|axis| *axis == letter.to_ascii_lowercase()))
        .collect();
    let order = order.and_then(|order| <[usize; 3]>::try_from(order).ok());
    let order = order.filter(|order| (0..3).all(|axis| order.contains(&axis)));
    let order = order.ok_or_else(|| lexer.error("an order of axes such as `XYZ`".to_string()))?;
    lexer.take_word();
    Ok(order)
}

fn read_dof(lexer: &mut Lexer) -> Result<Vec<Dof>, ImportError> {
    let mut dof = Vec::new();
    while !lexer.at_line_end() {
        let word = lexer.word();
        let mut kinds = Dof::ALL.into_iter();
        let found = kinds.find(|found| word.eq_ignore_ascii_case(found.name().as_bytes()));
        let found = found.filter(|found| !dof.contains(found));
        let expected = "degrees of freedom out of `tx ty tz rx ry rz l`, each once";
        dof.push(found.ok_or_else(|| lexer.error(expected.to_string()))?);
        lexer.take_word();
    }
    Ok(dof)
}

/// Reads `count` pairs: commas and parentheses are blanks, and they go over as many lines as they need.
fn read_limits(lexer: &mut Lexer, count: usize) -> Result<Vec<(f64, f64)>, ImportError> {
    let mut numbers = Vec::with_capacity(2 * count);
    while numbers.len() < 2 * count {
        let expected = || format!("{count} pairs of limits, one for each `dof` above");
        if !lexer.find_word() {
            return Err(lexer.error(expected()));
        }
        let error = lexer.error(expected());
        let word = String::from_utf8_lossy(lexer.take_word());
        for part in word.split(['(', ')', ',']).filter(|part| !part.is_empty()) {
            // Unlike elsewhere, `-inf` and `inf` are in use here.
            let number: Option<f64> = part.parse().ok().filter(|number: &f64| !number.is_nan());
            match number {
                Some(number) => numbers.push(number),
                None => return Err(error),
            }
        }
        if numbers.len() > 2 * count {
            return Err(error);
        }
    }
    // The closing parenthesis of the last pair may stand by itself.
    while lexer.find_word() && lexer.word().iter().all(|byte| b"(),".contains(byte)) {
        lexer.take_word();
    }
    Ok(numbers.chunks_exact(2).map(|pair| (pair[0].min(pair[1]), pair[0].max(pair[1]))).collect())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A skeleton that uses what CMU's files do not.
    pub(crate) const ODD: &str = "# made for tests
:version 1.10
:name odd
:units
  mass 2
  length 0.45
  angle rad
:documentation
  any text, :even this

:root # a comment
  axis ZXY
  order RZ TY RX TX RY TZ
  position 1 -2 3.5e0
  orientation .1 -0.2 0.3
:bonedata
  begin
    id 7
    name tip
    direction 0 0 1
    length 2
    axis 0.5 0 -0.25 YZX
    dof tz rx l ry
    limits (-1, 1)
           (-0.5 0.5) (-inf inf)
           (2, -inf
           )
    bodymass 3
    cofmass 0.5
  end
  begin
    name base
    direction 0.6 0.8 0
    length 10
    axis 0 1 0 zyx
    dof L
  end
  begin
    id 2
    name stiff
    direction -1 0 0
    length 4
  end
:hierarchy
  begin
    root stiff base
    base tip
  end
:skin nothing
";

    /// The whole of it, parsed.
    pub(crate) fn odd_skeleton() -> Skeleton {
        let skeleton = parse(ODD.as_bytes(), "odd.asf").expect("a skeleton");
        let with_crlf = parse(ODD.replace('\n', "\r\n").as_bytes(), "odd.asf").expect("a skeleton");
        assert_eq!(skeleton, with_crlf);
        skeleton
    }

    #[test]
    fn units_orders_and_hierarchy() {
        let skeleton = odd_skeleton();
        let names: Vec<&str> = skeleton.joints.iter().map(|joint| joint.name.as_str()).collect();
        assert_eq!(names, ["root", "stiff", "base", "tip"]);
        let levels: Vec<u8> = skeleton.joints.iter().map(|joint| joint.level).collect();
        assert_eq!(levels, [1, 1, 2, 3]);
        let channels: Vec<&str> = skeleton.channels.iter().map(|channel| channel.name.as_str()).collect();
        let root = ["root.rz", "root.ty", "root.rx", "root.tx", "root.ry", "root.tz"];
        assert_eq!(channels, [root.as_slice(), &["tip.tz", "tip.rx", "tip.l", "tip.ry", "base.l"]].concat());
        // The first rotation is applied first: it is the last factor.
        assert_eq!(skeleton.joints[0].rotations, [4, 2, 0]);
        assert_eq!(skeleton.joints[3].rotations, [9, 7]);
        let unit = 2.54 / 0.45;
        assert_eq!(skeleton.joints[0].offset, [unit, -2.0 * unit, 3.5 * unit]);
        assert_eq!(skeleton.joints[3].offset, skeleton.joints[2].tail);
        assert!((skeleton.joints[2].tail[1] - 8.0 * unit).abs() < 1e-12);
        assert_eq!(skeleton.channels[6].limits, Some((-unit, unit)));
        assert_eq!(skeleton.channels[7].limits, Some((-(0.5_f64.to_degrees()), 0.5_f64.to_degrees())));
        assert_eq!(skeleton.channels[8].limits, None);
        assert_eq!(skeleton.channels[9].limits, Some((f64::NEG_INFINITY, 2_f64.to_degrees())));
        assert_eq!(skeleton.origin, Origin::Asf { cm_per_unit: unit, radians: true });
    }

    #[test]
    fn rest_orientation_applies_the_first_letter_first() {
        let skeleton = odd_skeleton();
        let [x, z] = [0.5_f64, -0.25].map(f64::to_degrees);
        // YZX with y = 0: z first, then x.
        let expected = angles::multiply(&angles::rotation(0, x), &angles::rotation(2, z));
        for (a, b) in skeleton.joints[3].axis.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((a - b).abs() < 1e-15);
        }
    }

    #[test]
    fn errors_name_line_found_and_expected() {
        let good = ODD;
        for (from, to, message) in [
            ("length 10", "length ten", "x.asf, line 34: found `ten`, expected the bone's length"),
            ("axis ZXY", "axis ZZY", "x.asf, line 12: found `ZZY`, expected an order of axes such as `XYZ`"),
            ("angle rad", "angle grad", "x.asf, line 7: found `grad`, expected `deg` or `rad`"),
            ("dof tz rx l ry", "dof tz rx tz", "found `tz`, expected degrees of freedom out of"),
            ("root stiff base", "root stiff bass", "line 46: found `bass`, expected `root`, or a bone of"),
            ("base tip\n", "base tip stiff\n", "found a second parent for `stiff`, expected one parent"),
            ("root stiff base", "root stiff", "found bone `tip`, which the root does not lead to, expected"),
            ("name stiff", "name tip", "found a second bone `tip`, expected names that differ"),
            ("(2, -inf", "(2, x", "found `x`, expected 4 pairs of limits"),
            (" length 0.45", " length -1", "found `-1`, expected the unit of length, more than 0"),
            (":root # a comment", ":rood", "expected a section `:root`"),
            ("direction 0.6 0.8 0", "direction 0 0 0", "found bone `base` without length or direction"),
        ] {
            let bad = good.replace(from, to);
            assert_ne!(bad, good, "{from}");
            let error = parse(bad.as_bytes(), "x.asf").expect_err(to).to_string();
            assert!(error.contains(message), "{to}: {error}");
        }
    }
}
