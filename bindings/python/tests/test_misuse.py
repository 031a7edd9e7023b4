"""Every misuse gets an exception that names it, and loses nothing."""

import gc
import threading

import numpy as np
import pytest
from conftest import fill

import contactd
from contactd import Order


def refusal(session, *records):
    with pytest.raises(contactd.Refused) as refused:
        session.begin_step(len(records))[:] = list(records)
        session.finish(timeout=10)
    return refused.value


# Views after their step


def test_poses_after_they_were_sent_raise(ball_and_wall):
    session, ball, _ = ball_and_wall
    poses = session.begin_step(1)
    position, record = poses["position"], poses[0]
    poses[0] = contactd.end(ball, (1, 0, 0))
    session.send()
    for use in [
        lambda: poses["object"],
        lambda: poses.__setitem__("object", 1),
        lambda: position[0],
        lambda: position + 1,
        lambda: np.add(1, 1, out=position),
        lambda: position.sum(),
        lambda: position.tolist(),
        lambda: record["flags"],
        lambda: record.position,
        lambda: record.__setitem__("flags", 1),
        lambda: np.asarray(poses),
        lambda: np.array(poses),
        lambda: np.concatenate([position, position]),
        lambda: list(poses),
        lambda: poses.copy(),
        lambda: len(poses),
        lambda: str(poses),
        lambda: poses == poses,
        lambda: memoryview(np.asarray(poses)),
        lambda: float(position[0, 0]),
    ]:
        with pytest.raises(contactd.Stale, match="poses of this view were sent"):
            use()
    assert repr(poses) == "<view of a step that is over>" and not poses.alive
    session.finish()


def test_a_reply_after_the_next_step_began_raises(ball_and_wall):
    session, ball, _ = ball_and_wall
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    reply = session.finish()
    records, record, point = reply.records, reply[0], reply.records["point"]
    kept, times = records.copy(), records["time"].copy()
    kept_point = np.array(point)
    assert times[0] == 0.5
    session.add_object("other", 1, at=(0, 0, 900))
    assert record.time == 0.5, "commands leave the reply alone"
    poses = session.begin_step(1)
    uses = [
        lambda: records["time"],
        lambda: record.time,
        lambda: record["time"],
        lambda: point[0],
        lambda: np.linalg.norm(point, axis=1),
        lambda: point @ np.eye(3),
        lambda: point * 2.0,
        lambda: reply.records,
        lambda: reply.slots,
        lambda: reply[0],
        lambda: list(reply),
        lambda: reply.detail(0),
        lambda: reply.regions(0),
        lambda: reply.patches(0),
        lambda: reply.details,
        lambda: reply.all_regions,
        lambda: reply.all_patches,
    ]
    for use in uses:
        with pytest.raises(contactd.Stale, match="reply of this view is gone"):
            use()
    # What was copied and the header stay.
    assert kept["time"][0] == 0.5 and kept_point[0, 0] == pytest.approx(9) and reply.safe_time <= 0.5 and len(reply) == 1
    poses[0] = contactd.end(ball, (0, 0, 0))
    session.finish()


def test_a_plain_array_taken_of_a_view_holds_the_session_up(ball_and_wall):
    session, ball, _ = ball_and_wall
    poses = session.begin_step(1)
    plain = np.asarray(poses)
    plain[0] = contactd.end(ball, (16, 0, 0))
    for call in (session.send, session.finish, lambda: session.begin_step(1), session.close):
        with pytest.raises(BufferError, match="1 array.* taken of the step's poses"):
            call()
    row = plain[0:1]["position"]
    del plain
    with pytest.raises(contactd.StillExported):
        session.finish()
    assert row[0, 0] == 16
    del row
    reply = session.finish()
    assert reply[0].time == 0.5, "nothing was lost"

    times = np.asarray(reply.records["time"])
    assert not times.flags.writeable and times[0] == 0.5
    with pytest.raises(BufferError, match="taken of the step's reply"):
        session.begin_step(1)
    with pytest.raises(contactd.Misuse):  # embedded there is no server to find again
        session.reconnect(timeout=0)
    assert reply[0].time == 0.5 and times[0] == 0.5
    del times
    session.begin_step(1)[0] = contactd.end(ball, (0, 0, 0))
    session.finish()


def test_exports_are_of_the_views_own_elements(ball_and_wall):
    session, ball, _ = ball_and_wall
    poses = session.begin_step(4)
    poses["object"] = [1, 2, 3, 4]
    poses["position"] = np.arange(12).reshape(4, 3)
    for view in (poses["position"], poses["position"][::-1, 1], poses["position"].T, poses[2]["position"], poses[1:3]):
        inner, plain = view.copy(), np.asarray(view)
        assert np.array_equal(inner, plain) and np.shares_memory(plain, np.asarray(poses))
        plain.flat[0] = plain.flat[0]
        del plain
    assert np.asarray(poses["object"], dtype=float).dtype == float
    with pytest.raises(ValueError, match="without a copy"):
        poses["object"].__array__(float, copy=False)
    assert poses["position"][poses["object"] > 2].tolist() == [[6, 7, 8], [9, 10, 11]]
    assert isinstance(poses["position"][[0, 1]], np.ndarray) and isinstance(np.squeeze(poses["position"]), contactd.View)
    assert isinstance(poses["object"].reshape(2, 2), contactd.View) and poses["position"].sum() == 66
    for closed in ("data", "ctypes", "flat", "base", "setflags", "__array_interface__", "nothing"):
        with pytest.raises(AttributeError):
            getattr(poses["position"], closed)
    session.begin_step(0)


def test_a_view_outlives_its_session_without_harm():
    session = contactd.embedded()
    ball, _ = fill(session)
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    records = session.finish().records
    plain = np.asarray(records)
    del session
    gc.collect()
    assert plain["time"][0] == 0.5 and records["time"][0] == 0.5, "they keep it open"
    del plain


def test_records_cannot_be_written(ball_and_wall):
    session, ball, _ = ball_and_wall
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    reply = session.finish()
    with pytest.raises(ValueError, match="read-only"):
        reply.records["time"] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        reply.records["point"] += 1.0
    assert reply[0].time == 0.5


# Values that are none


@pytest.mark.parametrize(
    ("key", "value", "error", "what"),
    [
        ("position", np.zeros((3, 3)), ValueError, "broadcast"),
        ("position", np.zeros((2, 2)), ValueError, "broadcast"),
        ("position", [["a", "b", "c"]] * 2, TypeError, "expected float64 for 'position'"),
        ("position", np.zeros((2, 3), complex), TypeError, "found complex"),
        ("position", None, TypeError, "found object"),
        ("object", [1.5, 2.5], TypeError, "expected uint32 for 'object', found float64"),
        ("object", [-1, 2], OverflowError, "0 to 4294967295"),
        ("object", [1 << 40, 2], OverflowError, "0 to 4294967295"),
        ("object", [1, 2, 3], ValueError, "broadcast"),
        ("speed", 1.0, (KeyError, ValueError), "speed"),
        (slice(None), np.zeros(2), TypeError, "expected records with the fields object, flags, position, rotation"),
        (slice(None), np.zeros(2, [("object", "u4"), ("position", "3f8")]), TypeError, "expected records with the fields"),
        (slice(None), [1.0, 2.0], TypeError, "expected a record"),
        (0, 7, TypeError, "expected records with the fields"),
        (0, (1, 2, 3), ValueError, "tuple of length 3"),
        (0, (1, 2, (0, 0), (0, 0, 0, 1)), ValueError, "broadcast"),
        (5, (1, 1, (0, 0, 0), (0, 0, 0, 1)), IndexError, "out of bounds"),
    ],
)
def test_a_wrong_dtype_or_shape_is_named_and_changes_nothing(ball_and_wall, key, value, error, what):
    session, ball, _ = ball_and_wall
    poses = session.begin_step(2)
    poses["object"] = [7, 8]
    before = poses.copy()
    with pytest.raises(error, match=what):
        poses[key] = value
    assert np.array_equal(before, poses)
    poses[:] = [contactd.start(ball, (0, 0, 0)), contactd.end(ball, (16, 0, 0))]
    assert len(session.finish()) == 1


def test_numbers_that_are_no_poses_are_refused_with_their_index(ball_and_wall):
    session, ball, wall = ball_and_wall
    good = contactd.end(ball, (1, 0, 0))
    Code = contactd.ErrorCode
    table = [
        ([contactd.end(ball, (np.nan, 0, 0))], Code.NOT_FINITE, 0),
        ([contactd.start(ball, (0, 0, 0)), contactd.end(ball, (0, 0, 0), (0, 0, 0, 2))], Code.BAD_QUATERNION, 1),
        ([good, contactd.end(99, (0, 0, 0))], Code.UNKNOWN_OBJECT, 1),
        ([good, good], Code.DUPLICATE_OBJECT, 1),
        ([contactd.end(wall, (0, 0, 0))], Code.STATIC_OBJECT, 0),
        ([(ball, 0, (0, 0, 0), (0, 0, 0, 1))], Code.BAD_COUNT, 0),
        ([(ball, Order.END | Order.START, (0, 0, 0), (0, 0, 0, 1))], Code.BAD_COUNT, 0),
    ]
    for records, code, index in table:
        error = refusal(session, *records)
        assert (error.code, error.index) == (code, index) and f"index {index}" in str(error), error
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    assert session.finish()[0].time == 0.5, "no refused batch has moved anything"


def test_bad_arguments_are_named(session):
    with pytest.raises(contactd.Refused, match=r"m\.csg:1:") as refused:
        session.load_model("m.csg", "sphere(r = );")
    assert refused.value.code == contactd.ErrorCode.MODEL
    with pytest.raises(ValueError, match="auto, exact, as-written"):
        session.load_model("m.csg", "sphere(r = 1);", facets="fine")
    ball = session.load_model("m.csg", "sphere(r = 1);")
    with pytest.raises(ValueError, match="expected a position of 3 numbers"):
        session.add_object("o", ball, at=(0, 0, 0, 0))
    with pytest.raises(ValueError, match="quaternion x y z w"):
        session.add_object("o", ball, at=((0, 0, 0), (1, 0, 0)))
    with pytest.raises(contactd.Refused) as refused:
        session.add_object("o", ball, at=((0, 0, 0), (2, 0, 0, 0)))
    assert refused.value.code == contactd.ErrorCode.BAD_QUATERNION
    with pytest.raises(contactd.Refused) as refused:
        session.add_object("o", 17)
    assert refused.value.code == contactd.ErrorCode.UNKNOWN_MODEL
    with pytest.raises(TypeError):
        session.add_object("o", "m.csg")
    with pytest.raises(contactd.Refused, match="rule 1: report = \"everything\" is none of hit, time") as refused:
        session.set_rules([contactd.Rule(("a", "b")), contactd.Rule(("a", "b"), report="everything")])
    assert (refused.value.code, refused.value.index) == (contactd.ErrorCode.BAD_RULE, 1)
    with pytest.raises(contactd.Refused) as refused:
        session.set_rules([contactd.Rule(("a", "b"), margin=-1.0)])
    assert (refused.value.code, refused.value.index) == (contactd.ErrorCode.BAD_RULE, 0)
    with pytest.raises((AttributeError, TypeError)):
        session.set_rules([("a", "b")])
    with pytest.raises(contactd.Refused) as refused:
        session.begin_step(session.max_batch + 1)
    assert refused.value.code == contactd.ErrorCode.TOO_MANY
    with pytest.raises(OverflowError):
        session.begin_step(-1)


# Calls in a wrong order, from a wrong place


def test_calls_out_of_order_are_misuse(ball_and_wall):
    session, ball, _ = ball_and_wall
    with pytest.raises(contactd.Misuse, match="no step was begun"):
        session.finish()
    with pytest.raises(contactd.Misuse, match="no step was begun"):
        session.send()
    with pytest.raises(contactd.Misuse, match="no step was in flight"):
        session.resend()
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    session.send()
    with pytest.raises(contactd.Misuse, match="no step was begun"):
        session.send()
    for call in (lambda: session.begin_step(1), lambda: session.set_resolution(None), lambda: session.remove_object(ball)):
        with pytest.raises(contactd.Misuse, match="in flight"):
            call()
    for timeout in (-1.0, float("nan")):
        with pytest.raises(ValueError, match="timeout"):
            session.finish(timeout=timeout)
    assert session.finish(timeout=float("inf"))[0].time == 0.5


def test_an_embedded_session_has_nothing_to_find_again():
    with contactd.embedded() as session:
        ball, _ = fill(session)
        session.set_rules([contactd.Rule(("default", "default"), sensor=True)])
        session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
        reply = session.finish()
        with pytest.raises(contactd.Misuse, match="no server that could be lost"):
            session.reconnect(timeout=0)
        assert reply[0].time == 0.5 and reply[0].flags & contactd.Flag.SENSOR, "the reply is still there"
        session.begin_step(1)[0] = contactd.end(ball, (0, 0, 0))
        assert session.finish()[0].flags & contactd.Flag.SENSOR, "rules stay"


def test_a_closed_session_says_so(ball_and_wall):
    session, ball, _ = ball_and_wall
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    record = session.finish()[0]
    with session:
        pass
    session.close()
    for call in (
        lambda: session.begin_step(1),
        session.finish,
        session.send,
        session.reconnect,
        session.resend,
        lambda: session.load_model("m", "sphere(r = 1);"),
        lambda: session.add_object("o", 1),
        lambda: session.remove_object(ball),
        lambda: session.set_rules([]),
        lambda: session.set_resolution(None),
        lambda: session.mass_properties(1),
        lambda: session.id,
    ):
        with pytest.raises(contactd.Misuse, match="session is closed"):
            call()
    with pytest.raises(contactd.Stale):
        record.time


def test_an_exception_leaves_the_with_block_as_it_is():
    with pytest.raises(ZeroDivisionError):
        with contactd.embedded() as session:
            ball, _ = fill(session)
            session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
            kept = np.asarray(session.finish().records)
            1 / 0
    assert kept["time"][0] == 0.5
    with pytest.raises(BufferError):
        session.close()
    del kept
    session.close()


def test_another_thread_is_refused(ball_and_wall):
    session, ball, _ = ball_and_wall
    poses = session.begin_step(1)
    plain = np.asarray(poses)
    found = []

    def run():
        calls = (session.finish, lambda: poses["object"], session.close, lambda: session.closed, lambda: session.options)
        for call in calls:
            try:
                call()
            except contactd.Misuse as e:
                found.append(str(e))
        plain[0] = contactd.end(ball, (16, 0, 0))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert len(found) == 5 and all("belong to the thread that opened it" in f for f in found)
    del plain, run
    gc.collect()
    assert session.finish()[0].time == 0.5


def test_a_session_that_dies_on_another_thread_does_no_harm():
    holder = [contactd.embedded()]
    thread = threading.Thread(target=holder.clear)
    thread.start()
    thread.join()
    gc.collect()
    assert len(contactd.embedded().load_model("m", "sphere(r = 1);").faces) == 1


def test_every_error_is_an_error():
    for kind in (contactd.Refused, contactd.NoServer, contactd.ServerLost, contactd.ReplyLost, contactd.Timeout,
                 contactd.BadAddress, contactd.VersionMismatch, contactd.Misuse, contactd.Stale, contactd.StillExported,
                 contactd.SystemFailure):
        assert issubclass(kind, contactd.Error)
    assert issubclass(contactd.Timeout, TimeoutError) and issubclass(contactd.StillExported, BufferError)


def test_what_would_be_taken_in_silence_is_refused(tmp_path):
    with contactd.embedded() as session:
        for rule, field in [
            (contactd.Rule("ab"), "between"),
            (contactd.Rule(("a", "b"), except_=["ab"]), "except_"),
            (contactd.Rule(("a", "b"), except_="ab"), "except_"),
        ]:
            with pytest.raises(TypeError, match=f"rule 1: expected pairs of names as {field}"):
                session.set_rules([contactd.Rule(("a", "b")), rule])
        for name in ("advance", "rules", "resolution"):
            with pytest.raises(AttributeError):
                setattr(session, name, 0.5)
        with pytest.raises(AttributeError):
            session.options.advanced = 0.5
    with pytest.raises(ValueError, match="is for an engine in this process, not for the server"):
        contactd.Session("default", config=tmp_path / "contactd.toml")
