"""What notebooks show: tables that have the numbers, plots that have the curves, and a notebook that runs."""

import pathlib
import sys
import xml.etree.ElementTree

import numpy as np
import pytest

import carom
from conftest import ROOT, states

HERE = pathlib.Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def shown():
    """Results of each class that notebooks show."""
    arm = carom.Chain.from_urdf(ROOT / "robots/planar2.urdf")
    args = dict(frame="tip", normal=(-1, 0, 0), law=carom.Energetic(0.35, 0.2))
    run = carom.Scene.from_file(ROOT / "scenes/bounce.toml").simulate(sample=0.1)
    H, u = np.array([[2.44, 1.52], [1.52, 1.01]]), np.array([-0.267, -0.134])
    return {
        "impact": arm.impact([0.7854, -1.5708], [-0.15, 0.6], **args),
        "impacts": arm.impact(*states(arm, np.random.default_rng(4), 30), **args),
        "run": run,
        "table": run.states,
        "diagram": carom.diagram(H, u, 0.5, carom.law(H, u, [carom.Newton(0.5, 0.5), carom.Poisson(0.5, 0.5)])),
    }


def cells(own):
    """The texts of a table in HTML."""
    page = xml.etree.ElementTree.fromstring(f"<page>{own._repr_html_()}</page>")
    return [[cell.text or "" for cell in row] for row in page.iter("tr")], "".join(page.itertext())


def test_tables_have_the_numbers_of_results(shown):
    hit, hits, run, table = (shown[name] for name in ("impact", "impacts", "run", "table"))
    rows, text = cells(hit)
    assert ["energy_after", f"{hit.energy_after:.5g}", "J"] in rows and ["mode", hit.mode, ""] in rows and "energetic" in text
    rows, text = cells(hits)
    assert len(rows) == 11 and rows[3] == ["2", hits.mode[2], ", ".join(hits.flags[2]), f"{hits.energy_ratio[2]:.5g}"]
    assert "30 impacts" in text and "20 more" in text
    rows, text = cells(run)
    assert rows[1] == [f"{run.events[0].time:.5g}", "impact", run.events[0].contact] and len(rows) == 1 + len(run.events)
    rows, text = cells(table)
    assert rows[0] == table.columns[:12] and len(rows) == 11 and f"{len(table) - 10} more rows" in text
    assert f"{len(table.columns) - 12} more columns" in text
    assert shown["diagram"]._repr_html_() == shown["diagram"]["svg"]


def test_short_results_leave_nothing_out(shown):
    assert "more" not in cells(shown["impacts"][:10])[1]
    empty = shown["impacts"][:0]
    assert len(cells(empty)[0]) == 1 and list(empty) == []


def test_plots_have_the_numbers_of_results(shown):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    run = shown["run"]
    upper, lower = run.plot()
    assert np.array_equal(upper.lines[2].get_ydata(), run.q[:, 2]) and np.array_equal(lower.lines[2].get_ydata(), run.qd[:, 2])
    assert len(upper.lines) == run.chain.nq + sum(event.kind == "impact" for event in run.events)
    velocity, impulse = shown["impact"].plot()
    heights = [bar.get_height() for bar in velocity.patches]
    assert heights == [*shown["impact"].u_minus, *shown["impact"].u_plus]
    assert [bar.get_height() for bar in impulse.patches] == shown["impact"].impulse.tolist()
    axes = run.states.plot("qd.base 2" if "qd.base 2" in run.states else run.states.columns[-1])
    assert axes.get_xlabel() == "time" and len(axes.lines[0].get_xdata()) == len(run.states)
    assert run.states.plot(run.states.columns[1], axes=axes) is axes
    marks = {mark["name"]: mark["at"] for mark in shown["diagram"]["marks"]}
    drawn = {line.get_label(): line.get_xydata()[0] for line in shown["diagram"].plot().lines if len(line.get_xydata()) == 1}
    assert drawn.keys() == marks.keys() and all(np.array_equal(drawn[name], marks[name]) for name in marks)
    with pytest.raises(KeyError, match="the columns are"):
        run.states.plot("none")


@pytest.mark.parametrize("kind, arguments", [("impact", ()), ("run", ()), ("table", ("time",)), ("diagram", ())])
def test_a_plot_without_matplotlib_says_how_to_get_it(shown, kind, arguments, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        shown[kind].plot(*arguments)


@pytest.mark.parametrize("path", sorted((HERE / "examples").glob("*.ipynb")), ids=lambda path: path.stem)
def test_the_notebooks_run(path, tmp_path, monkeypatch):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "clear its outputs"
    # Files of the kernel of the machine are not used.
    for name in ("JUPYTER_PATH", "IPYTHONDIR", "JUPYTER_RUNTIME_DIR"):
        monkeypatch.setenv(name, str(tmp_path / name))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # notebooks have their own
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    kinds = [kind for output in outputs for kind in output.get("data", {})]
    assert kinds.count("image/png") >= 2 and kinds.count("text/html") >= 4
