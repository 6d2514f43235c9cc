//! FMUs of other tools, from PyPI: no false alarm. Takes a network and a minute: `cargo test --test check -- --ignored`.

use crate::{check, common, told, violated};
use std::path::{Path, PathBuf};
use std::process::Command;

const COUNTER: &str = r#"
from pythonfmu import Fmi2Causality, Fmi2Slave, Integer, Real

class Counter(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.y = 0.0, 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, t, dt):
        self.y += self.u * dt
        return True
"#;

const PAIR: &str = "rule;from_fmu;from_port;to_fmu;to_port
FMU;PmsmPlant.fmu;;;
FMU;SensorlessController.fmu;;;
LINK;SensorlessController.fmu;u_a;PmsmPlant.fmu;u_a
INPUT;;speed_ref;SensorlessController.fmu;speed_ref
OUTPUT;PmsmPlant.fmu;speed;;speed
";

fn run(command: &mut Command) {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A folder with the tools' programs, made once below the target directory.
fn tools() -> PathBuf {
    let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join("check-venv");
    if !venv.join("ready").exists() {
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&venv));
        let packages = ["pythonfmu==0.7.0", "fmu-manipulation-toolbox==2.0"];
        run(Command::new(venv.join("bin/pip")).args(["install", "-q"]).args(packages));
        std::fs::write(venv.join("ready"), "").unwrap();
    }
    venv.join("bin")
}

/// What is said of it is true: PythonFMU lists no InitialUnknowns (its issue 193), and its binary needs a Python that
/// is not in this process, which it declares.
#[test]
#[ignore = "needs PyPI"]
fn pythonfmu() {
    let (tools, dir) = (tools(), tempfile::tempdir().unwrap());
    std::fs::write(dir.path().join("counter.py"), COUNTER).unwrap();
    run(Command::new(tools.join("pythonfmu")).args(["build", "-f", "counter.py"]).current_dir(dir.path()));
    let report = check(&dir.path().join("Counter.fmu"), &[]);
    let must: Vec<_> = report.violated().filter(|f| f.level == fmu::check::Level::Must).map(|f| f.id).collect();
    assert_eq!(must, ["S02a"], "{}", told(&report));
}

/// It steps beyond the stop time (FMI 2.0.5, 2.1.6); all else that it does not do the standard leaves open.
#[test]
#[ignore = "needs PyPI"]
fn fmucontainer() {
    let (tools, dir) = (tools(), tempfile::tempdir().unwrap());
    for name in ["PmsmPlant.fmu", "SensorlessController.fmu"] {
        std::fs::copy(common::archives().join("fmi2").join(name), dir.path().join(name)).unwrap();
    }
    std::fs::write(dir.path().join("pair.csv"), PAIR).unwrap();
    let mut container = Command::new(tools.join("fmucontainer"));
    run(container.args(["-container", "pair.csv:0.0001", "-no-auto-link", "-fmu-directory"]).arg(dir.path()));
    let report = check(&dir.path().join("pair.fmu"), &[]);
    let must: Vec<_> = report.violated().filter(|f| f.level == fmu::check::Level::Must).map(|f| f.id).collect();
    assert_eq!(must, ["L12"], "{}", told(&report));
    assert!(violated(&report).contains(&"L08n"));
}
