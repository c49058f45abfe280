# SPDX-License-Identifier: Apache-2.0
"""Thermal mesh: heat conduction in hexahedra with SIMP densities and sources, by Espalier.

K(rho) T = f + s(source), k(rho) = k_min + (k_max - k_min) rho^p_exp, k_min = k_max / 1000; densities beyond [0, 1] count as its ends.
Outputs: thermal_compliance, f^T T with the load f of the surface alone, and identification_error, |T - target|^2.
Gradients by one more solution with the same factor: K a = c_1 f + 2 c_2 (T - target) for cotangents c_1, c_2.
"""

from typing import Any

import numpy as np
from mosaic_shared.problems.thermal_mesh import InputSchema as _CanonicalInputSchema
from mosaic_shared.problems.thermal_mesh import OutputSchema as _CanonicalOutputSchema
from mosaic_shared.schema_types import make_differentiable
from mosaic_shared.utils.hex8_simp import Hex8Inputs
from pydantic import Field
from tesseract_core.runtime import ShapeDType

_K_MIN_RATIO = 1e-3
_OUTPUTS = {"thermal_compliance", "identification_error"}


class InputSchema(make_differentiable(_CanonicalInputSchema, ["rho", "source"])):
    """The canonical inputs, with material parameters."""

    k_max: float = Field(default=1.0, gt=0, description="Conductivity where rho is 1.")
    p_exp: float = Field(default=3.0, ge=1, description="Exponent of SIMP.")


class OutputSchema(make_differentiable(_CanonicalOutputSchema, sorted(_OUTPUTS))):
    """The canonical outputs."""


class _Answer:
    def __init__(self, inputs: dict):
        self.problem = Hex8Inputs(inputs, lambda: None, "heat")
        self.inputs, count = inputs, self.problem.cell_count
        self.rho = np.asarray(inputs["rho"], dtype=float)
        source = np.zeros(count)
        given = np.asarray(inputs["source"], dtype=float)[:count]
        source[: len(given)] = given
        self.low, self.range = _K_MIN_RATIO * inputs["k_max"], (1 - _K_MIN_RATIO) * inputs["k_max"]
        model = self.problem.model
        self.clipped = np.clip(self.rho[:count], 0, 1)
        model.factorize(self.low + self.range * self.clipped ** inputs["p_exp"])
        self.temperature = model.solve(self.problem.load + model.source_load(source), self.problem.prescribed)
        self.off = np.zeros(len(self.temperature))
        target = np.asarray(inputs["target_temperature"], dtype=float)
        n = min(len(target), len(self.off))
        self.off[:n] = self.temperature[:n] - target[:n]

    def outputs(self) -> dict[str, np.float32]:
        return {
            "thermal_compliance": np.float32(self.problem.load @ self.temperature),
            "identification_error": np.float32(self.off @ self.off),
        }

    def gradients(self, of_compliance: float, of_error: float) -> dict[str, np.ndarray]:
        """Of of_compliance * thermal_compliance + of_error * identification_error."""
        model, count, p = self.problem.model, self.problem.cell_count, self.inputs["p_exp"]
        adjoint = model.solve(of_compliance * self.problem.load + 2 * of_error * self.off)
        inside = (self.rho[:count] >= 0) & (self.rho[:count] <= 1)
        slope = np.where(inside, self.range * p * self.clipped ** (p - 1), 0.0)
        rho, source = np.zeros(len(self.rho)), np.zeros(len(np.asarray(self.inputs["source"])))
        rho[:count] = -slope * model.slopes(self.temperature, adjoint)
        by_source = (model.volumes * adjoint[model.cells]).sum(axis=1)
        source[:count] = by_source[: len(source)]
        return {"rho": rho, "source": source}


def apply(inputs: InputSchema) -> OutputSchema:
    """Compliance and error of a density field and its sources."""
    return OutputSchema(**_Answer(inputs.model_dump()).outputs())


def vector_jacobian_product(
    inputs: InputSchema, vjp_inputs: set[str], vjp_outputs: set[str], cotangent_vector: dict[str, Any]
) -> dict[str, Any]:
    """Cotangents of the outputs times their derivatives by rho and source."""
    assert vjp_inputs <= {"rho", "source"} and vjp_outputs <= _OUTPUTS
    weights = [
        float(np.asarray(cotangent_vector.get(name, 0.0))) if name in vjp_outputs else 0.0
        for name in ("thermal_compliance", "identification_error")
    ]
    found = _Answer(inputs.model_dump()).gradients(*weights)
    return {name: found[name].astype(np.float32) for name in vjp_inputs}


def jacobian_vector_product(
    inputs: InputSchema, jvp_inputs: set[str], jvp_outputs: set[str], tangent_vector: dict[str, Any]
) -> dict[str, Any]:
    """Derivatives of the outputs along a change of rho and source."""
    assert jvp_inputs <= {"rho", "source"} and jvp_outputs <= _OUTPUTS
    answer = _Answer(inputs.model_dump())
    weights = {"thermal_compliance": (1.0, 0.0), "identification_error": (0.0, 1.0)}
    found = {}
    for output in jvp_outputs:
        slopes = answer.gradients(*weights[output])
        found[output] = np.float32(
            sum(slopes[name] @ np.asarray(tangent_vector[name], dtype=float) for name in jvp_inputs)
        )
    return found


def abstract_eval(abstract_inputs: InputSchema) -> dict:
    """Shapes of the outputs."""
    return {name: ShapeDType(shape=(), dtype="float32") for name in _OUTPUTS}
