//! Motion that comes to rest because this host wants it to, and what becomes of the board's queue then.
//!
//! A job that is paused or ended does not run the board's queue empty: motion is held, within its ramp, and at rest the
//! queue is dropped. Boards without a motion clock come to rest behind what they have.

use units::Seconds;
use wire::Command;

use super::{
    Ready,
    hold::{Hold, Phase, Purpose, Turned, hold_error},
};
use crate::{
    journal::MotorQueue,
    machine::{MOTORS, Motors},
    session::{
        board::FAN_LANE,
        event::Event,
        job::{Job, JobState},
        layout::StepperOids,
        lease::RAMP_AT_REST,
        motion_time::HoldReason,
        stream::MotionStream,
    },
};

impl Ready {
    /// Has motion come to rest on its path, whatever holds it already; `false` where that cannot be, or nothing moves.
    pub(super) fn hold_motion(&mut self, purpose: Purpose, now: Seconds) -> bool {
        let moves = matches!(purpose, Purpose::GoOn | Purpose::Back | Purpose::Parked)
            || self.stream.run().is_some_and(|run| !run.homing);
        if !moves || !self.board.layout.has_motion_clock {
            return false;
        }
        let Some(mut hold) = self.hold.take() else {
            self.begin_hold(HoldReason::Asked);
            if let Some(hold) = &mut self.hold {
                hold.purpose = purpose;
                hold.asked = now;
            }
            self.tell_hold(purpose, now);
            return true;
        };
        let mut is_at_rest = false;
        match hold.phase {
            Phase::Dropping { .. } | Phase::Leaving { .. } if purpose != Purpose::End => {
                self.hold = Some(hold);
                return false;
            }
            Phase::Resuming(Some(told)) => {
                hold.phase = Phase::Slowing;
                hold.asked = now;
                hold.turned = Some(Turned { told, sent: None });
                self.tell_hold(purpose, now);
            }
            Phase::AtRest | Phase::Heating | Phase::Resuming(None) => {
                is_at_rest = true;
            }
            Phase::Slowing | Phase::Rejoining { .. } | Phase::Dropping { .. } | Phase::Leaving { .. } => {}
        }
        hold.purpose = purpose;
        self.hold = Some(hold);
        if is_at_rest {
            self.has_come_to_rest(now);
        }
        true
    }

    /// Tells the board to hold.
    pub(super) fn tell_hold(&mut self, purpose: Purpose, now: Seconds) {
        // On the way back everything is at rest already.
        let ramp = if purpose == Purpose::GoOn { RAMP_AT_REST } else { self.lease.ramp() };
        let ramp = self.board.ticks(ramp);
        self.board.hold_motion(ramp, now);
    }

    /// Whether nothing is to be planned: what was planned comes to rest on its path, or has been dropped.
    pub(super) fn plans_nothing(&self) -> bool {
        let is_halting = self.job.as_ref().is_some_and(|job| job.state == JobState::Halting);
        let drops = |hold: &Hold| hold.is_wanted() || matches!(hold.phase, Phase::Dropping { .. });
        is_halting || self.hold.as_ref().is_some_and(drops)
    }

    /// Motion is at rest, as this host wanted it to be.
    pub(super) fn has_come_to_rest(&mut self, now: Seconds) {
        let Some(hold) = &mut self.hold else { return };
        hold.phase = Phase::AtRest;
        let can_go_on = self.job.as_ref().is_some_and(|job| job.paused.is_some() && !job.is_ending());
        match hold.purpose {
            Purpose::Pause | Purpose::Back | Purpose::Parked
                if self.job.as_ref().is_some_and(Job::is_ending) =>
            {
                self.cancel_held(now);
            }
            // What another host began is first made this one's own.
            Purpose::Pause if hold.rest.is_some() => hold.phase = hold.warm(now),
            Purpose::Pause | Purpose::Back | Purpose::Parked => self.drop_queue(now),
            Purpose::GoOn if can_go_on => {
                hold.purpose = Purpose::Ask;
                hold.phase = Phase::Resuming(None);
                let has_cooled = self.thermal.has_fallen();
                if has_cooled {
                    hold.phase = Phase::AtRest;
                    hold.is_told = true;
                    self.events.push(Event::Held(hold_error(HoldReason::HostAway, None)));
                }
                self.rejoin_cut(now);
            }
            Purpose::GoOn | Purpose::End => {
                self.cancel_held(now);
            }
            Purpose::Ask => {}
        }
    }

    /// The head of a job that another host had put aside stands where its motors' counts say.
    pub(super) fn stand_parked(&mut self, counts: &[i32; MOTORS], now: Seconds) {
        self.events.push(Event::RunBroken { at: self.board.motion_at(now) });
        self.stand_at(counts, now);
        self.diary.stay_parked(&mut self.board);
        let cut = self.job.as_ref().and_then(|job| job.paused.as_ref()).and_then(|it| it.cut.as_ref());
        if let Some(fan) = cut.map(|cut| cut.left.fan) {
            self.set_fan_now(fan, now);
        }
    }

    /// The way back of a paused job is broken off here.
    pub(super) fn stand_on_the_way_back(&mut self, counts: &[i32; MOTORS], now: Seconds) {
        let fan = self.thermal.fan_speed();
        self.stand_at(counts, now);
        self.diary.stay_parked(&mut self.board);
        self.set_fan_now(fan, now);
    }

    fn drop_queue(&mut self, now: Seconds) {
        if let Some(hold) = &mut self.hold {
            hold.phase = Phase::Dropping { since: now, asked: now, queues: [None; MOTORS] };
            MotionStream::forget_unsent(&mut self.board);
            self.board.control(&Command::MotionDrop {});
        }
    }

    /// Ends what is held; `false` where nothing is.
    pub(super) fn cancel_held(&mut self, now: Seconds) -> bool {
        let may_end = |hold: &&mut Hold| {
            matches!(
                hold.phase,
                Phase::AtRest | Phase::Heating | Phase::Rejoining { .. } | Phase::Resuming(None)
            )
        };
        let Some(hold) = self.hold.as_mut().filter(may_end) else { return false };
        hold.rest = None;
        hold.purpose = Purpose::End;
        self.thermal.all_off(&mut self.board, now);
        self.drop_queue(now);
        if let Some(job) = self.job.as_mut().filter(|job| !job.is_ending()) {
            job.state = JobState::Cancelling;
        }
        true
    }

    /// This host was held up for so long: what it has asked had no time to be answered.
    pub(super) fn has_not_listened(&mut self, gap: Seconds) {
        if let Some(Phase::Rejoining { since, .. } | Phase::Dropping { since, .. }) =
            self.hold.as_mut().map(|hold| &mut hold.phase)
        {
            *since += gap;
        }
    }

    /// A motor's answer to a dropped queue.
    pub(super) fn on_queue(&mut self, oid: u8, queue: &MotorQueue) {
        let is_it = |oids: &Option<StepperOids>| oids.is_some_and(|oids| oids.stepper.0 == oid);
        let Some(motor) = self.board.layout.steppers.iter().position(is_it) else { return };
        match self.hold.as_mut().map(|hold| &mut hold.phase) {
            Some(Phase::Dropping { queues, .. }) => queues[motor] = Some(*queue),
            Some(Phase::Rejoining { answered, .. }) => answered[motor] = true,
            _ => {}
        }
    }

    /// The queue has been dropped: the machine stands where its motors' counts say.
    pub(super) fn stand_at(&mut self, counts: &[i32; MOTORS], now: Seconds) {
        let position = self.stream.position_of(*counts, &Motors::new(&self.config), &self.board);
        self.planner.abandon_run();
        self.board.link.forget_motion(FAN_LANE as u8);
        if self.stream.abandon(&mut self.board) {
            self.events.push(Event::RunBroken { at: self.board.motion_at(now) });
        }
        for (motor, &count) in counts.iter().enumerate() {
            self.stream.set_count(motor, count);
        }
        match position {
            Some(position) => self.planner.stand_at(position),
            // Counts that no machine can have: where the head is shows only when it is homed.
            None => (0..3).for_each(|axis| self.planner.guard.set_homed(axis, false)),
        }
        self.console.clear();
        self.planner.correct(&mut self.console.source);
        self.thermal.forget_fan_orders();
        self.stream.kept.forget_fans();
        self.set_fan_now(0.0, now);
        self.lease.forget();
    }
}
