//! The reference physics loop at work, on an engine in this process:
//! `cargo run --release -p contactd --example physics [-- SCENE|all [FOLDER]]`.
//!
//! Prints a table a scene, the cost of a cell with everything on beside the one with only what it calls for, and writes each
//! scene as a strip of moments into FOLDER (default target/physics), as SVG and PNG.

mod scenes;
mod strip;
mod table;

use contactd::ipc::{Embedded, ServerConfig};
use contactd_client::dynamics::{Body, Energy, Frame, World};
use contactd_client::proto::Pose;
use contactd_client::{Error, Object};
use scenes::Scene;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What a run of a scene was.
pub struct Run {
    /// Sums over all frames.
    pub total: Frame,
    /// Energy before the first and after the last frame.
    pub energy: [Energy; 2],
    /// Free bodies, and those of them asleep at the end.
    pub bodies: [usize; 2],
    /// Poses of all bodies at the scene's moments.
    pub moments: Vec<(f64, Vec<Pose>)>,
    /// Time of all frames.
    pub took: Duration,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let wanted = arguments.next().unwrap_or_else(|| "all".into());
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "target/physics".into()));
    let all = scenes::all();
    let chosen: Vec<&Scene> = all.iter().filter(|s| wanted == "all" || s.name == wanted).collect();
    if chosen.is_empty() {
        let names: Vec<&str> = all.iter().map(|s| s.name).collect();
        return Err(format!("expected all or one of {}, found \"{wanted}\"", names.join(", ")).into());
    }
    std::fs::create_dir_all(&folder)?;
    for scene in chosen {
        let run = play(scene)?;
        table::print(scene, &run);
        if scene.name == "cell" {
            let dear = play(&scenes::cell(true))?;
            table::compare(&dear, &run);
        }
        for path in strip::write(scene, &run, &folder)? {
            println!("{}", path.display());
        }
        println!();
    }
    Ok(())
}

/// Runs a scene from its beginning to its end.
fn play(scene: &Scene) -> Result<Run, Error> {
    let mut session = contactd::embedded(&ServerConfig::default())?;
    let mut models = Vec::new();
    for (i, text) in scene.texts.iter().enumerate() {
        models.push(session.load_model(&format!("{}_{i}.csg", scene.name), text)?.id);
    }
    let mut world: World<Embedded> = World::new(session, scene.settings)?;
    if !scene.rules.is_empty() {
        world.session().set_rules(&scene.rules)?;
    }
    for actor in &scene.actors {
        let object = Object::new(&actor.name, models[actor.text]).group(actor.group).place(actor.place);
        let body = match actor.inertia {
            Some(inertia) => Body::new(object, inertia),
            None => Body::fixed(object),
        };
        let body = body.at(actor.pose).moving(actor.velocity, actor.omega);
        world.add(body.friction(actor.friction).restitution(actor.restitution))?;
    }
    let dt = scene.settings.dt;
    let frames = (scene.seconds / dt).round() as usize;
    let mut moments = Vec::new();
    let mut next = 0;
    let before = world.energy();
    let mut took = Duration::ZERO;
    for k in 0..=frames {
        if next < scene.moments.len() && k as f64 * dt >= scene.moments[next] - 0.5 * dt {
            moments.push((k as f64 * dt, (0..world.len()).map(|i| world.pose(i)).collect()));
            next += 1;
        }
        if k < frames {
            let start = Instant::now();
            world.frame()?;
            took += start.elapsed();
        }
    }
    let free: Vec<usize> = (0..world.len()).filter(|i| scene.actors[*i].inertia.is_some()).collect();
    let asleep = free.iter().filter(|i| world.state(**i).asleep).count();
    let energy = [before, world.energy()];
    Ok(Run { total: *world.total(), energy, bodies: [free.len(), asleep], moments, took })
}
