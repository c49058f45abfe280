"""Meshes of meshio as bodies. Truth: a cube by hand, in all kinds of solids; meshio's own files where it is installed."""

from types import SimpleNamespace

import numpy as np
import pytest

import espalier as esp

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
STEEL = {"young": 1e6, "poisson": 0.3, "density": 2.0}


def block(kind, cells):
    return SimpleNamespace(type=kind, data=np.array(cells))


def mesh(points, cells, **more):
    return SimpleNamespace(**{"points": points, "cells": cells, "point_sets": {}, "cell_sets": {}, "cell_data": {}, "point_data": {}, "field_data": {}, **more})


def pulled(given, face="top", held="foot", **body):
    """The reaction of a column that is pressed with a pressure of 3."""
    model = {"gravity": [0, 0, 0], "bodies": {"part": {"type": "solid", "mesh": given, "material": STEEL, **body}},
             "supports": {"clamp": {"body": "part", "face": held, "hold": "all"}},
             "forces": {"load": {"type": "pressure", "body": "part", "face": face, "pressure": 3.0}}, "statics": {"linear": True},
             "output": {"quantities": ["clamp.force.z"]}}
    return esp.Simulation(model).run().summary


def hexahedron(order):
    points = CUBE if order == 1 else np.vstack([CUBE, [(CUBE[a] + CUBE[b]) / 2 for a, b in EDGES]])
    return points, list(range(8 if order == 1 else 20))


@pytest.mark.parametrize("order", [1, 2])
def test_sets_and_order(order):
    points, cell = hexahedron(order)
    faces = {"foot": [0, 3, 2, 1, 11, 10, 9, 8], "top": [4, 5, 6, 7, 12, 13, 14, 15]}
    flat = [f[:4] if order == 1 else f for f in faces.values()]
    kinds = ("hexahedron", "quad") if order == 1 else ("hexahedron20", "quad8")
    given = esp.from_meshio(mesh(points * 10, [block(kinds[1], flat), block(kinds[0], [cell])], cell_sets={"foot": [[0], None], "top": [[1], None], "all": [[], [0]]}), scale=0.1)
    summary = pulled(given, element_set="all")
    assert summary["quantities"]["clamp.force.z"] == pytest.approx(3.0, rel=1e-12) if "quantities" in summary else summary["steps"] == 1


def test_complete_kinds_points_and_data(tmp_path):
    points, cell = hexahedron(2)
    points = np.vstack([points, np.full((7, 3), 0.5)])
    file = tmp_path / "part.inp"
    given = esp.from_meshio(mesh(points, [block("hexahedron27", [cell + list(range(20, 27))])], point_sets={"foot": [0, 1, 2, 3, 8, 9, 10, 11]},
                                 point_data={"level": np.where(points[:, 2] == 1, 7, 0)}, cell_data={"part": [np.array([4])]}), file=file)
    assert given == {"file": str(file), "scale": 1.0}
    text = file.read_text()
    assert "ELSET=part-4" in text and "NSET=level-7" in text
    assert pulled(given, face="level-7", element_set="part-4")["steps"] == 1


def test_physical_groups():
    given = mesh(CUBE, [block("quad", [[0, 3, 2, 1], [4, 5, 6, 7]]), block("hexahedron", [list(range(8))])], field_data={"foot": np.array([5, 2]), "top": np.array([6, 2]), "solid": np.array([5, 3])},
                 cell_data={"gmsh:physical": [np.array([5, 6]), np.array([5])]})
    assert pulled(esp.from_meshio(given), element_set="solid")["steps"] == 1


def test_mistakes():
    with pytest.raises(TypeError, match="has no points"):
        esp.from_meshio({"cells": []})
    with pytest.raises(ValueError, match="no cells"):
        esp.from_meshio(mesh(CUBE, []))
    with pytest.raises(ValueError, match="'polygon'"):
        esp.from_meshio(mesh(CUBE, [block("polygon", [[0, 1, 2, 3, 4]])]))
    with pytest.raises(ValueError, match="not there"):
        esp.from_meshio(mesh(CUBE, [block("tetra", [[0, 1, 2, 8]])]))
    with pytest.raises(ValueError, match="capitals alone"):
        esp.from_meshio(mesh(CUBE, [block("tetra", [[0, 1, 3, 4]])], point_sets={"a": [0], "A": [1]}))
    with pytest.raises(ValueError, match="rename it"):
        esp.from_meshio(mesh(CUBE, [block("tetra", [[0, 1, 3, 4]])], point_sets={"a,b": [0]}))
    with pytest.raises(ValueError, match="does not end so"):
        esp.from_meshio(mesh(CUBE, [block("tetra", [[0, 1, 3, 4]])]), file="part.vtu")
    with pytest.raises(ValueError, match="finite"):
        esp.from_meshio(mesh(CUBE * np.nan, [block("tetra", [[0, 1, 3, 4]])]))


def test_files_of_meshio(tmp_path):
    meshio = pytest.importorskip("meshio")
    given = meshio.Mesh(CUBE, [("hexahedron", [list(range(8))])])
    given.write(tmp_path / "cube.vtu")
    esp.Simulation({"bodies": {"part": {"type": "solid", "mesh": esp.from_meshio(meshio.read(tmp_path / "cube.vtu")), "material": STEEL}}, "integrator": {"end": 1e-6}}).run()
    for name, keys in (("a.vtu", {"binary": False}), ("b.vtu", {}), ("c.vtu", {"compression": None}), ("d.vtk", {}), ("e.msh", {"file_format": "gmsh"}), ("i.msh", {"file_format": "gmsh22", "binary": False}), ("f.inp", {}), ("g.mesh", {}), ("h.bdf", {})):
        given.write(tmp_path / name, **keys)  # our own readers read what meshio writes
        esp.Simulation({"bodies": {"part": {"type": "solid", "mesh": {"file": str(tmp_path / name)}, "material": STEEL}}, "integrator": {"end": 1e-6}}).run()
