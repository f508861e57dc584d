"""Equations as MathML, which browsers draw themselves: no script, no font, no network."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert
from sphinx.application import Sphinx


def inline(translator: Any, node: Any) -> None:
    """An equation within a line."""
    translator.body.append(mathml(node.astext(), "inline"))
    raise _skip()


def block(translator: Any, node: Any) -> None:
    """An equation in a line of its own, with its label if it has one."""
    label = f' id="equation-{node["label"]}"' if node.get("label") else ""
    translator.body.append(f'<div class="math"{label}>{mathml(node.astext(), "block")}</div>')
    raise _skip()


def mathml(text: str, display: str) -> str:
    """LaTeX as MathML; bold letters are characters of their own, since browsers ignore `mathvariant`."""
    return re.sub(
        r'<mi mathvariant="bold(?:-italic)?">(.|&#x[0-9A-F]+;)</mi>', _bold, convert(text, display=display)
    )


def _bold(match: re.Match[str]) -> str:
    letter = html.unescape(match[1])
    for first, bold in (("a", 0x1D41A), ("A", 0x1D400), ("\u03b1", 0x1D6C2)):
        if 0 <= ord(letter) - ord(first) < 26:
            return f'<mi mathvariant="normal">{chr(bold + ord(letter) - ord(first))}</mi>'
    return match[0]


def _skip() -> Exception:
    from docutils import nodes

    return nodes.SkipNode()


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True}
