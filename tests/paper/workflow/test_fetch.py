"""The target that fetches EuRoC: from a host on this machine, and never unless it is asked for."""

import io
import json
import zipfile
from pathlib import Path

import pytest

from support.asl import write_sequence
from support.file_server import serve
from vigauge.recordings.asl.sequence import read_sequence
from vigauge_paper.fetch.sources import COLUMNS

from .conftest import make_project, snakemake

pytestmark = pytest.mark.workflow
SEQUENCES = ("MH_01_easy", "V1_01_easy")


def zip_of(members: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()


def test_target_fetches_the_configured_sequences_once(tmp_path: Path) -> None:
    """Catches a rule that cannot run, fetches anew, or whose data `make clean` would delete."""
    project = make_project(tmp_path / "project")
    flight = write_sequence(tmp_path / "flight")
    files = {str(p.relative_to(flight)): p.read_bytes() for p in flight.rglob("*") if p.is_file()}
    with serve() as host:
        host.files["/b"] = zip_of({f"room/{name}/{name}.zip": zip_of(files) for name in SEQUENCES})
        rows = [f"{name},here,{host.url('/b')}#room/{name}/{name}.zip,,," for name in SEQUENCES]
        table = "\n".join([",".join(COLUMNS), *rows]) + "\n"
        (project / "data" / "euroc_sources.csv").write_text(table)
        done = snakemake(project, "fetch_euroc")
        assert done.returncode == 0, done.stderr[-3000:]
        asked = len(host.requests)
        again = snakemake(project, "fetch_euroc")
        assert again.returncode == 0 and "Nothing to be done" in again.stderr
        assert len(host.requests) == asked
    for name in SEQUENCES:
        assert len(read_sequence(project / "data" / "euroc" / name).frames.t_ns) == 4
        record = json.loads((project / "data" / "euroc" / f"{name}.json").read_text())
        assert record["sequence"] == name
    clean = snakemake(project, "--delete-all-output", "--dry-run")
    assert "euroc" not in clean.stdout + clean.stderr.replace("fetch_euroc", "")


def test_default_target_never_fetches(tmp_path: Path) -> None:
    """Catches gigabytes asked for by `make paper`."""
    done = snakemake(make_project(tmp_path / "project"), "--dry-run", "--forceall")
    assert done.returncode == 0, done.stderr
    assert "fetch_sequence" not in done.stdout + done.stderr
