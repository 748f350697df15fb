//! The JSON of a glTF file, as far as it is read.

use serde::Deserialize;
use serde_json::Value;

use crate::quaternion;

/// What was found, and what was expected.
pub(super) type Wrong = (String, &'static str);

/// Centimetres in the format's unit of length.
pub(super) const CM_PER_METRE: f64 = 100.0;

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Document {
    pub(super) nodes: Vec<Node>,
    pub(super) animations: Vec<Animation>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
}

#[derive(Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    pub(super) children: Vec<usize>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) mesh: Option<usize>,
}

impl Node {
    /// Its rotation where nothing moves it.
    pub(super) fn rest(&self) -> [f64; 4] {
        self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0])
    }

    /// Translation, rotation and scale of a node that has a matrix instead; it has none of them then.
    pub(super) fn split_matrix(&mut self) -> Result<(), Wrong> {
        let Some(columns) = self.matrix.take() else { return Ok(()) };
        let column = |k: usize| [columns[4 * k], columns[4 * k + 1], columns[4 * k + 2]];
        let [x, y, z] = [0, 1, 2].map(column);
        let length = |axis: [f64; 3]| axis.iter().map(|part| part * part).sum::<f64>().sqrt();
        let scale = [x, y, z].map(length);
        let right_handed = x[0] * (y[1] * z[2] - y[2] * z[1])
            + x[1] * (y[2] * z[0] - y[0] * z[2])
            + x[2] * (y[0] * z[1] - y[1] * z[0])
            > 0.0;
        if !right_handed || !scale.iter().all(|part| part.is_normal()) {
            let shown = self.name.as_deref().unwrap_or("without a name").escape_debug().to_string();
            return Err((format!("a mirrored or flat node ({shown})"), "a matrix that turns and scales"));
        }
        let turn = std::array::from_fn(|row| [x[row] / scale[0], y[row] / scale[1], z[row] / scale[2]]);
        self.translation = Some(column(3));
        self.rotation = Some(quaternion::of_matrix(&turn));
        self.scale = Some(scale);
        Ok(())
    }
}

#[derive(Deserialize)]
pub(super) struct Animation {
    pub(super) name: Option<String>,
    pub(super) channels: Vec<AnimationChannel>,
    pub(super) samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
pub(super) struct AnimationChannel {
    pub(super) sampler: usize,
    pub(super) target: Target,
}

#[derive(Deserialize)]
pub(super) struct Target {
    pub(super) node: Option<usize>,
    pub(super) path: String,
}

#[derive(Deserialize)]
pub(super) struct Sampler {
    pub(super) input: usize,
    pub(super) output: usize,
    #[serde(default)]
    pub(super) interpolation: Interpolation,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Interpolation {
    #[default]
    Linear,
    Step,
    CubicSpline,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    pub(super) count: usize,
    pub(super) sparse: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: Option<usize>,
}
