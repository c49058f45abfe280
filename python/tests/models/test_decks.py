"""Decks of other programs, by themselves and in a model. Truth: E A / l of a bar."""
import pathlib
import tempfile
import unittest

import espalier as esp

BAR = """*NODE
1,0,0,0
2,2,0,0
3,2,1,0
4,0,1,0
5,0,0,1
6,2,0,1
7,2,1,1
8,0,1,1
*NSET, NSET=LEFT
1,4,5,8
*NSET, NSET=RIGHT
2,3,6,7
*ELEMENT, TYPE=C3D8, ELSET=BAR
1, 1,2,3,4,5,6,7,8
*MATERIAL, NAME=M
*ELASTIC
1000, 0
*SOLID SECTION, ELSET=BAR, MATERIAL=M
*BOUNDARY
LEFT, 1, 3
*STEP
*STATIC
*CLOAD
RIGHT, 1, 1.
"""


class Decks(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = pathlib.Path(folder.name) / "bar.inp"
        self.path.write_text(BAR)

    def test_a_deck_runs_as_it_is(self):
        simulation = esp.Simulation(self.path, quantities=["part_hold_1.force.x"])
        simulation.run()
        self.assertAlmostEqual(simulation.value("part_hold_1.force.x"), -4, places=12)

    def test_a_model_takes_of_a_deck_what_it_names(self):
        model = esp.Model(bodies={"bar": {"type": "solid", "mesh": {"file": str(self.path), "take": ["boundary"]}}})
        model.marker("end", body="bar", nodes="RIGHT")
        model.force("pull", "load", a="end", force=[8, 0, 0])
        model.equation("level", body="bar", terms=[{"node": 2, "direction": "x"}, {"node": 3, "direction": "x", "factor": -1}])
        result = model.statics(linear=True, quantities=["end.position.x"])
        self.assertAlmostEqual(result["end.position.x"][-1], 2 + 8 / 500, places=12)

    def test_what_cannot_be_taken_is_refused(self):
        self.path.write_text(BAR.replace("*STATIC", "*BUCKLE"))
        with self.assertRaisesRegex(esp.InvalidInputError, r"bar\.inp:\d+: .*\*BUCKLE"):
            esp.Simulation(self.path)

    def test_wedges_that_lock_in_bending_say_so(self):
        place = lambda i, j, k: 1 + i + 9 * (j + 2 * k)  # noqa: E731
        nodes = [f"{place(i, j, k)},{i},{j},{k}" for k in (0, 1) for j in (0, 1) for i in range(9)]
        wedges = []
        for i in range(8):
            for corners in (((i, 0), (i + 1, 0), (i + 1, 1)), ((i, 0), (i + 1, 1), (i, 1))):
                wedges.append([place(*c, k) for k in (0, 1) for c in corners])
        rows = [f"{1 + e}," + ",".join(map(str, w)) for e, w in enumerate(wedges)]
        end = [",".join(str(place(i, j, k)) for j in (0, 1) for k in (0, 1)) for i in (0, 8)]
        self.path.write_text("\n".join(
            ["*NODE", *nodes, "*ELEMENT, TYPE=C3D6, ELSET=BAR", *rows, "*NSET, NSET=LEFT", end[0], "*NSET, NSET=RIGHT", end[1],
             "*MATERIAL, NAME=M", "*ELASTIC", "1000, 0", "*SOLID SECTION, ELSET=BAR, MATERIAL=M", "*BOUNDARY", "LEFT, 1, 3",
             "*STEP", "*STATIC", "*CLOAD", "RIGHT, 3, 0.001", ""]))
        model = esp.Model({"bodies": {"bar": {"mesh": {"file": str(self.path), "take": "all"}}}})
        self.assertTrue(any("wedge6 elements, which lock" in notice for notice in model.run().summary["notices"]))


if __name__ == "__main__":
    unittest.main()
