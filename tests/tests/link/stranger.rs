//! A client in Python, written from docs/LINK.md alone, in sessions that need a key.

use crate::uploads::{encode, renamed};
use crate::virtual_device::{map, with_device};
use firmware::link::key::HmacKey;
use host_sim::device::{Config, HOSTS, Key};
use mocap::sample;
use serde_json::{Value, json};

const KEY: &[u8] = b"0123456789abcdef0123456789abcdef";

#[test]
fn a_stranger_with_the_key_shares_the_device_with_others() {
    if !bunraku_tests::require_program("python3") {
        return;
    }
    let (clip, other) = (sample::clip(), renamed());
    let map = map("sample.toml", &clip.skeleton);
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let key = write("key", &[KEY, b"\n"].concat());
    let clips = [write("clip.mclip", &encode(&clip)), write("other.mclip", &encode(&other))];
    let lock: &'static HmacKey = Box::leak(Box::new(HmacKey::new(KEY).unwrap()));
    let config = Config { key: Some(Key { lock, seed: 11 }), ..Config::default() };
    with_device(&map, &config, |port| {
        let peer = bunraku_tests::workspace().join("tests/peers/link_session.py");
        let mut python = std::process::Command::new("python3");
        python.arg(peer).arg(port.strip_prefix("tcp:").unwrap()).arg(&key).args(&clips);
        let output = python.output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let mut said: Value = serde_json::from_slice(&output.stdout).unwrap();
        // How busy this computer is, is in it; tests in simulated time have the milliseconds.
        let offs = said.as_object_mut().unwrap().remove("ms off after each sync").unwrap();
        println!("ms off after each sync: {offs}");
        assert!(offs.as_array().unwrap().iter().all(|off| off.as_f64().unwrap().abs() < 400.0), "{offs}");
        // The bytes of the refusals are those of the page's table, with the digests and frames of these clips.
        let names = said.as_object_mut().unwrap().remove("other names").unwrap();
        assert!(names.as_str().unwrap().starts_with("05 0f 09 "), "store, play, names: {names}");
        let expected = json!({
            "wrong key": "09",
            "no session": "00",
            "busy": "05 06",
            "busy to remove": "05 06",
            "frames": 480,
            "channels": 31,
            "names": map.names(),
            "demands": [31, map.names()],
            "nothing plays": "04 0c",
            "no clip": "04 05 09",
            "paused": ["paused", 0, true],
            "beyond": "04 0a e0 03 e0 03",
            "stopped": null,
            "sought": "playing",
            "full": format!("0a {HOSTS:02x}"),
            "stopped by a fifth": "holding",
        });
        assert_eq!(said, expected);
    });
}
