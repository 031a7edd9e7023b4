//! An independent judge of one record: is the contact that it tells of there, and is it what it is called?
//!
//! Idea: the point is put into both models at the reported time, and f is evaluated there by code of its own, from the
//! tree (min and max over faces with their signs) and the formulas of the faces. Which faces are active is read off how f
//! grows from the point: its derivative along a direction d is the same min and max over the faces through the point,
//! each with its own derivative along d. A face is active if for some d the outcome changes with it. That is no matter of
//! multipliers and clauses, which the search goes by.
//!
//! What is demanded of a contact: the point lies on both surfaces, on every named face, and named faces are active
//! there; the normal lies in the cone of the active faces' gradients of a, and its opposite in that of b; kind is what
//! the active faces are (one tangent plane a face, two an edge, three or an apex a vertex); separation is 0; normal_speed
//! is how fast the bodies' matter closes in along the normal there; the times are in order. Of an overlap: the point is
//! deeper than 2 delta in both and proves the depth told.
//!
//! Where docs say less, less is demanded: the averaged normal of two vertices lies in the cone of both sides' gradients
//! together; a contact that is flagged as not continued, or that starts the step, has its point up to 2 delta deep, and its
//! normal is as near to the gradients as these are to those of points so far away; a
//! line or a patch of contact is told by any of its points, its border included, so that its kind may be smoother than
//! the point is.

use crate::engine::ReportedPoint as _;
use crate::reference::Moving;
use crate::reference::field::{Ball, Image, Ridge};
use contactd::contact::{ContactKind, Extent, Outcome, Status};
use contactd::solid::{Face, Sense, surface};
use contactd_proto::contact_record::NO_FACE;
use glam::{DMat3, DVec2, DVec3};
use side::{Side, Spot, rank};

mod side;

/// What a record says that is not so.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Lie {
    /// Times out of order or outside of the step, or not those of the status.
    Bracket,
    /// The point does not lie on both surfaces (contact) or not deep in both (overlap).
    Point,
    /// A named face does not pass through the point.
    FaceElsewhere,
    /// A named face passes through the point but f does not depend on it there, or none is named.
    FaceInactive,
    /// The normal is no unit vector, or lies outside of the cone of the active faces' gradients.
    Normal,
    /// The kind is not what the active faces are.
    Kind,
    /// A named face's primitive enters the solid with another sense than the model's table says.
    Sense,
    /// The separation is not what it is at the time told.
    Separation,
    /// The normal speed is not that of the bodies along the normal.
    NormalSpeed,
    /// Equals the upper end of its bracket though the surfaces met before, without the flag; or the flag stands without need.
    NotContinued,
}

/// Everything that is wrong with a record, with figures; empty if it is right. `o` must have been asked for everything.
pub fn lies(a: &Moving, b: &Moving, o: &Outcome) -> Vec<(Lie, String)> {
    let mut out = Vec::new();
    if !times_in_order(o) {
        out.push((Lie::Bracket, format!("{} {} {} {}", o.status().name(), o.time_lower(), o.time(), o.time_upper())));
        return out;
    }
    match o.status() {
        Status::Contact => contact(&[Side::new(a, o.time()), Side::new(b, o.time())], o, &mut out),
        Status::Overlap => overlap(&[Side::new(a, 0.0), Side::new(b, 0.0)], o, &mut out),
        Status::Clear | Status::Undecided => {}
    }
    out
}

/// `lies`, as a test that prints what is wrong: true if nothing is.
pub fn holds(name: &str, a: &Moving, b: &Moving, o: &Outcome) -> bool {
    let found = lies(a, b, o);
    for (lie, what) in &found {
        println!("{name}: {lie:?}: {what}");
    }
    found.is_empty()
}

fn times_in_order(o: &Outcome) -> bool {
    let (l, t, u) = (o.time_lower(), o.time(), o.time_upper());
    match o.status() {
        Status::Contact => 0.0 <= l && l <= t && t <= u && u <= 1.0,
        Status::Clear => l == 1.0 && t == 1.0 && u == 1.0,
        Status::Overlap => l == 0.0 && t == 0.0 && u == 0.0,
        Status::Undecided => (0.0..=1.0).contains(&l) && t == 1.0 && u == 1.0,
    }
}

/// A reported point as its two bodies see it, and the size of the numbers that go into that.
struct Seen {
    points: [DVec3; 2],
    extent: f64,
}

impl Seen {
    /// The point as it stands in the record.
    fn reported(sides: &[Side; 2], o: &Outcome) -> Self {
        let points = [sides[0].local(o.at().point), sides[1].local(o.at().point)];
        Self { points, extent: sides[0].extent + sides[1].extent }
    }

    /// The point without what a world coordinate far from the origin rounds away, whatever the bodies' sizes: both see
    /// it from a's position, and it is moved onto all faces that are named, the least way there is, if that is no more
    /// than rounding. `None` where it is more. Where the faces leave no point open, as at a vertex, it is the one that
    /// they have in common, and whatever else passes through it was to be named.
    fn on_named_faces(sides: &[Side; 2], o: &Outcome) -> Option<Self> {
        let [a, b] = sides.each_ref().map(|s| &s.moving.motion);
        let apart = (b.start.position - a.start.position) + (b.velocity - a.velocity) * sides[0].time;
        let start = (o.at().point - a.start.position) - a.velocity * sides[0].time;
        let far = 4.0 * f64::EPSILON * (a.start.position.length() + a.velocity.length() + o.at().point.length());
        let mut way = start;
        let seen = |way: DVec3| [sides[0].local_from(way), sides[1].local_from(way - apart)];
        for _ in 0..4 {
            let points = seen(way);
            // Least squares on the faces' values, hardly damped: (J^T J + mu) step = -J^T values.
            let (mut square, mut right) = (DMat3::from_diagonal(DVec3::splat(1e-12)), DVec3::ZERO);
            for (k, side) in sides.iter().enumerate() {
                let at = side.moving.motion.at(side.time).rotation * side.moving.place.rotation;
                let mut meets = |n: DVec3, value: f64| {
                    let n = at * n;
                    square += DMat3::from_cols(n * n.x, n * n.y, n * n.z);
                    right -= n * value;
                };
                let named = [o.at().faces_a, o.at().faces_b][k].into_iter().filter(|f| *f != NO_FACE);
                for i in named.filter_map(|f| side.ids.iter().position(|id| *id == f)) {
                    let (x, literal) = (points[k], &side.literals[i]);
                    match literal.face {
                        // The tip of a cone is a point.
                        Face::Cone(surface::Cone { apex, sin, .. }) if apex.distance(x) * sin <= far => {
                            DVec3::AXES.into_iter().for_each(|e| meets(e, e.dot(x - apex)));
                        }
                        _ => meets(literal.gradient(x), literal.value(x)),
                    }
                }
            }
            way += square.inverse() * right;
        }
        let extent = sides[0].own + sides[1].own + apart.length() + (b.velocity - a.velocity).length();
        (way.is_finite() && way.distance(start) <= far).then(|| Self { points: seen(way), extent })
    }
}

/// Distance of a unit vector from the cone that some vectors generate.
fn off_cone(n: DVec3, generators: &[DVec3]) -> f64 {
    let mut best = 1.0f64;
    for (i, g) in generators.iter().enumerate() {
        best = best.min(n.distance(*g * n.dot(*g).max(0.0) / g.length_squared()));
        for (j, h) in generators.iter().enumerate().skip(i + 1) {
            let up = g.cross(*h);
            let Some(up) = (up.length() > 1e-9).then(|| up.normalize()) else { continue };
            let flat = n - up * n.dot(up);
            // flat = s g + t h
            let (gg, gh, hh) = (g.length_squared(), g.dot(*h), h.length_squared());
            let det = gg * hh - gh * gh;
            let (s, t) = ((flat.dot(*g) * hh - flat.dot(*h) * gh) / det, (flat.dot(*h) * gg - flat.dot(*g) * gh) / det);
            if s >= 0.0 && t >= 0.0 {
                best = best.min(n.distance(flat));
            }
            for k in if generators.len() <= 40 { &generators[j + 1..] } else { &[] } {
                let volume = g.dot(h.cross(*k));
                if volume.abs() < 1e-12 {
                    continue;
                }
                let share = [n.dot(h.cross(*k)), g.dot(n.cross(*k)), g.dot(h.cross(n))].map(|v| v / volume);
                if share.iter().all(|v| *v >= -1e-12) {
                    return 0.0;
                }
            }
        }
    }
    best
}

/// How far a normal may be off its cone.
const NORMAL: f64 = 1e-6;

fn contact(sides: &[Side; 2], o: &Outcome, out: &mut Vec<(Lie, String)>) {
    let size = sides[0].radius.max(sides[1].radius);
    let rounding = 64.0 * f64::EPSILON * (sides[0].extent + sides[1].extent);
    let normals = [o.at().normal, -o.at().normal];
    if (o.at().normal.length() - 1.0).abs() > 1e-12 || !o.at().normal.is_finite() || !o.at().point.is_finite() {
        out.push((Lie::Normal, format!("point {}, normal {}", o.at().point, o.at().normal)));
        return;
    }
    let reported = Seen::reported(sides, o);
    let values: [f64; 2] = std::array::from_fn(|k| sides[k].value(reported.points[k]));
    // What starts in touch, or was not continued, is told where it is deep.
    let at_depth = o.not_continued() || o.time() == 0.0;
    let near = (1e-11 * size).max(rounding);
    // What was not continued is told how deep it is.
    let told = if o.not_continued() { -0.5 * o.at().separation } else { 0.0 };
    let off = if at_depth { near + told.max(2.001 * o.resolution) } else { near };
    if values.iter().any(|v| v.abs() > off) {
        out.push((Lie::Point, format!("f {:e} {:e} at {}, within {off:e}", values[0], values[1], o.at().point)));
    }
    let apart = values[0].max(values[1]);
    let exactly = if o.not_continued() { near } else { off };
    if !o.past && (o.at().separation - 2.0 * apart.min(0.0)).abs() > 2.0 * exactly {
        out.push((Lie::Separation, format!("{:e}, f {apart:e}", o.at().separation)));
    }
    let closing = (sides[0].velocity(o.at().point) - sides[1].velocity(o.at().point)).dot(o.at().normal);
    let fastest: f64 =
        sides.iter().map(|s| s.moving.motion.velocity.length() + s.moving.motion.spin.length() * (s.extent)).sum();
    // A ball's spin about its centre moves nothing of it: what the rounding of a normal makes of it is no speed.
    let carried = |s: &Side| {
        if s.is_ball_about_its_centre() { s.moving.motion.velocity } else { s.velocity(o.at().point) }
    };
    let without = (carried(&sides[0]) - carried(&sides[1])).dot(o.at().normal);
    if [closing, without].iter().all(|closing| {
        (closing - o.at().normal_speed).abs()
            > 1e-9 * fastest.min(1e3 * (closing.abs() + o.at().normal_speed.abs())) + 1e-13 * fastest
    }) && !o.at().averaged_normal
    {
        out.push((Lie::NormalSpeed, format!("{}, the bodies close in by {closing}", o.at().normal_speed)));
    }
    if o.time() == o.time_upper() && !o.not_continued() && o.time() > 0.0 {
        // Between touch and depth delta the step must pass, if a double can tell.
        let lag = o.resolution / closing.abs().max(f64::MIN_POSITIVE);
        if lag > 16.0 * f64::EPSILON && closing > 0.0 {
            out.push((Lie::NotContinued, format!("time {} is time_upper, delta takes {lag:e}", o.time())));
        }
    }
    // Which faces pass through the point is a matter of what counts as through: any sensible measure will do for all.
    let on_faces = if at_depth { None } else { Seen::on_named_faces(sides, o) };
    let Seen { points, extent } = on_faces.unwrap_or(reported);
    let least = 4.0 * f64::EPSILON * extent;
    let most = if at_depth { off } else { 1e-9 * size + rounding };
    let mut doubts: Option<Vec<(Lie, String)>> = None;
    let measures = [4, 0, 2, 6, 8, 10, 12, 14, 16, 18, 20].map(|k| least * f64::from(1 << k));
    let measures: Vec<f64> = measures.into_iter().filter(|t| *t < most).chain([most]).collect();
    // A point that is deep may lie deeper in the one than in the other: then each has a measure of its own.
    let same = measures.iter().map(|tau| [*tau; 2]);
    let each = measures.iter().flat_map(|a| measures.iter().map(|b| [*a, *b])).filter(|_| at_depth);
    for taus in same.chain(each) {
        let mut wrong = vec![];
        features(sides, &points, &normals, taus, o, &mut wrong);
        if wrong.is_empty() {
            return;
        }
        if doubts.as_ref().is_none_or(|d| wrong.len() < d.len()) {
            doubts = Some(wrong);
        }
    }
    out.extend(doubts.unwrap_or_default());
}

fn features(
    sides: &[Side; 2],
    points: &[DVec3; 2],
    normals: &[DVec3; 2],
    taus: [f64; 2],
    o: &Outcome,
    out: &mut Vec<(Lie, String)>,
) {
    let spots: [Spot; 2] =
        std::array::from_fn(|k| Spot::of(&sides[k], points[k], taus[k], sides[k].turned(normals[k])));
    let at_depth = o.not_continued() || o.time() == 0.0;
    // Of a round feature the gradient turns while a point moves: by its rounding, or, of one that is told where it is
    // deep, by how deep it is; then both sides' gradients are what the normal lies between.
    let turns: [f64; 2] = std::array::from_fn(|k| {
        let (side, point) = (&sides[k], points[k]);
        let moves = 64.0 * f64::EPSILON * side.extent + if at_depth { taus[k] } else { 0.0 };
        let each = spots[k].active.iter().map(|i| match side.literals[*i].face {
            Face::Plane(_) => 0.0,
            Face::Sphere(surface::Sphere { center, .. }) => moves / point.distance(center).max(f64::MIN_POSITIVE),
            Face::Cylinder(surface::Cylinder { origin: o, axis, .. })
            | Face::Cone(surface::Cone { apex: o, axis, .. }) => {
                moves / axis.cross(point - o).length().max(f64::MIN_POSITIVE)
            }
            Face::Torus(surface::Torus { origin, axis, major, .. }) => {
                let rho = axis.cross(point - origin).length();
                let tube = (rho - major).hypot(axis.dot(point - origin));
                moves / tube.min(rho).max(f64::MIN_POSITIVE)
            }
            Face::Capsule(surface::Capsule { origin, axis, half, .. }) => {
                let along = axis.dot(point - origin).clamp(-half, half);
                moves / point.distance(origin + axis * along).max(f64::MIN_POSITIVE)
            }
            // Of the gradient, over its length: twice as much of the normal.
            Face::Elliptic(e) => {
                let slope = side.literals[*i].gradient(point).length();
                2.0 * moves / (slope * Image::of(&e).across(point).length()).max(f64::MIN_POSITIVE)
            }
            Face::Bowl(b) => {
                let slope = side.literals[*i].gradient(point).length();
                2.0 * moves / (slope * Image::of_bowl(&b).across(point).length()).max(f64::MIN_POSITIVE)
            }
            Face::Superellipsoid(s) => {
                let slope = side.literals[*i].gradient(point).length();
                2.0 * moves * Ball::of(&s).turns(point) / slope
            }
            // Both of its halves turn.
            Face::Saddle(s) => {
                let slope = side.literals[*i].gradient(point).length();
                let per = |half: DVec2| 2.0 * moves / (slope * half.length()).max(f64::MIN_POSITIVE);
                Ridge::of(&s).halves(point).map(per).iter().sum()
            }
        });
        each.fold(0.0, f64::max)
    });
    let mut together = vec![];
    let mut ranks = [None; 2];
    for (k, (side, spot)) in sides.iter().zip(&spots).enumerate() {
        let (name, tau) = (["a", "b"][k], taus[k]);
        let named: Vec<u32> = [o.at().faces_a, o.at().faces_b][k].into_iter().filter(|f| *f != NO_FACE).collect();
        if named.is_empty() || spot.active.is_empty() {
            out.push((Lie::FaceInactive, format!("{name}: {named:?} named, {} active", spot.active.len())));
            continue;
        }
        for face in &named {
            let Some(i) = side.ids.iter().position(|id| id == face) else {
                out.push((Lie::FaceElsewhere, format!("{name}: there is no face {face}")));
                continue;
            };
            let off = side.literals[i].value(points[k]);
            if off.abs() > tau {
                out.push((Lie::FaceElsewhere, format!("{name}: face {face} is {off:e} away, {tau:e} allowed")));
            } else if !spot.active.contains(&i) {
                out.push((Lie::FaceInactive, format!("{name}: f does not depend on face {face}, tau {tau:e}")));
            }
            let owner = side.literals[i].owner as usize;
            let positive = side.literals[i].sign > 0.0;
            if (side.moving.solid.senses[owner] == Sense::Positive) != positive {
                out.push((Lie::Sense, format!("{name}: face {face} of primitive {owner}")));
            }
        }
        let n = side.turned(normals[k]);
        let allowed = NORMAL + turns[k].min(0.5) + if at_depth { turns[1 - k].min(0.5) } else { 0.0 };
        let off = off_cone(n, &spot.generators);
        let allowed = if spot.apex { allowed.max(2e-4) } else { allowed };
        if !o.at().averaged_normal && off > allowed {
            out.push((Lie::Normal, format!("{name}: {off:e} off the cone of faces {:?}", ids(side, spot))));
        }
        let at = side.moving.motion.at(side.time).rotation * side.moving.place.rotation;
        together.extend(spot.generators.iter().map(|g| if k == 0 { at * *g } else { -(at * *g) }));
        // Named faces that are all there are, are as many as the kind says.
        if spot.active.len() <= 3 && !spot.apex {
            let gradients: Vec<DVec3> = named
                .iter()
                .filter_map(|f| side.ids.iter().position(|id| id == f))
                .map(|i| side.literals[i].gradient(points[k]))
                .collect();
            ranks[k] = Some(rank(&gradients));
            if o.at().extent == Extent::Point && rank(&gradients) != spot.rank {
                out.push((Lie::FaceInactive, format!("{name}: of {:?} only {named:?} named", ids(side, spot))));
            }
        }
    }
    if let [Some(a), Some(b)] = ranks
        && ContactKind::of_active(a, b) != o.at().kind
    {
        out.push((Lie::FaceInactive, format!("{} by {a} and {b} named", o.at().kind.name())));
    }
    if o.at().averaged_normal && off_cone(o.at().normal, &together) > 2e-4 {
        out.push((Lie::Normal, format!("the averaged {} is not between the faces", o.at().normal)));
    }
    let kind = ContactKind::of_active(spots[0].rank, spots[1].rank);
    // A point that is deep beside an apex may be of the apex or of the face around it.
    let of = |spot: &Spot| if at_depth && spot.apex { [spot.rank, 1] } else { [spot.rank; 2] };
    let kinds = of(&spots[0]).map(|a| of(&spots[1]).map(|b| ContactKind::of_active(a, b)));
    let fits = match o.at().extent {
        Extent::Point => kinds.as_flattened().contains(&o.at().kind),
        // Any point of a line or a patch, its border included.
        Extent::Line => {
            let has_vertex =
                matches!(o.at().kind, ContactKind::VertexFace | ContactKind::VertexEdge | ContactKind::VertexVertex);
            (o.at().kind as usize) <= kind as usize && !has_vertex
        }
        Extent::Patch => o.at().kind == ContactKind::FaceFace,
    };
    if !fits {
        let at = [ids(&sides[0], &spots[0]), ids(&sides[1], &spots[1])];
        out.push((
            Lie::Kind,
            format!("{} {}, faces {at:?} make {}", o.at().kind.name(), o.at().extent.name(), kind.name()),
        ));
    }
    if o.at().averaged_normal != (o.at().kind == ContactKind::VertexVertex) {
        out.push((Lie::Kind, format!("{} and averaged {}", o.at().kind.name(), o.at().averaged_normal)));
    }
}

fn ids(side: &Side, spot: &Spot) -> Vec<u32> {
    spot.active.iter().map(|i| side.ids[*i]).collect()
}

fn overlap(sides: &[Side; 2], o: &Outcome, out: &mut Vec<(Lie, String)>) {
    let rounding = 64.0 * f64::EPSILON * (sides[0].extent + sides[1].extent);
    if (o.at().normal.length() - 1.0).abs() > 1e-12 || !o.at().normal.is_finite() || !o.at().point.is_finite() {
        out.push((Lie::Normal, format!("point {}, normal {}", o.at().point, o.at().normal)));
        return;
    }
    let depth = |p: DVec3| -sides[0].value(sides[0].local(p)).max(sides[1].value(sides[1].local(p)));
    let at = depth(o.at().point);
    if at < 2.0 * o.resolution - rounding {
        out.push((Lie::Point, format!("depth {at:e} at {}, 2 delta are {:e}", o.at().point, 2.0 * o.resolution)));
    }
    if -o.at().separation > 2.0 * at + rounding || o.at().separation > 0.0 {
        out.push((Lie::Separation, format!("{:e}, the point proves {:e}", o.at().separation, -2.0 * at)));
    }
    if o.penetration().map_or(0.0, |p| p.depth) > 0.0
        && o.penetration().map_or(0.0, |p| p.depth) > 2.0 * depth(o.penetration().unwrap().point) + rounding
    {
        out.push((
            Lie::Separation,
            format!(
                "penetration {:e}, deepest {:e}",
                o.penetration().map_or(0.0, |p| p.depth),
                2.0 * depth(o.penetration().unwrap().point)
            ),
        ));
    }
    // A spin about a body's own axis of revolution moves nothing of it, so it may be left out. Inside of the bodies that makes a
    // difference: the point is on neither surface.
    let turning = |s: &Side| s.velocity(o.at().point);
    let carried = |s: &Side| s.moving.motion.velocity;
    let speeds = [turning(&sides[0]), carried(&sides[0])]
        .map(|a| [turning(&sides[1]), carried(&sides[1])].map(|b| (a - b).dot(o.at().normal)));
    let closing = speeds[0][0];
    let fastest: f64 =
        sides.iter().map(|s| s.moving.motion.velocity.length() + s.moving.motion.spin.length() * (s.extent)).sum();
    let off = speeds.as_flattened().iter().map(|v| (v - o.at().normal_speed).abs()).fold(f64::INFINITY, f64::min);
    if off > 1e-9 * fastest && rank(&[o.at().normal]) == 1 {
        out.push((Lie::NormalSpeed, format!("{}, the bodies close in by {closing}", o.at().normal_speed)));
    }
}
