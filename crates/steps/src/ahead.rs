//! Where a command's last step comes within its window: what follows starts there.
//!
//! The usual way costs no search: the third difference of the times that follow says to which side they bend away, and the
//! command ends as far over there as its `add` allows. Looking ahead finds more: the next command is searched from
//! the end nearest to the last step's time, what blocks it says which side would help, and it is searched again from ends on that
//! side, of commands as long or a few steps shorter. What takes fewest bytes for the way that both go is taken.

use crate::stabbing::{Block, Fit, Stabbing, smaller};
use crate::windows::Steps;
use core::mem::swap;

/// Longer commands end without a look ahead: they are few, and their search is dear.
pub(crate) const AHEAD_STEPS_MAX: u32 = 128;
/// So much shorter a command may end, to leave a better start.
const SHORTER_MAX: u32 = 2;
/// Values of `add` tried for an end, when looking ahead.
const TRIES_AHEAD: u32 = 8;
/// What the room that the next command has left for its own end is worth, in steps for all of its window.
const PLAY_WORTH: f64 = 0.1;
/// Third differences are taken over this share of a command's steps, but not over more than so many.
const BEND_SHARE: u32 = 10;
const BEND_STEPS_MAX: u32 = 400;

/// How a command ends without a look at the next; `None` while too few steps are known. Where `ends`, no more follow.
pub(crate) fn usual_end(found: &Stabbing, steps: &Steps<'_>, ends: bool) -> Option<Fit> {
    let count = found.passed();
    let usual = ((count + BEND_SHARE / 2) / BEND_SHARE).clamp(1, BEND_STEPS_MAX) as usize;
    let beyond = steps.times.len() - count as usize;
    let apart = if 3 * usual <= beyond {
        usual
    } else if ends {
        beyond / 3
    } else {
        return None;
    };
    if apart == 0 || count == 0 {
        return Some(found.fit(steps));
    }
    let time = |number: usize| steps.times[count as usize - 1 + number * apart];
    let bend = time(3) - time(0) - 3.0 * (time(2) - time(1));
    Some(found.bent(count, found.add(), bend > 0.0, 0))
}

/// A look at what follows a command.
#[derive(Clone, Debug)]
pub(crate) struct Ahead {
    /// Ways to end the command; the first is the one nearest to its last step's time.
    ends: Vec<Fit>,
    /// The one that is looked at …
    at: usize,
    /// … and what would follow it.
    trial: Stabbing,
    /// The best so far …
    best: usize,
    /// … and what would follow that.
    next: Stabbing,
    best_worth: f64,
    /// What a step of what follows takes, bytes.
    price: f64,
}

impl Ahead {
    pub(crate) fn new() -> Self {
        let (trial, next) = (Stabbing::new(), Stabbing::new());
        Self { ends: Vec::new(), at: 0, trial, best: 0, next, best_worth: 0.0, price: 0.0 }
    }

    /// Begins anew.
    pub(crate) fn clear(&mut self) {
        self.ends.clear();
        self.trial.clear();
        self.next.clear();
        (self.at, self.best) = (0, 0);
    }

    /// Decides how the command `found` for `steps` ends; `None` while too few of them are known. Where `ends`, no more follow.
    pub(crate) fn choose(&mut self, found: &Stabbing, steps: &Steps<'_>, ends: bool) -> Option<Fit> {
        if self.ends.is_empty() {
            self.ends.push(found.fit(steps));
        }
        while let Some(&end) = self.ends.get(self.at) {
            let rest = steps.after(end.count as usize, end.end());
            if rest.times.is_empty() {
                return ends.then_some(end);
            }
            if self.trial.is_fresh() {
                self.trial.expect(end.count);
            }
            if !self.trial.extend(&rest) {
                if !ends {
                    return None;
                }
                self.trial.finish(&rest);
            }
            self.weigh(&end, &rest, found);
            self.trial.clear();
            self.at += 1;
        }
        Some(self.ends[self.best])
    }

    /// Puts the search of what follows the chosen end into `search`, and begins anew.
    pub(crate) fn go_on(&mut self, search: &mut Stabbing) {
        swap(search, &mut self.next);
        self.clear();
    }

    /// Whether the end that is looked at is the best so far.
    fn weigh(&mut self, end: &Fit, rest: &Steps<'_>, found: &Stabbing) {
        let next = self.trial.fit(rest);
        let count = f64::from(next.count);
        if self.at == 0 {
            self.price = f64::from(next.bytes()) / count;
        }
        let play = self.trial.play() / (2.0 * rest.errors[next.count as usize - 1]);
        let way = f64::from(end.count) + count + PLAY_WORTH * smaller(play, 1.0);
        let worth = self.price * way - f64::from(end.bytes() + next.bytes());
        if self.at == 0 || worth > self.best_worth {
            (self.best, self.best_worth) = (self.at, worth);
            swap(&mut self.trial, &mut self.next);
        }
        if self.at == 0
            && let Some(block) = self.next.block()
        {
            // What comes too late for a start in the middle comes in time for a later one.
            let is_late = block == Block::Above;
            let shortest = end.count.saturating_sub(SHORTER_MAX).max(1);
            let mut add = end.add;
            for count in (shortest..=end.count).rev() {
                let bent = found.bent(count, add, is_late, TRIES_AHEAD);
                add = bent.add;
                self.ends.push(bent);
            }
        }
    }
}
