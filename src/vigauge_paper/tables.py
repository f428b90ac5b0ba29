"""Tables I to III as rows, and any table as CSV, Markdown and LaTeX."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from vigauge.files import write_rows, write_text
from vigauge.model.archive import load_arrays

from .ids import ERRORS, FIX, FREE, GAUGES, PRIOR, Row

_UNITS = dict(zip(ERRORS, ("m", "deg", "m/s"), strict=True))
_SHORT = {"p_rmse_m": "p (m)", "phi_rmse_deg": "phi (deg)", "v_rmse_mps": "v (m/s)"}
_BOLD = re.compile(r"\*\*(.+?)\*\*")


def table1(covariance: Path) -> list[Row]:
    """Table I from a problem: size of the parameter vector, of the Hessian, and its measured rank."""
    arrays = load_arrays(covariance)
    n = int(arrays["n_parameters"])
    sizes = {"fix": n - 4, "prior": n, "free": n}
    return [
        {
            "gauge": gauge,
            "parameters": sizes[gauge],
            "hessian_rows": sizes[gauge],
            "hessian_rank": int(arrays[f"rank_{gauge}"]),
        }
        for gauge in (FIX, PRIOR, FREE)
    ]


def mean_errors(solutions: Path) -> dict[str, dict[str, float]]:
    """Mean RMSE over the converged trials of the headline noise, by gauge; with the number left out.

    NaN for a gauge under which no trial converged.
    """
    table = pd.read_csv(solutions).query("noise == 'headline'")
    good = table[table["converged"]]
    means = good.groupby("gauge")[list(ERRORS)].mean().reindex(list(GAUGES))
    return {
        gauge: {name: float(means.loc[gauge, name]) for name in ERRORS}
        | {"excluded": float((~table.loc[table["gauge"] == gauge, "converged"]).sum())}
        for gauge in GAUGES
    }


def table2(solutions: Mapping[str, Path]) -> list[Row]:
    """Table II: mean RMSE of each simulated configuration and gauge."""
    return [
        {"configuration": name, "gauge": gauge, **{error: values[gauge][error] for error in ERRORS}}
        for name, file in solutions.items()
        for values in [mean_errors(file)]
        for gauge in GAUGES
    ]


def table3(solutions: Mapping[str, Path], source: str) -> list[Row]:
    """Table III: RMSE of each sequence and gauge; ``source`` is 'euroc' or 'rendered'."""
    return [{"sequence": row.pop("configuration"), "source": source, **row} for row in table2(solutions)]


def trial_count(solutions: Mapping[str, Path]) -> str:
    """Number of trials of the experiments: one number, or the range."""
    counts = {pd.read_csv(file)["trial"].nunique() for file in solutions.values()}
    return " to ".join(str(count) for count in sorted({min(counts), max(counts)}))


def left_out(solutions: Mapping[str, Path]) -> str:
    """A sentence on the runs that did not converge and are in no mean; empty where there is none."""
    counts = [
        f"{int(values['excluded'])} of {name} {gauge}"
        for name, file in solutions.items()
        for gauge, values in mean_errors(file).items()
        if values["excluded"]
    ]
    return f" Left out, as they did not converge: {', '.join(counts)}." if counts else ""


def degenerate(solutions: Mapping[str, Path]) -> str:
    """A sentence on the runs whose problem is degenerate at the estimate; empty where there is none."""
    counts = []
    for name, file in solutions.items():
        table = pd.read_csv(file).query("noise == 'headline' and degenerate")
        counts += [f"{len(rows)} of {name} {gauge}" for gauge, rows in table.groupby("gauge", sort=False)]
    return f" Degenerate: {', '.join(counts)}." if counts else ""


def starts(solutions: Mapping[str, Path]) -> str:
    """A sentence on the errors of the starts, means over the trials."""
    parts = []
    for name, file in solutions.items():
        table = pd.read_csv(file).query("noise == 'headline' and gauge == 'fix'")
        errors = (f"{table[f'start_{error}'].mean():.5f} {unit}" for error, unit in _UNITS.items())
        parts.append(f"{name} {', '.join(errors)}")
    return f"The starts: {'; '.join(parts)}."


def worse_than_start(solutions: Mapping[str, Path]) -> str:
    """A sentence on errors that are larger after the optimisation than before; empty where there is none."""
    parts = []
    for name, file in solutions.items():
        table = pd.read_csv(file).query("noise == 'headline' and gauge == 'fix' and converged")
        for error, unit in _UNITS.items():
            start, end = table[f"start_{error}"].mean(), table[error].mean()
            if end > start:
                quantity = _SHORT[error].split()[0]
                parts.append(f"{name}, {quantity} from {start:.3g} to {end:.3g} {unit}")
    return f"**Worse at the end than at the start:** {'; '.join(parts)}. " if parts else ""


def _text(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def markdown(rows: Sequence[Mapping[str, object]], note: str = "", head: str = "") -> str:
    """Rows as a Markdown table, with a note below and what must be known first above."""
    names = list(rows[0])
    lines = ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    lines += [
        "| " + " | ".join(_text(row[name]).replace("|", "\\|") for name in names) + " |" for row in rows
    ]
    return (f"{head}\n\n" if head else "") + "\n".join(lines) + "\n" + (f"\n{note}\n" if note else "")


def latex(rows: Sequence[Mapping[str, object]], note: str = "", head: str = "") -> str:
    """Rows as a LaTeX tabular with booktabs rules; Markdown's bold becomes LaTeX's."""
    names = list(rows[0])

    def line(values: Sequence[object]) -> str:
        cells = (_text(value).replace("_", r"\_").replace("%", r"\%") for value in values)
        return " & ".join(_BOLD.sub(r"\\textbf{\1}", cell) for cell in cells) + r" \\"

    body = [line([row[name] for name in names]) for row in rows]
    begin = [r"\begin{tabular}{" + "l" * len(names) + "}", r"\toprule", line(names), r"\midrule"]
    foot = [r"\bottomrule", r"\end{tabular}"]
    return (
        "\n".join(([f"% {head}"] if head else []) + begin + body + foot + ([f"% {note}"] if note else []))
        + "\n"
    )


def wide_errors(
    rows: Sequence[Row], published: Path | None, names: Mapping[str, str] | None = None
) -> list[Row]:
    """Tables II and III as the paper sets them: a row a case, fixation and free side by side.

    The smaller of each pair is bold where the digits shown differ. With ``published`` (a CSV
    of the paper's table) its values follow in brackets; ``names`` maps our cases to the paper's.
    """
    key = "configuration" if "configuration" in rows[0] else "sequence"
    theirs = None if published is None else pd.read_csv(published).set_index([key, "gauge"])
    out = []
    for case in dict.fromkeys(str(row[key]) for row in rows):
        line: Row = {key: case}
        values = {str(row["gauge"]): row for row in rows if row[key] == case}
        for gauge in (FIX, FREE):
            for error in ERRORS:
                text = f"{values[gauge][error]:.5f}"
                other = f"{values[FREE if gauge == FIX else FIX][error]:.5f}"
                if float(text) < float(other):
                    text = f"**{text}**"
                their_case = (names or {}).get(case, case)
                if theirs is not None and (their_case, gauge) in theirs.index:
                    text += f" ({theirs.loc[(their_case, gauge), error]:.5g})"
                line[f"{gauge}, {_SHORT[error]}"] = text
        out.append(line)
    return out


def write_table(
    rows: Sequence[Row], stem: Path, shown: Sequence[Row] | None = None, note: str = "", head: str = ""
) -> None:
    """``stem``.csv with the rows; ``stem``.md and ``stem``.tex with what is ``shown`` of them."""
    write_rows(f"{stem}.csv", rows)
    write_text(f"{stem}.md", markdown(shown or rows, note, head))
    write_text(f"{stem}.tex", latex(shown or rows, note, head))
