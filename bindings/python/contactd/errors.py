"""Exceptions, each with one sentence; refusals carry the server's stable code and the index of what was refused."""

from __future__ import annotations

import enum


class ErrorCode(enum.IntEnum):
    """Why a request was refused. Numbers are stable across versions."""

    VERSION = 1
    SESSION_GONE = 2
    UNKNOWN_OBJECT = 3
    DUPLICATE_OBJECT = 4
    STATIC_OBJECT = 5
    NOT_FINITE = 6
    BAD_QUATERNION = 7
    BAD_COUNT = 8
    TOO_MANY = 9
    DECLARATION = 10
    RESOLUTION = 11
    LIMIT_TEXT = 12
    LIMIT_NODES = 13
    LIMIT_DEPTH = 14
    LIMIT_FACES = 15
    LIMIT_OBJECTS = 16
    LIMIT_SESSIONS = 17
    LIMIT_MEMORY = 18
    BUSY = 19
    INTERNAL = 20
    UNKNOWN_MODEL = 21
    MODEL = 22
    BAD_RULE = 23
    BAD_COMMAND = 24
    BAD_NUMBER = 25
    UNBOUNDED = 26
    SESSION_ENDED = 27
    RECORDING = 28


class Error(Exception):
    """What any call of a session may raise.

    ``code`` is the stable code of a refusal, else None; ``index`` the record, rule or track that was refused, else None.
    """

    code: ErrorCode | None = None
    index: int | None = None


class Refused(Error):
    """The server refused; nothing has changed there."""


class NoServer(Error):
    """No server of this name is running."""


class ServerLost(Error):
    """The server died or was stopped, or the session on it was lost: ``Session.reconnect`` finds a server and replays the session."""


class ReplyLost(Error):
    """The server could not deliver its reply; what was asked was done, or refused: ``Session.reconnect`` goes back to before it, then it
    is to be sent again (``Session.resend``, for a step)."""


class Timeout(Error, TimeoutError):
    """The time ran out. A step stays in flight: ``finish`` may be called again. What a command asked for may be done yet:
    ``Session.reconnect`` goes back to before it."""


class BadAddress(Error):
    """The name or the runtime folder is not usable."""


class VersionMismatch(Error):
    """The server speaks other protocol versions."""


class Misuse(Error):
    """A call that makes no sense now: wrong order, closed session, another thread."""


class Stale(Misuse):
    """A view was used after its step."""


class StillExported(Misuse, BufferError):
    """Arrays taken of a view are still held where the session would give their memory away."""


class SystemFailure(Error):
    """The system or the shared memory layer failed."""


def _make(kind: str, sentence: str, code: int | None, index: int | None) -> Error:
    """The exception that the native module raises."""
    error: Error = globals()[kind](sentence)
    try:
        error.code = None if code is None else ErrorCode(code)
    except ValueError:  # a newer server's
        error.code = None
    error.index = index
    return error
