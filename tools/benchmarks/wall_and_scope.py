#!/usr/bin/env python3
"""Can one camera tell the motion of a living wall from its own?

    python3 tools/benchmarks/wall_and_scope.py MAP SEQUENCE [--every N] [--points N] [--nodes N] [--strength SHARE]

MAP is a map that `haustra run` wrote (OUT/maps/map_0000), SEQUENCE the rendered colon, with groundtruth.txt. All keyframes and
points of the map are adjusted together, from the observations that the program made, in five ways: with a rigid wall, freely
and with the cameras held at the truth; with a wall that moves by itself in each view, freely, freely from the true cameras,
and held at the truth.

The motion of the wall is a Gaussian process: a displacement at each of some nodes among the points in view, as long as
--strength times the median depth, alike within one median depth. Its energy counts with the reprojection errors.

Where the free solution explains the pictures no worse than the truth does, no adjustment of this kind can find the truth.
The table has the cost (robust squared errors in pixels, and the energy), the median error and the RMS ATE after one Sim(3).

Needs numpy.
"""

import argparse
import pathlib
import re

import numpy as np

from poses import rotation, similarity

ROBUST_PX2 = 6.0     # where the cost of a squared error levels off (Geman and McClure)
SEED = 1             # of the choice of points
FAR_ENOUGH = 0.02    # of the median depth: nearer points have no derivative worth using
HELD = 1e15          # information that keeps a camera where it is
SMALL_GAIN = 2e-4    # of the cost: converged


class Camera:
    """Kannala and Brandt, from calib.yaml."""

    def __init__(self, path):
        text = path.read_text()

        def value(key):
            found = re.search(rf"\b{key}\s*:\s*([-+.\deE]+)", text)
            return float(found.group(1)) if found else 0.0

        self.focal = np.array([value("fx"), value("fy")])
        self.centre = np.array([value("cx"), value("cy")])
        self.distortion = [value(f"k{i}") for i in (1, 2, 3, 4)]

    def project(self, points):
        radius = np.hypot(points[:, 0], points[:, 1]) + 1e-12
        angle = np.arctan2(radius, points[:, 2])
        square, factor = angle * angle, 0.0
        for k in reversed(self.distortion):
            factor = square * (k + factor)
        return self.focal * (points[:, :2] * (angle * (1.0 + factor) / radius)[:, None]) + self.centre

    def jacobian(self, points):
        step = 1e-5 * np.linalg.norm(points, axis=1)
        columns = []
        for axis in np.eye(3):
            moved = step[:, None] * axis
            columns.append((self.project(points + moved) - self.project(points - moved)) / (2.0 * step[:, None]))
        return np.stack(columns, axis=2)


def skew(v):
    zero = np.zeros(v.shape[:-1])
    rows = [[zero, -v[..., 2], v[..., 1]], [v[..., 2], zero, -v[..., 0]], [-v[..., 1], v[..., 0], zero]]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def turned(v):
    angle, k = np.linalg.norm(v), skew(v)
    if angle < 1e-12:
        return np.eye(3) + k
    return np.eye(3) + np.sin(angle) / angle * k + (1.0 - np.cos(angle)) / angle**2 * k @ k


def rows_of(path):
    return [line for line in path.read_text().splitlines() if not line.startswith("#")]


class Views:
    """Keyframes, points and observations of a map, in the frame and unit of the truth."""

    def __init__(self, arguments):
        self.camera = Camera(arguments.sequence / "calib.yaml")
        truth = {round(1000 * row[0]): row for row in np.loadtxt(arguments.sequence / "groundtruth.txt")}
        times = np.loadtxt(arguments.sequence / "times.txt", ndmin=1)
        rows = rows_of(arguments.map / "images.txt")
        views = []
        for head, sights in zip(rows[::2], rows[1::2]):
            head = head.split()
            frame = int(pathlib.Path(head[9]).stem)
            true_row = truth.get(round(1000 * times[frame]))
            sights = np.array(sights.split(), float).reshape(-1, 3)
            if true_row is not None:
                pose = np.array(head[1:8], float)
                views.append((frame, rotation(*pose[:4]), pose[4:], sights[sights[:, 2] >= 0], true_row))
        views = sorted(views, key=lambda view: view[0])[::arguments.every]
        points = {int(row[0]): row[1:4] for row in (line.split(None, 4) for line in rows_of(arguments.map / "points3D.txt"))}
        self.true_turns = np.array([rotation(view[4][7], *view[4][4:7]).T for view in views])
        self.true_centres = np.array([view[4][1:4] for view in views])

        view_of = np.concatenate([np.full(len(view[3]), i) for i, view in enumerate(views)])
        names = np.concatenate([view[3][:, 2] for view in views]).astype(int)
        pixels = np.concatenate([view[3][:, :2] for view in views]) - 0.5
        known, index, count = np.unique(names, return_inverse=True, return_counts=True)
        chosen = np.flatnonzero(count >= arguments.min_views)
        if len(chosen) > arguments.points:
            chosen = np.random.default_rng(SEED).choice(chosen, arguments.points, replace=False)
        kept = np.isin(index, chosen)
        self.view_of, self.pixels = view_of[kept], pixels[kept]
        used, self.point_of = np.unique(index[kept], return_inverse=True)
        self.first = np.searchsorted(self.view_of, np.arange(len(views) + 1))

        turns, shifts = np.array([view[1] for view in views]), np.array([view[2] for view in views])
        centres = -np.einsum("nji,nj->ni", turns, shifts)
        scale, turn, shift = similarity(centres, self.true_centres)
        self.points = scale * np.array([points[known[i]] for i in used], float) @ turn.T + shift
        self.turns = turns @ turn.T
        self.centres = scale * centres @ turn.T + shift
        depths = np.einsum("ni,ni->n", self.turns[self.view_of][:, 2],
                           self.points[self.point_of] - self.centres[self.view_of])
        self.depth = np.median(depths)

    def of(self, view):
        return slice(self.first[view], self.first[view + 1])


class Adjustment:
    """Levenberg and Marquardt over cameras, points and the motion of the wall in each view; points are eliminated."""

    def __init__(self, views, nodes, strength, is_true):
        self.views = views
        self.points = views.points.copy()
        self.turns = (views.true_turns if is_true else views.turns).copy()
        centres = views.true_centres if is_true else views.centres
        self.shifts = -np.einsum("nij,nj->ni", self.turns, centres)
        self.basis = [self._basis(i, nodes, strength) for i in range(len(self.turns))]
        self.motion = np.zeros((len(self.turns), 3 * nodes))

    def _basis(self, view, nodes, strength):
        """How far each point follows each node, whitened: the prior of the motion is standard normal."""
        points = self.views.points[self.views.point_of[self.views.of(view)]]
        if nodes == 0 or len(points) == 0:
            return np.zeros((len(points), nodes))
        chosen, distance = [0], np.linalg.norm(points - points[0], axis=1)
        while len(chosen) < nodes:
            chosen.append(int(distance.argmax()))
            distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))

        def alike(a, b):
            return np.exp(-((a[:, None] - b[None]) ** 2).sum(-1) / (2.0 * self.views.depth**2))

        at = points[chosen]
        lower = np.linalg.cholesky(alike(at, at) + 1e-3 * np.eye(nodes))
        return strength * self.views.depth * np.linalg.solve(lower, alike(at, points)).T

    def _in_camera(self, view, state):
        turns, shifts, points, motion = state
        here = points[self.views.point_of[self.views.of(view)]] + self.basis[view] @ motion[view].reshape(-1, 3)
        return here @ turns[view].T + shifts[view]

    def errors_px2(self, state=None):
        state = state or self.state()
        project, pixels = self.views.camera.project, self.views.pixels
        return np.concatenate([((project(self._in_camera(i, state)) - pixels[self.views.of(i)]) ** 2).sum(1)
                               for i in range(len(self.turns))])

    def cost(self, state=None):
        state = state or self.state()
        errors = self.errors_px2(state)
        return (ROBUST_PX2 * errors / (ROBUST_PX2 + errors)).sum() + (state[3] ** 2).sum()

    def state(self):
        return self.turns, self.shifts, self.points, self.motion

    def ate(self):
        centres = -np.einsum("nji,nj->ni", self.turns, self.shifts)
        scale, turn, shift = similarity(centres, self.views.true_centres)
        return np.sqrt(((scale * centres @ turn.T + shift - self.views.true_centres) ** 2).sum(1).mean())

    def solve(self, iterations, is_held):
        damping, cost = 1e-3, self.cost()
        for _ in range(iterations):
            state = self._stepped(damping, is_held)
            new_cost = self.cost(state)
            if new_cost < cost:
                gain, cost = cost - new_cost, new_cost
                self.turns, self.shifts, self.points, self.motion = state
                damping = max(damping / 5.0, 1e-7)
                if gain < SMALL_GAIN * cost:
                    break
            else:
                damping *= 10.0
        return cost

    def _stepped(self, damping, is_held):
        views, num = self.views, len(self.turns)
        width = 6 + self.motion.shape[1]
        system, right = np.zeros((num * width, num * width)), np.zeros(num * width)
        of_points, right_points, mixed = np.zeros((len(self.points), 3, 3)), np.zeros((len(self.points), 3)), []
        for i in range(num):
            sights, own = views.of(i), slice(i * width, (i + 1) * width)
            here = self._in_camera(i, self.state())
            error = views.camera.project(here) - views.pixels[sights]
            by_here = views.camera.jacobian(here)
            weight = (here[:, 2] > FAR_ENOUGH * views.depth) / (1.0 + (error**2).sum(1) / ROBUST_PX2) ** 2
            by_point = by_here @ self.turns[i]
            by_motion = (by_point[:, :, None, :] * self.basis[i][:, None, :, None]).reshape(len(here), 2, -1)
            jacobian = np.concatenate([by_here, -by_here @ skew(here), by_motion], axis=2)
            weighted = jacobian * weight[:, None, None]
            flat = weighted.reshape(-1, width)
            system[own, own] += flat.T @ jacobian.reshape(-1, width)
            right[own] += flat.T @ error.reshape(-1)
            system[own, own][6:, 6:] += np.eye(width - 6)
            right[own][6:] += self.motion[i]
            if is_held or i == 0:
                system[own, own][:6, :6] += HELD * np.eye(6)
            np.add.at(of_points, views.point_of[sights], np.einsum("nij,nik,n->njk", by_point, by_point, weight))
            np.add.at(right_points, views.point_of[sights], np.einsum("nij,ni,n->nj", by_point, error, weight))
            mixed.append(np.einsum("nij,nik->njk", weighted, by_point))
        mixed = np.concatenate(mixed)
        diagonal = np.einsum("nii->ni", of_points)
        diagonal += damping * diagonal + 1e-9
        inverse = np.linalg.inv(of_points)
        system[np.diag_indices_from(system)] *= 1.0 + damping
        order = np.argsort(views.point_of, kind="stable")
        begin = np.searchsorted(views.point_of[order], np.arange(len(self.points) + 1))
        for j in range(len(self.points)):
            sights = order[begin[j]:begin[j + 1]]
            block = mixed[sights].reshape(-1, 3)
            index = (views.view_of[sights][:, None] * width + np.arange(width)).ravel()
            gained = block @ inverse[j]
            system[np.ix_(index, index)] -= gained @ block.T
            right[index] -= gained @ right_points[j]
        step = -np.linalg.solve(system, right).reshape(num, width)
        np.add.at(right_points, views.point_of, np.einsum("nij,ni->nj", mixed, step[views.view_of]))
        of_step = -np.einsum("nij,nj->ni", inverse, right_points)
        length = np.linalg.norm(of_step, axis=1, keepdims=True)
        points = self.points + of_step * np.minimum(1.0, views.depth / np.maximum(length, 1e-9))
        if is_held:
            return self.turns, self.shifts, points, self.motion + step[:, 6:]
        turns = np.array([turned(row[3:6]) for row in step])
        return (turns @ self.turns, np.einsum("nij,nj->ni", turns, self.shifts) + step[:, :3], points,
                self.motion + step[:, 6:])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("map", type=pathlib.Path)
    parser.add_argument("sequence", type=pathlib.Path)
    parser.add_argument("--every", type=int, default=1, help="use every n-th keyframe")
    parser.add_argument("--points", type=int, default=1500, help="at most so many")
    parser.add_argument("--min-views", type=int, default=4, help="of a point")
    parser.add_argument("--nodes", type=int, default=12)
    parser.add_argument("--strength", type=float, default=0.03, help="of the motion, share of the median depth")
    parser.add_argument("--iterations", type=int, default=15)
    arguments = parser.parse_args()
    views = Views(arguments)
    print(f"{len(views.turns)} keyframes, {len(views.points)} points, {len(views.pixels)} observations, "
          f"median depth {views.depth:.1f} mm\n")
    print("| wall | cameras | cost | median error px | RMS ATE mm |\n|---|---|---|---|---|")
    for wall, nodes in (("rigid", 0), (f"{arguments.nodes} nodes", arguments.nodes)):
        ways = [("free", False, False), ("free, from the truth", True, False), ("held at the truth", True, True)]
        for name, is_true, is_held in ways if nodes else (ways[0], ways[2]):
            adjustment = Adjustment(views, nodes, arguments.strength, is_true)
            cost = adjustment.solve(arguments.iterations, is_held)
            print(f"| {wall} | {name} | {cost:.0f} | {np.sqrt(np.median(adjustment.errors_px2())):.2f} | "
                  f"{adjustment.ate():.2f} |", flush=True)


if __name__ == "__main__":
    main()
