"""One HTML page of an estimate, with everything in it: path with ellipses, biases, chi-squares, sentences."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from ...geometry.so3 import Array
from .estimate import CHI_SQUARE_BAND, Estimate

# Ellipses hold 99 % of the errors: k^2 is that quantile of a chi-square of two degrees.
_K_SIGMA = 3.03
_WIDTH, _HEIGHT, _MARGIN = 640, 420, 46
_COLOURS = ("#b3261e", "#2e7d32", "#1f5fa8")
# Ellipses smaller than this share of the drawing are magnified, by a number that the caption says.
_LEAST_SHARE = 0.03
_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:44em;margin:2em auto;padding:0 1em;color:#222;
background:#fff}table{border-collapse:collapse}td,th{padding:.2em .8em;text-align:right;
border-bottom:1px solid #ccc}th:first-child,td:first-child{text-align:left}
.warn{background:#fff3cd;padding:.5em 1em;border-left:4px solid #d39e00}
svg{max-width:100%;height:auto}svg text{font:12px system-ui,sans-serif;fill:#444}figcaption{color:#555}"""


def page(one: Estimate) -> str:
    """The page as HTML text; it loads nothing."""
    warnings = "".join(f'<p class="warn">Warning: {escape(text)}.</p>' for text in one.warnings)
    known = "".join(f"<li>{escape(text)}</li>" for text in one.observable)
    truths = "".join(f"<li>{escape(str(truth))}</li>" for truth in one.truths)
    title = escape(f"{one.sequence}, {one.part}")
    t_s = (one.t_ns - one.t_ns[0]) * 1e-9
    bias, sigma = one.biases, one.sigma[:, 9:]
    path, magnified = _path(one)
    times = "" if magnified == 1 else f", drawn {magnified} times as large"
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{_STYLE}</style></head><body>
<h1>{title}</h1>
{warnings}
<figure>{path}<figcaption>Path from above, m. Ellipses: {_K_SIGMA:g} sigma (99 %) in the gauge
{escape(one.gauge_name)}{times}. The square is the first keyframe.</figcaption></figure>
<figure>{_series(t_s, bias[:, :3], sigma[:, :3])}<figcaption>Gyroscope bias, rad/s, over s, with one sigma:
{_legend()}.</figcaption></figure>
<figure>{_series(t_s, bias[:, 3:], sigma[:, 3:])}<figcaption>Accelerometer bias, m/s<sup>2</sup>, over s, with
one sigma: {_legend()}.</figcaption></figure>
<h2>Does the noise fit?</h2>
{_chi_squares(one)}
<h2>What is known, and what is not</h2>
<ul>{known}</ul>
<h2>Ground truth</h2>
{f"<p>Compared with, not used:</p><ul>{truths}</ul>" if truths else "<p>None in the folder.</p>"}
</body></html>
"""


def _chi_squares(one: Estimate) -> str:
    fit = one.noise
    rows = "".join(
        f"<tr><td>{kind}</td><td>{stated:.3g}</td><td>{used:.3g}</td><td>{redundancy:.0f}</td></tr>"
        for kind, stated, used, redundancy in (
            ("images", fit.at_stated.visual, fit.at_used.visual, fit.at_used.visual_redundancy),
            (
                "inertial samples",
                fit.at_stated.inertial,
                fit.at_used.inertial,
                fit.at_used.inertial_redundancy,
            ),
        )
    )
    low, high = CHI_SQUARE_BAND
    return f"""<table><tr><th>chi-square per redundancy</th><th>at 1 px, stated densities</th>
<th>at {fit.sigma_px:.2f} px, densities x {fit.density_factor:.2g}</th><th>redundancy</th></tr>{rows}</table>
<p>Near 1 the noise fits. Outside {low:g} to {high:g} sigmas are off by more than a factor of 1.4.</p>"""


def _legend() -> str:
    names = zip(_COLOURS, "xyz", strict=True)
    return ", ".join(f'<b style="color:{colour}">{axis}</b>' for colour, axis in names)


def _svg(parts: Sequence[str]) -> str:
    return f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img">{"".join(parts)}</svg>'


class _Axes:
    """From values to places on the drawing, with labelled ticks; ``equal``: one scale for both axes."""

    def __init__(self, low: Array, high: Array, *, equal: bool) -> None:
        size = np.array([_WIDTH - 2 * _MARGIN, _HEIGHT - 2 * _MARGIN], dtype=float)
        span = np.maximum(high - low, 1e-9)
        self.scale = np.full(2, np.min(size / span)) if equal else size / span
        middle = 0.5 * (low + high)
        self.low, self.high = middle - 0.5 * size / self.scale, middle + 0.5 * size / self.scale

    def at(self, xy: Array) -> Array:
        """(..., 2) pixels of the drawing."""
        place = _MARGIN + (xy - self.low) * self.scale
        place[..., 1] = _HEIGHT - place[..., 1]
        return np.asarray(place)

    def ticks(self) -> list[str]:
        out = [
            f'<rect x="{_MARGIN}" y="{_MARGIN}" width="{_WIDTH - 2 * _MARGIN}" '
            f'height="{_HEIGHT - 2 * _MARGIN}" fill="none" stroke="#999"/>'
        ]
        for axis in (0, 1):
            step = _round_step((self.high[axis] - self.low[axis]) / 5.0)
            for k in range(int(np.ceil(self.low[axis] / step)), int(np.floor(self.high[axis] / step)) + 1):
                x, y = self.at(np.where(np.arange(2) == axis, k * step, self.low))
                where = f'x="{x:.0f}" y="{y + 16:.0f}" text-anchor="middle"'
                if axis:
                    where = f'x="{x - 6:.0f}" y="{y + 4:.0f}" text-anchor="end"'
                out.append(f"<text {where}>{k * step:.3g}</text>")
        return out


def _round_step(least: float) -> float:
    """The smallest of 1, 2, 5, 10, ... times a power of ten that is not below ``least``."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= least * (1.0 - 1e-9)))


def _points(places: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def _path(one: Estimate) -> tuple[str, int]:
    """The path from above with its ellipses, and how often these are magnified."""
    xy = one.state.p_W[:, :2]
    values, vectors = np.linalg.eigh(one.keyframes[:, :2, :2])
    half = _K_SIGMA * vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    largest, span = float(np.sqrt(values.max(initial=0.0))) * _K_SIGMA, float(np.ptp(xy, axis=0).max())
    wanted = _LEAST_SHARE * span / largest if largest > 0.0 else 1.0
    magnified = round(_round_step(wanted)) if wanted > 1.0 else 1
    circle = np.linspace(0.0, 2.0 * np.pi, 33)
    ring = magnified * (half @ np.array([np.cos(circle), np.sin(circle)])).swapaxes(1, 2) + xy[:, None, :]
    axes = _Axes(ring.min(axis=(0, 1)), ring.max(axis=(0, 1)), equal=True)
    parts = axes.ticks()
    parts += [f'<polygon points="{_points(axes.at(r))}" fill="#1f5fa833" stroke="#1f5fa8"/>' for r in ring]
    parts.append(f'<polyline points="{_points(axes.at(xy))}" fill="none" stroke="#222" stroke-width="1.5"/>')
    x, y = axes.at(xy[0])
    parts.append(f'<rect x="{x - 4:.1f}" y="{y - 4:.1f}" width="8" height="8" fill="#222"/>')
    return _svg(parts), magnified


def _series(t_s: Array, values: Array, sigma: Array) -> str:
    """Three lines over time, each in a band of one sigma."""
    low, high = values - sigma, values + sigma
    axes = _Axes(np.array([t_s[0], low.min()]), np.array([t_s[-1], high.max()]), equal=False)
    parts = axes.ticks()
    for k, colour in enumerate(_COLOURS):
        ahead = np.column_stack([t_s, low[:, k]])
        back = np.column_stack([t_s, high[:, k]])[::-1]
        parts.append(f'<polygon points="{_points(axes.at(np.vstack([ahead, back])))}" fill="{colour}22"/>')
        line = _points(axes.at(np.column_stack([t_s, values[:, k]])))
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
    return _svg(parts)
