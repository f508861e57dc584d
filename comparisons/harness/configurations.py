"""Solver configurations: a code with its options, under the name that checks, tables and legends show."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

from comparisons.harness import codes
from comparisons.harness.case import Results, Variant
from gpudem.output.run import Run
from gpudem.scene import Scene


@dataclasses.dataclass(frozen=True)
class Configuration:
    """One code with one set of options."""

    title: str
    """Name to show: "gpudem mixed"."""
    code: str = "gpudem"
    options: dict[str, Any] = dataclasses.field(default_factory=dict)
    """Keyword arguments of the code's run function."""
    label: str = ""
    """Appended to the label of a variant; empty: it runs the variant that all codes run."""
    color: str = ""
    """Color in figures; empty: that of the code."""
    mark: str = "o"

    def key(self, variant: str) -> tuple[str, str]:
        """(label, code) under which the results of a variant hold its run."""
        return (f"{variant}-{self.label}" if self.label else variant), self.code

    def run(self, results: Results, variant: str) -> Run:
        """Its run of a variant. Raises what `Results` raises where there is none."""
        return results[self.key(variant)]

    def line(self, **changes: Any) -> dict[str, Any]:
        """Arguments of matplotlib's `plot` for a curve: gpudem's are full, those of other codes dashed."""
        from comparisons.report import plots

        dash = "-" if self.code == "gpudem" else "--"
        color = self.color or plots.color(self.code)
        return {"color": color, "linestyle": dash, "label": self.title, **changes}


class Configurations:
    """gpudem in several configurations, and each other code that advances a scene step by step, as it is.

    The first configuration of gpudem runs the same variant as the other codes; each further one has a variant
    of its own.
    """

    def __init__(self, *own: Configuration, timed_on: int | None = None, brought: bool = True):
        """`timed_on`: the runs are timed, on so many cores; no earlier output stands in for them. `brought`:
        whether codes that a user brings are among them.
        """
        self.own, self.timed_on, self.brought = own, timed_on, brought

    def of(self, code: str) -> tuple[Configuration, ...]:
        """The configurations of a code; none if it is not among them."""
        if codes.brought(code) and not self.brought:
            return ()
        return self.own if code == "gpudem" else (Configuration(codes.title(code), code),)

    def among(self, selected: Iterable[str]) -> list[Configuration]:
        """The configurations of several codes, gpudem's first: of `results.codes()`, those that ran."""
        chosen = codes.stepped([name for name in codes.CODES if name in set(selected)])
        return [configuration for code in chosen for configuration in self.of(code)]

    def variants(
        self, label: str, scene: Scene, own: Iterable[Configuration] | None = None, **more: Any
    ) -> list[Variant]:
        """The variants of a scene: one for all codes, one for each further configuration of gpudem.

        Args:
            label: Label of the first; the others append their configuration's.
            scene: The scene of all.
            own: Configurations of gpudem that run it; default: all. The first of all must be among them.
            more: Further fields of `Variant`.
        """
        first, *further = self.own if own is None else own
        if first.label:
            raise ValueError(f"configuration {first.title!r} does not run the variant of all codes")

        def options(one: Configuration) -> dict[str, Any]:
            timed = {} if self.timed_on is None else codes.CODES[one.code].on_cores(self.timed_on)
            return {**timed, **one.options}

        asked = [code for code in codes.stepped(tuple(codes.CODES)) if self.of(code)]
        shared = {code: options(self.of(code)[0]) for code in asked}
        if not self.brought:
            more = {"codes": tuple(asked), **more}
        made = Variant(label, scene, options=shared, timed=self.timed_on is not None, **more)
        return [made] + [
            dataclasses.replace(
                made, label=one.key(label)[0], codes=(one.code,), options={one.code: options(one)}
            )
            for one in further
        ]


def precisions() -> tuple[Configuration, ...]:
    """The configurations of gpudem in float64, mixed and float32."""
    from comparisons.report.plots import SERIES

    looks = {
        "float64": ("", SERIES[0], "s"),
        "mixed": ("mixed", SERIES[2], "^"),
        "float32": ("float32", SERIES[3], "v"),
    }
    return tuple(
        Configuration(f"gpudem {precision}", "gpudem", {"precision": precision}, *look)
        for precision, look in looks.items()
    )
