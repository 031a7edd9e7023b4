//! What fixed multipliers prove through time: a bound that is concave, until when it stays positive, and when one leads to another.

use glam::DVec3;

/// What fixed multipliers prove through time: for x = c + y,
/// Σ λ literal >= value + w·y + (rate + turn·y) t − ½ q t².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Course {
    pub value: f64,
    pub w: DVec3,
    pub rate: f64,
    pub turn: DVec3,
    pub q: f64,
}

impl Course {
    /// The bound over the whole cell, dt after the view's instant.
    pub fn at(&self, dt: f64, half: DVec3) -> f64 {
        self.value + self.rate * dt - (self.w + self.turn * dt).abs().dot(half) - 0.5 * self.q * dt * dt
    }

    /// Until when the bound stays positive, which it must be at `dt` (it is concave in time); else negative infinity.
    pub fn from(&self, dt: f64, half: DVec3) -> f64 {
        let mut end = dt;
        let s = self.turn.abs().dot(half) - self.rate;
        for round in 0..3 {
            let lb = self.at(end, half);
            if lb.is_nan() || lb <= 0.0 {
                return if round == 0 { f64::NEG_INFINITY } else { end };
            }
            end += span(lb, s + self.q * end, self.q);
        }
        end
    }

    /// Shortly before the bound began to fail that fails at `dt` (Newton, from above as it is concave); zero if it never held.
    pub fn back(&self, dt: f64, half: DVec3) -> f64 {
        let mut at = dt;
        for _ in 0..3 {
            let w = self.w + self.turn * at;
            let rate = self.rate - (w.signum() * self.turn).dot(half) - self.q * at;
            if rate >= 0.0 {
                return 0.0;
            }
            at -= self.at(at, half) / rate;
            if at <= 0.0 {
                return 0.0;
            }
        }
        at - 0.02 * (dt - at)
    }

    /// Multipliers that go from these to those of `end` linearly over [0, dt] prove all of it. With s = t/dt their bound is
    ///
    /// ```text
    /// (1−s) F0(t) + s F1(t) >= (1−s) F0(0) + s F1(dt) − s(1−s) M,
    /// M = dt·(rate1 − rate0 + Σ_k e_k |turn1 − turn0|_k) − dt²·min(½ q1, q1 − ½ q0),
    /// ```
    ///
    /// which is positive for all s where M <= (√F0(0) + √F1(dt))²; M may be `part` of that.
    pub fn leads_to(&self, end: &Course, dt: f64, half: DVec3, part: f64) -> bool {
        let (f0, f1) = (self.at(0.0, half), end.at(dt, half));
        if !(f0 > 0.0 && f1 >= 0.0) {
            return false;
        }
        let m = dt * (end.rate - self.rate + (end.turn - self.turn).abs().dot(half))
            - dt * dt * (0.5 * end.q).min(end.q - 0.5 * self.q);
        let root = f0.sqrt() + f1.sqrt();
        m <= root * root * part
    }
}

/// The largest dt with lb − s·dt − ½·q·dt² >= 0 (lb > 0, q >= 0), a little less for rounding; infinite if always.
fn span(lb: f64, s: f64, q: f64) -> f64 {
    let root = (s * s + 2.0 * q * lb).sqrt();
    let dt = if s > 0.0 {
        2.0 * lb / (s + root)
    } else if q > 0.0 {
        (root - s) / q
    } else {
        return f64::INFINITY;
    };
    dt * (1.0 - 1e-12)
}

#[cfg(test)]
mod tests {
    use super::span;

    #[test]
    fn the_span_is_the_first_root() {
        for (lb, s, q) in [(1.0, 2.0, 3.0), (1.0, -2.0, 3.0), (1e-9, 1e3, 0.0), (1e-9, 0.0, 5.0), (1.0, -1e-3, 1e-6)] {
            let t = span(lb, s, q);
            let left = lb - s * t - 0.5 * q * t * t;
            assert!(left >= 0.0 && left <= 1e-10 * (lb + (s * t).abs()), "{left}");
        }
        assert_eq!(span(1.0, -1.0, 0.0), f64::INFINITY);
    }
}
