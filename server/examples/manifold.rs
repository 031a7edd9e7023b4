//! Few contact points that stay: a cube that slides on a floor, its points at two steps as MuJoCo's contacts. The same in C:
//! `bindings/capi/examples/manifold.c`.

use contactd::ipc::ServerConfig;
use contactd_client::manifold::Manifolds;
use contactd_client::proto::{Pose, PoseRecord, Report, Rule};
use contactd_client::{Error, Object};
use glam::DVec3;
use std::time::Duration;

fn main() -> Result<(), Error> {
    print!("{}", points()?);
    Ok(())
}

/// What is printed: a line for each point.
pub fn points() -> Result<String, Error> {
    let mut session = contactd::embedded(&ServerConfig::default())?;
    let floor = session.load_model("floor.csg", "cube(size = [40, 40, 4], center = true);")?;
    let cube = session.load_model("cube.csg", "cube(size = [4, 4, 4], center = true);")?;
    let floor = session.add_object(Object::new("floor", floor.id).fixed())?;
    let cube = session.add_object(Object::new("cube", cube.id).at(Pose::at(DVec3::Z * 9.0)))?;
    // The cube rests a thousandth above the floor.
    let rule = Rule { report: Report::Patch, margin: 0.01, ..Rule::new(["default".into(), "default".into()]) };
    session.set_rules(&[rule])?;

    let (mut manifolds, mut lines) = (Manifolds::default(), String::new());
    for step in 0..2 {
        let at = Pose::at(DVec3::new(0.5 * f64::from(step), 0.25, 4.001));
        session.begin_step(1)?[0] = PoseRecord::start(cube, &at);
        let reply = session.finish(Duration::from_secs(5))?;
        manifolds.update(&reply, |object, _time| if object == cube { at } else { Pose::IDENTITY });
        let Some(pair) = manifolds.pair(floor, cube) else { continue };
        for p in pair.points {
            let (pos, [x, y, z, ..], dist) = p.contact().to_mujoco();
            lines += &format!("step {step}, point {}: pos {:.12} {:.12} {:.12}, ", p.id, pos.x, pos.y, pos.z);
            lines += &format!("normal {x:.12} {y:.12} {z:.12}, dist {dist:.12}\n");
        }
    }
    session.close()?;
    Ok(lines)
}
