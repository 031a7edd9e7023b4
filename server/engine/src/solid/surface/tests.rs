//! What the contract promises of every kind.

use super::*;
use crate::math::random::Random;
use glam::{DMat3, DQuat, DVec2};

/// One face of each kind, somewhere.
fn faces(r: &mut Random) -> [Face; 21] {
    let (o, n) = (r.vector(1.0), r.vector(1.0).normalize());
    let radius = r.within(0.2, 2.0);
    let (sin, cos) = r.within(0.1, 1.2).sin_cos();
    [
        Plane { normal: n, offset: r.within(-1.0, 1.0) }.into(),
        Sphere { center: o, radius }.into(),
        Cylinder { origin: o, axis: n, radius }.into(),
        Cone { apex: o, axis: n, sin, cos }.into(),
        Torus { origin: o, axis: n, major: r.within(1.0, 2.0), minor: r.within(0.1, 1.0) }.into(),
        // One without a hole.
        Torus { origin: o, axis: n, major: r.within(0.1, 0.5), minor: r.within(0.5, 1.0) }.into(),
        Capsule { origin: o, axis: n, half: r.within(0.1, 1.0), radius }.into(),
        ellipsoid(r).into(),
        Elliptic::cylinder(r.vector(1.0), [r.vector(1.0), r.vector(1.0)]).into(),
        // One that leans over its ellipse, and an upright one.
        Elliptic::cone(r.vector(1.0), [r.vector(1.0) + DVec3::X, r.vector(1.0) + DVec3::Y], DVec3::Z).into(),
        Elliptic::cone(o, [DVec3::X * r.within(0.5, 2.0), DVec3::Y * r.within(0.5, 2.0)], DVec3::Z * radius).into(),
        bowl(r, 0.0).into(),
        bowl(r, radius).into(),
        // A long ellipsoid, and a cylinder.
        bowl(r, -0.2).into(),
        Bowl { scale: DVec3::new(0.6, 0.0, 0.4), fall: 0.6, ..bowl(r, 0.0) }.into(),
        superellipsoid(r, 0.3, 0.6).into(),
        superellipsoid(r, 1.0, 0.2).into(),
        superellipsoid(r, 0.1, 1.0).into(),
        hyperboloid(r, 0.7).into(),
        hyperboloid(r, f64::INFINITY).into(),
        Saddle::paraboloid(r.vector(1.0), turned(r), DVec2::new(r.within(0.3, 2.0), r.within(0.3, 2.0)), 2.0).into(),
    ]
}

fn turned(r: &mut Random) -> DMat3 {
    let q = DQuat::from_xyzw(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0));
    DMat3::from_quat(q.normalize())
}

fn bowl(r: &mut Random, kappa: f64) -> Bowl {
    let (bends, g) = (DVec2::new(r.within(0.3, 2.0), r.within(0.3, 2.0)), r.within(0.3, 1.5));
    Bowl::new(r.vector(1.0), turned(r), bends, [kappa, g], 2.0)
}

fn hyperboloid(r: &mut Random, second: f64) -> Saddle {
    let semi = DVec3::new(r.within(0.2, 0.4), second * r.within(0.6, 1.4), r.within(0.3, 1.5));
    Saddle::hyperboloid(r.vector(1.0), turned(r), semi)
}

fn superellipsoid(r: &mut Random, e: f64, f: f64) -> Superellipsoid {
    let semi = DVec3::new(r.within(0.3, 2.0), r.within(0.3, 2.0), r.within(0.3, 2.0));
    Superellipsoid::new(r.vector(1.0), turned(r), semi, DVec2::new(e, f))
}

fn ellipsoid(r: &mut Random) -> Elliptic {
    let q = DQuat::from_xyzw(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0));
    let semi = DVec3::new(r.within(0.3, 2.0), r.within(0.3, 2.0), r.within(0.3, 2.0));
    Elliptic::ellipsoid(r.vector(1.0), glam::DMat3::from_quat(q.normalize()), semi)
}

#[test]
fn a_face_at_a_point_is_its_value_with_its_derivatives() {
    let mut r = Random(3);
    for _ in 0..500 {
        for face in faces(&mut r) {
            let x = r.vector(2.0);
            let at = face.at(x);
            assert!((at.value - face.value(x)).abs() < 1e-14 && (at.normal.length() - at.slope).abs() < 1e-14);
            assert!(at.slope < 1.0 + 1e-14 && (at.unit().length() - 1.0).abs() < 1e-14, "{face:?}");
            // Near an axis or a centre the third derivative is large.
            if at.rho < 0.2
                || face.under(x, x).is_some_and(|u| u.rho < 0.2)
                || face.axis().is_some_and(|axis| (x - axis.origin).cross(axis.direction).length() < 0.2)
            {
                continue;
            }
            let (h, d) = (1e-6, r.vector(1.0).normalize());
            let slope = (face.value(x + d * h) - face.value(x - d * h)) / (2.0 * h);
            assert!((slope - at.normal.dot(d)).abs() < 1e-8, "{face:?}");
            let turn = (face.at(x + d * h).normal - face.at(x - d * h).normal) / (2.0 * h);
            assert!((turn - face.curvature(x, &at).matrix() * d).length() < 1e-7, "{face:?}");
        }
    }
}

#[test]
fn spans_hold_the_values_and_rays_end_where_psi_changes_its_sign() {
    let mut r = Random(5);
    for _ in 0..500 {
        for face in faces(&mut r) {
            let (c, half) = (r.vector(2.0), r.vector(0.5).abs());
            let (lo, hi) = face.span(c, half);
            let d = r.vector(1.0).normalize();
            let inside = face.inside(c, d);
            for _ in 0..20 {
                let v = face.value(c + half * r.vector(1.0).clamp(-DVec3::ONE, DVec3::ONE));
                assert!(lo - 1e-14 <= v && v <= hi + 1e-14, "{face:?}");
                let t = r.within(-4.0, 4.0);
                let v = face.value(c + d * t);
                assert!(v.abs() < 1e-9 || (v < 0.0) == inside.iter().any(|(s, e)| *s <= t && t <= *e), "{face:?}");
            }
        }
    }
}

#[test]
fn a_tangent_lies_below_psi_however_near_to_an_axis_or_an_end_it_is_taken() {
    let mut r = Random(41);
    for _ in 0..2_000 {
        for face in &faces(&mut r) {
            let about = match face.symmetry() {
                Symmetry::Axis(Axis { origin, direction }) => origin + direction * r.within(-1.0, 1.0),
                Symmetry::Center(center) => center,
                Symmetry::Normal(_) | Symmetry::None => r.vector(1.0),
            };
            let ends = face.ends();
            let apex = face.apex().map(|apex| apex.point);
            let circle =
                if let Face::Torus(t) = face { Some(t.origin + any_perpendicular(t.axis) * t.major) } else { None };
            for p in [Some(about), ends[0], ends[1], apex, circle].into_iter().flatten() {
                let x = p + r.vector(1.0) * 10f64.powf(r.within(-18.0, -12.0));
                let at = face.at(x);
                let under = face.under(x, x);
                for _ in 0..10 {
                    let d = r.vector(1.0) * 10f64.powf(r.within(-3.0, 0.0));
                    let dip = under.map_or(0.0, |u| {
                        let (p, along) = (u.rho + u.out.dot(d), u.axis.cross(u.out).normalize_or_zero());
                        let t = u.beside.map_or(along.dot(d), |b| b.dot(d));
                        u.k * (p.hypot(t) - p)
                    });
                    let (value, normal) = under.map_or((at.value, at.normal), |u| (u.value, u.normal));
                    let over = value + normal.dot(d) - dip - face.value(x + d);
                    assert!(over < 1e-14, "{face:?} at {x}: {over:e} above it at {}", x + d);
                }
            }
        }
    }
}

#[test]
fn a_moved_face_has_its_values_moved_and_its_own_symmetry_changes_none() {
    let mut r = Random(7);
    for _ in 0..200 {
        let turn = DQuat::from_xyzw(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0), 1.5).normalize();
        let frame = Pose::new(r.vector(1.0), turn);
        for face in faces(&mut r) {
            let (placed, moved) = (face.placed(&frame), face.moved(|x| frame.point(x), |v| frame.vector(v)));
            let (origin, axis) = match face.symmetry() {
                Symmetry::Axis(Axis { origin, direction }) => (origin, direction),
                Symmetry::Center(center) => (center, r.vector(1.0).normalize()),
                Symmetry::Normal(normal) => (r.vector(1.0), normal),
                Symmetry::None => (DVec3::ZERO, DVec3::ZERO),
            };
            let spin =
                if axis == DVec3::ZERO { DQuat::IDENTITY } else { DQuat::from_axis_angle(axis, r.within(-3.0, 3.0)) };
            for _ in 0..10 {
                let x = r.vector(2.0);
                assert!((placed.value(frame.point(x)) - face.value(x)).abs() < 1e-13);
                assert!((moved.value(frame.point(x)) - face.value(x)).abs() < 1e-13);
                assert!((face.value(origin + spin * (x - origin)) - face.value(x)).abs() < 1e-13, "{face:?}");
            }
        }
    }
}

#[test]
fn capabilities_agree_with_psi() {
    let (mut r, mut parts) = (Random(11), 0);
    for _ in 0..300 {
        for face in faces(&mut r) {
            for _ in 0..10 {
                let x = r.vector(2.0);
                let (v, at) = (face.value(x), face.at(x));
                if let Some((normal, offset)) = face.flat() {
                    assert_eq!(v, normal.dot(x) - offset);
                }
                if let Some((center, radius)) = face.ball() {
                    assert_eq!(v, center.distance(x) - radius);
                }
                let inset = r.within(0.0, 0.1);
                if let Some(q) = face.quadric(inset) {
                    let s = x - q.origin;
                    let z = q.axis.map_or(0.0, |a| s.dot(a));
                    let u = s - q.axis.map_or(DVec3::ZERO, |a| a * z);
                    let rho = q.radius + q.slope * z;
                    let inside = rho >= 0.0 && u.length_squared() <= rho * rho;
                    assert!((v + inset).abs() < 1e-9 || inside == (v <= -inset), "{face:?} {x}");
                }
                let reach = r.within(0.0, 0.5);
                if let Some(part) = face.near(x, reach) {
                    let y = x + r.vector(1.0).normalize() * reach;
                    assert!((part.value(y) - face.value(y)).abs() < 1e-14, "{face:?} {x} {y}");
                    parts += 1;
                }
                if let Some(axis) = face.straight_at(x) {
                    // Straight along the tangent that the axis lies over.
                    let along = at.normal.cross(axis.cross(at.normal)).normalize();
                    assert!((face.curvature(x, &at).matrix() * along).length() < 1e-9, "{face:?}");
                }
                if let Some(apex) = face.apex() {
                    assert!(face.value(apex.point).abs() < 1e-14 && at.normal.dot(apex.axis) + apex.sin < 1e-12);
                }
                // What lies within a tube that meets itself is none of the surface.
                // Nor do all gradients of an open quadric occur on it: then the foot is the point itself.
                let is_near = |foot: DVec3| foot != x && foot.length() < 100.0;
                let is_whole = |foot: DVec3| is_near(foot) && (face.is_convex() || face.value(foot) > -1e-9);
                if !face.is_flat() && is_whole(face.foot(x, at.normal, 1.0)) {
                    let foot = face.foot(x, at.normal, 1.0);
                    assert!(face.value(foot).abs() < 1e-12, "{face:?}");
                    assert!((face.at(foot).normal - at.normal).length() < 1e-12, "{face:?}");
                }
            }
            assert_eq!(face.deviation(&face, 3.0), Some(0.0));
            assert_eq!(face.difference(&face, 3.0), Some(0.0));
        }
        let [p, s, ..] = faces(&mut r);
        assert_eq!((p.above(&s, DVec3::ZERO, 1.0), p.deviation(&s, 1.0)), (None, None));
    }
    assert!(parts > 1000, "{parts}");
}

/// What `Under` promises, at a point `y` off the centre.
fn beneath(u: &Under, y: DVec3) -> f64 {
    let (p, t) = (u.rho + u.out.dot(y), u.beside.unwrap_or(u.axis.cross(u.out)).dot(y));
    u.value + u.normal.dot(y) - u.k * (p.hypot(t) - p)
}

#[test]
fn what_bounds_psi_from_below_and_from_above_does_so_near_and_far() {
    let mut r = Random(13);
    let (mut bent, mut close, mut flat) = (0, 0, 0);
    for _ in 0..4000 {
        for face in faces(&mut r) {
            let (c, touched) = (r.vector(2.0), r.vector(2.0));
            let touched = if r.unit() < 0.5 { c } else { touched };
            let at = face.at(c);
            let under = face.under(touched, c);
            assert!(under.is_none() || !face.is_convex());
            bent += usize::from(under.is_some());
            for _ in 0..10 {
                let size = 10f64.powf(r.within(-4.0, 0.5));
                let y = r.vector(size);
                let psi = face.value(c + y);
                let d = y.length();
                // From above: a ball's or an axis' k D²/(2 rho).
                if at.k > 0.0 {
                    assert!(psi <= at.value + at.normal.dot(y) + at.k * d * d / (2.0 * at.rho) + 1e-13, "{face:?}");
                }
                // As the length of a vector of three.
                if let Some([radial, one, other]) = face.split(c) {
                    let (p, tau) = (at.rho + radial.dot(y), one.dot(y).hypot(other.dot(y)));
                    let rise = (p * p + at.k * tau * tau).sqrt() - p;
                    assert!(psi <= at.value + at.normal.dot(y) + rise + 1e-13, "{face:?} {c} {y}");
                    flat += usize::from(tau > 0.01 && rise > 0.0 && psi - at.value - at.normal.dot(y) > 0.1 * rise);
                }
                let turned = (face.at(c + y).normal - at.normal).length();
                assert!(turned <= face.turn(c, &at, d) + 1e-9, "{face:?}");
                let Some(u) = under else {
                    let t = face.at(touched);
                    let tangent = t.value + t.normal.dot(c + y - touched);
                    assert!(psi >= tangent - 1e-13, "{face:?} {touched} {y}");
                    continue;
                };
                let least = beneath(&u, y);
                assert!(psi >= least - 1e-13, "{face:?} {touched} {y}");
                let plane = u.value + u.normal.dot(y);
                assert!(least >= plane - Under::dip(u.k, u.rho, d) - 1e-13);
                assert!(psi >= u.value + u.far.dot(y) - u.k * d - 1e-13);
                close += usize::from(touched == c && psi - least < 0.01 * d);
            }
        }
    }
    assert!(bent > 700 && close > 1000 && flat > 1000, "{bent} {close} {flat}");
}

#[test]
fn an_elliptic_face_is_the_image_of_a_round_one() {
    let mut r = Random(17);
    for _ in 0..2000 {
        let m = [r.vector(1.0), r.vector(1.0), r.vector(1.0)];
        let (o, x) = (r.vector(1.0), r.vector(2.0));
        let y = x - o;
        let [n, k, h] = m;
        // What the rows make a circle of, and a cone of.
        let circle = n.dot(y).hypot(k.dot(y));
        let tube = Elliptic::cylinder(o, [n, k]);
        assert!((circle - 1.0).abs() < 1e-9 || (circle < 1.0) == (tube.value(x) < 0.0), "{tube:?}");
        let cone = Elliptic::cone(o, [n, k], h);
        let level = circle - h.dot(y);
        assert!(level.abs() < 1e-9 || (level < 0.0) == (cone.value(x) < 0.0), "{cone:?}");
        // On an ellipsoid's surface, and next to it: a lower bound of the distance, no smaller than the ratio of its semi-axes.
        let ball = ellipsoid(&mut r);
        let on = ball.foot(x, ball.at(x).normal, 1.0);
        let (out, far) = (ball.at(on).unit(), r.within(0.0, 1.0));
        let psi = ball.value(on + out * far);
        assert!(psi <= far + 1e-13 && psi >= far * ball.third - 1e-13, "{ball:?}");
    }
}

#[test]
fn a_bowl_and_a_saddle_are_the_quadrics_that_they_are_made_of() {
    let mut r = Random(19);
    let mut inside = 0;
    for _ in 0..4000 {
        let (axes, o, depth) = (turned(&mut r), r.vector(1.0), r.within(0.1, 4.0));
        let (bends, g) = (DVec2::new(r.within(0.3, 2.0), r.within(0.0, 2.0)), r.within(0.3, 1.5));
        let bends = if r.unit() < 0.2 { DVec2::new(bends.x, 0.0) } else { bends };
        let kappa = if r.unit() < 0.3 { 0.0 } else { r.within(-1.0, 2.0) };
        let kappa = kappa.max(-bends.min_element());
        let x = o + r.vector(2.0);
        let y = axes.transpose() * (x - o);
        let bowl = Bowl::new(o, axes, bends, [kappa, g], depth);
        // Of a hyperboloid the other sheet lies beyond its centre at −g/κ, and so does half of an ellipsoid.
        let form = bends.x * y.x * y.x + bends.y * y.y * y.y - kappa * y.z * y.z - 2.0 * g * y.z;
        let own = kappa <= 0.0 || y.z > -g / kappa;
        let is_inside = own && form < 0.0;
        assert!(form.abs() < 1e-9 || is_inside == (bowl.value(x) < 0.0), "{bowl:?} {x}");
        let semi = DVec3::new(r.within(0.2, 0.4), r.within(0.4, 1.0), r.within(0.3, 1.5));
        let waist = Saddle::hyperboloid(o, axes, semi);
        let form = (y.truncate() / semi.truncate()).length_squared() - 1.0 - (y.z / semi.z) * (y.z / semi.z);
        assert!(form.abs() < 1e-9 || (form < 0.0) == (waist.value(x) < 0.0), "{waist:?} {x}");
        let bends = DVec2::new(r.within(0.3, 2.0), r.within(0.3, 2.0));
        let saddle = Saddle::paraboloid(o, axes, bends, depth);
        let form = bends.x * y.x * y.x - bends.y * y.y * y.y - y.z;
        assert!(form.abs() < 1e-9 || (form < 0.0) == (saddle.value(x) < 0.0), "{saddle:?} {x}");
        inside += usize::from(is_inside);
    }
    assert!(inside > 800, "{inside}");
}

#[test]
fn the_terms_of_a_face_sum_up_to_its_psi() {
    let (mut r, mut told) = (Random(11), 0);
    for _ in 0..200 {
        for face in faces(&mut r) {
            let Some(terms) = face.terms() else { continue };
            told += 1;
            let x = r.vector(3.0);
            let (psi, sum) = (face.value(x), terms.value(x));
            let known = 1e-13 * (face.magnitude() + x.length());
            assert!((psi - sum).abs() <= known, "{face:?} at {x}: {psi} {sum}");
        }
    }
    assert!(told >= 18 * 200, "{told}");
}
