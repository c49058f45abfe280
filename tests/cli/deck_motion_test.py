#!/usr/bin/env python3
"""Decks that move. Truths: the same motion seen from a frame that moves with the support, where the bar's own weight takes its place; the same
deck with short steps. Beside CalculiX: bench/dynamics/motions_beside_ccx.py."""

import csv
import math
import unittest

import decks
from cli_test import Cli

PERIOD, WAY, POINTS = 1e-3, 1e-3, 800
BAR = decks.Block("C3D20", (0.2, 0.02, 0.02), (4, 1, 1))
TIP = BAR.labels[max(BAR.labels)]


def curve(of):
    """*AMPLITUDE over the step."""
    return "*AMPLITUDE, NAME=A\n" + "".join(f"{k * PERIOD / POINTS:.8e}, {of(k / POINTS):.10e}\n" for k in range(POINTS + 1))


def smooth(s):
    return s - math.sin(2 * math.pi * s) / (2 * math.pi)


def led(how):
    """The clamped end goes up by WAY."""
    return (decks.clamped(BAR, "") + curve(smooth) + f"*BOUNDARY\nFIX, 1, 2\n*STEP, NLGEOM\n*DYNAMIC{how}\n*BOUNDARY, AMPLITUDE=A\nFIX, 3, 3, {WAY}\n*END STEP\n")


def shaken(how):
    """The same in a frame that goes up with it."""
    weight = WAY / PERIOD**2 * 2 * math.pi
    return (decks.clamped(BAR, "") + curve(lambda s: math.sin(2 * math.pi * s)) +
            f"*BOUNDARY\nFIX, 1, 3\n*STEP, NLGEOM\n*DYNAMIC{how}\n*DLOAD, AMPLITUDE=A\nPART, GRAV, {weight!r}, 0., 0., -1.\n*END STEP\n")


def pushed(how):
    """A force at the tip that grows from nothing."""
    return (decks.clamped(BAR, "") + f"*AMPLITUDE, NAME=A\n0., 0., {PERIOD}, 1.\n*BOUNDARY\nFIX, 1, 3\n*STEP, NLGEOM\n*DYNAMIC{how}\n"
            f"*CLOAD, AMPLITUDE=A\n{TIP}, 3, 10.\n*END STEP\n")


def by_steps(n):
    return f", DIRECT\n{PERIOD / n!r}, {PERIOD!r}"


class DecksThatMove(Cli):
    def tip(self, deck, name):
        """(time, displacement along z) of the tip."""
        self.file(name + ".inp", deck)
        model = self.file(name + ".toml", f'bodies.part = {{ type = "solid", mesh = {{ file = "{name}.inp", take = "all" }} }}\n'
                          f'markers.tip = {{ body = "part", node = {TIP} }}\n[output]\nquantities = ["tip.position"]\n')
        self.expect(0, "simulate", model, "--no-page", "--out", self.folder / name)
        with open(self.folder / name / "quantities.csv") as file:
            rows = list(csv.DictReader(file))
        return [(float(r["time"]), float(r["tip.position.z"]) - float(rows[0]["tip.position.z"])) for r in rows]

    def test_a_support_that_is_led_is_a_weight_in_its_frame(self):
        by_support, by_weight = self.tip(led(by_steps(800)), "led"), self.tip(shaken(by_steps(800)), "shaken")
        self.assertEqual([t for t, _ in by_support], [t for t, _ in by_weight])
        apart = [abs(u - (v + WAY * smooth(t / PERIOD))) for (t, u), (_, v) in zip(by_support, by_weight)]
        self.assertGreater(max(abs(v) for _, v in by_weight), 0.2 * WAY)
        self.assertLess(max(apart), 1e-5 * WAY)

    def test_steps_that_are_found_follow_what_the_part_does(self):
        # It moves by 4e-5 of its length, under a load that is not there at the start.
        exact = dict((round(t / PERIOD, 6), u) for t, u in self.tip(pushed(by_steps(2000)), "short"))
        found = self.tip(pushed(f"\n{PERIOD / 50!r}, {PERIOD!r}"), "found")
        most = max(abs(u) for u in exact.values())
        near = [abs(u - exact[round(round(t / PERIOD * 2000) / 2000, 6)]) for t, u in found]
        self.assertLess(max(near), 1e-2 * most)
        self.assertLess(abs(found[-1][1] - exact[1.0]), 3e-3 * most)

    def test_the_largest_increment_is_kept(self):
        times = [t for t, _ in self.tip(pushed(f"\n{PERIOD / 50!r}, {PERIOD!r}, , {PERIOD / 200!r}"), "kept")]
        self.assertLess(max(b - a for a, b in zip(times, times[1:])), PERIOD / 200 * (1 + 1e-9))


if __name__ == "__main__":
    unittest.main()
