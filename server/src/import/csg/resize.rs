//! `resize`: a scale that gives what is inside the sizes that are asked for.

use super::arguments::{Arguments, finite};
use super::convex;
use super::meshed::Meshed;
use super::outlines::{flat_of, paths};
use super::parts::{Part, PartId, Parts};
use super::syntax::{Call, ValueKind};
use super::{Place, Problem};
use crate::math::Aabb;
use crate::solid::Op;
use glam::DVec3;

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// A box, and how far it may be off.
pub type Bounds = (Aabb, f64);

/// The scale about the origin of what `bounds` tells the box of. A size of 0 stays, or follows the largest size that is asked for where
/// `auto` says so.
///
/// # Errors
/// What is wrong with the arguments, or with what is inside.
pub fn scale(call: &Call, flat: bool, bounds: impl FnOnce() -> Result<Option<Bounds>>) -> Result<DVec3> {
    let arguments = Arguments::new(call, &["newsize", "auto", "convexity"])?;
    let mut sizes = [0.0; 3];
    if let Some(v) = arguments.get("newsize") {
        match &v.kind {
            ValueKind::List(list) if (2..=3).contains(&list.len()) => {
                for (size, v) in sizes.iter_mut().zip(list) {
                    // What is no number, or below 0, asks for nothing.
                    *size = match v.kind {
                        ValueKind::Number(n) if n.is_nan() || n == f64::NEG_INFINITY => 0.0,
                        _ => finite(v)?,
                    };
                }
            }
            _ => return Err((v.at, Problem::syntax("two or three numbers as newsize of resize", v.found()))),
        }
    }
    let mut auto = [false; 3];
    if let Some(v) = arguments.get("auto") {
        let truth = |kind: &ValueKind| match kind {
            ValueKind::Bool(b) => Some(*b),
            ValueKind::Number(n) => Some(*n != 0.0),
            _ => None,
        };
        let wrong = || (v.at, Problem::syntax("true or false, or a list of these, as auto of resize", v.found()));
        match &v.kind {
            ValueKind::List(list) if list.len() <= 3 => {
                for (a, v) in auto.iter_mut().zip(list) {
                    *a = truth(&v.kind).ok_or_else(wrong)?;
                }
            }
            kind => auto = [truth(kind).ok_or_else(wrong)?; 3],
        }
    }
    let axes = if flat { 2 } else { 3 };
    sizes[axes..].fill(0.0);
    if sizes.iter().all(|s| *s <= 0.0) {
        return Ok(DVec3::ONE);
    }
    let Some((around, _)) = bounds()? else { return Ok(DVec3::ONE) };
    let now = around.max - around.min;
    let own = |k: usize| if sizes[k] > 0.0 && now[k] > 0.0 { sizes[k] / now[k] } else { 1.0 };
    // OpenSCAD's: the first of the largest sizes.
    let largest = (1..axes).fold(0, |m, k| if sizes[k] > sizes[m] { k } else { m });
    let mut scale = DVec3::ONE;
    for k in 0..axes {
        scale[k] = if auto[k] && sizes[k] == 0.0 { own(largest) } else { own(k) };
    }
    Ok(scale)
}

/// The box of a solid that nothing has cut, by what it is made of.
fn whole(parts: &Parts<'_>, root: PartId) -> Option<Aabb> {
    if let Some(swept) = parts.swept.as_ref().and_then(|all| all.get(&root)) {
        return Some(swept.bounds());
    }
    if let Some(all) = convex::extremes(parts, root) {
        return Some(all.iter().fold(Aabb::EMPTY, |b, e| b.union(&e.bounds())));
    }
    match &parts.list[root] {
        Part::Op(Op::Union, _, of) => of.iter().try_fold(Aabb::EMPTY, |b, p| Some(b.union(&whole(parts, *p)?))),
        _ => None,
    }
}

/// The box of a part: of the elements of what nothing has cut, else of its mesh or its outline.
///
/// # Errors
/// Whatever a mesh or an outline of it fails for.
pub fn bounds(parts: &mut Parts<'_>, at: Place, root: PartId, flat: bool) -> Result<Option<Bounds>> {
    let (around, off) = if flat {
        let whole = match parts.leaves(root) {
            Some((leaves, false)) => leaves,
            Some((_, true)) | None => Vec::new(),
        };
        let round = |b: Aabb, l: &PartId| {
            let Some(f) = flat_of(parts, *l) else { return b };
            match f.disc() {
                Some(d) => b.union(&Aabb::around(d.center.extend(0.0), DVec3::new(d.radius, d.radius, 0.0))),
                None => b.union(&Aabb::of_points(f.paths().iter().flatten().map(|p| p.extend(0.0)))),
            }
        };
        if whole.is_empty() {
            let rims = paths(parts, at, &[root], "resize")?;
            (Aabb::of_points(rims.into_iter().flatten().map(|p| p.extend(0.0))), 0.0)
        } else {
            (whole.iter().fold(Aabb::EMPTY, round), 0.0)
        }
    } else {
        match whole(parts, root) {
            Some(around) => (around, 0.0),
            None => {
                let mesh = Meshed::of(parts, at, root)?;
                (mesh.bounds(), mesh.off)
            }
        }
    };
    Ok(if around.is_empty() { None } else { Some((around, off)) })
}
