#!/usr/bin/env python3
"""Runs the code blocks of documentation pages.

    python3 tests/docs/blocks.py README.md docs/tutorials/*.md docs/guide/python.md
    python3 tests/docs/blocks.py --list docs/guide/*.md      what each block is, and what is not run, and why

The blocks of a page are worked off in order, in a folder of their own that ends with the page. It looks like a clone of the
repository after `./run`: links to the files of the repository, build/release of the build, and a `./run` that hands its words
to the program, which is on PATH as well. /opt/espalier is a folder of the page, and where a page needs it the build is
installed there. apt-get installs nothing: it says whether Debian has the packages.

    ```python         runs; names stay for the next Python block of the page
    ```{code-cell}    the same, of a notebook
    ```console        commands after "$ " (and their continuation lines) run in bash; other lines are what they print
    ```sh             runs in bash
    ```toml, csv, c, cpp, cmake, text
                      a file where the first line names it in a comment, "# pendulum.toml" or "// solve.cpp". Of C and C++ it
                      is compiled against the library of the build, and run when it has a main()
    ```toml           without a name: a whole model, which `espalier simulate` runs
    indented          commands, as after "$ "
    ```output         what the block before it prints: "..." stands for anything, blanks do not count

A comment before a block says more:

    <!-- not run: why -->               counted and printed; there must be a reason
    <!-- needs: torch, gpu -->          left out where a Python module (or a GPU, or a program) is missing, which is said
    <!-- needs: torch (page) -->        so for the whole page; also: program, library, cuda, command X, header X, host X.so
    <!-- stopped: after 5 s -->         these commands may go on for longer: each has that long to fail, then it is ended
    <!-- raises: SingularMatrixError -->  this Python block must raise it
    <!-- around: ... @@ ... -->         C++: the block stands in the place of @@; lines of it that begin with #include go up

The environment says where things are: ESPALIER_BINARY (program), ESPALIER_LIBRARY (libespalier.a), ESPALIER_LINK (further
words for the linker), PYTHONPATH or the running Python for the package. What is missing is said; with --all-or-skip the exit
code is 77 when nothing could be run. Blocks that nothing runs and that no comment excuses are an error.
"""
import argparse
import contextlib
import importlib.util
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FILES = {"toml", "csv", "c", "cpp", "cmake", "text", "python", "sh", "json", "fortran"}
SHELL = {"console", "sh", "bash", "indented"}
LINK = "-lhwy -lfmt -lz -lpugixml -lpthread"  # what a static libespalier.a needs besides


@dataclass
class Block:
    page: Path
    line: int  # of the fence, from 1
    language: str
    text: str
    notes: dict = field(default_factory=dict)

    @property
    def place(self):
        return f"{self.page.relative_to(ROOT) if self.page.is_relative_to(ROOT) else self.page}:{self.line}"

    @property
    def file(self):
        """The name in the first line, or nothing."""
        m = re.match(r"\s*(?:#|//|/\*|!)\s*([\w.-]+\.\w+|CMakeLists\.txt)\s*(?:\*/)?\s*(?:\n|$)", self.text)
        return m[1] if m and self.language in FILES else None


def blocks_of(page):
    """The blocks of a page, fenced or indented, with the notes before them; and what the comments say of the whole page."""
    lines, found, notes, whole, k = page.read_text().splitlines(), [], {}, [], 0
    if lines[:1] == ["---"]:  # what the site reads of a notebook
        k = lines.index("---", 1) + 1
    while k < len(lines):
        line = lines[k]
        if line.startswith("<!--"):
            text = line
            while "-->" not in lines[k]:
                k += 1
                text += "\n" + lines[k]
            inner = text[4:text.index("-->")].strip()
            if m := re.match(r"(not run|needs|raises|around|stopped):\s*(.*)", inner, re.S):
                if m[1] == "needs" and m[2].endswith("(page)"):
                    whole += re.split(r",\s*", m[2][:-6].strip())
                else:
                    notes[m[1]] = m[2]
        elif m := re.match(r"(`{3,}|~{3,})\s*(\{[\w:-]+\}|[\w+-]*)", line):
            end = k + 1
            while end < len(lines) and not re.match(rf"{m[1]}`*~*\s*$", lines[end]):
                end += 1
            language = m[2]
            if language == "{code-cell}":
                language = "python"
            if not language.startswith("{"):
                found.append(Block(page, k + 1, language, "\n".join(lines[k + 1:end]) + "\n", notes))
            notes, k = {}, end
        elif line.startswith("    ") and not (k and lines[k - 1].strip()):
            end = k
            while end < len(lines) and lines[end].startswith("    "):
                end += 1
            found.append(Block(page, k + 1, "indented", "".join(f"{text[4:]}\n" for text in lines[k:end]), notes))
            notes, k = {}, end - 1
        elif line.strip():
            notes = notes if line.startswith("%") else {}
        k += 1
    return found, whole


def missing(names):
    """Those of some requirements that are not here."""
    absent = []
    for name in names:
        name = name.strip()
        if name == "gpu":
            here = shutil.which("nvidia-smi") and subprocess.run(["nvidia-smi", "-L"], capture_output=True).returncode == 0
        elif name == "cuda":
            here = b"cudaMalloc" in Path(os.environ.get("ESPALIER_LIBRARY", os.devnull)).read_bytes()
        elif name == "program":
            here = bool(os.environ.get("ESPALIER_BINARY"))
        elif name == "library":
            here = bool(os.environ.get("ESPALIER_LIBRARY"))
        elif name.startswith("command "):
            here = shutil.which(name.split()[1])
        elif name.startswith("file "):
            here = os.path.exists(os.path.expandvars(name[5:]))
        elif name.startswith("host "):
            folder = os.environ.get("ESPALIER_HOSTS") or str(Path(os.environ.get("ESPALIER_BINARY", "/")).parent / "hosts")
            here = os.path.exists(f"{folder}/{name[5:]}")
        elif name.startswith("header "):
            here = any(os.path.exists(f"{d}/{name[7:]}") for d in ("/usr/include", "/usr/local/include", "/usr/include/eigen3"))
        else:
            here = importlib.util.find_spec(name) is not None
        if not here:
            absent.append(name)
    return absent


def same(wanted, printed):
    """Whether a text is what was expected: blanks alike, "..." for anything."""
    parts = [re.escape(" ".join(p.split())) for p in wanted.split("...")]
    pattern = r"\s*.*?\s*".join(p.replace(r"\ ", r"\s+") for p in parts)
    return re.fullmatch(pattern, " ".join(printed.split()), re.S) is not None


def link_words(passed="-Wl,"):
    """The library of the build and what it needs; a shared one is found where it lies."""
    library = os.environ["ESPALIER_LIBRARY"]
    found = [] if library.endswith(".a") else [f"{passed}-rpath={Path(library).parent}"]
    return [library, *found, *os.environ.get("ESPALIER_LINK", LINK).split()]


class Failure(Exception):
    pass


# Says whether Debian has the packages; where the lists of packages are not here, nothing.
APT_GET = """#!/bin/bash
known=$(apt-cache pkgnames 2>/dev/null)
[[ -n $known ]] || exit 0
for word; do
  case $word in -*|install|update|build-dep) continue ;; esac
  grep -qxF -e "$word" <<<"$known" || { echo "there is no package $word" >&2; exit 100; }
done
"""
SUDO = """#!/bin/bash
exec "$@"
"""
RUN = """#!/bin/bash
[[ $# == 0 ]] || exec "${0%/*}/build/release/espalier" "$@"
"""
PREFIX = "/opt/espalier"


def executable(path, text):
    path.write_text(text)
    path.chmod(0o755)


def clone(folder):
    """What a clone looks like after `./run`, in an empty folder."""
    for entry in ROOT.iterdir():
        if not entry.name.startswith(".") and entry.name not in ("build", "run"):
            (folder / entry.name).symlink_to(entry)
    (folder / "build").mkdir()
    if binary := os.environ.get("ESPALIER_BINARY"):
        (folder / "build/release").symlink_to(Path(binary).parent)
    executable(folder / "run", RUN)
    (folder / "build/commands").mkdir()
    for name, text in (("apt-get", APT_GET), ("apt", APT_GET), ("sudo", SUDO), ("xdg-open", SUDO.replace("exec", "true"))):
        executable(folder / "build/commands" / name, text)


class Page:
    """Runs the blocks of one page in a folder of its own."""

    def __init__(self, path, folder):
        self.path, self.folder = path, folder
        self.names = {"__name__": "__main__"}
        self.printed = None
        clone(folder)

    def write(self, name, text):
        """A file of the page, in place of one of the repository that has this name."""
        (self.folder / name).unlink(missing_ok=True)
        (self.folder / name).write_text(text)

    def python(self, block):
        out = io.StringIO()
        code = compile("\n" * block.line + block.text, str(block.page), "exec")
        wanted = block.notes.get("raises")
        with contextlib.redirect_stdout(out), contextlib.chdir(self.folder):
            try:
                exec(code, self.names)  # noqa: S102 (that is what this is for)
            except Exception as error:  # noqa: BLE001
                if wanted is None or wanted not in [c.__name__ for c in type(error).__mro__]:
                    raise Failure(traceback.format_exc(limit=-3)) from error
                out.write(f"{type(error).__name__}: {error}")
            else:
                if wanted is not None:
                    raise Failure(f"did not raise {wanted}")
        return out.getvalue()

    def environment(self):
        env = dict(os.environ)
        binary = env.get("ESPALIER_BINARY")
        env["PATH"] = os.pathsep.join([str(self.folder / "build/commands"), *([str(Path(binary).parent)] if binary else []),
                                       str(Path(sys.executable).parent), env["PATH"]])
        env["NO_COLOR"] = "1"
        env["BROWSER"] = "true"
        return env

    def prefix(self):
        """Where the page thinks that the library is installed."""
        found = self.folder / "build/prefix"
        if not found.exists():
            build = Path(os.environ["ESPALIER_BINARY"]).parent
            subprocess.run(["cmake", "--install", str(build), "--prefix", str(found)], check=True, stdout=subprocess.DEVNULL,
                           timeout=300)
        return str(found)

    def begin(self, text, seconds):
        """A command that may take longer than a test: it must not fail within some seconds."""
        run = subprocess.Popen(["bash", "-euo", "pipefail", "-c", text], cwd=self.folder, env=self.environment(), text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True)
        try:
            printed, _ = run.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            run.communicate()
        else:
            if run.returncode != 0:
                raise Failure(f"$ {text}\nexit code {run.returncode}\n{printed[-3000:]}")

    def commands(self, block):
        """Commands of one shell."""
        text = block.text
        if PREFIX in text:
            text = text.replace(PREFIX, self.prefix())
        if "stopped" not in block.notes:
            return self.shell("trap 'echo \"failed: $BASH_COMMAND\"' ERR\n" + text)
        seconds = re.fullmatch(r"after ([\d.]+) s", block.notes["stopped"].strip())
        if not seconds:
            raise Failure("<!-- stopped: after 5 s --> is how this is said")
        for command in text.replace("\\\n", " ").splitlines():
            self.begin(command, float(seconds[1]))
        return ""

    def shell(self, text):
        run = subprocess.run(["bash", "-euo", "pipefail", "-c", text], cwd=self.folder, env=self.environment(),
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300, stdin=subprocess.DEVNULL)
        if run.returncode != 0:
            raise Failure(f"exit code {run.returncode}\n{run.stdout[-3000:]}")
        return run.stdout

    def console(self, block):
        """Commands and, between them, what they print."""
        command, wanted = None, []
        for line in block.text.splitlines() + ["$ "]:
            if line.startswith("$ ") or line == "$":
                if command is not None:
                    printed = self.shell(command)
                    if wanted and not same("\n".join(wanted), printed):
                        raise Failure(f"$ {command}\nshould print\n" + "\n".join(wanted) + f"\nbut prints\n{printed}")
                command, wanted = line[2:], []
            elif command is not None and command.endswith("\\"):
                command += "\n" + line
            else:
                wanted.append(line)
        return None

    def compile(self, block):
        """A C or C++ program, or a fragment inside what `around` says: compiled, linked, and run where it has a main()."""
        text = block.text
        if around := block.notes.get("around"):
            include = [line for line in text.splitlines() if line.startswith("#include")]
            rest = [line for line in text.splitlines() if not line.startswith("#include")]
            head, at, tail = around.partition("@@")
            if not at:
                raise Failure("the comment 'around' has no @@")
            text = "\n".join(include) + "\n" + head + "\n".join(rest) + tail + "\n"
        name = block.file or f"block{block.line}.{block.language}"
        source = self.folder / name
        self.write(name, text)
        program = source.with_suffix("")
        if name.endswith(".cu"):
            return self.cuda(source)
        main = re.search(r"\bmain\s*\(", text)
        compiler = os.environ.get("CC" if block.language == "c" else "CXX") or ("cc" if block.language == "c" else "c++")
        words = [compiler, "-std=c99" if block.language == "c" else "-std=c++20", "-O0", "-Wall", "-I", str(ROOT / "include"),
                 "-I", "/usr/include/eigen3", str(source)]
        if not main:
            words += ["-c", "-o", str(program) + ".o"]
        else:
            obj = str(program) + ".o"
            run = subprocess.run([*words, "-c", "-o", obj], capture_output=True, text=True, timeout=300)
            if run.returncode != 0:
                raise Failure(run.stderr[-3000:])
            words = [os.environ.get("CXX") or "c++", obj, "-o", str(program), *link_words()]
        run = subprocess.run(words, capture_output=True, text=True, timeout=300)
        if run.returncode != 0:
            raise Failure(run.stderr[-3000:])
        return self.shell(f"./{program.name}") if main else ""

    def cuda(self, source):
        """A CUDA program: compiled where nvcc is, linked and run where a GPU is and the library has the CUDA backend."""
        obj = source.with_suffix(".o")
        run = subprocess.run(["nvcc", "-std=c++20", "-I", str(ROOT / "include"), "-c", "-o", str(obj), str(source)],
                             capture_output=True, text=True, timeout=300)
        if run.returncode != 0:
            raise Failure(run.stderr[-3000:])
        absent = missing(["gpu", "cuda"])
        if absent:
            print(f"{source.name}: compiled, not run: {', '.join(absent)} is not here")
            return ""
        program = source.with_suffix("")
        run = subprocess.run(["nvcc", str(obj), "-o", str(program), *link_words("-Xlinker=")], capture_output=True, text=True, timeout=300)
        if run.returncode != 0:
            raise Failure(run.stderr[-3000:])
        return self.shell(f"./{program.name}")

    def run(self, block):
        """Runs one block. @return whether there was anything to do"""
        if block.language == "output":
            if self.printed is None:
                raise Failure("no block before this one prints anything")
            if not same(block.text, self.printed):
                raise Failure(f"should print\n{block.text}but prints\n{self.printed}")
            return True
        self.printed = None
        if block.language in ("c", "cpp") and not (block.file and block.notes.get("not run")):
            self.printed = self.compile(block)
        elif block.file:
            self.write(block.file, block.text)
        elif block.language == "toml" and re.search(r"^\[(integrator|statics)\]", block.text, re.M):
            self.write("model.toml", block.text)
            self.printed = self.shell("espalier simulate model.toml --quiet")
        elif block.language == "python":
            self.printed = self.python(block)
        elif block.language == "console":
            self.console(block)
        elif block.language == "indented":
            self.printed = self.commands(block)
        elif block.language in SHELL:
            self.printed = self.shell(block.text)
        else:
            return False
        return True


def needs_of(block):
    """What a block needs to be run at all."""
    needs = re.split(r",\s*", block.notes["needs"]) if "needs" in block.notes else []
    if block.language == "python" and not block.file:
        needs.append("espalier")
    if block.language in ("c", "cpp"):
        needs.append("library")
    if block.language in SHELL or block.language == "toml" and not block.file:
        needs.append("program")
    return needs


def run_page(path, verbose):
    """@return (blocks run, blocks left out, failures)"""
    blocks, whole = blocks_of(path)
    done, out, failed = 0, 0, 0
    absent = missing(whole)
    if absent:
        count = sum(b.language not in ("output", "") for b in blocks)
        print(f"{path.relative_to(ROOT)}: {count} blocks left out, {', '.join(absent)} is not here")
        return 0, count, 0
    sys.stdout.flush()
    with tempfile.TemporaryDirectory() as folder:
        page = Page(path, Path(folder))
        skipped = False
        for block in blocks:
            if block.language in ("", "text", "diff") and not block.file:
                continue
            reason = block.notes.get("not run")
            absent = missing(needs_of(block))
            if skipped and block.language == "output":
                continue
            skipped = bool(reason or absent)
            if skipped:
                out += 1
                why = reason or ", ".join(absent) + " is not here"
                if reason is not None and len(reason.strip()) < 4:
                    print(f"{block.place}: FAILED: 'not run' without a reason")
                    failed += 1
                elif verbose or not reason:
                    print(f"{block.place}: left out: {why}")
                continue
            begin = time.monotonic()
            try:
                if not page.run(block):
                    raise Failure(f"nothing runs a block of '{block.language}': name a file in its first line, or say why it is not run")
                done += 1
            except (Failure, subprocess.TimeoutExpired, OSError) as error:
                failed += 1
                print(f"{block.place}: FAILED ({block.language})\n{error}")
                break  # what follows builds on it
            if verbose and page.printed and block.language != "output":
                print("".join(f"    {line}\n" for line in page.printed.splitlines()), end="")
            if verbose:
                print(f"{block.place}: {block.language}, {time.monotonic() - begin:.1f} s")
    return done, out, failed


def main():
    os.environ.setdefault("MPLBACKEND", "Agg")
    os.environ.setdefault("ESPALIER_SITE_ROOT", str(ROOT))
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("pages", nargs="+", type=Path, help="pages, or folders of them")
    p.add_argument("--list", action="store_true", help="list blocks and their notes")
    p.add_argument("-v", "--verbose", action="store_true")
    p.add_argument("--all-or-skip", action="store_true", help="exit code 77 when nothing could be run")
    a = p.parse_args()
    pages = [page for path in a.pages for page in (sorted(path.glob("*.md")) if path.is_dir() else [path])]
    if a.list:
        for path in pages:
            for block in blocks_of(path.resolve())[0]:
                print(f"{block.place}: {block.language or '-'} {block.file or ''} {block.notes or ''}")
        return 0
    total = [0, 0, 0]
    for path in pages:
        counts = run_page(path.resolve(), a.verbose)
        total = [t + c for t, c in zip(total, counts)]
    print(f"{total[0]} blocks run, {total[1]} left out, {total[2]} failed")
    if total[2]:
        return 1
    return 77 if a.all_or_skip and total[0] == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
