"""What a report shows, and that it needs nothing beyond itself."""

import base64
import csv
import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from epinet.benchmark import pictures
from epinet.benchmark.latex import as_latex
from epinet.benchmark.page import render
from epinet.benchmark.report import write_report
from epinet.benchmark.standing import accuracy_and_time, caveats, ranking, run_times
from epinet.benchmark.table import (
    as_csv,
    as_json,
    score_tables,
    score_text,
    scored_metrics,
    text_tables,
)

SIZE = (40, 48)
RNG = np.random.default_rng(0)
TRUTH = RNG.normal(size=SIZE)


@pytest.fixture
def evaluation(add_scene, evaluated):
    """Two methods on two scenes, one of which has masks."""
    mask = np.ones(SIZE, bool)
    add_scene("a", TRUTH, masks={"mask_discontinuities_lowres": mask, "invalid_mask": ~mask})
    add_scene("b & c", TRUTH)
    maps = dict.fromkeys(("a", "b & c"), TRUTH + 0.05)
    holed = np.where(RNG.random(SIZE) < 0.1, np.nan, TRUTH)
    return evaluated(
        {"ours": maps, "<theirs>": dict.fromkeys(maps, holed)}, {"ours": 2.5}, border_px=4
    )


class Page(HTMLParser):
    """Tags and attributes of a page, checked to be closed."""

    VOID = frozenset({"meta", "img", "br"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_the_page_is_whole_and_asks_for_nothing(evaluation):
    text = render(evaluation)
    page = Page(text)
    assert page.open == []
    for tag, attributes in page.tags:
        assert tag not in ("script", "link", "iframe")
        for name in ("src", "href", "xlink:href"):
            target = attributes.get(name) or "#"
            assert target.startswith(("data:image/png;base64,", "#"))
    assert not re.search(r"url\((?!#)|@import", text)
    anchors = {attributes.get("id") for _, attributes in page.tags}
    links = [attributes["href"] for tag, attributes in page.tags if tag == "a"]
    assert {link[1:] for link in links} <= anchors
    words = " ".join(page.words)
    for said in ("b & c", "<theirs>", "SubFocal-L", "official truth", "different scenes"):
        assert said in words


def test_every_scene_and_method_is_shown(evaluation):
    page = Page(render(evaluation))
    shown = [attributes for tag, attributes in page.tags if tag == "img"]
    # A thumbnail of each truth, two and four of each map; centre view and truth of each scene.
    assert len(shown) == 2 * (1 + 2 * 2) + 2 * (2 + 2 * 4)
    for attributes in shown:
        data = base64.b64decode(attributes["src"].partition(",")[2])
        with Image.open(io.BytesIO(data)) as image:
            assert image.format == "PNG" and image.size == (48, 40)


def test_pictures_have_the_benchmarks_colours():
    truth, map_ = np.zeros((6, 8)), np.zeros((6, 8))
    map_[2, 2], map_[2, 3], map_[2, 4], truth[2, 5] = 0.1, 0.06, np.nan, np.nan
    good, bad = (103, 190, 99), (165, 0, 38)  # RdYlGn reversed at .2 and 1
    picture = pictures.badpix_picture(map_, truth, 0.07, 1)
    np.testing.assert_allclose(picture[3, 3], good, atol=3)
    np.testing.assert_allclose(picture[2, 2], bad, atol=3)
    np.testing.assert_allclose(picture[2, 3], good, atol=3)
    np.testing.assert_allclose(picture[2, 4], bad, atol=3)
    for outside in (picture[2, 5], picture[0, 0]):
        assert outside[0] == outside[1] == outside[2]
    error = pictures.error_picture(map_, truth).astype(int)
    assert (error[3, 3] >= 253).all()  # right is white
    assert error[2, 2, 2] > error[2, 2, 0]  # too near is blue
    assert tuple(error[2, 4]) == pictures.MISSING
    far = pictures.error_picture(map_ - 0.1, truth).astype(int)
    assert far[3, 3, 0] > far[3, 3, 2]  # too far is red


def test_large_pictures_are_made_smaller():
    uri = pictures.data_uri(np.zeros((300, 600, 3), np.uint8), 100)
    with Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))) as image:
        assert image.size == (100, 50)


def test_tables_hold_every_score_with_two_decimals(evaluation):
    text = "\n".join(text_tables(evaluation))
    for line in text.splitlines():
        for figure in re.findall(r"\d+\.\d+", line.partition("Border")[0]):
            assert len(figure.partition(".")[2]) >= 2 or line.startswith(" " * 10)
    values = {s.value for s in evaluation.scores.values() if s.value is not None}
    for value in values:
        assert score_text(value) in text
    assert "BadPix(.07)" in text and "Discontinuities" in text and "Fattening" not in text
    assert "*" in text  # no high-resolution truth at the discontinuities
    tables = score_tables(evaluation)
    assert [row[:2] for row in tables[0].rows][-2:] == [("mean", "ours"), ("mean", "<theirs>")]


def test_csv_has_a_line_for_every_score(evaluation):
    lines = list(csv.DictReader(io.StringIO(as_csv(evaluation))))
    assert len(lines) == len(evaluation.scores) == 2 * 2 * len(evaluation.metrics)
    for line in lines:
        score = evaluation.scores[line["method"], line["scene"], line["metric"]]
        assert (float(line["value"]) if line["value"] else None) == score.value
        assert line["truth"] == (score.truth or "")
        assert bool(line["absent"]) == (score.value is None)


def test_json_says_what_the_scores_are(evaluation):
    document = json.loads(as_json(evaluation))
    assert document["border_px"] == 4
    scores = document["scores"]["<theirs>"]["a"]
    assert scores["badpix_0.07"]["truth"] == "low"
    assert scores["missing"]["value"] > 0
    assert scores["discontinuities"]["truth_as_on_the_site"] is False
    assert scores["runtime"] == {"value": None, "absent": "no run time is stated"}
    assert document["means"]["ours"]["runtime"] == {"value": 2.5, "scenes": 2}
    assert "discontinuities" in document["metrics"]["discontinuities"]["masks"]


def test_small_figures_keep_their_digits():
    assert [score_text(v) for v in (0, 0.00412, 0.0471, 1.005, 2140, None)] == [
        *("0.00", "0.00412", "0.047", "1.00", "2140.00", "-")
    ]


def test_methods_are_ranked_beside_the_published(add_scene, evaluated):
    """A map of known BadPix on a scene whose published figures are 12.84, 12.34, 12.25, 11.04."""
    truth = np.zeros((512, 512))
    add_scene("boxes", truth)
    add_scene("elsewhere", truth)
    bad = truth.copy()
    bad[15:-15, 15:75] = 1  # 60 of 482 columns: 12.448 %
    maps = {"boxes": bad, "elsewhere": truth + 1}
    found = evaluated({"ours": maps}, {"ours": 3.0})
    by_badpix = ranking(found, "badpix_0.07")
    assert by_badpix.scenes == ("boxes",)
    assert [(row.rank, row.method) for row in by_badpix.rows] == [
        (1, "LFattNet"),
        (2, "Epinet-fcn9x9"),
        (3, "Epinet-fcn-m"),
        (4, "ours"),
        (5, "Epinet-fcn"),
    ]
    points = {p.method: (p.seconds, p.value) for p in accuracy_and_time(found, "badpix_0.07")}
    assert points["ours"] == (3.0, pytest.approx(100 * 60 / 482))
    assert points["Epinet-fcn-m"] == (10.65, 12.34)
    assert "OccCasNet" not in points
    times = [name for name, *_ in run_times(found)]
    assert times.index("Epinet-fcn") < times.index("ours") < times.index("LFattNet")
    assert caveats(found) == []
    assert "On boxes: the scenes" in render(found)


def test_a_map_with_holes_is_no_point_of_the_figure(add_scene, evaluated):
    """Its MSE passes over them: what is left may be the easy part."""
    truth = np.zeros((512, 512))
    add_scene("boxes", truth)
    holed = np.full_like(truth, np.nan)
    holed[100, 100] = 0
    maps = {"holed": {"boxes": holed}, "whole": {"boxes": truth + 1}}
    found = evaluated(maps, {"holed": 1.0, "whole": 2.0})
    ours = {p.method for p in accuracy_and_time(found, "mse_x100") if p.ours}
    assert ours == {"whole"}
    assert {p.method for p in accuracy_and_time(found, "badpix_0.07") if p.ours} == {
        "holed",
        "whole",
    }


def test_what_does_not_compare_is_said(add_scene, evaluated):
    add_scene("stripes", np.zeros((512, 512)))
    found = evaluated({"ours": {"stripes": np.zeros((512, 512))}}, border_px=16)
    border, truth = caveats(found)
    assert "leave out 15 px, these 16 px" in border
    assert truth.startswith("On stripes")


def test_other_scenes_are_ranked_among_the_given(evaluation):
    found = ranking(evaluation, "badpix_0.01")
    assert [(row.rank, row.method, row.ours) for row in found.rows] == [
        (1, "<theirs>", True),
        (2, "ours", True),
    ]


def test_a_report_is_a_page_tables_and_figures(evaluation, tmp_path):
    page = write_report(evaluation, tmp_path / "out")
    assert page.read_text(encoding="utf-8") == render(evaluation)
    names = {path.name for path in page.parent.iterdir()}
    assert names == {"figures", "report.html", "scores.csv", "scores.json", "scores.tex"}
    figures = {path.name: path for path in (page.parent / "figures").iterdir()}
    maps = {
        f"{s}_{m}_{kind}.png"
        for s in ("a", "b & c")
        for m in ("ours", "<theirs>")
        for kind in ("map", "error")
    }
    assert set(figures) == maps | {"accuracy.pdf", "ranks.pdf", "run_times.pdf"}
    assert figures["ranks.pdf"].read_bytes().startswith(b"%PDF")
    assert Image.open(figures["a_ours_map.png"]).size == SIZE[::-1]


def test_latex_has_every_score_and_the_lowest_of_a_scene_is_bold(evaluation):
    text = as_latex(evaluation)
    for name, count in ((r"\begin{table}", 1), (r"\end{table}", 1), (r"\begin{tabular}", 1)):
        assert text.count(name) == count * len(scored_metrics(evaluation))
    assert r"b \& c" in text and r"\textless{}theirs\textgreater{}" in text and "\\% " not in text
    table = text.split("MSE x100")[1].split(r"\end{tabular}")[0]
    rows = [line for line in table.splitlines() if " & " in line][1:]
    assert sum(row.count(r"\textbf{") for row in rows) >= 2, "one or both in each of two scenes"
    for (method, scene, id_), score in evaluation.scores.items():
        assert score.value is None or score_text(score.value) in text, (method, scene, id_)
    for line in text.splitlines():
        assert line.count("{") == line.count("}")


def test_no_line_on_a_terminal_is_wider_than_a_hundred_characters(evaluation):
    lines = text_tables(evaluation)
    assert max(map(len, lines)) <= 100
    assert sum(line.startswith("scene ") for line in lines) > 1, "more than one table is needed"


def test_means_over_other_scenes_say_so_and_do_not_win(add_scene, evaluated):
    add_scene("a")
    add_scene("b")
    nothing, right = np.full(SIZE, np.nan), np.full(SIZE, 0.2)
    maps = {"half": {"a": right / 2, "b": nothing}, "whole": {"a": right, "b": right}}
    maps["worse"] = {"a": 2 * right, "b": right}
    found = evaluated(maps, border_px=4)
    text = "\n".join(text_tables(found))
    half = "".join(line for line in text.splitlines() if re.match(r"mean +half", line))
    whole = "".join(line for line in text.splitlines() if re.match(r"mean +whole", line))
    assert "1.00 (1)" in half and "(1)" not in whole
    assert "over so many of the 2 scenes" in " ".join(text.split())
    page = render(found)
    assert '<td class="best">4.00</td>' in page  # the MSE x100 of the whole map
    assert '<td class="best">1.00 (1)</td>' not in page


def test_methods_with_holes_have_no_rank_by_what_passes_over_them(add_scene, evaluated):
    truth = np.zeros((512, 512))
    add_scene("cotton", truth)
    few = np.full((512, 512), np.nan)
    few[100, 100:104] = 0
    found = evaluated({"few": {"cotton": few}, "all": {"cotton": truth + 1}})
    by_mse = ranking(found, "mse_x100")
    assert by_mse.unranked == ("few",)
    assert "few" not in {row.method for row in by_mse.rows}
    assert "few" in {row.method for row in ranking(found, "badpix_0.07").rows}
    assert "Not ranked: few" in render(found)


def test_scores_against_high_truth_are_marked(add_scene, evaluated):
    add_scene("dots", TRUTH, high=TRUTH.repeat(10, 0).repeat(10, 1))
    add_scene("stripes", TRUTH)
    found = evaluated({"m": dict.fromkeys(("dots", "stripes"), TRUTH + 1)}, border_px=4)
    lines = text_tables(found)
    (high,) = (line for line in lines if line.startswith("dots") and "100.00^" in line)
    (low,) = (line for line in lines if line.startswith("stripes") and "100.00*" in line)
    assert "*" not in high and "^" not in low
    assert any(line.startswith("mean") and "100.00*" in line for line in lines)


def test_classes_keep_their_two_colours_when_made_smaller():
    truth, map_ = np.zeros((600, 600)), RNG.normal(0, 0.1, (600, 600))
    picture = pictures.badpix_picture(map_, truth, 0.07, 0)
    uri = pictures.data_uri(picture, 100, "classes")
    with Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))) as image:
        assert len(image.convert("RGB").getcolors()) == 2


def test_what_is_not_scored_is_gray_even_where_nothing_is_known():
    nothing = np.full((20, 20), np.nan)
    picture = pictures.badpix_picture(nothing, np.zeros((20, 20)), 0.07, 4)
    assert len(set(picture[0, 0])) == 1
    assert len(set(picture[10, 10])) == 3  # missing is bad
