//! Heaters that the board regulates: what it does with a host, without one, and with what is broken.

use proptest::prelude::*;
use wire::{Command, ShutdownReason};

use crate::{
    bench::{Bench, MILLISECOND, SECOND},
    oven::*,
};

#[test]
fn with_a_host_it_holds_the_target_whatever_the_outputs_level() {
    for level in [0, 1] {
        let mut oven = Oven::at(100 * SECOND, level);
        oven.run(5.0);
        assert_eq!(oven.on, 0, "off until it is told");
        oven.bench.send(&set(200, 140, 600));
        let mut peak = 0.0_f64;
        for _ in 0..150 {
            oven.run(1.0);
            peak = peak.max(oven.celsius);
        }
        assert!(peak < 205.0, "{peak}");
        for _ in 0..60 {
            oven.run(1.0);
            assert!((oven.celsius - 200.0).abs() < 1.0, "{}", oven.celsius);
        }
        let (temperature, target, power, state) = oven.state();
        assert!((temperature - oven.celsius).abs() < 0.2 && (power - 0.25).abs() < 0.05, "{power}");
        assert_eq!((target, state), (200.0, HOST));
        oven.bench.send(&set(0, 0, 0));
        assert!(!oven.is_on(), "off is at once");
        assert_eq!(oven.state().3, OFF);
        assert_eq!(oven.bench.shutdown(), None);
    }
}

#[test]
fn a_state_comes_with_every_sum_and_at_every_change() {
    let mut oven = Oven::hot();
    oven.bench.board.sent.clear();
    oven.run(3.0);
    assert_eq!(states(&mut oven.bench).len(), 10);
    oven.bench.run_for(10);
    assert!(states(&mut oven.bench).is_empty());
    oven.bench.send(&set(210, 140, 600));
    oven.bench.run_for(10);
    assert_eq!(states(&mut oven.bench).pop().map(|state| state.1), Some(210.0));
}

#[test]
fn a_silent_host_means_stand_by_then_off_and_its_return_changes_nothing() {
    let mut oven = Oven::hot();
    oven.is_attended = false;
    oven.run(4.4);
    assert_eq!(oven.state().3, HOST);
    oven.run(0.7);
    assert_eq!((oven.state().1, oven.state().3), (140.0, STANDBY));
    oven.run(250.0);
    assert!((oven.celsius - 140.0).abs() < 1.5, "{}", oven.celsius);
    // The host is back: stand-by goes on, and so does its time.
    oven.is_attended = true;
    oven.run(250.0);
    assert_eq!((oven.state().1, oven.state().3), (140.0, STANDBY));
    oven.run(110.0);
    assert_eq!((oven.state().1, oven.state().3), (0.0, OVER));
    oven.on = 0;
    oven.run(300.0);
    assert_eq!(oven.on, 0);
    oven.bench.send(&set(200, 140, 600));
    oven.run(150.0);
    assert_eq!(oven.state().3, HOST);
    assert!((oven.celsius - 200.0).abs() < 1.5, "{}", oven.celsius);
    assert_eq!(oven.bench.shutdown(), None);
}

#[test]
fn stand_by_never_heats_more_than_the_target() {
    for (target, standby, standby_s, expected) in [
        (60, 140, 100, (60.0, STANDBY)),
        (200, 0, 100, (0.0, OVER)),
        (200, 140, 0, (0.0, OVER)),
        (0, 140, 100, (0.0, OFF)),
    ] {
        let mut oven = Oven::new();
        oven.bench.send(&set(target, standby, standby_s));
        oven.is_attended = false;
        oven.run(5.5);
        let (_, target, power, state) = oven.state();
        assert_eq!((target, state), expected);
        assert_eq!(power > 0.0, target > 0.0);
    }
}

#[test]
fn without_a_lease_a_target_is_stand_by_from_the_start() {
    let mut oven = Oven::new();
    oven.is_attended = false;
    oven.run(6.0);
    oven.bench.send(&set(200, 140, 600));
    assert_eq!((oven.state().1, oven.state().3), (140.0, STANDBY));
    // A lease that is over counts for nothing, nor does one that came before.
    let past = (oven.bench.board.now - 1) as u32;
    oven.bench.send(&Command::HeaterLease { alive: past });
    oven.bench.send(&set(200, 140, 600));
    assert_eq!(oven.state().3, STANDBY);
    oven.renew();
    oven.bench.send(&Command::HeaterLease { alive: past });
    oven.bench.send(&set(200, 140, 600));
    assert_eq!(oven.state().3, HOST);
}

#[test]
fn stand_by_ends_on_time() {
    for standby_s in [1, 3, 7, 12] {
        let mut oven = Oven::new();
        oven.bench.send(&set(200, 140, standby_s));
        oven.run(20.0);
        oven.is_attended = false;
        // The lease was renewed last half a second ago or less. Nobody asks: that would have the board look at its clock.
        oven.run(4.4 + f64::from(standby_s) - 1.0);
        oven.on = 0;
        oven.run(1.0);
        assert!(oven.on > 0, "{standby_s}");
        oven.run(1.2);
        oven.on = 0;
        oven.run(1.0);
        assert_eq!((oven.on, oven.state().3), (0, OVER), "{standby_s}");
    }
}

#[test]
fn leases_and_stand_by_last_as_long_across_the_wraps_of_the_clock() {
    for before in [1.0, 3.0, 8.0] {
        let mut oven = Oven::at((1 << 32) - (before * SECOND as f64) as u64, 1);
        oven.bench.send(&set(100, 50, 1500));
        oven.run(40.0);
        assert_eq!(oven.state().3, HOST, "renewed across the wrap");
        oven.is_attended = false;
        oven.run(6.0);
        assert_eq!(oven.state().3, STANDBY);
        // Four wraps of a clock at 12 MHz.
        oven.run(1480.0);
        assert_eq!(oven.state().3, STANDBY);
        oven.run(20.0);
        assert_eq!(oven.state().3, OVER);
    }
}

#[test]
fn what_does_not_warm_or_loses_its_warmth_stops_the_board() {
    let mut oven = Oven::new();
    oven.strength = 0.0;
    oven.bench.send(&set(200, 140, 600));
    oven.run(19.0);
    assert_eq!(oven.bench.shutdown(), None);
    oven.shut_down_by(4.0, ShutdownReason::HeaterNotHeating);
    let mut oven = Oven::hot();
    oven.strength = 0.0;
    oven.shut_down_by(40.0, ShutdownReason::HeaterDrifted);
    // Stand-by is watched as well.
    let mut oven = Oven::hot();
    oven.is_attended = false;
    oven.run(200.0);
    oven.strength = 0.0;
    oven.shut_down_by(60.0, ShutdownReason::HeaterDrifted);
}

#[test]
fn a_broken_sensor_stops_the_board() {
    for counts in [0, 4095] {
        let mut oven = Oven::hot();
        let sampled = |oven: &mut Oven, rounds: u64| {
            oven.bench.board.analog[ADC] = counts;
            oven.bench.run_for(rounds * REST);
        };
        sampled(&mut oven, 2);
        assert!(
            !oven.is_on() && oven.bench.shutdown().is_none(),
            "a short one is borne, with the heater off"
        );
        oven.run(3.0);
        assert!(oven.bench.shutdown().is_none());
        sampled(&mut oven, 4);
        assert_eq!(oven.bench.shutdown(), Some(ShutdownReason::HeaterSensor));
    }
}

#[test]
fn a_loop_that_dies_is_noticed_by_its_output() {
    let mut oven = Oven::hot();
    oven.bench.send(&sampling(0, 0));
    oven.shut_down_by(3.2, ShutdownReason::MissedOutput);
}

#[test]
fn an_emergency_stop_switches_off_and_forgets() {
    let mut oven = Oven::new();
    oven.bench.send(&set(200, 140, 600));
    oven.run(5.0);
    assert!(oven.is_on());
    oven.bench.send(&Command::EmergencyStop {});
    assert!(!oven.is_on());
    oven.on = 0;
    oven.run(10.0);
    assert_eq!(oven.on, 0);
    oven.bench.send(&Command::ClearShutdown {});
    oven.bench.send(&Command::AllocateOids { count: 3 });
    oven.bench.send_all(&config(1));
    oven.bench.send(&Command::FinalizeConfig { crc: 1 });
    oven.bench.send(&sampling(oven.bench.board.now + MILLISECOND, READINGS));
    oven.run(5.0);
    assert_eq!((oven.on, oven.state().3), (0, OFF));
}

#[test]
fn pulses_of_every_width_are_whole() {
    let mut oven = Oven::new();
    oven.bench.send(&set(200, 140, 600));
    oven.run(120.0);
    let (rises, falls) = (oven.bench.edges_of(PIN as u8, true), oven.bench.edges_of(PIN as u8, false));
    assert!(rises.len() > 100);
    for (rise, fall) in rises.iter().zip(&falls) {
        assert!(fall > rise);
    }
    // Between the times that it is off altogether, each pulse begins a cycle after the one before.
    let spans: Vec<_> = rises.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let whole = spans.iter().filter(|&&span| span == CYCLE).count();
    assert!(spans.iter().all(|&span| span >= CYCLE), "cut short");
    assert!(whole * 10 > spans.len() * 9, "{whole} of {}", spans.len());
}

#[test]
fn nonsense_is_refused() {
    let lease = |by: i64| Command::HeaterLease { alive: (100 * SECOND as i64 + by) as u32 };
    let running = [
        set(301, 140, 60),
        set(-1, 140, 60),
        set(200, 301, 60),
        set(200, -5, 60),
        set(200, 140, 14_401),
        lease(11 * SECOND as i64),
        Command::UpdateDigitalOut { oid: OUTPUT, value: 1 },
        Command::QueueDigitalOut { oid: OUTPUT, clock: 110 * SECOND as u32, on_ticks: 5 },
        Command::SetDigitalOutPwmCycle { oid: OUTPUT, cycle_ticks: 7 },
        sampling(110 * SECOND, READINGS + 1),
    ];
    for command in running {
        let mut oven = Oven::new();
        oven.bench.send(&command);
        assert_eq!(oven.bench.shutdown(), Some(ShutdownReason::InvalidHeater), "{command:?}");
    }
    let heater = |adc_oid, out_oid, sample_count, max_power, smooth| Command::ConfigHeater {
        oid: HEATER,
        adc_oid,
        out_oid,
        sample_count,
        max_power,
        smooth,
    };
    let check = |max_error, gain_time, hysteresis, gain| Command::HeaterCheck {
        oid: HEATER,
        max_error,
        gain_time,
        hysteresis,
        gain,
    };
    let (wrong, oid) = (ShutdownReason::InvalidHeater, ShutdownReason::InvalidOid);
    let configuring = [
        (3, heater(OUTPUT, OUTPUT, 8, 4096, 1), oid),
        (3, heater(SENSOR, SENSOR, 8, 4096, 1), oid),
        (3, heater(SENSOR, OUTPUT, 0, 4096, 1), wrong),
        (3, heater(SENSOR, OUTPUT, 8, 4097, 1), wrong),
        (3, heater(SENSOR, OUTPUT, 8, 0, 1), wrong),
        (3, heater(SENSOR, OUTPUT, 8, 4096, 0), wrong),
        (2, heater(SENSOR, OUTPUT, 8, 4096, 1), wrong),
        (4, heater(SENSOR, OUTPUT, 8, 4096, 1), oid),
        (4, Command::HeaterPoint { oid: HEATER, sum: 5, temperature: 2_000_001 }, wrong),
        (5, Command::HeaterPoint { oid: HEATER, sum: 5, temperature: 1 }, wrong),
        (4, Command::HeaterPid { oid: SENSOR, kp: 1, ki: 1, kd: 1 }, oid),
        (4, Command::HeaterWatermark { oid: HEATER, delta: 0 }, wrong),
        (4, Command::HeaterWatermark { oid: HEATER, delta: 50_001 }, wrong),
        (4, check(10_000_001, 20_000, 5_000, 2_000), wrong),
        (4, check(120_000, 999, 5_000, 2_000), wrong),
        (4, check(120_000, 600_001, 5_000, 2_000), wrong),
        (4, check(120_000, 20_000, 50_001, 2_000), wrong),
        (4, check(120_000, 20_000, 5_000, 0), wrong),
        (4, set(200, 140, 60), ShutdownReason::NotConfigured),
        (4, lease(1), ShutdownReason::NotConfigured),
    ];
    for (after, command, reason) in configuring {
        let mut bench = Bench::at(100 * SECOND);
        bench.send(&Command::AllocateOids { count: 3 });
        bench.send_all(&config(1)[..after]);
        bench.send(&command);
        assert_eq!(bench.shutdown(), Some(reason), "{command:?}");
    }
}

#[test]
fn a_heater_that_is_not_complete_does_not_heat() {
    // Without its second point, its loop, its check.
    for missing in [&[5, 6][..], &[7], &[8]] {
        let config = config(1);
        let kept = config.iter().enumerate().filter(|(at, _)| !missing.contains(at));
        let kept: Vec<_> = kept.map(|(_, command)| *command).collect();
        let mut bench = Bench::configured(100 * SECOND, &kept);
        bench.send(&set(0, 0, 0));
        assert_eq!(bench.shutdown(), None);
        bench.send(&set(200, 0, 0));
        assert_eq!(bench.shutdown(), Some(ShutdownReason::InvalidHeater), "{missing:?}");
    }
}

#[test]
fn an_output_or_sensor_has_one_heater_and_a_board_few() {
    let heater = |oid, adc_oid, out_oid| Command::ConfigHeater {
        oid,
        adc_oid,
        out_oid,
        sample_count: READINGS,
        max_power: 4096,
        smooth: 1000,
    };
    let sensor = |oid| Command::ConfigAnalogIn { oid, pin: ADC as u32 };
    let output = |oid| {
        let pin = PIN as u32;
        [
            Command::ConfigDigitalOut { oid, pin, value: 0, default_value: 0, max_duration: 1000 },
            Command::SetDigitalOutPwmCycle { oid, cycle_ticks: 1000 },
        ]
    };
    let mut bench = Bench::at(0);
    bench.send(&Command::AllocateOids { count: 16 });
    bench.send_all(&[sensor(0), sensor(1)]);
    bench.send_all(&output(2));
    bench.send_all(&[heater(3, 0, 2), heater(4, 1, 2)]);
    assert_eq!(bench.shutdown(), Some(ShutdownReason::InvalidHeater));
    let mut bench = Bench::at(0);
    bench.send(&Command::AllocateOids { count: 16 });
    for at in 0..5 {
        assert_eq!(bench.shutdown(), None);
        bench.send(&sensor(3 * at));
        bench.send_all(&output(3 * at + 1));
        bench.send(&heater(3 * at + 2, 3 * at, 3 * at + 1));
    }
    assert_eq!(bench.shutdown(), Some(ShutdownReason::OutOfObjects));
}

#[test]
fn plain_boards_know_none_of_it() {
    for command in [Command::HeaterLease { alive: 1 }, Command::HeaterGetState { oid: 0 }] {
        let mut bench = Bench::plain(0);
        bench.send(&command);
        assert_eq!(bench.shutdown(), Some(ShutdownReason::CommandParser));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the host does and whenever it stops: unattended for longer than lease and stand-by, nothing heats.
    #[test]
    fn whoever_left_when_leaves_a_heater_that_goes_off(
        start: u32,
        orders in prop::collection::vec((0..300_i32, 0..200_i32, 0..30_u16, 0.1_f64..9.0, any::<bool>()), 1..6),
    ) {
        let mut oven = Oven::at(u64::from(start), 1);
        for (target, standby, standby_s, seconds, attended) in orders {
            oven.bench.send(&set(target, standby, standby_s));
            oven.is_attended = attended;
            oven.run(seconds);
        }
        oven.is_attended = false;
        oven.run(5.0);
        let mut limit = oven.state().1;
        oven.run(31.0);
        limit = limit.min(oven.state().1);
        oven.on = 0;
        oven.run(2.0);
        prop_assert_eq!(oven.on, 0);
        prop_assert_eq!((limit, oven.bench.shutdown()), (0.0, None));
    }
}
