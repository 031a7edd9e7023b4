//! Answers of the search with their certificates, which the independent verifier checks.

use crate::engine::question;
use crate::random_solids::{Random, placed, solid_of};
use crate::verifier::check;
use contactd::contact::certificate::certify;
use contactd::contact::{Outcome, QueryOptions, Scratch, Status, earliest_contact};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Shape;

/// The answer to a pair, and what the verifier says of its certificate.
pub fn certified(a: (&Model, Placed), b: (&Model, Placed)) -> (Outcome, Result<(), String>) {
    let query = question(a, b, QueryOptions::DEPTH);
    let o = earliest_contact(&query, &mut Scratch::default());
    if o.status() == Status::Overlap {
        return (o, Ok(()));
    }
    let Some(made) = certify(&query, &o) else { return (o, Err("no certificate".into())) };
    let mut text = String::new();
    made.write((0, 1), &mut text);
    let checked = check(&text, (0, 1), (&a.0.solid, &a.1), (&b.0.solid, &b.1));
    let slack = if o.status() == Status::Undecided { 1e-5 } else { 0.0 };
    let proven = checked.and_then(|c| {
        if c.until >= o.time_lower() - slack {
            Ok(())
        } else {
            Err(format!("{c:?} proves less than {}", o.time_lower()))
        }
    });
    (o, proven)
}

/// Certificates of so many pairs, drawn from a seed: each must hold, most pairs meet, few are undecided.
pub fn certify_all(name: &str, (count, seed): (usize, u64), make: impl Fn(&mut Random) -> [(Model, Placed); 2] + Sync) {
    let run = |first: usize| {
        let (mut told, mut refused) = ([0usize; 4], Vec::new());
        for i in (first..count).step_by(2) {
            let [a, b] = make(&mut Random::new(seed + i as u64));
            let (o, proven) = certified((&a.0, a.1), (&b.0, b.1));
            told[o.status() as usize] += 1;
            if let Err(e) = proven {
                refused.push(format!("{i}: {e}: {o:?}"));
            }
        }
        (told, refused)
    };
    let parts: Vec<_> = std::thread::scope(|s| {
        let started: Vec<_> = (0..2).map(|first| s.spawn(move || run(first))).collect();
        started.into_iter().map(|t| t.join().expect("a thread of the test")).collect()
    });
    let told: [usize; 4] = std::array::from_fn(|k| parts.iter().map(|p| p.0[k]).sum());
    let refused: Vec<String> = parts.into_iter().flat_map(|p| p.1).collect();
    let of = |status: Status| told[status as usize];
    println!(
        "{name}: {} contacts, {} clear, {} overlap, {} undecided, {} refused",
        of(Status::Contact),
        of(Status::Clear),
        of(Status::Overlap),
        of(Status::Undecided),
        refused.len()
    );
    assert!(refused.is_empty(), "{name}:\n{}", refused.join("\n"));
    assert!(of(Status::Contact) * 5 > count && of(Status::Undecided) * 50 <= count, "{name}: {told:?}");
}

/// The same of trees whose primitives `shape` draws: two that meet at random, or pass each other.
pub fn certify_trees(counted: (usize, u64), shape: fn(&mut Random, f64) -> Shape) {
    certify_all("trees", counted, |r| {
        let tree = |r: &mut Random| {
            let depth = 1 + r.below(2);
            Model::new(solid_of(r, depth, shape))
        };
        let (a, b) = (tree(r), tree(r));
        let mut motions = [placed(r, 0.5), placed(r, 0.5)];
        let aside = r.direction() * 2.2;
        motions[1].motion.start.position += aside;
        motions[1].motion.velocity -= aside * r.within(0.3, 1.0);
        [(a, motions[0]), (b, motions[1])]
    });
}
