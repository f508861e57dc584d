"""Normal impacts of spheres on planes of another material, restitution 0.3 to 1, with and without
`limit_force`.
"""

from __future__ import annotations

from comparisons import kit
from comparisons.cases.side_by_side import Spheres, every_pair, floor, plane, traced
from comparisons.cases.single_contact import checks, figures
from comparisons.cases.single_contact.checks import FIRST_ORDER
from comparisons.cases.single_contact.meetings import Meeting, ladder
from gpudem.scene import Contact, Material, Pair, Scene

#: Restitution, speed [m/s] and wall of each sphere: two walls that face along +z and -x, so that a sign
#: shows.
SPHERES = ((0.3, 1.0, "floor"), (0.6, 1.3, "side"), (0.9, 0.7, "floor"), (1.0, 1.0, "side"))
RADIUS, SPACING = 0.003, 0.05
#: Time of the touch and of the run [s]; a contact takes some 65e-6 s.
FLIGHT, DURATION = 7e-6, 90e-6
#: Polystyrene on acrylic (Park et al. 2014, tables 1 and 2; density from the mass of a ball, 0.2 g).
BALL = Material(young=3.25e9, poisson=0.34, density=1768.0)
WALL = Material(young=3.2e9, poisson=0.37, density=1185.0)

MEETINGS = [Meeting(f"e = {e:g}", k, wall) for k, (e, _, wall) in enumerate(SPHERES)]
DAMPED, ELASTIC = MEETINGS[:3], MEETINGS[3:]


def scene(limit_force: bool, dt: float) -> Scene:
    """All spheres, `FLIGHT` before their touch."""
    rows, reach, names = Spheres(), SPACING * len(SPHERES), [f"ball_{k}" for k in range(len(SPHERES))]
    for k, (_, speed, wall) in enumerate(SPHERES):
        gap = RADIUS + speed * FLIGHT
        if wall == "floor":
            rows.add((SPACING * k, 0.0, gap), (0.0, 0.0, -speed))
        else:
            rows.add((reach - gap, 0.0, SPACING * (k + 1)), (speed, 0.0, 0.0))
    pairs = [Pair(materials=(n, "wall"), restitution=s[0]) for n, s in zip(names, SPHERES, strict=True)]
    return traced(
        "wall_restitution", rows.explicit(angular_velocity=None, radius=RADIUS, material=names),
        title=f"spheres on planes, {'limit_force' if limit_force else 'default'}, step {dt:.3g} s",
        materials=dict.fromkeys(names, BALL) | {"wall": WALL}, pairs=every_pair(names, pairs),
        contact=Contact(limit_force=limit_force),
        walls=[floor("wall"), plane("side", (reach, 0, 0), (-1, 0, 0))], step=dt, duration=DURATION,
        lo=(-0.05, -0.05, -0.001), hi=(reach + 0.001, 0.05, reach + 0.05),
    )  # fmt: skip


CASE = kit.Case(
    name="wall_restitution",
    title="A sphere on a plane",
    purpose=(
        "A plane contributes its own modulus to a contact, no curvature and infinite mass. The law returns"
        " exactly the fraction e of the impact speed, at any speed, but only if the contact force may become"
        " tensile at the end of the rebound. With limit_force the tensile part is set to zero and the"
        " restitution is larger, by a closed form (0.397 instead of 0.3). A calibration of the restitution"
        " against an experiment depends on which of the two a code uses; both are shown here, for each code."
    ),
    source="Hertz (1882); Antypov and Elliott (2011); Schwager and Poeschel (2007), limit_force.",
    variants=lambda tier: [
        kit.Variant(f"{name}_{label}", scene(name == "limited", dt), timed=name == "default")
        for name in ("default", "limited")
        for label, dt in ladder(tier, FLIGHT).items()
    ],
    checks=(
        *checks.step_by_step(MEETINGS, spin=False),
        *checks.against_ode("default, damped", DAMPED, 1e-3, (0.85, 1.15), "default", FIRST_ORDER),
        *checks.against_ode("limit_force, damped", DAMPED, 1e-3, (0.85, 1.15), "limited", FIRST_ORDER),
        *checks.against_ode("elastic", ELASTIC, 2e-6, (1.85, 2.15), "default", checks.SECOND_ORDER),
        *checks.against_closed_forms("default, damped", DAMPED, 1e-3, "default", FIRST_ORDER),
        *checks.against_closed_forms("limit_force, damped", DAMPED, 1e-3, "limited", FIRST_ORDER),
    ),
    figures=(
        figures.overlay(MEETINGS, "default", title="Default: tensile force at the end"),
        figures.overlay(MEETINGS, "limited", title="limit_force: no tensile force"),
        *figures.of_steps(MEETINGS, MEETINGS, "default"),
    ),
    tables=(
        figures.observables_table(MEETINGS, "default"),
        figures.observables_table(MEETINGS, "limited"),
    ),
    features=("normal hertz", "damping", "limit_force", "several materials", "wall plane"),
    order=20,
)
