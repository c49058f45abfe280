#!/usr/bin/env python3
"""Decks that run as they are. Truth: the numbers of CalculiX 2.20 for decks.py, seven digits; all nodes and more decks:
bench/dynamics/decks_beside_ccx.py, which prints these numbers, too."""

import csv
import json
import unittest

import decks
from cli_test import Cli

# Displacements of the three nodes that move most; frequencies.
CALCULIX = {
    'loads C3D4': {63: [2.968465e-06, 1.234556e-05, -3.457874e-05], 61: [-4.034758e-06, 1.273036e-05, -3.453819e-05], 62: [-5.571895e-07, 1.254658e-05, -3.449383e-05]},
    'loads C3D10': {321: [6.194986e-06, 1.006167e-05, -6.890209e-05], 309: [-9.403483e-06, 9.417412e-06, -6.886207e-05], 323: [2.1838e-06, 9.893886e-06, -6.870021e-05]},
    'loads C3D20': {198: [8.909069e-06, 1.220289e-05, -8.562655e-05], 191: [-9.405879e-06, 1.238156e-05, -8.557025e-05], 201: [4.150657e-06, 1.219032e-05, -8.533189e-05]},
    'loads C3D20R': {198: [9.181079e-06, 1.189146e-05, -8.658326e-05], 191: [-9.543324e-06, 1.235398e-05, -8.644421e-05], 201: [4.1957e-06, 1.195452e-05, -8.596458e-05]},
    'loads C3D8': {61: [-5.785333e-06, 1.267839e-05, -5.152843e-05], 63: [4.81622e-06, 1.215719e-05, -5.151744e-05], 62: [-5.113747e-07, 1.241601e-05, -5.142236e-05]},
    'loads C3D8I': {59: [7.575772e-06, 9.511794e-06, -5.085532e-05], 61: [-7.541256e-06, 9.573209e-06, -5.075932e-05], 55: [-3.927541e-06, 1e-05, -5.074025e-05]},
    'springs C3D10': {171: [1.602372e-05, 2.855146e-06, -7.11283e-06], 174: [1.488869e-05, 2.775297e-06, -5.181925e-06], 175: [1.485525e-05, 2.843713e-06, -7.066733e-06]},
    'springs C3D20R': {108: [1.680497e-05, 2.751227e-06, -7.02994e-06], 110: [1.507398e-05, 3.062231e-06, -4.898189e-06], 109: [1.503861e-05, 3.043258e-06, -6.904263e-06]},
    'tie C3D20': {1082: [-5.355828e-06, 2.326434e-08, -4.804861e-05], 1094: [5.355828e-06, -2.326434e-08, -4.804861e-05], 1101: [-5.355828e-06, -2.326434e-08, -4.804861e-05]},
    'tie C3D20R': {1082: [-5.375867e-06, 2.963447e-08, -4.826948e-05], 1094: [5.375867e-06, -2.963447e-08, -4.826948e-05], 1101: [-5.375867e-06, -2.963447e-08, -4.826948e-05]},
    'tie C3D8': {1028: [-1.725924e-06, 6.077922e-10, -1.579804e-05], 1032: [1.725924e-06, -6.077922e-10, -1.579804e-05], 1034: [-1.725924e-06, -6.077922e-10, -1.579804e-05]},
    'rigid C3D20R': {112: [-4.911723e-07, 7.295841e-07, -2.813635e-06], 114: [5.086593e-08, 3.990557e-08, -2.813635e-06], 122: [-2.201532e-07, 3.847448e-07, -2.813635e-06]},
    'rigid C3D4': {37: [-1.7674e-07, 3.140385e-07, -1.12379e-06], 38: [6.449268e-08, 1.147784e-07, -1.12379e-06], 41: [3.057253e-07, -8.448178e-08, -1.12379e-06]},
    'kinematic C3D20R': {112: [-8.232936e-07, 1.032416e-06, -4.167339e-06], 114: [3.840781e-08, 3.212717e-08, -4.167339e-06], 122: [-3.924429e-07, 5.322718e-07, -4.167339e-06]},
    'distributing C3D8': {41: [7.711955e-07, -7.322019e-09, -2.321846e-06], 37: [-6.973378e-07, 6.904541e-08, -2.317117e-06], 39: [3.692562e-08, 3.125529e-08, -2.306384e-06]},
    'distributing C3D8 tapered': {45: [8.605026e-07, -7.607645e-08, -3.012446e-06], 43: [-7.935909e-07, 1.506522e-07, -3.010431e-06], 44: [3.254454e-08, 3.775705e-08, -3.00107e-06]},
    'distributing C3D10': {195: [1.07293e-06, -8.931294e-07, -4.232722e-06], 176: [-1.000166e-06, 9.545707e-07, -4.228486e-06], 197: [5.171535e-07, -4.235097e-07, -4.208665e-06]},
    'distributing C3D20': {124: [1.02175e-06, -9.293044e-07, -4.27051e-06], 112: [-9.466483e-07, 9.978188e-07, -4.26757e-06], 129: [4.78717e-07, -4.569844e-07, -4.252176e-06]},
    'distributing C3D20R': {124: [9.677006e-07, -1.135767e-06, -4.212291e-06], 112: [-8.267832e-07, 1.155523e-06, -4.200389e-06], 129: [4.49719e-07, -5.769946e-07, -4.188594e-06]},
    'weighted C3D8': {43: [-4.541309e-07, 2.254335e-07, -1.358807e-06], 44: [-8.74321e-08, 2.403345e-07, -1.345402e-06], 45: [2.743268e-07, 2.52479e-07, -1.340295e-06]},
    'weighted C3D20': {138: [3.419923e-07, 3.035135e-07, -1.635535e-06], 131: [-5.416714e-07, 2.656965e-07, -1.617755e-06], 141: [1.070056e-07, 2.797456e-07, -1.611753e-06]},
    'materials C3D8': {63: [1.486062e-06, 7.95069e-07, -6.916913e-06], 62: [3.328487e-07, 3.248287e-07, -5.918575e-06], 61: [-3.945748e-07, 1.655e-07, -5.908999e-06]},
    'materials C3D10': {321: [2.506138e-06, 9.416888e-07, -1.007974e-05], 323: [1.324058e-06, 6.443347e-07, -8.551201e-06], 325: [1.991639e-06, 8.929924e-07, -7.981658e-06]},
    'materials C3D20': {198: [4.172504e-06, 1.900851e-06, -1.738599e-05], 201: [1.993645e-06, 9.161026e-07, -1.517641e-05], 192: [8.266719e-07, 4.256259e-07, -1.347739e-05]},
    'materials C3D20R': {198: [5.472955e-06, 1.429904e-06, -2.021094e-05], 201: [2.041741e-06, 5.321374e-07, -1.647751e-05], 199: [3.492246e-06, 8.485644e-07, -1.359371e-05]},
    'spin C3D8': {63: [6.85183e-05, 3.912808e-05, -0.0001775976], 62: [3.477379e-05, 3.306349e-05, -0.0001752798], 61: [9.550729e-06, 2.750136e-05, -0.0001750902]},
    'spin C3D20': {198: [0.0001051355, 4.625073e-05, -0.0003503346], 201: [7.744523e-05, 4.37071e-05, -0.0003496697], 192: [4.664204e-05, 4.009383e-05, -0.0003484797]},
    'spin C3D20R': {198: [0.0001060184, 4.631401e-05, -0.0003526795], 201: [7.77044e-05, 4.415569e-05, -0.0003517771], 192: [4.675332e-05, 4.050764e-05, -0.0003503729]},
    'spin with masses': {198: [0.006629772, -0.001379719, -0.003900325], 199: [0.002044188, -0.0004815353, -0.002676822], 201: [0.002344092, -0.0008003962, -0.002647356]},
    'mpc C3D8': {45: [1.257212e-09, -3.102801e-10, -1.235782e-09], 44: [3.488025e-10, -6.324879e-10, -1.081365e-09], 43: [2.374651e-10, -9.731302e-10, -1.009294e-09]},
    'mpc C3D20': {138: [2.333155e-09, -7.134262e-10, -1.960112e-09], 141: [1.019307e-09, -8.102061e-10, -1.604918e-09], 131: [5.511071e-10, -1.495883e-09, -1.198341e-09]},
    'modes of materials C3D20': [429.725, 948.7337, 2457.974, 2526.261, 4754.39, 6022.418],
    'polar C3D20': {100: [2.283877e-05, 1.38433e-05, 7.113879e-08], 94: [2.261715e-05, 1.097403e-05, 0.0], 97: [2.195582e-05, 1.074351e-05, -2.43393e-07]},
    'polar C3D20R': {100: [2.306053e-05, 1.403632e-05, 7.236553e-08], 94: [2.279969e-05, 1.089695e-05, 0.0], 97: [2.195292e-05, 1.073242e-05, -2.630672e-07]},
    'modes C3D20': [560.6866, 1109.704, 1999.959, 2575.611, 3122.669, 4237.544],
    'modes light C3D4': [1231.857, 2087.225, 4213.212, 5669.097, 7207.288, 8498.481],
    'modes light C3D10': [699.9133, 1321.764, 2321.801, 3178.8, 4229.361, 4934.622],
    'modes light C3D20R': [612.4825, 1156.41, 1943.602, 2470.443, 3539.227, 4483.038],
}


# A bar of two elements, E A / L = 500, with a mass of 4000 on its rigid end, which slides along it.
SLIDES = """*NODE
1,0,0,0
3,2,0,0
*NGEN, NSET=EDGE
1,3
*NCOPY, CHANGE NUMBER=10, OLD SET=EDGE, NEW SET=SIDE, SHIFT
0,1,0
0,0,0, 0,0,1, 0
*NSET, NSET=LOWER
EDGE, SIDE
*NCOPY, CHANGE NUMBER=20, OLD SET=LOWER, SHIFT
0,0,1
0,0,0, 0,0,1, 0
*ELEMENT, TYPE=C3D8, ELSET=BAR
1, 1,2,12,11, 21,22,32,31
2, 2,3,13,12, 22,23,33,32
*NSET, NSET=X0
1,11,21,31
*NSET, NSET=X2
3,13,23,33
*MATERIAL, NAME=M
*ELASTIC
1000., 0.
*DENSITY
2.
*SOLID SECTION, ELSET=BAR, MATERIAL=M
*NODE
99,2,.5,.5
*RIGID BODY, NSET=X2, REF NODE=99
*ELEMENT, TYPE=MASS, ELSET=P
61,99
*MASS, ELSET=P
4000.
*BOUNDARY
X0, 1, 3
*BOUNDARY
99, 2, 6
*STEP
*FREQUENCY
1
"""


class Decks(Cli):
    def test_an_infinite_eigenvalue_of_a_constraint_is_no_mode(self):
        out = self.expect(0, "simulate", str(self.file("slides.inp", SLIDES)), "--json")
        self.assertAlmostEqual(json.loads(out.stdout)["initial"]["modes"][0]["frequency"], 0.05626, delta=2e-5)

    def moved(self, name, deck, labels):
        """Displacements of nodes, by markers of a model that takes the deck."""
        self.file(f"{name}.inp", deck)
        markers = "".join(f"n{label} = {{ body = \"part\", node = {label} }}\n" for label in labels)
        quantities = ", ".join(f'"n{label}.position"' for label in labels)
        model = self.file(f"{name}.toml", f'bodies.part = {{ type = "solid", mesh = {{ file = "{name}.inp", take = "all" }} }}\n'
                          f"[markers]\n{markers}[output]\nquantities = [{quantities}]\n")
        self.expect(0, "simulate", str(model), "--no-page", "--out", str(self.folder / name))
        with open(self.folder / name / "quantities.csv") as file:
            row = list(csv.DictReader(file))[-1]
        places = decks.places_of(deck)
        return {n: [float(row[f"n{n}.position.{d}"]) - places[n][k] for k, d in enumerate("xyz")] for n in labels}

    def test_displacements_are_those_of_calculix(self):
        for name, truth in CALCULIX.items():
            if not isinstance(truth, dict):
                continue
            with self.subTest(name):
                size = max(abs(x) for u in truth.values() for x in u)
                ours = self.moved(name.replace(" ", "_"), decks.DECKS[name](), list(truth))
                for label, u in truth.items():
                    for a, b in zip(ours[label], u):
                        self.assertLess(abs(a - b), 1e-6 * size, label)

    def test_frequencies_are_those_of_calculix(self):
        for name, truth in CALCULIX.items():
            if isinstance(truth, dict):
                continue
            with self.subTest(name):
                deck = self.file(name.replace(" ", "_") + ".inp", decks.DECKS[name]())
                found = json.loads(self.expect(0, "simulate", str(deck), "--json").stdout)["initial"]["modes"]
                self.assertEqual(len(found), len(truth))
                for mode, frequency in zip(found, truth):
                    self.assertLess(abs(mode["frequency"] / frequency - 1), 1e-6)


if __name__ == "__main__":
    unittest.main()
