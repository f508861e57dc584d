"""The checks of a scene: agreement of codes, distributions, conservation and sanity of each code."""

from __future__ import annotations

import math

import numpy as np

from comparisons.harness import codes
from comparisons.harness.case import Check, Measured, PerCode, PerPair, Results, Unmeasured
from comparisons.scene_case import analysis
from comparisons.scene_case import plan as plans
from comparisons.scene_case.plan import Plan
from gpudem.scene import Scene, groups
from gpudem.scene.time_step import contact_time
from gpudem.solver.guards import MAX_OVERLAP

#: Largest overlap / radius, and fewest steps of a contact, that are called sound.
OVERLAP, STEPS = 0.1, 10.0
#: Name of the check of each pair.
AGREEMENT = "positions and speeds until the horizon: largest difference / what rounding explains"
#: Change of the energy / largest kinetic energy.
ENERGY = 0.05
#: Difference of masses / mass of all particles.
MASS = 1e-9
#: Change of momentum / sum of m |v|: rounding of as many sums as there are steps and contacts.
MOMENTUM = 1e-9


def between(plan: Plan) -> PerPair:
    """Checks of each pair of codes."""

    def make(code: str, other: str) -> tuple[Check, ...]:
        title = codes.title(other)
        return (
            Check(
                name=AGREEMENT,
                measure=lambda results: agreement(results, plan, code, other),
                tolerance=1.0, unit="1", against=title, mark="X", needs=(code, other), half_step=True,
                reason=(
                    f"same law and scheme: {analysis.FACTOR:g} times what perturbations of the start by"
                    " rounding have grown to in gpudem itself"
                ),
                catches="a force, spring, list, wall or integration that differs by more than rounding",
            ),
            Check(
                name="distributions after the horizon: smallest corrected p over all metrics",
                measure=lambda results: distributions(results, plan, code, other),
                lo=analysis.ALPHA, tolerance=1.0, unit="1", against=title, mark="X", needs=(code, other),
                reason="permutation test of the largest difference over all metrics, level 0.01",
                catches="a bias of a flow beyond the spread over seeds",
            ),
        )  # fmt: skip

    return PerPair(make)


def agreement(results: Results, plan: Plan, code: str, other: str) -> Measured:
    """Excess of the differences over what rounding explains."""
    if plan.scene.meshes and plan.scene.contact.mesh_contacts == "unique":
        raise Unmeasured(
            "contact.mesh_contacts = 'unique' is a rule of gpudem's own: contacts at edges of meshes differ;"
            " with 'liggghts' the codes can be compared particle by particle"
        )
    limits, scene = analysis.envelope(results, plan), plan.scene
    own = analysis.trace(results[plans.SCENE, code])
    inside = limits.time <= limits.horizon
    found = analysis.agreement(results, plan, code, other)
    if found.vacuous:
        raise Unmeasured("rounding has grown beyond the limit before the third time of the trace")
    moved = float(np.abs(np.nan_to_num(own["position"] - scene.state.position)[inside]).max())
    note = f"{inside.sum()} times until {min(limits.horizon, limits.time[-1]):.6g} s"
    if found.parting:
        note += f"; first difference: {found.parting.sentence}"
    turned = float(np.abs(np.nan_to_num(own["angular_velocity"])).max())
    return Measured(found.excess if moved > 0 or turned > 0 else math.nan, note=note)


def distributions(results: Results, plan: Plan, code: str, other: str) -> Measured:
    """Smallest corrected p."""
    if math.isinf(analysis.envelope(results, plan).horizon):
        raise Unmeasured("the codes can be compared particle by particle to the end: nothing is left for it")
    if not analysis.has_seeds(results, plan, code, other):
        raise Unmeasured("runs over seeds are missing")
    if why := analysis.no_last_state(plan):
        raise Unmeasured(f"{why}: no state to compare")
    found = analysis.distributions(results, plan, code, other)
    if not found:
        raise Unmeasured("no metric varies")
    name = min(found, key=lambda n: found[n].corrected)
    comparison = found[name]
    bound = analysis.detectable(found)
    return Measured(
        comparison.corrected,
        note=(
            f"{len(found)} metrics, {plan.seeds} {plan.starts} a code; smallest at"
            f" {name}: {comparison.mean[0]:.5g} and {comparison.mean[1]:.5g}; differences of means above"
            f" {bound:.2g} standard deviations lie outside the 95 % intervals"
        ),
    )


def energy_defined(scene: Scene) -> bool:
    """Whether the energy balance can be computed from positions, velocities and the work of walls.

    Not where gravity changes.
    """
    gravity, periodic = np.array([at.gravity for at in scene.phase_scenes]), np.array(scene.domain.periodic)
    potential = scene.contact_range == 0 and not scene.needs.cohesion and not np.ptp(gravity, axis=0).any()
    vibrating = any(plane.speed > 0 for plane in scene.planes)  # steps back without a time of its own
    return not ((gravity != 0) & periodic).any() and not vibrating and potential


def conserved(scene: Scene) -> bool:
    """Whether the scene conserves energy: neither damping nor tangential or rolling forces, no change."""
    needs = scene.needs
    return not (needs.damping or needs.tangential or needs.rolling or scene.changes)


def each(plan: Plan) -> PerCode:
    """Checks of each code by itself."""
    scene = plan.scene

    def make(code: str) -> tuple[Check, ...]:
        title = codes.title(code)
        made = [
            Check(
                name=f"particles not finite or outside the domain ({title})",
                measure=lambda results: float(analysis.sanity(results, plan, code).outside),
                tolerance=0.0, unit="1", against="none", mark="A", needs=(code,),
                reason="the scene's domain holds all particles",
                catches="a lost particle, an output in disorder",
            ),
            Check(
                name=f"largest overlap / radius ({title})",
                measure=lambda results: analysis.sanity(results, plan, code).overlap,
                tolerance=MAX_OVERLAP if {"overlap", "large_overlap"} & set(scene.allow) else OVERLAP,
                unit="1", against="range of contact laws", mark="A", needs=(code,),
                reason="contact laws are derived for overlaps far below a radius; a tenth is generous",
                catches="a material too soft for the speeds, a contact found too late",
            ),
        ]  # fmt: skip
        if energy_defined(scene):
            made.append(_energy(plan, code))
        if scene.exits:
            made.append(_mass(plan, code))
        if not (scene.walls or scene.insert or scene.groups or scene.exits):
            made.append(
                Check(
                    name=f"momentum, that of gravity taken off: largest change / sum of m |v| ({title})",
                    measure=lambda results: analysis.sanity(results, plan, code).momentum,
                    tolerance=MOMENTUM, unit="1", against="conservation", mark="A", needs=(code,),
                    reason="contacts of particles act on both; what is left is rounding of many steps",
                    catches="a reaction of another size than the action, a contact counted for one particle",
                )
            )  # fmt: skip
        return tuple(made)

    return PerCode(make)


def _energy(plan: Plan, code: str) -> Check:
    constant, moving = conserved(plan.scene), bool(plan.scene.moving_walls or groups.moving(plan.scene))

    def measure(results: Results) -> Measured:
        found = analysis.sanity(results, plan, code)
        if found.unknown:
            raise Unmeasured(found.unknown)
        if found.scale == 0:
            raise Unmeasured("nothing moves")
        change = found.energy - found.energy[0]
        worst = float(np.nanmax(np.abs(change)) if constant else max(np.nanmax(change), 0.0))
        note = f"{np.isfinite(change).sum()} times, most contacts {found.contacts.max()}"
        if moving:
            movers = "walls and groups" if groups.moving(plan.scene) else "walls"
            note += f", work of {movers} {np.nanmax(np.abs(found.work)):.4g} J"
        if plan.scene.insert:
            note += f", brought by inserted particles {found.brought[-1]:.4g} J"
        if plan.scene.exits:
            note += f", taken along by {found.leavers} particles {found.left[-1]:.4g} J"
        return Measured(worst / found.scale, note=note)

    what = "change" if constant else "growth"
    more = " and of particles that have left" if plan.scene.exits else ""
    less = " less the work of walls" if moving else ""
    return Check(
        name=(
            f"energy with that of overlaps{more}{less}: largest {what} / largest kinetic energy"
            f" ({codes.title(code)})"
        ),
        measure=measure, tolerance=ENERGY, unit="1", against="energy balance", mark="A", needs=(code,),
        reason="velocity Verlet errs by (pi/steps in a contact)^2, at most 2.5 % at 20 steps; twice that",
        catches=(
            "an unstable step, damping of the wrong sign, a stiffness that differs on the way out"
            + (", a wall that moves at another velocity than particles feel" if moving else "")
        ),
    )  # fmt: skip


def _mass(plan: Plan, code: str) -> Check:
    """What came less what left by the history, against what is there by the trace."""

    def measure(results: Results) -> Measured:
        run = results[plans.SCENE, code]
        columns = [f"removed_mass_{stated.name}" for stated in run.scene.exits]
        missing = [c for c in columns if run.history is None or c not in run.history]
        if missing or run.history is None:
            raise Unmeasured(f"{codes.title(code)} does not tell {', '.join(missing)}")
        whole, mass = analysis.trace(run), run.scene.masses
        table = run.history.set_index("step")
        steps = np.intersect1d(whole["step"], table.index)
        left = table.loc[steps, columns].to_numpy().sum(axis=1)
        if left[-1] == 0:
            raise Unmeasured("nothing leaves")
        there = np.isfinite(whole["position"][np.isin(whole["step"], steps), :, 0]) @ mass
        come = np.concatenate([[0.0], np.cumsum(mass)])[
            np.searchsorted(run.scene.arrival_steps, steps, side="right")
        ]
        worst = float(np.abs(come - left - there).max() / mass.sum())
        return Measured(worst, note=f"{len(steps)} times; of {come[-1]:.4g} kg {left[-1]:.4g} kg left")

    return Check(
        name=f"mass that came less that left: largest difference from what is there ({codes.title(code)})",
        measure=measure, tolerance=MASS, unit="1", against="conservation", mark="A", needs=(code,),
        reason="sums of the masses of all particles, whose rounding is far smaller; none may be missing",
        catches="a particle that is lost without being counted, or counted and still there",
    )  # fmt: skip


def own(plan: Plan) -> tuple[Check, ...]:
    """Checks of gpudem's repeated runs and of the step."""
    scene = plan.scene
    steps = contact_time(scene) / scene.time.step

    def repeated(results: Results) -> Measured:
        one, two = (analysis.trace(results[label, "gpudem"]) for label in (plans.SCENE, plans.AGAIN))
        return Measured(
            max(float(np.abs(one[k] - two[k]).max()) for k in one), note="all columns of the trace"
        )

    return (
        Check(
            name="a second run: largest difference of any number of the trace (gpudem)",
            measure=repeated, tolerance=0.0, unit="SI", against="the first run", mark="A",
            reason="on one device a run is repeated to the last bit",
            catches="a race of threads, memory that is read before it is written",
        ),
        Check(
            name="steps in the shortest contact", measure=lambda results: steps, lo=STEPS, tolerance=math.inf,
            unit="1", against="time-step rule", mark="A",
            reason="20 are usual; below ten a contact is not resolved, below three it gains energy",
            catches="a step that is too long for the stiffness of the scene",
        ),
    )  # fmt: skip
