//! A heater on a small thermal model: it must regulate, wait and warm in peace, and every fault must end it in time.

use proptest::prelude::*;
use units::{Celsius, Seconds};

use super::*;
use crate::config;

const SAMPLE: f64 = 0.3;
const AMBIENT: f64 = 22.0;

fn machine() -> config::PrinterConfig {
    let (machine, diagnostics) = config::parse(config::SMALL_MACHINE);
    machine.unwrap_or_else(|| panic!("{diagnostics:#?}"))
}

fn hot_end() -> Heater {
    Heater::new(machine().extruder.unwrap().heater)
}

fn bed() -> Heater {
    Heater::new(machine().heater_bed.unwrap())
}

/// A heated block and a sensor that follows it.
struct Plant {
    power_w: f64,
    capacity_j_per_k: f64,
    loss_w_per_k: f64,
    sensor_lag_s: f64,
    block: f64,
    sensor: f64,
    /// Heat taken away by filament.
    load_w: f64,
}

impl Plant {
    fn hot_end() -> Self {
        Self {
            power_w: 45.0,
            capacity_j_per_k: 12.0,
            loss_w_per_k: 0.09,
            sensor_lag_s: 2.0,
            block: AMBIENT,
            sensor: AMBIENT,
            load_w: 0.0,
        }
    }

    fn bed() -> Self {
        Self {
            power_w: 250.0,
            capacity_j_per_k: 900.0,
            loss_w_per_k: 1.5,
            sensor_lag_s: 6.0,
            ..Self::hot_end()
        }
    }

    /// Lets one sample interval pass and gives the sensor's reading.
    fn step(&mut self, duty: f64) -> Celsius {
        const SUB_STEPS: u32 = 30;
        let dt = SAMPLE / f64::from(SUB_STEPS);
        for _ in 0..SUB_STEPS {
            let flow = duty * self.power_w - self.loss_w_per_k * (self.block - AMBIENT) - self.load_w;
            self.block += flow / self.capacity_j_per_k * dt;
            self.sensor += (self.block - self.sensor) / self.sensor_lag_s * dt;
        }
        Celsius(self.sensor)
    }
}

/// A heater and its plant in virtual time.
struct Bench {
    heater: Heater,
    plant: Plant,
    now: f64,
    duty: f64,
    /// What the reading is replaced by, and whether the power reaches the block.
    broken_sensor: Option<fn(f64) -> f64>,
    broken_heater: bool,
}

impl Bench {
    fn new(heater: Heater, plant: Plant) -> Self {
        Self { heater, plant, now: 0.0, duty: 0.0, broken_sensor: None, broken_heater: false }
    }

    fn step(&mut self) -> Result<f64, HeaterFault> {
        let reading = self.plant.step(if self.broken_heater { 0.0 } else { self.duty });
        let reading = self.broken_sensor.map_or(reading, |broken| Celsius(broken(reading.0)));
        self.now += SAMPLE;
        let result = self.heater.sample(reading, Seconds(self.now));
        self.duty = *result.as_ref().unwrap_or(&0.0);
        result
    }

    /// Runs for a time; gives the lowest and highest reading.
    fn run(&mut self, seconds: f64) -> (f64, f64) {
        let until = self.now + seconds;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        while self.now < until {
            self.step()
                .unwrap_or_else(|fault| panic!("{fault:?} at {} s, {} °C", self.now, self.plant.sensor));
            low = low.min(self.plant.sensor);
            high = high.max(self.plant.sensor);
        }
        (low, high)
    }

    /// Seconds until a fault, which must come within `limit`.
    fn time_to_fault(&mut self, limit: f64) -> (HeaterFault, f64) {
        let start = self.now;
        while self.now < start + limit {
            if let Err(fault) = self.step() {
                return (fault, self.now - start);
            }
        }
        panic!("no fault within {limit} s, {} °C", self.plant.sensor);
    }
}

#[test]
fn the_hot_end_warms_without_much_overshoot_and_holds() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.run(2.0);
    bench.heater.set_target(Celsius(205.0)).unwrap();
    let (_, high) = bench.run(180.0);
    assert!(high < 210.0, "overshoot to {high}");
    let (low, high) = bench.run(60.0);
    assert!(low > 204.5 && high < 205.5, "{low} to {high}");
    // Filament takes 4 W away all at once.
    bench.plant.load_w = 4.0;
    let (low, _) = bench.run(60.0);
    assert!(low > 202.0, "{low}");
    bench.heater.set_target(Celsius(230.0)).unwrap();
    let (_, high) = bench.run(120.0);
    assert!(high < 235.0, "overshoot to {high}");
    bench.heater.set_target(Celsius(190.0)).unwrap();
    bench.run(120.0);
    let (low, high) = bench.run(30.0);
    assert!(low > 189.0 && high < 191.0, "{low} to {high}");
}

#[test]
fn waits_end_when_the_heater_has_settled_and_not_while_it_overshoots() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.run(1.0);
    assert!(bench.heater.is_heated() && bench.heater.is_settled(), "nothing to wait for");
    bench.heater.set_target(Celsius(205.0)).unwrap();
    assert!(!bench.heater.is_heated() && !bench.heater.is_settled());
    let mut waited = 0.0;
    while !bench.heater.is_settled() {
        bench.run(SAMPLE);
        waited += SAMPLE;
        assert!(waited < 300.0);
    }
    let (low, high) = bench.run(60.0);
    assert!(low > 203.0 && high < 207.0, "{low} to {high} after the wait");
    // Cooling: "at least" is over at once, "from either side" is not.
    bench.heater.set_target(Celsius(180.0)).unwrap();
    bench.run(SAMPLE);
    assert!(bench.heater.is_heated() && !bench.heater.is_settled());
    bench.run(120.0);
    assert!(bench.heater.is_settled());
}

#[test]
fn a_noisy_converter_delays_no_wait_for_long() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.run(1.0);
    // What 12 bits behind 4.7 kΩ make of 205 °C, summed eight times: about ±0.3 °C, here at its ends.
    bench.broken_sensor = Some(|sensor| sensor + 0.3 * libm::copysign(1.0, libm::sin(sensor * 1e4)));
    bench.heater.set_target(Celsius(205.0)).unwrap();
    while !bench.heater.is_settled() {
        bench.run(SAMPLE);
        assert!(bench.now < 200.0, "still waiting at {} °C", bench.plant.sensor);
    }
    let (low, high) = bench.run(60.0);
    assert!(low > 203.0 && high < 207.0, "{low} to {high} after the wait");
}

#[test]
fn the_bed_swings_around_its_target() {
    let mut bench = Bench::new(bed(), Plant::bed());
    bench.run(1.0);
    bench.heater.set_target(Celsius(60.0)).unwrap();
    bench.run(600.0);
    let (low, high) = bench.run(600.0);
    assert!(low > 56.0 && high < 64.0, "{low} to {high}");
    assert!(low < 59.0 && high > 61.0, "it must swing: {low} to {high}");
}

#[test]
fn a_dead_heater_is_found_in_the_time_to_gain() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.broken_heater = true;
    bench.run(1.0);
    bench.heater.set_target(Celsius(205.0)).unwrap();
    let (fault, time) = bench.time_to_fault(30.0);
    assert_eq!(fault, HeaterFault::NotHeating);
    assert!((19.0..22.0).contains(&time), "{time}");

    let mut bench = Bench::new(bed(), Plant::bed());
    bench.broken_heater = true;
    bench.run(1.0);
    bench.heater.set_target(Celsius(60.0)).unwrap();
    let (fault, time) = bench.time_to_fault(90.0);
    assert_eq!(fault, HeaterFault::NotHeating);
    assert!((59.0..62.0).contains(&time), "{time}");
}

#[test]
fn a_dead_heater_is_found_though_its_target_keeps_changing() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.plant.power_w = 0.0;
    let mut fault = None;
    for round in 0..60 {
        bench.heater.set_target(Celsius(if round % 2 == 0 { 200.0 } else { 201.0 })).ok();
        for _ in 0..10 {
            fault = fault.or(bench.step().err());
        }
    }
    assert_eq!(fault, Some(HeaterFault::NotHeating));
}

#[test]
fn a_heater_that_dies_while_printing_is_found() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.heater.set_target(Celsius(205.0)).unwrap();
    bench.run(180.0);
    bench.broken_heater = true;
    let (fault, time) = bench.time_to_fault(60.0);
    assert_eq!(fault, HeaterFault::Drifted);
    assert!(time < 25.0, "{time}");
    assert!(!bench.heater.can_extrude());
}

#[test]
fn a_sensor_that_fell_out_is_found_before_the_block_gets_dangerous() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.heater.set_target(Celsius(205.0)).unwrap();
    bench.run(180.0);
    // In the open air it reads a third of the way between room and block.
    bench.broken_sensor = Some(|block| AMBIENT + (block - AMBIENT) / 3.0);
    let (fault, time) = bench.time_to_fault(60.0);
    assert_eq!(fault, HeaterFault::Drifted);
    assert!(time < 3.0, "{time}");
    assert!(bench.plant.block < 225.0, "{}", bench.plant.block);
}

#[test]
fn readings_outside_the_range_end_the_heater_at_once_and_for_good() {
    for (reading, fault) in [
        (-50.0, HeaterFault::BelowMin),
        (f64::NAN, HeaterFault::BelowMin),
        (f64::NEG_INFINITY, HeaterFault::BelowMin),
        (f64::INFINITY, HeaterFault::BelowMin),
        (261.0, HeaterFault::AboveMax),
    ] {
        let mut heater = hot_end();
        heater.sample(Celsius(200.0), Seconds(0.0)).unwrap();
        heater.set_target(Celsius(205.0)).unwrap();
        assert!(heater.sample(Celsius(200.0), Seconds(0.3)).unwrap() > 0.0);
        assert_eq!(heater.sample(Celsius(reading), Seconds(0.6)), Err(fault));
        assert_eq!((heater.duty(), heater.target()), (0.0, Celsius::ZERO));
        assert!(!heater.can_extrude());
        // A sensor that comes back does not bring the heater back.
        assert_eq!(heater.sample(Celsius(200.0), Seconds(0.9)), Err(fault));
        assert_eq!(heater.set_target(Celsius(205.0)).unwrap_err().code, fault.code());
        assert!(heater.set_target(Celsius::ZERO).is_ok());
    }
}

#[test]
fn targets_outside_the_limits_are_refused_and_change_nothing() {
    let mut heater = hot_end();
    heater.set_target(Celsius(200.0)).unwrap();
    for target in [-1.0, 261.0, f64::NAN, f64::INFINITY] {
        let error = heater.set_target(Celsius(target)).unwrap_err();
        assert_eq!(error.code, ErrorCode::TargetOutOfRange);
        assert_eq!(heater.target(), Celsius(200.0));
    }
    heater.set_target(Celsius::ZERO).unwrap();
    assert_eq!(heater.target(), Celsius::ZERO);
}

#[test]
fn filament_moves_only_at_a_known_sufficient_temperature() {
    let mut heater = hot_end();
    assert!(!heater.can_extrude(), "nothing measured yet");
    heater.sample(Celsius(169.0), Seconds(0.0)).unwrap();
    assert!(!heater.can_extrude());
    for step in 1..20 {
        heater.sample(Celsius(180.0), Seconds(f64::from(step) * SAMPLE)).unwrap();
    }
    assert!(heater.can_extrude());
}

#[test]
fn a_host_clock_that_stops_or_jumps_does_no_harm() {
    let mut heater = hot_end();
    heater.set_target(Celsius(205.0)).unwrap();
    for now in [0.0, 5.0, 5.0, 1.0, f64::NAN, 5.3, 1e6, 1e6 + 0.3] {
        let duty = heater.sample(Celsius(200.0), Seconds(now)).unwrap();
        assert!((0.0..=1.0).contains(&duty));
    }
}

#[test]
fn a_stall_of_the_host_is_not_taken_for_a_fault() {
    let mut bench = Bench::new(hot_end(), Plant::hot_end());
    bench.heater.set_target(Celsius(205.0)).unwrap();
    bench.run(180.0);
    // The board has switched the heater off; the host comes back after a minute.
    bench.duty = 0.0;
    for _ in 0..200 {
        bench.plant.step(0.0);
        bench.now += SAMPLE;
    }
    let (low, _) = bench.run(120.0);
    assert!(low < 190.0, "it must have cooled: {low}");
    let (low, high) = bench.run(30.0);
    assert!(low > 204.0 && high < 206.0, "{low} to {high}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_healthy_hot_end_never_faults(
        power_w in 30.0_f64..70.0,
        capacity_j_per_k in 8.0_f64..20.0,
        loss_w_per_k in 0.05_f64..0.10,
        sensor_lag_s in 0.5_f64..4.0,
        targets in prop::collection::vec((170.0_f64..240.0, 1.0_f64..120.0, 0.0_f64..3.0), 1..6),
    ) {
        let plant = Plant { power_w, capacity_j_per_k, loss_w_per_k, sensor_lag_s, ..Plant::hot_end() };
        let mut bench = Bench::new(hot_end(), plant);
        for (target, seconds, load_w) in targets {
            bench.heater.set_target(Celsius(target)).unwrap();
            bench.plant.load_w = load_w;
            let until = bench.now + seconds;
            while bench.now < until {
                let result = bench.step();
                prop_assert!(result.is_ok(), "{:?} at {} s, {} °C", result, bench.now, bench.plant.sensor);
                prop_assert!((0.0..=1.0).contains(&bench.duty));
            }
        }
    }

    #[test]
    fn a_healthy_bed_never_faults(
        power_w in 150.0_f64..400.0,
        capacity_j_per_k in 500.0_f64..1500.0,
        target in 40.0_f64..100.0,
    ) {
        let mut bench = Bench::new(bed(), Plant { power_w, capacity_j_per_k, ..Plant::bed() });
        // A bed that cannot warm even by heating_gain in check_gain_time is one to refuse.
        let power_left = power_w - 1.5 * (target - AMBIENT);
        prop_assume!(power_left / capacity_j_per_k * 60.0 > 4.0);
        bench.heater.set_target(Celsius(target)).unwrap();
        while bench.now < 1_200.0 {
            let result = bench.step();
            prop_assert!(result.is_ok(), "{:?} at {} s, {} °C", result, bench.now, bench.plant.sensor);
        }
    }

    #[test]
    fn a_dead_hot_end_always_faults_in_time(start in 15.0_f64..150.0, target in 170.0_f64..250.0) {
        prop_assume!(target - start > 20.0);
        let mut plant = Plant::hot_end();
        (plant.block, plant.sensor) = (start, start);
        let mut bench = Bench::new(hot_end(), plant);
        bench.broken_heater = true;
        bench.run(1.0);
        bench.heater.set_target(Celsius(target)).unwrap();
        let (_, time) = bench.time_to_fault(30.0);
        prop_assert!(time < 30.0);
    }

    #[test]
    fn any_samples_give_a_duty_in_range_or_a_lasting_fault(
        samples in prop::collection::vec((prop::num::f64::ANY, prop::num::f64::ANY, -10.0_f64..300.0), 0..60),
    ) {
        let mut heater = hot_end();
        let mut failed = None;
        for (temperature, now, target) in samples {
            let _ = heater.set_target(Celsius(target));
            match heater.sample(Celsius(temperature), Seconds(now)) {
                Ok(duty) => {
                    prop_assert!((0.0..=1.0).contains(&duty));
                    prop_assert_eq!(failed, None);
                }
                Err(fault) => {
                    prop_assert!(failed.is_none_or(|first| first == fault));
                    failed = Some(fault);
                    prop_assert_eq!(heater.duty(), 0.0);
                }
            }
        }
    }
}
