//! `fmu page --site`: the pages of a whole workspace as a folder for a server or for a double click.

use super::{Model, archive, write};
use crate::commands::atlas::{self, Atlas};
use crate::commands::build::{self, Models};
use crate::commands::compare::{self, Compare};
use crate::commands::preset;
use anyhow::{Context, Result, bail};
use cargo_fmu::message;
use drive_tools::tune;
use fmu_import::Folder;
use fmu_pack::compile::module;
use fmu_pack::workspace::Workspace;
use fmu_plot::page::{escape, page};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// The FMU for whose machine presets pages are written.
const DRIVE: &str = "PmsmDrive";

/// A link of the first page: file, title, one sentence.
type Link = (String, String, String);

/// Writes the folder; returns its first page.
///
/// # Errors
/// An FMU cannot be built, or a file cannot be written.
pub(super) fn run(workspace: &Workspace, out: &Path) -> Result<PathBuf> {
    let built = Folder::new()?;
    let archives =
        build::models(&Models { fmi: Some("3".into()), out: Some(built.path().into()), ..Models::default() })?;
    let mut sections: Vec<(&str, Vec<Link>)> = Vec::new();
    let (mut pages, mut documents, mut machines) = (Vec::new(), Vec::new(), Vec::new());
    for file in &archives {
        let model = archive(workspace, file)?;
        let module = fs::read(module(workspace, &model.package)?)?;
        pages.push(link(workspace, &model, &module, out, "")?);
        documents.push(document(file, &model, out)?);
        if model.plain.name == DRIVE {
            machines = of_machines(workspace, file, &module, out)?;
        }
    }
    sections.push(("Try a model in this browser", pages));
    if !machines.is_empty() {
        sections.push(("The drive with other machines", machines));
        sections.push(("Results", results(out)?));
    }
    sections.push(("Equations and variables", documents));
    let mut body = String::new();
    for (title, links) in sections {
        // Writing to a String does not fail.
        let _ = write!(body, "<h2>{title}</h2>\n<ul>\n");
        for (file, name, text) in links {
            let _ = writeln!(body, "<li><a href=\"{}\">{}</a>: {}</li>", escape(&file), escape(&name), escape(&text));
        }
        body += "</ul>\n";
    }
    let first = out.join("index.html");
    let name = workspace.root.file_name().map_or_else(|| "FMUs".into(), |name| name.to_string_lossy());
    let title = if archives.iter().any(|file| file.ends_with(format!("{DRIVE}.fmu"))) {
        "Sensorless motor drives as FMUs"
    } else {
        &name
    };
    fmu_pack::archive::write(&first, page(title, &body).as_bytes())?;
    no_dead_link(out)?;
    Ok(first)
}

fn link(workspace: &Workspace, model: &Model, module: &[u8], out: &Path, folder: &str) -> Result<Link> {
    let name = model.description.model_name();
    let file = format!("{folder}{name}.html");
    write(workspace, model, module, &out.join(&file))?;
    Ok((file, name.into(), model.description.description.clone()))
}

/// The documentation page of an archive, with the files that it links.
fn document(file: &Path, model: &Model, out: &Path) -> Result<Link> {
    let (_, files) = fmu_import::contents(file)?;
    let name = model.description.model_name();
    for (path, bytes) in files.iter().filter_map(|(path, bytes)| Some((path.strip_prefix("documentation/")?, bytes))) {
        fmu_pack::archive::write(&out.join(name).join(path), bytes)?;
    }
    Ok((format!("{name}/index.html"), name.into(), "equations, how to connect it, all variables".into()))
}

/// The page of the drive with each machine of `motors/`.
fn of_machines(workspace: &Workspace, drive: &Path, module: &[u8], out: &Path) -> Result<Vec<Link>> {
    let folder = workspace.root.join("motors");
    let mut files: Vec<PathBuf> = match folder.read_dir() {
        Ok(entries) => entries.flatten().map(|entry| entry.path()).collect(),
        Err(_) => Vec::new(),
    };
    files.retain(|file| file.extension().is_some_and(|e| e == "toml"));
    files.sort();
    let dir = Folder::new()?;
    let mut links = Vec::new();
    for file in files {
        let tuned = tune::tune(&file)?;
        let preset = dir.path().join("preset.fmu");
        if let Err(why) = preset::of_machine(drive, &tuned, &preset) {
            message::note(&format!("{}: gets no page: {why:#}", file.display()));
            continue;
        }
        let mut model = archive(workspace, &preset)?;
        let name =
            file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).context("a motor without a name")?;
        model.description.title = Some(name);
        links.push(link(workspace, &model, module, out, "machines/")?);
    }
    Ok(links)
}

/// The results of the README, and the atlas.
fn results(out: &Path) -> Result<Vec<Link>> {
    let compared = compare::run(&Compare { out: Some(out.join("compare")), ..Compare::default() })?;
    if !compared {
        message::note("a figure of compare is outside its tolerance");
    }
    atlas::run(&Atlas {
        estimator: vec!["Rasmussen".into()],
        every: 1,
        out: Some(out.join("atlas")),
        ..Atlas::default()
    })?;
    Ok(vec![
        ("compare/compare.html".into(), "Estimators compared".into(), "every estimator through every scenario".into()),
        (
            "atlas/atlas.html".into(),
            "Atlas".into(),
            "where a drive with wrong estimates loses the rotor at low speed".into(),
        ),
    ])
}

/// Requires that every relative link of every page leads to a file.
fn no_dead_link(out: &Path) -> Result<()> {
    let mut folders = vec![out.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in folder.read_dir()? {
            let path = entry?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "html") {
                let text = fs::read_to_string(&path)?;
                let links = text.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next());
                for target in
                    links.filter(|target| !target.starts_with('#') && !target.contains(':') && !target.contains('$'))
                {
                    let file = target.split('#').next().unwrap_or_default();
                    if !folder.join(file).exists() {
                        bail!("{}: a link to {target}, which does not exist", path.display());
                    }
                }
            }
        }
    }
    Ok(())
}
