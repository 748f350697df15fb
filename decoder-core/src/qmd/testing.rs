//! Clips for the tests: random bytes in a sound frame, and a slow decoder that shares no code with the core.

use super::segment::Layout;
pub use crate::testing::Random;
use std::vec::Vec;

/// Mostly a small difference, sometimes any bit pattern at all.
fn float(random: &mut Random) -> [u8; 4] {
    if random.below(16) == 0 {
        random.next().to_le_bytes()
    } else {
        ((random.next() as i32 as f32) / (1u32 << 30) as f32).to_le_bytes()
    }
}

/// The layouts that the tests try: every width of index, all, some and no fixed channels, one channel and many.
pub fn layouts() -> Vec<Layout> {
    let mut layouts = Vec::new();
    for (channels, fixed_channels) in [(1, 0), (1, 1), (3, 1), (62, 0), (62, 6), (62, 62), (300, 2)] {
        for index_bits in 8..=16 {
            layouts.push(Layout { channels, rate_centihertz: 12000, fixed_channels, index_bits });
        }
    }
    layouts
}

/// Whether Miri can afford a layout's tables.
pub fn affordable(layout: &Layout) -> bool {
    !cfg!(miri) || layout.index_bits < 10 && layout.channels < 100
}

/// A sound clip with random content, a segment for every number of rows.
pub fn clip(layout: Layout, rows: &[u32], random: &mut Random) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (segment, &n) in rows.iter().enumerate() {
        bytes.extend(n.to_le_bytes());
        bytes.extend(layout.channels.to_le_bytes());
        bytes.extend(layout.rate_centihertz.to_le_bytes());
        bytes.extend(u32::from(layout.fixed_channels).to_le_bytes());
        bytes.push(layout.index_bits);
        if segment == 0 {
            bytes.extend((0..layout.channels).map(|_| 1 + random.below(6) as u8));
            (0..layout.channels).for_each(|_| bytes.extend(float(random)));
        }
        (0..1 << layout.index_bits).for_each(|_| bytes.extend(float(random)));
        for _ in 0..n {
            (0..layout.fixed_channels).for_each(|_| bytes.extend(float(random)));
            for _ in layout.fixed_channels..layout.channels {
                let index = random.next();
                match layout.index_bits {
                    8 => bytes.push(index as u8),
                    // Bits above b are set at random: a decoder does not look at them.
                    _ => bytes.extend((index as u16).to_le_bytes()),
                }
            }
        }
    }
    bytes
}

/// Every frame of a sound clip, by the words of docs/FORMAT.md.
pub fn reference(bytes: &[u8]) -> Vec<Vec<i32>> {
    let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let fixed_at = |at: usize| -> i64 {
        let value = f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
        i64::from((value * 65536.0).round() as i32)
    };
    let mut frames = Vec::new();
    let mut pose: Vec<i64> = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let n = u16_at(at) as usize | (u16_at(at + 2) as usize) << 16;
        let m = u16_at(at + 4) as usize;
        let fdf = u16_at(at + 8) as usize;
        let b = bytes[at + 12];
        at += 13;
        if pose.is_empty() {
            at += m;
            pose = (0..m).map(|channel| fixed_at(at + 4 * channel)).collect();
            at += 4 * m;
        }
        let table = at;
        at += 4 << b;
        for _ in 0..n {
            for (channel, value) in pose.iter_mut().enumerate() {
                let difference = if channel < fdf {
                    at += 4;
                    fixed_at(at - 4)
                } else if b == 8 {
                    at += 1;
                    fixed_at(table + 4 * bytes[at - 1] as usize)
                } else {
                    at += 2;
                    fixed_at(table + 4 * (u16_at(at - 2) as usize & ((1 << b) - 1)))
                };
                *value = i64::from((*value + difference) as i32);
            }
            frames.push(pose.iter().map(|&value| value as i32).collect());
        }
    }
    frames
}
