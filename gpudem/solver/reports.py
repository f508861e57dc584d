# pyright: reportArgumentType=false, reportInvalidTypeForm=false, reportOperatorIssue=false
"""What a rebuild reports of a particle: one number, the smallest of a block of particles stays."""

import warp as wp

#: Places for the reports of a rebuild: one block of particles writes to one place.
SLOTS = wp.constant(64)
#: What a report says of a particle; its partner is a row of the scene or a wall.
OK, LOST, NOT_A_NUMBER, TOO_FAST, TOO_DEEP, DEEP_IN_WALL = 0, 1, 2, 3, 4, 5
#: A report that says nothing.
NO_REPORT = (1 << 63) - 1


def unpack_report(report: int) -> tuple[int, int, int]:
    """(what, particle, partner) of a report: the particle in the upper 31 bits, then 3 bits, then 29 bits."""
    return (report >> 29) & 7, report >> 32, report & ((1 << 29) - 1)


@wp.func
def write_report(
    status: wp.array[wp.int64], slot: wp.int32, what: wp.int32, particle: wp.int32, partner: wp.int32
):
    """One number, so that its parts come from one thread; the smallest stays: the first particle."""
    head = (wp.int64(particle) << wp.int64(32)) | (wp.int64(what) << wp.int64(29))
    wp.atomic_min(status, slot % SLOTS, head | wp.int64(partner))
