"""Views into a session's memory that know when their step is over.

A ``View`` behaves as the numpy array it stands for: indexing, fields, arithmetic, numpy's functions, methods. What it gives of the
same memory is a ``View`` again; what is computed is an array of its own. Once its step is over whatever reads or writes its
elements raises ``Stale`` (its shape and type stay told). A view never keeps its session from going on, so loops need no ``del``.

``numpy.asarray(view)`` gives a plain array over the same memory, for code that needs one. Nothing can be asked of it later, so it
is counted: while one lives (or anything numpy made of it), the session refuses to send its poses, or to begin the next step,
with ``StillExported``, a ``BufferError``. Passing a view to a function that converts it, as most of scipy, matplotlib or mujoco, is
fine: its array is gone when the function returns. ``view.copy()`` and ``numpy.array(view)`` give arrays that may be kept.

numpy itself gets the plain array, for as long as a call of it lasts, where it runs nothing of the caller's meanwhile: such code (a
function that numpy calls back, an index or operand of a class of its own) could keep the array, or end the step. Where it
may, numpy gets a counted one.
"""

from __future__ import annotations

from types import EllipsisType, NoneType
from typing import Any, Iterator

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from . import _native
from ._native import Lease

# Ways to the memory that neither a check nor a count would see.
_CLOSED = frozenset({"base", "ctypes", "data", "flat", "getfield", "resize", "setfield", "setflags", "view"})

# Types and classes whose use runs nothing of the caller's, and numpy's own functions of elements.
_PLAIN = frozenset({NoneType, EllipsisType, bool, int, float, complex, str, bytes})
_UFUNCS = frozenset(f for f in vars(np).values() if isinstance(f, np.ufunc))

_MOST = {n: 256**n - 1 for n in (1, 2, 4, 8)}


class View(NDArrayOperatorsMixin):
    """An array in the memory of one step, valid until that step is over."""

    __slots__ = ()
    __hash__ = None  # type: ignore[assignment]

    #: The array it stands for, never touched but after its lease was asked.
    _array: np.ndarray
    _lease: Lease

    # What is read

    def __getitem__(self, key: Any) -> Any:
        kind, counted = type(key), False
        if kind is not str and kind is not int:  # by far the most keys are
            counted = not _is_plain(key)
            key = _inner_of(key, [], counted)
        array = _inner(self, True) if counted else self._checked()
        found = array[key]
        if type(found) is np.void:
            # A record: numpy's own would look at the memory without asking.
            key = key if type(key) is tuple else (key,)
            found = array[(*key, ...)]
        if type(found) is np.ndarray:
            if found.ndim == 0 and found.dtype.names is None:
                return found[()]
            base = found.base
            if base is array or base is array.base:
                return Part(_uncounted(found, self._lease) if counted else found, self._lease)
        return found  # a number, or chosen by a list or a mask: a copy

    def __getattr__(self, name: str) -> Any:
        array = self._array
        if array.dtype.names is not None and name in array.dtype.names:
            return self[name]
        if name.startswith("_") or name in _CLOSED:
            raise AttributeError(f"a view has no attribute {name!r}; take numpy.asarray(view) or view.copy() for it")
        self._lease.check()
        found = getattr(array, name)
        if not callable(found):
            return _own_of(found, [self._lease], False)

        def method(*args: Any, **kwargs: Any) -> Any:
            counted = not (_is_plain(args) and _is_plain(kwargs))
            leases = [self._lease]
            args, kwargs = _inner_of(args, leases, counted), _inner_of(kwargs, leases, counted)
            return _own_of(getattr(_inner(self, counted), name)(*args, **kwargs), leases, counted)

        return method

    def __len__(self) -> int:
        self._lease.check()
        return len(self._array)

    def __iter__(self) -> Iterator[Any]:
        for i in range(len(self)):
            yield self[i]

    def __contains__(self, value: Any) -> bool:
        return value in _inner(self, not _is_plain(value))

    def __bool__(self) -> bool:
        return bool(self._checked())

    def __int__(self) -> int:
        return int(self._checked())

    def __float__(self) -> float:
        return float(self._checked())

    def __repr__(self) -> str:
        if not self._lease.alive:
            return "<view of a step that is over>"
        return f"View({self.__array__()!r})"  # the caller may have told numpy how numbers are written

    def __str__(self) -> str:
        return str(self.__array__())

    @property
    def dtype(self) -> np.dtype:
        """Type of its elements."""
        return self._array.dtype

    @property
    def shape(self) -> tuple[int, ...]:
        """Its shape."""
        return self._array.shape

    @property
    def ndim(self) -> int:
        """Number of its axes."""
        return self._array.ndim

    @property
    def size(self) -> int:
        """Number of its elements."""
        return self._array.size

    @property
    def alive(self) -> bool:
        """False once its step is over."""
        return self._lease.alive

    def copy(self) -> np.ndarray:
        """An array of its own that may be kept."""
        return self._checked().copy()

    def __copy__(self) -> np.ndarray:
        return self.copy()

    def __deepcopy__(self, memo: Any) -> np.ndarray:
        return self.copy()

    def __reduce_ex__(self, protocol: Any) -> Any:
        return self.copy().__reduce_ex__(protocol)

    # What is written

    def __setitem__(self, key: Any, value: Any) -> None:
        self._assign(key, value)

    def _assign(self, key: Any, value: Any) -> None:
        self._lease.check()
        counted = not _is_plain(key)
        array = _inner(self, counted)
        name = key
        key = _inner_of(key, [], counted)
        dtype = array.dtype
        if type(key) is str and dtype.names is not None:
            array, key = array[key], ...
            dtype = array.dtype
        if type(value) is not np.ndarray or (value.dtype is not dtype and value.dtype != dtype):
            value = _fit(_inner(value, counted), dtype, name)
            # Its conversion may have run the caller's code.
            self._lease.check()
        array[key] = value

    # What numpy asks for

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        wanted = self.dtype if dtype is None else np.dtype(dtype)
        array = self._checked()
        if copy is True or wanted != array.dtype:
            if copy is False:
                raise ValueError(f"a view of {array.dtype} cannot become {wanted} without a copy")
            return np.array(array, dtype=wanted)
        offset = array.__array_interface__["data"][0] - self._lease.address if array.size else 0
        if not 0 <= offset <= self._lease.bytes:
            return array  # slots that were gathered: memory of its own
        memory: Any = self._lease.export()
        return np.ndarray(array.shape, array.dtype, memory, offset, array.strides)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        counted = not (ufunc in _UFUNCS and _is_plain(inputs) and _is_plain(kwargs))
        out = kwargs.get("out")
        inputs, kwargs = _inner_of(inputs, [], counted), _inner_of(kwargs, [], counted)
        found = getattr(ufunc, method)(*inputs, **kwargs)
        if out is None:
            return found
        return out[0] if len(out) == 1 else out

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        module = getattr(function, "__module__", None) or ""
        counted = not (module.partition(".")[0] == "numpy" and _is_plain(args) and _is_plain(kwargs))
        leases: list[Lease] = []
        found = function(*_inner_of(args, leases, counted), **_inner_of(kwargs, leases, counted))
        return _own_of(found, leases, counted)

    def _checked(self) -> np.ndarray:
        self._lease.check()
        return self._array


class Part(View):
    """What was taken of a view: a field, some slots, one of them."""

    __slots__ = ("_array", "_lease")

    def __init__(self, array: np.ndarray, lease: Lease) -> None:
        self._array = array
        self._lease = lease


class Slots(_native.Slots, View):  # type: ignore[misc]
    """The first slots of a lease, of one dtype. What every step does of it is native: it is made without its array, and a batch or a
    field that numpy would copy as it is, is copied there; the rest comes to ``View._assign``."""

    __slots__ = ()


def _is_plain(value: Any) -> bool:
    """True when numpy can use it as an argument without running anything of the caller's."""
    kind = type(value)
    if kind in _PLAIN:
        return True
    if kind is tuple or kind is list:
        return all(map(_is_plain, value))
    if kind is dict:
        return all(map(_is_plain, value.values()))
    if kind is slice:
        return type(value.start) in _PLAIN and type(value.stop) in _PLAIN and type(value.step) in _PLAIN
    if kind is np.ndarray or (kind.__module__ == "numpy" and isinstance(value, np.generic)):
        return not value.dtype.hasobject
    if kind is type:
        return value in _PLAIN or value.__module__ == "numpy"
    return isinstance(value, (View, np.dtype))


def _inner(value: Any, counted: bool) -> Any:
    if isinstance(value, View):
        return value.__array__() if counted else value._checked()
    return value


def _inner_of(value: Any, leases: list[Lease], counted: bool) -> Any:
    """The same arguments with arrays for views, whose leases are noted."""
    if isinstance(value, View):
        leases.append(value._lease)
        return _inner(value, counted)
    kind = type(value)
    if kind is list or kind is tuple:
        return kind([_inner_of(v, leases, counted) for v in value])
    if kind is dict:
        return {k: _inner_of(v, leases, counted) for k, v in value.items()}
    return value


def _own_of(found: Any, leases: list[Lease], counted: bool) -> Any:
    """A result in which every array of a lease's memory is a view again."""
    if isinstance(found, (list, tuple)):
        items = [_own_of(f, leases, counted) for f in found]
        if all(new is old for new, old in zip(items, found)):
            return found
        return items if isinstance(found, list) else tuple(items)
    if isinstance(found, np.ndarray) and not found.flags.owndata:
        if counted and type(found) is not np.ndarray:
            return found  # of a class of the caller's: counted for as long as it lives
        for lease in leases:
            if _lies_in(found, lease):
                return Part(_uncounted(found, lease) if counted else found, lease)
    if type(found) is np.void:
        return found.copy()
    return found


def _lies_in(array: np.ndarray, lease: Lease) -> bool:
    offset = array.__array_interface__["data"][0] - lease.address
    return 0 <= offset < lease.bytes or (array.size == 0 and 0 <= offset <= lease.bytes)


def _uncounted(array: np.ndarray, lease: Lease) -> np.ndarray:
    """The same elements of a lease's memory, if they lie there, without the count that they were reached by."""
    if not _lies_in(array, lease):
        return array
    offset = array.__array_interface__["data"][0] - lease.address
    memory: Any = lease
    again = np.ndarray(array.shape, array.dtype, memory, offset, array.strides)
    again.flags.writeable = array.flags.writeable
    return again


def _fit(value: Any, dtype: np.dtype, key: Any) -> Any:
    """A number or an array that can be written as ``dtype`` without a surprise, where numpy would convert whatever it gets. Writing
    it runs nothing of the caller's any more."""
    if isinstance(value, int) and dtype.kind == "u" and 0 <= value <= _MOST[dtype.itemsize]:
        return int(value)
    if dtype.names is not None:
        if isinstance(value, tuple):
            return np.array(value, dtype)  # made beside: a bad field leaves the slot as it is
        if isinstance(value, list):
            odd = [v for v in value if not isinstance(v, (tuple, np.void, View))]
            if odd:
                raise TypeError(f"expected a record (a tuple of {len(dtype.names)} fields), found {odd[0]!r}")
            return np.array([v.copy()[()] if isinstance(v, View) else v for v in value], dtype)
        found = getattr(value, "dtype", None)
        if found is None or found.names != dtype.names:
            what = type(value).__name__ if found is None else f"an array of {found}"
            raise TypeError(f"expected records with the fields {', '.join(dtype.names)}, found {what}")
        return np.asarray(value).astype(dtype, copy=False)
    array = np.asarray(value)
    if np.can_cast(array.dtype, dtype, "same_kind"):
        return array
    if array.dtype.kind in "iu" and dtype.kind == "u":
        most = np.iinfo(dtype).max
        if array.size and (array.min() < 0 or array.max() > most):
            raise OverflowError(f"expected numbers of 0 to {most} for {key!r}, found {array.min()} to {array.max()}")
        return array.astype(dtype)
    raise TypeError(f"expected {dtype} for {key!r}, found {array.dtype}")
