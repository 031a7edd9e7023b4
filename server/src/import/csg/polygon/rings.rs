//! Closed paths as simple rings under the even-odd rule.
//!
//! Edges are cut where they touch or cross; of edges that lie on each other pairs cancel; what is left has an even number of
//! edges at every corner and is traced into rings that touch at corners at most. Whether edges cross is decided exactly
//! (`robust`); only the corner of a crossing is rounded, and told (`crossed`).

use super::{order, turn};
use glam::DVec2;
use std::collections::HashMap;

type Ring = Vec<DVec2>;

/// An outer ring, counter-clockwise, and its holes, clockwise.
pub struct Nest {
    /// The outer ring.
    pub outer: Ring,
    /// Rings inside of it.
    pub holes: Vec<Ring>,
}

/// Rounds of cutting: a rounded crossing may move an edge over a corner next to it.
const ROUNDS: usize = 8;

/// Simple rings.
#[derive(Default)]
pub struct Loops {
    /// They touch at corners at most; either way round.
    pub rings: Vec<Ring>,
    /// Corners had to be computed.
    pub crossed: bool,
    /// Some edges made no closed ring.
    pub open: bool,
}

/// Simple rings with the even-odd inside of some closed paths.
pub fn loops(paths: &[Ring]) -> Loops {
    let mut edges: Vec<[DVec2; 2]> = Vec::new();
    for path in paths {
        // Adding 0 turns -0 into 0.
        let at = |i: usize| path[i % path.len()] + DVec2::ZERO;
        edges.extend((0..path.len()).map(|i| [at(i), at(i + 1)]).filter(|[a, b]| a != b));
    }
    let mut crossed = false;
    for _ in 0..ROUNDS {
        let owned: Vec<Owned> = edges.iter().map(|e| (*e, 0)).collect();
        let (cut, computed) = cut(&owned, &|p| p);
        crossed |= computed;
        let same = cut.len() == edges.len();
        edges = odd(cut.into_iter().map(|e| e.0).collect());
        if same {
            break;
        }
    }
    let (rings, open) = traced(&edges);
    Loops { rings: simple(rings), crossed, open }
}

/// Rings that come through a corner once, without corners on straight lines.
pub fn simple(rings: Vec<Ring>) -> Vec<Ring> {
    rings.into_iter().flat_map(split_at_repeats).filter_map(without_straight).collect()
}

/// The bits of a point, to find it by.
pub fn bits(p: DVec2) -> [u64; 2] {
    p.to_array().map(f64::to_bits)
}

/// An edge and whose it is.
pub type Owned = ([DVec2; 2], usize);

/// Cuts edges where they touch or cross, at corners as `snap` has them; true when a corner was computed.
pub fn cut(edges: &[Owned], snap: &dyn Fn(DVec2) -> DVec2) -> (Vec<Owned>, bool) {
    let mut sorted: Vec<usize> = (0..edges.len()).collect();
    let low = |e: usize| edges[e].0[0].x.min(edges[e].0[1].x);
    sorted.sort_by(|a, b| low(*a).total_cmp(&low(*b)));
    let mut cuts: Vec<Vec<DVec2>> = vec![Vec::new(); edges.len()];
    let mut computed = false;
    for (k, &i) in sorted.iter().enumerate() {
        let [a, b] = edges[i].0;
        let right = a.x.max(b.x);
        for &j in &sorted[k + 1..] {
            let [c, d] = edges[j].0;
            if c.x.min(d.x) > right {
                break;
            }
            if a.y.max(b.y) < c.y.min(d.y) || c.y.max(d.y) < a.y.min(b.y) {
                continue;
            }
            let (of_c, of_d) = (turn(a, b, c), turn(a, b, d));
            let (of_a, of_b) = (turn(c, d, a), turn(c, d, b));
            if of_c * of_d < 0.0 && of_a * of_b < 0.0 {
                let at = snap(c + (d - c) * (of_c / (of_c - of_d)));
                cuts[i].push(at);
                cuts[j].push(at);
                computed = true;
                continue;
            }
            for (on, p, q, r, edge) in [(of_c, a, b, c, i), (of_d, a, b, d, i), (of_a, c, d, a, j), (of_b, c, d, b, j)]
            {
                if on == 0.0 && (r - p).dot(r - q) < 0.0 {
                    cuts[edge].push(r);
                }
            }
        }
    }
    let mut out = Vec::with_capacity(edges.len());
    for (([a, b], owner), mut at) in edges.iter().copied().zip(cuts) {
        at.sort_by(|p, q| (*p - a).length_squared().total_cmp(&(*q - a).length_squared()));
        let corners: Vec<DVec2> = std::iter::once(a).chain(at).chain(std::iter::once(b)).collect();
        out.extend(corners.windows(2).filter(|w| w[0] != w[1]).map(|w| ([w[0], w[1]], owner)));
    }
    (out, computed)
}

/// The edges that are there an odd number of times, whichever way they run, in their order.
fn odd(edges: Vec<[DVec2; 2]>) -> Vec<[DVec2; 2]> {
    let key = |[a, b]: [DVec2; 2]| if order(a, b).is_lt() { [bits(a), bits(b)] } else { [bits(b), bits(a)] };
    let mut counts: HashMap<[[u64; 2]; 2], usize> = HashMap::with_capacity(edges.len());
    edges.iter().for_each(|e| *counts.entry(key(*e)).or_default() += 1);
    let mut kept = Vec::with_capacity(edges.len());
    for e in edges {
        if let Some(count) = counts.get_mut(&key(e)) {
            if *count % 2 == 1 {
                kept.push(e);
            }
            *count = 0;
        }
    }
    kept
}

/// Closed rings of all edges, each edge once; at a corner of several the next one counter-clockwise goes on, so no two cross. True
/// where some make no closed ring.
pub fn traced(edges: &[[DVec2; 2]]) -> (Vec<Ring>, bool) {
    let mut at: HashMap<[u64; 2], Vec<(usize, usize)>> = HashMap::with_capacity(edges.len());
    for (e, ends) in edges.iter().enumerate() {
        (0..2).for_each(|k| at.entry(bits(ends[k])).or_default().push((e, k)));
    }
    for (_, around) in at.iter_mut() {
        let angle = |(e, k): &(usize, usize)| {
            let d = edges[*e][1 - k] - edges[*e][*k];
            libm::atan2(d.y, d.x)
        };
        around.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    }
    let mut used = vec![false; edges.len()];
    let (mut rings, mut open) = (Vec::new(), false);
    for start in 0..edges.len() {
        if used[start] {
            continue;
        }
        let (mut ring, mut e, mut k) = (Vec::new(), start, 0);
        loop {
            used[e] = true;
            ring.push(edges[e][k]);
            let end = edges[e][1 - k];
            if end == edges[start][0] {
                rings.push(ring);
                break;
            }
            let around = &at[&bits(end)];
            let here = around.iter().position(|o| *o == (e, 1 - k)).unwrap_or(0);
            let next = (1..around.len()).map(|i| around[(here + i) % around.len()]).find(|(o, _)| !used[*o]);
            // An odd number of edges at a corner: no ring goes through it.
            let Some(next) = next else {
                open = true;
                break;
            };
            (e, k) = next;
        }
    }
    (rings, open)
}

/// A ring that comes through a corner more than once, as rings that do so once.
fn split_at_repeats(ring: Ring) -> Vec<Ring> {
    let mut open: Ring = Vec::with_capacity(ring.len());
    let mut place: HashMap<[u64; 2], usize> = HashMap::new();
    let mut out = Vec::new();
    for p in ring {
        if let Some(&from) = place.get(&bits(p)) {
            let closed: Ring = open.split_off(from);
            closed.iter().for_each(|q| _ = place.remove(&bits(*q)));
            out.push(closed);
        }
        place.insert(bits(p), open.len());
        open.push(p);
    }
    out.push(open);
    out
}

/// A ring without corners on straight lines; `None` where no area is left.
fn without_straight(mut ring: Ring) -> Option<Ring> {
    loop {
        let n = ring.len();
        if n < 3 {
            return None;
        }
        let bent = |i: usize| turn(ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]) != 0.0;
        let kept: Ring = (0..n).filter(|i| bent(*i)).map(|i| ring[i]).collect();
        if kept.len() == n {
            return Some(ring);
        }
        ring = kept;
    }
}

/// Twice the area, positive counter-clockwise.
fn area(ring: &[DVec2]) -> f64 {
    let n = ring.len();
    (0..n).map(|i| (ring[i] - ring[0]).perp_dot(ring[(i + 1) % n] - ring[0])).sum()
}

/// Whether a point lies in a ring; on it, either way.
fn holds(ring: &[DVec2], p: DVec2) -> bool {
    let n = ring.len();
    let crosses = |i: usize| {
        let (a, b) = (ring[i], ring[(i + 1) % n]);
        (a.y > p.y) != (b.y > p.y) && (turn(a, b, p) > 0.0) == (b.y > a.y)
    };
    (0..n).filter(|i| crosses(*i)).count() % 2 == 1
}

/// Rings that do not cross, as islands: those within an even number of others, less the next ones inside.
pub fn nested(mut loops: Vec<Ring>) -> Vec<Nest> {
    let inside = |inner: &Ring, outer: &Ring| {
        let corner = inner.iter().find(|p| !outer.contains(p));
        holds(outer, corner.copied().unwrap_or((inner[0] + inner[1]) * 0.5))
    };
    let around: Vec<Vec<usize>> = (0..loops.len())
        .map(|i| (0..loops.len()).filter(|j| *j != i && inside(&loops[i], &loops[*j])).collect())
        .collect();
    for (ring, others) in loops.iter_mut().zip(&around) {
        if (area(ring) > 0.0) != others.len().is_multiple_of(2) {
            ring.reverse();
        }
    }
    let mut nests = Vec::new();
    for (i, ring) in loops.iter().enumerate().filter(|(i, _)| around[*i].len().is_multiple_of(2)) {
        let depth = around[i].len() + 1;
        let own = |j: &usize| around[*j].len() == depth && around[*j].contains(&i);
        let holes = (0..loops.len()).filter(own).map(|j| loops[j].clone()).collect();
        nests.push(Nest { outer: ring.clone(), holes });
    }
    nests
}
