"""Keep what a check on a GPU found: OUT of check.sh -> comparisons/recorded/gpu.json and gpu_sides.npz.

    python tools/gpu/record.py OUT [TO]

Of the balls at rest the layer at the front wall is kept, for a view from the side; the heights are read here.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.cases.dam_break import scenes as dam
from comparisons.metrics import pile
from gpudem.output.atomic import write_npz, write_text

ROOT = Path(__file__).resolve().parents[2]


def collect(out: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """(what gpu.json holds, the arrays of gpu_sides.npz). Raises OSError: a stage did not run."""

    def read(name: str) -> Any:
        return json.loads((out / name).read_text())

    bench, device, gates, sides = read("bench.json"), read("device.json"), [], {}
    keys = ("state", "particles", "precision", "rate", "moved_bytes", "array_bytes", "repeat")
    for row in read("paper.json"):
        with np.load(out / f"rest_gate_{row['gate_m']}.npz") as file:
            position = file["position"].astype(np.float64)
        radius = np.full(len(position), dam.RADIUS)
        profile = pile.height(position, radius, dam.PROFILE_AT, (0.0, dam.DEPTH))
        strips = dam.strip_heights(position, radius)
        gates.append({**row, "strips_m": strips.round(5).tolist(), "profile_m": profile.round(5).tolist()})
        front = position[:, 1] < 2 * dam.RADIUS
        sides[f"gate_{1e3 * row['gate_m']:.0f}"] = position[front][:, (0, 2)].astype(np.float32)
    commit, *changed = (out / "source.txt").read_text().splitlines()
    return {
        "commit": commit[:7], "dirty": bool(changed), "device": device, "bandwidth": bench["bandwidth"],
        "rates": [{key: row.get(key) for key in keys} for row in bench["rows"]],
        "kernels": read("kernels.json"), "paper": gates,
    }, sides  # fmt: skip


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("to", type=Path, nargs="?", default=ROOT / "comparisons" / "recorded")
    given = parser.parse_args()
    facts, sides = collect(given.out)
    write_text(given.to / "gpu.json", json.dumps(facts, indent=1) + "\n")
    write_npz(given.to / "gpu_sides.npz", sides)
    print(given.to / "gpu.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
