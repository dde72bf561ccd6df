#!/usr/bin/env python3
"""tools/report/picture.py on a run made for it: what is in the picture, and what is refused."""

import struct
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[3] / "tools" / "report" / "picture.py"
HEAD = ("ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty int num_observations\nproperty int map_id\n"
        "end_header\n")


class PictureTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        for name in ("colon/frames", "run/maps", "run/trajectory"):
            (self.folder / name).mkdir(parents=True)
        for i in range(4):
            (self.folder / f"colon/frames/{i:06}.jpg").write_bytes(b"picture %d" % i)
        rows = [(0, -1, 0), (1, 0, 0), (2, 0, 0), (3, -1, -1)]
        (self.folder / "run/frames.csv").write_text(
            "frame_idx,timestamp_ns,live_map_id,map_id\n" + "".join(f"{i},{i * 10**9},{a},{b}\n" for i, a, b in rows))
        points = [(x, y, z, 200, 100, 50, 2, 0) for x in range(4) for y in range(3) for z in range(2)]
        (self.folder / "run/maps/map_0000.ply").write_bytes(
            HEAD.format(len(points)).encode() + b"".join(struct.pack("<fffBBBii", *p) for p in points))
        (self.folder / "run/trajectory/map_0000.tum").write_text(
            "# poses\n" + "".join(f"{i} {i} {0.5 * i} 0 0 0 0 1\n" for i in range(3)))

    def call(self, *more):
        command = [sys.executable, SCRIPT, self.folder / "colon", self.folder / "run", self.folder / "p.svg", *more]
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
        return done.returncode, done.stderr

    def test_frame_points_path_and_states(self):
        self.assertEqual(self.call("--frame", "2"), (0, ""))
        text = (self.folder / "p.svg").read_text(encoding="utf-8")
        root = xml.etree.ElementTree.fromstring(text)
        svg = "{http://www.w3.org/2000/svg}"
        self.assertTrue(root.find(f"{svg}image").get("href").endswith("cGljdHVyZSAy"))  # "picture 2"
        self.assertEqual(len(root.findall(f"{svg}polyline")), 2)
        self.assertIn("M", root.find(f"{svg}g/{svg}path").get("d"))
        words = [t.text for t in root.findall(f"{svg}text")]
        self.assertIn("1 map, 24 points, and the path of the camera", words)
        self.assertEqual([w for w in words if w.endswith("frames")],
                         ["pose answered at the time: 2 frames", "pose found later: 1 frames", "no pose: 1 frames"])

    def test_frame_that_is_not_there_and_run_without_maps(self):
        code, said = self.call("--frame", "4")
        self.assertEqual((code, said), (1, "frame 4: the sequence has the frames 0 to 3\n"))
        (self.folder / "run/maps/map_0000.ply").unlink()
        code, said = self.call("--frame", "0")
        self.assertEqual(code, 1)
        self.assertIn("no map", said)

    def test_other_point_files_are_refused(self):
        ply = self.folder / "run/maps/map_0000.ply"
        ply.write_bytes(ply.read_bytes().replace(b"uchar red", b"uchar alpha"))
        code, said = self.call("--frame", "0")
        self.assertEqual(code, 1)
        self.assertIn("not a map of ours", said)


if __name__ == "__main__":
    unittest.main()
