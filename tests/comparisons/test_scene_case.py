"""A scene of the user as a case: codes that are gpudem with one thing changed stand for other codes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from comparisons import cli
from comparisons.harness import codes, execute
from comparisons.harness.case import Results
from comparisons.metrics import statistics
from comparisons.scene_case import analysis, build, headline
from comparisons.scene_case import plan as plans
from gpudem import driver
from gpudem.errors import GpudemError
from gpudem.scene import Scene
from reference.code import Code
from reference.errors import CannotState, CodeMissing

pytestmark = pytest.mark.long

SCENES = Path(__file__).parent / "scenes"


def hit(**changes) -> Scene:
    """A spinning ball flies, hits a floor with friction, and leaves it: some 600 steps."""
    scene = {
        "name": "hit",
        "materials": {
            "glass": {"young": 1e7, "poisson": 0.25, "density": 2500.0},
            "steel": {"young": 5e7, "poisson": 0.3, "density": 7800.0},
        },
        "pairs": [
            {"materials": ("glass", "glass"), "restitution": 0.9, "friction": 0.1},
            {"materials": ("glass", "steel"), "restitution": 0.8, "friction": 0.2},
        ],
        "particles": {
            "source": "explicit",
            "position": [[0.02, 0.02, 0.006], [0.05, 0.021, 0.03]], "radius": 0.005, "material": "glass",
            "velocity": [[0.6, 0.0, -0.6], [0.0, 0.0, 0.0]],
            "angular_velocity": [[0.0, 30.0, 5.0], [0, 0, 0]],
        },
        "gravity": (0.0, 0.0, -9.81),
        "walls": [
            {"kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, 0), "normal": (0, 0, 1)}
        ],
        "domain": {"lo": (0.0, 0.0, 0.0), "hi": (0.1, 0.05, 0.1)},
        "time": {"step": 1e-5, "duration": 0.006},
    }  # fmt: skip
    return Scene(**{**scene, **changes})


def beside(change, name="other") -> Code:
    """A reference code that runs gpudem on a changed scene and gives the result for the scene."""

    def run(scene, directory, options, progress, extra):
        made = driver.simulate(change(scene), directory, threads=1, progress=progress)
        return dataclasses.replace(made, code=name, scene=scene)

    return Code(name, "Other", run, role="reference", unit="core")


def pair(scene: Scene, **properties) -> Scene:
    """The scene with other properties of the pair glass / steel."""
    pairs = [p.model_dump() for p in scene.pairs]
    pairs[-1] |= properties
    return scene.replace(pairs=pairs)


@pytest.fixture
def compare(tmp_path, monkeypatch):
    """compare(scene, other, ...) -> (sentence, comparison)."""

    def run(scene, other=None, **options):
        known = {"gpudem": codes.CODES["gpudem"], **({other.name: other} if other else {})}
        monkeypatch.setattr(codes, "CODES", known)
        case = dataclasses.replace(build.of_scene(scene, "mine", "a test", **options), figures=())
        settings = codes.Options(threads=1)
        folder = tmp_path / f"run_{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        comparison = execute.Session([case], folder, options=settings).run()
        assert not comparison.broken()
        return comparison.cases[0].headline, comparison

    return run


def rounded(scene: Scene) -> Scene:
    """The scene with another rounding of its positions."""
    return plans.perturbed(scene, plans.rounding(scene) / 4, 77)


def test_an_equal_code_agrees_to_the_end(compare):
    """Detects: an accusation of rounding; a comparison of which nothing is evaluated."""
    sentence, comparison = compare(hit(), beside(rounded))
    assert sentence.startswith("gpudem and Other agree to rounding in the whole run of 0.006 s")
    assert comparison.counts()["fail"] == comparison.counts()["error"] == 0
    agreed = next(c for c in comparison.checks if c.name.startswith("positions and speeds"))
    assert agreed.status == "pass"
    assert "601 times" in agreed.note


FRICTION = "tangential force at the friction limit between particle 1 and wall floor"
DAMPING = "normal force and tangential force between particle 1 and wall floor"
FOREIGN = "tangential force at the friction limit, in Other that of glass / glass, between particle 1"
CONTACT = "missing contact (neighbor list or wall list) between particle 1 and wall floor"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda s: pair(s, friction=0.21), FRICTION),
        (lambda s: pair(s, friction=0.1), FOREIGN),
        (lambda s: pair(s, restitution=0.79), DAMPING),
        (lambda s: s.replace(gravity=(0, 0, -9.81 * (1 + 1e-6))), "force without a contact of particle"),
        (lambda s: s.replace(walls=()), CONTACT),
        (lambda s: s.replace(contact={"tangential_damping": False}), "tangential force at the first touch"),
        (
            lambda s: pair(s.replace(contact={"rolling": "cdt"}), rolling_friction=1e-3),
            "torque between particle 1",
        ),
    ],
    ids=["friction", "other pair", "damping", "gravity", "contact", "dashpot", "rolling"],
)
def test_a_wrong_code_is_told_where_it_separates(compare, change, said):
    """Detects: a defect of a law, of the gravity or of a list that the sentence does not name."""
    scene = hit(allow=("speed",), domain={"lo": (0, 0, -0.1), "hi": (0.1, 0.05, 0.1)})
    sentence, comparison = compare(scene, beside(change))
    assert "earlier than rounding explains" in sentence
    assert said in sentence
    assert comparison.exit_code() == 1


def test_a_scene_that_the_other_code_cannot_state(compare):
    """Detects: an error, or silence, where one code is left out."""

    def refuse(scene):
        raise CannotState("Other cannot state this scene:\n  - walls.slope: tilted\n  - another")

    sentence, comparison = compare(hit(), beside(refuse))
    assert "Other is left out (walls.slope: tilted and 1 more)" in sentence
    assert "gpudem ran without another code to compare with; half the step changes positions" in sentence
    assert comparison.exit_code() == 0

    def missing(scene):
        raise CodeMissing("Other is not installed: get it")

    sentence, comparison = compare(hit(), beside(missing))
    assert "Other is left out (Other is not installed: get it)" in sentence
    assert comparison.exit_code() == 0


def test_a_code_without_forces_is_judged_by_its_motion(compare):
    """Detects: a claim on forces that nobody wrote; an error where columns are missing."""

    def bare(change):
        code = beside(change)

        def run(*arguments):
            made = code.run(*arguments)
            assert made.trace is not None
            kept = {k: v for k, v in made.trace.items() if k not in ("force", "torque")}
            return dataclasses.replace(made, trace=kept)

        return dataclasses.replace(code, run=run)

    assert "agree to rounding in the whole run" in compare(hit(), bare(lambda s: s))[0]
    sentence, _ = compare(hit(), bare(lambda s: pair(s, friction=0.21)))
    assert "motion in a contact between particle 1 and wall floor at 0.0016" in sentence
    assert "forces are not written" in sentence


def test_a_code_in_another_scheme_is_not_accused(compare):
    """Detects: a code whose scheme differs, and that says so, called wrong."""

    def run(scene, directory, options, progress, extra):
        made = driver.simulate(scene, directory, threads=1, integrator="path", progress=progress)
        return dataclasses.replace(
            made, code="mine", scene=scene, notes={"scheme": "path", "time_step": 1e-5}
        )

    sentence, comparison = compare(hit(), Code("mine", "Mine", run))
    assert "Mine and gpudem are not judged particle by particle (agreement step by step is" in sentence
    assert "separate" not in sentence
    assert comparison.exit_code() == 0


def test_a_failed_code_is_an_error(compare):
    """Detects: a crash that is shown as agreement."""

    def crash(scene):
        raise GpudemError("it broke")

    sentence, comparison = compare(hit(), beside(crash))
    assert (
        "; Other failed (it broke); 3 of 8 checks of conservation and sanity could not be evaluated"
        in sentence
    )
    assert comparison.exit_code() == 3


def test_an_unsound_scene_is_said_to_be(compare):
    """Detects: overlaps of half a radius that no sentence mentions."""
    soft = {"glass": {"young": 3e4, "poisson": 0.25, "density": 2500.0}}
    scene = hit(materials={**hit().model_dump()["materials"], **soft})
    assert "not sound: largest overlap / radius (gpudem)" in compare(scene)[0]


GAS = {
    "source": "lattice", "material": "glass", "count": 27, "lo": (0, 0, 0), "hi": (0.033, 0.033, 0.033),
    "radius": 0.005, "spacing": 1.1, "velocity_rms": 0.8, "seed": 3,
}  # fmt: skip


def gas(duration: float = 0.08) -> Scene:
    """Elastic balls in a periodic box: rounding grows tenfold every few milliseconds."""
    return hit(
        pairs=[{"materials": ("glass", "glass")}], particles=GAS, walls=(), gravity=(0.0, 0.0, 0.0),
        domain={"lo": (0, 0, 0), "hi": (0.033, 0.033, 0.033), "periodic": (True, True, True)},
        time={"step": 2e-5, "duration": duration},
    )  # fmt: skip


def test_after_the_horizon_distributions_over_seeds(compare):
    """Detects: chaos called a defect; a changed law that only the distributions show and that is missed."""
    sentence, comparison = compare(gas(), beside(lambda s: s.replace(solver={"skin": 2.5e-3})))
    assert "agree to rounding until 0.0" in sentence
    assert "rounding differences grow tenfold every 0.0" in sentence
    assert "after that no significant difference in" in sentence
    assert {r.variant for r in comparison.runs} >= {"seed_1", "seed_5"}
    table = next(a for a in comparison.cases[0].artefacts if a.title == "Distributions")
    assert table.status == "ok"


def test_the_intervals_of_the_trace():
    """Detects: memory without bound; a run of another length than the scene's."""
    plan = plans.make(gas(2.0), 5, False)
    assert plan.scene.n_steps == 100_000
    assert plan.times * 27 * plans.ENTRY * (plans.ROUNDING_RUNS + 4) <= plans.TRACE_MEMORY
    assert plan.stride == 8
    frames = hit(output={"frames_every": 0.004})
    assert plans.make(frames, 5, False).scene.n_steps == frames.n_steps == 800


def test_a_perturbed_start():
    """Detects: a perturbation of another size, or one that leaves the plane of a plane motion."""
    scene = hit()
    moved = plans.perturbed(scene, 1e-9, 1).state
    shift = np.abs(moved.position - scene.state.position)
    assert 1e-10 < shift.max() <= 1e-9
    assert np.array_equal(moved.velocity, scene.state.velocity)
    flat = hit(
        particles={
            "source": "explicit",
            "position": [[0.02, 0.02, 0.02], [0.04, 0.02, 0.03]],
            "radius": 0.005,
            "material": "glass",
        }
    )
    shift = plans.perturbed(flat, 1e-9, 1).state.position - flat.state.position
    assert not shift[:, 1].any()
    assert shift[:, [0, 2]].all()


def test_steps_and_precisions(compare):
    """Detects: a ladder without a reference; an error that does not fall with the step."""
    _, comparison = compare(hit(), work_precision=True)
    table = next(a for a in comparison.cases[0].artefacts if a.title == "Steps and precisions")
    assert table.status == "ok", table.why
    assert {r.variant for r in comparison.runs} >= {"step_1_float32", "step_0.0625_float64"}


def test_rounding_that_allows_no_comparison(compare, monkeypatch):
    """Detects: agreement until 0 s called agreement."""
    monkeypatch.setattr(analysis, "LIMIT", 1e-16)
    sentence, comparison = compare(hit(), beside(lambda s: s.replace(solver={"skin": 2.5e-3})))
    first = next(c for c in comparison.checks if c.name.startswith("positions and speeds"))
    assert first.status == "left_out"
    assert sentence.startswith("rounding allows no comparison of gpudem and Other particle by particle; ")


def test_files_and_names_at_the_command_line(tmp_path, monkeypatch, capsys):
    """Detects: a scene taken for the name of a case, two scenes of one name, a file that is not there."""
    monkeypatch.chdir(tmp_path)
    text = (SCENES / "stiff_pair.toml").read_text().replace("duration = 0.003", "duration = 1e-5")
    (tmp_path / "one.toml").write_text(text)
    (tmp_path / "two.json").write_text(Scene.from_toml(tmp_path / "one.toml").to_json())
    made = build.from_files(["one.toml", "two.json"], ["stiff_pair"])
    assert [case.name for case in made] == ["stiff_pair_2", "stiff_pair_3"]
    assert build.is_scene("missing.toml")
    assert not build.is_scene("head_on")
    assert cli.main(["compare", "missing.toml", "-q"]) == 2
    assert "no such file" in capsys.readouterr().err
    assert cli.main(["compare", "one.toml", "--against", "yade", "-q"]) == 2
    assert "--against: no code 'yade'" in capsys.readouterr().err
    assert cli.main(["compare", "head_on", "--work-precision", "-q"]) == 2
    assert "are for scene files, and none is given" in capsys.readouterr().err


@pytest.mark.liggghts
def test_a_scene_through_liggghts(tmp_path, capsys):
    """Detects: the command without its sentence; a scene for which the two codes do not agree."""
    out = str(tmp_path / "out")
    scene = tmp_path / "pair.toml"
    scene.write_text(
        (SCENES / "stiff_pair.toml").read_text().replace("duration = 0.003", "duration = 0.0008")
    )
    assert cli.main(["compare", str(scene), "--out", out, "-q"]) == 0
    found = capsys.readouterr().out
    assert "stiff_pair: gpudem and LIGGGHTS agree to rounding in the whole run of 0.0008 s" in found
    assert "agree to rounding" in (tmp_path / "out" / "report.html").read_text()


def test_a_denser_run_finds_where_codes_separate(compare, monkeypatch):
    """Detects: a coarse trace that leaves the first difference between two far times."""
    monkeypatch.setattr(plans, "TRACE_MEMORY", 60 * 2 * plans.ENTRY * (plans.ROUNDING_RUNS + 4))
    sentence, comparison = compare(hit(), beside(lambda s: pair(s, friction=0.21)))
    assert {r.variant for r in comparison.runs} >= {"dense"}
    assert FRICTION in sentence
    table = next(a for a in comparison.cases[0].artefacts if a.title == "Comparison particle by particle")
    assert table.status == "ok"


def test_the_sentence_on_distributions():
    """Detects: a significant difference that the sentence hides, or one of chance that it reports."""
    scene_plan = plans.make(gas(), 5, False)
    one, two = np.array([1.0, 1.1, 0.9, 1.05, 0.95]), np.array([2.0, 2.1, 1.9, 2.05, 1.95])
    runs: dict = {(f"seed_{k}", code): None for k in range(1, 6) for code in ("gpudem", "liggghts")}

    def said(p: float) -> str:
        found = {"kinetic energy, mean [J]": dataclasses.replace(statistics.welch(one, two), corrected=p)}
        results = Results("quick", runs, {("distributions", "gpudem", "liggghts"): found})
        return headline.after(scene_plan, results, "gpudem", "liggghts")

    assert said(0.008).startswith(
        "a significant difference over 5 seeds in 1 of 1 metrics, first of all kinetic"
    )
    assert "1 against 2 (corrected p = 0.008)" in said(0.008)
    del runs["seed_3", "liggghts"]
    assert said(0.3) == "nothing is compared, since runs over seeds are missing"
    runs["seed_3", "liggghts"] = None
    assert said(0.3).startswith("no significant difference in 1 metrics over 5 seeds (p > 0.01; differences")


LIFT = {
    "kind": "plane", "name": "floor", "material": "steel", "point": (0, 0, 0), "normal": (0, 0, 1),
    "motion": [{"type": "linear", "velocity": (0, 0, 0.3)}],
}  # fmt: skip


def test_energy_that_walls_bring(compare):
    """A ball that a rising floor hits: its energy grows by the work of the floor, which each code tells.

    Detects: the work of walls left out of the balance, or with its sign turned; contacts with the floor
    looked for at its first place; a code that does not tell the work passed as one that conserves energy.
    """
    elastic = [{"materials": ("glass", "steel"), "restitution": 1.0, "friction": 0.0}]
    elastic += [{"materials": ("glass", "glass"), "restitution": 1.0, "friction": 0.0}]
    scene = hit(pairs=elastic, walls=(LIFT,))
    balance = "energy with that of overlaps less the work of walls: largest change / largest kinetic energy"

    def telling(change) -> Code:
        def run(scene, directory, options, progress, extra):
            made = driver.simulate(scene, directory, threads=1, progress=progress)
            return dataclasses.replace(made, code="other", history=change(made.history))

        return Code("other", "Other", run, role="reference", unit="core")

    def judged(change) -> dict:
        _, comparison = compare(scene, telling(change))
        return {c.name: c for c in comparison.checks if c.name.startswith(balance)}

    found = judged(lambda table: table)
    assert [c.status for c in found.values()] == ["pass", "pass"]
    assert all((c.value or 0.0) < 0.01 for c in found.values())
    assert found[f"{balance} (gpudem)"].note.startswith("60 times")
    assert "work of walls 0." in found[f"{balance} (Other)"].note
    turned = judged(lambda table: table.assign(work_floor=-table.work_floor))[f"{balance} (Other)"]
    assert turned.status == "fail"
    assert (turned.value or 0.0) > 0.5
    silent = judged(lambda table: table.drop(columns="work_floor"))[f"{balance} (Other)"]
    assert silent.status not in ("pass", "fail")
    assert "does not tell the work of wall 'floor'" in silent.why


def test_energy_that_groups_bring(compare):
    """A ball that hits another one which is moved: its energy grows by the work of the group.

    Detects: the work of groups left out of the balance, the energy of particles with a motion counted in it.
    """
    elastic = [{"materials": pair, "restitution": 1.0, "friction": 0.0}
               for pair in (("glass", "steel"), ("glass", "glass"))]  # fmt: skip
    swing = {"type": "oscillate", "amplitude": (0.0, 0.0, 0.002), "period": 0.02}
    balls = {"source": "explicit", "position": [(0.02, 0.02, 0.01), (0.021, 0.02, 0.0204)], "radius": 0.005,
             "material": "glass", "velocity": [(0, 0, 0), (0, 0, -0.2)]}  # fmt: skip
    group = {"name": "pusher", "ids": [1], "motion": [swing]}
    _, comparison = compare(hit(pairs=elastic, walls=(), particles=balls, groups=[group]))
    balance = "energy with that of overlaps less the work of walls: largest change / largest kinetic energy"
    found = [c for c in comparison.checks if c.name.startswith(balance)]
    assert found
    assert all(c.status == "pass" and (c.value or 0.0) < 0.01 for c in found)
    assert "work of walls and groups 0.00" in found[0].note


RAIN = {
    "kind": "list", "time": [0.0005, 0.0005, 0.0045], "radius": 0.002, "material": "ball",
    "position": [(0.01, 0.01, 0.015), (0.016, 0.01, 0.015), (0.0101, 0.01, 0.015)],
    "velocity": [(0.0, 0, -1.0)] * 3,
}  # fmt: skip


def rain(**changes) -> Scene:
    data = {
        "name": "rain", "materials": {"ball": {"young": 5e7, "poisson": 0.3, "density": 2500.0}},
        "pairs": [{"materials": ("ball", "ball"), "restitution": 0.7, "friction": 0.4}],
        "insert": [RAIN], "gravity": (0, 0, -9.81),
        "walls": [{"kind": "box", "name": "box", "material": "ball"}],
        "domain": {"lo": (0, 0, 0), "hi": (0.02, 0.02, 0.02)}, "time": {"step": 2e-6, "duration": 0.02},
    }  # fmt: skip
    return Scene(**{**data, **changes})


def test_the_sentence_while_particles_come():
    """Detects: a test of distributions of states that are still being filled."""
    late = rain(insert=[{**RAIN, "time": [0.0005, 0.0005, 0.018]}])
    runs: dict = {(f"seed_{k}", code): None for k in range(1, 6) for code in ("gpudem", "liggghts")}
    said = headline.after(plans.make(late, 5, False), Results("quick", runs, {}), "gpudem", "liggghts")
    assert said == "nothing is compared, since particles are inserted until the end of the run"


def test_particles_that_come(compare):
    """Detects: NaN of particles that have not come taken for a difference, for equality or for energy."""
    sentence, comparison = compare(rain(), beside(lambda scene: scene))
    assert "agree to rounding in the whole run of 0.02 s" in sentence
    bad = [c.name for c in comparison.checks if c.status not in ("pass", "left_out")]
    assert not bad
    late = {**RAIN, "time": [0.0005, 0.0005, 0.0046]}
    sentence, comparison = compare(rain(), beside(lambda scene: scene.replace(insert=[late])))
    assert "separate earlier than rounding explains" in sentence


@pytest.mark.slow
def test_particles_that_leave(compare):
    """Detects: NaN of particles that have left taken for a difference, for equality, for a broken run."""
    box = {"kind": "box", "name": "box", "material": "ball", "sides": ["xlo", "ylo", "yhi", "zlo", "zhi"]}
    domain = {"lo": (0, 0, 0), "hi": (0.02, 0.02, 0.02), "sides": {"xhi": "outflow"}}
    scene = rain(walls=[box], domain=domain, gravity=(100.0, 0, -9.81))
    assert analysis.no_last_state(plans.make(scene, 5, False)) == "particles leave"
    sentence, comparison = compare(scene, beside(lambda scene: scene))
    assert "agree to rounding in the whole run of 0.02 s" in sentence
    assert [c.name for c in comparison.checks if c.status not in ("pass", "left_out")] == []
    other = beside(lambda scene: scene.replace(solver={"skin": 2 * scene.skin}))
    sentence, comparison = compare(scene, other)
    assert "separate earlier than rounding explains" in sentence
