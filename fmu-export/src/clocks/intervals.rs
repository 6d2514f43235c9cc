//! Intervals and shifts of clocks (FMI 3.0.2, 2.2.8.4 and 2.3.3): getters and setters of the importer.

use super::{Found, Qualifier};
use crate::instance::Instance;
use crate::lifecycle::State;
use crate::message;
use fmu_core::{Exported, Fault, Model, Slot, Ticks};
use std::ffi::c_int;
use std::mem::MaybeUninit;

impl<E: Exported> Instance<E> {
    /// Intervals of clocks, with their qualifiers.
    ///
    /// # Errors
    /// A clock whose interval is not available in this state.
    pub fn get_intervals(
        &mut self,
        references: &[u32],
        intervals: &mut [MaybeUninit<f64>],
        qualifiers: &mut [MaybeUninit<c_int>],
    ) -> Result<(), Fault> {
        for &reference in references {
            let clock = self.clock(reference)?;
            self.check_interval(clock)?;
        }
        self.refresh_clocks()?;
        for ((&reference, interval), qualifier) in references.iter().zip(intervals).zip(qualifiers) {
            let clock = self.clock(reference)?;
            let (x, qualified) = self.tell_interval(clock);
            interval.write(x);
            qualifier.write(qualified as c_int);
        }
        Ok(())
    }

    /// Intervals as fractions: counters and resolutions.
    ///
    /// # Errors
    /// As [`get_intervals`](Self::get_intervals), or a clock without a fraction.
    pub fn get_fractions(
        &mut self,
        references: &[u32],
        counters: &mut [MaybeUninit<u64>],
        resolutions: &mut [MaybeUninit<u64>],
        qualifiers: &mut [MaybeUninit<c_int>],
    ) -> Result<(), Fault> {
        for &reference in references {
            let clock = self.clock(reference)?;
            Self::fraction(clock)?;
            self.check_interval(clock)?;
        }
        let places = counters.iter_mut().zip(resolutions).zip(qualifiers);
        for (&reference, ((counter, resolution), qualifier)) in references.iter().zip(places) {
            let clock = self.clock(reference)?;
            let fraction = Self::fraction(clock)?;
            counter.write(fraction.0);
            resolution.write(fraction.1);
            qualifier.write(self.tell_interval(clock).1 as c_int);
        }
        Ok(())
    }

    fn fraction(clock: Found) -> Result<(u64, u64), Fault> {
        clock.timing.fraction.ok_or_else(|| Self::no(clock, "has no fraction: supportsFraction = false"))
    }

    /// Before the start, the intervals follow the values set.
    fn refresh_clocks(&mut self) -> Result<(), Fault> {
        if self.current.life.state() == State::Initialization {
            self.refresh();
            self.plan_ticks(true)?;
        }
        Ok(())
    }

    fn check_interval(&mut self, clock: Found) -> Result<(), Fault> {
        let (state, done) = (self.current.life.state(), self.tick_of(clock.number).is_some_and(|tick| tick.done));
        let start = state == State::Initialization;
        let known = match clock.timing.ticks {
            Ticks::Constant | Ticks::Fixed => start,
            Ticks::Tunable => start || matches!(state, State::Event | State::Activation),
            Ticks::Changing => start || done && matches!(state, State::Event | State::Activation),
            Ticks::Countdown => start || matches!(state, State::Event | State::ClockUpdate),
            Ticks::Triggered => false,
        };
        if known { Ok(()) } else { Err(Self::no(clock, &format!("has no interval to read in {state}"))) }
    }

    fn tell_interval(&mut self, clock: Found) -> (f64, Qualifier) {
        let period = self.period(clock.index, &clock.timing);
        let Some(tick) = self.tick_of(clock.number) else { return (0.0, Qualifier::NotYetKnown) };
        if let Some(period) = period.filter(|period| period.to_bits() != tick.interval.to_bits()) {
            (tick.interval, tick.qualifier) = (period, Qualifier::Changed);
        }
        let answer = (tick.interval, tick.qualifier);
        if tick.qualifier == Qualifier::Changed {
            tick.qualifier = Qualifier::Unchanged;
        }
        answer
    }

    /// Sets the intervals (s) of clocks: all of them or, on an error, none.
    ///
    /// # Errors
    /// A clock whose interval the importer does not set in this state, or an interval that is not greater than 0.
    pub fn set_intervals(&mut self, references: &[u32], intervals: &[f64]) -> Result<(), Fault> {
        let start = self.current.life.state() == State::Initialization;
        for (&reference, interval) in references.iter().zip(intervals) {
            let clock = self.clock(reference)?;
            let open = clock.timing.ticks == Ticks::Tunable || start && clock.timing.ticks == Ticks::Fixed;
            if !open {
                return Err(Self::no(clock, &format!("does not take an interval in {}", self.current.life.state())));
            }
            if !(interval.is_finite() && *interval > 0.0) {
                let name = message::name::<E::Model>(clock.index);
                return Err(Fault::value(&format!("the interval of {name}"), interval, "finite and greater than 0"));
            }
        }
        for (&reference, &interval) in references.iter().zip(intervals) {
            let clock = self.clock(reference)?;
            if let Some((_, Slot::Clock(Some(place)))) = E::Model::TABLE.entry(&mut self.current.block, clock.index) {
                *place = interval;
                self.current.dirty = true;
            }
        }
        Ok(())
    }

    /// Times (s) from the start to the first ticks.
    ///
    /// # Errors
    /// A clock without a period.
    pub fn get_shifts(&mut self, references: &[u32], shifts: &mut [MaybeUninit<f64>]) -> Result<(), Fault> {
        for &reference in references {
            self.periodic(reference)?;
        }
        for (&reference, shift) in references.iter().zip(shifts) {
            let clock = self.clock(reference)?;
            shift.write(self.tick_of(clock.number).map_or(0.0, |tick| tick.shift));
        }
        Ok(())
    }

    /// Shifts as fractions.
    ///
    /// # Errors
    /// A clock without a period or without a fraction.
    pub fn get_shift_fractions(
        &mut self,
        references: &[u32],
        counters: &mut [MaybeUninit<u64>],
        resolutions: &mut [MaybeUninit<u64>],
    ) -> Result<(), Fault> {
        for &reference in references {
            let clock = self.periodic(reference)?;
            Self::fraction(clock)?;
        }
        for (&reference, (counter, resolution)) in references.iter().zip(counters.iter_mut().zip(resolutions)) {
            let clock = self.clock(reference)?;
            counter.write(clock.timing.shift_counter().unwrap_or(0));
            resolution.write(Self::fraction(clock)?.1);
        }
        Ok(())
    }

    /// Sets the times (s) from the start to the first ticks.
    ///
    /// # Errors
    /// A clock whose importer does not choose them, or a time that is negative.
    pub fn set_shifts(&mut self, references: &[u32], shifts: &[f64]) -> Result<(), Fault> {
        for (&reference, shift) in references.iter().zip(shifts) {
            let clock = self.periodic(reference)?;
            if clock.timing.ticks == Ticks::Constant {
                return Err(Self::no(clock, "has a constant shift"));
            }
            if !(shift.is_finite() && *shift >= 0.0) {
                let name = message::name::<E::Model>(clock.index);
                return Err(Fault::value(&format!("the shift of {name}"), shift, "finite and not negative"));
            }
        }
        for (&reference, &shift) in references.iter().zip(shifts) {
            let clock = self.clock(reference)?;
            if let Some(tick) = self.tick_of(clock.number) {
                tick.shift = shift;
            }
        }
        Ok(())
    }

    fn periodic(&self, reference: u32) -> Result<Found, Fault> {
        let clock = self.clock(reference)?;
        if clock.timing.ticks.is_periodic() { Ok(clock) } else { Err(Self::no(clock, "has no period, so no shift")) }
    }

    /// No clock takes a fraction.
    ///
    /// # Errors
    /// The list is not empty.
    pub fn refuse_fractions(&mut self, references: &[u32]) -> Result<(), Fault> {
        let Some(&reference) = references.first() else { return Ok(()) };
        let clock = self.clock(reference)?;
        Err(Self::no(clock, "does not take a fraction"))
    }
}
