#!/usr/bin/env python3
"""The benchmarks' scripts with a made-up program: the tables, and what is run again when. With the real program as the first
argument a small rendered colon is taken for a real clip as well.

    benchmarks_test.py [HAUSTRA]
"""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from made_up_program import HAUSTRA, SCRIPTS, MadeUpProgramTest
import real_clips
import results
import runs

# Notes every call in calls.txt beside itself. What it finds depends on the seed.
FAKE_PROGRAM = """#!{python}
import json, pathlib, sys
arguments = sys.argv[1:]
with open(pathlib.Path(__file__).parent / "calls.txt", "a") as calls:
    calls.write(" ".join(arguments) + "\\n")
if arguments[0] == "run":
    if "fail=true" in arguments:
        sys.exit("this run fails")
    out = pathlib.Path(arguments[arguments.index("--out") + 1])
    out.mkdir(exist_ok="--overwrite" in arguments)
    share = max([float(a[len("share="):]) for a in arguments if a.startswith("share=")], default=1.0)
    (out / "summary.json").write_text(arguments[arguments.index("--seed") + 1] + " " + str(share))
else:
    seed, share = pathlib.Path(arguments[1], "summary.json").read_text().split()
    seed, share = int(seed), float(share)
    has_truth = "--groundtruth" in arguments
    count = {{"made": 1, "judged": 1, "false": seed == 3, "precision": 1.0}}
    report = {{
        "live_coverage": 50.0 + 10 * seed, "coverage": 60.0 + 10 * seed, "live_visible_coverage": None,
        "visible_coverage": None, "run": arguments[1], "unit": "mm", "maps_created": seed, "maps": 1, "largest_map_frames": 4 * seed, "losses": 2,
        "relocalisations": 1, "merges": 0, "loops": 0, "rms_ate": 0.5 * share if has_truth else None,
        "keyframes": 100 * share, "map_points": 4000,
        "largest_map_rms_ate_percent_of_depth": 1.5 * seed if has_truth else None,
        "stages": [{{"stage": "frame/total", "mean": 30.25}}],
        "recall": {{"merges": {{"occasions": seed, "taken": 1}} if has_truth else None, "relocalisations": None}},
        "join_counts": {{"merges": count, "recoveries": {{**count, "false": 0}}}},
    }}
    pathlib.Path(arguments[arguments.index("--json") + 1]).write_text(json.dumps(report))
"""


class ScriptTest(MadeUpProgramTest):
    PROGRAM = FAKE_PROGRAM

    def setUp(self):
        super().setUp()
        self.clip = self.make_clip("clip", 10, "reference.txt")

    def make_clip(self, name, num_frames, truth=None):
        for i in range(num_frames):
            self.write(f"{name}/frames/{i:06}.png", f"picture {i}")
        self.write(f"{name}/times.txt", "".join(f"{0.04 * i:.6f}\n" for i in range(num_frames)))
        self.write(f"{name}/calib.yaml", "model: pinhole\n")
        if truth:
            # Every second frame, that of number 4 missing.
            self.write(f"{name}/{truth}", "# time_s tx ty tz qx qy qz qw\n" +
                       "".join(f"{0.04 * i:.6f} {i} 0 0 0 0 0 1\n" for i in (0, 2, 6, 8)))
        return self.folder / name

    def call(self, script, *arguments):
        """Of what the program was asked, the commands."""
        code, output, asked = super().call(script, *arguments)
        return code, output, [line.split()[0] for line in asked]


class RealClipsTest(ScriptTest):
    def test_table_has_median_and_worst_of_the_seeds(self):
        code, output, _ = self.call("real_clips.py", "--seeds", "3", "--jobs", "2", self.clip)
        self.assertEqual(code, 0, output)
        table = [[cell.strip() for cell in line.strip("|").split("|")] for line in output.splitlines()
                 if line.startswith("|")]
        self.assertEqual({len(row) for row in table}, {len(table[0])})
        row = dict(zip(table[0], table[2]))
        self.assertEqual(row["clip"], "clip")
        self.assertEqual(row["frames"], "10")
        self.assertEqual(row["runs"], "3")
        self.assertEqual(row["reference %"], "60.0")  # 0 to 2 and 6 to 8
        self.assertEqual(row["live coverage %"], "70.0 (60.0)")
        self.assertEqual(row["coverage at the end %"], "80.0 (70.0)")
        self.assertEqual(row["maps begun"], "2 (1 to 3)")
        self.assertEqual(row["frames of the largest"], "8 (4)")
        self.assertEqual(row["error of the largest, % of depth"], "3.00 (4.50)")
        self.assertEqual(row["ms a frame"], "30.2 (30.2)")
        self.assertEqual(row["pairs joined"], "3 of 6")
        self.assertEqual(row["false joins"], "1")
        self.assertEqual((self.folder / "out" / "table.md").read_text(encoding="utf-8"), output)
        figures = json.loads((self.folder / "out" / "figures.json").read_text(encoding="utf-8"))
        self.assertEqual(figures["clips"][0]["seeds"]["2"]["live_coverage"], 70.0)

    def test_clip_without_a_reference_has_dashes(self):
        clip = self.make_clip("bare", 4)
        code, output, _ = self.call("real_clips.py", "--seeds", "1", clip)
        self.assertEqual(code, 0, output)
        cells = output.splitlines()[-1].split(" | ")
        self.assertEqual(cells[3], "-")
        self.assertEqual(cells[-2:], ["-", "- |"])

    def test_range_is_a_sequence_of_links(self):
        code, output, _ = self.call("real_clips.py", "--seeds", "1", f"{self.clip}:2-5", self.clip)
        self.assertEqual(code, 0, output)
        sequence = self.folder / "out" / "sequences" / "clip_2-5"
        frames = sorted((sequence / "frames").iterdir())
        self.assertEqual([f.name for f in frames], [f"{i:06}.png" for i in range(2, 6)])
        self.assertTrue(all(f.is_symlink() for f in frames))
        self.assertEqual((sequence / "times.txt").read_text().split(), ["0.080000", "0.120000", "0.160000", "0.200000"])
        self.assertEqual((sequence / "calib.yaml").read_text(), "model: pinhole\n")
        self.assertIn("| clip_2-5 | 4 | 1 | 25.0 |", output)
        self.assertIn("| clip | 10 | 1 | 60.0 |", output)

    def test_range_beyond_the_clip_and_twins_are_refused(self):
        for clips in ([f"{self.clip}:5-10"], [f"{self.clip}:5-4"], [self.clip, self.clip], [self.folder / "none"]):
            code, output, asked = self.call("real_clips.py", *clips)
            self.assertNotEqual(code, 0, output)
            self.assertEqual(asked, [])
            self.assertNotIn("Traceback", output)

    def test_failed_run_is_told_and_no_results_are_written(self):
        code, output, _ = self.call("real_clips.py", "--seeds", "2", "--set", "fail=true", self.clip)
        self.assertEqual(code, 1)
        self.assertIn("clip seed 2: run failed: this run fails", output)
        self.assertIn("2 runs failed: no results are written", output)
        self.assertFalse((self.folder / "out" / "table.md").exists())
        self.assertFalse((self.folder / "out" / "figures.json").exists())

    def test_only_what_has_changed_is_made_again(self):
        def asked(*arguments):
            code, output, calls = self.call("real_clips.py", "--seeds", "1", self.clip, *arguments)
            self.assertEqual(code, 0, output)
            return calls

        both = ["run", "evaluate"]
        self.assertEqual(asked(), both)
        self.assertEqual(asked(), [])
        self.assertEqual(asked("--set", "a.b=1"), both)
        self.assertEqual(asked("--set", "a.b=1"), [])
        self.write("clip/calib.yaml", "model: kannala_brandt\n")
        self.assertEqual(asked("--set", "a.b=1"), both)
        with open(self.clip / "reference.txt", "a", encoding="ascii") as file:
            file.write("0.36 9 0 0 0 0 0 1\n")
        self.assertEqual(asked("--set", "a.b=1"), ["evaluate"])
        config = self.write("c.yaml", "a: 1\n")
        self.assertEqual(asked("--config", config), both)
        self.write("c.yaml", "a: 2\n")
        self.assertEqual(asked("--config", config), both)
        self.program.write_text(self.program.read_text() + "# another\n")
        self.assertEqual(asked("--config", config), both)
        judge = self.write("bin/judge", self.program.read_text() + "# a judge\n")
        judge.chmod(self.program.stat().st_mode)
        self.assertEqual(asked("--config", config, "--judge", judge), ["evaluate"])
        # Broken off before it was judged.
        (self.folder / "out" / "clip" / "seed_1" / "evaluation.json").unlink()
        self.assertEqual(asked("--config", config, "--judge", judge), ["evaluate"])
        (self.folder / "out" / "clip" / "seed_1" / "run_made_with.json").unlink()
        self.assertEqual(asked("--config", config, "--judge", judge), both)

    def test_cell(self):
        self.assertEqual(real_clips.cell([3, None, 1], 0, max), "2 (3)")
        self.assertEqual(real_clips.cell([1, 2], 0, None), "1.5 (1 to 2)")
        self.assertEqual(real_clips.cell([None], 1, min), "-")
        self.assertEqual(real_clips.cell([], 1, min), "-")


class AblationTest(ScriptTest):
    def test_table_and_reuse(self):
        sequence = self.make_clip("colon", 4, "groundtruth.txt")
        arguments = ("ablation.py", "--seeds", "2", "--variants", "default", "no_merging", "--", sequence)
        code, output, asked = self.call(*arguments)
        self.assertEqual(code, 0, output)
        self.assertEqual(sorted(asked), ["evaluate"] * 4 + ["run"] * 4)
        self.assertIn("| colon | no_merging | 2 | 65.0 (60.0) | 75.0 (70.0) | 1.0 | 6 | 0.0 |", output)
        self.assertIn("- `no_merging`: every loss leaves a map of its own; `--set merging.enabled=false`", output)
        self.assertEqual(self.call(*arguments), (0, output, []))


class ResultsTest(ScriptTest):
    def setUp(self):
        super().setUp()
        self.colon = self.make_clip("silicone", 4, "groundtruth.txt")
        self.readme = self.write("README.md", f"before\n{results.BEGIN}\nold\n{results.END}\nbehind\n")
        self.made = self.folder / "results"

    def call_results(self, *arguments):
        return self.call("results.py", "--seeds", "3", "--commit", "1234567", "--results", self.made, "--readme", self.readme,
                         *arguments)

    def test_table_machine_command_and_raw_figures_are_written_and_pasted(self):
        code, output, asked = self.call_results(self.colon, f"{self.clip}:2-9")
        self.assertEqual(code, 0, output)
        self.assertEqual(sorted(asked), ["evaluate"] * 6 + ["run"] * 6)
        files = sorted(self.made.iterdir())
        self.assertEqual([f.suffix for f in files], [".json", ".md"])
        self.assertRegex(files[1].name, r"^\d{4}-\d\d-\d\d-1234567\.md$")
        text = files[1].read_text(encoding="utf-8")
        # ORB-SLAM3's are those of peers.json.
        row = "| silicone | 3 | 70.0 (60.0) | 80.0 (70.0) | 1 (1) | 8 (4) | 2 (2) | 1 | 0.50 mm (0.50) | 62.0, 1, 0.30 mm |"
        self.assertIn(row, text)
        self.assertIn("| clip_2-9 | 3 | 70.0 (60.0) | 80.0 (70.0) | 1 (1) | 8 (4) | 2 (2) | 1 | 3.00 % (4.50) | - |", text)
        self.assertIn("--seeds 3 silicone clip:2-9`", text)
        self.assertIn("- machine: ", text)
        self.assertIn(runs.digest_of_file(self.program), text)
        raw = json.loads(files[0].read_text(encoding="utf-8"))
        self.assertEqual(raw["sequences"]["silicone"]["3"]["live_coverage"], 80.0)
        self.assertEqual(raw["commit"], "1234567")
        for file in files:
            self.assertNotIn(str(self.folder), file.read_text(encoding="utf-8"))
        readme = self.readme.read_text(encoding="utf-8")
        self.assertTrue(readme.startswith(f"before\n{results.BEGIN}\n| sequence |"), readme)
        self.assertTrue(readme.endswith(f"{results.END}\nbehind\n"), readme)
        self.assertIn(row, readme)
        self.assertIn(f"[{files[1].name}](tools/benchmarks/results/{files[1].name})", readme)
        self.assertNotIn("old", readme)

    def test_results_that_are_there_stay_unless_told(self):
        self.assertEqual(self.call_results("--keep-readme", self.colon)[0], 0)
        self.assertIn("old", self.readme.read_text(encoding="utf-8"))
        code, output, asked = self.call_results(self.colon)
        self.assertEqual((code, asked), (1, []))
        self.assertIn("is there already (--overwrite replaces it)", output)
        self.assertEqual(self.call_results("--overwrite", self.colon)[0], 0)

    def test_failed_run_writes_nothing(self):
        code, output, _ = self.call_results("--set", "fail=true", self.colon)
        self.assertEqual(code, 1)
        self.assertIn("no results are written", output)
        self.assertFalse(self.made.exists())
        self.assertIn("old", self.readme.read_text(encoding="utf-8"))

    def test_readme_without_markers_is_left_alone(self):
        self.readme.write_text(f"{results.END} {results.BEGIN}", encoding="utf-8")
        code, output, _ = self.call_results(self.colon)
        self.assertEqual(code, 1)
        self.assertIn("needs one <!-- results: begin -->", output)
        self.assertEqual(self.readme.read_text(encoding="utf-8"), f"{results.END} {results.BEGIN}")

    def test_peers_of_several_runs_are_a_range(self):
        peers = {"orb_slam3": {"sequences": {"a": {"coverage": [54.7, 61.8], "maps": [4, 4]}}}}
        self.assertEqual(results.peer_cell(peers, "a"), "54.7 to 61.8, 4")
        self.assertEqual(results.peer_cell(peers, "b"), "-")


class SweepTest(ScriptTest):
    def sweep(self, *arguments):
        return self.call("sweep.py", "--results", self.folder / "results", "--commit", "1234567", "--seeds", "3", "--key", "share",
                         *arguments)

    def test_a_table_a_sequence_and_one_of_all(self):
        colon = self.make_clip("colon", 4, "groundtruth.txt")
        code, output, asked = self.sweep("--values", "0.5,1", "--jobs", "2", colon, self.clip)
        self.assertEqual(code, 0, output)
        self.assertEqual(len(asked), 2 * 2 * 3 * 2)
        files = sorted((self.folder / "results").iterdir())
        self.assertEqual([f.suffix for f in files], [".json", ".md"])
        text = files[1].read_text(encoding="utf-8")
        # By hand: means of 70 and 70; ratios 0.5 of the colon's error, 1 of the clip's, 0.5 of the keyframes.
        self.assertIn("| 0.5 | 70.0 | 80.0 | 1.0 | 2.0 | 50.0 | 0.71 | 0.50 | 1.00 | 2 |", text)
        self.assertIn("| 1 | 70.0 | 80.0 | 1.0 | 2.0 | 50.0 | 1.00 | 1.00 | 1.00 | 2 |", text)
        colon_table = text[text.index("## colon"):text.index("## clip")]
        self.assertIn("error, mm", colon_table)
        self.assertIn("| 0.5 | 3 | 70.0 (60.0) | 80.0 (70.0) | 1 (1) | 2 (2) | 50 (33) | 0.250 (0.250) | 50 (50) | 4000 (4000) | 1 |",
                      colon_table)
        self.assertIn("error, %", text[text.index("## clip"):])
        self.assertIn("--seeds 3 --key share --values 0.5,1 colon clip`", text)
        document = json.loads(files[0].read_text(encoding="utf-8"))
        self.assertEqual(document["values"]["0.5"]["colon"]["2"]["keyframes"], 50)
        self.assertNotIn("stages", document["values"]["0.5"]["colon"]["2"])
        for file in files:
            self.assertNotIn(str(self.folder), file.read_text(encoding="utf-8"))

    def test_what_is_there_is_not_made_again_and_results_stay_unless_told(self):
        self.assertEqual(self.sweep("--values", "0.5,1", self.clip)[0], 0)
        code, output, asked = self.sweep("--values", "0.5,0.7,1", self.clip)
        self.assertNotEqual(code, 0)
        self.assertIn("--overwrite", output)
        self.assertEqual(asked, [])
        code, output, asked = self.sweep("--values", "0.5,0.7,1", "--overwrite", self.clip)
        self.assertEqual(code, 0, output)
        self.assertEqual(len(asked), 3 * 2)

    def test_values_that_make_no_curve_and_failed_runs_write_nothing(self):
        for values in ("0.5", "0.5,0.5", "0.5,", ""):
            code, output, asked = self.sweep("--values", values, self.clip)
            self.assertNotEqual(code, 0, output)
            self.assertEqual(asked, [])
            self.assertNotIn("Traceback", output)
        code, output, _ = self.sweep("--values", "0.5,1", "--set", "fail=true", self.clip)
        self.assertIn("6 runs failed", output)
        self.assertNotEqual(code, 0)
        self.assertFalse((self.folder / "results").exists())


class RunsTest(unittest.TestCase):
    def test_numbers_that_are_not_known_are_left_out(self):
        self.assertEqual(runs.mean([1, None, 3]), 2)
        self.assertIsNone(runs.mean([None]))
        self.assertEqual(runs.text(None, 2), "-")
        self.assertEqual(runs.text(1 / 3, 2), "0.33")


@unittest.skipUnless(HAUSTRA, "no program was named")
class RenderedClipTest(unittest.TestCase):
    def test_small_colon_is_mapped_and_judged(self):
        with tempfile.TemporaryDirectory() as folder:
            colon = Path(folder) / "colon"
            subprocess.run([HAUSTRA, "render", colon, "--preset", "clear", "--seconds", "3", "--size", "240x180", "--quiet"],
                           check=True)
            (colon / "groundtruth.txt").rename(colon / "reference.txt")
            command = [sys.executable, SCRIPTS / "real_clips.py", "--haustra", HAUSTRA, "--out", Path(folder) / "out",
                       "--seeds", "1", f"{colon}:5-74"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            figures = json.loads((Path(folder) / "out" / "figures.json").read_text(encoding="utf-8"))["clips"][0]
            self.assertEqual(figures["frames"], 70)
            self.assertEqual(figures["reference_coverage"], 100.0)
            seed = figures["seeds"]["1"]
            self.assertGreaterEqual(seed["coverage"], seed["live_coverage"])
            self.assertGreaterEqual(seed["live_coverage"], 50.0)
            self.assertLess(seed["largest_map_rms_ate_percent_of_depth"], 5.0)
            self.assertGreater(seed["ms_per_frame"], 0.0)


if __name__ == "__main__":
    unittest.main()
