"""Layouts, enumerations and stubs agree with what the native module was compiled with."""

import ast
import dataclasses
import inspect
import pathlib

import numpy as np
import pytest

import contactd
from contactd import _native


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
        found = getattr(getattr(contactd, enumeration), member) if enumeration else getattr(contactd, member)
        assert found == number, (enumeration, member)
    counted = {}
    for enumeration, _, _ in _native.constants():
        counted[enumeration] = counted.get(enumeration, 0) + 1
    for enumeration, n in counted.items():
        if enumeration:
            assert len(getattr(contactd, enumeration)) == n, enumeration


def test_error_codes_are_the_protocols():
    codes = _native.error_codes()
    assert len(codes) == len(contactd.ErrorCode)
    for name, number, sentence in codes:
        snake = "".join("_" + c if c.isupper() else c.upper() for c in name).lstrip("_")
        assert contactd.ErrorCode(number).name == snake and len(sentence) > 10


def test_rules_know_the_protocols_words():
    words = dict(_native.words())
    with contactd.embedded() as session:
        known = [field.name for field in dataclasses.fields(contactd.Rule) if field.name in words]
        assert len(known) == 3
        for field in known:
            for word in words[field]:
                session.set_rules([contactd.Rule(("a", "b"), **{field: word})])
    assert contactd.KIND_NAMES[1] == "face-face" and contactd.EXTENT_NAMES[3] == "patch"
    assert [s.name.lower() for s in contactd.Status] == contactd.STATUS_NAMES[1:]


def written(function, bound):
    """The arguments of a stub's function, each with its default as text; without the one it is bound to."""
    args = function.args
    assert not args.kwonlyargs and args.vararg is args.kwarg is None
    named = [*args.posonlyargs, *args.args]
    defaults = [None] * (len(named) - len(args.defaults)) + [ast.unparse(d) for d in args.defaults]
    return [(a.arg, d) for a, d in zip(named, defaults)][bound:]


def real(function, bound):
    """The same of the native one."""
    told = list(inspect.signature(function).parameters.values())[bound:]
    defaults = [None if p.default is p.empty else "..." if p.default is ... else repr(p.default) for p in told]
    return [(p.name, d) for p, d in zip(told, defaults)]


def is_property(node):
    return isinstance(node, ast.AnnAssign) or any(getattr(d, "id", "") == "property" for d in node.decorator_list)


def test_the_stubs_are_what_the_native_module_has():
    folder = pathlib.Path(contactd.__file__).parent
    assert (folder / "py.typed").is_file()
    tree = ast.parse((folder / "_native.pyi").read_text())
    stubs = {}
    for node in tree.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            stubs[node.name] = node
        elif isinstance(node, ast.AnnAssign) and (node.target.id[0] != "_" or node.target.id == "__version__"):
            stubs[node.target.id] = node
    assert {n for n in vars(_native) if not n.startswith("__") or n == "__version__"} == set(stubs)
    for name, node in stubs.items():
        native = getattr(_native, name)
        if isinstance(node, ast.FunctionDef):
            assert real(native, 0) == written(node, 0), name
        if not isinstance(node, ast.ClassDef):
            continue
        members = {n.name if isinstance(n, ast.FunctionDef) else n.target.id: n for n in node.body if not isinstance(n, ast.Expr)}
        public = {m for m in vars(native) if not m.startswith("__")}
        assert public == {m for m in members if not m.startswith("__")}, name
        for member in public:
            found, told = vars(native)[member], members[member]
            assert inspect.isgetsetdescriptor(found) == is_property(told), f"{name}.{member}"
            if not is_property(told):
                assert real(found, 1) == written(told, 1), f"{name}.{member}"
        made = members.get("__new__")
        assert real(native, 0) == (written(made, 1) if made else []), name
        if made is None:
            with pytest.raises(TypeError):
                native()


def test_all_is_what_there_is():
    assert all(hasattr(contactd, name) for name in contactd.__all__)
    assert {"connect", "embedded", "Session", "Reply", "View", "Rule", "POSE", "CONTACT"} <= set(contactd.__all__)
    assert np.dtype(contactd.POSE) is contactd.POSE
