//! What people write by hand, made what OpenSCAD would flatten it to.
//!
//! `translate`, `rotate`, `scale` and `mirror` get the matrix of `multmatrix` as their one argument; diameters become radii,
//! and sizes that are left out have OpenSCAD's defaults. What a flattened file says stays as it is. Meanings are those of
//! OpenSCAD 2021.01's `TransformNode.cc` and `primitives.cc`.

use super::arguments::{Arguments, finite};
use super::facets::direction;
use super::syntax::{Argument, Call, File, Value, ValueKind};
use super::{Place, Problem};
use glam::{DAffine3, DMat3, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// The transformations that are written as such; flattened files have `multmatrix` alone.
pub const TRANSFORMATIONS: [&str; 4] = ["translate", "rotate", "scale", "mirror"];

/// Rewrites all calls of a file.
pub fn flatten(file: &mut File) -> Result<()> {
    for call in &mut file.calls {
        match call.name.as_str() {
            "sphere" | "circle" => radius(call)?,
            "cylinder" => cylinder(call)?,
            "cube" | "square" if !has(call, "size") && call.arguments.iter().all(|a| a.name.is_some()) => {
                set(call, "size", call.at, 1.0);
            }
            name if TRANSFORMATIONS.contains(&name) => {
                let (at, matrix) = transformation(call)?;
                call.arguments = vec![Argument { name: Some("m".into()), at, value: rows(at, &matrix) }];
            }
            _ => {}
        }
    }
    Ok(())
}

/// The radius of a ball or disc, which may be told as a diameter.
fn radius(call: &mut Call) -> Result<()> {
    let told = has(call, "r") || call.arguments.iter().any(|a| a.name.is_none());
    let diameter = once(call, "d", told, "r")?;
    if !told {
        let (at, r) = diameter.unwrap_or((call.at, 1.0));
        set(call, "r", at, r);
    }
    Ok(())
}

/// The radii of a cylinder's two ends: each of its own, or of one radius or diameter for both.
fn cylinder(call: &mut Call) -> Result<()> {
    let mut order = ["h", "r1", "r2", "center"].into_iter();
    for argument in call.arguments.iter_mut().filter(|a| a.name.is_none()) {
        let Some(name) = order.next() else { break };
        argument.name = Some(name.to_owned());
    }
    for (end, across) in [("r1", "d1"), ("r2", "d2")] {
        let told = has(call, end);
        if let Some((at, r)) = once(call, across, told, end)? {
            set(call, end, at, r);
        }
    }
    let (told, has_r) = (has(call, "r1") && has(call, "r2"), has(call, "r"));
    let diameter = once(call, "d", told || has_r, if has_r { "r" } else { "r1 and r2" })?;
    let both = match take(call, "r") {
        Some(r) if told => return Err((r.at, twice(call, "r1 and r2", "r"))),
        Some(r) => Some((r.at, number(call, &r)?)),
        None => diameter,
    };
    for end in ["r1", "r2"] {
        if !has(call, end) {
            let (at, r) = both.unwrap_or((call.at, 1.0));
            set(call, end, at, r);
        }
    }
    if !has(call, "h") {
        set(call, "h", call.at, 1.0);
    }
    Ok(())
}

/// The matrix that a transformation is, and where what tells it stands.
fn transformation(call: &Call) -> Result<(Place, DAffine3)> {
    let parameters: &[&'static str] = if call.name == "rotate" { &["a", "v"] } else { &["v"] };
    let arguments = Arguments::new(call, parameters)?;
    let at = call.arguments.first().map_or(call.at, |a| a.at);
    let matrix = match call.name.as_str() {
        "translate" => DAffine3::from_translation(vector(arguments.required("v", "a shift of 3 numbers")?, 0.0)?),
        "scale" => DAffine3::from_scale(scale(arguments.required("v", "a factor, or 3")?)?),
        "mirror" => DAffine3::from_mat3(mirror(arguments.get("v"))?),
        _ => DAffine3::from_mat3(rotation(arguments.required("a", "an angle, or 3")?, arguments.get("v"))?),
    };
    Ok((at, matrix))
}

/// Two or three numbers; the third is `else_z` where there are two.
fn vector(v: &Value, else_z: f64) -> Result<DVec3> {
    match &v.kind {
        ValueKind::List(of) if of.len() == 2 || of.len() == 3 => {
            let z = of.get(2).map_or(Ok(else_z), finite)?;
            Ok(DVec3::new(finite(&of[0])?, finite(&of[1])?, z))
        }
        _ => Err((v.at, Problem::syntax("a list of 2 or 3 numbers", v.found()))),
    }
}

fn scale(v: &Value) -> Result<DVec3> {
    match v.kind {
        ValueKind::Number(_) => finite(v).map(DVec3::splat),
        _ => vector(v, 1.0),
    }
}

/// The reflection in the plane across a normal, by default x; of no direction it is none.
fn mirror(v: Option<&Value>) -> Result<DMat3> {
    let normal = v.map_or(Ok(DVec3::X), |v| vector(v, 0.0))?;
    let Some(n) = normal.try_normalize() else { return Ok(DMat3::IDENTITY) };
    Ok(DMat3::IDENTITY - outer(n) * 2.0)
}

/// n nᵀ.
fn outer(n: DVec3) -> DMat3 {
    DMat3::from_cols(n * n.x, n * n.y, n * n.z)
}

/// A turn by degrees: about x, y and z, one after the other, or by one angle about an axis, by default z.
fn rotation(a: &Value, axis: Option<&Value>) -> Result<DMat3> {
    let turn = |axis: DVec3, degrees: f64| {
        // Rodrigues: R = c I + s [k]× + (1 − c) k kᵀ.
        let (d, k) = (direction(degrees), axis);
        let cross = DMat3::from_cols(k.cross(DVec3::X), k.cross(DVec3::Y), k.cross(DVec3::Z));
        DMat3::from_diagonal(DVec3::splat(d.x)) + cross * d.y + outer(k) * (1.0 - d.x)
    };
    match &a.kind {
        ValueKind::List(of) if (1..=3).contains(&of.len()) => {
            let mut matrix = DMat3::IDENTITY;
            for (axis, angle) in DVec3::AXES.into_iter().zip(of) {
                matrix = turn(axis, finite(angle)?) * matrix;
            }
            Ok(matrix)
        }
        ValueKind::Number(_) => {
            let axis = axis.map_or(Ok(DVec3::Z), |v| vector(v, 0.0))?;
            let angle = finite(a)?;
            Ok(axis.try_normalize().map_or(DMat3::IDENTITY, |k| turn(k, angle)))
        }
        _ => Err((a.at, Problem::syntax("an angle in degrees, or 3 about x, y and z", a.found()))),
    }
}

fn rows(at: Place, matrix: &DAffine3) -> Value {
    let m = glam::DMat4::from(*matrix);
    let number = |x: f64| Value { at, kind: ValueKind::Number(x) };
    let list = |of| Value { at, kind: ValueKind::List(of) };
    list((0..4).map(|k| list(m.row(k).to_array().into_iter().map(number).collect())).collect())
}

fn has(call: &Call, name: &str) -> bool {
    call.arguments.iter().any(|a| a.name.as_deref() == Some(name))
}

fn take(call: &mut Call, name: &str) -> Option<Argument> {
    let at = call.arguments.iter().position(|a| a.name.as_deref() == Some(name))?;
    Some(call.arguments.remove(at))
}

fn set(call: &mut Call, name: &str, at: Place, x: f64) {
    call.arguments.push(Argument { name: Some(name.into()), at, value: Value { at, kind: ValueKind::Number(x) } });
}

/// Half of the diameter `name`, taken from a call, which must not be there where the radius `other` is told.
fn once(call: &mut Call, name: &str, told: bool, other: &str) -> Result<Option<(Place, f64)>> {
    let Some(argument) = take(call, name) else { return Ok(None) };
    if told {
        return Err((argument.at, twice(call, other, name)));
    }
    Ok(Some((argument.at, 0.5 * number(call, &argument)?)))
}

fn twice(call: &Call, one: &str, other: &str) -> Problem {
    Problem::syntax(format!("{one} or {other} of {}, not both", call.name), "both")
}

fn number(call: &Call, argument: &Argument) -> Result<f64> {
    match argument.value.kind {
        ValueKind::Number(x) => Ok(x),
        _ => {
            let name = argument.name.as_deref().unwrap_or_default();
            let expected = format!("a number as {name} of {}", call.name);
            Err((argument.value.at, Problem::syntax(expected, argument.value.found())))
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::import::{Facets, Import, Limits, import_csg};

    fn read(text: &str) -> Result<Import, String> {
        import_csg("m.csg", text, Facets::Auto, &Limits::default()).map_err(|e| e.to_string())
    }

    /// The solid with the places of its primitives left out, for these change with the text.
    fn solid(text: &str) -> String {
        let mut solid = read(text).unwrap_or_else(|e| panic!("{text}: {e}")).solid;
        solid.primitives.iter_mut().for_each(|p| p.label.column = 0);
        format!("{solid:?}")
    }

    #[test]
    fn what_is_written_by_hand_is_what_openscad_flattens_it_to() {
        let matrix = |rows: &str, of: &str| format!("multmatrix([{rows}, [0, 0, 0, 1]]) {{ {of} }}");
        let (ball, box_) = ("sphere(r = 2);", "cube(size = [1, 2, 3], center = false);");
        for (written, flat) in [
            ("sphere();", "sphere(r = 1);".to_owned()),
            ("sphere(2);", ball.into()),
            ("sphere(d = 4);", ball.into()),
            ("sphere(d = 3, $fn = 6);", "sphere($fn = 6, r = 1.5);".into()),
            ("cube();", "cube(size = [1, 1, 1], center = false);".into()),
            ("cube(3, true);", "cube(size = [3, 3, 3], center = true);".into()),
            ("cylinder();", "cylinder(h = 1, r1 = 1, r2 = 1, center = false);".into()),
            ("cylinder(h = 5, r = 2);", "cylinder(h = 5, r1 = 2, r2 = 2, center = false);".into()),
            ("cylinder(r = 2, h = 5, center = true);", "cylinder(h = 5, r1 = 2, r2 = 2, center = true);".into()),
            ("cylinder(5, 2, 1, true);", "cylinder(h = 5, r1 = 2, r2 = 1, center = true);".into()),
            ("cylinder(5, d = 3);", "cylinder(h = 5, r1 = 1.5, r2 = 1.5);".into()),
            ("cylinder(h = 5, d1 = 3, r2 = 0);", "cylinder(h = 5, r1 = 1.5, r2 = 0);".into()),
            ("cylinder(h = 5, r = 3, d2 = 2);", "cylinder(h = 5, r1 = 3, r2 = 1);".into()),
            ("linear_extrude(2) circle(d = 3);", "linear_extrude(height = 2) { circle(r = 1.5); }".into()),
            ("linear_extrude(2) square();", "linear_extrude(height = 2) { square(size = [1, 1]); }".into()),
            (
                "linear_extrude(2) translate([1, 2]) square([3, 4], true);",
                "linear_extrude(height = 2) { multmatrix([[1,0,0,1],[0,1,0,2],[0,0,1,0],[0,0,0,1]]) \
                 { square(size = [3, 4], center = true); } }"
                    .into(),
            ),
            ("translate([1, 2, 3]) sphere(2);", matrix("[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]", ball)),
            ("translate([1, 2]) sphere(r = 2);", matrix("[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 0]", ball)),
            ("rotate([90, 0, 0]) cube([1, 2, 3]);", matrix("[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0]", box_)),
            ("rotate(90) cube([1, 2, 3]);", matrix("[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]", box_)),
            (
                "rotate(a = 90, v = [0, 2, 0]) cube([1, 2, 3]);",
                matrix("[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0]", box_),
            ),
            // First about x, then about y, then about z.
            ("rotate([90, 90, 0]) cube([1, 2, 3]);", matrix("[0, 1, 0, 0], [0, 0, -1, 0], [-1, 0, 0, 0]", box_)),
            ("rotate([90, 90, 90]) cube([1, 2, 3]);", matrix("[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0]", box_)),
            ("scale(2) cube([1, 2, 3]);", matrix("[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]", box_)),
            ("scale([2, 3]) cube([1, 2, 3]);", matrix("[2, 0, 0, 0], [0, 3, 0, 0], [0, 0, 1, 0]", box_)),
            ("mirror([0, 0, 4]) cube([1, 2, 3]);", matrix("[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0]", box_)),
            ("mirror() cube([1, 2, 3]);", matrix("[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]", box_)),
            ("color(\"red\") sphere(2);", "color([1, 0, 0, 1]) { sphere(r = 2); }".into()),
            // One operand without braces, at any depth, with modifiers; the next call is no operand.
            (
                "union() { translate([1, 2, 3]) #rotate(90) cube([1, 2, 3]); sphere(2); }",
                "union() { multmatrix([[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]) { \
                 multmatrix([[0,-1,0,0],[1,0,0,0],[0,0,1,0],[0,0,0,1]]) { cube(size = [1, 2, 3]); } } sphere(r = 2); }"
                    .into(),
            ),
            ("difference() { cube(3); translate([1, 1, 1]) { sphere(1); sphere(2); } sphere(0.5); }", {
                let moved = matrix("[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]", "sphere(r = 1); sphere(r = 2);");
                format!("difference() {{ cube(size = [3, 3, 3]); {moved} sphere(r = 0.5); }}")
            }),
        ] {
            assert_eq!(solid(written), solid(&flat), "{written}");
        }
    }

    #[test]
    fn turns_are_those_of_a_rotation_matrix() {
        // By the rule that a rotation about an axis keeps it, and turns what is across it by the angle.
        let mut random = crate::math::random::Random(7);
        for _ in 0..200 {
            let (axis, angle) = (random.vector(1.0), random.within(-400.0, 400.0));
            let list = format!("[{}, {}, {}]", axis.x, axis.y, axis.z);
            let mut call =
                super::super::syntax::parse(&format!("rotate(a = {angle}, v = {list}) {{ }}"), &Limits::default())
                    .expect("readable");
            let arguments = &call.calls[0].arguments;
            let found = super::rotation(&arguments[0].value, Some(&arguments[1].value)).expect("a rotation");
            let expected = glam::DMat3::from_axis_angle(axis.normalize(), angle.to_radians());
            assert!(found.abs_diff_eq(expected, 1e-14), "{found} {expected}");
            super::flatten(&mut call).expect("flat");
            assert_eq!(call.calls[0].arguments.len(), 1);
        }
    }

    #[test]
    fn what_makes_no_sense_is_a_sentence_that_says_what_to_do() {
        let scad = "which is not supported (this is .scad: load the file by that ending, or flatten it first: openscad -o \
                    model.csg model.scad)";
        let mut wrong = Vec::new();
        for (text, sentence) in [
            ("sphere(r = 1, d = 2);", "1:15: expected r or d of sphere, not both, found both".to_owned()),
            ("sphere(d = true);", "1:12: expected a number as d of sphere, found true".into()),
            ("cylinder(h = 1, r1 = 1, d1 = 2);", "1:25: expected r1 or d1 of cylinder, not both, found both".into()),
            ("cylinder(1, 2, 3, r = 1);", "1:19: expected r1 and r2 or r of cylinder, not both, found both".into()),
            ("cylinder(r = 1, d = 1);", "1:17: expected r or d of cylinder, not both, found both".into()),
            ("translate(1) cube();", "1:11: expected a list of 2 or 3 numbers, found 1".into()),
            ("translate() cube();", "1:1: expected a shift of 3 numbers as v of translate, found none".into()),
            ("rotate([1, 2, inf]) cube();", "1:15: expected a finite number, found inf".into()),
            ("rotate(\"a\") cube();", "1:8: expected an angle in degrees, or 3 about x, y and z, found the string \"a\"".into()),
            ("translate([1, 2, 3])", "1:21: expected \";\", \"{\" or a call, found the end of the file".into()),
            ("union() { translate([1, 2, 3]) }", "1:32: expected \";\", \"{\" or a call, found \"}\"".into()),
            ("r = 3; sphere(r);", format!("1:3: expected a supported construct, found the variable r, {scad}")),
            ("sphere(r);", format!("1:8: expected a supported construct, found the variable r, {scad}")),
            ("cube([1, a, 2]);", format!("1:10: expected a supported construct, found the variable a, {scad}")),
            ("cube(2 * 3);", format!("1:8: expected a supported construct, found an expression, {scad}")),
            ("module part() { cube(); }", format!("1:1: expected a supported construct, found module, {scad}")),
            ("for (i = [1, 2]) cube(i);", format!("1:23: expected a supported construct, found the variable i, {scad}")),
            ("if (true) cube();", format!("1:1: expected a supported construct, found if, {scad}")),
            (
                "solid part\n facet normal 0 0 1\n",
                "1:7: expected OpenSCAD's CSG text, found an STL file (load it as such: by a name that ends in .stl, or with \
                 the format \"stl\")"
                    .into(),
            ),
        ] {
            wrong.extend(Some(read(text).err()).filter(|e| *e != Some(format!("m.csg:{sentence}"))).map(|e| (text, e)));
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    }
}
