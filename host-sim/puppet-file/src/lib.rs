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
//! All keys are in docs/PUPPET.md of the project, which a test compares with the parser.

#![forbid(unsafe_code)]

mod bus_kind;
mod channels;
mod error;
mod file;
mod follows;
mod joint;
mod map;
pub mod models;
mod place;
mod plan;
mod puppet;
mod recover;

pub use channels::{Channels, MissingChannel, Owner, Unit};
pub use error::{Error, Problem};
pub use joint::Units;
pub use map::{Map, to_bytes};
pub use place::Place;
pub use puppet::{NamedServo, Puppet};
