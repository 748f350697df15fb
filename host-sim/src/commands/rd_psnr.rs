//! `bunraku rd --psnr`: the document's methods at one PSNR, in their order.

use anyhow::Result;
use host_sim::rd::Named;
use host_sim::rd::psnr::{Method, Reached, reach_all};
use std::process::ExitCode;

/// A method on all motions together.
#[derive(serde::Serialize)]
struct Pooled {
    method: &'static str,
    section: Option<&'static str>,
    /// How many times smaller the codes of all motions are than their raw samples, at exactly the PSNR.
    ratio_at: f64,
    /// The same as bits per second.
    bits_per_s_at: f64,
    /// How many times smaller the codes, and the whole clips, are that have the PSNR or more.
    ratio: f64,
    ratio_file: f64,
    /// The least of the motions' ratios of codes, and whose it is.
    least_ratio: f64,
    least_clip: String,
    /// Motions that do not have the PSNR with any bits.
    missed: usize,
}

impl Pooled {
    fn of(method: &Method, rows: &[Reached], db: f64) -> Option<Self> {
        let rows: Vec<&Reached> = rows.iter().filter(|row| row.method == method.name).collect();
        let sum = |of: fn(&Reached) -> f64| rows.iter().map(|row| of(row)).sum::<f64>();
        let raw = sum(|row| row.raw_bytes as f64);
        let least = rows.iter().min_by(|a, b| a.ratio.total_cmp(&b.ratio))?;
        Some(Self {
            method: method.name,
            section: method.section,
            ratio_at: raw / sum(|row| row.code_bytes_at),
            bits_per_s_at: 8.0 * sum(|row| row.code_bytes_at) / sum(|row| row.seconds),
            ratio: raw / sum(|row| row.code_bytes as f64),
            ratio_file: raw / sum(|row| row.bytes as f64),
            least_ratio: least.ratio,
            least_clip: least.clip.clone(),
            missed: rows.iter().filter(|row| row.psnr_db < db).count(),
        })
    }
}

/// Brings all methods to a PSNR on all motions and reports what that takes.
pub fn run(motions: &[Named], db: f64, json: bool) -> Result<ExitCode> {
    let methods = Method::all();
    let rows = reach_all(motions, &methods, db)?;
    let mut order: Vec<Pooled> = methods.iter().filter_map(|method| Pooled::of(method, &rows, db)).collect();
    order.sort_by(|a, b| b.bits_per_s_at.total_cmp(&a.bits_per_s_at));
    if json {
        println!("{:#}", serde_json::json!({ "psnr_db": db, "clips": rows, "order": order }));
        return Ok(ExitCode::SUCCESS);
    }
    println!(
        "Each motion at {db} dB or more. Ratios are of 16-bit samples to codes, and to the whole file.\n"
    );
    println!("method                        clip       bits  PSNR dB   bits/s   ratio  of file");
    for row in &rows {
        println!(
            "{:<29} {:<10.10} {:>4} {:>8.2} {:>8.0} {:>7.2} {:>8.2}",
            row.method,
            row.clip,
            row.bits.map_or("-".to_owned(), |bits| bits.to_string()),
            row.psnr_db,
            row.code_bytes as f64 * 8.0 / row.seconds,
            row.ratio,
            row.ratio_file,
        );
    }
    println!("\nAll motions together, the most bits first; bits/s are at exactly {db} dB:\n");
    println!("method                        section   bits/s   ratio  least (whose)");
    for row in &order {
        println!(
            "{:<29} {:<7} {:>8.0} {:>7.2} {:>7.2} ({}){}",
            row.method,
            row.section.unwrap_or("ours"),
            row.bits_per_s_at,
            row.ratio_at,
            row.least_ratio,
            row.least_clip,
            if row.missed > 0 { format!(", {} clips not reached", row.missed) } else { String::new() },
        );
    }
    Ok(ExitCode::SUCCESS)
}
