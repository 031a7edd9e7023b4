//! A tree of boxes, halved by number.

use crate::math::Aabb;

/// Boxes up to which one is not halved.
const FEW: usize = 4;

/// Boxes around boxes.
pub struct Boxes {
    /// Of each node its box, and what is below: two nodes that stand side by side, or a part of the order.
    nodes: Vec<(Aabb, Below)>,
    order: Vec<u32>,
}

#[derive(Clone, Copy)]
enum Below {
    Halves(usize),
    Some(usize, usize),
}

impl Boxes {
    /// The tree of some boxes, which are told by their numbers.
    pub fn of(all: &[Aabb]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..all.len() as u32).collect() };
        tree.nodes.push((Aabb::EMPTY, Below::Some(0, 0)));
        let mut stack = vec![(0, 0, all.len())];
        while let Some((node, from, to)) = stack.pop() {
            let part = &mut tree.order[from..to];
            let around = part.iter().fold(Aabb::EMPTY, |b, i| b.union(&all[*i as usize]));
            if part.len() <= FEW {
                tree.nodes[node] = (around, Below::Some(from, to));
                continue;
            }
            let size = around.half();
            let k = (0..3).fold(0, |most, k| if size[k] > size[most] { k } else { most });
            let middle = |i: &u32| all[*i as usize].min[k] + all[*i as usize].max[k];
            let half = part.len() / 2;
            part.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
            let first = tree.nodes.len();
            tree.nodes[node] = (around, Below::Halves(first));
            tree.nodes.extend([(Aabb::EMPTY, Below::Some(0, 0)); 2]);
            stack.extend([(first, from, from + half), (first + 1, from + half, to)]);
        }
        tree
    }

    /// Calls for each box below nodes whose boxes are `wanted`.
    pub fn visit(&self, wanted: impl Fn(&Aabb) -> bool, mut each: impl FnMut(u32)) {
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            let (around, below) = &self.nodes[node];
            if !wanted(around) {
                continue;
            }
            match *below {
                Below::Halves(first) => stack.extend([first, first + 1]),
                Below::Some(from, to) => self.order[from..to].iter().for_each(|i| each(*i)),
            }
        }
    }
}
