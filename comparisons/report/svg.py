"""Matplotlib figures as small SVG images: text as text, in the fonts of the page."""

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
#: As in style.css.
FONTS = "system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,'DejaVu Sans',sans-serif"


def of(figure: Figure) -> str:
    """The figure as an SVG document; the figure is closed."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    _rasterise_dense(figure)
    text = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "gpudem", "path.simplify": True}):
        figure.savefig(
            text,
            format="svg",
            dpi=DPI,
            bbox_inches="tight",
            pad_inches=0.03,
            metadata={"Date": None, "Creator": None},
        )
    plt.close(figure)
    return small(text.getvalue())


def small(svg: str) -> str:
    """The same picture in fewer bytes, its text in the fonts of the page (an image sees no style of it)."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.S)
    svg = re.sub(r'<g id="[^"]+"', "<g", svg)  # matplotlib refers to clip paths, markers and images alone
    svg = re.sub(r'href="data:image/png;base64,([^"]+)"', _smaller, svg)
    # a browser that scales a picture should smooth it
    svg = re.sub(r"\s*image-rendering:\s*[a-z-]+;?", "", svg)
    svg = re.sub(r"\s*\n\s*", "\n", svg)
    return re.sub(
        "(<svg[^>]*>)", rf"\1<style>text,tspan{{font-family:{FONTS}!important}}</style>", svg, count=1
    )


def size(svg: str) -> tuple[int, int]:
    """Natural width and height [CSS pixels]; those of a plain figure where the text does not state them."""
    box = re.search(r'<svg\b[^>]{0,1000}?viewBox="0 0 (\d{1,5})(?:\.\d+)? (\d{1,5})(?:\.\d+)?"', svg[:4000])
    if box is None:
        return WIDE, WIDE * 2 // 3
    width, height = (round(int(points) * 4 / 3) for points in box.groups())
    return width, height


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
