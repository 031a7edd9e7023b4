//! Elliptic cylinder, cone or frustum, upright or leaning.

use super::{Checked, Convex, Geometry, Shape, Sink, Source};
use crate::math::{Aabb, Ball, Lanes, Moments};
use crate::solid::Face;
use crate::solid::primitive::{Cone, Cylinder};
use crate::solid::surface::{Elliptic, Plane};
use contactd_proto::Pose;
use glam::{DMat3, DVec2, DVec3};

/// What any affine map makes of a cylinder, a cone or a frustum: the hull of two ellipses in planes square to z, alike but for their
/// size, one above the other or aside. Centred at the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct EllipticFrustum {
    /// Semi-axes of an ellipse of size 1, along x and y; lengths.
    pub semi: DVec2,
    /// Size of the ellipse at z = −half_height.
    pub bottom: f64,
    /// Size at z = +half_height. One of the two is 1, the other one at most that.
    pub top: f64,
    /// Half the height.
    pub half_height: f64,
    /// How far its middle goes aside along x and y, per height.
    pub lean: DVec2,
}

impl EllipticFrustum {
    fn is_cylinder(&self) -> bool {
        self.bottom == self.top
    }

    /// The map that makes it of one about z of the radius 1.
    fn map(&self) -> DMat3 {
        DMat3::from_cols(DVec3::X * self.semi.x, DVec3::Y * self.semi.y, self.lean.extend(1.0))
    }

    /// Centre and semi-axes of the ellipse below or above.
    fn end(&self, above: bool) -> (DVec3, DVec2) {
        let (z, size) = if above { (self.half_height, self.top) } else { (-self.half_height, self.bottom) };
        ((self.lean * z).extend(z), self.semi * size)
    }

    /// How far the ellipse of size 1 about the axis reaches along m, and how far the middle of the upper end does.
    #[inline]
    pub(super) fn rim_and_up<T: Lanes>(&self, m: [T; 3]) -> [T; 2] {
        let [x, y] = [m[0] * self.semi.x, m[1] * self.semi.y];
        [(x * x + y * y).sqrt(), (m[2] + m[0] * self.lean.x + m[1] * self.lean.y) * self.half_height]
    }

    /// The point of an end that is farthest along m, of any length; its middle where all of it is, up to `flat`.
    fn farthest_of(&self, above: bool, m: DVec3, flat: f64) -> DVec3 {
        let (center, semi) = self.end(above);
        let along = semi * m.truncate();
        let length = along.length();
        let out = if length > flat { semi * along / length } else { DVec2::ZERO };
        center + out.extend(0.0)
    }

    /// A farthest point along m, of any length.
    pub(super) fn support(&self, m: DVec3) -> DVec3 {
        let [rim, up] = self.rim_and_up([m.x, m.y, m.z]);
        self.farthest_of(self.top * rim + up >= self.bottom * rim - up, m, 0.0)
    }

    /// The middle of what is farthest along the unit vector m, told as `Convex::farthest` does.
    pub(super) fn farthest(&self, m: DVec3, flat: f64) -> DVec3 {
        let size = self.half_height + self.semi.max_element();
        let [rim, up] = self.rim_and_up([m.x, m.y, m.z]);
        let [above, below] = [true, false].map(|above| self.farthest_of(above, m, flat * size));
        let off = rim * (self.top - self.bottom) + 2.0 * up;
        if off.abs() <= flat * size {
            0.5 * (above + below)
        } else if off > 0.0 {
            above
        } else {
            below
        }
    }

    fn has_top(&self) -> bool {
        self.top > 0.0
    }
}

impl Geometry for EllipticFrustum {
    fn faces(&self) -> Vec<Face> {
        // An ellipse at z has the points x with (n·x)² + (m·x)² = size².
        let n = DVec3::new(1.0, 0.0, -self.lean.x) / self.semi.x;
        let m = DVec3::new(0.0, 1.0, -self.lean.y) / self.semi.y;
        let side = if self.is_cylinder() {
            Elliptic::cylinder(DVec3::ZERO, [n, m])
        } else {
            let drop = self.bottom - self.top;
            let slope = drop.abs() / (2.0 * self.half_height);
            // Beyond the smaller end, by what the larger one says.
            let far = 2.0 * self.half_height / drop.abs();
            let z = if drop > 0.0 { far - self.half_height } else { self.half_height - far };
            Elliptic::cone((self.lean * z).extend(z), [n, m], DVec3::Z * -drop.signum() * slope)
        };
        let mut faces: Vec<Face> = vec![side.into()];
        if self.has_top() {
            faces.push(Plane { normal: DVec3::Z, offset: self.half_height }.into());
        }
        if self.bottom > 0.0 {
            faces.push(Plane { normal: -DVec3::Z, offset: self.half_height }.into());
        }
        faces
    }
    fn face_name(&self, index: usize) -> String {
        match (index, self.has_top()) {
            (0, _) => "side",
            (1, true) => "top",
            _ => "bottom",
        }
        .into()
    }
    fn aabb(&self, frame: &Pose) -> Aabb {
        let (u, v) = (frame.vector(DVec3::X), frame.vector(DVec3::Y));
        let around = |above: bool| {
            let (center, semi) = self.end(above);
            let (a, b) = (u * semi.x, v * semi.y);
            Aabb::around(frame.point(center), (a * a + b * b).map(f64::sqrt))
        };
        around(false).union(&around(true))
    }
    fn ball(&self) -> Ball {
        let far = |above: bool| {
            let (center, semi) = self.end(above);
            // Its farthest point lies in the quadrant of its centre, within this box of it.
            (center.truncate().length() + semi.max_element())
                .min((center.truncate().abs() + semi).length())
                .hypot(center.z)
        };
        Ball::new(DVec3::ZERO, far(false).max(far(true)))
    }
    fn smallest_dimension(&self) -> f64 {
        // The image of a ball of the half height or of the radius 1 is no thinner.
        let across = self.semi.min_element() / (1.0 + self.lean.length_squared()).sqrt();
        2.0 * self.half_height.min(across)
    }
    fn interior_point(&self) -> DVec3 {
        let z = self.half_height * if self.is_cylinder() { 0.0 } else { 0.5 * (self.top - self.bottom).signum() };
        (self.lean * z).extend(z)
    }
    #[inline]
    fn convex(&self) -> Convex<'_> {
        Convex::Elliptic(self)
    }
    fn moments(&self) -> Option<Moments> {
        let half_height = self.half_height;
        let upright = if self.is_cylinder() {
            Cylinder { radius: self.top, half_height }.moments()
        } else {
            Cone { bottom: self.bottom, top: self.top, half_height }.moments()
        };
        upright.map(|m| m.mapped(&self.map()))
    }
    fn grown(&self, _: f64) -> Option<Shape> {
        None
    }
    fn kind(&self) -> &'static str {
        match (self.is_cylinder(), self.semi.x == self.semi.y) {
            (true, false) => "elliptic cylinder",
            (true, true) => "oblique cylinder",
            (false, _) if self.bottom > 0.0 && self.top > 0.0 => "elliptic frustum",
            (false, _) => "elliptic cone",
        }
    }
    fn dimensions(&self) -> String {
        let Self { semi, bottom, top, half_height, lean } = self;
        let ends = if self.is_cylinder() {
            format!("semi-axes {}, {}", semi.x, semi.y)
        } else {
            let [b, t] = [bottom, top].map(|s| *semi * *s);
            format!("semi-axes {}, {} and {}, {}", b.x, b.y, t.x, t.y)
        };
        let aside = *lean * 2.0 * *half_height;
        let leans = if *lean == DVec2::ZERO { String::new() } else { format!(", aside by {}, {}", aside.x, aside.y) };
        format!("{ends}, h {}{leans}", 2.0 * half_height)
    }
    fn write(&self, out: &mut dyn Sink) {
        let Self { semi, bottom, top, half_height, lean } = self;
        [semi.x, semi.y, *bottom, *top, *half_height, lean.x, lean.y].into_iter().for_each(|x| out.number(x));
    }
    fn read(from: &mut dyn Source) -> Checked<Self> {
        let mut next = || from.finite();
        let semi = DVec2::new(next()?, next()?);
        let read =
            Self { semi, bottom: next()?, top: next()?, half_height: next()?, lean: DVec2::new(next()?, next()?) };
        let fine = semi.min_element() > 0.0 && read.half_height > 0.0 && read.bottom.min(read.top) >= 0.0;
        if fine && read.bottom.max(read.top) > 0.0 { Ok(read) } else { Err("an elliptic frustum with a volume") }
    }
}
