//! What a move may do, before it is planned: where it may go, how fast its motors can make it, and what the user is told.

use gcode::{Arc, Diagnostic, DiagnosticCode, LineNumber, Move, Severity, VelocityLimit};
use motion::Bend;
use units::MmPerS;

use super::{Planned, Planner, Position, Source};
use crate::{
    arcs,
    config::UnreachableSpeed,
    error::{ErrorCode, PrinterError},
    machine,
};

impl Planner {
    pub(super) fn notice_fan(&mut self, line: LineNumber) {
        if !core::mem::replace(&mut self.said.other_fans, true) {
            self.notice(line, "the machine file has one fan: orders for others are passed over");
        }
    }

    pub(super) fn notice(&mut self, line: LineNumber, message: &str) {
        self.ready.push_back(Planned::Notice(Diagnostic {
            line,
            columns: 0..0,
            severity: Severity::Info,
            code: DiagnosticCode::IgnoredSetting,
            message: message.into(),
        }));
    }

    /// A file may ask for less speed and acceleration than the machine file allows, never for more.
    pub(super) fn limit(&mut self, limit: VelocityLimit) {
        let limits = machine::lowered(&self.machine_limits, &self.limits, &limit);
        // Limits that make no sense (zero, not a number) leave those that hold.
        if self.look_ahead.set_limits(limits).is_ok() {
            self.limits = limits;
        }
    }

    /// An arc may lead out of the machine between two places that are in it. Where axes are not square, or the bed is not
    /// flat, all that it is made of is judged.
    pub(super) fn judge_arc(&self, arc: &Arc, source: &Source) -> Result<(), PrinterError> {
        if !self.transform.is_identity() {
            return self.judge_chords(arc, source);
        }
        let [x, y, z, _] = self.position;
        arc.extremes().try_for_each(|to| self.guard.judge_travel([x, y, z], [to.x, to.y, to.z], arc.line))
    }

    /// Plans a move along a straight line, or along `bend` where the machine is at its start. Where axes are not square, or
    /// the bed is not flat, it is a straight line. Filament alone leaves the head where it is, wherever the source believes
    /// that to be.
    pub(super) fn judge_and_push(
        &mut self,
        mv: &Move,
        bend: Option<&Bend>,
        source: &mut Source,
    ) -> Result<(), PrinterError> {
        let [x, y, z, e] = self.position;
        let is_filament_alone = [mv.from.x, mv.from.y, mv.from.z] == [mv.to.x, mv.to.y, mv.to.z];
        let end = if is_filament_alone {
            gcode::Position { x, y, z, e: mv.to.e }
        } else if self.transform.is_identity() {
            mv.to
        } else {
            return self.judge_and_take_apart(mv, source);
        };
        let e_offset = source.e_offset;
        let to = [end.x, end.y, end.z, end.e + e_offset];
        // Judged from where the machine is, not from where the source believes that it is.
        let from = gcode::Position { x, y, z, e: e - e_offset };
        self.guard.judge(&Move { from, to: end, ..*mv })?;
        let bend = bend.filter(|bend| bend.fits(&self.position, &to));
        if let Some(bend) = bend {
            self.guard.judge_bend(bend, self.position, to, mv.line)?;
        }
        let mut feed = mv.feed;
        for end in arcs::straight_ends(self.position, to, bend) {
            feed = feed.min(self.feed(mv.feed, mv.line, end, source));
        }
        for end in arcs::straight_ends(self.position, to, bend) {
            self.judge_torque(end, feed, mv.line)?;
        }
        self.push(to, bend, feed, mv.line, source.pace())
    }

    /// A move's feed; one that a factor has made faster than the motors can follow is slowed down to what they can.
    pub(super) fn feed(&mut self, wanted: MmPerS, line: LineNumber, to: Position, source: &Source) -> MmPerS {
        if !source.is_sped_up() {
            return wanted;
        }
        let feed = self.step_rates.slowed(self.position, to, wanted);
        if feed < wanted && !core::mem::replace(&mut self.said.slowed, true) {
            self.notice(line, "a move is made slower than the factor asks: a motor cannot step faster");
        }
        feed
    }

    /// A move that is faster than its motors' torque allows is slowed down by the look-ahead: the user is told, or it is
    /// refused, as the machine file says.
    pub(super) fn judge_torque(
        &mut self,
        to: Position,
        feed: MmPerS,
        line: LineNumber,
    ) -> Result<(), PrinterError> {
        if to == self.position || self.said.clamped {
            return Ok(());
        }
        self.reject_torque(self.position, to, feed, line)?;
        let found = self.step_rates.out_of_torque(self.position, to, feed, &self.limits);
        let Some((motor, speed, top)) = found else { return Ok(()) };
        let name = machine::MOTOR_NAMES[motor];
        self.said.clamped = true;
        let text = format!(
            "moves are made slower than the file asks: {name} would have to go {:.0} mm/s, and its torque lasts up to \
             {:.0} mm/s",
            speed.0, top.0
        );
        self.notice(line, &text);
        Ok(())
    }

    /// Why a move may not be made that is faster than its motors' torque allows, if the machine file wants that.
    pub(super) fn reject_torque(
        &self,
        from: Position,
        to: Position,
        feed: MmPerS,
        line: LineNumber,
    ) -> Result<(), PrinterError> {
        if self.unreachable_speed != UnreachableSpeed::Reject {
            return Ok(());
        }
        let Some((motor, speed, top)) = self.step_rates.out_of_torque(from, to, feed, &self.limits) else {
            return Ok(());
        };
        let name = machine::MOTOR_NAMES[motor];
        let detail = format!("{name} at {:.0} mm/s, its torque lasts up to {:.0} mm/s", speed.0, top.0);
        Err(PrinterError::new(ErrorCode::StepRateTooHigh, detail).at_line(line.0))
    }
}
