"""Manifolds: few points of a region, with ids that stay."""

import subprocess
import sys

import numpy as np
import pytest

import contactd
from contactd.manifold import Manifolds

UP = np.array([0.0, 0.0, 1.0])
FLOOR = "cube(size = [60, 60, 10], center = true);"
DRILLED = "difference() { cube(size = [60, 60, 10], center = true); cylinder(h = 30, r1 = 10.5, r2 = 10.5, center = true); }"
PEG = "union() { cylinder(h = 50, r1 = 10, r2 = 10, center = true); cylinder(h = 8, r1 = 18, r2 = 18); }"


class Scene:
    """A body over a floor whose top is at z = 0, put where it is wanted; its manifold."""

    def __init__(self, session, floor, body):
        self.session, self.manifolds = session, Manifolds()
        floor = session.load_model("floor.csg", floor)
        self.floor = session.add_object("floor", floor, fixed=True, at=(0, 0, -5))
        self.body = session.add_object("body", session.load_model("body.csg", body), at=(0, 0, 100))
        session.set_rules([contactd.Rule(("default", "default"), report="patch", margin=0.2, penetration=True)])
        session.options.details = True

    def put(self, position, rotation=(0, 0, 0, 1)):
        """The body's points at a pose."""
        self.session.begin_step(1)[0] = contactd.start(self.body, position, rotation)
        reply = self.session.finish()
        poses = {self.floor: (0, 0, -5), self.body: (position, rotation)}
        self.manifolds.update(reply, lambda object, time: poses[object])
        return [(pair, p) for pair in self.manifolds for p in pair.points]


def test_the_modules_are_there_once_the_package_is():
    told = "import contactd; contactd.manifold.Manifolds(); print(contactd.convention.quaternion_from_wxyz([1, 0, 0, 0]))"
    # An interpreter of its own: here others have imported them.
    assert subprocess.run([sys.executable, "-c", told], capture_output=True, check=True, text=True).stdout == "[0. 0. 0. 1.]\n"


def about_z(angle):
    return (0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2))


def test_a_shoulder_on_a_drilled_plate(session):
    scene = Scene(session, DRILLED, PEG)
    found = scene.put((0, 0, 0.1))
    assert len(found) == 4 and all(pair.is_complete and (pair.a, pair.b) == (1, 2) for pair, _ in found)
    for _, p in found:
        assert np.allclose(p.normal, UP) and p.separation == pytest.approx(0.1)
        assert np.hypot(*p.position[:2]) == pytest.approx(18) and p.position[2] == pytest.approx(0.05)
        assert p.on_a[2] == pytest.approx(5) and p.on_b[2] == pytest.approx(0, abs=1e-9)
    assert sorted(p.id for _, p in found) == [0, 1, 2, 3]
    # In overlap there are the same, with their depth.
    found = scene.put((0, 0, -0.3))
    assert sorted(p.id for _, p in found) == [0, 1, 2, 3]
    for pair, p in found:
        assert pair.status == contactd.Status.OVERLAP and np.allclose(p.normal, UP)
        assert p.separation == pytest.approx(-0.3, abs=1e-7)
        assert p.on_a[2] == pytest.approx(5, abs=1e-7) and p.on_b[2] == pytest.approx(0, abs=1e-7)


def test_a_resting_cylinder_keeps_its_points(session):
    scene = Scene(session, FLOOR, "cylinder(h = 8, r1 = 6, r2 = 6);")
    random = np.random.default_rng(5)
    first = {p.id: p for _, p in scene.put((0, 0, 1e-3))}
    assert sorted(first) == [0, 1, 2, 3]
    for step in range(60):
        size = 10.0 ** random.uniform(-9, -4)
        shift = size * random.normal(size=3)
        lean = np.append(size * 0.1 * random.normal(size=3), 1.0)
        found = scene.put(np.array([0, 0, 1e-3]) + shift, lean / np.linalg.norm(lean))
        assert {p.id for _, p in found} == set(first), step
        for _, p in found:
            # None moves more than the body does.
            assert np.linalg.norm(p.position - first[p.id].position) < 20 * size + 1e-9


def test_corners_keep_their_ids_while_a_box_slides_and_turns(session):
    scene = Scene(session, FLOOR, "cube(size = [8, 6, 4]);")
    corners = {}
    for k in range(50):
        for _, p in scene.put((0.2 * k - 5, 0.1 * k, 0.01), about_z(0.02 * k)):
            corners.setdefault(p.id, []).append(p.on_b)
    assert sorted(corners) == [0, 1, 2, 3]
    for places in corners.values():
        assert len(places) == 50 and np.ptp(places, axis=0).max() < 1e-2, "each is one corner of the box"
    # Away and back: named anew, from 0.
    assert scene.put((0, 0, 50)) == [] and sorted(p.id for _, p in scene.put((0, 0, 0.01))) == [0, 1, 2, 3]


def test_the_pose_is_that_of_the_moment(session):
    scene = Scene(session, FLOOR, "sphere(r = 2);")
    session.begin_step(2)[:] = [contactd.start(scene.body, (0, 0, 12)), contactd.end(scene.body, (8, 0, -8))]
    reply = session.finish()
    asked = []

    def pose(object, time):
        asked.append((object, time))
        return (0, 0, -5) if object == scene.floor else np.array([8 * time, 0, 12 - 20 * time])

    scene.manifolds.update(reply, pose)
    assert [o for o, _ in asked] == [scene.floor, scene.body] and all(t == pytest.approx(0.5) for _, t in asked)
    [pair] = scene.manifolds
    [p] = pair.points
    assert np.allclose(p.position, [4, 0, 0], atol=1e-8) and np.allclose(p.on_b, [0, 0, -2], atol=1e-8)
    assert np.allclose(p.on_a, [4, 0, 5], atol=1e-8) and pair.status == contactd.Status.CONTACT


def test_record_by_record_is_the_same(session):
    scene = Scene(session, DRILLED, PEG)
    scene.put((0, 0, 0.1))
    expected = scene.manifolds.pairs
    session.begin_step(0)
    reply = session.finish()
    mine = Manifolds()
    mine.start()
    mine.add(reply, 0, (0, 0, -5), (0, 0, 0.1))
    with pytest.raises(IndexError, match="record 1: there are 1"):
        mine.add(reply, 1, (0, 0, -5), (0, 0, 0.1))
    mine.finish()
    # Once more in the same update: in place of what was there.
    mine.add(reply, 0, (0, 0, -5), (0, 0, 0.1))
    mine.finish()
    [found], [pair] = mine.pairs, expected
    assert found[:4] == pair[:4] and len(found.points) == len(pair.points) == 4
    for p, q in zip(found.points, pair.points):
        assert all(np.array_equal(x, y) for x, y in zip(p, q))


def test_misuse_of_manifolds(session):
    scene = Scene(session, FLOOR, "sphere(r = 2);")
    assert len(scene.put((0, 0, 2.1))) == 1
    session.begin_step(0)
    reply = session.finish()
    kept = scene.manifolds.pairs

    def steps(object, time):
        session.begin_step(0)
        return (0, 0, 0)

    for pose, error in [
        (lambda object, time: (0, 0), ValueError),
        (lambda object, time: ((0, 0, 0), (0, 0, 0, 0)), contactd.Refused),
        (lambda object, time: {}[object], KeyError),
        (lambda object, time: scene.manifolds.update(reply, lambda *_: (0, 0, 0)), RuntimeError),
        (steps, contactd.Stale),
    ]:
        with pytest.raises(error):
            scene.manifolds.update(reply, pose)
        [pair], [before] = scene.manifolds.pairs, kept
        assert np.array_equal(pair.points[0].position, before.points[0].position), "nothing has changed"
    with pytest.raises(contactd.Stale):
        scene.manifolds.update(reply, lambda *_: (0, 0, 0))
    with pytest.raises(TypeError):
        scene.manifolds.update(None, lambda *_: (0, 0, 0))
