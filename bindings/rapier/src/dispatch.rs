//! What rapier asks of a pair of solids, answered from the table that the step's one request has filled.

use crate::solid::{Solid, vector};
use contactd_client::manifold::Manifolds;
use contactd_client::proto::Pose as WorldPose;
use parry3d_f64::math::{Pose, Real, Vector};
use parry3d_f64::query::details::{NormalConstraints, ShapeCastOptions};
use parry3d_f64::query::{
    ClosestPoints, Contact, ContactManifold, ContactManifoldsWorkspace, DefaultQueryDispatcher, NonlinearRigidMotion,
    PersistentQueryDispatcher, QueryDispatcher, ShapeCastHit, ShapeDistance, ShapeIntersection, TrackedContact,
    Unsupported,
};
use parry3d_f64::shape::{PackedFeatureId, Shape};
use std::ops::Range;
use std::sync::{Arc, PoisonError, RwLock};

/// Ids that fit into parry's feature ids.
const ID_BITS: u32 = 0x3fff_ffff;

/// The contact points of all pairs, in their bodies' frames.
#[derive(Debug, Default)]
pub(crate) struct Table {
    /// By objects, the smaller id first.
    pairs: Vec<([u32; 2], Range<usize>)>,
    groups: Vec<Group>,
    points: Vec<Tracked>,
}

/// Points with one normal: one manifold of rapier's.
#[derive(Debug)]
struct Group {
    /// From a to b, a's frame.
    normal: Vector,
    points: Range<usize>,
}

#[derive(Debug)]
struct Tracked {
    id: PackedFeatureId,
    on_a: Vector,
    on_b: Vector,
}

impl Table {
    /// Takes the points of a step; `pose` of an object is where it stood when they were told.
    pub fn fill(&mut self, manifolds: &Manifolds, pose: impl Fn(u32) -> WorldPose) {
        self.pairs.clear();
        self.groups.clear();
        self.points.clear();
        for pair in manifolds.pairs() {
            let first = self.groups.len();
            let inverse = pose(pair.a).inverse();
            for group in pair.points.chunk_by(|p, q| p.group == q.group) {
                let start = self.points.len();
                self.points.extend(group.iter().map(|p| Tracked {
                    id: PackedFeatureId::face(p.id & ID_BITS),
                    on_a: vector(p.on_a),
                    on_b: vector(p.on_b),
                }));
                let normal = vector(inverse.vector(group[0].normal));
                self.groups.push(Group { normal, points: start..self.points.len() });
            }
            self.pairs.push(([pair.a, pair.b], first..self.groups.len()));
        }
    }

    fn groups(&self, objects: [u32; 2]) -> &[Group] {
        let found = self.pairs.binary_search_by_key(&objects, |p| p.0);
        found.map_or(&[], |at| &self.groups[self.pairs[at].1.clone()])
    }
}

/// Contacts between [`Solid`]s from the table, everything between other shapes from parry. Give it to
/// `NarrowPhase::with_query_dispatcher`.
#[derive(Clone, Debug)]
pub struct Dispatcher {
    pub(crate) table: Arc<RwLock<Table>>,
}

/// Two solids, in the order in which rapier asks for them.
struct ExactPair<'s> {
    objects: [u32; 2],
    /// The first shape is the pair's b.
    is_flipped: bool,
    pos12: &'s Pose,
}

/// A point as rapier wants it: on both shapes, each in its own frame, and the distance along the normal.
struct Seen {
    id: PackedFeatureId,
    on1: Vector,
    on2: Vector,
    dist: Real,
}

impl ExactPair<'_> {
    /// The group's normal out of the first shape and out of the second, each in its own frame.
    fn normals(&self, group: &Group) -> [Vector; 2] {
        if self.is_flipped {
            [-(self.pos12.rotation * group.normal), group.normal]
        } else {
            [group.normal, -(self.pos12.rotation.inverse() * group.normal)]
        }
    }

    fn point(&self, normal1: Vector, p: &Tracked) -> Seen {
        let (on1, on2) = if self.is_flipped { (p.on_b, p.on_a) } else { (p.on_a, p.on_b) };
        Seen { id: p.id, on1, on2, dist: (*self.pos12 * on2 - on1).dot(normal1) }
    }
}

/// Which pair is asked for, if both shapes are solids; otherwise whether one is.
fn exact_pair<'s>(pos12: &'s Pose, g1: &dyn Shape, g2: &dyn Shape) -> Result<Option<ExactPair<'s>>, Unsupported> {
    match (g1.as_shape::<Solid>(), g2.as_shape::<Solid>()) {
        (Some(s1), Some(s2)) => {
            let is_flipped = s1.object > s2.object;
            let objects = [s1.object.min(s2.object), s1.object.max(s2.object)];
            Ok(Some(ExactPair { objects, is_flipped, pos12 }))
        }
        (None, None) => Ok(None),
        _ => Err(Unsupported),
    }
}

/// Parry's answer, unless a solid takes part.
macro_rules! parry {
    ($pos12:expr, $g1:expr, $g2:expr, $call:expr) => {
        match exact_pair($pos12, $g1, $g2)? {
            Some(_) => Err(Unsupported),
            None => $call,
        }
    };
}

impl QueryDispatcher for Dispatcher {
    fn intersection_test(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
    ) -> Result<ShapeIntersection, Unsupported> {
        let Some(pair) = exact_pair(pos12, g1, g2)? else {
            return DefaultQueryDispatcher.intersection_test(pos12, g1, g2);
        };
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        let meets = |g: &Group| {
            let [normal1, _] = pair.normals(g);
            table.points[g.points.clone()].iter().any(|p| pair.point(normal1, p).dist <= 0.0)
        };
        let intersecting = table.groups(pair.objects).iter().any(meets);
        Ok(ShapeIntersection { intersecting, subshape1: 0, subshape2: 0 })
    }

    fn distance(&self, pos12: &Pose, g1: &dyn Shape, g2: &dyn Shape) -> Result<ShapeDistance, Unsupported> {
        parry!(pos12, g1, g2, DefaultQueryDispatcher.distance(pos12, g1, g2))
    }

    fn contact(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
        prediction: Real,
    ) -> Result<Option<Contact>, Unsupported> {
        parry!(pos12, g1, g2, DefaultQueryDispatcher.contact(pos12, g1, g2, prediction))
    }

    fn closest_points(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
        max_dist: Real,
    ) -> Result<ClosestPoints, Unsupported> {
        parry!(pos12, g1, g2, DefaultQueryDispatcher.closest_points(pos12, g1, g2, max_dist))
    }

    fn cast_shapes(
        &self,
        pos12: &Pose,
        local_vel12: Vector,
        g1: &dyn Shape,
        g2: &dyn Shape,
        options: ShapeCastOptions,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        parry!(pos12, g1, g2, DefaultQueryDispatcher.cast_shapes(pos12, local_vel12, g1, g2, options))
    }

    fn cast_shapes_nonlinear(
        &self,
        motion1: &NonlinearRigidMotion,
        g1: &dyn Shape,
        motion2: &NonlinearRigidMotion,
        g2: &dyn Shape,
        start_time: Real,
        end_time: Real,
        stop_at_penetration: bool,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        let cast = || {
            DefaultQueryDispatcher.cast_shapes_nonlinear(
                motion1,
                g1,
                motion2,
                g2,
                start_time,
                end_time,
                stop_at_penetration,
            )
        };
        parry!(&Pose::IDENTITY, g1, g2, cast())
    }
}

impl<M, C> PersistentQueryDispatcher<M, C> for Dispatcher
where
    DefaultQueryDispatcher: PersistentQueryDispatcher<M, C>,
    M: Default,
    C: Default + Copy,
{
    fn contact_manifolds(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
        prediction: Real,
        manifolds: &mut Vec<ContactManifold<M, C>>,
        workspace: &mut Option<ContactManifoldsWorkspace>,
    ) -> Result<(), Unsupported> {
        let Some(pair) = exact_pair(pos12, g1, g2)? else {
            return DefaultQueryDispatcher.contact_manifolds(pos12, g1, g2, prediction, manifolds, workspace);
        };
        // What the solver left with each point goes on with its id, whichever manifold that is in now. Manifolds are never
        // removed: rapier remembers places in the list.
        let old: Vec<(PackedFeatureId, C)> =
            manifolds.iter_mut().flat_map(|m| m.points.drain(..).map(|p| (p.fid1, p.data))).collect();
        let table = self.table.read().unwrap_or_else(PoisonError::into_inner);
        for (k, group) in table.groups(pair.objects).iter().enumerate() {
            if k == manifolds.len() {
                manifolds.push(ContactManifold::with_data(0, 0, M::default()));
            }
            let manifold = &mut manifolds[k];
            [manifold.local_n1, manifold.local_n2] = pair.normals(group);
            for p in &table.points[group.points.clone()] {
                let seen = pair.point(manifold.local_n1, p);
                if seen.dist > prediction {
                    continue;
                }
                let mut contact = TrackedContact::new(seen.on1, seen.on2, seen.id, seen.id, seen.dist);
                if let Some((_, data)) = old.iter().find(|(id, _)| *id == seen.id) {
                    contact.data = *data;
                }
                manifold.points.push(contact);
            }
        }
        Ok(())
    }

    fn contact_manifold_convex_convex(
        &self,
        pos12: &Pose,
        g1: &dyn Shape,
        g2: &dyn Shape,
        normal_constraints1: Option<&dyn NormalConstraints>,
        normal_constraints2: Option<&dyn NormalConstraints>,
        prediction: Real,
        manifold: &mut ContactManifold<M, C>,
    ) -> Result<(), Unsupported> {
        let (c1, c2) = (normal_constraints1, normal_constraints2);
        let ask = |manifold| {
            DefaultQueryDispatcher.contact_manifold_convex_convex(pos12, g1, g2, c1, c2, prediction, manifold)
        };
        parry!(pos12, g1, g2, ask(manifold))
    }
}
