//! Tests: figures with the names of many programs, and the same without names.

use super::figure::{Body, FoundBy};
use super::part::{Part, Side};
use crate::angles::IDENTITY;
use crate::skeleton::{Channel, Dof, Joint, Origin, Skeleton};

/// A naming scheme: the middle, with `*` where the spine ends and the arms go out, then left arm and left leg, and
/// what makes a left name a right one. `+` stands before a joint that is no part.
struct Scheme(&'static str, &'static str, &'static str, &'static str, [&'static str; 2]);

const LEFT_RIGHT: [&str; 2] = ["Left", "Right"];

const SCHEMES: [Scheme; 21] = [
    Scheme(
        "cgspeed",
        "Hips LowerBack +Spine Spine1* Neck +Neck1 Head",
        "LeftShoulder LeftArm LeftForeArm LeftHand +LeftFingerBase",
        "+LeftHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase",
        LEFT_RIGHT,
    ),
    Scheme(
        "CMU",
        "root lowerback +upperback thorax* lowerneck +upperneck head",
        "lclavicle lhumerus lradius lwrist +lhand +lfingers",
        "+lhipjoint lfemur ltibia lfoot ltoes",
        ["l", "r"],
    ),
    Scheme(
        "MotionBuilder",
        "+Reference Hips Spine +Spine1 +Spine2 Spine3* Neck Head",
        "LeftShoulder LeftArm LeftForeArm LeftHand +LeftHandMiddle1",
        "LeftUpLeg LeftLeg LeftFoot LeftToeBase",
        LEFT_RIGHT,
    ),
    Scheme(
        "Mixamo",
        "mixamorig:Hips mixamorig:Spine +mixamorig:Spine1 mixamorig:Spine2* mixamorig:Neck mixamorig:Head",
        "mixamorig:LeftShoulder mixamorig:LeftArm mixamorig:LeftForeArm mixamorig:LeftHand \
         +mixamorig:LeftHandMiddle1",
        "mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot mixamorig:LeftToeBase",
        LEFT_RIGHT,
    ),
    Scheme(
        "Mixamo in three.js",
        "mixamorigHips mixamorigSpine +mixamorigSpine1 mixamorigSpine2* mixamorigNeck mixamorigHead",
        "mixamorigLeftShoulder mixamorigLeftArm mixamorigLeftForeArm mixamorigLeftHand",
        "mixamorigLeftUpLeg mixamorigLeftLeg mixamorigLeftFoot mixamorigLeftToeBase",
        LEFT_RIGHT,
    ),
    Scheme(
        "Rokoko Newton",
        "Hips Spine1 +Spine2 +Spine3 Spine4* Neck Head",
        "LeftShoulder LeftArm LeftForeArm LeftHand",
        "LeftThigh LeftShin LeftFoot LeftToe",
        LEFT_RIGHT,
    ),
    Scheme(
        "Xsens BVH",
        "Hips Chest +Chest2 +Chest3 Chest4* Neck Head",
        "LeftCollar LeftShoulder LeftElbow LeftWrist",
        "LeftHip LeftKnee LeftAnkle LeftToe",
        LEFT_RIGHT,
    ),
    Scheme(
        "Xsens MVN",
        "Pelvis L5 +L3 +T12 T8* Neck Head",
        "LeftShoulder LeftUpperArm LeftForeArm LeftHand",
        "LeftUpperLeg LeftLowerLeg LeftFoot LeftToe",
        LEFT_RIGHT,
    ),
    Scheme(
        "Perception Neuron",
        "Hips Spine +Spine1 Spine2* Neck +Neck1 Head",
        "LeftShoulder LeftArm LeftForeArm LeftHand +LeftInHandMiddle +LeftHandMiddle1",
        "LeftUpLeg LeftLeg LeftFoot",
        LEFT_RIGHT,
    ),
    Scheme(
        "DAZ",
        "hip abdomen chest* neck head",
        "lCollar lShldr lForeArm lHand +lMid1",
        "+lButtock lThigh lShin lFoot",
        ["l", "r"],
    ),
    Scheme(
        "Bandai-Namco",
        "+joint_Root Hips Spine Chest* Neck Head",
        "Shoulder_L UpperArm_L LowerArm_L Hand_L",
        "UpperLeg_L LowerLeg_L Foot_L Toes_L",
        ["_L", "_R"],
    ),
    Scheme(
        "mocapbank",
        "Hips Spine +Spine1 +Spine2 Spine3* Neck Head",
        "LeftShoulder LeftArm LeftForeArm LeftHand",
        "LeftUpLeg LeftLeg LeftFoot LeftToeBase",
        LEFT_RIGHT,
    ),
    Scheme(
        "Unreal",
        "+root pelvis spine_01 +spine_02 spine_03* neck_01 head",
        "clavicle_l upperarm_l lowerarm_l hand_l +middle_01_l",
        "thigh_l calf_l foot_l ball_l",
        ["_l", "_r"],
    ),
    Scheme(
        "SlimeVR",
        "HIP WAIST +CHEST UPPER_CHEST* NECK HEAD",
        "LEFT_SHOULDER LEFT_UPPER_ARM LEFT_LOWER_ARM LEFT_HAND",
        "+LEFT_HIP LEFT_UPPER_LEG LEFT_LOWER_LEG LEFT_FOOT",
        ["LEFT", "RIGHT"],
    ),
    Scheme(
        "100STYLE",
        "Hips Chest +Chest2 +Chest3 Chest4* Neck Head",
        "LeftCollar LeftShoulder LeftElbow LeftWrist",
        "LeftHip LeftKnee LeftAnkle LeftToe",
        LEFT_RIGHT,
    ),
    Scheme(
        "Motive",
        "Skeleton_001:Hip Skeleton_001:Ab Skeleton_001:Chest* Skeleton_001:Neck Skeleton_001:Head",
        "Skeleton_001:LShoulder Skeleton_001:LUArm Skeleton_001:LFArm Skeleton_001:LHand",
        "Skeleton_001:LThigh Skeleton_001:LShin Skeleton_001:LFoot Skeleton_001:LToe",
        [":L", ":R"],
    ),
    Scheme(
        "GAMES-105",
        "RootJoint pelvis_lowerback lowerback_torso* torso_head",
        "lTorso_Clavicle lShoulder lElbow lWrist",
        "lHip lKnee lAnkle lToeJoint",
        ["l", "r"],
    ),
    Scheme(
        "Biped",
        "+Bip01 Bip01_Pelvis Bip01_Spine Bip01_Spine1* Bip01_Neck Bip01_Head",
        "Bip01_L_Clavicle Bip01_L_UpperArm Bip01_L_Forearm Bip01_L_Hand",
        "Bip01_L_Thigh Bip01_L_Calf Bip01_L_Foot Bip01_L_Toe0",
        ["_L_", "_R_"],
    ),
    Scheme(
        "VRM",
        "J_Bip_C_Hips J_Bip_C_Spine +J_Bip_C_Chest J_Bip_C_UpperChest* J_Bip_C_Neck J_Bip_C_Head",
        "J_Bip_L_Shoulder J_Bip_L_UpperArm J_Bip_L_LowerArm J_Bip_L_Hand",
        "J_Bip_L_UpperLeg J_Bip_L_LowerLeg J_Bip_L_Foot J_Bip_L_ToeBase",
        ["_L_", "_R_"],
    ),
    Scheme(
        "Rigify",
        "hips spine.001 +spine.002 spine.003* neck head",
        "shoulder.L upper_arm.L forearm.L hand.L",
        "thigh.L shin.L foot.L toe.L",
        [".L", ".R"],
    ),
    Scheme(
        "SMPL",
        "Pelvis Spine1 +Spine2 Spine3* Neck Head",
        "L_Collar L_Shoulder L_Elbow L_Wrist +L_Hand",
        "L_Hip L_Knee L_Ankle L_Foot",
        ["L_", "R_"],
    ),
];

impl Scheme {
    /// A figure of 170 cm that stands with its arms out, and the part that each of its joints is.
    fn figure(&self) -> Figure {
        let Self(_, middle, arm, leg, [left, right]) = *self;
        let (torso, head) = middle.split_once("* ").expect("a chest");
        let mut figure = Figure { skeleton: empty(), parts: Vec::new() };
        let torso: Vec<&str> = torso.split(' ').collect();
        let parts = [Part::Hips, Part::Spine, Part::Chest];
        let offsets = [[0.0, 95.0, 0.0], [0.0, 10.0, -1.0], [0.0, 25.0, 0.0]];
        let chest = figure.chain(None, &torso, &parts, &offsets);
        let hips = figure.parts.iter().find(|(_, part)| *part == Part::Hips).expect("hips").0;
        let head: Vec<&str> = head.split(' ').collect();
        let necks = if parts_in(&head) == 1 { &[Part::Head][..] } else { &[Part::Neck, Part::Head] };
        let top = figure.chain(Some(chest), &head, necks, &[[0.0, 22.0, 0.0], [0.0, 10.0, 2.0]]);
        figure.end(top, [0.0, 18.0, 3.0]);
        for side in Side::BOTH {
            let x = side.sign();
            let names = |names: &str| -> Vec<String> {
                let own = |name: &str| match side {
                    Side::Left => name.to_owned(),
                    Side::Right => mirrored(name, left, right),
                };
                names.split(' ').map(own).collect()
            };
            let parts = [Part::Clavicle, Part::UpperArm, Part::Forearm, Part::Hand].map(|part| part(side));
            let offsets =
                [[3.0 * x, 18.0, 2.0], [12.0 * x, 0.0, 0.0], [28.0 * x, 0.0, 0.0], [25.0 * x, 0.0, 0.0]];
            let hand = figure.chain(Some(chest), &names(arm), &parts, &offsets);
            figure.end(hand, [9.0 * x, 0.0, 0.0]);
            let parts = [Part::Thigh, Part::Shin, Part::Foot, Part::Toes].map(|part| part(side));
            let offsets = [[9.0 * x, -5.0, 0.0], [0.0, -42.0, 0.0], [0.0, -42.0, 0.0], [0.0, -5.0, 13.0]];
            let toes = figure.chain(Some(hips), &names(leg), &parts, &offsets);
            figure.end(toes, [0.0, -2.0, 8.0]);
        }
        figure
    }
}

fn empty() -> Skeleton {
    Skeleton { joints: Vec::new(), channels: Vec::new(), origin: Origin::Bvh { cm_per_unit: 1.0 } }
}

fn parts_in(names: &[&str]) -> usize {
    names.iter().filter(|name| !name.starts_with('+')).count()
}

/// With its first mark of the left side replaced; a mark of one letter is the first letter.
fn mirrored(name: &str, left: &str, right: &str) -> String {
    let plain = name.trim_start_matches('+');
    let mirrored =
        if left == "l" { format!("{right}{}", &plain[1..]) } else { plain.replacen(left, right, 1) };
    format!("{}{mirrored}", if plain == name { "" } else { "+" })
}

struct Figure {
    skeleton: Skeleton,
    parts: Vec<(usize, Part)>,
}

impl Figure {
    /// Joints one below the other; returns the last. One with `+` before its name is no part, and where its parent is.
    fn chain(
        &mut self,
        mut parent: Option<usize>,
        names: &[impl AsRef<str>],
        parts: &[Part],
        offsets: &[[f64; 3]],
    ) -> usize {
        let mut parts = parts.iter().zip(offsets);
        for name in names {
            let name = name.as_ref();
            let mut offset = [0.0; 3];
            if !name.starts_with('+') {
                let (&part, &from_parent) = parts.next().expect("as many parts");
                self.parts.push((self.skeleton.joints.len(), part));
                offset = from_parent;
            }
            parent =
                Some(self.joint(name.trim_start_matches('+'), parent, offset, &[Dof::Rz, Dof::Ry, Dof::Rx]));
        }
        parent.expect("a joint")
    }

    fn end(&mut self, parent: usize, offset: [f64; 3]) {
        let name = format!("{}.end", self.skeleton.joints[parent].name);
        self.joint(&name, Some(parent), offset, &[]);
    }

    fn joint(&mut self, name: &str, parent: Option<usize>, offset: [f64; 3], dofs: &[Dof]) -> usize {
        let (joint, start) = (self.skeleton.joints.len(), self.skeleton.channels.len());
        let channels = start..start + dofs.len();
        for &dof in dofs {
            let name = format!("{name}.{}", dof.name());
            self.skeleton.channels.push(Channel { name, dof, joint, limits: None });
        }
        self.skeleton.joints.push(Joint {
            name: name.to_owned(),
            parent,
            offset,
            axis: IDENTITY,
            tail: [0.0; 3],
            rotations: channels.clone().collect(),
            channels,
            level: 1,
        });
        joint
    }

    fn check(&self, scheme: &str) -> Body {
        let body = Body::of(&self.skeleton);
        let name = |joint: Option<usize>| joint.map(|joint| self.skeleton.joints[joint].name.as_str());
        for part in Part::ALL {
            let expected = self.parts.iter().find(|(_, other)| *other == part).map(|&(joint, _)| joint);
            let found = body.joint(part);
            assert_eq!(name(found), name(expected), "{scheme}: {part}, {:?}", body.found_by(part));
        }
        body
    }
}

#[test]
fn parts_are_found_in_all_naming_schemes() {
    for scheme in SCHEMES {
        let body = scheme.figure().check(scheme.0);
        let guessed = Part::ALL.into_iter().find(|&part| body.found_by(part) == Some(FoundBy::Geometry));
        assert_eq!(guessed, None, "{}: found by its name", scheme.0);
    }
}

#[test]
fn parts_are_found_without_names() {
    for scheme in SCHEMES {
        let mut figure = scheme.figure();
        for (index, joint) in figure.skeleton.joints.iter_mut().enumerate() {
            joint.name = format!("j{index}");
        }
        figure.check(scheme.0);
    }
}

/// z up, and facing along -y: as Blender has it.
#[test]
fn without_names_the_feet_tell_left_from_right() {
    let mut figure = SCHEMES[0].figure();
    for (index, joint) in figure.skeleton.joints.iter_mut().enumerate() {
        joint.name = format!("j{index}");
        let [x, y, z] = joint.offset;
        joint.offset = [x, -z, y];
    }
    figure.check("z up");
    // Turned about: the figure's left is then along -x.
    for joint in &mut figure.skeleton.joints {
        let [x, y, z] = joint.offset;
        joint.offset = [-x, -y, z];
    }
    figure.check("z up, facing along y");
}

/// As MakeHuman has it: a helper before each leg, on the midline, and hips that are none.
#[test]
fn helpers_and_hips_of_the_legs_alone_are_no_parts() {
    let mut figure = Scheme(
        "MakeHuman",
        "Root Spine1 +Spine2 Spine3* Neck Head",
        "+__Clavicle_L Clavicle_L UpArm_L LoArm_L Hand_L",
        "+Hips +__UpLeg_L UpLeg_L LoLeg_L Foot_L Toe_L",
        ["_L", "_R"],
    )
    .figure();
    // Both legs hang on the same.
    let joints = &mut figure.skeleton.joints;
    let hips = |(index, joint): (usize, &Joint)| (joint.name == "Hips").then_some(index);
    let [left, right] = joints.iter().enumerate().filter_map(hips).collect::<Vec<_>>()[..] else {
        panic!("a joint a leg")
    };
    joints.iter_mut().filter(|joint| joint.parent == Some(right)).for_each(|joint| joint.parent = Some(left));
    joints[right].name = "helper".to_owned();
    figure.check("MakeHuman");
}

#[test]
fn a_skeleton_that_is_no_figure_has_no_limbs() {
    let mut figure = Figure { skeleton: empty(), parts: Vec::new() };
    let names: Vec<String> = (0..400).map(|index| format!("+tail{index}")).collect();
    figure.chain(None, &names, &[], &[]);
    figure.check("a chain");
}
