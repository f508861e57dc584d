"""The pytest plug-in, in any repository: each check of a case is a test, and the report is written.

    pytest --gpudem-case head_on --gpudem-scene my.toml --gpudem-with "python my_dem.py {scene} {out}"

Installed with gpudem (entry point `gpudem` of the group `pytest11`; `-p no:gpudem` switches it off). Without
one of SELECTING it adds nothing to a session, and imports nothing of gpudem.
"""

from __future__ import annotations

import pytest

#: Options that select checks: one of them makes the plug-in take part.
SELECTING = ("gpudem_case", "gpudem_cases", "gpudem_scene")


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of the group `gpudem`."""
    group = parser.getgroup("gpudem", "gpudem: comparison of simulation codes")

    def option(name: str, what: str, metavar: str, action: str = "append") -> None:
        default = [] if action == "append" else None
        group.addoption(f"--gpudem-{name}", action=action, default=default, metavar=metavar, help=what)

    option("case", "run this case, each of its checks a test; repeatable", "NAME")
    option(
        "cases",
        "cases of a package or module; without --gpudem-case all of them are run; repeatable",
        "PACKAGE",
    )
    option("scene", "compare a scene of yours, TOML or JSON; repeatable", "FILE")
    option("code", "code to run the cases through; repeatable; default: all that are known", "NAME")
    option("with", "a code of yours: 'python my_dem.py {scene} {out}'", "COMMAND", "store")
    option("tier", "quick, standard or full; default: quick", "TIER", "store")
    option("jobs", "runs side by side, those that are not timed; default: one a core", "N", "store")
    option("out", "new or empty folder of the report; default: runs/<UTC>_<commit>", "DIR", "store")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Register the checks where an option selects some."""
    if any(config.getoption(name) for name in SELECTING):
        from comparisons.harness import pytest_checks

        config.pluginmanager.register(pytest_checks.Checks(config), "gpudem-checks")
