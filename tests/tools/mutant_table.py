"""Mistakes that the tests have to notice: the table that `mutants.py` goes through.

Each is a slip that a refactoring could make and that neither an import nor a type checker would show. None is
equivalent to what it stands for: the phrase says what comes out wrong. When the code changes, a row has to follow it
(`mutants.py` stops where the old text is not there once), and its kind of mistake has to stay.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One mistake.

    Attributes:
        name: to call it by.
        module: the file, below `dlogen/`.
        old: text that stands there exactly once.
        new: what it becomes.
        breaks: what comes out wrong, in one phrase.
    """

    name: str
    module: str
    old: str
    new: str
    breaks: str


#: Rows that belong together, torn apart where stages and files are put together.
GLUE = (
    Mutant(
        "glue-normals-reversed",
        "stages/prepare.py",
        "normals=None if cloud.normals is None else cloud.normals[used],",
        "normals=None if cloud.normals is None else cloud.normals[used][::-1],",
        "each point has the normal of another",
    ),
    Mutant(
        "glue-normals-of-far-points",
        "stages/prepare.py",
        "else cloud.normals[near]",
        "else cloud.normals[: len(near)]",
        "behind the first point that is left out, normals are those of the point before",
    ),
    Mutant(
        "glue-dump-sorted",
        "stages/paper/line.py",
        'Intermediate("sorted", reached, {"s": walk.s}',
        'Intermediate("sorted", reached, {"s": walk.s[::-1]}',
        "the dump's coordinates run the other way than its points",
    ),
    Mutant(
        "glue-dump-tube",
        "stages/refined/line.py",
        '{"s": s[along], "residual": residual[along]}',
        '{"s": s[along], "residual": residual[on_tube]}',
        "the dump's residuals are in the order of the file, its points in that of the object",
    ),
    Mutant(
        "glue-mdtw-columns",
        "io/dump.py",
        "result.mdtw.s, result.mdtw.error, result.mdtw.path",
        "result.mdtw.error, result.mdtw.s, result.mdtw.path",
        "mdtw.csv has errors under s, and s under error",
    ),
    Mutant(
        "glue-deviation-rolled",
        "sequence/shared_model.py",
        "deviation[good] = deviations(shape, fitted, links)",
        "deviation[good] = np.roll(deviations(shape, fitted, links), 1)",
        "each capture has the error of the one before",
    ),
    Mutant(
        "glue-contact-side",
        "stages/quality/contacts.py",
        "s=float(s[group[:, 0]].mean() / s[-1])",
        "s=float(s[group[:, 1]].mean() / s[-1])",
        "a contact is reported at its second strand",
    ),
)

#: Over the whole of the package.
MUTANTS = (
    Mutant(
        "config-zero-allowed",
        "config/fields.py",
        "number <= self.above",
        "number < self.above",
        "r: 0 and e_max: 0 are accepted",
    ),
    Mutant(
        "config-units-swapped",
        "config/rules.py",
        '{"mm": 1e-3, "cm": 1e-2}',
        '{"mm": 1e-2, "cm": 1e-3}',
        "the hint at a length in the cloud's units is wrong by a factor of ten",
    ),
    Mutant(
        "types-position-axes",
        "types/quality.py",
        "(position[0], position[1], position[2])",
        "(position[0], position[2], position[1])",
        "findings that are read again lie elsewhere",
    ),
    Mutant(
        "geometry-gimbal-lock",
        "geometry/rotations.py",
        "math.atan2(s * rotation[0, 2] - c * rotation[1, 2], c * rotation[1, 1] - s * rotation[0, 1])",
        "math.atan2(rotation[2, 1], rotation[2, 2])",
        "the roll of the textbook, which a pitch of 90 degrees leaves to rounding",
    ),
    Mutant(
        "geometry-quaternion-sign",
        "geometry/rotations.py",
        "q[0] = rotation[m, j] - rotation[j, m]",
        "q[0] = rotation[j, m] - rotation[m, j]",
        "rotations by more than about 120 degrees turn the other way",
    ),
    Mutant(
        "stages-frame-angle-order",
        "stages/output_frame.py",
        'hinges(("z", "y", "x"), np.array([settings.yaw, settings.pitch, settings.roll]))',
        'hinges(("x", "y", "z"), np.array([settings.roll, settings.pitch, settings.yaw]))',
        "roll, pitch and yaw are about turned axes, not about fixed ones",
    ),
    Mutant(
        "paper-viewpoint-agreement",
        "stages/paper/normals.py",
        "(score >= 0.0)) > _AGREEMENT",
        "(score >= 0.0)) < _AGREEMENT",
        "a viewpoint is believed just where the shape contradicts it",
    ),
    Mutant(
        "paper-beta-freedom",
        "stages/paper/skeleton.py",
        "residual / freedom**2",
        "residual / freedom",
        "cross-validation forgets a square: beta: auto is too small",
    ),
    Mutant(
        "refined-smoothing-drifts",
        "stages/refined/linearisation.py",
        "np.log10(relative) - _SMOOTHER",
        "np.log10(relative) + _SMOOTHER",
        "each step starts from a smoothing that is four times that of the likelihood, not from it",
    ),
    Mutant(
        "refined-followed-distance",
        "stages/refined/line.py",
        "check_followed(points, ordering.backbone, residual + radius, radius)",
        "check_followed(points, ordering.backbone, residual, radius)",
        "distances from the surface pass for those from the line: a missed stretch is told later",
    ),
    Mutant(
        "segmentation-fewer-count",
        "stages/segmentation/fewest_segments.py",
        "_closest(table, tried, count - 1)",
        "_closest(table, tried, count)",
        "why there are not fewer segments is told of a chain with as many",
    ),
    Mutant(
        "segmentation-minimax-shares",
        "stages/segmentation/minimax.py",
        "- (weight * first * residual).sum(axis=1)[:, 1:]",
        "- (weight * last * residual).sum(axis=1)[:, 1:]",
        "a joint is pulled by what its segment does at the far end",
    ),
    Mutant(
        "quality-cut-angle",
        "stages/quality/cut_ends.py",
        "np.degrees(np.arctan(tilt))",
        "np.arctan(tilt)",
        "the angle of a cut end is said in radians, with degrees behind it",
    ),
    Mutant(
        "quality-stretch-place",
        "stages/quality/checks.py",
        "(worst + 0.5) / _STRETCHES",
        "(worst - 0.5) / _STRETCHES",
        "radius-varies points at the stretch before",
    ),
    Mutant(
        "multibody-last-span",
        "multibody/build.py",
        "if i + 2 == len(lengths) else",
        "if i + 1 == len(lengths) else",
        "the last joint stands for half of the last segment only: it is too stiff",
    ),
    Mutant(
        "multibody-bend-limit",
        "multibody/build.py",
        "limits = half[:-1] + half[1:]",
        "limits = 2.0 * half[:-1]",
        "the limit of the last joint ignores how short the last segment is",
    ),
    Mutant(
        "pcd-padding-offset",
        "io/clouds/pcd.py",
        "starts[fields.index(header.fields[index])]",
        "starts[index]",
        "compressed files of PCL with padding between the coordinates are read from the wrong place",
    ),
    Mutant(
        "ply-header-line",
        "io/parsing/ply_header.py",
        "enumerate(lines, start=2)",
        "enumerate(lines, start=1)",
        "a message names the line before the one that is wrong",
    ),
    Mutant(
        "mjcf-time-step",
        "io/models/mjcf.py",
        "longest = max(_OF_DAMPING * beta, 1.0 / omega)",
        "longest = min(_OF_DAMPING * beta, 1.0 / omega)",
        "time steps are far shorter than stiff objects need",
    ),
    Mutant(
        "srdf-quaternion-order",
        "io/models/srdf.py",
        "(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)",
        "(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)",
        "MoveIt, which has w last, turns a floating base by half a turn",
    ),
    Mutant(
        "ros2-quaternion-order",
        "io/models/ros2.py",
        '("x", "y", "z", "qw", "qx", "qy", "qz")',
        '("x", "y", "z", "qx", "qy", "qz", "qw")',
        "the base of the package is turned",
    ),
    Mutant(
        "curves-last-moving-joint",
        "io/curves/serial_urdf.py",
        "joint.moves or any(leads_on[other.child]",
        "any(leads_on[other.child]",
        "a chain whose last link has a frame fixed beside it passes for one that branches",
    ),
    Mutant(
        "report-dof",
        "io/report.py",
        '"dof": dof * (made.count - 1)',
        '"dof": dof * made.count',
        "degrees of freedom are counted by segments, not by joints",
    ),
    Mutant(
        "pipeline-viewpoint-scale",
        "pipeline.py",
        "output_frame(config.frame, cloud, prepared.scale)",
        "output_frame(config.frame, cloud)",
        "the sensor of a cloud in millimetres stands kilometres away",
    ),
    Mutant(
        "inspect-viewpoint-scale",
        "inspect.py",
        "(cloud.viewpoint * prepared.scale).tolist()",
        "cloud.viewpoint.tolist()",
        "dlogen info says where the sensor is in the cloud's units, among metres",
    ),
    Mutant(
        "evaluation-cap-density",
        "evaluation/synthetic.py",
        "radius * np.sqrt(rng.random((len(at), 1)))",
        "radius * rng.random((len(at), 1))",
        "points on flat ends crowd in the middle",
    ),
    Mutant(
        "batch-order-of-rows",
        "batch/store.py",
        " FROM clouds ORDER BY key",
        " FROM clouds",
        "records, and so the summary, are in the order in which clouds were ready",
    ),
    Mutant(
        "batch-stale-files",
        "batch/runner.py",
        "if name not in self.plan.outputs.names)",
        "if name in self.plan.outputs.names)",
        "models of another format, of older settings, stay beside the new ones",
    ),
    Mutant(
        "batch-override-order",
        "batch/job.py",
        "[*task.overrides, *plan.overrides]",
        "[*plan.overrides, *task.overrides]",
        "a column of a list wins over --set",
    ),
    Mutant(
        "batch-own-files",
        "batch/output_names.py",
        "if file.casefold() in OWN_FILES",
        "if file in OWN_FILES",
        "Summary.json of a cloud is the batch's own file where letters have no case",
    ),
    Mutant(
        "batch-median",
        "batch/summary.py",
        "0.5 * (ordered[(n - 1) // 2] + ordered[n // 2])",
        "0.5 * (ordered[n // 2 - 1] + ordered[n // 2])",
        "the median of an odd number of clouds is between two of them",
    ),
    Mutant(
        "batch-limit-reached",
        "batch/metrics.py",
        "bool(value > self.limit)",
        "bool(value >= self.limit)",
        "a figure that is just the limit of --fail-above is above it",
    ),
    Mutant(
        "sequence-time-shares",
        "sequence/orientation.py",
        "((times[2:] - times[1:-1]) / (times[2:] - times[:-2]))",
        "((times[1:-1] - times[:-2]) / (times[2:] - times[:-2]))",
        "steady motion at uneven times looks like a change of direction",
    ),
    Mutant(
        "sequence-joint-off-curve",
        "sequence/rigid_links.py",
        "before = distances(joints[:, 1:, None]",
        "before = distances(joints[:, :-1, None]",
        "the deviation overlooks joints that are off the curve, the last one above all",
    ),
    Mutant(
        "sequence-other-angles",
        "sequence/joint_values.py",
        "other[:, 1] = math.pi - values[:, 1]",
        "other[:, 1] = math.pi + values[:, 1]",
        "the second pair of angles is another direction: past 90 degrees the pose jumps",
    ),
    Mutant(
        "sequence-missing-length",
        "sequence/shared_model.py",
        "0.5 * (length - lengths))",
        "length - lengths)",
        "what a capture lacks in length is all taken to lack at its beginning",
    ),
    Mutant(
        "sequence-table-header",
        "sequence/trajectory_tables.py",
        '_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")',
        '_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")',
        "the trajectory's header names the parts of the quaternion in another order than they stand",
    ),
    Mutant(
        "cli-flag-precedence",
        "cli/options.py",
        "overrides=(*overrides, *flags)",
        "overrides=(*flags, *overrides)",
        "--set wins over a flag",
    ),
    Mutant(
        "cli-reference-millimetres",
        "cli/commands/fit.py",
        "(1e3 * float(compared[key])",
        "(float(compared[key])",
        "metres are printed as millimetres",
    ),
    Mutant(
        "cli-number-left-out",
        "cli/batch_progress.py",
        "and {len(clouds) - _MOST_NAMED} more",
        "and {len(clouds)} more",
        "clouds that are named are counted among those that are not",
    ),
)
