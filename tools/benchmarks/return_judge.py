#!/usr/bin/env python3
"""Is a place that a scope comes back to where it was? Judges a run on the kind `back` of recordings.py, which shows some
frames of a clip twice, the second time turned. Truth is in the making: both pictures of a frame have one camera centre,
and differ by the turn.

    python3 tools/benchmarks/return_judge.py RUN CLIP_back [--json FILE]

For each map: pairs of pictures of one frame that both have a final pose in it, of all pairs; and of these the distance of
the two centres, as a share of the depth of what is seen, and the angle that is left beside the turn. Median and worst.
Needs numpy.
"""

import argparse
import json
import pathlib
import re
import sys

import numpy as np

from poses import rotation


def rows_of(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    return [line.split() for line in lines if line.strip() and not line.startswith("#")]


def sources_of(clip):
    """Pairs (first picture, second picture) of one frame, and the turn in degrees."""
    path = clip / "sources.txt"
    if not path.is_file():
        sys.exit(f"{path}: not there; the kind `back` of recordings.py has it")
    turn = re.search(r"turned by ([-+.\d]+) degrees", path.read_text(encoding="ascii"))
    if not turn:
        sys.exit(f"{path}: the first line does not say by how much pictures are turned")
    first = {}
    pairs = []
    for picture, (frame, is_turned) in enumerate(rows_of(path)):
        if frame == "-1":
            continue
        if is_turned == "0":
            first[frame] = picture
        elif frame in first:
            pairs.append((first[frame], picture))
    return pairs, float(turn[1])


def poses_of(trajectory, times):
    """By picture: rotation world_from_cam, camera centre."""
    poses = {}
    for row in rows_of(trajectory):
        time, tx, ty, tz, qx, qy, qz, qw = map(float, row)
        picture = int(np.argmin(np.abs(times - time)))
        poses[picture] = (rotation(qw, qx, qy, qz), np.array([tx, ty, tz]))
    return poses


def depth_of(model):
    """The median depth of what keyframes see, from an export in COLMAP's form."""
    points = {row[0]: np.array(row[1:4], float) for row in rows_of(model / "points3D.txt")}
    depths = []
    images = rows_of(model / "images.txt")
    for image, seen in zip(images[::2], images[1::2]):
        forward = rotation(*map(float, image[1:5]))[2]
        depths += [forward @ points[point] + float(image[7]) for point in seen[2::3] if point in points]
    return float(np.median(depths))


def turn_about_axis(degrees):
    angle = np.radians(degrees)
    return rotation(np.cos(angle / 2), 0, 0, np.sin(angle / 2))


def judge(run, clip):
    pairs, turn = sources_of(clip)
    times = np.array([float(row[-1]) for row in rows_of(clip / "times.txt")])
    found = []
    for trajectory in sorted((run / "trajectory").glob("map_*.tum")):
        poses = poses_of(trajectory, times)
        both = [(poses[a], poses[b]) for a, b in pairs if a in poses and b in poses]
        if not both:
            continue
        depth = depth_of(run / "maps" / trajectory.stem)
        shifts = [100 * np.linalg.norm(b[1] - a[1]) / depth for a, b in both]
        # A picture turned clockwise is that of a camera turned the other way.
        left = [turn_about_axis(turn) @ a[0].T @ b[0] for a, b in both]
        angles = [np.degrees(np.arccos(np.clip((np.trace(turned) - 1) / 2, -1, 1))) for turned in left]
        found.append({"map": trajectory.stem, "pairs": len(both), "of": len(pairs),
                      "shift_percent_of_depth": float(np.median(shifts)), "worst_shift": float(max(shifts)),
                      "angle_deg": float(np.median(angles)), "worst_angle_deg": float(max(angles))})
    return {"pairs": len(pairs), "turn_deg": turn, "maps": found}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("clip", type=pathlib.Path)
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    found = judge(arguments.run, arguments.clip)
    for one in found["maps"]:
        print(f"{one['map']}: {one['pairs']} of {one['of']} pairs, apart by {one['shift_percent_of_depth']:.2f} % of the depth "
              f"(worst {one['worst_shift']:.2f}) and {one['angle_deg']:.2f} degrees (worst {one['worst_angle_deg']:.2f})")
    if not found["maps"]:
        print(f"none of {found['pairs']} pairs has both poses in one map")
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
