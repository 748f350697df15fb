//! Parts of a body and their plain names.

use std::fmt;

/// A side of the body, as the figure itself calls it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The figure's left.
    Left,
    /// The figure's right.
    Right,
}

impl Side {
    /// Both, left first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// `left` or `right`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
        }
    }

    /// +1 for left and -1 for right: the direction of the side along the figure's x axis.
    pub const fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }
}

/// A part of the body: a bone, and the joint whose rotation turns it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Part {
    /// The hips, from which the spine and the legs go out.
    Hips,
    /// The lowest bone of the spine.
    Spine,
    /// The bone of the spine from which the arms go out.
    Chest,
    /// The lowest bone of the neck.
    Neck,
    /// The head.
    Head,
    /// The collar bone, from chest to shoulder.
    Clavicle(Side),
    /// From shoulder to elbow.
    UpperArm(Side),
    /// From elbow to wrist.
    Forearm(Side),
    /// From the wrist on.
    Hand(Side),
    /// From hip to knee.
    Thigh(Side),
    /// From knee to ankle.
    Shin(Side),
    /// From the ankle on.
    Foot(Side),
    /// The toes, from the ball of the foot on.
    Toes(Side),
}

impl Part {
    /// All of them: the middle from the hips up, then the left side, then the right.
    pub const ALL: [Self; 21] = {
        use Side::{Left, Right};
        [
            Self::Hips,
            Self::Spine,
            Self::Chest,
            Self::Neck,
            Self::Head,
            Self::Clavicle(Left),
            Self::UpperArm(Left),
            Self::Forearm(Left),
            Self::Hand(Left),
            Self::Thigh(Left),
            Self::Shin(Left),
            Self::Foot(Left),
            Self::Toes(Left),
            Self::Clavicle(Right),
            Self::UpperArm(Right),
            Self::Forearm(Right),
            Self::Hand(Right),
            Self::Thigh(Right),
            Self::Shin(Right),
            Self::Foot(Right),
            Self::Toes(Right),
        ]
    };

    /// Its side, if it has one.
    pub const fn side(self) -> Option<Side> {
        match self {
            Self::Hips | Self::Spine | Self::Chest | Self::Neck | Self::Head => None,
            Self::Clavicle(side)
            | Self::UpperArm(side)
            | Self::Forearm(side)
            | Self::Hand(side)
            | Self::Thigh(side)
            | Self::Shin(side)
            | Self::Foot(side)
            | Self::Toes(side) => Some(side),
        }
    }

    /// The part of that plain name: `right upper arm`. Upper case, `_` and `-` for a space are accepted.
    pub fn parse(name: &str) -> Option<Self> {
        let same = |c: char| if c == '_' || c == '-' { ' ' } else { c.to_ascii_lowercase() };
        let name: String = name.trim().chars().map(same).collect();
        Self::ALL.into_iter().find(|part| part.to_string() == name)
    }

    /// Its plain name: `head`, `right upper arm`.
    pub fn name(self) -> String {
        self.to_string()
    }

    /// Its place in [`ALL`](Self::ALL).
    pub(super) fn index(self) -> usize {
        Self::ALL.iter().position(|&part| part == self).unwrap_or(0)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Hips => "hips",
            Self::Spine => "spine",
            Self::Chest => "chest",
            Self::Neck => "neck",
            Self::Head => "head",
            Self::Clavicle(_) => "clavicle",
            Self::UpperArm(_) => "upper arm",
            Self::Forearm(_) => "forearm",
            Self::Hand(_) => "hand",
            Self::Thigh(_) => "thigh",
            Self::Shin(_) => "shin",
            Self::Foot(_) => "foot",
            Self::Toes(_) => "toes",
        };
        match self.side() {
            Some(side) => write!(f, "{} {name}", side.name()),
            None => f.write_str(name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_that_of_one_part() {
        for part in Part::ALL {
            assert_eq!(Part::parse(&part.name()), Some(part));
            assert_eq!(Part::ALL[part.index()], part);
        }
        assert_eq!(Part::parse("Right_Upper-Arm"), Some(Part::UpperArm(Side::Right)));
        assert_eq!(Part::parse("forearm"), None);
    }
}
