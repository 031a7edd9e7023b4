//! What is asked of a world beside its steps: how far two bodies are apart, where points are, what rays meet first.
//!
//! Bodies stand where their last step ended. Nothing changes, and nothing is remembered for steps. Points and rays go to the bodies one
//! by one, those first whose box is nearest, until no box can hold anything nearer.

use super::body::Body;
use super::broad::BroadPhase;
use super::scene::{Refusal, World};
use crate::contact::PlacedModel;
use crate::contact::distance::{self, Distance, DistanceQuery};
use crate::contact::probe::{
    self, PointAnswer, PointOptions, PosedModel, Ray, RayAnswer, RayOptions, RayOutcome, Side,
};
use crate::math::{Aabb, halt, scaled};
use crate::motion::Placed;
use contactd_proto::pose::FARTHEST;
use contactd_proto::{ErrorCode, Motion};
use glam::DVec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::HashSet;

/// A point among bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPoint {
    /// The body whose surface is nearest, counted from within: the one with the least upper bound. `None` where there is no body.
    pub body: Option<u32>,
    /// Its bounds are those of the least signed distance of all bodies; what else it tells is of `body`.
    pub answer: PointAnswer,
}

/// A ray among bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyRay {
    /// The body that is hit, or the one that the whole of a ray lies in.
    pub body: Option<u32>,
    /// What becomes of the ray. A hit's `lower` holds for all bodies, as does `until`.
    pub answer: RayAnswer,
}

/// Bodies where they stand, to be asked: those of a world, or a copy that outlives its next step.
#[derive(Clone, Debug)]
pub struct Standing<'w> {
    /// In the order of their ids.
    bodies: Cow<'w, [Body]>,
}

/// Bodies that are asked, with their boxes.
struct Asked<'w> {
    bodies: Vec<&'w Body>,
    boxes: Vec<Aabb>,
    tree: BroadPhase,
}

impl Body {
    /// Its model where it stands.
    fn posed(&self) -> PosedModel<'_> {
        PosedModel { model: &self.part.model, pose: self.motion_state.end.compose(&self.place) }
    }
}

impl World {
    /// Its bodies where their last step ended.
    pub fn standing(&self) -> Standing<'_> {
        Standing { bodies: Cow::Borrowed(self.bodies()) }
    }
}

impl Standing<'_> {
    /// A copy of its own, of all bodies or of some; ids that it does not have are left out.
    pub fn kept(&self, ids: Option<&[u32]>) -> Standing<'static> {
        let wanted: Option<HashSet<u32>> = ids.map(|ids| ids.iter().copied().collect());
        let is_wanted = |body: &&Body| wanted.as_ref().is_none_or(|ids| ids.contains(&body.id));
        Standing { bodies: Cow::Owned(self.bodies.iter().filter(is_wanted).cloned().collect()) }
    }

    /// How far two bodies are apart, to a tolerance (a length); `time` is of no meaning.
    ///
    /// # Errors
    /// `UnknownObject`; `BadNumber` for a tolerance that is negative or no number.
    pub fn distance(&self, a: u32, b: u32, tolerance: f64) -> Result<Distance, Refusal> {
        not_negative("tolerance", tolerance)?;
        let [a, b] = [self.known(a)?, self.known(b)?].map(|body| PlacedModel {
            model: &body.part.model,
            placed: Placed { place: body.place, motion: Motion::resting(body.motion_state.end) },
        });
        Ok(distance::at_instant(&DistanceQuery { a, b, tolerance, limit: distance::DEFAULT_LIMIT }, 0.0))
    }

    /// The least signed distance of points from some bodies, or from all, in the order of the points.
    ///
    /// # Errors
    /// `UnknownObject`; `NotFinite` at the index of a point; `BadNumber` for a length that is negative or no number.
    pub fn points(
        &self,
        points: &[DVec3],
        options: &PointOptions,
        bodies: Option<&[u32]>,
    ) -> Result<Vec<BodyPoint>, Refusal> {
        not_negative("surface", options.surface)?;
        not_negative("tolerance", options.tolerance)?;
        if let Some(i) = points.iter().position(|x| !x.is_finite()) {
            return Err(Refusal::new(ErrorCode::NotFinite, format!("the point {}", vector(points[i]))).at(i));
        }
        let asked = self.asked(bodies)?;
        let told = points.par_iter().map(|x| {
            halt::point();
            asked.point(*x, options)
        });
        Ok(told.collect())
    }

    /// What rays meet first of some bodies, or of all, in the order of the rays. A direction may have any length but 0; parameters are
    /// lengths along it.
    ///
    /// # Errors
    /// `UnknownObject`; `NotFinite` at the index of a ray whose numbers are not finite (a length may be infinite); `BadNumber` for a
    /// direction or length that is none, or a depth that is negative or no number.
    pub fn rays(&self, rays: &[Ray], options: &RayOptions, bodies: Option<&[u32]>) -> Result<Vec<BodyRay>, Refusal> {
        not_negative("depth", options.depth)?;
        let refuse = |code, i: usize, detail: String| Err(Refusal::new(code, detail).at(i));
        let mut unit = Vec::with_capacity(rays.len());
        for (i, ray) in rays.iter().enumerate() {
            if !(ray.origin.is_finite() && ray.direction.is_finite()) {
                let detail = format!("the ray from {} along {}", vector(ray.origin), vector(ray.direction));
                return refuse(ErrorCode::NotFinite, i, detail);
            }
            if ray.length.is_nan() || ray.length < 0.0 {
                return refuse(
                    ErrorCode::BadNumber,
                    i,
                    format!("a ray's length must be >= 0, not {}", number(ray.length)),
                );
            }
            let Some(direction) = scaled::direction(ray.direction) else {
                return refuse(ErrorCode::BadNumber, i, format!("a ray cannot go along {}", vector(ray.direction)));
            };
            unit.push(Ray { direction, ..*ray });
        }
        let asked = self.asked(bodies)?;
        let told = unit.par_iter().map(|ray| {
            halt::point();
            asked.ray(ray, options)
        });
        Ok(told.collect())
    }

    fn known(&self, id: u32) -> Result<&Body, Refusal> {
        let at = self.bodies.binary_search_by_key(&id, |body| body.id);
        at.map(|i| &self.bodies[i]).map_err(|_| Refusal::new(ErrorCode::UnknownObject, format!("object id {id}")))
    }

    fn asked(&self, bodies: Option<&[u32]>) -> Result<Asked<'_>, Refusal> {
        let bodies: Vec<&Body> = match bodies {
            None => self.bodies.iter().collect(),
            Some(ids) => ids.iter().map(|id| self.known(*id)).collect::<Result<_, _>>()?,
        };
        let boxes: Vec<Aabb> = bodies.iter().map(|body| body.standing()).collect();
        let tree = BroadPhase::of(&boxes);
        Ok(Asked { bodies, boxes, tree })
    }
}

/// A number in few characters, however large or small.
fn number(x: f64) -> String {
    let is_plain = x == 0.0 || !x.is_finite() || (1e-5..1e16).contains(&x.abs());
    if is_plain { x.to_string() } else { format!("{x:e}") }
}

/// A vector likewise.
fn vector(v: DVec3) -> String {
    format!("[{}]", v.to_array().map(number).join(", "))
}

fn not_negative(what: &str, length: f64) -> Result<(), Refusal> {
    if length >= 0.0 {
        return Ok(());
    }
    Err(Refusal::new(ErrorCode::BadNumber, format!("the {what} must be a length >= 0, not {}", number(length))))
}

impl Asked<'_> {
    /// Bodies whose box has a key, by it: nothing of a body is nearer than that.
    fn by_box(&self, key: impl Fn(&Aabb) -> Option<f64>) -> Vec<(f64, usize)> {
        let mut found = Vec::new();
        self.tree.each(
            |aabb| key(aabb).is_some(),
            |i| {
                found.extend(key(&self.boxes[i as usize]).map(|near| (near, i as usize)));
            },
        );
        found.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        found
    }

    fn point(&self, x: DVec3, options: &PointOptions) -> BodyPoint {
        // The signed distance of a box: no body in it has a lower one.
        let away = |aabb: &Aabb| {
            let beyond = (aabb.min - x).max(x - aabb.max);
            let within = beyond.max_element();
            Some(if within > 0.0 { beyond.max(DVec3::ZERO).length() } else { within })
        };
        let (infinity, faces) = (f64::INFINITY, [u32::MAX; 3]);
        let nothing = PointAnswer {
            side: Side::Outside,
            lower: infinity,
            upper: infinity,
            nearest: DVec3::NAN,
            faces,
            is_settled: true,
            cells: 0,
        };
        let mut best = BodyPoint { body: None, answer: nothing };
        let (mut lower, mut cells, mut is_settled) = (infinity, 0, true);
        // Where squares are no doubles all are asked.
        let is_far = x.abs().max_element() > FARTHEST;
        for (near, i) in self.by_box(|aabb| if is_far { Some(f64::NEG_INFINITY) } else { away(aabb) }) {
            if near > best.answer.upper {
                lower = lower.min(near);
                break;
            }
            let answer = probe::points(&self.bodies[i].posed(), &[x], options)[0];
            (lower, cells) = (lower.min(answer.lower), cells + answer.cells);
            is_settled &= answer.is_settled;
            if best.body.is_none() || answer.upper < best.answer.upper {
                best = BodyPoint { body: Some(self.bodies[i].id), answer };
            }
        }
        let upper = best.answer.upper;
        let lower = lower.min(upper);
        let side = Side::of_bounds(lower, upper, options.surface);
        best.answer = PointAnswer { side, lower, is_settled, cells, ..best.answer };
        best
    }

    fn ray(&self, ray: &Ray, options: &RayOptions) -> BodyRay {
        let enters = |aabb: &Aabb| entry(ray, aabb);
        let (mut hit, mut hit_body) = (None::<probe::RayHit>, None);
        let (mut lower, mut until, mut cells) = (f64::INFINITY, f64::INFINITY, 0);
        let mut around = None;
        for (near, i) in self.by_box(enters) {
            if hit.is_some_and(|hit| near > hit.upper) {
                break;
            }
            let body = self.bodies[i];
            // No farther than what is known.
            let length = hit.map_or(ray.length, |hit| hit.upper);
            let answer = probe::rays(&body.posed(), &[Ray { length, ..*ray }], options)[0];
            cells += answer.cells;
            match answer.outcome {
                RayOutcome::Hit(found) => {
                    lower = lower.min(found.lower);
                    if hit.is_none_or(|hit| found.t < hit.t) {
                        (hit, hit_body) = (Some(found), Some(body.id));
                    }
                }
                RayOutcome::Miss { is_inside: true } => around = around.or(Some(body.id)),
                RayOutcome::Miss { is_inside: false } => {}
                RayOutcome::Undecided { until: free } => until = until.min(free),
            }
        }
        let (body, outcome) = match hit {
            Some(hit) if hit.lower.min(lower) <= until => {
                (hit_body, RayOutcome::Hit(probe::RayHit { lower: hit.lower.min(lower), ..hit }))
            }
            _ if until < f64::INFINITY => (None, RayOutcome::Undecided { until }),
            _ => (around, RayOutcome::Miss { is_inside: around.is_some() }),
        };
        BodyRay { body, answer: RayAnswer { outcome, cells } }
    }
}

/// Where a ray enters a box, at the earliest; `None` where it does not.
fn entry(ray: &Ray, aabb: &Aabb) -> Option<f64> {
    if aabb.is_empty() {
        return None;
    }
    let (from, to) = aabb.along(ray.origin, ray.direction)?;
    let (from, to) = (from.max(0.0), to.min(ray.length));
    // The quotients are rounded.
    let slack = 1e-14 * (from.abs() + to.abs().min(1e300));
    (from <= to + slack).then_some((from - slack).max(0.0))
}
