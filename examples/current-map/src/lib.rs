//! The currents of a machine with saturation, read from a map over its flux linkages; the importer may replace it by a map of
//! another size: arrays with structural parameters, and a terminal that groups them (FMI-LS-STRUCT).

use fmu_core::unit::{AMPERE, WEBER};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Member, Model, Resizable, Row, Step, Table, Terminal, table};
use serde::{Deserialize, Serialize};

/// Maximum number of points on an axis.
const MOST: usize = 31;

/// The map, and the point at which it is read. Tables are row by row: a row for each flux linkage of the d-axis.
#[derive(Clone, Serialize, Deserialize)]
struct CurrentMap {
    n_d: u64,
    n_q: u64,
    psi_d_axis: Vec<f64>,
    psi_q_axis: Vec<f64>,
    i_d_table: Vec<f64>,
    i_q_table: Vec<f64>,
    psi_d: f64,
    psi_q: f64,
}

impl Default for CurrentMap {
    fn default() -> Self {
        let [psi_d_axis, psi_q_axis, i_d_table, i_q_table] = [const { Vec::new() }; 4];
        let mut fresh = Self { n_d: 4, n_q: 5, psi_d_axis, psi_q_axis, i_d_table, i_q_table, psi_d: 0.1, psi_q: 0.0 };
        fresh.fill();
        fresh
    }
}

impl CurrentMap {
    /// Creates a map of the sizes: a magnet of 0.1 Wb, 2 mH and 5 mH, and currents that grow faster where the iron saturates.
    fn fill(&mut self) {
        let [n_d, n_q] = [self.n_d, self.n_q].map(|n| usize::try_from(n).unwrap_or(0));
        self.psi_d_axis = axis(n_d, 0.02, 0.14);
        self.psi_q_axis = axis(n_q, -0.1, 0.1);
        let saturation = |psi: f64| 1.0 + 25.0 * psi * psi;
        let currents =
            |psi_d: f64, psi_q: f64| ((psi_d - 0.1) / 2e-3 * saturation(psi_d), psi_q / 5e-3 * saturation(psi_q));
        let rows = self.psi_d_axis.iter().flat_map(|psi_d| self.psi_q_axis.iter().map(move |psi_q| (*psi_d, *psi_q)));
        (self.i_d_table, self.i_q_table) = rows.map(|(psi_d, psi_q)| currents(psi_d, psi_q)).unzip();
    }

    /// The values of both tables at the flux linkages, interpolated linearly and extrapolated beyond the outermost points.
    fn currents(&self) -> [f64; 2] {
        let ((row, x), (column, y)) = (place(&self.psi_d_axis, self.psi_d), place(&self.psi_q_axis, self.psi_q));
        [&self.i_d_table, &self.i_q_table].map(|table| {
            let at = |i: usize| {
                let values = &table[i * self.psi_q_axis.len() + column..];
                values[0] + y * (values[1] - values[0])
            };
            at(row) + x * (at(row + 1) - at(row))
        })
    }
}

/// `n` points from one value to another.
fn axis(n: usize, from: f64, to: f64) -> Vec<f64> {
    let points: Vec<f64> = (0_u8..).take(n).map(f64::from).collect();
    let last = points.last().copied().unwrap_or(1.0).max(1.0);
    points.into_iter().map(|i| from + i / last * (to - from)).collect()
}

/// The interval of an axis that contains a value, or the outermost one, and the position in it.
fn place(axis: &[f64], x: f64) -> (usize, f64) {
    let i = axis.partition_point(|point| *point <= x).clamp(1, axis.len() - 1) - 1;
    (i, (x - axis[i]) / (axis[i + 1] - axis[i]))
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    i_d: f64,
    i_q: f64,
}

type V = Row<Block<CurrentMap>>;

impl Model for CurrentMap {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "CurrentMap",
        description: "Currents of a machine with saturation from a map over its flux linkages",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers",
        experiment: Experiment { stop: 1.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::structural("map.n_d", "Number of flux linkages in d", |m| &mut m.model.n_d).at_least(2.0).at_most(31.0),
        V::structural("map.n_q", "Number of flux linkages in q", |m| &mut m.model.n_q).at_least(2.0).at_most(31.0),
        V::array_parameter("map.psi_d", &WEBER, "Flux linkages of the d-axis", MOST, |m| &mut m.model.psi_d_axis)
            .sized(&["map.n_d"]),
        V::array_parameter("map.psi_q", &WEBER, "Flux linkages of the q-axis", MOST, |m| &mut m.model.psi_q_axis)
            .sized(&["map.n_q"]),
        V::array_parameter("map.i_d", &AMPERE, "Currents of the d-axis", MOST * MOST, |m| &mut m.model.i_d_table)
            .sized(&["map.n_d", "map.n_q"]),
        V::array_parameter("map.i_q", &AMPERE, "Currents of the q-axis", MOST * MOST, |m| &mut m.model.i_q_table)
            .sized(&["map.n_d", "map.n_q"]),
        V::input("psi_d", &WEBER, "Flux linkage of the d-axis", |m| &mut m.model.psi_d),
        V::input("psi_q", &WEBER, "Flux linkage of the q-axis", |m| &mut m.model.psi_q),
        V::output("i_d", &AMPERE, "Current of the d-axis", |m| &mut m.out.i_d),
        V::output("i_q", &AMPERE, "Current of the q-axis", |m| &mut m.out.i_q),
    ];
    const TERMINALS: &'static [Terminal] = &[Terminal::map(
        "map",
        "Currents over flux linkages",
        &[
            Member::domain("psi_d").of("map.psi_d"),
            Member::domain_input("psi_d_now").of("psi_d"),
            Member::domain("psi_q").of("map.psi_q"),
            Member::domain_input("psi_q_now").of("psi_q"),
            Member::codomain("i_d").of("map.i_d"),
            Member::codomain_output("i_d_now").of("i_d"),
            Member::codomain("i_q").of("map.i_q"),
            Member::codomain_output("i_q_now").of("i_q"),
        ],
    )];

    fn validate(&self) -> Result<(), Fault> {
        for (name, axis) in [("map.psi_d", &self.psi_d_axis), ("map.psi_q", &self.psi_q_axis)] {
            if let Some(i) = axis.windows(2).position(|pair| pair[0] >= pair[1]) {
                let value = axis[i + 1];
                return Err(Fault::value(&format!("{name}[{}]", i + 2), value, format!("greater than {}", axis[i])));
            }
        }
        Ok(())
    }

    fn initialize(&mut self) {}

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        [out.i_d, out.i_q] = self.currents();
    }

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

impl Resizable for CurrentMap {
    fn resize(&mut self) -> Result<(), Fault> {
        self.fill();
        Ok(())
    }
}

fmu_export::export!(CurrentMap: Resizable);
