"""The options of calls that take many of them, with their types."""

import logging
from os import PathLike
from typing import Any, Callable, Iterable, Literal, Mapping, TypedDict


class SolverOptions(TypedDict, total=False):
    """Of the direct solver; the site's page on options says what each is for, with its values and its default."""

    kind: Literal["auto", "llt", "ldlt", "lu"]
    precision: Literal["fp64", "fp32", "mixed", "auto"]
    device: str
    device_memory: "int | str | list[int | str]"
    host_memory: "int | str"
    pinned_memory: "int | str"
    scratch: "str | PathLike[str]"
    machine: "str | PathLike[str]"
    threads: int
    max_block_size: int
    pivot_threshold: float
    perturbation: float
    singular: Literal["error", "report", "null_vectors"]
    zero_pivot: float
    analyze_values: bool
    rescale: 'Literal["off", "on", "equilibration"] | bool'
    matching: bool
    refinement_steps: int
    refinement_target: float
    required_backward_error: "float | str"
    partial_refactorization: bool
    record_timeline: bool


class MatrixOptions(SolverOptions, total=False):
    """Of a Solver."""

    symmetry: str
    log: "logging.Logger | None"
    permutation: Any
    progress: "bool | str | Callable[..., Any]"


class RunOptions(SolverOptions, total=False):
    """Of a Simulation, which says what each is, besides `until`; and those of its solver."""

    set: "Mapping[str, Any] | None"
    quantities: "Iterable[str]"
    out: "str | PathLike[str]"
    restart: "str | PathLike[str]"
    accept_changes: bool
    analyses: "str | PathLike[str]"
    frames: "float | None"
    page: bool


class SweepOptions(RunOptions, total=False):
    """Of the runs of a sweep."""

    until: "float | None"


class DerivativeOptions(SolverOptions, total=False):
    """Of derivatives()."""

    set: "Mapping[str, Any] | None"
    until: "float | None"
    quantities: "Iterable[str]"
    method: Literal["auto", "forward", "adjoint"]


class GradientOptions(SolverOptions, total=False):
    """Of Model.gradient()."""

    set: "Mapping[str, Any] | None"
    until: "float | None"
    quantities: "Iterable[str]"


class DaeOptions(TypedDict, total=False):
    """Of a Dae: tolerances, orders and steps, as espalier/dae.hpp has them."""

    relative: float
    absolute: float
    absolute_velocity: float
    test_velocity: bool
    max_order: int
    order: int
    step: float
    initial_step: float
    min_step: float
    max_step: float
    spectral_radius: float
    hht_alpha: float
    constraint_tolerance: float
    max_newton: int
    newton_tolerance: float
    allowed_position: float
    allowed_velocity: float


class Sections(TypedDict, total=False):
    """Of a Model: its named parts, as its tree has them."""

    bodies: "Mapping[str, Any]"
    markers: "Mapping[str, Any]"
    joints: "Mapping[str, Any]"
    forces: "Mapping[str, Any]"
    supports: "Mapping[str, Any]"
    equations: "Mapping[str, Any]"
    ties: "Mapping[str, Any]"
    surfaces: "Mapping[str, Any]"
    contacts: "Mapping[str, Any]"
    materials: "Mapping[str, Any]"
    splines: "Mapping[str, Any]"
    inputs: "Mapping[str, Any]"
    sensors: "Mapping[str, Any]"
    events: "Mapping[str, Any]"
    controllers: "Mapping[str, Any]"
    repeat: "Iterable[Mapping[str, Any]]"
