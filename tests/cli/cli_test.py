#!/usr/bin/env python3
"""Black-box tests of the binary: exit codes, messages, solutions, and the fields of the report.

ESPALIER_BINARY names the binary. Solutions are checked against a product with the matrix made here, in Python."""

import gzip
import json
import math
import os
import pathlib
import pty
import subprocess
import sys
import tempfile
import unittest

BINARY = os.environ.get("ESPALIER_BINARY", "build/release/espalier")
EPS = 2.0**-52


def coordinate(n, entries, symmetry="general", cols=None, field="real"):
    """Text of a Matrix Market file; entries are (row, column, value), 1-based."""
    lines = [f"%%MatrixMarket matrix coordinate {field} {symmetry}", f"{n} {cols or n} {len(entries)}"]
    return "\n".join(lines + [" ".join(repr(x) if isinstance(x, float) else str(x) for x in e) for e in entries]) + "\n"


def second_difference(n):
    """Lower triangle; the solution for ones is i (n + 1 - i) / 2, i from 1."""
    return [(i, i, 2.0) for i in range(1, n + 1)] + [(i + 1, i, -1.0) for i in range(1, n)]


class Cli(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def file(self, name, content):
        path = self.folder / name
        if isinstance(content, str):
            content = content.encode()
        path.write_bytes(content)
        return str(path)

    def run_cli(self, *arguments, **more):
        environment = {**os.environ, **more.pop("env", {})}
        return subprocess.run([BINARY, *map(str, arguments)], capture_output=True, text=True, timeout=120,
                              env=environment, stdin=subprocess.DEVNULL, **more)

    def expect(self, code, *arguments, says=(), **more):
        """Runs, checks the exit code and that stderr says something sensible in one message; returns the result."""
        result = self.run_cli(*arguments, **more)
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stdout}\n{result.stderr}")
        if code != 0:
            self.assertIn("error:", result.stderr)
            for bad in ("terminate called", "what():", "Sanitizer", "runtime error", "internal error", "std::"):
                self.assertNotIn(bad, result.stderr)
        for word in [says] if isinstance(says, str) else says:
            self.assertIn(word, result.stderr)
        return result

    def solve(self, content, *arguments, code=0, name="a.mtx"):
        """Solves a file with this content and returns (report, solution values column by column)."""
        out = self.folder / "x.mtx"
        result = self.expect(code, "solve", self.file(name, content), "--out", out, "--json", *arguments)
        report = json.loads(result.stdout)
        values = []
        if out.exists():
            lines = [line for line in out.read_text().splitlines() if not line.startswith("%")]
            values = [float(line) for line in lines[1:]]
        return report, values

    def assert_solution(self, x, exact, factor=100):
        self.assertEqual(len(x), len(exact))
        most = max(map(abs, exact))
        for mine, true in zip(x, exact):
            self.assertLessEqual(abs(mine - true), factor * len(exact) * EPS * most)


class RunPrograms(Cli):
    """`espalier run`: what the program finds, its exit code, and what is said in the end."""
    # The interface of MKL's PARDISO, from the library that programs find by MKLROOT: 2 x = 4.
    PARDISO = """
import ctypes, os
from ctypes import byref, c_double, c_int
lib = ctypes.CDLL(os.environ["MKLROOT"] + "/lib/libmkl_rt.so")
pt, iparm, error, x = (ctypes.c_void_p * 64)(), (c_int * 64)(), c_int(), c_double()
def call(phase):
    lib.pardiso(pt, byref(c_int(1)), byref(c_int(1)), byref(c_int(11)), byref(c_int(phase)), byref(c_int(1)), byref(c_double(2)),
                (c_int * 2)(1, 2), (c_int * 1)(1), None, byref(c_int(1)), iparm, byref(c_int(0)), byref(c_double(4)), byref(x), byref(error))
call(13)
print(x.value, error.value, os.environ["ESPALIER_OPTIONS"])
call(-1)
raise SystemExit(7)
"""

    def setUp(self):
        super().setUp()
        if not (pathlib.Path(BINARY).parent / "hosts" / "libespalier_mkl_pardiso.so").exists():
            self.skipTest("the libraries of hosts/ are not built")

    def test_a_program_finds_ours(self):
        result = self.run_cli("run", "--as", "mkl", "--threads", "1", "--", sys.executable, "-c", self.PARDISO,
                              env={"ESPALIER_OPTIONS": "device=cpu", "TMPDIR": str(self.folder)})
        self.assertEqual(result.returncode, 7, result.stderr)
        self.assertEqual(result.stdout.strip(), "2.0 0 device=cpu;threads=1")
        self.assertIn("pardiso: 1 factorization, largest n 1,", result.stderr)
        self.assertEqual(list(self.folder.iterdir()), [], "nothing is left behind")

    def test_an_interface_named_twice_is_offered_once(self):
        result = self.run_cli("run", "--as", "mkl,hsl,mkl", "--as", "hsl", "--", sys.executable, "-c", self.PARDISO,
                              env={"ESPALIER_OPTIONS": "device=cpu;threads=1"})
        self.assertEqual(result.returncode, 7, result.stderr)
        self.assertIn("pardiso: 1 factorization, largest n 1,", result.stderr)

    def test_a_folder_that_cannot_be_made(self):
        for folder in ("/nonexistent", "/dev/null"):
            self.expect(2, "run", "--", "true", env={"TMPDIR": folder}, says="folder")

    def test_programs_that_end_badly(self):
        self.assertEqual(self.run_cli("run", "--", "sh", "-c", "kill -9 $$").returncode, 128 + 9)
        self.expect(2, "run", "--", "no-such-program", says="no-such-program")
        self.expect(2, "run", says="program")
        self.expect(2, "run", "--as", "tarot", "--", "true", says="tarot")
        self.assertIn("no solver of ours", self.run_cli("run", "--", "true").stderr)


class Usage(Cli):
    def test_an_option_that_there_is_not_is_named(self):
        """Whatever stands behind it, which is read as the next argument."""
        for arguments in (["--repeats", "5", "--generate", "poisson 4 4 4"], ["--generate", "poisson 4 4 4", "--repeats"]):
            self.expect(2, "solve", *arguments, says="has no option --repeats")

    def test_wrong_usage_is_2_and_points_to_help(self):
        for arguments in ([], ["dance"], ["solve"], ["solve", "--colour", "a.mtx"], ["solve", "a.mtx", "b.mtx"],
                          ["solve", "a.mtx", "--refactor", "many"], ["solve", "a.mtx", "--refactor", "-1"],
                          ["solve", "a.mtx", "--generate", "poisson 3 3 3"], ["analyze"], ["generate"],
                          ["info", "--colour"]):
            with self.subTest(arguments=arguments):
                result = self.expect(2, *arguments)
                self.assertEqual(result.stdout, "")
                self.assertRegex(result.stderr, "--help")

    def test_wrong_values_name_the_option_and_what_it_takes(self):
        path = self.file("a.mtx", coordinate(1, [(1, 1, 1.0)]))
        for option, value, expected in (
                ("--kind", "qr", "ldlt"), ("--precision", "fp16", "mixed"), ("--device", "tpu", "host:N"),
                ("--device", "host:", "host:N"), ("--device", "host:0", "host:N"), ("--device", "gpu:x", "gpu:all"),
                ("--device-memory", "2GiBs", "2GiB"), ("--device-memory", "-2G", "2GiB"),
                ("--host-memory", "lots", "512M"), ("--host-memory", "1e400", "512M"),
                ("--host-memory", "99999999999T", "512M"), ("--threads", "two", "number"),
                ("--threads", "-3", "number"), ("--threads", "1.5", "number"), ("--max-block-size", "x", "number"),
                ("--max-block-size", "99999999999", "number")):
            with self.subTest(option=option, value=value):
                self.expect(2, "solve", path, f"{option}={value}", says=(option, expected))

    def test_sizes_that_are_understood(self):
        path = self.file("a.mtx", coordinate(1, [(1, 1, 4.0)]))
        for size in ("2GiB", "2G", "2gb", "512M", "1.5GiB", "100000k", "1073741824", "1073741824B", "1 GiB"):
            with self.subTest(size=size):
                self.expect(0, "solve", path, "--host-memory", size)

    def test_help_and_version(self):
        for arguments in (["--help"], ["solve", "--help"], ["analyze", "--help"], ["generate", "--help"],
                          ["info", "--help"]):
            result = self.run_cli(*arguments)
            self.assertEqual(result.returncode, 0)
            self.assertIn("--help", result.stdout)
        self.assertRegex(self.run_cli("--version").stdout, r"^espalier \d+\.\d+\.\d+\n$")

    def test_info(self):
        info = json.loads(self.expect(0, "info", "--json").stdout)
        self.assertRegex(info["version"], r"^\d+\.\d+\.\d+$")
        self.assertGreater(info["kernels"]["gemm_flops_per_second"], 0)
        self.assertGreaterEqual(info["machine"]["cores"], 1)
        self.assertIn("Highway", info["libraries"])
        self.assertIn("kernels", self.expect(0, "info").stdout)

    def test_machine_model(self):
        def rate(key, *options):
            model = json.loads(self.expect(0, "info", "--json", *options).stdout)["machine_model"]
            return model[key.split(".")[0]]["rates"][key.split(".", 1)[1]]

        self.assertEqual(rate("gpu.flops"), {"value": 4e13, "unit": "1/s", "source": "table"})
        self.assertEqual(rate("gpu.flops", "--machine", "gpu.flops=2e13")["source"], "caller")
        self.assertIn("gpu.out_of_core.bytes_in", self.expect(0, "info").stdout)
        self.expect(2, "info", "--machine", "gpu.speed=1")


class UnreadableInput(Cli):
    """Every broken file: exit code 2, and a message with its name (and line, where there is one)."""

    def refuse(self, content, *says, name="bad.mtx"):
        for command in ("solve", "analyze"):
            self.expect(2, command, self.file(name, content), says=(name, *says))

    def test_missing_folder_and_empty_file(self):
        self.expect(2, "solve", self.folder / "missing.mtx", says=("missing.mtx", "No such file"))
        self.expect(2, "solve", self.folder)
        self.refuse("")

    def test_truncated(self):
        text = coordinate(3, [(1, 1, 1.0), (2, 2, 1.0), (3, 3, 1.0)])
        self.refuse(text[: text.rfind("3 3")])
        self.refuse("%%MatrixMarket matrix coordinate real general\n")
        self.refuse(gzip.compress(text.encode())[:-12], name="bad.mtx.gz")

    def test_complex(self):
        for symmetry, entries, matrix in (("general", "4\n1 1 2 1\n2 1 0 1\n1 2 1 0\n2 2 3 0\n", ((2 + 1j, 1), (1j, 3))),
                                          ("symmetric", "3\n1 1 2 1\n2 1 0 1\n2 2 3 0\n", ((2 + 1j, 1j), (1j, 3))),
                                          ("hermitian", "3\n1 1 2 0\n2 1 0 1\n2 2 3 0\n", ((2, -1j), (1j, 3)))):
            rhs = self.file("b.mtx", "%%MatrixMarket matrix array complex general\n2 1\n1 2\n3 -1\n")
            out = self.folder / "x.mtx"
            a = self.file("a.mtx", f"%%MatrixMarket matrix coordinate complex {symmetry}\n2 2 {entries}")
            report = json.loads(self.expect(0, "solve", a, "--rhs", rhs, "--out", out, "--condition", "--json").stdout)
            x = [complex(*map(float, line.split())) for line in out.read_text().splitlines() if line[0] != "%"][1:]
            for row, b in zip(matrix, (1 + 2j, 3 - 1j)):
                self.assertLessEqual(abs(row[0] * x[0] + row[1] * x[1] - b), 1e-14)
            determinant = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0]
            self.assertLessEqual(abs(complex(*report["determinant"]["phase"]) - determinant / abs(determinant)), 1e-14)
            self.assertEqual((report["matrix"]["complex"], report["matrix"]["hermitian"]), (True, symmetry == "hermitian"))
            self.assertEqual(report["inertia"]["positive"], 2 if symmetry == "hermitian" else -1)
            self.expect(0, "analyze", a)
            # A device without complex numbers takes the real system of twice the size.
            report = json.loads(self.expect(0, "solve", a, "--rhs", rhs, "--out", out, "--device", "reference", "--json").stdout)
            again = [complex(*map(float, line.split())) for line in out.read_text().splitlines() if line[0] != "%"][1:]
            self.assertLessEqual(max(abs(p - q) for p, q in zip(x, again)), 1e-14)
            self.assertEqual(report["determinant"]["phase"], [1, 0] if symmetry == "hermitian" else None)
            self.assertLessEqual(abs(report["determinant"]["log"] - math.log(abs(determinant))), 1e-13)

    def test_complex_right_hand_sides_of_a_real_matrix(self):
        # Second differences and unsymmetric; two columns, one with an imaginary part that is zero. Truth: the product.
        for name, symmetry, entries, rows in (("spd", "symmetric", second_difference(3), ((2, -1, 0), (-1, 2, -1), (0, -1, 2))),
                                              ("lu", "general", [(1, 2, 1.0), (2, 1, 3.0), (2, 3, 1.0), (3, 3, 2.0)],
                                               ((0, 1, 0), (3, 0, 1), (0, 0, 2)))):
            a, out = self.file(name + ".mtx", coordinate(3, entries, symmetry)), self.folder / "x.mtx"
            b = (1 + 2j, -3j, 4, 5, 6, 7)
            rhs = self.file("b.mtx", "%%MatrixMarket matrix array complex general\n3 2\n"
                            + "".join(f"{complex(v).real} {complex(v).imag}\n" for v in b))
            report = json.loads(self.expect(0, "solve", a, "--rhs", rhs, "--out", out, "--json").stdout)
            self.assertLessEqual(report["backward_error"]["normwise"], 1e-15)
            lines = [line for line in out.read_text().splitlines() if line[0] != "%"]
            self.assertEqual(lines[0], "3 2")
            x = [complex(*map(float, line.split())) for line in lines[1:]]
            for k in range(6):
                product = sum(v * x[3 * (k // 3) + j] for j, v in enumerate(rows[k % 3]))
                self.assertLessEqual(abs(product - b[k]), 1e-14)
        self.expect(2, "solve", a, "--rhs", self.file("b.mtx", "%%MatrixMarket matrix array complex general\n2 1\n1 2\n3 4\n"),
                    says="2 x 1")

    def test_malformed(self):
        self.refuse("hello\n")
        self.refuse("%%MatrixMarket matrix coordinate complex hermitian\n1 1 1\n1 1 1 2\n", ":3")
        self.refuse("%%MatrixMarket matrix coordinate real general\n2 2 x\n", ":2")
        self.refuse("%%MatrixMarket matrix coordinate real general\n2 2 1\n1 1 1.0.0\n", ":3")
        self.refuse("%%MatrixMarket matrix coordinate real general\n2 2 1\n1 3 1.0\n", ":3")
        self.refuse("%%MatrixMarket matrix coordinate real general\n2 2 1\n0 1 1.0\n", ":3")
        self.refuse("%%MatrixMarket matrix coordinate real general\n-2 -2 1\n1 1 1.0\n", ":2")
        self.refuse("%%MatrixMarket matrix coordinate real general\n99999999999 99999999999 1\n1 1 1.0\n")
        self.refuse(coordinate(2, [(1, 1, 1.0), (2, 2, 1.0)]) + "2 1 5.0\n")
        self.refuse(b"\x00\xff\x7fELF" * 100, name="bad.bin")

    def test_encodings(self):
        text = coordinate(1, [(1, 1, 2.0)])
        self.expect(0, "solve", self.file("bom.mtx", b"\xef\xbb\xbf" + text.encode()))
        self.expect(0, "solve", self.file("bom.mtx.gz", gzip.compress(b"\xef\xbb\xbf" + text.encode())))
        self.expect(0, "solve", self.file("crlf.mtx", text.replace("\n", "\r\n")))
        for encoding in ("utf-16-le", "utf-16-be"):
            self.refuse(("\ufeff" + text).encode(encoding), "UTF-16")

    def test_a_file_that_is_cut_short_while_it_is_read(self):
        matrix = self.folder / "big.mtx"
        self.expect(0, "generate", "poisson", 60, "--out", matrix)
        text = matrix.read_bytes()
        seen = set()
        for _ in range(10):
            matrix.write_bytes(text)
            process = subprocess.Popen([BINARY, "analyze", matrix, "--threads", "1"], stdout=subprocess.DEVNULL,
                                       stderr=subprocess.PIPE, text=True)
            maps = pathlib.Path(f"/proc/{process.pid}/maps")
            while process.poll() is None and "big.mtx" not in maps.read_text():
                pass
            os.truncate(matrix, 0)
            said = process.communicate()[1]
            self.assertIn(process.returncode, (0, 2), said)
            seen.add(process.returncode)
            if process.returncode == 2:
                self.assertRegex(said, "became shorter|is empty|truncated")
        self.assertIn(2, seen)

    def test_not_finite(self):
        for value in ("nan", "NaN", "inf", "-inf", "1e999"):
            self.refuse(f"%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 1\n2 2 {value}\n", ":4")

    def test_rectangular_and_empty(self):
        self.refuse(coordinate(2, [(1, 1, 1.0)], cols=3), "2 x 3", "square")
        self.refuse("%%MatrixMarket matrix coordinate real general\n0 0 0\n", "empty")

    def test_right_hand_side(self):
        matrix = self.file("a.mtx", coordinate(2, [(1, 1, 1.0), (2, 2, 1.0)]))
        head = "%%MatrixMarket matrix array real general\n"
        for name, text, says in (("short.mtx", head + "2 1\n1\n", ""), ("long.mtx", head + "3 1\n1\n2\n3\n", "3 x 1"),
                                 ("wide.mtx", head + "1 2\n1\n2\n", "1 x 2"), ("none.mtx", head + "2 0\n", ""),
                                 ("nan.mtx", head + "2 1\n1\nnan\n", "")):
            with self.subTest(name=name):
                self.expect(2, "solve", matrix, "--rhs", self.file(name, text), says=(name, says))
        self.expect(2, "solve", matrix, "--rhs", self.folder / "missing.mtx", says="missing.mtx")

    def test_unknown_commands_are_named(self):
        self.expect(2, "dance", says=("'espalier dance'", "'espalier --help'"))
        self.expect(2, "bench", "dance", says=("'espalier bench dance'", "'espalier bench --help'"))

    def test_generators(self):
        for spec in ("", "bicycle 3 3", "elasticity", "elasticity 3 3", "elasticity 3 3 x", "elasticity 0 3 3",
                     "elasticity 3 3 3 3", "elasticity -1 3 3", "elasticity 99999 99999 99999", "kkt 0"):
            with self.subTest(spec=spec):
                self.expect(2, "solve", "--generate", spec)
                if spec:
                    self.expect(2, "generate", *spec.split(), "--out", self.folder / "g.mtx")


class Solutions(Cli):
    """Odd but sound systems: the right answer."""

    def test_second_difference(self):
        n = 40
        report, x = self.solve(coordinate(n, second_difference(n), "symmetric"))
        self.assert_solution(x, [i * (n + 1 - i) / 2 for i in range(1, n + 1)], factor=n)
        self.assertEqual(report["status"], "ok")
        self.assertLessEqual(report["backward_error"]["normwise"], 1e-14)
        self.assertEqual(report["inertia"], {"positive": n, "negative": 0, "zero": 0})

    def test_one_unknown(self):
        self.assertEqual(self.solve(coordinate(1, [(1, 1, -4.0)]))[1], [-0.25])
        self.assertEqual(self.solve(coordinate(1, [(1, 1, -4.0)], "symmetric"))[1], [-0.25])

    def test_duplicates_are_summed(self):
        self.assert_solution(self.solve(coordinate(2, [(1, 1, 1.0), (2, 2, 2.0), (1, 1, 1.0), (2, 2, 2.0)]))[1],
                             [0.5, 0.25])

    def test_both_triangles_of_a_symmetric_file(self):
        entries = [(1, 1, 4.0), (2, 2, 4.0), (2, 1, 1.0), (1, 2, 1.0)]
        report, x = self.solve(coordinate(2, entries, "symmetric"))
        self.assert_solution(x, [0.2, 0.2])
        self.assertEqual(len(report["matrix"]["notices"]), 1)
        self.assertIn("1 entry and its mirror image were taken once", report["matrix"]["notices"][0])
        for command in (["solve"], ["analyze"], ["modes", self.folder / "a.mtx", "--count", "1"]):
            result = self.expect(0, *command, self.folder / "a.mtx")
            self.assertIn("taken once", result.stdout + result.stderr)
        for symmetry, more in (("symmetric", ""), ("general", "1 2 1\n")):  # as it should be: nothing is said
            text = f"%%MatrixMarket matrix coordinate real {symmetry}\n2 2 {3 + bool(more)}\n1 1 4\n2 2 4\n2 1 1\n{more}"
            self.assertEqual(self.solve(text)[0]["matrix"]["notices"], [])
        text = "%%MatrixMarket matrix coordinate complex hermitian\n2 2 4\n1 1 4 0\n2 2 4 0\n2 1 0 1\n1 2 0 -1\n"
        result = self.expect(0, "solve", self.file("h.mtx", text), "--json")
        self.assertEqual(len(json.loads(result.stdout)["matrix"]["notices"]), 1)
        self.solve(coordinate(2, entries[:3] + [(1, 2, 3.0)], "symmetric"), code=2)

    def test_upper_triangle_of_a_symmetric_file(self):
        self.assert_solution(self.solve(coordinate(2, [(1, 1, 4.0), (2, 2, 4.0), (1, 2, 1.0)], "symmetric"))[1],
                             [0.2, 0.2])

    def test_explicit_zeros(self):
        entries = [(1, 1, 2.0), (2, 2, 4.0), (3, 3, 8.0), (3, 1, 0.0), (2, 1, 0.0)]
        self.assert_solution(self.solve(coordinate(3, entries, "symmetric"))[1], [0.5, 0.25, 0.125])

    def test_zero_diagonal_needs_pivoting(self):
        report, x = self.solve(coordinate(2, [(1, 1, 0.0), (2, 1, 2.0)], "symmetric"))
        self.assert_solution(x, [0.5, 0.5])
        self.assertEqual(report["inertia"], {"positive": 1, "negative": 1, "zero": 0})
        self.assertEqual(report["pivots"]["two_by_two"], 1)
        self.assert_solution(self.solve(coordinate(2, [(1, 2, 2.0), (2, 1, 4.0)]))[1], [0.25, 0.5])

    def test_disconnected(self):
        n = 30
        entries = [(i, i, float(i)) for i in range(1, n + 1)] + [(2, 1, 0.5), (n, n - 1, 0.5)]
        _, x = self.solve(coordinate(n, entries, "symmetric"))
        dense = [[0.0] * n for _ in range(n)]
        for i, j, v in entries:
            dense[i - 1][j - 1] = dense[j - 1][i - 1] = v
        for row in dense:
            self.assertLessEqual(abs(sum(a * b for a, b in zip(row, x)) - 1), 100 * n * EPS)

    def test_dense_row(self):
        """An arrow: A = diag(n) with ones in the last row and column; the solution for ones is solved by hand."""
        n = 500
        entries = [(i, i, float(n)) for i in range(1, n + 1)] + [(n, i, 1.0) for i in range(1, n)]
        _, x = self.solve(coordinate(n, entries, "symmetric"))
        last = (1 - (n - 1) / n) / (n - (n - 1) / n)
        self.assert_solution(x, [(1 - last) / n] * (n - 1) + [last])

    def test_unsymmetric_rhs_and_several_columns(self):
        matrix = coordinate(3, [(1, 1, 2.0), (1, 3, 1.0), (2, 2, 4.0), (3, 1, -1.0), (3, 3, 1.0)])
        rhs = self.file("b.mtx", "%%MatrixMarket matrix array real general\n3 2\n3\n4\n0\n6\n8\n0\n")
        report, x = self.solve(matrix, "--rhs", rhs)
        self.assert_solution(x, [1, 1, 1, 2, 2, 2])
        self.assertEqual(report["kind"], "lu")
        self.assertEqual(report["solve"]["columns"], 2)

    def test_kinds_precisions_and_devices_agree(self):
        n = 60
        text = coordinate(n, second_difference(n), "symmetric")
        exact = [i * (n + 1 - i) / 2 for i in range(1, n + 1)]
        for arguments in (["--kind", "llt"], ["--kind", "ldlt"], ["--kind", "lu"], ["--precision", "mixed"],
                          ["--threads", "1"], ["--device", "cpu"], ["--device", "host:1"], ["--device", "host:1,1"],
                          ["--max-block-size", "32"], ["--refactor", "2"], ["--host-memory", "1G"]):
            with self.subTest(arguments=arguments):
                report, x = self.solve(text, *arguments)
                self.assert_solution(x, exact, factor=n)
                if arguments[0] == "--kind":
                    self.assertEqual(report["kind"], arguments[1])

    def test_compressed_file(self):
        text = gzip.compress(coordinate(2, [(1, 1, 2.0), (2, 2, 4.0)]).encode())
        self.assert_solution(self.solve(text, name="a.mtx.gz")[1], [0.5, 0.25])

    def test_a_long_diagonal(self):
        n = 200000
        body = "\n".join(f"{i} {i} 2" for i in range(1, n + 1))
        _, x = self.solve(f"%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {n}\n{body}\n")
        self.assertLessEqual(max(abs(value - 0.5) for value in x), 4 * EPS)

    def test_runs_are_bit_identical(self):
        spec = ("solve", "--generate", "elasticity 4 3 3", "--quiet", "--out")
        texts = []
        for threads in ("1", "2", "2"):
            out = self.folder / "x.mtx"
            self.expect(0, *spec, out, "--threads", threads)
            texts.append(out.read_text())
        self.assertEqual(texts[0], texts[1])
        self.assertEqual(texts[1], texts[2])


class Failures(Cli):
    """Systems without an answer: the exit code and a message that names rows."""

    def test_structurally_singular(self):
        report, x = self.solve(coordinate(3, [(1, 1, 1.0), (3, 3, 1.0)]), code=3)
        self.assertEqual((report["status"], report["exit_code"], x), ("singular", 3, []))
        self.assertEqual(report["row"], 1)
        self.assertIn("row 1 (counted from 0)", report["message"])  # the file counts from 1
        self.solve(coordinate(3, [(1, 1, 1.0), (2, 1, 1.0), (3, 1, 1.0)]), code=3)

    def test_numerically_singular(self):
        self.solve(coordinate(2, [(1, 1, 1.0), (1, 2, 2.0), (2, 1, 2.0), (2, 2, 4.0)]), code=3)
        n = 20  # a bar that is held nowhere
        entries = [(i, i, 2.0 if 1 < i < n else 1.0) for i in range(1, n + 1)] + [(i + 1, i, -1.0) for i in range(1, n)]
        report, _ = self.solve(coordinate(n, entries, "symmetric"), code=3)
        self.assertEqual((report["status"], report["rank"]), ("singular", n - 1))
        pull = "%%MatrixMarket matrix array real general\n20 1\n" + "1\n" + "0\n" * (n - 2) + "-1\n"
        report, _ = self.solve(coordinate(n, entries, "symmetric"), "--singular", "report", "--rhs", self.file("b.mtx", pull))
        self.assertEqual((report["rank"], len(report["dependent_rows"])), (n - 1, 1))

    def test_zero_matrix(self):
        self.solve(coordinate(2, [(1, 1, 0.0), (2, 2, 0.0)]), code=3)
        self.solve("%%MatrixMarket matrix coordinate real general\n2 2 0\n", code=3)

    def test_not_positive_definite(self):
        report, _ = self.solve(coordinate(2, [(1, 1, 1.0), (2, 1, 2.0), (2, 2, 1.0)], "symmetric"), "--kind", "llt",
                               code=3)
        self.assertEqual(report["status"], "not_positive_definite")
        report, _ = self.solve(coordinate(2, [(1, 1, 1.0), (2, 1, 2.0), (2, 2, 1.0)], "symmetric"))
        self.assertEqual(report["kind"], "ldlt")  # auto falls back

    def test_llt_needs_a_symmetric_matrix(self):
        self.solve(coordinate(2, [(1, 1, 1.0), (1, 2, 2.0), (2, 2, 1.0)]), "--kind", "llt", code=2)

    def test_memory(self):
        result = self.expect(4, "solve", "--generate", "elasticity 8 8 8", "--host-memory", "64K")
        self.assertRegex(result.stderr, r"\d+(\.\d+)? [KMG]iB")
        self.expect(4, "analyze", "--generate", "elasticity 8 8 8", "--host-memory", "64K", "--dry-run")

    def test_no_gpu(self):
        if pathlib.Path("/dev/nvidia0").exists():
            self.skipTest("this machine has a GPU")
        self.expect(5, "solve", "--generate", "elasticity 3 3 3", "--device", "gpu:0")


class Reports(Cli):
    """The report: its fields, and that figures which are known beforehand are right."""

    def check_fields(self, report):
        for path in ("matrix.rows matrix.nonzeros matrix.symmetric kind analysis.seconds analysis.ordering_seconds "
                     "analysis.nonzeros_factor analysis.flops factor.seconds factor.flops_per_second "
                     "factor.refactor_seconds solve.seconds backward_error.normwise backward_error.componentwise "
                     "inertia.positive inertia.negative inertia.zero pivots.two_by_two pivots.perturbed "
                     "memory.predicted_bytes memory.peak_host_bytes devices status").split():
            at = report
            for key in path.split("."):
                self.assertIn(key, at, path)
                at = at[key]

    def test_fields(self):
        file = self.folder / "r.json"
        trace = self.folder / "t.json"
        self.expect(0, "solve", "--generate", "elasticity 5 4 3", "--refactor", "3", "--report", file, "--trace", trace)
        report = json.loads(file.read_text())
        self.check_fields(report)
        n = 3 * 5 * 5 * 4
        self.assertEqual(report["matrix"]["rows"], n)
        self.assertIs(report["matrix"]["symmetric"], True)
        self.assertEqual(report["kind"], "llt")
        self.assertEqual(sum(report["inertia"].values()), n)
        self.assertGreaterEqual(report["analysis"]["nonzeros_factor"], report["matrix"]["nonzeros"])
        self.assertGreater(report["analysis"]["flops"], 0)
        self.assertEqual(report["factor"]["refactorizations"], 3)
        rate = report["analysis"]["flops"] / report["factor"]["refactor_seconds"]
        self.assertAlmostEqual(report["factor"]["flops_per_second"] / rate, 1)
        self.assertGreaterEqual(report["memory"]["peak_host_bytes"], 8 * report["analysis"]["nonzeros_factor"])
        self.assertGreaterEqual(len(report["devices"]), 1)
        for device in report["devices"]:
            self.assertEqual(set(device), {"name", "busy_seconds", "idle_fraction", "waiting_seconds", "stolen_subtrees", "peak_bytes",
                                       "predicted_peak_bytes", "transferred_bytes", "streamed_in_bytes", "streamed_out_bytes", "disk_written_bytes", "disk_read_bytes", "link_seconds"})
            self.assertTrue(0 <= device["idle_fraction"] <= 1)
        events = json.loads(trace.read_text())
        self.assertTrue(events["traceEvents"] if isinstance(events, dict) else events)

    def test_json_on_stdout_is_the_report(self):
        report = json.loads(self.expect(0, "solve", "--generate", "kkt 2 3 2 2", "--json").stdout)
        self.check_fields(report)
        self.assertEqual(report["kind"], "ldlt")
        self.assertIsNone(report["factor"]["refactor_seconds"])
        self.assertGreater(report["inertia"]["negative"], 0)  # one for each multiplier
        self.assertEqual(report["inertia"]["zero"], 0)

    def test_a_failed_run_still_reports(self):
        report, _ = self.solve(coordinate(2, [(1, 1, 1.0)]), code=3)
        self.check_fields({**report, "factor": report["factor"] or {"seconds": 0, "flops_per_second": 0,
                                                                    "refactor_seconds": 0},
                           "analysis": report["analysis"] or dict.fromkeys(
                               ("seconds", "ordering_seconds", "nonzeros_factor", "flops")),
                           "solve": {"seconds": 0}, "backward_error": {"normwise": 0, "componentwise": 0},
                           "inertia": report["inertia"] or dict.fromkeys(("positive", "negative", "zero")),
                           "pivots": report["pivots"] or dict.fromkeys(("two_by_two", "perturbed"))})
        self.assertIsNone(report["solve"])
        self.assertTrue(report["message"])

    def test_analyze(self):
        result = self.expect(0, "analyze", "--generate", "elasticity 6 6 6", "--json", "--dry-run")
        report = json.loads(result.stdout)
        self.assertIsNone(report["factor"])
        self.assertEqual(sum(row["fronts"] for row in report["tree"]), report["analysis"]["fronts"])
        self.assertEqual(len(report["tree"]), report["analysis"]["tiers"])
        self.assertAlmostEqual(sum(row["flops"] for row in report["tree"]) / report["analysis"]["flops"], 1, places=6)
        self.assertEqual(max(row["largest_front"] for row in report["tree"]), report["analysis"]["largest_front"])
        self.assertGreater(report["memory"]["predicted_bytes"], 0)
        text = self.expect(0, "analyze", "--generate", "elasticity 6 6 6", "--dry-run").stdout
        for word in ("tier", "largest front", "memory", "work to come"):
            self.assertIn(word, text)

    def test_a_saved_analysis_serves(self):
        matrix = self.folder / "a.mtx"
        self.expect(0, "generate", "elasticity", "4", "4", "4", "--out", matrix)
        saved = self.folder / "a.analysis"
        self.expect(0, "analyze", matrix, "--save", saved)
        report = json.loads(self.expect(0, "solve", matrix, "--analysis", saved, "--json").stdout)
        self.assertEqual(report["status"], "ok")
        other = self.file("other.mtx", coordinate(3, second_difference(3), "symmetric"))
        self.expect(2, "solve", other, "--analysis", saved)
        saved.write_bytes(saved.read_bytes()[:100])
        self.expect(2, "solve", matrix, "--analysis", saved)


class Terminal(Cli):
    def test_plain_lines_and_no_escapes_without_a_terminal(self):
        result = self.expect(0, "solve", "--generate", "elasticity 4 4 4", "--refactor", "1")
        for text in (result.stdout, result.stderr):
            self.assertNotIn("\x1b", text)
            self.assertNotIn("\r", text)
        for phase in ("analysis", "factorization", "refactorization", "solve"):
            self.assertRegex(result.stderr, f"(?m)^{phase}[^:]*: ")
            self.assertIn(phase, result.stdout)
        for word in ("GFLOP/s", "fill", "predicted", "backward error", "inertia", "solved"):
            self.assertIn(word.lower().replace("gflop/s", "flop/s"), result.stdout.lower())

    def on_terminal(self, **env):
        leader, follower = pty.openpty()
        process = subprocess.Popen([BINARY, "solve", "--generate", "elasticity 4 4 4"], stdout=follower, stderr=follower,
                                   stdin=subprocess.DEVNULL, env={**os.environ, "TERM": "xterm", **env})
        os.close(follower)
        text = b""
        while True:
            try:
                piece = os.read(leader, 65536)
            except OSError:
                break
            if not piece:
                break
            text += piece
        os.close(leader)
        self.assertEqual(process.wait(timeout=60), 0)
        return text.decode()

    def test_colour_on_a_terminal_unless_no_color(self):
        self.assertIn("\x1b[1;32m", self.on_terminal(NO_COLOR=""))
        self.assertNotRegex(self.on_terminal(NO_COLOR="1"), "\x1b\\[[0-9;]*m")

    def test_quiet_says_nothing(self):
        for command in (["solve", "--generate", "elasticity 3 3 3"], ["analyze", "--generate", "elasticity 3 3 3"],
                        ["analyze", "--dry-run", "--generate", "elasticity 3 3 3"],
                        ["generate", "elasticity", "3", "3", "3", "--out", self.folder / "a.mtx"]):
            for flag in ("-q", "--quiet"):
                with self.subTest(command=command, flag=flag):
                    result = self.expect(0, *command, flag)
                    self.assertEqual((result.stdout, result.stderr), ("", ""))
        self.assertGreater((self.folder / "a.mtx").stat().st_size, 0)
        self.expect(2, "analyze", self.folder / "missing.mtx", "-q", says="missing.mtx")


class Generate(Cli):
    def test_elasticity_has_the_documented_size(self):
        for extension in ("mtx", "mtx.gz", "esp"):
            path = self.folder / f"a.{extension}"
            self.expect(0, "generate", "elasticity", 3, 4, 5, "--out", path)
            report = json.loads(self.expect(0, "solve", path, "--json").stdout)
            self.assertEqual(report["matrix"]["rows"], 3 * 3 * 5 * 6)

    def test_seed_changes_values_and_repeats(self):
        texts = []
        for name, seed in (("a", 1), ("b", 1), ("c", 2)):
            path = self.folder / f"{name}.mtx"
            self.expect(0, "generate", "elasticity", 2, 2, 2, "--seed", seed, "--out", path)
            texts.append(path.read_text())
        self.assertEqual(texts[0], texts[1])
        self.assertNotEqual(texts[0], texts[2])
        for seed in (-1, "1.5", "99999999999999999999999", "x"):
            self.expect(2, "generate", "poisson", 2, 2, 2, "--seed", seed, "--out", self.folder / "d.mtx", says="--seed")

    def test_every_generator_solves(self):
        for spec, code in (("elasticity 3 3 3", 0), ("plate 6 5", 0), ("shell 6 5", 0), ("poisson 5 5 5", 0),
                           ("kkt 3 3 2 2", 0), ("gyroscopic 3 3 3", 0), ("kkt-scaled 2 3 2 2", 0),
                           ("kkt-redundant 2 2 3 2 2", 3)):
            with self.subTest(spec=spec):
                self.expect(code, "solve", "--generate", spec)


if __name__ == "__main__":
    unittest.main()
