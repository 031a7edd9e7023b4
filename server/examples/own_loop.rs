//! A loop of one's own: a ball flies from contact to contact in a room with a pillar. The same in C:
//! `bindings/capi/examples/loop.c`.

use contactd::ipc::ServerConfig;
use contactd_client::proto::contact_record::CONTACT;
use contactd_client::proto::{Pose, PoseRecord};
use contactd_client::{Error, Object};
use glam::DVec3;
use std::time::Duration;

/// A hollow cube with a pillar in it.
pub const ROOM: &str = "union() {
    difference() { cube(size = [12, 12, 12], center = true); cube(size = [10, 10, 10], center = true); }
    cylinder(h = 11, r1 = 1.5, r2 = 1.5, center = true);
}";
/// Seconds of a step.
pub const STEP: f64 = 0.25;

fn main() -> Result<(), Error> {
    print!("{}", bounces()?);
    Ok(())
}

/// What is printed: a line for each bounce of 20 seconds.
pub fn bounces() -> Result<String, Error> {
    let mut session = contactd::embedded(&ServerConfig::default())?;
    session.options.first = true;
    let room = session.load_model("room.csg", ROOM)?;
    let ball = session.load_model("ball.csg", "sphere(r = 1);")?;
    let (mut x, mut v) = (DVec3::new(-3.0, -2.5, 1.0), DVec3::new(2.0, 1.25, 0.75));
    session.add_object(Object::new("room", room.id).fixed())?;
    let ball = session.add_object(Object::new("ball", ball.id).at(Pose::at(x)))?;
    let (mut time, mut taken, mut lines) = (0.0, 1.0, String::new());
    while time < 20.0 {
        session.options.advance = taken; // of the step before
        session.begin_step(1)?[0] = PoseRecord::end(ball, &Pose::at(x + v * STEP));
        let reply = session.finish(Duration::from_secs(5))?;
        let hit = reply.records().first().filter(|c| c.status == CONTACT);
        taken = hit.map_or(reply.safe_time(), |c| c.time);
        time += taken * STEP;
        x += v * (taken * STEP);
        if let Some(c) = hit {
            let n = DVec3::from_array(c.normal); // from the room to the ball
            v -= n * (2.0 * v.dot(n));
            lines += &format!("t = {time:.12}: at {:.12} {:.12} {:.12}\n", x.x, x.y, x.z);
        }
    }
    session.close()?;
    Ok(lines)
}
