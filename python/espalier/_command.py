"""The command `espalier`: the program of the package, or that of espalier-cuda where it is installed."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

from ._version import __version__


def program() -> Path:
    """Where the program is.

    Raises:
        FileNotFoundError: in a package that was put together by hand.
        ImportError: where espalier-cuda is of another version.
    """
    places = [Path(__file__).parent]
    cuda = find_spec("espalier_cuda")  # `import espalier` has looked at its version
    if cuda is not None and cuda.origin is not None:
        places.insert(0, Path(cuda.origin).parent)
    for place in places:
        if (place / "bin" / "espalier").exists():
            return place / "bin" / "espalier"
    raise FileNotFoundError(f"the program of espalier {__version__} is not in {places[-1] / 'bin'}; in a source folder it is"
                            " build/release/espalier, and pip install ./python puts it into the package")


def main() -> None:
    """Becomes that program, with the arguments of this process."""
    try:
        file = program()
        os.execv(file, [str(file), *sys.argv[1:]])
    except OSError as error:
        sys.exit(f"espalier: {error}")
