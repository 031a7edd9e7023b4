"""Solids told in code: what is printed, what is refused, what is loaded."""

import doctest
import math

import numpy as np
import pytest

import contactd
from contactd.solid import (
    Outline,
    Solid,
    box,
    capsule,
    circle,
    cone,
    cylinder,
    half_space,
    hull,
    hyperbolic_dome,
    hyperboloid,
    intersection,
    minkowski,
    paraboloid,
    polygon,
    polyhedron,
    quadric,
    rectangle,
    sphere,
    superellipsoid,
    torus,
    union,
)


def test_the_modules_own_example_is_true():
    assert doctest.testmod(contactd.solid) == (0, 2)


def volume(solid: Solid) -> float:
    with contactd.embedded() as session:
        model = session.load_model("part", solid)
        return session.mass_properties(model, tolerance=1e-5).volume


CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


@pytest.mark.parametrize(
    "solid, expected",
    [
        (box(4, 5, 6) - cylinder(r=1, h=9), 4 * 5 * 6 - 6 * math.pi),
        (sphere(2).scaled(1, 1, 1).mirrored((1, 2, 3)), 32 / 3 * math.pi),
        (cone(2, 1, 3), math.pi * 3 * 7 / 3),
        (torus(3, 1), 6 * math.pi**2),
        (capsule(1, 2), math.pi * 2 + 4 / 3 * math.pi),
        (paraboloid(1.5, 2), 0.5 * math.pi * 2.25 * 2),
        (hyperboloid(1.5, 0.5, 2), math.pi * 2 / 3 * (2 * 0.25 + 2.25)),
        (hyperbolic_dome(1, 1, 1), math.pi / 3 * (7 / 3 - 1)),
        (quadric([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 0.5], [0, 0, 0.5, 0]], (-1, -1, -2), (1, 1, 2)), 8),
        (superellipsoid((1, 2, 3), (1, 1)), 8 * math.pi),
        (superellipsoid((1, 2, 3), (0.5, 1)), math.pi * 2 * 3 * 2 * math.gamma(1.25) * math.gamma(1.5) / math.gamma(1.75)),
        (box(2, 2, 2) & half_space((0, 0, 3), 0.5), 4 * 1.5),
        (polyhedron(CORNERS, FACES), 1 / 6),
        ((rectangle(4, 4) - circle(1)).extrude(2), 2 * (16 - math.pi)),
        (polygon([(0, 0), (4, 0), (0, 4)], [(1, 1), (2, 1), (1, 2)]).extrude(1), 7.5),
        (circle(0.5).moved(2, 0).revolve(math.pi), 2 * math.pi * math.pi * 0.25),
        (rectangle(2, 2).extrude(3, scale=(0.5, 0.5)), 3 / 3 * (4 + 1 + 2)),
        (rectangle(1, 1).offset(1).extrude(1), 1 + 4 + math.pi),
        (minkowski(box(1, 1, 1), box(2, 2, 2)), 27),
        (hull(box(1, 1, 1), box(1, 1, 1).moved(0, 0, 3)), 4),
        (union(box(1, 1, 1), box(1, 1, 1).moved(5, 0, 0)), 2),
        (intersection(box(1, 1, 1), box(1, 1, 1).moved(0.5, 0, 0)), 0.5),
        (box(1, 2, 3).transformed([[0, 2, 0, 1], [1, 0, 0, 1], [0, 0, 1, 1]]), 12),
    ],
)
def test_what_is_built_is_what_is_loaded(solid, expected):
    assert volume(solid) == pytest.approx(expected, rel=2e-5)


def test_a_peg_goes_through_the_hole_that_was_built_for_it():
    plate = box(40, 40, 4) - cylinder(r=3, h=9)
    with contactd.embedded() as session:
        plate = session.add_object("plate", session.load_model("plate", plate), fixed=True)
        peg = session.load_model("peg", cylinder(r=2.9, h=10))
        peg = session.add_object("peg", peg, at=(0, 0, 20))
        session.begin_step(1)[0] = contactd.end(peg, (0, 0, -20))
        assert len(session.finish()) == 0
        session.begin_step(1)[0] = contactd.start(peg, (1, 0, 20))
        assert len(session.finish()) == 0
        session.begin_step(1)[0] = contactd.end(peg, (1, 0, -20))
        [record] = session.finish()
        assert record.time == pytest.approx(13 / 40, abs=1e-9)


def test_poses_and_angles_are_those_of_the_session():
    half = math.sqrt(0.5)
    turned = box(1, 2, 3).placed(((1, 0, 0), (0, 0, half, half)))
    rows = [line for line in turned.text.splitlines() if "multmatrix" in line]
    numbers = np.array(eval(rows[0].split("multmatrix(")[1].split(") {")[0]))
    assert np.allclose(numbers, [[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], atol=1e-15)
    assert turned == box(1, 2, 3).placed(((1, 0, 0), (0, 0, half, half))) != box(1, 2, 3)


@pytest.mark.parametrize(
    "build, sentence",
    [
        (lambda: sphere(-1), "sphere: expected a positive finite radius, found -1"),
        (lambda: hull(), "hull: expected one operand or more, found none"),
        (lambda: circle(1).offset(1, "soft"), "corners = 'soft' is none of round, sharp, cut"),
        (lambda: box(1, 1, 1).placed(((0, 0, 0), (0, 0, 0, 2))), "pose: expected a finite position and a unit quaternion"),
        (lambda: polygon([(0, 0), (1, 1)]), "polygon: expected paths of three corners or more, found 2 in path 0"),
    ],
)
def test_what_makes_no_sense_is_refused_at_once(build, sentence):
    with pytest.raises(ValueError) as refused:
        build()
    assert str(refused.value).replace('"', "'").startswith(sentence)


def test_kinds_do_not_mix():
    with pytest.raises(TypeError):
        box(1, 1, 1) - circle(1)
    with pytest.raises(TypeError):
        union(circle(1), box(1, 1, 1))
    assert isinstance(circle(1) + rectangle(1, 1), Outline)
