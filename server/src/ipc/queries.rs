//! What a session is asked beside its steps: distances of objects, points, rays (docs/queries.md). The answers are the world's own,
//! in the protocol's types.

use crate::contact::probe::{self, Ray};
use crate::math::halt;
use crate::world::{BodyPoint, BodyRay, Refusal, Standing, World};
use contactd_proto::ErrorCode;
use contactd_proto::query::{
    ObjectDistance, ObjectRay, PointAnswer, Query, QueryAnswer, RayAnswer, RayHit, RayOutcome,
};
use glam::DVec3;

/// A question, with the objects as they stood when it was asked.
#[derive(Debug)]
pub struct Inquiry {
    standing: Standing<'static>,
    query: Query,
}

impl Inquiry {
    /// A question to a world; what it needs of it is copied.
    pub fn new(world: &World, query: Query) -> Self {
        let standing = match &query {
            Query::Distance { a, b, .. } => world.standing().kept(Some(&[*a, *b])),
            Query::Points { objects, .. } | Query::Rays { objects, .. } => world.standing().kept(objects.as_deref()),
        };
        Self { standing, query }
    }

    /// Works the answer out; may take seconds.
    ///
    /// # Errors
    /// What the world refuses; `Internal` where the engine fails.
    pub fn answer(&self) -> Result<QueryAnswer, Refusal> {
        let failed = || Refusal::new(ErrorCode::Internal, "the query failed");
        halt::catch(|| self.told()).unwrap_or_else(|_| Err(failed()))
    }

    fn told(&self) -> Result<QueryAnswer, Refusal> {
        match &self.query {
            Query::Distance { a, b, tolerance } => {
                let d = self.standing.distance(*a, *b, *tolerance)?;
                Ok(QueryAnswer::Distance(ObjectDistance {
                    lower: d.lower,
                    upper: d.upper,
                    points: [d.a.point.to_array(), d.b.point.to_array()],
                    is_settled: d.is_settled,
                    cells: d.cells,
                }))
            }
            Query::Points { points, options, objects } => {
                let points: Vec<DVec3> = points.iter().map(|x| DVec3::from_array(*x)).collect();
                let told = self.standing.points(&points, options, objects.as_deref())?;
                Ok(QueryAnswer::Points(told.iter().map(point).collect()))
            }
            Query::Rays { rays, options, objects } => {
                let rays: Vec<Ray> = rays.iter().map(ray).collect();
                let told = self.standing.rays(&rays, options, objects.as_deref())?;
                Ok(QueryAnswer::Rays(told.iter().map(ray_answer).collect()))
            }
        }
    }
}

fn ray(r: &ObjectRay) -> Ray {
    let (origin, direction) = (DVec3::from_array(r.origin), DVec3::from_array(r.direction));
    Ray { origin, direction, length: r.length }
}

fn point(told: &BodyPoint) -> PointAnswer {
    let probe::PointAnswer { side, lower, upper, nearest, faces, is_settled, cells } = told.answer;
    let (object, nearest) = (told.body, nearest.to_array());
    PointAnswer { object, side, lower, upper, nearest, faces, is_settled, cells }
}

fn ray_answer(told: &BodyRay) -> RayAnswer {
    let outcome = match told.answer.outcome {
        probe::RayOutcome::Hit(hit) => {
            let probe::RayHit { lower, t, upper, point, normal, face, primitive: _, faces, is_leaving } = hit;
            let (point, normal) = (point.to_array(), normal.to_array());
            RayOutcome::Hit(RayHit { lower, t, upper, point, normal, face, faces, is_leaving })
        }
        probe::RayOutcome::Miss { is_inside } => RayOutcome::Miss { is_inside },
        probe::RayOutcome::Undecided { until } => RayOutcome::Undecided { until },
    };
    RayAnswer { object: told.body, outcome, cells: told.answer.cells }
}
