//! What the servos of a puppet on a port are set to, for `check` and `scan`.

use anyhow::{Result, anyhow};
use host_sim::ports::{self, SerialBus};
use host_sim::settings::{self, Fixed, Found, Judged, Mismatch, Settings};
use puppet_file::{Map, Puppet, models};
use serde::Serialize;
use servo_wire::bus::BusError;

/// What was found on a port, and what was set.
#[derive(Serialize)]
pub struct OnPort {
    servos: Vec<Servo>,
    fixed: Vec<Fixed>,
    /// How a servo that is set wrong is set right.
    #[serde(skip)]
    hint: String,
}

/// A servo, and what is amiss of it after anything was set.
#[derive(Serialize)]
struct Servo {
    id: u8,
    joint: String,
    model: Option<String>,
    answers: bool,
    mismatches: Vec<Mismatch>,
    settings: Vec<Setting>,
    #[serde(skip)]
    sentences: Vec<(Judged, String)>,
}

/// How often a servo is set right and looked at again.
const FIXES: usize = 3;

/// A register and its value.
#[derive(Serialize)]
pub struct Setting {
    /// Its name in the manual.
    pub register: &'static str,
    /// Its address.
    pub address: u16,
    /// What it is.
    pub value: i64,
}

/// All registers of a servo, for a report.
pub fn list(settings: &Settings) -> Vec<Setting> {
    let setting = |(register, value): (&settings::Register, i64)| Setting {
        register: register.name,
        address: register.address,
        value,
    };
    settings.each().map(setting).collect()
}

impl OnPort {
    /// Looks at the servos that can be read; `fix`: and sets them right.
    pub fn look(on: &str, puppet: &Puppet, map: &Map, fix: bool, let_go: bool) -> Result<Self> {
        let names = puppet.bus_names();
        let reads = |index: usize| map.buses().get(index).is_some_and(|bus| bus.kind.reads());
        let mut paths = ports::paths(on, &names, reads)?.into_iter();
        let (mut servos, mut fixed) = (Vec::new(), Vec::new());
        for (spec, expected) in map.buses().iter().zip(settings::expected(puppet, Some(map))?) {
            if !spec.kind.reads() {
                continue;
            }
            let Some(path) = paths.next() else { continue };
            let mut bus = SerialBus::open(*spec, &path)?;
            let failed = |error: BusError| anyhow!("{path}: {error}");
            for expected in &expected {
                let looked = settings::survey(&mut bus, spec.kind, expected);
                let mut found = ports::block_on(looked).map_err(failed)?;
                // What could not be read, or does not count in another mode, is found once the first is set right.
                let mut done: Vec<Fixed> = Vec::new();
                for _ in 0..FIXES {
                    let fixable = found.mismatches.iter().any(|mismatch| mismatch.fix.is_some());
                    if !fix || !fixable {
                        break;
                    }
                    let now = ports::block_on(settings::fix(&mut bus, spec.kind, &found, let_go));
                    let now = now.map_err(failed)?;
                    let stuck = now.iter().all(|fixed| !fixed.done);
                    done.retain(|fixed| fixed.done);
                    done.extend(now);
                    let again = settings::survey(&mut bus, spec.kind, expected);
                    found = ports::block_on(again).map_err(failed)?;
                    if stuck {
                        break;
                    }
                }
                fixed.extend(done);
                servos.push(Servo::of(found));
            }
        }
        let hint = format!(
            "to set these right: bunraku puppet check {} --on {on} --fix",
            puppet.source().0.display()
        );
        Ok(Self { servos, fixed, hint })
    }

    /// Whether all servos are there and set as they should be.
    pub fn is_good(&self) -> bool {
        let good = |servo: &Servo| {
            servo.answers && servo.mismatches.iter().all(|mismatch| mismatch.judged == Judged::Noted)
        };
        self.servos.iter().all(good) && self.fixed.iter().all(|fixed| fixed.done)
    }

    /// Says what was found.
    pub fn print(&self) {
        println!();
        self.fixed.iter().for_each(|fixed| println!("{}", fixed.sentence));
        let amiss = |servo: &&Servo| servo.sentences.iter().any(|(judged, _)| *judged > Judged::Noted);
        let wrong = self.servos.iter().filter(amiss).count();
        let silent = self.servos.iter().filter(|servo| !servo.answers).count();
        let good = self.servos.len() - wrong - silent;
        println!("{good} of {} servos on the port are there and set as they should be", self.servos.len());
        for servo in &self.servos {
            if !servo.answers {
                println!("  servo {} (\"{}\") does not answer", servo.id, servo.joint);
            }
            let mut sorted: Vec<_> = servo.sentences.iter().collect();
            sorted.sort_by_key(|(judged, _)| std::cmp::Reverse(*judged));
            for (judged, sentence) in sorted {
                let word = match judged {
                    Judged::Refused => "wrong",
                    Judged::Warned => "doubtful",
                    Judged::Noted => "note",
                };
                println!("  {word}: {sentence}");
            }
        }
        let fixable = |servo: &Servo| servo.mismatches.iter().any(|mismatch| mismatch.fix.is_some());
        if self.fixed.is_empty() && self.servos.iter().any(fixable) {
            println!("{}", self.hint);
        }
    }
}

impl Servo {
    fn of(found: Found) -> Self {
        let named = found.named();
        let sentence = |mismatch: &Mismatch| (mismatch.judged, format!("{named}: {}", mismatch.sentence()));
        let sentences = found.mismatches.iter().map(sentence).collect();
        let settings = found.settings.as_ref();
        Self {
            id: found.expected.id,
            joint: found.expected.name.clone(),
            model: settings.map(|settings| models::name(settings.identity.model)),
            answers: found.answers,
            settings: settings.map(list).unwrap_or_default(),
            mismatches: found.mismatches,
            sentences,
        }
    }
}
