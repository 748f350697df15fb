//! What became of a recording on a puppet, as one table.

use fit::{BoneReport, Excess, JointReport, Report};

/// The table: a line a joint, and then a line for each bone that turns or chains drive.
pub fn table(report: &Report) -> String {
    let header = ["joint", "recorded", "in the clip", "out of range", "too fast", "too sudden"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let is_smoothed = report.joints.iter().any(|joint| joint.smoothed.is_some());
    if is_smoothed {
        rows[0].push("smoothed by".to_owned());
    }
    for joint in &report.joints {
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
    let mut text = aligned(&rows);
    if !report.bones.is_empty() {
        let mut rows = vec![["bone", "against", "mean", "worst", "driven by"].map(str::to_owned).to_vec()];
        for BoneReport { bone, against, joints, mean, worst, at } in &report.bones {
            let worst = format!("{worst:.1}° at {at:.2} s");
            rows.push(vec![bone.clone(), against.clone(), format!("{mean:.1}°"), worst, joints.join(", ")]);
        }
        text += "\nWhere the bones point, beside the recording:\n";
        text += &aligned(&rows);
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
        };
        let text = table(&Report { joints: vec![joint], bones: vec![bone] });
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("joint        recorded          in the clip"), "{text}");
        assert!(lines[1].contains("2 times, 0.35 s; 12.3 ° at 1.50 s  never"), "{text}");
        assert!(lines[5].starts_with("rradius  rhumerus  1.0°"), "{text}");
    }
}
