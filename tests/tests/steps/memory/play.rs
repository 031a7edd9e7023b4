//! A play in a world that remembers, beside one made for each of its steps; what is remembered is proven by an independent
//! verifier.

use contactd::contact::{Counters, Outcome, RegionPoint, Status};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::world::memory::{Beside, Remembered};
use contactd::world::{MeasuredModel, PairOutcome, PairPlan, StepOptions, StepOutcome, World, record};
use contactd_proto::contact_record::{ContactRecord, DETAIL_SLOT, DetailSlot};
use contactd_proto::{Detect, InitialOverlap, Motion, MotionState, Rule};
use contactd_tests::scenes::Recipe;
use contactd_tests::stepped::{Act, Change, Play, Thing, motion_states};
use contactd_tests::verifier::UNSHOWN;
use contactd_tests::verifier::memory::{Proven, Truth, UNTOLD, check};
use std::sync::Arc;

pub fn part(recipe: &Recipe) -> Arc<MeasuredModel> {
    Arc::new(MeasuredModel::new(Arc::new(Model::new(recipe.build()))))
}

/// The reply to a step as its caller reads it, to the bit: header and all slots, work left out.
pub fn reported(world: &World) -> (String, Vec<ContactRecord>) {
    let out = world.outcome();
    let r = record::reply(out, true);
    let header = format!(
        "{} {} {} {} {:x} {}",
        r.status,
        r.records,
        r.slots,
        r.truncated,
        r.safe_time.to_bits(),
        out.may_have_passed
    );
    let slot = |i: usize| {
        let slot = record::slot(world, out, true, i);
        let detail: DetailSlot = bytemuck::cast(slot);
        // Cells are work.
        if i >= out.pairs.len() && detail.tag == DETAIL_SLOT {
            bytemuck::cast(DetailSlot { cells: 0, ..detail })
        } else {
            slot
        }
    };
    (header, (0..record::slots_of(out, true)).map(slot).collect())
}

pub fn same(a: &(String, Vec<ContactRecord>), b: &(String, Vec<ContactRecord>)) -> bool {
    a.0 == b.0 && bytemuck::cast_slice::<_, u8>(&a.1) == bytemuck::cast_slice::<_, u8>(&b.1)
}

/// The first slot in which two replies differ.
pub fn differing(a: &(String, Vec<ContactRecord>), b: &(String, Vec<ContactRecord>)) -> String {
    let bytes = |x: &ContactRecord| bytemuck::bytes_of(x).to_vec();
    let slots = a.1.iter().zip(&b.1).enumerate().find(|(_, (x, y))| bytes(x) != bytes(y));
    let slots = slots.map(|(i, (x, y))| {
        let at: Vec<usize> =
            bytes(x).iter().zip(bytes(y)).enumerate().filter(|(_, (x, y))| **x != *y).map(|(k, _)| k).collect();
        format!("slot {i} of {}, bytes {at:?}: {x:?}, {y:?}", a.1.len())
    });
    format!("{} {} {slots:?}", a.0, b.0)
}

/// A pair with all that is told of it but the work that it took, `regions` or not. A field that is not told may be 0 or -0.
fn line(out: &StepOutcome, p: &PairOutcome, regions: bool) -> String {
    let outcome = Outcome { counters: Counters::default(), apart: 0.0, ..p.outcome };
    let regions = if regions { out.regions_of(p) } else { &[] };
    let text = format!("{:?} {} {outcome:?} {regions:?}", (p.a, p.b), p.regions_complete);
    text.replace("-0.0,", "0.0,").replace("-0.0)", "0.0)")
}

/// Every pair of a step, as `line` has it.
fn lines(out: &StepOutcome, regions: bool) -> Vec<String> {
    out.pairs.iter().map(|p| line(out, p, regions)).collect()
}

/// A world that has never been asked anything: objects, rules and the tracks of the step before.
struct Fresh {
    parts: Vec<Arc<MeasuredModel>>,
    things: Vec<Thing>,
    rules: Vec<Rule>,
    resolution: Option<f64>,
    motion_states: Vec<(u32, MotionState)>,
}

impl Fresh {
    fn world(&self) -> World {
        let mut world = World::new(256, 256);
        for thing in &self.things {
            world.add_object(thing.spec(&self.parts)).expect("an object");
        }
        world.set_rules(self.rules.clone()).expect("rules");
        world.set_resolution(self.resolution).expect("a resolution");
        world.restore(&self.motion_states).expect("motion_states");
        world
    }

    fn change(&mut self, change: &Change) {
        match change {
            Change::Add(thing) => self.things.push(thing.clone()),
            Change::Remove(id) => {
                self.things.retain(|t| t.id != *id);
                self.motion_states.retain(|t| t.0 != *id);
            }
            Change::Rules(rules) => self.rules.clone_from(rules),
            Change::Resolution(resolution) => self.resolution = *resolution,
        }
    }
}

pub fn apply(world: &mut World, parts: &[Arc<MeasuredModel>], change: &Change) {
    match change {
        Change::Add(thing) => world.add_object(thing.spec(parts)).expect("an object"),
        Change::Remove(id) => world.remove_object(*id).expect("an object to remove"),
        Change::Rules(rules) => world.set_rules(rules.clone()).expect("rules"),
        Change::Resolution(resolution) => world.set_resolution(*resolution).expect("a resolution"),
    }
}

#[derive(Default)]
pub struct Work {
    pub difference: Option<String>,
    pub steps: usize,
    /// Steps with a contact, with an overlap alone, with nothing met; of the last those without a search.
    pub contacts: usize,
    pub overlaps: usize,
    pub clear: usize,
    pub known: usize,
    /// Steps that only a session without memory had to leave open.
    pub open: usize,
    /// Certificates that hold, by kind: clearance, directions, predicted motion, answer, overlap; free until after the first contact; and
    /// what is told beside an answer: apart, regions.
    pub proven: [usize; 8],
    /// What has no certificate: answers of memory, what is beyond a threshold, regions.
    pub unproven: [usize; 3],
    /// Certificates that the checker's budget did not suffice for.
    pub unshown: usize,
    pub refused: Option<String>,
    /// Steps with more than 12 primitives in both trees of some pair asked about.
    pub large: usize,
}

/// Cells that the proof of a predicted motion or an answer may take.
const CELLS: u64 = 4_000;

/// Asks a world for a certificate of each pair that it has answered without a search, and checks it against the motions that
/// another world has.
fn certificates(warm: &World, cold: &World, work: &mut Work) -> Result<(), String> {
    let ids: Vec<u32> = cold.bodies().iter().map(|b| b.id).collect();
    let truths: Vec<Truth> = cold
        .bodies()
        .iter()
        .map(|b| Truth::new(&b.part.model.solid, Placed { place: b.place, motion: b.motion_state.motion }))
        .collect();
    let pair = |a: u32, b: u32| {
        let detect = cold.plan_of(a, b)?.detect;
        let places = [ids.iter().position(|id| *id == a)?, ids.iter().position(|id| *id == b)?];
        let bodies = places.map(|k| match detect {
            Detect::Discrete => truths[k].moving(Motion::resting(cold.bodies()[k].motion_state.end)),
            _ => truths[k],
        });
        let own = places.map(|k| cold.bodies()[k].part.resolution);
        Some((bodies, cold.resolution().unwrap_or(own[0].max(own[1]))))
    };
    for (i, a) in ids.iter().enumerate() {
        for (j, b) in ids.iter().enumerate().skip(i + 1) {
            let Some(plan) = cold.plan_of(*a, *b) else { continue };
            let remembered = warm.remembered(*a, *b).ok_or(format!("{a}, {b}: nothing is said of the pair"))?;
            if remembered == Remembered::Nothing {
                continue;
            }
            let Some(text) = warm.certificate_of(*a, *b, CELLS) else {
                work.unproven[0] += 1;
                continue;
            };
            let (bodies, resolution) = pair(*a, *b).expect("bodies");
            let kind = match check(&text, (*a, *b), bodies, resolution, &pair) {
                Ok(Proven::Clearance) => 0,
                Ok(Proven::Directions) => 1,
                Ok(Proven::PredictedMotion) => 2,
                Ok(Proven::Answer(checked)) => {
                    // Of later pairs than the first contact nothing need be told.
                    let Remembered::Answer { outcome, .. } = remembered else {
                        return Err(format!("{a}, {b}: {remembered:?} is reported as an answer"));
                    };
                    let lower = outcome.time_lower();
                    if warm.outcome().pairs.iter().any(|p| (p.a, p.b) == (*a, *b) && p.outcome.time_lower() != lower) {
                        return Err(format!("{a}, {b}: remembered until {lower}, reported otherwise"));
                    }
                    if checked.until < lower && plan.detect != Detect::Discrete {
                        return Err(format!("{a}, {b}: proven until {}, reported {lower}", checked.until));
                    }
                    3
                }
                Ok(Proven::Overlap) => 4,
                Ok(Proven::Horizon { first, until }) => {
                    let Remembered::Horizon { outcome, .. } = remembered else {
                        return Err(format!("{a}, {b}: {remembered:?} is reported as left"));
                    };
                    let stops = warm.outcome().pairs.iter().filter(|p| !p.plan.sensor && p.outcome.meets());
                    let told = stops.map(|p| p.outcome.time_upper()).fold(f64::INFINITY, f64::min);
                    if until != outcome.time_lower() || first > told {
                        return Err(format!(
                            "{a}, {b}: left at {until} of {outcome:?}, the first contact is told by {told}"
                        ));
                    }
                    5
                }
                Ok(proven) => return Err(format!("{a}, {b}: {proven:?} is no answer")),
                // Neither shown nor refuted: counted, and bounded by the test.
                Err(e) if e.contains(UNSHOWN) => {
                    work.unshown += 1;
                    continue;
                }
                Err(e) => {
                    let motion_states = [i, j].map(|k| cold.bodies()[k].motion_state);
                    return Err(format!(
                        "{a}, {b}: {e}\n{}\n{plan:?}\n{motion_states:?}",
                        &text[..text.len().min(600)]
                    ));
                }
            };
            work.proven[kind] += 1;
            if let Remembered::Answer { .. } = remembered {
                beside(warm, (*a, *b), plan, (bodies, resolution), work)
                    .map_err(|e| format!("{a}, {b}: {e}\n{plan:?}"))?;
            }
        }
    }
    Ok(())
}

/// Radii, in radii of the smaller body, of the cells in which bodies that touch are left.
const LEFT: [f64; 3] = [0.25, 0.06, 0.015];

/// The same of what is told beside an answer that is repeated: that its bodies don't touch, or where.
fn beside(
    warm: &World,
    (a, b): (u32, u32),
    plan: &PairPlan,
    (bodies, resolution): ([Truth; 2], f64),
    work: &mut Work,
) -> Result<(), String> {
    let nobody = |_, _| None;
    let told = warm.outcome().pairs.iter().find(|p| (p.a, p.b) == (a, b));
    for (i, left) in LEFT.into_iter().enumerate() {
        let Some(Beside { apart, regions }) = warm.certificates_beside(a, b, (4 * CELLS, left)) else { return Ok(()) };
        let near = |threshold: f64| threshold >= plan.margin && threshold >= 2.0 * resolution;
        match apart.filter(|_| i == 0) {
            None => {}
            Some(None) => work.unproven[1] += 1,
            Some(Some(text)) => {
                let Proven::Apart { threshold, until } = check(&text, (a, b), bodies, resolution, &nobody)? else {
                    return Err("not proven apart".into());
                };
                let until = if plan.margin > 0.0 { until } else { 1.0 };
                let told = told.map(|p| &p.outcome);
                let same = |o: &Outcome| !o.touching && (o.status() != Status::Clear || o.margin_time == until);
                if !near(threshold) || !told.is_none_or(same) {
                    return Err(format!("proven {threshold:e} apart until {until}, told {told:?}"));
                }
                work.proven[6] += 1;
            }
        }
        let text = match regions {
            None => return Ok(()),
            Some(None) => {
                work.unproven[2] += 1;
                return Ok(());
            }
            Some(Some(text)) => text,
        };
        match check(&text, (a, b), bodies, resolution, &nobody) {
            Ok(Proven::Regions { threshold, .. }) => {
                let told = told.map_or(&[][..], |p| warm.outcome().regions_of(p));
                let line = |p: &RegionPoint| {
                    let [x, y, z] = p.point.to_array();
                    format!("point {x:e} {y:e} {z:e} {:e}\n", p.separation)
                };
                let all = told.iter().flat_map(|region| &region.points).all(|p| text.contains(&line(p)));
                if !near(threshold) || !all {
                    return Err(format!("proven for {threshold:e}, told {told:?}\n{text}"));
                }
                work.proven[7] += 1;
                return Ok(());
            }
            Err(e) if e.starts_with(UNTOLD) && i + 1 < LEFT.len() => {}
            Err(e) => return Err(format!("{e}\n{}", &text[..text.len().min(2_000)])),
            Ok(proven) => return Err(format!("{proven:?} is nothing of regions")),
        }
    }
    Ok(())
}

/// A play in a world that remembers, and each of its steps in a world made for it.
pub fn run(seed: u64, steps: usize) -> Work {
    run_play(seed, Play::new(seed), steps)
}

pub fn run_play(seed: u64, mut play: Play, steps: usize) -> Work {
    let parts: Vec<Arc<MeasuredModel>> = play.recipes.iter().map(part).collect();
    // Octrees are refined by searches: the fresh worlds have models of their own.
    let own: Vec<Arc<MeasuredModel>> = play.recipes.iter().map(part).collect();
    let mut fresh =
        Fresh { parts: own, things: Vec::new(), rules: Vec::new(), resolution: None, motion_states: Vec::new() };
    let mut warm = World::new(256, 256);
    warm.certify(true);
    let mut work = Work::default();
    let mut free = 1.0;
    for k in 0..steps {
        let Act { changes, records, options } = play.next(free);
        for change in &changes {
            fresh.change(change);
            apply(&mut warm, &parts, change);
        }
        let mut cold = fresh.world();
        cold.step(&records, &options).expect("a step");
        warm.step(&records, &options).expect("a step");
        let (expected, answer) = (cold.outcome(), warm.outcome());
        if !same(&reported(&warm), &reported(&cold)) {
            // What a limit left open may be known; then it is what no limit leaves open.
            // An overlap that was to be searched past, too: how deep it is was not proven.
            let is_left = |p: &PairOutcome| match p.outcome.status() {
                Status::Undecided => true,
                Status::Overlap => p.plan.initial_overlap == InitialOverlap::IgnoreIfSeparating,
                _ => false,
            };
            let is_open = |p: &PairOutcome| is_left(p) || !p.regions_complete;
            let open = expected.undecided || expected.pairs.iter().any(is_open);
            let (mine, other) = (lines(answer, true), lines(expected, true));
            let wide = StepOptions { cell_limit: 0, batch_limit: 0, max_records: 0, max_patch_slots: 0, ..options };
            let mut whole = fresh.world();
            let found = whole.step(&records, &wide).expect("a step");
            let all = lines(found, true);
            // Where the first contact is left open clear pairs are told beside it, which are left out once it is known.
            let mut whole = fresh.world();
            let beside = whole.step(&records, &StepOptions { first: false, ..wide }).expect("a step");
            let is_clear = |p: &&PairOutcome| p.outcome.status() == Status::Clear && answer.undecided;
            let clear: Vec<String> = beside.pairs.iter().filter(is_clear).map(|p| line(beside, p, true)).collect();
            let is_known = open && {
                // What the whole step's limit leaves for a pair depends on what others took, of which some may be known: such a
                // pair stays undecided from a time on before which it is free.
                let meets = |p: &PairOutcome| {
                    let same = found.pairs.iter().find(|q| (q.a, q.b) == (p.a, p.b));
                    same.filter(|q| q.outcome.status() != Status::Clear)
                        .map_or(f64::INFINITY, |q| q.outcome.time_upper())
                };
                let cut = |p: &PairOutcome| options.batch_limit > 0 && is_left(p) && p.outcome.time_lower() <= meets(p);
                // So does when it comes within its margin: where that is cut short it is told early.
                let nears = |p: &PairOutcome| {
                    let same = found.pairs.iter().find(|q| (q.a, q.b) == (p.a, p.b));
                    same.map_or(f64::INFINITY, |q| q.outcome.margin_time)
                };
                let early = |p: &PairOutcome| {
                    let is_cut = options.batch_limit > 0 && !p.regions_complete;
                    is_cut && p.outcome.status() == Status::Clear && p.outcome.margin_time <= nears(p)
                };
                // Regions that a limit cuts short are those that were looked at first.
                let (heads, others) = (lines(answer, false), lines(expected, false));
                let few = |k: usize| !answer.pairs[k].regions_complete && others.contains(&heads[k]);
                let pairs = mine.iter().zip(&answer.pairs).enumerate();
                pairs.into_iter().all(|(k, (line, p))| {
                    let told = [&all, &other, &clear].iter().any(|lines| lines.contains(line));
                    told || cut(p) || early(p) || few(k)
                })
            };
            if !is_known {
                let differs = |a: &[String], b: &[String]| {
                    a.iter().filter(|x| !b.contains(x)).map(|x| x[..x.len().min(600)].to_string()).collect::<Vec<_>>()
                };
                let known = |p: &PairOutcome| format!("{:?} {:?}: {:?}", (p.a, p.b), p.plan, warm.remembered(p.a, p.b));
                let differing_pairs = mine.iter().zip(&answer.pairs).filter(|(line, _)| !other.contains(line));
                let known: Vec<String> = differing_pairs.map(|(_, p)| known(p)).take(3).collect();
                work.difference = Some(format!(
                    "seed {seed}, step {k}, {options:?}\nremembers: {:#?}\nfresh: {:#?}\nwithout limits: {:#?}\n{known:#?}\n{}",
                    differs(&mine, &other),
                    differs(&other, &mine),
                    differs(&all, &mine),
                    differing(&reported(&warm), &reported(&cold))
                ));
                break;
            }
            work.open += 1;
        }
        if let Err(e) = certificates(&warm, &cold, &mut work) {
            work.refused = Some(format!("seed {seed}, step {k}: {e}"));
            break;
        }
        work.steps += 1;
        let has = |status| expected.pairs.iter().any(|p| p.outcome.status() == status);
        work.contacts += usize::from(has(Status::Contact));
        work.overlaps += usize::from(!has(Status::Contact) && has(Status::Overlap));
        if !expected.contact && !expected.undecided {
            work.clear += 1;
            work.known += usize::from(answer.known == answer.searched);
        }
        work.large += usize::from(answer.counters.primitives > 12);
        free = expected.safe_time;
        fresh.motion_states = motion_states(&cold);
        play.follow(&cold);
    }
    work
}
