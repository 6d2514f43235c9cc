//! A packed FMU, loaded, and an instance of it whose calls all succeed.

use fmu_import::Status;
use fmu_import::raw::{Arguments, Buffer, Handle, Interface, Raw, Simple, Vector, take_events};
use model_description::{BaseType, Causality, FmiVersion, ModelDescription};
use std::io::Read;
use std::path::Path;

/// A packed FMU, loaded.
pub struct Loaded {
    pub(super) raw: Raw,
    pub description: ModelDescription,
    _folder: tempfile::TempDir,
}

impl Loaded {
    pub fn new(path: &Path) -> Self {
        let mut zip = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
        let description = fmu_import::contents(path).unwrap().0;
        let folder = tempfile::tempdir().unwrap();
        let of = if description.version == FmiVersion::V2 { "linux64" } else { "x86_64-linux" };
        let name = &description.model_exchange.as_ref().unwrap().model_identifier;
        let mut bytes = Vec::new();
        zip.by_name(&format!("binaries/{of}/{name}.so")).unwrap().read_to_end(&mut bytes).unwrap();
        let file = folder.path().join(format!("{name}.so"));
        std::fs::write(&file, bytes).unwrap();
        Self { raw: Raw::open(&file, description.version).unwrap(), description, _folder: folder }
    }
}

/// An instance; every call succeeds, or the test ends with the FMU's message.
pub(super) struct Instance<'a> {
    pub(super) fmu: &'a Loaded,
    pub(super) it: Handle,
}

impl<'a> Instance<'a> {
    pub(super) fn new(fmu: &'a Loaded, interface: Interface) -> Self {
        let arguments = Arguments {
            name: Some(c"it".into()),
            token: Some(std::ffi::CString::new(fmu.description.token.as_str()).unwrap()),
            resources: None,
            interface,
            logger: true,
            callbacks: true,
            memory: true,
            lasting: true,
            logging: true,
            event_mode: false,
            early_return: false,
            environment: 0,
            intermediate: None,
            locks: false,
        };
        let it = fmu.raw.instantiate(&arguments).unwrap().expect("an instance");
        Self { fmu, it }
    }

    pub(super) fn version(&self) -> FmiVersion {
        self.fmu.description.version
    }

    pub(super) fn ok(&self, call: &str, status: Option<Status>) {
        let status = status.unwrap_or_else(|| panic!("{call} is missing"));
        if !status.is_ok() {
            let said: Vec<_> = take_events().into_iter().filter_map(|e| e.text).collect();
            panic!("{call} of {}: {status:?}\n{}", self.fmu.description.model_name, said.join("\n"));
        }
    }

    pub(super) fn simple(&self, name: Simple) {
        self.ok(name.as_str(), self.fmu.raw.simple(name, self.it));
    }

    pub(super) fn set(&self, base: BaseType, references: &[u32], bits: &[u64]) {
        let mut values = Buffer::of(base, self.version(), bits);
        let n = references.len();
        self.ok("a setter", self.fmu.raw.set(self.it, base, Some(references), n, Some(&mut values), bits.len()));
    }

    pub(super) fn get(&self, base: BaseType, references: &[u32]) -> Vec<u64> {
        let (n, mut values) = (references.len(), Buffer::room(base, self.version(), references.len()));
        self.ok("a getter", self.fmu.raw.get(self.it, base, Some(references), n, Some(&mut values), n));
        values.bits()
    }

    pub(super) fn reals(&self, references: &[u32]) -> Vec<f64> {
        self.get(BaseType::Float64, references).into_iter().map(f64::from_bits).collect()
    }

    pub(super) fn numbers(&self, recorded: &[(BaseType, u32)]) -> Vec<f64> {
        let number = |&(base, reference): &(BaseType, u32)| match (base, self.get(base, &[reference])[0]) {
            (BaseType::Float64, bits) => f64::from_bits(bits),
            (_, bits) => f64::from(u32::try_from(bits).unwrap().cast_signed()),
        };
        recorded.iter().map(number).collect()
    }

    pub(super) fn vector(&self, name: Vector, values: &mut [f64]) {
        let n = values.len();
        self.ok(name.as_str(), self.fmu.raw.vector(name, self.it, Some(values), n));
    }

    /// Every parameter to its start value, all of a type in one call.
    pub(super) fn set_starts(&self) {
        let mut calls: Vec<(BaseType, Vec<u32>, Vec<u64>)> = Vec::new();
        for v in &self.fmu.description.variables {
            let bits: Option<Vec<u64>> = match (v.causality, &v.start) {
                (Causality::Parameter, Some(start)) => start.split_whitespace().map(|x| bits(v.base, x)).collect(),
                _ => None,
            };
            // Texts are set one by one elsewhere, and these FMUs have no text parameters.
            let Some(bits) = bits else { continue };
            match calls.iter_mut().find(|call| call.0 == v.base) {
                Some(call) => {
                    call.1.push(v.value_reference);
                    call.2.extend(bits);
                }
                None => calls.push((v.base, vec![v.value_reference], bits)),
            }
        }
        for (base, references, bits) in calls {
            self.set(base, &references, &bits);
        }
    }
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        self.fmu.raw.free(self.it);
    }
}

/// The bits of a start value; none for texts and bytes.
fn bits(base: BaseType, text: &str) -> Option<u64> {
    match base {
        BaseType::Float64 => text.parse().ok().map(f64::to_bits),
        BaseType::Float32 => text.parse().ok().map(|x: f32| x.to_bits().into()),
        BaseType::Boolean => Some(u64::from(text == "true" || text == "1")),
        BaseType::String | BaseType::Binary | BaseType::Clock => None,
        _ => text.parse::<i64>().ok().map(i64::cast_unsigned),
    }
}
