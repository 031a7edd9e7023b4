//! Certificates of answers hold against a verifier with interval arithmetic of its own.
#![allow(missing_docs)]

use contactd::contact::certificate::certify;
use contactd::contact::{Body, Outcome, PairQuery, Scratch, Status, default_resolution, earliest_contact};
use contactd::eco::Model;
use contactd::motion::Placed;
use contactd::solid::Solid;
use contactd_proto::Pose;
use contactd_tests::judge::cases;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Scene};
use contactd_tests::verifier::{Checked, check};

/// A pair with its answer's certificate as text; no text where none was made.
struct Certified {
    a: (Solid, Placed),
    b: (Solid, Placed),
    outcome: Outcome,
    text: Option<String>,
}

fn certified(a: (Solid, Placed), b: (Solid, Placed), resolution: Option<f64>) -> Certified {
    let (model_a, model_b) = (Model::new(a.0.clone()), Model::new(b.0.clone()));
    let query = PairQuery {
        a: Body { model: &model_a, placed: a.1 },
        b: Body { model: &model_b, placed: b.1 },
        resolution: resolution.unwrap_or_else(|| default_resolution(&model_a, &model_b)),
        cell_limit: 100_000,
        ideas: Default::default(),
    };
    let outcome = earliest_contact(&query, &mut Scratch::default());
    let text = certify(&query, &outcome).map(|c| {
        let mut text = String::new();
        c.write((0, 1), &mut text);
        text
    });
    Certified { a, b, outcome, text }
}

impl Certified {
    fn check(&self, text: &str) -> Result<Checked, String> {
        check(text, (0, 1), (&self.a.0, &self.a.1), (&self.b.0, &self.b.1))
    }
}

fn of_scene(scene: &Scene) -> Certified {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    certified((scene.a.build(), placed(scene.motion_a)), (scene.b.build(), placed(scene.motion_b)), scene.resolution)
}

/// Known gap: without octrees this proof takes more cells than the limit.
const NOT_CERTIFIED: &str = "tree_09";

#[test]
fn certificates_of_the_cases_hold() {
    let all = std::env::var_os("CONTACTD_ALL_CERTIFICATES").is_some();
    let (mut refused, mut count, mut sum) = (vec![], 0, Checked::default());
    for (i, case) in cases().into_iter().enumerate() {
        if (!all && i % 8 != 0) || case.name == NOT_CERTIFIED {
            continue;
        }
        count += 1;
        let c = certified(case.a, case.b, case.resolution);
        let what = match &c.text {
            None => Err(format!("no certificate ({:?})", c.outcome.status)),
            Some(text) => c.check(text),
        };
        match what {
            Ok(k) => {
                assert_eq!(k.until, c.outcome.time_lower, "{}", case.name);
                sum.cells += k.cells;
                sum.spans += k.spans;
                sum.combinations += k.combinations;
                sum.evaluations += k.evaluations;
                println!("{}: {k:?}", case.name);
            }
            Err(e) => refused.push(format!("{}: {e}", case.name)),
        }
    }
    println!("{count} cases, {} refused; {sum:?}", refused.len());
    assert!(refused.is_empty(), "{}", refused.join("\n"));
}

#[test]
fn certificates_of_random_scenes_hold() {
    let count = std::env::var("CONTACTD_CERTIFICATES").ok().and_then(|n| n.parse().ok()).unwrap_or(20);
    let mut rng = Random::new(0x5EED);
    let (mut checked, mut overlap, mut unfinished, mut refused) = (0, 0, 0, vec![]);
    for i in 0..count {
        let scene = scenes::any(&mut rng);
        let c = of_scene(&scene);
        match &c.text {
            None if c.outcome.status == Status::Overlap => overlap += 1,
            None => unfinished += 1,
            Some(text) => match c.check(text) {
                Ok(k) => {
                    assert_eq!(k.until, c.outcome.time_lower);
                    checked += 1;
                }
                Err(e) => refused.push(format!("{i} ({}): {e}", scene.class)),
            },
        }
    }
    println!(
        "{count} scenes: {checked} proven, {overlap} overlap, {unfinished} beyond the limit, {} refused",
        refused.len()
    );
    assert!(refused.len() * 50 <= count, "{}", refused.join("\n"));
    assert!((checked + overlap) * 20 >= count * 19);
}

#[test]
fn a_deleted_or_altered_exclusion_is_caught() {
    let mut rng = Random::new(7);
    let (mut deleted, mut altered) = (0, 0);
    for case in cases().into_iter().filter(|c| ["edge_00", "hole_04", "inside_08", "pair_08"].contains(&&*c.name)) {
        let c = certified(case.a, case.b, case.resolution);
        let text = c.text.as_ref().expect("a certificate");
        c.check(text).expect("it holds as it is");
        let lines: Vec<&str> = text.lines().collect();
        let with = |i: usize, line: Option<String>| {
            let mut all: Vec<String> = lines.iter().map(|s| s.to_string()).collect();
            match line {
                Some(line) => all[i] = line,
                None => drop(all.remove(i)),
            }
            all.join("\n") + "\n"
        };
        for _ in 0..12 {
            let i = 1 + rng.below(lines.len() - 1);
            let words: Vec<&str> = lines[i].split(' ').collect();
            if words[0] != "until" {
                if words[0] != "never" {
                    // A cell's end: its half of the space or time is open.
                    assert!(c.check(&with(i, None)).is_err(), "{}: line {i} deleted: {}", case.name, lines[i]);
                    deleted += 1;
                }
                continue;
            }
            // One of the combinations left out: some clause is open.
            let parts: Vec<&str> = lines[i].split(" |").collect();
            if parts.len() > 1 {
                let mut kept = parts.clone();
                kept.remove(1 + rng.below(parts.len() - 1));
                assert!(c.check(&with(i, Some(kept.join(" |")))).is_err(), "{}: {}", case.name, lines[i]);
                deleted += 1;
            }
            // A span until the end of the proof, the last of its cell's: whatever closes it gives out before.
            let last = !lines[i + 1].starts_with("until");
            if parts.len() == 2 && !last && lines[i + 1].split(" |").count() == 2 {
                let mut claim = words.clone();
                let until = c.outcome.time_upper.to_string();
                claim[1] = &until;
                assert!(c.check(&with(i, Some(claim.join(" ")))).is_err(), "{}: {}", case.name, lines[i]);
                altered += 1;
            }
            // One multiplier negated; one literal of the other sense.
            if let Some(k) = (2..words.len()).find(|k| words[*k] == "|" && words.get(k + 1) != Some(&"fit")) {
                let (lambda, name) = (format!("-{}", words[k + 2]), words[k + 1]);
                let flip = if name.contains('+') { name.replace('+', "-") } else { name.replace('-', "+") };
                for (at, word) in [(k + 2, &lambda), (k + 1, &flip)] {
                    let mut claim = words.clone();
                    claim[at] = word;
                    assert!(c.check(&with(i, Some(claim.join(" ")))).is_err(), "{}: {}", case.name, lines[i]);
                    altered += 1;
                }
            }
        }
        // A later time than the proof's, a box that leaves some of the carrier out, cells cut off at the end.
        let later = text.replacen(&format!("until {:e}", c.outcome.time_lower), "until 1", 1);
        assert!(c.outcome.time_lower == 1.0 || c.check(&later).is_err());
        let mut head: Vec<String> = lines[0].split(' ').map(String::from).collect();
        let at = head.len() - 1;
        head[at] = format!("{:e}", head[at].parse::<f64>().unwrap() * 0.99 - 1e-3);
        assert!(c.check(&with(0, Some(head.join(" ")))).is_err());
        let short: String = lines[..lines.len() - 1].join("\n");
        assert!(c.check(&short).is_err());
    }
    println!("{deleted} deleted, {altered} altered, all caught");
    assert!(deleted >= 20 && altered >= 30, "{deleted} {altered}");
}
