//! A ball rolls on a plate and falls through its hole; rapier's own convex hull of the plate it rolls over:
//! `cargo run --release -p contactd-rapier --example hole [-- FOLDER]`.
//!
//! Prints where both end and writes two pictures into FOLDER (default target/rapier): moments of both runs, and height over time.

use contactd::import::{Facets, Limits, import_csg};
use contactd::ipc::ServerConfig;
use contactd::math::Aabb;
use contactd::picture::drawing::{Anchor, Color, Drawing, GREY, INK, Size};
use contactd::picture::ray::Traced;
use contactd::picture::scene::COLORS;
use contactd::picture::view::{Camera, Thing, View};
use contactd_client::proto::Pose as WorldPose;
use contactd_rapier::{Coupling, Settings};
use glam::{DQuat, DVec3};
use rapier3d_f64::prelude::*;
use std::path::PathBuf;

const PLATE: &str = "difference() { cube(size = [4, 3, 0.6], center = true);
    cylinder(h = 3, r1 = 0.55, r2 = 0.55, center = true); }";
const BALL: &str = "sphere(r = 0.4);";
const RADIUS: f64 = 0.4;
/// Upper face at z = 0.
const PLATE_AT: Vector = Vector::new(0.0, 0.0, -0.3);
const START: Vector = Vector::new(-1.5, 0.0, 0.401);
const SPEED: f64 = 1.0;
const GRAVITY: Vector = Vector::new(0.0, 0.0, -9.81);
const DT: f64 = 1.0 / 60.0;
const STEPS: usize = 120;
/// Moments that are drawn, seconds.
const MOMENTS: [f64; 6] = [0.0, 0.8, 1.3, 1.5, 1.6, 1.7];
const PANEL: (usize, usize) = (250, 230);
const GAP: usize = 8;
const WITH: Color = Color::hex(0x0b6e8a);
const STOCK: Color = Color::hex(0xb86e1a);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "target/rapier".into()));
    std::fs::create_dir_all(&folder)?;
    let (with, stock) = (with_contactd()?, stock());
    let last = [&with, &stock].map(|run| run[STEPS].translation);
    println!("after {:.1} s: with contactd at {:.3}, rapier's hull at {:.3}", STEPS as f64 * DT, last[0], last[1]);
    if last[0].z > -1.0 || last[1].z < 0.35 {
        return Err("the ball is not where it should be".into());
    }
    for (name, drawing) in
        [("rapier_frames.png", frames(&stock, &with)?), ("rapier_height.png", heights(&stock, &with))]
    {
        let path = folder.join(name);
        std::fs::write(&path, drawing.encode_for(&path)?)?;
        println!("{}", path.display());
    }
    Ok(())
}

/// A ball that rolls towards the hole, without slip.
fn rolling() -> RigidBodyBuilder {
    let spin = Vector::new(0.0, SPEED / RADIUS, 0.0);
    RigidBodyBuilder::dynamic().translation(START).linvel(Vector::new(SPEED, 0.0, 0.0)).angvel(spin)
}

/// The ball's poses, step by step, with contactd's contacts.
fn with_contactd() -> Result<Vec<Pose>, contactd_client::Error> {
    let mut coupling = Coupling::new(contactd::embedded(&ServerConfig::default())?, Settings::default())?;
    let mut world = coupling.world(GRAVITY);
    world.integration_parameters.dt = DT;
    let plate = coupling.load("plate.csg", PLATE)?;
    let ball = coupling.load("ball.csg", BALL)?;
    let plate = coupling.fixed("plate", &plate, &Pose::from_translation(PLATE_AT))?;
    world.insert_collider(plate, None);
    let (body, _) = world.insert(rolling(), coupling.moving("ball", &ball)?);
    let mut poses = vec![*world.bodies[body].position()];
    for _ in 0..STEPS {
        coupling.step(&mut world)?;
        poses.push(*world.bodies[body].position());
    }
    Ok(poses)
}

/// The same with rapier's own shapes: a ball, and the convex hull of the plate.
fn stock() -> Vec<Pose> {
    let mut world = PhysicsWorld { gravity: GRAVITY, ..PhysicsWorld::default() };
    world.integration_parameters.dt = DT;
    world.insert_collider(ColliderBuilder::cuboid(2.0, 1.5, 0.3).translation(PLATE_AT), None);
    let (body, _) = world.insert(rolling(), ColliderBuilder::ball(RADIUS));
    let mut poses = vec![*world.bodies[body].position()];
    for _ in 0..STEPS {
        world.step();
        poses.push(*world.bodies[body].position());
    }
    poses
}

/// Both runs as strips, rapier's own above; the plate is cut open.
fn frames(stock: &[Pose], with: &[Pose]) -> Result<Drawing, String> {
    let solid =
        |text| import_csg("hole", text, Facets::Auto, &Limits::default()).map(|i| i.solid).map_err(|e| e.to_string());
    let (plate, ball) = (solid(PLATE)?, solid(BALL)?);
    let (plate, ball) = (Traced::new(&plate), Traced::new(&ball));
    let window = Aabb { min: DVec3::new(-2.0, -0.4, -1.6), max: DVec3::new(2.0, 1.5, 0.8) };
    let camera = Camera::framing(&[window], DVec3::new(-0.25, -1.0, 0.42), PANEL);
    let mut drawing = Drawing::new(MOMENTS.len() * (PANEL.0 + GAP) + GAP, 2 * (PANEL.1 + 36) + 28);
    for (row, (title, run)) in [("rapier's convex hull", stock), ("with contactd", with)].into_iter().enumerate() {
        let top = (row * (PANEL.1 + 36)) as f64 + 36.0;
        drawing.bold([GAP as f64, top - 16.0], title, Size::Normal, Anchor::Left, INK);
        for (k, time) in MOMENTS.into_iter().enumerate() {
            let pose = run[(time / DT).round() as usize];
            let things = vec![
                Thing {
                    traced: &plate,
                    pose: WorldPose::at(DVec3::from_array(PLATE_AT.to_array())),
                    color: COLORS[0],
                    cut: Some(vec![(DVec3::NEG_Y, 0.0)]),
                },
                Thing { traced: &ball, pose: world_pose(&pose), color: COLORS[1], cut: None },
            ];
            let view = View { things, camera, ground: None, samples: 3 };
            let left = (GAP + k * (PANEL.0 + GAP)) as f64;
            drawing.image([left, top], PANEL.0, view.render());
            drawing.rectangle([left, top], [PANEL.0 as f64, PANEL.1 as f64], None, Some((GREY, 1.0)));
            if row == 1 {
                let at = [left + 0.5 * PANEL.0 as f64, top + PANEL.1 as f64 + 16.0];
                drawing.text(at, &format!("t = {time:.1} s"), Size::Normal, Anchor::Middle, INK);
            }
        }
    }
    Ok(drawing)
}

/// Height of the ball's centre over time in both runs.
fn heights(stock: &[Pose], with: &[Pose]) -> Drawing {
    let (width, height) = (720.0, 360.0);
    let (left, right, top, bottom) = (70.0, 20.0, 44.0, 50.0);
    let (low, high) = (-2.0, 1.0);
    let seconds = STEPS as f64 * DT;
    let at = |t: f64, z: f64| {
        let x = left + t / seconds * (width - left - right);
        [x, top + (high - z) / (high - low) * (height - top - bottom)]
    };
    let mut drawing = Drawing::new(width as usize, height as usize);
    drawing.bold([left, 20.0], "Height of the ball's centre", Size::Normal, Anchor::Left, INK);
    for z in [-2.0, -1.0, 0.0, 1.0] {
        drawing.line(at(0.0, z), at(seconds, z), GREY.alpha(0.4), 1.0);
        let [x, y] = at(0.0, z);
        drawing.text([x - 8.0, y], &format!("{z:.0}"), Size::Small, Anchor::Right, GREY);
    }
    for t in [0.0, 0.5, 1.0, 1.5, 2.0] {
        let [x, y] = at(t, low);
        drawing.text([x, y + 16.0], &format!("{t:.1}"), Size::Small, Anchor::Middle, GREY);
    }
    let [x, y] = at(0.5 * seconds, low);
    drawing.text([x, y + 36.0], "time, s (the plate's face is at 0)", Size::Small, Anchor::Middle, GREY);
    for (run, color, name, label) in [(stock, STOCK, "rapier's convex hull", 0.62), (with, WITH, "with contactd", -1.2)]
    {
        let heights = run.iter().enumerate().map(|(k, pose)| (k as f64 * DT, pose.translation.z));
        drawing.path(heights.take_while(|(_, z)| *z > low).map(|(t, z)| at(t, z)).collect(), color, 2.5);
        drawing.text(at(if label > 0.0 { 0.25 } else { 0.9 }, label), name, Size::Normal, Anchor::Left, color);
    }
    drawing
}

fn world_pose(pose: &Pose) -> WorldPose {
    let position = DVec3::from_array(pose.translation.to_array());
    WorldPose::new(position, DQuat::from_array(pose.rotation.to_array()))
}
