//! The folder `terminalsAndIcons/` of an FMU: its XML, and every picture as SVG and as PNG (FMI 3.0.2, 2.4.9).
//!
//! A picture is written once, as SVG; its PNG is drawn here, in the size that the SVG gives itself.

use crate::pack::Entry;
use anyhow::{Context, Result, anyhow, bail};
use fmu_core::Description;
use model_description::{FmiVersion, write_terminals};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{self, Tree};
use std::collections::BTreeMap;

const FOLDER: &str = "terminalsAndIcons";

/// Widest and highest picture that is drawn, in pixels.
const LARGEST: f32 = 2048.0;

/// The files; none for a model without terminals and icon.
///
/// # Errors
/// A picture is not an SVG document, or contains text.
pub fn files(description: &Description, version: FmiVersion) -> Result<BTreeMap<String, Entry>> {
    let mut files = BTreeMap::new();
    let file = |bytes: Vec<u8>| Entry { bytes, executable: false };
    if let Some(xml) = write_terminals(description) {
        files.insert(format!("{FOLDER}/terminalsAndIcons.xml"), file(xml.into_bytes()));
    }
    let of_terminals = description.terminals.iter().filter_map(|t| t.picture.as_ref());
    let mut pictures: BTreeMap<&str, &str> = of_terminals.map(|p| (p.icon.as_str(), p.svg.as_str())).collect();
    pictures.extend(description.icon.as_ref().map(|svg| ("icon", svg.as_str())));
    for (name, svg) in pictures {
        let png = png(svg).with_context(|| format!("the picture {name} of {}", description.name))?;
        // FMI 2.0.5, 2.3: the icon's location without terminals.
        if name == "icon" && version == FmiVersion::V2 {
            files.insert("model.png".into(), file(png.clone()));
        }
        files.insert(format!("{FOLDER}/{name}.png"), file(png));
        files.insert(format!("{FOLDER}/{name}.svg"), file(svg.as_bytes().into()));
    }
    Ok(files)
}

/// The picture as PNG with a transparent ground; the same SVG gives the same bytes.
fn png(svg: &str) -> Result<Vec<u8>> {
    // Without fonts, the renderer silently omits text.
    if svg.contains("<text") {
        bail!("has <text>, which is drawn differently wherever the fonts differ: draw paths instead");
    }
    let tree = Tree::from_str(svg, &usvg::Options::default()).map_err(|e| anyhow!("is not an SVG document: {e}"))?;
    let size = tree.size();
    let pixels = |x: f32| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive and at most LARGEST")]
        (x <= LARGEST).then_some(x.ceil() as u32)
    };
    let too_large = || anyhow!("is {} x {} pixels; at most {LARGEST} each", size.width(), size.height());
    let (width, height) = pixels(size.width()).zip(pixels(size.height())).ok_or_else(too_large)?;
    let mut map = Pixmap::new(width, height).ok_or_else(|| anyhow!("has no size"))?;
    resvg::render(&tree, Transform::identity(), &mut map.as_mut());
    Ok(map.encode_png()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive::{PmsmDrive, PmsmPlant, SensorlessController};
    use fmu_core::Model;

    #[test]
    fn a_picture_has_the_size_and_the_colors_of_its_svg() {
        let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="3" height="2"><path fill="#ff0007" d="M1 0h1v2h-1z"/></svg>"##;
        let map = Pixmap::decode_png(&png(svg).unwrap()).unwrap();
        let pixels: Vec<_> = map.pixels().iter().map(|p| [p.red(), p.green(), p.blue(), p.alpha()]).collect();
        let (none, red) = ([0; 4], [255, 0, 7, 255]);
        assert_eq!((map.width(), map.height(), pixels), (3, 2, vec![none, red, none, none, red, none]));
    }

    #[test]
    fn what_cannot_be_drawn_is_told() {
        let svg = |inside: &str| format!("<svg xmlns='http://www.w3.org/2000/svg' {inside}</svg>");
        let why = |svg: &str| png(svg).unwrap_err().to_string();
        assert!(why(&svg("width='9' height='9'><text>a</text>")).contains("draw paths instead"));
        assert!(why("<svg").contains("is not an SVG document"));
        assert!(why(&svg("width='9999' height='9'>")).contains("9999 x 9 pixels; at most 2048"));
    }

    fn names<M: Model>(version: FmiVersion) -> Vec<String> {
        files(&Description::of::<M>().unwrap(), version).unwrap().into_keys().collect()
    }

    /// Every picture is there as PNG and SVG, once, and never empty: each of ours covers a fifth of its square at least.
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
                let map = Pixmap::decode_png(&entry.bytes).unwrap();
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
}
