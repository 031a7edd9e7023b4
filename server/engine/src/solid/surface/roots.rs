//! Where squares along a line are negative: t with a t² + 2 b t + c <= 0.

/// Where slope·t + value <= 0.
pub(super) fn half_line(slope: f64, value: f64) -> Option<(f64, f64)> {
    if slope == 0.0 {
        return (value <= 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let at = -value / slope;
    Some(if slope > 0.0 { (f64::NEG_INFINITY, at) } else { (at, f64::INFINITY) })
}

/// The roots of a t² + 2 b t + c for a > 0, without cancellation.
pub(super) fn between_roots(a: f64, b: f64, c: f64) -> Option<(f64, f64)> {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return None;
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    if q == 0.0 {
        return Some((0.0, 0.0));
    }
    let (s, t) = (q / a, c / q);
    Some((s.min(t), s.max(t)))
}

/// Where a t² + 2 b t + c <= 0 along a line, and h + t k >= 0: within one nappe of a cone, whose other one the square does not tell
/// apart. |a| below `parallel` is that of a line along a generator.
pub(super) fn between_roots_of_nappe([a, b, c]: [f64; 3], parallel: f64, (h, k): (f64, f64)) -> Option<(f64, f64)> {
    let on_nappe = |t: f64| h + t * k >= 0.0;
    if a.abs() < parallel {
        // One crossing.
        let (from, to) = half_line(2.0 * b, c)?;
        let probe = if from.is_finite() { from + 1.0 } else { to - 1.0 };
        return on_nappe(probe).then_some((from, to));
    }
    if a > 0.0 {
        let (from, to) = between_roots(a, b, c)?;
        return on_nappe(0.5 * (from + to)).then_some((from, to));
    }
    // Steeper than the cone: the line is inside both nappes, beyond either root.
    let (low, high) = between_roots(-a, -b, -c)?;
    Some(if k > 0.0 { (high, f64::INFINITY) } else { (f64::NEG_INFINITY, low) })
}
