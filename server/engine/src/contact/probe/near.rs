//! How far a point is from a solid, or from its complement: branch and bound over voxels and parts, the lowest bound first.
//!
//! From below a part at the distance d of a point x is bounded by its box, by its hull and spines (`contact/distance/part`) along the
//! direction of the nearest point, and by f of what is left of the tree in it: f is 1-Lipschitz and not positive there, so d >= f(x).
//! The last is exact where the surface curves away from the point that is looked from, as a hole does. From above: `foot`.

use super::foot::Ground;
use super::{Sought, children, has_octree, open_voxel, worthwhile};
use crate::contact::distance::part::{Cut, Part, Parts};
use crate::contact::distance::polytope::support;
use crate::math::gjk::{Cores, of_supports};
use crate::math::{Aabb, BoundQueue};
use crate::octree::Node;
use crate::solid::Sense;
use crate::solid::local::{self, LiteralId, Truth};
use glam::DVec3;

/// Rounds in which a part takes tangents where its hull is nearest.
const ROUNDS: usize = 6;
/// Alternatives up to which a part is taken apart into them at any size.
const FEW: usize = 8;
/// Parts below this, relative to the size, are taken apart into however many alternatives they have.
const SMALL: f64 = 1e-3;
/// Relative gap to which the distance of hulls is found.
const EXACT: f64 = 1e-15;
/// Every so many looks the foot is looked for, once a few were.
const EVERY: u64 = 8;
/// Looks at first that each look for the foot.
const FIRST: u64 = 24;

/// What is nowhere deeper than so many roundings is nothing.
const SHALLOW: f64 = 4.0;
/// But for parts of no more than so many roundings.
const SMALL_PART: f64 = 128.0;

/// Convex faces this near to the foot, relative to the size, are touched there.
const TANGENT: f64 = 1e-6;

/// A cell of the queue.
#[derive(Clone, Copy, Debug)]
enum Place<'a> {
    /// A voxel, and how many terms are worth its decomposition.
    Voxel(&'a Node, usize),
    /// A part, and where its hull is nearest.
    Part(u32, DVec3),
}

/// When a search may end.
#[derive(Clone, Copy, Debug)]
pub struct Enough {
    /// How far apart the bounds may be, a length.
    pub tolerance: f64,
    /// A distance: once it is proven to be more, or no more, than this, that is enough too; NaN for no such one.
    pub threshold: f64,
    /// Parts that may be looked at.
    pub limit: u64,
}

/// What is known of the distance.
#[derive(Clone, Copy, Debug)]
pub struct Known {
    /// Proven from below, a length.
    pub lower: f64,
    /// Proven from above, a length.
    pub upper: f64,
    /// The nearest point that was found, the model's frame.
    pub foot: Option<DVec3>,
    /// Parts that were looked at.
    pub cells: u64,
}

/// The search for the distance of one point.
struct Search<'a> {
    ground: Ground<'a>,
    around: Aabb,
    parts: Parts<'a>,
    enough: Enough,
    queue: BoundQueue<Place<'a>>,
    done: f64,
    foot: Option<DVec3>,
    upper: f64,
    cells: u64,
}

/// The distance of a point from what is sought.
pub fn distance(ground: Ground, enough: Enough) -> Known {
    let parts = Parts::none(&ground.model.solid, ground.rounding);
    let (queue, around) = (BoundQueue::new(), Aabb::ALL);
    let (done, upper, foot) = (f64::INFINITY, f64::INFINITY, None);
    let mut search = Search { ground, around, parts, enough, queue, done, foot, upper, cells: 0 };
    search.keep(ground.descended());
    search.run()
}

impl<'a> Search<'a> {
    fn keep(&mut self, found: Option<DVec3>) {
        if let Some(y) = found {
            let away = (y - self.ground.x).length() + self.ground.rounding;
            if away < self.upper {
                (self.upper, self.foot) = (away, Some(y));
            }
        }
    }

    /// Above this nothing is looked at.
    fn goal(&self) -> f64 {
        self.upper - self.enough.tolerance
    }

    fn run(mut self) -> Known {
        let (model, x) = (self.ground.model, self.ground.x);
        let own = model.bounds.root().aabb.grown(8.0 * self.ground.rounding);
        if model.bounds.root().aabb.is_empty() && self.ground.sought == Sought::Solid {
            return self.known(f64::INFINITY);
        }
        // Where nothing was found of an unbounded solid a box of its faces' size is looked at.
        let reach = if self.upper.is_finite() {
            self.upper + 4.0 * self.ground.rounding
        } else if own.is_finite() {
            f64::INFINITY
        } else {
            1e3 * self.ground.scale
        };
        self.around = Aabb::around(x, DVec3::splat(reach)).intersection(&own);
        if self.around.is_empty() {
            return self.known(reach);
        }
        if has_octree(model) {
            self.look_at_voxel(model.octree.root(), usize::MAX, 0.0);
        } else {
            let tokens = self.ground.sought.expression(model.solid.normal_form.clone());
            self.look_at_new(&tokens, self.around, 0.0);
        }
        self.search();
        self.known(reach)
    }

    fn known(self, reach: f64) -> Known {
        let lower = self.queue.lowest().min(self.done).min(self.upper).min(reach).max(0.0);
        Known { lower, upper: self.upper, foot: self.foot, cells: self.cells }
    }

    fn is_enough(&self, lower: f64) -> bool {
        lower >= self.goal() || lower > self.enough.threshold || self.upper <= self.enough.threshold
    }

    fn search(&mut self) {
        let mut looks = 0u64;
        // What is done with bounds the distance by no more than that, whatever is found of the others.
        let may_gain = |search: &Self| search.queue.lowest() < search.done && search.cells < search.enough.limit;
        while !self.is_enough(self.queue.lowest().min(self.done)) && may_gain(self) {
            let Some((bound, place)) = self.queue.pop() else { return };
            match place {
                Place::Voxel(node, most) => self.open(node, most, bound),
                Place::Part(part, y) => {
                    looks += 1;
                    if looks <= FIRST || looks.is_multiple_of(EVERY) {
                        let found = self.ground.foot(&self.parts[part].tokens, y);
                        self.keep(found);
                    }
                    let bound = bound.max(self.at_foot(part));
                    if bound < self.goal() {
                        self.branch(part, y, bound);
                    } else {
                        self.done = self.done.min(bound);
                    }
                }
            }
        }
    }

    fn push(&mut self, place: Place<'a>, bound: f64) {
        if bound >= self.goal() {
            self.done = self.done.min(bound);
        } else {
            self.queue.push(bound, place);
        }
    }

    /// The distance of a box.
    fn of_box(&self, aabb: &Aabb) -> f64 {
        let x = self.ground.x;
        (x - x.clamp(aabb.min, aabb.max)).length() - self.ground.rounding
    }

    fn look_at_voxel(&mut self, node: &'a Node, most: usize, least: f64) {
        self.cells += 1;
        let aabb = node.aabb();
        if aabb.meets(&self.around) {
            self.push(Place::Voxel(node, most), least.max(self.of_box(&aabb)));
        }
    }

    /// Takes a voxel apart into its children, or makes a part of it.
    fn open(&mut self, node: &'a Node, most: usize, bound: f64) {
        if let Some(children) = children(self.ground.model, node, most) {
            for child in children {
                self.look_at_voxel(child, worthwhile(node), bound);
            }
            return;
        }
        let mut tokens = Vec::new();
        if open_voxel(self.ground.model, node, self.ground.sought, 0.0, &mut tokens) != Truth::False {
            let aabb = node.aabb().intersection(&self.around);
            self.look_at_new(&tokens, aabb, bound);
        }
    }

    /// A new part.
    fn look_at_new(&mut self, tokens: &[local::Token], aabb: Aabb, least: f64) {
        if !aabb.is_empty()
            && let Some(part) = self.parts.add(tokens, aabb)
        {
            self.look(part, least);
        }
    }

    /// Bounds a part and puts it to the others if it is open.
    fn look(&mut self, part: u32, least: f64) {
        self.cells += 1;
        let mut bound = least.max(self.of_box(&self.parts[part].aabb)).max(self.by_value(&self.parts[part]));
        if bound < self.goal() {
            bound = bound.max(self.by_spines(&self.parts[part]));
        }
        let mut y = self.parts[part].aabb.center();
        for _ in 0..ROUNDS {
            if bound >= self.goal() {
                break;
            }
            let hull = &self.parts[part].hull.corners;
            if hull.is_empty() {
                return;
            }
            if self.is_shallow(&self.parts[part]) {
                // A small part is shallow wherever it is, at an edge of a solid too: it counts.
                if self.parts[part].aabb.half().length() <= SMALL_PART * self.ground.rounding {
                    self.done = self.done.min(bound);
                }
                return;
            }
            match self.nearest(hull) {
                Some((found, u)) => {
                    y = found;
                    bound = bound.max(self.along(hull, u));
                }
                None => y = self.ground.x,
            }
            if !self.tighten(part, y) {
                break;
            }
        }
        self.push(Place::Part(part, y), bound);
    }

    /// The nearest point of the hull of some points, and the direction from there; `None` where the point is in it.
    fn nearest(&self, points: &[DVec3]) -> Option<(DVec3, DVec3)> {
        let x = self.ground.x;
        let between = x - points[0];
        let start = if between == DVec3::ZERO { DVec3::X } else { between };
        match of_supports(|v| support(points, v), |_| x, start, EXACT) {
            Cores::Apart { v, a, .. } => v.try_normalize().map(|u| (a, u)),
            Cores::Common(_) | Cores::Open => None,
        }
    }

    /// How far the point is beyond some points along a direction.
    fn along(&self, points: &[DVec3], u: DVec3) -> f64 {
        u.dot(self.ground.x) - u.dot(support(points, u)) - self.ground.rounding
    }

    fn by_value(&self, part: &Part) -> f64 {
        if part.tokens.is_empty() || part.tokens.iter().any(|t| local::is_part(*t)) {
            return f64::NEG_INFINITY;
        }
        let faces = &self.ground.model.solid.faces;
        local::value(&part.tokens, &mut |f| faces[f as usize].value(self.ground.x)) - self.ground.rounding
    }

    /// True where no point of a part is deeper in what is sought than `SHALLOW` roundings: a seam between solids that touch, or a sheet
    /// that a difference leaves, is nothing.
    fn is_shallow(&self, part: &Part) -> bool {
        let level = -SHALLOW * self.ground.rounding;
        let faces = &self.ground.model.solid.faces;
        let (c, corners) = (part.aabb.center(), &part.hull.corners);
        let low = |id: &LiteralId| {
            let face = &faces[id.face() as usize];
            let (value, g) = super::literal_at(self.ground.model, *id, c);
            match id.sense() {
                // Concave: least at a corner.
                Sense::Negative if face.is_convex() => {
                    corners.iter().map(|y| -face.value(*y)).fold(f64::INFINITY, f64::min)
                }
                Sense::Positive if face.is_convex() => {
                    corners.iter().map(|y| value + g.dot(*y - c)).fold(f64::INFINITY, f64::min)
                }
                Sense::Positive | Sense::Negative => f64::NEG_INFINITY,
            }
        };
        if part.literals.iter().any(|id| low(id) > level) {
            return true;
        }
        // Of two faces that lie on each other the one holds where the other does not.
        let of = |sense: Sense| part.literals.iter().filter(move |id| id.sense() == sense);
        let radius = part.aabb.half().length();
        of(Sense::Positive).any(|p| {
            of(Sense::Negative).any(|q| {
                let above = faces[p.face() as usize].above(&faces[q.face() as usize], c, radius);
                above.is_some_and(|(least, size)| least - 16.0 * f64::EPSILON * size > 2.0 * level)
            })
        })
    }

    fn by_spines(&self, part: &Part) -> f64 {
        let each = part.spines.iter().filter_map(|spine| {
            let (_, u) = self.nearest(&spine.points)?;
            Some(self.along(&spine.points, u) - spine.radius)
        });
        each.fold(f64::NEG_INFINITY, f64::max)
    }

    /// Takes the tangents of convex faces where a hull is nearest. False where nothing changes.
    fn tighten(&mut self, part: u32, y: DVec3) -> bool {
        let least = (0.02 * self.enough.tolerance).max(4.0 * self.ground.rounding);
        let faces = &self.ground.model.solid.faces;
        let outside = |id: &&LiteralId| {
            let face = &faces[id.face() as usize];
            id.sense() == Sense::Positive && face.is_convex() && face.value(y) > least
        };
        let ids: Vec<LiteralId> = self.parts[part].literals.iter().filter(outside).copied().collect();
        self.touch(part, &ids, y)
    }

    /// Cuts a part with the tangents of some faces at a point; true where one takes more.
    fn touch(&mut self, part: u32, ids: &[LiteralId], y: DVec3) -> bool {
        let mut changed = false;
        for id in ids {
            changed |= self.parts.refine(part, *id, y);
        }
        changed
    }

    /// The bound of a part once its hull has the tangents of convex faces at the foot: where all that is met there is convex they tell
    /// the distance itself.
    fn at_foot(&mut self, part: u32) -> f64 {
        let Some(foot) = self.foot else { return f64::NEG_INFINITY };
        let (model, near) = (self.ground.model, TANGENT * self.ground.scale);
        let met = |id: &&LiteralId| {
            let is_convex = id.sense() == Sense::Positive && model.solid.faces[id.face() as usize].is_convex();
            is_convex && super::literal_at(model, **id, foot).0 > -near
        };
        let ids: Vec<LiteralId> = self.parts[part].literals.iter().filter(met).copied().collect();
        let changed = self.touch(part, &ids, foot);
        let hull = &self.parts[part].hull.corners;
        if !changed || hull.is_empty() {
            return f64::NEG_INFINITY;
        }
        match self.nearest(hull) {
            Some((_, u)) => self.along(hull, u),
            None => f64::NEG_INFINITY,
        }
    }

    fn branch(&mut self, part: u32, y: DVec3, bound: f64) {
        let half = self.parts[part].aabb.half().max_element();
        if half <= 4.0 * f64::EPSILON * self.ground.scale {
            self.done = self.done.min(bound);
            return;
        }
        let cut = self.worst(part, y);
        for child in self.parts.cut(part, cut) {
            self.look(child, bound);
        }
    }

    /// How to take a part apart: by what is violated most at the nearest point of its hull.
    fn worst(&self, number: u32, y: DVec3) -> Cut {
        let part = &self.parts[number];
        let half = part.aabb.half();
        let mut worst = (0.0, Cut::Halves(half.max_position()));
        // On a seam all are met, and none holds at that depth.
        let shallow = SHALLOW * self.ground.rounding;
        for id in &part.literals {
            let value = super::literal_at(self.ground.model, *id, y).0 + shallow;
            if value > worst.0 {
                // Along the lines that it is straight along nothing is gained.
                let axis = self.ground.model.solid.faces[id.face() as usize].developable().unwrap_or(DVec3::ZERO);
                let across = (DVec3::ONE - axis * axis).max(DVec3::ZERO) * half * half;
                worst = (value, Cut::Halves(across.max_position()));
            }
        }
        for group in 0..part.groups.len() {
            let value = self.parts.group_value(part, group, y).unwrap_or(f64::INFINITY) + shallow;
            if value > worst.0 {
                let count = self.parts.alternatives(part, group);
                let is_small = half.max_element() < SMALL * self.ground.scale;
                let cut = match count {
                    Some(n) if n <= FEW || is_small => Cut::Alternatives(group),
                    Some(_) | None => Cut::Halves(half.max_position()),
                };
                worst = (value, cut);
            }
        }
        worst.1
    }
}
