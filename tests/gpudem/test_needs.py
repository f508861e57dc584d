"""What a scene does not need is not there: no array, and no code that could touch one."""

from gpudem.solver.solver import Solver
from gpudem.solver.spec import Spec
from tests.gpudem.beds import PAIRS, falling_bed, gas


def arrays(scene) -> set[str]:
    simulation = Solver(scene)
    simulation.start()
    return set(simulation.memory_bytes())


def test_full_scene_has_everything_it_needs():
    names = arrays(falling_bed(50))
    assert {
        "particles.spring",
        "particles.wall_start",
        "now.angular_velocity",
    } <= names
    assert not {"particles.radius", "particles.mass", "particles.material", "particles.pairs"} & names


def test_frictionless_gas_has_no_spin_spring_or_wall():
    names = arrays(gas())
    forbidden = {"spring", "wall_start", "neighbor_count", "angular_velocity", "material"}
    assert not {name for name in names if name.split(".")[1] in forbidden}
    assert {"particles.radius", "particles.mass"} <= names


def test_rolling_torques_are_kept_only_for_epsd2():
    """Without friction too: then the torque is kept and no shear spring is there."""
    kept = {"particles.rolling_torque"}
    springs = {"particles.spring"}
    rolls = [{**p, "rolling_friction": 0.1} for p in PAIRS]
    slides = [{**p, "friction": 0.0} for p in rolls]
    assert not kept & arrays(falling_bed(50, pairs=rolls, contact={"rolling": "cdt"}))
    assert kept | springs <= arrays(falling_bed(50, pairs=rolls, contact={"rolling": "epsd2"}))
    alone = arrays(falling_bed(50, pairs=slides, contact={"rolling": "epsd2"}))
    assert kept <= alone
    assert not springs & alone


def test_friction_that_cannot_act_counts_for_nothing():
    """A frictional pair of materials that never meet brings no friction."""
    pairs = [{**PAIRS[0], "friction": 0.0}, {**PAIRS[1], "friction": 0.0},
             {"materials": ("wall", "wall"), "friction": 0.5}]  # fmt: skip
    assert Spec.of(falling_bed(50, pairs=pairs)) == Spec(
        walls=("plane",), gravity=True, rotation=False, tangential="off"
    )


def test_nothing_is_written_before_it_is_asked_for():
    assert not {name for name in arrays(falling_bed(50)) if name.startswith("output.")}
