//! OpenSCAD's pieces of curves: its polygons of circles, the prisms between them, its spheres.

use glam::{DVec2, DVec3};

/// The mesh between two outlines with equally many corners, counter-clockwise; an outline may shrink to one point.
pub fn prism(bottom: &[DVec2], top: &[DVec2], low: f64, high: f64) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let n = bottom.len() as u32;
    let points = bottom.iter().map(|p| p.extend(low)).chain(top.iter().map(|p| p.extend(high))).collect();
    let mut faces: Vec<Vec<u32>> = (0..n).map(|i| vec![i, n + i, n + (i + 1) % n, (i + 1) % n]).collect();
    faces.push((n..2 * n).rev().collect());
    faces.push((0..n).collect());
    (points, faces)
}

/// The corners that OpenSCAD gives a circle of `fragments` sides: the first on +x, counter-clockwise. Multiples of 30°
/// are exact, as they are in OpenSCAD.
pub fn ring(radius: f64, fragments: u32) -> Vec<DVec2> {
    (0..fragments).map(|i| turn(i, fragments) * radius).collect()
}

/// Cosine and sine of the `i`-th of `n` parts of a full turn.
pub fn turn(i: u32, n: u32) -> DVec2 {
    let h = 0.5 * 3f64.sqrt();
    let twelfths: [[f64; 2]; 12] = [
        [1.0, 0.0],
        [h, 0.5],
        [0.5, h],
        [0.0, 1.0],
        [-0.5, h],
        [-h, 0.5],
        [-1.0, 0.0],
        [-h, -0.5],
        [-0.5, -h],
        [0.0, -1.0],
        [0.5, -h],
        [h, -0.5],
    ];
    let (i, n) = (u64::from(i), u64::from(n));
    if (12 * i).is_multiple_of(n) {
        return DVec2::from_array(twelfths[(12 * i / n % 12) as usize]);
    }
    let (sin, cos) = libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
    DVec2::new(cos, sin)
}

/// Cosine and sine of an angle in degrees, those of whole degrees as exact as OpenSCAD has them.
pub fn direction(degrees: f64) -> DVec2 {
    let within = degrees.rem_euclid(360.0);
    if within.fract() == 0.0 {
        return turn(within as u32, 360);
    }
    let (sin, cos) = libm::sincos(within.to_radians());
    DVec2::new(cos, sin)
}

/// OpenSCAD's sphere: `rings` rings of `n` corners at polar angles (i + ½)·180°/rings, caps on the outermost rings.
pub fn faceted_sphere(r: f64, n: u32, rings: u32) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let mut points = Vec::with_capacity((n * rings) as usize);
    for i in 0..rings {
        let polar = turn(2 * i + 1, 4 * rings);
        points.extend(ring(r * polar.y, n).into_iter().map(|p| p.extend(r * polar.x)));
    }
    // Ring 0 is the topmost; faces clockwise from outside.
    let mut faces: Vec<Vec<u32>> = vec![(0..n).rev().collect()];
    for i in 1..rings {
        let (up, down) = ((i - 1) * n, i * n);
        faces.extend((0..n).map(|k| vec![up + k, up + (k + 1) % n, down + (k + 1) % n, down + k]));
    }
    faces.push(((rings - 1) * n..rings * n).collect());
    (points, faces)
}
