//! What goes wrong, as a script: damage on the link by chance, and parts that fail at a given time.
//!
//! Times are seconds of the board's time since power-up. Does not know how a fault is brought about.

use std::fmt;
use std::ops::AddAssign;
use std::str::FromStr;
use units::Seconds;

/// The script. The default is a machine in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// What may happen to each byte, both ways.
    pub bytes: ByteFaults,
    /// What fails, and when.
    pub failures: Vec<Failure>,
    /// When the host is held up, for whoever runs the host: the printer itself does nothing about it.
    pub host_stalls: Vec<HostStall>,
}

/// A host that does nothing for a while: its computer sleeps, or does something else. Bytes wait meanwhile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostStall {
    /// From when on.
    pub at: Seconds,
    /// For how long.
    pub lasts: Seconds,
}

/// Probabilities per byte.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ByteFaults {
    /// One random bit is flipped.
    pub corrupt: f64,
    /// The byte is lost.
    pub drop: f64,
    /// The byte comes twice.
    pub duplicate: f64,
    /// The byte, and with it all behind it, comes up to 20 ms late.
    pub delay: f64,
}

/// Something that fails at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// When.
    pub at: Seconds,
    /// What.
    pub kind: FailureKind,
}

/// What can fail. Names are those of the machine's parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FailureKind {
    /// The cable to the host is pulled.
    Unplug,
    /// The cable is put back.
    Replug,
    /// The heater's sensor has come off: the converter reads full scale.
    SensorOpen(String),
    /// The heater's sensor is short-circuited: the converter reads zero.
    SensorShort(String),
    /// The heater no longer warms.
    HeaterDead(String),
    /// The heater's switch has fused: it warms whatever the pin says.
    HeaterStuckOn(String),
    /// The endstop reads as triggered.
    EndstopStuckOn(String),
    /// The endstop never reads as triggered.
    EndstopStuckOff(String),
}

/// The items that [`Faults`] reads, for help texts.
pub const FAULT_ITEMS: &str = "corrupt=P, drop=P, duplicate=P, delay=P (probability per byte), unplug@T, replug@T, \
    sensor-open=HEATER@T, sensor-short=HEATER@T, heater-dead=HEATER@T, heater-stuck-on=HEATER@T, \
    endstop-stuck-on=AXIS@T, endstop-stuck-off=AXIS@T, host-stall=SECONDS@T (T: seconds since power-up, 0 when left out)";

/// Why a fault cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaultError {
    item: String,
    problem: &'static str,
}

impl fmt::Display for FaultError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{}\": {}; known faults: {FAULT_ITEMS}", self.item, self.problem)
    }
}

impl std::error::Error for FaultError {}

/// One item, or several with commas between them.
impl FromStr for Faults {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let mut faults = Self::default();
        for item in text.split(',') {
            let item = item.trim();
            faults += parse_item(item).map_err(|problem| FaultError { item: item.to_owned(), problem })?;
        }
        Ok(faults)
    }
}

fn parse_item(item: &str) -> Result<Faults, &'static str> {
    let (what, at) = match item.split_once('@') {
        Some((what, at)) => (what, Some(parse_time(at)?)),
        None => (item, None),
    };
    let (name, value) = match what.split_once('=') {
        Some((name, value)) => (name, Some(value)),
        None => (what, None),
    };
    let mut faults = Faults::default();
    if matches!(name, "corrupt" | "drop" | "duplicate" | "delay") {
        if at.is_some() {
            return Err("faults on bytes have a probability and no time");
        }
        let probability = parse_probability(value.ok_or("the probability is missing")?)?;
        match name {
            "corrupt" => faults.bytes.corrupt = probability,
            "drop" => faults.bytes.drop = probability,
            "duplicate" => faults.bytes.duplicate = probability,
            _ => faults.bytes.delay = probability,
        }
        return Ok(faults);
    }
    if name == "host-stall" {
        let lasts = parse_duration(value.ok_or("the duration is missing")?)?;
        faults.host_stalls.push(HostStall { at: at.unwrap_or(Seconds::ZERO), lasts });
        return Ok(faults);
    }
    let part =
        || value.filter(|value| !value.is_empty()).map(str::to_owned).ok_or("the part's name is missing");
    let at = at.unwrap_or(Seconds::ZERO);
    let kind = match name {
        "unplug" | "replug" if value.is_some() => return Err("the cable has no name"),
        "unplug" => FailureKind::Unplug,
        "replug" => FailureKind::Replug,
        "sensor-open" => FailureKind::SensorOpen(part()?),
        "sensor-short" => FailureKind::SensorShort(part()?),
        "heater-dead" => FailureKind::HeaterDead(part()?),
        "heater-stuck-on" => FailureKind::HeaterStuckOn(part()?),
        "endstop-stuck-on" => FailureKind::EndstopStuckOn(part()?),
        "endstop-stuck-off" => FailureKind::EndstopStuckOff(part()?),
        _ => return Err("no such fault"),
    };
    faults.failures.push(Failure { at, kind });
    Ok(faults)
}

fn parse_time(text: &str) -> Result<Seconds, &'static str> {
    // A century and more of seconds still fits the clock.
    const SECONDS_MAX: f64 = 1e9;
    match text.trim_end_matches('s').parse::<f64>() {
        Ok(at) if (0.0..=SECONDS_MAX).contains(&at) => Ok(Seconds(at)),
        _ => Err("the time after @ must be seconds since power-up"),
    }
}

fn parse_duration(text: &str) -> Result<Seconds, &'static str> {
    parse_time(text).map_err(|_| "the duration must be seconds")
}

fn parse_probability(text: &str) -> Result<f64, &'static str> {
    match text.parse::<f64>() {
        Ok(probability) if (0.0..=1.0).contains(&probability) => Ok(probability),
        _ => Err("the probability must lie between 0 and 1"),
    }
}

/// Probabilities that are given replace those before; failures add up.
impl AddAssign for Faults {
    fn add_assign(&mut self, other: Self) {
        let set = |mine: &mut f64, theirs: f64| {
            if theirs > 0.0 {
                *mine = theirs;
            }
        };
        set(&mut self.bytes.corrupt, other.bytes.corrupt);
        set(&mut self.bytes.drop, other.bytes.drop);
        set(&mut self.bytes.duplicate, other.bytes.duplicate);
        set(&mut self.bytes.delay, other.bytes.delay);
        self.failures.extend(other.failures);
        self.host_stalls.extend(other.host_stalls);
    }
}

impl ByteFaults {
    /// Whether the link is in order.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    pub(crate) fn are_probabilities(&self) -> bool {
        [self.corrupt, self.drop, self.duplicate, self.delay].iter().all(|p| (0.0..=1.0).contains(p))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn items_are_read_and_combined() {
        let mut faults: Faults = "corrupt=0.01".parse().expect("a fault");
        faults += "sensor-open=extruder@30".parse().expect("a fault");
        faults += "unplug@5.5s, replug@6".parse().expect("faults");
        faults += "endstop-stuck-off=x".parse().expect("a fault");
        assert_eq!(faults.bytes, ByteFaults { corrupt: 0.01, ..ByteFaults::default() });
        let expected = [
            (30.0, FailureKind::SensorOpen("extruder".into())),
            (5.5, FailureKind::Unplug),
            (6.0, FailureKind::Replug),
            (0.0, FailureKind::EndstopStuckOff("x".into())),
        ];
        let expected = expected.map(|(at, kind)| Failure { at: Seconds(at), kind });
        assert_eq!(faults.failures, expected);
        faults += "host-stall=2.5@30".parse().expect("a fault");
        assert_eq!(faults.host_stalls, [HostStall { at: Seconds(30.0), lasts: Seconds(2.5) }]);
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (text, says) in [
            ("corrupt=2", "between 0 and 1"),
            ("corrupt", "missing"),
            ("corrupt=0.1@3", "no time"),
            ("sensor-open@3", "name is missing"),
            ("unplug=x@3", "no name"),
            ("unplug@soon", "seconds"),
            ("fire", "no such fault"),
            ("host-stall@3", "missing"),
            ("host-stall=long@3", "must be seconds"),
            ("drop=nan", "between 0 and 1"),
        ] {
            let error = text.parse::<Faults>().expect_err(text).to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text: String) {
            if let Ok(faults) = text.parse::<Faults>() {
                prop_assert!(faults.bytes.are_probabilities());
            }
        }
    }
}
