"""Impacts of kinematic chains: impact laws, event-driven simulation, impact maps and fits on NumPy arrays.

Start with ``Chain.from_urdf`` and ``Chain.impact``. Units are SI and radians; the contact normal points from the environment to
the robot; q and qd list the joints in the order of the URDF, a floating base first. Every computation is done by the Rust crates
of carom.
"""

import enum as _enum
import importlib.metadata as _metadata
import os as _os
import pathlib as _pathlib
import tempfile as _tempfile

from . import _carom
from ._carom import (
    Brach,
    Chain,
    ChatterjeeRuina,
    Energetic,
    Event,
    Fit,
    Frictionless,
    Impact,
    Impacts,
    Law,
    Newton,
    Outcome,
    Poisson,
    PythonLaw,
    Run,
    Scene,
    Sensitivity,
    Session,
    SessionState,
    SeveralImpact,
    Smith,
    Study,
    Table,
    Whittaker,
    can_record,
    diagram,
    law,
    map,
)
from ._errors import (
    CaromError,
    ChainError,
    FitError,
    ImpactError,
    RecordError,
    SimulationError,
    StateError,
    StudyError,
    UrdfError,
)
from ._notebook import Diagram
from ._results import Energies

__version__ = _metadata.version("carom")


class Flags(_enum.IntFlag):
    """The bits of ``Impacts.flag_bits``."""

    ENERGY_GAIN = 1
    JAM = 2
    SINGULAR = 4
    GRAZING = 8
    NON_UNIQUE = 16
    NO_APPROACH = 32


def fit(
    *,
    delassus=None,
    u_minus=None,
    u_plus=None,
    chain=None,
    q=None,
    qd_minus=None,
    qd_plus=None,
    frame=None,
    point=None,
    normal=None,
    tosses=None,
    robot=None,
    tolerance=1e-6,
    contact_step=1e-3,
    length=0.0524,
    start="fitted",
    horizon="whole",
    law="energetic",
    loss="huber",
    inertia=False,
    max_friction=1.0,
    train=1.0,
    seed=0,
    confidence=0.95,
):
    """Fits restitution and friction to measured impacts. One of three kinds of data is given:

    - velocities at the contact: ``delassus`` (N, D, D), 1/kg, ``u_minus`` and ``u_plus`` (N, D), m/s, in contact axes, tangents
      first, normal last; D is 2 or 3;
    - velocities of the joints of a ``chain``: ``q`` (N, nq), ``qd_minus`` and ``qd_plus`` (N, nv), with ``frame``, ``point`` and
      ``normal`` of the contact as in ``Chain.impact``;
    - tosses: ``tosses``, a folder with tosses.csv and a URDF (``robot`` names it if there are several), with the
      ``tolerance`` and ``contact_step`` (s) of the simulations and the ``length`` (m) of the pose error. The ``start`` is
      "fitted" to the flight before the first impact, or "given" by the first free sample; the ``horizon`` of the fitted error is
      the "whole" toss or "early", to 0.1 s after the first impact.

    Args:
        law: name of the law.
        loss: "huber" or "squares".
        inertia: fits the scale of rotational inertia too; needs a robot.
        max_friction: largest friction of the search.
        train: share of the measurements that is fitted; the rest, if any, is the test.
        seed: of the split into both, and of the bootstrap.
        confidence: level of the intervals.

    Returns:
        A Fit.

    Raises:
        FitError: too few measurements, an option out of its range, a contact that does not approach.
        TypeError: data of no or of several kinds.
    """
    options = {
        "law": law,
        "loss": loss,
        "inertia": inertia,
        "max_friction": max_friction,
        "train": train,
        "seed": seed,
        "confidence": confidence,
    }
    kinds = {
        "contact": {"delassus": delassus, "u_minus": u_minus, "u_plus": u_plus},
        "joints": {
            "chain": chain,
            "q": q,
            "qd_minus": qd_minus,
            "qd_plus": qd_plus,
            "frame": frame,
            "normal": normal,
        },
        "tosses": {"tosses": tosses},
    }
    given = [kind for kind, data in kinds.items() if any(value is not None for value in data.values())]
    if len(given) != 1:
        found = " and ".join(given) or "nothing"
        raise TypeError(f"{found} is given: give velocities at the contact, velocities of joints, or tosses")
    missing = [name for name, value in kinds[given[0]].items() if value is None]
    if missing:
        raise TypeError(f"{', '.join(missing)} is missing beside {', '.join(k for k in kinds[given[0]] if k not in missing)}")
    if given[0] == "contact":
        return _carom.fit_contacts(delassus, u_minus, u_plus, options)
    if given[0] == "joints":
        return _carom.fit_joints(chain, q, qd_minus, qd_plus, frame, point, normal, options)
    return _carom.fit_tosses(tosses, robot, tolerance, contact_step, length, start, horizon, options)


def record(run, to):
    """Records a run for the Rerun viewer: in a file, or in a recording stream of the package rerun-sdk.

    A stream gets the entities and timelines of the file and keeps its own application, recording and layout, so that a program
    logs its own data beside them.

    Args:
        run: a Run.
        to: the file, X.rrd, which is complete or not there; or a stream, such as ``rerun.RecordingStream("strike")`` or
            ``rerun.get_global_data_recording()``, of rerun-sdk 0.36.3.

    Raises:
        RecordError: the file cannot be written, or this package is built without recordings (``can_record()``).
        TypeError: `to` is neither a path nor a stream.
    """
    if not hasattr(to, "send_chunks"):
        try:
            path = _os.fspath(to)
        except TypeError:
            found = type(to).__qualname__
            raise TypeError(f"to is {found}: give the path of a file or a RecordingStream of rerun-sdk 0.36.3") from None
        return _carom.record(run, path)
    with _tempfile.TemporaryDirectory() as folder:
        path = _pathlib.Path(folder, "run.rrd")
        _carom.record(run, path)
        from rerun.experimental import RrdReader

        to.send_chunks(RrdReader(path).stream())


# Without `map`: `from carom import *` keeps Python's own.
__all__ = [
    "Brach",
    "CaromError",
    "Chain",
    "ChainError",
    "ChatterjeeRuina",
    "Diagram",
    "Energetic",
    "Energies",
    "Event",
    "Fit",
    "FitError",
    "Flags",
    "Frictionless",
    "Impact",
    "ImpactError",
    "Impacts",
    "Law",
    "Newton",
    "Outcome",
    "Poisson",
    "PythonLaw",
    "RecordError",
    "Run",
    "Scene",
    "Sensitivity",
    "Session",
    "SessionState",
    "SeveralImpact",
    "SimulationError",
    "Smith",
    "StateError",
    "Study",
    "StudyError",
    "Table",
    "UrdfError",
    "Whittaker",
    "can_record",
    "diagram",
    "fit",
    "law",
    "record",
]
