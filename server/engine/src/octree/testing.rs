//! Models for the tests of this floor and those above.

use super::Model;
use crate::math::random::Random;
use crate::solid::primitive::{Cuboid, Cylinder, Sphere};
use crate::solid::{Label, NodeId, Op, Shape, SolidBuilder};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use glam::DVec3;

/// One primitive in its own frame.
pub fn simple(shape: impl Into<Shape>) -> Model {
    pierced(shape, Vec::new())
}

/// A primitive in its own frame less others.
pub fn pierced(outer: impl Into<Shape>, holes: Vec<(Shape, Pose)>) -> Model {
    let mut b = SolidBuilder::new();
    let outer = b.primitive(outer, Pose::IDENTITY, Label::default());
    if holes.is_empty() {
        return Model::new(b.finish(outer));
    }
    let mut all = vec![outer];
    all.extend(holes.into_iter().map(|(shape, at)| b.primitive(shape, at, Label::default())));
    let root = b.operation(Op::Difference, &all);
    Model::new(b.finish(root))
}

/// A tree of some depth, its operations nested at random: alternatives within alternatives.
fn tree(b: &mut SolidBuilder, r: &mut Random, depth: u32) -> NodeId {
    if depth == 0 {
        let shape = match r.within(0.0, 3.0) as u32 {
            0 => Shape::from(Cuboid { half: DVec3::new(r.within(0.2, 0.8), r.within(0.2, 0.8), r.within(0.2, 0.8)) }),
            1 => Shape::from(Cylinder { radius: r.within(0.2, 0.6), half_height: r.within(0.2, 0.8) }),
            _ => Shape::from(Sphere { radius: r.within(0.3, 0.8) }),
        };
        let pose = Pose::new(r.vector(0.6), quat_of_rotation_vector(r.vector(2.0)));
        return b.primitive(shape, pose, Label::default());
    }
    let children: Vec<NodeId> = (0..2 + r.within(0.0, 2.0) as u32).map(|_| tree(b, r, depth - 1)).collect();
    let op = [Op::Union, Op::Intersection, Op::Difference][r.within(0.0, 3.0) as usize];
    b.operation(op, &children)
}

/// The model of such a tree.
pub fn random_tree(r: &mut Random, depth: u32) -> Model {
    let mut b = SolidBuilder::new();
    let root = tree(&mut b, r, depth);
    Model::new(b.finish(root))
}
