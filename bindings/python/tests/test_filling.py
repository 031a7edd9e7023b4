"""Poses are filled in as numpy would, whichever way they take; what is handed out again was nobody's any more."""

import random

import numpy as np
import pytest

import contactd
from contactd import Order


def numbers(n, seed=0):
    rng = np.random.default_rng(seed)
    batch = np.zeros(n, contactd.POSE)
    batch["object"] = rng.integers(0, 1 << 32, n, dtype=np.uint32)
    batch["flags"] = Order.END
    batch["position"] = rng.normal(size=(n, 3))
    batch["rotation"] = rng.normal(size=(n, 4))
    return batch


def spread(array):
    """The same values with gaps between."""
    wide = np.zeros((*array.shape, 2), array.dtype)
    wide[..., 0] = array
    return wide[..., 0]


def read_only(array):
    array = array.copy()
    array.setflags(write=False)
    return array


SHAPES = [
    lambda a: a.copy(),
    read_only,
    spread,
    lambda a: np.asfortranarray(a),
    lambda a: a.astype(a.dtype.newbyteorder(">")),
    lambda a: a.tolist(),
    lambda a: a[::-1].copy()[::-1],
]


@pytest.mark.parametrize("n", [0, 1, 2, 3, 4, 37])
def test_fields_and_batches_are_filled_as_numpy_does(session, n):
    batch = numbers(n)
    for shape in SHAPES:
        poses = session.begin_step(n)
        for field in contactd.POSE.names:
            poses[field] = shape(batch[field]) if n else batch[field]
        assert np.array_equal(np.array(poses), batch), shape
    for whole in (batch, read_only(batch), spread(batch), batch[::-1].copy()[::-1], batch.astype(batch.dtype, copy=True)):
        for every in (slice(None), slice(0, n), slice(0, None, 1), ...):
            poses = session.begin_step(n)
            poses[every] = whole
            assert np.array_equal(np.array(poses), batch)
    poses = session.begin_step(n)
    poses["position"] = (1, 2, 3)
    poses["rotation"] = [[0, 0, 0, 1]]
    for flags in (2, Order.TURN, np.uint32(2), np.array(2), np.full(n, 2, np.uint8)):
        poses["flags"] = 0
        poses["flags"] = flags
        assert np.all(poses["flags"] == 2)
    assert np.all(poses["position"] == [1, 2, 3]) and np.all(poses["rotation"] == [0, 0, 0, 1])
    session.begin_step(0)


def test_a_part_of_the_slots_is_filled_alone(session):
    batch = numbers(8)
    poses = session.begin_step(8)
    poses[2:5] = batch[:3]
    poses[6:] = batch[6:]
    poses[7::-7] = batch[:2]
    expected = np.zeros(8, contactd.POSE)
    expected[2:5], expected[6:], expected[7::-7] = batch[:3], batch[6:], batch[:2]
    assert np.array_equal(np.array(poses), expected)
    session.begin_step(0)


def test_slots_are_filled_from_their_own_memory(session):
    batch = numbers(4)
    poses = session.begin_step(4)
    poses[:] = batch
    plain = np.asarray(poses)
    # Twelve numbers in a row that are positions, rotations and words of the records themselves.
    inside = np.ndarray((4, 3), float, plain, offset=8)
    expected = batch.copy()
    expected["position"] = inside.copy()
    poses["position"] = inside
    assert np.array_equal(np.array(poses), expected)
    poses[:] = plain[::-1]
    assert np.array_equal(np.array(poses), expected[::-1])
    poses[:] = plain
    assert np.array_equal(np.array(poses), expected[::-1]), "their own memory over itself"
    del plain, inside
    session.begin_step(0)


class Odd(np.ndarray):
    """Its conversions are its own."""

    def __array_finalize__(self, source):
        pass


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [
        ("flags", -1, OverflowError),
        ("flags", 1 << 32, OverflowError),
        ("flags", 1.0, TypeError),
        ("object", np.zeros((3, 1), np.uint32), ValueError),
        ("object", np.zeros(2, np.uint32), ValueError),
        ("position", np.zeros((3, 4)), ValueError),
        ("position", np.zeros((9,)), ValueError),
        ("position", np.zeros((3, 3, 1)), ValueError),
        ("rotation", np.zeros((4, 3)), ValueError),
        ("rotation", np.zeros((3, 4), complex), TypeError),
        ("velocity", np.zeros((3, 3)), (KeyError, ValueError)),
    ],
)
def test_what_does_not_fit_is_refused_and_changes_nothing(session, field, value, error):
    batch = numbers(3)
    poses = session.begin_step(3)
    poses[:] = batch
    with pytest.raises(error):
        poses[field] = value
    for wrong in (batch[:2], batch.reshape(3, 1), np.concatenate([batch, batch])):
        with pytest.raises(ValueError):
            poses[:] = wrong
    assert np.array_equal(np.array(poses), batch)
    poses["position"] = np.zeros((3, 3)).view(Odd)
    assert not np.any(poses["position"])
    session.begin_step(0)


def test_slots_of_a_lease_are_counted(ball_and_wall):
    session, ball, _ = ball_and_wall
    poses = session.begin_step(2)
    for count in (3, 1 << 60):
        with pytest.raises(ValueError, match="at most 2 slots"):
            type(poses)(poses._lease, count)
    del poses
    session.begin_step(0)


def test_what_is_handed_out_again_was_nobodys(ball_and_wall):
    session, ball, _ = ball_and_wall
    choose = random.Random(7)
    session.options.clear = True
    held, poses_seen, replies_seen = [], set(), set()
    steps = 400
    for step in range(steps):
        poses = session.begin_step(1)
        poses_seen.add(id(poses))
        for _, uses in held:
            for use in uses:
                with pytest.raises(contactd.Stale):
                    use()
        mine = [
            lambda poses=poses: poses["object"],
            lambda part=poses["position"]: part[0],
            lambda record=poses[0]: record["flags"],
            lambda part=poses[:1]: len(part),
            poses.copy,
            lambda each=poses.__iter__: next(each()),
            lambda array=poses["rotation"].T: array.sum(),
        ]
        poses[0] = contactd.start(ball, (0, 0, step))
        kept = [mine[i] for i in range(len(mine)) if choose.random() < 0.3]
        del mine, poses
        reply = session.finish()
        replies_seen.add(id(reply))
        assert reply.step == step + 1 and len(reply) == len(reply.records) == 1
        for use in kept:
            with pytest.raises(contactd.Stale):
                use()
        theirs = [
            lambda reply=reply: reply.records,
            lambda records=reply.records: records["time"],
            lambda record=reply[0]: record.time,
            lambda slots=reply.slots: slots["a"],
            lambda point=reply.records["point"]: point + 1,
            lambda reply=reply: reply[0],
        ]
        kept += [use for use in theirs if choose.random() < 0.3]
        assert theirs[1]()[0] == 1.0 and np.all(theirs[3]() == 1)
        del theirs, reply
        if choose.random() < 0.5:
            held.append((step, kept))
        held = [entry for entry in held if step - entry[0] < choose.randrange(6)]
        del kept
    assert len(poses_seen) < steps / 2 and len(replies_seen) < steps / 2, "most were handed out again"


def test_a_loop_that_keeps_nothing_makes_nothing(ball_and_wall):
    session, ball, _ = ball_and_wall
    seen = set()
    batch = np.array([contactd.start(ball, (0, 0, 0))], contactd.POSE)
    for _ in range(40):
        poses = session.begin_step(1)
        poses[:] = batch
        reply = session.finish()
        seen |= {id(poses), id(reply), id(reply.records)}
    # Those of one step, and of the one before, which the loop's own variables still hold when the next begins.
    assert len(seen) <= 6
