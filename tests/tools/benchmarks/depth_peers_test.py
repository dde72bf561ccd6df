#!/usr/bin/env python3
"""tools/benchmarks/depth_peers.py on pictures made by geometry: a fisheye inside a textured ball, moved along its view and to
the side, with the range of every cell known."""

import sys
import tempfile
import unittest
from pathlib import Path

try:
    import cv2
    import numpy as np
except ImportError:
    print("skipped: numpy or OpenCV is not installed")
    sys.exit(77)

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "tools" / "benchmarks"))
import depth_peers  # noqa: E402
from textured_ball import noise, range_inside_ball  # noqa: E402

WIDTH, HEIGHT, FOCAL = 200, 160, 110.0
CAMERAS = f"# cameras\n1 OPENCV_FISHEYE {WIDTH} {HEIGHT} {FOCAL} {FOCAL} 100 80.5 -0.03 0.006 -0.002 0.0003\n"


class DepthPeersTest(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.folder = Path(holder.name)
        (self.folder / "cameras.txt").write_text(CAMERAS)
        self.camera = depth_peers.Camera(self.folder / "cameras.txt")
        self.is_scene = np.ones((HEIGHT, WIDTH), bool)

    def keyframe(self, place, turn=(0.0, 0.0, 0.0)):
        """At a place in the ball, in a map whose unit is the truth's."""
        world_from_cam = cv2.Rodrigues(np.array(turn))[0]
        place = np.array(place)
        view = depth_peers.Keyframe(0, np.array([1.0, 0, 0, 0, 0, 0, 0]), {})
        view.rotation, view.translation, view.centre = world_from_cam.T, -world_from_cam.T @ place, place
        view.world_from_cam, view.place = world_from_cam, place
        x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
        rays = self.camera.rays(np.stack([x, y], -1).astype(float)) @ world_from_cam.T
        points = place + range_inside_ball(place, rays)[..., None] * rays
        view.grey = np.uint8(40 + 120 * noise(6 * points + 100, 1) + 60 * noise(15 * points + 100, 2))
        view.truth = range_inside_ball(place, self.camera.cell_rays() @ world_from_cam.T)
        view.points = {i: points[8 * (i // 20), 10 * (i % 20)] for i in range(400)}
        return view

    def error_of(self, found, view):
        is_there = np.isfinite(found)
        return np.mean(is_there), np.median(np.abs(found - view.truth)[is_there] / view.truth[is_there])

    def test_a_ray_comes_back_to_its_pixel(self):
        x, y = np.meshgrid(np.arange(0, WIDTH, 7), np.arange(0, HEIGHT, 7))
        pixels = np.stack([x, y], -1).astype(float)
        np.testing.assert_allclose(self.camera.project(3.0 * self.camera.rays(pixels)), pixels, atol=1e-6)
        np.testing.assert_allclose(self.camera.project(np.array([0.0, 0.0, 2.0])), [99.5, 80.0], atol=1e-9)

    def test_range_is_found_wherever_the_scope_moved(self):
        view = self.keyframe((0, 0, 0))
        for name, place, least in (("forward", (0.05, 0.02, 0.9), 0.4), ("back", (0.1, 0.0, -0.9), 0.4),
                                   ("aside", (0.7, 0.1, 0.0), 0.7)):
            with self.subTest(name):
                other = self.keyframe(place, (0.05, -0.08, 0.1))
                answered, error = self.error_of(depth_peers.match(self.camera, self.is_scene, view, other), view)
                self.assertGreater(answered, least)
                self.assertLess(error, 0.015)

    def test_a_picture_of_something_else_is_hardly_answered(self):
        view, other = self.keyframe((0, 0, 0)), self.keyframe((0.7, 0, 0))
        other.grey = np.uint8(np.random.default_rng(3).integers(0, 255, other.grey.shape))
        answered, _ = self.error_of(depth_peers.match(self.camera, self.is_scene, view, other), view)
        self.assertLess(answered, 0.25)  # of the right one 0.88

    def test_two_pairs_must_agree(self):
        nan = np.nan
        found = depth_peers.agreed([np.array([1.00, 1.0, nan, 2.0]), np.array([1.02, 1.3, nan, nan]),
                                    np.array([1.01, nan, 1.0, 2.02])])
        np.testing.assert_allclose(found, [1.01, nan, nan, 2.01])

    def test_partners_are_those_under_a_useful_angle(self):
        views = [self.keyframe(place) for place in ((0, 0, 0), (0.05, 0, 0), (0.7, 0, 0), (0.4, 0, 0))]
        self.assertEqual(depth_peers.partners_of(views[0], views), [views[2], views[3], views[1]])
        views[3].points = {1000 + i: place for i, place in views[3].points.items()}
        self.assertEqual(depth_peers.partners_of(views[0], views), [views[2], views[1]])

    def test_judged_is_what_another_sees_under_an_angle(self):
        view, near, aside = self.keyframe((0, 0, 0)), self.keyframe((0.01, 0, 0)), self.keyframe((0.7, 0, 0))
        self.assertFalse(depth_peers.seen_cells(self.camera, [view, near], view).any())
        seen = depth_peers.seen_cells(self.camera, [view, near, aside], view)
        self.assertGreater(seen.mean(), 0.7)
        aside.truth = 0.8 * aside.truth  # something stands before the wall
        self.assertFalse(depth_peers.seen_cells(self.camera, [view, aside], view).any())


if __name__ == "__main__":
    unittest.main()
