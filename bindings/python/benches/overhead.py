"""What a step costs in Python beyond the same step in Rust, and what contacts for MuJoCo cost beside MuJoCo's own.

Rust and Python: the same embedded session, the same batches, steps taking turns.

overhead.py [--quick]. A step: slots loaned, filled with poses, sent, the answer's records looked at. Rust and Python fill them from
the same arrays, in three ways: a batch of records in one call, the same copied into the slots of a begun step, or field by field
from arrays of objects, positions and rotations. Filling is the caller's own work and is done on both sides.

Steps come in fours, Rust, Python, Python, Rust, so that other load on the machine and a drift of its clock meet both alike: the
difference of a four is that of its two pairs' means. Microseconds: medians, and of the differences the middle half beside the
median, and the error of the median (half of a 95 % interval, by its binomial order statistics).

"one call" is what stands between Rust's step and who asks for it from Python: one call of a compiled function, there and back,
whose step lies in between. After a step that has gone through megabytes the interpreter comes back to cold caches.

MuJoCo (where it is installed): stock's collision stage is ``mj_collision`` of the same scene with its own contacts, ``contacts`` is
``Coupling.add_contacts``; steps are ``mj_step`` and ``Coupling.step``, taking turns. "asked" counts requests to the engine, a step.
"all asked" leaves to MuJoCo nothing that it has in closed form (``keep_exact=False``).
"""

import pathlib
import sys
import time
from itertools import cycle

import numpy as np

import contactd
from contactd import Order, _native


def batches(n, ids):
    """Two batches between which the balls, far apart, take turns."""
    both = np.zeros((2, n), contactd.POSE)
    both["object"], both["flags"] = ids, Order.END
    both["position"][..., 0] = 10.0 * np.arange(n)
    both["position"][1, :, 1] = 1.0
    both["rotation"][..., 3] = 1.0
    return both


def whole(session, both):
    """A step of Rust's and one of Python's, of a batch that is copied as a whole; nanoseconds."""
    now, n, turns = time.perf_counter_ns, both.shape[1], cycle(both)

    def python():
        records = next(turns)
        start = now()
        session.begin_step(n)[:] = records
        session.finish(60.0).records
        return now() - start

    return lambda: _native._whole_in_rust(session, next(turns)), python


def at_once(session, both):
    """The same in one call."""
    now, turns = time.perf_counter_ns, cycle(both)

    def python():
        records = next(turns)
        start = now()
        session.step(records, 60.0).records
        return now() - start

    return lambda: _native._whole_in_rust(session, next(turns)), python


def fields(session, both):
    """The same, filled in field by field from arrays."""
    now, n, k = time.perf_counter_ns, both.shape[1], 0
    objects = both["object"][0].copy()
    position, rotation = ([np.ascontiguousarray(b[f]) for b in both] for f in ("position", "rotation"))

    def rust():
        nonlocal k
        k ^= 1
        return _native._fields_in_rust(session, objects, Order.END, position[k], rotation[k])

    def python():
        nonlocal k
        k ^= 1
        positions, rotations = position[k], rotation[k]
        start = now()
        poses = session.begin_step(n)
        poses["object"] = objects
        poses["flags"] = Order.END
        poses["position"] = positions
        poses["rotation"] = rotations
        session.finish(60.0).records
        return now() - start

    return rust, python


def fours(rust, python, count):
    """Nanoseconds of steps in fours: (count, 4), Rust's first and last; and of one call around each of Rust's."""
    now, calls = time.perf_counter_ns, []

    def around():
        start = now()
        inside = rust()
        calls.append(now() - start - inside)
        return inside

    for _ in range(8):
        rust(), python()
    return np.array([(around(), python(), python(), around()) for _ in range(count)]), np.array(calls)


def told(times, calls):
    """Medians of Rust's and Python's steps, the median difference, its error, the middle half of the differences, the median of one
    call; microseconds."""
    times = times / 1000.0
    more = np.sort(0.5 * (times[:, 1] + times[:, 2] - times[:, 0] - times[:, 3]))
    n = len(more)
    # Ranks between which the median lies 95 times in 100: n/2 ± 0.98 √n.
    reach = int(0.98 * np.sqrt(n)) + 1
    error = 0.5 * (more[min(n // 2 + reach, n - 1)] - more[max(n // 2 - reach, 0)])
    rust, python = np.median(times[:, [0, 3]]), np.median(times[:, [1, 2]])
    return rust, python, more[n // 2], error, more[n // 4], more[3 * n // 4], np.median(calls) / 1000.0


def main(quick):
    print(f"{'poses':>6} {'filled':>7} {'rust us':>9} {'python us':>10} {'more us':>8} {'+-':>5} {'middle half':>16} {'one call':>9}")
    worst = {}
    for n, count in ((1, 2000), (16, 2000), (256, 600), (4096, 300)):
        count *= 1 if quick else 5
        with contactd.embedded() as session:
            ball = session.load_model("ball.csg", "sphere(r = 1);")
            ids = [session.add_object(f"ball {i}", ball, at=(10.0 * i, 0, 0)) for i in range(n)]
            both = batches(n, ids)
            for way in (at_once, whole, fields):
                rust, python, more, error, low, high, call = told(*fours(*way(session, both), count))
                row = f"{n:6} {way.__name__:>7} {rust:9.2f} {python:10.2f} {more:8.2f} {error:5.2f} {low:7.2f} {high:8.2f}"
                print(f"{row} {call:9.2f}")
                if n in (16, 4096):
                    worst[way] = max(worst.get(way, 0.0), more)
    print(
        f"a step of 16 or 4,096 poses in Python: at most {worst[at_once]:.2f} us more than in Rust in one call, begun and filled "
        f"{worst[whole]:.2f}, field by field {worst[fields]:.2f}"
    )


def primitives(friction):
    """Boxes and cylinders, 20 in all, over a plane."""
    bodies = "".join(
        f'<body pos="{0.3 * (i % 5)} {0.3 * (i // 5)} .05"><freejoint/><geom type="{kind}" size=".05 .05 .05"/></body>'
        for i, kind in enumerate(["box", "cylinder"] * 10)
    )
    return f"""<mujoco><option timestep="0.001"/><default><geom friction="{friction}"/></default><worldbody>
        <geom type="plane" size="1 1 .1"/>{bodies}</worldbody></mujoco>"""


def thrown(geom):
    """Twelve bodies of a kind, falling in any attitude into a bin of boxes."""
    draw, bodies = np.random.default_rng(3), ""
    for i in range(12):
        (x, y), turn = draw.uniform(-0.1, 0.1, 2), draw.normal(size=4)
        place = f'pos="{x} {y} {0.15 + 0.14 * i}" quat="{" ".join(map(str, turn))}"'
        bodies += f"<body {place}><freejoint/><geom {geom}/></body>"
    walls = "".join(
        f'<geom type="box" size="{size}" pos="{at}"/>'
        for size, at in (
            (".3 .3 .05", "0 0 -.05"),
            (".02 .3 .2", ".22 0 .2"),
            (".02 .3 .2", "-.22 0 .2"),
            (".3 .02 .2", "0 .22 .2"),
            (".3 .02 .2", "0 -.22 .2"),
        )
    )
    corners = "0 0 .08 .08 0 -.04 -.05 .07 -.04 -.05 -.07 -.04"
    return f"""<mujoco><asset><mesh name="tetrahedron" vertex="{corners}"/></asset><worldbody>{walls}{bodies}</worldbody></mujoco>"""


# Kinds that are thrown; of boxes all contacts are MuJoCo's own.
KINDS = {
    "cylinders": 'type="cylinder" size=".05 .06"',
    "discs": 'type="cylinder" size=".08 .02"',
    "capsules": 'type="capsule" size=".04 .06"',
    "ellipsoids": 'type="ellipsoid" size=".05 .07 .04"',
    "tetrahedra": 'type="mesh" mesh="tetrahedron"',
}


def coupled(name, make, couple, settle, speed, count):
    """A line of the table: medians in microseconds."""
    import mujoco

    stock, model = make(), make()
    theirs, data = mujoco.MjData(stock), mujoco.MjData(model)
    now, times, inner = time.perf_counter_ns, [], []
    with couple(model) as coupling:
        add_contacts = coupling.add_contacts

        def timed(data):
            start = now()
            n = add_contacts(data)
            inner.append(now() - start)
            return n

        coupling.add_contacts = timed
        for _ in range(settle):
            mujoco.mj_step(stock, theirs)
            coupling.step(data)
        for d in (theirs, data):
            d.qvel[::6] += speed
        before = coupling.asked.requests
        for _ in range(count):
            marks = [now()]
            mujoco.mj_step(stock, theirs)
            marks.append(now())
            coupling.step(data)
            marks.append(now())
            mujoco.mj_fwdPosition(stock, theirs)
            marks.append(now())
            mujoco.mj_collision(stock, theirs)
            marks.append(now())
            times.append(np.diff(marks))
        asked = (coupling.asked.requests - before) / count
    step, coupled_step, _, collision = np.median(np.array(times), axis=0) / 1000.0
    contacts = np.median(inner[settle:]) / 1000.0
    more = f"{collision:8.2f} {contacts:9.2f} {contacts / collision:6.1f} {step:8.1f} {coupled_step:9.1f} {asked:6.2f}"
    print(f"{name:>22} {theirs.ncon:6} {data.ncon:6} {more}")


def contacts(quick):
    """Contacts for MuJoCo, beside its own."""
    try:
        import mujoco
    except ImportError:
        print("mujoco is not installed: its table is left out")
        return
    from contactd.mujoco import attach

    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "examples"))
    import mujoco_peg

    settle, count = (1500, 100) if quick else (1500, 1000)
    print(f"{'':>22} {'contacts':>13} {'collision stage':>24} {'whole step':>19}")
    print(f"{'':>22} {'stock':>6} {'here':>6} {'stock':>8} {'here':>9} {'ratio':>6} {'stock':>8} {'here':>9} {'asked':>6}")
    resting = lambda: mujoco.MjModel.from_xml_string(primitives(1))  # noqa: E731
    sliding = lambda: mujoco.MjModel.from_xml_string(primitives(0))  # noqa: E731
    alone = lambda model: attach(model, keep_exact=False)  # noqa: E731
    coupled("20 at rest", resting, attach, settle, 0.0, count)
    coupled("20 sliding at .2 m/s", sliding, attach, settle, 0.2, count)
    coupled("all asked, at rest", resting, alone, settle, 0.0, count)
    coupled("all asked, sliding", sliding, alone, settle, 0.2, count)
    peg = lambda model: attach(model, mujoco_peg.SOLIDS, unit=1e-3)  # noqa: E731
    coupled("peg and plate at rest", mujoco_peg.scene, peg, settle, 0.0, count)
    for kind, geom in KINDS.items():
        into_bin = lambda geom=geom: mujoco.MjModel.from_xml_string(thrown(geom))  # noqa: E731
        coupled(f"12 {kind} in a bin", into_bin, attach, 200, 0.0, 100 if quick else 400)


if __name__ == "__main__":
    main("--quick" in sys.argv[1:])
    contacts("--quick" in sys.argv[1:])
