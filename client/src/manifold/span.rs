//! Which four points of a region span most of it.

use glam::{DVec2, DVec3};

/// Points kept of a region: three hold two bodies that lie on each other, and a rectangle has four corners.
pub const KEPT: usize = 4;

/// Of a hull that is thinner than this part of its length only the ends count.
const THIN: f64 = 1e-9;
/// Areas that are as large but for rounding: the first one found is taken.
const TIE: f64 = 1.0 + 1e-9;
/// A point this part of the region's length nearer than all that span it bears before they do, and is taken with them.
const LOWER: f64 = 1e-3;

/// Up to [`KEPT`] of a region's points, by index.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Chosen {
    at: [usize; KEPT],
    count: usize,
}

impl Chosen {
    /// Their indices, in the order in which they were chosen.
    pub fn indices(&self) -> &[usize] {
        &self.at[..self.count]
    }

    /// True when there is room for another.
    pub fn has_room(&self) -> bool {
        self.count < KEPT
    }

    /// Takes one more. There must be room.
    pub fn push(&mut self, index: usize) {
        self.at[self.count] = index;
        self.count += 1;
    }

    fn of(indices: &[usize]) -> Self {
        let mut chosen = Self::default();
        indices.iter().for_each(|i| chosen.push(*i));
        chosen
    }
}

/// Chooses points; keeps its buffers from call to call.
#[derive(Clone, Debug, Default)]
pub struct Span {
    flat: Vec<DVec2>,
    separations: Vec<f64>,
    order: Vec<usize>,
    hull: Vec<usize>,
}

impl Span {
    /// Takes a region: its points (any frame and unit, with the unit normal in the same frame) and their separations.
    pub fn set(&mut self, normal: DVec3, points: impl Iterator<Item = (DVec3, f64)>) {
        let (u, v) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.separations.clear();
        for (point, separation) in points {
            self.flat.push(DVec2::new(point.dot(u), point.dot(v)));
            self.separations.push(separation);
        }
    }

    /// Number of points of the region.
    pub fn len(&self) -> usize {
        self.flat.len()
    }

    /// True for a region without points.
    pub fn is_empty(&self) -> bool {
        self.flat.is_empty()
    }

    /// Area of the convex hull of some chosen points, length².
    pub fn area(&self, chosen: &Chosen) -> f64 {
        let Some(first) = chosen.indices().first() else { return 0.0 };
        let p: [DVec2; KEPT] = std::array::from_fn(|k| self.flat[*chosen.indices().get(k).unwrap_or(first)]);
        let twice = |d: DVec2, e: DVec2| d.perp_dot(e).abs();
        // Of four points in convex position the product of the diagonals is the area and those of opposite sides are less; of
        // others the largest triangle is the hull.
        let mut most = 0.0f64;
        for [i, j, k, l] in [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]] {
            most = most.max(twice(p[j] - p[i], p[l] - p[k]));
        }
        for [i, j, k] in [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]] {
            most = most.max(twice(p[j] - p[i], p[k] - p[i]));
        }
        0.5 * most
    }

    /// Largest distance between two of some chosen points.
    pub fn length(&self, chosen: &Chosen) -> f64 {
        let mut most = 0.0f64;
        for (n, i) in chosen.indices().iter().enumerate() {
            for j in &chosen.indices()[..n] {
                most = most.max(self.flat[*i].distance(self.flat[*j]));
            }
        }
        most
    }

    /// At most four points that span the region, of those that `of` admits: all if there are no more; the corners of the
    /// quadrilateral of largest area, which is at least 2/π of that of their hull (Sas 1939); of points in a line the two ends.
    /// A point that is nearer than all of these by more than a thousandth of the region's length takes the place of the
    /// one next to it.
    pub fn best(&mut self, of: impl Fn(usize) -> bool) -> Chosen {
        self.order.clear();
        self.order.extend((0..self.flat.len()).filter(|i| of(*i)));
        if self.order.len() <= KEPT {
            return Chosen::of(&self.order);
        }
        let nearest = self.nearest(self.order.iter().copied());
        self.wrap();
        let ends = self.ends();
        let mut chosen = if self.hull_area() > THIN * self.length(&ends).powi(2) { self.quadrilateral() } else { ends };
        let size = self.length(&chosen);
        if size == 0.0 {
            return Chosen::of(&[nearest]);
        }
        if !self.holds_nearest(&chosen, nearest, size) {
            let away = |k: &usize| self.flat[chosen.at[*k]].distance(self.flat[nearest]);
            let next = (0..chosen.count).min_by(|j, k| away(j).total_cmp(&away(k))).unwrap_or(0);
            chosen.at[next] = nearest;
        }
        chosen
    }

    /// True when chosen points may stay chosen though `best` would do better: they span at least `share` of what it
    /// does, and no point is nearer than all of them by much.
    pub fn suffices(&self, chosen: &Chosen, best: &Chosen, share: f64) -> bool {
        if chosen.count == 0 {
            return best.count == 0;
        }
        let size = self.length(best);
        let nearest = self.nearest(0..self.flat.len());
        let flat = self.area(best) > THIN * size * size;
        let spans =
            if flat { self.area(chosen) >= share * self.area(best) } else { self.length(chosen) >= share * size };
        spans && self.holds_nearest(chosen, nearest, size)
    }

    /// Adds to some chosen points those that add most, as long as there is room and something to be had.
    pub fn fill(&self, chosen: &mut Chosen) {
        while chosen.has_room() {
            let worth = |i: usize| {
                let mut more = *chosen;
                more.push(i);
                (self.area(&more), self.length(&more))
            };
            let now = (self.area(chosen), self.length(chosen));
            let mut best: Option<(usize, (f64, f64))> = None;
            for i in (0..self.flat.len()).filter(|i| !chosen.indices().contains(i)) {
                let w = worth(i);
                let beaten = best.map_or(now, |b| b.1);
                let line = THIN * w.1 * w.1;
                if w.0 > beaten.0 * TIE + line || (w.0 <= line && w.1 > beaten.1 * TIE) {
                    best = Some((i, w));
                }
            }
            let Some((i, _)) = best else { return };
            chosen.push(i);
        }
    }

    fn nearest(&self, of: impl Iterator<Item = usize>) -> usize {
        of.min_by(|i, j| self.separations[*i].total_cmp(&self.separations[*j])).unwrap_or(0)
    }

    fn holds_nearest(&self, chosen: &Chosen, nearest: usize, size: f64) -> bool {
        let lowest = chosen.indices().iter().map(|i| self.separations[*i]).fold(f64::INFINITY, f64::min);
        self.separations[nearest] >= lowest - LOWER * size
    }

    fn cross(&self, i: usize, j: usize, k: usize) -> f64 {
        (self.flat[j] - self.flat[i]).perp_dot(self.flat[k] - self.flat[i])
    }

    /// The convex hull of the points in `order`, counterclockwise (Andrew's monotone chain).
    fn wrap(&mut self) {
        let flat = &self.flat;
        let by_place = |i: &usize, j: &usize| {
            let (p, q) = (flat[*i], flat[*j]);
            p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(i.cmp(j))
        };
        self.order.sort_unstable_by(by_place);
        self.hull.clear();
        for half in 0..2 {
            let from = self.hull.len();
            for n in 0..self.order.len() {
                let i = self.order[if half == 0 { n } else { self.order.len() - 1 - n }];
                while self.hull.len() >= from + 2 {
                    let [j, k] = [self.hull[self.hull.len() - 2], self.hull[self.hull.len() - 1]];
                    if self.cross(j, k, i) > 0.0 {
                        break;
                    }
                    self.hull.pop();
                }
                self.hull.push(i);
            }
            // The last of this half is the first of the other.
            self.hull.pop();
        }
        // From the smallest index on, so that near ties do not depend on the axes.
        if let Some(first) = (0..self.hull.len()).min_by_key(|n| self.hull[*n]) {
            self.hull.rotate_left(first);
        }
    }

    fn hull_area(&self) -> f64 {
        let Some(first) = self.hull.first() else { return 0.0 };
        0.5 * self.hull.windows(2).map(|w| self.cross(*first, w[0], w[1])).sum::<f64>()
    }

    /// The two points that are farthest from each other; one, where all are the same.
    fn ends(&self) -> Chosen {
        let mut far = (0.0, [self.order[0]; 2]);
        for (n, i) in self.hull.iter().enumerate() {
            for j in &self.hull[n + 1..] {
                let length = self.flat[*i].distance(self.flat[*j]);
                if length > far.0 * TIE {
                    far = (length, [*i.min(j), *i.max(j)]);
                }
            }
        }
        Chosen::of(if far.0 > 0.0 { &far.1 } else { &far.1[..1] })
    }

    /// Corners of the largest quadrilateral in the hull: for each diagonal the farthest point on either side, which moves on
    /// as the diagonal turns.
    fn quadrilateral(&self) -> Chosen {
        let h = self.hull.len();
        if h <= KEPT {
            return Chosen::of(&self.hull);
        }
        let at = |n: usize| self.hull[n % h];
        let mut best = (0.0, [0; KEPT]);
        for i in 0..h - 2 {
            let (mut c, mut d) = (i + 1, i + 3);
            for j in i + 2..(i + h - 1).min(h) {
                let left = |d: usize| self.cross(at(i), at(j), at(d));
                let right = |c: usize| -self.cross(at(i), at(j), at(c));
                while c + 1 < j && right(c + 1) >= right(c) {
                    c += 1;
                }
                d = d.max(j + 1);
                while d + 1 < i + h && left(d + 1) >= left(d) {
                    d += 1;
                }
                let area = left(d) + right(c);
                if area > best.0 * TIE {
                    best = (area, [at(i), at(c), at(j), at(d)]);
                }
            }
        }
        let mut corners = best.1;
        corners.sort_unstable();
        Chosen { at: corners, count: KEPT }
    }
}
