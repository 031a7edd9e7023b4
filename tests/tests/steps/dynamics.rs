//! Laws of motion, held by the reference loop on the embedded engine.

use contactd::ipc::Embedded;
use contactd_client::dynamics::{Body, Damping, Effects, Inertia, Penalty, Rest, Restitution, Settings, Sleep, World};
use contactd_client::{MassOptions, Object};
use contactd_proto::Pose;
use contactd_proto::motion::quat_of_rotation_vector;
use glam::{DVec3, dvec3};

const G: f64 = 9.81;
const DOWN: DVec3 = DVec3::new(0.0, 0.0, -G);

fn world(settings: Settings) -> World<Embedded> {
    let session = contactd::embedded(&contactd::ipc::ServerConfig::default()).expect("a session");
    World::new(session, settings).expect("a world")
}

fn model(world: &mut World<Embedded>, text: &str) -> u32 {
    world.session().load_model("model.csg", text).expect("a model").id
}

fn cuboid(size: DVec3) -> String {
    format!("cube(size = [{}, {}, {}], center = true);", size.x, size.y, size.z)
}

/// Settings with the effects of an ordinary scene.
fn ordinary(dt: f64) -> Settings {
    Settings { effects: Effects::on_the_ground(DOWN), ..Settings::new(dt, 1.0) }
}

/// A block with a hole beside its middle, as the engine weighs it: the same as by hand, and it stands on a post under its
/// centre of mass, which is where it would tip over if the centre were that of the block.
#[test]
fn a_drilled_part_has_the_mass_that_its_model_has() {
    let text = "difference() { cube(size = [4, 2, 1], center = true);
        multmatrix([[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) { cylinder(h = 2, r1 = 0.75, r2 = 0.75, center = true); } }";
    let mut s = ordinary(1.0 / 120.0);
    s.effects.sleep = None;
    let mut w = world(s);
    let part = model(&mut w, text);
    let properties = w.session().mass_properties(part, &MassOptions::default()).unwrap().with_density(2.0);
    let (inertia, place) = Inertia::of_model(&properties);
    let hole = std::f64::consts::PI * 0.75 * 0.75;
    let center = -hole / (8.0 - hole);
    let (mass_off, center_off) = (inertia.mass - 2.0 * (8.0 - hole), place.position.x + center);
    assert!(mass_off.abs() <= 2.0 * properties.volume_error && center_off.abs() <= properties.center_error.x);
    assert!(properties.volume_error < 1e-5 && properties.center_error.x < 1e-4, "{properties:?}");
    let (block, plug) = (Inertia::cuboid(16.0, dvec3(4.0, 2.0, 1.0)), Inertia::cylinder(2.0 * hole, 0.75, 1.0));
    let (again, at) = inertia.and(dvec3(center, 0.0, 0.0), &plug, DVec3::X);
    let off = (again.tensor - block.tensor).to_cols_array().iter().fold(0.0f64, |m, x| m.max(x.abs()));
    assert!(at.length() < 1e-5 && off < 1e-4, "hole and part are the block: off by {off}");
    // A post of half a unit, wholly on one side of the block's middle.
    let post = model(&mut w, &cuboid(dvec3(0.5, 1.0, 2.0)));
    w.add(Body::fixed(Object::new("post", post)).at(Pose::at(dvec3(center, 0.0, -1.0)))).unwrap();
    let part = Body::new(Object::new("part", part).place(place), inertia).friction(0.5);
    let part = w.add(part.at(Pose::at(dvec3(center, 0.0, 0.5 + 1e-6)))).unwrap();
    for _ in 0..240 {
        w.frame().unwrap();
    }
    let state = w.state(part);
    assert!((state.pose.position - dvec3(center, 0.0, 0.5)).length() < 1e-5, "{state:?}");
    assert!(center < -0.25, "the block's middle is off the post: {center}");
}

#[test]
fn an_elastic_bounce_returns_to_its_height() {
    let mut s = Settings::new(1.0 / 240.0, 1.0);
    s.effects.gravity = Some(DOWN);
    s.effects.restitution = Some(Restitution { threshold: 1e-3 });
    let mut w = world(s);
    let floor = model(&mut w, &cuboid(dvec3(4.0, 4.0, 1.0)));
    let ball = model(&mut w, "sphere(r = 0.5);");
    w.add(Body::fixed(Object::new("floor", floor)).at(Pose::at(dvec3(0.0, 0.0, -0.5)))).unwrap();
    let ball = Body::new(Object::new("ball", ball), Inertia::sphere(2.0, 0.5)).restitution(1.0);
    let ball = w.add(ball.at(Pose::at(dvec3(0.1, 0.2, 1.5)))).unwrap();
    let before = w.energy().total();
    let (mut bounces, mut was) = (0, 0.0f64);
    for _ in 0..240 * 6 {
        w.frame().unwrap();
        let state = w.state(ball);
        let height = state.pose.position.z + state.velocity.z * state.velocity.z / (2.0 * G);
        assert!((height - 1.5).abs() < 1e-9, "returns to {height}");
        bounces += u32::from(was < 0.0 && state.velocity.z > 0.0);
        was = state.velocity.z;
    }
    let energy = w.energy().total();
    println!("{bounces} bounces, energy {:e}, {:?}", energy / before - 1.0, w.total());
    // One each 2 √(2h/g), the first after half of that.
    assert_eq!(bounces, 7);
    assert!((energy / before - 1.0).abs() < 1e-9);
}

#[test]
fn ten_boxes_stand_for_ten_seconds() {
    let mut w = world(ordinary(1.0 / 120.0));
    let floor = model(&mut w, &cuboid(dvec3(8.0, 8.0, 1.0)));
    let cube = model(&mut w, &cuboid(DVec3::ONE));
    w.add(Body::fixed(Object::new("floor", floor)).at(Pose::at(dvec3(0.0, 0.0, -0.5)))).unwrap();
    let at = |i: usize| dvec3(0.03 * (i % 3) as f64, -0.02 * (i % 2) as f64, 0.5 + i as f64);
    let ids: Vec<usize> = (0..10)
        .map(|i| {
            let object = Object::new(&format!("box {i}"), cube);
            w.add(Body::new(object, Inertia::cuboid(1.0, DVec3::ONE)).at(Pose::at(at(i)))).unwrap()
        })
        .collect();
    let mut asleep_from = None;
    for k in 0..1200 {
        let f = w.frame().unwrap();
        if f.counters.sleep == 10 {
            asleep_from.get_or_insert(k);
        }
    }
    println!("{:?}", w.total());
    // Awake for 60 frames: ten bodies, four points each; then all of them asleep.
    let c = w.total().counters;
    assert_eq!((c.gravity, c.friction, c.rest, c.sleep), (600, 2400, 600, 11_400));
    assert_eq!((c.restitution, c.damping, c.penalty), (0, 0, 0));
    assert_eq!((asleep_from, w.total().looks, w.total().proposals), (Some(60), 1, 0));
    for (i, id) in ids.iter().enumerate() {
        let off = w.pose(*id).position.distance(at(i));
        assert!(off < 1e-6 && w.state(*id).asleep);
    }
}

/// A block of 1 x 1 x 0.5 on a plane that leans by `angle`; frames until it moved, and how far it went down.
fn slope(angle: f64, mu: f64, seconds: f64) -> (f64, f64, contactd_client::dynamics::Frame) {
    let mut w = world(ordinary(1.0 / 120.0));
    let plane = model(&mut w, &cuboid(dvec3(20.0, 8.0, 1.0)));
    let block = model(&mut w, &cuboid(dvec3(1.0, 1.0, 0.5)));
    let lean = quat_of_rotation_vector(DVec3::Y * angle);
    let at = |h: f64| Pose::new(lean * dvec3(0.0, 0.0, h), lean);
    w.add(Body::fixed(Object::new("plane", plane)).at(at(-0.5)).friction(mu)).unwrap();
    let body = Body::new(Object::new("block", block), Inertia::cuboid(3.0, dvec3(1.0, 1.0, 0.5)));
    let block = w.add(body.at(at(0.25)).friction(mu)).unwrap();
    let total = w.run(seconds).unwrap();
    let gone = w.pose(block).position - at(0.25).position;
    (gone.dot(lean * DVec3::X), w.state(block).velocity.length(), total)
}

#[test]
fn a_block_on_a_slope_sticks_or_slides() {
    let mu = 0.4f64;
    let t = 1.0;
    for (angle, slides) in [(0.99 * mu.atan(), false), (1.01 * mu.atan(), true), (0.7, true)] {
        let (gone, speed, total) = slope(angle, mu, t);
        let a = G * (angle.sin() - mu * angle.cos());
        println!("{angle}: {gone:e} m, {speed} m/s, expected {} m; {total:?}", 0.5 * a * t * t);
        if slides {
            assert!((gone / (0.5 * a * t * t) - 1.0).abs() < 1e-6 && (speed / (a * t) - 1.0).abs() < 1e-6);
        } else {
            assert!(gone.abs() < 1e-9 && speed == 0.0);
        }
    }
}

/// A random unit number from a counter: no two runs differ.
fn noise(k: u64) -> f64 {
    let mut v = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x2545_F491_4F6C_DD1D;
    v = (v ^ (v >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    v = (v ^ (v >> 32)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((v ^ (v >> 29)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn noises(k: u64) -> DVec3 {
    dvec3(noise(3 * k), noise(3 * k + 1), noise(3 * k + 2))
}

/// Bodies of several shapes that fly at each other in free space; energy and momenta after each frame, and the impacts.
fn shower(
    restitution: f64,
    friction: bool,
) -> (Vec<contactd_client::dynamics::Energy>, contactd_client::dynamics::Frame) {
    let mut s = Settings::new(1.0 / 120.0, 1.0);
    s.effects.restitution = Some(Restitution { threshold: 0.02 });
    s.effects.friction = friction;
    let mut w = world(s);
    let size = dvec3(0.5, 0.7, 0.9);
    let boxes = model(&mut w, &cuboid(size));
    let ball = model(&mut w, "sphere(r = 0.4);");
    let rod = model(&mut w, "cylinder(h = 1.2, r1 = 0.25, r2 = 0.25, center = true);");
    for i in 0..12u64 {
        let place = noises(i).normalize() * (2.0 + 0.25 * i as f64);
        let turn = quat_of_rotation_vector(noises(100 + i) * 2.0);
        let (text, inertia) = match i % 3 {
            0 => (boxes, Inertia::cuboid(1.0 + i as f64, size)),
            1 => (ball, Inertia::sphere(2.0, 0.4)),
            _ => (rod, Inertia::cylinder(1.5, 0.25, 1.2)),
        };
        let body = Body::new(Object::new(&format!("body {i}"), text), inertia).restitution(restitution);
        let body = body.at(Pose::new(place, turn)).moving(-place * 0.8 + noises(200 + i) * 0.3, noises(300 + i) * 2.0);
        w.add(body).unwrap();
    }
    let mut out = vec![w.energy()];
    for _ in 0..240 {
        w.frame().unwrap();
        out.push(w.energy());
    }
    println!("{:?}", w.total());
    (out, *w.total())
}

#[test]
fn free_bodies_keep_momentum_and_elastic_ones_energy() {
    for (e, friction) in [(1.0, false), (0.5, true)] {
        let (sums, total) = shower(e, friction);
        let first = sums[0];
        // What momenta are compared with: the sums of their parts' lengths have this order.
        let size = (2.0 * first.kinetic * 50.0).sqrt();
        let mut drift = [0.0f64; 4];
        for pair in sums.windows(2) {
            let now = pair[1];
            drift[0] = drift[0].max(now.linear.distance(first.linear) / size);
            drift[1] = drift[1].max(now.angular.distance(first.angular) / size);
            drift[2] = drift[2].max((now.kinetic / first.kinetic - 1.0).abs());
            drift[3] = drift[3].max(now.kinetic / pair[0].kinetic - 1.0);
        }
        println!("e {e}, friction {friction}: {drift:?}, {} impacts", total.impacts);
        assert!(total.impacts > 10);
        assert!(drift[0] < 1e-12 && drift[1] < 1e-12);
        if e == 1.0 {
            assert!(drift[2] < 1e-9);
        }
        assert!(drift[3] < 1e-9, "energy grew");
    }
}

#[test]
fn a_ball_rolls_out_through_a_real_hole() {
    let mut w = world(ordinary(1.0 / 120.0));
    let plate = model(
        &mut w,
        "difference() { cube(size = [8, 4, 0.5], center = true); multmatrix([[1, 0, 0, 1.5], [0, 1, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1]]) { cylinder(h = 2, r1 = 0.65, r2 = 0.65, center = true); } }",
    );
    let ball = model(&mut w, "sphere(r = 0.5);");
    w.add(Body::fixed(Object::new("plate", plate)).at(Pose::at(dvec3(0.0, 0.0, -0.25)))).unwrap();
    let body = Body::new(Object::new("ball", ball), Inertia::sphere(1.0, 0.5));
    let ball = w.add(body.at(Pose::at(dvec3(-1.5, 0.0, 0.5))).moving(DVec3::X * 0.8, DVec3::Y * 1.6)).unwrap();
    let mut through = None;
    for k in 0..120 * 6 {
        let f = w.frame().unwrap();
        let p = w.pose(ball).position;
        assert_eq!(f.left_over, 0.0);
        // Above the plate, or with its centre within the hole, or below.
        assert!(p.z > 0.5 - 1e-6 || dvec3(p.x - 1.5, p.y - 0.1, 0.0).length() < 0.65 || p.z < -1.0 + 1e-6);
        if p.z < -1.0 && through.is_none() {
            through = Some((k, p));
        }
    }
    println!("{through:?} {:?}", w.total());
    let (_, p) = through.expect("it falls");
    assert!(dvec3(p.x - 1.5, p.y - 0.1, 0.0).length() < 0.3);
    assert_eq!(w.total().left_over, 0.0);
}

#[test]
fn a_peg_rests_on_its_shoulder() {
    let mut s = ordinary(1.0 / 240.0);
    s.effects.damping = Some(Damping { linear: 0.5, angular: 8.0 });
    let mut w = world(s);
    let plate = model(
        &mut w,
        "difference() { cube(size = [4, 4, 1], center = true); cylinder(h = 4, r1 = 0.52, r2 = 0.52, center = true); }",
    );
    // The shaft's and the head's centres lie at 0 and 0.95 of the model.
    let (shaft, head) = (Inertia::cylinder(4.0, 0.5, 1.5), Inertia::cylinder(3.0, 0.8, 0.4));
    let (whole, centre) = shaft.and(DVec3::ZERO, &head, DVec3::Z * 0.95);
    let peg = model(
        &mut w,
        "union() { cylinder(h = 1.5, r1 = 0.5, r2 = 0.5, center = true); multmatrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.95], [0, 0, 0, 1]]) { cylinder(h = 0.4, r1 = 0.8, r2 = 0.8, center = true); } }",
    );
    w.add(Body::fixed(Object::new("plate", plate)).at(Pose::at(dvec3(0.0, 0.0, -0.5)))).unwrap();
    let object = Object::new("peg", peg).place(Pose::at(-centre));
    let lean = quat_of_rotation_vector(dvec3(0.004, 0.002, 0.0));
    let start = Pose::new(dvec3(0.003, -0.002, 0.9 + centre.z), lean);
    let peg = w.add(Body::new(object, whole).friction(0.3).at(start)).unwrap();
    for _ in 0..240 * 4 {
        w.frame().unwrap();
    }
    println!("{:?} {:?}", w.total(), w.state(peg));
    // The shoulder is 0.75 above the shaft's centre and lies on z = 0.
    let z = w.pose(peg).position.z - (centre.z - 0.75);
    println!("height {z:e}");
    assert!(z.abs() < 1e-6 && w.state(peg).asleep);
    assert_eq!(w.total().left_over, 0.0);
}

/// A block that falls onto a slope, bounces, slides and meets a second one; all bits of where the two end.
fn tumble(effects: Effects, friction: f64, restitution: f64) -> ([u64; 26], contactd_client::dynamics::Frame) {
    let mut s = Settings::new(1.0 / 120.0, 1.0);
    s.effects = effects;
    let mut w = world(s);
    let plane = model(&mut w, &cuboid(dvec3(20.0, 8.0, 1.0)));
    let block = model(&mut w, &cuboid(dvec3(1.0, 1.0, 0.5)));
    let lean = quat_of_rotation_vector(DVec3::Y * 0.3);
    let at = |x: f64, h: f64| Pose::new(lean * dvec3(x, 0.0, h), lean);
    w.add(Body::fixed(Object::new("plane", plane)).at(at(0.0, -0.5)).friction(friction)).unwrap();
    let inertia = Inertia::cuboid(3.0, dvec3(1.0, 1.0, 0.5));
    let ids = [at(-1.0, 0.35), at(0.75, 0.25)].map(|pose| {
        let body = Body::new(Object::new("block", block), inertia).friction(friction).restitution(restitution);
        w.add(body.at(pose).moving(lean * DVec3::X * 0.5, DVec3::ZERO)).unwrap()
    });
    let total = w.run(0.4).unwrap();
    let mut bits = [0; 26];
    for (k, id) in ids.into_iter().enumerate() {
        let s = w.state(id);
        let parts = [s.pose.position, s.velocity, s.momentum].map(|v| v.to_array()).concat();
        for (i, v) in parts.iter().chain(&s.pose.rotation.to_array()).enumerate() {
            bits[13 * k + i] = v.to_bits();
        }
    }
    (bits, total)
}

#[test]
fn a_switch_that_is_off_has_the_bits_of_an_effect_that_vanishes() {
    let all = Effects {
        gravity: Some(DOWN),
        restitution: Some(Restitution { threshold: 0.1 }),
        friction: true,
        damping: Some(Damping { linear: 0.1, angular: 0.2 }),
        rest: Some(Rest { speed: 1e-7 }),
        sleep: Some(Sleep { speed: 1e-3, frames: 30 }),
        penalty: Some(Penalty { stiffness: 1e4, damping: 10.0, instead_of_impulses: false }),
    };
    let (bits, total) = tumble(all, 0.2, 0.4);
    assert_eq!((bits, total), tumble(all, 0.2, 0.4), "two runs differ");
    let c = total.counters;
    assert!(c.gravity > 0 && c.restitution > 0 && c.friction > 0 && c.damping > 0, "{c:?}");
    let none = Damping { linear: 0.0, angular: 0.0 };
    let never = Sleep { speed: 0.0, frames: u32::MAX };
    let weak = Penalty { stiffness: 0.0, damping: 0.0, instead_of_impulses: false };
    // The effect off, the same on but without effect, friction and restitution of both, and the counter of the switch.
    type Count = fn(&contactd_client::dynamics::Counters) -> u64;
    let table: [(Effects, Effects, f64, f64, Count); 7] = [
        (Effects { gravity: None, ..all }, Effects { gravity: Some(DVec3::ZERO), ..all }, 0.2, 0.4, |c| c.gravity),
        (Effects { restitution: None, ..all }, all, 0.2, 0.0, |c| c.restitution),
        (Effects { friction: false, ..all }, all, 0.0, 0.4, |c| c.friction),
        (Effects { damping: None, ..all }, Effects { damping: Some(none), ..all }, 0.2, 0.4, |c| c.damping),
        (Effects { rest: None, ..all }, Effects { rest: Some(Rest { speed: 0.0 }), ..all }, 0.2, 0.4, |c| c.rest),
        (Effects { sleep: None, ..all }, Effects { sleep: Some(never), ..all }, 0.2, 0.4, |c| c.sleep),
        (Effects { penalty: None, ..all }, Effects { penalty: Some(weak), ..all }, 0.2, 0.4, |c| c.penalty),
    ];
    for (i, (off, vanishing, mu, e, count)) in table.into_iter().enumerate() {
        let (a, b) = (tumble(off, mu, e), tumble(vanishing, mu, e));
        assert_eq!(a.0, b.0, "row {i}");
        assert_eq!(count(&a.1.counters), 0, "row {i}");
        println!("row {i}: on {}", count(&b.1.counters));
    }
}

#[test]
fn counters_are_those_worked_out_by_hand() {
    // Two balls fall freely for 30 frames, damped: two of each a frame.
    let mut s = Settings::new(0.01, 1.0);
    s.effects.gravity = Some(DOWN);
    s.effects.damping = Some(Damping { linear: 0.5, angular: 0.0 });
    let mut w = world(s);
    let ball = model(&mut w, "sphere(r = 0.5);");
    for x in [0.0, 3.0] {
        w.add(Body::new(Object::new("ball", ball), Inertia::sphere(1.0, 0.5)).at(Pose::at(DVec3::X * x))).unwrap();
    }
    let c = w.run(0.3).unwrap().counters;
    assert_eq!((c.gravity, c.damping), (60, 60));
    assert_eq!((c.restitution, c.friction, c.rest, c.sleep, c.penalty), (0, 0, 0, 0, 0));
    // v' = (v + g t) / (1 + c t), thirty times.
    let v = (0..30).fold(0.0, |v, _| (v - G * 0.01) / (1.0 + 0.5 * 0.01));
    assert!((w.state(0).velocity.z - v).abs() < 1e-12);
}

/// A ball of mass 2 and radius 0.5, a tenth deep in the floor.
fn ball_in_the_floor(settings: Settings) -> (World<Embedded>, usize) {
    let mut w = world(settings);
    let floor = model(&mut w, &cuboid(dvec3(4.0, 4.0, 1.0)));
    let ball = model(&mut w, "sphere(r = 0.5);");
    w.add(Body::fixed(Object::new("floor", floor)).at(Pose::at(dvec3(0.0, 0.0, -0.5)))).unwrap();
    let ball = w
        .add(Body::new(Object::new("ball", ball), Inertia::sphere(2.0, 0.5)).at(Pose::at(dvec3(0.0, 0.0, 0.4))))
        .unwrap();
    (w, ball)
}

#[test]
fn springs_part_an_overlap_and_hold_a_ball_at_the_depth_of_its_weight() {
    let mut s = Settings::new(0.005, 1.0);
    s.effects.gravity = Some(DOWN);
    s.effects.penalty = Some(Penalty { stiffness: 2000.0, damping: 60.0, instead_of_impulses: true });
    let (mut w, ball) = ball_in_the_floor(s);
    let total = w.run(4.0).unwrap();
    let depth = 0.5 - w.pose(ball).position.z;
    println!("depth {depth}, expected {}; {total:?}", 2.0 * G / 2000.0);
    assert!((depth / (2.0 * G / 2000.0) - 1.0).abs() < 1e-3);
    assert!(total.counters.penalty > 0 && total.counters.penalty == total.overlaps);
    // Beside impulses: springs push the pair apart, impulses hold it from then on.
    s.effects.penalty = Some(Penalty { stiffness: 2000.0, damping: 60.0, instead_of_impulses: false });
    let (mut w, ball) = ball_in_the_floor(s);
    let total = w.run(4.0).unwrap();
    println!("{} {total:?}", w.pose(ball).position.z);
    assert!((w.pose(ball).position.z - 0.5).abs() < 1e-6 && total.overlaps > 0);
}
