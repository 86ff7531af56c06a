"""carom.fclib: problems are written and read without a change, and files in FCLIB's own layout are read in carom's order of rows."""

import subprocess
import sys

import numpy as np
import pytest

import carom

h5py = pytest.importorskip("h5py")
fclib = pytest.importorskip("carom.fclib")

# Rows of FCLIB (n, t1, t2) of the rows of carom (t1, t2, n).
ORDER = np.array([1, 2, 0])


def problem(rng, contacts, freedoms, **more):
    """Contacts of a body with a unit mass matrix; redundant if it has fewer degrees of freedom than rows."""
    jacobian = rng.normal(size=(3 * contacts, freedoms)) * (rng.random((3 * contacts, freedoms)) < 0.7)
    return carom.ContactProblem(jacobian @ jacobian.T, jacobian @ rng.normal(size=freedoms), friction=rng.random(contacts), **more)


def put(file, group, nz, p, i, x, shape, nzmax=None):
    """A matrix in FCLIB's layout: every number is a dataset of shape (1,)."""
    matrix = file.create_group(group)
    for name, value in (("nzmax", nzmax or len(x)), ("m", shape[0]), ("n", shape[1]), ("nz", nz)):
        matrix[name] = np.array([value], dtype=np.int32)
    # Entries after the last one may be anything.
    spare = [0] * ((nzmax or len(x)) - len(x))
    matrix["p"], matrix["i"] = np.array(p, dtype=np.int32), np.array([*i, *spare], dtype=np.int32)
    matrix["x"] = np.array([*x, *spare], dtype=float)


# [[2, 1, 0], [1, 5, 0], [0, 0, 3]] in rows n, t1, t2.
STORED = {
    # i are the rows, p the columns; an entry in two parts.
    "triplets": (6, [0, 1, 0, 1, 2, 1], [0, 0, 1, 1, 2, 1], [2.0, 1.0, 1.0, 4.0, 3.0, 1.0]),
    "compressed columns": (-1, [0, 2, 4, 5], [0, 1, 0, 1, 2], [2.0, 1.0, 1.0, 5.0, 3.0]),
    "compressed rows": (-2, [0, 2, 4, 5], [1, 0, 0, 1, 2], [1.0, 2.0, 1.0, 5.0, 3.0]),
}


def by_hand(path, stored="compressed rows", spacedim=3):
    with h5py.File(path, "w") as file:
        file["fclib_local/spacedim"] = np.array([spacedim], dtype=np.int32)
        put(file, "fclib_local/W", *STORED[stored], (3, 3), 9 if stored != "triplets" else None)
        file["fclib_local/vectors/q"] = [-1.0, 0.25, 0.5]
        file["fclib_local/vectors/mu"] = [0.5]
    return path


def global_by_hand(path):
    """Two bodies of two coordinates, M couples 0 with 2 and 1 with 3; one contact between them, the columns of H are n, t1, t2."""
    mass = np.array([[2.0, 0, 1, 0], [0, 3, 0, 0.5], [1, 0, 4, 0], [0, 0.5, 0, 5]])
    h = np.array([[1.0, 0, 0], [0, 2, 1], [-1, 0, 0], [0, 0, 3]])
    with h5py.File(path, "w") as file:
        file["fclib_global/spacedim"] = np.array([3], dtype=np.int32)
        for name, matrix in (("M", mass), ("H", h)):
            i, p = np.nonzero(matrix)
            put(file, f"fclib_global/{name}", len(i), p, i, matrix[i, p], matrix.shape)
        file["fclib_global/vectors/f"], file["fclib_global/vectors/w"] = [1.0, 2, 3, 4], [0.1, 0.2, 0.3]
        file["fclib_global/vectors/mu"] = [0.7]
    return mass, h


@pytest.mark.parametrize(("contacts", "freedoms"), [(1, 3), (2, 6), (4, 6), (17, 30)])
def test_a_problem_is_written_and_read_without_a_change(rng, tmp_path, contacts, freedoms):
    given, path = problem(rng, contacts, freedoms), tmp_path / "problem.hdf5"
    known = fclib.Solution(rng.normal(size=3 * contacts), rng.normal(size=3 * contacts))
    texts = {"title": "Stapel", "description": "Würfel\nauf dem Boden", "math_info": ""}
    fclib.write(path, given, **texts, solution=known)
    found, kept = fclib.read(path), fclib.solution(path)
    for name in ("delassus", "u_free", "friction", "restitution"):
        assert np.array_equal(getattr(found, name), getattr(given, name)), name
    assert np.array_equal(kept.impulse, known.impulse) and np.array_equal(kept.u_plus, known.u_plus)
    assert fclib.info(path) == texts and fclib.guesses(path) == []
    again = tmp_path / "again.hdf5"
    fclib.write(again, found, **texts, solution=kept)
    with h5py.File(path) as first, h5py.File(again) as second:
        first.visititems(lambda name, it: np.testing.assert_array_equal(it[()], second[name][()]) if hasattr(it, "dtype") else None)


def test_the_layout_is_that_of_fclib(rng, tmp_path):
    given, path = problem(rng, 2, 6), tmp_path / "problem.hdf5"
    fclib.write(path, given, title="é", solution=fclib.Solution(np.zeros(6), np.zeros(6)))
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, it: found.update({name: (it.dtype.str, it.shape)}) if hasattr(it, "dtype") else None)
        x, p, i = (file[f"fclib_local/W/{name}"][()] for name in "xpi")
        assert file["fclib_local/W/nz"][0] == -2 and file["fclib_local/W/nzmax"][0] == len(x)
    entries = ("<i4", (len(x),))
    assert found == {
        **{f"fclib_local/{name}": ("<i4", (1,)) for name in ("spacedim", "W/m", "W/n", "W/nz", "W/nzmax")},
        **{"fclib_local/W/p": ("<i4", (7,)), "fclib_local/W/i": entries, "fclib_local/W/x": ("<f8", (len(x),))},
        **{"fclib_local/vectors/q": ("<f8", (6,)), "fclib_local/vectors/mu": ("<f8", (2,))},
        # Sizes with the final zero: é has two bytes.
        **{"fclib_local/info/title": ("|S3", ()), "fclib_local/info/description": ("|S1", ()), "fclib_local/info/math_info": ("|S1", ())},
        **{"solution/u": ("<f8", (6,)), "solution/r": ("<f8", (6,))},
    }
    w = np.zeros((6, 6))
    w[np.repeat(np.arange(6), np.diff(p)), i] = x
    rows = np.concatenate([ORDER, 3 + ORDER])
    assert np.array_equal(w[np.ix_(rows, rows)], given.delassus)


@pytest.mark.parametrize("stored", STORED)
def test_a_file_of_fclib_is_read_in_rows_with_the_normal_last(tmp_path, stored):
    path = by_hand(tmp_path / "one.hdf5", stored)
    with h5py.File(path, "a") as file:
        file["fclib_local/info/title"] = "with a str of any length"
        file["guesses/number_of_guesses"] = np.array([2], dtype=np.int32)
        for name, first in (("solution", 0.0), ("guesses/1", 10.0), ("guesses/2", 20.0)):
            file[f"{name}/r"], file[f"{name}/u"] = first + np.arange(3.0), -first - np.arange(3.0)
    found = fclib.read(path)
    assert np.array_equal(found.delassus, [[5, 0, 1], [0, 3, 0], [1, 0, 2]])
    assert np.array_equal(found.u_free, [0.25, 0.5, -1]) and np.array_equal(found.friction, [0.5])
    assert np.array_equal(found.restitution, [0])
    assert np.array_equal(fclib.solution(path).impulse, [1, 2, 0]) and np.array_equal(fclib.solution(path).u_plus, [-1, -2, 0])
    assert [it.impulse.tolist() for it in fclib.guesses(path)] == [[11, 12, 10], [21, 22, 20]]
    assert fclib.info(path) == {"title": "with a str of any length"}


def test_a_problem_in_the_plane_gets_a_second_tangent_without_rows(tmp_path):
    with h5py.File(tmp_path / "plane.hdf5", "w") as file:
        file["fclib_local/spacedim"] = np.array([2], dtype=np.int32)
        w = np.array([[2.0, 1, 0, 0.5], [1, 3, 0.25, 0], [0, 0.25, 4, 0], [0.5, 0, 0, 5]])
        i, p = np.nonzero(w)
        put(file, "fclib_local/W", len(i), p, i, w[i, p], w.shape)
        file["fclib_local/vectors/q"], file["fclib_local/vectors/mu"] = [-1.0, 0.5, -2.0, 0.25], [0.5, 0.75]
        file["solution/r"], file["solution/u"] = [1.0, 2, 3, 4], [5.0, 6, 7, 8]
    found = fclib.read(tmp_path / "plane.hdf5")
    rows, own = [0, 2, 3, 5], [1, 0, 3, 2]
    assert np.array_equal(found.delassus[np.ix_(rows, rows)], w[np.ix_(own, own)])
    assert not found.delassus[[1, 4]].any() and not found.delassus[:, [1, 4]].any()
    assert np.array_equal(found.u_free, [0.5, 0, -1, 0.25, 0, -2])
    assert np.array_equal(fclib.solution(tmp_path / "plane.hdf5").impulse, [2, 0, 1, 4, 0, 3])


def test_a_global_problem_is_reduced_to_the_contacts(tmp_path):
    mass, h = global_by_hand(tmp_path / "global.hdf5")
    found = fclib.read(tmp_path / "global.hdf5")
    w, q = h.T @ np.linalg.inv(mass) @ h, h.T @ np.linalg.inv(mass) @ [1, 2, 3, 4] + [0.1, 0.2, 0.3]
    assert np.allclose(found.delassus, w[np.ix_(ORDER, ORDER)], rtol=0, atol=1e-14) and np.array_equal(found.delassus, found.delassus.T)
    assert np.allclose(found.u_free, q[ORDER], rtol=0, atol=1e-14)


def test_restitution_goes_into_the_file_as_a_velocity(rng, tmp_path):
    """A ball on the floor and one that leaves: Moreau's law changes the normal velocity of the first alone."""
    path = tmp_path / "ball.hdf5"
    given = carom.ContactProblem(
        np.diag([3.5, 3.5, 1.0] * 2), [0.4, 0, -1.25, 0, 0, 2.0], friction=0.25, restitution=[0.5, 0.5], u_minus=[0.4, 0, -1.0, 0, 0, 2.0]
    )
    hit = given.solve()
    fclib.write(path, given, title="balls", solution=hit)
    found = fclib.read(path)
    # u_n⁺ = e |u_n⁻| = 0.5 takes an impulse of 1.75; slipping needs 0.4/3.5 < 0.25 · 1.75 of it, so it stops.
    assert np.array_equal(found.u_free, [0.4, 0, -1.75, 0, 0, 2.0]) and not found.restitution.any()
    expected = [-0.4 / 3.5, 0, 1.75, 0, 0, 0]
    for impulse in (hit.impulse, found.solve().impulse, fclib.solution(path).impulse):
        assert np.allclose(impulse, expected, rtol=0, atol=1e-12)
    assert np.allclose(fclib.solution(path).u_plus, [0, 0, 0, 0, 0, 2.0], rtol=0, atol=1e-12)


def test_constraints_that_are_no_contacts_are_not_written(tmp_path):
    given = carom.ContactProblem(np.eye(4), -np.ones(4), friction=0.5, kinds=["contact", "stop"])
    with pytest.raises(fclib.FclibError, match=r'no\.hdf5: constraint 1 is of the kind "stop"'):
        fclib.write(tmp_path / "no.hdf5", given, title="a joint at its limit")
    assert not (tmp_path / "no.hdf5").exists()


def test_a_solution_of_another_problem_is_not_written(tmp_path):
    given = carom.ContactProblem(np.eye(3), -np.ones(3))
    other = carom.ContactProblem(np.eye(6), -np.ones(6)).solve()
    with pytest.raises(fclib.FclibError, match=r"no\.hdf5: solution\.impulse has the shape \(6,\): \(3,\) is needed"):
        fclib.write(tmp_path / "no.hdf5", given, title="a box", solution=other)
    assert not (tmp_path / "no.hdf5").exists()


def drop(name):
    return lambda file: file.__delitem__(name)


def replace(name, value):
    def change(file):
        del file[name]
        file[name] = value

    return change


WRONG = {
    "no problem": (drop("fclib_local"), r"/ has nothing: a problem is in the group fclib_local or fclib_global"),
    "rolling": (lambda file: file.create_group("fclib_global_rolling"), "rolling friction"),
    "V": (lambda file: file.create_group("fclib_local/V"), "/fclib_local/V: bilateral constraints"),
    "R": (lambda file: file.create_group("fclib_local/R"), "/fclib_local/R: bilateral constraints"),
    "spacedim": (replace("fclib_local/spacedim", [5]), "/fclib_local/spacedim = 5: must be 2 or 3"),
    "spacedim 2": (replace("fclib_local/spacedim", [2]), "/fclib_local/W/m = 3: must be a multiple of spacedim = 2"),
    "two numbers": (replace("fclib_local/W/nz", [-2, 3]), r"/fclib_local/W/nz: shape \(2,\), must be one number"),
    "format": (replace("fclib_local/W/nz", [-3]), "/fclib_local/W: m = 3, n = 3, nz = -3"),
    "fractions": (replace("fclib_local/W/p", [0.0, 2, 4, 5]), "/fclib_local/W/p: must be a dataset of whole numbers"),
    "not square": (replace("fclib_local/W/n", [4]), "/fclib_local/W: 3 by 4, must be square"),
    "pointers": (replace("fclib_local/W/p", [0, 2, 4]), r"/fclib_local/W/p: 3 numbers from \[0\], must be 4 from 0"),
    "falling pointers": (replace("fclib_local/W/p", [0, 4, 2, 5]), r"/fclib_local/W/p\[1\] = 2: must not decrease"),
    "far pointer": (replace("fclib_local/W/p", [0, 2, 4, 15]), "/fclib_local/W: i and x have 9 and 9 numbers, must have 15"),
    "index": (replace("fclib_local/W/i", [1, 0, 0, 1, 3]), r"/fclib_local/W/i\[4\] = 3: must be 0 to 2"),
    "negative index": (replace("fclib_local/W/i", [1, 0, 0, -1, 2]), r"/fclib_local/W/i\[3\] = -1: must be 0 to 2"),
    "short triplets": (replace("fclib_local/W/nz", [5]), r"/fclib_local/W/p: shape \(4,\), must have nz = 5 numbers"),
    "infinite": (replace("fclib_local/W/x", [1.0, np.inf, 1, 5, 3]), r"/fclib_local/W/x\[1\] = inf: must be finite"),
    "not symmetric": (replace("fclib_local/W/x", [1.0, 2, 0.5, 5, 3]), r"W\[0,1\] = 1.0 but W\[1,0\] = 0.5: .* symmetrize=True"),
    "indefinite": (replace("fclib_local/W/x", [1.0, -2, 1, 5, 3]), "/fclib_local: in rows t1, t2, n: .* not positive semidefinite"),
    "q": (replace("fclib_local/vectors/q", [1.0, 2]), r"/fclib_local/vectors/q: shape \(2,\), must be \(3,\) for W of 3 rows"),
    "no mu": (drop("fclib_local/vectors/mu"), "/fclib_local/vectors/mu is missing"),
    "mu": (replace("fclib_local/vectors/mu", [0.5, 0.5]), r"/fclib_local/vectors/mu: shape \(2,\), must be \(1,\)"),
    "negative mu": (replace("fclib_local/vectors/mu", [-0.5]), r"/fclib_local: in rows t1, t2, n: constraint 0: friction -0.5"),
    "NaN": (replace("fclib_local/vectors/q", [1.0, 2, np.nan]), r"/fclib_local/vectors/q\[2\] = nan: must be finite"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_file_is_refused_by_name(tmp_path, case):
    change, message = WRONG[case]
    path = by_hand(tmp_path / "wrong.hdf5")
    fclib.read(path)
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(fclib.FclibError, match=r"wrong\.hdf5: .*" + message):
        fclib.read(path)


def test_a_wrong_global_file_is_refused_by_name(tmp_path):
    path = tmp_path / "global.hdf5"
    for name, value, message in (
        ("H/m", [3], "/fclib_global/H/i.* must be 0 to 2"),
        ("H/n", [4], "/fclib_global/H: 4 by 4, must have 4 rows as M, and columns that are a multiple of spacedim = 3"),
        ("M/x", [-2.0, 1, 3, 0.5, 1, 4, 0.5, 5], "/fclib_global/M: rows 0 to 2 are not positive definite"),
        ("M/x", [2.0, 1, 3, 0.5, 2, 4, 0.5, 5], r"/fclib_global/M: M\[0,2\] = 1.0 but M\[2,0\] = 2.0"),
        ("vectors/f", [1.0], r"/fclib_global/vectors/f: shape \(1,\), must be \(4,\) for M of 4 rows"),
        ("G/m", [4], "/fclib_global/G: bilateral constraints"),
    ):
        global_by_hand(path)
        with h5py.File(path, "a") as file:
            if f"fclib_global/{name}" in file:
                del file[f"fclib_global/{name}"]
            file[f"fclib_global/{name}"] = value
        with pytest.raises(fclib.FclibError, match=message):
            fclib.read(path)


def test_symmetrize_takes_the_symmetric_part(tmp_path):
    path = by_hand(tmp_path / "skew.hdf5")
    with h5py.File(path, "a") as file:
        file["fclib_local/W/x"][2] = 0.5
    assert np.array_equal(fclib.read(path, symmetrize=True).delassus, [[5, 0, 0.75], [0, 3, 0], [0.75, 0, 2]])


@pytest.mark.parametrize("dropped", [(0, 2), (2, 0)])
def test_an_entry_on_one_side_couples_two_rows_of_a_mass_matrix(tmp_path, dropped):
    """Halved by symmetrize: M couples 0 and 2 by 0.5 instead of 1."""
    path = tmp_path / "half.hdf5"
    mass, h = global_by_hand(path)
    mass[dropped] = 0.0
    with h5py.File(path, "a") as file:
        del file["fclib_global/M"]
        i, p = np.nonzero(mass)
        put(file, "fclib_global/M", len(i), p, i, mass[i, p], mass.shape)
    w = h.T @ np.linalg.inv((mass + mass.T) / 2) @ h
    assert np.allclose(fclib.read(path, symmetrize=True).delassus, w[np.ix_(ORDER, ORDER)], rtol=0, atol=1e-14)


def test_a_file_that_is_none_of_hdf5_is_refused_by_name(tmp_path):
    path = tmp_path / "text.hdf5"
    path.write_text("a text")
    with pytest.raises(fclib.FclibError, match=r"text\.hdf5: not a file of HDF5"):
        fclib.read(path)
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n")
    with pytest.raises(fclib.FclibError, match=r"text\.hdf5: it is a pointer of Git LFS"):
        fclib.read(path)
    with pytest.raises(FileNotFoundError):
        fclib.read(tmp_path / "absent.hdf5")


def test_h5py_is_needed_for_files_only():
    """carom imports it with carom.fclib, and the error of a missing package names it."""
    code = "import sys; sys.modules['h5py'] = None; import carom; import carom.fclib"
    missing = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert missing.returncode != 0 and "carom/fclib.py" in missing.stderr.replace("\\", "/") and "h5py" in missing.stderr.splitlines()[-1]
