//! A heater that the board regulates by itself (docs/board-heaters.md): it is told a target, and says what it does.
//!
//! When the host falls silent the board lowers the heater to stand-by; the host's return does not raise it again, only a
//! target that is set anew. Knows no sensor and no loop.

use units::{Celsius, Oid, Seconds};
use wire::Command;

use super::board::Board;
use crate::heater::board::{celsius, duty, milli};

/// The host counts as alive for so long after each renewal: short stalls leave the heaters as they are.
const ALIVE: Seconds = Seconds(5.0);
/// How often the lease is renewed.
const RENEW: Seconds = Seconds(0.5);
/// A board that has not taken a target over after so long has lost its host in between.
const TAKE_OVER_MAX: Seconds = Seconds(3.0);

/// A `heater_state` as it came.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HeaterReport {
    pub(super) oid: u8,
    /// What is held; 0 is off.
    target: Celsius,
    /// 0 ..= 1.
    duty: f64,
    /// The board follows the host no more.
    has_fallen: bool,
}

impl HeaterReport {
    /// As the wire's numbers say.
    pub(super) fn new(oid: u8, target: i32, power: u16, state: u8) -> Self {
        Self { oid, target: celsius(target), duty: duty(power), has_fallen: matches!(state, 2 | 3) }
    }
}

/// The lease of all heaters.
#[derive(Debug)]
pub(super) struct HeaterLease {
    told: Seconds,
}

impl Default for HeaterLease {
    fn default() -> Self {
        Self { told: Seconds(f64::NEG_INFINITY) }
    }
}

impl HeaterLease {
    /// Vouches for the host, now.
    pub(super) fn tell(&mut self, board: &mut Board, now: Seconds) {
        self.told = now;
        let alive = board.clock_at(now) + board.ticks(ALIVE);
        board.control(&Command::HeaterLease { alive: alive.low().0 });
    }

    /// Vouches for it when that is due.
    pub(super) fn renew(&mut self, board: &mut Board, now: Seconds) {
        if now - self.told >= RENEW {
            self.tell(board, now);
        }
    }
}

/// What the board does with a heater.
#[derive(Debug)]
pub(super) struct BoardHeater {
    oid: Oid,
    standby: Celsius,
    standby_time: Seconds,
    /// When a target was set that the board has not confirmed, and which.
    asked: Option<(Seconds, Celsius)>,
    /// The board's last word.
    last: Option<HeaterReport>,
}

impl BoardHeater {
    /// A heater of which nothing is known; asks for its state.
    pub(super) fn start(oid: Oid, standby: Celsius, standby_time: Seconds, board: &mut Board) -> Self {
        board.control(&Command::HeaterGetState { oid: oid.0 });
        Self { oid, standby, standby_time, asked: None, last: None }
    }

    pub(super) const fn oid(&self) -> u8 {
        self.oid.0
    }

    /// Sets a target. The lease has to be told before, or it is stand-by from the start.
    pub(super) fn set(&mut self, target: Celsius, board: &mut Board, now: Seconds) {
        self.asked = Some((now, target));
        if let Some(last) = &mut self.last {
            last.has_fallen = false;
        }
        board.control(&Command::HeaterSet {
            oid: self.oid.0,
            target: milli(target),
            standby: milli(self.standby),
            standby_s: self.standby_time.0 as u16,
        });
    }

    /// The share of time that it is on.
    pub(super) fn duty(&self) -> f64 {
        self.last.map_or(0.0, |last| last.duty)
    }

    /// Whether the board has lowered it because the host fell silent.
    pub(super) fn has_fallen(&self) -> bool {
        self.last.is_some_and(|last| last.has_fallen)
    }

    /// Takes the board's word. Gives what it is held at now, and whether it has just fallen to stand-by; nothing for a
    /// word from before the last target came to the board.
    pub(super) fn receive(&mut self, report: HeaterReport, now: Seconds) -> Option<(Celsius, bool)> {
        if let Some((since, target)) = self.asked {
            let is_taken = !report.has_fallen && milli(report.target) == milli(target);
            if !is_taken && now - since < TAKE_OVER_MAX {
                return None;
            }
            self.asked = None;
        }
        let falls = report.has_fallen && self.last.is_some_and(|last| !last.has_fallen);
        self.last = Some(report);
        Some((report.target, falls))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heater(board: &mut Board) -> BoardHeater {
        BoardHeater::start(Oid(3), Celsius(140.0), Seconds(60.0), board)
    }

    #[test]
    fn words_from_before_a_target_do_not_count() {
        let config =
            crate::config::parse(include_str!("../../../../samples/printer.cfg")).0.expect("a machine");
        let mut board = Board::for_tests(&config);
        let mut heater = heater(&mut board);
        let report = |target, state| HeaterReport::new(3, target, 2048, state);
        // A board that had another host before: its state is taken as it is.
        assert_eq!(heater.receive(report(140_000, 2), Seconds(0.0)), Some((Celsius(140.0), false)));
        assert!(heater.has_fallen() && heater.duty() == 0.5);
        heater.set(Celsius(200.0), &mut board, Seconds(1.0));
        assert!(!heater.has_fallen());
        assert_eq!(heater.receive(report(140_000, 2), Seconds(1.2)), None);
        assert_eq!(heater.receive(report(200_000, 1), Seconds(1.3)), Some((Celsius(200.0), false)));
        assert_eq!(heater.receive(report(140_000, 2), Seconds(1.4)), Some((Celsius(140.0), true)));
        assert_eq!(heater.receive(report(0, 3), Seconds(1.5)), Some((Celsius(0.0), false)));
        // One that never came to the board, or too late.
        heater.set(Celsius(200.0), &mut board, Seconds(2.0));
        assert_eq!(heater.receive(report(140_000, 2), Seconds(5.1)), Some((Celsius(140.0), true)));
    }
}
