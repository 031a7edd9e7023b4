"""Distances, points and rays of a session's objects, by closed forms of balls and a wall."""

import math

import numpy as np
import pytest

import contactd


def ball_and_wall_by_hand(ball_at, points):
    """Signed distances from a ball of radius 1 and from the box 9 <= x <= 11, |y|, |z| <= 10."""
    of_ball = np.linalg.norm(points - ball_at, axis=1) - 1
    q = np.abs(points - [10, 0, 0]) - [1, 10, 10]
    of_wall = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
    return of_ball, of_wall


def test_points_are_bounded_by_their_signed_distance(ball_and_wall):
    session, ball, wall = ball_and_wall
    rng = np.random.default_rng(3)
    for at in ((0, 0, 0), (5, 2, -3)):
        session.begin_step(1)[0] = contactd.end(ball, at)
        session.finish()
        points = rng.uniform((-3, -6, -6), (13, 6, 6), (300, 3))
        of_ball, of_wall = ball_and_wall_by_hand(np.array(at), points)
        least = np.minimum(of_ball, of_wall)
        told = session.points(points, tolerance=1e-7)
        assert told.dtype == contactd.POINT and told["settled"].all()
        assert (told["lower"] <= least + 1e-12).all() and (least <= told["upper"] + 1e-12).all()
        assert (told["upper"] - told["lower"] <= 1e-7 + 1e-12).all()
        sides = np.array(contactd.SIDE_NAMES)[told["side"]]
        assert (sides == np.where(least > 0, "outside", "inside")).all()
        assert (told["object"] == np.where(of_ball < of_wall, ball, wall)).all()
        near = ball_and_wall_by_hand(np.array(at), told["nearest"])
        assert np.allclose(np.where(told["object"] == ball, *near), 0, atol=1e-9)
        assert np.allclose(np.linalg.norm(told["nearest"] - points, axis=1), np.abs(least), atol=1e-6)
        of_wall_alone = session.points(points, objects=[wall])
        assert (of_wall_alone["object"] == wall).all() and np.allclose(of_wall_alone["upper"], of_wall, atol=1e-6)


def test_rays_hit_what_they_meet_first(ball_and_wall):
    session, ball, wall = ball_and_wall
    rng = np.random.default_rng(4)
    origins = rng.uniform((-6, -3, -3), (-2, 3, 3), (400, 3))
    directions = rng.normal((1, 0, 0), 0.4, (400, 3))
    told = session.rays(origins, directions, 40)
    assert told.dtype == contactd.RAY
    unit = directions / np.linalg.norm(directions, axis=1)[:, None]
    b = np.einsum("ij,ij->i", origins, unit)
    root = b * b - (np.einsum("ij,ij->i", origins, origins) - 1)
    with np.errstate(invalid="ignore"):
        t_ball = np.where((root > 0) & (-b - np.sqrt(root) > 0), -b - np.sqrt(root), np.inf)
    t_wall = np.where(unit[:, 0] > 0, (9 - origins[:, 0]) / unit[:, 0], np.inf)
    at = origins + np.where(np.isfinite(t_wall), t_wall, 0)[:, None] * unit
    t_wall = np.where((np.abs(at[:, 1:]) < 10).all(axis=1) & (t_wall < 40), t_wall, np.inf)
    clear = np.abs(root) > 1e-6
    t = np.minimum(t_ball, t_wall)
    met = origins + np.where(np.isfinite(t), t, 0)[:, None] * unit
    hit = told["outcome"] == contactd.OUTCOME_NAMES.index("hit")
    assert (hit == np.isfinite(t))[clear].all() and 100 < hit.sum() < 400
    good = hit & clear
    assert np.abs(told["t"][good] - t[good]).max() < 1e-10
    assert (told["lower"] <= told["t"])[good].all() and (told["t"] <= told["upper"])[good].all()
    assert (told["object"] == np.where(t_ball < t_wall, ball, wall))[good].all()
    assert np.allclose(told["point"][good], met[good], atol=1e-9)
    assert (np.einsum("ij,ij->i", told["normal"], unit)[good] < 0).all()
    missed = ~hit
    assert (told["object"][missed] == contactd.NO_OBJECT).all() and np.isinf(told["lower"][missed]).all()
    [inside] = session.rays([[0, 0, 0]], [[0, 0, 2]])
    assert inside["inside"] and abs(inside["t"] - 1) < 1e-12 and inside["object"] == ball


def test_distances_are_those_of_the_objects_where_they_stand(ball_and_wall):
    session, ball, wall = ball_and_wall
    told = session.distance(ball, wall)
    assert told.lower <= 8 <= told.upper + 1e-12 and told.settled and told.points.shape == (2, 3)
    session.begin_step(1)[0] = contactd.end(ball, (9.5, 0, 0))
    session.finish()
    assert session.distance(ball, wall).upper == 0


def test_what_cannot_be_asked_is_refused(ball_and_wall):
    session, ball, wall = ball_and_wall
    with pytest.raises(ValueError, match=r"expected points as an array of \(n, 3\), found one of \(3,\)"):
        session.points([1, 2, 3])
    with pytest.raises(ValueError, match=r"found \(1, 3\) and \(2, 3\)"):
        session.rays([[0, 0, 0]], [[1, 0, 0]] * 2)
    with pytest.raises(contactd.Refused) as refused:
        session.points([[0, 0, 0], [math.nan, 0, 0]])
    assert (refused.value.code, refused.value.index) == (contactd.ErrorCode.NOT_FINITE, 1)
    with pytest.raises(contactd.Refused) as refused:
        session.rays([[0, 0, 0]], [[0, 0, 0]])
    assert refused.value.code == contactd.ErrorCode.BAD_NUMBER
    with pytest.raises(contactd.Refused) as refused:
        session.distance(ball, 99)
    assert refused.value.code == contactd.ErrorCode.UNKNOWN_OBJECT
    assert len(session.points(np.empty((0, 3)))) == 0
