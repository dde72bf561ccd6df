"""Poses, for the scripts beside this one. Needs numpy."""

import numpy as np


def rotation(w, x, y, z):
    """The matrix of a unit quaternion."""
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def similarity(a, b):
    """Scale, rotation and translation that take a to b, N x 3 each (Umeyama 1991)."""
    mean_a, mean_b = a.mean(0), b.mean(0)
    u, s, v = np.linalg.svd((b - mean_b).T @ (a - mean_a) / len(a))
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
    turn = u @ sign @ v
    scale = np.trace(np.diag(s) @ sign) / ((a - mean_a) ** 2).sum() * len(a)
    return scale, turn, mean_b - scale * turn @ mean_a
