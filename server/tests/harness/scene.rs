//! A small scene of drilled plates and pegs, and steps that are a function of their number.

use contactd_client::proto::motion::quat_of_rotation_vector;
use contactd_client::proto::{Pose, PoseRecord, Rule};
use contactd_client::{Object, Reply, Session, Transport};
use glam::DVec3;

pub const PLATE: &str = "difference() {
    cube(size = [40, 40, 4], center = true);
    multmatrix([[1, 0, 0, 8], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]) { cylinder($fn = 0, h = 9, r1 = 3, r2 = 3, center = true); }
}";
pub const PEG: &str =
    "union() { cylinder($fn = 0, h = 10, r1 = 2.5, r2 = 2.5, center = true); sphere($fn = 0, r = 2.6); }";

/// Bits that must agree: everything but the counters of work.
pub type Bits = (u32, u32, u64, Vec<u8>);

/// Loads the scene; returns the ids of its moving objects.
pub fn build<T: Transport>(session: &mut Session<T>, pegs: u32) -> Vec<u32> {
    let plate = session.load_model("plate.csg", PLATE).expect("a plate");
    let peg = session.load_model("peg.csg", PEG).expect("a peg");
    assert!(!plate.faces.is_empty() && plate.faces.iter().any(|f| f.subtracted));
    session.add_object(Object::new("plate", plate.id).group("cell").fixed()).expect("an object");
    let mut ids = Vec::new();
    for i in 0..pegs {
        let at = Pose::at(DVec3::new(8.0 - 12.0 * f64::from(i), 0.0, 15.0));
        ids.push(session.add_object(Object::new(&format!("peg {i}"), peg.id).group("pegs").at(at)).expect("an object"));
    }
    let rule = |a: &str, b: &str| Rule::new([a.into(), b.into()]);
    let deep = Rule { penetration: true, ..rule("cell", "pegs") };
    session.set_rules(&[deep, Rule { sensor: true, ..rule("pegs", "pegs") }]).expect("rules");
    ids
}

/// The poses of step `k`: pegs over hole and plate, some hitting, some not; half of the pegs turn as they go.
pub fn fill(records: &mut [PoseRecord], ids: &[u32], k: u64, seed: u64) {
    for (i, record) in records.iter_mut().enumerate() {
        let mut n = numbers(seed ^ (k << 8) ^ i as u64);
        let [x, y, z] = [n() * 2.0 - 1.0, n() * 2.0 - 1.0, n()];
        let home = DVec3::new(8.0 - 12.0 * i as f64, 0.0, 7.0 + 6.0 * z);
        let position = home + DVec3::new(3.0 * x, 3.0 * y, if k.is_multiple_of(3) { -6.0 } else { 0.0 });
        let tilt = DVec3::new(x, y, 0.0) * 0.4;
        *record = if (k + i as u64).is_multiple_of(2) {
            PoseRecord::end(ids[i], &Pose::new(position, quat_of_rotation_vector(tilt)))
        } else {
            PoseRecord::turn(ids[i], position, tilt)
        };
    }
}

/// The options of step `k`, which exercise what a header can say.
pub fn set_options<T: Transport>(session: &mut Session<T>, k: u64) {
    session.options.advance = if k % 5 == 4 { 0.25 } else { 1.0 };
    session.options.details = k.is_multiple_of(2);
    session.options.clear = k.is_multiple_of(7);
    session.options.first = k.is_multiple_of(11);
    session.options.polling = k.is_multiple_of(13);
    // Hard poses may end undecided: that is an answer too, and must agree like any other.
    session.options.cell_limit = 100_000;
}

/// A reply without its counters.
pub fn bits(reply: &Reply) -> Bits {
    let h = reply.header();
    let mut slots = Vec::new();
    for slot in reply.slots() {
        match slot.as_detail() {
            // Its count of cells is a counter too.
            Some(detail) if slot.a == 1 && slot.b == 0 => {
                let detail = contactd_client::proto::DetailSlot { cells: 0, ..*detail };
                slots.extend_from_slice(bytemuck::bytes_of(&detail));
            }
            _ => slots.extend_from_slice(bytemuck::bytes_of(slot)),
        }
    }
    (h.status, h.records, h.safe_time.to_bits(), slots)
}

pub fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut s = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    move || {
        s = s.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((s ^ (s >> 29)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A model of many spheres in a grid.
pub fn spheres(n: u32) -> String {
    let sphere = |i: u32| {
        format!(
            "multmatrix([[1,0,0,{}],[0,1,0,{}],[0,0,1,0],[0,0,0,1]]) {{ sphere($fn = 0, r = 0.7); }}\n",
            i % 150,
            i / 150
        )
    };
    format!("union() {{ {} }}", (0..n).map(sphere).collect::<String>())
}
