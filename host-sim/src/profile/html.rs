//! A report as one page that needs nothing else: a table, and for each core its frames and its functions.

use super::report::{Container, CoreReport, Report, Table};
use crate::plot::page::{figure, page, table};
use crate::plot::{bars, flame};
use maud::{Markup, html};
use std::path::Path;

/// The page.
pub fn report_page(report: &Report) -> String {
    let name = Path::new(&report.clip).file_name().unwrap_or_default().to_string_lossy();
    let subject = &report.subject;
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
    let body = html! {
        h1 { (name) }
        p {
            (subject.frames) " frames of " (subject.channels) " channels, " (subject.clip_bytes) " bytes; " (coded)
            ". The decoder had " (lent) ", the flash " (subject.wait_states) " wait states; a " (subject.unit())
            "'s time is that at " (report.rate_hz) " Hz."
        }
        @if let Some(puppet) = &subject.puppet {
            p {
                "A tick decodes, interpolates, applies the limits and writes the packet for " (puppet.servos)
                " servos; the clip takes " (puppet.ticks) " ticks."
            }
        }
        p class="soft" { "Cycles are simulated from the machine code; docs/CYCLES.md says how far to trust them." }
        (overview(report))
        @for core in &report.cores { (core_section(core, report)) }
    };
    page(&format!("{name}: cycles"), "", body)
}

fn overview(report: &Report) -> Markup {
    let ticks = report.subject.puppet.is_some();
    let heads = [
        "core",
        "error",
        "cycles, mean",
        "p99",
        "worst",
        if ticks { "at tick" } else { "at frame" },
        if ticks { "a servo" } else { "a sample" },
        "clock",
        if ticks { "of a tick" } else { "of a frame" },
        "stack",
        "code",
        "flash",
        "RAM",
    ];
    let rows = html! {
        @for core in &report.cores {
            tr {
                td { (core.core) }
                td { @match core.tolerance { Some(tolerance) => { "± " (tolerance * 100.0) " %" }, None => "not known" } }
                td { (format!("{:.1}", core.cycles_mean)) }
                td { (core.cycles_p99) }
                td { (core.cycles_max) }
                td { (core.worst_frame) }
                td { (format!("{:.2}", core.cycles_per_sample)) }
                td { (core.clock_hz / 1e6) " MHz" }
                td { (format!("{:.3}", core.frame_share_mean * 100.0)) " %" }
                td { (core.stack_bytes) }
                td { (core.code_bytes) }
                td { (core.flash_bytes) }
                td { (core.ram_bytes) }
            }
        }
    };
    table(&heads, rows)
}

fn core_section(core: &CoreReport, report: &Report) -> Markup {
    let (unit, rate_hz) = (report.subject.unit(), report.rate_hz);
    let functions = core.functions.iter().filter(|function| function.self_cycles >= 0.05);
    html! {
        h2 { (core.core) }
        @if let Some(energy) = &core.energy {
            p {
                (energy.part) " at " (energy.clock_hz / 1e6) " MHz and " (energy.volts) " V: "
                (format!("{:.3}", energy.microjoules_per_frame)) " µJ a " (unit) ", "
                (format!("{:.1}", energy.mean_microamps)) " µA on average at " (rate_hz) " " (unit) "s a second, "
                (format!("{:.0}", energy.battery_hours)) " hours from " (energy.battery_mah) " mAh."
            }
            p class="soft" { (energy.source) "." }
        }
        (figure(
            html! {
                "Cycles of each " (unit) ": mean " (format!("{:.1}", core.cycles_mean)) " (dashed), worst "
                (core.cycles_max) " at " (unit) " " (core.worst_frame)
            },
            bars::frames(&core.frame_cycles, core.cycles_mean, core.worst_frame),
        ))
        (figure(
            html! { "Where a " (unit) "'s cycles go" },
            flame::graph(&core.flame, core.frame_cycles.len()),
        ))
        (table(&["function", "bytes", &format!("own cycles a {unit}"), "part"], html! {
            @for function in functions {
                tr {
                    td class="name" { (function.name) }
                    td { (function.bytes) }
                    td { (format!("{:.1}", function.self_cycles)) }
                    td { (format!("{:.1}", function.share * 100.0)) " %" }
                }
            }
        }))
        (table(&["section", "bytes", "in"], html! {
            @for section in &core.sections {
                tr {
                    td class="name" { (section.name) }
                    td { (section.bytes) }
                    td {
                        @match (section.flash, section.ram) {
                            (true, true) => "flash and RAM",
                            (_, true) => "RAM",
                            _ => "flash",
                        }
                    }
                }
            }
        }))
    }
}
