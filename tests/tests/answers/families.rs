//! Thirteen families of random scenes: nothing is wrong by judges that share no code with the engine, and nothing undecided.
//!
//! In the command 5 scenes of each; `CONTACTD_FAMILY_SCENES` says how many in the long form, `CONTACTD_FAMILY_SEED` which
//! (1 by default). `cargo run --release -p contactd-benches --bin families` tells what they cost.

use crate::tight::Pair;
use contactd::contact::{Contact, ContactKind, ContactPoint, Outcome, Overlap, Status, Verdict};
use contactd::motion::Placed;
use contactd::world::{StepOutcome, record};
use contactd_proto::Pose;
use contactd_proto::contact_record::{COARSER_RESOLUTION, NO_FACE};
use contactd_tests::engine::{ReportedPoint as _, SEARCH_ALONE, ask_with};
use contactd_tests::families::{Course, Effort, Fault, NAMES, Node, Scene, Shape, ask, examine, judge, of_size, scene};
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};
use rayon::prelude::*;

/// Cells that a scene of the command's may cost: a fiftieth of the engine's limit.
const CELLS: u64 = 20_000;

#[test]
fn nothing_is_wrong_and_nothing_undecided() {
    let (scenes, seed) = (sized("CONTACTD_FAMILY_SCENES", 5), sized("CONTACTD_FAMILY_SEED", 1));
    let cells = if scenes > 40 { 0 } else { CELLS };
    let of_family = |family: usize| {
        let verdicts: Vec<_> = (0..scenes)
            .into_par_iter()
            .map(|index| (index, examine(&scene(seed, family, index), cells, Effort::Quick)))
            .collect();
        let met = verdicts.iter().filter(|(_, v)| v.status == Some(Status::Contact)).count();
        for (index, v) in verdicts.iter().filter(|(_, v)| !v.is_right()) {
            println!("{} {index}: {:?} after {} cells, {:?}", NAMES[family], v.status, v.cells, v.faults);
        }
        let is_record = |f: &Fault| f.kind.starts_with("record");
        let wrong = verdicts.iter().filter(|(_, v)| !v.faults.iter().all(is_record)).count();
        [met, verdicts.iter().filter(|(_, v)| !v.is_right()).count() - wrong, wrong]
    };
    let sum = |x: [usize; 3], y: [usize; 3]| [0, 1, 2].map(|k| x[k] + y[k]);
    let [met, open, wrong] = (0..NAMES.len()).map(of_family).fold([0; 3], sum);
    println!(
        "{met} of {} scenes meet; {open} are undecided or reported of wrongly, {wrong} wrong",
        scenes * NAMES.len() as u64
    );
    assert!(met as u64 * 10 >= 3 * scenes * NAMES.len() as u64, "too few meet: {met}");
    assert_eq!(wrong, 0);
    assert_eq!(open, 0, "undecided or reported of wrongly");
}

/// Trees of many primitives. `CONTACTD_SIZED_SCENES` sets their number, `CONTACTD_FAMILY_SEED` other ones; some may take a tenth of the
/// engine's limit and be left undecided.
#[test]
fn nothing_is_wrong_of_trees_of_a_hundred_primitives_and_more() {
    let (scenes, seed) = (sized("CONTACTD_SIZED_SCENES", 2), sized("CONTACTD_FAMILY_SEED", 1));
    let verdicts: Vec<_> = (0..scenes)
        .into_par_iter()
        .map(|index| {
            let primitives = [100, 200][(index % 2) as usize];
            (index, examine(&of_size(seed, primitives, index), 100_000, Effort::Quick))
        })
        .collect();
    let of = |status: Status| verdicts.iter().filter(|(_, v)| v.status == Some(status)).count();
    for (index, v) in verdicts.iter().filter(|(_, v)| !v.is_right()) {
        println!("{index}: {:?} after {} cells, {:?}", v.status, v.cells, v.faults);
    }
    let is_record = |f: &Fault| f.kind.starts_with("record");
    let wrong = verdicts.iter().filter(|(_, v)| !v.faults.iter().all(is_record)).count();
    let open = verdicts.iter().filter(|(_, v)| !v.is_right()).count() - wrong;
    println!(
        "{scenes} scenes: {} meet; {open} are undecided or reported of wrongly, {wrong} wrong",
        of(Status::Contact)
    );
    assert_eq!(wrong, 0);
    assert!(of(Status::Contact) > 0 && open * 50 <= verdicts.len());
}

/// Looks for a witness are charged as cells, and as much is searched before the next one: one after the other they came to 654,487.
#[test]
fn looks_for_a_witness_do_not_follow_each_other() {
    let verdict = examine(&of_size(6, 200, 44), 0, Effort::Quick);
    assert_eq!(verdict.status, Some(Status::Clear));
    assert!(verdict.cells < 20_000, "{} cells", verdict.cells);
}

#[test]
fn scenes_are_what_their_seed_says() {
    for family in 0..NAMES.len() {
        let texts = |seed: u64, index: u64| {
            let s = scene(seed, family, index);
            [s.a.text(), s.b.text(), s.text()]
        };
        assert_eq!(texts(1, 5), texts(1, 5));
        assert_ne!(texts(1, 5), texts(1, 6));
        assert_ne!(texts(1, 5), texts(2, 5));
    }
}

/// Each kind of wrong answer about status and time is noticed, in nearly all scenes of contact.
#[test]
fn the_judge_notices_wrong_answers() {
    let mut noticed = [0; 5];
    let mut contacts = 0;
    let scenes = sized("CONTACTD_FAMILY_SCENES", 16);
    for index in 0..scenes {
        let scene = scene(1, 0, index);
        let answer = ask(&scene, 0).expect("an answer");
        let o = answer.pair.outcome;
        if o.status() != Status::Contact || o.time() < 0.05 || o.time() > 0.8 || o.at().normal_speed < 1e-3 {
            continue;
        }
        contacts += 1;
        let contact = *o.contact().expect("a contact");
        let with = |verdict: Verdict| Outcome { verdict, ..o };
        let meets = |time_lower: f64, time: f64| {
            with(Verdict::Contact(Contact { time_lower, time, time_upper: time, ..contact }))
        };
        let clear = with(Verdict::Clear { until: 1.0, rest: None });
        // Late by a hundredth of the step: the contact is then this much deeper.
        let late = meets(o.time() + 0.01, o.time() + 0.01);
        let early = meets(0.0, o.time() - 0.01);
        let overlap = with(Verdict::Overlap(Overlap { time: 0.0, point: contact.point, penetration: None }));
        let nan = with(Verdict::Contact(Contact { time: f64::NAN, ..contact }));
        for (k, (wrong, kind)) in
            [(clear, "miss"), (late, "miss"), (early, "witness"), (overlap, "overlap"), (nan, "not finite")]
                .into_iter()
                .enumerate()
        {
            let found = judge(&scene, &wrong, Effort::Quick, || answer.witness());
            noticed[k] += usize::from(found.iter().any(|f| f.kind == kind));
        }
        assert_eq!(judge(&scene, &o, Effort::Quick, || answer.witness()), [], "scene {index}");
    }
    println!("{contacts} contacts; noticed: {noticed:?}");
    assert!(3 * contacts as u64 >= scenes, "{contacts} of {scenes}");
    assert!(noticed[..2].iter().all(|n| n * 20 >= contacts * 17), "misses go unnoticed: {noticed:?} of {contacts}");
    assert!(noticed[2..].iter().all(|n| *n == contacts), "{noticed:?} of {contacts}");
}

/// A peg that leans by some 1e-9 in its hole and moves sideways reaches depth delta at the hole's mouth when a closed form
/// says so. The two axes differ in the last digits of unit vectors: what their difference loses must not be left out of a bound.
#[test]
fn a_peg_that_hardly_leans_meets_its_hole() {
    let (radius, gap, way, height) = (0.75, 9e-9, 1.6e-8, 0.03);
    let round = |r: f64, h: f64| Node::Leaf(Shape::Round { h, bottom: r, top: r });
    let block = Node::Leaf(Shape::Box { size: dvec3(3.0, 3.0, 3.2) }).at(dvec3(0.0, 0.0, -1.6));
    for lean in [1e-9, 3e-9, 7e-9, 1e-8, 1.05e-8, 1.1e-8, 1.3e-8] {
        for angle in [0.0, 0.7, 2.0] {
            let still = Course { start: DVec3::ZERO, rotation: DQuat::IDENTITY, end: DVec3::ZERO, spin: DVec3::ZERO };
            let turn = DQuat::from_rotation_z(angle);
            let start = dvec3(0.0, 0.0, -height);
            let rotation = (turn * DQuat::from_xyzw(0.0, lean / 2.0, 0.0, 1.0)).normalize();
            let moving = Course { start, rotation, end: start + turn * DVec3::X * way, spin: DVec3::ZERO };
            let (a, b) = (block.clone().less(round(radius, 1.7)), round(radius - gap, 0.85));
            let o =
                ask(&Scene { a, b, courses: [still, moving], resolution: None }, 0).expect("an answer").pair.outcome;
            // At the mouth the peg's axis is off by way·t + lean·height; half of what is beyond the gap is common to both.
            let known = (2.0 * o.resolution + gap - lean * height) / way;
            let reported = (o.status(), o.time_lower(), o.time(), o.time_upper());
            assert_eq!(o.status(), Status::Contact, "lean {lean:e}, angle {angle}: {reported:?}, known {known}");
            assert!(o.time_lower() <= known + 1e-6, "lean {lean:e}, angle {angle}: {reported:?}, known {known}");
            assert!((o.time_upper() - known).abs() < 0.02, "lean {lean:e}, angle {angle}: {reported:?}, known {known}");
        }
    }
}

/// Deep trees whose small primitives allow no coarser resolution: a long search goes on at its own, with the work that is left.
#[test]
fn long_searches_without_a_coarser_resolution_go_on() {
    for (index, met) in [(107, true), (9009, false)] {
        let scene = scene(1, 1, index);
        let answer = ask(&scene, 0).expect("a scene");
        let o = &answer.pair.outcome;
        assert_eq!(o.status(), if met { Status::Contact } else { Status::Clear }, "{} {index}: {o:?}", NAMES[1]);
        let faults = judge(&scene, o, Effort::Thorough, || answer.witness());
        assert!(faults.is_empty(), "{index}: {faults:?}");
    }
}

/// Of two bodies that fit a fine search finds a deep point, and no coarser one does: what is known is told.
#[test]
fn what_a_finer_search_has_found_stays_where_a_coarser_one_finds_nothing() {
    let answer = ask(&scene(1, 6, 3103), 0).expect("a scene");
    let o = &answer.pair.outcome;
    assert_eq!((o.status(), o.resolution), (Status::Contact, answer.own_resolution));
}

/// A body that spins in a hole of nearly its own shape, where a search at the resolution asked for takes too long: a coarser one
/// answers, says so, and no point contradicts it.
#[test]
fn long_searches_are_answered_at_a_coarser_resolution_that_is_reported() {
    let (family, index) = (7, 2200);
    let scene = scene(1, family, index);
    let answer = ask(&scene, 0).expect("a scene");
    let o = &answer.pair.outcome;
    let name = format!("{} {index}", NAMES[family]);
    assert_eq!(o.status(), Status::Contact, "{name}");
    let coarser = o.resolution / answer.own_resolution;
    assert!((16.0..=4e4).contains(&coarser), "{name}: {coarser} times as coarse");
    let step = StepOutcome { pairs: vec![answer.pair], ..StepOutcome::default() };
    let slot = |i| record::slot(&answer.check.world, &step, true, i);
    let reported = slot(1).as_detail().expect("a detail slot").resolution;
    assert_ne!(slot(0).flags & COARSER_RESOLUTION, 0, "{name}");
    assert_eq!(reported, o.resolution, "{name}");
    assert!(o.counters.cells < 200_000, "{name}: {} cells", o.counters.cells);
    let faults = judge(&scene, o, Effort::Thorough, || answer.witness());
    assert!(faults.is_empty(), "{name}: {faults:?}");
}

/// Witnesses from which no equations lead back: the faces that decide change on the way, or two like faces have a line
/// in common. Climbs lead to a touch, which both judges find nothing wrong with.
#[test]
fn witnesses_are_followed_back_to_a_touch() {
    for (family, index) in [(12, 2074), (12, 4766), (12, 5575), (12, 13727), (7, 11533), (6, 1427)] {
        let name = format!("{} {index}", NAMES[family]);
        let scene = scene(1, family, index);
        let answer = ask(&scene, 0).expect("a scene");
        let o = &answer.pair.outcome;
        assert_eq!(o.status(), Status::Contact, "{name}: {o:?}");
        assert!(!o.not_continued(), "{name}: {o:?}");
        let verdict = examine(&scene, 0, Effort::Quick);
        assert!(verdict.is_right(), "{name}: {:?}", verdict.faults);
    }
}

/// Climbs that come to rest beside the touch: at a point that lies off both surfaces, or where the normals of small round
/// faces are not yet opposite. No touch is told there that the judges object to.
#[test]
fn ends_of_climbs_beside_the_touch_are_not_told() {
    for index in [3603, 8524, 13019, 17852, 18187, 19540] {
        let verdict = examine(&scene(1, 9, index), 0, Effort::Quick);
        assert_eq!(verdict.status, Some(Status::Contact), "{} {index}", NAMES[9]);
        assert!(verdict.is_right(), "{} {index}: {:?}", NAMES[9], verdict.faults);
    }
}

/// A face that decides at depth delta and is passed by before the surfaces meet is none of the touch's: in skins
/// thinner than the resolution, at corners cut out of a body.
#[test]
fn faces_that_are_passed_by_are_not_told() {
    let skins = [1985, 4712, 9115, 9504, 14657, 17255].map(|index| (11, index));
    for (family, index) in skins.into_iter().chain([(12, 2934), (12, 17466), (12, 19012), (6, 18324)]) {
        let verdict = examine(&scene(1, family, index), 0, Effort::Quick);
        assert_eq!(verdict.status, Some(Status::Contact));
        assert!(verdict.is_right(), "{} {index}: {:?}", NAMES[family], verdict.faults);
    }
}

/// Contacts of bodies whose faces lie in common planes: the tip of a cone against an edge, and a face behind which
/// another one of its plane always decides.
#[test]
fn contacts_at_tips_and_in_common_planes_are_told_of_the_faces_that_decide() {
    for index in [2882, 5661, 10443, 12921, 14594, 16632, 10089, 16258, 11197] {
        let verdict = examine(&scene(1, 2, index), 0, Effort::Quick);
        assert_eq!(verdict.status, Some(Status::Contact));
        assert!(verdict.is_right(), "{} {index}: {:?}", NAMES[2], verdict.faults);
    }
}

/// Walls of skins without thickness and of notches: which of them f depends on near the point is a matter of where the
/// others have decided before, not of which of them may be true together.
#[test]
fn faces_that_others_precede_in_every_direction_are_not_told() {
    for index in [2931, 13454, 17504] {
        let verdict = examine(&scene(1, 2, index), 0, Effort::Quick);
        assert_eq!(verdict.status, Some(Status::Contact));
        assert!(verdict.is_right(), "{} {index}: {:?}", NAMES[2], verdict.faults);
    }
}

/// Where one body shows a tip between two faces that are next to opposite, or a rim that is small against the pair, the normal
/// is the other body's own.
#[test]
fn normals_are_those_of_the_body_that_tells_them_best() {
    for (family, index) in [(2, 16971), (4, 2395)] {
        let verdict = examine(&scene(1, family, index), 0, Effort::Quick);
        assert_eq!(verdict.status, Some(Status::Contact));
        assert!(verdict.is_right(), "{} {index}: {:?}", NAMES[family], verdict.faults);
    }
}

/// Pegs that turn many times in a step in holes of nearly their own shape, leaning by little: clear, as the gaps between the
/// rims of the one and the walls of the other say at any time, and proven as such with the cells on the hole's body.
#[test]
fn pegs_that_turn_in_conical_holes_are_proven_clear() {
    for index in [2559, 3664, 7196, 16041] {
        let verdict = examine(&scene(1, 7, index), CELLS, Effort::Quick);
        assert_eq!(verdict.status, Some(Status::Clear), "{} {index}: {} cells", NAMES[7], verdict.cells);
        assert!(verdict.faults.is_empty() && verdict.cells < 2000, "{} {index}: {verdict:?}", NAMES[7]);
    }
}

/// Witnesses in the thin layer that like faces have in common: what is told lies as deep in the one body as in the other.
#[test]
fn witnesses_between_like_faces_lie_in_the_middle() {
    for (family, index) in [(6, 15653), (7, 621), (7, 6138), (7, 9165), (7, 11757)] {
        let verdict = examine(&scene(1, family, index), 0, Effort::Quick);
        assert_eq!(verdict.status, Some(Status::Contact));
        assert!(verdict.is_right(), "{} {index}: {:?}", NAMES[family], verdict.faults);
    }
}

/// Bodies that start in each other by less than two resolutions: what is told of the start is a point that lies that
/// deep in both.
#[test]
fn contacts_at_the_start_are_told_at_a_common_point() {
    for (family, index) in
        [149, 1544, 4401, 5148, 15680, 18596, 1060, 1492].map(|i| (6, i)).into_iter().chain([(7, 13516), (9, 4257)])
    {
        let scene = scene(1, family, index);
        let o = ask(&scene, 0).expect("a scene").pair.outcome;
        assert_eq!((o.status(), o.time()), (Status::Contact, 0.0), "{index}");
        let verdict = examine(&scene, 0, Effort::Quick);
        assert!(verdict.is_right(), "{} {index}: {:?}", NAMES[family], verdict.faults);
    }
}

/// Bodies that fit closely meet along rims and edges where the equations are nearly singular: each of these took 16,000 cells where
/// Newton's method did not come to the contact.
#[test]
fn what_fits_closely_is_met_without_a_search_of_its_rims() {
    for (family, index) in [(6, 214), (6, 13532), (6, 14137), (6, 18962), (7, 1995), (7, 2882), (7, 3140)] {
        let answer = ask(&scene(1, family, index), 0).expect("a scene");
        let o = &answer.pair.outcome;
        assert_eq!((o.status(), o.resolution), (Status::Contact, answer.own_resolution), "{} {index}", NAMES[family]);
        assert!(o.counters.cells < 2_000, "{} {index}: {} cells", NAMES[family], o.counters.cells);
    }
}

/// Between like faces the multipliers of a touch may hardly miss their balance far from where they have it: at the mouth
/// of a socket the edge holds the ball with next to no weight, and a touch on the walls alone is told of other normals.
/// A cone's tip is no touch where it is pressed from within; and what a climb follows at a depth another face of the same
/// body may be ahead of where the surfaces meet. Where a slender tip is told, the faces of the other body are told that pass
/// as near as it does.
#[test]
fn touches_are_balanced_and_of_the_faces_ahead() {
    for (family, index) in [(6, 4242), (7, 19373), (2, 14256), (7, 17903), (9, 19685), (7, 11221)] {
        let scene = scene(1, family, index);
        let answer = ask(&scene, 0).expect("a scene");
        let o = &answer.pair.outcome;
        assert_eq!(o.status(), Status::Contact, "{} {index}", NAMES[family]);
        assert_eq!(judge(&scene, o, Effort::Quick, || answer.witness()), [], "{} {index}", NAMES[family]);
        // Kernels answer for most of them in front of the search, which is asked as well.
        let [a, b] = [answer.pair.a, answer.pair.b].map(|id| {
            let body = answer.check.world.body(id).expect("a body of the pair");
            (&*body.part.model, Placed { place: Pose::IDENTITY, motion: body.motion_state.motion })
        });
        let alone = ask_with(a, b, None, SEARCH_ALONE);
        assert_eq!(judge(&scene, &alone, Effort::Quick, || answer.witness()), [], "{} {index}", NAMES[family]);
        if o.time() == 0.0 {
            continue;
        }
        // Nothing nearby is deep at the time that is told, by a descent that knows nothing of faces.
        let bodies = [answer.pair.a, answer.pair.b].map(|id| answer.check.world.body(id).expect("a body of the pair"));
        let pair = Pair { models: bodies.map(|b| &*b.part.model), motions: bodies.map(|b| b.motion_state.motion) };
        let value = [1e-3, 1e-5, 1e-7].map(|step| pair.descend(o.time(), o.at().point, step).1);
        let depth = value.into_iter().fold(0.0, |depth: f64, value| depth.max(-value)) / o.resolution;
        assert!(depth < 0.02, "{} {index}: {depth} resolutions deep at the touch", NAMES[family]);
    }
}

/// A wall that is hardly thicker than the resolution is pierced along a rim: nowhere in it is anything deeper, so that the way
/// back to the touch leads along the wall, down to where the rim came first.
#[test]
fn what_has_pierced_a_thin_wall_is_followed_back_to_where_it_came_through_first() {
    let scene = scene(1, 11, 12027);
    let answer = ask(&scene, 0).expect("an answer");
    let o = &answer.pair.outcome;
    assert_eq!(judge(&scene, o, Effort::Quick, || answer.witness()), []);
    assert!(!o.not_continued() && o.time() - o.time_lower() < 1e-8, "{o:?}");
}

/// A body that starts one resolution deep and sinks to just two of them. Rounding leaves open whether that is twice the
/// depth; at a raised resolution the start is not in touch any more, so that what reaches it once is a contact.
#[test]
fn a_resolution_raised_at_twice_its_depth_is_searched_at_once_its_depth_again() {
    let cube = |x: f64, y: f64, z: f64| Node::Leaf(Shape::Box { size: dvec3(x, y, z) });
    let ground = cube(4.0, 4.0, 1.0).at(dvec3(0.0, 0.0, -0.5)).or(cube(1.0, 1.0, 1.0).at(dvec3(1.25, 1.25, 0.5)));
    let cross = cube(1.0, 0.5, 0.5).or(cube(0.5, 1.0, 0.5));
    let still = Course { start: DVec3::ZERO, rotation: DQuat::IDENTITY, end: DVec3::ZERO, spin: DVec3::ZERO };
    // What two flat faces have in common is twice as thick as it is deep.
    let sinks = |from: f64, to: f64, resolution: f64| {
        let [start, end] = [from, to].map(|depth| dvec3(0.0, 0.0, 0.25 - 2.0 * depth));
        let moving = Course { start, rotation: DQuat::IDENTITY, end, spin: DVec3::ZERO };
        let (a, b) = (ground.clone(), cross.clone());
        Scene { a, b, courses: [still, moving], resolution: Some(resolution) }
    };
    let delta = 1.2 * ask(&sinks(0.0, 0.0, 1e-15), 0).expect("an answer").pair.outcome.resolution;
    let mut raised = 0;
    for part in [-4, -2, 0, 2, 4, 6] {
        let scene = sinks(delta, 2.0 * delta * (1.0 + 0.01 * f64::from(part)), delta);
        let answer = ask(&scene, 0).expect("an answer");
        let o = &answer.pair.outcome;
        assert_eq!(judge(&scene, o, Effort::Quick, || answer.witness()), [], "{part}: {o:?}");
        if o.resolution > 1.5 * delta {
            raised += 1;
            assert_eq!(o.status(), Status::Contact, "{part}: {o:?}");
        }
    }
    assert!(raised >= 2, "{raised}");
}

/// World coordinates a million sizes away round a point by more than faces are apart there: the judge of records sees
/// it from the bodies. It finds nothing wrong with what is told of such points, and still notices what is.
#[test]
fn points_far_from_the_origin_are_seen_from_the_bodies() {
    for index in [11687, 13187] {
        let mut answer = ask(&scene(1, 9, index), 0).expect("an answer");
        assert_eq!(answer.lies(), [], "{index}");
        let told = *answer.pair.outcome.contact().expect("a contact");
        let point = told.point.expect("a point");
        let mut notices = |wrong: ContactPoint| {
            answer.pair.outcome.verdict = Verdict::Contact(Contact { point: Some(wrong), ..told });
            assert!(!answer.lies().is_empty(), "{index}: {wrong:?}");
        };
        let [a, b] = [point.faces_a, point.faces_b];
        let fewer = |f: [u32; 3]| if f[1] == NO_FACE { [NO_FACE; 3] } else { [f[1], NO_FACE, NO_FACE] };
        notices(ContactPoint { faces_a: [a[0] ^ 1, a[1], a[2]], ..point });
        notices(ContactPoint { faces_a: fewer(a), ..point });
        notices(ContactPoint { faces_b: fewer(b), ..point });
        notices(ContactPoint {
            normal: (point.normal + point.normal.any_orthonormal_vector() * 1e-5).normalize(),
            ..point
        });
        notices(ContactPoint { point: point.point + point.normal * 1e-6, ..point });
    }
    // A corner on an edge, exactly: whoever tells of one face of the two is noticed, the judge's own moves left aside.
    let a = Node::Leaf(Shape::Box { size: DVec3::splat(2.0) });
    let corners =
        [(0.0, 0.0, -1.0), (-0.5, -0.5, 0.5), (0.75, -0.25, 0.5), (-0.25, 0.5, 0.5)].map(|(x, y, z)| dvec3(x, y, z));
    let b = Node::Leaf(Shape::Hull {
        points: corners.to_vec(),
        faces: vec![vec![0, 1, 2], vec![0, 2, 3], vec![0, 3, 1], vec![1, 3, 2]],
    });
    let far = dvec3(1e6, -2e6, 5e5);
    let still = Course { start: far, rotation: DQuat::IDENTITY, end: far, spin: DVec3::ZERO };
    let [start, end] = [3.0, 1.0].map(|z| far + dvec3(1.0, 0.0, z));
    let falls = Course { start, rotation: DQuat::IDENTITY, end, spin: DVec3::ZERO };
    let mut answer = ask(&Scene { a, b, courses: [still, falls], resolution: None }, 0).expect("an answer");
    let told = *answer.pair.outcome.contact().expect("a contact");
    let point = told.point.expect("a point");
    assert_eq!((point.kind, answer.lies()), (ContactKind::VertexEdge, vec![]), "{point:?}");
    for face in point.faces_a.into_iter().filter(|f| *f != NO_FACE) {
        let wrong = ContactPoint { faces_a: [face, NO_FACE, NO_FACE], kind: ContactKind::VertexFace, ..point };
        answer.pair.outcome.verdict = Verdict::Contact(Contact { point: Some(wrong), ..told });
        assert!(!answer.lies().is_empty(), "{wrong:?}");
    }
}

/// A peg that leans by 1e-8 starts .911 delta deep in the wall at its lower end, as 40 digits say, and ends 1.499 delta
/// deep: that is no miss at this delta. It is one at a smaller delta, of which it ends twice as deep, and at a larger one, in
/// touch with which it does not start.
#[test]
fn the_judge_finds_how_deep_a_leaning_peg_starts() {
    let scene = scene(1, 9, 6879);
    // The resolution of its answer, to which rounding raises its own.
    let delta = 1.766_873e-9;
    for (factor, is_miss) in [(0.7, true), (1.0, false), (1.1, true)] {
        let effort = if is_miss { Effort::Quick } else { Effort::Thorough };
        let found = judge(&scene, &Outcome::clear(factor * delta), effort, || None);
        assert_eq!(found.iter().any(|f| f.kind == "miss"), is_miss, "{factor}: {found:?}");
    }
}

/// A ball that starts off the axis of its hole by a little more than the gap and sinks along it: the depth at the start
/// is half of what the two circles have in common. From one to two resolutions nothing is promised before twice that;
/// if the same ball starts on the axis and moves there, "clear" is a miss.
#[test]
fn the_judge_knows_what_starts_in_touch() {
    let (radius, gap, delta) = (0.75, 6e-8, 2.6e-9);
    let round = |r: f64, h: f64| Node::Leaf(Shape::Round { h, bottom: r, top: r });
    let block = Node::Leaf(Shape::Box { size: dvec3(3.0, 3.0, 3.2) }).at(dvec3(0.0, 0.0, -1.6));
    let a = block.less(round(radius, 4.0));
    let still = Course { start: DVec3::ZERO, rotation: DQuat::IDENTITY, end: DVec3::ZERO, spin: DVec3::ZERO };
    for (depth, is_miss) in [(1.5 * delta, false), (1.9 * delta, false), (2.2 * delta, true)] {
        let off = dvec3(0.6, -0.8, 0.0) * (gap + 2.0 * depth);
        let from = |start: DVec3| {
            let end = off + dvec3(0.0, 0.0, -0.31);
            let moving = Course { start, rotation: DQuat::IDENTITY, end, spin: dvec3(0.0, 0.0, 16.8) };
            let b = Node::Leaf(Shape::Ball { r: radius - gap });
            Scene { a: a.clone(), b, courses: [still, moving], resolution: Some(delta) }
        };
        let starts_in_touch = from(off + dvec3(0.0, 0.0, -0.3));
        let comes_to_touch = from(dvec3(0.0, 0.0, -0.3));
        let answer = ask(&starts_in_touch, 0).expect("an answer");
        let clear = Outcome::clear(delta);
        // What is there is found at once; that nothing is there is said after a long look.
        let misses = |scene: &Scene, is_miss: bool| {
            let effort = if is_miss { Effort::Quick } else { Effort::Thorough };
            let found = judge(scene, &clear, effort, || None);
            found.iter().any(|f| f.kind == "miss")
        };
        assert_eq!(misses(&starts_in_touch, is_miss), is_miss, "depth {depth:e}: {:?}", answer.pair.outcome);
        assert!(misses(&comes_to_touch, true), "depth {depth:e}");
    }
}
