//! Pages that need no network: one style for all, and [`Figure`]s with zoom, legend switches and readings at the cursor.

use crate::error::Error;
use crate::figure::{Curve, Figure, Panel};
use crate::ink::Ink;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde_json::{Value, json};
use std::io::Write as _;
use std::rc::Rc;

/// The style of every document: colors on light and dark paper, the font, boxes that scroll.
const BASE: &str = include_str!("base.css");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("plot.js");

/// Functions for axes, in JavaScript: `find`, `ticks`, `minus`, `onAxis`, `shown`.
pub const AXIS: &str = include_str!("axis.js");

/// Escapes text for HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A dash in a color, placed before a name.
pub fn swatch(ink: Ink) -> String {
    format!("<span class=\"swatch\" style=\"background:{ink}\"></span>")
}

/// A document with the common style and an additional `style`; `head` precedes it, and `body` is the content of `<body>`.
pub fn document(title: &str, head: &str, style: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n{head}<style>\n{BASE}{style}</style>\n</head>\n\
         <body>\n{body}</body>\n</html>\n"
    )
}

/// A page of results: its title, which is also its heading, and its body below.
pub fn page(title: &str, body: &str) -> String {
    // Only figures need the script.
    let script =
        if body.contains("class=\"figure\"") { format!("<script>\n{SCRIPT}{AXIS}</script>\n") } else { String::new() };
    document(title, "", STYLE, &format!("<main>\n<h1>{}</h1>\n{body}</main>\n{script}", escape(title)))
}

/// A figure with its data, for a [`page`]; `instead` is HTML for browsers without JavaScript.
///
/// # Errors
/// There is nothing to draw.
pub fn figure(figure: &Figure, instead: &str) -> Result<String, Error> {
    if figure.is_empty() {
        return Err(Error::Empty);
    }
    let mut data = Data::default();
    let panels: Vec<Value> = figure.panels.iter().map(|panel| data.panel(panel)).collect();
    let mut deflated = ZlibEncoder::new(Vec::new(), Compression::best());
    deflated.write_all(&data.bytes)?;
    let json = json!({
        "label": figure.x,
        "columns": figure.columns,
        "panels": panels,
        "axes": data.axes.iter().map(|(_, at)| at).collect::<Vec<_>>(),
        "lengths": data.lengths,
        "values": STANDARD.encode(deflated.finish()?),
    });
    // Without '<', no text can end the element.
    let json = json.to_string().replace('<', "\\u003c");
    Ok(format!(
        "<div class=\"figure\">\n<script type=\"application/json\">{json}</script>\n<noscript><p>{instead}</p></noscript>\n</div>\n"
    ))
}

/// The numbers of a figure, coded.
#[derive(Default)]
struct Data {
    bytes: Vec<u8>,
    lengths: Vec<usize>,
    /// Horizontal coordinates, each the sum of two arrays, with the numbers of these arrays.
    axes: Vec<(Rc<[f64]>, [usize; 2])>,
}

impl Data {
    fn panel(&mut self, panel: &Panel) -> Value {
        let curves: Vec<Value> = panel.curves.iter().map(|curve| self.curve(curve)).collect();
        let mut json = json!({ "title": panel.title, "unit": panel.unit, "window": [panel.window.0, panel.window.1], "curves": curves });
        if panel.log {
            json["log"] = true.into();
        }
        json
    }

    fn curve(&mut self, curve: &Curve) -> Value {
        let known = self.axes.iter().position(|(x, _)| Rc::ptr_eq(x, &curve.x));
        let x = known.unwrap_or_else(|| {
            let high = self.array(curve.x.iter().map(|x| single(*x)));
            let low = self.array(curve.x.iter().map(|x| single(x - f64::from(single(*x)))));
            self.axes.push((curve.x.clone(), [high, low]));
            self.axes.len() - 1
        });
        let y = self.array(curve.y.iter().map(|y| seen(*y)));
        let Curve { name, ink, opacity, dashed, lost, .. } = curve;
        json!({ "name": name, "ink": ink, "opacity": opacity, "dashed": dashed, "lost": lost, "x": x, "y": y })
    }

    /// Appends an array and returns its number. The code stores the differences of successive bit patterns, with the sign in
    /// the last bit (zigzag), then all lowest bytes, all second bytes and so on: this order compresses best.
    fn array(&mut self, values: impl Iterator<Item = f32>) -> usize {
        let mut last = 0_i32;
        let coded: Vec<[u8; 4]> = values
            .map(|x| {
                let bits = x.to_bits().cast_signed();
                let difference = bits.wrapping_sub(std::mem::replace(&mut last, bits));
                ((difference << 1) ^ (difference >> 31)).to_le_bytes()
            })
            .collect();
        (0..4).for_each(|plane| self.bytes.extend(coded.iter().map(|bytes| bytes[plane])));
        self.lengths.push(coded.len());
        self.lengths.len() - 1
    }
}

/// A value rounded by at most a relative 1e-6, which saves a sixth of the space. The vertical axis never spans less than 2e-3 of
/// its values, so the error is less than a pixel at any zoom.
fn seen(y: f64) -> f32 {
    let bits = single(y).to_bits();
    f32::from_bits(bits.saturating_add(8) & !15)
}

#[expect(clippy::cast_possible_truncation, reason = "the remainder is a second array, or too small to be seen")]
fn single(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ink::CURVES;
    use flate2::read::ZlibDecoder;
    use std::io::Read as _;

    /// Decodes like `unpack` in `plot.js`.
    fn unpack(json: &Value) -> Vec<Vec<f32>> {
        let packed = STANDARD.decode(json["values"].as_str().unwrap()).unwrap();
        let mut bytes = Vec::new();
        ZlibDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
        let mut rest = &bytes[..];
        let lengths = json["lengths"].as_array().unwrap().iter().map(|n| usize::try_from(n.as_u64().unwrap()).unwrap());
        let arrays = lengths.map(|n| {
            let (own, after) = rest.split_at(4 * n);
            rest = after;
            let mut last = 0_u32;
            let one = |k: usize| {
                let z = u32::from_le_bytes([own[k], own[n + k], own[2 * n + k], own[3 * n + k]]);
                last = last.wrapping_add((z >> 1) ^ 0_u32.wrapping_sub(z & 1));
                f32::from_bits(last)
            };
            (0..n).map(one).collect()
        });
        arrays.collect()
    }

    #[test]
    fn the_numbers_come_back() {
        let x: Rc<[f64]> = (0..1000).map(|k| 1e5 + 1e-4 * f64::from(k)).collect();
        let y: Vec<f64> = x.iter().enumerate().map(|(k, x)| if k == 7 { f64::NAN } else { -1e3 * x.sin() }).collect();
        let curves = vec![
            Curve::new("a</script>", CURVES[0], &x, y.clone()),
            Curve::new("b", CURVES[1], &x, vec![f64::INFINITY, 1e300]),
        ];
        let panels = vec![Panel { unit: "A".into(), window: (x[0], x[999]), curves, ..Panel::default() }];
        let html = figure(&Figure { title: "f".into(), x: "time in s", columns: 1, panels }, "none").unwrap();
        assert_eq!(html.matches("</script>").count(), 1);
        let json = html.split_once("json\">").unwrap().1.split_once("</script>").unwrap().0;
        let json: Value = serde_json::from_str(json).unwrap();
        let arrays = unpack(&json);
        assert_eq!(
            (arrays.len(), json["axes"].as_array().unwrap().len()),
            (4, 1),
            "the axis is stored once, in two parts"
        );
        for k in 0..1000 {
            assert!((f64::from(arrays[0][k]) + f64::from(arrays[1][k]) - x[k]).abs() < 1e-9);
            assert!(k == 7 && arrays[2][k].is_nan() || (f64::from(arrays[2][k]) / y[k] - 1.0).abs() < 1.1e-6);
        }
        assert_eq!(arrays[3], [f32::INFINITY, f32::INFINITY]);
        assert_eq!(json["panels"][0]["curves"][0]["name"], "a</script>");
    }
}
