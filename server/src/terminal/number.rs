//! Numbers as people read them: rounded to what is known of them, without trailing zeros.

/// Powers of ten between which a number stands without an exponent.
const PLAIN: std::ops::Range<i32> = -5..9;

/// `x` to so many significant digits, and to no finer than `quantum`: what is smaller is 0.
pub fn number(x: f64, quantum: f64, digits: i32) -> String {
    if x == 0.0 || x.abs() < quantum {
        return "0".into();
    }
    if !x.is_finite() {
        return x.to_string();
    }
    let power = |x: f64| x.abs().log10().floor() as i32;
    let known = if quantum > 0.0 { (quantum.log10() - 1e-9).ceil() as i32 } else { i32::MIN };
    // Where rounding leads to the next power of ten, one digit more is told: it is a zero and left out.
    let finest = known.max(power(x) - digits + 1);
    if PLAIN.contains(&power(x)) {
        let unit = 10f64.powi(finest.max(0));
        // Left of the point it is rounded here, right of it when it is written.
        let rounded = if finest > 0 { (x / unit).round() * unit } else { x };
        let text = format!("{rounded:.*}", usize::try_from(-finest).unwrap_or(0));
        return without_zeros(&text).into();
    }
    let text = format!("{x:.*e}", usize::try_from(power(x) - finest).unwrap_or(0));
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}e{exponent}", without_zeros(mantissa))
}

/// A time within a step, to nine decimals.
pub fn time(t: f64) -> String {
    // What would be written as -0 is 0.
    format!("{:.9}", if t.abs() < 5e-10 { 0.0 } else { t })
}

fn without_zeros(text: &str) -> &str {
    let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text };
    if short == "-0" { "0" } else { short }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_below_the_quantum_is_zero() {
        for (x, quantum, digits, text) in [
            (3.55e-15, 1e-9, 6, "0"),
            (-1e-12, 1e-9, 6, "0"),
            (-0.0, 0.0, 6, "0"),
            (0.5, 1e-9, 6, "0.5"),
            (-35.923785426, 6.5e-5, 10, "-35.9238"),
            (58.523608870, 1e-3, 10, "58.524"),
            (2.5e-7, 1e-9, 6, "2.5e-7"),
            (2.53e-9, 1e-9, 6, "3e-9"),
            (123_456_789.0, 1e-9, 6, "123457000"),
            (1234.0, 100.0, 6, "1200"),
            (9.999_999_9, 0.0, 6, "10"),
            (1.0e12, 0.0, 6, "1e12"),
            (-6.25e-30, 0.0, 6, "-6.25e-30"),
            (f64::INFINITY, 1.0, 6, "inf"),
        ] {
            assert_eq!(number(x, quantum, digits), text, "{x} {quantum} {digits}");
        }
        assert_eq!((time(-1e-17).as_str(), time(0.25).as_str()), ("0.000000000", "0.250000000"));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn what_is_told_is_near_and_short(mantissa in -10.0..10.0f64, e in -14..14i32, q in -12..2i32, digits in 1..11i32) {
            let (x, quantum) = (mantissa * 10f64.powi(e), 10f64.powi(q));
            let text = number(x, quantum, digits);
            let told: f64 = text.parse().unwrap();
            let off = quantum.max(x.abs() * 10f64.powi(1 - digits)) * 1.000_001;
            prop_assert!((told - x).abs() <= off, "{text} for {x:e}");
            prop_assert!(text.len() <= 18 && !text.starts_with("-0.0e") && text != "-0", "{text}");
        }
    }
}
