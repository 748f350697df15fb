//! What changes while a puppet plays, with its tick.

use firmware::fault::Fault;
use firmware::library::Library;
use firmware::machine::{Machine, State};
use serde::Serialize;

/// Something that changed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// The tick that came next.
    pub tick: u32,
    /// What it is about.
    pub what: NoteKind,
    /// What it has become: a state, a fault, the number of a clip.
    pub text: String,
}

/// What a note is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum NoteKind {
    /// Where the puppet is.
    State,
    /// A fault was latched; the text is empty where it was acknowledged.
    Fault,
    /// Which clip plays; the text is empty where none does.
    Clip,
    /// A command that the puppet did not take.
    Refused,
    /// How frames of a live stream are made: `Right`, `Reckoned` or `Eased`; the text is empty where none plays.
    Stream,
    /// A stream has ended: frames that were played as they were sent, concealed, eased, and lost.
    Streamed,
}

/// Takes notes of a puppet.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    /// What has changed so far, in order.
    pub all: Vec<Note>,
    state: Option<State>,
    fault: Option<Fault>,
    clip: Option<u16>,
    /// The tick that comes, once goals have been sent.
    tick: Option<u32>,
}

impl Notes {
    /// Before each tick: counts ticks from the first on in which servos are given goals, as a
    /// [script](firmware::script::Script) does, and gives the number of the one that comes.
    pub fn count<L: Library, const N: usize>(&mut self, puppet: &Machine<'_, L, N>) -> u32 {
        self.tick = match self.tick {
            Some(tick) => Some(tick + 1),
            None if matches!(puppet.state(), State::Finding | State::Reading) => None,
            None => Some(1),
        };
        self.tick.unwrap_or(0)
    }

    /// Takes down a change.
    pub fn add(&mut self, tick: u32, what: NoteKind, text: String) {
        self.all.push(Note { tick, what, text });
    }

    /// Takes down what has changed of a puppet's state, fault and clip, and says whether its state has.
    pub fn look<L: Library, const N: usize>(&mut self, tick: u32, puppet: &Machine<'_, L, N>) -> bool {
        let (state, fault) = (Some(puppet.state()), puppet.fault());
        let moved_on = std::mem::replace(&mut self.state, state) != state;
        if moved_on {
            self.add(tick, NoteKind::State, format!("{:?}", puppet.state()));
        }
        if std::mem::replace(&mut self.fault, fault) != fault {
            self.add(tick, NoteKind::Fault, fault.map_or(String::new(), |fault| format!("{fault:?}")));
        }
        let clip = puppet.mixer().position().map(|(clip, ..)| clip);
        if std::mem::replace(&mut self.clip, clip) != clip {
            self.add(tick, NoteKind::Clip, clip.map_or(String::new(), |clip| clip.to_string()));
        }
        moved_on
    }
}
