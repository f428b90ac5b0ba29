"""The covariance of normal equations that a test has at hand."""

from vigauge.covariance.covariance import Covariance
from vigauge.covariance.covariance import motion_pseudo_inverse as pseudo_inverse_of
from vigauge.gauge.gauges import Gauge
from vigauge.gauge.group import YawTranslation, orbit_tangent
from vigauge.geometry.so3 import Array
from vigauge.model.state import State
from vigauge.observability.spectrum import Spectrum
from vigauge.solver.normal_equations import NormalEquations
from vigauge.sparsity.layout import Index


def covariance_at(equations: NormalEquations, state: State, reference: State) -> Covariance:
    """A covariance without motion factors."""
    return Covariance(equations, state, reference, orbit_tangent(state), (), YawTranslation())


def covariance_of(equations: NormalEquations, state: State, gauge: Gauge, reference: State) -> Array:
    return covariance_at(equations, state, reference).motion(gauge)


def motion_pseudo_inverse(equations: NormalEquations, state: State) -> Array:
    return pseudo_inverse_of(covariance_at(equations, state, state))


def spectrum(equations: NormalEquations, held: Index | None = None) -> Spectrum:
    return Spectrum.of(equations.eliminate(), held)
