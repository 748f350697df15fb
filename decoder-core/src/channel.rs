//! A channel: what of a joint moves, and how its values are coded.

use core::fmt;

/// Bits of the mantissa of Δ, where a channel has a [grid](Rules::grid).
pub const MANTISSA_BITS: u32 = 15;

/// Most bits of a value at an entry point.
pub const MAX_ENTRY_BITS: u8 = 32;

/// What the record of a channel may be, which is the codec's to say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rules {
    /// Most bits of a code, at most 16.
    pub bits: u8,
    /// Highest index of a step.
    pub step: u8,
    /// Whether a channel has a grid of values: the lowest one, and Δ as mantissa and exponent. Other channels have a
    /// step, a coefficient of the predictor, and values at entry points.
    pub grid: bool,
}

/// What a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelKind {
    /// Translation along x, in centimetres.
    Tx,
    /// Translation along y, in centimetres.
    Ty,
    /// Translation along z, in centimetres.
    Tz,
    /// Rotation about x, in degrees.
    Rx,
    /// Rotation about y, in degrees.
    Ry,
    /// Rotation about z, in degrees.
    Rz,
    /// Length of the bone beyond its rest length, in centimetres (ASF `l`).
    Length,
}

impl ChannelKind {
    /// All kinds, in the order of their numbers.
    pub const ALL: [Self; 7] = [Self::Tx, Self::Ty, Self::Tz, Self::Rx, Self::Ry, Self::Rz, Self::Length];

    /// Its number in a header.
    pub const fn id(self) -> u8 {
        self as u8
    }

    /// The kind with this number.
    pub fn from_id(id: u8) -> Option<Self> {
        Self::ALL.get(usize::from(id)).copied()
    }

    /// Its name in an ASF file, in lower case: `tx`, `rz`, `l`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tx => "tx",
            Self::Ty => "ty",
            Self::Tz => "tz",
            Self::Rx => "rx",
            Self::Ry => "ry",
            Self::Rz => "rz",
            Self::Length => "l",
        }
    }

    /// Whether it is a rotation, in degrees; the others are lengths, in centimetres.
    pub const fn is_rotation(self) -> bool {
        matches!(self, Self::Rx | Self::Ry | Self::Rz)
    }

    /// 0, 1 or 2 for a rotation about, or a translation along, x, y or z; `None` for [`Length`](Self::Length).
    pub const fn axis(self) -> Option<usize> {
        match self {
            Self::Tx | Self::Rx => Some(0),
            Self::Ty | Self::Ry => Some(1),
            Self::Tz | Self::Rz => Some(2),
            Self::Length => None,
        }
    }
}

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel<'a> {
    /// Name of its joint; empty where the clip names none.
    pub joint: &'a str,
    /// What it moves.
    pub kind: ChannelKind,
    /// A word. On a grid: the lowest value; with 0 bits, its value in the whole clip; else 0.
    pub low: i32,
    /// Bits of its value at an entry point, 1 to [`MAX_ENTRY_BITS`]; channels on a grid or of 0 bits have no such values.
    pub entry_bits: u8,
    /// Places by which its values are shifted at an entry point, and `low` is stored with, 0 to 27.
    pub entry_shift: u8,
    /// Bits of a code, 0 to 16; with 0, the channel keeps its value.
    pub bits: u8,
    /// Index of its step, or of its first step where it adapts; on a grid: the exponent of Δ.
    pub step: u8,
    /// Its group of code tables.
    pub group: u8,
    /// Coefficient of its predictor; on a grid: the mantissa of Δ.
    pub coefficient: i16,
}

/// `rradius.rx`, or `rx` where the clip names no joints.
impl fmt::Display for Channel<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.joint.is_empty() {
            formatter.write_str(self.joint)?;
            formatter.write_str(".")?;
        }
        formatter.write_str(self.kind.name())
    }
}

/// Places by which values are shifted at an entry point, where the step is as this index says: steps are told apart to
/// 2^precision parts at least. On a grid, the lowest value is in units of the mantissa's.
pub const fn entry_shift(step: u8, precision: u8, grid: bool) -> u8 {
    if grid { step } else { (step >> 3).wrapping_add(3).saturating_sub(precision) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    const CHANNEL: Channel<'_> = Channel {
        joint: "rradius",
        kind: ChannelKind::Rx,
        low: 0,
        entry_bits: 10,
        entry_shift: 13,
        bits: 8,
        step: 104,
        group: 0,
        coefficient: 0,
    };

    #[test]
    fn channels_are_named_by_joint_and_kind() {
        assert_eq!(CHANNEL.to_string(), "rradius.rx");
        assert_eq!(Channel { joint: "", kind: ChannelKind::Length, ..CHANNEL }.to_string(), "l");
        for (id, kind) in ChannelKind::ALL.into_iter().enumerate() {
            assert_eq!((usize::from(kind.id()), ChannelKind::from_id(id as u8)), (id, Some(kind)));
        }
        assert_eq!(ChannelKind::from_id(7), None);
    }

    #[test]
    fn kinds_are_named_as_in_asf_and_turn_or_not() {
        let all = ChannelKind::ALL.map(|kind| (kind.name(), kind.is_rotation(), kind.axis()));
        let expected = [
            ("tx", false, Some(0)),
            ("ty", false, Some(1)),
            ("tz", false, Some(2)),
            ("rx", true, Some(0)),
            ("ry", true, Some(1)),
            ("rz", true, Some(2)),
            ("l", false, None),
        ];
        assert_eq!(all, expected);
    }

    #[test]
    fn entry_shifts_follow_the_octave_of_the_step() {
        for step in 0..=199u8 {
            let octave = crate::quantise::step::size(step).ilog2() as u8;
            for precision in 0..16 {
                assert_eq!(entry_shift(step, precision, false), octave.saturating_sub(precision));
            }
        }
        assert_eq!(entry_shift(9, 3, true), 9);
    }
}
