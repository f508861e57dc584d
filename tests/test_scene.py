"""The scene: same object from TOML, JSON and Python; what follows from the statement."""

from __future__ import annotations

import itertools
import json
import math
import operator
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpudem.scene import (
    Box,
    Contact,
    Domain,
    Explicit,
    FromFile,
    Lattice,
    Material,
    Output,
    Pair,
    Plane,
    Scene,
    SceneError,
    Time,
)
from gpudem.scene.time_step import contact_time, rayleigh_time
from tests.counting import calls

MATERIALS = {
    "ps": Material(young=3.25e7, poisson=0.34, density=1050),
    "acrylic": Material(young=3.2e7, poisson=0.37, density=1190),
}
PAIRS = [
    Pair(materials=("ps", "ps"), restitution=0.9, friction=0.3, rolling_friction=0.1),
    Pair(materials=("acrylic", "ps"), restitution=0.8),
]
FLOOR = Plane(name="floor", material="acrylic", point=(0, 0, 0), normal=(0, 0, 2))
GATE = Plane(name="gate", material="acrylic", point=(0.05, 0, 0), normal=(-1, 0, 0), removed_at=0.02)


def scene(**changes) -> Scene:
    """Two balls over a floor, behind a gate that is removed at 0.02 s."""
    return Scene(
        **{
            "name": "two",
            "materials": MATERIALS,
            "pairs": PAIRS,
            "particles": Explicit(position=[[0, 0, 0.01], [0.02, 0, 0.01]], radius=0.003, material="ps"),
            "gravity": (0, 0, -9.81),
            "walls": [FLOOR, GATE],
            "domain": Domain(lo=(-0.1, -0.1, 0), hi=(0.1, 0.1, 0.2)),
            "time": Time(step=1e-5, duration=0.1),
            **changes,
        }
    )


# -- one object ----------------------------------------------------------------------------------------------


def test_json_round_trip_is_exact() -> None:
    """Floats that have no short decimal form come back to the last bit."""
    one = scene(particles=Explicit(position=[[0.1 / 3, 1 / 7, 0.01]], radius=[np.pi / 1000], material=["ps"]),
                domain=Domain(lo=(-1, -1, 0), hi=(1, 1, 1)), walls=[FLOOR])  # fmt: skip
    back = Scene.from_json(one.to_json())
    assert back == one
    assert back.hash == one.hash
    assert np.array_equal(back.state.position, one.state.position)
    assert back.walls == (FLOOR,)


@given(
    young=st.floats(1e6, 1e12),
    restitution=st.floats(1e-3, 1),
    x=st.floats(-0.05, 0.05),
    duration=st.floats(1e-3, 10),
)
@settings(max_examples=25, deadline=None)
def test_any_valid_scene_survives_json(young: float, restitution: float, x: float, duration: float) -> None:
    one = scene(
        materials={**MATERIALS, "ps": {"young": young, "poisson": 0.3, "density": 1000}},
        pairs=[{"materials": ["ps", "ps"], "restitution": restitution}, PAIRS[1]],
        particles={"source": "explicit", "position": [[x, 0, 0.05]], "radius": 0.003, "material": "ps"},
        walls=[FLOOR],
        time={"step": 1e-7, "duration": duration},
        allow=["time_step"],
    )
    back = Scene.from_json(one.to_json())
    assert back == one
    assert back.materials["ps"].young == young
    assert back.state.position[0, 0] == x


def test_hash_is_of_the_physics() -> None:
    """A recorded run is found again after a renaming, and not after any change of a number."""
    one = scene()
    assert one.replace(name="other", title="Other").hash == one.hash
    changed = [
        one.replace(time={"step": 1.0000000000000002e-5}),
        one.replace(gravity=(0, 0, -9.8)),
        one.replace(contact={"normal": "hertz", "limit_force": True}),
        one.replace(particles={"radius": 0.0030001}),
        one.replace(walls=[FLOOR]),
        one.replace(solver={"precision": "float32"}),
    ]
    assert len({s.hash for s in [one, *changed]}) == 7
    assert len({one, scene(), *changed}) == 7


def test_hash_of_a_file_is_of_its_content(tmp_path: Path) -> None:
    """Moving the particle file changes nothing; changing a digit in it does."""
    particles = ["x,y,z,radius\n0,0,0.01,0.003\n", "x,y,z,radius\n0,0,0.01,0.0031\n"]
    for name, text in (("a.csv", particles[0]), ("b.csv", particles[0]), ("c.csv", particles[1])):
        (tmp_path / name).write_text(text)
    a, b, c = (
        scene(particles=FromFile(source="file", path=str(tmp_path / f"{k}.csv"), material="ps"))
        for k in "abc"
    )
    assert a.hash == b.hash
    assert a.hash != c.hash


def test_particle_file_counts_from_the_scene_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "p.csv").write_text("x,y,z,radius\n0,0,0.01,0.003\n")
    text = (Path(__file__).parents[1] / "examples" / "drop.toml").read_text()
    start, end = text.index('source = "explicit"'), text.index("[[walls]]")
    edited = text[:start] + 'source = "file"\npath = "p.csv"\nmaterial = "polystyrene"\n' + text[end:]
    (tmp_path / "here" / "s.toml").write_text(edited)
    monkeypatch.chdir(tmp_path)
    read = Scene.from_toml("here/s.toml")
    monkeypatch.chdir(tmp_path / "here")
    assert len(Scene.from_json(read.to_json()).state) == 1


def test_a_scene_is_frozen() -> None:
    one = scene()
    with pytest.raises(ValueError, match="frozen"):
        one.time.step = 1.0
    with pytest.raises(ValueError, match="read-only"):
        one.particles.position[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        one.state.radius[0] = 1.0


def test_replace_merges_and_validates() -> None:
    one = scene(output=Output(frames_every=0.01))
    two = one.replace(time={"step": 2e-5}, output={"trace_every": 0.001})
    assert (two.time.step, two.time.duration) == (2e-5, 0.1)
    assert (two.output.frames_every, two.output.trace_every) == (0.01, 0.001)
    assert one.time.step == 1e-5
    with pytest.raises(SceneError, match=r"time\.step"):
        one.replace(time={"step": -1})


def test_a_copy_does_not_keep_what_followed_from_the_original() -> None:
    """Of pydantic's own copy, which knows nothing of cached properties."""
    one = scene()
    assert (one.hash, len(one.planes), one.needs.gate) == (scene().hash, 2, True)
    copied = one.model_copy(update={"walls": (FLOOR,)})
    assert len(copied.planes) == 1
    assert copied.needs.gate is False
    assert copied.hash == scene(walls=[FLOOR]).hash


def test_replace_with_another_source_does_not_keep_the_old_keys() -> None:
    lattice = {"source": "lattice", "material": "ps", "count": 3, "lo": (0, 0, 0), "hi": (0.04, 0.04, 0.04)}
    assert len(scene().replace(particles={**lattice, "radius": 0.003}).state) == 3


def test_numpy_numbers_are_numbers() -> None:
    one = scene(
        time={"step": np.float32(1e-5), "duration": np.float64(0.1)},
        gravity=np.array([0, 0, -9.81]),
        domain=Domain(lo=np.array([-1, -1, 0]), hi=(np.int64(1), 1, 1)),
    )
    assert type(one.time.step) is float
    assert one.domain.hi == (1.0, 1.0, 1.0)
    Scene.from_json(one.to_json())


NUMPY_LATTICE = {
    "source": "lattice", "material": np.str_("ps"), "count": np.int32(4), "lo": np.zeros(3, np.float32),
    "hi": [np.float64(0.05), np.array(0.05), 0.05], "radius": np.float32(0.003), "spacing": np.int64(2),
    "jitter": np.array(0.5), "velocity_rms": np.float16(0), "seed": np.uint64(3),
}  # fmt: skip


def test_numpy_scalars_in_every_field() -> None:
    """Whole numbers, booleans, text and numbers in lists too; what is stored is Python's own."""
    one = scene(
        particles=NUMPY_LATTICE, name=np.str_("two"),
        materials={
            np.str_("ps"): {"young": np.float32(5e6), "poisson": np.array(0.3), "density": np.int64(1050)},
            "acrylic": MATERIALS["acrylic"],
        },
        contact={
            "normal": np.str_("hooke"), "characteristic_velocity": np.array(1), "limit_force": np.bool_(True)
        },
        domain={"lo": (-1, -1, 0), "hi": (1, 1, 1), "periodic": np.array([False, True, False])},
    )  # fmt: skip
    assert one.particles.count == 4
    assert one.domain.periodic == (False, True, False)
    assert one.contact.limit_force is True
    assert type(one.particles.seed) is int
    assert type(one.materials["ps"].density) is float
    assert Scene.from_json(one.to_json()) == one
    changed = one.replace(
        domain={"periodic": [np.bool_(False), np.array(True), False]}, particles={"count": np.int64(5)},
        time={"step": np.float32(1e-6)},
    )  # fmt: skip
    assert changed.domain.periodic == (False, True, False)
    assert len(changed.state) == 5
    assert changed.time.step == float(np.float32(1e-6))


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("count", np.float64(4), "must be a whole number"),
        ("count", np.bool_(True), "must be a whole number"),
        ("radius", np.bool_(True), r"must be a number \[m\]"),
        ("radius", np.complex64(1), r"must be a number \[m\]"),
        ("radius", np.array(["x"])[0], r"must be a number \[m\]"),
        pytest.param("jitter", 10**400, "out of range", id="huge"),
        pytest.param("lo", (0, 0, -(10**400)), "three finite numbers", id="huge vector"),
        ("lo", (0, 0, np.bool_(False)), "must be three numbers"),
        ("hi", np.zeros((3, 1)), "must be three numbers"),
    ],
)
def test_what_is_no_number(key: str, value: object, message: str) -> None:
    """Catches a float taken for a count, a boolean for a number, and an OverflowError in the user's face."""
    with pytest.raises(SceneError, match=message) as caught:
        scene(particles=NUMPY_LATTICE | {key: value})
    assert len(caught.value.problems) == 1


def test_a_number_of_thousands_of_digits() -> None:
    """Python does not print it: the message leaves it out, and JSON and TOML say what they cannot read."""
    with pytest.raises(SceneError, match=r"particles\.seed = \.\.\.: "):
        scene(particles=NUMPY_LATTICE | {"seed": -(10**5000)})
    with pytest.raises(SceneError, match="not JSON: Exceeds the limit"):
        Scene.from_json('{"seed": ' + "1" * 5000 + "}")
    with pytest.raises(SceneError, match="not JSON: maximum recursion depth"):
        Scene.from_json("[" * 100_000)


def many(n: int) -> Explicit:
    """So many balls on a lattice with numbers of 17 digits."""
    rng, side = np.random.default_rng(0), int(np.ceil(n ** (1 / 3)))
    grid = np.stack(np.unravel_index(np.arange(n), (side, side, side)), axis=1)
    return Explicit(
        position=-0.08 + 3e-3 * grid + 1e-5 * rng.uniform(-1, 1, (n, 3)) + [0, 0, 0.09],
        radius=rng.uniform(1e-3, 1.4e-3, n), material="ps", velocity=rng.normal(0, 1e-3, (n, 3)),
    )  # fmt: skip


def test_cost_of_a_scene_of_1e5_particles() -> None:
    """Catches a loop over particles, or JSON written number by number: calls do not grow with particles."""
    big = {
        "walls": [],
        "domain": Domain(lo=(-1, -1, 0), hi=(1, 1, 1)),
        "time": Time(step=1e-6, duration=1e-3),
    }
    one, other = (scene(particles=many(100_000), **big) for _ in range(2))
    assert calls(operator.eq, one, other) < 1000  # the first time: the hash is kept
    assert len({one, other}) == 1
    assert calls(one.to_json) < 5000
    assert Scene.from_json(one.to_json()) == one


def test_equality_is_of_name_title_and_physics() -> None:
    """Not of the text of floats, nor of lists for arrays; another digit, name or title is another scene."""
    one = scene()
    assert one == scene(gravity=[0, 0, np.float64(-9.81)])
    assert one != one.replace(title="x")
    assert one != one.replace(name="other")
    assert one != one.replace(particles={"position": [[0, 0, 0.01], [0.02, 0, 0.010000000000000002]]})
    assert one != "two"
    assert pickle.loads(pickle.dumps(one)) == one
    listed = Explicit(position=[[0, 0, 1], [0, 1, 1]], radius=[1, 2], material="ps")
    assert listed == Explicit(
        position=np.array([[0, 0, 1], [0, 1, 1]]), radius=np.array([1, 2]), material="ps"
    )
    assert len({listed, Explicit(position=[[0, 0, 1], [0, 1, 1]], radius=[1, 2], material="ps")}) == 1
    assert listed != Explicit(position=[[0, 0, 1], [0, 1, 1]], radius=[1, 3], material="ps")
    assert listed != Explicit(position=[[0, 0, 1], [0, 1, 1]], radius=[1, 2], material=["ps", "ps"])


def test_json_has_a_particle_a_line_and_any_title() -> None:
    """A title that looks like a placeholder of the writer stays what it is."""
    one = scene(title='@position\n"@material"', particles={**many(3).model_dump(), "material": ["ps"] * 3})
    assert Scene.from_json(one.to_json()) == one
    assert json.loads(one.to_json())["title"] == one.title
    assert len(one.to_json().splitlines()) < 170


def test_many_materials_cost_little() -> None:
    """Catches work of pairs times materials: all pairs of 200 materials cost four times those of 100."""

    def of(count: int) -> Scene:
        names = [f"m{k}" for k in range(count)]
        particles = {**many(count).model_dump(), "material": names}
        every = itertools.combinations_with_replacement(names, 2)
        pairs = [{"materials": two, "restitution": 0.5} for two in every]
        materials = dict.fromkeys(names, MATERIALS["ps"])
        return scene(materials=materials, pairs=pairs, particles=particles, walls=[])

    assert len(of(200).contact_pairs) == 20_100
    assert calls(lambda: of(200).contact_pairs) < 4.5 * calls(lambda: of(100).contact_pairs)


# -- what follows --------------------------------------------------------------------------------------------


def test_needs_only_what_is_there() -> None:
    """A frictionless scene asks for no spin, no history; each ingredient switches its own flag only."""
    smooth = [
        PAIRS[0].model_copy(update={"friction": 0.0, "restitution": 1.0}),
        PAIRS[1].model_copy(update={"restitution": 1.0}),
    ]
    bare = scene(pairs=smooth, gravity=(0, 0, 0), walls=[])
    assert not any(value for _, value in bare.needs)
    assert scene(walls=[FLOOR]).needs.gate is False
    full = scene(contact=Contact(rolling="cdt"))
    sticky = [p.model_copy(update={"cohesion_energy_density": 1e3}) for p in smooth]
    assert bare.replace(pairs=sticky, contact={"cohesion": "sjkr"}).needs.cohesion
    wanted = {n for n, v in full.needs if v}
    assert wanted == {"tangential", "history", "rolling", "rotation", "damping", "gravity", "walls", "gate"}
    assert scene(contact=Contact(tangential="no_history")).needs.history is False
    assert scene(contact=Contact(tangential="off")).needs.rotation is False
    spin = Explicit(position=[[0, 0, 0.01]], radius=0.003, material="ps", angular_velocity=[[0, 1, 0]])
    assert bare.replace(particles=spin).needs.rotation is True
    mixed = Explicit(
        position=[[0, 0, 0.01], [0.02, 0, 0.01]], radius=[0.003, 0.002], material=["ps", "acrylic"]
    )
    both = bare.replace(particles=mixed, pairs=[*smooth, Pair(materials=("acrylic", "acrylic"))])
    assert both.needs.several_radii
    assert both.needs.several_materials


def test_friction_that_no_contact_has_is_not_needed() -> None:
    """Friction of a pair that cannot touch here (wall with wall) must not cost rotation."""
    pairs = [
        PAIRS[0].model_copy(update={"friction": 0.0, "rolling_friction": 0.0}),
        PAIRS[1],
        Pair(materials=("acrylic", "acrylic"), friction=0.5),
    ]
    assert scene(pairs=pairs).needs.tangential is False
    assert [set(p.materials) for p in scene(pairs=pairs).contact_pairs] == [{"ps"}, {"ps", "acrylic"}]


def test_pair_in_either_order() -> None:
    one = scene()
    found = one.pair("ps", "acrylic")
    assert found is not None
    assert found is one.pair("acrylic", "ps")
    assert found.restitution == 0.8
    assert one.pair("ps", "steel") is None


def test_box_faces_inwards() -> None:
    """Every side's normal points to the middle: a flipped sign would throw all particles out."""
    box = Box(kind="box", name="box", material="acrylic", lo=(-0.1, -0.05, 0), hi=(0.1, 0.05, 0.2))
    planes = scene(walls=[box]).planes
    assert [p.name for p in planes] == [f"box_{s}" for s in ("xlo", "xhi", "ylo", "yhi", "zlo", "zhi")]
    middle = np.array([0, 0, 0.1])
    distances = [(middle - np.array(p.point)) @ np.array(p.normal) for p in planes]
    np.testing.assert_allclose(distances, [0.1, 0.1, 0.05, 0.05, 0.1, 0.1])


def test_box_takes_the_domain_by_default() -> None:
    planes = scene(walls=[Box(kind="box", name="box", material="acrylic", sides=("xlo", "zhi"))]).planes
    assert [(p.point, p.normal) for p in planes] == [
        ((-0.1, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.2), (0.0, 0.0, -1.0)),
    ]


def test_normals_have_length_one() -> None:
    assert scene().planes[0].normal == (0.0, 0.0, 1.0)
    oblique = scene(walls=[FLOOR.model_copy(update={"normal": (1.0, 2.0, 2.0)})]).planes[0].normal
    assert oblique == (1 / 3, 2 / 3, 2 / 3)


@pytest.mark.parametrize("length", [1.0, 1e-17, 3e15])
@pytest.mark.parametrize("degrees", [0, 90, 180, 270, 360, 450])
def test_rounding_of_a_computed_normal_is_removed(degrees: int, length: float) -> None:
    """cos 90 deg = 6e-17 is no tilt: what follows (decks, sides, meshes) sees a plane along an axis."""
    angle = math.radians(degrees)
    normal = (length * math.cos(angle), length * 1e-14, length * math.sin(angle))
    plane = Plane(name="floor", material="acrylic", point=(0, 0, 0), normal=normal)
    found = scene(walls=[], domain=Domain(lo=(-1, -1, -1), hi=(1, 1, 1)))
    found = found.model_copy(update={"walls": (plane,)})
    expected = tuple(float(round(c)) for c in (math.cos(angle), 0.0, math.sin(angle)))
    assert found.planes[0].normal == expected
    assert plane.unit_normal == expected


def test_a_small_tilt_stays_a_tilt() -> None:
    """A normal is never rounded by more than what arithmetic leaves."""
    tilted = Plane(name="floor", material="acrylic", point=(0, 0, 0), normal=(1e-9, 0, 1))
    assert tilted.unit_normal == (1e-9, 0.0, 1.0)
    both = Plane(name="floor", material="acrylic", point=(0, 0, 0), normal=(1e-16, 1, 1))
    assert both.unit_normal == (0.0, 1 / math.sqrt(2.0), 1 / math.sqrt(2.0))


def test_segments_split_at_the_gate() -> None:
    """Both codes stop, remove the plane and set forces up anew at exactly this step."""
    one = scene()
    assert [(a, b, [p.name for p in planes]) for a, b, planes in one.segments] == [
        (0, 2000, ["floor", "gate"]),
        (2000, 10000, ["floor"]),
    ]
    late = one.replace(time={"duration": 0.01})
    assert [(a, b) for a, b, _ in late.segments] == [(0, 1000)]


def test_steps_and_strides() -> None:
    one = scene(output=Output(frames_every=0.03, trace_every=1e-9))
    assert one.frame_stride == 3000
    assert one.n_steps == 12000, "the duration is rounded up to whole frames"
    assert one.stride(one.output.trace_every) == 1
    assert one.stride(None) is None
    assert scene().n_steps == 10000 == scene().frame_stride
    assert scene(time=Time(step=1e-5, duration=0.3)).n_steps == 30000, "0.3 / 1e-5 is not 30000 in floats"


def test_time_limits_against_published_formulas() -> None:
    """Numbers worked out by hand for R = 3 mm, E = 3.25e7 Pa, nu = 0.34, rho = 1050: no factor is off."""
    one = scene(gravity=(0, 0, 0))
    shear = 3.25e7 / 2.68
    assert rayleigh_time(one) == pytest.approx(np.pi * 0.003 * (1050 / shear) ** 0.5 / 0.932054, rel=1e-12)
    assert contact_time(one) == np.inf, "nothing moves"
    v = 0.5
    moving = one.replace(particles={"velocity": [[v, 0, 0], [0, 0, 0]]})
    mass, modulus = 1050 * 4 / 3 * np.pi * 0.003**3 / 2, 3.25e7 / (2 * (1 - 0.34**2))
    assert contact_time(moving) == pytest.approx(
        2.87 * (mass**2 / (0.0015 * modulus**2 * 2 * v)) ** 0.2, rel=1e-3
    )


def test_lattice_mixture_comes_from_a_list_of_shares() -> None:
    mixture = Lattice(source="lattice", material="ps", count=200, lo=(-0.05, -0.05, 0), hi=(0.05, 0.05, 0.2),
                      radius=[{"radius": 0.002, "share": 3}, {"radius": 0.003, "share": 1}])  # fmt: skip
    one = scene(particles=mixture, walls=[FLOOR])
    assert Scene.from_json(one.to_json()) == one
    assert one.needs.several_radii


@pytest.mark.parametrize("periodic", [(False, False, False), (True, False, True), (True, True, True)])
def test_start_overlaps_against_every_pair(periodic: tuple[bool, bool, bool]) -> None:
    """Catches a pair missed or counted twice over a side, an edge or a corner, and a limit by the larger."""
    rng, n, size = np.random.default_rng(3), 150, np.array([0.05, 0.04, 0.06])
    radius = rng.choice([0.002, 0.003], n)
    position = rng.uniform(0.1, 0.9, (n, 3)) * size
    position[:2] = [[0.0005, 0.0005, 0.0005], [0.0495, 0.0395, 0.0595]]  # over a corner
    data = {
        "particles": Explicit(material="ps", position=position, radius=radius),
        "walls": [], "domain": Domain(lo=(0, 0, 0), hi=tuple(size), periodic=periodic),
    }  # fmt: skip
    d = position[:, None] - position
    d -= np.where(periodic, size * np.round(d / size), 0.0)
    i, j = np.triu_indices(n, 1)
    share = (radius[i] + radius[j] - np.linalg.norm(d[i, j], axis=1)) / np.minimum(radius[i], radius[j])
    worst = int(np.argmax(share))
    with pytest.raises(SceneError) as caught:
        scene(**data)
    found = f"{(share > 0.1).sum()} pairs overlap at the start, the worst: {i[worst] + 1} and {j[worst] + 1} "
    assert found in str(caught.value)
    assert ((share > 0) & (share < 0.1)).any()


def test_start_overlap_over_a_corner() -> None:
    """Catches images of images left out: the two meet over three sides at once."""
    corner = {
        "particles": Explicit(material="ps", radius=0.002, position=[[0.0005] * 3, [0.0495] * 3]),
        "walls": [],
    }
    scene(**corner, domain=Domain(lo=(0, 0, 0), hi=(0.05, 0.05, 0.05), periodic=(True, True, False)))
    with pytest.raises(SceneError, match=r"1 pairs overlap at the start, the worst: 1 and 2 by 0\.00227 m"):
        scene(**corner, domain=Domain(lo=(0, 0, 0), hi=(0.05, 0.05, 0.05), periodic=(True, True, True)))
