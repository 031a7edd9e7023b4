//! Quadrics that are not convex on either side: psi = |P(x)| − |N(x)|, P and N affine with two rows each.
//!
//! Along the principal axes, y from the origin:
//!
//! | quadric | P | N |
//! |---|---|---|
//! | hyperboloid of one sheet, x²/a² + y²/b² <= 1 + z²/c² | (s₁ y₁, s₂ y₂) | (s₃ y₃, k) |
//! | what is between the branches of a hyperbolic cylinder, x²/a² <= 1 + z²/c² | (s₁ y₁, 0) | (s₃ y₃, k) |
//! | hyperbolic paraboloid, α x² − β y² <= z | (s₁ y₁, ½ (y₃ − h)) | (s₂ y₂, ½ (y₃ + h)) |
//!
//! Each side of the inequality is a sum of two squares (J. Sylvester's law of inertia, 1852: of z it is ¼ ((z + h)² − (z − h)²)/h),
//! and psi is the difference of their roots: 0 on the surface alone, negative inside. P is convex and N concave in psi: by
//! |P| >= p·P for every |p| <= 1 psi is at least p·P − |N|, which bends away from its tangent as a subtracted face of two rows does,
//! and at most |P| − n·N, which does as a positive one.
//!
//! The gradient is P'ᵀp − N'ᵀn with the unit vectors p and n along P and N. Of the first two kinds both parts are square to each
//! other: its square is s₁² + s₃² at most, made 1 by k² = 1/(1/a² + 1/c²), a the smaller semi-axis. Of the third it is
//! s₁² p₁² + s₂² n₁² + ¼ (p₂ − n₂)² <= s² (2 − p₂² − n₂²) + ½ (p₂² + n₂²) <= 1 where s² = max(s₁², s₂²) = h max(α, β) <= ½. All rows
//! are a hair smaller (`WHOLE`). psi is flatter than the distance away from there: of a hyperboloid at its waist by 1/√(1 + a²/c²).

use super::elliptic::{WHOLE, axes_of, moved_turn, turn_of};
use super::roots::{between_roots, half_line};
use super::{Axis, Bend, Curvature, FaceAt, Law, NUMBERS, Section, Stretches, Surface, Symmetry, Terms, Under};
use glam::{DMat3, DVec2, DVec3};

/// A quadric of two positive and two negative squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Saddle {
    /// Its centre, or the saddle point.
    pub origin: DVec3,
    /// The rotation to its principal axes, as an elliptic face's.
    pub turn: DVec3,
    /// s₁.
    pub first: f64,
    /// s₂; 0 between the branches of a cylinder.
    pub second: f64,
    /// s₃; 0 of a hyperbolic paraboloid.
    pub third: f64,
    /// k, or h of a hyperbolic paraboloid; a length.
    pub size: f64,
}

/// A row of P or N: slope·y + at, y from the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Its gradient, 1 at most.
    pub slope: DVec3,
    /// At the origin, a length.
    pub at: f64,
}

/// The two sides of the inequality.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// P.
    pub plus: [Row; 2],
    /// N.
    pub minus: [Row; 2],
}

/// P or N at a point: a vector of two, its length, and the unit vector along it.
#[derive(Clone, Copy)]
struct Half {
    rows: [Row; 2],
    v: DVec2,
    length: f64,
    along: DVec2,
}

impl Half {
    fn new(rows: [Row; 2], y: DVec3) -> Self {
        let v = DVec2::from_array(rows.map(|row| row.slope.dot(y) + row.at));
        let length = v.length();
        // Any unit vector gives a tangent where it is zero, as far off as what rounding has left of v.
        let along = if length > 0.0 { v / length } else { DVec2::X };
        Self { rows, v, length, along }
    }

    /// The rows' gradients, weighed.
    fn back(&self, v: DVec2) -> DVec3 {
        self.rows[0].slope * v.x + self.rows[1].slope * v.y
    }

    /// The gradient of the length, and what it bends along.
    fn radial(&self) -> DVec3 {
        self.back(self.along)
    }

    fn beside(&self) -> DVec3 {
        self.back(self.along.perp())
    }

    /// Bounds of the length over the box of half extents `half` around the point.
    fn range(&self, half: DVec3) -> (f64, f64) {
        let extent = DVec2::from_array(self.rows.map(|row| row.slope.abs().dot(half)));
        let v = self.v.abs();
        ((v - extent).max(DVec2::ZERO).length(), (v + extent).length())
    }
}

impl Saddle {
    /// x²/a² + y²/b² <= 1 + z²/c² from the centre along the columns of a rotation, a <= b, b infinite of a cylinder; lengths.
    pub fn hyperboloid(center: DVec3, axes: DMat3, semi: DVec3) -> Self {
        let size = semi.z / (semi.z / semi.x).hypot(1.0);
        let [first, second, third] = [semi.x, semi.y, semi.z].map(|a| size / a * WHOLE);
        let turn = turn_of(axes.x_axis, axes.y_axis);
        Self { origin: center, turn, first, second, third, size: size * WHOLE }
    }

    /// α x² − β y² <= z from the saddle point along the columns of a rotation, α and β positive, per length; psi falls to −`depth` at
    /// most along z, a length.
    pub fn paraboloid(point: DVec3, axes: DMat3, bends: DVec2, depth: f64) -> Self {
        let size = (0.5 / bends.max_element()).min(depth);
        let [first, second] = (bends * size).to_array().map(|s| s.sqrt() * WHOLE);
        Self { origin: point, turn: turn_of(axes.x_axis, axes.y_axis), first, second, third: 0.0, size }
    }

    /// True of a hyperbolic paraboloid.
    #[inline]
    pub fn is_parabolic(&self) -> bool {
        self.third == 0.0
    }

    /// True of what is straight along its second axis.
    #[inline]
    pub fn is_cylinder(&self) -> bool {
        self.second == 0.0
    }

    /// Its principal axes: the rotation that `turn` tells.
    #[inline]
    pub fn axes(&self) -> DMat3 {
        axes_of(self.turn)
    }

    /// What psi is made of.
    #[inline]
    pub fn sides(&self) -> Sides {
        let axes = self.axes();
        let row = |slope: DVec3, at: f64| Row { slope, at };
        let (one, other) = (row(axes.x_axis * self.first, 0.0), row(axes.y_axis * self.second, 0.0));
        if self.is_parabolic() {
            let (up, level) = (axes.z_axis * (0.5 * WHOLE), 0.5 * WHOLE * self.size);
            return Sides { plus: [one, row(up, -level)], minus: [other, row(up, level)] };
        }
        Sides { plus: [one, other], minus: [row(axes.z_axis * self.third, 0.0), row(DVec3::ZERO, self.size)] }
    }

    fn halves(&self, x: DVec3) -> [Half; 2] {
        let (sides, y) = (self.sides(), x - self.origin);
        [Half::new(sides.plus, y), Half::new(sides.minus, y)]
    }
}

impl Surface for Saddle {
    #[inline]
    fn reach(&self) -> f64 {
        self.origin.length() + self.size
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.origin.abs().max_element() + self.size
    }

    #[inline]
    fn is_convex(&self) -> bool {
        false
    }

    fn value(&self, x: DVec3) -> f64 {
        let [p, n] = self.halves(x);
        p.length - n.length
    }

    fn at(&self, x: DVec3) -> FaceAt {
        let [p, n] = self.halves(x);
        let normal = p.radial() - n.radial();
        FaceAt { value: p.length - n.length, normal, slope: normal.length(), k: 1.0, rho: p.length }
    }

    fn curvature(&self, x: DVec3, at: &FaceAt) -> Curvature {
        let [p, n] = self.halves(x);
        let (one, other) = (p.beside(), n.beside());
        let falls = if n.length > 0.0 { -other.length_squared() / n.length } else { 0.0 };
        Curvature {
            each: 0.0,
            factor: one.length_squared() / at.rho,
            along: one.normalize_or_zero(),
            other: falls,
            beside: other.normalize_or_zero(),
        }
    }

    #[inline]
    fn steady(&self, x: DVec3) -> Option<DVec3> {
        let [_, n] = self.halves(x);
        Some(-n.radial())
    }

    fn split(&self, x: DVec3) -> Option<[DVec3; 3]> {
        let [p, _] = self.halves(x);
        Some([p.radial(), p.beside(), DVec3::ZERO])
    }

    fn under(&self, touched: DVec3, center: DVec3) -> Option<Under> {
        let [at, _] = self.halves(touched);
        let [p, n] = self.halves(center);
        let far = at.radial();
        Some(Under {
            value: at.along.dot(p.v) - n.length,
            normal: far - n.radial(),
            far,
            k: 1.0,
            rho: n.length,
            axis: DVec3::ZERO,
            out: n.radial(),
            beside: Some(n.beside()),
        })
    }

    fn turn(&self, x: DVec3, _: &FaceAt, reach: f64) -> f64 {
        let part = |half: &Half| if half.length > reach { reach / (half.length - reach) } else { 2.0 };
        self.halves(x).iter().map(part).sum::<f64>().min(2.0)
    }

    /// Below, the larger of the tangent less what it dips and of what the rows reach; above, the smaller of the tangent and what it
    /// rises and of these.
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        let [p, n] = self.halves(center);
        let tilt = (p.radial() - n.radial()).abs().dot(half);
        let value = p.length - n.length;
        let bends =
            |of: &Half| Under::dip(1.0, of.length, of.radial().abs().dot(half).hypot(of.beside().abs().dot(half)));
        let ([least, most], [low, high]) = ([p.range(half).0, p.range(half).1], [n.range(half).0, n.range(half).1]);
        ((value - tilt - bends(&n)).max(least - high), (value + tilt + bends(&p)).min(most - low))
    }

    fn bend(&self, x: DVec3, _: &FaceAt) -> Bend {
        let [p, n] = self.halves(x);
        Bend {
            law: Law::Saddle { rho: n.length, radial: n.radial() },
            radial: (p.length, p.radial()),
            tangents: [p.beside(), n.beside()],
            core: f64::INFINITY,
        }
    }

    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { origin: point(self.origin), turn: moved_turn(self.axes(), vector), ..*self }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::None
    }

    /// The line through the middles of the ellipses and the centre. Of a hyperbolic paraboloid planes cut no closed curves.
    fn skewer(&self, normal: DVec3) -> Option<Axis> {
        if self.is_parabolic() || self.is_cylinder() {
            return None;
        }
        let axes = self.axes();
        let (n, squares) = (axes.transpose() * normal, DVec3::new(self.first, self.second, self.third));
        let along = n / (squares * squares) * DVec3::new(1.0, 1.0, -1.0);
        Some(Axis { origin: self.origin, direction: axes * along.try_normalize()? })
    }

    #[inline]
    fn slides_along(&self, d: DVec3, tolerance: f64) -> bool {
        self.is_cylinder() && d.cross(self.axes().y_axis).length() < tolerance
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<Section> {
        None
    }

    /// Where P and N point as they do at the point, and are of one length; the point itself where no such is.
    fn foot(&self, point: DVec3, _: DVec3, _: f64) -> DVec3 {
        let [p, n] = self.halves(point);
        let axes = self.axes();
        let y = axes.transpose() * (point - self.origin);
        let found = if self.is_parabolic() {
            // ½ (y₃ ± h) = length·n₂ and length·p₂.
            let length = WHOLE * self.size / (n.along.y - p.along.y);
            let up = 0.5 * length * (n.along.y + p.along.y) / (0.5 * WHOLE);
            (length > 0.0).then(|| DVec3::new(length * p.along.x / self.first, length * n.along.x / self.second, up))
        } else {
            // A cylinder's stays at its height along the axis.
            let way = n.length * p.along;
            let second = if self.is_cylinder() { y.y } else { way.y / self.second };
            Some(DVec3::new(way.x / self.first, second, y.z))
        };
        found.filter(|y| y.is_finite()).map_or(point, |y| self.origin + axes * y)
    }

    /// −|P_p − P_q| − |N_p − N_q| over the ball, rows turned so that they point the same way.
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64) {
        if self.is_parabolic() != q.is_parabolic() {
            return (f64::NEG_INFINITY, 0.0);
        }
        let (one, other) = (self.sides(), q.sides());
        let off = |a: &Row, b: &Row| {
            let turned = if a.slope.dot(b.slope) < 0.0 { -1.0 } else { 1.0 };
            let at = a.at - b.at * turned + (a.slope.dot(c - self.origin) - b.slope.dot(c - q.origin) * turned);
            at.abs() + (a.slope - b.slope * turned).length() * r
        };
        let all = |a: &[Row; 2], b: &[Row; 2]| off(&a[0], &b[0]) + off(&a[1], &b[1]);
        let far = [self.origin, q.origin].map(|o| (c - o).length() + r);
        let size = self.origin.length() + q.origin.length() + self.size + q.size + 2.0 * (far[0] + far[1] + c.length());
        (-all(&one.plus, &other.plus) - all(&one.minus, &other.minus), size)
    }

    /// What psi is off there, as a distance where it is as flat as at a waist or `size` away.
    fn deviation(&self, other: &Self, size: f64) -> f64 {
        let (least, _) = self.above(other, self.origin, size);
        let (most, _) = other.above(self, self.origin, size);
        let flattest = if self.is_parabolic() { 0.5 / (1.0 + size / self.size) } else { self.first.min(self.third) };
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
        [o.x, o.y, o.z, t.x, t.y, t.z, self.first, self.second, self.third, self.size, 0.0]
    }

    fn quadric_name(&self) -> &'static str {
        if self.is_parabolic() { "hyperbolic paraboloid" } else { "hyperboloid of one sheet" }
    }

    /// Where |P₀ + t P₁|² <= |N₀ + t N₁|².
    fn terms(&self) -> Option<Terms> {
        let sides = self.sides();
        let rows = |rows: [Row; 2]| rows.map(|row| Row::from_origin(row.slope, row.at, self.origin)).to_vec();
        let rest = Row { slope: DVec3::ZERO, at: 0.0 };
        Some(Terms::Lengths { plus: rows(sides.plus), minus: rows(sides.minus), rest })
    }

    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        let squares = |half: &Half| {
            let way = DVec2::from_array(half.rows.map(|row| row.slope.dot(d)));
            [way.length_squared(), half.v.dot(way), half.v.length_squared()]
        };
        let [p, n] = self.halves(origin).map(|half| squares(&half));
        let [a, b, c] = [p[0] - n[0], p[1] - n[1], p[2] - n[2]];
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        if a.abs() < 1e-14 * (p[0] + n[0]) {
            return half_line(2.0 * b, c).into_iter().collect();
        }
        if a > 0.0 {
            return between_roots(a, b, c).into_iter().collect();
        }
        match between_roots(-a, -b, -c) {
            Some((low, high)) => [(all.0, low), (high, all.1)].into_iter().collect(),
            None => [all].into_iter().collect(),
        }
    }
}
