//! What the commands of the motion clock do. A board without one does not know them.

use units::Clock32;
use wire::{Command, ShutdownReason};

use crate::{board::Board, firmware::Core, objects::Object};

impl<const OBJECTS: usize, const MOVES: usize> Core<OBJECTS, MOVES> {
    pub(crate) fn dispatch_motion(
        &mut self,
        board: &mut impl Board,
        command: &Command<'_>,
    ) -> Result<(), ShutdownReason> {
        if !self.has_motion_clock {
            return Err(ShutdownReason::CommandParser);
        }
        match *command {
            Command::MotionTie { oid } => {
                if self.config_crc.is_some() {
                    return Err(ShutdownReason::AlreadyConfigured);
                }
                return self.objects.digital_out(oid)?.tie();
            }
            Command::StepperGetQueue { oid } => {
                let progress = self.objects.stepper(oid)?.progress(oid, self.job);
                self.reply(board, &progress);
                return Ok(());
            }
            Command::MotionGetState {} => {
                self.report_motion(board);
                return Ok(());
            }
            _ if self.config_crc.is_none() => return Err(ShutdownReason::NotConfigured),
            _ => {}
        }
        let now = board.now();
        self.command_motion(board, now, command)?;
        self.look(now);
        Ok(())
    }

    fn command_motion(
        &mut self,
        board: &mut impl Board,
        now: Clock32,
        command: &Command<'_>,
    ) -> Result<(), ShutdownReason> {
        match *command {
            Command::MotionLease { covered, alive, ramp } => {
                self.hold.lease(now, Clock32(covered), Clock32(alive), ramp)
            }
            Command::MotionEnd { clock } => {
                self.hold.end_at(now, Clock32(clock));
                Ok(())
            }
            Command::MotionHold { ramp } => self.hold.hold(now, ramp),
            Command::MotionResume { ramp } => self.hold.resume(now, ramp),
            Command::MotionRate { rate, ramp } => self.hold.set_rate(now, rate, ramp),
            Command::MotionDrop {} => self.drop_motion(board),
            Command::MotionJob { id } => {
                for (_, object) in self.objects.iter_mut() {
                    if let Object::Stepper(stepper) = object {
                        stepper.begin_job()?;
                    }
                }
                self.job = id;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Empties the queues of what follows the motion clock.
    fn drop_motion(&mut self, board: &mut impl Board) -> Result<(), ShutdownReason> {
        if !self.hold.is_held() {
            return Err(ShutdownReason::MotionNotHeld);
        }
        self.hold.forget_lease();
        let Self { objects, timers, moves, receiver, hold, job, reports_pending, .. } = self;
        for (oid, object) in objects.iter_mut() {
            match object {
                Object::Stepper(stepper) => {
                    if stepper.drop_queue(moves) {
                        timers.cancel(oid);
                    }
                    // One that finds no room waits for it: nothing of it changes until the clock is reset.
                    stepper.report_pending = !receiver.send(board, &stepper.progress(oid, *job));
                    *reports_pending |= stepper.report_pending;
                }
                Object::DigitalOut(output) if output.is_tied() => {
                    output.drop_queue(moves);
                    match output.wake(&hold.clock) {
                        Some(wake) => timers.schedule(oid, wake),
                        None => timers.cancel(oid),
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    pub(crate) fn report_motion(&self, board: &mut impl Board) {
        let state = self.hold.report(board.now());
        self.reply(board, &state);
    }
}
