//! What the solver keeps of a contact point from sweep to sweep.

use glam::DVec3;

/// What a solve needs of a point, beside where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// From the bodies' origins to the point.
    pub(super) arms: [DVec3; 2],
    /// Change of a body's angular velocity by a unit impulse along normal and tangents.
    pub(super) turns: [[DVec3; 2]; 3],
    /// Two unit vectors across the normal.
    pub(super) tangents: [DVec3; 2],
    /// Speed that a unit impulse along the normal makes.
    pub(super) normal_gain: f64,
    /// The larger one across it.
    pub(super) tangent_gain: f64,
    /// Coefficient of friction of the pair.
    pub friction: f64,
    /// Coefficient of restitution of the pair.
    pub restitution: f64,
    /// Least normal speed after the solve.
    pub target: f64,
    /// The same before any lift.
    pub out: f64,
    /// Takes part in the solve.
    pub active: bool,
    /// The surfaces are as near as makes no difference.
    pub closed: bool,
    /// Speed by which the motion must lead away, since its chord would cut a hollow surface.
    pub lift: f64,
    /// Impulse on the second body: along the normal and the tangents.
    pub impulse: DVec3,
}

impl Row {
    /// Speed that a unit impulse along the normal makes; 0: nothing there can be moved.
    pub fn normal_gain(&self) -> f64 {
        self.normal_gain
    }
}
