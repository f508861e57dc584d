"""Numbers as a reader wants them."""

from __future__ import annotations

import math

#: Typographic signs.
DASH, MINUS = "\u2013", "\u2212"


def number(x: float | None, digits: int = 4) -> str:
    """A number for a reader: so many digits, powers of ten as such; a dash for none."""
    if x is None:
        return DASH
    if math.isnan(x):
        return "NaN"
    if math.isinf(x):
        return "∞" if x > 0 else MINUS + "∞"
    text = f"{x:.{digits}g}"
    if "e" in text:
        factor, exponent = text.split("e")
        power = "".join("⁰¹²³⁴⁵⁶⁷⁸⁹"[int(d)] if d.isdigit() else "⁻" for d in str(int(exponent)))
        return f"10{power}" if factor == "1" else f"{factor}·10{power}".replace("-", MINUS)
    return text.replace("-", MINUS)
