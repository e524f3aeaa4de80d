"""Tables as Markdown and LaTeX: our figures with their spread, beside the paper's."""

from __future__ import annotations

import statistics
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from scipy import stats

from epinet.benchmark import latex

Values = Sequence[float]

SIGNIFICANCE = 0.05
"""What is more likely than this to be chance is undecided."""


class Spread(Enum):
    """What several values of one figure are, and so how two figures compare. Smaller is better."""

    SEEDS = "seeds"
    """Trainings that differ by their seed alone."""
    SCENES = "scenes"
    """The same scenes (or views)."""

    def verdict(self, values: Values, reference: Values) -> str:
        """How the values, at least two, stand to the reference's, by Student's t-test."""
        test = stats.ttest_ind if self is Spread.SEEDS else stats.ttest_rel
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # values that do not differ at all
            decided = test(values, reference).pvalue < SIGNIFICANCE
        better = statistics.mean(values) < statistics.mean(reference)
        return ("better" if better else "worse") if decided else "undecided"


def difference(values: Values, reference: Values) -> tuple[float, float]:
    """Mean of the paired differences and its standard error."""
    differences = [a - b for a, b in zip(values, reference, strict=True)]
    return statistics.mean(differences), statistics.stdev(differences) / len(differences) ** 0.5


@dataclass(frozen=True)
class Row:
    name: str
    ours: Mapping[str, Values]
    """By the metric's key; one value for each seed or scene."""
    paper: Mapping[str, float]
    """By the metric's key, where the paper has it."""
    against: str = ""
    """Name of the row that it is compared with, if with any."""


@dataclass(frozen=True)
class Table:
    title: str
    scale: str
    """At which scale the runs were made, in sentences."""
    metrics: Mapping[str, str]
    """Label of each metric by its key."""
    spread: Spread
    rows: Sequence[Row]

    def head(self) -> list[str]:
        columns = [""]
        for key, label in self.metrics.items():
            columns.append(f"{label}, ours")
            if self._published(key):
                columns.append(f"{label}, paper")
        return columns

    def cells(self) -> list[list[str]]:
        lines = []
        for row in self.rows:
            line = [row.name]
            for key in self.metrics:
                line.append(self._ours(row, key))
                if self._published(key):
                    line.append(f"{row.paper[key]:g}" if key in row.paper else "-")
            lines.append(line)
        return lines

    def _published(self, key: str) -> bool:
        return any(key in row.paper for row in self.rows)

    def _ours(self, row: Row, key: str) -> str:
        values = row.ours.get(key)
        if not values:
            return "-"
        text = _figures(statistics.mean(values), 3)
        if self.spread is Spread.SEEDS:
            text += f" ± {_figures((max(values) - min(values)) / 2, 2)}"
        reference = next((r.ours.get(key) for r in self.rows if r.name == row.against), None)
        if not reference or len(values) < 2:
            return text
        if self.spread is Spread.SCENES:
            mean, error = difference(values, reference)
            sign = "+" if mean >= 0 else ""
            text += f" ({sign}{_figures(mean, 2)} ± {_figures(error, 1)})"
        return f"{text}, {self.spread.verdict(values, reference)}"

    def markdown(self) -> str:
        lines = [self.head(), ["---"] * len(self.head()), *self.cells()]
        body = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        return f"### {self.title}\n\n{self.note()}\n\n{body}\n"

    def latex(self) -> str:
        rows = [list(map(latex.escaped, line)) for line in (self.head(), *self.cells())]
        return latex.table(f"{self.title}. {self.note()}", rows)

    def note(self) -> str:
        """The scale, and how to read the verdicts."""
        how = {
            Spread.SEEDS: "mean ± half the range over the seeds; undecided: by a t-test",
            Spread.SCENES: "mean (mean difference, scene by scene or view by view, ± its standard "
            "error); undecided: by a paired t-test",
        }[self.spread]
        how = f"{how}, more than {100 * SIGNIFICANCE:g} % likely to be chance."
        pairs = [f"{row.name} with {row.against}" for row in self.rows if row.against]
        return f"{self.scale} Ours: {how} Compared: {'; '.join(pairs)}."


def _figures(value: float, significant: int) -> str:
    """So many significant figures, never with an exponent where they fit."""
    return f"{float(f'{value:.{significant}g}'):g}"
