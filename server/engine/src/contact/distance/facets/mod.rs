//! A mesh against another one or a convex primitive: how far apart they are, by boxes over facets.
//!
//! Branch and bound over pairs of places, of boxes and then of facets, and over spans of time, the lowest bound first. The surface of a
//! mesh is its facets; so bodies whose surfaces do not meet are as far apart as these, unless one is within the other: a corner of each
//! connected part of a surface tells that, at any time of those at which surfaces do not meet.
//!
//! * At an instant two covers are apart by what lies between their supports along a direction, whatever the direction; along that of
//!   the nearest points it is their distance.
//! * Over a span the direction stands in A's frame or in B's, or turns in it from that of the nearest points at its begin to that at its
//!   end. With n(s) linear between unit vectors that are ν apart, s the part of the span of length h that has passed, the way along n
//!   between any two points has a second derivative of at most 2 ν V h + Acc h². So what lies between the covers along n is above the
//!   chord between its values at the ends less half of that times s(1 − s), and |n| <= 1.
//!
//! Source: distances by bounding volume hierarchies (E. Larsen, S. Gottschalk, M. Lin, D. Manocha, ICRA 2000); docs/algorithm/clearance.md.

mod body;
mod curved;
mod inside;
mod near;
mod search;
mod triangles;

pub(super) use search::Search;
