//! The scenes: metres, seconds, kilograms, z upwards.

use contactd_client::dynamics::{Damping, Effects, Inertia, Penalty, Restitution, Settings};
use contactd_client::proto::motion::quat_of_rotation_vector;
use contactd_client::proto::{Detect, Pose, Report, Rule};
use glam::{DVec3, dvec3};

/// A body of a scene.
pub struct Actor {
    pub name: String,
    /// Index of its model's text.
    pub text: usize,
    pub group: &'static str,
    /// The model in the body's frame, whose origin is the centre of mass.
    pub place: Pose,
    pub pose: Pose,
    /// None: it never moves.
    pub inertia: Option<Inertia>,
    pub velocity: DVec3,
    pub omega: DVec3,
    pub friction: f64,
    pub restitution: f64,
    /// It is in the picture.
    pub drawn: bool,
    /// In the picture, what lies at smaller y is cut away.
    pub cut: Option<f64>,
}

/// A scene: what is in it, how it is computed, how it is drawn.
pub struct Scene {
    pub name: &'static str,
    pub about: &'static str,
    pub settings: Settings,
    pub texts: Vec<String>,
    pub actors: Vec<Actor>,
    /// None: one rule for all pairs.
    pub rules: Vec<Rule>,
    pub seconds: f64,
    /// Times of the pictures.
    pub moments: Vec<f64>,
    /// Pixels of one picture.
    pub panel: (usize, usize),
    /// What the camera sees, and from which direction.
    pub window: [DVec3; 2],
    pub from: DVec3,
}

const DOWN: DVec3 = DVec3::new(0.0, 0.0, -9.81);

/// All scenes.
pub fn all() -> Vec<Scene> {
    vec![bounce(), slope(), stack(), hole(), peg(), cell(false)]
}

fn actor(name: &str, text: usize, pose: Pose, inertia: Option<Inertia>) -> Actor {
    Actor {
        name: name.into(),
        text,
        group: "default",
        place: Pose::IDENTITY,
        pose,
        inertia,
        velocity: DVec3::ZERO,
        omega: DVec3::ZERO,
        friction: 0.5,
        restitution: 0.0,
        drawn: true,
        cut: None,
    }
}

fn cuboid(size: DVec3) -> String {
    format!("cube(size = [{}, {}, {}], center = true);", size.x, size.y, size.z)
}

fn cylinder(height: f64, radius: f64) -> String {
    format!("cylinder(h = {height}, r1 = {radius}, r2 = {radius}, center = true);")
}

fn moved(by: DVec3, text: &str) -> String {
    format!("multmatrix([[1, 0, 0, {}], [0, 1, 0, {}], [0, 0, 1, {}], [0, 0, 0, 1]]) {{ {text} }}", by.x, by.y, by.z)
}

/// What lies and slides on the ground calls for.
fn ordinary(dt: f64) -> Settings {
    Settings { effects: Effects::on_the_ground(DOWN), ..Settings::new(dt, 1.0) }
}

fn bounce() -> Scene {
    let mut settings = Settings::new(1.0 / 240.0, 1.0);
    settings.effects.gravity = Some(DOWN);
    settings.effects.restitution = Some(Restitution { threshold: 0.05 });
    let size = dvec3(4.0, 2.0, 0.2);
    let ball = |name: &str, x: f64, e: f64| {
        let body = actor(name, 1, Pose::at(dvec3(x, 0.0, 1.5)), Some(Inertia::sphere(1.0, 0.3)));
        Actor { restitution: e, ..body }
    };
    Scene {
        name: "bounce",
        about: "Three balls with restitution 1, 0.8 and 0.5",
        settings,
        texts: vec![cuboid(size), "sphere(r = 0.3);".into()],
        actors: vec![
            actor("floor", 0, Pose::at(dvec3(0.0, 0.0, -0.1)), None),
            ball("elastic", -1.2, 1.0),
            ball("good", 0.0, 0.8),
            ball("dull", 1.2, 0.5),
        ],
        rules: vec![],
        seconds: 4.0,
        moments: vec![0.0, 0.5, 0.75, 1.0, 1.5, 3.0],
        panel: (300, 220),
        window: [dvec3(-2.0, -1.0, -0.2), dvec3(2.0, 1.0, 1.8)],
        from: dvec3(0.35, -1.0, 0.45),
    }
}

fn slope() -> Scene {
    let lean = quat_of_rotation_vector(DVec3::Y * 0.35);
    let at = |x: f64, y: f64, h: f64| Pose::new(lean * dvec3(x, y, h), lean);
    let size = dvec3(0.6, 0.6, 0.4);
    let block = |name: &str, text: usize, y: f64, mu: f64| {
        let body = actor(name, text, at(-2.2, y, 0.2), Some(Inertia::cuboid(1.0, size)));
        Actor { friction: mu, ..body }
    };
    Scene {
        name: "slope",
        about: "A plane of 20 degrees, tan = 0.365: blocks with friction 0.37, 0.3 and 0.1",
        settings: ordinary(1.0 / 120.0),
        texts: vec![cuboid(dvec3(6.0, 3.0, 0.2)), cuboid(size), cuboid(size), cuboid(size)],
        actors: vec![
            Actor { friction: 1.0, ..actor("plane", 0, at(0.0, 0.0, -0.1), None) },
            // A pair has the geometric mean of its coefficients: that of the plane is 1.
            block("sticks", 1, 0.9, 0.37 * 0.37),
            block("slides", 2, 0.0, 0.3 * 0.3),
            block("slips", 3, -0.9, 0.1 * 0.1),
        ],
        rules: vec![],
        seconds: 1.75,
        moments: vec![0.0, 0.6, 1.0, 1.4, 1.7],
        panel: (330, 230),
        window: [dvec3(-3.0, -1.5, -1.1), dvec3(3.0, 1.5, 1.5)],
        from: dvec3(0.3, -1.0, 0.5),
    }
}

fn stack() -> Scene {
    let at = |i: usize| dvec3(0.03 * (i % 3) as f64, -0.02 * (i % 2) as f64, 0.5 + i as f64);
    let body = |i: usize| {
        let text = 1 + i % 2;
        actor(&format!("box {i}"), text, Pose::at(at(i)), Some(Inertia::cuboid(1.0, DVec3::ONE)))
    };
    let mut actors = vec![actor("floor", 0, Pose::at(dvec3(0.0, 0.0, -0.25)), None)];
    actors.extend((0..10).map(body));
    let hit = actor("ball", 3, Pose::at(dvec3(-4.0, 0.0, 8.6)), Some(Inertia::sphere(0.6, 0.4)));
    actors.push(Actor { velocity: dvec3(0.0, 0.0, 12.0), ..hit });
    Scene {
        name: "stack",
        about: "Ten boxes asleep; a ball falls beside them and wakes none",
        settings: ordinary(1.0 / 120.0),
        texts: vec![cuboid(dvec3(12.0, 6.0, 0.5)), cuboid(DVec3::ONE), cuboid(DVec3::ONE), "sphere(r = 0.4);".into()],
        actors,
        rules: vec![],
        seconds: 10.0,
        moments: vec![0.0, 1.0, 2.5, 3.0, 10.0],
        panel: (260, 400),
        window: [dvec3(-5.0, -1.5, -0.5), dvec3(3.0, 1.5, 16.5)],
        from: dvec3(0.35, -1.0, 0.35),
    }
}

fn hole() -> Scene {
    let drilled = format!(
        "difference() {{ {} {} }}",
        cuboid(dvec3(6.0, 3.0, 0.5)),
        moved(dvec3(1.2, 0.0, 0.0), &cylinder(2.0, 0.65))
    );
    let ball = actor("ball", 1, Pose::at(dvec3(-2.2, 0.05, 0.5)), Some(Inertia::sphere(1.0, 0.5)));
    Scene {
        name: "hole",
        about: "A ball rolls to a real hole (plate minus cylinder), falls through and lies below",
        settings: ordinary(1.0 / 120.0),
        texts: vec![drilled, "sphere(r = 0.5);".into(), cuboid(dvec3(7.0, 3.0, 0.2))],
        actors: vec![
            Actor { cut: Some(0.0), ..actor("plate", 0, Pose::at(dvec3(0.0, 0.0, -0.25)), None) },
            Actor { velocity: DVec3::X, omega: DVec3::Y * 2.0, ..ball },
            actor("floor", 2, Pose::at(dvec3(0.5, 0.0, -2.1)), None),
        ],
        rules: vec![],
        seconds: 4.0,
        moments: vec![0.0, 2.0, 3.0, 3.2, 3.4, 4.0],
        panel: (330, 210),
        window: [dvec3(-3.0, -1.5, -2.2), dvec3(4.0, 1.5, 1.0)],
        from: dvec3(0.15, -1.0, 0.4),
    }
}

/// A shaft of radius 0.5 with a shoulder, its centre of mass at the origin.
fn shouldered() -> (String, Inertia, DVec3) {
    let (shaft, head) = (Inertia::cylinder(4.0, 0.5, 1.5), Inertia::cylinder(3.0, 0.8, 0.4));
    let up = DVec3::Z * 0.95;
    let (whole, centre) = shaft.and(DVec3::ZERO, &head, up);
    (format!("union() {{ {} {} }}", cylinder(1.5, 0.5), moved(up, &cylinder(0.4, 0.8))), whole, centre)
}

fn peg() -> Scene {
    let mut settings = ordinary(1.0 / 240.0);
    settings.effects.damping = Some(Damping { linear: 0.5, angular: 8.0 });
    let (text, inertia, centre) = shouldered();
    let plate = format!("difference() {{ {} {} }}", cuboid(dvec3(4.0, 4.0, 1.0)), cylinder(4.0, 0.52));
    let lean = quat_of_rotation_vector(dvec3(0.004, 0.002, 0.0));
    let start = Pose::new(dvec3(0.003, -0.002, 0.9 + centre.z), lean);
    let body = Actor { place: Pose::at(-centre), friction: 0.3, ..actor("peg", 1, start, Some(inertia)) };
    Scene {
        name: "peg",
        about: "A peg drops into its hole (clearance 0.02 of 1) and comes to rest on its shoulder",
        settings,
        texts: vec![plate, text],
        actors: vec![Actor { cut: Some(0.0), ..actor("plate", 0, Pose::at(dvec3(0.0, 0.0, -0.5)), None) }, body],
        rules: vec![],
        seconds: 2.0,
        moments: vec![0.0, 0.3, 0.45, 0.6, 2.0],
        panel: (290, 290),
        window: [dvec3(-2.0, -1.4, -1.0), dvec3(2.0, 1.6, 2.2)],
        from: dvec3(0.3, -1.0, 0.45),
    }
}

/// A cell with two feeders that have nothing to do with each other, a guard behind them, a zone that tells whether parts are in
/// it, and a sensor far away;
/// `everything`: all effects on for all pairs.
pub fn cell(everything: bool) -> Scene {
    let (text, inertia, centre) = shouldered();
    let size = dvec3(0.8, 0.6, 0.4);
    let tray = format!(
        "difference() {{ {} {} {} }}",
        cuboid(dvec3(6.0, 4.0, 1.0)),
        moved(dvec3(-1.5, 0.0, 0.0), &cylinder(2.0, 0.53)),
        moved(dvec3(1.5, 0.0, 0.6), &cuboid(dvec3(2.0, 2.4, 1.0)))
    );
    let texts = vec![
        tray,
        text,
        cuboid(size),
        "sphere(r = 0.35);".into(),
        cuboid(dvec3(14.0, 0.2, 3.0)),
        cuboid(dvec3(1.0, 6.0, 6.0)),
        cuboid(dvec3(15.0, 5.0, 4.0)),
    ];
    let mut actors = vec![];
    for (group, x, k) in [("left", -4.0, 0.0), ("right", 4.0, 1.0)] {
        let at = |dx: f64, y: f64, z: f64| Pose::at(dvec3(x + dx, y, z));
        let named = |what: &str| format!("{group} {what}");
        let free = |what: &str, text, pose, inertia| Actor { group, ..actor(&named(what), text, pose, Some(inertia)) };
        actors.push(Actor { group: "fixture", ..actor(&named("tray"), 0, at(0.0, 0.0, -0.5), None) });
        let start =
            Pose::new(dvec3(x - 1.496, 0.002, 0.9 + centre.z), quat_of_rotation_vector(dvec3(0.003, 0.002, 0.0)));
        let body = free("peg", 1, start, inertia);
        actors.push(Actor { place: Pose::at(-centre), friction: 0.3, ..body });
        for i in 0..4 {
            let h = 0.7 + 0.55 * f64::from(i);
            let y = 0.05 * f64::from(i % 2) + 0.02 * k;
            let pose = Pose::new(at(1.45, y, h).position, quat_of_rotation_vector(DVec3::Z * 0.1 * f64::from(i)));
            actors.push(free(&format!("box {i}"), 2, pose, Inertia::cuboid(0.5, size)));
        }
        let body = free("ball", 3, at(0.0, -1.2, 1.2 + 0.2 * k), Inertia::sphere(0.4, 0.35));
        actors.push(Actor { restitution: 0.3, ..body });
    }
    actors.push(Actor { group: "guard", ..actor("guard", 4, Pose::at(dvec3(0.0, 2.6, 1.0)), None) });
    let sensor = actor("sensor", 5, Pose::at(dvec3(60.0, 0.0, 0.0)), None);
    actors.push(Actor { group: "sensor", drawn: false, ..sensor });
    let zone = actor("zone", 6, Pose::at(dvec3(0.0, 0.0, 1.9)), None);
    actors.push(Actor { group: "sensor", drawn: false, ..zone });
    let mut settings = ordinary(1.0 / 120.0);
    settings.effects.damping = Some(Damping { linear: 0.5, angular: 8.0 });
    if everything {
        settings.effects.restitution = Some(Restitution { threshold: 0.3 });
        settings.effects.penalty = Some(Penalty { stiffness: 1e4, damping: 1e2, instead_of_impulses: false });
    }
    let groups = ["left", "right", "fixture", "guard", "sensor"];
    let mut rules = vec![];
    if everything {
        for (i, a) in groups.iter().enumerate() {
            for b in &groups[i..] {
                rules.push(Rule { sensor: *b == "sensor", ..settings.rule([a, b]) });
            }
        }
    } else {
        for group in ["left", "right"] {
            rules.push(settings.rule([group, "fixture"]));
            rules.push(settings.rule([group, group]));
            let mut seen = Rule::new([group.into(), "sensor".into()]);
            (seen.report, seen.sensor, seen.detect) = (Report::Hit, true, Detect::Discrete);
            rules.push(seen);
        }
    }
    Scene {
        name: "cell",
        about: "A cell with two feeders: pegs into their holes, boxes into their pockets, balls",
        settings,
        texts,
        actors,
        rules,
        seconds: 3.0,
        moments: vec![0.0, 0.35, 0.6, 3.0],
        panel: (560, 250),
        window: [dvec3(-7.0, -2.0, -1.0), dvec3(7.0, 2.7, 2.6)],
        from: dvec3(0.2, -1.0, 0.6),
    }
}
