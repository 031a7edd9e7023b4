//! Questions about a session's objects where its last step has left them, and their answers (docs/queries.md): how far two are
//! apart, on which side of a surface points are, what rays meet first. World frame, lengths in the models' unit.

use bincode::{Decode, Encode};
use bytemuck::{Pod, Zeroable};

/// What is asked of points.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct PointOptions {
    /// Points no farther from the surface than this are on it, a length >= 0. What is less than rounding is `Undecided` there.
    pub surface: f64,
    /// How far apart the bounds of the signed distance may be: a length, raised to what rounding allows. Infinite: the search ends
    /// as soon as the side is known.
    pub tolerance: f64,
    /// Parts of a solid that may be looked at for a point: then the bounds stay as far apart as they are.
    pub limit: u64,
}

impl Default for PointOptions {
    fn default() -> Self {
        Self { surface: 1e-9, tolerance: 1e-6, limit: DEFAULT_QUERY_LIMIT }
    }
}

/// What is asked of rays.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayOptions {
    /// A ray that comes no deeper than this into a solid passes it: a length, raised to what rounding needs (docs/queries.md).
    pub depth: f64,
    /// Stretches that may be looked at for a ray and a solid: then it is undecided from there.
    pub limit: u64,
}

impl Default for RayOptions {
    fn default() -> Self {
        Self { depth: 0.0, limit: DEFAULT_QUERY_LIMIT }
    }
}

/// Parts that a point, and stretches that a ray may cost by default.
pub const DEFAULT_QUERY_LIMIT: u64 = 200_000;

/// A ray: origin + t · direction, 0 <= t <= length, with the direction made a unit vector.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Pod, Zeroable)]
#[repr(C)]
pub struct ObjectRay {
    /// Where it begins.
    pub origin: [f64; 3],
    /// Where it goes; of any length but 0.
    pub direction: [f64; 3],
    /// How far it goes: a length >= 0; of objects without bounds nothing is told beyond some 1e10 times where it begins.
    pub length: f64,
}

/// On which side of the surface a point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Side {
    /// Proven inside, farther from the surface than told.
    Inside,
    /// Proven outside, farther from the surface than told.
    Outside,
    /// Proven no farther from the surface than told.
    Surface,
    /// None of them is proven: the bounds reach over the limit between two.
    Undecided,
}

impl Side {
    /// Words by number, as other languages have them.
    pub const NAMES: [&str; 4] = ["inside", "outside", "surface", "undecided"];

    /// Of a signed distance between bounds, with what counts as on the surface.
    pub fn of_bounds(lower: f64, upper: f64, surface: f64) -> Self {
        if lower > surface {
            Side::Outside
        } else if upper < -surface {
            Side::Inside
        } else if lower >= -surface && upper <= surface {
            Side::Surface
        } else {
            Side::Undecided
        }
    }
}

/// What is asked.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum Query {
    /// How far two objects are apart.
    Distance {
        /// The first one.
        a: u32,
        /// The second one.
        b: u32,
        /// How far apart the bounds may be, a length.
        tolerance: f64,
    },
    /// Where points are.
    Points {
        /// The points.
        points: Vec<[f64; 3]>,
        /// How exactly.
        options: PointOptions,
        /// Of these objects alone.
        objects: Option<Vec<u32>>,
    },
    /// What rays meet first.
    Rays {
        /// The rays.
        rays: Vec<ObjectRay>,
        /// How exactly.
        options: RayOptions,
        /// Of these objects alone.
        objects: Option<Vec<u32>>,
    },
}

/// What is told, in the order of what was asked.
#[derive(Clone, Debug, PartialEq, Encode, Decode)]
pub enum QueryAnswer {
    /// Of [`Query::Distance`].
    Distance(ObjectDistance),
    /// Of [`Query::Points`].
    Points(Vec<PointAnswer>),
    /// Of [`Query::Rays`].
    Rays(Vec<RayAnswer>),
}

/// How far apart two objects are.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct ObjectDistance {
    /// Proven: no two points of them are nearer to each other.
    pub lower: f64,
    /// Proven: two points of them are no farther apart; 0 where they share one, infinite where none were found.
    pub upper: f64,
    /// A point of each, as far apart as `upper` but for rounding; NaN where none was found.
    pub points: [[f64; 3]; 2],
    /// True when the bounds are as near to each other as was asked, or as rounding lets them be.
    pub is_settled: bool,
    /// Pairs of parts that were looked at.
    pub cells: u64,
}

/// A point among objects. The signed distance is that to the nearest surface, negative inside.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct PointAnswer {
    /// The object with the least signed distance; `None` where there is none.
    pub object: Option<u32>,
    /// On which side of its surface.
    pub side: Side,
    /// Proven: the least signed distance is no less.
    pub lower: f64,
    /// Proven: it is no more.
    pub upper: f64,
    /// The point of the object's surface that was found nearest; NaN where none was found.
    pub nearest: [f64; 3],
    /// Faces there, by face id of the object's model; `u32::MAX` fills.
    pub faces: [u32; 3],
    /// True when the bounds are as near to each other as was asked, or as rounding lets them be.
    pub is_settled: bool,
    /// Parts that were looked at.
    pub cells: u64,
}

/// A ray among objects.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayAnswer {
    /// The object that is hit, or the one in which the whole ray lies.
    pub object: Option<u32>,
    /// What becomes of the ray.
    pub outcome: RayOutcome,
    /// Stretches that were looked at.
    pub cells: u64,
}

/// What becomes of a ray.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub enum RayOutcome {
    /// It crosses a surface.
    Hit(RayHit),
    /// Proven: it crosses none, all of it being outside, or inside where `is_inside`.
    Miss {
        /// True when it begins in an object and does not leave it.
        is_inside: bool,
    },
    /// The limit of work was met, or the ray comes from so far away that rounding hides whether it meets an object.
    Undecided {
        /// Proven: up to this parameter it crosses no surface.
        until: f64,
    },
}

/// Where a ray first crosses a surface. Parameters are lengths along it.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode)]
pub struct RayHit {
    /// Proven: nothing is crossed before, by more than `RayOptions::depth`.
    pub lower: f64,
    /// Where it meets the surface, to rounding: `lower` <= `t` <= `upper`.
    pub t: f64,
    /// Proven: here it is in the object, or, of a ray that leaves, out of it.
    pub upper: f64,
    /// The point at `t`.
    pub point: [f64; 3],
    /// Unit normal of the surface there, out of the object.
    pub normal: [f64; 3],
    /// The face that is crossed, by its id within the object's model.
    pub face: u32,
    /// All faces that meet there, three at most; `u32::MAX` fills.
    pub faces: [u32; 3],
    /// True when the ray begins in the object and leaves it here.
    pub is_leaving: bool,
}

/// "No object" in a [`PointRecord`] or [`RayRecord`].
pub const NO_OBJECT: u32 = u32::MAX;

/// The answer about a point, as it lies in memory in C and Python.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PointRecord {
    /// The object with the least signed distance, or [`NO_OBJECT`].
    pub object: u32,
    /// On which side of its surface: 0 inside, 1 outside, 2 on it, 3 undecided.
    pub side: u8,
    /// 1 when the bounds are as near to each other as was asked, or as rounding lets them be.
    pub settled: u8,
    /// Zero.
    pub reserved: [u8; 2],
    /// Proven: the least signed distance is no less.
    pub lower: f64,
    /// Proven: it is no more.
    pub upper: f64,
    /// The point of the object's surface that was found nearest; NaN where none was found.
    pub nearest: [f64; 3],
    /// Faces there, by face id of the object's model; `NO_FACE` fills.
    pub faces: [u32; 3],
    /// Zero.
    pub spare: u32,
    /// Parts that were looked at.
    pub cells: u64,
}

/// `outcome` of a [`RayRecord`]: it crosses a surface.
pub const RAY_HIT: u8 = 0;
/// `outcome` of a [`RayRecord`]: proven that it crosses none.
pub const RAY_MISS: u8 = 1;
/// `outcome` of a [`RayRecord`]: the limit of work was met, or it comes from too far away to tell.
pub const RAY_UNDECIDED: u8 = 2;

/// The answer about a ray, as it lies in memory in C and Python.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RayRecord {
    /// The object that is hit, or the one in which the whole ray lies, or [`NO_OBJECT`].
    pub object: u32,
    /// 0 hit, 1 miss, 2 undecided.
    pub outcome: u8,
    /// 1 when it begins in the object: it leaves it at the hit, or lies in it.
    pub inside: u8,
    /// Zero.
    pub reserved: [u8; 2],
    /// Proven: nothing is crossed before; of a miss infinite.
    pub lower: f64,
    /// Where it meets the surface: lower <= t <= upper, lengths along the ray; NaN without a hit.
    pub t: f64,
    /// Proven: here it is in the object, or, of a ray that leaves, out of it; infinite without a hit.
    pub upper: f64,
    /// The point at `t`; NaN without a hit.
    pub point: [f64; 3],
    /// Unit normal of the surface there, out of the object; NaN without a hit.
    pub normal: [f64; 3],
    /// The face that is crossed, by its id within the object's model; `NO_FACE` without a hit.
    pub face: u32,
    /// All faces that meet there, three at most; `NO_FACE` fills.
    pub faces: [u32; 3],
    /// Stretches that were looked at.
    pub cells: u64,
}

/// Words for `outcome` by number.
pub const OUTCOME_NAMES: [&str; 3] = ["hit", "miss", "undecided"];

impl From<&PointAnswer> for PointRecord {
    fn from(told: &PointAnswer) -> Self {
        let PointAnswer { object, side, lower, upper, nearest, faces, is_settled, cells } = *told;
        let (object, side, settled) = (object.unwrap_or(NO_OBJECT), side as u8, u8::from(is_settled));
        Self { object, side, settled, lower, upper, nearest, faces, cells, ..Self::default() }
    }
}

impl From<&RayAnswer> for RayRecord {
    fn from(told: &RayAnswer) -> Self {
        let (nan, none) = ([f64::NAN; 3], u32::MAX);
        let object = told.object.unwrap_or(NO_OBJECT);
        let (t, upper, faces, cells) = (f64::NAN, f64::INFINITY, [none; 3], told.cells);
        let rest = Self { object, t, upper, point: nan, normal: nan, face: none, faces, cells, ..Self::default() };
        match told.outcome {
            RayOutcome::Hit(hit) => Self {
                outcome: RAY_HIT,
                inside: u8::from(hit.is_leaving),
                lower: hit.lower,
                t: hit.t,
                upper: hit.upper,
                point: hit.point,
                normal: hit.normal,
                face: hit.face,
                faces: hit.faces,
                ..rest
            },
            RayOutcome::Miss { is_inside } => {
                Self { outcome: RAY_MISS, inside: u8::from(is_inside), lower: f64::INFINITY, ..rest }
            }
            RayOutcome::Undecided { until } => Self { outcome: RAY_UNDECIDED, lower: until, ..rest },
        }
    }
}
