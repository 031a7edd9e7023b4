//! Answers of the search with their certificates, which the independent verifier checks.

use crate::engine::question;
use crate::random_solids::{Random, placed, solid_of};
use crate::verifier::{Checked, UNSHOWN, check, check_within};
use contactd::contact::certificate::certify;
use contactd::contact::{Outcome, QueryOptions, Scratch, Status, earliest_contact};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Shape;

/// What a combination may cost the verifier that it has not shown within its usual budget: one pair of trees in a thousand has some.
const PATIENT: u64 = 20_000_000;

/// The answer to a pair, and what the verifier says of its certificate.
pub fn certified(a: (&Model, Placed), b: (&Model, Placed)) -> (Outcome, Result<Checked, String>) {
    let query = question(a, b, QueryOptions::DEPTH);
    let o = earliest_contact(&query, &mut Scratch::default());
    if o.status() == Status::Overlap {
        return (o, Ok(Checked::default()));
    }
    let Some(made) = certify(&query, &o) else { return (o, Err("no certificate".into())) };
    let mut text = String::new();
    made.write((0, 1), &mut text);
    let sides = ((&a.0.solid, &a.1), (&b.0.solid, &b.1));
    let checked = match check(&text, (0, 1), sides.0, sides.1) {
        Err(e) if e.contains(UNSHOWN) => check_within(PATIENT, &text, (0, 1), sides.0, sides.1),
        checked => checked,
    };
    let slack = if o.status() == Status::Undecided { 1e-5 } else { 0.0 };
    let proven = checked.and_then(|c| {
        if c.until >= o.time_lower() - slack {
            Ok(c)
        } else {
            Err(format!("{c:?} proves less than {}", o.time_lower()))
        }
    });
    (o, proven)
}

/// Certificates of so many pairs, drawn from a seed: each must hold, most pairs meet, few are undecided.
pub fn certify_all(name: &str, (count, seed): (usize, u64), make: impl Fn(&mut Random) -> [(Model, Placed); 2] + Sync) {
    let run = |first: usize| {
        let (mut told, mut refused, mut dearest) = ([0usize; 4], Vec::new(), [(0u64, 0); 2]);
        for i in (first..count).step_by(2) {
            let [a, b] = make(&mut Random::new(seed + i as u64));
            let (o, proven) = certified((&a.0, a.1), (&b.0, b.1));
            told[o.status() as usize] += 1;
            dearest[0] = dearest[0].max((o.counters.cells, i));
            match proven {
                Ok(checked) => dearest[1] = dearest[1].max((checked.cells, i)),
                Err(e) => refused.push(format!("{i}: {e}: {o:?}")),
            }
        }
        (told, refused, dearest)
    };
    let parts: Vec<_> = std::thread::scope(|s| {
        let started: Vec<_> = (0..2).map(|first| s.spawn(move || run(first))).collect();
        started.into_iter().map(|t| t.join().expect("a thread of the test")).collect()
    });
    let told: [usize; 4] = std::array::from_fn(|k| parts.iter().map(|p| p.0[k]).sum());
    let [search, proof] = [0, 1].map(|k| parts.iter().map(|p| p.2[k]).max().unwrap_or_default());
    let refused: Vec<String> = parts.into_iter().flat_map(|p| p.1).collect();
    let of = |status: Status| told[status as usize];
    println!(
        "{name}: {} contacts, {} clear, {} overlap, {} undecided, {} refused; at most {} cells of the search (pair {}), {} \
         of a certificate (pair {})",
        of(Status::Contact),
        of(Status::Clear),
        of(Status::Overlap),
        of(Status::Undecided),
        refused.len(),
        search.0,
        search.1,
        proof.0,
        proof.1
    );
    assert!(refused.is_empty(), "{name}:\n{}", refused.join("\n"));
    assert!(of(Status::Contact) * 5 > count && of(Status::Undecided) * 50 <= count, "{name}: {told:?}");
}

/// Certificates of some pairs of those that are drawn from a seed: each must hold, in few cells.
pub fn stay_small(name: &str, seed: u64, chosen: &[u64], make: impl Fn(&mut Random) -> [(Model, Placed); 2]) {
    for i in chosen {
        let [a, b] = make(&mut Random::new(seed + i));
        let (o, proven) = certified((&a.0, a.1), (&b.0, b.1));
        let cells = proven.unwrap_or_else(|e| panic!("{name} {i}: {e}: {o:?}")).cells;
        println!("{name} {i}: {} cells of the search, {cells} of the certificate", o.counters.cells);
        assert!(cells > 0 && cells < 4000, "{name} {i}: {cells} cells: {o:?}");
    }
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
