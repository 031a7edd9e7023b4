//! The shortest useful client: a ball falls on a drilled plate. `hello [--embedded] [SERVER]`: with an engine of its own, or on
//! a server that runs (`contactd serve`). The same in C: `bindings/capi/examples/hello.c`.

use contactd::ipc::{Embedded, ServerConfig};
use contactd_client::proto::names::{Address, DEFAULT_NAME};
use contactd_client::proto::{Pose, PoseRecord};
use contactd_client::{Error, Object, Session, SharedMemory, Transport};
use glam::DVec3;
use std::time::Duration;

const PLATE: &str =
    "difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }";
const BALL: &str = "sphere(r = 5);";

fn main() -> Result<(), Error> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let server = arguments.iter().find(|a| *a != "--embedded").map_or(DEFAULT_NAME, String::as_str);
    let transport: Box<dyn Transport> = if arguments.iter().any(|a| a == "--embedded") {
        Box::new(Embedded::new(&ServerConfig::default()))
    } else {
        Box::new(SharedMemory::new(Address::of(server)?))
    };
    print!("{}", hello(Session::new(transport)?)?);
    Ok(())
}

/// What is printed: a line for each record.
pub fn hello<T: Transport>(mut session: Session<T>) -> Result<String, Error> {
    let plate = session.load_model("plate.csg", PLATE)?;
    let ball = session.load_model("ball.csg", BALL)?;
    session.add_object(Object::new("plate", plate.id).fixed())?;
    let ball = session.add_object(Object::new("ball", ball.id).at(Pose::at(DVec3::new(1.0, 0.0, 20.0))))?;

    session.begin_step(1)?[0] = PoseRecord::end(ball, &Pose::at(DVec3::X));
    let mut lines = String::new();
    for c in session.finish(Duration::from_secs(5))?.records() {
        let ([x, y, z], [u, v, w]) = (c.point, c.normal);
        lines += &format!("{}-{}: contact at t = {:.15}, ", c.a, c.b, c.time);
        lines += &format!("point {x:.12} {y:.12} {z:.12}, normal {u:.12} {v:.12} {w:.12}\n");
    }
    session.close()?;
    Ok(lines)
}
