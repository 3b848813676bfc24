"""Figures as SVG within a page: its own colours follow the page's, in the light and in the dark."""

import io
import re

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

DPI = 130
BEFORE, AFTER, GREY = "#b3541e", "#1f6f8b", "#8a8a8a"
"""Colours of the model before and after, and of what is neither; the first two differ for the colour-blind too."""
NOISE = "#d9c9a5"
INKS = {BEFORE: "var(--before)", AFTER: "var(--after)", GREY: "var(--grey)", NOISE: "var(--noise)",
        "#000000": "currentColor", "#262626": "currentColor", "#b0b0b0": "var(--line)"}  # fmt: skip
"""Colours of figures that the page decides; matplotlib writes no fill for black."""
PIXELS = 96 / 72
"""Of a page for one point of a figure."""


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG file."""
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def svg(figure: Figure, name: str, alt: str) -> str:
    """Return a figure as an SVG element that has no background; `name` keeps its ids apart from other figures'.

    Where its parts lie is decided here once, and stays: a file of the same figure shows what the page shows.
    """
    FigureCanvasSVG(figure)
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    figure.set_layout_engine("none")
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"(\bid=\"|href=\"#|url\(#)", rf"\g<1>{name}-", text)
    for colour, ink in INKS.items():
        text = text.replace(colour, ink)
    width = float(figure.get_figwidth()) * 72 * PIXELS
    head = f'<svg role="img" aria-label="{_escape_text(alt)}" style="width:{width:.0f}px" class="figure"'
    text = re.sub(r'<svg ([^>]*?)width="[^"]*"', r"<svg \1", text, count=1)
    text = re.sub(r'<svg ([^>]*?)height="[^"]*"', r"<svg \1", text, count=1)
    return text.replace("<svg", head, 1)


def _escape_text(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
