//! What a convex primitive shows along a direction: the feature that is farthest there, how it curves, and what holds it.
//!
//! An edge or a side of a body is shown along a whole circle of directions, n·axis = lean; a flat face along one direction
//! alone. What is shown nowhere else than there is *held* by it.

use super::Convex;
use glam::{DMat3, DVec3};

/// What a body shows along a direction.
#[derive(Clone, Copy)]
pub struct Shown {
    /// Farthest point, and the other end of the segment where it is held by one circle of directions.
    pub ends: [DVec3; 2],
    /// Circles n·axis = lean of directions along which the body stays what it is, by the index of the axis.
    pub held: u8,
    /// A flat face, held to the one direction.
    pub flat: bool,
    /// Second derivative of the support: this much along `tangent` …
    pub bend: f64,
    /// The unit direction of that.
    pub tangent: DVec3,
    /// … and this much in every direction.
    pub round: f64,
}

/// What a feature is held by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Hold {
    /// A face of the primitive, by its index, with the weight of its normal.
    Face(u32, f64),
    /// The apex of its first face.
    Apex,
}

/// A convex shape to be asked for its features.
#[derive(Clone, Copy)]
pub struct Features {
    shape: Convex<'static>,
    /// Of a round one the component along z of the outward normals of the side; else 0.
    lean: f64,
}

impl Features {
    /// `None` for a shape that is told by corners, for an elliptic one, and for what is not known.
    #[inline]
    pub fn new(shape: Convex<'_>) -> Option<Self> {
        let lean = match shape {
            Convex::Round { bottom, top, half } => {
                let drop = bottom - top;
                if drop == 0.0 { 0.0 } else { drop / (drop * drop + 4.0 * half * half).sqrt() }
            }
            Convex::Ball(_) | Convex::Cuboid(_) | Convex::Capsule { .. } => 0.0,
            Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::Corners(_)
            | Convex::HalfSpace
            | Convex::Other => {
                return None;
            }
        };
        Some(Self { shape: shape.of_few()?, lean })
    }

    /// Of a shape of which nothing is known: it shows nothing.
    pub fn none() -> Self {
        Self { shape: Convex::Other, lean: 0.0 }
    }

    /// Half the height of a round one, and the radius of its disc above or below.
    #[inline]
    pub fn disc(&self, above: bool) -> Option<(f64, f64)> {
        let Convex::Round { bottom, top, half } = self.shape else { return None };
        Some((half, if above { top } else { bottom }))
    }

    /// What holds the unit outward direction m, nearer than `tol`: circles, and whether a flat face does.
    #[inline]
    pub fn held(&self, axes: &DMat3, m: DVec3, tol: f64) -> (u8, bool) {
        let l = axes.transpose() * m;
        match self.shape {
            Convex::Cuboid(_) => {
                let held = (0..3).fold(0, |held, k| held | u8::from(l[k].abs() <= tol) << k);
                (held, held.count_ones() == 2)
            }
            Convex::Round { bottom, top, .. } => {
                let radius = if l.z >= 0.0 { top } else { bottom };
                let flat = l.x * l.x + l.y * l.y <= tol * tol && radius > 0.0;
                (u8::from(!flat && (l.z - self.lean).abs() <= tol) << 2, flat)
            }
            Convex::Capsule { .. } => (u8::from(l.z.abs() <= tol) << 2, false),
            Convex::Ball(_)
            | Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::Corners(_)
            | Convex::HalfSpace
            | Convex::Other => (0, false),
        }
    }

    /// Circles by their axes and leans.
    #[inline]
    pub fn circles(&self, axes: &DMat3, held: u8) -> impl Iterator<Item = (DVec3, f64)> {
        let (axes, lean) = (*axes, self.lean);
        (0..3).filter(move |k| held >> k & 1 == 1).map(move |k| (axes.col(k), lean))
    }

    /// What is shown along the unit outward direction m, held as told.
    pub fn shown(&self, axes: &DMat3, m: DVec3, (held, flat): (u8, bool)) -> Shown {
        let mut shown = Shown { ends: [m; 2], held, flat, bend: 0.0, tangent: DVec3::ZERO, round: 0.0 };
        match self.shape {
            Convex::Ball(r) => {
                shown.ends = [m * r; 2];
                shown.round = r;
            }
            Convex::Capsule { half, radius } => {
                let end = axes.z_axis * half.copysign(axes.z_axis.dot(m));
                shown.ends = [end + m * radius, if held == 0 { DVec3::ZERO } else { m * radius - end }];
                shown.round = radius;
            }
            Convex::Cuboid(half) => {
                let corner = half.copysign(axes.transpose() * m);
                let other =
                    DVec3::from_array(std::array::from_fn(|k| if held >> k & 1 == 1 { -corner[k] } else { corner[k] }));
                shown.ends = [*axes * corner, *axes * other];
            }
            Convex::Round { bottom, top, half } => {
                let radii = [bottom, top];
                let l = axes.transpose() * m;
                let rho = (l.x * l.x + l.y * l.y).sqrt();
                let u = if rho > 0.0 { DVec3::new(l.x / rho, l.y / rho, 0.0) } else { DVec3::X };
                let upper = usize::from(l.z >= self.lean);
                let rim = |k: usize| *axes * (u * radii[k] + DVec3::Z * half.copysign(k as f64 - 0.5));
                shown.ends = [rim(upper), if held == 0 { DVec3::ZERO } else { rim(1 - upper) }];
                shown.bend = if rho > 0.0 { radii[upper] / rho } else { 0.0 };
                shown.tangent = *axes * DVec3::new(-u.y, u.x, 0.0);
            }
            Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::Corners(_)
            | Convex::HalfSpace
            | Convex::Other => {}
        }
        shown
    }

    /// What meets in what is shown along the unit outward direction m.
    #[inline]
    pub fn holds(&self, axes: &DMat3, m: DVec3, shown: &Shown, mut hold: impl FnMut(Hold)) {
        let l = axes.transpose() * m;
        match self.shape {
            Convex::Ball(_) | Convex::Capsule { .. } => hold(Hold::Face(0, 1.0)),
            Convex::Cuboid(_) => {
                for k in (0..3).filter(|k| shown.held >> k & 1 == 0) {
                    hold(Hold::Face(2 * k as u32 + u32::from(l[k] < 0.0), l[k].abs()));
                }
            }
            Convex::Round { bottom, top, .. } => {
                let (radii, lean) = ([bottom, top], self.lean);
                let upper = usize::from(if shown.flat { l.z >= 0.0 } else { l.z >= lean });
                // The disc above comes before the one below.
                let disc = 1 + u32::from(upper == 0 && radii[1] > 0.0);
                if shown.flat {
                    hold(Hold::Face(disc, 1.0));
                } else if shown.held != 0 {
                    hold(Hold::Face(0, 1.0));
                } else if radii[upper] > 0.0 {
                    let on_side = ((l.x * l.x + l.y * l.y) / (1.0 - lean * lean)).sqrt();
                    hold(Hold::Face(0, on_side));
                    hold(Hold::Face(disc, (l.z - on_side * lean).abs()));
                } else {
                    hold(Hold::Apex);
                }
            }
            Convex::Ellipsoid(_)
            | Convex::Elliptic(_)
            | Convex::Superellipsoid(_)
            | Convex::Corners(_)
            | Convex::HalfSpace
            | Convex::Other => {}
        }
    }
}
