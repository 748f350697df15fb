//! Encoders for `.mclip`: pcm, mulaw, dpcm, adpcm and qmd with each entropy stage.
//!
//! Source: the waveform-coding document, sections 7.2 to 7.6. The bytes are in docs/FORMAT.md, "mclip".
//!
//! Every codec runs the decoder's own loop ([`decoder_core::mclip::ScalarDecoder::choose`]), so predictions and steps are
//! the decoder's to the last bit, and errors do not add up. Channels get steps in inverse proportion to how far they
//! move the joints, so that an error costs the same wherever it is made.

mod bits;
mod lent;
mod lookup;
mod max;
mod multipliers;
mod plan;
mod prefix;
mod record;
mod run;
mod target;
pub mod train;
mod writer;

use crate::qmd::{EncodeError, Source};
use decoder_core::Limits;
use decoder_core::mclip::{ChannelKind, Clip, CodecId, EntropyId, Opening};
use mocap::motion::Motion;
use mocap::skeleton::{Dof, Skeleton};
use plan::{Choice, Column};
use run::Plan;
use train::Steps;

pub use lent::Lent;
pub use max::Density;
pub use target::{Encoded, Target};
pub use writer::certify;

/// What a rotation counts for at least, in cm: as if it moved one point at this distance from its axis. A bone has a girth, and a face or a
/// hand at it, which joints do not show: by joints alone a head that turns about its neck, which moves none, is off by 25 degrees.
const LEVER_CM: f64 = 10.0;

/// How values are predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum Predictor {
    /// The last value.
    Last,
    /// First order (7-14).
    First,
    /// Second order, the coefficients chosen for each channel.
    Second,
    /// Second order, adapted by the decoder (7-15 to 7-18); only adpcm has it.
    Adaptive {
        /// 1 to 6: the exponential window has 2 to this power frames; 15 to 120: the sliding window has so many, at most
        /// 8 · 2^period.
        window: u8,
        /// Coefficients are solved for every 2 to this power frames.
        period: u8,
    },
}

/// What is not a matter of quality.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// The codec.
    #[serde(serialize_with = "codec_name")]
    pub codec: CodecId,
    /// The entropy stage; the smallest unless given.
    #[serde(serialize_with = "entropy_name")]
    pub entropy: Option<EntropyId>,
    /// The predictor; pcm has none, mulaw always the first order, qmd always the last value.
    pub predictor: Predictor,
    /// adpcm: whether steps adapt.
    pub adapt_step: bool,
    /// adpcm: how steps adapt; as was trained for the bits of a code unless given.
    pub steps: Option<Steps>,
    /// mulaw: μ.
    pub mu: f64,
    /// qmd: the density whose quantiser by Max the table has; fitted to the motion unless given.
    pub density: Option<Density>,
    /// Longest block in bytes of codes; a frame that is longer has a block of its own.
    pub block_bytes: u16,
    /// Frames from one entry point to the next.
    pub entry_frames: usize,
    /// Rounding towards zero, in 64ths of a step, 0 to 32.
    pub dead: i32,
}

fn codec_name<S: serde::Serializer>(codec: &CodecId, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(codec.name())
}

fn entropy_name<S: serde::Serializer>(entropy: &Option<EntropyId>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(entropy.map_or("smallest", EntropyId::name))
}

impl Settings {
    /// The settings that a codec has unless others are asked for.
    pub fn new(codec: CodecId) -> Self {
        Self {
            codec,
            entropy: None,
            predictor: match codec {
                CodecId::Pcm | CodecId::Qmd => Predictor::Last,
                CodecId::MuLaw => Predictor::First,
                CodecId::Dpcm => Predictor::Second,
                CodecId::Adpcm => Predictor::Adaptive { window: 5, period: 4 },
            },
            adapt_step: false,
            steps: None,
            mu: 255.0,
            density: None,
            block_bytes: 1024,
            entry_frames: 480,
            dead: if matches!(codec, CodecId::Dpcm | CodecId::Adpcm) { 12 } else { 0 },
        }
    }

    /// Most bits of a code that [`Quality::Bits`] may ask for.
    pub const fn most_bits(&self) -> u8 {
        match self.codec {
            CodecId::MuLaw => 9,
            CodecId::Qmd => 8,
            _ => 16,
        }
    }

    /// Whether steps may be chosen freely. Otherwise the number of bits is what sets the quality: the levels of mulaw
    /// and qmd are spread over all differences, and steps that adapt go where they want.
    pub const fn has_free_steps(&self) -> bool {
        match self.codec {
            CodecId::Pcm | CodecId::Dpcm => true,
            CodecId::Adpcm => !self.adapt_step,
            CodecId::MuLaw | CodecId::Qmd => false,
        }
    }
}

/// How fine steps are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quality {
    /// Every channel has codes of so many bits, 1 to [`Settings::most_bits`], and its best step.
    Bits(u8),
    /// The displacement in cm, root of the sum of squares over the joints, that one step of a channel makes. For
    /// codecs whose steps are free: [`Settings::has_free_steps`].
    Step(f64),
    /// The step of every channel in its own unit, degrees or centimetres: what has the most PSNR for its bits. For the
    /// same codecs.
    Even(f64),
}

/// A motion made ready to be encoded many times.
pub struct Encoder<'m> {
    skeleton: &'m Skeleton,
    source: Source,
    columns: Vec<Column>,
}

impl<'m> Encoder<'m> {
    /// # Errors
    /// [`EncodeError`] where the motion is empty or its size, rate or values do not fit the format.
    pub fn new(skeleton: &'m Skeleton, motion: &Motion) -> Result<Self, EncodeError> {
        let source = Source::new(skeleton, motion)?;
        if source.frames > i32::MAX as usize {
            let limit = i32::MAX as usize;
            return Err(EncodeError::TooMany { what: "frames", found: source.frames, limit });
        }
        let columns = Column::all(&source);
        Ok(Self { skeleton, source, columns })
    }

    /// Encodes with these settings, in the smallest entropy stage unless one is given.
    pub fn encode(&self, settings: &Settings, quality: Quality) -> Vec<u8> {
        let settings = &match quality {
            Quality::Bits(bits) => {
                let steps = settings.steps.unwrap_or_else(|| train::trained(bits));
                Settings { steps: Some(steps), ..*settings }
            }
            Quality::Step(_) | Quality::Even(_) => *settings,
        };
        let (levels, mut choices) = match quality {
            Quality::Bits(bits) => self.by_bits(settings, bits),
            Quality::Step(cm) => self.by_steps(settings, &self.steps(cm)),
            Quality::Even(step) => self.by_steps(settings, &vec![65536.0 * step; self.columns.len()]),
        };
        if settings.entropy == Some(EntropyId::FixedWidth) {
            plan::level(&mut choices);
        }
        // Rounding towards zero saves bits only where an entropy stage counts them.
        let dead = if matches!(quality, Quality::Bits(_)) { 0 } else { settings.dead };
        let parameters = plan::parameters(settings, &levels);
        let plan = Plan { dead, ..self.plan(settings, &parameters, &choices) };
        let coded = plan.run(&self.source.targets);
        let stages = settings.entropy.map_or(EntropyId::ALL.to_vec(), |entropy| vec![entropy]);
        let clips = stages.into_iter().map(|entropy| writer::write(&plan, &coded, entropy));
        clips.min_by_key(Vec::len).unwrap_or_default()
    }

    /// The choices for steps of so many words.
    fn by_steps(&self, settings: &Settings, steps: &[f64]) -> (Vec<u8>, Vec<Choice>) {
        let parameters = plan::parameters(settings, &[]);
        (Vec::new(), plan::by_steps(&self.columns, settings, &parameters, steps))
    }

    /// The levels of the quantiser, where it has some, and the choices for codes of so many bits.
    fn by_bits(&self, settings: &Settings, bits: u8) -> (Vec<u8>, Vec<Choice>) {
        let bits = bits.clamp(1, settings.most_bits());
        if let (CodecId::Qmd, Some(density)) = (settings.codec, settings.density) {
            // An even number of levels has none for 0, which a channel at rest needs.
            let tables = [(1 << bits) - 1, 1 << bits].map(|count| lookup::bytes_of(&density.levels(count)));
            let tried = tables.map(|levels| {
                let choices = plan::by_bits(&self.columns, settings, &levels, bits);
                let coded = self.plan(settings, &levels, &choices).run(&self.source.targets);
                (self.weighted_error(&coded.decoded), levels, choices)
            });
            let [odd, even] = tried;
            let (_, levels, choices) = if odd.0 <= even.0 { odd } else { even };
            return (levels, choices);
        }
        if settings.codec == CodecId::Qmd {
            let choices = lookup::choices(&self.columns, &self.steps(1.0), bits);
            let run = |levels: &[u8]| self.plan(settings, levels, &choices).run(&self.source.targets);
            return (lookup::fit(&self.columns, &choices, bits, run), choices);
        }
        let levels = match settings.codec {
            CodecId::MuLaw => plan::mu_law(settings.mu, bits),
            _ => Vec::new(),
        };
        let parameters = plan::parameters(settings, &levels);
        let settings = Settings { dead: 0, ..*settings };
        let choices = plan::by_bits(&self.columns, &settings, &parameters, bits);
        (levels, choices)
    }

    /// Sum over frames of the squared displacement of the joints, by how far each channel moves them.
    fn weighted_error(&self, decoded: &[i32]) -> f64 {
        let weights = self.source.weights.iter().cycle();
        let pairs = self.source.targets.iter().zip(decoded).zip(weights);
        pairs.map(|((a, b), weight)| weight * (f64::from(*a) - f64::from(*b)).powi(2)).sum()
    }

    /// The step of every channel in words, where a step moves the joints by `cm`; a rotation by no more than a point at
    /// [`LEVER_CM`].
    fn steps(&self, cm: f64) -> Vec<f64> {
        let least = (LEVER_CM * 1_f64.to_radians()).powi(2);
        let channels = self.source.weights.iter().zip(&self.skeleton.channels);
        let weights = channels
            .map(|(&weight, channel)| weight.max(if channel.dof.is_rotation() { least } else { 0.0 }));
        weights.map(|weight| 65536.0 * cm / weight.sqrt()).collect()
    }

    fn plan<'p>(&'p self, settings: &Settings, parameters: &'p [u8], choices: &[Choice]) -> Plan<'p> {
        let skeleton_channels = self.skeleton.channels.iter();
        let channels =
            skeleton_channels.zip(&self.columns).zip(choices).map(|((channel, column), choice)| {
                let joint = self.skeleton.joints[channel.joint].name.as_str();
                decoder_core::mclip::Channel {
                    joint,
                    ..column.record(settings.codec, kind(channel.dof), *choice)
                }
            });
        let hundredths = u32::from(self.source.rate_centihertz);
        let whole = hundredths.is_multiple_of(100);
        Plan {
            opening: Opening {
                rate_numerator: if whole { hundredths / 100 } else { hundredths },
                rate_denominator: if whole { 1 } else { 100 },
                ..plan::opening(settings, parameters, self.source.frames, self.source.channels)
            },
            channels: channels.collect(),
            precision: plan::PRECISION,
            entry_frames: settings.entry_frames,
            dead: settings.dead,
        }
    }
}

/// What a clip's header says of a channel.
const fn kind(dof: Dof) -> ChannelKind {
    match dof {
        Dof::Tx => ChannelKind::Tx,
        Dof::Ty => ChannelKind::Ty,
        Dof::Tz => ChannelKind::Tz,
        Dof::Rx => ChannelKind::Rx,
        Dof::Ry => ChannelKind::Ry,
        Dof::Rz => ChannelKind::Rz,
        Dof::Length => ChannelKind::Length,
    }
}

/// Decodes a whole clip with the decoder's own code. Values are in degrees and centimetres, angles continuous.
///
/// # Errors
/// As [`Clip::parse`] and [`Decoder::next_frame`](decoder_core::mclip::Decoder::next_frame).
pub fn decode(bytes: &[u8]) -> Result<Motion, decoder_core::Error> {
    let clip = Clip::parse(bytes, Limits::MAX)?;
    let opening = clip.header().opening();
    let fps = f64::from(opening.rate_numerator) / f64::from(opening.rate_denominator);
    let mut lent = Lent::new(clip.header().needs());
    let mut decoder = clip.decoder(lent.memory())?;
    let mut samples = Vec::new();
    while let Some(pose) = decoder.next_frame()? {
        samples.extend(pose.iter().map(|value| value.to_num::<f64>()));
    }
    Ok(Motion { fps, channels: clip.channels(), samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoder_core::mclip::{Receiver, Stream};
    use mocap::metrics::Evaluator;
    use mocap::sample;

    fn all_settings() -> Vec<Settings> {
        let mut all = Vec::new();
        for codec in CodecId::ALL {
            for entropy in EntropyId::ALL {
                let plain = Settings {
                    entropy: Some(entropy),
                    entry_frames: 100,
                    block_bytes: 700,
                    ..Settings::new(codec)
                };
                all.push(plain);
                match codec {
                    CodecId::Dpcm => {
                        all.push(Settings { predictor: Predictor::Last, ..plain });
                        all.push(Settings { predictor: Predictor::First, ..plain });
                    }
                    CodecId::Adpcm => {
                        all.push(Settings { adapt_step: true, ..plain });
                        all.push(Settings { adapt_step: true, predictor: Predictor::Second, ..plain });
                    }
                    _ => {}
                }
            }
        }
        all
    }

    /// By the positions of joints alone nobody would see that the head turns.
    #[test]
    fn what_moves_no_joint_is_seen_too() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let yaw = clip.skeleton.channel("head.ry").unwrap();
        let coarse = 0.5;
        let decoded = decode(&encoder.encode(&Settings::new(CodecId::Dpcm), Quality::Step(coarse))).unwrap();
        let off = |frame: usize| (decoded.frame(frame)[yaw] - clip.motion.frame(frame)[yaw]).abs();
        // A step, 2.9 degrees; rounding towards zero makes the error larger than half of it.
        let step = (coarse / LEVER_CM).to_degrees();
        assert!((0..decoded.frames()).all(|frame| off(frame) < step), "{step}");
    }

    /// Every frame by way of a stream, in chunks of `size` bytes.
    fn streamed(bytes: &[u8], size: usize) -> Vec<f64> {
        let mut chunks = bytes.chunks(size);
        let mut chunk: &[u8] = &[];
        let mut buffer = vec![0; 8192];
        let mut receiver = Receiver::new(&mut buffer);
        while !receiver.receive(&mut chunk).unwrap() {
            chunk = chunks.next().unwrap();
        }
        let header = receiver.finish(Limits::MAX).unwrap();
        let mut lent = Lent::new(header.needs());
        let mut block = vec![0; usize::from(header.opening().block_bytes).max(12)];
        let mut stream = Stream::new(header, lent.memory(), &mut block).unwrap();
        let mut samples = Vec::new();
        loop {
            while let Some(pose) = stream.next_frame(&mut chunk).unwrap() {
                samples.extend(pose.iter().map(|value| value.to_num::<f64>()));
            }
            match chunks.next() {
                Some(next) => chunk = next,
                None => break,
            }
        }
        stream.finish().unwrap();
        samples
    }

    #[test]
    fn every_codec_and_entropy_stage_comes_near_and_streams_alike() {
        let clip = sample::clip();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for settings in all_settings() {
            let mut qualities = vec![Quality::Bits(7)];
            if settings.has_free_steps() {
                qualities.extend([Quality::Step(0.3), Quality::Even(0.5)]);
            }
            for quality in qualities {
                let encoded = encoder.measured(&settings, quality, &evaluator);
                let off = encoded.mean_joint_cm;
                assert!(off < 0.5, "{settings:?} {quality:?}: {off} cm");
                let decoded = decode(&encoded.bytes).unwrap();
                assert_eq!((decoded.frames(), decoded.fps), (clip.motion.frames(), clip.motion.fps));
                assert_eq!(streamed(&encoded.bytes, 97), decoded.samples, "{settings:?}");
            }
        }
    }

    #[test]
    fn seeking_gives_the_frame_that_playing_gives() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for settings in all_settings() {
            let bytes = encoder.encode(&settings, Quality::Bits(5));
            let played = decode(&bytes).unwrap();
            let parsed = Clip::parse(&bytes, Limits::MAX).unwrap();
            assert_eq!(parsed.entry_count(), 5, "480 frames, an entry point every 100");
            let mut lent = Lent::new(parsed.header().needs());
            let mut decoder = parsed.decoder(lent.memory()).unwrap();
            for frame in [479, 0, 100, 99, 250, 251, 255, 3, 400, 399] {
                let found = decoder.seek(frame).unwrap().unwrap();
                let found: Vec<f64> = found.iter().map(|value| value.to_num()).collect();
                assert_eq!(found, played.frame(frame as usize), "{settings:?} frame {frame}");
            }
            assert!(decoder.seek(480).unwrap().is_none());
        }
    }

    #[test]
    fn targets_are_met() {
        let clip = sample::clip();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for codec in [CodecId::Pcm, CodecId::Dpcm, CodecId::Adpcm] {
            let settings = Settings { entropy: Some(EntropyId::Huffman), ..Settings::new(codec) };
            let found = encoder.encode_to(&settings, Target::Error(0.1), &evaluator).mean_joint_cm;
            assert!((found / 0.1 - 1.0).abs() < 0.03, "{codec:?}: {found} cm");
            let encoded = encoder.encode_to(&settings, Target::Rate(8_000.0), &evaluator);
            let rate = encoder.rate(&encoded.bytes);
            assert!((7_700.0..=8_000.0).contains(&rate), "{codec:?}: {rate} bits a second");
        }
    }

    #[test]
    fn a_channel_is_tried_as_the_clip_will_have_it() {
        let clip = sample::clip();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        let settings = Settings { dead: 0, ..Settings::new(CodecId::Adpcm) };
        let parameters = plan::parameters(&settings, &[]);
        let choices = plan::by_bits(&encoder.columns, &settings, &parameters, 6);
        let coded = encoder.plan(&settings, &parameters, &choices).run(&encoder.source.targets);
        let channels = encoder.source.channels;
        for (index, (column, &choice)) in encoder.columns.iter().zip(&choices).enumerate() {
            let alone = column.run(&settings, &parameters, choice);
            let there: Vec<i32> = coded.decoded.iter().skip(index).step_by(channels).copied().collect();
            assert_eq!(alone.decoded, there, "channel {index}");
        }
    }

    #[test]
    fn fewer_levels_cost_fewer_bytes_and_more_error() {
        let clip = sample::clip();
        let evaluator = Evaluator::new(&clip.skeleton, &clip.motion).unwrap();
        let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
        for codec in CodecId::ALL {
            let settings = Settings { entropy: Some(EntropyId::FixedWidth), ..Settings::new(codec) };
            let clips = [3, 5, 7].map(|bits| encoder.measured(&settings, Quality::Bits(bits), &evaluator));
            for pair in clips.windows(2) {
                assert!(pair[0].bytes.len() < pair[1].bytes.len(), "{codec:?}");
                assert!(pair[0].mean_joint_cm > 1.5 * pair[1].mean_joint_cm, "{codec:?}");
            }
        }
    }
}
