"""Layouts, enumerations and stubs agree with what the native module was compiled with."""

import ast
import pathlib

import numpy as np
import pytest

import contactd
from contactd import _native, records


@pytest.mark.parametrize(
    ("dtype", "size"), [("POSE", 64), ("CONTACT", 128), ("DETAIL", 128), ("REGION", 128), ("PATCH", 128)]
)
def test_a_record_has_no_gaps(dtype, size):
    dtype = getattr(contactd, dtype)
    assert dtype.itemsize == size
    at = 0
    for name in dtype.names:
        field, offset = dtype.fields[name]
        assert offset == at and offset % field.base.alignment == 0, name
        at += field.itemsize
    assert at == size


def test_the_fields_are_the_records():
    # A record filled in by Rust and read here: the layout is not only consistent but the same.
    with contactd.embedded() as session:
        ball = session.load_model("ball.csg", "sphere(r = 1);")
        first, second = (session.add_object(n, ball, at=(x, 0, 0)) for n, x in (("a", 0), ("b", 10)))
        session.options.details = True
        session.begin_step(1)[0] = contactd.turn(second, (0, 0, 0), (0, 0, 1))
        record = session.finish()[0]
        assert (record.a, record.b, record.status, record.kind) == (first, second, 1, 1)
        assert record.time == pytest.approx(0.8) and record.normal.tolist() == pytest.approx([1, 0, 0])
        assert record.faces_a.tolist() == [0, contactd.NO_FACE, contactd.NO_FACE] and record.slots == 1


def test_enumerations_have_the_protocols_numbers():
    for enumeration, member, number in _native.constants():
        found = getattr(getattr(records, enumeration), member) if enumeration else getattr(records, member)
        assert found == number, (enumeration, member)
    counted = {}
    for enumeration, _, _ in _native.constants():
        counted[enumeration] = counted.get(enumeration, 0) + 1
    for enumeration, n in counted.items():
        if enumeration:
            assert len(getattr(records, enumeration)) == n, enumeration


def test_error_codes_are_the_protocols():
    codes = _native.error_codes()
    assert len(codes) == len(contactd.ErrorCode)
    for name, number, sentence in codes:
        snake = "".join("_" + c if c.isupper() else c.upper() for c in name).lstrip("_")
        assert contactd.ErrorCode(number).name == snake and len(sentence) > 10


def test_rules_know_the_protocols_words():
    words = dict(_native.words())
    with contactd.embedded() as session:
        for field in ("detect", "report", "initial_overlap"):
            for word in words[field]:
                session.set_rules([contactd.Rule(("a", "b"), **{field: word})])
    assert contactd.KIND_NAMES[1] == "face-face" and contactd.EXTENT_NAMES[3] == "patch"
    assert [s.name.lower() for s in contactd.Status] == contactd.STATUS_NAMES[1:]


def test_the_stubs_name_what_the_native_module_has():
    folder = pathlib.Path(contactd.__file__).parent
    assert (folder / "py.typed").is_file()
    tree = ast.parse((folder / "_native.pyi").read_text())
    stubs = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            stubs[node.name] = {
                n.name if isinstance(n, ast.FunctionDef) else n.target.id
                for n in node.body
                if isinstance(n, (ast.FunctionDef, ast.AnnAssign))
            }
        elif isinstance(node, ast.FunctionDef):
            stubs[node.name] = None
        elif isinstance(node, ast.AnnAssign):
            if node.target.id[0] != "_" or node.target.id == "__version__":
                stubs[node.target.id] = None
    real = {n for n in vars(_native) if not n.startswith("__") or n == "__version__"}
    assert real == set(stubs)
    for name, members in stubs.items():
        if members is not None:
            public = {m for m in vars(getattr(_native, name)) if not m.startswith("__")}
            assert public == {m for m in members if not m.startswith("__")}, name


def test_all_is_what_there_is():
    assert all(hasattr(contactd, name) for name in contactd.__all__)
    assert {"connect", "embedded", "Session", "Reply", "View", "Rule", "POSE", "CONTACT"} <= set(contactd.__all__)
    assert np.dtype(contactd.POSE) is contactd.POSE
