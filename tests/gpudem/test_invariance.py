"""What must not change the result, and what the result must conserve."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gpudem.driver import simulate as run
from gpudem.scene import Scene
from gpudem.solver.solver import Solver
from tests.gpudem.beds import PAIRS, falling_bed, finish, gas, same


def final(scene: Scene, **options) -> dict[str, np.ndarray]:
    simulation = Solver(scene, **options)
    frame = finish(simulation)
    assert simulation.neighbors.rebuilds > 10
    return frame


def blocks(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    """Cuts the half list into blocks of this many particles."""
    monkeypatch.setattr("gpudem.solver.solver.block_size", lambda n, layers: size)


@pytest.fixture(scope="module")
def one_thread() -> dict[str, np.ndarray]:
    with pytest.MonkeyPatch.context() as patch:
        blocks(patch, 400)
        return final(falling_bed(), threads=1)


@pytest.mark.parametrize(
    "options", [{"threads": 1}, {"threads": 2}, {"threads": 5}, {"chunk": 32}, {"threads": 2, "chunk": 7}]
)
def test_bit_identical(one_thread, options, monkeypatch):
    """Repeat, cores, and launches between two looks. Catches races, float atomics, stale neighbour lists."""
    blocks(monkeypatch, 400)
    again = final(falling_bed(), **options)
    same(one_thread, again)


@pytest.mark.parametrize("threads", [1, 2])
def test_new_order_and_blocks_at_a_gate_are_only_rounding(threads, monkeypatch):
    """Where a gate goes, particles are sorted anew along another axis, in other blocks.

    Catches slices that cut new blocks in two, springs looked for by the old blocks, launches recorded before.
    """
    short = falling_bed(1500, time={"step": 2e-5, "duration": 0.045})
    blocks(monkeypatch, 400)
    plain = final(short, threads=1)
    extents = iter([(1.0, 2.0, 3.0), (3.0, 1.0, 2.0)])
    sizes = iter([400, 90])
    monkeypatch.setattr("gpudem.solver.solver.layers_of_cells", lambda x, rate: np.array(next(extents)))
    monkeypatch.setattr("gpudem.solver.solver.block_size", lambda n, layers: next(sizes))
    # the constructor chooses once, then the gate's removal
    turned = final(short, threads=threads)
    for column in ("position", "velocity", "angular_velocity"):
        scale = np.abs(plain[column]).max()
        assert np.abs(plain[column] - turned[column]).max() < 1e-6 * scale, column


@pytest.mark.parametrize("threads", [1, 2])
def test_bit_identical_with_a_full_list(threads, monkeypatch):
    """The list of CUDA devices, on the CPU in slices."""
    blocks(monkeypatch, 400)
    short = falling_bed(time={"step": 2e-5, "duration": 0.02})
    ends = [final(short, threads=count, half_list=False) for count in (1, threads)]
    same(*ends)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"solver": {"integrator": "path"}},
        {"contact": {"rolling": "cdt"}, "pairs": [{**p, "rolling_friction": 0.2} for p in PAIRS]},
        {"contact": {"rolling": "epsd2"}, "pairs": [{**p, "rolling_friction": 0.2} for p in PAIRS]},
    ],
    ids=["history", "path", "cdt", "epsd2"],
)
def test_half_list_is_only_rounding(changes, monkeypatch):
    """A pair once, a pair from both sides, and both at the edges of blocks.

    Catches a torque or spring with the wrong sign for the second of a pair, the lever of the first taken for
    the second, a force kept from the step before, springs lost where a pair moves from one block to two.
    """
    scene = falling_bed(1500, time={"step": 2e-5, "duration": 0.02}, walls=falling_bed().walls[:1], **changes)
    full = final(scene, half_list=False)
    for size in (1500, 70):
        blocks(monkeypatch, size)
        half = final(scene, half_list=True)
        for column in ("position", "velocity", "angular_velocity", "force", "torque"):
            scale = np.abs(full[column]).max()
            assert np.abs(full[column] - half[column]).max() < 1e-9 * scale, (size, column)
    assert np.abs(full["angular_velocity"]).max() > 1.0


def test_half_list_of_several_radii_is_only_rounding(monkeypatch):
    """Catches the first sphere's lever, mass or radius in the second's torque."""
    scene = falling_bed(600, time={"step": 1e-5, "duration": 0.03}, walls=falling_bed().walls[:1], particles={
        "source": "lattice", "material": "ball", "count": 600, "seed": 2,
        "lo": (0, 0, 0), "hi": (0.1, 0.05, 0.4),
        "radius": [{"radius": 0.003, "share": 0.5}, {"radius": 0.002, "share": 0.5}], "velocity_rms": 0.2,
    })  # fmt: skip
    full = final(scene, half_list=False)
    blocks(monkeypatch, 100)
    half = final(scene, half_list=True)
    for column in ("position", "velocity", "angular_velocity"):
        assert np.abs(full[column] - half[column]).max() < 1e-9 * np.abs(full[column]).max(), column


def test_order_of_particles_is_only_rounding():
    """Catches identities lost in the re-ordering: radius, mass or spring of another particle."""
    scene = gas(time={"step": 2e-6, "duration": 0.004})
    state, order = scene.state, np.random.default_rng(0).permutation(len(scene.state))
    listed = {"source": "explicit", "material": "ball", "radius": state.radius, "position": state.position}
    plain = gas(time=scene.time, particles={**listed, "velocity": state.velocity})
    shuffled = {k: v[order] if isinstance(v, np.ndarray) else v for k, v in listed.items()}
    mixed = gas(time=scene.time, particles={**shuffled, "velocity": state.velocity[order]})
    a, b = final(plain), final(mixed)
    assert np.abs(a["velocity"][order] - b["velocity"]).max() < 1e-9
    assert np.abs(a["velocity"] - state.velocity).max() > 0.1


def test_skin_is_only_rounding():
    """Catches pairs missed between rebuilds and springs lost at a rebuild."""
    short = {"step": 2e-5, "duration": 0.02}
    a = final(falling_bed(1500, time=short, walls=falling_bed().walls[:1]))
    b = final(falling_bed(1500, time=short, walls=falling_bed().walls[:1], solver={"skin": 0.0004}))
    assert np.abs(a["position"] - b["position"]).max() < 1e-9


def test_skin_is_only_rounding_with_rolling_torques():
    """Catches rolling torques lost or swapped at a rebuild, in a bed and at walls."""
    rolls = [{**p, "rolling_friction": 0.2} for p in PAIRS]
    more = {"pairs": rolls, "contact": {"rolling": "epsd2"}, "walls": falling_bed().walls[:1]}
    short = {"step": 2e-5, "duration": 0.03}
    a = final(falling_bed(300, time=short, **more))
    b = final(falling_bed(300, time=short, solver={"skin": 0.0004}, **more))
    assert np.abs(a["angular_velocity"] - b["angular_velocity"]).max() < 1e-6
    assert np.abs(a["angular_velocity"]).max() > 1.0


def test_rotation_of_a_free_cluster():
    """Catches an axis treated apart from the others: a cell, a component, a nearest image."""
    turn = Rotation.from_rotvec([0.7, -0.4, 1.1]).as_matrix()
    rng = np.random.default_rng(5)
    position = rng.permutation([[i, j, k] for i in range(2) for j in range(2) for k in range(2)]) * 0.0058
    velocity, spin = rng.normal(0, 0.3, (8, 3)), rng.normal(0, 30, (8, 3))

    def cluster(q: np.ndarray) -> dict[str, np.ndarray]:
        listed = {"source": "explicit", "material": "ball", "radius": 0.003}
        return final_free(falling_bed(8, walls=[], gravity=(0, 0, 0), time={"step": 2e-6, "duration": 2e-3},
            particles=listed | {"position": position @ q.T + 0.02, "velocity": velocity @ q.T,
                                "angular_velocity": spin @ q.T},
            domain={"lo": (-0.1,) * 3, "hi": (0.1,) * 3}))  # fmt: skip

    plain, turned = cluster(np.eye(3)), cluster(turn)
    for column in ("velocity", "angular_velocity"):
        scale = np.abs(plain[column]).max()
        assert np.abs(plain[column] @ turn.T - turned[column]).max() < 1e-9 * scale, column
    assert np.abs(plain["velocity"] - velocity).max() > 0.1


def test_momentum_of_an_elastic_gas():
    """Catches forces that are not opposite and a wrong image at periodic sides."""
    scene = gas()
    mass = scene.masses[:, None]
    end, velocity = final(scene), scene.state.velocity
    change = (mass * end["velocity"]).sum(axis=0) - (mass * velocity).sum(axis=0)
    assert np.abs(change).max() < 1e-14 * (mass * np.abs(velocity)).sum()
    assert np.abs(end["velocity"] - velocity).max() > 0.5


def test_energy_of_an_elastic_gas_is_second_order():
    """A quarter of the step: a sixteenth of the error. Catches an integrator of first order (a quarter)."""

    def drift(step: float) -> float:
        history = run(gas(time={"step": step, "duration": 0.01}, output={"history_every": 1e-4})).history
        apart = history[history.contacts == 0]
        assert len(apart) > 20  # energy is all kinetic where nobody touches
        assert history.contacts.max() > 0
        energy = apart.kinetic_energy.to_numpy()
        return float(np.abs(energy / energy[0] - 1).max())

    coarse, fine = drift(4e-6), drift(1e-6)
    assert fine < 1e-5
    assert coarse / fine > 8


def test_angular_momentum_of_a_free_cluster():
    """Orbital and spin together, with friction. Catches a torque without its counterpart, a wrong lever."""
    scene = falling_bed(8, walls=[], gravity=(0, 0, 0), particles={
        "source": "explicit", "material": "ball", "radius": 0.003,
        "position": [[0.1 + 0.0058 * i, 0.02 + 0.0058 * j, 0.1 + 0.0058 * k]
                     for i in range(2) for j in range(2) for k in range(2)],
        "velocity": np.random.default_rng(4).normal(0, 0.3, (8, 3)),
    }, time={"step": 2e-6, "duration": 2e-3})  # fmt: skip
    mass = scene.masses[:, None]

    def angular(f: dict[str, np.ndarray]) -> np.ndarray:
        inertia = 0.4 * mass * f["radius"][:, None] ** 2
        return (np.cross(f["position"], mass * f["velocity"]) + inertia * f["angular_velocity"]).sum(axis=0)

    start = {k: getattr(scene.state, k) for k in ("position", "velocity", "angular_velocity", "radius")}
    end = final_free(scene)
    assert np.abs(end["angular_velocity"]).max() > 1.0
    # Friction acts at R - overlap/2 on both sides: the lever arms add up to the distance, so L is exact
    # up to the half-step offset between positions and impulses, of first order in dt.
    scale = np.linalg.norm(np.cross(start["position"], mass * start["velocity"]), axis=1).sum()
    assert np.abs(angular(end) - angular(start)).max() < 1e-12 * scale


def final_free(scene: Scene) -> dict[str, np.ndarray]:
    simulation = Solver(scene)
    simulation.start()
    simulation.advance(scene.n_steps - 1)
    simulation.write_step()
    return simulation.frame()
