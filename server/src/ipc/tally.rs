//! What a server counts of its steps: how many there were, and how long those of the last minute took.
//!
//! A count is a few instructions, and what is asked for is made of six histograms: the loop hardly knows that it is counted.

use contactd_proto::control::LatestSteps;
use hdrhistogram::Histogram;
use std::time::{Duration, Instant};

/// The last minute is kept in parts, the oldest of which goes when another begins.
const PARTS: usize = 6;
const PART: Duration = Duration::from_secs(10);
/// Times that are told apart, in nanoseconds, and their digits.
const SHORTEST: u64 = 256;
const LONGEST: u64 = 3_600_000_000_000;
const DIGITS: u8 = 2;

/// Counters of a server's steps.
#[derive(Debug)]
pub struct Tally {
    began: Instant,
    /// Steps that were taken, and those of them that left a pair undecided.
    pub steps: u64,
    /// See `steps`.
    pub undecided: u64,
    parts: Vec<Histogram<u32>>,
    /// The part of now, and when it began.
    part: usize,
    part_began: Instant,
}

fn histogram() -> Histogram<u32> {
    Histogram::new_with_bounds(SHORTEST, LONGEST, DIGITS).expect("bounds are in order")
}

impl Tally {
    /// One that begins now.
    pub fn new(now: Instant) -> Self {
        let parts = (0..PARTS).map(|_| histogram()).collect();
        Self { began: now, steps: 0, undecided: 0, parts, part: 0, part_began: now }
    }

    /// A step was taken.
    pub fn count(&mut self, took: Duration, is_undecided: bool) {
        self.steps += 1;
        self.undecided += u64::from(is_undecided);
        self.parts[self.part].saturating_record(u64::try_from(took.as_nanos()).unwrap_or(LONGEST));
    }

    /// Lets go what is older than a minute.
    pub fn turn(&mut self, now: Instant) {
        for _ in 0..PARTS {
            if now.saturating_duration_since(self.part_began) < PART {
                return;
            }
            self.part = (self.part + 1) % PARTS;
            self.part_began += PART;
            self.parts[self.part].reset();
        }
        // Whoever has not looked for a minute begins anew.
        if now.saturating_duration_since(self.part_began) >= PART {
            self.part_began = now;
        }
    }

    /// Time since it began.
    pub fn age(&self, now: Instant) -> Duration {
        now.saturating_duration_since(self.began)
    }

    /// The steps of the last minute, or of what there is of it.
    pub fn latest(&mut self, now: Instant) -> LatestSteps {
        self.turn(now);
        let mut all = histogram();
        for part in &self.parts {
            all.add(part).expect("all have the same bounds");
        }
        let kept = PART * (PARTS as u32 - 1) + now.saturating_duration_since(self.part_began);
        let at = |q: f64| if all.is_empty() { 0 } else { all.value_at_quantile(q) };
        LatestSteps {
            window_ms: millis(kept.min(self.age(now))),
            steps: all.len(),
            p50_ns: at(0.5),
            p99_ns: at(0.99),
            p999_ns: at(0.999),
            largest_ns: if all.is_empty() { 0 } else { all.max() },
        }
    }
}

/// Whole milliseconds.
pub fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_minute_is_kept_and_older_steps_go_part_by_part() {
        let start = Instant::now();
        let at = |seconds: u64| start + Duration::from_secs(seconds);
        let mut tally = Tally::new(start);
        assert_eq!(tally.latest(start), LatestSteps::default());
        for k in 1..=1000 {
            tally.count(Duration::from_micros(k), k % 10 == 0);
        }
        let latest = tally.latest(at(5));
        assert_eq!((latest.window_ms, latest.steps, tally.steps, tally.undecided), (5000, 1000, 1000, 100));
        let near = |told: u64, micros: u64| told.abs_diff(1000 * micros) <= 10 * micros;
        assert!(near(latest.p50_ns, 500) && near(latest.p99_ns, 990) && near(latest.p999_ns, 999), "{latest:?}");
        assert!(near(latest.largest_ns, 1000), "{latest:?}");
        tally.turn(at(35));
        tally.count(Duration::from_secs(7200), false);
        let latest = tally.latest(at(59));
        assert_eq!((latest.window_ms, latest.steps, latest.p50_ns < 600_000), (59_000, 1001, true));
        // The first ones are gone, the later one is not.
        let latest = tally.latest(at(65));
        assert_eq!((latest.window_ms, latest.steps), (55_000, 1));
        assert!(latest.p50_ns.abs_diff(LONGEST) <= LONGEST / 100, "{latest:?}");
        assert_eq!(tally.latest(at(100)).steps, 0);
        assert_eq!(tally.latest(at(10_000)).steps, 0);
        tally.count(Duration::from_micros(3), false);
        assert_eq!((tally.latest(at(10_001)).steps, tally.steps), (1, 1002));
    }
}
