//! A machine from a run of the self-commissioning: the outputs `identified_*` in the last row of a recording of `fmu simulate`.
//!
//! An output counts under any name of the instance: `identified_R_s`, `drive.identified_R_s`.

use super::machine_file::{Content, number};
use super::verdict::Quantity;
use super::{Options, Ratings, SCALE};
use crate::csv::Columns;
use crate::error::{Error, Result, WithContext, bail, ensure};
use drive::control::commission::{CommissionFault, CommissionState, LIMIT_DEAD, LIMIT_L, LIMIT_R, LIMIT_SATURATION};
use fmu_core::Enumerated;

/// The quantities of a machine file with their units, maximum half-widths, and advice for a refused one.
const FILE: [(&str, &str, Option<f64>, &str); 9] = [
    ("R_s", "Ohm", Some(LIMIT_R), "commission with more current"),
    ("L_d", "H", Some(LIMIT_L), LOOPS),
    ("L_q", "H", Some(LIMIT_L), LOOPS),
    ("psi_M", "Wb", None, "commission.mode Spin, or --given psi_M=..., or a record of the running drive"),
    ("J", "kg.m2", None, "commission.mode Spin, or --given J=..., or a record of the running drive"),
    ("B", "N.m.s/rad", None, FRICTION),
    ("tau_coulomb", "N.m", None, FRICTION),
    ("u_dead", "V", Some(LIMIT_DEAD), "an inverter without dead time has none"),
    ("i_zero", "A", Some(LIMIT_DEAD), "fmu tune has a rule for it"),
];

/// The others: remarks of the file.
const MORE: [(&str, &str, Option<f64>, &str); 6] = [
    ("L_d_plus", "H", Some(LIMIT_L), LOOPS),
    ("L_d_minus", "H", Some(LIMIT_L), LOOPS),
    ("L_q_chord", "H", Some(LIMIT_L), LOOPS),
    ("s_2", "A/Wb2", Some(LIMIT_SATURATION), SATURATION),
    ("s_3", "A/Wb3", Some(LIMIT_SATURATION), SATURATION),
    ("tau_friction", "N.m", None, FRICTION),
];

const FRICTION: &str = "commission.mode Spin measures the sum of both, tau_friction";

const LOOPS: &str = "the loops of current do not fit or do not agree: block the rotor, or commission with less current";

const SATURATION: &str = "up to commission.i the machine saturates too little to measure it, or the loops do not fit";

/// Currents, voltages and motion that a page shows, with their units.
const SHOWN: [(&str, &str); 8] = [
    ("commission_state", ""),
    ("i_a", "A"),
    ("i_b", "A"),
    ("i_c", "A"),
    ("u_a", "V"),
    ("u_b", "V"),
    ("u_c", "V"),
    ("speed", "rad/s"),
];

/// A commissioning, as its run shows it.
#[derive(Clone, Debug)]
pub struct Commissioned {
    /// The quantities, in the order of a motor file.
    pub values: Vec<Quantity>,
    /// Quantities that a motor file does not contain.
    pub more: Vec<Quantity>,
    /// Why it has stopped.
    pub fault: CommissionFault,
    /// Ratings, and whether they are given.
    pub ratings: Ratings,
    /// Pole pairs.
    pub n_p: i32,
    /// Notes for the reader.
    pub notes: Vec<String>,
    /// Times in s, and the signals over them with their names and units.
    pub seen: (Vec<f64>, Vec<Signal>),
}

/// A signal of the run: its name, its unit and its values.
pub type Signal = (&'static str, &'static str, Vec<f64>);

/// The text of an enumeration's item.
fn about<E: Enumerated>(value: E) -> &'static str {
    E::ENUMERATION.items.iter().find(|item| item.value == value.value()).map_or("", |item| item.description)
}

/// Reads the run `text` of `file`.
///
/// # Errors
/// An option is wrong, the file does not contain a commissioning, or not its end.
pub fn commissioned(text: &str, file: &str, options: &Options) -> Result<Commissioned> {
    options.check()?;
    let Some(n_p) = options.n_p else {
        bail!("--n-p is missing: give the number of pole pairs; a commissioning does not measure it");
    };
    let wanted = |name: &str| {
        let known = |list: &[(&str, &str)]| list.iter().any(|(known, _)| *known == name);
        ["time", "u_dc", "commission_fault"].contains(&name) || name.starts_with("identified_") || known(&SHOWN)
    };
    let table = Columns::parse_some(text, file, |header| wanted(bare(header)))?;
    let find = |name: &str| -> Result<Option<usize>> {
        let mut places = table.names().iter().enumerate().filter(|(_, header)| bare(header) == name);
        let first = places.next();
        if let (Some((_, one)), Some((_, other))) = (first, places.next()) {
            bail!("{file}: two columns contain {name}: {one} and {other}; record one of them");
        }
        Ok(first.map(|(place, _)| place))
    };
    let column = |name: &str| {
        find(name)?.with_context(|| {
        format!("{file}: has no column {name}: record all outputs of a drive or controller whose commission.mode is Standstill or Spin")
    })
    };
    let Some((line, last)) = table.rows().last() else { bail!("{file}: has no row") };
    let item = |name: &str| -> Result<i32> {
        let x = last[column(name)?];
        #[expect(clippy::float_cmp, reason = "the number of an item is whole")]
        let whole = x == x.round() && x.abs() < 1e3;
        ensure!(whole, "{file}:{line}:{name}: {x} is not the number of an item");
        Ok(x as i32)
    };
    let unknown = |name: &str, n: i32| format!("{file}:{line}:{name}: {n} is not the number of an item");
    let (state, fault) = (item("commission_state")?, item("commission_fault")?);
    let state = CommissionState::of(state).with_context(|| unknown("commission_state", state))?;
    let fault = CommissionFault::of(fault).with_context(|| unknown("commission_fault", fault))?;
    if !matches!(state, CommissionState::Done | CommissionState::Refused) {
        let remedy = match state {
            CommissionState::Idle => "set commission.mode, and commission_start while the drive is enabled",
            _ => "record until commission_state is Done or Refused",
        };
        bail!("{file}:{line}: the commissioning has not ended, commission_state = {}: {remedy}", state.name());
    }
    let quantity =
        |&(name, unit, limit, remedy): &(&'static str, &'static str, Option<f64>, &str)| -> Result<Quantity> {
            let given = options.given.iter().find(|(known, _)| known == name);
            if let Some(&(_, value)) = given {
                return Ok(Quantity { name, unit, value, half_width: f64::NAN, refused: None });
            }
            let value = find(&format!("identified_{name}"))?.map_or(0.0, |place| last[place]);
            let half_width = find(&format!("identified_{name}_u"))?.map_or(1.0, |place| last[place]);
            let refused = (half_width >= 1.0 || half_width.is_nan()).then(|| match limit {
                _ if fault != CommissionFault::None => format!("commission_fault = {}: {}", fault.name(), about(fault)),
                Some(limit) => format!("the half-width is above {} %: {remedy}", 100.0 * limit),
                None => format!("not measured, or not to the width of its limit: {remedy}"),
            });
            Ok(Quantity { name, unit, value, half_width, refused })
        };
    column("identified_R_s")?;
    for (name, _) in &options.given {
        let known = || FILE.iter().map(|(known, ..)| *known).collect::<Vec<_>>().join(", ");
        ensure!(FILE.iter().any(|(k, ..)| k == name), "--given {name}: expected one of {}", known());
    }
    let values =
        |name: &str| Ok::<_, Error>(find(name)?.map(|place| table.rows().iter().map(move |(_, row)| row[place])));
    let mut greatest = 0.0_f64;
    for name in ["i_a", "i_b", "i_c"] {
        greatest = values(name)?.into_iter().flatten().fold(greatest, |most, i| most.max(i.abs()));
    }
    let seen = SHOWN.iter().filter_map(|&(name, unit)| match values(name) {
        Ok(found) => found.map(|of| Ok((name, unit, of.collect()))),
        Err(e) => Some(Err(e)),
    });
    let seen: Vec<Signal> = seen.collect::<Result<_>>()?;
    let rating = |given: Option<f64>, other: f64| (given.unwrap_or(other), given.is_some());
    Ok(Commissioned {
        values: FILE.iter().map(quantity).collect::<Result<_>>()?,
        more: MORE.iter().map(quantity).collect::<Result<_>>()?,
        fault,
        ratings: Ratings {
            current: rating(options.current, greatest),
            speed: rating(options.speed, 0.0),
            torque: rating(options.torque, 0.0),
            u_dc: match options.u_dc {
                None => find("u_dc")?.map(|place| last[place]),
                given => given,
            },
        },
        n_p,
        notes: vec![
            SCALE.into(),
            "R_s includes the mean resistance of a transistor and a diode, at the temperature of the run".into(),
        ],
        seen: (values("time")?.with_context(|| format!("{file}: has no column time"))?.collect(), seen),
    })
}

/// A header without the name of the instance.
fn bare(header: &str) -> &str {
    header.rsplit('.').next().unwrap_or(header)
}

impl Commissioned {
    /// Text of the machine file.
    pub fn text(&self, name: &str, source: &str) -> String {
        let remark = |v: &Quantity| match &v.refused {
            None => format!("{} = {}  # {}, +-{:.2} %", v.name, number(v.value), v.unit, 100.0 * v.half_width),
            Some(why) => format!("{} = ...  # refused: {why}", v.name),
        };
        let Self { notes, n_p, values, ratings, .. } = self;
        let first = "flux linkage over current at 0.9 commission.i, the saturation of the d-axis, and the friction at 0.3 commission.speed";
        let remarks = [first.to_owned()].into_iter().chain(self.more.iter().map(remark)).collect();
        let from = "a commissioning";
        Content { from, notes, n_p: *n_p, values, ratings: *ratings, remarks }.text(name, source)
    }

    /// The result for other programs: values with unit, relative half-width and reason.
    pub fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "values": self.values.iter().chain(&self.more).map(Quantity::json).collect::<serde_json::Map<_, _>>(),
            "n_p": self.n_p,
            "rating": self.ratings.json(),
            "u_dc": self.ratings.u_dc,
            "commission_fault": self.fault.name(),
            "notes": self.notes,
        })
    }
}
