//! `fmu build`: compiles models and packs them.

use crate::worker::ProcessOptions;
use crate::{Failed, message, model};
use anyhow::{Context, Result, anyhow, bail};
use clap::{Args, ValueEnum};
use fmu_core::Description;
use fmu_import::elf::{FLOOR, Needs};
use fmu_import::platform::Platform;
use fmu_import::{Folder, printable, whole};
use fmu_pack::archive::{self, GenerationTime, PackedFile};
use fmu_pack::compile::{Library, Profile, compile};
use fmu_pack::icons;
use fmu_pack::licenses::Licenses;
use fmu_pack::reference;
use fmu_pack::target::{Linker, Target, Tools, ZIG};
use fmu_pack::workspace::{Package, Workspace, output_folder};
use model_description::FmiVersion;
use std::collections::BTreeMap;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// Compiles FMUs and packs them for both standards.
///
/// Without names, builds every FMU of the Cargo package or workspace around the current folder: the packages in its folder
/// fmus/ or, if there is no such folder, every cdylib that depends on fmu-export. Select an FMU by the name of its package
/// (pmsm-plant) or of the FMU (PmsmPlant). `fmu new` creates a package for your FMU.
///
/// An FMU is any cdylib with the line `fmu_export::export!(MyModel);`:
///   packages elsewhere in the workspace     fmu build --package own-fmu --package my-fmu
///   an existing library, or several libraries of one model for several platforms
///                                  fmu build --library target/release/libmy_fmu.so
///                                  fmu build --library libmy_fmu.so --library x86_64-windows=my_fmu.dll
///
/// The folder resources/ beside the package's Cargo.toml, or that of --resources, becomes the folder resources/ of the FMU; the
/// model reads it in `load`. Hidden files are omitted.
///
/// For other platforms, name the Rust targets; the FMUs then contain exactly one binary for each:
///   fmu build --target x86_64-unknown-linux-gnu,aarch64-unknown-linux-gnu,x86_64-pc-windows-gnu
/// This needs Rust's standard library for each target (rustup target add TRIPLE), mingw for Windows, and cargo-zigbuild with
/// ziglang for Linux and macOS. The command always builds for this computer too, because that library describes the model.
///
/// With cargo-zigbuild in PATH, Linux binaries need glibc 2.17 (2012). Otherwise they depend on this computer's linker, and the
/// command prints their requirements. CARGO_TARGET_TRIPLE_LINKER (spelled as Cargo does) selects another linker.
///
/// Archives of FMI 2.0 contain one universal library for both processors of macOS. Many importers look for Linux libraries of
/// FMI 2.0 only in linux64, on every processor. `--linux64 aarch64` puts the library for ARM there; that for x86_64 moves to
/// x86_64-linux, so such importers no longer run the archive on x86_64:
///   fmu build --target x86_64-unknown-linux-gnu,aarch64-unknown-linux-gnu --linux64 aarch64 --out for-arm
///
/// With SOURCE_DATE_EPOCH set, identical sources give identical bytes.
///
/// While you write a model, `fmu build --dev` compiles only what has changed, with Cargo's profile dev, for this computer, for a debugger,
/// and without a reference result. `fmu build --keep-symbols` is the release with names of functions and line numbers, for gdb or perf.
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
pub struct Models {
    /// FMUs to build, by package or FMU name
    #[arg(value_name = "FMU", conflicts_with_all = ["package", "library", "resources"])]
    pub fmus: Vec<String>,
    /// FMI version: 2 or 3 [default: both]
    #[arg(long, value_name = "VERSION", value_parser = clap::builder::PossibleValuesParser::new(["2", "3"]))]
    pub fmi: Option<String>,
    /// Folder for fmi2/NAME.fmu and fmi3/NAME.fmu [default: fmu in Cargo's target folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Package of this workspace with a cdylib (repeatable)
    #[arg(long, value_name = "NAME", conflicts_with_all = ["library", "resources"])]
    pub package: Vec<String>,
    /// Existing library; PLATFORM= names a platform other than this computer's
    #[arg(long, value_name = "[PLATFORM=]FILE")]
    pub library: Vec<String>,
    /// Folder with the resources of the --library
    #[arg(long, value_name = "DIR", requires = "library")]
    pub resources: Option<PathBuf>,
    /// Target to build for instead of this computer; separate several with commas or repeat the option
    #[arg(long, value_name = "TRIPLE", value_delimiter = ',', conflicts_with_all = ["library", "resources"])]
    pub target: Vec<String>,
    /// Processor of the library in the folder linux64 of FMI 2.0: x86_64 or aarch64 [default: x86_64]
    #[arg(long, value_name = "PROCESSOR")]
    pub linux64: Option<Linux64>,
    /// Compile with Cargo's profile dev: in seconds after a change, with symbols, and without a reference result
    #[arg(long, conflicts_with_all = ["library", "target", "keep_symbols"])]
    pub dev: bool,
    /// Keep the names of functions and line numbers in the library, for a debugger or a profiler
    #[arg(long, conflicts_with = "library")]
    pub keep_symbols: bool,
    /// Pack no reference result: do not run the default experiment, whose failure is an error otherwise
    #[arg(long)]
    pub no_reference: bool,
    /// How the libraries are compiled without `dev` and `keep_symbols`.
    #[arg(skip)]
    pub profile: Profile,
    #[command(flatten)]
    /// The process of the model.
    pub process: ProcessOptions,
}

/// The processor of the folder `linux64` of FMI 2.0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Linux64 {
    /// x86_64.
    #[default]
    #[value(name = "x86_64")]
    X64,
    /// 64-bit ARM.
    #[value(name = "aarch64")]
    Arm,
}

impl Linux64 {
    /// The platform of its libraries.
    pub const fn platform(self) -> Platform {
        match self {
            Self::X64 => Platform::X64Linux,
            Self::Arm => Platform::ArmLinux,
        }
    }
}

/// A compiled model, ready to be packed.
struct Model {
    description: Description,
    /// The binary for this computer.
    own: Vec<(Platform, Vec<u8>)>,
    binaries: Vec<(Platform, Vec<u8>)>,
    licenses: Licenses,
    /// The model's resource files.
    resources: BTreeMap<String, PackedFile>,
    /// The file that feeds the default experiment.
    stimuli: PathBuf,
}

/// Runs the command; returns the files that were written. `example` gives the name and the text (SSV) of an example's parameters for the
/// archive of a model.
///
/// # Errors
/// A name is not an FMU, the compiler fails, a library was not made by `export!`, or a folder cannot be written.
pub fn run(args: &Models, example: impl Fn(&Description) -> Result<Option<(String, String)>>) -> Result<Vec<PathBuf>> {
    let moment = GenerationTime::of_environment()?;
    let versions = match args.fmi.as_deref() {
        None => vec![FmiVersion::V2, FmiVersion::V3],
        Some(version) => vec![version.parse()?],
    };
    if args.linux64.is_some() && !versions.contains(&FmiVersion::V2) {
        bail!("--linux64: is for FMI 2.0; the folders of FMI 3.0 name the processor: leave it out, or --fmi 3");
    }
    let (models, out) = if args.library.is_empty() {
        let workspace = Workspace::find()?;
        let out = args.out.clone().unwrap_or_else(|| workspace.target.join("fmu"));
        (compiled(&workspace, args)?, out)
    } else {
        let out = args.out.clone().map_or_else(|| output_folder("fmu"), Ok)?;
        (vec![given(&args.library, args.resources.as_deref(), &args.process)?], out)
    };
    let notes = if args.dev { Vec::new() } else { notes(&models) };
    for note in notes {
        message::note(&note);
    }
    let linux64 = args.linux64.unwrap_or_default().platform();
    if linux64 == Platform::ArmLinux && versions.contains(&FmiVersion::V2) {
        has_arm(&models)?;
    }
    let mut written = Vec::new();
    for model in &models {
        let name = &model.description.name;
        let mut versions = versions.clone();
        // Without names, only FMUs that the standard supports are built.
        let all = args.fmus.is_empty() && args.package.is_empty() && args.library.is_empty();
        if let Some(why) = model.description.needs_fmi3()
            && (versions.len() > 1 || all)
        {
            message::note(&printable(&format!("{name}: only for FMI 3.0: {why}")));
            versions.retain(|version| *version == FmiVersion::V3);
        }
        if versions.is_empty() {
            continue;
        }
        let reference = if args.no_reference || args.dev {
            BTreeMap::new()
        } else {
            reference(model, example(&model.description)?.as_ref(), versions[0], moment, &args.process)?
        };
        for &version in &versions {
            model_description::fits(&model.description, version).map_err(|e| anyhow!("{name}: {e}"))?;
            let folder = if version == FmiVersion::V2 { "fmi2" } else { "fmi3" };
            let path = out.join(folder).join(format!("{name}.fmu"));
            let mut files =
                archive::contents(&model.description, &model.binaries, &model.licenses, version, moment, linux64)?;
            files.extend(icons::files(&model.description, version)?);
            files.extend(model.resources.clone());
            files.extend(reference.clone());
            archive::write(&path, &archive::archive(&files, moment)?)?;
            written.push(path);
        }
    }
    Ok(written)
}

/// The reference files for the model's archives. A model that cannot run alone has none, and a note gives the reason.
///
/// # Errors
/// The default experiment fails.
fn reference(
    model: &Model,
    example: Option<&(String, String)>,
    version: FmiVersion,
    moment: GenerationTime,
    process: &ProcessOptions,
) -> Result<BTreeMap<String, PackedFile>> {
    let Model { description, stimuli, .. } = model;
    if let Some(why) = reference::impossible(description) {
        message::note(&printable(&format!("{}: the archive gets no reference result: {why}", description.name)));
        return Ok(BTreeMap::new());
    }
    let dir = Folder::new()?;
    let archive = dir.path().join("reference.fmu");
    let mut files = archive::contents(description, &model.own, &model.licenses, version, moment, Platform::host())?;
    files.extend(model.resources.clone());
    archive::write(&archive, &archive::temporary(&files, moment)?)?;
    model::reference(&archive, description, stimuli, example, process).map_err(|why| {
        let text = format!(
            "{}: the default experiment fails: {why:#}; correct the model, its DefaultExperiment or {}, or build with --no-reference",
            description.name,
            reference::STIMULI
        );
        Failed(text).into()
    })
}

fn compiled(workspace: &Workspace, args: &Models) -> Result<Vec<Model>> {
    // Check all targets before compiling anything.
    let tools = Tools::find()?;
    let host = || match tools.host() {
        target if args.dev => Target { linker: Linker::Usual, ..target },
        target => target,
    };
    let profile = match (args.dev, args.keep_symbols) {
        (true, _) => Profile::Development,
        (false, true) => Profile::Symbols,
        (false, false) => args.profile,
    };
    let targets = match &args.target[..] {
        [] => vec![host()],
        triples => targets(&tools, triples)?,
    };
    let named = |name: &String| {
        let package = workspace.package(name).filter(|p| p.has_cdylib());
        package.ok_or_else(|| anyhow!("{name} is not a package with crate-type = [\"cdylib\"] here"))
    };
    let packages = match &args.package[..] {
        [] => choose(&workspace.fmus(), &args.fmus)?,
        names => names.iter().map(named).collect::<Result<_>>()?,
    };
    let names: Vec<String> = packages.iter().map(|p| p.name.clone()).collect();
    let mut built: BTreeMap<String, Vec<(Platform, PathBuf)>> = BTreeMap::new();
    let mut describing: Option<Vec<Library>> = None;
    for target in &targets {
        let libraries = compile(workspace, &names, target, profile)?;
        for (package, library) in &libraries {
            built.entry(package.clone()).or_default().push((target.platform, library.clone()));
        }
        if target.platform == Platform::host() {
            describing = Some(libraries);
        }
    }
    let describing = match describing {
        Some(libraries) => libraries,
        None => compile(workspace, &names, &host(), profile)?,
    };
    if describing.is_empty() {
        bail!("no compiled package is a cdylib: set crate-type = [\"cdylib\"]");
    }
    let model = |(package, own): &Library| {
        let folder = workspace.package(package).map_or(Path::new("."), Package::folder);
        let resources = Some(folder.join("resources")).filter(|folder| folder.is_dir());
        let binaries = built.get(package).map(Vec::as_slice).unwrap_or_default();
        let stimuli = folder.join(reference::STIMULI);
        let describe =
            |library: &Path, folder: Option<&Path>, files: &_| described(library, folder, files, &args.process);
        load(own, binaries, Licenses::of_package(workspace, package), resources.as_deref(), stimuli, describe)
    };
    describing.iter().map(model).collect()
}

/// The targets of these names, each for a different platform.
fn targets(tools: &Tools, triples: &[String]) -> Result<Vec<Target>> {
    let mut targets: Vec<Target> = Vec::new();
    for triple in triples {
        let target = tools.target(triple)?;
        match targets.iter().find(|t| t.platform == target.platform) {
            Some(same) if same.triple == target.triple => {}
            Some(same) => bail!("--target {triple}: is for {}, as {} is; take one", target.platform, same.triple),
            None => targets.push(target),
        }
    }
    Ok(targets)
}

/// Checks that there is a library for `--linux64 aarch64`; a note states the drawback of the option.
fn has_arm(models: &[Model]) -> Result<()> {
    let has = |model: &Model, platform| model.binaries.iter().any(|(p, _)| *p == platform);
    if let Some(model) = models.iter().find(|model| !has(model, Platform::ArmLinux)) {
        let name = &model.description.name;
        bail!("--linux64 aarch64: {name} has no library for aarch64-linux; add --target aarch64-unknown-linux-gnu");
    }
    if models.iter().any(|model| has(model, Platform::X64Linux)) {
        message::note(
            "linux64 of FMI 2.0 contains the libraries for aarch64: an importer on x86_64 that does not look into x86_64-linux \
             too cannot load these archives",
        );
    }
    Ok(())
}

/// Requirements of the Linux binaries in addition to glibc 2.17: one line for all binaries with the same requirements.
fn notes(models: &[Model]) -> Vec<String> {
    let mut by_needs: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for Model { description, binaries, .. } in models {
        for (platform, bytes) in binaries {
            if let Ok(needs) = Needs::of(bytes)
                && !needs.are_modest()
            {
                by_needs.entry(format!("for {platform} requires {needs}")).or_default().push(&description.name);
            }
        }
    }
    let note = |(needs, names): (String, Vec<&str>)| {
        format!(
            "{} {needs}, which fmu check reports (B03, B04): to require at most {FLOOR}, install its linker and build again: {ZIG}",
            names.join(", ")
        )
    };
    by_needs.into_iter().map(note).collect()
}

/// The selected packages, by package name or by FMU name; the two differ only in how words are joined.
///
/// # Errors
/// There is no FMU package, or none with such a name.
pub fn choose<'a>(all: &[&'a Package], names: &[String]) -> Result<Vec<&'a Package>> {
    let letters = |name: &str| name.to_lowercase().replace(['-', '_'], "");
    if all.is_empty() {
        bail!(
            "no FMU package here: expected crate-type = [\"cdylib\"] and the dependency fmu-export in a Cargo.toml; \
             fmu new my-model creates such a package"
        );
    }
    if names.is_empty() {
        return Ok(all.to_vec());
    }
    let one = |name: &String| {
        let known = || all.iter().map(|p| p.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = all.iter().copied().find(|p| letters(&p.name) == letters(name));
        found.ok_or_else(|| anyhow!("there is no FMU {name}; available: {}", known()))
    };
    names.iter().map(one).collect()
}

/// Existing libraries of one model.
fn given(libraries: &[String], resources: Option<&Path>, process: &ProcessOptions) -> Result<Model> {
    let parse = |text: &String| match text.split_once('=') {
        Some((platform, file)) => Ok((platform.parse().map_err(|e: String| anyhow!(e))?, PathBuf::from(file))),
        None => Ok((Platform::host(), PathBuf::from(text))),
    };
    let libraries = libraries.iter().map(parse).collect::<Result<Vec<_>>>()?;
    for (i, (platform, file)) in libraries.iter().enumerate() {
        if let Some((_, other)) = libraries[..i].iter().find(|(of, _)| of == platform) {
            let (other, file) = (other.display(), file.display());
            bail!("--library {file}: {other} is for {platform} too; PLATFORM={file} names another platform");
        }
    }
    let own = libraries.iter().find(|(platform, _)| *platform == Platform::host());
    let (_, own) = own.ok_or_else(|| {
        anyhow!("one library must be for this machine ({}): it describes the model", Platform::host())
    })?;
    let describe = |library: &Path, folder: Option<&Path>, _: &_| model::describe(library, folder, process);
    load(own, &libraries, Licenses::default(), resources, PathBuf::new(), describe)
}

/// The description of a compiled `library` with the resources in `folder`: the one kept beside it, unless the library or one of
/// these `files` has changed. To find its dependencies, a model runs for seconds.
fn described(
    library: &Path,
    folder: Option<&Path>,
    files: &BTreeMap<String, PackedFile>,
    process: &ProcessOptions,
) -> Result<Description> {
    let mut hasher = DefaultHasher::new();
    (env!("CARGO_PKG_VERSION"), read(library)?, files).hash(&mut hasher);
    let (now, kept) = (hasher.finish(), library.with_extension("description.json"));
    if let Ok(bytes) = fs::read(&kept)
        && let Ok((of, description)) = serde_json::from_slice::<(u64, Description)>(&bytes)
        && of == now
    {
        return Ok(description);
    }
    let description = model::describe(library, folder, process)?;
    // Without the file, the next build takes longer.
    let _ = whole::write(&kept, &serde_json::to_vec(&(now, &description))?);
    Ok(description)
}

/// The model of these libraries, described by the one for this computer.
fn load(
    own: &Path,
    libraries: &[(Platform, PathBuf)],
    licenses: Licenses,
    resources: Option<&Path>,
    stimuli: PathBuf,
    describe: impl Fn(&Path, Option<&Path>, &BTreeMap<String, PackedFile>) -> Result<Description>,
) -> Result<Model> {
    let folder =
        resources.map(|folder| folder.canonicalize().with_context(|| folder.display().to_string())).transpose()?;
    let files = folder.as_deref().map_or_else(|| Ok(BTreeMap::new()), archive::resources)?;
    let description = describe(own, folder.as_deref(), &files)?;
    if !icons::ARE_DRAWN && (description.icon.is_some() || description.terminals.iter().any(|t| t.picture.is_some())) {
        message::note(&printable(&format!(
            "{}: without its icon and pictures, which the command fmu draws",
            description.name
        )));
    }
    let read = |(platform, path): &(Platform, PathBuf)| anyhow::Ok((*platform, read(path)?));
    let binaries = libraries.iter().map(read).collect::<Result<_>>()?;
    let own = vec![read(&(Platform::host(), own.to_owned()))?];
    Ok(Model { description, own, binaries, licenses, resources: files, stimuli })
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| path.display().to_string())
}
