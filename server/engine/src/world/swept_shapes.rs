//! The swept shapes of the bodies in a step (`contact::SweptShape`), each taken when it is first looked at.
//!
//! What was looked at in one step mostly will be in the next one: such a body's swept shape is taken as soon as its track is known,
//! while both are at hand. Thousands of bodies later they would have to be fetched from far away again.

use super::body::Body;
use crate::contact::SweptShape;

/// Swept shapes by bodies' indices.
#[derive(Debug, Default)]
pub struct SweptShapes {
    swept_shapes: Vec<SweptShape>,
    uses: Vec<Use>,
    /// The last step in which any was looked at; and that it was the one before this.
    looked: u64,
    looked_before: bool,
    /// The step that they are of.
    serial: u64,
}

/// Steps, by their serials: that for which the swept shape was taken, and the last one in which it was looked at.
#[derive(Clone, Copy, Debug, Default)]
struct Use {
    taken: u64,
    looked: u64,
}

impl SweptShapes {
    /// A step of so many bodies begins; serials go up by one and begin with 1.
    pub fn begin(&mut self, serial: u64, bodies: usize) {
        (self.serial, self.looked_before) = (serial, self.looked + 1 == serial);
        self.swept_shapes.resize(bodies, SweptShape::default());
        self.uses.resize(bodies, Use::default());
    }

    /// A body has got its track for this step.
    #[inline]
    pub fn moved(&mut self, index: usize, body: &Body) {
        if self.looked_before && self.uses[index].looked + 1 == self.serial {
            self.take(index, body);
        }
    }

    /// A look at some bodies; `None` where one has no hull.
    #[inline]
    pub fn look<const N: usize>(&mut self, indices: [usize; N], bodies: &[Body]) -> Option<[&SweptShape; N]> {
        for i in indices {
            if self.uses[i].taken != self.serial {
                self.take(i, &bodies[i])?;
            }
            self.uses[i].looked = self.serial;
            self.looked = self.serial;
        }
        Some(indices.map(|i| &self.swept_shapes[i]))
    }

    #[inline]
    fn take(&mut self, index: usize, body: &Body) -> Option<()> {
        self.swept_shapes[index] = body.hull.as_ref()?.swept_shape(&body.motion_state);
        self.uses[index].taken = self.serial;
        Some(())
    }
}
