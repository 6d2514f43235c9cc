//! The two models in C (`fmu.c`) as FMUs of both standards.

use fmu_import::Fmu;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// FMUs that are made for one test.
pub(crate) struct Workshop(tempfile::TempDir);

impl Workshop {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// An FMU: `plant` or `sampler`; `change` edits its description.
    pub(crate) fn fmu(&self, name: &str, version: u32, defines: &[&str], change: impl Fn(String) -> String) -> Fmu {
        Fmu::open(self.archive(name, version, defines, change)).unwrap()
    }

    pub(crate) fn plain(&self, name: &str, version: u32) -> Fmu {
        self.fmu(name, version, &[], |xml| xml)
    }

    /// An FMU of FMI 3.0 with further files.
    pub(crate) fn fmu_with(&self, name: &str, files: &[(&str, &str)]) -> Fmu {
        let path = self.archive(name, 3, &[], |xml| xml);
        let file = std::fs::File::options().read(true).write(true).open(&path).unwrap();
        let mut zip = zip::ZipWriter::new_append(file).unwrap();
        for (entry, text) in files {
            zip.start_file(*entry, zip::write::SimpleFileOptions::default()).unwrap();
            zip.write_all(text.as_bytes()).unwrap();
        }
        zip.finish().unwrap();
        Fmu::open(path).unwrap()
    }

    pub(crate) fn archive(
        &self,
        name: &str,
        version: u32,
        defines: &[&str],
        change: impl Fn(String) -> String,
    ) -> PathBuf {
        let library = self.0.path().join("x.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/model_exchange/fmu.c");
        let states = format!("-DSTATES={}", u8::from(name == "plant"));
        let mut cc = Command::new("cc");
        cc.args(["-std=c11", "-D_GNU_SOURCE", "-shared", "-fPIC", "-O1", "-w", &states]).args(defines);
        assert!(cc.arg(source).arg("-o").arg(&library).arg("-lm").status().unwrap().success());
        let path = self.0.path().join(format!("{name}.fmu"));
        let folder = if version == 2 { "linux64" } else { "x86_64-linux" };
        let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
        for (entry, bytes) in [
            ("modelDescription.xml".to_owned(), change(description(name, version)).into_bytes()),
            (format!("binaries/{folder}/x.so"), std::fs::read(library).unwrap()),
        ] {
            zip.start_file(entry, zip::write::SimpleFileOptions::default()).unwrap();
            zip.write_all(&bytes).unwrap();
        }
        zip.finish().unwrap();
        path
    }
}

/// The description, of FMI 3.0, with a variable as an array of one element.
pub(crate) fn array(xml: &str, name: &str) -> String {
    let at = xml.find(&format!("<Float64 name='{name}'")).unwrap();
    let end = at + xml[at..].find("/>").unwrap();
    format!("{}><Dimension start='1'/></Float64>{}", &xml[..end], &xml[end + 2..])
}

/// The description of a model in a standard, with both interfaces.
fn description(name: &str, version: u32) -> String {
    // Name, causality, variability, start.
    let variables = [
        ("u", "input", "continuous", "0"),
        ("x", "output", "continuous", ""),
        ("der(x)", "local", "continuous", ""),
        ("i", "input", "discrete", "0"),
        ("y", "output", "discrete", ""),
        ("T", "parameter", "fixed", "0.1"),
        ("level", "parameter", "fixed", "-1"),
        ("count", "output", "discrete", ""),
        ("fault", "parameter", "fixed", "0"),
        ("z", "output", "continuous", ""),
        ("tolerance", "output", "continuous", ""),
        ("prior", "output", "continuous", ""),
    ];
    let state = name == "plant";
    let variable = |(index, (name, causality, variability, start)): (usize, &(&str, &str, &str, &str))| {
        let start = if start.is_empty() { String::new() } else { format!("start='{start}'") };
        let derivative = if *name == "der(x)" && state { "derivative='2'" } else { "" };
        let common =
            format!("name='{name}' valueReference='{}' causality='{causality}' variability='{variability}'", index + 1);
        if version == 2 {
            format!("<ScalarVariable {common}><Real {start} {derivative}/></ScalarVariable>")
        } else {
            format!("<Float64 {common} {start} {derivative}/>")
        }
    };
    let variables: String = variables.iter().enumerate().map(variable).collect();
    let (root, structure, capabilities) = if version == 2 {
        let derivatives = if state { "<Derivatives><Unknown index='3'/></Derivatives>" } else { "" };
        (format!("fmiVersion='2.0' guid='g' numberOfEventIndicators='{}'", u8::from(state)), derivatives, "")
    } else {
        let derivatives = if state { "<ContinuousStateDerivative valueReference='3'/>" } else { "" };
        let events = "hasEventMode='true' mightReturnEarlyFromDoStep='true' canGetAndSetFMUState='true'";
        let capabilities = if state { "" } else { events };
        ("fmiVersion='3.0' instantiationToken='g'".to_owned(), derivatives, capabilities)
    };
    let step = if version == 2 { "" } else { "needsCompletedIntegratorStep='true'" };
    format!(
        "<fmiModelDescription {root} modelName='{name}'><ModelExchange modelIdentifier='x' {step}/>\
         <CoSimulation modelIdentifier='x' canHandleVariableCommunicationStepSize='true' {capabilities}/>\
         <DefaultExperiment tolerance='1e-5'/><ModelVariables>{variables}</ModelVariables>\
         <ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )
}
