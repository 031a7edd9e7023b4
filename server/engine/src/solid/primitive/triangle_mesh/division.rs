//! The formula of a mesh of very many facets: a tree of cells that overlap, as in `cells`, whose leaves are written out when
//! somebody looks there.
//!
//! The tree is all that is made at load, by the facets' boxes. A cell with many facets is divided across its longest side:
//! (x <= s + w and L) or (x >= s − w and R). The planes x = s ± w are faces of the primitive that bound nothing; their numbers follow
//! from that of the cell. A cell that no facet reaches is inside or outside as a whole, which `side` decides exactly. A cell
//! with few facets is a part: its formula (`local`) is made of the facets that reach it when it is asked for, and is the same
//! whoever asks.
//!
//! At load every pair of facets that share a cell is looked at (`apart`): where one runs through the other the mesh is refused.
//! Where they are only near each other, or thin, the formula of the cell is made at once and checked as in `cells`: it is 0 on
//! the facets and rises outwards through them. Where it is not, the cell is divided further, and the mesh is refused in the end. A
//! part that fails the check later, far from all such places, counts as solid: a contact may be told too early there, never too
//! late.

use super::MeshFault;
use super::apart::{self, Facet, FacetPair, pair};
use super::cells::{self, checked};
use super::edges::NONE;
use super::local::{Expr, Local};
use super::piece::Piece;
use super::planes::area;
use super::side::crosses;
use super::surface::Surface;
use crate::math::{Aabb, halt};
use crate::solid::faces::Planes;
use crate::solid::formula::{Division, Part, Place};
use crate::solid::local::Span;
use crate::solid::surface::Plane;
use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;
use std::sync::{Arc, OnceLock};

/// Planes up to which a cell is a part …
const FEW_PLANES: usize = 12;
/// … and facets.
const FEW_FACETS: usize = 32;
/// Divisions in a row that leave as many facets in a cell: they all meet in one corner then.
const STALLED: u32 = 9;
/// Facets of such a corner.
const MOST_FACETS: usize = 5_000;
/// Tokens of the formula of a part.
const MOST_TOKENS: usize = 400_000;
/// Half the overlap of two cells, as a fraction of the one that they were.
const OVERLAP: f64 = 1.0 / 128.0;
/// Places that are tried for a division, for one that keeps clear of corners.
const PLACES: usize = 9;
/// Facets up to which corners are looked at for that: of more the odds are that one is near anyway.
const LOOKED_AT: usize = 256;
/// Facets from which on two halves are divided side by side.
const SHARED: usize = 4096;
/// Times that a facet is in a part, on average, at most.
const MOST_TIMES: usize = 64;
/// Part of a cell's size below which a box is small beside it: only then the formula of a part is asked for bounds.
const SMALL: f64 = 0.25;

/// Kinds of a place, in the upper bits of its number.
const KIND: u32 = 3 << 30;
const PART: u32 = 1 << 30;
const OUT: u32 = 2 << 30;
const IN: u32 = 3 << 30;
/// Of a parent: the upper half.
const UPPER: u32 = 1 << 31;

#[derive(Clone, Copy, Debug)]
struct Node {
    s: f64,
    w: f64,
    halves: [u32; 2],
    parent: u32,
    axis: u8,
}

impl Node {
    /// Offsets of its planes along +axis and −axis.
    fn offsets(&self) -> [f64; 2] {
        [self.s + self.w, self.w - self.s]
    }
}

#[derive(Clone, Copy, Debug)]
struct Leaf {
    from: u32,
    to: u32,
    parent: u32,
}

/// What is grown side by side: trees under divisions.
enum Grown {
    /// With its top.
    Tree(Tree, u32),
    Divided(Node, [Option<Box<Grown>>; 2]),
}

impl Grown {
    /// How many nodes, leaves and facets it has.
    fn sizes(&self) -> [usize; 3] {
        match self {
            Grown::Tree(tree, _) => [tree.nodes.len(), tree.leaves.len(), tree.facets.len()],
            Grown::Divided(_, halves) => {
                let each = halves.iter().flatten().map(|half| half.sizes());
                each.fold([1, 0, 0], |all, one| std::array::from_fn(|k| all[k] + one[k]))
            }
        }
    }
}

/// A part of the tree with numbers of its own.
#[derive(Default)]
struct Tree {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    facets: Vec<u32>,
}

impl Tree {
    /// All that was grown as one tree, and its top.
    fn of(grown: Grown) -> (Self, u32) {
        let [nodes, leaves, facets] = grown.sizes();
        let (nodes, leaves) = (Vec::with_capacity(nodes), Vec::with_capacity(leaves));
        let mut tree = Self { nodes, leaves, facets: Vec::with_capacity(facets) };
        let top = tree.take(grown, NONE);
        (tree, top)
    }

    fn take(&mut self, grown: Grown, parent: u32) -> u32 {
        match grown {
            Grown::Tree(tree, top) => self.append(tree, top, parent),
            Grown::Divided(node, halves) => {
                let n = self.nodes.len();
                self.nodes.push(Node { parent, ..node });
                for (k, half) in halves.into_iter().enumerate() {
                    self.nodes[n].halves[k] = half.map_or(UNDECIDED, |half| self.take(*half, upper(n as u32, k)));
                }
                n as u32
            }
        }
    }

    /// Appends another one whose top is `top`, below the half `parent`; its place.
    fn append(&mut self, other: Tree, top: u32, parent: u32) -> u32 {
        let (nodes, leaves, facets) = (self.nodes.len() as u32, self.leaves.len() as u32, self.facets.len() as u32);
        let shifted = |place: u32| match place & KIND {
            0 => place + nodes,
            PART => place + leaves,
            _ => place,
        };
        let above = |p: u32| if p == NONE { parent } else { p + nodes };
        self.nodes.extend(other.nodes.into_iter().map(|n| Node {
            halves: n.halves.map(shifted),
            parent: above(n.parent),
            ..n
        }));
        self.leaves.extend(other.leaves.into_iter().map(|l| Leaf {
            from: l.from + facets,
            to: l.to + facets,
            parent: above(l.parent),
        }));
        self.facets.extend(other.facets);
        shifted(top)
    }
}

/// Makes the tree: of all facets, or of some that lie side by side in memory then.
struct Builder<'s> {
    surface: &'s Surface,
    boxes: Vec<Aabb>,
    /// Their numbers and corners, of some.
    some: Option<(Vec<u32>, Vec<[DVec3; 3]>)>,
}

/// A place whose side is not decided yet.
const UNDECIDED: u32 = OUT | 1;
/// Facets that are tried for the side of a place that none reaches.
const TRIED: usize = 4;

impl Builder<'_> {
    /// The number of a facet in the mesh.
    fn number(&self, i: u32) -> u32 {
        self.some.as_ref().map_or(i, |some| some.0[i as usize])
    }

    fn corners(&self, i: u32) -> [DVec3; 3] {
        self.some.as_ref().map_or_else(|| self.surface.corners(i), |some| some.1[i as usize])
    }

    /// The tree of a cell that some facets reach; `last`: the facets of the one before, and for how long it has been so.
    fn grown(&self, list: Vec<u32>, cell: Aabb, last: (usize, u32)) -> Result<Grown, MeshFault> {
        if list.len() < SHARED {
            let all = 0..list.len() as u32;
            let boxes = list.iter().map(|i| self.boxes[*i as usize]).collect();
            let corners = list.iter().map(|i| self.surface.corners(*i)).collect();
            let near = Builder { surface: self.surface, boxes, some: Some((list, corners)) };
            let mut tree = Tree::default();
            let top = near.grow(all.collect(), cell, last, NONE, &mut tree)?;
            return Ok(Grown::Tree(tree, top));
        }
        halt::point();
        let last = stalled(last, list.len());
        let (node, cells, [low, high]) = self.divided(&list, &cell)?;
        drop(list);
        let half = |list: Vec<u32>, cell| (!list.is_empty()).then(|| self.grown(list, cell, last)).transpose();
        let (low, high) = rayon::join(|| half(low, cells[0]), || half(high, cells[1]));
        Ok(Grown::Divided(node, [low?, high?].map(|half| half.map(Box::new))))
    }

    /// The same of few facets into a tree, below the half `parent`; its place.
    fn grow(
        &self,
        list: Vec<u32>,
        cell: Aabb,
        last: (usize, u32),
        parent: u32,
        tree: &mut Tree,
    ) -> Result<u32, MeshFault> {
        let last = stalled(last, list.len());
        if (list.len() <= FEW_FACETS && self.has_few_planes(&list)) || last.1 > STALLED {
            if list.len() > MOST_FACETS {
                return Err(MeshFault::Intricate(self.middle(&list)));
            }
            let from = tree.facets.len() as u32;
            if self.is_part(&list, &cell, last.1 > STALLED)? {
                tree.facets.extend(list.iter().map(|i| self.number(*i)));
                tree.leaves.push(Leaf { from, to: tree.facets.len() as u32, parent });
                return Ok(PART | (tree.leaves.len() as u32 - 1));
            }
        }
        let (node, cells, halves) = self.divided(&list, &cell)?;
        let empty = halves.iter().position(Vec::is_empty);
        let known = empty.and_then(|k| self.side(cells[k].center(), &list, &cell));
        drop(list);
        let n = tree.nodes.len();
        tree.nodes.push(Node { parent, ..node });
        for (k, half) in halves.into_iter().enumerate() {
            let place = if half.is_empty() {
                known.map_or(UNDECIDED, |inside| if inside { IN } else { OUT })
            } else {
                self.grow(half, cells[k], last, upper(n as u32, k), tree)?
            };
            tree.nodes[n].halves[k] = place;
        }
        Ok(n as u32)
    }

    /// Whether a point of a cell is inside, told by a facet of the cell and what of the cell's others lies between them; `None` where
    /// that is not clear.
    fn side(&self, p: DVec3, list: &[u32], cell: &Aabb) -> Option<bool> {
        let middle = |i: &u32| self.corners(*i).iter().sum::<DVec3>() / 3.0;
        let inner = list.iter().filter(|i| cell.contains(middle(i)));
        inner.take(TRIED).find_map(|f| {
            let q = middle(f);
            let mut inside = apart::is_below(p, self.corners(*f))?;
            for g in list.iter().filter(|g| *g != f) {
                inside ^= apart::runs_through(p, q, self.corners(*g), self.surface.tolerance)?;
            }
            Some(inside)
        })
    }

    fn middle(&self, list: &[u32]) -> DVec3 {
        list.first().map_or(DVec3::ZERO, |i| self.boxes[*i as usize].center())
    }

    fn has_few_planes(&self, list: &[u32]) -> bool {
        let mut planes: SmallVec<[u32; FEW_FACETS]> =
            list.iter().map(|i| self.surface.face_of[self.number(*i) as usize]).collect();
        planes.sort_unstable();
        planes.dedup();
        planes.len() <= FEW_PLANES
    }

    /// Whether a cell can be a part; where that is not sure its formula is tried, and the last time it must do.
    fn is_part(&self, list: &[u32], cell: &Aabb, last: bool) -> Result<bool, MeshFault> {
        let mut doubt = last;
        let facets: SmallVec<[Facet; FEW_FACETS]> =
            list.iter().map(|i| Facet::of(self.surface, self.number(*i))).collect();
        let boxes: SmallVec<[Aabb; FEW_FACETS]> = list.iter().map(|i| self.boxes[*i as usize]).collect();
        for i in 0..facets.len() {
            for j in 0..i {
                if !boxes[i].meets(&boxes[j]) {
                    continue;
                }
                match pair(self.surface.tolerance, [&facets[i], &facets[j]]) {
                    FacetPair::Apart => {}
                    FacetPair::Doubtful => doubt = true,
                    FacetPair::Crossing => return Err(MeshFault::Crossing(boxes[i].intersection(&boxes[j]).center())),
                }
            }
        }
        if !doubt {
            return Ok(true);
        }
        match written(self.surface, list.iter().map(|i| self.number(*i)), cell) {
            Ok(_) => Ok(true),
            Err(fault) if last => Err(fault),
            Err(_) => Ok(false),
        }
    }

    /// A cell cut in two: its node, the two cells and what reaches them.
    fn divided(&self, list: &[u32], cell: &Aabb) -> Result<(Node, [Aabb; 2], [Vec<u32>; 2]), MeshFault> {
        let size = cell.max - cell.min;
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let w = OVERLAP * size[axis];
        if w <= 1e3 * self.surface.tolerance {
            return Err(MeshFault::Intricate(self.middle(list)));
        }
        let s = self.place(list, cell, axis, w);
        let (mut below, mut above) = (*cell, *cell);
        (below.max[axis], above.min[axis]) = (s + w, s - w);
        let (mut low, mut high) = (Vec::with_capacity(list.len()), Vec::with_capacity(list.len()));
        for i in list {
            let b = &self.boxes[*i as usize];
            let (under, over) = (b.min[axis] <= below.max[axis], b.max[axis] >= above.min[axis]);
            // What lies on one side alone was in the cell before.
            let both = under && over;
            if under && (!both || self.reaches(*i, &below)) {
                low.push(*i);
            }
            if over && (!both || self.reaches(*i, &above)) {
                high.push(*i);
            }
        }
        let node = Node { s, w, halves: [UNDECIDED; 2], parent: NONE, axis: axis as u8 };
        Ok((node, [below, above], [low, high]))
    }

    /// True unless a facet and a cell are told apart by an axis (T. Akenine-Möller 2001); its box meets the cell.
    fn reaches(&self, i: u32, cell: &Aabb) -> bool {
        let corners = self.corners(i);
        if corners.iter().any(|c| cell.contains(*c)) {
            return true;
        }
        let (center, half) = (cell.center(), cell.half() + DVec3::splat(8.0 * self.surface.tolerance));
        let [a, b, c] = [corners[0] - center, corners[1] - center, corners[2] - center];
        let sides = [b - a, c - b, a - c];
        let apart = |[p, q, r]: [f64; 3], reach: f64| {
            let reach = reach * (1.0 + 1e-12);
            p.min(q).min(r) > reach || p.max(q).max(r) < -reach
        };
        let n = sides[0].cross(sides[1]);
        if apart([n.dot(a), n.dot(b), n.dot(c)], half.dot(n.abs())) {
            return false;
        }
        // Each side crossed with each axis k: in the other two coordinates.
        !(0..3).any(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            sides.iter().any(|side| {
                let (u, v) = (-side[j], side[i]);
                let at = |x: DVec3| u * x[i] + v * x[j];
                apart([at(a), at(b), at(c)], u.abs() * half[i] + v.abs() * half[j])
            })
        })
    }

    /// Where a cell is divided: near the middle of its facets, with both planes clear of corners.
    fn place(&self, list: &[u32], cell: &Aabb, k: usize, w: f64) -> f64 {
        let (from, size) = (cell.min[k], cell.max[k] - cell.min[k]);
        let step = list.len().div_ceil(1024);
        let mut middles: Vec<f64> = list.iter().step_by(step).map(|i| self.boxes[*i as usize].center()[k]).collect();
        let half = middles.len() / 2;
        let median = *middles.select_nth_unstable_by(half, f64::total_cmp).1;
        let middle = median.clamp(from + 0.25 * size, from + 0.75 * size);
        let enough = 1e4 * self.surface.tolerance;
        let mut best = (f64::NEG_INFINITY, middle);
        for i in 0..PLACES {
            // Odd fractions, so that models on a grid do not have corners there.
            let s = middle + size * (0.0137 + 0.0171 * (((i + 4) % PLACES) as f64 - 4.0));
            if list.len() > LOOKED_AT {
                return s;
            }
            let clear = list.iter().flat_map(|i| self.corners(*i)).fold(f64::INFINITY, |least: f64, c| {
                let v = c[k] - s;
                least.min((v - w).abs()).min((v + w).abs())
            });
            if clear >= enough {
                return s;
            }
            if clear > best.0 {
                best = (clear, s);
            }
        }
        best.1
    }
}

fn upper(node: u32, half: usize) -> u32 {
    if half == 1 { node | UPPER } else { node }
}

/// How often in a row a cell has had as many facets as the one before.
fn stalled(last: (usize, u32), count: usize) -> (usize, u32) {
    (count, if count < last.0 { 0 } else { last.1 + 1 })
}

/// The formula of a cell that some facets reach; `None` where none of them does after all.
fn written(surface: &Surface, list: impl Iterator<Item = u32> + Clone, cell: &Aabb) -> Result<Option<Expr>, MeshFault> {
    let mut pieces = surface.pieces(list);
    for k in 0..3 {
        let axis = DVec3::AXES[k];
        for plane in [(axis, cell.max[k]), (-axis, -cell.min[k])] {
            pieces = pieces.into_iter().filter_map(|p: Piece| p.within(plane, surface.tolerance)).collect();
        }
    }
    let Some(first) = pieces.first() else { return Ok(None) };
    let middle = first.middle();
    let local = Local { planes: &surface.planes, tolerance: surface.tolerance, most: MOST_TOKENS };
    let e = local.formula(pieces.clone(), true).map_err(|_| MeshFault::Intricate(middle))?;
    checked(&surface.planes, surface.tolerance, &pieces, e, cell).map(Some)
}

/// The formula of a whole mesh.
#[derive(Debug)]
pub struct Divided {
    surface: Arc<Surface>,
    domain: Aabb,
    top: u32,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    facets: Vec<u32>,
    made: Made,
    /// The largest distance of a plane from the origin.
    reach: f64,
}

/// Parts that are written out.
struct Made(Box<[OnceLock<Part>]>);

/// Without them: they are no part of a model's state.
impl std::fmt::Debug for Made {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} parts", self.0.len())
    }
}

impl Divided {
    /// Divides the space around a mesh; `opposite` are the neighbours of each triangle along its sides.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn new(surface: Arc<Surface>, opposite: &[[u32; 3]]) -> Result<Self, MeshFault> {
        let domain = cells::domain(&surface.around);
        let count = surface.triangles.len() as u32;
        let boxes = (0..count).into_par_iter().map(|i| Aabb::of_points(surface.corners(i))).collect();
        let builder = Builder { surface: &surface, boxes, some: None };
        let grown = builder.grown((0..count).collect(), domain, (usize::MAX, 0))?;
        drop(builder);
        let (tree, top) = Tree::of(grown);
        if tree.facets.len() > MOST_TIMES * count as usize + 10_000 {
            return Err(MeshFault::Intricate(domain.center()));
        }
        let made = Made((0..tree.leaves.len()).map(|_| OnceLock::new()).collect());
        let Tree { nodes, leaves, facets } = tree;
        let cuts = domain.min.abs().max(domain.max.abs()).max_element();
        let reach = surface.planes.iter().fold(cuts, |most, (_, d)| most.max(d.abs()));
        let mut this = Self { surface, domain, top, nodes, leaves, facets, made, reach };
        this.decide();
        this.is_outward(opposite)?;
        Ok(this)
    }

    /// Decides the cells that no facet reaches.
    fn decide(&mut self) {
        let empty = |n: &Node, k: usize| n.halves[k] == UNDECIDED;
        let all: Vec<(u32, usize)> = (0..self.nodes.len())
            .flat_map(|n| (0..2).map(move |k| (n as u32, k)))
            .filter(|(n, k)| empty(&self.nodes[*n as usize], *k))
            .collect();
        let side = |(n, k): &(u32, usize)| self.is_inside(self.cell(upper(*n, *k)).center());
        let sides: Vec<bool> = all.par_iter().with_min_len(256).map(side).collect();
        for ((n, k), inside) in all.into_iter().zip(sides) {
            self.nodes[n as usize].halves[k] = if inside { IN } else { OUT };
        }
    }

    /// Each part of the surface that edges connect has its inside on its inner side: one facet of it tells.
    fn is_outward(&self, opposite: &[[u32; 3]]) -> Result<(), MeshFault> {
        let surface = &*self.surface;
        let step = 1e2 * surface.tolerance;
        let outward = |i: u32| {
            let [a, b, c] = surface.corners(i);
            let (middle, n) = ((a + b + c) / 3.0, area(a, b, c).normalize_or_zero());
            if self.is_inside(middle - n * step) && !self.is_inside(middle + n * step) {
                Ok(())
            } else {
                Err(MeshFault::Crossing(middle))
            }
        };
        // The largest facet of each part.
        let mut leader: Vec<u32> = (0..opposite.len() as u32).collect();
        fn find(leader: &mut [u32], mut i: u32) -> u32 {
            while leader[i as usize] != i {
                leader[i as usize] = leader[leader[i as usize] as usize];
                i = leader[i as usize];
            }
            i
        }
        for (i, others) in opposite.iter().enumerate() {
            for j in others.iter().filter(|j| **j != NONE) {
                let (p, q) = (find(&mut leader, i as u32), find(&mut leader, *j));
                leader[p.max(q) as usize] = p.min(q);
            }
        }
        let size = |i: u32| {
            let [a, b, c] = surface.corners(i);
            (b - a).cross(c - a).length_squared()
        };
        let mut largest = vec![(NONE, -1.0); leader.len()];
        for i in 0..leader.len() as u32 {
            let one = &mut largest[find(&mut leader, i) as usize];
            let own = size(i);
            if own > one.1 {
                *one = (i, own);
            }
        }
        largest.retain(|one| one.0 != NONE);
        let tried: Vec<Result<(), MeshFault>> = largest.par_iter().map(|one| outward(one.0)).collect();
        tried.into_iter().collect()
    }

    /// The cell of a half.
    fn cell(&self, parent: u32) -> Aabb {
        let mut cell = self.domain;
        let (mut at, mut seen) = (parent, [false; 6]);
        while at != NONE {
            let node = &self.nodes[(at & !UPPER) as usize];
            let (axis, half) = (node.axis as usize, usize::from(at & UPPER != 0));
            // The last division is the closest.
            if !std::mem::replace(&mut seen[2 * axis + half], true) {
                if half == 0 { cell.max[axis] = node.s + node.w } else { cell.min[axis] = node.s - node.w }
            }
            at = node.parent;
        }
        cell
    }

    /// True where a point that is on no facet is inside.
    fn is_inside(&self, p: DVec3) -> bool {
        let mut crossed: SmallVec<[u32; 32]> = SmallVec::new();
        let mut stack: SmallVec<[u32; 64]> = SmallVec::new();
        stack.push(self.top);
        while let Some(place) = stack.pop() {
            match place & KIND {
                0 => {
                    let node = &self.nodes[place as usize];
                    // Across the line a facet is found in either half of an overlap, along it in both.
                    let (low, high) = match node.axis {
                        0 => (p.x <= node.s + node.w, true),
                        k => (p[k as usize] <= node.s, p[k as usize] > node.s),
                    };
                    stack.extend(low.then_some(node.halves[0]));
                    stack.extend(high.then_some(node.halves[1]));
                }
                PART => {
                    let leaf = &self.leaves[(place & !KIND) as usize];
                    let all = &self.facets[leaf.from as usize..leaf.to as usize];
                    crossed.extend(all.iter().copied().filter(|i| crosses(p, self.surface.corners(*i))));
                }
                _ => {}
            }
        }
        crossed.sort_unstable();
        crossed.dedup();
        crossed.len() % 2 == 1
    }

    /// The mesh.
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }

    fn first_cut(&self) -> u32 {
        self.surface.planes.len() as u32
    }

    fn first_part(&self) -> u32 {
        self.first_cut() + 6 + 2 * self.nodes.len() as u32
    }

    fn place(&self, place: u32) -> Place {
        match place & KIND {
            PART => Place::Part(self.first_part() + (place & !KIND)),
            IN => Place::Known(true),
            OUT => Place::Known(false),
            _ => Place::Divided(place),
        }
    }

    fn span_in(&self, place: u32, cell: &Aabb, look: &Look) -> Span {
        const OPEN: Span = (f64::NEG_INFINITY, f64::INFINITY);
        match place & KIND {
            IN => return (f64::NEG_INFINITY, f64::NEG_INFINITY),
            OUT => return (f64::INFINITY, f64::INFINITY),
            _ => {}
        }
        let (size, most) = ((cell.max - cell.min).max_element(), 2.0 * look.half.max_element());
        // Facets reach the cell, and a box as large as the cell cannot be told from them.
        if most > size {
            return OPEN;
        }
        if place & KIND == PART {
            let part = self.part(self.first_part() + (place & !KIND));
            return match part {
                _ if most > SMALL * size => OPEN,
                Part::Unclear => OPEN,
                Part::Known(inside) => self.span_in(if *inside { IN } else { OUT }, cell, look),
                Part::Open(tokens) => crate::solid::formula::span_of(tokens, &mut |f| {
                    let (n, d) = self.surface.planes[f as usize];
                    look.plane(n, d)
                }),
            };
        }
        let node = &self.nodes[place as usize];
        let (axis, offsets) = (node.axis as usize, node.offsets());
        let (mut lo, mut hi) = (f64::INFINITY, f64::INFINITY);
        for k in 0..2 {
            let (l, h) = look.along(axis, k == 1, offsets[k]);
            let mut inner = *cell;
            if k == 0 {
                inner.max[axis] = node.s + node.w
            } else {
                inner.min[axis] = node.s - node.w
            }
            let (l, h) = if l > 0.0 {
                (l, f64::INFINITY)
            } else {
                let inner = self.span_in(node.halves[k], &inner, look);
                (l.max(inner.0), h.max(inner.1))
            };
            (lo, hi) = (lo.min(l), hi.min(h));
        }
        (lo, hi)
    }
}

/// A box that f is asked for over.
struct Look {
    center: DVec3,
    half: DVec3,
    rounding: f64,
}

impl Look {
    fn plane(&self, n: DVec3, d: f64) -> Span {
        let (v, tilt) = (n.dot(self.center) - d, n.abs().dot(self.half) + self.rounding);
        (v - tilt, v + tilt)
    }

    /// ±x_k − d.
    fn along(&self, k: usize, negative: bool, d: f64) -> Span {
        let v = if negative { -self.center[k] } else { self.center[k] } - d;
        (v - self.half[k] - self.rounding, v + self.half[k] + self.rounding)
    }
}

impl Planes for Divided {
    fn count(&self) -> usize {
        self.first_part() as usize + self.leaves.len()
    }

    fn plane(&self, index: usize) -> Plane {
        let facets = self.surface.planes.len();
        if let Some(&(normal, offset)) = self.surface.planes.get(index) {
            return Plane { normal, offset };
        }
        let along = |axis: usize, negative: bool, offset: f64| {
            let axis = DVec3::AXES[axis];
            Plane { normal: if negative { -axis } else { axis }, offset }
        };
        let cut = index - facets;
        if cut < 6 {
            let (k, low) = (cut / 2, cut % 2 == 1);
            return along(k, low, if low { -self.domain.min[k] } else { self.domain.max[k] });
        }
        match self.nodes.get((cut - 6) / 2) {
            Some(node) => along(node.axis as usize, cut % 2 == 1, node.offsets()[cut % 2]),
            // A part has a number, and no plane: what bounds all stands for it.
            None => along(0, false, self.domain.max.x),
        }
    }

    fn reach(&self) -> f64 {
        self.reach
    }
}

impl Division for Divided {
    fn around(&self) -> [u32; 6] {
        std::array::from_fn(|k| self.first_cut() + k as u32)
    }

    fn whole(&self) -> Place {
        self.place(self.top)
    }

    fn halves(&self, divided: u32) -> [(u32, Place); 2] {
        let (node, cut) = (&self.nodes[divided as usize], self.first_cut() + 6 + 2 * divided);
        [(cut, self.place(node.halves[0])), (cut + 1, self.place(node.halves[1]))]
    }

    fn part(&self, part: u32) -> &Part {
        let n = (part - self.first_part()) as usize;
        self.made.0[n].get_or_init(|| {
            let leaf = self.leaves[n];
            let cell = self.cell(leaf.parent);
            let facets = &self.facets[leaf.from as usize..leaf.to as usize];
            match written(&self.surface, facets.iter().copied(), &cell) {
                Ok(Some(Expr::Open(tokens))) => Part::Open(tokens.into()),
                Ok(Some(Expr::Known(inside))) => Part::Known(inside),
                Ok(None) => Part::Known(self.is_inside(cell.center())),
                Err(_) => Part::Unclear,
            }
        })
    }

    fn span(&self, center: DVec3, half: DVec3, rounding: f64) -> Span {
        let look = Look { center, half, rounding };
        let (mut lo, mut hi) = self.span_in(self.top, &self.domain, &look);
        for k in 0..3 {
            for (negative, offset) in [(false, self.domain.max[k]), (true, -self.domain.min[k])] {
                let (l, h) = look.along(k, negative, offset);
                (lo, hi) = (lo.max(l), hi.max(h));
            }
        }
        (lo, hi)
    }
}
