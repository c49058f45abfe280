"""Which extension module a process gets: that of espalier-cuda, played by a folder on the path, or the package's own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import espalier
from espalier import _core

SOLVE = """
import espalier, pickle
solver = espalier.Solver(([0, 1, 2], [0, 1], [2.0, 4.0]))
x = pickle.loads(pickle.dumps(solver)).solve([2.0, 4.0])
assert abs(x - 1).max() < 1e-15
print(espalier._core.__file__, espalier._linear.solver._core is espalier._core)
"""


def run(folder):
    path = os.pathsep.join([str(folder), str(Path(espalier.__file__).parents[1])])
    return subprocess.run([sys.executable, "-c", SOLVE], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})


@pytest.mark.skipif("espalier_cuda" in sys.modules, reason="espalier-cuda is installed")
def test_the_module_of_espalier_cuda_is_taken(tmp_path):
    package = tmp_path / "espalier_cuda"
    package.mkdir()
    (package / "__init__.py").write_text(f'__version__ = "{espalier.__version__}"\n')
    file = Path(_core.__file__)
    (package / file.name).symlink_to(file)
    libraries = file.parents[1] / "espalier.libs"  # of an installed wheel
    if libraries.exists():
        (tmp_path / libraries.name).symlink_to(libraries)
    done = run(tmp_path)
    assert done.stdout.split()[-2:] == [str(package / file.name), "True"], done.stderr


@pytest.mark.skipif("espalier_cuda" in sys.modules, reason="espalier-cuda is installed")
def test_another_version_is_refused(tmp_path):
    package = tmp_path / "espalier_cuda"
    package.mkdir()
    (package / "__init__.py").write_text('__version__ = "9.9"\n')
    done = run(tmp_path)
    assert done.returncode != 0
    assert f"ImportError: espalier {espalier.__version__} is installed with espalier-cuda 9.9" in done.stderr


def test_without_it_the_own_module_is_taken(tmp_path):
    done = run(tmp_path)
    assert done.stdout.split()[-2:] == [_core.__file__, "True"], done.stderr


def test_versions_agree():
    assert espalier.__version__ == _core.version
