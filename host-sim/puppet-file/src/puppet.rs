//! A puppet.toml that was read.

use crate::channels::{Channels, Owner};
use crate::error::{Error, MOST_LETTERS, Mistakes, Problem};
use crate::file::{BusEntry, File, JointEntry};
use crate::models;
use crate::place::{FILLER, Place};
use crate::recover;
use firmware::map::{BusKind, BusSpec, Joint, MAX_BUSES, OSCILLATORS};
use heapless::Vec as HeaplessVec;
use mocap::import::read_bytes;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// A servo as a puppet.toml names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NamedServo {
    /// Number of its bus, in the order of the file.
    pub bus: usize,
    /// Its id on that bus.
    pub id: u8,
    /// The joint's name.
    pub name: String,
    /// Its model number, where the puppet says it.
    pub model: Option<u16>,
    /// The two ends of its range in goal units, where the puppet says them as such.
    pub goal_range: Option<[i32; 2]>,
}

/// A puppet.toml whose keys and value types are right; [`Puppet::map`] checks what the values say.
#[derive(Debug)]
pub struct Puppet {
    path: PathBuf,
    text: String,
    pub(crate) file: File,
}

impl Puppet {
    /// Reads a puppet.toml.
    ///
    /// # Errors
    /// A sentence that names the file, the line and the key.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let bytes = read_bytes(path).map_err(|error| Error::new(path, None, Problem::Read(error)))?;
        let not_text = |byte| Error::new(path, None, Problem::NotText { byte });
        let text = String::from_utf8(bytes).map_err(|error| not_text(error.utf8_error().valid_up_to()))?;
        Self::parse(path, text)
    }

    /// As [`read`](Self::read), of a text that came from `path`, which errors name.
    ///
    /// # Errors
    /// A sentence that names the file, the line and the key.
    pub fn parse(path: &Path, text: String) -> Result<Self, Error> {
        match toml::from_str(&text) {
            Ok(file) => Ok(Self { path: path.to_owned(), text, file }),
            Err(error) => {
                let place = error.span().map(|span| Place::of(&text, span));
                Err(Error::new(path, place, Problem::Toml(Box::new(error))))
            }
        }
    }

    /// As [`read`](Self::read), with all that is wrong with the keys and not only the first of it; the puppet is then what there is of
    /// it, to tell by [`check`](Self::check) what else is wrong.
    pub fn read_all(path: &Path) -> (Option<Self>, Vec<Error>) {
        let text = match read_bytes(path).map(String::from_utf8) {
            Ok(Ok(text)) => text,
            // It says which.
            _ => return (None, Self::read(path).err().into_iter().collect()),
        };
        let (file, errors) = recover::read(&text);
        let mistake = |error: toml::de::Error| {
            let place = error.span().map(|span| Place::of(&text, span));
            Error::new(path, place, Problem::Toml(Box::new(error)))
        };
        let mistakes = errors.into_iter().map(mistake).collect();
        (file.map(|file| Self { path: path.to_owned(), text, file }), mistakes)
    }

    /// Text and path, as they were read.
    pub fn source(&self) -> (&Path, &str) {
        (&self.path, &self.text)
    }

    /// Where the puppet says that its skeleton is.
    pub fn skeleton(&self) -> Option<PathBuf> {
        let skeleton = self.file.skeleton.as_ref()?;
        Some(self.path.parent().map_or_else(|| skeleton.clone(), |folder| folder.join(skeleton)))
    }

    /// The names of its buses, in the order of the map; one that has none is "bus".
    pub fn bus_names(&self) -> Vec<String> {
        match self.file.bus.as_slice() {
            [] => vec!["bus".to_owned()],
            buses => buses.iter().map(|bus| bus.name.get_ref().clone()).collect(),
        }
    }

    /// What the servos hang on, in the order of the map.
    ///
    /// # Errors
    /// A bus without a rate, or two with one name, or more than [`MAX_BUSES`].
    pub fn buses(&self) -> Result<HeaplessVec<BusSpec, MAX_BUSES>, Error> {
        self.all_buses().map_err(|mut mistakes| mistakes.swap_remove(0))
    }

    /// As [`buses`](Self::buses), with all mistakes there are.
    pub(crate) fn all_buses(&self) -> Result<HeaplessVec<BusSpec, MAX_BUSES>, Vec<Error>> {
        let file = &self.file;
        let mut mistakes = Mistakes::default();
        let mut buses = HeaplessVec::new();
        match (&file.baud, file.bus.as_slice()) {
            (Some(baud), []) => {
                if *baud.get_ref() == 0 {
                    mistakes.add(self.wrong(baud, Problem::BaudZero));
                }
                buses.extend([BusSpec { kind: BusKind::Dynamixel, baud: *baud.get_ref() }]);
            }
            (None, []) => mistakes.add(self.wrong_at_all(Problem::NoBaud)),
            (Some(baud), _) => mistakes.add(self.wrong(baud, Problem::BaudBesideBuses)),
            (None, _) => {}
        }
        for (index, entry) in file.bus.iter().enumerate() {
            if file.bus.iter().take(index).any(|other| other.name.get_ref() == entry.name.get_ref()) {
                mistakes.add(self.wrong(&entry.name, Problem::BusTwice));
            }
            self.check_name(&entry.name, &mut mistakes);
            if *entry.baud.get_ref() == 0 {
                mistakes.add(self.wrong(&entry.baud, Problem::BaudZero));
            }
            let baud = mistakes.note(self.rate(entry)).unwrap_or(*entry.baud.get_ref());
            if buses.push(BusSpec { kind: entry.kind, baud }).is_err() {
                mistakes.add(self.wrong(&entry.name, Problem::TooManyBuses));
                break;
            }
        }
        if mistakes.is_empty() { Ok(buses) } else { Err(mistakes.into()) }
    }

    /// The rate of a bus as a map has it.
    fn rate(&self, entry: &BusEntry) -> Result<u32, Error> {
        let Some(oscillator) = &entry.oscillator_hz else { return Ok(*entry.baud.get_ref()) };
        let found = *oscillator.get_ref();
        let (least, most) = (OSCILLATORS.start().to_owned(), OSCILLATORS.end().to_owned());
        match entry.kind {
            BusKind::Pca9685 if OSCILLATORS.contains(&found) => {
                Ok(BusSpec::pca9685(*entry.baud.get_ref(), found).baud)
            }
            BusKind::Pca9685 => {
                let (found, least, most) = (found.into(), least.into(), most.into());
                Err(self.wrong(oscillator, Problem::OutOfRange { found, least, most }))
            }
            _ => Err(self.wrong(oscillator, Problem::OscillatorElsewhere)),
        }
    }

    /// Notes a name that cannot be told.
    pub(crate) fn check_name(&self, name: &Spanned<String>, mistakes: &mut Mistakes) {
        let text = name.get_ref();
        let letters = text.chars().count();
        let found = match text {
            text if text.is_empty() => "none".to_owned(),
            text if text.chars().any(char::is_control) => "a control character".to_owned(),
            _ if letters > MOST_LETTERS => format!("{letters}"),
            _ => return,
        };
        mistakes.add(self.wrong(name, Problem::Name { found }));
    }

    /// The servos without what they follow, in the order of the file.
    ///
    /// # Errors
    /// A joint whose bus there is not, whose model is not known, or whose `goal_range` has not two ends.
    pub fn servos(&self) -> Result<Vec<NamedServo>, Error> {
        let named = |entry: &JointEntry| {
            let (bus, name) = (self.bus_of(entry)?, entry.name.get_ref().clone());
            let (id, model) = (*entry.id.get_ref(), self.model(entry)?);
            let ends = |range: &Spanned<Vec<i32>>| {
                let wrong = |_| self.wrong(range, Problem::RangeLength { found: range.get_ref().len() });
                <[i32; 2]>::try_from(range.get_ref().as_slice()).map_err(wrong)
            };
            let goal_range = entry.goal_range.as_ref().map(ends).transpose()?;
            Ok(NamedServo { bus: bus.into(), id, name, model, goal_range })
        };
        self.file.joint.iter().map(named).collect()
    }

    /// The name of a joint of this puppet's map; empty for one that is not of it.
    pub fn name_of(&self, joint: &Joint) -> &str {
        let is = |entry: &&JointEntry| {
            *entry.id.get_ref() == joint.id && self.bus_of(entry).ok() == Some(joint.bus)
        };
        self.file.joint.iter().find(is).map_or("", |entry| entry.name.get_ref())
    }

    /// The channels of the clips that `bunraku encode --puppet` makes for this puppet: one for each joint, in the order of
    /// the file, named as the joint.
    ///
    /// # Errors
    /// A channel whose name does not say what it moves.
    pub fn channels(&self) -> Result<Channels, Error> {
        let columns = self.file.joint.iter().map(|entry| self.own_channel(entry));
        Ok(Channels::new(Owner::Puppet, columns.collect::<Result<Vec<_>, _>>()?))
    }

    /// As [`channels`](Self::channels), of those joints whose channels are right.
    pub fn right_channels(&self) -> Channels {
        Channels::new(Owner::Puppet, self.file.joint.iter().filter_map(|entry| self.own_channel(entry).ok()))
    }

    /// Whether the puppet plays clips that were made for it alone: a joint follows something else than a channel.
    pub fn needs_fit(&self) -> bool {
        self.file.joint.iter().any(|entry| entry.channel.is_none())
    }

    /// The number of a joint's bus.
    pub(crate) fn bus_of(&self, entry: &JointEntry) -> Result<u8, Error> {
        match &entry.bus {
            None if self.file.bus.len() < 2 => Ok(0),
            None => Err(self.wrong(&entry.name, Problem::NoBus)),
            Some(name) => {
                let found = self.file.bus.iter().position(|bus| bus.name.get_ref() == name.get_ref());
                let number = found.and_then(|index| u8::try_from(index).ok());
                number.ok_or_else(|| self.wrong(name, Problem::UnknownBus { name: name.get_ref().clone() }))
            }
        }
    }

    /// The model number that an entry says.
    pub(crate) fn model(&self, entry: &JointEntry) -> Result<Option<u16>, Error> {
        let Some(spanned) = &entry.model else { return Ok(None) };
        let number = models::number(spanned.get_ref());
        number.map(Some).map_err(|unknown| self.wrong(spanned, unknown))
    }

    /// A mistake in a value.
    pub(crate) fn wrong<T>(&self, value: &Spanned<T>, problem: impl Into<Problem>) -> Error {
        self.wrong_at(value.span(), problem)
    }

    /// A mistake at a byte range of the file.
    pub(crate) fn wrong_at(&self, span: Range<usize>, problem: impl Into<Problem>) -> Error {
        let of_filler = span == FILLER;
        Error::new(&self.path, Some(Place::of(&self.text, span)), problem).of_filler(of_filler)
    }

    /// A mistake of the whole file.
    pub(crate) fn wrong_at_all(&self, problem: impl Into<Problem>) -> Error {
        Error::new(&self.path, None, problem)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channels::Unit;
    use std::fs;

    fn puppet(channels: &[&str]) -> Puppet {
        let mut text = "servo_hz = 50\nbaud = 1_000_000\n".to_owned();
        for (id, channel) in channels.iter().enumerate() {
            text += &format!(
                "[[joint]]\nname = \"{id}\"\nid = {id}\nchannel = \"{channel}\"\nrange = [-10, 10]\nmax_speed = 100\n"
            );
        }
        Puppet::parse(Path::new("puppet.toml"), text).unwrap()
    }

    #[test]
    fn a_puppets_own_channels_are_its_joints_in_order() {
        let puppet = puppet(&["a.b.rx", "c.tz", "a.b.rz", "c.tz", "d.l", "a.b.rx"]);
        let channels = puppet.channels().unwrap();
        assert_eq!(channels.names().collect::<Vec<_>>(), ["0.rx", "1.tx", "2.rx", "3.tx", "4.tx", "5.rx"]);
        assert_eq!(channels.find("3.tx"), Ok((3, Unit::Centimetre)));
        assert!(!puppet.needs_fit());
        let error = self::puppet(&["a.rx", "elbow"]).channels().unwrap_err().to_string();
        assert!(
            error.starts_with("puppet.toml, line 12, key \"channel\": \"elbow\" is no channel"),
            "{error}"
        );
    }

    #[test]
    fn what_is_not_text_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("photo.toml");
        fs::write(&path, b"\xff\xd8\xff\xe0").unwrap();
        let error = Puppet::read(&path).unwrap_err().to_string();
        assert!(error.contains("photo.toml: byte 0: not text"), "{error}");
    }

    #[test]
    fn the_skeleton_lies_beside_the_puppet() {
        let text = "skeleton = '02.asf'\nservo_hz = 50\nbaud = 1\n[[joint]]\nname = 'elbow'\nchannel = 'rradius.rx'\nid = 3\nrange = [-90, 10]\nmax_speed = 90"
            .to_owned();
        let puppet = Puppet::parse(Path::new("some/puppet.toml"), text).unwrap();
        assert_eq!(puppet.skeleton(), Some(PathBuf::from("some/02.asf")));
    }
}
