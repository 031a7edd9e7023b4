//! The least clearance over ranges of joints against arms of capsules, whose distances are closed forms.
//!
//! `CONTACTD_ROBOTS=2000 cargo test --release -p contactd-tests --test models clearance::` sets the number of random arms (20 by default).

use super::robots::{Arm, Joint, frame, models, read, shift};
use contactd::clearance::{Least, Question, least};
use contactd::import::robot::{Ask, Values};
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DMat4, DVec3};

/// Distance of two segments. Source: C. Ericson, "Real-Time Collision Detection", 5.1.9.
fn segments([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> f64 {
    let (d, e, w) = (q - p, s - r, p - r);
    let (a, b, c, f, g) = (d.dot(d), d.dot(e), d.dot(w), e.dot(w), e.dot(e));
    let det = a * g - b * b;
    let mut u = if det > 1e-14 * a * g { ((b * f - c * g) / det).clamp(0.0, 1.0) } else { 0.0 };
    let v = ((b * u + f) / g).clamp(0.0, 1.0);
    u = ((b * v - c) / a).clamp(0.0, 1.0);
    (p + d * u).distance(r + e * v)
}

/// An arm whose links are capsules, in the air.
fn arm(r: &mut Random) -> Arm {
    let mut arm = Arm::random(r);
    for link in &mut arm.links {
        (link.kind, link.size) = ("capsule", DVec3::new(r.within(0.03, 0.1), r.within(0.2, 0.6), 0.0));
    }
    for joint in &mut arm.joints {
        joint.kind = ["revolute", "revolute", "prismatic"][r.below(3)];
        let low = r.within(-1.0, 0.5);
        joint.range = [low, low + r.within(0.1, if joint.kind == "prismatic" { 0.5 } else { 1.2 })];
        joint.xyz = r.direction() * r.within(0.6, 1.4);
    }
    arm
}

/// The least distance of two links that are no neighbours, with values of the joints by their numbers.
fn distance(arm: &Arm, values: &Values) -> f64 {
    let stands = arm.stands(values);
    let ends = |i: usize| {
        let (g, at): (_, DMat4) = (&arm.links[i], stands[i]);
        let at = at * frame(g.xyz, g.rpy);
        [-1.0, 1.0].map(|s| at.transform_point3(DVec3::Z * (s * g.size.y)))
    };
    let mut least = f64::INFINITY;
    for i in 0..arm.links.len() {
        for j in i + 2..arm.links.len() {
            least = least.min(segments(ends(i), ends(j)) - arm.links[i].size.x - arm.links[j].size.x);
        }
    }
    least.max(0.0)
}

fn ask(folder: &std::path::Path, arm: &Arm, question: &Question) -> Least {
    let (robot, scene) = read(folder, "arm.urdf", &arm.urdf(), &Ask::default());
    least(&robot, &scene, &models(&scene), question).expect("an answer")
}

#[test]
fn no_sample_is_nearer_than_is_proven_and_what_is_told_is_so_near() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(5);
    let (mut clear, mut clashes, mut boxes, mut widest) = (0, 0, 0, 0.0_f64);
    for k in 0..sized("CONTACTD_ROBOTS", 40usize) {
        let arm = arm(&mut r);
        if arm.links.len() < 3 {
            continue;
        }
        // Two or three joints move; the others stand somewhere.
        let moving = 1 + r.below(3.min(arm.joints.len()));
        let inside = |r: &mut Random, joint: &Joint| r.within(joint.range[0], joint.range[1]);
        let (mut ranges, mut values) = (Vec::new(), Values::new());
        for (i, joint) in arm.joints.iter().enumerate() {
            if i < moving {
                let (a, b) = (inside(&mut r, joint), inside(&mut r, joint));
                ranges.push((format!("j{i}"), [a.min(b), a.max(b)]));
            } else {
                values.insert(format!("j{i}"), inside(&mut r, joint));
            }
        }
        let question =
            Question { ranges: ranges.clone(), values: values.clone(), tolerance: 0.01, least: None, boxes: 20_000 };
        let found = ask(folder.path(), &arm, &question);
        boxes += found.boxes;
        let with = |of: &dyn Fn(usize, [f64; 2]) -> f64| {
            let mut all = values.clone();
            all.extend(ranges.iter().enumerate().map(|(i, (name, range))| (name.clone(), of(i, *range))));
            all
        };
        for _ in 0..400 {
            let at: Vec<f64> = ranges.iter().map(|(_, [low, high])| low + (high - low) * r.within(0.0, 1.0)).collect();
            let sample = distance(&arm, &with(&|i, _| at[i]));
            assert!(sample >= found.lower - 1e-12, "{k}: {sample} where {} is proven", found.lower);
        }
        for corner in 0..1 << ranges.len() {
            let sample = distance(&arm, &with(&|i, range| range[corner >> i & 1]));
            assert!(sample >= found.lower - 1e-12, "{k}: {sample} in a corner where {} is proven", found.lower);
        }
        // So near it is at the values that are told, to the part of the tolerance that a distance may be off.
        let mut at = values.clone();
        at.extend(found.values.clone());
        assert!((distance(&arm, &at) - found.upper).abs() <= 0.0026, "{k}: {} {}", distance(&arm, &at), found.upper);
        if found.upper == 0.0 {
            clashes += 1;
            continue;
        }
        clear += 1;
        if found.is_settled {
            assert!(found.upper - found.lower <= 0.01 + 1e-12, "{k}: {found:?}");
            widest = widest.max(found.upper - found.lower);
        }
        // What is asked with a least length is decided rightly.
        let least = found.upper + if r.chance(0.5) { -0.5 } else { 0.5 } * found.upper;
        let decided = ask(folder.path(), &arm, &Question { least: Some(least), ..question });
        assert!(decided.lower <= found.upper + 1e-12 && decided.upper >= found.lower - 1e-12, "{k}");
        if decided.is_settled && (least - found.upper).abs() > 0.011 {
            assert_eq!(decided.lower >= least, least < found.lower, "{k}: {least} of {found:?}: {decided:?}");
        }
    }
    println!("{clear} clear, {clashes} clash, {boxes} boxes, bounds {widest:.1e} apart at most");
    assert!(clear > 5 && clashes > 1, "{clear} {clashes}");
}

/// A ball at the end of an arm goes along an arc: how near it comes to another one that stands is a closed form.
#[test]
fn a_ball_on_an_arm_comes_as_near_as_its_arc_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(21);
    for k in 0..sized("CONTACTD_ROBOTS", 8) {
        let (p, q, arm) = (r.within(0.05, 0.2), r.within(0.05, 0.2), r.within(0.5, 1.5));
        let (from, whole) = (r.within(-1.0, 1.0), r.within(0.3, 3.0));
        let x = r.direction() * r.within(2.2, 3.5);
        let to = (x.y.atan2(x.x) - from).rem_euclid(std::f64::consts::TAU);
        let at = |t: f64| (x - DVec3::new(arm * (from + t).cos(), arm * (from + t).sin(), 0.0)).length();
        let expected = if to <= whole { at(to) } else { at(0.0).min(at(whole)) } - p - q;
        let ball = |name: &str, at: DVec3, radius: f64| {
            format!(
                "<link name=\"{name}\"><collision><origin xyz=\"{:?} {:?} {:?}\"/><geometry><sphere radius=\"{radius:?}\"/></geometry></collision></link>",
                at.x, at.y, at.z
            )
        };
        // The other ball is in the world; a link without geometry is between, for neighbours are not tested.
        let text = format!(
            "<robot>{}<link name=\"hub\"/>{}<joint name=\"lift\" type=\"prismatic\"><parent link=\"base\"/><child link=\"hub\"/>\
             <axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\"/></joint><joint name=\"turn\" type=\"continuous\">\
             <parent link=\"hub\"/><child link=\"end\"/><axis xyz=\"0 0 1\"/></joint></robot>",
            ball("base", x, q),
            ball("end", DVec3::X * arm, p)
        );
        let (robot, scene) = read(folder.path(), "arc.urdf", &text, &Ask::default());
        let question = Question {
            ranges: vec![("turn".into(), [from, from + whole])],
            values: Values::new(),
            tolerance: 1e-6,
            least: None,
            boxes: 1_000_000,
        };
        let found = least(&robot, &scene, &models(&scene), &question).expect("an answer");
        assert!(found.is_settled && found.pairs == 1, "{k}: {found:?}");
        let right = found.lower <= expected + 1e-12 && expected <= found.upper + 1e-12;
        assert!(right && found.upper - found.lower <= 1e-6, "{k}: {expected} in {found:?}");
    }
}

/// A box, a ball or a cylinder as URDF writes it, and how deep a point of its frame lies in it, but for edges.
fn solid(r: &mut Random) -> (String, Box<dyn Fn(DVec3) -> f64>) {
    let (x, y, z) = (r.within(0.05, 0.4), r.within(0.05, 0.4), r.within(0.05, 0.4));
    match r.below(3) {
        0 => {
            let half = DVec3::new(x, y, z);
            let text = format!("<box size=\"{:?} {:?} {:?}\"/>", 2.0 * x, 2.0 * y, 2.0 * z);
            (text, Box::new(move |p| (half - p.abs()).min_element()))
        }
        1 => (format!("<sphere radius=\"{x:?}\"/>"), Box::new(move |p| x - p.length())),
        _ => {
            let text = format!("<cylinder radius=\"{x:?}\" length=\"{:?}\"/>", 2.0 * z);
            (text, Box::new(move |p| (x - p.x.hypot(p.y)).min(z - p.z.abs())))
        }
    }
}

/// Two links that a slide moves through each other or past: a clash is told wherever a sampled point lies deep in both, and none is
/// excluded that there is.
#[test]
fn what_clashes_at_a_value_of_the_range_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut r = Random::new(33);
    let (mut clashes, mut clear) = (0, 0);
    for k in 0..sized("CONTACTD_ROBOTS", 60usize) {
        let [(base, in_base), (tool, in_tool)] = [solid(&mut r), solid(&mut r)];
        let (xyz, rpy) = (r.vector(0.5), r.vector(3.0));
        let text = format!(
            "<robot><link name=\"base\"><collision><geometry>{base}</geometry></collision></link><link name=\"hub\"/>\
             <link name=\"tool\"><collision><origin xyz=\"{:?} {:?} {:?}\" rpy=\"{:?} {:?} {:?}\"/><geometry>{tool}</geometry>\
             </collision></link><joint name=\"lift\" type=\"prismatic\"><parent link=\"base\"/><child link=\"hub\"/>\
             <axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\"/></joint><joint name=\"s\" type=\"prismatic\">\
             <parent link=\"hub\"/><child link=\"tool\"/><axis xyz=\"1 0 0\"/><limit lower=\"-1\" upper=\"1\"/></joint></robot>",
            xyz.x, xyz.y, xyz.z, rpy.x, rpy.y, rpy.z
        );
        let (robot, scene) = read(folder.path(), "slide.urdf", &text, &Ask::default());
        let from = r.within(-1.0, 0.5);
        // Many are one value alone.
        let to = from + if r.chance(0.5) { 0.0 } else { r.within(0.0, 0.4) };
        let question = Question {
            ranges: vec![("s".into(), [from, to])],
            values: Values::new(),
            tolerance: 1e-3,
            least: if r.chance(0.3) { Some(5e-4) } else { None },
            boxes: 100_000,
        };
        let found = least(&robot, &scene, &models(&scene), &question).expect("an answer");
        // The deepest of many points.
        let mut deepest = f64::NEG_INFINITY;
        for value in 0..=8 {
            let stand = shift(DVec3::X * (from + (to - from) * f64::from(value) / 8.0)) * frame(xyz, rpy);
            let back = stand.inverse();
            let own = |p: DVec3| in_base(p).min(in_tool(back.transform_point3(p)));
            let (mut best, mut size) = (DVec3::ZERO, 0.5);
            let mut depth = own(best);
            for _ in 0..500 {
                let p = best + r.direction() * (size * r.within(0.0, 1.0));
                if own(p) > depth {
                    (best, depth) = (p, own(p));
                } else {
                    size *= 0.99;
                }
            }
            deepest = deepest.max(depth);
        }
        if deepest > 1e-6 {
            clashes += 1;
            // Nearer than was asked says enough.
            let is_told = found.upper == 0.0 || question.least.is_some_and(|least| found.upper < least);
            assert!(is_told, "{k}: {deepest} deep: {found:?}\n{text}");
        }
        assert!(found.is_settled, "{k}: {deepest} deep from {from} to {to}, {question:?}: {found:?}\n{text}");
        assert!(found.upper == 0.0 || question.least.is_some() || found.lower > 0.0, "{k}: {found:?}");
        clear += u32::from(found.lower > 0.0);
    }
    println!("{clashes} clash, {clear} clear");
    assert!(clashes > 10 && clear > 10, "{clashes} {clear}");
}

/// A ball whose way ends in a block, and is hardly clear of it half way: the bounds there are as near to each other as was asked.
#[test]
fn a_range_whose_middle_is_hardly_clear_may_end_in_a_clash() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "<robot><link name=\"base\"><collision><geometry><box size=\"0.4 0.4 0.4\"/></geometry></collision></link>\
                <link name=\"hub\"/><link name=\"tool\"><collision><geometry><sphere radius=\"0.05\"/></geometry></collision></link>\
                <joint name=\"lift\" type=\"fixed\"><parent link=\"base\"/><child link=\"hub\"/></joint>\
                <joint name=\"s\" type=\"prismatic\"><parent link=\"hub\"/><child link=\"tool\"/><axis xyz=\"0 0 1\"/>\
                <limit lower=\"-1\" upper=\"1\"/></joint></robot>";
    let (robot, scene) = read(folder.path(), "block.urdf", text, &Ask::default());
    for (range, least_asked, is_clash) in [
        ([0.1506, 0.3506], None, true),
        ([0.1506, 0.3506], Some(5e-4), true),
        ([0.2506, 0.3506], None, false),
        ([0.2506, 0.3506], Some(5e-4), false),
        ([0.25 + 1e-7, 0.3506], None, false),
    ] {
        let ranges = vec![("s".into(), range)];
        let question = Question { ranges, values: Values::new(), tolerance: 1e-3, least: least_asked, boxes: 10_000 };
        let found = least(&robot, &scene, &models(&scene), &question).expect("an answer");
        let told = format!("{range:?}, {least_asked:?}: {found:?}");
        assert!(found.is_settled && (found.upper == 0.0) == is_clash, "{told}");
        assert!(is_clash || found.lower > 0.0 && least_asked.is_none_or(|least| found.lower >= least), "{told}");
    }
}
