"""How points are chosen of a region."""

import numpy as np
import pytest

import contactd
from contactd.manifold import chosen, is_cut, manifold

UP = np.array([0.0, 0.0, 1.0])


def ring(radius, n=8, turn=0.0):
    angle = 2 * np.pi * np.arange(n) / n + turn
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)], axis=1)


def area(points):
    x, y = points[:, 0], points[:, 1]
    order = np.argsort(np.arctan2(y - y.mean(), x - x.mean()))
    x, y = x[order], y[order]
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def test_four_of_a_ring_span_it():
    points = np.concatenate([ring(1.0), ring(2.0)])
    picks = chosen(points, np.zeros(16), UP)
    assert len(picks) == 4 and np.all(picks >= 8), "of the outer ring"
    assert area(points[picks]) == pytest.approx(8.0), "the square of radius 2"


def test_few_points_are_kept_and_lines_get_their_ends():
    assert chosen(ring(1.0, 3), np.zeros(3), UP).tolist() == [0, 1, 2]
    line = np.stack([np.linspace(-1, 1, 9), np.zeros(9), np.zeros(9)], axis=1)
    assert chosen(line, np.zeros(9), UP).tolist() == [0, 8]
    assert chosen(np.zeros((6, 3)), np.array([3.0, 2, 1, 2, 3, 4]), UP).tolist() == [2]


def test_the_choice_turns_with_the_body_and_rounding_changes_nothing():
    random = np.random.default_rng(3)
    points = np.concatenate([ring(10.5), ring(18.0)])
    first = chosen(points, np.full(16, 0.1), UP)
    for _ in range(50):
        noise = 1e-9 * random.normal(size=points.shape)
        assert np.array_equal(chosen(points + noise, 0.1 + 1e-9 * random.normal(size=16), UP), first)


def test_the_nearest_point_is_among_them():
    points, separations = ring(1.0, 12), np.full(12, 0.1)
    for lowest in range(12):
        separations[:] = 0.1
        separations[lowest] = 0.0
        picks = chosen(points, separations, UP)
        assert lowest in picks and len(picks) == 4 and len(set(picks)) == 4
        assert area(points[picks]) > 1.2


def test_a_shoulder_on_a_drilled_plate():
    with contactd.embedded() as session:
        plate = "difference() { cube(size = [60, 60, 10], center = true); cylinder(h = 30, r1 = 10.5, r2 = 10.5, center = true); }"
        plate = session.add_object("plate", session.load_model("plate.csg", plate), fixed=True, at=(0, 0, -5))
        peg = "union() { cylinder(h = 50, r1 = 10, r2 = 10, center = true); cylinder(h = 8, r1 = 18, r2 = 18); }"
        peg = session.add_object("peg", session.load_model("peg.csg", peg), at=(0, 0, 0.1))
        session.set_rules([contactd.Rule(("default", "default"), report="patch", margin=0.2, penetration=True)])
        session.options.details = True
        session.begin_step(0)
        [record] = reply = session.finish()
        points = manifold(reply, record)
        assert not is_cut(record) and len(points) == 4
        assert all(np.allclose(p.normal, UP) and p.separation == pytest.approx(0.1) for p in points)
        assert all(np.hypot(*p.point[:2]) == pytest.approx(18) and p.point[2] == pytest.approx(0.05) for p in points)
        # In overlap there is one point, with its depth.
        session.begin_step(1)[0] = contactd.start(peg, (0, 0, -0.3))
        [record] = reply = session.finish()
        [point] = manifold(reply, record)
        assert record.status == contactd.Status.OVERLAP and np.allclose(point.normal, UP, atol=1e-6)
        assert -0.3 - 1e-9 <= point.separation < -0.29
