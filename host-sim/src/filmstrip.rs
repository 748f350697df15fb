//! A motion as a strip of figures, side by side: as recorded, and as decoded on top.

use anyhow::{Result, ensure};
use mocap::kinematics::Kinematics;
use mocap::motion::Motion;
use mocap::skeleton::Skeleton;
use plotters::prelude::{IntoDrawingArea, PathElement, RGBColor, SVGBackend, Text, WHITE};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, ShapeStyle};

/// Width and height of the drawing, in its units.
const SIZE: (u32, u32) = (960, 300);
/// Space above and below the figures, for the title and the times.
const MARGIN: f64 = 34.0;
/// Where the figures are looked at from: turned by so much about the vertical axis, so that steps are seen from the side.
const TURN_DEGREES: f64 = 55.0;
const RECORDED: RGBColor = RGBColor(200, 205, 212);
const DECODED: RGBColor = RGBColor(200, 40, 50);
const INK: RGBColor = RGBColor(70, 76, 84);

/// An SVG of `count` moments of a motion, from its first to its last frame. `recorded` is drawn wide and grey, `decoded`
/// narrow and red over the grey. Places of the root on the ground are left out: each figure stands in its own column.
///
/// # Errors
/// A sentence where the motions differ in frames or channels, or where there are fewer than two moments or frames.
pub fn filmstrip(
    skeleton: &Skeleton,
    recorded: &Motion,
    decoded: &Motion,
    count: usize,
    title: &str,
) -> Result<String> {
    let frames = recorded.frames();
    ensure!(
        frames == decoded.frames() && recorded.channels == decoded.channels,
        "found {frames} frames of {} channels and {} of {}, expected as many of both",
        recorded.channels,
        decoded.frames(),
        decoded.channels
    );
    ensure!(frames > 1 && count > 1, "found {frames} frames and {count} moments, expected two at least");
    let mut kinematics = Kinematics::new(skeleton);
    let moments: Vec<usize> = (0..count).map(|moment| moment * (frames - 1) / (count - 1)).collect();
    let mut figures_of = |motion: &Motion| -> Vec<Vec<[f64; 2]>> {
        moments.iter().map(|&frame| seen(&mut kinematics, motion.frame(frame))).collect()
    };
    let (before, after) = (figures_of(recorded), figures_of(decoded));

    // One scale for all figures, feet on one line.
    let points = || before.iter().chain(&after).flatten();
    let (low, high) = points().fold((f64::MAX, f64::MIN), |(low, high), [_, y]| (low.min(*y), high.max(*y)));
    let scale = (f64::from(SIZE.1) - 2.0 * MARGIN) / (high - low).max(1.0);
    let column = f64::from(SIZE.0) / count as f64;
    let place = |moment: usize, [x, y]: [f64; 2]| {
        let across = (moment as f64 + 0.5) * column + x * scale;
        (across.round() as i32, (f64::from(SIZE.1) - MARGIN - (y - low) * scale).round() as i32)
    };

    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let text = |size: i32| ("sans-serif", size).into_font().color(&INK);
        area.draw(&Text::new(title.to_owned(), (12, 10), text(15)))?;
        for (figures, style) in [
            (&before, ShapeStyle { color: RECORDED.to_rgba(), filled: false, stroke_width: 7 }),
            (&after, ShapeStyle { color: DECODED.to_rgba(), filled: false, stroke_width: 2 }),
        ] {
            for (moment, figure) in figures.iter().enumerate() {
                for (joint, &end) in skeleton.joints.iter().zip(figure) {
                    let Some(parent) = joint.parent else { continue };
                    let bone = [place(moment, figure[parent]), place(moment, end)];
                    area.draw(&PathElement::new(bone, style))?;
                }
            }
        }
        for (moment, &frame) in moments.iter().enumerate() {
            let seconds = format!("{:.1} s", frame as f64 / recorded.fps);
            let at = (((moment as f64 + 0.5) * column) as i32, SIZE.1 as i32 - 8);
            area.draw(&Text::new(seconds, at, text(13).pos(Pos::new(HPos::Center, VPos::Bottom))))?;
        }
        area.present()?;
    }
    Ok(svg)
}

/// Joints of a pose as they are seen, in cm: to the right and up, the root in the middle.
fn seen(kinematics: &mut Kinematics, pose: &[f64]) -> Vec<[f64; 2]> {
    let mut positions = vec![[0.0; 3]; kinematics.joints()];
    kinematics.positions(pose, &mut positions);
    let (sin, cos) = TURN_DEGREES.to_radians().sin_cos();
    let root = positions[0];
    positions.iter().map(|[x, y, z]| [(x - root[0]) * cos + (z - root[2]) * sin, *y]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use mocap::sample;

    #[test]
    fn a_strip_has_each_bone_of_each_moment_twice() {
        let clip = sample::clip();
        let svg = filmstrip(&clip.skeleton, &clip.motion, &clip.motion, 5, "a <title>").unwrap();
        let bones = clip.skeleton.joints.iter().filter(|joint| joint.parent.is_some()).count();
        assert_eq!(svg.matches("<polyline").count(), 2 * 5 * bones);
        assert!(svg.contains("a &lt;title&gt;") && svg.contains("8.0 s"), "{svg}");
    }

    #[test]
    fn motions_of_other_lengths_are_refused() {
        let clip = sample::clip();
        let mut shorter = clip.motion.clone();
        shorter.samples.truncate(clip.motion.channels * 10);
        let error = filmstrip(&clip.skeleton, &clip.motion, &shorter, 5, "").unwrap_err();
        assert_eq!(
            error.to_string(),
            "found 480 frames of 31 channels and 10 of 31, expected as many of both"
        );
        assert!(filmstrip(&clip.skeleton, &clip.motion, &clip.motion, 1, "").is_err());
    }
}
