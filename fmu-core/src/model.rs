//! The trait that a model implements, and the life cycle of an instance.

use crate::{Elapsed, Fault, Hash, Step, Table, Terminal};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::path::Path;

/// General information about a model; the table has its variables.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Name and model identifier: a C identifier.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// Version of the model; a change of behavior or of a start value changes it.
    pub version: &'static str,
    /// Who wrote it.
    pub author: &'static str,
    /// License, an SPDX expression.
    pub license: &'static str,
    /// Copyright line.
    pub copyright: &'static str,
    /// Recommended experiment.
    pub experiment: Experiment,
    /// Log categories of the model, in addition to the standards': names and descriptions. [`Warns`](crate::Warns) logs into
    /// them.
    pub categories: &'static [(&'static str, &'static str)],
    /// Body of the documentation page: an HTML fragment (equations, how to connect); the variables are added to it.
    pub documentation: &'static str,
}

impl Info {
    /// Defaults for everything except the name: `Info { name: "MyModel", description: "...", ..Info::DEFAULT }`.
    pub const DEFAULT: Self = Self {
        name: "",
        description: "",
        version: "0.1.0",
        author: "",
        license: "",
        copyright: "",
        experiment: Experiment::DEFAULT,
        categories: &[],
        documentation: "",
    };
}

/// The default experiment: times in s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Start time.
    pub start: f64,
    /// Stop time.
    pub stop: f64,
    /// Recommended communication step size.
    pub step: f64,
    /// Recommended relative tolerance of the importer's solver.
    #[serde(default)]
    pub tolerance: Option<f64>,
    /// The step of the model's solver in Co-Simulation, if it is fixed: `fixedInternalStepSize` of FMI 3.0.
    #[serde(default)]
    pub fixed_step: Option<f64>,
}

impl Experiment {
    /// From 0 to 1 s in steps of 1 ms: `Experiment { stop: 10.0, ..Experiment::DEFAULT }`.
    pub const DEFAULT: Self = Self { start: 0.0, stop: 1.0, step: 1e-3, tolerance: None, fixed_step: None };
}

/// The interface through which an importer uses a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Interface {
    /// Co-simulation without events: communication points only.
    CoSimulation,
    /// Co-simulation with Event Mode (FMI 3.0).
    EventMode,
    /// Model Exchange: the importer integrates.
    ModelExchange,
    /// Scheduled Execution: the importer activates clocks one by one (FMI 3.0).
    ScheduledExecution,
}

/// A model of one block in a block diagram, sampled or continuous.
///
/// The life of an instance:
/// 1. `Default` creates it: inputs and parameters at their start values. [`load`](Model::load) reads resources.
/// 2. The importer sets parameters and inputs; each set is checked against its range in the table.
/// 3. [`derive`](Model::derive), [`initialize`](Model::initialize) and [`output`](Model::output) run whenever the importer
///    reads a value after it has set one, so that initialization can be iterated.
/// 4. [`validate`](Model::validate) checks the parameters together; then the simulation starts.
/// 5. [`advance`](Model::advance) and [`output`](Model::output) run in turn. An `advance` does not allocate, lock, read a
///    clock or print, and never writes a parameter.
/// 6. Saving is a clone, storing is serde; both at any time between calls. A model without them is exported as
///    [`Unsaved`](crate::Capabilities::unsaved) or [`Unstored`](crate::Capabilities::unstored).
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a model: it lacks the trait `Model`",
    note = "write `impl Model for {Self}`, and name the type of the model in the line that exports it"
)]
pub trait Model: Default + Send + 'static {
    /// The outputs, a separate plain struct.
    type Outputs: Default + Clone + Serialize + DeserializeOwned + Send + 'static;

    /// General information about the model.
    const INFO: Info;

    /// The variables: names, units and ranges are written only here.
    const TABLE: &'static Table<Block<Self>>;

    /// Variables that are connected together; they are not part of the token.
    const TERMINALS: &'static [Terminal] = &[];

    /// Icon: an SVG document without text (a renderer may have no fonts) for a square from -100 to 100 both ways.
    const ICON: Option<&'static str> = None;

    /// Layout of the serialized state; a change of a field changes it.
    const STATE_VERSION: u16 = 1;

    /// Hash of name, version and table.
    const HASH: Hash = Hash::START.text(Self::INFO.name).text(Self::INFO.version).join(&Self::TABLE.hash());

    /// Reads data from the files of the FMU's folder `resources/`, once, at instantiation. `resources` is that folder; `None` if
    /// the importer passes none. Store what is read in a [`Resource`](crate::Resource): it is not part of a saved state, and
    /// remains after a reset and when a state is restored.
    ///
    /// ```
    /// # use fmu_core::{Fault, Resource};
    /// # use std::path::Path;
    /// # #[derive(Default)] struct Motor { map: Resource<Vec<f64>> }
    /// # impl Motor {
    /// fn load(&mut self, resources: Option<&Path>) -> Result<(), Fault> {
    ///     let file = resources.ok_or_else(|| Fault::new("map.txt is in the FMU's resources"))?.join("map.txt");
    ///     let wrong = |why: &dyn std::fmt::Display| Fault::new(format!("{}: {why}", file.display()));
    ///     let text = std::fs::read_to_string(&file).map_err(|e| wrong(&e))?;
    ///     let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    ///     self.map = numbers.map_err(|e| wrong(&e))?.into();
    ///     Ok(())
    /// }
    /// # }
    /// # let folder = std::env::temp_dir().join(format!("fmu-core-{}", std::process::id()));
    /// # std::fs::create_dir_all(&folder).unwrap();
    /// # std::fs::write(folder.join("map.txt"), "1 2.5").unwrap();
    /// # let mut motor = Motor::default();
    /// # motor.load(Some(&folder))?;
    /// # std::fs::remove_dir_all(&folder).unwrap();
    /// # assert_eq!(motor.map[1], 2.5);
    /// # assert!(motor.load(None).is_err());
    /// # Ok::<(), Fault>(())
    /// ```
    ///
    /// # Errors
    /// States the file and the reason; no instance is created.
    fn load(&mut self, _resources: Option<&Path>) -> Result<(), Fault> {
        Ok(())
    }

    /// The real outputs that the table declares discrete are computed at every instant: for a model without samples that shares
    /// the table of a sampled model, so that it can replace it.
    const CONTINUOUS: bool = false;

    /// Whether the parameter of this name has an effect. A model that shares the parameters of another model, so that it can
    /// replace it, need not read them all; the descriptions state which have no effect.
    fn has_effect(_parameter: &str) -> bool {
        true
    }

    /// Why the parameter or input of this name has no effect with the values of the others. If the model implements
    /// [`Warns`](crate::Warns), a changed value is then reported once, after the first step.
    fn idle(&self, _name: &str) -> Option<&'static str> {
        None
    }

    /// Calculated parameters from the parameters; runs again when a tunable parameter was set.
    fn derive(&mut self) {}

    /// Rules across parameters, checked on leaving initialization and in the first step after a tunable parameter was set,
    /// both on a copy after [`derive`](Model::derive): a refusal leaves the model unchanged.
    ///
    /// # Errors
    /// Names the inconsistent parameters, their values and the reason.
    fn validate(&self) -> Result<(), Fault> {
        Ok(())
    }

    /// Rules in addition to [`validate`](Model::validate) for a model that is used through this interface.
    ///
    /// # Errors
    /// Names the parameter, its value and the reason.
    fn validate_for(&self, _interface: Interface) -> Result<(), Fault> {
        Ok(())
    }

    /// The state at the start time, from parameters and inputs.
    fn initialize(&mut self);

    /// Makes [`initialize`](Model::initialize) short in a copy whose dependencies are found by many runs, without another dependency: for a
    /// model that simulates something before its start.
    fn shorten(&mut self) {}

    /// Computes the outputs from parameters and state at time `now`, and leaves everything else unchanged.
    fn output(&self, now: Elapsed, outputs: &mut Self::Outputs);

    /// Advances the state by one step with constant inputs.
    ///
    /// # Errors
    /// Gives the reason why the step is impossible, for example a state that is no longer finite. With
    /// [`Fault::end`] the simulation ends inside the step without an error, and the state is the final one.
    fn advance(&mut self, step: &Step) -> Result<(), Fault>;
}

/// A model together with its outputs: the type that the rows of its table access.
#[derive(Clone, Default, Serialize, Deserialize)]
#[serde(bound(serialize = "M: Serialize", deserialize = "M: DeserializeOwned"))]
pub struct Block<M: Model> {
    /// Inputs, parameters and state.
    pub model: M,
    /// Outputs at the last communication point.
    pub out: M::Outputs,
}

impl<M: Model> Block<M> {
    /// Calculated parameters, state and outputs at the start, from the values set so far.
    pub fn initialize(&mut self) {
        self.model.derive();
        self.model.initialize();
        self.model.output(Elapsed::ZERO, &mut self.out);
    }

    /// One step and the outputs at its end.
    ///
    /// # Errors
    /// Same as [`Model::advance`].
    #[inline]
    pub fn step(&mut self, step: &Step) -> Result<(), Fault> {
        self.model.advance(step)?;
        self.model.output(step.end(), &mut self.out);
        Ok(())
    }
}
