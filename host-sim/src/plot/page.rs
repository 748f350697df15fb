//! A page that needs nothing else: its style is in it, and its drawings are.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Colours, light and dark, and the looks of everything that several pages have.
const STYLE: &str = "\
:root { --ink: #1c2430; --soft: #667085; --line: #d9dee7; --paper: #fff; --panel: #f6f8fb; --bar: #3b74d8; --bar-soft: #a9c4f3; --worst: #d4380d; color-scheme: light dark }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ef; --soft: #98a2b3; --line: #333c4b; --paper: #12161d; --panel: #1a202a; --bar: #6b9bf0; --bar-soft: #2f4a78; --worst: #ff7a45 } }
* { box-sizing: border-box }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 1140px; margin: 0 auto; padding: 24px 20px 60px }
h1 { font-size: 24px; margin: 0 0 2px } h2 { font-size: 18px; margin: 36px 0 8px } p { margin: 4px 0 } .soft { color: var(--soft) }
.scroll { overflow-x: auto } table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; margin: 12px 0 }
th, td { padding: 5px 7px; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap } th { font-weight: 600; color: var(--soft) }
th:first-child, td:first-child { text-align: left } td.name { font-family: ui-monospace, monospace; font-size: 13px; white-space: normal; word-break: break-word }
figure { margin: 10px 0; background: var(--panel); border: 1px solid var(--line); border-radius: 8px; padding: 12px } figcaption { font-size: 13px; color: var(--soft); margin-bottom: 6px }
svg { display: block; width: 100%; height: auto } svg text { font: 12px system-ui, sans-serif; fill: var(--soft) }
.grid { stroke: var(--line); stroke-width: 1 } rect.frames, rect.worst { shape-rendering: crispEdges } .frames { fill: var(--bar) } .frames:hover { fill: var(--worst) } .mean { stroke: var(--ink); stroke-dasharray: 5 4 } .worst { fill: var(--worst) }
svg text.label { fill: #10182b; font-family: ui-monospace, monospace } svg text.strong { fill: var(--ink) }
";

/// A page with a title and, besides the style of all, one of its own.
pub fn page(title: &str, own_style: &str, body: Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(own_style)) }
            }
            body { (body) }
        }
    };
    page.into_string() + "\n"
}

/// A drawing with what it shows in words.
pub fn figure(caption: Markup, drawing: Markup) -> Markup {
    html! { figure { figcaption { (caption) } (drawing) } }
}

/// A table under these heads, which is scrolled where the page is too narrow for it.
pub fn table(heads: &[&str], rows: Markup) -> Markup {
    html! {
        div class="scroll" {
            table {
                tr { @for head in heads { th { (head) } } }
                (rows)
            }
        }
    }
}

/// A drawing of so many units.
pub fn svg(label: &str, (width, height): (f64, f64), content: Markup) -> Markup {
    html! {
        svg viewBox={ "0 0 " (width) " " (height) } role="img" aria-label=(label) { (content) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_ours_is_escaped() {
        let page = page("<a>", ".x { }", html! { (svg("\"b\"", (3.0, 4.5), html! {})) });
        assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"), "{page}");
        assert!(page.contains("<title>&lt;a&gt;</title>"), "{page}");
        assert!(page.contains("viewBox=\"0 0 3 4.5\"") && page.contains("&quot;b&quot;"), "{page}");
    }
}
