"""Stamps of results: what they hold, and which mixtures they let nobody make."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from vigauge.errors import DataError, MixtureError
from vigauge_paper.run.provenance import (
    Stamp,
    code_digest,
    digest_file,
    digests,
    made_with,
    read_stamp,
    require_coherent,
    write_stamp,
)

SOLVER = {"function_tolerance": 1e-6, "maximum_iterations": 50}


def make(
    folder: Path, stage: str, inputs: tuple[Path, ...] = (), content: str = "1", **changes: object
) -> Path:
    """A result of a stage with its stamp; returns the stamp's path."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.csv").write_text(content, encoding="utf-8")
    (folder / "timing.csv").write_text("0.1", encoding="utf-8")
    config = {"solver": SOLVER}
    stamp = Stamp(
        stage=stage,
        version="1",
        code="abc",
        packages={"numpy": "2.4"},
        config=config,
        labels={"name": folder.name},
        seeds=(1,),
        inputs={f"../{path.parent.name}/{path.name}": read_stamp(path).identity for path in inputs},
        sources={},
        outputs=digests([folder / "result.csv"], folder),
        timings=digests([folder / "timing.csv"], folder),
    )
    path = folder / "stamp.json"
    write_stamp(path, replace(stamp, **changes))
    return path


def test_a_stamp_survives_the_disk(tmp_path: Path) -> None:
    path = make(tmp_path / "a", "solve")
    stamp = read_stamp(path)
    assert stamp.outputs == {"result.csv": digest_file(tmp_path / "a/result.csv")}
    write_stamp(tmp_path / "b.json", stamp)
    assert (tmp_path / "b.json").read_bytes() == path.read_bytes()


def test_results_of_one_run_belong_together(tmp_path: Path) -> None:
    """Labels, inputs and times differ between results of one run."""
    problem = make(tmp_path / "problem", "simulate")
    first = make(tmp_path / "first", "solve", (problem,))
    second = make(tmp_path / "second", "solve", (problem,), content="2", timings={})
    assert set(require_coherent([first, second])) == {problem, first, second}


def test_a_key_only_one_stage_depends_on_may_differ_from_nothing(tmp_path: Path) -> None:
    """A result must not go stale by an edit of what it does not depend on."""
    first = make(tmp_path / "first", "solve")
    second = make(tmp_path / "second", "render", config={"rendered": 2}, code="other", version="1")
    require_coherent([first, second])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"config": {"solver": {**SOLVER, "function_tolerance": 1e-4}}},
            r"second.stamp.json, solver.function_tolerance: must be that of .*first.stamp.json,"
            r" which has 1e-06; .* \(found 0.0001\)",
        ),
        ({"config": {"solver": {"maximum_iterations": 50}}}, r"solver.function_tolerance: must .* has 1e-06"),
        ({"code": "other"}, r"second.stamp.json, code: must be that of"),
        ({"version": "2"}, r"second.stamp.json, version: must be that of"),
        ({"packages": {"numpy": "1.0"}}, r"packages.numpy: must be that of .*2.4.*found '1.0'"),
    ],
)
def test_results_of_two_runs_are_refused(tmp_path: Path, changes: dict, message: str) -> None:
    """Trials under two configurations, versions or packages, averaged together."""
    first = make(tmp_path / "first", "solve")
    second = make(tmp_path / "second", "solve", **changes)
    with pytest.raises(MixtureError, match=message):
        require_coherent([first, second])


def test_what_was_made_with_another_configuration_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Catches a sweep or spread of other settings beside the results, and one that is left out unsaid."""
    results, fitting = (make(tmp_path / name, "solve") for name in ("results", "fitting"))
    other = make(tmp_path / "other", "spread", config={"solver": {**SOLVER, "maximum_iterations": 7}})
    assert made_with([results], fitting, "spread") and not caplog.messages
    assert not made_with([results], other, "spread")
    assert caplog.messages[0].startswith("spread left out; make it again:")


def test_the_same_key_must_agree_between_stages(tmp_path: Path) -> None:
    first = make(tmp_path / "first", "solve")
    second = make(tmp_path / "second", "reasons", config={"solver": {}})
    with pytest.raises(MixtureError, match="solver"):
        require_coherent([first, second])


@pytest.mark.parametrize("name", ["result.csv", "timing.csv"])
def test_a_result_that_was_changed_is_refused(tmp_path: Path, name: str) -> None:
    """A file edited by hand, or copied over from another run without its stamp."""
    path = make(tmp_path / "first", "solve")
    (tmp_path / "first" / name).write_text("changed", encoding="utf-8")
    with pytest.raises(MixtureError, match=f"{name}: is not the result that .*stamp.json was written for"):
        require_coherent([path])


def test_a_result_of_other_inputs_is_refused(tmp_path: Path) -> None:
    """Solutions of an older simulation, beside the newer one."""
    problem = make(tmp_path / "problem", "simulate")
    solution = make(tmp_path / "solution", "solve", (problem,))
    covariance = make(tmp_path / "covariance", "covariance", (solution,))
    require_coherent([covariance])
    make(tmp_path / "problem", "simulate", content="another draw")
    with pytest.raises(
        MixtureError, match="solution.stamp.json: was made from another result than .*problem"
    ):
        require_coherent([covariance])


def test_another_time_is_not_another_result(tmp_path: Path) -> None:
    """Identities that contain timings would differ after every run."""
    first = make(tmp_path / "a", "solve", timings={"timing.csv": "1"})
    assert read_stamp(first).identity == replace(read_stamp(first), timings={"timing.csv": "2"}).identity
    assert read_stamp(first).identity != replace(read_stamp(first), seeds=(2,)).identity


def test_inputs_that_are_gone_do_not_matter(tmp_path: Path) -> None:
    """Intermediate files may be deleted."""
    problem = make(tmp_path / "problem", "simulate")
    solution = make(tmp_path / "solution", "solve", (problem,))
    problem.unlink()
    assert set(require_coherent([solution])) == {solution}


@pytest.mark.parametrize(
    "text", ["", "{}", "[1]", '{"stage": 1}', "\x00", '{"inputs": ', "null", '{"stage": "solve", "extra": 1}']
)
def test_what_is_no_stamp_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "stamp.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"stamp\.json: must be the stamp of a result"):
        read_stamp(path)


def test_fields_of_the_wrong_kind_are_refused(tmp_path: Path) -> None:
    path = make(tmp_path / "a", "solve")
    content = json.loads(path.read_text("utf-8"))
    path.write_text(json.dumps(content | {"outputs": ["result.csv"]}), encoding="utf-8")
    with pytest.raises(DataError, match="outputs is no object"):
        read_stamp(path)


def test_a_result_without_stamp_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="stamp of the result must exist"):
        require_coherent([tmp_path / "stamp.json"])


def test_a_folder_is_known_by_names_and_contents(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name / "deep").mkdir(parents=True)
        (tmp_path / name / "deep" / "file").write_text("x", encoding="utf-8")
    before = digest_file(tmp_path / "a")
    assert before == digest_file(tmp_path / "b")
    (tmp_path / "b" / "deep" / "file").rename(tmp_path / "b" / "file")
    assert digest_file(tmp_path / "b") != before


def test_code_is_the_same_wherever_it_lies(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "module.py").write_text("x = 1\n", encoding="utf-8")
    assert code_digest([tmp_path / "a/module.py"]) == code_digest([tmp_path / "b/module.py"])
