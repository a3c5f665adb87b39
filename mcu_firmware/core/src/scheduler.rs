//! Timers on a 32-bit clock that wraps: one timer an object, in a list sorted by time and linked through the objects'
//! numbers.
//!
//! Few timers run at a time (the moving steppers, a sensor, a software PWM), so that a list is shorter work than any
//! heap. Knows nothing of what the timers are for, nor which clock it counts: a second instance can run on a motion
//! clock of its own.

use units::Clock32;

/// No timer.
const NONE: u8 = u8::MAX;

/// The most timers one list can hold.
pub(crate) const TIMERS_MAX: usize = NONE as usize;

#[derive(Clone, Copy)]
struct Node {
    wake: Clock32,
    next: u8,
    active: bool,
}

/// How far back the clocks that are told apart reach: a timer may be late, and the clock goes on between two looks.
const BEHIND_TICKS: u32 = 1 << 30;

/// At most one timer for each number below `N`, due from a little before the clock last seen to 2³¹ ticks after.
pub(crate) struct Timers<const N: usize> {
    /// No timer is due before this clock: they are ordered by the distance from it, so that a late one and one that is
    /// 2³¹ ticks ahead do not change places.
    epoch: Clock32,
    nodes: [Node; N],
    head: u8,
}

impl<const N: usize> Timers<N> {
    pub(crate) const fn new() -> Self {
        assert!(N <= TIMERS_MAX, "timers are numbered by a byte");
        Self {
            nodes: [Node { wake: Clock32(0), next: NONE, active: false }; N],
            head: NONE,
            epoch: Clock32(0),
        }
    }

    /// Sees the clock. Has to be shown it at least once in every 2³⁰ ticks.
    #[inline]
    pub(crate) fn look(&mut self, now: Clock32) {
        self.epoch = now.wrapping_add(BEHIND_TICKS.wrapping_neg());
    }

    #[inline]
    const fn is_before(&self, wake: Clock32, other: Clock32) -> bool {
        wake.0.wrapping_sub(self.epoch.0) < other.0.wrapping_sub(self.epoch.0)
    }

    /// The timer that is due first.
    #[inline]
    pub(crate) fn first(&self) -> Option<(u8, Clock32)> {
        self.nodes.get(usize::from(self.head)).map(|node| (self.head, node.wake))
    }

    /// Starts a timer, or moves one that runs. Among equal times, the one that came first goes first.
    pub(crate) fn schedule(&mut self, id: u8, wake: Clock32) {
        self.cancel(id);
        self.insert(id, wake);
    }

    /// Moves the first timer to a later time.
    #[inline]
    pub(crate) fn reschedule_first(&mut self, wake: Clock32) {
        let id = self.head;
        let Some(node) = self.nodes.get_mut(usize::from(id)) else { return };
        node.wake = wake;
        let second = node.next;
        if let Some(next) = self.nodes.get(usize::from(second))
            && !self.is_before(wake, next.wake)
        {
            self.head = second;
            self.insert_after(second, id, wake);
        }
    }

    /// Stops a timer; nothing happens when it does not run.
    #[inline(never)]
    pub(crate) fn cancel(&mut self, id: u8) {
        let Some(node) = self.nodes.get_mut(usize::from(id)).filter(|node| node.active) else { return };
        node.active = false;
        let next = node.next;
        if self.head == id {
            self.head = next;
            return;
        }
        let mut at = self.head;
        while let Some(node) = self.nodes.get_mut(usize::from(at)) {
            if node.next == id {
                node.next = next;
                return;
            }
            at = node.next;
        }
    }

    /// Stops all timers.
    pub(crate) fn clear(&mut self) {
        *self = Self { epoch: self.epoch, ..Self::new() };
    }

    fn insert(&mut self, id: u8, wake: Clock32) {
        let Some(node) = self.nodes.get_mut(usize::from(id)) else { return };
        node.active = true;
        let head = self.head;
        match self.nodes.get(usize::from(head)) {
            Some(first) if !self.is_before(wake, first.wake) => self.insert_after(head, id, wake),
            _ => {
                let node = &mut self.nodes[usize::from(id)];
                node.wake = wake;
                node.next = head;
                self.head = id;
            }
        }
    }

    /// Puts `id` into the list behind `at`, whose time is not later, and behind all others that are not later.
    #[inline]
    fn insert_after(&mut self, mut at: u8, id: u8, wake: Clock32) {
        let mut next = self.nodes[usize::from(at)].next;
        while let Some(node) = self.nodes.get(usize::from(next)) {
            if self.is_before(wake, node.wake) {
                break;
            }
            at = next;
            next = node.next;
        }
        self.nodes[usize::from(at)].next = id;
        let node = &mut self.nodes[usize::from(id)];
        node.wake = wake;
        node.next = next;
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    const N: usize = 12;

    fn drain(timers: &mut Timers<N>) -> Vec<(u8, Clock32)> {
        let mut order = Vec::new();
        while let Some((id, wake)) = timers.first() {
            order.push((id, wake));
            timers.cancel(id);
        }
        order
    }

    #[test]
    fn equal_times_run_in_the_order_of_their_coming() {
        let mut timers = Timers::<N>::new();
        timers.look(Clock32(u32::MAX));
        for id in [3, 1, 2] {
            timers.schedule(id, Clock32(u32::MAX));
        }
        timers.schedule(0, Clock32(2));
        timers.reschedule_first(Clock32(u32::MAX));
        let order: Vec<_> = drain(&mut timers).iter().map(|&(id, _)| id).collect();
        assert_eq!(order, [1, 2, 3, 0]);
    }

    #[test]
    fn a_late_timer_goes_before_one_as_far_ahead_as_can_be() {
        for now in [0, 5, u32::MAX - 5, 1 << 31].map(Clock32) {
            let mut timers = Timers::<N>::new();
            timers.look(now);
            timers.schedule(1, now.wrapping_add(i32::MAX as u32));
            timers.schedule(0, now);
            timers.reschedule_first(now.wrapping_add(10_u32.wrapping_neg()));
            timers.schedule(2, now.wrapping_add(5_u32.wrapping_neg()));
            let order: Vec<_> = drain(&mut timers).iter().map(|&(id, _)| id).collect();
            assert_eq!(order, [0, 2, 1]);
        }
    }

    proptest! {
        #[test]
        fn it_agrees_with_a_sorted_list(base: u32, operations in prop::collection::vec((0..3_u8, 0..N as u8, 0..1000_i32), 0..200)) {
            let mut timers = Timers::<N>::new();
            timers.look(Clock32(base));
            let mut model: Vec<(u8, i32)> = Vec::new();
            let insert = |model: &mut Vec<(u8, i32)>, id, at| {
                let place = model.iter().position(|&(_, other)| other > at).unwrap_or(model.len());
                model.insert(place, (id, at));
            };
            for (operation, id, at) in operations {
                let wake = Clock32(base.wrapping_add_signed(at));
                match operation {
                    0 => {
                        model.retain(|&(other, _)| other != id);
                        timers.cancel(id);
                    }
                    1 => {
                        model.retain(|&(other, _)| other != id);
                        insert(&mut model, id, at);
                        timers.schedule(id, wake);
                    }
                    _ => {
                        if !model.is_empty() {
                            let (first, _) = model.remove(0);
                            insert(&mut model, first, at);
                        }
                        timers.reschedule_first(wake);
                    }
                }
                prop_assert_eq!(timers.first().map(|(id, _)| id), model.first().map(|&(id, _)| id));
            }
            let expected: Vec<_> =
                model.iter().map(|&(id, at)| (id, Clock32(base.wrapping_add_signed(at)))).collect();
            prop_assert_eq!(drain(&mut timers), expected);
        }
    }
}
