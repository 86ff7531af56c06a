"""Closed forms that judge.py compares with. check.py compares those of the derivatives with differences of another program, certify.py
those of the motions with an integration."""

import math

import numpy as np

MEANS = 8  # the mean converges quadratically: enough for m up to 1 − 1e-12


def jacobi(u, m):
    """Jacobi's sn, cn, dn of `u` for the parameter m = k² < 1, by the arithmetic–geometric mean (Abramowitz & Stegun 16.4)."""
    a, b, shares = 1.0, math.sqrt(1 - m), []
    for _ in range(MEANS):
        a, b, c = (a + b) / 2, math.sqrt(a * b), (a - b) / 2
        shares.append(c / a)
    angle = 2**MEANS * a * u
    for share in reversed(shares):
        angle = (angle + math.asin(share * math.sin(angle))) / 2
    sn, cn = math.sin(angle), math.cos(angle)
    return sn, cn, math.sqrt(1 - m * sn * sn)


def quarter(m):
    """The quarter period K of Jacobi's functions."""
    a, b = 1.0, math.sqrt(1 - m)
    for _ in range(MEANS):
        a, b = (a + b) / 2, math.sqrt(a * b)
    return math.pi / (2 * a)


def near(late, value, rate, second):
    """Numbers that are known at one time with two derivatives, `late` seconds after it: an engine's step need not divide that time."""
    return np.array(value) + late * np.array(rate) + late**2 / 2 * np.array(second)


def planar_impact(slip, approach, tt, tn, nn, mu, e, law):
    """Tangential and normal impulse of a planar impact by Routh's method. `tt`, `tn`, `nn`: velocity of the contact point by impulse.

    Friction has the ratio `first` to the normal impulse until the slip ends, then `second`; `a` and `b` are the changes of the normal
    velocity by the normal impulse. Laws: `newton` (velocities), `poisson` (impulses), `energetic` (works of the normal force).
    """
    first = -mu if slip > 0 else mu
    rate = tn + first * tt
    end = -slip / rate if slip * rate < 0 else math.inf
    hold = -tn / tt
    second = hold if abs(hold) <= mu else -mu if tn > 0 else mu
    a, b = nn + first * tn, nn + second * tn
    turned = approach + a * end  # the normal velocity at the end of the slip
    most = -approach / a if -approach / a <= end else end - turned / b
    if law == "newton":
        p = -(1 + e) * approach / a
        p = p if p <= end else end + (-e * approach - turned) / b
    elif law == "poisson":
        p = (1 + e) * most
    else:
        work = approach * most / 2 if most <= end else (approach + turned) * end / 2 - turned**2 / (2 * b)
        p = most + e * (-2 * work / (a if most < end else b)) ** 0.5
        if most < end < p:
            left = -(e**2) * work - turned**2 / (2 * a)  # of the work that is returned, after the end of the slip
            p = end + ((turned**2 + 2 * b * left) ** 0.5 - turned) / b
    return first * min(p, end) + second * max(p - end, 0), p


def steered(pieces, force=(0.0, 3.0), radius=0.2):
    """Cost and its derivatives, of a ball that a force of constant pieces drives against an equal one (case ad-steer): mass 1, 1 s.

    Before the strike the path is linear in the forces: in the piece [a, b] a unit of force moves the ball by ((t−a)² − (t−b)²)/2 up to t > b.
    At the strike, n is the direction of the centres, the struck ball takes over the normal component of the velocity. A change
    of the path by δ moves the time of the strike by −n·δ/(n·v); after it the struck ball has no force.
    """
    force, start, other = (np.array(it, float) for it in (force, (-1, -2), (-1, -1)))
    ends = np.arange(pieces + 1) / pieces
    after = lambda t: np.maximum(t - ends, 0.0)
    moved = lambda t: (after(t)[:-1] ** 2 - after(t)[1:] ** 2) / 2  # position by each piece
    speeds = lambda t: after(t)[:-1] - after(t)[1:]  # velocity by each piece
    # Constant force: a parabola along u. The strike is where |other − start − u t²/2| = 2 r.
    line, size = other - start, force @ force
    t = np.sqrt(2 * (line @ force - np.sqrt((line @ force) ** 2 - size * (line @ line - 4 * radius**2))) / size)
    n = (line - force * t * t / 2) / (2 * radius)
    velocity, left = force * t, 1 - t
    normal = n @ velocity
    last = other + left * normal * n
    found = np.zeros((pieces, 2))
    for k in range(2):
        unit = np.eye(2)[k]
        place, rate = np.outer(moved(t), unit), np.outer(speeds(t), unit)
        later = -(place @ n) / normal
        turn = -(place + np.outer(later, velocity)) / (2 * radius)
        change = rate + np.outer(later, force)
        by_normal = turn @ velocity + change @ n
        by_last = -np.outer(later, normal * n) + left * (np.outer(by_normal, n) + normal * turn)
        found[:, k] = 2 * by_last @ last + 0.02 * force[k] / pieces
    return float(last @ last + 0.01 * size), np.ravel(found)
