//! Polygons that need not be convex: from paths to simple rings (`rings`), from a ring to a formula of half-planes (`peterson`).
//!
//! OpenSCAD fills paths by the even-odd rule. The result is some islands, each a simple ring less simple rings: an island is its
//! convex hull and, for each pocket and each hole, a monotone formula in which every edge's half-plane stands once. A pocket's
//! lid, the side of the hull that is no edge of the ring, decides nothing anywhere: beside it the pocket's formula is larger. So
//! f is 0 on the boundary alone, and negative strictly inside.

mod overlay;
mod peterson;
mod rings;
mod triangles;

pub use overlay::overlay;
pub use peterson::Formula;
pub use triangles::triangles;

use glam::DVec2;
use peterson::Effort;
use robust::{Coord, orient2d};

/// A directed edge with the inside on its left.
pub type Edge = [DVec2; 2];

/// What some paths enclose.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// Every edge of a pocket or a hole once.
    pub edges: Vec<Edge>,
    /// Parts that touch at corners at most.
    pub islands: Vec<Island>,
    /// All rings, the inside on their left.
    pub rings: Vec<Vec<DVec2>>,
    /// Corners were computed where paths cross.
    pub crossed: bool,
    /// Some edges made no closed ring: paths cross where a double cannot tell.
    pub open: bool,
    /// Formulas are missing: they would be too deep, or take too long.
    pub intricate: bool,
}

/// A ring less the rings inside of it.
#[derive(Clone, Debug)]
pub struct Island {
    /// Corners of its convex hull, counter-clockwise.
    pub hull: Vec<DVec2>,
    /// The hull has too many sides to be one shape: one of the cuts tells them, and what is around may be anything.
    pub wide: bool,
    /// Pockets and holes: each must hold.
    pub cuts: Vec<Formula>,
    /// Its ring and those inside of it, as places in the region's.
    pub rings: std::ops::Range<usize>,
}

/// What the formulas of a region take at most: some tenths of a second. A chain of n corners takes n log n looks where its formula is
/// shallow, n² where it is as deep as it has corners, as that of a spiral is.
const MOST: Effort = Effort { looks: 50_000_000, levels: MOST_LEVELS };
/// Trees are walked by recursion.
pub const MOST_LEVELS: usize = 1000;

impl Region {
    /// What closed paths enclose by the even-odd rule.
    pub fn of_paths(paths: &[Vec<DVec2>]) -> Self {
        Self::with_hulls(paths, usize::MAX)
    }

    /// The same with hulls of so many sides at most: of another island the cuts tell the sides, too.
    pub fn with_hulls(paths: &[Vec<DVec2>], most_sides: usize) -> Self {
        let rings::Loops { rings, crossed, open } = rings::loops(paths);
        let mut region = Self { crossed, open, ..Self::default() };
        let mut left = MOST;
        for nest in rings::nested(rings) {
            let first = region.rings.len();
            let rings = first..first + 1 + nest.holes.len();
            match region.island(&nest.outer, &nest.holes, most_sides, &mut left) {
                Some(island) => region.islands.push(Island { rings, ..island }),
                None => region.intricate = true,
            }
            region.rings.push(nest.outer);
            region.rings.extend(nest.holes);
        }
        region
    }

    /// The convex parts in place of everything: true when one island has no pocket and no hole.
    pub fn is_convex(&self) -> bool {
        !self.intricate && matches!(self.islands.as_slice(), [one] if one.cuts.is_empty())
    }

    /// An island; `None` where its formulas would be too deep or take too long. An edge between corners of the hull is one of its sides.
    fn island(
        &mut self,
        outer: &[DVec2],
        holes: &[Vec<DVec2>],
        most_sides: usize,
        left: &mut Effort,
    ) -> Option<Island> {
        let on_hull = corners_on_hull(outer);
        let mut island = Island { hull: Vec::new(), wide: false, cuts: Vec::new(), rings: 0..0 };
        let places: Vec<usize> = (0..outer.len()).filter(|i| on_hull[*i]).collect();
        // What lies on a side of the hull is no corner of it.
        let n = places.len();
        let corner = |k: usize| outer[places[k % n]];
        let straight = |k: &usize| turn(corner(k + n - 1), corner(*k), corner(k + 1)) == 0.0;
        island.hull = (0..n).filter(|k| !straight(k)).map(corner).collect();
        island.wide = island.hull.len() > most_sides;
        let mut sides = Vec::new();
        for (k, &from) in places.iter().enumerate() {
            let to = places[(k + 1) % places.len()];
            let count = (to + outer.len() - from - 1) % outer.len() + 1;
            let chain: Vec<DVec2> = (0..=count).map(|i| outer[(from + i) % outer.len()]).collect();
            if count > 1 {
                island.cuts.push(self.chain(&chain, left)?);
            } else if island.wide {
                sides.push(Formula::Edge(self.edges.len()));
                self.edges.push([chain[0], chain[1]]);
            }
        }
        if !sides.is_empty() {
            island.cuts.push(Formula::Many(true, sides));
        }
        for hole in holes {
            // Of a ring the other way round the left is what is outside of it: and for or, or for and.
            let first = lowest(hole);
            let around: Vec<DVec2> = (0..=hole.len()).map(|i| hole[(first + i) % hole.len()]).collect();
            let far = (0..hole.len()).max_by(|a, b| order(around[*a], around[*b])).unwrap_or(0);
            let halves = [self.chain(&around[..=far], left)?, self.chain(&around[far..], left)?];
            island.cuts.push(Formula::of_many(false, halves));
        }
        Some(island)
    }

    fn chain(&mut self, corners: &[DVec2], left: &mut Effort) -> Option<Formula> {
        let first = self.edges.len();
        self.edges.extend(corners.windows(2).map(|w| [w[0], w[1]]));
        peterson::formula(corners, first, left)
    }
}

/// Twice the area of a triangle, its sign exact: positive where the way a, b, c turns left.
pub fn turn(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// By x, then by y.
pub fn order(a: DVec2, b: DVec2) -> std::cmp::Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
}

fn lowest(ring: &[DVec2]) -> usize {
    (0..ring.len()).min_by(|a, b| order(ring[*a], ring[*b])).unwrap_or(0)
}

/// Convex hull of points, counter-clockwise, without corners on its sides (Andrew's monotone chain).
pub fn convex_hull(points: &[DVec2]) -> Vec<DVec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| order(*a, *b));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let half = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter().copied());
    hull.extend(half(&mut sorted.iter().rev().copied()));
    hull
}

/// Which corners of a simple ring, counter-clockwise, lie on its convex hull, sides included.
fn corners_on_hull(ring: &[DVec2]) -> Vec<bool> {
    let hull = convex_hull(ring);
    let mut on = vec![false; ring.len()];
    let Some(start) = hull.first().and_then(|h| ring.iter().position(|p| p == h)) else { return on };
    // The hull's corners come in the ring's order: one walk around both.
    let mut side = 0;
    for k in 0..ring.len() {
        let i = (start + k) % ring.len();
        let (from, to) = (hull[side], hull[(side + 1) % hull.len()]);
        on[i] = turn(from, to, ring[i]) == 0.0;
        if ring[i] == to {
            side = (side + 1) % hull.len();
            on[i] = true;
        }
    }
    on
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn below(r: &mut Random, n: usize) -> usize {
        (r.unit() * n as f64) as usize
    }

    /// f of a region: the hull's sides and the cuts of the best island.
    fn value(region: &Region, p: DVec2) -> f64 {
        let plane = |[a, b]: Edge| {
            let t = (b - a).normalize();
            (p - a).dot(DVec2::new(t.y, -t.x))
        };
        let one = |island: &Island| {
            let n = island.hull.len();
            let sides = if island.wide { 0 } else { n };
            let hull = (0..sides).map(|i| plane([island.hull[i], island.hull[(i + 1) % n]]));
            let cuts = island.cuts.iter().map(|f| f.value(&mut |e| plane(region.edges[e])));
            hull.chain(cuts).fold(f64::NEG_INFINITY, f64::max)
        };
        region.islands.iter().map(one).fold(f64::INFINITY, f64::min)
    }

    fn even_odd(paths: &[Vec<DVec2>], p: DVec2) -> bool {
        let crossings = paths.iter().flat_map(|path| {
            let n = path.len();
            (0..n).map(move |i| (path[i], path[(i + 1) % n]))
        });
        crossings
            .filter(|(a, b)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y))
            .count()
            % 2
            == 1
    }

    fn distance(paths: &[Vec<DVec2>], p: DVec2) -> f64 {
        let mut least = f64::INFINITY;
        for path in paths {
            for i in 0..path.len() {
                let (a, b) = (path[i], path[(i + 1) % path.len()]);
                let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                least = least.min((a + (b - a) * t - p).length());
            }
        }
        least
    }

    /// A simple ring: star-shaped, or a comb, or a spiral.
    fn random_ring(r: &mut Random) -> Vec<DVec2> {
        let n = 4 + below(r, 40);
        match below(r, 3) {
            0 => (0..n)
                .map(|i| {
                    let (s, c) = libm::sincos(std::f64::consts::TAU * (i as f64 + r.within(0.0, 0.9)) / n as f64);
                    DVec2::new(c, s) * r.within(0.2, 2.0)
                })
                .collect(),
            1 => {
                let tops = (0..n).map(|i| DVec2::new(2.0 - 4.0 * i as f64 / n as f64, r.within(0.1, 2.0)));
                [DVec2::new(-2.0, -1.0), DVec2::new(2.0, -1.0)].into_iter().chain(tops).collect()
            }
            _ => {
                let arm = |width: f64| {
                    (0..n).map(move |i| {
                        let (s, c) = libm::sincos(0.45 * i as f64);
                        DVec2::new(c, s) * (0.4 + 0.05 * i as f64 + width)
                    })
                };
                arm(0.2).chain(arm(0.0).collect::<Vec<_>>().into_iter().rev()).collect()
            }
        }
    }

    fn agrees(paths: &[Vec<DVec2>], r: &mut Random, count: usize) {
        // With the hulls of its islands as one shape, or without.
        let most_sides = if below(r, 2) == 0 { usize::MAX } else { 3 };
        let region = Region::with_hulls(paths, most_sides);
        assert!(region.islands.iter().all(|i| i.wide == (i.hull.len() > most_sides)));
        for _ in 0..count {
            let p = DVec2::new(r.within(-3.0, 3.0), r.within(-3.0, 3.0));
            let (f, away) = (value(&region, p), distance(paths, p));
            if away > 1e-9 {
                assert_eq!(f < 0.0, even_odd(paths, p), "{p} of {paths:?}: f {f}, {away} away");
                assert!(f.abs() <= away * (1.0 + 1e-9), "{p}: |f| {f}, {away} away");
                assert!(f.abs() > 1e-3 * away, "a seam at {p} of {paths:?}: f {f}, {away} away");
            }
        }
    }

    #[test]
    fn formulas_say_what_the_even_odd_rule_says_without_seams() {
        let mut r = Random(7);
        let rounds =
            std::env::var("CONTACTD_OUTLINES").ok().and_then(|n| n.parse().ok()).map_or(160, |n: usize| n.max(400));
        for _ in 0..rounds {
            let mut ring = random_ring(&mut r);
            if below(&mut r, 2) == 0 {
                ring.reverse();
            }
            agrees(&[ring], &mut r, 400);
        }
    }

    #[test]
    fn holes_and_islands_in_holes_are_told_apart() {
        let mut r = Random(8);
        for _ in 0..100 {
            let ring = |size: f64, r: &mut Random| -> Vec<DVec2> {
                let n = 3 + below(r, 12);
                let at = |i: usize| libm::sincos(std::f64::consts::TAU * i as f64 / n as f64);
                (0..n).map(|i| DVec2::new(at(i).1, at(i).0) * size * r.within(0.75, 1.0)).collect()
            };
            let paths: Vec<Vec<DVec2>> = [2.9, 1.0, 0.2].map(|size| ring(size, &mut r)).into();
            agrees(&paths, &mut r, 300);
        }
    }

    #[test]
    fn paths_that_touch_or_cross_themselves_are_filled_by_the_even_odd_rule() {
        let mut r = Random(9);
        let p = |list: &[[f64; 2]]| -> Vec<DVec2> { list.iter().map(|p| DVec2::from_array(*p)).collect() };
        let bow = p(&[[-2., -1.], [2., 1.], [2., -1.], [-2., 1.]]);
        assert!(Region::of_paths(std::slice::from_ref(&bow)).crossed);
        agrees(&[bow], &mut r, 2000);
        let star: Vec<DVec2> = (0..5)
            .map(|i| {
                let (s, c) = libm::sincos(std::f64::consts::TAU * 2.0 * f64::from(i) / 5.0);
                DVec2::new(c, s) * 2.0
            })
            .collect();
        agrees(&[star], &mut r, 2000);
        // A ring whose hole hangs on a bridge, there and back.
        let bridged = p(&[
            [-2., -2.],
            [2., -2.],
            [2., 0.],
            [1., 0.],
            [0., -1.],
            [-1., 0.],
            [0., 1.],
            [1., 0.],
            [2., 0.],
            [2., 2.],
            [-2., 2.],
        ]);
        let region = Region::of_paths(std::slice::from_ref(&bridged));
        assert_eq!((region.islands.len(), region.islands[0].cuts.len(), region.crossed), (1, 1, false));
        for at in [DVec2::new(1.5, 0.0), DVec2::new(1.2, 0.001)] {
            assert!(value(&region, at) < -0.1, "no seam along the bridge");
        }
        // Squares that share a corner, and squares that share a side: the side is gone.
        let square = |x: f64, y: f64| p(&[[x, y], [x + 1., y], [x + 1., y + 1.], [x, y + 1.]]);
        agrees(&[square(0., 0.), square(1., 1.)], &mut r, 2000);
        let joined = Region::of_paths(&[square(0., 0.), square(1., 0.)]);
        assert!(joined.is_convex() && value(&joined, DVec2::new(1.0, 0.5)) == -0.5);
        // Spikes, repeated corners and what has no area are gone.
        let spiked = p(&[[0., 0.], [0., 0.], [2., 0.], [1., 0.], [1., 1.], [1., 3.], [1., 1.], [0., 1.]]);
        assert!(Region::of_paths(&[spiked]).is_convex());
        assert!(Region::of_paths(&[p(&[[0., 0.], [1., 1.], [2., 2.]])]).islands.is_empty());
    }
}
