//! What a user does with a puppet on a link, from the first upload to a line that breaks.

use crate::virtual_device::{Cutter, map, with_device};
use bunraku_tests::motion;
use decoder_core::mclip::CodecId;
use encoder::mclip::{Encoder, Encoding, Quality};
use firmware::clips::LIVE;
use firmware::clock::Speed;
use firmware::fault::Fault;
use firmware::link::message::{Refusal, Request, Telemetry};
use firmware::machine::{Command, State};
use host_sim::device::Config;
use host_sim::link::streaming::{self, StreamedClip, stream};
use host_sim::link::upload::{Upload, list, upload, upload_again};
use host_sim::link::{Client, LinkError};
use mocap::{Clip, sample};
use puppet_file::Map;
use std::time::{Duration, Instant};

fn encode(clip: &Clip) -> Vec<u8> {
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
    encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(7)).unwrap()
}

/// Waits until the device says something, at most 20 s.
fn until(client: &mut Client, what: &str, done: impl Fn(&Telemetry) -> bool) -> Telemetry {
    client.request_done(&Request::Telemetry { millis: 20 }).unwrap();
    let start = Instant::now();
    let mut last = None;
    while start.elapsed() < Duration::from_secs(20) {
        let Some(telemetry) = client.telemetry(Duration::from_secs(3)).unwrap() else { continue };
        if done(&telemetry) {
            client.request_done(&Request::Telemetry { millis: 0 }).unwrap();
            return telemetry;
        }
        last = Some(telemetry);
    }
    panic!("it is never {what}: {last:?}");
}

fn plays(clip: u16) -> impl Fn(&Telemetry) -> bool {
    move |told| told.state == State::Playing && told.playing.is_some_and(|playing| playing.clip == clip)
}

fn refusal(result: Result<(), LinkError>) -> Refusal {
    match result {
        Err(LinkError::Refused { refusal, .. }) => refusal,
        other => panic!("{other:?}"),
    }
}

/// Two clips uploaded, and a third one streamed over a line that breaks; `conceals`: it is so long that the device runs out of it.
fn a_session(map: &Map, clips: [&Clip; 3], conceals: bool) {
    let [first, second, third] = clips.map(encode);
    let (hold_millis, lost_millis) = if conceals { (0, 4500) } else { (1500, 60_000) };
    let mut config = Config::default();
    config.stream.lost_millis = lost_millis;
    with_device(map, &config, |port| {
        let mut client = Client::open(port).unwrap();
        assert_eq!(usize::from(client.hello().servos), map.joints().len());
        assert_eq!(client.hello().tick_hz, map.tick_hz());
        until(&mut client, "at rest", |told| told.state == State::Resting);

        for (clip, name, bytes) in [(3, "first", &first), (4, "second", &second)] {
            upload(&mut client, Upload { clip, name, bytes }, &mut |_| ()).unwrap();
        }
        let found = list(&mut client).unwrap();
        let found: Vec<_> =
            found.iter().map(|clip| (clip.clip, clip.name.as_str(), clip.bytes as usize)).collect();
        assert_eq!(found, [(3, "first", first.len()), (4, "second", second.len())]);

        client.command(Command::Play { clip: 3, repeats: true }).unwrap();
        until(&mut client, "played", plays(3));
        client.command(Command::Speed(Speed::new(512))).unwrap();
        until(&mut client, "fast", |told| told.speed == 512);
        client.command(Command::Pause).unwrap();
        let still = until(&mut client, "paused", |told| told.speed == 0).playing.unwrap();
        client.command(Command::Resume).unwrap();
        until(&mut client, "on its way again", |told| told.playing.is_some_and(|now| now != still));
        client.command(Command::Speed(Speed::NORMAL)).unwrap();
        // A clip that is played can be replaced: it goes on.
        upload(&mut client, Upload { clip: 3, name: "new", bytes: &second }, &mut |_| ()).unwrap();
        until(&mut client, "played", plays(3));
        client.command(Command::Play { clip: 4, repeats: false }).unwrap();
        let told = until(&mut client, "the other one", plays(4));
        assert_eq!(told.fault, None);
        assert!(
            told.servos.iter().all(|servo| servo.reading.is_some_and(|reading| reading.torque == Some(true)))
        );
        client.command(Command::Stop).unwrap();
        until(&mut client, "stopped", |told| told.state == State::Holding);
        client.command(Command::Home).unwrap();
        until(&mut client, "at home", |told| told.state == State::Resting);
        assert_eq!(
            refusal(client.request_done(&Request::Remove { clip: 9 })).to_string(),
            "there is no clip 9 in the store"
        );
        client.request_done(&Request::Remove { clip: 3 }).unwrap();
        assert_eq!(list(&mut client).unwrap().len(), 1);

        // A stream whose line breaks: what is missing is made up, until the link counts as lost.
        let cutter = Cutter::start(port, usize::MAX);
        let parts = StreamedClip::new(&third).unwrap();
        let settings = streaming::Settings { hold_millis, patience: Duration::ZERO, plays: true };
        let mut cut = false;
        let failed = stream(cutter.port().into(), &parts, settings, &mut |told| {
            // As soon as nothing more can wait in the device than is soon played.
            if !cut && told.stream.is_some_and(|stream| stream.counters.played > 0) {
                cutter.cut(false);
                cut = true;
            }
        });
        let error = format!("{:#}", failed.unwrap_err());
        assert!(error.contains("is broken"), "{error}");
        if conceals {
            let made = |told: &Telemetry| told.stream.map_or(0, |stream| stream.counters.concealed);
            let told = until(&mut client, "without frames", |told| made(told) > 0 || told.fault.is_some());
            assert_eq!((told.fault, told.state), (None, State::Playing), "first it makes up what is missing");
        }
        let told = until(&mut client, "without a link", |told| told.fault.is_some());
        assert_eq!(told.fault, Some(Fault::LinkLost));
        until(&mut client, "stopped", |told| told.state == State::Holding);
        let play = Command::Play { clip: 4, repeats: false };
        assert_eq!(refusal(client.command(play)), Refusal::Fault(Fault::LinkLost));
        client.command(Command::Stop).unwrap();
        client.command(Command::Acknowledge).unwrap();
        until(&mut client, "well", |told| told.fault.is_none() && told.state == State::Holding);
        client.command(play).unwrap();
        until(&mut client, "played", plays(4));
        assert_eq!(refusal(client.command(Command::LinkLost)), Refusal::Reserved);
        let stream = Upload { clip: LIVE, name: "stream", bytes: &first };
        assert_eq!(refusal(upload(&mut client, stream, &mut |_| ())), Refusal::Reserved);
    });
}

#[test]
fn the_sample_on_a_link() {
    let clip = sample::clip();
    a_session(&map("sample.toml", &clip.skeleton), [&clip; 3], false);
}

#[test]
fn clips_of_cmu_on_a_link() {
    let Some(folder) = motion() else { return };
    let load = |trial: &str| {
        let cmu = folder.join("cmu");
        let subject = trial.split('_').next().unwrap();
        let skeleton = cmu.join(format!("{subject}.asf"));
        mocap::import::load(&cmu.join(format!("{trial}.amc")), Some(&skeleton), Some(120.0)).unwrap()
    };
    let clips = ["02_01", "49_04", "02_07"].map(load);
    a_session(&map("cmu-12.toml", &clips[0].skeleton), [&clips[0], &clips[1], &clips[2]], true);
}

#[test]
fn an_upload_goes_on_over_lines_that_break() {
    let clip = sample::clip();
    let (bytes, map) = (encode(&clip), map("sample.toml", &clip.skeleton));
    with_device(&map, &Config::default(), |port| {
        let cutter = Cutter::start(port, 3000);
        let what = Upload { clip: 1, name: "cut", bytes: &bytes };
        let mut told = Vec::new();
        upload_again(cutter.port().into(), what, Duration::from_secs(10), &mut |bytes| told.push(bytes))
            .unwrap();
        assert!(cutter.cuts() >= bytes.len() / 3000 && cutter.cuts() > 1, "{} cuts", cutter.cuts());
        assert!(told.is_sorted(), "what has arrived is not sent again: {told:?}");
        let mut client = Client::open(port).unwrap();
        let found = list(&mut client).unwrap();
        assert_eq!((found.len(), found[0].crc), (1, firmware::link::frame::crc32([&bytes[..]])));
    });
}

#[test]
fn a_stream_goes_on_over_lines_that_break_for_a_moment() {
    let clip = sample::clip();
    let map = map("sample.toml", &clip.skeleton);
    // Larger than the device's buffer.
    let encoder = Encoder::new(&clip.skeleton, &clip.motion).unwrap();
    let bytes = encoder.encode(&Encoding::new(CodecId::Dpcm), Quality::Bits(12)).unwrap();
    assert!(bytes.len() > 12_000, "{} bytes", bytes.len());
    with_device(&map, &Config::default(), |port| {
        let cutter = Cutter::start(port, usize::MAX);
        let parts = StreamedClip::new(&bytes).unwrap();
        let settings =
            streaming::Settings { hold_millis: 3000, patience: Duration::from_secs(5), plays: true };
        let mut cuts = 0;
        let report = stream(cutter.port().into(), &parts, settings, &mut |told| {
            let frame =
                told.playing.filter(|playing| playing.clip == LIVE).map_or(0, |playing| playing.frame);
            if frame > 100 * (cuts + 1) && cuts < 3 {
                cuts += 1;
                cutter.cut(true);
            }
        });
        let report = report.unwrap();
        assert_eq!((report.breaks, cuts), (3, 3));
        let stream = report.last.unwrap().stream.unwrap();
        assert_eq!((stream.counters.concealed, stream.counters.lost, stream.counters.played), (0, 0, 480));
    });
}

/// A clip of other channels is no clip for this puppet, and that it was refused no fault.
#[test]
fn a_stream_that_is_refused_leaves_nothing_behind() {
    let clip = sample::clip();
    let map = map("sample.toml", &clip.skeleton);
    let kept = [clip.skeleton.channel("head.ry").unwrap()];
    let other =
        Clip { skeleton: clip.skeleton.with_channels(&kept), motion: clip.motion.with_channels(&kept) };
    let bytes = encode(&other);
    with_device(&map, &Config::default(), |port| {
        let parts = StreamedClip::new(&bytes).unwrap();
        let hold_millis = 300;
        let settings = streaming::Settings { hold_millis, patience: Duration::ZERO, plays: true };
        let error = stream(port.into(), &parts, settings, &mut |_| {}).unwrap_err();
        assert!(format!("{error:#}").contains("the clip has 1 channels, expected 31"), "{error:#}");
        std::thread::sleep(Duration::from_millis(u64::from(hold_millis) * 2));
        let mut client = Client::open(port).unwrap();
        assert_eq!(until(&mut client, "heard", |_| true).fault, None);
    });
}

#[test]
fn several_hosts_at_once() {
    let clip = sample::clip();
    let map = map("sample.toml", &clip.skeleton);
    with_device(&map, &Config::default(), |port| {
        let mut hosts: Vec<Client> = (0..3).map(|_| Client::open(port).unwrap()).collect();
        for host in &mut hosts {
            until(host, "heard", |_| true);
            host.command(Command::Home).unwrap();
        }
        // One that has to be there, and is gone.
        hosts[0].request_done(&Request::Hold { millis: 100 }).unwrap();
        drop(hosts.remove(0));
        let told = until(&mut hosts[0], "without a link", |told| told.fault.is_some());
        assert_eq!(told.fault, Some(Fault::LinkLost));
    });
}

#[cfg(unix)]
#[test]
fn a_pseudo_terminal_is_a_serial_port() {
    use host_sim::device::{Listener, run_device};
    use std::sync::atomic::{AtomicBool, Ordering};
    use virtual_servos::serve::Pty;
    let clip = sample::clip();
    let map = map("sample.toml", &clip.skeleton);
    let listener = Listener::Pty(Box::new(Pty::open().unwrap()));
    let (port, ended) = (listener.name().unwrap(), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let device =
            scope.spawn(|| run_device(&map, &Config::default(), listener, &|| ended.load(Ordering::Relaxed)));
        let bytes = encode(&clip);
        let uploaded = (0..2).try_for_each(|clip| {
            let mut client = Client::open(port.as_str())?;
            upload(&mut client, Upload { clip, name: "serial", bytes: &bytes }, &mut |_| ())
        });
        ended.store(true, Ordering::Relaxed);
        device.join().unwrap().unwrap();
        uploaded.unwrap();
    });
}

/// A client in Python, written from docs/LINK.md, which sends each frame twice.
#[test]
fn a_stranger_uploads_and_plays() {
    if !bunraku_tests::require_program("python3") {
        return;
    }
    let clip = sample::clip();
    let map = map("sample.toml", &clip.skeleton);
    let folder = tempfile::tempdir().unwrap();
    let (path, bytes) = (folder.path().join("sample.mclip"), encode(&clip));
    std::fs::write(&path, &bytes).unwrap();
    with_device(&map, &Config::default(), |port| {
        let peer = bunraku_tests::workspace().join("tests/peers/link.py");
        let mut python = std::process::Command::new("python3");
        python.arg(peer).arg(port.strip_prefix("tcp:").unwrap()).arg(path);
        let output = python.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(said["device"]["servos"], map.joints().len());
        assert_eq!(said["clips"][0]["crc"], firmware::link::frame::crc32([&bytes[..]]));
        assert_eq!(said["clips"].as_array().unwrap().len(), 1);
        assert!(said["frames"].as_u64().unwrap() >= 100, "{said}");
        let last = &said["last"];
        assert!(last["repeated"].as_u64().unwrap() > 0, "{last}");
        for (servo, joint) in last["servos"].as_array().unwrap().iter().zip(map.joints()) {
            assert_eq!(servo["id"], joint.id);
            let goal = servo["goal"].as_i64().unwrap() as i32;
            assert!((joint.min..=joint.max).contains(&goal), "{servo}");
            assert_eq!(servo["reading"]["millivolts"], 12_000);
        }
    });
}
