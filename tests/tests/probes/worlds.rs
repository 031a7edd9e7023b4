//! Points and rays among the bodies of random worlds, and of a session whose bodies have moved.
//!
//! The judge has an f of its own for each body. `CONTACTD_PROBE_WORLDS=500` sets the number of worlds (6 by default).

use super::judge::{Judge, refuted, solid};
use super::rays::drawn;
use contactd::contact::probe::{
    DEFAULT_LIMIT, PointOptions, PosedModel, Ray, RayAnswer, RayOptions, RayOutcome, points,
};
use contactd::ipc::{Embedded, ServerConfig};
use contactd::octree::Model;
use contactd::world::{MeasuredModel, ObjectSpec, World};
use contactd_client::{Object, Session};
use contactd_proto::query::{self, ObjectRay};
use contactd_proto::{ErrorCode, Pose, PoseRecord};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::DVec3;
use std::sync::Arc;

const RAYS: RayOptions = RayOptions { depth: 0.0, limit: DEFAULT_LIMIT };

/// Points and rays asked of a world.
const EACH: usize = 30;

struct Bodies {
    world: World,
    judges: Vec<Judge>,
    models: Vec<(Arc<Model>, Pose)>,
}

impl Bodies {
    fn drawn(r: &mut Random, number: usize) -> Self {
        let mut world = World::new(100, 100);
        let (mut judges, mut models) = (vec![], vec![]);
        for id in 1..=2 + r.below(24) as u32 {
            let tree = solid(r, number + id as usize);
            let (place, pose) = (Pose::new(r.vector(0.5), r.rotation()), Pose::new(r.vector(2.2), r.rotation()));
            let at = pose.compose(&place);
            judges.push(Judge::new(&tree, &at));
            let model = Arc::new(Model::new(tree));
            models.push((model.clone(), at));
            let part = Arc::new(MeasuredModel::new(model));
            world.add_object(ObjectSpec { place, ..ObjectSpec::new(id, &part, pose) }).unwrap();
        }
        Self { world, judges, models }
    }
}

/// What an answer says that is refuted by the bodies' own f, and of the one that is hit that it is.
fn refuted_by_any(body: Option<u32>, answer: &RayAnswer, ray: &Ray, judges: &[Judge]) -> Option<String> {
    let until = match answer.outcome {
        RayOutcome::Hit(hit) => hit.lower,
        RayOutcome::Miss { .. } => ray.length,
        RayOutcome::Undecided { until } => until,
    };
    judges.iter().zip(1..).find_map(|(judge, id)| {
        let f = |x: DVec3| judge.value(x);
        let own = match answer.outcome {
            RayOutcome::Hit(_) if body == Some(id) => return refuted(answer, ray, &f, 300, 1e-10),
            _ => RayOutcome::Miss { is_inside: f(ray.origin) < 0.0 },
        };
        let passes = RayAnswer { outcome: own, cells: 0 };
        let found = refuted(&passes, &Ray { length: until, ..*ray }, &f, 300, 1e-10);
        found.map(|text| format!("body {id}: {text}: {answer:?}"))
    })
}

#[test]
fn first_hits_among_bodies_are_refuted_by_none_of_them() {
    let (mut failures, mut hits, mut all) = (Vec::new(), 0, 0);
    for i in 0..sized("CONTACTD_PROBE_WORLDS", 6usize) {
        let mut r = Random::new(97_000 + i as u64);
        let Bodies { world, judges, .. } = Bodies::drawn(&mut r, i);
        let asked: Vec<Ray> = (0..EACH).map(|_| drawn(&mut r, DVec3::ZERO, 2.5)).collect();
        let some: Vec<u32> = (1..=judges.len() as u32).filter(|id| id % 2 == 1).collect();
        for (k, told) in world.standing().rays(&asked, &RAYS, None).unwrap().iter().enumerate() {
            all += 1;
            hits += usize::from(matches!(told.answer.outcome, RayOutcome::Hit(_)));
            failures.extend(refuted_by_any(told.body, &told.answer, &asked[k], &judges));
        }
        // Of some of them: a body that is not asked is never told, and none is hit earlier than among all.
        let (among, few) = (
            world.standing().rays(&asked, &RAYS, None).unwrap(),
            world.standing().rays(&asked, &RAYS, Some(&some)).unwrap(),
        );
        for (one, other) in among.iter().zip(&few) {
            assert!(other.body.is_none_or(|id| id % 2 == 1), "{i}: {other:?}");
            if one.body.is_some_and(|id| id % 2 == 1) {
                assert_eq!(one.body, other.body, "{i}: {one:?} {other:?}");
            }
        }
    }
    println!("{hits} of {all} rays hit");
    assert!(failures.is_empty(), "{} refuted, such as {:#?}", failures.len(), &failures[..failures.len().min(5)]);
    assert!(3 * hits > all && 10 * hits < 9 * all, "{hits} of {all}");
}

#[test]
fn signed_distances_among_bodies_are_the_least_of_all() {
    let options = PointOptions { surface: 1e-7, tolerance: 1e-6, limit: DEFAULT_LIMIT };
    let mut inside = 0;
    for i in 0..sized("CONTACTD_PROBE_WORLDS", 6usize) {
        let mut r = Random::new(98_000 + i as u64);
        let Bodies { world, judges, models } = Bodies::drawn(&mut r, i);
        let asked: Vec<DVec3> = (0..EACH).map(|_| r.vector(2.5)).collect();
        for (x, told) in asked.iter().zip(world.standing().points(&asked, &options, None).unwrap()) {
            let each =
                models.iter().map(|(model, pose)| points(&PosedModel { model, pose: *pose }, &[*x], &options)[0]);
            let least = each.map(|a| a.upper).fold(f64::INFINITY, f64::min);
            let text = format!("{i} {x}: {least}: {told:?}");
            assert!(told.answer.lower <= least && (told.answer.upper - least).abs() <= 1e-6, "{text}");
            let f = judges.iter().map(|judge| judge.value(*x)).fold(f64::INFINITY, f64::min);
            assert!(f.abs() < 1e-9 || (f < 0.0) == (told.answer.upper < 0.0), "{f}: {text}");
            inside += usize::from(f < 0.0);
            if let Some(id) = told.body.filter(|_| told.answer.upper.is_finite()) {
                let on = judges[id as usize - 1].value(told.answer.nearest);
                assert!(on.abs() < 1e-9, "{on}: {text}");
            }
        }
    }
    println!("{inside} inside");
    assert!(inside > 10, "{inside}");
}

#[test]
fn a_session_is_asked_where_its_bodies_stand_now() {
    let mut session = contactd::embedded(&ServerConfig::default()).unwrap();
    let ball = session.load_model("ball.csg", "sphere(r = 1);").unwrap().id;
    let wall = session.load_model("wall.csg", "cube(size = [1, 40, 40], center = true);").unwrap().id;
    let ball = session.add_object(Object::new("ball", ball)).unwrap();
    let wall = session.add_object(Object::new("wall", wall).at(Pose::at(DVec3::X * 10.5))).unwrap();
    let ray = ObjectRay { origin: [-5.0, 0.0, 0.6], direction: [3.0, 0.0, 0.0], length: 30.0 };
    let first = |session: &mut Session<Embedded>, objects: Option<&[u32]>| -> (Option<u32>, query::RayHit) {
        let told = session.rays(&[ray], &RAYS, objects).unwrap()[0];
        let query::RayOutcome::Hit(hit) = told.outcome else { panic!("{told:?}") };
        (told.object, hit)
    };
    let (body, hit) = first(&mut session, None);
    assert!(
        body == Some(ball)
            && (hit.t - 4.2).abs() < 1e-12
            && DVec3::from_array(hit.normal).distance(DVec3::from_array(hit.point)) < 1e-12,
        "{hit:?}"
    );
    assert_eq!(first(&mut session, Some(&[wall])).0, Some(wall));
    let d = session.distance(ball, wall, 1e-9).unwrap();
    assert!(d.lower <= 9.0 && 9.0 <= d.upper + 1e-13 && d.upper - d.lower < 1e-9, "{d:?}");
    // It moves: the same questions, other answers.
    session.begin_step(1).unwrap()[0] = PoseRecord::end(ball, &Pose::at(DVec3::new(4.0, 0.0, 2.0)));
    session.finish(std::time::Duration::from_secs(5)).unwrap();
    let (body, hit) = first(&mut session, None);
    assert!(body == Some(wall) && (hit.t - 15.0).abs() < 1e-12, "{body:?} {hit:?}");
    let d = session.distance(ball, wall, 1e-9).unwrap();
    assert!((d.upper - 5.0).abs() < 1e-9, "{d:?}");
    let options = PointOptions { surface: 1e-9, tolerance: 1e-9, limit: DEFAULT_LIMIT };
    let told = session.points(&[[4.0, 0.0, 2.5], [9.0, 0.0, -3.0]], &options, None).unwrap();
    assert!(told[0].object == Some(ball) && (told[0].upper + 0.5).abs() < 1e-9, "{told:?}");
    assert!(told[1].object == Some(wall) && (told[1].upper - 1.0).abs() < 1e-9, "{told:?}");
    // What makes no sense is refused, with its place.
    let nowhere = ObjectRay { direction: [0.0; 3], ..ray };
    let refusal = session.rays(&[ray, nowhere], &RAYS, None).unwrap_err();
    assert_eq!(
        refusal.to_string(),
        "index 1: an option of the request is out of its range: a ray cannot go along [0, 0, 0]"
    );
    assert_eq!(session.distance(ball, 77, 1e-9).unwrap_err().code(), Some(ErrorCode::UnknownObject));
    assert_eq!(session.points(&[[0.0, f64::NAN, 0.0]], &options, None).unwrap_err().code(), Some(ErrorCode::NotFinite));
    assert_eq!(session.distance(ball, wall, -1.0).unwrap_err().code(), Some(ErrorCode::BadNumber));
}
