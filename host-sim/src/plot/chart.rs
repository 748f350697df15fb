//! Panels of lines with one legend, as SVG.

use super::scale::short;
use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;

/// A picture.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What stands above it.
    pub title: String,
    /// Pixels of a panel, width and height.
    pub panel: (u32, u32),
    /// Panels beside each other; where there are more, they go on below.
    pub columns: usize,
    /// The panels.
    pub panels: Vec<Panel>,
}

/// A pair of axes with lines.
#[derive(Clone, Debug)]
pub struct Panel {
    /// What stands above it.
    pub title: String,
    /// Across.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// The lines; those of one name have one look in all panels.
    pub lines: Vec<Line>,
}

/// An axis; its range is that of the lines.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What it shows, with its unit.
    pub name: String,
    /// Whether its scale is logarithmic; points at 0 or below are then left out.
    pub log: bool,
}

/// A line through points.
#[derive(Clone, Debug)]
pub struct Line {
    /// What the legend says.
    pub name: String,
    /// How it looks.
    pub look: Look,
    /// The points in order.
    pub points: Vec<(f64, f64)>,
}

/// How a line looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// Which of [`COLOURS`].
    pub colour: usize,
    /// Whether it is dashed.
    pub dashed: bool,
    /// What marks its points.
    pub marker: Marker,
}

/// What marks points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// Nothing.
    None,
    /// A disc.
    Disc,
    /// A triangle.
    Triangle,
    /// A cross.
    Cross,
}

impl Look {
    /// Of what stands for all lines: black.
    pub const TOTAL: Self = Self { colour: COLOURS.len() - 1, dashed: false, marker: Marker::Disc };

    /// Looks that are told apart, one after another, none of them black.
    pub const fn nth(index: usize) -> Self {
        let colours = COLOURS.len() - 1;
        let marker = match index / colours % 3 {
            0 => Marker::Disc,
            1 => Marker::Triangle,
            _ => Marker::Cross,
        };
        Self { colour: index % colours, dashed: index / colours % 2 == 1, marker }
    }

    fn colour(self) -> RGBColor {
        let (red, green, blue) = COLOURS[self.colour.min(COLOURS.len() - 1)];
        RGBColor(red, green, blue)
    }
}

/// Okabe and Ito's palette, which colour-blind people can tell apart, with a darker yellow, and a grey before its black.
pub const COLOURS: [(u8, u8, u8); 9] = [
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (86, 180, 233),
    (230, 159, 0),
    (158, 142, 0),
    (96, 96, 96),
    (0, 0, 0),
];

/// Height of the title and of a row of the legend, and the width of the legend before its names, in pixels.
const TITLE: u32 = 34;
const ROW: i32 = 19;
const SAMPLE: i32 = 44;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), Box<dyn std::error::Error>>;

impl Chart {
    /// Draws it.
    ///
    /// # Errors
    /// A sentence where there is nothing to draw.
    pub fn svg(&self) -> Result<String> {
        let mut svg = String::new();
        self.draw(&mut svg).map_err(|error| anyhow!("cannot draw \"{}\": {error}", self.title))?;
        Ok(svg)
    }

    fn draw(&self, svg: &mut String) -> Drawn {
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns);
        let legend = self.legend();
        let longest = legend.iter().map(|line| line.name.chars().count()).max().unwrap_or(0);
        let (width, height) = (self.panel.0 * columns as u32, self.panel.1 * rows as u32);
        let legend_width = SAMPLE as u32 + 24 + 7 * longest as u32;
        let legend_height = (legend.len() as u32 + 2) * ROW as u32;
        let size = (width + legend_width, TITLE + height.max(legend_height));
        let root = SVGBackend::with_string(svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let style = TextStyle::from(("sans-serif", 17).into_font()).pos(Pos::new(HPos::Left, VPos::Center));
        root.draw_text(&self.title, &style, (14, TITLE as i32 / 2 + 2))?;
        let (_, below) = root.split_vertically(TITLE);
        let (panels, beside) = below.split_horizontally(width);
        let (panels, _) = panels.split_vertically(height);
        for (panel, area) in self.panels.iter().zip(panels.split_evenly((rows, columns))) {
            panel.draw(&area)?;
        }
        draw_legend(&beside, &legend)?;
        root.present()?;
        Ok(())
    }

    /// A line of each name.
    fn legend(&self) -> Vec<&Line> {
        let mut legend: Vec<&Line> = Vec::new();
        for line in self.panels.iter().flat_map(|panel| &panel.lines) {
            if !legend.iter().any(|there| there.name == line.name) {
                legend.push(line);
            }
        }
        legend
    }
}

fn draw_legend(area: &Area, legend: &[&Line]) -> Drawn {
    for (line, row) in legend.iter().zip(1..) {
        let y = row * ROW + 6;
        let ends = vec![(4, y), (SAMPLE - 8, y)];
        let colour = line.look.colour();
        if line.look.dashed {
            area.draw(&DashedPathElement::new(ends, 5, 4, colour.stroke_width(2)))?;
        } else {
            area.draw(&PathElement::new(ends, colour.stroke_width(2)))?;
        }
        let at = (SAMPLE / 2 - 2, y);
        match line.look.marker {
            Marker::None => {}
            Marker::Disc => area.draw(&Circle::new(at, 3, colour.filled()))?,
            Marker::Triangle => area.draw(&TriangleMarker::new(at, 5, colour.filled()))?,
            Marker::Cross => area.draw(&Cross::new(at, 4, colour.stroke_width(2)))?,
        }
        let style = TextStyle::from(("sans-serif", 13).into_font()).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw_text(&line.name, &style, (SAMPLE, y))?;
    }
    Ok(())
}

impl Panel {
    fn draw(&self, area: &Area) -> Drawn {
        let x = self.range(&self.x, |point| point.0).ok_or("no points to draw")?;
        let y = self.range(&self.y, |point| point.1).ok_or("no points to draw")?;
        // The drawing library names powers of ten alone, and a graph may have none.
        let log = |range: Range<f64>| {
            let points = log_points(&range);
            range.log_scale().with_key_points(points)
        };
        match (self.x.log, self.y.log) {
            (false, false) => self.on(area, x, y),
            (false, true) => self.on(area, x, log(y)),
            (true, false) => self.on(area, log(x), y),
            (true, true) => self.on(area, log(x), log(y)),
        }
    }

    fn on<X, Y>(&self, area: &Area, x: X, y: Y) -> Drawn
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let mut builder = ChartBuilder::on(area);
        if !self.title.is_empty() {
            builder.caption(&self.title, ("sans-serif", 14));
        }
        let mut chart = builder
            .margin(10)
            .margin_right(18)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d(x, y)?;
        chart
            .configure_mesh()
            .light_line_style(RGBColor(242, 242, 246))
            .bold_line_style(RGBColor(217, 221, 231))
            .x_desc(&self.x.name)
            .y_desc(&self.y.name)
            .x_labels(8)
            .y_labels(8)
            .max_light_lines(2)
            .x_label_formatter(&|value| short(*value))
            .y_label_formatter(&|value| short(*value))
            .label_style(("sans-serif", 12))
            .axis_desc_style(("sans-serif", 13))
            .draw()?;
        for line in &self.lines {
            let points: Vec<(f64, f64)> =
                line.points.iter().copied().filter(|point| self.shows(point)).collect();
            let colour = line.look.colour();
            if line.look.dashed {
                let path = DashedPathElement::new(points.clone(), 6, 4, colour.stroke_width(2));
                chart.draw_series([path])?;
            } else {
                // Thinner where points are so many that they say more than a curve through them.
                let width = if line.look.marker == Marker::None { 1 } else { 2 };
                chart.draw_series([PathElement::new(points.clone(), colour.stroke_width(width))])?;
            }
            let points = points.into_iter();
            match line.look.marker {
                Marker::None => {}
                Marker::Disc => {
                    chart.draw_series(points.map(|at| Circle::new(at, 3, colour.filled())))?;
                }
                Marker::Triangle => {
                    chart.draw_series(points.map(|at| TriangleMarker::new(at, 5, colour.filled())))?;
                }
                Marker::Cross => {
                    chart.draw_series(points.map(|at| Cross::new(at, 4, colour.stroke_width(2))))?;
                }
            }
        }
        Ok(())
    }

    fn shows(&self, point: &(f64, f64)) -> bool {
        let on = |axis: &Axis, value: f64| value.is_finite() && (!axis.log || value > 0.0);
        on(&self.x, point.0) && on(&self.y, point.1)
    }

    /// The range of an axis, with a little room at both ends.
    fn range(&self, axis: &Axis, of: impl Fn(&(f64, f64)) -> f64) -> Option<Range<f64>> {
        let points = self.lines.iter().flat_map(|line| &line.points).filter(|point| self.shows(point));
        let (low, high) = points
            .map(of)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if low > high {
            return None;
        }
        Some(if axis.log {
            low / 1.15..high * 1.15
        } else {
            let room = if high > low { (high - low) * 0.04 } else { 1.0 };
            low - room..high + room
        })
    }
}

/// Where a logarithmic axis is named: at 1, 2 and 5 of each power of ten, or at the powers alone where they are many.
fn log_points(range: &Range<f64>) -> Vec<f64> {
    let (low, high) = (range.start.log10().floor() as i32, range.end.log10().ceil() as i32);
    let parts: &[f64] = if (range.end / range.start).log10() > 3.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let points = (low..=high).flat_map(|power| parts.iter().map(move |part| part * 10f64.powi(power)));
    points.filter(|point| range.contains(point)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithmic_axes_have_names() {
        assert_eq!(log_points(&(4e3..30e3)), [5e3, 10e3, 20e3]);
        assert_eq!(log_points(&(0.5..600.0)), [1.0, 10.0, 100.0]);
    }

    #[test]
    fn a_chart_has_its_lines_and_names_and_one_without_points_is_refused() {
        let line = |name: &str, index, points: &[(f64, f64)]| Line {
            name: name.into(),
            look: Look::nth(index),
            points: points.to_vec(),
        };
        let axis = |log| Axis { name: "bits & bytes".into(), log };
        let mut chart = Chart {
            title: "a < b".into(),
            panel: (300, 200),
            columns: 2,
            panels: vec![Panel {
                title: "one".into(),
                x: axis(true),
                y: axis(false),
                lines: vec![
                    line("first", 0, &[(1.0, 2.0), (10.0, 3.0), (0.0, 9.0)]),
                    line("second", 9, &[(3.0, 1.0), (4.0, f64::NAN)]),
                ],
            }],
        };
        let svg = chart.svg().unwrap();
        for text in ["a &lt; b", "bits &amp; bytes", "first", "second"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(svg.contains("#0072B2") && svg.contains("#D55E00"));
        chart.panels[0].lines.clear();
        assert_eq!(chart.svg().unwrap_err().to_string(), "cannot draw \"a < b\": no points to draw");
    }
}
