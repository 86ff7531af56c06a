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
    ContactProblem,
    ContactSolution,
    Energetic,
    Event,
    Fit,
    Frictionless,
    Impact,
    Impacts,
    Law,
    LinearRun,
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
    aim,
    basin,
    can_record,
    chart,
    cycles,
    diagram,
    law,
    map,
    orbit,
    tosses,
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


def _measured(data):
    """The kind of the measurements among the arguments of a function, and its arguments."""
    kinds = {
        "contact": ("delassus", "u_minus", "u_plus"),
        "joints": ("chain", "q", "qd_minus", "qd_plus", "frame", "normal"),
        "tosses": ("tosses",),
        "data": ("data",),
    }
    given = [kind for kind, names in kinds.items() if any(data.get(name) is not None for name in names)]
    if len(given) != 1:
        found = " and ".join(given) or "nothing"
        others = ", or tosses" if "tosses" in data else ", or data"
        raise TypeError(f"{found} is given: give velocities at the contact, velocities of joints{others}")
    names = kinds[given[0]]
    missing = [name for name in names if data[name] is None]
    if missing:
        raise TypeError(f"{', '.join(missing)} is missing beside {', '.join(name for name in names if name not in missing)}")
    return given[0], {name: data[name] for name in names} | ({"point": data["point"]} if given[0] == "joints" else {})


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
    given = locals()  # the arguments by name
    options = {name: given[name] for name in ("law", "loss", "inertia", "max_friction", "train", "seed", "confidence")}
    kind, data = _measured(given)
    if kind != "tosses":
        of_tosses = ("robot", "tolerance", "contact_step", "length", "start", "horizon")
        idle = [name for name in of_tosses if given[name] != fit.__kwdefaults__[name]]
        if idle:
            raise TypeError(f"{', '.join(idle)} is given, and belongs to tosses: leave it out")
        return _carom.fit_impacts(data, options)
    return _carom.fit_tosses(tosses, robot, tolerance, contact_step, length, start, horizon, options)


def compare(
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
    data=None,
    name="impacts",
    folds=5,
    seed=0,
    max_friction=1.0,
    trials=60,
    fitted=60,
    horizon="early",
    judge="whole",
    tolerance=1e-5,
    contact_step=1e-3,
    length=0.0524,
):
    """Compares all impact laws on measured impacts: each law is fitted to the measurements outside a fold, and judged by those in it.

    The measurements are those of ``fit``: velocities at the contact, or velocities of the joints of a chain; or published ones.

    Args:
        data: path of published measurements, or a list of paths, as for ``carom compare``.
        name: of one's own measurements in the result.
        folds: number of folds, 2 or more.
        seed: of the folds, of the tosses that are fitted, and of the perturbed starts.
        max_friction: largest friction of the search.
        trials, fitted: sets of parameters that each model may try, and tosses to which it is fitted; of tosses and landings.
        horizon, judge: part of the tosses whose error is fitted, and that is judged: "whole", or "early", to 0.1 s after the impact.
        tolerance, contact_step, length: of the simulations of tosses and landings, and of the pose error (m).

    Returns:
        A dict of seed, folds, comparisons (a list of dicts with the JSON keys of ``carom compare --help``), markdown (the tables as a
        text) and svg (pictures by set).

    Raises:
        FitError: too few measurements, an option out of its range, data that cannot be read.
        TypeError: data of no or of several kinds.
    """
    given = locals()  # the arguments by name
    kind, measured = _measured(given)
    paths = [] if kind != "data" else [data] if isinstance(data, (str, _os.PathLike)) else list(data)
    own = ("folds", "seed", "max_friction", "trials", "fitted", "horizon", "judge", "tolerance", "contact_step", "length")
    options = {option: given[option] for option in own}
    return _carom.compare(name, {} if paths else measured, paths, options)


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
__all__ = sorted(name for name in globals() if not name.startswith("_") and name != "map")
