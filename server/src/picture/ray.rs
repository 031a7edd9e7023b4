//! Exact rays through CSG trees: where a line enters and leaves a solid, and through which face.
//!
//! Idea (S. Roth, "Ray casting for modeling solids", CGIP 18, 1982): a line meets a convex primitive in one span, cut out by
//! its faces, and a torus in two; the tree's operations then combine lists of spans. Planes give a half-line, spheres and
//! cylinders the two roots of a quadratic, the cone's nappe at most one span of its quadratic's sign.
//! Of a mesh those triangles are met that a tree of boxes leaves (`mesh`).
//! Invariant: spans are disjoint, ascending, none a skin (`THIN`).
//! Not promised: skins thinner than `THIN`, and rays that graze a face, may go either way. Pictures only.

use super::line::THIN;
pub use super::line::{Crossing, Ray, Span};
use super::mesh::Mesh;
use crate::math::Aabb;
use crate::solid::{Node, NodeId, Op, Primitive, Solid};
use glam::DVec3;

/// A solid prepared for rays: a box for every node, a tree of boxes for every mesh.
#[derive(Debug)]
pub struct Traced<'a> {
    /// The solid.
    pub solid: &'a Solid,
    boxes: Vec<Aabb>,
    /// Of each primitive that is one.
    meshes: Vec<Option<Mesh<'a>>>,
}

impl<'a> Traced<'a> {
    /// Prepares `solid`.
    pub fn new(solid: &'a Solid) -> Self {
        let mut boxes: Vec<Aabb> = Vec::with_capacity(solid.nodes.len());
        for node in &solid.nodes {
            boxes.push(match node {
                Node::Empty => Aabb::EMPTY,
                Node::Primitive(p) => solid.primitives[*p as usize].aabb,
                Node::Op(op, children) => {
                    let mut each = children.iter().map(|c| boxes[*c as usize]);
                    match op {
                        Op::Union => each.fold(Aabb::EMPTY, |a, b| a.union(&b)),
                        Op::Intersection => each.fold(Aabb::ALL, |a, b| a.intersection(&b)),
                        Op::Difference => each.next().unwrap_or(Aabb::EMPTY),
                    }
                }
            });
        }
        let prepared = |p: &'a Primitive| p.shape.geometry().facets().map(|facets| Mesh::new(p, facets));
        Self { solid, boxes, meshes: solid.primitives.iter().map(prepared).collect() }
    }

    /// The box of the whole solid.
    pub fn aabb(&self) -> Aabb {
        self.boxes[self.solid.root as usize]
    }

    /// The spans of `ray` (in the solid's frame) inside the solid, ascending: all ahead of its origin, and of those behind some.
    pub fn spans(&self, ray: &Ray) -> Vec<Span> {
        self.spans_of(self.solid.root, ray)
    }

    fn spans_of(&self, node: NodeId, ray: &Ray) -> Vec<Span> {
        if ray.through(&self.boxes[node as usize]).is_none() {
            return vec![];
        }
        match &self.solid.nodes[node as usize] {
            Node::Empty => vec![],
            Node::Primitive(p) => match &self.meshes[*p as usize] {
                Some(mesh) => mesh.spans(ray),
                None => spans_of_primitive(&self.solid.primitives[*p as usize], ray),
            },
            Node::Op(op, children) => {
                let mut lists: Vec<(usize, Vec<Span>)> = Vec::with_capacity(children.len());
                for (i, child) in children.iter().enumerate() {
                    let spans = self.spans_of(*child, ray);
                    if spans.is_empty() && (*op == Op::Intersection || (*op == Op::Difference && i == 0)) {
                        return vec![];
                    }
                    if !spans.is_empty() {
                        lists.push((i, spans));
                    }
                }
                match lists.len() {
                    1 => lists.swap_remove(0).1,
                    _ => combine(*op, children.len(), &lists),
                }
            }
        }
    }

    /// A lower bound of the distance from `x` (in the solid's frame) that is f where the solid is near, of meshes the distance, and
    /// some value of at least `reach` elsewhere.
    pub fn clearance(&self, x: DVec3, reach: f64) -> f64 {
        self.clearance_of(self.solid.root, x, reach)
    }

    fn clearance_of(&self, node: NodeId, x: DVec3, reach: f64) -> f64 {
        let b = &self.boxes[node as usize];
        let outside = (b.min - x).max(x - b.max).max(DVec3::ZERO).length();
        if outside >= reach {
            return outside;
        }
        match &self.solid.nodes[node as usize] {
            Node::Empty => f64::INFINITY,
            Node::Primitive(p) => match &self.meshes[*p as usize] {
                Some(mesh) => mesh.clearance(x, reach),
                None => self.solid.primitives[*p as usize].value(x),
            },
            Node::Op(op, children) => match op {
                Op::Union => children.iter().fold(f64::INFINITY, |m, c| m.min(self.clearance_of(*c, x, reach.min(m)))),
                Op::Intersection => {
                    children.iter().fold(f64::NEG_INFINITY, |m, c| m.max(self.clearance_of(*c, x, reach)))
                }
                Op::Difference => {
                    let first = self.clearance_of(children[0], x, reach);
                    children[1..].iter().fold(first, |m, c| m.max(-self.clearance_of(*c, x, reach)))
                }
            },
        }
    }
}

/// The spans of a ray inside a primitive: what all of its faces' stretches have in common. One of a convex one.
fn spans_of_primitive(primitive: &Primitive, ray: &Ray) -> Vec<Span> {
    let enter = Crossing { at: f64::NEG_INFINITY, face: 0, outward: true };
    let mut spans = vec![(enter, Crossing { at: f64::INFINITY, ..enter })];
    for (i, face) in primitive.faces.iter().enumerate() {
        let id = primitive.first_face + i as u32;
        let stretches = face.inside(ray.origin, ray.direction);
        let cut = |(enter, leave): &Span| {
            let (first, last) = (*enter, *leave);
            stretches.iter().map(move |&(from, to)| {
                let (mut enter, mut leave) = (first, last);
                if from > enter.at {
                    enter = Crossing { at: from, face: id, outward: true };
                }
                if to < leave.at {
                    leave = Crossing { at: to, face: id, outward: true };
                }
                (enter, leave)
            })
        };
        spans = match (spans.as_slice(), stretches.as_slice()) {
            (_, []) => return vec![],
            (all, _) => all.iter().flat_map(cut).filter(|(enter, leave)| enter.at < leave.at).collect(),
        };
    }
    spans.retain(|(enter, leave)| leave.at - enter.at > THIN * enter.at.abs().min(leave.at.abs()));
    spans
}

/// Combines the spans of several children; children without spans are left out of `lists` but counted in `arity`.
fn combine(op: Op, arity: usize, lists: &[(usize, Vec<Span>)]) -> Vec<Span> {
    let mut events: Vec<(Crossing, bool, bool)> = Vec::new();
    for (child, spans) in lists {
        let subtracted = op == Op::Difference && *child > 0;
        for (enter, leave) in spans {
            events.push((*enter, true, subtracted));
            events.push((*leave, false, subtracted));
        }
    }
    events.sort_by(|a, b| a.0.at.total_cmp(&b.0.at));
    let (mut kept, mut cut) = (0, 0);
    let mut spans: Vec<Span> = Vec::new();
    let mut open: Option<Crossing> = None;
    for (crossing, entering, subtracted) in events {
        let counter = if subtracted { &mut cut } else { &mut kept };
        if entering {
            *counter += 1;
        } else {
            *counter -= 1;
        }
        let inside = match op {
            Op::Union => kept > 0,
            Op::Intersection => kept == arity,
            Op::Difference => kept > 0 && cut == 0,
        };
        let crossing = Crossing { outward: crossing.outward != subtracted, ..crossing };
        match (inside, open) {
            (true, None) => open = Some(crossing),
            (false, Some(enter)) => {
                open = None;
                if crossing.at - enter.at > THIN * crossing.at.abs() {
                    spans.push((enter, crossing));
                }
            }
            _ => {}
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
    use crate::solid::{Label, SolidBuilder};
    use contactd_proto::Pose;

    /// Deterministic numbers in −1..1.
    fn noise(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    #[test]
    fn spans_hold_exactly_the_points_where_f_is_negative() {
        let mut b = SolidBuilder::new();
        let label = Label::default;
        let tilt = glam::DQuat::from_xyzw(0.1, 0.5, -0.3, 0.8).normalize();
        let block = b.primitive(Cuboid { half: DVec3::new(2.0, 1.5, 1.0) }, Pose::IDENTITY, label());
        let dome = b.primitive(Sphere { radius: 1.2 }, Pose::at(DVec3::new(0.5, 0.0, 1.0)), label());
        let body = b.operation(Op::Union, &[block, dome]);
        let hole = b.primitive(Cylinder { radius: 0.6, half_height: 3.0 }, Pose::new(DVec3::X * 0.4, tilt), label());
        let sink = b.primitive(
            Cone { bottom: 0.2, top: 1.0, half_height: 0.7 },
            Pose::at(DVec3::new(-1.0, 0.0, 0.8)),
            label(),
        );
        let ring = b.primitive(
            crate::solid::primitive::Torus { major: 1.1, minor: 0.25 },
            Pose::new(DVec3::new(1.0, 0.5, -0.8), tilt),
            label(),
        );
        let spike =
            b.primitive(Cone { bottom: 0.8, top: 0.0, half_height: 1.5 }, Pose::new(DVec3::NEG_X, tilt), label());
        let drilled = b.operation(Op::Difference, &[body, hole, sink]);
        let root = b.operation(Op::Union, &[drilled, spike, ring]);
        let solid = b.finish(root);
        let traced = Traced::new(&solid);
        let mut state = 7;
        let (mut inside, mut crossings) = (0, 0);
        for _ in 0..3000 {
            let mut next = || DVec3::new(noise(&mut state), noise(&mut state), noise(&mut state));
            let (origin, target) = (next() * 6.0, next() * 1.5);
            let ray = Ray { origin, direction: (target - origin).normalize() };
            let spans = traced.spans(&ray);
            for i in 0..60 {
                let t = i as f64 * 0.2 + 0.05;
                let f = solid.value(ray.at(t));
                let in_span = spans.iter().any(|(a, b)| a.at <= t && t <= b.at);
                inside += in_span as usize;
                assert!(f.abs() < 1e-7 || in_span == (f < 0.0), "t = {t}, f = {f}, {spans:?}");
            }
            for c in spans.iter().flat_map(|(a, b)| [a, b]) {
                let x = ray.at(c.at);
                let normal = solid.faces[c.face as usize].at(x).normal * if c.outward { 1.0 } else { -1.0 };
                assert!(solid.value(x).abs() < 1e-9);
                let step = 1e-5;
                let grows = solid.value(x + normal * step) - solid.value(x - normal * step);
                crossings += 1;
                // At an edge another face may rule; then f still does not shrink along the normal.
                assert!(grows > -1e-9, "normal points inwards at {x}");
            }
        }
        assert!(inside > 5_000 && crossings > 3_000, "{inside} {crossings}");
    }

    #[test]
    fn a_mesh_has_the_spans_of_the_solid_that_it_is() {
        // A brick with a step, as a mesh of six walls and of an L of two cuboids.
        let outline = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        let points: Vec<DVec3> =
            [0.0, 1.0].iter().flat_map(|z| outline.iter().map(move |(x, y)| DVec3::new(*x, *y, *z))).collect();
        let mut faces: Vec<Vec<u32>> = vec![(0..6).rev().collect(), (6..12).collect()];
        faces.extend((0..6).map(|i| vec![i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i]));
        let (mesh, _) = crate::solid::primitive::TriangleMesh::of_polygons(&points, faces.iter().map(Vec::as_slice))
            .expect("a closed mesh");
        let tilt = glam::DQuat::from_xyzw(0.1, 0.5, -0.3, 0.8).normalize();
        let pose = |at: DVec3| Pose::new(tilt * at, tilt);
        let mut b = SolidBuilder::new();
        let root = b.primitive(mesh, pose(DVec3::ZERO), Label::default());
        let of_mesh = b.finish(root);
        let mut b = SolidBuilder::new();
        let long =
            b.primitive(Cuboid { half: DVec3::new(1.0, 0.5, 0.5) }, pose(DVec3::new(1.0, 0.5, 0.5)), Label::default());
        let high =
            b.primitive(Cuboid { half: DVec3::new(0.5, 1.0, 0.5) }, pose(DVec3::new(0.5, 1.0, 0.5)), Label::default());
        let root = b.operation(Op::Union, &[long, high]);
        let of_cuboids = b.finish(root);
        let (one, other) = (Traced::new(&of_mesh), Traced::new(&of_cuboids));
        let (mut state, mut hits) = (3, 0);
        for _ in 0..2000 {
            let mut next = || DVec3::new(noise(&mut state), noise(&mut state), noise(&mut state));
            let (origin, target) = (next() * 6.0, tilt * (next() * 1.2 + DVec3::new(1.0, 1.0, 0.5)));
            let ray = Ray { origin, direction: (target - origin).normalize() };
            let [a, b] = [&one, &other].map(|traced| {
                // What lies ahead of the origin.
                let mut spans = traced.spans(&ray);
                spans.retain(|(_, leave)| leave.at > 0.0);
                spans.iter_mut().for_each(|(enter, _)| enter.at = enter.at.max(0.0));
                spans
            });
            assert_eq!(a.len(), b.len(), "{a:?} {b:?}");
            for ((enter, leave), (enter_too, leave_too)) in a.iter().zip(&b) {
                assert!((enter.at - enter_too.at).abs() < 1e-9 && (leave.at - leave_too.at).abs() < 1e-9);
                for (c, entering) in [(enter, true), (leave, false)].into_iter().filter(|c| c.0.at > 0.0) {
                    let normal =
                        of_mesh.faces[c.face as usize].at(ray.at(c.at)).normal * if c.outward { 1.0 } else { -1.0 };
                    assert!((normal.dot(ray.direction) < 0.0) == entering);
                }
                hits += 1;
            }
        }
        assert!(hits > 800, "{hits}");
    }
}
