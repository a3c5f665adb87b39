//! Where an axis stands once its motor has current again.
//!
//! Without current a rotor stays where friction holds it, or falls to the nearest full step (its detent). A driver that
//! is powered up sets the coils to the first place of its table of microsteps, whatever it was before, and that pulls the
//! rotor to the nearest place that is alike: one in every four full steps. So a rotor that is not near the middle between
//! two of them has one place to go to, and one that is has two.
//!
//! Sources: TMC2209 datasheet (Trinamic), section 5.5.1, register MSCNT "actual position in the microstep table", reset 0;
//! A4988 and DRV8825 datasheets, "home state" after reset; Acarnley, "Stepping Motors", ch. 1 (detent torque: one period
//! a full step). Knows no sag: what hangs on the axis may pull it down by more.

use units::Mm;

use crate::{
    config::MotorConfig,
    journal::{Height, MovedBy},
};

/// The most places that are told; more say nothing.
pub const STANDINGS_MAX: usize = 8;
/// Full steps from one place of the rotor to the next that is alike.
const FULL_STEPS_PER_PERIOD: f64 = 4.0;
/// A rotor may be so many full steps from where its driver has it: it hangs behind by its load, and count and position
/// are rounded to microsteps.
const LAG_FULL_STEPS: f64 = 0.2;
/// A rotor without current falls by no more than this, to the nearest full step.
const FALL_FULL_STEPS: f64 = 0.5;
/// What is left of doubt at a known place, in microsteps: rounding, of position and of count.
const ROUNDING_MICROSTEPS: f64 = 2.0;

/// Where an axis can stand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Standings {
    /// The places, the likeliest first. Empty where the coils' place is not known, or it may have been anywhere.
    pub places: Vec<Mm>,
    /// One place from the next.
    pub pitch: Mm,
    /// At the right place, it is no farther off than this. Where there is no place: it is no farther than this from where
    /// the power went.
    pub error: Mm,
}

impl Standings {
    /// Of a motor, from what was last known of it and where its axis may have been by then, in mm.
    pub fn new(motor: &MotorConfig, height: Option<Height>, range_mm: Option<[f64; 2]>) -> Self {
        let step_mm = motor.step_distance().0;
        let per_full = f64::from(motor.microsteps);
        let pitch_mm = FULL_STEPS_PER_PERIOD * per_full * step_mm;
        let away = FULL_STEPS_PER_PERIOD / 2.0 + FALL_FULL_STEPS + LAG_FULL_STEPS;
        let unknown = Self { places: Vec::new(), pitch: Mm(pitch_mm), error: Mm(away * per_full * step_mm) };
        let known = height.filter(|height| height.since_power_up && height.by != MovedBy::Others);
        let Some((height, [low, high])) = known.zip(range_mm) else { return unknown };
        let is_near = (0.0..=STANDINGS_MAX as f64 * pitch_mm).contains(&(high - low));
        if !is_near {
            return unknown;
        }
        let full_steps = |mm: f64| f64::from(height.count) / per_full + (mm - height.z) / step_mm / per_full;
        let (low, high) = (full_steps(low), full_steps(high));
        let middle = 0.5 * (low + high) / FULL_STEPS_PER_PERIOD;
        // Where it may lie without current, and which place is near that.
        let (low, high) = (low - LAG_FULL_STEPS, high + LAG_FULL_STEPS);
        let (low, high) = (low.min(round_half_down(low)), high.max(round_half_up(high)));
        let first = round_half_down(low / FULL_STEPS_PER_PERIOD);
        let last = round_half_up(high / FULL_STEPS_PER_PERIOD);
        let mm = |place: f64| {
            height.z + (place * FULL_STEPS_PER_PERIOD * per_full - f64::from(height.count)) * step_mm
        };
        let count = ((last - first) as usize).min(STANDINGS_MAX - 1) + 1;
        let mut places: Vec<f64> = (0..count).map(|at| first + at as f64).collect();
        places.sort_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
        Self {
            places: places.into_iter().map(|place| Mm(mm(place))).collect(),
            pitch: Mm(pitch_mm),
            error: Mm(ROUNDING_MICROSTEPS * step_mm),
        }
    }
}

/// The nearest whole number; of two, the lower.
fn round_half_down(value: f64) -> f64 {
    libm::ceil(value - 0.5)
}

/// The nearest whole number; of two, the higher.
fn round_half_up(value: f64) -> f64 {
    libm::floor(value + 0.5)
}
