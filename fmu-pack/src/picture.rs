//! Renders pictures as PNG; their only source is SVG.

use crate::error::{Result, ensure, invalid};
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree};

/// Maximum width and height of a picture, in pixels.
const LARGEST: f32 = 8192.0;

/// Draws an SVG document without text on a transparent ground, in the size of the document; equal documents give equal bytes.
///
/// # Errors
/// It is not an SVG document, is too large, or contains text.
pub fn without_text(svg: &str) -> Result<Vec<u8>> {
    // Without fonts, the renderer silently omits text.
    ensure!(!svg.contains("<text"), "has <text>, which looks different with other fonts: draw paths instead");
    draw(svg, &Options::default(), 1.0)
}

/// Draws an SVG document at twice its size, with the fonts of this system.
///
/// # Errors
/// It is not an SVG document, is too large, or the system has no font.
pub fn with_text(svg: &str) -> Result<Vec<u8>> {
    let mut options = Options::default();
    options.fontdb_mut().load_system_fonts();
    let family = options.fontdb.faces().find_map(|face| {
        let (name, _) = face.families.first()?;
        // Prefer a sans-serif, otherwise take any font.
        name.contains("Sans").then(|| name.clone())
    });
    let any = || options.fontdb.faces().find_map(|face| Some(face.families.first()?.0.clone()));
    let none = || invalid!("this system has no font for the text of the picture: write an .svg");
    let family = family.or_else(any).ok_or_else(none)?;
    options.fontdb_mut().set_sans_serif_family(family);
    draw(svg, &options, 2.0)
}

fn draw(svg: &str, options: &Options<'_>, scale: f32) -> Result<Vec<u8>> {
    let tree = Tree::from_str(svg, options).map_err(|e| invalid!("is not an SVG document: {e}"))?;
    let size = tree.size();
    let pixels = |x: f32| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive and at most LARGEST")]
        (x * scale <= LARGEST).then_some((x * scale).ceil() as u32)
    };
    let too_large = || invalid!("is {} x {} pixels; at most {} each", size.width(), size.height(), LARGEST / scale);
    let (width, height) = pixels(size.width()).zip(pixels(size.height())).ok_or_else(too_large)?;
    let mut map = Pixmap::new(width, height).ok_or_else(|| invalid!("has no size"))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut map.as_mut());
    map.encode_png().map_err(|e| invalid!("{e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_has_the_size_and_the_colors_of_its_svg() {
        let svg = r##"<svg xmlns="http://www.w3.org/2000/svg" width="3" height="2"><path fill="#ff0007" d="M1 0h1v2h-1z"/></svg>"##;
        let map = Pixmap::decode_png(&without_text(svg).unwrap()).unwrap();
        let pixels: Vec<_> = map.pixels().iter().map(|p| [p.red(), p.green(), p.blue(), p.alpha()]).collect();
        let (none, red) = ([0; 4], [255, 0, 7, 255]);
        assert_eq!((map.width(), map.height(), pixels), (3, 2, vec![none, red, none, none, red, none]));
    }

    #[test]
    fn what_cannot_be_drawn_is_told() {
        let svg = |inside: &str| format!("<svg xmlns='http://www.w3.org/2000/svg' {inside}</svg>");
        let why = |svg: &str| without_text(svg).unwrap_err().to_string();
        assert!(why(&svg("width='9' height='9'><text>a</text>")).contains("draw paths instead"));
        assert!(why("<svg").contains("is not an SVG document"));
        assert!(why(&svg("width='9999' height='9'>")).contains("9999 x 9 pixels; at most 8192"));
    }
}
