//! One stepper motor with its driver and its load: the rotor's angle, integrated.
//!
//! The driver turns the stator's field by one microstep at every step pulse. The rotor is pulled towards the field
//! with a torque that is a sine of the electrical angle between them, so it follows with a small lag, swings, and
//! slips by whole electrical periods (four full steps) when the torque does not suffice. Steps are lost here by
//! physics alone; nothing knows what a planner promised.
//!
//! Without current only the magnets of the rotor pull it, towards the nearest full step (the detent torque); where dry
//! friction is stronger it stays where it is. A driver that gets its power back begins at the first place of its table of
//! microsteps, wherever the rotor stands: that is the same for every fourth full step.
//!
//! `J·dω/dt = T(f)·sin(2π·(field − rotor)/period) − load − drag·ω − damping·(ω − ω_field) − dry friction`, with
//! T(f) flat up to a corner speed and falling as 1/f beyond it, where the coils' inductance limits the current.
//!
//! Units: microsteps for angles, seconds for durations, ticks of the board's clock for points in time.
//! Does not know: pins, millimetres (apart from the stops of the frame, given in microsteps), firmware.
//! Sources: the datasheets of the TMC2209 (MSCNT, the place in the table, is 0 after reset) and of the A4988 (home state);
//! the standard two-phase hybrid motor model (Acarnley, "Stepping Motors", ch. 4 and 5); leapfrog integration
//! of second order with the field's mean over each step of time.

use crate::switch::Switch;

/// The longest step of time of the integration. A tenth of a radian of the swing of usual motors.
pub const TIME_STEP_US: u32 = 100;
const TIME_STEP_S: f64 = TIME_STEP_US as f64 * 1e-6;
/// Whatever changes by more than this part in a step of time is not integrated faithfully.
const RATE_PER_STEP_MAX: f64 = 0.5;
/// Where the field turns by more than 1/16 of an electrical period in a step of time, the step is divided.
const PERIODS_PER_SUBSTEP_MAX: f64 = 1.0 / 16.0;
/// At most so many parts; a field that fast drags no rotor anyway.
const SUBSTEPS_MAX: f64 = 32.0;
/// A rotor that lags by more than this may be about to slip: where it comes to rest then is a close decision, and time
/// is cut finer.
const LAG_PERIODS_FINE: f64 = 0.08;
/// By this much.
const FINER: u64 = 16;
/// How fast the current, and with it the torque, follows the speed of the field: the coils' L/R.
const CURRENT_TIME_CONSTANT_S: f64 = 0.001;
/// A rotor this near to the middle between two places that its driver could pull it to, in electrical periods, is pulled by
/// too little to overcome friction.
const BALANCE_PERIODS: f64 = 0.06;
/// Least dry friction: without any, a rotor would swing for ever.
const FRICTION_NM_MIN: f64 = 1e-4;

/// A motor and its load, in the units of data sheets.
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanics {
    /// Full steps per turn of the rotor, 200 for 1.8°.
    pub full_steps_per_rotation: u32,
    /// Microsteps per full step, as the driver is set.
    pub microsteps: u32,
    /// Greatest torque at low speed and the driver's current, in newton metres.
    pub holding_torque_nm: f64,
    /// Turns per second beyond which the torque falls as 1/speed.
    pub corner_speed_rev_s: f64,
    /// Inertia of the rotor and of all that moves with it, in kg·m².
    pub inertia_kg_m2: f64,
    /// Dry friction, in newton metres.
    pub friction_nm: f64,
    /// Drag that grows with speed, in N·m·s/rad.
    pub drag_nm_s: f64,
    /// Damping of swings around the field, as a fraction of the critical one.
    pub damping_ratio: f64,
    /// Constant torque towards lower positions (gravity), in newton metres.
    pub load_nm: f64,
    /// Greatest torque towards the nearest full step without current, in newton metres. With current it is part of the
    /// holding torque.
    pub detent_nm: f64,
}

const TURN_RAD: f64 = core::f64::consts::TAU;
/// A usual NEMA 17 rotor: 54 g·cm².
const NEMA17_ROTOR_KG_M2: f64 = 5.4e-6;

impl Mechanics {
    /// A NEMA 17 motor (0.4 N·m at its rated current, of which the driver is set to three quarters; 24 V) that moves a
    /// mass by a belt or a screw.
    pub fn nema17(microsteps: u32, mm_per_rotation: f64, moved_kg: f64) -> Self {
        let lever_m = mm_per_rotation / 1000.0 / TURN_RAD;
        Self {
            full_steps_per_rotation: 200,
            microsteps,
            holding_torque_nm: 0.3,
            corner_speed_rev_s: 6.0,
            inertia_kg_m2: NEMA17_ROTOR_KG_M2 + moved_kg * lever_m * lever_m,
            friction_nm: 0.03,
            drag_nm_s: 1e-4,
            damping_ratio: 0.1,
            load_nm: 0.0,
            detent_nm: 0.02,
        }
    }

    /// A NEMA 17 motor that pushes filament: little inertia, more friction.
    pub fn extruder(microsteps: u32) -> Self {
        Self { friction_nm: 0.08, inertia_kg_m2: 8e-6, ..Self::nema17(microsteps, 0.0, 0.0) }
    }

    /// Microsteps per turn.
    pub fn microsteps_per_rotation(&self) -> f64 {
        f64::from(self.full_steps_per_rotation) * f64::from(self.microsteps)
    }

    /// Angular frequency of small swings of the rotor around the field, in rad/s.
    fn swing_rad_s(&self) -> f64 {
        let electrical_per_mechanical = f64::from(self.full_steps_per_rotation) / 4.0;
        (self.holding_torque_nm * electrical_per_mechanical / self.inertia_kg_m2).sqrt()
    }

    /// The same around a full step, without current.
    fn detent_swing_rad_s(&self) -> f64 {
        (self.detent_nm * f64::from(self.full_steps_per_rotation) / self.inertia_kg_m2).sqrt()
    }

    /// Whether all values are finite and make a motor, one that [`TIME_STEP_US`] is short enough for.
    pub fn is_sound(&self) -> bool {
        let positive = [self.holding_torque_nm, self.corner_speed_rev_s, self.inertia_kg_m2];
        let not_negative = [self.friction_nm, self.drag_nm_s, self.damping_ratio, self.detent_nm];
        positive.iter().all(|v| v.is_finite() && *v > 0.0)
            && not_negative.iter().all(|v| v.is_finite() && *v >= 0.0)
            && self.load_nm.is_finite()
            && (4..=4000).contains(&self.full_steps_per_rotation)
            && (1..=256).contains(&self.microsteps)
            && self.swing_rad_s() * TIME_STEP_S < RATE_PER_STEP_MAX
            && self.detent_swing_rad_s() * TIME_STEP_S < RATE_PER_STEP_MAX
            && 2.0 * self.damping_ratio * self.swing_rad_s() * TIME_STEP_S < RATE_PER_STEP_MAX
            && self.drag_nm_s / self.inertia_kg_m2 * TIME_STEP_S < RATE_PER_STEP_MAX
    }
}

/// The mechanics in microsteps and seconds, ready for the integration.
#[derive(Clone, Debug)]
struct Model {
    period: f64,
    per_period: f64,
    /// Acceleration at full torque, in microsteps/s².
    pull: f64,
    corner_rate: f64,
    friction: f64,
    load: f64,
    detent: f64,
    per_full_step: f64,
    drag_per_s: f64,
    damping_per_s: f64,
    damping_max: f64,
    /// The speed against the field with which a swing of [`LAG_PERIODS_FINE`] goes through the middle.
    swing_rate_fine: f64,
}

impl Model {
    fn new(mechanics: &Mechanics) -> Self {
        let per_rad = mechanics.microsteps_per_rotation() / TURN_RAD;
        let acceleration = |torque_nm: f64| torque_nm / mechanics.inertia_kg_m2 * per_rad;
        let period = 4.0 * f64::from(mechanics.microsteps);
        let pull = acceleration(mechanics.holding_torque_nm);
        let natural_rad_s = mechanics.swing_rad_s();
        Self {
            period,
            per_period: 1.0 / period,
            pull,
            corner_rate: mechanics.corner_speed_rev_s * mechanics.microsteps_per_rotation(),
            friction: acceleration(mechanics.friction_nm.max(FRICTION_NM_MIN)),
            load: acceleration(mechanics.load_nm),
            detent: acceleration(mechanics.detent_nm),
            per_full_step: 1.0 / f64::from(mechanics.microsteps),
            drag_per_s: mechanics.drag_nm_s / mechanics.inertia_kg_m2,
            damping_per_s: 2.0 * mechanics.damping_ratio * natural_rad_s,
            // Eddy currents damp swings; they do not drag a stalled rotor along.
            damping_max: 0.05 * pull,
            swing_rate_fine: LAG_PERIODS_FINE * period * natural_rad_s,
        }
    }
}

/// A motor in motion.
#[derive(Clone, Debug)]
pub(crate) struct MotorState {
    model: Model,
    /// Pulses forward less pulses backward: where the field stands, in microsteps.
    field: i64,
    /// Where the field stood when the present chunk of time began.
    chunk_field: i64,
    /// Σ ±(ticks left in the chunk) over the pulses of the chunk; gives the field's mean.
    weight: i64,
    chunk_end: u64,
    /// The chunk under way: one of the two below.
    chunk: Chunk,
    coarse: Chunk,
    fine: Chunk,
    tick_s: f64,
    rotor: f64,
    velocity: f64,
    /// Speed of the field as the current sees it, in microsteps/s.
    rate: f64,
    energised: bool,
    /// The driver has got its power back, and the motor no current since then; which way it goes where it could go either.
    begins_anew: Option<bool>,
    settled: bool,
    stops: Stops,
    /// The limit switches on this motor's axis.
    pub(crate) switches: Vec<Switch>,
}

/// A length of time.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    ticks: u64,
    seconds: f64,
    per_tick: f64,
    per_second: f64,
    /// How far the current follows the field within it.
    gain: f64,
}

impl Chunk {
    fn new(ticks: u64, tick_s: f64) -> Self {
        let seconds = ticks as f64 * tick_s;
        let gain = 1.0 - libm::exp(-seconds / CURRENT_TIME_CONSTANT_S);
        Self { ticks, seconds, per_tick: 1.0 / ticks as f64, per_second: 1.0 / seconds, gain }
    }
}

/// Where the frame ends, in microsteps from where the rotor stood at power-up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stops {
    pub(crate) min: f64,
    pub(crate) max: f64,
}

impl Stops {
    pub(crate) const NONE: Self = Self { min: f64::NEG_INFINITY, max: f64::INFINITY };
}

/// The part of a turn beyond the nearest whole one, −0.5 to 0.5.
#[inline]
fn wrapped(turns: f64) -> f64 {
    // Adding and taking away 1.5·2⁵² rounds to the nearest whole number (IEEE 754, to nearest).
    const ROUND: f64 = 6_755_399_441_055_744.0;
    turns - ((turns + ROUND) - ROUND)
}

/// sin(2π·turns) for any angle, to 1e-7: the platform's sine is neither the same everywhere nor cheap.
#[inline]
fn sin_turns(turns: f64) -> f64 {
    let y = wrapped(turns);
    // Folded to a quarter turn, then the Taylor series around zero.
    let a = 0.25 - (y.abs() - 0.25).abs();
    let x = a * TURN_RAD;
    let x2 = x * x;
    let x4 = x2 * x2;
    // In pairs, so that the processor need not wait for one term after the other.
    let low = (1.0 - x2 * (1.0 / 6.0)) + x4 * (1.0 / 120.0 - x2 * (1.0 / 5040.0));
    let series = low + (x4 * x4) * (1.0 / 362_880.0 - x2 * (1.0 / 39_916_800.0));
    (x * series).copysign(y)
}

impl MotorState {
    /// A motor at rest; `time_step_us` as [`TIME_STEP_US`].
    pub(crate) fn new(
        mechanics: &Mechanics,
        clock_hz: u32,
        start: u64,
        time_step_us: u32,
        stops: Stops,
    ) -> Self {
        let chunk_ticks = (u64::from(clock_hz) * u64::from(time_step_us) / 1_000_000).max(1);
        let tick_s = 1.0 / f64::from(clock_hz);
        let coarse = Chunk::new(chunk_ticks, tick_s);
        Self {
            model: Model::new(mechanics),
            field: 0,
            chunk_field: 0,
            weight: 0,
            chunk_end: start + chunk_ticks,
            chunk: coarse,
            coarse,
            fine: Chunk::new((chunk_ticks / FINER).max(1), tick_s),
            tick_s,
            rotor: 0.0,
            velocity: 0.0,
            rate: 0.0,
            energised: false,
            begins_anew: None,
            settled: true,
            stops,
            switches: Vec::new(),
        }
    }

    /// One microstep of the field at a clock that is not before any earlier call's.
    #[inline]
    pub(crate) fn step(&mut self, now: u64, forward: bool) {
        if now >= self.chunk_end {
            self.advance(now);
        }
        let left = (self.chunk_end - now) as i64;
        if forward {
            self.field += 1;
            self.weight += left;
        } else {
            self.field -= 1;
            self.weight -= left;
        }
        self.settled = false;
    }

    /// Current on or off.
    pub(crate) fn energise(&mut self, now: u64, on: bool) {
        self.advance(now);
        if self.energised != on {
            if let Some(upwards) = self.begins_anew.take_if(|_| on) {
                self.pull_in(upwards);
            }
            self.energised = on;
            self.settled = false;
        }
    }

    /// The power is gone: no current, and what hangs on the motor sinks by this much.
    pub(crate) fn lose_power(&mut self, now: u64, sag: f64) {
        self.energise(now, false);
        self.rotor = (self.rotor - sag).clamp(self.stops.min, self.stops.max);
        self.settled = false;
    }

    /// The power is back: the driver begins at the first place of its table, wherever the rotor stands.
    pub(crate) fn regain_power(&mut self, now: u64, upwards: bool) {
        self.advance(now);
        (self.field, self.chunk_field, self.weight, self.rate) = (0, 0, 0, 0.0);
        self.begins_anew = Some(upwards);
    }

    /// The first current since then pulls the rotor to the nearest place that the coils' is like: from there on it counts.
    /// One that stands in the middle between two goes where chance has it.
    fn pull_in(&mut self, upwards: bool) {
        let turns = (self.rotor - self.field as f64) * self.model.per_period;
        let lag = wrapped(turns);
        let mut place = turns - lag;
        if 0.5 - lag.abs() < BALANCE_PERIODS {
            // Not even friction keeps it there: the smallest shake is enough.
            let sign = if upwards { 1.0 } else { -1.0 };
            let middle = place + 0.5_f64.copysign(lag);
            place = middle + 0.5 * sign;
            self.rotor = self.field as f64 + (middle + BALANCE_PERIODS * sign) * self.model.period;
        }
        self.field += libm::rint(place * self.model.period) as i64;
        self.chunk_field = self.field;
    }

    /// Integrates all chunks of time that end at or before `now`. Calling it more often changes nothing.
    #[inline]
    pub(crate) fn advance(&mut self, now: u64) {
        while now >= self.chunk_end {
            if self.settled {
                let chunks = (now - self.chunk_end) / self.chunk.ticks + 1;
                self.chunk_end += chunks * self.chunk.ticks;
                return;
            }
            self.integrate_chunk();
        }
    }

    /// Integrates the chunk under way and begins the next.
    fn integrate_chunk(&mut self) {
        let chunk = self.chunk;
        let turned = (self.field - self.chunk_field) as f64;
        let mean = self.chunk_field as f64 + self.weight as f64 * chunk.per_tick;
        let still = self.velocity == 0.0 && self.weight == 0 && turned == 0.0;
        let rate_before = self.rate;
        let rate_after = rate_before + chunk.gain * (turned * chunk.per_second - rate_before);
        // Its value in the middle of the chunk, for second order.
        self.rate = 0.5 * (rate_before + rate_after);
        let before = self.rotor;
        let periods = turned.abs() * self.model.per_period;
        if periods <= PERIODS_PER_SUBSTEP_MAX {
            self.integrate(mean, chunk.seconds);
        } else {
            self.integrate_in_parts(mean, turned, periods);
        }
        self.rate = rate_after;
        self.chunk_field = self.field;
        self.weight = 0;
        // Friction holds a rotor that has stopped: with the same forces it stays where it is.
        if still && self.velocity == 0.0 && self.rate.abs() < self.model.corner_rate {
            self.settled = true;
            self.rate = 0.0;
        }
        for switch in &mut self.switches {
            switch.moved(before, self.rotor, self.chunk_end - chunk.ticks, chunk.ticks);
        }
        self.chunk =
            if self.energised && !self.settled && self.is_out_of_step() { self.fine } else { self.coarse };
        self.chunk_end += self.chunk.ticks;
    }

    /// Whether the swing around the field is so wide that the rotor slips or may be about to.
    #[inline]
    fn is_out_of_step(&self) -> bool {
        let lag = wrapped((self.field as f64 - self.rotor) * self.model.per_period);
        lag.abs() > LAG_PERIODS_FINE || (self.rate - self.velocity).abs() > self.model.swing_rate_fine
    }

    /// The field moves along a straight line with the mean that it has.
    #[cold]
    fn integrate_in_parts(&mut self, mean: f64, turned: f64, periods: f64) {
        let count = (periods / PERIODS_PER_SUBSTEP_MAX).min(SUBSTEPS_MAX) as u32 + 1;
        let each = 1.0 / f64::from(count);
        for part in 0..count {
            let place = (f64::from(part) + 0.5) * each - 0.5;
            self.integrate(mean + turned * place, self.chunk.seconds * each);
        }
    }

    /// Half a step of the angle, a whole one of the speed, the other half of the angle.
    #[inline]
    fn integrate(&mut self, field: f64, dt: f64) {
        let model = &self.model;
        let middle = self.rotor + self.velocity * (0.5 * dt);
        let mut acceleration = -model.load;
        if self.energised {
            let speed = self.rate.abs();
            let pull =
                if speed > model.corner_rate { model.pull * (model.corner_rate / speed) } else { model.pull };
            acceleration += pull * sin_turns((field - middle) * model.per_period);
        } else {
            acceleration -= model.detent * sin_turns(middle * model.per_full_step);
        }
        // What depends on the speed takes its value in the middle of the step.
        let speed = self.velocity + acceleration * (0.5 * dt);
        acceleration -= model.drag_per_s * speed;
        if self.energised {
            let damping = model.damping_per_s * (self.rate - speed);
            acceleration += damping.max(-model.damping_max).min(model.damping_max);
        }
        let velocity = self.velocity + acceleration * dt;
        // Dry friction takes speed away and never reverses it.
        self.velocity = (velocity.abs() - model.friction * dt).max(0.0).copysign(velocity);
        self.rotor = middle + self.velocity * (0.5 * dt);
        if self.rotor < self.stops.min {
            self.rotor = self.stops.min;
            self.velocity = self.velocity.max(0.0);
        } else if self.rotor > self.stops.max {
            self.rotor = self.stops.max;
            self.velocity = self.velocity.min(0.0);
        }
    }

    /// The level of one of the motor's switches now: true while the contact is closed.
    pub(crate) fn switch_closed(&mut self, index: usize, now: u64) -> bool {
        self.advance(now);
        let began = self.chunk_end - self.chunk.ticks;
        let since = now - began;
        let ahead = if self.settled { 0.0 } else { self.velocity * since as f64 * self.tick_s };
        let rotor = self.rotor;
        match self.switches.get_mut(index) {
            Some(switch) => {
                switch.moved(rotor, rotor + ahead, began, since);
                switch.closed(now)
            }
            None => false,
        }
    }

    /// Where the rotor is now, between two chunks of time too.
    pub(crate) fn place(&mut self, now: u64) -> f64 {
        self.advance(now);
        let since = now - (self.chunk_end - self.chunk.ticks);
        let ahead = if self.settled { 0.0 } else { self.velocity * since as f64 * self.tick_s };
        self.rotor + ahead
    }

    /// Where the field stands, in microsteps from power-up.
    pub(crate) fn field(&self) -> i64 {
        self.field
    }

    /// Where the rotor stands, in microsteps from power-up, as of the last whole chunk of time.
    pub(crate) fn rotor(&self) -> f64 {
        self.rotor
    }

    /// Microsteps by which the rotor has slipped against the field: whole electrical periods, 0 while in step.
    pub(crate) fn lost(&self) -> i64 {
        if self.begins_anew.is_some() {
            // What it counts from shows only with its first current.
            return 0;
        }
        let periods = (self.chunk_field as f64 - self.rotor) * self.model.per_period;
        (libm::floor(periods + 0.5) * self.model.period) as i64
    }

    pub(crate) fn energised(&self) -> bool {
        self.energised
    }
}

#[cfg(test)]
#[path = "motor_tests.rs"]
mod tests;
