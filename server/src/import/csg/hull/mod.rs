//! Convex hulls: of discs in a plane (`plane`), of points (`points`) and of balls (`balls`) in space. What they tell are corners,
//! tangent points and who is on the hull; the faces are made of these by others.

mod balls;
mod plane;
mod points;

pub use balls::ball_hull;
pub use plane::{Disc, DiscHull, disc_hull};
pub use points::{corners_of, point_hull};
