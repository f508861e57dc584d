"""Oracles of mfix_dem, incline, rolling_decay, haff and elastic_gas against answers known elsewhere."""

import math

import numpy as np
import pytest

from comparisons.oracles import cohesion, column, gas, linear
from comparisons.oracles.bodies import Bodies
from comparisons.oracles.rolling import Arm, down_slope, resisted, sticking_limit, wound_stop
from gpudem.contact.coefficients import pair_coefficients
from gpudem.scene import Contact, Domain, Explicit, Material, Pair, Scene, Time

RIGID = Arm(0.003, 0.003, 0.0)


@pytest.mark.parametrize(
    ("stiffness", "restitution", "end", "speed", "last"),
    [
        (1e4, 0.9, 0.39743489, 2.47544321, 0.30231307),
        (1e5, 1.0, 0.31916510, 2.80094984, 0.44616457),
        (5e4, 0.6, 0.33467116, 1.60203036, 0.23083617),
    ],
)
def test_bouncer_against_the_analytic_solution_of_mfix(stiffness, restitution, end, speed, last):
    """End of contact, velocity then and height at 0.5 s of MFIX-DEM's DEM01, evaluated apart."""
    b = linear.Bouncer(10.8908545, stiffness, restitution, 9.80665, 0.4)
    phases = b.phases(0.5)
    assert phases[1].end == pytest.approx(end, rel=1e-7)
    assert phases[2].speed == pytest.approx(speed, rel=1e-7)
    assert b.at(np.array([0.5]))[0][0] + 0.1 == pytest.approx(last, rel=1e-6)


def test_bouncer_tends_to_the_hard_sphere_and_comes_to_rest():
    hard = linear.Bouncer(1.0, 1e10, 0.8, 9.81, 0.4)
    assert hard.tops(1.5) == pytest.approx(
        [linear.hard_sphere_top(0.4, 0.8, k) for k in (1, 2, 3)][: len(hard.tops(1.5))], rel=1e-3
    )
    soft = linear.Bouncer(1.0, 1e3, 0.3, 9.81, 0.05)
    assert soft.phases(10.0)[-1].end == math.inf
    assert soft.at(np.array([10.0]))[0][0] == pytest.approx(-9.81 / 1e3, rel=1e-9)


def test_squeezed_column_rests_where_forces_balance():
    """MFIX-DEM's DEM03: 0.43325 mm and 1.3666 mm."""
    y = linear.squeezed_column(
        np.array([0.0, 1.0]), (4.5e-4, 1.35e-3), 5e-4, (1.0471976e-5, 0.5235988e-5), 0.0018, 1e3, 0.5, 9.80665
    )
    assert y[0] == pytest.approx([4.5e-4, 1.35e-3])
    assert y[1] == pytest.approx([4.3325e-4, 1.3666e-3], rel=1e-4)


def test_modulus_of_hooke_gives_the_stiffness_wanted():
    """Through the solver's own coefficients: k = A R*^(2/5) m*^(1/5)."""
    radius, mass, nu = 0.01, 1000 * 4 / 3 * math.pi * 1e-6, 0.3
    young = 2 * (1 - nu**2) * linear.young_star(5e4, radius / 2, mass / 2, 2.0)
    scene = Scene(
        name="k", materials={"a": Material(young=young, poisson=nu, density=1000)},
        pairs=[Pair(materials=("a", "a"))], contact=Contact(normal="hooke", characteristic_velocity=2.0),
        particles=Explicit(position=[(0, 0, 0)], radius=radius, material="a"),
        domain=Domain(lo=(-1, -1, -1), hi=(1, 1, 1)), time=Time(step=1e-5, duration=1e-4),
    )  # fmt: skip
    k = (
        pair_coefficients(scene.laws, scene.inputs("a", "a"))["k_normal"]
        * (radius / 2) ** 0.4
        * (mass / 2) ** 0.2
    )
    assert k == pytest.approx(5e4, rel=1e-12)


def test_slopes_are_the_textbook_ones_for_a_rigid_sphere():
    """5/7 g sin; g (sin - mu cos) and 5/2 mu g cos; the limit at tan = 7/2 mu; MercuryDPM's 15 degrees."""
    slope = math.radians(30)
    assert sticking_limit(RIGID, slope) == pytest.approx(2 / 7 * math.tan(slope))
    assert down_slope(RIGID, math.radians(15), 0.5, 9.8)[0] == pytest.approx(1.81167, abs=1e-4)
    u, w = down_slope(RIGID, slope, 0.1, 10.0)
    assert u == pytest.approx(10 * (0.5 - 0.1 * math.cos(slope)))
    assert w == pytest.approx(2.5 * 0.1 * 10 * math.cos(slope))
    at = down_slope(RIGID, slope, sticking_limit(RIGID, slope) * (1 - 1e-9), 10.0)
    assert at[0] == pytest.approx(at[1], rel=1e-7)
    assert resisted(RIGID, 0.0, 0.1, 9.8) == pytest.approx(-5 / 7 * 0.98)


def test_slope_with_rolling_friction():
    """The limit 2/7 tan + 5/7 mu_r, where sliding and rolling meet; beyond, 5/2 (mu - mu_r) g cos."""
    slope, mu_r = math.radians(30), 0.05
    limit = sticking_limit(RIGID, slope, mu_r)
    assert limit == pytest.approx(2 / 7 * math.tan(slope) + 5 / 7 * mu_r)
    u, w = down_slope(RIGID, slope, 0.1, 10.0, mu_r)
    assert u == pytest.approx(10 * (0.5 - 0.1 * math.cos(slope)))
    assert w == pytest.approx(2.5 * 0.05 * 10 * math.cos(slope))
    at = down_slope(RIGID, slope, limit * (1 - 1e-9), 10.0, mu_r)
    assert at == pytest.approx((resisted(RIGID, slope, mu_r, 10.0),) * 2, rel=1e-7)


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_stop_against_a_rolling_spring(damping):
    """Against small steps of the torque itself: a spring that yields at its limit, its dashpot below it."""
    speed, rate, wind = 0.06, 0.35, 4e-4
    dt, v, way, spring = 1e-6, speed, 0.0, 0.0
    for _ in range(1_000_000):
        stretch = spring + v * dt
        yields = abs(stretch) > wind
        spring = math.copysign(wind, stretch) if yields else stretch
        v -= dt * (rate / wind * spring + (0 if yields else 2 * damping * math.sqrt(rate / wind) * v))
        way += v * dt
        if v < 0 and damping == 0:
            way -= wind  # an undamped spring swings about this place
            break
    assert wound_stop(speed, rate, wind, damping) == pytest.approx(way, rel=2e-4)


@pytest.mark.parametrize("radius", [(0.003, 0.003), (0.003, 0.002), (0.003, math.inf)])
def test_pull_off_of_a_cohesive_contact(radius):
    """2/3 pi^3 k^3 R*^2/E*^2 where overlaps are small, and the density of a force gives that force."""
    mass = tuple(math.inf if math.isinf(r) else 1.0 for r in radius)
    one = Bodies((mass[0], mass[1]), radius, 1e6, 1e5, 1.0, 0.0)
    small = 1e3
    want = 2 / 3 * math.pi**3 * small**3 * one.radius_star**2 / one.young_star**2
    assert cohesion.pull_off(one, small) == pytest.approx(want, rel=1e-4)
    for force in (want, 1e6 * want):
        assert cohesion.pull_off(one, cohesion.density_for(one, force)) == pytest.approx(force, rel=1e-6)


@pytest.mark.parametrize(("phi", "z"), [(0.1, 1.52126), (0.2, 2.40625), (0.3, 3.97376), (0.49, 12.15559)])
def test_carnahan_starling(phi, z):
    assert gas.compressibility(phi) == pytest.approx(z, rel=1e-5)
    assert gas.compressibility(phi) == pytest.approx((1 + phi + phi**2 - phi**3) / (1 - phi) ** 3, rel=1e-12)


def test_collision_rate_against_dynamo():
    """Mean free time 0.13057 (Enskog) of 1372 hard spheres at rho d^3 = 0.5, T = 1 (DynamO's own test)."""
    g = gas.contact_value(gas.volume_share(1.0, 0.5))
    assert 1 / gas.collision_rate(1.0, 0.5, 1.0, g) == pytest.approx(0.13057, rel=1e-4)


def test_soft_diameter_is_the_integral():
    k, m, t, d = 2e6, 1e-5, 1.0, 2e-3
    r = np.linspace(d * 0.95, d, 200001)
    hole = np.trapezoid(np.exp(-k * (d - r) ** 2 / (2 * m * t)), r)
    assert gas.soft_diameter(d, k, m, t) == pytest.approx(d - hole, rel=1e-9)


def test_cooling_is_rate_times_loss():
    """dT/dt = -(1 - e^2) w T/3 with w the collision rate, but for the Sonine factor (0.3 % at e = 0.9)."""
    slope, e = gas.haff_slope(2e-3, 2.4e7, 0.9), 0.9
    w = gas.collision_rate(2e-3, 2.4e7, 1.0, gas.contact_value(gas.volume_share(2e-3, 2.4e7)))
    assert slope == pytest.approx((1 - e * e) * w / 6, rel=0.005)
    assert slope != pytest.approx((1 - e * e) * w / 6, rel=0.001)


def test_a_thin_column_is_the_barometric_one():
    # catches: units of cover, the height counted from elsewhere. Ideal gas: exp(-g h/T), mean height T/g
    thin = column.column(0.1, 10.0, 2e-3, 1e-6 / 2e-3**2)
    assert thin.centre == pytest.approx(0.01, rel=1e-5)
    assert thin.layer < 1e-6
    assert thin.share_below(np.array([0.01])) == pytest.approx(1 - math.exp(-1), rel=1e-5)


def test_a_dense_column_carries_its_weight():
    # catches: the integral of the profile. phi/volume integrates to the spheres above an area, less the layer
    d, cover = 2e-3, 2 / 2e-3**2
    dense = column.column(0.0858, 9.81, d, cover)
    above = np.trapezoid(dense.phi, dense.height) / (math.pi / 6 * d**3)
    assert above == pytest.approx((1 - dense.layer) * cover, rel=1e-5)
    assert dense.layer == pytest.approx(0.025, abs=0.001)
    again = column.of_energy(1.5 * 0.0858 + 9.81 * dense.centre, 3, 9.81, d, cover)
    assert again.temperature == pytest.approx(0.0858, rel=1e-8)


def test_hits_bring_the_weight():
    # a half-Maxwellian hits with mean speed sqrt(pi T/2): N m g = 2 m sqrt(pi T/2) rate
    rng = np.random.default_rng(1)
    speed = rng.rayleigh(math.sqrt(0.3), 1_000_000).mean()
    assert column.floor_rate(5, 9.81, 0.3) * 2 * speed == pytest.approx(5 * 9.81, rel=2e-3)


def test_equations_of_state_of_disks():
    # catches: a digit of a coefficient. Henderson: 4.125 at 0.5; Luding's correction is 1.2 % at 0.6; both
    # are 1 + 2 eta + 3.125 eta^2 at small eta
    assert gas.disk_compressibility(0.5, gas.henderson(0.5)) == pytest.approx(4.125)
    assert gas.disk_compressibility(0.6, gas.disk_contact_value(0.6)) == pytest.approx(6.4521, abs=1e-4)
    small = gas.disk_compressibility(1e-3, gas.disk_contact_value(1e-3))
    assert small == pytest.approx(1 + 2e-3 + 3.125e-6, abs=1e-8)


def test_virial_series_of_spheres():
    # catches: a digit of a coefficient. Carnahan and Starling's are 4, 10, 18, 28, 40, 54, ...
    assert gas.virial_series(0.1) == pytest.approx(gas.compressibility(0.1), rel=5e-4)
    assert gas.virial_series(math.pi / 12) == pytest.approx(3.2691, abs=2e-4)


def test_rate_goes_with_pressure():
    # catches: a factor for two or three axes. Enskog's rate and Z have one g
    z, d, t = gas.compressibility(0.2), 2e-3, 0.7
    n = 6 * 0.2 / (math.pi * d**3)
    want = gas.collision_rate(d, n, t, gas.contact_value(0.2))
    assert gas.rate_of_pressure(z, d, t, 3) == pytest.approx(want)
    g, n = gas.henderson(0.3), 4 * 0.3 / (math.pi * d**2)
    want = 2 * math.sqrt(math.pi) * n * d * g * math.sqrt(t)
    assert gas.rate_of_pressure(gas.disk_compressibility(0.3, g), d, t, 2) == pytest.approx(want)
