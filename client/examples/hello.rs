//! The shortest useful client: a ball falls on a drilled plate. Start a server first: `contactd serve`.

use contactd_client::proto::{Pose, PoseRecord};
use contactd_client::{Object, Session};
use glam::DVec3;
use std::time::Duration;

const PLATE: &str =
    "difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }";
const BALL: &str = "sphere(r = 5);";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut session = Session::connect("default")?;
    let plate = session.load_model("plate.csg", PLATE)?;
    let ball = session.load_model("ball.csg", BALL)?;
    let plate = session.add_object(Object::new("plate", plate.id).fixed())?;
    let ball = session.add_object(Object::new("ball", ball.id).at(Pose::at(DVec3::new(1.0, 0.0, 20.0))))?;

    session.begin_step(1)?[0] = PoseRecord::end(ball, &Pose::at(DVec3::X));
    let reply = session.finish(Duration::from_secs(5))?;
    for c in reply.records() {
        println!("{plate}-{ball}: contact at t = {:.9}, point {:?}, normal {:?}", c.time, c.point, c.normal);
    }
    Ok(())
}
