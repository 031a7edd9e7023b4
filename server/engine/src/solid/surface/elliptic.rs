//! Elliptic faces, the affine images of a sphere, a cylinder or a cone: psi = |B(x − o)| − w·(x − o) − r.
//!
//! With x = o + A u a face psi₀ of u is psi₀(A⁻¹(x − o)) of x. That grows by up to ‖A⁻¹‖ as fast as a distance, so psi is it over
//! that norm: where A's principal axes are e₁, e₂, e₃ and their semi-axes a₁ <= a₂ <= a₃, B has the rows s_k e_k with s_k = a₁/a_k.
//!
//! | image of a | s | w | r |
//! |---|---|---|---|
//! | sphere | 1, a₁/a₂, a₁/a₃ | 0 | a₁ |
//! | cylinder | 1, a₁/a₂, 0 | 0 | a₁ |
//! | cone | cos α, s₂, 0 | sin α e₃ | 0 |
//!
//! A cone's α is its half angle where it is narrowest, s₂/sin α the tangent of the complement of the other one. Any cone over an
//! ellipse, however it leans, has such axes: those of the form that is 0 on it (S. Lang, Linear Algebra, on quadratic forms).
//!
//! The gradient Bᵀn − w, n = B(x − o)/|B(x − o)|, is no unit vector: it is as long as 1 where the face is as steep as the
//! distance, and as short as a₁/a₃ elsewhere (of a cone longer). So psi is 1-Lipschitz, convex, and a lower bound of the distance
//! that is at most a₃/a₁ times too small. All s and w are a hair smaller than that (`WHOLE`): 1-Lipschitz for certain.

use super::roots::{between_roots, between_roots_of_nappe};
use super::{
    Analytic, Apex, Axis, Bend, Curvature, FaceAt, Law, NUMBERS, Stretches, Surface, Symmetry, Terms, largest_corner,
    tangent,
};
use crate::math::any_perpendicular;
use glam::{DMat3, DQuat, DVec3};

/// The affine image of a sphere, an infinite cylinder or an infinite single-napped cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elliptic {
    /// Centre, a point of the axis, or the apex.
    pub origin: DVec3,
    /// The rotation to its principal axes: the unit axis of rotation times the tangent of a quarter of the angle (modified Rodrigues
    /// parameters: M. Shuster, A survey of attitude representations, 1993), at most 1 long.
    pub turn: DVec3,
    /// r of the image of a sphere or cylinder; of a cone's s₁.
    pub size: f64,
    /// s₂.
    pub second: f64,
    /// s₃ of the image of a sphere or cylinder; of a cone's −|w|.
    pub third: f64,
}

/// What psi = |B(x − o)| − w·(x − o) − r is made of. These numbers are the face; `Elliptic` keeps them in fewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Rows of B, square to each other; per length 1 at most.
    pub rows: [DVec3; 3],
    /// w; zero but for a cone.
    pub fall: DVec3,
    /// r, a length.
    pub radius: f64,
}

/// What stands for 1: the rows that `stretch` makes of a rotation are those of one to 30 half units in the last place.
pub(super) const WHOLE: f64 = 1.0 - 32.0 * f64::EPSILON;

/// Where a point stands: the length of B(x − o), the unit vector along it, and psi.
pub(super) struct Seen {
    stretch: Stretch,
    length: f64,
    along: DVec3,
    value: f64,
}

impl Seen {
    pub(super) fn at(&self) -> FaceAt {
        let normal = self.stretch.back(self.along) - self.stretch.fall;
        FaceAt { value: self.value, normal, slope: normal.length(), k: 1.0, rho: self.length }
    }

    /// Bᵀt for the unit vectors t square to B(x − o).
    fn beside(&self) -> [DVec3; 2] {
        self.stretch.beside(self.along).map(|t| self.stretch.back(t))
    }

    /// Bᵀ(I − n nᵀ)B/|B(x − o)|.
    pub(super) fn curvature(&self) -> Curvature {
        let [one, other] = self.beside();
        Curvature {
            each: 0.0,
            factor: one.length_squared() / self.length,
            along: one.normalize_or_zero(),
            other: other.length_squared() / self.length,
            beside: other.normalize_or_zero(),
        }
    }

    pub(super) fn bend(&self, law: Law) -> Bend {
        let radial = (self.length, self.stretch.back(self.along));
        Bend { law, radial, tangents: self.beside(), core: f64::INFINITY }
    }
}

impl Stretch {
    #[inline]
    pub(super) fn of(&self, y: DVec3) -> DVec3 {
        let [a, b, c] = self.rows;
        DVec3::new(a.dot(y), b.dot(y), c.dot(y))
    }

    /// Where a point stands, y = x − o.
    #[inline]
    pub(super) fn seen(self, y: DVec3) -> Seen {
        let v = self.of(y);
        let length = v.length();
        // Any unit vector gives a tangent in the middle, as far off as what rounding has left of v.
        let along = if length > 0.0 { v / length } else { DVec3::X };
        Seen { stretch: self, length, along, value: length - self.fall.dot(y) - self.radius }
    }

    /// Bᵀv.
    #[inline]
    pub fn back(&self, v: DVec3) -> DVec3 {
        let [a, b, c] = self.rows;
        a * v.x + b * v.y + c * v.z
    }

    /// n of a gradient Bᵀn − w, or where B has two rows or w is zero of a multiple of one that is not a cone's: a unit vector.
    pub fn along(&self, gradient: DVec3) -> DVec3 {
        // A third row lies along w.
        let gradient = if self.rows[2] == DVec3::ZERO { gradient } else { gradient + self.fall };
        let part = |row: DVec3| if row == DVec3::ZERO { 0.0 } else { row.dot(gradient) / row.length_squared() };
        let v = DVec3::from_array(self.rows.map(part));
        v.try_normalize().unwrap_or(DVec3::X)
    }

    /// Unit vectors square to `along` that B reaches: one, and zero, where it has two rows.
    pub fn beside(&self, along: DVec3) -> [DVec3; 2] {
        if self.rows[2] == DVec3::ZERO {
            return [DVec3::new(-along.y, along.x, 0.0), DVec3::ZERO];
        }
        let t = any_perpendicular(along);
        [t, along.cross(t)]
    }

    /// Lower bound of psi less that of `q` over the ball of radius r around c, and the size of the numbers at hand:
    /// r_q − r_p + w_p·Δ − |B_p Δ| − |x − o_q| (|B_p − B_q| + |w_p − w_q|), rows turned so that they point the same way; Δ = o_p − o_q.
    pub(super) fn above(&self, o: DVec3, (q, u): (&Self, DVec3), c: DVec3, r: f64) -> (f64, f64) {
        let off = |a: DVec3, b: DVec3| (a - if a.dot(b) < 0.0 { -b } else { b }).length();
        let lean = (0..3).map(|k| off(self.rows[k], q.rows[k])).sum::<f64>() + (self.fall - q.fall).length();
        let far = (c - u).length() + r;
        let tilt = if lean == 0.0 { 0.0 } else { lean * far };
        let delta = o - u;
        let size = o.length() + u.length() + self.radius + q.radius + 2.0 * (far + c.length());
        (q.radius - self.radius + self.fall.dot(delta) - self.of(delta).length() - tilt, size)
    }

    /// Where |B o + t B d| <= r + w·(o + t d).
    pub(super) fn crossed(&self, o: DVec3, d: DVec3) -> Option<(f64, f64)> {
        let (p, e) = (self.of(o), self.of(d));
        let (h, k) = (self.radius + self.fall.dot(o), self.fall.dot(d));
        let (a, b, c) = (e.length_squared() - k * k, p.dot(e) - h * k, p.length_squared() - h * h);
        if self.fall == DVec3::ZERO {
            if a < 1e-24 {
                return (c <= 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY));
            }
            return between_roots(a, b, c);
        }
        // As of a circular cone, which it is in these coordinates; of what has a focus likewise, whose other sheet is the other nappe.
        between_roots_of_nappe([a, b, c], 1e-14 * (e.length_squared() + k * k), (h, k))
    }
}

impl Elliptic {
    /// The image of a sphere around `origin`, with the semi-axes `semi` (lengths) along the columns of a rotation.
    pub fn ellipsoid(origin: DVec3, axes: DMat3, semi: DVec3) -> Self {
        let mut order = [0, 1, 2];
        order.sort_by(|i, j| semi[*i].total_cmp(&semi[*j]));
        let [a, b, c] = order.map(|k| semi[k]);
        let [x, y, _] = order.map(|k| axes.col(k));
        let turn = turn_of(x, y);
        Self { origin, turn, size: a * WHOLE, second: a / b * WHOLE, third: a / c * WHOLE }
    }

    /// The image of a cylinder: |n₁·(x − o)|² + |n₂·(x − o)|² <= 1 with the vectors n (per length), which are not parallel.
    pub fn cylinder(origin: DVec3, [n, m]: [DVec3; 2]) -> Self {
        let [n, m] = squared([n, m]);
        let (p, q) = (n.length(), m.length());
        Self { origin, turn: turn_of(n / p, m / q), size: WHOLE / p, second: q / p * WHOLE, third: 0.0 }
    }

    /// The image of a cone: |n₁·(x − o)|² + |n₂·(x − o)|² <= |h·(x − o)|² where h·(x − o) >= 0, for three vectors of any length.
    pub fn cone(apex: DVec3, [n, m]: [DVec3; 2], h: DVec3) -> Self {
        // The three principal axes of the form; of a right cone they are its own.
        let is_right = n.dot(m) == 0.0 && n.dot(h) == 0.0 && m.dot(h) == 0.0;
        let (mut axes, squares) = if is_right {
            let steep = DVec3::new(n.length_squared(), m.length_squared(), -h.length_squared());
            (DMat3::from_cols(n.normalize(), m.normalize(), h.normalize()), steep)
        } else {
            principal(outer(n) + outer(m) - outer(h))
        };
        let mut order = [0, 1, 2];
        order.sort_by(|i, j| squares[*j].total_cmp(&squares[*i]));
        let [p, q, _] = order.map(|k| squares[k]);
        axes = DMat3::from_cols(axes.col(order[0]), axes.col(order[1]), axes.col(order[2]));
        // The product of all three, which keeps the digits of a small one, is known.
        let volume = n.cross(m).dot(h);
        let low = volume * volume / (p * q);
        let middle = axes.z_axis * axes.z_axis.dot(h).signum();
        let all = (p + low).sqrt();
        let y = middle.cross(axes.x_axis);
        let turn = turn_of(axes.x_axis, y);
        let [first, second, down] = [p, q, low].map(|v| v.sqrt() / all * WHOLE);
        Self { origin: apex, turn, size: first, second, third: -down }
    }

    /// True of the image of a cone.
    #[inline]
    pub fn is_cone(&self) -> bool {
        self.third < 0.0
    }

    /// True of the image of a cylinder.
    #[inline]
    pub fn is_cylinder(&self) -> bool {
        self.third == 0.0
    }

    /// Its principal axes: the rotation that `turn` tells.
    #[inline]
    pub fn axes(&self) -> DMat3 {
        axes_of(self.turn)
    }

    /// What psi is made of.
    #[inline]
    pub fn parts(&self) -> Stretch {
        let axes = self.axes();
        let (x, y, z) = (axes.x_axis, axes.y_axis, axes.z_axis);
        if self.is_cone() {
            return Stretch { rows: [x * self.size, y * self.second, DVec3::ZERO], fall: z * -self.third, radius: 0.0 };
        }
        Stretch { rows: [x * WHOLE, y * self.second, z * self.third], fall: DVec3::ZERO, radius: self.size }
    }

    /// The direction of the axis of a cylinder or, into it, of a cone; a unit vector.
    pub fn axis(&self) -> DVec3 {
        self.axes().z_axis
    }

    #[inline]
    fn seen(&self, x: DVec3) -> Seen {
        self.parts().seen(x - self.origin)
    }

    /// The point of an image of a sphere, or of the cross-section of one of a cylinder, at which the gradient lies along Bᵀn: from
    /// the origin.
    fn rim(&self, along: DVec3) -> DVec3 {
        let axes = self.axes();
        let scale = DVec3::new(WHOLE, self.second, self.third);
        let at = |k: usize| if scale[k] > 0.0 { self.size * along[k] / scale[k] } else { 0.0 };
        axes * DVec3::new(at(0), at(1), at(2))
    }

    /// The line along which an image of a cylinder or cone has the unit normal `normal`, or the one next to it: a point of it, its
    /// direction, and the sine by which the normal leans against it.
    pub fn ruling(&self, normal: DVec3) -> Option<(DVec3, DVec3, f64)> {
        let axis = self.axis();
        let along = self.parts().along(normal);
        if self.is_cylinder() {
            return Some((self.origin + self.rim(along), axis, normal.dot(axis)));
        }
        let across = self.axes() * DVec3::new(along.x / self.size, along.y / self.second, 0.0);
        let direction = (axis + across * -self.third).normalize();
        self.is_cone().then(|| (self.origin, direction, normal.dot(direction)))
    }
}

/// The rotation that is told by the unit axis times the tangent of a quarter of the angle.
#[inline]
pub(super) fn axes_of(p: DVec3) -> DMat3 {
    let s = p.length_squared();
    let d = 1.0 / ((1.0 + s) * (1.0 + s));
    let (k, m) = (8.0 * d, 4.0 * (1.0 - s) * d);
    let (xx, yy, zz) = (k * p.x * p.x, k * p.y * p.y, k * p.z * p.z);
    let (xy, xz, yz) = (k * p.x * p.y, k * p.x * p.z, k * p.y * p.z);
    let t = p * m;
    DMat3::from_cols(
        DVec3::new(1.0 - (yy + zz), xy + t.z, xz - t.y),
        DVec3::new(xy - t.z, 1.0 - (xx + zz), yz + t.x),
        DVec3::new(xz + t.y, yz - t.x, 1.0 - (xx + yy)),
    )
}

/// A rotation by the images of x and y, unit vectors square to each other to rounding.
pub(super) fn turn_of(x: DVec3, y: DVec3) -> DVec3 {
    let z = x.cross(y).normalize();
    let q = DQuat::from_mat3(&DMat3::from_cols(x, z.cross(x), z)).normalize();
    let q = if q.w < 0.0 { -q } else { q };
    DVec3::new(q.x, q.y, q.z) / (1.0 + q.w)
}

/// The rotation of principal axes that are moved along with their face, by what moves a direction.
pub(super) fn moved_turn(axes: DMat3, vector: impl Fn(DVec3) -> DVec3) -> DVec3 {
    turn_of(vector(axes.x_axis).normalize(), vector(axes.y_axis).normalize())
}

fn outer(v: DVec3) -> DMat3 {
    super::outer(v, v)
}

/// Two vectors turned in their plane until they are square to each other, the longer one first; the sum of their outer products
/// stays. (One step of M. Hestenes, Inversion of matrices by biorthogonalization, 1958.)
pub fn squared([n, m]: [DVec3; 2]) -> [DVec3; 2] {
    let (mut n, mut m) = (n, m);
    // Rounding leaves a little of long ones along each other: twice.
    for _ in 0..3 {
        let half = 0.5 * libm::atan2(2.0 * n.dot(m), (n - m).dot(n + m));
        let (s, c) = libm::sincos(half);
        if n.dot(m) == 0.0 {
            break;
        }
        (n, m) = (n * c + m * s, m * c - n * s);
    }
    if n.length_squared() >= m.length_squared() { [n, m] } else { [m, n] }
}

/// The principal axes of a symmetric form and its values along them (C. Jacobi, 1846; G. Golub, C. Van Loan, Matrix Computations,
/// 8.5).
pub fn principal(form: DMat3) -> (DMat3, DVec3) {
    let mut a = form.to_cols_array_2d();
    let mut axes = DMat3::IDENTITY;
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let half = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = 1.0f64.copysign(half) / (half.abs() + half.hypot(1.0));
            let c = 1.0 / t.hypot(1.0);
            let s = t * c;
            let mut turn = DMat3::IDENTITY.to_cols_array_2d();
            (turn[p][p], turn[q][q], turn[p][q], turn[q][p]) = (c, c, -s, s);
            let turn = DMat3::from_cols_array_2d(&turn);
            a = (turn.transpose() * DMat3::from_cols_array_2d(&a) * turn).to_cols_array_2d();
            (a[p][q], a[q][p]) = (0.0, 0.0);
            axes *= turn;
        }
    }
    (axes, DVec3::new(a[0][0], a[1][1], a[2][2]))
}

impl Surface for Elliptic {
    #[inline]
    fn reach(&self) -> f64 {
        self.origin.length() + if self.is_cone() { 0.0 } else { self.size }
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.origin.abs().max_element() + if self.is_cone() { 0.0 } else { self.size }
    }

    fn value(&self, x: DVec3) -> f64 {
        let (stretch, y) = (self.parts(), x - self.origin);
        let length = stretch.of(y).length();
        if self.is_cone() { length - stretch.fall.dot(y) } else { length - stretch.radius }
    }

    fn at(&self, x: DVec3) -> FaceAt {
        self.seen(x).at()
    }

    fn curvature(&self, x: DVec3, _: &FaceAt) -> Curvature {
        self.seen(x).curvature()
    }

    #[inline]
    fn stretch(&self) -> Option<Stretch> {
        Some(self.parts())
    }

    /// Below, the largest of the tangent, what B's rows reach over the box, and the axis of a cone; above, the largest value of a
    /// corner.
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        let (stretch, y) = (self.parts(), center - self.origin);
        let extent = DVec3::from_array(stretch.rows.map(|row| row.abs().dot(half)));
        let nearest = (stretch.of(y).abs() - extent).max(DVec3::ZERO).length();
        let fall = stretch.fall.dot(y) + stretch.fall.abs().dot(half);
        (tangent(self, center, half).max(nearest - fall - stretch.radius), largest_corner(self, center, half))
    }

    /// In the coordinates B(x − o) it is a sphere's, a cylinder's or a cone's of the half angle whose cosine and sine are 1.
    fn bend(&self, x: DVec3, _: &FaceAt) -> Bend {
        self.seen(x).bend(if self.is_cone() { Law::Conical { cos: 1.0 } } else { Law::Round { radius: self.size } })
    }

    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { origin: point(self.origin), turn: moved_turn(self.axes(), vector), ..*self }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::None
    }

    #[inline]
    fn apex(&self) -> Option<Apex> {
        let stretch = self.parts();
        self.is_cone().then(|| Apex {
            point: self.origin,
            axis: self.axis(),
            sin: -self.third,
            cos: self.size,
            rows: Some([stretch.rows[0], stretch.rows[1]]),
        })
    }

    /// Its axis; of an ellipsoid the diameter through the middles of all these ellipses, to where the plane touches it.
    fn skewer(&self, normal: DVec3) -> Option<Axis> {
        let along = if self.third > 0.0 { self.rim(self.parts().along(normal)) } else { self.axis() };
        Some(Axis { origin: self.origin, direction: along.normalize() })
    }

    #[inline]
    fn slides_along(&self, d: DVec3, tolerance: f64) -> bool {
        self.is_cylinder() && d.cross(self.axis()).length() < tolerance
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<super::Section> {
        None
    }

    fn foot(&self, point: DVec3, normal: DVec3, size: f64) -> DVec3 {
        let along = self.parts().along(normal);
        let (o, axis) = (point - self.origin, self.axis());
        if self.is_cone() {
            let far = o.length().max(size);
            return self.ruling(normal).map_or(self.origin, |(apex, direction, _)| apex + direction * far);
        }
        let slid = if self.is_cylinder() { axis * o.dot(axis) } else { DVec3::ZERO };
        self.origin + slid + self.rim(along)
    }

    /// Of cylinders between the points of the axes next to c.
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64) {
        if self.is_cone() != q.is_cone() || self.is_cylinder() != q.is_cylinder() {
            return (f64::NEG_INFINITY, 0.0);
        }
        let foot = |face: &Self| {
            let slid = face.axis() * (c - face.origin).dot(face.axis());
            if face.is_cylinder() { face.origin + slid } else { face.origin }
        };
        self.parts().above(foot(self), (&q.parts(), foot(q)), c, r)
    }

    /// What psi is off there, as a distance where it is flattest.
    fn deviation(&self, other: &Self, size: f64) -> f64 {
        let (least, _) = self.above(other, self.origin, size);
        let (most, _) = other.above(self, self.origin, size);
        let flattest = if self.third > 0.0 { self.third } else { self.second };
        (-least).max(-most).max(0.0) / flattest
    }

    /// What psi is in the middle of the ball.
    #[inline]
    fn key(&self, c: DVec3, _: f64) -> f64 {
        self.value(c)
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let (o, t) = (self.origin, self.turn);
        [o.x, o.y, o.z, t.x, t.y, t.z, self.size, self.second, self.third, 0.0, 0.0]
    }

    #[inline]
    fn analytic(&self) -> Option<Analytic> {
        Some(Analytic::Elliptic(*self))
    }

    fn terms(&self) -> Option<Terms> {
        let parts = self.parts();
        Some(Terms::around(self.origin, &parts.rows, parts.fall, parts.radius))
    }

    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        self.parts().crossed(origin - self.origin, d).into_iter().collect()
    }
}
