//! A solid as a union of parts, each a convex primitive less others, where it is one.
//!
//! A difference takes its holes from every part of its first operand. So the holes of one difference stand together in a
//! group, a part names the group nearest to it, and a group the one of the difference around its own: however many parts
//! share them, each hole is kept once.
//!
//! Of a solid that is no such union as a whole the part within a region may be: what has no say there is left out.
//!
//! Invariant: the same holes in the same order as if each part had a list of its own, inner differences first.

use crate::math::{Aabb, Ball, BallTree};
use crate::solid::{Node, NodeId, Op, Primitive, Solid};
use glam::DVec3;
use smallvec::SmallVec;

/// Some holes of a part.
pub type Holes<'s> = SmallVec<[&'s Primitive; 4]>;

/// Parts of one solid that are looked through.
const MOST_PARTS: usize = 256;
/// Holes of a group up to which a scan finds the deepest as fast as a tree.
const FEW_HOLES: usize = 32;

/// A convex primitive less some others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PiercedPart {
    /// Index of the primitive.
    pub main: u32,
    /// The innermost group of holes.
    holes: Option<u32>,
}

impl PiercedPart {
    /// True when something is subtracted from it.
    pub fn is_pierced(&self) -> bool {
        self.holes.is_some()
    }
}

/// What one difference subtracts.
#[derive(Clone, Debug)]
struct Group {
    /// Indices of the primitives; at least one.
    holes: Vec<u32>,
    /// Of many: a tree of their balls.
    tree: Option<BallTree>,
    /// The group of the next difference around.
    outer: Option<u32>,
}

/// The parts of which a solid is the union.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    parts: Vec<PiercedPart>,
    groups: Vec<Group>,
}

impl Parts {
    /// The parts of a solid; `None` where it is no union of such, or of more than are looked through.
    pub fn of(solid: &Solid) -> Option<Self> {
        let mut parts = Self::default();
        parts.take(&Seen { solid, has_say: &|_| true, fills: false }, solid.root, None)?;
        Some(parts)
    }

    /// The parts of what the nodes for which `has_say` holds leave of a solid; others have neither material nor holes. Subtracted
    /// operands that are no unions of convex primitives are filled: the parts hold the solid there, and may hold more.
    pub fn within(solid: &Solid, has_say: &impl Fn(NodeId) -> bool) -> Option<Self> {
        let mut parts = Self::default();
        parts.take(&Seen { solid, has_say, fills: true }, solid.root, None)?;
        Some(parts)
    }

    /// All parts, in the tree's order.
    pub fn all(&self) -> &[PiercedPart] {
        &self.parts
    }

    /// True when some part is pierced.
    pub fn are_pierced(&self) -> bool {
        !self.groups.is_empty()
    }

    /// The hole of a part that a point is deepest in, or else nearest to; the first of equals. Of thousands most are dropped by
    /// their balls.
    pub fn deepest<'s>(&self, solid: &'s Solid, part: PiercedPart, point: DVec3) -> Option<&'s Primitive> {
        // Value, place in the part's order, index.
        let mut best: Option<(f64, u32, u32)> = None;
        let mut before = 0;
        for group in self.groups_of(part) {
            let mut look = |i: u32| {
                let (place, index) = (before + i, group.holes[i as usize]);
                let hole = &solid.primitives[index as usize];
                let reach = best.map_or(f64::INFINITY, |b| b.0.max(0.0));
                let within = hole.ball.radius + reach;
                if (point - hole.ball.center).length_squared() < within * within {
                    let value = hole.value(point);
                    if best.is_none_or(|b| value < b.0 || value == b.0 && place < b.1) {
                        best = Some((value, place, index));
                        return value.max(0.0);
                    }
                }
                reach
            };
            match &group.tree {
                Some(tree) => tree.visit(point, &mut look),
                None => (0..group.holes.len() as u32).for_each(|i| _ = look(i)),
            }
            before += group.holes.len() as u32;
        }
        best.map(|(_, _, index)| &solid.primitives[index as usize])
    }

    /// The hole of a part that a point is deepest in, or else nearest to, and before others that hold it, at most `most` in all.
    pub fn holes_at<'s>(&self, solid: &'s Solid, part: PiercedPart, point: DVec3, most: usize) -> Holes<'s> {
        let mut found: Holes = self.deepest(solid, part, point).into_iter().collect();
        if found.len() >= most {
            return found;
        }
        for group in self.groups_of(part) {
            let mut look = |i: u32| {
                let hole = &solid.primitives[group.holes[i as usize] as usize];
                let holds = found.len() < most && hole.value(point) < 0.0;
                if holds && !found.iter().any(|other| std::ptr::eq(*other, hole)) {
                    found.push(hole);
                }
                0.0
            };
            match &group.tree {
                Some(tree) => tree.visit(point, &mut look),
                None => (0..group.holes.len() as u32).for_each(|i| _ = look(i)),
            }
        }
        found
    }

    /// The holes of a part whose boxes meet a box, inner differences first; `None` where there are more than `most`.
    pub fn holes_within<'s>(
        &self,
        solid: &'s Solid,
        part: PiercedPart,
        within: &Aabb,
        most: usize,
    ) -> Option<Holes<'s>> {
        let (mut found, mut are_few) = (Holes::new(), true);
        let (center, reach) = (within.center(), within.half().length());
        for group in self.groups_of(part) {
            let mut look = |i: u32| {
                let hole = &solid.primitives[group.holes[i as usize] as usize];
                if are_few && hole.aabb.meets(within) {
                    are_few = found.len() < most;
                    found.push(hole);
                }
                reach
            };
            match &group.tree {
                Some(tree) if reach.is_finite() => tree.visit(center, &mut look),
                _ => (0..group.holes.len() as u32).for_each(|i| _ = look(i)),
            }
        }
        are_few.then_some(found)
    }

    /// Groups of holes of a part, the inner ones first.
    fn groups_of(&self, part: PiercedPart) -> impl Iterator<Item = &Group> {
        let group = |g: Option<u32>| g.map(|g| &self.groups[g as usize]);
        std::iter::successors(group(part.holes), move |g| group(g.outer))
    }

    /// Adds the parts below a node, from which the holes of `outer` are taken.
    fn take<S: Fn(NodeId) -> bool>(&mut self, seen: &Seen<S>, node: NodeId, outer: Option<u32>) -> Option<()> {
        let solid = seen.solid;
        if !(seen.has_say)(node) {
            return Some(());
        }
        match &solid.nodes[node as usize] {
            Node::Primitive(p) if self.parts.len() < MOST_PARTS && has_no_formula(solid, *p) => {
                self.parts.push(PiercedPart { main: *p, holes: outer });
            }
            Node::Op(Op::Union, children) => children.iter().try_for_each(|c| self.take(seen, *c, outer))?,
            Node::Op(Op::Difference, children) => {
                let (first, rest) = children.split_first()?;
                let mut holes = Vec::new();
                for c in rest {
                    if convex(seen, *c, &mut holes).is_none() && !seen.fills {
                        return None;
                    }
                }
                let group = if holes.is_empty() { outer } else { Some(self.add(solid, holes, outer)) };
                self.take(seen, *first, group)?;
            }
            Node::Primitive(_) | Node::Op(Op::Intersection, _) | Node::Empty => return None,
        }
        Some(())
    }

    fn add(&mut self, solid: &Solid, holes: Vec<u32>, outer: Option<u32>) -> u32 {
        let ball = |h: &u32| solid.primitives[*h as usize].ball;
        let many = holes.len() > FEW_HOLES;
        let tree = many.then(|| BallTree::new(&holes.iter().map(ball).collect::<Vec<Ball>>()));
        self.groups.push(Group { holes, tree, outer });
        self.groups.len() as u32 - 1
    }
}

/// A solid with the nodes that have a say.
struct Seen<'s, S> {
    solid: &'s Solid,
    has_say: &'s S,
    /// Holes of other kinds are filled.
    fills: bool,
}

/// The convex primitives of which a subtracted node is the union; holes in it would be material.
fn convex<S: Fn(NodeId) -> bool>(seen: &Seen<S>, node: NodeId, out: &mut Vec<u32>) -> Option<()> {
    let solid = seen.solid;
    if !(seen.has_say)(node) {
        return Some(());
    }
    match &solid.nodes[node as usize] {
        Node::Primitive(p) if has_no_formula(solid, *p) => out.push(*p),
        Node::Op(Op::Union, children) => children.iter().try_for_each(|c| convex(seen, *c, out))?,
        Node::Primitive(_) | Node::Op(..) | Node::Empty => return None,
    }
    Some(())
}

/// True for an intersection of faces, the kind of primitive that parts are made of.
fn has_no_formula(solid: &Solid, primitive: u32) -> bool {
    solid.primitives[primitive as usize].shape.formula().is_none()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use crate::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
    use crate::solid::{Label, SolidBuilder};
    use contactd_proto::Pose;
    use contactd_proto::motion::quat_of_rotation_vector;

    fn holes(parts: &Parts, part: usize) -> Vec<u32> {
        parts.groups_of(parts.all()[part]).flat_map(|g| g.holes.iter().copied()).collect()
    }

    fn ball(b: &mut SolidBuilder) -> NodeId {
        b.primitive(Sphere { radius: 1.0 }, Pose::IDENTITY, Label::default())
    }

    #[test]
    fn a_part_has_the_holes_of_every_difference_around_it_and_each_is_kept_once() {
        let mut b = SolidBuilder::new();
        // (0 ∪ (1 − 2 − (3 ∪ 4))) − 5
        let [n0, n1, n2, n3, n4, n5] = [(); 6].map(|()| ball(&mut b));
        let two = b.operation(Op::Union, &[n3, n4]);
        let inner = b.operation(Op::Difference, &[n1, n2, two]);
        let union = b.operation(Op::Union, &[n0, inner]);
        let root = b.operation(Op::Difference, &[union, n5]);
        let parts = Parts::of(&b.finish(root)).expect("a union");
        assert_eq!(parts.all().iter().map(|p| p.main).collect::<Vec<_>>(), [0, 1]);
        assert_eq!((holes(&parts, 0), holes(&parts, 1)), (vec![5], vec![2, 3, 4, 5]));
        assert_eq!(parts.groups.iter().map(|g| g.holes.len()).sum::<usize>(), 4);
        assert!(parts.are_pierced() && parts.all().iter().all(PiercedPart::is_pierced));
    }

    #[test]
    fn what_is_no_union_of_parts_has_none() {
        let of = |make: &dyn Fn(&mut SolidBuilder) -> NodeId| {
            let mut b = SolidBuilder::new();
            let root = make(&mut b);
            Parts::of(&b.finish(root))
        };
        let two = |b: &mut SolidBuilder, op: Op| {
            let operands = [ball(b), ball(b)];
            b.operation(op, &operands)
        };
        assert!(of(&|b| two(b, Op::Intersection)).is_none());
        assert!(of(&|b| b.empty()).is_none());
        let drilled_drill = |b: &mut SolidBuilder| {
            let operands = [ball(b), two(b, Op::Difference)];
            b.operation(Op::Difference, &operands)
        };
        assert!(of(&drilled_drill).is_none());
        let union = |b: &mut SolidBuilder, count: usize| {
            let operands: Vec<NodeId> = (0..count).map(|_| ball(b)).collect();
            b.operation(Op::Union, &operands)
        };
        assert!(of(&|b| union(b, MOST_PARTS + 1)).is_none());
        let most = of(&|b| union(b, MOST_PARTS)).expect("not too many");
        assert!(most.all().len() == MOST_PARTS && !most.are_pierced());
    }

    /// A block less holes of three kinds at random places, from `inner` of which its first half is taken before.
    fn sieve(r: &mut Random, count: usize, inner: usize) -> Solid {
        let size = (count as f64).cbrt();
        let mut b = SolidBuilder::new();
        let block = b.primitive(Cuboid { half: DVec3::splat(size) }, Pose::IDENTITY, Label::default());
        let holes: Vec<NodeId> = (0..count)
            .map(|i| {
                let frame = Pose::new(r.vector(size), quat_of_rotation_vector(r.vector(2.0)));
                let (radius, half_height) = (r.within(0.1, 0.4), r.within(0.1, 0.6));
                match i % 3 {
                    0 => b.primitive(Cylinder { radius, half_height }, frame, Label::default()),
                    1 => b.primitive(Cone { bottom: radius, top: 0.0, half_height }, frame, Label::default()),
                    _ => b.primitive(Sphere { radius }, frame, Label::default()),
                }
            })
            .collect();
        let mut root = block;
        for some in [&holes[..inner], &holes[inner..]] {
            root = b.operation(Op::Difference, &[&[root], some].concat());
        }
        b.finish(root)
    }

    #[test]
    fn the_deepest_hole_is_that_of_a_scan() {
        let mut r = Random(21);
        for (count, inner) in [(1, 0), (20, 5), (100, 0), (100, 10), (3000, 40), (3000, 1500)] {
            let solid = sieve(&mut r, count, inner);
            let parts = Parts::of(&solid).expect("one block");
            let part = parts.all()[0];
            let all = holes(&parts, 0);
            assert_eq!(all, (1..=count as u32).collect::<Vec<_>>());
            let (mut within, mut same) = (0, 0);
            for _ in 0..500 {
                let point = r.vector(1.3 * (count as f64).cbrt());
                let found = parts.deepest(&solid, part, point).expect("a hole");
                let value = found.value(point);
                // What is nearer as its faces have it lies beyond by its ball.
                let dropped = |p: &Primitive| (point - p.ball.center).length() >= p.ball.radius + value.max(0.0);
                let scan = all.iter().map(|h| &solid.primitives[*h as usize]);
                assert!(scan.clone().all(|p| p.value(point) >= value || dropped(p)));
                let least = scan.map(|p| p.value(point)).fold(f64::INFINITY, f64::min);
                within += usize::from(value <= 0.0);
                same += usize::from(least == value);
                // Inside of one it is the deepest of all.
                assert!(least > 0.0 || value == least);
            }
            println!("{count} holes: {within} of 500 points in one, {same} the least of all");
        }
    }
}
