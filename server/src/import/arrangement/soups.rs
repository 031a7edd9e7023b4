//! Random meshes.

use crate::math::random::Random;
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// Points and faces of a closed mesh, counter-clockwise as seen from outside.
#[derive(Clone, Debug, Default)]
pub struct Soup {
    /// Its corners.
    pub points: Vec<DVec3>,
    /// Of each face the numbers of its corners.
    pub faces: Vec<Vec<u32>>,
}

impl Soup {
    /// Both as one mesh.
    pub fn with(mut self, other: &Soup) -> Self {
        let first = self.points.len() as u32;
        self.points.extend(&other.points);
        self.faces.extend(other.faces.iter().map(|f| f.iter().map(|i| i + first).collect::<Vec<u32>>()));
        self
    }

    /// The other way round.
    pub fn reversed(mut self) -> Self {
        self.faces.iter_mut().for_each(|f| f.reverse());
        self
    }

    /// With its points elsewhere.
    pub fn mapped(mut self, to: impl Fn(DVec3) -> DVec3) -> Self {
        self.points.iter_mut().for_each(|p| *p = to(*p));
        self
    }

    /// The triangles that its faces are fans of.
    pub fn triangles(&self) -> Vec<[DVec3; 3]> {
        let fan = |f: &Vec<u32>| (1..f.len() - 1).map(|i| [f[0], f[i], f[i + 1]]).collect::<Vec<_>>();
        self.faces.iter().flat_map(fan).map(|t| t.map(|i| self.points[i as usize])).collect()
    }

    /// The rings of a tube as a closed mesh of triangles.
    pub fn tube(rings: &[Vec<DVec3>]) -> Self {
        let n = rings[0].len() as u32;
        let mut faces = vec![(0..n).rev().collect::<Vec<u32>>()];
        for k in 0..rings.len() as u32 - 1 {
            for i in 0..n {
                let [a, b] = [k * n + i, k * n + (i + 1) % n];
                faces.extend([vec![a, b, b + n], vec![a, b + n, a + n]]);
            }
        }
        let last = (rings.len() as u32 - 1) * n;
        faces.push((last..last + n).collect());
        // Ends as triangles: those of a ring need not be flat.
        let fan = |f: Vec<u32>| (1..f.len() - 1).map(|i| vec![f[0], f[i], f[i + 1]]).collect::<Vec<_>>();
        Self { points: rings.concat(), faces: faces.into_iter().flat_map(fan).collect() }
    }
}

/// A box.
pub fn cuboid(low: DVec3, high: DVec3) -> Soup {
    let at = |x: f64, y: f64, z: f64| low + (high - low) * DVec3::new(x, y, z);
    let ring = |z: f64| vec![at(0.0, 0.0, z), at(1.0, 0.0, z), at(1.0, 1.0, z), at(0.0, 1.0, z)];
    Soup::tube(&[ring(0.0), ring(1.0)])
}

/// A regular prism about z.
pub fn prism(n: u32, r: f64, h: f64) -> Soup {
    let at = |i: u32, z: f64| {
        let (y, x) = libm::sincos(TAU * f64::from(i) / f64::from(n));
        DVec3::new(r * x, r * y, z)
    };
    Soup::tube(&[0.0, h].map(|z| (0..n).map(|i| at(i, z)).collect()))
}

/// A tetrahedron, the right way round.
pub fn tetrahedron(corners: [DVec3; 4]) -> Soup {
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|f| f.to_vec()).to_vec();
    let [a, b, c, d] = corners;
    let soup = Soup { points: corners.to_vec(), faces };
    if (b - a).cross(c - a).dot(d - a) < 0.0 { soup.reversed() } else { soup }
}

/// A ball's triangles with random radii, one corner of which is pushed through the other side.
pub fn star(r: &mut Random, rings: u32) -> Soup {
    let turn = 2 * rings;
    let at = |k: u32, i: u32, radius: f64| {
        let (z, up) = libm::sincos(PI * (f64::from(k) / f64::from(rings) - 0.5));
        let (y, x) = libm::sincos(TAU * f64::from(i) / f64::from(turn));
        DVec3::new(x * up, y * up, z) * radius
    };
    let mut points = vec![at(0, 0, 1.0)];
    for k in 1..rings {
        points.extend((0..turn).map(|i| at(k, i, r.within(0.6, 1.4))));
    }
    points.push(at(rings, 0, 1.0));
    let id = |k: u32, i: u32| if k == 0 { 0 } else { 1 + (k - 1) * turn + i % turn };
    let top = points.len() as u32 - 1;
    let mut faces = Vec::new();
    for i in 0..turn {
        faces.push(vec![0, id(1, i + 1), id(1, i)]);
        faces.push(vec![top, id(rings - 1, i), id(rings - 1, i + 1)]);
        for k in 1..rings - 1 {
            let [a, b, c, d] = [id(k, i), id(k, i + 1), id(k + 1, i + 1), id(k + 1, i)];
            faces.extend([vec![a, b, c], vec![a, c, d]]);
        }
    }
    let pushed = (r.unit() * f64::from(top)) as usize;
    points[pushed] *= -r.within(0.5, 2.0);
    Soup { points, faces }
}

/// A polygon swept along a helix whose turns overlap.
pub fn helix(r: &mut Random, per_turn: u32) -> Soup {
    let (sides, turns, size) = (3 + (r.unit() * 4.0) as u32, 1.2 + r.unit(), r.within(0.3, 0.5));
    let (rise, lean) = (r.within(0.2, 0.5), r.within(0.0, 1.0));
    let count = (turns * f64::from(per_turn)) as u32;
    let ring = |k: u32| {
        let around = TAU * f64::from(k) / f64::from(per_turn);
        let (s, c) = libm::sincos(around);
        let corner = |i: u32| {
            let (y, x) = libm::sincos(TAU * f64::from(i) / f64::from(sides) + lean);
            let out = 1.0 + size * x;
            DVec3::new(out * c, out * s, rise * around / TAU + size * y)
        };
        (0..sides).rev().map(corner).collect::<Vec<_>>()
    };
    Soup::tube(&(0..=count).map(ring).collect::<Vec<_>>())
}

fn turn(r: &mut Random) -> DQuat {
    DQuat::from_xyzw(r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(-1.0, 1.0), r.within(0.1, 1.0)).normalize()
}

/// Solids in a heap as one mesh, some of them inside out: placed at random or on a grid of whole numbers.
pub fn heap(r: &mut Random, on_grid: bool) -> Soup {
    let mut all = Soup::default();
    for _ in 0..2 + (r.unit() * 3.0) as usize {
        let mut one = if on_grid {
            let whole = |r: &mut Random, to: f64| DVec3::from(r.vector(to).to_array().map(libm::round));
            let low = whole(r, 2.0);
            match r.unit() < 0.6 {
                true => cuboid(low, low + DVec3::ONE + whole(r, 1.0).abs()),
                false => loop {
                    let corners = [low, low + whole(r, 3.0), low + whole(r, 3.0), low + whole(r, 3.0)];
                    let [a, b, c, d] = corners;
                    if (b - a).cross(c - a).dot(d - a) != 0.0 {
                        break tetrahedron(corners);
                    }
                },
            }
        } else {
            let one = match (r.unit() * 3.0) as u32 {
                0 => cuboid(-r.vector(1.0).abs() - 0.1, r.vector(1.0).abs() + 0.1),
                1 => tetrahedron([0; 4].map(|_| r.vector(1.5))),
                _ => prism(3 + (r.unit() * 5.0) as u32, r.within(0.3, 1.0), r.within(0.3, 2.0)),
            };
            let (turn, by) = (turn(r), r.vector(0.8));
            one.mapped(|p| turn * p + by)
        };
        if r.unit() < 0.2 {
            one = one.reversed();
        }
        all = all.with(&one);
    }
    all
}

/// A box by two of its corners.
type Place = (DVec3, DVec3);

/// Where the k-th of some parts is, on a grid of whole numbers: apart of all others, within one of them, with a part of a face, an edge
/// or a corner in common, or anywhere.
fn place(r: &mut Random, k: usize, stands: u32, boxes: &mut Vec<Place>) -> Place {
    let whole =
        |r: &mut Random, low: f64, high: f64| DVec3::from([0; 3].map(|_| libm::floor(r.within(low, high + 1.0))));
    let (low, high) = boxes[(r.unit() * boxes.len() as f64) as usize];
    // What is apart of one or within it has a place of its own there.
    let apart = 100.0 * f64::from(1 << k);
    let within = low + 1.0 + 6.0 * (k as f64 - 1.0);
    match stands {
        0 => {
            let low = low + DVec3::X * apart;
            (low, low + whole(r, 4.0, 32.0))
        }
        1 if k == 1 && r.unit() < 0.5 => {
            // What is within the outer one then is within both.
            boxes.clear();
            (low + 1.0, high - 1.0)
        }
        1 if within.cmplt(high - 2.0).all() => (within, (within + whole(r, 1.0, 5.0)).min(high - 1.0)),
        2 => {
            let axis = (r.unit() * 3.0) as usize;
            let mut from = low + 4.0 * whole(r, -3.0, 3.0);
            from[axis] = high[axis];
            (from, from + whole(r, 2.0, 20.0))
        }
        3 => {
            let from = whole(r, -20.0, 10.0);
            (from, from + whole(r, 4.0, 32.0))
        }
        _ => (low - apart, low - apart + whole(r, 4.0, 32.0)),
    }
}

/// Parts either way round, the first one a box, that stand apart of each other, within each other or touch; with `crossing` anywhere,
/// too. On a grid of whole numbers, or turned as a whole where they neither touch nor cross.
pub fn shells(r: &mut Random, crossing: bool) -> Soup {
    let is_turned = !crossing && r.unit() < 0.5;
    let ways = match (crossing, is_turned) {
        (true, _) => 4.0,
        (false, true) => 2.0,
        (false, false) => 3.0,
    };
    let first = (DVec3::splat(-16.0), DVec3::splat(16.0));
    let (mut boxes, mut all) = (Vec::new(), Soup::default());
    for k in 0..2 + (r.unit() * 4.0) as usize {
        let stands = (r.unit() * ways) as u32;
        let (low, high) = if k == 0 { first } else { place(r, k, stands, &mut boxes) };
        let fitted = |p: DVec3| low + (high - low) * (p + DVec3::new(0.5, 0.5, 0.0));
        let one = match (r.unit() * 8.0) as u32 {
            5 if !boxes.is_empty() => tetrahedron([low, low.with_x(high.x), low.with_y(high.y), high]),
            6 if !boxes.is_empty() => prism(5, 0.5, 1.0).mapped(fitted),
            // So many facets that their formula is divided.
            7 if !boxes.is_empty() && !crossing && r.unit() < 0.2 => prism(300, 0.5, 1.0).mapped(fitted),
            _ => {
                boxes.push((low, high));
                cuboid(low, high)
            }
        };
        all = all.with(&if r.unit() < 0.5 { one.reversed() } else { one });
    }
    let turn = turn(r);
    all.mapped(|p| if is_turned { turn * p } else { p })
}
