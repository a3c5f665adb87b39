//! `[skew_correction]` and `[bed_mesh]` with their profiles: `[skew_correction NAME]`, `[bed_mesh NAME]`, as `SAVE_CONFIG`
//! writes them or by hand.
//!
//! Source: Klipper's public documentation (docs/Config_Reference.md, docs/Bed_Mesh.md, docs/Skew_Correction.md).

use std::{collections::BTreeMap, sync::Arc};

use super::Builder;
use super::diagnostics::excerpt;
use super::reader::{Checked, Range, Reader, Reported};
use crate::transform::{
    Fade, GridAxis, Interpolation, LAGRANGE_POINTS_MAX, MeshSettings, Profiles, SKEW_MAX, SavedMesh, Skew,
    Z_ERROR_MAX_MM,
};

/// The most points along an axis.
const POINTS_MAX: u32 = 100;
/// The least that a mesh has.
const POINTS_MIN: u32 = 3;
/// With fewer, a spline has nothing to look at.
const SPLINE_POINTS_MIN: usize = 4;
/// Points are at least so far apart, in mm.
const PITCH_MIN_MM: f64 = 1.0;
/// No bed is higher or lower anywhere, in mm.
const HEIGHT_MAX_MM: f64 = 10.0;
/// Places on the bed, in mm.
const PLACE_MAX_MM: f64 = 10_000.0;
/// The most points put between two.
const PPS_MAX: u32 = 100;
/// The most profiles of a kind.
const PROFILES_MAX: usize = 64;
const TENSION: Range = Range::from(0.0).to(2.0);

const ALGORITHMS: &str = "`lagrange` or `bicubic`";
const NO_PROBE: &str = "the bed is not probed from here";

/// All profiles.
pub(super) fn profiles(builder: &mut Builder<'_>) -> Checked<Arc<Profiles>> {
    let skews = skews(builder);
    let settings = bed_mesh(builder);
    let names = builder.document.names_starting_with("bed_mesh ");
    let mut meshes = BTreeMap::new();
    for section in kept(builder, names) {
        let Some(mut reader) = builder.section(&section) else { continue };
        let found = profile(&mut reader, settings.as_ref().ok());
        reader.finish();
        // What cannot be read has been refused; what cannot be used is not there when it is to be loaded.
        if let Ok(mesh) = found {
            meshes.insert(mesh.name().to_owned(), mesh);
        }
    }
    settings?;
    Ok(Arc::new(Profiles { skews: skews?, meshes }))
}

/// As many as are read.
fn kept(builder: &mut Builder<'_>, mut names: Vec<String>) -> Vec<String> {
    for name in names.drain(names.len().min(PROFILES_MAX)..) {
        let line = builder.document.take(&name).map_or(0, |section| section.line);
        let name = excerpt(&name);
        builder
            .log
            .error(line, format!("[{name}]: more than {PROFILES_MAX} profiles are not read; delete some"));
    }
    names
}

fn skews(builder: &mut Builder<'_>) -> Checked<BTreeMap<String, Skew>> {
    if let Some(reader) = builder.section("skew_correction") {
        reader.finish();
    }
    let mut skews = BTreeMap::new();
    let mut result = Ok(());
    let names = builder.document.names_starting_with("skew_correction ");
    for section in kept(builder, names) {
        let Some(mut reader) = builder.section(&section) else { continue };
        let factor = Range::from(-SKEW_MAX).to(SKEW_MAX);
        let [xy, xz, yz] = ["xy_skew", "xz_skew", "yz_skew"].map(|key| reader.number_or(key, 0.0, factor));
        reader.finish();
        if let (Ok(xy), Ok(xz), Ok(yz)) = (xy, xz, yz) {
            skews.insert(name_of(&section), Skew { xy, xz, yz });
        } else {
            result = Err(Reported);
        }
    }
    result.map(|()| skews)
}

/// What stands behind the section's kind.
fn name_of(section: &str) -> String {
    section.split_once(' ').map_or("", |(_, name)| name).to_owned()
}

/// Where there is no `[bed_mesh]`.
const NO_SETTINGS: MeshSettings = MeshSettings {
    fade: Fade { start: 1.0, end: 0.0 },
    target: None,
    z_error: Z_ERROR_MAX_MM,
    reference: None,
};

/// `[bed_mesh]`. Where the bed would be probed is checked, and of no use.
fn bed_mesh(builder: &mut Builder<'_>) -> Checked<MeshSettings> {
    let Some(mut reader) = builder.section("bed_mesh") else { return Ok(NO_SETTINGS) };
    for key in ["mesh_min", "mesh_max", "mesh_origin"] {
        place(&mut reader, key)?;
    }
    counts(&mut reader, "probe_count", POINTS_MIN, POINTS_MAX)?;
    counts(&mut reader, "mesh_pps", 0, PPS_MAX)?;
    algorithm(&mut reader, "algorithm")?;
    reader.number_or("bicubic_tension", 0.2, TENSION)?;
    reader.without_effect(
        &[
            "speed",
            "horizontal_move_z",
            "mesh_radius",
            "round_probe_count",
            "adaptive_margin",
            "scan_overshoot",
        ],
        NO_PROBE,
    );
    reader.without_effect_beginning("faulty_region_", NO_PROBE);
    reader.without_effect(
        &["move_check_distance"],
        "moves are taken apart so that they follow the mesh closely enough, at whatever distance",
    );
    let start = reader.number_or("fade_start", 1.0, Range::from(-PLACE_MAX_MM).to(PLACE_MAX_MM));
    let end = reader.number_or("fade_end", 0.0, Range::from(-PLACE_MAX_MM).to(PLACE_MAX_MM));
    let target = reader.optional_number("fade_target", Range::from(-HEIGHT_MAX_MM).to(HEIGHT_MAX_MM));
    let z_error = reader.number_or("split_delta_z", 0.025, Range::from(Z_ERROR_MIN_MM));
    let reference = place(&mut reader, "zero_reference_position");
    reader.finish();
    Ok(MeshSettings {
        fade: Fade { start: start?, end: end? },
        target: target?,
        z_error: z_error?,
        reference: reference?,
    })
}

/// Smaller errors than this would only make more pieces.
const Z_ERROR_MIN_MM: f64 = 0.0005;

/// A saved mesh.
fn profile(reader: &mut Reader<'_>, settings: Option<&MeshSettings>) -> Checked<SavedMesh> {
    let name = name_of(reader.name());
    let version = reader.integer_or("version", 1, 1, 1);
    let place = Range::from(-PLACE_MAX_MM).to(PLACE_MAX_MM);
    let ends = ["min_x", "max_x", "min_y", "max_y"].map(|key| reader.number(key, place));
    let counts = ["x_count", "y_count"].map(|key| reader.integer(key, POINTS_MIN, POINTS_MAX));
    let pps = ["mesh_x_pps", "mesh_y_pps"].map(|key| reader.integer_or(key, 2, 0, PPS_MAX));
    let algorithm = algorithm(reader, "algo");
    let tension = reader.number_or("tension", 0.2, TENSION);
    let rows = reader.required_text("points");
    version?;
    let [min_x, max_x, min_y, max_y] = ends;
    let (lows, highs) = ([min_x?, min_y?], [max_x?, max_y?]);
    let [x_count, y_count] = counts;
    let counts = [x_count? as usize, y_count? as usize];
    let [x_pps, y_pps] = pps;
    let pps = [x_pps?, y_pps?];
    let between = match algorithm? {
        Algorithm::Direct => Interpolation::Linear,
        Algorithm::Bicubic if counts.iter().all(|&count| count >= SPLINE_POINTS_MIN) => {
            Interpolation::Cardinal(tension?)
        }
        Algorithm::Bicubic | Algorithm::Lagrange => Interpolation::Lagrange,
    };
    let mut axes = [0, 1].map(|axis: usize| GridAxis {
        min: lows[axis],
        max: highs[axis],
        count: counts[axis],
        interpolation: if pps[axis] == 0 { Interpolation::Linear } else { between },
    });
    for (axis, keys) in axes.iter_mut().zip([["max_x", "x_count"], ["max_y", "y_count"]]) {
        if axis.pitch() < PITCH_MIN_MM {
            let problem = format!("points must be {PITCH_MIN_MM} mm apart at least");
            return Err(reader.error(keys[0], problem));
        }
        if axis.interpolation == Interpolation::Lagrange && axis.count > LAGRANGE_POINTS_MAX {
            let problem = format!(
                "`lagrange` joins no more than {LAGRANGE_POINTS_MAX} points, and `bicubic` needs \
                 {SPLINE_POINTS_MIN} along each axis; write `algo: direct`, or probe other counts"
            );
            return Err(reader.error(keys[1], problem));
        }
    }
    let heights = heights(reader, &rows?, counts)?;
    let settings = settings.ok_or(Reported)?;
    let saved = SavedMesh::new(name, axes, heights, *settings);
    saved.ok_or_else(|| reader.error("points", "they make no grid"))?.map_err(|error| {
        reader.warning("points", format!("the profile is left out and cannot be loaded: {error}"));
        Reported
    })
}

/// Rows of Y, each of X.
fn heights(reader: &mut Reader<'_>, rows: &str, counts: [usize; 2]) -> Checked<Vec<f64>> {
    let rows: Vec<&str> = rows.lines().map(str::trim).filter(|row| !row.is_empty()).collect();
    if rows.len() != counts[1] {
        return Err(reader.error("points", format!("{} rows, y_count is {}", rows.len(), counts[1])));
    }
    let mut heights = Vec::with_capacity(counts[0] * counts[1]);
    for row in rows {
        let numbers = row.trim_end_matches(',').split(',');
        let before = heights.len();
        for number in numbers {
            let height = number.trim().parse::<f64>().ok().filter(|height| height.abs() <= HEIGHT_MAX_MM);
            let Some(height) = height else {
                let problem = format!(
                    "`{}` is no height from -{HEIGHT_MAX_MM} to {HEIGHT_MAX_MM} mm",
                    excerpt(number.trim())
                );
                return Err(reader.error("points", problem));
            };
            heights.push(height);
        }
        if heights.len() - before != counts[0] {
            let problem = format!("a row has {} points, x_count is {}", heights.len() - before, counts[0]);
            return Err(reader.error("points", problem));
        }
    }
    Ok(heights)
}

#[derive(Clone, Copy)]
enum Algorithm {
    Lagrange,
    Bicubic,
    /// By straight lines.
    Direct,
}

fn algorithm(reader: &mut Reader<'_>, key: &'static str) -> Checked<Algorithm> {
    let Some(text) = reader.text(key) else { return Ok(Algorithm::Lagrange) };
    match text.to_ascii_lowercase().as_str() {
        "lagrange" => Ok(Algorithm::Lagrange),
        "bicubic" => Ok(Algorithm::Bicubic),
        "direct" => Ok(Algorithm::Direct),
        _ => Err(reader.error(key, format!("`{}` is not {ALGORITHMS}", excerpt(&text)))),
    }
}

/// `X, Y`, where it is there.
fn place(reader: &mut Reader<'_>, key: &'static str) -> Checked<Option<[f64; 2]>> {
    let Some(text) = reader.text(key) else { return Ok(None) };
    let mut parts =
        text.split(',').map(|part| part.trim().parse::<f64>().ok().filter(|at| at.abs() <= PLACE_MAX_MM));
    match (parts.next(), parts.next(), parts.next()) {
        (Some(Some(x)), Some(Some(y)), None) => Ok(Some([x, y])),
        _ => {
            Err(reader
                .error(key, format!("`{}` is no place; write X and Y in mm, e.g. 35, 6", excerpt(&text))))
        }
    }
}

/// One whole number, or one for each of X and Y.
fn counts(reader: &mut Reader<'_>, key: &'static str, min: u32, max: u32) -> Checked<()> {
    let Some(text) = reader.text(key) else { return Ok(()) };
    let parts: Vec<_> = text.split(',').map(|part| part.trim().parse::<u32>().ok()).collect();
    let fits = |part: &Option<u32>| part.is_some_and(|count| (min..=max).contains(&count));
    if parts.len() <= 2 && parts.iter().all(fits) {
        return Ok(());
    }
    let text = excerpt(&text);
    Err(reader
        .error(key, format!("`{text}` must be one or two whole numbers from {min} to {max}, e.g. 5, 3")))
}
