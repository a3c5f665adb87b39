//! Typed, checked access to one section: every option asked for is known, every other one is reported at the end.

use std::collections::BTreeMap;

use super::diagnostics::{Log, excerpt};
use super::document::Section;
use super::hints::hint;
use super::pin::{PinSpec, PinUse};

/// The numbers an option may have.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    min: f64,
    max: f64,
    min_excluded: bool,
}

impl Range {
    /// Above `min`, and at most the largest number that makes sense for any machine of this kind.
    pub(super) const fn above(min: f64) -> Self {
        Self { min, max: NUMBER_MAX, min_excluded: true }
    }

    /// `min` or more.
    pub(super) const fn from(min: f64) -> Self {
        Self { min, max: NUMBER_MAX, min_excluded: false }
    }

    /// The same with an upper end, included.
    pub(super) const fn to(self, max: f64) -> Self {
        Self { max, ..self }
    }

    fn contains(self, value: f64) -> bool {
        value <= self.max && if self.min_excluded { value > self.min } else { value >= self.min }
    }

    fn in_words(self) -> String {
        let (min, max) = (self.min, self.max);
        match (self.min_excluded, max < NUMBER_MAX) {
            (true, true) => format!("above {min} and at most {max}"),
            (false, true) => format!("from {min} to {max}"),
            (true, false) => format!("above {min}"),
            (false, false) => format!("{min} or more"),
        }
    }
}

/// Larger numbers are typing errors: no length, speed, acceleration or time of a printer comes near.
const NUMBER_MAX: f64 = 1e7;

/// Longest option name for which a similar one is sought.
const SUGGESTION_BYTES_MAX: usize = 48;

/// The value is missing or wrong, and the log says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reported;

/// A value that was checked, or was found wrong and reported.
pub(super) type Checked<T> = Result<T, Reported>;

/// Which option took which pin: two must not share one.
#[derive(Debug, Default)]
pub(super) struct PinRegistry {
    /// By the pin's name: the option, and the words for it.
    taken: BTreeMap<String, (&'static str, String)>,
}

/// One section being read.
pub(super) struct Reader<'a> {
    section: Section,
    /// Options that were asked for, found or not.
    asked: Vec<&'static str>,
    pins: &'a mut PinRegistry,
    pub(super) log: &'a mut Log,
}

impl<'a> Reader<'a> {
    pub(super) const fn new(section: Section, pins: &'a mut PinRegistry, log: &'a mut Log) -> Self {
        Self { section, asked: Vec::new(), pins, log }
    }

    pub(super) fn name(&self) -> &str {
        &self.section.name
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.section.entries.contains_key(key)
    }

    /// The line of an option, or of the section where it is missing.
    pub(super) fn line_of(&self, key: &str) -> u32 {
        self.section.entries.get(key).map_or(self.section.line, |entry| entry.line)
    }

    /// Reports an error of an option.
    pub(super) fn error(&mut self, key: &str, problem: impl core::fmt::Display) -> Reported {
        let line = self.line_of(key);
        self.log.error(line, format!("[{}] {key}: {problem}", excerpt(&self.section.name)));
        Reported
    }

    pub(super) fn warning(&mut self, key: &str, problem: impl core::fmt::Display) {
        let line = self.line_of(key);
        self.log.warning(line, format!("[{}] {key}: {problem}", excerpt(&self.section.name)));
    }

    /// The text of an option that may be missing. One that is there but empty is reported and counts as missing.
    pub(super) fn text(&mut self, key: &'static str) -> Option<String> {
        let value = self.value(key);
        if value.is_none() && self.has(key) {
            self.warning(key, "it has no value, so the default counts; delete the line or write one");
        }
        value
    }

    fn value(&mut self, key: &'static str) -> Option<String> {
        self.asked.push(key);
        let value = self.section.entries.get(key)?.value.trim();
        (!value.is_empty()).then(|| value.to_owned())
    }

    /// The text of an option that must be there.
    pub(super) fn required_text(&mut self, key: &'static str) -> Checked<String> {
        self.value(key).ok_or_else(|| {
            let problem = if self.has(key) { "it has no value" } else { "it is missing" };
            self.error(key, format!("{problem}; write {}", hint(key)))
        })
    }

    fn number_from(&mut self, key: &str, text: &str, range: Range) -> Checked<f64> {
        let Ok(value) = text.parse::<f64>() else {
            return Err(self.error(key, format!("`{}` is not a number; write {}", excerpt(text), hint(key))));
        };
        // Not a number is in no range.
        if range.contains(value) {
            return Ok(value);
        }
        let words = range.in_words();
        Err(self.error(key, format!("`{}` must be {words}; write {}", excerpt(text), hint(key))))
    }

    /// A number that must be there.
    pub(super) fn number(&mut self, key: &'static str, range: Range) -> Checked<f64> {
        let text = self.required_text(key)?;
        self.number_from(key, &text, range)
    }

    /// A number with a default.
    pub(super) fn number_or(&mut self, key: &'static str, default: f64, range: Range) -> Checked<f64> {
        self.optional_number(key, range).map(|value| value.unwrap_or(default))
    }

    /// A number that may be missing.
    pub(super) fn optional_number(&mut self, key: &'static str, range: Range) -> Checked<Option<f64>> {
        self.text(key).map(|text| self.number_from(key, &text, range)).transpose()
    }

    fn integer_from(&mut self, key: &str, text: &str, min: u32, max: u32) -> Checked<u32> {
        text.parse::<u32>().ok().filter(|value| (min..=max).contains(value)).ok_or_else(|| {
            let text = excerpt(text);
            let problem = format!("`{text}` must be a whole number from {min} to {max}; write {}", hint(key));
            self.error(key, problem)
        })
    }

    /// A whole number that must be there.
    pub(super) fn integer(&mut self, key: &'static str, min: u32, max: u32) -> Checked<u32> {
        let text = self.required_text(key)?;
        self.integer_from(key, &text, min, max)
    }

    /// A whole number with a default.
    pub(super) fn integer_or(&mut self, key: &'static str, default: u32, min: u32, max: u32) -> Checked<u32> {
        self.text(key).map_or(Ok(default), |text| self.integer_from(key, &text, min, max))
    }

    /// A switch that may be missing.
    pub(super) fn optional_boolean(&mut self, key: &'static str) -> Checked<Option<bool>> {
        let Some(text) = self.text(key) else { return Ok(None) };
        match text.to_ascii_lowercase().as_str() {
            "1" | "yes" | "true" | "on" => Ok(Some(true)),
            "0" | "no" | "false" | "off" => Ok(Some(false)),
            _ => Err(self.error(key, format!("`{}` must be true or false", excerpt(&text)))),
        }
    }

    /// A switch with a default.
    pub(super) fn boolean_or(&mut self, key: &'static str, default: bool) -> Checked<bool> {
        self.optional_boolean(key).map(|value| value.unwrap_or(default))
    }

    fn pin_from(&mut self, key: &'static str, text: &str, usage: PinUse) -> Checked<PinSpec> {
        let pin = PinSpec::parse(text, self.line_of(key), usage).map_err(|advice| {
            self.error(key, format!("`{}` is not a pin that can be used here: {advice}", excerpt(text)))
        })?;
        self.claim(key, &pin)?;
        Ok(pin)
    }

    /// Drivers often share one enable line; any other pin with two jobs is a mistake.
    fn claim(&mut self, key: &'static str, pin: &PinSpec) -> Checked<()> {
        let user = format!("[{}] {key} (line {})", excerpt(&self.section.name), pin.line);
        let Some((other_key, other)) = self.pins.taken.get(&pin.name) else {
            self.pins.taken.insert(pin.name.clone(), (key, user));
            return Ok(());
        };
        if key == "enable_pin" && *other_key == key {
            return Ok(());
        }
        let problem = format!("pin {} is already used by {other}; each pin has one job", pin.name);
        Err(self.error(key, problem))
    }

    /// A pin that must be there.
    pub(super) fn pin(&mut self, key: &'static str, usage: PinUse) -> Checked<PinSpec> {
        let text = self.required_text(key)?;
        self.pin_from(key, &text, usage)
    }

    /// A pin that may be missing.
    pub(super) fn optional_pin(&mut self, key: &'static str, usage: PinUse) -> Checked<Option<PinSpec>> {
        self.text(key).map(|text| self.pin_from(key, &text, usage)).transpose()
    }

    /// Options of Klipper that have no effect here, and that nothing is lost by.
    pub(super) fn without_effect(&mut self, keys: &[&'static str], why: &str) {
        for &key in keys {
            self.asked.push(key);
            if self.has(key) {
                let line = self.line_of(key);
                self.log.info(line, format!("[{}] {key} has no effect: {why}", excerpt(&self.section.name)));
            }
        }
    }

    /// The same of all options whose names begin so.
    pub(super) fn without_effect_beginning(&mut self, prefix: &str, why: &str) {
        let keys: Vec<String> =
            self.section.entries.keys().filter(|key| key.starts_with(prefix)).cloned().collect();
        for key in keys {
            if let Some(entry) = self.section.entries.remove(&key) {
                let name = excerpt(&self.section.name);
                self.log.info(entry.line, format!("[{name}] {} has no effect: {why}", excerpt(&key)));
            }
        }
    }

    /// Options of Klipper that change what the machine does but are not supported yet.
    pub(super) fn not_supported(&mut self, keys: &[&'static str], consequence: &str) {
        for &key in keys {
            self.asked.push(key);
            if self.has(key) {
                self.warning(key, format!("not supported yet: {consequence}"));
            }
        }
    }

    /// Reports the options that nobody asked for.
    pub(super) fn finish(self) {
        for (key, entry) in &self.section.entries {
            if self.asked.iter().any(|asked| asked == key) {
                continue;
            }
            let mut message = format!(
                "[{}] has no option `{}`: the line has no effect",
                excerpt(&self.section.name),
                excerpt(key)
            );
            if let Some(similar) = most_similar(key, &self.asked) {
                message.push_str("; did you mean `");
                message.push_str(similar);
                message.push_str("`?");
            }
            self.log.warning(entry.line, message);
        }
    }
}

/// The known name that differs by the fewest typing errors, if by few enough to be one.
fn most_similar(key: &str, known: &[&'static str]) -> Option<&'static str> {
    if key.len() > SUGGESTION_BYTES_MAX {
        return None;
    }
    let (distance, name) = known.iter().map(|name| (edit_distance(key, name), *name)).min()?;
    (distance <= 1 + name.len() / 5).then_some(name)
}

/// Insertions, deletions and replacements between two short names (Wagner and Fischer, 1974).
fn edit_distance(one: &str, other: &str) -> usize {
    let other = other.as_bytes();
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (i, a) in one.bytes().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, b) in other.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typing_errors_find_their_option() {
        let known = ["rotation_distance", "microsteps", "step_pin"];
        assert_eq!(most_similar("rotation_distanse", &known), Some("rotation_distance"));
        assert_eq!(most_similar("microstep", &known), Some("microsteps"));
        assert_eq!(most_similar("colour", &known), None);
        assert_eq!(most_similar(&"x".repeat(1_000), &known), None);
    }

    #[test]
    fn ranges_know_their_ends_and_exclude_what_is_no_number() {
        assert!(!Range::above(0.0).contains(0.0));
        assert!(Range::from(0.0).contains(0.0));
        assert!(Range::above(0.0).to(1.0).contains(1.0));
        for value in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300] {
            assert!(!Range::from(0.0).contains(value));
        }
        assert_eq!(Range::above(0.0).to(1.0).in_words(), "above 0 and at most 1");
        assert_eq!(Range::from(2.0).in_words(), "2 or more");
    }
}
