//! Moves as JSON: what the Blender Servo Animation add-on exports, and what robots' own programs record.
//!
//! **Blender Servo Animation** (`"description": "Blender Servo Animation Positions"`, add-on by T. Hendriks): `fps`, and either
//! `servos`, an object of `{"name", "positions"}` by servo id, or (older versions) `positions`, a list with one object a
//! frame of positions by servo id. A position is what the servo is told, in units of the bus: it becomes the channel
//! `NAME.tx`, one centimetre for each unit, since a number of units that jumps is no turn. What
//! [`export::servo_json`](crate::export::servo_json) writes for a rotation has `"unit": "degrees"`, and becomes `NAME.rx`.
//!
//! **Recorded moves**, in one of two shapes:
//! - an object with a list of times, and beside it lists as long, of numbers, lists or objects:
//!   `{"time": [0, 0.01], "head_yaw": [0.1, 0.2]}`, `{"time": […], "set_target_data": [{"head": 4 × 4, "antennas": [0, 1]}, …]}`;
//! - a list of objects, each with its time: `[{"t": 0, "joints": {"neck": 0.1}}, …]`.
//!
//! Names inside each other are joined by points, places in a list are numbers from 0. A 4 × 4 matrix is a pose: three
//! rotations and three translations, in metres. Truth values and texts are left out. Times are in seconds. Angles are in
//! degrees if a value is beyond 2π in size, else in radians, which is told; a name that ends in `_deg` or `_rad` says it, or
//! the caller.

use std::f64::consts::TAU;

use serde_json::{Map, Value};

use super::csv::TIME;
use super::error::ImportError;
use super::imported::Imported;
use super::options::Options;
use super::text::{self, quote};
use super::timed::Timed;
use super::values::{self, GOAL, Values, is_open, split};
use crate::angles;
use crate::skeleton::Dof;

/// Parses a move: `file` is its name for messages.
///
/// # Errors
/// Names the line of what is no JSON, or says what was found and expected.
pub fn parse(bytes: &[u8], file: &str, options: &Options) -> Result<Imported, ImportError> {
    text::check(bytes, file, "a JSON file")?;
    let value: Value = serde_json::from_slice(bytes).map_err(|error| ImportError::Line {
        file: file.to_string(),
        line: error.line(),
        found: format!("no JSON ({error})"),
        expected: "JSON".to_string(),
    })?;
    let wrong =
        |(found, expected): (String, String)| ImportError::File { file: file.to_string(), found, expected };
    match &value {
        Value::Object(object) if object.contains_key("servos") || is_list_of_frames(object) => {
            let (columns, samples) = servo_animation(object, options.values).map_err(wrong)?;
            let own = object.get("fps").and_then(Value::as_f64).filter(|fps| *fps > 0.0);
            let mut notes = Vec::new();
            // What we wrote ourselves says its units.
            let says = |servo: &Value| servo.get("unit").is_some();
            let ours = object
                .get("servos")
                .and_then(Value::as_object)
                .is_some_and(|servos| servos.values().any(says));
            let has_goals = options.values == Some(Values::Goals);
            let counted = if ours || has_goals { 0 } else { columns.len() };
            if counted > 0 {
                notes.push(format!(
                    "{counted} channels are positions of servos: a joint that follows one has `scale = 1` and `zero = 0`"
                ));
            }
            Timed { columns, times: None, samples }.into_clip(
                file,
                &Options { fps: options.fps.or(own), ..options.clone() },
                notes,
            )
        }
        Value::Object(object) => {
            let (times, frames) = by_columns(object).map_err(wrong)?;
            recorded(file, times, &frames, options)
        }
        Value::Array(list) => {
            let (times, frames) = by_frames(list).map_err(wrong)?;
            recorded(file, times, &frames, options)
        }
        _ => Err(wrong(("a single value".to_string(), EXPECTED.to_string()))),
    }
}

const EXPECTED: &str =
    "a list of times with lists of values beside it, or a list of objects with a time each";

type Wrong = (String, String);

fn is_list_of_frames(object: &Map<String, Value>) -> bool {
    object.contains_key("fps") && object.get("positions").is_some_and(Value::is_array)
}

/// Columns and row-major values.
fn servo_animation(
    object: &Map<String, Value>,
    values: Option<Values>,
) -> Result<(Vec<String>, Vec<f64>), Wrong> {
    let expected = || "a number for each servo in each frame".to_string();
    let number =
        |value: &Value| value.as_f64().ok_or_else(|| (quote(value.to_string().as_bytes()), expected()));
    let unit = if values == Some(Values::Goals) { GOAL } else { Dof::Tx.name() };
    let mut columns: Vec<(String, Vec<f64>)> = Vec::new();
    if let Some(Value::Object(servos)) = object.get("servos") {
        let mut servos: Vec<(&String, &Value)> = servos.iter().collect();
        servos.sort_by_key(|(id, _)| id.parse::<u64>().unwrap_or(u64::MAX));
        for (id, servo) in servos {
            let name = servo.get("name").and_then(Value::as_str).unwrap_or(id);
            let degrees = servo.get("unit").and_then(Value::as_str) == Some("degrees");
            let positions = servo.get("positions").and_then(Value::as_array);
            let positions = positions.ok_or_else(|| (format!("servo {id} without positions"), expected()))?;
            let positions = positions.iter().map(number).collect::<Result<_, _>>()?;
            // What we write has the channel's own name.
            let name = if split(name).is_some() {
                name.to_string()
            } else {
                format!("{name}.{}", if degrees { Dof::Rx.name() } else { unit })
            };
            columns.push((name, positions));
        }
    } else {
        let frames = object.get("positions").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        for frame in frames {
            let Value::Object(frame) = frame else {
                return Err((quote(frame.to_string().as_bytes()), expected()));
            };
            for (id, value) in frame {
                let name = format!("{id}.{unit}");
                match columns.iter_mut().find(|(other, _)| *other == name) {
                    Some((_, positions)) => positions.push(number(value)?),
                    None => columns.push((name, vec![number(value)?])),
                }
            }
        }
    }
    let frames = columns.first().map_or(0, |(_, positions)| positions.len());
    if let Some((name, positions)) = columns.iter().find(|(_, positions)| positions.len() != frames) {
        return Err((
            format!("{} positions of {name}, and {frames} of another servo", positions.len()),
            expected(),
        ));
    }
    let samples = (0..frames).flat_map(|frame| columns.iter().map(move |(_, positions)| positions[frame]));
    let samples = samples.collect();
    Ok((columns.into_iter().map(|(name, _)| name).collect(), samples))
}

fn is_time(name: &str) -> bool {
    TIME.iter().any(|time| name.eq_ignore_ascii_case(time))
}

/// Times, and for each the values by name.
type Frames = (Vec<f64>, Vec<Vec<(String, f64)>>);

fn by_columns(object: &Map<String, Value>) -> Result<Frames, Wrong> {
    let time = object.iter().find_map(|(name, value)| if is_time(name) { value.as_array() } else { None });
    let Some(time) = time else {
        return Err(("an object without a list of times".to_string(), EXPECTED.to_string()));
    };
    let times: Option<Vec<f64>> = time.iter().map(Value::as_f64).collect();
    let times = times.ok_or_else(|| ("a time that is no number".to_string(), "seconds".to_string()))?;
    let mut frames = vec![Vec::new(); times.len()];
    let mut pending: Vec<(String, &Value)> =
        object.iter().rev().map(|(name, value)| (name.clone(), value)).collect();
    while let Some((name, value)) = pending.pop() {
        match value {
            Value::Array(list) if list.len() == times.len() && !is_time(&name) => {
                for (frame, value) in frames.iter_mut().zip(list) {
                    flatten(&name, value, frame);
                }
            }
            Value::Object(inner) => {
                pending.extend(inner.iter().rev().map(|(below, value)| (format!("{name}.{below}"), value)));
            }
            _ => {}
        }
    }
    Ok((times, frames))
}

fn by_frames(list: &[Value]) -> Result<Frames, Wrong> {
    let (mut times, mut frames) = (Vec::new(), Vec::new());
    for (index, frame) in list.iter().enumerate() {
        let wrong = |found: &str| (format!("{found} in place {index} of the list"), EXPECTED.to_string());
        let Value::Object(frame) = frame else { return Err(wrong("no object")) };
        let time = frame.iter().find(|(name, _)| is_time(name)).and_then(|(_, time)| time.as_f64());
        times.push(time.ok_or_else(|| wrong("no time"))?);
        let mut values = Vec::new();
        for (name, value) in frame.iter().filter(|(name, _)| !is_time(name)) {
            flatten(name, value, &mut values);
        }
        frames.push(values);
    }
    Ok((times, frames))
}

/// The numbers in `value` with their names. Depth is bounded by that of the JSON reader.
fn flatten(name: &str, value: &Value, out: &mut Vec<(String, f64)>) {
    match value {
        Value::Number(number) => out.extend(number.as_f64().map(|value| (name.to_string(), value))),
        Value::Object(inner) => {
            inner.iter().for_each(|(below, value)| flatten(&format!("{name}.{below}"), value, out));
        }
        Value::Array(list) => match matrix(list) {
            Some((rotation, translation)) => {
                let [z, y, x] = angles::euler_zyx(&rotation);
                for (dof, degrees) in [("rz", z), ("ry", y), ("rx", x)] {
                    out.push((format!("{name}.{dof}"), degrees));
                }
                for (dof, metres) in ["tx", "ty", "tz"].into_iter().zip(translation) {
                    out.push((format!("{name}.{dof}"), 100.0 * metres));
                }
            }
            None => {
                let places = list.iter().enumerate();
                places.for_each(|(place, value)| flatten(&format!("{name}.{place}"), value, out));
            }
        },
        Value::Null | Value::Bool(_) | Value::String(_) => {}
    }
}

/// Rotation and translation of a 4 × 4 matrix in rows.
fn matrix(list: &[Value]) -> Option<(angles::Matrix, [f64; 3])> {
    let row = |row: &Value| -> Option<[f64; 4]> {
        let row: Option<Vec<f64>> = row.as_array()?.iter().map(Value::as_f64).collect();
        row?.try_into().ok()
    };
    let rows: Option<Vec<[f64; 4]>> = list.iter().map(row).collect();
    let rows: [[f64; 4]; 4] = rows?.try_into().ok()?;
    (rows[3] == [0.0, 0.0, 0.0, 1.0]).then(|| {
        let part = |k: usize| [rows[k][0], rows[k][1], rows[k][2]];
        ([part(0), part(1), part(2)], [rows[0][3], rows[1][3], rows[2][3]])
    })
}

fn recorded(
    file: &str,
    times: Vec<f64>,
    frames: &[Vec<(String, f64)>],
    options: &Options,
) -> Result<Imported, ImportError> {
    let mut columns: Vec<String> =
        frames.first().map_or_else(Vec::new, |frame| frame.iter().map(|(name, _)| name.clone()).collect());
    for (index, frame) in frames.iter().enumerate() {
        if !frame.iter().map(|(name, _)| name).eq(&columns) {
            return Err(ImportError::File {
                file: file.to_string(),
                found: format!("other values in frame {index} than in frame 0"),
                expected: "the same in each".to_string(),
            });
        }
    }
    let mut samples: Vec<f64> = frames.iter().flatten().map(|(_, value)| *value).collect();
    let width = columns.len().max(1);
    let open = samples.iter().enumerate().filter(|(index, _)| is_open(&columns[index % width]));
    let largest = open.map(|(_, value)| value.abs()).fold(0.0, f64::max);
    let guess = if largest <= TAU { Values::Radians } else { Values::Degrees };
    let mut notes = Vec::new();
    let count = columns.iter().filter(|name| is_open(name)).count();
    if count > 0 && options.values.is_none() {
        let unit = if guess == Values::Radians { "radians" } else { "degrees" };
        notes.push(format!(
            "{count} values taken as {unit}: the greatest is {largest:.2} (else give --values)"
        ));
    }
    values::apply(&mut columns, &mut samples, options.values.unwrap_or(guess));
    Timed { columns, times: Some(times), samples }.into_clip(file, options, notes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(read: &Imported) -> Vec<&str> {
        read.clip.skeleton.channels.iter().map(|channel| channel.name.as_str()).collect()
    }

    #[test]
    fn servo_animations_of_both_versions() {
        let new = r#"{"description": "Blender Servo Animation Positions", "fps": 24, "frames": 3, "seconds": 0, "bones": 2,
            "armature": "A", "file": "a.blend", "scene": "S", "servos": {
            "0": {"name": "Bone", "positions": [375, 1400, 377]}, "3": {"name": "Bone.001", "positions": [1, 2, 3]}}}"#;
        let read = parse(new.as_bytes(), "x.json", &Options::default()).expect("an animation");
        assert_eq!(names(&read), ["Bone.tx", "Bone.001.tx"]);
        assert_eq!(
            (read.clip.motion.fps, &read.clip.motion.samples[..4]),
            (24.0, &[375.0, 1.0, 1400.0, 2.0][..])
        );
        assert_eq!(read.notes.len(), 1);
        let old = r#"{"description": "Blender Servo Animation Positions", "fps": 30, "positions": [{"0": 1472, "1": 5}, {"0": 1477, "1": 6}]}"#;
        let read = parse(old.as_bytes(), "x.json", &Options::default()).expect("an animation");
        assert_eq!(
            (names(&read), &*read.clip.motion.samples),
            (vec!["0.tx", "1.tx"], &[1472.0, 5.0, 1477.0, 6.0][..])
        );
    }

    #[test]
    fn recorded_moves_of_both_shapes() {
        let text = r#"{"description": "nod", "time": [0, 0.02, 0.05], "set_target_data": [
            {"head": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "antennas": [0, 1.5], "check_collision": false},
            {"head": [[0,-1,0,0],[1,0,0,0.01],[0,0,1,0],[0,0,0,1]], "antennas": [0, 1.5], "check_collision": false},
            {"head": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "antennas": [0, 1.5], "check_collision": true}]}"#;
        let read =
            parse(text.as_bytes(), "x.json", &Options { sampled_fps: Some(50.0), ..Options::default() })
                .expect("a move");
        let expected = ["rz", "ry", "rx", "tx", "ty", "tz"].map(|dof| format!("set_target_data.head.{dof}"));
        let mut found = names(&read);
        found.sort_unstable();
        assert!(expected.iter().all(|name| found.contains(&name.as_str())), "{found:?}");
        let channel = |name: &str| read.clip.skeleton.channel(name).expect(name);
        let row = read.clip.motion.frame(1);
        assert!((row[channel("set_target_data.head.rz")] - 90.0).abs() < 1e-9);
        assert!((row[channel("set_target_data.head.ty")] - 1.0).abs() < 1e-9);
        assert!((row[channel("set_target_data.antennas.1.rx")] - 1.5_f64.to_degrees()).abs() < 1e-9);
        assert_eq!(read.notes[0], "2 values taken as radians: the greatest is 1.50 (else give --values)");
        assert!(read.notes[1].starts_with("the times of the 3 rows are uneven"), "{:?}", read.notes);

        let text = r#"[{"t": 0, "joints": {"neck": 10, "jaw_rad": 1}}, {"t": 0.5, "joints": {"neck": -30.5, "jaw_rad": 1}}]"#;
        let read = parse(text.as_bytes(), "x.json", &Options::default()).expect("a move");
        assert_eq!(read.clip.motion.fps, 2.0);
        let mut found = names(&read);
        found.sort_unstable();
        assert_eq!(found, ["joints.jaw_rad.rx", "joints.neck.rx"]);
        assert_eq!(read.notes, ["1 values taken as degrees: the greatest is 30.50 (else give --values)"]);
    }

    #[test]
    fn the_caller_may_say_the_unit() {
        let text = r#"[{"t": 0, "neck": 1, "jaw_rad": 1}, {"t": 0.5, "neck": 2, "jaw_rad": 1}]"#;
        for (values, name, expected) in [
            (Values::Degrees, "neck.rx", 2.0),
            (Values::Radians, "neck.rx", 2_f64.to_degrees()),
            (Values::Goals, "neck.goal", 2.0),
        ] {
            let options = Options { values: Some(values), ..Options::default() };
            let clip = parse(text.as_bytes(), "x.json", &options).expect("a move").clip;
            let row = clip.motion.frame(1);
            assert_eq!(row[clip.skeleton.channel(name).expect(name)], expected);
            let jaw = clip.skeleton.channel("jaw_rad.rx").expect("a jaw");
            assert_eq!(row[jaw], 1_f64.to_degrees());
        }
        let positions = r#"{"fps": 30, "positions": [{"0": 1472}, {"0": 1477}]}"#;
        let options = Options { values: Some(Values::Goals), ..Options::default() };
        let read = parse(positions.as_bytes(), "x.json", &options).expect("an animation");
        assert_eq!(names(&read), ["0.goal"]);
        assert_eq!(read.notes, ["1 of 1 columns taken as goals of servos"]);
    }

    #[test]
    fn other_json_is_refused() {
        for (text, message) in [
            ("{\"a\":\n", "x.json, line 2: found no JSON"),
            ("7", "x.json: found a single value, expected a list of times"),
            ("{}", "x.json: found an object without a list of times, expected"),
            ("[{\"a\": 1}]", "x.json: found no time in place 0 of the list, expected"),
            ("[]", "x.json: found no row of values"),
            (
                "[{\"t\":0,\"a\":1},{\"t\":1,\"b\":1}]",
                "x.json: found other values in frame 1 than in frame 0",
            ),
            (
                r#"{"fps":1,"servos":{"0":{"positions":[1]},"1":{"positions":[]}}}"#,
                "x.json: found 0 positions of 1.tx",
            ),
        ] {
            let error = parse(text.as_bytes(), "x.json", &Options::default()).expect_err(text).to_string();
            assert!(error.starts_with(message), "{error}");
        }
    }
}
