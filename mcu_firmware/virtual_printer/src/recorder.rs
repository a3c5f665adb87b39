//! What watches the pins of the motors.
//!
//! Does not know what is made of it. Clocks are the board's, exact.

use units::Ticks;

/// Sees every edge on the step and direction pins of every motor, in the order of time.
///
/// Chosen at compile time, since tens of millions of edges pass through it.
pub trait Recorder {
    /// A pulse begins: the driver turns the field by one microstep. `count` is forward less backward pulses of this
    /// motor since power-up, this one included.
    fn step(&mut self, motor: usize, at: Ticks, forward: bool, count: i64);

    /// The motion clock is this much behind the board's clock from now on, until this is called again: for each edge
    /// while motion speeds up or slows down. Zero before the first call.
    fn motion_behind(&mut self, behind: Ticks) {
        let _ = behind;
    }

    /// A pulse ends.
    fn step_end(&mut self, motor: usize, at: Ticks) {
        let _ = (motor, at);
    }

    /// The direction pin changes.
    fn direction(&mut self, motor: usize, at: Ticks, forward: bool) {
        let _ = (motor, at, forward);
    }
}

/// Watches nothing.
impl Recorder for () {
    fn step(&mut self, _motor: usize, _at: Ticks, _forward: bool, _count: i64) {}
}

/// One edge on a motor's pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The motor, as numbered in the machine.
    pub motor: usize,
    /// When.
    pub at: Ticks,
    /// What.
    pub kind: EdgeKind,
}

/// What an edge means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EdgeKind {
    /// A pulse began; the direction was this, the count became that.
    Step {
        /// Whether towards higher positions.
        forward: bool,
        /// Forward less backward pulses.
        count: i64,
    },
    /// A pulse ended.
    StepEnd,
    /// The direction pin changed to this.
    Direction {
        /// Whether towards higher positions.
        forward: bool,
    },
}

/// Keeps the first edges, up to a bound, and counts the rest.
#[derive(Clone, Debug)]
pub struct EdgeLog {
    edges: Vec<Edge>,
    edges_max: usize,
    missed: u64,
}

impl EdgeLog {
    /// Keeps at most `edges_max` edges.
    pub fn new(edges_max: usize) -> Self {
        Self { edges: Vec::new(), edges_max, missed: 0 }
    }

    /// The edges kept, in the order of time.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Edges that came after the log was full.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// The clocks and counts of one motor's pulses.
    pub fn steps(&self, motor: usize) -> impl Iterator<Item = (Ticks, i64)> {
        self.edges.iter().filter(move |edge| edge.motor == motor).filter_map(|edge| match edge.kind {
            EdgeKind::Step { count, .. } => Some((edge.at, count)),
            _ => None,
        })
    }

    fn push(&mut self, motor: usize, at: Ticks, kind: EdgeKind) {
        if self.edges.len() < self.edges_max {
            self.edges.push(Edge { motor, at, kind });
        } else {
            self.missed += 1;
        }
    }
}

impl Recorder for EdgeLog {
    fn step(&mut self, motor: usize, at: Ticks, forward: bool, count: i64) {
        self.push(motor, at, EdgeKind::Step { forward, count });
    }

    fn step_end(&mut self, motor: usize, at: Ticks) {
        self.push(motor, at, EdgeKind::StepEnd);
    }

    fn direction(&mut self, motor: usize, at: Ticks, forward: bool) {
        self.push(motor, at, EdgeKind::Direction { forward });
    }
}
