//! Inputs over time as FMPy 0.3.32 applies them, to the last bit: `fmpy.simulation.Input`.
//!
//! Continuous variables are interpolated as `w0 v0 + (1 - w0) v1`, `w0 = (t1 - t) / (t1 - t0)`; discrete ones hold. Two samples
//! at the same time are an event: its right-hand values act from the step that begins there.

use fmu_import::{Error, Instance, Values};
use model_description::BaseType;

/// Variables of one type, set together.
pub(crate) struct Group {
    pub(crate) base: BaseType,
    pub(crate) continuous: bool,
    pub(crate) references: Vec<u32>,
    /// The samples of each variable, or of each element of an array, which has a separate group.
    pub(crate) tables: Vec<Vec<f64>>,
}

/// Inputs of a simulation; empty without samples.
#[derive(Default)]
pub(crate) struct Input {
    pub(crate) times: Vec<f64>,
    /// Instants at which a step ends, ascending.
    pub(crate) events: Vec<f64>,
    pub(crate) groups: Vec<Group>,
    /// Their derivatives are also set (Co-Simulation of FMI 2.0).
    pub(crate) derivatives: bool,
}

/// Python's `math.isclose` with its default tolerances.
pub(crate) fn is_close(a: f64, b: f64) -> bool {
    #[expect(clippy::float_cmp, reason = "as Python's, which infinities need")]
    let same = a == b;
    same || (a.is_finite() && b.is_finite() && (a - b).abs() <= 1e-9 * a.abs().max(b.abs()))
}

/// The samples that determine the value at a time.
enum At {
    Sample(usize),
    /// Between a sample and the next, with the weight of the first.
    Between(usize, f64),
}

impl Input {
    /// The first event after `time`, or infinity.
    pub(crate) fn next_event(&self, time: f64) -> f64 {
        self.events.iter().copied().find(|&t| t > time && !is_close(t, time)).unwrap_or(f64::INFINITY)
    }

    /// Sets the inputs at `time`; `after_event` selects the right-hand values of an event.
    pub(crate) fn apply(&self, instance: &mut Instance, time: f64, after_event: bool) -> Result<(), Error> {
        self.apply_to(instance, time, after_event, |_| true)
    }

    /// Sets the inputs of some groups.
    pub(crate) fn apply_to(
        &self,
        instance: &mut Instance,
        time: f64,
        after_event: bool,
        which: impl Fn(&Group) -> bool,
    ) -> Result<(), Error> {
        for group in self.groups.iter().filter(|group| which(group)) {
            let at = self.at(time, group.continuous, after_event);
            let value = |table: &Vec<f64>| match at {
                At::Sample(i) => table[i],
                At::Between(i, w0) => w0 * table[i] + (1.0 - w0) * table[i + 1],
            };
            if group.tables.len() != group.references.len() {
                let numbers: Vec<f64> = group.tables.iter().map(value).collect();
                let wrong = |cause| Error::Usage { instance: instance.name().into(), cause };
                let values = Values::from_numbers(&numbers, group.base).map_err(wrong)?;
                instance.set_at(group.base, group.references[0], &values)?;
                continue;
            }
            if group.base == BaseType::Float64 {
                let values: Vec<f64> = group.tables.iter().map(value).collect();
                instance.set_reals(&group.references, &values)?;
                if self.derivatives && group.continuous {
                    let slopes: Vec<f64> =
                        group.tables.iter().map(|table| self.slope(table, time, after_event)).collect();
                    instance.set_input_derivatives(&group.references, &vec![1; slopes.len()], &slopes)?;
                }
                continue;
            }
            for (reference, table) in group.references.iter().zip(&group.tables) {
                let value = Values::from_number(value(table), group.base);
                let value = value.map_err(|cause| Error::Usage { instance: instance.name().into(), cause })?;
                instance.set_at(group.base, *reference, &value)?;
            }
        }
        Ok(())
    }

    /// The derivative of a continuous input: 0 before the first and after the last sample.
    fn slope(&self, table: &[f64], time: f64, after_event: bool) -> f64 {
        let (t, i) = (&self.times, self.times.partition_point(|&x| x < time));
        if i == 0 || i == t.len() {
            return 0.0;
        }
        let left = match self.at(time, true, after_event) {
            At::Between(left, _) => left,
            At::Sample(at) if !after_event => at - 1,
            At::Sample(at) if at + 1 < t.len() => at,
            At::Sample(_) => return 0.0,
        };
        (table[left + 1] - table[left]) / (t[left + 1] - t[left])
    }

    fn at(&self, time: f64, continuous: bool, after_event: bool) -> At {
        let (t, last) = (&self.times, self.times.len() - 1);
        let mut i = t.partition_point(|&x| x < time);
        if i == 0 || t.len() < 2 {
            return At::Sample(0);
        }
        if i > last {
            return At::Sample(last);
        }
        if !continuous {
            i -= 1;
            while after_event && i < last && (t[i + 1] < time || is_close(time, t[i + 1])) {
                i += 1;
            }
            return At::Sample(i);
        }
        if is_close(time, t[i]) && i < last && is_close(t[i], t[i + 1]) {
            while after_event && i < last && is_close(t[i], t[i + 1]) {
                i += 1;
            }
            return At::Sample(i);
        }
        At::Between(i - 1, (t[i] - time) / (t[i] - t[i - 1]))
    }
}
