"""Prints the packages of a requirements file (and of the arguments after it) that this Python does not have.

Those after it may also be modules from elsewhere: a build folder on the path has espalier without pip's records of it.
"""
import importlib.metadata
import importlib.util
import re
import sys
from pathlib import Path

wanted = [line.split("#")[0].strip() for line in Path(sys.argv[1]).read_text().splitlines()]
missing = []
for line in [w for w in wanted if w] + [name for name in sys.argv[2:] if importlib.util.find_spec(name) is None]:
    name, _, version = line.partition("==")
    try:
        found = importlib.metadata.version(re.sub(r"\[.*", "", name))
    except importlib.metadata.PackageNotFoundError:
        missing.append(line)
        continue
    if version and found != version:
        missing.append(f"{line} (there is {found})")
if missing:
    sys.exit("missing in " + sys.prefix + ":\n  " + "\n  ".join(missing))
