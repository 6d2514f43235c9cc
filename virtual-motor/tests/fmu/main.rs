//! Random calls on the C functions beside the FMU `PmsmPlant`, called as an importer calls it: the same state, bit for bit, and
//! refused calls change nothing. `VM_CALLS` sets the number of calls, 1e5 by default, `VM_SEED` selects others.
#![allow(missing_docs, clippy::undocumented_unsafe_blocks)]

#[path = "../common/mod.rs"]
mod common;
mod importer;

use common::{Refused, adc, advance, advance_gates, create, destroy, encoder, find, get, get_adc, hall, set, time};
use drive::PmsmPlant;
use fmu_core::draw::Draw;
use fmu_core::{Causality, Kind, Model};
use importer::Plant;
use std::collections::BTreeMap;
use virtual_motor::ErrorCode;
use virtual_motor::pool::MotorId;

fmu_export::export!(drive::PmsmPlant: ContinuousTime + Events + Differentiable + CompletedSteps + Warns);

/// Period of the carrier in s.
const T: f64 = 50e-6;

/// Outputs that every advance compares.
const SHOWN: [&str; 12] =
    ["psi_d", "psi_q", "speed", "angle", "i_a", "i_b", "i_c", "tau_e", "p_in", "energy_loss", "energy_in", "T_winding"];

/// All lower gates.
const LOWER: u32 = 0x2a;

fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| text.parse().unwrap())
}

/// A motor with its FMU.
#[expect(clippy::struct_excessive_bools, reason = "independent properties")]
struct Twin {
    id: MotorId,
    plant: Plant,
    begun: bool,
    t: f64,
    /// Number of whole carrier periods, if the motor is at the beginning of one.
    period: Option<u32>,
    /// Voltage references of the last duty cycles.
    u: [f64; 3],
    switched: bool,
    dead: bool,
    /// No zero sequence: the carrier has the duty cycles as given.
    plain: bool,
    /// The devices have no drop: no search for the zero of a current splits a period, which would round its instants.
    ideal: bool,
}

struct World {
    draw: Draw,
    twins: Vec<Twin>,
    /// A motor without FMU, for gate signals that an FMU cannot have.
    loose: MotorId,
    gone: Vec<MotorId>,
    /// Numbers of variables by their names.
    numbers: BTreeMap<String, u32>,
    /// Every real scalar that is not an input.
    all: Vec<u32>,
    /// How often each kind of call took place.
    counts: BTreeMap<&'static str, u32>,
}

fn code<T: std::fmt::Debug>(result: Result<T, Refused>) -> i32 {
    result.unwrap_err().0
}

impl World {
    fn new(seed: u64) -> Self {
        let (mut numbers, mut all) = (BTreeMap::new(), Vec::new());
        for index in PmsmPlant::TABLE.indices() {
            let (name, meta, _) = PmsmPlant::TABLE.locate(index).unwrap();
            if meta.dimension.is_some() {
                continue;
            }
            let reference = find(&name).unwrap();
            // What the FMU calls its value reference.
            assert_eq!(reference as usize, index + 1, "{name}");
            if matches!(meta.kind, Kind::Real(_)) && meta.causality != Causality::Input {
                all.push(reference);
            }
            numbers.insert(name, reference);
        }
        assert!(all.len() >= 80, "{}", all.len());
        let loose = create().unwrap();
        set(loose, numbers["inverter.dead_time"], 1e-6).unwrap();
        let (draw, twins, gone, counts) = (Draw(seed), Vec::new(), Vec::new(), BTreeMap::new());
        Self { draw, twins, loose, gone, numbers, all, counts }
    }

    fn of(&self, name: &str) -> u32 {
        self.numbers[name]
    }

    /// Compares these variables of motor and FMU.
    fn compare(&self, k: usize, references: &[u32]) {
        let twin = &self.twins[k];
        let mut values = vec![0.0; references.len()];
        twin.plant.get(references, &mut values);
        for (&reference, value) in references.iter().zip(values) {
            let own = get(twin.id, reference).unwrap();
            let name = virtual_motor::variables::name(reference).unwrap();
            assert_eq!(own.to_bits(), value.to_bits(), "{name} = {own}, in the FMU {value}, at {} s", twin.t);
        }
    }

    /// Compares the most important outputs, and sometimes all.
    fn compare_some(&mut self, k: usize) {
        if self.draw.below(100) == 0 {
            self.compare(k, &self.all);
        } else {
            let shown = SHOWN.map(|name| self.of(name));
            self.compare(k, &shown);
        }
    }

    fn set(&self, k: usize, name: &str, value: f64) {
        set(self.twins[k].id, self.of(name), value).unwrap();
        self.twins[k].plant.set(self.of(name), value);
    }

    fn choose(&self, k: usize, name: &str, item: i32) {
        set(self.twins[k].id, self.of(name), item.into()).unwrap();
        self.twins[k].plant.set_enumeration(self.of(name), item.into());
    }

    fn create(&mut self) {
        let (switched, dead, plain) = (self.draw.below(4) > 0, self.draw.below(3) == 0, self.draw.below(4) > 0);
        let (id, plant) = (create().unwrap(), Plant::new());
        let (begun, t, period, u, ideal) = (false, 0.0, Some(0), [0.0; 3], self.draw.below(2) == 0);
        self.twins.push(Twin { id, plant, begun, t, period, u, switched, dead, plain, ideal });
        let k = self.twins.len() - 1;
        self.set(k, "inverter.T_pwm", T);
        self.choose(k, "inverter.mode", if switched { 2 } else { 1 });
        let other = self.draw.of(&[1, 3, 4, 5]);
        self.choose(k, "inverter.zero_sequence", if plain { 2 } else { other });
        let update = self.draw.of(&[1, 2]);
        self.choose(k, "inverter.update", update);
        if dead {
            self.set(k, "inverter.dead_time", 1e-6);
        }
        if !ideal {
            for (name, value) in [("inverter.u_diode", 0.9), ("inverter.r_transistor", 0.05), ("inverter.E_sw", 1e-4)] {
                self.set(k, name, value);
            }
        }
        if self.draw.below(3) == 0 {
            self.choose(k, "thermal.mode", 2);
            for name in ["thermal.C_winding", "thermal.C_stator", "thermal.C_rotor", "thermal.C_inverter"] {
                self.set(k, name, 10.0);
            }
            self.set(k, "winding.alpha", 3.93e-3);
        }
        if self.draw.below(2) == 0 {
            self.set(k, "motor.L_q", 9e-3);
            self.set(k, "mechanics.k_w", 1e-6);
        }
        if self.draw.below(4) == 0 {
            self.set(k, "saturation.s_3", 500.0);
            self.set(k, "saturation.s_dq", 100.0);
        }
        let (speed, theta) = (self.draw.around(200.0), self.draw.around(3.0));
        self.set(k, "initial.speed", speed);
        self.set(k, "initial.theta_e", theta);
        self.compare(k, &self.all);
    }

    /// A time to advance to, and the number of carrier periods until then.
    fn target(&mut self, k: usize) -> (f64, Option<u32>) {
        let (t, at) = (self.twins[k].t, self.twins[k].period);
        if let (Some(at), true) = (at, self.draw.below(2) == 0) {
            return (f64::from(at + 1) * T, Some(at + 1));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some periods")]
        let next = at.map_or((t / T).floor() as u32, |at| at) + 1;
        match self.draw.below(8) {
            0..4 => (f64::from(next) * T, Some(next)),
            4 => (t, at),
            5 => (t + self.draw.scaled(1e-9, 1e-5), None),
            _ => (t + self.draw.between(0.1, 3.0) * T, None),
        }
    }

    /// An advance with duty cycles.
    fn duties(&mut self, k: usize) {
        let (t, period) = self.target(k);
        let d = [0, 1, 2]
            .map(|_| if self.draw.below(4) > 0 { self.draw.share() } else { self.draw.of(&[0.0, 0.25, 0.5, 1.0]) });
        let enable = self.draw.below(20) > 0;
        advance(self.twins[k].id, t, d, enable).unwrap();
        let mut u_dc = [0.0];
        self.twins[k].plant.get(&[self.of("u_dc")], &mut u_dc);
        self.twins[k].u = d.map(|d| (d - 0.5) * u_dc[0]);
        self.references(k, self.twins[k].u);
        self.twins[k].plant.set_boolean(self.of("enable"), enable);
        self.reach(k, t, period);
        self.compare_some(k);
    }

    /// Voltage references of the FMU.
    fn references(&self, k: usize, u: [f64; 3]) {
        for (name, u) in ["u_a", "u_b", "u_c"].into_iter().zip(u) {
            self.twins[k].plant.set(self.of(name), u);
        }
    }

    /// An advance with gate signals that the FMU can have, too.
    fn gates(&mut self, k: usize) {
        let twin = &self.twins[k];
        let (id, dead, plain) = (twin.id, twin.dead, twin.plain && twin.ideal);
        if !twin.switched {
            let t = twin.t + T;
            assert_eq!(code(advance_gates(id, t, LOWER)), ErrorCode::NeedsSwitched as i32);
            return;
        }
        match (self.draw.below(3), twin.period) {
            // Duty cycles of 0 and 1 over a period are gates that stay.
            (0, Some(at)) if plain && !dead => {
                let (t, upper) = (f64::from(at + 1) * T, [0, 1, 2].map(|_| self.draw.below(2) == 0));
                let gates: u32 = (0..3).map(|x| if upper[x] { 1 << (2 * x) } else { 2 << (2 * x) }).sum();
                advance_gates(id, t, gates).unwrap();
                let mut u_dc = [0.0];
                self.twins[k].plant.get(&[self.of("u_dc")], &mut u_dc);
                self.references(k, upper.map(|upper| if upper { 0.5 * u_dc[0] } else { -0.5 * u_dc[0] }));
                self.twins[k].plant.set_boolean(self.of("enable"), true);
                self.reach(k, t, Some(at + 1));
                // The carrier of the motor has kept its references.
                self.references(k, self.twins[k].u);
            }
            // A short circuit.
            (1, _) if !dead => {
                let (t, period) = self.target(k);
                advance_gates(id, t, LOWER).unwrap();
                self.twins[k].plant.set_boolean(self.of("asc"), true);
                self.reach(k, t, period);
                self.twins[k].plant.set_boolean(self.of("asc"), false);
            }
            _ => {
                let (t, period) = self.target(k);
                advance_gates(id, t, 0).unwrap();
                self.twins[k].plant.set_boolean(self.of("enable"), false);
                self.reach(k, t, period);
            }
        }
        self.compare_some(k);
    }

    /// The FMU follows to the time `t` (s).
    fn reach(&mut self, k: usize, t: f64, period: Option<u32>) {
        let twin = &mut self.twins[k];
        if !twin.begun {
            twin.plant.start();
        }
        if t > twin.t {
            twin.plant.step(twin.t, t - twin.t);
        }
        (twin.begun, twin.t, twin.period) = (true, t, period);
        assert_eq!(time(twin.id).unwrap().to_bits(), t.to_bits());
    }

    /// Any gate signals, on a motor without FMU.
    fn any_gates(&mut self) {
        let (gates, t) = (u32::try_from(self.draw.below(0x50)).unwrap(), time(self.loose).unwrap());
        let h = self.draw.scaled(1e-8, 1e-4);
        let speed = get(self.loose, self.of("speed")).unwrap();
        let result = advance_gates(self.loose, t + h, gates);
        let both = (0..3).any(|x| gates >> (2 * x) & 3 == 3);
        if gates > 0x3f {
            assert_eq!(code(result), ErrorCode::BadValue as i32);
        } else if both {
            assert_eq!(code(result), ErrorCode::ShootThrough as i32);
        } else {
            result.unwrap();
            assert!(get(self.loose, self.of("speed")).unwrap().is_finite());
            return;
        }
        assert_eq!(time(self.loose).unwrap().to_bits(), t.to_bits());
        assert_eq!(get(self.loose, self.of("speed")).unwrap().to_bits(), speed.to_bits());
    }

    /// A value that may change at any time.
    fn input(&mut self, k: usize) {
        match self.draw.below(3) {
            0 => {
                let value = self.draw.between(20.0, 400.0);
                self.set(k, "u_dc", value);
            }
            1 => {
                let value = self.draw.around(3.0);
                self.set(k, "tau_load", value);
            }
            _ => {
                let value = self.draw.between(0.5, 4.0);
                self.set(k, "motor.R_s", value);
            }
        }
    }

    /// A call that is refused, with its code.
    fn refused(&mut self, k: usize) {
        let Twin { id, t, begun, .. } = self.twins[k];
        let nan = f64::NAN;
        let later = t + T;
        let (wrong, expected) = match self.draw.below(16) {
            0 => (advance(id, nan, [0.5; 3], true), ErrorCode::BadTime),
            1 => (advance(id, f64::INFINITY, [0.5; 3], true), ErrorCode::BadTime),
            2 => (advance(id, t - 1e-7, [0.5; 3], true), ErrorCode::BadTime),
            3 => (advance(id, later, [0.5, nan, 0.5], true), ErrorCode::BadValue),
            4 => (advance(id, later, [0.5, 0.5, 1.0 + 1e-9], true), ErrorCode::BadValue),
            5 => (advance(id, later, [-1e-9, 0.5, 0.5], false), ErrorCode::BadValue),
            6 => (advance_gates(id, later, 0x40), ErrorCode::BadValue),
            7 => (advance_gates(id, later, 0x0c), ErrorCode::ShootThrough),
            8 => (set(id, self.of("u_dc"), -1.0), ErrorCode::BadValue),
            9 => (set(id, self.of("motor.R_s"), nan), ErrorCode::BadValue),
            10 => (set(id, self.of("speed"), 1.0), ErrorCode::NotSettable),
            11 => (set(id, self.of("enable"), 1.0), ErrorCode::NotSettable),
            12 => (set(id, 0, 1.0), ErrorCode::UnknownVariable),
            13 => (get(id, u32::MAX).map(drop), ErrorCode::UnknownVariable),
            14 if begun => (set(id, self.of("motor.L_d"), 5e-3), ErrorCode::NotSettable),
            15 if begun => {
                // The torque makes the shaft too fast within the step.
                let tau = self.of("tau_load");
                let before = get(id, tau).unwrap();
                set(id, tau, -1e12).unwrap();
                let failed = advance(id, t + 3.0 * T, [0.5; 3], true);
                set(id, tau, before).unwrap();
                (failed, ErrorCode::Failed)
            }
            _ => (find("motor.r_s").map(drop), ErrorCode::UnknownVariable),
        };
        assert_eq!(code(wrong), expected as i32);
        assert_eq!(time(id).unwrap().to_bits(), t.to_bits());
        self.compare_some(k);
    }

    /// A call with the id of no motor.
    fn stranger(&mut self) {
        let number = |draw: &mut Draw| u32::try_from(draw.below(600)).unwrap();
        let id = match self.draw.below(3) {
            0 => MotorId::default(),
            1 => MotorId { index: number(&mut self.draw), generation: 1_000_000 + number(&mut self.draw) },
            _ => {
                let place = self.draw.below(self.gone.len().max(1));
                self.gone.get(place).copied().unwrap_or_default()
            }
        };
        let result = match self.draw.below(8) {
            0 => destroy(id),
            1 => set(id, self.of("u_dc"), 1.0),
            2 => get(id, self.of("u_dc")).map(drop),
            3 => advance(id, 1.0, [0.5; 3], true),
            4 => advance_gates(id, 1.0, 0),
            5 => adc(id).map(drop),
            6 => encoder(id).map(drop),
            _ => time(id).map(drop),
        };
        assert_eq!(code(result), ErrorCode::BadId as i32, "{id:?}");
    }

    /// The sensors show the FMU's outputs.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts")]
    fn sensors(&mut self, k: usize) {
        let twin = &self.twins[k];
        let mut shown = [0.0; 6];
        let references = ["i_a", "i_b", "i_c", "u_dc", "angle", "theta_e"].map(|name| self.of(name));
        twin.plant.get(&references, &mut shown);
        let (setup, counts) = (get_adc(twin.id).unwrap(), adc(twin.id).unwrap());
        let count = |gain: f64, offset: f64, x: f64| (offset + gain * x).round().clamp(0.0, 4095.0);
        for (i, found) in shown.into_iter().zip(counts.i) {
            let expected = count(setup.current_gain, setup.current_offset, i);
            assert!((expected - f64::from(found)).abs() < 1e-9, "{i} A: {expected}, not {counts:?}");
        }
        let expected = count(setup.voltage_gain, setup.voltage_offset, shown[3]);
        assert!((expected - f64::from(counts.u_dc)).abs() < 1e-9, "{expected}, not {counts:?}");
        let turn = (shown[4] / std::f64::consts::TAU).rem_euclid(1.0);
        assert!(encoder(twin.id).unwrap().count.abs_diff((turn * 4096.0) as u32) <= 1);
        let sector = (shown[5] / std::f64::consts::FRAC_PI_3).floor().rem_euclid(6.0) as usize;
        assert_eq!(hall(twin.id).unwrap(), [5, 1, 3, 2, 6, 4][sector]);
    }

    fn call(&mut self) {
        let k = self.draw.below(self.twins.len().max(1));
        let kind = match self.draw.below(100) {
            _ if self.twins.is_empty() => "create",
            0 if self.twins.len() < 6 => "create",
            1 if self.twins.len() > 2 => "destroy",
            2..12 => "input",
            12..22 => "refused",
            22..30 => "stranger",
            30..38 => "any gates",
            38..46 => "sensors",
            46..62 => "gates",
            _ => "duties",
        };
        *self.counts.entry(kind).or_default() += 1;
        match kind {
            "create" => self.create(),
            "destroy" => {
                let twin = self.twins.swap_remove(k);
                destroy(twin.id).unwrap();
                self.gone.push(twin.id);
            }
            "input" => self.input(k),
            "refused" => self.refused(k),
            "stranger" => self.stranger(),
            "any gates" => self.any_gates(),
            "sensors" => self.sensors(k),
            "gates" => self.gates(k),
            _ => self.duties(k),
        }
    }
}

#[test]
fn random_calls_have_the_state_of_the_fmu() {
    let mut world = World::new(number("VM_SEED", 1));
    for _ in 0..number("VM_CALLS", 100_000) {
        world.call();
    }
    println!("{:?}", world.counts);
    assert_eq!(world.counts.len(), 9, "{:?}", world.counts);
}
