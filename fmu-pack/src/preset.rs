//! An FMU with other start values, made from its archive: the same binaries with a [`preset`] among their resources, and a
//! matching description.

use crate::TOOL;
use crate::archive::{self, GenerationTime, PackedFile};
use crate::documentation;
use crate::error::{Context, Error, Result, ensure, invalid};
use crate::reference::{self, FOLDER};
use fmu_core::description::{Dependencies, Value, Variable, VariableKind};
use fmu_core::preset::{self, FILE, FORMER_FILE};
use fmu_core::variable::{Causality, position};
use fmu_core::{Bytes, Description};
use fmu_import::{Fmu, Folder, Kind, Unpacked, Values, describe, suggest};
use model_description::{FmiVersion, Generation, ModelDescription};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const DESCRIPTION: &str = "modelDescription.xml";
const PAGE: &str = "documentation/index.html";
const BINARIES: &str = "binaries/";

/// The default experiment of the new FMU: its inputs, and its times in s.
pub struct NewExperiment {
    /// CSV with time first and a column for each input.
    pub stimuli: String,
    /// Stop time.
    pub stop: f64,
    /// Communication step, if it differs from the archive's.
    pub step: Option<f64>,
}

/// What was written.
pub struct Written {
    /// A line for every start value that differs from the model's.
    pub changes: Vec<String>,
    /// Limitations of the new FMU, which is written anyway.
    pub notes: Vec<String>,
}

/// An FMU, and its new start values.
pub struct PresetFmu {
    /// The archive, for messages.
    file: PathBuf,
    md: ModelDescription,
    files: BTreeMap<String, Vec<u8>>,
    unpacked: Unpacked,
    /// The model without a preset.
    own: Description,
    /// The model as described by FMI 3.0, with arrays, to parse user input.
    reader: ModelDescription,
    /// Names and values by value reference, which is the order of the table.
    values: BTreeMap<u32, (String, String)>,
    /// The value references that an earlier preset has set.
    earlier: BTreeSet<u32>,
}

impl PresetFmu {
    /// Opens an FMU of this exporter, with the values of its preset, if it has one.
    ///
    /// # Errors
    /// The file is not an FMU of this exporter with a binary for this computer.
    pub fn open(file: &Path) -> Result<Self> {
        let (md, files) = fmu_import::contents(file)?;
        let unpacked = Unpacked::new(file)?;
        let path = unpacked.resources().join(FILE);
        let old = fs::read(&path).ok();
        if old.is_some() {
            fs::remove_file(&path)?;
        }
        let name = file.display();
        ensure!(!files.contains_key(&format!("resources/{FORMER_FILE}")), "{name}: {}", preset::former());
        let own = described(&unpacked).map_err(|e| {
            invalid!("{name}: {}: a preset is for FMUs of this program (fmu build)", cause(&e.to_string(), &unpacked))
        })?;
        let suffix = preset::suffix_of(&md.token, &own.token).with_context(|| {
            format!("{name}: {DESCRIPTION} and binary are of different builds: build the FMU again")
        })?;
        let reader = model_description::write(&own, FmiVersion::V3, &generation(GenerationTime::fixed(0)));
        let reader = model_description::read(reader)?;
        let mut values = BTreeMap::new();
        if !suffix.is_empty() {
            let old = old.filter(|bytes| preset::suffix(bytes) == suffix);
            let old =
                old.with_context(|| format!("{name}: resources/{FILE} is missing or does not match {DESCRIPTION}"))?;
            for preset::PresetValue { name, value } in
                preset::read(&old).map_err(|e| invalid!("{}: {e}", file.display()))?
            {
                let (variable, element) =
                    find(&own, &reader, &name).with_context(|| format!("{name} in resources/{FILE}"))?;
                values.insert(reference(variable, element.unwrap_or(0)), (name, value));
            }
        }
        let earlier = values.keys().copied().collect();
        Ok(Self { file: file.into(), md, files, unpacked, own, reader, values, earlier })
    }

    /// Whether there is a variable of this name, or an element of an array.
    pub fn has(&self, name: &str) -> bool {
        find(&self.own, &self.reader, name).is_some()
    }

    /// The model without a preset.
    pub fn own(&self) -> &Description {
        &self.own
    }

    /// The model of the archive, with its default experiment and the file of inputs.
    ///
    /// # Errors
    /// The binary does not support presets.
    pub fn archived(&self) -> Result<(Description, Option<Vec<u8>>)> {
        let mut description = if self.values.is_empty() { self.own.clone() } else { self.described(None)? };
        description.title = (self.md.model_name != description.name).then(|| self.md.model_name.clone());
        self.take_experiment(&mut description, None);
        Ok((description, self.stimuli().map(<[u8]>::to_vec)))
    }

    /// The default experiment of the archive, or another course.
    fn take_experiment(&self, description: &mut Description, course: Option<&NewExperiment>) {
        let of_archive = &self.md.default_experiment;
        let experiment = &mut description.experiment;
        let stop = course.map(|course| course.stop).or(of_archive.stop);
        let step = course.and_then(|course| course.step).or(of_archive.step);
        (experiment.stop, experiment.step) = (stop.unwrap_or(experiment.stop), step.unwrap_or(experiment.step));
    }

    /// The file with the inputs of the archive's default experiment.
    fn stimuli(&self) -> Option<&[u8]> {
        let packed = self.files.iter().find(|(name, _)| name.starts_with(FOLDER) && name.ends_with("_in.csv"));
        packed.map(|(_, bytes)| bytes.as_slice())
    }

    /// The names set by an earlier preset but not by this one.
    pub fn earlier(&self) -> Vec<&str> {
        self.earlier.iter().filter_map(|place| self.values.get(place)).map(|(name, _)| name.as_str()).collect()
    }

    /// Sets the start value of a variable, of a whole array, or of an element, from user input, in `unit` if given.
    ///
    /// # Errors
    /// States the variable, its value, and the expected one.
    pub fn set(&mut self, name: &str, text: &str, unit: Option<&str>) -> Result<()> {
        let model = &self.own.name;
        let Some((variable, element)) = find(&self.own, &self.reader, name) else {
            let names = self.own.variables.iter().filter(|v| v.takes_start()).map(|v| v.name.as_str());
            return Err(invalid!("{model} has no variable {name}{}", suggest(name, names)));
        };
        if !variable.takes_start() {
            let what = match variable.causality {
                Causality::Output => "an output",
                Causality::CalculatedParameter => "a calculated parameter",
                Causality::StructuralParameter => "a structural parameter, which sizes arrays",
                _ => "a local variable",
            };
            return Err(invalid!(
                "{name} is {what}: a preset contains start values of inputs, parameters, and exact variables"
            ));
        }
        let read = self.reader.variable(&variable.name).context(variable.name.clone())?;
        let own_unit = read.unit.as_deref().unwrap_or("1");
        if let Some(unit) = unit.filter(|unit| *unit != own_unit) {
            return Err(invalid!("{name} is given in {unit}, but {model} uses {own_unit}: convert the value"));
        }
        let elements = texts(&Values::read(text, read, &self.reader).map_err(Error::Invalid)?, variable);
        let places: Vec<usize> = element.map_or_else(|| (0..variable.elements()).collect(), |one| vec![one]);
        ensure!(elements.len() == places.len(), "{name} has {} elements, not {}", places.len(), elements.len());
        for (place, text) in places.into_iter().zip(elements) {
            self.earlier.remove(&reference(variable, place));
            self.values.insert(reference(variable, place), (element_name(variable, place), text));
        }
        Ok(())
    }

    /// Writes the FMU with these start values to `out`; nothing is written unless all are allowed. `title` is the display name;
    /// by default, name and experiment come from the archive.
    ///
    /// # Errors
    /// The binary does not support presets; a value is not allowed, or the FMU refuses them together; the file cannot be
    /// written.
    pub fn write(self, title: Option<&str>, course: Option<&NewExperiment>, out: &Path) -> Result<Written> {
        let moment = GenerationTime::of_environment()?;
        let mut description = self.described(title)?;
        self.take_experiment(&mut description, course);
        let changes = changes(&description, &self.own);
        let mut files: BTreeMap<String, PackedFile> = self
            .files
            .iter()
            .filter(|(name, _)| !name.starts_with(FOLDER))
            .map(|(name, bytes)| (name.clone(), entry(name, bytes.clone())))
            .collect();
        let version = self.md.version;
        let mut put = |name: &str, text: String| files.insert(name.into(), entry(name, text.into_bytes()));
        let text = model_description::write(&description, version, &generation(moment));
        let text = self.files.get(DESCRIPTION).and_then(|archived| with_structure_of(archived, &text));
        put(
            DESCRIPTION,
            text.with_context(|| format!("{}: {DESCRIPTION} has no ModelStructure", self.file.display()))?,
        );
        put(&format!("resources/{FILE}"), self.text());
        let documentation = documentation::preset::preset(&description, &self.own);
        put(PAGE, documentation::page(&Description { documentation, ..description.clone() }, version));
        let dir = Folder::new()?;
        let first = dir.path().join("preset.fmu");
        archive::write(&first, &archive::archive(&files, moment)?)?;
        let mut notes: Vec<String> = self.starts(&first)?.into_iter().collect();
        match self.reference(&first, &description, course, dir.path()) {
            Ok(more) => files.extend(more),
            // A disk that is full is no reason for an FMU without its reference result: an instance was made before.
            Err(why) if why.is_before_the_run() => return Err(why),
            Err(why) => {
                notes.push(format!("{}: the archive gets no reference result: {}", self.file.display(), why.whole()));
            }
        }
        archive::write(out, &archive::archive(&files, moment)?)?;
        Ok(Written { changes, notes })
    }

    /// The file of the preset.
    fn text(&self) -> String {
        preset::write(self.values.values().map(|(name, value)| (name.as_str(), value.as_str())))
    }

    /// The description that the binary returns with the preset: it checks every name and value.
    fn described(&self, title: Option<&str>) -> Result<Description> {
        let (name, text) = (self.file.display(), self.text());
        let file = self.unpacked.resources().join(FILE);
        fs::write(&file, &text).with_context(|| file.display().to_string())?;
        let mut description =
            described(&self.unpacked).map_err(|e| invalid!("{name}: {}", cause(&e.to_string(), &self.unpacked)))?;
        let token = self.own.token.clone() + &preset::suffix(text.as_bytes());
        ensure!(
            description.token == token,
            "{name}: its binary does not support presets, because an earlier version built it: build the FMU again"
        );
        let title = title.unwrap_or(&self.md.model_name);
        description.title = (title != description.name).then(|| title.to_owned());
        model_description::fits(&description, self.md.version).map_err(|e| invalid!("{name}: {e}"))?;
        Ok(description)
    }

    /// Requires that the FMU initializes with the preset if it does so without; for Model Exchange, a note reports a failure.
    fn starts(&self, archive: &Path) -> Result<Option<String>> {
        let (fmu, name) = (Fmu::open(archive)?, self.file.display());
        for (kind, what) in [(Kind::default(), "Co-Simulation"), (Kind::ModelExchange, "Model Exchange")] {
            let steps = kind == Kind::default();
            let interface = if steps { &self.md.co_simulation } else { &self.md.model_exchange };
            let Some(why) = interface.as_ref().and_then(|_| initialized(&fmu, kind).err()) else { continue };
            if initialized(&Fmu::open(&self.file)?, kind).is_err() {
                continue;
            }
            let why = format!("{name}: the FMU does not initialize for {what} with these start values: {why}");
            ensure!(!steps, "{why}");
            return Ok(Some(why));
        }
        Ok(None)
    }

    /// The reference files of a new run.
    fn reference(
        &self,
        archive: &Path,
        description: &Description,
        course: Option<&NewExperiment>,
        dir: &Path,
    ) -> Result<BTreeMap<String, PackedFile>> {
        let stimuli = dir.join(reference::STIMULI);
        // Without a file, the inputs keep their start values.
        if let Some(bytes) = course.map(|course| course.stimuli.as_bytes()).or(self.stimuli()) {
            fs::write(&stimuli, bytes).with_context(|| stimuli.display().to_string())?;
        }
        reference::files(archive, description, &stimuli, None)
    }
}

/// Whether an instance of this kind initializes.
fn initialized(fmu: &Fmu, kind: Kind) -> Result<(), fmu_import::Error> {
    let mut instance = fmu.instantiate_as(kind, "preset", false)?;
    instance.setup(fmu.description().default_experiment.start.unwrap_or(0.0), None)?;
    instance.enter_initialization()?;
    instance.exit_initialization()
}

/// The description that the library returns. The archive knows the dependencies: they hold for any values of the parameters.
fn described(unpacked: &Unpacked) -> Result<Description, fmu_import::Error> {
    describe(&unpacked.library, Some(&unpacked.resources()), Dependencies::Omitted)
}

/// The text of a description with the model structure of the archive.
fn with_structure_of(archived: &[u8], text: &str) -> Option<String> {
    let structure = |text: &str| {
        let start = text.find("<ModelStructure")?;
        let end =
            ["<ModelStructure/>", "</ModelStructure>"].map(|end| text[start..].find(end).map(|at| at + end.len()));
        Some(start..start + end.into_iter().flatten().next()?)
    };
    let archived = std::str::from_utf8(archived).ok()?;
    let (own, of_archive) = (structure(text)?, structure(archived)?);
    Some([&text[..own.start], &archived[of_archive], &text[own.end..]].concat())
}

fn generation(moment: GenerationTime) -> Generation {
    Generation { tool: TOOL.into(), date_and_time: moment.date_and_time() }
}

fn entry(name: &str, bytes: Vec<u8>) -> PackedFile {
    PackedFile { bytes, executable: name.starts_with(BINARIES) }
}

/// The reason why a library cannot be described, without the path of the unpacked preset.
fn cause(error: &str, unpacked: &Unpacked) -> String {
    let library = unpacked.library.display().to_string();
    let rest = error.strip_prefix(&library).map_or(error, |rest| rest.trim_start_matches([':', ' ']));
    rest.split_once(&format!("{FILE}: ")).map_or(rest, |(_, why)| why).into()
}

/// The variable of this name, or the array and the index of the element.
fn find<'a>(own: &'a Description, reader: &ModelDescription, name: &str) -> Option<(&'a Variable, Option<usize>)> {
    let element =
        || reader.element(name).and_then(|(array, element)| Some((own.variable(&array.name)?, Some(element))));
    own.variable(name).map(|variable| (variable, None)).or_else(element)
}

fn element_name(variable: &Variable, element: usize) -> String {
    if variable.is_array() {
        variable.name.clone() + &position(&variable.shape, element)
    } else {
        variable.name.clone()
    }
}

fn reference(variable: &Variable, element: usize) -> u32 {
    variable.value_reference + u32::try_from(element).unwrap_or_default()
}

/// A line for every start value that differs.
fn changes(preset: &Description, own: &Description) -> Vec<String> {
    let pairs = preset.variables.iter().zip(&own.variables).filter(|(new, old)| new.start != old.start);
    let line = |(new, old): (&Variable, &Variable)| {
        let unit = match &new.kind {
            VariableKind::Real { unit, .. } if !unit.is_empty() => format!(" {unit}"),
            _ => String::new(),
        };
        format!("{} = {}{unit} (was {})", new.name, shown(new), shown(old))
    };
    pairs.map(line).collect()
}

/// The start value, an enumeration by name.
fn shown(variable: &Variable) -> String {
    let item = |x: i128| match &variable.kind {
        VariableKind::Enumeration { items, .. } => {
            items.iter().find(|(value, ..)| i128::from(*value) == x).map(|(_, name, _)| name.clone())
        }
        _ => None,
    };
    let one = |value: &Value| match value {
        Value::Real(x) => format!("{x:?}"),
        Value::Integer(x) => item(*x).unwrap_or_else(|| x.to_string()),
        Value::Boolean(x) => x.to_string(),
        Value::Text(x) => format!("{x:?}"),
        Value::Binary(x) => Bytes::from(x).to_string(),
    };
    variable.start.iter().flatten().map(one).collect::<Vec<_>>().join(", ")
}

/// The elements as in the file, rounded to the type of the variable.
fn texts(values: &Values, variable: &Variable) -> Vec<String> {
    #[expect(clippy::cast_possible_truncation, reason = "rounds")]
    let real = |x: &f64| match variable.kind {
        VariableKind::Real { single: true, .. } => format!("{:?}", *x as f32),
        _ => format!("{x:?}"),
    };
    match values {
        Values::Reals(x) => x.iter().map(real).collect(),
        Values::Integers(x) => x.iter().map(i128::to_string).collect(),
        Values::Booleans(x) => x.iter().map(bool::to_string).collect(),
        Values::Strings(x) => x.clone(),
        Values::Binaries(x) => x.iter().map(|bytes| Bytes::from(bytes).to_string()).collect(),
    }
}
