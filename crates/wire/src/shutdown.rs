//! Why a board stops everything: the numbers that travel and the texts its dictionary gives them.

macro_rules! reasons {
    ($($(#[$doc:meta])* $name:ident = $number:literal, $text:literal;)*) => {
        /// The reason of a shutdown, as the board reports it (`static_string_id`).
        ///
        /// Texts that Klipper's firmware also has are spelled as there, since hosts recognise them.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u16)]
        pub enum ShutdownReason {
            $($(#[$doc])* $name = $number,)*
        }

        impl ShutdownReason {
            /// Every reason, for the dictionary.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// The text in the dictionary's `static_string_id` enumeration.
            pub const fn text(self) -> &'static str {
                match self { $(Self::$name => $text,)* }
            }
        }
    };
}

reasons! {
    /// The host sent `emergency_stop`.
    EmergencyStop = 2, "Command request";
    /// A timer was asked for that is already past.
    TimerTooClose = 3, "Timer too close";
    /// A running timer fell more than a millisecond behind.
    TimerInPast = 4, "Rescheduled timer in the past";
    /// A stepper's next step lies more than a millisecond in the past.
    StepperTooFarInPast = 5, "Stepper too far in past";
    /// An output with `max_duration` was not refreshed in time.
    MissedOutput = 6, "Missed scheduling of next digital out event";
    /// A sensor left its range.
    AdcOutOfRange = 7, "ADC out of range";
    /// A message that does not decode, or whose values make no sense.
    CommandParser = 8, "Command parser error";
    /// A command that only makes sense before `finalize_config`, or the other way round.
    AlreadyConfigured = 9, "Already finalized";
    /// A command that needs a finished configuration.
    NotConfigured = 10, "config not finalized";
    /// More oids than the board has, or allocated twice.
    OidAllocation = 11, "oids already allocated";
    /// A command named an oid that does not exist or is of another kind.
    InvalidOid = 12, "Invalid oid type";
    /// No room for another object.
    OutOfObjects = 13, "alloc_chunk failed";
    /// More outstanding moves than `move_count`.
    MoveQueueOverflow = 14, "Move queue overflow";
    /// A `queue_step` whose count is zero or whose intervals fall to or below zero.
    InvalidStepInterval = 15, "Invalid count parameter";
    /// `reset_step_clock` while steps are queued.
    StepperActive = 16, "Can't reset time when stepper active";
    /// Homing commands on a stepper that already obeys another trigger.
    StepperAlreadyTriggered = 17, "Can't add signal that is already active";
    /// The pin cannot do what was asked of it.
    InvalidPin = 18, "Not a valid pin";
    /// The pin has no converter.
    InvalidAdcPin = 19, "Not a valid ADC pin";
    /// An output event lies further ahead than its `max_duration` allows.
    OutputTooFarAhead = 20, "Scheduled digital out event will exceed max_duration";
    /// Values on a software PWM that cannot be timed.
    InvalidPwm = 21, "Invalid soft_pwm cycle";
    /// The analog sampling commands do not fit the board.
    InvalidAdcTiming = 22, "Invalid ADC sampling parameters";
    /// The trigger commands do not fit together.
    InvalidTrsync = 23, "Invalid trsync parameters";
    /// The sampling commands of an endstop make no sense.
    InvalidEndstop = 24, "Invalid endstop sampling parameters";
    /// A ramp, rate or tie that the motion clock cannot have.
    InvalidMotion = 25, "Invalid motion clock parameters";
    /// `motion_drop` while the motion clock is not held.
    MotionNotHeld = 26, "Motion clock is not held";
    /// Commands of a heater that make no sense, or that it does not allow.
    InvalidHeater = 27, "Invalid heater parameters";
    /// A heater's sensor left its curve.
    HeaterSensor = 28, "Heater sensor out of range";
    /// A heater that is on its way does not warm.
    HeaterNotHeating = 29, "Heater does not get warmer";
    /// A heater lost its temperature.
    HeaterDrifted = 30, "Heater does not hold its temperature";
}
