//! Every reason to shut down has something that leads to it, and all end the same: nothing moves, nothing heats.

use wire::{Command, Response, ShutdownReason, vlq};

use crate::bench::{Bench, OBJECTS, SECOND, STEP_PIN, output, stepper, steps};

const STEPPER: u8 = 0;
const HEATER: u8 = 1;
const TRSYNC: u8 = 2;
const ENDSTOP: u8 = 3;
const SENSOR: u8 = 4;
const OTHER_TRSYNC: u8 = 5;
const HEATER_PIN: usize = 17;

const CONFIG: [Command<'static>; 6] = [
    stepper(STEPPER),
    output(HEATER, 36_000_000),
    Command::ConfigTrsync { oid: TRSYNC },
    Command::ConfigEndstop { oid: ENDSTOP, pin: 5, pull_up: 0 },
    Command::ConfigAnalogIn { oid: SENSOR, pin: 26 },
    Command::ConfigTrsync { oid: OTHER_TRSYNC },
];

const START: u64 = 100 * SECOND;

const fn armed(oid: u8) -> Command<'static> {
    Command::TrsyncStart { oid, report_clock: 0, report_ticks: 0, expire_reason: 4 }
}

const fn obey(trsync_oid: u8) -> Command<'static> {
    Command::StepperStopOnTrigger { oid: STEPPER, trsync_oid }
}

const fn home(clock: u64, rest_ticks: u32, trsync_oid: u8) -> Command<'static> {
    Command::EndstopHome {
        oid: ENDSTOP,
        clock: clock as u32,
        sample_ticks: 180,
        sample_count: 4,
        rest_ticks,
        pin_value: 1,
        trsync_oid,
        trigger_reason: 1,
    }
}

const fn sample(clock: u64, max_value: u16, rest_ticks: u32) -> Command<'static> {
    Command::QueryAnalogIn {
        oid: SENSOR,
        clock: clock as u32,
        sample_ticks: 1000,
        sample_count: 8,
        rest_ticks,
        bytes_per_report: 2,
        min_value: 0,
        max_value,
        range_check_count: 1,
    }
}

const fn heat(clock: u64, on_ticks: u32) -> Command<'static> {
    Command::QueueDigitalOut { oid: HEATER, clock: clock as u32, on_ticks }
}

/// What a running board is told, and what it must stop for.
fn cases() -> Vec<(ShutdownReason, Vec<Command<'static>>)> {
    use ShutdownReason as R;
    let soon = START + SECOND;
    let past = START - 1;
    vec![
        (R::EmergencyStop, vec![Command::EmergencyStop {}]),
        (R::TimerTooClose, vec![home(past, 3000, TRSYNC)]),
        (R::TimerTooClose, vec![sample(past, 32_000, 3_600_000)]),
        (R::TimerTooClose, vec![heat(past, 1)]),
        (
            R::TimerTooClose,
            vec![Command::TrsyncStart {
                oid: TRSYNC,
                report_clock: past as u32,
                report_ticks: 9,
                expire_reason: 4,
            }],
        ),
        (
            R::TimerTooClose,
            vec![armed(TRSYNC), Command::TrsyncSetTimeout { oid: TRSYNC, clock: past as u32 }],
        ),
        (
            R::TimerTooClose,
            vec![Command::ResetStepClock { oid: STEPPER, clock: past as u32 - 5 }, steps(STEPPER, 5, 1, 0)],
        ),
        (R::StepperTooFarInPast, vec![steps(STEPPER, 1000, 1, 0), steps(STEPPER, 1, 2000, 0)]),
        (R::StepperTooFarInPast, vec![steps(STEPPER, 1000, 1, 0), steps(STEPPER, 3 << 30, 1, 0)]),
        (R::MissedOutput, vec![Command::UpdateDigitalOut { oid: HEATER, value: 1 }]),
        (R::AdcOutOfRange, vec![sample(soon, 100, 3_600_000)]),
        (R::AlreadyConfigured, vec![Command::ConfigTrsync { oid: 9 }]),
        (R::AlreadyConfigured, vec![Command::FinalizeConfig { crc: 1 }]),
        (R::InvalidOid, vec![steps(TRSYNC, 1000, 1, 0)]),
        (R::InvalidOid, vec![Command::StepperGetPosition { oid: 255 }]),
        (R::InvalidOid, vec![home(soon, 3000, STEPPER)]),
        (R::InvalidOid, vec![obey(ENDSTOP)]),
        (R::InvalidOid, vec![armed(23)]),
        (R::MoveQueueOverflow, vec![steps(STEPPER, 100_000_000, 1, 0); 258]),
        (R::InvalidStepInterval, vec![steps(STEPPER, 1000, 0, 0)]),
        (R::InvalidStepInterval, vec![steps(STEPPER, 0, 1, 0)]),
        (R::InvalidStepInterval, vec![steps(STEPPER, 1000, 101, -10)]),
        (R::InvalidStepInterval, vec![steps(STEPPER, u32::MAX, 2, 1)]),
        (
            R::StepperActive,
            vec![steps(STEPPER, 9000, 1, 0), Command::ResetStepClock { oid: STEPPER, clock: 0 }],
        ),
        (
            R::StepperAlreadyTriggered,
            vec![armed(TRSYNC), armed(OTHER_TRSYNC), obey(TRSYNC), obey(OTHER_TRSYNC)],
        ),
        (R::OutputTooFarAhead, vec![heat(soon, 1), heat(soon + 4 * SECOND, 1)]),
        (R::InvalidPwm, vec![Command::SetDigitalOutPwmCycle { oid: HEATER, cycle_ticks: 1 << 31 }]),
        (R::InvalidAdcTiming, vec![sample(soon, 100, 7000)]),
        (R::InvalidEndstop, vec![home(soon, 0, TRSYNC)]),
        (R::InvalidMotion, vec![Command::MotionHold { ramp: (1 << 30) + 1 }]),
        (R::InvalidMotion, vec![Command::MotionRate { rate: 0, ramp: 0 }]),
        (R::InvalidMotion, vec![Command::MotionRate { rate: 4097, ramp: 0 }]),
        (R::MotionNotHeld, vec![Command::MotionDrop {}]),
    ]
}

/// Heater on, all in order; the motor turns, or rests with its clock at [`START`].
fn running(is_moving: bool) -> Bench {
    let mut bench = Bench::configured(START - 2 * SECOND, &CONFIG);
    bench.send(&Command::UpdateDigitalOut { oid: HEATER, value: 1 });
    let clock = if is_moving { START - 2 * SECOND } else { START };
    bench.send(&Command::ResetStepClock { oid: STEPPER, clock: clock as u32 });
    if is_moving {
        bench.send(&steps(STEPPER, 12_000, 3000, 0));
    }
    bench.run_until(START - SECOND);
    bench.send(&Command::UpdateDigitalOut { oid: HEATER, value: 1 });
    bench.run_until(START);
    assert_eq!(bench.shutdown(), None);
    assert!(bench.board.levels[HEATER_PIN]);
    bench.board.sent.clear();
    bench
}

fn assert_safe(bench: &mut Bench, reason: ShutdownReason) {
    assert_eq!(bench.shutdown(), Some(reason));
    let announced = bench.pick(|response| match *response {
        Response::Shutdown { static_string_id, .. } => Some(static_string_id),
        _ => None,
    });
    assert_eq!(announced, [reason as u16], "{reason:?} is announced once");
    assert!(!bench.board.levels[HEATER_PIN], "{reason:?}: the heater is off");
    assert!(!bench.board.levels[usize::from(STEP_PIN)]);
    let edges = bench.board.edges.len();
    bench.run_for(20 * SECOND);
    assert_eq!(bench.board.edges.len(), edges, "{reason:?}: nothing moves any more");
}

#[test]
fn every_fault_stops_the_board() {
    for (reason, commands) in cases() {
        let queues_steps = commands.iter().any(|command| matches!(command, Command::QueueStep { .. }));
        let mut bench = running(!queues_steps);
        for command in &commands {
            bench.send(command);
        }
        bench.run_for(5 * SECOND);
        assert_safe(&mut bench, reason);
    }
}

#[test]
fn the_cases_cover_every_reason_but_those_tested_on_their_own() {
    // Configuration and parser faults, a late timer, heaters; and trsync parameters, none of which are invalid.
    let elsewhere = [
        ShutdownReason::TimerInPast,
        ShutdownReason::CommandParser,
        ShutdownReason::NotConfigured,
        ShutdownReason::OidAllocation,
        ShutdownReason::OutOfObjects,
        ShutdownReason::InvalidPin,
        ShutdownReason::InvalidAdcPin,
        ShutdownReason::InvalidTrsync,
        ShutdownReason::InvalidHeater,
        ShutdownReason::HeaterSensor,
        ShutdownReason::HeaterNotHeating,
        ShutdownReason::HeaterDrifted,
    ];
    for reason in ShutdownReason::ALL {
        let is_case = cases().iter().any(|case| case.0 == *reason);
        assert_eq!(is_case, !elsewhere.contains(reason), "{reason:?}");
    }
}

#[test]
fn a_timer_that_runs_a_millisecond_late_stops_the_board() {
    let mut bench = running(true);
    bench.board.now += 11_000;
    bench.firmware.run_timers(&mut bench.board);
    assert_eq!(bench.shutdown(), None, "less is caught up");
    let mut bench = running(true);
    bench.board.now += 13_000 + 12_000;
    bench.firmware.run_timers(&mut bench.board);
    assert_safe(&mut bench, ShutdownReason::TimerInPast);
}

#[test]
fn what_cannot_be_understood_stops_the_board() {
    let number = |value| {
        let mut bytes = Vec::new();
        vlq::encode(value, &mut bytes);
        bytes
    };
    let oids = i32::from(wire::messages::CommandKind::AllocateOids.spec().id);
    for payload in
        [number(60), number(-1), number(100_000), number(oids), [number(oids), number(256)].concat()]
    {
        let mut bench = running(true);
        bench.send_payload(&payload);
        assert_safe(&mut bench, ShutdownReason::CommandParser);
    }
}

#[test]
fn mistakes_of_configuration_stop_the_board() {
    use ShutdownReason as R;
    const ALLOCATE: Command<'static> = Command::AllocateOids { count: 4 };
    let bad_stepper = |step_pin, dir_pin| Command::ConfigStepper {
        oid: 0,
        step_pin,
        dir_pin,
        invert_step: 0,
        step_pulse_ticks: 24,
    };
    let digital = |pin, value, max_duration| Command::ConfigDigitalOut {
        oid: 0,
        pin,
        value,
        default_value: 0,
        max_duration,
    };
    let cases = [
        (R::OidAllocation, vec![ALLOCATE, ALLOCATE]),
        (R::OutOfObjects, vec![Command::AllocateOids { count: OBJECTS as u8 + 1 }]),
        (R::InvalidOid, vec![stepper(0)]),
        (R::InvalidOid, vec![ALLOCATE, stepper(4)]),
        (R::InvalidOid, vec![ALLOCATE, stepper(1), Command::ConfigTrsync { oid: 1 }]),
        (R::NotConfigured, vec![ALLOCATE, stepper(0), steps(0, 1000, 1, 0)]),
        (R::NotConfigured, vec![Command::UpdateDigitalOut { oid: 0, value: 1 }]),
        (R::InvalidPin, vec![ALLOCATE, bad_stepper(30, 1)]),
        (R::InvalidPin, vec![ALLOCATE, bad_stepper(1, 200)]),
        (R::InvalidPin, vec![ALLOCATE, Command::ConfigEndstop { oid: 0, pin: 99, pull_up: 1 }]),
        (R::InvalidPin, vec![ALLOCATE, digital(30, 0, 0)]),
        (R::InvalidPin, vec![ALLOCATE, digital(256, 0, 0)]),
        (R::InvalidAdcPin, vec![ALLOCATE, Command::ConfigAnalogIn { oid: 0, pin: 5 }]),
        (R::InvalidAdcPin, vec![ALLOCATE, Command::ConfigAnalogIn { oid: 0, pin: 256 + 26 }]),
        (R::CommandParser, vec![ALLOCATE, digital(1, 1, 1000)]),
        (R::CommandParser, vec![ALLOCATE, digital(1, 0, 1 << 31)]),
    ];
    for (reason, commands) in cases {
        let mut bench = Bench::at(0);
        bench.send_all(&commands);
        assert_eq!(bench.shutdown(), Some(reason), "{commands:?}");
    }
}

#[test]
fn the_first_reason_stays() {
    let mut bench = running(true);
    bench.send_all(&[Command::EmergencyStop {}, Command::EmergencyStop {}, steps(99, 0, 0, 0)]);
    assert_eq!(bench.shutdown(), Some(ShutdownReason::EmergencyStop));
}

#[test]
fn a_pulse_that_has_begun_ends_with_the_shutdown() {
    let mut bench = running(true);
    assert!(bench.board.levels[usize::from(STEP_PIN)], "a step is due right at the start");
    bench.send(&Command::EmergencyStop {});
    assert!(!bench.board.levels[usize::from(STEP_PIN)]);
}
