//! A scene at its contacts: every object where it first meets another one, the contacts drawn in and listed.
//!
//! The camera stands where it sees all contacts, on the usual side if it can (`camera`). When some are hidden from every side, or
//! from the side that is asked for, the largest object is cut open: the quarter of it that faces the camera is taken away, down to
//! planes through the middle of its box, and the section is hatched.

use super::camera;
use super::contacts::{Mark, annotated};
use super::drawing::Drawing;
use super::ray::Traced;
use super::view::{Camera, Rgb, Thing, View};
use crate::contact::{Outcome, Status};
use crate::math::Aabb;
use crate::solid::{Sense, Solid};
use contactd_proto::{Motion, Pose};
use glam::DVec3;

/// An object of the scene over one step.
#[derive(Clone, Copy, Debug)]
pub struct Actor<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its solid.
    pub solid: &'a Solid,
    /// Objects of one model have one colour.
    pub model: usize,
    /// The model in the object's frame.
    pub place: Pose,
    /// The object's motion.
    pub motion: Motion,
}

/// The answer for two of the actors.
#[derive(Clone, Copy, Debug)]
pub struct Meeting<'a> {
    /// Indices of the actors.
    pub pair: [usize; 2],
    /// What was found.
    pub outcome: &'a Outcome,
}

/// How large, how fine, and from where.
#[derive(Clone, Copy, Debug)]
pub struct Quality {
    /// Image size, pixels.
    pub size: (usize, usize),
    /// Samples a pixel along each side.
    pub samples: usize,
    /// Where the camera stands, towards it from what it sees; `None`: where contacts are seen.
    pub from: Option<DVec3>,
}

/// For files: a few seconds.
pub const FINE: Quality = Quality { size: (1280, 720), samples: 4, from: None };

/// Linear colours of the models of a scene, in their order.
pub const COLORS: [Rgb; 8] = [
    [0.40, 0.44, 0.49],
    [0.72, 0.43, 0.10],
    [0.08, 0.22, 0.42],
    [0.52, 0.09, 0.06],
    [0.10, 0.31, 0.20],
    [0.30, 0.13, 0.36],
    [0.45, 0.40, 0.30],
    [0.06, 0.32, 0.36],
];

/// Draws the scene; `title` above, `note` below.
pub fn scene(title: &str, note: &str, actors: &[Actor], meetings: &[Meeting], quality: Quality) -> Drawing {
    let mut met: Vec<&Meeting> = meetings.iter().filter(|m| m.outcome.meets()).collect();
    met.sort_by(|a, b| a.outcome.time().total_cmp(&b.outcome.time()).then(a.pair.cmp(&b.pair)));
    // Each object at its own earliest contact, else at the end of the step.
    let mut times = vec![1.0; actors.len()];
    for m in met.iter().rev() {
        for i in m.pair {
            times[i] = m.outcome.time();
        }
    }
    let traced: Vec<Traced> = actors.iter().map(|a| Traced::new(a.solid)).collect();
    let mut things: Vec<Thing> = actors
        .iter()
        .zip(&traced)
        .zip(&times)
        .filter(|((_, traced), _)| traced.aabb().is_finite() && !traced.aabb().is_empty())
        .map(|((a, traced), time)| Thing {
            traced,
            pose: a.motion.at(*time).compose(&a.place),
            color: COLORS[a.model % COLORS.len()],
            cut: None,
        })
        .collect();
    let boxes: Vec<Aabb> = things.iter().map(Thing::aabb).collect();
    if boxes.is_empty() {
        return Drawing::new(quality.size.0, 64);
    }
    let marks: Vec<Mark> = met.iter().filter_map(|m| mark(actors, m)).collect();
    let camera = Camera::framing(&boxes, quality.from.unwrap_or(camera::USUAL), quality.size);
    let low = boxes.iter().map(|b| b.min.z).fold(f64::INFINITY, f64::min);
    let size = Aabb::of_points(boxes.iter().flat_map(|b| b.corners())).half().length();
    let largest = (0..boxes.len()).max_by(|i, j| boxes[*i].half().length().total_cmp(&boxes[*j].half().length()));
    let mut view = View { things: vec![], camera, ground: Some(low - 0.01 * size), samples: quality.samples };
    std::mem::swap(&mut view.things, &mut things);
    let points: Vec<DVec3> = marks.iter().map(|m| m.point).collect();
    let hidden = match quality.from {
        Some(_) => points.iter().filter(|x| !view.sees(**x)).count(),
        None => camera::turn(&mut view, &points).1,
    };
    if let (Some(i), true) = (largest, hidden > 0) {
        let c = boxes[i].center();
        let cut = |view: &mut View<'_>, side: DVec3| {
            let (x, y) = (DVec3::X.copysign(DVec3::splat(side.x)), DVec3::Y.copysign(DVec3::splat(side.y)));
            view.things[i].cut = Some(vec![(x, x.dot(c)), (y, y.dot(c))]);
        };
        match quality.from {
            Some(side) => cut(&mut view, side),
            None => {
                camera::turn_to_quarter(&mut view, &points, cut);
            }
        }
    }
    view.zoom_to_things();
    annotated(&view, title, &marks, note)
}

/// `None` where no point was asked for.
fn mark(actors: &[Actor], m: &Meeting) -> Option<Mark> {
    let o = m.outcome;
    let at = o.point()?;
    let [a, b] = m.pair.map(|i| &actors[i]);
    let negative = |actor: &Actor, faces: &[u32; 3]| {
        let owner = |f: &u32| actor.solid.face_owner.get(*f as usize).copied();
        faces.iter().filter_map(owner).any(|p| actor.solid.senses[p as usize] == Sense::Negative)
    };
    let cut = if negative(a, &at.faces_a) || negative(b, &at.faces_b) { ", subtracted" } else { "" };
    let text = match o.status() {
        Status::Overlap => format!("t {:.9}  {} - {}  overlap", o.time(), a.name, b.name),
        _ => format!("t {:.9}  {} - {}  {} {}{cut}", o.time(), a.name, b.name, at.kind.name(), at.extent.name()),
    };
    Some(Mark { point: at.point, normal: at.normal, text })
}
