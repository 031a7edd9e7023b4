//! What is told of bodies in holes of several steps in front of the search, and the search without it: the same answers on random
//! bores with countersinks and counterbores, flush or not, some of them askew, and on what is put into them.

use super::cavities::{ask, compare, moving, rest};
use contactd::contact::{Status, Strategies};
use contactd::import::{Facets, Limits, read_model};
use contactd::math::random::Random;
use contactd::octree::Model;
use contactd::solid::primitive::{Capsule, Cone, Cuboid, Cylinder, Sphere};
use contactd::solid::{Label, NodeId, Op, Shape, SolidBuilder};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use contactd_tests::sweep::sized;
use glam::{DQuat, DVec3, dvec3};
use std::f64::consts::PI;

/// True with a probability.
fn often(r: &mut Random, part: f64) -> bool {
    r.within(0.0, 1.0) < part
}

/// A primitive whose z axis points up or down, from `from` on as far as `to` along it; some a little askew.
fn along(b: &mut SolidBuilder, r: &mut Random, x: DVec3, [from, to]: [f64; 2], shape: impl Fn(f64) -> Shape) -> NodeId {
    let (askew, aside) = if often(r, 0.15) { (0.1, 0.02) } else { (0.0, 0.0) };
    let up = if to >= from { DQuat::IDENTITY } else { DQuat::from_rotation_x(PI) };
    let rotation = quat_of_rotation_vector(r.vector(askew)) * up;
    let at = x + r.vector(aside) + DVec3::Z * (0.5 * (from + to));
    b.primitive(shape(0.5 * (to - from).abs()), Pose::new(at, rotation), Label::default())
}

/// The steps of one hole about x, of a plate between −h and h: a bore, through or blind, what it has at either end, and now and then
/// a groove around it, round or of two cones, or a pocket with flat walls.
fn hole(b: &mut SolidBuilder, r: &mut Random, x: DVec3, h: f64) -> Vec<NodeId> {
    let radius = r.within(0.1, 0.25);
    let depth = if often(r, 0.3) { r.within(-0.5, 0.5) * h } else { -h - 0.1 };
    let beyond = r.within(0.0, 1.0) * 0.1 + 0.001;
    let mut steps = vec![along(b, r, x, [depth, h + beyond], |half| Cylinder { radius, half_height: half }.into())];
    for up in [1.0, -1.0] {
        let deep = r.within(0.05, 0.8) * h;
        // Flush with the plate as well as standing out of it.
        let out = if often(r, 0.2) { 0.0 } else { 0.01 };
        let span = [up * (h - deep), up * (h + out)];
        let wide = radius + r.within(0.01, 1.5) * deep;
        let at_floor = if often(r, 0.7) { radius } else { radius * r.within(0.7, 1.2) };
        if often(r, 0.6) {
            let cone = |half| Cone { bottom: at_floor, top: wide.max(at_floor + 0.01), half_height: half }.into();
            steps.push(along(b, r, x, span, cone));
        } else if often(r, 0.5) {
            steps.push(along(b, r, x, span, |half| Cylinder { radius: wide, half_height: half }.into()));
        }
    }
    if often(r, 0.3) {
        let (from, half, wide) = (r.within(-0.7, 0.3) * h, r.within(0.02, 0.2) * h, radius + r.within(0.01, 0.1));
        match r.within(0.0, 3.0) as usize {
            0 => steps.push(along(b, r, x, [from, from + 2.0 * half], |half| {
                Cylinder { radius: wide, half_height: half }.into()
            })),
            1 => {
                let side = |half| Cone { bottom: wide, top: radius, half_height: half }.into();
                steps.extend([from + half, from - half].map(|end| along(b, r, x, [from, end], side)));
            }
            _ => steps
                .push(along(b, r, x, [from, h + 0.01], |half| Cuboid { half: dvec3(wide, 0.9 * radius, half) }.into())),
        }
    }
    steps
}

/// A plate with holes at some places, and half its height.
fn plate(r: &mut Random, places: &[DVec3]) -> (Model, f64) {
    let mut b = SolidBuilder::new();
    let h = r.within(0.05, 0.4);
    let shape: Shape = if often(r, 0.8) {
        Cuboid { half: dvec3(1.2, 0.8, h) }.into()
    } else {
        Cylinder { radius: 1.2, half_height: h }.into()
    };
    let mut whole = b.primitive(shape, Pose::IDENTITY, Label::default());
    let mut all = Vec::new();
    for x in places {
        let steps = hole(&mut b, r, *x, h);
        if often(r, 0.5) {
            all.extend(steps);
        } else {
            let hole = b.operation(Op::Union, &steps);
            whole = b.operation(Op::Difference, &[whole, hole]);
        }
    }
    if !all.is_empty() {
        all.insert(0, whole);
        whole = b.operation(Op::Difference, &all);
    }
    (Model::new(b.finish(whole)), h)
}

/// Pins with and without points and heads, balls and boxes at some places below z = 0.
fn pins(r: &mut Random, places: &[DVec3]) -> Model {
    let mut b = SolidBuilder::new();
    let mut parts = Vec::new();
    for x in places {
        let (radius, length) = (r.within(0.08, 0.24), r.within(0.2, 0.8));
        let below = |from: f64, to: f64| [-from, -to];
        match r.within(0.0, 6.0) as usize {
            0 => parts.push(b.primitive(Sphere { radius }, Pose::at(*x - DVec3::Z * radius), Label::default())),
            1 => parts.push(along(&mut b, r, *x, below(0.0, length), |half| {
                Cuboid { half: dvec3(0.7 * radius, 0.6 * radius, half) }.into()
            })),
            2 => parts.push(along(&mut b, r, *x, below(0.0, length), |half| Capsule { radius, half }.into())),
            3 => parts.push(along(&mut b, r, *x, below(0.0, length), |half| {
                Cone { bottom: radius, top: 0.3 * radius, half_height: half }.into()
            })),
            _ => {
                parts.push(along(&mut b, r, *x, below(0.0, length), |half| {
                    Cylinder { radius, half_height: half }.into()
                }));
                if often(r, 0.7) {
                    let point = r.within(0.02, 0.2);
                    let top = radius * r.within(0.3, 0.95);
                    parts.push(along(&mut b, r, *x, below(length, length + point), |half| {
                        Cone { bottom: radius, top, half_height: half }.into()
                    }));
                }
                if often(r, 0.5) {
                    let (head, from) = (radius + r.within(0.02, 0.15), r.within(0.0, 0.1));
                    parts.push(along(&mut b, r, *x, below(-0.1, from), |half| {
                        Cylinder { radius: head, half_height: half }.into()
                    }));
                }
            }
        }
    }
    let whole = b.operation(Op::Union, &parts);
    Model::new(b.finish(whole))
}

/// Also the long form: `CONTACTD_STEPPED_SCENES=5000 cargo test --release -p contactd-tests --test search stepped:: -- --nocapture`.
#[test]
fn bodies_in_stepped_holes_are_reported_as_the_search_tells_them() {
    let scenes = sized("CONTACTD_STEPPED_SCENES", 60_u64);
    let (mut reported, mut met) = (0, 0);
    for seed in 0..scenes {
        let mut own = Random(0x7374_6570_0000 + seed);
        let places = [dvec3(0.0, 0.0, 0.0), dvec3(0.7, 0.1, 0.0), dvec3(-0.7, -0.2, 0.0)];
        let places = &places[..1 + own.within(0.0, 3.0) as usize];
        let (plate, h) = plate(&mut own, places);
        let pins = pins(&mut own, places);
        let draw = |_: &mut Random| {
            let r = &mut own;
            // From above the plate or within, along the holes or across, straight or turning.
            let aside = |r: &mut Random| if often(r, 0.3) { DVec3::ZERO } else { r.vector(1.0) * r.within(0.0, 0.15) };
            let (from, to) = (r.within(-h, 1.2 + h), r.within(-1.0 - h, 0.5));
            let (at, end) = (aside(r) + DVec3::Z * from, aside(r) + DVec3::Z * to);
            let tilt = if often(r, 0.5) { DVec3::ZERO } else { r.vector(0.1) };
            let turn = if often(r, 0.5) { DVec3::ZERO } else { r.vector(1.0) * r.within(0.0, 0.4) };
            let plate = moving(
                DVec3::ZERO,
                DVec3::ZERO,
                r.vector(0.05),
                if often(r, 0.8) { DVec3::ZERO } else { r.vector(0.2) },
            );
            (plate, moving(at, tilt, end - at, turn))
        };
        let sum = compare(&format!("holes {seed}"), 4, draw, &plate, &pins);
        (reported, met) = (reported + sum.reported as u64, met + sum.met as u64);
    }
    println!("reported: {reported} of {}, {met} with a contact", 4 * scenes);
    assert!(reported * 2 >= scenes && met * 2 >= scenes, "{reported}, {met} of {}", 4 * scenes);
}

#[test]
fn a_cover_over_its_dowels_is_solved_for_where_it_meets_first() {
    let part = |name: &str| {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../server/models").join(name);
        Model::new(read_model(&path, Facets::Auto, &Limits::default()).unwrap_or_else(|e| panic!("{e}")).solid)
    };
    let (base, cover) = (part("base.csg"), part("cover.csg"));
    let mut newton = 0;
    for k in 0..12 {
        // Half a millimetre above the base it comes down and tilts: its flat rim would reach it after most of the step, its bores
        // meet the dowels soon.
        let tilt = DVec3::X.rotate_z(f64::from(k)) * 0.01 + DVec3::Z * 0.004;
        let down = moving(DVec3::Z * 0.55, DVec3::ZERO, DVec3::Z * -0.05, tilt);
        let fronted = ask((&base, rest()), (&cover, down), Strategies::default());
        let alone = ask((&base, rest()), (&cover, down), Strategies { region: false, ..Strategies::default() });
        assert_eq!((fronted.status(), alone.status()), (Status::Contact, Status::Contact), "{k}");
        assert!((fronted.time() - alone.time()).abs() < 1e-9, "{k}: {fronted:?} {alone:?}");
        assert_eq!(fronted.counters.cells, 0, "{k}: {fronted:?}");
        newton += fronted.counters.newton;
    }
    println!("{newton} solutions");
    assert!(newton <= 36, "{newton}");
}
