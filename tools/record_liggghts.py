"""LIGGGHTS output of the quick tier, kept in reference/liggghts/recorded for machines without the binary.

    python tools/record_liggghts.py          # run what is missing, remove what no deck of today has
    python tools/record_liggghts.py --all    # run all anew
    python tools/record_liggghts.py --check  # run nothing; exit code 1 if anything is missing or left over

A file is found by the hash of its deck: after a change of a scene or of the deck it is missing.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from comparisons.harness.discover import find_cases
from gpudem.scene import Scene
from reference import liggghts
from reference.errors import CannotState
from reference.liggghts import recorded
from reference.liggghts.deck import render

CODE = "liggghts"
#: Cases of which nothing is kept, and why. Nor is anything of variants with options: these are about times
#: or altered decks.
NOT_KEPT = {
    "liggghts_findings": "it is about the program that is here",
    "extremes": "it is about what the program that is here does at its limits",
    "stable_step": "it is about steps at which a run may end in an error",
    "endurance": "its traces take 25 MB",
}
#: No check reads it.
LEFT_OUT = ("trace.torque",)


def decks() -> dict[str, tuple[str, Scene]]:
    """Hash -> (case and variant, scene) of all decks that are kept."""
    return {
        render(scene).hash: (f"{case} {label}", scene)
        for case, label, scene, options in _variants()
        if case not in NOT_KEPT and not options and _can_be_stated(scene)
    }


def _variants() -> Iterator[tuple[str, str, Scene, dict]]:
    for case in find_cases():
        for variant in case.variants("quick") if "quick" in case.tiers else ():
            if CODE in variant.codes_of((CODE,)):
                yield case.name, variant.label, variant.scene, variant.options.get(CODE, {})


def _can_be_stated(scene: Scene) -> bool:
    try:
        render(scene)
    except CannotState:
        return False
    return True


def kept() -> set[str]:
    """Hashes of what is there."""
    return {path.name.removesuffix(recorded.SUFFIX) for path in recorded.FOLDER.glob(f"*{recorded.SUFFIX}")}


def differences(wanted: dict[str, tuple[str, Scene]]) -> tuple[dict[str, str], set[str]]:
    """(hash -> case and variant of what is missing, hashes of what no deck has)."""
    there = kept()
    return {key: what for key, (what, _) in wanted.items() if key not in there}, there - set(wanted)


def main(arguments: list[str] | None = None) -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--all", action="store_true", help="run all anew")
    parser.add_argument("--check", action="store_true", help="run nothing")
    options = parser.parse_args(arguments)
    wanted = decks()
    missing, left_over = differences(wanted)
    if options.check:
        for line in [
            *(f"missing: {what}" for what in missing.values()),
            *map("left over: {}".format, left_over),
        ]:
            print(line)
        return 1 if missing or left_over else 0
    for key, (what, scene) in wanted.items():
        if options.all or key in missing:
            print(what, flush=True)
            with tempfile.TemporaryDirectory() as folder:
                run = liggghts.run(scene, Path(folder), use_recorded=False)
                recorded.record(run, frame_dtype="float32", leave_out=LEFT_OUT)
    for key in left_over:
        (recorded.FOLDER / f"{key}{recorded.SUFFIX}").unlink()
    size = sum(path.stat().st_size for path in recorded.FOLDER.glob(f"*{recorded.SUFFIX}"))
    print(f"{len(kept())} runs, {size / 1e6:.1f} MB in {recorded.FOLDER}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
