"""One look for all figures: a colour and mark for each code, a size for each figure, the usual kinds.

Colours from Okabe and Ito (2008), told apart by colour-blind readers; marks and line styles differ as well.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.harness import codes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SOFT, GRID = "#1b2430", "#56616e", "#e6eaee"

#: What is drawn beside codes: thin black line for what is exact, diamonds for measurements.
OTHERS: dict[str, dict[str, Any]] = {
    "oracle": {"color": "#000000", "linestyle": "-", "linewidth": 0.9, "zorder": 5},
    "experiment": {
        "color": "#777777",
        "linestyle": "none",
        "marker": "D",
        "markersize": 4.5,
        "markerfacecolor": "#bbbbbb",
        "zorder": 6,
    },
}
#: For sweeps within one code.
SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")

TOLERANCE = {"color": "#b3261e", "linewidth": 1.0, "linestyle": (0, (5, 3)), "zorder": 1}

#: Width of a figure that shares a row of the report, and of one that takes it all [inch].
HALF, WHOLE = 5.2, 9.6

_LOOK = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titleweight": "normal",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.constrained_layout.use": True,
    "image.interpolation": "none",
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 4),
    "savefig.facecolor": "none",
    "figure.dpi": 96,
}


@contextlib.contextmanager
def look() -> Iterator[None]:
    """The report's fonts, lines and colours, for figures made inside."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt
    from cycler import cycler

    plt.switch_backend("agg")
    rc: Any = {**_LOOK, "axes.prop_cycle": cycler(color=SERIES)}
    with mpl.rc_context(rc):
        yield


def style(who: str, **changes: Any) -> dict[str, Any]:
    """Drawing arguments of a code, "oracle" or "experiment", with its name as label."""
    return {**OTHERS.get(who, _of_code(who)), "label": name(who), **changes}


def name(who: str) -> str:
    """The name to show for a code, "oracle" or "experiment"."""
    return "exact" if who == "oracle" else codes.title(who)


def color(who: str) -> str:
    """The colour of a code, "oracle" or "experiment"."""
    return style(who)["color"]


def _of_code(who: str) -> dict[str, Any]:
    """A code's own style; one without gets a colour by its place among the codes, and a dashed line."""
    if who not in codes.CODES:
        return {"color": SOFT}
    if codes.CODES[who].style:
        return codes.CODES[who].style
    place = [name for name, code in codes.CODES.items() if not code.style].index(who)
    return {"color": SERIES[3 + place % 4], "linestyle": (0, (4, 2)), "linewidth": 1.5, "zorder": 4}


def figure(
    rows: int = 1, columns: int = 1, *, width: float = HALF, height: float = 3.2, **options: Any
) -> tuple[Figure, Any]:
    """(figure, axes) in the report's look; height [inch] of the whole. `width=WHOLE` takes a row alone.

    `options` go to `plt.subplots`: sharex, height_ratios, squeeze, ...
    """
    import matplotlib.pyplot as plt

    with look():
        return plt.subplots(rows, columns, figsize=(width, height), **options)


def marks(code: str, **changes: Any) -> dict[str, Any]:
    """Points of a code where color says something else: crosses for gpudem, open symbols for the others."""
    shape = "xos^vD"[list(codes.CODES).index(code) % 6] if code in codes.CODES else "o"
    return {"marker": shape, "linestyle": "none", "markersize": 5, "markerfacecolor": "none", **changes}


def line_or_marks(code: str, length: int, dash: Any = "-", **changes: Any) -> dict[str, Any]:
    """The same for a curve of `length` points: gpudem as a line, the others as some 25 points on it."""
    if code == "gpudem":
        return {"linestyle": dash, **changes}
    return marks(code, **{"markersize": 4, "markevery": max(1, length // 25), **changes})


def exact_and_marks(axes: Axes, x: Any, exact: Any, found: Mapping[str, Any], color: str, label: str) -> None:
    """An exact line in a color, and on it each code's values at the same x as some 45 points.

    `found` and `exact` may come with an x of their own, as (x, y).
    """
    line = exact if isinstance(exact, tuple) else (x, exact)
    axes.plot(*line, "-", color=color, linewidth=0.9, label=label)
    for code, values in found.items():
        xs, ys = values if isinstance(values, tuple) else (x, values)
        axes.plot(xs, ys, **marks(code, color=color, markevery=max(1, len(xs) // 45)))


def curves_and_differences(
    x: Mapping[str, Any],
    curves: Mapping[str, tuple[Mapping[str, Any], Any]],
    *,
    reference: str,
    **options: Any,
) -> tuple[Figure, Any, Any]:
    """(figure, upper axes, lower axes): curves {label: ({code: y}, exact y)} over x[label], each label in a
    color. Lower axes, logarithmic: differences between compared codes (solid), and of the first code from the
    exact curve (dashed), called `reference`. `options` go to `figure`.
    """
    fig, (top, low) = figure(2, 1, height=5.4, sharex=True, height_ratios=(1.5, 1), **options)
    ran: list[str] = []
    for (label, (found, exact)), shade in zip(curves.items(), SERIES, strict=False):
        ran = list(found)
        for code, values in found.items():
            text = label if code == ran[0] else None
            top.plot(x[label], values, **line_or_marks(code, len(values), color=shade, label=text))
        gaps = [("--", found[ran[0]] - exact)]
        gaps += [("-", found[a] - found[b]) for a, b in codes.pairs(ran)]
        for dash, gap in gaps:
            low.semilogy(x[label], np.maximum(np.abs(gap), 1e-18), dash, color=shade)
    low.set_ylabel("difference")
    low.set_title(f"solid: between the codes, dashed: {name(ran[0])} - {reference}", fontsize=9)
    legend(top, lines=ran, ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return fig, top, low


def legend(*axes: Axes, points: Sequence[str] = (), lines: Sequence[str] = (), **options: Any) -> None:
    """A legend where something is labeled, each label once; below it, in black, how codes are drawn:
    `points` of them by `marks`, `lines` by `line_or_marks`.
    """
    from matplotlib.lines import Line2D

    drawn = [(who, marks(who)) for who in points] + [(who, line_or_marks(who, 1)) for who in lines]
    for one in axes:
        handles = {label: handle for handle, label in zip(*one.get_legend_handles_labels(), strict=True)}
        handles |= {name(who): Line2D([], [], color=INK, **look) for who, look in drawn}
        if handles:
            one.legend(handles.values(), handles.keys(), **options)


def work_precision(
    series: Mapping[str, tuple[Any, Any]], *, ylabel: str, xlabel: str = "stepping time [s]"
) -> Figure:
    """Error against stepping seconds, log-log: {"gpudem": (seconds, errors), "gpudem float32": ..., ...}.

    The first word of a key is the code and gives the colour; others (precision, device) change the mark.
    """
    fig, axes = figure()
    marks: dict[str, int] = {}
    for key, (seconds, errors) in series.items():
        who, _, rest = key.partition(" ")
        nth = marks[who] = marks.get(who, -1) + 1
        look = style(
            who, marker="os^vD"[nth % 5], markersize=5, linewidth=1.2, linestyle=("-", "--", ":")[nth % 3]
        )
        look["label"] = f"{name(who)} {rest}".strip()
        order = np.argsort(seconds)
        axes.loglog(np.asarray(seconds, float)[order], np.asarray(errors, float)[order], **look)
    axes.set(xlabel=xlabel, ylabel=ylabel)
    legend(axes)
    return fig


def band(axes: Axes, x: Any, samples: Any, who: str, *, label: str | None = None) -> None:
    """Mean of several seeds and the range between the smallest and the largest: samples (seeds, len(x))."""
    samples = np.asarray(samples, float)
    shade = color(who)
    axes.fill_between(x, samples.min(axis=0), samples.max(axis=0), color=shade, alpha=0.18, linewidth=0)
    dash = "-" if who == "gpudem" else (0, (4, 2))
    text = label or f"{name(who)}, mean and range of {len(samples)}"
    axes.plot(x, samples.mean(axis=0), color=shade, linewidth=1.5, linestyle=dash, label=text)


def points(axes: Axes, x: Any, y: Any, who: str, *, error: Any = None, **changes: Any) -> None:
    """Measured points, with error bars where given."""
    look = style(who, **changes)
    if error is None:
        axes.plot(x, y, **look)
    else:
        axes.errorbar(x, y, yerr=error, elinewidth=0.9, capsize=2, **look)
