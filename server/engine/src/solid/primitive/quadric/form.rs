//! What quadric an inequality of degree two is, and the faces that it is made of.
//!
//! Along its principal axes xᵀQx + 2p·x + q <= 0 is Σ λ_k v_k² + e <= 0, with a linear term where a λ is 0. The signs say which (every
//! textbook's table, as D. Brannan, M. Esplen, J. Gray, Geometry, 1.3): one convex piece, two of them (the sheets of a hyperboloid, the
//! nappes of a cone, the branches of a cylinder), one saddle, or all but such.
//!
//! Numbers that are 0 but for rounding are taken for it: `ZERO` of the largest over the box that the solid is cut by.

use crate::math::Aabb;
use crate::solid::Face;
use crate::solid::surface::elliptic::principal;
use crate::solid::surface::{Bowl, Elliptic, Saddle};
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// What counts as 0 beside the largest coefficient over the box.
const ZERO: f64 = 1e-13;
/// How many sizes of its box off a centre may lie: what is computed from it loses as many digits.
const FAR: f64 = 1e3;

/// xᵀQx + 2p·x + q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// Q, symmetric.
    pub square: DMat3,
    /// p.
    pub linear: DVec3,
    /// q.
    pub constant: f64,
}

/// The points of an inequality: those in any of some faces' insides, or in none.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadrics {
    /// One or two.
    pub sides: Vec<Face>,
    /// All but these.
    pub outside: bool,
}

/// Why an inequality is not a quadric's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoQuadric {
    /// It is one of planes, or holds for all or no points.
    Planes,
    /// Its centre is too far off its box for the digits of a double.
    Far,
}

impl Form {
    /// Of a symmetric 4×4 matrix M: [x, 1] M [x, 1]ᵀ.
    pub fn of_matrix(m: &[[f64; 4]; 4]) -> Self {
        let row = |k: usize| DVec3::new(m[k][0], m[k][1], m[k][2]);
        Self { square: DMat3::from_cols(row(0), row(1), row(2)), linear: row(3), constant: m[3][3] }
    }

    /// Its value at a point.
    pub fn value(&self, x: DVec3) -> f64 {
        x.dot(self.square * x) + 2.0 * self.linear.dot(x) + self.constant
    }

    /// The same form of the points that an affine map has moved.
    pub fn mapped(&self, map: &DAffine3) -> Self {
        let back = map.inverse();
        let (m, t) = (back.matrix3, back.translation);
        Self {
            square: m.transpose() * self.square * m,
            linear: m.transpose() * (self.square * t + self.linear),
            constant: self.value(t),
        }
    }

    /// What it is, cut by a box.
    ///
    /// # Errors
    /// It is no quadric, or one that its numbers do not tell.
    pub fn quadrics(&self, around: &Aabb) -> Result<Quadrics, NoQuadric> {
        let (center, size) = (around.center(), around.half().length());
        // Along the axes from the middle of the box, in its half diagonals.
        let (axes, squares) = principal(self.square);
        let terms = squares * (size * size);
        let linear = axes.transpose() * (self.square * center + self.linear) * size;
        let constant = self.value(center);
        let largest = terms.abs().max_element().max(2.0 * linear.abs().max_element()).max(constant.abs());
        if !(largest.is_finite() && largest > 0.0) {
            return Err(NoQuadric::Planes);
        }
        let kept = |v: f64| if v.abs() <= ZERO * largest { 0.0 } else { v / largest };
        let terms = DVec3::from_array(terms.to_array().map(kept));
        let linear = DVec3::from_array(linear.to_array().map(kept));
        let mut plain = Plain { axes, terms, linear, constant: kept(constant), center, size };
        let count = |sign: f64| plain.terms.to_array().iter().filter(|v| **v * sign > 0.0).count();
        let outside = count(-1.0) > count(1.0);
        if outside {
            plain = plain.negated();
        }
        plain.sides().map(|sides| Quadrics { sides, outside })
    }
}

/// Σ t_k u_k² + 2 l·u + e <= 0 along the columns of a rotation, x = center + size · axes u.
#[derive(Clone, Copy, Debug)]
struct Plain {
    axes: DMat3,
    terms: DVec3,
    linear: DVec3,
    constant: f64,
    center: DVec3,
    size: f64,
}

impl Plain {
    fn negated(self) -> Self {
        Self { terms: -self.terms, linear: -self.linear, constant: -self.constant, ..self }
    }

    /// Axes in the order of a permutation, the last one turned over where it is to look the other way; right-handed.
    fn frame(&self, order: [usize; 3], sign: f64) -> DMat3 {
        let (x, z) = (self.axes.col(order[0]), self.axes.col(order[2]) * sign);
        DMat3::from_cols(x, z.cross(x), z)
    }

    fn point(&self, u: DVec3) -> DVec3 {
        self.center + self.axes * u * self.size
    }

    /// The axes in the order of their terms, the largest first.
    fn order(&self) -> [usize; 3] {
        let mut order = [0, 1, 2];
        order.sort_by(|i, j| self.terms[*j].total_cmp(&self.terms[*i]));
        order
    }

    /// The point next to which the form has no linear terms but along axes without a square, and its value there.
    fn middle(&self) -> (DVec3, f64) {
        let (mut u, mut e) = (DVec3::ZERO, self.constant);
        for k in 0..3 {
            if self.terms[k] != 0.0 {
                u[k] = -self.linear[k] / self.terms[k];
                e += self.linear[k] * u[k];
            }
        }
        (u, if e.abs() <= ZERO { 0.0 } else { e })
    }

    fn sides(&self) -> Result<Vec<Face>, NoQuadric> {
        let order = self.order();
        let [a, b, c] = order.map(|k| self.terms[k]);
        let (u, e) = self.middle();
        // Along axes without a square: a paraboloid where anything changes, else straight.
        let free: Vec<usize> = order.into_iter().filter(|k| self.terms[*k] == 0.0).collect();
        let slopes = free.iter().map(|k| self.linear[*k].abs()).fold(0.0, f64::max);
        let near = u.abs().max_element() <= FAR;
        match (a > 0.0, b, c) {
            (false, ..) => Err(NoQuadric::Planes),
            (true, b, c) if b > 0.0 && c > 0.0 => self.ellipsoid(order, u, e),
            (true, b, c) if b > 0.0 && c == 0.0 => {
                if slopes > 0.0 {
                    return Ok(vec![self.paraboloid(order, [a, b], u)]);
                }
                let [n, m] = [(0, a), (1, b)].map(|(k, t)| self.axes.col(order[k]) * ((t / -e).sqrt() / self.size));
                if e >= 0.0 {
                    Err(NoQuadric::Planes)
                } else {
                    Ok(vec![Elliptic::cylinder(self.point(u), [n, m]).into()])
                }
            }
            (true, b, c) if b > 0.0 && c < 0.0 => {
                if e > 0.0 {
                    return Ok(self.sheets(order, [a, b, -c]));
                }
                if !near {
                    return Err(NoQuadric::Far);
                }
                if e == 0.0 {
                    let [n, m, h] =
                        [(0, a), (1, b), (2, -c)].map(|(k, t)| self.axes.col(order[k]) * (t.sqrt() / self.size));
                    return Ok([1.0, -1.0].map(|s| Elliptic::cone(self.point(u), [n, m], h * s).into()).to_vec());
                }
                let semi = DVec3::new(a, b, -c).map(|t| (-e / t).sqrt() * self.size);
                Ok(vec![Saddle::hyperboloid(self.point(u), self.frame(order, 1.0), semi).into()])
            }
            (true, b, c) if b == 0.0 && c == 0.0 => {
                if slopes > 0.0 {
                    Ok(vec![self.trough(order, a, u)])
                } else {
                    Err(NoQuadric::Planes)
                }
            }
            // One positive, one negative; the one that is left lies in the middle.
            (true, _, c) => {
                let [x, z] = [order[0], order[2]];
                if slopes > 0.0 {
                    return Ok(vec![self.saddle([x, z, order[1]], [a, -c], u)]);
                }
                if e > 0.0 {
                    return Ok(self.sheets([x, order[1], z], [a, 0.0, -c]));
                }
                if e == 0.0 {
                    return Err(NoQuadric::Planes);
                }
                if !near {
                    return Err(NoQuadric::Far);
                }
                let semi = DVec3::new((-e / a).sqrt() * self.size, f64::INFINITY, (-e / -c).sqrt() * self.size);
                Ok(vec![Saddle::hyperboloid(self.point(u), self.frame([x, order[1], z], 1.0), semi).into()])
            }
        }
    }

    /// What is cut lies within about a box: the focus need lie no deeper.
    fn bowl(&self, vertex: DVec3, frame: DMat3, bends: [f64; 2], rest: [f64; 2]) -> Face {
        // From half diagonals to lengths: squares by their square, g by one of them.
        let per = 1.0 / self.size;
        let [kappa, g] = rest;
        Bowl::new(
            self.point(vertex),
            frame,
            DVec2::from_array(bends) * (per * per),
            [kappa * per * per, g * per],
            self.size,
        )
        .into()
    }

    fn ellipsoid(&self, order: [usize; 3], u: DVec3, e: f64) -> Result<Vec<Face>, NoQuadric> {
        let [a, b, c] = order.map(|k| self.terms[k]);
        if e >= 0.0 {
            return Err(NoQuadric::Planes);
        }
        let last = order[2];
        if u.abs().max_element() <= FAR {
            let semi = DVec3::from_array([0, 1, 2].map(|k| (-e / self.terms[k]).sqrt() * self.size));
            return Ok(vec![Elliptic::ellipsoid(self.point(u), self.axes, semi).into()]);
        }
        // A long one, of which an end is near: from there.
        if (u[order[0]].abs()).max(u[order[1]].abs()) > FAR {
            return Err(NoQuadric::Far);
        }
        let (rest, l) = (self.rest(last, u), self.linear[last]);
        let sign = -l.signum();
        let root = (l * l - c * rest).sqrt();
        let vertex =
            DVec3::from_array([0, 1, 2].map(|k| if k == last { -rest / (l + root.copysign(l)) } else { u[k] }));
        Ok(vec![self.bowl(vertex, self.frame(order, sign), [a, b], [-c, root])])
    }

    fn paraboloid(&self, order: [usize; 3], bends: [f64; 2], u: DVec3) -> Face {
        let last = order[2];
        let l = self.linear[last];
        let mut vertex = u;
        vertex[last] = -self.rest(last, u) / (2.0 * l);
        self.bowl(vertex, self.frame(order, -l.signum()), bends, [0.0, l.abs()])
    }

    /// A parabolic cylinder: the linear terms along both other axes are one.
    fn trough(&self, order: [usize; 3], bend: f64, u: DVec3) -> Face {
        let [x, y, z] = order;
        let slope = DVec2::new(self.linear[y], self.linear[z]);
        let l = slope.length();
        let into = -(self.axes.col(y) * slope.x + self.axes.col(z) * slope.y) / l;
        let side = self.axes.col(x);
        let frame = DMat3::from_cols(side, into.cross(side), into);
        let e = self.constant + self.linear[x] * u[x];
        let mut vertex = DVec3::ZERO;
        vertex[x] = u[x];
        vertex[y] = -e * slope.x / (2.0 * l * l);
        vertex[z] = -e * slope.y / (2.0 * l * l);
        self.bowl(vertex, frame, [bend, 0.0], [0.0, l])
    }

    fn saddle(&self, order: [usize; 3], [a, b]: [f64; 2], u: DVec3) -> Face {
        let last = order[2];
        let l = self.linear[last];
        let mut point = u;
        point[last] = -self.rest(last, u) / (2.0 * l);
        let bends = DVec2::new(a, b) / (2.0 * l.abs() * self.size);
        Saddle::paraboloid(self.point(point), self.frame(order, -l.signum()), bends, self.size).into()
    }

    /// The constant at a point that has none of its `last` coordinate.
    fn rest(&self, last: usize, u: DVec3) -> f64 {
        (0..3).filter(|k| *k != last).fold(self.constant, |e, k| e + self.linear[k] * u[k])
    }

    /// Both sheets of a hyperboloid, or branches of a hyperbolic cylinder.
    fn sheets(&self, order: [usize; 3], [a, b, c]: [f64; 3]) -> Vec<Face> {
        let last = order[2];
        let (mut u, _) = self.middle();
        let (l, e) = (self.linear[last], self.rest(last, u));
        // −c v² + 2 l v + e = 0 at both vertices.
        let root = (l * l + c * e).max(0.0).sqrt();
        let far = l + root.copysign(l);
        let roots = [far / c, -e / far];
        let up = if roots[0] > roots[1] { roots } else { [roots[1], roots[0]] };
        [(up[0], 1.0), (up[1], -1.0)]
            .map(|(at, sign)| {
                u[last] = at;
                self.bowl(u, self.frame(order, sign), [a, b], [c, root])
            })
            .to_vec()
    }
}
