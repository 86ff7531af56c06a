"""The README's snippet and the examples run as they stand; the stubs have what the package has."""

import ast
import importlib.util
import inspect
import os
import pathlib
import re
import subprocess
import sys

import pytest

import carom
from conftest import ROOT

HERE = pathlib.Path(__file__).resolve().parents[1]


def snippets(path):
    return re.findall(r"```python\n(.*?)```", path.read_text(), flags=re.DOTALL)


def test_the_first_impact_of_the_readme_has_five_lines_and_runs(capsys):
    first = snippets(HERE / "README.md")[0]
    assert len([line for line in first.splitlines() if line.strip()]) == 5
    exec(first, {})
    printed = capsys.readouterr().out
    shown = re.search(r"```python\n.*?```\n+```text\n(.*?)```", (HERE / "README.md").read_text(), flags=re.DOTALL)[1]
    assert printed == shown


PAGES = ["python", "task-many-runs", "task-loop", "task-optimise", "task-gradients", "task-own-simulator", "task-fclib", "coming-from"]


@pytest.mark.parametrize(
    "path",
    [ROOT / "README.md", HERE / "README.md", *(ROOT / f"book/src/{page}.md" for page in PAGES)],
    ids=lambda path: f"{path.parent.name}/{path.name}",
)
def test_every_snippet_of_a_page_runs(path, monkeypatch, tmp_path):
    # The snippets of a page are read one after another, from the folder of the repository; files go elsewhere.
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names, found = {"__name__": "__main__"}, snippets(path)
    assert found
    for library in ("scipy", "pinocchio", "mujoco", "dask", "carom.fclib"):
        if f"from {library}" in "".join(found) or f"import {library}" in "".join(found):
            pytest.importorskip(library)
    for snippet in found:
        if "carom.record(" in snippet and not carom.can_record():
            continue
        if any(f"import {it}\n" in snippet and importlib.util.find_spec(it) is None for it in ("jax", "torch")):
            continue
        exec(snippet.replace('"out/', f'"{tmp_path}/'), names)


@pytest.mark.parametrize("path", sorted((HERE / "examples").glob("*.py")), ids=lambda path: path.stem)
def test_the_examples_run(path, tmp_path):
    done = subprocess.run(
        [sys.executable, path, "--out", tmp_path],
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_the_script_of_the_types_runs():
    exec(compile((HERE / "tests/typed.py").read_text(), "typed.py", "exec"), {})


def members(tree):
    """Names of the module, and of the members of each class, in a stub."""
    names = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            own = [part for part in node.body if isinstance(part, (ast.FunctionDef, ast.AnnAssign))]
            names[node.name] = {part.name if isinstance(part, ast.FunctionDef) else part.target.id for part in own}
        elif isinstance(node, ast.FunctionDef):
            names[node.name] = {argument.arg for argument in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]}
    return names


def test_the_stubs_have_what_the_package_has():
    folder = pathlib.Path(carom.__file__).parent
    assert (folder / "py.typed").exists()
    stubs = members(ast.parse((folder / "__init__.pyi").read_text()))
    for name in [*carom.__all__, "map"]:
        assert name in stubs, name
        found = getattr(carom, name)
        if isinstance(found, type):
            if issubclass(found, (Exception, int)):
                continue
            public = {member for member in vars(found) if not member.startswith("_")}
            assert public == {member for member in stubs[name] if not member.startswith("_")}, name
            for member in public:
                assert getattr(found, member).__doc__, f"{name}.{member} has no docstring"
        else:
            assert set(inspect.signature(found).parameters) == stubs[name], name
        assert found.__doc__, name


def test_the_properties_of_the_stubs_have_the_types_of_the_getters():
    spec = importlib.util.spec_from_file_location("stubs", HERE / "stubs.py")
    stubs = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(stubs)
    assert len(list(stubs.getters())) > 100
    text = stubs.STUB.read_text()
    assert stubs.written(text) == text, "run stubs.py"


def test_the_version_is_that_of_the_crates():
    manifest = (ROOT / "Cargo.toml").read_text()
    assert f'version = "{carom.__version__}"' in manifest


def test_the_version_of_rerun_is_that_of_the_recordings():
    manifest = (ROOT / "crates/carom-record/Cargo.toml").read_text()
    version = re.search(r'^re_sdk = "=([\d.]+)"', manifest, flags=re.MULTILINE)[1]
    for text in (carom.record.__doc__, *((ROOT / page).read_text() for page in ("book/src/python.md", "crates/carom-python/README.md"))):
        assert version in text
