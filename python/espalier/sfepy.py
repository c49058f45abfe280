"""`import espalier.sfepy` makes the linear solver "ls.espalier" known to SfePy: in a problem description
solvers = {"ls": ("ls.espalier", {})}; keys of the dictionary are options of espalier.Solver."""

from typing import Any

from sfepy.base.base import Struct
from sfepy.solvers import register_solver
from sfepy.solvers.solvers import LinearSolver

from ._linear.solver import Solver


class EspalierSolver(LinearSolver):
    """SfePy's linear solver "ls.espalier"."""

    name = "ls.espalier"
    _parameters = [("*", "*", None, False, "Options of espalier.Solver.")]

    def __init__(self, conf: Any, method: Any = None, **kwargs: Any) -> None:
        LinearSolver.__init__(self, conf, **kwargs)
        known = {"name", "kind", "method", "i_max", "eps_a", "eps_r", "use_presolve", "is_linear"}
        options = {k: v for k, v in conf.to_dict().items() if k not in known} if isinstance(conf, Struct) else {}
        self._solver = Solver(**options)

    def __call__(self, rhs: Any, x0: Any = None, conf: Any = None, eps_a: Any = None, eps_r: Any = None, i_max: Any = None,
                 mtx: Any = None, status: Any = None, context: Any = None, **kwargs: Any) -> Any:
        self._solver.factorize(mtx if mtx is not None else self.mtx)
        return self._solver.solve(rhs)


register_solver(EspalierSolver)
