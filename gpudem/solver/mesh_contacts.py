# pyright: reportInvalidTypeForm=false
"""Which triangles near a particle make contacts, and which contact of the last step each goes on with.

Before the forces of a particle, its triangles are looked at together: `mesh_leader` of an entry is the entry
whose contact it is part of (itself: it makes one), -2 for none. Springs are handed on before the forces, so
that the loop over contacts knows nothing of triangles.
"""

import functools
from typing import Any

import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_frames import triangle_surface
from gpudem.walls.triangle import EDGE, FACE

#: A point so near a triangle lies on it [radius of the particle]: far below any contact radius, far above the
#: rounding of coordinates in float32.
ON_TRIANGLE = 1e-4
#: mesh_leader of a triangle that is not decided on, and of one without a contact.
OPEN, APART = wp.constant(-1), wp.constant(-2)


@functools.cache
def mesh_contacts(spec: Spec) -> Any:
    """A function: decides on the triangles among entries first..last-1 of a particle at x.

    Without meshes it does nothing.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    if not spec.meshes:

        @wp.func
        def nothing(
            params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
            first: wp.int32, last: wp.int32,
        ):  # fmt: skip
            return

        return nothing
    triangle, rule, hand_on = triangle_surface(spec), contact_rule(spec), spring_handover(spec)
    read = entry_triangle(spec)

    @wp.func
    def decide(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
        first: wp.int32, last: wp.int32,
    ):  # fmt: skip
        limit = radius + params.range
        if wp.static(spec.path):  # may overlap half a step before or after
            limit += wide(0.5) * params.skin
        near = wp.int32(0)
        for k in range(first, last):
            particles.mesh_leader[k] = APART
            e = read(params, particles, k)
            if e >= 0:
                at = launch * params.walls + walls.triangle_wall[e]
                gap, normal, _feature = triangle(params, walls, at, e, x)
                particles.mesh_gap[k] = gap
                particles.mesh_point[k] = x - gap * normal
                if gap <= limit:
                    particles.mesh_leader[k] = OPEN
                    near += 1
        if near > 0:
            rule(params, walls, particles, launch, x, radius, first, last)
        if wp.static(spec.contact_history):
            hand_on(params, walls, particles, launch, x, radius, first, last)

    return decide


@functools.cache
def triangle_apart(spec: Spec) -> Any:
    """A function: whether entry k, of partner `other`, is a triangle that makes no contact of its own."""
    t = structs(spec.precision)

    @wp.func
    def apart(params: t.Params, particles: t.Particles, k: wp.int32, other: wp.int32):
        if wp.static(bool(spec.meshes)):
            return other - params.n >= params.walls and particles.mesh_leader[k] != k
        return False

    return apart


@functools.cache
def entry_triangle(spec: Spec) -> Any:
    """A function of entry k -> its triangle; negative for another wall."""
    t = structs(spec.precision)
    get_int = access(wp.int32).get

    @wp.func
    def read(params: t.Params, particles: t.Particles, k: wp.int32):
        entry = get_int(particles.neighbor, k)
        if entry < 0:
            entry = -entry - 1
        return entry - params.n - params.walls

    return read


def contact_rule(spec: Spec) -> Any:
    """The rule that a scene states, a function like `mesh_contacts`'."""
    return unique_contacts(spec) if spec.meshes == "unique" else liggghts_contacts(spec)


@functools.cache
def same_contact(spec: Spec) -> Any:
    """A function: whether the nearest point of entry k is no place of its own beside entry m.

    It lies on m's triangle, which is nearer elsewhere, or (with merge) both are of one mesh and the normals
    differ by less than the merge angle.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    triangle, read = triangle_surface(spec), entry_triangle(spec)

    @wp.func
    def lies_on(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, radius: wide,
        k: wp.int32, m: wp.int32,
    ):  # fmt: skip
        e = read(params, particles, m)
        at = launch * params.walls + walls.triangle_wall[e]
        gap, _normal, _feature = triangle(params, walls, at, e, particles.mesh_point[k])
        return gap <= wide(ON_TRIANGLE) * radius

    @wp.func
    def alike(
        params: Params, walls: Walls, particles: Particles, x: wide3, k: wp.int32, m: wp.int32
    ):  # fmt: skip
        wall_k = walls.triangle_wall[read(params, particles, k)]
        wall_m = walls.triangle_wall[read(params, particles, m)]
        to_k, to_m = x - particles.mesh_point[k], x - particles.mesh_point[m]
        cosine = wp.dot(to_k, to_m)
        return wall_k == wall_m and cosine > params.merge_cosine * wp.length(to_k) * wp.length(to_m)

    return lies_on, alike


@functools.cache
def unique_contacts(spec: Spec) -> Any:
    """One contact for each place where the distance to the surface is least, the deepest first.

    A triangle whose nearest point lies on a deeper one has no such place of its own: so an edge counts once,
    and not at all where the surface goes on nearer to the particle; which triangles share corners does not
    matter. Of places of one mesh whose normals differ by less than the merge angle the deepest counts: there
    the surface is curved, and a finer mesh would have one.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    lies_on, alike = same_contact(spec)

    @wp.func
    def leader_of(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
        first: wp.int32, last: wp.int32, k: wp.int32,
    ):  # fmt: skip
        for m in range(first, last):
            if particles.mesh_leader[m] >= 0:
                if lies_on(params, walls, particles, launch, radius, k, m):  # mutate: point_on_deeper
                    return particles.mesh_leader[m]
        for m in range(first, last):
            if particles.mesh_leader[m] == m:
                if alike(params, walls, particles, x, k, m):  # mutate: merged_normals
                    return m
        return k

    @wp.func
    def decide(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
        first: wp.int32, last: wp.int32,
    ):  # fmt: skip
        deepest = wp.int32(0)
        while deepest >= 0:
            deepest = wp.int32(-1)
            for k in range(first, last):
                if particles.mesh_leader[k] == OPEN:
                    if deepest < 0:
                        deepest = wp.int32(0) + k
                    elif particles.mesh_gap[k] < particles.mesh_gap[deepest]:  # mutate: deepest_first
                        deepest = wp.int32(0) + k
            if deepest >= 0:
                particles.mesh_leader[deepest] = leader_of(
                    params, walls, particles, launch, x, radius, first, last, deepest
                )

    return decide


@functools.cache
def coplanar_neighbors(spec: Spec) -> Any:
    """A function: whether triangles d and e of one mesh share a corner and are one face to LIGGGHTS."""
    t = structs(spec.precision)

    @wp.func
    def coplanar(params: t.Params, walls: t.Walls, d: wp.int32, e: wp.int32):
        if walls.triangle_wall[d] != walls.triangle_wall[e]:
            return False
        if wp.dot(walls.facing[d], walls.facing[e]) < params.coplanar_cosine:  # mutate: coplanar_faces
            return False
        for a in range(3):
            for b in range(3):
                if walls.nodes[d][a] == walls.nodes[e][b]:
                    return True
        return False

    return coplanar


@functools.cache
def liggghts_contacts(spec: Spec) -> Any:
    """LIGGGHTS' rule, triangle by triangle in the order of the mesh.

    A face counts unless one before it that shares a corner and lies in the same plane counts already; one
    that was in contact in the last step keeps it. An edge or a corner counts where it is active for its
    triangle (`gpudem.solver.mesh_tables.active_features`).
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    triangle, read, coplanar = triangle_surface(spec), entry_triangle(spec), coplanar_neighbors(spec)
    get_int = access(wp.int32).get

    @wp.func
    def feature_of(params: Params, walls: Walls, launch: wp.int32, e: wp.int32, x: wide3):
        _gap, _normal, feature = triangle(params, walls, launch * params.walls + walls.triangle_wall[e], e, x)
        return feature

    @wp.func
    def counts(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3,
        first: wp.int32, k: wp.int32,
    ):  # fmt: skip
        e = read(params, particles, k)
        feature = feature_of(params, walls, launch, e, x)
        if feature >= EDGE:
            return (walls.active[e] >> (feature - EDGE)) & 1 == 1  # mutate: active_feature
        if get_int(particles.neighbor, k) < 0:
            return True  # mutate: face_keeps_contact
        for m in range(first, k):
            if particles.mesh_leader[m] == m:
                d = read(params, particles, m)
                if coplanar(params, walls, d, e):
                    if feature_of(params, walls, launch, d, x) == FACE:
                        return False  # mutate: one_face_of_plane
        return True

    @wp.func
    def decide(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
        first: wp.int32, last: wp.int32,
    ):  # fmt: skip
        for k in range(first, last):
            if particles.mesh_leader[k] == OPEN:
                if counts(params, walls, particles, launch, x, first, k):
                    particles.mesh_leader[k] = wp.int32(0) + k
                else:
                    particles.mesh_leader[k] = APART

    return decide


@functools.cache
def spring_handover(spec: Spec) -> Any:
    """A function: hands the history of contacts that ended to those that go on with them.

    `unique`: the history of a triangle that is now part of another's contact, or has none, moves to that
    one, unless it has a history. `liggghts`: a new contact takes a copy from a coplanar neighbor in contact.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    lies_on, alike = same_contact(spec)
    read, coplanar = entry_triangle(spec), coplanar_neighbors(spec)

    @wp.func
    def copy(particles: Particles, source: wp.int32, target: wp.int32):
        particles.neighbor[target] = -particles.neighbor[target] - 1
        if wp.static(spec.spring_history):
            particles.spring[target] = particles.spring[source]  # mutate: spring_handed_on
        if wp.static(spec.rolling_history):
            particles.rolling_torque[target] = particles.rolling_torque[source]

    @wp.func
    def heir_of(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
        first: wp.int32, last: wp.int32, k: wp.int32,
    ):  # fmt: skip
        if particles.mesh_leader[k] >= 0:
            return particles.mesh_leader[k]
        for m in range(first, last):
            if particles.mesh_leader[m] == m:
                if lies_on(params, walls, particles, launch, radius, k, m):
                    return wp.int32(0) + m
                if alike(params, walls, particles, x, k, m):
                    return wp.int32(0) + m
        return wp.int32(-1)

    @wp.func
    def move_all(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
        first: wp.int32, last: wp.int32,
    ):  # fmt: skip
        for k in range(first, last):
            if particles.neighbor[k] < 0 and particles.mesh_leader[k] != k:
                if read(params, particles, k) >= 0:
                    heir = heir_of(params, walls, particles, launch, x, radius, first, last, k)
                    if heir >= 0 and particles.neighbor[heir] >= 0:
                        copy(particles, k, heir)
                    particles.neighbor[k] = -particles.neighbor[k] - 1

    @wp.func
    def copy_all(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, x: wide3, radius: wide,
        first: wp.int32, last: wp.int32,
    ):  # fmt: skip
        for k in range(first, last):
            if particles.neighbor[k] >= 0 and particles.mesh_leader[k] == k:
                source = wp.int32(-1)
                for m in range(first, last):
                    if particles.neighbor[m] < 0 and source < 0:
                        e = read(params, particles, m)
                        if e >= 0:
                            if coplanar(params, walls, e, read(params, particles, k)):
                                source = wp.int32(0) + m
                if source >= 0:
                    copy(particles, source, k)

    return move_all if spec.meshes == "unique" else copy_all
