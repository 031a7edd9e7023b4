"""How far tables of queries scale: measured on one and two processes, and from their measured times simulated on a thousand.

    python benches/scale.py [--quick]

A peg falls into the hole of a plate, or misses it. Prints queries a second, what a part costs, and for 10^9 queries the time on so
many workers when each takes the next part as it is done (`contactd batch` gives each worker its share beforehand: the second
column). Times are of this machine while nothing else runs.
"""

import argparse
import concurrent.futures
import heapq
import multiprocessing
import os
import pathlib
import random
import sys
import tempfile
import time

import numpy as np
import pyarrow as pa

SCENE = """
[[model]]
name = "plate"
file = "plate.csg"

[[model]]
name = "peg"
file = "peg.csg"

[[object]]
name = "plate"
model = "plate"
motion = "static"

[[object]]
name = "peg"
model = "peg"
start = { position = [0, 0, 20] }
"""
PLATE = "difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }"
PEG = "cylinder(h = 20, r1 = 2.5, r2 = 2.9, center = true);"


def queries(n, seed):
    """So many falls, tilted by a few degrees, towards the hole and beside it."""
    rng = np.random.default_rng(seed)

    def poses(height):
        at = np.zeros((n, 7))
        at[:, :2] = rng.normal(0, 1.5, (n, 2))
        at[:, 2] = height
        at[:, 3:6] = rng.normal(0, 0.02, (n, 3))
        at[:, 6] = 1
        at[:, 3:] /= np.linalg.norm(at[:, 3:], axis=1)[:, None]
        return pa.FixedSizeListArray.from_arrays(pa.array(at.ravel()), 7)

    return pa.table({"id": pa.array(np.arange(n)), "start": poses(20), "end": poses(0)})


_checker = None


def begin(scene):
    global _checker
    from contactd.ray import Checker

    _checker = Checker(scene)


def part(job):
    n, seed = job
    table = queries(n, seed)
    begun = time.perf_counter()
    answers = _checker(table)
    return time.perf_counter() - begun, answers.num_rows


def measured(workers, scene, jobs):
    """Queries a second of so many processes, and what each part took."""
    with concurrent.futures.ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), begin, (scene,)) as pool:
        list(pool.map(part, [(64, k) for k in range(4 * workers)]))
        begun = time.perf_counter()
        done = list(pool.map(part, jobs))
        elapsed = time.perf_counter() - begun
    return sum(rows for _, rows in done) / elapsed, [seconds for seconds, _ in done]


def simulated(workers, parts, times, start, rng):
    """When the last of so many parts is done, taken as workers are free; and dealt out beforehand."""
    free = [start] * workers
    heapq.heapify(free)
    dealt = [start] * workers
    for k in range(parts):
        seconds = rng.choice(times)
        heapq.heapreplace(free, free[0] + seconds)
        dealt[k % workers] += seconds
    return max(free), max(dealt)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    rows, parts = (500, 8) if asked.quick else (2_000, 40)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("scene.toml", SCENE), ("plate.csg", PLATE), ("peg.csg", PEG)):
            pathlib.Path(folder, name).write_text(text)
        scene = os.path.join(folder, "scene.toml")
        code = f"import contactd.ray; contactd.ray.Checker({scene!r})"
        begun = time.perf_counter()
        assert os.spawnl(os.P_WAIT, sys.executable, sys.executable, "-c", code) == 0
        start = time.perf_counter() - begun
        print(f"a worker is ready after {start:.2f} s (Python, libraries, models)")
        jobs = [(rows, 1000 + k) for k in range(parts)]
        rates = {}
        for workers in (1, 2):
            rates[workers], times = measured(workers, scene, jobs)
            spread = max(times) / min(times)
            print(f"{workers} worker(s): {rates[workers]:,.0f} queries a second; a part of {rows:,}: {np.mean(times) * 1e3:.1f} ms, dearest by cheapest {spread:.2f}")
        print(f"two workers do {rates[2] / rates[1]:.2f} times what one does ({os.cpu_count()} processors here)")
        _, times = measured(1, scene, jobs)
        rng = random.Random(1)
        wanted = 10**9
        # A part of 65,536 rows is so many of those that were measured.
        many = 65_536 // rows
        whole = [sum(rng.choices(times, k=many)) * 65_536 / (many * rows) for _ in range(2_000)]
        count = -(-wanted // 65_536)
        alone = count * np.mean(whole)
        print(f"10^9 queries, {count:,} parts of 65,536: {alone / 3600:,.0f} hours of one processor; simulated from the times measured:")
        print(f"{'workers':>8} {'as free, s':>12} {'dealt out, s':>13} {'of ideal':>9}")
        for workers in (1, 2, 10, 100, 1_000):
            free, dealt = simulated(workers, count, whole, start, rng)
            print(f"{workers:8,} {free:12,.0f} {dealt:13,.0f} {alone / workers / free:8.1%}")


if __name__ == "__main__":
    main()
