//! The content of modelDescription.xml that importers need.

use crate::conversion::Measured;
use crate::units::{DisplayUnit, TypeDefinition, Unit};
use crate::variable::{Dimension, ModelVariable};
use crate::version::FmiVersion;
use fmu_core::variable::element;
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;

/// A modelDescription.xml.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelDescription {
    /// The standard.
    pub version: FmiVersion,
    /// `fmiVersion` as in the file.
    pub fmi_version: String,
    /// Name of the model.
    pub model_name: String,
    /// Instantiation token (GUID in FMI 2.0).
    pub token: String,
    /// One sentence.
    pub description: Option<String>,
    /// Who wrote it.
    pub author: Option<String>,
    /// Version of the model.
    pub model_version: Option<String>,
    /// Copyright line.
    pub copyright: Option<String>,
    /// License.
    pub license: Option<String>,
    /// The tool that wrote the file.
    pub generation_tool: Option<String>,
    /// Time of generation, as written in the file.
    pub generation_date_and_time: Option<String>,
    /// Names are structured (`part.name[1]`), not flat.
    pub structured_names: bool,
    /// The co-simulation interface, if any.
    pub co_simulation: Option<Interface>,
    /// The model exchange interface, if any.
    pub model_exchange: Option<Interface>,
    /// The scheduled execution interface, if there is one (FMI 3.0 only).
    pub scheduled_execution: Option<Interface>,
    /// `numberOfEventIndicators` as in the file (FMI 2.0 only).
    pub number_of_event_indicators: Option<u32>,
    /// Recommended times, step size and tolerance.
    pub default_experiment: Experiment,
    /// Units with their display units.
    pub units: Vec<Unit>,
    /// Types that variables refer to with `declaredType`.
    pub types: Vec<TypeDefinition>,
    /// Categories of log messages, which an importer can switch on and off.
    pub log_categories: Vec<LogCategory>,
    /// Variables, in the order of the file.
    pub variables: Vec<ModelVariable>,
    /// Outputs of the model structure.
    pub outputs: Vec<Unknown>,
    /// Continuous state derivatives of the model structure.
    pub derivatives: Vec<Unknown>,
    /// Initial unknowns of the model structure.
    pub initial_unknowns: Vec<Unknown>,
    /// Event indicators of the model structure (FMI 3.0 only).
    pub event_indicators: Vec<Unknown>,
    /// Clocked states of the model structure (FMI 3.0 only).
    pub clocked_states: Vec<Unknown>,
    #[serde(skip)]
    pub(crate) names: Names,
}

/// Indices of the variables, sorted by name; the first search for a name builds it. A linear search for each of 100,000 names among
/// as many variables takes a minute.
#[derive(Clone, Debug, Default)]
pub(crate) struct Names(OnceLock<Vec<usize>>);

impl PartialEq for Names {
    /// The index follows from the variables: it never makes two descriptions differ.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl ModelDescription {
    /// The variable with this name or alias.
    pub fn variable(&self, name: &str) -> Option<&ModelVariable> {
        let by_name = self.names.0.get_or_init(|| {
            let mut places: Vec<usize> = (0..self.variables.len()).collect();
            places.sort_by_key(|place| &self.variables[*place].name);
            places
        });
        let at = |place: &usize| self.variables.get(*place);
        let place = by_name.partition_point(|place| at(place).is_some_and(|v| *v.name < *name));
        let found = by_name.get(place).and_then(at).filter(|v| v.name == name);
        // The variables may have changed since the first search.
        let named = found.or_else(|| self.variables.iter().find(|v| v.name == name));
        named.or_else(|| self.variables.iter().find(|v| v.aliases.iter().any(|a| a.name == name)))
    }

    /// Extents of a variable, empty for a scalar; a structural parameter counts with its start value. `None` if a size is not
    /// known.
    pub fn shape(&self, variable: &ModelVariable) -> Option<Vec<usize>> {
        self.shape_with(variable, |_| None)
    }

    /// [`shape`](Self::shape), where `size` gives the structural parameters that differ from their start values, by value
    /// reference.
    pub fn shape_with(&self, variable: &ModelVariable, size: impl Fn(u32) -> Option<usize>) -> Option<Vec<usize>> {
        let extent = |dimension: &Dimension| match dimension {
            Dimension::Fixed(n) => usize::try_from(*n).ok(),
            Dimension::Variable(reference) => size(*reference).or_else(|| {
                let size = self.variables.iter().find(|v| v.value_reference == *reference)?;
                size.start.as_ref()?.trim().parse().ok()
            }),
        };
        variable.dimensions.iter().map(extent).collect()
    }

    /// The array of FMI 3.0 and the element index denoted by this name: `x[2]`, `m[1,2]`.
    pub fn element(&self, name: &str) -> Option<(&ModelVariable, usize)> {
        self.element_with(name, |_| None)
    }

    /// [`element`](Self::element) with sizes as for [`shape_with`](Self::shape_with).
    pub fn element_with(&self, name: &str, size: impl Fn(u32) -> Option<usize>) -> Option<(&ModelVariable, usize)> {
        let (array, _) = name.rsplit_once('[')?;
        let variable = self.variable(array).filter(|v| v.is_array())?;
        Some((variable, element(&self.shape_with(variable, size)?, &name[array.len()..])?))
    }

    /// The variable that a number in the model structure refers to: its position in the list, from 1, in FMI 2.0
    /// (2.0.5, 2.2.8); its value reference in FMI 3.0 (3.0.2, 2.4.8).
    pub fn referenced(&self, reference: u32) -> Option<&ModelVariable> {
        match self.version {
            FmiVersion::V2 => self.variables.get(usize::try_from(reference).ok()?.checked_sub(1)?),
            // They mostly ascend.
            FmiVersion::V3 => match self.variables.binary_search_by_key(&reference, |v| v.value_reference) {
                Ok(place) => self.variables.get(place),
                Err(_) => self.variables.iter().find(|v| v.value_reference == reference),
            },
        }
    }

    /// The state of which a variable is the derivative, if any.
    pub fn state_of(&self, derivative: &ModelVariable) -> Option<&ModelVariable> {
        self.referenced(derivative.derivative?)
    }

    /// The continuous states in the order of `x` in every call, which is the order of the derivatives in the model structure
    /// (FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8). Entries that do not refer to the derivative of a variable are omitted.
    pub fn states(&self) -> Vec<&ModelVariable> {
        self.derivatives.iter().filter_map(|unknown| self.state_of(self.referenced(unknown.reference)?)).collect()
    }

    /// The unit with this name.
    pub fn unit(&self, name: &str) -> Option<&Unit> {
        self.units.iter().find(|u| u.name == name)
    }

    /// A display unit for the variable's values: the named one, or by default the variable's.
    pub fn display_unit(&self, v: &ModelVariable, name: Option<&str>) -> Option<DisplayUnit> {
        let shown = self.unit(v.unit.as_deref()?)?.display_unit(name.or(v.display_unit.as_deref())?)?;
        Some(if v.relative { shown.of_differences() } else { shown.clone() })
    }

    /// The known part of the unit of a variable's values.
    pub fn measured<'a>(&self, v: &'a ModelVariable) -> Measured<'a> {
        let base = v.unit.as_deref().and_then(|name| self.unit(name)?.base);
        Measured { unit: v.unit.as_deref(), base, relative: v.relative }
    }

    /// The type definition with this name.
    pub fn type_definition(&self, name: &str) -> Option<&TypeDefinition> {
        self.types.iter().find(|t| t.name == name)
    }
}

/// One of the interfaces: its model identifier and the capabilities it claims.
///
/// Capabilities are kept as written, so that a checker can find misspelled ones; [`flag`](Self::flag) reads them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interface {
    /// Base name of the binaries.
    pub model_identifier: String,
    /// Every attribute except the model identifier, as written.
    pub attributes: Vec<(String, String)>,
    /// The version that spells them.
    pub version: FmiVersion,
    /// Line of the element.
    pub line: usize,
}

/// The co-simulation interface.
pub type CoSimulation = Interface;

impl Interface {
    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str())
    }

    /// Whether a capability is claimed; a missing one is `false` in both standards.
    pub fn flag(&self, name: &str) -> bool {
        self.attribute(name).is_some_and(|value| matches!(value.trim(), "true" | "1"))
    }

    /// The state can be read and set.
    pub fn can_get_and_set_state(&self) -> bool {
        self.flag(self.of("canGetAndSetFMUstate", "canGetAndSetFMUState"))
    }

    /// The state can be serialized.
    pub fn can_serialize_state(&self) -> bool {
        self.flag(self.of("canSerializeFMUstate", "canSerializeFMUState"))
    }

    /// The standards spell some capabilities differently: FMI 2.0.5, 4.3.1; FMI 3.0.2, 2.4.2.
    const fn of<'a>(&self, two: &'a str, three: &'a str) -> &'a str {
        match self.version {
            FmiVersion::V2 => two,
            FmiVersion::V3 => three,
        }
    }

    /// The FMU needs another program to run.
    pub fn needs_execution_tool(&self) -> bool {
        self.flag("needsExecutionTool")
    }

    /// There is an event mode (FMI 3.0 Co-Simulation only; in Model Exchange there always is one).
    pub fn has_event_mode(&self) -> bool {
        self.flag("hasEventMode")
    }

    /// `DoStep` may return before the end of the step, for its own reasons or after an intermediate update (FMI 3.0 only).
    pub fn may_return_early(&self) -> bool {
        self.flag("mightReturnEarlyFromDoStep") || self.flag("canReturnEarlyAfterIntermediateUpdate")
    }

    /// The FMU has directional derivatives.
    pub fn has_directional_derivatives(&self) -> bool {
        self.flag(self.of("providesDirectionalDerivative", "providesDirectionalDerivatives"))
    }

    /// The FMU must be notified of every completed integrator step (Model Exchange): FMI 2.0 states when it need not be, FMI
    /// 3.0 when it must.
    pub fn needs_completed_integrator_step(&self, version: FmiVersion) -> bool {
        match version {
            FmiVersion::V2 => !self.flag("completedIntegratorStepNotNeeded"),
            FmiVersion::V3 => self.flag("needsCompletedIntegratorStep"),
        }
    }
}

/// The default experiment as given in the file: times in the unit of the independent variable, usually s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Start time.
    pub start: Option<f64>,
    /// Stop time.
    pub stop: Option<f64>,
    /// Recommended communication step size.
    pub step: Option<f64>,
    /// Relative tolerance.
    pub tolerance: Option<f64>,
}

/// A log category.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogCategory {
    /// Name that messages and `SetDebugLogging` use.
    pub name: String,
    /// Meaning of its messages.
    pub description: Option<String>,
}

/// An entry of the model structure. Its numbers are as written; [`ModelDescription::referenced`] finds the variables.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unknown {
    /// The variable.
    pub reference: u32,
    /// Its dependencies: `None` if the file gives none (it then depends on everything), empty if there are none.
    pub dependencies: Option<Vec<u32>>,
    /// Kind of each dependency, one word per dependency.
    pub kinds: Option<Vec<String>>,
    /// Line of the element.
    pub line: usize,
}
