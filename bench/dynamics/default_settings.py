#!/usr/bin/env python3
"""What the defaults of [integrator] give, beside the best settings that a sweep finds: error and cost of a newcomer's models.

    PYTHONPATH=build/release/python bench/dynamics/default_settings.py [--only NAME] [--accuracy 1e-4] [--quick]

The models are those of the guide and the tutorials, and some of their kind, without a word about tolerances. The error is the
largest distance of any point from where it is in a converged run, at 20 times, over the extent of the whole motion. The cost is
the number of Newton's iterations. The sweep takes tolerances a factor of two apart, orders 2, 3 and 5, velocities tested at
three levels or not at all. Its best is the cheapest setting whose error and that of the next tighter one are below the accuracy
asked for: one that is right by luck does not count.
"""
import argparse
import pathlib
import re
import sys

import espalier as esp
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
TIMES = 20
STATED = re.compile(r"^(relative|absolute|absolute_velocity|test_velocity|max_order)\s*=.*\n", re.M)

BEAM = """gravity = [0, 0, -9.81]
[bodies.beam]
type = "beam"
start = [0, 0, 0]
end = [0.5, 0, 0]
elements = 10
height = 0.02
width = 0.004
material = { young = 2.1e11, poisson = 0.3, density = 7850 }
[joints.hinge]
type = "revolute"
a = { body = "ground", axis = [0, 1, 0] }
b = { body = "beam", node = 1, axis = [0, 1, 0] }
[integrator]
end = 0.5
"""
ROD = """gravity = [0, 0, -9.81]
[bodies.rod]
type = "beam"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 10
radius = 0.01
material = { young = 7e10, poisson = 0.3, density = 2700 }
[joints.hinge]
type = "spherical"
a = { body = "ground" }
b = { body = "rod", node = 1 }
[integrator]
end = 0.5
"""
CRANK = """gravity = [0, 0, -9.81]
[bodies.crank]
mass = 1
inertia = [0.001, 0.001, 0.002]
type = "rigid"
position = [0.05, 0, 0]
angular_velocity = [0, 0, 30]
[bodies.rod]
type = "rigid"
mass = 2
inertia = [0.001, 0.02, 0.02]
position = [0.25, 0, 0]
[bodies.slider]
type = "rigid"
mass = 3
inertia = [0.01, 0.01, 0.01]
position = [0.4, 0, 0]
[joints]
bearing = { type = "revolute", bodies = ["ground", "crank"], at = [0, 0, 0], axis = [0, 0, 1] }
pin = { type = "revolute", bodies = ["crank", "rod"], at = [0.1, 0, 0], axis = [0, 0, 1] }
wrist = { type = "revolute", bodies = ["rod", "slider"], at = [0.4, 0, 0], axis = [0, 0, 1] }
guide = { type = "prismatic", bodies = ["ground", "slider"], at = [0.4, 0, 0], axis = [1, 0, 0] }
[integrator]
end = 1
"""


def blocks(page):
    text = (ROOT / "docs" / page).read_text()
    return [b for b in re.findall(r"```toml\n(.*?)```", text, re.S) if "[integrator]" in b]


def double_pendulum():
    """The first model of the tutorial about flexible mechanisms."""
    bar = 'type = "rigid"\nmass = 0.54\nbox = [0.5, 0.02, 0.02]\n'
    return (f"gravity = [0, 0, -9.81]\n[bodies.upper]\n{bar}position = [0.25, 0, 0]\n[bodies.lower]\n{bar}position = [0.75, 0, 0]\n"
            '[bodies.bob]\ntype = "rigid"\nmass = 0.2\nbox = [0.04, 0.04, 0.04]\nposition = [1, 0, 0]\n[joints]\n'
            'shoulder = { type = "revolute", bodies = ["ground", "upper"], at = [0, 0, 0], axis = [0, 1, 0] }\n'
            'elbow = { type = "revolute", bodies = ["upper", "lower"], at = [0.5, 0, 0], axis = [0, 1, 0] }\n'
            'weld = { type = "fixed", bodies = ["lower", "bob"], at = [1, 0, 0] }\n[integrator]\nend = 1\n')


def models():
    forces, contact = blocks("guide/forces.md"), blocks("guide/contact.md")
    for block in forces:  # the page's splines are beside it
        if "damper.csv" in block:
            csv = re.search(r"```csv\n# damper.csv\n(.*?)```", (ROOT / "docs/guide/forces.md").read_text(), re.S)
            if csv:
                rows = [re.split("[;,]", r) for r in csv.group(1).strip().splitlines() if not r.startswith("#")][1:]
                points = ", ".join(f"[{r[0]}, {r[1]}]" for r in rows)
                forces[forces.index(block)] = re.sub(r'file = .*\nx = .*\ny = .*\n', f"points = [{points}]\n", block)
    found = {
        "flexible pendulum": blocks("guide/simulate.md")[0],
        "motor and cord": forces[0],
        "wheel on a strut": forces[1],
        "door": forces[2],
        "release and landing": forces[3],
        "rolling ball": contact[0],
        "double pendulum": double_pendulum(),
        "pendulum with a beam": blocks("tutorials/flexible_mechanism.md")[0],
        "pendulum": (ROOT / "examples/pendulum.toml").read_text(),
        "slider-crank": CRANK,
        "steel beam": BEAM,
        "undamped rod": ROD,
    }
    return {name: STATED.sub("", text) for name, text in found.items()}


def run(text, settings):
    """Pictures at 20 times and the summary. The third model about forces ends before its landing: frames within the step that
    ends in an event are interpolated to velocities after it."""
    model = esp.Model.from_text(text)
    end = model_end(text)
    result = model.run(frames=end / TIMES, until=end, set={f"integrator.{k}": v for k, v in settings.items()})
    return np.array([f.points for f in result.frames if abs(f.t * TIMES / end - round(f.t * TIMES / end)) < 1e-6]), result.summary


def model_end(text):
    if "let go at the bottom" in text:
        return 1.0
    return float(re.search(r"\[integrator\][^[]*?end = ([0-9.e-]+)", text, re.S).group(1))


def compare(points, truth):
    n = min(len(points), len(truth))
    extent = np.ptp(truth.reshape(-1, 3), axis=0).max()
    return np.linalg.norm(points[:n] - truth[:n], axis=-1).max() / extent, extent


def cost(summary):
    return summary["newton_iterations"]


def sweep(text, truth, accuracy, quick, limit):
    """Of all settings the cheapest that is right, as (cost, settings, error)."""
    best = None
    extent = np.ptp(truth.reshape(-1, 3), axis=0).max()
    speed = extent / model_end(text)
    for order in (2, 5) if quick else (2, 3, 5):
        for of_velocity in (1e-2, None) if quick else (1e-4, 1e-3, 1e-2, None):
            before = None
            for k in range(0, 22, 2 if quick else 1):
                relative = 1e-3 * 2.0 ** -k
                settings = {"max_order": order, "relative": relative, "absolute": relative * extent}
                settings.update({"test_velocity": False} if of_velocity is None else {"absolute_velocity": of_velocity * speed})
                settings["steps"] = limit
                try:
                    points, summary = run(text, settings)
                except Exception:
                    before = None
                    continue
                error = compare(points, truth)[0] if len(points) == len(truth) else np.inf
                done = len(points) == len(truth)
                if before is not None and error < accuracy and before[2] < accuracy:
                    if best is None or before[0] < best[0]:
                        best = before
                    break
                before = (cost(summary), settings, error)
                if not done or (best is not None and cost(summary) > 1.5 * best[0]):
                    break
    return best


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--accuracy", type=float, default=1e-4)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--no-sweep", action="store_true")
    arguments = parser.parse_args()
    print(f"{'model':22} {'default':>8} {'error':>8}   {'best':>8} {'error':>8} {'ratio':>6}  settings")
    for name, text in models().items():
        if arguments.only and arguments.only not in name:
            continue
        flexible = any(word in text for word in ('"beam"', '"solid"'))
        fine = {"relative": 1e-8, "absolute": 1e-9, "test_velocity": False, "max_order": 2} if flexible else {
            "relative": 1e-11, "absolute": 1e-12}
        truth, _ = run(text, fine)
        points, summary = run(text, {"steps": 100000})
        error, _ = compare(points, truth)
        line = f"{name:22} {cost(summary):8d} {error:8.1e}"
        if len(points) < len(truth):
            line += " (not ended)"
        print(line, end="", flush=True)
        if not arguments.no_sweep:
            best = sweep(text, truth, arguments.accuracy, arguments.quick, 5 * summary["steps"] if "integrator" in summary else 100000)
            if best:
                shown = {k: v for k, v in best[1].items() if k != "steps"}
                print(f"   {best[0]:8d} {best[2]:8.1e} {cost(summary) / best[0]:6.2f}  {shown}", end="")
        print(flush=True)


if __name__ == "__main__":
    sys.exit(main())
