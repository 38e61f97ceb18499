"""The tube around the skeleton line as a mesh (the paper's Fig. 8a): GLB, OBJ and PLY.

All in metres in the frame of the chain, z as there: viewers of glTF that take y for up show it lying on its side.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dlogen.io.registry import ModelFormat

if TYPE_CHECKING:
    from dlogen.types import FitData


def write_glb(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.tube.glb`, with one node `tube`.

    glTF stores vertices in single precision, which at survey coordinates is half a metre. So they are relative to the
    start of the line, and the node is placed there.
    """
    import trimesh

    from dlogen.geometry.tube_mesh import tube_mesh
    from dlogen.io.models.chain_mesh import SEGMENT, coloured

    origin = result.chain.joints[0]
    tube = tube_mesh(result.skeleton, result.chain.radius, origin=origin)
    mesh = trimesh.Trimesh(tube.vertices, tube.faces, process=False)
    mesh.visual = coloured(SEGMENT)
    scene = trimesh.Scene()
    scene.add_geometry(
        mesh, node_name="tube", geom_name="tube", transform=trimesh.transformations.translation_matrix(origin)
    )
    return {f"{stem}.tube.glb": scene.export(file_type="glb", include_normals=True)}


def write_obj(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.tube.obj`; nanometres are its last digit."""
    import trimesh

    from dlogen.geometry.tube_mesh import tube_mesh

    tube = tube_mesh(result.skeleton, result.chain.radius)
    mesh = trimesh.Trimesh(tube.vertices, tube.faces, process=False)
    text = trimesh.exchange.obj.export_obj(
        mesh, include_normals=False, include_color=False, digits=9, header="Tube around the skeleton line, metres"
    )
    return {f"{stem}.tube.obj": f"{text.rstrip()}\n".encode()}


def write_ply(result: FitData, stem: str) -> dict[str, bytes]:
    """One file, `stem.tube.ply`, binary, with double precision, which trimesh's own writer does not have."""
    import io

    import numpy as np

    from dlogen.geometry.tube_mesh import tube_mesh
    from dlogen.io.parsing import ply_writer

    tube = tube_mesh(result.skeleton, result.chain.radius)
    vertices = np.empty(len(tube.vertices), dtype=[(axis, "<f8") for axis in "xyz"])
    for axis, column in zip("xyz", tube.vertices.T, strict=True):
        vertices[axis] = column
    faces = np.empty(len(tube.faces), dtype=[("vertex_indices", "<i4", 3)])
    faces["vertex_indices"] = tube.faces
    stream = io.BytesIO()
    ply_writer.write_ply(
        stream,
        {"vertex": vertices, "face": faces},
        "binary_little_endian",
        ["tube around the skeleton line, metres"],
    )
    return {f"{stem}.tube.ply": stream.getvalue()}


FORMATS = (
    ModelFormat(
        name="glb",
        suffixes=(".tube.glb",),
        description="GLB mesh of the tube around the skeleton line",
        write=write_glb,
    ),
    ModelFormat(
        name="obj",
        suffixes=(".tube.obj",),
        description="OBJ mesh of the same tube",
        write=write_obj,
    ),
    ModelFormat(
        name="ply-mesh",
        suffixes=(".tube.ply",),
        description="PLY mesh of the same tube, binary, double precision",
        write=write_ply,
    ),
)
