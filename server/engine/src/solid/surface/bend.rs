//! How a face bends away from its tangent plane over a box: bounds of the second derivatives there.

use glam::DVec3;

/// How a face bends where its tangent plane is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// How the curvature ranges over a box.
    pub law: Law,
    /// Distance from the centre or axis, a length, and the direction away from it, a unit vector unless the face is elliptic; zero
    /// for a plane.
    pub radial: (f64, DVec3),
    /// Vectors along which the face curves, units unless it is elliptic, zero where there are fewer.
    pub tangents: [DVec3; 2],
    /// How far inwards along the normal the face is what it is from here: a tube to its middle. Infinite where `radial` says it.
    pub core: f64,
}

/// The range of κ: the surface lies between ½ κ⁻ τ² and ½ κ⁺ τ² below its tangent plane, τ the offset along the tangents. A
/// face that is not convex has κ⁻ < 0.
/// Formulas and their derivation: `octree::mass::slab`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// κ = 0.
    Straight,
    /// A sphere's, or a cylinder's in its cross-section.
    Round {
        /// Radius, a length.
        radius: f64,
    },
    /// A cone's: κ falls along its lines through the apex.
    Conical {
        /// cos α of the half angle.
        cos: f64,
    },
    /// A torus': above as of a ball of its tube, below as of a cone seen from inside where it looks towards its axis.
    Ring {
        /// Radius of the tube, a length.
        radius: f64,
        /// The normal's part towards the axis, 0 where it leads away.
        lean: f64,
    },
    /// A bowl's: as a cone's, along no line of its own.
    Focal,
    /// A saddle's: above by |P|, below by |N|. |N| is infinite, and κ⁻ 0, of what is bent outwards as a superellipsoid is, flat in places.
    Saddle {
        /// |N| at the middle of the box, or after `over` the least of it by its gradient there; a length.
        rho: f64,
        /// Gradient of |N| there.
        radial: DVec3,
    },
}

impl Law {
    /// True for a face that does not bend.
    #[inline]
    pub fn is_straight(&self) -> bool {
        matches!(self, Law::Straight)
    }

    /// True where κ changes along the direction normal × tangent.
    #[inline]
    pub fn changes_along(&self) -> bool {
        matches!(self, Law::Conical { .. })
    }

    /// The same over a box of the half extents `half`.
    #[inline]
    pub fn over(self, half: DVec3) -> Self {
        match self {
            Law::Saddle { rho, radial } => Law::Saddle { rho: rho - radial.abs().dot(half), radial },
            Law::Straight | Law::Round { .. } | Law::Conical { .. } | Law::Ring { .. } | Law::Focal => self,
        }
    }

    /// κ⁻ and κ⁺, per length, where τ is at most `t` and the distance from the centre or axis along the radial direction from
    /// `least` to `most`, each of them known to `pad`; all lengths. `None` where the surface is not held by two parallel planes.
    #[inline]
    pub fn range(&self, t: f64, [least, most]: [f64; 2], pad: f64) -> Option<[f64; 2]> {
        match *self {
            Law::Straight => Some([0.0; 2]),
            Law::Round { radius: r } => {
                (t < r && least >= 0.0).then(|| [1.0 / r, 2.0 / (r + ((r - t) * (r + t)).sqrt())])
            }
            Law::Conical { cos } => {
                (least > 16.0 * pad).then(|| [2.0 * cos / (most + most.hypot(t)), cos / (least - pad)])
            }
            Law::Ring { radius: r, lean } => {
                let high = 2.0 / (r + ((r - t) * (r + t)).max(0.0).sqrt());
                (t < r && (lean == 0.0 || least > 16.0 * pad)).then(|| {
                    let low = if lean == 0.0 { 0.0 } else { -lean / (least - pad) };
                    [low, high]
                })
            }
            Law::Focal => (least > 16.0 * pad).then(|| [2.0 / (most + most.hypot(t)), 1.0 / (least - pad)]),
            Law::Saddle { rho, .. } => {
                (least > 16.0 * pad && rho > 16.0 * pad).then(|| [-1.0 / (rho - pad), 1.0 / (least - pad)])
            }
        }
    }
}
