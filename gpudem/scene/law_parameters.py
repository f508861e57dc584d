"""The keys that contact laws add to `[[pairs]]` and `[contact]`: known to a law, and in range."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpudem.contact import registry
from gpudem.contact.law import Parameter
from gpudem.scene.files import nearest
from gpudem.scene.laws import stated_laws
from gpudem.scene.types import Model, number

if TYPE_CHECKING:
    from gpudem.scene.model import Scene


def problems(scene: Scene) -> list[str]:
    """Unknown keys, values out of range, and missing parameters of `[contact]` that a law needs."""
    own = [
        stated_laws(scene, wall) for wall in getattr(scene, "walls", ())
    ]  # where walls are not valid: none
    laws = list(dict.fromkeys(law for names in [stated_laws(scene), *own] for law in names.laws))
    declared = [parameter for law in laws for parameter in law.parameters]
    found = _section("contact", scene.contact, [p for p in declared if p.where == "contact"])
    for i, pair in enumerate(scene.pairs):
        found += _section(f"pairs[{i}]", pair, [p for p in declared if p.where == "pair"])
    for k, phase in enumerate(getattr(scene, "phases", ())):
        for i, change in enumerate(phase.pairs):
            key = f"phases[{k}].pairs[{i}]"
            found += _section(key, change, [p for p in declared if p.where == "pair"])
    for law in laws:
        for parameter in law.parameters:
            stated = scene.contact.model_extra or {}
            if parameter.where == "contact" and parameter.default is None and parameter.name not in stated:
                found.append(f"contact.{parameter.name}: missing; {law.name} needs it [{parameter.unit}]")
    return found


def _laws_with(name: str, where: str) -> str:
    """The laws that read a parameter in this section, as `contact.SLOT = 'LAW'`; empty: none."""
    laws = [
        registry.law(slot, law) for slot in registry.SLOTS for law in registry.names(slot) if law != "off"
    ]
    found = [law for law in laws if (name, where) in [(p.name, p.where) for p in law.parameters]]
    return " or ".join(f"contact.{law.slot} = {law.name!r}" for law in found)


def _section(key: str, section: Model, declared: list[Parameter]) -> list[str]:
    found, known = [], {p.name: p for p in declared}
    for name, value in (section.model_extra or {}).items():
        if name not in known:
            others = _laws_with(name, "contact" if key == "contact" else "pair")
            why = f"unknown key{nearest(name, [*type(section).model_fields, *known])}"
            found.append(f"{key}.{name}: {f'read only with {others}' if others else why}")
            continue
        p = known[name]
        try:
            number(p.unit, p.lo, p.hi, p.open_lo).check(value)
        except ValueError as error:
            found.append(f"{key}.{name} = {value!r}: {error}")
    return found
