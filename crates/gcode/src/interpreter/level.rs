//! Klipper's commands for axes that are not square and beds that are not flat, as its public documentation has them
//! (docs/G-Codes.md, docs/Skew_Correction.md).

use super::extended::{Call, Parameter};
use super::{Out, Said};
use crate::action::{Action, SkewChange};
use crate::annotation::text_of;
use crate::diagnostic::DiagnosticCode;
use crate::diagnostic::Severity::{Blocking, Error, Info};
use crate::number;

/// No printed square is larger, in mm.
const LENGTH_MAX_MM: f64 = 1e5;

impl Call<'_> {
    /// `SET_SKEW`.
    pub(super) fn set_skew(&self, out: &mut Out<'_>) -> Result<SkewChange, Said> {
        if self.get("CLEAR").is_some_and(|it| it.value != b"0") {
            return Ok(SkewChange::Clear);
        }
        let [xy, xz, yz] = ["XY", "XZ", "YZ"].map(|key| self.get(key));
        let mut lengths = |it: Option<&Parameter<'_>>| it.map(|it| lengths(it, out)).transpose();
        Ok(SkewChange::Measured { xy: lengths(xy)?, xz: lengths(xz)?, yz: lengths(yz)? })
    }

    /// `CALC_MEASURED_SKEW`.
    pub(super) fn measured_skew(&self, out: &mut Out<'_>) -> Result<SkewChange, Said> {
        let mut found = [0.0; 3];
        for (key, length) in ["AC", "BD", "AD"].into_iter().zip(&mut found) {
            let parameter = self.required(key, out)?;
            *length = one_length(parameter.value).ok_or_else(|| no_lengths(parameter, out))?;
        }
        Ok(SkewChange::Calculate(found))
    }

    /// The profile that is to be loaded. Profiles are neither saved nor removed from here, which changes no print.
    pub(super) fn profile(&self, section: &str, out: &mut Out<'_>) -> Result<Option<String>, Said> {
        if let Some(name) = self.get("LOAD") {
            return Ok(Some(String::from_utf8_lossy(name.value).into_owned()));
        }
        if self.get("SAVE").is_none() && self.get("REMOVE").is_none() {
            // What is missing is said.
            return self.required("LOAD", out).map(|_| None);
        }
        let message = format!(
            "Profiles are kept in the machine file: the line changes nothing. Write, or delete, a section [{section} NAME] \
             there."
        );
        out.say(Info, DiagnosticCode::IgnoredSetting, self.columns.clone(), message);
        Ok(None)
    }

    /// `BED_MESH_CALIBRATE`: a print that relies on it must not begin without.
    pub(super) fn calibrate_mesh(&self, out: &mut Out<'_>) -> Result<Option<Action>, Said> {
        let message = "The bed cannot be probed from here yet: the line would be skipped, and the bed taken as it was before. \
                       Write a mesh that was measured into the machine file as [bed_mesh NAME], and BED_MESH_PROFILE LOAD=NAME \
                       in this line's place; or confirm that the print is right without it.";
        out.say(Blocking, DiagnosticCode::UnsupportedCommand, self.columns.clone(), message);
        Err(Said)
    }
}

/// `140.4,142.8,99.8`.
fn lengths(parameter: &Parameter<'_>, out: &mut Out<'_>) -> Result<[f64; 3], Said> {
    let mut found = [0.0; 3];
    let mut parts = parameter.value.split(|&byte| byte == b',');
    for length in &mut found {
        let part = parts.next().unwrap_or_default().trim_ascii();
        *length = one_length(part).ok_or_else(|| no_lengths(parameter, out))?;
    }
    if parts.next().is_some() { Err(no_lengths(parameter, out)) } else { Ok(found) }
}

fn one_length(text: &[u8]) -> Option<f64> {
    let (value, end) = number::read(text, 0)?;
    (end == text.len() && value > 0.0 && value <= LENGTH_MAX_MM).then_some(value)
}

fn no_lengths(parameter: &Parameter<'_>, out: &mut Out<'_>) -> Said {
    let text = text_of(parameter.value);
    let message = format!(
        "`{text}` are no lengths: write those of AC, BD and AD in mm, as in XY=140.4,142.8,99.8. The line is skipped."
    );
    out.say(Error, DiagnosticCode::ValueOutOfRange, parameter.start..parameter.end, message);
    Said
}
