//! The paths of the axes at even times, as the kinematics gets them: after pressure advance and input shaping.
//!
//! Samples are made when they are asked for, up to the time for which all axes are known. Keeps the segments that have not
//! been passed. Times in seconds of print time over all runs of motion and the dwells between them; mm.

use std::collections::VecDeque;

use steps::{AXES, Segment};
use units::Seconds;

use super::{Planner, Position};

/// The axes at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceSample {
    /// Print time.
    pub time: Seconds,
    /// X, Y, Z and the filament, mm.
    pub position: [f64; AXES],
    /// mm/s.
    pub velocity: [f64; AXES],
    /// mm/s².
    pub accel: [f64; AXES],
}

/// Samples a plan.
#[derive(Debug)]
pub(super) struct Trace {
    step_s: f64,
    /// The next sample's number: its time is that many steps.
    next: u64,
    /// Print time of everything before this run.
    base: f64,
    /// In the run's own time.
    known: f64,
    position: Position,
    paths: [VecDeque<Segment>; AXES],
}

impl Trace {
    pub(super) fn new(step: Seconds) -> Self {
        Self {
            step_s: step.0,
            next: 0,
            base: 0.0,
            known: 0.0,
            position: [0.0; AXES],
            paths: Default::default(),
        }
    }

    /// A run begins at rest.
    pub(super) fn begin_run(&mut self, position: Position) {
        self.position = position;
        self.known = 0.0;
        self.paths.iter_mut().for_each(VecDeque::clear);
    }

    /// What has become known of each axis, and up to which time of the run.
    pub(super) fn take(&mut self, paths: &[Vec<Segment>; AXES], known: Seconds) {
        for (queue, path) in self.paths.iter_mut().zip(paths) {
            queue.extend(path);
        }
        self.known = self.known.max(known.0);
    }

    /// The run, or a rest, lasts until this time of it.
    pub(super) fn last_until(&mut self, time: Seconds) {
        self.known = self.known.max(time.0);
    }

    /// What comes next is after this much time, all of which has been sampled.
    pub(super) fn go_on_after(&mut self, time: Seconds) {
        self.base += time.0;
        self.known = 0.0;
        for (queue, position) in self.paths.iter_mut().zip(&mut self.position) {
            if let Some(last) = queue.drain(..).next_back() {
                *position = last.end;
            }
        }
    }

    /// The next sample, if it is known.
    pub(super) fn next(&mut self) -> Option<TraceSample> {
        let time = self.next as f64 * self.step_s;
        let local = time - self.base;
        if local >= self.known {
            return None;
        }
        self.next += 1;
        let mut sample = TraceSample {
            time: Seconds(time),
            position: self.position,
            velocity: [0.0; AXES],
            accel: [0.0; AXES],
        };
        for (axis, queue) in self.paths.iter_mut().enumerate() {
            while let Some(done) = queue.pop_front_if(|front| front.end_time() <= local) {
                self.position[axis] = done.end;
            }
            sample.position[axis] = self.position[axis];
            if let Some(segment) = queue.front().filter(|front| front.start_time <= local) {
                let t = local - segment.start_time;
                let [c1, c2, c3, c4, c5] = segment.powers;
                sample.position[axis] = segment.start + segment.way(t);
                sample.velocity[axis] = c1 + (2.0 * c2 + (3.0 * c3 + (4.0 * c4 + 5.0 * c5 * t) * t) * t) * t;
                sample.accel[axis] = 2.0 * c2 + (6.0 * c3 + (12.0 * c4 + 20.0 * c5 * t) * t) * t;
            }
        }
        Some(sample)
    }
}

impl Planner {
    /// Samples the paths of the axes from now on, so far apart.
    pub(super) fn trace(&mut self, step: Seconds) {
        self.trace = Some(Box::new(Trace::new(step)));
    }

    /// The generator has been given something.
    pub(super) fn trace_paths(&mut self) {
        if let Some(trace) = &mut self.trace {
            let (paths, known) = self.generator.axis_paths();
            trace.take(paths, known);
        }
    }
}
