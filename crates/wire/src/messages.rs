//! Every message, declared once.
//!
//! The declaration gives each message its name, its fields in the order in which they travel and their wire types;
//! formats, encoders, decoders and the dictionary all come from it. A board numbers messages by their place here
//! ([`MessageSpec::id`]); a host must not rely on that and resolves every number through the board's dictionary.

use crate::vlq::{self, Sink};

#[cfg(test)]
mod tests;

/// Why a message could not be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// No message has this number.
    UnknownId(u16),
    /// The block ended inside the message.
    CutOff,
    /// A value does not fit the type that the message declares for it.
    OutOfRange,
}

/// A type that a message field may have.
pub trait Field<'a>: Sized {
    /// How the dictionary spells the type.
    const FORMAT: &'static str;
    /// Appends the value; `false` when the sink is full.
    fn encode(&self, sink: &mut impl Sink) -> bool;
    /// Takes a value off the front of `bytes`.
    fn decode(bytes: &mut &'a [u8]) -> Result<Self, DecodeError>;
}

macro_rules! integer_field {
    ($($type:ty, $format:literal, |$raw:ident| $convert:expr;)*) => {$(
        impl Field<'_> for $type {
            const FORMAT: &'static str = $format;
            fn encode(&self, sink: &mut impl Sink) -> bool {
                vlq::encode(*self as i32, sink)
            }
            fn decode(bytes: &mut &[u8]) -> Result<Self, DecodeError> {
                let $raw = vlq::decode(bytes).ok_or(DecodeError::CutOff)?;
                $convert
            }
        }
    )*};
}

integer_field! {
    u32, "%u", |raw| Ok(raw as u32);
    i32, "%i", |raw| Ok(raw);
    u16, "%hu", |raw| raw.try_into().map_err(|_| DecodeError::OutOfRange);
    i16, "%hi", |raw| raw.try_into().map_err(|_| DecodeError::OutOfRange);
    u8, "%c", |raw| raw.try_into().map_err(|_| DecodeError::OutOfRange);
    i8, "%c", |raw| raw.try_into().map_err(|_| DecodeError::OutOfRange);
}

impl<'a> Field<'a> for &'a [u8] {
    const FORMAT: &'static str = "%.*s";
    fn encode(&self, sink: &mut impl Sink) -> bool {
        vlq::encode(self.len() as i32, sink) && self.iter().all(|&byte| sink.put(byte))
    }
    fn decode(bytes: &mut &'a [u8]) -> Result<Self, DecodeError> {
        let len = vlq::decode(bytes).ok_or(DecodeError::CutOff)?;
        let len = usize::try_from(len).map_err(|_| DecodeError::OutOfRange)?;
        let (value, rest) = bytes.split_at_checked(len).ok_or(DecodeError::CutOff)?;
        *bytes = rest;
        Ok(value)
    }
}

/// One field of a message's declaration: its name and the dictionary's spelling of its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldSpec {
    /// The field's name.
    pub name: &'static str,
    /// Its type: `%u`, `%i`, `%hu`, `%hi`, `%c`, `%.*s`.
    pub format: &'static str,
}

/// A message's declaration, from which the dictionary and the host's checks are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageSpec {
    /// The message's name.
    pub name: &'static str,
    /// Its fields in the order in which they travel.
    pub fields: &'static [FieldSpec],
    /// The number by which our own boards name it.
    pub id: u16,
}

/// How the dictionary spells a field's type: as the type says, unless the declaration says otherwise.
macro_rules! field_format {
    ($type:ty) => {
        <$type as Field<'a>>::FORMAT
    };
    ($type:ty, $format:literal) => {
        $format
    };
}

macro_rules! messages {
    (
        $(#[$enum_doc:meta])*
        $enum:ident, $kind:ident, $id_of:ident, $index_of:ident;
        $($(#[$doc:meta])* $name:ident $wire_name:literal { $($field:ident: $type:ty $(as $format:literal)?),* $(,)? })*
    ) => {
        /// Names the members of the enum of the same name, without their values.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u16)]
        pub enum $kind {
            $($(#[$doc])* $name,)*
        }

        impl $kind {
            /// Every member, in the order of the declaration.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// The declaration.
            #[allow(clippy::extra_unused_lifetimes, reason = "only messages with byte fields use it")]
            pub const fn spec<'a>(self) -> MessageSpec {
                let id = $id_of(self as u16);
                match self {
                    $(Self::$name => MessageSpec {
                        name: $wire_name,
                        fields: &[$(FieldSpec {
                            name: stringify!($field),
                            format: field_format!($type $(, $format)?),
                        }),*],
                        id,
                    },)*
                }
            }

            /// Reads the fields of this message off the front of `bytes`, which start after its number.
            pub fn decode<'a>(self, bytes: &mut &'a [u8]) -> Result<$enum<'a>, DecodeError> {
                let _ = &bytes;
                match self {
                    $(Self::$name => Ok($enum::$name { $($field: <$type as Field<'a>>::decode(bytes)?,)* }),)*
                }
            }
        }

        $(#[$enum_doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the fields are the protocol's, described by the message's own line")]
        pub enum $enum<'a> {
            $($(#[$doc])* $name { $($field: $type),* },)*
            #[doc(hidden)]
            _Lifetime(core::convert::Infallible, core::marker::PhantomData<&'a ()>),
        }

        impl<'a> $enum<'a> {
            /// Which message this is.
            pub const fn kind(&self) -> $kind {
                match self {
                    $(Self::$name { .. } => $kind::$name,)*
                    Self::_Lifetime(never, _) => match *never {},
                }
            }

            /// Appends the fields, without the message's number; `false` when the sink is full.
            pub fn encode_fields(&self, sink: &mut impl Sink) -> bool {
                let _ = &sink;
                match self {
                    $(Self::$name { $($field),* } => true $(&& $field.encode(sink))*,)*
                    Self::_Lifetime(never, _) => match *never {},
                }
            }

            /// Appends number and fields with our own boards' numbering; `false` when the sink is full.
            pub fn encode(&self, sink: &mut impl Sink) -> bool {
                vlq::encode(i32::from(self.kind().spec().id), sink) && self.encode_fields(sink)
            }

            /// Takes one message off the front of `bytes`, with our own boards' numbering.
            pub fn decode(bytes: &mut &'a [u8]) -> Result<Self, DecodeError> {
                let id = decode_id(bytes)?;
                let kind = $index_of(id).and_then(|at| $kind::ALL.get(usize::from(at)));
                kind.ok_or(DecodeError::UnknownId(id))?.decode(bytes)
            }
        }
    };
}

/// Takes a message number off the front of `bytes`.
pub fn decode_id(bytes: &mut &[u8]) -> Result<u16, DecodeError> {
    let id = vlq::decode(bytes).ok_or(DecodeError::CutOff)?;
    u16::try_from(id).map_err(|_| DecodeError::OutOfRange)
}

// Our own boards' numbering: the protocol fixes 0 and 1, and numbers below 96 travel as one byte.

const fn command_id(index: u16) -> u16 {
    1 + index
}

const fn command_index(id: u16) -> Option<u16> {
    id.checked_sub(1)
}

const RESPONSE_ID_FIRST: u16 = 63;

const fn response_id(index: u16) -> u16 {
    if index == 0 { 0 } else { RESPONSE_ID_FIRST + index }
}

const fn response_index(id: u16) -> Option<u16> {
    if id == 0 {
        Some(0)
    } else if id > RESPONSE_ID_FIRST {
        Some(id - RESPONSE_ID_FIRST)
    } else {
        None
    }
}

messages! {
    /// What a host tells a board.
    Command, CommandKind, command_id, command_index;

    /// Asks for a piece of the dictionary. Its number is 1 on every board.
    Identify "identify" { offset: u32, count: u8 }
    /// Asks for the state of the configuration.
    GetConfig "get_config" {}
    /// Makes room for objects.
    AllocateOids "allocate_oids" { count: u8 }
    /// Ends the configuration; the CRC is the host's, kept so that a host that comes back knows its own work.
    FinalizeConfig "finalize_config" { crc: u32 }
    /// Asks for the low half of the clock.
    GetClock "get_clock" {}
    /// Asks for the whole clock.
    GetUptime "get_uptime" {}
    /// Stops everything, now.
    EmergencyStop "emergency_stop" {}
    /// Leaves the shutdown state; the configuration has to be made anew.
    ClearShutdown "clear_shutdown" {}
    /// Restarts the firmware.
    Reset "reset" {}
    /// Forgets the configuration without restarting.
    ConfigReset "config_reset" {}

    /// A motor driver with step and direction pins.
    ConfigStepper "config_stepper" { oid: u8, step_pin: u8, dir_pin: u8, invert_step: u8, step_pulse_ticks: u32 }
    /// `count` steps: the first `interval` ticks after the last step, each further interval larger by `add`.
    QueueStep "queue_step" { oid: u8, interval: u32, count: u16, add: i16 }
    /// The direction of the `queue_step`s that follow.
    SetNextStepDir "set_next_step_dir" { oid: u8, dir: u8 }
    /// The clock from which the next interval counts.
    ResetStepClock "reset_step_clock" { oid: u8, clock: u32 }
    /// Asks for the position that has been reached, in steps.
    StepperGetPosition "stepper_get_position" { oid: u8 }
    /// The stepper halts and drops its queue when the trigger fires.
    StepperStopOnTrigger "stepper_stop_on_trigger" { oid: u8, trsync_oid: u8 }

    /// A trigger that others can listen to.
    ConfigTrsync "config_trsync" { oid: u8 }
    /// Arms a trigger and has it reported from `report_clock` on, every `report_ticks`.
    TrsyncStart "trsync_start" { oid: u8, report_clock: u32, report_ticks: u32, expire_reason: u8 }
    /// The clock at which the trigger fires by itself.
    TrsyncSetTimeout "trsync_set_timeout" { oid: u8, clock: u32 }
    /// Fires the trigger.
    TrsyncTrigger "trsync_trigger" { oid: u8, reason: u8 }

    /// A switch input; `pull_up` is 1 for a resistor to the supply, -1 for one to ground, 0 for none.
    ConfigEndstop "config_endstop" { oid: u8, pin: u8, pull_up: i8 }
    /// Asks for the state of a switch.
    EndstopQueryState "endstop_query_state" { oid: u8 }
    /// Watches a switch from `clock` on; `sample_count` equal samples in a row fire the trigger; 0 stops watching.
    EndstopHome "endstop_home" {
        oid: u8, clock: u32, sample_ticks: u32, sample_count: u8, rest_ticks: u32, pin_value: u8, trsync_oid: u8,
        trigger_reason: u8
    }

    /// An analog input.
    ConfigAnalogIn "config_analog_in" { oid: u8, pin: u32 }
    /// Samples it: `sample_count` readings are added up, every `rest_ticks`; sums outside the range for
    /// `range_check_count` times in a row shut the board down.
    QueryAnalogIn "query_analog_in" {
        oid: u8, clock: u32, sample_ticks: u32, sample_count: u8, rest_ticks: u32, bytes_per_report: u8,
        min_value: u16, max_value: u16, range_check_count: u8
    }

    /// A switched output; with `max_duration` it has to be refreshed while it is not at its default.
    ConfigDigitalOut "config_digital_out" { oid: u8, pin: u32, value: u8, default_value: u8, max_duration: u32 }
    /// Turns an output into a pulse-width modulated one with this period.
    SetDigitalOutPwmCycle "set_digital_out_pwm_cycle" { oid: u8, cycle_ticks: u32 }
    /// At `clock`: on for `on_ticks` of every cycle (without a cycle: 0 is off, anything else on).
    QueueDigitalOut "queue_digital_out" { oid: u8, clock: u32, on_ticks: u32 }
    /// Sets an output now.
    UpdateDigitalOut "update_digital_out" { oid: u8, value: u8 }

    // The motion clock, an extension of ours (docs/motion-clock.md). What plain boards also have stays before it, so
    // that it keeps its numbers.
    /// Renews the lease on motion: steps are queued up to the motion clock `covered`, the host lives until the clock
    /// `alive`; motion comes to rest by a ramp of `ramp` ticks when either runs out.
    MotionLease "motion_lease" { covered: u32, alive: u32, ramp: u32 }
    /// The motion clock at which all that is queued has come to rest by itself: there the lease ends.
    MotionEnd "motion_end" { clock: u32 }
    /// Slows the motion clock to a stop.
    MotionHold "motion_hold" { ramp: u32 }
    /// Speeds the motion clock up again.
    MotionResume "motion_resume" { ramp: u32 }
    /// The rate of the motion clock while it is not held, in 1/4096 of the clock's.
    MotionRate "motion_rate" { rate: u16, ramp: u32 }
    /// Asks for the state of the motion clock.
    MotionGetState "motion_get_state" {}
    /// While held: drops all queued steps and tied output changes; every stepper tells how far it came.
    MotionDrop "motion_drop" {}
    /// Begins a new count of rows on every stepper.
    MotionJob "motion_job" { id: u32 }
    /// An output's queued changes follow the motion clock.
    MotionTie "motion_tie" { oid: u8 }
    /// Asks how far a stepper has come in its rows.
    StepperGetQueue "stepper_get_queue" { oid: u8 }

    // Heaters that the board regulates, an extension of ours (docs/board-heaters.md, with all units).
    /// A heater: an analog input, sampled with so many readings a sum, that regulates an output.
    ConfigHeater "config_heater" {
        oid: u8, adc_oid: u8, out_oid: u8, sample_count: u8, max_power: u16, smooth: u16
    }
    /// The next point of the sensor's curve.
    HeaterPoint "heater_point" { oid: u8, sum: u16, temperature: i32 }
    /// Regulates by PID.
    HeaterPid "heater_pid" { oid: u8, kp: u32, ki: u32, kd: u32 }
    /// Regulates on and off, `delta` around the target.
    HeaterWatermark "heater_watermark" { oid: u8, delta: u32 }
    /// What a sound heater does.
    HeaterCheck "heater_check" { oid: u8, max_error: u32, gain_time: u32, hysteresis: u32, gain: u32 }
    /// A target, and what becomes of it when the host falls silent.
    HeaterSet "heater_set" { oid: u8, target: i32, standby: i32, standby_s: u16 }
    /// The host lives until the clock `alive`.
    HeaterLease "heater_lease" { alive: u32 }
    /// Asks for the state of a heater.
    HeaterGetState "heater_get_state" { oid: u8 }

    // The block check, an extension of ours (docs/block-check.md).
    /// The CRC-32 over all of the block before it; from the first right one on the board takes no block without.
    BlockCheck "block_check" { crc: u32 }
}

/// What plain Klipper firmware lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extension {
    /// The motion clock: hold, resume and lease.
    MotionClock,
    /// Heaters that the board regulates.
    Heaters,
    /// The check over whole blocks.
    BlockCheck,
}

impl CommandKind {
    /// The extension that this command belongs to; `None` for those of plain Klipper firmware.
    pub const fn extension(self) -> Option<Extension> {
        match self {
            Self::BlockCheck => Some(Extension::BlockCheck),
            _ if self.is_heater() => Some(Extension::Heaters),
            _ if self as u16 >= Self::MotionLease as u16 => Some(Extension::MotionClock),
            _ => None,
        }
    }

    /// Whether a board with plain Klipper firmware lacks this command.
    pub const fn is_extension(self) -> bool {
        self.extension().is_some()
    }

    /// Whether it belongs to the heaters that a board regulates.
    pub const fn is_heater(self) -> bool {
        self as u16 >= Self::ConfigHeater as u16 && self as u16 <= Self::HeaterGetState as u16
    }
}

messages! {
    /// What a board tells a host.
    Response, ResponseKind, response_id, response_index;

    /// A piece of the dictionary. Its number is 0 on every board.
    IdentifyResponse "identify_response" { offset: u32, data: &'a [u8] }
    /// The state of the configuration.
    Config "config" { is_config: u8, crc: u32, is_shutdown: u8, move_count: u16 }
    /// The low half of the clock.
    Clock "clock" { clock: u32 }
    /// The whole clock.
    Uptime "uptime" { high: u32, clock: u32 }
    /// Where a stepper is.
    StepperPosition "stepper_position" { oid: u8, pos: i32 }
    /// The state of a switch.
    EndstopState "endstop_state" { oid: u8, homing: u8, next_clock: u32, pin_value: u8 }
    /// The state of a trigger.
    TrsyncState "trsync_state" { oid: u8, can_trigger: u8, trigger_reason: u8, clock: u32 }
    /// One or more sums of readings, little-endian. Klipper's host insists on this spelling of the type.
    AnalogInState "analog_in_state" { oid: u8, next_clock: u32, values: &'a [u8] as "%*s" }
    /// How busy the board is.
    Stats "stats" { count: u32, sum: u32, sumsq: u32 }
    /// The board has just stopped everything.
    Shutdown "shutdown" { clock: u32, static_string_id: u16 }
    /// The board has been stopped, and said so before; the answer to most commands in that state.
    IsShutdown "is_shutdown" { static_string_id: u16 }
    /// The firmware has just started.
    Starting "starting" {}

    // The motion clock, as above.
    /// At the clock `clock` the motion clock stood at `motion` and ran at `rate`/4096; why it is or will be held.
    MotionState "motion_state" { clock: u32, motion: u32, rate: u16, state: u8, reason: u8 }
    /// How far a stepper has come in its job: rows, steps left in the current row, the motion clock and direction of
    /// the next step, position, and the check over all rows received.
    StepperQueue "stepper_queue" {
        oid: u8, job: u32, received: u32, done: u32, left: u16, next: u32, dir: u8, pos: i32, crc: u32
    }

    // Heaters, as above.
    /// What a heater read at `clock`, what it is held at, its power, and why.
    HeaterState "heater_state" { oid: u8, clock: u32, temperature: i32, target: i32, power: u16, state: u8 }

    // The block check, as above.
    /// The CRC-32 over all of the block before it.
    BlockChecked "block_checked" { crc: u32 }
}

impl ResponseKind {
    /// The extension that this message belongs to; `None` for those of plain Klipper firmware.
    pub const fn extension(self) -> Option<Extension> {
        match self {
            Self::BlockChecked => Some(Extension::BlockCheck),
            Self::HeaterState => Some(Extension::Heaters),
            _ if self as u16 >= Self::MotionState as u16 => Some(Extension::MotionClock),
            _ => None,
        }
    }
}
