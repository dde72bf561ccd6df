#!/usr/bin/env python3
"""tools/benchmarks/recordings.py: which frame a kind shows when, where the camera goes with the pixels, and the pixels
themselves where FFmpeg is: ctest shows these by a name of their own."""

import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[3] / "tools" / "benchmarks" / "recordings.py"
sys.path.insert(0, str(SCRIPT.parent))

import recordings  # noqa: E402

WIDTH, HEIGHT, FRAMES = 160, 120, 300
CALIBRATION = f"""model: kannala_brandt
width_px: {WIDTH}
height_px: {HEIGHT}
rate_hz: 25
intrinsics:
  fx: 80.5
  fy: 81.5
  cx: 79.5
  cy: 59.5
coefficients:
  k1: -0.1
"""


class ClipTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.clip = self.make_clip(FRAMES)

    def make_clip(self, num_frames):
        """Each picture is a grey of its own, with a bright left column."""
        clip = self.folder / "clip"
        shutil.rmtree(clip, ignore_errors=True)
        (clip / "frames").mkdir(parents=True)
        for i in range(num_frames):
            row = bytes([250]) + bytes([60 + i % 100]) * (WIDTH - 1)
            (clip / "frames" / f"{i:06d}.pgm").write_bytes(f"P5 {WIDTH} {HEIGHT} 255\n".encode() + row * HEIGHT)
        (clip / "times.txt").write_text("".join(f"{0.04 * i:.6f}\n" for i in range(num_frames)))
        (clip / "calib.yaml").write_text(CALIBRATION)
        (clip / "reference.txt").write_text("0.04 0 0 0 0 0 0 1\n")
        return clip

    def make(self, kind, *options):
        command = [sys.executable, SCRIPT, self.clip, "--out", self.folder / "out", "--only", kind, *options]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return self.folder / "out" / f"clip_{kind}"

    def grey(self, picture):
        command = ["ffmpeg", "-v", "error", "-i", str(picture), "-f", "rawvideo", "-pix_fmt", "gray", "-"]
        return subprocess.run(command, capture_output=True, check=True).stdout

    def shown(self, made, num=None):
        """(time, number of the frame of the clip) of the first pictures of a kind that are links; of all."""
        times = [float(line) for line in (made / "times.txt").read_text().split()]
        frames = sorted((made / "frames").iterdir())
        self.assertEqual(len(times), len(frames))
        return [(time, int(frame.resolve().stem)) for time, frame in list(zip(times, frames))[:num]]


class RecordingsTest(ClipTest):
    def test_twice_shows_each_frame_twice_in_the_same_time(self):
        shown = self.shown(self.make("twice"))
        self.assertEqual(len(shown), 2 * FRAMES)
        for time, frame in shown:
            self.assertEqual(frame, int(time / 0.04 + 1e-6))

    def test_telecine_shows_the_frame_of_the_time_at_thirty_a_second(self):
        shown = self.shown(self.make("telecine"))
        self.assertAlmostEqual(shown[1][0], 1 / 30, places=5)
        self.assertEqual(len(shown), FRAMES * 6 // 5)
        for time, frame in shown:
            self.assertEqual(frame, int(time / 0.04 + 1e-3))

    def test_freeze_stands_still_and_jumps(self):
        made = self.make("freeze")
        shown = [frame for _, frame in self.shown(made)]
        self.assertEqual(shown[:61], list(range(61)))
        self.assertEqual(shown[61:100], [60] * 39)
        self.assertEqual(shown[100:211], list(range(100, 211)))
        self.assertEqual(shown[211:250], [210] * 39)
        # A picture that is not of its time has no pose in a reference.
        self.assertFalse((made / "reference.txt").exists())

    def test_half_keeps_the_times_and_the_reference(self):
        made = self.make("half")
        self.assertEqual(self.shown(made)[3], (0.24, 6))
        self.assertTrue((made / "reference.txt").is_file())

    def test_the_camera_goes_with_the_pixels(self):
        camera = recordings.Camera(self.clip / "calib.yaml")
        (self.clip / "calib.yaml").write_text(camera.moved(2 * WIDTH, 2 * HEIGHT, scale=2))
        larger = recordings.Camera(self.clip / "calib.yaml")
        # The middle of the picture stays its middle: pixel centres are at integers.
        self.assertEqual([larger.value(name) for name in ("fx", "fy", "cx", "cy")], [161.0, 163.0, 159.5, 119.5])
        self.assertEqual((larger.width, larger.height), (2 * WIDTH, 2 * HEIGHT))
        self.assertEqual(larger.value("k1"), -0.1)

    def test_an_unknown_kind_is_named(self):
        done = subprocess.run([sys.executable, str(SCRIPT), str(self.clip), "--out", str(self.folder), "--only", "half,x"],
                              capture_output=True, text=True, check=False)
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("no kind x", done.stderr)


@unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
class PixelsTest(ClipTest):
    def test_surround_is_dark_and_the_window_is_as_it_was(self):
        self.clip = self.make_clip(5)
        made = self.make("surround")
        camera = recordings.Camera(made / "calib.yaml")
        self.assertEqual((camera.width, camera.height), (320, 180))
        left, top = int(camera.value("cx") - 79.5), int(camera.value("cy") - 59.5)
        self.assertEqual(len(list((made / "frames").iterdir())), 5)
        raw = self.grey(made / "frames" / "000003.png")
        rows = [raw[320 * y:320 * (y + 1)] for y in range(180)]
        self.assertEqual(rows[top + 10][left:left + 3], bytes([250, 63, 63]))
        self.assertLess(rows[top + 10][left - 1], 20)
        self.assertLess(rows[top - 1][left + 5], 20)
        self.assertLess(rows[top + HEIGHT][left + 5], 20)

    def test_back_shows_what_it_began_with_again_and_turned(self):
        self.clip = self.make_clip(50)
        made = self.make("back", "--turn", 20)
        rows = [line.split() for line in (made / "sources.txt").read_text().splitlines() if not line.startswith("#")]
        expected = [(str(i), "0") for i in range(20, 50)] + [("-1", "0")] * 30 + [(str(i), "1") for i in range(30)]
        self.assertEqual([tuple(row) for row in rows], expected)
        self.assertEqual([frame for _, frame in self.shown(made, 30)], list(range(20, 50)))
        self.assertFalse((made / "reference.txt").exists())
        # Of the bright column at the left the point (0, 59.5) goes to (4.8, 32.3), of the principal point's picture.
        raw = self.grey(made / "frames" / "000060.png")
        self.assertGreater(raw[WIDTH * 32 + 5], 120)
        self.assertLess(raw[WIDTH * 87 + 5], 80)
        self.assertAlmostEqual(raw[WIDTH * 60 + 80], 60 * 5 / 6, delta=2)

    def test_every_kind_is_a_whole_clip(self):
        self.clip = self.make_clip(12)
        for kind in recordings.KINDS:
            made = self.make(kind)
            times = (made / "times.txt").read_text().split()
            self.assertEqual(len(list((made / "frames").iterdir())), len(times), kind)
            self.assertEqual(times, sorted(times, key=float), kind)
            self.assertTrue(recordings.Camera(made / "calib.yaml").value("fx") > 0, kind)


if __name__ == "__main__":
    unittest.main()
