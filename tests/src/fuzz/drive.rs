//! A campaign: seeded mutation of a pool of inputs that grows by every input with a new word.

use super::Target;
use crate::random_solids::Random;
use std::collections::{BTreeMap, HashSet};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// An input that breaks a promise.
#[derive(Clone, Debug)]
pub struct Finding {
    /// What is wrong.
    pub what: String,
    /// The input, as short as cutting it has made it.
    pub input: Vec<u8>,
}

/// Runs an input; a panic is a finding like any other.
///
/// # Errors
/// The sentence that says what is wrong.
pub fn checked(target: &Target, bytes: &[u8], thorough: bool) -> Result<String, String> {
    catch_unwind(AssertUnwindSafe(|| (target.run)(bytes, thorough))).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
        Err(format!("panicked: {}", text.unwrap_or("without a sentence")))
    })
}

/// A run over many inputs.
pub struct Campaign<'t> {
    target: &'t Target,
    random: Random,
    pool: Vec<Vec<u8>>,
    /// The pool's inputs by the first word of what came of them.
    kinds: BTreeMap<String, Vec<usize>>,
    /// How many of the pool are seeds or corpus.
    seeds: usize,
    words: HashSet<String>,
    /// Inputs run.
    pub runs: u64,
    /// Inputs run with the slow checks.
    pub thorough: u64,
    /// Inputs by what came of them, the first word of it.
    pub shares: BTreeMap<String, u64>,
    /// Inputs whose word was new, in order.
    pub fresh: Vec<Vec<u8>>,
    /// What broke, one of each kind.
    pub findings: Vec<Finding>,
}

impl<'t> Campaign<'t> {
    /// A campaign from the target's seeds and a corpus.
    pub fn new(target: &'t Target, corpus: &[Vec<u8>], seed: u64) -> Self {
        let mut this = Self {
            target,
            random: Random::new(seed),
            pool: Vec::new(),
            kinds: BTreeMap::new(),
            seeds: 0,
            words: HashSet::new(),
            runs: 0,
            thorough: 0,
            shares: BTreeMap::new(),
            fresh: Vec::new(),
            findings: Vec::new(),
        };
        for input in (target.seeds)().into_iter().chain(corpus.iter().cloned()) {
            this.take(input, false);
        }
        // What is in the corpus already is not new.
        this.seeds = this.pool.len();
        this.fresh.clear();
        this
    }

    /// One more input.
    pub fn step(&mut self) {
        let input = self.next();
        let thorough = self.runs.is_multiple_of(self.target.thorough_every);
        self.take(input, thorough);
    }

    fn take(&mut self, input: Vec<u8>, thorough: bool) {
        self.runs += 1;
        self.thorough += u64::from(thorough);
        match checked(self.target, &input, thorough) {
            Ok(word) => {
                let first = word.split(' ').next().unwrap_or_default().to_owned();
                *self.shares.entry(first.clone()).or_default() += 1;
                if self.words.insert(word) {
                    self.kinds.entry(first).or_default().push(self.pool.len());
                    self.fresh.push(input.clone());
                    self.pool.push(input);
                }
            }
            Err(what) => self.found(what, input, thorough),
        }
    }

    fn found(&mut self, what: String, input: Vec<u8>, thorough: bool) {
        let kind = |s: &str| s.chars().filter(char::is_ascii_alphabetic).take(40).collect::<String>();
        *self.shares.entry("WRONG".into()).or_default() += 1;
        if self.findings.iter().any(|f| kind(&f.what) == kind(&what)) {
            return;
        }
        // Cut pieces out, halves first, as long as the same kind of thing stays wrong.
        let mut short = input;
        let mut piece = short.len().div_ceil(2);
        while piece > 0 {
            let mut at = 0;
            while at < short.len() {
                let mut cut = short.clone();
                cut.drain(at..(at + piece).min(cut.len()));
                match checked(self.target, &cut, thorough) {
                    Err(again) if kind(&again) == kind(&what) => short = cut,
                    _ => at += piece,
                }
            }
            piece /= 2;
        }
        let what = checked(self.target, &short, thorough).err().unwrap_or(what);
        self.findings.push(Finding { what, input: short });
    }

    /// A mutated, a spliced or a wholly random input.
    fn next(&mut self) -> Vec<u8> {
        const SPECIAL: [u8; 8] = [0, 1, 0x7f, 0x80, 0xfb, 0xfc, 0xfd, 0xff];
        let r = &mut self.random;
        if self.target.words.is_empty() && r.below(4) == 0 {
            let length = r.below(self.target.longest);
            return (0..length).map(|_| r.bits() as u8).collect();
        }
        // The seeds lead deepest; of what grew from them every kind of outcome counts alike, or refusals would soon
        // outnumber all others. One edit in two cases: what was taken is then often taken again.
        let i = if r.below(3) == 0 || self.kinds.is_empty() {
            r.below(self.seeds.clamp(1, self.pool.len()))
        } else {
            let kind = self.kinds.values().nth(r.below(self.kinds.len())).expect("a kind");
            kind[r.below(kind.len())]
        };
        let mut input = self.pool[i].clone();
        let edits = if r.below(2) == 0 { 1 } else { 1 + r.below(4) };
        for _ in 0..edits {
            let at = r.below(input.len() + 1);
            let end = (at + 1 + r.below(8)).min(input.len());
            match r.below(9) {
                0 if at < input.len() => input[at] ^= 1 << r.below(8),
                1 if at < input.len() => input[at] = r.bits() as u8,
                2 if at < input.len() => input[at] = SPECIAL[r.below(8)],
                3 => drop(input.drain(at..end)),
                4 => input.insert(at, r.bits() as u8),
                5 if !self.target.words.is_empty() => {
                    let word = self.target.words[r.below(self.target.words.len())];
                    drop(input.splice(at..at, word.bytes()));
                }
                6 => {
                    let other = &self.pool[r.below(self.pool.len())];
                    let from = r.below(other.len() + 1);
                    input.truncate(at);
                    input.extend_from_slice(&other[from..]);
                }
                7 => {
                    let piece = input[at..end].to_vec();
                    drop(input.splice(at..at, piece));
                }
                8 if r.below(10) == 0 => input.truncate(at),
                _ if at < input.len() => input[at] = input[at].wrapping_add(1),
                _ => {}
            }
        }
        input.truncate(self.target.longest);
        input
    }
}
