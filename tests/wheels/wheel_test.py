#!/usr/bin/env python3
"""A wheel of espalier in a fresh environment: what it brings works, it replaces an older version without a rest, and it
works beside espalier-cuda of its own version alone. Older versions and espalier-cuda are made here, of the same wheel.

    wheel_test.py build/wheels/espalier-0.1.0-*.whl [--python python3]     needs PyPI, for NumPy"""

import argparse
import base64
import hashlib
import pathlib
import subprocess
import sys
import tempfile
import zipfile

LEFT_BY_AN_OLDER_VERSION = "espalier/_of_an_older_version.py"


def run(*words, code=0):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode != code:
        sys.exit(f"{' '.join(map(str, words))}\nended with {done.returncode} instead of {code}\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def expect(wanted, text):
    if wanted not in text:
        sys.exit(f"'{wanted}' is not in\n{text}")


def write_wheel(path, files):
    """files: {name: (content, file attributes)} without RECORD."""
    info = next(name.split("/")[0] for name in files if ".dist-info/" in name)
    lines = [f"{info}/RECORD,,"]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as out:
        for name, (content, attributes) in files.items():
            entry = zipfile.ZipInfo(name)
            entry.external_attr, entry.compress_type = attributes, zipfile.ZIP_DEFLATED
            out.writestr(entry, content)
            digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
            lines.append(f"{name},sha256={digest},{len(content)}")
        out.writestr(f"{info}/RECORD", "\n".join(lines) + "\n")
    return path


def contents(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return {e.filename: (archive.read(e), e.external_attr) for e in archive.infolist()
                if not e.filename.endswith(("/RECORD", "/"))}


def older(wheel, folder, version, new):
    """The same wheel under an older number, with a module that the new one has not."""
    files = {}
    for name, (content, attributes) in contents(wheel).items():
        if name.endswith(("dist-info/METADATA", "espalier/_version.py")):
            content = content.replace(new.encode(), version.encode())
        files[name.replace(f"espalier-{new}.dist-info", f"espalier-{version}.dist-info")] = (content, attributes)
    files[LEFT_BY_AN_OLDER_VERSION] = (b"", 0o644 << 16)
    return write_wheel(folder / wheel.name.replace(new, version, 1), files)


def cuda(wheel, folder, new):
    """espalier-cuda as python/cuda makes it, but of the module and the program without CUDA."""
    files = {}
    for name, (content, attributes) in contents(wheel).items():
        if name.startswith("espalier/_core.") and name.endswith(".so") or name == "espalier/bin/espalier":
            files[name.replace("espalier/", "espalier_cuda/", 1)] = (content, attributes)
        if name.endswith("dist-info/WHEEL"):
            files[f"espalier_cuda-{new}.dist-info/WHEEL"] = (content, attributes)
    files["espalier_cuda/__init__.py"] = (f'__version__ = "{new}"\n'.encode(), 0o644 << 16)
    metadata = f"Metadata-Version: 2.1\nName: espalier-cuda\nVersion: {new}\nRequires-Dist: espalier=={new}\n"
    files[f"espalier_cuda-{new}.dist-info/METADATA"] = (metadata.encode(), 0o644 << 16)
    return write_wheel(folder / wheel.name.replace("espalier-", "espalier_cuda-", 1), files)


def check_command(env, folder):
    command = env / "bin" / "espalier"
    expect("backends", run(command, "info"))
    expect("engine", run(command, "examples"))
    expect("did you mean 'pendulum'?", run(command, "examples", "pendulm", code=2))
    model = run(command, "examples", "pendulum").strip()
    out = folder / "run"
    run(command, "simulate", model, "--until", "0.1", "--out", out, "--quiet")
    expect("index.html", run(command, "view", "--no-browser", out))
    expect("file://", run(command, "view", "--no-browser", model))
    run(command, "examples", "engine", "--copy", folder / "copies")
    expect("is not replaced", run(command, "examples", "engine", "--copy", folder / "copies", code=2))
    expect("backward", run(command, "solve", "--generate", "elasticity 4"))
    for interface, way in LOADED_BY_HOSTS.items():
        expect("ours is loaded", run(command, "run", "--as", interface, "--", env / "bin" / "python", "-c", LOAD.format(way)))


# What a host looks for; those that need no headers of others, so that every wheel has them.
LOADED_BY_HOSTS = {"hsl": "'libhsl.so', 'ma57ad_'", "panua": "os.environ['PARDISO_PATH'] + '/libpardiso.so', 'pardiso'",
                   "mkl": "os.environ['MKLROOT'] + '/lib/libmkl_rt.so', 'pardiso_64'", "umfpack": "None, 'umfpack_di_symbolic'"}
LOAD = """
import ctypes, os
library, function = {}
getattr(ctypes.CDLL(library), function)
print("ours is loaded")
"""
IN_PYTHON = """
import espalier as esp, pathlib, sys, tempfile
x = esp.solve(([0, 2, 4], [0, 1, 0, 1], [2.0, 1.0, 1.0, 3.0]), [3.0, 4.0])
assert abs(x - 1).max() < 1e-15, x
names = esp.examples.names()
assert {"engine", "chain", "gears", "tyre", "rotor", "sprocket", "pendulum", "bicycle"} <= set(names), names
assert all(esp.examples.path(n).read_text() for n in names)
try:
    esp.examples.load("engin")
except ValueError as error:
    assert "did you mean 'engine'?" in str(error), error
else:
    raise AssertionError("no error")
result = esp.examples.load("pendulum").run(until=0.1)
page = result.to_html()
assert "<canvas" in page or "three" in page, len(page)
print(esp.__version__, esp._core.__file__)
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=pathlib.Path)
    parser.add_argument("--python", default=sys.executable)
    given = parser.parse_args()
    wheel = given.wheel.resolve()
    new = wheel.name.split("-")[1]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        env = folder / "env"
        run(given.python, "-m", "venv", env)
        python, pip = env / "bin" / "python", [env / "bin" / "python", "-m", "pip", "--disable-pip-version-check"]

        def installed():
            return [p.name for p in env.glob("lib/python*/site-packages/espalier*")], list(env.glob("lib/python*/site-packages/" + LEFT_BY_AN_OLDER_VERSION))

        before = older(wheel, folder, "0.0.1", new)
        run(*pip, "install", "--quiet", before)
        expect("0.0.1 ", run(python, "-c", "import espalier; print(espalier.__version__, '')"))
        if not installed()[1]:
            sys.exit("the older version is not what it should be")
        run(*pip, "install", "--quiet", "--upgrade", wheel)
        if installed()[1] or f"espalier-0.0.1.dist-info" in installed()[0]:
            sys.exit(f"the upgrade has left something behind: {installed()}")
        expect(new, run(python, "-c", IN_PYTHON))
        check_command(env, folder)
        print(f"{wheel.name}: works in {given.python}, also over version 0.0.1")

        run(*pip, "install", "--quiet", cuda(wheel, folder, new))
        expect("espalier_cuda/_core.", run(python, "-c", IN_PYTHON))
        expect("espalier_cuda", run(python, "-c", "from espalier import _command; print(_command.program())"))
        check_command(env, folder / "beside_cuda")
        run(*pip, "check")
        run(*pip, "install", "--quiet", "--no-deps", before)
        told = run(python, "-c", "import espalier", code=1)
        expect("they must be of one version", told)
        expect("they must be of one version", run(env / "bin" / "espalier", "info", code=1))
        run(*pip, "install", "--quiet", "--upgrade", wheel)
        run(*pip, "uninstall", "--quiet", "-y", "espalier-cuda")
        expect("espalier/_core.", run(python, "-c", IN_PYTHON))
        run(*pip, "uninstall", "--quiet", "-y", "espalier")
        if installed()[0]:
            sys.exit(f"uninstalling leaves {installed()[0]}")
        print(f"{wheel.name}: works beside espalier-cuda {new}, refuses another version of it, leaves nothing behind")


if __name__ == "__main__":
    main()
