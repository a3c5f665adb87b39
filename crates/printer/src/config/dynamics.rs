//! `[input_shaper]`, and the pressure advance of `[extruder]`.

use steps::{Advance, DAMPING_RATIOS, Nonlinear, SHAPER_FREQUENCIES, Shaper, ShaperKind};

use super::Builder;
use super::reader::{Checked, Range, Reader};

/// One axis of `[input_shaper]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisShaperConfig {
    /// Which shaper.
    pub kind: ShaperKind,
    /// The frequency of the resonance that it is for, Hz; 0 is off.
    pub frequency: f64,
    /// The resonance's damping, as a share of the critical damping.
    pub damping_ratio: f64,
}

impl Default for AxisShaperConfig {
    fn default() -> Self {
        Self { kind: ShaperKind::Mzv, frequency: 0.0, damping_ratio: 0.1 }
    }
}

impl AxisShaperConfig {
    /// The shaper; none where it is off.
    pub fn shaper(&self) -> Option<Shaper> {
        Shaper::new(self.kind, self.frequency, self.damping_ratio)
    }
}

/// `[input_shaper]`: X and Y.
pub(super) fn input_shaper(builder: &mut Builder<'_>) -> Checked<[AxisShaperConfig; 2]> {
    let Some(mut reader) = builder.section("input_shaper") else { return Ok(Default::default()) };
    let both = kind(&mut reader, "shaper_type", ShaperKind::Mzv);
    let fallback = both.unwrap_or(ShaperKind::Mzv);
    let x = axis(&mut reader, fallback, ["shaper_type_x", "shaper_freq_x", "damping_ratio_x"]);
    let y = axis(&mut reader, fallback, ["shaper_type_y", "shaper_freq_y", "damping_ratio_y"]);
    reader.finish();
    both?;
    Ok([x?, y?])
}

fn axis(reader: &mut Reader<'_>, fallback: ShaperKind, keys: [&'static str; 3]) -> Checked<AxisShaperConfig> {
    let [type_key, frequency_key, damping_key] = keys;
    let kind = kind(reader, type_key, fallback);
    let frequency = reader.number_or(frequency_key, 0.0, Range::from(0.0).to(*SHAPER_FREQUENCIES.end()));
    let damping = reader.number_or(damping_key, 0.1, Range::from(0.0).to(*DAMPING_RATIOS.end()));
    let (kind, frequency, damping_ratio) = (kind?, frequency?, damping?);
    if frequency > 0.0 && frequency < *SHAPER_FREQUENCIES.start() {
        let lowest = SHAPER_FREQUENCIES.start();
        return Err(reader.error(frequency_key, format!("{frequency} Hz is below {lowest} Hz; 0 is off")));
    }
    Ok(AxisShaperConfig { kind, frequency, damping_ratio })
}

fn kind(reader: &mut Reader<'_>, key: &'static str, fallback: ShaperKind) -> Checked<ShaperKind> {
    let Some(name) = reader.text(key) else { return Ok(fallback) };
    ShaperKind::from_name(&name).ok_or_else(|| {
        let known = ShaperKind::ALL.map(ShaperKind::name).join(", ");
        reader.error(key, format!("`{name}` is no shaper; there are {known}"))
    })
}

/// The advance of `[extruder]`: linear, or one of Kalico's nonlinear models.
pub(super) fn advance(reader: &mut Reader<'_>) -> Checked<Advance> {
    let model = reader.text("pressure_advance_model").unwrap_or_else(|| "linear".to_owned());
    if model == "linear" {
        let pressure_advance = reader.number_or("pressure_advance", 0.0, Range::from(0.0).to(10.0))?;
        return Ok(Advance::Linear { pressure_advance });
    }
    let linear_advance = reader.number_or("linear_advance", 0.0, Range::from(0.0).to(10.0));
    let nonlinear_offset = reader.number_or("nonlinear_offset", 0.0, Range::from(0.0).to(10.0));
    let velocity = reader.number("linearization_velocity", Range::above(0.0).to(1_000.0));
    let model_of = match model.as_str() {
        "tanh" => Advance::Tanh,
        "recipr" => Advance::Reciprocal,
        _ => {
            let problem = format!("`{model}` is no model; there are linear, tanh, recipr");
            return Err(reader.error("pressure_advance_model", problem));
        }
    };
    Ok(model_of(Nonlinear {
        linear_advance: linear_advance?,
        nonlinear_offset: nonlinear_offset?,
        linearization_velocity: velocity?.max(LINEARIZATION_VELOCITY_MIN),
    }))
}

/// mm/s; below this the model is a jump.
const LINEARIZATION_VELOCITY_MIN: f64 = 1e-3;
