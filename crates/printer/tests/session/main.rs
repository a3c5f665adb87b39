//! Whole sessions against the virtual printer: what is asked for happens, and whatever goes wrong ends with its own
//! error and a machine that is safe.

mod asked_again;
mod attach;
mod bench;
mod console;
mod coupled;
mod faults;
mod filters;
mod heaters;
mod hold;
mod homing;
mod kept;
mod level;
mod link;
mod machine;
mod pause;
mod power;
mod print;
mod rate;
mod start;
mod stopping;
