//! The bytes of a clip (docs/FORMAT.md, "QMD").

use super::parameters::Parameters;
use crate::source::Source;

/// What an encoder decided.
pub(super) struct Coded {
    /// The initial pose, a value a channel.
    pub pose: Vec<f32>,
    pub segments: Vec<Segment>,
}

/// A table and the rows that use it.
pub(super) struct Segment {
    /// `2^b` differences.
    pub table: Vec<f32>,
    /// For every frame, the differences of the fixed channels.
    pub floats: Vec<f32>,
    /// For every frame, the indices of the other channels.
    pub indices: Vec<u16>,
}

pub(super) fn write(source: &Source, parameters: Parameters, coded: &Coded) -> Vec<u8> {
    let layout = parameters.layout(source.channels as u16, source.rate_centihertz);
    let fixed_channels = usize::from(layout.fixed_channels);
    let indexed_channels = source.channels - fixed_channels;
    let mut bytes = Vec::with_capacity(parameters.bytes(source.frames, source.channels));
    for (number, segment) in coded.segments.iter().enumerate() {
        // One of the two is empty where all channels are of the other kind.
        let rows = match indexed_channels {
            0 => segment.floats.len() / fixed_channels,
            _ => segment.indices.len() / indexed_channels,
        };
        bytes.extend((rows as u32).to_le_bytes());
        bytes.extend(layout.channels.to_le_bytes());
        bytes.extend(layout.rate_centihertz.to_le_bytes());
        bytes.extend(u32::from(layout.fixed_channels).to_le_bytes());
        bytes.push(layout.index_bits);
        if number == 0 {
            bytes.extend(&source.levels);
            bytes.extend(coded.pose.iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes.extend(segment.table.iter().flat_map(|value| value.to_le_bytes()));
        for row in 0..rows {
            let floats = &segment.floats[row * fixed_channels..][..fixed_channels];
            let indices = &segment.indices[row * indexed_channels..][..indexed_channels];
            bytes.extend(floats.iter().flat_map(|value| value.to_le_bytes()));
            match layout.index_bytes() {
                1 => bytes.extend(indices.iter().map(|&index| index as u8)),
                _ => bytes.extend(indices.iter().flat_map(|index| index.to_le_bytes())),
            }
        }
    }
    bytes
}
