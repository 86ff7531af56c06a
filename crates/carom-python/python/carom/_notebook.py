"""What notebooks show of results: small tables, and plots with matplotlib, which is imported when it is needed."""

import html

import numpy as np

ROWS = 10
COLUMNS = 12
# Lines of a legend beside axes of 2.5 inches.
LINES = 11


def pyplot():
    """matplotlib.pyplot."""
    try:
        import matplotlib.pyplot
    except ImportError:
        raise ImportError("plot() needs matplotlib: pip install matplotlib") from None
    return matplotlib.pyplot


def number(value):
    """A value with as many digits as a table needs."""
    if isinstance(value, (float, np.floating)):
        return f"{value:.5g}"
    if isinstance(value, np.ndarray):
        return "(" + ", ".join(map(number, value.tolist())) + ")"
    return str(value)


def table(head, rows, caption, cut=""):
    """An HTML table; `cut` says what it leaves out."""

    def row(tag, cells):
        return "<tr>" + "".join(f"<{tag}>{html.escape(number(cell))}</{tag}>" for cell in cells) + "</tr>"

    foot = f"<p>{html.escape(cut)}</p>" if cut else ""
    body = "".join(row("td", cells) for cells in rows)
    head = f"<thead>{row('th', head)}</thead>" if head else ""
    return f"<table><caption>{html.escape(caption)}</caption>{head}<tbody>{body}</tbody></table>{foot}"


def impact_html(hit):
    """The numbers of an impact with their units."""
    rows = [
        ("mode", hit.mode, ""),
        ("flags", ", ".join(hit.flags) or "none", ""),
        ("qd_plus", hit.qd_plus, "rad/s, m/s"),
        ("impulse", hit.impulse, "N s"),
        ("u_minus", hit.u_minus, "m/s"),
        ("u_plus", hit.u_plus, "m/s"),
        ("energy_before", hit.energy_before, "J"),
        ("energy_after", hit.energy_after, "J"),
    ]
    return table((), rows, f"Impact, law {hit.law}")


def impacts_html(hits):
    """The first impacts of a batch."""
    first = list(zip(range(ROWS), hits.mode[:ROWS], hits[:ROWS].flags, hits.energy_ratio[:ROWS]))
    rows = [(k, mode, ", ".join(flags), ratio) for k, mode, flags, ratio in first]
    cut = f"{len(hits) - ROWS} more" if len(hits) > ROWS else ""
    return table(("state", "mode", "flags", "energy_ratio"), rows, f"{len(hits)} impacts, law {hits.law}", cut)


def run_html(run):
    """The first events of a run."""
    events = run.events
    rows = [(event.time, event.kind, event.contact or ", ".join(event.contacts)) for event in events[:ROWS]]
    cut = f"{len(events) - ROWS} more events" if len(events) > ROWS else ""
    caption = f"Run of {run.chain.name}: {len(events)} events to {number(run.last[0])} s, then {run.mode}"
    return table(("time, s", "event", "contact"), rows, caption, cut)


def table_html(own):
    """The first rows and columns of a table."""
    columns = own.columns[:COLUMNS]
    rows = zip(*(own[name][:ROWS] for name in columns))
    left = [(len(own) - ROWS, "rows"), (len(own.columns) - COLUMNS, "columns")]
    cut = ", ".join(f"{count} more {what}" for count, what in left if count > 0)
    return table(columns, rows, f"Table of {len(own)} rows", cut)


def impact_plot(hit, axes):
    """The contact velocity before and after, and the impulse, by world axes."""
    axes = pyplot().subplots(1, 2, figsize=(8, 3), layout="constrained")[1] if axes is None else axes
    places = np.arange(3)
    axes[0].bar(places - 0.2, hit.u_minus, 0.4, label="before")
    axes[0].bar(places + 0.2, hit.u_plus, 0.4, label="after")
    axes[0].legend()
    axes[1].bar(places, hit.impulse, 0.6)
    for own, label in zip(axes, ("velocity of the contact point, m/s", "impulse on the robot, N s")):
        own.set_xticks(places, ("x", "y", "z"))
        own.axhline(0, color="black", lw=0.5)
        own.set_ylabel(label)
    axes[0].set_title(f"{hit.law}: {hit.mode}")
    return axes


def run_plot(run, axes):
    """q and qd over time, with a line at each impact."""
    if axes is None:
        width = 8 + 2 * (run.chain.nq // LINES)
        axes = pyplot().subplots(2, 1, sharex=True, figsize=(width, 6), layout="constrained")[1]
    names = run.states.columns[1:]
    nq = run.chain.nq
    for own, values, labels in zip(axes, (run.q, run.qd), (names[:nq], names[nq:])):
        for curve, label in zip(values.T, labels):
            own.plot(run.time, curve, label=label)
        for event in run.events:
            if event.kind in ("impact", "several"):
                own.axvline(event.time, color="grey", lw=0.5, zorder=0)
        # Beside the axes, in as many columns as its height asks for.
        own.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1, 1), ncols=-(-values.shape[1] // LINES))
    axes[0].set_ylabel("q: rad, m")
    axes[1].set(xlabel="time, s", ylabel="qd: rad/s, m/s")
    return axes


def table_plot(own, y, x, axes):
    """One column over another."""
    axes = pyplot().subplots(layout="constrained")[1] if axes is None else axes
    x = own.columns[0] if x is None else x
    style = "." if np.any(np.diff(own[x]) < 0) else "-"
    axes.plot(own[x], own[y], style)
    axes.set(xlabel=x, ylabel=y)
    return axes


class Diagram(dict):
    """A diagram of one impact, the dict of ``carom.diagram``, with its picture in notebooks."""

    def _repr_html_(self):
        return self["svg"]

    def plot(self, axes=None):
        """Draws the diagram with matplotlib.

        Args:
            axes: the Axes to draw into; new ones by default.

        Returns:
            The Axes.

        Raises:
            ImportError: matplotlib is not installed.
        """
        axes = pyplot().subplots(figsize=(7, 6), layout="constrained")[1] if axes is None else axes
        for shape in self["shapes"]:
            for k, piece in enumerate(shape["pieces"]):
                label = shape["name"] if k == 0 else None
                if shape["stroke"] == "area":
                    axes.fill(*piece.T, color=shape["colour"], alpha=0.5, label=label)
                else:
                    axes.plot(*piece.T, color=shape["colour"], lw=2 if shape["stroke"] == "thick" else 1, label=label)
        for mark in self["marks"]:
            axes.plot(*mark["at"], "o" if mark["symbol"] == "law" else "s", color=mark["colour"], label=mark["name"])
        axes.set(title=self["title"], xlabel=self["axes"][0], ylabel=self["axes"][1])
        axes.set(xlim=self["window"][0], ylim=self["window"][1], aspect="equal" if self["equal_scales"] else "auto")
        axes.legend(fontsize=7)
        return axes


Diagram.__module__ = "carom"
