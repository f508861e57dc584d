"""float32 far from the origin: refused or warned of, since positions there cannot hold a step or an overlap.

Around 10 m, two balls of 1 mm that approach at 0.6 m/s with steps of 1 us never meet in float32: x + v dt is
rounded to x. Detects: no word about it; one for `mixed`, whose positions are float64, or near the origin.
"""

import numpy as np
import pytest

from gpudem.driver import simulate
from gpudem.errors import SceneError
from gpudem.scene import Scene


def meeting(origin: float, precision: str, **more) -> Scene:
    """Two balls of 1 mm meet obliquely around (origin, origin, origin) [m]."""
    return Scene(**{
        "name": "meeting", "materials": {"ball": {"young": 5e6, "poisson": 0.34, "density": 1768.0}},
        "pairs": [{"materials": ("ball", "ball"), "restitution": 0.8, "friction": 0.3}],
        "particles": {
            "source": "explicit", "material": "ball", "radius": 0.001,
            "position": [(origin, origin, origin), (origin + 0.00205, origin + 0.0003, origin)],
            "velocity": [(0.3, 0, 0), (-0.3, 0, 0)],
        },
        "domain": {"lo": (origin - 0.1,) * 3, "hi": (origin + 0.1,) * 3},
        "time": {"step": 1e-6, "duration": 1e-3}, "output": {"trace_every": 1e-3},
        "solver": {"precision": precision}, **more,
    })  # fmt: skip


@pytest.mark.parametrize("origin", [1000.0, -2000.0])
def test_overlaps_that_float32_cannot_hold_are_refused(origin):
    with pytest.raises(SceneError, match=r"solver\.precision = 'float32': positions at .* are .* m apart"):
        meeting(origin, "float32")


def test_steps_that_float32_cannot_hold_are_warned_of():
    done = simulate(meeting(10.0, "float32"))
    assert [w for w in done.warnings if w.startswith("solver.precision = 'float32'")]


@pytest.mark.parametrize(("origin", "precision"), [(0.0, "float32"), (1000.0, "mixed"), (1000.0, "float64")])
def test_where_positions_suffice_the_motion_is_that_of_float64(origin, precision):
    """No word, and the rebound of float64 at the origin; 1000 m away to 1e-6 of the speed."""
    exact, done = simulate(meeting(0.0, "float64")).trace, simulate(meeting(origin, precision))
    assert not [w for w in done.warnings if "precision" in w]
    assert exact is not None
    assert done.trace is not None
    bound = 1e-4 if precision == "float32" else 1e-6
    assert np.abs(done.trace["velocity"] - exact["velocity"]).max() < bound * 0.3
    assert exact["velocity"][-1, 0, 0] < 0.2  # they have met
