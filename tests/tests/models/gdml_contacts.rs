//! GDML: curved solids, turned at random, that were put against each other and their mothers' walls along a direction of their own, a
//! known length apart, touching, or into each other; and points of solids against their definitions.
//!
//! `CONTACTD_GEOMETRIES=500 cargo test --release -p contactd-tests --test models gdml_contacts::` sets the number of geometries (6 by
//! default).

use super::gdml::{overlaps_of, read};
use contactd::overlaps::Verdict;
use contactd_tests::random_solids::Random;
use contactd_tests::sweep::sized;
use glam::{DMat3, DQuat, DVec2, DVec3};
use std::collections::BTreeMap;

/// A convex solid with a point of its surface that a plane and a ball within touch; its axes.
struct Touching {
    solid: String,
    kind: &'static str,
    point: DVec3,
    normal: DVec3,
}

impl Touching {
    /// `is_round`: it rolls within a ball of radius 100.
    fn random(r: &mut Random, name: &str, is_round: bool) -> Self {
        let mut size = || r.within(3.0, 10.0);
        let (a, b, c) = (size(), size(), size());
        let (u, middle) = (r.direction(), r.vector(0.8));
        let around = DVec3::new(u.x, u.y, 0.0).normalize();
        let kinds = ["orb", "ellipsoid", "box", "tube", "cone", "torus", "eltube"];
        let kind = kinds[r.below(if is_round { 2 } else { kinds.len() })];
        let is_end = r.chance(0.4);
        let end = if r.chance(0.5) { DVec3::Z } else { -DVec3::Z };
        let (text, point, normal) = match kind {
            "orb" => (format!("r=\"{a:?}\""), u * a, u),
            "ellipsoid" => {
                let axes = DVec3::new(a, b, c);
                (format!("ax=\"{a:?}\" by=\"{b:?}\" cz=\"{c:?}\""), u * axes, (u / axes).normalize())
            }
            "box" => {
                let half = 0.5 * DVec3::new(a, b, c);
                let k = r.below(3);
                let normal = DVec3::AXES[k] * if r.chance(0.5) { 1.0 } else { -1.0 };
                let mut point = middle * half;
                point[k] = normal[k] * half[k];
                (format!("x=\"{a:?}\" y=\"{b:?}\" z=\"{c:?}\""), point, normal)
            }
            "torus" => {
                let (ring, tube) = (a + 3.0, 0.3 * a);
                let text = format!(
                    "rmin=\"0\" rmax=\"{tube:?}\" rtor=\"{ring:?}\" startphi=\"0\" deltaphi=\"360\" aunit=\"deg\""
                );
                match is_end {
                    true => (text, around * ring + end * tube, end),
                    false => (text, around * (ring + tube), around),
                }
            }
            // What has an axis and ends: in the middle of an end, or on the side.
            "tube" | "eltube" | "cone" => {
                let (z, wide) = (0.5 * c, if kind == "eltube" { DVec3::new(a, b, 0.0) } else { DVec3::new(a, a, 0.0) });
                let top = if kind == "cone" { b } else { a };
                let text = match kind {
                    "tube" => format!("rmax=\"{a:?}\" z=\"{c:?}\" deltaphi=\"360\" aunit=\"deg\""),
                    "eltube" => format!("dx=\"{a:?}\" dy=\"{b:?}\" dz=\"{z:?}\""),
                    _ => format!("rmax1=\"{a:?}\" rmax2=\"{b:?}\" z=\"{c:?}\" deltaphi=\"360\" aunit=\"deg\""),
                };
                let low = wide.min_element().max(if kind == "eltube" { a.min(b) } else { a.min(top) });
                let t = 0.5 + 0.5 * middle.z;
                match (is_end, kind) {
                    (true, _) => (text, around * (0.5 * low) + end * z, end),
                    (false, "cone") => {
                        let r = a + (top - a) * t;
                        let point = around * r + DVec3::Z * (c * t - z);
                        (text, point, (around * c + DVec3::Z * (a - top)).normalize())
                    }
                    (false, _) => {
                        (text, around * wide + DVec3::Z * (middle.z * z), (around / wide.with_z(1.0)).normalize())
                    }
                }
            }
            other => unreachable!("{other}"),
        };
        Self { solid: format!("<{kind} name=\"{name}\" {text}/>\n"), kind, point, normal }
    }
}

/// The angles that GDML has for a volume turned by a matrix: those of its inverse, about x first.
fn angles(turn: DMat3) -> DVec3 {
    let m = turn.transpose();
    let at = |row: usize, column: usize| m.col(column)[row];
    let level = at(0, 0).hypot(at(1, 0));
    let y = (-at(2, 0)).atan2(level);
    match level > 1e-6 {
        true => DVec3::new(at(2, 1).atan2(at(2, 2)), y, at(1, 0).atan2(at(0, 0))),
        // Straight up: x and z turn about one line.
        false => DVec3::new((-at(1, 2)).atan2(at(1, 1)), y, 0.0),
    }
}

/// A turn that takes one direction to another one, by any angle about it.
fn turn(r: &mut Random, from: DVec3, to: DVec3) -> (DMat3, DVec3) {
    let first = DQuat::from_rotation_arc(from, to);
    let matrix = DMat3::from_quat(DQuat::from_axis_angle(to, r.within(-3.0, 3.0)) * first);
    (matrix, angles(matrix))
}

fn physvol(name: &str, volume: &str, at: DVec3, angles: DVec3) -> String {
    format!(
        "<physvol name=\"{name}\"><volumeref ref=\"{volume}\"/><position x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/>\
         <rotation x=\"{:?}\" y=\"{:?}\" z=\"{:?}\"/></physvol>\n",
        at.x, at.y, at.z, angles.x, angles.y, angles.z
    )
}

/// How deep two are in each other: apart by as much where it is negative.
fn depth(r: &mut Random) -> f64 {
    let size = 10f64.powf(r.within(-6.0, -0.5));
    [size, 0.0, -size][r.below(3)]
}

/// Mothers, turned, in a world: in each two volumes in the middle that meet, and one at its wall.
#[test]
fn what_was_put_against_each_other_is_told_apart_from_what_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("contacts.gdml");
    let mut r = Random::new(14);
    let (mut planted, mut apart, mut least, mut open) = (0, 0, f64::INFINITY, 0);
    let mut kinds = BTreeMap::<String, usize>::new();
    for k in 0..sized("CONTACTD_GEOMETRIES", 6usize) {
        let (mut solids, mut volumes, mut placed) = (String::new(), String::new(), String::new());
        let mut expected: BTreeMap<(String, Option<String>), f64> = BTreeMap::new();
        for m in 0..4 {
            let is_ball = r.chance(0.5);
            let wall = |r: &mut Random| if is_ball { (r.direction(), 100.0) } else { (DVec3::AXES[r.below(3)], 100.0) };
            solids += &match is_ball {
                true => format!("<orb name=\"M{m}\" r=\"100\"/>\n"),
                false => format!("<box name=\"M{m}\" x=\"200\" y=\"200\" z=\"200\"/>\n"),
            };
            let mut inside = String::new();
            let mut put = |name: &str, t: &Touching, at: DVec3, angles: DVec3| {
                solids += &t.solid;
                volumes += &format!("<volume name=\"V{name}\"><solidref ref=\"{name}\"/></volume>\n");
                inside += &physvol(name, &format!("V{name}"), at, angles);
            };
            let (a, b, c) = (format!("a{m}"), format!("b{m}"), format!("c{m}"));
            let (first, second) = (Touching::random(&mut r, &a, false), Touching::random(&mut r, &b, false));
            // Where the first one touches, along its normal, the second one does, against its own.
            let u = r.direction();
            let center = r.vector(10.0);
            let (of_first, angles) = turn(&mut r, first.normal, u);
            put(&a, &first, center, angles);
            let (of_second, angles) = turn(&mut r, second.normal, -u);
            let d = depth(&mut r);
            let meet = center + of_first * first.point - u * d;
            put(&b, &second, meet - of_second * second.point, angles);
            *kinds.entry(format!("{} {}", first.kind.min(second.kind), first.kind.max(second.kind))).or_default() += 1;
            expected.insert((a, Some(b)), d);
            let third = Touching::random(&mut r, &c, is_ball);
            let (out, far) = wall(&mut r);
            let (of_third, angles) = turn(&mut r, third.normal, out);
            let d = depth(&mut r);
            // Anywhere on a plane wall's middle.
            let along = if is_ball { DVec3::ZERO } else { r.vector(40.0).reject_from(out) };
            put(&c, &third, out * (far + d) + along - of_third * third.point, angles);
            expected.insert((c, None), d);
            volumes += &format!("<volume name=\"mother{m}\"><solidref ref=\"M{m}\"/>{inside}</volume>\n");
            let to = r.direction();
            let (_, angles) = turn(&mut r, DVec3::Z, to);
            placed += &physvol(&format!("P{m}"), &format!("mother{m}"), DVec3::X * (500.0 * m as f64), angles);
        }
        let text = format!(
            "<gdml><define/><materials/><solids>{solids}<box name=\"W\" x=\"5000\" y=\"500\" z=\"500\"/></solids><structure>{volumes}\
             <volume name=\"World\"><solidref ref=\"W\"/>{placed}</volume></structure>\
             <setup name=\"Default\"><world ref=\"World\"/></setup></gdml>"
        );
        std::fs::write(&path, &text).expect("written");
        // Above what rounding takes in a world of 5 m.
        let found = overlaps_of(&path, 1e-7);
        let mut told: BTreeMap<(String, Option<String>), Verdict> =
            found.pairs.iter().map(|p| ((p.a.clone(), p.b.name().map(str::to_owned)), p.verdict)).collect();
        for (pair, d) in expected {
            match told.remove(&pair) {
                None => assert!(d <= 0.0, "{k}: {pair:?} are {d} deep and were not told\n{text}"),
                Some(Verdict::Overlap(_, depth)) => {
                    assert!(d > 0.0 && depth <= 0.5 * d + 1e-12, "{k}: {pair:?} are {d} deep, told {depth}\n{text}");
                    least = least.min(d);
                }
                // A proof that was not found is no lie; it is counted.
                Some(Verdict::NotProven(_)) => open += 1,
                Some(Verdict::Separate(_)) => unreachable!("only what is not separate is listed"),
            }
            (planted, apart) = if d > 0.0 { (planted + 1, apart) } else { (planted, apart + 1) };
        }
        assert!(told.is_empty(), "{k}: {told:?}\n{text}");
    }
    println!(
        "{planted} planted, the least {least:.1e}, {apart} that touch or are apart, {open} not proven; {} kinds of pairs",
        kinds.len()
    );
    assert!(planted > 8 && apart > 16 && open * 50 <= planted + apart, "{planted} {apart} {open}");
}

/// A solid, and what its definition says of a point. Source: GDML User's Guide and the Geant4 Book For Application Developers, 4.1.
fn defined(r: &mut Random, kind: &str) -> (String, Box<dyn Fn(DVec3) -> bool>) {
    let mut size = |low: f64| r.within(low, 10.0);
    let (a, b, c) = (size(3.0), size(3.0), size(3.0));
    let inner = 0.3 * a.min(b);
    let (from, wide) = (r.within(-3.0, 3.0), r.within(0.5, 6.0));
    let in_span = move |x: DVec3| (x.y.atan2(x.x) - from).rem_euclid(std::f64::consts::TAU) <= wide;
    let span = format!("startphi=\"{from:?}\" deltaphi=\"{wide:?}\" aunit=\"rad\"");
    let rho = |x: DVec3| DVec2::new(x.x, x.y).length();
    match kind {
        "tube" => (
            format!("rmin=\"{inner:?}\" rmax=\"{a:?}\" z=\"{c:?}\" {span}"),
            Box::new(move |x| (inner..a).contains(&rho(x)) && x.z.abs() < 0.5 * c && in_span(x)),
        ),
        "cone" => (
            format!("rmin1=\"0\" rmax1=\"{a:?}\" rmin2=\"{inner:?}\" rmax2=\"{b:?}\" z=\"{c:?}\" {span}"),
            Box::new(move |x| {
                let t = x.z / c + 0.5;
                (0.0..1.0).contains(&t) && (inner * t..a + (b - a) * t).contains(&rho(x)) && in_span(x)
            }),
        ),
        "sphere" => {
            let (low, high) = (r.within(0.0, 1.5), r.within(0.3, 1.6));
            (
                format!("rmin=\"{inner:?}\" rmax=\"{a:?}\" {span} starttheta=\"{low:?}\" deltatheta=\"{high:?}\""),
                Box::new(move |x| {
                    let theta = rho(x).atan2(x.z);
                    (inner..a).contains(&x.length()) && (low..low + high).contains(&theta) && in_span(x)
                }),
            )
        }
        "torus" => (
            format!("rmin=\"{:?}\" rmax=\"{inner:?}\" rtor=\"{a:?}\" {span}", 0.5 * inner),
            Box::new(move |x| (0.5 * inner..inner).contains(&(rho(x) - a).hypot(x.z)) && in_span(x)),
        ),
        "ellipsoid" => (
            format!("ax=\"{a:?}\" by=\"{b:?}\" cz=\"{c:?}\" zcut1=\"{:?}\" zcut2=\"{:?}\"", -0.5 * c, 0.7 * c),
            Box::new(move |x| (x / DVec3::new(a, b, c)).length() < 1.0 && x.z > -0.5 * c && x.z < 0.7 * c),
        ),
        "eltube" => (
            format!("dx=\"{a:?}\" dy=\"{b:?}\" dz=\"{c:?}\""),
            Box::new(move |x| (x.x / a).hypot(x.y / b) < 1.0 && x.z.abs() < c),
        ),
        "paraboloid" => (
            format!("rlo=\"{inner:?}\" rhi=\"{a:?}\" dz=\"{c:?}\""),
            Box::new(move |x| {
                let t = 0.5 * (x.z / c + 1.0);
                (0.0..1.0).contains(&t) && rho(x).powi(2) < inner * inner + (a * a - inner * inner) * t
            }),
        ),
        "hype" => {
            let (low, high) = (r.within(0.0, 0.3), r.within(0.3, 0.8));
            (
                format!("rmin=\"{inner:?}\" rmax=\"{a:?}\" inst=\"{low:?}\" outst=\"{high:?}\" z=\"{c:?}\""),
                Box::new(move |x| {
                    let at = |r: f64, stereo: f64| r * r + (stereo.tan() * x.z).powi(2);
                    x.z.abs() < 0.5 * c && (at(inner, low)..at(a, high)).contains(&rho(x).powi(2))
                }),
            )
        }
        "trd" => (
            format!("x1=\"{a:?}\" x2=\"{b:?}\" y1=\"{b:?}\" y2=\"{c:?}\" z=\"{a:?}\""),
            Box::new(move |x| {
                let t = x.z / a + 0.5;
                (0.0..1.0).contains(&t) && x.x.abs() < 0.5 * (a + (b - a) * t) && x.y.abs() < 0.5 * (b + (c - b) * t)
            }),
        ),
        "para" => {
            let (alpha, theta, phi) = (r.within(-0.6, 0.6), r.within(0.0, 0.6), r.within(-3.0, 3.0));
            (
                format!("x=\"{a:?}\" y=\"{b:?}\" z=\"{c:?}\" alpha=\"{alpha:?}\" theta=\"{theta:?}\" phi=\"{phi:?}\""),
                Box::new(move |x| {
                    let y = x.y - x.z * theta.tan() * phi.sin();
                    let along = x.x - x.z * theta.tan() * phi.cos() - y * alpha.tan();
                    x.z.abs() < 0.5 * c && y.abs() < 0.5 * b && along.abs() < 0.5 * a
                }),
            )
        }
        "genericPolyhedra" => {
            // An outline around a middle that it sees all of, or one along the axis.
            let corners = 3 + r.below(5);
            let mut outline: Vec<DVec2> = (0..corners)
                .map(|k| {
                    let turn = (k as f64 + r.within(0.1, 0.9)) * std::f64::consts::TAU / corners as f64;
                    DVec2::new(5.0, 0.0) + DVec2::from_angle(turn) * r.within(1.5, 4.5)
                })
                .collect();
            if r.chance(0.3) {
                outline = vec![DVec2::new(0.0, -a), DVec2::new(b, -a), DVec2::new(c, a), DVec2::new(0.0, a)];
            }
            if r.chance(0.5) {
                outline.reverse();
            }
            let wide = if r.chance(0.5) { std::f64::consts::TAU } else { wide };
            let sides = 3 + r.below(6);
            let points: String =
                outline.iter().map(|p| format!("<rzpoint r=\"{:?}\" z=\"{:?}\"/>", p.x, p.y)).collect();
            let text =
                format!("startphi=\"{from:?}\" deltaphi=\"{wide:?}\" aunit=\"rad\" numsides=\"{sides}\">{points}");
            let step = wide / sides as f64;
            let inside = move |x: DVec3| {
                let phi = (x.y.atan2(x.x) - from).rem_euclid(std::f64::consts::TAU);
                let side = (phi / step).floor();
                if side >= sides as f64 {
                    return false;
                }
                // As far from the axis as the corners of the same section are.
                let p = DVec2::new(rho(x) * (phi - (side + 0.5) * step).cos() / (0.5 * step).cos(), x.z);
                let crosses = |k: usize| {
                    let (u, v) = (outline[k], outline[(k + 1) % outline.len()]);
                    (u.y > p.y) != (v.y > p.y) && p.x < u.x + (v.x - u.x) * (p.y - u.y) / (v.y - u.y)
                };
                (0..outline.len()).filter(|k| crosses(*k)).count() % 2 == 1
            };
            (text, Box::new(inside))
        }
        other => unreachable!("{other}"),
    }
}

#[test]
fn points_of_solids_are_where_their_definitions_have_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("solids.gdml");
    let mut r = Random::new(41);
    let (mut points, mut within) = (0, 0);
    for k in 0..sized("CONTACTD_GEOMETRIES", 6usize) {
        for kind in [
            "tube",
            "cone",
            "sphere",
            "torus",
            "ellipsoid",
            "eltube",
            "paraboloid",
            "hype",
            "trd",
            "para",
            "genericPolyhedra",
        ] {
            let (text, is_inside) = defined(&mut r, kind);
            let end = if text.contains('<') { format!("</{kind}>") } else { "/>".to_owned() };
            let whole = format!(
                "<gdml><solids><{kind} name=\"s\" {text}{end}</solids><structure><volume name=\"v\"><solidref ref=\"s\"/></volume></structure></gdml>"
            );
            std::fs::write(&path, &whole).expect("written");
            let (_, models) = read(&path);
            for _ in 0..300 {
                let x = r.vector(12.0);
                let f = models[0].solid.value(x);
                assert!(f.abs() < 1e-9 || (f < 0.0) == is_inside(x), "{k}: {x} of {text}: {f}");
                points += 1;
                within += usize::from(f < 0.0);
            }
        }
    }
    println!("{points} points, {within} of them inside");
    assert!(within > 500, "{within}");
}
