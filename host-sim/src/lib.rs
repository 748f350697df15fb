//! The parts of the command `bunraku` that tests and boards use as a library.

pub mod servos;
