"""``contactd batch``: the queries of Parquet files, answered part by part into a folder; for arrays of jobs, and to be gone on with.

Parts are named by where their rows stand in the input, and get their name when they are whole: a run that was killed is gone on with by
starting it again, no row is lost and none is there twice. A shard is every n-th part, so shards need not know of each other.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import pathlib
import sys
import tempfile
import time
from typing import Iterator, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from . import _native
from .batch import Solver, answer_schema
from .errors import Error

_ABOUT = "_contactd.json"


class Part(NamedTuple):
    """A part of the input: rows of one row group of one file."""

    file: pathlib.Path
    #: The row group in its file.
    group: int
    #: Its first row in the group, and how many it has.
    row: int
    rows: int
    #: The name of its answers' file.
    name: str


def inputs(path: pathlib.Path) -> list[pathlib.Path]:
    """The Parquet files of an input: itself, or those of a folder by their names."""
    if not path.is_dir():
        return [path]
    files = sorted(p for p in path.glob("**/*.parquet") if not p.name.startswith(("_", ".")))
    if not files:
        raise ValueError(f"{path}: expected Parquet files in the folder, found none")
    return files


def parts(files: list[pathlib.Path], rows: int) -> list[Part]:
    """All parts of some files, in the order of their rows."""
    found, group = [], 0
    for file in files:
        about = pq.read_metadata(file)
        for i in range(about.num_row_groups):
            whole = about.row_group(i).num_rows
            for at in range(0, whole, rows):
                name = f"part-{group:06d}-{at // rows:06d}.parquet"
                found.append(Part(file, i, at, min(rows, whole - at), name))
            group += 1
    return found


def read(wanted: list[Part]) -> Iterator[tuple[Part, pa.Table]]:
    """The rows of some parts. A row group is read in pieces: memory is bounded by a part, not by the input."""
    by_group: dict[tuple[pathlib.Path, int], list[Part]] = {}
    for part in wanted:
        by_group.setdefault((part.file, part.group), []).append(part)
    for (file, group), own in by_group.items():
        with pq.ParquetFile(file) as opened:
            pieces, before, left = [], 0, iter(own)
            part = next(left)
            for batch in opened.iter_batches(batch_size=min(part.rows, 65536) or 1, row_groups=[group]):
                at = 0
                while part is not None and before + batch.num_rows > part.row:
                    begin = max(part.row - before, at)
                    end = min(part.row + part.rows - before, batch.num_rows)
                    pieces.append(batch.slice(begin, end - begin))
                    at = end
                    if before + end < part.row + part.rows:
                        break
                    yield part, pa.Table.from_batches(pieces)
                    pieces, part = [], next(left, None)
                before += batch.num_rows
                if part is None:
                    break


def _about(files: list[pathlib.Path], all_parts: list[Part], solver: Solver, rows: int) -> dict:
    """What a folder of parts must agree in, so that they are parts of one run."""
    footer = hashlib.sha256()
    for file in files:
        footer.update(repr((file.name, file.stat().st_size)).encode())
        # The footer has the place, size and statistics of every piece of the file.
        with open(file, "rb") as opened:
            opened.seek(-8, os.SEEK_END)
            length = int.from_bytes(opened.read(4), "little")
            opened.seek(-8 - length, os.SEEK_END)
            footer.update(opened.read(length))
    return {
        "contactd": _native.__version__,
        "input": footer.hexdigest(),
        "scenes": hashlib.sha256(solver.key.encode()).hexdigest(),
        "rows_of_a_part": rows,
        "parts": len(all_parts),
        "rows": sum(part.rows for part in all_parts),
    }


def _claim(folder: pathlib.Path, about: dict) -> None:
    """Makes the folder this run's, or sees that it is."""
    folder.mkdir(parents=True, exist_ok=True)
    mark = folder / _ABOUT
    if not mark.exists():
        foreign = [p.name for p in folder.iterdir() if not p.name.startswith(".")]
        if foreign and not mark.exists():
            raise ValueError(f"{folder}: expected a new or empty folder, found {foreign[0]}")
        _write(mark, lambda path: pathlib.Path(path).write_text(json.dumps(about, indent=1) + "\n"))
    found = json.loads(mark.read_text())
    differs = [name for name in about if found.get(name) != about[name]]
    if differs:
        raise ValueError(
            f"{folder}: expected parts of this run, found those of another one ({', '.join(differs)} differ); choose another folder, or remove it"
        )


def _write(path: pathlib.Path, write) -> None:
    """A file that is there whole or not at all, whenever the process or the machine ends."""
    prefix = f".unfinished-{path.name}-"
    handle, name = tempfile.mkstemp(prefix=prefix, dir=path.parent)
    os.close(handle)
    try:
        write(name)
        with open(name, "rb") as written:
            os.fsync(written.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except FileNotFoundError:
        # Another process has written the same one meanwhile, and taken this one for one that is left.
        if not path.exists():
            raise
    finally:
        pathlib.Path(name).unlink(missing_ok=True)
    # Those of processes that were killed over it, or that write the same.
    for left in path.parent.glob(f"{prefix}*"):
        left.unlink(missing_ok=True)


def run(
    source: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    solver: Solver,
    *,
    shard: tuple[int, int] = (1, 1),
    rows: int = 65536,
    progress=lambda done, all, table: None,
) -> int:
    """Answers the queries of Parquet files into a folder of Parquet files; returns how many rows it has answered now.

    ``source``: a file, or a folder of them. ``shard``: (i, n), the i-th of n shares, from 1. ``rows``: of a part. Parts that are there
    are left as they are. ``progress`` is called with rows done, rows of the shard, and the answers of a part, or None for those that
    were there.
    """
    files = inputs(pathlib.Path(source))
    every = parts(files, rows)
    for file in files:
        answer_schema(pq.read_schema(file))
    folder = pathlib.Path(folder)
    _claim(folder, _about(files, every, solver, rows))
    own = every[shard[0] - 1 :: shard[1]]
    left = [part for part in own if not (folder / part.name).exists()]
    total = sum(part.rows for part in own)
    done = total - sum(part.rows for part in left)
    before = done
    progress(done, total, None)
    for part, queries in read(left):
        answers = solver.solve(queries)
        _write(folder / part.name, lambda path: pq.write_table(answers, path))
        done += part.rows
        progress(done, total, answers)
    return done - before


class _Bar:
    """A line on a terminal's standard error, and at the end the counts."""

    def __init__(self):
        self.counts = dict.fromkeys(("contact", "clear", "undecided", "refused"), 0)
        self.begun, self.before, self.shows = time.monotonic(), 0, sys.stderr.isatty()

    def __call__(self, done: int, total: int, answers: pa.Table | None) -> None:
        if answers is None:
            self.before = done
        else:
            for item in answers["status"].value_counts().to_pylist():
                self.counts[item["values"]] += item["counts"]
        if not self.shows:
            return
        rate = (done - self.before) / max(time.monotonic() - self.begun, 1e-9)
        left = f"{(total - done) / rate:,.0f} s left" if rate > 0 and done > self.before else "…"
        bar = "#" * (24 * done // max(total, 1))
        print(f"\r[{bar:24}] {done:,} of {total:,} rows, {rate:,.0f}/s, {left}\x1b[K", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self.shows:
            print(file=sys.stderr)


def _shard(text: str) -> tuple[int, int]:
    words = text.split("/")
    if len(words) == 2 and all(w.isdecimal() for w in words) and 1 <= int(words[0]) <= int(words[1]):
        return int(words[0]), int(words[1])
    raise argparse.ArgumentTypeError(f"expected I/N with 1 <= I <= N, found {text}")


def _count(text: str) -> int:
    if text.isdecimal() and int(text) > 0:
        return int(text)
    raise argparse.ArgumentTypeError(f"expected a number above 0, found {text}")


def _length(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if 0 < value < math.inf:
        return value
    raise argparse.ArgumentTypeError(f"expected a length above 0, found {text}")


def _scenes(texts: list[str]) -> str | dict[str, str]:
    """``FILE`` alone, or ``NAME=FILE`` for each scene."""
    if len(texts) == 1 and ("=" not in texts[0] or os.path.exists(texts[0])):
        return texts[0]
    named: dict[str, str] = {}
    for text in texts:
        name, is_named, file = text.partition("=")
        if not is_named or name in named:
            raise ValueError(f"--scene {text}: expected NAME=FILE, each name once, where there are several")
        named[name] = file
    return named


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="contactd batch",
        description="Answers the queries of Parquet files into a folder of Parquet files (columns: docs/scale.md). "
        "Started again it goes on where it was killed.",
    )
    parser.add_argument("source", metavar="IN", help="a Parquet file, or a folder of them")
    parser.add_argument("folder", metavar="OUT", help="folder of the answers' parts, made if need be")
    parser.add_argument("--scene", action="append", required=True, metavar="[NAME=]FILE", help="the scene's .toml file; several by the names that the column scene has")
    parser.add_argument("--shard", type=_shard, default=(1, 1), metavar="I/N", help="the I-th of N shares, such as $SLURM_ARRAY_TASK_ID of an array's")
    parser.add_argument("--rows", type=_count, default=65536, metavar="N", help="rows of a part (65536)")
    parser.add_argument("--threads", type=_count, default=0, metavar="N", help="all of the machine, if it is not said")
    parser.add_argument("--resolution", type=_length, metavar="LENGTH", help="in place of the scenes' own")
    parser.add_argument("--first", action="store_true", help="only the pairs that meet first")
    parser.add_argument("--clear", action="store_true", help="clear pairs, too")
    parser.add_argument("--max-records", type=_count, default=0, metavar="N", help="most contacts of a query, the earliest")
    parser.add_argument("--cell-limit", type=_count, default=0, metavar="N", help="most cells of a pair's search")
    parser.add_argument("--batch-limit", type=_count, default=0, metavar="N", help="most cells of all searches of a query")
    parser.add_argument("--cache", metavar="DIR", help="folder for preprocessed models")
    return parser


def main(arguments: list[str]) -> int:
    """The command; its exit status: 0 done, 2 it cannot be done. Rows that are refused say why, and are counted."""
    asked = _parser().parse_args(arguments)
    bar = _Bar()
    try:
        options = {name: getattr(asked, name) for name in ("resolution", "first", "clear", "max_records", "cell_limit", "batch_limit", "threads", "cache")}
        solver = Solver(_scenes(asked.scene), **options)
        answered = run(asked.source, asked.folder, solver, shard=asked.shard, rows=asked.rows, progress=bar)
    except (Error, OSError, ValueError, pa.ArrowException) as error:
        bar.end()
        print(f"contactd batch: {error}", file=sys.stderr)
        return 2
    bar.end()
    counts = ", ".join(f"{n:,} {word}" for word, n in bar.counts.items() if n)
    print(f"{answered:,} rows answered" + (f": {counts}" if counts else "") + (f"; {bar.before:,} were there" if bar.before else ""))
    return 0
