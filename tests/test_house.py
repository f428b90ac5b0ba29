"""The house: who may import whom, what the package depends on, and what no file may name."""

import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
LIBRARY, ARTIFACT = "vigauge", "vigauge_paper"

# Top floor first. A folder (or a module beside them) imports only from floors below its own. What has no
# floor fails the test, so a new folder gets its place on purpose. The library's root is its public API.
FLOORS = (
    "vigauge_paper.workflow",
    "vigauge_paper.commands",
    "vigauge_paper.page",
    "vigauge_paper.claims",
    "vigauge_paper.comparison",
    "vigauge_paper.figures",
    "vigauge_paper.experiments",
    "vigauge_paper.stand_in",
    "vigauge_paper.fetch",
    "vigauge_paper.run",
    "vigauge_paper.no_truth",
    "vigauge_paper.tables",
    "vigauge_paper.spread",
    "vigauge_paper.prior",
    "vigauge_paper.ids",
    "vigauge_paper",
    "vigauge.cli",
    "vigauge.adapters",
    "vigauge.recordings",
    "vigauge",
    "vigauge.synthetic",
    "vigauge.covariance",
    "vigauge.observability",
    "vigauge.solver",
    "vigauge.gauge",
    "vigauge.model",
    "vigauge.sparsity",
    "vigauge.kernels",
    "vigauge.geometry",
    "vigauge.files",
    "vigauge.arrays",
    "vigauge.errors",
)

# Third-party packages that only these floors may import; the rest runs without them.
CONFINED = {
    "matplotlib": {"vigauge_paper.figures"},
    "pandas": {name for name in FLOORS if name.startswith(ARTIFACT)},
    "pycolmap": {"vigauge.recordings", "vigauge.adapters"},
    "gtsam": {"vigauge.adapters"},
    "cv2": {"vigauge.recordings", "vigauge_paper.stand_in"},
    "snakemake": set(),
    "grimp": {"vigauge_paper.workflow"},
    "numba": {"vigauge.kernels"},
    "llvmlite": {"vigauge.kernels"},
    "rosbags": {"vigauge.recordings"},
}

# Import name of a distribution where the two differ.
IMPORT_NAMES = {"opencv-python-headless": "cv2", "pillow": "PIL", "pyyaml": "yaml"}


def floor_of(module: str) -> str:
    """'vigauge.solver.residuals' lies on the floor 'vigauge.solver'; 'vigauge' on its own."""
    return ".".join(module.split(".")[:2])


def is_ours(module: str) -> bool:
    return module.split(".")[0] in (LIBRARY, ARTIFACT)


def direct_imports(graph: grimp.ImportGraph) -> Iterator[tuple[str, str]]:
    """Pairs (importer, imported), importer inside the package."""
    for importer in sorted(graph.modules):
        if is_ours(importer):
            for imported in sorted(graph.find_modules_directly_imported_by(importer)):
                yield importer, imported


def unplaced(graph: grimp.ImportGraph) -> list[str]:
    """Modules on no floor."""
    return sorted(m for m in graph.modules if is_ours(m) and floor_of(m) not in FLOORS)


def upward_imports(graph: grimp.ImportGraph) -> list[str]:
    """Imports between floors that do not go down."""
    level = {floor: -index for index, floor in enumerate(FLOORS)}
    wrong = []
    for importer, imported in direct_imports(graph):
        above, below = floor_of(importer), floor_of(imported)
        if not is_ours(imported) or above == below or not {above, below} <= level.keys():
            continue
        if level[below] >= level[above]:
            wrong.append(f"{importer} imports {imported}: {below} is not below {above}")
    return wrong


def import_circle(graph: grimp.ImportGraph) -> list[str]:
    """One circle of modules that import each other, or nothing."""
    edges: dict[str, set[str]] = defaultdict(set)
    for importer, imported in direct_imports(graph):
        edges[importer].add(imported)
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def misplaced_packages(graph: grimp.ImportGraph) -> list[str]:
    """Confined third-party packages imported from a floor that must do without them."""
    return [
        f"{importer} imports {imported}: only {sorted(CONFINED[package]) or 'nothing'} may"
        for importer, imported in direct_imports(graph)
        if (package := imported.split(".")[0]) in CONFINED and floor_of(importer) not in CONFINED[package]
    ]


def commands_that_import_commands(graph: grimp.ImportGraph) -> list[str]:
    """A command is thin: what two of them need stands below them."""
    return [
        f"{importer} imports {imported}"
        for importer, imported in direct_imports(graph)
        if floor_of(importer) == floor_of(imported) == "vigauge_paper.commands"
        and "vigauge_paper.commands" not in (importer, imported)
    ]


@pytest.fixture(scope="module")
def house() -> grimp.ImportGraph:
    return grimp.build_graph(LIBRARY, ARTIFACT, include_external_packages=True, cache_dir=None)


def graph_of(*imports: tuple[str, str]) -> grimp.ImportGraph:
    """A made-up house, to show that the checks above can fail."""
    graph = grimp.ImportGraph()
    for module in sorted({module for pair in imports for module in pair}):
        graph.add_module(module)
    for importer, imported in imports:
        graph.add_import(importer=importer, imported=imported)
    return graph


def test_every_module_has_a_floor(house: grimp.ImportGraph) -> None:
    """Catches a new module that escapes the layer check because nobody gave it a place."""
    assert {"vigauge.geometry.so3", "vigauge_paper.ids"} <= house.modules, (
        "the graph is not that of the package"
    )
    assert not unplaced(house), "name these in FLOORS"


def test_imports_only_go_down(house: grimp.ImportGraph) -> None:
    """Catches a library module that reaches up, for instance the solver importing the figures."""
    assert not upward_imports(house)


def test_no_import_circles(house: grimp.ImportGraph) -> None:
    """Catches two modules of one subpackage that import each other."""
    assert not import_circle(house)


def test_heavy_packages_stay_on_their_floors(house: grimp.ImportGraph) -> None:
    """Catches Matplotlib, pycolmap or OpenCV creeping into the numerics."""
    assert not misplaced_packages(house)


def test_no_command_imports_a_command(house: grimp.ImportGraph) -> None:
    """Catches logic that two stages share and that only one of them owns."""
    assert not commands_that_import_commands(house)


def test_pycolmap_follows_zlib(house: grimp.ImportGraph) -> None:
    """Catches an import of pycolmap that does not follow `import zlib`: PNG writing then aborts."""
    importers = [importer for importer, imported in direct_imports(house) if imported == "pycolmap"]
    assert len(importers) == 2, importers
    for importer in importers:
        text = (ROOT / "src" / importer.replace(".", "/")).with_suffix(".py").read_text(encoding="utf-8")
        assert -1 < text.find("import zlib") < text.find("import pycolmap"), importer


def test_the_checks_see_violations() -> None:
    """Catches a check that passes whatever the code does."""
    upward = graph_of(("vigauge.geometry.so3", "vigauge.model.state"))
    assert upward_imports(upward) == [
        "vigauge.geometry.so3 imports vigauge.model.state: vigauge.model is not below vigauge.geometry"
    ]
    assert upward_imports(graph_of(("vigauge.covariance.a", "vigauge_paper.figures.style")))
    assert upward_imports(graph_of(("vigauge.solver.a", "vigauge.covariance.b")))
    assert not upward_imports(
        graph_of(("vigauge.model.state", "vigauge.geometry.so3"), ("vigauge.model.a", "vigauge.model.b"))
    )
    assert commands_that_import_commands(
        graph_of(("vigauge_paper.commands.solve", "vigauge_paper.commands.tables"))
    )
    assert import_circle(
        graph_of(("vigauge.model.a", "vigauge.model.b"), ("vigauge.model.b", "vigauge.model.a"))
    )
    assert unplaced(graph_of(("vigauge.attic", "vigauge.geometry"))) == ["vigauge.attic"]
    assert misplaced_packages(graph_of(("vigauge.gauge.gauges", "matplotlib")))


# Dependencies: what is imported, declared and locked must agree.


def read_project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def read_lock() -> dict[str, list[Requirement]]:
    """Pinned requirements by canonical name."""
    pins: dict[str, list[Requirement]] = defaultdict(list)
    for line in (ROOT / "requirements.lock").read_text(encoding="utf-8").splitlines():
        if line and not line[0].isspace() and not line.startswith("#"):
            pin = Requirement(line.removesuffix("\\").strip())
            pins[canonicalize_name(pin.name)].append(pin)
    return pins


def test_imported_packages_are_declared(house: grimp.ImportGraph) -> None:
    """Catches an import that only works because another package happens to bring it."""
    project = read_project()["project"]
    extras = project["optional-dependencies"]
    library = project["dependencies"]
    assert {Requirement(line).name for line in library} == {"numpy", "scipy", "numba", "threadpoolctl"}
    allowed = {
        LIBRARY: library,
        "vigauge.recordings": library + extras["recordings"],
        "vigauge.adapters": library + extras["adapters"],
        ARTIFACT: library + extras["recordings"] + extras["paper"],
    }
    for importer, imported in direct_imports(house):
        name = imported.split(".")[0]
        place = floor_of(importer) if floor_of(importer) in allowed else importer.split(".")[0]
        declared = {canonicalize_name(Requirement(line).name) for line in allowed[place]}
        # llvmlite is part of numba.
        known = {IMPORT_NAMES.get(d, d) for d in declared} | {LIBRARY, ARTIFACT, "llvmlite"}
        assert name in known | set(sys.stdlib_module_names), f"{importer} imports {name}"


def test_lock_fits_the_project() -> None:
    """Catches a dependency added or raised in pyproject.toml without `make lock`."""
    project, pins = read_project(), read_lock()
    wanted = [*project["project"]["dependencies"], *project["build-system"]["requires"]]
    for group in project["project"]["optional-dependencies"].values():
        wanted += group
    for requirement in map(Requirement, wanted):
        if requirement.name == LIBRARY:
            continue
        locked = pins.get(canonicalize_name(requirement.name))
        assert locked, f"{requirement.name} is not in requirements.lock"
        for pin in locked:
            (version,) = pin.specifier
            assert requirement.specifier.contains(version.version), f"{pin} against {requirement}"


def test_workflow_asks_for_what_the_project_asks_for() -> None:
    """Catches an environment of the rules, or a least version of Snakemake, that was left behind."""
    extras = read_project()["project"]["optional-dependencies"]
    wanted = {*read_project()["project"]["dependencies"], *extras["recordings"], *extras["paper"]}
    # The rest is for Snakemake's own process.
    apart = {LIBRARY, "snakemake", "psutil", "grimp"}
    environment = yaml.safe_load((ROOT / "workflow/envs/vigauge.yaml").read_text("utf-8"))
    assert set(environment["dependencies"][-1]["pip"]) == {
        requirement for requirement in wanted if Requirement(requirement).name not in apart
    }
    assert f"python {read_project()['project']['requires-python']}" in environment["dependencies"]
    (snakemake,) = (requirement for requirement in wanted if requirement.startswith("snakemake"))
    least = snakemake.removeprefix("snakemake>=")
    assert f'min_version("{least}")' in (ROOT / "workflow/Snakefile").read_text("utf-8")


def test_versions_agree() -> None:
    """Catches a release that raises the version in one file and forgets the others."""
    sources = {"src/vigauge/__init__.py": r'^__version__ = "(.+)"$', "CITATION.cff": r"^version: (.+)$"}
    version = read_project()["project"]["version"]
    for name, pattern in sources.items():
        found = re.search(pattern, (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
        assert found and found[1] == version, name


def test_lock_is_pinned_hashed_and_free_of_addresses() -> None:
    """Catches a lock that names somebody's index, a local path, or a package without hashes."""
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    assert "://" not in text and " @ " not in text
    assert not re.search(r"^\s*(-[a-z]|--(?!hash=))", text, re.MULTILINE), "an option other than --hash"
    assert all(
        pin.specifier and str(pin.specifier).startswith("==") for pins in read_lock().values() for pin in pins
    )
    blocks = re.split(r"\n(?=[A-Za-z0-9])", text)[1:]
    assert blocks and all("--hash=sha256:" in block for block in blocks)


# Files: nothing may tie the repository to one machine.

TEXT_LIMIT = 2_000_000
MACHINE_BOUND = {
    "path of one machine": re.compile(
        r"(?<![\w.~$})/-])/(?:work|root|tmp|opt|home|Users|mnt|media|scratch)/\w"
    ),
    "path of one machine (Windows)": re.compile(r"\b[A-Z]:\\(?:Users|Documents)\\"),
    "package index": re.compile(
        r"(?:--(?:extra-)?index-url|--find-links|--trusted-host)\b|pypi\.org/simple|files\.pythonhosted\.org"
    ),
}


def repository_files() -> list[Path]:
    """Files that git has or would add; without git, all but what lies in hidden or made folders."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True
    )
    if listed.returncode == 0:
        names = [ROOT / name for name in listed.stdout.decode().split("\0") if name]
    else:
        tops = ("src", "tests", "workflow", "config", ".ci")
        names = [path for top in tops for path in (ROOT / top).rglob("*")] + list(ROOT.glob("*"))
    return sorted(path for path in names if path.is_file() and path.stat().st_size < TEXT_LIMIT)


def machine_bound_lines(path: Path) -> list[str]:
    """Lines of a text file that only make sense on one machine; binary files have none."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        return []
    return [
        f"{path.relative_to(ROOT)}:{number}: {what}: {line.strip()[:100]}"
        for number, line in enumerate(lines, 1)
        for what, pattern in MACHINE_BOUND.items()
        if pattern.search(line)
    ]


def test_no_file_names_a_machine() -> None:
    """Catches a home folder, a scratch path or a package index that works on one machine only."""
    files = [path for path in repository_files() if path != Path(__file__).resolve()]
    assert ROOT / "pyproject.toml" in files
    assert not [line for path in files for line in machine_bound_lines(path)]


@pytest.mark.parametrize(
    ("line", "bound"),
    [
        ("open('/home/someone/euroc')", True),
        ("EUROC_ROOT=/home/someone/data", True),
        ("cache in /tmp/vigauge", True),
        ("--extra-" + "index-url http://mirror", True),
        (r"root: C:\Users\me", True),
        ("https://example.org/home/page", False),
        ("EUROC_ROOT=/path/to/euroc make paper", False),
        ("tmp_path / 'work' / 'x'", False),
        ("../shared/home/x", False),
    ],
)
def test_machine_paths_are_recognised(line: str, bound: bool) -> None:
    """Catches patterns that miss a real path or trip over an ordinary line."""
    assert any(pattern.search(line) for pattern in MACHINE_BOUND.values()) is bound
