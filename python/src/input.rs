//! Inputs over time as FMPy 0.3.32 applies them, to the last bit: `fmpy.simulation.Input`.
//!
//! Continuous variables are interpolated as `w0 v0 + (1 - w0) v1`, `w0 = (t1 - t) / (t1 - t0)`; discrete ones hold. Two samples
//! of one time are an event: its right-hand values act from the step that begins there.

use fmu_import::{Error, Instance, Values};
use model_description::BaseType;

/// Variables of one type, set together.
pub(crate) struct Group {
    pub(crate) base: BaseType,
    pub(crate) continuous: bool,
    pub(crate) references: Vec<u32>,
    /// The samples of each variable.
    pub(crate) tables: Vec<Vec<f64>>,
}

/// Inputs of a simulation; empty without samples.
#[derive(Default)]
pub(crate) struct Input {
    pub(crate) times: Vec<f64>,
    /// Instants at which a step ends, ascending.
    pub(crate) events: Vec<f64>,
    pub(crate) groups: Vec<Group>,
}

/// Python's `math.isclose` with its default tolerances.
pub(crate) fn is_close(a: f64, b: f64) -> bool {
    #[expect(clippy::float_cmp, reason = "as Python's, which infinities need")]
    let same = a == b;
    same || (a.is_finite() && b.is_finite() && (a - b).abs() <= 1e-9 * a.abs().max(b.abs()))
}

/// The samples that give the value at a time.
enum At {
    Sample(usize),
    /// Between a sample and the next, with the weight of the first.
    Between(usize, f64),
}

impl Input {
    /// The first event after `time`, infinity if there is none.
    pub(crate) fn next_event(&self, time: f64) -> f64 {
        self.events.iter().copied().find(|&t| t > time && !is_close(t, time)).unwrap_or(f64::INFINITY)
    }

    /// Sets the inputs at `time`; `after_event` takes the right-hand values of an event.
    pub(crate) fn apply(&self, instance: &mut Instance, time: f64, after_event: bool) -> Result<(), Error> {
        if self.groups.is_empty() {
            return Ok(());
        }
        for group in &self.groups {
            let at = self.at(time, group.continuous, after_event);
            let value = |table: &Vec<f64>| match at {
                At::Sample(i) => table[i],
                At::Between(i, w0) => w0 * table[i] + (1.0 - w0) * table[i + 1],
            };
            if group.base == BaseType::Float64 {
                let values: Vec<f64> = group.tables.iter().map(value).collect();
                instance.set_reals(&group.references, &values)?;
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
