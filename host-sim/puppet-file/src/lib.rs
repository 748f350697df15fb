//! Reads `puppet.toml` and makes the joint map of it, which a Bunraku device plays clips with.
//!
//! A puppet.toml says which servo follows which channel of a skeleton. [`Puppet`] is such a file; [`Puppet::map`]
//! resolves the names of its channels and converts its units. Errors name the file, the line and the key.
//!
//! # Example
//!
//! ```
//! use puppet_file::{Channels, Owner, Puppet, Unit};
//! use std::path::Path;
//!
//! let text = "
//! servo_hz = 50
//! baud = 1_000_000
//!
//! [[joint]]
//! name = 'right elbow'
//! channel = 'rradius.rx'
//! id = 3
//! range = [-150, 0]
//! max_speed = 450
//! ";
//! let puppet = Puppet::parse(Path::new("puppet.toml"), text.to_owned())?;
//!
//! // The columns of the clips that the puppet will play.
//! let channels = [("root.ty", Unit::Centimetre), ("rradius.rx", Unit::Degree)];
//! let channels = Channels::new(Owner::Clip, channels.map(|(name, unit)| (name.to_owned(), unit)));
//! let map = puppet.map(channels.clone())?;
//! let elbow = map.joints()[0];
//! assert_eq!((elbow.channel, elbow.min, elbow.max), (1, 341, 2048));
//!
//! // A mistake is a sentence.
//! let wrong = Puppet::parse(Path::new("puppet.toml"), text.replace("rradius", "rradus"))?;
//! assert_eq!(
//!     wrong.map(channels).unwrap_err().to_string(),
//!     "puppet.toml, line 7, key \"channel\": the clip has no joint \"rradus\"; \
//!      the nearest channels are rradius.rx, root.ty",
//! );
//! # Ok::<(), puppet_file::Error>(())
//! ```
//!
//! # The file
//!
//! ```toml
//! skeleton = "02.asf"       # optional: where channel names are looked up, relative to this file
//! servo_hz = 50             # goals per second, 1 to 1000
//! baud = 1_000_000          # of the servo bus; Dynamixel protocol 2.0
//!
//! # All of these are optional; the values are those that hold where they are not given.
//! interpolation = "cubic"   # or "linear"
//! on_fault = "hold"         # or "home", "torque-off" (which drops a standing puppet)
//! ease_seconds = 2.0        # least time to a first pose, and home
//! ease_speed = 0.25         # part of each joint's max_speed that is used for it
//! fade_seconds = 0.5        # between clips
//! temperature_limit = 70    # degrees Celsius; 0: only what servos say themselves counts
//! min_volts = 0.0           # supply below which is a fault; 0: not looked at
//! servo_watchdog_ms = 200   # silence after which servos stop by themselves; 0: never
//!
//! [[joint]]
//! name = "right elbow"
//! channel = "rradius.rx"    # joint.axis of the skeleton
//! id = 3                    # of the servo, 0 to 252
//! zero = 1024               # goal at channel value 0; the middle of the servo unless given
//! direction = -1            # 1 (unless given) or -1
//! scale = 11.378            # goal units per degree or cm; the servo's own unless given (rotations only)
//! range = [0, 150]          # lowest and highest channel value, in degrees or cm
//! home = 10                 # channel value at rest; 0 unless given
//! max_speed = 270           # degrees or cm per second
//! max_acceleration = 5400   # degrees or cm per second squared; max_speed in 50 ms unless given
//! idle = { breathing = 1.0, sway = 0.5, gaze = 0.0 }  # degrees or cm that the idle layer adds at most; 0 unless given
//! model = "XM430-W350"      # optional, a name or a number: what `bunraku puppet scan` expects to find there
//! ```
//!
//! Instead of `range`, `goal_range = [min, max]` gives the range in goal units: those of the kind of servo.
//!
//! A puppet with other servos than Dynamixel X on one bus names its buses instead of `baud`, and each joint its bus:
//!
//! ```toml
//! [[bus]]
//! name = "face"
//! kind = "pca9685"          # dynamixel, dynamixel1, sts, scs, pwm, pca9685, blender
//! baud = 50                 # bits per second; of pwm and pca9685 the pulses per second
//!                           # (ids on these two are the numbers of their outputs, from 0)
//! ```

#![forbid(unsafe_code)]

mod bus_kind;
mod channels;
mod error;
mod file;
mod joint;
mod map;
pub mod models;
mod place;
mod puppet;

pub use bus_kind::bus_kind;
pub use channels::{Channels, MissingChannel, Owner, Unit};
pub use error::{Error, Problem};
pub use joint::goal_range;
pub use map::{Map, to_bytes};
pub use place::Place;
pub use puppet::{NamedServo, Puppet};
