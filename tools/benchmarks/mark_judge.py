#!/usr/bin/env python3
"""Marks of a run against the truth of a rendered sequence.

    haustra render SEQUENCE --depth ...
    python3 tools/benchmarks/mark_judge.py choose SEQUENCE --out MARKS.csv [--every 25] [--seed 1]
    haustra run SEQUENCE --out RUN --marks MARKS.csv
    python3 tools/benchmarks/mark_judge.py judge RUN SEQUENCE MARKS.csv [--json FILE] [--overwrite]

`choose` takes a place every so many frames, by the true depth: where the scene can be seen, and no farther than the median
depth of the frame. `judge` knows by depth and pose of the marked frame where each place lies, and by those of every later
frame whether the camera sees it there: its pixel, and whether the wall before it is as far away as it is. Where the wall is
neither clearly as far nor clearly nearer, at the edge of a fold, nothing is judged.

Frames are those in which the map of the mark was tracked, after the one in which it was set. Found: drawn within 2 % of the
width of the picture. Where walls breathe, the depth is that of the moment, and the place the same for all: the rest position.

Needs only the standard library.
"""

import argparse
import csv
import json
import math
import pathlib
import random
import sys

FOUND_SHARE = 0.02      # of the width
MARGIN_SHARE = 0.02     # nearer the edge of the picture than that nothing is judged
SAME_WALL = 0.05        # of the range
NEARER_WALL = 0.90
DEPTH_STEP = 4          # pixels of the picture to one of the depth
DEPTH_UNIT = 1.0 / 256.0


class Refusal(Exception):
    """Something is wrong with a file; the text names it."""


class Camera:
    """Kannala-Brandt, by a calib.yaml of `haustra render`."""

    def __init__(self, path):
        values = {}
        for line in path.read_text().splitlines():
            key, separator, value = line.partition(":")
            if separator:
                values[key.strip().rsplit(".", 1)[-1]] = value.split("#")[0].strip().strip('"')
        try:
            self.fx, self.fy, self.cx, self.cy = (float(values[key]) for key in ("fx", "fy", "cx", "cy"))
            self.k = [float(values[f"k{i}"]) for i in (1, 2, 3, 4)]
            self.width, self.height = int(values["width"]), int(values["height"])
        except KeyError as missing:
            raise Refusal(f"{path}: {missing} is missing; the camera of a rendered sequence is expected") from None

    def radius(self, angle):
        square = angle * angle
        return angle * (1 + square * (self.k[0] + square * (self.k[1] + square * (self.k[2] + square * self.k[3]))))

    def project(self, point):
        x, y, z = point
        across = math.hypot(x, y)
        angle = math.atan2(across, z)
        if z <= 0:
            return None
        radius = self.radius(angle)
        scale = radius / across if across > 0 else 0.0
        return self.fx * x * scale + self.cx, self.fy * y * scale + self.cy

    def ray(self, u, v):
        x, y = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        radius = math.hypot(x, y)
        low, high = 0.0, 1.5
        for _ in range(60):
            angle = 0.5 * (low + high)
            low, high = (angle, high) if self.radius(angle) < radius else (low, angle)
        scale = math.sin(angle) / radius if radius > 0 else 0.0
        return x * scale, y * scale, math.cos(angle)


class Pose:
    """world_from_cam."""

    def __init__(self, fields):
        self.centre = fields[0:3]
        x, y, z, w = fields[3:7]
        self.rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]

    def to_world(self, point):
        return [sum(row[i] * point[i] for i in range(3)) + c for row, c in zip(self.rows, self.centre)]

    def to_camera(self, point):
        offset = [p - c for p, c in zip(point, self.centre)]
        return [sum(self.rows[j][i] * offset[j] for j in range(3)) for i in range(3)]


class Sequence:
    def __init__(self, folder):
        self.folder = folder
        true_camera = folder / "calib_true.yaml"
        self.camera = Camera(true_camera if true_camera.exists() else folder / "calib.yaml")
        lines = [line.split() for line in (folder / "groundtruth.txt").read_text().splitlines()]
        self.poses = [Pose([float(f) for f in line[1:8]]) for line in lines if line and line[0][0] != "#"]
        self.depths = {}
        self.unseen = set()
        events = folder / "events.csv"
        if events.exists():
            with open(events, newline="") as file:
                for row in csv.DictReader(r for r in file if not r.startswith("#")):
                    if row.get("visible", "1") == "0":
                        self.unseen.update(range(int(row["first_frame"]), int(row["last_frame"]) + 1))

    def depth(self, frame):
        """Width, height and ranges of a frame, row by row; 0: not known."""
        if frame not in self.depths:
            path = self.folder / "depth" / f"{frame:06d}.pgm"
            if not path.exists():
                raise Refusal(f"{path} is missing: haustra render --depth writes it")
            data = path.read_bytes()
            head = []
            for line in data.split(b"\n", 8)[:8]:
                head += [] if line.startswith(b"#") or len(head) >= 4 else line.split()
            if len(head) < 4 or head[0] != b"P5" or head[3] != b"65535":
                raise Refusal(f"{path}: a picture of 16 bits is expected")
            width, height = int(head[1]), int(head[2])
            body = data[len(data) - 2 * width * height:]
            values = [DEPTH_UNIT * (body[i] << 8 | body[i + 1]) for i in range(0, len(body), 2)]
            self.depths = {frame: (width, height, values)}  # one is enough: frames come in order
        return self.depths[frame]

    def ranges_around(self, frame, u, v):
        width, height, values = self.depth(frame)
        x, y = int((u + 0.5) / DEPTH_STEP), int((v + 0.5) / DEPTH_STEP)
        around = [(i, j) for j in range(y - 1, y + 2) for i in range(x - 1, x + 2)]
        return [values[j * width + i] for i, j in around if 0 <= i < width and 0 <= j < height]

    def place(self, frame, u, v):
        """Where in the world a pixel of a frame shows the wall; None where that is not known."""
        around = sorted(self.ranges_around(frame, u, v))
        if not around or around[0] <= 0 or around[-1] > (1 + 2 * SAME_WALL) * around[0]:
            return None
        distance = around[len(around) // 2]
        return self.poses[frame].to_world([distance * r for r in self.camera.ray(u, v)])

    def view(self, frame, place):
        """How a frame sees a place: 'out', 'seen', 'hidden' or 'edge', and its pixel."""
        in_camera = self.poses[frame].to_camera(place)
        pixel = self.camera.project(in_camera)
        margin = MARGIN_SHARE * self.camera.width
        if pixel is None:
            return "out", None
        u, v = pixel
        if not (0 <= u <= self.camera.width - 1 and 0 <= v <= self.camera.height - 1):
            return "out", pixel
        is_inside = margin <= u < self.camera.width - margin and margin <= v < self.camera.height - margin
        around = self.ranges_around(frame, u, v)
        if not is_inside or not around or min(around) <= 0:
            return "edge", pixel
        distance = math.sqrt(sum(c * c for c in in_camera))
        if max(around) < NEARER_WALL * distance:
            return "hidden", pixel
        if max(abs(r - distance) for r in around) <= 2 * SAME_WALL * distance:
            return "seen", pixel
        return "edge", pixel


def choose(sequence, every, seed):
    rng = random.Random(seed)
    camera = sequence.camera
    marks = []
    for frame in range(every, len(sequence.poses), every):
        if frame in sequence.unseen:
            continue
        known = sorted(r for r in sequence.depth(frame)[2] if r > 0)
        for _ in range(200):
            u = rng.uniform(0.15, 0.85) * camera.width
            v = rng.uniform(0.15, 0.85) * camera.height
            around = sequence.ranges_around(frame, u, v)
            if min(around) <= 0 or max(around) > known[len(known) // 2] or sequence.place(frame, u, v) is None:
                continue
            marks.append((frame, round(u, 2), round(v, 2), f"m{frame}"))
            break
    return marks


def judge(run, sequence, marks):
    """A figure a mark, and the sums. Counts are of frames."""
    summary = json.loads((run / "summary.json").read_text()).get("marks", {"set": [], "refused": []})
    refused = {mark["label"]: mark["reason"] for mark in summary["refused"]}
    by_frame = {}
    table = run / "marks.csv"
    if table.exists():
        with open(table, newline="") as file:
            for row in csv.DictReader(file):
                by_frame.setdefault(int(row["frame_idx"]), []).append(row)
    places = {label: sequence.place(frame, u, v) for frame, u, v, label in marks}
    set_in = {label: frame for frame, u, v, label in marks}
    names = ("seen", "found", "drawn_elsewhere", "seen_called_hidden", "seen_called_unsure", "seen_called_out", "hidden",
             "hidden_drawn", "hidden_called_unsure", "out", "out_drawn", "edge")
    figures = {label: dict.fromkeys(names, 0) for label in places}
    errors = []
    for frame in sorted(by_frame):
        if frame in sequence.unseen or frame >= len(sequence.poses):
            continue
        for row in by_frame[frame]:
            label, state = row["mark"], row["state"]
            if label not in figures or places[label] is None or frame <= set_in[label]:
                continue
            counts = figures[label]
            view, pixel = sequence.view(frame, places[label])
            counts[view] += 1
            if view == "seen":
                if state == "in_front":
                    error = math.hypot(float(row["u_px"]) - pixel[0], float(row["v_px"]) - pixel[1])
                    errors.append(error / sequence.camera.width)
                    counts["found" if errors[-1] <= FOUND_SHARE else "drawn_elsewhere"] += 1
                else:
                    counts["seen_called_" + {"hidden": "hidden", "unsure": "unsure", "out_of_view": "out"}[state]] += 1
            elif view == "hidden":
                counts["hidden_drawn"] += state == "in_front"
                counts["hidden_called_unsure"] += state == "unsure"
            elif view == "out":
                counts["out_drawn"] += state == "in_front"
    total = {name: sum(counts[name] for counts in figures.values()) for name in names}
    errors.sort()
    return {
        "chosen": len(marks),
        "set": len([label for label in figures if label not in refused]),
        "refused": refused,
        "frames": total,
        "found_share": total["found"] / total["seen"] if total["seen"] else None,
        "hidden_drawn_share": total["hidden_drawn"] / total["hidden"] if total["hidden"] else None,
        "error_share": {f"p{p}": errors[min(len(errors) - 1, len(errors) * p // 100)] for p in (50, 95, 99)} if errors else None,
        "marks": figures,
    }


def read_marks(path):
    with open(path, newline="") as file:
        return [(int(r["frame"]), float(r["u"]), float(r["v"]), r["label"]) for r in csv.DictReader(file)]


def percent(share):
    return "-" if share is None else f"{100 * share:.1f} %"


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    choosing = commands.add_parser("choose")
    choosing.add_argument("sequence", type=pathlib.Path)
    choosing.add_argument("--out", type=pathlib.Path, required=True)
    choosing.add_argument("--every", type=int, default=25)
    choosing.add_argument("--seed", type=int, default=1)
    judging = commands.add_parser("judge")
    judging.add_argument("run", type=pathlib.Path)
    judging.add_argument("sequence", type=pathlib.Path)
    judging.add_argument("marks", type=pathlib.Path)
    judging.add_argument("--json", type=pathlib.Path)
    for command in (choosing, judging):
        command.add_argument("--overwrite", action="store_true")
    options = parser.parse_args(arguments)
    out = options.out if options.command == "choose" else options.json
    if out and out.exists() and not options.overwrite:
        raise Refusal(f"{out} is there already; --overwrite replaces it")
    sequence = Sequence(options.sequence)
    if options.command == "choose":
        marks = choose(sequence, options.every, options.seed)
        out.write_text("frame,u,v,label\n" + "".join(f"{f},{u},{v},{label}\n" for f, u, v, label in marks))
        print(f"{len(marks)} marks")
        return
    result = judge(options.run, sequence, read_marks(options.marks))
    if out:
        out.write_text(json.dumps(result, indent=2) + "\n")
    frames = result["frames"]
    print(f"marks        {result['set']} set of {result['chosen']} chosen")
    for label, reason in result["refused"].items():
        print(f"  refused    {label}: {reason}")
    print(f"found        {percent(result['found_share'])} of {frames['seen']} frames that see a mark"
          f" ({frames['drawn_elsewhere']} elsewhere, {frames['seen_called_hidden']} called hidden,"
          f" {frames['seen_called_unsure']} unsure, {frames['seen_called_out']} out)")
    print(f"drawn        {percent(result['hidden_drawn_share'])} of {frames['hidden']} frames in which the wall hides it")
    if result["error_share"]:
        print("error        " + ", ".join(f"{k} {percent(v)}" for k, v in result["error_share"].items()) + " of the width")


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except (Refusal, OSError) as error:
        sys.exit(f"mark_judge.py: {error}")
