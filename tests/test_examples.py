"""The example in TOML and in Python is one scene, and runs; so does what README shows."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

from comparisons.cli import app
from gpudem.scene import Scene

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"


def test_both_state_one_scene() -> None:
    names: dict[str, object] = {"__name__": "example"}
    exec(compile((EXAMPLES / "drop.py").read_text(), "drop.py", "exec"), names)
    read = Scene.from_toml(EXAMPLES / "drop.toml")
    assert names["scene"] == read
    assert read.hash == names["scene"].hash


def run_example(name: str, folder: Path) -> str:
    """What examples/NAME prints when it runs in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r}); import runpy;"
         f" runpy.run_path({str(EXAMPLES / name)!r}, run_name='__main__')"],
        cwd=folder, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout


def test_python_example_runs(tmp_path: Path) -> None:
    """It says how high the ball bounces: e^2 of the 50 mm fall, above the radius."""
    said = run_example("drop.py", tmp_path)
    height = float(re.search(r"highest after the first bounce: ([\d.]+) m", said)[1])
    assert abs(height - (0.9**2 * 0.05 + 0.003)) < 2e-4, "a trace each millisecond, apex within 0.5 ms of one"
    assert (tmp_path / "runs" / "drop_py" / "run.pvd").is_file()


def test_vibrated_box_runs(tmp_path: Path) -> None:
    """Catches an example that settles elsewhere than the case does (0.288 m; 20 s scatter by 0.004 m)."""
    said = run_example("vibrated_box.py", tmp_path)
    height = float(re.search(r"mean height: ([\d.]+) m", said)[1])
    assert abs(height - 0.288) < 0.012
    assert (tmp_path / "runs" / "vibrated_box" / "run.pvd").is_file()


def test_readme_runs(tmp_path: Path) -> None:
    """The Python block of README, from the root of a checkout."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 1
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    program = f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{blocks[0]}"
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 2
    assert (tmp_path / "runs" / "drop" / "run.pvd").is_file()


def test_readme_names_what_there_is() -> None:
    """Catches commands, targets and files that README names and that are gone."""
    text = (ROOT / "README.md").read_text()
    targets = re.findall(r"^([a-z-]+):.*##", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"make ([a-z-]+)", text)) <= set(targets)
    assert all((ROOT / path).exists() for path in re.findall(r"\]\(([^):]+)\)", text))
    commands = {name for name in re.findall(r"gpudem ([a-z]+) ", text) if name != "run"}
    assert {"compare", "diff"} <= commands <= set(app.commands)
