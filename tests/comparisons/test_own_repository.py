"""pytest in a repository of somebody else, with a case and a code of its own, as a process of its own.

Catches: a plug-in that needs a file of tests, finds neither case nor code, writes two reports or none, hides
a check that fails, or takes part where nobody asked for it.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]

#: A code of theirs: free fall by its closed form, for any scene.
CODE = """
import numpy as np
from gpudem.output.run import Run, Timing
from reference.code import Code

def fall(scene, directory, options, progress, extra):
    steps = np.arange(0, scene.n_steps + 1, scene.stride(scene.output.trace_every))
    t = (steps * scene.time.step)[:, None, None]
    v = scene.state.velocity + np.array(scene.gravity) * t
    x = scene.state.position + scene.state.velocity * t + np.array(scene.gravity) * t**2 / 2
    trace = {"step": steps, "time": t[:, 0, 0], "position": x, "velocity": v}
    run = Run("mine", "1.0", scene, directory, Timing(1, scene.n_steps, 1e-3), trace=trace)
    run.save()
    return run

CODE = Code("mine", "Mine", fall)
"""
#: A case of theirs: one check holds, one does not.
CASE = """
import numpy as np
from comparisons.harness.case import Case, Check, PerCode, Variant
from gpudem.scene import Scene

def variants(tier):
    return [Variant("one", Scene(
        name="fall", gravity=(0, 0, -9.81),
        materials={"glass": {"young": 1e7, "poisson": 0.25, "density": 2500.0}},
        pairs=[{"materials": ("glass", "glass"), "restitution": 0.9}],
        particles={"source": "explicit", "position": [[0.05, 0.05, 0.09]], "radius": 5e-3,
                   "material": "glass"},
        domain={"lo": (0, 0, 0), "hi": (0.1, 0.1, 0.1)},
        time={"step": 1e-5, "duration": 0.05}, output={"trace_every": 1e-3},
    ))]

def checks(code):
    def speed(results):
        return abs(results["one", code].trace["velocity"][-1, 0, 2] + 9.81 * 0.05)
    return (
        Check(f"speed ({code})", speed, 1e-12, "m/s", "v = g t", "A", "rounding", "gravity of 10", (code,)),
        Check(f"wrong ({code})", lambda r: 1.0, 0.5, "1", "nobody", "A", "none", "the moon", (code,)),
    )

CASE = Case("fall", "A ball falls", "Gravity.", "Galileo", variants, checks=(PerCode(checks),))
"""


@pytest.fixture
def repository(tmp_path):
    """An empty repository with a package of cases; run(*arguments) runs pytest in it."""
    package = tmp_path / "repository" / "my_cases"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "fall.py").write_text(CASE)
    (package / "mine.py").write_text(CODE)
    plugin = tmp_path / "site" / "installed_gpudem-1.dist-info"  # as pip leaves it, for this tree
    plugin.mkdir(parents=True)
    (plugin / "METADATA").write_text("Metadata-Version: 2.1\nName: installed-gpudem\nVersion: 1\n")
    (plugin / "entry_points.txt").write_text("[pytest11]\ngpudem = comparisons.pytest_plugin\n")

    def run(*arguments, code=0):
        path = os.pathsep.join([str(ROOT), str(plugin.parent)])
        environment = {**os.environ, "PYTHONPATH": path, "GPUDEM_NO_RENDER": "1"}
        environment.pop("PYTEST_ADDOPTS", None)
        done = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-rA", *arguments],
            cwd=package.parent, env=environment, capture_output=True, text=True, timeout=120,
        )  # fmt: skip
        assert done.returncode == code, done.stdout + done.stderr
        return done.stdout + done.stderr

    return run


def results(folder):
    return json.loads((folder / "results.json").read_text())


def test_checks_are_tests_without_any_test_file(repository, tmp_path):
    text = repository(
        "--gpudem-cases", "my_cases", "--gpudem-code", "mine", "--gpudem-out", "report", "--gpudem-jobs", "1",
        code=1,
    )  # fmt: skip
    assert "PASSED gpudem::fall: speed (mine)" in text
    assert "PASSED gpudem::fall: runs and is shown" in text
    assert "1, allowed: \u2264 0.5, against nobody; it would catch: the moon" in text
    assert "1 failed, 2 passed" in text
    report = tmp_path / "repository" / "report"
    assert f"report: {report / 'report.html'}" in text
    assert "A ball falls" in (report / "report.html").read_text()
    assert [(c["name"], c["status"]) for c in results(report)["checks"]] == [
        ("speed (mine)", "pass"), ("wrong (mine)", "fail"),
    ]  # fmt: skip
    assert results(report)["codes"] == ["mine"]
    assert [timing["shared"] for timing in results(report)["timings"]] == [False]


def test_runs_go_side_by_side(repository, tmp_path):
    """Detects workers of the plug-in that do not find the repository's cases; with one job see above."""
    text = repository(
        "--gpudem-cases", "my_cases", "--gpudem-code", "mine", "--gpudem-out", "report", "--gpudem-jobs",
        "2", code=1,
    )  # fmt: skip
    assert "1 failed, 2 passed" in text
    assert "main process" not in text
    found = results(tmp_path / "repository" / "report")
    assert found["notices"] == []
    assert [timing["shared"] for timing in found["timings"]] == [True]


def test_cases_and_codes_by_entry_points_beside_tests_of_theirs(repository, tmp_path):
    info = tmp_path / "site" / "their_cases-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-cases\nVersion: 1\n")
    entries = "[gpudem.cases]\ntheirs = my_cases\n[gpudem.codes]\nmine = my_cases.mine:CODE\n"
    (info / "entry_points.txt").write_text(entries)
    (tmp_path / "repository" / "test_theirs.py").write_text("def test_of_theirs(): pass\n")
    text = repository("--gpudem-case", "fall", "--gpudem-code", "mine", "-k", "speed or theirs")
    assert "2 passed, 2 deselected" in text
    assert (tmp_path / "repository" / "runs" / "latest" / "report.html").is_file()


@pytest.mark.parametrize("how", [(), ("--dist", "loadscope")], ids=["load", "loadscope"])
def test_with_several_workers_there_is_one_report(repository, tmp_path, how):
    (tmp_path / "repository" / "test_theirs.py").write_text(
        "import pytest\n@pytest.mark.parametrize('k', range(6))\ndef test_of_theirs(k): pass\n"
    )
    selected = ("--gpudem-cases", "my_cases", "--gpudem-code", "mine", "--gpudem-out", "report")
    text = repository("-n", "2", *how, *selected, code=1)
    assert "1 failed, 8 passed" in text
    assert text.count("report.html") == 1
    assert len(results(tmp_path / "repository" / "report")["checks"]) == 2


def test_it_is_quiet_where_it_is_not_used(repository, tmp_path):
    (tmp_path / "repository" / "test_theirs.py").write_text(
        "import sys\n\ndef test_of_theirs(pytestconfig):\n"
        "    assert pytestconfig.pluginmanager.hasplugin('gpudem')\n"
        "    ours = {m for m in sys.modules if m.split('.')[0] in ('gpudem', 'reference', 'comparisons')}\n"
        "    assert ours == {'comparisons', 'comparisons.pytest_plugin'}\n"
        "    assert not {'numpy', 'warp', 'pydantic'} & set(sys.modules)\n"
    )
    text = repository("--strict-markers")
    assert "1 passed" in text
    assert "gpudem" not in re.sub("^plugins:.*", "", text, flags=re.M)
    assert "unrecognized arguments: --gpudem-case" in repository(
        "-p", "no:gpudem", "--gpudem-case", "fall", code=4
    )


def test_a_scene_and_a_code_behind_a_command(repository, tmp_path):
    """What is collected; the comparison of a scene and the running of a command have tests of their own."""
    shutil.copy(ROOT / "examples" / "drop.toml", tmp_path / "repository" / "my.toml")
    text = repository(
        "--collect-only", "-q", "--gpudem-scene", "my.toml", "--gpudem-code", "gpudem",
        "--gpudem-with", "python my_dem.py {scene} {out}",
    )  # fmt: skip
    assert "gpudem::drop: runs and is shown" in text
    assert re.search("gpudem::drop: .*own_code", text)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--gpudem-case", "head_no"), "gpudem: no case 'head_no'; did you mean 'head_on'?"),
        (("--gpudem-cases", "no_such"), "gpudem: cases 'no_such': does not load: ModuleNotFoundError"),
        (("--gpudem-case", "head_on", "--gpudem-code", "yade"), "gpudem: no code 'yade'"),
        (("--gpudem-case", "head_on", "--gpudem-tier", "huge"), "--gpudem-tier huge: choose from quick"),
        (
            ("--gpudem-case", "head_on", "--gpudem-jobs", "0"),
            "--gpudem-jobs 0: a whole number from 1 on is needed",
        ),
    ],
    ids=["case", "package", "code", "tier", "jobs"],
)
def test_a_mistake_is_one_line(repository, arguments, message):
    lines = [line for line in repository(*arguments, code=4).splitlines() if line]
    assert len(lines) == 1
    assert message in lines[0]
