//! The servo buses of the firmware against servos that share no code with them, on a simulated wire in simulated time.

mod clients;
mod faults;
mod fuzz;
mod sdk;
mod servos1;
mod servos2;
mod session;
mod tick;
mod whole;
mod wire;
