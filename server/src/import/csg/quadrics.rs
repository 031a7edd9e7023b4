//! Words of its own: `paraboloid`, `hyperboloid`, `quadric`. Any affine image of a quadric is one, so none of them is refused under a
//! matrix.

use super::arguments::{Arguments, finite, vector};
use super::parts::PartId;
use super::place::{self, PlacedShape};
use super::shapes::Shapes;
use super::syntax::{Call, Value, ValueKind};
use super::{Place, Problem};
use crate::math::Aabb;
use crate::solid::primitive::Quadric;
use crate::solid::primitive::quadric::{Form, NoQuadric};
use crate::solid::surface::Plane;
use crate::solid::{Face, Op};
use contactd_proto::Pose;
use glam::{DAffine3, DMat3, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// By how much of its size the planes around a hyperboloid of one sheet stand off it: they hold it and are none of its faces.
const ROOM: f64 = 0.125;

/// What is no farther from a cylinder than this, relative to its radius, is one to rounding.
const STRAIGHT: f64 = 1e-12;

/// An inequality within a box, in the call's coordinates.
struct Asked {
    form: Form,
    /// A box around all of it.
    around: Aabb,
    /// The box whose sides cut it, those of `cut` for what is convex.
    cage: Aabb,
    cut: Vec<u8>,
    /// Of two pieces the one that holds this point.
    holds: Option<DVec3>,
    /// Of one sheet: 1 − (waist/r)², by how much it is no cylinder.
    sheet: Option<f64>,
}

/// `paraboloid`: a dome with its tip up, as a cone of the same height and radius; `hyperboloid`, of one sheet with a waist or such a
/// dome that nears a cone; `quadric`, any inequality of degree two within a box.
pub fn quadric(shapes: &mut Shapes<'_>, call: &Call, outer: &DAffine3) -> Result<PartId> {
    let asked = match call.name.as_str() {
        "quadric" => Some(general(call)?),
        name => of_revolution(call, name == "paraboloid")?,
    };
    match asked {
        Some(asked) => made(shapes, call, outer, asked),
        None => Ok(shapes.nothing(call, "of no size")),
    }
}

/// ρ² <= the square of a radius that is linear or quadratic in z.
fn of_revolution(call: &Call, is_paraboloid: bool) -> Result<Option<Asked>> {
    let names: &[&str] = if is_paraboloid { &["h", "r", "center"] } else { &["h", "r", "waist", "cone", "center"] };
    let arguments = Arguments::new(call, names)?;
    let (h, r) = (arguments.finite_size("h")?, arguments.finite_size("r")?);
    let center = arguments.bool_or("center", false)?;
    let (Some(h), Some(r)) = (h, r) else { return Ok(None) };
    let low = if center { -0.5 * h } else { 0.0 };
    let around = Aabb { min: DVec3::new(-r, -r, low), max: DVec3::new(r, r, low + h) };
    // ρ²/r² <= a − b z − c z² from z = low.
    let form = |[a, b, c]: [f64; 3]| {
        let (shift, per) = (-low, 1.0 / (r * r));
        Form {
            square: DMat3::from_diagonal(DVec3::new(per, per, c)),
            linear: DVec3::Z * (0.5 * b + c * shift),
            constant: -a + b * shift + c * shift * shift,
        }
    };
    let dome =
        |form| Asked { form, around, cage: around, cut: vec![4], holds: Some(DVec3::Z * (low + 0.5 * h)), sheet: None };
    if is_paraboloid {
        return Ok(Some(dome(form([1.0, 1.0 / h, 0.0]))));
    }
    match (arguments.get("waist"), arguments.get("cone")) {
        (Some(v), None) => {
            let Some(waist) = arguments.finite_size("waist")? else { return Ok(None) };
            if waist >= r {
                return Err((v.at, Problem::syntax("a waist below r of hyperboloid", format!("{waist}"))));
            }
            // waist² + (r² − waist²)(2z/h − 1)².
            let (w, rest) = ((waist / r) * (waist / r), (1.0 - waist / r) * (1.0 + waist / r));
            let form = form([w + rest, 4.0 * rest / h, -4.0 * rest / (h * h)]);
            let room = DVec3::new(ROOM * r, ROOM * r, 0.0);
            let cage = Aabb { min: around.min - room, max: around.max + room };
            Ok(Some(Asked { form, around, cage, cut: vec![4, 5], holds: None, sheet: Some(rest) }))
        }
        (None, Some(_)) => {
            let Some(cone) = arguments.finite_size("cone")? else { return Ok(None) };
            // ρ²/r² <= ((h + cone − z)² − cone²)/((h + cone)² − cone²).
            let whole = h * (h + 2.0 * cone);
            Ok(Some(dome(form([1.0, 2.0 * (h + cone) / whole, -1.0 / whole]))))
        }
        _ => {
            let expected =
                "either waist (the radius in the middle) or cone (from the tip to the cone's) of hyperboloid";
            Err((call.at, Problem::syntax(expected, "both or none")))
        }
    }
}

fn general(call: &Call) -> Result<Asked> {
    let arguments = Arguments::new(call, &["m", "min", "max"])?;
    let m = symmetric(arguments.required("m", "a symmetric 4×4 matrix")?)?;
    let corner = |name| arguments.required(name, "three numbers").and_then(|v| vector(v, "three numbers"));
    let (min, max) = (corner("min")?, corner("max")?);
    if !min.cmplt(max).all() {
        return Err((
            call.at,
            Problem::syntax("min below max of quadric in all coordinates", format!("{min} and {max}")),
        ));
    }
    let around = Aabb { min, max };
    Ok(Asked { form: Form::of_matrix(&m), around, cage: around, cut: (0..6).collect(), holds: None, sheet: None })
}

fn symmetric(value: &Value) -> Result<[[f64; 4]; 4]> {
    let wrong = |v: &Value| (v.at, Problem::syntax("a symmetric matrix with 4 rows of 4 numbers", v.found()));
    let ValueKind::List(rows) = &value.kind else { return Err(wrong(value)) };
    let mut m = [[0.0; 4]; 4];
    if rows.len() != 4 {
        return Err(wrong(value));
    }
    for (row, values) in m.iter_mut().zip(rows) {
        let ValueKind::List(numbers) = &values.kind else { return Err(wrong(values)) };
        if numbers.len() != 4 {
            return Err(wrong(values));
        }
        for (x, v) in row.iter_mut().zip(numbers) {
            *x = finite(v)?;
        }
    }
    for i in 0..4 {
        for j in 0..i {
            if m[i][j] != m[j][i] {
                let found = format!("{} and {} across its diagonal", m[i][j], m[j][i]);
                return Err((value.at, Problem::syntax("a symmetric matrix as m of quadric", found)));
            }
        }
    }
    Ok(m)
}

/// The planes of a box after an affine map: of −x, +x, −y, +y, −z, +z.
fn planes(cage: &Aabb, map: &DAffine3) -> [Plane; 6] {
    let back = map.matrix3.inverse().transpose();
    std::array::from_fn(|k| {
        let (axis, sign) = (DVec3::AXES[k / 2], if k % 2 == 0 { -1.0 } else { 1.0 });
        let normal = (back * (axis * sign)).normalize();
        let corner = if k % 2 == 0 { cage.min } else { cage.max };
        Plane { normal, offset: normal.dot(map.transform_point3(corner)) }
    })
}

fn made(shapes: &mut Shapes<'_>, call: &Call, outer: &DAffine3, asked: Asked) -> Result<PartId> {
    let middle = asked.around.center();
    // Around the middle of the box, along the model's axes.
    let map = DAffine3::from_mat3_translation(outer.matrix3, outer.matrix3 * -middle);
    let frame = Pose::at(outer.transform_point3(middle));
    let around = Aabb::of_points(asked.around.corners().map(|c| map.transform_point3(c)));
    let refused = |expected: &str, found: &str| (call.at, Problem::syntax(expected, found));
    let quadrics = asked.form.mapped(&map).quadrics(&around).map_err(|why| match why {
        NoQuadric::Planes => refused("a quadric that is none of planes", "planes, nothing or all of space"),
        NoQuadric::Far => refused("a quadric with its centre within a thousand sizes of its box", "one farther off"),
    })?;
    // Two cones that meet in a point are no neck, and a cylinder has no waist: neither is loaded in place of what was asked for.
    let is_sheet = |sides: &[Face]| sides.len() == 1 && !sides[0].is_convex();
    if asked.sheet.is_some_and(|rest| !is_sheet(&quadrics.sides) && (rest > STRAIGHT || quadrics.sides.len() > 1)) {
        let expected = "a hyperboloid with a waist that is no less than about a millionth of r and of h, or is r";
        return Err(refused(expected, "one that its digits do not tell from two cones or a cylinder"));
    }
    let holds = asked.holds.map(|x| map.transform_point3(x));
    let sides: Vec<Face> = quadrics.sides.into_iter().filter(|s| holds.is_none_or(|x| s.value(x) < 0.0)).collect();
    // What is taken away reaches beyond the block, so that no skin is left where both end.
    let beyond = if quadrics.outside { asked.cage.half() * ROOM } else { DVec3::ZERO };
    let cage = Aabb { min: asked.cage.min - beyond, max: asked.cage.max + beyond };
    let around =
        if quadrics.outside { Aabb::of_points(cage.corners().map(|c| map.transform_point3(c))) } else { around };
    let all = planes(&cage, &map);
    let mut pieces = Vec::new();
    for side in sides {
        let cut = if side.is_convex() { asked.cut.clone() } else { (0..6).collect() };
        let cut = cut.into_iter().map(|k| (k, all[usize::from(k)])).collect();
        let Some(shape) = Quadric::new(side, cut, around) else {
            // One that stays clear of the box is none of it.
            if side.span(around.center(), around.half()).0 <= 0.0 {
                shapes.parts.note(call.at, "a piece of a quadric that is thin or not in its box: left out", None);
            }
            continue;
        };
        let placed = PlacedShape { shape: shape.into(), frame, mirrored: false, notes: Vec::new() };
        let leaf = shapes.parts.leaf(&call.name, call.at, Ok(placed))?;
        pieces.push(shapes.parts.push(leaf));
    }
    if quadrics.outside {
        let half = asked.around.half();
        let block = shapes.parts.leaf(&call.name, call.at, place::cuboid(outer, middle, half))?;
        let mut operands = vec![shapes.parts.push(block)];
        operands.extend(pieces);
        return Ok(shapes.parts.op(Op::Difference, call.at, operands));
    }
    if pieces.is_empty() {
        return Err(refused("a quadric with an inside within its box", "none, or a thin one"));
    }
    Ok(shapes.parts.op(Op::Union, call.at, pieces))
}
