//! `bunraku info` of a puppet file.

use anyhow::Result;
use puppet_file::Puppet;
use std::path::Path;

/// Prints the puppet's buses and servos, and the channels of the clips that it plays.
pub fn print(file: &Path, json: bool) -> Result<()> {
    let puppet = Puppet::read(file)?;
    let (servos, channels) = (puppet.servos()?, puppet.channels()?);
    let buses = puppet.bus_names();
    let model =
        |index: usize| servos[index].model.map_or_else(|| "unknown".to_owned(), |model| format!("{model:?}"));
    if json {
        let servos: Vec<_> = (servos.iter().zip(channels.names()).enumerate())
            .map(|(index, (servo, channel))| {
                serde_json::json!({
                    "name": servo.name, "id": servo.id, "bus": servo.bus, "model": model(index), "channel": channel,
                })
            })
            .collect();
        let report = serde_json::json!({ "puppet": file, "buses": buses, "servos": servos });
        println!("{report:#}");
        return Ok(());
    }
    println!("{}: puppet of {} servos", file.display(), servos.len());
    println!("  {:<20} {:>4}  {:>3}  channel", "joint", "bus", "id");
    for (servo, channel) in servos.iter().zip(channels.names()) {
        println!("  {:<20} {:>4}  {:>3}  {channel}", servo.name, servo.bus, servo.id);
    }
    Ok(())
}
