//! What can be wrong with a puppet.toml, in sentences.

use crate::channels::{MissingChannel, Unit};
use crate::models::UnknownModel;
use crate::place::Place;
use core::fmt;
use firmware::map::{GOAL_LIMIT, MAX_BUSES, MAX_SERVOS, MapError};
use servo_wire::pca9685::CHANNELS;
use std::io;
use std::path::{Path, PathBuf};

/// Most letters of a name.
pub(crate) const MOST_LETTERS: usize = 100;

/// What is wrong with a puppet.toml, and where. It is written as one sentence with the file, the line and the key.
#[derive(Debug)]
pub struct Error {
    path: PathBuf,
    place: Option<Place>,
    /// Whether it is about a value that was made up.
    of_filler: bool,
    /// In a box: the largest problems have several names, and a result should be small.
    problem: Box<Problem>,
}

impl Error {
    pub(crate) fn new(path: &Path, place: Option<Place>, problem: impl Into<Problem>) -> Self {
        Self { path: path.to_owned(), place, of_filler: false, problem: Box::new(problem.into()) }
    }

    /// The same, about a value that was made up.
    pub(crate) const fn of_filler(mut self, of_filler: bool) -> Self {
        self.of_filler = of_filler;
        self
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where in the file it is; `None` where it concerns the whole of the file.
    pub const fn place(&self) -> Option<&Place> {
        self.place.as_ref()
    }

    /// What is wrong.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path.display();
        match (self.problem(), &self.place) {
            (Problem::Read(error), _) => write!(f, "cannot read {path}: {error}"),
            (problem, Some(place)) => write!(f, "{path}{place}: {}", shown(&problem.to_string())),
            (problem, None) => write!(f, "{path}: {}", shown(&problem.to_string())),
        }
    }
}

impl std::error::Error for Error {}

/// A sentence with names from a file as it can be printed: on one line, without what a terminal takes for a command, and not much
/// longer than a sentence.
fn shown(sentence: &str) -> String {
    const MOST: usize = 600;
    let mut shown = String::new();
    for letter in sentence.chars().take(MOST) {
        if letter.is_control() { shown.extend(letter.escape_default()) } else { shown.push(letter) }
    }
    if sentence.chars().nth(MOST).is_some() {
        shown.push('…');
    }
    shown
}

/// What is wrong with a puppet.toml.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// The file cannot be read.
    #[error(transparent)]
    Read(io::Error),
    /// The bytes are not UTF-8.
    #[error("byte {byte}: not text")]
    NotText {
        /// The first byte that is not.
        byte: usize,
    },
    /// The text is not TOML, a key is unknown or missing, or a value is of another type.
    #[error("{}", .0.message().replace('\n', ", "))]
    Toml(Box<toml::de::Error>),
    /// A number is out of range.
    #[error("found {found}, expected {least} to {most}")]
    OutOfRange {
        /// The number.
        found: f64,
        /// Least that it may be.
        least: f64,
        /// Most that it may be.
        most: f64,
    },
    /// A number of a joint is not positive.
    #[error("found {found}, expected more than 0{}", .most.map_or(String::new(), |most| format!(" and at most {most}")))]
    NotPositive {
        /// The number.
        found: f64,
        /// Most that it may be, where that is less than any number.
        most: Option<f64>,
    },
    /// No baud rate and no buses.
    #[error("expected `baud`, or a [[bus]] with its `kind` and `baud`")]
    NoBaud,
    /// A baud rate of the puppet, and buses.
    #[error("a puppet with [[bus]] has the `baud` there")]
    BaudBesideBuses,
    /// A baud rate of 0.
    #[error("found 0, expected more")]
    BaudZero,
    /// Two buses have this name.
    #[error("another bus has this name")]
    BusTwice,
    /// More buses than a map holds.
    #[error("more than {MAX_BUSES} buses")]
    TooManyBuses,
    /// A joint of a puppet with several buses names none.
    #[error("expected `bus`, since there are several")]
    NoBus,
    /// A joint names a bus that there is not.
    #[error("there is no [[bus]] with the name \"{name}\"")]
    UnknownBus {
        /// The name.
        name: String,
    },
    /// More joints than a map holds.
    #[error("more than {MAX_SERVOS} joints, the most that a board holds")]
    TooManyJoints,
    /// A name that cannot be told, or is too long for that.
    #[error("found {found}, expected 1 to {MOST_LETTERS} letters, none of them a control character")]
    Name {
        /// What was found.
        found: String,
    },
    /// Two joints have this name.
    #[error("another joint has this name")]
    JointTwice,
    /// Two joints of a bus have this id.
    #[error("joint \"{joint}\" has id {id} as well")]
    IdTwice {
        /// Name of the other joint.
        joint: String,
        /// The id.
        id: u8,
    },
    /// A PCA9685 has no output with this number.
    #[error("a PCA9685 has the channels 0 to {}, which its servos' ids are", CHANNELS - 1)]
    Pca9685Channel,
    /// A servo's model is not known.
    #[error(transparent)]
    Model(#[from] UnknownModel),
    /// The channel is none of the clips'.
    #[error(transparent)]
    Channel(#[from] MissingChannel),
    /// The name of a channel does not say what it moves.
    #[error("\"{name}\" is no channel, expected joint.rx, .ry, .rz, .tx, .ty, .tz or .l")]
    Dof {
        /// The name.
        name: String,
    },
    /// A joint follows nothing, or several things.
    #[error("expected one of `channel`, `turn`, `chain` and `sum`, and not several")]
    Follows,
    /// An axis of a joint that is in no chain.
    #[error("`axis` belongs to a joint with `chain`; a turn has its axis within its braces")]
    AxisWithoutChain,
    /// A joint of a chain has no axis.
    #[error("a joint of a chain needs `axis`, in the T-pose: x to the figure's left, y up, z forward")]
    NoAxis,
    /// There is no chain of that name.
    #[error("there is no [[chain]] with the name \"{name}\"")]
    UnknownChain {
        /// The name.
        name: String,
    },
    /// Two chains have this name.
    #[error("another chain has this name")]
    ChainTwice,
    /// A chain with no joint, or too many.
    #[error("{found} joints have this chain, expected 1 to 3")]
    ChainJoints {
        /// How many.
        found: usize,
    },
    /// A weight of a turn that is in no sum.
    #[error("a weight belongs to the turns of a `sum`; for one turn there is `scale`")]
    WeightOfTurn,
    /// A sum of nothing.
    #[error("found no turns, expected at least one")]
    EmptySum,
    /// A number that is infinite or none.
    #[error("found {found}, expected a number")]
    NotFinite {
        /// What it is.
        found: f64,
    },
    /// The clip has no channel for a joint that follows a turn, a chain or a sum.
    #[error("the clip was not made for this puppet: make one with bunraku encode --puppet and this file")]
    NotFitted,
    /// A recording of columns alone, for a joint that follows a turn, a chain or a sum.
    #[error(
        "a table has columns and no bones, so that there is no turn or chain in it: give a recording with a skeleton, or \
         name a column as the joint, in degrees (\"NAME\") or in goals (\"NAME.goal\")"
    )]
    NoBones,
    /// What is known of a figure names no limb.
    #[error("found \"{name}\", expected \"left\" or \"right\" and \"upper arm\" or \"thigh\"")]
    NoLimb {
        /// The name.
        name: String,
    },
    /// The skeleton has no such bone.
    #[error("the skeleton has no bone \"{name}\"; it has {}", .known.join(", "))]
    NoBone {
        /// The name.
        name: String,
        /// What names it knows: body parts that it has, and joints with names that are like it.
        known: Vec<String>,
    },
    /// The zero is beyond what a map holds.
    #[error("found {found}, expected -{GOAL_LIMIT} to {GOAL_LIMIT}")]
    Zero {
        /// The goal at value 0, the offset included.
        found: f64,
    },
    /// The channel is beyond those that a map can number.
    #[error("a clip has at most 65535 channels")]
    ChannelNumber,
    /// A joint that follows a translation has no scale.
    #[error("a translation needs `scale`, in goal units per cm")]
    NoScale,
    /// The scale is 0 in the steps that a map has.
    #[error("the scale is too small for a servo to move")]
    ScaleZero,
    /// A direction that is none.
    #[error("found {found}, expected 1 or -1")]
    Direction {
        /// The direction.
        found: i8,
    },
    /// No range, or two.
    #[error("expected either `range` or `goal_range`, and not both")]
    Ranges,
    /// A range of another number of values than two.
    #[error("found {found} numbers, expected two: the lowest and the highest")]
    RangeLength {
        /// How many.
        found: usize,
    },
    /// A range of one place.
    #[error("found {found} twice, expected two ends that are apart: the joint could not move")]
    EmptyRange {
        /// Both ends.
        found: f64,
    },
    /// Two servos one behind the other that turn about the same axis.
    #[error("the axis is that of \"{joint}\" before it, so both do the same: the two must be apart")]
    ParallelAxes {
        /// Name of the other joint.
        joint: String,
    },
    /// A turn that counts for nothing.
    #[error("found 0, with which the turn counts for nothing: leave the turn out")]
    WeightZero,
    /// An oscillator of a bus that has none.
    #[error("only a bus of the kind \"pca9685\" has an oscillator")]
    OscillatorElsewhere,
    /// A range beyond that of the servo.
    #[error("these are goals {min} to {max}, a servo takes {lowest} to {highest}")]
    RangeBeyondServo {
        /// Lowest goal of the range.
        min: f64,
        /// Highest goal of the range.
        max: f64,
        /// Lowest goal of the servo.
        lowest: f64,
        /// Highest goal of the servo.
        highest: f64,
    },
    /// A home out of the range.
    #[error("this is goal {goal}, the range is {min} to {max}")]
    HomeOutOfRange {
        /// The goal at home.
        goal: f64,
        /// Lowest goal of the range.
        min: f64,
        /// Highest goal of the range.
        max: f64,
    },
    /// A speed below the least that a map can say.
    #[error("too slow for a servo at {hz} Hz, expected at least {least:.4} {unit}s/s")]
    TooSlow {
        /// Goals a second.
        hz: f64,
        /// Least speed in the channel's unit.
        least: f64,
        /// The channel's unit.
        unit: Unit,
    },
    /// An acceleration below the least that a map can say.
    #[error("too little for a servo at {hz} Hz, expected at least {least:.4} {unit}s/s²")]
    TooGentle {
        /// Goals a second.
        hz: f64,
        /// Least acceleration in the channel's unit.
        least: f64,
        /// The channel's unit.
        unit: Unit,
    },
    /// The idle layer would add more than the joint's range.
    #[error("{found} {unit}s are more than the joint's range")]
    IdleBeyondRange {
        /// What it would add.
        found: f64,
        /// The channel's unit.
        unit: Unit,
    },
    /// What the map's own check says.
    #[error(transparent)]
    Map(#[from] MapError),
}

/// All that is wrong with a puppet, so far.
#[derive(Debug, Default)]
pub(crate) struct Mistakes(Vec<Error>);

impl Mistakes {
    /// Notes a mistake; one of a value that was made up is told to nobody, and one of the whole clip once.
    pub(crate) fn add(&mut self, mistake: Error) {
        let not_fitted = |error: &Error| matches!(error.problem(), Problem::NotFitted);
        if !(mistake.of_filler || not_fitted(&mistake) && self.0.iter().any(not_fitted)) {
            self.0.push(mistake);
        }
    }

    /// Notes several.
    pub(crate) fn add_all(&mut self, mistakes: impl IntoIterator<Item = Error>) {
        mistakes.into_iter().for_each(|mistake| self.add(mistake));
    }

    /// What there is of a result; its error is kept.
    pub(crate) fn note<T>(&mut self, result: Result<T, Error>) -> Option<T> {
        result.map_err(|error| self.add(error)).ok()
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl From<Mistakes> for Vec<Error> {
    fn from(mistakes: Mistakes) -> Self {
        mistakes.0
    }
}
