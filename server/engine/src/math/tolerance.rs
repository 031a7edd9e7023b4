//! Numerical constants that more than one part of the engine goes by, each with its reason. Those of one method stand at the
//! head of its file.

/// Default resolution as a fraction of the larger bounding radius of a pair: nine digits.
pub const DEFAULT_RESOLUTION: f64 = 1e-9;

/// Below this distance from an axis, relative to the distance from its origin, the radial direction of a cylinder or
/// cone is noise (the distance itself is right to two epsilon): any exact perpendicular is used instead.
pub const ON_AXIS: f64 = 8.0 * f64::EPSILON;

/// Linear parts of a `multmatrix` within this of a similarity are replaced by it: real files print six digits, which
/// leaves 2e-6.
pub const SIMILARITY: f64 = 1e-5;

/// A polyhedron this close to convex, relative to the diagonal of its box, is taken as the hull of its planes: six printed digits
/// leave faces non-planar by so much. What is dented by more is a mesh: planes of a dent cut far corners off by many times its depth.
pub const CONVEXITY: f64 = 4e-6;

/// Neighbouring faces of a polyhedron whose corners lie this close to one plane, relative to the diagonal of its box, are
/// one face: six printed digits bend a triangulated face by this much.
pub const COPLANAR: f64 = 1e-6;

/// Deviations below this, relative to the size at hand, are rounding: nothing was snapped and no note is due.
pub const ROUNDING: f64 = 1e-12;

/// A frustum whose radii differ by less than this, relative to the larger one, is a cylinder: its apex would be so far
/// away that the apex' own rounding spoils the lateral surface.
pub const SAME_RADIUS: f64 = 1e-9;

/// Relative outward rounding of bounds: a rule on boxes or balls does a dozen operations, each off by half an ulp.
pub const OUTWARD: f64 = 32.0 * f64::EPSILON;

/// S-bounds are stable once no bound shrinks by more than this fraction in a round: what is left to gain by going on is
/// less than that.
pub const BOUND_PROGRESS: f64 = 1e-3;

/// Depth, as a fraction of a model's bounding radius, up to which its S-bounds and octree keep f exactly: far above
/// every sensible resolution (also that of a partner ten thousand times larger), far below every voxel.
pub const MODEL_MARGIN: f64 = 1e-5;

/// The same for the bounds that proofs of a clearance use: coherence over steps works with gaps of this order, and wider
/// bounds would tell the parts of a model apart less well.
pub const WIDE_MARGIN: f64 = 1.0 / 128.0;

/// The same of a model that reaches to infinity, a length: its partner says how far is looked, and it has no size to be
/// measured by.
pub const UNBOUNDED_MARGIN: f64 = 1e12;

/// Relative rounding of a point carried through a few rotations and translations.
pub const CARRIED: f64 = 64.0 * f64::EPSILON;

/// Swept boxes grow by this times the size of their coordinates: a pose, a corner and a sum of both are each right to a
/// few units in the last place (2e-16); a wider box only costs a comparison.
pub const BOX_ROUNDING: f64 = 1e-14;

/// How far past the end of the earliest bracket (fraction of the step) other pairs are searched for a scene's first
/// contact: their own brackets may begin before the time at which the resolution's depth is reached.
pub const FIRST_SLACK: f64 = 1e-6;

/// Smallest resolution relative to the pair's extent over the step …
pub const LEAST_RESOLUTION: f64 = 1e3 * f64::EPSILON;

/// … and relative to what rounding may do to one bound (docs/accuracy.md): what is left of delta must still exclude.
pub const LEAST_ROUNDINGS: f64 = 4.0;

/// Sine of an angle that a double cannot tell from 0: axes within it are one direction.
pub const PARALLEL: f64 = 1e-15;

/// Cosine below which two directions are at a right angle: what their rounding leaves.
pub const RIGHT_ANGLE: f64 = 2.0 * f64::EPSILON;
