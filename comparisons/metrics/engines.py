"""Soft and hard spheres from the same starts: do two engines differ by more than chance and softness?"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from comparisons.harness.case import Measured

#: Standard errors of a difference that chance is granted.
SIGMAS = 3.0


def gap(samples: Mapping[str, np.ndarray], a: str, b: str, softness: float = 0.0) -> Measured:
    """Mean a / mean b - 1 by what is allowed: from 0 to the softness, and SIGMAS standard errors beyond.

    Args:
        samples: Engine -> (seeds,) of one quantity; the spread of one seed is pooled over all engines.
        a: One engine.
        b: The other, whose mean is the scale.
        softness: Relative error [1], with its sign, that a contact that takes its time may make at most.
    """
    scale = float(np.mean(samples[b]))
    freedom = sum(len(values) - 1 for values in samples.values())
    squares = sum(float(np.sum((values - np.mean(values)) ** 2)) for values in samples.values())
    spread = (squares / freedom) ** 0.5 / abs(scale)
    chance = SIGMAS * spread * (1 / len(samples[a]) + 1 / len(samples[b])) ** 0.5
    found = float(np.mean(samples[a])) / scale - 1
    low, high = min(softness, 0.0) - chance, max(softness, 0.0) + chance
    value = abs(found - (low + high) / 2) / ((high - low) / 2)
    note = (
        f"{found:+.2%}, allowed {low:+.2%} to {high:+.2%}; a seed scatters by {spread:.2%}"
        f" ({len(samples[a])} and {len(samples[b])} seeds)"
    )
    return Measured(value, float(np.mean(samples[a])), scale, note)
