//! A contact from its direction, its time and the features that meet: the point, the witness of depth delta, and what is told
//! of both.
//!
//! The point follows from the features, the witness from one linear step or a few, and both trees confirm both. What meets in
//! more than its features tell is left to others.

use super::part::{Active, ConvexPart};
use super::turns::Turns;
use super::whole::PrimitivePair;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::{Contact, ContactKind, ContactPoint, Extent, NO_FACE, Outcome, Verdict};
use crate::contact::witness::extent::{self, INCIDENT};
use crate::contact::witness::newton::{Constraint, MAX_ACTIVE, cholesky_solve};
use crate::solid::primitive::Shown;
use glam::{DMat3, DQuat, DVec3};
use smallvec::SmallVec;

/// Further steps to where every active constraint is met at a depth.
const SINKS: usize = 4;

/// An active constraint where it is met; world axes.
#[derive(Clone, Copy, Default)]
struct Row {
    value: f64,
    normal: DVec3,
    /// d(value)/dt, length per step.
    rate: f64,
    /// How much its value has to fall for a depth of 1.
    sinks: f64,
    /// Curvature: across the axis, or in every direction along the surface.
    bend: f64,
    axis: DVec3,
    all: bool,
}

impl Row {
    fn hessian(&self) -> DMat3 {
        let outer = |u: DVec3| DMat3::from_cols(u * u.x, u * u.y, u * u.z) * self.bend;
        if self.all {
            DMat3::from_diagonal(DVec3::splat(self.bend)) - outer(self.normal)
        } else {
            outer(self.axis.cross(self.normal).normalize_or_zero())
        }
    }
}

/// A contact that both trees confirm; world axes.
pub struct Touch {
    /// The point seen from A's centre at the time.
    x: DVec3,
    /// Offset of A's centre at the time.
    offset: DVec3,
    /// Where the surfaces meet.
    pub t: f64,
    /// A verified witness of depth delta exists then.
    pub deep: f64,
    /// Unit direction from a to b.
    pub normal: DVec3,
    speed: f64,
    kind: ContactKind,
    extent: Extent,
    faces: [[u32; 3]; 2],
}

impl Touch {
    /// Tells that they meet, where nothing is proven to be free after `time_lower`: a witness is all of a hit.
    pub fn report_hit(&self, time_lower: f64, out: &mut Outcome) {
        out.verdict = Verdict::Contact(Contact { time_lower, ..Contact::at(self.deep, self.deep) });
    }

    /// Tells the contact, before which everything is proven to be free.
    pub fn report(&self, pair: &PrimitivePair, query_options: QueryOptions, out: &mut Outcome) {
        out.counters.times += u64::from(query_options.time());
        out.counters.contacts += u64::from(query_options.point());
        let [faces_a, faces_b] = self.faces;
        let point = query_options.point().then(|| ContactPoint {
            point: pair.point(self.offset, self.x, self.t),
            normal: self.normal,
            normal_speed: self.speed,
            kind: self.kind,
            extent: self.extent,
            faces_a,
            faces_b,
            ..ContactPoint::default()
        });
        out.verdict = Verdict::Contact(Contact { point, ..Contact::at(self.t, self.deep) });
    }
}

/// Two bodies at one time; world axes, seen from A's centre.
pub struct Stand<'a> {
    pair: &'a PrimitivePair<'a>,
    /// How they turn; `None` where they only move along.
    turns: Option<&'a Turns>,
    /// What they are, as they stand.
    pub parts: [ConvexPart<'a>; 2],
    /// World from model.
    models: [DMat3; 2],
    /// From the centres of rotation to the primitives'.
    offsets: [DVec3; 2],
    /// From A's centre to B's.
    way: DVec3,
    t: f64,
}

impl<'a> Stand<'a> {
    /// The pair at the start.
    #[inline]
    pub fn new(
        pair: &'a PrimitivePair<'a>,
        parts: [ConvexPart<'a>; 2],
        models: [DMat3; 2],
        turns: Option<&'a Turns>,
    ) -> Self {
        Self { pair, turns, parts, models, offsets: pair.offsets, way: pair.way, t: 0.0 }
    }

    fn set_models(&mut self) {
        for (model, part) in self.models.iter_mut().zip(&self.parts) {
            let frame = part.primitive.frame.rotation;
            *model = if frame == DQuat::IDENTITY { part.axes } else { part.axes * DMat3::from_quat(frame).transpose() };
        }
    }

    /// The same at another time.
    #[inline]
    pub fn to(&mut self, t: f64) {
        self.t = t;
        let Some(turns) = self.turns else {
            self.way = self.pair.at(t);
            return;
        };
        let posed = turns.at(t);
        (self.way, self.offsets) = (posed.way, posed.offsets);
        self.parts[0].axes = posed.axes[0];
        self.parts[1].axes = posed.axes[1];
        self.set_models();
    }

    /// A point in a body's own model.
    #[inline]
    pub fn own(&self, k: usize, x: DVec3) -> DVec3 {
        let x = if k == 0 { x } else { x - self.way };
        self.models[k].transpose() * x + self.parts[k].primitive.frame.position
    }

    /// A direction along a body's own model.
    pub fn own_vector(&self, k: usize, n: DVec3) -> DVec3 {
        self.models[k].transpose() * n
    }

    /// True when a point lies this deep in both bodies.
    fn is_deep(&self, x: DVec3, level: f64) -> bool {
        (0..2).all(|k| {
            let own = self.own(k, x);
            self.parts[k].primitive.faces.listed().iter().all(|f| f.value(own) <= -level)
        })
    }

    /// How many faces of both bodies pass within `tol` of a point on both surfaces; `None` for another point.
    fn passing(&self, x: DVec3, tol: f64) -> Option<[usize; 2]> {
        let mut passing = [0; 2];
        for k in 0..2 {
            let own = self.own(k, x);
            for face in self.parts[k].primitive.faces.listed() {
                let value = face.value(own);
                if value.is_nan() || value > tol {
                    return None;
                }
                passing[k] += usize::from(value >= -tol);
            }
        }
        (passing[0].min(passing[1]) > 0).then_some(passing)
    }

    /// Velocity of a body's own point at x, in the frame that moves with A's centre.
    fn carried(&self, k: usize, x: DVec3) -> DVec3 {
        match (self.turns, k) {
            (None, 0) => DVec3::ZERO,
            (None, _) => -self.pair.velocity,
            (Some(turns), 0) => turns.spins[0].cross(x),
            (Some(turns), _) => {
                let arm = x - self.way + self.offsets[1];
                turns.spins[1].cross(arm) - turns.spins[0].cross(self.offsets[0]) - self.pair.velocity
            }
        }
    }

    /// The contact at a time, along n and between the features shown there, if both trees confirm it. The bodies are left at
    /// another time.
    pub fn confirm(&mut self, n: DVec3, t: f64, shown: &[Shown; 2]) -> Option<Touch> {
        self.to(t);
        let x = self.point(n, shown)?;
        let mut active = Active::new();
        self.parts[0].faces(Side::A, n, self.models[0].transpose() * n, &shown[0], &mut active);
        let of_a = active.len();
        self.parts[1].faces(Side::B, -n, self.models[1].transpose() * -n, &shown[1], &mut active);
        if active.len() > MAX_ACTIVE {
            return None;
        }
        self.confirm_at(x, n, (&active, of_a), false)
    }

    /// The contact at the time of now in a point of both bodies, along n and between active faces, the first `of_a` of
    /// which are A's; the bodies are left at another time. What `any` more faces pass through the point, they hold
    /// nothing that n does not tell.
    pub fn confirm_at(&mut self, mut x: DVec3, n: DVec3, (active, of_a): (&Active, usize), any: bool) -> Option<Touch> {
        let pair = self.pair;
        let mut rows = [Row::default(); MAX_ACTIVE];
        self.rows(active, x, &mut rows);
        let tol = INCIDENT * pair.rounding;
        let passing = match self.passing(x, tol) {
            Some(passing) => passing,
            None => {
                x = self.sink(&rows, active.len(), x, 0.0)?;
                self.rows(active, x, &mut rows);
                self.passing(x, tol)?
            }
        };
        let t = self.t;
        let (a, b) = (self.carried(0, x), self.carried(1, x));
        let mut touch = Touch {
            x,
            offset: self.offsets[0],
            t,
            deep: t,
            normal: n,
            speed: (a - b).dot(n),
            kind: ContactKind::FaceFace,
            extent: Extent::Point,
            faces: [[NO_FACE; 3]; 2],
        };
        touch.describe(active, of_a, &rows, pair.scale);
        let noted = [extent::noted(&touch.faces[0]), extent::noted(&touch.faces[1])];
        // Faces that pass through the point and hold nothing are the search's to tell.
        if touch.kind == ContactKind::VertexVertex || (!any && touch.extent == Extent::Point && passing != noted) {
            return None;
        }
        // Round faces bend away from the first order: the deeper, the farther.
        let level = pair.delta + pair.rounding;
        let mut deep = self.sink(&rows, active.len(), x, pair.witness_level())?;
        let mut is_deep = self.is_deep(deep, level);
        for _ in 0..SINKS {
            if is_deep {
                break;
            }
            self.rows(active, deep, &mut rows);
            deep = self.sink(&rows, active.len(), deep, pair.witness_level())?;
            is_deep = self.is_deep(deep, level);
        }
        touch.deep = self.t;
        (is_deep && 0.0 <= t && t <= touch.deep && touch.deep <= 1.0).then_some(touch)
    }

    /// A point of both bodies at the time of contact.
    fn point(&self, n: DVec3, shown: &[Shown; 2]) -> Option<DVec3> {
        let of_a = shown[0].ends;
        let of_b = shown[1].ends.map(|p| self.way + p);
        let free = |s: &Shown| !s.flat && s.held == 0;
        if free(&shown[0]) {
            return Some(of_a[0]);
        }
        if free(&shown[1]) {
            return Some(of_b[0]);
        }
        if shown[0].flat || shown[1].flat {
            return self.on_flat(n, shown);
        }
        let (p, q) = (of_a[1] - of_a[0], of_b[1] - of_b[0]);
        let (start, det) = (of_b[0] - of_a[0], n.dot(p.cross(q)));
        let square = p.length_squared();
        if det.abs() > 1e-9 * square.sqrt() * q.length() {
            return Some(of_a[0] + p * (n.dot(start.cross(q)) / det));
        }
        // Along each other: the middle of what they have in common.
        let (s, r) = (start.dot(p) / square, (start + q).dot(p) / square);
        let (from, to) = (s.min(r).max(0.0), s.max(r).min(1.0));
        (from < to).then(|| of_a[0] + p * (0.5 * (from + to)))
    }

    /// The middle of what two discs have in common, or a disc and a segment.
    fn on_flat(&self, n: DVec3, shown: &[Shown; 2]) -> Option<DVec3> {
        let centers = [DVec3::ZERO, self.way];
        let disc = |k: usize| {
            let outward = if k == 0 { n } else { -n };
            let (half, radius) = self.parts[k].features.disc(outward.dot(self.parts[k].axes.z_axis) >= 0.0)?;
            Some((centers[k] + outward * half, radius))
        };
        let across = |v: DVec3| v - n * v.dot(n);
        match (shown[0].flat, shown[1].flat) {
            (true, true) => {
                let ((p, r), (q, s)) = (disc(0)?, disc(1)?);
                let way = across(q - p);
                let far = way.length();
                let (from, to) = (-r.min(s - far), r.min(s + far));
                let unit = if far > 0.0 { way / far } else { DVec3::ZERO };
                (from < to).then(|| p + unit * (0.5 * (from + to)))
            }
            (of_a, _) => {
                let k = usize::from(!of_a);
                let (p, r) = disc(k)?;
                let [from, to] = shown[1 - k].ends.map(|e| centers[1 - k] + e);
                // Where the segment enters and leaves the disc.
                let (o, way) = (across(from - p), across(to - from));
                let (square, along) = (way.length_squared(), o.dot(way));
                let root = along * along - square * (o.length_squared() - r * r);
                let (enter, leave) = ((-along - root.sqrt()) / square, (-along + root.sqrt()) / square);
                let (enter, leave) = (enter.max(0.0), leave.min(1.0));
                (enter < leave).then(|| from + (to - from) * (0.5 * (enter + leave)))
            }
        }
    }

    /// The active constraints at x.
    fn rows(&self, active: &[(Constraint, f64)], x: DVec3, rows: &mut [Row; MAX_ACTIVE]) {
        let own = [self.own(0, x), self.own(1, x)];
        let carried = [self.carried(0, x), self.carried(1, x)];
        for (row, (constraint, _)) in rows.iter_mut().zip(active) {
            let (Constraint::Literal(side, id) | Constraint::Apex(side, id, _)) = *constraint;
            let (primitive, own) = (self.parts[side as usize].primitive, own[side as usize]);
            let face = &primitive.faces[(id.face() - primitive.first_face) as usize];
            let axes = &self.models[side as usize];
            if let Some((normal, offset)) = face.flat() {
                (row.value, row.normal, row.sinks, row.bend) = (normal.dot(own) - offset, *axes * normal, 1.0, 0.0);
            } else if let (Constraint::Apex(_, _, i), Some(apex)) = (*constraint, face.apex()) {
                let n = apex.directions()[i as usize];
                (row.value, row.normal) = (n.dot(own - apex.point), *axes * n);
                row.sinks = if i == 0 { -1.0 / apex.sin } else { 0.0 };
            } else {
                let f = face.at(own);
                (row.value, row.normal, row.sinks) = (f.value, *axes * f.normal, 1.0);
                row.bend = if f.rho > 0.0 { f.k / f.rho } else { 0.0 };
                (row.axis, row.all) = match face.straight_at(own) {
                    Some(axis) => (*axes * axis, false),
                    None => (DVec3::ZERO, true),
                };
            }
            row.rate = -row.normal.dot(carried[side as usize]);
        }
    }

    /// The least step from x and now to where the first `count` constraints are met at a depth, to first order.
    fn sink(&mut self, rows: &[Row; MAX_ACTIVE], count: usize, x: DVec3, level: f64) -> Option<DVec3> {
        // Of a size that is known beforehand the loops hold no tests of their own.
        match count {
            2 => self.sink_of::<2>(rows, x, level),
            3 => self.sink_of::<3>(rows, x, level),
            4 => self.sink_of::<4>(rows, x, level),
            5 => self.sink_of::<5>(rows, x, level),
            6 => self.sink_of::<6>(rows, x, level),
            _ => unreachable!("between two and six faces meet"),
        }
    }

    fn sink_of<const M: usize>(&mut self, rows: &[Row; MAX_ACTIVE], x: DVec3, level: f64) -> Option<DVec3> {
        let scale = self.pair.scale;
        let time = (scale / self.pair.velocity.length()).min(1.0);
        let (mut lines, mut rhs) = ([[0.0; 4]; M], [0.0; M]);
        for k in 0..M {
            let (row, n) = (&rows[k], rows[k].normal);
            lines[k] = [n.x, n.y, n.z, row.rate * time / scale];
            rhs[k] = -(row.value + row.sinks * level) / scale;
        }
        // Gram matrix of the rows, a trace of damping for redundant ones.
        let mut gram = [[0.0; M]; M];
        for i in 0..M {
            for j in 0..=i {
                let (p, q) = (lines[i], lines[j]);
                gram[i][j] = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
            }
            gram[i][i] += 1e-13;
        }
        let rhs = cholesky_solve(&mut gram, rhs, M)?;
        let mut step = [0.0; 4];
        for (line, weight) in lines.iter().zip(rhs) {
            (0..4).for_each(|k| step[k] += line[k] * weight);
        }
        let x = x + DVec3::new(step[0], step[1], step[2]) * scale;
        let t = self.t + step[3] * time;
        self.to(t);
        (x.is_finite() && t.is_finite()).then_some(x)
    }
}

impl Touch {
    /// ContactKind, extent and faces from the active constraints, of which the first `of_a` are A's.
    fn describe(&mut self, active: &[(Constraint, f64)], of_a: usize, rows: &[Row], scale: f64) {
        let literal = |c: &Constraint| matches!(c, Constraint::Literal(..));
        let sum: f64 = active.iter().filter(|c| literal(&c.0)).map(|c| c.1).sum();
        let sum = if sum > 0.0 { sum } else { 1.0 };
        let mut gradients: SmallVec<[DVec3; 8]> = SmallVec::new();
        let (mut curvature, mut count) = (DMat3::ZERO, [0; 2]);
        for (k, ((c, weight), row)) in active.iter().zip(rows).enumerate() {
            let side = usize::from(k >= of_a);
            let (Constraint::Literal(_, id) | Constraint::Apex(_, id, _)) = c;
            if row.bend != 0.0 {
                curvature += row.hessian() * (weight / sum);
            }
            if !literal(c) || weight / sum > extent::ACTIVE {
                gradients.push(row.normal);
                count[side] += 1;
                extent::note(&mut self.faces[side], id.face());
            }
        }
        self.extent = extent::extent(&gradients, curvature, scale);
        self.kind = ContactKind::of_active(count[0], count[1]);
    }
}
