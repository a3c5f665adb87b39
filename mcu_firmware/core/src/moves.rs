//! The pool of queued moves that all steppers and outputs share, and the queues made of its entries.
//!
//! The host is told how many there are (`move_count`) and keeps account of them; a host that queues more is shut down.

use wire::ShutdownReason;

const NONE: u16 = u16::MAX;

/// The most entries a pool can have.
pub(crate) const MOVES_MAX: usize = NONE as usize - 1;

/// One queued `queue_step` or `queue_digital_out`, in the same twelve bytes.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    first: u32,
    second: u32,
    flag: bool,
    next: u16,
}

/// A `queue_step` with the direction it is to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct StepMove {
    pub(crate) interval: u32,
    pub(crate) count: u16,
    pub(crate) add: i16,
    pub(crate) forward: bool,
}

/// A `queue_digital_out`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutputMove {
    pub(crate) clock: u32,
    pub(crate) on_ticks: u32,
}

impl From<StepMove> for Entry {
    fn from(step: StepMove) -> Self {
        let second = u32::from(step.count) | u32::from(step.add as u16) << 16;
        Self { first: step.interval, second, flag: step.forward, next: NONE }
    }
}

impl From<Entry> for StepMove {
    fn from(entry: Entry) -> Self {
        Self {
            interval: entry.first,
            count: entry.second as u16,
            add: (entry.second >> 16) as i16,
            forward: entry.flag,
        }
    }
}

impl From<OutputMove> for Entry {
    fn from(output: OutputMove) -> Self {
        Self { first: output.clock, second: output.on_ticks, flag: false, next: NONE }
    }
}

impl From<Entry> for OutputMove {
    fn from(entry: Entry) -> Self {
        Self { clock: entry.first, on_ticks: entry.second }
    }
}

/// One object's entries, oldest first. Whoever drops a queue must [`MovePool::clear`] it, or reset the whole pool.
#[derive(Clone, Copy)]
pub(crate) struct Queue {
    first: u16,
    last: u16,
}

impl Queue {
    pub(crate) const fn new() -> Self {
        Self { first: NONE, last: NONE }
    }

    pub(crate) const fn is_empty(self) -> bool {
        self.first == NONE
    }
}

/// The entries, `N` at most.
pub(crate) struct MovePool<const N: usize> {
    entries: [Entry; N],
    /// A list of entries that were used before and are free again.
    free: u16,
    /// Entries from here on have never been used.
    untouched: u16,
    limit: u16,
}

impl<const N: usize> MovePool<N> {
    pub(crate) const fn new() -> Self {
        assert!(N <= MOVES_MAX, "moves are numbered by two bytes");
        Self {
            entries: [Entry { first: 0, second: 0, flag: false, next: NONE }; N],
            free: NONE,
            untouched: 0,
            limit: N as u16,
        }
    }

    /// How many entries may be in use.
    pub(crate) const fn limit(&self) -> u16 {
        self.limit
    }

    /// Uses fewer entries than there are.
    pub(crate) const fn set_limit(&mut self, limit: u16) {
        if (limit as usize) < N {
            self.limit = limit;
        }
    }

    /// Frees every entry; queues made of them are void.
    pub(crate) const fn reset(&mut self) {
        self.free = NONE;
        self.untouched = 0;
    }

    /// Appends to a queue.
    pub(crate) fn push(&mut self, queue: &mut Queue, entry: impl Into<Entry>) -> Result<(), ShutdownReason> {
        let at = self.take().ok_or(ShutdownReason::MoveQueueOverflow)?;
        self.entries[usize::from(at)] = entry.into();
        match self.entries.get_mut(usize::from(queue.last)) {
            Some(last) => last.next = at,
            None => queue.first = at,
        }
        queue.last = at;
        Ok(())
    }

    /// The oldest entry of a queue.
    pub(crate) fn front<T: From<Entry>>(&self, queue: Queue) -> Option<T> {
        self.entries.get(usize::from(queue.first)).map(|&entry| entry.into())
    }

    /// Takes the oldest entry out of a queue.
    pub(crate) fn pop<T: From<Entry>>(&mut self, queue: &mut Queue) -> Option<T> {
        let at = queue.first;
        let entry = self.entries.get_mut(usize::from(at))?;
        queue.first = entry.next;
        if queue.first == NONE {
            queue.last = NONE;
        }
        let taken = *entry;
        entry.next = self.free;
        self.free = at;
        Some(taken.into())
    }

    /// Frees all entries of a queue, in one stroke however many they are.
    pub(crate) fn clear(&mut self, queue: &mut Queue) {
        if let Some(last) = self.entries.get_mut(usize::from(queue.last)) {
            last.next = self.free;
            self.free = queue.first;
        }
        *queue = Queue::new();
    }

    fn take(&mut self) -> Option<u16> {
        let at = self.free;
        if let Some(entry) = self.entries.get(usize::from(at)) {
            self.free = entry.next;
            return Some(at);
        }
        let at = self.untouched;
        (at < self.limit).then(|| {
            self.untouched += 1;
            at
        })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    #[test]
    fn an_entry_is_twelve_bytes() {
        assert_eq!(size_of::<Entry>(), 12);
    }

    #[test]
    fn the_limit_counts_entries_in_use() {
        let mut pool = MovePool::<8>::new();
        pool.set_limit(2);
        let mut queue = Queue::new();
        let output = OutputMove { clock: 1, on_ticks: 2 };
        assert!(pool.push(&mut queue, output).is_ok());
        assert!(pool.push(&mut queue, output).is_ok());
        assert_eq!(pool.push(&mut queue, output), Err(ShutdownReason::MoveQueueOverflow));
        assert_eq!(pool.pop(&mut queue), Some(output));
        assert!(pool.push(&mut queue, output).is_ok());
    }

    proptest! {
        #[test]
        fn queues_that_share_a_pool_do_not_mix(operations in prop::collection::vec((0..3_u8, 0..3_usize, any::<StepArgs>()), 0..300)) {
            const N: usize = 10;
            let mut pool = MovePool::<N>::new();
            let mut queues = [Queue::new(); 3];
            let mut models = [const { VecDeque::<StepMove>::new() }; 3];
            for (operation, which, args) in operations {
                match operation {
                    0 => {
                        pool.clear(&mut queues[which]);
                        models[which].clear();
                    }
                    1 => prop_assert_eq!(pool.pop(&mut queues[which]), models[which].pop_front()),
                    _ => {
                        let full = models.iter().map(VecDeque::len).sum::<usize>() == N;
                        let pushed = pool.push(&mut queues[which], args.0);
                        prop_assert_eq!(pushed.is_err(), full);
                        if pushed.is_ok() {
                            models[which].push_back(args.0);
                        }
                    }
                }
                for (queue, model) in queues.iter().zip(&models) {
                    prop_assert_eq!(pool.front(*queue), model.front().copied());
                }
            }
        }
    }

    #[derive(Clone, Copy, Debug)]
    struct StepArgs(StepMove);

    impl Arbitrary for StepArgs {
        type Parameters = ();
        type Strategy = BoxedStrategy<Self>;
        fn arbitrary_with((): ()) -> Self::Strategy {
            any::<(u32, u16, i16, bool)>()
                .prop_map(|(interval, count, add, forward)| Self(StepMove { interval, count, add, forward }))
                .boxed()
        }
    }
}
