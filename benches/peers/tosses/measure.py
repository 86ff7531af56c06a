"""The pose error of a toss, as carom computes it (`RollOut::pose_error`), and statistics of paired errors."""

import math

import numpy as np

EARLY, WHOLE = "to 0.1 s after the first impact", "whole toss"
FITTED, GIVEN = "start fitted to the flight", "start given by the table"
# The parts of a comparison in the order of `carom compare`, with the keys of `carom compare --export`.
PARTS = [(f"{part}, {start}", key, part == EARLY)
         for start, key in ((FITTED, "fitted_start"), (GIVEN, "given_start")) for part in (EARLY, WHOLE)]


def squares(rolled, measured):
    """Squares of the differences of each sample: |Δp|² (m²), Δθ² (rad²), the largest of the joints (rad²)."""
    a, b = np.asarray(rolled, float), np.asarray(measured, float)
    place = np.sum((a[:, :3] - b[:, :3]) ** 2, axis=1)
    unit = lambda q: q / np.linalg.norm(q, axis=1, keepdims=True)
    p, q = unit(a[:, 3:7]), unit(b[:, 3:7])
    # q p* has the angle of the rotation between them: the vector part by the sine, the scalar part by the cosine.
    imaginary = p[:, 3:] * q[:, :3] - q[:, 3:] * p[:, :3] - np.cross(q[:, :3], p[:, :3])
    turn = 2.0 * np.arctan2(np.linalg.norm(imaginary, axis=1), np.abs(np.sum(p * q, axis=1)))
    wrapped = np.abs(np.mod(a[:, 7:] - b[:, 7:] + math.pi, 2.0 * math.pi) - math.pi)
    joint = wrapped.max(axis=1) if wrapped.shape[1] else np.zeros(len(a))
    return np.column_stack([place, turn**2, joint**2])


def pose_error(rolled, measured, length):
    """Mean |Δp|²/L + mean Δθ² + mean of the squared joint difference; infinite if the roll-out is not finite."""
    if not np.all(np.isfinite(rolled)):
        return math.inf
    place, turn, joint = squares(rolled, measured).mean(axis=0)
    return float(place / length + turn + joint)


def without_refused(errors):
    """Refused roll-outs count with the greatest error of the others, as in carom."""
    errors = np.asarray(errors, float)
    finite = np.isfinite(errors)
    return np.where(finite, errors, errors[finite].max(initial=0.0)), int(np.sum(~finite))


def estimate(values):
    """Mean and its standard error."""
    values = np.asarray(values, float)
    return float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values)))
