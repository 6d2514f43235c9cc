//! Arrays of more elements than a table has indices, and other names of variables.
#![allow(missing_docs)]
#![allow(
    clippy::undocumented_unsafe_blocks,
    clippy::borrow_as_ptr,
    reason = "an importer calls C functions, rightly or not"
)]

use fmi::*;
use fmu_core::unit::{DisplayUnit, METER, METER_PER_S, ONE, VOLT};
use fmu_core::{
    Alias, Block, ContinuousTime, Description, Elapsed, Exported, Fault, Info, Items, Model, Part, Row, State, Step,
    Table, integrate, table,
};
use fmu_export::abi::types::*;
use serde::{Deserialize, Serialize};
use std::ffi::CString;
use std::ptr::{null, null_mut};

const SIDE: usize = 31;
const SIZE: usize = SIDE * SIDE;
const FOOT: DisplayUnit = DisplayUnit { name: "ft", factor: 1.0 / 0.3048, offset: 0.0 };

/// A map with its axes: a part of the model.
#[derive(Clone, Serialize, Deserialize)]
struct Map {
    scale: f64,
    values: Vec<f64>,
    marks: Vec<i32>,
}

impl Default for Map {
    fn default() -> Self {
        let values = (0_u16..961).map(|i| f64::from(i) / 8.0).collect();
        Self { scale: 1.0, values, marks: vec![0; 200] }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Machine {
    x: f64,
    map: Map,
    row: Vec<f64>,
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    sum: f64,
}

type V = Row<Block<Machine>>;
type P = Row<Map>;

const MAP: &Table<Map> = table![
    P::parameter("scale", &ONE, "Factor", |m| &mut m.scale),
    P::array_parameter("values", &VOLT, "A value for each point", SIZE, |m| &mut m.values)
        .shape(&[SIDE, SIDE])
        .at_least(-1.0),
    P::list_parameter("marks", "A mark for each point", 200, &Items(|m: &mut Map| &mut m.marks)),
];

impl Model for Machine {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "Machine", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::part("map.", &Part { table: MAP, lens: |m: &mut Block<Machine>| &mut m.model.map }),
        V::array_local("row", &VOLT, "First row, five times", 155, |m| &mut m.model.row),
        V::state("x", &METER, "State", |m| &mut m.model.x).aliases(&[Alias {
            name: "x_ft",
            description: "In feet",
            display: Some(FOOT)
        }]),
        V::output("sum", &VOLT, "Sum of the map", |m| &mut m.out.sum),
    ];
    fn initialize(&mut self) {
        self.row = self.map.values.iter().cycle().take(155).copied().collect();
    }
    fn output(&self, _: Elapsed, out: &mut Outputs) {
        out.sum = self.map.scale * self.map.values.iter().sum::<f64>();
    }
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 1>(self, step, 1.0)
    }
}

impl ContinuousTime for Machine {
    const STATES: &'static [State<Self>] = &[State::new("x", &METER_PER_S, |m| &mut m.x)];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = self.map.values[0];
        Ok(())
    }
}

fmu_export::export!(Machine: ContinuousTime);

const SCALE: u32 = 1;
const X: u32 = 2;
const SUM: u32 = 3;
const DER_X: u32 = 4;
const VALUES: u32 = 5;
const MARKS: u32 = VALUES + 961;
const ROW: u32 = MARKS + 200;

fn entered(version: u8) -> InstancePointer {
    let token = CString::new(This::TOKEN.as_str()).unwrap();
    let (name, token, no) = (c"it".as_ptr(), token.as_ptr(), Fmi3Boolean(0));
    unsafe {
        if version == 2 {
            let it = fmi2Instantiate(name, 1, token, null(), null(), Fmi2Boolean(0), Fmi2Boolean(0));
            assert_eq!(fmi2SetupExperiment(it, Fmi2Boolean(0), 0.0, 0.0, Fmi2Boolean(0), 0.0), 0);
            assert_eq!(fmi2EnterInitializationMode(it), 0);
            return it;
        }
        let it = fmi3InstantiateCoSimulation(name, token, null(), no, no, no, no, null(), 0, null_mut(), None, None);
        assert_eq!(fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0), 0);
        it
    }
}

/// Wide arrays come after derivatives, in the order of the table; nothing before them moves.
#[test]
fn their_references_follow_all_others() {
    let d = Description::exported::<This>().unwrap();
    let names: Vec<_> = d.variables.iter().map(|v| (v.name.as_str(), v.value_reference)).collect();
    assert_eq!(
        names,
        [
            ("map.scale", SCALE),
            ("x", X),
            ("sum", SUM),
            ("der(x)", DER_X),
            ("map.values", VALUES),
            ("map.marks", MARKS),
            ("row", ROW)
        ]
    );
    let values = d.variable("map.values").unwrap();
    assert_eq!((values.shape.clone(), values.start.as_ref().unwrap().len()), (vec![SIDE, SIDE], SIZE));
    assert_eq!(d.variable("sum").unwrap().initial_dependencies, Some(vec![SCALE, VALUES, MARKS]));
    assert_eq!(d.variable("der(x)").unwrap().dependencies, Some(vec![]), "the map is fixed");
    let alias = &d.variable("x").unwrap().aliases[0];
    assert_eq!((alias.name.as_str(), alias.display.as_ref().unwrap().0.as_str()), ("x_ft", "ft"));
}

#[test]
fn all_elements_cross_in_one_call() {
    let it = entered(3);
    let mut values = vec![0.0; SIZE];
    let (mut sum, new) = (0.0, vec![0.5; SIZE]);
    unsafe {
        assert_eq!(fmi3GetFloat64(it, &VALUES, 1, values.as_mut_ptr(), SIZE), 0);
        assert_eq!((values[1].to_bits(), values[960].to_bits()), (0.125_f64.to_bits(), 120.0_f64.to_bits()));
        assert_eq!(fmi3SetFloat64(it, [SCALE, VALUES].as_ptr(), 2, [&[2.0], &new[..]].concat().as_ptr(), SIZE + 1), 0);
        assert_eq!(fmi3GetFloat64(it, &SUM, 1, &mut sum, 1), 0);
        assert_eq!(sum.to_bits(), 961.0_f64.to_bits());
        let mut row = vec![0.0; 155];
        assert_eq!(fmi3GetFloat64(it, &ROW, 1, row.as_mut_ptr(), 155), 0);
        assert!(row.iter().all(|x| x.to_bits() == 0.5_f64.to_bits()));
        let marks: Vec<i32> = (0..200).collect();
        let mut back = vec![0; 200];
        assert_eq!(fmi3SetInt32(it, &MARKS, 1, marks.as_ptr(), 200), 0);
        assert_eq!(fmi3GetInt32(it, &MARKS, 1, back.as_mut_ptr(), 200), 0);
        assert_eq!(back, marks);
        fmi3FreeInstance(it);
    }
}

/// The last of 961 values is out of range, a reference leads into the array, a count is wrong: nothing has changed.
#[test]
fn what_is_wrong_changes_nothing() {
    let mut wrong = vec![0.5; SIZE];
    wrong[SIZE - 1] = -2.0;
    let right = vec![0.5; SIZE];
    for (reference, values, n) in [
        (VALUES, &wrong, SIZE),
        (VALUES, &right, SIZE - 1),
        (VALUES + 1, &right, SIZE),
        (ROW, &right, 155),
        (ROW + 155, &right, 1),
        (u32::MAX, &right, 1),
    ] {
        let it = entered(3);
        let mut values_after = vec![0.0; SIZE];
        unsafe {
            assert_eq!(fmi3SetFloat64(it, &reference, 1, values.as_ptr(), n), 3, "{reference} {n}");
            assert_eq!(fmi3GetFloat64(it, &VALUES, 1, values_after.as_mut_ptr(), SIZE), 0);
            fmi3FreeInstance(it);
        }
        assert_eq!(values_after[960].to_bits(), 120.0_f64.to_bits());
    }
}

#[test]
fn fmi_2_has_a_variable_for_each_element() {
    let it = entered(2);
    let (mut x, last) = (0.0, VALUES + 960);
    unsafe {
        assert_eq!(fmi2GetReal(it, &last, 1, &mut x), 0);
        assert_eq!(x.to_bits(), 120.0_f64.to_bits());
        assert_eq!(fmi2SetReal(it, [last, SCALE].as_ptr(), 2, [121.0, 1.0].as_ptr()), 0);
        assert_eq!(fmi2GetReal(it, &SUM, 1, &mut x), 0);
        assert_eq!(x.to_bits(), (961.0 * 60.0_f64 + 1.0).to_bits());
        let mut mark = Fmi2Integer(7);
        assert_eq!(fmi2GetInteger(it, &(MARKS + 199), 1, &mut mark), 0);
        assert_eq!(mark, Fmi2Integer(0));
        assert_eq!(fmi2GetReal(it, &(ROW + 155), 1, &mut x), 3);
        fmi2FreeInstance(it);
    }
}
