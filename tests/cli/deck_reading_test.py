#!/usr/bin/env python3
"""Decks as strangers write them: ways of writing that mean the same, and words that change the answer and are refused by name. Truth: a bar of
two cubes with E A / l = 500 (u = F / 500), its mass, and what messages say."""

import csv
import json
import unittest

from cli_test import Cli

NODES = "".join(f"{1 + x + 10 * y + 20 * z}, {x}., {y}., {z}.\n" for z in (0, 1) for y in (0, 1) for x in (0, 1, 2))
ELEMENTS = "1, 1,2,12,11, 21,22,32,31\n2, 2,3,13,12, 22,23,33,32\n"
REST = "*NSET, NSET=X0\n1,11,21,31\n*NSET, NSET=X2\n3,13,23,33\n*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.\n*DENSITY\n2.\n*SOLID SECTION, ELSET=BAR, MATERIAL=M\n"
BAR = f"*NODE\n{NODES}*ELEMENT, TYPE=C3D8, ELSET=BAR\n{ELEMENTS}{REST}"
CLAMP = "*BOUNDARY\nX0, 1, 3\n"
PULL = "*CLOAD\nX2, 1, 1.\n"
STATIC = "*STEP\n*STATIC\n"

GRIDS = "".join(f"GRID,{1 + x + 10 * y + 20 * z},,{x}.,{y}.,{z}.\n" for z in (0, 1) for y in (0, 1) for x in (0, 1, 2))
BULK = GRIDS + "CHEXA,1,7,1,2,12,11,21,22\n+,32,31\nCHEXA,2,7,2,3,13,12,22,23\n+,33,32\nPSOLID,7,3\nMAT1,3,1000.,,0.,2.\nSPC1,1,123,1,11,21,31\n"
CASE = "SOL 101\nCEND\nSPC=1\nLOAD=2\nBEGIN BULK\n"
FORCES = "".join(f"FORCE,2,{n},,1.,1.,0.,0.\n" for n in (3, 13, 23, 33))


class DecksOfStrangers(Cli):
    def end(self, deck, name="bar.inp", more="", others=()):
        """The motion of node 3 along x, and what is said."""
        self.file(name, deck)
        for path, content in others:
            (self.folder / path).parent.mkdir(exist_ok=True)
            self.file(path, content)
        model = self.file("bar.toml", f'bodies.bar = {{ type = "solid", mesh = {{ file = "{name}", take = "all"{more} }} }}\n'
                          'markers.end = { body = "bar", node = 3 }\n[output]\nquantities = ["end.position"]\n')
        run = self.expect(0, "simulate", model, "--no-page", "--out", self.folder / "out")
        with open(self.folder / "out/quantities.csv") as file:
            return float(list(csv.DictReader(file))[-1]["end.position.x"]) - 2, run.stdout + run.stderr

    def same(self, deck, **more):
        self.assertAlmostEqual(self.end(deck, **more)[0], 8e-3, delta=1e-13)

    def refused(self, deck, *says, name="bar.inp", more=""):
        self.file(name, deck)
        model = self.file("bar.toml", f'bodies.bar = {{ type = "solid", mesh = {{ file = "{name}", take = "all"{more} }} }}\n')
        self.expect(2, "simulate", model, "--no-page", says=(name + ":",) + says)

    def test_blanks_tabs_comments_and_line_ends(self):
        ugly = BAR.replace("*NODE", "** first\n  ** a comment behind blanks\n\t *Node").replace(
            "*ELEMENT, TYPE=C3D8, ELSET=BAR", "*Element ,\n** between\n type = c3d8 ,\n  elset=Bar").replace("1000.", " 1.D+3")
        self.same((ugly + CLAMP.lower() + STATIC + PULL.lower()).replace("\n", "\r\n"))

    def test_lines_come_from_other_files(self):
        head = "*ELEMENT, TYPE=C3D8, ELSET=BAR\n" + ELEMENTS + REST + CLAMP + STATIC + PULL
        lines = NODES.splitlines(keepends=True)
        for nodes in ("*NODE, INPUT=nodes.txt\n", "*NODE\n*INCLUDE, INPUT=nodes.txt\n"):
            self.same(nodes + head, others=[("nodes.txt", NODES)])
        self.same("*NODE\n" + lines[0] + "*INCLUDE, INPUT=nodes.txt\n" + lines[-1] + head, others=[("nodes.txt", "".join(lines[1:-1]))])
        # Beside the file that includes, and beside the first one.
        for inner in ("b.inp", "sub/b.inp"):
            self.same("*INCLUDE, INPUT=sub/a.inp\n" + head, others=[("sub/a.inp", f"*INCLUDE, INPUT={inner}\n"), ("sub/b.inp", "*NODE\n" + NODES)])

    def test_faults_in_other_files_are_named_there(self):
        self.file("nodes.inp", "*NODE\n" + NODES + "*NSET, NSET=GAPS\nNOWHERE\n")
        mesh = self.file("bar.inp", "** first\n*INCLUDE, INPUT=nodes.inp\n*ELEMENT, TYPE=C3D8, ELSET=BAR\n" + ELEMENTS)
        self.expect(2, "mesh", mesh, says="nodes.inp:15: node set NOWHERE is not defined")

    def test_sets_of_the_nodes_of_elements_and_free_surfaces(self):
        # The second cube moves as a whole: the first one alone is strained.
        deck = BAR + "*ELSET, ELSET=SECOND\n2\n*NSET, NSET=MOVED, ELSET=SECOND\n" + CLAMP + STATIC + "*BOUNDARY\nMOVED, 1, 1, 8.e-3\n"
        self.same(deck)
        # On all faces of the bar: it is compressed alike from all sides; those at the clamped end do nothing.
        moved, _ = self.end(BAR + "*SURFACE, NAME=ALL\nBAR,\n" + CLAMP.replace("3", "1") + "*BOUNDARY\n1, 2, 3\n11, 3\n" + STATIC + "*DSLOAD\nALL, P, -4.\n")
        self.assertAlmostEqual(moved, 8e-3, delta=1e-13)

    def test_nodes_behind_those_of_the_type_are_said(self):
        moved, said = self.end(BAR.replace("32,31\n2,", "32,31, 33\n2,") + CLAMP + STATIC + PULL)
        self.assertAlmostEqual(moved, 8e-3, delta=1e-13)
        self.assertIn("more nodes than their type has, those behind are left out: C3D8 (1)", said)

    def test_a_surface_of_nodes_has_the_name_of_a_set(self):
        rigid = "*SURFACE, NAME=X2, TYPE=NODE\nX2\n13\n*NODE\n99, 2.5,.5,.5\n*COUPLING, REF NODE=99, SURFACE=X2, CONSTRAINT NAME=C\n*KINEMATIC\n1, 3\n"
        self.same(BAR + rigid + CLAMP + STATIC + "*CLOAD\n99, 1, 4.\n")
        # The surface is meant, not the set of its name.
        other = rigid.replace("TYPE=NODE\nX2\n13", "TYPE=NODE\n3,\n13,\n23,\n33").replace("*SURFACE", "*NSET, NSET=X2\n1\n*SURFACE")
        self.same((BAR + other).replace("*NSET, NSET=X2\n3,13,23,33\n", "") + CLAMP + STATIC + "*CLOAD\n99, 1, 4.\n")

    def test_a_coupling_that_is_left_is_named(self):
        reference = "*SURFACE, NAME=S, TYPE=NODE\nX2\n*NODE\n99, 2.5,.5,.5\n*ORIENTATION, NAME=O\n0,1,0, 1,0,0\n"
        for kind in ("*KINEMATIC\n1, 3\n", "*DISTRIBUTING\n1, 3\n"):
            self.refused(BAR + reference + "*COUPLING, REF NODE=99, SURFACE=S, CONSTRAINT NAME=C, ORIENTATION=O\n" + kind + CLAMP + STATIC, "*COUPLING ORIENTATION")

    def test_names_with_that_of_the_assembly(self):
        parts = ("*PART, NAME=P\n*NODE\n" + NODES + "*ELEMENT, TYPE=C3D8, ELSET=BAR\n" + ELEMENTS + "*SOLID SECTION, ELSET=BAR, MATERIAL=M\n*END PART\n"
                 "*ASSEMBLY, NAME=Assembly\n*INSTANCE, NAME=P-1, PART=P\n*END INSTANCE\n*NSET, NSET=X0, INSTANCE=P-1\n1,11,21,31\n"
                 "*NSET, NSET=X2, INSTANCE=P-1\n3,13,23,33\n*END ASSEMBLY\n*MATERIAL, NAME=M\n*ELASTIC\n1000., 0.\n*DENSITY\n2.\n")
        self.same(parts + CLAMP.replace("X0", "ASSEMBLY.X0") + STATIC + PULL.replace("X2", "assembly.X2"))

    def test_a_node_on_the_axis_of_a_cylindrical_system(self):
        self.same(BAR + "*TRANSFORM, NSET=X0, TYPE=C\n0,0,0, 1,0,0\n" + CLAMP + STATIC + PULL)

    def test_words_of_programs_that_change_nothing(self):
        deck = self.file("modes.inp", BAR + CLAMP + "*STEP, NAME=S, PERTURBATION\n*FREQUENCY, EIGENSOLVER=LANCZOS, SIM, ACOUSTIC COUPLING=ON, NORMALIZATION=MASS\n3, , , , ,\n")
        self.expect(0, "simulate", deck, "--no-page", "--out", self.folder / "modes")
        self.same(CASE + BULK + FORCES + "PLOTEL,900,1,2\nMAT4,9,1.\n", name="bar.bdf")

    def test_what_goes_on_from_other_runs(self):
        self.refused(BAR + "*RESTART, READ, STEP=1\n" + CLAMP + STATIC + PULL, "*RESTART, READ goes on from another run")

    def test_words_that_change_the_answer(self):
        curve = "*AMPLITUDE, NAME=A{}\n0., 0., 1., 1.\n"
        pull = PULL.replace("*CLOAD", "*CLOAD, AMPLITUDE=A")
        self.same(BAR + curve.format("") + CLAMP + STATIC + pull)
        for word in ("VALUE=ABSOLUTE", "SHIFTX=0.5", "SHIFTY=1.", "TIME=TOTAL TIME", "DEFINITION=USER"):
            self.refused(BAR + curve.format(", " + word) + CLAMP + STATIC + pull, "*AMPLITUDE " + word.split("=")[0])
        self.refused(BAR + CLAMP + "*STEP\n*STATIC, RIKS\n" + PULL, "*STATIC RIKS")
        self.refused(BAR + CLAMP + "*STEP\n*STATIC, STABILIZE\n" + PULL, "*STATIC STABILIZE")
        flat = "*NODE\n51, 5.,0.,0.\n52, 6.,0.,0.\n53, 6.,1.,0.\n*ELEMENT, TYPE=CPS3, ELSET=F\n71, 51,52,53\n"
        self.refused(BAR + flat + CLAMP + STATIC + PULL, "elements CPS3")

    def test_steps_behind_others(self):
        two = BAR + CLAMP + STATIC + PULL + "*END STEP\n"
        self.refused(two + "*STEP\n*DYNAMIC, DIRECT\n0.01, 0.1\n", "*DYNAMIC from where the steps before it have led", more=", step = 2")
        # NLGEOM stays: u / l = 0.1 of St. Venant and Kirchhoff's law needs E A (1 + u / l) (u / l + (u / l)^2 / 2) with u / l = 0.1.
        force = 1000 * 1.1 * (0.1 + 0.005) / 4
        large = (BAR + CLAMP + "*STEP, NLGEOM\n*STATIC\n" + PULL + "*END STEP\n" + STATIC + f"*CLOAD\nX2, 1, {force!r}\n")
        self.assertAlmostEqual(self.end(large, more=", step = 2")[0], 0.2, delta=1e-9)

    def test_gravity_in_another_direction(self):
        # rho g l^2 / (2 E) = 2 * 4 * 4 / 2000; CalculiX adds the second one, others replace the first.
        weight = BAR + CLAMP + STATIC + "*DLOAD\nBAR, GRAV, 4., 0.,1.,0.\n*END STEP\n" + STATIC
        self.refused(weight + "*DLOAD\nBAR, GRAV, 4., 1.,0.,0.\n", "*DLOAD GRAV in another direction than in the step before, without OP=NEW", more=", step = 2")
        moved, _ = self.end(weight + "*DLOAD, OP=NEW\nBAR, GRAV, 4., 1.,0.,0.\n", more=", step = 2")
        self.assertAlmostEqual(moved, 16e-3, delta=1e-13)

    def test_new_loads_of_faces_once_in_a_step(self):
        faces = "*SURFACE, NAME=END\n2, S4\n"
        both = "*DLOAD, OP=NEW\n2, P4, -1.\n*DSLOAD, OP=NEW\nEND, P, -3.\n"
        self.same(BAR + faces + CLAMP + STATIC + "*DLOAD\n2, P4, -7.\n*END STEP\n" + STATIC + both, more=", step = 2")

    def test_motions_without_nlgeom_are_said(self):
        moved, said = self.end(BAR + CLAMP + "*STEP\n*DYNAMIC, EXPLICIT\n0.01, 0.02\n" + PULL)
        self.assertIn("the step has no NLGEOM", said)
        self.assertIn("*DYNAMIC EXPLICIT", said)

    def test_formulations_that_are_others_are_said(self):
        for types in (("C3D8R", "C3D8R"), ("C3D8", "C3D8I")):
            deck = BAR.replace("TYPE=C3D8,", f"TYPE={types[0]},").replace("\n2, 2,3", f"\n*ELEMENT, TYPE={types[1]}, ELSET=BAR\n2, 2,3")
            moved, said = self.end(deck + CLAMP + STATIC + PULL)
            self.assertAlmostEqual(moved, 8e-3, delta=1e-13)
            self.assertIn('hex8 = "enhanced"', said)
            self.assertIn(types[0], said)

    def test_bounds_of_frequencies_are_said(self):
        for bounds, says in ((", , 1.", "also those above 1."), (", 0.01", "also those below 0.01")):
            deck = self.file("modes.inp", BAR + CLAMP + f"*STEP\n*FREQUENCY\n3{bounds}\n")
            run = self.expect(0, "simulate", deck, "--no-page", "--out", self.folder / "modes")
            self.assertIn("the lowest 3 modes are given, " + says, run.stdout + run.stderr)

    def test_loads_of_nastran_that_a_sum_has(self):
        self.same(CASE + BULK + FORCES, name="bar.bdf")
        summed = BULK + FORCES.replace("FORCE,2", "FORCE,11") + "LOAD,2,1.,1.,11,1.,12\n"
        self.same(CASE + summed + "GRAV,12,,0.,1.,0.,0.\n", name="bar.bdf")
        self.refused(CASE + summed + "PLOAD2,12,1.,1\n", "PLOAD2", name="bar.bdf")
        self.refused(CASE + summed + "GRAV,12,,0.,1.,0.,0.\nTEMP,12,3,100.\n", "TEMP", name="bar.bdf")
        self.refused(CASE + summed, "LOAD = 12", name="bar.bdf")

    def test_case_control_of_nastran(self):
        self.file("case.inc", "SPC=1\n")
        self.refused(CASE.replace("SPC=1\n", "INCLUDE 'case.inc'\n") + BULK + FORCES, "INCLUDE before BEGIN BULK", name="bar.bdf")
        self.refused(CASE.replace("LOAD=2", "SYM 1\nLOAD=2\nSYM 2\nLOAD=2") + BULK + FORCES, "SYM", name="bar.bdf")

    def test_lines_of_nastran_that_are_too_long(self):
        self.refused(CASE + BULK.replace("SPC1,1,123,1,11,21,31\n", "SPC1,1,123,1,11,21,31,31,31,1,11\n") + FORCES, "'1,11' stands behind the 8 fields", name="bar.bdf")
        self.same(CASE + BULK.replace("CHEXA,1,7,1,2,12,11,21,22\n+,32,31", "CHEXA,1,7,1,2,12,11,21,22,+A\n+A,32,31") + FORCES, name="bar.bdf")

    def test_what_follows_in_nastran(self):
        reference = "GRID,99,,2.5,.5,.5\nRBE3,90,,99,{},1.,123,3,13\n+,23,33\n"
        load = "FORCE,2,99,,4.,1.,0.,0.\n"
        self.same(CASE + BULK + reference.format("123") + load, name="bar.bdf")
        self.refused(CASE + BULK + reference.format("3") + load, "RBE3 whose reference follows in some directions", name="bar.bdf")
        self.same(CASE + BULK + "GRID,99,,2.5,.5,.5\nRBE2,90,99,321,3,13,23,33\n" + load, name="bar.bdf")

    def test_masses_of_sections(self):
        # A cube of each material.
        two = (BAR + "*ELSET, ELSET=SECOND\n2\n*ELSET, ELSET=FIRST\n1\n*MATERIAL, NAME=HEAVY\n*ELASTIC\n1000., 0.\n*DENSITY\n7.\n").replace(
            "*SOLID SECTION, ELSET=BAR", "*SOLID SECTION, ELSET=FIRST") + "*SOLID SECTION, ELSET=SECOND, MATERIAL=heavy\n"
        out = json.loads(self.expect(0, "mesh", self.file("bar.inp", two), "--json").stdout)
        self.assertAlmostEqual(out["masses"]["FIRST"], 2, delta=1e-14)
        self.assertAlmostEqual(out["masses"]["SECOND"], 7, delta=1e-14)

    def test_a_shear_modulus_that_does_not_fit(self):
        moved, said = self.end(CASE + BULK.replace("1000.,,0.,2.", "1000.,700.,0.,2.") + FORCES, name="bar.bdf")
        self.assertAlmostEqual(moved, 8e-3, delta=1e-13)
        self.assertIn("MAT1 has G = 700, and E / (2 (1 + NU)) is 500", said)

    def test_modes_of_a_free_structure(self):
        # E A / l of the two cubes along x, consistent masses, no Poisson's ratio: omega^2 = 12 E / (rho h^2) of one and 3 E / (rho h^2) of the
        # other motion of a bar with three nodes; with the turning and bending ones six are of the body as a whole.
        free = BAR + "*STEP\n*FREQUENCY\n36\n*END STEP\n"
        run = self.expect(0, "simulate", self.file("free.inp", free), "--no-page", "--out", self.folder / "free", "--json")
        found = [mode["frequency"] for mode in json.loads(run.stdout)["initial"]["modes"]]
        self.assertLess(max(found[:6]), 1e-4 * found[6])
        for square in (3, 12):
            along = (square * 1000 / 2) ** 0.5 / 6.283185307179586
            self.assertLess(min(abs(f / along - 1) for f in found), 1e-9)
        self.assertIn("the modes are those of a structure that is free", run.stdout + run.stderr)
        # A free cube beside a held one, as one body: its six motions are there, too.
        apart = BAR.replace("2, 2,3,13,12, 22,23,33,32\n", "2, 42,3,13,52, 62,23,33,72\n").replace("*ELEMENT", "*NODE\n42,1.1,0.,0.\n52,1.1,1.,0.\n62,1.1,0.,1.\n72,1.1,1.,1.\n*ELEMENT", 1)
        run = self.expect(0, "simulate", self.file("apart.inp", apart + CLAMP + "*STEP\n*FREQUENCY\n8\n"), "--no-page", "--out", self.folder / "apart", "--json")
        found = [mode["frequency"] for mode in json.loads(run.stdout)["initial"]["modes"]]
        self.assertLess(max(found[:6]), 1e-4 * found[6])
        nastran = "SOL 103\nCEND\nMETHOD=5\nBEGIN BULK\n" + BULK.replace("SPC1,1,123,1,11,21,31\n", "") + "EIGRL,5,,{}\n"
        for bound, count in (("100.", 20), ("", 1)):
            run = self.expect(0, "simulate", self.file("free.bdf", nastran.format(bound)), "--no-page", "--out", self.folder / ("n" + str(count)), "--json")
            self.assertEqual(len(json.loads(run.stdout)["initial"]["modes"]), count)
            self.assertIn(f"EIGRL states no number of modes (ND): {count}", run.stdout + run.stderr)


if __name__ == "__main__":
    unittest.main()
