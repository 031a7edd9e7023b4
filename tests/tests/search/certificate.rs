//! Certificates of answers hold against a verifier with interval arithmetic of its own: all cases and 200 random scenes
//! (`CONTACTD_CERTIFICATES=N` for another number and all altered cases, `CONTACTD_CERTIFICATE_FIRST=I` from another one on),
//! and no altered one does.

use contactd::contact::certificate::certify;
use contactd::contact::{
    Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, default_resolution, earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Solid;
use contactd_proto::{Motion, Pose};
use contactd_tests::judge::cases;
use contactd_tests::random_solids::Random;
use contactd_tests::scenes::{self, Recipe, Scene};
use contactd_tests::sweep::sized;
use contactd_tests::verifier::{Checked, check};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;

/// Cells of a search, and of a certificate.
const CELLS: u64 = 100_000;

/// A pair with its answer's certificate as text; no text where none was made.
struct Certified {
    a: (Solid, Placed),
    b: (Solid, Placed),
    outcome: Outcome,
    text: Option<String>,
}

fn certified(a: (Solid, Placed), b: (Solid, Placed), resolution: Option<f64>, cell_limit: u64) -> Certified {
    let (model_a, model_b) = (Model::new(a.0.clone()), Model::new(b.0.clone()));
    let query = PairQuery {
        a: PlacedModel { model: &model_a, placed: a.1 },
        b: PlacedModel { model: &model_b, placed: b.1 },
        resolution: resolution.unwrap_or_else(|| default_resolution(&model_a, &model_b)),
        cell_limit,
        strategies: Default::default(),
        query_options: QueryOptions::DEPTH,
    };
    let outcome = earliest_contact(&query, &mut Scratch::default());
    let text = certify(&PairQuery { cell_limit: CELLS, ..query }, &outcome).map(|c| {
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

    /// Its certificate proves all of `time_lower`, and both ends of a contact's bracket; nothing to prove in overlap.
    fn proven(&self) -> Result<Option<Checked>, String> {
        let Some(text) = &self.text else {
            let overlap = self.outcome.status() == Status::Overlap;
            return if overlap { Ok(None) } else { Err(format!("no certificate of {:?}", self.outcome)) };
        };
        let checked = self.check(text)?;
        let witness = (self.outcome.status() == Status::Contact).then_some(self.outcome.time_upper());
        // Where the search gave up, the proof may end a little before.
        let least = self.outcome.time_lower() - if self.outcome.status() == Status::Undecided { 1e-5 } else { 0.0 };
        if checked.until < least || checked.until > self.outcome.time_lower() || checked.witness != witness {
            return Err(format!("{checked:?} proves less than {:?}", self.outcome));
        }
        Ok(Some(checked))
    }
}

fn of_scene(scene: &Scene, cell_limit: u64) -> Certified {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let (a, b) = ((scene.a.build(), placed(scene.motion_a)), (scene.b.build(), placed(scene.motion_b)));
    certified(a, b, scene.resolution, cell_limit)
}

/// Certificates over some numbered scenes, by both cores.
struct Sum {
    proven: usize,
    overlap: usize,
    undecided: usize,
    refused: Vec<String>,
    work: Checked,
}

fn over(count: u64, make: impl Fn(u64) -> (String, Certified) + Sync) -> Sum {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get()).min(8) as u64;
    let run = |first: u64| {
        let mut sum = Sum { proven: 0, overlap: 0, undecided: 0, refused: vec![], work: Checked::default() };
        for i in (first..count).step_by(threads as usize) {
            let (name, c) = make(i);
            sum.undecided += usize::from(c.outcome.status() == Status::Undecided);
            match c.proven() {
                Ok(None) => sum.overlap += 1,
                Ok(Some(k)) => {
                    sum.proven += 1;
                    sum.work.cells += k.cells;
                    sum.work.spans += k.spans;
                    sum.work.combinations += k.combinations;
                    sum.work.evaluations += k.evaluations;
                }
                Err(e) => sum.refused.push(format!("{i} {name}: {e}")),
            }
        }
        sum
    };
    let parts: Vec<Sum> = std::thread::scope(|s| {
        let run = &run;
        let started: Vec<_> = (0..threads).map(|first| s.spawn(move || run(first))).collect();
        started.into_iter().map(|t| t.join().expect("a thread of the test")).collect()
    });
    let total = parts.into_iter().reduce(|mut x, y| {
        x.proven += y.proven;
        x.overlap += y.overlap;
        x.undecided += y.undecided;
        x.refused.extend(y.refused);
        x.work.cells += y.work.cells;
        x.work.spans += y.work.spans;
        x.work.combinations += y.work.combinations;
        x.work.evaluations += y.work.evaluations;
        x
    });
    let total = total.expect("a thread");
    println!(
        "{count}: {} proven ({} of them undecided), {} overlap, {} refused; {:?}",
        total.proven,
        total.undecided,
        total.overlap,
        total.refused.len(),
        total.work
    );
    assert!(total.refused.is_empty(), "{}", total.refused.join("\n"));
    total
}

#[test]
fn certificates_of_the_cases_hold() {
    let all = cases();
    let sum = over(all.len() as u64, |i| {
        let case = &all[i as usize];
        (case.name.clone(), certified(case.a.clone(), case.b.clone(), case.resolution, CELLS))
    });
    assert_eq!((sum.proven, sum.undecided), (94, 0));
}

#[test]
fn certificates_of_random_scenes_hold() {
    let (count, first) = (sized("CONTACTD_CERTIFICATES", 36), sized("CONTACTD_CERTIFICATE_FIRST", 0));
    let sum = over(count, |i| {
        let scene = scenes::any(&mut Random::new(0x00CE_27F1_0000 + first + i));
        (scene.class.into(), of_scene(&scene, CELLS))
    });
    assert!(sum.overlap * 20 <= sum.proven, "{} of {count} overlap", sum.overlap);
}

#[test]
fn an_undecided_answer_has_a_certificate_up_to_its_time_lower() {
    let mut found = 0;
    for i in 0..40 {
        let c = of_scene(&scenes::any(&mut Random::new(90_000 + i)), 12);
        if c.outcome.status() == Status::Undecided && c.outcome.time_lower() > 0.05 {
            c.proven().unwrap_or_else(|e| panic!("scene {i}: {e}"));
            found += 1;
        }
    }
    assert!(found >= 5, "{found} undecided");
}

/// Lines of a certificate that are altered one at a time.
struct Altered<'c> {
    name: &'c str,
    of: &'c Certified,
    lines: Vec<String>,
    caught: BTreeMap<&'static str, usize>,
}

impl Altered<'_> {
    /// The certificate with a line replaced, or left out, must be refused.
    #[track_caller]
    fn line(&mut self, what: &'static str, i: usize, line: Option<String>) {
        let mut all = self.lines.clone();
        match line {
            Some(line) => all[i] = line,
            None => drop(all.remove(i)),
        }
        self.lines(what, all, i);
    }

    #[track_caller]
    fn lines(&mut self, what: &'static str, all: Vec<String>, i: usize) {
        assert_ne!(all, self.lines);
        let verdict = self.of.check(&(all.join("\n") + "\n"));
        assert!(verdict.is_err(), "{}: {what} at line {i}: {}", self.name, self.lines[i]);
        *self.caught.entry(what).or_default() += 1;
    }

    #[track_caller]
    fn word(&mut self, what: &'static str, i: usize, at: usize, word: &str) {
        let mut words: Vec<&str> = self.lines[i].split(' ').collect();
        words[at] = word;
        let line = words.join(" ");
        self.line(what, i, Some(line));
    }
}

#[test]
fn a_deleted_or_altered_exclusion_is_caught() {
    let mut rng = Random::new(7);
    let mut caught: BTreeMap<&str, usize> = BTreeMap::new();
    // The dearer half where it is asked for.
    let chosen = ["edge_03", "inside_08", "pair_01", "edge_00", "hole_04", "pair_08"];
    let halves = 1 + usize::from(std::env::var_os("CONTACTD_CERTIFICATES").is_some());
    let chosen = &chosen[..3 * halves];
    for case in cases().into_iter().filter(|c| chosen.contains(&&*c.name)) {
        let c = certified(case.a, case.b, case.resolution, CELLS);
        let text = c.text.as_ref().expect("a certificate");
        c.proven().expect("it holds as it is");
        let lines: Vec<String> = text.lines().map(String::from).collect();
        let mut altered = Altered { name: &case.name, of: &c, lines: lines.clone(), caught: BTreeMap::new() };
        let head: Vec<&str> = lines[0].split(' ').collect();
        let number = |words: &[&str], k: usize| words[k].parse::<f64>().expect("a number");
        // The head: each side of the box a little less, another reference body, a later end, a smaller depth.
        for k in 0..6 {
            let at = head.len() - 6 + k;
            let (v, sign) = (number(&head, at), if k < 3 { 1.0 } else { -1.0 });
            altered.word("a side of the box", 0, at, &format!("{:e}", v + sign * (0.01 * v.abs() + 1e-3)));
        }
        altered.word("the reference", 0, 4, if head[4] == "0" { "1" } else { "0" });
        altered.word("a smaller depth", 0, 6, &format!("{:e}", number(&head, 6) * 1e-3));
        if c.outcome.time_upper() < 1.0 {
            altered.word("a later end", 0, 8, &format!("{:e}", 0.5 * (c.outcome.time_upper() + 1.0)));
        }
        let fewer = head[10].parse::<usize>().expect("a number of cells") - 1;
        altered.word("the number of cells", 0, 10, &fewer.to_string());
        // The witness: elsewhere, at another time.
        let words: Vec<&str> = lines[1].split(' ').collect();
        assert_eq!(words[0], "witness");
        let delta = number(&head, 6);
        for k in 2..5 {
            // Outside one of the two bodies on one side at least: by far more than the depth on all.
            let v = number(&words, k);
            let both = [1.0, -1.0].map(|sign| {
                let mut words: Vec<String> = words.iter().map(|w| w.to_string()).collect();
                words[k] = format!("{:e}", v + sign * 1e3 * delta);
                let mut all = lines.clone();
                all[1] = words.join(" ");
                c.check(&(all.join("\n") + "\n")).is_err()
            });
            if both[0] || both[1] {
                *altered.caught.entry("a witness elsewhere").or_default() += 1;
            }
        }
        altered.word("a witness too early", 1, 1, &format!("{:e}", c.outcome.time_lower() * (1.0 - 1e-6)));
        altered.word("a witness far away", 1, 2, &format!("{:e}", number(&words, 2) + 10.0));
        // The last cell missing, with and without the count of cells set right.
        let ends = |w: &str| ["done", "inside", "split"].contains(&w);
        let last = lines[..lines.len() - 1].iter().rposition(|l| ends(l.split(' ').next().unwrap_or_default()));
        altered.lines("the last cell missing", lines[..=last.unwrap_or(1)].to_vec(), 0);
        for _ in 0..if head[10] == "1" { 4 } else { 10 } {
            let i = 2 + rng.below(lines.len() - 2);
            let words: Vec<&str> = lines[i].split(' ').collect();
            match words[0] {
                "never" => {
                    let name = words[1];
                    let flip = if name.contains('+') { name.replace('+', "-") } else { name.replace('-', "+") };
                    altered.word("a literal's sense", i, 1, &flip);
                    continue;
                }
                "until" => {}
                "split" => {
                    altered.line("a split left out", i, None);
                    altered.word("a split elsewhere", i, 2, "1e3");
                    continue;
                }
                _ => {
                    altered.line("a cell's end", i, None);
                    // The whole of a leaf, the count of cells set right: what follows stands for another place.
                    let from = lines[..i].iter().rposition(|l| ends(l.split(' ').next().unwrap_or_default()));
                    let mut all = lines.clone();
                    all.drain(from.map_or(2, |f| f + 1)..=i);
                    let mut head: Vec<String> = head.iter().map(|w| w.to_string()).collect();
                    head[10] = fewer.to_string();
                    all[0] = head.join(" ");
                    altered.lines("a cell missing", all, i);
                    continue;
                }
            }
            // One of the combinations left out: some clause is open.
            let parts: Vec<&str> = lines[i].split(" |").collect();
            if (2..40).contains(&parts.len()) {
                let mut kept = parts.clone();
                kept.remove(1 + rng.below(parts.len() - 1));
                altered.line("a combination", i, Some(kept.join(" |")));
            }
            // A span until the end of the proof, not the last of its cell's: whatever closes it gives out before.
            let last = !lines[i + 1].starts_with("until");
            if parts.len() == 2 && !last && lines[i + 1].split(" |").count() == 2 {
                altered.word("a time span", i, 1, &format!("{:e}", c.outcome.time_lower()));
            }
            altered.word("a span backwards", i, 1, "-1e-3");
            let Some(k) = (2..words.len()).find(|k| words[*k] == "|" && words.get(k + 1) != Some(&"fit")) else {
                continue;
            };
            let name = words[k + 1];
            let flip = if name.contains('+') { name.replace('+', "-") } else { name.replace('-', "+") };
            altered.word("a literal's sense", i, k + 1, &flip);
            // A multiplier at the start or the end of the span, whichever is not zero.
            let value = |w: &str| w.parse::<f64>().expect("a number");
            if let Some(at) = [k + 2, k + 3].into_iter().find(|at| value(words[*at]) > 0.0) {
                altered.word("a multiplier negated", i, at, &format!("-{}", words[at]));
            }
            // Literals of both bodies over the whole of the reference body: the reference body's own hold somewhere in it, alone or with
            // far more weight than is theirs.
            let whole = words[k + 1..].iter().take_while(|w| **w != "|").count();
            let terms: Vec<&[&str]> = words[k + 1..k + 1 + whole].chunks(6).collect();
            let of_a = |t: &&[&str]| t[0].starts_with('a');
            let mixed = terms.iter().any(of_a) && !terms.iter().all(of_a);
            if head[10] == "1" && mixed && terms.iter().all(|t| t[0] != "fit") {
                let rest = words[k + 1 + whole..].iter().copied();
                let kept = terms.iter().filter(|t| of_a(t)).flat_map(|t| t.iter().copied());
                let line: Vec<&str> = words[..=k].iter().copied().chain(kept).chain(rest).collect();
                altered.line("missing literals", i, Some(line.join(" ")));
                let reference = terms.iter().position(|t| t[0].starts_with('a')).expect("a literal of the reference");
                altered.word("a multiplier", i, k + 2 + 6 * reference, "1e9");
            }
        }
        for (what, n) in altered.caught {
            *caught.entry(what).or_default() += n;
        }
    }
    println!("caught: {caught:?}");
    let kinds = [
        ("a side of the box", 30),
        ("the reference", 5),
        ("a smaller depth", 5),
        ("a later end", 3),
        ("the number of cells", 5),
        ("a witness elsewhere", 10),
        ("a witness too early", 5),
        ("a witness far away", 5),
        ("the last cell missing", 5),
        ("a literal's sense", 20),
        ("a split left out", 2),
        ("a split elsewhere", 2),
        ("a cell's end", 5),
        ("a cell missing", 5),
        ("a combination", 20),
        ("a time span", 3),
        ("a span backwards", 20),
        ("a multiplier negated", 20),
        ("a multiplier", 10),
        ("missing literals", 10),
    ];
    for (kind, least) in kinds {
        let n = caught.get(kind).copied().unwrap_or_default();
        assert!(2 * n >= halves * least, "{kind}: {n} caught");
    }
}

#[test]
fn what_lies_on_itself_is_certified() {
    let turned = |r: Recipe| r.moved(&Pose::new(DVec3::ZERO, DQuat::from_rotation_z(0.7)));
    let falling =
        Motion::turning(Pose::at(DVec3::new(0.1, 0.2, 5.0)), DVec3::new(0.0, 0.0, -5.0), DVec3::new(1.0, 0.3, 0.2));
    let plate = Recipe::cuboid(2.0, 2.0, 0.5);
    let parts = [Recipe::sphere(1.0), Recipe::cylinder(0.7, 0.5), Recipe::cone(0.8, 0.3, 0.6)];
    let inner = [
        Recipe::sphere(1.0 - 1.9e-6),
        Recipe::cylinder(0.7 - 1.9e-6, 0.6),
        Recipe::cone(0.8 - 1.9e-6, 0.3 - 1.9e-6, 0.6),
    ];
    for (part, inner) in parts.into_iter().zip(inner) {
        let beside = Recipe::cuboid(0.3, 0.4, 0.2).at(0.0, 0.0, -1.4);
        let skin = part.clone().minus(turned(part.clone()));
        let kinds = [
            skin.clone(),
            skin.union(beside.clone()),
            part.clone().minus(inner),
            part.clone().union(turned(part.clone())),
            part.clone().union(beside).minus(turned(part)),
        ];
        for (i, body) in kinds.into_iter().enumerate() {
            let mut scene = Scene::new("itself", plate.clone(), Motion::resting(Pose::IDENTITY), body, falling);
            scene.resolution = Some(1e-6);
            let c = of_scene(&scene, CELLS);
            assert_ne!(c.outcome.status(), Status::Undecided, "{i}: {:?}", c.outcome);
            let checked = c.proven().unwrap_or_else(|e| panic!("{i}: {e}"));
            assert!(checked.is_some(), "{i}: {:?}", c.outcome);
        }
    }
}
