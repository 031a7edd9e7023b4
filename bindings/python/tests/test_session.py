"""What a loop does: models, objects, rules, steps, over both ways."""

import doctest
import math
import threading
import time

import numpy as np
import pytest
from conftest import fill

import contactd
from contactd import Flag, Order, Rule, Status, StepStatus, Valid


def test_the_packages_own_example_is_true():
    assert doctest.testmod(contactd).failed == 0
    assert doctest.testmod(contactd).attempted == 2


def test_a_ball_meets_a_wall(ball_and_wall):
    session, ball, wall = ball_and_wall
    poses = session.begin_step(1)
    assert poses.dtype == contactd.POSE and poses.shape == (1,)
    assert not np.asarray(poses).tobytes().strip(b"\0"), "slots are zero"
    poses["object"] = ball
    poses["flags"] = Order.END
    poses["position"] = [[16, 0, 0]]
    poses["rotation"][0] = [0, 0, 0, 1]
    reply = session.finish(timeout=10)
    assert len(reply) == 1 and reply.records.dtype == contactd.CONTACT
    record = reply[0]
    assert (record.a, record.b) == (wall, ball)
    assert record.status == Status.CONTACT and contactd.STATUS_NAMES[record.status] == "contact"
    assert record["time"] == pytest.approx(0.5, abs=1e-9) and reply.safe_time <= record.time
    assert record.valid & Valid.POINT and np.allclose(record.point, [9, 0, 0], atol=1e-8)
    assert np.allclose(record.normal, [-1, 0, 0]) and record.normal_speed == pytest.approx(16)
    assert reply.status == StepStatus.CONTACT and not reply.truncated and reply.pairs == 1
    assert reply.counters["closed_forms"] >= 0 and reply.effect_counters["contact"] == 1
    assert contactd.Effect.CONTACT in reply.effects


def test_embedded_and_shared_memory_give_the_same_bits(shared_server):
    def answers(session):
        with session:
            ball, _ = fill(session)
            session.options.details = True
            found = []
            for k in range(5):
                session.begin_step(1)[0] = contactd.turn(ball, (8.3 + 0.1 * k, 0.7 * k, 1 / 3), (0.1, 0.2, 0.3))
                found.append(session.finish(timeout=10).slots.tobytes())
                session.options.advance = 0.1
            return found

    embedded, shared = answers(contactd.embedded()), answers(contactd.connect(shared_server.name))
    assert embedded == shared and len(embedded[0]) == 256


def test_advance_is_put_back_after_an_accepted_step(ball_and_wall):
    session, ball, _ = ball_and_wall
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    time_of_contact = session.finish().records["time"][0]
    session.options.advance = time_of_contact
    session.begin_step(1)[0] = contactd.end(ball, (0, 0, 0))
    reply = session.finish()
    assert session.options.advance == 1.0 and len(reply) == 0


def test_details_regions_and_patches(session):
    block = session.load_model("block.csg", "cube(size = [2, 2, 2], center = true);")
    lower = session.add_object("lower", block, fixed=True)
    upper = session.add_object("upper", block, at=((0.5, 0, 2.01), (0, 0, 0, 1)))
    session.set_rules([Rule(("default", "default"), report="patch", margin=0.05)])
    session.options.details = True
    session.begin_step(0)
    reply = session.finish(timeout=30)
    [record] = reply
    assert (record.a, record.b) == (lower, upper) and record.flags & Flag.TOUCHING
    detail = reply.detail(record)
    assert detail.dtype == contactd.DETAIL and detail.resolution > 0 and detail.margin_time == 0
    [region] = reply.regions(0)
    assert contactd.KIND_NAMES[region.slot.kind] == "face-face" and contactd.EXTENT_NAMES[region.slot.extent] == "patch"
    assert np.allclose(region.slot.normal, [0, 0, 1])
    corners = {(round(x, 9), round(y, 9)) for x, y, _ in region.points}
    assert corners == {(-0.5, -1), (-0.5, 1), (1, -1), (1, 1)}
    assert np.allclose(region.points[:, 2], 1.005) and np.allclose(region.separations, 0.01)
    assert reply.patches(0).dtype == contactd.PATCH and len(reply.patches(record)) == 1 == len(reply.all_patches)
    assert len(reply.details) == 1 == len(reply.all_regions)
    face = block.faces[record.faces_a[0]]
    assert (face.name, face.face, face.subtracted) == ("cube", "+z", False)
    third = session.add_object("third", block, at=((-0.5, 0, -2.02), (0, 0, 0, 1)))
    session.begin_step(0)
    reply = session.finish(timeout=30)
    # Details stand between regions and patches: gathered, so taking an array of them holds nothing up.
    gathered = np.asarray(reply.details)
    assert len(reply) == 2 == len(gathered) and reply.all_regions["separation"] == pytest.approx([0.01, 0.02])
    session.begin_step(1)[0] = contactd.end(third, (0, 0, -9))


def test_details_alone_are_a_view_in_place(session):
    ball = session.load_model("ball.csg", "sphere(r = 1);")
    balls = [session.add_object(f"b{i}", ball, at=(3 * i, 0, 0)) for i in range(5)]
    session.options.details = session.options.clear = True
    session.begin_step(1)[0] = contactd.end(balls[0], (12, 0.5, 0))
    reply = session.finish()
    assert len(reply) == len(reply.details) > 1
    assert np.shares_memory(np.asarray(reply.details), np.asarray(reply.slots))
    assert [d.cells for d in reply.details] == [reply.detail(i).cells for i in range(len(reply))]
    assert np.all(reply.details["time_upper"] >= reply.records["time_lower"])


def test_rules_choose_what_is_told(ball_and_wall):
    session, ball, wall = ball_and_wall

    def step(rules):
        session.set_rules(rules)
        session.begin_step(2)[:] = [contactd.start(ball, (0, 0, 0)), contactd.end(ball, (16, 0, 0))]
        return session.finish().records.copy()

    [hit] = step([Rule(("default", "default"), report="hit")])
    assert hit["status"] == Status.CONTACT and hit["valid"] == 0 and hit["time"] == 0
    [sensor] = step([Rule(["default", "default"], sensor=True, penetration=True)])
    assert sensor["flags"] & Flag.SENSOR
    assert len(step([Rule(("default", "default"), except_=[("ball", "wall")])])) == 0
    assert len(step([Rule(("default", "other"))])) == 0
    # At the end pose the ball is through the wall.
    assert len(step([Rule(("default", "default"), initial_overlap="ignore_if_separating", detect="discrete")])) == 0


def test_objects_carry_what_is_declared(session):
    ball = session.load_model("ball.csg", "sphere(r = 1);")
    still = session.add_object("still", ball, rotates=False, group="slow", max_speed=2.0, place=contactd.Pose((1, 0, 0)))
    session.options.dt = 1.0
    with pytest.raises(contactd.Refused) as turned:
        session.begin_step(1)[0] = contactd.turn(still, (0, 0, 0), (0, 0, 1))
        session.finish()
    assert turned.value.code == contactd.ErrorCode.DECLARATION and turned.value.index == 0
    session.begin_step(1)[0] = contactd.end(still, (1.5, 0, 0))
    session.finish()
    with pytest.raises(contactd.Refused, match="declared"):
        session.begin_step(1)[0] = contactd.end(still, (9, 0, 0))
        session.finish()
    session.remove_object(still)
    with pytest.raises(contactd.Refused) as gone:
        session.remove_object(still)
    assert gone.value.code == contactd.ErrorCode.UNKNOWN_OBJECT


def test_a_file_is_read_as_its_format_or_its_name_says(session):
    text = "cube(size = [1, 2, 3], center = true);"
    models = [
        session.load_model("a", text),
        session.load_model("a.csg", text.encode()),
        session.load_model("a.bin", text.encode(), format="csg"),
    ]
    assert [session.mass_properties(model).volume for model in models] == [6, 6, 6]
    with pytest.raises(contactd.Refused, match='expected one of the formats csg, stl, .* found "step"'):
        session.load_model("a.csg", text, format="step")
    with pytest.raises(contactd.Refused, match="a.csg:1:1: expected text in UTF-8, found the byte 0xff"):
        session.load_model("a.csg", b"\xff")


def test_mass_properties_and_warnings(session):
    model = session.load_model("box.csg", "cube(size = [1, 2, 3], center = true);")
    mass = session.mass_properties(model).with_density(2.0)
    assert mass.volume == pytest.approx(6, abs=1e-12) and mass.mass == pytest.approx(12)
    assert mass.inertia[0] == pytest.approx(12 * (4 + 9) / 12) and mass.inertia[3] == pytest.approx(0, abs=1e-12)
    moved = mass.placed((1, 2, 3), (0, 0, math.sin(math.pi / 4), math.cos(math.pi / 4)))
    assert moved.center == pytest.approx((1, 2, 3)) and moved.inertia[0] == pytest.approx(mass.inertia[1])
    assert "MassProperties(volume=6" in repr(mass)
    assert model.warnings == []
    with pytest.raises(contactd.Refused) as refused:
        session.mass_properties(99)
    assert refused.value.code == contactd.ErrorCode.UNKNOWN_MODEL
    warned = session.load_model("w.csg", "cylinder(h = 2, r1 = 1, r2 = 1, $fn = 6);", facets="exact")
    assert isinstance(warned.warnings, list)


def test_resolution_and_options(ball_and_wall):
    session, ball, _ = ball_and_wall
    session.set_resolution(1e-3)
    session.options.details = True
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    assert session.finish().details["resolution"][0] == 1e-3
    session.set_resolution(None)
    assert "details=True" in repr(session.options)
    with pytest.raises(AttributeError):
        session.options.detail = True
    with pytest.raises(TypeError):
        session.options.first = "yes"
    with pytest.raises(OverflowError):
        session.options.max_records = -1
    with pytest.raises(contactd.Refused) as refused:
        session.set_resolution(-1.0)
    assert refused.value.code == contactd.ErrorCode.RESOLUTION


def test_a_loop_needs_no_del(ball_and_wall):
    session, ball, _ = ball_and_wall
    seen = []
    for k in range(20):
        poses = session.begin_step(1)
        positions = poses["position"]
        first = poses[0]
        first["object"], first["flags"] = ball, Order.END
        positions[0] = [8.5 if k % 3 == 1 else 0, 0, k]
        poses["rotation"] = [0, 0, 0, 1]
        positions += 0.25
        reply = session.finish()
        records = reply.records
        times = records["time"]
        for record in reply:
            point = record.point
            seen.append((float(times.min()), float(np.linalg.norm(point))))
    assert 5 < len(seen) < 20


def test_the_interpreters_lock_is_released_while_waiting(shared_server):
    # An import of some tenths of a second; meanwhile another thread counts.
    text = "union() {%s}" % "".join(
        f"multmatrix([[1,0,0,{3 * (i % 60)}],[0,1,0,{3 * (i // 60)}],[0,0,1,0],[0,0,0,1]]) {{ cylinder(h = 2, r1 = 1, r2 = 0.5); }}"
        for i in range(3600)
    )
    counted, over = [0], threading.Event()

    def count():
        while not over.is_set():
            counted[0] += 1
            time.sleep(1e-4)

    thread = threading.Thread(target=count)
    with contactd.connect(shared_server.name) as session:
        thread.start()
        started = time.monotonic()
        try:
            session.load_model("many.csg", text)
            seconds, n = time.monotonic() - started, counted[0]
        finally:
            over.set()
            thread.join()
    assert n > 3, f"{n} rounds of another thread in {seconds:.3f} s of loading"


def test_sessions_and_objects_have_ids(session):
    assert session.id >= 1 and session.max_batch >= 1000 and session.epoch >= 0
    assert not session.closed
    session.close()
    assert session.closed


def test_an_empty_batch_is_a_step(session):
    poses = session.begin_step(0)
    assert len(poses) == 0 and np.array(poses).shape == (0,) and np.asarray(poses).shape == (0,)
    reply = session.finish()
    assert len(reply) == 0 and reply.records.shape == (0,) and list(reply) == [] and reply.safe_time == 1.0
