"""Golden decks and recorded run anew after a wanted change of the deck: python -m tests.reference.renew."""

from __future__ import annotations

import tempfile
from pathlib import Path

from reference import liggghts
from reference.liggghts import recorded
from reference.liggghts.deck import render
from tests.reference.scenes import AGREEMENT, recorded_scene
from tests.reference.test_deck import GOLDEN


def main() -> None:
    """Look at `git diff` afterwards: every changed line must be one that was meant."""
    for path in GOLDEN.glob("*.in"):
        path.write_text(render(AGREEMENT[path.stem]()).text)
    with tempfile.TemporaryDirectory() as folder:
        for path in GOLDEN.glob(f"*{recorded.SUFFIX}"):
            path.unlink()
        recorded.record(liggghts.run(recorded_scene(), Path(folder), use_recorded=False), GOLDEN)


if __name__ == "__main__":
    main()
