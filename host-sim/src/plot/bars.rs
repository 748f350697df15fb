//! A bar a frame.

use super::page;
use super::scale::{lines, number, step, tenths};
use maud::{Markup, html};

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 220.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 30.0;

/// Most bars of a plot; where there are more frames, a bar stands for several.
const BARS: usize = 500;

/// Cycles of each frame, the highest of several where there are many; the scale starts at 0.
pub fn frames(cycles: &[u64], mean: f64, worst: usize) -> Markup {
    let per_bar = cycles.len().div_ceil(BARS).max(1);
    let highest = cycles.iter().copied().max().unwrap_or(0);
    let line_step = step((highest as f64 / 4.0).max(1.0));
    let top = (highest as f64 / line_step).ceil().max(1.0) * line_step;
    let (plot_width, plot_height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    let y = |cycles: f64| TOP + plot_height * (1.0 - cycles / top);
    let x = |frame: f64| LEFT + plot_width * frame / cycles.len().max(1) as f64;
    let bar = |number: usize, chunk: &[u64]| {
        let first = number * per_bar;
        let last = first + chunk.len() - 1;
        let most = chunk.iter().copied().max().unwrap_or(0);
        let (left, right) = (x(first as f64), x((last + 1) as f64));
        // A hair's breadth between bars where they are wide enough for one; narrow ones overlap by as much.
        let gap = if right - left > 4.0 { 0.6 } else { -0.6 };
        let class = if (first..=last).contains(&worst) { "worst" } else { "frames" };
        html! {
            rect class=(class) x=(format!("{left:.2}")) width=(format!("{:.2}", right - left - gap))
                y=(format!("{:.2}", y(most as f64))) height=(format!("{:.2}", y(0.0) - y(most as f64))) {
                title {
                    @if first == last { "frame " (first) } @else { "frames " (first) " to " (last) ", at most" }
                    ": " (most) " cycles"
                }
            }
        }
    };
    let frame_step = step((cycles.len() as f64 / 8.0).max(1.0)) as usize;
    let content = html! {
        @for line in lines(0.0, top, line_step) {
            line class="grid" x1=(LEFT) x2=(WIDTH - RIGHT) y1=(tenths(y(line))) y2=(tenths(y(line))) {}
            text x=(LEFT - 8.0) y=(tenths(y(line) + 4.0)) text-anchor="end" { (number(line, line_step)) }
        }
        @for (number, chunk) in cycles.chunks(per_bar).enumerate() { (bar(number, chunk)) }
        line class="mean" x1=(LEFT) x2=(WIDTH - RIGHT) y1=(tenths(y(mean))) y2=(tenths(y(mean))) {}
        @for frame in (0..cycles.len()).step_by(frame_step) {
            text x=(tenths(x(frame as f64 + 0.5))) y=(HEIGHT - 10.0) text-anchor="middle" { (frame) }
        }
        text x=(WIDTH - RIGHT) y=(HEIGHT - 10.0) text-anchor="end" { "frame" }
    };
    page::svg("Cycles of each frame", (WIDTH, HEIGHT), content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_frames_share_bars_and_the_worst_is_marked() {
        let mut cycles = vec![100; 2000];
        cycles[1234] = 5000;
        let drawn = frames(&cycles, 102.0, 1234).into_string();
        assert!(drawn.matches("<rect").count() <= BARS);
        assert!(
            drawn.contains("class=\"worst\"") && drawn.contains("frames 1232 to 1235, at most: 5000"),
            "{drawn}"
        );
    }
}
