//! Named points in panels beside each other, as SVG: one amount across, another upwards on a logarithmic scale.

use anyhow::{Result, anyhow};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (1000, 520);
const OURS: RGBColor = RGBColor(212, 56, 13);
const THEIRS: RGBColor = RGBColor(59, 116, 216);

/// A picture.
#[derive(Clone, Debug)]
pub struct Scatter<'a> {
    /// What stands above it.
    pub title: &'a str,
    /// What is across.
    pub x: &'a str,
    /// What is upwards.
    pub y: &'a str,
    /// The panels, each with its title.
    pub panels: Vec<(&'a str, Vec<Point<'a>>)>,
}

/// A point.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    /// Its name, which stands beside it.
    pub name: &'a str,
    /// Whether it is ours: in another colour.
    pub ours: bool,
    /// How far across.
    pub x: f64,
    /// How far up.
    pub y: f64,
    /// How far up a bar goes from it.
    pub bar: f64,
}

impl Scatter<'_> {
    /// Draws it.
    ///
    /// # Errors
    /// A sentence from the drawing library.
    pub fn svg(&self) -> Result<String> {
        let mut svg = String::new();
        self.draw(&mut svg).map_err(|error| anyhow!("cannot draw the plot: {error}"))?;
        Ok(svg)
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let root = root.titled(self.title, ("sans-serif", 20))?;
        let points = || self.panels.iter().flat_map(|(_, points)| points);
        let across = range(points().map(|point| point.x));
        let upwards = range(points().flat_map(|point| [point.y, point.bar]));
        let areas = root.split_evenly((1, self.panels.len().max(1)));
        for (number, (area, (title, points))) in areas.iter().zip(&self.panels).enumerate() {
            let mut chart = ChartBuilder::on(area)
                .caption(title, ("sans-serif", 16))
                .margin(10)
                .x_label_area_size(36)
                .y_label_area_size(if number == 0 { 64 } else { 48 })
                .build_cartesian_2d(0.0..across.1, (upwards.0..upwards.1).log_scale())?;
            chart
                .configure_mesh()
                .light_line_style(RGBColor(240, 240, 244))
                .bold_line_style(RGBColor(217, 221, 231))
                .x_desc(self.x)
                .y_desc(if number == 0 { self.y } else { "" })
                .x_labels(6)
                .x_label_formatter(&|value| format!("{value:.0}"))
                .y_label_formatter(&|value| format!("{value:.0}"))
                .draw()?;
            // Names must not lie over each other: those that would are moved down.
            let mut taken: Vec<(i32, i32, i32)> = Vec::new();
            for &Point { name, ours, x, y, bar } in points {
                let colour = if ours { OURS } else { THEIRS };
                chart
                    .draw_series([PathElement::new([(x, y), (x, bar)], colour.mix(0.35).stroke_width(3))])?;
                chart.draw_series([Circle::new((x, y), 5, colour.filled())])?;
                let (left, top) = chart.backend_coord(&(x, y));
                let width = name.len() as i32 * 7;
                let bounds = area.get_pixel_range();
                // Right of the point, or left of it where the picture ends.
                let right_of_it = left + 10 + width < bounds.0.end;
                let from = if right_of_it { left + 9 } else { left - 9 - width };
                let mut row = top;
                while taken.iter().any(|&(other, end, there)| {
                    from < end && other < from + width && (row - there).abs() < 13
                }) {
                    row += 1;
                }
                taken.push((from, from + width, row));
                let (at, anchor) = if right_of_it { (HPos::Left, from) } else { (HPos::Right, from + width) };
                let style = TextStyle::from(("sans-serif", 13).into_font())
                    .color(&colour)
                    .pos(Pos::new(at, VPos::Center));
                area.draw_text(name, &style, (anchor - bounds.0.start, row - bounds.1.start))?;
            }
        }
        root.present()?;
        Ok(())
    }
}

/// From a little below the least to a little above the most.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) =
        values.fold((f64::MAX, 1.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    (low.max(1.0) / 1.5, high * 1.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_named_in_its_colour() {
        let point = |name, ours| Point { name, ours, x: 500.0, y: 80.0, bar: 90.0 };
        let panels = vec![("m4", vec![point("a", true), point("b", false)])];
        let svg = Scatter { title: "a < b", x: "bytes", y: "cycles", panels }.svg().unwrap();
        for text in ["a &lt; b", "bytes", "cycles", "m4", "#D4380D", "#3B74D8"] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
    }
}
