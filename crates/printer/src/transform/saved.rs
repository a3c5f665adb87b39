//! A mesh as a machine file has it: what it is made from. A machine file may have dozens, of which a print loads one; what
//! takes time is worked out when that is first asked for.

use core::fmt;
use std::sync::{Arc, OnceLock};

use crc::{CRC_32_ISO_HDLC, Crc};

use super::{Fade, GridAxis, Mesh, MeshError, Surface};

/// No surface swings farther beyond its points than by so many times half of what they span: six points along either axis
/// that are joined by Lagrange's polynomial, or a spline of the greatest tension.
const SWING_MAX: f64 = 12.0;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What all meshes of a machine file have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshSettings {
    /// Where the bed's shape is left behind.
    pub fade: Fade,
    /// What is added above that; the mesh's mean where nothing is said.
    pub target: Option<f64>,
    /// How far a straight piece of a move may be from the surface, in mm.
    pub z_error: f64,
    /// The place where nothing is added, if the mesh has it.
    pub reference: Option<[f64; 2]>,
}

/// See the module.
#[derive(Clone)]
pub struct SavedMesh {
    name: String,
    axes: [GridAxis; 2],
    /// In rows of Y, each of X.
    heights: Vec<f64>,
    settings: MeshSettings,
    made: OnceLock<Result<Arc<Mesh>, MeshError>>,
}

impl SavedMesh {
    /// Of a grid of heights; none where they make no grid. An error where it can be seen from the points that nothing can
    /// be done with it.
    pub fn new(
        name: String,
        axes: [GridAxis; 2],
        heights: Vec<f64>,
        settings: MeshSettings,
    ) -> Option<Result<Self, MeshError>> {
        if !Surface::is_grid(&axes, &heights) {
            return None;
        }
        let saved = Self { name, axes, heights, settings, made: OnceLock::new() };
        Some(saved.check_points().map(|()| saved))
    }

    /// What is wrong whatever lies between the points.
    fn check_points(&self) -> Result<(), MeshError> {
        let (low, high) = self
            .heights
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &it| (low.min(it), high.max(it)));
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let MeshSettings { fade, target, reference, .. } = self.settings;
        if fade.end <= fade.start {
            return Ok(());
        }
        // With a place where nothing is added, the heights count from the surface there.
        let (middle, swing) = if reference.is_some() { (0.0, 2.0 * SWING_MAX) } else { (middle, SWING_MAX) };
        if let Some(target) = target.filter(|&it| it != 0.0 && (it - middle).abs() > swing * half) {
            return Err(MeshError::TargetOutside { target, low, high });
        }
        let distance = fade.end - fade.start;
        if half >= distance { Err(MeshError::FadeTooShort { depth: half, distance }) } else { Ok(()) }
    }

    /// The profile's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The mesh, worked out once.
    pub fn mesh(&self) -> Result<Arc<Mesh>, MeshError> {
        self.made.get_or_init(|| self.make().map(Arc::new)).clone()
    }

    /// Whether it has been worked out.
    #[cfg(test)]
    pub(super) fn is_made(&self) -> bool {
        self.made.get().is_some()
    }

    fn make(&self) -> Result<Mesh, MeshError> {
        let MeshSettings { fade, target, z_error, reference } = self.settings;
        let surface = Surface::of_grid(self.axes, self.heights.clone());
        let is_on = |place: [f64; 2]| {
            self.axes.iter().zip(place).all(|(axis, at)| (axis.min..=axis.max).contains(&at))
        };
        let surface = match reference.filter(|&place| is_on(place)) {
            Some([x, y]) => {
                let height = surface.height(x, y);
                surface.lowered(height)
            }
            None => surface,
        };
        Mesh::new(self.name.clone(), surface, Some(fade), target, z_error)
    }
}

/// What has been worked out is no part of it.
impl PartialEq for SavedMesh {
    fn eq(&self, other: &Self) -> bool {
        let Self { name, axes, heights, settings, made: _ } = self;
        (name, axes, heights, settings) == (&other.name, &other.axes, &other.heights, &other.settings)
    }
}

/// Of the heights only a check, for there may be ten thousand; nothing of what has been worked out.
impl fmt::Debug for SavedMesh {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut check = CRC.digest();
        self.heights.iter().for_each(|height| check.update(&height.to_bits().to_le_bytes()));
        let Self { name, axes, settings, heights: _, made: _ } = self;
        let heights = check.finalize();
        out.debug_struct("SavedMesh")
            .field("name", name)
            .field("axes", axes)
            .field("heights", &heights)
            .field("settings", settings)
            .finish_non_exhaustive()
    }
}
