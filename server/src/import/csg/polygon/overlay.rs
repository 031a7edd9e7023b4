//! Set operations on polygons: edges of all operands are cut at each other, and those stay that have the inside of the result on
//! one side alone.

use super::rings::{Owned, bits, cut, simple, traced};
use super::{order, turn};
use glam::DVec2;
use smallvec::SmallVec;
use std::collections::HashMap;

/// Corners are moved to a grid of this times the largest coordinate, so that edges meant to lie on each other do so to the bit.
const GRID: f64 = 1.0 / (1u64 << 40) as f64;
/// Rounds of cutting.
const ROUNDS: usize = 8;

/// The numbers of the operands that an edge is a side of.
type Among = SmallVec<[u32; 4]>;

/// Paths around what `inside` says of some operands, each filled by the even-odd rule: it is given whether a point lies in each of
/// them. `None` where edges make no closed ring.
pub fn overlay(operands: &[Vec<Vec<DVec2>>], inside: &dyn Fn(&[bool]) -> bool) -> Option<Vec<Vec<DVec2>>> {
    let largest = operands.iter().flatten().flatten().fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
    if largest == 0.0 {
        return Some(Vec::new());
    }
    // A power of two: what is short stays as it is.
    let grid = (largest * GRID).log2().ceil().exp2();
    let snap = |p: DVec2| (p / grid).round() * grid + DVec2::ZERO;
    let mut edges: Vec<Owned> = Vec::new();
    for (owner, paths) in operands.iter().enumerate() {
        for path in paths {
            let at = |i: usize| snap(path[i % path.len()]);
            let all = (0..path.len()).map(|i| ([at(i), at(i + 1)], owner));
            edges.extend(all.filter(|(e, _)| e[0] != e[1]));
        }
    }
    for _ in 0..ROUNDS {
        let before = edges.len();
        edges = cut(&edges, &snap).0;
        if edges.len() == before {
            break;
        }
    }
    let pieces = pieces(&edges);
    let columns = [false, true].map(|steep| Columns::of(&pieces, steep));
    let mut beside = vec![false; operands.len()];
    let mut is_bound = |(e, own): &&([DVec2; 2], Among)| bounds(*e, own, (&pieces, &columns), inside, &mut beside);
    let kept: Vec<[DVec2; 2]> = pieces.iter().filter(|piece| is_bound(piece)).map(|(e, _)| *e).collect();
    let (rings, open) = traced(&kept);
    (!open).then(|| simple(rings))
}

/// Every edge once, with the operands that it is a side of: those in which it is there an odd number of times.
fn pieces(edges: &[Owned]) -> Vec<([DVec2; 2], Among)> {
    let mut place: HashMap<[[u64; 2]; 2], usize> = HashMap::with_capacity(edges.len());
    let mut pieces: Vec<([DVec2; 2], Among)> = Vec::with_capacity(edges.len());
    for ([a, b], owner) in edges {
        let e = if order(*a, *b).is_lt() { [*a, *b] } else { [*b, *a] };
        let at = *place.entry(e.map(bits)).or_insert_with(|| {
            pieces.push((e, Among::new()));
            pieces.len() - 1
        });
        pieces[at].1.push(*owner as u32);
    }
    pieces.iter_mut().for_each(|(_, owners)| keep_odd(owners));
    pieces
}

/// Sorts numbers, and leaves those that are there an odd number of times, once.
fn keep_odd(numbers: &mut Among) {
    numbers.sort_unstable();
    let mut kept = 0;
    let mut i = 0;
    while i < numbers.len() {
        let same = numbers[i..].iter().take_while(|n| **n == numbers[i]).count();
        if same % 2 == 1 {
            numbers[kept] = numbers[i];
            kept += 1;
        }
        i += same;
    }
    numbers.truncate(kept);
}

/// The edges over each of some intervals of x, of y where they are taken `steep`.
struct Columns {
    from: f64,
    width: f64,
    edges: Vec<Vec<u32>>,
}

impl Columns {
    fn of(pieces: &[([DVec2; 2], Among)], steep: bool) -> Self {
        let ends = |e: &[DVec2; 2]| if steep { (e[0].y, e[1].y) } else { (e[0].x, e[1].x) };
        let spans = || pieces.iter().map(|(e, _)| ends(e));
        let (low, high) = spans()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (a, b)| (low.min(a.min(b)), high.max(a.max(b))));
        // So few that even edges over all of them take no more room than what follows takes time.
        let count = 1 + 4 * pieces.len().isqrt();
        let mut this = Self { from: low, width: (high - low) / count as f64, edges: vec![Vec::new(); count] };
        for (i, (a, b)) in spans().enumerate() {
            for k in this.column(a.min(b))..=this.column(a.max(b)) {
                this.edges[k].push(i as u32);
            }
        }
        this
    }

    fn column(&self, x: f64) -> usize {
        // What is not a number is 0.
        (((x - self.from) / self.width) as usize).min(self.edges.len() - 1)
    }
}

/// True when the result lies on one side of an edge: counted along a ray from its middle, up or, from a steep one, to the right.
/// `beside`: room for a truth of each operand.
fn bounds(
    e: [DVec2; 2],
    own: &Among,
    (pieces, columns): (&[([DVec2; 2], Among)], &[Columns; 2]),
    inside: &dyn Fn(&[bool]) -> bool,
    beside: &mut [bool],
) -> bool {
    let steep = (e[1].y - e[0].y).abs() > (e[1].x - e[0].x).abs();
    let flip = |p: DVec2| if steep { DVec2::new(p.y, p.x) } else { p };
    let middle = flip((e[0] + e[1]) * 0.5);
    beside.fill(false);
    let columns = &columns[usize::from(steep)];
    for (other, owners) in columns.edges[columns.column(middle.x)].iter().map(|i| &pieces[*i as usize]) {
        if *other == e {
            continue;
        }
        let (a, b) = (flip(other[0]), flip(other[1]));
        if (a.x > middle.x) != (b.x > middle.x) {
            let (a, b) = if a.x < b.x { (a, b) } else { (b, a) };
            if turn(a, b, middle) < 0.0 {
                owners.iter().for_each(|o| beside[*o as usize] ^= true);
            }
        }
    }
    let is_in = inside(beside);
    own.iter().for_each(|o| beside[*o as usize] ^= true);
    is_in != inside(beside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn holds(paths: &[Vec<DVec2>], p: DVec2) -> bool {
        let edges = paths.iter().flat_map(|path| (0..path.len()).map(move |i| (path[i], path[(i + 1) % path.len()])));
        let crosses =
            |(a, b): &(DVec2, DVec2)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y);
        edges.filter(crosses).count() % 2 == 1
    }

    #[test]
    fn overlays_hold_what_the_operands_say() {
        let mut r = Random(11);
        let rounds =
            std::env::var("CONTACTD_OUTLINES").ok().and_then(|n| n.parse().ok()).map_or(100, |n: usize| n.max(200));
        for round in 0..rounds {
            let operands: Vec<Vec<Vec<DVec2>>> = (0..4)
                .map(|_| {
                    let n = 3 + (r.unit() * 6.0) as usize;
                    let corner = |r: &mut Random| {
                        let p = DVec2::new(r.within(-2.0, 2.0), r.within(-2.0, 2.0));
                        // On a grid every other time: sides lie on each other.
                        if round % 2 == 0 { p.round() } else { p }
                    };
                    vec![(0..n).map(|_| corner(&mut r)).collect()]
                })
                .collect();
            let says = |m: &[bool]| (m[0] || m[1]) && !m[2] || m[3] && m[1];
            let paths = overlay(&operands, &says).expect("closed rings");
            for _ in 0..300 {
                let p = DVec2::new(r.within(-2.1, 2.1), r.within(-2.1, 2.1));
                let near = operands.iter().flatten().any(|path| {
                    (0..path.len()).any(|i| {
                        let (a, b) = (path[i], path[(i + 1) % path.len()]);
                        let along = b - a;
                        let t = ((p - a).dot(along) / along.length_squared().max(1e-300)).clamp(0.0, 1.0);
                        (a + along * t - p).length() < 1e-9
                    })
                });
                let of_each: Vec<bool> = operands.iter().map(|o| holds(o, p)).collect();
                assert!(near || holds(&paths, p) == says(&of_each), "{p}: {operands:?} gave {paths:?}");
            }
        }
    }
}
