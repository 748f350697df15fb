//! The joints that a first puppet may have: for each bone one servo about an axis, or several in series.

use mocap::body::{Body, Part, Side};
use std::fmt;

/// Parts of a puppet that a person asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// It turns and nods.
    Head,
    /// Shoulders and elbows.
    Arms,
    /// Hips, knees and ankles.
    Legs,
    /// The chest turns against the hips.
    Waist,
}

impl Group {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Head, Self::Arms, Self::Legs, Self::Waist];

    /// Its name in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Arms => "arms",
            Self::Legs => "legs",
            Self::Waist => "waist",
        }
    }
}

impl fmt::Display for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// One servo of a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// What its joint is called behind the unit's name; nothing for the only one.
    pub name: &'static str,
    /// What it turns about in the T-pose, in figure axes.
    pub axis: [f64; 3],
    /// As far as a human joint goes and some way more, in degrees. A chain can point a bone in most directions in two
    /// ways; only one of them is within these.
    pub reach: [f64; 2],
}

impl Axis {
    const fn new(name: &'static str, axis: [f64; 3], reach: [f64; 2]) -> Self {
        Self { name, axis, reach }
    }
}

/// The reach of a joint of this side, where the left one's is given.
const fn mirrored(side: Side, [low, high]: [f64; 2]) -> [f64; 2] {
    match side {
        Side::Left => [low, high],
        Side::Right => [-high, -low],
    }
}

/// What one bone needs: a servo that follows a turn, or a chain of servos.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Of what it is a part.
    pub group: Group,
    /// Such as `right shoulder`.
    pub name: String,
    /// The bone that it moves.
    pub bone: Part,
    /// The bone that carries it.
    pub against: Part,
    /// Its servos, the one nearest to the bone that stays first.
    pub axes: Vec<Axis>,
    /// Two other axes that may serve a recording better. A chain of two cannot be followed where its bone points along
    /// the first axis: with these it is another direction.
    pub others: Option<[Axis; 2]>,
    /// What a servo more would turn about.
    pub more: Option<Axis>,
}

impl Unit {
    /// All that a figure has bones for.
    pub fn all(body: &Body) -> Vec<Self> {
        let has = |part: &Part| body.joint(*part).is_some();
        let trunk = [Part::Chest, Part::Spine, Part::Hips].into_iter().find(has);
        let mut units = Vec::new();
        let mut add = |group, name: String, bone, against: Option<Part>, axes: &[Axis], servos| {
            let Some(against) = against.filter(|against| has(&bone) && has(against) && *against != bone)
            else {
                return;
            };
            let mut axes = axes.to_vec();
            let more = (axes.len() > servos).then(|| axes.pop()).flatten();
            units.push(Self { group, name, bone, against, axes, others: None, more });
        };
        if let Some(trunk) = trunk.filter(|trunk| *trunk != Part::Hips) {
            let axes = [Axis::new("turn", Y, [-120.0, 120.0]), Axis::new("bend", X, [-90.0, 120.0])];
            add(Group::Waist, "waist".to_owned(), trunk, Some(Part::Hips), &axes, 1);
        }
        let axes = [
            Axis::new("turn", Y, [-150.0, 150.0]),
            Axis::new("nod", X, [-90.0, 90.0]),
            Axis::new("tilt", Z, [-90.0, 90.0]),
        ];
        add(Group::Head, "head".to_owned(), Part::Head, trunk, &axes, 2);
        for side in [Side::Right, Side::Left] {
            let name = |joint: &str| format!("{} {joint}", side.name());
            let upper_arm = Part::UpperArm(side);
            // The arm hangs down at a swing of 0 and a lift of 90 (right) or -90 degrees.
            let axes = [
                Axis::new("swing", X, [-220.0, 120.0]),
                Axis::new("lift", Z, mirrored(side, [-180.0, 5.0])),
                Axis::new("twist", X, [-120.0, 120.0]),
            ];
            add(Group::Arms, name("shoulder"), upper_arm, trunk, &axes, 2);
            // So that a bent elbow has a positive value. Fit turns a limb's T-pose so that its hinge is along this axis.
            let hinge = [Axis::new("", [0.0, -side.sign(), 0.0], [-180.0, 180.0])];
            add(Group::Arms, name("elbow"), Part::Forearm(side), Some(upper_arm), &hinge, 1);
        }
        for side in [Side::Right, Side::Left] {
            let name = |joint: &str| format!("{} {joint}", side.name());
            let (thigh, shin) = (Part::Thigh(side), Part::Shin(side));
            let axes = [
                Axis::new("swing", X, [-180.0, 120.0]),
                Axis::new("spread", Z, [-90.0, 90.0]),
                Axis::new("twist", Y, [-120.0, 120.0]),
            ];
            let hinge = [Axis::new("", X, [-180.0, 180.0])];
            add(Group::Legs, name("hip"), thigh, Some(Part::Hips), &axes, 2);
            add(Group::Legs, name("knee"), shin, Some(thigh), &hinge, 1);
            add(Group::Legs, name("ankle"), Part::Foot(side), Some(shin), &hinge, 1);
        }
        for unit in &mut units {
            if let Part::UpperArm(side) = unit.bone {
                let lift = Axis::new("lift", Z, mirrored(side, [-225.0, 135.0]));
                unit.others = Some([lift, Axis::new("swing", Y, [-90.0, 90.0])]);
            }
            if matches!(unit.bone, Part::Thigh(_)) {
                let spread = Axis::new("spread", Z, [-130.0, 130.0]);
                unit.others = Some([spread, Axis::new("swing", X, [-130.0, 100.0])]);
            }
        }
        units
    }

    /// The name of the joint of one of its axes.
    pub fn joint_name(&self, axis: &Axis) -> String {
        if axis.name.is_empty() { self.name.clone() } else { format!("{} {}", self.name, axis.name) }
    }
}
