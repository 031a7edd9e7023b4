//! Random quadrics cut by planes, and a box around one that is checked by a way of its own.

use crate::random_solids::Random;
use crate::reference::field::Image;
use contactd::math::Aabb;
use contactd::solid::primitive::quadric::Form;
use contactd::solid::primitive::{Geometry as _, Quadric};
use contactd::solid::surface::{self, Plane};
use contactd::solid::{Face, Shape};
use glam::{DMat3, DVec3};

/// Of how many kinds `of_kind` knows.
pub const KINDS: usize = 8;

/// A random quadric of size about `size`.
pub fn random(r: &mut Random, size: f64) -> Shape {
    let kind = r.below(KINDS);
    of_kind(r, size, kind)
}

/// The same as `random_solids::shape`, or a quadric, one in three.
pub fn shape_or_quadric(r: &mut Random, size: f64) -> Shape {
    if r.below(3) == 0 { random(r, size) } else { crate::random_solids::shape(r, size) }
}

/// Elliptic paraboloid and hyperboloid with one plane across, then, each in a box that leans against its axes: hyperboloid of one sheet,
/// hyperbolic paraboloid, between the branches of a hyperbolic cylinder, parabolic cylinder, one such branch, elliptic paraboloid.
pub fn of_kind(r: &mut Random, size: f64, kind: usize) -> Shape {
    loop {
        let (a, b, c) = (r.within(0.3, 1.0), r.within(0.3, 1.0), r.within(0.3, 1.0));
        // Coefficients of x², y², z² and of z, and the constant, for a size of 1.
        let (squares, z, constant) = match kind {
            0 | 7 => (DVec3::new(1.0 / (a * a), 1.0 / (b * b), 0.0), 1.0 / c, -0.4 / c),
            1 => (DVec3::new(1.0 / (a * a), 1.0 / (b * b), -1.0 / (c * c)), 2.0 * (1.0 + c) / (c * c), -1.0 - 2.0 * c),
            2 => (DVec3::new(4.0 / (a * a), 4.0 / (b * b), -1.0 / (c * c)), 0.0, -1.0),
            3 => (DVec3::new(0.7 / a, -0.7 / b, 0.0), -1.0, 0.0),
            4 => (DVec3::new(4.0 / (a * a), 0.0, -1.0 / (c * c)), 0.0, -1.0),
            5 => (DVec3::new(1.0 / (a * a), 0.0, 0.0), 1.0 / c, -0.4 / c),
            _ => (DVec3::new(1.0 / (a * a), 0.0, -1.0 / (c * c)), 2.0 * (1.0 + c) / (c * c), -1.0 - 2.0 * c),
        };
        let turn = if kind < 2 || r.chance(0.3) { DMat3::IDENTITY } else { DMat3::from_quat(r.rotation()) };
        let middle = if kind < 2 { DVec3::ZERO } else { r.vector(0.2) * size };
        // In lengths of `size`: f(x/size).
        let diagonal = turn * DMat3::from_diagonal(squares) * turn.transpose() * (1.0 / (size * size));
        let linear = turn * DVec3::Z * (0.5 * z / size);
        let form = Form {
            square: diagonal,
            linear: linear - diagonal * middle,
            constant: constant + middle.dot(diagonal * middle) - 2.0 * linear.dot(middle),
        };
        let (half, low) = if kind < 2 { (1.0, -0.6) } else { (r.within(0.4, 0.9), -r.within(0.3, 0.8)) };
        let around = Aabb { min: DVec3::new(-half, -half, low) * size, max: DVec3::new(half, half, 0.7) * size };
        if kind < 2 {
            // Up to its tip; what of it is below the plane has no bounds.
            if let Some(shape) = dome(&form, low * size) {
                return shape.into();
            }
            continue;
        }
        let Ok(found) = form.quadrics(&around) else { continue };
        let side = found.sides[r.below(found.sides.len())];
        let planes = (0..6u8).map(|k| (k, plane(&around, k))).collect();
        if let Some(shape) = Quadric::new(side, planes, around)
            && shape.smallest_dimension() > 0.05 * size
        {
            return shape.into();
        }
    }
}

/// A paraboloid about z with its tip at z = h above its rim of radius r at z = 0.
pub fn dome_of(radius: f64, height: f64) -> Quadric {
    let per = 1.0 / (radius * radius);
    let square = DMat3::from_diagonal(DVec3::new(per, per, 0.0));
    let form = Form { square, linear: DVec3::Z * (0.5 / height), constant: -1.0 };
    dome(&form, 0.0).expect("a dome")
}

/// All points of a box of these half extents with x²/a² − y²/b² <= z/c.
pub fn saddle_of(half: DVec3) -> Quadric {
    let square = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 0.0) / (half * half).with_z(1.0));
    let form = Form { square, linear: DVec3::Z * (-0.5 / half.z), constant: 0.0 };
    let around = Aabb { min: -half, max: half };
    let side = form.quadrics(&around).expect("a saddle").sides[0];
    Quadric::new(side, (0..6u8).map(|k| (k, plane(&around, k))).collect(), around).expect("an inside")
}

/// The side of a form that has a tip upwards on the z axis and begins at z = `low`.
fn dome(form: &Form, low: f64) -> Option<Quadric> {
    // The radii of its rim.
    let level = form.value(DVec3::Z * low);
    let rim = |k: usize| (-level / form.square.col(k)[k]).sqrt();
    let (a, b) = (rim(0), rim(1));
    let (z, l, c) = (form.square.z_axis.z, form.linear.z, form.constant);
    let tip = if z == 0.0 { -c / (2.0 * l) } else { -c / (l + (l * l - z * c).sqrt()) };
    if !(a.is_finite() && b.is_finite() && tip > low) {
        return None;
    }
    let around = Aabb { min: DVec3::new(-a, -b, low), max: DVec3::new(a, b, tip) };
    let middle = DVec3::Z * (0.5 * (low + tip));
    let side = form.quadrics(&around).ok()?.sides.into_iter().find(|s| s.value(middle) < 0.0)?;
    Quadric::new(side, vec![(4, plane(&around, 4))], around)
}

fn plane(around: &Aabb, k: u8) -> Plane {
    let axis = DVec3::AXES[usize::from(k / 2)];
    if k.is_multiple_of(2) {
        Plane { normal: -axis, offset: -around.min.dot(axis) }
    } else {
        Plane { normal: axis, offset: around.max.dot(axis) }
    }
}

/// Scaled about its origin.
pub fn scaled(q: &Quadric, k: f64) -> Quadric {
    let side: Face = match *q.side() {
        Face::Bowl(b) => surface::Bowl { origin: b.origin * k, radius: b.radius * k, ..b }.into(),
        Face::Saddle(s) => surface::Saddle { origin: s.origin * k, size: s.size * k, ..s }.into(),
        // Of the image of a cone the size is a ratio.
        Face::Elliptic(e) if e.is_cone() => surface::Elliptic { origin: e.origin * k, ..e }.into(),
        Face::Elliptic(e) => surface::Elliptic { origin: e.origin * k, size: e.size * k, ..e }.into(),
        ref other => panic!("no side of a quadric: {other:?}"),
    };
    let planes = q.planes().iter().map(|(n, p)| (*n, Plane { offset: p.offset * k, ..*p })).collect();
    let around = Aabb { min: q.around().min * k, max: q.around().max * k };
    Quadric::new(side, planes, around).expect("an inside as before")
}

/// A box around {f <= level} of a quadric cut by planes, in its frame; `None` where none is found.
///
/// With six planes, those of its box: x lies within all of them. A bowl with one plane n·x <= d: e·x <= λ (level + r) + μ (d + level) for
/// all λ, μ >= 0 with e = λ (Bᵀv − w) + μ n and a unit vector v, since |B y| >= v·B y (weak duality); the best μ is looked for.
pub fn checked_box(q: &Quadric, level: f64) -> Option<Aabb> {
    let (faces, level) = (q.faces(), level.max(0.0));
    match faces.as_slice() {
        [_, planes @ ..] if planes.len() == 6 => of_planes(planes, level),
        [Face::Bowl(bowl), plane] => {
            let cut = plane.flat()?;
            let far = |e: DVec3| support(bowl, cut, level, e);
            let [x, y, z] = DVec3::AXES;
            let found = Aabb { min: -DVec3::new(far(-x), far(-y), far(-z)), max: DVec3::new(far(x), far(y), far(z)) };
            found.is_finite().then_some(found)
        }
        _ => None,
    }
}

fn of_planes(planes: &[Face], level: f64) -> Option<Aabb> {
    let of = |k: usize| planes[k].flat().map(|(n, d)| (n, d + level));
    let [a, b, c] = [(0, 1), (2, 3), (4, 5)].map(|(k, l)| of(k).zip(of(l)));
    let (a, b, c) = (a?, b?, c?);
    let opposite = [&a, &b, &c].iter().all(|p| (p.0.0 + p.1.0).length() < 1e-12);
    let back = DMat3::from_cols(a.1.0, b.1.0, c.1.0).transpose().inverse();
    let mut all = Aabb::EMPTY;
    for k in 0..8u32 {
        let side = |bit: u32, pair: &((DVec3, f64), (DVec3, f64))| if k >> bit & 1 == 0 { -pair.0.1 } else { pair.1.1 };
        let corner = back * DVec3::new(side(0, &a), side(1, &b), side(2, &c));
        all = all.union(&Aabb { min: corner, max: corner });
    }
    opposite.then(|| all.grown(2e-15 * (all.max - all.min).length()))
}

/// How far a bowl that is cut by a plane reaches along e at most.
fn support(bowl: &surface::Bowl, (n, d): (DVec3, f64), level: f64, e: DVec3) -> f64 {
    let image = Image::of_bowl(bowl);
    // Of a bowl alone along w: with w = λ (Bᵀv − fall) and v a unit vector, λ (level + r) from the focus.
    let alone = |w: DVec3| {
        let own = image.turn.conjugate() * w;
        let (p, fall) = (own / image.scale, image.fall / image.scale.z);
        // |ν p + fall e₃| = 1, the larger ν = 1/λ.
        let (a, b, c) = (p.length_squared(), p.z * fall, (fall - 1.0) * (fall + 1.0));
        let under = b * b - a * c;
        let nu = ((under.max(0.0)).sqrt() - b) / a;
        if under < 0.0 || nu <= 0.0 { f64::INFINITY } else { w.dot(bowl.origin) + (bowl.radius + level) / nu }
    };
    let bound = |mu: f64| alone(e - n * mu) + mu * (d + level);
    // Convex in μ: the golden section.
    let (mut low, mut high) = (0.0, 64.0);
    for _ in 0..120 {
        let (p, q) = (high - 0.618 * (high - low), low + 0.618 * (high - low));
        if bound(p).is_finite() && bound(p) <= bound(q) { high = q } else { low = p }
    }
    let found = [0.0, low, high].map(bound).into_iter().filter(|f| f.is_finite()).fold(f64::INFINITY, f64::min);
    found + 2e-15 * (found.abs() + bowl.origin.length() + bowl.radius)
}
