//! Motion that the board has brought to rest on its path because its host was held up: nothing is lost, and nothing goes
//! on before the user says so.
//!
//! The way on is with the very next step; the way out drops the board's queue and reads where the motors stand. A board
//! that regulates its heaters lowers them to stand-by meanwhile: to go on is to heat again first. On other boards a heater
//! that gets no orders shuts everything down, and then nothing is held any more.

use units::{Celsius, Seconds, Ticks};
use wire::Command;

use super::{Failure, Ready, Wait, take_up::Rest};
use crate::{
    error::{ErrorCode, PrinterError},
    journal::MotorQueue,
    link::{Lane, SCHEDULE_AHEAD_TICKS_MAX},
    machine::MOTORS,
    planner::ExtrusionPermit,
    session::{
        event::Event,
        job::{Job, JobState, JobStatus},
        lease::Cover,
        motion_time::{HoldReason, MotionReport, MotionState},
    },
};

/// Commands that are not answered are given again after this long.
const ASK_AGAIN: Seconds = Seconds(0.3);
/// A board that does not say where its motors stand for this long is given up.
const ANSWER_MAX: Seconds = Seconds(3.0);
/// A board that still holds so long after it was told to go on did not, or holds again.
const RESUME_MAX: Seconds = Seconds(1.5);
/// A nozzle that has cooled by this much since the hold, in °C, is heated first.
const COOLED_MAX_C: f64 = 10.0;
/// Motion that is to go on is covered by this much more than what speeding up and coming to rest take.
const COVER_SPARE: Seconds = Seconds(0.3);

/// How far a hold is.
#[derive(Clone, Debug)]
pub(super) enum Phase {
    /// Motion slows down.
    Slowing,
    /// At rest: the user decides.
    AtRest,
    /// The user wants to go on: what has cooled is heated again.
    Heating,
    /// Hot enough, with what another host began: the board drops what it has, and gets it again.
    Rejoining { since: Seconds, asked: Seconds, answered: [bool; MOTORS] },
    /// It may go on; since when the board has been told, if it has.
    Resuming(Option<Ticks>),
    /// The queue is dropped, and each motor says where it stands: the user wants to end it, or the job is put aside.
    Dropping { since: Seconds, asked: Seconds, queues: [Option<MotorQueue>; MOTORS] },
    /// Nothing is queued any more; the motion clock is set going again.
    Leaving { asked: Seconds },
}

/// What motion is held for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The board did it by itself: the user decides.
    Ask,
    /// The job is put aside …
    Pause,
    /// … and goes on where it was.
    GoOn,
    /// The job is put aside already: its way back is broken off.
    Back,
    /// Another host has put the job aside: what that was doing with the head is broken off.
    Parked,
    /// What is being made is ended.
    End,
}

/// Motion is held.
#[derive(Clone, Debug)]
pub(super) struct Hold {
    pub(super) phase: Phase,
    pub(super) purpose: Purpose,
    reason: HoldReason,
    /// When the board was last told to hold, where that is this host's wish.
    pub(super) asked: Seconds,
    /// The nozzle's temperature then, and whether it was hot enough to push filament.
    nozzle: Option<Celsius>,
    could_extrude: bool,
    /// What the heaters were set to.
    targets: Vec<(gcode::Heater, Celsius)>,
    /// The user has been told.
    pub(super) is_told: bool,
    /// What the board has to be given again, where another host began.
    pub(super) rest: Option<Box<Rest>>,
    /// It was told to go on, and then to rest after all.
    pub(super) turned: Option<Turned>,
}

/// The board was told to go on, and to hold again before it said that it does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turned {
    /// Its clock when it was told to go on: that it holds before that is no news …
    pub(super) told: Ticks,
    /// … nor is it before it has heard what was sent until then: that it is to hold.
    pub(super) sent: Option<Seconds>,
}

impl Hold {
    /// What comes once it is warm enough.
    pub(super) const fn warm(&self, now: Seconds) -> Phase {
        match &self.rest {
            Some(_) => {
                Phase::Rejoining { since: now, asked: Seconds(f64::NEG_INFINITY), answered: [false; MOTORS] }
            }
            None => Phase::Resuming(None),
        }
    }

    /// Whether motion comes to rest because this host wants it to. Then what the board says of motion that runs is older.
    pub(super) fn is_wanted(&self) -> bool {
        matches!(self.phase, Phase::Slowing) && self.purpose != Purpose::Ask
    }
}

impl Ready {
    /// What a hold makes of a job's status; nothing where there is none.
    pub(super) fn hold_status(&self) -> Option<JobStatus> {
        match self.hold.as_ref()?.phase {
            Phase::AtRest => Some(JobStatus::Held),
            Phase::Dropping { .. } if matches!(self.hold.as_ref()?.purpose, Purpose::Ask | Purpose::End) => {
                Some(JobStatus::Ending)
            }
            Phase::Dropping { .. }
            | Phase::Slowing
            | Phase::Heating
            | Phase::Rejoining { .. }
            | Phase::Resuming(_)
            | Phase::Leaving { .. } => None,
        }
    }

    /// The board's word on its motion.
    pub(super) fn on_motion(&mut self, report: &MotionReport, now: Seconds) {
        let Some(clock) = self.board.on_motion(report, now) else { return };
        if report.state == MotionState::Running {
            self.hold_is_over(now);
            return;
        }
        let at_rest = report.state == MotionState::Held;
        let slows = at_rest || report.state == MotionState::Slowing;
        let resume_max = self.board.ticks(RESUME_MAX);
        match &mut self.hold {
            None if slows && report.reason != HoldReason::None && self.lease.is_on() => {
                self.begin_hold(report.reason);
            }
            // Perhaps the order to go on did not reach it, or it held again: either way the user is asked again.
            Some(hold) if slows && report.reason != HoldReason::None => match hold.phase {
                Phase::Resuming(Some(told)) if clock > told + resume_max => {
                    self.begin_hold(report.reason);
                }
                _ => {}
            },
            _ => {}
        }
        let said_after = self.board.said_after;
        if let Some(hold) = &mut self.hold
            && at_rest
            && matches!(hold.phase, Phase::Slowing)
            && hold.turned.is_none_or(|it| clock > it.told && it.sent.is_some_and(|sent| said_after > sent))
        {
            hold.turned = None;
            if hold.purpose != Purpose::Ask {
                return self.has_come_to_rest(now);
            }
            let motion_now = self.board.motion_at(now);
            let has_begun = self.stream.run().is_none_or(|run| motion_now > run.start);
            let is_soon = self.calls.come_often();
            if hold.reason == HoldReason::QueueDry && !has_begun && is_soon {
                // What covers the run did not get there in time for its begin: it only begins a little later. Who has been
                // away does not expect it to move now.
                hold.phase = Phase::Resuming(None);
                return;
            }
            hold.phase = Phase::AtRest;
            if self.job.as_ref().is_some_and(Job::is_ending) {
                // The user has ended it while it slowed down.
                self.cancel_held(now);
                return;
            }
            hold.is_told = true;
            let error = match hold.rest {
                Some(_) => ErrorCode::HeldForHost.into(),
                None => hold_error(hold.reason, self.calls.gap.take()),
            };
            self.events.push(Event::Held(error));
        }
    }

    /// Motion that another host began is held, or about to be.
    pub(super) fn hold_for_host(&mut self, rest: Rest) {
        self.hold = Some(Hold {
            phase: Phase::Slowing,
            purpose: Purpose::Ask,
            asked: Seconds(f64::NEG_INFINITY),
            reason: HoldReason::HostAway,
            nozzle: None,
            could_extrude: rest.is_nozzle_on(),
            targets: rest.targets.clone(),
            is_told: false,
            rest: Some(Box::new(rest)),
            turned: None,
        });
    }

    pub(super) fn begin_hold(&mut self, reason: HoldReason) {
        self.hold = Some(Hold {
            phase: Phase::Slowing,
            purpose: Purpose::Ask,
            asked: Seconds(f64::NEG_INFINITY),
            reason,
            nozzle: self.nozzle(),
            could_extrude: self.extrusion_permit() == ExtrusionPermit::Allowed,
            targets: self.thermal.wanted(),
            is_told: false,
            rest: None,
            turned: None,
        });
    }

    /// Motion goes at its rate.
    fn hold_is_over(&mut self, now: Seconds) {
        let is_over = |hold: &mut Hold| {
            hold.rest.is_none() && !hold.is_wanted() && !matches!(hold.phase, Phase::Dropping { .. })
        };
        let Some(hold) = self.hold.take_if(is_over) else {
            return;
        };
        if hold.is_told && !matches!(hold.phase, Phase::Leaving { .. }) {
            self.events.push(Event::Resumed);
        }
        match hold.purpose {
            Purpose::Pause => self.park(now),
            Purpose::Back | Purpose::Parked => self.is_parked(now),
            Purpose::Ask | Purpose::GoOn | Purpose::End => {}
        }
    }

    fn nozzle(&self) -> Option<Celsius> {
        self.thermal.heater(gcode::Heater::Tool(0)).and_then(crate::heater::Heater::temperature)
    }

    /// Whether it is known how warm the nozzle is, where there is one: a host that has just come has to wait for that.
    pub(super) fn is_nozzle_read(&self) -> bool {
        self.config.extruder.is_none() || self.nozzle().is_some()
    }

    /// What is held is not heated any longer before it goes on: the user is asked again, and the nozzle, which may stick to
    /// the part, stays where it is. `false` where it was not.
    pub(super) fn stop_heating_held(&mut self) -> bool {
        let Some(hold) = self.hold.as_mut().filter(|hold| matches!(hold.phase, Phase::Heating)) else {
            return false;
        };
        hold.phase = Phase::AtRest;
        let error = match hold.rest {
            Some(_) => ErrorCode::HeldForHost.into(),
            None => hold_error(hold.reason, None),
        };
        self.events.push(Event::Held(error));
        true
    }

    /// Goes on with what is held, with the very next step, once it is as warm as it was; `false` where nothing is held.
    pub(super) fn resume_held(&mut self, now: Seconds) -> Result<bool, PrinterError> {
        let Some(hold) = self.hold.take_if(|hold| matches!(hold.phase, Phase::AtRest)) else {
            return Ok(false);
        };
        let nozzle = self.nozzle();
        let has_cooled = hold.nozzle.zip(nozzle).is_some_and(|(then, now)| (then - now).0 > COOLED_MAX_C);
        let heats = self.heat_again(&hold.targets, hold.could_extrude, has_cooled, now);
        let phase = match heats {
            Ok(true) => Phase::Heating,
            Ok(false) => hold.warm(now),
            Err(_) => Phase::AtRest,
        };
        self.hold = Some(Hold { phase, ..hold });
        heats.map(|_| true)
    }

    /// Heats what has been switched off or lowered to stand-by to what it was before; whether that is to be waited for.
    /// Refused where nothing would make a nozzle warm enough that has to be.
    pub(super) fn heat_again(
        &mut self,
        before: &[(gcode::Heater, Celsius)],
        could_extrude: bool,
        has_cooled: bool,
        now: Seconds,
    ) -> Result<bool, PrinterError> {
        let is_cold = could_extrude && (has_cooled || self.extrusion_permit() != ExtrusionPermit::Allowed);
        let min = self.config.extruder.as_ref().map_or(Celsius::ZERO, |it| it.heater.min_extrude_temp);
        let goal = self.thermal.goal(gcode::Heater::Tool(0), before);
        // A host that has just come waits for the first reading.
        if let Some(nozzle) = self.nozzle().filter(|_| is_cold && (goal <= Celsius::ZERO || goal < min)) {
            let detail = format!("the nozzle has cooled to {:.0} °C meanwhile", nozzle.0);
            return Err(PrinterError::new(ErrorCode::ColdExtrusion, detail));
        }
        let heats = self.thermal.reheat(before, &mut self.board, now)?;
        if heats {
            self.events.push(Event::Message("heating again before it goes on".into()));
        }
        Ok(heats || is_cold)
    }

    /// The board has lowered its heaters because this host was held up. What is held waits for the user anyway; all else
    /// must not go on with them as if nothing had been.
    pub(super) fn heaters_fell(&mut self, now: Seconds) {
        let text =
            "the computer did not reach the printer in time: its board lowered the heaters to stand-by";
        self.events.push(Event::Message(text.into()));
        match &mut self.hold {
            Some(hold)
                if matches!(hold.phase, Phase::Heating | Phase::Rejoining { .. } | Phase::Resuming(None)) =>
            {
                hold.phase = Phase::AtRest;
                self.events.push(Event::Held(hold_error(hold.reason, self.calls.gap.take())));
            }
            Some(_) => {}
            None if matches!(self.wait, Wait::Free | Wait::Heat) => {
                self.wait = Wait::Nothing;
                if let Some(job) = &mut self.job {
                    job.state = JobState::Paused;
                }
                self.events.push(Event::Paused);
            }
            None if self.job.is_some() => drop(self.pause(now)),
            None => self.stop_typed(),
        }
    }

    /// Goes on with a hold.
    pub(super) fn advance_hold(&mut self, now: Seconds) -> Result<(), Failure> {
        let Some(mut hold) = self.hold.take() else { return Ok(()) };
        match &mut hold.phase {
            Phase::Slowing => {
                if let Some(rest) = &mut hold.rest {
                    rest.stop(self.lease.ramp(), &mut self.board, now);
                } else if hold.purpose != Purpose::Ask {
                    let all_sent = self.board.link.waiting(Lane::Control) == 0;
                    if let Some(turned) = hold.turned.as_mut().filter(|it| all_sent && it.sent.is_none()) {
                        turned.sent = Some(now);
                    }
                    if now - hold.asked >= ASK_AGAIN {
                        hold.asked = now;
                        self.tell_hold(hold.purpose, now);
                    }
                }
            }
            Phase::Resuming(Some(_)) => {}
            Phase::Rejoining { since, asked, answered } => {
                let all = self
                    .board
                    .layout
                    .steppers
                    .iter()
                    .zip(answered.iter())
                    .all(|(oids, is)| oids.is_none() || *is);
                if all {
                    hold.phase = Phase::Resuming(None);
                    if let Some(rest) = hold.rest.take() {
                        self.rejoin(&rest, now);
                    }
                    if hold.purpose != Purpose::Ask {
                        hold.phase = Phase::Slowing;
                    }
                } else if now - *since > ANSWER_MAX {
                    let detail = "it does not say where its motors stand";
                    return Err(Failure::Stop(PrinterError::new(ErrorCode::LinkTimeout, detail)));
                } else if now - *asked >= ASK_AGAIN {
                    *asked = now;
                    self.board.control(&Command::MotionDrop {});
                    self.board.ask_queues(|motor| !answered[motor]);
                }
            }
            Phase::AtRest => self.cool_down(now),
            Phase::Heating => {
                self.last_active = now;
                let is_heated = self.thermal.is_heated() && self.is_nozzle_read();
                let is_cold = self.extrusion_permit() != ExtrusionPermit::Allowed;
                if is_heated && hold.could_extrude && is_cold {
                    // It was switched off meanwhile: that is no way to go on.
                    hold.phase = Phase::AtRest;
                    let detail = "the nozzle was switched off while it was heated again";
                    self.events.push(Event::Held(PrinterError::new(ErrorCode::ColdExtrusion, detail)));
                } else if is_heated {
                    hold.phase = hold.warm(now);
                }
            }
            Phase::Resuming(told @ None) => {
                if let Some(cover) = self.cover_to_resume(now) {
                    self.lease.tell(cover, &mut self.board, now);
                    self.keep_rate(now);
                    let ramp = self.board.ticks(self.lease.ramp());
                    self.board.resume_motion(ramp, now);
                    *told = Some(self.board.clock_at(now));
                }
            }
            Phase::Dropping { since, asked, queues } => {
                let of = |motor: usize| match self.board.layout.steppers[motor] {
                    Some(_) => queues[motor],
                    None => Some(MotorQueue::default()),
                };
                if let [Some(x), Some(y), Some(z), Some(e)] = core::array::from_fn(of) {
                    let queues = [x, y, z, e];
                    hold.phase = Phase::Leaving { asked: Seconds(f64::NEG_INFINITY) };
                    if hold.purpose == Purpose::Pause {
                        self.put_aside(&queues, hold.targets.clone(), hold.could_extrude, now)?;
                    } else if hold.purpose == Purpose::Parked {
                        self.stand_parked(&queues.map(|queue| queue.position), now);
                    } else if hold.purpose == Purpose::Back {
                        self.stand_on_the_way_back(&queues.map(|queue| queue.position), now);
                    } else {
                        self.stand_at(&queues.map(|queue| queue.position), now);
                    }
                } else if now - *since > ANSWER_MAX {
                    let detail = "it does not say where its motors stand";
                    return Err(Failure::Stop(PrinterError::new(ErrorCode::LinkTimeout, detail)));
                } else if now - *asked >= ASK_AGAIN {
                    *asked = now;
                    // Only those who have not answered: a small board has no room for all answers at once.
                    self.board.ask_queues(|motor| queues[motor].is_none());
                }
            }
            Phase::Leaving { asked } => {
                if now - *asked >= ASK_AGAIN {
                    *asked = now;
                    self.keep_rate(now);
                    self.board.resume_motion(Ticks(0), now);
                }
            }
        }
        self.hold = Some(hold);
        Ok(())
    }

    /// Whether the board is in a run that another host began, and has not been given its steps again: until the user
    /// says so, nothing of the plan may take effect.
    pub(super) fn waits_to_rejoin(&self) -> bool {
        self.hold.as_ref().is_some_and(|hold| hold.rest.is_some())
    }

    /// Nobody decides for too long.
    fn cool_down(&mut self, now: Seconds) {
        if now - self.last_active >= self.config.idle_timeout.timeout && self.thermal.any_target() {
            self.thermal.all_off(&mut self.board, now);
            self.events.push(Event::Message("held for too long: heaters are off".into()));
        }
    }

    /// What the board has, once it is enough to speed up on and come to rest again.
    fn cover_to_resume(&self, now: Seconds) -> Option<Cover> {
        if self.board.clock_at(now) <= self.stream.switched() {
            // A driver that was off comes on first.
            return None;
        }
        let motion_now = self.board.motion_at(now);
        let Some(run) = self.stream.run() else {
            // It was held on the last steps of a run that was taken for done.
            return Some(Cover { until: motion_now, is_end: true });
        };
        let cover = self.cover(run.end, now)?;
        let enough = motion_now + self.board.ticks(self.lease.ramp() + COVER_SPARE);
        (cover.is_end || cover.until >= enough).then_some(cover)
    }

    fn cover(&self, end: Option<Ticks>, now: Seconds) -> Option<Cover> {
        let covered = self.stream.covered(self.planner.generated_until(), &self.board)?;
        // A single row may last for minutes, which the board's clock cannot compare.
        let until = covered.min(self.board.motion_at(now) + SCHEDULE_AHEAD_TICKS_MAX);
        Some(Cover { until, is_end: end.is_some_and(|end| until >= end) })
    }

    /// Keeps the lease on the run that is being made.
    pub(super) fn renew_lease(&mut self, now: Seconds) {
        let may = matches!(self.hold, None | Some(Hold { phase: Phase::Resuming(Some(_)), .. }));
        if let Some(run) = self.stream.run().filter(|_| may && self.board.layout.has_motion_clock)
            && let Some(cover) = self.cover(run.end, now)
        {
            self.lease.renew(run, cover, &mut self.board, now);
        }
    }
}

/// What the user is told of a hold.
pub(super) fn hold_error(reason: HoldReason, gap: Option<Seconds>) -> PrinterError {
    match (reason, gap) {
        (HoldReason::HostAway, Some(gap)) => {
            PrinterError::new(ErrorCode::HeldHostAway, format!("it was away for {:.1} s", gap.0))
        }
        (HoldReason::HostAway, None) => ErrorCode::HeldHostAway.into(),
        (_, Some(gap)) => {
            PrinterError::new(ErrorCode::HeldQueueDry, format!("the computer was away for {:.1} s", gap.0))
        }
        (_, None) => ErrorCode::HeldQueueDry.into(),
    }
}
