"""Tables of queries: many steps of scenes, each for itself, in and out as Arrow tables.

>>> import contactd.batch, pyarrow as pa
>>> queries = pa.table({"part": ["a", "b"], "end": [[0, 0, 0, 0, 0, 0, 1.0], [0, 0, 30, 0, 0, 0, 1.0]]})
>>> answers = contactd.batch.solve(queries, "scene.toml")  # doctest: +SKIP
>>> answers["status"].to_pylist()  # doctest: +SKIP
['contact', 'clear']

Each row is a step of a scene whose objects stand as the scene has them, but for those that the row moves. No row knows of another:
answers are the same bits however a table is cut, on however many threads, workers or machines. Needs pyarrow
(``pip install "contactd[batch]"``).

Columns of a query:

- ``scene``: which of several scenes, by its name; not needed where there is one;
- ``objects``: names of the objects that it moves, a list; without it those that may move, in the order of the file;
- ``start``: where they stand first, a list of 7 numbers an object (position, quaternion x y z w); null: as in the scene;
- ``end``: where their step ends, the same; null: they stand where ``start`` puts them;
- ``turn``: a rotation vector for each, 3 numbers, in place of ``end``'s quaternions, for turns of half a turn and more; may be null.

All other columns are handed on. Columns of an answer, behind those:

- ``status``: "clear", "contact", "undecided" (a limit of work left a pair open), or "refused";
- ``safe_time``: nothing meets before this fraction of the step; null where it was refused;
- ``truncated``: ``max_records`` left contacts out;
- ``cells``: work;
- ``refusal``: one sentence, else null;
- ``contacts``: a list of pairs in the order of time, each a struct: names ``a`` and ``b``, ``status``, ``time`` within the bracket
  [``time_lower``, ``time_upper``], ``touching``, ``point``, ``normal`` (from a to b), ``separation``, ``normal_speed``, ``kind``, ``extent``, ``penetration``,
  ``resolution``, ``features_a`` and ``features_b`` (faces by name), ``cells``. What has no meaning for its status is null.
"""

from __future__ import annotations

import collections
import os
import threading
from typing import Any, Iterable, Iterator, Mapping

import numpy as np

from . import _native
from .records import CONTACT, DETAIL, EXTENT_NAMES, KIND_NAMES, NO_FACE, POSE, STATUS_NAMES, Flag, Order, Status, Valid

try:
    import pyarrow as pa
    import pyarrow.compute as pc
except ImportError as error:
    raise ImportError('contactd.batch needs pyarrow: pip install "contactd[batch]"') from error

Scenes = str | os.PathLike[str] | Mapping[str, str | os.PathLike[str]]

_POSES = ("start", "end", "turn")
_WIDTH = {"start": 7, "end": 7, "turn": 3}
#: Rows that are answered at a time: memory is bounded by it.
ROWS = 8192
_STATUS = ["refused", "clear", "contact", "undecided"]
# Of three numbers each; not every engine takes lists of a fixed size.
_VECTOR = pa.list_(pa.float64())
#: The type of ``contacts``' items.
CONTACT_TYPE = pa.struct(
    [
        ("a", pa.string()),
        ("b", pa.string()),
        ("status", pa.string()),
        ("time", pa.float64()),
        ("time_lower", pa.float64()),
        ("time_upper", pa.float64()),
        ("touching", pa.bool_()),
        ("point", _VECTOR),
        ("normal", _VECTOR),
        ("separation", pa.float64()),
        ("normal_speed", pa.float64()),
        ("kind", pa.string()),
        ("extent", pa.string()),
        ("penetration", pa.float64()),
        ("resolution", pa.float64()),
        ("features_a", pa.list_(pa.string())),
        ("features_b", pa.list_(pa.string())),
        ("cells", pa.int64()),
    ]
)
_ANSWER = [
    ("status", pa.string()),
    ("safe_time", pa.float64()),
    ("truncated", pa.bool_()),
    ("cells", pa.int64()),
    ("refusal", pa.string()),
    ("contacts", pa.list_(CONTACT_TYPE)),
]


class Scene:
    """A scene that takes queries: its models are read and preprocessed once."""

    def __init__(self, path: str | os.PathLike[str], *, resolution: float | None = None, cache: str | os.PathLike[str] | None = None):
        self.path = os.fspath(path)
        self._native = _native.Batch(self.path, cache, resolution)
        objects = self._native._objects()
        #: Names of its objects, in the order of the file.
        self.objects: list[str] = [name for name, _, _, _ in objects]
        #: Names of those that may move.
        self.movable: list[str] = [name for name, fixed, _, _ in objects if not fixed]
        #: Where they stand: position and quaternion by name.
        self.poses: dict[str, list[float]] = {name: pose for name, _, _, pose in objects}
        self._ids = {name: i for i, name in enumerate(self.objects)}
        self._movable = np.array([i for i, (_, fixed, _, _) in enumerate(objects) if not fixed], np.uint32)
        # Faces of all models behind each other, and where those of each object's begin.
        faces = self._native._faces()
        begins = np.cumsum([0, *map(len, faces)])
        self._faces = pa.array([name for model in faces for name in model], pa.string())
        self._faces_of = np.array([begins[model] for _, _, model, _ in objects], np.int64)
        self._names = pa.array(self.objects, pa.string())

    @property
    def key(self) -> str:
        """A hash of all that its answers depend on beside queries and options."""
        return self._native.key

    @property
    def notes(self) -> list[str]:
        """What its import snapped, left out or found without effect."""
        return self._native.notes


_kept: collections.OrderedDict[str, Scene] = collections.OrderedDict()
_keeping = threading.Lock()


def _scene(path: str | os.PathLike[str], resolution: float | None, cache: str | os.PathLike[str] | None) -> Scene:
    """A scene, read anew only where its content is another one: a worker that is asked often loads its models once."""
    key = _native._batch_key(os.fspath(path), resolution)
    with _keeping:
        scene = _kept.get(key) or Scene(path, resolution=resolution, cache=cache)
        _kept[key] = scene
        _kept.move_to_end(key)
        while len(_kept) > 64:
            _kept.popitem(last=False)
    return scene


class Solver:
    """Answers tables of queries on scenes.

    ``scenes``: a scene's file, or files by the names that the column ``scene`` has. ``resolution``: a length, in place of the
    scenes' own. ``first``: only the pairs whose bracket meets a query's earliest contact. ``clear``: clear pairs, too.
    ``max_records``: most contacts of a query, 0 for all. ``cell_limit``, ``batch_limit``: most cells of a pair and of a query, 0
    for the engine's. ``threads``: 0 for all that there are. ``cache``: a folder for preprocessed models.
    """

    def __init__(
        self,
        scenes: Scenes,
        *,
        resolution: float | None = None,
        first: bool = False,
        clear: bool = False,
        max_records: int = 0,
        cell_limit: int = 0,
        batch_limit: int = 0,
        threads: int = 0,
        cache: str | os.PathLike[str] | None = None,
    ):
        paths = scenes if isinstance(scenes, Mapping) else {"": scenes}
        self._is_one = not isinstance(scenes, Mapping)
        self.scenes = {name: _scene(path, resolution, cache) for name, path in paths.items()}
        self._options = (first, clear, max_records, cell_limit, batch_limit, threads)

    @property
    def key(self) -> str:
        """A hash of all that answers depend on beside the queries."""
        return repr(([(name, scene.key) for name, scene in sorted(self.scenes.items())], self._options[:-1]))

    def solve(self, queries: Any) -> pa.Table:
        """The answers to a table (a ``pyarrow.Table`` or ``RecordBatch``, or what ``pyarrow.table`` makes one of), row by row."""
        queries = _table(queries)
        parts = list(self.stream(queries.to_batches()))
        return pa.Table.from_batches(parts, answer_schema(queries.schema)) if parts else answer_schema(queries.schema).empty_table()

    def stream(self, batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        """The same of a stream of record batches, some thousand rows at a time."""
        for batch in batches:
            for at in range(0, batch.num_rows, ROWS):
                yield self._solve(batch.slice(at, ROWS))

    def _solve(self, queries: pa.RecordBatch) -> pa.RecordBatch:
        schema = answer_schema(queries.schema)
        n = queries.num_rows
        refusals: dict[int, str] = {}
        tables, order = [], []
        for name, rows in self._by_scene(queries, refusals):
            answers = _of_scene(self.scenes[name], queries, rows, refusals, self._options)
            tables.append(answers)
            order.append(rows)
        left = np.setdiff1d(np.arange(n), np.concatenate(order) if order else np.empty(0, np.int64))
        if len(left):
            tables.append(_refused([refusals[int(row)] for row in left]))
            order.append(left)
        columns = pa.concat_tables(tables).take(pa.array(np.argsort(np.concatenate(order), kind="stable"))).combine_chunks()
        kept = [queries.column(field.name) for field in schema if field.name not in columns.schema.names]
        own = [columns.column(name).combine_chunks() for name, _ in _ANSWER]
        own = [c.chunk(0) if isinstance(c, pa.ChunkedArray) else c for c in own]
        return pa.RecordBatch.from_arrays(kept + own, schema=schema)

    def _by_scene(self, queries: pa.RecordBatch, refusals: dict[int, str]) -> Iterator[tuple[str, np.ndarray]]:
        rows = np.arange(queries.num_rows)
        if self._is_one:
            if len(rows):
                yield "", rows
            return
        if "scene" not in queries.schema.names:
            raise ValueError('expected a column "scene", which names one of several scenes of each row, found none')
        names = queries.column("scene").cast(pa.string()).dictionary_encode()
        which = names.indices.fill_null(-1).to_numpy(zero_copy_only=False)
        for i, name in [(-1, None), *enumerate(names.dictionary.to_pylist())]:
            own = rows[which == i]
            if name in self.scenes:
                yield name, own
            else:
                known = ", ".join(map(repr, list(self.scenes)[:8]))
                refusals.update((int(row), f"scene: expected one of {known}, found {name!r}") for row in own)


def solve(queries: Any, scenes: Scenes, **options: Any) -> pa.Table:
    """The answers to a table of queries: ``Solver(scenes, **options).solve(queries)``. Models stay loaded between calls."""
    return Solver(scenes, **options).solve(queries)


def solve_frame(queries: Any, scenes: Scenes, **options: Any) -> Any:
    """The same of a pandas ``DataFrame``, as one: for Dask, ``frame.map_partitions(solve_frame, scene, threads=1, meta=…)``."""
    table = pa.Table.from_pandas(queries, preserve_index=False)
    frame = solve(table, scenes, **options).to_pandas()
    frame.index = queries.index
    return frame


class Mapper:
    """The same of an iterator of record batches: for Spark, ``frame.mapInArrow(Mapper(scene, threads=1), schema)``.

    It can be pickled: a worker reads the scenes where it runs.
    """

    def __init__(self, scenes: Scenes, **options: Any):
        self._of = (scenes, options)

    def __call__(self, batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        scenes, options = self._of
        return Solver(scenes, **options).stream(batches)


def answer_schema(queries: pa.Schema) -> pa.Schema:
    """The columns of the answers to queries of some columns."""
    taken = [name for name, _ in _ANSWER if name in queries.names]
    if taken:
        raise ValueError(f"columns {', '.join(taken)}: expected other names, as those of answers are called so")
    if len(set(queries.names)) < len(queries.names):
        raise ValueError("expected columns of different names, found one twice")
    kept = [field.with_metadata(None) for field in queries if field.name not in (*_POSES, "objects")]
    return pa.schema(kept + [pa.field(*column) for column in _ANSWER])


def _table(queries: Any) -> pa.Table:
    if isinstance(queries, pa.RecordBatch):
        return pa.Table.from_batches([queries])
    return queries if isinstance(queries, pa.Table) else pa.table(queries)


def _refused(sentences: list[str]) -> pa.Table:
    n = len(sentences)
    nothing = {name: pa.nulls(n, kind) for name, kind in _ANSWER}
    nothing |= {"status": pa.array(["refused"] * n, pa.string()), "refusal": pa.array(sentences, pa.string())}
    nothing |= {"truncated": pa.array([False] * n), "cells": pa.array([0] * n, pa.int64())}
    nothing["contacts"] = pa.array([[] for _ in range(n)], pa.list_(CONTACT_TYPE))
    return pa.table(nothing)


class _Lists:
    """A column of lists of numbers: how many each row has, and all of them; rows that are null have none."""

    def __init__(self, queries: pa.RecordBatch, name: str):
        self.name, self.width = name, _WIDTH[name]
        column = queries.column(name) if name in queries.schema.names else pa.nulls(queries.num_rows, pa.list_(pa.float64()))
        if pa.types.is_null(column.type):
            column = column.cast(pa.list_(pa.float64()))
        if not (pa.types.is_list(column.type) or pa.types.is_large_list(column.type) or pa.types.is_fixed_size_list(column.type)):
            raise ValueError(f'column "{name}": expected lists of numbers, found {column.type}')
        self.given = column.is_valid().to_numpy(zero_copy_only=False)
        self.length = column.value_lengths() if hasattr(column, "value_lengths") else pc.list_value_length(column)
        self.length = np.where(self.given, pc.fill_null(self.length, 0).to_numpy(zero_copy_only=False), 0).astype(np.int64)
        flat = column.flatten()
        try:
            flat = flat.cast(pa.float64())
        except pa.ArrowInvalid as error:
            raise ValueError(f'column "{name}": expected lists of numbers, found {column.type}') from error
        # A number that is null is none: the engine refuses it, and says of which object.
        self.values = pc.fill_null(flat, float("nan")).to_numpy(zero_copy_only=False)
        self.begin = np.concatenate([[0], np.cumsum(self.length)])

    def of(self, rows: np.ndarray) -> np.ndarray:
        """The numbers of rows that have what they should, one line an object."""
        chosen = [self.values[self.begin[row] : self.begin[row + 1]] for row in rows]
        return (np.concatenate(chosen) if chosen else np.empty(0)).reshape(-1, self.width)


def _objects(scene: Scene, queries: pa.RecordBatch, rows: np.ndarray, refusals: dict[int, str]) -> dict[int, np.ndarray]:
    """The ids of the objects of each row, where all are known."""
    if "objects" not in queries.schema.names:
        return dict.fromkeys(map(int, rows), scene._movable)
    kind = queries.schema.field("objects").type
    # Views of lists are there in newer versions.
    tests = ("is_list", "is_large_list", "is_fixed_size_list", "is_list_view", "is_large_list_view")
    is_list = any(getattr(pa.types, test)(kind) for test in tests if hasattr(pa.types, test))
    if not (pa.types.is_null(kind) or is_list):
        raise ValueError(f'column "objects": expected lists of names, found {kind}')
    ids = {}
    for row, names in zip(map(int, rows), queries.column("objects").take(pa.array(rows)).to_pylist()):
        names = scene.movable if names is None else names
        unknown = [name for name in names if name not in scene._ids]
        if unknown:
            known = ", ".join(map(repr, scene.movable[:8]))
            refusals[row] = f"objects: expected names of the scene's objects ({known} …), found {unknown[0]!r}"
        else:
            ids[row] = np.array([scene._ids[name] for name in names], np.uint32)
    return ids


def _of_scene(scene: Scene, queries: pa.RecordBatch, rows: np.ndarray, refusals: dict[int, str], options: tuple) -> pa.Table:
    """The answers to the rows of one scene, in their order."""
    lists = {name: _Lists(queries, name) for name in _POSES}
    start, end, turn = lists.values()
    ids = _objects(scene, queries, rows, refusals)
    for row in list(ids):
        count = len(ids[row])
        wrong = next((c for c in lists.values() if c.given[row] and c.length[row] != c.width * count), None)
        if wrong is not None:
            refusals[row] = f"{wrong.name}: expected {wrong.width} numbers for each of {count} objects, found {wrong.length[row]}"
        elif not (start.given[row] or end.given[row]):
            refusals[row] = "expected start or end, found neither"
        elif turn.given[row] and not end.given[row]:
            refusals[row] = "turn: expected end beside it, found none"
        else:
            continue
        del ids[row]
    good = np.array(list(ids), np.int64)
    counts = np.array([len(ids[int(row)]) for row in good], np.int64)
    has_start, has_end, has_turn = (c.given[good] for c in lists.values())
    offsets = np.concatenate([[0], np.cumsum(counts * (has_start.astype(np.int64) + has_end))]).astype(np.uint64)
    records = np.zeros(int(offsets[-1]), POSE)
    first = offsets[:-1].astype(np.int64)
    _fill(records, first, counts, has_start, good, ids, Order.START, start)
    _fill(records, first + counts * has_start, counts, has_end, good, ids, Order.END, end)
    if has_turn.any():
        at = _places(first + counts * has_start, counts, has_turn)
        records["flags"][at] = Order.TURN
        records["rotation"][at, :3] = turn.of(good[has_turn])
        records["rotation"][at, 3] = 0.0
    columns, refused = scene._native._solve(offsets.tobytes(), records.tobytes(), options)
    refusals.update((int(good[i]), sentence) for i, sentence in refused)
    bad = np.setdiff1d(rows, good)
    answers = [_answers(scene, columns, [refusals.get(int(row)) for row in good])]
    if len(bad):
        answers.append(_refused([refusals[int(row)] for row in bad]))
    order = np.argsort(np.concatenate([good, bad]), kind="stable")
    return pa.concat_tables(answers).take(pa.array(order))


def _places(first: np.ndarray, counts: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The places of the records of chosen rows: of each ``counts`` from ``first`` on."""
    first, counts = first[chosen], counts[chosen]
    ends = np.cumsum(counts)
    return np.repeat(first - (ends - counts), counts) + np.arange(ends[-1] if len(ends) else 0)


def _fill(
    records: np.ndarray,
    first: np.ndarray,
    counts: np.ndarray,
    chosen: np.ndarray,
    rows: np.ndarray,
    ids: dict[int, np.ndarray],
    order: Order,
    poses: _Lists,
) -> None:
    at = _places(first, counts, chosen)
    if not len(at):
        return
    values = poses.of(rows[chosen])
    records["object"][at] = np.concatenate([ids[int(row)] for row in rows[chosen]])
    records["flags"][at] = order
    records["position"][at] = values[:, :3]
    records["rotation"][at] = values[:, 3:]


def _answers(scene: Scene, columns: list[bytes], refusals: list[str | None]) -> pa.Table:
    """The columns of an answer from what the engine says."""
    kinds = (np.uint32, np.uint32, np.bool_, np.float64, np.uint64, CONTACT, DETAIL)
    status, counts, truncated, safe, cells, records, details = (np.frombuffer(c, kind) for c, kind in zip(columns, kinds))
    valid, flags = records["valid"], records["flags"]

    def words(names: list[str], values: np.ndarray, mask: np.ndarray) -> pa.Array:
        return pa.array(names, pa.string()).take(pa.array(values.astype(np.int64), mask=~mask))

    def numbers(values: np.ndarray, mask: np.ndarray) -> pa.Array:
        return pa.array(np.ascontiguousarray(values), pa.float64(), mask=~mask)

    def vectors(values: np.ndarray, mask: np.ndarray) -> pa.Array:
        offsets = pa.array(np.concatenate([[0], np.cumsum(3 * mask)]).astype(np.int32))
        return pa.ListArray.from_arrays(offsets, pa.array(values[mask].ravel(), pa.float64()), mask=pa.array(~mask))

    def features(side: str) -> pa.Array:
        faces = records[f"faces_{side}"]
        has = (faces != NO_FACE) & ((valid & Valid.FACES) != 0)[:, None]
        places = (faces.astype(np.int64) + scene._faces_of[records[side]][:, None])[has]
        offsets = np.concatenate([[0], np.cumsum(has.sum(axis=1))]).astype(np.int32)
        return pa.ListArray.from_arrays(pa.array(offsets), scene._faces.take(pa.array(places)))

    every = np.ones(len(records), bool)
    has_time, has_point = (valid & Valid.TIME) != 0, (valid & Valid.POINT) != 0
    has_kind, has_separation = (valid & Valid.KIND) != 0, (valid & Valid.SEPARATION) != 0
    is_deep = records["status"] == Status.OVERLAP
    fields = [
        scene._names.take(pa.array(records["a"])),
        scene._names.take(pa.array(records["b"])),
        words(STATUS_NAMES, records["status"], every),
        numbers(records["time"], has_time),
        numbers(records["time_lower"], has_time),
        numbers(details["time_upper"], has_time),
        pa.array((flags & Flag.TOUCHING) != 0),
        vectors(records["point"], has_point),
        vectors(records["normal"], (valid & Valid.NORMAL) != 0),
        numbers(records["separation"], has_separation),
        numbers(records["normal_speed"], (valid & Valid.NORMAL_SPEED) != 0),
        words(KIND_NAMES, records["kind"], has_kind),
        words(EXTENT_NAMES, records["extent"], has_kind),
        numbers(details["penetration"], is_deep & (details["penetration"] > 0.0)),
        numbers(details["resolution"], every),
        features("a"),
        features("b"),
        pa.array(details["cells"].astype(np.int64)),
    ]
    offsets = pa.array(np.concatenate([[0], np.cumsum(counts)]).astype(np.int32))
    contacts = pa.ListArray.from_arrays(offsets, pa.StructArray.from_arrays(fields, fields=list(CONTACT_TYPE)))
    said = np.where(status > 3, 0, status).astype(np.int64)
    answered = said != 0
    own = [
        pa.array(_STATUS, pa.string()).take(pa.array(said)),
        numbers(safe, answered),
        pa.array(truncated),
        pa.array(cells.astype(np.int64)),
        pa.array(refusals, pa.string()),
        contacts,
    ]
    return pa.table(dict(zip([name for name, _ in _ANSWER], own)))
