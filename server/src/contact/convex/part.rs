//! A primitive by what it shows along a direction: the feature that is farthest there, how it curves, and what holds it.
//!
//! An edge or a side of a body is shown along a whole circle of directions, n·axis = lean; a flat face along one direction
//! alone. What is shown nowhere else than there is *held* by it.

use crate::contact::exclusion::literal::Side;
use crate::contact::witness::newton::Constraint;
use crate::solid::local::LiteralId;
use crate::solid::primitive::Form;
use crate::solid::{Primitive, Sense};
use glam::{DMat3, DVec3};
use smallvec::SmallVec;

/// Faces that meet in a feature, with the weights of their normals.
pub type Active = SmallVec<[(Constraint, f64); 8]>;

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
    pub tangent: DVec3,
    /// … and this much in every direction.
    pub round: f64,
}

/// A shape's numbers.
#[derive(Clone, Copy)]
pub enum Core {
    Ball(f64),
    Cuboid(DVec3),
    /// Cylinder, cone, frustum: the radii, half the height, the component along z of the outward normals of the side.
    Round {
        radii: [f64; 2],
        half: f64,
        lean: f64,
    },
}

/// A primitive along the world's axes, seen from its own centre.
#[derive(Clone, Copy)]
pub struct ConvexPart<'a> {
    /// The primitive.
    pub primitive: &'a Primitive,
    pub axes: DMat3,
    pub core: Core,
}

impl<'a> ConvexPart<'a> {
    pub fn new(primitive: &'a Primitive, axes: DMat3) -> Option<Self> {
        let round = |bottom: f64, top: f64, half: f64| {
            let drop = bottom - top;
            let lean = if drop == 0.0 { 0.0 } else { drop / (drop * drop + 4.0 * half * half).sqrt() };
            Core::Round { radii: [bottom, top], half, lean }
        };
        let core = match primitive.shape.form() {
            Form::Ball(radius) => Core::Ball(radius),
            Form::Cuboid(half) => Core::Cuboid(half),
            Form::Round { bottom, top, half } => round(bottom, top, half),
            Form::Corners(_) | Form::Other => return None,
        };
        Some(Self { primitive, axes, core })
    }

    /// What holds the unit outward direction m, nearer than `tol`: circles, and whether a flat face does.
    pub fn held(&self, m: DVec3, tol: f64) -> (u8, bool) {
        let l = self.axes.transpose() * m;
        match self.core {
            Core::Ball(_) => (0, false),
            Core::Cuboid(_) => {
                let held = (0..3).fold(0, |held, k| held | u8::from(l[k].abs() <= tol) << k);
                (held, held.count_ones() == 2)
            }
            Core::Round { radii, lean, .. } => {
                let flat = l.x * l.x + l.y * l.y <= tol * tol && radii[usize::from(l.z >= 0.0)] > 0.0;
                (u8::from(!flat && (l.z - lean).abs() <= tol) << 2, flat)
            }
        }
    }

    /// Circles by their axes and leans.
    pub fn circles(&self, held: u8) -> impl Iterator<Item = (DVec3, f64)> {
        let lean = if let Core::Round { lean, .. } = self.core { lean } else { 0.0 };
        (0..3).filter(move |k| held >> k & 1 == 1).map(move |k| (self.axes.col(k), lean))
    }

    /// What is shown along the unit outward direction m, held as told.
    pub fn shown(&self, m: DVec3, (held, flat): (u8, bool)) -> Shown {
        let mut shown = Shown { ends: [m; 2], held, flat, bend: 0.0, tangent: DVec3::ZERO, round: 0.0 };
        match self.core {
            Core::Ball(r) => {
                shown.ends = [m * r; 2];
                shown.round = r;
            }
            Core::Cuboid(half) => {
                let corner = half.copysign(self.axes.transpose() * m);
                let other =
                    DVec3::from_array(std::array::from_fn(|k| if held >> k & 1 == 1 { -corner[k] } else { corner[k] }));
                shown.ends = [self.axes * corner, self.axes * other];
            }
            Core::Round { radii, half, lean } => {
                let l = self.axes.transpose() * m;
                let rho = (l.x * l.x + l.y * l.y).sqrt();
                let u = if rho > 0.0 { DVec3::new(l.x / rho, l.y / rho, 0.0) } else { DVec3::X };
                let upper = usize::from(l.z >= lean);
                let rim = |k: usize| self.axes * (u * radii[k] + DVec3::Z * half.copysign(k as f64 - 0.5));
                shown.ends = [rim(upper), if held == 0 { DVec3::ZERO } else { rim(1 - upper) }];
                shown.bend = if rho > 0.0 { radii[upper] / rho } else { 0.0 };
                shown.tangent = self.axes * DVec3::new(-u.y, u.x, 0.0);
            }
        }
        shown
    }

    /// The faces that meet in what is shown along the unit outward direction m, with the weights of their normals; `own`
    /// is m along the axes of the primitive's model.
    pub fn faces(&self, side: Side, m: DVec3, own: DVec3, shown: &Shown, out: &mut Active) {
        let id = |k: u32| LiteralId::new(self.primitive.first_face + k, Sense::Positive);
        let literal = |k: u32| Constraint::Literal(side, id(k));
        let l = self.axes.transpose() * m;
        match self.core {
            Core::Ball(_) => out.push((literal(0), 1.0)),
            Core::Cuboid(_) => {
                for k in 0..3 {
                    if shown.held >> k & 1 == 0 {
                        out.push((literal(2 * k as u32 + u32::from(l[k] < 0.0)), l[k].abs()));
                    }
                }
            }
            Core::Round { radii, lean, .. } => {
                let upper = usize::from(if shown.flat { l.z >= 0.0 } else { l.z >= lean });
                // The disc above comes before the one below.
                let disc = literal(1 + u32::from(upper == 0 && radii[1] > 0.0));
                if shown.flat {
                    out.push((disc, 1.0));
                } else if shown.held != 0 {
                    out.push((literal(0), 1.0));
                } else if radii[upper] > 0.0 {
                    let on_side = ((l.x * l.x + l.y * l.y) / (1.0 - lean * lean)).sqrt();
                    out.push((literal(0), on_side));
                    out.push((disc, (l.z - on_side * lean).abs()));
                } else if let Some(apex) = self.primitive.faces[0].apex() {
                    let along = apex.directions();
                    out.extend((0..3).map(|k| (Constraint::Apex(side, id(0), k), along[usize::from(k)].dot(own))));
                }
            }
        }
    }
}
