//! What a puppet asks of a clip, before it is stored and before it plays.

use crate::clock::keeps_up;
use crate::play_error::PlayError;

/// What a clip says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Facts {
    /// Frames.
    pub frames: u32,
    /// Channels in a frame.
    pub channels: usize,
    /// Frames per second, in hundredths.
    pub rate_centihertz: u16,
    /// Digest of the channels' names ([`names_digest`](decoder_core::mclip::Header::names_digest)), where the clip has names.
    pub names: Option<u32>,
}

/// What a joint map asks of a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Demands {
    /// Channels that the clip must have; 0: enough for [`furthest`](Self::furthest).
    pub channels: u16,
    /// Digest of their names; 0: not known.
    pub names: u32,
    /// The highest channel that a joint follows, and the id of its servo.
    pub furthest: (u16, u8),
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
    pub fn check_channels(&self, channels: usize, names: Option<u32>) -> Result<(), PlayError> {
        let found = u32::try_from(channels).unwrap_or(u32::MAX);
        if self.channels > 0 && usize::from(self.channels) != channels {
            return Err(PlayError::Channels { found, expected: self.channels });
        }
        let (channel, id) = self.furthest;
        if usize::from(channel) >= channels {
            return Err(PlayError::Channel { id, channel, channels: found });
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
        let demands = Demands { channels: 3, names: 7, furthest: (2, 11), tick_hz: 50 };
        let clip = Facts { frames: 10, channels: 3, rate_centihertz: 6_000, names: Some(7) };
        assert_eq!(demands.check(&clip), Ok(()));
        let any = Demands { channels: 0, ..demands };
        let unnamed = Demands { names: 0, ..demands };
        for (demands, clip, error) in [
            (demands, Facts { rate_centihertz: 0, ..clip }, Some(PlayError::Rate)),
            (
                demands,
                Facts { rate_centihertz: u16::MAX, ..clip },
                None,
            ),
            (
                Demands { tick_hz: 1, ..demands },
                clip,
                Some(PlayError::TooFast { rate_centihertz: 6_000, tick_hz: 1 }),
            ),
            (demands, Facts { channels: 4, ..clip }, Some(PlayError::Channels { found: 4, expected: 3 })),
            (any, Facts { channels: 4, ..clip }, None),
            (any, Facts { channels: 2, ..clip }, Some(PlayError::Channel { id: 11, channel: 2, channels: 2 })),
            (demands, Facts { names: Some(8), ..clip }, Some(PlayError::Names { found: 8, expected: 7 })),
            (demands, Facts { names: None, ..clip }, None),
            (unnamed, Facts { names: Some(8), ..clip }, None),
            (demands, Facts { frames: 0, ..clip }, Some(PlayError::NoFrames)),
        ] {
            assert_eq!(demands.check(&clip).err(), error, "{clip:?}");
        }
    }
}
