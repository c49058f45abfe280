"""espalier.scipy against SciPy itself."""

import sys
import types

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.sparse.linalg import spsolve as taken

import espalier.scipy as es
from test_solver import matrix

KINDS = ["llt", "ldlt", "lu"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", ["csc", "csr", "coo"])
@pytest.mark.parametrize("dtype", ["f8", "f4", "i4"])
def test_spsolve(kind, form, dtype):
    a = matrix(40, kind).asformat(form).astype(dtype)
    if dtype == "i4":
        a = (a + 50 * sp.eye(40)).asformat(form).astype(dtype)
    rng = np.random.default_rng(0)
    for b in (rng.normal(size=40), rng.normal(size=(40, 1)), rng.normal(size=(40, 3)), rng.normal(size=40).astype("f4"),
              rng.normal(size=40) + 1j, sp.random(40, 5, 0.3, format="csc", random_state=1),
              sp.random(40, 5, 0.3, format="csr", random_state=1), np.arange(40)):
        ours = es.spsolve(a, b)
        theirs = spla.spsolve(a, b)
        assert type(ours) is type(theirs) and ours.shape == theirs.shape
        if sp.issparse(b):
            ours, theirs = ours.toarray(), theirs.toarray()
        single = ours.dtype in ("f4",) or theirs.dtype in ("f4",)
        assert ours == pytest.approx(theirs, rel=1e-3 if single else 1e-9, abs=1e-5 if single else 1e-11)
        if dtype != "i4":
            assert ours.dtype == theirs.dtype


@pytest.mark.parametrize("kind", KINDS)
def test_splu_and_factorized(kind):
    a = matrix(60, kind).tocsc()
    lu, theirs = es.splu(a, permc_spec="COLAMD", options={"SymmetricMode": True}), spla.splu(a)
    assert lu.shape == theirs.shape and lu.nnz > 60
    for b in (np.ones(60), np.ones((60, 2)), np.ones(60) * 1j):
        for trans in "NTH":
            assert lu.solve(b, trans) == pytest.approx(theirs.solve(b.astype("c16") if b.dtype == "c16" else b, trans)
                                                       if b.dtype != "c16" else 1j * theirs.solve(b.imag, trans))
    with pytest.raises(ValueError, match="trans"):
        lu.solve(np.ones(60), "X")
    assert es.factorized(a)(np.ones(60)) == pytest.approx(spla.factorized(a)(np.ones(60)))
    with pytest.raises(RuntimeError):
        es.splu(sp.csc_array((3, 3)))


def test_singular_as_scipy():
    a = sp.csc_array(np.ones((2, 2)))
    with pytest.warns(spla.MatrixRankWarning):
        assert np.isnan(es.spsolve(a, np.ones(2))).all()


@pytest.mark.parametrize("sigma, mode", [(0, "normal"), (3.7, "normal"), (0.5, "buckling"), (0.5, "cayley")])
@pytest.mark.parametrize("with_mass", [False, True])
def test_eigsh(sigma, mode, with_mass):
    a = matrix(120, "llt")
    m = matrix(120, "llt", seed=5) if with_mass else None
    w, v = es.eigsh(a, 5, m, sigma, mode=mode)
    truth = spla.eigsh(a.tocsc(), 5, None if m is None else m.tocsc(), sigma, mode=mode, return_eigenvectors=False)
    assert np.sort(w) == pytest.approx(np.sort(truth), rel=1e-9)
    right = v if m is None else m @ v
    assert abs(a @ v - right * w).max() < 1e-8


def test_eigs_and_eigsh_without_shift():
    a, m = matrix(80, "lu"), matrix(80, "llt")

    def upper(w):  # the last of four may be either of a conjugate pair, which are equally near
        return np.sort_complex(w.real + 1j * abs(w.imag))

    ours = upper(es.eigs(a, 4, sigma=1.0, return_eigenvectors=False))
    assert ours == pytest.approx(upper(spla.eigs(a.tocsc(), 4, sigma=1.0, return_eigenvectors=False)))
    assert es.eigsh(m, 3, m + sp.eye(80), return_eigenvectors=False) == pytest.approx(
        spla.eigsh(m, 3, (m + sp.eye(80)).tocsc(), return_eigenvectors=False))
    assert es.eigsh(m, 3, return_eigenvectors=False) == pytest.approx(spla.eigsh(m, 3, return_eigenvectors=False))
    operator = spla.aslinearoperator(m)
    assert es.eigsh(operator, 3, return_eigenvectors=False) == pytest.approx(
        es.eigsh(m, 3, return_eigenvectors=False))


def test_patch_reaches_scipy_and_modules_and_goes_away():
    user = types.ModuleType("a_program_that_cannot_be_changed")
    user.spsolve = user.another_name = taken
    sys.modules[user.__name__] = user
    original = spla.spsolve
    a, b = matrix(30, "lu").tocsc(), np.ones(30)
    try:
        with es.patch():
            assert spla.spsolve is not original and user.spsolve is spla.spsolve is user.another_name
            assert user.spsolve(a, b) == pytest.approx(original(a, b))
            assert isinstance(spla.splu(a), es._SuperLU)
            shifted = spla.eigsh(matrix(50, "llt"), 3, sigma=0, return_eigenvectors=False)
            z = a.astype(complex) + 1j * sp.eye(30)
            assert spla.spsolve(z.tocsc(), b) == pytest.approx(original(z.tocsc(), b))
            with pytest.raises(ZeroDivisionError), es.patch():
                1 / 0
            assert isinstance(spla.splu(a), es._SuperLU)
        assert spla.spsolve is original and user.spsolve is original and user.another_name is original
        assert shifted == pytest.approx(spla.eigsh(matrix(50, "llt").tocsc(), 3, sigma=0, return_eigenvectors=False))
    finally:
        del sys.modules[user.__name__]
