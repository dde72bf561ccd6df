#!/usr/bin/env python3
"""Judges poses of a run on a real clip by optical flow, without ground truth.

    python3 tools/benchmarks/flow_judge.py RUN CLIP [--stride N] [--json FILE] [--overwrite]

RUN is what `haustra run` wrote, CLIP the sequence that it read: frames/, times.txt, calib.yaml and, where there is one,
mask.png. Corners are followed from frame to frame, there and back. The relative pose of two frames of one final map has an
epipolar distance to them: the median, first order, in pixels at the centre of the picture. It shares nothing with the
features and the map of the program.

A recovery is a pose after frames without one, in a final map that has poses before them. It is true or false by how its
distance compares with that of tracked stretches of this run, as long as the gap, and with the best that any rigid motion does
for the same corners. It is not judged where few corners last, where no tracked stretch is long enough, or in between.

--stride N judges chains of N frames inside tracked stretches as well. There the best rigid motion is the only measure, so that
a map that is wrong all over shows. Two views do not know a scale: a wrong length of the way between them does not show.

Needs numpy and OpenCV (python3-opencv).
"""

import argparse
import csv
import json
import pathlib
import statistics
import sys

import cv2
import numpy as np

PICTURES = {".png", ".jpg", ".jpeg"}
SAME_STAMP_S = 1e-4

MAX_CORNERS = 1500
MIN_CORNERS = 20        # left at the end of a chain
MIN_CELLS = 3           # of 4 by 4 that these lie in: one instrument alone is no witness
RETURN_LIMIT_PX = 1.0   # between a corner and itself, followed there and back
MAX_CHAIN = 150         # frames
TARGETS = 5             # frames after a recovery that are asked
STARTS = (0, 3)         # frames before the last pose of before the loss, where chains begin: the last one is often thin
SAMPLES = 16            # chains of tracked stretches
MIN_SAMPLES = 4         # of a length, else nothing is known of it
# Of the distance and what the clip allows. Nine recoveries of one clip known from their record: true 0.7 to 1.9, false 10.9 to 20.5.
TRUE_RATIO, FALSE_RATIO = 4.0, 8.0


class Refusal(Exception):
    """Something is wrong with a file; the text names it."""


class Camera:
    """Unit rays of pixels, by a calib.yaml."""

    COEFFICIENTS = {"pinhole": ("k1", "k2", "p1", "p2", "k3"), "kannala_brandt": ("k1", "k2", "k3", "k4")}
    TYPES = {"PinHole": "pinhole", "KannalaBrandt8": "kannala_brandt"}  # as the program names them, with "Camera." before each key

    def __init__(self, path):
        values = self._read(path)
        self.model = values.get("model", self.TYPES.get(values.get("type"), values.get("type")))
        if self.model not in self.COEFFICIENTS:
            raise Refusal(f"{path}: model is '{self.model}'; known here: {', '.join(self.COEFFICIENTS)}")
        try:
            self.focal = np.array([float(values["fx"]), float(values["fy"])])
            self.centre = np.array([float(values["cx"]), float(values["cy"])])
            self.k = [float(values.get(name, 0)) for name in self.COEFFICIENTS[self.model]]
        except (KeyError, ValueError) as error:
            raise Refusal(f"{path}: {error} is missing or not a number") from error
        self.scale = float(self.focal.mean())  # pixels a radian, at the centre

    @staticmethod
    def _read(path):
        """Keys and values; a map's keys stand beside those of the file, their names are all different."""
        values = {}
        for line in path.read_text(encoding="utf-8").splitlines():
            key, colon, value = line.split("#")[0].partition(":")
            if colon and value.strip():
                values[key.strip().removeprefix("Camera.")] = value.strip().strip("'\"")
        return values

    def distort(self, x, y):
        """Of points of the plane z = 1, pinhole model: the distorted points and their derivatives."""
        k1, k2, p1, p2, k3 = self.k
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        ux = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
        uy = slope * x * y + 2 * p1 * x + 2 * p2 * y
        vy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
        return u, v, ux, uy, vy

    def rays(self, pixels):
        """Unit vectors, one a row; not a number where the model has no ray."""
        with np.errstate(all="ignore"):
            mx, my = ((np.asarray(pixels, float).reshape(-1, 2) - self.centre) / self.focal).T
            if self.model == "pinhole":
                x, y = mx.copy(), my.copy()
                for _ in range(30):
                    u, v, ux, uy, vy = self.distort(x, y)
                    det = ux * vy - uy * uy
                    x, y = x - (vy * (u - mx) - uy * (v - my)) / det, y - (ux * (v - my) - uy * (u - mx)) / det
                u, v, *_ = self.distort(x, y)
                rays = np.stack([x, y, np.ones_like(x)], 1)
                rays[np.hypot(u - mx, v - my) > 1e-6] = np.nan
                return rays / np.linalg.norm(rays, axis=1, keepdims=True)
            radius = np.hypot(mx, my)
            theta = radius.copy()
            powers = np.arange(1, 10, 2)
            k = np.array([1, *self.k])
            for _ in range(30):
                value = (k * theta[:, None] ** powers).sum(1) - radius
                theta = theta - value / (k * powers * theta[:, None] ** (powers - 1)).sum(1)
            failed = ~(np.abs((k * theta[:, None] ** powers).sum(1) - radius) < 1e-6) | (theta < 0) | (theta > np.pi)
            side = np.where(radius > 0, np.sin(theta) / np.where(radius > 0, radius, 1), 1)
            rays = np.stack([mx * side, my * side, np.cos(theta)], 1)
            rays[failed] = np.nan
            return rays


def epipolar_distances(essential, a, b):
    """First-order distances, in radians on the sphere, of rays b to the epipolar planes of rays a: b' E a = 0."""
    to_b, to_a = a @ essential.T, b @ essential
    value = (b * to_b).sum(1)
    slopes = (to_b ** 2).sum(1) - value ** 2 + (to_a ** 2).sum(1) - value ** 2
    return np.abs(value) / np.sqrt(np.maximum(slopes, 1e-300))


def essential_of(pose_a, pose_b):
    """Of two world_from_cam poses (rotation, position): b' E a = 0."""
    rotation = pose_b[0].T @ pose_a[0]
    t = pose_b[0].T @ (pose_a[1] - pose_b[1])
    t = t / max(np.linalg.norm(t), 1e-300)
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    return cross @ rotation


def best_median(a, b):
    """The smallest median distance, in radians, that a rigid motion was found for."""
    flat = (a[:, 2] > 0.2) & (b[:, 2] > 0.2)
    if flat.sum() < 8:
        return float("inf")
    points = [np.ascontiguousarray(r[flat, :2] / r[flat, 2:]) for r in (a, b)]
    found, _ = cv2.findEssentialMat(*points, np.eye(3), cv2.LMEDS, 0.9999)
    if found is None:
        return float("inf")
    return min(float(np.median(epipolar_distances(found[i:i + 3], a, b))) for i in range(0, len(found) - 2, 3))


class Pictures:
    """Grey pictures of a clip, and which pixels are of use."""

    def __init__(self, clip):
        self.files = sorted(p for p in (clip / "frames").glob("*") if p.suffix.lower() in PICTURES)
        if not self.files:
            raise Refusal(f"{clip / 'frames'}: no pictures")
        self.kept = {}
        brightest = None
        for file in self.files[::max(1, len(self.files) // 20)]:
            grey = self._read(file)
            brightest = grey if brightest is None else np.maximum(brightest, grey)
        self.side = max(15, int(grey.shape[1] / 40) | 1)
        # The rim of the scope's window stands still, whatever the scope does.
        inside = np.pad((brightest > 40).astype(np.uint8), 1)
        inside = cv2.morphologyEx(inside, cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
        self.mask = cv2.erode(inside, np.ones((self.side, self.side), np.uint8))[1:-1, 1:-1] * 255
        if (clip / "mask.png").is_file():
            own = cv2.imread(str(clip / "mask.png"), cv2.IMREAD_GRAYSCALE)
            if own is None or own.shape != self.mask.shape:
                raise Refusal(f"{clip / 'mask.png'}: not a picture of the size of the frames")
            self.mask[own == 0] = 0

    @staticmethod
    def _read(file):
        grey = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if grey is None:
            raise Refusal(f"{file}: cannot be read as a picture")
        return grey

    def grey(self, index):
        if index not in self.kept:
            while len(self.kept) > 64:
                self.kept.pop(next(iter(self.kept)))
            self.kept[index] = self._read(self.files[index])
        return self.kept[index]

    def corners(self, index):
        """Where a chain begins: not on the rim, not in highlights, which travel with the light."""
        grey = self.grey(index)
        bright = cv2.dilate((grey >= 240).astype(np.uint8), np.ones((9, 9), np.uint8))
        mask = np.where(bright > 0, 0, self.mask).astype(np.uint8)
        found = cv2.goodFeaturesToTrack(grey, MAX_CORNERS, 0.001, max(4, self.side // 4), mask=mask)
        return np.zeros((0, 2), np.float32) if found is None else found.reshape(-1, 2)

    def chain(self, first, last):
        """Yields (frame, start points, points) for first + 1 to last, of the corners that were followed all the way."""
        begin = here = self.corners(first)
        options = {"winSize": (self.side, self.side), "maxLevel": 5, "criteria": (3, 30, 0.01)}
        for frame in range(first + 1, last + 1):
            if len(here) < 8:
                return
            grey, following = self.grey(frame - 1), self.grey(frame)
            there, good, _ = cv2.calcOpticalFlowPyrLK(grey, following, here, None, **options)
            back, good_back, _ = cv2.calcOpticalFlowPyrLK(following, grey, there, None, **options)
            height, width = grey.shape
            keep = (good.ravel() == 1) & (good_back.ravel() == 1) & (np.linalg.norm(back - here, axis=1) < RETURN_LIMIT_PX)
            keep &= (there >= 0).all(1) & (there < (width, height)).all(1)
            pixel = there[keep].astype(int)
            keep[keep] = self.mask[pixel[:, 1], pixel[:, 0]] > 0
            begin, here = begin[keep], there[keep]
            yield frame, begin, here


class Run:
    """Final poses and states of a run's frames."""

    def __init__(self, run, clip):
        with (run / "frames.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        for column in ("frame_idx", "timestamp_ns", "live_map_id", "map_id"):
            if not rows or column not in rows[0]:
                raise Refusal(f"{run / 'frames.csv'}: no column {column}, or no frames")
        count = 1 + max(int(row["frame_idx"]) for row in rows)
        self.tracked, self.map = [False] * count, [-1] * count
        self.pose = [None] * count
        poses = {}
        for row in rows:
            frame = int(row["frame_idx"])
            self.tracked[frame], self.map[frame] = int(row["live_map_id"]) >= 0, int(row["map_id"])
            if self.map[frame] >= 0:
                if self.map[frame] not in poses:
                    poses[self.map[frame]] = self._read(run / "trajectory" / f"map_{self.map[frame]:04}.tum")
                stamp = int(row["timestamp_ns"]) * 1e-9
                near = poses[self.map[frame]].get(round(stamp / SAME_STAMP_S))
                self.pose[frame] = near
                self.map[frame] = self.map[frame] if near else -1
        self.camera = Camera(next((p for p in (run / "calib.yaml", clip / "calib.yaml") if p.is_file()), clip / "calib.yaml"))

    @staticmethod
    def _read(path):
        poses = {}
        for line in path.read_text(encoding="ascii").splitlines():
            if line.strip() and not line.startswith("#"):
                stamp, x, y, z, qx, qy, qz, qw = (float(v) for v in line.split())
                q = np.array([qw, qx, qy, qz])
                w, a, b, c = q / np.linalg.norm(q)
                rotation = np.array([[1 - 2 * (b * b + c * c), 2 * (a * b - c * w), 2 * (a * c + b * w)],
                                     [2 * (a * b + c * w), 1 - 2 * (a * a + c * c), 2 * (b * c - a * w)],
                                     [2 * (a * c - b * w), 2 * (b * c + a * w), 1 - 2 * (a * a + b * b)]])
                for key in (-1, 0, 1):
                    poses.setdefault(round(stamp / SAME_STAMP_S) + key, (rotation, np.array([x, y, z])))
        return poses

    def is_tracked(self, frame):
        """A pose was answered at the time, and the frame has one in a map that exists at the end."""
        return 0 <= frame < len(self.pose) and self.tracked[frame] and self.pose[frame] is not None

    def stretches(self):
        """(first, last) of frames in a row that were tracked and are in one final map."""
        found, first = [], None
        for frame in range(len(self.pose) + 1):
            goes_on = first is not None and self.is_tracked(frame) and self.map[frame] == self.map[first]
            if first is not None and not goes_on:
                found.append((first, frame - 1))
                first = None
            if first is None and self.is_tracked(frame):
                first = frame
        return found

    def recoveries(self):
        """(last frame before, first frame after) of each gap whose two sides have poses in one final map."""
        found, last_of = [], {}
        before = None
        for first, last in self.stretches():
            if self.map[first] in last_of and first - before[1] > 1:
                found.append((last_of[self.map[first]], first))
            last_of[self.map[first]] = last
            before = (first, last)
        return found


class Judge:
    def __init__(self, run, clip):
        self.run, self.pictures = Run(run, clip), Pictures(clip)
        if len(self.run.pose) > len(self.pictures.files):
            raise Refusal(f"{clip / 'frames'}: {len(self.pictures.files)} pictures, the run has {len(self.run.pose)} frames")

    def measure(self, first, frame, begin, end):
        """What the corners say of the poses of two frames; None where they are too few or too close together."""
        a, b = self.run.camera.rays(begin), self.run.camera.rays(end)
        known = np.isfinite(a).all(1) & np.isfinite(b).all(1)
        height, width = self.pictures.mask.shape
        cells = {(int(4 * x / width), int(4 * y / height)) for x, y in end[known]}
        if known.sum() < MIN_CORNERS or len(cells) < MIN_CELLS:
            return None
        a, b = a[known], b[known]
        distance = float(np.median(epipolar_distances(essential_of(self.run.pose[first], self.run.pose[frame]), a, b)))
        scale = self.run.camera.scale
        return {"from": first, "to": frame, "corners": int(known.sum()), "px": distance * scale,
                "best_px": min(distance, best_median(a, b)) * scale,
                "moved_px": float(np.median(np.linalg.norm(end - begin, axis=1)))}

    def sample(self, longest):
        """Measures of tracked stretches by length, up to `longest` frames."""
        stretches = [(a, b) for a, b in self.run.stretches() if b > a]
        total = sum(b - a for a, b in stretches)
        lengths = [n for n in (1, 2, 3, 4, 6, 8, 11, 16, 23, 32, 45, 64, 91, 128) if n <= longest]
        measures = {}
        for sample in range(SAMPLES):
            # Evenly over all tracked frames; early enough in its stretch for half of it to follow.
            offset = int(total * (sample + 0.5) / SAMPLES)
            for a, b in stretches:
                if offset < b - a:
                    break
                offset -= b - a
            first = a + offset // 2
            for frame, begin, end in self.pictures.chain(first, min(b, first + longest)):
                if frame - first in lengths:
                    found = self.measure(first, frame, begin, end)
                    if found is None:
                        break
                    measures.setdefault(frame - first, []).append(found)
        return {n: m for n, m in measures.items() if len(m) >= MIN_SAMPLES}

    @staticmethod
    def usual(samples, length, key):
        """Median of the tracked stretches of this length, or of the nearest below, grown with it; None if under half."""
        below = [n for n in samples if n <= length]
        if not below or 2 * max(below) < length:
            return None
        return statistics.median(m[key] for m in samples[max(below)]) * length / max(below)

    def recovery(self, before, after, samples):
        result = {"before": before, "after": after, "verdict": "not judged"}
        if after - before > MAX_CHAIN:
            return result | {"reason": f"{after - before} frames apart"}
        targets = []
        for frame in range(after, after + TARGETS):
            if not self.run.is_tracked(frame) or self.run.map[frame] != self.run.map[before]:
                break
            targets.append(frame)
        measures, left = [], 0
        for back in STARTS:
            first = before - back
            if not self.run.is_tracked(first) or self.run.map[first] != self.run.map[before]:
                continue
            for frame, begin, end in self.pictures.chain(first, targets[-1]):
                if frame in targets:
                    left = max(left, len(end))
                    found = self.measure(first, frame, begin, end)
                    if found:
                        measures.append(found)
        if not measures:
            return result | {"reason": f"{left} corners left"}
        ratios = []
        for m in measures:
            usual = self.usual(samples, m["to"] - m["from"], "px")
            if usual is None:
                return result | {"reason": f"no tracked stretch of half of {m['to'] - m['from']} frames"}
            ratios.append(m["px"] / max(usual, m["best_px"]))
        ratio = statistics.median(ratios)
        verdict = "true" if ratio <= TRUE_RATIO else "false" if ratio >= FALSE_RATIO else "not judged"
        result |= {"verdict": verdict, "ratio": ratio, "corners": int(statistics.median(m["corners"] for m in measures))}
        result |= {key: statistics.median(m[key] for m in measures) for key in ("px", "best_px", "moved_px")}
        return result if verdict != "not judged" else result | {"reason": "between true and false"}

    def recoveries(self):
        gaps = self.run.recoveries()
        lengths = [after - before + TARGETS + max(STARTS) for before, after in gaps if after - before <= MAX_CHAIN]
        samples = self.sample(max(lengths)) if lengths else {}
        return [self.recovery(before, after, samples) for before, after in gaps]

    def tracked(self, stride):
        """Chains of `stride` frames inside tracked stretches, each begun where the one before ended."""
        measures, unknown = [], 0
        for first, last in self.run.stretches():
            for begin_frame in range(first, last - stride + 1, stride):
                found = None
                for frame, begin, end in self.pictures.chain(begin_frame, begin_frame + stride):
                    if frame == begin_frame + stride:
                        found = self.measure(begin_frame, frame, begin, end)
                if found:
                    measures.append(found)
                else:
                    unknown += 1
        usual = statistics.median(m["best_px"] for m in measures) if measures else 0.0
        for m in measures:
            m["map"] = self.run.map[m["from"]]
            m["ratio"] = m["px"] / max(m["best_px"], usual, 1e-9)
            m["verdict"] = "true" if m["ratio"] <= TRUE_RATIO else "false" if m["ratio"] >= FALSE_RATIO else "not judged"
        return {"stride": stride, "chains": measures, "broken": unknown}


def judge(run, clip, stride=None):
    """All that is found, as a dictionary: recoveries and, with a stride, tracked chains."""
    judge_of_run = Judge(pathlib.Path(run), pathlib.Path(clip))
    recoveries = judge_of_run.recoveries()
    found = {"recoveries": recoveries, "judged": sum(r["verdict"] != "not judged" for r in recoveries),
             "false": sum(r["verdict"] == "false" for r in recoveries)}
    if stride:
        found["tracked"] = judge_of_run.tracked(stride)
    return found


def lines_of(found):
    yield f"recoveries {len(found['recoveries'])}, judged {found['judged']}, false {found['false']}"
    for r in found["recoveries"]:
        line = f"  {r['before']} to {r['after']}: {r['verdict']}"
        if "px" in r:
            line += (f", {r['px']:.2f} px, best {r['best_px']:.2f}, ratio {r['ratio']:.1f}, {r['corners']} corners moved by "
                     f"{r['moved_px']:.0f} px")
        yield line + (f" ({r['reason']})" if "reason" in r else "")
    if "tracked" in found:
        chains = found["tracked"]["chains"]
        yield (f"tracked chains of {found['tracked']['stride']} frames: {len(chains)}, broken {found['tracked']['broken']}, false "
               f"{sum(m['verdict'] == 'false' for m in chains)}")
        for m in chains:
            if m["verdict"] != "true":
                yield (f"  {m['from']} to {m['to']}, map {m['map']}: {m['verdict']}, {m['px']:.2f} px, best {m['best_px']:.2f}, "
                       f"ratio {m['ratio']:.1f}, {m['corners']} corners moved by {m['moved_px']:.0f} px")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("clip", type=pathlib.Path)
    parser.add_argument("--stride", type=int, metavar="N", help="judge tracked chains of N frames as well")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="all figures")
    parser.add_argument("--overwrite", action="store_true", help="replace FILE")
    arguments = parser.parse_args()
    if arguments.stride is not None and arguments.stride < 1:
        parser.error("--stride is at least 1")
    if arguments.json and arguments.json.exists() and not arguments.overwrite:
        parser.error(f"{arguments.json} is there; --overwrite replaces it")
    cv2.setNumThreads(1)
    try:
        found = judge(arguments.run, arguments.clip, arguments.stride)
    except (Refusal, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 1
    print("\n".join(lines_of(found)))
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
