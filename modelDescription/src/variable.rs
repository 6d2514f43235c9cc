//! Variables as in a file (FMI 2.0.5, 2.2.7; FMI 3.0.2, 2.4.7).

use serde::{Deserialize, Serialize};

/// Declares an enumeration of words of the XML, with conversions in both directions.
macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $word:literal),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum $name { $($(#[$variant_doc])* $variant),* }

        impl $name {
            /// Every value, in the order of the standard.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// The word in the XML.
            pub const fn as_str(self) -> &'static str {
                match self { $(Self::$variant => $word),* }
            }

            /// The value of a word of the XML.
            pub fn from_word(word: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|x| x.as_str() == word)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.as_str())
            }
        }
    };
}

words! {
    /// Who sets a variable.
    Causality {
        /// Set before the simulation, sizes arrays (FMI 3.0 only).
        StructuralParameter = "structuralParameter",
        /// Set by the importer before the simulation.
        Parameter = "parameter",
        /// Computed from parameters.
        CalculatedParameter = "calculatedParameter",
        /// Set by the importer at communication points.
        Input = "input",
        /// Computed by the model, for connection to other models.
        Output = "output",
        /// Computed by the model, for inspection only.
        Local = "local",
        /// Time.
        Independent = "independent",
    }
}

words! {
    /// When a variable changes.
    Variability {
        /// Never.
        Constant = "constant",
        /// Not after initialization.
        Fixed = "fixed",
        /// A parameter that may change during the simulation.
        Tunable = "tunable",
        /// At events, or at communication points.
        Discrete = "discrete",
        /// All the time.
        Continuous = "continuous",
    }
}

words! {
    /// Source of the initial value.
    Initial {
        /// The start value.
        Exact = "exact",
        /// An iteration that begins at the start value.
        Approx = "approx",
        /// Calculated from other variables.
        Calculated = "calculated",
    }
}

words! {
    /// Base type, by the name of FMI 3.0. FMI 2.0's Real is `Float64` and its Integer is `Int32`: the same values cross
    /// the interface.
    BaseType {
        /// A single-precision number.
        Float32 = "Float32",
        /// A double-precision number; Real in FMI 2.0.
        Float64 = "Float64",
        /// A signed integer of 8 bits.
        Int8 = "Int8",
        /// An unsigned integer of 8 bits.
        UInt8 = "UInt8",
        /// A signed integer of 16 bits.
        Int16 = "Int16",
        /// An unsigned integer of 16 bits.
        UInt16 = "UInt16",
        /// A signed integer of 32 bits; Integer in FMI 2.0.
        Int32 = "Int32",
        /// An unsigned integer of 32 bits.
        UInt32 = "UInt32",
        /// A signed integer of 64 bits.
        Int64 = "Int64",
        /// An unsigned integer of 64 bits.
        UInt64 = "UInt64",
        /// A truth value.
        Boolean = "Boolean",
        /// A text.
        String = "String",
        /// Bytes.
        Binary = "Binary",
        /// A named value; 64 bits in FMI 3.0, 32 in FMI 2.0.
        Enumeration = "Enumeration",
        /// A clock.
        Clock = "Clock",
    }
}

impl BaseType {
    /// Whether values are floating-point numbers.
    pub fn is_float(self) -> bool {
        matches!(self, Self::Float32 | Self::Float64)
    }

    /// Whether values are integers, including enumerations.
    pub fn is_integer(self) -> bool {
        !self.is_float() && !matches!(self, Self::Boolean | Self::String | Self::Binary | Self::Clock)
    }
}

words! {
    /// The source of the ticks of a clock (FMI 3.0 only).
    IntervalVariability {
        /// Always with one interval.
        Constant = "constant",
        /// With an interval that is set before the start.
        Fixed = "fixed",
        /// With an interval that may change at events.
        Tunable = "tunable",
        /// With an interval that the FMU gives at each tick.
        Changing = "changing",
        /// After a time that the FMU gives at an event.
        Countdown = "countdown",
        /// At any time.
        Triggered = "triggered",
    }
}

/// When a clock ticks, as in the file (FMI 3.0 only).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClockTiming {
    /// The source of its ticks.
    pub ticks: IntervalVariability,
    /// Interval between two ticks in the unit of the independent variable, usually s.
    pub interval: Option<f64>,
    /// Time from the start to the first tick.
    pub shift: f64,
    /// Smaller numbers are first when clocks tick together (Scheduled Execution).
    pub priority: Option<u32>,
}

/// One extent of an array (FMI 3.0 only).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Dimension {
    /// A number.
    Fixed(u64),
    /// The value of the variable with this value reference.
    Variable(u32),
}

/// Another name of a variable (FMI 3.0 only).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Alias {
    /// Structured name, unique in the FMU.
    pub name: String,
    /// One sentence.
    pub description: Option<String>,
    /// Display unit.
    pub display_unit: Option<String>,
}

/// A variable. Missing properties come from its type definition, then from the standard's default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelVariable {
    /// Full name.
    pub name: String,
    /// Value reference.
    pub value_reference: u32,
    /// One sentence.
    pub description: Option<String>,
    /// Who sets it.
    pub causality: Causality,
    /// When it changes.
    pub variability: Variability,
    /// Source of the initial value, as in the file; see [`initial_or_default`](Self::initial_or_default).
    pub initial: Option<Initial>,
    /// Base type.
    pub base: BaseType,
    /// Name of the type definition.
    pub declared_type: Option<String>,
    /// Start value as in the file: a list for an array of numbers, the first `<Start>` of an FMI 3.0 String or Binary.
    pub start: Option<String>,
    /// All `<Start>` values of an FMI 3.0 String or Binary.
    pub start_texts: Vec<String>,
    /// Physical quantity.
    pub quantity: Option<String>,
    /// Name of the unit.
    pub unit: Option<String>,
    /// Display unit.
    pub display_unit: Option<String>,
    /// The value is a difference, to which the offset of a display unit does not apply (`relativeQuantity`).
    pub relative: bool,
    /// Lower bound; beyond 2^53 the nearest double.
    pub min: Option<f64>,
    /// Upper bound; beyond 2^53 the nearest double.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// Maximum number of bytes of a Binary.
    pub max_size: Option<u64>,
    /// Extents of an array, empty for a scalar.
    pub dimensions: Vec<Dimension>,
    /// Other names.
    pub aliases: Vec<Alias>,
    /// The state whose derivative this is, as in the file: an index in FMI 2.0, a value reference in FMI 3.0.
    pub derivative: Option<u32>,
    /// A state may jump at events (Model Exchange only).
    pub reinit: bool,
    /// It can be read or set inside a communication step (FMI 3.0 only).
    pub intermediate: bool,
    /// Value references of its clocks (FMI 3.0 only).
    pub clocks: Vec<u32>,
    /// When a clock ticks; `None` if the file does not follow the standard.
    pub timing: Option<ClockTiming>,
    /// Line of the element.
    pub line: usize,
}

impl ModelVariable {
    /// `initial`, or its default (tables of FMI 2.0.5, 2.2.7 and FMI 3.0.2, 2.4.7.5); `None` for time, which has none.
    pub fn initial_or_default(&self) -> Option<Initial> {
        self.initial.or(match (self.causality, self.variability) {
            (Causality::Independent, _) => None,
            (Causality::StructuralParameter | Causality::Parameter | Causality::Input, _)
            | (_, Variability::Constant) => Some(Initial::Exact),
            _ => Some(Initial::Calculated),
        })
    }

    /// Whether the variable belongs to an array.
    pub fn is_array(&self) -> bool {
        !self.dimensions.is_empty()
    }
}
