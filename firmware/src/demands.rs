//! What a puppet asks of a clip, before it is stored and before it plays.

use crate::clock::keeps_up;
use crate::play_error::PlayError;
use decoder_core::mclip::{Header, MAGIC};
use decoder_core::{Error, Limits, qmd};
use serde::Serialize;

/// What a clip says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Facts {
    /// Frames.
    pub frames: u32,
    /// Channels in a frame.
    pub channels: u32,
    /// Frames per second, in hundredths.
    pub rate_centihertz: u16,
    /// Digest of the channels' names ([`names_digest`](decoder_core::mclip::Header::names_digest)), where the clip has names.
    pub names: Option<u32>,
}

impl Facts {
    /// What the bytes of a clip say.
    ///
    /// # Errors
    /// What is wrong with the header.
    pub fn of(clip: &[u8]) -> Result<Self, Error> {
        if clip.starts_with(&MAGIC) {
            Header::parse(clip, Limits::MAX).map(|header| Self::from(&header))
        } else {
            qmd::Clip::parse(clip, Limits::MAX).map(|clip| Self::from(&clip))
        }
    }
}

impl From<&Header<'_>> for Facts {
    fn from(header: &Header<'_>) -> Self {
        Self {
            frames: header.frames(),
            channels: count(header.channel_count()),
            rate_centihertz: header.rate_centihertz(),
            names: header.names_digest(),
        }
    }
}

impl From<&qmd::Clip<'_>> for Facts {
    fn from(clip: &qmd::Clip<'_>) -> Self {
        let (frames, channels) = (clip.frames(), count(clip.channels()));
        Self { frames, channels, rate_centihertz: clip.rate_centihertz(), names: None }
    }
}

/// A number of channels, of which there are at most 65,535.
pub(crate) fn count(channels: usize) -> u32 {
    u32::try_from(channels).unwrap_or(u32::MAX)
}

/// What a joint map asks of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Demands {
    /// Channels that the clip must have; 0: enough for [`furthest_channel`](Self::furthest_channel).
    pub channels: u16,
    /// Digest of their names; 0: not known.
    pub names: u32,
    /// The highest channel that a joint follows.
    pub furthest_channel: u16,
    /// The id of that joint's servo.
    pub furthest_id: u8,
    /// Ticks a second.
    pub tick_hz: u16,
}

impl Demands {
    /// Whether a clip can be played.
    ///
    /// # Errors
    /// Why it cannot.
    pub fn check(&self, facts: &Facts) -> Result<(), PlayError> {
        let Facts { frames, channels, rate_centihertz, names } = *facts;
        if rate_centihertz == 0 {
            return Err(PlayError::Rate);
        }
        if !keeps_up(rate_centihertz, self.tick_hz) {
            return Err(PlayError::TooFast { rate_centihertz, tick_hz: self.tick_hz });
        }
        self.check_channels(channels, names)?;
        if frames == 0 { Err(PlayError::NoFrames) } else { Ok(()) }
    }

    /// Whether these are the channels. Names that one side does not know are not compared.
    ///
    /// # Errors
    /// [`PlayError::Channels`], [`PlayError::Channel`], [`PlayError::Names`].
    pub fn check_channels(&self, channels: u32, names: Option<u32>) -> Result<(), PlayError> {
        if self.channels > 0 && u32::from(self.channels) != channels {
            return Err(PlayError::Channels { found: channels, expected: self.channels });
        }
        let (channel, id) = (self.furthest_channel, self.furthest_id);
        if u32::from(channel) >= channels {
            return Err(PlayError::Channel { id, channel, channels });
        }
        match names {
            Some(found) if self.names != 0 && found != self.names => {
                Err(PlayError::Names { found, expected: self.names })
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_demand_is_refused_by_its_own_error() {
        let demands = Demands { channels: 3, names: 7, furthest_channel: 2, furthest_id: 11, tick_hz: 50 };
        let clip = Facts { frames: 10, channels: 3, rate_centihertz: 6_000, names: Some(7) };
        assert_eq!(demands.check(&clip), Ok(()));
        let any = Demands { channels: 0, ..demands };
        let unnamed = Demands { names: 0, ..demands };
        for (demands, clip, error) in [
            (demands, Facts { rate_centihertz: 0, ..clip }, Some(PlayError::Rate)),
            (demands, Facts { rate_centihertz: u16::MAX, ..clip }, None),
            (
                Demands { tick_hz: 1, ..demands },
                clip,
                Some(PlayError::TooFast { rate_centihertz: 6_000, tick_hz: 1 }),
            ),
            (demands, Facts { channels: 4, ..clip }, Some(PlayError::Channels { found: 4, expected: 3 })),
            (any, Facts { channels: 4, ..clip }, None),
            (
                any,
                Facts { channels: 2, ..clip },
                Some(PlayError::Channel { id: 11, channel: 2, channels: 2 }),
            ),
            (demands, Facts { names: Some(8), ..clip }, Some(PlayError::Names { found: 8, expected: 7 })),
            (demands, Facts { names: None, ..clip }, None),
            (unnamed, Facts { names: Some(8), ..clip }, None),
            (demands, Facts { frames: 0, ..clip }, Some(PlayError::NoFrames)),
        ] {
            assert_eq!(demands.check(&clip).err(), error, "{clip:?}");
        }
    }
}
