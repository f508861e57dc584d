"""One comparison of fake codes, with checks of every status, shared by the tests of the harness."""

from __future__ import annotations

import dataclasses

import pytest

from comparisons.harness import codes, execute
from comparisons.harness.case import Case, Check
from tests.comparisons import fake


@pytest.fixture
def fake_codes(monkeypatch):
    """Put fake codes in place of the real ones: fake_codes(gpudem={"fails": "no"})."""

    def use(**changes):
        monkeypatch.setattr(codes, "CODES", fake.codes(**changes))

    use()
    return use


def troubled() -> Case:
    """A case in which a check fails, one raises, one is not a number and one is left out."""
    case = fake.case("troubled", tolerance=1e-9, order=20)

    def more(name, measure, needs=("gpudem",)):
        return Check(name, measure, 1.0, "1", "nobody <b>", "R", "a reason", "nothing", needs=needs)

    def broken(results):
        raise ValueError("<script>alert(1)</script>")

    extra = (
        more("a check that raises", broken),
        more("a check that is not a number", lambda r: float("nan")),
        more("a check of a code that was not selected", lambda r: 0.0, ("yade",)),
    )
    bad = dataclasses.replace(case.figures[0], title="A figure that cannot be drawn", draw=broken)
    return dataclasses.replace(case, checks=case.checks + extra, figures=(*case.figures, bad))


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """(directory, comparison) of a finished comparison."""
    directory = tmp_path_factory.mktemp("comparison")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(codes, "CODES", fake.codes())
        patch.setenv("GPUDEM_NO_RENDER", "1")
        session = execute.Session([fake.case(), troubled()], directory, command=["gpudem", "compare", "<&>"])
        return directory, session.run()
