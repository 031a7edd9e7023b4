"""Tables of queries on Ray: ``dataset.map_batches(contactd.ray.Checker, fn_constructor_args=("scene.toml",), batch_format="pyarrow",
concurrency=N)``."""

from __future__ import annotations

from typing import Any

import pyarrow as pa

from .batch import Scenes, Solver


class Checker:
    """An actor's callable: it reads the scenes once, and answers tables of queries (``contactd.batch``) on one thread.

    Ray itself is not imported: whatever calls a class with tables can use it.
    """

    def __init__(self, scenes: Scenes, **options: Any):
        self._solver = Solver(scenes, **({"threads": 1} | options))

    def __call__(self, queries: pa.Table) -> pa.Table:
        return self._solver.solve(queries)
