//! Drawings: closed paths in a plane, which an OpenSCAD text imports.

pub mod dxf;
pub mod svg;

use super::Place;
use super::problem::Problem;
use glam::DVec2;

/// How a drawing is read.
pub struct Frame<'f> {
    /// The layer that counts; empty for all.
    pub layer: &'f str,
    /// The id of the element that counts, where a format has any; empty for all.
    pub id: &'f str,
    /// Points of an inch, where a format counts in these.
    pub dpi: f64,
    /// The middle of what is drawn is the origin.
    pub center: bool,
    /// What becomes the origin.
    pub origin: DVec2,
    /// By how much it is scaled, after that.
    pub scale: f64,
    /// Into how many pieces a whole turn of a radius is cut.
    pub pieces: &'f dyn Fn(f64) -> u32,
}

/// What a drawing encloses: the union of its shapes.
#[derive(Debug, Default)]
pub struct Drawing {
    /// The closed paths of each shape, filled by the even-odd rule.
    pub shapes: Vec<Vec<Vec<DVec2>>>,
    /// How far pieces of curves lie off them at most.
    pub off: f64,
    /// What was left out, by its name, and how often.
    pub left_out: Vec<(String, usize)>,
    /// A length that is no plain number, and how many there are: they count as 0.
    pub zeros: Option<(String, usize)>,
}

/// True for the name of a drawing.
pub fn is_drawing(name: &str) -> bool {
    ending(name).is_some_and(|e| ["dxf", "svg"].contains(&e.as_str()))
}

fn ending(name: &str) -> Option<String> {
    Some(std::path::Path::new(name).extension()?.to_str()?.to_ascii_lowercase())
}

/// The drawing of a file whose name ends as one of these formats' do; `None` for another one.
pub fn of_file(name: &str, bytes: &[u8], frame: &Frame<'_>) -> Option<Result<Drawing, (Place, Problem)>> {
    match ending(name)?.as_str() {
        "dxf" => Some(dxf::read(bytes, frame)),
        "svg" => Some(svg::read(bytes, frame)),
        _ => None,
    }
}
