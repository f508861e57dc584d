# pyright: reportInvalidTypeForm=false, reportOptionalCall=false, reportArgumentType=false
"""Which triangles near a particle make contacts, and which contact of the last step each goes on with.

Before the forces of a particle, its triangles are looked at together: `mesh_leader` of an entry is the entry
whose contact it is part of (itself: it makes one). Springs are handed on before the forces, so that the loop
over contacts knows nothing of triangles. `mesh_near` lists the entries of the triangles within reach, from
the first wall entry of the particle on: `begin` to `end` below.
"""

import functools
from typing import Any

import warp as wp

from gpudem.solver.arrays import access
from gpudem.solver.mesh_entries import mesh_entry, triangle_reach, triangle_surface
from gpudem.solver.spec import Spec
from gpudem.solver.state import structs
from gpudem.solver.wall_frames import element_surface, wall_frame
from gpudem.walls.triangle import EDGE, FACE

#: A point so near a triangle lies on it [radius of the particle]: far below any contact radius, far above the
#: rounding of coordinates in float32.
ON_TRIANGLE = 1e-4
#: A face is deeper than an edge or a corner whose gap is less by no more than this share, which is rounding:
#: where the surface goes on across an edge, the normal is then the face's to the last bit.
FACE_FIRST = {"float64": 2.0**-49, "mixed": 2.0**-49, "float32": 2.0**-20}
#: mesh_leader of a triangle without a contact, and of one within reach that is not decided on, less its
#: feature.
APART, OPEN = wp.constant(-2), wp.constant(-3)


@functools.cache
def mesh_contacts(spec: Spec) -> Any:
    """A function: decides on the triangles among entries first..last-1 of particle i at x.

    Without meshes it does nothing.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    if not spec.meshes:

        @wp.func
        def nothing(
            params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
            radius: wide, first: wp.int32, last: wp.int32,
        ):  # fmt: skip
            return

        return nothing
    place_of, entry, integers = mesh_place(spec), mesh_entry(spec), access(wp.int32)
    code_of, put_int = entry.code, integers.put
    may_reach, triangle = triangle_reach(spec.precision), triangle_surface(spec)
    to_space, rule, hand_on = wall_frame(spec).to_space, contact_rule(spec), spring_handover(spec)

    @wp.func
    def decide(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        radius: wide, first: wp.int32, last: wp.int32,
    ):  # fmt: skip
        limit = radius + params.range
        if wp.static(spec.path):  # may overlap half a step before or after
            limit += wide(0.5) * params.skin
        end = wp.int32(0) + first
        for k in range(first, last, wp.static(spec.list_slice)):
            put_int(particles.mesh_leader, k, APART)
            code = code_of(params, particles, k)
            if code >= 0:
                e, at, place = place_of(params, walls, particles, launch, i, code, x)
                if may_reach(walls, e, place, limit):
                    gap, normal, feature = triangle(walls, e, place)
                    if gap <= limit:
                        particles.mesh_gap[k] = gap
                        particles.mesh_normal[k] = to_space(walls, at, normal)
                        put_int(particles.mesh_leader, k, OPEN - feature)
                        put_int(particles.mesh_near, end, k)
                        end += wp.static(spec.list_slice)  # mutate: next_near_triangle
        if end > first:
            rule(params, walls, particles, launch, i, x, radius, first, end)
            if wp.static(spec.contact_history):
                hand_on(params, walls, particles, launch, i, x, radius, first, last, end)

    return decide


@functools.cache
def triangle_apart(spec: Spec) -> Any:
    """A function: whether entry k, of partner `other`, is a triangle that makes no contact of its own."""
    t = structs(spec.precision)
    get_int = access(wp.int32).get

    @wp.func
    def apart(params: t.Params, particles: t.Particles, k: wp.int32, other: wp.int32):
        if wp.static(bool(spec.meshes)):
            if other - params.n >= params.walls:
                return get_int(particles.mesh_leader, k) != k
        return False

    return apart


@functools.cache
def mesh_place(spec: Spec) -> Any:
    """A function of the code of an entry -> (triangle, place of its mesh in the tables, x in its frame)."""
    t = structs(spec.precision)
    entry, to_wall = mesh_entry(spec), wall_frame(spec).to_wall
    triangle, shifted = entry.triangle, entry.shifted

    @wp.func
    def place_of(
        params: t.Params, walls: t.Walls, particles: t.Particles, launch: wp.int32, i: wp.int32,
        code: wp.int32, x: t.wide3,
    ):  # fmt: skip
        e = triangle(code)
        at = launch * params.walls + walls.triangle_wall[e]
        return e, at, to_wall(walls, at, shifted(params, walls, particles, i, at, code, x))

    return place_of


@functools.cache
def wall_entry(spec: Spec) -> Any:
    """A function of entry k, of a wall or of a triangle that makes a contact, and its partner -> (wall,
    gap [m], normal, the wall's nearest point where the wall is [m]).
    """
    t = structs(spec.precision)
    entry, surface = mesh_entry(spec), element_surface(spec) if spec.walls else None
    triangle, shifted = entry.triangle, entry.shifted

    @wp.func
    def contact_of(
        params: t.Params, walls: t.Walls, particles: t.Particles, launch: wp.int32, i: wp.int32,
        k: wp.int32, other: wp.int32, x: t.wide3,
    ):  # fmt: skip
        e = other - params.n
        if wp.static(bool(spec.meshes)):
            if e >= params.walls:
                code = e - params.walls
                w = walls.triangle_wall[triangle(code)]
                gap_k, normal_k = particles.mesh_gap[k], particles.mesh_normal[k]
                here = shifted(params, walls, particles, i, launch * params.walls + w, code, x)
                return w, gap_k, normal_k, here - gap_k * normal_k
        if wp.static(bool(spec.walls)):
            gap, normal = surface(params, walls, launch, e, x)
            return e, gap, normal, x - gap * normal
        return e, t.wide(1.0e30), x, x

    return contact_of


def contact_rule(spec: Spec) -> Any:
    """The rule that a scene states: a function that sets mesh_leader of the triangles within reach."""
    return unique_contacts(spec) if spec.meshes == "unique" else liggghts_contacts(spec)


@functools.cache
def lies_on_triangle(spec: Spec) -> Any:
    """A function: whether a point of space near particle i lies on the triangle of entry m."""
    t = structs(spec.precision)
    place_of, code_of = mesh_place(spec), mesh_entry(spec).code
    may_reach, triangle = triangle_reach(spec.precision), triangle_surface(spec)

    @wp.func
    def lies_on(
        params: t.Params, walls: t.Walls, particles: t.Particles, launch: wp.int32, i: wp.int32,
        point: t.wide3, radius: t.wide, m: wp.int32,
    ):  # fmt: skip
        code = code_of(params, particles, m)
        e, _at, place = place_of(params, walls, particles, launch, i, code, point)
        if not may_reach(walls, e, place, t.wide(ON_TRIANGLE) * radius):
            return False
        gap, _normal, _feature = triangle(walls, e, place)
        return gap <= t.wide(ON_TRIANGLE) * radius

    return lies_on


@functools.cache
def deepest_triangle(spec: Spec) -> Any:
    """A function: the entry within reach that is deepest of those not decided on; -1: all are."""
    t = structs(spec.precision)
    get_int, bias = access(wp.int32).get, FACE_FIRST[spec.precision]

    @wp.func
    def deepest(particles: t.Particles, begin: wp.int32, end: wp.int32):
        found, least = wp.int32(-1), t.wide(0.0)
        for at in range(begin, end, wp.static(spec.list_slice)):
            k = get_int(particles.mesh_near, at)
            state = get_int(particles.mesh_leader, k)
            if state <= OPEN:
                gap = particles.mesh_gap[k]
                if state < OPEN - FACE:
                    gap += t.wide(bias) * gap  # mutate: face_first
                if found < 0 or gap < least:  # mutate: deepest_first
                    found = wp.int32(0) + k
                    least = t.wide(0.0) + gap
        return found

    return deepest


@functools.cache
def unique_contacts(spec: Spec) -> Any:
    """One contact for each place where the distance to the surface is least, the deepest first.

    A triangle whose nearest point lies on a deeper one has no such place of its own: so an edge counts once,
    and not at all where the surface goes on nearer to the particle; which triangles share corners, and how
    the surface is divided into triangles and meshes, does not matter. Of places whose normals differ by less
    than the merge angle the deepest counts: there the surface is curved, and a finer mesh would have one.
    """
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    lies_on, deepest, get_int = lies_on_triangle(spec), deepest_triangle(spec), access(wp.int32).get

    @wp.func
    def leader_of(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        radius: wide, begin: wp.int32, end: wp.int32, k: wp.int32,
    ):  # fmt: skip
        """Of the contact that the nearest point of entry k is part of, or k."""
        point = x - particles.mesh_gap[k] * particles.mesh_normal[k]
        for at in range(begin, end, wp.static(spec.list_slice)):
            m = get_int(particles.mesh_near, at)
            leader = get_int(particles.mesh_leader, m)
            if leader >= 0:
                if lies_on(params, walls, particles, launch, i, point, radius, m):  # mutate: point_on_deeper
                    return leader
        return k

    @wp.func
    def decide(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        radius: wide, begin: wp.int32, end: wp.int32,
    ):  # fmt: skip
        k = deepest(particles, begin, end)
        while k >= 0:
            leader = leader_of(params, walls, particles, launch, i, x, radius, begin, end, k)
            particles.mesh_leader[k] = leader
            if leader == k:
                for at in range(begin, end, wp.static(spec.list_slice)):
                    m = get_int(particles.mesh_near, at)
                    if get_int(particles.mesh_leader, m) <= OPEN:
                        cosine = wp.dot(particles.mesh_normal[k], particles.mesh_normal[m])
                        if cosine > params.merge_cosine:  # mutate: merged_normals
                            particles.mesh_leader[m] = k
            k = deepest(particles, begin, end)

    return decide


@functools.cache
def coplanar_neighbors(spec: Spec) -> Any:
    """A function: whether triangles d and e of one mesh share a corner and are one face to LIGGGHTS."""
    t = structs(spec.precision)

    @wp.func
    def coplanar(params: t.Params, walls: t.Walls, d: wp.int32, e: wp.int32):
        if walls.triangle_wall[d] != walls.triangle_wall[e]:
            return False
        between = wp.abs(wp.dot(walls.facing[d], walls.facing[e]))
        if between < params.coplanar_cosine:  # mutate: coplanar_faces
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
    coplanar, place_of, entry = coplanar_neighbors(spec), mesh_place(spec), mesh_entry(spec)
    code_of, triangle_of = entry.code, entry.triangle
    get_int, triangle = access(wp.int32).get, triangle_surface(spec)

    @wp.func
    def counts(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        begin: wp.int32, at: wp.int32,
    ):  # fmt: skip
        k = get_int(particles.mesh_near, at)
        e, feature = triangle_of(code_of(params, particles, k)), OPEN - get_int(particles.mesh_leader, k)
        if feature >= EDGE:
            return (walls.active[e] >> (feature - EDGE)) & 1 == 1  # mutate: active_feature
        if get_int(particles.neighbor, k) < 0:  # mutate: face_keeps_contact
            return True
        for before in range(begin, at, wp.static(spec.list_slice)):
            m = get_int(particles.mesh_near, before)
            if get_int(particles.mesh_leader, m) == m:
                code = code_of(params, particles, m)
                if coplanar(params, walls, triangle_of(code), e):
                    d, _at, place = place_of(params, walls, particles, launch, i, code, x)
                    _gap, _normal, feature_d = triangle(walls, d, place)
                    if feature_d == FACE:
                        return False  # mutate: one_face_of_plane
        return True

    @wp.func
    def decide(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        radius: wide, begin: wp.int32, end: wp.int32,
    ):  # fmt: skip
        for at in range(begin, end, wp.static(spec.list_slice)):
            k = get_int(particles.mesh_near, at)
            if counts(params, walls, particles, launch, i, x, begin, at):
                particles.mesh_leader[k] = k
            else:
                particles.mesh_leader[k] = APART

    return decide


@functools.cache
def spring_handover(spec: Spec) -> Any:
    """A function: hands the history of contacts that ended to those that go on with them.

    `unique`: the history of a triangle that is now part of another's contact, or has none, moves to that
    one, unless it has a history. `liggghts`: a new contact takes a copy from a coplanar neighbor in contact.
    """
    return moved_springs(spec) if spec.meshes == "unique" else copied_springs(spec)


@functools.cache
def spring_copy(spec: Spec) -> Any:
    """A function: entry `target` goes on with the history of `source`."""
    t = structs(spec.precision)

    @wp.func
    def copy(particles: t.Particles, source: wp.int32, target: wp.int32):
        particles.neighbor[target] = -particles.neighbor[target] - 1  # mutate: contact_handed_on
        if wp.static(spec.spring_history):
            particles.spring[target] = particles.spring[source]  # mutate: spring_handed_on
        if wp.static(spec.rolling_history):
            particles.rolling_torque[target] = particles.rolling_torque[source]  # mutate: torque_handed_on

    return copy


@functools.cache
def moved_springs(spec: Spec) -> Any:
    """The `spring_handover` of the rule `unique`."""
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    lies_on, copy, get_int = lies_on_triangle(spec), spring_copy(spec), access(wp.int32).get
    code_of, place_of, triangle = mesh_entry(spec).code, mesh_place(spec), triangle_surface(spec)
    to_space = wall_frame(spec).to_space

    @wp.func
    def heir_of(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        radius: wide, begin: wp.int32, end: wp.int32, k: wp.int32,
    ):  # fmt: skip
        leader = get_int(particles.mesh_leader, k)
        if leader >= 0:
            return leader
        code = code_of(params, particles, k)
        e, at_wall, place = place_of(params, walls, particles, launch, i, code, x)
        gap, inward, _feature = triangle(walls, e, place)
        normal = to_space(walls, at_wall, inward)
        for at in range(begin, end, wp.static(spec.list_slice)):
            m = get_int(particles.mesh_near, at)
            if get_int(particles.mesh_leader, m) == m:
                if wp.dot(normal, particles.mesh_normal[m]) > params.merge_cosine:
                    return m
                if lies_on(params, walls, particles, launch, i, x - gap * normal, radius, m):
                    return m
        return wp.int32(-1)

    @wp.func
    def move_all(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        radius: wide, first: wp.int32, last: wp.int32, end: wp.int32,
    ):  # fmt: skip
        for k in range(first, last, wp.static(spec.list_slice)):
            if get_int(particles.neighbor, k) < 0 and get_int(particles.mesh_leader, k) != k:
                if code_of(params, particles, k) >= 0:
                    heir = heir_of(params, walls, particles, launch, i, x, radius, first, end, k)
                    if heir >= 0:
                        if particles.neighbor[heir] >= 0:
                            copy(particles, k, heir)

    return move_all


@functools.cache
def copied_springs(spec: Spec) -> Any:
    """The `spring_handover` of the rule `liggghts`."""
    t = structs(spec.precision)
    Params, Particles, Walls, wide, wide3 = t.Params, t.Particles, t.Walls, t.wide, t.wide3
    coplanar, copy, get_int = coplanar_neighbors(spec), spring_copy(spec), access(wp.int32).get
    code_of, triangle_of = mesh_entry(spec).code, mesh_entry(spec).triangle

    @wp.func
    def source_of(
        params: Params, walls: Walls, particles: Particles, first: wp.int32, last: wp.int32, e: wp.int32
    ):  # fmt: skip
        for m in range(first, last, wp.static(spec.list_slice)):
            if get_int(particles.neighbor, m) < 0:
                code = code_of(params, particles, m)
                if code >= 0:
                    if coplanar(params, walls, triangle_of(code), e):
                        return m
        return wp.int32(-1)

    @wp.func
    def copy_all(
        params: Params, walls: Walls, particles: Particles, launch: wp.int32, i: wp.int32, x: wide3,
        radius: wide, first: wp.int32, last: wp.int32, end: wp.int32,
    ):  # fmt: skip
        for at in range(first, end, wp.static(spec.list_slice)):
            k = get_int(particles.mesh_near, at)
            if get_int(particles.mesh_leader, k) == k and get_int(particles.neighbor, k) >= 0:
                e = triangle_of(code_of(params, particles, k))
                source = source_of(params, walls, particles, first, last, e)
                if source >= 0:
                    copy(particles, source, k)

    return copy_all
