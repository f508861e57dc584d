"""Small scenes in which LIGGGHTS and the emulator must agree to rounding."""

from __future__ import annotations

from gpudem.scene import Scene

R = 0.003
BALL = {"young": 5e6, "poisson": 0.34, "density": 1768.0}
WALL = {"young": 3.2e9, "poisson": 0.37, "density": 1190.0}


def scene(
    name: str, position, velocity, *, steps: int, every: int = 1, pair=None, wall_pair=None, **more
) -> Scene:
    """Spheres of radius R in a 60 mm cube, dt = 1 us."""
    data = {
        "name": name,
        "materials": {"ball": BALL, "wall": WALL} if more.get("walls") else {"ball": BALL},
        "pairs": [{"materials": ("ball", "ball"), "restitution": 0.5, "friction": 0.3, **(pair or {})}],
        "particles": {
            "source": "explicit", "position": position, "radius": R, "material": "ball", "velocity": velocity,
            "angular_velocity": more.pop("spin", None),
        },
        "domain": {"lo": (-0.03, -0.03, -0.03), "hi": (0.03, 0.03, 0.03)},
        "time": {"step": 1e-6, "duration": steps * 1e-6},
        "output": {"trace_every": every * 1e-6, "history_every": every * 1e-6},
    }  # fmt: skip
    if more.get("walls"):
        data["pairs"].append(
            {"materials": ("ball", "wall"), "restitution": 0.6, "friction": 0.2, **(wall_pair or {})}
        )
    data["output"] |= more.pop("output", {})
    return Scene(**{**data, **more})


FLOOR = {"kind": "plane", "name": "floor", "material": "wall", "point": (0, 0, 0), "normal": (0, 0, 1)}
FACING = {
    "position": [[-0.0031, 0, 0], [0.0031, 0.001, 0.0005]],
    "velocity": [[0.5, 0.3, 0], [-0.5, -0.3, 0.1]],
}
FALLING = {
    "position": [[0.001, 0.002, 0.00301]],
    "velocity": [[0.3, 0.1, -0.5]],
    "spin": [[20.0, -30.0, 5.0]],
}
STIFFNESS = {"kn": 2e6, "kt": 1.5e6, "gamma_n": 4e5, "gamma_t": 2e5}


def two_spheres(**more) -> Scene:
    """Oblique impact of two spinning spheres."""
    more = {"spin": [[30.0, -10.0, 20.0], [-5.0, 15.0, 40.0]], "name": "two_spheres", "steps": 1200, **more}
    return scene(**FACING, **more)


def recorded_scene() -> Scene:
    """The one whose LIGGGHTS output is kept in the source."""
    return two_spheres(name="recorded", steps=1000, every=25)


def wall_bounce(**more) -> Scene:
    """Oblique impact of a spinning sphere on a floor, under gravity."""
    more = {"name": "wall_bounce", "walls": [FLOOR], "gravity": (0.0, 0.0, -9.81), **more}
    more = {"steps": 1200, **more}
    return scene(**FALLING, **more)


def periodic_crossing() -> Scene:
    """Two spheres meet across the periodic x side; the first crosses it while they touch."""
    return scene(
        "periodic_crossing", [[-0.0297, 0, 0], [0.0241, 0.001, 0.0005]], [[-0.9, 0.2, 0], [-0.1, -0.2, 0.1]],
        steps=3000, domain={"lo": (-0.03,) * 3, "hi": (0.03,) * 3, "periodic": (True, False, False)},
        spin=[[30.0, -10.0, 20.0], [-5.0, 15.0, 40.0]],
    )  # fmt: skip


def gate_removal() -> Scene:
    """A ball on the floor leans against a gate, which goes at 2 ms; a second ball lies on top and behind."""
    gate = {
        "kind": "plane", "name": "gate", "material": "wall", "point": (0.005, 0, 0), "normal": (-1, 0, 0),
        "removed_at": 2e-3,
    }  # fmt: skip
    return scene(
        "gate_removal", [[0.00201, 0, 0.00299], [-0.0018, 0.0004, 0.00757]],
        [[0.02, 0.01, 0.0], [0.05, 0, -0.05]],
        steps=5000, every=5, walls=[FLOOR, gate], gravity=(40.0, 0.0, -9.81),
    )  # fmt: skip


def rebound() -> Scene:
    """A ball hops on a ball: they part and meet again before LIGGGHTS rebuilds its list."""
    return scene(
        "rebound", [[0, 0, 0.003], [0.0002, 0.0001, 0.00905]], [[0, 0, 0], [0.02, 0, -0.2]],
        steps=7000, every=10,
        pair={"restitution": 0.9, "friction": 0.5}, walls=[FLOOR], gravity=(0.0, 0.0, -200.0),
    )  # fmt: skip


def start_in_contact() -> Scene:
    """Overlap and sliding speed at t = 0: the set-up forces; the wall has no friction, the pair has.

    With the tangential dashpot that LIGGGHTS applies to the wall at the set-up all the same.
    """
    return scene(
        "start_in_contact", [[0, 0, 0.00298], [0.0003, 0, 0.00894]], [[0.1, 0, 0], [-0.2, 0.1, 0]], steps=800,
        walls=[FLOOR], gravity=(1.0, 2.0, -9.81), wall_pair={"friction": 0.0},
        contact={"frictionless_dashpot": True},
    )  # fmt: skip


def resting(**more) -> Scene:
    """Three turning spheres in touch with one another and the floor from the start, under tilted gravity."""
    return scene(
        position=[[0, 0, 0.00298], [0.00597, 0, 0.00297], [0.0030, 0.0001, 0.00815]],
        velocity=[[0.02, 0, 0], [-0.01, 0.01, 0], [0.0, 0.02, -0.03]],
        spin=[[20.0, -30.0, 5.0], [-10.0, 15.0, 3.0], [4.0, 9.0, -20.0]],
        **{"steps": 4000, "every": 10, "walls": [FLOOR], "gravity": (3.0, 1.0, -9.81)} | more,
    )  # fmt: skip


def polystyrene_on_acrylic() -> Scene:
    """True moduli, 3 GPa, which LIGGGHTS takes only with `hard_particles yes`; dt = 50 ns."""
    return wall_bounce(
        name="polystyrene_on_acrylic", steps=1600, time={"step": 5e-8, "duration": 8e-5},
        materials={"ball": {**BALL, "young": 3.25e9}, "wall": WALL},
        particles={
            "source": "explicit", "radius": R, "material": "ball", "position": [[0.001, 0.002, 0.0030005]],
            "velocity": [[0.3, 0.1, -0.5]], "angular_velocity": [[20.0, -30.0, 5.0]],
        },
        output={"trace_every": 5e-8, "history_every": 5e-8},
    )  # fmt: skip


def periodic_bed() -> Scene:
    """27 balls fall on a floor between periodic sides: many contacts at once, rebuilds of the list."""
    return Scene(
        name="periodic_bed",
        materials={"ball": BALL, "wall": WALL},
        pairs=[
            {"materials": ("ball", "ball"), "restitution": 0.5, "friction": 0.3},
            {"materials": ("ball", "wall"), "restitution": 0.6, "friction": 0.2},
        ],
        particles={
            "source": "lattice", "material": "ball", "count": 27, "lo": (0, 0, 0), "hi": (0.02, 0.02, 0.02),
            "radius": R, "velocity_rms": 0.1, "seed": 3,
        },
        walls=[FLOOR],
        gravity=(0.0, 0.0, -9.81),
        domain={"lo": (0, 0, 0), "hi": (0.02, 0.02, 0.05), "periodic": (True, True, False)},
        time={"step": 4e-6, "duration": 0.012},
        output={"trace_every": 4e-5, "history_every": 4e-5},
    )  # fmt: skip


def two_sizes() -> Scene:
    """Unlike spheres of unlike materials, three in a row: several radii, several materials."""
    steel = {"young": 2e7, "poisson": 0.25, "density": 2500.0}
    return Scene(
        name="two_sizes",
        materials={"ball": BALL, "steel": steel},
        pairs=[
            {"materials": ("ball", "ball"), "restitution": 0.5, "friction": 0.3},
            {"materials": ("steel", "ball"), "restitution": 0.7, "friction": 0.5},
            {"materials": ("steel", "steel"), "restitution": 0.9, "friction": 0.1},
        ],
        particles={
            "source": "explicit", "radius": [0.003, 0.002, 0.0025], "material": ["ball", "steel", "ball"],
            "position": [[-0.0052, 0, 0], [0, 0.0005, 0], [0.0048, 0, 0.0004]],
            "velocity": [[0.6, 0.1, 0], [0, 0, 0], [-0.4, 0, 0]],
        },
        domain={"lo": (-0.03,) * 3, "hi": (0.03,) * 3},
        time={"step": 5e-7, "duration": 1.5e-3},
        output={"trace_every": 5e-7},
    )  # fmt: skip


def own_law(name: str, contact: dict, own: dict, **more) -> Scene:
    """Three turning balls in touch on a floor, and a side wall, each wall with another law."""
    side = {**FLOOR, "name": "side", "point": (0.00895, 0, 0), "normal": (-1, 0, 0)}
    return resting(
        name=name, contact=contact, pair={"rolling_friction": 0.2, **more.pop("pair", {})},
        wall_pair={"rolling_friction": 0.1, **more.pop("wall_pair", {})},
        walls=[{**FLOOR, "contact": own}, side], **{"steps": 1500, **more},
    )  # fmt: skip


#: Laws of a wall beside those of particles; name -> scene maker.
OWN_LAWS = {
    "own_rolling_off": lambda: own_law("own_rolling_off", {"rolling": "cdt"}, {"rolling": "off"}),
    "own_rolling_cdt": lambda: own_law("own_rolling_cdt", {}, {"rolling": "cdt"}),
    "own_rolling_epsd2": lambda: own_law("own_rolling_epsd2", {"rolling": "cdt"}, {"rolling": "epsd2"}),
    "own_no_history": lambda: own_law("own_no_history", {}, {"tangential": "no_history"}),
    "own_history": lambda: own_law("own_history", {"tangential": "no_history"}, {"tangential": "history"}),
    "own_tangential_off": lambda: own_law("own_tangential_off", {}, {"tangential": "off"}),
    "own_friction_only": lambda: own_law(
        "own_friction_only", {"tangential": "off"}, {"tangential": "history"}
    ),
    "own_hooke": lambda: own_law(
        "own_hooke", {"characteristic_velocity": 0.5}, {"normal": "hooke", "rolling": "epsd2"}
    ),
    "own_stiffness": lambda: own_law(
        "own_stiffness", {}, {"normal": "hertz/stiffness"}, wall_pair={**STIFFNESS, "restitution": 0.7}
    ),
    "own_hertz": lambda: own_law(
        "own_hertz",
        {"normal": "hooke", "characteristic_velocity": 0.5, "limit_force": True},
        {"normal": "hertz"},
    ),
}


def sticky(name: str, law: str, make, density: float = 2e4, **more) -> Scene:
    """A scene with cohesion between spheres and at walls."""
    contact = {"cohesion": law, **more.pop("contact", {})}
    pair = {"cohesion_energy_density": density, **more.pop("pair", {})}
    if make is not two_spheres:
        more["wall_pair"] = {"cohesion_energy_density": 0.7 * density, **more.pop("wall_pair", {})}
    return make(name=name, contact=contact, pair=pair, **more)


def unlike(name: str, **contact) -> Scene:
    """The three unlike spheres in a row, with cohesion and rolling resistance."""
    base = two_sizes()
    more = {
        "cohesion_energy_density": 3e4, "rolling_friction": 0.1, "rolling_viscous_damping": 0.4,
    }  # fmt: skip
    more |= {"rolling_stiffness": 3.0} if contact["rolling"] == "epsd3" else {}
    pairs = [{**p.model_dump(), **more} for p in base.pairs]
    particles = {
        **base.particles.model_dump(),
        "angular_velocity": [[20.0, -30.0, 5.0], [-10.0, 15.0, 3.0], [4.0, 9.0, -20.0]],
    }
    return base.replace(name=name, pairs=pairs, contact=contact, particles=particles)


EPSD = {"rolling_friction": 0.2, "rolling_viscous_damping": 0.3}
EPSD_WALL = {"rolling_friction": 0.05, "rolling_viscous_damping": 0.6}
FACTOR = {"rolling_stiffness": 1.5}
LINEAR_STIFFNESS = {"kn": 9e3, "kt": 7e3, "gamma_n": 2e3, "gamma_t": 1e3, "restitution": 1.0}


def rolls(name: str, law: str, make, **more) -> Scene:
    """A scene with a rolling spring and its dashpot."""
    factor = FACTOR if law == "epsd3" else {}
    walls = {} if make is two_spheres else {"wall_pair": {**EPSD_WALL, **factor}}
    contact = {"rolling": law, **more.pop("contact", {})}
    return make(name=name, contact=contact, pair={**EPSD, **factor}, **walls, **more)


#: Cohesion, rolling springs with dashpot, twisting friction, linear springs; name -> scene maker.
LATER_LAWS = {
    "sjkr": lambda: sticky("sjkr", "sjkr", two_spheres),
    "sjkr_wall": lambda: sticky("sjkr_wall", "sjkr", wall_bounce),
    "sjkr_resting": lambda: sticky("sjkr_resting", "sjkr", resting),
    "sjkr2": lambda: sticky("sjkr2", "sjkr2", two_spheres),
    "sjkr2_wall": lambda: sticky("sjkr2_wall", "sjkr2", wall_bounce),
    "sjkr_reduce": lambda: sticky(
        "sjkr_reduce", "sjkr", resting, pair={"rolling_friction": 0.2}, wall_pair={"rolling_friction": 0.1},
        contact={"tangential_reduce": True, "rolling": "epsd2"},
    ),
    "sjkr_reduce_cdt": lambda: sticky(
        "sjkr_reduce_cdt", "sjkr", resting, pair={"rolling_friction": 0.2},
        wall_pair={"rolling_friction": 0.1}, contact={"tangential_reduce": True, "rolling": "cdt"},
    ),
    "sjkr_limit_force": lambda: sticky(
        "sjkr_limit_force", "sjkr", two_spheres, contact={"limit_force": True, "tangential_reduce": True}
    ),
    "sjkr_no_history": lambda: sticky(
        "sjkr_no_history", "sjkr2", resting, contact={"tangential": "no_history", "tangential_reduce": True}
    ),
    "sjkr_hooke": lambda: sticky(
        "sjkr_hooke", "sjkr", resting, contact={"normal": "hooke", "characteristic_velocity": 0.5}
    ),
    "sjkr_frictionless": lambda: sticky(
        "sjkr_frictionless", "sjkr", resting, pair={"friction": 0.0}, wall_pair={"friction": 0.0}
    ),
    "unlike_sjkr": lambda: unlike("unlike_sjkr", cohesion="sjkr", rolling="epsd"),
    "unlike_sjkr2": lambda: unlike("unlike_sjkr2", cohesion="sjkr2", rolling="epsd3"),
    "own_sjkr": lambda: own_law(
        "own_sjkr", {}, {"cohesion": "sjkr"}, pair={"cohesion_energy_density": 3e4},
        wall_pair={"cohesion_energy_density": 2e4},
    ),
    "own_sjkr_off": lambda: own_law(
        "own_sjkr_off", {"cohesion": "sjkr2"}, {"cohesion": "off", "rolling": "epsd"},
        pair={"cohesion_energy_density": 3e4}, wall_pair={"cohesion_energy_density": 2e4, **EPSD_WALL},
    ),
    "epsd": lambda: rolls("epsd", "epsd", two_spheres),
    "epsd_wall": lambda: rolls("epsd_wall", "epsd", wall_bounce),
    "epsd_resting": lambda: rolls("epsd_resting", "epsd", resting),
    "epsd3": lambda: rolls("epsd3", "epsd3", two_spheres),
    "epsd3_resting": lambda: rolls("epsd3_resting", "epsd3", resting),
    **{
        f"torsion_{law}": lambda law=law: rolls(
            f"torsion_{law}", law, resting, contact={"torsion": True}
        )
        for law in ("epsd", "epsd3")
    },
    **{
        f"torsion_{law}": lambda law=law: two_spheres(
            name=f"torsion_{law}", contact={"rolling": law, "torsion": True}, pair={"rolling_friction": 0.02}
        )
        for law in ("cdt", "epsd2")
    },
    "hooke_stiffness": lambda: two_spheres(
        name="hooke_stiffness", contact={"normal": "hooke/stiffness"}, pair=LINEAR_STIFFNESS
    ),
    "hooke_stiffness_wall": lambda: wall_bounce(
        name="hooke_stiffness_wall", contact={"normal": "hooke/stiffness"},
        pair=LINEAR_STIFFNESS, wall_pair=LINEAR_STIFFNESS,
    ),
}  # fmt: skip


#: name -> scene maker
AGREEMENT = {
    "two_spheres": two_spheres,
    "wall_bounce": wall_bounce,
    "limit_force": lambda: two_spheres(name="limit_force", contact={"limit_force": True}),
    "limit_force_wall": lambda: wall_bounce(name="limit_force_wall", contact={"limit_force": True}),
    "no_damping": lambda: two_spheres(name="no_damping", contact={"tangential_damping": False}),
    "hooke": lambda: two_spheres(name="hooke", contact={"normal": "hooke", "characteristic_velocity": 0.5}),
    "hooke_wall": lambda: wall_bounce(
        name="hooke_wall", contact={"normal": "hooke", "characteristic_velocity": 0.5}
    ),
    "stiffness": lambda: two_spheres(
        name="stiffness", contact={"normal": "hertz/stiffness"}, pair={**STIFFNESS, "restitution": 1.0}
    ),
    "stiffness_wall": lambda: wall_bounce(
        name="stiffness_wall",
        contact={"normal": "hertz/stiffness"},
        pair={**STIFFNESS, "restitution": 1.0},
        wall_pair={**STIFFNESS, "restitution": 1.0},
    ),
    "no_history": lambda: two_spheres(name="no_history", contact={"tangential": "no_history"}),
    "no_history_wall": lambda: wall_bounce(name="no_history_wall", contact={"tangential": "no_history"}),
    "cdt": lambda: two_spheres(name="cdt", contact={"rolling": "cdt"}, pair={"rolling_friction": 0.2}),
    "cdt_wall": lambda: wall_bounce(
        name="cdt_wall",
        contact={"rolling": "cdt"},
        pair={"rolling_friction": 0.2},
        wall_pair={"rolling_friction": 0.1},
    ),
    "epsd2": lambda: two_spheres(name="epsd2", contact={"rolling": "epsd2"}, pair={"rolling_friction": 0.02}),
    "epsd2_wall": lambda: wall_bounce(
        name="epsd2_wall",
        contact={"rolling": "epsd2"},
        pair={"rolling_friction": 0.2},
        wall_pair={"rolling_friction": 0.01},
    ),
    "epsd2_alone": lambda: resting(
        name="epsd2_alone",
        contact={"rolling": "epsd2"},
        pair={"rolling_friction": 0.2, "friction": 0.0},
        wall_pair={"rolling_friction": 0.1, "friction": 0.0},
    ),
    "epsd2_resting": lambda: resting(
        name="epsd2_resting",
        contact={"rolling": "epsd2"},
        pair={"rolling_friction": 0.2},
        wall_pair={"rolling_friction": 0.1},
    ),
    "frictionless": lambda: two_spheres(name="frictionless", pair={"friction": 0.0}),
    "frictionless_wall": lambda: wall_bounce(
        name="frictionless_wall", pair={"friction": 0.0}, wall_pair={"friction": 0.0}
    ),
    "periodic_crossing": periodic_crossing,
    "gate_removal": gate_removal,
    "two_sizes": two_sizes,
    "polystyrene_on_acrylic": polystyrene_on_acrylic,
    "rebound": rebound,
    "start_in_contact": start_in_contact,
    "periodic_bed": periodic_bed,
    **OWN_LAWS,
    **LATER_LAWS,
}


#: Tangential laws that LIGGGHTS does not have: emulator only; name -> scene maker.
OURS = {
    **{
        f"{law}_{make.__name__}": lambda law=law, make=make: make(
            name=f"{law}_{make.__name__}", contact={"tangential": law}, pair={"restitution": 0.2}
        )
        for law in ("history_rotated", "history_incremental", "history_capped")
        for make in (two_spheres, resting)
    },
    "history_capped_no_spring": lambda: two_spheres(
        name="history_capped_no_spring",
        contact={"tangential": "history_capped", "normal": "hooke/stiffness"},
        pair={**LINEAR_STIFFNESS, "kt": 0.0},
    ),
}  # fmt: skip
