"""All kinds of findings: code, severities, what each means and what to do about it. One entry here adds one.

The stages make their findings with these constants (`GAP.found(...)`, `GAP.at(...)`) and recognise them by
`GAP.matches(finding)`. `dlogen explain` and the table in the README of this folder come from here. Importing this
module must not import numpy: `dlogen explain` need not wait for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, TypeVar

if TYPE_CHECKING:
    from dlogen.types import Finding, Severity, Skeleton

#: The commands whose outputs hold a code.
Where = Literal["fit", "sequence", "batch"]


@dataclass(frozen=True)
class Explanation:
    """What a code in the outputs says.

    Attributes:
        code: stable identifier, for scripts.
        where: the command whose outputs hold it; `dlogen batch` and `dlogen sequence` hold those of their fits as well.
        meaning: one sentence.
        what_to_do: one or more sentences.
        severities: that it can have, from the mildest to the gravest; empty for reasons and failures, which have none.
    """

    code: str
    where: Where
    meaning: str
    what_to_do: str
    severities: tuple[Severity, ...] = ()

    def to_dict(self) -> dict[str, str | list[str]]:
        """As `dlogen explain --json` prints it."""
        return {
            "code": self.code,
            "where": self.where,
            "severities": list(self.severities),
            "meaning": self.meaning,
            "what_to_do": self.what_to_do,
        }


_Some = TypeVar("_Some", bound=Explanation)


def declared(table: dict[str, _Some], item: _Some) -> _Some:
    """Put an explanation into a table of them, by its code.

    Raises:
        ValueError: the code is in it already.
    """
    if item.code in table:
        raise ValueError(f"the code {item.code!r} is declared twice")
    table[item.code] = item
    return item


@dataclass(frozen=True)
class FindingKind(Explanation):
    """A kind of finding about a cloud or its chain, which makes findings of this kind."""

    def found(
        self,
        message: str,
        severity: Severity | None = None,
        *,
        s: float | None = None,
        position: tuple[float, float, float] | None = None,
    ) -> Finding:
        """A finding of this kind.

        Args:
            message: one sentence with the figures of this case.
            severity: one of those of this kind; may be left out where there is only one.
            s: coordinate on the line that it is at, in [0, 1], if any.
            position: its place in space, metres, if any.

        Raises:
            ValueError: this kind does not have the severity, or has several and none was named.
        """
        # Imported here, since it imports numpy.
        from dlogen.types import Finding

        if severity is None and len(self.severities) == 1:
            severity = self.severities[0]
        if severity is None or severity not in self.severities:
            raise ValueError(f"a finding {self.code!r} is one of {', '.join(self.severities)}, not {severity}")
        return Finding(self.code, message, severity, s, position)

    def at(self, line: Skeleton, s: float, message: str, severity: Severity | None = None) -> Finding:
        """A finding of this kind at a coordinate of the line, with its place in space; otherwise as `found`."""
        x, y, z = (float(value) for value in line(s))
        return self.found(message, severity, s=s, position=(x, y, z))

    def matches(self, finding: Finding) -> bool:
        """Whether a finding is of this kind."""
        return finding.code == self.code


_declared: dict[str, FindingKind] = {}

#: All kinds of findings by their codes, in the order of what they are about.
REGISTRY: Mapping[str, FindingKind] = MappingProxyType(_declared)


def _kind(code: str, severities: tuple[Severity, ...], meaning: str, what_to_do: str) -> FindingKind:
    """Declare a kind of finding."""
    return declared(_declared, FindingKind(code, "fit", meaning, what_to_do, severities))


# Whether the cloud is one open line.

NOT_A_LINE = _kind(
    "not-a-line",
    ("doubtful", "bad"),
    "The cloud is not that of a line alone: much of it is no line, or the object is hardly longer than it is wide.",
    "Leave only the object in the cloud, without table, background and fixtures (dlogen extract cuts it out of a "
    "scene), and check r and units.",
)
SEVERAL_OBJECTS = _kind(
    "several-objects",
    ("bad",),
    "Another object is in the cloud, beside the one that the chain follows.",
    "Leave one object in the cloud, or make a cloud of each of them.",
)
BRANCH = _kind(
    "branch",
    ("bad",),
    "A branch leaves the line, or strands run into one another: a chain has no branches.",
    "Cut the branch out of the cloud and make a chain of it by itself. If there is none, give r, so that strands that "
    "lie close together are told apart.",
)
CLOSED_RING = _kind(
    "closed-ring",
    ("doubtful", "bad"),
    "The object is a closed ring, or its two ends face each other as those of a ring with a gap do; a chain needs two "
    "ends.",
    "If it is a ring, cut a short stretch out of the cloud where the chain is to begin. If it is open, capture it with "
    "its ends apart.",
)
TOO_FEW_POINTS = _kind(
    "too-few-points",
    ("doubtful",),
    "There are so few points that their order along the object is uncertain.",
    "Capture the object from nearer or with a higher resolution, or keep more of the points.",
)
UNITS = _kind(
    "units",
    ("note", "doubtful", "bad"),
    "The object is thicker, longer or shorter than cables are (other units?); a note says what auto took.",
    "Set units to what the numbers of the cloud are (m, cm or mm). If they are right, give r, the radius in metres.",
)
FEW_DIGITS = _kind(
    "few-digits",
    ("note", "doubtful", "bad"),
    "The numbers have too few digits so far from the origin: their steps are large beside the object.",
    "Export the cloud with double precision, or subtract the survey offset before it is stored in single precision. "
    "What was rounded away cannot be found again.",
)
COARSE_GRID = _kind(
    "coarse-grid",
    ("note", "doubtful"),
    "The points lie on a grid, as centres of voxels do: if it is coarse, the object seems thicker than it is.",
    "Thin the cloud out with smaller voxels, or keep the mean of the points of each voxel in place of its centre; or "
    "give r.",
)
MESH_SAMPLED = _kind(
    "mesh-sampled",
    ("note",),
    "The file is a mesh whose vertices do not cover its surface: points spread over its faces were used.",
    "Nothing. To use the vertices, set mesh to vertices.",
)

# Where the line is a guess.

GAP = _kind(
    "gap",
    ("note", "doubtful", "bad"),
    "A stretch without points, or a bend with hardly any, was bridged: the line is a guess there.",
    "See whether the line takes the right way there (--plot). If not, capture what is hidden, or make a cloud of "
    "several views. If so, give bridge (or length), and the gap is a note.",
)
CROSSING = _kind(
    "crossing",
    ("note", "doubtful"),
    "The object crosses or touches itself; where this is doubtful, its strands may have been mixed up.",
    "See whether the line stays on its strand there (--plot). If not, capture the object with its strands farther "
    "apart, or from a side that shows both.",
)
SIDE_BY_SIDE = _kind(
    "side-by-side",
    ("doubtful",),
    "Two strands lie side by side and may have been mixed up; or the object is not round, which looks the same.",
    "Give r, the radius of one strand, so that they are told apart, or capture the object with its strands apart. An "
    "object that is not round, such as a flat cable, gets a round model.",
)
NOT_ROUND = _kind(
    "not-round",
    ("doubtful",),
    "The cross-sections are oval or flat, and the model is round: its axis and radius are off where only one side was "
    "seen.",
    "If the object is round, see whether views of it are out of register, or a strip of what it lies on was left in "
    "the cloud. If it is oval or flat, take width and thickness from the message.",
)
END_CUT_OFF = _kind(
    "end-cut-off",
    ("note", "doubtful"),
    "An end is not square, as where the view or a crop cuts through an object: it may go on there.",
    "Nothing if it is a note, as where one side was seen less far than the other, whose edge is square. Otherwise "
    "capture all of the object, or crop it squarely where the chain is to end.",
)
END_NOT_SEEN = _kind(
    "end-not-seen",
    ("note", "doubtful"),
    "The object may go on beyond an end, along the view, behind another strand or outside of the image.",
    "The length is a lower bound. Capture the end from another side, or all of it. If the length of the "
    "object is known, give length: where the "
    "line is as long, this is a note.",
)
CURVATURE_UNCERTAIN = _kind(
    "curvature-uncertain",
    ("note",),
    "The largest curvature, which decides the segment length by Eq. 17, is not known well.",
    "Give segmentation.min_bend_radius if the segment length is to follow Eq. 17; the default, the fewest segments "
    "within e_max, goes by measured deviations instead.",
)

# Points that are no part of the tube.

STRAY_POINTS = _kind(
    "stray-points",
    ("note", "doubtful"),
    "Points that do not lie around the line were left out.",
    "See what they are: noise needs nothing, but if they are part of the object, check r, and if they are a table or a "
    "gripper, take them out of the cloud.",
)
POINTS_NOT_REACHED = _kind(
    "points-not-reached",
    ("doubtful", "bad"),
    "The line misses some of the points along the object: there are strays, a branch, a gap or a second object.",
    "See where the line ends (--plot) and leave only the object in the cloud. With profile: paper, try a larger r_n, "
    "or profile: refined.",
)
LEFT_OVER = _kind(
    "left-over",
    ("doubtful",),
    "Points that lie together, as dense as those of the object, are not on the line: a tip that it does not reach, or "
    "something else.",
    "See what is there (--plot): if it is part of the object, capture what is between it and the rest; if not, take it "
    "out of the cloud.",
)
POINTS_OFF_THE_TUBE = _kind(
    "points-off-the-tube",
    ("doubtful", "bad"),
    "Many points around the line are not on a tube of this radius: the cloud is something else, or the fit failed.",
    "Check r and units, and take out of the cloud what touches the object.",
)
NOISE = _kind(
    "noise",
    ("note", "doubtful"),
    "The points scatter about the surface, by more than 1 % of the radius; from half of it on, this is doubtful.",
    "Nothing if it is a note. If it is doubtful, give r, and capture the object from nearer or average several "
    "captures.",
)

UNEVEN_SURFACE = _kind(
    "uneven-surface",
    ("note",),
    "Neighbouring points are off the tube by the same: the surface has a pattern, or the sensor smooths its noise.",
    "Nothing, if the object is wound, braided or corrugated, but its radius is then one between the least and the "
    "largest. Of a coiled cord the model is that of the whole cord, not of its wire.",
)
STRAND = _kind(
    "strand",
    ("note",),
    "The depth scatters by about as much as the object is thick, so that only its width shows.",
    "Nothing: the axis was fitted to the middle of the strip and put behind it. A radius that is given makes the "
    "model better.",
)
SIDE_UNKNOWN = _kind(
    "side-unknown",
    ("doubtful",),
    "The object was seen from one side, and nothing tells which: the line stays in the surface that was seen.",
    "The axis is up to a radius away. Keep the sensor's position in the file (VIEWPOINT of PCD), or give the "
    "cloud in the frame of the camera.",
)
POSITION_UNCERTAIN = _kind(
    "position-uncertain",
    ("doubtful",),
    "The line is known to no better than a radius somewhere, as far as the noise tells.",
    "Capture the object from nearer, average several captures, or give r.",
)

# The radius.

RADIUS_UNKNOWN = _kind(
    "radius-unknown",
    ("doubtful",),
    "The points do not tell the radius: the one in the model is a guess.",
    "Measure the object and give r, half of its diameter, in metres.",
)
RADIUS_MISMATCH = _kind(
    "radius-mismatch",
    ("doubtful",),
    "The points contradict the radius: they are nearer to the line or farther from it, or their cross-sections have "
    "another one.",
    "Check r, which is half of the diameter, in metres whatever the units of the cloud are; or leave it at auto.",
)
RADIUS_VARIES = _kind(
    "radius-varies",
    ("note", "doubtful"),
    "The object is clearly thicker or thinner in places; the model has one radius.",
    "Nothing if it is a note: plugs at the ends, connectors along it, a corrugated hose. Otherwise take "
    "connectors, clips and tape out of the cloud, or give r to say which "
    "radius the model is to have.",
)
BEND_TIGHTER_THAN_RADIUS = _kind(
    "bend-tighter-than-radius",
    ("bad",),
    "The line bends more tightly than a tube of this radius can.",
    "Check r and units, and see whether the line jumps from one strand to another there (--plot).",
)

# What was asked for.

DEVIATION_ABOVE_E_MAX = _kind(
    "deviation-above-e_max",
    ("doubtful",),
    "The chain is farther from the line than e_max: its segments are as they were asked for, and too long for that.",
    "Ask for more or shorter segments, leave the settings in segmentation at auto, or allow a larger e_max.",
)
LENGTH_MISMATCH = _kind(
    "length-mismatch",
    ("doubtful",),
    "The line is longer or shorter than the known length that was given (by more than 3 %).",
    "If it is shorter, a part of the object is not in the cloud or was left out; if it is longer, the line takes in "
    "something else (--plot). Check length and units, which are metres for length whatever the cloud has.",
)
SETTINGS_NOT_USED = _kind(
    "settings-not-used",
    ("note",),
    "Settings of profile: paper were given that the refined profile has no use for.",
    "Leave them out, or set profile: paper.",
)
