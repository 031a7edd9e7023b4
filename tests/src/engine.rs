//! The library's own answer to a scene, all stages on.

use crate::scenes::Scene;
use contactd::contact::{
    Contact, ContactPoint, Extent, Outcome, PairQuery, PlacedModel, QueryOptions, Scratch, Status, Strategies, Verdict,
    default_resolution, earliest_contact,
};
use contactd::motion::Placed;
use contactd::octree::Model;
use contactd::solid::Solid;
use contactd_proto::Pose;

/// Cells that a test may spend on a pair, far below the default: what needs more should be told so.
pub const CELL_LIMIT: u64 = 60_000;

/// What a record tells of its point, for comparisons of all of its fields.
pub trait ReportedPoint {
    /// The point, zeros where there is none.
    fn at(&self) -> ContactPoint;
}

/// The contact of an outcome, to be changed.
///
/// # Panics
/// When the outcome is no contact.
pub fn contact_mut(o: &mut Outcome) -> &mut Contact {
    match &mut o.verdict {
        Verdict::Contact(contact) => contact,
        other => panic!("no contact: {other:?}"),
    }
}

/// The point of a contact or an overlap, to be changed.
///
/// # Panics
/// When the outcome has none.
pub fn point_mut(o: &mut Outcome) -> &mut ContactPoint {
    let point = match &mut o.verdict {
        Verdict::Clear { rest, .. } => rest,
        Verdict::Contact(contact) => &mut contact.point,
        Verdict::Overlap(overlap) => &mut overlap.point,
        other => panic!("no point: {other:?}"),
    };
    point.as_mut().expect("a point that was asked for")
}

impl ReportedPoint for Outcome {
    fn at(&self) -> ContactPoint {
        self.point().copied().unwrap_or_default()
    }
}

/// Asks about two placed solids; `None` is the default resolution.
pub fn ask_solids(a: (Solid, Placed), b: (Solid, Placed), resolution: Option<f64>) -> Outcome {
    ask_models((&Model::new(a.0), a.1), (&Model::new(b.0), b.1), resolution)
}

/// Asks about two placed models.
pub fn ask_models(a: (&Model, Placed), b: (&Model, Placed), resolution: Option<f64>) -> Outcome {
    ask_with(a, b, resolution, Strategies::default())
}

/// Asks about two placed models with some ideas of the search switched off.
pub fn ask_with(a: (&Model, Placed), b: (&Model, Placed), resolution: Option<f64>, strategies: Strategies) -> Outcome {
    let query = PairQuery {
        resolution: resolution.unwrap_or_else(|| default_resolution(a.0, b.0)),
        strategies,
        ..question(a, b, QueryOptions::DEPTH)
    };
    earliest_contact(&query, &mut Scratch::default())
}

/// A question about two placed models, at the default resolution, all ideas on.
pub fn question<'a>(a: (&'a Model, Placed), b: (&'a Model, Placed), query_options: QueryOptions) -> PairQuery<'a> {
    PairQuery {
        a: PlacedModel { model: a.0, placed: a.1 },
        b: PlacedModel { model: b.0, placed: b.1 },
        resolution: default_resolution(a.0, b.0),
        cell_limit: CELL_LIMIT,
        strategies: Strategies::default(),
        query_options,
    }
}

/// A scene's question about its models, as `question`; its own resolution is not looked at.
pub fn question_of<'a>(scene: &Scene, models: [&'a Model; 2], query_options: QueryOptions) -> PairQuery<'a> {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    question((models[0], placed(scene.motion_a)), (models[1], placed(scene.motion_b)), query_options)
}

/// Asks about a scene.
pub fn ask(scene: &Scene) -> Outcome {
    ask_scene_with(scene, Strategies::default())
}

/// Asks about a scene with some ideas of the search switched off.
pub fn ask_scene_with(scene: &Scene, strategies: Strategies) -> Outcome {
    let placed = |motion| Placed { place: Pose::IDENTITY, motion };
    let (a, b) = (Model::new(scene.a.build()), Model::new(scene.b.build()));
    ask_with((&a, placed(scene.motion_a)), (&b, placed(scene.motion_b)), scene.resolution, strategies)
}

/// The search alone, without whole-primitive answers in front of it.
pub const SEARCH_ALONE: Strategies = Strategies {
    region: true,
    walk: true,
    multipliers: true,
    fits: true,
    hints: true,
    tighten: true,
    convex: false,
    cavities: false,
    facets: false,
    balls: false,
    coarser: true,
};

/// Of two contacts that come at one time, as mirror images do, either may be told.
pub fn are_tied(x: &Outcome, y: &Outcome, size: f64) -> bool {
    let speed = x.at().normal_speed.abs().max(y.at().normal_speed.abs()) / size;
    x.status() == Status::Contact && y.status() == Status::Contact && (x.time() - y.time()).abs() * speed <= 1e-12
}

/// In which fields two answers to one question differ, counters apart; times and places by more than rounding: times
/// weigh with the closing speed, in units of the pair's size. Where a contact is a line or a patch any of its points will do.
pub fn differences(x: &Outcome, y: &Outcome, size: f64) -> Vec<String> {
    let mut out = Vec::new();
    let mut demand = |same: bool, what: String| {
        if !same {
            out.push(what);
        }
    };
    demand(x.status() == y.status(), format!("status {:?} {:?}", x.status(), y.status()));
    let speed = x.at().normal_speed.abs().max(y.at().normal_speed.abs()) / size;
    for (name, s, t) in [
        ("time_lower", x.time_lower(), y.time_lower()),
        ("time", x.time(), y.time()),
        ("time_upper", x.time_upper(), y.time_upper()),
    ] {
        demand((s - t).abs() * speed <= 1e-12, format!("{name} {s} {t} at speed {speed}"));
    }
    if x.status() == Status::Contact && y.status() == Status::Contact {
        let off = (x.at().point - y.at().point).length() / size;
        demand(x.at().extent != Extent::Point || off <= 1e-6, format!("points {off:e} apart"));
        let turned = (x.at().normal - y.at().normal).length();
        demand(turned <= 1e-6, format!("normals {turned:e} apart"));
        demand(
            (x.at().kind, x.at().extent) == (y.at().kind, y.at().extent),
            format!("{:?} {:?}", (x.at().kind, x.at().extent), (y.at().kind, y.at().extent)),
        );
        let sorted = |mut f: [u32; 3]| {
            f.sort_unstable();
            f
        };
        let faces = |o: &Outcome| (sorted(o.at().faces_a), sorted(o.at().faces_b));
        demand(faces(x) == faces(y), format!("faces {:?} {:?}", faces(x), faces(y)));
        demand((x.at().normal_speed - y.at().normal_speed).abs() <= 1e-6 * size, "normal speed".into());
    }
    let flags = |o: &Outcome| (o.touching, o.not_continued(), o.at().averaged_normal, o.resolution);
    demand(flags(x) == flags(y), format!("flags {:?} {:?}", flags(x), flags(y)));
    out
}

/// The most cells a named scene may cost: its line in `cell_ceilings.toml`, twice what it cost when that was recorded.
pub fn cell_ceiling(name: &str) -> u64 {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../cell_ceilings.toml");
    let table: toml::Table = std::fs::read_to_string(path).expect("cell_ceilings.toml").parse().expect("valid TOML");
    table.get(name).and_then(toml::Value::as_integer).unwrap_or_else(|| panic!("no ceiling for {name}")) as u64
}
