"""The DAG itself: artefacts, reruns, resumption, configuration errors."""

import csv
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.paper_time import job_records

from .conftest import make_project, snakemake

pytestmark = pytest.mark.workflow

OUT = "paper_figures"
TIMED_RULES = {"time_simulation", "time_sequences", "time_sweep", "reasons_time"}
SOLVING_ARC, SOLVING_HALL = (f"Solving {name} in three gauges" for name in ("arc_plane", "rendered_hall"))

TABLES = {
    "table1.csv": ["gauge", "parameters", "hessian_rows", "hessian_rank"],
    "table2.csv": ["configuration", "gauge", "p_rmse_m", "phi_rmse_deg", "v_rmse_mps"],
    "table3.csv": ["sequence", "source", "gauge", "p_rmse_m", "phi_rmse_deg", "v_rmse_mps"],
    "claims.csv": [
        *("id", "section", "claim", "published", "measured", "criterion"),
        *("verdict", "verdict_as_printed"),
    ],
}


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def planned_rules(output: str) -> set[str]:
    """Rules of a dry run, from its table of job counts."""
    return set(re.findall(r"^(\w+) +\d+$", output, flags=re.MULTILINE)) - {"all", "paper", "total"}


def planned(output: str) -> set[str]:
    """The same, and what its jobs say that they do."""
    return planned_rules(output) | set(re.findall(r"^Job \d+: (.+)$", output, flags=re.MULTILINE))


@pytest.mark.parametrize(("name", "columns"), TABLES.items())
def test_tables_have_the_columns_that_readers_rely_on(
    smoke_project: Path, name: str, columns: list[str]
) -> None:
    found = rows(smoke_project / "paper_figures" / name)
    assert list(found[0]) == columns
    for ending in (".md", ".tex") if name.startswith("table") else (".md",):
        assert (smoke_project / "paper_figures" / name).with_suffix(ending).stat().st_size > 0


def test_every_figure_has_both_formats_and_its_numbers(smoke_project: Path) -> None:
    """A figure without the numbers it shows cannot be checked."""
    for name in [*(f"fig{number:02d}_*" for number in range(1, 12)), "prior_reading.*", "nees.*", "biases.*"]:
        files = {file.suffix for file in (smoke_project / "paper_figures").glob(name)}
        assert {".pdf", ".png"} <= files, name
        assert files & {".csv", ".npz"}, name


def test_covariance_figures_hold_the_contract_arrays(smoke_project: Path) -> None:
    for number, keyframes in (("09", 10), ("10", None)):
        (path,) = (smoke_project / "paper_figures").glob(f"fig{number}_*.npz")
        with np.load(path) as arrays:
            for name in ("free", "transformed", "fixed"):
                size = arrays[name].shape[0]
                assert arrays[name].shape == (size, size)
                assert keyframes is None or size == 9 * keyframes
            assert arrays["relative_frobenius_same_point"] <= 1e-9
            assert 0 < arrays["relative_frobenius_converged"] < 0.05


def test_a_stand_in_is_never_called_euroc(smoke_project: Path) -> None:
    """Rendered results must not pass for EuRoC's."""
    for row in rows(smoke_project / "paper_figures" / "table3.csv"):
        assert row["source"] == "rendered"
        assert row["sequence"].startswith("rendered_")
    assert "rendered stand-in, not EuRoC" in (smoke_project / "paper_figures" / "table3.md").read_text(
        "utf-8"
    )
    environment = json.loads((smoke_project / "paper_figures" / "environment.json").read_text("utf-8"))
    assert {entry["source"] for entry in environment["sequences"].values()} == {"rendered"}


def test_nothing_runs_beside_a_timed_stage(smoke_project: Path) -> None:
    """Times that another stage on the same machine made longer."""
    spans = {
        (str(job["rule"]), float(job["starttime"]), float(job["endtime"]))
        for job in job_records(smoke_project / ".snakemake" / "metadata")
    }
    timed = [span for span in spans if span[0] in TIMED_RULES]
    assert {rule for rule, _, _ in timed} == TIMED_RULES
    for rule, begin, end in timed:
        # Files of one job are recorded a moment after each other.
        beside = [name for name, b, e in spans if b < end - 0.1 and begin < e - 0.1 and name != rule]
        assert not beside, (rule, beside)


def test_second_run_has_nothing_to_do(smoke_project: Path) -> None:
    done = snakemake(smoke_project, "--dry-run")
    assert done.returncode == 0, done.stderr
    assert not planned_rules(done.stdout + done.stderr)


@pytest.mark.parametrize(
    ("module", "reruns", "stays"),
    [
        ("vigauge/synthetic/landmarks.py", {"simulate"}, {"render"}),
        ("vigauge/recordings/frontend/pnp.py", {"front_end"}, {"simulate", SOLVING_ARC, "render"}),
        (
            "vigauge/covariance/transform.py",
            {"covariance"},
            {"simulate", "render", "front_end", "prior_sweep"},
        ),
        (
            "vigauge_paper/figures/style.py",
            {"figure_prior", "figure_orbit"},
            {"simulate", "render", "front_end", "solve"},
        ),
    ],
)
def test_editing_a_module_reruns_what_uses_it_and_no_other_rule(
    scratch_project: Path, module: str, reruns: set[str], stays: set[str]
) -> None:
    """Stale results after an edit in src/, or a whole rerun for a change of a figure."""
    with (scratch_project / "src" / module).open("a", encoding="utf-8") as stream:
        stream.write("\n# edited\n")
    done = snakemake(scratch_project, "--dry-run")
    jobs = planned(done.stdout + done.stderr)
    assert jobs, "an edit that reruns nothing leaves stale results"
    assert reruns <= jobs
    assert not jobs & stays


def test_a_touched_module_reruns_nothing(scratch_project: Path) -> None:
    """Hours of work again after a checkout, which gives files new times and the same contents."""
    for file in [*(scratch_project / "src").rglob("*.py"), *(scratch_project / "workflow").rglob("*.smk")]:
        os.utime(file)
    done = snakemake(scratch_project, "--dry-run")
    assert done.returncode == 0, done.stderr
    assert not planned(done.stdout + done.stderr)


@pytest.mark.parametrize(
    ("key", "value", "reruns", "stays"),
    [
        ("simulation.sigma_px", "1.5", {"simulate", SOLVING_ARC}, {"render", "front_end", SOLVING_HALL}),
        (
            "prior.sweep_weights",
            '["0","7","100","500","9e9","1e8"]',
            {"prior_sweep"},
            {"simulate", "solve", "front_end"},
        ),
        (
            "timing.repeats_sequence",
            "4",
            {"time_sequences"},
            {"simulate", "solve", "time_simulation", "front_end", "render"},
        ),
    ],
)
def test_editing_a_config_key_reruns_what_depends_on_it(
    scratch_project: Path, key: str, value: str, reruns: set[str], stays: set[str]
) -> None:
    section, name = key.split(".")
    config = (scratch_project / "config" / "smoke.yaml").read_text("utf-8")
    config = re.sub(rf"^  {name}: .*$\n?", "", config, flags=re.MULTILINE)
    config = re.sub(rf"^{section}:$", f"{section}:\n  {name}: {value}", config, flags=re.MULTILINE)
    (scratch_project / "config" / "smoke.yaml").write_text(config, "utf-8")
    done = snakemake(scratch_project, "--dry-run")
    jobs = planned(done.stdout + done.stderr)
    assert reruns <= jobs
    assert not jobs & stays


def test_one_table_can_be_made_alone(smoke_project: Path) -> None:
    """Table II must not need the image sequences."""
    done = snakemake(smoke_project, "--dry-run", "--forceall", "paper_figures/table2.csv")
    jobs = planned(done.stdout + done.stderr)
    assert {"simulate", SOLVING_ARC} <= jobs
    assert not jobs & {"render", "front_end", SOLVING_HALL, "prior_sweep", "time_simulation"}


def test_an_explaining_experiment_waits_for_what_it_reads_only(smoke_project: Path) -> None:
    """One that takes half a minute left to the end of the run, behind stages that it reads nothing from."""
    for name, reads in (("nees", {"simulate"}), ("reading", {"simulate", "prior_sweep"})):
        done = snakemake(smoke_project, "--dry-run", "--forceall", f"data/reasons/{name}.csv")
        assert planned_rules(done.stdout + done.stderr) == {"reasons"} | reads


def test_sensitivity_is_swept_only_when_asked_for(smoke_project: Path) -> None:
    """A default run must not take the minutes of the sweep, and the sweep must not need image sequences."""
    done = snakemake(smoke_project, "--dry-run", "--forceall")
    assert not [rule for rule in planned_rules(done.stdout + done.stderr) if rule.startswith("sensitivity")]
    done = snakemake(smoke_project, "--dry-run", "sensitivity")
    assert planned_rules(done.stdout + done.stderr) == {"sensitivity", "sensitivity_setting"}


@pytest.mark.slow
def test_windows_are_made_only_when_asked_for_and_whole(scratch_project: Path) -> None:
    """Windows in a default run, or a window without start, optimum and distances."""
    done = snakemake(scratch_project, "--dry-run", "--forceall")
    assert "windows" not in planned_rules(done.stdout + done.stderr)
    assert "hall_begin" not in done.stdout + done.stderr
    with (scratch_project / "config/smoke.yaml").open("a", encoding="utf-8") as stream:
        stream.write(
            """windows:
  rendered:
    nowhere: {sequence: hall, front_end: {keyframes: {window_start_s: 9.0, window_end_s: 12.0}}}
    crowded: {sequence: room, front_end: {keyframes: {window_end_s: 3.0, count: 500}}}
"""
        )
    done = snakemake(scratch_project, "windows")
    assert done.returncode == 0, done.stderr[-3000:]
    found = rows(scratch_project / "paper_figures" / "windows.csv")
    stopped = {row["window"]: (row["stopped_at"], row["why"]) for row in found if not row["gauge"]}
    assert {name: stage for name, (stage, _) in stopped.items()} == {
        "nowhere": "check",
        "crowded": "front-end",
    }
    assert all(why for _, why in stopped.values())
    solved = [row for row in found if row["gauge"]]
    assert {row["window"] for row in solved} == {"hall_begin", "hall_end", "room_begin"}
    for row in solved:
        assert row["source"] == "rendered" and row["stopped_at"] == "", row["why"]
        assert float(row["relative_frobenius_same_point"]) < 1e-9
        assert float(row["p_rmse_m"]) > 0 and float(row["start_p_rmse_m"]) > 0
    assert "not EuRoC" in (scratch_project / "paper_figures" / "windows.md").read_text("utf-8")
    assert rows(scratch_project / "paper_figures" / "windows_summary.csv")


def test_unusable_sequence_stops_before_the_front_end(smoke_project: Path, tmp_path: Path) -> None:
    """A solve of a recording whose check had errors; a message that names no file and no rule."""
    folder = make_project(tmp_path / "project")
    for name in ("MH_01_easy", "V1_01_easy"):
        shutil.copytree(smoke_project / "data/rendered/rendered_hall", tmp_path / "euroc" / name)
        path = tmp_path / "euroc" / name / "mav0/imu0/data.csv"
        head, *lines = path.read_text("utf-8").splitlines()
        in_g = [
            ",".join([*row[:4], *(repr(float(x) / 9.81) for x in row[4:])])
            for row in (line.split(",") for line in lines)
        ]
        path.write_text("\n".join([head, *in_g]) + "\n", "utf-8")
    target = "data/sequences/MH_01_easy/problem.npz"
    done = snakemake(folder, target, EUROC_ROOT=str(tmp_path / "euroc"))
    assert done.returncode != 0
    assert "MH_01_easy/mav0/imu0/data.csv, a: specific force must be in m/s^2" in done.stdout + done.stderr
    assert "unusable" in (folder / "logs/check/MH_01_easy.log").read_text("utf-8")
    assert not (folder / "data/checks/MH_01_easy.json").exists()
    assert not (folder / "logs/front_end").exists()


def test_ledger_comes_with_reasons_and_statistics(smoke_project: Path) -> None:
    """A verdict without its reason, or a reason for no claim."""
    folder = smoke_project / "paper_figures"
    claims = {row["id"] for row in rows(folder / "claims.csv")}
    assert len(claims) >= 20
    assert {row["id"] for row in rows(folder / "claims_why.csv")} <= claims
    assert {row["gauge"] for row in rows(folder / "claims_statistics.csv")} == {"free", "prior"}


def test_unknown_config_key_is_one_clear_error(tmp_path: Path) -> None:
    """A misspelt key must not be ignored."""
    folder = make_project(tmp_path / "project")
    done = snakemake(folder, "--dry-run", "--config", "simulation={n_trails: 3}", smoke=False)
    assert done.returncode != 0
    assert "configuration, simulation: unknown key n_trails; known keys:" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("simulation={minimum_views: 11}", "simulation.minimum_views: must not be above n_keyframes, 10"),
        ("simulation={landmark_depth_m: [8, 2]}", "simulation.landmark_depth_m: must begin with the nearest"),
        (
            "rendered={hall: {scene: {frame_spacing_min_s: 1}}}",
            "rendered.hall.scene.frame_spacing_min_s: must not be above frame_spacing_max_s",
        ),
        (
            "windows={rendered: {hall_end: {sequence: hall, front_end: {keyframes: {window_end_s: 1e-1}}}}}",
            "front-end of hall_end, keyframes.window_end_s: must lie after window_start_s",
        ),
        ("sensitivity={values: {n_trails: [3]}}", "sensitivity.values.n_trails: must be one of"),
        (
            "sensitivity={values: {minimum_views: [2, 12]}}",
            "sensitivity.values.minimum_views of 12, simulation.minimum_views: must not be above n_keyframes",
        ),
        ("figures={orbit_trial: 50}", "figures.orbit_trial: must be below n_trials, 50"),
        ("figures={path_weights: [7, 100, 500, 8]}", "figures.path_weights: must be among prior."),
    ],
)
def test_keys_that_contradict_each_other_are_found_before_any_job(
    tmp_path: Path, given: str, told: str
) -> None:
    """A configuration that the schema allows key by key, and that fails after an hour."""
    done = snakemake(make_project(tmp_path / "project"), "--dry-run", "--config", given, smoke=False)
    assert done.returncode != 0
    assert told in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


def test_numbers_of_the_command_line_are_those_of_a_file(smoke_project: Path) -> None:
    """--config that hands numbers on as text, which the schema then refuses or a stage reads otherwise."""
    given = "simulation={n_trials: 4, sigma_px: 83e-2, redraw_noise: true}"
    done = snakemake(smoke_project, "--dry-run", "--config", given)
    assert done.returncode == 0, done.stderr
    assert not planned(done.stdout + done.stderr)


def test_environment_depends_on_what_results_used(smoke_project: Path) -> None:
    """A record made anew for a key that no result depends on, or left as it was for one that some do."""
    for given, reruns in (("sensitivity={trials: 3}", False), ("reasons={yaw: {trials: 3}}", True)):
        done = snakemake(smoke_project, "--dry-run", f"{OUT}/environment.json", "--config", given)
        assert ("environment" in planned(done.stdout + done.stderr)) == reruns


def test_config_value_out_of_range_names_key_value_and_unit(tmp_path: Path) -> None:
    folder = make_project(tmp_path / "project")
    done = snakemake(folder, "--dry-run", "--config", "simulation={sigma_px: -1}", smoke=False)
    assert done.returncode != 0
    assert "simulation.sigma_px" in done.stdout + done.stderr
    assert "px" in done.stdout + done.stderr and "-1" in done.stdout + done.stderr


def test_missing_euroc_root_is_one_clear_error(tmp_path: Path) -> None:
    """A mistyped EUROC_ROOT must not fall back to the stand-in in silence."""
    folder = make_project(tmp_path / "project")
    done = snakemake(folder, "--dry-run", EUROC_ROOT=str(tmp_path / "nowhere"))
    assert done.returncode != 0
    assert (
        "nowhere" in done.stdout + done.stderr and "must be an existing folder" in done.stdout + done.stderr
    )


def test_missing_sequence_file_is_named(tmp_path: Path) -> None:
    folder = make_project(tmp_path / "project")
    (tmp_path / "euroc").mkdir()
    done = snakemake(folder, EUROC_ROOT=str(tmp_path / "euroc"))
    assert done.returncode != 0
    assert "MH_01_easy/mav0/cam0/data.csv" in done.stdout + done.stderr
    assert not (folder / "paper_figures").exists()


@pytest.mark.slow
def test_same_config_gives_the_same_bytes(tmp_path: Path, smoke_project: Path) -> None:
    """Hidden state in random numbers, file writers or thread order."""
    folder = make_project(tmp_path / "project")
    targets = [f"data/solutions/arc_random/{name}" for name in ("solutions.csv", "trace.csv", "states.npz")]
    targets += ["data/simulation/arc_random/problems.npz", "data/covariance/arc_random.npz"]
    targets += [f"data/reasons/{file.name}" for file in (smoke_project / "data" / "reasons").iterdir()]
    assert "data/reasons/weights.csv" in targets and "data/reasons/reading.csv" in targets
    done = snakemake(folder, *targets)
    assert done.returncode == 0, done.stderr[-3000:]
    for target in targets:
        assert (folder / target).read_bytes() == (smoke_project / target).read_bytes(), target


def test_ledger_judged_again_is_the_same_bytes(tmp_path: Path, smoke_project: Path) -> None:
    """Hidden state in the ledger, such as a bootstrap that is not seeded: same files, same verdicts."""
    again = shutil.copytree(smoke_project, tmp_path / "project", symlinks=True)
    names = ["claims.csv", "claims_why.csv", "claims_statistics.csv", "comparison.csv", "index.html"]
    targets = [f"{OUT}/index.html", f"{OUT}/comparison.csv"]
    done = snakemake(again, *targets, "--forcerun", "claims", "comparison", "index")
    assert done.returncode == 0, done.stderr[-3000:]
    assert "Judging the paper's claims" in done.stdout + done.stderr
    for name in names:
        assert (again / OUT / name).read_bytes() == (smoke_project / OUT / name).read_bytes(), name


def test_links_of_the_ledger_lead_to_files(smoke_project: Path) -> None:
    text = (smoke_project / OUT / "claims.md").read_text("utf-8")
    links = set(re.findall(r"\]\(([^)]+)\)", text))
    assert len(links) > 20
    assert not [link for link in links if not (smoke_project / OUT / link).is_file()]


def test_published_numbers_stand_beside_ours(smoke_project: Path) -> None:
    """A comparison that leaves an artefact out, or sets a stand-in beside EuRoC's numbers."""
    found = rows(smoke_project / OUT / "comparison.csv")
    columns = ["artefact", "case", "gauge", "quantity", "published", "ours", "low", "high", "ratio"]
    assert list(found[0]) == [*columns, "inside_our_range"]
    artefacts = {"table2", "fig04", "fig05", "fig06", "fig07", "fig09", "times"}
    assert {row["artefact"] for row in found} == artefacts


def test_report_builds_with_every_caption(smoke_project: Path) -> None:
    done = snakemake(smoke_project, "--report", "report.html")
    assert done.returncode == 0, done.stderr[-3000:]
    report = (smoke_project / "report.html").read_text("utf-8")
    assert len(report) > 100_000
    # What the list of the report says of a figure.
    for words in ('"result": "Figure 9"', '"shows": "covariance simulation"', '"source": "rendered"'):
        assert words in report
    # The page with the evidence opens inside the report: it is there as HTML.
    start = report.index('"paper_figures/index.html": {')
    assert re.search(r'"mime_type": "text/html".*?"data_uri": "data:text/html', report[start : start + 4000])


def of_euroc(folder: Path) -> Path:
    """The record says that what stands there is EuRoC's; the path of the record."""
    path = folder / "paper_figures" / "source.json"
    record = json.loads(path.read_text("utf-8"))
    shows = {file: build for file, build in record.items() if "claims" in build}
    assert len(shows) > 15 and {build["claims"] for build in shows.values()} == {"rendered"}
    made = {"source": "euroc", "claims": "euroc", "published": True, "trials": 4}
    path.write_text(json.dumps(record | dict.fromkeys(shows, made)), "utf-8")
    return path


@pytest.mark.slow
def test_results_of_another_source_are_not_replaced_unasked(scratch_project: Path) -> None:
    """Stand-ins in the place of EuRoC's results, because EUROC_ROOT was not set in this terminal."""
    record = of_euroc(scratch_project)
    table = scratch_project / "paper_figures" / "table3.csv"
    table.write_text("of EuRoC", "utf-8")
    os.utime(scratch_project / "data" / "published" / "table3.csv")
    told = "show the paper's EuRoC sequences, and {} would replace them by rendered stand-ins: set EUROC_ROOT"
    looked = snakemake(scratch_project, "--dry-run")
    assert looked.returncode == 0 and told.format("a build of everything") in looked.stdout + looked.stderr
    refused = snakemake(scratch_project)
    assert refused.returncode != 0 and told.format("this run") in refused.stderr
    assert "--config replace_other_source=True" in refused.stderr
    assert "Traceback" not in refused.stderr
    assert table.read_text("utf-8") == "of EuRoC"
    # What shows no sequence is made as ever.
    others = snakemake(scratch_project, "--force", "paper_figures/table1.csv")
    assert others.returncode == 0, others.stderr[-3000:]
    leave = ("--config", "replace_other_source=True")
    done = snakemake(scratch_project, "--force", "paper_figures/table3.csv", *leave)
    assert done.returncode == 0, done.stderr[-3000:]
    assert {row["source"] for row in rows(table)} == {"rendered"}
    builds = {file: build.get("claims") for file, build in json.loads(record.read_text("utf-8")).items()}
    assert {file for file, source in builds.items() if source == "rendered"} == {
        f"paper_figures/table3.{ending}" for ending in ("csv", "md", "tex")
    }


def test_results_of_more_trials_are_not_replaced_unasked(scratch_project: Path) -> None:
    """A smoke run over finished results of 50 trials; and more trials, which need no leave."""
    target = "paper_figures/table2.csv"
    before = (scratch_project / target).read_bytes()
    refused = snakemake(scratch_project, target, "--config", "simulation={n_trials: 3}")
    (sentence,) = [line for line in refused.stderr.splitlines() if "this run would" in line]
    assert (
        refused.returncode != 0
        and "are of 4 trials, and this run would replace them by those of 3" in sentence
    )
    assert "--directory FOLDER" in sentence and "--config replace_other_source=True" in sentence
    assert (scratch_project / target).read_bytes() == before
    for trials, *leave in ((3, "replace_other_source=True"), (5,)):
        given = ("--config", f"simulation={{n_trials: {trials}}}", *leave)
        done = snakemake(scratch_project, target, *given)
        assert done.returncode == 0, done.stderr[-3000:]
        record = json.loads((scratch_project / "paper_figures" / "source.json").read_text("utf-8"))
        assert record[target] == {"trials": trials}


@pytest.mark.slow
def test_report_speaks_of_what_it_shows(scratch_project: Path) -> None:
    """Captions of stand-ins under EuRoC's results, where the report is made without EUROC_ROOT."""
    words = "Rendered stand-in, not EuRoC"
    for change, told in ((lambda folder: None, True), (of_euroc, False)):
        change(scratch_project)
        done = snakemake(scratch_project, "--report", "report.html")
        assert done.returncode == 0, done.stderr[-3000:]
        assert (words in (scratch_project / "report.html").read_text("utf-8")) == told


def test_record_that_is_none_is_refused(scratch_project: Path) -> None:
    (scratch_project / "paper_figures" / "source.json").write_text('{"table3.csv": 1}', "utf-8")
    done = snakemake(scratch_project)
    assert done.returncode != 0 and "must be the record of a build" in done.stderr


@pytest.mark.slow
def test_snakefile_in_another_folder_makes_the_same(smoke_project: Path, tmp_path: Path) -> None:
    """Configuration and published numbers looked up where the results go; a folder's name with a space."""
    results = tmp_path / "my results"
    target = "paper_figures/table1.csv"
    arguments = ("--directory", str(results), "-s", str(smoke_project / "Snakefile"))
    smoke = ("--configfile", str(smoke_project / "config" / "smoke.yaml"))
    planned = snakemake(tmp_path, *arguments, *smoke, "--dry-run", smoke=False)
    assert planned.returncode == 0, planned.stdout[-3000:] + planned.stderr[-3000:]
    done = snakemake(tmp_path, *arguments, target, *smoke, smoke=False)
    assert done.returncode == 0, done.stderr[-3000:]
    assert (results / target).read_bytes() == (smoke_project / target).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["module://matplotlib_inline.backend_inline", "no_such_backend", "tkagg"])
def test_figures_are_drawn_whatever_a_notebook_says(
    smoke_project: Path, tmp_path: Path, backend: str
) -> None:
    """Matplotlib that stops while it is loaded, before there is a log."""
    data = smoke_project / "data" / "simulation"
    command = [sys.executable, "-m", "vigauge_paper.commands.figure_scenes", "--names", "sine_plane"]
    command += ["--truths", str(data / "sine_plane" / "truth.npz"), "--paths"]
    command += [str(data / "sine_plane" / "path.csv"), "--output", str(tmp_path / "scene.png")]
    environment = dict(os.environ) | {"MPLBACKEND": backend, "PYTHONPATH": str(smoke_project / "src")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "scene.png").is_file()


def test_standard_entry_makes_the_same(smoke_project: Path) -> None:
    """An entry at workflow/Snakefile, where the standard layout has it, that makes nothing."""
    jobs = [
        planned_rules(done.stdout + done.stderr)
        for entry in ("Snakefile", "workflow/Snakefile")
        for done in [snakemake(smoke_project, "--dry-run", "--forceall", "--snakefile", entry)]
    ]
    assert jobs[0]
    assert jobs[0] == jobs[1]


MODULE = """
configfile: "{project}/config/config.yaml"
module paper:
    snakefile: "{project}/workflow/Snakefile"
    config: config
    prefix: "vi"
use rule * from paper as paper_*
rule all:
    default_target: True
    input: rules.paper_all.input
"""


@pytest.mark.slow
def test_as_a_module_of_another_workflow_it_makes_the_same(smoke_project: Path, tmp_path: Path) -> None:
    """Paths that are spelt where a module's prefix does not reach, or that depend on the working folder."""
    (tmp_path / "Snakefile").write_text(MODULE.replace("{project}", str(smoke_project)), "utf-8")
    smoke = ("--configfile", str(smoke_project / "config" / "smoke.yaml"))
    whole = snakemake(tmp_path, "--dry-run", *smoke, smoke=False)
    # Names in a list are without the module's prefix: what takes a moment would then be a job of the cluster.
    assert "localrules" not in whole.stdout + whole.stderr
    ours = snakemake(smoke_project, "--dry-run", "--forceall")
    named = {f"paper_{rule}" for rule in planned_rules(ours.stdout + ours.stderr)}
    assert planned_rules(whole.stdout + whole.stderr) - {"paper_all"} == named, whole.stderr[-3000:]
    targets = [f"{OUT}/table1.csv", f"{OUT}/fig03_scenes.csv"]
    done = snakemake(tmp_path, *(f"vi/{target}" for target in targets), *smoke, smoke=False)
    assert done.returncode == 0, done.stderr[-3000:]
    for target in targets:
        assert (tmp_path / "vi" / target).read_bytes() == (smoke_project / target).read_bytes()
