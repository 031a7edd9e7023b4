//! Solids told in code: `contactd_client::solid` for C. What makes no sense is refused by the call that asks for it.

use crate::error::Failure;
use crate::handle::{Session, State, free, on};
use crate::model::FACETS;
use crate::raw::{place, row, text, word};
use contactd_client::solid::{self, BuildError, Corners, Outline, Solid};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;
use std::ptr::null_mut;

/// All points of any of the operands.
pub const UNION: u32 = 0;
/// All points that the operands have in common.
pub const INTERSECTION: u32 = 1;
/// All points of the first operand that no other one has.
pub const DIFFERENCE: u32 = 2;
/// The convex hull of the operands.
pub const HULL: u32 = 3;
/// All sums of a point of each operand; of solids alone.
pub const MINKOWSKI: u32 = 4;

/// Corners that an offset opens are joined by a circle.
pub const CORNERS_ROUND: u32 = 0;
/// By prolonging the sides.
pub const CORNERS_SHARP: u32 = 1;
/// By a straight cut.
pub const CORNERS_CUT: u32 = 2;

/// A solid in the making, and its text once that was asked for.
pub struct Built {
    solid: Solid,
    text: Option<CString>,
}

/// A flat shape in the making.
pub struct Drawn {
    outline: Outline,
}

impl From<BuildError> for Failure {
    fn from(e: BuildError) -> Self {
        Failure::argument(e.to_string())
    }
}

/// Writes a solid that makes sense.
fn write_solid(solid: Solid, out: *mut *mut Built) -> Result<(), Failure> {
    // SAFETY: the caller's variable (1).
    let out = unsafe { place(out, "out")? };
    solid.check()?;
    out.write(Box::into_raw(Box::new(Built { solid, text: None })));
    Ok(())
}

/// Writes an outline that makes sense.
fn write_outline(outline: Outline, out: *mut *mut Drawn) -> Result<(), Failure> {
    // SAFETY: the caller's variable (1).
    let out = unsafe { place(out, "out")? };
    outline.check()?;
    out.write(Box::into_raw(Box::new(Drawn { outline })));
    Ok(())
}

/// A handle's solid.
///
/// # Safety
/// Point 6 of the contract: NULL, or a solid that was not freed, in no other call.
unsafe fn solid<'a>(handle: *const Built) -> Result<&'a Solid, Failure> {
    // SAFETY: NULL or a live handle, which nobody changes meanwhile.
    unsafe { handle.as_ref() }.map(|b| &b.solid).ok_or_else(|| Failure::null("the solid (freed, or never made)"))
}

/// A handle's outline.
///
/// # Safety
/// Point 6 of the contract, as above.
unsafe fn outline<'a>(handle: *const Drawn) -> Result<&'a Outline, Failure> {
    // SAFETY: NULL or a live handle, which nobody changes meanwhile.
    unsafe { handle.as_ref() }.map(|d| &d.outline).ok_or_else(|| Failure::null("the outline (freed, or never made)"))
}

/// Numbers that the caller gives as an array of a length that is part of the interface.
///
/// # Safety
/// Point 1 of the contract.
unsafe fn numbers<'a, const N: usize>(pointer: *const f64, what: &str) -> Result<&'a [f64; N], Failure> {
    if pointer.is_null() {
        return Err(Failure::null(what));
    }
    // SAFETY: not NULL, and the caller promises N of them.
    let row = unsafe { row(pointer, N, what)? };
    row.try_into().map_err(|_| Failure::argument(format!("expected {N} numbers as {what}")))
}

/// A box with these lengths of its edges, centred at the origin of its frame as every solid here.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_box(x: f64, y: f64, z: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::cuboid(x, y, z), out))
}

/// A ball.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_sphere(radius: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::sphere(radius), out))
}

/// A cylinder along z, from -height/2 to height/2.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_cylinder(radius: f64, height: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::cylinder(radius, height), out))
}

/// A cone or frustum along z, of radius `bottom` at -height/2 and `top` at height/2; one of them may be 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_cone(bottom: f64, top: f64, height: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::cone(bottom, top, height), out))
}

/// All points within `minor` of the circle of radius `major` about z.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_torus(major: f64, minor: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::torus(major, minor), out))
}

/// All points within `radius` of the segment along z from -length/2 to length/2.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_capsule(radius: f64, length: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::capsule(radius, length), out))
}

/// A dome along z, from its rim of radius `radius` at -height/2 to its tip at height/2: (x^2 + y^2)/radius^2 <= 1/2 - z/height
/// above the rim.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_paraboloid(radius: f64, height: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::paraboloid(radius, height), out))
}

/// A hyperboloid of one sheet about z, of radius `radius` at -height/2 and height/2 and `waist`, which is smaller, at z = 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_hyperboloid(radius: f64, waist: f64, height: f64, out: *mut *mut Built) -> i32 {
    free(|| write_solid(solid::hyperboloid(radius, waist, height), out))
}

/// A dome as a paraboloid's, of one sheet of a hyperboloid of two: downwards it nears a cone, whose tip is `cone` above its
/// own.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_hyperbolic_dome(
    radius: f64,
    height: f64,
    cone: f64,
    out: *mut *mut Built,
) -> i32 {
    free(|| write_solid(solid::hyperbolic_dome(radius, height, cone), out))
}

/// All points of the box from `min` to `max` (3 numbers each) with [x y z 1] M [x y z 1]' <= 0. `m`: the 16 numbers of M, a
/// symmetric matrix. Planes alone are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_quadric(
    m: *const f64,
    min: *const f64,
    max: *const f64,
    out: *mut *mut Built,
) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (m, min, max) = unsafe { (numbers::<16>(m, "m")?, numbers::<3>(min, "min")?, numbers::<3>(max, "max")?) };
        let rows: [[f64; 4]; 4] = std::array::from_fn(|i| std::array::from_fn(|j| m[4 * i + j]));
        write_solid(solid::quadric(&rows, DVec3::from_array(*min), DVec3::from_array(*max)), out)
    })
}

/// All points with (|x/a|^(2/e2) + |y/b|^(2/e2))^(e2/e1) + |z/c|^(2/e1) <= 1. `radii`: a, b and c; `exponents`: e1 (north to south) and e2
/// (east to west), each from 0.1 to 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_superellipsoid(
    radii: *const f64,
    exponents: *const f64,
    out: *mut *mut Built,
) -> i32 {
    free(|| {
        // SAFETY: the caller's arrays (1).
        let (radii, exponents) = unsafe { (numbers::<3>(radii, "radii")?, numbers::<2>(exponents, "exponents")?) };
        write_solid(solid::superellipsoid(DVec3::from_array(*radii), *exponents), out)
    })
}

/// The half-space normal.x <= offset |normal|: a floor or a wall of its own, or to be cut with something. `normal`: 3
/// numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_half_space(normal: *const f64, offset: f64, out: *mut *mut Built) -> i32 {
    free(|| {
        // SAFETY: the caller's array (1).
        let normal = unsafe { numbers::<3>(normal, "normal")? };
        write_solid(solid::half_space(DVec3::from_array(*normal), offset), out)
    })
}

/// The solid between the plane z = `base` and heights above it: `rows` rows that go up in y, each of `columns` heights
/// that go up in x, at the corners of equal cells of a rectangle of the lengths `x` and `y` about the origin. Each cell
/// is two triangles that meet along the diagonal from its corner of least x and y to that of most.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_height_field(
    heights: *const f64,
    rows: usize,
    columns: usize,
    x: f64,
    y: f64,
    base: f64,
    out: *mut *mut Built,
) -> i32 {
    free(|| {
        let count = rows.checked_mul(columns).ok_or_else(|| Failure::argument("heights: more than memory holds"))?;
        // SAFETY: the caller's array (1).
        let heights = unsafe { row(heights, count, "heights")? };
        let rows: Vec<&[f64]> = heights.chunks_exact(columns.max(1)).collect();
        write_solid(solid::height_field(&rows, x, y, base), out)
    })
}

/// The solid within faces, convex or not. `points`: 3 numbers each. `corners`: indices of points, those of each face
/// counter-clockwise as seen from outside, one face after the other; `sides`: how many of them each face has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_polyhedron(
    points: *const f64,
    point_count: usize,
    corners: *const u32,
    sides: *const u32,
    face_count: usize,
    out: *mut *mut Built,
) -> i32 {
    free(|| {
        let numbers = point_count.checked_mul(3).ok_or_else(|| Failure::argument("points: more than memory holds"))?;
        // SAFETY: the caller's array (1).
        let points = unsafe { row(points, numbers, "points")? };
        let points: Vec<DVec3> = points.chunks_exact(3).map(DVec3::from_slice).collect();
        // SAFETY: as above.
        let sides = unsafe { row(sides, face_count, "sides")? };
        // SAFETY: as above.
        let mut corners = unsafe { row(corners, sides.iter().map(|n| *n as usize).sum(), "corners")? };
        let mut faces: Vec<&[u32]> = Vec::with_capacity(sides.len());
        for n in sides {
            let (face, rest) = corners.split_at(*n as usize);
            faces.push(face);
            corners = rest;
        }
        write_solid(solid::polyhedron(&points, &faces), out)
    })
}

/// CONTACTD_UNION, _INTERSECTION, _DIFFERENCE, _HULL or _MINKOWSKI of solids, which stay the caller's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_join(
    operation: u32,
    operands: *const *const Built,
    count: usize,
    out: *mut *mut Built,
) -> i32 {
    free(|| {
        // SAFETY: the caller's array (1).
        let handles = unsafe { row(operands, count, "operands")? };
        // SAFETY: the caller's handles (6).
        let of = |(i, handle): (usize, &*const Built)| unsafe { solid(*handle) }.cloned().map_err(|e| e.at(i));
        let mut all = handles.iter().enumerate().map(of).collect::<Result<Vec<_>, _>>()?.into_iter();
        let joined = match word(&[0, 1, 2, 3, 4], operation, "operation")? {
            UNION => solid::union(all),
            INTERSECTION => solid::intersection(all),
            HULL => solid::hull(all),
            MINKOWSKI => solid::minkowski(all),
            _ => {
                let first = all.next().ok_or_else(|| Failure::argument("difference: expected one operand or more"))?;
                all.fold(first, |left, right| left - right)
            }
        };
        write_solid(joined, out)
    })
}

/// A solid under an affine map. `matrix`: 12 numbers, the three rows of 3 of its linear part and a translation each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_transformed(of: *const Built, matrix: *const f64, out: *mut *mut Built) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6) and array (1).
        let (of, m) = unsafe { (solid(of)?, numbers::<12>(matrix, "matrix")?) };
        let column = |k: usize| DVec3::new(m[k], m[k + 4], m[k + 8]);
        let linear = DMat3::from_cols(column(0), column(1), column(2));
        write_solid(of.transformed(&DAffine3 { matrix3: linear, translation: column(3) }), out)
    })
}

/// A solid whose curves are cut into `pieces`, 9 or more, where something made of them has no exact form.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_with_pieces(of: *const Built, pieces: u32, out: *mut *mut Built) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6).
        write_solid(unsafe { solid(of)? }.with_pieces(pieces), out)
    })
}

/// OpenSCAD's text of a solid, which is what is loaded. Valid until the solid is freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_text(of: *mut Built, out: *mut *const c_char) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6), in this call alone.
        let built = unsafe { of.as_mut() }.ok_or_else(|| Failure::null("the solid (freed, or never made)"))?;
        // SAFETY: the caller's variable (1).
        let out = unsafe { place(out, "out")? };
        let text = built.solid.text()?;
        out.write(built.text.insert(CString::new(text).unwrap_or_default()).as_ptr());
        Ok(())
    })
}

/// Frees a solid and sets `*of` to NULL; one that is NULL already is done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_free(of: *mut *mut Built) -> i32 {
    // SAFETY: the caller's variable (1), and what is in it (6).
    free(|| unsafe { drop_handle(of) })
}

/// Loads a solid as contactd_load_model loads its text.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_load_solid(
    session: *mut Session,
    name: *const c_char,
    of: *const Built,
    facets: u32,
    model: *mut u32,
) -> i32 {
    let call = |state: &mut State| {
        // SAFETY: the caller's string (2) and handle (6).
        let (name, of) = unsafe { (text(name, "name")?, solid(of)?) };
        // SAFETY: the caller's variable (1).
        let model = unsafe { place(model, "model")? };
        let info = state.session.load_model_with(name, of, word(&FACETS, facets, "facets")?)?;
        model.write(info.id);
        state.models.add(info);
        Ok(())
    };
    // SAFETY: the caller's handle (3).
    unsafe { on(session, call) }
}

/// A disc.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_circle(radius: f64, out: *mut *mut Drawn) -> i32 {
    free(|| write_outline(solid::circle(radius), out))
}

/// A rectangle with these lengths of its sides, centred.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_rectangle(x: f64, y: f64, out: *mut *mut Drawn) -> i32 {
    free(|| write_outline(solid::rectangle(x, y), out))
}

/// What is within an odd number of closed paths: one, or an outline with holes. `points`: 2 numbers each, those of one path after
/// those of another; `corners`: how many each path has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_polygon(
    points: *const f64,
    corners: *const u32,
    path_count: usize,
    out: *mut *mut Drawn,
) -> i32 {
    free(|| {
        // SAFETY: the caller's array (1).
        let corners = unsafe { row(corners, path_count, "corners")? };
        let count: usize = corners.iter().map(|n| *n as usize).sum();
        let numbers = count.checked_mul(2).ok_or_else(|| Failure::argument("points: more than memory holds"))?;
        // SAFETY: as above.
        let points = unsafe { row(points, numbers, "points")? };
        let mut points = points.chunks_exact(2).map(DVec2::from_slice);
        let paths: Vec<Vec<DVec2>> = corners.iter().map(|n| points.by_ref().take(*n as usize).collect()).collect();
        write_outline(solid::polygon_of_paths(&paths), out)
    })
}

/// CONTACTD_UNION, _INTERSECTION, _DIFFERENCE or _HULL of outlines, which stay the caller's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_join(
    operation: u32,
    operands: *const *const Drawn,
    count: usize,
    out: *mut *mut Drawn,
) -> i32 {
    free(|| {
        // SAFETY: the caller's array (1).
        let handles = unsafe { row(operands, count, "operands")? };
        // SAFETY: the caller's handles (6).
        let of = |(i, handle): (usize, &*const Drawn)| unsafe { outline(*handle) }.cloned().map_err(|e| e.at(i));
        let mut all = handles.iter().enumerate().map(of).collect::<Result<Vec<_>, _>>()?.into_iter();
        let joined = match word(&[0, 1, 2, 3], operation, "operation")? {
            UNION => Outline::union(all),
            INTERSECTION => Outline::intersection(all),
            HULL => Outline::hull(all),
            _ => {
                let first = all.next().ok_or_else(|| Failure::argument("difference: expected one operand or more"))?;
                all.fold(first, |left, right| left - right)
            }
        };
        write_outline(joined, out)
    })
}

/// Everything within `by` of an outline, or, below 0, what is farther than that inside; `corners` is CONTACTD_CORNERS_….
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_offset(of: *const Drawn, by: f64, corners: u32, out: *mut *mut Drawn) -> i32 {
    free(|| {
        let corners = word(&[Corners::Round, Corners::Sharp, Corners::Cut], corners, "corners")?;
        // SAFETY: the caller's handle (6).
        write_outline(unsafe { outline(of)? }.offset(by, corners), out)
    })
}

/// An outline under an affine map. `matrix`: 6 numbers, the two rows of 2 of its linear part and a translation each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_transformed(
    of: *const Drawn,
    matrix: *const f64,
    out: *mut *mut Drawn,
) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6) and array (1).
        let (of, m) = unsafe { (outline(of)?, numbers::<6>(matrix, "matrix")?) };
        let column = |k: usize| DVec2::new(m[k], m[k + 3]);
        write_outline(of.transformed([column(0), column(1)], column(2)), out)
    })
}

/// The solid over an outline from z = -height/2 to height/2, scaled by `scale_x`, `scale_y` towards its upper end (1 and 1: straight).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_extrude(
    of: *const Drawn,
    height: f64,
    scale_x: f64,
    scale_y: f64,
    out: *mut *mut Built,
) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6).
        let of = unsafe { outline(of)? };
        let straight = scale_x == 1.0 && scale_y == 1.0;
        let tapered = || of.extrude_tapered(height, DVec2::new(scale_x, scale_y));
        write_solid(if straight { of.extrude(height) } else { tapered() }, out)
    })
}

/// The same, turned about z towards its upper end by `angle` (radians, counter-clockwise) in `slices` steps.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_twist(
    of: *const Drawn,
    height: f64,
    angle: f64,
    slices: u32,
    out: *mut *mut Built,
) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6).
        write_solid(unsafe { outline(of)? }.extrude_twisted(height, angle, slices), out)
    })
}

/// The solid that an outline makes about an axis, over `angle` radians from +x: its x becomes the distance from z, its y becomes z.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_revolve(of: *const Drawn, angle: f64, out: *mut *mut Built) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6).
        write_solid(unsafe { outline(of)? }.revolve_part(angle), out)
    })
}

/// The outline that the plane z = 0 cuts out of a solid (`cut` 1), or the solid's shadow on it (0).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_solid_projection(of: *const Built, cut: u32, out: *mut *mut Drawn) -> i32 {
    free(|| {
        // SAFETY: the caller's handle (6).
        let of = unsafe { solid(of)? };
        write_outline(if crate::raw::flag(cut, "cut")? { of.cut() } else { of.shadow() }, out)
    })
}

/// Frees an outline and sets `*of` to NULL; one that is NULL already is done.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn contactd_outline_free(of: *mut *mut Drawn) -> i32 {
    // SAFETY: the caller's variable (1), and what is in it (6).
    free(|| unsafe { drop_handle(of) })
}

/// Drops what a variable holds and sets it to NULL.
///
/// # Safety
/// Points 1 and 6 of the contract.
unsafe fn drop_handle<T>(variable: *mut *mut T) -> Result<(), Failure> {
    // SAFETY: the caller's variable.
    let variable = unsafe { place(variable, "the variable")? };
    // SAFETY: it was set by a function of this file, or to NULL.
    let handle = unsafe { std::mem::replace(variable, MaybeUninit::new(null_mut())).assume_init() };
    if !handle.is_null() {
        // SAFETY: it came out of a box here and was not freed since.
        drop(unsafe { Box::from_raw(handle) });
    }
    Ok(())
}
