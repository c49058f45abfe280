"""A change of rank 32 around a factor: ours, CHOLMOD's updown (Debian: libcholmod3), MKL PARDISO's low-rank update (PyPI: mkl).

    python bench/active_set_peers.py [N [RANK [REPEATS]]]      Poisson's equation on N^3 nodes, default 30, 32, 5

RANK diagonal entries at random places become larger by the largest entry. Seconds of the update, of a solve with it, and of a factorization of the changed matrix;
errors are |b - M x| / (|M| |x| + |b|), formed here. What is not installed is left out.
"""

import ctypes
import sys
import time

import numpy as np
import scipy.sparse as sp


def poisson(n):
    line = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
    one = sp.eye(n)
    return (sp.kron(sp.kron(line, one), one) + sp.kron(sp.kron(one, line), one) + sp.kron(sp.kron(one, one), line)).tocsc()


def seconds(call):
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def ours(A, changes, b, column):
    import espalier
    solver = espalier.Solver(A)
    changed = espalier.ChangedSystem(solver, folding=False)
    changed.add_low_rank(column(changes[0]))
    changed.solve(b)  # takes the memory
    for places in changes:
        changed.reset()
        changed.add_low_rank(column(places))
        update, _ = seconds(changed.prepare)
        solve, x = seconds(lambda: changed.solve(b))
        u = column(places)
        fresh, _ = seconds(lambda: espalier.Solver.factorize(solver, (A + u @ u.T).tocsc()))
        solver.factorize(A)
        yield update, solve, fresh, x


class CholmodSparse(ctypes.Structure):
    _fields_ = [(n, ctypes.c_size_t) for n in ("nrow", "ncol", "nzmax")] + [(n, ctypes.c_void_p) for n in ("p", "i", "nz", "x", "z")] \
        + [(n, ctypes.c_int) for n in ("stype", "itype", "xtype", "dtype", "sorted", "packed")]


class CholmodDense(ctypes.Structure):
    _fields_ = [(n, ctypes.c_size_t) for n in ("nrow", "ncol", "nzmax", "d")] + [("x", ctypes.c_void_p), ("z", ctypes.c_void_p),
                                                                                 ("xtype", ctypes.c_int), ("dtype", ctypes.c_int)]


class CholmodFactor(ctypes.Structure):
    _fields_ = [("n", ctypes.c_size_t), ("minor", ctypes.c_size_t), ("Perm", ctypes.POINTER(ctypes.c_int32))]


def cholmod(A, changes, b, column):
    """The int32 interface of CHOLMOD 3 (SuiteSparse 5), whose structs stand above."""
    try:
        lib = ctypes.CDLL("libcholmod.so.3")
    except OSError as error:
        raise ImportError(error) from None
    common = ctypes.create_string_buffer(1 << 14)
    for name, kind in (("cholmod_analyze", CholmodFactor), ("cholmod_solve", CholmodDense)):
        getattr(lib, name).restype = ctypes.POINTER(kind)
    lib.cholmod_start(common)
    n = A.shape[0]

    def address(array):
        return array.ctypes.data_as(ctypes.c_void_p).value

    def view(m, stype):
        m.sort_indices()
        arrays = m.indptr.astype(np.int32), m.indices.astype(np.int32), m.data
        return CholmodSparse(m.shape[0], m.shape[1], m.nnz, address(arrays[0]), address(arrays[1]), None, address(arrays[2]), None, stype, 0, 1, 0, 1, 1), arrays

    lower, kept = view(sp.tril(A, format="csc"), -1)
    factor = lib.cholmod_analyze(ctypes.byref(lower), common)

    def factorize(m):
        if not lib.cholmod_factorize(ctypes.byref(m), factor, common):
            raise RuntimeError("cholmod_factorize failed")

    def solve():
        right = CholmodDense(n, 1, n, n, address(b), None, 1, 0)
        x = lib.cholmod_solve(0, factor, ctypes.byref(right), common)
        found = np.ctypeslib.as_array(ctypes.cast(x.contents.x, ctypes.POINTER(ctypes.c_double)), (n,)).copy()
        lib.cholmod_free_dense(ctypes.byref(x), common)
        return found

    factorize(lower)
    place = np.empty(n, dtype=np.int64)
    place[np.ctypeslib.as_array(factor.contents.Perm, (n,))] = np.arange(n)
    for places in changes:
        u = column(places)
        turned, kept_u = view(sp.csc_matrix((u.data, (place[u.indices], np.repeat(np.arange(u.shape[1]), np.diff(u.indptr)))), shape=u.shape), 0)
        whole, kept_w = view(sp.tril(A + u @ u.T, format="csc"), -1)
        again = lib.cholmod_analyze(ctypes.byref(whole), common)
        fresh, _ = seconds(lambda: lib.cholmod_factorize(ctypes.byref(whole), again, common))
        lib.cholmod_free_factor(ctypes.byref(again), common)
        # The first one turns the supernodes into columns, which stay.
        update, done = seconds(lambda: lib.cholmod_updown(1, ctypes.byref(turned), factor, common))
        if not done:
            raise RuntimeError("cholmod_updown failed")
        solved, x = seconds(solve)
        yield update, solved, fresh, x
        lib.cholmod_updown(0, ctypes.byref(turned), factor, common)
    lib.cholmod_free_factor(ctypes.byref(factor), common)


def pardiso(A, changes, b, column):
    import glob
    import os
    prefix = sys.prefix + "/lib/libmkl_rt.so*"
    found = glob.glob(prefix) + glob.glob(os.environ.get("MKLROOT", "/none") + "/lib/libmkl_rt.so*")
    if not found:
        raise ImportError("libmkl_rt is not in " + prefix)
    mkl = ctypes.CDLL(found[0])
    upper = sp.triu(A, format="csr")
    upper.sort_indices()
    n, handle, iparm = A.shape[0], (ctypes.c_int64 * 64)(), np.zeros(64, dtype=np.int32)
    ia, ja = upper.indptr.astype(np.int32) + 1, upper.indices.astype(np.int32) + 1
    iparm[[0, 1, 9, 17, 23, 34, 38]] = [1, 2, 8, -1, 10, 0, 0]
    diagonal = upper.indptr[:-1]
    x = np.empty_like(b)

    def call(phase, values, perm):
        numbers = [ctypes.c_int(v) for v in (1, 1, 2, phase, n)]
        maxfct, mnum, mtype, the_phase, size = (ctypes.byref(v) for v in numbers)
        one, quiet, error = ctypes.c_int(1), ctypes.c_int(0), ctypes.c_int(0)
        mkl.pardiso(handle, maxfct, mnum, mtype, the_phase, size, values.ctypes.data_as(ctypes.c_void_p), ia.ctypes.data_as(ctypes.c_void_p),
                    ja.ctypes.data_as(ctypes.c_void_p), perm.ctypes.data_as(ctypes.c_void_p), ctypes.byref(one), iparm.ctypes.data_as(ctypes.c_void_p),
                    ctypes.byref(quiet), b.ctypes.data_as(ctypes.c_void_p), x.ctypes.data_as(ctypes.c_void_p), ctypes.byref(error))
        if error.value:
            raise RuntimeError(f"pardiso: {error.value} in phase {phase}")

    none = np.zeros(n, dtype=np.int32)
    call(11, upper.data, none)
    for places in changes:
        iparm[38] = 0
        call(22, upper.data, none)
        values = upper.data.copy()
        values[diagonal[places]] += np.abs(A.data).max()
        perm = np.zeros(max(n, 2 * len(places) + 1), dtype=np.int32)
        perm[0] = len(places)
        perm[1:2 * len(places) + 1] = np.repeat(places, 2)  # rows and columns, from 0
        iparm[38] = 1
        update, _ = seconds(lambda: call(22, values, perm))
        iparm[38] = 0
        solve, _ = seconds(lambda: call(33, values, none))
        solution = x.copy()
        fresh, _ = seconds(lambda: call(22, values, none))
        yield update, solve, fresh, solution
    call(-1, upper.data, none)


def main():
    sizes = [int(v) for v in sys.argv[1:]]
    n, rank, repeats = (sizes + [30, 32, 5][len(sizes):])[:3]
    A = poisson(n)
    rng = np.random.default_rng(1)
    changes = [np.sort(rng.choice(A.shape[0], rank, replace=False)) for _ in range(repeats)]
    b = rng.uniform(-1, 1, A.shape[0])
    scale = np.sqrt(np.abs(A.data).max())

    def column(places):
        return sp.csc_matrix((np.full(len(places), scale), (places, np.arange(len(places)))), shape=(A.shape[0], len(places)))

    print(f"Poisson {n}^3, {A.shape[0]} unknowns, rank {rank}")
    for peer in (ours, cholmod, pardiso):
        try:
            times, worst = [], 0.0
            for (update, solve, fresh, x), places in zip(peer(A, changes, b, column), changes):
                times.append((update, solve, fresh))
                u = column(places)
                M = (A + u @ u.T).tocsr()
                worst = max(worst, np.abs(b - M @ x).max() / (np.abs(M).sum(axis=1).max() * np.abs(x).max() + np.abs(b).max()))
            update, solve, fresh = np.median(times, axis=0)
            print(f"{peer.__name__:8s} update {1e3 * update:8.2f} ms, solve {1e3 * solve:8.2f} ms, factorization {1e3 * fresh:8.2f} ms, error {worst:.1e}", flush=True)
        except (ImportError, RuntimeError) as error:
            print(f"{peer.__name__:8s} not measured: {error}")


if __name__ == "__main__":
    main()
