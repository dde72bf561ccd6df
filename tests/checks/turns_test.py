#!/usr/bin/env python3
"""What takes turns is the same in the tests, in CI and in the README: no part is forgotten, and none only said to run."""

import re
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BY_HAND = "by hand only"


def text_of(name):
    return (ROOT / name).read_text(encoding="utf-8")


def parts_of_the_readme():
    """{turn: whether CI runs it}; a row may name several, or the first to the last of numbered ones."""
    parts = {}
    table = text_of("tests/README.md").split("## What takes turns in CI")[1].split("\n## ")[0]
    for row in re.findall(r"^\| (`.*)\|$", table, re.MULTILINE):
        names = re.findall(r"`(\w+)`", row.split("|")[0])
        if " to " in row.split("|")[0]:
            stem, last = re.fullmatch(r"(\w+_)(\d+)", names[1]).groups()
            names = [f"{stem}{i}" for i in range(1, int(last) + 1)]
        parts.update({name: BY_HAND not in row for name in names})
    return parts


class Turns(unittest.TestCase):
    def test_ci_runs_what_the_readme_says(self):
        in_ci = re.search(r"turns=\(([^)]*)\)", text_of(".ci/run")).group(1).split()
        self.assertEqual(sorted(in_ci), sorted(name for name, runs in parts_of_the_readme().items() if runs))

    def test_every_part_stands_in_the_readme(self):
        parts = re.findall(r"^ *haustra_add_turn\((\w+) ", text_of("tests/turns/CMakeLists.txt"), re.MULTILINE)
        parts += [f"tidy_{i}" for i in range(1, 5)]  # made in a loop
        self.assertGreater(len(parts), 15)
        self.assertEqual(sorted(set(parts)), sorted(parts_of_the_readme()))


if __name__ == "__main__":
    unittest.main()
