//! A smooth surface through a grid of heights: the product of two interpolations of one variable.
//!
//! Knows heights over places, not what they are for. Beyond its edges a surface goes on as at the edge. All in mm.
//!
//! Sources: cubic Hermite splines with tangents t·(p₊ − p₋) (Catmull and Rom, "A Class of Local Interpolating Splines",
//! 1974; t = ½ is theirs, and follows planes), Lagrange's polynomial. Which is used when, and what the tension does, is as
//! Klipper's public documentation has it (docs/Bed_Mesh.md, "Mesh Interpolation"), whose tension is t.

/// The most points along an axis that Lagrange's polynomial is led through: with more it swings.
pub const LAGRANGE_POINTS_MAX: usize = 6;
/// A spline looks at two points to either side.
const SPLINE_POINTS: usize = 4;
/// Where a cell is looked at to know how steep and how bent it is: so many places along either axis …
const SAMPLES: usize = 5;
/// … between which it may be more so by this.
const SAMPLE_SLACK: f64 = 1.25;

/// How the heights along an axis are joined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interpolation {
    /// By straight lines.
    Linear,
    /// By one polynomial.
    Lagrange,
    /// By cubics, with this tension.
    Cardinal(f64),
}

/// One axis of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridAxis {
    /// Where the first point is …
    pub min: f64,
    /// … and the last.
    pub max: f64,
    /// How many there are, 2 or more.
    pub count: usize,
    /// What is between them.
    pub interpolation: Interpolation,
}

impl GridAxis {
    /// From one point to the next.
    pub fn pitch(&self) -> f64 {
        (self.max - self.min) / (self.count - 1) as f64
    }

    /// A place counted in points from the first.
    pub fn grid(&self, at: f64) -> f64 {
        (at - self.min) / self.pitch()
    }

    /// The interval between points that a place counted so is in, or the nearest.
    fn interval(&self, grid: f64) -> usize {
        // A cast keeps what is below 0, and what is no number, at 0.
        (grid as usize).min(self.count - 2)
    }

    /// What each point counts at a place, with the first and second derivatives by it. A place beyond the ends counts as the end.
    fn weights(&self, at: f64, interval: Option<usize>) -> Weights {
        let grid = self.grid(at.clamp(self.min, self.max));
        let interval = interval.unwrap_or_else(|| self.interval(grid));
        let u = Jet { value: grid - interval as f64, first: 1.0 / self.pitch(), second: 0.0 };
        let mut weights = Weights { begin: interval, count: 2, of: [Jet::default(); LAGRANGE_POINTS_MAX] };
        match self.interpolation {
            Interpolation::Linear => {
                weights.add(interval, Jet::constant(1.0).plus(u.times_number(-1.0)));
                weights.add(interval + 1, u);
            }
            Interpolation::Lagrange => {
                weights.begin = 0;
                weights.count = self.count;
                for point in 0..self.count {
                    weights.add(point, self.lagrange(point, grid));
                }
            }
            Interpolation::Cardinal(tension) => self.cardinal(interval, u, tension, &mut weights),
        }
        weights
    }

    fn lagrange(&self, point: usize, grid: f64) -> Jet {
        let mut product = Jet::constant(1.0);
        for other in (0..self.count).filter(|&other| other != point) {
            let way = point as f64 - other as f64;
            let factor =
                Jet { value: (grid - other as f64) / way, first: 1.0 / (self.pitch() * way), second: 0.0 };
            product = product.times(factor);
        }
        product
    }

    fn cardinal(&self, interval: usize, u: Jet, tension: f64, weights: &mut Weights) {
        let (u2, u3) = (u.times(u), u.times(u).times(u));
        let sum = |a: f64, b: f64, c: f64, d: f64| {
            let bent = u3.times_number(a).plus(u2.times_number(b));
            bent.plus(u.times_number(c)).plus(Jet::constant(d))
        };
        weights.begin = interval.saturating_sub(1);
        weights.count = SPLINE_POINTS.min(self.count - weights.begin);
        weights.add(interval, sum(2.0, -3.0, 0.0, 1.0));
        weights.add(interval + 1, sum(-2.0, 3.0, 0.0, 0.0));
        for (point, shape) in [(interval, sum(1.0, -2.0, 1.0, 0.0)), (interval + 1, sum(1.0, -1.0, 0.0, 0.0))]
        {
            // At an end, the point that is missing is taken to lie straight on.
            let (before, after, share) = match point {
                0 => (0, 1, 2.0),
                _ if point == self.count - 1 => (point - 1, point, 2.0),
                _ => (point - 1, point + 1, 1.0),
            };
            weights.add(after, shape.times_number(share * tension));
            weights.add(before, shape.times_number(-share * tension));
        }
    }
}

/// A value and its first two derivatives.
#[derive(Clone, Copy, Debug, Default)]
struct Jet {
    value: f64,
    first: f64,
    second: f64,
}

impl Jet {
    const fn constant(value: f64) -> Self {
        Self { value, first: 0.0, second: 0.0 }
    }

    fn plus(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            first: self.first + other.first,
            second: self.second + other.second,
        }
    }

    fn times_number(self, by: f64) -> Self {
        Self { value: self.value * by, first: self.first * by, second: self.second * by }
    }

    fn times(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            first: self.first * other.value + self.value * other.first,
            second: self.second * other.value + 2.0 * self.first * other.first + self.value * other.second,
        }
    }
}

/// What the points from `begin` on count.
struct Weights {
    begin: usize,
    count: usize,
    of: [Jet; LAGRANGE_POINTS_MAX],
}

impl Weights {
    fn add(&mut self, point: usize, weight: Jet) {
        let place = &mut self.of[point - self.begin];
        *place = place.plus(weight);
    }

    fn iter(&self) -> impl Iterator<Item = (usize, Jet)> {
        self.of[..self.count].iter().enumerate().map(|(at, &weight)| (self.begin + at, weight))
    }
}

/// How steep and how bent a cell of the grid is at most, whatever the direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// mm/mm.
    pub slope: f64,
    /// 1/mm.
    pub curvature: f64,
}

/// The surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    /// X and Y.
    pub axes: [GridAxis; 2],
    /// Rows of Y, from the first.
    heights: Vec<f64>,
    cells: Vec<Cell>,
    /// The lowest and highest heights that it has.
    pub range: [f64; 2],
    /// Its mean.
    pub mean: f64,
}

impl Surface {
    /// Through these heights, given in rows of Y: as many as the axes have points, or there is none.
    pub fn new(axes: [GridAxis; 2], heights: Vec<f64>) -> Option<Self> {
        Self::is_grid(&axes, &heights).then(|| Self::of_grid(axes, heights))
    }

    /// Whether there is one.
    pub(super) fn is_grid(axes: &[GridAxis; 2], heights: &[f64]) -> bool {
        let fits = |axis: &GridAxis| {
            let lagrange = axis.interpolation == Interpolation::Lagrange;
            axis.count >= 2 && axis.max > axis.min && (!lagrange || axis.count <= LAGRANGE_POINTS_MAX)
        };
        axes.iter().all(fits) && heights.len() == axes[0].count * axes[1].count
    }

    /// Where there is one.
    pub(super) fn of_grid(axes: [GridAxis; 2], heights: Vec<f64>) -> Self {
        let range = [f64::INFINITY, f64::NEG_INFINITY];
        let mut surface = Self { axes, heights, cells: Vec::new(), range, mean: 0.0 };
        surface.look();
        surface
    }

    /// Looks at each cell.
    fn look(&mut self) {
        let [columns, rows] = self.axes.map(|axis| axis.count - 1);
        let mut sum = 0.0;
        for row in 0..rows {
            for column in 0..columns {
                let (cell, mean, range) = self.look_at([column, row]);
                self.cells.push(cell);
                self.range = [self.range[0].min(range[0]), self.range[1].max(range[1])];
                sum += mean;
            }
        }
        self.mean = sum / (columns * rows) as f64;
    }

    /// What a cell is like, its mean, and its lowest and highest heights.
    fn look_at(&self, cell: [usize; 2]) -> (Cell, f64, [f64; 2]) {
        let pitches = self.axes.map(|axis| axis.pitch());
        let weights = [0, 1].map(|axis: usize| {
            core::array::from_fn::<_, SAMPLES, _>(|sample| {
                let part = sample as f64 / (SAMPLES - 1) as f64;
                let at = self.axes[axis].min + (cell[axis] as f64 + part) * pitches[axis];
                self.axes[axis].weights(at, Some(cell[axis]))
            })
        });
        let (mut found, mut sum) = (Cell::default(), 0.0);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for (row, y) in weights[1].iter().enumerate() {
            for (column, x) in weights[0].iter().enumerate() {
                let [z, by_x, by_y, by_xx, by_xy, by_yy] = self.derivatives(x, y);
                let half = 0.5 * (by_xx - by_yy);
                let bend = 0.5 * (by_xx + by_yy).abs() + libm::hypot(half, by_xy);
                found.curvature = found.curvature.max(bend * SAMPLE_SLACK);
                found.slope = found.slope.max(libm::hypot(by_x, by_y) * SAMPLE_SLACK);
                range = [range[0].min(z), range[1].max(z)];
                let at_edge = |sample: usize| if sample == 0 || sample == SAMPLES - 1 { 0.5 } else { 1.0 };
                sum += z * at_edge(row) * at_edge(column);
            }
        }
        // The samples around any place are no farther than this from it.
        let away = 0.5 * libm::hypot(pitches[0], pitches[1]) / (SAMPLES - 1) as f64;
        let beyond = found.curvature * away * away;
        let mean = sum / ((SAMPLES - 1) * (SAMPLES - 1)) as f64;
        (found, mean, [range[0] - beyond, range[1] + beyond])
    }

    /// The height, and its derivatives by x, y, xx, xy, yy.
    fn derivatives(&self, x: &Weights, y: &Weights) -> [f64; 6] {
        let mut sums = [0.0; 6];
        for (row, y) in y.iter() {
            let mut along = Jet::default();
            for (column, x) in x.iter() {
                along = along.plus(x.times_number(self.heights[row * self.axes[0].count + column]));
            }
            let terms = [
                along.value * y.value,
                along.first * y.value,
                along.value * y.first,
                along.second * y.value,
                along.first * y.first,
                along.value * y.second,
            ];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        sums
    }

    /// How high it is at a place.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let [x, y] = [self.axes[0].weights(x, None), self.axes[1].weights(y, None)];
        let mut height = 0.0;
        for (row, y) in y.iter() {
            let points =
                x.iter().map(|(column, x)| self.heights[row * self.axes[0].count + column] * x.value);
            height += y.value * points.sum::<f64>();
        }
        height
    }

    /// What a cell is like; the nearest one where there is none.
    pub fn cell(&self, column: usize, row: usize) -> Cell {
        let [columns, rows] = self.axes.map(|axis| axis.count - 1);
        self.cells[row.min(rows - 1) * columns + column.min(columns - 1)]
    }

    /// The height of each point, in rows of Y.
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.heights.chunks(self.axes[0].count)
    }

    /// The same, lower by so much.
    #[must_use]
    pub fn lowered(mut self, by: f64) -> Self {
        self.heights.iter_mut().for_each(|height| *height -= by);
        self.range = self.range.map(|height| height - by);
        self.mean -= by;
        self
    }
}
