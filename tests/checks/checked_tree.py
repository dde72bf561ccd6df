"""Runs a checker of tools/checks on a tree that is made for it."""

import subprocess
import sys
import tempfile
from pathlib import Path

CHECKERS = Path(__file__).resolve().parents[2] / "tools" / "checks"


def run_checker(name, files, *arguments):
    """Exit code and all output. `files`: {path: text}; a file whose text is None is not there."""
    with tempfile.TemporaryDirectory() as folder:
        for path, text in files.items():
            if text is not None:
                place = Path(folder) / path
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_text(text, encoding="utf-8")
        done = subprocess.run([sys.executable, str(CHECKERS / name), folder, *arguments], capture_output=True, text=True,
                              check=False)
        return done.returncode, done.stdout + done.stderr
