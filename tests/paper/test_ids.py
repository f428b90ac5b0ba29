"""Names that are written once agree with what others call the same things."""

import yaml

from support import ROOT
from vigauge.gauge.gauges import three_gauges
from vigauge.synthetic import landmarks, trajectories
from vigauge_paper.ids import CONFIGURATIONS, FIGURE7_ORDER, GAUGES, HEADLINE, POINTS, TRAJECTORIES


def test_names_are_those_of_the_library() -> None:
    """Catches a gauge, trajectory or layout that one side adds or renames."""
    assert set(GAUGES) == set(three_gauges(1.0))
    assert set(TRAJECTORIES) == set(trajectories.TRAJECTORIES)
    assert set(POINTS) == set(landmarks.LAYOUTS)


def test_configurations_are_complete() -> None:
    """Catches a figure or a configuration file that leaves one out."""
    assert len(CONFIGURATIONS) == len(TRAJECTORIES) * len(POINTS)
    assert sorted(FIGURE7_ORDER) == sorted(CONFIGURATIONS)
    schema = yaml.safe_load((ROOT / "workflow" / "schemas" / "config.schema.yaml").read_text("utf-8"))
    assert set(schema["$defs"]["configuration"]["enum"]) == set(CONFIGURATIONS)
    assert schema["$defs"]["noise_models"]["required"] == [HEADLINE]
