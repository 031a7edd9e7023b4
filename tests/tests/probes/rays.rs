//! Rays against random trees of all kinds of faces: no place of a ray refutes what is told of it.
//!
//! The judge has its own f (`reference::field`), and of meshes the solid angle beside it. `CONTACTD_PROBE_RAYS=10000` sets the number of
//! rays (700 by default).

use super::judge::{Judge, refuted, solid};
use contactd::contact::probe::{DEFAULT_LIMIT, PosedModel, Ray, RayOptions, RayOutcome, rays};
use contactd::octree::Model;
use contactd_proto::Pose;
use contactd_tests::meshes;
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::DVec3;

/// Rays against one solid.
const EACH: usize = 20;
/// Places looked at along a ray.
const PLACES: usize = 400;

/// A ray from somewhere around a ball about a centre, through it or past it.
pub fn drawn(r: &mut Random, center: DVec3, size: f64) -> Ray {
    let origin = center + r.direction() * size * r.within(0.0, 2.5);
    let towards = center + r.direction() * size * r.within(0.0, 1.2);
    let direction = (towards - origin).try_normalize().unwrap_or(DVec3::X);
    // Along an axis now and then, as programs ask.
    let direction = if r.chance(0.1) { DVec3::AXES[r.below(3)] } else { direction };
    Ray { origin, direction, length: size * r.within(0.2, 6.0) }
}

#[test]
fn no_place_of_a_ray_refutes_its_answer() {
    let count = sized("CONTACTD_PROBE_RAYS", 700usize);
    let (mut failures, mut told, mut cells, mut most) = (Vec::new(), [0usize; 4], 0, 0);
    for i in 0..count.div_ceil(EACH) {
        let mut r = Random::new(91_000 + i as u64);
        let tree = solid(&mut r, i);
        let pose = Pose::new(r.vector(2.0), r.rotation());
        let judge = Judge::new(&tree, &pose);
        let aabb = tree.aabb();
        let (center, size) = (pose.point(aabb.center()), aabb.half().length());
        let asked: Vec<Ray> = (0..EACH).map(|_| drawn(&mut r, center, size)).collect();
        let model = Model::new(tree);
        let options = RayOptions { depth: 0.0, limit: DEFAULT_LIMIT };
        for (k, answer) in rays(&PosedModel { model: &model, pose }, &asked, &options).iter().enumerate() {
            told[match answer.outcome {
                RayOutcome::Hit(hit) if hit.is_leaving => 1,
                RayOutcome::Hit(_) => 0,
                RayOutcome::Miss { .. } => 2,
                RayOutcome::Undecided { .. } => 3,
            }] += 1;
            (cells, most) = (cells + answer.cells, most.max(answer.cells));
            let found = refuted(answer, &asked[k], &|x| judge.value(x), PLACES, 1e-10);
            failures.extend(found.map(|text| format!("solid {i}, ray {k}: {text}")));
        }
    }
    let all = told.iter().sum::<usize>();
    println!(
        "{all} rays: hit, leaving, missed, undecided {told:?}; {} cells on average, {most} at most",
        cells / all as u64
    );
    assert!(failures.is_empty(), "{} refuted, such as {:#?}", failures.len(), &failures[..failures.len().min(5)]);
    assert!(told[3] == 0 && 4 * told[0] > all && 20 * told[1] > all && 8 * told[2] > all, "{told:?}");
}

/// Of meshes, small and divided: by how often they wind around the points of a ray.
#[test]
fn rays_against_meshes_agree_with_solid_angles() {
    let (mut hits, mut failures) = (0, Vec::new());
    for i in 0..sized("CONTACTD_PROBE_MESHES", 12usize) {
        let mut r = Random::new(92_000 + i as u64);
        let mesh = meshes::random(&mut r, 1.0);
        let shape = if i % 2 == 0 { meshes::solid(&mesh) } else { meshes::divided(&mesh) };
        let mut b = contactd::solid::SolidBuilder::new();
        let root = b.primitive(shape, Pose::IDENTITY, contactd::solid::Label::default());
        let model = Model::new(b.finish(root));
        let pose = Pose::new(r.vector(2.0), r.rotation());
        let asked: Vec<Ray> = (0..EACH).map(|_| drawn(&mut r, pose.position, 1.0)).collect();
        let options = RayOptions { depth: 0.0, limit: DEFAULT_LIMIT };
        // As far from the mesh as the sign of its winding tells, to what single precision may have bent.
        let f = |x: DVec3| {
            let x = pose.inverse().point(x);
            meshes::distance(&mesh, x) * if meshes::winding(&mesh, x).abs() > 0.5 { -1.0 } else { 1.0 }
        };
        for (k, answer) in rays(&PosedModel { model: &model, pose }, &asked, &options).iter().enumerate() {
            hits += usize::from(matches!(answer.outcome, RayOutcome::Hit(_)));
            let found = refuted(answer, &asked[k], &f, 60, 1e-5);
            failures.extend(found.map(|text| format!("mesh {i}, ray {k}: {text}")));
        }
    }
    println!("{hits} hits");
    assert!(failures.is_empty(), "{} refuted, such as {:#?}", failures.len(), &failures[..failures.len().min(5)]);
    assert!(hits > 100, "{hits}");
}
