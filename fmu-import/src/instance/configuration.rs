//! Configuration Mode: structural parameters of FMI 3.0, and the sizes of arrays.

use super::Instance;
use crate::abi::journal::Call;
use crate::abi::raw::Simple;
use crate::{Error, Values};
use model_description::Causality;

impl Instance {
    /// Sets structural parameters together, in Configuration Mode: before the initialization, or in Reconfiguration Mode, where
    /// the FMU lets them change. Arrays sized by them lose their values.
    ///
    /// # Errors
    /// A variable does not exist, a value does not fit, or the FMU refuses.
    pub fn configure(&mut self, values: &[(&str, &Values)]) -> Result<(), Error> {
        self.call(Call::Set, |s| s.simple(Simple::EnterConfigurationMode))?;
        for (name, value) in values {
            let (base, reference, count) = self.place(name)?;
            if value.len() != count {
                return Err(Error::usage(&self.name, format!("{name} has {count} elements, not {}", value.len())));
            }
            self.set_at(base, reference, value)?;
        }
        self.call(Call::Set, |s| s.simple(Simple::ExitConfigurationMode))?;
        self.read_sizes()
    }

    /// The value of a structural parameter that was set, by value reference.
    pub(crate) fn size(&self, reference: u32) -> Option<usize> {
        self.sizes.get(&reference).copied()
    }

    /// Reads all structural parameters.
    pub(super) fn read_sizes(&mut self) -> Result<(), Error> {
        let structural = self.description.variables.iter().filter(|v| v.causality == Causality::StructuralParameter);
        let all: Vec<_> = structural.map(|v| (v.base, v.value_reference)).collect();
        for (base, reference) in all {
            let Values::Integers(value) = self.get_at(base, reference, 1)? else { continue };
            let size = value.first().and_then(|size| usize::try_from(*size).ok());
            self.sizes.extend(size.map(|size| (reference, size)));
        }
        Ok(())
    }
}
