#!/usr/bin/env python3
"""tools/benchmarks/flow_judge.py on pictures made by geometry: a camera with distortion inside a textured ball. Recoveries and
tracked chains with right and with wrong poses, gaps that nothing can be followed through, and the rays of the models."""

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
import flow_judge  # noqa: E402
from textured_ball import noise, range_inside_ball  # noqa: E402

WIDTH, HEIGHT, FOCAL, FRAMES = 200, 160, 110.0, 40
GAP = range(20, 25)  # frames without a pose
CALIBRATION = f"""model: kannala_brandt  # as a guess
width_px: {WIDTH}
height_px: {HEIGHT}
intrinsics:
  fx: {FOCAL}
  fy: {FOCAL}
  cx: 100
  cy: 80
coefficients:
  k1: -0.1
  k2: 0.01
  k3: 0
  k4: 0
"""


def rotation(axis, degrees):
    return cv2.Rodrigues(np.array(axis, float) * np.deg2rad(degrees))[0]


def true_pose(frame):
    return rotation((0.3, 1, 0.2), 0.4 * frame), np.array([0.05, 0.02, 0.03]) * frame


def picture(camera, pose):
    """Of the textured ball."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = camera.rays(np.stack([x.ravel(), y.ravel()], 1)) @ pose[0].T
    points = pose[1] + rays * range_inside_ball(pose[1], rays)[:, None]
    grey = 60 + 90 * noise(3 * points + 50, 1) + 60 * noise(8 * points + 50, 2)
    return grey.reshape(HEIGHT, WIDTH).astype(np.uint8)


def quaternion(matrix):
    vector = cv2.Rodrigues(matrix)[0].ravel()
    angle = np.linalg.norm(vector)
    axis = vector / angle if angle > 0 else vector
    return [*(axis * np.sin(angle / 2)), np.cos(angle / 2)]


class FlowJudgeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.clip = Path(cls.temporary.name) / "clip"
        (cls.clip / "frames").mkdir(parents=True)
        (cls.clip / "calib.yaml").write_text(CALIBRATION)
        camera = flow_judge.Camera(cls.clip / "calib.yaml")
        for frame in range(FRAMES):
            cv2.imwrite(str(cls.clip / f"frames/{frame:06}.png"), picture(camera, true_pose(frame)))

    def run_with(self, pose, gap=GAP, second_map=False):
        """A run's folder whose frame f has pose(f), but for the gap."""
        folder = Path(tempfile.mkdtemp(dir=self.temporary.name))
        (folder / "trajectory").mkdir()
        rows, lines = ["frame_idx,timestamp_ns,live_map_id,map_id"], {0: ["# a comment"], 1: []}
        for frame in range(FRAMES):
            of_map = -1 if frame in gap else int(second_map and frame >= gap[0])
            rows.append(f"{frame},{frame * 40000000},{of_map},{of_map}")
            if of_map >= 0:
                matrix, position = pose(frame)
                numbers = [frame * 0.04, *position, *quaternion(matrix)]
                lines[of_map].append(" ".join(f"{n:.9f}" for n in numbers))
        (folder / "frames.csv").write_text("\n".join(rows) + "\n")
        for index, of_map in lines.items():
            (folder / f"trajectory/map_{index:04}.tum").write_text("\n".join(of_map) + "\n")
        return folder

    @staticmethod
    def wrong_after_gap(frame):
        matrix, position = true_pose(frame)
        return (matrix, position) if frame < GAP[0] else (matrix @ rotation((1, 0, 0), 8), position)

    def test_true_recovery(self):
        found = flow_judge.judge(self.run_with(true_pose), self.clip)
        self.assertEqual((found["judged"], found["false"]), (1, 0), found)
        recovery = found["recoveries"][0]
        self.assertEqual((recovery["before"], recovery["after"], recovery["verdict"]), (19, 25, "true"))
        self.assertLess(recovery["px"], 0.5)

    def test_false_recovery(self):
        found = flow_judge.judge(self.run_with(self.wrong_after_gap), self.clip)
        self.assertEqual((found["judged"], found["false"]), (1, 1), found)
        self.assertGreater(found["recoveries"][0]["ratio"], flow_judge.FALSE_RATIO)

    def test_a_new_map_after_the_gap_is_no_recovery(self):
        self.assertEqual(flow_judge.judge(self.run_with(true_pose, second_map=True), self.clip)["recoveries"], [])

    def test_gap_without_corners_or_without_long_stretches_is_not_judged(self):
        clip = Path(tempfile.mkdtemp(dir=self.temporary.name))
        (clip / "frames").mkdir()
        (clip / "calib.yaml").write_text(CALIBRATION)
        for file in sorted((self.clip / "frames").iterdir()):
            (clip / "frames" / file.name).symlink_to(file)
        black = clip / "frames" / "000022.png"
        black.unlink()
        cv2.imwrite(str(black), np.zeros((HEIGHT, WIDTH), np.uint8))
        recovery = flow_judge.judge(self.run_with(true_pose), clip)["recoveries"][0]
        self.assertEqual((recovery["verdict"], recovery["reason"]), ("not judged", "0 corners left"))
        recovery = flow_judge.judge(self.run_with(true_pose, gap=range(4, 36)), self.clip)["recoveries"][0]
        self.assertEqual(recovery["verdict"], "not judged")
        self.assertIn("no tracked stretch", recovery["reason"])

    def test_stride_finds_a_map_that_is_wrong_all_over(self):
        found = flow_judge.judge(self.run_with(true_pose, gap=()), self.clip, stride=6)["tracked"]
        self.assertEqual({m["verdict"] for m in found["chains"]}, {"true"})
        self.assertEqual((len(found["chains"]), found["broken"]), (6, 0))

        def turning_back(frame):
            return rotation((0.3, 1, 0.2), -1.6 * frame), true_pose(frame)[1]
        found = flow_judge.judge(self.run_with(turning_back, gap=()), self.clip, stride=6)["tracked"]
        self.assertEqual({m["verdict"] for m in found["chains"]}, {"false"})

    def test_rays_undo_the_distortion(self):
        points = np.array([[0.1, -0.2, 1], [0.5, 0.4, 1], [-0.7, 0.1, 1], [0, 0, 1]])
        expected = points / np.linalg.norm(points, axis=1, keepdims=True)
        camera_matrix = np.array([[200, 0, 150], [0, 210, 120], [0, 0, 1.0]])
        models = {"pinhole": ((-0.3, 0.1, 0.002, -0.003, 0.01), cv2.projectPoints),
                  "kannala_brandt": ((-0.15, 0.03, 0.01, -0.002), cv2.fisheye.projectPoints)}
        for model, (k, project) in models.items():
            path = Path(self.temporary.name) / f"{model}.yaml"
            names = flow_judge.Camera.COEFFICIENTS[model]
            path.write_text(f"model: {model}\nintrinsics:\n  fx: 200\n  fy: 210\n  cx: 150\n  cy: 120\ncoefficients:\n" +
                            "".join(f"  {name}: {value}\n" for name, value in zip(names, k)))
            zero = np.zeros(3)
            if model == "pinhole":
                pixels, _ = project(points, zero, zero, camera_matrix, np.array(k))
            else:
                pixels, _ = project(points.reshape(-1, 1, 3), zero, zero, camera_matrix, np.array(k))
            np.testing.assert_allclose(flow_judge.Camera(path).rays(pixels.reshape(-1, 2)), expected, atol=1e-8)

    def test_the_calibration_that_a_run_writes_is_read(self):
        path = Path(self.temporary.name) / "written.yaml"
        path.write_text('%YAML:1.0\nCamera.type: "KannalaBrandt8"\nCamera.fx: 166.1\nCamera.fy: 166.2\nCamera.cx: 176.5\n'
                        "Camera.cy: 118.5\nCamera.k1: -0.1\nCamera.k2: 0.008\nCamera.k3: 0\nCamera.k4: 0\nCamera.RGB: 1\n")
        camera = flow_judge.Camera(path)
        self.assertEqual((camera.model, *camera.focal, *camera.centre), ("kannala_brandt", 166.1, 166.2, 176.5, 118.5))
        self.assertEqual(camera.k, [-0.1, 0.008, 0.0, 0.0])
        path.write_text('Camera.type: "Fishbowl"\n')
        with self.assertRaisesRegex(flow_judge.Refusal, "model is 'Fishbowl'; known here"):
            flow_judge.Camera(path)

    def test_errors_name_the_file(self):
        path = Path(self.temporary.name) / "other.yaml"
        path.write_text("model: ocamcalib\n")
        with self.assertRaisesRegex(flow_judge.Refusal, "other.yaml: model is 'ocamcalib'"):
            flow_judge.Camera(path)
        path.write_text("model: pinhole\nintrinsics:\n  fx: wide\n")
        with self.assertRaisesRegex(flow_judge.Refusal, "other.yaml"):
            flow_judge.Camera(path)


if __name__ == "__main__":
    unittest.main()
