"""What a live page of a server's steps costs the server's other clients: their steps' tail beside the page and without it.

    python benches/live.py [--contactd PROGRAM] [--rounds N] [--seconds S]

One client moves a ball at 100 steps a second; the page shows it (`contactd view --server`, read as a browser reads it: whole when it
opens and when the show has grown, and the stream of events). Another client takes a step of 16 balls every millisecond and times it.
Blocks come in fours, without, with, with, without the page, so that a drift of the machine meets both alike; of each four the ratio
of the mean 99th percentiles, and of the medians. Prints the medians of both over all fours, and the middle half of the ratios.
"""

import argparse
import contextlib
import multiprocessing
import re
import shutil
import subprocess
import sys
import time
import urllib.request

import numpy as np

import contactd

NAME = "live-bench"


def balls(session, count):
    wall = session.load_model("wall.csg", "cube(size = [2, 20, 20], center = true);")
    ball = session.load_model("ball.csg", "sphere(r = 1);")
    session.add_object("wall", wall, fixed=True, at=(10, 0, 0))
    return [session.add_object(f"ball {i}", ball, at=(0, 4 * i, 0)) for i in range(count)]


def steps(count, pause, until):
    """Takes steps of so many balls until a time; how long each took, microseconds."""
    times = []
    with contactd.connect(NAME) as session:
        ids = balls(session, count)
        due, k = time.perf_counter(), 0
        while time.time() < until:
            due += pause
            time.sleep(max(0.0, due - time.perf_counter()))
            k += 1
            begun = time.perf_counter_ns()
            slots = session.begin_step(count)
            for i, object in enumerate(ids):
                slots[i] = contactd.end(object, (4 + 4 * np.sin(0.1 * k), 4 * i, 0))
            session.finish(timeout=10)
            times.append((time.perf_counter_ns() - begun) / 1000)
    return times


def read(address):
    """Does what a page does."""
    urllib.request.urlopen(address).read()
    with urllib.request.urlopen(address + "live") as events:
        for _ in events:
            with contextlib.suppress(OSError):
                urllib.request.urlopen(address + "show.json").read()


@contextlib.contextmanager
def page(program):
    view = subprocess.Popen([program, "view", "--server", NAME], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    address = None
    while address is None:
        address = re.search(r"http://\S+/", view.stdout.readline())
    reader = multiprocessing.Process(target=read, args=(address.group(),), daemon=True)
    reader.start()
    try:
        yield
    finally:
        reader.kill()
        view.terminate()
        view.wait()


def block(program, with_page, seconds):
    with page(program) if with_page else contextlib.nullcontext():
        if with_page:
            # The page opens.
            time.sleep(1.0)
        return np.percentile(steps(16, 0.001, time.time() + seconds), [50, 99])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--contactd", default=shutil.which("contactd"))
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=3.0)
    asked = parser.parse_args()
    command = [asked.contactd, "serve", "--name", NAME, "--cache", "off"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    server.stdout.readline()
    until = time.time() + asked.rounds * 4 * (asked.seconds + 3.0) + 10
    shown = multiprocessing.Process(target=steps, args=(1, 0.01, until), daemon=True)
    shown.start()
    try:
        time.sleep(1.0)
        fours = [[block(asked.contactd, k in (1, 2), asked.seconds) for k in range(4)] for _ in range(asked.rounds)]
    finally:
        shown.kill()
        server.terminate()
        server.wait()
    fours = np.array(fours)
    off, on = (fours[:, 0] + fours[:, 3]) / 2, (fours[:, 1] + fours[:, 2]) / 2
    for name, k in (("median", 0), ("p99", 1)):
        low, middle, high = np.percentile(on[:, k] / off[:, k], [25, 50, 75])
        times = f"{np.median(off[:, k]):.1f} us without, {np.median(on[:, k]):.1f} us beside a live page"
        print(f"{name}: {times}, ratio {middle:.3f} (middle half {low:.3f} to {high:.3f} of {asked.rounds})")


if __name__ == "__main__":
    sys.exit(main())
