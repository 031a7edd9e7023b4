"""contactd: certified earliest contact of moving solids modelled by constructive solid geometry.

>>> import contactd
>>> with contactd.embedded() as session:
...     ball = session.load_model("ball.csg", "sphere(r = 1);")
...     wall = session.load_model("wall.csg", "cube(size = [2, 20, 20], center = true);")
...     wall = session.add_object("wall", wall, fixed=True, at=(10, 0, 0))
...     ball = session.add_object("ball", ball)
...     session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
...     [record] = session.finish()
...     print(record.time, record.a == wall, record.separation)
0.5 True 0.0
"""

from . import convention, manifold, solid
from ._native import PROTOCOL_VERSION, MassProperties, Options, __version__
from .errors import (
    BadAddress,
    Error,
    ErrorCode,
    Misuse,
    NoServer,
    Refused,
    ReplyLost,
    ServerLost,
    Stale,
    StillExported,
    SystemFailure,
    Timeout,
    VersionMismatch,
)
from .pose import Pose, end, start, turn
from .records import (
    CLEARANCE,
    CONTACT,
    DETAIL,
    EXTENT_NAMES,
    KIND_NAMES,
    NO_FACE,
    NO_OBJECT,
    OUTCOME_NAMES,
    PATCH,
    POINT,
    POSE,
    RAY,
    REGION,
    SIDE_NAMES,
    STATUS_NAMES,
    ClearanceFlag,
    Flag,
    Order,
    Status,
    StepStatus,
    Tag,
    Valid,
)
from .reply import Region, Reply
from .rules import Effect, Rule
from .scene import Joint, Scene
from .session import Distance, Face, Model, Recording, Session, connect, embedded
from .solid import Outline, Solid
from .view import View

__all__ = [name for name in dir() if not name.startswith("_") and name not in ("errors", "pose", "records", "reply", "rules", "scene", "session", "view")]
