"""The table of bad scenes: each row edits one valid scene file. Used by test_bad_scenes.py."""

from __future__ import annotations

import dataclasses

GOOD = """
name = "bed"
gravity = [0.0, 0.0, -9.81]
[materials.ps]
young = 3.25e7
poisson = 0.34
density = 1050.0
[materials.acrylic]
young = 3.2e7
poisson = 0.37
density = 1190.0
[[pairs]]
materials = ["ps", "ps"]
restitution = 0.9
[[pairs]]
materials = ["ps", "acrylic"]
restitution = 0.8
[contact]
normal = "hertz"
[particles]
source = "explicit"
position = [[0.0, 0.0, 0.01], [0.02, 0.0, 0.01]]
velocity = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
radius = 0.003
material = "ps"
[[walls]]
kind = "plane"
name = "floor"
material = "acrylic"
point = [0.0, 0.0, 0.0]
normal = [0.0, 0.0, 1.0]
[domain]
lo = [-0.1, -0.1, 0.0]
hi = [0.1, 0.1, 0.2]
periodic = [false, false, false]
[time]
step = 1e-5
duration = 0.1
[output]
frames_every = 0.01
"""

PLANE = 'kind = "plane"\nname = "floor"'
LATTICE = """source = "lattice"
count = 100
lo = [-0.1, -0.1, 0.0]
hi = [0.1, 0.1, 0.2]
radius = 0.003
"""
EXPLICIT = GOOD[GOOD.index('source = "explicit"') : GOOD.index('material = "ps"\n[[walls]]')]


@dataclasses.dataclass(frozen=True)
class Bad:
    """One row: edits {old: new} of the good scene, fragments of the message, number of problems listed."""

    name: str
    edits: dict[str, str]
    expected: tuple[str, ...]
    problems: int = 1

    def text(self) -> str:
        text = GOOD
        for old, new in self.edits.items():
            assert text.count(old) == 1, f"{old!r} must stand in the good scene exactly once"
            text = text.replace(old, new)
        return text


def bad(name: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    return Bad(name, {old: new}, expected, problems)


MESH = """kind = "mesh"
name = "chute"
material = "acrylic"
vertices = [[-0.05, -0.05, 0.05], [0.05, -0.05, 0.05], [0.0, 0.05, 0.05]]
triangles = [[0, 1, 2]]
"""
CYLINDER = """kind = "cylinder"
name = "pipe"
material = "acrylic"
radius = 0.04
point = [0.0, 0.0, 0.1]
axis = [0.0, 0.0, 1.0]
length = 0.05
"""
CONE = """kind = "cone"
name = "hopper"
material = "acrylic"
radius = 0.01
end_radius = 0.04
point = [0.0, 0.0, 0.05]
axis = [0.0, 0.0, 1.0]
length = 0.05
"""


def bad_wall(name: str, wall: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with one wall more, in which `old` is replaced by `new`."""
    assert wall.count(old) == 1, f"{old!r} must stand in the wall exactly once"
    wall = wall.replace(old, new)
    return Bad(name, {"[domain]": f"[[walls]]\n{wall}[domain]"}, expected, problems)


# fmt: off
FIELDS = [
    bad("unknown key", "duration = 0.1", "duration = 0.1\ndurration = 1", "time.durration: unknown key",
        "did you mean 'duration'?"),
    bad("unknown section", "[output]", "[outputs]", "outputs: unknown key; did you mean 'output'?"),
    bad("unknown material key", "young = 3.25e7", "young = 3.25e7\nyuong = 1", "materials.ps.yuong: unknown key",
        "'young'"),
    bad("unknown key nothing near", "[time]", "[time]\nxyzzy = 1", "time.xyzzy: unknown key; known: step, duration"),
    bad("missing key", "poisson = 0.34\n", "", "materials.ps.poisson: missing [1]"),
    bad("missing section", "[time]\nstep = 1e-5\nduration = 0.1", "", "time: missing"),
    bad("number in quotes", "young = 3.25e7", 'young = "3.25e7"', "materials.ps.young = '3.25e7'",
        "must be a number [Pa]"),
    bad("true as number", "restitution = 0.9", "restitution = true", "pairs[0].restitution = True", "number [1]"),
    bad("number as flag", "[contact]", "[contact]\nlimit_force = 1", "contact.limit_force = 1",
        "must be true or false"),
    bad("number as name", 'name = "bed"', "name = 7", "name = 7: must be text in quotes"),
    Bad("section is a number", {"[output]\nframes_every = 0.01": "", 'name = "bed"': 'name = "bed"\noutput = 3'},
        ("output = 3: must be a table",)),
    bad("infinite", "duration = 0.1", "duration = inf", "time.duration = inf: out of range", "[s]"),
    bad("nan vector", "gravity = [0.0, 0.0, -9.81]", "gravity = [0.0, nan, -9.81]", "gravity = [0.0, nan, -9.81]",
        "three finite numbers [m/s2]"),
    bad("two components", "gravity = [0.0, 0.0, -9.81]", "gravity = [0.0, -9.81]", "three numbers [m/s2]"),
    bad("negative radius", "radius = 0.003", "radius = -0.003", "particles.radius = -0.003: out of range",
        "allowed: 0 < value [m]"),
    bad("one radius zero", "radius = 0.003", "radius = [0.003, 0.0]", "particles.radius", "row 2 = 0 out of range",
        "[m]"),
    bad("poisson", "poisson = 0.34", "poisson = 0.51", "materials.ps.poisson = 0.51", "0 <= value <= 0.5 [1]"),
    bad("restitution zero", "restitution = 0.9", "restitution = 0.0", "pairs[0].restitution = 0.0",
        "0 < value <= 1 [1]"),
    bad("restitution above one", "restitution = 0.9", "restitution = 1.1", "pairs[0].restitution = 1.1",
        "0 < value <= 1 [1]"),
    bad("negative friction", "restitution = 0.9", "friction = -0.1", "pairs[0].friction = -0.1",
        "0 <= value [1]"),
    bad("zero density", "density = 1050.0", "density = 0", "materials.ps.density = 0", "0 < value", "[kg/m3]"),
    bad("auto step without accuracy", "step = 1e-5", 'step = "auto"',
        'time.accuracy: missing; step = "auto" needs it: 1e-06 <= value <= 0.1 [1]'),
    bad("auto step of no accuracy", "step = 1e-5", 'step = "auto"\naccuracy = 0.5',
        "time.accuracy = 0.5: out of range", "1e-06 <= value <= 0.1"),
    bad("step in words", "step = 1e-5", 'step = "small"', "time.step = 'small'"),
    bad("zero step", "step = 1e-5", "step = 0.0", "time.step = 0.0", "0 < value [s]"),
    bad("unknown law", 'normal = "hertz"', 'normal = "herz"', "contact.normal = 'herz'", "did you mean 'hertz'?"),
    bad("unknown wall", PLANE, PLANE.replace('"plane"', '"xyzzy"'), "walls[0].kind = 'xyzzy': unknown",
        "known: plane, box"),
    bad("wall without kind", PLANE, 'name = "floor"', "walls[0].kind: missing; one of: plane, box"),
    bad("unknown source", '"explicit"', '"explict"', "particles.source = 'explict'", "did you mean 'explicit'?"),
    bad("wall name with blank and ;", PLANE, PLANE.replace("floor", "floor; shell reboot"),
        "walls[0].name = 'floor; shell reboot': not a name", "letters, digits or underscores"),
    bad("wall name with line break", PLANE, PLANE.replace("floor", "floor\\nshell"), "walls[0].name", "not a name"),
    bad("material name", "[materials.ps]", '[materials."a b"]', "materials.a b = 'a b': not a name"),
    bad("zero normal", "normal = [0.0, 0.0, 1.0]", "normal = [0.0, 0.0, 0.0]", "walls[0].normal",
        "has no direction"),
    bad("normal of no length", "normal = [0.0, 0.0, 1.0]", "normal = [0.0, 0.0, 1e-320]", "walls[0].normal",
        "has no direction; allowed: any length >= 1e-18"),
    bad("step of no length", "step = 1e-5", "step = 1e-320", "time.step = ", "allowed: >= 1e-18 [s]"),
    bad("duration without end", "duration = 0.1", "duration = 1e300", "time.duration = 1e+300: too large",
        "allowed: <= 1e+18 [s]"),
    bad("domain without end", "hi = [0.1, 0.1, 0.2]", "hi = [0.1, 1e300, 0.2]", "domain.hi", "too large",
        "allowed: <= 1e+18 [m]"),
    bad("velocity without end", "velocity = [[0.0, 0.0, 0.0]", "velocity = [[0.0, -1e300, 0.0]",
        "particles.velocity", "row 1 is too large for the arithmetic; allowed: <= 1e+18 [m/s]"),
    bad("one radius nearly zero", "radius = 0.003", "radius = [0.003, 1e-300]", "particles.radius",
        "row 2 = 1e-300 too small", ">= 1e-18 [m]"),
    bad("positions of two numbers", "[0.02, 0.0, 0.01]]", "[0.02, 0.0]]", "particles.position",
        "rows of different length; must be (n, 3) [m]"),
    bad("position of text", "[0.02, 0.0, 0.01]]", '[0.02, 0.0, "0.01"]]', "particles.position", "numbers"),
    bad("nan position", "[0.02, 0.0, 0.01]]", "[0.02, nan, 0.01]]", "particles.position",
        "row 2 is not a finite number [m]"),
    bad("half a particle", EXPLICIT, LATTICE.replace("100", "0.5"), "particles.count = 0.5"),
    bad("no particles asked for", EXPLICIT, LATTICE.replace("100", "0"), "particles.count = 0", "greater than 0"),
    bad("empty mixture", EXPLICIT, LATTICE.replace("radius = 0.003", "radius = []"), "particles.radius = []",
        "at least 1 item"),
    bad("distribution without a kind", EXPLICIT, LATTICE.replace("0.003", "{ lo = 0.001, hi = 0.002 }"), "particles.radius.kind: missing"),
    bad("unknown distribution", EXPLICIT, LATTICE.replace("0.003", '{ kind = "gaus" }'), "particles.radius.kind = 'gaus': unknown"),
    bad("distribution upside down", EXPLICIT, LATTICE.replace("0.003", '{ kind = "uniform", lo = 0.003, hi = 0.002 }'),
        "particles.radius.hi = 0.002: must be above lo = 0.003 [m]"),
    bad("distribution that does not fit", EXPLICIT,
        LATTICE.replace("0.003", '{ kind = "uniform", lo = 0.02, hi = 0.05 }'), "particles.count = 100 does not fit"),
    bad("mixture share", EXPLICIT, LATTICE.replace("0.003", "[{radius = 0.003, share = 0.0}]"),
        "particles.radius[0].share = 0.0", "0 < value"),
    bad("mixture without shares", EXPLICIT, LATTICE.replace("0.003", "[0.004]"),
        "particles.radius[0] = 0.004: must be a table with radius, share"),
    bad("waiver that does not exist", 'name = "bed"', 'name = "bed"\nallow = ["timestep"]',
        "allow[0] = 'timestep'", "did you mean 'time_step'?"),
]

WHOLE = [
    bad("unknown material of particles", 'material = "ps"', 'material = "pp"', "particles.material = 'pp'",
        "no such material; known: acrylic, ps"),
    bad("unknown material of wall", 'material = "acrylic"\n', 'material = "steel"\n', "walls[0].material = 'steel'",
        "known: acrylic, ps"),
    bad("unknown material of pair", 'materials = ["ps", "acrylic"]', 'materials = ["ps", "steel"]',
        "pairs[1].materials = 'steel'"),
    bad("missing pair", 'materials = ["ps", "acrylic"]', 'materials = ["acrylic", "acrylic"]',
        "pairs: ps / acrylic can meet"),
    bad("duplicate pair", 'materials = ["ps", "acrylic"]', 'materials = ["ps", "ps"]', "pairs: ps / ps given twice"),
    bad("duplicate pair reversed", "[contact]", '[[pairs]]\nmaterials = ["acrylic", "ps"]\n[contact]',
        "pairs: acrylic / ps given twice"),
    bad("duplicate wall", "[domain]", '[[walls]]\nkind = "plane"\nname = "floor"\nmaterial = "acrylic"\n'
        "point = [0.0, 0.0, 0.2]\nnormal = [0.0, 0.0, -1.0]\n[domain]", "walls: name 'floor' given twice"),
    bad("side given twice", "[domain]", '[[walls]]\nkind = "box"\nname = "b"\nmaterial = "acrylic"\n'
        'sides = ["xlo", "xlo"]\n[domain]', "walls: name 'b_xlo' given twice"),
    bad("box upside down", "[domain]", '[[walls]]\nkind = "box"\nname = "b"\nmaterial = "acrylic"\n'
        "lo = [0.0, 0.0, 0.1]\nhi = [0.1, 0.1, 0.0]\n[domain]", "walls[1].hi", "must be above lo", "[m]"),
    bad("domain upside down", "hi = [0.1, 0.1, 0.2]", "hi = [0.1, 0.1, 0.0]", "domain.hi = (0.1, 0.1, 0.0)",
        "must be above domain.lo", "[m]"),
    bad("list lengths differ", "radius = 0.003", "radius = [0.003]", "particles.radius has 1 rows", "2 particles"),
    bad("material lengths differ", 'material = "ps"', 'material = ["ps", "ps", "ps"]',
        "particles.material has 3 rows", "2 particles"),
    bad("velocity lengths differ", "velocity = [[0.0, 0.0, 0.0], ", "velocity = [", "particles.velocity has 1 rows"),
    bad("no particles", EXPLICIT, 'source = "explicit"\nposition = []\nradius = 0.003\n',
        "particles.position: no particles"),
    bad("radius in mm", "radius = 0.003", "radius = 3", "particles.radius = 3 m", "3 mm is 0.003 m", "unusual_units"),
    bad("young in GPa", "young = 3.25e7", "young = 3.25", "materials.ps.young = 3.25 Pa", "3.25 GPa is 3.25e+09 Pa"),
    bad("density in g/cm3", "density = 1050.0", "density = 1.2", "materials.ps.density = 1.2 kg/m3",
        "1.2 g/cm3 is 1200 kg/m3"),
    bad("density with a slip of the exponent", "density = 1050.0", "density = 1.05e8",
        "materials.ps.density = 1.05e+08 kg/m3: unusual, above 1e+06 kg/m3; waive with allow = ['unusual_units']"),
    bad("young with a slip of the exponent", "young = 3.25e7", "young = 3.25e17",
        "materials.ps.young = 3.25e+17 Pa: unusual, above 1e+14 Pa; waive with"),
    bad("friction in percent", "restitution = 0.9", "friction = 30",
        "pairs[0].friction = 30 [1]: unusual, above 10 [1]; waive with"),
    bad("rolling friction in percent", "restitution = 0.9", "rolling_friction = 30", "pairs[0].rolling_friction = 30"),
    bad("cohesion without its law", "restitution = 0.9", "cohesion_energy_density = 1e4",
        "pairs[0].cohesion_energy_density: read only with contact.cohesion = 'sjkr' or contact.cohesion = 'sjkr2'"),
    bad("negative cohesion", 'restitution = 0.9\n[[pairs]]\nmaterials = ["ps", "acrylic"]\nrestitution = 0.8\n[contact]',
        'cohesion_energy_density = -1.0\n[[pairs]]\nmaterials = ["ps", "acrylic"]\n[contact]\ncohesion = "sjkr"',
        "pairs[0].cohesion_energy_density = -1.0: out of range; allowed: 0 <= value [J/m3]"),
    bad("cohesion unknown", 'normal = "hertz"', 'cohesion = "sjkr3"', "contact.cohesion = 'sjkr3': unknown; did you mean 'sjkr"),
    bad("rolling dashpot missing", 'restitution = 0.9\n[[pairs]]\nmaterials = ["ps", "acrylic"]\nrestitution = 0.8\n[contact]',
        'rolling_friction = 0.1\n[[pairs]]\nmaterials = ["ps", "acrylic"]\n[contact]\nrolling = "epsd3"',
        "pairs: ps / ps: epsd3 needs rolling_viscous_damping, rolling_stiffness"),
    bad("linear spring missing", 'normal = "hertz"', 'normal = "hooke/stiffness"',
        "pairs: ps / ps: hooke/stiffness needs kn, kt, gamma_n, gamma_t", problems=2),
    bad("cohesion of a wall unknown", 'name = "floor"', 'name = "floor"\ncontact = {cohesion = "glue"}',
        "contact.cohesion = 'glue': unknown"),
    bad("speed in mm/s", 'normal = "hertz"', 'normal = "hooke"\ncharacteristic_velocity = 2e4',
        "contact.characteristic_velocity = 20000 m/s: unusual, above 10000 m/s; waive with"),
    bad("more particles than indices", EXPLICIT, LATTICE.replace("100", "89478486"),
        "particles.count = 89478486: too many for 32-bit indices; allowed: <= 89478485 particles"),
    bad("gravity in mm/s2", "-9.81", "-9810.0", "gravity = 9810 m/s2", "9810 mm/s2 is 9.81 m/s2"),
    bad("overlap", "[0.02, 0.0, 0.01]]", "[0.005, 0.0, 0.01]]", "1 pairs overlap at the start",
        "1 and 2 by 0.001 m", "0.1 of the smaller radius", "waive with allow = ['overlap']"),
    Bad("overlap through a periodic side",
        {"[[0.0, 0.0, 0.01], [0.02, 0.0, 0.01]]": "[[-0.099, 0.0, 0.01], [0.099, 0.0, 0.01]]",
         "periodic = [false": "periodic = [true"}, ("1 and 2 by 0.004 m",)),
    Bad("overlap of a lattice through a periodic side",  # which its own box is not
        {EXPLICIT: LATTICE.replace("-0.1, -0.1", "-0.103, -0.1").replace("0.1, 0.1, 0.2", "0.103, 0.1, 0.2"),
         "periodic = [false": "periodic = [true"}, ("3 pairs overlap at the start", "33 and 64 by 0.00141 m")),
    bad("outside the domain", "[0.02, 0.0, 0.01]]", "[0.2, 0.0, 0.01]]", "1 outside the domain",
        "particle 2 at (0.2, 0.0, 0.01) m"),
    bad("in the wall", "[0.02, 0.0, 0.01]]", "[0.02, 0.0, 0.001]]", "1 outside wall floor",
        "particle 2 reaches 0.002 m into it", "0.1 radii"),
    bad("wall beyond the domain", "point = [0.0, 0.0, 0.0]", "point = [0.0, 0.0, -0.01]",
        "floor lies 0.01 m outside the domain"),
    bad("periodic side too thin", "lo = [-0.1, -0.1, 0.0]\nhi = [0.1, 0.1, 0.2]\nperiodic = [false, false",
        "lo = [-0.1, -0.006, 0.0]\nhi = [0.1, 0.006, 0.2]\nperiodic = [false, true",
        "domain: y is periodic and 0.012 m long", "must exceed 2 (largest diameter + skin) = 0.0138 m"),
    bad("wall across a periodic side", "periodic = [false, false, false]", "periodic = [false, false, true]",
        "floor bounds z, which is periodic"),
    Bad("step above Rayleigh", {"step = 1e-5": "step = 1e-4", "-9.81": "-0.01"},
        ("time.step = 0.0001 s: above 0.5 of the Rayleigh time, 4.7e-05 s; waive with allow = ['time_step']",)),
    Bad("step above Hertz",
        {"step = 1e-5": "step = 3e-5", "velocity = [[0.0, 0.0, 0.0]": "velocity = [[90.0, 0.0, 0.0]"},
        ("time.step = 3e-05 s: above 0.2 of the Hertz contact time, ", "waive with")),
    bad("longer step than run", "duration = 0.1", "duration = 1e-6", "time.step = 1e-05 s",
        "longer than time.duration = 1e-06 s"),
    bad("hooke without velocity", 'normal = "hertz"', 'normal = "hooke"', "contact.characteristic_velocity: missing",
        "[m/s]"),
    bad("stiffness without constants", 'normal = "hertz"', 'normal = "hertz/stiffness"',
        "ps / ps: hertz/stiffness needs kn, kt, gamma_n, gamma_t", "ps / acrylic", problems=2),
    bad("lattice does not fit", EXPLICIT, LATTICE.replace("100", "100000"), "particles.count = 100000 does not fit",
        "31 x 31 x 31", "pitch of 0.0063 m"),
    Bad("trace fills the memory",
        {"duration = 0.1": "duration = 1000.0", "[output]": "[output]\ntrace_every = 1e-5"},
        ("output.trace_every = 1e-05 s", "100000001 rows of 2 particles take 24 GB", "allowed: <= 4 GB",
         "waive with allow = ['memory']")),
    bad("vibration with a speed of zero", PLANE, PLANE + "\nvibration = {speed = 0.0}",
        "walls[0].vibration.speed = 0.0"),
    bad("vibration with unknown key", PLANE, PLANE + "\nvibration = {speed = 0.1, stroke = 1}",
        "walls[0].vibration.stroke: unknown key; known: speed, amplitude"),
    bad("teeth of a few steps", PLANE, PLANE + "\nvibration = {speed = 0.1, amplitude = 5e-6}",
        "walls: floor.vibration: a period A / U = 5e-05 s is 5 time steps; allowed: >= 10"),
    bad("vibration faster than a radius in a step", PLANE, PLANE + "\nvibration = {speed = 400}",
        "floor.vibration.speed = 400 m/s: moves 0.004 m in a step", "the smallest radius, 0.003 m"),
    Bad("vibration with path", {PLANE: PLANE + "\nvibration = {speed = 0.1}", "[time]": '[solver]\nintegrator = "path"\n[time]'},
        ("floor.vibration: solver.integrator = 'path' knows no moving plane; use 'half_step'",)),
    Bad("several fields at once",
        {"radius = 0.003": "radius = -1", "poisson = 0.34": "poisson = 2", "step = 1e-5": "step = 1"},
        ("particles.radius = -1", "materials.ps.poisson = 2", "time.step = 1 s: longer than"), problems=3),
    Bad("fields and the whole at once",
        {"restitution = 0.8": "restitution = 8", 'material = "ps"': 'material = "pp"', "step = 1e-5": "step = 1.0",
         "[output]": "[output]\nframes = 1"},
        ("pairs[1].restitution = 8", "particles.material = 'pp'", "time.step = 1 s: longer than",
         "output.frames: unknown key"), problems=4),
]

WALLS = [
    bad_wall("mesh of neither file nor arrays", MESH, MESH[MESH.index("vertices"):], "",
        "walls[1].file: missing; state file, or vertices and triangles"),
    bad_wall("mesh of file and arrays", MESH, "vertices", 'file = "a.stl"\nvertices',
        "walls[1].file = ", "a.stl': beside vertices and triangles; state one of the two"),
    bad_wall("mesh of vertices alone", MESH, "triangles = [[0, 1, 2]]\n", "", "walls[1].triangles: missing beside vertices"),
    bad_wall("mesh file that is not there", MESH, MESH[MESH.index("vertices"):], 'file = "gone.stl"\n',
        "walls: chute.file = ", "gone.stl': no such file"),
    bad_wall("mesh file that is the scene", MESH, MESH[MESH.index("vertices"):], 'file = "scene.toml"\n',
        "scene.toml': unknown suffix; known: .stl, .obj, .ply, .vtk, .vtu, .npz"),
    bad_wall("mesh file that is a number", MESH, MESH[MESH.index("vertices"):], "file = 3\n",
        "walls[1].file = 3: must be text in quotes"),
    bad_wall("half a row", MESH, "[[0, 1, 2]]", "[[0, 1, 2.5]]", "walls[1].triangles",
        "row 1 is [0.0, 1.0, 2.5]; must be whole numbers from 0, shape (n, 3)"),
    bad_wall("row below zero", MESH, "[[0, 1, 2]]", "[[0, 1, -1]]", "walls[1].triangles", "must be whole numbers from 0"),
    bad_wall("row counted from one", MESH, "[[0, 1, 2]]", "[[1, 2, 3]]",
        "walls: chute.triangles: row 1 names vertices 1, 2, 3; must be rows of the 3 vertices, 0 to 2"),
    bad_wall("row of four", MESH, "[[0, 1, 2]]", "[[0, 1, 2, 0]]", "walls[1].triangles", "has shape (1, 4); must be (n, 3)"),
    bad_wall("no triangles", MESH, "[[0, 1, 2]]", "[]", "walls: chute.triangles: none given"),
    bad_wall("triangle without an area", MESH, "[[0, 1, 2]]", "[[0, 1, 1]]",
        "walls: chute.triangles: none of them has an area"),
    bad_wall("vertex that is not a number", MESH, "[0.0, 0.05, 0.05]", "[0.0, nan, 0.05]", "walls[1].vertices",
        "row 3 is not a finite number [m]"),
    bad_wall("vertices of two numbers", MESH, "[0.0, 0.05, 0.05]", "[0.0, 0.05]", "walls[1].vertices",
        "rows of different length; must be (n, 3) [m]"),
    bad_wall("mesh scaled to nothing", MESH, "triangles", "scale = 0.0\ntriangles", "walls[1].scale = 0.0: out of range",
        "0 < value [1]"),
    bad_wall("mesh turned about no axis", MESH, "triangles", "rotate = {axis = [0, 0, 0], angle = 90}\ntriangles",
        "walls[1].rotate.axis", "has no direction"),
    bad_wall("mesh turned by nothing", MESH, "triangles", "rotate = {axis = [0, 0, 1]}\ntriangles",
        "walls[1].rotate.angle: missing [deg]"),
    bad_wall("mesh in millimetres", MESH, "triangles", "scale = 1000\ntriangles",
        "walls: chute is 141 m across, the domain 0.346 m; a file in millimetres needs scale = 1; waive with"),
    bad_wall("mesh scaled twice", MESH, "triangles", "scale = 1e-6\nmove = [0.0, 0.0, 0.1]\ntriangles",
        "walls: chute is 1.41e-07 m across, the smallest radius 0.003 m; scaled twice? scale = 1e-06"),
    bad_wall("mesh beyond the domain", MESH, "triangles", "move = [0.0, 0.3, 0.0]\ntriangles",
        "walls: chute lies 0.15 m outside the domain; no particle can reach it"),
    bad_wall("particle in a mesh", MESH, "triangles", "move = [0.0, 0.0, -0.04]\ntriangles",
        "particles: 2 in wall chute; particle 1 reaches 0.003 m into it"),
    bad_wall("mesh without material", MESH, 'material = "acrylic"\n', "", "walls[1].material: missing"),
    bad_wall("mesh of unknown material", MESH, "acrylic", "steel", "walls[1].material = 'steel': no such material"),
    bad_wall("mesh with a misspelled key", MESH, "triangles", "scael = 1\ntriangles",
        "walls[1].scael: unknown key; did you mean 'scale'?"),
    bad_wall("mesh of the floor's name", MESH, "chute", "floor", "walls: name 'floor' given twice"),
    bad_wall("present the wrong way round", MESH, "triangles", "present = [0.2, 0.1]\ntriangles",
        "walls[1].present = [0.2, 0.1]: must rise: from < until [s]"),
    bad_wall("present before the start", MESH, "triangles", "present = [-0.1]\ntriangles",
        "walls[1].present = [-0.1]", "0 <= value [s]"),
    bad_wall("two ends", MESH, "triangles", "removed_at = 0.1\npresent = [0.0, 0.1]\ntriangles",
        "walls[1].present = [0.0, 0.1]: removed_at is its end already; state one of the two"),
    bad_wall("belt that stands still", MESH, "triangles", "surface_velocity = [0, 0, 0]\ntriangles",
        "walls[1].surface_velocity", "has no direction"),
    bad_wall("cylinder without radius", CYLINDER, "radius = 0.04\n", "", "walls[1].radius: missing [m]"),
    bad_wall("cylinder without axis", CYLINDER, "[0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0]", "walls[1].axis", "has no direction"),
    bad_wall("cylinder of negative radius", CYLINDER, "0.04", "-0.04", "walls[1].radius = -0.04", "0 < value [m]"),
    bad_wall("cylinder of no length", CYLINDER, "length = 0.05", "length = 0", "walls[1].length = 0", "0 < value [m]"),
    bad_wall("cylinder beyond the domain", CYLINDER, "[0.0, 0.0, 0.1]", "[0.0, 0.0, 0.3]",
        "walls: pipe lies 0.1 m outside the domain; no particle can reach it"),
    bad_wall("cylinder around the domain", CYLINDER, "radius = 0.04\npoint = [0.0, 0.0, 0.1]\naxis = [0.0, 0.0, 1.0]\nlength = 0.05",
        "radius = 0.2\npoint = [0.0, 0.0, 0.1]\naxis = [0.0, 0.0, 1.0]", "walls: pipe lies 0.0586 m outside the domain"),
    bad_wall("cone of no radius", CONE, "radius = 0.01\nend_radius = 0.04", "radius = 0.0\nend_radius = 0.0",
        "walls[1].end_radius = 0: must be above 0 where radius = 0 [m]"),
    bad_wall("cone without length", CONE, "length = 0.05\n", "", "walls[1].length: missing [m]"),
    bad_wall("saw-tooth and motion", PLANE + '\nmaterial = "acrylic"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n', "floor",
        'lid"\nvibration = {speed = 0.1, amplitude = 0.01}\nmotion = [{type = "linear", velocity = [0, 0, 1]}]#',
        "walls: lid.vibration: beside motion; state one of the two"),
]
# fmt: on


def moved(name: str, motion: str, *expected: str, edits: dict[str, str] | None = None) -> Bad:
    """The floor with one motion, its keys separated by semicolons; `edits` also change other lines."""
    text = "[[walls.motion]]\n" + "\n".join(part.strip() for part in motion.split(";"))
    return Bad(name, {"[domain]": f"{text}\n[domain]", **(edits or {})}, expected)


_FALSE = "periodic = [false, false, false]"

# fmt: off
MOTIONS = [
    moved("motion of unknown type", 'type = "xyzzy"; period = 1.0',
        "walls[0].motion[0].type = 'xyzzy': unknown; known: linear, oscillate, rotate, swing, table"),
    moved("motion misspelled", 'type = "rotat"; period = 1.0', "type = 'rotat': unknown; did you mean 'rotate'?"),
    moved("motion without type", "velocity = [1.0, 0.0, 0.0]",
        "walls[0].motion[0].type: missing; one of: linear, oscillate, rotate, swing, table"),
    moved("motion without period", 'type = "rotate"; axis = [0, 0, 1]', "walls[0].motion[0].period: missing [s]"),
    moved("swing without amplitude", 'type = "swing"; axis = [0, 0, 1]; period = 1.0',
        "walls[0].motion[0].amplitude: missing [rad]"),
    moved("oscillation without amplitude", 'type = "oscillate"; period = 1.0', "walls[0].motion[0].amplitude: missing [m]"),
    moved("motion of period zero", 'type = "rotate"; axis = [0, 0, 1]; period = 0.0',
        "walls[0].motion[0].period = 0.0: out of range; allowed: 0 < value [s]"),
    moved("turn without direction", 'type = "rotate"; axis = [0, 0, 0]; period = 1.0', "walls[0].motion[0].axis",
        "has no direction"),
    moved("motion at speed zero", 'type = "linear"; velocity = [0, 0, 0]', "walls[0].motion[0].velocity", "has no direction"),
    moved("key of another motion", 'type = "rotate"; axis = [0, 0, 1]; period = 1.0; velocity = [0, 0, 1]',
        "walls[0].motion[0].velocity: unknown key; known: axis, point, type, period"),
    moved("swing with a vector", 'type = "swing"; axis = [0, 0, 1]; amplitude = [0.1, 0, 0]; period = 1.0',
        "walls[0].motion[0].amplitude = [0.1, 0, 0]: must be a number [rad]"),
    moved("table that does not ascend", 'type = "table"; time = [0.0, 0.2, 0.2]; velocity = [[0,0,0], [0,0,1], [0,0,0]]',
        "walls[0].motion[0].time = [0.0, 0.2, 0.2]: must ascend; row 3, 0.2, is not above 0.2 [s]"),
    moved("table with rows too few", 'type = "table"; time = [0.0, 0.2]; velocity = [[0,0,0]]',
        "walls[0].motion[0].velocity = [[0, 0, 0]]: has 1 rows for 2 times"),
    moved("table without rows", 'type = "table"; time = []; axis = [0, 0, 1]; angular_velocity = []',
        "walls[0].motion[0].time = []: has no rows; at least one is needed [s]"),
    moved("table of nothing", 'type = "table"; time = [0.0]', "walls[0].motion[0].velocity: missing [m/s]"),
    moved("table of a turn without axis", 'type = "table"; time = [0.0]; angular_velocity = [1.0]',
        "walls[0].motion[0].axis: missing [1]"),
    Bad("motion that is no list", {"[domain]": '[walls.motion]\ntype = "linear"\n[domain]'},
        ("walls[0].motion = {'type': 'linear'}: must be a list",)),
    Bad("motion that is no table", {PLANE: PLANE + "\nmotion = [5]"}, ("walls[0].motion[0] = 5: must be a table",)),
    moved("motion beside vibration", 'type = "linear"; velocity = [0, 0, 0.1]',
        "walls: floor.vibration: beside motion; state one of the two", edits={PLANE: PLANE + "\nvibration = {speed = 0.1}"}),
    moved("motion faster than a radius in a step", 'type = "linear"; velocity = [0, 0, 400]',
        "walls: floor.motion: moves up to 400 m/s within the domain, 0.004 m in a step",
        "allowed: < the smallest radius, 0.003 m; waive with allow = ['speed']"),
    moved("oscillation of a few steps", 'type = "oscillate"; amplitude = [0, 0, 1e-6]; period = 5e-5',
        "walls: floor.motion.period = 5e-05 s: is 5 time steps; allowed: >= 10; waive with allow = ['time_step']"),
    moved("plane that turns into a periodic side", 'type = "rotate"; axis = [0, 1, 0]; period = 1.0',
        "walls: floor.motion: a plane without ends that turns about (0.0, 1.0, 0.0) would cross x, which is periodic",
        edits={_FALSE: "periodic = [true, true, false]"}),
]
# fmt: on
