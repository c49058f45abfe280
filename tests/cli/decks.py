"""Decks of CalculiX that a program makes: small solids with springs, ties, couplings and the like."""

import itertools
import math

TETS = ((0, 1, 3, 7), (0, 1, 7, 5), (0, 5, 7, 4), (1, 2, 3, 7), (1, 2, 7, 6), (1, 6, 7, 5))
EDGES_TET = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
EDGES_HEX = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
STEEL = "*MATERIAL, NAME=STEEL\n*ELASTIC\n210e9, 0.3\n*DENSITY\n7850\n*SOLID SECTION, ELSET=PART, MATERIAL=STEEL\n"
END = "*NODE PRINT, NSET=ALL\nU\n*END STEP\n"
NEAR = 1e-9


def as_it_is(p):
    return p


def tapered(p):
    return [p[0] * (1 + 4 * p[1]), p[1] * (1 - 1.5 * p[0]), p[2] * (1 + 0.5 * p[0])]


class Block:
    """n[0] x n[1] x n[2] cells of a box, bent by a function; labels from `first`."""

    def __init__(self, kind, size, n, origin=(0, 0, 0), first=1, bend=as_it_is):
        self.kind, self.first, self.labels, self.elements = kind, first, {}, []
        for cell in itertools.product(*map(range, n)):
            corners = [tuple(2 * (c + a) for c, a in zip(cell, corner)) for corner in CORNERS]
            for nodes in [[corners[a] for a in tet] for tet in TETS] if kind in ("C3D4", "C3D10") else [corners]:
                if kind in ("C3D10", "C3D20", "C3D20R"):
                    edges = EDGES_TET if len(nodes) == 4 else EDGES_HEX
                    nodes = nodes + [tuple((a + b) // 2 for a, b in zip(nodes[p], nodes[q])) for p, q in edges]
                self.elements.append([self.label(place) for place in nodes])
        self.nodes = {l: bend([origin[d] + size[d] * place[d] / (2 * n[d]) for d in range(3)]) for place, l in self.labels.items()}

    def label(self, place):
        return self.labels.setdefault(place, self.first + len(self.labels))

    def where(self, test):
        return [label for label, p in self.nodes.items() if test(*p)]

    def faces(self, face, first_element, test):
        """S-faces of elements that have four corners and more where the test holds."""
        chosen = [e for e, nodes in enumerate(self.elements, first_element) if sum(test(*self.nodes[n]) for n in nodes) >= 4]
        return "".join(f"{e}, {face}\n" for e in chosen)

    def outer(self, end):
        """S-faces whose corners are all in a set of nodes."""
        corners = {"S1": (0, 1, 2), "S2": (0, 3, 1), "S3": (1, 3, 2), "S4": (2, 3, 0)}
        if not self.kind in ("C3D4", "C3D10"):
            corners = {"S1": (0, 1, 2, 3), "S2": (4, 7, 6, 5), "S3": (0, 4, 5, 1), "S4": (1, 5, 6, 2), "S5": (2, 6, 7, 3), "S6": (3, 7, 4, 0)}
        return "".join(f"{e}, {name}\n" for e, nodes in enumerate(self.elements, 1) for name, face in corners.items()
                       if all(nodes[a] in end for a in face))

    def text(self, elset, first_element=1):
        lines = ["*NODE"] + [f"{label}, " + ", ".join(f"{x:.17g}" for x in p) for label, p in self.nodes.items()]
        lines.append(f"*ELEMENT, TYPE={self.kind}, ELSET={elset}")
        for e, nodes in enumerate(self.elements, first_element):
            words = [str(x) for x in [e] + nodes]
            lines.append(", ".join(words[:12]) + ("," if len(words) > 12 else ""))
            if len(words) > 12:
                lines.append(", ".join(words[12:]))
        return "\n".join(lines) + "\n"


def nset(name, labels):
    labels = [str(label) for label in labels]
    return f"*NSET, NSET={name}\n" + "".join(", ".join(labels[k:k + 12]) + ",\n" for k in range(0, len(labels), 12))


def clamped(b, more=""):
    return b.text("PART") + more + nset("ALL", b.nodes) + nset("FIX", b.where(lambda x, y, z: x < NEAR)) + STEEL


def loads(kind):
    """Forces, pressures, gravity and a displacement on a bar; tapered where both programs integrate alike."""
    b = Block(kind, (0.2, 0.05, 0.03), (6, 2, 2), bend=as_it_is if kind in ("C3D8I", "C3D10") else tapered)
    tip = [b.labels[(12, 4, 4)], b.labels[(12, 0, 4)], b.labels[(12, 4, 0)]]
    return (clamped(b, nset("TIP", tip)) + "*BOUNDARY\nFIX, 1, 3\n*STEP\n*STATIC\n*CLOAD\n" +
            f"TIP, 3, -200.\n{tip[0]}, 1, 50.\n*DLOAD\nPART, GRAV, 9.81, 0., 0.6, -0.8\n" +
            "".join(f"{e}, P1, 1.e5\n" for e in (1, 2, 3)) + f"{len(b.elements)}, P2, -2.e5\n" +
            f"*BOUNDARY\n{b.labels[(12, 0, 0)]}, 2, 2, 1.e-5\n" + END)


def springs(kind):
    """A block that nothing but springs holds: to the ground along axes, along lines, between its own nodes."""
    b = Block(kind, (0.1, 0.06, 0.04), (3, 2, 2), bend=tapered)
    c = [b.labels[p] for p in ((0, 0, 0), (0, 4, 0), (0, 0, 4), (6, 0, 0), (6, 4, 4))]
    t = b.text("PART") + "*NODE\n9001, 0.3, 0.1, 0.05\n9002, -0.1, -0.1, 0.\n" + nset("ALL", b.nodes)
    for first, name, nodes in ((801, "SX", c[:4]), (811, "SY", c[:3]), (821, "SZ", c[1:])):
        t += f"*ELEMENT, TYPE=SPRING1, ELSET={name}\n" + "".join(f"{first + k}, {n}\n" for k, n in enumerate(nodes))
    t += f"*ELEMENT, TYPE=SPRINGA, ELSET=SA\n831, {c[4]}, 9001\n832, 9002, {c[0]}\n*ELEMENT, TYPE=SPRING2, ELSET=S2\n841, {c[0]}, {c[4]}\n"
    t += "*SPRING, ELSET=SX\n1\n2.e7\n*SPRING, ELSET=SY\n2\n3.e7\n*SPRING, ELSET=SZ\n3\n5.e7\n*SPRING, ELSET=SA\n\n4.e6\n*SPRING, ELSET=S2\n2, 2\n7.e6\n"
    return (t + STEEL + "*BOUNDARY\n9001, 1, 3\n9002, 1, 3\n*STEP\n*STATIC\n*CLOAD\n" +
            f"{c[4]}, 1, 1000.\n{c[4]}, 2, 300.\n{c[3]}, 3, -500.\n" + END)


def tie(kind):
    """Two blocks whose meshes do not fit, welded; under their weight and forces."""
    a = Block(kind, (0.1, 0.05, 0.03), (4, 3, 2))
    b = Block(kind, (0.1, 0.05, 0.03), (3, 2, 2), origin=(0.1, 0, 0), first=1001)
    t = a.text("A") + b.text("B", 501) + "*ELSET, ELSET=PART\nA, B\n" + nset("ALL", list(a.nodes) + list(b.nodes))
    t += nset("FIX", a.where(lambda x, y, z: x < NEAR)) + nset("LOAD", b.where(lambda x, y, z: x > 0.2 - NEAR))
    middle = lambda x, y, z: abs(x - 0.1) < NEAR
    t += "*SURFACE, NAME=ONE, TYPE=ELEMENT\n" + a.faces("S4", 1, middle) + "*SURFACE, NAME=TWO, TYPE=ELEMENT\n" + b.faces("S6", 501, middle)
    return (t + STEEL + "*TIE, NAME=T, POSITION TOLERANCE=0.001\nONE, TWO\n*BOUNDARY\nFIX, 1, 3\n*STEP\n*STATIC\n" +
            "*CLOAD\nLOAD, 3, -20.\n*DLOAD\nPART, GRAV, 9.81, 0., 0., -1.\n" + END)


def rigid(kind):
    """A rigid end under a force and a moment, and equations between nodes."""
    b = Block(kind, (0.1, 0.06, 0.04), (4, 2, 2))
    m = [b.labels[p] for p in ((4, 0, 0), (4, 4, 0), (4, 4, 4), (2, 2, 4))]
    end = nset("END", b.where(lambda x, y, z: x > 0.1 - NEAR))
    return (clamped(b, "*NODE\n9001, 0.15, 0.02, 0.02\n9002, 0.15, 0.02, 0.02\n" + end) +
            "*RIGID BODY, NSET=END, REF NODE=9001, ROT NODE=9002\n*BOUNDARY\nFIX, 1, 3\n" +
            f"*EQUATION\n3\n{m[0]}, 3, 1., {m[1]}, 3, -0.5, {m[2]}, 3, -0.25\n2\n{m[3]}, 1, 2., {m[2]}, 1, -1.\n" +
            "*STEP\n*STATIC\n*CLOAD\n9001, 3, -300.\n9001, 1, 100.\n9002, 1, 30.\n9002, 2, -10.\n" + END)


def coupling(kind, how, bend=as_it_is):
    """A face that follows its reference node, as one rigid piece or in the mean."""
    b = Block(kind, (0.1, 0.06, 0.04), (4, 2, 2), bend=bend)
    end = set(b.where(lambda x, y, z: x > 0.1 * (1 + 4 * y) - NEAR if bend is tapered else x > 0.1 - NEAR))
    face = "*SURFACE, NAME=END, TYPE=ELEMENT\n" + b.outer(end)
    return (clamped(b, "*NODE\n9001, 0.15, 0.02, 0.02\n") + face +
            f"*COUPLING, REF NODE=9001, SURFACE=END, CONSTRAINT NAME=C\n*{how.split()[0]}\n1, {6 if 'TURNED' in how else 3}\n*BOUNDARY\nFIX, 1, 3\n" +
            "*STEP\n*STATIC\n*CLOAD\n9001, 3, -300.\n9001, 1, 100.\n" + ("" if how == "DISTRIBUTING" else "9001, 4, 30.\n") + END)


def weighted(kind):
    """Forces on the reference node of CalculiX's old distributing coupling, far from the nodes, which have weights of their own."""
    b = Block(kind, (0.1, 0.06, 0.04), (4, 2, 2))
    weights = "".join(f"{n}, {1 + k % 4 / 2}\n" for k, n in enumerate(b.where(lambda x, y, z: x > 0.1 - NEAR)))
    return (clamped(b, "*NODE\n9001, 0.3, 0.2, 0.1\n") + "*ELEMENT, TYPE=DCOUP3D, ELSET=E1\n9100, 9001\n*DISTRIBUTING COUPLING, ELSET=E1\n" + weights +
            "*BOUNDARY\nFIX, 1, 3\n*STEP\n*STATIC\n*CLOAD\n9001, 3, -300.\n9001, 2, 100.\n" + END)


TWO = ("*MATERIAL, NAME=STEEL\n*ELASTIC\n210e9, 0.3\n*DENSITY\n7850\n*MATERIAL, NAME=RESIN\n*ELASTIC\n3e9, 0.4\n*DENSITY\n1200\n"
       "*SOLID SECTION, ELSET=LOWER, MATERIAL=STEEL\n*SOLID SECTION, ELSET=UPPER, MATERIAL=RESIN\n")


def layers(kind, bend=as_it_is):
    """A bar of two layers, clamped, and its steps' begin; the sets LOWER and UPPER are its elements."""
    b = Block(kind, (0.2, 0.05, 0.04), (6, 2, 2), bend=bend)
    height = [sum(b.nodes[n][2] for n in nodes) / len(nodes) for nodes in b.elements]
    t = b.text("PART") + nset("ALL", b.nodes) + nset("FIX", b.where(lambda x, y, z: x < NEAR))
    for name, chosen in (("LOWER", lambda z: z < 0.02), ("UPPER", lambda z: z >= 0.02)):
        t += nset(name, [e for e, z in enumerate(height, 1) if chosen(z)]).replace("NSET", "ELSET")
    return b, t + TWO + "*BOUNDARY\nFIX, 1, 3\n"


def materials(kind):
    """Two layers of different materials and weights, and forces on the volume of one."""
    b, t = layers(kind, bend=lambda p: [p[0] * (1 + 4 * p[1]), p[1] * (1 - 1.5 * p[0]), p[2]] if kind != "C3D10" else p)
    return (t + f"*STEP\n*STATIC\n*CLOAD\n{b.labels[(12, 4, 4)]}, 3, -20.\n*DLOAD\nLOWER, GRAV, 9.81, 0., 0., -1.\n" +
            "UPPER, GRAV, 40., 0.6, 0., 0.8\nPART, GRAV, 3., 0., 1., 0.\nUPPER, BY, 2.e4\nLOWER, BX, -1.e5\n" + END)


def materials_modes(kind):
    """Frequencies of two layers."""
    return layers(kind)[1] + "*STEP\n*FREQUENCY\n6\n*END STEP\n"


def spin(kind, masses=False):
    """Two layers, and masses, that turn about a skew axis."""
    b, t = layers(kind)
    where = "PART"
    if masses:
        t = (t.replace("*BOUNDARY", f"*ELEMENT, TYPE=MASS, ELSET=M\n901, {b.labels[(12, 4, 4)]}\n902, {b.labels[(12, 0, 0)]}\n*MASS, ELSET=M\n0.7\n"
                       "*ELSET, ELSET=BOTH\nPART, M\n*BOUNDARY"))
        where = "BOTH"
    return t + f"*STEP\n*STATIC\n*DLOAD\n{where}, CENTRIF, 250000., 0., 0.01, 0., 0., 0.6, 0.8\n" + END


def mpc(kind):
    """Nodes that stay in a plane, on a line, at a distance; under small forces, since CalculiX iterates."""
    b = Block(kind, (0.1, 0.06, 0.04), (4, 2, 2), bend=tapered)
    c = [b.labels[p] for p in ((8, 0, 0), (8, 4, 0), (8, 0, 4), (8, 4, 4), (4, 0, 0), (4, 0, 4), (4, 0, 2), (4, 4, 0), (2, 4, 4))]
    return (clamped(b) + f"*MPC\nPLANE, {c[0]}, {c[1]}, {c[2]}, {c[3]}\n*MPC\nSTRAIGHT, {c[4]}, {c[5]},\n{c[6]}\n*MPC\nBEAM, {c[7]}, {c[8]}\n" +
            f"*BOUNDARY\nFIX, 1, 3\n*STEP\n*STATIC\n*CLOAD\n{c[0]}, 1, -0.2\n{c[3]}, 1, 0.7\n{c[6]}, 3, 0.5\n{c[6]}, 1, 0.3\n{c[8]}, 2, 0.3\n" + END)


def modes(kind, light=False):
    """Frequencies with masses and a spring, of a block that three corners hold; light: the masses alone count."""
    b = Block(kind, (0.1, 0.06, 0.04), (4, 2, 2), bend=tapered)
    c = [b.labels[p] for p in ((0, 0, 0), (0, 4, 0), (0, 0, 4), (8, 0, 0), (8, 4, 4))]
    t = b.text("PART") + nset("ALL", b.nodes) + nset("FIX", c[:3])
    t += f"*ELEMENT, TYPE=MASS, ELSET=M\n901, {c[3]}\n902, {c[4]}\n*MASS, ELSET=M\n0.7\n"
    t += f"*ELEMENT, TYPE=SPRING1, ELSET=S\n911, {c[3]}\n*SPRING, ELSET=S\n2\n4.e7\n"
    return t + (STEEL.replace("7850", "7850.e-9") if light else STEEL) + "*BOUNDARY\nFIX, 1, 3\n*STEP\n*FREQUENCY\n6\n*END STEP\n"


def polar(kind):
    """A sector whose bore is widened: supports and forces along axes of their own."""
    b = Block(kind, (0.03, math.pi / 3, 0.02), (2, 4, 2),
              bend=lambda p: [(0.05 + p[0]) * math.cos(p[1]), (0.05 + p[0]) * math.sin(p[1]), p[2]])
    radius = lambda x, y: math.hypot(x, y)
    t = b.text("PART") + nset("ALL", b.nodes) + nset("INNER", b.where(lambda x, y, z: abs(radius(x, y) - 0.05) < NEAR))
    t += nset("BASE", b.where(lambda x, y, z: abs(z) < NEAR)) + nset("TIP", b.where(lambda x, y, z: abs(radius(x, y) - 0.08) < NEAR)[:3])
    t += "*TRANSFORM, NSET=INNER, TYPE=C\n0., 0., 0., 0., 0., 1.\n*TRANSFORM, NSET=TIP, TYPE=R\n0.8, 0.6, 0., -0.6, 0.8, 0.\n"
    return t + STEEL + "*BOUNDARY\nINNER, 1, 1, 2.e-5\nINNER, 2, 2\nBASE, 3, 3\n*STEP\n*STATIC\n*CLOAD\nTIP, 1, 500.\n" + END


DECKS = {"loads C3D4": lambda: loads("C3D4"), "loads C3D10": lambda: loads("C3D10"), "loads C3D20": lambda: loads("C3D20"),
         "loads C3D20R": lambda: loads("C3D20R"), "loads C3D8": lambda: loads("C3D8"), "loads C3D8I": lambda: loads("C3D8I"),
         "springs C3D10": lambda: springs("C3D10"), "springs C3D20R": lambda: springs("C3D20R"),
         "tie C3D20": lambda: tie("C3D20"), "tie C3D20R": lambda: tie("C3D20R"), "tie C3D8": lambda: tie("C3D8"),
         "rigid C3D20R": lambda: rigid("C3D20R"), "rigid C3D4": lambda: rigid("C3D4"),
         "kinematic C3D20R": lambda: coupling("C3D20R", "KINEMATIC"),
         "distributing C3D8": lambda: coupling("C3D8", "DISTRIBUTING"),
         "distributing C3D8 tapered": lambda: coupling("C3D8", "DISTRIBUTING", tapered),
         "distributing C3D10": lambda: coupling("C3D10", "DISTRIBUTING TURNED"),
         "distributing C3D20": lambda: coupling("C3D20", "DISTRIBUTING TURNED"),
         "distributing C3D20R": lambda: coupling("C3D20R", "DISTRIBUTING TURNED", tapered),
         "weighted C3D8": lambda: weighted("C3D8"), "weighted C3D20": lambda: weighted("C3D20"),
         "materials C3D8": lambda: materials("C3D8"), "materials C3D10": lambda: materials("C3D10"),
         "materials C3D20": lambda: materials("C3D20"), "materials C3D20R": lambda: materials("C3D20R"),
         # Centrifugal forces of others are integrated at fewer points there: docs/guide/your_files.md has the differences.
         "spin C3D8": lambda: spin("C3D8"), "spin C3D20": lambda: spin("C3D20"), "spin C3D20R": lambda: spin("C3D20R"),
         "spin with masses": lambda: spin("C3D20", True), "mpc C3D8": lambda: mpc("C3D8"), "mpc C3D20": lambda: mpc("C3D20"),
         "modes of materials C3D20": lambda: materials_modes("C3D20"),
         "polar C3D20": lambda: polar("C3D20"), "polar C3D20R": lambda: polar("C3D20R"),
         # Masses of other kinds are integrated at other points there: 2e-4 (C3D20R), 3e-5 (C3D10), 9e-3 (C3D4) of a frequency.
         "modes C3D20": lambda: modes("C3D20"), "modes light C3D4": lambda: modes("C3D4", True),
         "modes light C3D10": lambda: modes("C3D10", True), "modes light C3D20R": lambda: modes("C3D20R", True)}


def labels_of(deck):
    """Of the deck's set ALL."""
    text = deck.split("*NSET, NSET=ALL\n")[1].split("*")[0]
    return [int(word) for word in text.replace("\n", "").split(",") if word.strip()]


def places_of(deck):
    """Node -> coordinates."""
    places = {}
    for part in deck.split("*NODE\n")[1:]:
        for line in part.split("*")[0].splitlines():
            label, *x = line.split(",")
            places[int(label)] = [float(c) for c in x]
    return places
