//! What the queue's cells hold.

use super::cell::Cell;
use super::items::Items;
use super::propose::Proposals;
use super::scratch::Scratch;
use super::slices::Slices;
use crate::contact::exclusion::clause::Advance;
use crate::contact::exclusion::literal::Side;
use crate::contact::query::options::QueryOptions;
use crate::contact::query::outcome::Counters;
use crate::contact::query::question::{PairQuery, PlacedModel, Strategies, default_resolution};
use crate::contact::query::task::Task;
use crate::contact::witness::contacts::{Contacts, Visited};
use crate::contact::witness::known::Handed;
use crate::math::Aabb;
use crate::motion::Placed;
use crate::octree::testing::pierced;
use crate::solid::local::LiteralId;
use crate::solid::primitive::{Cuboid, Cylinder};
use crate::solid::{Sense, Shape, local};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{Motion, Pose};
use glam::DVec3;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A cell takes over what a few voxels leave of B. Beyond their hull that is another solid, and only the clip planes keep a cell
/// from it: without them no contact would be missed, but the search would not come to an end where the other solid is met.
#[test]
fn no_cell_holds_where_the_whole_trees_do_not() {
    let hole = |i: i32, j: i32| {
        let at = Pose::at(v(f64::from(i) * 0.25, f64::from(j) * 0.25, 0.0));
        (Shape::from(Cylinder { radius: 0.08, half_height: 0.3 }), at)
    };
    let holes = (-2..=2).flat_map(|i| (-2..=2).map(move |j| hole(i, j))).collect();
    let plate = pierced(Cuboid { half: v(0.7, 0.7, 0.1) }, holes);
    let slot = |y: f64| (Shape::from(Cuboid { half: v(1.0, 0.12, 0.4) }), Pose::at(v(0., y, -0.3)));
    let fork = pierced(Cuboid { half: v(0.1, 0.6, 0.5) }, vec![slot(-0.25), slot(0.25)]);
    let (mut held, mut kept_out) = (0, 0);
    for k in 0..40 {
        let r = |a: f64| (f64::from(k) * a).fract() * 2.0 - 1.0;
        let place = Pose::IDENTITY;
        let falling = Motion {
            start: Pose::new(v(r(0.31), r(0.47), 0.9), quat_of_rotation_vector(v(0.2, 0.1, r(0.7)))),
            velocity: v(0.1, 0.2, -1.2),
            spin: v(0.3, 0.0, 0.4),
        };
        let query = PairQuery {
            a: PlacedModel { model: &fork, placed: Placed { place, motion: falling } },
            b: PlacedModel { model: &plate, placed: Placed { place, motion: Motion::resting(Pose::IDENTITY) } },
            resolution: default_resolution(&fork, &plate),
            cell_limit: 1000,
            strategies: Strategies::default(),
            query_options: QueryOptions::DEPTH,
        };
        let (task, _) = Task::of(&query);
        let mut items = Items::new(Scratch::default());
        // A hull of voxels as a walk might leave it.
        let hull = Aabb::around(v(0.5 * r(0.137), 0.5 * r(0.291), 0.0), v(0.15, 0.2, 0.1));
        let (a, b) = (task.a.normal_form.clone(), task.b.normal_form.clone());
        Slices { task: &task, items: &mut items, counters: &mut Counters::default() }.hand_over(
            (0.0, 1.0),
            &task.a.aabb(),
            &hull,
            &a,
            &b,
        );
        let cells: Vec<_> = std::iter::from_fn(|| items.pop()).collect();
        let scratch = &items.scratch;
        for cell in &cells {
            let tokens = |r: (u32, u32)| &scratch.pool[r.0 as usize..r.1 as usize];
            for i in 0..2500u32 {
                // Weyl's sequence in space and time.
                let r = |a: f64| (f64::from(i) * a).fract() * 2.0 - 1.0;
                let x = cell.center + cell.half * v(r(0.819_172_5), r(0.671_043_6), r(0.549_700_5));
                let t = cell.t + (cell.until - cell.t) * 0.5 * (1.0 + r(0.450_304_7));
                let y = task.relative.at(t).b_point(x);
                let value = |tokens: &[_], psi: &mut dyn FnMut(u32) -> f64| {
                    if tokens.is_empty() { f64::NEG_INFINITY } else { local::value(tokens, &mut |f| psi(f)) }
                };
                let own = task.b.faces.len();
                let f_a = value(tokens(cell.a), &mut |f| task.a.faces[f as usize].value(x));
                let of_b = |f: u32| task.b.faces.get(f as usize).map(|face| face.value(y));
                let guarded = |f: u32| of_b(f).unwrap_or_else(|| scratch.clip_planes_b[f as usize - own].value(y));
                let f_b = value(tokens(cell.b), &mut |f| guarded(f));
                let unguarded = value(tokens(cell.b), &mut |f| of_b(f).unwrap_or(f64::NEG_INFINITY));
                let whole = task.a.value(x).max(task.b.value(y));
                if f_a.max(f_b) < -1e-6 {
                    held += 1;
                    assert!(
                        whole <= 0.0,
                        "cell of {} at {t}: {x} is in the cell's solids, {whole} outside",
                        cell.center
                    );
                }
                kept_out += usize::from(f_a.max(unguarded) < -1e-6 && whole > 1e-6);
            }
        }
    }
    println!("{held} points in a cell's solids, {kept_out} kept out by clip_planes alone");
    assert!(held > 100 && kept_out > 100, "{held} {kept_out}");
}

/// Fits weigh two literals each: in large trees eight and more held a cell together. A system takes six of them.
#[test]
fn a_cell_that_more_literals_hold_than_a_system_takes_is_tried_with_those_that_weigh_most() {
    let cube = || pierced(Cuboid { half: v(0.5, 0.5, 0.5) }, Vec::new());
    let (below, above) = (cube(), cube());
    let place = Pose::IDENTITY;
    let falling = Motion { start: Pose::at(v(0.1, 0.2, 1.5)), velocity: v(0.0, 0.0, -1.0), spin: DVec3::ZERO };
    let query = PairQuery {
        a: PlacedModel { model: &above, placed: Placed { place, motion: falling } },
        b: PlacedModel { model: &below, placed: Placed { place, motion: Motion::resting(Pose::IDENTITY) } },
        resolution: default_resolution(&above, &below),
        cell_limit: 1000,
        strategies: Strategies::default(),
        query_options: QueryOptions::DEPTH,
    };
    let (task, _) = Task::of(&query);
    let (mut items, mut contacts) = (Items::new(Scratch::default()), Contacts::new(task));
    let own = || std::iter::once(0).collect();
    items.handed = Handed { primitives: [own(), own()], candidates: std::iter::once((0, 0)).collect() };
    let faces = |side: Side| (0..6).map(move |f| (side, LiteralId::new(f, Sense::Positive), 0.1));
    let support = faces(Side::A).chain(faces(Side::B)).collect();
    let advance = Advance { dt: 0.0, support, y: DVec3::ZERO, cost: DVec3::ONE, now: f64::INFINITY };
    let (a, b) = (task.a.normal_form.clone(), task.b.normal_form.clone());
    let (a, b) = (items.store(&a), items.store(&b));
    let cell = Cell::new((0.4, 1.0), &Aabb::around(v(0.0, 0.0, -0.5), v(0.1, 0.1, 0.1)), a, b);
    let at = task.relative.at(0.4);
    let visited = Visited::default();
    Proposals { items: &mut items, contacts: &mut contacts, patient: true, visited }.attempt(&cell, &advance, &at);
    // A system of more would be refused by an assertion where it is solved.
    assert!(contacts.counters.newton > 0, "a guess is tried");
    let (tried, ..) = &items.scratch.tried[0];
    let of = |side: Side| tried.iter().filter(|l| l.0 == side).count();
    assert_eq!((of(Side::A), of(Side::B)), (5, 1), "all weigh as much: of both bodies, as many as a system takes");
}
