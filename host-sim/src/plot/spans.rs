//! Stretches of time in rows, and moments below them.

use super::lines::{BOTTOM, LEFT, RIGHT, TOP, across, time_axis};
use super::page;
use super::scale::tenths;
use maud::{Markup, html};

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
pub fn time_line(width: f64, seconds: f64, rows: &[(&str, Vec<Span>)], marks: &[(f64, String)]) -> Markup {
    let below = TOP + rows.len() as f64 * ROW;
    let (moments, deepest) = placed(width, seconds, marks);
    let size = (width, below + 18.0 * deepest as f64 + 8.0 + BOTTOM);
    let content = html! {
        @for (row, (name, spans)) in rows.iter().enumerate() {
            @let y = TOP + row as f64 * ROW;
            text x=(LEFT - 6.0) y=(tenths(y + 16.0)) text-anchor="end" { (name) }
            @for span in spans {
                @let from = across(width, seconds, span.from);
                @let to = across(width, seconds, span.to);
                rect class=(span.class) x=(tenths(from)) y=(tenths(y)) width=(tenths((to - from).max(0.8)))
                    height=(ROW - 5.0) {
                    title { (span.text) (format!(", {:.2} to {:.2} s", span.from, span.to)) }
                }
                @if to - from > 7.4 * span.text.chars().count() as f64 {
                    text class="on" x=(tenths(from + 4.0)) y=(tenths(y + 15.0)) { (span.text) }
                }
            }
        }
        @for moment in moments {
            @let y = tenths(below + 18.0 * moment.row as f64 + 14.0);
            line class="mark" x1=(tenths(moment.x)) x2=(tenths(moment.x)) y1=(TOP) y2=(y) {}
            @let (shift, anchor) = if moment.before { (-5.0, "end") } else { (5.0, "start") };
            text class="what" x=(tenths(moment.x + shift)) y=(y) text-anchor=(anchor) { (moment.what) }
        }
        (time_axis(size, seconds))
    };
    page::svg("What happened when", size, content)
}

/// A moment in a drawing.
struct Moment<'a> {
    x: f64,
    /// Row of its text: texts of moments that are close stand below each other.
    row: usize,
    /// Whether its text stands before it, where there is no room after it.
    before: bool,
    what: &'a str,
}

/// Where moments are, and how many rows their texts take.
fn placed(width: f64, seconds: f64, marks: &[(f64, String)]) -> (Vec<Moment<'_>>, usize) {
    let mut ends: Vec<f64> = Vec::new();
    let place = |(at, what): &'_ (f64, String)| {
        let x = across(width, seconds, *at);
        let length = 6.4 * what.chars().count() as f64 + 14.0;
        let before = x + length > width - RIGHT;
        let from = if before { x - length } else { x };
        let row = ends.iter().position(|end| *end < from).unwrap_or(ends.len());
        match ends.get_mut(row) {
            Some(end) => *end = from + length,
            None => ends.push(from + length),
        }
        (x, row, before)
    };
    let places: Vec<_> = marks.iter().map(place).collect();
    let moments = places.into_iter().zip(marks);
    let moments = moments.map(|((x, row, before), (_, what))| Moment { x, row, before, what }).collect();
    (moments, ends.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_do_not_lie_over_each_other() {
        let marks = [(1.0, "first".to_owned()), (1.01, "second".to_owned()), (9.9, "at the end".to_owned())];
        let (moments, rows) = placed(1000.0, 10.0, &marks);
        let rows_of: Vec<usize> = moments.iter().map(|moment| moment.row).collect();
        assert_eq!((rows_of.as_slice(), rows), ([0, 1, 0].as_slice(), 2));
        assert!(moments[2].before && !moments[0].before);
    }
}
