//! Integrals over a solid by rays: exact along z, by the midpoint rule across. Independent of the server's way.
//!
//! Along a ray every face is a polynomial of degree two at most, a torus' of degree four; between its roots the solid's value keeps its sign, which
//! one point tells. Across, the lengths are no smooth function: the rule converges with the power 1.5 or so of the
//! distance of the rays, and two rules tell how far it has come.

use crate::reference::field::{Ball, Image, Ridge};
use contactd::math::Aabb;
use contactd::solid::{Face, Solid, surface};
use glam::{DVec2, DVec3};

/// ∫ 1, x, y, z, xx, yy, zz, xy, xz, yz.
pub type Integrals = [f64; 10];

/// The integrals over a solid by `n`² rays within a box that holds it.
pub fn integrals(solid: &Solid, around: &Aabb, n: usize) -> Integrals {
    let (size, mut sum) = (around.max - around.min, [0.0; 10]);
    let area = size.x * size.y / (n * n) as f64;
    let mut roots = vec![];
    for i in 0..n {
        for j in 0..n {
            let x = around.min.x + size.x * (i as f64 + 0.5) / n as f64;
            let y = around.min.y + size.y * (j as f64 + 0.5) / n as f64;
            roots.clear();
            roots.extend([around.min.z, around.max.z]);
            for face in &solid.faces {
                add_roots(face, DVec3::new(x, y, 0.0), &mut roots);
            }
            roots.retain(|z| (around.min.z..=around.max.z).contains(z));
            roots.sort_by(f64::total_cmp);
            for w in roots.windows(2) {
                let (a, b) = (w[0], w[1]);
                if solid.value(DVec3::new(x, y, 0.5 * (a + b))) >= 0.0 {
                    continue;
                }
                let (l, m, q) = (b - a, (b * b - a * a) / 2.0, (b * b * b - a * a * a) / 3.0);
                let terms = [l, x * l, y * l, m, x * x * l, y * y * l, q, x * y * l, x * m, y * m];
                sum.iter_mut().zip(terms).for_each(|(s, t)| *s += t * area);
            }
        }
    }
    sum
}

/// z of the places where a face's psi is 0 on the line `at` + z e_z.
fn add_roots(face: &Face, at: DVec3, roots: &mut Vec<f64>) {
    let e = DVec3::Z;
    // c₀ + 2 c₁ z + c₂ z² = 0.
    let [c0, c1, c2] = match *face {
        Face::Plane(surface::Plane { normal, offset }) => [normal.dot(at) - offset, normal.z / 2.0, 0.0],
        Face::Sphere(surface::Sphere { center, radius }) => {
            let o = at - center;
            [o.dot(o) - radius * radius, o.dot(e), 1.0]
        }
        Face::Cylinder(surface::Cylinder { origin, axis, radius }) => {
            let (o, d) = (across(at - origin, axis), across(e, axis));
            [o.dot(o) - radius * radius, o.dot(d), d.dot(d)]
        }
        Face::Cone(surface::Cone { apex, axis, sin, cos }) => {
            // ρ² cos² = z² sin², both nappes: a root too many only divides an interval.
            let (o, d) = (across(at - apex, axis), across(e, axis));
            let (h, k) = ((at - apex).dot(axis), axis.z);
            let (c, s) = (cos * cos, sin * sin);
            [o.dot(o) * c - h * h * s, o.dot(d) * c - h * k * s, d.dot(d) * c - k * k * s]
        }
        Face::Torus(torus) => return add_roots_of_torus(&torus, at, roots),
        Face::Superellipsoid(s) => return add_roots_of_norm(&s, at, roots),
        // Of its cylinder and its balls: a root too many only divides an interval.
        Face::Capsule(surface::Capsule { origin, axis, half, radius }) => {
            for end in [half, -half] {
                add_roots(&surface::Sphere { center: origin + axis * end, radius }.into(), at, roots);
            }
            return add_roots(&surface::Cylinder { origin, axis, radius }.into(), at, roots);
        }
        Face::Saddle(s) => {
            // |P + z P'|² = |N + z N'|².
            let ridge = Ridge::of(&s);
            let e = ridge.turn.conjugate() * DVec3::Z;
            let (now, ways) = (ridge.halves(at), ridge.scales().map(|rows| DVec2::from(rows.map(|row| row.dot(e)))));
            let of = |f: &dyn Fn(usize) -> f64| f(0) - f(1);
            [of(&|k| now[k].length_squared()), of(&|k| now[k].dot(ways[k])), of(&|k| ways[k].length_squared())]
        }
        Face::Elliptic(e) => of_image(&Image::of(&e), at),
        Face::Bowl(b) => of_image(&Image::of_bowl(&b), at),
    };
    if c2.abs() < 1e-14 {
        if c1 != 0.0 {
            roots.push(-c0 / (2.0 * c1));
        }
        return;
    }
    let under = c1 * c1 - c0 * c2;
    if under >= 0.0 {
        roots.extend([(-c1 - under.sqrt()) / c2, (-c1 + under.sqrt()) / c2]);
    }
}

/// The coefficients of |p + z d|² = (h + z k)²: both nappes of a cone, both sheets of a hyperboloid.
fn of_image(i: &Image, at: DVec3) -> [f64; 3] {
    let (p, d) = (i.across(at), (i.turn.conjugate() * DVec3::Z) * i.scale);
    let (h, k) = (i.radius + i.fall * i.local(at).z, i.fall * (i.turn.conjugate() * DVec3::Z).z);
    [p.dot(p) - h * h, p.dot(d) - h * k, d.dot(d) - k * k]
}

/// The same of a torus: (|o|² + R² − r²)² = 4 R² ρ², all four complex roots at once (E. Durand, 1960; I. Kerner, 1966). A root too many
/// only divides an interval.
fn add_roots_of_torus(torus: &surface::Torus, at: DVec3, roots: &mut Vec<f64>) {
    let surface::Torus { origin, axis, major, minor } = *torus;
    let start = (origin - at).z;
    let o = at + DVec3::Z * start - origin;
    let p = across(o, axis);
    let e = across(DVec3::Z, axis);
    let w = o.dot(o) + major * major - minor * minor;
    let f = 4.0 * major * major;
    // o has no part along the ray.
    let c = [w * w - f * p.dot(p), -2.0 * f * p.dot(e), 2.0 * w - f * e.dot(e), 0.0];
    type Complex = (f64, f64);
    let times = |a: Complex, b: Complex| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
    let over = |a: Complex, b: Complex| {
        let n = b.0 * b.0 + b.1 * b.1;
        ((a.0 * b.0 + a.1 * b.1) / n, (a.1 * b.0 - a.0 * b.1) / n)
    };
    let value = |z: Complex| c.iter().rev().fold((1.0, 0.0), |v, k| (times(v, z).0 + k, times(v, z).1));
    let size = major + minor;
    let mut all: [Complex; 4] = std::array::from_fn(|k| {
        let (s, c) = (0.4 + k as f64 * 1.7).sin_cos();
        (size * c, size * s)
    });
    for _ in 0..200 {
        let mut moved = 0.0_f64;
        for i in 0..4 {
            let others = (0..4).filter(|j| *j != i);
            let product = others.fold((1.0, 0.0), |q, j| times(q, (all[i].0 - all[j].0, all[i].1 - all[j].1)));
            let step = over(value(all[i]), product);
            if step.0.is_finite() && step.1.is_finite() {
                all[i] = (all[i].0 - step.0, all[i].1 - step.1);
                moved = moved.max(step.0.hypot(step.1));
            }
        }
        if moved < 1e-15 * size {
            break;
        }
    }
    roots.extend(all.iter().filter(|z| z.1.abs() < 1e-5 * size).map(|z| start + z.0));
}

/// The same of a superellipsoid: sN is convex along the line, so its least value is found by thirds, and the two ends by halves.
fn add_roots_of_norm(face: &surface::Superellipsoid, at: DVec3, roots: &mut Vec<f64>) {
    let (ball, size) = (Ball::of(face), face.semi.length());
    let level = |z: f64| ball.length(at + DVec3::Z * z) - face.semi.min_element() * Image::WHOLE;
    let (low, high) = (face.origin.z - size, face.origin.z + size);
    let (mut a, mut b) = (low, high);
    // (2/3)^80 is 1e-14.
    for _ in 0..80 {
        let (c, d) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
        if level(c) < level(d) { b = d } else { a = c }
    }
    let middle = 0.5 * (a + b);
    if level(middle) >= 0.0 {
        return;
    }
    for mut out in [low, high] {
        let mut within = middle;
        for _ in 0..60 {
            let half = 0.5 * (out + within);
            if level(half) < 0.0 { within = half } else { out = half }
        }
        roots.push(within);
    }
}

fn across(v: DVec3, axis: DVec3) -> DVec3 {
    v - axis * v.dot(axis)
}
