"""Matplotlib figures as small SVG that stand in one HTML page with others: text as text, ids of their own."""

from __future__ import annotations

import base64
import io
import re
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Artists with more points than this are drawn as pixels: an SVG path of 100 000 points stops a browser.
DENSE = 4000
DPI = 150
#: A figure wider than this [CSS pixels] takes a row of the page alone.
WIDE = 640
NAMESPACES = 'xmlns:xlink="http://www.w3.org/1999/xlink" xmlns="http://www.w3.org/2000/svg"'


def of(figure: Figure, prefix: str) -> str:
    """The figure as an <svg> element, its ids prefixed; the figure is closed."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    _rasterise_dense(figure)
    text = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": prefix, "path.simplify": True}):
        figure.savefig(
            text,
            format="svg",
            dpi=DPI,
            bbox_inches="tight",
            pad_inches=0.03,
            metadata={"Date": None, "Creator": None},
        )
    plt.close(figure)
    return clean(text.getvalue(), re.sub(r"[^A-Za-z0-9]+", "-", prefix))


def clean(svg: str, prefix: str) -> str:
    """Only the <svg> element; unused ids dropped, the others prefixed; pictures made small."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.S)
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', svg))

    def keep(match: re.Match) -> str:
        return f' id="{prefix}-{match[1]}"' if match[1] in used else ""

    svg = re.sub(r'\sid="([^"]+)"', keep, svg)
    svg = re.sub(r'(url\(#|href="#)', rf"\g<1>{prefix}-", svg)
    svg = re.sub(r'href="data:image/png;base64,([^"]+)"', _smaller, svg)
    svg = re.sub(
        r"\s*image-rendering:\s*[a-z-]+;?", "", svg
    )  # a browser that scales a picture should smooth it
    svg = re.sub(r"\n\s+", "\n", svg)
    match = re.search(r'<svg [^>]*?width="([\d.]+)pt"[^>]*?viewBox="([^"]+)"[^>]*>', svg)
    if match is None:
        raise ValueError("an SVG without width and viewBox")
    # The page scales a figure to its column; the natural width keeps it from growing beyond.
    width = float(match[1]) * 4 / 3
    kind = "plot wide" if width > WIDE else "plot"
    head = f'<svg viewBox="{match[2]}" class="{kind}" style="--w:{width:.0f}px" role="img" {NAMESPACES}>'
    return re.sub(r"[ \t]+\n", "\n", svg.replace(match[0], head, 1))


def _rasterise_dense(figure: Figure) -> None:
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D

    for line in figure.findobj(Line2D):
        if np.size(line.get_xdata(orig=False)) > DENSE:
            line.set_rasterized(True)
    for many in figure.findobj(Collection):
        if (
            max(
                len(np.atleast_1d(many.get_offsets())),
                sum(np.size(p.vertices) // 2 for p in many.get_paths()),
            )
            > DENSE
        ):
            many.set_rasterized(True)


def _smaller(match: re.Match) -> str:
    """An embedded PNG with a palette of 256 colours: a quarter of the bytes, no visible loss."""
    from PIL import Image

    raw = base64.b64decode(match[1])
    picture, out = Image.open(io.BytesIO(raw)), io.BytesIO()
    picture.convert("RGBA").quantize(256, method=Image.Quantize.FASTOCTREE).save(out, "png", optimize=True)
    small = out.getvalue() if len(out.getvalue()) < len(raw) else raw
    return f'href="data:image/png;base64,{base64.b64encode(small).decode()}"'
