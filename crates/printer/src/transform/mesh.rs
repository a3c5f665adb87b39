//! A bed that is not flat, and what is added to Z for it.
//!
//! The height over the surface counts from the bed; above `fade.start` less and less of the bed's shape is left, and above
//! `fade.end` only `target`. Machine coordinates in mm. Knows no moves.
//!
//! Source of what the options mean: Klipper's public documentation (docs/Bed_Mesh.md, docs/Config_Reference.md).

use super::surface::Surface;

/// A straight piece of a move may be so far from the surface at most, in mm, where no less is asked for.
pub const Z_ERROR_MAX_MM: f64 = 0.002;

/// Heights between which the bed's shape is left behind, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fade {
    /// All of it up to here.
    pub start: f64,
    /// None of it from here.
    pub end: f64,
}

/// Why there is no such mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The fade is too short.
    #[error(
        "the bed differs by up to {depth:.3} mm from the height that fade leads to: fade_end less fade_start is \
         {distance:.3} mm and must be more than that"
    )]
    FadeTooShort {
        /// What is to be lost on the way.
        depth: f64,
        /// The way.
        distance: f64,
    },
    /// It leads to a height that the bed has not.
    #[error(
        "fade_target {target:.3} mm is not between {low:.3} and {high:.3} mm, which the mesh has; 0 is allowed"
    )]
    TargetOutside {
        /// Where it leads.
        target: f64,
        /// The lowest that there is.
        low: f64,
        /// And the highest.
        high: f64,
    },
}

/// A bed's shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The profile's name.
    pub name: String,
    surface: Surface,
    fade: Option<Fade>,
    /// What is added above the fade.
    target: f64,
    /// How far a straight piece of a move may be from the surface, in mm.
    pub z_error: f64,
}

impl Mesh {
    /// Of a surface; `target` is the surface's mean where nothing is said.
    pub fn new(
        name: String,
        surface: Surface,
        fade: Option<Fade>,
        target: Option<f64>,
        z_error: f64,
    ) -> Result<Self, MeshError> {
        let fade = fade.filter(|fade| fade.end > fade.start);
        let target = target.unwrap_or(surface.mean);
        if let Some(fade) = fade {
            let [low, high] = surface.range;
            if target != 0.0 && !(low..=high).contains(&target) {
                return Err(MeshError::TargetOutside { target, low, high });
            }
            let (depth, distance) = ((high - target).max(target - low), fade.end - fade.start);
            // Otherwise lines one above the other would be made in the wrong order.
            if depth >= distance {
                return Err(MeshError::FadeTooShort { depth, distance });
            }
        }
        Ok(Self { name, surface, fade, target, z_error: z_error.min(Z_ERROR_MAX_MM) })
    }

    /// The bed.
    pub const fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Where its shape is left behind.
    pub const fn fade(&self) -> Option<Fade> {
        self.fade
    }

    /// How much of its shape is left at a height over it: 1 is all.
    pub fn share(&self, z: f64) -> f64 {
        self.fade.map_or(1.0, |Fade { start, end }| ((end - z) / (end - start)).clamp(0.0, 1.0))
    }

    /// Where Z has to be for a height over the bed.
    pub fn machine_from_gcode(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let height = self.surface.height(x, y);
        let added = match self.fade {
            None => height,
            Some(_) => self.target + (height - self.target) * self.share(z),
        };
        [x, y, z + added]
    }

    /// The height over the bed that a place has.
    pub fn gcode_from_machine(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let height = self.surface.height(x, y);
        let Some(Fade { start, end }) = self.fade else { return [x, y, z - height] };
        let low = z - height;
        let high = z - self.target;
        let over = if low <= start {
            low
        } else if high >= end {
            high
        } else {
            // z = over + target + (height − target)·(end − over)/(end − start)
            let lost = (height - self.target) / (end - start);
            (high - lost * end) / (1.0 - lost)
        };
        [x, y, over]
    }

    /// The least and the most that is ever added to Z.
    pub fn added(&self) -> [f64; 2] {
        let [low, high] = self.surface.range;
        if self.fade.is_some() { [low.min(self.target), high.max(self.target)] } else { [low, high] }
    }
}
