//! Rows of truth values, enumerations, single precision, arrays and texts; [`integer`](crate::integer) has those of integers.

use crate::enumeration::{Enumerated, Field};
use crate::row::{Access, Row};
use crate::unit::Quantity;
use crate::variable::{Causality, Kind, Variability};

impl<W: 'static> Row<W> {
    const fn boolean(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        description: &'static str,
        get: fn(&mut W) -> &mut bool,
    ) -> Self {
        Self::new(name, description, causality, variability, Kind::Boolean, Access::Boolean(get))
    }

    /// A Boolean input.
    pub const fn boolean_input(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        Self::boolean((Causality::Input, Variability::Discrete), name, description, get)
    }

    /// A Boolean output.
    pub const fn boolean_output(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        Self::boolean((Causality::Output, Variability::Discrete), name, description, get)
    }

    /// A Boolean variable other than an output.
    pub const fn boolean_local(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        Self::boolean((Causality::Local, Variability::Discrete), name, description, get)
    }

    /// A Boolean parameter.
    pub const fn boolean_parameter(
        name: &'static str,
        description: &'static str,
        get: fn(&mut W) -> &mut bool,
    ) -> Self {
        Self::boolean((Causality::Parameter, Variability::Fixed), name, description, get)
    }

    const fn enumeration<E: Enumerated>(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        let kind = Kind::Enumeration(E::ENUMERATION);
        Self::new(name, description, causality, variability, kind, Access::Enumeration(field))
    }

    /// An enumeration input; `field` says where the model holds the enum.
    pub const fn enumeration_input<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Input, Variability::Discrete), name, description, field)
    }

    /// An enumeration output.
    pub const fn enumeration_output<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Output, Variability::Discrete), name, description, field)
    }

    /// An enumeration other than an output.
    pub const fn enumeration_local<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Local, Variability::Discrete), name, description, field)
    }

    /// An enumeration parameter.
    pub const fn enumeration_parameter<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Parameter, Variability::Fixed), name, description, field)
    }

    const fn single(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::new(name, description, causality, variability, Kind::Float32(quantity), Access::Float32(get))
    }

    /// A real input in single precision, which changes at sample instants. FMI 2.0 has double precision only: what the
    /// importer sets is rounded.
    pub const fn float32_input(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Input, Variability::Discrete), name, quantity, description, get)
    }

    /// A real output in single precision, which changes at sample instants.
    pub const fn float32_output(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Output, Variability::Discrete), name, quantity, description, get)
    }

    /// A real variable in single precision other than an output, which changes at sample instants.
    pub const fn float32_local(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Local, Variability::Discrete), name, quantity, description, get)
    }

    /// A real parameter in single precision.
    pub const fn float32_parameter(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Parameter, Variability::Fixed), name, quantity, description, get)
    }

    const fn array(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        let mut row = Self::new(name, description, causality, variability, Kind::Real(quantity), Access::Reals(get));
        row.meta.dimension = Some(dimension);
        row
    }

    /// An array of continuous real inputs; `dimension` elements.
    pub const fn array_input(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Input, Variability::Continuous), name, quantity, description, dimension, get)
    }

    /// An array of continuous real outputs; `dimension` elements.
    pub const fn array_output(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Output, Variability::Continuous), name, quantity, description, dimension, get)
    }

    /// An array of `dimension` continuous real variables other than outputs.
    pub const fn array_local(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Local, Variability::Continuous), name, quantity, description, dimension, get)
    }

    /// A fixed array of real parameters; `dimension` elements.
    pub const fn array_parameter(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Parameter, Variability::Fixed), name, quantity, description, dimension, get)
    }

    /// A text parameter, fixed after initialization: a file name, a mode that is not an enumeration.
    pub const fn text_parameter(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut String) -> Self {
        Self::new(name, description, Causality::Parameter, Variability::Fixed, Kind::Text, Access::Text(get))
    }

    /// A text output. The model keeps it or chooses among constants: reading it in a step does not allocate.
    pub const fn text_output(name: &'static str, description: &'static str, say: fn(&W) -> &str) -> Self {
        Self::new(name, description, Causality::Output, Variability::Discrete, Kind::Text, Access::Said(say))
    }

    /// A text that never changes, for inspection: a revision, a source.
    pub const fn text_constant(name: &'static str, description: &'static str, text: &'static str) -> Self {
        Self::new(name, description, Causality::Local, Variability::Constant, Kind::Text, Access::Constant(text))
    }
}
