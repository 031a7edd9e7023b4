//! Whole scenes: two trees drawn from the bytes, of sizes that do not fit, with faces that coincide and motions that
//! hardly move, asked in one step. Sampled, the slow reference is asked as well and must not refute the answer.

use super::{Reader, Target, sound};
use crate::engine::ReportedPoint as _;
use crate::reference::{self, Effort, Moving, Verdict};
use crate::scenes::Recipe;
use contactd::contact::{
    Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, default_resolution, earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Op;
use contactd_proto::{Motion, Pose};
use glam::DVec3;

pub(super) const TARGET: Target = Target { name: "scenes", run, seeds, words: &[], longest: 160, thorough_every: 100 };

/// Cells a pair may cost: answers beyond are undecided, which is an answer, too.
const CELLS: u64 = 200;
/// Time that rounding may take from either side's proof, where bodies move by about their size.
const SAME: f64 = 1e-9;

fn seeds() -> Vec<Vec<u8>> {
    vec![vec![], (0..=255).rev().collect(), (0..120).map(|i| (i * 29 % 256) as u8).collect()]
}

/// What the reference can follow: everything of about one size, moving by about that size.
#[derive(Clone, Copy, Debug)]
struct Tame(bool);

fn leaf(r: &mut Reader, size: f64) -> Recipe {
    // Sizes from a small set: faces, axes and apexes of different leaves fall together.
    let mut s = || size * r.one_of(&[0.5, 1.0, 0.25, 0.75]);
    let (x, y, z) = (s(), s(), s());
    let shape = match r.below(13) {
        0 => Recipe::sphere(x),
        1 => Recipe::cylinder(x, y),
        2 => Recipe::cone(x, 0.0, y),
        3 => Recipe::cone(x, 0.5 * x, y),
        4 => Recipe::cone(0.0, x, y),
        5 => Recipe::cuboid(x, y, z),
        6 => Recipe::torus(x, 0.5 * y),
        7 => Recipe::ellipsoid(x, y, z),
        8 => Recipe::capsule(x, 0.5 * y),
        9 => Recipe::dome(x, y),
        10 => Recipe::saddle(x, y, z),
        11 => Recipe::superellipsoid(DVec3::new(x, y, z), [r.one_of(&[0.1, 0.5, 1.0]), r.one_of(&[0.2, 0.5, 1.0])]),
        _ => Recipe::platonic(r.one_of(&[4, 6, 8, 12, 20]), x),
    };
    match r.below(4) {
        0 => shape,
        // Coaxial: along its own axis.
        1 => shape.at(0.0, 0.0, size * r.round()),
        _ => shape.moved(&r.pose(0.5 * size)),
    }
}

fn tree(r: &mut Reader, size: f64, levels: usize, tame: &mut Tame) -> Recipe {
    if levels == 0 || r.below(3) == 0 {
        let size = match r.below(12) {
            0 => {
                tame.0 = false;
                size * r.one_of(&[1e-6, 1e-3, 1e3, 1e6, 1.0 + 1e-9, 1.0 - 1e-15])
            }
            _ => size,
        };
        return leaf(r, size);
    }
    let op = r.one_of(&[Op::Union, Op::Difference, Op::Intersection, Op::Difference]);
    let operands = (0..2 + r.below(2)).map(|_| tree(r, size, levels - 1, tame)).collect();
    Recipe::Op(op, operands)
}

fn motion(r: &mut Reader, size: f64, away: DVec3, tame: &mut Tame) -> Motion {
    let start = r.pose(size);
    let start = Pose::new(start.position + away, start.rotation);
    let velocity = match r.below(8) {
        0 | 1 => DVec3::ZERO,
        2 => {
            tame.0 = false;
            r.round_vector() * r.one_of(&[1e-39, 1e-300, 5e-324, 1e-16, 1e6, 1e9]) * size
        }
        3 => r.rough_vector() * (3.0 * size),
        4 => -away,
        _ => r.round_vector() * size,
    };
    let spin = r.turn();
    tame.0 &= spin.length() < 10.0;
    Motion::turning(start, start.position + velocity, spin)
}

fn run(bytes: &[u8], thorough: bool) -> Result<String, String> {
    let mut r = Reader::new(bytes);
    let mut tame = Tame(true);
    let size_a = match r.below(4) {
        0 => {
            tame.0 = false;
            r.one_of(&[1e-6, 1e-3, 1e3, 1e6])
        }
        _ => 1.0,
    };
    let size_b = match r.below(4) {
        0 => {
            tame.0 = false;
            r.one_of(&[1e-6, 1e-3, 1e3, 1e6])
        }
        _ => size_a,
    };
    let (a, b) = (tree(&mut r, size_a, 2, &mut tame), tree(&mut r, size_b, 2, &mut tame));
    let away = r.round_vector() * size_a.max(size_b);
    let motions = [motion(&mut r, size_a, DVec3::ZERO, &mut tame), motion(&mut r, size_b, away, &mut tame)];
    let (a, b) = (Model::new(a.build()), Model::new(b.build()));
    let [placed_a, placed_b] = motions.map(|motion| Placed { place: Pose::IDENTITY, motion });
    let resolution = default_resolution(&a, &b);
    if a.solid.is_empty() || b.solid.is_empty() {
        return Ok("empty".into());
    }
    let query = PairQuery {
        a: PlacedModel { model: &a, placed: placed_a },
        b: PlacedModel { model: &b, placed: placed_b },
        resolution,
        cell_limit: CELLS,
        strategies: Default::default(),
        query_options: QueryOptions::DEPTH,
    };
    let o = earliest_contact(&query, &mut Scratch::default());
    sound(&o)?;
    if matches!(o.status(), Status::Contact | Status::Overlap) {
        witness(&o, &query)?;
    }
    if thorough && tame.0 && o.status() != Status::Undecided {
        let moving = |model, placed: Placed| Moving { solid: model, place: placed.place, motion: placed.motion };
        let truth = reference::earliest_contact(
            moving(&a.solid, placed_a),
            moving(&b.solid, placed_b),
            resolution,
            Effort::QUICK,
        );
        unrefuted(&o, &truth)?;
    }
    Ok(format!("{} {:?} {:?} {} {}", o.status().name(), o.at().kind, o.at().extent, o.touching, o.not_continued()))
}

/// The point of an answer lies in or on both bodies, as far as its place in the world can tell.
fn witness(o: &Outcome, query: &PairQuery) -> Result<(), String> {
    for (name, body) in [("a", &query.a), ("b", &query.b)] {
        let Placed { place, motion } = body.placed;
        let x = place.inverse().point(motion.at(o.time()).inverse().point(o.at().point));
        let reach = o.at().point.length() + motion.at(o.time()).position.length() + body.model.radius;
        // Turning by an angle rounds in proportion to it. What is told is told at a resolution that bodies as fast as these may raise.
        let slack = 4.0 * o.resolution.max(query.resolution) + 1e-13 * reach * (1.0 + motion.spin.length());
        let f = body.model.solid.value(x);
        if f.is_nan() || f > slack {
            return Err(format!("{} at {}: its point lies {f:e} outside {name} ({o:?})", o.status().name(), o.time()));
        }
    }
    Ok(())
}

/// Nothing that the reference has proven or has seen contradicts the answer.
fn unrefuted(o: &Outcome, truth: &reference::Truth) -> Result<(), String> {
    let reported = format!("{} {:?}", o.status().name(), [o.time_lower(), o.time(), o.time_upper()]);
    if o.status() != Status::Clear && o.time_upper() < truth.lower - SAME {
        return Err(format!("{reported}, but nothing is common before {}", truth.lower));
    }
    let seen = match truth.verdict {
        Verdict::Contact => truth.upper,
        Verdict::Overlap => 0.0,
        Verdict::Clear => return Ok(()),
    };
    let free = if o.status() == Status::Clear { 1.0 } else { o.time_lower() };
    if free > seen + SAME && seen < 1.0 - SAME {
        return Err(format!("{reported}, but {:?} with depth at {seen} ({})", truth.verdict, truth.point));
    }
    Ok(())
}
