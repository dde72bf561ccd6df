#!/usr/bin/env python3
"""tools/benchmarks/reference_repeats.py on models made by geometry; COLMAP itself is not called."""

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

try:
    import numpy as np
except ImportError:
    print("skipped: numpy is not installed")
    sys.exit(77)

SCRIPT = Path(__file__).resolve().parents[3] / "tools" / "benchmarks" / "reference_repeats.py"
sys.path.insert(0, str(SCRIPT.parent))
import reference_repeats  # noqa: E402


class ReferenceRepeatsTest(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)

    def model(self, sights):
        """Cameras along x, a unit apart, turned by 90 degrees about z; points ten in front of the first camera."""
        half = np.sqrt(0.5)
        images = ["# two lines an image"]
        for frame in range(6):
            # X_cam = R X + t; the centre is -R' t.
            t = -reference_repeats.rotation(half, 0, 0, half) @ np.array([float(frame), 0.0, 0.0])
            images += [f"{frame + 1} {half} 0 0 {half} {t[0]} {t[1]} {t[2]} 1 {frame:06d}.png", "1 2 7 3 4 8"]
        points = [f"{k} 0 0 10 0 0 0 0.5 " + " ".join(f"{frame + 1} 0" for frame in frames)
                  for k, frames in enumerate(sights)]
        (self.folder / "images.txt").write_text("\n".join(images) + "\n")
        (self.folder / "points3D.txt").write_text("\n".join(points) + "\n")
        return reference_repeats.Model(self.folder)

    def test_centres_are_where_the_cameras_stand(self):
        model = self.model([[0, 1]])
        self.assertEqual(sorted(model.centres), list(range(6)))
        for frame, centre in model.centres.items():
            np.testing.assert_allclose(centre, [frame, 0, 0], atol=1e-12)

    def test_depth_is_the_distance_of_what_is_seen(self):
        self.assertAlmostEqual(self.model([[0], [0]]).depth(), 10.0)

    def test_points_in_common_are_a_share_of_the_smaller_side(self):
        # Frames 0 to 2 see three points, 3 to 5 one, and that is one of the three.
        shares = self.model([[0, 1], [2], [1, 4]]).shared(0, 3, 2)
        self.assertEqual(shares, [[1.0, 1.0], [1.0, 1.0]])
        shares = self.model([[0], [1], [4], [5]]).shared(0, 3, 2)
        self.assertEqual(shares, [[1.0, 0.0], [0.0, 1.0]])

    def test_a_similarity_makes_no_difference_and_a_bend_does(self):
        rng = np.random.default_rng(3)
        truth = {frame: rng.normal(size=3) for frame in range(30)}
        turned = reference_repeats.rotation(np.cos(0.4), 0, np.sin(0.4), 0)
        moved = {frame: 2.5 * turned @ centre + [1, 2, 3] for frame, centre in truth.items() if frame % 2 == 0}
        rms, count, scale = reference_repeats.difference(moved, truth)
        self.assertEqual(count, 15)
        self.assertAlmostEqual(rms, 0.0)
        self.assertAlmostEqual(scale, 0.4)
        moved[4] = moved[4] + 1.0
        self.assertGreater(reference_repeats.difference(moved, truth)[0], 0.05)
        with self.assertRaises(reference_repeats.Refusal):
            reference_repeats.difference({0: truth[0]}, truth)

    def test_calibration_of_smaller_pictures_is_in_colmaps_pixels(self):
        (self.folder / "calib.yaml").write_text(
            "model: pinhole\nintrinsics:\n  fx: 700\n  fy: 700\n  cx: 639.5\n  cy: 359.5\ncoefficients:\n  k1: -0.1\n")
        self.assertEqual(reference_repeats.calibration(self.folder, 2), ("SIMPLE_RADIAL", "350.0,320.0,180.0,-0.1"))

    def test_a_model_becomes_a_reference(self):
        model, times = self.model([[0, 1]]), 0.04 * np.arange(6)
        path = self.folder / "reference.txt"
        reference_repeats.write_reference(model, times, path)
        centres = reference_repeats.centres_by_time(path, times)
        self.assertEqual(sorted(centres), list(range(6)))
        for frame, centre in centres.items():
            np.testing.assert_allclose(centre, [frame, 0, 0], atol=1e-8)
        # The cameras are turned by 90 degrees about z from the world, so back by as much.
        half = np.sqrt(0.5)
        for fields in reference_repeats.lines_of(path):
            np.testing.assert_allclose([float(value) for value in fields[4:]], [0, 0, -half, half], atol=1e-8)

    def test_the_camera_of_a_model_is_written_in_pixels_of_the_clip(self):
        text = "model: kannala_brandt\nintrinsics:\n  fx: 1\n  fy: 1\n  cx: 1\n  cy: 1\ncoefficients:\n  k1: 1\n  k2: 0\n"
        (self.folder / "calib.yaml").write_text(text)
        out = self.folder / "new"
        out.mkdir()
        camera = ["1", "SIMPLE_RADIAL_FISHEYE", "640", "360", "350", "320", "180", "-0.1"]
        reference_repeats.write_calibration(self.folder, camera, 2, out / "calib.yaml")
        self.assertEqual(reference_repeats.calibration(out, 2), ("SIMPLE_RADIAL_FISHEYE", "350.0,320.0,180.0,-0.1"))
        self.assertIn("k2: 0\n", (out / "calib.yaml").read_text())

    def test_frames_are_told_by_their_time(self):
        path = self.folder / "reference.txt"
        path.write_text("# time_s tx ty tz qx qy qz qw\n0.0400 1 2 3 0 0 0 1\n0.0610 4 5 6 0 0 0 1\n")
        centres = reference_repeats.centres_by_time(path, np.array([0.0, 0.04, 0.08]))
        self.assertEqual(list(centres), [1])
        np.testing.assert_array_equal(centres[1], [1, 2, 3])

    def test_a_folder_of_others_is_not_replaced(self):
        (self.folder / "mine").mkdir()
        found = subprocess.run([sys.executable, SCRIPT, self.folder, self.folder / "mine", "--overwrite"],
                               capture_output=True, text=True, check=False)
        self.assertEqual(found.returncode, 1)
        self.assertIn("was not made by this", found.stderr)
        self.assertTrue((self.folder / "mine").is_dir())


if __name__ == "__main__":
    unittest.main()
