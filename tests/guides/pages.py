"""Runs the guides: each page's blocks in their order, by one shell, in an empty folder; what a page shows must be what comes out.

pages.py ROOT TARGET [--install] [--keep FOLDER] [PAGE...]: see tests/guides/check, which calls it.

A block is a fence with words behind it:
- ``sh``: lines for a shell that stops at the first failure; its output, both streams, is kept;
- ``sh install``: the same, run with ``--install`` alone;
- a language and a file's name: the file is written;
- ``text``: what the shell block before it has put out. Its lines must be found there, in this order, others between them allowed;
  an ellipsis stands for anything.
Any other block is an error: nothing in a guide goes unread.
"""

import concurrent.futures
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zlib

PATIENCE = 600
#: Tools that a page needs beside those of the checkout, and Debian's packages of them.
NEEDS = {
    "cpp": {"cmake": "cmake", "c++": "g++"},
    "maker": {"openscad": "openscad"},
    "operator": {"curl": "curl"},
}
#: Pages that want the environment of bindings/python/check.
PYTHON = {"mujoco", "maker", "operator", "measure"}


class Wrong(Exception):
    """A page that does not do what it says; the sentence names file and line."""


def blocks(page, text):
    """Blocks as (line, words, text)."""
    found, opened, words, lines = [], 0, [], []
    for n, line in enumerate(text.splitlines(), 1):
        fence = re.match(r"```(.*)$", line)
        if fence and opened:
            found.append((opened, words, "".join(f"{one}\n" for one in lines)))
            opened = 0
        elif fence:
            opened, words, lines = n, fence[1].split(), []
        elif opened:
            lines.append(line)
    if opened:
        raise Wrong(f"{page}:{opened}: expected the end of the block, found the end of the page")
    return found


def lost_line(shown, output):
    """The first line of ``shown`` that is not in ``output`` behind those before it; None where all are."""
    rest = iter(output.splitlines())
    for line in filter(str.strip, shown.splitlines()):
        pattern = ".*".join(re.escape(part) for part in line.strip().split("…"))
        if not any(re.fullmatch(pattern, other.strip()) for other in rest):
            return line
    return None


def plan(page, text):
    """The page's steps: ("write", line, name, text), ("run", line, text, installs), ("show", line, text, the run's number)."""
    steps, runs = [], 0
    for line, words, inner in blocks(page, text):
        match words:
            case ["sh"] | ["sh", "install"]:
                steps.append(("run", line, inner, len(words) > 1))
                runs += 1
            case ["text"] if runs and steps[-1][0] == "run":
                steps.append(("show", line, inner, runs - 1))
            case ["text"]:
                raise Wrong(f"{page}:{line}: expected a block that shows output right behind the block that makes it")
            case [_, name]:
                # A reader has to be told where it goes.
                if f"`{name}`" not in text:
                    raise Wrong(f"{page}:{line}: expected the page to name the file `{name}`")
                steps.append(("write", line, name, inner))
            case _:
                raise Wrong(f"{page}:{line}: expected a block of sh, sh install, text, or a language and a file, found {words}")
    if not any(step[0] == "show" for step in steps):
        raise Wrong(f"{page}: expected a page that shows what comes out, found none")
    return steps


def script(page, steps, folder, install):
    """The page as one shell's text: files are written where they stand, each run's output goes to a file of its own."""
    lines, runs = ["set -euo pipefail"], 0
    for number, step in enumerate(steps):
        if step[0] == "write":
            kept = folder / f"block{number}"
            kept.write_text(step[3])
            lines.append(f"mkdir -p \"$(dirname '{step[2]}')\" && cp '{kept}' '{step[2]}'")
        elif step[0] == "run":
            if not step[3] or install:
                lines += [f"echo {step[1]} > '{folder}/line'", f"{{\n{step[2]}}} > '{folder}/out{runs}' 2>&1"]
            runs += 1
    return "\n".join(lines) + "\n"


def environment(root, target, home, name, install):
    kept = {k: v for k, v in os.environ.items() if k in ("PATH", "LANG", "CARGO_HOME", "RUSTUP_HOME", "RUSTUP_TOOLCHAIN", "TERM")}
    kept.setdefault("CARGO_HOME", str(pathlib.Path.home() / ".cargo"))
    kept.setdefault("RUSTUP_HOME", str(pathlib.Path.home() / ".rustup"))
    kept.update({k: v for k, v in os.environ.items() if re.match(r"(?i)(pip_|https?_proxy$|no_proxy$|ssl_cert_)", k)})
    first = [] if install else [str(target / "release")]
    if not install and name in PYTHON:
        first = [str(target / "python" / "bin"), *first]
    if install:
        first = [str(home / ".local" / "bin")]
        kept["CARGO_INSTALL_ROOT"] = str(home / ".local")
    return kept | {
        "HOME": str(home),
        "PATH": ":".join([*first, kept["PATH"]]),
        "LC_ALL": "C.UTF-8",
        # What a page's own project compiles is kept for the next time.
        "CARGO_TARGET_DIR": str(target if install and name != "rust" else target / "guides"),
        "PIP_CACHE_DIR": kept.get("PIP_CACHE_DIR", str(pathlib.Path.home() / ".cache" / "pip")),
        "MUJOCO_GL": "egl",
    }


def installed(root, target, home):
    """What the C library's install makes, of what was built."""
    command = [root / "bindings/capi/install", home / "contactd-c", "--built", target / "release/deps"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise Wrong(f"bindings/capi/install: {done.stdout}{done.stderr}")


def follow(root, target, page, install, keep):
    """Runs a page; what it shows is compared."""
    text = page.read_text()
    name, steps = page.stem, plan(page.relative_to(root), text)
    # At the same place each time, or cargo would take the checkout for another one and compile it anew; and not in the checkout, or
    # it would take a page's project for a part of that.
    home = pathlib.Path(tempfile.gettempdir()) / f"contactd-guides-{os.getuid()}-{zlib.crc32(bytes(root)):08x}" / name
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    # In memory, as a user's runtime folder is, and its path is short.
    runtime = pathlib.Path(tempfile.mkdtemp(prefix="ct", dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else "/tmp"))
    shell = None
    try:
        (home / "contactd").symlink_to(root)
        folder, own = home / "work", home / ".blocks"
        folder.mkdir()
        own.mkdir()
        if not install and name == "cpp":
            installed(root, target, home)
        env = environment(root, target, home, name, install) | {"XDG_RUNTIME_DIR": str(runtime)}
        lines = script(page, steps, own, install)
        # A group of its own, so that what it leaves running can be ended.
        shell = subprocess.Popen(["bash", "-c", lines], cwd=folder, env=env, stdin=subprocess.DEVNULL, start_new_session=True)
        try:
            status = shell.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            status = f"no end within {PATIENCE} s"
        outputs = {int(p.name[3:]): p.read_text(errors="replace") for p in own.glob("out*")}
        if status != 0:
            at, last = (own / "line").read_text().strip(), outputs.get(max(outputs, default=0), "")
            raise Wrong(f"{page.relative_to(root)}:{at}: expected commands that go well, found {status}:\n{last}")
        for kind, line, inner, *run in steps:
            lost = lost_line(inner, outputs[run[0]]) if kind == "show" else None
            if lost is not None:
                raise Wrong(f"{page.relative_to(root)}:{line}: expected the line {lost!r}, found:\n{outputs[run[0]]}")
        pictures(root, page, text, folder, keep)
    finally:
        if shell:
            try:
                os.killpg(shell.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        shutil.rmtree(home, ignore_errors=True)
        shutil.rmtree(runtime, ignore_errors=True)


def pictures(root, page, text, folder, keep):
    """Every picture that the page shows was made by it."""
    shown = re.findall(r"!\[[^]]+\]\(([^)]+)\)", text)
    if not shown:
        raise Wrong(f"{page.relative_to(root)}: expected a picture, found none")
    for name in shown:
        made = folder / name
        if not made.is_file() or made.read_bytes()[:8] != b"\x89PNG\r\n\x1a\n":
            raise Wrong(f"{page.relative_to(root)}: expected the picture {name} to be made by the page's commands, found none")
        if keep:
            shutil.copy(made, keep / name)


def lacks(name, target, install):
    """What is missing here for a page, as a sentence; tries to help itself on a machine of its own."""
    for tool, package in NEEDS.get(name, {}).items():
        if not shutil.which(tool) and os.getuid() == 0 and shutil.which("apt-get"):
            subprocess.run(["apt-get", "install", "-y", "-q", "--no-install-recommends", package], capture_output=True)
        if not shutil.which(tool):
            return f"{tool} is missing (Debian's package {package})"
    if name in PYTHON and not install and not (target / "python/bin/contactd").exists():
        return "the environment of bindings/python/check is missing: run it first"
    return None


def main(arguments):
    root, target = (pathlib.Path(a).resolve() for a in arguments[:2])
    install, keep, names = False, None, []
    rest = iter(arguments[2:])
    for word in rest:
        match word:
            case "--install":
                install = True
            case "--keep":
                keep = pathlib.Path(next(rest)).resolve()
                keep.mkdir(parents=True, exist_ok=True)
            case _:
                names.append(word)
    pages = sorted((root / "docs/guides").glob("*.md"))
    unknown = set(names) - {page.stem for page in pages}
    if unknown:
        raise Wrong(f"expected a page of docs/guides, found {', '.join(sorted(unknown))}")
    def one(page):
        started = time.monotonic()
        if lack := lacks(page.stem, target, install):
            return f"{page.stem}: left out, {lack}"
        follow(root, target, page, install, keep)
        took = time.monotonic() - started
        return f"{page.stem}: every command went well, and put out what the page shows, {took:.0f} s"

    # Two at a time: some compile, some wait, some draw.
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        told = [pool.submit(one, page) for page in pages if not names or page.stem in names]
        for page in told:
            print(page.result(), flush=True)


def self_test():
    """A page that lies is told: without this nobody would know that pages are read at all."""
    assert lost_line("a … c\nd", "x\na b c\ny\nd\n") is None
    assert lost_line("d\na", "a\nd\n") == "a", "lines in another order were taken"
    assert lost_line("p50 1 ms", "p50 11 ms\n") == "p50 1 ms", "a part of a line was taken for it"
    for text in ("```sh\ntrue\n", "```text\na\n```\n", "```sh\ntrue\n```\n```python\npass\n```\n", "```sh\ntrue\n```\n"):
        try:
            plan("page", text)
        except Wrong:
            continue
        raise AssertionError(f"taken: {text!r}")


if __name__ == "__main__":
    self_test()
    try:
        main(sys.argv[1:])
    except Wrong as wrong:
        print(f"tests/guides/check: {wrong}", file=sys.stderr)
        sys.exit(1)
