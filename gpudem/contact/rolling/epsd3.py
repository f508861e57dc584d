"""As `epsd`, with a factor of the rolling stiffness that is stated (LIGGGHTS `epsd3`)."""

from gpudem.contact.law import LiggghtsWords, PairInputs, Parameter
from gpudem.contact.rolling.epsd import FRICTION_WORDS, VISCOUS, Epsd, epsd_torque

STIFFNESS = Parameter("rolling_stiffness", "1", 0, open_lo=True)


class Epsd3(Epsd):
    """Rolling friction, viscous damping and factor of the rolling stiffness of the pair."""

    name = "epsd3"
    parameters = (VISCOUS, STIFFNESS)
    liggghts = LiggghtsWords(
        "epsd3", (*FRICTION_WORDS, ("common", "rollingStiffness", STIFFNESS.or_zero, 1.0))
    )

    def stiffness_factor(self, inputs: PairInputs) -> float:
        """As stated by the pair."""
        return STIFFNESS.or_zero(inputs.pair)


LAW = Epsd3(epsd_torque(False), epsd_torque(True))
