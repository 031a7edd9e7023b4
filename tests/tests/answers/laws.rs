//! Laws that hold for any scene, over random ones: all primitives, all operations, both bodies moving and turning.
//!
//! Each law prints how many of its scenes meet, miss and overlap. For long runs `CONTACTD_LAW_SCENES` sets the number of
//! scenes a law, `CONTACTD_LAW_FIRST` the first one:
//! `CONTACTD_LAW_SCENES=2000 cargo test --release -p contactd-tests --test answers laws:: -- --nocapture`

use contactd::contact::{
    Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, default_resolution, earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::primitive::HalfSpace;
use contactd::world::{MeasuredModel, ObjectSpec, StepOptions, World};
use contactd_proto::{Motion, Pose, PoseRecord};
use contactd_tests::engine;
use contactd_tests::engine::ReportedPoint as _;
use contactd_tests::random_solids::Random;
use contactd_tests::reference::{Verdict, field::Field};
use contactd_tests::scenes::{self, Recipe, Scene, Share};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3};
use std::cell::{Cell, RefCell};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Times of one event computed in two ways may differ by rounding only: 1e-10 of a step at these sizes and speeds.
const SAME: f64 = 1e-10;

/// What a nudge by one unit in the last place of a length may move beyond the bracket: its rounding in time.
const NUDGE: f64 = 1e-12;

thread_local! {
    /// Answers asked for and answers undecided, in this test.
    static ASKED: Cell<(usize, usize)> = const { Cell::new((0, 0)) };
    /// The law's name and its scene, for what is undecided.
    static SCENE: RefCell<(String, usize)> = const { RefCell::new((String::new(), 0)) };
}

fn ask(scene: &Scene) -> Outcome {
    let o = engine::ask(scene);
    let (asked, undecided) = ASKED.get();
    ASKED.set((asked + 1, undecided + usize::from(o.status() == Status::Undecided)));
    if o.status() == Status::Undecided {
        let (place, first) = SCENE.with_borrow(Clone::clone);
        let cells = o.counters.cells;
        println!(
            "UNDECIDED {place}, ask {} ({}): free before {}, {cells} cells",
            asked - first,
            scene.class,
            o.time_lower()
        );
        if std::env::var_os("CONTACTD_LAW_SHOW").is_some() {
            println!("{scene:?}");
        }
    }
    o
}

/// Scenes of a law in the command.
const SCENES: u64 = 16;

/// The same where each takes the reference a tenth of a second.
const SLOW_SCENES: u64 = 8;

/// Runs `law` over random scenes and prints the shares; a law returns what is wrong.
fn hold(name: &str, seed: u64, law: impl Fn(&mut Random, &Scene, &Outcome) -> Result<(), String>) {
    hold_over(name, seed, SCENES, scenes::any, law);
}

fn hold_over(
    name: &str,
    seed: u64,
    scenes: u64,
    draw: impl Fn(&mut Random) -> Scene,
    law: impl Fn(&mut Random, &Scene, &Outcome) -> Result<(), String>,
) {
    let (count, from) = (sized("CONTACTD_LAW_SCENES", scenes), sized("CONTACTD_LAW_FIRST", 0));
    let mut share = Share::default();
    let mut wrong = vec![];
    for i in from..from + count {
        SCENE.set((format!("{name} {i}"), ASKED.get().0));
        let mut random = Random::new(seed * 1_000_003 + i);
        let scene = draw(&mut random);
        let outcome = ask(&scene);
        count_share(&mut share, &scene, &outcome);
        let before = ASKED.get().1 - usize::from(outcome.status() == Status::Undecided);
        let verdict = law(&mut random, &scene, &outcome);
        // Without an answer a law says nothing.
        if let (Err(what), true) = (verdict, ASKED.get().1 == before) {
            wrong.push(format!("scene {i} ({}): {what}", scene.class));
        }
    }
    share.assert_enough(name);
    let (asked, undecided) = ASKED.get();
    println!("{name}: {undecided} of {asked} answers undecided");
    assert_eq!(undecided, 0, "{name}: of {asked}");
    assert!(wrong.is_empty(), "{name}: {} of {count} scenes break it\n{}", wrong.len(), wrong.join("\n"));
}

fn count_share(share: &mut Share, scene: &Scene, o: &Outcome) {
    match o.status() {
        Status::Contact => share.contact += 1,
        Status::Clear => share.clear += 1,
        Status::Overlap => share.overlap += 1,
        Status::Undecided => share.undecided += 1,
    }
    if o.status() == Status::Contact {
        let negative = |recipe: &Recipe, faces: &[u32; 3]| {
            let solid = recipe.build();
            faces.iter().any(|f| {
                solid
                    .face_owner
                    .get(*f as usize)
                    .is_some_and(|p| solid.senses[*p as usize] == contactd::solid::Sense::Negative)
            })
        };
        share.subtracted += usize::from(negative(&scene.a, &o.at().faces_a) || negative(&scene.b, &o.at().faces_b));
    }
}

/// Two answers to the same question: same status, same time.
fn same(x: &Outcome, y: &Outcome) -> Result<(), String> {
    if x.status() != y.status() {
        return Err(format!("{} at {}, but {} at {}", x.status().name(), x.time(), y.status().name(), y.time()));
    }
    if (x.time() - y.time()).abs() > SAME {
        return Err(format!("time {} and {}: {:.1e} apart", x.time(), y.time(), (x.time() - y.time()).abs()));
    }
    Ok(())
}

/// When the pair first touches: 0 in overlap, infinite when it never does.
fn first(o: &Outcome) -> f64 {
    match o.status() {
        Status::Contact | Status::Overlap => o.time(),
        _ => f64::INFINITY,
    }
}

fn earlier_part(m: &Motion, s: f64) -> Motion {
    Motion { start: m.start, velocity: m.velocity * s, spin: m.spin * s }
}

fn later_part(m: &Motion, s: f64) -> Motion {
    Motion { start: m.at(s), velocity: m.velocity * (1.0 - s), spin: m.spin * (1.0 - s) }
}

fn with_motions(scene: &Scene, f: impl Fn(&Motion) -> Motion) -> Scene {
    Scene { motion_a: f(&scene.motion_a), motion_b: f(&scene.motion_b), ..scene.clone() }
}

#[test]
fn every_answer_is_in_order_and_the_reference_agrees() {
    hold_over("reference", 1, SLOW_SCENES, scenes::any, |_, scene, o| {
        let truth = scene.truth_with_care();
        if ![o.time_lower(), o.time(), o.time_upper()].iter().all(|t| (0.0..=1.0).contains(t)) {
            return Err(format!("times {} {} {}", o.time_lower(), o.time(), o.time_upper()));
        }
        if !(o.time_lower() <= o.time() && o.time() <= o.time_upper()) {
            return Err(format!("bracket out of order: {} {} {}", o.time_lower(), o.time(), o.time_upper()));
        }
        match (o.status(), truth.verdict) {
            (Status::Contact, Verdict::Contact) => {
                if (o.time() - truth.time).abs() > SAME {
                    return Err(format!("time {}, reference {} proven from {}", o.time(), truth.time, truth.lower));
                }
                if o.time_lower() > truth.upper {
                    return Err(format!("time_lower {} is after depth at {}", o.time_lower(), truth.upper));
                }
                if truth.active.0 + truth.active.1 <= 3 && o.at().normal.distance(truth.normal) > 1e-6 {
                    return Err(format!("normal {}, reference {}", o.at().normal, truth.normal));
                }
                Ok(())
            }
            (Status::Clear, Verdict::Clear) | (Status::Overlap, Verdict::Overlap) => Ok(()),
            (s, v) => Err(format!(
                "{} at {}, reference {v:?} at {} proven from {}",
                s.name(),
                o.time(),
                truth.time,
                truth.lower
            )),
        }
    });
}

#[test]
fn the_witness_is_on_both_surfaces_at_time() {
    hold("witness", 2, |_, scene, o| {
        if o.status() != Status::Contact {
            return Ok(());
        }
        let depth = |recipe: &Recipe, m: &Motion| {
            let pose = m.at(o.time());
            let local = pose.rotation.conjugate() * (o.at().point - pose.position);
            Field::new(&recipe.build(), &Pose::IDENTITY).value(local)
        };
        let (a, b) = (depth(&scene.a, &scene.motion_a), depth(&scene.b, &scene.motion_b));
        let slack = 2.0 * scene.delta();
        if a.abs() > slack || b.abs() > slack {
            return Err(format!("f at the point: {a:e}, {b:e}"));
        }
        if (o.at().normal.length() - 1.0).abs() > 1e-12 {
            return Err(format!("normal {} is not of unit length", o.at().normal));
        }
        Ok(())
    });
}

#[test]
fn swapping_the_pair_negates_the_normal() {
    hold("swap", 3, |_, scene, o| {
        let s = ask(&scene.swapped());
        same(o, &s)?;
        if o.status() == Status::Contact
            && o.at().point.distance(s.at().point) < 1e-7
            && (o.at().normal + s.at().normal).length() > 1e-6
        {
            return Err(format!("normals {} and {}", o.at().normal, s.at().normal));
        }
        Ok(())
    });
}

fn carried(m: &Motion, by: &Pose) -> Motion {
    Motion { start: by.compose(&m.start), velocity: by.rotation * m.velocity, spin: by.rotation * m.spin }
}

#[test]
fn a_common_rigid_motion_of_the_scene_changes_nothing() {
    hold("rigid motion", 4, |random, scene, o| {
        let by = Pose::new(random.vector(10.0), random.rotation());
        let moved = ask(&with_motions(scene, |m| carried(m, &by)));
        same(o, &moved)?;
        if o.status() == Status::Contact && moved.at().normal.distance(by.rotation * o.at().normal) > 1e-6 {
            let point = by.rotation * o.at().point + by.position;
            if moved.at().point.distance(point) < 1e-7 {
                return Err(format!("normal {}, expected {}", moved.at().normal, by.rotation * o.at().normal));
            }
        }
        Ok(())
    });
}

#[test]
fn a_shift_by_powers_of_two_changes_no_bit() {
    let rounded = |v: DVec3| (v * 1048576.0).round() / 1048576.0;
    let draw = |random: &mut Random| {
        with_motions(&scenes::any(random), |m| Motion {
            start: Pose::new(rounded(m.start.position), m.start.rotation),
            velocity: rounded(m.velocity),
            spin: m.spin,
        })
    };
    hold_over("exact shift", 5, SCENES, draw, |random, scene, o| {
        let k = |r: &mut Random| f64::powi(2.0, r.below(24) as i32);
        let shift = DVec3::new(k(random), -k(random), k(random));
        let moved = ask(&with_motions(scene, |m| Motion {
            start: Pose::new(m.start.position + shift, m.start.rotation),
            ..*m
        }));
        let bits = |o: &Outcome| {
            [o.time_lower(), o.time(), o.time_upper(), o.at().normal.x, o.at().normal.y, o.at().normal.z]
                .map(f64::to_bits)
        };
        if moved.status() != o.status() || bits(&moved) != bits(o) {
            return Err(format!(
                "shifted by {shift}: {} {:e} for {} {:e}",
                moved.status().name(),
                moved.time(),
                o.status().name(),
                o.time()
            ));
        }
        Ok(())
    });
}

#[test]
fn quarter_turns_of_the_world_change_nothing() {
    hold("quarter turns", 6, |random, scene, o| {
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][random.below(3)];
        let by = Pose::new(DVec3::ZERO, DQuat::from_axis_angle(axis, FRAC_PI_2 * (1 + random.below(3)) as f64));
        same(o, &ask(&with_motions(scene, |m| carried(m, &by))))
    });
}

#[test]
fn scaling_by_a_power_of_two_scales_lengths_and_leaves_time() {
    hold("scaling", 7, |random, scene, o| {
        let k = f64::powi(2.0, random.below(41) as i32 - 20);
        let mut scaled = with_motions(scene, |m| Motion {
            start: Pose::new(m.start.position * k, m.start.rotation),
            velocity: m.velocity * k,
            spin: m.spin,
        });
        (scaled.a, scaled.b) = (scene.a.scaled(k), scene.b.scaled(k));
        let s = ask(&scaled);
        same(o, &s)?;
        if o.status() == Status::Contact && s.at().point.distance(o.at().point * k) > 1e-7 * k {
            return Err(format!("point {} scaled by {k}: {}", o.at().point, s.at().point));
        }
        Ok(())
    });
}

#[test]
fn splitting_a_step_finds_the_same_first_contact() {
    hold("splitting", 8, |random, scene, o| {
        let s = random.within(0.2, 0.8);
        let t = first(o);
        if (t - s).abs() < 1e-6 || o.status() == Status::Overlap {
            return Ok(());
        }
        let head = ask(&with_motions(scene, |m| earlier_part(m, s)));
        let found = if head.status() == Status::Contact {
            head.time() * s
        } else if head.status() == Status::Clear {
            let tail = ask(&with_motions(scene, |m| later_part(m, s)));
            if tail.status() == Status::Overlap {
                return Err(format!("clear until {s}, overlap after"));
            }
            s + first(&tail) * (1.0 - s)
        } else {
            return Err(format!("the first part is {}", head.status().name()));
        };
        let same = found == t || (found - t).abs() <= SAME;
        if same { Ok(()) } else { Err(format!("whole {t}, in parts {found} (split at {s})")) }
    });
}

#[test]
fn shortening_a_step_moves_the_contact_or_loses_it() {
    hold("shortening", 9, |random, scene, o| {
        let s = random.within(0.3, 0.95);
        let t = first(o);
        if (t - s).abs() < 1e-6 || o.status() == Status::Overlap {
            return Ok(());
        }
        let short = ask(&with_motions(scene, |m| earlier_part(m, s)));
        match (t < s, short.status()) {
            (true, Status::Contact) if (short.time() * s - t).abs() <= SAME => Ok(()),
            (false, Status::Clear) => Ok(()),
            (_, status) => Err(format!("contact at {t}, shortened to {s}: {} at {}", status.name(), short.time() * s)),
        }
    });
}

#[test]
fn reversing_time_turns_the_last_exit_into_the_first_entry() {
    hold("reversal", 10, |_, scene, o| {
        let back = ask(&with_motions(scene, |m| Motion { start: m.at(1.0), velocity: -m.velocity, spin: -m.spin }));
        match o.status() {
            Status::Clear if back.status() == Status::Clear => Ok(()),
            Status::Contact if first(&back) <= 1.0 - o.time_upper() + SAME => Ok(()),
            Status::Overlap if first(&back) <= 1.0 => Ok(()),
            s => Err(format!("{} at {}, backwards {} at {}", s.name(), o.time(), back.status().name(), back.time())),
        }
    });
}

/// Another solid in place of a.
fn with_a(scene: &Scene, a: Recipe) -> Scene {
    Scene { a, ..scene.clone() }
}

fn another(random: &mut Random) -> Recipe {
    let at = scenes::pose(random, 0.5);
    scenes::primitive(random, 0.6).moved(&at)
}

#[test]
fn a_union_touches_when_its_first_operand_does() {
    hold("union", 11, |random, scene, o| {
        let c = another(random);
        let (alone, both) = (ask(&with_a(scene, c.clone())), ask(&with_a(scene, scene.a.clone().union(c))));
        let expected = first(o).min(first(&alone));
        let found = first(&both);
        let same = found == expected || (found - expected).abs() <= SAME;
        if same { Ok(()) } else { Err(format!("union at {found}, operands at {} and {}", first(o), first(&alone))) }
    });
}

#[test]
fn an_intersection_or_a_difference_touches_never_earlier() {
    hold("cut", 12, |random, scene, o| {
        let c = another(random);
        for (what, cut) in [("∩", scene.a.clone().intersection(c.clone())), ("−", scene.a.clone().minus(c))] {
            let cut = ask(&with_a(scene, cut));
            if first(&cut) < first(o) - SAME {
                return Err(format!("A {what} C at {}, A at {}", first(&cut), first(o)));
            }
        }
        Ok(())
    });
}

#[test]
fn union_commutes_and_a_solid_joined_with_itself_stays() {
    hold("commuting", 13, |random, scene, o| {
        let c = another(random);
        let ab = ask(&with_a(scene, scene.a.clone().union(c.clone())));
        let ba = ask(&with_a(scene, c.union(scene.a.clone())));
        same(&ab, &ba)?;
        same(o, &ask(&with_a(scene, scene.a.clone().union(scene.a.clone()))))?;
        same(o, &ask(&with_a(scene, scene.a.clone().intersection(scene.a.clone()))))
    });
}

#[test]
fn de_morgan_holds_inside_a_box() {
    hold("De Morgan", 14, |random, scene, _| {
        let block = || Recipe::cuboid(0.9, 0.8, 0.7);
        let (c, d) = (another(random), another(random));
        let joined = ask(&with_a(scene, block().minus(c.clone().union(d.clone()))));
        let cut = ask(&with_a(scene, block().minus(c).intersection(block().minus(d))));
        same(&joined, &cut)
    });
}

#[test]
fn a_box_a_polyhedron_and_six_half_spaces_are_one_solid() {
    let half_space =
        |n: DVec3, d: f64| Recipe::Leaf(HalfSpace.into(), Pose::new(n * d, DQuat::from_rotation_arc(DVec3::Z, n)));
    hold("box", 15, |random, scene, _| {
        let h = DVec3::new(random.within(0.3, 0.8), random.within(0.3, 0.8), random.within(0.3, 0.8));
        let hole = another(random);
        let corners = (0..8).map(|i| {
            DVec3::new(
                if i & 1 == 0 { h.x } else { -h.x },
                if i & 2 == 0 { h.y } else { -h.y },
                if i & 4 == 0 { h.z } else { -h.z },
            )
        });
        let polyhedron = contactd::solid::primitive::Polyhedron::hull(corners.collect()).expect("a box");
        let sides = [(DVec3::X, h.x), (DVec3::Y, h.y), (DVec3::Z, h.z)];
        let planes = sides.iter().flat_map(|(n, d)| [half_space(*n, *d), half_space(-*n, *d)]).collect();
        let three = [
            Recipe::cuboid(h.x, h.y, h.z),
            Recipe::of(polyhedron),
            Recipe::Op(contactd::solid::Op::Intersection, planes),
        ];
        let [x, y, z] = three.map(|solid| ask(&with_a(scene, solid.minus(hole.clone()))));
        same(&x, &y)?;
        same(&x, &z)
    });
}

#[test]
fn spinning_a_solid_of_revolution_about_its_own_axis_changes_nothing() {
    let draw = |random: &mut Random| {
        let mut scene = scenes::any(random);
        let r = random.within(0.2, 0.5);
        scene.b = match random.below(3) {
            0 => Recipe::cylinder(r, random.within(0.2, 0.6)),
            1 => Recipe::cone(r, 0.0, random.within(0.2, 0.6)),
            _ => Recipe::cylinder(r, 0.4).minus(Recipe::cylinder(0.6 * r, 0.5)).union(Recipe::sphere(0.3 * r)),
        };
        if scene.class != "trees" {
            scene.b = scene.b.scaled(0.5);
        }
        scene.motion_b.spin = DVec3::ZERO;
        scene
    };
    hold_over("own axis", 16, SCENES, draw, |random, scene, o| {
        let axis = scene.motion_b.start.rotation * DVec3::Z;
        let mut spun = scene.clone();
        spun.motion_b.spin = axis * random.within(-20.0, 20.0);
        same(o, &ask(&spun))
    });
}

#[test]
fn a_nudge_by_one_unit_in_the_last_place_stays_within_the_bracket() {
    hold("nudge", 17, |_, scene, o| {
        let mut nudged = scene.clone();
        let p = &mut nudged.motion_b.start.position;
        *p = DVec3::new(p.x.next_up(), p.y.next_down(), p.z.next_up());
        let n = ask(&nudged);
        same(o, &n)?;
        let room = NUDGE;
        if n.time() < o.time_lower() - room || n.time() > o.time_upper() + room {
            return Err(format!("time {}, bracket {} to {}", n.time(), o.time_lower(), o.time_upper()));
        }
        Ok(())
    });
}

fn bits(o: &Outcome) -> [u64; 9] {
    [
        o.time_lower(),
        o.time(),
        o.time_upper(),
        o.at().normal.x,
        o.at().normal.y,
        o.at().normal.z,
        o.at().point.x,
        o.at().point.y,
        o.at().point.z,
    ]
    .map(f64::to_bits)
}

fn same_bits(x: &Outcome, y: &Outcome, what: &str) -> Result<(), String> {
    if (x.status(), x.at().kind, x.at().extent, x.at().faces_a, x.at().faces_b)
        != (y.status(), y.at().kind, y.at().extent, y.at().faces_a, y.at().faces_b)
        || bits(x) != bits(y)
    {
        return Err(format!("{what}: {:?} for {:?}", y, x));
    }
    Ok(())
}

#[test]
fn memory_that_was_used_before_changes_no_bit() {
    let scratch = RefCell::new(Scratch::default());
    hold("warm", 18, |_, scene, o| {
        let (a, b) = (Model::new(scene.a.build()), Model::new(scene.b.build()));
        let placed = |motion| Placed { place: Pose::IDENTITY, motion };
        let query = PairQuery {
            a: PlacedModel { model: &a, placed: placed(scene.motion_a) },
            b: PlacedModel { model: &b, placed: placed(scene.motion_b) },
            resolution: scene.resolution.unwrap_or_else(|| default_resolution(&a, &b)),
            cell_limit: engine::CELL_LIMIT,
            strategies: Default::default(),
            query_options: QueryOptions::DEPTH,
        };
        same_bits(o, &earliest_contact(&query, &mut scratch.borrow_mut()), "warm")
    });
}

#[test]
fn other_pairs_of_the_step_change_no_bit() {
    let ball = Arc::new(MeasuredModel::new(Arc::new(Model::new(Recipe::sphere(0.4).build()))));
    hold("batch", 19, |random, scene, o| {
        let parts = [&scene.a, &scene.b].map(|r| Arc::new(MeasuredModel::new(Arc::new(Model::new(r.build())))));
        let mut world = World::new(8, 8);
        let mut add = |id: u32, part: &Arc<MeasuredModel>, motion: &Motion| {
            world.add_object(ObjectSpec::new(id, part, motion.start)).map(|_| ()).map_err(|e| e.to_string())
        };
        let free = Motion::turning(scenes::pose(random, 1.0), random.vector(1.0), random.vector(2.0));
        let motions = [scene.motion_a, free, scene.motion_b, free];
        for (i, (part, motion)) in [&parts[0], &ball, &parts[1], &ball].into_iter().zip(&motions).enumerate() {
            add(i as u32, part, motion)?;
        }
        let end = |m: &Motion| m.start.position + m.velocity;
        let records: Vec<PoseRecord> =
            motions.iter().enumerate().map(|(i, m)| PoseRecord::turn(i as u32, end(m), m.spin)).collect();
        let options =
            StepOptions { clear: true, max_records: 100, cell_limit: engine::CELL_LIMIT, ..Default::default() };
        let out = world.step(&records, &options).map_err(|e| e.to_string())?;
        let found = out.pairs.iter().find(|p| (p.a, p.b) == (0, 2)).map(|p| p.outcome);
        // The broad phase drops what never comes near.
        let found = found.unwrap_or_else(|| Outcome::clear(o.resolution));
        // The end's velocity is the difference of two positions: right to a rounding.
        same(o, &found)
    });
}
