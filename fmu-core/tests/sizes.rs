//! Structural parameters: the lengths of arrays, in the table and in its parts, the numbers of states, and refused tables.
#![allow(missing_docs, clippy::float_cmp)]

use fmu_core::table::numbered;
use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::*;
use serde::{Deserialize, Serialize};
use std::panic::{UnwindSafe, catch_unwind};

/// A part that has its own size.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Map {
    rows: u64,
    values: Vec<f64>,
}

/// A part without sizes.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Load {
    gain: f64,
    table: [f64; 3],
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Grid {
    n: u64,
    k: u64,
    gains: Vec<f64>,
    marks: Vec<i32>,
    matrix: [f64; 6],
    x: Vec<f64>,
    a: f64,
    y: Vec<f64>,
    b: f64,
    map: Map,
    load: Load,
}

type V = Row<Block<Grid>>;
type M = Row<Map>;
type L = Row<Load>;

const MAP: &Table<Map> = table![
    M::structural("rows", "", |m| &mut m.rows).at_most(7.0),
    M::array_parameter("values", &ONE, "", 7, |m| &mut m.values).sized(&["rows"]),
];
const LOAD: &Table<Load> = table![
    L::parameter("gain", &ONE, "", |m| &mut m.gain),
    L::array_parameter("table", &ONE, "", 3, |m| &mut m.table).shape(&[3, 1]),
];

impl Model for Grid {
    type Outputs = ();
    const INFO: Info = Info { name: "Grid", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::structural("n", "", |m| &mut m.model.n).at_most(5.0).tunable(),
        V::structural("k", "", |m| &mut m.model.k).at_most(4.0),
        V::array_parameter("gains", &ONE, "", 20, |m| &mut m.model.gains).sized(&["k", "n"]),
        V::list_parameter("marks", "", 4, &Items(|m: &mut Block<Grid>| &mut m.model.marks)).sized(&["k"]),
        V::array_parameter("matrix", &ONE, "", 6, |m| &mut m.model.matrix).shape(&[2, 3]),
        V::array_constant("levels", &ONE, "", &[1.0, 2.0, 3.0]),
        V::state("a", &ONE, "", |m| &mut m.model.a),
        V::array_local("x", &ONE, "", 5, |m| &mut m.model.x).sized(&["n"]),
        V::array_local("y", &ONE, "", 4, |m| &mut m.model.y).sized(&["k"]),
        V::state("b", &ONE, "", |m| &mut m.model.b),
        V::part("map.", &Part { table: MAP, lens: |m: &mut Block<Grid>| &mut m.model.map }),
        V::part("load.", &Part { table: LOAD, lens: |m: &mut Block<Grid>| &mut m.model.load }),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, { Self::SCALARS }>(self, step, 0.1)
    }
}

impl ContinuousTime for Grid {
    const STATES: &'static [State<Self>] = &[
        State::new("a", &PER_SECOND, |m: &mut Self| &mut m.a),
        State::array("x", &PER_SECOND, 5, |m: &mut Self| &mut m.x),
        State::array("y", &PER_SECOND, 4, |m: &mut Self| &mut m.y),
        State::new("b", &PER_SECOND, |m: &mut Self| &mut m.b),
    ];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.fill(1.0);
        Ok(())
    }
}

const CAN: Capabilities<Grid> = Capabilities::NONE.ContinuousTime();

/// A grid with arrays of the right lengths; `x` is 10, 11, ... and `y` is 20, 21, ...
fn grid(n: u8, k: u8, rows: u8) -> Block<Grid> {
    let count = |first: u8, n: u8| (first..first + n).map(f64::from).collect::<Vec<_>>();
    let [long, short] = [n * k, rows].map(|n| vec![0.5; n.into()]);
    let model = Grid {
        n: n.into(),
        k: k.into(),
        gains: long,
        marks: vec![0; k.into()],
        x: count(10, n),
        a: 1.0,
        y: count(20, k),
        b: 2.0,
        map: Map { rows: rows.into(), values: short },
        ..Grid::default()
    };
    Block { model, out: () }
}

/// The index of a variable, or of the first element of an array.
fn index(name: &str) -> usize {
    Grid::TABLE.indices().find(|&i| Grid::TABLE.locate(i).is_some_and(|(found, ..)| found == name)).unwrap()
}

/// The present sizes, not the maximum ones, of the table's own arrays and of those in parts.
#[test]
fn extents_are_the_present_ones() {
    let mut it = grid(3, 2, 6);
    for (name, count, extents) in [
        ("n", 1, &[][..]),
        ("gains", 6, &[2, 3]),
        ("marks", 2, &[2]),
        ("matrix", 6, &[2, 3]),
        ("levels", 3, &[]),
        ("a", 1, &[]),
        ("x", 3, &[3]),
        ("map.rows", 1, &[]),
        ("map.values", 6, &[6]),
        ("load.gain", 1, &[]),
        ("load.table", 3, &[3, 1]),
    ] {
        let (meta, found) = Grid::TABLE.extent(&mut it, index(name)).unwrap();
        assert_eq!((meta.name, found), (name.rsplit('.').next().unwrap(), count), "{name}");
        assert_eq!(Grid::TABLE.extents(&mut it, index(name)), extents, "{name}");
    }
    assert!(Grid::TABLE.extent(&mut it, Grid::TABLE.len()).is_none());
    assert!(Grid::TABLE.extents(&mut it, Grid::TABLE.len()).is_empty());
}

/// Each array alone with one element too many or too few.
#[test]
fn an_array_of_another_length_is_named() {
    let check = |it: &mut Block<Grid>| Grid::TABLE.check_sizes(it).map_err(|fault| fault.message().to_owned());
    for (n, k, rows) in [(3, 2, 6), (5, 4, 7), (1, 1, 1), (0, 3, 0), (2, 0, 1)] {
        assert_eq!(check(&mut grid(n, k, rows)), Ok(()), "{n} {k} {rows}");
    }
    let wrong = |change: fn(&mut Grid)| {
        let mut it = grid(3, 2, 6);
        change(&mut it.model);
        check(&mut it).unwrap_err()
    };
    assert_eq!(wrong(|m| m.gains.push(0.0)), "gains has 7 elements, and k x n is 6");
    assert_eq!(wrong(|m| m.marks.truncate(1)), "marks has 1 elements, and k is 2");
    assert_eq!(wrong(|m| m.y.clear()), "y has 0 elements, and k is 2");
    assert_eq!(wrong(|m| m.n = 4), "gains has 6 elements, and k x n is 8");
    assert_eq!(wrong(|m| m.map.values.push(0.0)), "values has 7 elements, and rows is 6");
}

/// A tunable parameter that is no size.
const GAIN: &Table<Load> = table![L::parameter("gain", &ONE, "", |m| &mut m.gain).tunable()];

/// The sizes of a part are those of the whole.
const WHOLE: &Table<Grid> = table![
    Row::<Grid>::parameter("b", &ONE, "", |m| &mut m.b),
    Row::<Grid>::part("map.", &Part { table: MAP, lens: |m: &mut Grid| &mut m.map }),
    Row::<Grid>::parameter("a", &ONE, "", |m| &mut m.a),
];

#[test]
fn a_table_knows_whether_it_has_sizes() {
    let has = [Grid::TABLE.has_sizes(), MAP.has_sizes(), LOAD.has_sizes(), GAIN.has_sizes(), WHOLE.has_sizes()];
    assert_eq!(has, [true, true, false, false, true]);
    let tunable = [Grid::TABLE.has_tunable_sizes(), MAP.has_tunable_sizes(), WHOLE.has_tunable_sizes()];
    assert_eq!((tunable, GAIN.has_tunable_sizes()), ([true, false, false], false));
}

/// A number is counted with the maximum sizes: `a` is 0, `x` is 1 to 5, `y` is 6 to 9 and `b` is 10.
#[test]
fn numbers_of_states_do_not_move_with_the_sizes() {
    assert_eq!((CAN.scalars(), Grid::SCALARS, CAN.has_arrays()), (11, 11, true));
    let mut it = grid(3, 2, 6).model;
    assert_eq!(CAN.count_states(&mut it), 7);
    let mut found = Vec::new();
    CAN.each_state(&mut it, |number, x| found.push((number, *x)));
    let present = [(0, 1.0), (1, 10.0), (2, 11.0), (3, 12.0), (6, 20.0), (7, 21.0), (10, 2.0)];
    assert_eq!(found, present);
    for number in 0..12 {
        let expected = present.iter().find(|(of, _)| *of == number).map(|(_, x)| *x);
        assert_eq!(CAN.scalar(&mut it, number).copied(), expected, "{number}");
        let state = CAN.state_of(number).map(|(state, first)| (state.name, first));
        let name = match number {
            0 => Some(("a", 0)),
            1..=5 => Some(("x", 1)),
            6..=9 => Some(("y", 6)),
            10 => Some(("b", 10)),
            _ => None,
        };
        assert_eq!(state, name, "{number}");
    }
    // The model writes the derivatives of present states one after the other.
    let mut dx: Vec<f64> = (100_u8..111).map(f64::from).collect();
    CAN.spread(&mut it, &mut dx);
    let spread: Vec<_> = dx.iter().enumerate().filter(|(_, dx)| !dx.is_nan()).map(|(i, dx)| (i, *dx)).collect();
    let derivatives = [100.0, 101.0, 102.0, 103.0, 104.0, 105.0, 106.0];
    assert_eq!(spread, present.map(|(number, _)| number).into_iter().zip(derivatives).collect::<Vec<_>>());
}

const SCALARS: &[State<Grid>] =
    &[State::new("a", &PER_SECOND, |m: &mut Grid| &mut m.a), State::new("b", &PER_SECOND, |m: &mut Grid| &mut m.b)];

/// Scalar states alone are where the model writes them.
#[test]
fn scalar_states_need_no_spreading() {
    let mut scalar: Capabilities<Grid> = Capabilities::NONE.ContinuousTime();
    let continuous = scalar.continuous.as_mut().unwrap();
    continuous.states = SCALARS;
    assert_eq!((scalar.scalars(), scalar.has_arrays()), (2, false));
    let mut dx = [7.0, 8.0, 9.0];
    scalar.spread(&mut grid(1, 1, 1).model, &mut dx);
    assert_eq!(dx, [7.0, 8.0, 9.0]);
    assert_eq!((Capabilities::<Grid>::NONE.scalars(), Capabilities::<Grid>::NONE.has_arrays()), (0, false));
}

/// The rules that the compiler applies to a table, at run time.
#[test]
fn impossible_sizes_are_refused() {
    fn n(most: f64) -> M {
        M::structural("n", "", |m| &mut m.rows).at_most(most)
    }
    fn m(most: f64) -> M {
        M::structural("m", "", |m| &mut m.rows).at_most(most)
    }
    fn array(count: usize, sized: &'static [&'static str]) -> M {
        M::array_parameter("values", &ONE, "", count, |m| &mut m.values).sized(sized)
    }
    fn refusal<const N: usize>(rows: impl FnOnce() -> [M; N] + UnwindSafe) -> Option<String> {
        let build = move || Table::new(Box::leak(Box::new(numbered(rows())))).len();
        catch_unwind(build).err().map(|panic| panic.downcast_ref::<String>().unwrap().clone())
    }
    assert_eq!(refusal(|| [n(3.0), array(3, &["n"])]), None);
    assert_eq!(refusal(|| [n(1.0), array(1, &["n"])]), None);
    assert_eq!(refusal(|| [n(3.0), m(2.0), array(6, &["n", "m"])]), None);
    assert_eq!(refusal(|| [n(3.0), m(2.0), array(18, &["n", "m", "n"])]), None);
    let product = "values: the product of the maximum sizes is not the number of elements";
    for wrong in [1, 2, 4, 5] {
        assert_eq!(refusal(move || [n(3.0), array(wrong, &["n"])]).as_deref(), Some(product), "{wrong}");
    }
    for wrong in [1, 2, 3, 5, 7] {
        let two = move || [n(3.0), m(2.0), array(wrong, &["n", "m"])];
        assert_eq!(refusal(two).as_deref(), Some(product), "{wrong}");
    }
    let bound = "n: a structural parameter needs an upper bound: at_most";
    assert_eq!(refusal(|| [M::structural("n", "", |m| &mut m.rows)]).as_deref(), Some(bound));
    assert_eq!(refusal(|| [n(0.0)]).as_deref(), Some(bound));
    let nameless = "values: the table has no structural parameter of the name that sizes it";
    assert_eq!(refusal(|| [n(3.0), array(3, &["k"])]).as_deref(), Some(nameless));
    assert_eq!(refusal(|| [n(3.0), array(3, &["n", "values"])]).as_deref(), Some(nameless));
    let no_size = || [M::parameter("p", &ONE, "", |m| &mut m.values[0]).at_most(3.0), array(3, &["p"])];
    assert_eq!(refusal(no_size).as_deref(), Some(nameless));
}
