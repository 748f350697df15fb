//! One channel over time: what was recorded, what is decoded, and the error (figures 7-2, 7-5 and 7-7).

use super::Named;
use super::curve::{Curve, Sweep};
use super::sweep;
use crate::plot::chart::{Axis, Chart, Line, Look, Marker, Panel};
use anyhow::{Context, Result, bail};
use encoder::mclip::Quality;
use puppet_file::Channels;
use std::io::Write;

/// A channel's values, as recorded and as decoded.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Name of the channel.
    pub channel: String,
    /// degrees, or cm.
    pub unit: &'static str,
    /// Frames per second.
    pub fps: f64,
    /// The recorded values, angles continuous.
    pub original: Vec<f64>,
    /// What each curve makes of them with codes of so many bits.
    pub decoded: Vec<Decoded>,
}

/// One decoded channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// Name of the curve.
    pub curve: String,
    /// Bits of a code.
    pub bits: u8,
    /// The values.
    pub values: Vec<f64>,
}

/// How far a decoded channel is off, in its unit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Error<'t> {
    /// Name of the curve.
    pub curve: &'t str,
    /// Bits of a code.
    pub bits: u8,
    /// Root of the mean squared error.
    pub rms: f64,
    /// The largest error.
    pub worst: f64,
}

/// Encodes a motion as each curve says with codes of each number of bits, and takes one channel out.
///
/// # Errors
/// A sentence that names the nearest channels where there is no such one, and one where a curve cannot have so many
/// bits.
pub fn trace(named: &Named, channel: &str, curves: &[Curve], bits: &[u8]) -> Result<Trace> {
    let skeleton = &named.clip.skeleton;
    let (index, _) = Channels::from(skeleton).find(channel).with_context(|| named.name.clone())?;
    let mut motion = named.clip.motion.clone();
    motion.unwrap_angles(skeleton);
    let column = |motion: &mocap::Motion| motion.iter().map(|pose| pose[index]).collect::<Vec<f64>>();
    let mut decoded = Vec::new();
    for curve in curves {
        let Sweep::Bits(encoding) = curve.sweep else { continue };
        for &bits in bits {
            if !(1..=encoding.most_bits()).contains(&bits) {
                bail!("{} has codes of 1 to {} bits, not of {bits}", curve.name, encoding.most_bits());
            }
            let quality = super::curve::Quality::Mclip(encoding, Quality::Bits(bits));
            let clip = sweep::decode(&sweep::encode(named, quality)?, quality)?;
            decoded.push(Decoded { curve: curve.name.clone(), bits, values: column(&clip) });
        }
    }
    Ok(Trace {
        channel: channel.to_owned(),
        unit: if skeleton.channels[index].dof.is_rotation() { "degrees" } else { "cm" },
        fps: motion.fps,
        original: column(&motion),
        decoded,
    })
}

impl Trace {
    /// The picture: for each curve beside each other, the recorded channel with each decoded one, and below the errors.
    pub fn chart(&self, title: &str) -> Chart {
        let of_curve: Vec<&[Decoded]> = self.decoded.chunk_by(|a, b| a.curve == b.curve).collect();
        let rows = of_curve.first().map_or(0, |curve| curve.len());
        let mut panels = Vec::new();
        for row in 0..rows {
            panels.extend(of_curve.iter().map(|curve| {
                let Decoded { curve, bits, values } = &curve[row];
                let lines = vec![
                    self.line("original".to_owned(), 7, &self.original),
                    self.line(levels(*bits), row, values),
                ];
                self.panel(format!("{curve}: {}", levels(*bits)), self.unit.to_owned(), lines)
            }));
        }
        panels.extend(of_curve.iter().map(|curve| {
            let lines = curve
                .iter()
                .enumerate()
                .map(|(row, decoded)| self.line(levels(decoded.bits), row, &self.error(&decoded.values)));
            self.panel(format!("{}: error", curve[0].curve), format!("error, {}", self.unit), lines.collect())
        }));
        let columns = of_curve.len();
        Chart { title: title.to_owned(), panel: (if columns > 1 { 480 } else { 860 }, 230), columns, panels }
    }

    /// How far each decoded channel is off.
    pub fn errors(&self) -> impl Iterator<Item = Error<'_>> {
        self.decoded.iter().map(|Decoded { curve, bits, values }| {
            let error = self.error(values);
            let squares: f64 = error.iter().map(|error| error * error).sum();
            Error {
                curve,
                bits: *bits,
                rms: (squares / error.len().max(1) as f64).sqrt(),
                worst: error.iter().fold(0.0, |worst, error| worst.max(error.abs())),
            }
        })
    }

    fn error(&self, decoded: &[f64]) -> Vec<f64> {
        decoded.iter().zip(&self.original).map(|(decoded, original)| decoded - original).collect()
    }

    fn panel(&self, title: String, unit: String, lines: Vec<Line>) -> Panel {
        let axis = |name| Axis { name, log: false };
        Panel { title, x: axis("seconds".to_owned()), y: axis(unit), lines }
    }

    fn line(&self, name: String, colour: usize, values: &[f64]) -> Line {
        Line {
            name,
            look: Look { colour, dashed: false, marker: Marker::None },
            points: values
                .iter()
                .enumerate()
                .map(|(frame, &value)| (frame as f64 / self.fps, value))
                .collect(),
        }
    }

    /// Writes the seconds, the recorded value, and of every curve and number of bits the decoded value and the error.
    ///
    /// # Errors
    /// Where `out` fails.
    pub fn write_csv(&self, out: &mut dyn Write) -> Result<()> {
        let mut table = csv::Writer::from_writer(out);
        let mut header = vec!["seconds".to_owned(), format!("original_{}", self.unit)];
        for Decoded { curve, bits, .. } in &self.decoded {
            header.extend(["decoded", "error"].map(|what| format!("{curve} {bits} bits {what}")));
        }
        table.write_record(&header)?;
        for (frame, original) in self.original.iter().enumerate() {
            table.write_field((frame as f64 / self.fps).to_string())?;
            table.write_field(original.to_string())?;
            for decoded in &self.decoded {
                let value = decoded.values[frame];
                table.write_field(value.to_string())?;
                table.write_field((value - original).to_string())?;
            }
            table.write_record(None::<&[u8]>)?;
        }
        table.flush()?;
        Ok(())
    }
}

fn levels(bits: u8) -> String {
    format!("{} levels", 1u32 << bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Named {
        Named { name: "sample".into(), clip: mocap::sample::clip() }
    }

    #[test]
    fn errors_are_differences_and_more_levels_make_them_smaller() {
        let curves = [Curve::pcm(), Curve::dpcm_first()];
        let trace = trace(&sample(), "rradius.rx", &curves, &[3, 6]).unwrap();
        assert_eq!((trace.unit, trace.original.len(), trace.decoded.len()), ("degrees", 480, 4));
        let range = trace.original.iter().fold((f64::MAX, f64::MIN), |(a, b), &x| (a.min(x), b.max(x)));
        let worst: Vec<f64> = trace.errors().map(|error| error.worst).collect();
        // Direct quantisation is off by half a step at most, rounded to words.
        assert!(worst[0] <= (range.1 - range.0) / 16.0 * 1.05);
        assert!(worst[1] < worst[0] / 4.0 && worst[3] < worst[2] / 2.0, "{worst:?}");
        assert!(trace.errors().all(|error| error.rms < error.worst));

        let svg = trace.chart("an elbow").svg().unwrap();
        for text in ["original", "8 levels", "64 levels", "pcm: error", "dpcm order 1: error", "seconds"] {
            assert!(svg.contains(text), "{text}");
        }
        let mut csv = Vec::new();
        trace.write_csv(&mut csv).unwrap();
        let mut rows = csv::Reader::from_reader(&*csv);
        assert_eq!(rows.headers().unwrap().get(9), Some("dpcm order 1 6 bits error"));
        let row = rows.records().nth(240).unwrap().unwrap();
        let field = |index: usize| row[index].parse::<f64>().unwrap();
        assert_eq!((field(0), field(1)), (4.0, trace.original[240]));
        assert!((field(8) - field(1) - field(9)).abs() < 1e-12);
    }

    #[test]
    fn an_unknown_channel_and_too_many_bits_are_told() {
        let error = |channel: &str, bits| {
            format!("{:#}", trace(&sample(), channel, &[Curve::mulaw()], &[bits]).unwrap_err())
        };
        assert_eq!(
            error("rradus.rx", 3),
            "sample: the skeleton has no joint \"rradus\"; the nearest channels are rradius.rx, lradius.rx, head.rx"
        );
        assert_eq!(
            error("rradius.rz", 3),
            "sample: \"rradius.rz\" is no channel of the skeleton; its joint has rradius.rx"
        );
        assert_eq!(error("rradius.rx", 10), "mulaw has codes of 1 to 9 bits, not of 10");
    }
}
