"""Types of the public names; at run time __init__.py loads each when first asked for."""

from typing import Literal

from .covariance.calibration import Nees as Nees
from .covariance.calibration import nees as nees
from .covariance.calibration import sandwich as sandwich
from .covariance.covariance import Covariance as Covariance
from .covariance.covariance import keyframe_covariances as keyframe_covariances
from .covariance.covariance import landmark_covariances as landmark_covariances
from .covariance.covariance import motion_covariance as motion_covariance
from .covariance.ellipsoids import Ellipsoids as Ellipsoids
from .covariance.ellipsoids import ellipsoids as ellipsoids
from .covariance.estimate import EstimateCovariance as EstimateCovariance
from .covariance.foreign import covariance_from_hessian as covariance_from_hessian
from .covariance.projection import project_covariance as project_covariance
from .covariance.relative import MahalanobisTest as MahalanobisTest
from .covariance.relative import RelativePose as RelativePose
from .covariance.transform import transform_covariance as transform_covariance
from .errors import DataError as DataError
from .errors import DegenerateError as DegenerateError
from .errors import IndefiniteError as IndefiniteError
from .errors import MissingExtraError as MissingExtraError
from .errors import OutputError as OutputError
from .errors import SolverError as SolverError
from .errors import VigaugeError as VigaugeError
from .gauge.gauges import CentroidGauge as CentroidGauge
from .gauge.gauges import FixedGauge as FixedGauge
from .gauge.gauges import FreeGauge as FreeGauge
from .gauge.gauges import Gauge as Gauge
from .gauge.gauges import KeyframeGauge as KeyframeGauge
from .gauge.gauges import PriorGauge as PriorGauge
from .gauge.group import Euclidean as Euclidean
from .gauge.group import Group as Group
from .gauge.group import Similarity as Similarity
from .gauge.group import YawTranslation as YawTranslation
from .gauge.group import orbit_tangent as orbit_tangent
from .gauge.layout import Layout as Layout
from .gauge.layout import null_space as null_space
from .gauge.normals import Distance as Distance
from .gauge.normals import MeanDepth as MeanDepth
from .gauge.normals import gauge_normal as gauge_normal
from .gauge.normals import normal_from as normal_from
from .geometry.camera import Camera as Camera
from .geometry.charts import as_convention as as_convention
from .model.archive import load_problems as load_problems
from .model.archive import save_problems as save_problems
from .model.evaluation import TrajectoryErrors as TrajectoryErrors
from .model.evaluation import relative_frobenius as relative_frobenius
from .model.evaluation import trajectory_errors as trajectory_errors
from .model.factors import BiasPrior as BiasPrior
from .model.factors import LinearFactor as LinearFactor
from .model.factors import MotionFactor as MotionFactor
from .model.imu import ImuNoise as ImuNoise
from .model.imu import ImuSamples as ImuSamples
from .model.imu import Preintegrated as Preintegrated
from .model.imu import preintegrate as preintegrate
from .model.loss import Cauchy as Cauchy
from .model.loss import Huber as Huber
from .model.problem import InertialFactors as InertialFactors
from .model.problem import Problem as Problem
from .model.state import State as State
from .model.trajectory import Trajectory as Trajectory
from .model.trajectory_files import load_trajectory as load_trajectory
from .model.trajectory_files import save_trajectory as save_trajectory
from .observability.audit import Concern as Concern
from .observability.audit import audit as audit
from .observability.diagnosis import Diagnosis as Diagnosis
from .observability.diagnosis import Direction as Direction
from .observability.diagnosis import diagnose as diagnose
from .observability.diagnosis import diagnose_hessian as diagnose_hessian
from .solver.levenberg_marquardt import Iteration as Iteration
from .solver.levenberg_marquardt import Options as Options
from .solver.levenberg_marquardt import Solution as Solution
from .solver.levenberg_marquardt import Status as Status
from .solver.levenberg_marquardt import solve as solve
from .solver.reintegration import reintegrate as reintegrate
from .solver.reintegration import solve_with_samples as solve_with_samples

__version__: str

def example_problem(biases: Literal["known", "estimated"] = "known") -> Problem: ...
