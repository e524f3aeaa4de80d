"""Tables of the report's page."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape


def html_table(
    header: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    left: int = 1,
    ours: Collection[tuple[int, int]] = (),
    best: Collection[tuple[int, int]] = (),
    parted: Collection[int] = (),
) -> str:
    """A table that scrolls sideways where the page is too narrow.

    Args:
        header: names of the columns.
        rows: the cells' text.
        left: so many columns are text; the others are figures, to the right.
        ours: cells (row, column) of methods scored here, in colour.
        best: cells that stand out.
        parted: rows with a line above.

    Example:
        >>> "<td>1.00</td>" in html_table(["a", "b"], [["x < y", "1.00"]])
        True
    """
    lines = []
    for i, row in enumerate(rows):
        cells = []
        for j, text in enumerate(row):
            kinds = ["left"] * (j < left) + ["ours"] * ((i, j) in ours)
            kinds += ["best"] * ((i, j) in best)
            attribute = f' class="{" ".join(kinds)}"' if kinds else ""
            cells.append(f"<td{attribute}>{escape(text)}</td>")
        first = ' class="first"' if i in parted else ""
        lines.append(f"<tr{first}>{''.join(cells)}</tr>")
    names = "".join(
        f'<th class="left">{escape(name)}</th>' if j < left else f"<th>{escape(name)}</th>"
        for j, name in enumerate(header)
    )
    body = "\n".join(lines)
    return (
        f'<div class="wide"><table><thead><tr>{names}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )


def lowest(columns: Sequence[Sequence[float | None]], first: int) -> set[tuple[int, int]]:
    """Cells (row, column) of the lowest of each column's values, where they differ.

    Args:
        columns: values of the rows.
        first: number of the first of these columns in the table.
    """
    cells = set()
    for j, values in enumerate(columns, first):
        known = [value for value in values if value is not None]
        if len(set(known)) > 1:
            cells |= {(i, j) for i, value in enumerate(values) if value == min(known)}
    return cells
