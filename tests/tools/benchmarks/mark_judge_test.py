#!/usr/bin/env python3
"""mark_judge.py on walls that are known, and with a program (first argument) on a short rendered sequence."""

import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools/benchmarks"))
import mark_judge  # noqa: E402

PROGRAM = sys.argv.pop(1) if len(sys.argv) > 1 else None

CALIBRATION = """%YAML:1.0
Camera.type: "KannalaBrandt8"
Camera.fx: 200.0
Camera.fy: 199.0
Camera.cx: 160.0
Camera.cy: 120.0
Camera.k1: -0.04
Camera.k2: 0.007
Camera.k3: -0.003
Camera.k4: 0.0004
Camera.width: 320
Camera.height: 240
"""


def write_depth(path, ranges, width=80, height=60):
    """`ranges`: of a pixel of the depth picture, mm."""
    values = [round(256 * ranges(i % width, i // width)) for i in range(width * height)]
    body = b"".join(value.to_bytes(2, "big") for value in values)
    path.write_bytes(b"P5\n# range\n%d %d\n65535\n" % (width, height) + body)


class Scene(unittest.TestCase):
    """Three frames: at the start, moved to the side, and with a fold over the left half."""

    def setUp(self):
        self.holder = tempfile.TemporaryDirectory()
        self.addCleanup(self.holder.cleanup)
        self.folder = pathlib.Path(self.holder.name)
        (self.folder / "depth").mkdir()
        (self.folder / "calib.yaml").write_text(CALIBRATION)
        poses = ["0 0 0 0 0 0 0 1", "0.04 10 0 0 0 0 0 1", "0.08 0 0 0 0 0 0 1"]
        (self.folder / "groundtruth.txt").write_text("# truth\n" + "\n".join(poses) + "\n")
        camera = mark_judge.Camera(self.folder / "calib.yaml")

        def wall(x, y):
            return 50.0 / camera.ray(4 * x + 1.5, 4 * y + 1.5)[2]  # the plane z = 50

        for frame in (0, 1):
            write_depth(self.folder / f"depth/{frame:06d}.pgm", wall)
        write_depth(self.folder / "depth/000002.pgm", lambda x, y: wall(x, y) * (0.5 if x < 40 else 1.0))
        self.sequence = mark_judge.Sequence(self.folder)

    def test_pixel_and_ray_are_inverse(self):
        for u, v in ((10, 20), (160, 120), (300, 200)):
            pixel = self.sequence.camera.project(self.sequence.camera.ray(u, v))
            self.assertAlmostEqual(pixel[0], u, places=6)
            self.assertAlmostEqual(pixel[1], v, places=6)

    def test_place_is_seen_where_it_lies_and_hidden_behind_the_fold(self):
        place = self.sequence.place(0, 100, 80)
        self.assertAlmostEqual(place[2], 50.0, delta=0.5)
        self.assertEqual(self.sequence.view(0, place)[0], "seen")
        view, pixel = self.sequence.view(1, place)
        self.assertEqual(view, "seen")
        self.assertLess(pixel[0], 100 - 20)
        self.assertEqual(self.sequence.view(2, place)[0], "hidden")
        self.assertEqual(self.sequence.view(2, self.sequence.place(0, 250, 80))[0], "seen")
        self.assertEqual(self.sequence.view(2, self.sequence.place(0, 160, 80))[0], "edge")

    def judged(self, rows):
        run = self.folder / "run"
        run.mkdir()
        (run / "summary.json").write_text(json.dumps({"marks": {"set": [], "refused": []}}))
        header = "frame_idx,mark,u_px,v_px,state,distance_in_depths\n"
        (run / "marks.csv").write_text(header + "".join(",".join(map(str, row)) + "\n" for row in rows))
        return mark_judge.judge(run, self.sequence, [(0, 100.0, 80.0, "a")])

    def test_right_pixel_is_found_and_a_wrong_one_is_not(self):
        place = self.sequence.place(0, 100, 80)
        u, v = self.sequence.view(1, place)[1]
        self.assertEqual(self.judged([(1, "a", u + 3, v, "in_front", 1)])["found_share"], 1.0)

    def test_pixel_that_is_off_is_not_found(self):
        place = self.sequence.place(0, 100, 80)
        u, v = self.sequence.view(1, place)[1]
        result = self.judged([(1, "a", u + 8, v, "in_front", 1)])
        self.assertEqual(result["found_share"], 0.0)
        self.assertEqual(result["frames"]["drawn_elsewhere"], 1)

    def test_mark_on_the_fold_before_it_is_counted(self):
        result = self.judged([(1, "a", 0, 0, "hidden", 1), (2, "a", 100, 80, "in_front", 1)])
        self.assertEqual(result["found_share"], 0.0)
        self.assertEqual(result["frames"]["seen_called_hidden"], 1)
        self.assertEqual(result["hidden_drawn_share"], 1.0)


@unittest.skipUnless(PROGRAM, "no program was given")
class Chain(unittest.TestCase):
    """Rendered, marked, run and judged."""

    def call(self, *arguments):
        return subprocess.run([PROGRAM, *map(str, arguments)], check=True, capture_output=True, text=True)

    def test_marks_are_found_and_change_nothing_else(self):
        with tempfile.TemporaryDirectory() as holder:
            folder = pathlib.Path(holder)
            self.call("render", folder / "colon", "--preset", "clear", "--seconds", 3, "--size", "360x270", "--depth", "--quiet")
            marks = folder / "marks.csv"
            mark_judge.main(["choose", str(folder / "colon"), "--out", str(marks), "--every", "20"])
            marks.write_text(marks.read_text() + "70,-5,10,outside\n74,100,100,m20\n900,1,1,never\n")
            common = ("--device", "cpu", "--report", "off", "--quiet")
            self.call("run", folder / "colon", "--out", folder / "plain", *common)
            self.call("run", folder / "colon", "--out", folder / "marked", "--marks", marks, *common)
            self.assertFalse((folder / "plain/marks.csv").exists())
            for name in ("frames.csv", "maps.csv", "events.csv", "trajectory/live.tum"):
                self.assertEqual((folder / "plain" / name).read_bytes(), (folder / "marked" / name).read_bytes(), name)
            result = mark_judge.judge(folder / "marked", mark_judge.Sequence(folder / "colon"), mark_judge.read_marks(marks)[:-3])
            self.assertGreaterEqual(result["frames"]["seen"], 40)
            self.assertGreaterEqual(result["found_share"], 0.9)
            refused = result["refused"]
            self.assertIn("outside the image", refused["outside"])
            self.assertIn("already", refused["m20"])
            self.assertIn("before its frame came", refused["never"])


if __name__ == "__main__":
    unittest.main()
