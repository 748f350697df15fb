//! A show with crossfades, a trigger, a live stream with gaps, and servos that restart, fall silent and are cut off: the same on
//! the host, on the simulated core and under QEMU.
#![allow(clippy::unwrap_used)]

use bunraku_tests::{bunraku, motion, require_program, require_target, workspace};
use encoder::mclip::{Encoder, Encoding, Quality};
use host_sim::show::{self, Program, Summary};
use mocap::{Motion, sample};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

const EVENTS: &str = "
[[event]]
at = 2.0
what = 'restart'
servo = 3

[[event]]
at = 2.6
what = 'acknowledge'

[[event]]
at = 4.9
what = 'silence'
servo = 5
seconds = 0.2

[[event]]
at = 5.4
what = 'acknowledge'

[[event]]
at = 6.4
what = 'cut'
seconds = 0.15

[[event]]
at = 7.0
what = 'acknowledge'

[[event]]
at = 8.0
what = 'stream'
clip = 'live'

[[event]]
at = 11.2
what = 'gap'
seconds = 0.3

[[event]]
at = 13.0
what = 'gap'
seconds = 0.9

[[event]]
at = 14.0
what = 'acknowledge'

[[event]]
at = 14.6
what = 'trigger'
";

/// Writes a show of two clips, and one to be streamed, in `folder`; clips that are there stay.
fn write_show(folder: &Path, events: &str) -> PathBuf {
    let clip = sample::clip();
    fs::write(folder.join("sample.asf"), sample::asf()).unwrap();
    fs::copy(workspace().join("puppets/sample.toml"), folder.join("sample.toml")).unwrap();
    let channels = clip.motion.channels;
    let part = |from: usize, to: usize| Motion {
        samples: clip.motion.samples[from * channels..to * channels].to_vec(),
        ..clip.motion.clone()
    };
    for (name, motion, codec) in [
        ("one.mclip", part(0, 100), decoder_core::mclip::CodecId::Dpcm),
        ("two.mclip", part(200, 300), decoder_core::mclip::CodecId::Pcm),
        ("live.mclip", part(100, 480), decoder_core::mclip::CodecId::Dpcm),
    ] {
        if folder.join(name).exists() {
            continue;
        }
        let encoder = Encoder::new(&clip.skeleton, &motion).unwrap();
        // Ten entry points a second, for what is streamed.
        let encoding = Encoding { entry_frames: 6, block_bytes: 400, ..Encoding::new(codec) };
        fs::write(folder.join(name), encoder.encode(&encoding, Quality::Bits(8)).unwrap()).unwrap();
    }
    let show = folder.join("show.toml");
    let text = format!(
        "puppet = 'sample.toml'\nskeleton = 'sample.asf'\nplaylist = ['one', 'two', 'one']\ntrigger = 'two'\n\
         [[clip]]\nname = 'one'\nfile = 'one.mclip'\n[[clip]]\nname = 'two'\nfile = 'two.mclip'\n[[clip]]\nname = 'live'\nfile = 'live.mclip'\n{events}"
    );
    fs::write(&show, text).unwrap();
    show
}

/// The report and the log of a run.
fn run(show: &Path, on: &str) -> (Value, String) {
    let (log, page) = (show.with_extension("csv"), show.with_extension("html"));
    let mut command = bunraku();
    command.arg("show").arg(show).args(["--on", on, "--json", "--log"]).arg(&log).arg("--html").arg(&page);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{on}: {}", String::from_utf8_lossy(&output.stderr));
    let page = fs::read_to_string(&page).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    assert!(!page.contains("NaN") && !page.contains("inf\""), "{on}: the page has numbers that are none");
    assert!(!page.contains("src=") && !page.contains("href="), "{on}: the page needs something else");
    (serde_json::from_slice(&output.stdout).unwrap(), fs::read_to_string(&log).unwrap())
}

fn check(report: &Value, faults: usize) {
    let summary = &report["summary"];
    assert_eq!((&summary["ends"], &summary["fault"]), (&"Resting".into(), &Value::Null), "{summary}");
    assert_eq!(summary["outside_limits"], 0, "{summary}");
    let found = summary["faults"].as_array().unwrap();
    assert_eq!(found.len(), faults, "{found:?}");
    for fault in found {
        assert!(fault["settled_ms"].as_f64().is_some_and(|ms| ms <= 100.0), "{fault}");
        assert_eq!(fault["state"], "Holding", "{fault}");
    }
}

fn on_boards(show: &Path, here: &(Value, String), left_us_least: f64) {
    if !(require_target("thumbv7em-none-eabi") && require_program("qemu-system-arm")) {
        return;
    }
    for on in ["sim", "qemu"] {
        let (report, log) = run(show, on);
        assert!(log == here.1, "the goals on {on} differ");
        let states = |report: &Value| {
            let notes = report["notes"].as_array().unwrap().iter();
            notes
                .filter(|note| note["what"] == "state" || note["what"] == "stream")
                .map(Value::to_string)
                .collect::<Vec<_>>()
        };
        assert_eq!(states(&report), states(&here.0), "{on}");
        check(&report, here.0["summary"]["faults"].as_array().unwrap().len());
        assert_eq!(report["summary"]["streams"], here.0["summary"]["streams"], "{on}");
        if on == "sim" {
            // Apart from ticks in which servos are waited for or set up, one by one.
            let cost = &report["summary"]["cost"];
            let (overrun, ticks) =
                (cost["overrun"].as_u64().unwrap(), report["summary"]["ticks"].as_u64().unwrap());
            assert!(
                overrun * 20 < ticks && cost["left_us_median"].as_f64().unwrap() > left_us_least,
                "{cost}"
            );
        }
    }
}

#[test]
fn a_disturbed_show_comes_to_its_end_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let show = write_show(folder.path(), EVENTS);
    let here = run(&show, "host");
    check(&here.0, 4);
    streamed(&here.0);
    on_boards(&show, &here, 5_000.0);
}

/// The stream of a show: the short gap was bridged, and the long one, of which the second part is silence, is the last fault.
fn streamed(report: &Value) {
    let summary = &report["summary"];
    let [stream] = &summary["streams"].as_array().unwrap()[..] else { panic!("{}", summary["streams"]) };
    let count = |name: &str| stream[name].as_u64().unwrap();
    // Whole blocks of a tenth of a second are lost, and each gap is eased back from.
    assert!((12..=36).contains(&count("concealed")) && count("eased") >= 5, "{stream}");
    assert!(count("played") > 100 && count("lost") <= count("concealed"), "{stream}");
    let last = summary["faults"].as_array().unwrap().last().unwrap();
    assert_eq!(last["fault"], "LinkLost", "{last}");
    let acknowledged = last["acknowledged_at"].as_f64().unwrap();
    let again = report["notes"].as_array().unwrap().iter().any(|note| {
        let at = note["tick"].as_f64().unwrap() / 50.0;
        note["what"] == "state" && note["text"] == "Playing" && at > acknowledged
    });
    assert!(again, "nothing plays after the fault");
}

/// A show of one short clip on three servos; acknowledged, should there be a fault.
fn write_short_show(folder: &Path) -> PathBuf {
    let show = write_show(folder, "[[event]]\nat = 2.4\nwhat = 'acknowledge'\n");
    let text = fs::read_to_string(&show).unwrap().replace("['one', 'two', 'one']", "['two']");
    fs::write(&show, text).unwrap();
    let puppet = fs::read_to_string(folder.join("sample.toml")).unwrap();
    let three = puppet.splitn(5, "[[joint]]").take(4).collect::<Vec<_>>().join("[[joint]]");
    fs::write(folder.join("sample.toml"), format!("ease_seconds = 0.3\nease_speed = 1.0\n{three}")).unwrap();
    show
}

/// What gets through of a packet with a fault.
fn struck(fault: usize, from_servo: bool, packet: &[u8]) -> Vec<u8> {
    let mut changed = packet.to_vec();
    let len = packet.len();
    match fault {
        0 => changed.clear(),
        1 => changed.extend(packet),
        2 => changed.truncate(len / 2),
        3 => changed[len / 3] ^= 0x10,
        4 => changed[len - 1] ^= 0x80,
        5 => changed[4] = 77,
        6 => changed[5] ^= 0x0f,
        7 => {
            changed.splice(0..0, [0xff, 0xff, 0xfd, 0x00, 0x01, 0x30, 0xff, 0x55]);
        }
        8 => changed.fill(0),
        // A servo refuses.
        _ if from_servo && packet[4] != 0xfe => {
            let mut buffer = [0; 32];
            let instruction = servo_wire::dynamixel::Instruction::Status;
            let mut writer =
                servo_wire::dynamixel::PacketWriter::new(&mut buffer, packet[4], instruction).unwrap();
            writer.push(&[7]).unwrap();
            changed = writer.finish().unwrap().to_vec();
        }
        _ => {
            changed.remove(len / 2);
        }
    }
    changed
}

/// What the board tells servos, beside what it may.
struct Told<'p> {
    program: &'p Program,
    /// Sync Writes so far, and for each servo the goal that it got last, with the Sync Write.
    ticks: u32,
    last: Vec<Option<(u32, i32)>>,
    wrong: Option<String>,
}

impl<'p> Told<'p> {
    fn new(program: &'p Program) -> Self {
        Self { program, ticks: 0, last: vec![None; program.map.joints().len()], wrong: None }
    }

    fn see(&mut self, packet: &[u8], gets_through: bool) {
        // A Sync Write of goal positions: address 116, 4 bytes each.
        if packet.get(7..12) != Some(&[0x83, 116, 0, 4, 0]) {
            return;
        }
        self.ticks += 1;
        for value in packet[12..packet.len() - 2].chunks_exact(5) {
            let goal = i32::from_le_bytes([value[1], value[2], value[3], value[4]]);
            let index = self.program.map.joints().iter().position(|joint| joint.id == value[0]).unwrap();
            let joint = self.program.map.joints()[index];
            let step = f64::from(joint.max_velocity) / 1024.0;
            let far = self.last[index].is_some_and(|(tick, last)| {
                f64::from((goal - last).abs()) > step * f64::from(self.ticks - tick) + 1.0
            });
            if far || !(joint.min..=joint.max).contains(&goal) {
                self.wrong
                    .get_or_insert(format!("servo {} gets {goal} after {:?}", value[0], self.last[index]));
            }
            if gets_through {
                self.last[index] = Some((self.ticks, goal));
            }
        }
    }
}

#[test]
fn the_board_bears_a_fault_at_any_packet() {
    if !require_target("thumbv7em-none-eabi") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let program = Program::read(&write_short_show(folder.path())).unwrap();
    let image = show::image(&program).unwrap();
    let mut count = 0;
    let clean = show::on_sim_wire(
        &image,
        &program,
        &mut |at, _, packet| {
            count = at + 1;
            packet.to_vec()
        },
        &mut |_| {},
    );
    let clean = Summary::new(&program, &clean.unwrap(), "sim");
    assert_eq!((clean.ends.as_str(), clean.faults.len(), clean.outside_limits), ("Resting", 0, 0));
    let (mut cases, mut latched) = (0, 0);
    // Alone, and for so long that it is a fault.
    let all = std::env::var_os("BUNRAKU_ALL_FAULTS").is_some();
    for (many, step) in if all { [(1, 7), (40, 5)] } else { [(1, 2), (40, 1)] } {
        for fault in 0..10 {
            for part in 0..step {
                let first = (fault + 10 * part) * count / (10 * step);
                let mut told = Told::new(&program);
                let mut wire = |at: usize, from_servo: bool, packet: &[u8]| {
                    let through = match (first..first + many).contains(&at) {
                        true => struck(fault, from_servo, packet),
                        false => packet.to_vec(),
                    };
                    told.see(packet, through == packet);
                    through
                };
                let context = || format!("fault {fault} at {many} packets from {first} on");
                let ran = show::on_sim_wire(&image, &program, &mut wire, &mut |_| {});
                let ran = ran.unwrap_or_else(|error| panic!("{}: {error:#}", context()));
                let summary = Summary::new(&program, &ran, "sim");
                assert_eq!(told.wrong, None, "{}", context());
                // While servos are found and turned on, one by one, nothing moves.
                let mut moving = summary.faults.iter().filter(|fault| !fault.while_starting);
                let late = moving.find(|fault| fault.settled_ms.is_none_or(|ms| ms > 100.0));
                // What happens after the one acknowledgement stays latched.
                let ends = ["Resting", "Holding"].contains(&summary.ends.as_str());
                assert!(late.is_none() && ends, "{}: {:?}, ends {}", context(), summary.faults, summary.ends);
                (cases, latched) = (cases + 1, latched + usize::from(!summary.faults.is_empty()));
            }
        }
    }
    println!("{cases} cases on the simulated board at {count} packets, of which {latched} latched a fault");
    assert!(cases >= 30 && latched > 5);
}

/// The show in puppets/show.toml, with three trials of different people. Its runs on boards take minutes: they are made where
/// `BUNRAKU_SHOWS` is set.
#[test]
fn three_trials_come_to_their_end() {
    let Some(motion) = motion() else { return };
    let folder = tempfile::tempdir().unwrap();
    let live = ["--entry", "12", "--block", "400"];
    for (trial, subject, name, more) in [
        ("02_01", "02", "walk", &[][..]),
        ("05_03", "05", "dance", &[]),
        ("49_04", "49", "leap", &[]),
        ("05_02", "05", "live", &live),
    ] {
        let mut encode = bunraku();
        encode.arg("encode").arg(motion.join(format!("cmu/{trial}.amc"))).arg("--skeleton");
        encode
            .arg(motion.join(format!("cmu/{subject}.asf")))
            .args(["--codec", "dpcm", "--bits", "8"])
            .args(more)
            .arg("-o");
        assert!(encode.arg(folder.path().join(name).with_extension("mclip")).status().unwrap().success());
    }
    fs::copy(motion.join("cmu/02.asf"), folder.path().join("02.asf")).unwrap();
    for name in ["show.toml", "cmu-20.toml"] {
        fs::copy(workspace().join("puppets").join(name), folder.path().join(name)).unwrap();
    }
    let show = folder.path().join("show.toml");
    let here = run(&show, "host");
    check(&here.0, 4);
    let servos = here.0["summary"]["servos"].as_array().unwrap();
    assert_eq!(servos.len(), 20);
    if std::env::var_os("BUNRAKU_SHOWS").is_some() {
        on_boards(&show, &here, 500.0);
    }
}

#[test]
fn a_wrong_show_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |events: &str, expected: &str| {
        let show = write_show(folder.path(), events);
        let output = bunraku().arg("show").arg(&show).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), said.lines().count()), (Some(1), 1), "{said}");
        assert!(said.contains(expected), "{expected:?} is not in {said:?}");
    };
    refused("[[event]]\nat = 1\nwhat = 'dance'\n", "unknown variant `dance`");
    refused("[[event]]\nwhat = 'home'\n", "expected `at`, in seconds");
    refused("[[event]]\nat = 1\nwhat = 'restart'\nservo = 99\n", "the puppet has no servo 99");
    refused("[[event]]\nat = 1\nwhat = 'play'\nclip = 'three'\n", "there is no [[clip]] \"three\"");
    refused("[[event]]\nat = 1\nwhat = 'speed'\nfactor = 9.0\n", "the speed is 9, expected 0.25 to 4");
    refused("[[clip]]\nname = 'one'\nfile = 'two.mclip'\n", "two clips have the name \"one\"");
    refused("[[clip]]\nname = 'x'\nfile = 'none.mclip'\n", "none.mclip");
    refused("[[event]]\nat = 1\nwhat = 'gap'\nseconds = -1\n", "the gap is -1 s, expected 0 to 60");
    refused("tempo = 3\n", "unknown field `tempo`");
}
