//! Integrals over a solid by rays: exact along z, by the midpoint rule across. Independent of the server's way.
//!
//! Along a ray every face is a polynomial of degree two at most; between its roots the solid's value keeps its sign, which
//! one point tells. Across, the lengths are no smooth function: the rule converges with the power 1.5 or so of the
//! distance of the rays, and two rules tell how far it has come.

use contactd::math::Aabb;
use contactd::solid::{Face, Solid, surface};
use glam::DVec3;

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

fn across(v: DVec3, axis: DVec3) -> DVec3 {
    v - axis * v.dot(axis)
}
