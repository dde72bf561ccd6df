#!/usr/bin/env python3
"""How well does the reference of a real clip repeat? COLMAP anew on the same pictures, held against reference.txt.

    python3 tools/benchmarks/reference_repeats.py CLIP OUT [--frames FIRST-LAST] [--every N] [--shrink N]
        [--matcher exhaustive|sequential] [--hold-calibration] [--run RUN] [--overwrite]

CLIP is a folder as for real_clips.py, with calib.yaml and reference.txt. Every Nth picture is taken, made smaller by --shrink, and
masked where it is dark or glares. COLMAP begins at the calibration, and adjusts it unless it is held. An error that is smaller
than the difference between two references of the same pictures says nothing.

Printed are, of the largest model: its pictures, its focal length, and by how much its camera centres differ from the
reference after one Sim(3), as share of the median depth. With --run, the same of a run's largest map against both. Then,
second by second, which share of the points of the smaller side two seconds have in common, of the model and of the run.

OUT/reference.txt and OUT/calib.yaml are the path and the camera of the largest model. A clip without reference.txt gets one so;
its calib.yaml may hold a guess. Nothing is compared with a reference then.

Needs COLMAP (as `colmap`), numpy and OpenCV.
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys

import numpy as np

from poses import rotation, similarity

GLARE, DARK = 235, 12          # grey; what is beyond shows no wall
MODELS = {"kannala_brandt": "SIMPLE_RADIAL_FISHEYE", "pinhole": "SIMPLE_RADIAL"}
SAME_TIME_S = 1e-3


class Refusal(Exception):
    """Something is wrong with a file or a step; the text names it."""


def lines_of(path):
    return [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]


class Model:
    """A model in COLMAP's text format: centres of the cameras, points, and which frames see which."""

    def __init__(self, folder):
        self.frames, self.centres, self.turns = {}, {}, {}
        for fields in lines_of(folder / "images.txt"):
            if len(fields) != 10:
                continue  # the points of a picture
            frame = int(re.search(r"(\d+)\D*$", fields[9]).group(1))
            values = [float(value) for value in fields[1:8]]
            self.frames[fields[0]] = frame
            self.centres[frame] = -rotation(*values[:4]).T @ np.array(values[4:])
            self.turns[frame] = values[0], -values[1], -values[2], -values[3]  # world_from_cam: w, x, y, z
        points = lines_of(folder / "points3D.txt")
        self.points = np.array([[float(value) for value in fields[1:4]] for fields in points])
        self.sights = [{self.frames[image] for image in fields[8::2] if image in self.frames} for fields in points]

    def depth(self):
        """Median over the pictures of the median distance of what they see."""
        seen = {}
        for point, frames in zip(self.points, self.sights):
            for frame in frames:
                seen.setdefault(frame, []).append(np.linalg.norm(point - self.centres[frame]))
        return float(np.median([np.median(distances) for distances in seen.values()]))

    def shared(self, begin, bin_frames, num_bins):
        """Of the points of two stretches of time, the share of the smaller number that both have."""
        sets = [set() for _ in range(num_bins)]
        for index, frames in enumerate(self.sights):
            for frame in frames:
                if 0 <= frame - begin < bin_frames * num_bins:
                    sets[(frame - begin) // bin_frames].add(index)
        return [[len(a & b) / max(1, min(len(a), len(b))) for b in sets] for a in sets]


def difference(centres, targets):
    """RMS between centres of the same frames after one Sim(3), in units of the targets; their number; and the scale."""
    frames = sorted(set(centres) & set(targets))
    if len(frames) < 4:
        raise Refusal(f"only {len(frames)} frames have a pose in both")
    p, t = np.array([centres[f] for f in frames]), np.array([targets[f] for f in frames])
    scale, turned, moved = similarity(p, t)
    return float(np.sqrt(((scale * p @ turned.T + moved - t) ** 2).sum(1).mean())), len(frames), scale


def centres_by_time(path, times):
    """Of a TUM file, by the number of the frame that has the time."""
    centres = {}
    for fields in lines_of(path):
        frame = int(np.abs(times - float(fields[0])).argmin())
        if abs(times[frame] - float(fields[0])) <= SAME_TIME_S:
            centres[frame] = np.array([float(value) for value in fields[1:4]])
    return centres


def prepare(clip, out, first, last, every, shrink):
    import cv2
    for name in ("pictures", "masks"):
        (out / name).mkdir(parents=True)
    chosen = [path for path in sorted((clip / "frames").glob("*.png"))
              if first <= int(path.stem) <= last and (int(path.stem) - first) % every == 0]
    for path in chosen:
        picture = cv2.imread(str(path))
        brightest = picture.max(2)
        dark = cv2.morphologyEx((brightest < DARK).astype(np.uint8), cv2.MORPH_OPEN, np.ones((15, 15)))
        hidden = cv2.dilate((brightest > GLARE).astype(np.uint8), np.ones((9, 9))) | cv2.dilate(dark, np.ones((15, 15)))
        size = (picture.shape[1] // shrink, picture.shape[0] // shrink)
        cv2.imwrite(str(out / "pictures" / path.name), cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
        mask = cv2.resize(255 * (1 - hidden), size, interpolation=cv2.INTER_NEAREST)
        cv2.imwrite(str(out / "masks" / (path.name + ".png")), mask)
    if not chosen:
        raise Refusal(f"{clip}: no picture frames/NNNNNN.png in {first} to {last}")


def calibration(clip, shrink):
    text = (clip / "calib.yaml").read_text()

    def value(key):
        found = re.search(rf"^\s*{key}\s*:\s*(\S+)", text, re.M)
        if not found:
            raise Refusal(f"{clip / 'calib.yaml'}: no {key}")
        return found.group(1)

    if value("model") not in MODELS:
        raise Refusal(f"{clip / 'calib.yaml'}: model {value('model')} is none of {', '.join(MODELS)}")
    fx = float(value("fx")) / shrink
    # To COLMAP the middle of the first pixel is 0.5, to calib.yaml 0.
    cx, cy = ((float(value(key)) + 0.5) / shrink for key in ("cx", "cy"))
    return MODELS[value("model")], f"{fx},{cx},{cy},{value('k1')}"


def reconstruct(out, model, parameters, matcher, hold):
    def colmap(*arguments):
        with open(out / "log", "a") as log:
            if subprocess.run(["colmap", *arguments], stdout=log, stderr=log).returncode != 0:
                raise Refusal(f"colmap {arguments[0]} failed: {out / 'log'}")

    database, pictures = ["--database_path", str(out / "database")], ["--image_path", str(out / "pictures")]
    colmap("feature_extractor", *database, *pictures, "--ImageReader.mask_path", str(out / "masks"),
           "--ImageReader.single_camera", "1", "--ImageReader.camera_model", model, "--ImageReader.camera_params", parameters,
           "--SiftExtraction.use_gpu", "0", "--SiftExtraction.peak_threshold", "0.003")
    colmap(f"{matcher}_matcher", *database, "--SiftMatching.use_gpu", "0")
    (out / "models").mkdir()
    refine = "0" if hold else "1"
    colmap("mapper", *database, *pictures, "--output_path", str(out / "models"),
           "--Mapper.ba_refine_focal_length", refine, "--Mapper.ba_refine_extra_params", refine,
           "--Mapper.init_min_tri_angle", "4", "--Mapper.abs_pose_min_num_inliers", "15",
           "--Mapper.init_min_num_inliers", "50", "--Mapper.min_num_matches", "10")
    models = sorted((out / "models").iterdir())
    if not models:
        raise Refusal(f"colmap made no model: {out / 'log'}")
    for folder in models:
        colmap("model_converter", "--input_path", str(folder), "--output_path", str(folder), "--output_type", "TXT")
    return max(models, key=lambda folder: len(Model(folder).centres))


def write_reference(model, times, path):
    """The path of a model in the format of TUM, world_from_cam."""
    rows = ["# time_s tx ty tz qx qy qz qw"]
    for frame, centre in sorted(model.centres.items()):
        w, x, y, z = model.turns[frame]
        rows.append(" ".join(f"{value:.9g}" for value in (times[frame], *centre, x, y, z, w)))
    path.write_text("\n".join(rows) + "\n")


def write_calibration(clip, camera, shrink, path):
    """The clip's calib.yaml with the numbers of a line of cameras.txt: f, cx, cy, k1."""
    f, cx, cy, k1 = (float(value) for value in camera[4:8])
    text = (clip / "calib.yaml").read_text()
    for key, value in (("fx", f * shrink), ("fy", f * shrink), ("cx", cx * shrink - 0.5), ("cy", cy * shrink - 0.5), ("k1", k1)):
        text = re.sub(rf"^(\s*{key}\s*:\s*)\S+", rf"\g<1>{value:.9g}", text, flags=re.M)
    path.write_text(text)


def say_shared(name, shares):
    print(f"\npoints in common, %, {name}:")
    for row in shares:
        print(" ".join(f"{100 * share:4.0f}" for share in row))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clip", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--frames", default="0-999999", help="FIRST-LAST, counted from 0, both included")
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--shrink", type=int, default=1)
    parser.add_argument("--matcher", choices=["exhaustive", "sequential"], default="exhaustive")
    parser.add_argument("--hold-calibration", action="store_true")
    parser.add_argument("--run", type=pathlib.Path, help="output folder of haustra run on the clip")
    parser.add_argument("--overwrite", action="store_true", help="replace OUT")
    options = parser.parse_args()
    bounds = re.fullmatch(r"(\d+)-(\d+)", options.frames)
    if not bounds or options.every < 1 or options.shrink < 1:
        raise Refusal("--frames is FIRST-LAST, --every and --shrink are 1 or more")
    first, last = int(bounds[1]), int(bounds[2])
    if options.out.exists():
        if not options.overwrite or not (options.out / "pictures").is_dir():
            raise Refusal(f"{options.out} is there already" + (" and was not made by this" if options.overwrite else ""))
        shutil.rmtree(options.out)
    if shutil.which("colmap") is None:
        raise Refusal("colmap is not installed")
    times = np.array([float(fields[0]) for fields in lines_of(options.clip / "times.txt")])
    has_reference = (options.clip / "reference.txt").exists()
    reference = centres_by_time(options.clip / "reference.txt", times) if has_reference else {}
    prepare(options.clip, options.out, first, last, options.every, options.shrink)
    folder = reconstruct(options.out, *calibration(options.clip, options.shrink), options.matcher, options.hold_calibration)
    model = Model(folder)
    num_pictures = len(list((options.out / "pictures").iterdir()))
    camera = lines_of(folder / "cameras.txt")[0]
    print(f"{len(model.centres)} of {num_pictures} pictures, camera {' '.join(camera[1:])}")
    write_reference(model, times, options.out / "reference.txt")
    write_calibration(options.clip, camera, options.shrink, options.out / "calib.yaml")
    scale = 1.0
    if has_reference:
        rms, count, scale = difference(model.centres, reference)
        print(f"model against the reference: {100 * rms / (model.depth() * scale):.2f} % of the depth, {count} frames")
    depth = model.depth() * scale
    rate_hz = 1.0 / float(np.median(np.diff(times)))
    begin = min(model.centres)
    num_seconds = int((max(model.centres) - begin) / rate_hz) + 1
    if options.run:
        largest = max((options.run / "trajectory").glob("map_*.tum"), key=lambda path: len(lines_of(path)))
        ours = centres_by_time(largest, times)
        for name, target, unit in (("the reference", reference, 1.0), ("the model", model.centres, scale)):
            if not target:
                continue
            rms, count, _ = difference(ours, target)
            print(f"run against {name}: {100 * rms * unit / depth:.2f} % of the depth, {count} frames")
    say_shared("model", model.shared(begin, round(rate_hz), num_seconds))
    if options.run:
        say_shared("run", Model(options.run / "maps" / largest.stem).shared(begin, round(rate_hz), num_seconds))


if __name__ == "__main__":
    try:
        main()
    except (Refusal, OSError) as error:
        sys.exit(f"reference_repeats.py: {error}")
