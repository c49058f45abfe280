"""One cantilever out of every format and kind of surface element, beside the grid of our own."""

import pytest

import espalier
from test_shells import INERTIA, MATERIAL, STRIP, YOUNG, cantilever, deck, ends, grid, moved, of_file, second_order, triangles, weight

SECTION = {"thickness": 0.01, "material": MATERIAL}
FORCE = -1.0
TRUTH = FORCE / (3 * YOUNG * INERTIA)


def mesh_of(kind):
    """Nodes and elements: quadrilaterals or triangles of first or second order."""
    nodes, quads = grid(10, 2)
    elements = quads if kind.startswith("quad") else triangles(quads)
    return second_order(nodes, elements) if kind[-1] in "68" else (nodes, elements)


def bdf(path, nodes, elements, card):
    """T1 to T4 and what follows are left empty; the property has the thickness."""
    lines = [f"GRID,{k},,{x!r},{y!r},{z!r}" for k, (x, y, z) in nodes.items()]
    for k, own in enumerate(elements):
        fields = [card, str(k + 1), "7", *map(str, own)]
        lines.append(",".join(fields[:9]))
        if fields[9:]:
            lines.append("," + ",".join(fields[9:]))
    root, tip = ends(nodes).values()
    lines += ["PSHELL,7,3,0.01,3", f"MAT1,3,{YOUNG},,0.,7850."] + [f"SPC,1,{k},123,0." for k in root] + [f"FORCE,2,{k},,1.,1.,0.,0." for k in tip]
    path.write_text("BEGIN BULK\n" + "\n".join(lines) + "\nENDDATA\n")
    return of_file(str(path)), {"nodes": "SPC-1"}, {"nodes": "FORCE-2", "attach": "mean"}


@pytest.mark.parametrize("card, kind, tolerance", [("CQUAD4", "quad4", 1e-9), ("CQUADR", "quad4", 1e-9), ("CTRIA3", "tri3", 0.02), ("CTRIAR", "tri3", 0.02),
                                                  ("CTRIA6", "tri6", 0.02), ("CQUAD8", "quad8", 5e-3)])
def test_nastran(tmp_path, card, kind, tolerance):
    nodes, elements = mesh_of(kind)
    own = moved(STRIP, {"edge": "x0"}, {"edge": "x1", "attach": "mean"})[2]
    assert moved(*bdf(tmp_path / "s.bdf", nodes, elements, card))[2] == pytest.approx(own, rel=tolerance)


@pytest.mark.parametrize("number, kind, tolerance", [(181, "quad4", 1e-9), (63, "quad4", 1e-9), (181, "tri3", 0.02), (281, "quad8", 5e-3), (281, "tri6", 0.02)])
def test_ansys(tmp_path, number, kind, tolerance):
    """Triangles of SHELL181 and 281 are quadrilaterals whose last corners are one node."""
    nodes, elements = mesh_of(kind)
    text = f"/PREP7\nET,1,{number}\nNBLOCK,6,SOLID\n(3i9,6e21.13e3)\n"
    text += "".join(f"{k:9}{0:9}{0:9}{x:21.13E}{y:21.13E}{z:21.13E}\n" for k, (x, y, z) in nodes.items()) + "N,R5.3,LOC,       -1,\nEBLOCK,19,SOLID\n(19i9)\n"
    for e, own in enumerate(elements):
        if kind == "tri3":
            own = [*own, own[2]]
        if kind == "tri6":
            a, b, c, ab, bc, ca = own
            own = [a, b, c, c, ab, bc, c, ca]
        text += "".join(f"{v:9}" for v in [1, 1, 1, 1, 0, 0, 0, 0, len(own), 0, e + 1, *own]) + "\n"
    text += "       -1\n"
    for name, members in ends(nodes).items():
        text += f"CMBLOCK,{name},NODE,{len(members)}\n(8i10)\n" + "".join(f"{m:10}\n" if k % 8 == 7 else f"{m:10}" for k, m in enumerate(members)) + "\n"
    (tmp_path / "s.cdb").write_text(text + "FINISH\n")
    own = moved(STRIP, {"edge": "x0"}, {"edge": "x1", "attach": "mean"})[2]
    assert moved(of_file(str(tmp_path / "s.cdb"), **SECTION), {"nodes": "ROOT"}, {"nodes": "TIP", "attach": "mean"})[2] == pytest.approx(own, rel=tolerance)


def counted(nodes):
    return {label: k for k, label in enumerate(nodes)}


@pytest.mark.parametrize("kind, cell, tolerance", [("quad4", 9, 1e-9), ("tri3", 5, 0.02), ("quad8", 23, 5e-3), ("tri6", 22, 0.02)])
def test_vtu(tmp_path, kind, cell, tolerance):
    nodes, elements = mesh_of(kind)
    number, most = counted(nodes), max(x for x, _, _ in nodes.values())
    array = lambda name, kind, values, more="": f'<DataArray type="{kind}" Name="{name}" format="ascii"{more}>{" ".join(map(str, values))}</DataArray>\n'
    text = ('<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">\n<UnstructuredGrid>\n'
            f'<Piece NumberOfPoints="{len(nodes)}" NumberOfCells="{len(elements)}">\n<PointData>\n'
            + array("end", "Int32", [1 if p[0] == 0 else 2 if p[0] == most else 0 for p in nodes.values()]) + "</PointData>\n<Points>\n"
            + array("p", "Float64", [v for p in nodes.values() for v in p], ' NumberOfComponents="3"') + "</Points>\n<Cells>\n"
            + array("connectivity", "Int64", [number[k] for own in elements for k in own])
            + array("offsets", "Int64", [len(elements[0]) * (k + 1) for k in range(len(elements))]) + array("types", "UInt8", [cell] * len(elements))
            + "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")
    (tmp_path / "s.vtu").write_text(text)
    own = moved(STRIP, {"edge": "x0"}, {"edge": "x1", "attach": "mean"})[2]
    assert moved(of_file(str(tmp_path / "s.vtu"), **SECTION), {"nodes": "end-1"}, {"nodes": "end-2", "attach": "mean"})[2] == pytest.approx(own, rel=tolerance)


@pytest.mark.parametrize("kind, tolerance", [("quad4", 1e-9), ("tri3", 0.02)])
@pytest.mark.parametrize("name", ["medit", "mfem"])
def test_medit_and_mfem(tmp_path, name, kind, tolerance):
    nodes, elements = mesh_of(kind)
    number, sides = counted(nodes), ends(nodes)
    rim = {side: [(a, b) for a, b in zip(members, members[1:])] for side, members in sides.items()}
    if name == "medit":
        where = {k: 5 if k in sides["ROOT"] else 6 if k in sides["TIP"] else 0 for k in nodes}
        text = f"MeshVersionFormatted 2\nDimension 3\nVertices\n{len(nodes)}\n" + "".join(f"{x} {y} {z} {where[k]}\n" for k, (x, y, z) in nodes.items())
        text += f"{'Quadrilaterals' if kind == 'quad4' else 'Triangles'}\n{len(elements)}\n" + "".join(" ".join(str(number[k] + 1) for k in own) + " 1\n" for own in elements) + "End\n"
        root, tip = "vertex-5", "vertex-6"
    else:  # a surface in space, with its boundary as segments
        text = f"MFEM mesh v1.0\n\ndimension\n2\n\nelements\n{len(elements)}\n" + "".join(f"1 {3 if kind == 'quad4' else 2} " + " ".join(str(number[k]) for k in own) + "\n" for own in elements)
        lines = [(7 if side == "ROOT" else 8, a, b) for side, list_ in rim.items() for a, b in list_]
        text += f"\nboundary\n{len(lines)}\n" + "".join(f"{v} 1 {number[a]} {number[b]}\n" for v, a, b in lines)
        text += f"\nvertices\n{len(nodes)}\n3\n" + "".join(f"{x} {y} {z}\n" for x, y, z in nodes.values())
        root, tip = "boundary-7", "boundary-8"
    (tmp_path / "s.mesh").write_text(text)
    own = moved(STRIP, {"edge": "x0"}, {"edge": "x1", "attach": "mean"})[2]
    found = moved(of_file(str(tmp_path / "s.mesh"), **SECTION), {"nodes": root}, {"nodes": tip, "attach": "mean"})[2]
    assert found == pytest.approx(own, rel=tolerance)


def test_a_section_in_a_file_that_is_included(tmp_path):
    nodes, quads = grid(10, 2)
    path = deck(tmp_path / "s.inp", nodes, {"S4": quads}, sets=ends(nodes))
    text = open(path).read()
    at = text.index("*MATERIAL")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "m.inp").write_text(text[at:text.index("*SHELL")] + "*INCLUDE, INPUT=s.inp\n")
    (tmp_path / "parts" / "s.inp").write_text(text[text.index("*SHELL"):])
    open(path, "w").write(text[:at] + "*INCLUDE, INPUT=parts/m.inp\n")
    assert moved(of_file(path), {"nodes": "ROOT"}, {"nodes": "TIP", "attach": "mean"})[2] == pytest.approx(TRUTH, rel=5e-3)
    (tmp_path / "parts" / "s.inp").write_text("*INCLUDE, INPUT=s.inp\n")
    with pytest.raises(espalier.Error, match="include one another"):
        moved(of_file(path), {"nodes": "ROOT"}, {"nodes": "TIP"})


@pytest.mark.parametrize("parameters, section, message", [(",COMPOSITE", "0.005,3,OTHER,0", r"s.inp:\d+: layers of 'OTHER'"), (",COMPOSITE,NODAL THICKNESS", "0.01,3,STEEL", r"s.inp:\d+: COMPOSITE with NODAL")])
def test_what_sections_say_more_is_refused_with_its_line(tmp_path, parameters, section, message):
    nodes, quads = grid(2, 1)
    path = deck(tmp_path / "s.inp", nodes, {"S4": quads}, section, parameters, ends(nodes))
    with pytest.raises(espalier.Error, match=message):
        cantilever(of_file(path), {"nodes": "ROOT"}, {"nodes": "TIP", "attach": "mean"})


def test_quadrilaterals_of_several_thicknesses(tmp_path):
    """The weight of three strips side by side is that of each thickness."""
    nodes, quads = grid(6, 3)
    path = deck(tmp_path / "s.inp", nodes, {"S4": quads}, sets=ends(nodes))
    text = open(path).read()
    sections = "".join(f"*ELSET,ELSET=T{j}\n" + "".join(f"{6 * j + i + 1},\n" for i in range(6)) + f"*SHELL SECTION,ELSET=T{j},MATERIAL=STEEL\n{t}\n"
                       for j, t in enumerate((0.01, 0.02, 0.04)))
    open(path, "w").write(text[:text.index("*SHELL")] + sections)
    assert weight(of_file(path), ["ROOT"]) == pytest.approx([7850 * 10 * 0.2 / 3 * 0.07], rel=1e-6)
