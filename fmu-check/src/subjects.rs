//! The variables of an FMU that a probe examines, and values for setting them.

use crate::encoding::bits;
use crate::session::Session;
use model_description::{BaseType, Causality, ModelVariable};

impl Session {
    /// Variables whose values are numbers, which all probes can compare; of several names of one value, the first.
    pub(super) fn numeric(&self) -> impl Iterator<Item = &ModelVariable> {
        let all = self.description.variables.iter().zip(&self.aliases).filter(|(_, alias)| !**alias).map(|(v, _)| v);
        all.filter(|v| !matches!(v.base, BaseType::String | BaseType::Binary | BaseType::Clock))
    }

    /// Whether two plain runs agree in this variable, so that it can be compared.
    pub(super) fn is_steady(&self, v: &ModelVariable) -> bool {
        !self.varying.contains(&v.name)
    }

    /// The numeric outputs that can be compared, or all such variables if there are no outputs.
    pub(super) fn watched(&self) -> Vec<&ModelVariable> {
        let all: Vec<_> = self.numeric().filter(|v| v.clocks.is_empty() && self.is_steady(v)).collect();
        let outputs: Vec<_> = all.iter().filter(|v| v.causality == Causality::Output).copied().collect();
        if outputs.is_empty() { all } else { outputs }
    }

    /// Inputs that are floating-point numbers.
    pub(super) fn float_inputs(&self) -> Vec<&ModelVariable> {
        let fits = |v: &&ModelVariable| v.causality == Causality::Input && v.base.is_float() && v.clocks.is_empty();
        self.description.variables.iter().filter(fits).collect()
    }

    /// Number of elements of a variable.
    pub(super) fn elements(&self, v: &ModelVariable) -> usize {
        if v.is_array() { self.description.shape(v).unwrap_or_default().iter().product() } else { 1 }
    }

    /// Number of values that references stand for; one that does not exist counts as one value.
    pub(super) fn values_of(&self, references: &[u32]) -> usize {
        let of = |r: &u32| self.description.variables.iter().find(|v| v.value_reference == *r);
        references.iter().map(|r| of(r).map_or(1, |v| self.elements(v))).sum()
    }

    /// A value near the start value, within the range, that differs from it.
    pub(super) fn different_value(&self, v: &ModelVariable, scale: f64) -> Option<Vec<u64>> {
        let n = self.elements(v);
        if v.base == BaseType::Boolean {
            let on = v.start.as_deref().is_some_and(|s| matches!(s.trim(), "true" | "1"));
            return Some(vec![u64::from(!on); n]);
        }
        let first = v.start.as_deref().and_then(|s| s.split_whitespace().next());
        let start: f64 = first.and_then(model_description::parse_number).unwrap_or(0.0);
        let (min, max) = (v.min.unwrap_or(f64::NEG_INFINITY), v.max.unwrap_or(f64::INFINITY));
        let nominal = v.nominal.unwrap_or(1.0).abs();
        if v.base.is_float() {
            let step = if start == 0.0 { 0.01 * nominal } else { 0.01 * start.abs() } * scale;
            let value =
                [start + step, start - step].into_iter().find(|x| (min..=max).contains(x) && *x > min && *x < max)?;
            return Some(vec![bits(v.base, value); n]);
        }
        if v.base == BaseType::Enumeration {
            let items = &self.description.type_definition(v.declared_type.as_deref()?)?.items;
            let other = items.iter().map(|i| i.value).find(|i| first != Some(i.to_string().as_str()))?;
            return Some(vec![other.cast_unsigned(); n]);
        }
        let value = [start + 1.0, start - 1.0].into_iter().find(|x| (min..=max).contains(x) && *x >= 0.0)?;
        Some(vec![bits(v.base, value); n])
    }
}
