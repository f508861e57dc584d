"""One sentence: what was found on a scene."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

from comparisons.harness import codes
from comparisons.harness.case import Results
from comparisons.harness.results import CheckResult
from comparisons.scene_case import analysis
from comparisons.scene_case import plan as plans
from comparisons.scene_case.checks import AGREEMENT
from comparisons.scene_case.plan import Plan

#: Letters of a reason at most.
LONGEST = 160


def sentence(plan: Plan, results: Results, checks: Sequence[CheckResult]) -> str:
    """What was found: agreement of each pair, codes left out, and checks of single codes that fail."""
    ran = _ran(results)
    if not ran:
        every = {**results.left_out, **results.failed}
        why = [text for (label, _), text in every.items() if label == plans.SCENE]
        return f"no code ran the scene: {'; '.join(dict.fromkeys(_short(text) for text in why))}"
    parts = [_pair(plan, results, checks, *pair) for pair in pairs_of(results)]
    if not parts:
        parts = [_alone(plan, results, ran)]
    for missing, what in ((results.failed, "failed"), (results.left_out, "is left out")):
        parts += [
            f"{codes.title(code)} {what} ({_short(why)})"
            for (label, code), why in missing.items()
            if label == plans.SCENE
        ]
    parts.append(_sanity(checks))
    return "; ".join(part for part in parts if part) + "."


def _ran(results: Results) -> list[str]:
    return [code for code in codes.CODES if (plans.SCENE, code) in results.runs]


def pairs_of(results: Results) -> list[tuple[str, str]]:
    """Pairs of codes that ran the scene: (under test, the other)."""
    return codes.pairs(_ran(results))


def _pair(plan: Plan, results: Results, checks: Sequence[CheckResult], code: str, other: str) -> str:
    one, two = codes.title(code), codes.title(other)
    if not analysis.has(results, plans.SCENE, "gpudem") or incomplete(results):
        return f"{one} and {two} are not compared: runs of gpudem are missing"
    limits = analysis.envelope(results, plan)
    found = analysis.agreement(results, plan, code, other)
    asked = [c for c in checks if c.name.startswith(AGREEMENT) and c.needs == (code, other)]
    if asked and asked[0].status == "left_out" and not found.vacuous:
        end = min(limits.horizon, float(limits.time[-1]))
        text = (
            f"{one} and {two} are not judged particle by particle ({asked[0].why}): positions differ by at"
            f" most {found.largest:.1e} diameters until {end:.4g} s"
        )
        if math.isinf(limits.horizon):
            return text
        return f"{text}; after that {after(plan, results, code, other)}"
    if found.parting is not None:
        return f"{one} and {two} separate earlier than rounding explains: {found.parting.sentence}"
    if found.vacuous:
        text = f"rounding allows no comparison of {one} and {two} particle by particle"
        return f"{text}; {after(plan, results, code, other)}"
    if math.isinf(limits.horizon):
        return (
            f"{one} and {two} agree to rounding in the whole run of {limits.time[-1]:.4g} s"
            f" ({_size(found.largest)})"
        )
    why = "rounding differences then exceed a thousandth of a diameter"
    if limits.growth.rate:
        why = f"rounding differences grow tenfold every {limits.growth.decade:.2g} s"
    text = f"{one} and {two} agree to rounding until {limits.horizon:.4g} s ({why})"
    return f"{text}; after that {after(plan, results, code, other)}"


def _size(largest: float) -> str:
    return f"largest difference {largest:.1e} diameters" if largest > 0 else "positions to the last bit"


def after(plan: Plan, results: Results, code: str, other: str) -> str:
    """What the distributions of two codes show."""
    if not analysis.has_seeds(results, plan, code, other):
        return "nothing is compared, since runs over seeds are missing"
    if why := analysis.no_last_state(plan):
        return f"nothing is compared, since {why}"
    found = analysis.distributions(results, plan, code, other)
    over = f"{plan.seeds} {plan.starts}"
    low = {name: c for name, c in found.items() if c.corrected < analysis.ALPHA}
    if low:
        name = min(low, key=lambda n: low[n].corrected)
        one, two = low[name].mean
        return (
            f"a significant difference over {over} in {len(low)} of {len(found)} metrics, first of all"
            f" {name}: {one:.4g} against {two:.4g} (corrected p = {low[name].corrected:.2g})"
        )
    return (
        f"no significant difference in {len(found)} metrics over {over} (p > {analysis.ALPHA:g}; differences"
        f" of means up to {analysis.detectable(found):.1f} standard deviations remain possible)"
    )


def _alone(plan: Plan, results: Results, ran: list[str]) -> str:
    title = " and ".join(codes.title(code) for code in ran)
    text = f"{title} ran without another code to compare with"
    if "gpudem" in ran and not incomplete(results):
        limits = analysis.envelope(results, plan)
        time, relative = analysis.halving(results, plan)
        end = min(limits.horizon, float(time[-1]))
        moved = float(relative[time <= end].max())
        text += f"; half the step changes positions until {end:.4g} s by at most {moved:.1e} diameters"
    return text


def incomplete(results: Results) -> bool:
    """Whether a run of gpudem that shows the growth of rounding is missing."""
    labels = [plans.SCENE, plans.HALF, *(f"{plans.ROUNDING}_{k}" for k in range(1, plans.ROUNDING_RUNS + 1))]
    return any((label, "gpudem") not in results.runs for label in labels)


def _sanity(checks: Sequence[CheckResult]) -> str:
    """Checks of single codes that fail or could not be evaluated."""
    own = [c for c in checks if c.mark != "X"]
    bad = [c.name for c in own if c.status == "fail"]
    if bad:
        return f"not sound: {', '.join(bad)}"
    good, lost = (sum(c.status == status for c in own) for status in ("pass", "error"))
    if lost:
        return f"{lost} of {good + lost} checks of conservation and sanity could not be evaluated"
    return f"all {good} checks of conservation and sanity hold" if good else ""


def _short(why: str) -> str:
    """The reason in one line: of several points the first, and how many more."""
    lines = [textwrap.shorten(line.strip(" -"), LONGEST) for line in why.splitlines() if line.strip()]
    if len(lines) > 1 and lines[0].endswith(":"):
        more = f" and {len(lines) - 2} more" if len(lines) > 2 else ""
        return lines[1] + more
    return lines[0] if lines else "no reason given"
