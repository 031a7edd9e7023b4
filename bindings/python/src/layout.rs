//! Layouts of the records, constants and words, told by the types themselves: Python's dtypes cannot drift from them.

use contactd_proto::contact_record as wire;
use contactd_proto::query::{NO_OBJECT, OUTCOME_NAMES, PointRecord, RayRecord, Side};
use contactd_proto::rule::Values;
use contactd_proto::{ClearanceSlot, ContactRecord, DetailSlot, Effects, PatchSlot, PoseRecord, RegionSlot};
use contactd_proto::{effects, pose_record, step};
use pyo3::prelude::*;
use std::mem::offset_of;

/// Names, formats (numpy's words), offsets, size.
type Layout = (Vec<&'static str>, Vec<&'static str>, Vec<usize>, usize);

macro_rules! layout {
    ($type:ty { $($field:ident: $format:literal),+ $(,)? }) => {
        (vec![$(stringify!($field)),+], vec![$($format),+], vec![$(offset_of!($type, $field)),+], size_of::<$type>())
    };
}

/// Each record's layout by its name.
#[pyfunction]
pub fn layouts() -> Vec<(&'static str, Layout)> {
    vec![
        (
            "POINT",
            layout!(PointRecord {
                object: "<u4",
                side: "u1",
                settled: "?",
                lower: "<f8",
                upper: "<f8",
                nearest: "(3,)<f8",
                faces: "(3,)<u4",
                cells: "<u8",
            }),
        ),
        (
            "RAY",
            layout!(RayRecord {
                object: "<u4",
                outcome: "u1",
                inside: "?",
                lower: "<f8",
                t: "<f8",
                upper: "<f8",
                point: "(3,)<f8",
                normal: "(3,)<f8",
                face: "<u4",
                faces: "(3,)<u4",
                cells: "<u8",
            }),
        ),
        ("POSE", layout!(PoseRecord { object: "<u4", flags: "<u4", position: "(3,)<f8", rotation: "(4,)<f8" })),
        (
            "CONTACT",
            layout!(ContactRecord {
                a: "<u4",
                b: "<u4",
                status: "u1",
                kind: "u1",
                extent: "u1",
                flags: "u1",
                valid: "<u4",
                time: "<f8",
                time_lower: "<f8",
                point: "(3,)<f8",
                normal: "(3,)<f8",
                separation: "<f8",
                normal_speed: "<f8",
                faces_a: "(3,)<u4",
                faces_b: "(3,)<u4",
                slot: "<u4",
                slots: "<u4",
            }),
        ),
        (
            "DETAIL",
            layout!(DetailSlot {
                tag: "<u4",
                reserved: "<u4",
                time_upper: "<f8",
                resolution: "<f8",
                point_a: "(3,)<f8",
                penetration: "<f8",
                direction: "(3,)<f8",
                cells: "<u8",
                margin_time: "<f8",
                spare: "(4,)<u8",
            }),
        ),
        (
            "REGION",
            layout!(RegionSlot {
                tag: "<u4",
                region: "<u4",
                kind: "u1",
                extent: "u1",
                reserved: "(2,)u1",
                points: "<u4",
                normal: "(3,)<f8",
                faces_a: "(3,)<u4",
                faces_b: "(3,)<u4",
                separation: "<f8",
                spare: "(7,)<u8",
            }),
        ),
        (
            "CLEARANCE",
            layout!(ClearanceSlot {
                tag: "<u4",
                flags: "<u4",
                lower: "<f8",
                upper: "<f8",
                time: "<f8",
                points: "(2,3)<f8",
                faces_a: "(3,)<u4",
                faces_b: "(3,)<u4",
                tolerance: "<f8",
                cells: "<u8",
                spare: "<u8",
            }),
        ),
        (
            "PATCH",
            layout!(PatchSlot {
                tag: "<u4",
                count: "<u4",
                points: "(4,3)<f8",
                separations: "(4,)<f4",
                region: "(2,)<u4"
            }),
        ),
    ]
}

/// Numbers that records hold: the enumeration that Python makes of them, the member, its number.
#[pyfunction]
pub fn constants() -> Vec<(&'static str, &'static str, u32)> {
    let mut all = vec![
        ("Order", "END", pose_record::END),
        ("Order", "TURN", pose_record::TURN),
        ("Order", "START", pose_record::START),
        ("Status", "CONTACT", wire::CONTACT.into()),
        ("Status", "CLEAR", wire::CLEAR.into()),
        ("Status", "OVERLAP", wire::OVERLAP.into()),
        ("Status", "UNDECIDED", wire::UNDECIDED.into()),
        ("Flag", "TOUCHING", wire::TOUCHING.into()),
        ("Flag", "NOT_CONTINUED", wire::NOT_CONTINUED.into()),
        ("Flag", "AVERAGED_NORMAL", wire::AVERAGED_NORMAL.into()),
        ("Flag", "SENSOR", wire::SENSOR.into()),
        ("Flag", "REGIONS_INCOMPLETE", wire::REGIONS_INCOMPLETE.into()),
        ("Flag", "WITHIN_MARGIN", wire::WITHIN_MARGIN.into()),
        ("Flag", "COARSER_RESOLUTION", wire::COARSER_RESOLUTION.into()),
        ("Valid", "TIME", wire::VALID_TIME),
        ("Valid", "POINT", wire::VALID_POINT),
        ("Valid", "NORMAL", wire::VALID_NORMAL),
        ("Valid", "SEPARATION", wire::VALID_SEPARATION),
        ("Valid", "NORMAL_SPEED", wire::VALID_NORMAL_SPEED),
        ("Valid", "KIND", wire::VALID_KIND),
        ("Valid", "FACES", wire::VALID_FACES),
        ("StepStatus", "CLEAR", step::STEP_CLEAR),
        ("StepStatus", "CONTACT", step::STEP_CONTACT),
        ("StepStatus", "UNDECIDED", step::STEP_UNDECIDED),
        ("Tag", "DETAIL", wire::DETAIL_SLOT),
        ("Tag", "PATCH", wire::PATCH_SLOT),
        ("Tag", "REGION", wire::REGION_SLOT),
        ("Tag", "CLEARANCE", wire::CLEARANCE_SLOT),
        ("ClearanceFlag", "SETTLED", wire::CLEARANCE_SETTLED),
        ("ClearanceFlag", "POINTS", wire::CLEARANCE_POINTS),
        ("", "NO_FACE", wire::NO_FACE),
        ("", "NO_OBJECT", NO_OBJECT),
    ];
    // `EFFECT_TIME` is `Effect.TIME`.
    all.extend(effects::ALL.iter().map(|e| ("Effect", e.bit.trim_start_matches("EFFECT_"), e.value)));
    all
}

/// Words of rules and records by their tables.
#[pyfunction]
pub fn words() -> Vec<(&'static str, Vec<&'static str>)> {
    let rules = Effects::FIELDS.iter().filter(|field| matches!(field.values, Values::Words(..)));
    let mut all: Vec<_> = rules.map(|field| (field.name, field.words().collect())).collect();
    all.extend([
        ("kind", wire::KIND_NAMES.to_vec()),
        ("extent", wire::EXTENT_NAMES.to_vec()),
        ("status", wire::STATUS_NAMES.to_vec()),
        ("side", Side::NAMES.to_vec()),
        ("outcome", OUTCOME_NAMES.to_vec()),
    ]);
    all
}
