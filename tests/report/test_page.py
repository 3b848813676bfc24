"""Rules for every report page: links of the contents have targets, tables have headings, pictures have texts, colours
have contrast, and nothing is loaded from the network.
"""

import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from rover_pin.discrepancy.answer import Answer
from rover_pin.report import page as page_module
from rover_pin.report.drive.report import write_report
from rover_pin.report.experiment import panel
from rover_pin.report.page import mark_code
from rover_pin.report.words import key

CSS, ZOOM = ((Path(page_module.__file__).parent / name).read_text(encoding="utf-8") for name in ("page.css", "zoom.js"))


class Seen(HTMLParser):
    """A parser that collects the tags of a page with their attributes, and the texts of its headings."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.headings, self._inside = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._inside = tag if tag in ("h1", "h2", "h3") else self._inside
        if tag in ("h1", "h2", "h3"):
            self.headings.append("")

    def handle_endtag(self, tag):
        self._inside = "" if tag == self._inside else self._inside

    def handle_data(self, data):
        if self._inside:
            self.headings[-1] += data

    def all(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


@pytest.fixture(
    scope="module", params=[Answer.NAMED, Answer.NONE_FITS, Answer.CANNOT_TELL], ids=lambda first: first.name
)
def page(request, sag_fits, answered, tmp_path_factory):
    out = tmp_path_factory.mktemp("page")
    files = write_report(answered(request.param), sag_fits[0], out)
    return files[0].read_text(encoding="utf-8"), files, out


def without_scene(text):
    """Return a page without its 3D scene, because the scene is a page of its own."""
    return re.sub(r'data-page="[^"]*"', "", text)


def test_contents_lead_to_every_section(page):
    page_seen = Seen(without_scene(page[0]))
    ids = [attrs["id"] for attrs in page_seen.all("section")]
    links = [attrs["href"] for attrs in page_seen.all("a") if attrs["href"].startswith("#")]
    assert [f"#{anchor}" for anchor in ids[1:]] == [anchor for anchor in dict.fromkeys(links) if anchor[1:] in ids[1:]]
    assert {anchor[1:] for anchor in links} <= set(ids)
    assert len(page_seen.all("nav")) == 1


def test_ids_are_there_once(page):
    ids = [attrs["id"] for _, attrs in Seen(without_scene(page[0])).tags if "id" in attrs]
    assert len(ids) == len(set(ids))


def test_every_table_has_headed_columns_and_rows(page):
    text = without_scene(page[0])
    for table in re.findall(r"<table>.*?</table>", text, re.DOTALL):
        page_seen = Seen(table)
        scopes = [attrs.get("scope") for attrs in page_seen.all("th")]
        assert set(scopes) == {"col", "row"}
        assert scopes.count("row") == len(re.findall(r"<tr", table)) - 1
        assert all("data-head" in attrs for attrs in Seen(table[table.index("<tbody") :]).all("td"))


def test_every_picture_states_its_result(page):
    observed = Seen(without_scene(page[0]))
    pictures = [attrs for attrs in observed.all("svg") if "role" in attrs]
    assert all(len(attrs["aria-label"]) > 25 for attrs in pictures)
    assert not observed.all("img")
    picture_files = [file for file in page[1] if file.suffix == ".png"]
    assert len(picture_files) == len(pictures)
    assert sorted(file.name for file in page[2].iterdir()) == sorted(file.name for file in page[1])


def test_nothing_comes_from_outside(page):
    text = without_scene(page[0])
    assert not re.findall(r'(?:src|href)="(?!#|data:)[^"]*"', text)
    assert re.findall(r"<script[^>]*>\s*(.*)", text) == [ZOOM.partition("\n")[0]]
    assert "@import" not in text
    assert not re.findall(r"url\((?!#)", text)


def test_the_first_heading_is_the_sentence_and_none_is_skipped(page):
    text = without_scene(page[0])
    levels = [int(level) for level in re.findall(r"<h([1-6])", text)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(later - before <= 1 for before, later in zip(levels, levels[1:], strict=False))
    assert Seen(text).headings[0].endswith(".")


def luminance(colour):
    """Return the relative luminance of a colour, as defined in WCAG 2.1."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(first, second):
    bright, dark = sorted((luminance(first), luminance(second)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_has_the_contrast_of_level_aa(scheme):
    blocks = re.findall(r":root \{(.*?)\}", CSS, re.DOTALL)
    colours = dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", blocks[scheme == "dark"]))
    for paper in ("paper", "box", "warn", "code"):
        for ink in ("ink", "soft", "after", "before"):
            assert contrast(colours[ink], colours[paper]) >= 4.5, f"{ink} on {paper}"
    for mark in ("before", "after", "grey"):
        assert contrast(colours[mark], colours["paper"]) >= 3.0  # what pictures are drawn with, 1.4.11


def test_docstrings_show_their_code_and_no_tags():
    assert mark_code("see `a < b` <i>") == "see <code>a &lt; b</code> &lt;i&gt;"


def test_the_legend_of_a_picture_fits_next_to_its_panel():
    """Two or three long names in a legend must not extend beyond the picture."""
    points = np.array([[1.0], [2.0]])
    bed = SimpleNamespace(channels=("pull",), observed=points, unit=lambda name: "N")
    fitted, added = (
        SimpleNamespace(predicted=points),
        "ploughing, slip-softening, excavation by lugs and rate-dependence",
    )
    sides = [(fitted, "k", "_", "base model, fitted"), (fitted, "k", "x", key(added))]
    figure = panel(bed, 0, sides, ("slip", points))
    FigureCanvasAgg(figure).draw()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
