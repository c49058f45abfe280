"""Takes the extension module _core from espalier-cuda, which has the GPU kernels, where that is installed.

Both packages hold the whole extension, and a process loads one of them: the C++ objects need not find each other across
two libraries, and nothing is decided at run time but this."""

import sys
from importlib.util import find_spec

from ._version import __version__


def _from_cuda() -> None:
    import espalier_cuda  # type: ignore[import-not-found]

    if espalier_cuda.__version__ != __version__:
        raise ImportError(f"espalier {__version__} is installed with espalier-cuda {espalier_cuda.__version__}; they must be of one"
                          f" version: pip install espalier=={__version__} espalier-cuda=={__version__}, or pip uninstall"
                          " espalier-cuda")
    from espalier_cuda import _core  # type: ignore[import-not-found]

    sys.modules["espalier._core"] = _core
    setattr(sys.modules["espalier"], "_core", _core)


if find_spec("espalier_cuda") is not None:
    _from_cuda()
