"""Robots from files, driven by their joints, parts that go along, and clearances: by closed forms of balls on circles."""

import math

import numpy as np
import pytest

import contactd


def urdf(length, height, radius, post, angle):
    """An arm with a ball at its end that turns about z on a slide, and a ball on the same circle."""
    x, y = length * math.cos(angle), length * math.sin(angle)
    return f"""<robot name="r">
      <link name="base"><collision><origin xyz="{x!r} {y!r} {height!r}"/>
        <geometry><sphere radius="{post!r}"/></geometry></collision></link>
      <link name="hub"/>
      <link name="arm"><collision><origin xyz="{length!r} 0 0"/><geometry><sphere radius="{radius!r}"/></geometry></collision></link>
      <joint name="lift" type="prismatic"><parent link="base"/><child link="hub"/><axis xyz="0 0 1"/>
        <limit lower="0" upper="{height!r}"/></joint>
      <joint name="turn" type="revolute"><parent link="hub"/><child link="arm"/><axis xyz="0 0 1"/>
        <limit lower="-3" upper="3"/></joint></robot>"""


class Arm:
    """Random numbers of it, and when it meets the other ball."""

    def __init__(self, rng, folder):
        self.length, self.height = rng.uniform(1, 3), rng.uniform(2, 4)
        self.radius, self.post = rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.4)
        self.angle, self.begin = rng.uniform(0.5, 1.2), rng.uniform(-1, -0.5)
        self.path = folder / "arm.urdf"
        self.path.write_text(urdf(self.length, self.height, self.radius, self.post, self.angle))

    def chord(self, turn):
        return 2 * self.length * abs(math.sin((self.angle - turn) / 2))

    def meets(self, end):
        """When the balls touch on the way from ``begin`` to ``end``."""
        lag = 2 * math.asin((self.radius + self.post) / (2 * self.length))
        return (self.angle - lag - self.begin) / (end - self.begin)


def test_an_arm_turns_on_its_arc_and_stops_where_it_met_something(session, tmp_path):
    rng = np.random.default_rng(4)
    for _ in range(5):
        arm = Arm(rng, tmp_path)
        scene = session.load_scene(arm.path, {"turn": arm.begin})
        assert list(scene.objects) == ["base", "arm"] and list(scene.joints) == ["lift", "turn"]
        assert not scene.joints["lift"].turns and scene.joints["lift"].range == (0, arm.height)
        # Below the other ball it passes.
        assert len(scene.step({"turn": arm.angle}, timeout=5)) == 0
        scene.set_joints({"turn": arm.begin, "lift": arm.height})
        [met] = scene.step({"turn": arm.angle}, timeout=5)
        assert met.time == pytest.approx(arm.meets(arm.angle), abs=1e-9)
        scene.stop_at(met.time_lower)
        turn = arm.begin + met.time_lower * (arm.angle - arm.begin)
        assert scene.joints["turn"].value == pytest.approx(turn, abs=1e-12)
        at = [[arm.length * math.cos(turn), arm.length * math.sin(turn), arm.height]]
        [told] = session.points(at, objects=[scene.objects["arm"]])
        assert told["upper"] == pytest.approx(-arm.radius, abs=1e-6)
        for id in scene.objects.values():
            session.remove_object(id)


def test_a_rule_asks_for_the_clearance_of_a_step(session, tmp_path):
    rng = np.random.default_rng(5)
    for _ in range(5):
        arm = Arm(rng, tmp_path)
        end = arm.begin + rng.uniform(0, 1) * (arm.meets(1 + arm.begin) - 0.05)
        scene = session.load_scene(arm.path, {"turn": arm.begin, "lift": arm.height})
        assert scene.rules == [contactd.Rule(["default", "default"])]
        session.set_rules([contactd.Rule(["default", "default"], clearance=1e-7)])
        reply = scene.step({"turn": end}, timeout=5)
        clearance = reply.clearance(0)
        expected = arm.chord(end) - arm.radius - arm.post
        assert clearance.lower - 1e-9 <= expected <= clearance.upper + 1e-9
        assert clearance.upper - clearance.lower <= 1e-7 and clearance.time == pytest.approx(1, abs=1e-6)
        assert clearance.flags == contactd.ClearanceFlag.SETTLED | contactd.ClearanceFlag.POINTS
        apart = np.linalg.norm(clearance.points[0] - clearance.points[1])
        assert apart == pytest.approx(clearance.upper, abs=1e-9) and len(reply.clearances) == 1
        assert reply.effects & contactd.Effect.CLEARANCE
        for id in scene.objects.values():
            session.remove_object(id)
        session.set_rules([])


def test_what_is_attached_goes_along_and_is_not_tested_against_its_carrier(session, tmp_path):
    arm = Arm(np.random.default_rng(6), tmp_path)
    scene = session.load_scene(arm.path, {"turn": arm.begin})
    session.set_rules([])
    model = session.load_model("ball", contactd.solid.sphere(0.2))
    # Above the arm's ball, within it, so high that it meets the other one as if that stood at the arm's height.
    at = (arm.length * math.cos(arm.begin), arm.length * math.sin(arm.begin), arm.height)
    part = session.add_object("part", model, at=at)
    hand = scene.objects["arm"]
    session.attach(part, hand)
    assert session.carrier(part) == hand and session.carrier(hand) is None
    [met] = scene.step({"turn": arm.angle}, timeout=5)
    lag = 2 * math.asin((0.2 + arm.post) / (2 * arm.length))
    assert {met.a, met.b} == {part, scene.objects["base"]}
    assert met.time == pytest.approx((arm.angle - lag - arm.begin) / (arm.angle - arm.begin), abs=1e-9)
    session.allow([(part, scene.objects["base"])])
    assert len(scene.step({"turn": arm.begin}, timeout=5)) == 0
    session.detach(part)
    session.allow([(part, scene.objects["base"])], allowed=False)
    # It stays; the arm below it passes both.
    assert len(scene.step({"turn": arm.angle}, timeout=5)) == 0
    with pytest.raises(contactd.Misuse, match="attached to itself"):
        session.attach(part, part)


def test_what_is_wrong_is_one_sentence(session, tmp_path):
    arm = Arm(np.random.default_rng(7), tmp_path)
    with pytest.raises(contactd.Refused, match=r"none\.urdf: expected a readable file"):
        session.load_scene(tmp_path / "none.urdf")
    with pytest.raises(contactd.Refused, match=r"arm\.urdf:.*expected -3 to 3 as turn, found 4"):
        session.load_scene(arm.path, {"turn": 4})
    scene = session.load_scene(arm.path)
    with pytest.raises(contactd.Refused, match=r'expected one of the joints lift, turn, found "elbow"'):
        scene.step({"elbow": 1})
    with pytest.raises(contactd.Refused, match="expected a time within the step, 0 to 1, found 2"):
        scene.stop_at(2)
    with pytest.raises(ValueError, match="turn, found NaN"):
        scene.set_joints({"turn": math.nan})
    assert len(session.points([[0, 0, 0]])) == 1
