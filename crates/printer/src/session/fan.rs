//! The part fan: its orders at the clocks of the plan, never closer together than the board should have to keep.
//!
//! Each order holds an entry of the board's move queue until its clock, so a file with thousands of them in a row must
//! not send them all. Its clocks are those of steps: where the board can hold its motion, the fan waits with it. Knows
//! nothing of G-code. Speeds are 0 ..= 1.

use units::{Seconds, Ticks};
use wire::Command;

use super::{board::Board, layout::Output};
use crate::config::FanConfig;

/// Two orders are at least this far apart; of those between, the last one counts.
const ORDER_GAP: Seconds = Seconds(0.1);

/// The part fan on the board.
#[derive(Debug)]
pub(super) struct Fan {
    output: Output,
    config: FanConfig,
    speed: f64,
    /// The last order: its clock and what it says.
    last: Option<(Ticks, u32)>,
    /// An order that came too soon after the last.
    waiting: Option<(Ticks, u32)>,
}

impl Fan {
    pub(super) const fn new(output: Output, config: FanConfig) -> Self {
        Self { output, config, speed: 0.0, last: None, waiting: None }
    }

    /// The last speed that was asked for.
    pub(super) const fn speed(&self) -> f64 {
        self.speed
    }

    /// A speed from a clock on, or from as soon as is safe.
    pub(super) fn set(&mut self, speed: f64, at: Option<Ticks>, board: &mut Board, now: Seconds) {
        self.speed = if speed > 0.0 { speed.min(1.0) } else { 0.0 };
        let on_ticks = self.output.on_ticks(self.config.duty(speed));
        let clock = at.unwrap_or_default().max(board.fan_clock(now));
        if let Some((due, waiting)) = self.waiting.take_if(|(due, _)| *due <= clock) {
            self.send(due.max(board.fan_clock(now)), waiting, board);
        }
        let earliest = self.last.map_or(Ticks(0), |(last, _)| last + board.ticks(ORDER_GAP));
        if clock >= earliest {
            self.send(clock, on_ticks, board);
        } else {
            self.waiting = Some((earliest, on_ticks));
        }
    }

    /// Sends an order that has waited for long enough.
    pub(super) fn poll(&mut self, board: &mut Board, now: Seconds) {
        let clock = board.fan_clock(now);
        let soon = clock + board.ticks(ORDER_GAP);
        if let Some((due, on_ticks)) = self.waiting.take_if(|(due, _)| *due <= soon) {
            self.send(due.max(clock), on_ticks, board);
        }
    }

    /// The board has dropped what waited for its time: what the fan does now, nobody knows.
    pub(super) const fn forget_orders(&mut self) {
        self.last = None;
        self.waiting = None;
    }

    fn send(&mut self, clock: Ticks, on_ticks: u32, board: &mut Board) {
        if self.last.is_some_and(|(_, last)| last == on_ticks) {
            return;
        }
        self.last = Some((clock, on_ticks));
        let oid = self.output.oid.0;
        board.fan_at(&Command::QueueDigitalOut { oid, clock: clock.low().0, on_ticks }, clock);
    }
}
