//! Quadrics that are convex and open, by a focus: psi = |B(x − o)| − w·(x − o) − r.
//!
//! Elliptic paraboloids, one sheet of a hyperboloid of two sheets, parabolic cylinders, and one branch of a hyperbolic cylinder. The
//! points of such a surface of revolution have distances from a focus o and from a plane (its directrix) in one ratio (Apollonius,
//! Conics III; D. Hilbert, S. Cohn-Vossen, Geometry and the Imagination, 1-4). Stretched across the axis, e₃, that is
//!
//! s₁² y₁² + s₂² y₂² + s₃² y₃² <= (w y₃ + r)²,   w y₃ + r >= 0,   y = x − o along the principal axes.
//!
//! Every convex open quadric, as z >= α x² + β y² (s₃ = w) or z >= c √(1 + x²/a² + y²/b²) (s₃ < w), can be written so, with the vertex at
//! y₃ = −r and any r up to the smaller radius of curvature there; a long ellipsoid, too (s₃ > w). psi is the difference of the roots
//! of both sides, so it is 0 on the surface alone, negative inside, and convex: a norm less what is linear. That is an elliptic face's
//! psi ([`Stretch`]) with a third row and with w.
//!
//! It is 1-Lipschitz where s₁², s₂² <= s₃ and s₃ + w = 1: with n = B(x − o)/|B(x − o)| and t = n₃ the gradient Bᵀn − w has at most the
//! square s₃ (1 − t²) + (s₃ t − w)², which falls with t from (s₃ + w)² = 1 at t = −1, where the vertex is. Away from it psi is flatter
//! than the distance: on the axis inside of the focus it does not fall below −r. All s and w are a hair smaller (`WHOLE`).

use super::elliptic::{Seen, WHOLE, axes_of, moved_turn, turn_of};
use super::{
    Axis, Bend, Curvature, FaceAt, Law, NUMBERS, Section, Stretch, Stretches, Surface, Symmetry, Terms, largest_corner,
    tangent,
};
use glam::{DMat3, DVec2, DVec3};

/// A convex open quadric: an elliptic paraboloid or a sheet of a hyperboloid, or such a cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bowl {
    /// Its focus.
    pub origin: DVec3,
    /// The rotation to its principal axes, the third into it, as an elliptic face's.
    pub turn: DVec3,
    /// s₁, s₂ and s₃; s₂ is 0 of a cylinder.
    pub scale: DVec3,
    /// w, along the third axis; s₃ of a paraboloid.
    pub fall: f64,
    /// r, a length.
    pub radius: f64,
}

impl Bowl {
    /// λ₁ x² + λ₂ y² <= κ z² + 2 g z next to the vertex, with z from it along the third column of a rotation, `bends` = (λ₁, λ₂),
    /// λ₁ > 0, λ₂ >= 0 (0 of a cylinder), g > 0: a paraboloid where κ = 0, the sheet of a hyperboloid where κ > 0, and where κ < 0 a long
    /// ellipsoid, −κ at most λ₁ and λ₂. psi falls to −`depth` at most along the axis to the focus, a length.
    ///
    /// Proportional to s₁² x² + s₂² y² − (1 − 2 s₃) z² − 2 s₃ r z, which the form by the focus is with y₃ = z − r and w = 1 − s₃.
    pub fn new(vertex: DVec3, axes: DMat3, bends: DVec2, [kappa, g]: [f64; 2], depth: f64) -> Self {
        let radius = (g / bends.max_element()).min(depth);
        let whole = kappa * radius + 2.0 * g;
        let [first, second] = (bends * (radius / whole)).to_array().map(f64::sqrt);
        let third = g / whole;
        let fall = if kappa == 0.0 { third } else { (kappa * radius + g) / whole };
        Self {
            origin: vertex + axes.z_axis * radius,
            turn: turn_of(axes.x_axis, axes.y_axis),
            scale: DVec3::new(first, second, third) * WHOLE,
            fall: fall * WHOLE,
            radius: radius * WHOLE,
        }
    }

    /// True of a paraboloid or a parabolic cylinder alone.
    #[inline]
    pub fn is_parabolic(&self) -> bool {
        self.fall == self.scale.z
    }

    /// True of what is straight along its second axis.
    #[inline]
    pub fn is_cylinder(&self) -> bool {
        self.scale.y == 0.0
    }

    /// Its principal axes: the rotation that `turn` tells.
    #[inline]
    pub fn axes(&self) -> DMat3 {
        axes_of(self.turn)
    }

    /// What psi is made of.
    #[inline]
    pub fn parts(&self) -> Stretch {
        let (axes, s) = (self.axes(), self.scale);
        let rows = [axes.x_axis * s.x, axes.y_axis * s.y, axes.z_axis * s.z];
        Stretch { rows, fall: axes.z_axis * self.fall, radius: self.radius }
    }

    #[inline]
    fn seen(&self, x: DVec3) -> Seen {
        self.parts().seen(x - self.origin)
    }
}

impl Surface for Bowl {
    #[inline]
    fn reach(&self) -> f64 {
        self.origin.length() + self.radius
    }

    #[inline]
    fn magnitude(&self) -> f64 {
        self.origin.abs().max_element() + self.radius
    }

    fn value(&self, x: DVec3) -> f64 {
        let (stretch, y) = (self.parts(), x - self.origin);
        stretch.of(y).length() - stretch.fall.dot(y) - stretch.radius
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

    #[inline]
    fn steady(&self, _: DVec3) -> Option<DVec3> {
        Some(-self.parts().fall)
    }

    /// Below, the larger of the tangent and of what B's rows reach over the box less w; above, the largest value of a corner.
    fn span(&self, center: DVec3, half: DVec3) -> (f64, f64) {
        let (stretch, y) = (self.parts(), center - self.origin);
        let extent = DVec3::from_array(stretch.rows.map(|row| row.abs().dot(half)));
        let nearest = (stretch.of(y).abs() - extent).max(DVec3::ZERO).length();
        let fall = stretch.fall.dot(y) + stretch.fall.abs().dot(half);
        (tangent(self, center, half).max(nearest - fall - stretch.radius), largest_corner(self, center, half))
    }

    fn bend(&self, x: DVec3, _: &FaceAt) -> Bend {
        self.seen(x).bend(Law::Focal)
    }

    fn moved(&self, point: impl Fn(DVec3) -> DVec3, vector: impl Fn(DVec3) -> DVec3) -> Self {
        Self { origin: point(self.origin), turn: moved_turn(self.axes(), vector), ..*self }
    }

    #[inline]
    fn symmetry(&self) -> Symmetry {
        Symmetry::None
    }

    /// The line through the middles of the ellipses: of a paraboloid along its axis, otherwise through the centre of both sheets.
    fn skewer(&self, normal: DVec3) -> Option<Axis> {
        let axes = self.axes();
        let (n, s) = (axes.transpose() * normal, self.scale);
        if self.is_cylinder() {
            return None;
        }
        if self.is_parabolic() {
            // Where the surface looks along the normal.
            let drop = self.fall * self.radius / -n.z;
            let foot = DVec3::new(n.x / (s.x * s.x), n.y / (s.y * s.y), 0.0) * drop;
            return foot.is_finite().then(|| Axis { origin: self.origin + axes * foot, direction: axes.z_axis });
        }
        let last = (s.z - self.fall) * (s.z + self.fall);
        let along = DVec3::new(n.x / (s.x * s.x), n.y / (s.y * s.y), n.z / last);
        let center = axes.z_axis * (self.fall * self.radius / last);
        Some(Axis { origin: self.origin + center, direction: axes * along.try_normalize()? })
    }

    #[inline]
    fn slides_along(&self, d: DVec3, tolerance: f64) -> bool {
        self.is_cylinder() && d.cross(self.axes().y_axis).length() < tolerance
    }

    #[inline]
    fn section(&self, _: DVec3) -> Option<Section> {
        None
    }

    /// On the ray from the focus through the point: psi + r grows along it in proportion, and its gradient stays.
    fn foot(&self, point: DVec3, _: DVec3, _: f64) -> DVec3 {
        let (stretch, y) = (self.parts(), point - self.origin);
        let straight = if self.is_cylinder() { self.axes().y_axis } else { DVec3::ZERO };
        let slid = straight * y.dot(straight);
        let whole = stretch.of(y).length() - stretch.fall.dot(y);
        let far = self.radius / whole;
        if far > 0.0 && far.is_finite() { self.origin + slid + (y - slid) * far } else { point }
    }

    /// Of cylinders between the points of the focal lines next to c.
    fn above(&self, q: &Self, c: DVec3, r: f64) -> (f64, f64) {
        if self.is_cylinder() != q.is_cylinder() {
            return (f64::NEG_INFINITY, 0.0);
        }
        let focus = |face: &Self| {
            let straight = face.axes().y_axis;
            let slid = straight * (c - face.origin).dot(straight);
            if face.is_cylinder() { face.origin + slid } else { face.origin }
        };
        self.parts().above(focus(self), (&q.parts(), focus(q)), c, r)
    }

    /// What psi is off there, as a distance where it is flattest: there its gradient along x − o is r of |x − o|.
    fn deviation(&self, other: &Self, size: f64) -> f64 {
        let (least, _) = self.above(other, self.origin, size);
        let (most, _) = other.above(self, self.origin, size);
        (-least).max(-most).max(0.0) * (1.0 + size / self.radius)
    }

    /// What psi is in the middle of the ball.
    #[inline]
    fn key(&self, c: DVec3, _: f64) -> f64 {
        self.value(c)
    }

    #[inline]
    fn numbers(&self) -> [f64; NUMBERS] {
        let (o, t, s) = (self.origin, self.turn, self.scale);
        [o.x, o.y, o.z, t.x, t.y, t.z, s.x, s.y, s.z, self.fall, self.radius]
    }

    fn quadric_name(&self) -> &'static str {
        if self.is_parabolic() { "paraboloid" } else { "hyperboloid of two sheets" }
    }

    fn terms(&self) -> Option<Terms> {
        let parts = self.parts();
        Some(Terms::around(self.origin, &parts.rows, parts.fall, parts.radius))
    }

    fn inside(&self, origin: DVec3, d: DVec3) -> Stretches {
        self.parts().crossed(origin - self.origin, d).into_iter().collect()
    }
}
