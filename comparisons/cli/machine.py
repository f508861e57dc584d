"""`gpudem info`: what this machine offers."""

from __future__ import annotations

import click

from comparisons.harness import provenance
from comparisons.report import render
from gpudem.errors import GpudemError

PACKAGES = (
    "gpudem",
    "warp-lang",
    "numpy",
    "pandas",
    "pyvista",
    "vtk",
    "meshio",
    "matplotlib",
    "Jinja2",
    "pytest",
)


def show() -> int:
    """Print versions, hardware, the LIGGGHTS binary and whether pictures can be rendered."""
    facts = provenance.collect()
    hardware = facts["hardware"]
    rows = [
        ("commit", facts["commit"] + (" with uncommitted changes" if facts["dirty"] else "")),
        ("system", f"{facts['os']}, Python {facts['python']}"),
        ("processor", f"{hardware['cpu']}, {hardware['cores']} cores, {hardware['memory_gib']} GiB"),
        ("gpu", ", ".join(hardware["gpus"]) or "none; device cpu only"),
        ("LIGGGHTS", liggghts()),
        ("rendering", render.backend()),
        *((name, facts["packages"].get(name, "not installed")) for name in PACKAGES),
    ]
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        click.echo(f"{name:{width}}  {value}")
    return 0


def liggghts() -> str:
    """Path and version of the LIGGGHTS binary, or how to get it."""
    from reference.liggghts import binary

    try:
        path = binary.find_liggghts()
    except GpudemError as error:
        return str(error)
    return f"{path} ({binary.version(path) or 'version unknown'})"
