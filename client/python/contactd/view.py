"""Views into a session's memory that know when their step is over.

A ``View`` behaves as the numpy array it stands for: indexing, fields, arithmetic, numpy's functions, methods. What it gives of the
same memory is a ``View`` again; what is computed is an array of its own. Once its step is over every use raises ``Stale``. A view
never keeps its session from going on, so loops need no ``del``.

``numpy.asarray(view)`` gives a plain array over the same memory, for code that needs one. Nothing can be asked of it later, so it
is counted: while one lives (or anything numpy made of it), the session refuses to send its poses, or to begin the next step,
with ``StillExported``, a ``BufferError``. Passing a view to a function that converts it, as most of scipy, matplotlib or mujoco, is
fine: its array is gone when the function returns. ``view.copy()`` and ``numpy.array(view)`` give arrays that may be kept.
"""

from __future__ import annotations

from typing import Any, Iterator

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from . import _native
from ._native import Lease

# Ways to the memory that neither a check nor a count would see.
_CLOSED = frozenset({"base", "ctypes", "data", "flat", "getfield", "resize", "setfield", "setflags", "view"})


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
        self._lease.check()
        array = self._array
        found = array[key]
        if type(found) is np.ndarray:
            if found.ndim == 0 and found.dtype.names is None:
                return found[()]
            base = found.base
            if base is array or base is array.base:
                return Part(found, self._lease)
            return found  # chosen by a list or a mask: a copy
        if type(found) is np.void:
            # A record: numpy's own would look at the memory without asking.
            key = key if type(key) is tuple else (key,)
            return Part(array[(*key, ...)], self._lease)
        return found

    def __getattr__(self, name: str) -> Any:
        array = self._array
        if array.dtype.names is not None and name in array.dtype.names:
            return self[name]
        if name.startswith("_") or name in _CLOSED:
            raise AttributeError(f"a view has no attribute {name!r}; take numpy.asarray(view) or view.copy() for it")
        self._lease.check()
        found = getattr(array, name)
        if not callable(found):
            return self._own(found)

        def method(*args: Any, **kwargs: Any) -> Any:
            self._lease.check()
            return self._own(found(*(_inner(a) for a in args), **{k: _inner(v) for k, v in kwargs.items()}))

        return method

    def __len__(self) -> int:
        self._lease.check()
        return len(self._array)

    def __iter__(self) -> Iterator[Any]:
        for i in range(len(self)):
            yield self[i]

    def __contains__(self, value: Any) -> bool:
        return value in self._checked()

    def __bool__(self) -> bool:
        return bool(self._checked())

    def __int__(self) -> int:
        return int(self._checked())

    def __float__(self) -> float:
        return float(self._checked())

    def __repr__(self) -> str:
        if not self._lease.alive:
            return "<view of a step that is over>"
        return f"View({self._checked()!r})"

    def __str__(self) -> str:
        return str(self._checked())

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
        array = self._array
        dtype = array.dtype
        name = key
        if type(key) is str and dtype.names is not None:
            array, key = array[key], ...
            dtype = array.dtype
        if type(value) is not np.ndarray or (value.dtype is not dtype and value.dtype != dtype):
            value = _fit(value, dtype, name)
        array[key] = value

    # What numpy asks for

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        array = self._checked()
        if copy or (dtype is not None and np.dtype(dtype) != array.dtype):
            if copy is False:
                raise ValueError(f"a view of {array.dtype} cannot become {np.dtype(dtype)} without a copy")
            return np.array(array, dtype=dtype)
        offset = array.__array_interface__["data"][0] - self._lease.address if array.size else 0
        if not 0 <= offset <= self._lease.bytes:
            return array  # slots that were gathered: memory of its own
        memory: Any = self._lease.export()
        return np.ndarray(array.shape, array.dtype, memory, offset, array.strides)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        out = kwargs.get("out")
        if out is not None:
            kwargs["out"] = tuple(_inner(o) for o in out)
        if "where" in kwargs:
            kwargs["where"] = _inner(kwargs["where"])
        found = getattr(ufunc, method)(*(_inner(i) for i in inputs), **kwargs)
        if out is None:
            return found
        return out[0] if len(out) == 1 else out

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        leases: list[Lease] = []
        found = function(*_inner_of(args, leases), **_inner_of(kwargs, leases))
        return _own_of(found, leases)

    def _checked(self) -> np.ndarray:
        self._lease.check()
        return self._array

    def _own(self, found: Any) -> Any:
        return _own_of(found, [self._lease])


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


def _inner(value: Any) -> Any:
    return value._checked() if isinstance(value, View) else value


def _inner_of(value: Any, leases: list[Lease]) -> Any:
    """The same arguments with arrays for views, whose leases are noted."""
    if isinstance(value, View):
        leases.append(value._lease)
        return value._checked()
    if type(value) in (list, tuple):
        return type(value)(_inner_of(v, leases) for v in value)
    if type(value) is dict:
        return {k: _inner_of(v, leases) for k, v in value.items()}
    return value


def _own_of(found: Any, leases: list[Lease]) -> Any:
    """A result in which every array of a lease's memory is a view again."""
    if isinstance(found, (list, tuple)):
        items = [_own_of(f, leases) for f in found]
        if all(new is old for new, old in zip(items, found)):
            return found
        return items if isinstance(found, list) else tuple(items)
    if isinstance(found, np.ndarray) and not found.flags.owndata:
        at = found.__array_interface__["data"][0]
        for lease in leases:
            if lease.address <= at < lease.address + max(lease.bytes, 1):
                return Part(found, lease)
    if type(found) is np.void:
        return found.copy()
    return found


def _fit(value: Any, dtype: np.dtype, key: Any) -> Any:
    """A value that can be written as ``dtype`` without a surprise, where numpy would convert whatever it gets."""
    value = _inner(value)
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
        return value
    array = np.asarray(value)
    if np.can_cast(array.dtype, dtype, "same_kind"):
        return value
    if array.dtype.kind in "iu" and dtype.kind == "u":
        most = np.iinfo(dtype).max
        if array.size and (array.min() < 0 or array.max() > most):
            raise OverflowError(f"expected numbers of 0 to {most} for {key!r}, found {array.min()} to {array.max()}")
        return array.astype(dtype)
    raise TypeError(f"expected {dtype} for {key!r}, found {array.dtype}")
