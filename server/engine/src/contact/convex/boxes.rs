//! Two boxes that only move along: the contact that their slabs tell.
//!
//! Along the axes of the first one all is short: the direction n across which they meet lies along an axis of either box or
//! across two edges. With what both boxes reach along it the gap at the start is φ, and t = φ / n·w the time of contact, of
//! which n is the proof: before it the gap along n is positive. The point is the corner that meets the face, or where the
//! edges cross.
//!
//! Boxes eroded by a depth L have their gap along n larger by L (|n|₁ + |m|₁), with n along A's axes and m along B's: they meet
//! that much later, at the same features, and the point where they do is L deep in both. This is the witness.
//!
//! The point has to lie on both surfaces, on no other faces than these, and the witness in both boxes. Whatever is not as
//! simple, edges in faces and what starts near, is left to others.

use super::slabs::{Across, Boxes, Features, Passage};
use super::whole::{APART, PrimitivePair, excluded};
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::{Contact, ContactKind, ContactPoint, NO_FACE, Outcome, Verdict};
use crate::contact::witness::extent::INCIDENT;
use glam::{DMat3, DVec3};

/// A face lies no flatter on another than this (radians): its neighbours are told apart.
const FLAT: f64 = 1e-6;
/// Gap that the proof may leave at the time of contact, in sizes of the pair.
const CLOSED: f64 = 1e-14;

/// Fills in the contact of two boxes that do not turn, or leaves `out` clear where they miss each other; `None` leaves them
/// to others.
#[inline(never)] // Its variables would widen the frame of every other way of answering.
pub fn meet(pair: &PrimitivePair, half: [DVec3; 2], query_options: QueryOptions, out: &mut Outcome) -> Option<()> {
    // (Arrays of two are written out where they are hot: a map over them stays a call.)
    let (a, b) = (pair.frame(0, &pair.axes(0)), pair.frame(1, &pair.axes(1)));
    let own = a.transpose();
    let boxes = Boxes { half, turned: own * b, way: own * pair.way, velocity: own * pair.velocity };
    match boxes.pass() {
        Passage::Miss => Some(()),
        Passage::Open => None,
        Passage::Across(across) => {
            out.counters.closed_forms += 1;
            Met::new(&boxes, across)?.report(pair, &a, query_options, out)
        }
    }
}

/// Two boxes and the direction across which they meet.
struct Met<'a> {
    boxes: &'a Boxes,
    features: Features,
    /// Unit, along the axes of A and of B.
    n: DVec3,
    m: DVec3,
    /// Of two edges: how far along A's they cross is the distance of B's from it, along this.
    crossing: DVec3,
}

impl<'a> Met<'a> {
    /// `None` where more lies across the direction than is said.
    #[inline]
    fn new(boxes: &'a Boxes, Across { features, sign }: Across) -> Option<Self> {
        let r = &boxes.turned;
        let mut crossing = DVec3::ZERO;
        let (n, m) = match features {
            Features::FaceOfA(i) => (DVec3::AXES[i] * sign, r.row(i) * sign),
            Features::FaceOfB(j) => (r.col(j) * sign, DVec3::AXES[j] * sign),
            Features::Edges(i, j) => {
                let across = DVec3::AXES[i].cross(r.col(j));
                let length = across.length();
                let n = across * (sign / length);
                crossing = r.col(j).cross(n) * (sign / length);
                (n, r.transpose() * n)
            }
        };
        let free = |v: DVec3, but: Option<usize>| (0..3).all(|k| Some(k) == but || v[k].abs() > FLAT);
        let is_free = match features {
            Features::FaceOfA(_) => free(m, None),
            Features::FaceOfB(_) => free(n, None),
            Features::Edges(i, j) => free(n, Some(i)) && free(m, Some(j)),
        };
        is_free.then_some(Self { boxes, features, n, m, crossing })
    }

    /// Where the boxes eroded by a depth meet, if they do so at a time; along A's axes.
    #[inline]
    fn point(&self, depth: f64, t: f64) -> DVec3 {
        let boxes = self.boxes;
        let corner = |k: usize, n: DVec3| (boxes.half[k] - depth).copysign(n);
        let seen = |y: DVec3| boxes.way - boxes.velocity * t + boxes.turned * y;
        match self.features {
            Features::FaceOfA(_) => seen(corner(1, -self.m)),
            Features::FaceOfB(_) => corner(0, self.n),
            Features::Edges(i, j) => {
                let (mut of_a, mut of_b) = (corner(0, self.n), corner(1, -self.m));
                (of_a[i], of_b[j]) = (0.0, 0.0);
                of_a[i] = (seen(of_b) - of_a).dot(self.crossing);
                of_a
            }
        }
    }

    /// How far a point lies outside each pair of opposite faces, of A and of B.
    #[inline]
    fn outside(&self, x: DVec3, t: f64) -> [DVec3; 2] {
        let boxes = self.boxes;
        let y = boxes.turned.transpose() * (x - (boxes.way - boxes.velocity * t));
        [x.abs() - boxes.half[0], y.abs() - boxes.half[1]]
    }

    /// Tells the contact if both boxes confirm it, or leaves `out` clear if it comes after the step.
    #[inline]
    fn report(&self, pair: &PrimitivePair, a: &DMat3, query_options: QueryOptions, out: &mut Outcome) -> Option<()> {
        let (boxes, n, m) = (self.boxes, self.n.abs(), self.m.abs());
        let phi = self.n.dot(boxes.way) - boxes.half[0].dot(n) - boxes.half[1].dot(m);
        let speed = self.n.dot(boxes.velocity);
        let least = excluded(pair.delta, pair.rounding);
        if phi <= APART * pair.delta || speed <= 0.0 {
            return None;
        }
        if phi - speed > 0.0 {
            return Some(());
        }
        let (each, level) = (1.0 / speed, pair.witness_level());
        let touch = phi * each;
        let deep = (phi + level * (n.element_sum() + m.element_sum())) * each;
        // The proof and the point are of one time.
        let left = phi - touch * speed;
        let is_closed = left > least && left.abs() <= CLOSED * (boxes.half[0] + boxes.half[1]).element_sum();
        if !(is_closed && 0.0 <= touch && touch <= deep && deep <= 1.0) {
            return None;
        }
        let (x, tol) = (self.point(0.0, touch), INCIDENT * pair.rounding);
        let on = self.outside(x, touch);
        let faces_at = |f: DVec3| f.cmpge(DVec3::splat(-tol)).bitmask().count_ones();
        let passing = [faces_at(on[0]), faces_at(on[1])];
        let of_faces = match self.features {
            Features::FaceOfA(_) => [1, 3],
            Features::FaceOfB(_) => [3, 1],
            Features::Edges(..) => [2, 2],
        };
        // Faces that pass through the point and hold nothing are the search's to tell.
        let is_on = on[0].max(on[1]).max_element() <= tol && passing == of_faces;
        let inside = self.outside(self.point(level, deep), deep);
        // Also false for what is not a number.
        if !(is_on && inside[0].max(inside[1]).max_element() <= -(pair.delta + pair.rounding)) {
            return None;
        }
        let point = query_options.point().then(|| {
            let (faces_a, faces_b) = self.faces(pair);
            ContactPoint {
                point: pair.point(pair.offsets[0], *a * x, touch),
                normal: (*a * self.n).normalize(),
                normal_speed: speed,
                kind: self.kind(),
                faces_a,
                faces_b,
                ..ContactPoint::default()
            }
        });
        out.counters.times += u64::from(query_options.time());
        out.counters.contacts += u64::from(query_options.point());
        out.verdict = Verdict::Contact(Contact { point, ..Contact::at(touch, deep) });
        out.apart = phi;
        Some(())
    }

    fn kind(&self) -> ContactKind {
        match self.features {
            Features::Edges(..) => ContactKind::EdgeEdge,
            _ => ContactKind::VertexFace,
        }
    }

    /// The ids of the faces that meet.
    fn faces(&self, pair: &PrimitivePair) -> ([u32; 3], [u32; 3]) {
        let but = |held: [bool; 3], k: usize, n: DVec3| {
            let first = pair.primitives[k].first_face;
            let (mut faces, mut count) = ([NO_FACE; 3], 0);
            for i in (0..3).filter(|i| held[*i]) {
                faces[count] = first + 2 * i as u32 + u32::from(n[i] < 0.0);
                count += 1;
            }
            faces
        };
        let one = |k: usize| [k == 0, k == 1, k == 2];
        let others = |k: usize| [k != 0, k != 1, k != 2];
        let held = match self.features {
            Features::FaceOfA(i) => [one(i), [true; 3]],
            Features::FaceOfB(j) => [[true; 3], one(j)],
            Features::Edges(i, j) => [others(i), others(j)],
        };
        (but(held[0], 0, self.n), but(held[1], 1, -self.m))
    }
}
