//! A bounding volume hierarchy over the facets of a mesh: boxes halved down to a few facets.
//!
//! Boxes are kept in single precision about the middle of the mesh, rounded outwards. The tree is made when somebody first asks for
//! it, and is the same whoever asks.

use crate::math::Aabb;
use glam::DVec3;
use rayon::prelude::*;

/// Facets up to which a box is not halved.
const FEW: usize = 4;
/// Facets from which on two halves are made side by side.
const SHARED: usize = 8192;
/// A half that has no more than this part of the facets is too small: they are halved by number then.
const LEAST: f64 = 1.0 / 16.0;
/// Coordinates beyond which boxes in single precision tell nothing.
const LARGEST: f64 = 1e30;

/// A box of the tree.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// The first of two halves that stand side by side, or of the facets.
    first: u32,
    /// How many facets; 0 of a box that is halved.
    count: u32,
}

/// What a place of the tree is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Below<'t> {
    /// Two halves, by their places.
    Halves([u32; 2]),
    /// Facets, by their numbers.
    Facets(&'t [u32]),
}

/// Boxes over the facets of a mesh.
#[derive(Debug)]
pub struct FacetTree {
    middle: DVec3,
    nodes: Vec<Node>,
    order: Vec<u32>,
    shells: Vec<DVec3>,
}

/// A facet with its box, about the middle.
#[derive(Clone, Copy)]
struct Boxed {
    low: [f32; 3],
    high: [f32; 3],
    facet: u32,
}

impl Boxed {
    /// Twice the middle of the box along an axis.
    fn at(&self, k: usize) -> f32 {
        self.low[k] + self.high[k]
    }
}

/// No larger, and what double precision may have left.
fn below(x: f64) -> f32 {
    (x as f32).next_down()
}

/// No smaller, likewise.
fn above(x: f64) -> f32 {
    (x as f32).next_up()
}

impl FacetTree {
    /// The tree of a mesh; `None` of one whose coordinates are too large for it.
    pub(super) fn of(vertices: &[DVec3], triangles: &[[u32; 3]], around: &Aabb) -> Option<Self> {
        let middle = around.center();
        if around.min.abs().max(around.max.abs()).max_element() >= LARGEST {
            return None;
        }
        let boxed = |facet: u32| {
            let corners = triangles[facet as usize].map(|v| vertices[v as usize] - middle);
            let low = corners[0].min(corners[1]).min(corners[2]).to_array().map(below);
            let high = corners[0].max(corners[1]).max(corners[2]).to_array().map(above);
            Boxed { low, high, facet }
        };
        let count = triangles.len() as u32;
        let mut all: Vec<Boxed> = (0..count).into_par_iter().map(boxed).collect();
        let (nodes, shells) = rayon::join(|| grown(&mut all, 0), || shells(vertices, triangles));
        Some(Self { middle, nodes, order: all.into_iter().map(|b| b.facet).collect(), shells })
    }

    /// The place of the box around all of the mesh.
    pub const ROOT: u32 = 0;

    /// The box of a place, by its centre and half extents.
    #[inline]
    pub fn around(&self, place: u32) -> (DVec3, DVec3) {
        let node = &self.nodes[place as usize];
        let (low, high) = (DVec3::from(node.low.map(f64::from)), DVec3::from(node.high.map(f64::from)));
        (self.middle + 0.5 * (low + high), 0.5 * (high - low))
    }

    /// What is below a place.
    #[inline]
    pub fn below(&self, place: u32) -> Below<'_> {
        let node = &self.nodes[place as usize];
        match node.count {
            0 => Below::Halves([node.first, node.first + 1]),
            count => Below::Facets(&self.order[node.first as usize..(node.first + count) as usize]),
        }
    }

    /// A corner of each part of the surface that is connected.
    pub fn shells(&self) -> &[DVec3] {
        &self.shells
    }

    /// Calls for each facet whose box comes within `reach` (a length) of a point.
    pub fn near(&self, x: DVec3, reach: f64, mut each: impl FnMut(u32)) {
        let mut stack = vec![Self::ROOT];
        while let Some(place) = stack.pop() {
            let (center, half) = self.around(place);
            if !((x - center).abs() - half).max(DVec3::ZERO).cmple(DVec3::splat(reach)).all() {
                continue;
            }
            match self.below(place) {
                Below::Halves(halves) => stack.extend(halves),
                Below::Facets(facets) => facets.iter().for_each(|f| each(*f)),
            }
        }
    }
}

/// The first corner of each part of the surface that facets connect.
fn shells(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut leader: Vec<u32> = (0..vertices.len() as u32).collect();
    fn find(leader: &mut [u32], mut i: u32) -> u32 {
        while leader[i as usize] != i {
            leader[i as usize] = leader[leader[i as usize] as usize];
            i = leader[i as usize];
        }
        i
    }
    for [a, b, c] in triangles {
        for (p, q) in [(*a, *b), (*b, *c)] {
            let (p, q) = (find(&mut leader, p), find(&mut leader, q));
            leader[p.max(q) as usize] = p.min(q);
        }
    }
    let first = leader.iter().enumerate().filter(|(i, l)| *i == **l as usize);
    first.map(|(i, _)| vertices[i]).collect()
}

/// The boxes over some facets, which are put in order; the first of them has the number `first` in the mesh's order.
fn grown(all: &mut [Boxed], first: u32) -> Vec<Node> {
    let mut root = Node { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3], first, count: all.len() as u32 };
    let (mut from, mut to) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for b in all.iter() {
        for k in 0..3 {
            root.low[k] = root.low[k].min(b.low[k]);
            root.high[k] = root.high[k].max(b.high[k]);
            from[k] = from[k].min(b.at(k));
            to[k] = to[k].max(b.at(k));
        }
    }
    if all.len() <= FEW {
        return vec![root];
    }
    let size = |k: usize| to[k] - from[k];
    let k = if size(0) >= size(1) && size(0) >= size(2) { 0 } else { 1 + usize::from(size(2) > size(1)) };
    let count = all.len();
    let at = halved(all, k, 0.5 * (from[k] + to[k]));
    let (low, high) = all.split_at_mut(at);
    let (mut of_low, mut of_high) = (|| grown(low, first), || grown(high, first + at as u32));
    let (low, high) = if count >= SHARED { rayon::join(of_low, of_high) } else { (of_low(), of_high()) };
    // The two halves stand side by side, then what is below the one and the other.
    let mut nodes = Vec::with_capacity(1 + low.len() + high.len());
    let behind = [3, 2 + low.len() as u32];
    let shifted = |n: &Node, by: u32| if n.count == 0 { Node { first: n.first + by - 1, ..*n } } else { *n };
    nodes.push(Node { first: 1, count: 0, ..root });
    nodes.push(shifted(&low[0], behind[0]));
    nodes.push(shifted(&high[0], behind[1]));
    nodes.extend(low[1..].iter().map(|n| shifted(n, behind[0])));
    nodes.extend(high[1..].iter().map(|n| shifted(n, behind[1])));
    nodes
}

/// Puts those up to the middle first; how many these are.
fn halved(all: &mut [Boxed], k: usize, middle: f32) -> usize {
    let mut at = 0;
    for i in 0..all.len() {
        if all[i].at(k) <= middle {
            all.swap(i, at);
            at += 1;
        }
    }
    let least = (LEAST * all.len() as f64) as usize;
    if at > least && all.len() - at > least {
        return at;
    }
    let half = all.len() / 2;
    all.select_nth_unstable_by(half, |a, b| a.at(k).total_cmp(&b.at(k)).then(a.facet.cmp(&b.facet)));
    half
}
