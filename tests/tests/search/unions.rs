//! What is told of unions of convex parts in front of the search, and the search without it: the same answers on random unions, some
//! of them less what is no union of convex parts itself.

use super::cavities::{compare, moving, rest};
use contactd::math::random::Random;
use contactd::octree::Model;
use contactd::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, Polyhedron, Sphere};
use contactd::solid::{Label, NodeId, Op, Shape, SolidBuilder};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_tests::sweep::sized;
use glam::{DVec3, dvec3};

fn shape(r: &mut Random) -> Shape {
    let size = r.within(0.15, 0.5);
    match r.within(0.0, 6.0) as usize {
        0 => Cuboid { half: dvec3(size, r.within(0.1, 0.6), r.within(0.1, 0.6)) }.into(),
        1 => Cylinder { radius: size, half_height: r.within(0.1, 0.6) }.into(),
        2 => Cone { bottom: size, top: size * r.within(0.2, 0.9), half_height: r.within(0.2, 0.5) }.into(),
        3 => Capsule { radius: 0.5 * size, half: r.within(0.1, 0.6) }.into(),
        4 => {
            let corners = 4 + r.within(0.0, 8.0) as usize;
            let corners = (0..corners).map(|_| r.vector(1.0).normalize() * size).collect();
            Polyhedron::hull(corners).map_or(Sphere { radius: size }.into(), Shape::from)
        }
        _ => Sphere { radius: size }.into(),
    }
}

fn leaf(b: &mut SolidBuilder, r: &mut Random, reach: f64) -> NodeId {
    // Half of them along the axes, where faces of parts lie on each other.
    let turn = if r.within(0.0, 1.0) < 0.5 { DVec3::ZERO } else { r.vector(2.0) };
    let pose = Pose::new(r.vector(reach), quat_of_rotation_vector(turn));
    let shape = shape(r);
    b.primitive(shape, pose, Label::default())
}

/// A union of convex parts; of some a difference is taken away, or a union of which one operand is none.
fn union(r: &mut Random) -> Model {
    let mut b = SolidBuilder::new();
    let parts: Vec<NodeId> = (0..2 + r.within(0.0, 6.0) as usize).map(|_| leaf(&mut b, r, 1.0)).collect();
    let mut whole = b.operation(Op::Union, &parts);
    if r.within(0.0, 1.0) < 0.5 {
        let pair = [leaf(&mut b, r, 1.0), leaf(&mut b, r, 1.0)];
        let mut cut = b.operation(Op::Difference, &pair);
        if r.within(0.0, 1.0) < 0.5 {
            let other = leaf(&mut b, r, 1.0);
            cut = b.operation(Op::Union, &[cut, other]);
        }
        whole = b.operation(Op::Difference, &[whole, cut]);
    }
    Model::new(b.finish(whole))
}

/// Also the long form: `CONTACTD_UNION_SCENES=5000 cargo test --release -p contactd-tests --test search unions:: -- --nocapture`.
#[test]
fn unions_are_reported_as_the_search_tells_them() {
    let unions = sized("CONTACTD_UNION_SCENES", 60_u64);
    let (mut reported, mut met) = (0, 0);
    for seed in 0..unions {
        let mut own = Random(0x756e_6900 + seed);
        let [a, b] = [union(&mut own), union(&mut own)];
        let draw = |_: &mut Random| {
            let r = &mut own;
            // From beside it on to somewhere near its middle, or past it.
            let way = r.vector(1.0).normalize();
            let from = way * r.within(1.5, 3.5);
            let to = r.vector(1.0) - way * r.within(0.0, 2.0);
            let most = r.within(0.0, 2.0);
            let turn = if r.within(0.0, 1.0) < 0.3 { DVec3::ZERO } else { r.vector(1.0) * most };
            (rest(), moving(from, r.vector(1.5), to - from, turn))
        };
        let sum = compare(&format!("union {seed}"), 4, draw, &a, &b);
        (reported, met) = (reported + sum.reported as u64, met + sum.met as u64);
    }
    println!("reported: {reported} of {}, {met} with a contact", 4 * unions);
    assert!(reported * 10 >= 28 * unions && met >= 2 * unions, "{reported}, {met} of {}", 4 * unions);
}
