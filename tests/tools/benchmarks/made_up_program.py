"""What the tests of the benchmarks' scripts share: the scripts themselves, and a made-up program in the place of haustra."""

import os
import stat
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[3] / "tools" / "benchmarks"
sys.path.insert(0, str(SCRIPTS))

# The real program, where the first argument names it.
HAUSTRA = Path(sys.argv.pop(1)).resolve() if len(sys.argv) > 1 and os.path.isfile(sys.argv[1]) else None


class MadeUpProgramTest(unittest.TestCase):
    PROGRAM = ""  # in Python, for str.format with `python`; it notes every call in calls.txt beside itself

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.program = self.write("bin/haustra", self.PROGRAM.format(python=sys.executable))
        self.program.chmod(self.program.stat().st_mode | stat.S_IXUSR)

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def call(self, script, *arguments):
        """Exit code, what was printed, what the program was asked since the last call: a line each."""
        command = [sys.executable, SCRIPTS / script, "--haustra", self.program, "--out", self.folder / "out", *arguments]
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
        calls = self.folder / "bin" / "calls.txt"
        asked = calls.read_text(encoding="utf-8").splitlines() if calls.exists() else []
        calls.unlink(missing_ok=True)
        return done.returncode, done.stdout + done.stderr, asked
