//! The virtual printer as a host meets it, through its public interface.

mod board;
mod hold;
mod host;
mod motion;
