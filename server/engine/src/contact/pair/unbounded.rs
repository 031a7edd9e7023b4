//! Two unbounded bodies: no box holds what they may have in common, so no search would end.
//!
//! Two half-spaces overlap wherever they stand and however they move, unless their planes are parallel and look at each other.
//! What else is unbounded mostly has common points far out, which are looked for along a few directions. A pair of which this
//! tells nothing is undecided, at once.

use crate::contact::query::outcome::{ContactPoint, Outcome, Overlap, Penetration, Verdict};
use crate::contact::query::question::{PairQuery, PlacedModel};
use crate::math::tolerance;
use crate::solid::{Node, Solid};
use contactd_proto::Pose;
use glam::DVec3;

/// How far out points are looked for, in distances of the bodies from the world's origin and extents of their faces.
const FAR: [f64; 2] = [1e2, 1e5];
/// How deep a point must lie in both bodies, relative to its distance: rounding is much less.
const DEEP: f64 = 1e-6;
/// Normals whose sum is longer than this do not look at each other.
const OPPOSITE: f64 = 1e-12;

/// What is told of two unbounded bodies; `None` when one is bounded.
pub fn reported(query: &PairQuery) -> Option<Outcome> {
    let resolution = resolution(query)?;
    let bodies = [Side::new(&query.a), Side::new(&query.b)];
    let mut o = Outcome::clear(resolution);
    o.counters.primitives = bodies.iter().map(|b| b.solid.primitives.len() as u64).sum();
    if let Some(gap) = parallel(&bodies, query)
        && gap > 2.0 * resolution
    {
        o.apart = gap;
        return Some(o);
    }
    o.touching = true;
    let Some((x, depth)) = common(&bodies, resolution) else {
        o.verdict = Verdict::Undecided { time_lower: 0.0 };
        return Some(o);
    };
    // No translation takes them apart: any direction is as good as the one that the point was found along.
    let normal = bodies[0].normals().next().unwrap_or(DVec3::Z);
    let of_point = || ContactPoint { point: x, normal, separation: -2.0 * depth, ..ContactPoint::default() };
    let of_depth = || Penetration { depth: 2.0 * depth, point: x, direction: normal };
    let options = &query.query_options;
    o.verdict = Verdict::Overlap(Overlap {
        time: 0.0,
        point: options.point().then(of_point),
        penetration: options.penetration.then(of_depth),
    });
    o.counters.contacts += u64::from(options.point());
    o.counters.penetrations += u64::from(options.penetration);
    Some(o)
}

/// The resolution that is told of two unbounded bodies: neither has a size to measure it by.
pub fn resolution(query: &PairQuery) -> Option<f64> {
    if query.a.model.radius.is_finite() || query.b.model.radius.is_finite() {
        return None;
    }
    Some(if query.resolution.is_finite() { query.resolution } else { tolerance::DEFAULT_RESOLUTION })
}

/// A solid at the start of the step.
struct Side<'a> {
    solid: &'a Solid,
    world_from_model: Pose,
}

impl<'a> Side<'a> {
    fn new(body: &PlacedModel<'a>) -> Self {
        let (start, place) = (body.placed.motion.start, body.placed.place);
        let world_from_model = Pose::new(start.point(place.position), start.rotation * place.rotation);
        Self { solid: &body.model.solid, world_from_model }
    }

    /// Normals of its planes, world axes, out of what is solid there.
    fn normals(&self) -> impl Iterator<Item = DVec3> + '_ {
        let flat = self.solid.faces.kept().filter_map(|(_, face)| face.flat());
        let planes = flat.map(|(normal, _)| self.world_from_model.rotation * normal);
        planes.flat_map(|n| [n, -n])
    }

    /// The outward normal and the offset of a solid that is one half-space, world axes.
    fn half_space(&self) -> Option<(DVec3, f64)> {
        let (Node::Primitive(_), [face]) = (&self.solid.nodes[self.solid.root as usize], self.solid.faces.listed())
        else {
            return None;
        };
        let (normal, offset) = face.flat()?;
        let n = self.world_from_model.rotation * normal;
        Some((n, n.dot(self.world_from_model.position) + offset))
    }

    /// A length by which far is measured.
    fn size(&self) -> f64 {
        self.world_from_model.position.length() + self.solid.faces.reach()
    }

    fn value(&self, x: DVec3) -> f64 {
        self.solid.value(self.world_from_model.inverse().point(x))
    }
}

/// How far apart two half-spaces are over the whole step whose planes look at each other and do not turn; rounding taken off.
fn parallel(bodies: &[Side; 2], query: &PairQuery) -> Option<f64> {
    let ((n, a), (m, b)) = (bodies[0].half_space()?, bodies[1].half_space()?);
    let motions = [&query.a, &query.b].map(|body| body.placed.motion);
    if (n + m).length() > OPPOSITE || motions.iter().any(|motion| motion.spin.cross(n) != DVec3::ZERO) {
        return None;
    }
    let gap = -a - b;
    let later = gap + n.dot(motions[1].velocity - motions[0].velocity);
    let size = bodies[0].size() + bodies[1].size();
    Some(gap.min(later) - 1e-12 * size)
}

/// A point deep inside both, and how deep.
fn common(bodies: &[Side; 2], resolution: f64) -> Option<(DVec3, f64)> {
    let size = 1.0 + bodies[0].size() + bodies[1].size();
    let grid = (0..27i32).map(|k| DVec3::new(f64::from(k % 3 - 1), f64::from(k / 3 % 3 - 1), f64::from(k / 9 - 1)));
    let wedges = bodies[0].normals().flat_map(|n| bodies[1].normals().map(move |m| -(n + m)));
    let directions = wedges.chain(grid).filter_map(DVec3::try_normalize);
    directions.flat_map(|d| FAR.map(|far| d * (far * size))).find_map(|x| {
        let depth = -bodies.iter().map(|body| body.value(x)).fold(f64::NEG_INFINITY, f64::max);
        (depth > DEEP * x.length() + 4.0 * resolution).then_some((x, depth))
    })
}
