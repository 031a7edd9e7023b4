//! Outcomes as 128-byte slots: what the pair's plan asks for, everything else zero with its `valid` bit clear.
//!
//! Behind the records stand their further slots, pair by pair: the detail slot where asked for, then for each region its
//! own slot and the points that bound it, four a slot, and last the clearance slot.

use super::outcome::{PairOutcome, StepOutcome};
use super::scene::World;
use crate::contact::distance::Distance;
use crate::contact::{Region, Status};
use contactd_proto::contact_record::{self as wire, ClearanceSlot, ContactRecord, DetailSlot, PatchSlot, RegionSlot};
use contactd_proto::step::{STEP_CLEAR, STEP_CONTACT, STEP_UNDECIDED, StepReply, WorkCounters};
use contactd_proto::{Report, step};

/// Number of slots that the reply to a step needs.
pub fn slots_of(out: &StepOutcome, details: bool) -> usize {
    let patches = out.pairs.last().map_or(0, |p| p.patch_slots.0 + p.patch_slots.1);
    out.pairs.len() * if details { 2 } else { 1 } + patches as usize
}

/// Further slots that some regions take.
pub fn patch_slots(regions: &[Region]) -> u32 {
    regions.iter().map(|r| 1 + r.points.len().div_ceil(4) as u32).sum()
}

/// Slot `index` of the reply: records first, then their further slots, in the same order.
pub fn slot(world: &World, out: &StepOutcome, details: bool, index: usize) -> ContactRecord {
    let n = out.pairs.len();
    let detail_slots = usize::from(details);
    let start = |i: usize| n + i * detail_slots + out.pairs[i].patch_slots.0 as usize;
    if index < n {
        let mut record = record(&out.pairs[index]);
        let slots = detail_slots as u32 + out.pairs[index].patch_slots.1;
        if slots > 0 {
            (record.slot, record.slots) = (start(index) as u32, slots);
        }
        return record;
    }
    // The last pair whose slots begin at or before this one; pairs without slots share their beginning with the next.
    let (mut low, mut high) = (0, n);
    while high - low > 1 {
        let middle = (low + high) / 2;
        if start(middle) <= index { low = middle } else { high = middle }
    }
    let pair = &out.pairs[low];
    let own = index - start(low);
    if own < detail_slots {
        return detail(world, pair).into();
    }
    match out.clearance_of(pair) {
        Some(found) if own + 1 == detail_slots + pair.patch_slots.1 as usize => {
            clearance(found, pair.plan.clearance).into()
        }
        _ => patch(out.regions_of(pair), own - detail_slots),
    }
}

/// The slot of a least distance that was asked for to a tolerance.
fn clearance(found: &Distance, tolerance: f64) -> ClearanceSlot {
    let points = [found.a.point, found.b.point];
    let has_points = points.iter().all(|x| x.is_finite());
    let flags = [(found.is_settled, wire::CLEARANCE_SETTLED), (has_points, wire::CLEARANCE_POINTS)];
    ClearanceSlot {
        tag: wire::CLEARANCE_SLOT,
        flags: flags.iter().map(|(on, bit)| if *on { *bit } else { 0 }).sum(),
        lower: found.lower,
        upper: found.upper,
        time: found.time,
        points: if has_points { points.map(|x| x.to_array()) } else { [[0.0; 3]; 2] },
        faces_a: found.a.faces,
        faces_b: found.b.faces,
        tolerance,
        cells: found.cells,
        spare: 0,
    }
}

/// Slot `index` of a pair's regions.
fn patch(regions: &[Region], mut index: usize) -> ContactRecord {
    for (k, r) in regions.iter().enumerate() {
        let slots = 1 + r.points.len().div_ceil(4);
        if index >= slots {
            index -= slots;
            continue;
        }
        if index == 0 {
            let slot = RegionSlot {
                tag: wire::REGION_SLOT,
                region: k as u32,
                kind: r.kind as u8 + 1,
                extent: r.extent as u8 + 1,
                points: r.points.len() as u32,
                normal: r.normal.to_array(),
                faces_a: r.faces_a,
                faces_b: r.faces_b,
                separation: r.separation(),
                ..RegionSlot::default()
            };
            return slot.into();
        }
        let mut slot = PatchSlot { tag: wire::PATCH_SLOT, region: [k as u32, 0], ..PatchSlot::default() };
        for (i, p) in r.points.iter().skip(4 * (index - 1)).take(4).enumerate() {
            slot.count += 1;
            slot.points[i] = p.point.to_array();
            slot.separations[i] = p.separation as f32;
        }
        return slot.into();
    }
    ContactRecord::default()
}

/// The header of a reply: everything but the step number and the epoch.
pub fn reply(out: &StepOutcome, details: bool) -> StepReply {
    let status = if out.undecided {
        STEP_UNDECIDED
    } else if out.contact {
        STEP_CONTACT
    } else {
        STEP_CLEAR
    };
    let c = &out.counters;
    StepReply {
        status,
        index: step::NO_INDEX,
        records: out.pairs.len() as u32,
        slots: (slots_of(out, details) - out.pairs.len()) as u32,
        truncated: u32::from(out.truncated),
        effects: out.effect_counters.bits(),
        pairs: out.searched,
        safe_time: out.safe_time,
        counters: WorkCounters {
            box_tests: out.box_tests,
            primitives: c.primitives,
            after_stage1: c.after_stage1,
            node_pairs: c.node_pairs,
            candidates: c.candidates,
            cells: c.cells,
            clauses: c.clauses,
            newton: c.newton,
            closed_forms: c.closed_forms,
            may_have_passed: out.may_have_passed,
            instant_cells: c.instant_cells,
        },
        effect_counters: out.effect_counters,
        ..StepReply::default()
    }
}

fn record(p: &PairOutcome) -> ContactRecord {
    let o = &p.outcome;
    let mut r = ContactRecord { a: p.a, b: p.b, faces_a: [0; 3], ..ContactRecord::default() };
    r.status = match o.status() {
        Status::Contact => wire::CONTACT,
        Status::Clear => wire::CLEAR,
        Status::Overlap => wire::OVERLAP,
        Status::Undecided => wire::UNDECIDED,
    };
    r.flags |= if p.plan.sensor { wire::SENSOR } else { 0 };
    if p.plan.report >= Report::Time {
        r.valid |= wire::VALID_TIME;
        (r.time, r.time_lower) = (o.time(), o.time_lower());
        r.flags |= if o.not_continued() { wire::NOT_CONTINUED } else { 0 };
    }
    if p.plan.report >= Report::Time || p.plan.margin > 0.0 {
        r.flags |= if o.touching { wire::TOUCHING } else { 0 };
        r.flags |= if p.regions_complete { 0 } else { wire::REGIONS_INCOMPLETE };
    }
    r.flags |= if o.margin_time < 1.0 { wire::WITHIN_MARGIN } else { 0 };
    r.flags |= if p.coarser { wire::COARSER_RESOLUTION } else { 0 };
    // A clear pair that touches has the fields of its nearest region, where its rule asks for them.
    let is_reported = p.plan.report >= Report::Contact && (o.meets() || p.regions.1 > 0);
    if let Some(point) = o.point().filter(|_| is_reported) {
        r.valid |= wire::VALID_POINT | wire::VALID_NORMAL | wire::VALID_SEPARATION | wire::VALID_NORMAL_SPEED;
        r.valid |= wire::VALID_FACES;
        r.flags |= if point.averaged_normal { wire::AVERAGED_NORMAL } else { 0 };
        // Bodies that overlap meet in no one way.
        if o.status() != Status::Overlap {
            r.valid |= wire::VALID_KIND;
            (r.kind, r.extent) = (point.kind as u8 + 1, point.extent as u8 + 1);
        }
        r.point = point.point.to_array();
        r.normal = point.normal.to_array();
        r.separation = point.separation;
        r.normal_speed = point.normal_speed;
        (r.faces_a, r.faces_b) = (point.faces_a, point.faces_b);
    }
    r
}

/// The detail slot of a pair of the world's last step.
pub fn detail(world: &World, p: &PairOutcome) -> DetailSlot {
    let o = &p.outcome;
    // The point that is told: of an overlap the deepest one, where it was asked for.
    let of_contact = o.point().filter(|_| o.meets() && p.plan.report >= Report::Contact);
    let point = o.penetration().map(|deepest| deepest.point).or(of_contact.map(|point| point.point));
    let point_a = world.body(p.a).zip(point).map(|(body, point)| {
        let pose = body.motion_state.motion.at(o.time());
        pose.rotation.conjugate() * (point - pose.position)
    });
    DetailSlot {
        tag: wire::DETAIL_SLOT,
        time_upper: if p.plan.report >= Report::Time { o.time_upper() } else { 0.0 },
        resolution: o.resolution,
        point_a: point_a.map_or([0.0; 3], |x| x.to_array()),
        penetration: o.penetration().map_or(0.0, |p| p.depth),
        direction: o.penetration().map_or([0.0; 3], |p| p.direction.to_array()),
        cells: o.counters.cells,
        margin_time: if p.plan.margin > 0.0 { o.margin_time } else { 0.0 },
        ..DetailSlot::default()
    }
}
