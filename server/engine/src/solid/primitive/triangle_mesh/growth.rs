//! How the space around a mesh of very many facets is divided (`division`): cell by cell, halves of large ones side by side.

use super::MeshFault;
use super::apart::{self, Facet, FacetPair, pair};
use super::cells::checked;
use super::edges::NONE;
use super::local::{Expr, Local};
use super::piece::Piece;
use super::surface::Surface;
use crate::math::{Aabb, halt};
use glam::DVec3;
use smallvec::SmallVec;

/// Planes up to which a cell is a part …
const FEW_PLANES: usize = 12;
/// … and facets.
const FEW_FACETS: usize = 32;
/// By how much more both may be, at most, of a mesh that smaller parts do not suit (`Limits`).
const MOST_COARSE: usize = 64;
/// Times that a facet is in a part, on average, at most: so often, and some thousands of times more of a small mesh.
const MOST_TIMES: usize = 64;
const FEW_TIMES: usize = 10_000;
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
/// A cut across the longest side that leaves so many times the facets in both halves together parts nothing …
const IN_BOTH: f64 = 1.9;
/// … and one across another side that leaves no more than so many times the facets is taken for it.
const PARTED: f64 = 1.4;
/// Facets from which on two halves are divided side by side.
const SHARED: usize = 4096;

/// Kinds of a place, in the upper bits of its number.
pub(super) const KIND: u32 = 3 << 30;
pub(super) const PART: u32 = 1 << 30;
pub(super) const OUT: u32 = 2 << 30;
pub(super) const IN: u32 = 3 << 30;
/// Of a parent: the upper half.
pub(super) const UPPER: u32 = 1 << 31;

/// A cell that is divided: at s ± w across an axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) s: f64,
    pub(super) w: f64,
    pub(super) halves: [u32; 2],
    pub(super) parent: u32,
    pub(super) axis: u8,
}

impl Node {
    /// Offsets of its planes along +axis and −axis.
    pub(super) fn offsets(&self) -> [f64; 2] {
        [self.s + self.w, self.w - self.s]
    }
}

/// A part: its facets, and the half that it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) parent: u32,
}

/// What is grown side by side: trees under divisions.
pub(super) enum Grown {
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

    /// Names places by their numbers in the whole, of which so many nodes, leaves and facets come before; the place of its top, which is
    /// below the half `parent`.
    fn number(&mut self, before: &mut [u32; 3], parent: u32) -> u32 {
        match self {
            Grown::Tree(tree, top) => tree.number(*top, before, parent),
            Grown::Divided(node, halves) => {
                let n = before[0];
                before[0] += 1;
                node.parent = parent;
                for (k, half) in halves.iter_mut().enumerate() {
                    let below = half.as_mut().map(|half| half.number(before, upper(n, k)));
                    node.halves[k] = below.unwrap_or(UNDECIDED);
                }
                n
            }
        }
    }

    /// Calls for what it consists of, in the order of numbers.
    fn walk(&mut self, each: &mut dyn FnMut(Met<'_>)) {
        match self {
            Grown::Tree(tree, _) => each(Met::Tree(tree)),
            Grown::Divided(node, halves) => {
                each(Met::Node(*node));
                halves.iter_mut().flatten().for_each(|half| half.walk(each));
            }
        }
    }
}

/// What a walk meets.
enum Met<'g> {
    Node(Node),
    Tree(&'g mut Tree),
}

/// A part of the tree with numbers of its own.
#[derive(Default)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
    pub(super) facets: Vec<u32>,
}

impl Tree {
    /// All that was grown as one tree, and its top. Facets, leaves and nodes one after another: what is moved is freed, and of a large
    /// mesh each takes as much as its planes do.
    pub(super) fn of(mut grown: Grown) -> (Self, u32) {
        let [nodes, leaves, facets] = grown.sizes();
        let top = grown.number(&mut [0; 3], NONE);
        let mut all = Self { facets: Vec::with_capacity(facets), ..Self::default() };
        grown.walk(&mut |met| match met {
            Met::Node(_) => {}
            Met::Tree(tree) => all.facets.append(&mut std::mem::take(&mut tree.facets)),
        });
        all.leaves.reserve_exact(leaves);
        grown.walk(&mut |met| match met {
            Met::Node(_) => {}
            Met::Tree(tree) => all.leaves.append(&mut std::mem::take(&mut tree.leaves)),
        });
        all.nodes.reserve_exact(nodes);
        grown.walk(&mut |met| match met {
            Met::Node(node) => all.nodes.push(node),
            Met::Tree(tree) => all.nodes.append(&mut std::mem::take(&mut tree.nodes)),
        });
        (all, top)
    }

    /// Its part of `Grown::number`.
    fn number(&mut self, top: u32, before: &mut [u32; 3], parent: u32) -> u32 {
        let [nodes, leaves, facets] = *before;
        let shifted = |place: u32| match place & KIND {
            0 => place + nodes,
            PART => place + leaves,
            _ => place,
        };
        let above = |p: u32| if p == NONE { parent } else { p + nodes };
        for n in &mut self.nodes {
            (n.halves, n.parent) = (n.halves.map(shifted), above(n.parent));
        }
        for l in &mut self.leaves {
            *l = Leaf { from: l.from + facets, to: l.to + facets, parent: above(l.parent) };
        }
        let own = [self.nodes.len(), self.leaves.len(), self.facets.len()];
        *before = std::array::from_fn(|k| before[k] + own[k] as u32);
        shifted(top)
    }

    /// Without room for more.
    fn shrink(&mut self) {
        self.nodes.shrink_to_fit();
        self.leaves.shrink_to_fit();
        self.facets.shrink_to_fit();
    }
}

/// The box of a facet in single precision, rounded outwards: half the room, and enough for most of what is asked.
#[derive(Clone, Copy)]
pub(super) struct Rough {
    low: [f32; 3],
    high: [f32; 3],
}

impl Rough {
    /// That of a box.
    pub(super) fn of(exact: &Aabb) -> Self {
        let (low, high) = (exact.min.to_array(), exact.max.to_array());
        Self { low: low.map(|x| (x as f32).next_down()), high: high.map(|x| (x as f32).next_up()) }
    }
}

/// How large parts are, and how often facets may be in one. Cells are as wide as they are long, so a fan of n slivers is told by as
/// many as n²: of small parts there are more than a mesh of so many triangles may have, of parts with n facets there are few.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    planes: usize,
    facets: usize,
    /// Facets in all parts together.
    all: usize,
}

impl Limits {
    /// Those of a mesh of so many triangles, parts the smallest first.
    pub(super) fn of(triangles: usize) -> impl Iterator<Item = Self> {
        let coarse = std::iter::successors(Some(1), |k| Some(2 * k)).take_while(|k| *k <= MOST_COARSE);
        let all = MOST_TIMES * triangles + FEW_TIMES;
        coarse.map(move |k| Self { planes: k * FEW_PLANES, facets: k * FEW_FACETS, all })
    }

    /// Whether a tree has more facets than it may.
    pub(super) fn is_beyond(&self, tree: &Tree) -> bool {
        tree.facets.len() > self.all
    }
}

/// Why there is no tree.
pub(super) enum Stop {
    /// More facets in all parts together than `Limits` has.
    TooMany,
    /// What is wrong with the mesh.
    Fault(MeshFault),
}

impl From<MeshFault> for Stop {
    fn from(fault: MeshFault) -> Self {
        Stop::Fault(fault)
    }
}

/// A cell cut in two: its node, the two cells and what reaches them.
type Cut = (Node, [Aabb; 2], [Vec<u32>; 2]);

/// How many facets reach both halves of a cut together.
fn reaching((_, _, halves): &Cut) -> usize {
    halves.iter().map(Vec::len).sum()
}

/// Makes the tree: of all facets, or of some that lie side by side in memory then.
pub(super) struct Builder<'s> {
    pub(super) surface: &'s Surface,
    pub(super) limits: Limits,
    pub(super) of: Of,
}

/// Of which facets a tree is made.
pub(super) enum Of {
    /// Of all, with their boxes.
    All(Vec<Rough>),
    /// Of some, with their numbers, corners and boxes.
    Some(Vec<u32>, Vec<[DVec3; 3]>, Vec<Aabb>),
}

/// A place whose side is not decided yet.
pub(super) const UNDECIDED: u32 = OUT | 1;
/// Facets that are tried for the side of a place that none reaches.
const TRIED: usize = 4;

impl Builder<'_> {
    /// The number of a facet in the mesh.
    fn number(&self, i: u32) -> u32 {
        match &self.of {
            Of::All(_) => i,
            Of::Some(numbers, ..) => numbers[i as usize],
        }
    }

    fn corners(&self, i: u32) -> [DVec3; 3] {
        match &self.of {
            Of::All(_) => self.surface.corners(i),
            Of::Some(_, corners, _) => corners[i as usize],
        }
    }

    /// The box of a facet.
    fn around(&self, i: u32) -> Aabb {
        match &self.of {
            Of::All(_) => Aabb::of_points(self.surface.corners(i)),
            Of::Some(.., boxes) => boxes[i as usize],
        }
    }

    /// Whether the box of a facet reaches below the one place of an axis, and above the other, which is lower.
    #[inline]
    fn beside(&self, i: u32, axis: usize, [below, above]: [f64; 2]) -> [bool; 2] {
        if let Of::All(rough) = &self.of {
            let rough = &rough[i as usize];
            if f64::from(rough.high[axis]) < above {
                return [true, false];
            }
            if f64::from(rough.low[axis]) > below {
                return [false, true];
            }
        }
        let exact = self.around(i);
        [exact.min[axis] <= below, exact.max[axis] >= above]
    }

    /// The tree of a cell that some facets reach; `last`: the facets of the one before, and for how long it has been so.
    pub(super) fn grown(&self, list: Vec<u32>, cell: Aabb, last: (usize, u32)) -> Result<Grown, Stop> {
        if list.len() < SHARED {
            let all = 0..list.len() as u32;
            let corners: Vec<[DVec3; 3]> = list.iter().map(|i| self.surface.corners(*i)).collect();
            let boxes = corners.iter().map(|c| Aabb::of_points(*c)).collect();
            let near = Builder { of: Of::Some(list, corners, boxes), ..*self };
            let mut tree = Tree::default();
            let top = near.grow(all.collect(), cell, last, NONE, &mut tree)?;
            tree.shrink();
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
    fn grow(&self, list: Vec<u32>, cell: Aabb, last: (usize, u32), parent: u32, tree: &mut Tree) -> Result<u32, Stop> {
        let last = stalled(last, list.len());
        if (list.len() <= self.limits.facets && self.has_few_planes(&list)) || last.1 > STALLED {
            if list.len() > MOST_FACETS {
                return Err(MeshFault::Intricate(self.middle(&list)).into());
            }
            let from = tree.facets.len() as u32;
            if self.is_part(&list, &cell, last.1 > STALLED)? {
                tree.facets.extend(list.iter().map(|i| self.number(*i)));
                tree.leaves.push(Leaf { from, to: tree.facets.len() as u32, parent });
                if self.limits.is_beyond(tree) {
                    return Err(Stop::TooMany);
                }
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
        list.first().map_or(DVec3::ZERO, |i| self.around(*i).center())
    }

    fn has_few_planes(&self, list: &[u32]) -> bool {
        let mut planes: SmallVec<[u32; FEW_FACETS]> =
            list.iter().map(|i| self.surface.face_of[self.number(*i) as usize]).collect();
        planes.sort_unstable();
        planes.dedup();
        planes.len() <= self.limits.planes
    }

    /// Whether a cell can be a part; where that is not sure its formula is tried, and the last time it must do.
    fn is_part(&self, list: &[u32], cell: &Aabb, last: bool) -> Result<bool, MeshFault> {
        let mut doubt = last;
        let facets: SmallVec<[Facet; FEW_FACETS]> =
            list.iter().map(|i| Facet::of(self.surface, self.number(*i))).collect();
        let boxes: SmallVec<[Aabb; FEW_FACETS]> = list.iter().map(|i| self.around(*i)).collect();
        for i in 0..facets.len() {
            for j in 0..i {
                if !boxes[i].meets(&boxes[j]) {
                    continue;
                }
                match pair(self.surface.tolerance, [&facets[i], &facets[j]]) {
                    FacetPair::Apart => {}
                    FacetPair::Doubtful => doubt = true,
                    FacetPair::Crossing => {
                        return Err(apart::through(self.surface, [list[j], list[i]].map(|f| self.number(f))));
                    }
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

    /// A cell cut in two: its node, the two cells and what reaches them. Across its longest side; where that leaves nearly all facets
    /// in both halves, as of the tall walls of a prism, across another one that parts them.
    fn divided(&self, list: &[u32], cell: &Aabb) -> Result<Cut, MeshFault> {
        let size = cell.max - cell.min;
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let longest = self.divided_across(list, cell, axis).ok_or_else(|| MeshFault::Intricate(self.middle(list)))?;
        if (reaching(&longest) as f64) < IN_BOTH * list.len() as f64 {
            return Ok(longest);
        }
        let others = [(axis + 1) % 3, (axis + 2) % 3].map(|k| self.divided_across(list, cell, k));
        let parted = others.into_iter().flatten().min_by_key(reaching);
        Ok(parted.filter(|cut| reaching(cut) as f64 <= PARTED * list.len() as f64).unwrap_or(longest))
    }

    /// The same across an axis; `None` where the halves would overlap by roundings.
    fn divided_across(&self, list: &[u32], cell: &Aabb, axis: usize) -> Option<Cut> {
        let w = OVERLAP * (cell.max - cell.min)[axis];
        if w <= 1e3 * self.surface.tolerance {
            return None;
        }
        let s = self.place(list, cell, axis, w);
        let (mut below, mut above) = (*cell, *cell);
        (below.max[axis], above.min[axis]) = (s + w, s - w);
        let (mut low, mut high) = (Vec::with_capacity(list.len()), Vec::with_capacity(list.len()));
        for i in list {
            let [under, over] = self.beside(*i, axis, [below.max[axis], above.min[axis]]);
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
        Some((node, [below, above], [low, high]))
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
        let mut middles: Vec<f64> = list.iter().step_by(step).map(|i| self.around(*i).center()[k]).collect();
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

pub(super) fn upper(node: u32, half: usize) -> u32 {
    if half == 1 { node | UPPER } else { node }
}

/// How often in a row a cell has had as many facets as the one before.
fn stalled(last: (usize, u32), count: usize) -> (usize, u32) {
    (count, if count < last.0 { 0 } else { last.1 + 1 })
}

/// The formula of a cell that some facets reach; `None` where none of them does after all.
pub(super) fn written(
    surface: &Surface,
    list: impl Iterator<Item = u32> + Clone,
    cell: &Aabb,
) -> Result<Option<Expr>, MeshFault> {
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
