"""Bad statements of what is inserted: rows for test_bad_scenes.py."""

from __future__ import annotations

from tests.bad_scenes import EXPLICIT, Bad

INSERT = """kind = "list"
time = [0.01, 0.02]
position = [[0.0, 0.0, 0.1], [0.02, 0.0, 0.1]]
velocity = [[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]]
radius = 0.003
material = "ps"
"""


def inserted(name: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with an insertion, in which `old` is replaced by `new`."""
    assert INSERT.count(old) == 1, f"{old!r} must stand in the insertion exactly once"
    text = INSERT.replace(old, new)
    return Bad(name, {"[domain]": f"[[insert]]\n{text}[domain]"}, expected, problems)


TOUCHING = INSERT.replace("[0.01, 0.02]", "0.01").replace("[0.02, 0.0, 0.1]", "[0.001, 0.0, 0.1]")
FILE = INSERT[INSERT.index("time") : INSERT.index("radius")]
INSERTIONS = [
    inserted("insertion of unknown kind", '"list"', '"rain"', "insert[0].kind = 'rain': unknown; did you mean 'rate'?"),
    inserted("insertion without kind", 'kind = "list"\n', "", "insert[0].kind: missing; one of: list, pack, rate, stream"),
    inserted("insertion with an unknown key", "radius", "radii = 1\nradius", "insert[0].radii: unknown key; did you mean 'radius'?"),
    inserted("insertion without time", "time = [0.01, 0.02]\n", "", "insert[0].time: missing [s]; or state a path"),
    inserted("insertion without position", INSERT[INSERT.index("position") : INSERT.index("velocity")], "",
        "insert[0].position: missing [m]; or state a path"),
    inserted("insertion without radius", "radius = 0.003\n", "", "insert[0].radius: missing [m]; or state a path"),
    inserted("insertion without material", 'material = "ps"\n', "", "insert[0].material: missing; or state a path"),
    inserted("insertion before the start", "0.01,", "-0.01,", "insert[0].time", "row 1 = -0.01", "0 <= value [s]"),
    inserted("insertion at no time", "0.01,", "nan,", "insert[0].time", "row 1 is not a finite number [s]"),
    inserted("too few times", "[0.01, 0.02]", "[0.01]", "insert[0].time has 1 rows; must have one for each of the 2 particles"),
    inserted("too few velocities", "velocity = [[0.0, 0.0, -1.0], ", "velocity = [", "insert[0].velocity has 1 rows"),
    inserted("radius of an insertion zero", "0.003", "0.0", "insert[0].radius = 0.0: out of range; allowed: 0 < value [m]"),
    inserted("radius of an insertion negative", "0.003", "[0.003, -0.003]", "insert[0].radius", "row 2 = -0.003"),
    inserted("radius of an insertion in mm", "0.003", "3.0", "insert: radius = 3 m: 3 mm is 0.003 m"),
    inserted("material of an insertion unknown", '"ps"', '"sp"', "insert[0].material = 'sp': no such material; known: acrylic, ps"),
    inserted("insertion outside the domain", "[0.0, 0.0, 0.1]", "[0.0, 0.0, 0.3]", "particles: 1 outside the domain", "particle 3"),
    Bad("two in one place", {"[domain]": f"[[insert]]\n{TOUCHING}[domain]"},
        ("insert: 1 pairs inserted in step 1000 (0.01 s) overlap, the worst: 3 and 4 by 0.005 m",)),
    inserted("insertion in the floor", "[0.0, 0.0, 0.1]", "[0.0, 0.0, 0.001]",
        "insert: 1 outside wall floor at insertion; particle 3 reaches 0.002 m into it (allowed: 0.1 radii)"),
    inserted("file and list of an insertion", "time", 'path = "rain.csv"\ntime', "insert[0].time: stands in the file that path names; state one of both"),
    inserted("file of an insertion that is not there", FILE, 'path = "rain.csv"\n', "insert[0].path = ", "rain.csv': no such file"),
    inserted("file of an insertion that is the scene", FILE, 'path = "scene.toml"\n', "scene.toml': unknown suffix; known: .csv, .npz, .vtu"),
    Bad("neither particles nor insertions", {"[particles]\n" + EXPLICIT + 'material = "ps"\n': ""},
        ("particles: missing; or state what is inserted ([[insert]])",)),
]  # fmt: skip

PACK = """kind = "pack"
region = { kind = "block", lo = [-0.05, -0.05, 0.05], hi = [0.05, 0.05, 0.15] }
count = 20
radius = 0.003
material = "ps"
"""
RATE = PACK.replace('"pack"', '"rate"').replace("count = 20", "number_rate = 500.0\nevery = 0.02")
STREAM = """kind = "stream"
face = { kind = "disc", center = [0.0, 0.0, 0.15], axis = [0, 0, 1], radius = 0.03 }
velocity = [0.0, 0.0, -1.0]
number_rate = 200.0
radius = 0.003
material = "ps"
"""
BLOCK = PACK[PACK.index("region") : PACK.index("count")]
DISC = STREAM[STREAM.index("face") : STREAM.index("velocity")]


def drawn(source: str, name: str, old: str, new: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with a random insertion, in which `old` is replaced by `new`."""
    assert source.count(old) == 1, f"{old!r} must stand in the insertion exactly once"
    return Bad(name, {"[domain]": f"[[insert]]\n{source.replace(old, new)}[domain]"}, expected, problems)


def sized(name: str, size: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with a pack of another distribution of radii."""
    return drawn(PACK, name, "0.003", f"{{ {size} }}", *expected, problems=problems)


def mixed(name: str, parts: str, *expected: str, problems: int = 1) -> Bad:
    """The good scene with a pack of a mixture."""
    return drawn(PACK, name, 'radius = 0.003\nmaterial = "ps"\n', parts, *expected, problems=problems)


TWO = "mixture = [{{ material = {}, radius = 0.003, share = {} }}, {{ material = {}, radius = 0.004, share = {} }}]\n"
SOURCES = [
    drawn(PACK, "pack without region", BLOCK, "", "insert[0].region: missing"),
    drawn(PACK, "region of unknown kind", '"block"', '"brick"', "insert[0].region.kind = 'brick': unknown; did you mean 'block'?"),
    drawn(PACK, "region without kind", 'kind = "block", ', "", "insert[0].region.kind: missing; one of: block, sphere, cylinder,"),
    drawn(PACK, "region with an unknown key", "lo =", "low = 1, lo =", "insert[0].region.low: unknown key; did you mean 'lo'?"),
    drawn(PACK, "region that is a number", BLOCK, "region = 3\n", "insert[0].region = 3: must be a table"),
    drawn(PACK, "region upside down", "0.05, 0.05, 0.15]", "0.05, 0.05, 0.05]",
        "insert[0].region.hi = (0.05, 0.05, 0.05): must be above lo = (-0.05, -0.05, 0.05) in x, y and z [m]"),
    drawn(PACK, "region beyond the domain", "0.05, 0.05, 0.15]", "0.05, 0.05, 0.25]",
        "insert[0].region: reaches from (-0.05, -0.05, 0.05) to (0.05, 0.05, 0.25) m, outside the domain (-0.1, -0.1, 0) .. (0.1, 0.1, 0.2) m"),
    drawn(PACK, "region smaller than a particle", "0.05, 0.05, 0.15]", "0.05, 0.05, 0.055]",
        "insert[0].region: no particle of radius 0.003 m fits; allowed: a larger region"),
    drawn(PACK, "region of a mesh that is not there", BLOCK, 'region = { kind = "mesh", file = "drum.stl" }\n', "insert[0].region.file", "drum.stl': no such file"),
    drawn(PACK, "union of nothing", BLOCK, 'region = { kind = "union", parts = [] }\n', "insert[0].region.parts", "at least 1"),
    drawn(PACK, "cut of a negative sphere", BLOCK,
        'region = { kind = "cut", part = { kind = "sphere", center = [0, 0, 0.1], radius = 0.05 }, without = { kind = "sphere", center = [0, 0, 0.1], radius = -0.01 } }\n',
        "insert[0].region.without.radius = -0.01: out of range; allowed: 0 < value [m]"),
    drawn(PACK, "cone without a radius", BLOCK, 'region = { kind = "cone", point = [0, 0, 0.05], axis = [0, 0, 1], length = 0.1, radius = 0.0, end_radius = 0.0 }\n',
        "insert[0].region.end_radius = 0.0: radius is 0 too; allowed: one of the two above 0 [m]"),
    drawn(PACK, "no target", "count = 20\n", "", "insert[0].count: missing; state one of count, mass [kg] and volume_fraction [1]"),
    drawn(PACK, "two targets", "count = 20", "count = 20\nmass = 0.1", "insert[0].count and mass: stated together; state one of"),
    drawn(PACK, "no particles requested", "20", "0", "insert[0].count = 0: must be greater than 0"),
    drawn(PACK, "a number that is no whole number", "20", "20.5", "insert[0].count = 20.5: must be a"),
    drawn(PACK, "too many particles", "20", "100000000", "insert[0].count = 100000000: must be less than or equal to 89478485"),
    drawn(PACK, "mass below half a particle", "count = 20", "mass = 1e-5", "insert[0].mass = 1e-05 kg: less than half a particle; allowed: >= 5.94e-05 kg"),
    drawn(PACK, "negative mass", "count = 20", "mass = -0.1", "insert[0].mass = -0.1: out of range; allowed: 0 < value [kg]"),
    drawn(PACK, "mass in grams", "count = 20", "mass = 1e9", "insert[0].mass = 1e+09 kg: about 8.42e+12 particles; allowed: <= 89478485"),
    drawn(PACK, "impossible fraction", "count = 20", "volume_fraction = 0.9", "insert[0].volume_fraction = 0.9: out of range; allowed: 0 < value <= 0.74 [1]"),
    drawn(PACK, "filled before the start", "count = 20", "count = 20\ntime = -1.0", "insert[0].time = -1.0: out of range; allowed: 0 <= value [s]"),
    drawn(PACK, "interval zero", "count = 20", "count = 20\nevery = 0.0", "insert[0].every = 0.0: out of range; allowed: 0 < value [s]"),
    drawn(PACK, "seed negative", "count = 20", "count = 20\nseed = -1", "insert[0].seed = -1: must be greater than or equal to 0"),
    drawn(PACK, "seed no whole number", "count = 20", 'count = 20\nseed = "a"', "insert[0].seed = 'a': must be a whole number"),
    drawn(PACK, "no attempts", "count = 20", "count = 20\nattempts = 0", "insert[0].attempts = 0: must be greater than or equal to 1"),
    drawn(PACK, "spread negative", "count = 20", "count = 20\nvelocity_spread = -0.1", "insert[0].velocity_spread = -0.1: out of range; allowed: 0 <= value [m/s]"),
    drawn(PACK, "radius of a pack negative", "0.003", "-0.003", "insert[0].radius = -0.003: out of range; allowed: 0 < value [m]"),
    drawn(PACK, "radius of a pack in mm", "0.003", "3.0", "insert[0].region: no particle of radius 3 m fits"),
    drawn(PACK, "pack without radius", "radius = 0.003\n", "", "insert[0].radius: missing [m]; or state a mixture"),
    drawn(PACK, "pack without material", 'material = "ps"\n', "", "insert[0].material: missing; or state a mixture"),
    drawn(PACK, "material of a pack unknown", '"ps"', '"sp"', "insert[0].material = 'sp': no such material; known: acrylic, ps"),
    sized("distribution of unknown kind", 'kind = "gauss"', "insert[0].radius.kind = 'gauss': unknown; known: discrete, uniform, normal,"),
    sized("sigma zero", 'kind = "normal", mean = 0.003, sigma = 0.0', "insert[0].radius.sigma = 0.0: out of range; allowed: 0 < value [m]"),
    sized("sigma of ln(r) negative", 'kind = "lognormal", median = 0.003, sigma = -0.2', "insert[0].radius.sigma = -0.2: out of range; allowed: 0 < value [1]"),
    sized("key of another distribution", 'kind = "lognormal", mean = 0.003, sigma = 0.2', "insert[0].radius.mean: unknown key; did you mean 'median'?", problems=2),
    sized("negative sizes", 'kind = "normal", mean = 0.003, sigma = 0.001',
        "insert[0].radius.sigma = 0.001: 0.0013 of the radii would be negative; state lo [m], or sigma <= mean/6 = 0.0005 m"),
    sized("cut-offs reversed", 'kind = "normal", mean = 0.003, sigma = 0.0003, lo = 0.004, hi = 0.002', "insert[0].radius.hi = 0.002: must be above lo = 0.004 [m]"),
    sized("cut-offs far from the mean", 'kind = "normal", mean = 0.003, sigma = 0.0003, lo = 0.005, hi = 0.006',
        "insert[0].radius.lo .. hi: holds 1.31e-11 of the distribution; allowed: >= 0.001 [1]"),
    sized("mass without a smallest radius", 'kind = "weibull", scale = 0.003, shape = 2.0, by = "mass"', "insert[0].radius.lo: missing [m]; shares of mass need a smallest radius"),
    sized("mass from a tiny radius on", 'kind = "weibull", scale = 0.003, shape = 4.0, by = "mass", lo = 1e-4',
        "insert[0].radius.lo = 0.0001: too small for shares of mass"),
    sized("uniform, reversed", 'kind = "uniform", lo = 0.004, hi = 0.003', "insert[0].radius.hi = 0.003: must be above lo = 0.004 [m]"),
    sized("shares of radii that do not add up", 'kind = "discrete", radii = [0.002, 0.003], shares = [0.5, 0.6]',
        "insert[0].radius.shares = (0.5, 0.6): sum 1.1; must add up to 1 [1]"),
    sized("too few shares", 'kind = "discrete", radii = [0.002, 0.003], shares = [1.0]', "insert[0].radius.shares: 1; must be one for each of the 2 radii"),
    sized("table that falls", 'kind = "table", radii = [0.002, 0.003, 0.004], cumulative = [0.0, 1.2, 1.0]', "insert[0].radius.cumulative[1] = 1.2: out of range"),
    sized("table that does not end at 1", 'kind = "table", radii = [0.002, 0.003], cumulative = [0.0, 0.9]',
        "insert[0].radius.cumulative = (0.0, 0.9): must not fall, from 0 to 1 [1]"),
    sized("table of radii that fall", 'kind = "table", radii = [0.003, 0.002], cumulative = [0.0, 1.0]', "insert[0].radius.radii = (0.003, 0.002): must rise [m]"),
    mixed("mixture that does not add up", TWO.format('"ps"', 0.5, '"acrylic"', 0.4), "insert[0].mixture.share = (0.5, 0.4): sum 0.9; must add up to 1 [1]"),
    mixed("mixture of an unknown material", TWO.format('"ps"', 0.5, '"sp"', 0.5), "insert[0].mixture[1].material = 'sp': no such material"),
    mixed("share negative", TWO.format('"ps"', -0.5, '"acrylic"', 1.0), "insert[0].mixture[0].share = -0.5: out of range; allowed: 0 < value <= 1 [1]"),
    mixed("mixture and material", 'material = "ps"\n' + TWO.format('"ps"', 0.5, '"acrylic"', 0.5), "insert[0].material: stands in the mixture; state one of both"),
    drawn(PACK, "shares of mass of one kind", "count = 20", 'count = 20\nshare_by = "mass"', "insert[0].share_by = 'mass': no effect without a mixture"),
    drawn(RATE, "rate zero", "500.0", "0.0", "insert[0].number_rate = 0.0: out of range; allowed: 0 < value [1/s]"),
    drawn(RATE, "no rate", "number_rate = 500.0\n", "", "insert[0].number_rate: missing; state one of number_rate [1/s] and mass_rate [kg/s]"),
    drawn(RATE, "two rates", "number_rate = 500.0", "number_rate = 500.0\nmass_rate = 1.0", "insert[0].number_rate: beside mass_rate; state one of"),
    drawn(RATE, "rate without interval", "every = 0.02\n", "", "insert[0].every: missing [s]"),
    drawn(RATE, "rate above what the region holds", "500.0", "1e6", "insert[0].number_rate = 1e+06 1/s: more than 0.4 of the region every 0.02 s; allowed: <= 1.768e+05 [1/s]"),
    drawn(RATE, "end before the start", "every = 0.02", "every = 0.02\nstart = 0.08\nend = 0.04", "insert[0].end = 0.04: must be above start = 0.08 [s]"),
    drawn(RATE, "start after the end of the run", "every = 0.02", "every = 0.02\nstart = 0.5", "insert[0].start = 0.5 s: less than 0.02 s before the end, 0.1 s"),
    drawn(RATE, "rate of less than one particle", "500.0", "5.0", "insert[0].number_rate = 5 1/s: no particle until 0.1 s"),
    drawn(STREAM, "stream too fast", "200.0", "1e5", "insert[0].number_rate = 100000 1/s: more than the face passes at this velocity; allowed: <= 5391 [1/s]"),
    drawn(STREAM, "stream along its face", "[0.0, 0.0, -1.0]", "[1.0, 0.0, 0.0]", "insert[0].velocity = (1.0, 0.0, 0.0): does not lead through the face [m/s]"),
    drawn(STREAM, "stream at rest", "velocity = [0.0, 0.0, -1.0]\n", "", "insert[0].velocity = (0.0, 0.0, 0.0): does not lead through the face [m/s]"),
    drawn(STREAM, "stream that falls back", "-1.0", "0.1", "insert[0].velocity = (0.0, 0.0, 0.1): gravity turns it back within a diameter; allowed: >= 0.3431 m/s"),
    drawn(STREAM, "stream of unbounded sizes", "radius = 0.003\n", 'radius = { kind = "lognormal", median = 0.003, sigma = 0.2 }\n', "insert[0].radius.hi: missing [m]; a stream needs a largest radius"),
    drawn(STREAM, "face smaller than a particle", "radius = 0.03 ", "radius = 0.002 ", "insert[0].face: no particle of radius 0.003 m passes; allowed: a larger face"),
    drawn(STREAM, "face beyond the domain", "0.0, 0.15]", "0.0, 0.25]", "insert[0].face: reaches from (-0.03, -0.03, 0.25) to (0.03, 0.03, 0.25) m, outside the domain"),
    drawn(STREAM, "face that is skew", DISC, 'face = { kind = "rectangle", corner = [0, 0, 0.1], edges = [[0.05, 0, 0], [0.01, 0.05, 0]] }\n', "insert[0].face.edges", "not at a right angle"),
    drawn(STREAM, "streams that overlap", 'material = "ps"\n', f'material = "ps"\n[[insert]]\n{STREAM}', "insert[1].face: meets the stream of insert[0]"),
]  # fmt: skip
