"""The chain as a scene of meshes (the paper's Fig. 8b): a cylinder for each segment, a ball at each joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dlogen.io.registry import ModelFormat

if TYPE_CHECKING:
    from dlogen.types import FitData

#: Linear RGBA.
SEGMENT, _JOINT = (0.12, 0.30, 0.45, 1.0), (0.80, 0.28, 0.05, 1.0)

#: Balls stand out a little from the cylinders that they join.
_BALL = 1.15


def write(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.chain.glb`; metres, in the frame of the chain.

    The nodes `segment_01` ... have the transforms of the chain's links (frame in the centre, x axis along the segment),
    the nodes `joint_00` ... are the paper's x_0 .. x_n, the ends included.
    """
    import numpy as np
    import trimesh

    chain = result.chain
    count = len(chain.lengths)
    digits = max(2, len(str(count)))
    scene = trimesh.Scene()

    along_x = trimesh.transformations.rotation_matrix(0.5 * np.pi, (0.0, 1.0, 0.0))
    for i, (length, transform) in enumerate(zip(chain.lengths, chain.transforms, strict=True)):
        name = f"segment_{i + 1:0{digits}d}"
        cylinder = trimesh.creation.cylinder(radius=chain.radius, height=float(length), sections=32, transform=along_x)
        cylinder.visual = coloured(SEGMENT)
        scene.add_geometry(cylinder, node_name=name, geom_name=name, transform=transform)

    ball = trimesh.creation.icosphere(subdivisions=2, radius=_BALL * chain.radius)
    ball.visual = coloured(_JOINT)
    scene.geometry["joint"] = ball
    for i, position in enumerate(chain.joints):
        place = trimesh.transformations.translation_matrix(position)
        scene.graph.update(frame_to=f"joint_{i:0{digits}d}", matrix=place, geometry="joint")
    return {f"{stem}.chain.glb": scene.export(file_type="glb")}


def coloured(rgba: tuple[float, ...]) -> Any:
    """The look of a surface, for `mesh.visual`: linear RGBA, dull."""
    import trimesh

    material = trimesh.visual.material.PBRMaterial(baseColorFactor=rgba, metallicFactor=0.0, roughnessFactor=0.6)
    return trimesh.visual.TextureVisuals(material=material)


FORMAT = ModelFormat(
    name="chain-glb",
    suffixes=(".chain.glb",),
    description="GLB scene of the chain: a node for each segment, balls at the joints",
    write=write,
)
