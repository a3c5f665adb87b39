//! What a host and an oscilloscope see of the firmware core: every test speaks blocks and looks at pins.

mod bench;
mod block_check;
mod faults;
mod heaters;
mod hold;
mod homing;
mod inputs;
mod lease;
mod link;
mod outputs;
mod oven;
mod progress;
mod random;
mod replay;
mod steps;
