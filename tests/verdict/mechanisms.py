#!/usr/bin/env python3
"""Random mechanisms of rigid bodies whose constraint rank is known by exact arithmetic, judged by the simulator.

    mechanisms.py [COUNT [SEED]]        default: 200 mechanisms from seed 1

Bodies stand at whole-numbered places, joints have whole-numbered places and axes, so the rows of velocity constraints are
integers and their rank is that modulo a prime of 61 bits. The simulator must name as many redundant rows as there are, no
row of a joint that the others do not replace, and forces that balance: of each body m a = sum F + m g, and in a structure
that cannot move the moments as well.

A position where the rank is smaller than next to it, or where a motion that the rank allows ends at once, is singular: the
simulator may decide beside it, or end with an error that says so. Truth there: places on the constraints close by, found
by Newton's method on their positions (numpy).

Prints a line for each mechanism that is wrong and a summary; exit code 1 where one was wrong.
"""

import collections
import random
import re
import sys
from typing import NamedTuple

import espalier
import numpy as np

PRIME = (1 << 61) - 1
UNITS = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
AXES = (*UNITS, (1, 1, 0), (0, 1, 1), (1, 0, -1), (1, 2, 2), (2, -1, 2))
KINDS = ("spherical", "revolute", "fixed", "cylindrical", "prismatic", "planar")
MASS, WEIGHT = 2.0, np.array([0, 0, -9.81 * 2.0])


class Joint(NamedTuple):
    kind: str
    a: int  # a body, -1: the ground
    b: int
    at: tuple
    axis: tuple | None


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def normals(axis):
    """Two whole-numbered vectors across it."""
    unit = min(UNITS, key=lambda e: abs(dot(axis, e)))
    first = cross(axis, unit)
    return first, cross(axis, first)


def held(joint):
    """Directions along which its points, and about which its bodies keep together."""
    across = normals(joint.axis) if joint.axis else ()
    along = {"cylindrical": across, "prismatic": across, "planar": (joint.axis,)}.get(joint.kind, UNITS)
    about = {"spherical": (), "fixed": UNITS, "prismatic": UNITS}.get(joint.kind, across)
    return along, about


def velocity_rows(joint, centres):
    """Rows over (velocity of the centre, angular velocity) of each body, as dictionaries."""
    along, about = held(joint)
    rows = []
    for direction, turns in [(d, False) for d in along] + [(d, True) for d in about]:
        row = {}
        for body, sign in ((joint.a, -1), (joint.b, 1)):
            if body < 0:
                continue
            arm = tuple(x - y for x, y in zip(joint.at, centres[body]))
            parts = (0, 0, 0, *direction) if turns else (*direction, *cross(arm, direction))
            row.update({6 * body + k: sign * v for k, v in enumerate(parts) if v})
        rows.append(row)
    return rows


def exact_rank(rows):
    pivots = {}
    for row in rows:
        row = {k: v % PRIME for k, v in row.items()}
        while row:
            k = min(row)
            if k not in pivots:
                inverse = pow(row[k], PRIME - 2, PRIME)
                pivots[k] = {j: v * inverse % PRIME for j, v in row.items()}
                break
            factor = row[k]
            for j, v in pivots[k].items():
                row[j] = (row.get(j, 0) - factor * v) % PRIME
            row = {j: v for j, v in row.items() if v}
    return len(pivots)


def make(seed):
    """Centres of the bodies, and joints: a tree, and up to three that close loops; a third of them in a plane."""
    rng = random.Random(seed)
    bodies = rng.randint(1, 7)
    plane = rng.random() < 0.35

    def place():
        return rng.randint(-3, 3), rng.randint(-3, 3), 0 if plane else rng.randint(-3, 3)

    def joint(a, b):
        kind = rng.choice(("revolute", "revolute", *KINDS[:-1]) if plane else KINDS)
        axis = rng.choice(AXES if rng.random() < 0.5 else UNITS)
        if plane:
            axis = (0, 0, 1) if kind in ("revolute", "cylindrical") else rng.choice(((1, 0, 0), (0, 1, 0), (1, 1, 0)))
        return Joint(kind, a, b, place(), None if kind in ("spherical", "fixed") else axis)

    centres = [place() for _ in range(bodies)]
    joints = [joint(rng.randint(-1, b - 1), b) for b in range(bodies)]
    joints += [joint(*rng.sample(range(-1, bodies), 2)) for _ in range(rng.choice((0, 1, 1, 2, 2, 3)))]
    return centres, joints


def text_of(centres, joints):
    name = lambda body: "ground" if body < 0 else f"b{body}"  # noqa: E731
    text = "gravity = [0, 0, -9.81]\n"
    for k, centre in enumerate(centres):
        text += f'[bodies.b{k}]\ntype = "rigid"\nmass = {MASS}\ninertia = [1, 1.5, 2]\nposition = {list(centre)}\n'
    for k, j in enumerate(joints):
        axis = f"axis = {list(j.axis)}\n" if j.axis else ""
        text += f'[joints.j{k}]\ntype = "{j.kind}"\nbodies = ["{name(j.a)}", "{name(j.b)}"]\nat = {list(j.at)}\n{axis}'
    wanted = [f"b{k}.acceleration" for k in range(len(centres))]
    wanted += [f"j{k}.{what}" for k in range(len(joints)) for what in ("force", "moment")]
    quantities = ", ".join(f'"{w}"' for w in wanted)
    return text + f"[integrator]\nend = 1e-3\nstep = 1e-3\n[output]\nquantities = [{quantities}]\n"


class Poses:
    """Bodies in other places, with the rows of their constraints and by how much these are violated."""

    def __init__(self, centres, joints):
        self.begin = np.array(centres, float)
        self.joints = joints
        self.x = self.begin.copy()
        self.turns = [np.eye(3) for _ in centres]

    def direction(self, body, d):
        return np.array(d, float) if body < 0 else self.turns[body] @ np.array(d, float)

    def point(self, body, p):
        return np.array(p, float) if body < 0 else self.x[body] + self.turns[body] @ (np.array(p, float) - self.begin[body])

    def system(self):
        rows, rest = [], []
        for j in self.joints:
            pa, pb = self.point(j.a, j.at), self.point(j.b, j.at)
            along, about = held(j)
            pairs = ((UNITS[0], UNITS[1]), (UNITS[1], UNITS[2]), (UNITS[2], UNITS[0]))
            if about != UNITS:
                pairs = tuple((d, j.axis) for d in about)
            for d in along:
                u = self.direction(j.a, d)
                rest.append(u @ (pb - pa))
                rows.append(self.row(j, u, np.cross(pb - self.x[j.a], u), np.cross(pb - self.x[j.b], u)))
            for d, e in pairs:
                u, v = self.direction(j.a, d), self.direction(j.b, e)
                rest.append(u @ v - dot(d, e))
                rows.append(self.row(j, np.zeros(3), -np.cross(u, v), -np.cross(u, v)))
        size = np.linalg.norm(rows, axis=1)
        size[size == 0] = 1
        return np.array(rows) / size[:, None], np.array(rest) / size

    def row(self, joint, u, of_a, of_b):
        row = np.zeros(6 * len(self.x))
        for body, sign, moment in ((joint.a, -1, of_a), (joint.b, 1, of_b)):
            if body >= 0:
                row[6 * body : 6 * body + 6] += sign * np.concatenate([u, moment])
        return row

    def move(self, change):
        for body, turn in enumerate(self.turns):
            self.x[body] += change[6 * body : 6 * body + 3]
            w = change[6 * body + 3 : 6 * body + 6]
            angle = np.linalg.norm(w)
            if angle > 0:
                k = np.cross(w / angle, np.eye(3)).T  # k @ v = w x v
                self.turns[body] = (np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k) @ turn

    def apart(self):
        """How far the bodies are from where they began, turns included."""
        return np.sqrt(np.sum((self.x - self.begin) ** 2) + sum(np.sum((t - np.eye(3)) ** 2) / 2 for t in self.turns))


def is_singular(centres, joints, rank):
    """Whether the rank changes, or a motion dies, next to the position in which a mechanism was put together."""
    poses = Poses(centres, joints)
    motions = np.linalg.svd(poses.system()[0])[2][rank:]
    for seed in range(3):
        if not len(motions):
            return False
        poses = Poses(centres, joints)
        step = np.random.default_rng(seed).standard_normal(len(motions)) @ motions
        poses.move(0.02 * step / np.linalg.norm(step))
        for _ in range(80):  # Levenberg and Marquardt: rows that nearly depend move nothing far
            rows, rest = poses.system()
            if np.abs(rest).max() < 1e-15:
                break
            damped = rows @ rows.T + np.linalg.norm(rest) * np.eye(len(rest))
            poses.move(-rows.T @ np.linalg.lstsq(damped, rest, rcond=None)[0])
        values = np.linalg.svd(poses.system()[0])[1]
        if (values > 1e-7).sum() != rank or poses.apart() < 0.018:
            return True
    return False


def unbalanced(result, centres, joints, at_rest):
    """The largest rest of the equations of a body, over the weight of all."""
    at = lambda name: np.array([result[f"{name}.{c}"][-1] for c in "xyz"])  # noqa: E731
    force = [WEIGHT - MASS * at(f"b{k}.acceleration") for k in range(len(centres))]
    moment = [np.zeros(3) for _ in centres]
    for k, j in enumerate(joints):
        f, m = at(f"j{k}.force"), at(f"j{k}.moment")  # on body b, at the joint
        for body, sign in ((j.a, -1), (j.b, 1)):
            if body >= 0:
                force[body] = force[body] + sign * f
                moment[body] = moment[body] + sign * (m + np.cross(np.subtract(j.at, centres[body]), f))
    rest = max(np.abs(f).max() for f in force)
    if at_rest:
        rest = max(rest, max(np.abs(m).max() for m in moment))
    return rest / (np.linalg.norm(WEIGHT) * len(centres))


def judge(seed):
    """@returns what became of it, and what was wrong (empty: nothing)"""
    centres, joints = make(seed)
    rows = [velocity_rows(j, centres) for j in joints]
    together = [row for of_joint in rows for row in of_joint]
    rank = exact_rank(together)
    try:
        result = espalier.Model.from_text(text_of(centres, joints)).run()
    except espalier.Error as error:
        if "near a singular position" not in str(error):
            return "error", str(error)
        return ("singular", "") if is_singular(centres, joints, rank) else ("error", f"no singular position: {error}")
    system = result.summary["system"]
    if system["constraints"] != len(together):
        return "rows", f"{system['constraints']} constraints for {len(together)}"
    if len(system["redundant"]) != len(together) - rank or system["degrees_of_freedom"] != 6 * len(centres) - rank:
        said = f"{len(system['redundant'])} redundant rows named, {len(together) - rank} there are"
        return ("singular", "") if is_singular(centres, joints, rank) else ("rank", said)
    named = collections.Counter(int(re.search(r'"j(\d+)"', line).group(1)) for line in system["redundant"])
    for k, count in named.items():
        others = [row for j, of_joint in enumerate(rows) if j != k for row in of_joint]
        if count > len(rows[k]) - (rank - exact_rank(others)):
            return "names", f"{count} rows of j{k} named, which hold what nothing else holds"
    rest = unbalanced(result, centres, joints, rank == 6 * len(centres))
    largest = 1e-5 if rank == 6 * len(centres) else 1e-2  # the step of 1 ms moves what can move
    return "right", f"forces leave {rest:.1e} of the weight" if not rest < largest else ""


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    tally, wrong = collections.Counter(), 0
    for seed in range(first, first + count):
        what, fault = judge(seed)
        tally[what] += 1
        if fault:
            wrong += 1
            print(f"WRONG seed {seed}: {fault}", flush=True)
    print(f"{count} mechanisms: {tally['right']} of regular ranks, {tally['singular']} in singular positions; {wrong} wrong")
    return 0 if wrong == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
