"""Gauges, scales and losses by the names that flags give them."""

from __future__ import annotations

from vigauge.errors import DataError
from vigauge.gauge.gauges import CentroidGauge, FixedGauge, FreeGauge, Gauge, KeyframeGauge
from vigauge.gauge.normals import Distance, MeanDepth
from vigauge.model.loss import LOSSES, Loss

_GAUGES: dict[str, Gauge] = {"first": FixedGauge(), "centroid": CentroidGauge(), "free": FreeGauge()}


def gauge_of(text: str) -> Gauge:
    """The gauge that ``--gauge`` names; DataError for any other word."""
    word, _, key = text.partition(":")
    if word == "keyframe" and key.isascii() and key.isdigit():
        return KeyframeGauge(int(key))
    if text not in _GAUGES:
        raise DataError("--gauge", f"must be {', '.join(_GAUGES)} or keyframe:K", value=text)
    return _GAUGES[text]


def scale_of(text: str) -> Distance | MeanDepth:
    """The scale that ``--scale`` names; DataError for any other word."""
    word, *keys = text.split(":")
    if all(key.isascii() and key.isdigit() for key in keys):
        if (word, len(keys)) == ("distance", 2):
            return Distance(int(keys[0]), int(keys[1]))
        if (word, len(keys)) == ("depth", 1):
            return MeanDepth(int(keys[0]))
    raise DataError("--scale", "must be distance:I:J or depth:K", value=text)


def loss_of(text: str) -> Loss | None:
    """The loss that ``--loss`` names, None for "none"; DataError for any other word or number."""
    if text == "none":
        return None
    word, _, delta = text.partition(":")
    try:
        return LOSSES[word](float(delta))
    except (KeyError, ValueError, DataError) as error:
        rule = "must be none, huber:D or cauchy:D, with D in sigmas above 0"
        raise DataError("--loss", rule, value=text) from error
