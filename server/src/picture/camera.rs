//! Where a camera stands so that it sees the contacts: on the usual side if all are seen from there, else where most are.

use super::view::{Camera, Thing, View};
use crate::math::Aabb;
use glam::DVec3;

/// The usual side, towards the camera: in front, to the right, above.
pub const USUAL: DVec3 = DVec3::new(0.5, -1.0, 0.95);

/// Turns the camera of `view` to the side from which most of `points` (world) are seen; returns that side and how many are not seen
/// from there. Of sides that see as many the first one of `sides`.
pub fn turn(view: &mut View<'_>, points: &[DVec3]) -> (DVec3, usize) {
    // What stands on a ground is not seen from below it.
    let all = sides().into_iter().filter(|side| view.ground.is_none() || side.z > 0.0).collect::<Vec<_>>();
    turn_to_best(view, points, &all, |_, _| {})
}

/// The same of the sides of four quarters, `cut` being told each before it is looked from.
pub fn turn_to_quarter(view: &mut View<'_>, points: &[DVec3], cut: impl FnMut(&mut View<'_>, DVec3)) -> (DVec3, usize) {
    let quarter = |k: f64| {
        let (s, c) = libm::sincos(k * std::f64::consts::FRAC_PI_2);
        DVec3::new(c * USUAL.x - s * USUAL.y, s * USUAL.x + c * USUAL.y, USUAL.z)
    };
    turn_to_best(view, points, &[USUAL, quarter(1.0), quarter(-1.0), quarter(2.0)], cut)
}

/// Makes the camera of `view` stand on a side, all things in view.
pub fn stand(view: &mut View<'_>, side: DVec3) {
    let boxes: Vec<Aabb> = view.things.iter().map(Thing::aabb).collect();
    view.camera = Camera::framing(&boxes, side, view.camera.size);
}

fn turn_to_best(
    view: &mut View<'_>,
    points: &[DVec3],
    sides: &[DVec3],
    mut ready: impl FnMut(&mut View<'_>, DVec3),
) -> (DVec3, usize) {
    let mut look = |view: &mut View<'_>, side| {
        ready(view, side);
        stand(view, side);
        points.iter().filter(|x| !view.sees(**x)).count()
    };
    let (mut best, mut hidden) = (sides[0], look(view, sides[0]));
    for side in &sides[1..] {
        if hidden == 0 {
            break;
        }
        let unseen = look(view, *side);
        if unseen < hidden {
            (best, hidden) = (*side, unseen);
        }
    }
    look(view, best);
    (best, hidden)
}

/// The sides that are tried, in order: the usual one, around at three heights, those next to it first, then from below.
fn sides() -> Vec<DVec3> {
    let mut all = vec![USUAL];
    let start = libm::atan2(USUAL.y, USUAL.x);
    for height in [0.85, 2.0, 0.3, -0.6] {
        for turn in [1, -1, 2, -2, 3, -3, 4] {
            let (s, c) = libm::sincos(start + f64::from(turn) * std::f64::consts::FRAC_PI_4);
            all.push(DVec3::new(c, s, height));
        }
    }
    all
}
