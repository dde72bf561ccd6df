"""`haustra view` as a process."""

import signal
import subprocess


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
