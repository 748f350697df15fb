//! The show: the linked-in clip, played on the servos of the linked-in map.

use crate::clip;
use core::num::NonZeroU16;
use embassy_time::{Delay, Duration, Instant, Timer};
use embedded_hal::digital::{ErrorType, InputPin, OutputPin};
use embedded_io_async::{Read, Write};
use firmware::control_loop::{Surroundings, control_loop};
use firmware::decoder_list::SingleClip;
use firmware::fault::{Fault, Feedback};
use firmware::library::Library;
use firmware::machine::{After, Command, Machine, Show, Start, State};
use firmware::map::{BusKind, JointMap, MAX_SERVOS};
use servo_wire::dynamixel::bus::DynamixelBus;
use servo_wire::dynamixel::client::DynamixelClient;
use servo_wire::port::{LineConfig, Port};

static MAP: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/map.postcard"));

/// Rate to play at instead of the clip's own, in hundredths of a hertz, if one was given.
const CENTIHERTZ: Option<NonZeroU16> = match u16::from_str_radix(env!("BUNRAKU_CENTIHERTZ"), 10) {
    Ok(rate) => NonZeroU16::new(rate),
    Err(_) => panic!("BUNRAKU_CENTIHERTZ must be 0 to 65535"),
};

/// The clip, then home; and again at each trigger.
pub(crate) const SHOW: Show<'static> =
    Show { playlist: &[0], repeats: false, idle_clip: None, trigger_clip: Some(0), after: After::Home };

/// What a board brings.
pub struct Wiring<U, D, T, W> {
    /// The servo bus, at [`Puppet::baud`]. Its reads are buffered and can be cancelled.
    pub uart: U,
    /// High to send, or [`Automatic`](servo_wire::port::Automatic).
    pub direction: D,
    /// What is to be known of the bus.
    pub line: LineConfig,
    /// When it is pulled low, a puppet at rest plays the clip again, and one with a fault takes that as acknowledged;
    /// [`Button::None`] where there is none.
    pub trigger: T,
    /// Feeds the controller's watchdog; called once a tick, after decoder and bus.
    pub feed: W,
    /// Why the controller started.
    pub start: Start,
    /// Whether the board is simulated: then the show ends when the puppet rests, and nobody is late, since the clock may be the
    /// host's.
    pub simulated: bool,
}

/// The trigger of a board that has none.
pub enum Button {
    /// Never pressed.
    None,
}

impl ErrorType for Button {
    type Error = core::convert::Infallible;
}

impl InputPin for Button {
    fn is_high(&mut self) -> Result<bool, Self::Error> {
        Ok(true)
    }

    fn is_low(&mut self) -> Result<bool, Self::Error> {
        Ok(false)
    }
}

/// The linked-in puppet, and the memory of the linked-in clip's decoder.
pub struct Puppet {
    pub(crate) map: JointMap<MAX_SERVOS>,
    memory: clip::Memory,
}

impl Puppet {
    /// Reads the map. Panics with what is wrong with it.
    pub fn linked_in() -> Self {
        match JointMap::parse(MAP) {
            Ok(map) => Self { map, memory: clip::Memory::EMPTY },
            Err(error) => defmt::panic!("map: {}", error),
        }
    }

    /// Bits per second of the servo bus; a puppet without one has none that it minds.
    pub fn baud(&self) -> u32 {
        self.rate_of(BusKind::Dynamixel).unwrap_or(1_000_000)
    }

    /// Bits or pulses per second of the bus of this kind, where the puppet has one.
    pub fn rate_of(&self, kind: BusKind) -> Option<u32> {
        self.map.buses().iter().find(|bus| bus.kind == kind).map(|bus| bus.baud)
    }

    /// Plays the clip, and again at each trigger. Returns where a simulated board's puppet rests, with its fault. Panics where
    /// the clip is damaged.
    pub async fn play<U, D, T, W>(&mut self, wiring: Wiring<U, D, T, W>) -> Option<Fault>
    where
        U: Read + Write,
        D: OutputPin,
        T: InputPin,
        W: FnMut(),
    {
        let Self { map, memory } = self;
        let Wiring { uart, direction, line, trigger, feed, start, simulated } = wiring;
        let clip = match clip::open(memory) {
            Ok(clip) => clip,
            Err(error) => defmt::panic!("clip: {}", error),
        };
        let rate = CENTIHERTZ.map_or(clip.rate_centihertz, NonZeroU16::get);
        let library = SingleClip::new(clip.decoder, Some(rate));
        let mut machine = Machine::new(map, library, SHOW, start);
        let mut bus =
            DynamixelBus::<_, _, _>::new(DynamixelClient::new(Port::new(uart, direction, Delay, line)));
        defmt::info!("{} frames at {} cHz on {} servos", clip.frames, rate, map.joints().len());
        let mut board = BoardSurroundings::new(map, trigger, feed, simulated);
        control_loop(&mut machine, &mut bus, &mut board).await;
        machine.fault()
    }
}

/// The board, as the drive sees it.
pub(crate) struct BoardSurroundings<'m, T, W> {
    map: &'m JointMap<MAX_SERVOS>,
    began: Instant,
    trigger: T,
    /// Whether it was in the last tick.
    pressed: bool,
    feed: W,
    simulated: bool,
    ticks: u32,
    /// What was logged last.
    state: State,
    fault: Option<Fault>,
    rests: bool,
}

impl<'m, T: InputPin, W: FnMut()> BoardSurroundings<'m, T, W> {
    pub(crate) fn new(map: &'m JointMap<MAX_SERVOS>, trigger: T, feed: W, simulated: bool) -> Self {
        Self {
            map,
            began: Instant::now(),
            trigger,
            // What is pressed already when the power comes on says nothing.
            pressed: true,
            feed,
            simulated,
            ticks: 0,
            state: State::Finding,
            fault: None,
            rests: false,
        }
    }

    /// Since the show began.
    #[cfg(feature = "link")]
    pub(crate) fn millis(&self) -> u32 {
        self.began.elapsed().as_millis() as u32
    }

    fn due(&self, tick: u32) -> Instant {
        self.began + Duration::from_micros(self.map.tick_micros(tick))
    }

    /// Logs what has changed. That the puppet rests is said once it does, with its fault said before.
    fn log<L: Library>(&mut self, machine: &Machine<'_, L, MAX_SERVOS>) {
        if machine.state() != self.state {
            self.state = machine.state();
            defmt::info!("{}", self.state);
        }
        if machine.fault() != self.fault {
            self.fault = machine.fault();
            match self.fault {
                Some(fault) => {
                    match fault.servo().and_then(|servo| self.map.joints().get(usize::from(servo))) {
                        Some(joint) => defmt::error!("servo {=u8}: {}", joint.id, fault),
                        None => defmt::error!("{}", fault),
                    }
                }
                None => defmt::info!("acknowledged"),
            }
        }
        if machine.at_rest() != self.rests {
            self.rests = !self.rests;
            if self.rests {
                defmt::info!("rests after {} ticks in {} ms", self.ticks, self.began.elapsed().as_millis());
            }
        }
    }
}

impl<L: Library, T: InputPin, W: FnMut()> Surroundings<L, MAX_SERVOS> for BoardSurroundings<'_, T, W> {
    async fn wait(&mut self, tick: u32) -> bool {
        let (due, now) = (self.due(tick), Instant::now());
        let late = !self.simulated && now >= self.due(tick.wrapping_add(1));
        if late {
            // Ticks that are caught up with come too fast for servos: the later ones are later, too.
            self.began += now - due;
        }
        Timer::at(due).await;
        self.ticks = tick;
        late
    }

    fn control(&mut self, machine: &mut Machine<'_, L, MAX_SERVOS>, _: &Feedback<'_>) -> bool {
        // A pin that cannot be read is not pressed.
        let pressed = self.trigger.is_low().unwrap_or(false);
        if pressed && !self.pressed {
            let command = match machine.fault() {
                Some(_) => Some(Command::Acknowledge),
                // There is memory for one decoder, so a clip cannot fade into itself.
                None => machine.at_rest().then_some(Command::Trigger),
            };
            if let Some(Err(error)) = command.map(|command| machine.command(command)) {
                defmt::warn!("trigger: {}", error);
            }
        }
        self.pressed = pressed;
        self.log(machine);
        !(self.simulated && machine.at_rest())
    }

    fn feed(&mut self) {
        (self.feed)();
    }
}
