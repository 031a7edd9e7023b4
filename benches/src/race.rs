//! Contestants timed against each other on the same cases.
//!
//! A machine's speed changes from second to second, with its clock and with its neighbours. So the contestants alternate
//! in short blocks, each block's ratio is of neighbours in time, and the median over the blocks is what counts.

use std::hint::black_box;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// How long a race is.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Blocks of each contestant on each case.
    pub blocks: usize,
    /// A block repeats its call until it has lasted this long by estimate: far above what the clock costs.
    pub least: Duration,
}

/// Seconds a call of the two contestants on one case: medians over the blocks.
#[derive(Clone, Copy, Debug)]
pub struct Lap {
    /// The first one's.
    pub own: f64,
    /// The second one's.
    pub peer: f64,
    /// Median over the blocks of own / peer.
    pub ratio: f64,
    /// Those of the fastest blocks, for tails: of a few blocks one that was interrupted is not what the question takes.
    pub least: [f64; 2],
}

impl Lap {
    /// Own over peer, of the fastest blocks.
    pub fn least_ratio(&self) -> f64 {
        self.least[0] / self.least[1]
    }
}

/// Runs both contestants on the cases 0..n, in blocks that alternate; the case is the innermost, so that no contestant
/// learns one by heart.
pub fn race<A, B>(plan: Plan, n: usize, mut own: impl FnMut(usize) -> A, mut peer: impl FnMut(usize) -> B) -> Vec<Lap> {
    // The warm-up tells how often a call must be repeated.
    let repeats: Vec<[u32; 2]> =
        (0..n).map(|i| [repeats(plan.least, || own(i)), repeats(plan.least, || peer(i))]).collect();
    let mut times = vec![Vec::with_capacity(plan.blocks); n];
    for block in 0..plan.blocks {
        for i in 0..n {
            let pair = if (block + i) % 2 == 0 {
                let first = timed(repeats[i][0], || own(i));
                [first, timed(repeats[i][1], || peer(i))]
            } else {
                let second = timed(repeats[i][1], || peer(i));
                [timed(repeats[i][0], || own(i)), second]
            };
            times[i].push(pair);
        }
    }
    times
        .iter()
        .map(|t| Lap {
            own: median(t.iter().map(|p| p[0])),
            peer: median(t.iter().map(|p| p[1])),
            ratio: median(t.iter().map(|p| p[0] / p[1])),
            least: [0, 1].map(|k| t.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min)),
        })
        .collect()
}

fn repeats<R>(least: Duration, call: impl FnMut() -> R) -> u32 {
    let once = timed(1, call);
    ((least.as_secs_f64() / once.max(1e-8)).ceil() as u32).clamp(1, 10_000)
}

/// Seconds a call, over `n` calls.
fn timed<R>(n: u32, mut call: impl FnMut() -> R) -> f64 {
    let from = Instant::now();
    for _ in 0..n {
        // By reference: a copy of the answer is neither's work, and the longer answer would pay more for it.
        let answer = call();
        black_box(&answer);
    }
    from.elapsed().as_secs_f64() / f64::from(n)
}

/// What `of` makes of 0..n, in order. Plain threads, as many as rayon would use, take one after the other: were they rayon's, one
/// that waits for another within a step could take on a second step and count its time twice.
pub fn spread<T: Send>(n: u64, of: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(0);
    let out = Mutex::new(Vec::with_capacity(n as usize));
    std::thread::scope(|scope| {
        for _ in 0..rayon::current_num_threads() {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= n {
                        break;
                    }
                    let made = of(i);
                    out.lock().expect("no panic while it is held").push((i, made));
                }
            });
        }
    });
    let mut out = out.into_inner().expect("no panic while it was held");
    out.sort_by_key(|(i, _)| *i);
    out.into_iter().map(|(_, made)| made).collect()
}

/// The `q` quantile (0..1) of some numbers: the smallest that at least that share does not exceed; NaN when there are none.
pub fn quantile(values: impl IntoIterator<Item = f64>, q: f64) -> f64 {
    let mut all: Vec<f64> = values.into_iter().collect();
    all.sort_by(f64::total_cmp);
    let rank = (q * all.len() as f64).ceil() as usize;
    all.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
}

/// The median.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    quantile(values, 0.5)
}

/// The largest number.
pub fn worst(values: impl IntoIterator<Item = f64>) -> f64 {
    quantile(values, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_of_the_sorted_values() {
        let v = || [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!((median(v()), worst(v()), quantile(v(), 0.2), quantile(v(), 0.21)), (3.0, 5.0, 1.0, 2.0));
        assert!(median([]).is_nan());
    }

    #[test]
    fn every_case_is_called_in_every_block() {
        let (mut own, mut peer) = ([0; 3], [0; 3]);
        let plan = Plan { blocks: 4, least: Duration::ZERO };
        let laps = race(plan, 3, |i| own[i] += 1, |i| peer[i] += 1);
        assert_eq!((own, peer, laps.len()), ([5; 3], [5; 3], 3));
        assert!(laps.iter().all(|l| l.own >= l.least[0] && l.least_ratio() > 0.0 && l.ratio > 0.0));
    }
}
