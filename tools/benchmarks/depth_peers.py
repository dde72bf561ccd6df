#!/usr/bin/env python3
"""Depth of keyframes beside OpenCV's stereo, on the poses, the camera and the pictures of the same run.

    haustra render SEQUENCE --depth ...
    haustra run SEQUENCE --out RUN
    haustra surface RUN --sequence SEQUENCE --out SURFACE --depth-maps --groundtruth SEQUENCE/groundtruth.txt
    haustra evaluate RUN --groundtruth SEQUENCE/groundtruth.txt --json EVALUATION
    python3 tools/benchmarks/depth_peers.py SEQUENCE RUN SURFACE EVALUATION [--json FILE] [--overwrite]

Each keyframe is matched with OpenCV's semi-global block matching (StereoSGBM), and these depths and ours are compared with the
truth.

Rectified pairs: a scope mostly moves along its view, and the epipoles lie in the picture. No pair of pinhole views has parallel
epipolar lines then. So both pictures are drawn over angles: a row is a half plane that ends in the baseline, a column an angle
from it. Rows are epipolar lines wherever the scope moved, and the disparity is the angle between both rays at the wall.

Partners are those of engine/surface/view_selection.h, by shared points and their angles. Disparities reach from the limit of
one degree of parallax, as ours do, to twice that of the nearest points, and ranges to twice those of the points. Kept is what
the search from the other picture confirms within a pixel. In `best pair` one partner is asked. In `six pairs` each of up to
six is, and a cell is answered when two of them agree within 4 %: with the mean of those that agree with the median. `ours` is
what `haustra surface` has, whose depths another keyframe has confirmed within the same 4 %.

Judged is what `haustra surface --groundtruth` judges, by the same rules, once more in this file. A difference from what that
command says ends the work. Needs numpy and OpenCV.
"""

import argparse
import json
import math
import pathlib
import re
import sys

import cv2
import numpy as np

from poses import rotation

STEP_PX = 4              # pixels a cell, of the truth and of our depth
TRUE_UNIT_MM = 1.0 / 256.0
MIN_ANGLE_DEG = 2.0      # under which two keyframes see what is judged
SAME_WALL = 0.05         # of the range
BEST_DEG, BELOW_DEG, ABOVE_DEG = 8.0, 3.0, 12.0  # view_selection.h
MIN_SCORE, MAX_PARTNERS = 10.0, 6
MIN_PARALLAX_DEG = 1.0
AGREE = 0.04
SEED_QUANTILE = 0.02     # of the points that are taken for wrong, at each end of ranges and parallax
RANGE_MARGIN = 2.0       # beyond the points
EPIPOLE_DEG = 3.0        # nearer the baseline there is no parallax to speak of
# Chosen on the colon of seed 21 (results/): pixels of a rectified picture to one of the camera's, and side of the block.
OVERSAMPLING = 1.0
BLOCK = 7


class Refusal(Exception):
    """Something is wrong with a file or a step; the text names it."""


class Camera:
    """Kannala and Brandt, from cameras.txt of an exported map. Pixel centres at integers."""

    def __init__(self, path):
        lines = [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]
        if len(lines) != 1 or lines[0][1] != "OPENCV_FISHEYE":
            raise Refusal(f"{path}: one OPENCV_FISHEYE camera is expected")
        self.width, self.height = int(lines[0][2]), int(lines[0][3])
        values = [float(v) for v in lines[0][4:]]
        self.focal = np.array(values[0:2])
        self.centre = np.array(values[2:4]) - 0.5
        self.distortion = values[4:8]
        self.max_angle = self._angle(self._distorted(0.0, 0.0)) * 1.02  # of the corner of the picture

    def _distorted(self, u, v):
        return math.hypot((u - self.centre[0]) / self.focal[0], (v - self.centre[1]) / self.focal[1])

    def _radius(self, angle):
        square, factor = angle * angle, 0.0
        for k in reversed(self.distortion):
            factor = square * (k + factor)
        return angle * (1.0 + factor)

    def _angle(self, radius):
        low, high = np.zeros_like(radius), np.full_like(radius, 1.5)
        for _ in range(50):
            middle = 0.5 * (low + high)
            is_less = self._radius(middle) < radius
            low, high = np.where(is_less, middle, low), np.where(is_less, high, middle)
        return 0.5 * (low + high)

    def project(self, points):
        """Pixels of points (..., 3); NaN where the model ends."""
        across = np.hypot(points[..., 0], points[..., 1])
        angle = np.arctan2(across, points[..., 2])
        scale = self._radius(angle) / np.maximum(across, 1e-12)
        pixels = self.focal * points[..., :2] * scale[..., None] + self.centre
        pixels[angle > self.max_angle] = np.nan
        return pixels

    def rays(self, pixels):
        plane = (pixels - self.centre) / self.focal
        radius = np.hypot(plane[..., 0], plane[..., 1])
        angle = self._angle(radius)
        scale = np.sin(angle) / np.maximum(radius, 1e-12)
        return np.concatenate([plane * scale[..., None], np.cos(angle)[..., None]], -1)

    def cell_rays(self):
        x, y = np.meshgrid(np.arange(self.width // STEP_PX), np.arange(self.height // STEP_PX))
        return self.rays(np.stack([x, y], -1) * STEP_PX + 0.5 * (STEP_PX - 1))


def read_pgm(path):
    """Values of a 16-bit PGM file, and its comment."""
    data = path.read_bytes()
    head = re.match(rb"P5\n(#[^\n]*)?\n?(\d+) (\d+)\n65535\n", data)
    if not head:
        raise Refusal(f"{path}: a picture of 16 bits is expected")
    width, height = int(head[2]), int(head[3])
    return np.frombuffer(data, ">u2", width * height, head.end()).reshape(height, width), (head[1] or b"").decode()


class Keyframe:
    """Of one map, with its picture, the depth that we have found, and the truth."""

    def __init__(self, frame, fields, points):
        self.frame = frame
        self.rotation = rotation(*fields[0:4])  # cam_from_map
        self.translation = fields[4:7]
        self.centre = -self.rotation.T @ self.translation
        self.points = points  # id to its place in the map

    def attach(self, sequence, found, pose):
        path = sequence / "frames" / f"{self.frame:06d}.jpg"
        self.grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if self.grey is None:
            raise Refusal(f"{path}: no such picture")
        self.truth = read_pgm(sequence / "depth" / f"{self.frame:06d}.pgm")[0] * TRUE_UNIT_MM
        inverse, comment = read_pgm(found)
        unit = float(re.search(r"1 is (\S+) / map unit", comment)[1])
        with np.errstate(divide="ignore"):
            self.ours = 1.0 / (inverse * unit)  # map units, infinite: no depth
        self.world_from_cam = rotation(pose[6], *pose[3:6])
        self.place = pose[0:3]


def read_map(folder):
    places = {}
    for line in (folder / "points3D.txt").read_text().splitlines():
        if line and line[0] != "#":
            fields = line.split()
            places[int(fields[0])] = np.array([float(f) for f in fields[1:4]])
    keyframes = []
    lines = [line for line in (folder / "images.txt").read_text().splitlines() if not line.startswith("#")]
    for pose, seen in zip(lines[0::2], lines[1::2]):
        fields = pose.split()
        ids = [int(i) for i in seen.split()[2::3]]
        keyframes.append(Keyframe(int(re.search(r"(\d+)\.\w+$", fields[9])[1]), np.array([float(f) for f in fields[1:8]]),
                                  {i: places[i] for i in ids if i in places}))
    return Camera(folder / "cameras.txt"), keyframes


def read_poses(path):
    """world_from_cam of each frame: place, and quaternion x y z w."""
    lines = [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]
    return [np.array([float(f) for f in line[1:8]]) for line in lines]


def angles_between(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, -1)))


def partners_of(keyframe, keyframes):
    """The others that help to see its depth, the best first."""
    scored = []
    for i, other in enumerate(keyframes):
        shared = sorted(keyframe.points.keys() & other.points.keys())
        if other is keyframe or not shared:
            continue
        points = np.array([keyframe.points[p] for p in shared])
        off = angles_between(points - keyframe.centre, points - other.centre) - BEST_DEG
        score = np.exp(-0.5 * (off / np.where(off < 0, BELOW_DEG, ABOVE_DEG)) ** 2).sum()
        if score >= MIN_SCORE:
            scored.append((-score, i))
    return [keyframes[i] for _, i in sorted(scored)[:MAX_PARTNERS]]


class Angles:
    """Rays of the reference by angles about the baseline: theta from it, phi around it."""

    def __init__(self, baseline):
        self.length = np.linalg.norm(baseline)
        self.axis = baseline / self.length
        across = np.array([0.0, 0.0, 1.0]) - self.axis[2] * self.axis
        if np.linalg.norm(across) < 0.1:
            across = np.array([1.0, 0.0, 0.0]) - self.axis[0] * self.axis
        self.first = across / np.linalg.norm(across)
        self.second = np.cross(self.axis, self.first)

    def of(self, rays):
        along, first, second = rays @ self.axis, rays @ self.first, rays @ self.second
        return np.arctan2(np.hypot(first, second), along), np.arctan2(second, first)

    def rays(self, theta, phi):
        across = np.cos(phi)[..., None] * self.first + np.sin(phi)[..., None] * self.second
        return np.cos(theta)[..., None] * self.axis + np.sin(theta)[..., None] * across


def matcher(num_disparities):
    return cv2.StereoSGBM_create(minDisparity=0, numDisparities=num_disparities, blockSize=BLOCK, P1=8 * BLOCK * BLOCK,
                                 P2=32 * BLOCK * BLOCK, disp12MaxDiff=-1, preFilterCap=31, uniquenessRatio=5,
                                 speckleWindowSize=100, speckleRange=2, mode=cv2.STEREO_SGBM_MODE_SGBM)


def match(camera, is_scene, reference, source):
    """Range of each cell in map units by one pair; NaN: none."""
    source_from_reference = source.rotation @ reference.rotation.T
    angles = Angles(reference.rotation @ (source.centre - reference.centre))
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = camera.rays(np.stack([x, y], -1)[is_scene])
    theta, phi = angles.of(rays)
    theta_there, _ = angles.of(rays @ source_from_reference)
    density = OVERSAMPLING * float(np.mean(camera.focal))  # pixels a radian
    # A column more to the right is an angle nearer to the baseline: what is nearer lies farther left in the source.
    most = min(max(theta.max(), theta_there.max()), math.pi - math.radians(EPIPOLE_DEG))
    least = max(min(theta.min(), theta_there.min()), math.radians(EPIPOLE_DEG))
    columns = most - np.arange(int((most - least) * density)) / density
    # All around, the rows begin and end with some of the other end, for the paths of costs.
    half = min(np.abs(phi).max(), math.pi)
    if half > 0.95 * math.pi:
        half = math.pi + 0.3
    rows = np.arange(int(2 * half * density)) / density - half
    grid = angles.rays(*np.meshgrid(columns, rows))
    pictures, shown = [], []
    for rays_of, grey in ((grid, reference.grey), (grid @ source_from_reference.T, source.grey)):
        pixels = camera.project(rays_of).astype(np.float32)
        pixels = np.where(np.isfinite(pixels), pixels, -10.0).astype(np.float32)
        pictures.append(cv2.remap(grey, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR))
        shown.append(cv2.remap(is_scene.astype(np.uint8), pixels[..., 0], pixels[..., 1], cv2.INTER_NEAREST) > 0)

    points = np.array([reference.points[p] for p in sorted(reference.points)])
    parallax = np.radians(angles_between(points - reference.centre, points - source.centre))
    disparities = RANGE_MARGIN * np.quantile(parallax, 1.0 - SEED_QUANTILE) * density
    num_disparities = int(min(max(16 * math.ceil(disparities / 16), 32), 16 * ((len(columns) - 1) // 16)))
    if num_disparities < 16:
        return np.full(reference.truth.shape, np.nan)
    # The border on the left lets what the source shows farther out be found, too.
    wide = [cv2.copyMakeBorder(p, 0, 0, num_disparities, num_disparities, cv2.BORDER_CONSTANT) for p in pictures]
    inner = slice(num_disparities, num_disparities + len(columns))
    left = matcher(num_disparities).compute(wide[0], wide[1])[:, inner] / 16.0
    flipped = matcher(num_disparities).compute(cv2.flip(wide[1], 1), cv2.flip(wide[0], 1))
    right = cv2.flip(flipped, 1)[:, inner] / 16.0

    column = np.arange(len(columns))[None, :]
    there = np.round(column - left).astype(int)
    is_inside = (left >= 0) & (there >= 0)
    at = np.arange(len(rows))[:, None], np.clip(there, 0, len(columns) - 1)
    is_good = is_inside & shown[0] & shown[1][at] & (np.abs(right[at] - left) <= 1.0)
    delta = left / density
    is_good &= delta >= math.radians(MIN_PARALLAX_DEG)
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = angles.length * np.sin(columns[None, :] + delta) / np.sin(delta)
    distances = np.linalg.norm(points - reference.centre, axis=-1)
    near, far = np.quantile(distances, [SEED_QUANTILE, 1.0 - SEED_QUANTILE])
    is_good &= (ranges > near / RANGE_MARGIN) & (ranges < far * RANGE_MARGIN)
    ranges = np.where(is_good, ranges, np.nan).astype(np.float32)

    theta, phi = angles.of(camera.cell_rays())
    at_column, at_row = np.round((most - theta) * density).astype(int), np.round((phi + half) * density).astype(int)
    samples = []
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            i, j = at_row + dy, at_column + dx
            is_there = (i >= 0) & (j >= 0) & (i < len(rows)) & (j < len(columns))
            value = ranges[np.clip(i, 0, len(rows) - 1), np.clip(j, 0, len(columns) - 1)]
            samples.append(np.where(is_there, value, np.nan))
    samples = np.sort(np.array(samples), 0)  # NaN last
    known = np.isfinite(samples).sum(0)
    middle = np.take_along_axis(samples, (np.maximum(known - 1, 0) // 2)[None], 0)[0]
    return np.where(known >= 5, middle, np.nan)


def agreed(ranges):
    """The mean of those that agree with the median of several, where two do."""
    if len(ranges) < 2:
        return np.full(ranges[0].shape, np.nan)
    samples = np.sort(np.array(ranges), 0)
    known = np.isfinite(samples).sum(0)
    middle = np.take_along_axis(samples, (np.maximum(known - 1, 0) // 2)[None], 0)[0]
    with np.errstate(invalid="ignore"):
        agrees = np.abs(samples - middle) <= AGREE * middle
    count = agrees.sum(0)
    return np.where(count >= 2, np.where(agrees, samples, 0).sum(0) / np.maximum(count, 1), np.nan)


def seen_cells(camera, keyframes, own):
    """Cells with a true range whose wall another keyframe sees under enough of an angle."""
    bearings = camera.cell_rays()
    points = own.place + (own.truth[..., None] * bearings) @ own.world_from_cam.T
    height, width = own.truth.shape
    seen = np.zeros(own.truth.shape, bool)
    for other in keyframes:
        if other is own:
            continue
        rays = points - other.place
        distance = np.linalg.norm(rays, axis=-1)
        pixels = camera.project(rays @ other.world_from_cam)
        cells = np.round((pixels - 0.5 * (STEP_PX - 1)) / STEP_PX)
        is_in = (cells[..., 0] >= 0) & (cells[..., 1] >= 0) & (cells[..., 0] < width) & (cells[..., 1] < height)
        x = np.where(is_in, cells[..., 0], 0).astype(int)
        y = np.where(is_in, cells[..., 1], 0).astype(int)
        is_same = np.abs(other.truth[y, x] - distance) <= SAME_WALL * distance
        seen |= is_in & is_same & (angles_between(points - own.place, rays) > MIN_ANGLE_DEG)
    return seen & (own.truth > 0)


def figures(errors_mm, truth_mm, num_seen):
    relative = errors_mm / truth_mm
    share = {f"within_{p}": float(np.mean(relative <= 0.01 * p)) if len(relative) else 0.0 for p in (2, 5, 10)}
    return {"answered": len(relative) / num_seen if num_seen else 0.0, "median_error": float(np.median(relative)), **share,
            "rms_mm": float(np.sqrt(np.mean(errors_mm**2)))}


def judge(sequence, run, surface, evaluation):
    """Figures of the keyframes of a run that have a depth in its surface."""
    scales = {m["map_id"]: m["scale"] for m in evaluation["per_map"] if m["scale"] is not None}
    true_poses = read_poses(sequence / "groundtruth.txt")
    mask = cv2.imread(str(sequence / "mask.png"), cv2.IMREAD_GRAYSCALE)
    columns = {"truth": [], "ours": [], "best pair": [], "six pairs": []}
    num_keyframes = 0
    for map_id, scale in sorted(scales.items()):
        found = surface / f"map_{map_id:04d}"
        camera, everyone = read_map(run / "maps" / found.name)
        keyframes = [k for k in everyone if (found / f"{k.frame:06d}.pgm").exists()]
        for keyframe in keyframes:
            keyframe.attach(sequence, found / f"{keyframe.frame:06d}.pgm", true_poses[keyframe.frame])
        is_scene = np.ones((camera.height, camera.width), bool) if mask is None else mask >= 128
        num_keyframes += len(keyframes)
        for keyframe in keyframes:
            seen = seen_cells(camera, keyframes, keyframe)
            pairs = [match(camera, is_scene, keyframe, other) for other in partners_of(keyframe, keyframes)]
            nothing = np.full(seen.shape, np.nan)
            columns["truth"].append(keyframe.truth[seen])
            columns["ours"].append(np.where(np.isfinite(keyframe.ours), scale * keyframe.ours, np.nan)[seen])
            columns["best pair"].append(scale * (pairs[0] if pairs else nothing)[seen])
            columns["six pairs"].append(scale * (agreed(pairs) if pairs else nothing)[seen])
    values = {name: np.concatenate(parts) for name, parts in columns.items()}
    truth = values.pop("truth")
    result = {"keyframes": num_keyframes, "seen_cells": len(truth), "all": {}, "common": {}}
    for name, ranges in values.items():
        is_there = np.isfinite(ranges)
        result["all"][name] = figures(np.abs(ranges - truth)[is_there], truth[is_there], len(truth))
    is_common = np.isfinite(values["ours"]) & np.isfinite(values["six pairs"])
    for name in ("ours", "six pairs"):
        result["common"][name] = figures(np.abs(values[name] - truth)[is_common], truth[is_common], len(truth))
    check(surface, result)
    return result


def check(surface, result):
    """That the rules of this file are those of `haustra surface --groundtruth`."""
    said = json.loads((surface / "surface.json").read_text())["depth"]
    ours = result["all"]["ours"]
    pairs = {"seen cells": (said["seen_cells"], result["seen_cells"]),
             "answered": (said["completeness"], ours["answered"]),
             "median error": (said["median_error"], ours["median_error"]), "RMS": (said["rms_mm"], ours["rms_mm"])}
    for what, (theirs, here) in pairs.items():
        if abs(theirs - here) > 0.01 * theirs:
            raise Refusal(f"{surface}: {what}: `haustra surface` says {theirs}, this file {here}")


def table(name, result):
    lines = ["| sequence | depth by | answered | median error | within 2 % | 5 % | 10 % | RMS, mm |",
             "|---|---|---:|---:|---:|---:|---:|---:|"]
    for part, label in (("all", ""), ("common", ", where both answer")):
        for who, f in result[part].items():
            by = who if who == "ours" else f"OpenCV, {who}"
            shares = " | ".join(f"{100 * f[f'within_{p}']:.1f} %" for p in (2, 5, 10))
            lines.append(f"| {name} | {by}{label} | {100 * f['answered']:.1f} % | {100 * f['median_error']:.2f} % | {shares} |"
                         f" {f['rms_mm']:.2f} |")
    return "\n".join(lines)


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("sequence", "run", "surface", "evaluation"):
        parser.add_argument(name, type=pathlib.Path)
    parser.add_argument("--json", type=pathlib.Path, help="all figures")
    parser.add_argument("--overwrite", action="store_true", help="of --json")
    options = parser.parse_args(arguments)
    if options.json and options.json.exists() and not options.overwrite:
        raise Refusal(f"{options.json} is there already; --overwrite replaces it")
    result = judge(options.sequence, options.run, options.surface, json.loads(options.evaluation.read_text()))
    if options.json:
        options.json.write_text(json.dumps(result, indent=2) + "\n")
    print(table(options.sequence.resolve().name, result))


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except (Refusal, OSError) as error:
        sys.exit(f"depth_peers.py: {error}")
