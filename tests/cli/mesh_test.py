#!/usr/bin/env python3
"""`espalier mesh`: what a file holds, and first models that run as they are written. Truth: a block by hand."""

import json
import pathlib
import unittest

from cli_test import Cli

ROOT = pathlib.Path(__file__).resolve().parents[2]


def block(nx, material, more=""):
    """nx x 1 x 1 cubes of edge 1 as an Abaqus deck."""
    node = lambda i, j, k: 1 + i + (nx + 1) * (j + 2 * k)
    lines = ["*NODE"] + [f"{node(i, j, k)},{i}.,{j}.,{k}." for k in (0, 1) for j in (0, 1) for i in range(nx + 1)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=ALL"]
    for i in range(nx):
        corners = [node(i + a, b, c) for c in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        lines.append(",".join(map(str, [i + 1] + corners)))
    return "\n".join(lines) + "\n" + more + material


STEEL = "*MATERIAL, NAME=Steel\n*ELASTIC\n2.1e11, 0.3\n*DENSITY\n7850\n*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL\n"


class Meshes(Cli):
    def write(self, name, text):
        return str(self.file(name, text))

    def test_what_a_file_holds(self):
        path = self.write("part.inp", block(4, STEEL, "*ELEMENT, TYPE=MASS\n99, 1\n*STEP\n*STATIC\n*END STEP\n"))
        found = json.loads(self.expect(0, "mesh", path, "--json").stdout)
        self.assertEqual((found["nodes"], found["elements"]), (20, {"hex8": 4}))
        self.assertAlmostEqual(found["solids"]["volume"], 4, places=13)
        self.assertEqual([round(x, 12) for x in found["solids"]["centre"]], [2, 0.5, 0.5])
        self.assertEqual(found["materials"][0]["young"], 2.1e11)
        self.assertTrue(any("MASS (1)" in n for n in found["notices"]), found["notices"])
        text = self.expect(0, "mesh", path).stdout
        for part in ("4 hex8 on 20 nodes", "4 x 1 x 1", "m, kg, s", "Steel", "*STEP (1)"):
            self.assertIn(part, text)

    def test_first_models_run(self):
        # The pressure on the far end, 1e-6 of Young's modulus: the clamp bears it.
        for name, material, young in (("steel.inp", STEEL, 2.1e11), ("none.inp", "", 2.1e11)):
            path = self.write(name, block(4, material))
            model = str(self.folder / (name + ".toml"))
            self.expect(0, "mesh", path, "--model", model)
            results = self.folder / (name + ".out")
            self.expect(0, "simulate", model, "--out", str(results))
            names, *rows = (results / "quantities.csv").read_text().splitlines()
            force = float(rows[-1].split(",")[names.split(",").index("clamp.force.x")])
            self.assertAlmostEqual(force / (young * 1e-6), 1, places=9)
            self.assertIn("there already", self.expect(2, "mesh", path, "--model", model).stderr)
        # Two pieces that share no node, and names that end with a NUL: both are held, so that the model runs.
        pieces = block(2, STEEL.replace("NAME=Steel", "NAME=Steel\0"))
        shift = "".join(f"{n + 50},{x}.,{y}.,{z}.\n" for n, (x, y, z) in enumerate(
            ((5, 0, 0), (6, 0, 0), (6, 1, 0), (5, 1, 0), (5, 0, 1), (6, 0, 1), (6, 1, 1), (5, 1, 1))))
        path = self.write("two.inp", pieces + "*NODE\n" + shift + "*ELEMENT, TYPE=C3D8, ELSET=ALL\n9, "
                          + ", ".join(str(n + 50) for n in range(8)) + "\n")
        model = str(self.folder / "two.toml")
        self.expect(0, "mesh", path, "--model", model)
        self.expect(0, "simulate", model)
        page = self.folder / "page"
        self.expect(0, "mesh", path, "--page", str(page))
        self.assertIn("<html", (page / "index.html").read_text()[:400].lower())

    def first_model_of(self, name, deck, *says):
        """Its text and quantities; it runs."""
        path, model = self.write(name + ".inp", deck), self.folder / (name + ".toml")
        self.expect(0, "mesh", path, "--model", str(model))
        run = self.expect(0, "simulate", str(model), "--no-page", "--out", str(self.folder / name), "--json")
        for part in says:
            self.assertIn(part, model.read_text())
        names, *rows = (self.folder / name / "quantities.csv").read_text().splitlines()
        return dict(zip(names.split(","), map(float, rows[-1].split(",")))), json.loads(run.stdout)

    def test_first_models_of_decks(self):
        sets = "*NSET, NSET=X0\n1,6,11,16\n*NSET, NSET=X4\n5,10,15,20\n"  # of four cubes
        pull = "*STEP\n*STATIC\n*CLOAD\nX4, 1, 25.\n"
        clamp = "*BOUNDARY\nX0, 1, 3\n"
        values, _ = self.first_model_of("whole", block(4, STEEL, sets) + clamp + pull, 'take = "all"')
        self.assertAlmostEqual(values["part_hold_1.force.x"], -100, delta=1e-9)
        # It holds nothing: one face is held, another pressed.
        values, _ = self.first_model_of("loose", block(4, STEEL, sets) + pull, "does not hold it", "[supports]\nclamp")
        self.assertAlmostEqual(abs(values["clamp.force.x"]) / 2.1e5, 1, delta=1e-9)
        # Held in part: the same.
        self.first_model_of("half", block(4, STEEL, sets) + "*BOUNDARY\nX0, 1, 1\n" + pull, "does not hold it")
        # A second cube that only a contact would hold, its nodes 50 higher: it is held, and bears its load.
        other = "*NODE\n" + "".join(f"{n},{4 + x}.,{y}.,{z}.\n" for n, x, y, z in (
            (51, 0, 0, 0), (52, 1, 0, 0), (53, 1, 1, 0), (54, 0, 1, 0), (55, 0, 0, 1), (56, 1, 0, 1), (57, 1, 1, 1), (58, 0, 1, 1))
        ) + "*ELEMENT, TYPE=C3D8, ELSET=ALL\n9, 51,52,53,54,55,56,57,58\n"
        contact = "*SURFACE, NAME=A\n4, S4\n*SURFACE, NAME=B\n9, S6\n*CONTACT PAIR, INTERACTION=I\nA, B\n"
        values, _ = self.first_model_of("contact", block(4, STEEL, sets) + other + contact + clamp + pull, "*CONTACTPAIR (1", "piece_1", '"boundary"')
        self.assertAlmostEqual(values["part_hold_1.force.x"], -100, delta=1e-9)
        # Tied, or joined by an equation at each node, it needs nothing.
        tie = "*SURFACE, NAME=A\n4, S4\n*SURFACE, NAME=B\n9, S6\n*TIE, NAME=T\nB, A\n"
        model = self.folder / "tied.toml"
        self.first_model_of("tied", block(4, STEEL, sets) + other + tie + clamp + pull, 'take = "all"')
        self.assertNotIn("piece", model.read_text())
        # What cannot be taken is left out, with the reason; laws that are not ours are steel.
        spring = "*NODE\n99,9.,9.,9.\n*ELEMENT, TYPE=SPRING2, ELSET=S\n77, 5, 99\n*SPRING, ELSET=S\n1, 1\n1e6\n"
        self.first_model_of("spring", block(4, STEEL, sets) + spring + clamp + pull, "#   springs: ", "between nodes 5 and 99 is not taken", '"cload"')
        law = STEEL.replace("*ELASTIC\n2.1e11, 0.3", "*HYPERELASTIC, NEO HOOKE\n80., 0.001")
        self.first_model_of("law", block(4, law, sets) + clamp + pull, "*HYPERELASTIC", "# of steel")
        # A deck with a fault is a mesh all the same.
        self.first_model_of("fault", block(4, STEEL, sets) + "*BOUNDARY\nNOWHERE, 1, 3\n" + pull, "cannot be taken: ", "NOWHERE", "[supports]\nclamp")
        # Modes, also of a structure that is free.
        for name, held in (("modes", clamp), ("free", "")):
            _, run = self.first_model_of(name, block(4, STEEL, sets) + held + "*STEP\n*FREQUENCY\n8\n", 'take = "all"')
            self.assertEqual(len(run["initial"]["modes"]), 8)

    def test_what_is_wrong_is_said(self):
        self.assertIn("name a mesh file", self.expect(2, "mesh").stderr)
        self.assertIn("there is no file", self.expect(2, "mesh", str(self.folder / "none.inp")).stderr)
        self.assertIn("unknown kind of mesh file", self.expect(2, "mesh", self.write("a.txt", "")).stderr)
        shell = self.write("shell.inp", "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n*ELEMENT, TYPE=S4\n1,1,2,3,4\n")
        self.assertIn("no solids", self.expect(2, "mesh", shell, "--model", str(self.folder / "s.toml")).stderr)
        deck = self.write("deck.inp", block(1, STEEL))
        for command in ("simulate", "modes"):
            self.assertIn("is a mesh", self.expect(2, command, deck).stderr)

    def test_the_table_of_formats_is_that_of_the_guide(self):
        table = self.expect(0, "mesh", "--formats").stdout
        self.assertIn(table, (ROOT / "docs/guide/your_files.md").read_text())


if __name__ == "__main__":
    unittest.main()
