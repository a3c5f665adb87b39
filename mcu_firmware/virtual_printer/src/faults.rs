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
    /// When the user pauses the print, for whoever plays the user.
    pub pauses: Vec<UserPause>,
}

/// A print that is paused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UserPause {
    /// When the user asks for it.
    pub at: Seconds,
    /// How long after it has come to rest it is resumed.
    pub lasts: Seconds,
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
    /// Another byte comes in its place, any of them.
    pub corrupt: f64,
    /// One random bit is flipped.
    pub flip: f64,
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
    /// The board starts anew, as after a dip of its supply: all pins are let go, and it knows nothing of before.
    BoardReset,
    /// The machine has no power any more: as a reset, and all motors and heaters are without current.
    PowerLoss,
    /// The power is back.
    PowerReturn,
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
pub const FAULT_ITEMS: &str = "corrupt=P (another byte), flip=P (one bit), drop=P, duplicate=P, delay=P (probability per \
    byte), unplug@T, replug@T, outage=SECONDS@T (both), board-reset@T, power-loss=SECONDS@T (and back), sensor-open=HEATER@T, sensor-short=HEATER@T, heater-dead=HEATER@T, heater-stuck-on=HEATER@T, \
    endstop-stuck-on=AXIS@T, endstop-stuck-off=AXIS@T, host-stall=SECONDS@T, pause=SECONDS@T (by the user, which is no fault; T: seconds since power-up, 0 when left out)";

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
    if let Some(of_bytes) = faults.bytes.named(name) {
        if at.is_some() {
            return Err("faults on bytes have a probability and no time");
        }
        *of_bytes = parse_probability(value.ok_or("the probability is missing")?)?;
        return Ok(faults);
    }
    if matches!(name, "host-stall" | "pause" | "outage" | "power-loss") {
        let lasts = parse_duration(value.ok_or("the duration is missing")?)?;
        let at = at.unwrap_or(Seconds::ZERO);
        if name == "host-stall" {
            faults.host_stalls.push(HostStall { at, lasts });
        } else if name == "pause" {
            faults.pauses.push(UserPause { at, lasts });
        } else {
            let [gone, back] = if name == "outage" {
                [FailureKind::Unplug, FailureKind::Replug]
            } else {
                [FailureKind::PowerLoss, FailureKind::PowerReturn]
            };
            faults.failures.push(Failure { at, kind: gone });
            faults.failures.push(Failure { at: at + lasts, kind: back });
        }
        return Ok(faults);
    }
    let part =
        || value.filter(|value| !value.is_empty()).map(str::to_owned).ok_or("the part's name is missing");
    let at = at.unwrap_or(Seconds::ZERO);
    let kind = match name {
        "unplug" | "replug" | "board-reset" if value.is_some() => {
            return Err("there is only one: it has no name");
        }
        "unplug" => FailureKind::Unplug,
        "replug" => FailureKind::Replug,
        "board-reset" => FailureKind::BoardReset,
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
        for (mine, theirs) in self.bytes.all_mut().into_iter().zip(other.bytes.all()) {
            set(mine, theirs);
        }
        self.failures.extend(other.failures);
        self.host_stalls.extend(other.host_stalls);
        self.pauses.extend(other.pauses);
    }
}

impl ByteFaults {
    /// Whether the link is in order.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    pub(crate) fn are_probabilities(&self) -> bool {
        self.all().iter().all(|p| (0.0..=1.0).contains(p))
    }

    fn named(&mut self, name: &str) -> Option<&mut f64> {
        Some(match name {
            "corrupt" => &mut self.corrupt,
            "flip" => &mut self.flip,
            "drop" => &mut self.drop,
            "duplicate" => &mut self.duplicate,
            "delay" => &mut self.delay,
            _ => return None,
        })
    }

    const fn all(&self) -> [f64; 5] {
        [self.corrupt, self.flip, self.drop, self.duplicate, self.delay]
    }

    const fn all_mut(&mut self) -> [&mut f64; 5] {
        [&mut self.corrupt, &mut self.flip, &mut self.drop, &mut self.duplicate, &mut self.delay]
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
        faults += "pause=4@31".parse().expect("a pause");
        assert_eq!(faults.pauses, [UserPause { at: Seconds(31.0), lasts: Seconds(4.0) }]);
        let outage: Faults = "outage=1.5@10,board-reset@20,flip=0.5".parse().expect("faults");
        let expected =
            [(10.0, FailureKind::Unplug), (11.5, FailureKind::Replug), (20.0, FailureKind::BoardReset)];
        assert_eq!(outage.failures, expected.map(|(at, kind)| Failure { at: Seconds(at), kind }));
        faults += outage;
        let gone: Faults = "power-loss=60@7".parse().expect("a fault");
        let expected = [(7.0, FailureKind::PowerLoss), (67.0, FailureKind::PowerReturn)];
        assert_eq!(gone.failures, expected.map(|(at, kind)| Failure { at: Seconds(at), kind }));
        assert_eq!((faults.bytes.corrupt, faults.bytes.flip), (0.01, 0.5));
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (text, says) in [
            ("corrupt=2", "between 0 and 1"),
            ("corrupt", "missing"),
            ("corrupt=0.1@3", "no time"),
            ("sensor-open@3", "name is missing"),
            ("unplug=x@3", "no name"),
            ("outage@3", "missing"),
            ("power-loss@3", "missing"),
            ("pause@3", "missing"),
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
