//! What a joint follows: a channel, a turn of one bone against another, a chain of joints, or a sum of turns.

use crate::channels::Unit;
use crate::error::{Error, Mistakes, Problem};
use crate::file::{JointEntry, TurnEntry};
use crate::puppet::Puppet;
use mocap::skeleton::Dof;
use toml::Spanned;

/// Most joints of a chain: the third one turns about any axis that is left.
const MAX_CHAIN: usize = 3;

impl Puppet {
    /// The channel of a joint in the clips that are made for this puppet, and its unit: `NAME.rx` in degrees, or `NAME.tx`
    /// in centimetres for a joint that follows a translation.
    pub(crate) fn own_channel(&self, entry: &JointEntry) -> Result<(String, Unit), Error> {
        let unit = match &entry.channel {
            None => Unit::Degree,
            Some(name) => {
                let ends = |dof: &Dof| name.get_ref().ends_with(&format!(".{}", dof.name()));
                let dof = Dof::ALL.into_iter().find(ends);
                let wrong = || self.wrong(name, Problem::Dof { name: name.get_ref().clone() });
                dof.ok_or_else(wrong)?.into()
            }
        };
        let dof = if unit == Unit::Degree { Dof::Rx } else { Dof::Tx };
        Ok((format!("{}.{}", entry.name.get_ref(), dof.name()), unit))
    }

    /// What is added to what a joint follows.
    pub(crate) fn offset(&self, entry: &JointEntry) -> Result<f64, Error> {
        match &entry.offset {
            None => Ok(0.0),
            Some(offset) => self.finite(offset),
        }
    }

    fn finite(&self, value: &Spanned<f64>) -> Result<f64, Error> {
        let found = *value.get_ref();
        if found.is_finite() { Ok(found) } else { Err(self.wrong(value, Problem::NotFinite { found })) }
    }

    /// The weight of a turn in a sum.
    pub(crate) fn weight(&self, turn: &TurnEntry) -> Result<f64, Error> {
        turn.weight.as_ref().map_or(Ok(1.0), |weight| self.finite(weight))
    }

    /// What is wrong with the chains, whatever follows them.
    pub(crate) fn check_chains(&self, mistakes: &mut Mistakes) {
        let chains = &self.file.chain;
        for (index, chain) in chains.iter().enumerate() {
            let name = chain.name.get_ref();
            if chains.iter().take(index).any(|other| other.name.get_ref() == name) {
                mistakes.add(self.wrong(&chain.name, Problem::ChainTwice));
                continue;
            }
            self.check_name(&chain.name, mistakes);
            let follows = |entry: &&JointEntry| entry.chain.as_ref().is_some_and(|own| own.get_ref() == name);
            let joints: Vec<&JointEntry> = self.file.joint.iter().filter(follows).collect();
            let found = joints.len();
            if found == 0 || found > MAX_CHAIN {
                mistakes.add(self.wrong(&chain.name, Problem::ChainJoints { found }));
            }
            for pair in joints.windows(2) {
                let &[before, behind] = pair else { continue };
                if let (Some(one), Some(other)) = (&before.axis, &behind.axis)
                    && one.get_ref().is_parallel(other.get_ref())
                {
                    let joint = before.name.get_ref().clone();
                    mistakes.add(self.wrong(other, Problem::ParallelAxes { joint }));
                }
            }
        }
    }

    /// What is wrong with the keys of a joint that say what it follows.
    pub(crate) fn check_follows(&self, entry: &JointEntry, mistakes: &mut Mistakes) {
        let JointEntry { channel, turn, chain, sum, axis, .. } = entry;
        let given = [channel.is_some(), turn.is_some(), chain.is_some(), sum.is_some()];
        if given.into_iter().filter(|given| *given).count() != 1 {
            mistakes.add(self.wrong(&entry.name, Problem::Follows));
        }
        match (chain, axis) {
            (None, Some(axis)) => mistakes.add(self.wrong(axis, Problem::AxisWithoutChain)),
            (Some(chain), None) => mistakes.add(self.wrong(chain, Problem::NoAxis)),
            _ => {}
        }
        if let Some(chain) = chain
            && self.chain_number(chain.get_ref()).is_none()
        {
            let name = chain.get_ref().clone();
            mistakes.add(self.wrong(chain, Problem::UnknownChain { name }));
        }
        if sum.as_ref().is_some_and(Vec::is_empty) {
            mistakes.add(self.wrong(&entry.name, Problem::EmptySum));
        }
        for turn in sum.iter().flatten() {
            mistakes.note(self.weight(turn));
            if let Some(weight) = turn.weight.as_ref().filter(|weight| *weight.get_ref() == 0.0) {
                mistakes.add(self.wrong(weight, Problem::WeightZero));
            }
        }
        if let Some(weight) = turn.as_ref().and_then(|turn| turn.weight.as_ref()) {
            mistakes.add(self.wrong(weight, Problem::WeightOfTurn));
        }
    }

    /// The number of a chain in the order of the file.
    pub(crate) fn chain_number(&self, name: &str) -> Option<usize> {
        self.file.chain.iter().position(|chain| chain.name.get_ref() == name)
    }
}
