#!/usr/bin/env python3
"""Octave's backslash, lu, chol and det on our solver and on its own UMFPACK and CHOLMOD: the same answers and the same
warnings, and how long each took.

    apt-get install octave; pip install scipy
    tests/hosts/octave.py --libraries build/release/hosts [--data FOLDER] [--quick]

Systems are generated, and read from a folder of Matrix Market files where one is given. Fails where warnings differ, or
where our backward error is above 1e-14 and ten times Octave's own.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np
import scipy.io
import scipy.sparse as sp

FOLDER = pathlib.Path(__file__).resolve().parent
LARGEST_FILE = 4 << 20


def laplacian(*sides):
    a = sp.csc_matrix((1, 1))
    for side in sides:
        line = sp.diags([-np.ones(side - 1), 2 * np.ones(side), -np.ones(side - 1)], [-1, 0, 1])
        a = sp.kron(a, sp.eye(side)) + sp.kron(sp.eye(a.shape[0]), line)
    return a.tocsc()


def convection(*sides):
    """A Laplacian with a wind: not symmetric."""
    a = laplacian(*sides)
    n = a.shape[0]
    return (a + 0.7 * sp.diags([np.ones(n - 1), -np.ones(n - 1)], [1, -1])).tocsc()


def generated(quick):
    yield "poisson_2d_20", laplacian(20, 20)
    yield "poisson_2d_100", laplacian(100, 100)
    yield "wind_2d_20", convection(20, 20)
    yield "wind_2d_100", convection(100, 100)
    yield "wind_3d_12", convection(12, 12, 12)
    yield "neumann", (laplacian(30, 30) - sp.diags(laplacian(30, 30) @ np.ones(900))).tocsc()  # singular
    for decade in (10, 14, 15, 16, 17, 20):  # nearly dependent columns
        a = convection(15, 15).tolil()
        a[:, 7] = a[:, 8] * (1 + 10.0**-decade)
        a[7, 7] += 10.0**-decade
        yield f"near_{decade}", a.tocsc()
    if quick:
        return
    yield "poisson_2d_500", laplacian(500, 500)
    yield "poisson_3d_30", laplacian(30, 30, 30)
    yield "wind_2d_400", convection(400, 400)
    yield "wind_3d_24", convection(24, 24, 24)


def collected(folder):
    for path in sorted([*folder.rglob("*.mtx"), *folder.rglob("*.mtx.gz")]):
        if path.stat().st_size > LARGEST_FILE:
            continue
        try:
            a = scipy.io.mmread(path)
        except (ValueError, StopIteration, EOFError):
            continue
        if not sp.issparse(a) or a.shape[0] != a.shape[1] or np.iscomplexobj(a) or a.dtype.kind not in "fi":
            continue
        yield path.name.split(".")[0], a.tocsc().astype(float)


def solve_all(folder, repeat, preload):
    with tempfile.TemporaryDirectory() as place:
        out = pathlib.Path(place) / "out"
        environment = dict(os.environ)
        if preload:
            environment["LD_PRELOAD"] = ":".join(map(str, preload))
        subprocess.run(["octave-cli", "--norc", FOLDER / "octave.m", folder, out, str(repeat)], env=environment, check=True,
                       stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
        results = {}
        for line in out.read_text().splitlines():
            name, n, seconds, backward, forward, warning = line.split(" ", 5)
            results[name] = {"unknowns": int(n), "seconds": float(seconds), "backward": float(backward), "forward": float(forward),
                             "warning": warning}
        return results


def warned(result):
    """Whether, and of what; the estimate of the condition in the text differs from library to library."""
    return result["warning"].split("|")[0] + ("singular" if "singular" in result["warning"] else "")


def differences(ours, own):
    if warned(ours) != warned(own):
        return f"warning '{ours['warning']}' instead of '{own['warning']}'"
    small = max(1e-14, 10 * own["backward"])
    if not ours["backward"] <= small and not np.isnan(own["backward"]):
        return f"backward error {ours['backward']:.1e} instead of {own['backward']:.1e}"
    return ""


# What takes the factors apart, whatever library makes them.
FACTORS = """
A = gallery('poisson', 40) + sprandn(gallery('poisson', 40)) * 0.01; S = gallery('poisson', 60);
for k = 1:2
  [L, U, P, Q, R] = lu(A); assert(norm(R \\ A * 1 - P' * (L * U) * Q', 1) < 1e-12 || norm(P * (R \\ A) * Q - L * U, 1) < 1e-12)
  [L, U, P] = lu(A); assert(norm(P * A - L * U, 1) < 1e-12)
  [L, p, Q] = chol(S, 'lower'); assert(p == 0 && norm(Q' * S * Q - L * L', 1) < 1e-12)
  [R, p] = chol(S - 5 * speye(rows(S))); assert(p > 0)
  T = A(1:200, 1:200); assert(abs(det(T) / det(full(T)) - 1) < 1e-9)
  assert(norm(inv(T) * T - eye(200), 1) < 1e-9)
end
x = S \\ sparse(3, 1, 2, rows(S), 1); assert(issparse(x) && norm(S * x - sparse(3, 1, 2, rows(S), 1), 1) < 1e-12)
disp('factors are right')
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--libraries", type=pathlib.Path, required=True)
    parser.add_argument("--data", type=pathlib.Path, help="a folder of Matrix Market files")
    parser.add_argument("--quick", action="store_true", help="leave out what takes long")
    parser.add_argument("--repeat", type=int, default=1, help="the best time counts")
    parser.add_argument("--out", help="all results as JSON")
    arguments = parser.parse_args()
    if shutil.which("octave-cli") is None:
        print("skipped: octave is not installed")
        return 0
    preload = [p.resolve() for p in (arguments.libraries / f"libespalier_{name}.so" for name in ("umfpack", "cholmod")) if p.exists()]
    with tempfile.TemporaryDirectory() as folder:
        systems = [*generated(arguments.quick), *(collected(arguments.data) if arguments.data else [])]
        for name, a in systems:
            scipy.io.savemat(pathlib.Path(folder) / f"{name}.mat", {"A": a, "name": name})
        own = solve_all(folder, arguments.repeat, [])
        ours = solve_all(folder, arguments.repeat, preload)
    wrong = 0
    for name, result in own.items():
        ours[name]["wrong"] = differences(ours[name], result)
        wrong += bool(ours[name]["wrong"])
        print(f"{name:36} {result['unknowns']:7} {result['seconds']:9.4f} {ours[name]['seconds']:9.4f} s  {ours[name]['wrong'] or 'same'}")
    environment = dict(os.environ, LD_PRELOAD=":".join(map(str, preload)))
    factors = subprocess.run(["octave-cli", "--norc", "--eval", FACTORS], env=environment, capture_output=True, text=True)
    right = "factors are right" in factors.stdout
    print("lu, chol, det, inv: " + ("right" if right else factors.stderr))
    if arguments.out:
        pathlib.Path(arguments.out).write_text(json.dumps({name: {"own": own[name], "ours": ours[name]} for name in own}))
    print(f"{len(own)} systems, {wrong} differences; with {', '.join(p.name for p in preload)}")
    return 1 if wrong or not own or not right else 0


if __name__ == "__main__":
    sys.exit(main())
