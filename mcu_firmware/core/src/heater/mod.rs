//! Heaters that the board regulates by itself, and what becomes of them when the host falls silent
//! (docs/board-heaters.md).
//!
//! A heater takes the sums of an analog input and gives the share of time that an output is on. While the host's lease
//! runs it holds the host's target; then a stand-by temperature for a set time; then nothing. Only a new target ends
//! that. Knows no pins. Temperatures in 1/1000 °C, power in [`control::FULL`]ths, clocks in ticks.

mod check;
mod control;
mod table;

use units::{Clock32, Hertz};
use wire::{Response, ShutdownReason};

use self::{
    check::Check,
    control::{Control, FULL, Pid, SECOND_BITS, Watermark},
    table::Table,
};

/// The most heaters of a board.
pub(crate) const HEATERS_MAX: usize = 4;
/// A host may vouch for itself this far ahead.
const LEASE_SECONDS_MAX: u32 = 10;
/// Stand-by for longer than this is not to be left alone.
const STANDBY_SECONDS_MAX: u16 = 4 * 3600;
/// Sums further apart than this count as this far apart: what was not seen must not be integrated over …
const GAP_SECONDS_MAX: i64 = 2;
/// … and after this much longer a gap, what was known of a climb is void.
const GAP_RESTART_SECONDS: i64 = 3;
/// So many sums in a row outside of the sensor's curve are a fault.
const OUTSIDE_MAX: u8 = 4;
/// Full power on the wire.
const POWER_ONE: u16 = 4096;
/// What an output is told is in this share of its cycle.
pub(crate) const SHARE_ONE: u32 = 1 << 16;
/// Limits of what the host may ask for, in 1/1000 °C, s or ms.
const HYSTERESIS_MAX: u32 = 50_000;
const GAIN_MAX: u32 = 50_000;
const GAIN_TIME_MS: core::ops::RangeInclusive<u32> = 1_000..=600_000;
const ERROR_MAX: u32 = 10_000_000;
/// What is said of a sensor that has not been read.
const UNREAD: i32 = i32::MIN;
/// Clocks further ahead than this are not compared.
const STANDBY_TOLD_MAX: u32 = 1 << 30;

const WRONG: ShutdownReason = ShutdownReason::InvalidHeater;

/// Whose will a heater follows; as on the wire.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
enum State {
    Off = 0,
    /// The host's target.
    Host = 1,
    /// The host fell silent: stand-by, for a time.
    Standby = 2,
    /// That time is over.
    Over = 3,
}

/// A sum of readings that has just been made.
#[derive(Clone, Copy)]
pub(crate) struct Sum {
    pub(crate) clock: Clock32,
    pub(crate) value: u16,
}

/// What `config_heater` says.
#[derive(Clone, Copy)]
pub(crate) struct Wiring {
    pub(crate) oid: u8,
    pub(crate) adc: u8,
    pub(crate) out: u8,
    pub(crate) sample_count: u8,
    /// In 1/4096.
    pub(crate) max_power: u16,
    /// Over how long the slope is averaged, ms.
    pub(crate) smooth: u16,
}

/// What `heater_set` says.
#[derive(Clone, Copy)]
pub(crate) struct Target {
    pub(crate) milli: i32,
    pub(crate) standby: i32,
    pub(crate) standby_s: u16,
}

const OFF: Target = Target { milli: 0, standby: 0, standby_s: 0 };

/// What an output has to do.
pub(crate) struct Drive {
    pub(crate) out: u8,
    /// Of [`SHARE_ONE`].
    pub(crate) share: u32,
}

pub(crate) struct Heater {
    pub(crate) wiring: Wiring,
    table: Table,
    control: Control,
    check: Option<Check>,
    wanted: Target,
    state: State,
    /// Of the stand-by time, in ticks.
    left: u64,
    milli: i32,
    /// Of the last sum.
    clock: Option<Clock32>,
    outside: u8,
    share: u32,
    sum: Option<Sum>,
    pub(crate) report_pending: bool,
}

impl Heater {
    pub(crate) fn new(wiring: Wiring) -> Result<Self, ShutdownReason> {
        if wiring.sample_count == 0 || !(1..=POWER_ONE).contains(&wiring.max_power) || wiring.smooth == 0 {
            return Err(WRONG);
        }
        Ok(Self {
            wiring,
            table: Table::new(),
            control: Control::None,
            check: None,
            wanted: OFF,
            state: State::Off,
            left: 0,
            milli: UNREAD,
            clock: None,
            outside: 0,
            share: 0,
            sum: None,
            report_pending: false,
        })
    }

    pub(crate) fn add_point(&mut self, sum: u16, milli: i32) -> Result<(), ShutdownReason> {
        self.table.add(sum, milli)
    }

    pub(crate) fn set_pid(&mut self, kp: u32, ki: u32, kd: u32) {
        self.control = Control::Pid(Pid::new(kp, ki, kd, units_of(u32::from(self.wiring.smooth))));
    }

    pub(crate) const fn set_watermark(&mut self, delta: u32) -> Result<(), ShutdownReason> {
        if delta == 0 || delta > HYSTERESIS_MAX {
            return Err(WRONG);
        }
        self.control = Control::Watermark(Watermark::new(delta as i32));
        Ok(())
    }

    pub(crate) fn set_check(
        &mut self,
        max_error: u32,
        gain_time_ms: u32,
        hysteresis: u32,
        gain: u32,
    ) -> Result<(), ShutdownReason> {
        let is_sound = max_error <= ERROR_MAX
            && GAIN_TIME_MS.contains(&gain_time_ms)
            && hysteresis <= HYSTERESIS_MAX
            && (1..=GAIN_MAX).contains(&gain);
        if !is_sound {
            return Err(WRONG);
        }
        self.check = Some(Check::new(max_error, units_of(gain_time_ms), hysteresis as i32, gain as i32));
        Ok(())
    }

    /// A new target of a host that lives until the lease ends, or is not known to live.
    fn set(&mut self, target: Target, is_alive: bool, clock: Hertz) -> Result<(), ShutdownReason> {
        let is_complete =
            self.table.is_complete() && self.check.is_some() && !matches!(self.control, Control::None);
        let is_allowed = |milli| milli == 0 || milli > 0 && self.table.contains(milli);
        let is_sound = is_allowed(target.milli)
            && is_allowed(target.standby)
            && target.standby_s <= STANDBY_SECONDS_MAX
            && (target.milli == 0 || is_complete);
        if !is_sound {
            return Err(WRONG);
        }
        self.wanted = target;
        self.state = if target.milli == 0 { State::Off } else { State::Host };
        self.report_pending = true;
        if !is_alive {
            self.fall_back(clock);
        }
        Ok(())
    }

    /// The host fell silent.
    fn fall_back(&mut self, clock: Hertz) {
        if self.state == State::Host {
            self.left = u64::from(self.wanted.standby_s) * u64::from(clock.0);
            self.state = if self.left > 0 && self.wanted.standby > 0 { State::Standby } else { State::Over };
            self.report_pending = true;
        }
    }

    /// So many ticks have passed.
    fn pass(&mut self, ticks: u64) {
        if self.state == State::Standby {
            self.left = self.left.saturating_sub(ticks);
            if self.left == 0 {
                self.state = State::Over;
                self.report_pending = true;
            }
        }
    }

    /// When the stand-by time is over, where that is near enough to be told as a clock.
    fn standby_ends(&self, seen: Clock32) -> Option<Clock32> {
        let left = u32::try_from(self.left).ok().filter(|&left| left < STANDBY_TOLD_MAX)?;
        (self.state == State::Standby).then(|| seen.wrapping_add(left))
    }

    /// What is held; 0 is off.
    fn target(&self) -> i32 {
        match self.state {
            State::Off | State::Over => 0,
            State::Host => self.wanted.milli,
            State::Standby => self.wanted.milli.min(self.wanted.standby),
        }
    }

    /// Whether there is something for [`Self::step`] to do.
    fn is_due(&self) -> bool {
        self.sum.is_some() || (self.share > 0 && self.target() == 0)
    }

    /// Takes a sum in, if there is one; what the output has to do then.
    fn step(&mut self, clock: Hertz) -> Result<Drive, ShutdownReason> {
        self.share = match self.sum.take() {
            Some(sum) => self.regulate(sum, clock)?,
            None if self.target() == 0 => 0,
            None => self.share,
        };
        if self.target() == 0 {
            self.control.reset();
        }
        self.report_pending = true;
        Ok(Drive { out: self.wiring.out, share: self.share })
    }

    fn regulate(&mut self, sum: Sum, clock: Hertz) -> Result<u32, ShutdownReason> {
        let dt = self.time_since(sum.clock, clock);
        self.clock = Some(sum.clock);
        let Some(milli) = self.table.read(sum.value) else {
            self.outside = self.outside.saturating_add(1);
            return if self.outside >= OUTSIDE_MAX { Err(ShutdownReason::HeaterSensor) } else { Ok(0) };
        };
        self.outside = 0;
        self.milli = milli;
        let target = self.target();
        if let Some(check) = &mut self.check {
            if dt.is_none() {
                check.restart();
            }
            check.look(milli, target, dt.unwrap_or(0))?;
        }
        let power_max = FULL / i64::from(POWER_ONE) * i64::from(self.wiring.max_power);
        let power = self.control.update(milli, target, dt.unwrap_or(0), power_max);
        Ok((power / (FULL / i64::from(SHARE_ONE))) as u32)
    }

    /// Since the last sum, in 1/1024 s; nothing where that is too long ago to go on from.
    fn time_since(&self, now: Clock32, clock: Hertz) -> Option<i64> {
        let ticks = i64::from(now.since(self.clock?));
        let hertz = i64::from(clock.0.max(1));
        if !(0..GAP_RESTART_SECONDS * hertz).contains(&ticks) {
            return None;
        }
        // In 32 bits where they do: a chip may have no division by more.
        let unit = (clock.0 >> SECOND_BITS).max(1);
        Some(i64::from(ticks as u32 / unit).min(GAP_SECONDS_MAX << SECOND_BITS))
    }

    pub(crate) fn report(&self, now: Clock32) -> Response<'static> {
        let share = self.share * u32::from(POWER_ONE) / SHARE_ONE;
        Response::HeaterState {
            oid: self.wiring.oid,
            clock: self.clock.unwrap_or(now).0,
            temperature: self.milli,
            target: self.target(),
            power: share as u16,
            state: self.state as u8,
        }
    }
}

/// Of milliseconds, in 1/1024 s.
fn units_of(ms: u32) -> i64 {
    ((i64::from(ms) << SECOND_BITS) / 1000).max(1)
}

/// All heaters of a board, and the lease of the host that they follow.
pub(crate) struct Heaters {
    slots: [Option<Heater>; HEATERS_MAX],
    clock: Hertz,
    /// Until when the host counts as alive.
    alive: Option<Clock32>,
    /// The clock that was last looked at.
    seen: Clock32,
    /// There are sums to be taken in, or something to be said.
    pub(crate) is_due: bool,
}

impl Heaters {
    pub(crate) const fn new(clock: Hertz) -> Self {
        Self { slots: [const { None }; HEATERS_MAX], clock, alive: None, seen: Clock32(0), is_due: false }
    }

    pub(crate) fn add(&mut self, heater: Heater) -> Result<(), ShutdownReason> {
        let slot = self.slots.iter_mut().find(|slot| slot.is_none());
        *slot.ok_or(ShutdownReason::OutOfObjects)? = Some(heater);
        Ok(())
    }

    pub(crate) fn get(&mut self, oid: u8) -> Result<&mut Heater, ShutdownReason> {
        self.all().find(|heater| heater.wiring.oid == oid).ok_or(ShutdownReason::InvalidOid)
    }

    pub(crate) fn all(&mut self) -> impl Iterator<Item = &mut Heater> {
        self.slots.iter_mut().flatten()
    }

    /// The heater that an analog input feeds.
    pub(crate) fn fed_by(&mut self, adc: u8) -> Option<&mut Heater> {
        self.all().find(|heater| heater.wiring.adc == adc)
    }

    /// A sum of an analog input.
    pub(crate) fn feed(&mut self, adc: u8, sum: Sum) {
        if let Some(heater) = self.fed_by(adc) {
            heater.sum = Some(sum);
            self.is_due = true;
        }
    }

    pub(crate) fn set(&mut self, oid: u8, target: Target) -> Result<(), ShutdownReason> {
        let (is_alive, clock) = (self.alive.is_some(), self.clock);
        self.is_due = true;
        self.get(oid)?.set(target, is_alive, clock)
    }

    /// The host lives until a clock. Only later ones count, and none too far ahead.
    pub(crate) fn lease(&mut self, now: Clock32, alive: Clock32) -> Result<(), ShutdownReason> {
        let ahead = i64::from(alive.since(now));
        if ahead > i64::from(LEASE_SECONDS_MAX) * i64::from(self.clock.0) {
            return Err(WRONG);
        }
        if ahead > 0 && self.alive.is_none_or(|known| known.is_before(alive)) {
            self.alive = Some(alive);
        }
        Ok(())
    }

    /// Looks at the clock, at least once in every 2³⁰ ticks.
    pub(crate) fn look(&mut self, now: Clock32) {
        let passed = u64::from(now.0.wrapping_sub(self.seen.0));
        self.seen = now;
        let clock = self.clock;
        let is_over = self.alive.take_if(|alive| !now.is_before(*alive)).is_some();
        for heater in self.slots.iter_mut().flatten() {
            heater.pass(passed);
            if is_over {
                heater.fall_back(clock);
            }
            self.is_due |= heater.report_pending;
        }
    }

    /// When the clock has to be looked at again: as the lease ends, and as a stand-by time does.
    pub(crate) fn event_at(&self) -> Option<Clock32> {
        let standby_ends = self.slots.iter().flatten().filter_map(|heater| heater.standby_ends(self.seen));
        self.alive
            .into_iter()
            .chain(standby_ends)
            .reduce(|first, at| if at.is_before(first) { at } else { first })
    }

    /// Goes on with one heater that has something to do.
    pub(crate) fn step(&mut self) -> Option<Result<Drive, ShutdownReason>> {
        let clock = self.clock;
        self.all().find(|heater| heater.is_due()).map(|heater| heater.step(clock))
    }

    /// Everything off, for good: the outputs are put to their defaults by the caller.
    pub(crate) fn shut_down(&mut self) {
        self.alive = None;
        self.is_due = false;
        for heater in self.all() {
            heater.wanted = OFF;
            heater.state = State::Off;
            heater.share = 0;
            heater.sum = None;
            heater.report_pending = false;
            heater.control.reset();
        }
    }
}
