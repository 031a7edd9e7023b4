//! A convex body as the hull of discs of one axis, and how far it reaches when cut by one plane.
//!
//! A cylinder or frustum is the hull of its two rims, a ball one disc without an axis (all directions count), a capsule two of them,
//! a box or a polyhedron the hull of its corners: discs of radius 0. Along w the disc about c with radius r reaches c·w + r|w⊥|, w⊥ the
//! part of w across the axis.
//!
//! Of a body P cut by half-spaces n_k·x <= d_k no point reaches farther along u than
//!
//! ```text
//! max over P of (u − μ)·x + κ,   μ = Σ λ_k n_k, κ = Σ λ_k d_k, any λ >= 0        (weak duality),
//! ```
//!
//! and the least of these over λ is what the cut body reaches, where one plane is enough for it. `Moment::best` finds that
//! least for each plane alone: a convex function of one number, the largest of a few hyperbolas. What it finds is used as
//! a multiplier, never as a proof: `proof` evaluates φ afresh, which holds for whatever multipliers.

use crate::math::any_perpendicular;
use crate::motion::Instant;
use crate::solid::Primitive;
use crate::solid::local::LiteralId;
use crate::solid::primitive::{Convex, Discs};
use glam::DVec3;
use smallvec::SmallVec;

/// Largest multiplier of a plane, against 1 for the wall: beyond it a body lands on the plane rather than on the wall.
const MOST: f64 = 4096.0;
/// Steps of the search for one multiplier.
const STEPS: usize = 8;

/// Corners of a polyhedron up to which each is a disc.
const MOST_CORNERS: usize = 32;

/// True when three faces meet in every corner of a polyhedron: 2E = 3V, and V − E + F = 2 (Euler).
fn is_simple(p: &Primitive, corners: &[DVec3]) -> bool {
    corners.len() + 4 == 2 * p.faces.len()
}

/// A convex body in its model's frame.
#[derive(Clone, Debug)]
pub(super) struct CavityBody {
    pub discs: Discs,
    /// Common axis; `None` for a ball and a capsule, whose discs are balls.
    pub axis: Option<DVec3>,
}

impl CavityBody {
    /// `None` for what has no bounds, and for a polyhedron of many corners or with one in which more than three faces meet: which of
    /// them hold it is for the search to say.
    pub fn of(p: &Primitive) -> Option<Self> {
        let (at, z) = (&p.frame, p.frame.vector(DVec3::Z).normalize());
        let shape = p.shape.convex();
        if let Convex::Corners(c) = shape
            && !(c.len() <= MOST_CORNERS && is_simple(p, c))
        {
            return None;
        }
        let mut discs = shape.discs()?;
        discs.iter_mut().for_each(|(c, _)| *c = at.point(*c));
        Some(Self { discs, axis: (shape.margin() == 0.0).then_some(z) })
    }
}

/// A half-space n·x <= d, with the literal that bounds the solid there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub normal: DVec3,
    pub offset: f64,
    pub literal: LiteralId,
}

/// A linear bound: points beyond the wall have u·x >= base, those of the cut body u·x <= max over P of (u − μ)·x + κ.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bound {
    pub u: DVec3,
    pub base: f64,
    pub mu: DVec3,
    pub kappa: f64,
}

impl Bound {
    /// w = u − μ: along which the body's reach is asked for.
    pub fn w(&self) -> DVec3 {
        self.u - self.mu
    }

    /// |u| + |w| + |μ|: a contact of depth delta needs phi <= −delta·weight.
    pub fn weight(&self) -> f64 {
        self.u.length() + self.w().length() + self.mu.length()
    }
}

/// A bound with the multiplier that is best at a moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    pub bound: Bound,
    /// How far the cut body stays from the wall.
    pub phi: f64,
    /// The body's point that reaches farthest.
    pub x: DVec3,
    /// The plane that cuts there, with its multiplier.
    pub plane: Option<(usize, f64)>,
}

impl Best {
    /// True when the body lands on a plane rather than on the wall.
    pub fn lands(&self) -> bool {
        self.plane.is_some_and(|(_, lambda)| lambda >= 0.5 * MOST)
    }

    /// How far beyond the wall the body's point is, were it not for the planes.
    pub fn beyond(&self) -> f64 {
        self.bound.u.dot(self.x) - self.bound.base
    }
}

/// The body where it stands at an instant, in the frame of the wall.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    pub at: Instant,
    pub discs: Discs,
    pub axis: Option<DVec3>,
    /// Planes that it crosses.
    crossed: SmallVec<[u8; 8]>,
}

impl Moment {
    pub fn new(body: &CavityBody, at: Instant, planes: &[Plane]) -> Self {
        let discs = body.discs.iter().map(|(c, r)| (at.b_point(*c), *r)).collect();
        let axis = body.axis.map(|a| at.b_from_a * a);
        let mut m = Self { at, discs, axis, crossed: SmallVec::new() };
        for (k, plane) in planes.iter().enumerate() {
            if m.reach(plane.normal).0 > plane.offset {
                m.crossed.push(k as u8);
            }
        }
        m
    }

    /// The part of v that a disc reaches along.
    pub fn across(&self, v: DVec3) -> DVec3 {
        self.axis.map_or(v, |a| v - a * a.dot(v))
    }

    /// How far the body reaches along w, and with which disc.
    pub fn reach(&self, w: DVec3) -> (f64, usize) {
        let across = self.across(w).length();
        let mut best = (f64::NEG_INFINITY, 0);
        for (i, (c, r)) in self.discs.iter().enumerate() {
            let reach = c.dot(w) + r * across;
            if reach > best.0 {
                best = (reach, i);
            }
        }
        best
    }

    /// The disc's point farthest along w.
    fn point(&self, i: usize, w: DVec3) -> DVec3 {
        let (c, r) = self.discs[i];
        c + self.across(w).try_normalize().unwrap_or_else(|| self.axis.map_or(DVec3::X, any_perpendicular)) * r
    }

    /// The best bound along u, uncut or cut by one of the planes.
    pub fn best(&self, u: DVec3, base: f64, planes: &[Plane]) -> Best {
        let (reach, i) = self.reach(u);
        let bound = Bound { u, base, mu: DVec3::ZERO, kappa: 0.0 };
        let mut best = Best { bound, phi: base - reach, x: DVec3::ZERO, plane: None };
        let mut held = [i, i];
        for k in &self.crossed {
            let plane = &planes[usize::from(*k)];
            let line = Line { moment: self, u, plane, p: self.across(u), q: self.across(plane.normal) };
            let (lambda, reach, by) = line.least(i);
            if lambda > 0.0 && base - reach > best.phi {
                let bound = Bound { mu: plane.normal * lambda, kappa: plane.offset * lambda, ..bound };
                best = Best { bound, phi: base - reach, plane: Some((usize::from(*k), lambda)), ..best };
                held = by;
            }
        }
        let w = best.bound.w();
        best.x = self.point(held[0], w);
        if let Some((k, _)) = best.plane
            && held[0] != held[1]
        {
            // Between two discs: where the plane cuts.
            let other = self.point(held[1], w);
            let along = planes[k].normal.dot(other - best.x);
            if along != 0.0 {
                let s = (planes[k].offset - planes[k].normal.dot(best.x)) / along;
                best.x += (other - best.x) * s.clamp(0.0, 1.0);
            }
        } else if best.plane.is_none() {
            // Discs that reach as far leave a line or a face open: half of it that lies within the planes.
            let tie = 1e-9 * (reach - self.discs[i].0.dot(u)).abs().max(self.discs[i].1);
            let mut others = (0..self.discs.len()).filter(|j| *j != i);
            let across = self.across(u).length();
            let same = |j: &usize| reach - self.discs[*j].0.dot(u) - self.discs[*j].1 * across <= tie;
            if let Some(j) = others.rfind(same) {
                let (from, way) = (best.x, self.point(j, u) - best.x);
                let (mut lo, mut hi) = (0.0f64, 1.0f64);
                for plane in planes {
                    let (gap, rate) = (plane.offset - plane.normal.dot(from), plane.normal.dot(way));
                    if rate > 0.0 {
                        hi = hi.min(gap / rate);
                    } else if rate < 0.0 {
                        lo = lo.max(gap / rate);
                    }
                }
                best.x = from + way * (0.5 * (lo + hi)).clamp(0.0, 1.0);
            }
        }
        best
    }
}

/// The reach along u − λ n, plus λ d, as a function of λ.
struct Line<'a> {
    moment: &'a Moment,
    u: DVec3,
    plane: &'a Plane,
    /// Across the discs' axis: of u and of n.
    p: DVec3,
    q: DVec3,
}

impl Line<'_> {
    fn value(&self, i: usize, l: f64) -> f64 {
        let (c, r) = self.moment.discs[i];
        c.dot(self.u) + l * (self.plane.offset - c.dot(self.plane.normal)) + r * (self.p - self.q * l).length()
    }

    fn slope(&self, i: usize, l: f64) -> f64 {
        let (c, r) = self.moment.discs[i];
        let v = self.p - self.q * l;
        let length = v.length();
        let turn = if length > 0.0 { -self.q.dot(v) / length } else { 0.0 };
        self.plane.offset - c.dot(self.plane.normal) + r * turn
    }

    /// The disc that reaches farthest, and how far.
    fn highest(&self, l: f64) -> (f64, usize) {
        let mut best = (f64::NEG_INFINITY, 0);
        for i in 0..self.moment.discs.len() {
            let value = self.value(i, l);
            if value > best.0 {
                best = (value, i);
            }
        }
        best
    }

    /// Where one disc's hyperbola is lowest.
    fn bottom(&self, i: usize) -> f64 {
        let (c, r) = self.moment.discs[i];
        let (m, q2) = (self.plane.offset - c.dot(self.plane.normal), self.q.length_squared());
        let room = r * r * q2 - m * m;
        if room <= 0.0 {
            return if m > 0.0 { f64::NEG_INFINITY } else { f64::INFINITY };
        }
        let q = q2.sqrt();
        let along = self.p.dot(self.q) / q;
        let k = (self.p.length_squared() - along * along).max(0.0).sqrt();
        (along - m * k / room.sqrt()) / q
    }

    /// Where two discs reach as far, between l and r, if they do.
    fn crossing(&self, i: usize, j: usize, l: f64, r: f64) -> f64 {
        let ((a, ra), (b, rb)) = (self.moment.discs[i], self.moment.discs[j]);
        if ra == rb {
            // Linear: (a − b)·(u − λ n) = 0.
            let way = a - b;
            return (way.dot(self.u) / way.dot(self.plane.normal)).clamp(l, r);
        }
        let (mut l, mut r) = (l, r);
        let gap = |at: f64| self.value(i, at) - self.value(j, at);
        let (mut fl, mut fr) = (gap(l), gap(r));
        let mut at = 0.5 * (l + r);
        // Regula falsi with halved weights (Illinois).
        for _ in 0..40 {
            at = if fl == fr { 0.5 * (l + r) } else { (l * fr - r * fl) / (fr - fl) };
            let f = gap(at);
            if f == 0.0 || (r - l) <= 1e-15 * r {
                break;
            }
            if (f > 0.0) == (fl > 0.0) {
                (l, fl) = (at, f);
                fr *= 0.5;
            } else {
                (r, fr) = (at, f);
                fl *= 0.5;
            }
        }
        at
    }

    /// The multiplier with the least reach, that reach, and the disc or the two discs that hold it; `first` reaches
    /// farthest at 0.
    fn least(&self, first: usize) -> (f64, f64, [usize; 2]) {
        let (mut l, mut a) = (0.0, first);
        if self.slope(a, l) >= 0.0 {
            return (0.0, self.value(a, 0.0), [a, a]);
        }
        let mut r = MOST;
        let (mut high, mut b) = self.highest(r);
        if self.slope(b, r) <= 0.0 {
            return (r, high, [b, b]);
        }
        let mut best = (r, high, [b, b]);
        for _ in 0..STEPS {
            let (mut at, mut by) = (0.0, [a, b]);
            if a == b {
                at = self.bottom(a).clamp(l, r);
            } else {
                let x = self.crossing(a, b, l, r);
                if self.slope(a, x) > 0.0 {
                    (at, by) = (self.bottom(a).clamp(l, r), [a, a]);
                } else if self.slope(b, x) < 0.0 {
                    (at, by) = (self.bottom(b).clamp(l, r), [b, b]);
                } else {
                    at = at.max(x);
                }
            }
            let k;
            (high, k) = self.highest(at);
            if high < best.1 {
                best = (at, high, by);
            }
            if by.contains(&k) || at <= l || at >= r {
                break;
            }
            if self.slope(k, at) < 0.0 {
                (l, a) = (at, k);
            } else {
                (r, b) = (at, k);
            }
        }
        best
    }
}
