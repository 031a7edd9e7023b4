//! What is wrong with an answer, found without the engine: by evaluating f of both trees along the motion.
//!
//! The judge looks for points that an answer says are not there. Corners, apexes and points of rims and surfaces of each body
//! are followed into the other body; since f is 1-Lipschitz, a point that is far away may be moved on by as much time as
//! its distance allows. The deepest places are then deepened by descent in x and t. It finds points or does not: an
//! answer that it finds nothing wrong with may still be wrong, one that it faults with a point is.

use super::draw::Draw;
use super::{Course, Field, Scene};
use crate::engine::ReportedPoint as _;
use contactd::contact::{Outcome, Status};
use glam::{DMat3, DVec3, dvec3};

/// How hard the judge looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Some thousand evaluations of f.
    Quick,
    /// A hundred thousand.
    Thorough,
}

/// What is wrong with an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// The kind, one word or two.
    pub kind: String,
    /// What was found, as a sentence with numbers.
    pub text: String,
}

/// Both bodies as the judge sees them; points are given in a's model frame.
struct Pair {
    a: Field,
    b: Field,
    courses: [Course; 2],
    /// Position of b less that of a at the start, and its change over the step.
    apart: DVec3,
    travel: DVec3,
    /// Size of the larger body: for steps of descents.
    size: f64,
    /// What f may be wrong by.
    rounding: f64,
}

/// A moment.
#[derive(Clone, Copy)]
struct Moment {
    a: DMat3,
    b: DMat3,
    apart: DVec3,
}

impl Moment {
    /// The point of b's frame that is x of a's.
    fn in_b(&self, x: DVec3) -> DVec3 {
        self.b.transpose() * (self.a * x - self.apart)
    }
}

impl Pair {
    fn new(scene: &Scene) -> Self {
        let (a, b) = (scene.a.field(), scene.b.field());
        let [ca, cb] = scene.courses;
        let apart = cb.start - ca.start;
        // As a step is defined: the positions' differences, each rounded once.
        let travel = (cb.end - cb.start) - (ca.end - ca.start);
        let extent = a.size + b.size + apart.length() + (apart + travel).length();
        let size = scene.a.ball().1.max(scene.b.ball().1);
        Self { a, b, courses: scene.courses, apart, travel, size, rounding: 16.0 * f64::EPSILON * extent }
    }

    fn at(&self, t: f64) -> Moment {
        Moment { a: self.courses[0].matrix_at(t), b: self.courses[1].matrix_at(t), apart: self.apart + self.travel * t }
    }

    /// The larger of both f: below 0 inside both.
    fn common(&self, m: &Moment, x: DVec3) -> f64 {
        let f = self.a.value(x);
        if f > self.size { f } else { f.max(self.b.value(m.in_b(x))) }
    }

    /// Follows points of one body through the other one up to `until`; the deepest places of all, lowest first.
    fn follow(&self, of_a: bool, points: &[DVec3], until: f64, steps: usize, out: &mut Vec<(f64, f64, DVec3)>) {
        let [ca, cb] = &self.courses;
        let farthest = self.apart.length().max((self.apart + self.travel).length());
        let mut cache: Vec<Option<Moment>> = vec![None; steps + 1];
        for p in points {
            let reach = p.length();
            // The speed of a's point in b's frame, or of b's in a's.
            let own = if of_a { ca.spin.length() } else { cb.spin.length() };
            let other = if of_a { cb.spin.length() } else { ca.spin.length() };
            let speed = self.travel.length() + own * reach + other * (reach + farthest);
            let mut best = (f64::INFINITY, 0.0, *p);
            let mut k = 0;
            while k <= steps {
                let t = until * k as f64 / steps as f64;
                let m = *cache[k].get_or_insert_with(|| self.at(t));
                let (v, x) = if of_a {
                    (self.b.value(m.in_b(*p)), *p)
                } else {
                    let x = m.a.transpose() * (m.b * *p + m.apart);
                    (self.a.value(x), x)
                };
                if v < best.0 {
                    best = (v, t, x);
                }
                let free = if v > 0.0 && speed > 0.0 { v / speed / until.max(1e-300) * steps as f64 } else { 0.0 };
                k += (free.floor() as usize).clamp(1, steps + 1);
            }
            out.push(best);
        }
    }

    /// Goes down from (t, x) in x, and in t up to `until` unless that is `None`: the deepest place found.
    fn deepen(
        &self,
        t: f64,
        x: DVec3,
        until: Option<f64>,
        first: f64,
        most: usize,
        draw: &mut Draw,
    ) -> (f64, f64, DVec3) {
        let m = self.at(t);
        let mut best = (self.common(&m, x), t, x);
        // Inward from the surface of the one that is shallower, as deep as the other one allows.
        for _ in 0..6 {
            let (x, v) = (best.2, best.0);
            let (fa, fb) = (self.a.value(x), self.b.value(m.in_b(x)));
            let h = 1e-7 * self.size;
            let gradient =
                if fa >= fb { self.a.gradient(x, h) } else { m.a.transpose() * (m.b * self.b.gradient(m.in_b(x), h)) };
            let mut step = (fa - fb).abs().max(first);
            for _ in 0..12 {
                let y = x - gradient * step;
                let w = self.common(&m, y);
                if w < best.0 {
                    best = (w, best.1, y);
                    break;
                }
                step /= 3.0;
            }
            if best.0 >= v {
                break;
            }
        }
        // Half of the way in round steps, half in flat ones: where round faces meet, the common part is a lens.
        let h = 1e-7 * self.size;
        let best = self.evolve(best, until, first, None, most / 2, draw);
        let m = self.at(best.1);
        let normal = m.a.transpose() * (m.b * self.b.gradient(m.in_b(best.2), h));
        self.evolve(best, until, first, Some(normal), most / 2, draw)
    }

    /// Goes down by lot: one child at a time, in steps that grow where they help and whose directions learn from those that
    /// did (Igel, Suttorp and Hansen 2006), so that narrow valleys are followed. Time is the fourth direction, in units of
    /// `until` where that is given. With a normal the first steps are those of a lens as thick as `first`.
    fn evolve(
        &self,
        mut best: (f64, f64, DVec3),
        until: Option<f64>,
        first: f64,
        normal: Option<DVec3>,
        most: usize,
        draw: &mut Draw,
    ) -> (f64, f64, DVec3) {
        const C: f64 = 2.0 / 22.0;
        let mut shape = [[0.0; 4]; 4];
        for k in 0..3 {
            shape[k][k] = 1.0;
        }
        if let Some(n) = normal.filter(|n| n.is_normalized()) {
            let wide = (self.size / first).sqrt().max(1.0);
            let x = n.any_orthonormal_vector();
            for (k, axis) in [x * wide, n.cross(x) * wide, n].into_iter().enumerate() {
                for i in 0..3 {
                    shape[i][k] = axis[i];
                }
            }
        }
        // A first step in time moves the bodies by about as much.
        let speed = self.travel.length() + self.courses.iter().map(|c| c.spin.length()).sum::<f64>() * self.size;
        shape[3][3] = if until.is_some() { 1.0 / speed.max(1e-12 * self.size) } else { 0.0 };
        let (mut step, mut success) = (first, 0.2);
        let mut m = self.at(best.1);
        for _ in 0..most {
            let z = [0; 4].map(|_| draw.normal());
            let mut y = [0.0; 4];
            for i in 0..4 {
                for j in 0..4 {
                    y[i] += shape[i][j] * z[j];
                }
            }
            let x = best.2 + DVec3::new(y[0], y[1], y[2]) * step;
            let t = until.map_or(best.1, |u| (best.1 + y[3] * step).clamp(0.0, u));
            let n = if t == best.1 { m } else { self.at(t) };
            let v = self.common(&n, x);
            let better = v < best.0;
            success += 0.12 * (f64::from(u8::from(better)) - success);
            step *= (((success - 0.18) / 0.82) / 2.5).exp();
            if better {
                best = (v, t, x);
                m = n;
                let square: f64 = z.iter().map(|x| x * x).sum();
                let keep = (1.0f64 - C).sqrt();
                let add = keep / square * ((1.0 + C * square / (1.0 - C)).sqrt() - 1.0);
                for i in 0..4 {
                    for j in 0..4 {
                        shape[i][j] = keep * shape[i][j] + add * y[i] * z[j];
                    }
                }
            }
            if step < 1e-16 * self.size {
                break;
            }
        }
        best
    }

    /// Is there a common point about as deep as `delta` at the start? Looked for from x first, then everywhere.
    fn starts_within(&self, t: f64, x: DVec3, delta: f64, draw: &mut Draw) -> bool {
        // Few places show it as a rule; a contradiction must have looked at many.
        [(90, 24), (4000, 400)].into_iter().any(|(points, kept)| self.starts_within_of(t, x, delta, points, kept, draw))
    }

    fn starts_within_of(&self, t: f64, x: DVec3, delta: f64, points: usize, kept: usize, draw: &mut Draw) -> bool {
        let m = self.at(0.0);
        // The place itself, as each body has carried it there, and as the second one would without turning: in a fit it
        // is hardly downhill to the deepest one from anywhere else.
        let later = self.at(t);
        let carried = m.a.transpose() * (m.b * later.in_b(x) + m.apart);
        let moved = m.a.transpose() * (later.a * x - later.apart + m.apart);
        let mut places = vec![x, carried, moved];
        places.extend(self.a.surface_points(points, draw));
        let seen = |x: DVec3| m.a.transpose() * (m.b * x + m.apart);
        places.extend(self.b.surface_points(points, draw).into_iter().map(seen));
        let mut places: Vec<(f64, DVec3)> = places.into_iter().map(|x| (self.common(&m, x), x)).collect();
        places[3..].sort_by(|x, y| x.0.total_cmp(&y.0));
        places.truncate(kept);
        // Between like round faces the deepest place is far away and hardly downhill.
        let firsts = [10.0, 1e3, 1e5, 1e7].map(|k| (k * delta).min(0.3 * self.size));
        let slides = [1e-1, 1e-2, 1e-3].map(|k| k * self.size);
        let mut is_deep = |x: DVec3, first: f64| -self.deepen(0.0, x, None, first, 600, draw).0 >= 0.9 * delta;
        if places.iter().any(|(_, x)| firsts.iter().any(|first| is_deep(*x, *first))) {
            return true;
        }
        let mut is_deep = |x: DVec3, first: f64| -self.slide(&m, x, first, 400, draw) >= 0.9 * delta;
        places.iter().take(24).any(|(_, x)| slides.iter().any(|first| is_deep(*x, *first)))
    }

    /// A point beside x that is as deep in the one body as in the other, along what their gradients differ by.
    fn levelled(&self, m: &Moment, mut x: DVec3) -> DVec3 {
        let h = 1e-7 * self.size;
        for _ in 0..2 {
            let y = m.in_b(x);
            let apart = self.a.gradient(x, h) - m.a.transpose() * (m.b * self.b.gradient(y, h));
            if apart.length_squared() < 1.0 {
                break;
            }
            x -= apart * ((self.a.value(x) - self.b.value(y)) / apart.length_squared());
        }
        x
    }

    /// The depth (f, below 0 inside) that is reached from x by lot in the middle of the layer that both bodies have in
    /// common: between like round faces that is thinner by far than it is wide, and each step is led back to it.
    fn slide(&self, m: &Moment, x: DVec3, mut step: f64, most: usize, draw: &mut Draw) -> f64 {
        let mut x = self.levelled(m, x);
        let mut best = self.common(m, x);
        for _ in 0..most {
            let y = self.levelled(m, x + dvec3(draw.normal(), draw.normal(), draw.normal()) * step);
            let v = self.common(m, y);
            step *= if v < best { 1.5 } else { 0.85 };
            if v < best {
                (x, best) = (y, v);
            }
        }
        best
    }

    /// The deepest common point found at `time_upper`, near the contact first (x in a's frame), then anywhere; the search
    /// ends once one is as deep as `enough` (f, below 0).
    fn witness(&self, o: &Outcome, x: DVec3, enough: f64, effort: Effort, draw: &mut Draw) -> f64 {
        let (t, delta) = (o.time_upper(), o.resolution);
        let mut found = f64::INFINITY;
        let mut best = x;
        for first in [3.0, 30.0, 1e3, 3e4, 1.0, 3.0] {
            let (v, _, y) = self.deepen(t, best, None, first * delta, 600, draw);
            if v < found {
                (found, best) = (v, y);
            }
            if found <= enough {
                return found;
            }
        }
        let (pa, pb) = (self.a.surface_points(60, draw), self.b.surface_points(60, draw));
        let m = self.at(t);
        let mut places: Vec<(f64, DVec3)> = pa.iter().map(|x| (self.common(&m, *x), *x)).collect();
        let seen = |x: &DVec3| m.a.transpose() * (m.b * *x + m.apart);
        places.extend(pb.iter().map(seen).map(|x| (self.common(&m, x), x)));
        places.sort_by(|x, y| x.0.total_cmp(&y.0));
        places.truncate(6);
        let tries = if effort == Effort::Thorough { 10_000 } else { 600 };
        places.push((found, best));
        for (_, mut x) in places {
            for first in [1e4, 10.0, 2.0] {
                let (v, _, y) = self.deepen(t, x, None, first * delta, tries, draw);
                found = found.min(v);
                x = y;
                if found <= enough {
                    return found;
                }
            }
        }
        found
    }
}

/// What is wrong with an answer to a scene. The same for the same scene and answer. `named` is asked for the witness that the
/// answer's certificate names where none is found without: whether it is a point of a's frame or of b's, its time, itself.
pub fn judge(
    scene: &Scene,
    o: &Outcome,
    effort: Effort,
    named: impl FnOnce() -> Option<(bool, f64, DVec3)>,
) -> Vec<Fault> {
    let mut faults = Vec::new();
    let mut fault = |kind: &str, text: String| faults.push(Fault { kind: kind.into(), text });
    let numbers = [o.time_lower(), o.time(), o.time_upper(), o.resolution, o.at().normal_speed, o.at().separation];
    if !numbers.iter().all(|x| x.is_finite()) || !o.at().point.is_finite() || !o.at().normal.is_finite() {
        fault("not finite", format!("{o:?}"));
        return faults;
    }
    let ordered =
        0.0 <= o.time_lower() && o.time_lower() <= o.time() && o.time() <= o.time_upper() && o.time_upper() <= 1.0;
    if !ordered {
        fault("bracket", format!("{} {} {}", o.time_lower(), o.time(), o.time_upper()));
        return faults;
    }
    let pair = Pair::new(scene);
    let delta = o.resolution;
    let mut draw = Draw::new(7, 0, 0);
    let thorough = effort == Effort::Thorough;
    let (most, steps, descents, evaluations) = if thorough { (120, 400, 24, 3000) } else { (18, 48, 4, 200) };
    // What is found deeper than this is deeper than the answer allows.
    let allowed = |level: f64| level * delta * (1.0 + 1e-4) + pair.rounding;

    let world = |x: DVec3, t: f64| {
        let m = pair.at(t);
        m.a.transpose() * ((x - scene.courses[0].start) - (scene.courses[0].end - scene.courses[0].start) * t)
    };

    if o.status() != Status::Overlap && o.time_lower() > 0.0 {
        let mut places = Vec::new();
        let until = o.time_lower();
        let (pa, pb) = (pair.a.surface_points(most, &mut draw), pair.b.surface_points(most, &mut draw));
        pair.follow(true, &pa, until, steps, &mut places);
        pair.follow(false, &pb, until, steps, &mut places);
        places.sort_by(|x, y| x.0.total_cmp(&y.0));
        places.truncate(descents);
        if o.status() == Status::Contact {
            // Just before the contact, from its point.
            places.push((0.0, until, world(o.at().point, until)));
        }
        for (v, t, x) in places {
            if v > 0.05 * pair.size {
                continue;
            }
            let first = v.abs().max(10.0 * delta).min(0.1 * pair.size);
            let (g, t, x) = pair.deepen(t, x, Some(until), first, evaluations, &mut draw);
            // At a start within depth delta the promise is one for twice that.
            let doubtful = -g > allowed(1.0) && -g <= allowed(2.0);
            let level = if doubtful && !pair.starts_within(t, x, delta, &mut draw) { 1.0 } else { 2.0 };
            if -g > allowed(level) {
                let depth = -g;
                fault(
                    "miss",
                    format!(
                        "{} from {until}: depth {depth:e} ({:.3} delta) at t = {t}, a's point {x}",
                        o.status().name(),
                        depth / delta
                    ),
                );
                break;
            }
        }
    }

    match o.status() {
        Status::Contact => {
            if (o.at().normal.length() - 1.0).abs() > 1e-9 {
                fault("normal", format!("length {}", o.at().normal.length()));
            }
            let x = world(o.at().point, o.time());
            let m = pair.at(o.time());
            let (fa, fb) = (pair.a.value(x), pair.b.value(m.in_b(x)));
            let far = (scene.courses[0].start.length() + scene.courses[0].end.length()) * f64::EPSILON * 4.0;
            // A contact that starts the step may have sunk in by twice the resolution.
            let sunk = if o.time() == 0.0 { 2.1 * delta } else { 0.0 };
            let near = 1e-9 * pair.size + pair.rounding + far + sunk;
            if !o.not_continued() && (fa.abs() > near || fb.abs() > near) {
                fault("off surface", format!("f_a = {fa:e}, f_b = {fb:e} at the point"));
            }
            // A search by lot ends a little above the deepest point.
            let enough = -0.85 * delta + pair.rounding + far;
            let found = pair.witness(o, world(o.at().point, o.time_upper()), enough, effort, &mut draw);
            if found > enough {
                // What the engine's own proof names, seen with the judge's eyes.
                let named = named().is_some_and(|(of_a, t, x)| {
                    let m = pair.at(t);
                    let x = if of_a { x } else { m.a.transpose() * (m.b * x + m.apart) };
                    t <= o.time_upper() && pair.common(&m, x) <= -0.98 * delta + pair.rounding
                });
                // Where there is none, the answer's own: as the body turns, and without a spin about its own axis.
                let m = pair.at(o.time_upper());
                let reported = o.contact().and_then(|c| c.witness).is_some_and(|x| {
                    let places = [x, m.a.transpose() * (pair.at(0.0).a * x)];
                    places.iter().any(|x| pair.common(&m, *x) <= -0.98 * delta + pair.rounding)
                });
                if !(named || reported) {
                    let depth = -found / delta;
                    fault("witness", format!("at time_upper = {} no more than {depth:.4} delta", o.time_upper()));
                }
            }
        }
        Status::Overlap => {
            let x = world(o.at().point, 0.0);
            let m = pair.at(0.0);
            let far = scene.courses[0].start.length() * f64::EPSILON * 4.0;
            let g = pair.common(&m, x);
            if -g < 2.0 * delta * (1.0 - 1e-2) - pair.rounding - far {
                fault("overlap", format!("depth {:e} at the reported point, {:.3} delta", -g, -g / delta));
            }
        }
        Status::Clear | Status::Undecided => {}
    }
    faults
}
