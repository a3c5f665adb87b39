//! Does the heater do what it is told? A heater that does not warm has a loose sensor or a dead cartridge, and full
//! power on a loose sensor is how fires start.
//!
//! While heating up the temperature must rise by `gain` within every `gain_time`; once there, the time integral of how
//! far it lies below `target - hysteresis` must stay under `max_error`. Temperatures in 1/1000 °C, times in 1/1024 s.
//!
//! Source: the meaning of `[verify_heater]` in Klipper's public documentation (docs/Config_Reference.md).

use wire::ShutdownReason;

use super::control::SECOND_BITS;

pub(crate) struct Check {
    max_error: i64,
    gain_time: i64,
    hysteresis: i32,
    gain: i32,
    target: i32,
    state: State,
    /// Below the band since the last time all was well, in 1/1000 °C by 1/1024 s.
    error: i64,
}

enum State {
    /// Within the band, or off: nothing to watch.
    Content,
    /// On its way up: it has to reach `goal` before `left` is over.
    Climbing { goal: i32, left: i64, first: bool },
    /// Below the band without climbing: the error adds up.
    Low { never_rose: bool },
}

impl Check {
    /// `max_error` in 1/1000 °C·s; `gain_time` in 1/1024 s.
    pub(crate) fn new(max_error: u32, gain_time: i64, hysteresis: i32, gain: i32) -> Self {
        let max_error = i64::from(max_error) << SECOND_BITS;
        Self { max_error, gain_time, hysteresis, gain, target: 0, state: State::Content, error: 0 }
    }

    /// Forgets what was seen: what comes next is another story.
    pub(crate) const fn restart(&mut self) {
        self.target = 0;
        self.state = State::Content;
        self.error = 0;
    }

    /// Looks at a reading `dt` after the one before.
    pub(crate) fn look(&mut self, milli: i32, target: i32, dt: i64) -> Result<(), ShutdownReason> {
        let is_new = target != self.target;
        self.target = target;
        let below = i64::from(target) - i64::from(self.hysteresis) - i64::from(milli);
        if target <= 0 || below <= 0 {
            self.state = State::Content;
            self.error = 0;
            return Ok(());
        }
        // A climb goes on whatever the new target is: one that changes all the time must not put the check off.
        if is_new && !matches!(self.state, State::Climbing { .. }) {
            self.climb_from(milli, true);
            return Ok(());
        }
        self.error = self.error.saturating_add(below * dt);
        match &mut self.state {
            State::Content => self.state = State::Low { never_rose: false },
            State::Climbing { goal, .. } if milli >= *goal => self.climb_from(milli, false),
            State::Climbing { left, first, .. } if *left <= dt => {
                // The error of the climb counts: a heater far below its target has none of it to spare.
                self.state = State::Low { never_rose: *first };
            }
            State::Climbing { goal, left, first } => {
                *left -= dt;
                if *first {
                    // A block that still cools from before may fall first: the gain counts from the lowest point.
                    *goal = (*goal).min(milli.saturating_add(self.gain));
                }
            }
            State::Low { .. } => {}
        }
        match self.state {
            State::Low { never_rose } if self.error >= self.max_error => {
                Err(if never_rose { ShutdownReason::HeaterNotHeating } else { ShutdownReason::HeaterDrifted })
            }
            _ => Ok(()),
        }
    }

    const fn climb_from(&mut self, milli: i32, first: bool) {
        self.error = 0;
        self.state = State::Climbing { goal: milli.saturating_add(self.gain), left: self.gain_time, first };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1 << SECOND_BITS;

    fn check() -> Check {
        Check::new(120_000, 20 * SECOND, 5_000, 2_000)
    }

    /// Until when a temperature that changes evenly is borne, in s.
    fn lasts(
        check: &mut Check,
        from: i32,
        by_a_second: i32,
        target: i32,
    ) -> Result<i32, (i32, ShutdownReason)> {
        for second in 0..600 {
            let milli = from + second * by_a_second;
            check.look(milli, target, SECOND).map_err(|reason| (second, reason))?;
            if milli >= target {
                return Ok(second);
            }
        }
        Ok(600)
    }

    #[test]
    fn a_climb_is_enough_and_standing_still_is_not() {
        assert_eq!(lasts(&mut check(), 20_000, 1_000, 200_000), Ok(180));
        assert_eq!(lasts(&mut check(), 20_000, 0, 200_000), Err((20, ShutdownReason::HeaterNotHeating)));
        assert_eq!(lasts(&mut check(), 20_000, 99, 200_000), Err((20, ShutdownReason::HeaterNotHeating)));
        assert_eq!(lasts(&mut check(), 20_000, 101, 40_000), Ok(199));
    }

    #[test]
    fn what_was_warm_may_not_get_lost() {
        let mut check = check();
        assert_eq!(check.look(200_000, 200_000, SECOND), Ok(()));
        assert_eq!(lasts(&mut check, 194_000, 0, 200_000), Err((119, ShutdownReason::HeaterDrifted)));
    }

    #[test]
    fn targets_that_keep_changing_do_not_put_it_off() {
        let mut check = check();
        let found = (0..60).find_map(|second| check.look(20_000, 200_000 + second % 2, SECOND).err());
        assert_eq!(found, Some(ShutdownReason::HeaterNotHeating));
    }

    #[test]
    fn a_lower_target_is_nothing_to_worry_about() {
        let mut check = check();
        for second in 0..600 {
            let milli = 200_000 - 100 * second;
            assert_eq!(check.look(milli.max(139_000), 140_000, SECOND), Ok(()));
        }
        check.restart();
        assert_eq!(check.look(20_000, 140_000, SECOND), Ok(()));
    }
}
