"""Servers and sessions for the tests. The server's binary: --server, $CONTACTD, or what is built under target/."""

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time

import pytest

import contactd

ROOT = pathlib.Path(__file__).resolve().parents[3]


def pytest_addoption(parser):
    parser.addoption("--server", help="path of the contactd binary")


@pytest.fixture(scope="session")
def binary(request):
    """The contactd binary."""
    given = request.config.getoption("--server") or os.environ.get("CONTACTD")
    built = [ROOT / "target" / profile / "contactd" for profile in ("release", "debug")]
    for path in [pathlib.Path(given)] if given else built:
        if path.is_file():
            return path
    pytest.fail("no contactd binary: build it (cargo build -p contactd), or name it by --server or $CONTACTD")


@pytest.fixture(scope="session")
def runtime():
    """A runtime folder of the tests' own, in memory where that can be had; sockets' paths are short."""
    folder = tempfile.mkdtemp(prefix="ct", dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else "/tmp")
    before = os.environ.get("XDG_RUNTIME_DIR")
    os.environ["XDG_RUNTIME_DIR"] = folder
    yield folder
    os.environ.pop("XDG_RUNTIME_DIR")
    if before is not None:
        os.environ["XDG_RUNTIME_DIR"] = before
    shutil.rmtree(folder)


class Server:
    """A server process."""

    def __init__(self, binary, name):
        self.name = name
        self.command = [str(binary), "serve", "--name", name, "--cache", "off"]
        self.start()

    def start(self):
        with tempfile.TemporaryFile("w+") as said:
            self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=said, text=True)
            line = self.process.stdout.readline()
            if self.name not in line:
                self.kill()
                said.seek(0)
                raise AssertionError(f"the server did not start: {line!r}, {said.read()!r}")

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    @contextlib.contextmanager
    def suspended(self):
        """The server does nothing while the block runs. The signal alone is not enough: a thread that runs stops a little later."""
        tasks = pathlib.Path("/proc", str(self.process.pid), "task")
        self.process.send_signal(signal.SIGSTOP)
        try:
            end = time.monotonic() + 20
            while any(task.joinpath("stat").read_text().rpartition(")")[2].split()[0] != "T" for task in tasks.iterdir()):
                assert time.monotonic() < end, "the server does not stop"
                time.sleep(0.001)
            yield
        finally:
            self.process.send_signal(signal.SIGCONT)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(timeout=20)
        self.process.stdout.close()


@pytest.fixture(scope="session")
def shared_server(binary, runtime):
    """One server for all tests that do not kill it."""
    server = Server(binary, "pytest")
    yield server
    server.stop()


@pytest.fixture
def own_server(binary, runtime, request):
    """A server that the test may kill."""
    server = Server(binary, "own")
    yield server
    if server.process.poll() is None:
        server.stop()


@pytest.fixture(params=["embedded", "shared"])
def session(request):
    """An open session of either kind."""
    if request.param == "embedded":
        opened = contactd.embedded()
    else:
        opened = contactd.connect(request.getfixturevalue("shared_server").name)
    yield opened
    try:
        opened.close()
    except contactd.StillExported:
        pass


@pytest.fixture
def ball_and_wall(session):
    """A session with a fixed wall at x = 10 and a ball of radius 1 at the origin: session, ball, wall."""
    return (session, *fill(session))


def fill(session):
    """Adds them; ball, wall."""
    wall = session.load_model("wall.csg", "cube(size = [2, 20, 20], center = true);")
    ball = session.load_model("ball.csg", "sphere(r = 1);")
    wall = session.add_object("wall", wall, fixed=True, at=(10, 0, 0))
    ball = session.add_object("ball", ball)
    return ball, wall


@contextlib.contextmanager
def in_a_moment(work):
    """Runs ``work`` in a signal handler of this thread."""
    before = signal.signal(signal.SIGALRM, lambda *_: work())
    signal.setitimer(signal.ITIMER_REAL, 0.15)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def interrupt():
    raise KeyboardInterrupt
