//! What is asked for, and what is proposed.

use super::figure::Figure;
use super::servo::Servo;
use super::unit::{Group, Unit};
use firmware::map::BusKind;

/// What a person asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// The parts that the puppet has; all unless given.
    pub groups: Vec<Group>,
    /// Most servos; as many as the parts need unless given.
    pub servos: Option<usize>,
    /// What the servos speak.
    pub kind: BusKind,
}

/// A joint of the puppet.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// What it turns about, in figure axes.
    pub axis: [f64; 3],
    /// Lowest and highest value in the recording, in degrees.
    pub recorded: [f64; 2],
    /// Lowest and highest value that it may have.
    pub range: [f64; 2],
    /// The goal at value 0, where that is not the middle of the servo.
    pub zero: Option<i32>,
    /// Highest speed of the recording, in degrees a second.
    pub recorded_speed: f64,
    /// Highest speed that it may have.
    pub max_speed: f64,
}

/// A unit and its joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposed {
    /// What they do.
    pub unit: Unit,
    /// In the order of the unit's axes.
    pub joints: Vec<Joint>,
}

/// A first puppet.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The figure that it was made of.
    pub figure: Figure,
    /// The servo that all joints have.
    pub servo: Servo,
    /// In the order in which they are written.
    pub units: Vec<Proposed>,
    /// What was guessed, left out or cut off: a sentence each.
    pub notes: Vec<String>,
}
