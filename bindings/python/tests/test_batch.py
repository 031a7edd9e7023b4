"""Tables of queries, against sessions that were made for each row, whole and in parts, and by processes that are killed."""

import json
import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import contactd

pa = pytest.importorskip("pyarrow", reason="the package pyarrow is not installed: pip install 'contactd[batch]'")
import pyarrow.parquet as pq  # noqa: E402

import contactd.batch  # noqa: E402
import contactd.ray  # noqa: E402

#: Rows of the random tables; long: CONTACTD_BATCH_ROWS=20000.
ROWS = int(os.environ.get("CONTACTD_BATCH_ROWS", "300"))

MODELS = {
    "plate": "difference() { cube(size = [40, 40, 4], center = true); cylinder(h = 9, r1 = 3, r2 = 3, center = true); }",
    "peg": "cylinder(h = 20, r1 = 2.5, r2 = 2.9, center = true);",
    "ball": "sphere(r = 3);",
    "ring": "rotate_extrude(angle = 360, $fn = 0) translate([5, 0, 0]) circle(r = 1.5);",
    "block": "cube(size = [6, 4, 5], center = true);",
}


def quaternion(rng):
    q = np.array([rng.gauss(0, 1) for _ in range(4)])
    return (q / np.linalg.norm(q)).tolist()


def pose(rng, spread=18.0):
    return [rng.uniform(-spread, spread) for _ in range(3)] + quaternion(rng)


def scene_of(rng, folder, name):
    """A random scene: its file, and its objects as name, model, fixed, pose."""
    folder.mkdir(parents=True, exist_ok=True)
    for model, text in MODELS.items():
        (folder / f"{model}.csg").write_text(text)
    objects = []
    for i in range(rng.randint(2, 5)):
        objects.append((f"{name}{i}", rng.choice(list(MODELS)), i == 0 and rng.random() < 0.7, pose(rng)))
    lines = [f'[[model]]\nname = "{model}"\nfile = "{model}.csg"\n' for model in MODELS]
    for object, model, fixed, at in objects:
        motion = 'motion = "static"\n' if fixed else ""
        lines.append(
            f'[[object]]\nname = "{object}"\nmodel = "{model}"\n{motion}start = {{ position = {at[:3]}, rotation = {at[3:]} }}\n'
        )
    path = folder / f"{name}.toml"
    path.write_text("\n".join(lines))
    return path, objects


def row_of(rng, scenes):
    name = rng.choice(list(scenes))
    movable = [object for object, _, fixed, _ in scenes[name][1] if not fixed]
    all_of_them = rng.random() < 0.3
    moved = movable if all_of_them else rng.sample(movable, rng.randint(1, len(movable)))
    row = {"scene": name, "objects": None if all_of_them else moved, "start": None, "end": None, "turn": None}
    near = rng.choice([6.0, 18.0])
    if rng.random() < 0.7:
        row["start"] = [x for _ in moved for x in pose(rng, near)]
    if row["start"] is None or rng.random() < 0.85:
        row["end"] = [x for _ in moved for x in pose(rng, near)]
        if rng.random() < 0.3:
            row["turn"] = [rng.uniform(-7, 7) for _ in moved for _ in range(3)]
    return row


def spoiled(rng, row):
    """The row with something wrong, and a word of the sentence that says so."""
    kind = rng.choice(["scene", "object", "length", "nan", "quaternion", "neither", "far"])
    row = dict(row)
    if kind == "scene":
        return row | {"scene": rng.choice([None, "nowhere"])}, "scene: expected one of"
    if kind == "object":
        return row | {"objects": ["nobody"]}, "found 'nobody'"
    if kind == "neither":
        return row | {"start": None, "end": None, "turn": None}, "found neither"
    field = "end" if row["end"] is not None else "start"
    values = list(row[field])
    if kind == "length":
        return row | {field: values[:-1]}, f"{field}: expected 7 numbers"
    if kind == "quaternion" and (field == "start" or row["turn"] is None):
        values[3:7] = [1.0, 1.0, 1.0, 1.0]
        return row | {field: values}, f": {field}: "
    values[rng.randrange(3)] = {"far": 1e200}.get(kind, rng.choice([float("nan"), float("inf"), None]))
    return row | {field: values}, f": {field}: "


def table_of(rows):
    numbers = pa.list_(pa.float64())
    schema = [("id", pa.int64()), ("scene", pa.string()), ("objects", pa.list_(pa.string()))]
    schema += [("start", numbers), ("end", numbers), ("turn", numbers)]
    return pa.Table.from_pylist([{"id": i, **row} for i, row in enumerate(rows)], pa.schema(schema))


def asked_alone(scenes, row):
    """What a session says that was made for a row: statuses, records with details, header."""
    path, objects = scenes[row["scene"]]
    with contactd.embedded() as session:
        models = {m: session.load_model(f"{m}.csg", text) for m, text in MODELS.items()}
        ids = {}
        for name, model, fixed, at in objects:
            ids[name] = session.add_object(name, models[model], fixed=fixed, at=(at[:3], at[3:]))
        moved = row["objects"] if row["objects"] is not None else [o for o, _, fixed, _ in objects if not fixed]
        batch = []
        for i, name in enumerate(moved):
            if row["start"] is not None:
                at = row["start"][7 * i : 7 * i + 7]
                batch.append(contactd.start(ids[name], at[:3], at[3:]))
        for i, name in enumerate(moved):
            if row["end"] is not None:
                at = row["end"][7 * i : 7 * i + 7]
                turn = row["turn"] and row["turn"][3 * i : 3 * i + 3]
                batch.append(contactd.turn(ids[name], at[:3], turn) if turn else contactd.end(ids[name], at[:3], at[3:]))
        session.options.details = True
        reply = session.step(batch)
        names = {id: name for name, id in ids.items()}
        found = []
        for i, r in enumerate(reply.records):
            detail = reply.detail(i)
            valid = int(r["valid"])
            has = lambda flag: bool(valid & flag)  # noqa: E731
            faces = lambda of, id: [  # noqa: E731
                face_name(models[next(m for n, m, _, _ in objects if n == names[int(id)])].faces[f])
                for f in of.tolist()
                if f != contactd.NO_FACE and has(contactd.Valid.FACES)
            ]
            found.append(
                {
                    "a": names[int(r["a"])],
                    "b": names[int(r["b"])],
                    "status": contactd.STATUS_NAMES[int(r["status"])],
                    "time": float(r["time"]) if has(contactd.Valid.TIME) else None,
                    "time_lower": float(r["time_lower"]) if has(contactd.Valid.TIME) else None,
                    "time_upper": float(detail["time_upper"]) if has(contactd.Valid.TIME) else None,
                    "touching": bool(int(r["flags"]) & contactd.Flag.TOUCHING),
                    "point": r["point"].tolist() if has(contactd.Valid.POINT) else None,
                    "normal": r["normal"].tolist() if has(contactd.Valid.NORMAL) else None,
                    "separation": float(r["separation"]) if has(contactd.Valid.SEPARATION) else None,
                    "normal_speed": float(r["normal_speed"]) if has(contactd.Valid.NORMAL_SPEED) else None,
                    "kind": contactd.KIND_NAMES[int(r["kind"])] if has(contactd.Valid.KIND) else None,
                    "extent": contactd.EXTENT_NAMES[int(r["extent"])] if has(contactd.Valid.KIND) else None,
                    "resolution": float(detail["resolution"]),
                    "features_a": faces(r["faces_a"], r["a"]),
                    "features_b": faces(r["faces_b"], r["b"]),
                    "cells": int(detail["cells"]),
                }
            )
        return reply.status.name.lower(), reply.safe_time, found


def face_name(face):
    return f"{face.face} of {'subtracted ' if face.subtracted else ''}{face.name} {face.primitive}"


@pytest.fixture(scope="module")
def play(tmp_path_factory):
    """Random scenes, random rows, and what is wrong with some of them."""
    rng = random.Random(int(os.environ.get("CONTACTD_BATCH_SEED", "5")))
    folder = tmp_path_factory.mktemp("scenes")
    scenes = {name: scene_of(rng, folder / name, name) for name in ("s", "t", "u")}
    rows, wrong = [], {}
    for i in range(ROWS):
        row = row_of(rng, scenes)
        if rng.random() < 0.1:
            row, wrong[i] = spoiled(rng, row)
        rows.append(row)
    return {name: path for name, (path, _) in scenes.items()}, scenes, rows, wrong


def test_a_row_has_the_bits_of_a_session_that_was_made_for_it(play):
    paths, scenes, rows, wrong = play
    answers = contactd.batch.solve(table_of(rows), paths).to_pylist()
    assert [a["id"] for a in answers] == list(range(len(rows)))
    seen = dict.fromkeys(("clear", "contact", "refused"), 0)
    for i, (row, answer) in enumerate(zip(rows, answers)):
        seen[answer["status"]] = seen.get(answer["status"], 0) + 1
        if i in wrong:
            assert answer["status"] == "refused" and wrong[i] in answer["refusal"], (row, answer, wrong[i])
            assert answer["contacts"] == [] and answer["safe_time"] is None
            continue
        status, safe_time, found = asked_alone(scenes, row)
        assert (answer["status"], answer["safe_time"], answer["refusal"]) == (status, safe_time, None), row
        for contact in answer["contacts"]:
            contact.pop("penetration")
        assert answer["contacts"] == found, row
    assert min(seen.values()) >= len(rows) // 40, seen


def test_no_cut_no_order_and_no_number_of_threads_changes_a_bit(play):
    paths, _, rows, _ = play
    table = table_of(rows)
    whole = contactd.batch.solve(table, paths, threads=1)
    assert contactd.batch.solve(table, paths, threads=3).equals(whole)
    rng = random.Random(8)
    for _ in range(3):
        order = list(range(len(rows)))
        rng.shuffle(order)
        cuts = sorted(rng.sample(range(len(rows)), 7))
        checker = contactd.ray.Checker(paths)
        mixed = table.take(order)
        parts = [checker(mixed.slice(a, b - a)) for a, b in zip([0, *cuts], [*cuts, len(rows)])]
        again = pa.concat_tables(parts)
        assert again.take(np.argsort(order)).combine_chunks().equals(whole.combine_chunks())
    mapped = pa.Table.from_batches(contactd.batch.Mapper(paths)(table.to_batches(max_chunksize=41)))
    assert mapped.combine_chunks().equals(whole.combine_chunks())


def test_limits_and_options_are_a_rows_own(play):
    paths, _, rows, wrong = play
    table = table_of([row for i, row in enumerate(rows) if i not in wrong])
    for options in ({"first": True}, {"clear": True}, {"max_records": 1}, {"cell_limit": 1}, {"batch_limit": 1}, {"resolution": 1e-3}):
        whole = contactd.batch.solve(table, paths, **options)
        halves = [contactd.batch.solve(table.slice(at, len(table) // 2 + 1), paths, **options) for at in (0, len(table) // 2 + 1)]
        assert pa.concat_tables(halves).combine_chunks().equals(whole.combine_chunks()), options
        counts = [len(c) for c in whole["contacts"].to_pylist()]
        assert "max_records" not in options or max(counts) == 1
        assert "clear" not in options or min(counts) >= 1
    assert "undecided" in contactd.batch.solve(table, paths, cell_limit=1)["status"].to_pylist()


def test_tables_that_are_none_are_refused_in_one_sentence(play):
    paths, _, rows, _ = play
    table = table_of(rows[:5])
    one = next(iter(paths.values()))
    with pytest.raises(ValueError, match='expected a column "scene"'):
        contactd.batch.solve(table.drop_columns(["scene"]), paths)
    with pytest.raises(ValueError, match="columns status: expected other names"):
        contactd.batch.solve(table.append_column("status", pa.array([1] * 5)), paths)
    with pytest.raises(ValueError, match='column "end": expected lists of numbers, found string'):
        contactd.batch.solve({"end": ["here"]}, one)
    with pytest.raises(ValueError, match='column "objects": expected lists of names, found string'):
        contactd.batch.solve({"objects": ["bolt"], "end": [[0.0] * 7]}, one)
    # A number may be finite and yet too large.
    name = contactd.batch.Scene(one).movable[0]
    far = contactd.batch.solve({"objects": [[name]], "end": [[1e308, 0, 0, 0, 0, 0, 1]]}, one)
    assert "is farther than 1e150 away" in far.column("refusal")[0].as_py()
    with pytest.raises(contactd.Refused, match=r"nowhere\.toml: expected a readable file"):
        contactd.batch.solve(table, "nowhere.toml")
    none = contactd.batch.solve(table.slice(0, 0), paths)
    assert len(none) == 0 and none.schema == contactd.batch.answer_schema(table.schema)


def test_a_scene_that_was_changed_is_read_again(play, tmp_path):
    rng = random.Random(3)
    path, objects = scene_of(rng, tmp_path, "s")
    before = contactd.batch.Solver(path)
    assert contactd.batch.Solver(path).scenes[""] is before.scenes[""]
    (tmp_path / f"{objects[0][1]}.csg").write_text("sphere(r = 3.5);")
    after = contactd.batch.Solver(path)
    assert after.scenes[""] is not before.scenes[""] and after.key != before.key


def command(*arguments):
    return [sys.executable, "-m", "contactd", "batch", *map(str, arguments)]


def test_shards_that_are_killed_lose_no_row_and_give_none_twice(play, tmp_path):
    paths, _, rows, _ = play
    whole = table_of(rows * 8)
    whole = whole.set_column(0, "id", pa.array(range(len(whole))))
    source, out = tmp_path / "in", tmp_path / "out"
    source.mkdir()
    third = len(whole) // 3
    pq.write_table(whole.slice(0, third), source / "a.parquet", row_group_size=130)
    pq.write_table(whole.slice(third), source / "b.parquet", row_group_size=777)
    scenes = [f"--scene={name}={path}" for name, path in paths.items()]
    rng = random.Random(1)
    shards, kills = 3, 0
    left = set(range(1, shards + 1))
    while left:
        shard = rng.choice(sorted(left))
        process = subprocess.Popen(
            command(source, out, *scenes, f"--shard={shard}/{shards}", "--rows=50", "--threads=1"),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        if kills < 10:
            # As soon as it has done something more, at the latest.
            before, until = len(list(out.glob("part*"))), time.monotonic() + 20
            goal = before + rng.randint(0, 4)
            while process.poll() is None and len(list(out.glob("part*"))) <= goal and time.monotonic() < until:
                time.sleep(0.001)
            kills += process.poll() is None
            process.send_signal(signal.SIGKILL)
        said, complained = process.communicate()
        if process.returncode == 0:
            left.discard(shard)
        else:
            assert process.returncode == -signal.SIGKILL, (said, complained)
    assert kills == 10
    assert not list(out.glob(".unfinished-part*")), "of processes that were killed"
    answers = pa.concat_tables([pq.read_table(p) for p in sorted(out.glob("part*.parquet"))])
    assert answers["id"].to_pylist() == list(range(len(whole)))
    assert answers.combine_chunks().equals(contactd.batch.solve(whole, paths).combine_chunks())
    # Those who read the folder as a whole see the rows alone.
    assert pq.read_table(out).num_rows == len(whole)
    # Again: nothing is left to do; and nothing of another run is mixed with it.
    again = subprocess.run(command(source, out, *scenes, "--rows=50"), capture_output=True, text=True)
    assert again.returncode == 0 and f"0 rows answered; {len(whole):,} were there" in again.stdout, again
    other = subprocess.run(command(source, out, *scenes, "--rows=50", "--clear"), capture_output=True, text=True)
    assert other.returncode == 2 and "expected parts of this run, found those of another one (scenes differ)" in other.stderr, other
    assert other.stderr.count("\n") == 1


def test_the_command_refuses_in_one_sentence_and_touches_nothing(play, tmp_path):
    paths, _, rows, _ = play
    path = next(iter(paths.values()))
    source = tmp_path / "in.parquet"
    pq.write_table(table_of(rows[:3]).drop_columns(["scene"]), source)
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "letter.txt").write_text("dear")
    (tmp_path / "empty").mkdir()
    for arguments, sentence in [
        ((source, tmp_path / "own", "--scene", path), "expected a new or empty folder, found letter.txt"),
        ((tmp_path / "empty", tmp_path / "o", "--scene", path), "expected Parquet files in the folder, found none"),
        ((path, tmp_path / "o", "--scene", path), "Parquet"),
        ((source, tmp_path / "o", "--scene", tmp_path / "no.toml"), "no.toml: expected a readable file"),
        ((source, tmp_path / "o", "--scene", "a=b", "--scene", "c"), "--scene c: expected NAME=FILE"),
        ((source, tmp_path / "o", "--scene", path, "--shard", "3/2"), "expected I/N with 1 <= I <= N, found 3/2"),
    ]:
        done = subprocess.run(command(*arguments), capture_output=True, text=True)
        assert done.returncode == 2 and sentence in done.stderr, (arguments, done)
        assert "Traceback" not in done.stderr
    assert (tmp_path / "own" / "letter.txt").read_text() == "dear" and len(list((tmp_path / "own").iterdir())) == 1
    done = subprocess.run(command(source, tmp_path / "o", "--scene", path), capture_output=True, text=True)
    assert done.returncode == 0 and "3 rows answered" in done.stdout, done
    about = json.loads((tmp_path / "o" / "_contactd.json").read_text())
    assert about["rows"] == 3 and about["parts"] == 1
