"""Checks of the measure and of the search by closed forms."""

import math

import numpy as np

from measure import estimate, pose_error, without_refused


def turned(axis, angle):
    return [*(math.sin(angle / 2) * np.array(axis)), math.cos(angle / 2)]


def close(a, b, tolerance=1e-14):
    assert abs(a - b) <= tolerance, (a, b)


# A shift of 3 mm and a turn of 0.2 rad about any axis, by a quaternion of either sign and any length, relative to a turned pose.
axis, other = np.array([2.0, -1.0, 2.0]) / 3.0, np.array([0.6, 0.0, 0.8])
for sign in (1.0, -2.0):
    poses = [[0.1, 0.2, 0.3, *turned(axis, 1.1)]]
    shifted = [[0.103, 0.2, 0.3, *(sign * np.array(turned(axis, 1.3)))]]
    close(pose_error(poses, shifted, 0.0524), 0.003**2 / 0.0524 + 0.2**2)
    close(pose_error(shifted, poses, 0.0524), 0.003**2 / 0.0524 + 0.2**2)
# Turns about different axes from the same pose: cos of half the angle is the product of the quaternions.
between = 2.0 * math.acos(abs(np.dot(turned(axis, 0.7), turned(other, 0.9))))
close(pose_error([[0, 0, 0, *turned(axis, 0.7)]], [[0, 0, 0, *turned(other, 0.9)]], 1.0), between**2)
# Joint angles are compared modulo a full turn; the mean is over the samples.
rest = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
close(pose_error([[*rest, 3.1], [*rest, 0.0]], [[*rest, -3.1], [*rest, 0.0]], 1.0), 0.5 * (2.0 * math.pi - 6.2) ** 2)
assert pose_error([[*rest, math.nan]], [[*rest, 0.0]], 1.0) == math.inf

# Differences 1, 2, 3: mean 2, standard error 1/sqrt(3), as in carom's own test.
mean, error = estimate(np.array([11.0, 22.0, 33.0]) - np.array([10.0, 20.0, 30.0]))
close(mean, 2.0)
close(error, 1.0 / math.sqrt(3.0))
values, refused = without_refused([1.0, math.inf, 3.0])
assert refused == 1 and list(values) == [1.0, 3.0, 3.0]

# The search: a fold's parameters are fitted to the tosses outside it, within the budget.
from tune import search

targets, fold_of = np.array([0.3, 0.3, 0.7, 0.7]), np.array([0, 0, 1, 1])
tried = []


def errors_of(x):
    tried.append(x)
    return (targets - x[0]) ** 2 + (x[1] - 0.45) ** 2


found, trials = search([("a", 0.0, 1.0, [0.1, 0.5]), ("b", 0.0, 1.0, [0.0, 0.5])], errors_of, 2, fold_of, 200)
assert trials == len(tried) == len(set(tried)) <= 200
for point, truth in zip(found, [(0.7, 0.45), (0.3, 0.45)]):
    assert max(abs(a - b) for a, b in zip(point, truth)) < 0.01, (found, trials)
found, trials = search([("a", 0.0, 1.0, [0.1, 0.5])], lambda x: (targets - x[0]) ** 2, 2, fold_of, 7)
assert trials == 7
print("the measure, the statistics and the search agree with closed forms")
