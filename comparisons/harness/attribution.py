"""What differs in a code that a user brings: the law, the scheme or timing, the list, a wall, or the output.

The contact law is evaluated on the code's own states (`comparisons.metrics.law_on_states`), at every time
step of the case. What remains at small steps is of the law; what vanishes with the step is of the scheme or
timing. Nothing more is claimed: without contacts that can be evaluated, or with one time step, it says so.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from comparisons.harness import codes
from comparisons.harness.case import Finding, Measured, Results, Table, Unmeasured
from comparisons.metrics import law_on_states as states
from comparisons.metrics.law_on_states import Touch
from gpudem.errors import GpudemError
from gpudem.output.run import Run
from gpudem.scene import Scene
from reference.process import contacts
from reference.process.contacts import ContactTable
from reference.process.states import FULL_DIGITS

if TYPE_CHECKING:
    import pandas

#: Impulse of a difference, as a share of that of the law, up to which a force is that of the law. With all
#: digits, rounding of positions leaves 2e-5 at the smallest steps of the cases, less at larger ones.
AGREES = 1e-4
#: Error of velocities against the central difference of positions up to which a run is velocity Verlet.
VERLET = 1e-6
#: Where there is one time step only, and no classical mistake explains it.
ONE_STEP = "law or scheme (one time step only)"
#: Begins a verdict where nothing can be said; the reason follows.
NOT_KNOWN = "not known: "
#: Order in the time step from which a difference vanishes with it; a law gives 0, a first-order scheme 1.
VANISHES = 0.5
#: Share of the steps of a contact without a force from which it was missed, and not only begun a step late.
MISSED = 0.05
#: Factor by which a mistake must reduce the difference to be named as what explains it.
EXPLAINS = 20.0
#: Contacts that are evaluated at most, evenly among those found.
MOST = 300

#: That nothing differs, and what does, for the head of the page.
FOLLOWED = "the contact law is followed"
WORDS = {
    "law": "the contact law differs",
    "wall": "the contact law differs at walls only",
    "scheme or timing": "the scheme or its timing differs, and not the contact law",
    "list": "contacts are without a force for some time, as if missing in the neighbor list",
    "output": "the velocities written do not belong to the positions",
    ONE_STEP: "the contact law or the scheme differs, which one time step cannot tell",
}

HEADS = (
    "code", "scenes", "time steps", "contacts", "what differs", "in", "largest at contact",
    "difference at the smallest step [1]", "order in the step", "explained by",
)  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Verdict:
    """What differs in the runs of one scene at several time steps."""

    scenes: str
    """Label of the run with the smallest step."""
    steps: int
    """Time steps at which it was run."""
    contacts: int = 0
    """Contacts that were evaluated."""
    what: str = "nothing"
    """nothing, law, wall, scheme or timing, list, output, law or scheme; or "not known: ..."."""
    part: str = ""
    """normal force, tangential force, torque, velocity."""
    where: str = ""
    """The contact where it is largest."""
    size: float = math.nan
    """Difference at the smallest step, as a share of the impulse of the law [1]."""
    order: float = math.nan
    """Its order in the time step [1]."""
    explained: str = ""
    """The classical mistake that explains it."""

    def phrase(self) -> str:
        """What differs and in which part, for the head of the page; the same for the same finding."""
        if self.what == "nothing":
            return FOLLOWED
        if not self.part:
            return self.what
        as_by = f", as with {self.explained}" if self.explained else ""
        return f"{WORDS[self.what]} ({self.part}{as_by})"

    def sentence(self) -> str:
        """In words, for the terminal."""
        text = (
            f"{self.what}: {self.part}, {self.size:.2g} at contact {self.where}" if self.part else self.what
        )
        falls = f", order {self.order:.2g} in the step" if math.isfinite(self.order) else ""
        return text + falls + (f"; explained by: {self.explained}" if self.explained else "")


def verdicts(results: Results, code: str) -> list[Verdict]:
    """One for each scene that a code ran, at all its time steps. Raises Unmeasured: a run failed."""

    def found() -> list[Verdict]:
        groups: dict[str, list[tuple[str, Run]]] = {}
        try:
            for label, run in results.of(code):
                groups.setdefault(_physics(run.scene), []).append((label, run))
        except GpudemError as error:
            raise Unmeasured(str(error)) from None
        return [_verdict(_with_every_step(sorted(group, key=_step))) for group in groups.values()]

    return results.once(("attribution", code), found)


def main(results: Results, code: str) -> Verdict:
    """The verdict with the largest difference over the scenes of a case; else that nothing differs; else why
    that is not known. Raises Unmeasured: a run failed.
    """
    found = verdicts(results, code)
    known = [v for v in found if not v.what.startswith(NOT_KNOWN)]
    if not known:
        why = sorted({v.what.removeprefix(NOT_KNOWN) for v in found})
        return Verdict("", 0, what=NOT_KNOWN + ("; ".join(why) or "no run"))
    return max(known, key=lambda v: (v.what != "nothing", v.size if v.size == v.size else 0.0))


def _physics(scene: Scene) -> str:
    """The same for scenes that differ only in time step and output."""
    fields = type(scene.output).model_fields.items()
    silent = {name: field.get_default() for name, field in fields}
    return scene.replace(
        time={"step": 1.0, "duration": 1.0}, output=silent, allow=["time_step", "speed"]
    ).hash


def _with_every_step(group: list[tuple[str, Run]]) -> list[tuple[str, Run]]:
    """The runs with states at every step; all where none has."""
    every = [
        (label, run)
        for label, run in group
        if run.trace is not None and states.every_step(run.scene, run.trace)
    ]
    return every or group


def _step(labelled: tuple[str, Run]) -> float:
    return labelled[1].scene.time.step


def _verdict(group: list[tuple[str, Run]]) -> Verdict:
    """Of runs of one scene, smallest step first."""
    blank = Verdict(group[0][0], len(group))
    why = _not_known(group)
    if why:
        return dataclasses.replace(blank, what=f"{NOT_KNOWN}{why}")
    runs = [run for _, run in group]
    errors = [states.verlet_error(_trace(run)) for run in runs]
    verlet = max(errors) <= VERLET
    drift = _order(runs, errors)
    if not verlet and errors[0] > AGREES and not drift > VANISHES and len(runs) > 1:
        return dataclasses.replace(
            blank, what="output", part="velocity", where="-", size=errors[0], order=drift
        )
    found = states.contacts(runs[0].scene, _trace(runs[0])["position"])
    touches = found if all(map(_table, runs)) else [touch for touch in found if touch.alone]
    touches = touches[:: max(1, -(-len(touches) // MOST))]
    blank = dataclasses.replace(blank, contacts=len(touches))
    if not touches:
        none = (
            "contacts of particles that have several at a time, and no contacts.csv"
            if found
            else "no contact"
        )
        return dataclasses.replace(blank, what=f"{NOT_KNOWN}{none}")
    missed = _missed(runs[0], touches, verlet)
    if missed:
        return dataclasses.replace(blank, what="list", part="no force", where=missed[0], size=missed[1])
    return _of_forces(blank, runs, touches, verlet)


def _not_known(group: list[tuple[str, Run]]) -> str:
    """Why nothing can be said of these runs."""
    for _, run in group:
        if run.notes.get("digits", FULL_DIGITS) < FULL_DIGITS:
            return f"output with {run.notes['digits']} significant digits"
        if run.trace is None:
            return "no states at every step"
        why = states.judged(run.scene, run.trace)
        if why:
            return why
    return ""


def _trace(run: Run) -> states.Trace:
    assert run.trace is not None
    return run.trace


def _table(run: Run) -> ContactTable | None:
    """The forces of contacts as the code states them; None if it does not."""
    name = run.notes.get("contacts")
    return _read_table(run.scene, run.directory / name) if name else None


@functools.lru_cache(maxsize=16)
def _read_table(scene: Scene, path: Path) -> ContactTable:
    return contacts.read(scene, path)


def _compare(run: Run, touch: Touch, verlet: bool, law: states.Law | None = None) -> states.Compared:
    """The forces of a contact: as stated in contacts.csv where there is one, else from the motion."""
    trace, table = _trace(run), _table(run)
    given = None if table is None else table.force(touch.i, touch.other, trace["step"])
    return states.compare(run.scene, trace, touch, verlet, law, given)


def _missed(run: Run, touches: Sequence[Touch], verlet: bool) -> tuple[str, float] | None:
    """(contact, share of its steps) that has no force where the law has one."""
    for touch in touches:
        compared = _compare(run, touch, verlet)
        share = compared.absent() / len(compared.normal[0])
        if share > MISSED:
            return str(touch), share
    return None


def _of_forces(blank: Verdict, runs: list[Run], touches: Sequence[Touch], verlet: bool) -> Verdict:
    """What the forces say: the part with the largest difference that does not vanish, else that does."""
    found = [_largest(run, touches, verlet, states.Law()) for run in runs]
    candidates = []
    for part, (size, where) in found[0].items():
        if size > AGREES:
            order = _order(runs, [one.get(part, (math.nan, None))[0] for one in found])
            candidates.append((not order > VANISHES, size, part, where, order))
    if not candidates:
        return blank
    stays, size, part, where, order = max(candidates, key=lambda c: c[:2])
    changed = {"part": part, "where": str(where), "size": size, "order": order}
    if not stays:
        return dataclasses.replace(blank, what="scheme or timing", **changed)
    explained = _explained(runs[0], touches, verlet, found[0])
    what = "law" if len(runs) > 1 or explained else ONE_STEP
    if what == "law" and _only_walls(runs[0], touches, verlet):
        what = "wall"
    return dataclasses.replace(blank, what=what, explained=explained, **changed)


def _largest(
    run: Run, touches: Sequence[Touch], verlet: bool, law: states.Law
) -> dict[str, tuple[float, Touch]]:
    """Part of the force -> (largest difference, contact)."""
    found: dict[str, tuple[float, Touch]] = {}
    for touch in touches:
        for part, size in _compare(run, touch, verlet, law).differences().items():
            if part not in found or size > found[part][0]:
                found[part] = (size, touch)
    return found


def _only_walls(run: Run, touches: Sequence[Touch], verlet: bool) -> bool:
    """Whether contacts of two particles follow the law, so that those with walls do not."""
    between = [touch for touch in touches if not isinstance(touch.other, str)]
    if not between:
        return False
    found = _largest(run, between, verlet, states.Law())
    return max(size for size, _ in found.values()) <= AGREES


def _explained(
    run: Run, touches: Sequence[Touch], verlet: bool, found: dict[str, tuple[float, Touch]]
) -> str:
    """The classical mistake with which the law gives the code's forces; empty if none does."""
    before = max(size for size, _ in found.values())
    after = {
        name: max(size for size, _ in _largest(run, touches, verlet, law).values())
        for name, law in states.MISTAKES.items()
    }
    best = min(after, key=lambda name: after[name])
    return best if after[best] <= max(before / EXPLAINS, AGREES) else ""


def _order(runs: list[Run], errors: Sequence[float]) -> float:
    """Observed order between the two smallest steps; nan where there are none, or they are the same."""
    if len(runs) < 2 or not errors[0] > 0 or not errors[1] > 0:
        return math.nan
    refined = runs[1].scene.time.step / runs[0].scene.time.step
    return math.log(errors[1] / errors[0]) / math.log(refined) if refined != 1.0 else math.nan


# -- in the report -------------------------------------------------------------------------------------------


def tables(ran: Sequence[str]) -> tuple[Table, ...]:
    """A table of what differs for each code of those that ran that a user brought, for any case."""
    return tuple(
        Table(
            title=f"What differs: {codes.title(code)}",
            caption="The law evaluated on the code's own states: a difference that does not vanish with the"
            " time step is of the law. Only contacts of particles that have one at a time are evaluated.",
            make=lambda results, code=code: _frame(results, code),
            needs=(code,),
        )
        for code in ran
        if codes.brought(code)
    )


def findings(ran: Sequence[str]) -> tuple[Finding, ...]:
    """What differs, in one line, for each code that a user brought."""

    def measure(results: Results, code: str) -> Measured:
        found = main(results, code)
        if found.what.startswith(NOT_KNOWN):
            raise Unmeasured(found.what)
        return Measured(0.0 if found.what == "nothing" else found.size, note=found.sentence())

    return tuple(
        Finding(
            name=f"What differs in {codes.title(code)}, largest share of the impulse of a contact",
            measure=lambda results, code=code: measure(results, code),
            unit="1",
            sentence="The contact law on the code's own states; its table says where.",
            needs=(code,),
        )
        for code in ran
        if codes.brought(code)
    )


def _frame(results: Results, code: str) -> pandas.DataFrame:
    import pandas

    rows = [
        (code, v.scenes, v.steps, v.contacts, v.what, v.part, v.where, v.size, v.order, v.explained)
        for v in verdicts(results, code)
    ]
    if not rows:
        raise Unmeasured(f"{codes.title(code)} ran no scene of this case")
    return pandas.DataFrame(rows, columns=list(HEADS))
