"""Tables of queries on Ray, Dask and Spark for real, a node or a worker killed half way, held against one process bit for bit.

    python benches/clusters.py [--rows N] [--namespaces] [ray] [dask] [spark]

Each is tried where it is installed (`pip install "ray[data]" "dask[dataframe,distributed]" pyspark`; Spark needs Java). Prints what
each took and whether its answers are those of one process; exit status 1 where they are not.

With `--namespaces` Ray's nodes are machines of their own to each other: each runs in a network namespace, joined by a virtual cable
alone, and the second one is killed with all its processes. Needs root and iproute2.
"""

import argparse
import contextlib
import importlib.util
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import pyarrow as pa
import pyarrow.parquet as pq

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from scale import PEG, PLATE, SCENE, queries  # noqa: E402

from contactd.batch import Mapper, answer_schema, solve, solve_frame  # noqa: E402


class Marking:
    """A callable that leaves a mark for each of its calls: so it is known when half of the work is done."""

    def __init__(self, work, folder):
        self._work, self._folder = work, folder

    def __call__(self, table):
        answers = self._work(table)
        tempfile.mkstemp(dir=self._folder)
        return answers


def half_way(marks, wanted, kill):
    """Calls ``kill`` once so many marks are there."""

    def watch():
        while len(os.listdir(marks)) < wanted:
            time.sleep(0.02)
        kill()

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    return thread


class MarkingChecker(Marking):
    """The same of an actor's callable."""

    def __init__(self, scene, folder):
        from contactd.ray import Checker

        super().__init__(Checker(scene), folder)


# Queries of one call of a Ray actor.
BATCH = 500
NAMESPACES = ("contactd-head", "contactd-node")
ADDRESSES = ("10.77.0.1", "10.77.0.2")


def ip(*words):
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True).stdout


def kill_all_in(namespace):
    for pid in ip("netns", "pids", namespace).split():
        with contextlib.suppress(ProcessLookupError):
            os.kill(int(pid), signal.SIGKILL)


@contextlib.contextmanager
def namespaces():
    """Two network namespaces, joined by a virtual cable; what runs in them ends with them."""
    ends = ("contactd0", "contactd1")
    try:
        for namespace in NAMESPACES:
            ip("netns", "add", namespace)
        ip("link", "add", ends[0], "netns", NAMESPACES[0], "type", "veth", "peer", "name", ends[1], "netns", NAMESPACES[1])
        for namespace, end, address in zip(NAMESPACES, ends, ADDRESSES, strict=True):
            ip("-n", namespace, "address", "add", f"{address}/24", "dev", end)
            for device in ("lo", end):
                ip("-n", namespace, "link", "set", device, "up")
        yield
    finally:
        for namespace in NAMESPACES:
            with contextlib.suppress(subprocess.CalledProcessError):
                kill_all_in(namespace)
                ip("netns", "delete", namespace)


@contextlib.contextmanager
def ray_nodes():
    """Two nodes of this machine: yields the cluster's address and what kills the second one."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    other = cluster.add_node(num_cpus=1)
    try:
        yield cluster.address, lambda: cluster.remove_node(other, allow_graceful=False)
    finally:
        cluster.shutdown()


@contextlib.contextmanager
def ray_nodes_in_namespaces():
    """The same in two network namespaces, the first of which is this process's."""
    program = pathlib.Path(sys.executable).with_name("ray")
    head = f"{ADDRESSES[0]}:6379"
    roles = (("--head", "--port=6379", "--include-dashboard=false"), (f"--address={head}",))
    nodes = []
    with tempfile.TemporaryDirectory() as folder:
        try:
            for namespace, address, role in zip(NAMESPACES, ADDRESSES, roles, strict=True):
                log = open(pathlib.Path(folder) / namespace, "wb")
                words = ["ip", "netns", "exec", namespace, str(program), "start", *role]
                words += [f"--node-ip-address={address}", "--num-cpus=1", "--disable-usage-stats", "--block"]
                nodes.append(subprocess.Popen(words, stdout=log, stderr=log))
                # The second one asks the first one's address once alone.
                time.sleep(15)
                if nodes[-1].poll() is not None:
                    sys.exit((pathlib.Path(folder) / namespace).read_text())
            yield head, lambda: kill_all_in(NAMESPACES[1])
        finally:
            for node in nodes:
                node.kill()


def by_ray(source, scene, out, rows, parts, marks, apart):
    import ray

    with ray_nodes_in_namespaces() if apart else ray_nodes() as (address, kill):
        ray.init(address=address, logging_level="ERROR")
        while len([node for node in ray.nodes() if node["Alive"]]) < 2:
            time.sleep(0.1)
        addresses = sorted(node["NodeManagerAddress"] for node in ray.nodes())
        ray.data.DataContext.get_current().enable_progress_bars = False
        killed = half_way(marks, rows // BATCH // 2, kill)
        data = ray.data.read_parquet(source, override_num_blocks=parts)
        answers = data.map_batches(
            MarkingChecker,
            fn_constructor_args=(scene, marks),
            batch_format="pyarrow",
            batch_size=BATCH,
            compute=ray.data.ActorPoolStrategy(min_size=1, max_size=2),
            num_cpus=0.5,
        )
        answers.write_parquet(str(out))
        killed.join(60)
        dead = not killed.is_alive()
        ray.shutdown()
    where = f" in network namespaces ({', '.join(addresses)})" if apart else ""
    return f"ray {ray.__version__}, two nodes{where}, one of them killed" if dead else "ray: no node was killed"


def marked(frame, scene, folder):
    return Marking(lambda f: solve_frame(f, scene, threads=1), folder)(frame)


def by_dask(source, scene, out, _rows, parts, marks, _apart):
    import dask.dataframe
    import distributed

    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, distributed.Client(cluster):
        pids = [worker.process.pid for worker in cluster.workers.values()]
        killed = half_way(marks, parts // 2, lambda: os.kill(pids[0], signal.SIGKILL))
        data = dask.dataframe.read_parquet(source, dtype_backend="pyarrow")
        meta = solve_frame(data.head(0), scene)
        schema = answer_schema(pq.read_schema(sorted(pathlib.Path(source).glob("*.parquet"))[0]))
        answers = data.map_partitions(marked, scene, marks, meta=meta)
        answers.to_parquet(out, schema=schema, write_index=False)
        killed.join(10)
        return f"dask {dask.__version__}, two workers, one of them killed" if not killed.is_alive() else "dask: no worker was killed"


def by_spark(source, scene, out, _rows, parts, _marks, _apart):
    import pyspark
    from pyspark.sql import SparkSession
    from pyspark.sql.pandas.types import from_arrow_schema

    os.environ["PYSPARK_PYTHON"] = sys.executable
    spark = SparkSession.builder.master("local[2]").config("spark.ui.enabled", "false").getOrCreate()
    spark.sparkContext.setLogLevel("ERROR")
    data = spark.read.parquet(source)
    schema = answer_schema(pq.read_schema(sorted(pathlib.Path(source).glob("*.parquet"))[0]))
    data.mapInArrow(Mapper(scene, threads=1), from_arrow_schema(schema)).write.parquet(str(out))
    spark.stop()
    return f"spark {pyspark.__version__}, two tasks at a time"


def main():
    ways = {"ray": by_ray, "dask": by_dask, "spark": by_spark}
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=20_000)
    parser.add_argument("--namespaces", action="store_true")
    # What runs in the first namespace.
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("ways", nargs="*", choices=[[], *ways])
    asked = parser.parse_args()
    if asked.namespaces and not asked.inside:
        if os.geteuid() != 0 or shutil.which("ip") is None:
            sys.exit("--namespaces needs root and the program `ip` (iproute2)")
        with namespaces():
            again = ["ip", "netns", "exec", NAMESPACES[0], sys.executable, *sys.argv, "--inside"]
            return subprocess.run(again).returncode
    wrong = False
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for file, text in (("scene.toml", SCENE), ("plate.csg", PLATE), ("peg.csg", PEG)):
            (folder / file).write_text(text)
        scene = str(folder / "scene.toml")
        table, parts = queries(asked.rows, 7), max(20, asked.rows // 5000)
        source = folder / "in"
        source.mkdir()
        size = -(-asked.rows // parts)
        for k in range(parts):
            pq.write_table(table.slice(k * size, size), source / f"{k:04d}.parquet")
        begun = time.perf_counter()
        whole = solve(table, scene, threads=1)
        print(f"one process: {asked.rows:,} queries in {time.perf_counter() - begun:.1f} s", flush=True)
        for way in asked.ways or ways:
            module = {"spark": "pyspark", "dask": "distributed"}.get(way, way)
            if importlib.util.find_spec(module) is None:
                print(f"{way}: not installed")
                continue
            out = folder / way
            begun = time.perf_counter()
            marks = folder / f"{way} marks"
            marks.mkdir()
            what = ways[way](str(source), scene, out, asked.rows, parts, str(marks), asked.namespaces)
            elapsed = time.perf_counter() - begun
            found = pa.concat_tables([pq.read_table(p) for p in sorted(out.glob("**/*.parquet"))], promote_options="permissive")
            found = found.select(whole.column_names).cast(whole.schema).sort_by("id").combine_chunks()
            same = found.equals(whole.combine_chunks())
            wrong |= not same
            print(f"{what}: {found.num_rows:,} rows in {elapsed:.1f} s, {'every bit that of one process' if same else 'NOT the answers of one process'}", flush=True)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
