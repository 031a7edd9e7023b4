"""A robot from its file: it turns until it meets a post, goes back, and takes a part along that it does not collide with meanwhile.

robot.py [--embedded] [SERVER]
"""

import pathlib
import sys
import tempfile

import contactd
from contactd.solid import sphere

URDF = """<robot name="arm">
  <link name="post"><collision><origin xyz="0 1.4 0"/><geometry><cylinder radius="0.1" length="2"/></geometry></collision></link>
  <link name="rod"><collision><origin xyz="0.7 0 0"/><geometry><box size="1.4 0.2 0.2"/></geometry></collision></link>
  <joint name="turn" type="revolute">
    <parent link="post"/><child link="rod"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="-3" upper="3"/>
  </joint>
</robot>"""

# The format lets links that a joint connects pass each other; here they are to be tested.
TESTED = contactd.Rule(["default", "default"])

names = [a for a in sys.argv[1:] if a != "--embedded"]
with contactd.embedded() if "--embedded" in sys.argv else contactd.connect(*names) as session:
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "arm.urdf")
        path.write_text(URDF)
        arm = session.load_scene(path)
    session.set_rules([TESTED])

    [meets] = arm.step({"turn": 2.0}, timeout=5)
    print(f"the rod meets the post at t = {meets.time:.9f}")
    arm.stop_at(meets.time_lower)
    print(f"it stands at turn = {arm.joints['turn'].value:.9f}")

    arm.set_joints({"turn": -2.0})
    model = session.load_model("part", sphere(0.2))
    at = (1.5 * -0.4161468365471424, 1.5 * -0.9092974268256817, 0.5)  # at the rod's end
    part = session.add_object("part", model, at=at)
    session.attach(part, arm.objects["rod"])
    called = {id: name for name, id in arm.objects.items()} | {part: "part"}
    # The part is not tested against the rod, but against the post.
    for c in arm.step({"turn": 1.5}, timeout=5):
        print(f"{called[c.a]} and {called[c.b]} meet at t = {c.time:.9f}")
