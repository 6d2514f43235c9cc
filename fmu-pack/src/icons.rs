//! The folder `terminalsAndIcons/` of an FMU: its XML, and every picture as SVG and as PNG (FMI 3.0.2, 2.4.9).
//!
//! A terminal of a layered standard, a map or a network, comes with the manifest of that standard. A picture is written once, as SVG; its PNG is drawn here,
//! in the size stated by the SVG.

use crate::archive::PackedFile;
use crate::error::{Context, Result};
#[cfg(feature = "full")]
use crate::picture::without_text;
use fmu_core::Description;
use fmu_core::terminal::MatchingRule;
use model_description::{FmiVersion, write_terminals};
use std::collections::BTreeMap;

const FOLDER: &str = "terminalsAndIcons";

/// The layered standards of terminals: rule, name, version, description, further attributes of the manifest.
const LAYERED: [(MatchingRule, &str, &str, &str, &str); 2] = [
    (
        MatchingRule::Map,
        "org.fmi-standard.fmi-ls-struct",
        "1.0.0-rc.1",
        "Layered standard for structuring of variables",
        "",
    ),
    (
        MatchingRule::Transceiver,
        "org.fmi-standard.fmi-ls-bus",
        "1.0.0",
        "Layered standard for network communication",
        " isBusSimulationFMU=\"false\"",
    ),
];

fn manifest(name: &str, version: &str, description: &str, more: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiLayeredStandardManifest xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" fmi-ls:fmi-ls-name=\"{name}\" \
         fmi-ls:fmi-ls-version=\"{version}\" fmi-ls:fmi-ls-description=\"{description}\"{more}/>\n"
    )
}

/// Whether this build draws pictures: with the feature `full`. Without it, archives have no icon and no pictures of terminals, because
/// the standards require each as PNG.
pub const ARE_DRAWN: bool = cfg!(feature = "full");

#[cfg(not(feature = "full"))]
fn without_text(_: &str) -> Result<Vec<u8>> {
    Err(crate::error::invalid!("this build draws no pictures"))
}

/// The model without icon and pictures.
fn bare(description: &Description) -> Description {
    let mut bare = description.clone();
    bare.icon = None;
    bare.terminals.iter_mut().for_each(|terminal| terminal.picture = None);
    bare
}

/// The files; empty for a model without terminals and icon.
///
/// # Errors
/// A picture is not an SVG document, or contains text.
pub fn files(description: &Description, version: FmiVersion) -> Result<BTreeMap<String, PackedFile>> {
    let bare = (!ARE_DRAWN).then(|| bare(description));
    let description = bare.as_ref().unwrap_or(description);
    let mut files = BTreeMap::new();
    let file = |bytes: Vec<u8>| PackedFile { bytes, executable: false };
    if let Some(xml) = write_terminals(description, version) {
        files.insert(format!("{FOLDER}/terminalsAndIcons.xml"), file(xml.into_bytes()));
    }
    for (rule, name, of, about, more) in LAYERED {
        if version == FmiVersion::V3 && description.terminals.iter().any(|t| t.rule == rule) {
            files.insert(format!("extra/{name}/fmi-ls-manifest.xml"), file(manifest(name, of, about, more).into()));
        }
    }
    let of_terminals = description.terminals.iter().filter_map(|t| t.picture.as_ref());
    let mut pictures: BTreeMap<&str, &str> = of_terminals.map(|p| (p.icon.as_str(), p.svg.as_str())).collect();
    pictures.extend(description.icon.as_ref().map(|svg| ("icon", svg.as_str())));
    for (name, svg) in pictures {
        let png = without_text(svg).with_context(|| format!("the picture {name} of {}", description.name))?;
        // FMI 2.0.5, 2.3: the icon's location without terminals.
        if name == "icon" && version == FmiVersion::V2 {
            files.insert("model.png".into(), file(png.clone()));
        }
        files.insert(format!("{FOLDER}/{name}.png"), file(png));
        files.insert(format!("{FOLDER}/{name}.svg"), file(svg.as_bytes().into()));
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive::{PmsmDrive, PmsmPlant, SensorlessController};
    use fmu_core::Stored;

    fn names<M: Stored>(version: FmiVersion) -> Vec<String> {
        files(&Description::of::<M>().unwrap(), version).unwrap().into_keys().collect()
    }

    /// Every picture exists once as PNG and SVG and is not empty: each of our pictures covers at least a fifth of its square.
    #[test]
    fn every_picture_of_the_models_is_drawn() {
        assert_eq!(
            names::<SensorlessController>(FmiVersion::V3),
            ["icon.png", "icon.svg", "phases.png", "phases.svg", "sensor.png", "sensor.svg", "terminalsAndIcons.xml"]
                .map(|name| format!("terminalsAndIcons/{name}"))
        );
        assert_eq!(names::<PmsmDrive>(FmiVersion::V2)[0], "model.png");
        for (name, entry) in files(&Description::of::<PmsmPlant>().unwrap(), FmiVersion::V2).unwrap() {
            if entry.bytes.starts_with(b"\x89PNG") {
                let map = resvg::tiny_skia::Pixmap::decode_png(&entry.bytes).unwrap();
                let opaque = map.pixels().iter().filter(|p| p.alpha() == 255).count();
                assert!(5 * opaque > map.pixels().len(), "{name}: {opaque} of {} pixels", map.pixels().len());
            }
        }
    }

    #[test]
    fn a_model_without_pictures_has_no_files() {
        let mut bare = Description::of::<PmsmPlant>().unwrap();
        (bare.terminals, bare.icon) = (Vec::new(), None);
        assert!(files(&bare, FmiVersion::V2).unwrap().is_empty());
    }

    #[test]
    fn without_pictures_the_terminals_stay() {
        let whole = Description::of::<PmsmPlant>().unwrap();
        let bare = super::bare(&whole);
        let names = |d: &Description| d.terminals.iter().map(|t| t.name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&bare), names(&whole));
        assert_eq!(
            files(&bare, FmiVersion::V3).unwrap().into_keys().collect::<Vec<_>>(),
            ["terminalsAndIcons/terminalsAndIcons.xml"]
        );
    }
}
