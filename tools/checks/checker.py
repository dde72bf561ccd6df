"""The ends of every checker of this folder: the tree that it looks at, and what it says."""

import sys
from pathlib import Path


def root_of(arguments, usage, missing):
    """The tree: ROOT, the only argument, or the repository. Ends with 64 on more, or when `missing(root)` names a lack."""
    if len(arguments) > 1:
        print(usage, file=sys.stderr)
        sys.exit(64)
    root = Path(arguments[0]).resolve() if arguments else Path(__file__).resolve().parents[2]
    if lack := missing(root):
        print(f"{Path(sys.argv[0]).name}: {root} {lack}", file=sys.stderr)
        sys.exit(64)
    return root


def verdict(violations, kind, clean):
    """Prints the lines and their number, or `clean` if there are none; the exit code."""
    for line in violations:
        print(line)
    if violations:
        print(f"{len(violations)} {kind}")
        return 1
    if clean:
        print(clean)
    return 0


class Violations:
    """Places and what is wrong there, listed as "path:line: what is wrong" in the order of the tree."""

    def __init__(self, root):
        self.root = root
        self.places = []

    def report(self, path, line, message):
        self.places.append((path.relative_to(self.root).as_posix(), line, message))

    def lines(self):
        return [f"{path}:{line}: {message}" for path, line, message in sorted(self.places)]
