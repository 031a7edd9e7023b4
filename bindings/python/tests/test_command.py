"""The command ``contactd`` that the package installs behaves as the program that Rust builds: what it prints, its exit status, signals."""

import os
import pathlib
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time

import pytest
from conftest import fill

import contactd

INSTALLED = pathlib.Path(sysconfig.get_path("scripts"), "contactd")
BALL = "sphere(r = 1);"
CUBE = "translate([0, 0, 1.5]) cube(size = [2, 2, 2], center = true);"


@pytest.fixture(params=["installed", "module", "program"])
def command(request, binary):
    """The command as the package installs it, as Python's ``-m`` runs it, and as Rust builds it."""
    return {
        "installed": [str(INSTALLED)],
        "module": [sys.executable, "-P", "-m", "contactd"],
        "program": [str(binary)],
    }[request.param]


def run(command, *arguments, **more):
    done = subprocess.run([*command, *arguments], capture_output=True, stdin=subprocess.DEVNULL, timeout=60, **more)
    return done.returncode, done.stdout.decode(), done.stderr.decode()


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["--version"], 0),
        (["--help"], 0),
        (["check", "--help"], 0),
        ([], 2),
        (["chekc"], 2),
        (["check"], 2),
        (["check", "gone.toml"], 2),
        (["check", "ball.csg", "cube.csg", "--json"], 0),
        (["check", "ball.csg", "cube.csg", "--explain=no"], 2),
        (["check", "bad.csg"], 2),
        (["check", os.fsdecode(b"\xff.csg")], 2),
        (["inspect", "cube.csg", "--color", "always"], 0),
        (["status", "--json"], 0),
        (["status", "--name", "Nobody"], 2),
        (["completions", "bash"], 0),
        (["man", "pages"], 0),
        (["serve", "--config", "gone.toml"], 2),
    ],
)
def test_it_prints_what_the_program_prints(binary, runtime, tmp_path, arguments, status):
    (tmp_path / "ball.csg").write_text(BALL)
    (tmp_path / "cube.csg").write_text(CUBE)
    (tmp_path / "bad.csg").write_text("sphere(r = 1")
    # No server runs there; its path is short, as sockets' must be.
    with tempfile.TemporaryDirectory(prefix="ct", dir=os.path.dirname(runtime)) as empty:
        environment = os.environ | {"XDG_RUNTIME_DIR": empty}
        of_the_program = run([str(binary)], *arguments, cwd=tmp_path, env=environment)
        assert of_the_program[0] == status and of_the_program[1] + of_the_program[2]
        assert run([str(INSTALLED)], *arguments, cwd=tmp_path, env=environment) == of_the_program


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_server_ends_well_when_it_is_asked_to(command, runtime, number):
    """It serves sessions, takes no notice of a hangup, and leaves nothing behind."""
    started = [*command, "serve", "--name", "wheel", "--quiet"]
    with subprocess.Popen(started, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline().endswith(f"process {process.pid})\n")
        with contactd.connect("wheel") as session:
            ball, _ = fill(session)
            process.send_signal(signal.SIGHUP)
            for _ in range(3):
                poses = session.begin_step(2)
                poses[0] = contactd.start(ball, (0, 0, 0))
                poses[1] = contactd.end(ball, (16, 0, 0))
                assert session.finish(timeout=10)[0].time == pytest.approx(0.5, abs=1e-9)
            code, text, _ = run(command, "status", "--name", "wheel")
            assert code == 0 and f"wheel: process {process.pid}" in text
        process.send_signal(number)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out) == (0, ""), err
    assert all("SIGHUP" in line for line in err.splitlines()), err
    assert not pathlib.Path(runtime, "contactd", "wheel").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_another_command_ends_by_the_signal(command, tmp_path, number):
    """It waits for a model that nobody writes."""
    model = tmp_path / "endless.csg"
    os.mkfifo(model)

    def begin():
        # A shell's background job begins with SIGINT ignored.
        signal.signal(number, signal.SIG_DFL)

    started = [*command, "check", str(model)]
    with subprocess.Popen(started, stderr=subprocess.PIPE, text=True, preexec_fn=begin) as process:
        end = time.monotonic() + 20
        # The other end can be opened once the command reads, not before.
        while (writer := _open_for_writing(model)) is None:
            assert time.monotonic() < end and process.poll() is None
            time.sleep(0.01)
        process.send_signal(number)
        _, err = process.communicate(timeout=20)
        os.close(writer)
    assert (process.returncode, err) == (-number, "")


def _open_for_writing(path):
    try:
        return os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    except OSError:
        return None


def test_a_reader_that_has_gone_away_is_no_error(command, tmp_path):
    (tmp_path / "cube.csg").write_text(CUBE)
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [*command, "inspect", "cube.csg"], stdout=writer, stderr=subprocess.PIPE, cwd=tmp_path, timeout=60, check=False
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, b"")


def test_the_demo_starts_its_own_server(binary, runtime):
    """What it meets is the same; times are not."""

    def met(command):
        code, out, err = run(command, "demo")
        assert code == 0, err
        return [line for line in out.splitlines() if " ms" not in line and " s in all" not in line]

    assert met([str(INSTALLED)]) == met([str(binary)])
    left = pathlib.Path(runtime, "contactd").glob("demo-*")
    assert not list(left)
