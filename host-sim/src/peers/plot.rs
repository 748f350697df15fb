//! Bytes against cycles, a point for every method.

use super::compare::Entry;
use crate::plot::scatter::{Point, Scatter};
use anyhow::Result;

/// Draws the methods as SVG: bytes of the motion across, mean cycles of a frame upwards, one panel a core. Cycles
/// are on a logarithmic scale; a bar goes up to the worst frame.
///
/// # Errors
/// A sentence from the drawing library.
pub fn plot(title: &str, entries: &[Entry]) -> Result<String> {
    let cores = entries.first().map_or(&[][..], |entry| &entry.costs);
    let panel = |core: &'static str| {
        let points = entries.iter().filter_map(|entry| {
            let cost = entry.costs.iter().find(|cost| cost.core == core)?;
            Some(Point {
                name: &entry.name,
                ours: entry.method.is_ours(),
                x: entry.bytes as f64,
                y: cost.cycles_mean,
                bar: cost.cycles_max as f64,
            })
        });
        (core, points.collect())
    };
    let panels = cores.iter().map(|cost| panel(cost.core)).collect();
    let (x, y) = ("bytes of the motion", "cycles a frame: mean, and up to the worst");
    Scatter { title, x, y, panels }.svg()
}
