"""Writes bracket.inp, the mesh of bracket.toml, as a mesher for Abaqus and CalculiX would: an angle of two legs, 6 mm thick
and 4 mm wide, joined by a quarter ring whose inner radius, the fillet, is 6 mm. Quadratic hexahedra; node sets ROOT (the
end that is clamped), TIP (the end that is loaded) and FILLET (across the middle of the inner arc).

    python3 bracket_mesh.py bracket.inp"""

import math
import sys

INNER, THICK, WIDE, LEG = 6.0, 6.0, 4.0, 24.0  # mm
ALONG = [8, 12, 8]  # elements of leg, ring, leg
ACROSS, DEEP = 4, 2


def place(s, r, z):
    """A point of the angle: s = 0..3 along its axis, r = 0..1 from the inner to the outer side. The ring's centre is the
    origin; the first leg stands on the plane y = -LEG, the second one ends at x = -LEG."""
    radius = INNER + r * THICK
    if s <= 1:
        return radius, (s - 1) * LEG, z
    if s <= 2:
        angle = (s - 1) * math.pi / 2
        return radius * math.cos(angle), radius * math.sin(angle), z
    return -(s - 2) * LEG, radius, z


def corner_nodes(element):
    """The 20 nodes of a hexahedron in half steps of the grid, in Abaqus' order."""
    i, j, k = (2 * c for c in element)
    low = [(0, 0), (2, 0), (2, 2), (0, 2)]
    middle = [(1, 0), (2, 1), (1, 2), (0, 1)]
    at = [(a, b, 0) for a, b in low] + [(a, b, 2) for a, b in low] + [(a, b, 0) for a, b in middle]
    at += [(a, b, 2) for a, b in middle] + [(a, b, 1) for a, b in low]
    return [(i + a, j + b, k + c) for a, b, c in at]


def mesh():
    total = sum(ALONG)
    half_steps = []  # s of every half step along the axis
    for part, count in enumerate(ALONG):
        half_steps += [part + k / (2 * count) for k in range(2 * count)]
    half_steps.append(3.0)
    labels, nodes, elements = {}, [], []
    for e in range(total):
        for j in range(ACROSS):
            for k in range(DEEP):
                corners = []
                for node in corner_nodes((k, j, e)):  # depth, thickness, axis: right-handed
                    if node not in labels:
                        labels[node] = len(labels) + 1
                        c, b, a = node
                        nodes.append((labels[node], *place(half_steps[a], b / (2 * ACROSS), WIDE * c / (2 * DEEP))))
                    corners.append(labels[node])
                elements.append(corners)
    arc = 2 * (ALONG[0] + ALONG[1] // 2)  # half steps to the middle of the arc
    sets = {
        "ROOT": [n for (c, b, a), n in labels.items() if a == 0],
        "TIP": [n for (c, b, a), n in labels.items() if a == 2 * total],
        "FILLET": [n for (c, b, a), n in labels.items() if a == arc and b == 0],
    }
    return nodes, elements, sets


def write(path):
    nodes, elements, sets = mesh()
    with open(path, "w", encoding="ascii") as out:
        out.write("*HEADING\nan angle with a fillet, mm\n*NODE\n")
        out.writelines(f"{n}, {x:.9g}, {y:.9g}, {z:.9g}\n" for n, x, y, z in nodes)
        out.write("*ELEMENT, TYPE=C3D20R, ELSET=BRACKET\n")
        for number, e in enumerate(elements, 1):
            out.write(f"{number}, {', '.join(map(str, e[:10]))},\n{', '.join(map(str, e[10:]))}\n")
        for name, members in sets.items():
            out.write(f"*NSET, NSET={name}\n")
            out.writelines(f"{', '.join(map(str, members[k:k + 16]))}\n" for k in range(0, len(members), 16))


if __name__ == "__main__":
    write(sys.argv[1] if len(sys.argv) > 1 else "bracket.inp")
