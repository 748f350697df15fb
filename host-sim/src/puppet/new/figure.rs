//! What a puppet file keeps of a figure, so that all recordings of the figure have the same zeros.

use fit::TwistReport;
use mocap::Clip;
use std::fmt::Write;

/// The figure of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    bones: String,
    twists: Vec<(String, f64)>,
}

impl Figure {
    /// The figure of this recording, with the twists of its limbs.
    pub fn of(clip: &Clip, twists: &[TwistReport]) -> Self {
        let twists = twists.iter().map(|twist| (twist.part.clone(), twist.degrees));
        Self { bones: clip.skeleton.fingerprint(), twists: twists.collect() }
    }

    /// Its table in a puppet.toml, if there is something to keep.
    pub fn text(&self) -> Option<String> {
        if self.twists.is_empty() {
            return None;
        }
        let mut text = format!("[[figure]]\nbones = \"{}\"\ntwists = {{ ", self.bones);
        for (index, (part, degrees)) in self.twists.iter().enumerate() {
            let _ =
                write!(text, "{}\"{part}\" = {:.1}", if index == 0 { "" } else { ", " }, tenths(*degrees));
        }
        Some(text + " }\n")
    }
}

/// To a tenth, and 0 without a sign.
fn tenths(degrees: f64) -> f64 {
    (degrees * 10.0).round() / 10.0 + 0.0
}
