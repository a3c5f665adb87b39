//! Triggers: an endstop, the host or a time-out fires one, and the steppers that obey it stop.
//!
//! Its state is reported again and again, because reports may be lost: until the host fires or arms it itself.

use units::Clock32;
use wire::Response;

pub(crate) struct Trsync {
    can_trigger: bool,
    reason: u8,
    expire_reason: u8,
    expire_at: Option<Clock32>,
    report_at: Option<Clock32>,
    report_ticks: u32,
    /// The clock that the next report names: when it was due, or when the trigger fired.
    state_clock: Clock32,
    pub(crate) report_pending: bool,
}

/// What a trigger's timer found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Due {
    /// The state is to be reported.
    Report,
    /// The time-out has passed: the trigger is to be fired for this reason.
    Expired(u8),
}

impl Trsync {
    pub(crate) const fn new() -> Self {
        Self {
            can_trigger: false,
            reason: 0,
            expire_reason: 0,
            expire_at: None,
            report_at: None,
            report_ticks: 0,
            state_clock: Clock32(0),
            report_pending: false,
        }
    }

    /// Arms it; `report_ticks` of 0 asks for no reports.
    pub(crate) fn start(&mut self, report_clock: Clock32, report_ticks: u32, expire_reason: u8) {
        *self = Self {
            can_trigger: true,
            expire_reason,
            report_at: (report_ticks != 0).then_some(report_clock),
            report_ticks,
            ..Self::new()
        };
    }

    /// When the timer is to wake.
    pub(crate) fn wake(&self) -> Option<Clock32> {
        match (self.expire_at, self.report_at) {
            (Some(expire), Some(report)) => Some(if report.is_before(expire) { report } else { expire }),
            (expire, report) => expire.or(report),
        }
    }

    pub(crate) const fn is_armed(&self) -> bool {
        self.can_trigger
    }

    /// Sets the time-out; one that has fired stays as it is.
    pub(crate) fn set_timeout(&mut self, clock: Clock32) {
        if self.can_trigger {
            self.expire_at = Some(clock);
        }
    }

    /// The host has ended the search that the time-out guards: it no longer expires.
    ///
    /// Klipper leaves the time-out running there, and its host then fires the trigger itself; both orders end the same.
    pub(crate) fn cancel_timeout(&mut self) {
        self.expire_at = None;
    }

    pub(crate) fn event(&mut self, wake: Clock32) -> Due {
        if self.expire_at == Some(wake) {
            self.expire_at = None;
            return Due::Expired(self.expire_reason);
        }
        self.state_clock = wake;
        self.report_pending = true;
        self.report_at = Some(wake.wrapping_add(self.report_ticks));
        Due::Report
    }

    /// Fires it; `false` when it was not armed.
    pub(crate) fn fire(&mut self, reason: u8, now: Clock32) -> bool {
        if !self.can_trigger {
            return false;
        }
        self.can_trigger = false;
        self.reason = reason;
        self.expire_at = None;
        self.state_clock = now;
        self.report_pending = true;
        true
    }

    /// The host knows: no more reports but the answer that it gets now.
    pub(crate) const fn end_reports(&mut self) {
        self.expire_at = None;
        self.report_at = None;
        self.report_pending = false;
    }

    pub(crate) const fn state(&self, oid: u8) -> Response<'static> {
        Response::TrsyncState {
            oid,
            can_trigger: self.can_trigger as u8,
            trigger_reason: self.reason,
            clock: self.state_clock.0,
        }
    }

    pub(crate) const fn shut_down(&mut self) {
        *self = Self::new();
    }
}
