//! Rate against distortion: codecs over their range of qualities, on as many motions as are given.
//!
//! [`curve`] says what is swept, [`sweep`] encodes, decodes and measures, [`figure`] makes the graphs of the
//! waveform-coding document (7-3, 7-6, 7-8) and of the QMD paper (5, 6) of it, [`trace`] those of one channel over
//! time (7-2, 7-5, 7-7), and [`chart`](crate::plot::chart) draws. docs/RD.md has the commands and what they gave.

pub mod curve;
pub mod figure;
pub mod psnr;
pub mod sweep;
pub mod trace;

use anyhow::{Result, bail};
use mocap::Clip;

/// A motion and what it is called.
#[derive(Clone, Debug)]
pub struct Named {
    /// The file's name without its extension.
    pub name: String,
    /// The motion.
    pub clip: Clip,
}

/// Samples a motion at another rate, as [`mocap::resample`] does.
///
/// # Errors
/// A sentence where the motion was recorded at less.
pub fn resample(named: Named, fps: f64) -> Result<Named> {
    let Named { name, clip: Clip { skeleton, motion } } = named;
    // A rate from a file may be 29.9998: that is 30.
    if fps > motion.fps * 1.001 {
        bail!("{name} was recorded at {} frames per second, expected at least {fps}", motion.fps);
    }
    Ok(Named { name, clip: Clip { motion: mocap::resample(&skeleton, &motion, fps), skeleton } })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Named {
        Named { name: "sample".into(), clip: mocap::sample::clip() }
    }

    #[test]
    fn a_fraction_of_the_rate_takes_frames_as_they_are() {
        let whole = sample();
        let third = resample(whole.clone(), 20.0).unwrap().clip.motion;
        assert_eq!((third.frames(), third.fps), (160, 20.0));
        for frame in 0..third.frames() {
            assert_eq!(third.frame(frame), whole.clip.motion.frame(3 * frame));
        }
    }

    #[test]
    fn other_rates_are_between_frames_and_higher_ones_are_refused() {
        let whole = sample();
        let off = resample(whole.clone(), 40.0).unwrap().clip.motion;
        assert_eq!(off.frames(), 320);
        for channel in 0..off.channels {
            let (from, to) = (whole.clip.motion.frame(301)[channel], whole.clip.motion.frame(302)[channel]);
            assert!((off.frame(201)[channel] - f64::midpoint(from, to)).abs() < 1e-9);
        }
        let refused = resample(whole, 61.0).unwrap_err().to_string();
        assert_eq!(refused, "sample was recorded at 60 frames per second, expected at least 61");
    }
}
