//! A Modelica package around an FMU: a drive with a flange, ports and a dialog, for the block that an import creates from the
//! FMU.
//!
//! - `interface`: the mapping of terminals to ports; `base`, `shafts`: the drives; `machines`: records of machines.
//! - `examples`: drive trains, and the script for OpenModelica.

mod base;
mod examples;
mod figures;
mod interface;
mod machines;
mod shafts;
mod text;

use anyhow::{Context, Result, bail};
use interface::{Interface, Kind, Variable};
use model_description::{FmiVersion, ModelDescription};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use text::html;

/// What to write.
#[derive(Clone, Debug, Default)]
pub struct Wrapping {
    /// Name of the package, if it differs from the FMU's with `Lib`.
    pub name: Option<String>,
    /// Class of the imported block, if it differs from OpenModelica's.
    pub block: Option<String>,
    /// Files of machines.
    pub motors: Vec<PathBuf>,
}

/// Paths of the picture in FMI 2.0 and FMI 3.0.
const ICON: &str = "terminalsAndIcons/icon.png";

/// The files of the package by their names below the output folder, and the name of the package.
///
/// # Errors
/// The FMU has no shaft, or Model Exchange is missing; a name is invalid in Modelica; a machine does not match.
pub fn files(fmu: &Path, options: &Wrapping) -> Result<(String, BTreeMap<String, Vec<u8>>)> {
    let (md, contents) = fmu_import::contents(fmu)?;
    let terminals = fmu_import::outline(fmu)?.terminals;
    let of = || fmu.display().to_string();
    let interface = Interface::of(&md, terminals.as_ref()).with_context(of)?;
    let identifier = identifier(&md).with_context(of)?;
    let package = options.name.clone().unwrap_or_else(|| format!("{identifier}Lib"));
    text::check("--name", &package)?;
    let block = match &options.block {
        Some(block) => {
            block.split('.').try_for_each(|part| text::check("--block", part))?;
            block.clone()
        }
        None if md.version == FmiVersion::V3 || md.model_exchange.is_none() => bail!(
            "{}: OpenModelica imports FMI 2.0 for Model Exchange, and this is {} of FMI {}; use the archive of FMI \
             2.0, or give the class of another import with --block",
            of(),
            if md.model_exchange.is_none() { "Co-Simulation" } else { "an FMU" },
            md.fmi_version
        ),
        None => format!("{identifier}_me_FMU"),
    };
    let machines = machines::read(&options.motors, &interface)?;
    let set = machines::names(&machines);
    let about = md.description.clone().unwrap_or_default();
    let mut files = BTreeMap::new();
    let mut order = vec!["Block", "Base"];
    let mut put = |name: &str, text: String| {
        files.insert(format!("{package}/{name}"), text.into_bytes());
    };
    put("Block.mo", of_block(&package, &block));
    put("Base.mo", base::text(&package, &about, &interface, &set).with_context(of)?);
    let shafts = [
        ("ImposedShaft", shafts::imposed(&package, &interface)),
        ("CompliantShaft", shafts::compliant(&package, &interface)),
    ];
    for (name, text) in shafts.into_iter().filter_map(|(name, text)| Some((name, text?))) {
        order.insert(order.len() - 2, name);
        put(&format!("{name}.mo"), text);
    }
    if !machines.is_empty() {
        put("Machines.mo", machines::text(&package, &machines, &interface)?);
        order.insert(order.len() - 2, "Machines");
    }
    put("Types.mo", types(&package, &interface));
    order.insert(order.len() - 2, "Types");
    put("Examples.mo", examples::text(&package, &interface));
    order.insert(0, "Examples");
    put("package.mo", head(&package, &md, &identifier, &block));
    put("package.order", order.join("\n") + "\n");
    if options.block.is_none() && interface.imposed.is_some() {
        let figures = figures::of(fmu, &interface).map_err(|why| format!("{why:#}"));
        let script = examples::script(&package, &format!("{identifier}.fmu"), &block, &figures);
        files.insert("import.mos".into(), script.into_bytes());
        files.insert(format!("{identifier}.fmu"), std::fs::read(fmu).with_context(of)?);
    }
    if let Some(icon) = contents.get(ICON) {
        files.insert(format!("{package}/Resources/Images/icon.png"), icon.clone());
    }
    Ok((package, files))
}

fn identifier(md: &ModelDescription) -> Result<String> {
    let interface = md.model_exchange.as_ref().or(md.co_simulation.as_ref());
    let identifier = interface.context("has neither Model Exchange nor Co-Simulation")?.model_identifier.clone();
    text::check("modelIdentifier", &identifier)?;
    Ok(identifier)
}

/// The only file that names the imported block.
fn of_block(package: &str, block: &str) -> String {
    format!(
        "within {package};\nmodel Block = {block}\n  \"The block that the import created from the FMU; if it has another name, write it here\";\n"
    )
}

/// The enumerations.
fn types(package: &str, interface: &Interface) -> String {
    let mut out = format!(
        "within {package};\npackage Types\n  \"Enumerations of the FMU\"\n  extends Modelica.Icons.TypesPackage;\n"
    );
    let used = |name: &str| {
        let is = |v: &Variable| matches!(&v.kind, Kind::Enumeration { of, .. } if of == name);
        interface.parameters.iter().any(is)
    };
    for definition in interface.enumerations.iter().filter(|t| used(&text::identifier(&t.name))) {
        let item = |item: &model_description::Item| {
            let about = item.description.as_deref().map(|text| format!(" \"{}\"", html(text))).unwrap_or_default();
            format!("    {}{about}", item.name)
        };
        let items: Vec<String> = definition.items.iter().map(item).collect();
        let about = definition.description.as_deref().map(html).unwrap_or_default();
        let name = text::identifier(&definition.name);
        let _ = write!(out, "\n  type {name} = enumeration(\n{})\n    \"{about}\";\n", items.join(",\n"));
    }
    out + "end Types;\n"
}

/// `package.mo`.
fn head(package: &str, md: &ModelDescription, identifier: &str, block: &str) -> String {
    let about = html(md.description.as_deref().unwrap_or_default());
    let version = md.model_version.as_deref().map(|v| format!(" {}", html(v))).unwrap_or_default();
    format!(
        "package {package}
  \"{about}\"
  extends Modelica.Icons.Package;
  annotation(
    uses(Modelica(version=\"4.0.0\")),
    Documentation(info=\"<html>
<p>A package around the FMU {identifier}{version} (FMI {fmi}), written by fmu modelica. It needs the block {block}, which the import of
the FMU makes: load that first.</p>
<p>ImposedShaft has the rotor's inertia here and suits every drive train. In CompliantShaft the rotor turns in the FMU, behind a spring.
All inputs have constants; a switch use_... in the dialog replaces one by a connector, pins or a heat port, which must then be
connected. Enumerations keep the values of the FMU, because the import sends none: fmu preset gives an FMU others.</p>
</html>\"));
end {package};
",
        fmi = html(&md.fmi_version),
    )
}
