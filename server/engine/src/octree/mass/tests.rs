//! One face in a box is off by its bound at most; a model that is moved has its mass properties moved along.

use super::mass_properties;
use super::voxel::Evaluator;
use crate::math::Aabb;
use crate::math::moments::Moments;
use crate::math::random::Random;
use crate::octree::Model;
use crate::solid::local::{LiteralId, Token, literal_token};
use crate::solid::primitive::{Cone, Cuboid, Cylinder, Sphere};
use crate::solid::{Face, Label, Op, Sense, Shape, SolidBuilder, surface};
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_proto::{MassOptions, MassProperties, Pose};
use glam::DVec3;
use proptest::prelude::*;

/// The sum over the 8^levels boxes of a subdivision: moments about `origin`, and their error.
fn fine(evaluator: &mut Evaluator<'_>, region: Aabb, tokens: &[Token], levels: u32, origin: DVec3) -> (Moments, f64) {
    let voxel = evaluator.voxel(region, tokens);
    if levels == 0 || voxel.tokens.is_empty() {
        return (voxel.moments.moved(region.center() - origin), voxel.error);
    }
    let (mut sum, mut error) = (Moments::default(), 0.0);
    for corner in region.corners() {
        let part = Aabb::of_points([corner, region.center()]);
        let (moments, e) = fine(evaluator, part, &voxel.tokens, levels - 1, origin);
        sum.add(&moments);
        error += e;
    }
    (sum, error)
}

#[test]
fn one_face_in_a_box_is_off_by_its_bound_at_most() {
    let mut r = Random(31);
    let (mut curved, mut closest) = (0, 0.0f64);
    for i in 0..1500 {
        let n = r.vector(1.0).normalize();
        let face = match i % 3 {
            0 => Face::from(surface::Sphere { center: DVec3::ZERO, radius: 1.0 }),
            1 => surface::Cylinder { origin: DVec3::ZERO, axis: n, radius: 1.0 }.into(),
            _ => surface::Cone { apex: n * -1.5, axis: n, sin: 0.6, cos: 0.8 }.into(),
        };
        let size = [0.05, 0.2, 0.5][i / 3 % 3];
        let half = r.vector(size).abs() + DVec3::splat(0.1 * size);
        // Around a point of the face, or nearly.
        let at = r.vector(1.0).normalize() * r.within(0.3, 1.5);
        let region = Aabb::around(at - face.at(at).normal * face.value(at), half);
        let sense = if i % 2 == 0 { Sense::Positive } else { Sense::Negative };
        let tokens = [literal_token(LiteralId::new(0, sense))];
        let mut cube = SolidBuilder::new();
        let node = cube.primitive(Cuboid { half: DVec3::ONE }, Pose::IDENTITY, Label::default());
        let mut solid = cube.finish(node);
        solid.faces = vec![face].into();
        let mut evaluator = Evaluator::new(&solid);
        let whole = evaluator.voxel(region, &tokens);
        let (sum, rest) = fine(&mut evaluator, region, &tokens, 3, region.center());
        let off = (whole.moments.volume() - sum.volume()).abs();
        assert!(off <= whole.error + rest, "{face:?} {region:?} {sense:?}: {off} {} {rest}", whole.error);
        for k in 1..4 {
            let off = (whole.moments.0[k] - sum.0[k]).abs();
            assert!(off <= (whole.spread + rest) * half[k - 1], "{face:?} {region:?}: {k}");
        }
        if whole.error > 1e-9 * Moments::of_box(half).volume() && rest < 0.1 * whole.error {
            curved += 1;
            closest = closest.max(off / whole.error);
        }
    }
    println!("{curved} boxes; the largest error is {closest:.2} of its bound");
    assert!(curved > 300 && closest > 0.1, "{curved} {closest}");
}

fn vector(size: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-size..size).prop_map(DVec3::from_array)
}

fn pose(size: f64) -> impl Strategy<Value = Pose> {
    (vector(size), vector(1.8)).prop_map(|(at, spin)| Pose::new(at, quat_of_rotation_vector(spin)))
}

fn shape() -> impl Strategy<Value = Shape> {
    let size = || 0.3..1.2f64;
    prop_oneof![
        size().prop_map(|radius| Sphere { radius }.into()),
        (size(), size()).prop_map(|(radius, half_height)| Cylinder { radius, half_height }.into()),
        (size(), 0.0..0.25f64, size()).prop_map(|(bottom, top, half_height)| Cone { bottom, top, half_height }.into()),
        (size(), size(), size()).prop_map(|(x, y, z)| Cuboid { half: DVec3::new(x, y, z) }.into()),
    ]
}

/// The tree of some primitives, all of them moved.
fn moved(op: Op, parts: &[(Shape, Pose)], by: &Pose) -> MassProperties {
    let mut b = SolidBuilder::new();
    let leaves: Vec<_> = parts.iter().map(|(s, at)| b.primitive(s.clone(), by.compose(at), Label::default())).collect();
    let root = b.operation(op, &leaves);
    let options = MassOptions { tolerance: 2e-3, boxes: 20_000 };
    mass_properties(&Model::new(b.finish(root)), &options).expect("a bounded solid")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn centre_and_inertia_move_with_the_model(
        parts in prop::collection::vec((shape(), pose(0.6)), 1..4),
        op in prop::sample::select(vec![Op::Union, Op::Difference, Op::Intersection]),
        by in pose(5.0),
    ) {
        let (here, there) = (moved(op, &parts, &Pose::IDENTITY), moved(op, &parts, &by));
        let seen = here.placed(&by);
        prop_assert!((seen.volume - there.volume).abs() <= seen.volume_error + there.volume_error);
        if here.volume == 0.0 || there.volume == 0.0 {
            return Ok(());
        }
        let off = (seen.center - there.center).abs();
        prop_assert!(off.cmple(seen.center_error + there.center_error).all(), "{:?}\n{:?}", seen, there);
        for k in 0..6 {
            let bound = seen.inertia_error[k] + there.inertia_error[k];
            prop_assert!((seen.inertia[k] - there.inertia[k]).abs() <= bound, "{}: {:?}\n{:?}", k, seen, there);
        }
        // The bounds say something: most of these solids are known to a few thousandths.
        prop_assert!(here.boxes >= 19_990 || here.volume_error <= 2e-3 * here.volume);
    }
}
