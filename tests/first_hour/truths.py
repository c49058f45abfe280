"""What the problems of the first hour must give, by theory, with the relative error that the meshes and steps leave.

Whoever solves them (first_hour.py by the command line, in_python.py by the package, a program with the library) calls
check() with the numbers found."""

import math

MATRIX_ROWS = 1000
G = 9.81


def _matrix():
    """-1, 2, -1 on the diagonals and a right-hand side of ones: x_i = i (n + 1 - i) / 2."""
    half = MATRIX_ROWS // 2
    return {"largest unknown": (half * (MATRIX_ROWS + 1 - half) / 2, 1e-12)}


def _pendulum():
    """A bar of length L, let go from the horizontal. It reaches the lowest point after K(sin 45) / sqrt(3 g / 2 L), K the
    complete elliptic integral; its tip has the speed sqrt(3 g L) there, and the hinge bears 5/2 of the weight. That it
    bends (first frequency 37 Hz, it swings with 0.5 Hz) changes these by less than a thousandth."""
    a, b = 1.0, math.cos(math.pi / 4)
    while a - b > 1e-15:
        a, b = (a + b) / 2, math.sqrt(a * b)
    quarter = math.pi / 2 / a / math.sqrt(1.5 * G)
    weight = 7850 * 0.01**2 * G
    return {"time to the lowest point": (quarter, 3e-4), "speed of the tip": (-math.sqrt(3 * G), 5e-3),
            "force in the hinge": (2.5 * weight, 1e-2)}


def _bracket():
    """The ring between the legs is a curved bar of inner radius a and outer radius b, width w. In its middle section acts
    the force F = 100 N as if through the ring's centre, and its moment M = 24 mm F about that. Both have closed forms
    (Golovin; Timoshenko and Goodier, Theory of Elasticity, 29 and 33), exact but for the ends of the ring, which are
    far enough, and the width: stress along the inner arc at 45 degrees."""
    a, b, w, force, arm = 6.0, 12.0, 4.0, 100.0, 24.0
    log = math.log(b / a)
    bending = 4 / ((b * b - a * a)**2 - 4 * (a * b * log)**2) * (2 * b * b * log - (b * b - a * a))
    pull = (3 * a - b * b / a - (a * a + b * b) / a) / (a * a - b * b + (a * a + b * b) * log)
    return {"stress in the fillet": (force * arm / w * bending - force / w * pull * math.sin(math.pi / 4), 1e-2),
            "force on the clamp": (-force, 1e-9)}


def _plate():
    """f = pi / 2 (m^2 + n^2) sqrt(D / (rho h)) / a^2 for (m, n) = (1, 1), (1, 2), (2, 1), (2, 2); D = E h^3 / 12 (1 - nu^2)."""
    root = math.sqrt(210e9 * 0.005**3 / 12 / (1 - 0.3**2) / (7850 * 0.005))
    return {f"frequency {k}": (math.pi / 2 * sum_of_squares * root, 1e-2) for k, sum_of_squares in enumerate((2, 5, 5, 8), 1)}


def _casadi():
    """The optimum that Hock and Schittkowski give for their problem 71."""
    return {"objective": (17.0140173, 1e-7)}


TRUTHS = {"matrix": _matrix(), "pendulum": _pendulum(), "bracket": _bracket(), "plate": _plate(), "casadi": _casadi()}


def lowest_point(times, x, speed, force):
    """Of a run of pendulum.toml: where the tip first passes x = 0, between two steps."""
    for k in range(1, len(times)):
        if x[k - 1] > 0 >= x[k]:
            f = x[k - 1] / (x[k - 1] - x[k])
            at = [float(v[k - 1] + f * (v[k] - v[k - 1])) for v in (times, speed, force)]
            return dict(zip(("time to the lowest point", "speed of the tip", "force in the hinge"), at))
    raise AssertionError("the pendulum has not come to its lowest point")


def check(problem, found, seconds, by):
    """Prints the numbers beside their truths. Returns whether all of them are there and right."""
    right = True
    for name, (truth, tolerance) in TRUTHS[problem].items():
        value = found.get(name, math.nan)
        error = abs(value - truth) / abs(truth)
        good = error <= tolerance
        right = right and good
        print(f"{problem:9s} {by:13s} {name:25s} {value:14.9g}  truth {truth:14.9g}  error {error:7.1e}  "
              f"{'ok' if good else f'WRONG: above {tolerance:g}'}")
    print(f"{problem:9s} {by:13s} {seconds:.2f} s")
    return right
