"""Tables of queries on Ray, Dask and Spark for real, a node or a worker killed half way, held against one process bit for bit.

    python benches/clusters.py [--rows N] [ray] [dask] [spark]

Each is tried where it is installed (`pip install "ray[data]" "dask[dataframe,distributed]" pyspark`; Spark needs Java). Prints what
each took and whether its answers are those of one process; exit status 1 where they are not.
"""

import argparse
import importlib.util
import os
import pathlib
import signal
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


def by_ray(source, scene, out, parts, marks):
    import ray
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    other = cluster.add_node(num_cpus=1)
    ray.init(address=cluster.address, logging_level="ERROR")
    cluster.wait_for_nodes()
    ray.data.DataContext.get_current().enable_progress_bars = False
    killed = half_way(marks, parts // 2, lambda: cluster.remove_node(other, allow_graceful=False))
    data = ray.data.read_parquet(source, override_num_blocks=parts)
    answers = data.map_batches(
        MarkingChecker,
        fn_constructor_args=(scene, marks),
        batch_format="pyarrow",
        batch_size=500,
        compute=ray.data.ActorPoolStrategy(min_size=1, max_size=2),
        num_cpus=0.5,
    )
    answers.write_parquet(str(out))
    killed.join(60)
    dead = not killed.is_alive()
    ray.shutdown()
    cluster.shutdown()
    return f"ray {ray.__version__}, two nodes, one of them killed" if dead else "ray: no node was killed"


def marked(frame, scene, folder):
    return Marking(lambda f: solve_frame(f, scene, threads=1), folder)(frame)


def by_dask(source, scene, out, parts, marks):
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


def by_spark(source, scene, out, parts, _marks):
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
    parser.add_argument("ways", nargs="*", choices=[[], *ways])
    asked = parser.parse_args()
    wrong = False
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for file, text in (("scene.toml", SCENE), ("plate.csg", PLATE), ("peg.csg", PEG)):
            (folder / file).write_text(text)
        scene = str(folder / "scene.toml")
        table, parts = queries(asked.rows, 7), 20
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
            what = ways[way](str(source), scene, out, parts, str(marks))
            elapsed = time.perf_counter() - begun
            found = pa.concat_tables([pq.read_table(p) for p in sorted(out.glob("**/*.parquet"))], promote_options="permissive")
            found = found.select(whole.column_names).cast(whole.schema).sort_by("id").combine_chunks()
            same = found.equals(whole.combine_chunks())
            wrong |= not same
            print(f"{what}: {found.num_rows:,} rows in {elapsed:.1f} s, {'every bit that of one process' if same else 'NOT the answers of one process'}", flush=True)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
