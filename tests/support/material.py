"""What the page is made of, tiny: a file of every figure, table and experiment."""

import base64
from collections.abc import Sequence
from pathlib import Path

from vigauge_paper.claims import CLAIMS, Verdict
from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.figures.style import narrow
from vigauge_paper.ids import TABLES
from vigauge_paper.page.index import SHOWN_ROWS, Material

from . import ROOT

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)
TABLE = "head\n\n| a | b |\n|---|---|\n| **1** | 2 \\| 3 |\n"
ROWS = SHOWN_ROWS + 2


def material_of(folder: Path, explorers: Sequence[dict[str, object]] = ()) -> Material:
    """A rendered build in which every fourth claim differs, with its files in ``folder``."""

    def written(name: str, text: str) -> Path:
        (folder / name).write_text(text, "utf-8")
        return folder / name

    figures = {key: folder / f"{figure.stem}.png" for key, figure in FIGURES.items()}
    (folder / "narrow").mkdir()
    for file in figures.values():
        file.write_bytes(PIXEL)
        narrow(file).write_bytes(PIXEL)
    named = {name for claim in CLAIMS for name in claim.evidence} - set(FIGURES) - set(TABLES)
    rows = [
        {
            "id": claim.id,
            "section": claim.section,
            "claim": claim.claim,
            "published": claim.published,
            "measured": "1 < 2",
            "criterion": claim.criterion,
            "verdict": str(Verdict.HOLDS if k % 4 else Verdict.DIFFERS),
            "verdict_as_printed": str(Verdict.HOLDS),
        }
        for k, claim in enumerate(CLAIMS)
    ]
    return Material(
        rows=rows,
        why={claim.id: f"Because of {claim.id} & more." for claim in CLAIMS},
        claims="# Claims\n",
        figures=figures,
        tables={key: written(f"{key}.md", TABLE) for key in TABLES},
        evidence={name: written(f"{name}.csv", "a,b\n" + f"<{name}>,0.123456789\n" * ROWS) for name in named},
        captions=ROOT / "workflow" / "report",
        source="rendered",
        published=("fig09",),
        environment={
            "sequences": {"rendered_hall": {"source": "rendered", "truth": "t"}},
            "versions": {"numpy": "2"},
            "machine": {"processor": "P", "cores": 2},
            "speed": {"simulation": {"drift": 0.013}, "sweep": {"drift": 0.027}},
            "seed": 1,
            "commit": "abcdef",
        },
        extensions={},
        explorers=explorers,
    )
