"""A headless Chromium that a test tells what to do: its DevTools protocol over a pair of pipes, nothing listens."""

import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")


def program():
    """None where there is no Chromium."""
    return next((path for path in map(shutil.which, PROGRAMS) if path), None)


class Browser:
    """One page. Usable in a with statement; ends the browser."""

    def __init__(self, width=1440, height=900, limit_s=120):
        self._limit_s = limit_s
        self._profile = tempfile.mkdtemp(prefix="haustra_view_")
        ours_in, theirs_out = os.pipe()
        theirs_in, ours_out = os.pipe()

        def place():
            # The browser reads from 3 and writes to 4; either may be one of the pipes' own numbers.
            read = fcntl.fcntl(theirs_in, fcntl.F_DUPFD, 10)
            write = fcntl.fcntl(theirs_out, fcntl.F_DUPFD, 10)
            os.dup2(read, 3)
            os.dup2(write, 4)

        flags = [
            "--headless", "--remote-debugging-pipe", f"--user-data-dir={self._profile}", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-extensions",
            # Of a machine without a screen or a GPU, and of a container, where nobody but root is there.
            "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-sandbox",
        ]
        self._process = subprocess.Popen([program(), *flags, "about:blank"], stdin=subprocess.DEVNULL,
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, close_fds=False,
                                         pass_fds=(), preexec_fn=place)
        os.close(theirs_in)
        os.close(theirs_out)
        self._in, self._out, self._read, self._number = ours_in, ours_out, b"", 0
        self.messages = []  # of the page's console, and of errors
        target = self._ask("Target.createTarget", {"url": "about:blank"})["targetId"]
        self._session = None
        self._session = self._ask("Target.attachToTarget", {"targetId": target, "flatten": True})["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._ask(domain + ".enable")
        self._ask("Emulation.setDeviceMetricsOverride",
                  {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.wait()
        os.close(self._in)
        os.close(self._out)
        shutil.rmtree(self._profile, ignore_errors=True)

    def _ask(self, method, parameters=None):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters or {}}
        if getattr(self, "_session", None):
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + self._limit_s
        while time.monotonic() < end:
            answer = self._next(end - time.monotonic())
            if answer is None:
                continue
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self._note(answer)
        raise TimeoutError(method)

    def _next(self, limit_s):
        while b"\0" not in self._read:
            if not select.select([self._in], [], [], max(0, min(limit_s, 1)))[0]:
                return None
            piece = os.read(self._in, 1 << 16)
            if not piece:
                raise RuntimeError("the browser has ended")
            self._read += piece
        message, self._read = self._read.split(b"\0", 1)
        return json.loads(message)

    def _note(self, message):
        parameters = message.get("params", {})
        if message.get("method") == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
            self.messages.append(" ".join(str(a.get("value", a.get("description"))) for a in parameters["args"]))
        elif message.get("method") == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.messages.append(details.get("exception", {}).get("description", details["text"]))
        elif message.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.messages.append(parameters["entry"]["text"] + " " + parameters["entry"].get("url", ""))

    def before_pages(self, script):
        """JavaScript that runs in every page that is opened from now on, before its own."""
        self._ask("Page.addScriptToEvaluateOnNewDocument", {"source": script})

    def open(self, address):
        self._ask("Page.navigate", {"url": address})

    def slide(self, selector, value):
        """As a person moves a slider."""
        self.value(f"(s => {{ s.value = {value}; s.dispatchEvent(new Event('input')); }})"
                   f"(document.querySelector({json.dumps(selector)}))")

    def wait_for_drawing(self):
        self.wait_for("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")

    def value(self, expression):
        """Of JavaScript in the page."""
        result = self._ask("Runtime.evaluate", {"expression": expression, "returnByValue": True, "awaitPromise": True})
        if "exceptionDetails" in result:
            raise RuntimeError(result["exceptionDetails"].get("exception", {}).get("description", str(result)))
        return result["result"].get("value")

    def wait_for(self, expression, limit_s=None):
        """Until it is true; False when it never is."""
        end = time.monotonic() + (limit_s or self._limit_s)
        while time.monotonic() < end:
            try:
                if self.value(expression):
                    return True
            except RuntimeError:
                pass  # the page is on its way
            time.sleep(0.1)
        return False

    def picture(self, scale=1.0, clip=None, jpeg_quality=None):
        """PNG, or JPEG, of the window or of (x, y, width, height) of the page."""
        parameters = {"format": "jpeg", "quality": jpeg_quality} if jpeg_quality else {"format": "png"}
        if clip or scale != 1.0:
            x, y, width, height = clip or (0, 0, *self.value("[innerWidth, innerHeight]"))
            parameters["clip"] = {"x": x, "y": y, "width": width, "height": height, "scale": scale}
        return base64.b64decode(self._ask("Page.captureScreenshot", parameters)["data"])

    def box(self, selector):
        """(x, y, width, height) of an element."""
        return self.value(f"(r => [r.x, r.y, r.width, r.height])(document.querySelector('{selector}').getBoundingClientRect())")
