"""What was measured on a GPU, as recorded: rates, the experiment's box at its real modulus."""

from __future__ import annotations

import csv
import functools
import json
import math
import re
from importlib import resources
from typing import Any

import numpy as np
import pandas

from comparisons import kit
from comparisons.cases.dam_break import scenes as dam
from comparisons.cases.performance import speed
from comparisons.metrics import statistics
from comparisons.report import plots

RECORDED = resources.files("comparisons") / "recorded"
#: The paper's own gain of its GPU over one core of a CPU, at 120 000 balls.
PAPER_GAIN = 34
#: Confidence level of one place, so that all ten hold at once with 0.95 (Bonferroni).
LEVEL = 1 - 0.05 / len(dam.READ_AT)
LOOKS = {"float64": 0, "mixed": 2, "float32": 3}


@functools.cache
def recorded() -> dict[str, Any]:
    """gpu.json: provenance, rates, times of kernels, the three gates."""
    return json.loads((RECORDED / "gpu.json").read_text())


def rate(bed: str, particles: int, precision: str) -> float:
    """Median particle-steps per second on the GPU; NaN if it was not measured."""
    key = (bed, particles, precision)
    found = [r["rate"] for r in recorded()["rates"] if (r["state"], r["particles"], r["precision"]) == key]
    return float(np.median(found)) if found else math.nan


def on_one_core(bed: str, particles: int, precision: str) -> float:
    """The same on one core of the recorded bench's CPU."""
    rows = pandas.DataFrame(speed.recorded()["rows"])
    keys = {"state": bed, "particles": particles, "precision": precision, "code": "gpudem", "device": "cpu",
            "cores": 1}  # fmt: skip
    return float(rows[np.logical_and.reduce([rows[k] == v for k, v in keys.items()])].rate.median())


def bandwidth() -> float:
    """Of a copy in the memory of the GPU [bytes/s], read and written."""
    return max(row["bytes_per_s"] for row in recorded()["bandwidth"] if row["device"] != "cpu")


def roofline(bed: str, particles: int, precision: str) -> float:
    """Particle-steps per second at which the bytes that a step must move take the whole bandwidth."""
    key = (bed, particles, precision)
    moved = [
        r["moved_bytes"] for r in recorded()["rates"] if (r["state"], r["particles"], r["precision"]) == key
    ]
    return bandwidth() / float(np.median(moved)) if moved else math.nan


def gain(results: kit.Results) -> kit.Measured:
    fast, slow = rate("flowing", 120_000, "mixed"), on_one_core("flowing", 120_000, "mixed")
    note = f"{fast:.3g} and {slow:.3g} particle-steps/s, the CPU is that of the recorded bench"
    return kit.Measured(fast / slow, note=f"{note}; the paper: {PAPER_GAIN}")


def share(results: kit.Results) -> float:
    bed = ("flowing", 1_000_000, "mixed")
    return rate(*bed) / roofline(*bed)


def rates_table(results: kit.Results) -> kit.Rows:
    arrays = {(r["state"], r["precision"], r["particles"]): r["array_bytes"] for r in recorded()["rates"]}
    rows = []
    for (bed, precision, particles), size in sorted(arrays.items()):
        found = rate(bed, particles, precision)
        rows.append({
            "bed": bed, "precision": precision, "particles": particles,
            "particle-steps/s [1e9]": round(found / 1e9, 2),
            "time of a step [us]": round(1e6 * particles / found, 1),
            "roofline [%]": round(100 * found / roofline(bed, particles, precision)),
            "arrays, bytes per particle": round(size),
        })  # fmt: skip
    return rows


def draw_rates(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(height=3.8)
    table = pandas.DataFrame(rates_table(results))
    for precision, group in table[table.bed == "flowing"].groupby("precision"):
        color = plots.SERIES[LOOKS[str(precision)]]
        rates = 1e9 * group["particle-steps/s [1e9]"]
        axes.loglog(group.particles, rates, "o-", color=color, ms=4, label=f"gpudem {precision}, GPU")
    bound = roofline("flowing", 1_000_000, "mixed")
    axes.axhline(bound, color="0.5", ls=":", label="roofline of mixed, GPU")
    rows = pandas.DataFrame(speed.recorded()["rows"])
    cores = int(rows.cores.max())
    part = rows[(rows.state == "flowing") & (rows.cores == cores)]
    for code in part.code.unique():
        precision = "mixed" if code == "gpudem" else "float64"
        group = part.query("code == @code and precision == @precision").groupby("particles").rate.median()
        look = {"linestyle": "--", "marker": "s", "markersize": 3}
        label = f"{plots.name(code)} {precision}, {cores} cores"
        axes.loglog(group.index, group, **plots.style(code, **look, label=label))
    axes.set(xlabel="particles", ylabel="particle-steps per second", title="flowing bed")
    plots.legend(axes, fontsize=7.5)
    return figure


# -- the experiment's box ----------------------------------------------------------------------------------


def gates() -> list[dict[str, Any]]:
    """The three runs, by the distance of the gate."""
    return sorted(recorded()["paper"], key=lambda row: row["gate_m"])


def gates_table(results: kit.Results) -> kit.Rows:
    quantities = {
        "wall clock [s]": lambda g: round(g["wall_s"], 1),
        "particle-steps/s [1e9]": lambda g: round(g["particle_steps_per_s"] / 1e9, 2),
        "time to the far wall [s]": lambda g: g["far_wall_s"],
    }
    for k, x in enumerate(dam.READ_AT):
        quantities[f"height at {1e3 * x:.0f} mm [mm]"] = lambda g, k=k: f"{g['heights_mm'][k]:.1f}"
    return [
        {"quantity": name, **{f"gate at {1e3 * g['gate_m']:.0f} mm": of(g) for g in gates()}}
        for name, of in quantities.items()
    ]


def draw_sides(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(3, 1, width=plots.WHOLE, height=6.4, sharex=True)
    edges = [np.arange(0.0, dam.LENGTH + 1e-3, 1e-3), np.arange(0.0, 0.2, 1e-3)]
    with np.load(str(RECORDED / "gpu_sides.npz")) as file:
        for ax, gate in zip(axes, gates(), strict=True):
            mm = round(1e3 * gate["gate_m"])
            picture = _discs(file[f"gate_{mm}"], edges)
            ax.pcolormesh(*[1e3 * e for e in edges], picture.T, cmap="Blues", vmax=1.6, rasterized=True)
            ax.plot(1e3 * dam.PROFILE_AT, 1e3 * np.array(gate["profile_m"]), color="0.2", lw=1)
            ax.plot(1e3 * dam.READ_AT, gate["heights_mm"], "o", color="0.2", ms=3)
            ax.axvline(mm, color="0.6", ls=":")
            ax.set(ylabel="height [mm]", aspect="equal", ylim=(0, 190))
            ax.set_title(f"gate at {mm} mm", loc="left", fontsize=9)
    axes[-1].set_xlabel("x [mm]")
    return figure


def _discs(centers: np.ndarray, edges: list[np.ndarray]) -> np.ndarray:
    """Picture of the balls at the front wall: 0 outside, 0.35 to 1 from a ball's rim to its center."""
    x, z = (0.5 * (e[1:] + e[:-1]) for e in edges)
    picture = np.zeros((len(x), len(z)))
    for cx, cz in centers.astype(float):
        i = slice(*np.searchsorted(x, (cx - dam.RADIUS, cx + dam.RADIUS)))
        k = slice(*np.searchsorted(z, (cz - dam.RADIUS, cz + dam.RADIUS)))
        rest = 1 - ((x[i, None] - cx) ** 2 + (z[None, k] - cz) ** 2) / dam.RADIUS**2
        picture[i, k] = np.where(rest > 0, np.maximum(picture[i, k], 0.35 + 0.65 * rest), picture[i, k])
    return picture


def softened() -> list[statistics.Comparison]:
    """Heights at rest [mm], gate at 200 mm: real modulus less 5 MPa by place, over eight strips each."""
    text = (RECORDED / "full" / "dam_box" / "01_the_whole_box.csv").read_text()
    soft = next(row for row in csv.DictReader(text.splitlines()) if row["code"] == "gpudem")
    real = 1e3 * np.array(next(g["strips_m"] for g in gates() if g["gate_m"] == min(dam.GATES)))
    found = []
    for x, strips in zip(dam.READ_AT, real.T, strict=True):
        mean, spread = map(float, soft[f"height at {1e3 * x:.0f} mm [mm]"].split(" ± "))
        stiff = (float(strips.mean()), float(strips.std(ddof=1)), len(strips))
        found.append(statistics.welch_of(stiff, (mean, spread, dam.STRIPS), LEVEL))
    return found


def softened_table(results: kit.Results) -> kit.Rows:
    return [
        {"x [mm]": round(1e3 * x), "real modulus [mm]": f"{c.mean[0]:.1f} ± {c.spread[0]:.1f}",
         "5 MPa [mm]": f"{c.mean[1]:.1f} ± {c.spread[1]:.1f}", "difference [mm]": round(c.difference, 1),
         "95 % interval, all places at once [mm]":
             f"{c.difference - c.half_width:.1f} to {c.difference + c.half_width:.1f}",
         "significant": "yes" if abs(c.difference) > c.half_width else "no"}
        for x, c in zip(dam.READ_AT, softened(), strict=True)
    ]  # fmt: skip


def draw_softened(results: kit.Results) -> plots.Figure:
    figure, axes = plots.figure(height=3.0)
    found = softened()
    axes.errorbar(1e3 * dam.READ_AT, [c.difference for c in found], [c.half_width for c in found], fmt="o",
                  ms=4, capsize=3, color=plots.SERIES[0])  # fmt: skip
    axes.axhline(0, color="0.3", lw=0.8)
    axes.set(xlabel="x [mm]", ylabel="height, real less softened [mm]")
    return figure


def largest_softened(results: kit.Results) -> kit.Measured:
    found = softened()
    k = max(range(len(found)), key=lambda i: abs(found[i].difference))
    clear = [
        f"{1e3 * x:.0f}" for x, c in zip(dam.READ_AT, found, strict=True) if abs(c.difference) > c.half_width
    ]
    where = (
        f"significant at {', '.join(clear)} mm" if clear else "nowhere significant, all places at once (95 %)"
    )
    return kit.Measured(abs(found[k].difference), note=f"at {1e3 * dam.READ_AT[k]:.0f} mm; {where}")


def _short(kernel: str) -> str:
    """The name of a kernel without what Warp adds to it."""
    return re.sub("_[0-9a-f]{8}$", "", kernel.replace("forward kernel ", "").split("__")[0])


def kernels_table(results: kit.Results) -> kit.Rows:
    total: dict[tuple[str, str], tuple[int, float]] = {}
    for r in recorded()["kernels"]:
        key = (r["precision"], _short(r["kernel"]))
        launches, us = total.get(key, (0, 0.0))
        total[key] = launches + r["launches"], us + r["launches"] * r["us"]
    return [
        {"precision": precision, "kernel": kernel, "launches": launches,
         "us a launch": round(us / launches, 1), "us in all": round(us)}
        for (precision, kernel), (launches, us) in sorted(total.items(), key=lambda kv: (kv[0][0], -kv[1][1]))
    ]  # fmt: skip


def _as_recorded() -> str:
    r, d = recorded(), recorded()["device"]
    return (
        f"Recorded, not run now: {d['date']}, commit {r['commit']}{' with changes' if r['dirty'] else ''},"
        f" {d['name']} (driver {d['driver']}, Warp {d['warp']}), by {d['command']}."
    )


CASE = kit.Case(
    name="gpu",
    title="On a GPU, as recorded",
    purpose=(
        "The CUDA path on a real card, recorded since a report is rarely made beside one: particle-steps per"
        " second against size and precision, beside the codes on a CPU and the bound of the memory; the"
        " experiment's box of 120 000 balls with the modulus that the material has, 650 times that of other"
        " runs, 1 500 000 steps a gate; and what softening changes in the pile at rest. " + _as_recorded()
    ),
    source="tools/gpu, kept in comparisons/recorded/gpu.json; tests on the device: pytest -m gpu.",
    variants=lambda tier: [],
    checks=(),
    findings=(
        kit.Finding(
            "particle-steps/s on the GPU over one core of a CPU, 120 000 flowing balls, mixed", gain, "1",
            "The paper reports 34 for its GPU, against one core of its time.", (),
        ),
        kit.Finding(
            "rate / roofline on the GPU, one million flowing balls, mixed", share, "1",
            "Roofline: what a step must move at least, at the bandwidth of a copy.", (),
        ),
        kit.Finding(
            "real less softened modulus: largest difference of the heights at rest, gate at 200 mm",
            largest_softened, "mm", "Runs with 5 MPa stand for the 3.25 GPa of the experiment.", (),
        ),
    ),
    figures=(
        kit.Figure(
            "Rate against the number of balls", "Flowing beds. Dashed: the recorded bench on a CPU.",
            draw_rates, needs=(),
        ),
        kit.Figure(
            "The experiment's box with its real modulus, at rest",
            "The layer at the front wall, as a camera sees it; line: heights read as in the experiment, dots:"
            " every 100 mm; dotted: the gate.", draw_sides, needs=(),
        ),
        kit.Figure(
            "Real less softened modulus, heights at rest",
            "Gate at 200 mm; eight strips along the depth in each run. The intervals hold for all places at"
            " once (95 %).", draw_softened, needs=(),
        ),
    ),
    tables=(
        kit.Table(
            "Three gates at the real modulus",
            "120 000 balls, 3.25 GPa, 1 500 000 steps of 1 us: 0.5 s before and 1 s after the gate goes. The"
            " paper: the far wall is reached after 0.49 s (measured), 0.54 s (simulated).",
            gates_table, needs=(),
        ),
        kit.Table(
            "Real against softened modulus", "Heights at rest, mean and standard deviation over strips.",
            softened_table, needs=(),
        ),
        kit.Table(
            "Rates on the GPU", "Roofline: bandwidth of a copy / bytes that a step must move.", rates_table,
            needs=(),
        ),
        kit.Table(
            "Kernels on the GPU",
            "One million flowing balls, 100 steps and their rebuilds, launched one by one.",
            kernels_table, needs=(),
        ),
    ),
    features=(),
    order=92,
)  # fmt: skip
