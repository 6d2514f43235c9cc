//! `fmu page`: writes pages that run FMUs in a browser.

mod site;

use anyhow::{Context, Result, anyhow, ensure};
use cargo_fmu::build::choose;
use cargo_fmu::{Failed, message};
use clap::Args;
use fmu_core::Description;
use fmu_core::description::{Dependencies, VariableKind};
use fmu_import::{Folder, describe};
use fmu_pack::compile::{Profile, compile, module};
use fmu_pack::licenses::Licenses;
use fmu_pack::page::{self, FILE, Source};
use fmu_pack::preset::PresetFmu;
use fmu_pack::reference::STIMULI;
use fmu_pack::target::{Tools, has_modules};
use fmu_pack::workspace::{Package, Workspace};
use std::fs;
use std::path::{Path, PathBuf};

/// Writes pages that run FMUs in a web browser.
///
/// A page is one HTML file that needs no network and no installation: it contains the model's code as WebAssembly, sliders for
/// its inputs and parameters, plots, presets, and a link that repeats a run bit for bit. It opens with a double click. Without
/// names, the command writes a page for every FMU of the package or workspace around the current folder, as `fmu build` builds
/// them.
///
/// From a FILE.fmu of `fmu build` or `fmu preset`, the page takes the start values and the default experiment; the code comes
/// from the workspace, which must be the one that built it.
///
/// page.toml beside the package's Cargo.toml chooses inputs, plots, vectors and presets (docs/pages.md). Without it, the page has a plot
/// for each unit of the outputs and the default experiment.
///
/// --site DIR writes the pages of the whole workspace with a first page that links them: the FMUs, their documentation, and in
/// the workspace of the drives its machines and results (some minutes).
///
/// The command needs Rust's standard library for WebAssembly: rustup target add wasm32-unknown-unknown
///
/// The drive, and then the drive with another motor:
///   fmu page PmsmDrive
///   fmu preset target/fmu/fmi3/PmsmDrive.fmu --motor motors/ipmsm-2.2kw.toml --name Pump --out Pump.fmu
///   fmu page Pump.fmu --out Pump.html
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Page {
    /// FMUs by package or FMU name, or archives of this workspace [default: all FMUs of the workspace]
    #[arg(value_name = "FMU|FILE.fmu", conflicts_with = "package")]
    pub fmus: Vec<String>,
    /// Package of this workspace with a cdylib (repeatable)
    #[arg(long, value_name = "NAME")]
    pub package: Vec<String>,
    /// File of the one page, or folder of NAME.html [default: fmu/page in Cargo's target folder]
    #[arg(long, value_name = "FILE.html|DIR")]
    pub out: Option<PathBuf>,
    /// Write all pages of the workspace to this folder
    #[arg(long, value_name = "DIR", conflicts_with_all = ["fmus", "package", "out", "module"])]
    pub site: Option<PathBuf>,
    /// Existing module, instead of compiling the FMU
    #[arg(long, value_name = "FILE.wasm")]
    pub module: Option<PathBuf>,
}

/// A model for a page.
struct Model {
    description: Description,
    plain: Description,
    package: String,
    folder: PathBuf,
    /// Text of the inputs of the default experiment, if they differ from the package's.
    stimuli: Option<Vec<u8>>,
}

/// Runs the command; returns the files that were written.
///
/// # Errors
/// A name is not an FMU, the compiler fails, `page.toml` does not fit the model, or a file cannot be written.
pub fn run(args: &Page) -> Result<Vec<PathBuf>> {
    if args.module.is_none() {
        has_modules()?;
    }
    let workspace = Workspace::find()?;
    if let Some(folder) = &args.site {
        return Ok(vec![site::run(&workspace, folder)?]);
    }
    let models = models(&workspace, args)?;
    let single = args.out.as_ref().filter(|out| out.extension().is_some_and(|e| e == "html"));
    ensure!(
        models.len() == 1 || (single.is_none() && args.module.is_none()),
        "{} pages need a folder, with one module per page: --out DIR",
        models.len()
    );
    // Errors in page.toml are reported before anything is compiled.
    for model in &models {
        page::is_possible(&model.description)?;
        own(model)?;
    }
    let mut written = Vec::new();
    for model in &models {
        let file = match &args.module {
            Some(file) => file.clone(),
            None => module(&workspace, &model.package)?,
        };
        let module = fs::read(&file).with_context(|| file.display().to_string())?;
        let out = single.cloned().unwrap_or_else(|| {
            let folder = args.out.clone().unwrap_or_else(|| workspace.target.join("fmu").join("page"));
            folder.join(format!("{}.html", model.description.model_name()))
        });
        write(&workspace, model, &module, &out)?;
        written.push(out);
    }
    Ok(written)
}

/// Writes the page of a model.
fn write(workspace: &Workspace, model: &Model, module: &[u8], out: &Path) -> Result<()> {
    let dir = Folder::new().with_context(|| std::env::temp_dir().display().to_string())?;
    let mut stimuli = model.folder.join(STIMULI);
    if let Some(text) = &model.stimuli {
        stimuli = dir.path().join(STIMULI);
        fs::write(&stimuli, text).with_context(|| stimuli.display().to_string())?;
    }
    let own = own(model)?;
    let source = Source {
        description: &model.description,
        plain: &model.plain,
        module,
        own: own.as_ref().map(|(path, text)| (path.as_path(), text.as_str())),
        stimuli: Some(&stimuli),
        licenses: &Licenses::of_package(workspace, &model.package).text(&model.description),
    };
    let html = page::page(&source).with_context(|| model.description.model_name().to_owned())?;
    Ok(fmu_pack::archive::write(out, html.as_bytes())?)
}

/// The `page.toml` of a model, checked against it.
fn own(model: &Model) -> Result<Option<(PathBuf, String)>> {
    let path = model.folder.join(FILE);
    if !path.is_file() {
        return Ok(None);
    }
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    page::judged(&model.plain, Some((&path, &text)))?;
    Ok(Some((path, text)))
}

fn models(workspace: &Workspace, args: &Page) -> Result<Vec<Model>> {
    let is_archive = |name: &&String| Path::new(name).extension().is_some_and(|e| e.eq_ignore_ascii_case("fmu"));
    let (archives, names): (Vec<&String>, Vec<&String>) = args.fmus.iter().partition(is_archive);
    let named = |name: &String| {
        let package = workspace.package(name).filter(|p| p.has_cdylib());
        package.ok_or_else(|| anyhow!("{name} is not a package with crate-type = [\"cdylib\"] here"))
    };
    let packages: Vec<&Package> = if args.package.is_empty() {
        let names: Vec<String> = names.into_iter().cloned().collect();
        if names.is_empty() && !archives.is_empty() { Vec::new() } else { choose(&workspace.fmus(), &names)? }
    } else {
        args.package.iter().map(named).collect::<Result<_>>()?
    };
    let mut models =
        archives.into_iter().map(|file| archive(workspace, Path::new(file))).collect::<Result<Vec<_>>>()?;
    let names: Vec<String> = packages.iter().map(|p| p.name.clone()).collect();
    if names.is_empty() {
        return Ok(models);
    }
    for (package, library) in compile(workspace, &names, &Tools::find()?.host(), Profile::Release)? {
        let folder = workspace.package(&package).map_or(Path::new("."), Package::folder).to_owned();
        let description = describe(&library, None, Dependencies::Omitted).map_err(|e| reads_files(&folder, e))?;
        if let Some(clock) = description.variables.iter().find(|v| matches!(v.kind, VariableKind::Clock(_))) {
            let why = format!("{}: a page does not tick the clock {}", description.name, clock.name);
            if args.fmus.is_empty() && args.package.is_empty() {
                message::note(&why);
                continue;
            }
            return Err(Failed(why).into());
        }
        models.push(Model { plain: description.clone(), description, package, folder, stimuli: None });
    }
    Ok(models)
}

/// A model that reads files at instantiation has none in a page.
fn reads_files(folder: &Path, cause: fmu_import::Error) -> anyhow::Error {
    if folder.join("resources").is_dir() {
        return Failed(format!("the model reads resources/ at instantiation, which a page cannot provide: {cause}"))
            .into();
    }
    cause.into()
}

fn archive(workspace: &Workspace, file: &Path) -> Result<Model> {
    let preset = PresetFmu::open(file)?;
    let plain = preset.own().clone();
    let package = choose(&workspace.fmus(), std::slice::from_ref(&plain.name));
    let package = package.with_context(|| format!("{}: its code is not in this workspace", file.display()))?[0];
    let (description, stimuli) = preset.archived()?;
    Ok(Model { description, plain, package: package.name.clone(), folder: package.folder().to_owned(), stimuli })
}
