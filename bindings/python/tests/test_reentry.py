"""The caller's own code in the middle of a call, where an index or a conversion runs it, and numpy's callbacks: it may do to the session
what it likes, and no array ever sees memory of another step."""

import gc

import numpy as np
import pytest

import contactd
from contactd import Order


# Slots of the step that is begun meanwhile.
LARGER = 5000


class Meddler:
    """Ends the step as soon as it is asked for anything, and begins one that is larger, so that the memory moves."""

    def __init__(self, session, value=0):
        self.session, self.value = session, value

    def meddle(self):
        self.session.begin_step(LARGER)
        return self.value

    __index__ = __float__ = __int__ = meddle

    def __array__(self, dtype=None, copy=None):
        return np.array(self.meddle(), dtype)

    def __radd__(self, other):
        return self.meddle()

    def __eq__(self, other):
        return bool(self.meddle())

    def __hash__(self):
        return 0


class Sequence(Meddler):
    """The same, of a value that is no array yet."""

    def __len__(self):
        return len(self.value)

    def __getitem__(self, i):
        self.meddle()
        return self.value[i]


def batch(n):
    found = np.ones(n, contactd.POSE)
    found["flags"] = Order.END
    return found


USES = {
    "slice": lambda poses, m: poses.__setitem__(slice(m, None), batch(1)),
    "slice of a part": lambda poses, m: poses["position"].__setitem__(slice(m, None), np.ones((1, 3))),
    "index": lambda poses, m: poses.__setitem__(m, batch(1)[0]),
    "indices": lambda poses, m: poses["position"].__setitem__((m, m), 1.0),
    "list": lambda poses, m: poses["position"].__setitem__([m], 1.0),
    "array": lambda poses, m: poses.__setitem__("position", Meddler(m.session, np.ones((1, 3)))),
    "word": lambda poses, m: poses.__setitem__("object", Meddler(m.session, np.uint32(1))),
    "sequence": lambda poses, m: poses.__setitem__("position", Sequence(m.session, [(1, 1, 1)])),
    "record": lambda poses, m: poses.__setitem__(0, (m, 1, (1, 1, 1), (1, 1, 1, 1))),
    "record by field": lambda poses, m: poses.__setitem__(0, (1, 1, Sequence(m.session, (1, 1, 1)), (1, 1, 1, 1))),
    "records": lambda poses, m: poses.__setitem__(slice(None), [(m, 1, (1, 1, 1), (1, 1, 1, 1))]),
    "records of objects": lambda poses, m: poses.__setitem__(
        slice(None), np.array([(m, 1, [1] * 3, [1] * 4)], [(n, "O") for n in contactd.POSE.names])
    ),
    "read": lambda poses, m: poses["object"][m],
    "read a list": lambda poses, m: poses[[m]],
    "read a slice": lambda poses, m: poses["position"][m:, 0].sum(),
    "operand": lambda poses, m: poses["position"] + m,
    "objects": lambda poses, m: poses["object"] + np.array([m], object),
    "compared": lambda poses, m: poses["object"] == np.array([m], object),
    "contained": lambda poses, m: m in poses["object"],
    "axis": lambda poses, m: poses["position"].sum(axis=m),
    "axis of a function": lambda poses, m: np.sum(poses["position"], axis=m),
    "element": lambda poses, m: poses["object"].item(m),
    "filled": lambda poses, m: poses["position"].fill(m),
    "copied": lambda poses, m: np.copyto(poses["position"], np.array([m], object), casting="unsafe"),
    "a function of elements": lambda poses, m: np.frompyfunc(lambda x: m.meddle(), 1, 1)(poses["object"]),
    "called back": lambda poses, m: np.apply_along_axis(lambda row: m.meddle(), 1, poses["position"]),
    "as another type": lambda poses, m: np.array(poses, dtype=Typed(m)),
}


class Typed:
    """A type that is asked for."""

    def __init__(self, meddler):
        self.meddler = meddler

    @property
    def dtype(self):
        self.meddler.meddle()
        return np.dtype(contactd.POSE)


@pytest.mark.parametrize("use", USES)
def test_the_step_may_end_in_the_middle_of_a_call(session, use):
    poses = session.begin_step(1)
    with pytest.raises((contactd.Stale, contactd.StillExported)):
        USES[use](poses, Meddler(session))
    # Either the step went on, and was not written; or it did not, and nothing has changed.
    later = session.begin_step(LARGER)
    assert not np.array(later).tobytes().strip(b"\0")


def saved_by_a_function(saved, position):
    np.apply_along_axis(saved.append, 1, position)


def saved_over_axes(saved, position):
    np.apply_over_axes(lambda array, axis: saved.append(array) or array, position, [0])


def saved_from_fields(saved, position):
    from numpy.lib import recfunctions

    recfunctions.apply_along_fields(lambda array, axis: saved.append(array) or array[..., 0], position)


class Keeper:
    """An operand of a class of its own, which keeps the other one."""

    def __init__(self, saved):
        self.saved = saved

    def __array_ufunc__(self, ufunc, method, *inputs, **kwargs):
        self.saved += [i for i in inputs if i is not self]
        return 0


def saved_by_an_operand(saved, position):
    np.add(position, Keeper(saved))


def saved_in_a_class(saved, position):
    class Kept:
        def __init__(self, row):
            saved.append(row)

        def __float__(self):
            return 0.0

    np.apply_along_axis(lambda row: float(Kept(row)), 1, position)


@pytest.mark.parametrize(
    "save", [saved_by_a_function, saved_over_axes, saved_from_fields, saved_by_an_operand, saved_in_a_class]
)
def test_what_a_callback_keeps_is_counted(ball_and_wall, save):
    session, ball, _ = ball_and_wall
    poses = session.begin_step(1)
    poses[0] = contactd.end(ball, (16, 0, 0))
    saved = []
    save(saved, poses["position"] if save is not saved_from_fields else poses[["object", "flags"]])
    assert saved and all(type(s) is np.ndarray for s in saved)
    with pytest.raises(contactd.StillExported):
        session.finish()
    saved.clear()
    gc.collect()
    assert session.finish()[0].time == 0.5, "nothing was lost"


def test_what_a_counted_call_gives_back_holds_nothing_up(session):
    poses = session.begin_step(4)
    poses["position"] = np.arange(12).reshape(4, 3)

    class Two:
        def __index__(self):
            return 2

    two, position = Two(), poses["position"]
    kept = [
        position[two:],
        position[two],
        position[::-1][:, two],
        position[two:2],
        position[4:two],
        poses[two],
        position.T.reshape(3, two, two),
        np.apply_over_axes(lambda array, axis: array, position, [0]),
        np.reshape(position, (two, 6)),
        *np.split(position, [two]),
    ]
    values = [np.array(k) for k in kept]
    assert values[0].tolist() == [[6, 7, 8], [9, 10, 11]] and values[1].tolist() == [6, 7, 8]
    assert values[2].tolist() == [11, 8, 5, 2] and values[3].shape == values[4].shape == (0, 3)
    assert values[5]["position"].tolist() == [6, 7, 8] and np.array_equal(values[7], position)
    assert values[10].tolist() == values[0].tolist()
    views = [k for k in kept if isinstance(k, contactd.View)]
    position[two][0] = 60.0
    assert position[2, 0] == 60.0 and len(views) == 10, "a reshaped part is a copy"
    session.begin_step(0)
    for view in views:
        with pytest.raises(contactd.Stale):
            view.copy()
