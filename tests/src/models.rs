//! Models whose right answers can be worked out by hand.

use contactd::octree::Model;
use contactd::solid::{Label, Op, Shape, SolidBuilder};
use contactd_proto::Pose;

/// One primitive in its own frame.
pub fn simple(shape: impl Into<Shape>) -> Model {
    pierced(shape, Vec::new())
}

/// A primitive in its own frame less others, each at its pose.
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
