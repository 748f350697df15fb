//! Cycles of functions and of what they call, as a flame graph.

use super::page;
use maud::{Markup, html};

const WIDTH: f64 = 1000.0;

/// Height of a row.
const ROW: f64 = 24.0;

/// Width of a letter of a label, about.
const LETTER: f64 = 7.3;

/// A function's cycles, all frames together, on one path of calls.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Node {
    /// The function.
    pub name: String,
    /// Cycles, with those of the functions that it calls.
    pub cycles: u64,
    /// Cycles in the function itself.
    pub itself: u64,
    /// What it calls, by the most cycles.
    pub children: Vec<Node>,
}

impl Node {
    /// Rows that a drawing takes.
    pub fn depth(&self) -> usize {
        1 + self.children.iter().map(Self::depth).max().unwrap_or(0)
    }
}

/// Functions from left to right by their cycles, what is inlined in them below.
pub fn graph(root: &Node, frames: usize) -> Markup {
    let height = root.depth() as f64 * ROW + 2.0;
    let scale = Scale { total: root.cycles.max(1) as f64, frames: frames.max(1) as f64 };
    page::svg("Cycles of each function", (WIDTH, height), node(root, scale, 0.0, 0))
}

/// What cycles are set in proportion to.
#[derive(Clone, Copy)]
struct Scale {
    total: f64,
    frames: f64,
}

impl Scale {
    fn width(self, node: &Node) -> f64 {
        node.cycles as f64 / self.total * WIDTH
    }
}

fn node(node: &Node, scale: Scale, left: f64, depth: usize) -> Markup {
    let width = scale.width(node);
    // Narrower than a line of the screen.
    if width < 0.4 {
        return html! {};
    }
    let top = depth as f64 * ROW + 1.0;
    let letters = ((width - 12.0) / LETTER) as usize;
    let mut next = left;
    let children = node.children.iter().map(|child| {
        let at = next;
        next += scale.width(child);
        self::node(child, scale, at, depth + 1)
    });
    html! {
        g {
            title {
                (node.name) ": " (format!("{:.1}", node.cycles as f64 / scale.frames)) " cycles a frame, "
                (format!("{:.1}", node.cycles as f64 / scale.total * 100.0)) " %; itself "
                (format!("{:.1}", node.itself as f64 / scale.frames))
            }
            rect x=(format!("{left:.2}")) y=(top) width=(format!("{:.2}", (width - 1.0).max(0.4))) height=(ROW - 2.0)
                rx="2" fill={ "hsl(" (hue(&node.name)) " 70% 74%)" } {}
            @if letters >= 4 {
                text class="label" x=(format!("{:.2}", left + 6.0)) y=(format!("{:.1}", top + ROW - 9.0)) {
                    (shortened(&node.name, letters))
                }
            }
        }
        @for child in children { (child) }
    }
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
    fn names_are_escaped_and_cut_at_the_front() {
        assert_eq!(shortened("decoder_core::qmd::row::add", 9), "…row::add");
        assert_eq!(shortened("short", 9), "short");
        let root = Node { name: "<a as B>".into(), cycles: 10, itself: 10, children: Vec::new() };
        let drawn = graph(&root, 5).into_string();
        assert!(drawn.contains("&lt;a as B&gt;: 2.0 cycles a frame, 100.0 %"), "{drawn}");
    }
}
