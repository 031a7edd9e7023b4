"""What a step costs in Python beyond the same step in Rust: the same embedded session, the same batches, blocks taking turns.

overhead.py [--quick]. A step: slots loaned, filled with a batch of poses, sent, the answer's records looked at. Rust copies the batch
into the slots; Python does so by one assignment, or field by field from arrays of its own. Microseconds: the tenth part of the steps
was faster, which other load on the machine moves less than a median.
"""

import sys
import time

import numpy as np

import contactd
from contactd import Order


def batches(n, ids):
    """Two batches between which the balls, far apart, take turns."""
    both = np.zeros((2, n), contactd.POSE)
    both["object"], both["flags"] = ids, Order.END
    both["position"][..., 0] = 10.0 * np.arange(n)
    both["position"][1, :, 1] = 1.0
    both["rotation"][..., 3] = 1.0
    return both


def whole(session, both, steps):
    """Python's steps, the batch assigned as a whole; nanoseconds each."""
    n, times, now = both.shape[1], [], time.perf_counter_ns
    for k in range(steps):
        batch = both[k % 2]
        start = now()
        session.begin_step(n)[:] = batch
        session.finish(60.0).records
        times.append(now() - start)
    return times


def fields(session, both, steps):
    """Python's steps, each field assigned from an array of its own."""
    n, times, now = both.shape[1], [], time.perf_counter_ns
    objects = both["object"][0].copy()
    positions, rotations = ([np.ascontiguousarray(b[f]) for b in both] for f in ("position", "rotation"))
    for k in range(steps):
        position, rotation = positions[k % 2], rotations[k % 2]
        start = now()
        poses = session.begin_step(n)
        poses["object"] = objects
        poses["flags"] = Order.END
        poses["position"] = position
        poses["rotation"] = rotation
        session.finish(60.0).records
        times.append(now() - start)
    return times


def main(quick):
    print(f"{'poses':>6} {'rust us':>9} {'python us':>10} {'more us':>8} {'by fields us':>13} {'more us':>8}")
    worst = 0.0
    for n, steps, blocks in ((1, 100, 30), (16, 100, 30), (256, 40, 30), (4096, 4, 120)):
        blocks *= 1 if quick else 6
        with contactd.embedded() as session:
            ball = session.load_model("ball.csg", "sphere(r = 1);")
            ids = [session.add_object(f"ball {i}", ball, at=(10.0 * i, 0, 0)) for i in range(n)]
            both = batches(n, ids)
            raw = [b.tobytes() for b in both]
            ways = {
                "rust": lambda: session._native._steps_in_rust(raw, steps),
                "whole": lambda: whole(session, both, steps),
                "fields": lambda: fields(session, both, steps),
            }
            times = {name: [] for name in ways}
            for block in range(blocks + 1):
                for name, run in ways.items():
                    # The first round, and the first two steps of each block, warm up.
                    times[name] += run()[2:] if block else []
            rust, python, by_field = (np.percentile(t, 10) / 1000 for t in times.values())
            print(f"{n:6} {rust:9.2f} {python:10.2f} {python - rust:8.2f} {by_field:13.2f} {by_field - rust:8.2f}")
            worst = max(worst, python - rust) if n in (16, 4096) else worst
    print(f"a step in Python: at most {worst:.2f} us more than in Rust, for 16 and 4,096 poses")


if __name__ == "__main__":
    main("--quick" in sys.argv[1:])
