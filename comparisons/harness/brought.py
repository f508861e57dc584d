"""What is required of a code that a user brings, and which failures are no evidence against its law.

Agreement step by step is required only of a code with the half-step scheme, at the step of the scene and with
all digits. A failure explained by few digits of its output, or by a declared other scheme, is skipped with
the reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from comparisons.harness import attribution, codes
from comparisons.harness.case import Check, Results
from gpudem.errors import GpudemError
from gpudem.output.run import Run
from reference.process.contract import HALF_STEP
from reference.process.states import FULL_DIGITS

if TYPE_CHECKING:
    from comparisons.harness.results import CheckResult

Key = tuple[str, str]

#: An overlap, as a share of the radius: measures divide differences of positions by overlaps.
OVERLAP = 1e-3
#: Where nothing can be said; the reason follows.
UNKNOWN = "what differs is not known"
#: What leaves a code in another scheme without an accusation.
NO_LAW = ("nothing", "scheme or timing", attribution.ONE_STEP)


def _own(needs: tuple[str, ...], runs: Mapping[Key, Run]) -> Iterator[tuple[str, Run]]:
    """(code, run) of those needed that a user brought and whose notes say how they ran."""
    for (_, code), run in runs.items():
        if code in needs and codes.brought(code) and "scheme" in run.notes:
            yield code, run


def _other_scheme(code: str, run: Run) -> str:
    """How a run differs from the half-step scheme at the step of the scene; empty if it does not."""
    scheme, step = run.notes["scheme"], run.notes.get("time_step", run.scene.time.step)
    if scheme != HALF_STEP:
        return f"{codes.title(code)} declares {f'the scheme {scheme!r}' if scheme else 'no scheme'}"
    if step != run.scene.time.step:
        return f"{codes.title(code)} takes steps of {step:g} s instead of {run.scene.time.step:g} s"
    return ""


def _digits(run: Run) -> int:
    return int(run.notes.get("digits", FULL_DIGITS))


def not_required(check: Check, runs: Mapping[Key, Run]) -> str:
    """Why a check is not required of the codes that it reads; empty if it is."""
    if not check.half_step:
        return ""
    for code, run in _own(check.needs, runs):
        other = _other_scheme(code, run)
        if other:
            return f"agreement step by step is required only of the half-step scheme (run.json); {other}"
        if _digits(run) < FULL_DIGITS:
            return f"needs {FULL_DIGITS} significant digits; {codes.title(code)} writes {_digits(run)}"
    return ""


def explained(check: Check, value: float, runs: Mapping[Key, Run], results: Results) -> str:
    """What explains a failure without a wrong law: too few digits, another scheme; empty: nothing."""
    for code, run in _own(check.needs, runs):
        overlap = OVERLAP * float(run.scene.state.radius.min())
        lost = 10.0 ** -_digits(run) * float(abs(run.scene.state.position).max()) / overlap
        if _digits(run) < FULL_DIGITS and (check.lo is not None or value <= check.tolerance + lost):
            return (
                f"{value:.3g} may be rounding: {codes.title(code)} writes {_digits(run)} significant digits"
            )
        other = _other_scheme(code, run)
        if other:
            known = _known(results, code)
            if known and all(v.what in NO_LAW for v in known):
                worst = max(known, key=lambda v: v.size if v.size == v.size else 0.0)
                return f"{value:.3g}; {other}, and its forces show no other law: {worst.sentence()}"
    return ""


def _known(results: Results, code: str) -> list[attribution.Verdict]:
    """What is known of a code; nothing where one of its runs failed."""
    try:
        return [
            v for v in attribution.verdicts(results, code) if not v.what.startswith(attribution.NOT_KNOWN)
        ]
    except GpudemError:
        return []


def differs(code: str, results: Results) -> str:
    """What differs in a code, or that nothing does, in a few words; or why it is not known."""
    ran = [name for _, name in results.runs.keys() if name == code]  # asking for all items wants them whole
    failed = [why for (_, name), why in results.failed.items() if name == code]
    away = [why for (_, name), why in results.left_out.items() if name == code]
    if not ran:
        return f"it failed: {failed[0]}" if failed else f"it did not run: {away[0]}" if away else ""
    try:
        found = attribution.main(results, code)
    except GpudemError as error:
        return f"{UNKNOWN}: {error}"
    if found.what.startswith(attribution.NOT_KNOWN):
        return f"{UNKNOWN}: {found.what.removeprefix(attribution.NOT_KNOWN)}"
    return found.phrase()


def sentence(code: str, what: str, checks: Sequence[CheckResult]) -> str:
    """What was found of a code in a case: its checks in numbers, and what differs (`differs`)."""
    status = [check.status for check in checks if code in check.needs]
    judged = len(status) - status.count("left_out")
    held = f"all {judged} of its checks hold" if judged else "none of its checks could be judged"
    words = {"fail": "do not hold", "error": "could not be evaluated"}
    bad = [
        f"{status.count(kind)} of its {judged} checks {says}"
        for kind, says in words.items()
        if kind in status
    ]
    return f"{codes.title(code)}: {' and '.join(bad) or held}; {what}"


def not_written(error: KeyError, runs: Mapping[Key, Run], failed: Mapping[Key, str]) -> str:
    """What to say where a measure asked for a column that a code does not write, or for a failed run of a
    code that a user brought; empty for another error.
    """
    name = error.args[0] if error.args else None
    if name in failed and codes.brought(name[1]):
        return f"{codes.title(name[1])} failed on {name[0]}"
    for (_, code), run in runs.items():
        if name in run.notes.get("not_written", ()):
            return f"{codes.title(code)} does not write {name}"
    return ""
