"""The laws of a contact by name: one for each slot."""

from __future__ import annotations

from typing import NamedTuple

from gpudem.contact import registry
from gpudem.contact.law import Law, NormalLaw, RollingLaw, TangentialLaw


class LawNames(NamedTuple):
    """One law for each slot; "off": an empty one."""

    normal: str
    tangential: str
    rolling: str
    cohesion: str = registry.OFF

    @property
    def laws(self) -> tuple[Law, ...]:
        """The laws themselves, in order of the slots."""
        found = (registry.find(slot, name) for slot, name in zip(registry.SLOTS, self, strict=True))
        return tuple(law for law in found if law is not None)

    @property
    def normal_law(self) -> NormalLaw:
        """The normal law."""
        return registry.law("normal", self.normal)

    @property
    def history(self) -> bool:
        """The tangential law stores a spring from step to step."""
        law = registry.find("tangential", self.tangential)
        return isinstance(law, TangentialLaw) and law.history

    @property
    def rolling_history(self) -> bool:
        """The rolling law stores a torque from step to step."""
        law = registry.find("rolling", self.rolling)
        return isinstance(law, RollingLaw) and law.history
