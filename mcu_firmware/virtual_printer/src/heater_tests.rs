use super::*;

/// A controller as hosts have it: gains in units of 255, derivative of the measured value smoothed over a second,
/// sampled every 0.3 s.
struct Pid {
    integral: f64,
    slope: f64,
    last_c: f64,
}

impl Pid {
    const PERIOD_S: f64 = 0.3;
    const GAINS: [f64; 3] = [22.2 / 255.0, 1.08 / 255.0, 114.0 / 255.0];

    fn duty(&mut self, target_c: f64, sensor_c: f64) -> f64 {
        let [kp, ki, kd] = Self::GAINS;
        self.slope += ((sensor_c - self.last_c) / Self::PERIOD_S - self.slope) * Self::PERIOD_S;
        self.last_c = sensor_c;
        let error = target_c - sensor_c;
        let integral = (self.integral + error * Self::PERIOD_S).clamp(0.0, 1.0 / ki);
        let wanted = kp * error + ki * integral - kd * self.slope;
        if (0.0..=1.0).contains(&wanted) {
            self.integral = integral;
        }
        wanted.clamp(0.0, 1.0)
    }
}

/// Runs a controlled hot end; `load` gives target, fan and flow (mm³/s) at a time; `seen` gets time, body, target.
fn regulate(seconds: f64, load: impl Fn(f64) -> (f64, f64, f64), mut seen: impl FnMut(f64, f64, f64)) {
    let mut heater = HeaterState::new(Plant::hot_end());
    let mut fan = FanState::default();
    let mut pid = Pid { integral: 0.0, slope: 0.0, last_c: heater.sensor_c };
    let mut duty = 0.0;
    for step in 0..(seconds / THERMAL_STEP_S) as u32 {
        let time = f64::from(step) * THERMAL_STEP_S;
        let (target, fan_duty, flow) = load(time);
        if step % 30 == 0 {
            duty = pid.duty(target, heater.sensor_c);
        }
        fan.step(fan_duty);
        heater.step(duty, fan.speed, flow * THERMAL_STEP_S);
        seen(time, heater.body_c, target);
    }
}

#[test]
fn a_hot_end_warms_as_hot_ends_do() {
    let mut heater = HeaterState::new(Plant::hot_end());
    let mut steps = 0;
    while heater.body_c < 210.0 && steps < 20_000 {
        heater.step(1.0, 0.0, 0.0);
        steps += 1;
    }
    let took_s = f64::from(steps) * THERMAL_STEP_S;
    assert!((60.0..90.0).contains(&took_s), "{took_s}");
    for _ in 0..60_000 {
        heater.step(0.0, 0.0, 0.0);
    }
    assert!((22.0..40.0).contains(&heater.body_c), "cold again after ten minutes: {}", heater.body_c);
}

#[test]
fn usual_gains_hold_the_nozzle_through_fan_and_flow() {
    let (mut top, mut worst) = (0.0_f64, 0.0_f64);
    let load = |time: f64| match time {
        t if t < 200.0 => (215.0, 0.0, 0.0),
        t if t < 260.0 => (215.0, 0.0, 6.0),
        t if t < 330.0 => (215.0, 1.0, 8.0),
        t if t < 380.0 => (215.0, 0.3, 2.0),
        _ => (215.0, 1.0, 10.0),
    };
    regulate(450.0, load, |time, body, target| {
        top = top.max(body - target);
        if time > 200.0 {
            worst = worst.max((body - target).abs());
        }
    });
    assert!(top < 5.0, "overshoot {top}");
    assert!(worst < 2.5, "error while extruding {worst}");
}

#[test]
fn a_bed_is_held_by_switching_it_on_and_off() {
    let mut bed = HeaterState::new(Plant::bed());
    let (mut on, mut steps_to_60, mut low, mut high) = (true, 0, f64::MAX, f64::MIN);
    for step in 0..90_000 {
        if step % 30 == 0 {
            on = if on { bed.sensor_c < 62.0 } else { bed.sensor_c <= 58.0 };
        }
        bed.step(if on { 1.0 } else { 0.0 }, 0.0, 0.0);
        if steps_to_60 == 0 && bed.body_c >= 60.0 {
            steps_to_60 = step;
        }
        if step > 45_000 {
            low = low.min(bed.body_c);
            high = high.max(bed.body_c);
        }
    }
    // 250 W on 3 mm of aluminium, a steel sheet and the heater itself: two minutes, more or less.
    assert!((9_000..18_000).contains(&steps_to_60), "{steps_to_60}");
    assert!(low > 56.0 && high < 66.0, "{low} .. {high}");
}

#[test]
fn the_meter_measures_shares() {
    let mut meter = DutyMeter::new(0);
    meter.set(100, true);
    meter.set(350, false);
    assert_eq!(meter.take(1000, 1000), 0.25);
    meter.set(1500, true);
    assert_eq!(meter.take(2000, 1000), 0.5);
    assert_eq!(meter.take(3000, 1000), 1.0);
}

#[test]
fn plants_that_cannot_be_integrated_are_refused() {
    assert!(Plant::hot_end().is_sound() && Plant::bed().is_sound());
    assert!(!Plant { body_j_k: 1e-6, ..Plant::hot_end() }.is_sound());
    assert!(!Plant { power_w: f64::INFINITY, ..Plant::hot_end() }.is_sound());
}
