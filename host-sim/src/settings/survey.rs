//! All servos of a puppet, before they are armed.

use super::judge::{Expected, Judged, Mismatch, judge, mute};
use super::read::{Settings, read};
use crate::ports::SerialBus;
use anyhow::{Result, bail};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read, Write};
use firmware::map::BusKind;
use puppet_file::{Map, Puppet};
use servo_wire::bus::BusError;
use std::path::Path;

/// Most servos that a sentence about several names.
const MOST_NAMED: usize = 8;

/// What was found of one servo.
#[derive(Clone, Debug)]
pub struct Found {
    /// What was expected of it.
    pub expected: Expected,
    /// What it is set to; `None` where that could not be read.
    pub settings: Option<Settings>,
    /// Whether it said anything.
    pub answers: bool,
    /// What is not as it should be.
    pub mismatches: Vec<Mismatch>,
}

impl Found {
    /// The servo as a sentence calls it.
    #[must_use]
    pub fn named(&self) -> String {
        named(&self.expected)
    }

    /// A sentence for each mismatch that is at least so bad.
    pub fn sentences(&self, least: Judged) -> impl Iterator<Item = String> {
        let bad = self.mismatches.iter().filter(move |mismatch| mismatch.judged >= least);
        bad.map(|mismatch| format!("{}: {}", self.named(), mismatch.sentence()))
    }
}

/// A servo as a sentence calls it.
pub(super) fn named(expected: &Expected) -> String {
    let Expected { id, name, .. } = expected;
    if name.is_empty() { format!("servo {id}") } else { format!("servo {id} (\"{name}\")") }
}

/// What a puppet expects of its servos, by bus; joints are those of `map`.
///
/// # Errors
/// A sentence where the puppet's servos cannot be told.
pub fn expected(puppet: &Puppet, map: Option<&Map>) -> Result<Vec<Vec<Expected>>> {
    let servos = puppet.servos()?;
    let mut buses = vec![Vec::new(); puppet.bus_names().len()];
    for servo in &servos {
        let joint = map.and_then(|map| {
            map.joints().iter().find(|joint| usize::from(joint.bus) == servo.bus && joint.id == servo.id)
        });
        let others = servos.iter().filter(|other| other.bus == servo.bus && other.id != servo.id);
        let expected = Expected {
            id: servo.id,
            name: servo.name.clone(),
            model: servo.model,
            joint: joint.copied(),
            servo_hz: map.map_or(0.0, |map| f64::from(map.tick_hz())),
            others: others.map(|other| other.id).collect(),
            watchdog_millis: map.map_or(0, |map| map.settings().servo_watchdog_millis),
        };
        buses.get_mut(servo.bus).into_iter().for_each(|bus| bus.push(expected.clone()));
    }
    Ok(buses)
}

/// Reads one servo and judges what it is set to; writes nothing.
///
/// # Errors
/// [`BusError::Port`].
pub async fn survey<S: Read + Write, T: DelayNs>(
    bus: &mut SerialBus<S, T>,
    kind: BusKind,
    expected: &Expected,
) -> Result<Found, BusError> {
    let found =
        |settings, answers, mismatches| Found { expected: expected.clone(), settings, answers, mismatches };
    Ok(match read(bus, kind, expected.id).await {
        Ok(settings) => {
            let mismatches = judge(&settings, expected);
            found(Some(settings), true, mismatches)
        }
        Err(BusError::Port) => return Err(BusError::Port),
        Err(BusError::Unsupported) => found(None, true, vec![mute(kind)]),
        Err(_) => found(None, false, Vec::new()),
    })
}

/// Looks at all servos of a puppet that can be read, before any of them is armed. Says what may make the movement another one, once
/// for each register; `on` is the port as it was given. Silence is left to the player, which waits for servos.
///
/// # Errors
/// A sentence with every setting that makes the movement wrong, and the command that mends them.
pub async fn check_before_arming<S: Read + Write, T: DelayNs>(
    buses: &mut [SerialBus<S, T>],
    map: &Map,
    puppet: &Puppet,
    on: &str,
    say: &mut dyn FnMut(&str),
) -> Result<()> {
    let mut all = Vec::new();
    let expected = expected(puppet, Some(map))?;
    for ((bus, spec), expected) in buses.iter_mut().zip(map.buses()).zip(&expected) {
        if !spec.kind.reads() {
            continue;
        }
        for expected in expected {
            // The player says best what is wrong with a port.
            let Ok(found) = survey(bus, spec.kind, expected).await else { return Ok(()) };
            all.push(found);
        }
    }
    let mends = mends(puppet.source().0, on);
    let refused: Vec<String> = all.iter().flat_map(|found| found.sentences(Judged::Refused)).collect();
    if !refused.is_empty() {
        bail!(
            "nothing was armed, since the servos would not do what they are told.\n  {}\n{mends}",
            refused.join("\n  ")
        );
    }
    let warned = warned(&all);
    warned.iter().for_each(|sentence| say(sentence));
    if !warned.is_empty() {
        say(&mends);
    }
    Ok(())
}

/// The command that sets servos right.
fn mends(puppet: &Path, on: &str) -> String {
    let puppet = puppet.display().to_string();
    let quoted = if puppet.contains(' ') { format!("\"{puppet}\"") } else { puppet };
    format!(
        "`bunraku puppet check {quoted} --on {on}` lists what is set otherwise, and with --fix sets right what can be set"
    )
}

/// A sentence for each register, with the servos that it is wrong of.
fn warned(all: &[Found]) -> Vec<String> {
    let mut sentences: Vec<(&'static str, String, Vec<String>)> = Vec::new();
    for found in all {
        for mismatch in found.mismatches.iter().filter(|mismatch| mismatch.judged == Judged::Warned) {
            match sentences.iter_mut().find(|(register, ..)| *register == mismatch.register) {
                Some((.., others)) => others.push(found.named()),
                None => {
                    let sentence = format!("{}: {}", found.named(), mismatch.sentence());
                    sentences.push((mismatch.register, sentence, Vec::new()));
                }
            }
        }
    }
    let join = |(_, sentence, others): (_, String, Vec<String>)| match others.len() {
        0 => sentence,
        count if count > MOST_NAMED => format!("{sentence}; so of {count} more servos"),
        _ => format!("{sentence}; so of {}", others.join(", ")),
    };
    sentences.into_iter().map(join).collect()
}
