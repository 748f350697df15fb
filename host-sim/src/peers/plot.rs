//! Bytes against cycles, a point for every method.

use super::compare::Entry;
use anyhow::{Result, anyhow};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (1000, 520);
const OURS: RGBColor = RGBColor(212, 56, 13);
const THEIRS: RGBColor = RGBColor(59, 116, 216);

/// Draws the methods as SVG: bytes of the motion across, mean cycles of a frame upwards, one picture a core. Cycles
/// are on a logarithmic scale; a bar goes up to the worst frame.
///
/// # Errors
/// A sentence from the drawing library.
pub fn plot(title: &str, entries: &[Entry]) -> Result<String> {
    let mut svg = String::new();
    draw(&mut svg, title, entries).map_err(|error| anyhow!("cannot draw the plot: {error}"))?;
    Ok(svg)
}

fn draw(svg: &mut String, title: &str, entries: &[Entry]) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.titled(title, ("sans-serif", 20))?;
    let cores: Vec<&str> =
        entries.first().map_or_else(Vec::new, |entry| entry.costs.iter().map(|cost| cost.core).collect());
    let bytes = range(entries.iter().map(|entry| entry.bytes as f64));
    let cycles =
        range(entries.iter().flat_map(|entry| {
            entry.costs.iter().flat_map(|cost| [cost.cycles_mean, cost.cycles_max as f64])
        }));
    for (number, (area, core)) in root.split_evenly((1, cores.len().max(1))).iter().zip(&cores).enumerate() {
        let mut chart = ChartBuilder::on(area)
            .caption(core, ("sans-serif", 16))
            .margin(10)
            .x_label_area_size(36)
            .y_label_area_size(if number == 0 { 64 } else { 48 })
            .build_cartesian_2d(0.0..bytes.1, (cycles.0..cycles.1).log_scale())?;
        chart
            .configure_mesh()
            .light_line_style(RGBColor(240, 240, 244))
            .bold_line_style(RGBColor(217, 221, 231))
            .x_desc("bytes of the motion")
            .y_desc(if number == 0 { "cycles a frame: mean, and up to the worst" } else { "" })
            .x_labels(6)
            .x_label_formatter(&|value| format!("{value:.0}"))
            .y_label_formatter(&|value| format!("{value:.0}"))
            .draw()?;
        // Names must not lie over each other: those that would are moved down.
        let mut taken: Vec<(i32, i32, i32)> = Vec::new();
        for entry in entries {
            let Some(cost) = entry.costs.iter().find(|cost| cost.core == *core) else { continue };
            let colour = if entry.method.is_ours() { OURS } else { THEIRS };
            let (x, y) = (entry.bytes as f64, cost.cycles_mean);
            chart.draw_series([PathElement::new(
                [(x, y), (x, cost.cycles_max as f64)],
                colour.mix(0.35).stroke_width(3),
            )])?;
            chart.draw_series([Circle::new((x, y), 5, colour.filled())])?;
            let (left, top) = chart.backend_coord(&(x, y));
            let width = entry.name.len() as i32 * 7;
            let bounds = area.get_pixel_range();
            // Right of the point, or left of it where the picture ends.
            let right_of_it = left + 10 + width < bounds.0.end;
            let from = if right_of_it { left + 9 } else { left - 9 - width };
            let mut row = top;
            while taken
                .iter()
                .any(|&(other, end, there)| from < end && other < from + width && (row - there).abs() < 13)
            {
                row += 1;
            }
            taken.push((from, from + width, row));
            let (at, anchor) = if right_of_it { (HPos::Left, from) } else { (HPos::Right, from + width) };
            let style = TextStyle::from(("sans-serif", 13).into_font())
                .color(&colour)
                .pos(Pos::new(at, VPos::Center));
            area.draw_text(&entry.name, &style, (anchor - bounds.0.start, row - bounds.1.start))?;
        }
    }
    root.present()?;
    Ok(())
}

/// From a little below the least to a little above the most.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.fold((f64::MAX, 1.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    (low.max(1.0) / 1.5, high * 1.5)
}
