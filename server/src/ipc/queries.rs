//! What an embedded session can be asked beside its steps: distances of bodies, points, rays (docs/queries.md).

use super::embedded::Embedded;
use crate::contact::distance::Distance;
use crate::contact::probe::{PointOptions, Ray, RayOptions};
use crate::world::{BodyPoint, BodyRay, Refusal};
use contactd_client::{Error, Session};
use glam::DVec3;

/// Queries of a session's bodies where its last step has left them. They change nothing, and no step's answer.
pub trait Queries {
    /// How far two objects are apart: certified bounds to a tolerance (a length), and a point of each.
    ///
    /// # Errors
    /// `Refused`: an object is unknown (`UnknownObject`), or the tolerance is no length (`BadNumber`).
    fn distance(&mut self, a: u32, b: u32, tolerance: f64) -> Result<Distance, Error>;

    /// The least signed distance of points from all objects, or from those named, in the order of the points.
    ///
    /// # Errors
    /// `Refused`: an object is unknown (`UnknownObject`), a point is not finite (`NotFinite`, with its index), a length is none
    /// (`BadNumber`).
    fn points(
        &mut self,
        points: &[DVec3],
        options: &PointOptions,
        objects: Option<&[u32]>,
    ) -> Result<Vec<BodyPoint>, Error>;

    /// What rays meet first of all objects, or of those named, in the order of the rays. A direction may have any length but 0.
    ///
    /// # Errors
    /// `Refused`: an object is unknown (`UnknownObject`), a ray is not finite (`NotFinite`) or goes nowhere (`BadNumber`), each with
    /// its index; a depth is none (`BadNumber`).
    fn rays(&mut self, rays: &[Ray], options: &RayOptions, objects: Option<&[u32]>) -> Result<Vec<BodyRay>, Error>;
}

impl Queries for Session<Embedded> {
    fn distance(&mut self, a: u32, b: u32, tolerance: f64) -> Result<Distance, Error> {
        self.transport_mut().world().and_then(|world| world.distance(a, b, tolerance)).map_err(refused)
    }

    fn points(
        &mut self,
        points: &[DVec3],
        options: &PointOptions,
        objects: Option<&[u32]>,
    ) -> Result<Vec<BodyPoint>, Error> {
        self.transport_mut().world().and_then(|world| world.points(points, options, objects)).map_err(refused)
    }

    fn rays(&mut self, rays: &[Ray], options: &RayOptions, objects: Option<&[u32]>) -> Result<Vec<BodyRay>, Error> {
        self.transport_mut().world().and_then(|world| world.rays(rays, options, objects)).map_err(refused)
    }
}

fn refused(refusal: Refusal) -> Error {
    let Refusal { code, index, detail } = refusal;
    Error::Refused { code, index, detail }
}
