#!/usr/bin/env python3
"""Proves that tools/checks/readme.py fails on a tree that breaks the rules, and only then."""

import sys
import unittest

from checked_tree import CHECKERS, run_checker

sys.path.insert(0, str(CHECKERS))
from readme import RESULTS, WITHOUT_JSON  # noqa: E402

TABLE = """| sequence | live % | error | ORB-SLAM3: % |
|---|---|---|---|
| colon_1 | 96.5 (90.1) | 0.30 mm | 88.0 |
| colon_2 | 97.5 (90.1) | 0.31 mm | - |
"""
BLOCK = f"""<!-- results: begin -->
{TABLE}
Machine with 7 cores, a median of 96.5 %, [results](tools/benchmarks/results/2026-11-23-3e3d8e5.md).
<!-- results: end -->
"""
LONG = " ".join(["word"] * 36)
README = f"""# haustra

![A run](tools/report/demo.svg) and a [folder](engine/) and a [place](engine/README.md#limits) and a
[site](https://example.org/none). Short sentence with `a piece of code that has quite a lot of words` in it.

    haustra run {LONG}

```
{LONG}
```

- {" ".join(["word"] * 20)}
- {" ".join(["word"] * 20)}

| folder | what |
|---|---|
| `hal` | 720x540 pictures of 2026-11-23, 12 of them |

{BLOCK}"""

SECTIONS = """
## Contract: what it keeps
It is there.

## Limits
It is small.
"""

GOOD_TREE = {
    "README.md": README,
    "tools/report/demo.svg": "<svg/>\n",
    "tools/benchmarks/results/2026-11-23-3e3d8e5.md": f"# Results\n\n{TABLE}\nMedian.\n",
    "CHANGELOG.md": "It takes 5 % less ([how](tools/benchmarks/results/2026-11-22-0d47607.md)). `gone.h` went.\n",
    "tools/benchmarks/results/2026-11-22-0d47607.md": f"{LONG}.\n",
    "tools/benchmarks/results/2026-11-22-0d47607.json": "{}\n",
    "kernels/cuda/decisions/2026-11-22-bands.md": "# Bands\n\nBefore 91.0 us at 640x480, 2026-11-22, commit 48a00ea.\n" + "\n" * 57,
    "toolchains/decisions/2026-11-24-flags.md": "# Flags\n\nIt takes 7.5 % less.\n",
    "build/README.md": f"{LONG}. [gone](gone.md)\n",
    ".git/README.md": f"{LONG}.\n",
    ".github/CONTRIBUTING.md": "See [README](../README.md).\n",
}
for folder in ("hal", "kernels", "capture", "engine", "platform", "toolchains", "config", "tests", "tools"):
    GOOD_TREE[f"{folder}/README.md"] = f"# {folder}\n\nWhat it is.\n{SECTIONS}"
# Those that the checker itself lists, as it wants them all.
for name in WITHOUT_JSON:
    GOOD_TREE.setdefault(f"{RESULTS}{name}.md", "# Old\n")
GOOD_TREE["tools/old.md"] = "".join(f"[{name}](benchmarks/results/{name}.md)\n" for name in sorted(WITHOUT_JSON))
OLD = "2026-11-28-ae2be7b-wall"
GOOD_TREE["config/README.md"] = """# config

<!-- figures: preset.h -->
It moves by 4 % within 3 seconds and has 7 MB, see [C++20](preset.h). `0.7 ms` is what is typed, `config/preset.h` and `preset.h` are files.
""" + SECTIONS
GOOD_TREE["config/preset.h"] = """constexpr double kMotion = 0.04;
constexpr int kWithinSeconds = 3, kTableMegabytes = 7;
"""
GOOD_TREE["hal/README.md"] = "# hal\n\n- A look takes 91 us ([why](../kernels/cuda/decisions/2026-11-22-bands.md)).\n" + SECTIONS
GOOD_TREE["kernels/README.md"] = """# kernels

<!-- figures: cuda/decisions/2026-11-22-bands.md -->
| step | us |
|---|---|
| extraction | 91.0 |

[Why](cuda/decisions/2026-11-22-bands.md).
""" + SECTIONS
GOOD_TREE["toolchains/README.md"] = "# toolchains\n\nIt takes 7.5 % less, and a folder's own records need no link.\n" + SECTIONS

# What takes the place of a file of the good tree (nothing: the file is gone), and what the checker must say.
BAD_FILES = [
    ("README.md", README + "\n" * 120, "lines, 120 are allowed"),
    ("README.md", README + f"\nA new sentence. {LONG}. Another.\n", "README.md:28: a sentence of 36 words, 35 are allowed: word"),
    ("README.md", README + f"\n- {LONG}\n", "a sentence of 36 words"),
    ("README.md", README + f"\n1. {LONG}\n", "a sentence of 36 words"),
    ("README.md", README + "\n" + LONG.replace(" ", "\n") + "\n", "a sentence of 36 words"),
    ("engine/README.md", f"# engine\n\n{LONG}.\n", "engine/README.md:3: a sentence of 36 words"),
    ("engine/io/README.md", f"{LONG}.\n", "engine/io/README.md:1: a sentence of 36 words"),
    ("engine/decisions/2026-11-22-one.md", f"# One\n\n{LONG}.\n", "2026-11-22-one.md:3: a sentence of 36 words"),
    ("engine/decisions/2026-11-22-one.md", "# One\n" + "\n" * 60, "2026-11-22-one.md:61: 61 lines, 60 are allowed"),
    ("CHANGELOG.md", f"- One.\n- {LONG}.\n", "CHANGELOG.md:2: a sentence of 36 words"),
    (".github/CONTRIBUTING.md", f"{LONG}.\n", "CONTRIBUTING.md:1: a sentence of 36 words"),
    ("engine/README.md", "# engine\n\nSee `io/gone.h`.\n", "engine/README.md:3: there is no io/gone.h"),
    ("engine/README.md", "| `gone.py --all` | what |\n|---|---|\n", "engine/README.md:1: there is no gone.py"),
    ("engine/README.md", "# engine\n\nSee `set.h`.\n", "engine/README.md:3: there is no set.h"),
    ("README.md", README + "\n[gone](engine/gone.md)\n", "the link to engine/gone.md leads nowhere"),
    ("README.md", README + '\n<img src="gone.svg">\n', "the link to gone.svg leads nowhere"),
    ("CHANGELOG.md", "[gone](gone.md)\n", "CHANGELOG.md:1: the link to gone.md leads nowhere"),
    (".github/CONTRIBUTING.md", "[gone](README.md)\n", "the link to README.md leads nowhere"),
    ("tools/report/demo.svg", None, "the link to tools/report/demo.svg leads nowhere"),
    ("engine/README.md", None, "engine:0: has no README.md"),
    ("config/README.md", None, "config:0: has no README.md"),
    ("engine/README.md", "# engine\n\n## Limits\n", "engine/README.md:1: has no section Contract"),
    ("tests/README.md", "# tests\n\n## Contract\n\n## Limitsless\n", "tests/README.md:1: has no section Limits"),
    ("README.md", README.replace("96.5", "96.6"), "this row is not that of 2026-11-23-3e3d8e5.md: | colon_1 | 96.5"),
    ("README.md", README.replace("| colon_1 | 96.5", "| colon_1 | 97.5"), "this row is not that of"),
    ("README.md", README.replace("colon_1", "colon_3").replace("colon_2", "colon_1").replace("colon_3", "colon_2"),
     "this row is not that of"),
    ("README.md", README.replace("| colon_2 | 97.5 (90.1) | 0.31 mm | - |\n", ""),
     "the table has 3 lines, that of 2026-11-23-3e3d8e5.md 4"),
    ("tools/benchmarks/results/2026-11-23-3e3d8e5.md", "nothing\n", "that of 2026-11-23-3e3d8e5.md 0"),
    ("tools/benchmarks/results/2026-11-23-3e3d8e5.md", None, "links to no file in tools/benchmarks/results/"),
    ("README.md", README.replace("Machine", "[Others](tools/benchmarks/results/2026-11-22-0d47607.md)"), "or to several"),
    ("tools/benchmarks/results/2026-11-22-0d47607.json", None, "2026-11-22-0d47607.md:0: its raw figures, a .json beside it, are"),
    (f"{RESULTS}{OLD}.md", None, f"{OLD}.md:0: is not there, and WITHOUT_JSON lists it"),
    ("CHANGELOG.md", "`2026-11-22-0d47607.md` went.\n", "2026-11-22-0d47607.md:0: no page links to it"),
    ("README.md", README.replace(BLOCK, ""), "one block of results"),
    ("README.md", README + BLOCK, "one block of results"),
    ("README.md", README.replace("|", "/"), "the table has 0 lines"),
    ("engine/README.md", f"| a | {LONG} |\n|---|---|\n| b | {LONG[5:]} |\n",
     "engine/README.md:1: a cell with a sentence of 36 words"),
    ("README.md", README.replace("12 of them", "0.5 of them"), "a figure (0.5) without a results file"),
    ("kernels/README.md", "| a | 91 us |\n|---|---|\n", "kernels/README.md:1: a figure (91) without a results file"),
    ("README.md", README + "\nA frame takes 2.5.\n", "README.md:28: a figure (2.5) that is in no results file"),
    ("README.md", README.replace("a median of 96.5", "a median of 97"), "a figure (97%) that is in no results file"),
    ("hal/README.md", GOOD_TREE["hal/README.md"].replace("91 us", "92 us"), "hal/README.md:3: a figure (92us) that is in no"),
    ("hal/README.md", "# hal\n\n- A look takes 91 us.\n", "hal/README.md:3: a figure (91us) that is in no results file"),
    ("config/README.md", GOOD_TREE["config/README.md"].replace("4 %", "5 %"), "config/README.md:4: a figure (5%)"),
    ("config/README.md", GOOD_TREE["config/README.md"].replace("4 %", "4 mm"), "config/README.md:4: a figure (4mm)"),
    ("config/README.md", GOOD_TREE["config/README.md"].replace("3 seconds", "5 seconds"), "config/README.md:4: a figure (5seconds)"),
    ("config/README.md", GOOD_TREE["config/README.md"].replace("7 MB", "8 MB"), "config/README.md:4: a figure (8MB)"),
    *[("engine/README.md", f"# engine\n\nIt has 42 {unit}.\n", f"engine/README.md:3: a figure (42{unit}) that is in no")
      for unit in ("s", "minutes", "hours", "Hz", "kB", "MB", "GB")],
    ("engine/README.md", "| memory | 42 MB |\n|---|---|\n", "engine/README.md:1: a figure (42) without a results file"),
    # In a record that another README links to, in a link that nobody can follow, in another folder's records.
    ("engine/README.md", "# engine\n\nA look takes 91 us.\n", "engine/README.md:3: a figure (91us) that is in no results file"),
    ("hal/README.md", "# hal\n\nA look takes 91 us (`[why](../kernels/cuda/decisions/2026-11-22-bands.md)`).\n",
     "hal/README.md:3: a figure (91us)"),
    ("hal/README.md", "# hal\n\nIt takes 7.5 % less.\n", "hal/README.md:3: a figure (7.5%)"),
    # A part of a size, of a date and of a revision is no figure.
    ("hal/README.md", GOOD_TREE["hal/README.md"].replace("91 us", "640 us"), "hal/README.md:3: a figure (640us)"),
    ("hal/README.md", GOOD_TREE["hal/README.md"].replace("91 us", "22 us"), "hal/README.md:3: a figure (22us)"),
    ("hal/README.md", GOOD_TREE["hal/README.md"].replace("91 us", "48 us"), "hal/README.md:3: a figure (48us)"),
    # Named for the checker, and no reader finds it.
    ("kernels/README.md", GOOD_TREE["kernels/README.md"].replace("[Why](cuda/decisions/2026-11-22-bands.md)", "So"),
     "kernels/README.md:3: figures of 2026-11-22-bands.md, which this README does not link to"),
    ("config/preset.h", None, "config/README.md:3: figures of preset.h, which is not there"),
    ("kernels/README.md", "| a | 91.0 |\n|---|---|\n", "kernels/README.md:1: a figure (91.0) without a results file"),
    ("kernels/README.md", GOOD_TREE["kernels/README.md"].replace("91.0", "91.5"), "91.5 is not in 2026-11-22-bands.md"),
    ("kernels/cuda/decisions/2026-11-22-bands.md", None, "figures of 2026-11-22-bands.md, which is not there"),
]


class ReadmeTest(unittest.TestCase):
    def check(self, files):
        return run_checker("readme.py", files)

    def test_tree_that_keeps_the_rules_passes(self):
        self.assertEqual(self.check(GOOD_TREE), (0, "readme: clean\n"))

    def test_each_violation_fails_and_is_named(self):
        for name, text, message in BAD_FILES:
            with self.subTest(file=name, message=message):
                code, output = self.check({**GOOD_TREE, name: text})
                self.assertEqual(code, 1, output)
                self.assertIn(message, output)

    def test_limits_are_kept_to_the_word_and_the_line(self):
        fits = README + f"\n{' '.join(['word'] * 35)}.\n"
        fits += "\n" * (120 - len(fits.splitlines()))
        self.assertEqual(self.check({**GOOD_TREE, "README.md": fits})[0], 0)
        code, output = self.check({**GOOD_TREE, "README.md": fits + "\n"})
        self.assertIn("README.md:121: 121 lines", output)

    def test_sentences_end_where_they_end(self):
        half = " ".join(["word"] * 20)
        for text in (f"{half}. {half}.", f"{half}! {half}", f"({half}.) {half}", f"{half}\n\n{half}", f"{half}\n- {half}",
                     f"## {half} {half}", f"<!-- {half} {half} -->", f"{half}\n| a |\n{half}"):
            with self.subTest(text=text):
                self.assertEqual(self.check({**GOOD_TREE, "engine/README.md": text + "\n" + SECTIONS})[0], 0)

    def test_folder_that_is_no_tree_is_a_usage_error(self):
        code, _ = self.check({"notes.txt": "nothing"})
        self.assertEqual(code, 64)


if __name__ == "__main__":
    unittest.main()
