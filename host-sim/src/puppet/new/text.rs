//! A proposed puppet as a puppet.toml.

use super::proposal::{Proposal, Proposed};
use firmware::map::BusKind;
use std::fmt::Write;

/// The puppet.toml. `source` names the recording.
pub fn text(proposal: &Proposal, source: &str) -> String {
    let Proposal { servo, units, figure, notes } = proposal;
    let count: usize = units.iter().map(|unit| unit.joints.len()).sum();
    let mut text = format!(
        "# A first puppet for the figure of {source}: {count} servos. `bunraku puppet new` wrote it.\n\
         #\n\
         # What is still yours to say: the id of each servo, and direction = -1 where one is mounted the other way\n\
         # round. `bunraku puppet scan` finds servos and their ids, and `bunraku puppet calibrate` measures `zero` and\n\
         # the range with the puppet in your hands. docs/PUPPET.md has all keys.\n\
         #\n\
         # Values are degrees. At 0 the figure stands in its T-pose: upright, arms out to the sides. An axis is what the\n\
         # servo turns about in that pose: x points to the figure's left, y up, z forward. Ranges are those of the\n\
         # recording and a margin; so are speeds, up to {:.0} degrees a second, which is what a {} does.\n",
        servo.speed, servo.model
    );
    for note in notes {
        let _ = writeln!(text, "#\n# {}", wrapped(note));
    }
    // How often a second all servos get a new goal.
    text += "\n# Goals a second.\nservo_hz = 50\n";
    if servo.kind == BusKind::Dynamixel {
        let _ = writeln!(text, "# Bits a second. From the factory a Dynamixel has 57_600.\nbaud = 1_000_000");
    } else {
        let _ = writeln!(
            text,
            "\n# What the servos hang on.\n[[bus]]\nname = \"servos\"\nkind = \"{}\"\nbaud = {}",
            servo.kind.name(),
            servo.baud
        );
    }
    if let Some(figure) = figure.text() {
        text += "\n# How the limbs of the recorded figure are twisted about themselves in the T-pose, in degrees, as this recording\n\
                 # shows it. Other recordings of the figure then have the same zeros.\n";
        text += &figure;
    }
    // The outputs of a board are counted from 0.
    let mut id = u16::from(!matches!(servo.kind, BusKind::Pwm | BusKind::Pca9685));
    for unit in units {
        write_unit(&mut text, unit, &mut id);
    }
    text
}

fn write_unit(text: &mut String, proposed: &Proposed, id: &mut u16) {
    let Proposed { unit, joints } = proposed;
    let (bone, against) = (unit.bone, unit.against);
    if joints.len() > 1 {
        let _ = write!(
            text,
            "\n# {} servos in series, the first one on the {against}: together they point the {bone} as recorded.\n\
             [[chain]]\nname = \"{}\"\nbone = \"{bone}\"\nagainst = \"{against}\"\n",
            if joints.len() == 2 { "Two" } else { "Three" },
            unit.name
        );
    }
    for joint in joints {
        let _ = write!(text, "\n[[joint]]\nname = \"{}\"\n", joint.name);
        if joints.len() > 1 {
            let _ = write!(text, "chain = \"{}\"\naxis = {}\n", unit.name, axis(joint.axis));
        } else {
            let _ = writeln!(
                text,
                "turn = {{ bone = \"{bone}\", against = \"{against}\", axis = {} }}",
                axis(joint.axis)
            );
        }
        let _ = writeln!(text, "id = {id}");
        if let Some(zero) = joint.zero {
            let _ =
                writeln!(text, "# So that the range lies in the middle of the servo's turn.\nzero = {zero}");
        }
        let ([low, high], [min, max]) = (joint.recorded, joint.range);
        let _ = write!(
            text,
            "# Recorded: {low:.0} to {high:.0}, at most {:.0} a second.\nrange = [{min:.0}, {max:.0}]\nmax_speed = {:.0}\n",
            joint.recorded_speed, joint.max_speed
        );
        *id += 1;
    }
}

/// An axis as a puppet.toml has it: a letter, or three numbers.
fn axis(axis: [f64; 3]) -> String {
    for (letter, k) in [("x", 0), ("y", 1), ("z", 2)] {
        if axis[k].abs() == 1.0 {
            return format!("\"{}{letter}\"", if axis[k] < 0.0 { "-" } else { "" });
        }
    }
    format!("[{}, {}, {}]", axis[0], axis[1], axis[2])
}

/// In lines of a comment.
fn wrapped(note: &str) -> String {
    let mut lines = vec![String::new()];
    for word in note.split(' ') {
        if lines.last().is_some_and(|line| line.len() + word.len() > 110) {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            line.push_str(if line.is_empty() { "" } else { " " });
            line.push_str(word);
        }
    }
    lines.join("\n# ")
}
