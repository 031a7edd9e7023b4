//! On which of the literals that pass through a point f depends there.
//!
//! Along a direction d each literal grows by g·d at first, g its gradient, and f by the same minimum and maximum of these
//! slopes. Which literal that is depends on the slopes' order alone, and the order changes only across the planes
//! (g_i − g_j)·d = 0. So one direction of each cell of the arrangement of these planes tells all. Every cell reaches to a
//! line in which two of them meet (where they have a line in common, all of them do): the directions beside each such
//! line, one between each two neighbours of the planes through it, are at least one of each cell.
//!
//! That is more than which truths of the literals the expression depends on: of two faces of a subtracted prism one may
//! decide only where another face of the body, which the same directions leave, has decided before.

use crate::solid::local::{self, Expression, LiteralId, Token};
use glam::DVec3;
use smallvec::SmallVec;

/// The literals active on a side, in order.
pub type Literals = SmallVec<[LiteralId; 8]>;

/// Gradients closer than this are of one tangent plane.
pub(super) const ONE_PLANE: f64 = 1e-9;

/// Most tangent planes at a point of which it is worked out on which of them f depends.
const MOST_PLANES: usize = 8;

/// Sine of the angle between two planes that are one.
const PARALLEL: f64 = 1e-9;

/// A literal is moved by this part of the least difference between two slopes, to see whether f follows.
const MOVED: f64 = 1e-3;

/// The literals that an open expression depends on, those of one gradient taken for one. `gradient` is that of a literal
/// at the point; `has_apex`: one of them has none there.
pub(super) fn active(open: &[Token], gradient: impl Fn(LiteralId) -> DVec3, has_apex: bool) -> Literals {
    let mut ids: Literals = local::literals(open).collect();
    ids.sort_unstable();
    ids.dedup();
    // Of literals that are all alternatives, or all demanded, none can be left out.
    if is_flat(open) {
        return ids;
    }
    let mut gradients: SmallVec<[DVec3; MOST_PLANES]> = SmallVec::new();
    let plane_of = ids
        .iter()
        .map(|id| {
            let g = gradient(*id);
            gradients.iter().position(|p| (*p - g).length() <= ONE_PLANE).unwrap_or_else(|| {
                gradients.push(g);
                gradients.len() - 1
            })
        })
        .collect();
    if gradients.len() > MOST_PLANES {
        return ids;
    }
    let planes = Planes { open, ids: &ids, plane_of, gradients };
    let kept = if has_apex { planes.by_truths() } else { planes.by_slopes() };
    if kept.is_empty() { ids } else { kept }
}

/// The literals of an open expression by their tangent planes.
struct Planes<'e> {
    open: &'e [Token],
    /// In order, each once.
    ids: &'e [LiteralId],
    /// One each.
    plane_of: SmallVec<[usize; 8]>,
    /// One for each plane.
    gradients: SmallVec<[DVec3; MOST_PLANES]>,
}

impl Planes<'_> {
    fn plane(&self, id: LiteralId) -> usize {
        self.plane_of[self.ids.binary_search(&id).expect("a literal of the expression")]
    }

    fn of_plane(&self, k: usize) -> impl Iterator<Item = LiteralId> + '_ {
        self.ids.iter().zip(&self.plane_of).filter(move |(_, p)| **p == k).map(|(id, _)| *id)
    }

    /// The literals with which f changes along some direction when one of them alone is moved a little. Where in a plane
    /// that decides each is kept by the others, all of it count.
    fn by_slopes(&self) -> Literals {
        let (mut decides, mut kept) =
            (SmallVec::<[bool; MOST_PLANES]>::from_elem(false, self.gradients.len()), Literals::new());
        for d in cells(&self.gradients) {
            let slopes: SmallVec<[f64; MOST_PLANES]> = self.gradients.iter().map(|g| g.dot(d)).collect();
            let apart = least_difference(&slopes);
            let now = value(self.open, &|id| slopes[self.plane(id)]);
            let Some(k) = slopes.iter().position(|s| *s == now).filter(|_| apart > 0.0) else { continue };
            decides[k] = true;
            for own in self.of_plane(k) {
                let moved = |by: f64| value(self.open, &|id| slopes[self.plane(id)] + if id == own { by } else { 0.0 });
                let by = MOVED * apart.min(1.0);
                if !kept.contains(&own) && [by, -by].into_iter().any(|by| moved(by) != now) {
                    kept.push(own);
                }
            }
        }
        self.with_whole_planes(|k| decides[k], kept)
    }

    /// The same by truths alone, which an apex' face has where it has no slope: more than there are.
    fn by_truths(&self) -> Literals {
        let worlds = || 0..1usize << self.gradients.len();
        let table: Vec<bool> = worlds().map(|w| holds(self.open, &|id| w >> self.plane(id) & 1 == 1)).collect();
        let depends = |k: usize| worlds().any(|w| w >> k & 1 == 0 && table[w] != table[w | 1 << k]);
        // Of the faces in one plane those count that decide when they are the first or the last of it.
        let alone = |own: LiteralId| {
            worlds().any(|w| table[w] != holds(self.open, &|id| (w >> self.plane(id) & 1 == 1) != (id == own)))
        };
        let planes: SmallVec<[bool; MOST_PLANES]> = (0..self.gradients.len()).map(depends).collect();
        let kept = self.ids.iter().zip(&self.plane_of).filter(|(id, k)| planes[**k] && alone(**id));
        self.with_whole_planes(|k| planes[k], kept.map(|(id, _)| *id).collect())
    }

    /// Some literals, and all of each plane that decides without one of them; in order.
    fn with_whole_planes(&self, decides: impl Fn(usize) -> bool, mut kept: Literals) -> Literals {
        for k in (0..self.gradients.len()).filter(|k| decides(*k)) {
            if self.of_plane(k).all(|id| !kept.contains(&id)) {
                kept.extend(self.of_plane(k));
            }
        }
        kept.sort_unstable();
        kept
    }
}

/// The least difference between two of some numbers; infinite for one.
fn least_difference(all: &[f64]) -> f64 {
    let pairs = all.iter().enumerate().flat_map(|(i, a)| all[..i].iter().map(move |b| (a - b).abs()));
    pairs.fold(f64::INFINITY, f64::min)
}

/// A direction in each cell of the arrangement of the planes on which two gradients have the same slope.
fn cells(gradients: &[DVec3]) -> Vec<DVec3> {
    let mut walls: SmallVec<[DVec3; 8]> = SmallVec::new();
    for (i, g) in gradients.iter().enumerate() {
        for h in &gradients[..i] {
            let wall = (*g - *h).normalize();
            if walls.iter().all(|w| w.cross(wall).length() > PARALLEL) {
                walls.push(wall);
            }
        }
    }
    let first = walls.first().or(gradients.first()).copied();
    let [_, _, ..] = walls[..] else { return first.into_iter().flat_map(|d| [d, -d]).collect() };
    let mut out = Vec::new();
    for (i, w) in walls.iter().enumerate() {
        for (j, v) in walls.iter().enumerate().skip(i + 1) {
            let line = w.cross(*v).normalize();
            // The two themselves, too, where they are so nearly parallel that their line is known no better.
            let passes = |k: usize| k == i || k == j || walls[k].dot(line).abs() <= PARALLEL;
            // Each line once, by the first two walls through it.
            if (0..j).all(|k| k == i || !passes(k)) {
                let through: SmallVec<[DVec3; 8]> = (0..walls.len()).filter(|k| passes(*k)).map(|k| walls[k]).collect();
                let beside = (0..walls.len()).filter(|k| !passes(*k));
                let off = beside.map(|k| walls[k].dot(line).abs()).fold(1.0, f64::min);
                for aside in between(line, &through) {
                    out.extend(
                        [line, -line]
                            .into_iter()
                            .flat_map(|end| [end + aside * (0.5 * off), end - aside * (0.5 * off)]),
                    );
                }
            }
        }
    }
    out
}

/// Directions across a line, one between each two neighbours of the planes through it, by their normals; the opposite of each is
/// between two, too.
fn between(line: DVec3, normals: &[DVec3]) -> SmallVec<[DVec3; 8]> {
    let x = normals[0];
    let y = line.cross(x);
    // Along each plane, on one side of the first normal: ordered by the angle to it.
    let mut along: SmallVec<[DVec3; 8]> = normals.iter().map(|n| line.cross(*n)).collect();
    for v in &mut along {
        if v.dot(y) < 0.0 || (v.dot(y) == 0.0 && v.dot(x) < 0.0) {
            *v = -*v;
        }
    }
    along.sort_unstable_by(|v, w| w.dot(x).total_cmp(&v.dot(x)));
    let next = along.iter().skip(1).copied().chain([-along[0]]);
    along.iter().zip(next).map(|(v, w)| (*v + w).normalize_or_zero()).collect()
}

/// True for a literal, and for an operator over literals alone.
fn is_flat(tokens: &[Token]) -> bool {
    match local::first(tokens).0 {
        Expression::Literal(_) | Expression::Part(_) => true,
        Expression::And(body) | Expression::Or(body) => {
            local::operands(body).all(|e| matches!(e, Expression::Literal(_)))
        }
    }
}

/// Truth of an expression from its literals'.
fn holds(tokens: &[Token], of: &dyn Fn(LiteralId) -> bool) -> bool {
    value(tokens, &|id| if of(id) { -1.0 } else { 1.0 }) < 0.0
}

/// An expression as the minimum and maximum of its literals' numbers.
fn value(tokens: &[Token], of: &dyn Fn(LiteralId) -> f64) -> f64 {
    let (expression, _) = local::first(tokens);
    let each = |body: &[Token], all: bool| {
        let (mut rest, mut out) = (body, if all { f64::NEG_INFINITY } else { f64::INFINITY });
        while !rest.is_empty() {
            let n = local::first(rest).1;
            let v = value(&rest[..n], of);
            out = if all { out.max(v) } else { out.min(v) };
            rest = &rest[n..];
        }
        out
    };
    match expression {
        Expression::Literal(id) => of(id),
        Expression::Part(_) => f64::NAN,
        Expression::And(body) => each(body, true),
        Expression::Or(body) => each(body, false),
    }
}

#[cfg(test)]
mod tests {
    use super::{active, between, cells};
    use crate::solid::Sense;
    use crate::solid::local::{self, LiteralId, Token};
    use glam::DVec3;

    /// Directions of every order of some gradients' slopes that random directions show.
    #[test]
    fn every_order_of_slopes_has_a_direction() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for count in 2..=5 {
            for round in 0..12 {
                let mut draw =
                    || DVec3::new(random(), random(), if round % 3 == 0 { 0.0 } else { random() }).normalize();
                let mut gradients: Vec<DVec3> = (0..count).map(|_| draw()).collect();
                if round % 4 == 1 {
                    // Several planes through one line.
                    gradients = vec![DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y, DVec3::Z][..count].to_vec();
                }
                let order = |d: DVec3| {
                    let mut all: Vec<usize> = (0..count).collect();
                    all.sort_by(|i, j| gradients[*i].dot(d).total_cmp(&gradients[*j].dot(d)));
                    all
                };
                let known: Vec<_> = cells(&gradients).into_iter().map(order).collect();
                for _ in 0..300 {
                    let d = DVec3::new(random(), random(), random());
                    assert!(known.contains(&order(d)), "{gradients:?}: {d}");
                }
            }
        }
        assert_eq!(between(DVec3::Z, &[DVec3::X, DVec3::Y]).len(), 2);
    }

    #[test]
    fn walls_that_are_nearly_parallel_have_cells_too() {
        for i in 0..200 {
            let u = f64::from(i);
            let turn = glam::DQuat::from_xyzw(u.sin(), (2.3 * u).cos(), (0.7 * u).sin(), (1.9 * u).cos()).normalize();
            let gradients = [DVec3::X, -DVec3::X, DVec3::new(-1.0, 3e-9, 0.0).normalize()].map(|g| turn * g);
            let known = cells(&gradients);
            assert!(known.len() >= 4 && known.iter().all(|d| d.is_finite()), "{i}: {known:?}");
        }
    }

    /// A body y <= 0 less (a prism less itself): f = max(y, −|c|), c = max(n1, n2). Where y < 0 is n2 above n1.
    #[test]
    fn a_face_that_others_precede_everywhere_decides_nothing() {
        let (n, p) = (Sense::Negative, Sense::Positive);
        let walls = [DVec3::new(-0.8, 0.6, 0.0), DVec3::new(-0.8, -0.6, 0.0)];
        let faces = [DVec3::Y, walls[0], walls[1], walls[0], walls[1]];
        let gradient = |i: LiteralId| faces[i.face() as usize] * if i.sense() == p { 1.0 } else { -1.0 };
        let literal = |face, sense| vec![local::literal_token(LiteralId::new(face, sense))];
        let mut again: Vec<Token> = Vec::new();
        local::write_and([literal(3, p).as_slice(), literal(4, p).as_slice()], &mut again);
        let outside = [literal(1, n), literal(2, n), again].concat();
        let skin = [vec![local::OR | outside.len() as u32], outside].concat();
        let mut open: Vec<Token> = Vec::new();
        local::write_and([literal(0, p).as_slice(), skin.as_slice()], &mut open);
        let expected = [LiteralId::new(0, p), LiteralId::new(4, p), LiteralId::new(2, n)];
        assert_eq!(active(&open, gradient, false).to_vec(), expected);
        // By truths alone the other wall looks as if it did.
        assert_eq!(active(&open, gradient, true).len(), 5);
    }
}
