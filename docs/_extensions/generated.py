"""Pages made from the code when the documentation is built, so that they cannot go stale.

In generated/: scene.md from the pydantic models, laws.md and observables.md from the registries,
verification/*.md from the cases and their recorded results, walls/*.svg from the examples of the guide.
"""

from __future__ import annotations

import math
import re
import types
import typing
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for its sources."""
    app.connect("config-inited", lambda app, config: write(Path(app.srcdir) / "generated"))
    return {"parallel_read_safe": True}


def write(folder: Path) -> None:
    """All generated pages; a page whose text has not changed is left alone."""
    import insertion_pictures  # beside this file
    import motion_pictures
    import wall_pictures

    pages = {"scene": scene_page(), "laws": laws_page(), "observables": observables_page()}
    pages |= {f"verification/{name}": text for name, text in verification_pages().items()}
    files = {f"{name}.md": text for name, text in pages.items()}
    drawn = wall_pictures.pictures(folder.parent / "guide" / "walls.md")
    files |= {f"walls/{kind}.svg": text for kind, text in drawn.items()}
    files["motions.svg"] = motion_pictures.picture()
    files["insertions.svg"] = insertion_pictures.picture()
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text() != text:
            path.write_text(text)


def table(header: list[str], rows: list[list[str]]) -> str:
    """A Markdown table; `|` and line breaks of a cell are escaped."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines) + "\n"


def _cell(text: str) -> str:
    return re.sub(r"\s+", " ", text).replace("|", "\\|").strip()


def code(text: str) -> str:
    """Text between backticks."""
    return f"`{text}`"


# -- the scene -----------------------------------------------------------------------------------------------


def scene_page() -> str:
    """Every key of a scene file: type, unit, range, default, meaning."""
    from gpudem.scene import (
        distributions,
        groups,
        insertion,
        mesh,
        motion,
        phases,
        regions,
        removal,
        sections,
        sources,
        wall_kinds,
        wall_phases,
        walls,
    )
    from gpudem.scene.model import Scene

    parts = {
        "Top level": Scene,
        "[materials.NAME]": sections.Material,
        "[[pairs]]": sections.Pair,
        "[contact]": sections.Contact,
        '[particles] with source = "explicit"': sections.Explicit,
        '[particles] with source = "file"': sections.FromFile,
        '[particles] with source = "lattice"': sections.Lattice,
        "Mixture of radii": sections.RadiusShare,
        **{f'[[insert]] with kind = "{kind}"': section for kind, section in insertion.INSERTIONS.items()},
        "Part of a mixture": sources.Part,
        **{f'Region with kind = "{kind}"': section for kind, section in regions.REGIONS.items()},
        **{f'Face with kind = "{kind}"': section for kind, section in regions.FACES.items()},
        **{
            f'Distribution of radii with kind = "{kind}"': section
            for kind, section in distributions.DISTRIBUTIONS.items()
        },
        "[[remove]]": removal.Remove,
        "[[groups]]": groups.Group,
        "[[phases]]": phases.Phase,
        "[[phases.pairs]]": phases.PairChange,
        "[[phases.walls]]": wall_phases.WallChange,
        **{f'[[walls]] with kind = "{kind}"': section for kind, section in wall_kinds.BUILT_IN.items()},
        "Vibration of a plane": walls.Vibration,
        "The turn of a mesh into its place": mesh.Placement,
        "A wall's own contact law": walls.WallContact,
        '[[walls.motion]] with type = "linear"': motion.Linear,
        '[[walls.motion]] with type = "oscillate"': motion.Oscillate,
        '[[walls.motion]] with type = "rotate"': motion.Rotate,
        '[[walls.motion]] with type = "swing"': motion.Swing,
        '[[walls.motion]] with type = "servo"': motion.Servo,
        '[[walls.motion]] with type = "table", of velocities': motion.TranslationTable,
        '[[walls.motion]] with type = "table", of angular velocities': motion.TurnTable,
        "[domain]": sections.Domain,
        "[time]": sections.Time,
        "[output]": sections.Output,
        "[[output.flow]]": sections.FlowPlane,
        "[solver]": sections.Solver,
    }
    text = [
        "# Scene reference\n",
        "Every key of a scene file, from the models that validate it. All numbers are in SI units. The same"
        " names are the arguments of the classes of `gpudem.scene`.\n",
    ]
    for title, model in parts.items():
        rows = [_field(name, info) for name, info in model.model_fields.items()]
        text += [f"## {title}\n", f"{first_paragraph(model.__doc__)}\n", table(COLUMNS, rows)]
    return "\n".join(text)


COLUMNS = ["key", "type", "unit", "allowed", "default", "meaning"]


def _field(name: str, info: Any) -> list[str]:
    unit, allowed = _unit_and_range(info)
    default = "required" if info.is_required() else _value(info.get_default(call_default_factory=True))
    return [code(name), _type(info.annotation), unit, allowed, default, info.description or ""]


def _unit_and_range(info: Any) -> tuple[str, str]:
    """Of the validator in a field's metadata, also within `X | None` and `Annotated`."""
    from gpudem.scene.types import array, each, indices, number, span, vector

    for item in [*info.metadata, *_metadata(info.annotation)]:
        if isinstance(item, each):
            return item.unit, item.of.span
        if isinstance(item, number):
            return item.unit, item.span
        if isinstance(item, vector):
            return item.unit, "not all zero" if item.nonzero else "finite"
        if isinstance(item, indices):
            return "1", f"from 0, shape (n, {item.columns})"
        if isinstance(item, span):
            return item.unit, "0 <= from < until"
        if isinstance(item, array):
            return item.unit, f"shape (n, {item.columns})" if item.columns else "shape (n,)"
    choices = [c for c in _choices(info.annotation) if isinstance(c, str)]
    return "", ", ".join(map(code, choices))


def _metadata(annotation: Any) -> list[Any]:
    found = list(getattr(annotation, "__metadata__", ()))
    for inner in typing.get_args(annotation):
        found += _metadata(inner)
    return found


def _choices(annotation: Any) -> list[Any]:
    if typing.get_origin(annotation) is typing.Literal:
        return list(typing.get_args(annotation))
    return [c for inner in typing.get_args(annotation) for c in _choices(inner)]


def _type(annotation: Any) -> str:
    """A type as a user of TOML reads it."""
    words = {float: "number", int: "integer", str: "text", bool: "true or false", type(None): ""}
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in words:
        return words[annotation]
    if origin is typing.Annotated:
        return _type(arguments[0])
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(filter(None, map(_type, arguments))))
    if origin is typing.Literal:
        return "text"
    if origin is tuple and len(arguments) == 3 and set(map(_type, arguments)) == {"number"}:
        return "three numbers"
    if origin is tuple and arguments[-1] is not Ellipsis:
        return f"{len(arguments)} x {_type(arguments[0])}"
    if origin in (tuple, list):
        return f"list of {_type(arguments[0])}"
    if origin is dict:
        return "table"
    return {"ndarray": "list of numbers"}.get(getattr(annotation, "__name__", ""), "table")


def _value(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return code(str(value).lower())
    if isinstance(value, str | int | float | list | tuple):
        return code(repr(list(value) if isinstance(value, tuple) else value).replace("'", '"'))
    return "its defaults"


def first_paragraph(text: str | None) -> str:
    """The first paragraph of a docstring, in one line."""
    return re.sub(r"\s+", " ", (text or "").strip().split("\n\n")[0])


# -- laws and observables ------------------------------------------------------------------------------------


def laws_page() -> str:
    """Every contact law by slot: what it reads, its word in a LIGGGHTS deck, its docstring."""
    from gpudem.contact import registry

    text = ["# Contact laws by name\n", "From the registry that the scene asks.\n"]
    for slot in registry.SLOTS:
        text.append(f"## {slot}\n")
        for name in registry.names(slot):
            law = registry.find(slot, name)
            if law is None:
                continue
            word = law.liggghts.word if law.liggghts else None
            reads = ", ".join(map(code, law.reads)) or "none"
            further = "".join(f" Further key of `[[pairs]]`: {_parameter(p)}." for p in law.parameters)
            text += [
                f"### `{name}`\n",
                f"Keys that act: {reads}.{further} LIGGGHTS: {code(word) if word else 'none'}.\n",
                f"```text\n{_docstring(law)}\n```\n",
            ]
    return "\n".join(text)


def _parameter(p: Any) -> str:
    """A parameter of a law: name, unit, default."""
    default = "must be stated" if p.default is None else f"default {p.default:g}"
    return f"{code(p.name)} [{p.unit}], {default}"


def _docstring(law: Any) -> str:
    """The docstring of a law's device function, which holds the formula and its source."""
    import inspect

    function = next(
        f for name, f in vars(law).items() if name in ("stiffness", "force", "torque", "attraction")
    )
    return inspect.cleandoc(function.func.__doc__ or "")


def observables_page() -> str:
    """Every observable of a history."""
    from gpudem.output import observables

    rows = []
    for name in observables.names():
        item = observables.find(name)
        assert item is not None
        rows.append([code(name), item.unit, item.description])
    intro = "Names for `output.history`; `step` and `time` [s] stand in every history.\n"
    return "\n".join(["# Observables\n", intro, table(["name", "unit", "what it is"], rows)])


# -- verification --------------------------------------------------------------------------------------------


def verification_pages() -> dict[str, str]:
    """An index and a page for each case, with its checks and its recorded results."""
    from comparisons.harness.case import TIERS
    from comparisons.harness.discover import find_cases

    cases = find_cases()
    rows = [
        [f"[{c.title}](#case-{c.name})", code(c.name)]
        + [str(len(c.checks_of(tier))) if tier in c.tiers else "" for tier in TIERS]
        for c in cases
    ]
    index = [
        "# Cases\n",
        "What is compared, with what, how closely and why. The numbers are those of the checks in each tier:"
        " `quick` is part of the test suite, `standard` is what `make verify` runs, `full` takes hours and is"
        " kept as a record.\n",
        table(["case", "name", *TIERS], rows),
        "```{toctree}\n:hidden:\n",
        *(c.name for c in cases),
        "```\n",
    ]
    return {"index": "\n".join(index)} | {c.name: case_page(c) for c in cases}


def case_page(case: Any) -> str:
    """Purpose, source, checks, recorded results of one case."""
    from comparisons.harness import recorded_cases
    from comparisons.harness.case import TIERS

    text = [
        f"(case-{case.name})=\n# {case.title}\n",
        f"{case.purpose}\n",
        f"**Source:** {case.source}\n",
        f"Run it: `gpudem compare {case.name}`\n",
        "## Checks\n",
    ]
    checks = {check.name: check for tier in TIERS if tier in case.tiers for check in case.checks_of(tier)}
    for check in checks.values():
        text.append(
            f"**{check.name}**\n: {_allowed(check)}, against {check.against}. {sentence(check.reason)}"
            f" Would detect: {check.catches}.\n"
        )
    recorded = recorded_cases.find(case.name)
    if recorded is not None:
        text.append(_recorded(recorded))
    return "\n".join(text)


def _allowed(check: Any) -> str:
    unit = "" if check.unit in ("", "1") else f" {check.unit}"
    if check.lo is None:
        return f"at most {check.tolerance:g}{unit}"
    if math.isinf(check.tolerance):
        return f"at least {check.lo:g}{unit}"
    return f"{check.lo:g} to {check.tolerance:g}{unit}"


def _recorded(recorded: Any) -> str:
    facts = recorded.provenance
    where = f"{facts['date']}, commit `{facts['commit']}`, {facts['hardware']['cpu']}"
    rows = [
        [check.name, "holds" if check.status == "pass" else check.status.replace("_", " "),
         "" if check.value is None else f"{check.value:.3g}", check.allowed]
        for check in recorded.checks
    ]  # fmt: skip
    intro = f"## Recorded run of the {recorded.tier} tier\n\n{where}, {recorded.wall_s / 60:.0f} min.\n"
    return f"{intro}\n{table(['check', 'verdict', 'value', 'allowed'], rows)}"


def sentence(text: str) -> str:
    """A text with a capital letter first and a full stop last."""
    text = text.strip()
    if not text:
        return ""
    return text[0].upper() + text[1:] + ("" if text[-1] in ".!?" else ".")
