//! The graphs: which curves they show, and how their points become lines.

use super::curve::{Curve, Sweep};
use super::sweep::{POOLED, Point};
use crate::plot::chart::{Axis, Chart, Line, Look, Marker, Panel};
use decoder_core::mclip::{CodecId, EntropyId};

/// A graph of the two documents that this reproduces. Those over time, of one channel, are [`super::trace`]'s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// Waveform coding 7-2 (over time), 7-3: direct quantisation.
    Direct,
    /// 7-5 (over time), 7-6: predictive coding.
    Predictive,
    /// 7-7 (over time), 7-8: adaptive predictive coding.
    Adaptive,
    /// QMD 5: file size against FDF.
    QmdSize,
    /// QMD 6: reconstruction error against FDF.
    QmdError,
}

/// b in the QMD paper's figures 5 and 6.
const INDEX_BITS: std::ops::RangeInclusive<u8> = 8..=11;

impl Figure {
    /// What it shows, in words.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Direct => "direct quantisation",
            Self::Predictive => "predictive coding",
            Self::Adaptive => "adaptive predictive coding",
            Self::QmdSize => "QMD size against FDF",
            Self::QmdError => "QMD error against FDF",
        }
    }

    /// Its curves. Those of the waveform-coding document have the entropy stage that it has there, unless another is
    /// asked for: direct quantisation none, the others the smallest.
    pub fn curves(self, faithful: bool) -> Vec<Curve> {
        let plain = |mut curve: Curve| {
            if let Sweep::Bits(encoding) = &mut curve.sweep {
                encoding.entropy = Some(EntropyId::FixedWidth);
            }
            curve
        };
        match self {
            Self::Direct => vec![plain(Curve::pcm())],
            Self::Predictive => vec![Curve::dpcm_first(), Curve::mulaw()],
            Self::Adaptive => vec![Curve::adpcm_both()],
            Self::QmdSize | Self::QmdError => INDEX_BITS.map(|bits| Curve::qmd(bits, faithful)).collect(),
        }
    }

    /// The picture. Where there is one motion or more, each is a line of its own in the waveform-coding document's
    /// graphs, and a panel of its own in the QMD paper's.
    pub fn chart(self, title: &str, points: &[Point]) -> Chart {
        let panels = match self {
            Self::Direct | Self::Predictive | Self::Adaptive => self.by_curve(points),
            Self::QmdSize => by_clip(points, "KB", |point| point.bytes as f64 / 1024.0, false),
            Self::QmdError => by_clip(points, "mean joint error, cm", |point| point.mean_joint_cm, true),
        };
        let columns = panels.len().min(if panels.len() == 4 { 2 } else { 3 });
        let panel = if panels.len() > 2 { (400, 330) } else { (520, 430) };
        Chart { title: title.to_owned(), panel, columns, panels }
    }
}

impl Figure {
    /// The rate that it shows. The waveform-coding document counts the codes alone, and so do its graphs: a clip's header
    /// is as large for three seconds of motion as for an hour of it.
    pub fn rate(self, point: &Point) -> f64 {
        match self {
            Self::Direct | Self::Predictive | Self::Adaptive => point.blocks_bits_per_s,
            Self::QmdSize | Self::QmdError => None,
        }
        .unwrap_or(point.bits_per_s)
    }

    /// A panel for every curve with a line for every motion.
    fn by_curve(self, points: &[Point]) -> Vec<Panel> {
        let of_curve = |of_curve: &[Point]| Panel {
            title: of_curve[0].curve.clone(),
            x: axis("bits per second, without the clip's header", true),
            y: axis("PSNR, dB", false),
            lines: groups(of_curve)
                .enumerate()
                .map(|(index, line)| Line {
                    name: line[0].clip.clone(),
                    look: if line[0].clip == POOLED { Look::TOTAL } else { Look::nth(index) },
                    points: line
                        .iter()
                        .filter_map(|point| Some((self.rate(point), point.psnr_db?)))
                        .collect(),
                })
                .collect(),
        };
        points.chunk_by(|a, b| a.curve == b.curve).map(of_curve).collect()
    }
}

/// The graph of all curves: PSNR, joint error and RMS degrees against bits per second, of all motions pooled.
pub fn overview(title: &str, points: &[Point]) -> Chart {
    type Measure = fn(&Point) -> Option<f64>;
    let measures: [(&str, bool, Measure); 3] = [
        ("PSNR, dB", false, |point| point.psnr_db),
        ("mean joint error, cm", true, |point| Some(point.mean_joint_cm)),
        ("RMS error of rotations, degrees", true, |point| Some(point.rms_deg)),
    ];
    let panels = measures.map(|(name, log, of)| {
        let mut counts = [0; CodecId::ALL.len()];
        let lines = groups(points).filter(|line| is_total(line, points)).map(|line| {
            let codec = CodecId::ALL.iter().position(|codec| codec.name() == line[0].codec).unwrap_or(0);
            let steps = line[0].step_cm.is_some();
            let marker = [Marker::Disc, Marker::Triangle, Marker::Cross][counts[codec] % 3];
            counts[codec] += 1;
            Line {
                name: line[0].curve.clone(),
                look: Look { colour: codec, dashed: steps, marker },
                // A .qmd whose channels all are floats has nothing that its codec does, and next to no error.
                points: (line.iter().filter(|point| point.fdf.map(usize::from) != Some(point.channels)))
                    .filter_map(|point| Some((point.bits_per_s, of(point)?)))
                    .collect(),
            }
        });
        Panel {
            title: String::new(),
            x: axis("bits per second", true),
            y: axis(name, log),
            lines: lines.collect(),
        }
    });
    Chart { title: title.to_owned(), panel: (430, 460), columns: 3, panels: panels.into() }
}

fn axis(name: &str, log: bool) -> Axis {
    Axis { name: name.to_owned(), log }
}

/// The points of each curve on each motion, in order.
pub fn groups(points: &[Point]) -> impl Iterator<Item = &[Point]> {
    points.chunk_by(|a, b| a.curve == b.curve && a.clip == b.clip)
}

/// Whether these points stand for all motions: pooled, or of the only one.
fn is_total(group: &[Point], points: &[Point]) -> bool {
    let pooled = points.iter().any(|point| point.clip == POOLED);
    !pooled || group[0].clip == POOLED
}

/// A panel for every motion with a line for every curve, against FDF.
fn by_clip(points: &[Point], name: &str, of: fn(&Point) -> f64, log: bool) -> Vec<Panel> {
    let mut clips: Vec<&str> = points.iter().map(|point| point.clip.as_str()).collect();
    clips.sort_unstable();
    clips.dedup();
    clips.retain(|&clip| clip != POOLED);
    let panel = |clip: &str| Panel {
        title: clip.to_owned(),
        x: axis("FDF, channels that stay floats", false),
        y: axis(name, log),
        lines: groups(points)
            .filter(|line| line[0].clip == clip)
            .enumerate()
            .map(|(index, line)| Line {
                name: line[0].curve.clone(),
                look: Look::nth(index),
                points: line.iter().filter_map(|point| Some((f64::from(point.fdf?), of(point)))).collect(),
            })
            .collect(),
    };
    clips.into_iter().map(panel).collect()
}
