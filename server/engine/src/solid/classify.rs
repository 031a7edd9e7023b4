//! f of a whole tree at a point.

use crate::math::halt;
use crate::solid::{Node, NodeId, Op, Solid};
use glam::DVec3;

impl Op {
    /// f of an operation from the values of its operands, in order.
    pub fn value(self, mut values: impl Iterator<Item = f64>) -> f64 {
        match self {
            Op::Union => values.fold(f64::INFINITY, f64::min),
            Op::Intersection => values.fold(f64::NEG_INFINITY, f64::max),
            Op::Difference => {
                let first = values.next().unwrap_or(f64::INFINITY);
                values.fold(first, |m, v| m.max(-v))
            }
        }
    }
}

impl Solid {
    /// f at `x` (model frame): negative inside, positive outside, 0 on the surface and on internal seams; 1-Lipschitz.
    /// An empty solid has f = +infinity.
    pub fn value(&self, x: DVec3) -> f64 {
        self.value_of(self.root, x)
    }

    /// f of the subtree under `node` at `x`.
    pub fn value_of(&self, node: NodeId, x: DVec3) -> f64 {
        match &self.nodes[node as usize] {
            Node::Empty => f64::INFINITY,
            Node::Primitive(p) => {
                halt::work(1);
                self.primitives[*p as usize].value(x)
            }
            Node::Op(op, children) => op.value(children.iter().map(|c| self.value_of(*c, x))),
        }
    }
}
