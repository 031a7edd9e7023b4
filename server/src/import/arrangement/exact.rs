//! Points and planes over whole numbers: every answer is exact.
//!
//! A point is X/w, a plane n·x = d, all of them integers of any length (homogeneous coordinates). What a few roundings cannot turn
//! round is answered in double precision.

use dashu_int::ops::{BitTest as _, DivRem as _};
use dashu_int::{IBig, UBig};
use glam::DVec3;
use std::cmp::Ordering;

/// What the roundings of a plane, of a point and of the value at it come to, of the sum of all absolute values: some 12 halves of
/// an epsilon.
const ROUNDINGS: f64 = 8.0 * f64::EPSILON;

/// A point.
#[derive(Clone, Debug)]
pub struct Point {
    /// X of X/w.
    pub at: [IBig; 3],
    /// w, above 0.
    pub weight: IBig,
    /// Each coordinate as the double nearest to it: equal points have equal ones.
    pub near: DVec3,
}

impl Point {
    /// The point of three integers.
    pub fn whole(at: [i64; 3]) -> Self {
        Self { at: at.map(IBig::from), weight: IBig::from(1), near: DVec3::from(at.map(|x| x as f64)) }
    }

    /// The point that three planes have in common; `None` of planes that have not one.
    pub fn of_planes(planes: [&Plane; 3]) -> Option<Self> {
        let [a, b, c] = planes;
        let crossed = [cross(&b.normal, &c.normal), cross(&c.normal, &a.normal), cross(&a.normal, &b.normal)];
        let weight = dot(&a.normal, &crossed[0]);
        if weight.is_zero() {
            return None;
        }
        let of = |k: usize| &a.offset * &crossed[0][k] + &b.offset * &crossed[1][k] + &c.offset * &crossed[2][k];
        let at = [of(0), of(1), of(2)];
        let (at, weight) = if weight < IBig::ZERO { (at.map(|x| -x), -weight) } else { (at, weight) };
        let near = DVec3::new(nearest(&at[0], &weight), nearest(&at[1], &weight), nearest(&at[2], &weight));
        Some(Self { at, weight, near })
    }

    /// True for the same point.
    pub fn is(&self, other: &Self) -> bool {
        self.near == other.near && (0..3).all(|k| self.compare(other, k) == Ordering::Equal)
    }

    /// The order along an axis.
    pub fn compare(&self, other: &Self, axis: usize) -> Ordering {
        match self.near[axis].partial_cmp(&other.near[axis]) {
            Some(Ordering::Equal) | None => (&self.at[axis] * &other.weight).cmp(&(&other.at[axis] * &self.weight)),
            Some(order) => order,
        }
    }
}

/// True where three points are on one line.
pub fn are_in_line([a, b, c]: [&Point; 3]) -> bool {
    (0..3).all(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let minor = |p: &Point, q: &Point| &p.at[i] * &q.at[j] - &p.at[j] * &q.at[i];
        (minor(a, b) * &c.weight + minor(b, c) * &a.weight + minor(c, a) * &b.weight).is_zero()
    })
}

/// The double nearest to a fraction whose denominator is above 0.
fn nearest(numerator: &IBig, denominator: &IBig) -> f64 {
    let (sign, above) = numerator.clone().into_parts();
    let (_, below) = denominator.clone().into_parts();
    if above.is_zero() {
        return 0.0;
    }
    // As many digits as are rounded once, and one that tells of all the others.
    let shift = 66 + below.bit_len() as isize - above.bit_len() as isize;
    let shifted = |x: UBig, by: isize| if by > 0 { x << by as usize } else { x };
    let (whole, rest) = shifted(above, shift).div_rem(shifted(below, -shift));
    let digits = u128::try_from(whole).unwrap_or(u128::MAX) | u128::from(!rest.is_zero());
    let size = libm::ldexp(digits as f64, -shift as i32);
    if sign == dashu_int::Sign::Negative { -size } else { size }
}

/// A plane n·x = d.
#[derive(Clone, Debug)]
pub struct Plane {
    /// n.
    pub normal: [IBig; 3],
    /// d.
    pub offset: IBig,
    /// Both rounded.
    near: (DVec3, f64),
}

impl Plane {
    /// The plane with a normal through a point.
    pub fn through(normal: [i128; 3], at: [i64; 3]) -> Self {
        let normal = normal.map(IBig::from);
        let offset = dot(&normal, &at.map(IBig::from));
        let rounded = |x: &IBig| x.to_f64().value();
        let near = (DVec3::new(rounded(&normal[0]), rounded(&normal[1]), rounded(&normal[2])), rounded(&offset));
        Self { normal, offset, near }
    }

    /// On which side of it a point is: `Greater` where its normal points to.
    pub fn side(&self, p: &Point) -> Ordering {
        let (normal, offset) = self.near;
        let value = normal.dot(p.near) - offset;
        if value.abs() > ROUNDINGS * (normal.abs().dot(p.near.abs()) + offset.abs()) {
            return if value > 0.0 { Ordering::Greater } else { Ordering::Less };
        }
        dot(&self.normal, &p.at).cmp(&(&self.offset * &p.weight))
    }
}

fn dot(a: &[IBig; 3], b: &[IBig; 3]) -> IBig {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn cross(a: &[IBig; 3], b: &[IBig; 3]) -> [IBig; 3] {
    let of = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [of(1, 2), of(2, 0), of(0, 1)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::Random;

    fn whole(r: &mut Random, size: f64) -> [i64; 3] {
        r.vector(size).to_array().map(|x| x as i64)
    }

    #[test]
    fn fractions_become_the_doubles_nearest_to_them() {
        let of = |a: i128, b: i128| nearest(&IBig::from(a), &IBig::from(b));
        let mut r = Random(7);
        for _ in 0..2000 {
            let size = libm::exp2(r.within(1.0, 52.0));
            let (a, b) = (r.within(-size, size) as i64, 1 + r.within(0.0, size) as i64);
            // Of numbers that doubles hold one division is rounded once.
            assert_eq!(of(a.into(), b.into()), a as f64 / b as f64, "{a}/{b}");
            // However large a factor both have.
            let factor = IBig::from(r.within(1.0, 1e15) as i64) << 300;
            assert_eq!(nearest(&(IBig::from(a) * &factor), &(IBig::from(b) * &factor)), a as f64 / b as f64);
        }
        // Half way between two: to the even one, and what is above half way by a little up.
        assert_eq!(of((1 << 53) + 1, 1), (1u64 << 53) as f64);
        assert_eq!(of((((1i128 << 53) + 1) << 40) + 1, 1 << 40), ((1u64 << 53) + 2) as f64);
    }

    #[test]
    fn planes_know_the_points_on_them() {
        let mut r = Random(8);
        let plane = |r: &mut Random| Plane::through(whole(r, 1e15).map(i128::from), whole(r, 1e15));
        for _ in 0..200 {
            let [a, b, c, d] = [0; 4].map(|_| plane(&mut r));
            let p = Point::of_planes([&a, &b, &c]).expect("a point");
            assert!([&a, &b, &c].iter().all(|plane| plane.side(&p) == Ordering::Equal));
            assert!(Point::of_planes([&c, &a, &b]).expect("the same").is(&p));
            let (q, other) = (Point::of_planes([&a, &b, &d]), Point::whole(whole(&mut r, 1e15)));
            let q = q.expect("another one");
            assert!(!q.is(&p) && c.side(&q) != Ordering::Equal && !are_in_line([&p, &q, &other]));
            // The middle of two is on their line, and between them.
            let sum = |k: usize| &p.at[k] * &q.weight + &q.at[k] * &p.weight;
            let weight = &p.weight * &q.weight * 2;
            let at = [sum(0), sum(1), sum(2)];
            let near = DVec3::from([0, 1, 2].map(|k: usize| nearest(&at[k], &weight)));
            let middle = Point { at, weight, near };
            assert!(are_in_line([&p, &q, &middle]) && a.side(&middle) == Ordering::Equal);
            assert!((0..3).all(|k| p.compare(&middle, k) == middle.compare(&q, k)));
        }
        let same = Plane::through([1, 0, 0], [0; 3]);
        assert!(Point::of_planes([&same, &plane(&mut r), &same]).is_none());
    }
}
