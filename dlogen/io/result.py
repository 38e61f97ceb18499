"""What `dlogen.fit` returns: everything that a fit made, which can write and draw itself."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from dlogen import types
from dlogen.io.atomic import refuse_existing, write_all
from dlogen.io.outputs import Outputs
from dlogen.io.report import report_dict
from dlogen.multibody.build import multibody
from dlogen.multibody.model import MultibodyModel


@dataclass(frozen=True, eq=False, repr=False)
class Result(types.FitData):
    """Everything that a fit made; see `FitData` for what is in it.

    >>> import dlogen
    >>> cloud = dlogen.synth("straight", points=2000, seed=1)
    >>> result = dlogen.fit(cloud.points)
    >>> len(result.chain.joints), result.quality.verdict
    (2, 'good')
    >>> result.skeleton(0.5).shape
    (3,)
    """

    @cached_property
    def model(self) -> MultibodyModel:
        """The multibody model that all formats write: bodies, joints, limits, springs, forward kinematics.

        Raises:
            ConfigError: the settings of joints and material do not fit the chain.
        """
        return multibody(self)

    def write(
        self,
        folder: str | Path,
        formats: str | Iterable[str] = ("urdf", "json"),
        *,
        plot: bool = False,
        force: bool = False,
    ) -> tuple[Path, ...]:
        """Write models and the report into a folder, all of them or none; the same bytes as `dlogen fit`.

        Args:
            folder: made if it is not there.
            formats: names of model formats (`dlogen formats`), as a list or with commas between them; "all" for all.
            plot: also write a picture, NAME.png (needs matplotlib).
            force: overwrite existing files.

        Returns:
            The files.

        Raises:
            UsageError: there is no such format, a file exists already, or the folder cannot be written.
            DlogenError: a format cannot hold this result, or matplotlib is missing.

        >>> import dlogen, tempfile
        >>> result = dlogen.fit(dlogen.synth("straight", points=2000, seed=1).points)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     [path.name for path in result.write(folder, ["urdf", "mjcf"])]
        ['cloud.urdf', 'cloud.xml', 'cloud.report.json']
        """
        outputs = Outputs.parse(formats if isinstance(formats, str) else ",".join(formats), plot)
        place = Path(folder)
        refuse_existing([place / name for name in outputs.files(self.name)], force)
        contents = outputs.contents(self, self.name, report_dict(self))
        paths = {place / name: data for name, data in contents.items()}
        write_all(paths)
        return tuple(paths)

    def plot(self, path: str | Path | None = None) -> bytes:
        """A picture of the fit as PNG: cloud, skeleton line and chain from two sides, curvature, error (Fig. 9).

        Args:
            path: write it there as well.

        Raises:
            UsageError: matplotlib is not installed, or the file cannot be written.

        >>> import dlogen
        >>> result = dlogen.fit(dlogen.synth("straight", points=2000, seed=1).points)
        >>> result.plot()[:4]  # doctest: +SKIP
        b'\\x89PNG'
        """
        from dlogen.io.plots import fit_picture

        picture = fit_picture(self)
        if path is not None:
            write_all({Path(path): picture})
        return picture
