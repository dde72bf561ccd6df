"""`haustra view` as a process, the haustrad that it looks at, and a click that sets a mark."""

import os
import signal
import subprocess

# With shares of the picture's width and height.
CLICK_PICTURE = ("(picture => { const box = picture.getBoundingClientRect(); picture.dispatchEvent(new MouseEvent('click', "
                 "{clientX: box.left + %f * box.width, clientY: box.top + %f * box.height})); })(document.getElementById('picture'))")


class ServedView:
    """Runs with these arguments inside a with statement; SIGINT ends it. `code` is its exit code then."""

    def __init__(self, haustra, *arguments):
        self._process = subprocess.Popen([haustra, "view", *map(str, arguments)], stdout=subprocess.PIPE, text=True)
        self.address = self._process.stdout.readline().strip()

    def __enter__(self):
        if not self.address.startswith("http://127.0.0.1:"):
            self._process.wait()
            raise RuntimeError("haustra view printed no address")
        return self

    def __exit__(self, *_):
        self._process.send_signal(signal.SIGINT)
        self.code = self._process.wait(timeout=60)
        self._process.stdout.close()


class Service:
    """haustrad on a sequence, in a folder of its own, with depth on the CPU; a procedure begins at once."""

    def __init__(self, haustrad, sequence, folder, settings):
        (folder / "state").mkdir(exist_ok=True)
        settings = [f"files.state_folder={folder}/state", f"files.runtime_folder={folder}", "procedure.begin_at_start=true",
                    "publish.view=true", "publish.depth=true", "depth.enabled=true", "vision.device=cpu",
                    "watchdog.tracking_limit_ms=60000", "watchdog.capture_limit_ms=60000",
                    "watchdog.mapping_limit_ms=300000", "watchdog.worker_limit_ms=60000", "watchdog.stop_limit_ms=60000",
                    *settings]
        words = [word for setting in settings for word in ("--set", setting)]
        environment = {key: value for key, value in os.environ.items() if key not in ("NOTIFY_SOCKET", "WATCHDOG_USEC")}
        self._process = subprocess.Popen([haustrad, "--source", sequence, *words], stderr=subprocess.DEVNULL, env=environment)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(timeout=120)


def click_a_mark(page, u, v, label="polyp"):
    """At a share of the picture's width and height. Whether it was set: a place may have too little of the map near."""
    page.value(f"document.getElementById('marking-label').value = '{label}'; document.getElementById('marking-begin').click()")
    page.value(CLICK_PICTURE % (u, v))
    answer = "document.getElementById('marking-answer').textContent"
    return page.wait_for(f"{answer} !== ''") and page.value(answer) == "marked " + label
