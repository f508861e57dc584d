# pyright: reportInvalidTypeForm=false
"""What a contact law reads: the geometry and motion of one contact, the coefficients of one material pair."""

import functools
from typing import Any

import warp as wp

#: Arithmetic of the contact laws: forces, springs, coefficients.
REAL = {"float64": wp.float64, "mixed": wp.float32, "float32": wp.float32}
#: What is added up from step to step or subtracted to a small difference: positions, velocities, radii.
WIDE = {"float64": wp.float64, "mixed": wp.float64, "float32": wp.float32}


@functools.cache
def contact_struct(real: Any) -> Any:
    """The struct `Contact` in one precision. Particle i touches j (or a wall); normal points from j to i."""
    vec3 = wp.types.vector(3, real)

    @wp.struct
    class Contact:
        overlap: real  # delta [m], > 0 in contact
        normal: vec3  # n, from j to i
        normal_velocity: real  # (v_i - v_j).n [m/s], > 0 separating
        tangential_velocity: vec3  # of the contact point, i against j [m/s]
        slide: vec3  # displacement of the contact point in the tangent plane over the last step [m]
        spin: vec3  # w_i - w_j [rad/s]; at a wall w_i lever/(R - overlap)
        radius_eff: real  # R* = R_i R_j/(R_i + R_j) [m]; at a wall R_i
        mass_eff: real  # m* = m_i m_j/(m_i + m_j) [kg]; at a wall m_i
        overlap_minus_half: real  # overlap half a step before, at least 0 [m]; integrator "path" only
        overlap_plus_half: real  # overlap half a step ahead, at least 0 [m]; likewise
        lever: real  # R_i - overlap/2 [m], from the centre of i to the contact point
        inverse_reach: real  # 1/(R_i + R_j) [1/m], 0 at a wall; for laws of cohesion only
        inertia_eff: real  # 7/5 m R^2 of both as m* is of masses [kg m2]; for laws of rolling that read it

    return Contact


@functools.cache
def pair_struct(real: Any, fields: tuple[str, ...]) -> Any:
    """The struct `Pair` in one precision: the coefficients of a material pair that the laws read."""
    return wp.struct(type("Pair", (), {"__annotations__": dict.fromkeys(fields, real)}))
