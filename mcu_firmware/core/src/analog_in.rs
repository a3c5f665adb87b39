//! Analog inputs: sums of readings, reported in groups, and the range that the board itself guards.

use units::Clock32;
use wire::{Response, ShutdownReason};

use crate::{
    board::{AnalogSample, Board, Pin},
    heater::Sum,
    objects::After,
};

/// The most bytes of sums in one report.
pub(crate) const REPORT_BYTES_MAX: usize = 32;

/// What `query_analog_in` asks for.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sampling {
    pub(crate) sample_ticks: u32,
    pub(crate) sample_count: u8,
    pub(crate) rest_ticks: u32,
    pub(crate) bytes_per_report: u8,
    pub(crate) min_value: u16,
    pub(crate) max_value: u16,
    pub(crate) range_check_count: u8,
}

pub(crate) struct AnalogIn {
    pin: Pin,
    sampling: Sampling,
    /// When the current group of readings began.
    group_clock: Clock32,
    sum: u16,
    readings: u8,
    /// Sums out of range in a row.
    out_of_range: u8,
    report: [u8; REPORT_BYTES_MAX],
    report_len: u8,
    pub(crate) report_pending: bool,
    /// A heater wants every sum …
    pub(crate) feeds_heater: bool,
    /// … and has not taken this one.
    fresh: Option<Sum>,
}

impl AnalogIn {
    pub(crate) fn new(board: &mut impl Board, pin: Pin) -> Result<Self, ShutdownReason> {
        board.configure_analog(pin).map_err(|_| ShutdownReason::InvalidAdcPin)?;
        Ok(Self::idle(pin))
    }

    const fn idle(pin: Pin) -> Self {
        const NOTHING: Sampling = Sampling {
            sample_ticks: 0,
            sample_count: 0,
            rest_ticks: 0,
            bytes_per_report: 0,
            min_value: 0,
            max_value: 0,
            range_check_count: 0,
        };
        Self {
            pin,
            sampling: NOTHING,
            group_clock: Clock32(0),
            sum: 0,
            readings: 0,
            out_of_range: 0,
            report: [0; REPORT_BYTES_MAX],
            report_len: 0,
            report_pending: false,
            feeds_heater: false,
            fresh: None,
        }
    }

    /// Forgets all that was asked.
    fn rest(&mut self) {
        *self = Self { feeds_heater: self.feeds_heater, ..Self::idle(self.pin) };
    }

    /// Begins to sample; `false` when it was asked to stop.
    pub(crate) fn query(
        &mut self,
        board: &mut impl Board,
        clock: Clock32,
        sampling: Sampling,
    ) -> Result<bool, ShutdownReason> {
        board.cancel_analog(self.pin);
        self.rest();
        if sampling.sample_count == 0 {
            return Ok(false);
        }
        let group = u64::from(sampling.sample_ticks) * u64::from(sampling.sample_count - 1);
        let bytes = usize::from(sampling.bytes_per_report);
        let report_fits = bytes > 0 && bytes <= REPORT_BYTES_MAX && bytes.is_multiple_of(size_of::<u16>());
        if !report_fits || group >= u64::from(sampling.rest_ticks) {
            return Err(ShutdownReason::InvalidAdcTiming);
        }
        self.sampling = sampling;
        self.group_clock = clock;
        Ok(true)
    }

    /// Takes a reading; at the end of a group judges and stores its sum.
    pub(crate) fn event(&mut self, board: &mut impl Board, wake: Clock32) -> Result<After, ShutdownReason> {
        let value = match board.sample_analog(self.pin) {
            AnalogSample::Ready(value) => value,
            // A board that says "now" would otherwise be asked for ever.
            AnalogSample::Pending(ticks) => return Ok(After::Again(wake.wrapping_add(ticks.max(1)))),
        };
        // A sum that does not fit is out of range anyway, unless the host allows the largest one there is.
        self.sum = self.sum.saturating_add(value);
        self.readings += 1;
        if self.readings < self.sampling.sample_count {
            return Ok(After::Again(wake.wrapping_add(self.sampling.sample_ticks)));
        }
        let sum = core::mem::take(&mut self.sum);
        self.readings = 0;
        self.check_range(sum)?;
        if self.feeds_heater {
            self.fresh = Some(Sum { clock: self.group_clock, value: sum });
        }
        self.group_clock = self.group_clock.wrapping_add(self.sampling.rest_ticks);
        self.store(sum);
        Ok(After::Again(self.group_clock))
    }

    /// The sum that a heater wants.
    pub(crate) const fn take_sum(&mut self) -> Option<Sum> {
        self.fresh.take()
    }

    fn check_range(&mut self, sum: u16) -> Result<(), ShutdownReason> {
        if (self.sampling.min_value..=self.sampling.max_value).contains(&sum) {
            self.out_of_range = 0;
            return Ok(());
        }
        self.out_of_range = self.out_of_range.saturating_add(1);
        if self.out_of_range >= self.sampling.range_check_count {
            return Err(ShutdownReason::AdcOutOfRange);
        }
        Ok(())
    }

    fn store(&mut self, sum: u16) {
        if self.report_pending {
            // The last report found no time to be sent: it is too old now.
            self.report_pending = false;
            self.report_len = 0;
        }
        let at = usize::from(self.report_len);
        if let Some(place) = self.report.get_mut(at..at + size_of::<u16>()) {
            place.copy_from_slice(&sum.to_le_bytes());
            self.report_len += size_of::<u16>() as u8;
        }
        self.report_pending = self.report_len >= self.sampling.bytes_per_report;
    }

    pub(crate) fn report(&self, oid: u8) -> Response<'_> {
        let values = &self.report[..usize::from(self.report_len)];
        Response::AnalogInState { oid, next_clock: self.group_clock.0, values }
    }

    /// The report was sent, or dropped because there was no room for it.
    pub(crate) const fn report_done(&mut self) {
        self.report_pending = false;
        self.report_len = 0;
    }

    pub(crate) fn shut_down(&mut self, board: &mut impl Board) {
        board.cancel_analog(self.pin);
        self.rest();
    }
}
