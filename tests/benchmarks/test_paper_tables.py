"""The paper's tables: what is decided, what is run again, and what the recipes share."""

import json
import statistics

import numpy as np
import pytest

from benchmarks.paper_tables import published
from benchmarks.paper_tables.predictions import _content, unseen_errors
from benchmarks.paper_tables.saved import saved_run
from benchmarks.paper_tables.tables import Row, Spread, Table
from benchmarks.paper_tables.trained import (
    BUDGETS,
    STUDIED,
    Trainings,
    recipe_for,
    settings_of,
    streams,
)
from epinet.angular import star_positions
from epinet.errors import InputError
from epinet.lightfield import LightField
from epinet.synth.generator import VERSION
from epinet.train.recipe_files import load_recipe


def test_seeds_decide_where_they_are_farther_apart_than_among_themselves():
    verdict = Spread.SEEDS.verdict
    assert verdict([1.0, 1.1], [3.0, 3.1]) == "better"
    assert verdict([3.0, 3.1], [1.0, 1.1]) == "worse"
    assert verdict([1.0, 2.0], [1.5, 3.0]) == "undecided"
    assert verdict([1.0, 2.0], [2.1, 3.1]) == "undecided"  # one in three by chance: 2 before 2
    assert verdict([1.0, 1.0], [1.0, 1.0]) == "undecided"


def test_verdicts_on_chance_are_rare():
    """Of figures that do not differ, one in twenty is decided, by definition."""
    rng = np.random.default_rng(5)
    for spread, count in ((Spread.SEEDS, 2), (Spread.SCENES, 4)):
        decided = sum(
            spread.verdict(*rng.normal(size=(2, count))) != "undecided" for _ in range(2000)
        )
        assert 0.03 < decided / 2000 < 0.07


def test_scenes_decide_by_their_paired_differences():
    hard = np.array([1.0, 50.0, 9.0, 20.0])  # scenes differ far more than methods
    steady = hard + np.array([0.4, 0.6, 0.5, 0.5])
    assert Spread.SCENES.verdict(steady, hard) == "worse"
    assert Spread.SCENES.verdict(hard, steady) == "better"
    erratic = hard + np.array([0.4, 9.0, -8.0, 0.5])
    assert Spread.SCENES.verdict(erratic, hard) == "undecided"


def table(spread, against="first"):
    rows = [
        Row("first", {"bad": [4.9, 5.1], "s": [1.0]}, {"bad": 3.94}),
        Row("second_row", {"bad": [8.2, 8.8], "s": [2.0]}, {}, against),
    ]
    return Table("Table 9: 100 %", "Ten steps.", {"bad": "BadPix", "s": "s"}, spread, rows)


def test_markdown_has_spread_verdict_and_the_papers_figure():
    lines = table(Spread.SEEDS).markdown().splitlines()
    assert "|  | BadPix, ours | BadPix, paper | s, ours |" in lines  # the paper has no times
    assert "| first | 5 ± 0.1 | 3.94 | 1 ± 0 |" in lines
    assert "| second_row | 8.5 ± 0.3, worse | - | 2 ± 0 |" in lines
    assert "Ten steps." in lines[2]
    assert "second_row with first" in lines[2]


def test_scenes_show_the_mean_difference():
    differences = [8.2 - 4.9, 8.8 - 5.1]
    error = statistics.stdev(differences) / 2**0.5
    expected = f"8.5 (+{statistics.mean(differences):.2g} ± {error:.1g}), worse"
    assert expected in table(Spread.SCENES).markdown()
    assert "), worse" not in table(Spread.SCENES, against="").markdown()


def test_large_values_are_written_out():
    rows = [Row("only", {"s": [1234.0, 1434.0]}, {})]
    text = Table("T", "S.", {"s": "s"}, Spread.SEEDS, rows).markdown()
    assert "| only | 1330 ± 100 |" in text


def test_latex_escapes_what_it_must():
    text = table(Spread.SEEDS).latex()
    assert r"Table 9: 100 \%" in text
    assert r"second\_row & 8.5 $\pm$ 0.3, worse & - & 2 $\pm$ 0 \\" in text
    assert text.count(r"\\") == 3


def test_latex_keeps_commands_as_they_are_typed():
    rows = [Row("`epinet synth --scenes 50`", {"s": [1.0]}, {})]
    text = Table("T", "S.", {"s": "s"}, Spread.SCENES, rows).latex()
    assert r"\texttt{epinet synth -{}-scenes 50} &" in text


def test_other_data_of_the_same_name_are_another_run(tmp_path):
    """Which would be refused instead of answered with the old figure."""
    for folder, text in (("one", "a"), ("same", "a"), ("other", "b")):
        (tmp_path / folder / "scene").mkdir(parents=True)
        (tmp_path / folder / "scene" / "view.png").write_text(text)
    one, same, other = (_content(tmp_path / f / "scene") for f in ("one", "same", "other"))
    assert one == same != other
    assert other.startswith("scene ")


def test_a_saved_run_is_not_run_again_and_other_settings_are_refused(tmp_path):
    file, calls = tmp_path / "deep" / "run.json", []

    def run():
        calls.append(1)
        return {"score": 7}

    first = saved_run(file, {"steps": 3, "sizes": (1, 2)}, run)
    assert saved_run(file, {"steps": 3, "sizes": (1, 2)}, run) == first | json.loads(
        file.read_text()
    )
    assert calls == [1]
    with pytest.raises(InputError, match="other settings"):
        saved_run(file, {"steps": 4, "sizes": (1, 2)}, run)


@pytest.mark.parametrize("budget", BUDGETS)
@pytest.mark.parametrize("name", sorted(published.STREAMS | published.VIEWS))
def test_a_budget_changes_nothing_of_what_the_tables_study(name, budget):
    recipe, paper = recipe_for(name, 2, BUDGETS[budget]), load_recipe(name)
    assert [getattr(recipe, key) for key in STUDIED] == [getattr(paper, key) for key in STUDIED]
    assert recipe.seed == 2
    others = recipe_for("paper-9x9", 2, BUDGETS[budget])
    differing = {k for k, v in recipe.as_dict().items() if v != others.as_dict()[k]}
    assert differing <= {"name", "about", *STUDIED}


def test_a_table_is_made_of_saved_runs_alone(tmp_path):
    """Runs of two seeds are written beforehand; no training starts."""
    budget = BUDGETS["hours"]
    trainings = Trainings(budget, tmp_path / "results", tmp_path / "runs", "another machine")
    for k, name in enumerate(published.STREAMS):
        for seed in (1, 2):
            settings = settings_of(recipe_for(name, seed, budget), budget)
            scores = {"badpix_0.07": 60.0 - 10 * k + seed, "mse_x100": 5.0 + seed}
            report = {
                "history": [{"step": 10, "scores": scores}],
                "scores": scores,
                "minutes": 0.5,
                "machine": "the machine of the runs",
                "threads": 1,
            }
            file = tmp_path / "results" / f"{name}_seed{seed}.json"
            saved_run(file, settings, lambda report=report: report)
    constant = {"badpix_0.07": 97.5, "mse_x100": 300.0}
    settings = {"generator": VERSION, "validation": []}
    saved_run(tmp_path / "results" / "constant.json", settings, lambda: constant)
    lines = streams(trainings).markdown().splitlines()
    assert "| 1 stream | 61.5 ± 0.5, worse | 7.61 | 6.5 ± 0.5, undecided | 2.165 |" in lines
    assert "| 4 streams | 41.5 ± 0.5 | 3.87 | 6.5 ± 0.5 | 1.393 |" in lines
    assert "| best constant map | 97.5 ± 0 | - | 300 ± 0 | - |" in lines
    assert "500 steps" in lines[2]
    assert "2 seeds" in lines[2]
    assert "the machine of the runs, 1 thread." in lines[2]
    assert "another machine" not in lines[2]
    assert (tmp_path / "results" / "streams.png").exists()
    assert not (tmp_path / "runs").exists()


def test_unseen_views_tell_a_right_map_from_a_wrong_one():
    disparity = np.full((64, 64), 0.75, np.float32)
    y, x = np.mgrid[:64, :64]
    views = np.zeros((9, 9, 64, 64, 1), np.float32)
    for row, col in np.ndindex(9, 9):
        there = x + 0.75 * (col - 4), y + 0.75 * (row - 4)
        views[row, col, ..., 0] = 0.5 + 0.2 * np.sin(0.6 * there[0]) * np.sin(0.5 * there[1])
    lf = LightField(views)
    right, wrong = unseen_errors(lf, disparity), unseen_errors(lf, disparity + 0.1)
    assert {ring: len(errors) for ring, errors in right.items()} == {
        "unseen_inner": 25 - len(star_positions(5)),
        "unseen_outer": 81 - 25 - len(star_positions(9)) + len(star_positions(5)),
    }
    for ring in right:
        assert max(right[ring]) < 0.25 * min(wrong[ring])
