//! Outcomes as 128-byte slots: what the pair's plan asks for, everything else zero with its `valid` bit clear.

use super::World;
use super::step::{PairOutcome, StepOutcome};
use crate::contact::Status;
use contactd_proto::contact_record::{self as wire, ContactRecord, DetailSlot};
use contactd_proto::step::{STEP_CLEAR, STEP_CONTACT, STEP_UNDECIDED, StepReply, WorkCounters};
use contactd_proto::{Report, step};

/// Number of slots that the reply to a step needs.
pub fn slots_of(out: &StepOutcome, details: bool) -> usize {
    out.pairs.len() * if details { 2 } else { 1 }
}

/// Slot `index` of the reply: records first, then their detail slots, in the same order.
pub fn slot(world: &World, out: &StepOutcome, details: bool, index: usize) -> ContactRecord {
    let n = out.pairs.len();
    if index >= n {
        return detail(world, &out.pairs[index - n]).into();
    }
    let mut record = record(&out.pairs[index]);
    if details {
        record.slot = (n + index) as u32;
        record.slots = 1;
    }
    record
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
        effects: out.effects,
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
        },
        ..StepReply::default()
    }
}

fn record(p: &PairOutcome) -> ContactRecord {
    let o = &p.outcome;
    let mut r = ContactRecord { a: p.a, b: p.b, faces_a: [0; 3], ..ContactRecord::default() };
    r.status = match o.status {
        Status::Contact => wire::CONTACT,
        Status::Clear => wire::CLEAR,
        Status::Overlap => wire::OVERLAP,
        Status::Undecided => wire::UNDECIDED,
    };
    r.flags |= if p.plan.sensor { wire::SENSOR } else { 0 };
    if p.plan.report >= Report::Time {
        r.valid |= wire::VALID_TIME;
        (r.time, r.time_lower) = (o.time, o.time_lower);
        r.flags |= if o.touching { wire::TOUCHING } else { 0 };
        r.flags |= if o.not_continued { wire::NOT_CONTINUED } else { 0 };
    }
    let meets = matches!(o.status, Status::Contact | Status::Overlap);
    if p.plan.report >= Report::Contact && meets {
        r.valid |= wire::VALID_POINT | wire::VALID_NORMAL | wire::VALID_SEPARATION | wire::VALID_NORMAL_SPEED;
        r.valid |= wire::VALID_KIND | wire::VALID_FACES;
        r.flags |= if o.averaged_normal { wire::AVERAGED_NORMAL } else { 0 };
        r.kind = o.kind as u8 + 1;
        r.extent = o.extent as u8 + 1;
        r.point = o.point.to_array();
        r.normal = o.normal.to_array();
        r.separation = o.separation;
        r.normal_speed = o.normal_speed;
        (r.faces_a, r.faces_b) = (o.faces_a, o.faces_b);
    }
    r
}

fn detail(world: &World, p: &PairOutcome) -> DetailSlot {
    let o = &p.outcome;
    let meets = matches!(o.status, Status::Contact | Status::Overlap);
    let overlap = o.status == Status::Overlap && p.plan.penetration;
    let point_a = world.body(p.a).filter(|_| meets).map(|body| {
        let pose = body.track.motion.at(o.time);
        pose.rotation.conjugate() * (o.point - pose.position)
    });
    DetailSlot {
        tag: wire::DETAIL_SLOT,
        time_upper: o.time_upper,
        resolution: o.resolution,
        point_a: point_a.map_or([0.0; 3], |x| x.to_array()),
        penetration: if overlap { -o.separation } else { 0.0 },
        direction: if overlap { o.normal.to_array() } else { [0.0; 3] },
        cells: o.counters.cells,
        ..DetailSlot::default()
    }
}
