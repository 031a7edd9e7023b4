//! GDML's solids as flattened OpenSCAD texts, millimetres.
//!
//! Source: GDML User's Guide 2.8, section 3.4, and the classes of Geant4 that it names. Round ones are exact.

use super::super::problem::Problem;
use super::super::written::placed;
use super::super::{Place, xml};
use super::text::{both, clean, cone, cylinder, is_whole, minus, polyhedron, scaled, sweep, turned};
use super::{Geometry, Result, needed, only};
use contactd_proto::Pose;
use glam::{DVec2, DVec3};
use roxmltree::Node;
use std::f64::consts::TAU;

/// Solids within solids.
const DEEPEST: usize = 200;
/// Two planes that are no farther apart, in sizes, are one: what files calculate of the same height differs so.
const SAME_PLANE: f64 = 1e-12;
/// Sides of a torus' section where it has to be cut: an uneven scale makes no surface of it that is known here. They lie 1.6e-4 of its
/// radius within it, and cost a search little more than a sixth of them.
const BENT: u32 = 180;
/// Bytes of one solid's text.
const LONGEST: usize = 16 << 20;

/// Attributes of a solid, in millimetres and radians.
struct Read<'g, 'a, 'i> {
    geometry: &'g Geometry<'a, 'i>,
    node: Node<'a, 'i>,
    length: f64,
    angle: f64,
}

impl<'g, 'a, 'i> Read<'g, 'a, 'i> {
    fn raw(&self, key: &str) -> Result<Option<f64>> {
        self.geometry.number(self.node, key)
    }

    fn len(&self, key: &str) -> Result<f64> {
        let value =
            self.raw(key)?.ok_or_else(|| xml::wrong(self.node, format!("{key} of the {}", self.kind()), None))?;
        Ok(value * self.length)
    }

    /// A length that is positive.
    fn size(&self, key: &str) -> Result<f64> {
        match self.len(key)? {
            size if size > 0.0 => Ok(size),
            size => Err(self.refused(format!("{key} of the {} that is positive", self.kind()), size)),
        }
    }

    /// A length that is positive or 0, which it is where it is left out.
    fn rest(&self, key: &str) -> Result<f64> {
        match self.len_or(key, 0.0)? {
            size if size >= 0.0 => Ok(size),
            size => Err(self.refused(format!("{key} of the {} that is not negative", self.kind()), size)),
        }
    }

    /// An inner radius: less than the outer one.
    fn inner(&self, key: &str, outer: f64) -> Result<f64> {
        match self.rest(key)? {
            inner if inner < outer || (inner == 0.0 && outer == 0.0) => Ok(inner),
            inner => Err(self.refused(format!("{key} of the {} below {outer}", self.kind()), inner)),
        }
    }

    fn refused(&self, expected: String, found: f64) -> (Place, Problem) {
        xml::wrong(self.node, expected, Some(&found.to_string()))
    }

    /// Where a part of a turn begins, and how far it goes.
    fn span(&self) -> Result<(f64, f64)> {
        let turn = self.angle_or("deltaphi", TAU)?;
        if turn <= 0.0 {
            return Err(self.refused(format!("deltaphi of the {} that is positive", self.kind()), turn));
        }
        Ok((self.angle_or("startphi", 0.0)?, turn))
    }

    fn len_or(&self, key: &str, none: f64) -> Result<f64> {
        Ok(self.raw(key)?.map_or(none, |x| x * self.length))
    }

    fn angle_or(&self, key: &str, none: f64) -> Result<f64> {
        Ok(self.raw(key)?.map_or(none, |x| x * self.angle))
    }

    fn kind(&self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Those of an element inside, in the units of this one.
    fn inside(&self, node: Node<'a, 'i>) -> Self {
        Self { node, ..*self }
    }

    fn all(&self, name: &'static str) -> Vec<Self> {
        xml::inside(self.node, name).map(|node| self.inside(node)).collect()
    }
}

/// Eight corners, the lower four first, both counter-clockwise from above; sides that are no planes are refused.
fn eight(read: &Read<'_, '_, '_>, points: [DVec3; 8]) -> Result<String> {
    let faces = [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
    let size = points.iter().map(|p| p.length()).fold(0.0, f64::max);
    for [a, b, c, d] in faces {
        let n = (points[c] - points[a]).cross(points[d] - points[b]).normalize_or_zero();
        if (points[b] - points[a]).dot(n).abs() > 1e-9 * size {
            let sentence = format!("a twisted {}: its sides are no planes", read.kind());
            return Err((xml::place(read.node), Problem::unsupported(sentence)));
        }
    }
    Ok(clean(&points, &faces.map(Vec::from)))
}

/// What stands inside of a solid of a kind.
fn inside(kind: &str) -> &'static [&'static str] {
    match kind {
        "polycone" | "polyhedra" => &["zplane"],
        "genericPolycone" | "genericPolyhedra" => &["rzpoint"],
        "xtru" => &["twoDimVertex", "section"],
        "tessellated" => &["triangular", "quadrangular"],
        "multiUnion" => &["multiUnionNode"],
        "scaledSolid" => &["solidref", "scale", "scaleref"],
        "union" | "subtraction" | "intersection" => &[
            "first",
            "second",
            "position",
            "positionref",
            "rotation",
            "rotationref",
            "firstposition",
            "firstpositionref",
            "firstrotation",
            "firstrotationref",
        ],
        _ => &[],
    }
}

/// The text of a solid.
pub(super) fn text(geometry: &Geometry<'_, '_>, name: &str, asker: Node<'_, '_>, depth: usize) -> Result<String> {
    let Some(node) = geometry.solids.get(name).copied() else {
        return Err(xml::wrong(asker, "the name of a solid", Some(name)));
    };
    if depth > DEEPEST {
        return Err((xml::place(node), Problem::Limit { what: "solids within solids", limit: DEEPEST }));
    }
    let unit = |key: &str, none: &str| geometry.unit(node, node.attribute(key).unwrap_or(none));
    let read = Read { geometry, node, length: unit("lunit", "mm")?, angle: unit("aunit", "rad")? };
    let text = match read.kind() {
        "box" | "orb" | "tube" | "cone" | "sphere" | "torus" | "ellipsoid" | "eltube" | "elcone" | "paraboloid"
        | "hype" | "cutTube" => round(&read)?,
        "polycone" | "genericPolycone" | "polyhedra" | "genericPolyhedra" => revolved(&read)?,
        "trd" | "trap" | "para" | "arb8" | "tet" | "xtru" | "tessellated" => flat(&read)?,
        "union" | "subtraction" | "intersection" | "multiUnion" | "scaledSolid" => combined(&read, depth)?,
        other => return Err((xml::place(node), Problem::unsupported(format!("the solid {other}")))),
    };
    only(node, inside(read.kind()))?;
    if text.len() > LONGEST {
        return Err((xml::place(node), Problem::Limit { what: "bytes of a solid's text", limit: LONGEST }));
    }
    Ok(match &geometry.origins {
        None => text,
        Some(origins) => origins.borrow_mut().mark(read.kind(), name, xml::place(node), &text),
    })
}

fn round(read: &Read<'_, '_, '_>) -> Result<String> {
    let span = || read.span();
    Ok(match read.kind() {
        "box" => {
            format!(
                "cube(size = [{:?}, {:?}, {:?}], center = true);",
                read.size("x")?,
                read.size("y")?,
                read.size("z")?
            )
        }
        "orb" => format!("sphere($fn = 0, r = {:?});", read.size("r")?),
        "tube" => {
            let rmax = read.size("rmax")?;
            tube(read.inner("rmin", rmax)?, rmax, read.size("z")?, span()?)
        }
        "cutTube" => {
            let (rmax, z) = (read.size("rmax")?, read.size("z")?);
            let rmin = read.inner("rmin", rmax)?;
            let mut planes = Vec::new();
            for (keys, at) in [(["lowX", "lowY", "lowZ"], -0.5 * z), (["highX", "highY", "highZ"], 0.5 * z)] {
                let part = |k: usize| Ok(read.raw(keys[k])?.unwrap_or(0.0));
                let n = DVec3::new(part(0)?, part(1)?, part(2)?);
                let unit = n.try_normalize().filter(|u| u.z * at > 0.0);
                let outward = "normals of the planes that look out of the tube: lowZ below 0, highZ above";
                planes.push((unit.ok_or_else(|| xml::wrong(read.node, outward, Some(&n.to_string())))?, at));
            }
            // As long as the steeper plane asks for.
            let reach = planes.iter().map(|(n, _)| rmax * n.truncate().length() / n.z.abs()).fold(0.0, f64::max);
            let mut text = tube(rmin, rmax, 1.1 * z + 2.2 * reach, span()?);
            for (n, at) in planes {
                let half = format!("half_space(normal = {:?}, offset = {:?});", n.to_array(), n.z * at);
                text = both(&text, &half);
            }
            text
        }
        "cone" => {
            let (b, d, z) = (read.rest("rmax1")?, read.rest("rmax2")?, read.size("z")?);
            let (a, c) = (read.inner("rmin1", b)?, read.inner("rmin2", d)?);
            let (from, turn) = span()?;
            if a == 0.0 && c == 0.0 && is_whole(turn) {
                return Ok(cone(b, d, z));
            }
            let at = DVec2::new;
            turned(&[at(a, -0.5 * z), at(b, -0.5 * z), at(d, 0.5 * z), at(c, 0.5 * z)], from, turn)
        }
        "sphere" => sphere(read, span()?)?,
        "torus" => {
            let ring = |r: f64| {
                Ok(format!(
                    "multmatrix([[1, 0, 0, {:?}], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) {{ circle($fn = {BENT}, r = {r:?}); }}",
                    read.size("rtor")?
                ))
            };
            let (from, turn) = span()?;
            let rmax = read.size("rmax")?;
            let outer = sweep(&ring(rmax)?, from, turn);
            match read.inner("rmin", rmax)? {
                0.0 => outer,
                // The hole goes on through the ends.
                inner => minus(&outer, &sweep(&ring(inner)?, from, TAU)),
            }
        }
        "ellipsoid" => {
            let axes = DVec3::new(read.size("ax")?, read.size("by")?, read.size("cz")?);
            let text = scaled(axes, "sphere($fn = 0, r = 1.0);");
            let (low, high) = (read.len_or("zcut1", 0.0)?, read.len_or("zcut2", 0.0)?);
            if low == 0.0 && high == 0.0 {
                return Ok(text);
            }
            if low >= high {
                return Err(read.refused("zcut2 of the ellipsoid above zcut1".into(), high));
            }
            let (low, high) = (low.max(-1.5 * axes.z), high.min(1.5 * axes.z));
            let slab =
                format!("cube(size = [{:?}, {:?}, {:?}], center = true);", 4.0 * axes.x, 4.0 * axes.y, high - low);
            both(&text, &placed(&Pose::at(DVec3::Z * (0.5 * (low + high))), &slab))
        }
        "eltube" => {
            let (x, y, z) = (read.size("dx")?, read.size("dy")?, read.size("dz")?);
            scaled(DVec3::new(x, y, 1.0), &cylinder(1.0, 2.0 * z))
        }
        "elcone" => {
            // Semi-axes a length of height: dx and dy have no unit.
            let (x, y) = (read.raw("dx")?.unwrap_or(1.0), read.raw("dy")?.unwrap_or(1.0));
            let (tip, cut) = (read.size("zmax")?, read.size("zcut")?);
            let cut = cut.min(tip);
            scaled(DVec3::new(x, y, 1.0), &cone(tip + cut, tip - cut, 2.0 * cut))
        }
        "paraboloid" => {
            let (high, half) = (read.size("rhi")?, read.size("dz")?);
            let low = read.inner("rlo", high)?;
            // ρ² = k (z − tip): a dome upside down, cut where it is to begin.
            let k = (high * high - low * low) / (2.0 * half);
            let h = high * high / k;
            let dome = format!("paraboloid(h = {h:?}, r = {high:?}, center = false);");
            let down = Pose::new(DVec3::Z * half, glam::DQuat::from_rotation_x(std::f64::consts::PI));
            let slab = format!("cube(size = [{:?}, {:?}, {:?}], center = true);", 4.0 * high, 4.0 * high, 2.0 * half);
            both(&placed(&down, &dome), &slab)
        }
        _ => {
            let (outer, z) = (read.size("rmax")?, read.size("z")?);
            let inner = read.inner("rmin", outer)?;
            let steep = read.angle_or("inst", 0.0)?.tan().abs();
            let waist = |r: f64, stereo: f64, h: f64| {
                let rim = (r * r + (stereo.tan() * 0.5 * h).powi(2)).sqrt();
                if rim == r {
                    cylinder(r, h)
                } else {
                    format!("hyperboloid(h = {h:?}, r = {rim:?}, waist = {r:?}, center = true);")
                }
            };
            let whole = waist(outer, read.angle_or("outst", 0.0)?, z);
            match inner {
                0.0 if steep == 0.0 => whole,
                // Two cones, tip to tip.
                0.0 => {
                    let h = 0.75 * z;
                    let at = |z: f64, text: &str| placed(&Pose::at(DVec3::Z * z), text);
                    let below = at(-0.5 * h, &cone(steep * h, 0.0, h));
                    minus(&whole, &format!("union() {{ {below} {} }}", at(0.5 * h, &cone(0.0, steep * h, h))))
                }
                inner => minus(&whole, &waist(inner, read.angle_or("inst", 0.0)?, 1.5 * z)),
            }
        }
    })
}

fn tube(rmin: f64, rmax: f64, z: f64, (from, turn): (f64, f64)) -> String {
    match (rmin == 0.0, is_whole(turn)) {
        (true, true) => cylinder(rmax, z),
        (false, true) => minus(&cylinder(rmax, z), &cylinder(rmin, 1.5 * z)),
        (_, false) => {
            let at = DVec2::new;
            turned(&[at(rmin, -0.5 * z), at(rmax, -0.5 * z), at(rmax, 0.5 * z), at(rmin, 0.5 * z)], from, turn)
        }
    }
}

fn sphere(read: &Read<'_, '_, '_>, (from, turn): (f64, f64)) -> Result<String> {
    let rmax = read.size("rmax")?;
    let rmin = read.inner("rmin", rmax)?;
    let (low, delta) = (read.angle_or("starttheta", 0.0)?, read.angle_or("deltatheta", std::f64::consts::PI)?);
    let ball = |r: f64| format!("sphere($fn = 0, r = {r:?});");
    let mut text = if rmin == 0.0 { ball(rmax) } else { minus(&ball(rmax), &ball(rmin)) };
    let high = (low + delta).min(std::f64::consts::PI);
    let is_all = low <= 0.0 && high >= std::f64::consts::PI - 1e-9;
    if is_all && is_whole(turn) {
        return Ok(text);
    }
    // A sector whose straight rim lies outside of the ball: steps of 45 degrees at most.
    let steps = ((high - low) / std::f64::consts::FRAC_PI_4).ceil().max(1.0) as usize;
    let far = 1.5 * rmax;
    let mut outline = vec![DVec2::ZERO];
    for k in 0..=steps {
        let theta = low + (high - low) * k as f64 / steps as f64;
        let r = theta.sin() * far;
        outline.push(DVec2::new(if is_all && (k == 0 || k == steps) { 0.0 } else { r.max(0.0) }, theta.cos() * far));
    }
    text = both(&text, &turned(&outline, from, turn));
    Ok(text)
}

/// What has an outline of planes z, or of points.
fn revolved(read: &Read<'_, '_, '_>) -> Result<String> {
    let (from, turn) = (read.angle_or("startphi", 0.0)?, read.angle_or("deltaphi", TAU)?);
    // Geant4 takes it so.
    let turn = if turn <= 0.0 { TAU } else { turn };
    if read.kind().starts_with("generic") {
        let points = read.all("rzpoint");
        let outline = points.iter().map(|p| Ok(DVec2::new(p.rest("r")?, p.len("z")?))).collect::<Result<Vec<_>>>()?;
        let (radii, heights): (Vec<f64>, Vec<f64>) = outline.iter().map(|p| (p.x, p.y)).unzip();
        let mut outline: Vec<DVec2> =
            radii.iter().zip(level(heights, &radii)).map(|(r, z)| DVec2::new(*r, z)).collect();
        // Its last corner stands beside the first.
        if let [first, .., last] = &mut outline[..]
            && level(vec![first.y, last.y], &radii)[1] == first.y
        {
            last.y = first.y;
        }
        if outline.len() < 3 {
            return Err(xml::wrong(read.node, "three rzpoints at least", Some(&outline.len().to_string())));
        }
        return match read.kind() {
            "genericPolycone" => Ok(turned(&outline, from, turn)),
            _ => Ok(around(outline, sides(read, turn)?, (from, turn))),
        };
    }
    let planes = read.all("zplane");
    if planes.len() < 2 {
        return Err(xml::wrong(read.node, "two planes at least", Some(&planes.len().to_string())));
    }
    let radii = |key: &str| planes.iter().map(|p| p.len_or(key, 0.0)).collect::<Result<Vec<_>>>();
    let (outer, inner) = (radii("rmax")?, radii("rmin")?);
    let heights = level(planes.iter().map(|p| p.len("z")).collect::<Result<_>>()?, &outer);
    let [outer, inner]: [Vec<DVec2>; 2] =
        [outer, inner].map(|radii| radii.into_iter().zip(&heights).map(|(r, z)| DVec2::new(r, *z)).collect());
    if read.kind() == "polycone" {
        let outline: Vec<DVec2> = outer.iter().chain(inner.iter().rev()).copied().collect();
        return Ok(turned(&outline, from, turn));
    }
    let sides = sides(read, turn)?;
    let whole = rings(&outer, sides, (from, turn));
    Ok(match inner.iter().all(|p| p.x == 0.0) {
        true => whole,
        // What is taken away goes on beyond the ends of the other.
        false => minus(&whole, &rings(&beyond(&inner), sides, (from, turn))),
    })
}

/// Planes' heights, those that differ by rounding from the one before as that: a step back by rounding would be a cut into the solid,
/// thinner than any tolerance, and what lies beside it could not be told.
fn level(mut heights: Vec<f64>, radii: &[f64]) -> Vec<f64> {
    let size = heights.iter().chain(radii).fold(0.0, |m: f64, x| m.max(x.abs()));
    for k in 1..heights.len() {
        if (heights[k] - heights[k - 1]).abs() <= SAME_PLANE * size {
            heights[k] = heights[k - 1];
        }
    }
    heights
}

/// How many sides a polyhedra has over its turn.
fn sides(read: &Read<'_, '_, '_>, turn: f64) -> Result<usize> {
    let sides = read.raw("numsides")?.unwrap_or(0.0);
    if !(1.0..=10_000.0).contains(&sides) || sides.fract() != 0.0 {
        return Err(xml::wrong(read.node, "a whole number of sides", read.node.attribute("numsides")));
    }
    if turn.min(TAU) / sides > std::f64::consts::PI - 1e-6 {
        return Err(xml::wrong(read.node, "sides of less than half a turn each", read.node.attribute("numsides")));
    }
    Ok(sides as usize)
}

/// An outline of (r, z), r the distance of corners from the axis, in plane steps around z.
fn around(mut outline: Vec<DVec2>, sides: usize, (from, turn): (f64, f64)) -> String {
    let n = outline.len();
    let area: f64 = (0..n).map(|i| outline[i].perp_dot(outline[(i + 1) % n])).sum();
    if area < 0.0 {
        outline.reverse();
    }
    let is_closed = is_whole(turn);
    let step = if is_closed { TAU } else { turn } / sides as f64;
    let count = if is_closed { sides } else { sides + 1 };
    let mut points = Vec::new();
    for k in 0..count {
        let (s, c) = (from + k as f64 * step).sin_cos();
        points.extend(outline.iter().map(|p| DVec3::new(p.x * c, p.x * s, p.y)));
    }
    let mut faces = Vec::new();
    for k in 0..sides {
        let next = (k + 1) % count;
        faces.extend((0..n).map(|i| vec![k * n + i, next * n + i, next * n + (i + 1) % n, k * n + (i + 1) % n]));
    }
    if !is_closed {
        faces.push((0..n).collect());
        faces.push((sides * n..(sides + 1) * n).rev().collect());
    }
    clean(&points, &faces)
}

/// An outline whose ends go on straight up and down.
fn beyond(outline: &[DVec2]) -> Vec<DVec2> {
    let (first, last) = (outline[0], outline[outline.len() - 1]);
    let by = 0.1 * (last.y - first.y);
    let mut longer = vec![DVec2::new(first.x, first.y - by)];
    longer.extend_from_slice(outline);
    longer.push(DVec2::new(last.x, last.y + by));
    longer
}

/// A stack of regular polygons of these distances from the axis to their sides, over a part of a turn.
fn rings(outline: &[DVec2], sides: usize, (from, turn): (f64, f64)) -> String {
    let is_closed = is_whole(turn);
    let step = if is_closed { TAU } else { turn } / sides as f64;
    let out = (0.5 * step).cos().recip();
    let count = if is_closed { sides } else { sides + 1 };
    let mut parts = Vec::new();
    for pair in outline.windows(2) {
        let [low, high] = if pair[0].y < pair[1].y { [pair[0], pair[1]] } else { [pair[1], pair[0]] };
        if low.y == high.y || (low.x == 0.0 && high.x == 0.0) {
            continue;
        }
        let ring = |p: DVec2| {
            (0..count).map(move |k| {
                let (s, c) = (from + k as f64 * step).sin_cos();
                DVec3::new(p.x * out * c, p.x * out * s, p.y)
            })
        };
        // The lower ring, the upper one, and the axis of a part of a turn.
        let points: Vec<DVec3> = ring(low).chain(ring(high)).chain([DVec3::Z * low.y, DVec3::Z * high.y]).collect();
        let (axis_low, axis_high) = (2 * count, 2 * count + 1);
        let mut faces = Vec::new();
        for k in 0..sides {
            let next = (k + 1) % count;
            faces.push(vec![k, next, count + next, count + k]);
        }
        let mut floor: Vec<usize> = (0..count).rev().collect();
        let mut roof: Vec<usize> = (count..2 * count).collect();
        if !is_closed {
            floor.push(axis_low);
            roof.push(axis_high);
            faces.push(vec![axis_low, 0, count, axis_high]);
            faces.push(vec![axis_low, axis_high, 2 * count - 1, count - 1]);
        }
        faces.extend([floor, roof]);
        parts.push(clean(&points, &faces));
    }
    if parts.len() == 1 { parts.remove(0) } else { format!("union() {{ {} }}", parts.join(" ")) }
}

/// What has plane sides.
fn flat(read: &Read<'_, '_, '_>) -> Result<String> {
    let base = |z: f64, [x1, x2, y]: [f64; 3], shift: DVec2, lean: f64| {
        let corner = |x: f64, y: f64| DVec3::new(shift.x + x + y * lean, shift.y + y, z);
        [corner(-x1, -y), corner(x1, -y), corner(x2, y), corner(-x2, y)]
    };
    let two = |low: [DVec3; 4], high: [DVec3; 4]| {
        let mut all = [DVec3::ZERO; 8];
        all[..4].copy_from_slice(&low);
        all[4..].copy_from_slice(&high);
        all
    };
    match read.kind() {
        "trd" => {
            let half = |key: &str| Ok(0.5 * read.rest(key)?);
            let (x1, x2, y1, y2, z) = (half("x1")?, half("x2")?, half("y1")?, half("y2")?, 0.5 * read.size("z")?);
            eight(read, two(base(-z, [x1, x1, y1], DVec2::ZERO, 0.0), base(z, [x2, x2, y2], DVec2::ZERO, 0.0)))
        }
        "trap" => {
            let half = |key: &str| Ok(0.5 * read.size(key)?);
            let z = half("z")?;
            let (theta, phi) = (read.angle_or("theta", 0.0)?, read.angle_or("phi", 0.0)?);
            let shift = DVec2::from_angle(phi) * (theta.tan() * z);
            let lean = |key: &str| Ok(read.angle_or(key, 0.0)?.tan());
            let low = base(-z, [half("x1")?, half("x2")?, half("y1")?], -shift, lean("alpha1")?);
            let high = base(z, [half("x3")?, half("x4")?, half("y2")?], shift, lean("alpha2")?);
            eight(read, two(low, high))
        }
        "para" => {
            let half = |key: &str| Ok(0.5 * read.size(key)?);
            let (x, y, z) = (half("x")?, half("y")?, half("z")?);
            let (theta, phi) = (read.angle_or("theta", 0.0)?, read.angle_or("phi", 0.0)?);
            let shift = DVec2::from_angle(phi) * (theta.tan() * z);
            let lean = read.angle_or("alpha", 0.0)?.tan();
            eight(read, two(base(-z, [x, x, y], -shift, lean), base(z, [x, x, y], shift, lean)))
        }
        "arb8" => {
            let z = read.size("dz")?;
            let mut points = [DVec3::ZERO; 8];
            for (k, point) in points.iter_mut().enumerate() {
                let [x, y] = [format!("v{}x", k + 1), format!("v{}y", k + 1)];
                *point = DVec3::new(read.len(&x)?, read.len(&y)?, if k < 4 { -z } else { z });
            }
            // They go round clockwise in GDML as a rule, and either way in files.
            let area: f64 = (0..4).map(|k| points[k].truncate().perp_dot(points[(k + 1) % 4].truncate())).sum::<f64>()
                + (4..8).map(|k| points[k].truncate().perp_dot(points[4 + (k + 1) % 4].truncate())).sum::<f64>();
            if area < 0.0 {
                points[..4].reverse();
                points[4..].reverse();
            }
            eight(read, points)
        }
        "tet" => {
            let mut points = [DVec3::ZERO; 4];
            for (k, point) in points.iter_mut().enumerate() {
                *point = read.geometry.position(read.node, &format!("vertex{}", k + 1))? * read.length;
            }
            let [a, b, c, d] = points;
            if (b - a).cross(c - a).dot(d - a) < 0.0 {
                points.swap(1, 2);
            }
            Ok(polyhedron(&points, &[vec![0, 2, 1], vec![0, 1, 3], vec![1, 2, 3], vec![2, 0, 3]]))
        }
        "xtru" => extruded(read),
        _ => {
            let mut points: Vec<DVec3> = Vec::new();
            let mut faces = Vec::new();
            for facet in read.node.children().filter(Node::is_element) {
                let count = match facet.tag_name().name() {
                    "triangular" => 3,
                    "quadrangular" => 4,
                    other => return Err(xml::wrong(facet, "triangular or quadrangular facets", Some(other))),
                };
                if facet.attribute("type") == Some("RELATIVE") {
                    return Err((xml::place(facet), Problem::unsupported("a facet of relative vertices")));
                }
                let mut face = Vec::new();
                for k in 1..=count {
                    points.push(read.geometry.position(facet, &format!("vertex{k}"))?);
                    face.push(points.len() - 1);
                }
                faces.push(face);
            }
            Ok(clean(&points, &faces))
        }
    }
}

/// An outline in several sections, each scaled and moved.
fn extruded(read: &Read<'_, '_, '_>) -> Result<String> {
    let corners = read.all("twoDimVertex");
    let mut outline = corners.iter().map(|c| Ok(DVec2::new(c.len("x")?, c.len("y")?))).collect::<Result<Vec<_>>>()?;
    let area: f64 = (0..outline.len()).map(|k| outline[k].perp_dot(outline[(k + 1) % outline.len()])).sum();
    if area < 0.0 {
        outline.reverse();
    }
    let mut sections = Vec::new();
    for s in read.all("section") {
        let shift = DVec2::new(s.len_or("xOffset", 0.0)?, s.len_or("yOffset", 0.0)?);
        sections.push((
            s.raw("zOrder")?.unwrap_or(0.0),
            s.len("zPosition")?,
            shift,
            s.raw("scalingFactor")?.unwrap_or(1.0),
        ));
    }
    sections.sort_by(|a, b| a.0.total_cmp(&b.0));
    let reach: Vec<f64> = outline.iter().map(|p| p.length()).collect();
    let heights = level(sections.iter().map(|s| s.1).collect(), &reach);
    sections.iter_mut().zip(heights).for_each(|(s, z)| s.1 = z);
    if outline.len() < 3 || sections.len() < 2 {
        return Err(xml::wrong(read.node, "three corners and two sections at least", None));
    }
    let n = outline.len();
    let mut points = Vec::new();
    for (_, z, shift, scale) in &sections {
        points.extend(outline.iter().map(|p| (*p * *scale + *shift).extend(*z)));
    }
    let mut faces = vec![(0..n).rev().collect::<Vec<_>>(), ((sections.len() - 1) * n..sections.len() * n).collect()];
    for k in 0..sections.len() - 1 {
        for i in 0..n {
            let next = (i + 1) % n;
            faces.push(vec![k * n + i, k * n + next, (k + 1) * n + next, (k + 1) * n + i]);
        }
    }
    Ok(clean(&points, &faces))
}

/// What is made of others.
fn combined(read: &Read<'_, '_, '_>, depth: usize) -> Result<String> {
    let of = |node: Node<'_, '_>| text(read.geometry, needed(node, "ref")?, node, depth + 1);
    let inside = |name: &'static str| {
        let node = xml::inside(read.node, name).next();
        node.ok_or_else(|| xml::wrong(read.node, format!("a {name} of the {}", read.kind()), None))
    };
    if read.kind() == "scaledSolid" {
        let scale = read.geometry.vector(read.node, "scale", DVec3::ONE)?;
        return Ok(scaled(scale, &of(inside("solidref")?)?));
    }
    if read.kind() == "multiUnion" {
        let mut parts = Vec::new();
        for node in xml::inside(read.node, "multiUnionNode") {
            only(node, &["solid", "position", "positionref", "rotation", "rotationref"])?;
            let solid = xml::inside(node, "solid").next();
            let solid = solid.ok_or_else(|| xml::wrong(node, "a solid of the node", None))?;
            parts.push(placed(&read.geometry.pose(node, ["position", "rotation"], false)?, &of(solid)?));
        }
        return Ok(format!("union() {{ {} }}", parts.join(" ")));
    }
    let first =
        placed(&read.geometry.pose(read.node, ["firstposition", "firstrotation"], false)?, &of(inside("first")?)?);
    let second = placed(&read.geometry.pose(read.node, ["position", "rotation"], false)?, &of(inside("second")?)?);
    let word = match read.kind() {
        "union" => "union",
        "subtraction" => "difference",
        _ => "intersection",
    };
    Ok(format!("{word}() {{ {first} {second} }}"))
}
