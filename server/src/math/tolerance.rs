//! Every numerical constant of the engine, each with its reason. Tolerances are arguments elsewhere, never literals.

/// Default resolution as a fraction of the larger bounding radius of a pair: nine digits.
pub const DEFAULT_RESOLUTION: f64 = 1e-9;

/// Below this distance from an axis, relative to the distance from its origin, the radial direction of a cylinder or
/// cone is noise: any exact perpendicular is used instead.
pub const ON_AXIS: f64 = 1e-9;

/// Linear parts of a `multmatrix` within this of a similarity are replaced by it: real files print six digits, which
/// leaves 2e-6.
pub const SIMILARITY: f64 = 1e-5;

/// A polyhedron this close to convex, relative to its size, is taken as the hull of its planes: single-precision
/// sources leave faces non-planar by 1e-4.
pub const CONVEXITY: f64 = 1e-4;
