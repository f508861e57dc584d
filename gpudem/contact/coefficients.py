"""Material pair -> the constants that the laws of a scene read, in float64, from primary inputs."""

from __future__ import annotations

from collections.abc import Iterable

from gpudem.contact.law import Law, PairInputs


def coefficient_names(laws: Iterable[Law]) -> tuple[str, ...]:
    """Fields of the device struct `Pair` for these laws, in order of the slots."""
    return tuple(dict.fromkeys(name for law in laws for name in law.coefficients))


def pair_coefficients(laws: Iterable[Law], inputs: PairInputs) -> dict[str, float]:
    """Value of each of `coefficient_names`. Raises ValueError: an input that a law needs is missing."""
    values: dict[str, float] = {}
    for law in laws:
        values |= law.coefficients_of(inputs)
    contact = inputs.contact
    # mutate: frictionless_contact
    frictionless = values.get("friction") == 0 and not contact.frictionless_dashpot
    if "c_tangential" in values and (frictionless or not contact.tangential_damping):
        values["c_tangential"] = 0.0  # mutate: no_tangential_damping
    return values
