//! What the host configured, by oid.

use units::Clock32;
use wire::ShutdownReason;

use crate::{
    analog_in::AnalogIn, board::Board, digital_out::DigitalOut, endstop::Endstop, stepper::Stepper,
    trsync::Trsync,
};

/// What an object's timer wants next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum After {
    /// To rest.
    Done,
    /// To be woken again.
    Again(Clock32),
    /// To rest, and a trigger to be fired.
    Fire {
        /// The trigger's oid.
        trsync: u8,
        /// The reason it is to give.
        reason: u8,
    },
}

pub(crate) enum Object {
    /// Allocated or not, but not configured.
    Free,
    Stepper(Stepper),
    Trsync(Trsync),
    Endstop(Endstop),
    AnalogIn(AnalogIn),
    DigitalOut(DigitalOut),
    /// One of [`crate::heater::Heaters`], which are few and large.
    Heater,
}

/// The objects; the first `allocated` of `N` may be used.
pub(crate) struct Objects<const N: usize> {
    slots: [Object; N],
    allocated: Option<u8>,
}

macro_rules! lookup {
    ($($name:ident -> $type:ident;)*) => {$(
        pub(crate) fn $name(&mut self, oid: u8) -> Result<&mut $type, ShutdownReason> {
            match self.slots.get_mut(usize::from(oid)) {
                Some(Object::$type(object)) => Ok(object),
                _ => Err(ShutdownReason::InvalidOid),
            }
        }
    )*};
}

impl<const N: usize> Objects<N> {
    pub(crate) const fn new() -> Self {
        Self { slots: [const { Object::Free }; N], allocated: None }
    }

    lookup! {
        stepper -> Stepper;
        trsync -> Trsync;
        endstop -> Endstop;
        analog_in -> AnalogIn;
        digital_out -> DigitalOut;
    }

    pub(crate) fn allocate(&mut self, count: u8) -> Result<(), ShutdownReason> {
        if self.allocated.is_some() {
            return Err(ShutdownReason::OidAllocation);
        }
        if usize::from(count) > N {
            return Err(ShutdownReason::OutOfObjects);
        }
        self.allocated = Some(count);
        Ok(())
    }

    /// Whether an object may be configured under this number.
    pub(crate) fn check_free(&self, oid: u8) -> Result<(), ShutdownReason> {
        let is_allocated = self.allocated.is_some_and(|count| oid < count);
        match self.slots.get(usize::from(oid)) {
            Some(Object::Free) if is_allocated => Ok(()),
            _ => Err(ShutdownReason::InvalidOid),
        }
    }

    pub(crate) fn put(&mut self, oid: u8, object: Object) {
        if let Some(slot) = self.slots.get_mut(usize::from(oid)) {
            *slot = object;
        }
    }

    #[inline]
    pub(crate) fn get_mut(&mut self, oid: u8) -> Option<&mut Object> {
        self.slots.get_mut(usize::from(oid))
    }

    /// All objects with their oids.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (u8, &mut Object)> {
        (0..=u8::MAX).zip(&mut self.slots)
    }

    /// Stops everything and puts outputs to their defaults. The caller stops the timers and resets the move pool.
    pub(crate) fn shut_down(&mut self, board: &mut impl Board) {
        for object in &mut self.slots {
            match object {
                Object::Free | Object::Heater => {}
                Object::Stepper(stepper) => stepper.shut_down(board),
                Object::Trsync(trsync) => trsync.shut_down(),
                Object::Endstop(endstop) => endstop.shut_down(),
                Object::AnalogIn(input) => input.shut_down(board),
                Object::DigitalOut(output) => output.shut_down(board),
            }
        }
    }

    /// Forgets all objects.
    pub(crate) fn clear(&mut self) {
        for object in &mut self.slots {
            *object = Object::Free;
        }
        self.allocated = None;
    }
}
