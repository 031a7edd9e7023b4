//! What calls make of what is inside of them, that being lowered already: of solids hulls, Minkowski sums and projections, of outlines
//! what turns about an axis; and which of their operands OpenSCAD takes. What stays flat: `outlines`.

use super::convex;
use super::element::Element;
use super::flat::{Flat, Outline, Plane};
use super::hull::Disc;
use super::meshed::Meshed;
use super::outlines::{self, flat_of, flats};
use super::parts::{Around, Part, PartId, Parts};
use super::place;
use super::polygon::Region;
use super::revolve::{Lathe, Turn};
use super::shadow;
use super::shapes::Shapes;
use super::swept::{Rim, Swept};
use super::syntax::Call;
use super::{Place, Problem};
use crate::math::tolerance::{ROUNDING, SIMILARITY};
use crate::solid::Op;
use glam::{DAffine3, DVec2, DVec3};

type Result<T> = std::result::Result<T, (Place, Problem)>;

/// What to do about what is flat and cannot be summed.
const THICK: &str = " (give it a thickness)";

/// Of operands in space and in the plane those that OpenSCAD takes: as many dimensions as the first has, at the top solids.
/// Whatever else is there is left out with a note. The place and name of the first in the plane where these are taken.
pub fn of_one_dimension(
    parts: &mut Parts<'_>,
    built: Vec<PartId>,
    top: bool,
) -> Result<(Vec<PartId>, Option<(Place, String)>)> {
    let list = &parts.list;
    let solid = |p: PartId| match &list[p] {
        Part::Leaf(..) => Some(true),
        Part::Op(_, _, of) => (!of.is_empty()).then_some(true),
        Part::Stray(..) => Some(false),
        Part::Empty | Part::Flat(_) => None,
    };
    let kinds: Vec<Option<bool>> = built.iter().map(|p| solid(*p)).collect();
    let first = kinds.iter().flatten().next().copied();
    let stray = built.iter().find_map(|p| match &list[*p] {
        Part::Stray(at, name) => Some((*at, name.clone())),
        _ => None,
    });
    let solids = if top { kinds.contains(&Some(true)) } else { first != Some(false) };
    let Some((at, name)) = stray else { return Ok((built, None)) };
    if !solids {
        if top {
            let text = format!(
                "{name} outside of linear_extrude: a 2D shape, without volume (OpenSCAD: \"Current top level object is not a \
                 3D object.\")"
            );
            parts.note(at, text, None);
            return Ok((Vec::new(), None));
        }
        if kinds.contains(&Some(true)) {
            parts.note(
                at,
                format!("{name} among solids, as the first: all solids beside it left out, as OpenSCAD does"),
                None,
            );
        }
        return Ok((Vec::new(), Some((at, name))));
    }
    let mut kept = Vec::with_capacity(built.len());
    for p in built {
        match &parts.list[p] {
            Part::Stray(at, name) => {
                let (at, text) = (*at, format!("{name} among solids: a 2D shape, left out, as OpenSCAD does"));
                parts.note(at, text, None);
            }
            Part::Empty | Part::Leaf(..) | Part::Flat(_) | Part::Op(..) => kept.push(p),
        }
    }
    Ok((kept, None))
}

/// The flat parts of a projection of some solids, in a plane or where none is.
pub fn projection(
    parts: &mut Parts<'_>,
    call: &Call,
    cut: bool,
    plane: Option<Plane>,
    built: Vec<PartId>,
) -> Result<PartId> {
    let at = call.at;
    let (built, stray) = of_one_dimension(parts, built, false)?;
    if let Some((at, name)) = stray {
        parts.note(at, format!("{name} inside of projection: a 2D shape, left out, as OpenSCAD does"), None);
    }
    let Some(plane) = plane else { return Ok(parts.push(Part::Stray(at, call.name.clone()))) };
    let like = Flat {
        outline: Outline::Circle(1.0),
        inner: DAffine3::IDENTITY,
        overshoot: plane.overshoot,
        name: call.name.clone(),
        at,
        pieces: built.iter().filter_map(|p| parts.most_pieces(*p)).max().unwrap_or(convex::PIECES),
    };
    let part = if cut { shadow::section(parts, at, &like, &built)? } else { shadow::shadow(parts, at, &like, &built)? };
    let id = parts.push(part);
    for leaf in flats(parts, &[id]) {
        if let Part::Flat(flat) = &mut parts.list[leaf] {
            flat.inner = plane.inner * flat.inner;
        }
    }
    Ok(id)
}

/// A set operation, with what is known of it below a hull or a sum: of several, OpenSCAD leaves out faces that enclose nothing.
pub fn set(parts: &mut Parts<'_>, op: Op, at: Place, built: Vec<PartId>, around: Around) -> PartId {
    if around == Around::Other {
        return parts.push(Part::Op(op, at, built));
    }
    let operands: Vec<usize> = built.iter().map(|p| parts.operands(*p)).filter(|n| *n > 0).collect();
    if operands.len() > 1 && !parts.loose.is_empty() {
        let mut stack: Vec<PartId> = built.iter().copied().filter(|p| parts.operands(*p) == 1).collect();
        while let Some(p) = stack.pop() {
            if let Part::Op(_, _, of) = &parts.list[p] {
                stack.extend(of);
            } else if parts.loose.contains(&p) && parts.points.remove(&p).is_some() {
                parts.note(at, "faces without volume, beside others: left out, as OpenSCAD does", None);
            }
        }
    }
    let id = parts.push(Part::Op(op, at, built));
    parts.operands.insert(id, if let [one] = operands[..] { one } else { operands.len() });
    id
}

/// What a matrix flattens below a hull or a sum, as OpenSCAD has it: the points of one solid, nothing of several. `None` for nothing
/// that counts, though something is there.
///
/// # Errors
/// Below a sum what is not convex; whatever a mesh fails for.
pub fn flattened(
    parts: &mut Parts<'_>,
    at: Place,
    built: &[PartId],
    by: &DAffine3,
    around: Around,
) -> Result<Option<PartId>> {
    let some: Vec<PartId> = built.iter().copied().filter(|p| parts.operands(*p) > 0).collect();
    let [one] = some[..] else { return Ok(some.is_empty().then(|| parts.push(Part::Empty))) };
    if parts.operands(one) > 1 {
        return Ok(None);
    }
    let elements = if around == Around::Sum {
        let pieces = convex::pieces(parts, one).filter(|pieces| pieces.len() == 1);
        pieces.map(|pieces| pieces.concat()).ok_or_else(|| {
            let construct = "minkowski of something that is not convex and that a matrix flattens".to_owned();
            (at, Problem::Unsupported { construct, hint: THICK })
        })?
    } else {
        extremes(parts, at, one)?
    };
    let points = elements.iter().flat_map(|e| e.flattened(by)).collect();
    let id = parts.push(Part::Empty);
    parts.points.insert(id, points);
    Ok(Some(id))
}

/// Elements with the hull of a part: of one that is cut the corners of what is left of it.
fn extremes(parts: &mut Parts<'_>, at: Place, p: PartId) -> Result<Vec<Element>> {
    if let Some(all) = convex::extremes(parts, p) {
        return Ok(all);
    }
    let mesh = Meshed::of(parts, at, p)?;
    if mesh.off > 0.0 {
        parts.faceted(at, "what a hull holds, cut", mesh.triangles(), mesh.off);
    }
    Ok([mesh.elements(), parts.flat_points(p)].concat())
}

/// True for points of which OpenSCAD makes a hull, though without volume: four or more that lie on no line.
fn is_area(points: &[Element]) -> bool {
    let mut all: Vec<DVec3> = points.iter().map(Element::center).collect();
    all.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap_or(std::cmp::Ordering::Equal));
    all.dedup();
    let Some(first) = all.first().copied() else { return false };
    let far = all.iter().map(|p| *p - first).fold(DVec3::ZERO, |m, d| if d.length() > m.length() { d } else { m });
    all.len() > 3 && all.iter().any(|p| far.cross(*p - first).length() > ROUNDING * far.length_squared())
}

/// The convex hull of some solids. What has no volume counts by its points below another hull or a sum.
pub fn hull(parts: &mut Parts<'_>, at: Place, built: &[PartId], around: Around) -> Result<PartId> {
    let mut elements = Vec::new();
    for p in built {
        elements.extend(extremes(parts, at, *p)?);
    }
    if elements.is_empty() {
        return Ok(parts.push(Part::Empty));
    }
    let part = convex::hull(parts, "hull", at, &elements)?;
    let is_flat = matches!(part, Part::Empty);
    let id = parts.push(part);
    if is_flat {
        let points: Vec<Element> = elements.iter().flat_map(|e| e.flattened(&DAffine3::IDENTITY)).collect();
        if around != Around::Other && is_area(&points) {
            parts.points.insert(id, points);
            parts.note(at, "a hull without volume: its points count to what is around it, as in OpenSCAD", None);
        } else {
            parts.note(at, "a hull without volume: left out, as OpenSCAD does", None);
        }
    }
    Ok(id)
}

/// The sum of operands that were each moved by `origin`.
pub fn minkowski(parts: &mut Parts<'_>, at: Place, built: &[PartId], origin: DVec3) -> Result<Part> {
    if let [one] = built {
        return Ok(Part::Op(Op::Union, at, vec![*one]));
    }
    let mut operands = Vec::with_capacity(built.len());
    for p in built {
        let pieces = match convex::pieces(parts, *p) {
            Some(pieces) => pieces,
            None => {
                let mesh = Meshed::of(parts, at, *p)?;
                let Some(piece) = mesh.convex() else { return minkowski_of_meshes(parts, at, built, origin) };
                if mesh.off > 0.0 {
                    parts.faceted(at, "what minkowski sums, cut", mesh.triangles(), mesh.off);
                }
                if mesh.is_empty() { Vec::new() } else { vec![piece] }
            }
        };
        if !pieces.is_empty() {
            operands.push(pieces);
        }
    }
    let back = origin * (1.0 - operands.len() as f64);
    let mut made = Vec::new();
    if !operands.is_empty() {
        for sum in convex::sums(parts, at, &operands)? {
            let sum: Vec<Element> = sum.into_iter().map(|e| e.moved(back)).collect();
            let part = convex::hull(parts, "minkowski", at, &sum)?;
            if matches!(part, Part::Empty) {
                parts.note(at, "a minkowski without volume: left out, as OpenSCAD does", None);
            }
            made.push(parts.push(part));
        }
    }
    Ok(Part::Op(Op::Union, at, made))
}

/// The same of solids that are not unions of convex ones: of their meshes.
fn minkowski_of_meshes(parts: &mut Parts<'_>, at: Place, built: &[PartId], origin: DVec3) -> Result<Part> {
    let mut sum: Option<Meshed> = None;
    for p in built {
        if !parts.flat_points(*p).is_empty() {
            let construct = "minkowski of something without volume with what is not convex".to_owned();
            return Err((at, Problem::Unsupported { construct, hint: THICK }));
        }
        let mesh = Meshed::of(parts, at, *p)?;
        sum = match sum {
            _ if mesh.is_empty() => sum,
            None => Some(mesh),
            Some(before) => Some(before.plus(&mesh, at, origin)?),
        };
    }
    let Some(sum) = sum else { return Ok(Part::Empty) };
    parts.faceted(at, "minkowski", sum.triangles(), sum.off);
    sum.part(parts, at, "faceted minkowski")
}

/// What `rotate_extrude` makes of the outlines inside of it.
pub fn revolve(
    shapes: &mut Shapes<'_>,
    call: &Call,
    turn: Turn,
    outer: &DAffine3,
    built: Vec<PartId>,
) -> Result<PartId> {
    let at = call.at;
    let arguments = Turn::arguments(call)?;
    let leaves = flats(&shapes.parts, &built);
    let side = side_of_axis(&mut shapes.parts, at, &leaves, &built)?;
    let turn = if side < 0.0 { Turn { start: turn.start + 180.0, ..turn } } else { turn };
    let of_leaf = |parts: &Parts<'_>, leaf: PartId| flat_of(parts, leaf).map(Flat::paths).unwrap_or_default();
    let reach = |parts: &Parts<'_>| {
        let points = leaves.iter().flat_map(|l| of_leaf(parts, *l)).flatten();
        points.fold(0.0, |m: f64, p| m.max(p.x * side))
    };
    let far = reach(&shapes.parts);
    let sides = match shapes.fragments(&arguments, far)? {
        Some(count) => {
            let count = (f64::from(count) * turn.angle / 360.0).floor().max(1.0) as u32;
            Lathe::flat_sides(&turn, count)
        }
        None => Vec::new(),
    };
    // Into how many pieces OpenSCAD cuts the turn, where it has to be cut.
    let pieces = shapes.pieces(&arguments, far)?;
    let parts = &mut shapes.parts;
    let swept = if sides.is_empty() && parts.swept.is_some() {
        Some(Swept { outer: *outer, turn: [turn.start, turn.angle], rims: rims(parts, at, &built, side)? })
    } else {
        None
    };
    for leaf in leaves {
        let Some(flat) = flat_of(parts, leaf) else { continue };
        let (name, at) = (flat.name.clone(), flat.at);
        let lathe = Lathe { name: &name, at, outer, sides: sides.clone() };
        if let Some(disc) = flat.disc().filter(|_| sides.is_empty()) {
            let center = *outer * DAffine3::from_translation(DVec3::Z * disc.center.y);
            let away = disc.center.x.abs();
            let placed = if away <= ROUNDING * disc.radius {
                place::sphere(&center, disc.radius)
            } else {
                place::torus(&center, away, disc.radius)
            };
            if placed.is_ok() {
                parts.pieces.insert(leaf, flat.pieces);
                parts.list[leaf] = parts.leaf(&name, at, placed)?;
                continue;
            }
        }
        let paths: Vec<Vec<DVec2>> =
            flat.paths().iter().map(|p| p.iter().map(|p| DVec2::new(p.x * side, p.y)).collect()).collect();
        outlines::note_stretched_facets(parts, at, &[leaf], "rotate_extrude", place::stretch(outer.matrix3));
        parts.affordable(at, paths.iter().map(Vec::len).sum::<usize>() + 2)?;
        let region = Region::of_paths(&paths);
        if region.open {
            return Err((at, outlines::crossing()));
        }
        let first = parts.list.len();
        parts.list[leaf] = lathe.region(parts, &region)?;
        parts.pieces.extend((first..parts.list.len()).map(|p| (p, pieces)));
    }
    let whole = parts.push(Part::Op(Op::Union, at, built));
    let whole = match turn.wedge(parts, at, outer)? {
        Some(wedge) => parts.push(Part::Op(Op::Intersection, at, vec![whole, wedge])),
        None => whole,
    };
    if let (Some(swept), Some(all)) = (swept, &mut parts.swept) {
        all.insert(whole, swept);
    }
    Ok(whole)
}

/// What turns about the axis: whole discs and outlines, or what is left of them.
fn rims(parts: &mut Parts<'_>, at: Place, built: &[PartId], side: f64) -> Result<Vec<Rim>> {
    let turned = |p: DVec2| DVec2::new(p.x * side, p.y);
    let whole: Option<Vec<PartId>> = built
        .iter()
        .map(|p| parts.leaves(*p).filter(|(_, cut)| !cut).map(|(leaves, _)| leaves))
        .collect::<Option<Vec<_>>>()
        .map(|all| all.into_iter().flatten().collect());
    if let Some(leaves) = whole {
        let rim = |flat: &Flat| match flat.disc() {
            Some(disc) => Rim::Disc(Disc { center: turned(disc.center), ..disc }),
            None => Rim::Corners(flat.paths().into_iter().flatten().map(turned).collect()),
        };
        return Ok(leaves.iter().filter_map(|l| flat_of(parts, *l)).map(rim).collect());
    }
    let before = parts.notes.len();
    let left = outlines::paths(parts, at, built, "rotate_extrude")?;
    parts.notes.truncate(before);
    Ok(vec![Rim::Corners(left.into_iter().flatten().map(turned).collect())])
}

/// On which side of the axis an outline lies: 1 or −1. One on both has no solid in OpenSCAD, either.
fn side_of_axis(parts: &mut Parts<'_>, at: Place, leaves: &[PartId], built: &[PartId]) -> Result<f64> {
    let extent =
        |paths: &mut dyn Iterator<Item = DVec2>| paths.fold([0.0, 0.0], |[l, h]: [f64; 2], p| [l.min(p.x), h.max(p.x)]);
    let all: Vec<DVec2> = leaves.iter().filter_map(|l| flat_of(parts, *l)).flat_map(Flat::paths).flatten().collect();
    let [low, high] = extent(&mut all.into_iter());
    let least = SIMILARITY * (high - low);
    if low >= -least {
        return Ok(1.0);
    }
    if high <= least {
        return Ok(-1.0);
    }
    // What is subtracted may lie on both sides: the outline itself tells.
    let before = parts.notes.len();
    let rims = outlines::paths(parts, at, built, "rotate_extrude")?;
    parts.notes.truncate(before);
    let [low, high] = extent(&mut rims.into_iter().flatten());
    if low >= -least {
        return Ok(1.0);
    }
    if high <= least {
        return Ok(-1.0);
    }
    Err((at, Problem::syntax("an outline on one side of the axis of rotate_extrude", "one on both")))
}

#[cfg(test)]
mod tests {
    use crate::import::{Facets, Limits, import_csg};
    use crate::octree::Model;
    use crate::octree::mass::mass_properties;
    use contactd_proto::MassOptions;

    const SQUARE: &str =
        "polyhedron(points = [[0, -5, 0], [4, -5, 0], [4, -5, 4], [0, -5, 4]], faces = [[0, 1, 2, 3]]);";
    const FLATTENED: &str = "multmatrix([[1, 0, 0, 0], [0, 0, 0, -5], [0, 0, 1, 0], [0, 0, 0, 1]])";
    const ASIDE: &str = "multmatrix([[1, 0, 0, 9], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) { cube(1); }";

    /// The expected volumes are those of OpenSCAD 2021.01.
    #[test]
    fn what_has_no_volume_counts_by_its_points_to_hulls_and_sums() {
        let flat = format!("hull() {{ {SQUARE} }}");
        let scaled = format!("{FLATTENED} cube(4);");
        let joined = format!("{FLATTENED} {{ cube(4); {ASIDE} }}");
        let cut = format!("{FLATTENED} difference() {{ cube(4); cube(1); }}");
        let line =
            "hull() { polyhedron(points = [[0, -5, 0], [1, -5, 0], [2, -5, 0], [4, -5, 0]], faces = [[0, 1, 2, 3]]); }";
        let nook = "linear_extrude(height = 2) { polygon([[0, 0], [9, 0], [9, 1], [1, 1], [1, 9], [0, 9]]); }";
        let ring = "rotate_extrude($fn = 4) { polygon([[1, 0], [3, 0], [2, 4]]); }";
        for (text, volume) in [
            (format!("hull() {{ {SQUARE} cube(4); }}"), 144.0),
            (format!("hull() {{ {flat} cube(4); }}"), 144.0),
            (format!("hull() {{ {scaled} cube(4); }}"), 144.0),
            (format!("hull() {{ group() {{ group(); {flat} }} cube(4); }}"), 144.0),
            (format!("hull() {{ minkowski() {{ {flat} }} cube(4); }}"), 144.0),
            (format!("hull() {{ {FLATTENED} {ring} cube(4); }}"), 536.0 / 3.0),
            (format!("hull() {{ {FLATTENED} {nook} cube(4); }}"), 572.0 / 3.0),
            (format!("hull() {{ {FLATTENED} cylinder(r1 = 2, r2 = 2, h = 3, $fn = 6); cube(4); }}"), 446.0 / 3.0),
            (format!("minkowski() {{ {flat} cube(4); }}"), 256.0),
            (format!("minkowski() {{ {scaled} cube(4); }}"), 256.0),
            (format!("minkowski() {{ hull() {{ {scaled} }} cube(4); }}"), 256.0),
            (format!("minkowski() {{ union() {{ {flat} {ASIDE} }} cube(4); }}"), 381.0),
            // Beside others in a union faces alone are nothing, hulls and what is flattened are something.
            (format!("hull() {{ union() {{ {SQUARE} {ASIDE} }} cube(4); }}"), 106.0),
            (format!("hull() {{ union() {{ {scaled} {ASIDE} }} cube(4); }}"), 231.0),
            // What several make is nothing when it is flattened, nor is a sum without volume, nor a line.
            (format!("hull() {{ {joined} cube(4); }}"), 64.0),
            (format!("hull() {{ {cut} cube(4); }}"), 64.0),
            (format!("hull() {{ minkowski() {{ {flat} {flat} }} cube(4); }}"), 64.0),
            (format!("hull() {{ {line} cube(4); }}"), 64.0),
            (format!("cube(4); {flat} {scaled}"), 64.0),
        ] {
            let import = import_csg("m.csg", &text, Facets::Auto, &Limits::default());
            let import = import.unwrap_or_else(|e| panic!("{text}: {e}"));
            let found = mass_properties(&Model::new(import.solid), &MassOptions::default()).expect("a solid").volume;
            assert!((found - volume).abs() < 1e-9, "{text}: {found}, not {volume}");
        }
        for (operands, sentence) in [
            (
                format!("{flat} difference() {{ cube(4); cube(1); }}"),
                "minkowski of something without volume with what is not convex",
            ),
            (
                format!("{FLATTENED} {nook} cube(4);"),
                "minkowski of something that is not convex and that a matrix flattens",
            ),
        ] {
            let text = format!("minkowski() {{ {operands} }}");
            let error = import_csg("m.csg", &text, Facets::Auto, &Limits::default()).expect_err("refused").to_string();
            assert!(error.contains(sentence), "{error}");
        }
    }
}
