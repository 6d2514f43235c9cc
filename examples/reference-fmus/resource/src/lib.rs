//! Resource of the Reference-FMUs: the first character of a file.

use fmu_core::{
    Block, Elapsed, Events, Experiment, Fault, Info, Model, Next, Outcome, Resource, Row, Step, Table, table,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

#[derive(Clone, Default, Serialize, Deserialize)]
struct Character {
    file: Resource<u8>,
}

type V = Row<Block<Character>>;

impl Model for Character {
    type Outputs = i32;
    const INFO: Info = Info {
        name: "Resource",
        description: "This model loads data from a resource file",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { step: 1.0, fixed_step: Some(1.0), ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> =
        table![V::integer_output("y", "Value of the first character in resources/y.txt", |m| &mut m.out)];

    fn load(&mut self, resources: Option<&Path>) -> Result<(), Fault> {
        let file = resources.ok_or_else(|| Fault::new("y.txt is in the FMU's resources"))?.join("y.txt");
        let wrong = |why: &dyn std::fmt::Display| Fault::new(format!("{}: {why}", file.display()));
        let bytes = std::fs::read(&file).map_err(|e| wrong(&e))?;
        self.file = (*bytes.first().ok_or_else(|| wrong(&"is empty"))?).into();
        Ok(())
    }

    fn initialize(&mut self) {}

    fn output(&self, _now: Elapsed, y: &mut i32) {
        *y = (*self.file).into();
    }

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

/// There are none; but Model Exchange is for models with events or states.
impl Events for Character {
    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        Ok(Outcome::default())
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

fmu_export::export!(Character: Events);
