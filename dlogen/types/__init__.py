"""The frozen data types that the stages pass to one another. Metres, radians, right-handed frames."""

from dlogen.types.arrays import Array, BoolArray, IntArray
from dlogen.types.chain import Chain, FewerSegments, Frame, Joints, Pose, Segmentation
from dlogen.types.cloud import Cloud, Dropped, Mesh, RawCloud, Source
from dlogen.types.intermediate import Intermediate
from dlogen.types.line import Basis, FittedLine, Skeleton, SortedPoints
from dlogen.types.quality import SEVERITIES, Finding, Mdtw, Quality, Residual, Severity, Uncertainty, Verdict
from dlogen.types.result import FitData

__all__ = [
    "SEVERITIES",
    "Array",
    "Basis",
    "BoolArray",
    "Chain",
    "Cloud",
    "Dropped",
    "FewerSegments",
    "Finding",
    "FitData",
    "FittedLine",
    "Frame",
    "IntArray",
    "Intermediate",
    "Joints",
    "Mdtw",
    "Mesh",
    "Pose",
    "Quality",
    "RawCloud",
    "Residual",
    "Segmentation",
    "Severity",
    "Skeleton",
    "SortedPoints",
    "Source",
    "Uncertainty",
    "Verdict",
]
