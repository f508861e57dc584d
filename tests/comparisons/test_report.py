import dataclasses
import re
import shutil
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import numpy as np
import pytest

from comparisons.cases.limits.stability import at_rest
from comparisons.harness import results, setup_table
from comparisons.harness.numbers import number
from comparisons.report import page as report
from comparisons.report import plots, render, svg
from comparisons.report import view as report_view
from tests.comparisons import fake


class Page(HTMLParser):
    """Collects ids, links and tags, and sees that elements are closed in order."""

    VOID = frozenset({"meta", "link", "br", "img", "input", "hr"})

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.sources, self.stack, self.tags = [], [], [], [], []
        self.attributes = set()
        self.feed(text)
        assert not self.stack

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.tags.append(tag)
        self.attributes |= set(values)
        self.ids += [values["id"]] if "id" in values else []
        self.links += [values["href"]] if "href" in values else []
        self.sources += [v for k, v in attributes if k in ("src", "href", "xlink:href", "action", "data")]
        if tag not in self.VOID:
            self.stack.append(tag)

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in self.VOID:
            self.stack.pop()


@pytest.fixture(scope="module")
def page(finished):
    return (finished[0] / "report.html").read_text()


def test_the_page_is_whole_and_asks_nobody(page):
    parsed = Page(page)
    assert not [s for s in parsed.sources if re.match(r"(https?:)?//", s)]
    assert not re.search(r"@import|url\((?!#|\"#|data:)", page)
    assert len(parsed.ids) == len(set(parsed.ids))
    assert {link[1:] for link in parsed.links if re.fullmatch(r"#[A-Za-z][\w-]*", link)} <= set(parsed.ids)


def test_files_of_runs_are_linked_and_there(page, finished):
    links = [x for x in Page(page).links if not x.startswith(("#", "data:"))]
    assert len(links) > 40
    assert {x.rsplit("/", 1)[-1] for x in links} >= {"deck.in", "scene.json", "run.pvd", "log.liggghts"}
    assert [x for x in links if not (finished[0] / x).is_file()] == []


def test_text_from_anywhere_is_escaped(page):
    assert "<script>alert" not in page
    assert "&lt;script&gt;alert(1)" in page
    assert "nobody &lt;b&gt;" in page
    assert "# &lt;deck&gt; of a fake" in page


def test_what_was_found_of_a_users_code_stands_at_the_top(finished):
    """Detects a finding over many cases that has to be looked for in each of them."""
    case, follows = finished[1].cases[0], "the contact law is followed"
    found = [follows] * 5 + ["the contact law differs (normal force)"] * 2
    found += ["what differs is not known: no contact", "what differs is not known: few digits"]
    cases = [
        dataclasses.replace(case, name=f"case_{k}", headline="gpudem: one", differs={"gpudem": what})
        for k, what in enumerate(found)
    ]
    comparison = dataclasses.replace(finished[1], cases=cases, checks=finished[1].checks[:4])
    assert report_view.own_codes(comparison) == [
        "gpudem: the contact law differs (normal force) in case_5 and case_6; the contact law is followed in"
        " 5 cases; what differs is not known in case_7 and case_8; all 4 checks hold."
    ]
    comparison = dataclasses.replace(comparison, checks=[])
    head = report.html(comparison, finished[0]).partition("</header>")[0]
    assert "differs (normal force) in case_5 and case_6" in head
    assert "gpudem: one" not in head
    scene = dataclasses.replace(cases[0], name="scene", headline="codes agree; gpudem: one")
    both = dataclasses.replace(comparison, cases=[*cases, scene])
    assert "codes agree; gpudem: one" in report.html(both, finished[0]).partition("</header>")[0]
    assert report_view.headlines(both)[1:] == [("scene", "codes agree; gpudem: one")]
    few = dataclasses.replace(comparison, cases=cases[:1])
    assert report_view.own_codes(few) == []
    assert "gpudem: one" in report.html(few, finished[0]).partition("</header>")[0]


def test_checks_that_do_not_hold_are_at_the_top_with_their_links(page):
    """Detects a page whose failures have to be looked for."""
    head = page.partition("</header>")[0]
    assert head.count('<a href="#check-troubled-') == 3
    assert "ValueError: &lt;script&gt;" in head


def test_heads_of_columns_of_numbers_stand_above_their_numbers(page):
    """Detects a head on the left of a column whose numbers are on its right."""
    assert '<th scope="col" class="n">largest error [m]</th>' in page
    assert '<th scope="col">variant</th>' in page


def test_names_of_checks_show_codes_as_people_know_them():
    shown = report_view.named("order (liggghts) of event_driven, gpudem")
    assert shown == "order (LIGGGHTS) of event-driven, gpudem"


def test_names_in_texts_are_set_as_code():
    """Detects backticks on the page, and a text that is taken for HTML on the way."""
    assert (
        str(report_view.prose("`epsd` <b> & `run 3`"))
        == "<code>epsd</code> &lt;b&gt; &amp; <code>run 3</code>"
    )


def test_what_an_expert_looks_for(page):
    for text in (
        "7 of 10 checks hold; 2 fail, 1 could not be evaluated", "How to read this", "What is covered",
        "Table of checks", "Reason of the tolerance", "Defect it would detect", "Error against run time",
        "Provenance", "Rayleigh", "Peak memory", "A figure that cannot be drawn",
        "order of convergence", "LIGGGHTS deck of",
    ):  # fmt: skip
        assert text in page, text


def test_failures_come_first(finished):
    directory, comparison = finished
    order = [c.status for c in report_view.View(comparison, directory).checks]
    assert order == ["error"] * 1 + ["fail"] * 2 + ["pass"] * 7 + ["left_out"]


def test_the_page_is_rebuilt_from_what_is_stored(finished, tmp_path, monkeypatch):
    copy = tmp_path / "copy"
    shutil.copytree(finished[0], copy)
    before = (copy / "report.html").read_text()
    (copy / "report.html").unlink()
    monkeypatch.setattr("comparisons.harness.codes.CODES", fake.codes(gpudem={"fails": "must not run"}))
    assert report.write(results.load(copy), copy).read_text() == before


def test_an_artefact_that_is_gone_is_said_to_be(finished, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(finished[0], copy)
    next((copy / "throw" / "figures").glob("01*")).unlink()
    assert "01_height_in_time.svg is missing" in report.html(results.load(copy), copy)


@pytest.mark.parametrize(
    ("change", "word", "text"),
    [
        ({"state": "running", "checks": []}, "warn", "Still running"),
        ({"state": "done", "checks": [], "cases": []}, "warn", "Nothing was checked"),
    ],
)
def test_verdicts(finished, change, word, text):
    comparison = dataclasses.replace(finished[1], **{"cases": [], **change})
    assert report_view.View(comparison, finished[0]).verdict == (word, text)


def test_good_verdict(finished):
    good = [c for c in finished[1].checks if c.status in ("pass", "left_out")]
    comparison = dataclasses.replace(finished[1], checks=good, cases=[])
    assert report_view.View(comparison, finished[0]).verdict == ("pass", "All 7 checks hold")


@pytest.mark.parametrize(
    ("x", "text"),
    [
        (0.0, "0"), (1234.0, "1234"), (1.5e-7, "1.5·10⁻⁷"), (1e-9, "10⁻⁹"), (-2e10, "\u22122·10¹⁰"),
        (-0.5, "\u22120.5"),
        (None, "\u2013"), (float("nan"), "NaN"), (float("inf"), "∞"),
    ],
)  # fmt: skip
def test_numbers(x, text):
    assert number(x) == text


def test_figures_are_images_with_their_text():
    """Catches a picture whose clip paths or markers are gone, or one that differs from run to run."""

    def made():
        fig, axes = plots.figure()
        for code in ("gpudem", "liggghts"):
            axes.plot(np.arange(5), **plots.style(code))
        axes.set_xlabel("time [s]")
        plots.legend(axes)
        return svg.of(fig)

    one = made()
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', one))
    assert used
    assert used <= set(re.findall(r'\bid="([^"]+)"', one))
    assert ">time [s]</text>" in one
    assert made() == one
    ElementTree.fromstring(one)
    assert svg.size(one)[0] == pytest.approx(plots.HALF * 96, rel=0.05)


def test_dense_figures_stay_small():
    fig, axes = plots.figure()
    axes.plot(np.random.default_rng(0).random(200_000), np.arange(200_000))
    assert len(svg.of(fig)) < 400_000


def test_setup_of_many_materials_stays_short():
    """Catches a row that names each of hundreds of pairs."""
    scene = at_rest("hertz", [0.5])[0]
    rows = {name: value for name, value, _ in setup_table.rows([scene])}
    assert rows["restitution"] == "0.1, 0.3, 0.5, 0.9, 1 (65 pairs)"
    assert all(len(name) + len(value) < 150 for name, value in rows.items())


def test_setup_names_what_differs_between_variants():
    rows = {name: value for name, value, _ in setup_table.rows([fake.scene(1e-5), fake.scene(2e-5)])}
    assert rows["time step"] == "10⁻⁵; 2·10⁻⁵"
    assert rows["particles"] == "3"
    assert rows["restitution"] == "0.9"
    assert "Young's modulus 10⁷ Pa" in rows["material glass"]
    many = {name: value for name, value, _ in setup_table.rows([fake.scene(k * 1e-6) for k in range(1, 10)])}
    assert many["time step"] == "10⁻⁶ to 9·10⁻⁶ (9 values)"


def test_pictures_without_gl_say_so(monkeypatch, tmp_path):
    monkeypatch.setenv("GPUDEM_NO_RENDER", "1")
    scene = fake.scene()
    frame = {"position": scene.state.position, "velocity": scene.state.velocity, "radius": scene.state.radius}
    text = svg.of(render.side_by_side({"one": (scene, frame), "two": (scene, frame)}))
    assert "no off-screen rendering here" in text


def test_pictures_show_the_balls():
    if not render.can_render():
        pytest.skip(render.NO_GL)
    scene = fake.scene()
    frame = {"position": scene.state.position, "velocity": scene.state.velocity, "radius": scene.state.radius}
    image = render.picture(scene, frame)
    assert image.shape[1:] == (render.WIDTH, 3)
    coloured = np.ptp(image.astype(int), axis=2) > 60
    assert 0.002 < coloured.mean() < 0.5
