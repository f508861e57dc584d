"""A program of a user, run by the tests in a process of its own: `python -m tests.user_program`.

It has only what gpudem needs itself (the packages of every extra are refused), runs a scene in both engines
and then differentiates a Warp kernel of its own. Prints one line of JSON after what gpudem has printed.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import warp as wp

#: Top-level modules that only the extras bring. (meshio needs rich: it is not among them.)
EXTRAS = {
    "jinja2", "matplotlib", "pyvista", "vtk", "vtkmodules", "click", "psutil", "PIL", "imageio_ffmpeg",
    "pytest", "hypothesis", "selenium",
}  # fmt: skip


class Refuse:
    """An import hook: none of EXTRAS is installed."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> None:
        """Refuse it, or leave it to the other hooks."""
        if name.split(".")[0] in EXTRAS:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


@wp.kernel
def square(x: wp.array[float], y: wp.array[float]):
    i = wp.tid()
    y[i] = x[i] * x[i]


def settings() -> dict[str, str]:
    """All settings of Warp but the cache folder, which Warp itself fills in at its start."""
    names = [k for k in vars(wp.config) if not k.startswith("__") and k != "kernel_cache_dir"]
    return {k: repr(getattr(wp.config, k)) for k in names}


def gradient() -> list[float]:
    """Of the sum of squares at 1, 2, 3."""
    with wp.ScopedLogLevel(wp.LOG_ERROR):  # its module is the user's, and may say that it is loaded
        x = wp.array([1.0, 2.0, 3.0], dtype=float, requires_grad=True, device="cpu")
        y = wp.zeros_like(x)
        with wp.Tape() as tape:
            wp.launch(square, 3, inputs=[x], outputs=[y], device="cpu")
        tape.backward(grads={y: wp.ones_like(y)})
        return x.grad.numpy().tolist()


def main() -> None:
    """Settings before, a run of each engine, gradient, settings after."""
    sys.meta_path.insert(0, Refuse())  # pyright: ignore[reportArgumentType]
    before = settings()
    import gpudem
    from gpudem import event_driven
    from gpudem.output.run import Run
    from gpudem.scene import Domain, Explicit, Material, Output, Pair, Scene, Time

    material = Material(young=1e7, poisson=0.3, density=1000.0)
    scene = Scene(
        name="two",
        materials={"a": material},
        pairs=[Pair(materials=("a", "a"), restitution=0.8)],
        particles=Explicit(
            position=[[0.02, 0.05, 0.05], [0.08, 0.05, 0.05]],
            velocity=[[1.0, 0, 0], [-1.0, 0, 0]],
            radius=0.01,
            material="a",
        ),
        domain=Domain(lo=(0, 0, 0), hi=(0.1, 0.1, 0.1), periodic=(True, True, True)),
        time=Time(step=1e-6, duration=0.04),
        output=Output(frames_every=0.02, history_every=0.02),
    )
    with tempfile.TemporaryDirectory() as folder:
        gpudem.simulate(scene, Path(folder) / "soft")
        soft = Run.load(Path(folder) / "soft")
        hard = event_driven.run(scene, Path(folder) / "hard")
        kinetic = [float(run.history.kinetic_energy.iloc[-1]) for run in (soft, hard)]
        frames = len(soft.frames[-1]["position"]), len(hard.frames[-1]["position"])
    start = 2 * 0.5 * material.density * 4 / 3 * 3.141592653589793 * 0.01**3
    found = {
        "gradient": gradient(),
        "changed": [name for name, value in settings().items() if before[name] != value],
        "kinetic": [energy / start for energy in kinetic],
        "particles": frames,
        "extras": sorted(EXTRAS & {name.split(".")[0] for name in sys.modules}),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
