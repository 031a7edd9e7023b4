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
use super::cells;
use super::edges::NONE;
use super::growth::{
    Builder, IN, KIND, Leaf, Limits, Node, OUT, Of, PART, Rough, Stop, Tree, UNDECIDED, UPPER, upper, written,
};
use super::local::Expr;
use super::outward;
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

/// What a facet of a part costs where that is written out, in looks at a face.
const FACET: usize = 64;

/// Part of a cell's size below which a box is small beside it: only then the formula of a part is asked for bounds.
const SMALL: f64 = 0.25;

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

/// The tree with the smallest parts that there may be, and its top.
fn tree(surface: &Surface, domain: Aabb) -> Result<(Tree, u32), MeshFault> {
    let count = surface.triangles.len() as u32;
    for limits in Limits::of(count as usize) {
        let rough = |i| Rough::of(&Aabb::of_points(surface.corners(i)));
        let of = Of::All((0..count).into_par_iter().map(rough).collect());
        match (Builder { surface, limits, of }).grown((0..count).collect(), domain, (usize::MAX, 0)) {
            Ok(grown) => {
                let (tree, top) = Tree::of(grown);
                if !limits.is_beyond(&tree) {
                    return Ok((tree, top));
                }
            }
            Err(Stop::TooMany) => {}
            Err(Stop::Fault(fault)) => return Err(fault),
        }
    }
    Err(MeshFault::Intricate(domain.center()))
}

impl Divided {
    /// Divides the space around a mesh; `leaders` names of each triangle the first one of the part of the surface that it is in.
    ///
    /// # Errors
    /// What is wrong with the mesh, and where.
    pub fn new(surface: Arc<Surface>, leaders: &[u32]) -> Result<Self, MeshFault> {
        let domain = cells::domain(&surface.around);
        let (tree, top) = tree(&surface, domain)?;
        let made = Made((0..tree.leaves.len()).map(|_| OnceLock::new()).collect());
        let Tree { nodes, leaves, facets } = tree;
        let cuts = domain.min.abs().max(domain.max.abs()).max_element();
        let reach = surface.planes.iter().fold(cuts, |most, (_, d)| most.max(d.abs()));
        let mut this = Self { surface, domain, top, nodes, leaves, facets, made, reach };
        this.decide();
        this.is_outward(leaders)?;
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

    /// Each part of the surface has its inside on its inner side.
    fn is_outward(&self, leaders: &[u32]) -> Result<(), MeshFault> {
        let all = outward::largest(&self.surface, leaders);
        let of = |i: &u32| outward::is_outward(&self.surface, *i, |p| self.is_inside(p));
        let tried: Vec<Result<(), MeshFault>> = all.par_iter().map(of).collect();
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
        if self.made.0[n].get().is_none() {
            let leaf = &self.leaves[n];
            halt::work(FACET * (leaf.to - leaf.from) as usize);
        }
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
