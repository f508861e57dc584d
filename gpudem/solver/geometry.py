"""From positions and velocities to a `Contact`: what the contact laws read, for pairs and at walls."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from gpudem.contact.types import contact_struct
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs


@functools.cache
def nearest_image(periodic: tuple[bool, bool, bool], precision: str) -> Any:
    """A function (d, size) -> d between nearest images; no code for sides that are not periodic."""
    t = structs(precision, False)
    vec3, real = t.wide3, t.wide
    px, py, pz = periodic

    @wp.func
    def wrap(d: real, size: real):
        half = real(0.5) * size
        if d > half:
            d = d - size
        elif d < -half:
            d = d + size
        return d

    @wp.func
    def nearest(d: vec3, size: vec3):
        x, y, z = d[0], d[1], d[2]
        if wp.static(px):
            x = wrap(x, size[0])
        if wp.static(py):
            y = wrap(y, size[1])
        if wp.static(pz):
            z = wrap(z, size[2])
        return vec3(x, y, z)

    return nearest


@functools.cache
def contact_geometry(spec: Spec) -> SimpleNamespace:
    """The functions narrow, widen, pair_contact, wall_contact, turned, set_motion of one Spec."""
    t = structs(spec.precision, spec.vibration)
    real, vec3, wide, wide3 = t.real, t.vec3, t.wide, t.wide3
    Contact = contact_struct(real)
    mixed = real is not wide

    @wp.func
    def narrow(a: wide3):
        if wp.static(mixed):
            b = vec3(real(a[0]), real(a[1]), real(a[2]))
        else:
            b = a
        return b

    @wp.func
    def widen(a: vec3):
        if wp.static(mixed):
            b = wide3(wide(a[0]), wide(a[1]), wide(a[2]))
        else:
            b = a
        return b

    @wp.func
    def set_motion(c: Contact, v: vec3, v_ahead: vec3, dt: real):
        """Velocities of the contact point, i against j: half a step behind and ahead; dt = 0 at set-up."""
        mean = v
        if wp.static(spec.path):
            mean = real(0.5) * (v + v_ahead)
        c.normal_velocity = wp.dot(mean, c.normal)
        c.tangential_velocity = mean - c.normal_velocity * c.normal
        c.slide = dt * c.tangential_velocity
        if wp.static(spec.path):
            closing = -wp.dot(v, c.normal)
            closing_ahead = -wp.dot(v_ahead, c.normal)
            c.before = wp.max(c.overlap - real(0.5) * dt * closing, real(0.0))
            c.after = wp.max(c.overlap + real(0.5) * dt * closing_ahead, real(0.0))
            share = real(1.0)
            if c.overlap <= dt * closing:  # first step of the contact: it slides from the touch on
                share = c.overlap / (dt * closing)
            c.slide = (share * dt) * (v + closing * c.normal)
        return c

    @wp.func
    def pair_contact(d: wide3, rsq: wide, wide_ri: wide, wide_rj: wide, mi: real, mj: real):
        c = Contact()
        ri = real(wide_ri)
        rj = real(wide_rj)
        if wp.static(mixed and spec.half_list):
            r = wp.sqrt(rsq)
            c.normal = narrow(d * (wide(1.0) / r))
            c.overlap = real(wide_ri + wide_rj - r)
        elif wp.static(mixed):  # the small difference in float64, without its square root, dear to a GPU
            r = wp.sqrt(real(rsq))
            reach = wide_ri + wide_rj
            c.normal = narrow(d) * (real(1.0) / r)
            c.overlap = real(reach * reach - rsq) / (real(reach) + r)
        else:
            r = wp.sqrt(rsq)
            c.normal = d * (real(1.0) / r)
            c.overlap = ri + rj - r
        c.lever = ri - real(0.5) * c.overlap
        if wp.static(spec.several_radii):
            c.radius_eff = ri * rj / (ri + rj)
        else:
            c.radius_eff = real(0.5) * ri
        if wp.static(spec.several_masses):
            c.mass_eff = mi * mj / (mi + mj)
        else:
            c.mass_eff = real(0.5) * mi
        return c

    @wp.func
    def wall_contact(distance: wide, normal: wide3, radius: wide, mass: real):
        c = Contact()
        c.normal = narrow(normal)
        c.overlap = real(radius - distance)
        c.lever = real(radius) - real(0.5) * c.overlap
        c.radius_eff = real(radius)
        c.mass_eff = mass
        return c

    @wp.func
    def turned(c: Contact, v: wide3, wi: wide3, wj: wide3, lever_j: real):
        """Velocity of the contact point from that of the centres and the spins."""
        if wp.static(spec.rotation):
            return narrow(v) - wp.cross(c.lever * narrow(wi) + lever_j * narrow(wj), c.normal)
        return narrow(v)

    return SimpleNamespace(
        narrow=narrow,
        widen=widen,
        set_motion=set_motion,
        pair_contact=pair_contact,
        wall_contact=wall_contact,
        turned=turned,
    )
