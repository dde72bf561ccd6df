#!/usr/bin/env python3
"""The sweep of hardships with a made-up program: what is rendered, what is made again when, the tables, where a curve breaks.
With the real program as the first argument one short point is made as well.

    degradation_test.py [HAUSTRA]
"""

import json
import os
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree
from pathlib import Path

from made_up_program import HAUSTRA, MadeUpProgramTest
import degradation

# Notes every call beside itself. Live coverage falls by 40 with the exposure, and by 1 a seed; contraction splits the map.
FAKE_PROGRAM = """#!{python}
import json, pathlib, sys
arguments = sys.argv[1:]
with open(pathlib.Path(__file__).parent / "calls.txt", "a") as calls:
    calls.write(" ".join(arguments) + "\\n")
value = lambda name: float(arguments[arguments.index(name) + 1]) if name in arguments else 0.0
if arguments[0] == "render":
    if value("--readout") == 1.0:
        sys.exit("this cannot be rendered")
    sequence = pathlib.Path(arguments[1])
    (sequence / "frames").mkdir(parents=True, exist_ok=True)
    (sequence / "frames" / "000000.jpg").write_text("picture")
    (sequence / "groundtruth.txt").write_text(json.dumps([value("--exposure"), value("--contraction"), value("--seed")]))
elif arguments[0] == "run":
    out = pathlib.Path(arguments[arguments.index("--out") + 1])
    out.mkdir(exist_ok=True)
    (out / "summary.json").write_text("")
else:
    exposure, contraction, seed = json.loads(pathlib.Path(arguments[arguments.index("--groundtruth") + 1]).read_text())
    count = {{"made": 1, "judged": 1, "false": 0}}
    pathlib.Path(arguments[arguments.index("--json") + 1]).write_text(json.dumps({{
        "run": arguments[1], "live_coverage": 1.0, "live_visible_coverage": 98 - 40 * exposure - seed, "maps": 1 + (contraction > 8),
        "rms_ate": 0.4, "scene_depth": 40.0, "losses": 2, "join_counts": {{"merges": count}}, "stages": [1],
        "recall": {{"merges": {{"occasions": 2, "taken": 1}}, "relocalisations": None}}}}))
"""


class DegradationTest(MadeUpProgramTest):
    PROGRAM = FAKE_PROGRAM

    def call(self, *arguments):
        return super().call("degradation.py", "--results", self.folder / "results", "--commit", "1234567", "--seeds", "3",
                            *arguments)

    def test_tables_figures_and_curves_are_written(self):
        code, output, asked = self.call("--jobs", "2", "exposure", "contraction")
        self.assertEqual(code, 0, output)
        # Strength zero is shared: 1 + 4 + 5 points, three seeds, three calls each.
        self.assertEqual(len(asked), 90)
        files = sorted((self.folder / "results").iterdir())
        self.assertEqual([f.suffix for f in files], [".json", ".md", ".svg"])
        text = files[1].read_text(encoding="utf-8")
        self.assertIn("| 0 | 3 | 96.0 (95.0) | 1 (1) | 1.00 (1.00) | 50 (50) | 2 (2) | 0 |", text)
        self.assertIn("| 1 | 3 | 56.0 (55.0) |", text)
        self.assertIn("Breaks between 0 and 0.25 of the frame period: live coverage 96.0 to 86.0 %.", text)
        self.assertIn("Breaks between 6 and 9 % of the radius: maps 1 to 2.", text)
        self.assertIn("--seeds 3 --seconds 36 exposure contraction`", text)
        document = json.loads(files[0].read_text(encoding="utf-8"))
        self.assertEqual(document["points"]["exposure_1 2"]["live_visible_coverage"], 56)
        self.assertNotIn("stages", document["points"]["exposure_1 2"])
        root = xml.etree.ElementTree.parse(files[2]).getroot()
        self.assertEqual(len([e for e in root.iter() if e.tag.endswith("polyline")]), 8)
        self.assertEqual(len([e for e in root.iter() if e.tag.endswith("circle")]), 4 * 3 * (5 + 6))
        for file in files:
            self.assertNotIn(str(self.folder), file.read_text(encoding="utf-8"))
        self.assertFalse(list((self.folder / "out").rglob("frames")))

    def test_only_what_is_missing_or_has_changed_is_made(self):
        self.assertEqual(len(self.call("exposure")[2]), 45)
        self.assertEqual(self.call("exposure", "--overwrite")[2], [])
        (self.folder / "out" / "exposure_0.5" / "seed_2" / "figures.json").unlink()  # broken off before it was judged
        asked = self.call("exposure", "--overwrite")[2]
        self.assertEqual([line.split()[0] for line in asked], ["render", "run", "evaluate"])
        self.assertIn("--exposure 0.5", asked[0])
        self.assertEqual(len(self.call("exposure", "--overwrite", "--seconds", "20")[2]), 45)
        self.program.write_text(self.program.read_text() + "# another\n")
        self.assertEqual(len(self.call("exposure", "--overwrite", "--seconds", "20")[2]), 45)

    def test_results_that_are_there_stay_unless_told(self):
        self.assertEqual(self.call("exposure")[0], 0)
        code, output, asked = self.call("exposure")
        self.assertEqual((code, asked), (1, []))
        self.assertIn("is there already", output)

    def test_failed_point_writes_no_results_and_the_others_are_kept(self):
        code, output, _ = self.call("--ends-only", "readout")
        self.assertEqual(code, 1)
        self.assertIn("readout_1 seed 1: rendering failed: this cannot be rendered", output)
        self.assertFalse((self.folder / "results").exists())
        self.assertTrue((self.folder / "out" / "zero" / "seed_3" / "figures.json").exists())

    def test_video_goes_through_an_encoder_and_back(self):
        tools = self.folder / "encoder"
        tools.mkdir()
        encoder = tools / "ffmpeg"
        # Notes its arguments; decoding gives as many pictures as the name of the curve's point says.
        encoder.write_text(f"""#!{sys.executable}
import pathlib, sys
with open(r"{self.folder}/encoded.txt", "a") as calls:
    calls.write(" ".join(sys.argv[1:]) + "\\n")
pathlib.Path(sys.argv[-1].replace("%06d", "000000")).write_text("decoded")
if "h264_33/" in sys.argv[-1] and sys.argv[-1].endswith("png"):
    pathlib.Path(sys.argv[-1].replace("%06d", "000001")).write_text("one too many")
""", encoding="utf-8")
        encoder.chmod(0o755)
        path = os.environ["PATH"]
        self.addCleanup(os.environ.__setitem__, "PATH", path)
        os.environ["PATH"] = f"{tools}:{path}"
        code, output, asked = self.call("--keep-frames", "h264")
        self.assertEqual(code, 1)
        self.assertIn("h264_33 seed 1: encoding failed: the video has 2 pictures of 1", output)
        self.assertFalse([line for line in asked if "--h264" in line])
        encoded = (self.folder / "encoded.txt").read_text(encoding="utf-8").splitlines()
        self.assertEqual(len(encoded), 2 * 5 * 3)  # not the point of strength zero
        self.assertEqual(len([line for line in encoded if "-crf 23 " in line]), 3)
        frames = [p.name for p in (self.folder / "out" / "h264_23" / "seed_2" / "sequence" / "frames").iterdir()]
        self.assertEqual(frames, ["000000.png"])
        os.environ["PATH"] = str(tools)
        encoder.unlink()
        self.assertIn("needs ffmpeg", self.call("h264")[1])

    def test_two_calls_in_one_folder_are_refused(self):
        held = degradation.runs.claim(self.folder / "out")
        code, output, asked = self.call("exposure")
        held.close()
        self.assertEqual((code, asked), (1, []))
        self.assertIn("another call is at work there", output)
        self.assertEqual(self.call("--ends-only", "exposure")[0], 0)

    def test_unknown_curve_and_program_are_named(self):
        for arguments, words in ((["fog"], "no curve 'fog'"), (["--haustra", self.folder / "none"], "no such program")):
            code, output, asked = self.call(*arguments)
            self.assertEqual((code, asked), (1, []))
            self.assertIn(words, output)

    def test_strength_zero_of_every_curve_is_the_same_sequence(self):
        zero = degradation.render_options("focal", 0, 36)
        for name, (_, _, _, strengths) in degradation.CURVES.items():
            self.assertEqual(degradation.render_options(name, strengths[0], 36), zero, name)
            for strength in strengths[1:]:
                self.assertNotEqual(degradation.render_options(name, strength, 36), zero, name)
        self.assertIn("instrument@21.56+8", degradation.render_options("instrument", 8, 36))
        self.assertIn("narrowband@4.52+8", degradation.render_options("narrowband", 8, 12))

    def test_slips_lie_between_the_losses(self):
        self.assertIn("slip@25.56+0.5", degradation.render_options("slip", 1, 36))
        self.assertIn("slip@25.56+0.5,slip@11.52+0.5,slip@3.60+0.5,slip@17.64+0.5", degradation.render_options("slip", 4, 36))
        for share in degradation.SLIPS:
            for _, loss, seconds in degradation.LOSSES:
                self.assertFalse(loss - 0.5 / 36 < share < loss + seconds / 36, (share, loss))

    def test_hard_picture_has_everything_by_its_strength(self):
        half, whole = (" ".join(degradation.render_options("combined", s, 36)) for s in (0.5, 1))
        for words in ("exposure 0.5", "h264 23", "calibration-error 1", "breathing 3", "contraction 3", "stool 20", "fluid 30",
                      "lens-drops 8", "events instrument@9.52+4", "events redout@16.94+1.4", "events narrowband@21.40+4"):
            self.assertIn(f" --{words} ", whole)
        for words in ("exposure 0.25", "h264 11.5", "calibration-error 0.5", "lens-drops 4", "events instrument@10.52+2"):
            self.assertIn(f" --{words} ", half)
        self.assertTrue(half.endswith(" --events slip@25.56+0.5") and whole.endswith(" --events slip@25.56+0.5"))


@unittest.skipUnless(HAUSTRA, "no program was named")
class RenderedPointTest(unittest.TestCase):
    def test_program_takes_the_options_of_every_curve(self):
        for name, (_, _, _, strengths) in degradation.CURVES.items():
            # Too small to be rendered, so what is wrong is that alone.
            options, _ = degradation.split(degradation.render_options(name, strengths[-1], 36) + ["--size", "63x63"])
            with tempfile.TemporaryDirectory() as folder:
                options.remove(degradation.SIZE)
                options.remove("--size")
                done = subprocess.run([HAUSTRA, "render", Path(folder) / "out", *options], capture_output=True, text=True,
                                      check=False)
                self.assertIn("width is 63", done.stderr, name)

    def test_one_point_is_made_and_judged(self):
        with tempfile.TemporaryDirectory() as folder:
            render = ["--preset", "clear", "--seconds", "3", "--size", "240x180", "--quiet", "--contraction", "6"]
            figures = degradation.made_point(Path(folder) / "point", HAUSTRA, 1, render, False)
            self.assertIsInstance(figures, dict, figures)
            self.assertGreater(degradation.live(figures), 50.0)
            self.assertLess(degradation.error(figures), 10.0)
            self.assertFalse((Path(folder) / "point" / "run").exists())


if __name__ == "__main__":
    unittest.main()
