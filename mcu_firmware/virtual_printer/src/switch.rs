//! A limit switch on an axis: closes where the carriage comes to it, and chatters as contacts do.
//!
//! Units: microsteps and ticks. Does not know: pins, polarity, what reads it.
//! Source: usual data of snap-action switches: 0.1 mm differential travel or less, bounce of one to two milliseconds.

use crate::random::Random;

/// Most edges of one bounce.
const BOUNCE_EDGES_MAX: usize = 9;
/// The contact is quiet after this time.
const BOUNCE_S: f64 = 0.0015;

/// At which end of the travel the switch sits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// It closes at and below its position.
    Min,
    /// It closes at and above its position.
    Max,
}

/// A switch at work.
#[derive(Clone, Debug)]
pub(crate) struct Switch {
    /// Where it closes and where it opens again, in microsteps; for [`Side::Max`] both negated, like the position.
    closes: f64,
    opens: f64,
    side: Side,
    pressed: bool,
    /// Clocks at which the contact changed, the first of them from the state before; odd in number.
    edges: [u64; BOUNCE_EDGES_MAX],
    edge_count: usize,
    bounce_ticks: u32,
    random: Random,
}

impl Switch {
    /// A switch that closes at `position` and opens `differential` further out; `rotor` is where the axis stands.
    pub(crate) fn new(
        side: Side,
        position: f64,
        differential: f64,
        clock_hz: u32,
        rotor: f64,
        random: Random,
    ) -> Self {
        let closes = side.towards(position);
        Self {
            closes,
            opens: closes + differential.abs(),
            side,
            pressed: side.towards(rotor) <= closes,
            edges: [0; BOUNCE_EDGES_MAX],
            edge_count: 0,
            bounce_ticks: (BOUNCE_S * f64::from(clock_hz)) as u32,
            random,
        }
    }

    /// The axis moved from `before` to `after` within `ticks` from `began`.
    #[inline]
    pub(crate) fn moved(&mut self, before: f64, after: f64, began: u64, ticks: u64) {
        let (before, after) = (self.side.towards(before), self.side.towards(after));
        let limit = if self.pressed { self.opens } else { self.closes };
        if self.pressed == (after <= limit) {
            return;
        }
        let way = after - before;
        let part = if way == 0.0 { 0.0 } else { ((limit - before) / way).clamp(0.0, 1.0) };
        self.change(began + (part * ticks as f64) as u64);
    }

    /// The contact changes at a clock, with its chatter.
    fn change(&mut self, at: u64) {
        self.pressed = !self.pressed;
        // Closing chatters; opening parts the contacts at once or nearly so.
        let pairs = if self.pressed { 1 + self.random.below(4) } else { self.random.below(2) } as usize;
        self.edge_count = 1 + 2 * pairs;
        self.edges[0] = at;
        let mut clock = at;
        for index in 1..self.edge_count {
            // Each gap leaves room for the rest within the bounce.
            let share = self.bounce_ticks / (self.edge_count as u32);
            clock += u64::from(1 + self.random.below(share.max(1)));
            self.edges[index] = clock;
        }
    }

    /// Whether the contact is closed at `now`.
    pub(crate) fn closed(&self, now: u64) -> bool {
        let to_come = self.edges[..self.edge_count].iter().filter(|&&edge| edge > now).count();
        self.pressed ^ (to_come % 2 == 1)
    }
}

impl Side {
    /// Positions counted towards the switch from within the travel are falling.
    fn towards(self, position: f64) -> f64 {
        match self {
            Self::Min => position,
            Self::Max => -position,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Source;

    const CLOCK_HZ: u32 = 12_000_000;

    fn switch(side: Side) -> Switch {
        Switch::new(side, 0.0, 5.0, CLOCK_HZ, 1000.0 * side.towards(1.0), Random::new(3, Source::Bounce(0)))
    }

    fn levels(switch: &Switch, from: u64, to: u64) -> Vec<bool> {
        (from..to).step_by(12).map(|clock| switch.closed(clock)).collect()
    }

    #[test]
    fn it_chatters_on_closing_and_is_quiet_after_the_bounce() {
        let mut chattered = false;
        let mut switch = switch(Side::Min);
        for round in 1..20 {
            let at = round * 1_000_000;
            switch.moved(1000.0, -10.0, at, 1000);
            let seen = levels(&switch, at, at + 30_000);
            chattered |= seen.windows(2).filter(|pair| pair[0] != pair[1]).count() > 1;
            assert!(seen.last().copied().unwrap_or(false), "closed in the end");
            assert!(levels(&switch, at + 1000 + 18_000, at + 30_000).iter().all(|&closed| closed));
            switch.moved(-10.0, 1000.0, at + 500_000, 1000);
            assert!(!switch.closed(at + 530_000));
        }
        assert!(chattered);
    }

    #[test]
    fn a_switch_at_the_far_end_closes_above_its_position() {
        let mut switch = switch(Side::Max);
        assert!(!switch.closed(5));
        switch.moved(-1000.0, 1.0, 10, 100);
        assert!(switch.closed(100_000));
    }

    #[test]
    fn it_opens_further_out_than_it_closes() {
        let mut switch = switch(Side::Min);
        switch.moved(10.0, -1.0, 0, 100);
        switch.moved(-1.0, 4.0, 100_000, 100);
        assert!(switch.closed(200_000));
        switch.moved(4.0, 6.0, 300_000, 100);
        assert!(!switch.closed(400_000));
    }
}
