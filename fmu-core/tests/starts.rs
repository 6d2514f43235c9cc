//! Contradictory starts, sizes and names, which the description of a model refuses before it is built.
#![allow(missing_docs)]

use fmu_core::unit::{Exponents, METER, ONE, Quantity, Unit};
use fmu_core::*;
use serde::{Deserialize, Serialize};

#[derive(Clone, Serialize, Deserialize)]
struct Wrong {
    x: f64,
    n: u64,
    a: Vec<f64>,
}

/// A model with these values at the start, these rows, and this beginning of a simulation.
macro_rules! wrong {
    ($name:ident, $start:expr, $rows:expr, $initialize:expr) => {
        #[derive(Clone, Serialize, Deserialize)]
        struct $name(Wrong);

        impl Default for $name {
            fn default() -> Self {
                Self($start)
            }
        }

        impl Model for $name {
            type Outputs = f64;
            const INFO: Info = Info { name: stringify!($name), ..Info::DEFAULT };
            const TABLE: &'static Table<Block<Self>> = {
                type V = Row<Block<$name>>;
                $rows
            };
            fn initialize(&mut self) {
                let initialize: fn(&mut Wrong) = $initialize;
                initialize(&mut self.0);
            }
            fn output(&self, _: Elapsed, out: &mut f64) {
                *out = 3.0;
            }
            fn advance(&mut self, _: &Step) -> Result<(), Fault> {
                Ok(())
            }
        }
    };
}

fn start(n: u64) -> Wrong {
    Wrong { x: 1.0, n, a: vec![0.0; 2] }
}

wrong!(Kept, start(2), table![V::output("x", &METER, "", |m| &mut m.model.0.x).exact()], |_| {});
wrong!(Overwritten, start(2), table![V::output("x", &METER, "", |m| &mut m.model.0.x).exact()], |m| m.x = 1.0);
wrong!(Elsewhere, start(2), table![V::output("y", &METER, "", |m| &mut m.out).exact()], |_| {});

wrong!(
    Sized,
    start(2),
    table![
        V::structural("n", "", |m| &mut m.model.0.n).at_most(5.0),
        V::array_parameter("a", &ONE, "", 5, |m| &mut m.model.0.a).sized(&["n"]),
    ],
    |_| {}
);
wrong!(
    Longer,
    start(3),
    table![
        V::structural("n", "", |m| &mut m.model.0.n).at_most(5.0),
        V::array_parameter("a", &ONE, "", 5, |m| &mut m.model.0.a).sized(&["n"]),
    ],
    |_| {}
);
wrong!(Nothing, start(0), table![V::structural("n", "", |m| &mut m.model.0.n).at_most(5.0)], |_| {});

const OTHER: &[Alias] = &[Alias { name: "x_m", description: "", display: None }];
const TAKEN: &[Alias] = &[Alias { name: "n", description: "", display: None }];
wrong!(Named, start(2), table![V::output("x", &METER, "", |m| &mut m.model.0.x).aliases(OTHER)], |_| {});
wrong!(
    Taken,
    start(2),
    table![
        V::output("x", &METER, "", |m| &mut m.model.0.x).aliases(TAKEN),
        V::discrete_input("n", &ONE, "", |m| &mut m.model.0.a[0]),
    ],
    |_| {}
);

const SWAPPED: &Quantity = &Quantity::new("Swapped", Unit::si("m", Exponents::mechanical(0, 0, 1, 0)));
wrong!(
    Twofold,
    start(2),
    table![
        V::output("x", &METER, "", |m| &mut m.model.0.x),
        V::discrete_input("n", SWAPPED, "", |m| &mut m.model.0.a[0]),
    ],
    |_| {}
);

#[test]
fn a_model_that_contradicts_itself_is_told_why() {
    fn why<M: Stored>() -> Option<String> {
        Description::of::<M>().err().map(|fault| fault.to_string())
    }
    assert_eq!((why::<Kept>(), why::<Sized>(), why::<Named>()), (None, None, None));
    for (name, why) in [("x", why::<Overwritten>()), ("y", why::<Elsewhere>())] {
        let reason = format!("{name} is exact, and does not keep the value that the importer sets: ");
        assert!(why.as_ref().is_some_and(|why| why.starts_with(&reason)), "{why:?}");
    }
    assert_eq!(why::<Longer>().unwrap(), "a has 2 elements, and n is 3");
    assert_eq!(why::<Nothing>().unwrap(), "n must be greater than 0 at the start");
    assert_eq!(why::<Taken>().unwrap(), "two variables of Taken have the name n");
    assert_eq!(why::<Twofold>().unwrap(), "the unit m of n differs from that of x: other base units or another factor");
}
