//! Constructors of rows: each determines who sets the variable and when it changes. Those of integers are in
//! [`integer`](crate::integer).

use crate::bytes::Bytes;
use crate::enumeration::{Enumerated, Field};
use crate::integer::{Getter, IntegerType};
use crate::list::{Element, Items};
use crate::refusal::demand;
use crate::row::{Access, Constant, Row};
use crate::unit::Quantity;
use crate::variable::{Causality, Kind, Variability};

/// Constructors with the same arguments (after their type parameters) and the same row: one per line, with causality and
/// variability.
macro_rules! constructors {
    ([$($generic:tt)*] $arguments:tt => $row:expr; $($(#[$doc:meta])* $name:ident $causality:ident $variability:ident;)*) => {
        constructors! { @ [$($generic)*] $arguments [$row] $([$(#[$doc])* $name $causality $variability])* }
    };
    (@ $generics:tt $arguments:tt $row:tt $([$($line:tt)*])*) => {
        impl<W: 'static> Row<W> {
            $(constructors! { @ $generics $arguments $row; $($line)* })*
        }
    };
    (@ [$($generic:tt)*] $arguments:tt [$row:expr]; $(#[$doc:meta])* $name:ident $causality:ident $variability:ident) => {
        $(#[$doc])*
        #[track_caller]
        pub const fn $name<$($generic)*> $arguments -> Self {
            $row.with(Causality::$causality, Variability::$variability)
        }
    };
}

constructors! {
    [] (name: &'static str, quantity: &'static Quantity, description: &'static str, get: fn(&mut W) -> &mut f64)
        => Self::new(name, description, Kind::Real(quantity), Access::Real(get));
    /// A continuous real input.
    input Input Continuous;
    /// A real input that changes at sample instants.
    discrete_input Input Discrete;
    /// A continuous real output, calculated from the start on.
    output Output Continuous;
    /// A continuous real variable other than an output: a state that importers may read.
    state Local Continuous;
    /// A continuous real variable, calculated as an output, that is neither an output nor a state.
    local Local Continuous;
    /// A real output that changes at sample instants.
    discrete_output Output Discrete;
    /// A real variable that is not an output and changes at sample instants.
    discrete_local Local Discrete;
    /// A real parameter, fixed after initialization.
    parameter Parameter Fixed;
    /// A parameter computed by the model's `derive`, constant during the simulation.
    calculated CalculatedParameter Fixed;
}

constructors! {
    [] (name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool)
        => Self::new(name, description, Kind::Boolean, Access::Boolean(get));
    /// A Boolean input.
    boolean_input Input Discrete;
    /// A Boolean output.
    boolean_output Output Discrete;
    /// A Boolean variable other than an output.
    boolean_local Local Discrete;
    /// A Boolean parameter.
    boolean_parameter Parameter Fixed;
}

constructors! {
    [E: Enumerated] (name: &'static str, description: &'static str, field: &'static Field<W, E>)
        => Self::new(name, description, Kind::Enumeration(E::ENUMERATION), Access::Enumeration(field));
    /// An enumeration input; `field` locates the enum in the model.
    enumeration_input Input Discrete;
    /// An enumeration output.
    enumeration_output Output Discrete;
    /// An enumeration other than an output.
    enumeration_local Local Discrete;
    /// An enumeration parameter.
    enumeration_parameter Parameter Fixed;
}

constructors! {
    [] (name: &'static str, quantity: &'static Quantity, description: &'static str, get: fn(&mut W) -> &mut f32)
        => Self::new(name, description, Kind::Float32(quantity), Access::Float32(get));
    /// A real input in single precision, which changes at sample instants unless it is [`continuous`](Row::continuous). FMI 2.0
    /// has double precision only: values from the importer are rounded.
    float32_input Input Discrete;
    /// A real output in single precision, which changes at sample instants.
    float32_output Output Discrete;
    /// A real variable in single precision that is not an output and changes at sample instants.
    float32_local Local Discrete;
    /// A real parameter in single precision.
    float32_parameter Parameter Fixed;
}

constructors! {
    [] (
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) => Self::new(name, description, Kind::Real(quantity), Access::Reals(get)).of_dimension(dimension);
    /// An array of continuous real inputs; `dimension` elements.
    array_input Input Continuous;
    /// An array of continuous real outputs; `dimension` elements.
    array_output Output Continuous;
    /// An array of `dimension` continuous real variables other than outputs.
    array_local Local Continuous;
    /// A fixed array of real parameters; `dimension` elements.
    array_parameter Parameter Fixed;
}

constructors! {
    [T: Element] (name: &'static str, description: &'static str, dimension: usize, items: &'static Items<W, T>)
        => Self::new(name, description, T::KIND, Access::List(items)).of_dimension(dimension);
    /// An array of inputs other than real numbers; `dimension` elements, and `items` locates them in the model.
    list_input Input Discrete;
    /// An array of outputs other than real numbers; `dimension` elements.
    list_output Output Discrete;
    /// An array of `dimension` variables, neither outputs nor real numbers.
    list_local Local Discrete;
    /// A fixed array of parameters other than real numbers; `dimension` elements.
    list_parameter Parameter Fixed;
}

constructors! {
    [] (name: &'static str, description: &'static str, get: fn(&mut W) -> &mut String)
        => Self::new(name, description, Kind::Text, Access::Text(get));
    /// A text input: setting it may allocate.
    text_input Input Discrete;
    /// A text parameter, fixed after initialization: a file name, a mode that is not an enumeration.
    text_parameter Parameter Fixed;
}

constructors! {
    [] (
        name: &'static str,
        description: &'static str,
        mime_type: &'static str,
        most: usize,
        get: fn(&mut W) -> &mut Bytes,
    ) => Self::new(name, description, Kind::Binary { mime_type, most }, Access::Binary(get));
    /// An input of at most `most` bytes (FMI 3.0), whose content has this MIME type.
    binary_input Input Discrete;
    /// An output of at most `most` bytes (FMI 3.0).
    binary_output Output Discrete;
    /// A variable, other than an output, of at most `most` bytes (FMI 3.0).
    binary_local Local Discrete;
    /// A parameter of at most `most` bytes (FMI 3.0), fixed after initialization.
    binary_parameter Parameter Fixed;
}

impl<W: 'static> Row<W> {
    const fn of_dimension(mut self, dimension: usize) -> Self {
        self.meta.dimension = Some(dimension);
        self
    }

    /// A structural parameter (FMI 3.0), the size of arrays that name it in [`sized`](Self::sized); an
    /// [upper bound](Self::at_most) belongs to it. The importer sets it in Configuration Mode, before the simulation; also in
    /// Reconfiguration Mode if it is [`tunable`](Self::tunable). In FMI 2.0 it is a constant.
    #[track_caller]
    pub const fn structural(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut u64) -> Self {
        let (kind, access) = (Kind::Integer(IntegerType::UInt64), Access::Integer(Getter::UInt64(get)));
        Self::new(name, description, kind, access).with(Causality::StructuralParameter, Variability::Fixed)
    }

    /// A text output. The model stores it or selects a constant: reading it in a step does not allocate.
    #[track_caller]
    pub const fn text_output(name: &'static str, description: &'static str, say: fn(&W) -> &str) -> Self {
        Self::new(name, description, Kind::Text, Access::Said(say)).with(Causality::Output, Variability::Discrete)
    }

    /// A real output that changes at sample instants and is not stored: `compute` reads it from the state, without an
    /// allocation.
    #[track_caller]
    pub const fn computed_output(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        compute: fn(&W) -> f64,
    ) -> Self {
        let row = Self::new(name, description, Kind::Real(quantity), Access::Computed(compute));
        row.with(Causality::Output, Variability::Discrete)
    }

    /// A text that never changes, for inspection: a revision, a source.
    #[track_caller]
    pub const fn text_constant(name: &'static str, description: &'static str, text: &'static str) -> Self {
        Self::new(name, description, Kind::Text, Access::ConstantText(text)).constant_local()
    }

    /// A real number that never changes, for inspection; [`as_output`](Self::as_output) makes it an output.
    #[track_caller]
    pub const fn constant(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        value: f64,
    ) -> Self {
        Self::new(name, description, Kind::Real(quantity), Access::Constant(Constant::Real(value))).constant_local()
    }

    /// A real number in single precision that never changes.
    #[track_caller]
    pub const fn float32_constant(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        value: f32,
    ) -> Self {
        let access = Access::Constant(Constant::Float32(value));
        Self::new(name, description, Kind::Float32(quantity), access).constant_local()
    }

    /// A truth value that never changes.
    #[track_caller]
    pub const fn boolean_constant(name: &'static str, description: &'static str, value: bool) -> Self {
        Self::new(name, description, Kind::Boolean, Access::Constant(Constant::Boolean(value))).constant_local()
    }

    /// An item of an enumeration that never changes: `Fan::On as i32`.
    ///
    /// # Panics
    /// At compile time, if the enumeration has no item of this value.
    #[track_caller]
    pub const fn enumeration_constant<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        value: i32,
    ) -> Self {
        let (items, mut i) = (E::ENUMERATION.items, 0);
        while i < items.len() && items[i].value != value {
            i += 1;
        }
        demand(i < items.len(), name, "the enumeration has no item of this value");
        let access = Access::Constant(Constant::Enumeration(value));
        Self::new(name, description, Kind::Enumeration(E::ENUMERATION), access).constant_local()
    }

    /// An array of real numbers that never changes.
    #[track_caller]
    pub const fn array_constant(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        values: &'static [f64],
    ) -> Self {
        let row = Self::new(name, description, Kind::Real(quantity), Access::Constants(values));
        row.of_dimension(values.len()).constant_local()
    }

    pub(crate) const fn constant_local(self) -> Self {
        self.with(Causality::Local, Variability::Constant)
    }
}
