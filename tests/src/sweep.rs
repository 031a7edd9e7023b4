//! How long a random sweep is: short in the test command, longer where the environment says so.

use std::str::FromStr;

/// The number in the environment variable `name`; `short` where there is none.
///
/// # Panics
/// Where the variable holds no number.
pub fn sized<N: FromStr>(name: &str, short: N) -> N {
    match std::env::var(name) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{name}: expected a number, found {text:?}")),
        Err(_) => short,
    }
}
