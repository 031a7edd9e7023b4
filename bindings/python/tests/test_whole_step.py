"""A step in one call is the three calls that it stands for."""

import numpy as np
import pytest

import contactd
from contactd import Order


def balls(session, n):
    ball = session.load_model("ball.csg", "sphere(r = 1);")
    return [session.add_object(f"ball {i}", ball, at=(3.0 * i, 0, 0)) for i in range(n)]


def together(ids):
    """The balls come together: each is moved to 1.2 apart from the one before."""
    batch = np.zeros(len(ids), contactd.POSE)
    batch["object"], batch["flags"] = ids, Order.END
    batch["position"][:, 0] = 1.2 * np.arange(len(ids))
    batch["rotation"][:, 3] = 1.0
    return batch


def in_three(session, poses):
    session.begin_step(len(poses))[:] = poses
    return session.finish(5)


WAYS = [
    lambda batch: batch,
    lambda batch: np.repeat(batch, 2)[::2],
    lambda batch: batch.astype(contactd.POSE.newbyteorder(">")),
    lambda batch: batch.view(type("Own", (np.ndarray,), {})),
    list,
]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("n", [0, 1, 5])
def test_it_answers_as_three_calls_do(way, n):
    with contactd.embedded() as one, contactd.embedded() as other:
        poses = [together(balls(session, n)) for session in (one, other)]
        at_once = one.step(way(poses[0]), timeout=5)
        expected = in_three(other, poses[1])
        assert at_once.slots.tobytes() == expected.slots.tobytes()
        assert len(at_once) == max(n - 1, 0) and at_once.safe_time == expected.safe_time


def test_options_count_and_advance_is_put_back():
    with contactd.embedded() as session:
        ids = balls(session, 3)
        session.options.max_records = 1
        assert len(session.step(together(ids), 5)) == 1
        session.options.max_records = 0
        session.options.advance = 0.5
        rest = np.zeros(0, contactd.POSE)
        session.step(rest)
        assert session.options.advance == 1.0
        # Half of the way was taken: they stand 2.1 apart and do not touch.
        assert len(session.step(rest)) == 0


def test_it_ends_the_step_before_and_is_refused_as_one():
    with contactd.embedded() as session:
        ids = balls(session, 2)
        poses = together(ids)
        first = session.step(poses)
        session.step(poses)
        with pytest.raises(contactd.Stale):
            first.records["time"]
        kept = np.asarray(session.step(poses).records)
        with pytest.raises(contactd.StillExported):
            session.step(poses)
        del kept
        poses["object"][1] = 99
        with pytest.raises(contactd.Refused) as refusal:
            session.step(poses)
        assert refusal.value.index == 1
        poses["object"][1] = ids[1]
        assert len(session.step(poses)) == 1


@pytest.mark.parametrize(
    "poses, error",
    [
        (np.zeros((2, 2), contactd.POSE), ValueError),
        (np.zeros(2), (ValueError, TypeError)),
        (np.zeros(2, contactd.CONTACT), (ValueError, TypeError)),
        (7, TypeError),
        (None, TypeError),
    ],
)
def test_what_is_no_batch_is_refused_and_the_session_goes_on(poses, error):
    with contactd.embedded() as session:
        ids = balls(session, 2)
        with pytest.raises(error):
            session.step(poses)
        with pytest.raises(ValueError, match="timeout"):
            session.step(together(ids), timeout=-1)
        assert len(session.step(together(ids))) == 1
    with pytest.raises(contactd.Misuse):
        session.step(together(ids))


def test_a_batch_of_the_session_s_own_slots_is_none():
    with contactd.embedded() as session:
        ids = balls(session, 2)
        poses = session.begin_step(2)
        poses[:] = together(ids)
        own = np.asarray(poses)
        with pytest.raises(contactd.StillExported):
            session.step(own)
        del own
        assert len(session.finish(5)) == 1
