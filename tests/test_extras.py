"""Packages of an extra that are not installed: one line that says how to install them.

Catches: a traceback in the place of that line, in the command and in the library; a package added to an extra
of pyproject.toml and forgotten in the table that the line is made of; an error of another kind hidden by it.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from gpudem.extras import EXTRAS, MissingExtraError, from_extra
from tests import user_program

ROOT = Path(__file__).parents[1]
#: Modules whose package has another name.
PACKAGES = {"PIL": "pillow", "imageio_ffmpeg": "imageio-ffmpeg", "vtkmodules": "pyvista"}


def test_the_table_is_that_of_the_project():
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra in ("compare", "video"):
        packages = {re.split(r"[<>=~;\[ ]", requirement)[0] for requirement in stated[extra]}
        assert {PACKAGES.get(m, m) for m, of in EXTRAS.items() if of == extra} == packages
    assert set(EXTRAS) - {"rich"} <= user_program.EXTRAS


@pytest.mark.parametrize("module", EXTRAS)
def test_one_line_names_the_extra(module):
    with pytest.raises(MissingExtraError) as found, from_extra():
        raise ModuleNotFoundError(f"No module named '{module}.part'", name=f"{module}.part")
    assert str(found.value) == f"{module} is not installed: pip install 'gpudem[{EXTRAS[module]}]'"
    assert isinstance(found.value, ImportError)


@pytest.mark.parametrize("name", ["comparisons.mistyped", None])
def test_other_modules_are_not_excused(name):
    with pytest.raises(ModuleNotFoundError), from_extra():
        raise ModuleNotFoundError("No module named this", name=name)


@pytest.mark.parametrize(
    ("module", "arguments"),
    [("click", ["info"]), ("jinja2", ["deck", "examples/drop.toml"]), ("psutil", ["info"])],
)
def test_the_command_without_a_package(module, arguments):
    program = (
        "import sys; from tests import user_program; user_program.EXTRAS.clear();"
        f" user_program.EXTRAS.add({module!r}); sys.meta_path.insert(0, user_program.Refuse());"
        " from comparisons.__main__ import main; sys.exit(main())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 3
    lines = [line for line in done.stderr.splitlines() if not line.startswith("Warp CUDA")]
    assert lines == [f"error: {module} is not installed: pip install 'gpudem[compare]'"]


def test_the_library_without_a_package():
    program = (
        "import sys; from tests import user_program; sys.meta_path.insert(0, user_program.Refuse())\n"
        "try:\n    import reference.liggghts\nexcept ImportError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout == "jinja2 is not installed: pip install 'gpudem[compare]'\n"
