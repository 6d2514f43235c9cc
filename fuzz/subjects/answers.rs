//! The answers of an FMU to our importer, in this process: `answers.c` takes each status and value from the bytes. The first byte selects
//! Co-Simulation or a solver of Model Exchange.

use fmu_import::Fmu;
use fmu_system::cosimulation::{CommunicationPoint, Integration, Method, Settings, Solver, System};
use std::fmt::Write as _;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::process::Command;
use std::sync::OnceLock;

const XML: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="answers" guid="g" numberOfEventIndicators="1">
<ModelExchange modelIdentifier="answers" canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>
<CoSimulation modelIdentifier="answers" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
 canSerializeFMUstate="true"/>
<DefaultExperiment startTime="0" stopTime="1" stepSize="0.25"/>
<ModelVariables>
<ScalarVariable name="x" valueReference="1" causality="output" variability="continuous" initial="exact"><Real start="1"/></ScalarVariable>
<ScalarVariable name="der(x)" valueReference="2" causality="local"><Real derivative="1"/></ScalarVariable>
<ScalarVariable name="i" valueReference="3" causality="output" variability="discrete" initial="calculated"><Integer/></ScalarVariable>
<ScalarVariable name="b" valueReference="4" causality="output" variability="discrete" initial="calculated"><Boolean/></ScalarVariable>
<ScalarVariable name="s" valueReference="5" causality="output" variability="discrete" initial="calculated"><String/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="1"/><Unknown index="3"/><Unknown index="4"/><Unknown index="5"/></Outputs>
<Derivatives><Unknown index="2"/></Derivatives></ModelStructure>
</fmiModelDescription>"#;

/// The FMU, compiled once; `None` without a C compiler.
fn fmu() -> Option<&'static Fmu> {
    static FMU: OnceLock<Option<Fmu>> = OnceLock::new();
    let packed = || {
        let dir = tempfile::tempdir().expect("a folder");
        let (source, library) = (dir.path().join("answers.c"), dir.path().join("answers.so"));
        std::fs::write(&source, include_str!("answers.c")).expect("space");
        let status =
            Command::new("cc").args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(&source).status().ok()?;
        assert!(status.success());
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let binary = std::fs::read(library).expect("the library");
        for (name, bytes) in [("modelDescription.xml", XML.as_bytes()), ("binaries/linux64/answers.so", &binary)] {
            zip.start_file(name, zip::write::SimpleFileOptions::default()).expect("an entry");
            zip.write_all(bytes).expect("memory");
        }
        let bytes = zip.finish().expect("an archive").into_inner();
        Some(Fmu::from_bytes("answers.fmu", bytes.into()).expect("an FMU"))
    };
    FMU.get_or_init(packed).as_ref()
}

pub(crate) fn run(bytes: &[u8]) {
    let (Some((method, bytes)), Some(fmu)) = (bytes.split_first(), fmu()) else { return };
    let exchange = |solver| Method::ModelExchange(Integration { solver, ..Integration::default() });
    let mut system = System::new(match method % 3 {
        0 => Method::default(),
        1 => exchange(Solver::Rk4),
        _ => exchange(Solver::Dopri { rtol: 1e-3 }),
    });
    let mut name = String::from("n");
    for byte in bytes.iter().take(4096) {
        let _ = write!(name, "{byte:02x}");
    }
    if system.add(&name, fmu, false).is_err() {
        return;
    }
    system.record_outputs().expect("outputs");
    let each = |point: &mut CommunicationPoint<'_>| {
        if point.index == 2 {
            let it = point.instance(&name).expect("the instance");
            if let Ok(state) = it.get_state() {
                let stored = it.serialize_state(state).and_then(|bytes| it.deserialize_state(&bytes));
                let _ = stored.and_then(|state| it.set_state(state));
            }
        }
        Ok(ControlFlow::Continue(()))
    };
    let _ = system.run(&Settings { start: 0.0, stop: 1.0, step: 0.25, sequential: false }, each);
    let _ = system.take_messages();
}
