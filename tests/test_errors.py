"""Every exception class of the packages survives pickling, as a process pool needs: one that does not makes
`Pool.map` wait for ever and ProcessPoolExecutor lose its workers.
"""

from __future__ import annotations

import copy
import importlib
import inspect
import multiprocessing
import pickle
import pkgutil
from pathlib import Path

import pytest

from gpudem.errors import GpudemError, SceneError


def _exceptions() -> list[type[Exception]]:
    """All exception classes that the packages define."""
    import comparisons
    import gpudem
    import reference  # not above: the worker of the pool below imports this module

    found = []
    for package in (gpudem, reference, comparisons):
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if info.name.endswith("__main__"):
                continue
            module = importlib.import_module(info.name)
            found += [
                value
                for value in vars(module).values()
                if inspect.isclass(value) and issubclass(value, Exception) and value.__module__ == info.name
            ]
    return found


def _example(kind: type[Exception]) -> Exception:
    """An instance, its arguments made up from the annotations of its own __init__."""
    if "__init__" not in vars(kind):
        return kind("what, where, what to do")
    values = {
        "str": "text",
        "list[str]": ["one", "two"],
        "int": 3,
        "float": 0.5,
        "Path": Path("run"),
        "OSError": OSError(28, "No space left"),
    }
    arguments = {}
    for name, parameter in list(inspect.signature(kind.__init__).parameters.items())[1:]:
        plain = str(parameter.annotation).removesuffix(" | None")
        arguments[name] = values[plain]
    return kind(**arguments)


def _copies(error: Exception) -> list[Exception]:
    pickled = [pickle.loads(pickle.dumps(error, protocol)) for protocol in range(6)]
    return [*pickled, copy.copy(error), copy.deepcopy(error)]


def test_every_exception_class_survives_pickling_and_copying() -> None:
    kinds = _exceptions()
    assert {SceneError, GpudemError} <= set(kinds)
    assert len(kinds) >= 14, "the walk must find those of all three packages"
    for kind in kinds:
        error = _example(kind)
        error.add_note("seen in a worker")
        for again in _copies(error):
            assert type(again) is kind
            assert str(again) == str(error)
            assert again.args == error.args
            assert vars(again) == vars(error)


class _Keywords(GpudemError):
    """Takes arguments by name only, which the pickling of BaseException cannot give back."""

    def __init__(self, *, step: int, time: float):
        self.step, self.time = step, time
        super().__init__(f"step {step}, t = {time:g} s")


def test_arguments_by_name_survive() -> None:
    for again in _copies(_Keywords(step=7, time=0.25)):
        assert isinstance(again, _Keywords)
        assert (again.step, again.time, str(again)) == (7, 0.25, "step 7, t = 0.25 s")


def _fail(problem: str) -> None:
    raise SceneError("sweep.toml", [problem, "time.step: missing"])


def test_a_scene_error_crosses_a_process_pool() -> None:
    """Catches a pool that waits for ever for a result that cannot be unpickled."""
    with multiprocessing.get_context("spawn").Pool(1) as pool, pytest.raises(SceneError) as caught:
        pool.map_async(_fail, ["radius = -1 m"]).get(timeout=60)
    assert caught.value.problems == ["radius = -1 m", "time.step: missing"]
    assert caught.value.source == "sweep.toml"
