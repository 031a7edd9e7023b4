//! Surfaces: where they are negative as a flattened OpenSCAD text within a box, and what is known of them without a search.

use super::{Result, xml};
use crate::import::Problem;
use crate::import::written::placed;
use crate::math::Aabb;
use contactd_proto::Pose;
use glam::{DMat3, DVec3};
use roxmltree::Node;

/// How far what is cut off reaches beyond a box, in sizes of it: no skin is left where both end.
const ROOM: f64 = 0.25;
/// Boxes at most that are split to learn on which sides of a quadric a box is.
const MOST_LOOKS: usize = 2_000;

/// A surface, negative on one side and positive on the other.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Surface {
    /// n·x − offset, n of length 1.
    Plane {
        normal: DVec3,
        offset: f64,
    },
    /// Around a line along an axis, without ends.
    Cylinder {
        axis: usize,
        center: DVec3,
        radius: f64,
    },
    Sphere {
        center: DVec3,
        radius: f64,
    },
    /// Two cones, tip to tip: negative where the distance from the axis is below `slope` times that along it.
    Cone {
        axis: usize,
        tip: DVec3,
        slope: f64,
    },
    /// Around an axis.
    Torus {
        axis: usize,
        center: DVec3,
        major: f64,
        minor: f64,
    },
    /// xᵀ square x + linear·x + constant.
    Quadric {
        square: DMat3,
        linear: DVec3,
        constant: f64,
    },
}

/// The two other axes.
fn across(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

/// Least and largest distance of a box's points from 0 along one axis, where it goes from `low` to `high`.
fn reach(low: f64, high: f64) -> (f64, f64) {
    let least = if low <= 0.0 && high >= 0.0 { 0.0 } else { low.abs().min(high.abs()) };
    (least, low.abs().max(high.abs()))
}

/// A text whose z axis is put on an axis through a point, by exact numbers.
fn along(axis: usize, at: DVec3, text: &str) -> String {
    let rows =
        [["0, 0, 1", "1, 0, 0", "0, 1, 0"], ["0, 1, 0", "0, 0, 1", "1, 0, 0"], ["1, 0, 0", "0, 1, 0", "0, 0, 1"]];
    let [x, y, z] = rows[axis];
    format!("multmatrix([[{x}, {:?}], [{y}, {:?}], [{z}, {:?}], [0, 0, 0, 1]]) {{ {text} }}", at.x, at.y, at.z)
}

impl Surface {
    /// Reads a `surface` element.
    pub(super) fn read(node: Node<'_, '_>) -> Result<Self> {
        let kind = super::needed(node, "type")?;
        let words = super::value(node, "coeffs").unwrap_or_default();
        let numbers: Vec<f64> =
            words.split_whitespace().map(|w| xml::finite(node, w, "coeffs")).collect::<Result<_>>()?;
        let count = match kind.as_str() {
            "x-plane" | "y-plane" | "z-plane" => 1,
            "x-cylinder" | "y-cylinder" | "z-cylinder" => 3,
            "plane" | "sphere" | "x-cone" | "y-cone" | "z-cone" => 4,
            "x-torus" | "y-torus" | "z-torus" => 6,
            "quadric" => 10,
            other => return Err((xml::place(node), Problem::unsupported(format!("the surface {other}")))),
        };
        let wrong = |expected: String| Err(xml::wrong(node, expected, Some(&words)));
        if numbers.len() != count {
            return wrong(format!("{count} numbers as coeffs of the {kind}"));
        }
        let n = numbers.as_slice();
        let axis = usize::from(kind.as_bytes()[0].saturating_sub(b'x')).min(2);
        let point = || DVec3::new(n[0], n[1], n[2]);
        Ok(match &*kind {
            "x-plane" | "y-plane" | "z-plane" => Self::Plane { normal: DVec3::AXES[axis], offset: n[0] },
            "plane" => {
                let length = point().length();
                if !(length > 0.0 && length.is_finite()) {
                    return wrong("a normal of some length as the first coeffs of the plane".into());
                }
                Self::Plane { normal: point() / length, offset: n[3] / length }
            }
            "x-cylinder" | "y-cylinder" | "z-cylinder" | "sphere" => {
                let radius = n[count - 1];
                if radius <= 0.0 {
                    return wrong(format!("a positive radius as the last of the coeffs of the {kind}"));
                }
                if &*kind == "sphere" {
                    return Ok(Self::Sphere { center: point(), radius });
                }
                let mut center = DVec3::ZERO;
                let [i, j] = if axis == 1 { [0, 2] } else { across(axis) };
                // In the order of x, y, z.
                (center[i.min(j)], center[i.max(j)]) = (n[0], n[1]);
                Self::Cylinder { axis, center, radius }
            }
            "x-cone" | "y-cone" | "z-cone" => {
                if n[3] <= 0.0 {
                    return wrong(format!("a positive square of a slope as the last of the coeffs of the {kind}"));
                }
                Self::Cone { axis, tip: point(), slope: n[3].sqrt() }
            }
            "quadric" => {
                let [a, b, c, d, e, f, g, h, j, k]: [f64; 10] = numbers.try_into().unwrap_or_default();
                let square = DMat3::from_cols(
                    DVec3::new(a, 0.5 * d, 0.5 * f),
                    DVec3::new(0.5 * d, b, 0.5 * e),
                    DVec3::new(0.5 * f, 0.5 * e, c),
                );
                let linear = DVec3::new(g, h, j);
                if square == DMat3::ZERO {
                    let length = linear.length();
                    if !(length > 0.0 && length.is_finite()) {
                        return wrong("coeffs of the quadric of which not all but the last are 0".into());
                    }
                    return Ok(Self::Plane { normal: linear / length, offset: -k / length });
                }
                Self::Quadric { square, linear, constant: k }
            }
            _ => {
                let [major, along, out] = [n[3], n[4], n[5]];
                if major <= 0.0 || along <= 0.0 || out <= 0.0 {
                    return wrong(format!("positive radii as the last three of the coeffs of the {kind}"));
                }
                let refused = |what: &str| Err((xml::place(node), Problem::unsupported(format!("a {kind} {what}"))));
                if along != out {
                    return refused("of an elliptic section");
                }
                if out >= major {
                    return refused("that comes to its own axis");
                }
                Self::Torus { axis, center: point(), major, minor: out }
            }
        })
    }

    /// True where no point is on this side of it and on that side of another one, as is seen without a search: of planes that face each
    /// other, and of what is round about the same middle.
    pub(super) fn parts_from(&self, is_outside: bool, (other, other_outside): (&Self, bool)) -> bool {
        if let (Self::Plane { normal: m, offset: d }, Self::Plane { normal: n, offset: e }) = (self, other) {
            let signs = [is_outside, other_outside].map(|outside| if outside { -1.0 } else { 1.0 });
            return *m * signs[0] == *n * -signs[1] && d * signs[0] <= -e * signs[1];
        }
        let (inner, outer) = match (is_outside, other_outside) {
            (false, true) => (self, other),
            (true, false) => (other, self),
            _ => return false,
        };
        match (inner, outer) {
            (Self::Sphere { center: c, radius: r }, Self::Sphere { center: d, radius: s }) => c == d && r <= s,
            (Self::Cylinder { axis, center: c, radius: r }, Self::Cylinder { axis: other, center: d, radius: s }) => {
                axis == other && across(*axis).iter().all(|k| c[*k] == d[*k]) && r <= s
            }
            (Self::Cone { axis, tip: c, slope: r }, Self::Cone { axis: other, tip: d, slope: s }) => {
                axis == other && c == d && r <= s
            }
            (
                Self::Torus { axis, center: c, major: m, minor: r },
                Self::Torus { axis: other, center: d, major: n, minor: s },
            ) => axis == other && c == d && m == n && r <= s,
            (
                Self::Quadric { square: p, linear: l, constant: r },
                Self::Quadric { square: q, linear: m, constant: s },
            ) => p == q && l == m && r >= s,
            _ => false,
        }
    }

    /// Whether all points of a box are on the negative side or on the surface (`true`), or on the positive side or on it (`false`);
    /// `None` where both may be.
    pub(super) fn side(&self, block: &Aabb) -> Option<bool> {
        let (center, half) = (block.center(), block.half());
        let (low, high) = match self {
            Self::Plane { normal, offset } => {
                let (at, by) = (normal.dot(center) - offset, normal.abs().dot(half));
                (at - by, at + by)
            }
            Self::Cylinder { axis, center, radius } => {
                let [i, j] = across(*axis);
                let (near, far) = distances(block, *center, &[i, j]);
                (near - radius, far - radius)
            }
            Self::Sphere { center, radius } => {
                let (near, far) = distances(block, *center, &[0, 1, 2]);
                (near - radius, far - radius)
            }
            Self::Cone { axis, tip, slope } => {
                let [i, j] = across(*axis);
                let (near, far) = distances(block, *tip, &[i, j]);
                let (least, most) = reach(block.min[*axis] - tip[*axis], block.max[*axis] - tip[*axis]);
                (near - slope * most, far - slope * least)
            }
            Self::Torus { axis, center, major, minor } => {
                let [i, j] = across(*axis);
                let (near, far) = distances(block, *center, &[i, j]);
                let (least, most) = reach(block.min[*axis] - center[*axis], block.max[*axis] - center[*axis]);
                let (inner, outer) = reach(near - major, far - major);
                (inner.hypot(least) - minor, outer.hypot(most) - minor)
            }
            Self::Quadric { .. } => return self.side_of_quadric(block),
        };
        if high <= 0.0 {
            Some(true)
        } else if low >= 0.0 {
            Some(false)
        } else {
            None
        }
    }

    /// The same of a quadric, by bounds over ever smaller boxes.
    fn side_of_quadric(&self, block: &Aabb) -> Option<bool> {
        let Self::Quadric { square, linear, constant } = self else { return None };
        // Of one sign everywhere, but for a point at most.
        for sign in [1.0, -1.0] {
            let own = Self::Quadric { square: *square * sign, linear: *linear * sign, constant: constant * sign };
            if own.ellipsoid().is_some_and(|(_, _, level)| level <= 0.0) {
                return Some(sign < 0.0);
            }
        }
        let bend = DMat3::from_cols(square.x_axis.abs(), square.y_axis.abs(), square.z_axis.abs());
        let (mut open, mut found, mut looks) = (vec![*block], None, 0);
        while let Some(part) = open.pop() {
            let (center, half) = (part.center(), part.half());
            let at = center.dot(*square * center) + linear.dot(center) + constant;
            let by = (2.0 * (*square * center) + *linear).abs().dot(half) + half.dot(bend * half);
            let is_negative = at < 0.0;
            if at == 0.0 || found.is_some_and(|found| found != is_negative) || looks > MOST_LOOKS {
                return None;
            }
            found = Some(is_negative);
            if at.abs() < by {
                looks += 1;
                let k = half.max_position();
                let (mut low, mut high) = (part, part);
                (low.max[k], high.min[k]) = (center[k], center[k]);
                open.extend([low, high]);
            }
        }
        found
    }

    /// A box that holds what of a box, which may have no end, is on its negative side, or on its positive one.
    pub(super) fn narrow(&self, is_outside: bool, block: &Aabb) -> Aabb {
        let Self::Plane { normal, offset } = self else {
            return if is_outside { *block } else { block.intersection(&self.bounds()) };
        };
        let (normal, offset) = if is_outside { (-*normal, -offset) } else { (*normal, *offset) };
        // The least that each axis adds to n·x.
        let least = |k: usize| match normal[k] {
            0.0 => 0.0,
            n if n > 0.0 => n * block.min[k],
            n => n * block.max[k],
        };
        let mut left = *block;
        for k in (0..3).filter(|k| normal[*k] != 0.0) {
            let rest: f64 = (0..3).filter(|j| *j != k).map(least).sum();
            if rest == f64::NEG_INFINITY {
                continue;
            }
            let at = (offset - rest) / normal[k];
            // A box that is a little too large holds it just as well.
            let at =
                if normal[k].abs() == 1.0 { at } else { at + 1e-12 * at.abs().max(rest.abs()) * normal[k].signum() };
            if normal[k] > 0.0 { left.max[k] = left.max[k].min(at) } else { left.min[k] = left.min[k].max(at) }
        }
        left
    }

    /// A box that holds its negative side, without end where there is none.
    fn bounds(&self) -> Aabb {
        let mut bounds = Aabb::ALL;
        match self {
            Self::Plane { .. } => {}
            Self::Cylinder { axis, center, radius } => {
                for k in across(*axis) {
                    (bounds.min[k], bounds.max[k]) = (center[k] - radius, center[k] + radius);
                }
            }
            Self::Sphere { center, radius } => {
                bounds = Aabb { min: *center - *radius, max: *center + *radius };
            }
            Self::Torus { axis, center, major, minor } => {
                let mut half = DVec3::splat(major + minor);
                half[*axis] = *minor;
                bounds = Aabb { min: *center - half, max: *center + half };
            }
            Self::Quadric { .. } => {
                if let Some((center, half, _)) = self.ellipsoid() {
                    bounds = Aabb { min: center - half, max: center + half };
                }
            }
            Self::Cone { .. } => {}
        }
        bounds
    }

    /// The middle of an ellipsoid, half the sides of the box around it, and how far below 0 the quadric is in its middle: where it is not,
    /// there is none.
    fn ellipsoid(&self) -> Option<(DVec3, DVec3, f64)> {
        let Self::Quadric { square, linear, constant } = self else { return None };
        let minors = [
            square.x_axis.x,
            square.x_axis.x * square.y_axis.y - square.x_axis.y * square.y_axis.x,
            square.determinant(),
        ];
        let back = square.inverse();
        if !(minors.iter().all(|m| *m > 0.0) && back.is_finite()) {
            return None;
        }
        let center = back * *linear * -0.5;
        let level = center.dot(*square * center) - constant;
        let half = DVec3::from_array(std::array::from_fn(|k| (level * back.col(k)[k]).max(0.0).sqrt()));
        Some((center, half * (1.0 + 1e-9), level))
    }

    /// Where it is, along each axis along which that can be said: an interval of no length is a place.
    pub(super) fn extent(&self) -> [Option<(f64, f64)>; 3] {
        let around = |center: DVec3, half: DVec3| {
            std::array::from_fn(|k| half[k].is_finite().then(|| (center[k] - half[k], center[k] + half[k])))
        };
        match self {
            Self::Plane { normal, offset } => match (0..3).find(|k| normal[*k].abs() == 1.0) {
                Some(k) => {
                    let mut of = [None; 3];
                    of[k] = Some((offset * normal[k], offset * normal[k]));
                    of
                }
                None => around(*normal * *offset, DVec3::ZERO),
            },
            Self::Cylinder { axis, center, radius } => {
                let mut half = DVec3::splat(*radius);
                half[*axis] = f64::INFINITY;
                around(*center, half)
            }
            Self::Cone { tip, .. } => around(*tip, DVec3::ZERO),
            Self::Quadric { square, linear, constant } => match self.ellipsoid() {
                Some((center, half, _)) => around(center, half),
                None => {
                    // A rough size: where its terms are as large as each other.
                    let most = square.to_cols_array().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
                    let by = (constant.abs() / most).sqrt().max(linear.abs().max_element() / most);
                    around(DVec3::ZERO, DVec3::splat(by))
                }
            },
            Self::Sphere { .. } | Self::Torus { .. } => {
                let bounds = self.bounds();
                around(bounds.center(), bounds.half())
            }
        }
    }

    /// Its negative side within a box and somewhat beyond, a flattened OpenSCAD text; for a plane also the positive one.
    pub(super) fn text(&self, is_outside: bool, block: &Aabb) -> String {
        let far = block.grown(ROOM * block.half().length());
        match self {
            Self::Plane { normal, offset } => {
                let sign = if is_outside { -1.0 } else { 1.0 };
                format!("half_space(normal = {:?}, offset = {:?});", (*normal * sign).to_array(), offset * sign)
            }
            Self::Cylinder { axis, center, radius } => {
                let mut at = *center;
                at[*axis] = far.center()[*axis];
                let h = 2.0 * far.half()[*axis];
                let text = format!("cylinder($fn = 0, h = {h:?}, r1 = {radius:?}, r2 = {radius:?}, center = true);");
                along(*axis, at, &text)
            }
            Self::Sphere { center, radius } => placed(&Pose::at(*center), &format!("sphere($fn = 0, r = {radius:?});")),
            Self::Cone { axis, tip, slope } => {
                let mut cones = Vec::new();
                for (sign, h) in [(1.0, far.max[*axis] - tip[*axis]), (-1.0, tip[*axis] - far.min[*axis])] {
                    if h > 0.0 {
                        let [low, high] = if sign > 0.0 { [0.0, slope * h] } else { [slope * h, 0.0] };
                        let mut at = *tip;
                        at[*axis] += 0.5 * sign * h;
                        // The tip itself is told to the bit.
                        let text = format!("cylinder($fn = 0, h = {h:?}, r1 = {low:?}, r2 = {high:?}, center = true);");
                        cones.push(along(*axis, at, &text));
                    }
                }
                format!("union() {{ {} }}", cones.join(" "))
            }
            Self::Torus { axis, center, major, minor } => {
                let ring = placed(&Pose::at(DVec3::X * *major), &format!("circle($fn = 0, r = {minor:?});"));
                let text = format!("rotate_extrude(angle = 360, $fn = 0) {{ {ring} }}");
                along(*axis, *center, &text)
            }
            Self::Quadric { square, linear, constant } => {
                // About the middle of the box: less is lost to rounding there.
                let c = far.center();
                let (half, k) = (*square * c + *linear * 0.5, c.dot(*square * c) + linear.dot(c) + constant);
                let row = |r: usize| {
                    let v = square.col(r);
                    format!("[{:?}, {:?}, {:?}, {:?}]", v.x, v.y, v.z, half[r])
                };
                let [low, high] = [far.min - c, far.max - c].map(|v| v.to_array());
                let last = format!("[{:?}, {:?}, {:?}, {k:?}]", half.x, half.y, half.z);
                let m = format!("[{}, {}, {}, {last}]", row(0), row(1), row(2));
                placed(&Pose::at(c), &format!("quadric(m = {m}, min = {low:?}, max = {high:?});"))
            }
        }
    }

    /// Is it one whose positive side is told by what is left of a box?
    pub(super) fn is_plane(&self) -> bool {
        matches!(self, Self::Plane { .. })
    }
}

/// Least and largest distance of a box's points from a point, along some axes.
fn distances(block: &Aabb, from: DVec3, axes: &[usize]) -> (f64, f64) {
    let squares = axes.iter().map(|k| {
        let (least, most) = reach(block.min[*k] - from[*k], block.max[*k] - from[*k]);
        (least * least, most * most)
    });
    let (near, far) = squares.fold((0.0, 0.0), |(a, b), (p, q)| (a + p, b + q));
    (near.sqrt(), far.sqrt())
}
