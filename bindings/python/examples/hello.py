"""The shortest useful client: a ball falls on a drilled plate. The same scene and output as server/examples/hello.rs.

hello.py [--embedded] [SERVER]
"""

import sys

import contactd

PLATE = "difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }"
BALL = "sphere(r = 5);"

names = [a for a in sys.argv[1:] if a != "--embedded"]
with contactd.embedded() if "--embedded" in sys.argv else contactd.connect(*names) as session:
    plate = session.load_model("plate.csg", PLATE)
    ball = session.load_model("ball.csg", BALL)
    session.add_object("plate", plate, fixed=True)
    ball = session.add_object("ball", ball, at=(1, 0, 20))

    session.begin_step(1)[0] = contactd.end(ball, (1, 0, 0))
    for c in session.finish(timeout=5):
        point = " ".join(f"{x:.12f}" for x in c.point)
        normal = " ".join(f"{x:.12f}" for x in c.normal)
        print(f"{c.a}-{c.b}: contact at t = {c.time:.15f}, point {point}, normal {normal}")
