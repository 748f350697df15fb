//! What fit is asked for: the joints of a puppet, and what each of them follows in a figure.

/// The joints of a puppet, and its chains.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The joints, in the order of the fitted clip's channels.
    pub joints: Vec<Joint>,
    /// The chains that joints are parts of.
    pub chains: Vec<Chain>,
    /// Limbs of the figure whose twist is known: the joint of the upper bone, and degrees about it from the T-pose. That of
    /// others is found from the recording.
    pub twists: Vec<(usize, f64)>,
}

/// A joint of a puppet. Its values are degrees, or centimetres where it follows a translation.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name, unique in the plan.
    pub name: String,
    /// What it follows.
    pub follows: Follows,
    /// Whether its values are degrees.
    pub is_rotation: bool,
    /// What is added to what it follows.
    pub offset: f64,
    /// Lowest and highest value.
    pub range: [f64; 2],
    /// Highest speed, in units a second.
    pub max_speed: f64,
    /// Highest acceleration, in units a second squared.
    pub max_acceleration: f64,
}

/// What a joint follows.
#[derive(Clone, Debug, PartialEq)]
pub enum Follows {
    /// A channel of the figure's skeleton, by its index.
    Channel(usize),
    /// A channel whose values are goals of the servo; the joint's offset does not count.
    Goals {
        /// Index of the channel.
        channel: usize,
        /// The goal at value 0.
        zero: f64,
        /// Goals a unit of the joint, below 0 for a servo that is mounted the other way round.
        scale: f64,
    },
    /// The sum of turns, each times its weight; a single turn is a sum of one.
    Turns(Vec<(Turn, f64)>),
    /// What a chain needs of it. The joints of a chain come in the order of the plan, the first nearest to the bone that
    /// stays.
    Chain {
        /// Index of the chain.
        chain: usize,
        /// What the joint turns about in the T-pose, in figure axes: a unit vector.
        axis: [f64; 3],
    },
}

/// The rotation of a bone against another about an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Turn {
    /// The bones.
    pub bones: Bones,
    /// The axis in the T-pose, in figure axes: a unit vector.
    pub axis: [f64; 3],
}

/// A bone and the one that it is seen from, as joints of the skeleton.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bones {
    /// The bone that turns.
    pub bone: usize,
    /// The bone against which it turns; `None` for the world.
    pub against: Option<usize>,
}

/// One to three joints in series that turn a bone against another.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// Name, for reports.
    pub name: String,
    /// The bones.
    pub bones: Bones,
}
