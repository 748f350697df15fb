//! The two drawings of a profile's page.

use super::flame::Node;
use std::fmt::{Result, Write};

const WIDTH: f64 = 1000.0;
const HEIGHT: f64 = 220.0;
const LEFT: f64 = 64.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 30.0;

/// Most bars of a plot; where there are more frames, a bar stands for several.
const BARS: usize = 500;

/// Text for HTML or SVG.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A bar a frame, the highest of several where there are many; the scale starts at 0.
///
/// # Errors
/// Only where `page` has any.
pub fn frames(page: &mut dyn Write, cycles: &[u64], mean: f64, worst: usize) -> Result {
    let per_bar = cycles.len().div_ceil(BARS).max(1);
    let highest = cycles.iter().copied().max().unwrap_or(0);
    let step = tick(highest as f64 / 4.0);
    let top = (highest as f64 / step).ceil().max(1.0) * step;
    let (plot_width, plot_height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
    let y = |cycles: f64| TOP + plot_height * (1.0 - cycles / top);
    let x = |frame: f64| LEFT + plot_width * frame / cycles.len().max(1) as f64;
    writeln!(
        page,
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"Cycles of each frame\">"
    )?;
    let mut line = 0.0;
    while line <= top + step / 2.0 {
        let at = y(line);
        writeln!(
            page,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{line}</text>",
            WIDTH - RIGHT,
            LEFT - 8.0,
            at + 4.0
        )?;
        line += step;
    }
    for (number, chunk) in cycles.chunks(per_bar).enumerate() {
        let first = number * per_bar;
        let last = first + chunk.len() - 1;
        let most = chunk.iter().copied().max().unwrap_or(0);
        let (left, right) = (x(first as f64), x((last + 1) as f64));
        // A hair's breadth between bars where they are wide enough for one; narrow ones overlap by as much.
        let gap = if right - left > 4.0 { 0.6 } else { -0.6 };
        let class = if (first..=last).contains(&worst) { "worst" } else { "frames" };
        let which = if first == last {
            format!("frame {first}")
        } else {
            format!("frames {first} to {last}, at most")
        };
        writeln!(
            page,
            "<rect class=\"{class}\" x=\"{left:.2}\" width=\"{:.2}\" y=\"{:.2}\" height=\"{:.2}\"><title>{which}: {most} \
             cycles</title></rect>",
            right - left - gap,
            y(most as f64),
            y(0.0) - y(most as f64)
        )?;
    }
    let at = y(mean);
    writeln!(
        page,
        "<line class=\"mean\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>",
        WIDTH - RIGHT
    )?;
    let step = (tick(cycles.len() as f64 / 8.0) as usize).max(1);
    for frame in (0..cycles.len()).step_by(step) {
        writeln!(
            page,
            "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{frame}</text>",
            x(frame as f64 + 0.5),
            HEIGHT - 10.0
        )?;
    }
    writeln!(
        page,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"end\">frame</text>\n</svg>",
        WIDTH - RIGHT,
        HEIGHT - 10.0
    )
}

/// The step of a scale: 1, 2 or 5 times a power of ten, at least `wanted`.
fn tick(wanted: f64) -> f64 {
    let power = 10f64.powf(wanted.max(1.0).log10().floor());
    let step = [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|&step| step >= wanted);
    step.unwrap_or(10.0 * power)
}

/// Height of a row of the flame graph.
const ROW: f64 = 24.0;

/// Width of a letter of a label, about.
const LETTER: f64 = 7.3;

/// Functions from left to right by their cycles, what is inlined in them below.
///
/// # Errors
/// Only where `page` has any.
pub fn flame(page: &mut dyn Write, root: &Node, frames: usize) -> Result {
    let height = root.depth() as f64 * ROW + 2.0;
    writeln!(
        page,
        "<svg viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"Cycles of each function\">"
    )?;
    let scale = Scale { total: root.cycles.max(1) as f64, frames: frames.max(1) as f64 };
    node(page, root, scale, 0.0, 0)?;
    writeln!(page, "</svg>")
}

/// What cycles are set in proportion to.
#[derive(Clone, Copy)]
struct Scale {
    total: f64,
    frames: f64,
}

fn node(page: &mut dyn Write, node: &Node, scale: Scale, left: f64, depth: usize) -> Result {
    let width = node.cycles as f64 / scale.total * WIDTH;
    // Narrower than a line of the screen.
    if width < 0.4 {
        return Ok(());
    }
    let top = depth as f64 * ROW + 1.0;
    let name = escape(&node.name);
    let hue = hue(&node.name);
    writeln!(
        page,
        "<g><title>{name}: {:.1} cycles a frame, {:.1} %; itself {:.1}</title><rect x=\"{left:.2}\" y=\"{top}\" \
         width=\"{:.2}\" height=\"{}\" rx=\"2\" fill=\"hsl({hue} 70% 74%)\"/>",
        node.cycles as f64 / scale.frames,
        node.cycles as f64 / scale.total * 100.0,
        node.itself as f64 / scale.frames,
        (width - 1.0).max(0.4),
        ROW - 2.0,
    )?;
    let letters = ((width - 12.0) / LETTER) as usize;
    if letters >= 4 {
        let label = shortened(&node.name, letters);
        writeln!(
            page,
            "<text class=\"label\" x=\"{:.2}\" y=\"{:.1}\">{}</text>",
            left + 6.0,
            top + ROW - 9.0,
            escape(&label)
        )?;
    }
    writeln!(page, "</g>")?;
    let mut left = left;
    for child in &node.children {
        self::node(page, child, scale, left, depth + 1)?;
        left += child.cycles as f64 / scale.total * WIDTH;
    }
    Ok(())
}

/// The last `letters` of a path say most.
fn shortened(name: &str, letters: usize) -> String {
    let count = name.chars().count();
    if count <= letters {
        return name.to_owned();
    }
    let tail: String = name.chars().skip(count + 1 - letters).collect();
    format!("…{tail}")
}

/// A colour for a name, the same in every picture: warm, as flames are.
fn hue(name: &str) -> u32 {
    let sum = name.bytes().fold(17u32, |sum, byte| sum.wrapping_mul(31).wrapping_add(u32::from(byte)));
    10 + sum % 190
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_a_scale_are_round() {
        for (wanted, step) in [(0.2, 1.0), (1.0, 1.0), (1.1, 2.0), (3.0, 5.0), (7.0, 10.0), (180.0, 200.0)] {
            assert!((tick(wanted) - step).abs() < 1e-9, "{wanted}");
        }
    }

    #[test]
    fn names_are_escaped_and_cut_at_the_front() {
        assert_eq!(escape("<a as B>::\"c\" & d"), "&lt;a as B&gt;::&quot;c&quot; &amp; d");
        assert_eq!(shortened("decoder_core::qmd::row::add", 9), "…row::add");
        assert_eq!(shortened("short", 9), "short");
    }

    #[test]
    fn many_frames_share_bars_and_the_worst_is_marked() {
        let mut cycles = vec![100; 2000];
        cycles[1234] = 5000;
        let mut page = String::new();
        frames(&mut page, &cycles, 102.0, 1234).unwrap();
        assert!(page.matches("<rect").count() <= BARS);
        assert!(
            page.contains("class=\"worst\"") && page.contains("frames 1232 to 1235, at most: 5000"),
            "{page}"
        );
    }
}
