//! Every kind of primitive against every kind: what is told in front of the search against the search alone, what is told of the pair
//! against what is told of it the other way round, records against the judge, certificates against the verifier.
//!
//! Nothing here knows which pairs have a kernel. A pair is drawn from its kinds and its number alone, so that each can be asked again.
//! `CONTACTD_PAIRS=10000 cargo test --release -p contactd-tests --test answers table:: -- --nocapture` sets the number of pairs a row
//! and prints the table; `CONTACTD_KINDS="torus mesh"` asks for the rows of which both kinds are named, and
//! `CONTACTD_FIRST=17` begins with that pair.

use super::kinds::{alone, pairs, past, placed, turning};
use contactd::contact::{Outcome, Status, Strategies};
use contactd::octree::Model;
use contactd_proto::{Motion, Pose};
use contactd_tests::certified::certified;
use contactd_tests::engine::{ReportedPoint as _, SEARCH_ALONE, are_tied, ask_with, differences, point_mut};
use contactd_tests::random_solids::{KINDS, Random, of_kind};
use contactd_tests::record_judge::{self, Lie};
use contactd_tests::reference::Moving;
use contactd_tests::reference::field::Field;
use contactd_tests::sweep::sized;
use glam::DVec3;
use rayon::prelude::*;

/// Two bodies and their motions: past each other, or onto a half-space that rests.
fn draw(kinds: [&str; 2], seed: u64) -> [(Model, Motion); 2] {
    let mut r = Random::new(seed);
    let [a, b] = kinds.map(|kind| alone(of_kind(&mut r, kind, 0.8)));
    let mut motions = if kinds[1] == "half-space" {
        let floor = Pose::new(r.vector(0.3), r.rotation());
        let up = floor.rotation * DVec3::Z;
        let start = Pose::new(floor.position + up * r.within(1.0, 2.6) + r.vector(0.5), r.rotation());
        let fall = Motion { start, velocity: r.vector(0.8) - up * r.within(0.5, 2.5), spin: r.vector(1.5) };
        [fall, Motion::resting(floor)]
    } else {
        [turning(&mut r), past(&mut r, 2.4)]
    };
    // Every third pair only moves along.
    if seed.is_multiple_of(3) {
        motions.iter_mut().for_each(|m| m.spin = DVec3::ZERO);
    }
    let [of_a, of_b] = motions;
    [(a, of_a), (b, of_b)]
}

/// The same answer of the bodies the other way round: sides are exchanged, the normal looks the other way.
fn turned(mut o: Outcome) -> Outcome {
    if o.status() == Status::Contact {
        let at = point_mut(&mut o);
        std::mem::swap(&mut at.faces_a, &mut at.faces_b);
        at.normal = -at.normal;
    }
    o
}

/// What a row says.
#[derive(Default)]
struct Row {
    told: [usize; 4],
    alone: usize,
    deeper: usize,
    looser: usize,
    wider: usize,
    within: usize,
    farthest: f64,
    turned: usize,
    rare: usize,
    cells: [u64; 2],
    dearest: (u64, usize),
    certified: usize,
    wrong: Vec<String>,
}

/// A row's pairs from `first` on.
fn row(kinds: [&str; 2], index: usize, first: usize, count: usize) -> Row {
    let (mut row, name) = (Row::default(), kinds.join(" and "));
    for i in first..first + count {
        let [(a, of_a), (b, of_b)] = draw(kinds, (index as u64) << 32 | i as u64);
        let sides = [(&a, placed(of_a)), (&b, placed(of_b))];
        let ask = |strategies| ask_with(sides[0], sides[1], None, strategies);
        let (told, searched) = (ask(Strategies::default()), ask(SEARCH_ALONE));
        row.told[told.status() as usize] += 1;
        row.alone += usize::from(told.counters.cells == 0);
        row.cells[0] += told.counters.cells;
        row.cells[1] += searched.counters.cells;
        row.dearest = row.dearest.max((told.counters.cells, i));
        let mut wrong = |what: String| row.wrong.push(format!("{name} {i}: {what}"));
        let bounded = [&a, &b].map(|m| m.radius).into_iter().filter(|r| r.is_finite());
        let size = bounded.fold(0.0, f64::max);
        // Of what overlaps any point will do; what was decided at another resolution is another answer.
        let of_overlap = |p: &Outcome| told.status() == Status::Overlap && p.status() == Status::Overlap;
        let mut compare = |how: &str, p: &Outcome| {
            if of_overlap(p) {
                return;
            }
            if p.resolution != told.resolution {
                row.deeper += 1;
                return;
            }
            let mut all = differences(p, &told, size);
            let before = all.len();
            // A wider bracket is as true as long as it is no wider than was asked for at either end and has a time in common with the other one.
            let speed = told.at().normal_speed.abs();
            let tight = |o: &Outcome| {
                (o.time() - o.time_lower()).max(o.time_upper() - o.time() - 2.0 * o.resolution / speed) * speed
                    <= 2.0 * o.resolution
            };
            let one = told.time_lower() <= p.time_upper() && p.time_lower() <= told.time_upper();
            if one && tight(p) && tight(&told) {
                all.retain(|d| !d.starts_with("time_lower") && !d.starts_with("time_upper"));
            }
            row.wider += before - all.len();
            let before = all.len();
            // Of two places at one time either may be told, and either time may be the bracket's end. Of two that meet one after the
            // other but within the resolution (2δ of the gap), too: these are counted apart.
            let speeds = [p, &told].map(|o| o.at().normal_speed.abs());
            let both_meet = p.status() == Status::Contact && told.status() == Status::Contact;
            let apart = (p.time() - told.time()).abs() * speeds[0].max(speeds[1]);
            // At one place both must say the same, but for which three of a corner's many faces, or of an edge's in one plane, are named.
            let elsewhere = (p.at().point - told.at().point).length() > 1e-6 * size;
            if are_tied(p, &told, size) {
                all.retain(|d| match elsewhere {
                    true => d.starts_with("time_lower") || d.starts_with("status"),
                    false => !d.starts_with("faces"),
                });
                row.looser += usize::from(all.len() < before);
                if !elsewhere && !all.is_empty() {
                    row.rare += 1;
                    println!("{name} {i}: {how}: {}", all.join("; "));
                    all.clear();
                }
            } else if both_meet && apart <= 2.0 * told.resolution {
                all.clear();
                row.within += 1;
                row.farthest = row.farthest.max(apart / size);
            }
            all.into_iter().for_each(|d| wrong(format!("{how}: {d}")));
        };
        compare("the search alone", &searched);
        compare("the other way round", &turned(ask_with(sides[1], sides[0], None, Strategies::default())));
        let moving = sides.map(|(m, p)| Moving { solid: &m.solid, place: Pose::IDENTITY, motion: p.motion });
        if !kinds.contains(&"mesh") {
            for (lie, what) in record_judge::lies(&moving[0], &moving[1], &told) {
                // Near the tip of a cone the normal of a point turns by more than the point is off: these are counted.
                if lie == Lie::Normal && kinds.contains(&"frustum") {
                    row.turned += 1;
                    println!("{name} {i}: {what}");
                } else {
                    wrong(format!("{lie:?}: {what}"));
                }
            }
        }
        if told.status() == Status::Contact {
            for (m, p) in sides {
                let at = Field::new(&m.solid, &p.motion.at(told.time())).value(told.at().point);
                if at.abs() > told.resolution + 1e-12 * size {
                    wrong(format!("the point is {at:e} off a surface at {}", told.time()));
                }
            }
        }
        if i % 10 == 0 && told.status() != Status::Overlap {
            row.certified += 1;
            if let (_, Err(e)) = certified(sides[0], sides[1]) {
                wrong(e);
            }
        }
    }
    row
}

#[test]
fn every_kind_meets_every_kind_as_the_search_alone_says_and_either_way_round() {
    let (count, first) = (pairs(1), sized("CONTACTD_FIRST", 0));
    let named = std::env::var("CONTACTD_KINDS").unwrap_or_default();
    let wanted = |kind: &str| named.is_empty() || named.split_whitespace().any(|n| n == kind);
    let n = KINDS.len();
    let rows: Vec<(usize, [&str; 2])> = (0..n)
        .flat_map(|i| (i..n).map(move |j| (i * n + j, [KINDS[i], KINDS[j]])))
        // Two half-spaces meet everywhere, or never.
        .filter(|(_, kinds)| kinds[0] != "half-space" && kinds.iter().all(|k| wanted(k)))
        .collect();
    let found: Vec<Row> = rows
        .par_iter()
        .map(|&(index, kinds)| {
            let row = row(kinds, index, first, count);
            println!(
                "{:>14} {:>14}: {:?} told, {} by no cell, {:.1} and {:.1} cells, at most {} (pair {}), {} at another resolution, {} looser, {} wider, \
                 {} within the resolution (at most {:.1e} of the size), {} normals turned, {} told otherwise at one place, \
                 {} certified, {} wrong",
                kinds[0],
                kinds[1],
                row.told,
                row.alone,
                row.cells[0] as f64 / count as f64,
                row.cells[1] as f64 / count as f64,
                row.dearest.0,
                row.dearest.1,
                row.deeper,
                row.looser,
                row.wider,
                row.within,
                row.farthest,
                row.turned,
                row.rare,
                row.certified,
                row.wrong.len()
            );
            row
        })
        .collect();
    let wrong: Vec<String> = found.iter().flat_map(|r| r.wrong.iter().cloned()).collect();
    assert!(wrong.is_empty(), "{} wrong\n{}", wrong.len(), wrong.join("\n"));
    let told: [usize; 4] = std::array::from_fn(|k| found.iter().map(|r| r.told[k]).sum());
    let all: usize = told.iter().sum();
    assert!(told[Status::Contact as usize] * 5 > all, "{told:?}");
    assert!(told[Status::Undecided as usize] * 1000 <= all, "{told:?}");
    assert!(found.iter().map(|r| r.within + r.turned).sum::<usize>() * 1000 <= all, "within the resolution");
    assert!(found.iter().map(|r| r.rare).sum::<usize>() * 5000 <= all, "told otherwise at one place");
    assert!(found.iter().map(|r| r.deeper + r.looser).sum::<usize>() * 10 <= all, "looser");
}
