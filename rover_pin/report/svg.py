"""Convert matplotlib figures to SVG elements, whose colours follow the page's light or dark style, and to PNG files."""

import io
import re

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from rover_pin.base.encode import html_text, missing_glyphs_allowed

DPI = 130
"""Resolution of a PNG file [dots per inch]. It is higher than the 96 dots of a page, so that the file remains sharp if
it is enlarged in slides."""
BEFORE, AFTER, GREY = "#b3541e", "#1f6f8b", "#8a8a8a"
"""Colours of the base model, of the model with added effects, and of everything else. Colour-blind readers can
distinguish the first two colours."""
NOISE = "#d9c9a5"
"""Colour of the band that shows the noise."""
INKS = {BEFORE: "var(--before)", AFTER: "var(--after)", GREY: "var(--grey)", NOISE: "var(--noise)",
        "#000000": "currentColor", "#262626": "currentColor", "#b0b0b0": "var(--line)"}  # fmt: skip
"""Colour in a figure -> variable of the page's style sheet that replaces it. Matplotlib writes no fill colour for
black, so the style sheet sets this colour itself."""
PIXELS = 96 / 72
"""Number of pixels on the page for each point (1/72 inch) of a figure."""


def png(figure: Figure) -> bytes:
    """Return the bytes of a PNG file that shows a figure."""
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    with missing_glyphs_allowed():
        figure.savefig(buffer, format="png", dpi=DPI)
    return buffer.getvalue()


def svg(figure: Figure, name: str, alt: str) -> str:
    """Return a figure as an SVG element of an HTML page, without a background.

    The layout of the figure is computed once and then fixed, so that a PNG of this figure looks like the page.

    Parameters
    ----------
    figure : Figure
        The figure; its layout engine is removed.
    name : str
        Prefix of all ids in the element, because two figures of one page must not share an id.
    alt : str
        Content of the figure in words, for a screen reader.
    """
    FigureCanvasSVG(figure)
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}), missing_glyphs_allowed():
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    figure.set_layout_engine("none")
    # A page needs only the element: the XML header, the metadata and the size in points are removed.
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # Ids and all references to them get the prefix.
    text = re.sub(r"(\bid=\"|href=\"#|url\(#)", rf"\g<1>{name}-", text)
    # Colours become variables of the style sheet, which differ between the light and the dark style.
    for colour, ink in INKS.items():
        text = text.replace(colour, ink)
    width = float(figure.get_figwidth()) * 72 * PIXELS
    head = f'<svg role="img" aria-label="{html_text(alt)}" style="width:{width:.0f}px" class="figure"'
    text = re.sub(r'<svg ([^>]*?)width="[^"]*"', r"<svg \1", text, count=1)
    text = re.sub(r'<svg ([^>]*?)height="[^"]*"', r"<svg \1", text, count=1)
    return text.replace("<svg", head, 1)
