//! From a puppet.toml and a skeleton to what fit is asked for.

use crate::channels::Channels;
use crate::error::{Error, Mistakes, Problem};
use crate::file::{JointEntry, TurnEntry};
use crate::puppet::Puppet;
use firmware::limits::FINE_BITS;
use firmware::map;
use fit::{Bones, Follows, Joint, Plan, Turn};
use mocap::body::{Body, Part};
use mocap::import::GOAL;
use mocap::skeleton::Origin;
use mocap::{Clip, Skeleton};
use toml::Spanned;

/// What a bone is called that is none: turns against it are turns of the figure in the room.
const WORLD: &str = "world";

/// Names that are told where a bone is not found.
const MOST_TOLD: usize = 24;

impl Puppet {
    /// What fit is asked for, for a recording.
    ///
    /// # Errors
    /// Every mistake there is: those that [`check`](Self::check) gives, and channels and bones that the skeleton has not.
    pub fn plan(&self, clip: &Clip) -> Result<Plan, Vec<Error>> {
        let skeleton = &clip.figure();
        let map = self.channels().map_err(|mistake| vec![mistake]).and_then(|own| self.check(own))?;
        let mut mistakes = Mistakes::default();
        let figure = Figure { skeleton, body: Body::of(skeleton), channels: Channels::from(skeleton) };
        // A table has no bones, and needs none for joints whose columns it has.
        let of_bones = self.file.chain.iter().filter(|_| !figure.is_table());
        let chains = of_bones.filter_map(|chain| {
            let bones = mistakes.note(figure.bones(self, &chain.bone, &chain.against))?;
            Some(fit::Chain { name: chain.name.get_ref().clone(), bones })
        });
        let chains: Vec<fit::Chain> = chains.collect();
        let twists = mistakes.note(self.twists(clip, &figure)).unwrap_or_default();
        let mut joints = Vec::new();
        for (index, entry) in self.file.joint.iter().enumerate() {
            let own = mistakes.note(self.own_channel(entry));
            // Of the puppet's own channels each joint has the one with its number.
            let joint = map.joints().iter().find(|joint| usize::from(joint.channel) == index);
            let (Some((own, unit)), Some(joint)) = (own, joint) else { continue };
            let follows = match figure.column_of(entry, joint, &own) {
                // What is given for the joint itself is its value.
                Some(follows) => Some((follows, 0.0)),
                None => mistakes.note(self.followed(entry, &figure)).zip(mistakes.note(self.offset(entry))),
            };
            let Some((follows, offset)) = follows else { continue };
            let scale = joint.scale.to_num::<f64>();
            let value = |goal: i32| f64::from(goal - joint.zero) / scale;
            let (one, other) = (value(joint.min), value(joint.max));
            let per_tick = |fine: i32| f64::from(fine) / f64::from(1 << FINE_BITS) / scale.abs();
            let hz = f64::from(map.tick_hz());
            joints.push(Joint {
                name: entry.name.get_ref().clone(),
                follows,
                is_rotation: unit == crate::channels::Unit::Degree,
                offset,
                range: [one.min(other), one.max(other)],
                max_speed: per_tick(joint.max_velocity) * hz,
                max_acceleration: per_tick(joint.max_acceleration) * hz * hz,
            });
        }
        if mistakes.is_empty() { Ok(Plan { joints, chains, twists }) } else { Err(mistakes.into()) }
    }

    /// The twists that the file has of this figure's limbs.
    fn twists(&self, clip: &Clip, figure: &Figure<'_>) -> Result<Vec<(usize, f64)>, Error> {
        let mut twists = Vec::new();
        let own = clip.skeleton.fingerprint();
        for entry in &self.file.figure {
            for (name, degrees) in entry.twists.get_ref() {
                let limb =
                    Part::parse(name).filter(|part| matches!(part, Part::UpperArm(_) | Part::Thigh(_)));
                let no_limb = || self.wrong(&entry.twists, Problem::NoLimb { name: name.clone() });
                let joint = figure.body.joint(limb.ok_or_else(no_limb)?);
                if !degrees.is_finite() {
                    return Err(self.wrong(&entry.twists, Problem::NotFinite { found: *degrees }));
                }
                if let (Some(joint), true) = (joint, *entry.bones.get_ref() == own) {
                    twists.push((joint, *degrees));
                }
            }
        }
        Ok(twists)
    }

    fn followed(&self, entry: &JointEntry, figure: &Figure<'_>) -> Result<Follows, Error> {
        if let Some(name) = &entry.channel {
            let found = figure.channels.find(name.get_ref());
            return Ok(Follows::Channel(found.map_err(|missing| self.wrong(name, missing))?.0));
        }
        if let (Some(name), Some(axis)) = (&entry.chain, &entry.axis)
            && let Some(chain) = self.chain_number(name.get_ref())
        {
            if figure.is_table() {
                return Err(self.wrong(name, Problem::NoBones));
            }
            return Ok(Follows::Chain { chain, axis: axis.get_ref().0 });
        }
        let turn = |turn: &TurnEntry| {
            let bones = figure.bones(self, &turn.bone, &turn.against)?;
            Ok((Turn { bones, axis: turn.axis.0 }, self.weight(turn)?))
        };
        let turns = entry.turn.iter().chain(entry.sum.iter().flatten());
        Ok(Follows::Turns(turns.map(turn).collect::<Result<_, _>>()?))
    }
}

/// A skeleton, and what is what in it.
struct Figure<'s> {
    skeleton: &'s Skeleton,
    body: Body,
    channels: Channels,
}

impl Figure<'_> {
    /// Whether it has columns alone.
    fn is_table(&self) -> bool {
        self.skeleton.origin == Origin::Table
    }

    /// The column of a table that is named as the joint: in goals, or, where the joint follows no other column, in the joint's
    /// own unit.
    fn column_of(&self, entry: &JointEntry, joint: &map::Joint, own: &str) -> Option<Follows> {
        if !self.is_table() {
            return None;
        }
        let column = |name: &str| Some(self.channels.find(name).ok()?.0);
        if let Some(channel) = column(&format!("{}.{GOAL}", entry.name.get_ref())) {
            let (zero, scale) = (f64::from(joint.zero), joint.scale.to_num());
            return Some(Follows::Goals { channel, zero, scale });
        }
        let other = entry.channel.as_ref().and_then(|channel| column(channel.get_ref()));
        if other.is_some() { None } else { Some(Follows::Channel(column(own)?)) }
    }

    fn bones(
        &self,
        puppet: &Puppet,
        bone: &Spanned<String>,
        against: &Spanned<String>,
    ) -> Result<Bones, Error> {
        if self.is_table() {
            return Err(puppet.wrong(bone, Problem::NoBones));
        }
        let find = |name: &Spanned<String>| {
            let found = self.body.find(self.skeleton, name.get_ref());
            found.ok_or_else(|| puppet.wrong(name, self.missing(name.get_ref())))
        };
        let against = if against.get_ref() == WORLD { None } else { Some(find(against)?) };
        Ok(Bones { bone: find(bone)?, against })
    }

    fn missing(&self, name: &str) -> Problem {
        let mut joints: Vec<&str> = self.skeleton.joints.iter().map(|joint| joint.name.as_str()).collect();
        joints.sort_by_cached_key(|own| strsim::levenshtein(name, own));
        let parts = Part::ALL.into_iter().filter(|part| self.body.joint(*part).is_some()).map(Part::name);
        let known = parts.chain(joints.into_iter().take(3).map(ToOwned::to_owned)).take(MOST_TOLD).collect();
        Problem::NoBone { name: name.to_owned(), known }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn plan(joints: &str) -> Result<Plan, Vec<Error>> {
        let text = format!("servo_hz = 50\nbaud = 1\n{joints}");
        Puppet::parse(Path::new("puppet.toml"), text).unwrap().plan(&mocap::sample::clip())
    }

    const ELBOW: &str = "[[joint]]\nname = 'elbow'\nid = 3\nrange = [10, 90]\nmax_speed = 90\n";

    #[test]
    fn names_become_bones_and_goals_become_degrees() {
        let turn = "turn = { bone = 'right forearm', against = 'rhumerus', axis = '-y' }\noffset = 20\n";
        let plan = plan(&format!("{ELBOW}{turn}")).unwrap();
        let skeleton = mocap::sample::clip().skeleton;
        let joint = |name: &str| skeleton.joints.iter().position(|joint| joint.name == name).unwrap();
        let bones = Bones { bone: joint("rradius"), against: Some(joint("rhumerus")) };
        let [elbow] = plan.joints.as_slice() else { panic!("{plan:?}") };
        let turn = Turn { bones, axis: [0.0, -1.0, 0.0] };
        assert_eq!(elbow.follows, Follows::Turns(vec![(turn, 1.0)]));
        assert!((elbow.range[0] - 10.0).abs() < 0.05 && (elbow.range[1] - 90.0).abs() < 0.05, "{elbow:?}");
        assert!(
            (elbow.max_speed - 90.0).abs() < 0.1 && (elbow.max_acceleration - 1800.0).abs() < 5.0,
            "{elbow:?}"
        );
        assert!(elbow.is_rotation && elbow.offset == 20.0);
    }

    #[test]
    fn columns_of_a_table_that_are_named_as_joints_are_their_values() {
        let joints = format!(
            "{ELBOW}turn = {{ bone = 'a', against = 'b', axis = 'x' }}\ndirection = -1\nzero = 2000\noffset = 7\n{}",
            ELBOW.replace("elbow", "jaw").replace("id = 3", "id = 4") + "channel = 'mouth.rx'\noffset = 7\n"
        );
        let puppet =
            Puppet::parse(Path::new("p.toml"), format!("servo_hz = 50\nbaud = 1\n{joints}")).unwrap();
        let plan = |header: &str| {
            let text = format!("time,{header}\n0,1,2\n0.1,1,2\n");
            let read =
                mocap::import::csv::parse(text.as_bytes(), "x.csv", &mocap::import::Options::default());
            puppet.plan(&read.unwrap().clip)
        };
        let goals = plan("elbow.goal,mouth").unwrap().joints;
        let Follows::Goals { channel: 0, zero: 2000.0, scale } = goals[0].follows else {
            panic!("{goals:?}")
        };
        assert!((scale + 4096.0 / 360.0).abs() < 1e-4, "{scale}");
        assert_eq!((&goals[1].follows, goals[0].offset, goals[1].offset), (&Follows::Channel(1), 0.0, 7.0));
        let own = plan("elbow,jaw").unwrap().joints;
        assert_eq!((&own[0].follows, own[0].offset), (&Follows::Channel(0), 0.0));
        assert_eq!((&own[1].follows, own[1].offset), (&Follows::Channel(1), 0.0));
        let error = plan("shoulder,jaw").unwrap_err().remove(0).to_string();
        assert!(error.contains("name a column as the joint"), "{error}");
    }

    #[test]
    fn a_table_needs_no_bones_for_the_joints_of_a_chain_that_it_has() {
        let chain = "[[chain]]\nname = 'head'\nbone = 'head'\nagainst = 'chest'\n";
        let joint = |name: &str, id: u8, axis: &str| {
            let joint = ELBOW.replace("elbow", name).replace("id = 3", &format!("id = {id}"));
            joint + &format!("chain = 'head'\naxis = '{axis}'\n")
        };
        let text =
            format!("servo_hz = 50\nbaud = 1\n{chain}{}{}", joint("pan", 3, "y"), joint("tilt", 4, "x"));
        let puppet = Puppet::parse(Path::new("p.toml"), text).unwrap();
        let plan = |header: &str| {
            let text = format!("time,{header}\n0,1,2\n0.1,1,2\n");
            let read =
                mocap::import::csv::parse(text.as_bytes(), "x.csv", &mocap::import::Options::default());
            puppet.plan(&read.unwrap().clip)
        };
        let found = plan("pan.goal,tilt.goal").unwrap();
        assert!(found.chains.is_empty() && found.joints.len() == 2, "{found:?}");
        let mistakes = plan("pan.goal,nod.goal").unwrap_err();
        let [error] = mistakes.as_slice() else { panic!("{mistakes:?}") };
        assert!(error.to_string().contains("line 19, key \"chain\": a table has columns"), "{error}");
    }

    #[test]
    fn a_figure_that_is_known_has_the_twists_in_the_file() {
        let clip = mocap::sample::clip();
        let elbow = format!("{ELBOW}channel = 'rradius.rx'\n");
        let figure = |bones: &str, twists: &str| {
            format!("[[figure]]\nbones = '{bones}'\ntwists = {{ {twists} }}\n{elbow}")
        };
        let joint = |name: &str| clip.skeleton.joints.iter().position(|joint| joint.name == name).unwrap();
        let own = clip.skeleton.fingerprint();
        let known = plan(&figure(&own, "'left thigh' = -3.5, 'right upper arm' = 20")).unwrap();
        assert_eq!(known.twists, [(joint("lfemur"), -3.5), (joint("rhumerus"), 20.0)]);
        assert_eq!(plan(&figure("0123456789abcdef", "'left thigh' = 3")).unwrap().twists, []);
        let error = plan(&figure(&own, "'left shin' = 3")).unwrap_err().remove(0).to_string();
        assert!(error.contains("line 5, key \"twists\": found \"left shin\", expected"), "{error}");
    }

    #[test]
    fn every_bone_that_there_is_not_is_told() {
        let tail = "turn = { bone = 'tail', against = 'world', axis = 'y' }\n";
        let sum = "sum = [{ bone = 'head', against = 'nek', axis = 'y' }]\n";
        let other = ELBOW.replace("elbow", "other").replace("id = 3", "id = 4");
        let mistakes = plan(&format!("{ELBOW}{tail}{other}{sum}")).unwrap_err();
        let sentences: Vec<String> = mistakes.iter().map(ToString::to_string).collect();
        assert_eq!(sentences.len(), 2, "{sentences:#?}");
        assert!(
            sentences[0].contains("line 8, key \"turn\": the skeleton has no bone \"tail\"; it has hips")
        );
        assert!(
            sentences[1].contains("line 14, key \"sum\": the skeleton has no bone \"nek\""),
            "{}",
            sentences[1]
        );
    }
}
