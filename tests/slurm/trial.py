"""The smoke configuration as jobs of Slurm: killed, taken up again, compared, and with a stage that fails.

`tests/slurm/run.sh` starts a Slurm for it; any other does as well where it writes its completed jobs as
jobcomp/filetxt does.
"""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from datetime import datetime
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from recovery.compare import differences
from recovery.kill import ROOT, finish, make_project
from vigauge.files import write_rows

SLURM = ["--workflow-profile", str(ROOT / "profiles" / "slurm"), "--configfile", "config/smoke.yaml"]
# The plugin asks for a status after 40 s, and most jobs here are shorter. Logs tell which stage a job was.
SLURM += ["--slurm-init-seconds-before-status-checks", "5", "--slurm-keep-successful-logs"]
RESUME = [sys.executable, "-m", "vigauge_paper.commands.resume", *SLURM]


class Job(NamedTuple):
    stage: str
    state: str
    start: datetime
    end: datetime
    processors: int


def environment() -> dict[str, str]:
    return {key: value for key, value in os.environ.items() if key not in ("EUROC_ROOT", "PYTHONPATH")}


def run(project: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A run to its end."""
    return subprocess.run(
        [*RESUME, *arguments], cwd=project, env=environment(), capture_output=True, text=True, check=False
    )


def queued() -> list[str]:
    squeue = ["squeue", "--me", "--noheader", "--format", "%i"]
    return subprocess.run(squeue, capture_output=True, text=True, check=True).stdout.split()


def jobs(record: Path, project: Path) -> list[Job]:
    """Jobs that Slurm has ended, with the stage that each of them was."""
    logs = project / ".snakemake" / "slurm_logs"
    stages = {log.stem: log.parent.relative_to(logs).as_posix() for log in logs.rglob("*.log")}
    out = []
    for line in record.read_text("utf-8").splitlines():
        entry = dict(re.findall(r"(\w+)=(\S*)", line))
        times = [datetime.fromisoformat(entry[key]) for key in ("StartTime", "EndTime")]
        out.append(Job(stages.get(entry["JobId"], "?"), entry["JobState"], *times, int(entry["ProcCnt"])))
    return out


def beside_a_timed_one(done: list[Job]) -> list[str]:
    """Pairs of jobs that ran at the same time, one of them timed."""
    alone = re.compile("rule_(time_|reasons_time)")
    return [
        f"{one.stage} beside {other.stage}"
        for one, other in combinations(sorted(done, key=lambda job: job.start), 2)
        if (alone.match(one.stage) or alone.match(other.stage)) and other.start < one.end
    ]


def killed(project: Path) -> tuple[bool, str]:
    """Kill Snakemake with jobs in the queue; whether a second start leaves them alone, and its words."""
    with subprocess.Popen(RESUME, cwd=project, env=environment()) as engine:
        while not queued():
            if engine.poll() is not None:
                sys.exit(f"Snakemake ended before it had a job in the queue; the project is {project}")
            time.sleep(0.5)
        time.sleep(10.0)  # into the first stages
        engine.send_signal(signal.SIGKILL)
    before = queued()
    again = run(project)
    refused = again.returncode == 2 and "Slurm job" in again.stderr and len(again.stderr.splitlines()) == 1
    return bool(before) and refused and set(queued()) <= set(before), again.stderr.strip()


def failing(project: Path) -> tuple[bool, list[str]]:
    """A stage with bad input: whether its sentence reaches the terminal."""
    problems = project / "data" / "simulation" / "arc_plane" / "problems.npz"
    problems.write_bytes(problems.read_bytes()[:1000])
    done = run(project, "--", "data/solutions/arc_plane/solutions.csv")
    sentence = (project / "logs" / "solve" / "arc_plane.log").read_text("utf-8").splitlines()[-1]
    shown = done.stderr.splitlines()
    return done.returncode == 1 and sentence.startswith("error: ") and f"  {sentence}" in shown, shown


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--jobs", type=Path, required=True, help="JobCompLoc of this Slurm")
    arguments.add_argument(
        "--reference", type=Path, help="project in which the configuration has run locally"
    )
    arguments.add_argument("--record", type=Path, required=True, help="output: what was seen (CSV)")
    options = arguments.parse_args()
    # Where all nodes see it, which /tmp often is not.
    folder = Path(tempfile.mkdtemp(prefix="vigauge_slurm.", dir=Path.home())).resolve()
    # Copied at once: both are of the same sources, whoever edits them meanwhile.
    project, local = make_project(folder / "project"), make_project(folder / "reference")
    reference = options.reference or local
    if reference is local:
        finish(local, "smoke")

    left_alone, words = killed(project)
    sys.stderr.write(f"second start: {words}\n")
    while queued():
        time.sleep(2.0)
    whole = run(project)
    sys.stderr.write(f"{whole.stderr[-3000:]}\n")
    done = jobs(options.jobs, project)
    differ = differences(reference, project)
    beside = beside_a_timed_one(done)
    overlapping = [
        one.stage
        for one, other in combinations(sorted(done, key=lambda job: job.start), 2)
        if one.stage == other.stage and other.start < one.end
    ]
    fails, shown = failing(project)
    sys.stderr.write("\n".join([*differ, *beside, *overlapping, *shown, ""]))
    alone = sum(job.processors > 1 for job in done)
    refusal = "".join(re.findall(r"\(.*?\)", words))
    states = ", ".join(
        f"{count} {state.lower()}" for state, count in Counter(job.state for job in done).items()
    )
    found = [
        ("after a kill, jobs in the queue are left alone by the next start", left_alone, refusal),
        ("the run after that ends well", whole.returncode == 0, f"{len(done)} jobs: {states}"),
        ("no stage is in the queue twice at a time", not overlapping, f"{len(overlapping)} are"),
        ("results are those of a local run, but for times", not differ, f"{len(differ)} files differ"),
        ("no job runs beside a timed one", not beside, f"{alone} ran alone"),
        ("the sentence of a stage that fails reaches the terminal", fails, f"{len(shown)} lines"),
    ]
    names = ("check", "holds", "seen")
    write_rows(options.record, [dict(zip(names, row, strict=True)) for row in found])
    if not all(holds for _, holds, _ in found):
        sys.exit(f"not as it should be: {options.record}; the projects are in {folder}")
    shutil.rmtree(folder)


if __name__ == "__main__":
    main()
