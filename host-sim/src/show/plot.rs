//! Drawings over a show's time, as SVG that takes its colours from the page.

use crate::profile::svg::escape;
use std::fmt::{Result, Write};

/// Space around a plot.
const LEFT: f64 = 52.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 22.0;

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
    ///
    /// # Errors
    /// Only where `page` has any.
    pub fn draw(&self, page: &mut dyn Write) -> Result {
        let (width, height) = self.size;
        let (low, high) = self.range;
        let span = if high > low { high - low } else { 1.0 };
        let y = |value: f64| TOP + (height - TOP - BOTTOM) * (1.0 - (value - low) / span);
        writeln!(
            page,
            "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">",
            escape(self.label)
        )?;
        let step = step(span / ((height - TOP - BOTTOM) / 34.0).max(1.0));
        let mut line = (low / step).ceil() * step;
        while line <= high + step * 1e-6 {
            let at = y(line);
            let text = number(line, step);
            writeln!(
                page,
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/><text x=\"{}\" y=\"{:.1}\" \
                 text-anchor=\"end\">{text}</text>",
                width - RIGHT,
                LEFT - 6.0,
                at + 4.0
            )?;
            line += step;
        }
        time_axis(page, self.size, self.seconds)?;
        for limit in self.limits.iter().filter(|limit| (low..=high).contains(*limit)) {
            let at = y(*limit);
            writeln!(
                page,
                "<line class=\"limit\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>",
                width - RIGHT
            )?;
        }
        for (at, what) in self.marks {
            let x = across(width, self.seconds, *at);
            writeln!(
                page,
                "<line class=\"mark\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{:.1}\"><title>{at:.2} s: {}</title></line>",
                height - BOTTOM,
                escape(what)
            )?;
        }
        for series in &self.series {
            let points = thinned(&series.values, (width - LEFT - RIGHT) as usize);
            let count = series.values.len().max(2) as f64 - 1.0;
            for run in points.split(Option::is_none).filter(|run| !run.is_empty()) {
                write!(page, "<polyline class=\"{}\" points=\"", series.class)?;
                for (place, value) in run.iter().flatten() {
                    let x = LEFT + (width - LEFT - RIGHT) * place / count;
                    write!(page, "{x:.1},{:.1} ", y(value.clamp(low, high)))?;
                }
                writeln!(page, "\"/>")?;
            }
        }
        writeln!(
            page,
            "<text class=\"unit\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n</svg>",
            LEFT + 4.0,
            TOP + 10.0,
            escape(self.unit)
        )
    }
}

/// A stretch of time, how the page's style names it, and what it says.
pub struct Span {
    /// When it begins, in seconds.
    pub from: f64,
    /// When it ends.
    pub to: f64,
    /// Its class.
    pub class: String,
    /// Its text.
    pub text: String,
}

/// Height of a row of a time line.
const ROW: f64 = 26.0;

/// Rows of stretches of time, each with a name, and moments below them.
///
/// # Errors
/// Only where `page` has any.
pub fn time_line(
    page: &mut dyn Write,
    width: f64,
    seconds: f64,
    rows: &[(&str, Vec<Span>)],
    marks: &[(f64, String)],
) -> Result {
    let below = TOP + rows.len() as f64 * ROW;
    // Texts of moments that are close stand below each other.
    let mut ends: Vec<f64> = Vec::new();
    let placed: Vec<(f64, usize, &str)> = marks
        .iter()
        .map(|(at, what)| {
            let x = across(width, seconds, *at);
            let length = 6.4 * what.chars().count() as f64 + 14.0;
            // At the right end the text stands before its moment.
            let from = if x + length > width - RIGHT { x - length } else { x };
            let row = ends.iter().position(|end| *end < from).unwrap_or(ends.len());
            match ends.get_mut(row) {
                Some(end) => *end = from + length,
                None => ends.push(from + length),
            }
            (x, row, what.as_str())
        })
        .collect();
    let height = below + 18.0 * ends.len() as f64 + 8.0 + BOTTOM;
    writeln!(page, "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"What happened when\">")?;
    for (row, (name, spans)) in rows.iter().enumerate() {
        let y = TOP + row as f64 * ROW;
        writeln!(
            page,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 6.0,
            y + 16.0,
            escape(name)
        )?;
        for span in spans {
            let (from, to) = (across(width, seconds, span.from), across(width, seconds, span.to));
            let text = escape(&span.text);
            writeln!(
                page,
                "<rect class=\"{}\" x=\"{from:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{}\"><title>{text}, {:.2} to {:.2} \
                 s</title></rect>",
                span.class,
                (to - from).max(0.8),
                ROW - 5.0,
                span.from,
                span.to
            )?;
            if to - from > 7.4 * span.text.chars().count() as f64 {
                writeln!(
                    page,
                    "<text class=\"on\" x=\"{:.1}\" y=\"{:.1}\">{text}</text>",
                    from + 4.0,
                    y + 15.0
                )?;
            }
        }
    }
    for (x, row, what) in placed {
        let y = below + 18.0 * row as f64 + 14.0;
        let anchor =
            if x + 6.4 * what.chars().count() as f64 + 14.0 > width - RIGHT { "end" } else { "start" };
        let shift = if anchor == "end" { -5.0 } else { 5.0 };
        writeln!(
            page,
            "<line class=\"mark\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{TOP}\" y2=\"{y:.1}\"/><text class=\"what\" x=\"{:.1}\" \
             y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>",
            x + shift,
            escape(what)
        )?;
    }
    time_axis(page, (width, height), seconds)?;
    writeln!(page, "</svg>")
}

/// Where a moment is.
fn across(width: f64, seconds: f64, at: f64) -> f64 {
    LEFT + (width - LEFT - RIGHT) * (at / seconds.max(1e-9)).clamp(0.0, 1.0)
}

fn time_axis(page: &mut dyn Write, (width, height): (f64, f64), seconds: f64) -> Result {
    let step = step(seconds / ((width - LEFT - RIGHT) / 70.0));
    let mut at = 0.0;
    while at <= seconds {
        writeln!(
            page,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{} s</text>",
            across(width, seconds, at),
            height - 6.0,
            number(at, step)
        )?;
        at += step;
    }
    Ok(())
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

/// The step of a scale: 1, 2 or 5 times a power of ten, at least `wanted`.
fn step(wanted: f64) -> f64 {
    let power = 10f64.powf(wanted.max(1e-9).log10().floor());
    let step = [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|&step| step >= wanted);
    step.unwrap_or(10.0 * power)
}

/// A value on a scale, with no more decimals than its step has.
fn number(value: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').chars().all(|digit| "0.".contains(digit)) { "0".to_owned() } else { text }
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
    fn scales_are_round() {
        assert_eq!((step(0.3), step(7.0), step(20.0)), (0.5, 10.0, 20.0));
        assert_eq!(
            (number(0.5, 0.5), number(-0.0, 1.0), number(30.0, 10.0)),
            ("0.5".into(), "0".into(), "30".into())
        );
    }
}
