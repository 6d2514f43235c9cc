//! A trolley on a rail with a hanging load: the physics engine [rapier](https://rapier.rs) as an FMU.
//!
//! A crate is wrapped in four steps: the engine is a field of the model; `initialize` builds its world from the parameters;
//! `advance` passes the inputs, and steps the engine; `output` reads the world. rapier's `PhysicsWorld` is not `Clone`, so
//! the model is exported as `Unsaved`.

use fmu_core::unit::{KILOGRAM, METER, METER_PER_S, NEWTON, RADIAN, SECOND};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Model, Row, Step, Table, integrate, table};
use rapier2d_f64::prelude::*;
use serde::{Deserialize, Serialize};

/// Radius of the load in m.
const RADIUS: f64 = 0.05;

/// Parameters and input, and the engine.
pub struct Crane {
    force: f64,
    m_trolley: f64,
    m_load: f64,
    l: f64,
    angle_start: f64,
    dt: f64,
    world: PhysicsWorld,
    trolley: RigidBodyHandle,
    load: RigidBodyHandle,
}

impl Default for Crane {
    fn default() -> Self {
        Self {
            force: 0.0,
            m_trolley: 100.0,
            m_load: 50.0,
            l: 2.0,
            angle_start: 0.0,
            dt: 1e-3,
            world: PhysicsWorld::default(),
            trolley: RigidBodyHandle::invalid(),
            load: RigidBodyHandle::invalid(),
        }
    }
}

/// The outputs.
#[derive(Clone, Default, Serialize, Deserialize)]
pub struct Outputs {
    /// Position of the trolley in m.
    pub x: f64,
    /// Its velocity in m/s.
    pub v: f64,
    /// Position of the load in m.
    pub x_load: f64,
    /// Angle of the rope in rad.
    pub angle: f64,
}

impl Crane {
    /// Angle of the rope at the start in rad.
    pub fn start_at(&mut self, angle: f64) {
        self.angle_start = angle;
    }

    /// Force on the trolley in N.
    pub fn push(&mut self, force: f64) {
        self.force = force;
    }
}

type V = Row<Block<Crane>>;

impl Model for Crane {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "Crane",
        description: "A trolley with a hanging load, simulated by a physics engine",
        author: "The sensorless-drive developers",
        license: "MIT OR Apache-2.0",
        copyright: "The sensorless-drive developers",
        experiment: Experiment { stop: 10.0, step: 1e-2, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("force", &NEWTON, "Force on the trolley", |m| &mut m.model.force),
        V::output("x", &METER, "Position of the trolley", |m| &mut m.out.x),
        V::output("v", &METER_PER_S, "Velocity of the trolley", |m| &mut m.out.v),
        V::output("x_load", &METER, "Position of the load along the rail", |m| &mut m.out.x_load),
        V::output("angle", &RADIAN, "Angle of the rope from the vertical", |m| &mut m.out.angle),
        V::parameter("m_trolley", &KILOGRAM, "Mass of the trolley", |m| &mut m.model.m_trolley).above(0.0),
        V::parameter("m_load", &KILOGRAM, "Mass of the load", |m| &mut m.model.m_load).above(0.0),
        V::parameter("l", &METER, "Length of the rope, which stays straight", |m| &mut m.model.l).above(0.0),
        V::parameter("angle_start", &RADIAN, "Angle of the rope at the start", |m| &mut m.model.angle_start),
        V::parameter("dt", &SECOND, "Longest step of the engine", |m| &mut m.model.dt).above(0.0),
    ];

    /// A new world: initialization may run several times.
    fn initialize(&mut self) {
        let mut world = PhysicsWorld::default();
        // A small ball: a body without inertia does not turn.
        let of = |mass| MassProperties::new(Vector::ZERO, mass, 0.4 * mass * RADIUS * RADIUS);
        let body = |mass| RigidBodyBuilder::dynamic().additional_mass_properties(of(mass)).can_sleep(false);
        let (sin, cos) = self.angle_start.sin_cos();
        let rail = world.insert_body(RigidBodyBuilder::fixed());
        let trolley = world.insert_body(body(self.m_trolley).lock_rotations());
        let load = body(self.m_load).translation(Vector::new(self.l * sin, -self.l * cos)).rotation(self.angle_start);
        let load = world.insert_body(load);
        world.insert_impulse_joint(rail, trolley, PrismaticJointBuilder::new(Vector::X));
        let rope = RevoluteJointBuilder::new().local_anchor2(Vector::new(0.0, self.l));
        world.insert_impulse_joint(trolley, load, rope);
        (self.world, self.trolley, self.load) = (world, trolley, load);
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        let (trolley, load) = (&self.world.bodies[self.trolley], &self.world.bodies[self.load]);
        let rope = load.translation() - trolley.translation();
        (out.x, out.v) = (trolley.translation().x, trolley.linvel().x);
        (out.x_load, out.angle) = (load.translation().x, rope.x.atan2(-rope.y));
    }

    /// Whole steps of the engine, at most `dt` long.
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        // More than the maximum number is an error: an importer may try a step of a year.
        let n = integrate::substeps(step.h, self.dt)?;
        self.world.integration_parameters.dt = step.h / n;
        let trolley = &mut self.world.bodies[self.trolley];
        trolley.reset_forces(true);
        trolley.add_force(Vector::new(self.force, 0.0), true);
        let mut done = 0.0;
        while done < n {
            self.world.step();
            done += 1.0;
        }
        let x = self.world.bodies[self.trolley].translation().x;
        if x.is_finite() { Ok(()) } else { Err(Fault::value("x", x, "a finite number")) }
    }
}

fmu_export::export!(Crane: Unsaved);
