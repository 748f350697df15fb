//! What a puppet cannot do of a recording, as one table.

use fit::{BoneReport, Excess, JointReport, Pole, Report};

/// A bone that is further off in the mean than this is told besides, in degrees.
const FAR_OFF: f64 = 30.0;

/// A bone that is off by more than this near the axis of its first servo is told besides, in degrees.
const POLE_TOLD: f64 = 10.0;

/// A turn about a limb's own length that is worth a word, in degrees.
pub const TOLD: f64 = 5.0;

/// The table: a line for each joint that cannot do all of it, and one for each bone that turns or chains drive.
pub fn table(report: &Report) -> String {
    let header = ["joint", "recorded", "in the clip", "out of range", "too fast", "too sudden"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let is_smoothed = report.joints.iter().any(|joint| joint.smoothed.is_some());
    if is_smoothed {
        rows[0].push("smoothed by".to_owned());
    }
    let is_short = |joint: &&JointReport| {
        joint.out_of_range.is_some() || joint.too_fast.is_some() || joint.too_sudden.is_some()
    };
    for joint in report.joints.iter().filter(is_short) {
        let JointReport { name, unit, recorded, fitted, .. } = joint;
        let range = |[low, high]: [f64; 2]| format!("{low:.1} to {high:.1} {unit}");
        let mut row = vec![
            name.clone(),
            recorded.map_or_else(|| "as a chain".to_owned(), range),
            range(*fitted),
            excess(joint.out_of_range, &format!(" {unit}"), 1),
            excess(joint.too_fast, &format!(" {unit}/s"), 0),
            excess(joint.too_sudden, &format!(" {unit}/s²"), 0),
        ];
        if let Some(smoothed) = joint.smoothed {
            row.push(format!("{smoothed:.2} {unit}"));
        }
        rows.push(row);
    }
    let mut text = String::new();
    if rows.len() > 1 {
        text = format!("{} of {} joints cannot do all of it:\n", rows.len() - 1, report.joints.len());
        text += &aligned(&rows);
        let is_late = |joint: &JointReport| joint.too_fast.is_some() || joint.too_sudden.is_some();
        if !is_smoothed && report.joints.iter().any(is_late) {
            text += "A servo that is too slow comes late. With --smooth it begins earlier instead; `play --speed 0.5` leaves it twice \
                     the time.\n";
        }
    }
    if !report.bones.is_empty() {
        let mut rows = vec![["bone", "against", "mean", "worst", "driven by"].map(str::to_owned).to_vec()];
        for BoneReport { bone, against, joints, mean, worst, at, .. } in &report.bones {
            let worst = format!("{worst:.1}° at {at:.2} s");
            rows.push(vec![bone.clone(), against.clone(), format!("{mean:.1}°"), worst, joints.join(", ")]);
        }
        text += "Where the bones point, beside the recording:\n";
        text += &aligned(&rows);
        for BoneReport { bone, joints, worst, pole, .. } in &report.bones {
            if let (Some(Pole { frames, worst: near }), Some(first)) = (pole, joints.first())
                && near == worst
                && *worst > POLE_TOLD
                && !is_smoothed
            {
                text += &format!(
                    "{bone} is worst where it points along the axis of {first}, to within {:.0}° ({:.1} % of the frames): there two \
                     servos cannot follow, and a third one in the chain can.\n",
                    Pole::NEAR,
                    100.0 * frames
                );
            }
        }
        let far = report.bones.iter().filter(|bone| bone.mean > FAR_OFF).map(|bone| bone.bone.as_str());
        let far: Vec<&str> = far.collect();
        if !far.is_empty() {
            text += &format!(
                "More than {FAR_OFF:.0} degrees off in the mean: {}. Either the servos have no axis for that, or a bone was \
                 taken for another part of the body; `bunraku info` shows the recording's joints.\n",
                far.join(", ")
            );
        }
    }
    let twisted = report.twists.iter().filter(|twist| twist.degrees.abs() > TOLD);
    let twisted: Vec<String> = twisted.map(|twist| format!("{} {:.0}°", twist.bone, twist.degrees)).collect();
    if !twisted.is_empty() {
        text += &format!(
            "Turned about their length, so that elbows and knees bend as such: {}\n",
            twisted.join(", ")
        );
    }
    text
}

/// How often, how long and how far a joint is beyond a limit; "never" where it is not.
fn excess(found: Option<Excess>, unit: &str, decimals: usize) -> String {
    found.map_or_else(
        || "never".to_owned(),
        |Excess { times, seconds, most, at }| {
            let often = if times == 1 { "once".to_owned() } else { format!("{times} times") };
            format!("{often}, {seconds:.2} s; {most:.decimals$}{unit} at {at:.2} s")
        },
    )
}

/// Rows in columns that are as wide as what is in them.
fn aligned(rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let line = |row: &Vec<String>| {
        let cells = row.iter().enumerate().map(|(column, cell)| format!("{cell:0$}", width(column)));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fit::TwistReport;

    #[test]
    fn a_table_says_how_often_how_long_and_how_far() {
        let excess = Excess { times: 2, seconds: 0.35, most: 12.34, at: 1.5 };
        let joint = JointReport {
            name: "right elbow".to_owned(),
            unit: "°",
            recorded: Some([-12.0, 150.0]),
            fitted: [0.0, 137.7],
            out_of_range: Some(excess),
            too_fast: None,
            too_sudden: None,
            smoothed: None,
        };
        let bone = BoneReport {
            bone: "rradius".to_owned(),
            against: "rhumerus".to_owned(),
            joints: vec!["right elbow".to_owned()],
            mean: 1.0,
            worst: 12.3,
            at: 1.5,
            pole: None,
        };
        let twist = TwistReport {
            bone: "rhumerus".to_owned(),
            part: "right upper arm".to_owned(),
            degrees: 31.1,
            is_known: false,
        };
        let able = JointReport { out_of_range: None, ..joint.clone() };
        let report = Report { joints: vec![joint, able.clone()], bones: vec![bone], twists: vec![twist] };
        let text = table(&report);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "1 of 2 joints cannot do all of it:");
        assert!(lines[1].starts_with("joint        recorded          in the clip"), "{text}");
        assert!(lines[2].contains("2 times, 0.35 s; 12.3 ° at 1.50 s  never"), "{text}");
        assert!(lines[5].starts_with("rradius  rhumerus  1.0°"), "{text}");
        assert!(lines[6].ends_with("rhumerus 31°"), "{text}");
        let at_pole = |worst: f64| {
            let pole = Some(Pole { frames: 0.031, worst });
            let bone = BoneReport { pole, ..report.bones[0].clone() };
            table(&Report { bones: vec![bone], ..report.clone() })
        };
        let told = "rradius is worst where it points along the axis of right elbow, to within 30° (3.1 % of the frames): there two";
        assert!(at_pole(12.3).contains(told), "{}", at_pole(12.3));
        assert!(!at_pole(12.0).contains("is worst where"));
        assert_eq!(table(&Report { joints: vec![able], bones: Vec::new(), twists: Vec::new() }), "");
    }
}
