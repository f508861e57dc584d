"""Codes and cases for tests of the harness: balls thrown upwards, from the closed form, errors on demand."""

from __future__ import annotations

import dataclasses

import numpy as np

from comparisons.harness import codes as known
from comparisons.harness.case import Case, Check, Figure, Measured, Table, Variant
from comparisons.metrics.trace import observed_order
from comparisons.report import plots, render
from gpudem.errors import GpudemError
from gpudem.output.frames import FrameWriter
from gpudem.output.run import Run, Timing
from gpudem.scene import Scene
from reference.code import Code, never_missing
from reference.errors import CodeMissing

SPEED, G = 1.0, 9.81


def scene(dt: float = 1e-5, balls: int = 3) -> Scene:
    """Balls thrown upwards side by side."""
    x = 0.01 + 0.02 * np.arange(balls)
    return Scene(
        name="throw",
        materials={"glass": {"young": 1e7, "poisson": 0.25, "density": 2500.0}},
        pairs=[{"materials": ("glass", "glass"), "restitution": 0.9, "friction": 0.3}],
        particles={
            "source": "explicit",
            "position": np.stack([x, 0 * x + 0.05, 0 * x + 0.02], axis=1),
            "radius": 0.005,
            "material": "glass",
            "velocity": np.tile([0.0, 0.0, SPEED], (balls, 1)),
        },
        gravity=(0.0, 0.0, -G),
        walls=[
            {"kind": "plane", "name": "floor", "material": "glass", "point": (0, 0, 0), "normal": (0, 0, 1)}
        ],
        domain={"lo": (0, 0, 0), "hi": (0.02 * balls, 0.1, 0.12)},
        time={"step": dt, "duration": 0.05},
        output={"trace_every": 10 * dt},
    )


def exact(scene: Scene, times: np.ndarray) -> np.ndarray:
    """Positions (t, n, 3) [m]."""
    start = scene.state.position[None] + 0 * times[:, None, None]
    start[..., 2] += (SPEED * times - G * times**2 / 2)[:, None]
    return start


def code(name: str, error: float = 0.0, fails: str = "", speed: float = 1e6, error_kind=GpudemError) -> Code:
    """A code that is off by error * dt, or fails with a message."""

    def run(scene, directory, options, progress, extra):
        if fails:
            raise error_kind(fails)
        steps = np.arange(0, scene.n_steps + 1, scene.stride(scene.output.trace_every))
        times = steps * scene.time.step
        position = exact(scene, times) + error * scene.time.step * times[:, None, None]
        velocity = np.gradient(position, times, axis=0)
        writer = FrameWriter(directory, scene)
        for step in (0, scene.n_steps):
            progress(step)
            k = 0 if step == 0 else -1
            n = len(scene.state)
            writer.add(
                step,
                {
                    "id": np.arange(1, n + 1),
                    "material": scene.state.material,
                    "position": position[k],
                    "velocity": velocity[k],
                    "radius": scene.state.radius,
                },
            )
        if name == "liggghts":
            (directory / "deck.in").write_text("# <deck> of a fake\nrun " + str(scene.n_steps) + "\n")
            (directory / "log.liggghts").write_text("log")
        work = len(scene.state) * scene.n_steps
        timing = Timing(
            len(scene.state),
            scene.n_steps,
            work / speed,
            setup_s=0.1,
            compile_s=1.0,
            peak_memory_bytes=90 << 20,
        )
        trace = {"step": steps, "time": times, "position": position, "velocity": velocity}
        made = Run(name, "0.0", scene, directory, timing, trace=trace, notes={"deck_hash": "ab" * 32})
        made.save()
        return made

    missing = (lambda: fails) if error_kind is CodeMissing else never_missing
    return dataclasses.replace(known.CODES[name], run=run, missing=missing)


def codes(**changes) -> dict[str, Code]:
    """Both codes; `gpudem={"fails": "no"}` changes one."""
    default = {"gpudem": {"error": 0.05}, "liggghts": {"error": 0.4, "speed": 2e6}}
    return {name: code(name, **(given | changes.get(name, {}))) for name, given in default.items()}


def worst(results, label: str, who: str) -> float:
    """Largest error of any position [m]."""
    run = results[label, who]
    return float(np.abs(run.trace["position"] - exact(run.scene, run.trace["time"])).max())


def case(name: str = "throw", tolerance: float = 1e-6, order: int = 10) -> Case:
    """A case with each kind of check, figure and table."""
    labels = {f"dt_{dt:g}": dt for dt in (4e-5, 2e-5, 1e-5)}

    def cross(results):
        one, two = (results["dt_1e-05", c].trace["position"] for c in ("gpudem", "liggghts"))
        return float(np.abs(one - two).max())

    def apex(results):
        top = results["dt_1e-05", "gpudem"].trace["position"][..., 2].max() - 0.02
        return Measured(abs(top - 0.03774), top, 0.03774, note="top of the arc within the run")

    def errors(results, who):
        return [worst(results, label, who) for label in labels]

    def draw(results):
        times = results["dt_1e-05", "gpudem"].trace["time"]
        heights = {c: results["dt_1e-05", c].trace["position"][:, 0, 2] for c in results.codes()}
        oracle = exact(scene(), times)[:, 0, 2]
        figure, top, low = plots.curves_and_differences(
            {"height": times}, {"height": (heights, oracle)}, reference="exact"
        )
        top.set_ylabel("height [m]")
        low.set_xlabel("time [s]")
        return figure

    def converge(results):
        figure, axes = plots.figure()
        for c in results.codes():
            axes.loglog(list(labels.values()), errors(results, c), **plots.style(c, marker="o"))
        axes.set(xlabel="time step [s]", ylabel="largest error [m]")
        plots.legend(axes)
        return figure

    def work(results):
        seconds = {c: [results[label, c].timing.stepping_s for label in labels] for c in results.codes()}
        return plots.work_precision(
            {c: (s, errors(results, c)) for c, s in seconds.items()}, ylabel="largest error [m]"
        )

    def piles(results):
        last = {f"{plots.name(c)}, end": results["dt_1e-05", c] for c in results.codes()}
        return render.side_by_side({title: (run.scene, run.frames[-1]) for title, run in last.items()})

    def table(results):
        import pandas

        rows = [(label, c, worst(results, label, c)) for label in labels for c in results.codes(label)]
        return pandas.DataFrame(rows, columns=["variant", "code", "largest error [m]"])

    both = ("gpudem", "liggghts")

    def checks():
        return (
            Check(
                "height, largest error",
                lambda r: worst(r, "dt_1e-05", "gpudem"),
                tolerance,
                "m",
                "closed form",
                "A",
                "first order in the step",
                "a scheme that drops gravity's half step",
            ),
            Check(
                "position, largest difference of the codes",
                cross,
                1e-6,
                "m",
                "LIGGGHTS",
                "X",
                "same scheme",
                "a different start state",
                needs=both,
            ),
            Check("apex", apex, 1e-3, "m", "closed form", "A", "output interval", "gravity of 10"),
            Check(
                "order of convergence",
                lambda r: observed_order(list(labels.values()), errors(r, "gpudem")),
                1.2,
                "1",
                "closed form",
                "A",
                "first order",
                "a step that does not matter",
                lo=0.8,
            ),
        )

    def figures():
        return (
            Figure(
                "Height in time", "Both codes and the closed form; below, their errors.", draw, needs=both
            ),
            Figure("Error against step", "Both fall in proportion.", converge, needs=both),
            Figure("At the end", "Coloured by speed.", piles, needs=both),
            Figure(
                "Error against time", "Each point a time step.", work, needs=both, section="work_precision"
            ),
        )

    return Case(
        name=name,
        title="Balls thrown upwards" if name == "throw" else name.replace("_", " ").capitalize(),
        purpose="Free flight under gravity: the integrator alone, and whether both codes count time alike.",
        source="Elementary mechanics: z = z0 + v t - g t²/2.",
        variants=lambda tier: [Variant(label, scene(dt), timed=True) for label, dt in labels.items()],
        checks=checks(),
        figures=figures(),
        tables=(Table("Errors", "Over the whole flight.", table, needs=both),),
        features=("gravity", "velocity Verlet")
        if name == "throw"
        else ("gravity", "normal hertz", "wall plane"),
        order=order,
    )
