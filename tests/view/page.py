"""Drives the page of `contactd view` in Chromium and holds it to what is known otherwise.

Usage: page.py PROGRAM CHROMIUM [FOLDER]     the program contactd, the browser, where screenshots go
"""

import json
import math
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import zlib

from browser import Browser

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")

# A plate with a hole, a ball that comes down beside it and turns, a bolt of two cylinders.
PLATE = (
    "difference() { cube(size = [40, 30, 6], center = true);\n"
    "  multmatrix([[1,0,0,6],[0,1,0,-4],[0,0,1,0],[0,0,0,1]]) cylinder(h = 20, r1 = 7, r2 = 7, center = true, $fn = 0); }\n"
)
BALL = "sphere(r = 5, $fn = 0);\n"
BOLT = (
    "union() { cylinder(h = 12, r1 = 3, r2 = 3, center = true, $fn = 0);\n"
    "  multmatrix([[1,0,0,0],[0,1,0,0],[0,0,1,7],[0,0,0,1]]) cylinder(h = 4, r1 = 5, r2 = 5, center = true, $fn = 0); }\n"
)
SCENE = """unit = "mm"
[[model]]
name = "plate"
file = "plate.csg"
[[model]]
name = "ball"
file = "ball.csg"
[[model]]
name = "bolt"
file = "bolt.csg"
[[object]]
name = "plate"
model = "plate"
motion = "static"
[[object]]
name = "ball"
model = "ball"
start = { position = [-9, 3, 22] }
end = { position = [-9, 3, 2] }
rotation_vector = [0.4, 7.5, -0.3]
[[object]]
name = "bolt"
model = "bolt"
start = { position = [6, -4, 14], rotation = [0, 0, 0, 1] }
end = { position = [6.5, -4.2, -2] }
rotation_vector = [0.3, 0.1, 2.0]
"""


class Judge:
    """The scene by formulas of its own: f of every object, and the face that decides."""

    def __init__(self, poses):
        self.poses = poses

    @staticmethod
    def inner(pose, x):
        (px, py, pz), (a, b, c, w) = pose
        v = [x[0] - px, x[1] - py, x[2] - pz]
        # The rows of the transposed rotation.
        r = [
            [1 - 2 * (b * b + c * c), 2 * (a * b + c * w), 2 * (a * c - b * w)],
            [2 * (a * b - c * w), 1 - 2 * (a * a + c * c), 2 * (b * c + a * w)],
            [2 * (a * c + b * w), 2 * (b * c - a * w), 1 - 2 * (a * a + b * b)],
        ]
        return [sum(m * k for m, k in zip(row, v)) for row in r]

    @staticmethod
    def cylinder(x, radius, low, high, at=(0, 0)):
        faces = {"side": math.hypot(x[0] - at[0], x[1] - at[1]) - radius, "top": x[2] - high, "bottom": low - x[2]}
        name = max(faces, key=faces.get)
        return faces[name], name

    def value(self, index, x):
        x = self.inner(self.poses[index], x)
        if index == 0:
            faces = {}
            for axis, half, name in ((0, 20, "x"), (1, 15, "y"), (2, 3, "z")):
                faces["+" + name], faces["-" + name] = x[axis] - half, -x[axis] - half
            name = max(faces, key=faces.get)
            block, hole = (faces[name], name), self.cylinder(x, 7, -10, 10, (6, -4))
            return block if block[0] > -hole[0] else (-hole[0], hole[1])
        if index == 1:
            return math.hypot(*x) - 5, "surface"
        return min(self.cylinder(x, 3, -6, 6), self.cylinder(x, 5, 5, 9))

    def first(self, eye, way, plane=None):
        """The object and face that a ray meets first, by small steps of a length that f allows."""
        best, start, end = None, 0.0, 400.0
        if plane:
            # The plane n·x = d is met at s; what is above it is gone.
            above = sum(n * e for n, e in zip(plane[0], eye)) - plane[1]
            rise = sum(n * d for n, d in zip(plane[0], way))
            s = -above / rise
            start, end = (s, end) if above > 0 and s > 0 else (0.0, s if s > 0 else end)
            if above > 0 >= s:
                return None
        for index in range(3):
            t = start
            while t < end:
                f, name = self.value(index, [e + t * d for e, d in zip(eye, way)])
                if f < 1e-6:
                    told = (t, index, "cut" if t == start and f < -0.02 else name)
                    best = min(best, told) if best else told
                    break
                t += max(f, 1e-3)
        return best


class Png:
    """The pixels of a screenshot."""

    def __init__(self, data):
        at, packed = 8, b""
        while at < len(data):
            size, kind = struct.unpack(">I4s", data[at : at + 8])
            body = data[at + 8 : at + 8 + size]
            if kind == b"IHDR":
                self.width, self.height, _, color = struct.unpack(">IIBB", body[:10])
                self.each = {2: 3, 6: 4}[color]
            elif kind == b"IDAT":
                packed += body
            at += 12 + size
        raw, row = zlib.decompress(packed), self.width * self.each
        self.rows, before = [], bytearray(row)
        for y in range(self.height):
            kind, line = raw[y * (row + 1)], bytearray(raw[y * (row + 1) + 1 : (y + 1) * (row + 1)])
            for i in range(row):
                left = line[i - self.each] if i >= self.each else 0
                corner = before[i - self.each] if i >= self.each else 0
                up = before[i]
                if kind == 1:
                    guess = left
                elif kind == 2:
                    guess = up
                elif kind == 3:
                    guess = (left + up) // 2
                elif kind == 4:
                    p = left + up - corner
                    a, b, c = abs(p - left), abs(p - up), abs(p - corner)
                    guess = left if a <= b and a <= c else up if b <= c else corner
                else:
                    guess = 0
                line[i] = (line[i] + guess) & 255
            self.rows.append(line)
            before = line

    def at(self, x, y):
        i = int(x) * self.each
        return tuple(self.rows[int(y)][i : i + 3])


def check(holds, sentence):
    if not holds:
        raise AssertionError(sentence)


class Server:
    """`contactd view` of some arguments."""

    def __init__(self, program, *arguments):
        self.process = subprocess.Popen([program, "view", *arguments], stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        check(found, f"expected the page's address, found {line!r}")
        self.address = found.group()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()

    def get(self, path):
        with urllib.request.urlopen(self.address + path, timeout=60) as answer:
            return json.load(answer)


def opened(browser, server):
    from_ = time.monotonic()
    browser.open(server.address)
    browser.ask("contactdView.ready")
    browser.ask("contactdView.drawn()")
    took = time.monotonic() - from_
    problem = browser.ask("document.getElementById('problem').hidden ? '' : document.getElementById('problem').textContent")
    check(problem == "", f"the page tells of a problem: {problem}")
    return took


def camera(browser):
    return browser.ask("(({eye, axes, size, field}) => ({eye, axes, size, field}))(contactdView.camera)")


def poses_agree(browser, server, rnd, act=0, step=0):
    """The page's motion is the engine's."""
    worst = 0
    for t in [0, 1, *(rnd.random() for _ in range(6))]:
        own = browser.ask(f"contactdView.scene.step({act}, {step}).then((s) => contactdView.scene.poses({act}, s, {t!r}))")
        told = server.get(f"poses/{act}/{step}?t={t!r}")
        for mine, pose in zip(own, told, strict=True):
            size = 1 + max(map(abs, pose[:3]))
            worst = max([worst, *(abs(a - b) / size for a, b in zip(mine["position"], pose[:3]))])
            same = sum(a * b for a, b in zip(mine["rotation"], pose[3:]))
            worst = max(worst, abs(abs(same) - 1))
    check(worst < 1e-12, f"the page's poses are off the engine's by {worst}")
    return worst


def rays(seen, px, py):
    """The directions through a pixel and through four next to it, from what the camera says of itself."""
    width, height = seen["size"]
    focal = height / 2 / seen["field"]
    for dx, dy in ((0, 0), (1.5, 1.5), (-1.5, 1.5), (1.5, -1.5), (-1.5, -1.5)):
        u, v = (px + dx - width / 2) / focal, (height / 2 - py - dy) / focal
        way = [u * a + v * b - c for a, b, c in zip(*seen["axes"])]
        size = math.hypot(*way)
        yield [x / size for x in way]


def picks_agree(browser, rnd, count, plane=None):
    """Picks of the page tell what rays by own formulas meet."""
    t = browser.ask("contactdView.t")
    poses = browser.ask(f"contactdView.posesAt({t!r})")
    judge = Judge([(p["position"], p["rotation"]) for p in poses])
    seen = camera(browser)
    names, hits, cuts = ["plate", "ball", "bolt"], 0, 0
    width, height = seen["size"]
    places = [(width * rnd.uniform(0.2, 0.8), height * rnd.uniform(0.2, 0.8)) for _ in range(count)]
    picked = browser.ask(f"Promise.all({json.dumps(places)}.map(([x, y]) => contactdView.pick(x, y)))")
    for (px, py), got in zip(places, picked, strict=True):
        told = [judge.first(seen["eye"], way, plane) for way in rays(seen, px, py)]
        kinds = {None if one is None else one[1:] for one in told}
        if len(kinds) > 1:
            continue  # Next to an edge either is right.
        if told[0] is None:
            check(got is None, f"nothing is at pixel ({px:.1f}, {py:.1f}), the page picks {got}")
            continue
        distance, index, face = told[0]
        where = f"{face} of {names[index]} is at pixel ({px:.1f}, {py:.1f}), {distance:.4f} away, the page picks {got}"
        check(got and got["name"] == names[index], where)
        if face == "cut":
            check(got["word"] and "section plane" in got["word"], where)
            cuts += 1
        else:
            check(got["face"] and got["face"]["face"] == face, where)
        check(abs(got["far"] - distance) < 0.05, where)
        hits += 1
    return hits, cuts


def marks_agree(browser):
    """At a contact's time its mark stands where its point is projected."""
    pairs = browser.ask("contactdView.step.pairs.map((p) => ({time: p.time, status: p.status, point: p.point}))")
    met = [(i + 1, p) for i, p in enumerate(pairs) if p["status"] == "contact"]
    for number, pair in met:
        browser.ask(f"contactdView.setTime({pair['time']!r})")
        browser.ask("contactdView.settled()")
        axes = camera(browser)
        v = [a - b for a, b in zip(pair["point"], axes["eye"])]
        right, up, out = (sum(a * b for a, b in zip(v, axis)) for axis in axes["axes"])
        width, height = axes["size"]
        k = height / 2 / axes["field"] / -out
        expected = (width / 2 + right * k, height / 2 - up * k)
        at = browser.ask(
            f"(() => {{ const c = document.querySelector('[data-contact=\"{number}\"] .dot');"
            "return c && [Number(c.getAttribute('cx')), Number(c.getAttribute('cy')), c.parentNode.classList.contains('past')]; })()"
        )
        check(at, f"contact {number} has no mark at its time")
        off = math.hypot(at[0] - expected[0], at[1] - expected[1])
        check(off < 0.01, f"the mark of contact {number} is {off} pixels off")
        check(not at[2], f"contact {number} is drawn as one of the past at its own time")
    return len(met)


def records_agree(browser):
    """At the point of a contact that is not hidden a pick tells one of the faces that the record names."""
    pairs = browser.ask("contactdView.step.pairs")
    seen = 0
    for number, pair in enumerate(pairs, 1):
        if pair["status"] != "contact" or not pair["point"]:
            continue
        browser.ask(f"(contactdView.chooseContact({number}), contactdView.settled())")
        if browser.ask(f"contactdView.marks.hidden.get({number})"):
            continue
        at = browser.ask(f"contactdView.camera.pixel({json.dumps(pair['point'])})")
        got = browser.ask(f"contactdView.pick({at[0]}, {at[1]})")
        faces = [(i, f["face"]) for i, side in zip(pair["objects"], pair["faces"]) for f in side]
        near = [(got["object"], got["id"])] if got else []
        # The point lies on an edge as often as not: any pixel next to it will do.
        for dx, dy in ((2, 0), (-2, 0), (0, 2), (0, -2)):
            more = browser.ask(f"contactdView.pick({at[0] + dx}, {at[1] + dy})")
            near += [(more["object"], more["id"])] if more else []
        check(set(near) & set(faces), f"contact {number} is between {faces}, picks there tell {near}")
        seen += 1
    return seen


def quiet(browser):
    check(not browser.console, "the console complains: " + "; ".join(browser.console))


def own_scene(program, browser, keep):
    rnd = random.Random(7)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("plate.csg", PLATE), ("ball.csg", BALL), ("bolt.csg", BOLT), ("scene.toml", SCENE)):
            with open(os.path.join(folder, name), "w") as file:
                file.write(text)
        with Server(program, os.path.join(folder, "scene.toml")) as server:
            opened(browser, server)
            browser.ask("contactdView.settled()")
            keep("own.png")
            off = poses_agree(browser, server, rnd)
            marks = marks_agree(browser)
            check(marks >= 1, "nothing meets")
            browser.ask("(contactdView.setTime(0.31), contactdView.settled())")
            hits, _ = picks_agree(browser, rnd, 80)
            check(hits >= 15, f"only {hits} picks met something")
            before = browser.picture()
            browser.ask("document.getElementById('cutting').click()")
            browser.ask("document.getElementById('axis').value = 'y', document.getElementById('offset').value = 0.45, contactdView.look()")
            browser.ask("document.getElementById('flip').click()")
            browser.ask("contactdView.settled()")
            keep("section.png")
            section = browser.ask("contactdView.drawing.section")
            met, cuts = picks_agree(browser, rnd, 80, (section["normal"], section["offset"]))
            check(cuts >= 3, f"the section plane cut {cuts} of {met} picks")
            check(browser.picture() != before, "the section plane changes nothing that is seen")
            browser.ask("document.getElementById('cutting').click()")
            interaction(browser, server)
            quiet(browser)
            return f"{hits + met} picks, {cuts} of them on the section, {marks} marks, poses within {off:.0e}"


def interaction(browser, server):
    """What the mouse and the keys do."""
    eye = camera(browser)["eye"]
    browser.drag((500, 400), (620, 430))
    orbited = camera(browser)["eye"]
    check(math.dist(eye, orbited) > 1, "a drag does not orbit")
    browser.drag((500, 400), (560, 380), "right")
    panned = camera(browser)["eye"]
    check(math.dist(orbited, panned) > 0.1, "a drag with the right button does not pan")
    browser.mouse("mouseWheel", 500, 400, deltaX=0, deltaY=-240)
    browser.ask("contactdView.drawn()")
    check(math.dist(camera(browser)["eye"], panned) > 1, "the wheel does not zoom")
    browser.ask("(contactdView.fit(), contactdView.settled())")
    stage = browser.ask("(({x, y, width, height}) => [x, y, width, height])(document.getElementById('stage').getBoundingClientRect())")
    target = browser.ask("contactdView.camera.pixel([-14, -10, 3])")
    browser.click(stage[0] + target[0], stage[1] + target[1])
    until = time.monotonic() + 20
    while "plate" not in (told := browser.ask("document.getElementById('chosen').textContent")):
        check(time.monotonic() < until, f"a click on the plate tells {told!r}")
        time.sleep(0.05)
    check("+z" in told and "plate.csg, line 1" in told, f"a click on the plate's top tells {told!r}")
    browser.ask("document.getElementById('solids').focus(), contactdView.setTime(0)")
    browser.call("Input.dispatchKeyEvent", type="keyDown", key=" ")
    browser.call("Input.dispatchKeyEvent", type="keyUp", key=" ")
    until = time.monotonic() + 20
    while browser.ask("contactdView.t") == 0:
        check(time.monotonic() < until, "the space bar does not play")
        time.sleep(0.05)
    browser.ask("contactdView.stop()")


def pixels(browser, keep, name):
    """A screenshot, and that something is drawn in it: as many colours as a shaded solid has."""
    data = browser.picture()
    keep(name, data)
    image = Png(data)
    colors = {image.at(x, y) for x in range(0, image.width, 7) for y in range(0, image.height, 7)}
    check(len(colors) > 60, f"{name} has {len(colors)} colours: nothing is drawn")


def assembly(program, browser, keep):
    with Server(program, os.path.join(ROOT, "server/models/assembly.toml")) as server:
        took = opened(browser, server)
        browser.ask("contactdView.settled()")
        pixels(browser, keep, "assembly.png")
        seen = records_agree(browser)
        keep("contact.png")
        browser.ask("contactdView.dress('dark'), contactdView.drawing.line = contactdView.line, contactdView.drawing.relight(), contactdView.settled()")
        keep("dark.png")
        browser.resize(700, 620)
        browser.ask("new Promise((done) => setTimeout(done, 300)).then(() => contactdView.settled())")
        keep("small.png")
        browser.resize(1280, 720)
        browser.ask("localStorage.clear()")
        quiet(browser)
        return f"open in {took:.2f} s, {seen} contacts picked that the record names"


def demo(program, browser, keep):
    rnd = random.Random(3)
    with Server(program, "--demo") as server:
        took = opened(browser, server)
        told = []
        for act in range(5):
            browser.ask(f"contactdView.showAct({act}).then(() => contactdView.settled())")
            pixels(browser, keep, f"act{act + 1}.png")
            step = rnd.choice([m["step"] for m in server.get(f"marks/{act}") if m["status"] == "contact"])
            browser.ask(f"contactdView.showStep({step}, true).then(() => contactdView.settled())")
            poses_agree(browser, server, rnd, act, step)
            marks = marks_agree(browser)
            check(marks >= 1, f"nothing meets in step {step} of act {act + 1}, whose marks say otherwise")
            told.append(str(marks))
        quiet(browser)
        return f"open in {took:.2f} s, marks of a step of each act: {', '.join(told)}"


def thousand(program, browser, keep):
    """1,000 objects of the assembly's models."""
    rnd = random.Random(5)
    with tempfile.TemporaryDirectory() as folder:
        models = os.path.join(os.path.abspath(ROOT), "server/models")
        lines = ['unit = "mm"']
        for name in ("flange", "bolt", "gear", "peg"):
            lines.append(f'[[model]]\nname = "{name}"\nfile = "{models}/{name}.csg"')
        for i in range(1000):
            name = ("flange", "bolt", "gear", "peg")[0 if i % 25 == 0 else 1 + i % 3]
            at = [150.0 * (i % 10), 150.0 * (i // 10 % 10), 110.0 * (i // 100)]
            to = [x + rnd.uniform(-70, 70) for x in at]
            lines.append(f'[[object]]\nname = "{name} {i}"\nmodel = "{name}"\nstart = {{ position = {at} }}\nend = {{ position = {to} }}')
        path = os.path.join(folder, "thousand.toml")
        with open(path, "w") as file:
            file.write("\n".join(lines) + "\n")
        from_ = time.monotonic()
        with Server(program, path) as server:
            ready = time.monotonic() - from_
            took = opened(browser, server)
            browser.ask("contactdView.settled()", 300)
            whole = time.monotonic() - from_ - ready
            pixels(browser, keep, "thousand.png")
            count = browser.ask("contactdView.act.objects.length")
            check(count == 1000, f"expected 1000 objects, found {count}")
            met = browser.ask("contactdView.meetings().length")
            quiet(browser)
            return f"program ready in {ready:.2f} s, page open in {took:.2f} s, at full resolution in {whole:.1f} s, {met} contacts"


class Running:
    """A server of its own, and a page that follows it."""

    def __init__(self, program):
        self.program = program
        self.folder = tempfile.mkdtemp(prefix="ct", dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else "/tmp")
        self.env = os.environ | {"XDG_RUNTIME_DIR": self.folder, "TMPDIR": self.folder}
        self.server = subprocess.Popen([program, "serve", "-q"], stdout=subprocess.PIPE, text=True, env=self.env)
        line = self.server.stdout.readline()
        check("is ready" in line, f"expected a server, found {line!r}")
        command = [program, "view", "--server", "default"]
        self.view = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=self.env)
        line = self.view.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        check(found and "waits for the first step" in line, f"expected a page that waits and its address, found {line!r}")
        self.address = found.group()

    def client(self, name, *arguments):
        example = os.path.join(os.path.dirname(self.program), "examples", name)
        return subprocess.Popen([example, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=self.env)

    def get(self, path):
        with urllib.request.urlopen(self.address + path, timeout=60) as answer:
            return json.load(answer)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in (self.view, self.server):
            process.kill()
            process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def until(browser, expression, sentence, patience=60):
    """Waits until something holds on the page, which may load itself anew meanwhile."""
    end = time.monotonic() + patience
    while True:
        try:
            if browser.ask(expression):
                return
            found = browser.ask("JSON.stringify([contactdView.stepAt, contactdView.scene?.acts?.map((a) => [a.steps, a.objects.length])])")
        except Exception as e:  # noqa: BLE001: between two pages there is none to ask
            found = e
        check(time.monotonic() < end, f"{sentence}: {found}")
        time.sleep(0.05)


def slowed(process):
    """Lets a client run a twentieth of the time, until it has ended: one without a pause takes what the browser needs to draw."""
    while process.poll() is None:
        for word, seconds in ((signal.SIGCONT, 0.005), (signal.SIGSTOP, 0.095)):
            try:
                process.send_signal(word)
            except ProcessLookupError:
                return
            time.sleep(seconds)


def live(program, browser, keep):
    """A server's steps as they are taken."""
    rnd = random.Random(11)
    with Running(program) as running:
        # Before there is a step the page says so, and asks again.
        with urllib.request.urlopen(running.address, timeout=60) as answer:
            page = answer.read().decode()
        check("Waits for the first step" in page and "refresh" in page, f"the page does not say that it waits: {page!r}")
        check(running.client("hello", "default").wait(60) == 0, "the client hello failed")
        left = [name for name in os.listdir(running.folder) if name.endswith(".mcap")]
        check(not left, f"the recording still has a name: {left}")
        opened(browser, running)
        # The ball meets the rim of the hole: a closed form.
        times = browser.ask("contactdView.meetings().map((p) => p.time)")
        fall = (18 - math.sqrt(21)) / 20
        check(len(times) == 1 and abs(times[0] - fall) < 1e-12, f"expected one contact at {fall}, found {times}")
        browser.ask("contactdView.settled()")
        keep("live.png")

        # Another session: the page shows it, and the newest of its steps.
        steps = 1500
        check(running.client("latency", 16, steps).wait(120) == 0, "the client latency failed")
        until(browser, f"contactdView.act.objects.length === 16 && contactdView.act.steps === {2 * steps}", "the steps do not come")
        until(browser, f"contactdView.stepAt === {2 * steps - 1}", "the newest step is not shown")
        # In the last step ball i goes from (10 i, 0, 0) to (10 i, 1, 0).
        for t in (0.0, 0.25, 1.0):
            for i, pose in enumerate(browser.ask(f"contactdView.posesAt({t})")):
                off = math.dist(pose["position"], (10 * i, t, 0))
                check(off < 1e-12, f"ball {i} is {off} from where its client has put it at t = {t}")
        poses_agree(browser, running, rnd, 0, 2 * steps - 1)

        # Who looks at an old step is left there while others come.
        more = running.client("latency", 3, 200000)
        paced = threading.Thread(target=slowed, args=(more,), daemon=True)
        paced.start()
        until(browser, "contactdView.act.objects.length === 3 && contactdView.act.steps > 50", "the third session does not come")
        browser.ask("contactdView.ready")
        browser.ask("contactdView.goTo(7)")
        seen = browser.ask("contactdView.act.steps")
        until(browser, f"contactdView.act.steps > {seen + 100}", "no more steps come")
        check(browser.ask("contactdView.stepAt") == 7, "the page has left the step that was looked at")
        running.server.terminate()
        running.server.wait(30)
        more.kill()
        more.wait()
        paced.join()
        until(browser, "contactdView.word?.startsWith('It is over')", "the page does not tell that its server has ended")
        browser.console.clear()
    return f"live: a closed form met, {2 * steps} steps followed, the newest shown, an old one kept"


def main():
    program, chromium, folder = sys.argv[1], sys.argv[2], sys.argv[3] if len(sys.argv) > 3 else None
    browser = Browser(chromium)

    def keep(name, data=None):
        if folder:
            os.makedirs(folder, exist_ok=True)
            with open(os.path.join(folder, name), "wb") as file:
                file.write(data or browser.picture())

    passed = 0
    try:
        for part in (own_scene, assembly, demo, thousand, live):
            from_ = time.monotonic()
            told = part(program, browser, keep)
            print(f"tests/view: {part.__name__.replace('_', ' ')}: {told} ({time.monotonic() - from_:.1f} s)", flush=True)
            passed += 1
    finally:
        browser.close()
    print(f"{passed} passed, 0 failed")


if __name__ == "__main__":
    main()
