//! The boxes that hold the bodies over a step, each taken when it is first looked at.

use super::roster::Roster;
use crate::math::Aabb;

/// Swept boxes by bodies' indices, each with the serial of the step for which it was taken.
#[derive(Debug, Default)]
pub struct SweptBoxes {
    boxes: Vec<(u64, Aabb)>,
    serial: u64,
}

impl SweptBoxes {
    /// A step of so many bodies begins; serials go up by one and begin with 1.
    pub fn begin(&mut self, serial: u64, bodies: usize) {
        self.serial = serial;
        self.boxes.resize(bodies, (0, Aabb::EMPTY));
    }

    /// A body's box, grown so that boxes of bodies within their touching distance meet.
    #[inline]
    pub fn of(&mut self, index: u32, roster: &Roster) -> Aabb {
        let (serial, place) = &mut self.boxes[index as usize];
        if *serial != self.serial {
            let body = &roster.bodies[index as usize];
            (*serial, *place) = (self.serial, body.swept().grown(roster.touch(body)));
        }
        *place
    }
}
