//! The contact points of all pairs, as the engine tells them of one moment.
//!
//! Order: pairs by their bodies, points as the engine lists them. A body at rest keeps its list, so that a point finds its
//! force of the solve before in the same place of the same pair (warm start); where the number has changed, it begins at 0.

use super::body::{BodyKind, Entry, Twist};
use super::report::Frame;
use crate::Reply;
use contactd_proto::ContactRecord;
use contactd_proto::contact_record::{CLEAR, CONTACT, OVERLAP, SENSOR, UNDECIDED, VALID_NORMAL, VALID_POINT};
use glam::DVec3;

/// A point in which two bodies touch or nearly so.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Its bodies, by index in the world, the smaller first.
    pub bodies: [usize; 2],
    /// Where it is, world.
    pub position: DVec3,
    /// Unit normal from the first to the second body.
    pub normal: DVec3,
    /// Distance of the surfaces there; below 0 they overlap.
    pub gap: f64,
    /// Force on the second body in the last solve: along the normal and two tangents.
    pub force: DVec3,
    pub(super) row: super::row::Row,
}

/// An overlap that the engine reports where bodies stand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Its bodies, by index in the world.
    pub bodies: [usize; 2],
    /// A point deep inside both.
    pub position: DVec3,
    /// Unit normal from the first to the second body: the way out.
    pub normal: DVec3,
    /// A way that does not suffice to part them; 0 where the rule does not measure it.
    pub depth: f64,
}

/// What is known of the present moment.
#[derive(Debug, Default)]
pub struct Contacts {
    /// Points of pairs with an awake body.
    pub points: Vec<Point>,
    /// Overlapping pairs with an awake body.
    pub overlaps: Vec<Overlap>,
    /// Pairs of free bodies that touch, asleep or not: what groups are made of.
    pub links: Vec<[usize; 2]>,
    /// Free bodies that something driven touches and moves.
    pub stirred: Vec<usize>,
    before: Vec<Point>,
}

/// How a record's bodies are found, and when a point counts as closed.
#[derive(Clone, Copy, Debug)]
pub struct Reading<'a> {
    /// Index by object id; `usize::MAX`: not of this world.
    pub index: &'a [usize],
    /// The bodies.
    pub entries: &'a [Entry],
    /// Largest gap of a closed point.
    pub closed: f64,
}

impl Reading<'_> {
    /// The bodies of a record, if both belong to the world.
    pub fn bodies(&self, record: &ContactRecord) -> Option<[usize; 2]> {
        let of = |id: u32| self.index.get(id as usize).copied().filter(|i| *i != usize::MAX);
        Some([of(record.a)?, of(record.b)?])
    }
}

/// True for a record that physics acts on: not a sensor's, and with a point and a normal.
pub fn acts(record: &ContactRecord) -> bool {
    let needed = VALID_POINT | VALID_NORMAL;
    record.flags & SENSOR == 0 && record.valid & needed == needed
}

impl Contacts {
    /// Takes the answer to a step without motion.
    pub fn read(&mut self, reply: &Reply, reading: &Reading, frame: &mut Frame) {
        std::mem::swap(&mut self.points, &mut self.before);
        self.points.clear();
        self.overlaps.clear();
        self.links.clear();
        self.stirred.clear();
        for record in reply.records() {
            let Some(bodies) = reading.bodies(record) else { continue };
            if !acts(record) {
                frame.sensed += u64::from(record.flags & SENSOR != 0);
                frame.undecided += u64::from(record.status == UNDECIDED);
                continue;
            }
            let awake = bodies.iter().any(|i| reading.entries[*i].is_active());
            match record.status {
                OVERLAP if awake => {
                    frame.overlaps += 1;
                    // The deepest point, where the rule asks for it.
                    let detail = reply.detail(record).filter(|d| d.penetration > 0.0);
                    self.overlaps.push(Overlap {
                        bodies,
                        position: DVec3::from_array(record.point),
                        normal: DVec3::from_array(detail.map_or(record.normal, |d| d.direction)),
                        depth: detail.map_or(-record.separation, |d| d.penetration).max(0.0),
                    });
                }
                CLEAR | CONTACT => self.regions(reply, record, bodies, awake, reading),
                _ => {}
            }
        }
        self.warm();
    }

    fn regions(&mut self, reply: &Reply, record: &ContactRecord, bodies: [usize; 2], awake: bool, reading: &Reading) {
        let first = self.points.len();
        let mut closed = false;
        let mut put = |position: [f64; 3], normal: [f64; 3], gap: f64| {
            closed |= gap <= reading.closed;
            let (position, normal) = (DVec3::from_array(position), DVec3::from_array(normal));
            self.points.push(Point { bodies, position, normal, gap, ..Point::default() });
        };
        let mut any = false;
        for (region, slots) in reply.regions(record) {
            for slot in slots {
                for k in 0..slot.count as usize {
                    put(slot.points[k], region.normal, f64::from(slot.separations[k]));
                    any = true;
                }
            }
        }
        if !any {
            put(record.point, record.normal, record.separation);
        }
        let kinds = bodies.map(|i| reading.entries[i].kind);
        if closed && kinds == [BodyKind::Free, BodyKind::Free] {
            self.links.push(bodies);
        }
        let drives = |i: usize| kinds[i] == BodyKind::Driven && reading.entries[bodies[i]].now != Twist::default();
        for (driven, free) in [(0, 1), (1, 0)] {
            if closed && drives(driven) && kinds[free] == BodyKind::Free {
                self.stirred.push(bodies[free]);
            }
        }
        if !awake {
            self.points.truncate(first);
        }
    }

    /// Gives each point the force that it had.
    fn warm(&mut self) {
        let mut at = 0;
        let mut i = 0;
        while i < self.points.len() {
            let pair = self.points[i].bodies;
            let count = self.points[i..].iter().take_while(|p| p.bodies == pair).count();
            while at < self.before.len() && self.before[at].bodies < pair {
                at += 1;
            }
            let known = self.before[at..].iter().take_while(|p| p.bodies == pair).count();
            if known == count {
                for k in 0..count {
                    self.points[i + k].force = self.before[at + k].force;
                }
            }
            i += count;
        }
    }
}
