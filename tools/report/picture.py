#!/usr/bin/env python3
"""One picture of a run, for the README: a frame of the sequence, the maps with their points and paths, and which frames have a
pose.

    python3 tools/report/picture.py SEQUENCE RESULT PICTURE.svg [--frame N]

SEQUENCE is a folder with frames/*.jpg, RESULT what `haustra run` wrote. The README's picture is that of the demo's rendered
colon; pictures of patients do not belong into the tree. Needs only the standard library.
"""

import argparse
import base64
import csv
import pathlib
import struct
import sys

WIDTH, HEIGHT, MARGIN = 960, 430, 16
FRAME = (MARGIN, 40, 400, 300)             # x, y, width, height
VIEW = (432, 40, WIDTH - 432 - MARGIN, 300)
STRIP = (MARGIN, 372, WIDTH - 2 * MARGIN, 18)
MAX_POINTS = 7000
COLOURS = {"live": "#2e7d4f", "later": "#9ccc9c", "none": "#c0392b"}
WORDS = {"live": "pose answered at the time", "later": "pose found later", "none": "no pose"}
PATH_COLOURS = ["#0b5fa5", "#a5420b", "#6a1b9a", "#00796b", "#5d4037"]


def read_path(file):
    """Camera centres of a TUM file."""
    rows = [line.split() for line in file.read_text(encoding="ascii").splitlines() if line and not line.startswith("#")]
    return [tuple(map(float, row[1:4])) for row in rows]


def read_points(file):
    """Positions and colours of a PLY file of ours: x y z as floats, then red green blue as bytes, then what is skipped."""
    head, _, body = file.read_bytes().partition(b"end_header\n")
    sizes = {"float": 4, "uchar": 1, "int": 4}
    properties = [line.split()[1:] for line in head.decode("ascii").splitlines() if line.startswith("property ")]
    count = next(int(line.split()[2]) for line in head.decode("ascii").splitlines() if line.startswith("element vertex"))
    if [name for _, name in properties[:6]] != ["x", "y", "z", "red", "green", "blue"]:
        sys.exit(f"{file}: not a map of ours")
    step = sum(sizes[kind] for kind, _ in properties)
    return [struct.unpack_from("<fffBBB", body, i * step) for i in range(count)]


def quantile(values, share):
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def spread(values):
    return max(values) - min(values)


class Plane:
    """From a map into the picture: the two axes along which the path is longest, the longer one to the right."""

    def __init__(self, path, points, box):
        along = sorted(range(3), key=lambda axis: -spread([p[axis] for p in path]))
        self.axes = along[:2]
        # A few points far away must not make everything else small.
        low = [min(min(p[a] for p in path), quantile([p[a] for p in points], 0.01)) for a in self.axes]
        high = [max(max(p[a] for p in path), quantile([p[a] for p in points], 0.99)) for a in self.axes]
        self.scale = min(box[2] / (high[0] - low[0]), box[3] / (high[1] - low[1]))
        self.middle = [(l + h) / 2 for l, h in zip(low, high)]
        self.box = box

    def __call__(self, point):
        x = self.box[0] + self.box[2] / 2 + self.scale * (point[self.axes[0]] - self.middle[0])
        y = self.box[1] + self.box[3] / 2 + self.scale * (point[self.axes[1]] - self.middle[1])
        inside = self.box[0] <= x <= self.box[0] + self.box[2] and self.box[1] <= y <= self.box[1] + self.box[3]
        return (x, y) if inside else None


def draw_map(points, path, colour, box):
    plane, dots = Plane(path, points, box), {}
    for point in points[::max(1, -(-len(points) // MAX_POINTS))]:
        if (place := plane(point)) is not None:
            shade = "#" + "".join(f"{min(15, (c + 8) // 17):x}" for c in point[3:6])
            dots.setdefault(shade, []).append(f"M{place[0]:.0f} {place[1]:.0f}h0")
    lines = [f'<path stroke="{shade}" d="{"".join(places)}"/>' for shade, places in sorted(dots.items())]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in filter(None, map(plane, path)))
    return ('<g stroke-width="2.2" stroke-linecap="round" fill="none">' + "".join(lines) + "</g>"
            f'<polyline points="{line}" fill="none" stroke="#fff" stroke-width="4"/>'
            f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')


def states(rows):
    """live, later or none for each frame."""
    return ["live" if row["live_map_id"] != "-1" and row["map_id"] != "-1" else
            "later" if row["map_id"] != "-1" else "none" for row in rows]


def text(x, y, words, size=14, anchor="start", weight="normal"):
    return (f'<text x="{x:.0f}" y="{y:.0f}" font-size="{size}" text-anchor="{anchor}" font-weight="{weight}">'
            f"{words}</text>")


def picture(sequence, result, frame):
    rows = list(csv.DictReader((result / "frames.csv").open(encoding="ascii", newline="")))
    frames = sorted((sequence / "frames").glob("*.jpg"))
    if not 0 <= frame < min(len(frames), len(rows)):
        sys.exit(f"frame {frame}: the sequence has the frames 0 to {len(frames) - 1}")
    maps = [(read_points(file), read_path(result / "trajectory" / f"{file.stem}.tum"))
            for file in sorted((result / "maps").glob("map_*.ply"))]
    if not maps:
        sys.exit(f"{result}: no map")
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
             'font-family="sans-serif" fill="#222">', f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>']
    jpeg = base64.b64encode(frames[frame].read_bytes()).decode("ascii")
    x, y, width, height = FRAME
    parts.append(text(x, y - 12, f"frame {frame} of {len(rows)}", weight="bold"))
    parts.append(f'<image x="{x}" y="{y}" width="{width}" height="{height}" href="data:image/jpeg;base64,{jpeg}"/>')
    x, y, width, height = VIEW
    num_points = sum(len(points) for points, _ in maps)
    named = f"{len(maps)} map{'s' if len(maps) > 1 else ''}"
    parts.append(text(x, y - 12, f"{named}, {num_points} points, and the path of the camera", weight="bold"))
    share = width / len(maps)
    for i, (points, path) in enumerate(maps):
        parts.append(draw_map(points, path, PATH_COLOURS[i % len(PATH_COLOURS)], (x + i * share, y, share, height)))
    x, y, width, height = STRIP
    kinds, begin = states(rows), 0
    for i in range(1, len(kinds) + 1):
        if i == len(kinds) or kinds[i] != kinds[begin]:
            parts.append(f'<rect x="{x + width * begin / len(kinds):.2f}" y="{y}" height="{height}" '
                         f'width="{width * (i - begin) / len(kinds):.2f}" fill="{COLOURS[kinds[begin]]}"/>')
            begin = i
    seconds = int(rows[-1]["timestamp_ns"]) / 1e9
    parts.append(text(x, y - 6, f"{seconds:.0f} s of video"))
    for i, kind in enumerate(("live", "later", "none")):
        left = x + i * (width + MARGIN) / 3
        parts.append(f'<rect x="{left:.0f}" y="{y + height + 10}" width="12" height="12" fill="{COLOURS[kind]}"/>')
        parts.append(text(left + 18, y + height + 21, f"{WORDS[kind]}: {kinds.count(kind)} frames", size=13))
    return "\n".join(parts) + "\n</svg>\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("result", type=pathlib.Path)
    parser.add_argument("picture", type=pathlib.Path)
    parser.add_argument("--frame", type=int, default=150, help="which frame is shown, counted from 0")
    arguments = parser.parse_args()
    arguments.picture.write_text(picture(arguments.sequence, arguments.result, arguments.frame), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
