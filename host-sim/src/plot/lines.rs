//! Lines over time.

use super::page;
use super::scale::{self, number, step, tenths};
use maud::{Markup, html};

/// Space around a plot.
pub const LEFT: f64 = 52.0;
/// Space at its right.
pub const RIGHT: f64 = 10.0;
/// Space above it.
pub const TOP: f64 = 8.0;
/// Space below it.
pub const BOTTOM: f64 = 22.0;

/// A line, and how the page's style names it.
pub struct Series<'a> {
    /// Class of the line.
    pub class: &'a str,
    /// Its values, one a tick; gaps where there is none.
    pub values: Vec<Option<f64>>,
}

/// Lines over time.
pub struct Plot<'a> {
    /// What it shows, for those who cannot see it.
    pub label: &'a str,
    /// Width and height in units of the drawing.
    pub size: (f64, f64),
    /// Seconds from the left to the right.
    pub seconds: f64,
    /// Lowest and highest value.
    pub range: (f64, f64),
    /// What a value is in.
    pub unit: &'a str,
    /// Values at which a dashed line is drawn.
    pub limits: Vec<f64>,
    /// Moments at which a line is drawn, and what was then.
    pub marks: &'a [(f64, String)],
    /// The lines.
    pub series: Vec<Series<'a>>,
}

impl Plot<'_> {
    /// Draws it.
    pub fn draw(&self) -> Markup {
        let (width, height) = self.size;
        let (low, high) = self.range;
        let span = if high > low { high - low } else { 1.0 };
        let y = |value: f64| TOP + (height - TOP - BOTTOM) * (1.0 - (value - low) / span);
        let right = width - RIGHT;
        let line_step = step(span / ((height - TOP - BOTTOM) / 34.0).max(1.0));
        let limits = self.limits.iter().filter(|limit| (low..=high).contains(*limit));
        let content = html! {
            @for line in scale::lines(low, high, line_step) {
                line class="grid" x1=(LEFT) x2=(right) y1=(tenths(y(line))) y2=(tenths(y(line))) {}
                text x=(LEFT - 6.0) y=(tenths(y(line) + 4.0)) text-anchor="end" { (number(line, line_step)) }
            }
            (time_axis(self.size, self.seconds))
            @for limit in limits {
                line class="limit" x1=(LEFT) x2=(right) y1=(tenths(y(*limit))) y2=(tenths(y(*limit))) {}
            }
            @for (at, what) in self.marks {
                @let x = tenths(across(width, self.seconds, *at));
                line class="mark" x1=(x) x2=(x) y1=(TOP) y2=(tenths(height - BOTTOM)) {
                    title { (format!("{at:.2}")) " s: " (what) }
                }
            }
            @for series in &self.series {
                @let points = thinned(&series.values, (right - LEFT) as usize);
                @let count = series.values.len().max(2) as f64 - 1.0;
                @for part in points.split(Option::is_none).filter(|part| !part.is_empty()) {
                    polyline class=(series.class) points={
                        @for (place, value) in part.iter().flatten() {
                            (tenths(LEFT + (right - LEFT) * place / count)) "," (tenths(y(value.clamp(low, high)))) " "
                        }
                    } {}
                }
            }
            text class="unit" x=(tenths(LEFT + 4.0)) y=(tenths(TOP + 10.0)) { (self.unit) }
        };
        page::svg(self.label, self.size, content)
    }
}

/// Where a moment is in a drawing of this width.
pub fn across(width: f64, seconds: f64, at: f64) -> f64 {
    LEFT + (width - LEFT - RIGHT) * (at / seconds.max(1e-9)).clamp(0.0, 1.0)
}

/// Seconds below a drawing.
pub fn time_axis((width, height): (f64, f64), seconds: f64) -> Markup {
    let line_step = step(seconds / ((width - LEFT - RIGHT) / 70.0));
    html! {
        @for at in scale::lines(0.0, seconds, line_step) {
            text x=(tenths(across(width, seconds, at))) y=(tenths(height - 6.0)) text-anchor="middle" {
                (number(at, line_step)) " s"
            }
        }
    }
}

/// The lowest and the highest of each stretch, where there are more values than columns; each with its place.
fn thinned(values: &[Option<f64>], columns: usize) -> Vec<Option<(f64, f64)>> {
    let width = values.len().div_ceil(columns.max(1)).max(1);
    let mut points = Vec::new();
    for (number, chunk) in values.chunks(width).enumerate() {
        let all = || chunk.iter().enumerate().filter_map(|(at, value)| Some((at, (*value)?)));
        let lowest = all().min_by(|one, other| one.1.total_cmp(&other.1));
        let highest = all().max_by(|one, other| one.1.total_cmp(&other.1));
        let (Some(one), Some(other)) = (lowest, highest) else {
            points.push(None);
            continue;
        };
        let (first, second) = if one.0 <= other.0 { (one, other) } else { (other, one) };
        let point = |(at, value): (usize, f64)| Some(((number * width + at) as f64, value));
        points.push(point(first));
        if first.0 != second.0 {
            points.push(point(second));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_thinned_keeps_its_peaks_and_its_gaps() {
        let mut values: Vec<Option<f64>> = (0..1000).map(|at| Some(f64::from(at % 10))).collect();
        values[537] = Some(99.0);
        values[800..900].fill(None);
        let points = thinned(&values, 50);
        assert!(points.contains(&Some((537.0, 99.0))) && points.contains(&None));
        assert!(points.len() <= 100);
        assert_eq!(thinned(&[Some(1.0), None, Some(2.0)], 50), [Some((0.0, 1.0)), None, Some((2.0, 2.0))]);
    }

    #[test]
    fn a_gap_parts_a_line_and_a_moment_says_what_was_then() {
        let values = vec![Some(0.0), Some(1.0), None, Some(2.0), Some(1.0)];
        let plot = Plot {
            label: "angle",
            size: (300.0, 100.0),
            seconds: 4.0,
            range: (0.0, 2.0),
            unit: "degrees",
            limits: vec![1.5, 9.0],
            marks: &[(2.0, "a < b".to_owned())],
            series: vec![Series { class: "goal", values }],
        };
        let drawn = plot.draw().into_string();
        assert_eq!(drawn.matches("<polyline class=\"goal\"").count(), 2, "{drawn}");
        assert_eq!(drawn.matches("class=\"limit\"").count(), 1, "{drawn}");
        assert!(drawn.contains("<title>2.00 s: a &lt; b</title>"), "{drawn}");
    }
}
