//! The board as a host meets it: dictionary, clock, sensors, heaters, the link and its faults.

use crate::host::{Answer, Host, machine};
use proptest::prelude::*;
use units::{Celsius, Seconds};
use virtual_printer::{BoardProfile, Faults, Machine, Recorder, Sensor, VirtualPrinter, WiringError};
use wire::block::Block;
use wire::dictionary::Dictionary;
use wire::{Command, Response, ShutdownReason};

/// Object 0 is the hot end's sensor, 1 its heater, 2 the fan.
fn configure<R: Recorder>(host: &mut Host<R>) {
    host.send(&[
        Command::AllocateOids { count: 3 },
        Command::ConfigAnalogIn { oid: 0, pin: 26 },
        Command::ConfigDigitalOut { oid: 1, pin: 17, value: 0, default_value: 0, max_duration: 36_000_000 },
        Command::SetDigitalOutPwmCycle { oid: 1, cycle_ticks: 1_200_000 },
        Command::ConfigDigitalOut { oid: 2, pin: 19, value: 0, default_value: 0, max_duration: 0 },
        Command::FinalizeConfig { crc: 1 },
    ]);
    host.run(0.05);
    let clock = host.after(0.1).low().0;
    host.send(&[Command::QueryAnalogIn {
        oid: 0,
        clock,
        sample_ticks: 12_000,
        sample_count: 8,
        rest_ticks: 3_600_000,
        bytes_per_report: 2,
        // As hosts set it for 0 °C to 300 °C.
        min_value: 900,
        max_value: 32_300,
        range_check_count: 4,
    }]);
}

/// Holds a duty for so long, refreshing it as hosts do.
fn heat<R: Recorder>(host: &mut Host<R>, duty: f64, seconds: u32) {
    for _ in 0..seconds {
        let clock = host.after(0.1).low().0;
        host.send(&[Command::QueueDigitalOut { oid: 1, clock, on_ticks: (duty * 1_200_000.0) as u32 }]);
        host.run(1.0);
    }
}

fn readings<R: Recorder>(host: &Host<R>) -> Vec<u16> {
    host.all(|response| match response {
        Response::AnalogInState { values: &[low, high], .. } => Some(u16::from_le_bytes([low, high])),
        _ => None,
    })
}

#[test]
fn the_dictionary_comes_over_the_link_whole() {
    for profile in BoardProfile::all() {
        let clock = f64::from(profile.clock.0);
        let mut host = Host::new(profile, &Machine::default(), "", ());
        let mut data: Vec<u8> = Vec::new();
        loop {
            let offset = data.len() as u32;
            host.send(&[Command::Identify { offset, count: 40 }]);
            host.run(0.02);
            let pieces = host.all(|response| match response {
                Response::IdentifyResponse { offset: at, data } if at == offset => Some(data.to_vec()),
                _ => None,
            });
            let piece = pieces.first().expect("a piece");
            if piece.is_empty() {
                break;
            }
            data.extend(piece);
        }
        let dictionary = Dictionary::parse(&data).expect("a dictionary");
        assert_eq!(dictionary.number("CLOCK_FREQ"), Some(clock));
    }
}

#[test]
fn the_clock_is_the_virtual_one_and_the_link_takes_its_time() {
    let mut host = Host::usual("", ());
    host.run(0.5);
    let sent = host.printer.now();
    host.send(&[Command::GetClock {}]);
    host.run(0.1);
    let clock = host.all(|response| match response {
        Response::Clock { clock } => Some(clock),
        _ => None,
    })[0];
    let there = clock.wrapping_sub(sent.low().0);
    assert!((6_000..13_000).contains(&there), "half a millisecond to one: {there}");
    let answer = host.answers.iter().find(|answer| answer.payload.len() > 1).expect("an answer");
    let back = (answer.at - sent).0;
    assert!((12_000..26_000).contains(&back), "{back}");
}

#[test]
fn the_sensor_reads_the_hot_end_with_little_noise() {
    let mut host = Host::usual("", ());
    configure(&mut host);
    host.run(5.0);
    let cold = readings(&host);
    let ideal = Sensor::default().thermistor.ratio(Celsius(22.0), Sensor::default().pull_up) * 4095.0 * 8.0;
    assert!(cold.len() >= 15);
    assert!(cold.iter().all(|&sum| (f64::from(sum) - ideal).abs() < 25.0), "{ideal}: {cold:?}");
    assert!(cold.iter().any(|&sum| sum != cold[0]), "noise");
    heat(&mut host, 1.0, 40);
    let state = host.state();
    assert_eq!(state.shutdown, None);
    assert!(state.heaters[0].temperature.0 > 110.0, "{}", state.heaters[0].temperature);
    assert!(state.heaters[0].sensor < state.heaters[0].temperature, "the sensor follows late");
    assert!(*readings(&host).last().expect("a reading") < 12_000);
}

#[test]
fn duty_and_fan_are_seen_by_the_plant() {
    let after_200_s = |fan: u8| {
        let mut host = Host::usual("", ());
        configure(&mut host);
        host.send(&[Command::UpdateDigitalOut { oid: 2, value: fan }]);
        heat(&mut host, 0.25, 200);
        let state = host.state();
        assert!((state.fans[0].speed - f64::from(fan)).abs() < 0.01);
        state.heaters[0].temperature.0
    };
    // 10 W into 12.5 J/K and 0.06 W/K: 22 °C + 167 K · (1 − e^(−200/208)).
    let still_air = after_200_s(0);
    assert!((still_air - 125.0).abs() < 3.0, "{still_air}");
    assert!(after_200_s(1) < still_air - 8.0);
}

#[test]
fn a_host_that_dies_leaves_no_heater_on() {
    let mut host = Host::usual("unplug@6", ());
    configure(&mut host);
    heat(&mut host, 1.0, 8);
    assert!(!host.printer.connected());
    host.run(4.0);
    let state = host.state();
    assert_eq!(state.shutdown, Some(ShutdownReason::MissedOutput));
    assert_eq!(state.heaters[0].duty, 0.0);
}

#[test]
fn a_cable_put_back_works_again() {
    let mut host = Host::usual("unplug@1,replug@2", ());
    host.run(1.5);
    assert!(!host.printer.connected());
    let before = host.answers.len();
    host.run(0.6);
    assert!(host.printer.connected());
    assert_eq!(host.answers.len(), before);
    host.send(&[Command::GetClock {}]);
    host.run(0.1);
    assert!(host.answers.len() > before);
}

#[test]
fn a_sensor_that_fails_stops_the_board() {
    for (fault, reads) in [("sensor-open=extruder@12", 8 * 4095), ("sensor-short=extruder@12", 0)] {
        let mut host = Host::usual(fault, ());
        configure(&mut host);
        heat(&mut host, 0.3, 11);
        assert_eq!(host.state().shutdown, None);
        heat(&mut host, 0.3, 4);
        let state = host.state();
        assert_eq!(state.shutdown, Some(ShutdownReason::AdcOutOfRange), "{fault}");
        assert_eq!(state.heaters[0].duty, 0.0);
        assert!(readings(&host).contains(&reads), "{fault}");
    }
}

#[test]
fn a_dead_heater_stays_cold_and_a_fused_one_gets_hot() {
    let mut host = Host::usual("heater-dead=extruder@5", ());
    configure(&mut host);
    heat(&mut host, 1.0, 30);
    assert!(host.state().heaters[0].temperature.0 < 50.0);
    let mut host = Host::usual("heater-stuck-on=extruder@5", ());
    configure(&mut host);
    host.run(60.0);
    assert!(host.state().heaters[0].temperature.0 > 120.0);
}

#[test]
fn a_restart_of_a_usb_board_takes_the_port_with_it() {
    let mut host = Host::usual("", ());
    configure(&mut host);
    heat(&mut host, 1.0, 3);
    host.send(&[Command::Reset {}]);
    host.run(0.1);
    assert!(!host.printer.connected());
    assert_eq!(host.state().heaters[0].duty, 0.0);
    let before = host.all(|response| matches!(response, Response::Starting {}).then_some(())).len();
    host.run(0.6);
    assert!(host.printer.connected());
    let after = host.all(|response| matches!(response, Response::Starting {}).then_some(())).len();
    assert_eq!(after, before + 1);
}

#[test]
fn damage_on_the_link_is_refused_and_counted() {
    let mut host = Host::usual("corrupt=0.05", ());
    for _ in 0..200 {
        host.send(&[Command::GetClock {}]);
        host.run(0.01);
    }
    let state = host.state();
    assert!(state.damaged_bytes[0] > 20, "{:?}", state.damaged_bytes);
    assert!(state.damaged_bytes[1] > 20, "{:?}", state.damaged_bytes);
    assert_eq!(state.shutdown, None, "damage is no command");
    let answered = host.all(|response| matches!(response, Response::Clock { .. }).then_some(())).len();
    assert!(answered < 200, "this host does not repeat what was lost");
}

#[test]
fn wiring_that_cannot_be_is_refused() {
    let build = |machine: &Machine, faults: &str| {
        let faults: Faults = faults.parse().expect("faults");
        VirtualPrinter::new(BoardProfile::rp2040(), machine, &faults, 1, ()).map(|_| ())
    };
    let none = "corrupt=0";
    assert_eq!(build(&machine(), none), Ok(()));
    let mut wrong = machine();
    wrong.motors[0].step.pin = "PA1".into();
    assert!(matches!(build(&wrong, none), Err(WiringError::UnknownPin { .. })));
    let mut wrong = machine();
    wrong.motors[0].dir.pin = "gpio17".into();
    assert!(matches!(build(&wrong, none), Err(WiringError::PinTaken { .. })));
    let mut wrong = machine();
    wrong.heaters[0].sensor_pin = "gpio20".into();
    assert!(matches!(build(&wrong, none), Err(WiringError::NotAnalog { .. })));
    let mut wrong = machine();
    wrong.endstops[0].motor = 7;
    assert!(matches!(build(&wrong, none), Err(WiringError::NoSuchPart { .. })));
    let mut wrong = machine();
    wrong.motors[0].mechanics.inertia_kg_m2 = f64::NAN;
    assert!(matches!(build(&wrong, none), Err(WiringError::Unsound { .. })));
    let unknown = build(&machine(), "heater-dead=chamber");
    assert!(matches!(unknown, Err(WiringError::UnknownFaultTarget { .. })));
}

#[test]
fn faults_at_the_end_of_time_are_no_harm() {
    let mut faults: Faults = "unplug".parse().expect("a fault");
    for at in [f64::INFINITY, 1e300, f64::NAN, -1.0] {
        faults.failures[0].at = Seconds(at);
        let printer = VirtualPrinter::new(BoardProfile::rp2040(), &Machine::default(), &faults, 1, ());
        assert!(printer.is_ok());
    }
}

#[test]
fn drivers_may_share_an_enable_pin() {
    let mut shared = machine();
    shared.motors[1].enable = shared.motors[0].enable.clone();
    let mut host = Host::new(BoardProfile::rp2040(), &shared, "", ());
    host.send(&[
        Command::AllocateOids { count: 1 },
        Command::ConfigDigitalOut { oid: 0, pin: 4, value: 0, default_value: 1, max_duration: 0 },
    ]);
    host.run(0.1);
    assert!(host.state().motors.iter().all(|motor| motor.energised));
}

#[test]
fn an_idle_hour_is_short() {
    let mut printer =
        VirtualPrinter::new(BoardProfile::rp2040(), &Machine::default(), &Faults::default(), 1, ())
            .expect("sound");
    let until = printer.start() + printer.profile().clock.ticks_in(Seconds(3600.0));
    let mut to_host = Vec::new();
    while printer.run_until(until, &mut to_host) < until {}
    assert!(to_host.len() < 100_000, "{}", to_host.len());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_bytes_at_any_time_leave_it_running(
        pieces in prop::collection::vec((0.0..0.3_f64, prop::collection::vec(any::<u8>(), 0..100), any::<bool>()), 0..30),
    ) {
        let mut host = Host::usual("corrupt=0.01,duplicate=0.01,drop=0.01,delay=0.01", ());
        configure(&mut host);
        for (sequence, (wait, bytes, framed)) in pieces.into_iter().enumerate() {
            // Some of it in valid blocks, so that it gets as far as the commands.
            let payload = &bytes[..bytes.len().min(59)];
            let block = Block::new(sequence as u8, payload);
            host.printer.write(if framed { block.as_bytes() } else { &bytes });
            host.run(wait);
            host.printer.write(Block::new(0, payload).as_bytes());
        }
        host.run(1.0);
        let state = host.state();
        prop_assert!(state.motors.iter().all(|motor| motor.position.0.is_finite()));
        prop_assert!(state.heaters.iter().all(|heater| (0.0..800.0).contains(&heater.temperature.0)));
    }
}

#[test]
fn a_board_that_starts_anew_lets_its_pins_go_and_says_so() {
    let mut host = Host::usual("board-reset@6", ());
    configure(&mut host);
    heat(&mut host, 1.0, 5);
    assert!(host.state().heaters[0].duty > 0.0);
    host.answers.clear();
    host.run(2.0);
    let state = host.state();
    assert_eq!((state.shutdown, state.heaters[0].duty), (None, 0.0));
    let is_starting =
        |answer: &Answer| matches!(Response::decode(&mut &answer.payload[..]), Ok(Response::Starting {}));
    assert!(host.answers.iter().any(is_starting));
}
