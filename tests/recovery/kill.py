"""Kill the pipeline at random moments, start it again as documented, and compare the results.

    python tests/recovery/kill.py --config smoke --kills 20 --seed 1 --record docs/recovery.csv

Every run starts in a fresh copy of the project. It is killed (SIGKILL to the whole process
group) after random times, each time started again by ``python -m vigauge_paper.commands.resume``, which is
what ``make paper`` does, and its results are compared with those of an undisturbed run: all
bytes, but for times. The exit status is 1 where anything differs.
"""

import argparse
import csv
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from recovery.compare import differences

ROOT = Path(__file__).resolve().parents[2]
CONFIG = {"smoke": ["--configfile", "config/smoke.yaml"], "full": []}
TIMEOUT_S = 4 * 3600


@dataclass(frozen=True)
class Kill:
    """One line of the record: when the run was killed, what it was doing, and how it ended in the end."""

    config: str
    seed: int
    kill: int
    killed_after_seconds: float
    running: str
    jobs_finished: int
    identical: bool


def make_project(folder: Path) -> Path:
    """A copy of what the workflow reads; results start empty."""
    for name in ("workflow", "config", "profiles", "src"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Snakefile", folder)
    shutil.copytree(ROOT / "data" / "published", folder / "data" / "published")
    return folder


def start(folder: Path, config: str, targets: tuple[str, ...] = ()) -> subprocess.Popen[bytes]:
    """Start, or start again: one and the same command."""
    command = [sys.executable, "-m", "vigauge_paper.commands.resume", "--cores", "2", *CONFIG[config]]
    command += ["--", *targets] if targets else []
    env = {key: value for key, value in os.environ.items() if key not in ("EUROC_ROOT", "PYTHONPATH")}
    with (folder / "run.log").open("ab") as log:
        return subprocess.Popen(command, cwd=folder, env=env, start_new_session=True, stdout=log, stderr=log)


def finish(folder: Path, config: str, targets: tuple[str, ...] = ()) -> float:
    """Run to the end; seconds that it took. Raises RuntimeError where the run fails."""
    begin = time.monotonic()
    status = start(folder, config, targets).wait(TIMEOUT_S)
    if status:
        tail = (folder / "run.log").read_text("utf-8", errors="replace")[-3000:]
        raise RuntimeError(f"a run ended with status {status}:\n{tail}")
    return time.monotonic() - begin


def kill_after(process: subprocess.Popen[bytes], seconds: float) -> bool:
    """SIGKILL to the process group of a run after some time; False where it had ended by then."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return True
    return False


def progress(folder: Path) -> tuple[str, int]:
    """Jobs that Snakemake had running when it was killed, and the number of jobs it had finished."""
    logs = sorted((folder / ".snakemake" / "log").glob("*.log"), key=lambda path: path.stat().st_mtime)
    if not logs:
        return "starting", 0
    text = logs[-1].read_text("utf-8", errors="replace")
    started = re.findall(r"^Job (\d+): (.*)$", text, flags=re.MULTILINE)
    finished = set(re.findall(r"^Finished jobid: (\d+)", text, flags=re.MULTILINE))
    running = sorted(message for job, message in started if job not in finished)
    return "; ".join(running) or "between jobs", len(finished)


def disturbed_run(
    folder: Path,
    reference: Path,
    config: str,
    seed: int,
    kills: int,
    span_s: float,
    targets: tuple[str, ...] = (),
) -> list[Kill]:
    """One run with ``kills`` kills at moments drawn over ``span_s`` seconds, and its comparison.

    Kills that come after the end are none; the run may therefore have fewer.
    """
    rng = random.Random(seed)
    moments = sorted(rng.uniform(0.0, span_s) for _ in range(kills))
    # A session starts anew after each kill: it needs its time before it gets anywhere.
    sessions = [moment - before for moment, before in zip(moments, [0.0, *moments], strict=False)]
    records = []
    for number, session in enumerate(sessions):
        seconds = max(session, 1.0)
        if not kill_after(start(folder, config, targets), seconds):
            break
        running, finished = progress(folder)
        records.append((number, seconds, running, finished))
    finish(folder, config, targets)
    found = differences(reference, folder) if not targets else _targets_differ(reference, folder, targets)
    for line in found:
        sys.stderr.write(f"seed {seed}: {line}\n")
    return [
        Kill(config, seed, number, round(seconds, 2), running, finished, not found)
        for number, seconds, running, finished in records
    ]


def _targets_differ(reference: Path, folder: Path, targets: tuple[str, ...]) -> list[str]:
    return [
        f"{name} differs"
        for name in targets
        if (reference / name).read_bytes() != (folder / name).read_bytes()
    ]


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    arguments.add_argument("--config", choices=sorted(CONFIG), required=True)
    arguments.add_argument("--kills", type=int, required=True)
    arguments.add_argument("--kills-per-run", type=int, default=5)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--record", type=Path, required=True, help="CSV that the kills are added to")
    arguments.add_argument("--reference", type=Path, help="project of an undisturbed run; else one is made")
    arguments.add_argument("--span", type=float, help="seconds over which kills are drawn; else the run's")
    options = arguments.parse_args()
    kills: list[Kill] = []
    with tempfile.TemporaryDirectory(prefix="vigauge-recovery-") as place:
        reference, span = options.reference, options.span
        if reference is None:
            reference = make_project(Path(place) / "reference")
            seconds = finish(reference, options.config)
            span = span or seconds
        seed = options.seed
        while len(kills) < options.kills:
            folder = make_project(Path(place) / f"run{seed}")
            wanted = min(options.kills_per_run, options.kills - len(kills))
            kills += disturbed_run(folder, reference, options.config, seed, wanted, span, ())
            _append(options.record, kills)
            shutil.rmtree(folder)
            seed += 1
    sys.exit(0 if all(kill.identical for kill in kills) else 1)


def _append(record: Path, kills: list[Kill]) -> None:
    """Write the record: kills of other configurations that are in it stay."""
    rows: list[dict[str, object]] = []
    if record.is_file():
        with record.open(encoding="utf-8", newline="") as stream:
            rows = [row for row in csv.DictReader(stream) if row["config"] != kills[0].config]
    rows += [asdict(kill) for kill in kills]
    with record.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(asdict(kills[0])), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
