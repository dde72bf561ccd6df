#!/usr/bin/env python3
"""Clips as people record them: makes of one prepared clip what a tower, a recorder or an editor would have made of it, each
a prepared clip that real_clips.py and `haustra run` read.

    python3 tools/benchmarks/recordings.py CLIP --out OUT [--only surround,card] [--turn 45]

| kind | what |
|---|---|
| surround | the picture in the middle of a dark one of twice the width, 16:9 |
| pip | the same, with a still picture and a counter that runs in the surround |
| card | a test card for five seconds, then the surround |
| clock | a counter that runs within the picture |
| twice | every frame twice, at twice the rate |
| telecine | 25 frames a second in a recording of 30: every fifth is shown twice |
| freeze | 1.6 s of every six stand still, as when the freeze button is pressed |
| half | every other frame |
| soft | enlarged to twice its size |
| gamma | lighter and darker by turns of two seconds |
| coarse | through H.264 at a constant rate factor of 33 |
| back | the last six tenths, 1.2 s of darkness, then the first six tenths, turned by --turn and a sixth darker |

A clip is a folder with frames/, times.txt, calib.yaml of our own form, and reference.txt where there is one; reference.txt goes
with those kinds that keep the times. What the kind `back` shows first it meets again: its sources.txt names the frame of each
picture, and return_judge.py asks where it was found. Needs FFmpeg. Writes links to pictures that stay as they are.
"""

import argparse
import math
import pathlib
import re
import shutil
import subprocess
import sys

CARD_FRAMES = 125
FREEZE_FROM, FREEZE_TO, FREEZE_EVERY = 60, 100, 150  # frames
DARK_S = 1.2


class Camera:
    """calib.yaml of our own form, moved and scaled with the pixels."""

    def __init__(self, path):
        self.text = path.read_text(encoding="utf-8")
        self.width, self.height = (int(self.value(name)) for name in ("width_px", "height_px"))

    def value(self, name):
        found = re.search(rf"\b{name}: *([-+.\deE]+)", self.text)
        if not found:
            sys.exit(f"calib.yaml: no {name}")
        return float(found[1])

    def moved(self, width, height, left=0, top=0, scale=1):
        values = {"width_px": width, "height_px": height}
        for axis, shift in (("x", left), ("y", top)):
            values[f"f{axis}"] = scale * self.value(f"f{axis}")
            values[f"c{axis}"] = scale * (self.value(f"c{axis}") + 0.5) - 0.5 + shift
        text = self.text
        for name, value in values.items():
            text = re.sub(rf"\b{name}: *[-+.\deE]+", f"{name}: {value:.10g}", text)
        return text


class Clip:
    def __init__(self, folder):
        self.folder = folder.resolve()
        self.frames = sorted(p for p in (self.folder / "frames").glob("*") if p.is_file())
        if not self.frames:
            sys.exit(f"{folder}: no pictures in {self.folder / 'frames'}")
        lines = (self.folder / "times.txt").read_text(encoding="ascii").splitlines()
        self.times = [line.split()[-1] for line in lines if line.strip() and not line.startswith("#")]
        if len(self.times) != len(self.frames):
            sys.exit(f"{folder}: {len(self.frames)} pictures, {len(self.times)} times")
        self.camera = Camera(self.folder / "calib.yaml")
        self.period = (float(self.times[-1]) - float(self.times[0])) / max(len(self.times) - 1, 1)


def even(value):
    return int(value) // 2 * 2


class Recorder:
    """Makes the kinds of one clip, each in a folder of its own below `out`."""

    def __init__(self, clip, out, ffmpeg="ffmpeg", turn=45):
        self.clip, self.out, self.ffmpeg, self.turn = clip, out, ffmpeg, turn
        self.rate = f"{1 / clip.period:.6g}"
        camera = clip.camera
        self.big_width = even(2 * camera.width)
        self.big_height = even(max(self.big_width * 9 / 16, camera.height))
        self.left, self.top = even((self.big_width - camera.width) / 2), even((self.big_height - camera.height) / 2)
        self.pad = f"pad={self.big_width}:{self.big_height}:{self.left}:{self.top}"
        self.big_camera = camera.moved(self.big_width, self.big_height, self.left, self.top)

    def folder(self, kind):
        folder = self.out / f"{self.clip.folder.name}_{kind}"
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "frames").mkdir(parents=True)
        return folder

    def finish(self, folder, times, camera, keeps_times):
        (folder / "times.txt").write_text("".join(f"{time}\n" for time in times), encoding="ascii")
        (folder / "calib.yaml").write_text(camera, encoding="utf-8")
        reference = self.clip.folder / "reference.txt"
        if keeps_times and reference.is_file():
            shutil.copy(reference, folder)
        return folder

    def link(self, kind, pictures, times, camera=None, keeps_times=False):
        folder = self.folder(kind)
        for i, picture in enumerate(pictures):
            (folder / "frames" / f"{i:06d}{picture.suffix}").symlink_to(picture)
        return self.finish(folder, times, camera or self.clip.camera.text, keeps_times)

    def run(self, *arguments):
        subprocess.run([self.ffmpeg, "-v", "error", "-y", *map(str, arguments)], check=True)

    def pictures(self, folder):
        """All frames of the clip as one input; a list, since their names may be any."""
        script = folder / "pictures.txt"
        script.write_text("".join(f"file '{frame}'\nduration {self.clip.period:.6f}\n" for frame in self.clip.frames),
                          encoding="utf-8")
        return ["-r", self.rate, "-f", "concat", "-safe", "0", "-i", script]

    def filtered(self, kind, options, camera=None):
        folder = self.folder(kind)
        self.run(*self.pictures(folder), *options, "-vsync", "passthrough", "-frames:v", len(self.clip.frames),
                 "-start_number", 0, folder / "frames" / "%06d.png")
        (folder / "pictures.txt").unlink()
        return self.finish(folder, self.clip.times, camera or self.clip.camera.text, True)

    def surround(self):
        return self.filtered("surround", ["-vf", self.pad], self.big_camera)

    def pip(self):
        small = f"scale={even(self.big_width / 5)}:{even(self.big_height / 5)}"
        counter = ["-f", "lavfi", "-i", f"testsrc=size=100x80:rate={self.rate}"]
        still = ["-loop", "1", "-r", self.rate, "-i", self.clip.frames[0]]
        corner = f"{self.big_width - 110}:{self.big_height - 90}"
        return self.filtered("pip", [*counter, *still, "-filter_complex",
                                     f"[0]{self.pad}[a];[2]{small}[b];[a][b]overlay=8:8[c];[c][1]overlay={corner}"],
                             self.big_camera)

    def card(self):
        surround = self.out / f"{self.clip.folder.name}_surround"
        if not surround.is_dir():
            self.surround()
        folder = self.folder("card")
        self.run("-f", "lavfi", "-i", f"testsrc2=size={self.big_width}x{self.big_height}:rate={self.rate}",
                 "-frames:v", CARD_FRAMES, "-start_number", 0, folder / "frames" / "%06d.png")
        for i in range(len(self.clip.frames)):
            (folder / "frames" / f"{CARD_FRAMES + i:06d}.png").symlink_to(surround / "frames" / f"{i:06d}.png")
        times = [f"{i * self.clip.period:.6f}" for i in range(CARD_FRAMES + len(self.clip.frames))]
        return self.finish(folder, times, self.big_camera, False)

    def clock(self):
        camera = self.clip.camera
        place = f"{camera.width - 70}:{camera.height // 2}"
        return self.filtered("clock", ["-f", "lavfi", "-i", f"testsrc=size=60x45:rate={self.rate}", "-filter_complex",
                                       f"[0][1]overlay={place}"])

    def twice(self):
        frames = [frame for frame in self.clip.frames for _ in range(2)]
        return self.link("twice", frames, [f"{i * self.clip.period / 2:.6f}" for i in range(len(frames))])

    def telecine(self):
        num = len(self.clip.frames) * 6 // 5
        frames = [self.clip.frames[i * 5 // 6] for i in range(num)]
        return self.link("telecine", frames, [f"{i * self.clip.period * 5 / 6:.6f}" for i in range(num)])

    def freeze(self):
        frames = [self.clip.frames[i - i % FREEZE_EVERY + FREEZE_FROM] if FREEZE_FROM < i % FREEZE_EVERY < FREEZE_TO
                  else frame for i, frame in enumerate(self.clip.frames)]
        return self.link("freeze", frames, self.clip.times)

    def half(self):
        return self.link("half", self.clip.frames[::2], self.clip.times[::2], keeps_times=True)

    def soft(self):
        camera = self.clip.camera
        return self.filtered("soft", ["-vf", "scale=2*iw:2*ih:flags=bilinear"],
                             camera.moved(2 * camera.width, 2 * camera.height, scale=2))

    def gamma(self):
        return self.filtered("gamma", ["-vf", "eq=gamma=1.8:enable='lt(mod(t,4),2)'"])

    def coarse(self):
        folder = self.folder("coarse")
        self.run(*self.pictures(folder), "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-c:v", "libx264", "-crf", 33,
                 "-pix_fmt", "yuv420p", folder / "coarse.mp4")
        camera = self.clip.camera
        self.run("-i", folder / "coarse.mp4", "-vf", f"crop={camera.width}:{camera.height}:0:0", "-vsync", "passthrough",
                 "-frames:v", len(self.clip.frames), "-start_number", 0, folder / "frames" / "%06d.png")
        (folder / "coarse.mp4").unlink()
        (folder / "pictures.txt").unlink()
        return self.finish(folder, self.clip.times, camera.text, True)

    def turned(self):
        """A filter that turns the picture about the principal point, clockwise; what comes in from outside is black."""
        camera = self.clip.camera
        sides = []
        for axis, side in (("x", camera.width), ("y", camera.height)):
            centre = camera.value(f"c{axis}") + 0.5
            half = math.ceil(max(centre, side - centre))
            sides.append((2 * half, round(half - centre)))
        (width, left), (height, top) = sides
        darker = ":".join(f"{channel}=val*5/6" for channel in "rgb")
        return (f"format=gbrp,pad={width}:{height}:{left}:{top},rotate={self.turn}*PI/180,"
                f"crop={camera.width}:{camera.height}:{left}:{top},lutrgb={darker}")

    def back(self):
        clip, camera = self.clip, self.clip.camera
        num = len(clip.frames)
        begin, end = 2 * num // 5, 3 * num // 5
        num_dark = round(DARK_S / clip.period)
        folder = self.folder("back")
        self.run("-f", "lavfi", "-i", f"color=black:size={camera.width}x{camera.height}", "-frames:v", 1,
                 folder / "dark.png")
        pictures = clip.frames[begin:] + [folder / "dark.png"] * num_dark
        for i, picture in enumerate(pictures):
            (folder / "frames" / f"{i:06d}{picture.suffix}").symlink_to(picture)
        self.run(*self.pictures(folder), "-vf", self.turned(), "-vsync", "passthrough", "-frames:v", end, "-start_number",
                 len(pictures), folder / "frames" / "%06d.png")
        (folder / "pictures.txt").unlink()
        sources = [(i, 0) for i in range(begin, num)] + [(-1, 0)] * num_dark + [(i, 1) for i in range(end)]
        lines = "".join(f"{frame} {is_turned}\n" for frame, is_turned in sources)
        (folder / "sources.txt").write_text(f"# frame of the clip or -1, 1: turned by {self.turn:g} degrees\n" + lines,
                                            encoding="ascii")
        times = [f"{i * clip.period:.6f}" for i in range(len(sources))]
        return self.finish(folder, times, camera.text, False)


KINDS = ["surround", "pip", "card", "clock", "twice", "telecine", "freeze", "half", "soft", "gamma", "coarse",
         "back"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clip", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--only", help="kinds, with commas between them; all")
    parser.add_argument("--turn", type=float, default=45, help="of the kind back, degrees; 45")
    parser.add_argument("--ffmpeg", default="ffmpeg")
    arguments = parser.parse_args()
    kinds = arguments.only.split(",") if arguments.only else KINDS
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown:
        sys.exit(f"--only: no kind {', '.join(unknown)}; there are {', '.join(KINDS)}")
    recorder = Recorder(Clip(arguments.clip), arguments.out.resolve(), arguments.ffmpeg, arguments.turn)
    for kind in kinds:
        print(getattr(recorder, kind)())


if __name__ == "__main__":
    main()
