"""espalier.mpi: a solver that three processes share, started by mpirun with mpi4py. Truth: the solver of one process, whose
numbers all processes must have to the last bit. Skipped where mpirun, mpi4py or the adapter is not there."""

import os
import shutil
import subprocess
import sys
import textwrap

import pytest

PROGRAM = textwrap.dedent('''
    import sys
    import numpy as np
    import scipy.sparse as sp
    try:
        from mpi4py import MPI
    except ImportError:  # Debian's, for the Python that we have
        sys.path.append("/usr/lib/python3/dist-packages")
        try:
            from mpi4py import MPI
        except ImportError:
            sys.exit(77)
    import espalier, espalier.mpi
    try:
        espalier.mpi.adapter()
    except FileNotFoundError:
        sys.exit(77)
    comm = MPI.COMM_WORLD
    rank, size = comm.Get_rank(), comm.Get_size()
    assert size == 3, size
    n = 9
    line = sp.diags_array([-1.0, 2.5, -1.2], offsets=[-1, 0, 1], shape=(n, n))
    whole = sp.csr_array(sp.kron(sp.eye_array(n), line) + sp.kron(line, sp.eye_array(n)))
    n = whole.shape[0]
    b = np.random.default_rng(3).standard_normal((n, 2))
    alone = espalier.Solver(sp.csc_array(whole), kind="lu", device="cpu", threads=1)
    x, xt = alone.solve(b), alone.solve(b[:, 0], transpose=True)
    begin, end = rank * n // 3, (rank + 1) * n // 3
    mine = whole[begin:end]

    def wrong(call, *words):
        try:
            call()
        except (espalier.InvalidInputError, ValueError, TypeError, RuntimeError) as e:
            assert all(w in str(e) for w in words), str(e)
        else:
            raise AssertionError("no error")

    with espalier.mpi.Solver(comm, kind="lu", device="cpu", threads=1, patience=20) as solver:
        wrong(lambda: solver.solve(b[begin:end]), "no factorization")
        analysis = solver.analyze(mine)
        assert solver.rows == (begin, end - begin)
        factor = solver.factorize(mine)
        assert analysis.nonzeros_factor == alone.analysis.nonzeros_factor
        assert factor.determinant_log == alone.factor.determinant_log
        assert np.array_equal(solver.solve(b[begin:end]), x[begin:end])
        assert np.array_equal(solver.solve(b[begin:end, 0], transpose=True), xt[begin:end])
        assert solver.last_solve.backward_error < 1e-15
        # Values alone; then all rows of vectors on the last process.
        solver.factorize(2 * mine.data)
        solver.set_rows(0, n if rank == 2 else 0)
        y = solver.solve(b if rank == 2 else np.zeros((0, 2)))
        assert rank != 2 or np.allclose(2 * y, x, rtol=1e-13)
        # What is wrong on one process is said on all.
        wrong(lambda: solver.factorize(mine.data[:-1] if rank == 1 else mine.data), "values of shape" if rank == 1 else "rank 1")
        wrong(lambda: solver.factorize(mine if rank == 1 else mine.data), "values alone")
        bad = mine.data.copy()
        bad[0] = np.nan if rank == 0 else bad[0]
        wrong(lambda: solver.factorize(bad))
        wrong(lambda: solver.analyze(mine if rank else mine.astype("longdouble")), "dtype" if rank == 0 else "rank 0")
        wrong(lambda: solver.analyze(mine[:-1]), "give first_row")
        wrong(lambda: solver.solve(b[:, 0]), "no factorization")
        # Rows that overlap are summed; another pattern is analyzed by itself.
        half = (0.5 * whole).tocsr()
        part = half if rank < 2 else half[:0]
        solver.factorize(part, first_row=0)
        solver.set_rows(begin, end - begin)
        assert np.array_equal(solver.solve(b[begin:end]), x[begin:end])
        # Entries that are sorted in place make another order of the values, which is noticed.
        turned = whole[begin:end].copy()
        for r in range(end - begin):
            row = slice(turned.indptr[r], turned.indptr[r + 1])
            turned.indices[row], turned.data[row] = turned.indices[row][::-1].copy(), turned.data[row][::-1].copy()
        turned.has_sorted_indices = False
        solver.factorize(turned)
        turned.sort_indices()
        solver.factorize(turned)
        assert np.array_equal(solver.solve(b[begin:end]), x[begin:end])
        # A pattern by three arrays, and one triangle.
        lower = sp.csr_array(sp.tril(whole + whole.T))[begin:end]
    with espalier.mpi.Solver(comm, symmetry="lower", device="cpu", threads=1, patience=20, nodes="process") as solver:
        solver.analyze((lower.indptr, lower.indices, None), n=n)
        solver.factorize(lower.data)
        z = solver.solve(b[begin:end])
        gathered = np.vstack(comm.allgather(z))
        assert np.allclose((whole + whole.T) @ gathered, b, rtol=1e-10, atol=1e-12)
    # Complex numbers, of any storage. Where one process has real ones, they are complex all the same.
    skew = sp.csr_array(whole * (1 + 0.3j) + 2j * sp.eye_array(n))
    c = b + 1j * b[:, ::-1]
    for symmetry, matrix, alone_kind in (
            ("general", skew, {"kind": "lu"}), ("lower", sp.csr_array(sp.tril(skew + skew.T)), {}),
            ("hermitian_lower", sp.csr_array(sp.tril(skew + skew.conj().T)), {}), ("hermitian", skew + skew.conj().T, {})):
        one = espalier.Solver(sp.csc_array(matrix), symmetry=symmetry, device="cpu", threads=1, **alone_kind)
        with espalier.mpi.Solver(comm, symmetry=symmetry, device="cpu", threads=1, patience=20, **alone_kind) as solver:
            analysis = solver.analyze(matrix[begin:end])
            factor = solver.factorize(matrix[begin:end])
            assert factor.determinant_log == one.factor.determinant_log
            assert factor.determinant_sign == one.factor.determinant_sign
            assert factor.inertia == one.factor.inertia
            for transpose in (False, True, "H"):
                z = solver.solve(c[begin:end], transpose=transpose)
                assert z.dtype == np.complex128 and np.array_equal(z, one.solve(c, transpose=transpose)[begin:end]), symmetry
            assert np.array_equal(solver.solve(b[begin:end, 0]), one.solve(b[:, 0])[begin:end])
            # The file of process 0, which is that of one process.
            path = sys.argv[1] + "/analysis"
            solver.save_analysis(path)
            again = espalier.Solver(symmetry=symmetry, device="cpu", threads=1, **alone_kind)
            assert again.load_analysis(path, sp.csc_array(matrix)).nonzeros_factor == analysis.nonzeros_factor
            assert solver.load_analysis(path, matrix[begin:end]).nonzeros_factor == analysis.nonzeros_factor
            solver.factorize(matrix[begin:end])
            assert np.array_equal(solver.solve(c[begin:end]), one.solve(c)[begin:end])
            wrong(lambda: solver.load_analysis(path + "_not_there" if rank == 1 else path, matrix[begin:end]), "_not_there")
            wrong(lambda: solver.save_analysis(path), "no analysis")
    with espalier.mpi.Solver(comm, kind="lu", device="cpu", threads=1, patience=20) as solver:
        wrong(lambda: solver.save_analysis("nowhere"), "no analysis")
        some = whole.astype(complex)
        some.data[-1] += 1j  # on the last process
        one = espalier.Solver(sp.csc_array(some), symmetry="general", kind="lu", device="cpu", threads=1)
        mine = some[begin:end] if rank == 2 else whole[begin:end]
        solver.factorize(mine)
        assert np.array_equal(solver.solve(b[begin:end]), one.solve(b)[begin:end])
        solver.factorize(whole[begin:end])  # real: analyzed anew
        z = solver.solve(c[begin:end] if rank == 0 else b[begin:end])  # of a real matrix, complex on one process
        first = (np.arange(n) < n // 3)[:, None]
        assert z.dtype == np.complex128 and np.array_equal(z, alone.solve(np.where(first, c, b))[begin:end])
        solver.factorize(mine.data)  # complex values of the pattern
        assert np.array_equal(solver.solve(b[begin:end]), one.solve(b)[begin:end])
        wrong(lambda: solver.solve(b[begin:end], transpose="H" if rank == 1 else False), "another transpose")
        wrong(lambda: solver.solve(b[begin:end], transpose="C"), "'C'")
    wrong(lambda: espalier.mpi.Solver(comm, nodes="cloud"), "cloud")
    wrong(lambda: espalier.mpi.Solver(comm, kind="qr" if rank == 2 else "lu"), "qr")
    ended = comm.gather(rank)  # one process prints: mpirun mixes what several do
    if rank == 0:
        print("done", ended)
''')


def test_three_processes_have_the_bits_of_one(tmp_path):
    launcher = shutil.which("mpirun.openmpi") or shutil.which("mpirun")
    if launcher is None:
        pytest.skip("there is no mpirun")
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                       OMPI_MCA_rmaps_base_oversubscribe="1", OMPI_MCA_hwloc_base_binding_policy="none",
                       OMPI_MCA_btl_vader_single_copy_mechanism="none", OPENBLAS_NUM_THREADS="1")
    done = subprocess.run([launcher, "-n", "3", sys.executable, str(program), str(tmp_path)], env=environment, capture_output=True, text=True,
                          timeout=100, check=False)
    if done.returncode == 77:
        pytest.skip("mpi4py or the adapter for its MPI is not there")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout == "done [0, 1, 2]\n"
