//! Boxes along any three perpendicular axes: tighter than boxes along the frame's axes, and dearer to compare.

use super::{Aabb, tolerance::OUTWARD};
use glam::{DMat3, DVec3};

/// A closed, bounded box along axes of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oriented {
    /// Centre.
    pub center: DVec3,
    /// Its axes, unit and perpendicular to each other.
    pub axes: DMat3,
    /// Half extents along them.
    pub half: DVec3,
}

impl Oriented {
    /// A finite box along the frame's own axes.
    pub fn of_box(b: &Aabb) -> Self {
        let center = b.center();
        // The centre rounds too: the farther side of each axis counts.
        Self { center, axes: DMat3::IDENTITY, half: (b.max - center).max(center - b.min) }
    }

    /// True when the two share no point, rounding considered: some axis separates them. The candidates are the axes of
    /// both and their cross products (S. Gottschalk, M. Lin, D. Manocha, OBBTree, SIGGRAPH 1996).
    pub fn misses(&self, other: &Self) -> bool {
        let way = other.center - self.center;
        let (m, n) = (&self.axes, &other.axes);
        // Other's axes along this one's.
        let turn = m.transpose() * *n;
        let spread = DMat3::from_cols(turn.x_axis.abs(), turn.y_axis.abs(), turn.z_axis.abs());
        let along = m.transpose() * way;
        let (e, f) = (self.half, other.half);
        let size = self.center.abs().max(other.center.abs()).element_sum() + e.element_sum() + f.element_sum();
        let slack = 4.0 * OUTWARD * size;
        if (along.abs() - e - spread * f).max_element() > slack {
            return true;
        }
        if ((turn.transpose() * along).abs() - f - spread.transpose() * e).max_element() > slack {
            return true;
        }
        for j in 0..3 {
            for (i, k, l) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
                // The cross product of this one's axis i and the other's axis j, along this one's axes.
                let (p, q) = ((j + 1) % 3, (j + 2) % 3);
                let reach = (along[l] * turn.col(j)[k] - along[k] * turn.col(j)[l]).abs();
                let own = e[k] * spread.col(j)[l] + e[l] * spread.col(j)[k];
                let others = f[p] * spread.col(q)[i] + f[q] * spread.col(p)[i];
                if reach - own - others > slack {
                    return true;
                }
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;
    use glam::DQuat;

    /// The separating axes against sampled points, and against the distance of the two boxes by projection onto each in turn.
    #[test]
    fn boxes_miss_each_other_where_no_point_is_common() {
        let mut r = Random(5);
        let (mut missed, mut met) = (0, 0);
        for _ in 0..4000 {
            let mut draw = || {
                let u = |r: &mut Random| r.within(-1.0, 1.0);
                let q = DQuat::from_xyzw(u(&mut r), u(&mut r), u(&mut r), u(&mut r)).normalize();
                let center = DVec3::new(u(&mut r), u(&mut r), u(&mut r));
                let half = 0.05 + 0.4 * DVec3::new(u(&mut r), u(&mut r), u(&mut r)).abs();
                Oriented { center, axes: DMat3::from_quat(q), half }
            };
            let (a, b) = (draw(), draw());
            // The nearest point of a box is its clamped coordinates; between convex bodies alternating them converges.
            let nearest = |o: &Oriented, x: DVec3| {
                let l = o.axes.transpose() * (x - o.center);
                o.center + o.axes * l.clamp(-o.half, o.half)
            };
            let mut x = a.center;
            for _ in 0..2000 {
                x = nearest(&a, nearest(&b, x));
            }
            let gap = (x - nearest(&b, x)).length();
            assert_eq!(a.misses(&b), b.misses(&a));
            if a.misses(&b) {
                assert!(gap > 0.0, "{a:?} {b:?}");
                missed += 1;
            } else {
                assert!(gap < 1e-3, "{gap}: {a:?} {b:?}");
                met += 1;
            }
        }
        assert!(missed > 1000 && met > 300, "{missed} {met}");
    }
}
