//! Encodes, decodes and measures every quality of every curve on every motion, on all of the machine's cores.

use super::Named;
use super::curve::{Curve, Quality};
use anyhow::{Context, Result};
use decoder_core::Limits;
use decoder_core::mclip::Clip;
use encoder::mclip::{self, Encoder};
use encoder::qmd::{self, Method, Parameters};
use encoder::source::Source;
use mocap::metrics::{self, Report};
use rayon::prelude::*;
use std::io::Write;

/// The clip that a point of all motions together names.
pub const POOLED: &str = "pooled";

/// What a motion came to at one quality of a curve: a row of the CSV.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Point {
    /// The motion, or [`POOLED`].
    pub clip: String,
    /// The curve.
    pub curve: String,
    /// The codec.
    pub codec: &'static str,
    /// The entropy stage that was used: where the smallest is taken, which one it was. None in a .qmd, and none of a
    /// pooled point whose motions differ in it.
    pub entropy: Option<&'static str>,
    /// Bits of a code, where they set the quality.
    pub bits: Option<u8>,
    /// Displacement of the joints that a step makes in cm, where it sets the quality.
    pub step_cm: Option<f64>,
    /// Leading channels that are floats (.qmd).
    pub fdf: Option<u16>,
    /// Frames that were encoded.
    pub frames: usize,
    /// Frames per second.
    pub fps: f64,
    /// Channels of a frame.
    pub channels: usize,
    /// Bytes of the whole clip, its header included.
    pub bytes: u64,
    /// How many of them are its header, with names and code tables. None in a .qmd.
    pub header_bytes: Option<u64>,
    /// All bytes as bits per second of motion.
    pub bits_per_s: f64,
    /// Those of the blocks alone: codes and the blocks' own headers, without the clip's. None in a .qmd. The
    /// waveform-coding document counts no header at all.
    pub blocks_bits_per_s: Option<f64>,
    /// How many times larger the motion is as float32.
    pub ratio_f32: f64,
    /// How many times larger the motion is in 16-bit samples, the document's raw rate.
    pub ratio_i16: f64,
    /// Mean joint error in cm after forward kinematics, over joints and frames.
    pub mean_joint_cm: f64,
    /// Root of the mean squared error of the rotations in degrees.
    pub rms_deg: f64,
    /// PSNR of the rotations in dB; none where there is no error or no movement.
    pub psnr_db: Option<f64>,
    /// Σ over rotations of their squared ranges, and how many there are: what pooling needs.
    #[serde(skip)]
    peak: (f64, f64),
}

/// A motion that is ready to be encoded many times.
struct Ready<'m> {
    named: &'m Named,
    encoder: Encoder<'m>,
    source: Source,
}

/// Encodes a motion at one quality.
///
/// # Errors
/// A sentence where the codec cannot hold the motion.
pub fn encode(named: &Named, quality: Quality) -> Result<Vec<u8>> {
    let ready = Ready::new(named)?;
    ready.encode(quality)
}

/// Decodes a clip that [`encode`] made.
///
/// # Errors
/// A sentence where it is not sound.
pub fn decode(bytes: &[u8], quality: Quality) -> Result<mocap::Motion> {
    Ok(match quality {
        Quality::Mclip(..) => mclip::decode(bytes)?,
        Quality::Qmd { .. } => qmd::decode(bytes)?,
    })
}

/// Encodes all. The points are in the order of curves, in each of motions (and of [`POOLED`], where there is more than
/// one), and in each of qualities. `done` is told each time that one of [`len`] encodes is done.
///
/// # Errors
/// A sentence that names the motion that cannot be encoded.
pub fn sweep_all(motions: &[Named], curves: &[Curve], done: &(dyn Fn() + Sync)) -> Result<Vec<Point>> {
    let ready = motions.iter().map(Ready::new).collect::<Result<Vec<_>>>()?;
    let jobs: Vec<(&Curve, &Ready, Quality)> = curves
        .iter()
        .flat_map(|curve| {
            ready.iter().flat_map(move |ready| {
                let qualities = curve.qualities(ready.named.clip.motion.channels);
                qualities.into_iter().map(move |quality| (curve, ready, quality))
            })
        })
        .collect();
    let points: Vec<Point> = jobs
        .into_par_iter()
        .map(|(curve, ready, quality)| {
            let point = ready.measure(curve, quality);
            done();
            point
        })
        .collect::<Result<_>>()?;
    if motions.len() < 2 {
        return Ok(points);
    }
    let mut all = Vec::with_capacity(points.len() * (motions.len() + 1) / motions.len());
    for of_curve in points.chunk_by(|a, b| a.curve == b.curve) {
        all.extend_from_slice(of_curve);
        let qualities = of_curve.len() / motions.len();
        for quality in 0..qualities {
            let same: Vec<&Point> = of_curve.iter().skip(quality).step_by(qualities).collect();
            all.extend(pool(&same));
        }
    }
    Ok(all)
}

/// How many encodes [`sweep_all`] does.
pub fn len(motions: &[Named], curves: &[Curve]) -> usize {
    let of = |curve: &Curve| {
        motions.iter().map(|named| curve.qualities(named.clip.motion.channels).len()).sum::<usize>()
    };
    curves.iter().map(of).sum()
}

impl<'m> Ready<'m> {
    fn new(named: &'m Named) -> Result<Self> {
        let cannot = || format!("cannot encode {}", named.name);
        let (skeleton, motion) = (&named.clip.skeleton, &named.clip.motion);
        Ok(Self {
            named,
            encoder: Encoder::new(skeleton, motion).with_context(cannot)?,
            source: Source::new(skeleton, motion).with_context(cannot)?,
        })
    }

    fn encode(&self, quality: Quality) -> Result<Vec<u8>> {
        match quality {
            Quality::Mclip(encoding, quality) => Ok(self.encoder.encode(&encoding, quality)?),
            Quality::Qmd { index_bits, fixed_channels, faithful } => {
                let method = if faithful { Method::FAITHFUL } else { Method::ClosedLoop };
                let parameters = Parameters { index_bits, fixed_channels, segment_frames: u32::MAX };
                let encoded = self.source.encode(parameters, method);
                encoded.with_context(|| format!("cannot encode {}", self.named.name))
            }
        }
    }

    fn measure(&self, curve: &Curve, quality: Quality) -> Result<Point> {
        let bytes = self.encode(quality)?;
        let decoded = decode(&bytes, quality)
            .with_context(|| format!("{}: {} cannot be decoded", self.named.name, curve.name))?;
        let (skeleton, motion) = (&self.named.clip.skeleton, &self.named.clip.motion);
        let report = metrics::compare(skeleton, motion, &decoded, bytes.len() as u64)?;
        let rotations = skeleton.rotation_channels().iter().filter(|&&rotates| rotates).count() as f64;
        let Report { frames, channels, fps, mean_joint_cm, rms_deg, psnr_db, .. } = report;
        let mse = rms_deg * rms_deg * rotations;
        let (bits, step_cm, fdf) = match quality {
            Quality::Mclip(_, mclip::Quality::Bits(bits)) => (Some(bits), None, None),
            Quality::Mclip(_, mclip::Quality::Step(cm)) => (None, Some(cm), None),
            // Not swept: its steps have a unit that no column has.
            Quality::Mclip(_, mclip::Quality::Even(_) | mclip::Quality::Each(_)) => (None, None, None),
            Quality::Qmd { index_bits, fixed_channels, .. } => (Some(index_bits), None, Some(fixed_channels)),
        };
        let (entropy, header_bytes) = match quality {
            Quality::Mclip(..) => {
                let clip = Clip::parse(&bytes, Limits::MAX)?;
                (Some(clip.header().entropy().name()), Some(clip.header_bytes() as u64))
            }
            Quality::Qmd { .. } => (None, None),
        };
        let point = Point {
            clip: self.named.name.clone(),
            curve: curve.name.clone(),
            codec: curve.codec().name(),
            entropy,
            bits,
            step_cm,
            fdf,
            frames,
            fps,
            channels,
            bytes: bytes.len() as u64,
            header_bytes,
            bits_per_s: 0.0,
            blocks_bits_per_s: None,
            ratio_f32: 0.0,
            ratio_i16: 0.0,
            mean_joint_cm,
            rms_deg,
            psnr_db,
            peak: (psnr_db.map_or(0.0, |psnr| mse * 10f64.powf(psnr / 10.0)), rotations),
        };
        Ok(point.with_rates((frames * channels) as f64, frames as f64 / fps))
    }
}

impl Point {
    fn with_rates(self, samples: f64, seconds: f64) -> Self {
        let bytes = self.bytes as f64;
        Self {
            bits_per_s: 8.0 * bytes / seconds,
            blocks_bits_per_s: self.header_bytes.map(|header| 8.0 * (bytes - header as f64) / seconds),
            ratio_f32: 4.0 * samples / bytes,
            ratio_i16: 2.0 * samples / bytes,
            ..self
        }
    }
}

/// All motions at one quality as if they were one: errors are weighted by frames, and ranges too.
fn pool(points: &[&Point]) -> Option<Point> {
    let first = *points.first()?;
    let sum = |of: &dyn Fn(&Point) -> f64| points.iter().map(|point| of(point)).sum::<f64>();
    let frames = sum(&|point| point.frames as f64);
    let squares = sum(&|point| point.frames as f64 * point.rms_deg.powi(2) * point.peak.1);
    let peaks = sum(&|point| point.frames as f64 * point.peak.0);
    let rotations = sum(&|point| point.frames as f64 * point.peak.1);
    let samples = sum(&|point| (point.frames * point.channels) as f64);
    let seconds = sum(&|point| point.frames as f64 / point.fps);
    let pooled = Point {
        clip: POOLED.to_owned(),
        entropy: first.entropy.filter(|_| points.iter().all(|point| point.entropy == first.entropy)),
        frames: frames as usize,
        bytes: points.iter().map(|point| point.bytes).sum(),
        header_bytes: points.iter().map(|point| point.header_bytes).sum(),
        mean_joint_cm: sum(&|point| point.frames as f64 * point.mean_joint_cm) / frames,
        rms_deg: if rotations > 0.0 { (squares / rotations).sqrt() } else { 0.0 },
        psnr_db: (squares > 0.0 && peaks > 0.0).then(|| 10.0 * (peaks / squares).log10()),
        peak: (peaks / frames, rotations / frames),
        ..first.clone()
    };
    Some(pooled.with_rates(samples, seconds))
}

/// The rate at which points (rate, PSNR), coarsest first, come to so many dB: between two points in proportion, on a
/// logarithmic scale of rates. None where they do not get there, or are all above.
pub fn rate_at(points: &[(f64, f64)], psnr_db: f64) -> Option<f64> {
    points.windows(2).find_map(|pair| {
        let (low, high) = (pair[0].1, pair[1].1);
        let part = (psnr_db - low) / (high - low);
        let (from, to) = (pair[0].0.ln(), pair[1].0.ln());
        (low <= psnr_db && psnr_db < high).then(|| (from + part * (to - from)).exp())
    })
}

/// Writes the points as CSV with a header; the columns are the fields of [`Point`].
///
/// # Errors
/// Where `out` fails.
pub fn write_csv(points: &[Point], out: &mut dyn Write) -> Result<()> {
    let mut table = csv::Writer::from_writer(out);
    for point in points {
        table.serialize(point)?;
    }
    table.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::figure::overview;
    use super::*;
    use decoder_core::mclip::CodecId;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn motions() -> Vec<Named> {
        let sample = Named { name: "whole".into(), clip: mocap::sample::clip() };
        let whole = super::super::resample(sample, 15.0).unwrap();
        let mut half = Named { name: "half, \"quoted\"".into(), ..whole.clone() };
        half.clip.motion.samples.truncate(60 * whole.clip.motion.channels);
        vec![whole, half]
    }

    #[test]
    fn every_codec_has_its_curve_and_pools() {
        let motions = motions();
        // One of each codec, and one whose steps are swept.
        let mut curves: Vec<Curve> =
            CodecId::ALL.into_iter().map(|codec| Curve::of(codec).swap_remove(0)).collect();
        curves.extend([Curve::of(CodecId::Pcm).swap_remove(1), Curve::qmd(8, false)]);
        let done = AtomicUsize::new(0);
        let points = sweep_all(&motions, &curves, &|| {
            done.fetch_add(1, Ordering::Relaxed);
        })
        .unwrap();
        assert_eq!(done.into_inner(), len(&motions, &curves));
        assert_eq!(points.len() * 2, len(&motions, &curves) * 3);

        // What a pooled point says is what both motions together come to.
        let of = |clip: &str, curve: &str| -> Vec<&Point> {
            points.iter().filter(|point| point.clip == clip && point.curve == curve).collect()
        };
        for curve in &curves {
            let (whole, half) = (of("whole", &curve.name), of("half, \"quoted\"", &curve.name));
            for ((whole, half), pooled) in whole.iter().zip(half).zip(of(POOLED, &curve.name)) {
                assert_eq!((pooled.bytes, pooled.frames), (whole.bytes + half.bytes, 180));
                assert_eq!((pooled.bits, pooled.fdf), (whole.bits, half.fdf));
                assert!((pooled.bits_per_s - pooled.bytes as f64 * 8.0 / 12.0).abs() < 1e-6);
                assert!((pooled.ratio_f32 - 2.0 * pooled.ratio_i16).abs() < 1e-9);
                assert_eq!(
                    pooled.header_bytes,
                    whole.header_bytes.zip(half.header_bytes).map(|(a, b)| a + b)
                );
                let blocks = pooled.header_bytes.map(|header| (pooled.bytes - header) as f64 * 8.0 / 12.0);
                assert_eq!(pooled.blocks_bits_per_s, blocks);
                let cm = (2.0 * whole.mean_joint_cm + half.mean_joint_cm) / 3.0;
                assert!((pooled.mean_joint_cm - cm).abs() < 1e-9);
                let between = |a: f64, b: f64, x: f64| a.min(b) - 1e-9 <= x && x <= a.max(b) + 1e-9;
                assert!(between(whole.rms_deg, half.rms_deg, pooled.rms_deg));
                let psnr = [whole, half, pooled].map(|point| point.psnr_db.unwrap());
                assert!(between(psnr[0], psnr[1], psnr[2]), "{psnr:?}");
            }
        }
        for curve in ["pcm", "dpcm order 1", "mulaw", "pcm steps"] {
            for pair in of("whole", curve).windows(2) {
                assert!(pair[0].psnr_db < pair[1].psnr_db, "{curve}: {pair:?}");
                assert!(pair[0].bits_per_s < pair[1].bits_per_s, "{curve}: {pair:?}");
            }
        }
        // One bit more halves the steps: 6 dB.
        for pair in of("whole", "pcm").windows(2) {
            let gain = pair[1].psnr_db.unwrap() - pair[0].psnr_db.unwrap();
            assert!((5.0..7.5).contains(&gain), "{gain} dB");
        }

        // The picture has every curve, and the table reads back.
        let svg = overview("all", &points).svg().unwrap();
        assert!(curves.iter().all(|curve| svg.contains(&curve.name)));
        let mut csv = Vec::new();
        write_csv(&points, &mut csv).unwrap();
        let mut table = csv::Reader::from_reader(&*csv);
        let header = table.headers().unwrap().iter().collect::<Vec<_>>().join(",");
        assert_eq!(
            header,
            "clip,curve,codec,entropy,bits,step_cm,fdf,frames,fps,channels,bytes,header_bytes,bits_per_s,blocks_bits_per_s,ratio_f32,ratio_i16,\
             mean_joint_cm,rms_deg,psnr_db"
        );
        let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), points.len());
        for (row, point) in rows.iter().zip(&points) {
            assert_eq!((&row[0], &row[1]), (&*point.clip, &*point.curve));
            assert_eq!(row[10].parse::<u64>().unwrap(), point.bytes);
        }
    }

    #[test]
    fn a_rate_is_found_between_points() {
        let motions = &motions()[..1];
        let points = sweep_all(motions, &[Curve::pcm()], &|| {}).unwrap();
        let points: Vec<(f64, f64)> =
            points.iter().map(|point| (point.bits_per_s, point.psnr_db.unwrap())).collect();
        let rate = rate_at(&points, points[3].1).unwrap();
        assert!((rate - points[3].0).abs() < 1e-6 * rate);
        let rate = rate_at(&points, f64::midpoint(points[3].1, points[4].1)).unwrap();
        assert!((rate - (points[3].0 * points[4].0).sqrt()).abs() < 1e-6 * rate);
        assert_eq!(rate_at(&points, 1.0).or(rate_at(&points, 200.0)), None);
    }
}
