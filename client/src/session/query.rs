//! What a session is asked about its objects where its last step has left them.

use super::{Session, unexpected};
use crate::Error;
use crate::transport::Transport;
use contactd_proto::control::{Answer, Command};
use contactd_proto::query::{
    ObjectDistance, ObjectRay, PointAnswer, PointOptions, Query, QueryAnswer, RayAnswer, RayOptions,
};

impl<T: Transport> Session<T> {
    /// How far two objects are apart: certified bounds to a tolerance (a length), and a point of each (docs/queries.md).
    ///
    /// Queries change nothing, and no step's answer. They may take long where much is asked; other sessions go on meanwhile.
    ///
    /// # Errors
    /// `Refused`: an object is unknown (`UnknownObject`), the tolerance is no length (`BadNumber`); `ServerLost`, `ReplyLost`, `Timeout`,
    /// `System`.
    pub fn distance(&mut self, a: u32, b: u32, tolerance: f64) -> Result<ObjectDistance, Error> {
        match self.command(Command::Ask(Query::Distance { a, b, tolerance }))? {
            Answer::Told(QueryAnswer::Distance(told)) => Ok(told),
            other => Err(unexpected(&other)),
        }
    }

    /// The least signed distance of points from all objects, or from those named, in the order of the points.
    ///
    /// # Errors
    /// `Refused`: an object is unknown (`UnknownObject`), a point is not finite (`NotFinite`, with its index), a length is none
    /// (`BadNumber`); `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn points(
        &mut self,
        points: &[[f64; 3]],
        options: &PointOptions,
        objects: Option<&[u32]>,
    ) -> Result<Vec<PointAnswer>, Error> {
        let (points, options, objects) = (points.to_vec(), *options, objects.map(<[u32]>::to_vec));
        match self.command(Command::Ask(Query::Points { points, options, objects }))? {
            Answer::Told(QueryAnswer::Points(told)) => Ok(told),
            other => Err(unexpected(&other)),
        }
    }

    /// What rays meet first of all objects, or of those named, in the order of the rays.
    ///
    /// # Errors
    /// `Refused`: an object is unknown (`UnknownObject`), a ray is not finite (`NotFinite`) or goes nowhere (`BadNumber`), each with
    /// its index, a depth is none (`BadNumber`); `ServerLost`, `ReplyLost`, `Timeout`, `System`.
    pub fn rays(
        &mut self,
        rays: &[ObjectRay],
        options: &RayOptions,
        objects: Option<&[u32]>,
    ) -> Result<Vec<RayAnswer>, Error> {
        let (rays, options, objects) = (rays.to_vec(), *options, objects.map(<[u32]>::to_vec));
        match self.command(Command::Ask(Query::Rays { rays, options, objects }))? {
            Answer::Told(QueryAnswer::Rays(told)) => Ok(told),
            other => Err(unexpected(&other)),
        }
    }
}
