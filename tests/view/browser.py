"""A Chromium without a window, by the DevTools protocol over two pipes: messages end with a zero byte."""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time


class Browser:
    """One tab. `console` holds what the page complained of."""

    def __init__(self, program, size=(1280, 720)):
        self.folder = tempfile.mkdtemp(prefix="contactd-view-")
        to_browser, ours = os.pipe()
        theirs, from_browser = os.pipe()
        self.ours, self.theirs = ours, theirs

        def pipes():
            # The browser reads from 3 and writes to 4; first out of the way of each other.
            read, write = os.dup(to_browser), os.dup(from_browser)
            high_read, high_write = max(read, 10), max(write, 11)
            os.dup2(read, 20)
            os.dup2(write, 21)
            os.dup2(20, 3)
            os.dup2(21, 4)
            del high_read, high_write

        flags = [
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--hide-scrollbars",
            "--disable-dev-shm-usage",
            "--disable-background-networking",
            "--disable-component-update",
            "--no-first-run",
            "--remote-debugging-pipe",
            f"--user-data-dir={self.folder}",
            f"--window-size={size[0]},{size[1]}",
        ]
        self.log = open(os.path.join(self.folder, "log"), "wb")
        self.process = subprocess.Popen(
            [program, *flags, "about:blank"],
            stdin=subprocess.DEVNULL,
            stdout=self.log,
            stderr=self.log,
            close_fds=False,
            preexec_fn=pipes,
        )
        os.close(to_browser)
        os.close(from_browser)
        self.number, self.rest, self.console = 0, b"", []
        self.session = None
        tab = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=tab, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page", "Network"):
            self.call(f"{domain}.enable")
        self.resize(*size)

    def resize(self, width, height):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def call(self, method, patience=120, **parameters):
        """Sends a command and waits for its answer."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.ours, json.dumps(message).encode() + b"\0")
        until = time.monotonic() + patience
        while True:
            answer = self.receive(until, method)
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.heard(answer)

    def receive(self, until, what):
        while b"\0" not in self.rest:
            ready, _, _ = select.select([self.theirs], [], [], max(0, until - time.monotonic()))
            if not ready:
                raise TimeoutError(f"no answer to {what} in time")
            more = os.read(self.theirs, 1 << 20)
            if not more:
                with open(os.path.join(self.folder, "log"), errors="replace") as log:
                    raise RuntimeError("the browser has ended: " + log.read()[-2000:])
            self.rest += more
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def heard(self, event):
        method, told = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.console.append(told["exceptionDetails"].get("exception", {}).get("description") or str(told))
        elif method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.console.append(" ".join(str(a.get("value", a.get("description"))) for a in told["args"]))
        elif method == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.console.append(told["entry"]["text"] + " " + told["entry"].get("url", ""))

    def ask(self, expression, patience=120):
        """The value of an expression of the page, of a promise what it brings."""
        answer = self.call(
            "Runtime.evaluate", patience, expression=expression, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise RuntimeError(f"{expression}: {details.get('exception', {}).get('description', details)}")
        return answer["result"].get("value")

    def open(self, address):
        self.call("Page.navigate", url=address)
        until = time.monotonic() + 60
        while not self.ask("Boolean(window.contactdView)"):
            if time.monotonic() > until:
                raise TimeoutError("the page does not open: " + "; ".join(self.console))
            time.sleep(0.02)

    def mouse(self, kind, x, y, button="none", **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, **more)

    def click(self, x, y):
        for kind in ("mousePressed", "mouseReleased"):
            self.mouse(kind, x, y, "left", clickCount=1, buttons=1 if kind == "mousePressed" else 0)

    def drag(self, start, end, button="left"):
        buttons = {"left": 1, "right": 2}[button]
        self.mouse("mousePressed", *start, button, clickCount=1, buttons=buttons)
        for k in range(1, 9):
            x, y = (a + (b - a) * k / 8 for a, b in zip(start, end))
            self.mouse("mouseMoved", x, y, button, buttons=buttons)
        self.mouse("mouseReleased", *end, button, clickCount=1)

    def picture(self, to=None):
        """A screenshot as the bytes of a PNG."""
        data = base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])
        if to:
            with open(to, "wb") as file:
                file.write(data)
        return data

    def close(self):
        try:
            self.session = None
            self.call("Browser.close", patience=5)
            self.process.wait(10)
        except (OSError, TimeoutError, RuntimeError, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()
        self.log.close()
        os.close(self.ours)
        os.close(self.theirs)
        shutil.rmtree(self.folder, ignore_errors=True)
