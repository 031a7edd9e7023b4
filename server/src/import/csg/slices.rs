//! How many slices OpenSCAD cuts an extrusion with bent walls into (Calc of OpenSCAD 2021.01).

use super::arguments::Arguments;
use super::{Place, Problem};
use glam::DVec2;

/// Lengths below which OpenSCAD takes points as one: its finer grid.
const GRID: f64 = 1.0 / (1u64 << 20) as f64;
/// Into how many pieces curves are cut.
#[derive(Clone, Copy, Debug, Default)]
pub struct Curve {
    /// Pieces of a whole turn; 0 where the other two say it.
    pub fn_: f64,
    /// The least angle of a piece, in degrees.
    pub fa: f64,
    /// Its least length.
    pub fs: f64,
}

impl Curve {
    /// As a call has it, or OpenSCAD's own.
    pub fn of(arguments: &Arguments<'_>) -> Result<Self, (Place, Problem)> {
        let number = |name, default| arguments.setting(name, default);
        let fn_ = number("$fn", 0.0)?;
        let fn_ = if fn_.is_finite() { fn_.max(0.0) } else { 0.0 };
        Ok(Self { fn_, fa: number("$fa", 12.0)?.max(0.01), fs: number("$fs", 2.0)?.max(0.01) })
    }
}

/// OpenSCAD's number of slices of a twist, or of an uneven scale without one, of an outline with some corners.
pub fn slices(corners: &[DVec2], height: f64, twist: f64, scale: DVec2, curve: &Curve) -> f64 {
    let largest = |all: &dyn Fn(DVec2) -> f64| corners.iter().map(|p| all(*p)).fold(0.0, f64::max);
    if twist == 0.0 {
        let way = largest(&|p| (p - p * scale).length());
        return if way < GRID {
            1.0
        } else if curve.fn_ > 0.0 {
            curve.fn_.floor().max(1.0)
        } else {
            (way.hypot(height) / curve.fs).ceil().max(1.0)
        };
    }
    let (turned, radius) = (twist.abs(), largest(&|p| p.length()));
    let least = (turned / 120.0).ceil().max(1.0);
    if radius < GRID {
        return least;
    }
    if curve.fn_ > 0.0 {
        return (turned / 360.0 * curve.fn_).ceil().max(least);
    }
    let angle = turned.to_radians();
    let length = if scale.x == scale.y && scale.x != 1.0 {
        // Along a spiral of Archimedes that ends where the scale would be 0.
        let end = angle * if scale.x > 1.0 { scale.x / (scale.x - 1.0) } else { 1.0 / (1.0 - scale.x) };
        let arc = |t: f64| 0.5 * (radius / end) * (t * (1.0 + t * t).sqrt() + libm::asinh(t));
        (arc(end) - arc(end - angle)).hypot(height)
    } else {
        (angle * radius).hypot(height)
    };
    (turned / curve.fa).ceil().min((length / curve.fs).ceil()).max(least)
}
