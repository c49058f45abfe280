"""`import espalier.ngsolve` makes the inverse "espalier" known to NGSolve: a.mat.Inverse(fes.FreeDofs(), inverse="espalier").

options: a dictionary of options for Solver (device, threads, ...), to be filled in before an inverse is made.
"""

from typing import Any

import ngsolve.la as la
import numpy as np

from ._linear.solver import Solver

options: "dict[str, Any]" = {}


class EspalierInverse(la.SparseFactorizationInterface):
    """One factorization of NGSolve; free dofs are taken by NGSolve, blocks are refused by it."""

    def _arrays(self) -> Any:
        if self.is_complex:
            raise TypeError("espalier takes real matrices; complex ones are not supported yet")
        values, columns, rows = (np.asarray(a.NumPy()) for a in self.GetInnerMatrix().CSR())
        return rows, columns, values

    def Analyze(self) -> None:
        """Called by NGSolve with the matrix."""
        symmetric = self.is_symmetric.is_true
        symmetry = "lower" if symmetric and self.is_symmetric_storage else "auto"
        self._solver = Solver(symmetry=symmetry, **options)
        self._solver.analyze(self._arrays())

    def Factor(self) -> None:
        """Called by NGSolve after Analyze(), and for new values."""
        self._solver.factorize(self._arrays()[2])

    def Solve(self, b: Any, sol: Any) -> None:
        """sol = A^-1 b."""
        self._apply(b, sol, False)

    def SolveTrans(self, b: Any, sol: Any) -> None:
        """sol = A^-T b."""
        self._apply(b, sol, True)

    def _apply(self, b: Any, sol: Any, transpose: bool) -> None:
        self._solver.solve(b.FV().NumPy(), out=sol.FV().NumPy(), transpose=transpose)


la.RegisterInverseType("espalier", EspalierInverse)
