//! What a session is asked about its objects where its last step has left them.

use super::{Session, unexpected};
use crate::Error;
use crate::transport::Transport;
use contactd_proto::ErrorCode;
use contactd_proto::control::{Answer, Command};
use contactd_proto::query::{
    ObjectDistance, ObjectRay, PointAnswer, PointOptions, Query, QueryAnswer, RayAnswer, RayOptions,
};

/// Points or rays of one command: their answers stay far below what a command may carry (`DECODE_LIMIT`).
const IN_A_COMMAND: usize = 1 << 16;

/// The error of a later command: its index counts from the first question on.
fn behind(error: Error, before: usize) -> Error {
    match error {
        // An index of this refusal is one of the objects.
        Error::Refused { code: ErrorCode::UnknownObject, .. } => error,
        Error::Refused { code, index: Some(index), detail } => {
            Error::Refused { code, index: Some(index.saturating_add(before as u32)), detail }
        }
        other => other,
    }
}

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
        self.in_commands(points, |session, points| {
            let (points, options, objects) = (points.to_vec(), *options, objects.map(<[u32]>::to_vec));
            match session.command(Command::Ask(Query::Points { points, options, objects }))? {
                Answer::Told(QueryAnswer::Points(told)) => Ok(told),
                other => Err(unexpected(&other)),
            }
        })
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
        self.in_commands(rays, |session, rays| {
            let (rays, options, objects) = (rays.to_vec(), *options, objects.map(<[u32]>::to_vec));
            match session.command(Command::Ask(Query::Rays { rays, options, objects }))? {
                Answer::Told(QueryAnswer::Rays(told)) => Ok(told),
                other => Err(unexpected(&other)),
            }
        })
    }

    /// The answers to all of `asked`, which know nothing of each other, in commands that are no larger than a command may be.
    fn in_commands<Q, A>(
        &mut self,
        asked: &[Q],
        ask: impl Fn(&mut Self, &[Q]) -> Result<Vec<A>, Error>,
    ) -> Result<Vec<A>, Error> {
        // Nothing is asked as well: the objects named may be unknown.
        let mut told = ask(self, &asked[..asked.len().min(IN_A_COMMAND)])?;
        while told.len() < asked.len() {
            let rest = &asked[told.len()..];
            let more = ask(self, &rest[..rest.len().min(IN_A_COMMAND)]).map_err(|e| behind(e, told.len()))?;
            if more.is_empty() {
                return Err(Error::System("the server answered fewer questions than were asked".into()));
            }
            told.extend(more);
        }
        Ok(told)
    }
}
