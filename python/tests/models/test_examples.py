"""The models that come with the package, and its command."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import espalier as esp
from espalier import _command

GALLERY = {"bicycle", "blade", "chain", "engine", "gears", "overhung_disc", "pendulum", "rotor", "sprocket", "torn_link", "tyre"}


def test_all_models_of_the_gallery_are_there_and_can_be_read():
    assert set(esp.examples.names()) >= GALLERY
    assert esp.examples.names() == sorted(esp.examples.names())
    for name in esp.examples.names():
        assert "bodies" in esp.examples.path(name).read_text(), name


def test_an_example_runs():
    result = esp.examples.load("pendulum").run(until=0.1, quantities=["bob.position.y"])
    assert result["bob.position.y"][-1] == pytest.approx(-0.5 * 10 * 0.1**2, rel=1e-2)  # free fall, nearly


@pytest.mark.parametrize("name, said", [("engin", "did you mean 'engine'?"), ("Engine", "did you mean 'engine'?"),
                                        ("engine.toml", "did you mean 'engine'?"), ("", "known are bicycle,"),
                                        ("../models/engine", "there is no example")])
def test_an_unknown_name_is_refused_with_the_next_one(name, said):
    for call in (esp.examples.path, esp.examples.load):
        with pytest.raises(ValueError) as error:
            call(name)
        assert said in str(error.value)


def package(folder, *, program=None, cuda=None):
    """A package put together of links to this one, with a script for its program."""
    here = Path(esp.__file__).parent
    (folder / "espalier").mkdir()
    for file in here.iterdir():
        if file.suffix in (".py", ".so", ".pyi") or file.name.startswith("_") and file.is_dir():
            (folder / "espalier" / file.name).symlink_to(file.resolve() if file.is_file() else file)
    if cuda is not None:
        (folder / "espalier_cuda").mkdir()
        (folder / "espalier_cuda" / "__init__.py").write_text(f'__version__ = "{esp.__version__}"\n')
        extension = Path(esp._core.__file__)
        (folder / "espalier_cuda" / extension.name).symlink_to(extension.resolve())
    for name, text in (("espalier", program), ("espalier_cuda", cuda)):
        if text is not None:
            (folder / name / "bin").mkdir()
            file = folder / name / "bin" / "espalier"
            file.write_text(f"#!/bin/sh\necho {text} \"$@\"\nexit 7\n")
            file.chmod(0o755)
    return subprocess.run([sys.executable, "-c", "from espalier._command import main; main()", "solve", "a b", "--quiet"],
                          capture_output=True, text=True, cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)})


@pytest.mark.skipif(Path(_command.__file__).parent.joinpath("bin").exists(), reason="an installed package")
def test_the_command_is_the_program_of_the_package(tmp_path):
    done = package(tmp_path, program="own")
    assert (done.returncode, done.stdout) == (7, "own solve a b --quiet\n"), done.stderr


@pytest.mark.skipif("espalier_cuda" in sys.modules, reason="espalier-cuda is installed")
def test_the_program_of_espalier_cuda_comes_first(tmp_path):
    done = package(tmp_path, program="own", cuda="gpu")
    assert (done.returncode, done.stdout) == (7, "gpu solve a b --quiet\n"), done.stderr


def test_without_a_program_the_command_says_where_one_is(tmp_path):
    done = package(tmp_path)
    assert done.returncode == 1
    assert "build/release/espalier" in done.stderr and "Traceback" not in done.stderr
