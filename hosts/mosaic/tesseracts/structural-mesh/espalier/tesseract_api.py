# SPDX-License-Identifier: Apache-2.0
"""Structural mesh: compliance of a body of linear elastic hexahedra with SIMP densities, by Espalier.

C = f^T u with K(rho) u = f, E(rho) = E_min + (E_max - E_min) rho^penal. A load that does not depend on rho and supports
that are held make u its own adjoint: dC/drho_e = -E'(rho_e) u^T K_e u. Where supports move, a second solution
with the same factor is the adjoint.
"""

from typing import Any

import numpy as np
from mosaic_shared.problems.structural_mesh import InputSchema as _CanonicalInputSchema
from mosaic_shared.problems.structural_mesh import OutputSchema as _CanonicalOutputSchema
from mosaic_shared.schema_types import make_differentiable
from mosaic_shared.utils.hex8_simp import Hex8Inputs, isotropic
from pydantic import Field
from tesseract_core.runtime import ShapeDType


class InputSchema(make_differentiable(_CanonicalInputSchema, ["rho"])):
    """The canonical inputs, with material parameters."""

    E_max: float = Field(default=70000.0, gt=0, description="Young's modulus where rho is 1.")
    nu: float = Field(default=0.3, gt=-1, lt=0.5, description="Poisson's ratio.")
    xmin: float = Field(default=1e-3, gt=0, description="E_min / E_max.")
    penal: float = Field(default=3.0, ge=1, description="Exponent of SIMP.")


class OutputSchema(make_differentiable(_CanonicalOutputSchema, ["compliance"])):
    """The canonical outputs."""


class _Answer:
    def __init__(self, inputs: dict, with_gradient: bool):
        nu = inputs["nu"]
        problem = Hex8Inputs(inputs, lambda: isotropic(nu), ("elastic", nu))
        model = problem.model
        rho = np.asarray(inputs["rho"], dtype=float)
        active = rho[: problem.cell_count]
        low, range_ = inputs["xmin"] * inputs["E_max"], (1 - inputs["xmin"]) * inputs["E_max"]
        model.factorize(low + range_ * active ** inputs["penal"])
        u = model.solve(problem.load, problem.prescribed)
        self.compliance = float(problem.load @ u)
        if not with_gradient:
            return
        adjoint = model.solve(problem.load) if problem.prescribed.any() else u
        slope = range_ * inputs["penal"] * active ** (inputs["penal"] - 1)
        self.gradient = np.zeros(rho.shape)
        self.gradient[: problem.cell_count] = -slope * model.slopes(u, adjoint)


def apply(inputs: InputSchema) -> OutputSchema:
    """Compliance of a density field."""
    return OutputSchema(compliance=np.float32(_Answer(inputs.model_dump(), False).compliance))


def vector_jacobian_product(
    inputs: InputSchema, vjp_inputs: set[str], vjp_outputs: set[str], cotangent_vector: dict[str, Any]
) -> dict[str, Any]:
    """The cotangent of the compliance times its derivatives by rho."""
    assert vjp_inputs <= {"rho"} and vjp_outputs <= {"compliance"}
    weight = float(np.asarray(cotangent_vector.get("compliance", 0.0)))
    return {"rho": (weight * _Answer(inputs.model_dump(), True).gradient).astype(np.float32)} if vjp_inputs else {}


def jacobian_vector_product(
    inputs: InputSchema, jvp_inputs: set[str], jvp_outputs: set[str], tangent_vector: dict[str, Any]
) -> dict[str, Any]:
    """The derivative of the compliance along a change of rho."""
    assert jvp_inputs <= {"rho"} and jvp_outputs <= {"compliance"}
    change = np.asarray(tangent_vector["rho"], dtype=float)
    return {"compliance": np.float32(_Answer(inputs.model_dump(), True).gradient @ change)}


def abstract_eval(abstract_inputs: InputSchema) -> dict:
    """Shapes of the outputs."""
    return {"compliance": ShapeDType(shape=(), dtype="float32")}
