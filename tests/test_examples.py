"""The README's scene, in TOML and in Python, is what examples/ holds, is one scene, and runs."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from gpudem.scene import Scene

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"


def block(language: str) -> str:
    """The README's only code block in a language."""
    blocks = re.findall(rf"```{language}\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 1
    return blocks[0]


def test_readme_shows_the_files() -> None:
    assert block("toml") == (EXAMPLES / "drop.toml").read_text()
    assert block("python") == (EXAMPLES / "drop.py").read_text()


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


def test_readme_shows_real_messages(tmp_path: Path) -> None:
    """The error message in the README is what the program says."""
    text = (EXAMPLES / "drop.toml").read_text()
    text = text.replace("young = 3.25e7", "young = 3.25").replace(
        '"polystyrene"\n\n[[walls]]', '"acryl"\n\n[[walls]]'
    )
    text = text.replace("duration = 0.3", "duration = 0.3\ndurration = 1")
    (tmp_path / "scene.toml").write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "comparisons", "validate", str(tmp_path / "scene.toml")],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 2
    shown = re.search(
        r"\$ gpudem validate scene.toml\n(.*?)\n\n", (ROOT / "README.md").read_text(), re.DOTALL
    )
    expected = re.sub(r"^    ", "", shown[1], flags=re.MULTILINE)
    assert done.stderr.strip() == expected.replace("scene.toml", str(tmp_path / "scene.toml")).strip()
