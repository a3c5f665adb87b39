//! A hot end on a simulated board: its heater's configuration, its physics and what it says of itself.

use wire::{Command, Response, ShutdownReason};

use crate::bench::{Bench, MILLISECOND, SECOND};

pub(crate) const SENSOR: u8 = 0;
pub(crate) const OUTPUT: u8 = 1;
pub(crate) const HEATER: u8 = 2;
pub(crate) const PIN: usize = 17;
pub(crate) const ADC: usize = 26;
/// What the converter reads at 0 °C and at 300 °C; straight in between.
pub(crate) const COLD_COUNTS: f64 = 3900.0;
pub(crate) const HOT_COUNTS: f64 = 100.0;
pub(crate) const READINGS: u8 = 8;
pub(crate) const REST: u64 = 300 * MILLISECOND;
pub(crate) const CYCLE: u64 = 100 * MILLISECOND;
pub(crate) const AMBIENT: f64 = 20.0;

pub(crate) const OFF: u8 = 0;
pub(crate) const HOST: u8 = 1;
pub(crate) const STANDBY: u8 = 2;
pub(crate) const OVER: u8 = 3;

pub(crate) fn counts(celsius: f64) -> u16 {
    (COLD_COUNTS + (HOT_COUNTS - COLD_COUNTS) * celsius / 300.0).clamp(0.0, 4095.0) as u16
}

pub(crate) const fn sampling(clock: u64, sample_count: u8) -> Command<'static> {
    Command::QueryAnalogIn {
        oid: SENSOR,
        clock: clock as u32,
        sample_ticks: MILLISECOND as u32,
        sample_count,
        rest_ticks: REST as u32,
        bytes_per_report: 2,
        min_value: 0,
        max_value: u16::MAX,
        range_check_count: 1,
    }
}

pub(crate) const fn set(celsius: i32, standby: i32, standby_s: u16) -> Command<'static> {
    Command::HeaterSet { oid: HEATER, target: celsius * 1000, standby: standby * 1000, standby_s }
}

pub(crate) const fn gain(duty: f64) -> u32 {
    (duty * (1 << 24) as f64) as u32
}

/// A heater as it is configured, on an output that is on at `level`.
pub(crate) fn config(level: u8) -> Vec<Command<'static>> {
    let point = |celsius: u16| Command::HeaterPoint {
        oid: HEATER,
        sum: counts(f64::from(celsius)) * u16::from(READINGS),
        temperature: i32::from(celsius) * 1000,
    };
    let (value, default_value) = (1 - level, 1 - level);
    vec![
        Command::ConfigAnalogIn { oid: SENSOR, pin: ADC as u32 },
        Command::ConfigDigitalOut {
            oid: OUTPUT,
            pin: PIN as u32,
            value,
            default_value,
            max_duration: 3 * SECOND as u32,
        },
        Command::SetDigitalOutPwmCycle { oid: OUTPUT, cycle_ticks: CYCLE as u32 },
        Command::ConfigHeater {
            oid: HEATER,
            adc_oid: SENSOR,
            out_oid: OUTPUT,
            sample_count: READINGS,
            max_power: 4096,
            smooth: 1000,
        },
        point(300),
        point(150),
        point(0),
        Command::HeaterPid { oid: HEATER, kp: gain(0.08), ki: gain(0.003), kd: gain(0.3) },
        Command::HeaterCheck {
            oid: HEATER,
            max_error: 120_000,
            gain_time: 20_000,
            hysteresis: 5_000,
            gain: 2_000,
        },
    ]
}

/// A board with a hot end.
pub(crate) struct Oven {
    pub(crate) bench: Bench,
    pub(crate) celsius: f64,
    /// The share of power that the heater gives of what it is told.
    pub(crate) strength: f64,
    /// The host renews its lease.
    pub(crate) is_attended: bool,
    /// Active level of the output.
    pub(crate) level: bool,
    pub(crate) on: u64,
    pub(crate) steps: u64,
}

impl Oven {
    pub(crate) fn at(now: u64, level: u8) -> Self {
        let mut bench = Bench::configured(now, &config(level));
        bench.board.analog[ADC] = counts(AMBIENT);
        bench.send(&sampling(now + MILLISECOND, READINGS));
        let mut oven = Self {
            bench,
            celsius: AMBIENT,
            strength: 1.0,
            is_attended: true,
            level: level != 0,
            on: 0,
            steps: 0,
        };
        oven.renew();
        oven
    }

    pub(crate) fn new() -> Self {
        Self::at(100 * SECOND, 1)
    }

    pub(crate) fn renew(&mut self) {
        let alive = (self.bench.board.now + 5 * SECOND) as u32;
        self.bench.send(&Command::HeaterLease { alive });
    }

    pub(crate) fn is_on(&self) -> bool {
        self.bench.board.levels[PIN] == self.level
    }

    pub(crate) fn run(&mut self, seconds: f64) {
        const STEP: u64 = 5 * MILLISECOND;
        let until = self.bench.board.now + (seconds * SECOND as f64) as u64;
        while self.bench.board.now < until {
            if self.is_attended && self.steps.is_multiple_of(100) {
                self.renew();
            }
            self.steps += 1;
            let duty = if self.is_on() { self.strength } else { 0.0 };
            self.on += u64::from(self.is_on());
            let rate = 3.6 * duty - 0.005 * (self.celsius - AMBIENT);
            self.celsius += rate * STEP as f64 / SECOND as f64;
            self.bench.board.analog[ADC] = counts(self.celsius);
            self.bench.run_for(STEP);
        }
    }

    /// The last thing said: temperature and target in °C, power 0 … 1, state.
    pub(crate) fn state(&mut self) -> (f64, f64, f64, u8) {
        self.bench.board.sent.clear();
        self.bench.send(&Command::HeaterGetState { oid: HEATER });
        states(&mut self.bench).pop().unwrap_or_else(|| panic!("{:?}", self.bench.shutdown()))
    }

    pub(crate) fn hot() -> Self {
        let mut oven = Self::new();
        oven.bench.send(&set(200, 140, 600));
        oven.run(150.0);
        assert!((oven.celsius - 200.0).abs() < 1.5, "{}", oven.celsius);
        oven
    }

    #[track_caller]
    pub(crate) fn shut_down_by(&mut self, seconds: f64, reason: ShutdownReason) {
        self.run(seconds);
        assert_eq!(self.bench.shutdown(), Some(reason));
        assert!(!self.is_on());
        self.on = 0;
        self.run(30.0);
        assert_eq!(self.on, 0, "it heats after all");
    }
}

pub(crate) fn states(bench: &mut Bench) -> Vec<(f64, f64, f64, u8)> {
    bench.pick(|response| match *response {
        Response::HeaterState { oid: HEATER, temperature, target, power, state, .. } => {
            let milli = |value: i32| f64::from(value) / 1000.0;
            Some((milli(temperature), milli(target), f64::from(power) / 4096.0, state))
        }
        _ => None,
    })
}
