//! A straight move of the G-code as the machine makes it: straight pieces that stay near the bed's surface.
//!
//! A piece of length h is no farther than |z''|·h²/8 from the surface that it follows, z'' being the surface's second
//! derivative along the way. Each cell of the mesh has a bound for that ([`super::surface::Cell`]), so that a piece is as
//! long as the bounds of the cells on its way allow; it ends where the surface has an edge. One piece at a time, each at
//! least [`PIECE_MIN_MM`] long. The filament is shared out by length.

use super::{Transform, mesh::Mesh, surface::Interpolation};

/// No piece is shorter, in mm, but for a whole move; where a surface has an edge, a piece may go so far beyond it.
pub const PIECE_MIN_MM: f64 = 0.02;
/// Of the error that is allowed, this is left for going beyond edges.
const SHARE_BENT: f64 = 0.75;
/// Heights at which a fade begins and ends may be missed by this, in mm.
const FADE_MISSED_MM: f64 = 0.001;

/// What is left of a move.
#[derive(Clone, Debug)]
pub struct Pieces {
    transform: Transform,
    /// In the G-code's coordinates: X, Y, Z, and the filament.
    from: [f64; 4],
    to: [f64; 4],
    /// Where its ends are on the bed: skewed, not yet lifted.
    flat: [[f64; 3]; 2],
    /// How far it is, 0 ..= 1.
    at: f64,
    /// The shortest piece, as a share of the whole.
    shortest: f64,
}

/// A cell that the way leads through.
struct Stretch {
    /// Where the way leaves it, as a share of the whole; infinite where it does not.
    until: f64,
    /// There is an edge.
    is_edge: bool,
    /// The second derivative of Z along the way.
    bend: f64,
}

impl Pieces {
    /// Of a move in the G-code's coordinates.
    pub(super) fn new(transform: &Transform, from: [f64; 4], to: [f64; 4]) -> Self {
        let flat = [from, to].map(|[x, y, z, _]| transform.flat([x, y, z]));
        let way: [f64; 3] = core::array::from_fn(|axis| flat[1][axis] - flat[0][axis]);
        let length = libm::sqrt(way.iter().map(|d| d * d).sum());
        // A move of no length is one piece.
        let shortest = if length > PIECE_MIN_MM { PIECE_MIN_MM / length } else { 1.0 };
        Self { transform: transform.clone(), from, to, flat, at: 0.0, shortest }
    }

    /// Where the next piece ends.
    fn end(&self) -> f64 {
        let Some(mesh) = self.transform.mesh() else { return 1.0 };
        let limit = self.fade_end(mesh);
        let mut bend: f64 = 0.0;
        let mut at = self.at;
        let end = loop {
            let stretch = self.stretch(mesh, at, limit);
            bend = bend.max(stretch.bend);
            let allowed = libm::sqrt(8.0 * SHARE_BENT * mesh.z_error / bend).max(self.shortest);
            let reach = self.at + allowed;
            if reach <= stretch.until.min(limit) {
                // Two of the same length rather than a long and a short one.
                let rest = limit - self.at;
                break if rest < 2.0 * allowed { self.at + 0.5 * rest } else { reach };
            }
            if reach < at {
                break at;
            }
            if stretch.until >= limit {
                break limit;
            }
            if stretch.is_edge {
                break stretch.until;
            }
            at = stretch.until;
        };
        let end = end.max(self.at + self.shortest);
        if end + self.shortest >= 1.0 { 1.0 } else { end }
    }

    /// Where the way next comes to a height at which a fade begins or ends.
    fn fade_end(&self, mesh: &Mesh) -> f64 {
        let Some(fade) = mesh.fade() else { return 1.0 };
        let [from, to] = [self.flat[0][2], self.flat[1][2]];
        let (way, here) = (to - from, from + (to - from) * self.at);
        let ahead = |height: f64| (height - here) * way.signum() > FADE_MISSED_MM;
        let share = |height: f64| (height - from) / way;
        let found =
            [fade.start, fade.end].into_iter().filter(|&height| way != 0.0 && ahead(height)).map(share);
        found.fold(1.0, f64::min)
    }

    /// The cell that the way is in just behind `at`.
    fn stretch(&self, mesh: &Mesh, at: f64, limit: f64) -> Stretch {
        let surface = mesh.surface();
        let mut until = f64::INFINITY;
        let mut is_edge = false;
        let mut cell = [0; 2];
        let mut ways = [0.0; 2];
        for axis in 0..2 {
            let grid = &surface.axes[axis];
            let [from, to] = [self.flat[0][axis], self.flat[1][axis]];
            let way = to - from;
            let last = (grid.count - 1) as f64;
            // A border that is as good as reached has been passed.
            let place = grid.grid(from + way * at) + way.signum() * (PIECE_MIN_MM / grid.pitch());
            let is_inside = (0.0..last).contains(&place);
            cell[axis] = place.clamp(0.0, last) as usize;
            if way == 0.0 {
                ways[axis] = 0.0;
                continue;
            }
            // Beyond the ends the surface does not change along this axis.
            ways[axis] = if is_inside { way } else { 0.0 };
            let border = if way > 0.0 {
                if place < 0.0 { 0.0 } else { libm::floor(place) + 1.0 }
            } else if place >= last {
                last
            } else {
                libm::ceil(place) - 1.0
            };
            if !(0.0..=last).contains(&border) {
                continue;
            }
            let share = (grid.min + border * grid.pitch() - from) / way;
            if share < until {
                until = share;
                is_edge = border == 0.0 || border == last || grid.interpolation == Interpolation::Linear;
            }
        }
        let cell = surface.cell(cell[0], cell[1]);
        let length = libm::hypot(ways[0], ways[1]);
        let rise = self.flat[1][2] - self.flat[0][2];
        let heights = [at, until.min(limit)].map(|at| self.flat[0][2] + rise * at);
        let shares = heights.map(|height| mesh.share(height));
        let lost = shares[0] - shares[1];
        let steepest =
            if lost == 0.0 { 0.0 } else { mesh.fade().map_or(0.0, |it| 1.0 / (it.end - it.start)) };
        let bend = shares[0].max(shares[1]) * cell.curvature * length * length
            + 2.0 * steepest * rise.abs() * cell.slope * length;
        Stretch { until, is_edge, bend }
    }
}

impl Iterator for Pieces {
    type Item = [f64; 4];

    /// Where the next piece ends: machine coordinates, and the filament.
    fn next(&mut self) -> Option<[f64; 4]> {
        if self.at >= 1.0 {
            return None;
        }
        self.at = self.end();
        let is_last = self.at >= 1.0;
        let [x, y, z, e] = core::array::from_fn(|axis| {
            let (from, to) = (self.from[axis], self.to[axis]);
            if is_last { to } else { from + (to - from) * self.at }
        });
        let [x, y, z] = self.transform.machine_from_gcode([x, y, z]);
        Some([x, y, z, e])
    }
}
