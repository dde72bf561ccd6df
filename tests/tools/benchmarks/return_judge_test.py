#!/usr/bin/env python3
"""tools/benchmarks/return_judge.py, on poses that are made up: what is one place is found to be, and what is off by so
much is said to be off by so much."""

import math
import sys
import tempfile
import unittest
from pathlib import Path

try:
    import numpy  # noqa: F401
except ImportError:
    print("skipped: numpy is not installed")
    sys.exit(77)

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "tools" / "benchmarks"))

import return_judge  # noqa: E402

TURN = 30.0


class ReturnJudgeTest(unittest.TestCase):
    """Frames 0 to 9; 4 to 9 come first, 0 to 5 after them, so 4 and 5 are shown twice."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.clip, self.run_folder = Path(folder.name) / "clip", Path(folder.name) / "run"
        self.clip.mkdir()
        (self.run_folder / "trajectory").mkdir(parents=True)
        model = self.run_folder / "maps" / "map_0000"
        model.mkdir(parents=True)
        sources = [(i, 0) for i in range(4, 10)] + [(-1, 0)] + [(i, 1) for i in range(6)]
        (self.clip / "sources.txt").write_text(f"# frame of the clip or -1, 1: turned by {TURN:g} degrees\n" +
                                               "".join(f"{a} {b}\n" for a, b in sources))
        (self.clip / "times.txt").write_text("".join(f"{0.04 * i:.6f}\n" for i in range(len(sources))))
        # Two points, 5 before a camera at the origin that looks along z.
        (model / "points3D.txt").write_text("# points\n7 0.5 0 5 0 0 0 1 1 0\n9 -0.5 0 5 0 0 0 1 1 1\n")
        (model / "images.txt").write_text("# images\n1 1 0 0 0 0 0 0 1 a.png\n10 10 7 20 20 9 30 30 -1\n")

    def write(self, poses):
        """(picture, angle about z in degrees of world_from_cam, centre)"""
        rows = [f"{0.04 * picture} {x} {y} {z} 0 0 {math.sin(math.radians(angle) / 2)} {math.cos(math.radians(angle) / 2)}\n"
                for picture, angle, (x, y, z) in poses]
        (self.run_folder / "trajectory" / "map_0000.tum").write_text("# poses\n" + "".join(rows))

    def test_a_place_that_is_found_again_is_in_one_place(self):
        # A picture that is turned clockwise is that of a camera turned the other way.
        self.write([(0, 10, (1, 0, 0)), (1, 10, (2, 0, 0)), (11, 10 - TURN, (1, 0, 0)), (12, 10 - TURN, (2, 0, 0))])
        found = return_judge.judge(self.run_folder, self.clip)
        self.assertEqual(found["pairs"], 2)
        self.assertEqual(len(found["maps"]), 1)
        self.assertEqual(found["maps"][0]["pairs"], 2)
        self.assertAlmostEqual(found["maps"][0]["worst_shift"], 0.0)
        self.assertLess(found["maps"][0]["worst_angle_deg"], 1e-4)

    def test_what_is_off_is_measured(self):
        self.write([(0, 0, (0, 0, 0)), (11, 3 - TURN, (0.1, 0, 0)), (12, 0, (9, 9, 9))])
        found = return_judge.judge(self.run_folder, self.clip)["maps"][0]
        self.assertEqual((found["pairs"], found["of"]), (1, 2))
        self.assertAlmostEqual(found["shift_percent_of_depth"], 2.0)
        self.assertAlmostEqual(found["angle_deg"], 3.0, places=5)

    def test_poses_in_two_maps_are_no_pair(self):
        self.write([(0, 0, (0, 0, 0)), (1, 0, (0, 0, 0))])
        self.assertEqual(return_judge.judge(self.run_folder, self.clip)["maps"], [])


if __name__ == "__main__":
    unittest.main()
