"""Judge the claims at every setting of the sensitivity sweep."""

import argparse

import pandas as pd

from vigauge.files import write_rows
from vigauge_paper.claims import Criteria
from vigauge_paper.claims.sensitivity import judge_setting
from vigauge_paper.run.artefacts import FILE, add_section
from vigauge_paper.run.stage import Stamped, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    criteria = settings_from(Criteria, options.criteria, "claims")
    table2 = pd.read_csv(options.published / "table2.csv")
    rows = []
    for setting in options.settings:
        parameter, _, value = setting.partition("=")
        solutions = {file.stem: file for file in sorted((options.folder / setting).glob("*.csv"))}
        rows += judge_setting(parameter, value, solutions, criteria, table2)
    write_rows(options.output, rows)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--folder", **FILE, help="folder with a folder a setting")
    arguments.add_argument(
        "--settings", nargs="+", required=True, help="PARAMETER=VALUE, names of these folders"
    )
    arguments.add_argument("--published", **FILE, help="folder of the published numbers")
    add_section(arguments, "--criteria", "claims")
    arguments.add_argument("--output", **FILE, help="a row a setting and claim")
    run(work, arguments, Stamped({"criteria": "claims"}, outputs=("output",)))


if __name__ == "__main__":
    main()
