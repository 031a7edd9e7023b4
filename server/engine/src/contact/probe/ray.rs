//! The first place of a ray that is deep in what is sought: the solid, or of a ray that begins in it the complement.
//!
//! With δ the depth asked for (16 E at least, E what rounding may do to a bound) a stretch of the ray is *free* where bounds of the literals
//! show f > −δ all along it. A place is a *witness* where f <= −2 E. Both are proofs, and what is less than 4 E long is one of
//! them since f is 1-Lipschitz: the search ends. Where a literal changes its sign is guessed by a face's own roots; the guess only
//! says where a ray is cut.
//!
//! From so far away that 16 E is more than the solid's octree and boxes are true to, no such depth says anything. There only f > 2 E
//! is free, by the whole tree; a stretch of 4 E that is neither stays open, and a ray with such a one is no miss.

use super::along::Line;
use super::foot::Ground;
use super::near::{Enough, distance};
use super::{
    PosedModel, Ray, RayAnswer, RayHit, RayOptions, RayOutcome, Sought, children, faces_at, has_octree, literal_at,
    open_voxel, rounding, three, worthwhile,
};
use crate::math::{Aabb, scaled};
use crate::octree::{Model, Node};
use crate::solid::local::{self, Token, Truth};
use glam::DVec3;

/// Literals up to which a stretch is cut at the roots of all of them.
const FEW_LITERALS: usize = 40;
/// Distance from a root at which the ray is cut, in E over the slope.
const BESIDE: f64 = 8.0;
/// Slopes below this count as this.
const FLAT: f64 = 1e-6;
/// Parts that may be looked at to tell a seam within from a surface.
const SEAM_LIMIT: u64 = 1000;
/// Steps of the way back to the surface, and of the halving there.
const STEPS: usize = 60;

/// Each stretch of a ray against a solid without bounds is so many times as long as the one before.
const LONGER: f64 = 64.0;
/// The longest one, over the distance of the ray's begin and the reach of the faces: there E is a hundredth of these.
const LONGEST: f64 = 1e10;

/// What a stretch holds.
#[derive(Clone, Copy, Debug)]
enum End {
    /// A witness at the second parameter, nothing being deep before the first.
    Witness(f64, f64),
    /// The limit of work, nothing being deep before.
    Limit(f64),
}

/// One ray against one solid.
struct Caster<'a> {
    model: &'a Model,
    line: Line,
    sought: Sought,
    /// E.
    rounding: f64,
    /// What literals are compared with: δ less what rounding takes.
    level: f64,
    limit: u64,
    cells: u64,
    /// Where E is coarse beside the solid: where the first stretch begins that is neither free nor has a witness; infinite where there
    /// is none. `None` where E is not.
    open: Option<f64>,
}

/// Where a line is in a box, and `None` where it passes by.
fn clipped(line: &Line, aabb: &Aabb) -> Option<(f64, f64)> {
    aabb.along(line.origin, line.direction).filter(|(from, to)| from <= to)
}

/// A ray against a solid. One without bounds is asked in ever longer stretches: what rounding may do grows with the length, and would hide
/// what is near.
pub fn of_ray(solid: &PosedModel, ray: &Ray, options: &RayOptions) -> RayAnswer {
    let model = solid.model;
    if model.bounds.root().aabb.is_finite() {
        return of_stretch(solid, ray, options, None);
    }
    let near = scaled::length(ray.origin - solid.pose.position) + model.face_reach + 1.0;
    let (mut length, mut cells, mut known) = (LONGER * near, 0, None);
    loop {
        let stretch = Ray { length: length.min(ray.length), ..*ray };
        let mut answer = of_stretch(solid, &stretch, options, known);
        answer.cells += cells;
        let RayOutcome::Miss { is_inside } = answer.outcome else { return answer };
        if length >= ray.length {
            return answer;
        }
        if length > LONGEST * near {
            return RayAnswer { outcome: RayOutcome::Undecided { until: stretch.length }, ..answer };
        }
        (length, cells) = (length * LONGER, answer.cells);
        known = Some(if is_inside { Sought::Complement } else { Sought::Solid });
    }
}

/// A ray against a solid in one stretch; `known`: what is sought from its begin on.
fn of_stretch(solid: &PosedModel, ray: &Ray, options: &RayOptions, known: Option<Sought>) -> RayAnswer {
    let miss = RayAnswer { outcome: RayOutcome::Miss { is_inside: false }, cells: 0 };
    let (model, aabb) = (solid.model, solid.model.bounds.root().aabb);
    if model.solid.is_empty() || aabb.is_empty() {
        return miss;
    }
    let turn = solid.pose.rotation.conjugate();
    let seen = |x: DVec3| turn * (x - solid.pose.position);
    let whole = Line { origin: seen(ray.origin), direction: turn * ray.direction };
    let far = scaled::length(ray.origin) + scaled::length(solid.pose.position);
    // From where the ray may be near the solid on it is told by coordinates of the solid's size.
    let (mut from, mut to): (f64, f64) = (0.0, ray.length);
    if aabb.is_finite() {
        let pad = rounding(model, far);
        let Some((enters, leaves)) = clipped(&whole, &aabb.grown(2.0 * pad)) else { return miss };
        // The parameters themselves are rounded, at a flat angle the more.
        let pad = pad + 1e-12 * (leaves - enters);
        (from, to) = (from.max(enters - pad), to.min(leaves + pad));
        if from > to {
            return miss;
        }
    }
    let undecided = |until: f64| RayAnswer { outcome: RayOutcome::Undecided { until }, cells: 0 };
    if !to.is_finite() {
        return undecided(0.0);
    }
    let line = Line { origin: seen(ray.at(from)), direction: whole.direction };
    let length = to - from;
    let rounding = rounding(model, line.origin.length() + length) + 8.0 * f64::EPSILON * (far + to);
    let most = if model.radius.is_finite() { 0.25 * model.margin() } else { f64::INFINITY };
    let is_coarse = rounding.is_nan() || 16.0 * rounding > most;
    if is_coarse && (rounding.is_nan() || 2.0 * rounding >= model.radius) {
        // Nothing of it is deep enough to be a witness.
        return undecided(from);
    }
    let depth = options.depth.min(most).max(16.0 * rounding);
    let level = if is_coarse { -2.0 * rounding } else { depth - 8.0 * rounding };
    let open = is_coarse.then_some(f64::INFINITY);
    let mut caster =
        Caster { model, line, sought: Sought::Solid, rounding, level, limit: options.limit, cells: 0, open };
    match known {
        Some(sought) => caster.sought = sought,
        None if from == 0.0 && caster.begins_inside() => caster.sought = Sought::Complement,
        None => {}
    }
    let is_inside = caster.sought == Sought::Complement;
    let ended = caster.run(length);
    let open = caster.open.unwrap_or(f64::INFINITY);
    let outcome = match ended {
        None if open < f64::INFINITY => RayOutcome::Undecided { until: from + open },
        None => RayOutcome::Miss { is_inside },
        Some(End::Limit(until)) => RayOutcome::Undecided { until: from + until.min(open) },
        Some(End::Witness(lower, upper)) => RayOutcome::Hit(caster.hit(solid, ray, from, (lower.min(open), upper))),
    };
    RayAnswer { outcome, cells: caster.cells }
}

impl Caster<'_> {
    fn value(&self, t: f64) -> f64 {
        self.sought.value(self.model, self.line.at(t))
    }

    fn is_witness(&self, t: f64) -> bool {
        self.value(t) <= -2.0 * self.rounding
    }

    fn begins_inside(&self) -> bool {
        let f = self.value(0.0);
        let near = 2.0 * self.rounding;
        if f.abs() >= near {
            return f < 0.0;
        }
        if self.open.is_some() {
            return false;
        }
        // On a face, which may be a seam within.
        let (model, x) = (self.model, self.line.origin);
        let scale = if model.radius.is_finite() { model.radius } else { x.length() + model.face_reach + 1.0 };
        let ground = Ground { model, sought: Sought::Complement, x, rounding: self.rounding, scale };
        let enough = Enough { tolerance: 8.0 * self.rounding, threshold: 16.0 * self.rounding, limit: SEAM_LIMIT };
        distance(ground, enough).lower > 16.0 * self.rounding
    }

    fn run(&mut self, length: f64) -> Option<End> {
        if has_octree(self.model) && self.open.is_none() {
            let aabb = self.model.octree.root().aabb();
            let inside = clipped(&self.line, &aabb).map(|(a, b)| (a.max(0.0), b.min(length)));
            let Some((a, b)) = inside.filter(|(a, b)| a <= b) else { return self.beyond(0.0, length) };
            return self
                .beyond(0.0, a)
                .or_else(|| self.through(self.model.octree.root(), (a, b), usize::MAX))
                .or_else(|| self.beyond(b, length));
        }
        let tokens = self.sought.expression(self.model.solid.normal_form.clone());
        self.search(&tokens, (0.0, length), true)
    }

    /// What is outside of the octree: empty.
    fn beyond(&mut self, a: f64, b: f64) -> Option<End> {
        match self.sought {
            Sought::Complement if b > a => {
                let at = [a, b].into_iter().find(|t| self.is_witness(*t));
                at.map(|t| End::Witness(a, t))
            }
            Sought::Complement | Sought::Solid => None,
        }
    }

    /// A stretch through a voxel. It leaves the voxel by no more than E.
    fn through(&mut self, node: &Node, (a, b): (f64, f64), most: usize) -> Option<End> {
        if let Some(children) = children(self.model, node, most) {
            let mut cuts = [a, b, b, b, b];
            let crosses = |k: usize| (node.center[k] - self.line.origin[k]) / self.line.direction[k];
            let mut count = 1;
            for t in [0, 1, 2].map(crosses) {
                if t > a && t < b {
                    cuts[count] = t;
                    count += 1;
                }
            }
            cuts[1..count].sort_by(f64::total_cmp);
            for k in 0..count {
                let (p, q) = (cuts[k], cuts[k + 1]);
                let x = self.line.at(0.5 * (p + q));
                let child = (0..8).find(|i| children[*i].aabb().contains(x)).unwrap_or_else(|| nearest(children, x));
                let found = self.through(&children[child], (p, q), worthwhile(node));
                if found.is_some() {
                    return found;
                }
            }
            return None;
        }
        let mut tokens = Vec::new();
        match open_voxel(self.model, node, self.sought, self.level, &mut tokens) {
            Truth::False => None,
            Truth::Open => self.search(&tokens, (a, b), true),
            Truth::True => match self.is_witness(a) {
                true => Some(End::Witness(a, a)),
                // Of what is known at a depth the whole tree is asked where rounding stands in the way.
                false => {
                    let tokens = self.sought.expression(self.model.solid.normal_form.clone());
                    self.search(&tokens, (a, b), true)
                }
            },
        }
    }

    /// The first witness in a stretch, by what is left of the tree in it; `None` where it is free.
    fn search(&mut self, tokens: &[Token], (a, b): (f64, f64), at_roots: bool) -> Option<End> {
        self.cells += 1;
        if self.cells > self.limit {
            return Some(End::Limit(a));
        }
        let mut left = Vec::new();
        let (solid, line, level, rounding) = (&self.model.solid, &self.line, self.level, self.rounding);
        let truth = solid.prune(tokens, &mut left, &mut |id| {
            let (lo, hi) = line.span(&solid.faces[id.face() as usize], a, b);
            local::truth_of(id.sense(), (lo - rounding, hi + rounding), level, 0.0)
        });
        if truth == Truth::False {
            return None;
        }
        if self.is_witness(a) {
            return Some(End::Witness(a, a));
        }
        let short = if self.open.is_some() { 4.0 * rounding } else { 4.0 * level };
        if b - a <= short && self.is_witness(b) {
            return Some(End::Witness(a, b));
        }
        if let Some(open) = &mut self.open
            && b - a <= short
        {
            *open = open.min(a);
            return None;
        }
        let middle = 0.5 * (a + b);
        if !(a < middle && middle < b) {
            return Some(End::Limit(a));
        }
        let tokens = if truth == Truth::Open { left.as_slice() } else { tokens };
        if at_roots && let Some(cuts) = self.roots(tokens, a, b) {
            for pair in cuts.windows(2) {
                let found = self.search(tokens, (pair[0], pair[1]), false);
                if found.is_some() {
                    return found;
                }
            }
            return None;
        }
        self.search(tokens, (a, middle), at_roots).or_else(|| self.search(tokens, (middle, b), at_roots))
    }

    /// Where a stretch is cut: beside the roots of its literals. `None` where there are none, or too many.
    fn roots(&self, tokens: &[Token], a: f64, b: f64) -> Option<Vec<f64>> {
        if tokens.iter().any(|t| local::is_part(*t)) || local::literals(tokens).count() > FEW_LITERALS {
            return None;
        }
        let mut found = Vec::new();
        for id in local::literals(tokens) {
            self.line.crossings(&self.model.solid.faces[id.face() as usize], a, b, &mut found);
        }
        if found.is_empty() {
            return None;
        }
        let mut cuts = vec![a, b];
        for (t, slope) in found {
            let beside = BESIDE * self.rounding / slope.max(FLAT);
            cuts.extend([t - beside, t + beside].into_iter().filter(|t| *t > a && *t < b));
        }
        cuts.sort_by(f64::total_cmp);
        cuts.dedup();
        (cuts.len() > 2).then_some(cuts)
    }

    /// Where the surface is crossed at or before a witness: back from it to where f is not negative, then by halves.
    fn crossing(&self, lower: f64, upper: f64) -> f64 {
        let (mut out, mut within) = (lower, upper);
        let mut step = (upper - lower).max(self.rounding);
        for _ in 0..STEPS {
            if self.value(out) >= 0.0 || out == 0.0 {
                break;
            }
            (within, out, step) = (out, (out - step).max(0.0), 2.0 * step);
        }
        for _ in 0..STEPS {
            let middle = 0.5 * (out + within);
            if !(out < middle && middle < within) {
                break;
            }
            if self.value(middle) < 0.0 { within = middle } else { out = middle }
        }
        within
    }

    fn hit(&self, solid: &PosedModel, ray: &Ray, from: f64, (lower, upper): (f64, f64)) -> RayHit {
        let t = self.crossing(lower, upper);
        let x = self.line.at(t);
        let found = faces_at(self.model, x, 4.0 * self.rounding + 1e-12 * self.model.size());
        // Of the faces that meet there, one that is crossed.
        let way = |n: DVec3| n.dot(self.line.direction) * self.sought.depth(1.0);
        let normal = |id| literal_at(self.model, id, x).1.normalize_or(DVec3::Z);
        let crossed = found.iter().copied().find(|id| way(normal(*id)) < 0.0).unwrap_or(found[0]);
        RayHit {
            lower: from + lower.min(t),
            t: from + t,
            upper: from + upper,
            point: ray.at(from + t),
            normal: solid.pose.vector(normal(crossed)),
            face: crossed.face(),
            primitive: self.model.solid.face_owner[crossed.face() as usize],
            faces: three(&found),
            is_leaving: self.sought == Sought::Complement,
        }
    }
}

/// The voxel whose centre is nearest to a point that rounding has put beside all of them.
fn nearest(nodes: &[Node; 8], x: DVec3) -> usize {
    let away = |i: &usize| (nodes[*i].center - x).length_squared();
    (0..8).min_by(|i, j| away(i).total_cmp(&away(j))).unwrap_or(0)
}
