"""A loop of one's own: a ball flies from contact to contact in a room with a pillar. The same in Rust
(server/examples/own_loop.rs) and C (bindings/capi/examples/loop.c)."""

import numpy as np

import contactd

ROOM = """union() {
    difference() { cube(size = [12, 12, 12], center = true); cube(size = [10, 10, 10], center = true); }
    cylinder(h = 11, r1 = 1.5, r2 = 1.5, center = true);
}"""
STEP = 0.25

with contactd.embedded() as session:  # or contactd.connect("default")
    session.options.first = True
    room = session.load_model("room.csg", ROOM)
    ball = session.load_model("ball.csg", "sphere(r = 1);")
    x, v = np.array([-3.0, -2.5, 1.0]), np.array([2.0, 1.25, 0.75])
    session.add_object("room", room, fixed=True)
    ball = session.add_object("ball", ball, at=x)
    time, taken = 0.0, 1.0
    while time < 20.0:
        session.options.advance = taken  # of the step before
        session.begin_step(1)[0] = contactd.end(ball, x + v * STEP)
        reply = session.finish(timeout=5)
        hit = len(reply) > 0 and reply[0].status == contactd.Status.CONTACT
        taken = reply[0].time if hit else reply.safe_time
        time += taken * STEP
        x += v * (taken * STEP)
        if hit:
            n = reply[0].normal  # from the room to the ball
            v -= n * (2.0 * sum(v * n))
            print(f"t = {time:.12f}: at {x[0]:.12f} {x[1]:.12f} {x[2]:.12f}")
