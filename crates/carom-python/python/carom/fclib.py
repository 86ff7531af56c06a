"""Contact problems in files of FCLIB, the exchange format of the frictional contact library (HDF5).

Needs ``pip install h5py``. A file holds a problem, with u = W r + q for the velocities u and impulses r of the contacts and Coulomb's law
between them, and may hold a solution and guesses. FCLIB orders the rows of a contact normal first, carom tangents first (t1, t2, n): both
directions are reordered here. FCLIB knows no restitution: it is in q, to whose normal rows Moreau's law adds e min(u_n⁻, 0).
"""

import os as _os
from typing import Any as _Any
from typing import NamedTuple as _NamedTuple

import h5py as _h5py
import numpy as _np
from numpy.typing import NDArray as _NDArray

from . import CaromError as _CaromError
from . import ContactProblem as _ContactProblem

__all__ = ["FclibError", "Solution", "guesses", "info", "read", "solution", "write"]

_Path = str | _os.PathLike[str]
_Floats = _NDArray[_np.float64]

# That of carom for a Delassus matrix, relative to the largest entry.
_SYMMETRY = 1e-8
_TEXTS = ("title", "description", "math_info")


class FclibError(_CaromError, ValueError):
    """A file that is not of FCLIB, that breaks a rule, or that has a part without a counterpart in carom; the message names file, group
    or dataset, value and rule."""


class Solution(_NamedTuple):
    """A solution or a guess of a file, in rows t1, t2, n of each contact, shapes (n,)."""

    impulse: _Floats
    """N s."""
    u_plus: _Floats
    """W r + q of the file, m/s."""


def read(path: _Path, *, symmetrize: bool = False) -> _ContactProblem:
    """The problem of a file.

    A local problem is read as it is. A global one, M v = H r + f and u = Hᵀ v + w, is reduced to W = Hᵀ M⁻¹ H and q = Hᵀ M⁻¹ f + w. With
    spacedim 2 the second tangent has zero rows.

    Args:
        path: of the file.
        symmetrize: replaces a matrix W or M that is not symmetric within 1e-8 of its largest entry by its symmetric part.

    Raises:
        FclibError: not a file of FCLIB; bilateral constraints (V, R or G); rolling friction; a matrix or a vector that breaks a rule.
        FileNotFoundError: no such file.
    """
    with _Reader(path) as file:
        group, size = file.problem()
        if group == "fclib_local":
            w, q = _local(file, symmetrize)
        else:
            w, q = _reduced(file, symmetrize)
        mu = file.floats(f"{group}/vectors/mu", len(q) // size, f"of a problem of {len(q)} rows with spacedim {size}")
        to_carom = _to_carom(len(mu), size)
        delassus = _np.zeros((3 * len(mu), 3 * len(mu)))
        delassus[_np.ix_(to_carom, to_carom)] = w
        try:
            return _ContactProblem(delassus, _embedded(q, size), friction=mu)
        except ValueError as error:
            raise FclibError(f"{file.path}: /{group}: in rows t1, t2, n: {error}") from error


def write(
    path: _Path,
    problem: _ContactProblem,
    *,
    title: str,
    description: str = "",
    math_info: str = "",
    solution: _Any = None,
) -> None:
    """Writes a problem as a local problem of FCLIB; replaces the file.

    Restitution goes into q: a problem that has some is read back as one without, with the same impulses.

    Args:
        path: of the file.
        problem: a `carom.ContactProblem` of contacts alone.
        title, description, math_info: texts about the problem, its origin and its known properties.
        solution: result of `carom.ContactProblem.solve` for Moreau's law, or a `Solution`, which is written beside the problem.

    Raises:
        FclibError: the problem has other constraints than contacts; a solution of another problem.
    """
    for k, kind in enumerate(problem.kinds):
        if kind != "contact":
            raise FclibError(f'{_os.fspath(path)}: constraint {k} is of the kind "{kind}": FCLIB has contacts alone')
    if solution is not None:
        for name in ("impulse", "u_plus"):
            found, needed = _np.shape(getattr(solution, name)), problem.u_free.shape
            if found != needed:
                raise FclibError(
                    f"{_os.fspath(path)}: solution.{name} has the shape {found}: {needed} is needed, a number for each row of the problem"
                )
    to_carom = _to_carom(len(problem.friction), 3)
    w = problem.delassus[_np.ix_(to_carom, to_carom)]
    rows, columns = _np.nonzero(w)
    normals = 2 + 3 * _np.arange(len(problem.friction))
    shift = _np.zeros(len(w))
    shift[normals] = problem.restitution * _np.minimum(problem.u_minus[normals], 0.0)
    q = problem.u_free + shift
    with _h5py.File(path, "w") as file:
        local = file.create_group("fclib_local")
        _put_int(local, "spacedim", 3)
        matrix = local.create_group("W")
        # Compressed rows.
        for name, value in (("nzmax", len(rows)), ("m", len(w)), ("n", len(w)), ("nz", -2)):
            _put_int(matrix, name, value)
        matrix["p"] = _np.searchsorted(rows, _np.arange(len(w) + 1)).astype(_np.int32)
        matrix["i"] = columns.astype(_np.int32)
        matrix["x"] = w[rows, columns]
        vectors = local.create_group("vectors")
        vectors["q"] = q[to_carom]
        vectors["mu"] = problem.friction
        texts = local.create_group("info")
        for name, text in zip(_TEXTS, (title, description, math_info)):
            # With the final zero, which readers in C need.
            bytes = text.encode() + b"\0"
            texts.create_dataset(name, data=_np.array(bytes, dtype=f"S{len(bytes)}"))
        if solution is not None:
            own = file.create_group("solution")
            own["u"] = (solution.u_plus + shift)[to_carom]
            own["r"] = solution.impulse[to_carom]


def solution(path: _Path) -> Solution | None:
    """The solution of a file, or None.

    Raises:
        FclibError: as of `read`.
    """
    with _Reader(path) as file:
        return _solution(file, "solution") if "solution" in file else None


def guesses(path: _Path) -> list[Solution]:
    """The guesses of a file: impulses and velocities to start a solver from.

    Raises:
        FclibError: as of `read`.
    """
    with _Reader(path) as file:
        count = file.int("guesses/number_of_guesses") if "guesses" in file else 0
        return [_solution(file, f"guesses/{k + 1}") for k in range(count)]


def info(path: _Path) -> dict[str, str]:
    """The texts of a file: title, description and math_info, as far as it has them.

    Raises:
        FclibError: as of `read`.
    """
    with _Reader(path) as file:
        group, _ = file.problem()
        return {name: file.text(f"{group}/info/{name}") for name in _TEXTS if f"{group}/info/{name}" in file}


class _Entries(_NamedTuple):
    """A sparse matrix by its entries; equal places add up."""

    shape: tuple[int, int]
    rows: _NDArray[_np.int64]
    columns: _NDArray[_np.int64]
    values: _Floats

    def dense(self):
        matrix = _np.zeros(self.shape)
        _np.add.at(matrix, (self.rows, self.columns), self.values)
        return matrix


class _Reader:
    """A file open for reading. Its functions name what they miss."""

    def __init__(self, path):
        self.path = _os.fspath(path)
        try:
            self._file = _h5py.File(path, "r")
        except FileNotFoundError:
            raise
        except OSError as error:
            with open(path, "rb") as file:
                pointer = file.read(23) == b"version https://git-lfs"
            rule = "it is a pointer of Git LFS: `git lfs pull` gets the file" if pointer else f"not a file of HDF5: {error}"
            raise FclibError(f"{self.path}: {rule}") from error

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._file.close()

    def __contains__(self, name):
        return name in self._file

    def refuse(self, name, rule):
        return FclibError(f"{self.path}: /{name}{rule}")

    def problem(self):
        """The group of the problem, and the number of rows of a contact."""
        if "fclib_global_rolling" in self or "fclib_rolling" in self:
            raise self.refuse("", "fclib_global_rolling: carom has no rolling friction")
        group = next((it for it in ("fclib_local", "fclib_global") if it in self), None)
        if group is None:
            raise self.refuse("", f" has {', '.join(self._file) or 'nothing'}: a problem is in the group fclib_local or fclib_global")
        size = self.int(f"{group}/spacedim")
        if size not in (2, 3):
            raise self.refuse(f"{group}/spacedim", f" = {size}: must be 2 or 3")
        for name in ("V", "R", "G"):
            if f"{group}/{name}" in self:
                raise self.refuse(f"{group}/{name}", ": bilateral constraints have no counterpart in carom.ContactProblem")
        return group, size

    def dataset(self, name, kind):
        found = self._file.get(name)
        if found is None:
            raise self.refuse(name, " is missing")
        if not isinstance(found, _h5py.Dataset) or found.dtype.kind not in kind:
            raise self.refuse(name, ": must be a dataset of " + {"iu": "whole numbers", "fiu": "numbers", "SO": "text"}[kind])
        return found[()]

    def int(self, name):
        found = _np.atleast_1d(self.dataset(name, "iu"))
        if found.shape != (1,):
            raise self.refuse(name, f": shape {found.shape}, must be one number")
        return int(found[0])

    def ints(self, name):
        return _np.atleast_1d(self.dataset(name, "iu")).astype(_np.int64)

    def floats(self, name, size, of):
        found = _np.atleast_1d(self.dataset(name, "fiu")).astype(float)
        if found.shape != (size,):
            raise self.refuse(name, f": shape {found.shape}, must be ({size},) {of}")
        self.check(name, found, _np.isfinite(found), "must be finite")
        return found

    def check(self, name, found, good, rule):
        if not good.all():
            k = int(_np.argmin(good))
            raise self.refuse(name, f"[{k}] = {found[k]}: {rule}")

    def text(self, name):
        found = self.dataset(name, "SO")
        return (found if isinstance(found, bytes) else str(found).encode()).split(b"\0")[0].decode(errors="replace")

    def entries(self, name):
        """A matrix: triplets, compressed columns or compressed rows."""
        rows, columns, nz = (self.int(f"{name}/{it}") for it in ("m", "n", "nz"))
        if nz < -2 or rows < 0 or columns < 0:
            raise self.refuse(name, f": m = {rows}, n = {columns}, nz = {nz}: sizes are 0 or more; nz is -1, -2 or the number of triplets")
        p, i = self.ints(f"{name}/p"), self.ints(f"{name}/i")
        # As in CSparse, i is the row of a triplet and p its column. The comment in fclib.h has it the other way round, its files do not.
        major, minor = (columns, rows) if nz != -2 else (rows, columns)
        if nz >= 0:
            count, outer = nz, p[:nz]
            if len(p) < nz:
                raise self.refuse(f"{name}/p", f": shape ({len(p)},), must have nz = {nz} numbers")
            self.check(f"{name}/p", outer, (outer >= 0) & (outer < major), f"must be 0 to {major - 1}")
        else:
            if len(p) != major + 1 or p[0] != 0:
                raise self.refuse(f"{name}/p", f": {len(p)} numbers from {p[:1]}, must be {major + 1} from 0")
            self.check(f"{name}/p", p[1:], p[1:] >= p[:-1], "must not decrease")
            count, outer = int(p[-1]), _np.repeat(_np.arange(major), _np.diff(p))
        inner = i[:count]
        self.check(f"{name}/i", inner, (inner >= 0) & (inner < minor), f"must be 0 to {minor - 1}")
        # nzmax may be larger than the number of entries.
        x = _np.atleast_1d(self.dataset(f"{name}/x", "fiu")).astype(float)[:count]
        if min(len(inner), len(x)) < count:
            raise self.refuse(name, f": i and x have {len(i)} and {len(x)} numbers, must have {count}")
        self.check(f"{name}/x", x, _np.isfinite(x), "must be finite")
        return _Entries((rows, columns), *((outer, inner) if nz == -2 else (inner, outer)), x)

    def square(self, name):
        entries = self.entries(name)
        if entries.shape[0] != entries.shape[1]:
            raise self.refuse(name, f": {entries.shape[0]} by {entries.shape[1]}, must be square")
        return entries

    def symmetric(self, name, matrix, largest, symmetrize, of=None):
        """The symmetric part, if it differs from the matrix by rounding or is asked for; `of` are the numbers of the rows in the file."""
        excess = _np.abs(matrix - matrix.T)
        if excess.max(initial=0.0) > _SYMMETRY * largest and not symmetrize:
            i, j = _np.unravel_index(_np.argmax(excess), excess.shape)
            a, b = (i, j) if of is None else (of[i], of[j])
            rule = f"must be symmetric within {_SYMMETRY * largest:.3g} (1e-8 of its largest entry); "
            rule += "symmetrize=True takes the symmetric part"
            raise self.refuse(name, f": {name[-1]}[{a},{b}] = {matrix[i, j]} but {name[-1]}[{b},{a}] = {matrix[j, i]}: {rule}")
        return matrix + 0.5 * (matrix.T - matrix)


def _local(file, symmetrize):
    name, size = "fclib_local/W", file.int("fclib_local/spacedim")
    entries = file.square(name)
    rows = entries.shape[0]
    if rows % size:
        raise file.refuse(f"{name}/m", f" = {rows}: must be a multiple of spacedim = {size}")
    q = file.floats("fclib_local/vectors/q", rows, f"for W of {rows} rows")
    w = entries.dense()
    return file.symmetric(name, w, _np.abs(w).max(initial=0.0), symmetrize), q


def _reduced(file, symmetrize):
    """W and q of a global problem. M is factored by the bodies that it does not couple: most have a few rows."""
    size = file.int("fclib_global/spacedim")
    mass, h = file.square("fclib_global/M"), file.entries("fclib_global/H")
    if h.shape[0] != mass.shape[0] or h.shape[1] % size:
        rule = f"must have {mass.shape[0]} rows as M, and columns that are a multiple of spacedim = {size}"
        raise file.refuse("fclib_global/H", f": {h.shape[0]} by {h.shape[1]}, {rule}")
    f = file.floats("fclib_global/vectors/f", mass.shape[0], f"for M of {mass.shape[0]} rows")
    q = file.floats("fclib_global/vectors/w", h.shape[1], f"for H of {h.shape[1]} columns")
    w = _np.zeros((h.shape[1], h.shape[1]))
    largest = _np.abs(mass.values).max(initial=0.0)
    for body, own_mass, own_h in _bodies(mass, h):
        columns = _np.unique(own_h.columns)
        local = lambda of, among: _np.searchsorted(among, of)  # noqa: E731
        m = _Entries((len(body),) * 2, local(own_mass.rows, body), local(own_mass.columns, body), own_mass.values).dense()
        m = file.symmetric("fclib_global/M", m, largest, symmetrize, body)
        right = _Entries((len(body), len(columns)), local(own_h.rows, body), local(own_h.columns, columns), own_h.values).dense()
        try:
            factor = _np.linalg.cholesky(m)
        except _np.linalg.LinAlgError as error:
            raise file.refuse("fclib_global/M", f": rows {body[0]} to {body[-1]} are not positive definite") from error
        # With M = L Lᵀ both products are those of L⁻¹ H, and W is symmetric without rounding.
        half = _np.linalg.solve(factor, _np.column_stack([right, f[body]]))
        w[_np.ix_(columns, columns)] += half[:, :-1].T @ half[:, :-1]
        q[columns] += half[:, :-1].T @ half[:, -1]
    return w, q


def _bodies(mass, h):
    """The rows that M couples to one another, with the entries of M and H in them; those without entries of H are left out."""
    label = _np.arange(mass.shape[0])
    while True:
        least = label.copy()
        _np.minimum.at(least, mass.rows, label[mass.columns])
        _np.minimum.at(least, mass.columns, label[mass.rows])
        least = least[least]
        if (least == label).all():
            break
        label = least
    order = _np.argsort(label, kind="stable")
    by_mass, by_h = (_by_label(it, label) for it in (mass, h))
    for own in _np.unique(label[h.rows]):
        first, last = _np.searchsorted(label[order], [own, own + 1])
        yield order[first:last], by_mass(own), by_h(own)


def _by_label(entries, label):
    of = label[entries.rows]
    order = _np.argsort(of, kind="stable")
    of = of[order]

    def part(own):
        some = order[slice(*_np.searchsorted(of, [own, own + 1]))]
        return _Entries(entries.shape, entries.rows[some], entries.columns[some], entries.values[some])

    return part


def _solution(file, name):
    group, size = file.problem()
    rows = file.int("fclib_local/W/n" if group == "fclib_local" else "fclib_global/H/n")
    of = f"for a problem of {rows} rows"
    return Solution(*(_embedded(file.floats(f"{name}/{it}", rows, of), size) for it in ("r", "u")))


def _embedded(vector, size):
    """A vector of FCLIB in rows t1, t2, n."""
    contacts = len(vector) // size
    found = _np.zeros(3 * contacts)
    found[_to_carom(contacts, size)] = vector
    return found


def _to_carom(contacts, size):
    """The row of carom for each row of FCLIB: n, t1, t2, in the plane n, t1."""
    return (3 * _np.arange(contacts)[:, None] + _np.array([2, 0, 1][:size])).reshape(-1)


def _put_int(group, name, value):
    group.create_dataset(name, data=_np.array([value], dtype=_np.int32))
