//! How near two bodies are at one instant, without motion: what a threshold of separation decides.
//!
//! F(x) = max(f_A, f_B) is what both bodies' distance functions say of a point. A point within `level` of both has F <= level
//! (f is 1-Lipschitz), and where the bodies' distance is 2·level or less there is one; so where none exists it is more. The
//! contrary does not hold: at an edge of half angle a {f <= level} reaches out to level/sin a. `Cover` walks the boxes in which
//! a point within `level` of both may lie: those of both bodies, grown by it, and a box is dropped once a combination of its
//! literals' planes, the search's own bound (`clause`), proves F > level over it. So "apart" proves a distance, and
//! "within" has a witness of F.
//!
//! The same walk with a level that sinks to the best point found is branch and bound: it makes the deepest point of an
//! overlap the deepest of all, up to a tolerance.

use super::work::Work;
use crate::contact::exclusion::clause;
use crate::contact::exclusion::enumeration;
use crate::contact::exclusion::literal::{Side, View};
use crate::contact::exclusion::tighten::{self, Left, TIGHTENINGS, WORTH};
use crate::contact::query::task::Task;
use crate::math::Aabb;
use crate::motion::Instant;
use crate::solid::local::{self, LiteralId, Token, Truth};
use glam::DVec3;
use smallvec::SmallVec;

/// A box of A's frame with what is left there of both trees, for depths and distances below the cover's reach.
#[derive(Clone, Debug)]
pub(in crate::contact) struct Place {
    pub center: DVec3,
    pub half: DVec3,
    pub a: Vec<Token>,
    pub b: Vec<Token>,
    /// The faces of A and of B that matter here, each once, in order.
    lits: [Lits; 2],
    /// Where the bounds are lowest.
    pub lowest: DVec3,
    cost: DVec3,
    /// The level for which it was bounded, and how often it was made smaller since it was halved.
    level: f64,
    tightenings: u32,
}

/// Literals of one side, usually few.
type Lits = SmallVec<[(Side, LiteralId); 6]>;

impl Place {
    /// The faces of a side that matter here, each once, in order.
    pub fn lits(&self, side: Side) -> &[(Side, LiteralId)] {
        &self.lits[usize::from(side == Side::B)]
    }

    /// True when `x` lies in the box, or off it by at most `slack`.
    pub fn holds(&self, x: DVec3, slack: f64) -> bool {
        ((x - self.center).abs() - self.half).max_element() <= slack
    }
}

/// Sides of a box differ by no more than about this.
const SLAB: f64 = 4.0;

/// Boxes in which a point with F <= level may exist, depth first and in a fixed order.
pub(in crate::contact) struct Cover<'t, 'a> {
    task: &'t Task<'a>,
    at: &'t Instant,
    /// Depths and distances up to which the boxes' trees are kept.
    deep: f64,
    far: f64,
    /// Same-shape fits hold up to this level.
    fits_below: f64,
    stack: Vec<Place>,
    scratch: clause::Scratch,
    work: &'t Work,
}

/// Pairs of a box's faces that cost as much as a look at one, and so many such looks that bounding it counts already.
const PAIRS_PER_LOOK: usize = 256;
const FREE_LOOKS: usize = 16;

impl<'t, 'a> Cover<'t, 'a> {
    /// A cover of what two bodies have in common, as far as the work goes. The boxes are those of the bodies' bounds grown by
    /// `far`: they hold what lies within that distance of both, not all of {F <= far}. Their trees are kept for depths up to `deep` and
    /// distances up to `far`, or up to the level that is asked for.
    pub fn new(task: &'t Task<'a>, at: &'t Instant, deep: f64, far: f64, work: &'t Work) -> Self {
        let mut cover = Self {
            task,
            at,
            deep,
            far,
            fits_below: task.fits_below(),
            stack: Vec::new(),
            scratch: clause::Scratch::default(),
            work,
        };
        let region = common(task, at, far.max(0.0));
        if region.is_finite() {
            let (center, half) = (region.center(), region.half());
            let (a, b) = (task.a.normal_form.clone(), task.b.normal_form.clone());
            cover.stack.push(Place {
                center,
                half,
                a,
                b,
                lits: Default::default(),
                lowest: center,
                cost: DVec3::ZERO,
                level: far,
                tightenings: 0,
            });
        }
        cover
    }

    /// True when nothing is left: what was not handed out is proven free.
    pub fn is_done(&self) -> bool {
        self.stack.is_empty()
    }

    fn view(&self, place: &Place, delta: f64) -> View<'t> {
        View {
            velocity: DVec3::ZERO,
            delta,
            wall: delta,
            fits: -delta < self.fits_below,
            multipliers: true,
            curved: false,
            ..self.task.view((place.center, place.half), self.at, self.task.relative.bounds(self.at.t, 0.0, 0.0), &[])
        }
    }

    /// The next box that may hold a point with F <= level; `None` at the end and where the work ran out.
    pub fn next(&mut self, level: f64) -> Option<Place> {
        while !self.work.is_spent() {
            let place = self.stack.pop()?;
            let bounded = self.bounded(place, level);
            if bounded.is_some() {
                return bounded;
            }
        }
        None
    }

    /// A box with what is left there of both trees, where its bounds let it hold such a point.
    fn bounded(&mut self, mut place: Place, level: f64) -> Option<Place> {
        self.work.bound();
        let (pool, middle) = self.pruned(&place, level)?;
        let end = pool.len() as u32;
        // What many faces bound costs by their pairs.
        self.work.look((pool.len() * pool.len() / PAIRS_PER_LOOK).saturating_sub(FREE_LOOKS));
        place.a = pool[..middle as usize].to_vec();
        place.b = pool[middle as usize..].to_vec();
        place.level = level;
        if end > 0 {
            let pair = clause::Expressions { pool: &pool, a: (0, middle), b: (middle, end) };
            let view = self.view(&place, -level);
            let found = enumeration::advance(&view, &pair, &[], self.task.rounding, 0.0, &mut self.scratch);
            if found.dt >= 0.0 {
                return None;
            }
            place.lowest = place.center + found.y;
            place.cost = found.cost;
        }
        place.lits = [(Side::A, &place.a), (Side::B, &place.b)].map(|(side, tokens)| {
            let mut lits: Lits = local::literals(tokens).map(|id| (side, id)).collect();
            lits.sort_unstable();
            lits.dedup();
            lits
        });
        Some(place)
    }

    /// What all clauses leave of a box that was handed out, where that is so little that it is worth to be bounded in its stead.
    fn left(&mut self, place: &Place) -> Option<Left> {
        if !self.task.strategies.tighten || place.tightenings >= TIGHTENINGS {
            return None;
        }
        let pool = [&place.a[..], &place.b[..]].concat();
        let (middle, end) = (place.a.len() as u32, pool.len() as u32);
        // A look at each face, and no program.
        self.work.look(pool.len());
        let pair = clause::Expressions { pool: &pool, a: (0, middle), b: (middle, end) };
        let view = self.view(place, -place.level);
        enumeration::left(&view, &pair, self.task.rounding, WORTH, &mut self.scratch)
    }

    /// What is left of both trees in a box, and where B's begins; `None` where one of the bodies is nowhere in it.
    fn pruned(&self, place: &Place, level: f64) -> Option<(Vec<Token>, u32)> {
        let (near, far) = (self.view(place, self.deep), self.view(place, -level.max(self.far)));
        let mut pool = Vec::new();
        let mut middle = 0;
        for (side, solid, tokens) in [(Side::A, self.task.a, &place.a), (Side::B, self.task.b, &place.b)] {
            middle = if side == Side::A { 0 } else { pool.len() as u32 };
            let is_all = tokens.is_empty();
            if !is_all && solid.prune(tokens, &mut pool, &mut |id| between(&near, &far, side, id)) == Truth::False {
                return None;
            }
        }
        Some((pool, middle))
    }

    /// Puts the halves of a box back that are to be looked at: cut across the axis that costs its bound most, as the search does,
    /// unless that would make a slab of it. Where much of the box is cut off by what all clauses share, the rest is put back in their
    /// stead.
    pub fn split(&mut self, mut place: Place, is_open: impl Fn(&Place) -> bool) {
        if let Some(left) = self.left(&place) {
            if !left.span.is_empty() {
                tighten::shrink(&mut place.center, &mut place.half, &left.span);
                place.tightenings += 1;
                self.stack.push(place);
            }
            return;
        }
        place.tightenings = 0;
        let dearest = clause::axis_to_halve(place.cost, place.half);
        let longest = place.half.max_position();
        let k = if place.half[dearest] * SLAB < place.half[longest] { longest } else { dearest };
        for sign in [1.0, -1.0] {
            let mut child = place.clone();
            child.half[k] *= 0.5;
            child.center[k] += sign * child.half[k];
            if is_open(&child) {
                self.stack.push(child);
            }
        }
    }
}

/// What is known of a literal over a box for every level of F between those of two views: the lowest, where it is the hardest to
/// hold, and the highest.
pub(super) fn between(lowest: &View, highest: &View, side: Side, id: LiteralId) -> Truth {
    if highest.truth(side, id) == Truth::False {
        Truth::False
    } else if lowest.truth(side, id) == Truth::True {
        Truth::True
    } else {
        Truth::Open
    }
}

/// What the bounds of two bodies, each grown by `reach`, have in common; along A's axes.
pub(in crate::contact) fn common(task: &Task, at: &Instant, reach: f64) -> Aabb {
    let (of_a, of_b) = (task.model_a.bounds.root().aabb, task.model_b.bounds.root().aabb);
    let of_b = if of_b.is_finite() {
        Aabb::of_points(of_b.corners().iter().map(|c| at.a_point(*c)))
    } else if of_b.is_empty() {
        Aabb::EMPTY
    } else {
        Aabb::ALL
    };
    of_a.grown(reach).intersection(&of_b.grown(reach))
}

/// F at a point of A's frame.
pub(in crate::contact) fn value(task: &Task, at: &Instant, x: DVec3) -> f64 {
    task.a.value(x).max(task.b.value(at.b_point(x)))
}
