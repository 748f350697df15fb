//! A report as one page that needs nothing else: a table, and for each core its frames and its functions.

use super::report::{Container, CoreReport, Report, Table};
use super::svg;
use std::fmt::{Result, Write};
use std::path::Path;

/// Colours, light and dark.
pub(crate) const STYLE: &str = "\
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

/// Writes the page.
///
/// # Errors
/// Only where `page` has any.
pub fn write(page: &mut dyn Write, report: &Report) -> Result {
    let name = Path::new(&report.clip).file_name().unwrap_or_default().to_string_lossy();
    let name = svg::escape(&name);
    let subject = &report.subject;
    write!(
        page,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{name}: cycles</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{name}</h1>\n"
    )?;
    let unit = subject.unit();
    let plural = |count: u32| if count == 1 { "" } else { "s" };
    let (coded, lent) = match &subject.container {
        Container::Qmd { fixed_channels, index_bits, segments, table } => (
            format!("FDF {fixed_channels}, b {index_bits}, {segments} segment{}", plural(*segments)),
            match table {
                Table::Lent => format!("a table of {} bytes lent", 4u32 << index_bits),
                Table::None => "no table lent".to_owned(),
            },
        ),
        Container::Mclip { codec, entropy, blocks, lent_bytes } => (
            format!("{codec} with {entropy} codes, {blocks} block{}", plural(*blocks)),
            format!("{lent_bytes} bytes lent"),
        ),
    };
    writeln!(
        page,
        "<p>{} frames of {} channels, {} bytes; {coded}. The decoder had {lent}, the flash {} wait states; a {unit}'s \
         time is that at {} Hz.</p>",
        subject.frames, subject.channels, subject.clip_bytes, subject.wait_states, report.rate_hz,
    )?;
    if let Some(puppet) = &subject.puppet {
        writeln!(
            page,
            "<p>A tick decodes, interpolates, applies the limits and writes the packet for {} servos; the clip takes {} \
             ticks.</p>",
            puppet.servos, puppet.ticks
        )?;
    }
    writeln!(
        page,
        "<p class=\"soft\">Cycles are simulated from the machine code; docs/CYCLES.md says how far to trust them.</p>"
    )?;
    overview(page, report)?;
    for core in &report.cores {
        self::core(page, core, report)?;
    }
    writeln!(page, "</body>\n</html>")
}

fn overview(page: &mut dyn Write, report: &Report) -> Result {
    write!(page, "<div class=\"scroll\"><table>\n<tr>")?;
    for head in [
        "core",
        "error",
        "cycles, mean",
        "p99",
        "worst",
        if report.subject.puppet.is_some() { "at tick" } else { "at frame" },
        if report.subject.puppet.is_some() { "a servo" } else { "a sample" },
        "clock",
        if report.subject.puppet.is_some() { "of a tick" } else { "of a frame" },
        "stack",
        "code",
        "flash",
        "RAM",
    ] {
        write!(page, "<th>{head}</th>")?;
    }
    writeln!(page, "</tr>")?;
    for core in &report.cores {
        let error =
            core.tolerance.map_or("not known".to_owned(), |tolerance| format!("± {} %", tolerance * 100.0));
        writeln!(
            page,
            "<tr><td>{}</td><td>{error}</td><td>{:.1}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td>\
             <td>{} MHz</td><td>{:.3} %</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            core.core,
            core.cycles_mean,
            core.cycles_p99,
            core.cycles_max,
            core.worst_frame,
            core.cycles_per_sample,
            core.clock_hz / 1e6,
            core.frame_share_mean * 100.0,
            core.stack_bytes,
            core.code_bytes,
            core.flash_bytes,
            core.ram_bytes,
        )?;
    }
    writeln!(page, "</table></div>")
}

fn core(page: &mut dyn Write, core: &CoreReport, report: &Report) -> Result {
    let (unit, rate_hz) = (report.subject.unit(), report.rate_hz);
    writeln!(page, "<h2>{}</h2>", core.core)?;
    if let Some(energy) = &core.energy {
        writeln!(
            page,
            "<p>{} at {} MHz and {} V: {:.3} µJ a {unit}, {:.1} µA on average at {rate_hz} {unit}s a second, {:.0} hours \
             from {} mAh.</p>\n<p class=\"soft\">{}.</p>",
            energy.part,
            energy.clock_hz / 1e6,
            energy.volts,
            energy.microjoules_per_frame,
            energy.mean_microamps,
            energy.battery_hours,
            energy.battery_mah,
            svg::escape(energy.source),
        )?;
    }
    writeln!(
        page,
        "<figure><figcaption>Cycles of each {unit}: mean {:.1} (dashed), worst {} at {unit} {}</figcaption>",
        core.cycles_mean, core.cycles_max, core.worst_frame
    )?;
    svg::frames(page, &core.frame_cycles, core.cycles_mean, core.worst_frame)?;
    writeln!(page, "</figure>\n<figure><figcaption>Where a {unit}'s cycles go</figcaption>")?;
    svg::flame(page, &core.flame, core.frame_cycles.len())?;
    writeln!(
        page,
        "</figure>\n<div class=\"scroll\"><table>\n<tr><th>function</th><th>bytes</th><th>own cycles a {unit}</th><th>part</th></tr>"
    )?;
    for function in core.functions.iter().filter(|function| function.self_cycles >= 0.05) {
        writeln!(
            page,
            "<tr><td class=\"name\">{}</td><td>{}</td><td>{:.1}</td><td>{:.1} %</td></tr>",
            svg::escape(&function.name),
            function.bytes,
            function.self_cycles,
            function.share * 100.0
        )?;
    }
    writeln!(
        page,
        "</table></div>\n<div class=\"scroll\"><table>\n<tr><th>section</th><th>bytes</th><th>in</th></tr>"
    )?;
    for section in &core.sections {
        let place = match (section.flash, section.ram) {
            (true, true) => "flash and RAM",
            (_, true) => "RAM",
            _ => "flash",
        };
        writeln!(
            page,
            "<tr><td class=\"name\">{}</td><td>{}</td><td>{place}</td></tr>",
            svg::escape(&section.name),
            section.bytes
        )?;
    }
    writeln!(page, "</table></div>")
}
