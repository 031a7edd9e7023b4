//! `superellipsoid`, a word of its own.

use super::arguments::{Arguments, finite};
use super::parts::PartId;
use super::place;
use super::shapes::Shapes;
use super::syntax::{Call, Value, ValueKind};
use super::{Place, Problem};
use crate::solid::surface::superellipsoid::EXPONENTS;
use glam::{DAffine3, DVec2};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// `superellipsoid(r = [a, b, c], e = [e1, e2])`: ((|x/a|^(2/e2) + |y/b|^(2/e2))^(e2/e1) + |z/c|^(2/e1)) <= 1, around the origin.
pub fn superellipsoid(shapes: &mut Shapes<'_>, call: &Call, outer: &DAffine3) -> Result<PartId> {
    let arguments = Arguments::new(call, &["r", "e"])?;
    let radii = arguments.sizes("r")?;
    let exponents = exponents(arguments.required("e", "two numbers")?)?;
    let Some(radii) = radii else { return Ok(shapes.nothing(call, "of no size")) };
    if !radii.is_finite() {
        return Err((call.at, Problem::syntax("finite radii of superellipsoid", format!("{radii}"))));
    }
    let leaf = shapes.parts.leaf(&call.name, call.at, place::superellipsoid(outer, radii, exponents))?;
    Ok(shapes.parts.push(leaf))
}

/// Two exponents, or one for both.
fn exponents(value: &Value) -> Result<DVec2> {
    let [least, most] = EXPONENTS;
    let one = |v: &Value| {
        let e = finite(v)?;
        if (least..=most).contains(&e) {
            return Ok(e);
        }
        let why = if e > most {
            "above it the surface bends without bound along its planes of symmetry"
        } else {
            "below it take a box, or a cylinder"
        };
        Err((v.at, Problem::syntax(format!("exponents from {least} to {most} of superellipsoid ({why})"), v.found())))
    };
    match &value.kind {
        ValueKind::List(of) => match of.as_slice() {
            [north, east] => Ok(DVec2::new(one(north)?, one(east)?)),
            _ => Err((value.at, Problem::syntax("two numbers as e of superellipsoid", value.found()))),
        },
        _ => Ok(DVec2::splat(one(value)?)),
    }
}
