//! A question: two bodies over one step, what is asked of them, and which of them carries the cells.

use super::options::QueryOptions;
use crate::math::tolerance;
use crate::motion::Placed;
use crate::octree::Model;
use crate::solid::Sense;
use glam::DVec3;

/// One body of a pair.
#[derive(Clone, Copy, Debug)]
pub struct PlacedModel<'a> {
    /// Its model.
    pub model: &'a Model,
    /// Where it stands and how it moves.
    pub placed: Placed,
}

/// A question: two bodies over one step.
#[derive(Clone, Copy, Debug)]
pub struct PairQuery<'a> {
    /// The first body; normals point from it.
    pub a: PlacedModel<'a>,
    /// The second one.
    pub b: PlacedModel<'a>,
    /// Depth delta at which a contact is decided; see `default_resolution`. Raised to `LEAST_RESOLUTION` of the pair's
    /// extent over the step; the outcome tells what was used.
    pub resolution: f64,
    /// Cells' worth of work (`Counters::spent`) before the answer is `undecided`.
    pub cell_limit: u64,
    /// Ideas of the search that are switched on: all, unless their worth is measured.
    pub strategies: Strategies,
    /// What is worked out beside whether they meet.
    pub query_options: QueryOptions,
}

impl PairQuery<'_> {
    /// True when b carries the cells: small and without cavities is cheap to cover. A round peg that spins about hardly another axis
    /// than its own in a hole with flat or conical walls does not: seen from it the walls rush by, or the hole's apex goes round;
    /// seen from the hole it all but stands (`fit::spun`). Of cylinders and balls in their like either is as good, and where
    /// they come deep is found sooner from the smaller one.
    pub(super) fn is_swapped(&self) -> bool {
        let [a, b] = [&self.a, &self.b];
        if turns_in_a_hole(a, b) {
            return true;
        }
        if turns_in_a_hole(b, a) {
            return false;
        }
        let weight = |m: &Model| m.radius * if m.hollow { HOLLOW } else { 1.0 };
        weight(self.b.model) < weight(self.a.model)
    }
}

/// The ideas of the search, each of which can be switched off. None changes what an answer promises, only the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strategies {
    /// Stage 1: the collision region by S-bounds.
    pub region: bool,
    /// Stage 2: candidates from the walk of both octrees.
    pub walk: bool,
    /// Several faces with multipliers bound a cell together; otherwise the best single one does. For measurements only: nearly
    /// every search then runs into its limit of cells.
    pub multipliers: bool,
    /// Same-shape fits as bounds of their own.
    pub fits: bool,
    /// Curved faces touched where a contact was found.
    pub hints: bool,
    /// Cells made smaller by what all their clauses share before they are bounded.
    pub tighten: bool,
    /// Whole convex primitives are answered in front of the search. Its answers may differ from the search's in their
    /// last digits: both solve the same equations, from another guess.
    pub convex: bool,
    /// Convex primitives against solids with holes, and unions of convex parts, are answered in front of the search, with the same
    /// proviso; the latter where `convex` is on too.
    pub cavities: bool,
    /// Meshes against convex primitives and each other are answered in front of the search, with the same proviso.
    pub facets: bool,
    /// Balls against other solids are answered in front of the search, with the same proviso.
    pub balls: bool,
    /// A search that takes too long is begun anew at a coarser resolution, which the answer tells; otherwise it goes on to its limit.
    pub coarser: bool,
}

impl Default for Strategies {
    fn default() -> Self {
        Self {
            region: true,
            walk: true,
            multipliers: true,
            fits: true,
            hints: true,
            tighten: true,
            convex: true,
            cavities: true,
            facets: true,
            balls: true,
            coarser: true,
        }
    }
}

/// A hollow body counts as this much larger when the reference body of the cells is chosen.
const HOLLOW: f64 = 2.0;

/// 1e-9 of the larger bounding radius of the two models; of one without bounds the other's counts. Infinite for two
/// without.
pub fn default_resolution(a: &Model, b: &Model) -> f64 {
    let radius = if a.radius.min(b.radius).is_finite() { a.size().max(b.size()) } else { f64::INFINITY };
    tolerance::DEFAULT_RESOLUTION * radius
}

/// A body's placed model, less a spin about its own axis of revolution: that moves nothing of it.
pub(in crate::contact) fn without_own_spin(body: &PlacedModel) -> Placed {
    let mut placed = body.placed;
    if spins_in_itself(body) {
        placed.motion.spin = DVec3::ZERO;
    }
    placed
}

/// True when a body spins about an axis of revolution of its own.
pub(in crate::contact) fn spins_in_itself(body: &PlacedModel) -> bool {
    let (place, motion) = (&body.placed.place, &body.placed.motion);
    if motion.spin == DVec3::ZERO {
        return false;
    }
    // A ball about its object's origin does, whatever the axis.
    if body.model.ball.is_some() && place.position == DVec3::ZERO {
        return true;
    }
    let along = (motion.start.rotation * place.rotation).conjugate() * motion.spin;
    let Some(axis) = body.model.axis_of_revolution(along).filter(|axis| axis.is_along(along)) else { return false };
    axis.passes(place.inverse().position, body.model.radius)
}

/// A spin about an axis of revolution of a body, nearly: this much of it, radians, and off the axis by no more than this part.
const SPINS: f64 = 0.1;
const OFF_AXIS: f64 = 0.02;

/// Cosine of the angle between a wall and an axis up to which the one is along the other.
const ALONG: f64 = 0.1;

/// True when a body without cavities spins nearly about an axis of revolution of its own, but not exactly, and the
/// other one has subtracted planes along that axis or subtracted cones.
fn turns_in_a_hole(peg: &PlacedModel, hole: &PlacedModel) -> bool {
    let spin = peg.placed.motion.spin;
    let bounded = peg.model.radius.is_finite() && hole.model.radius.is_finite();
    let candidates = hole.model.hollow && !peg.model.hollow && bounded;
    if !candidates || spin.length_squared() < SPINS * SPINS {
        return false;
    }
    let world_from_model = |body: &PlacedModel| body.placed.motion.start.rotation * body.placed.place.rotation;
    let along = world_from_model(peg).conjugate() * spin;
    let Some(axis) = peg.model.axis_of_revolution(along) else { return false };
    if axis.is_along(along) || axis.direction.cross(along).length() > OFF_AXIS * along.length() {
        return false;
    }
    let axis = world_from_model(hole).conjugate() * (world_from_model(peg) * axis.direction);
    let solid = &hole.model.solid;
    solid.faces.kept().any(|(i, face)| {
        let negative = solid.senses[solid.face_owner[i] as usize] == Sense::Negative;
        negative && (face.apex().is_some() || face.flat().is_some_and(|(normal, _)| normal.dot(axis).abs() <= ALONG))
    })
}
