"""The wheel, built, installed into an environment of its own and used in an empty folder.

Catches: data of the package that is not in the wheel (templates, schemas, records), a command or a plug-in
that is not installed, and anything that reads the source tree.
"""

from __future__ import annotations

import json
import os
import shutil
import site
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
PACKAGES = ("gpudem", "reference", "comparisons")


def run(*command: object, cwd: Path, code: int = 0) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTEST_ADDOPTS")}
    done = subprocess.run(
        [*map(str, command)], cwd=cwd, env=environment, capture_output=True, text=True, timeout=280
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    source = tmp_path_factory.mktemp("source")
    for name in PACKAGES:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    pip = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation")
    run(*pip, "-w", source / "dist", source, cwd=source)
    return next((source / "dist").glob("*.whl"))


@pytest.fixture(scope="module")
def programs(wheel, tmp_path_factory) -> Path:
    """The programs of a new environment with the wheel; other packages are those of this environment."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, with_pip=False)
    folder = next((home / "lib").glob("python*")) / "site-packages"
    (folder / "shared.pth").write_text("\n".join(site.getsitepackages()))
    run(sys.executable, "-m", "pip", "--python", home / "bin" / "python", "install", "-q", "--no-deps", wheel,
        "--force-reinstall", "--prefix", home, cwd=home)  # fmt: skip
    return home / "bin"


def test_every_file_of_the_packages_is_in_it(wheel):
    held = set(zipfile.ZipFile(wheel).namelist())
    files = {
        path.relative_to(ROOT).as_posix()
        for name in PACKAGES
        for path in (ROOT / name).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.name != "README.md"
    }
    assert len(files) > 200
    assert files <= held


def test_it_compares_in_an_empty_folder(programs, tmp_path):
    where = run(programs / "python", "-c", "import comparisons; print(comparisons.__file__)", cwd=tmp_path)
    assert str(programs.parent) in where
    text = run(
        programs / "gpudem", "compare", "head_on", "--codes", "gpudem", "-q", "--out", "c", cwd=tmp_path
    )
    assert " 0 fail, 0 error" in text
    results = json.loads((tmp_path / "c" / "results.json").read_text())
    assert results["checks"]
    assert results["provenance"]["commit"] == "unknown"
    run(programs / "gpudem", "report", "c", cwd=tmp_path)
    assert "0 for the worse" in run(programs / "gpudem", "diff", "c", "c", cwd=tmp_path)
    for name in ("scene", "run", "results"):
        assert json.loads(run(programs / "gpudem", "schema", name, cwd=tmp_path))


def test_its_plug_in_is_there(programs, tmp_path):
    checks = ("--gpudem-case", "head_on", "--gpudem-code", "gpudem", "--gpudem-out", "c")
    text = run(programs / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider", *checks, cwd=tmp_path)
    assert f"report: {tmp_path / 'c' / 'report.html'}" in text
