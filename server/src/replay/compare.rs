//! Two replies to one step, bit for bit: all that an answer says, and nothing of the work that it took.

use contactd_proto::StepReply;
use contactd_proto::contact_record::{
    CLEARANCE_SLOT, ClearanceSlot, ContactRecord, DETAIL_SLOT, DetailSlot, PATCH_SLOT, PatchSlot, REGION_SLOT,
    RegionSlot,
};
use std::mem::offset_of;

/// A field of a slot: name, offset, what it holds.
type Field = (&'static str, usize, Kind);

/// What a field holds, one or several in a row.
#[derive(Clone, Copy)]
enum Kind {
    Byte,
    Word,
    Single,
    Double,
}

use Kind::{Byte, Double, Single, Word};

const RECORD: &[Field] = &[
    ("a", offset_of!(ContactRecord, a), Word),
    ("b", offset_of!(ContactRecord, b), Word),
    ("status", offset_of!(ContactRecord, status), Byte),
    ("kind", offset_of!(ContactRecord, kind), Byte),
    ("extent", offset_of!(ContactRecord, extent), Byte),
    ("flags", offset_of!(ContactRecord, flags), Byte),
    ("valid", offset_of!(ContactRecord, valid), Word),
    ("time", offset_of!(ContactRecord, time), Double),
    ("time_lower", offset_of!(ContactRecord, time_lower), Double),
    ("point", offset_of!(ContactRecord, point), Double),
    ("normal", offset_of!(ContactRecord, normal), Double),
    ("separation", offset_of!(ContactRecord, separation), Double),
    ("normal_speed", offset_of!(ContactRecord, normal_speed), Double),
    ("faces_a", offset_of!(ContactRecord, faces_a), Word),
    ("faces_b", offset_of!(ContactRecord, faces_b), Word),
    ("slot", offset_of!(ContactRecord, slot), Word),
    ("slots", offset_of!(ContactRecord, slots), Word),
];

const DETAIL: &[Field] = &[
    ("tag", 0, Word),
    ("time_upper", offset_of!(DetailSlot, time_upper), Double),
    ("resolution", offset_of!(DetailSlot, resolution), Double),
    ("point_a", offset_of!(DetailSlot, point_a), Double),
    ("penetration", offset_of!(DetailSlot, penetration), Double),
    ("direction", offset_of!(DetailSlot, direction), Double),
    ("cells", offset_of!(DetailSlot, cells), Double),
    ("margin_time", offset_of!(DetailSlot, margin_time), Double),
    ("spare", offset_of!(DetailSlot, spare), Double),
];

const REGION: &[Field] = &[
    ("tag", 0, Word),
    ("region", offset_of!(RegionSlot, region), Word),
    ("kind", offset_of!(RegionSlot, kind), Byte),
    ("extent", offset_of!(RegionSlot, extent), Byte),
    ("reserved", offset_of!(RegionSlot, reserved), Byte),
    ("points", offset_of!(RegionSlot, points), Word),
    ("normal", offset_of!(RegionSlot, normal), Double),
    ("faces_a", offset_of!(RegionSlot, faces_a), Word),
    ("faces_b", offset_of!(RegionSlot, faces_b), Word),
    ("separation", offset_of!(RegionSlot, separation), Double),
    ("spare", offset_of!(RegionSlot, spare), Double),
];

const CLEARANCE: &[Field] = &[
    ("tag", 0, Word),
    ("flags", offset_of!(ClearanceSlot, flags), Word),
    ("lower", offset_of!(ClearanceSlot, lower), Double),
    ("upper", offset_of!(ClearanceSlot, upper), Double),
    ("time", offset_of!(ClearanceSlot, time), Double),
    ("points", offset_of!(ClearanceSlot, points), Double),
    ("faces_a", offset_of!(ClearanceSlot, faces_a), Word),
    ("faces_b", offset_of!(ClearanceSlot, faces_b), Word),
    ("tolerance", offset_of!(ClearanceSlot, tolerance), Double),
    ("cells", offset_of!(ClearanceSlot, cells), Double),
    ("spare", offset_of!(ClearanceSlot, spare), Double),
];

const PATCH: &[Field] = &[
    ("tag", 0, Word),
    ("count", offset_of!(PatchSlot, count), Word),
    ("points", offset_of!(PatchSlot, points), Double),
    ("separations", offset_of!(PatchSlot, separations), Single),
    ("region", offset_of!(PatchSlot, region), Word),
];

/// What differs first between a recorded reply (header and slots) and a repeated one; `None`: nothing that is part of the answer.
pub fn first_difference(
    recorded: (&StepReply, &[ContactRecord]),
    repeated: (&StepReply, &[ContactRecord]),
) -> Option<String> {
    header(recorded.0, repeated.0).or_else(|| {
        let records = recorded.0.records as usize;
        if recorded.1.len() != repeated.1.len() {
            return Some(format!("{} slots were recorded, {} are told", recorded.1.len(), repeated.1.len()));
        }
        let each = recorded.1.iter().zip(repeated.1).enumerate();
        each.into_iter().find_map(|(i, (x, y))| slot(i, i < records, x, y))
    })
}

fn header(x: &StepReply, y: &StepReply) -> Option<String> {
    let fields = [
        ("status", u64::from(x.status), u64::from(y.status)),
        ("error", u64::from(x.error), u64::from(y.error)),
        ("index", u64::from(x.index), u64::from(y.index)),
        ("records", u64::from(x.records), u64::from(y.records)),
        ("slots", u64::from(x.slots), u64::from(y.slots)),
        ("truncated", u64::from(x.truncated), u64::from(y.truncated)),
        ("step", x.step, y.step),
        ("epoch", x.epoch, y.epoch),
        ("may_have_passed", x.counters.may_have_passed, y.counters.may_have_passed),
    ];
    if let Some((name, x, y)) = fields.into_iter().find(|(_, x, y)| x != y) {
        return Some(format!("{name} of the reply was {x}, is {y}"));
    }
    let same = x.safe_time.to_bits() == y.safe_time.to_bits();
    (!same).then(|| format!("safe_time of the reply was {:?}, is {:?}", x.safe_time, y.safe_time))
}

/// What differs first in a slot.
fn slot(i: usize, is_record: bool, x: &ContactRecord, y: &ContactRecord) -> Option<String> {
    let (mut x_slot, mut y_slot) = (*x, *y);
    if !is_record {
        // Cells are work.
        for slot in [&mut x_slot, &mut y_slot] {
            if let Some(detail) = slot.as_detail().copied() {
                *slot = DetailSlot { cells: 0, ..detail }.into();
            }
            if let Some(clearance) = slot.as_clearance().copied() {
                *slot = ClearanceSlot { cells: 0, ..clearance }.into();
            }
        }
    }
    let bytes = [bytemuck::bytes_of(&x_slot), bytemuck::bytes_of(&y_slot)];
    let at = bytes[0].iter().zip(bytes[1]).position(|(x, y)| x != y)?;
    let (what, fields) = if is_record {
        (format!("record {i} (objects {} and {})", x.a, x.b), RECORD)
    } else {
        // Its first word says what it is.
        let fields = match x.a {
            DETAIL_SLOT => DETAIL,
            REGION_SLOT => REGION,
            PATCH_SLOT => PATCH,
            CLEARANCE_SLOT => CLEARANCE,
            _ => &[("tag", 0, Word)],
        };
        (format!("further slot {i}"), fields)
    };
    let field = fields.iter().rev().find(|(_, offset, _)| *offset <= at);
    let (name, offset, kind) = field.copied().unwrap_or(("its bytes", 0, Byte));
    let size = match kind {
        Byte => 1,
        Word | Single => 4,
        Double => 8,
    };
    let from = offset + (at - offset) / size * size;
    let [x, y] = bytes.map(|all| told(&all[from..from + size], kind));
    Some(format!("{name} of {what} was {x}, is {y}"))
}

fn told(bytes: &[u8], kind: Kind) -> String {
    match kind {
        Byte => bytes[0].to_string(),
        Word => bytemuck::pod_read_unaligned::<u32>(bytes).to_string(),
        Single => format!("{:?}", bytemuck::pod_read_unaligned::<f32>(bytes)),
        Double => format!("{:?}", bytemuck::pod_read_unaligned::<f64>(bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_an_answer_counts_and_none_of_its_work() {
        let header = StepReply { records: 1, slots: 1, safe_time: 0.5, ..StepReply::default() };
        let record = ContactRecord { a: 3, b: 4, time: 0.25, ..ContactRecord::default() };
        let detail = DetailSlot { tag: DETAIL_SLOT, resolution: 1e-9, cells: 7, ..DetailSlot::default() };
        let slots = [record, detail.into()];
        assert_eq!(first_difference((&header, &slots), (&header, &slots)), None);
        let cells = offset_of!(DetailSlot, cells);
        for i in 0..2 {
            for bit in 0..8 * 128 {
                let mut other = slots;
                bytemuck::bytes_of_mut(&mut other[i])[bit / 8] ^= 1 << (bit % 8);
                let is_work = i == 1 && (cells..cells + 8).contains(&(bit / 8));
                let told = first_difference((&header, &slots), (&header, &other));
                assert_eq!(told.is_none(), is_work, "slot {i}, bit {bit}: {told:?}");
            }
        }
        let mut other = slots;
        other[0].normal[1] = -0.0;
        let told = first_difference((&header, &slots), (&header, &other)).unwrap();
        assert_eq!(told, "normal of record 0 (objects 3 and 4) was 0.0, is -0.0");
        let later = StepReply { safe_time: 0.75, ..header };
        let told = first_difference((&header, &slots), (&later, &slots)).unwrap();
        assert_eq!(told, "safe_time of the reply was 0.5, is 0.75");
        let work = StepReply { pairs: 9, effects: 1, ..header };
        assert_eq!(first_difference((&header, &slots), (&work, &slots)), None);
        assert!(first_difference((&header, &slots), (&header, &slots[..1])).is_some());
    }
}
