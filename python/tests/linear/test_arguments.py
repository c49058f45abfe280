"""Every argument of every public call, in turn replaced by what it cannot be: the call ends in an exception of Python's
kinds that says so in words, or takes the value; never in the words of C++, a crash or a hang. Objects go on afterwards.

Truth: the words in `FOREIGN` come from C++ and from slips inside the package alone."""

import math
import re
import typing
import warnings

import numpy as np
import pytest
import scipy.sparse as sp

import espalier as esp
from espalier._options import SolverOptions

N = 6
FOREIGN = re.compile(r"std::|bad_cast|incompatible function|Invoked with|nanobind|\barg0\b|_core|espalier::|Options::|object of type"
                     r"|has no attribute|unsupported operand|not subscriptable|positional argument|_numbers|bad_alloc|NoneType' object"
                     r"|not iterable|cannot be interpreted|cannot unpack|vector::|C long|0x[0-9a-f]{6}|object at")
KINDS = (TypeError, ValueError, ArithmeticError, MemoryError, KeyError, OSError, esp.Error, RuntimeError)
SLIPS = (OverflowError, ZeroDivisionError, FloatingPointError, RecursionError, NotImplementedError, UnicodeError)

WRONG = [-1, 0, 2**40, 2**70, -2**70, math.nan, math.inf, -math.inf, 1.5, -1.5, 10**400, True, "x", "", "3", b"x", None, 1j, [], [1], [None], ["x"],
         [2**70], [math.nan], [[1.0, 2.0], [3.0]], (), {}, {"x": 1}, {1: 2}, np.empty(0), np.ones((2, 3)), np.ones((N, N)), np.ones(N + 1),
         np.full(N, math.nan), np.array("x"), np.ones((2, 2, 2, 2)), np.array([None] * N), object(), print, sp.csc_array((N, N)), sp.csc_array((2, 3)),
         sp.eye_array(N + 1).tocsc(), "\0", "\udcff", np.float32("nan"), np.int64(-3), range(3)]


def string(n=N):
    return sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsc()


A, M, B = string(), sp.eye_array(N, format="csc"), np.ones(N)


def solver():
    return esp.Solver(A, threads=1)


def cart():
    model = esp.Model(integrator={"end": 0.1})
    model.body("cart", "point", mass=2)
    model.input("push", 0)
    model.force("push", "load", a={"body": "cart"}, force=["inputs.push", 0, 0])
    return model


def dae(**keys):
    return esp.Dae(**{"coordinates": 1, "mass": lambda q: np.eye(1), "force": lambda t, q, v: -q, **keys})


def started():
    d = dae()
    d.start(0, [1], [0])
    return d


OPTIONS = {"kind": "ldlt", "precision": "fp64", "threads": 1, "device": "cpu", "singular": "error", "refinement_steps": 2, "host_memory": 0,
           "device_memory": 0, "zero_pivot": 0.0, "pivot_threshold": 0.1, "max_block_size": 64}

# name -> (call, arguments that it takes, those that are not tried)
CALLS = {
    "Solver": (esp.Solver, {"A": A, "symmetry": "auto", "log": None, "permutation": range(N), "progress": False}),
    "Solver options": (esp.Solver, {"A": A, **OPTIONS}),
    "solve": (esp.solve, {"A": A, "b": B}),
    "Solver.analyze": (lambda A: solver().analyze(A), {"A": A}),
    "Solver.analyze_change": (lambda A: solver().analyze_change(A), {"A": A}),
    "Solver.factorize": (lambda A, stream: solver().factorize(A, stream=stream), {"A": A, "stream": None}),
    "Solver.solve": (lambda **k: solver().solve(**k), {"b": B, "out": None, "transpose": False, "stream": None}),
    "Solver.clone": (lambda threads: solver().clone(threads).factorize(A), {"threads": 1}),
    "Solver.save_analysis": (lambda path: solver().save_analysis(path), {"path": "/proc/none/a"}),
    "Solver.load_analysis": (lambda path, A: solver().load_analysis(path, A), {"path": "/proc/none/a", "A": A}),
    "SchurComplement": (esp.SchurComplement, {"A": A, "unknowns": [1], "symmetry": "auto", "log": None, "threads": 1}),
    "Schur.factorize": (lambda A: esp.SchurComplement(string(), [1]).factorize(A), {"A": A}),
    "Schur.condense": (lambda **k: esp.SchurComplement(A, [1]).condense(**k), {"b": B, "transpose": False}),
    "Schur.expand": (lambda **k: esp.SchurComplement(A, [1]).expand(**k), {"b": B, "xs": [1.0], "transpose": False}),
    "Schur.solve": (lambda **k: esp.SchurComplement(A, [1]).solve(**k), {"b": B, "transpose": False}),
    "ChangedSystem": (esp.ChangedSystem, {"solver": solver(), "folding": True}),
    "Changed.add": (lambda **k: esp.ChangedSystem(solver()).add(**k), {"columns": B, "rows": B, "corner": [[1.0]]}),
    "Changed.add_low_rank": (lambda **k: esp.ChangedSystem(solver()).add_low_rank(**k), {"U": B, "C": [[1.0]], "V": B}),
    "Changed.remove": (lambda **k: esp.ChangedSystem(solver()).remove(**k), {"unknowns": [1]}),
    "Changed.restore": (lambda **k: esp.ChangedSystem(solver()).restore(**k), {"unknowns": []}),
    "Changed.flip": (lambda **k: esp.ChangedSystem(solver()).flip(**k), {"unknowns": [1]}),
    "Changed.replace": (lambda **k: esp.ChangedSystem(solver()).replace(**k), {"unknowns": [1], "columns": B, "rows": B}),
    "Changed.solve": (lambda **k: esp.ChangedSystem(solver()).solve(**k), {"b": B}),
    "Batch": (esp.Batch, {"A": A, "symmetry": "auto", "log": None, "threads": 1}),
    "Batch.solve": (lambda **k: esp.Batch(A, threads=1).solve(**k), {"values": A.data[None], "b": B[None], "transpose": False, "check": True}),
    "solve_systems": (esp.solve_systems, {"systems": [(A, B)], "symmetry": "auto", "transpose": False, "check": True, "log": None, "threads": 1}),
    "modes": (esp.modes, {"K": A, "M": M, "count": 2, "below": 1e3, "shift": -1.0, "tolerance": 1e-10, "prove": True, "check_mass": True,
                          "block_size": 0, "basis_size": 0, "seed": 1, "symmetry": "auto", "log": None, "progress": False, "threads": 1}),
    "buckling_modes": (esp.buckling_modes, {"K": A, "Kg": M, "count": 2, "tolerance": 1e-10, "prove": True, "block_size": 0, "basis_size": 0,
                                            "seed": 1, "symmetry": "auto", "log": None, "progress": False, "threads": 1}),
    "quadratic_modes": (esp.quadratic_modes, {"K": A, "C": 0.01 * A, "M": M, "count": 2, "shift": -1.0, "tolerance": 1e-10, "basis_size": 0,
                                              "progress": False, "threads": 1}),
    "harmonic": (esp.harmonic, {"K": A, "M": M, "loads": B, "C": 0.01 * A, "frequencies": None, "between": (0.1, 0.2), "points": 3,
                                "logarithmic": False, "tolerance": 0.0, "max_solves": 100, "seek_resonances": True, "loss_factor": 0.01,
                                "observed": [1], "shapes_at": [0.1], "symmetry": "auto", "log": None, "progress": False, "threads": 1}),
    "harmonic at frequencies": (lambda frequencies: esp.harmonic(A, M, B, frequencies=frequencies), {"frequencies": [0.1, 0.2]}),
    "Dae": (dae, {"coordinates": 1, "constraints": 0, "mass": lambda q: np.eye(1), "force": lambda t, q, v: -q, "residual": None, "tangent": None,
                  "constraint": None, "constraint_jacobian": None, "constraint_rate": None, "constraint_gamma": None, "energy": None,
                  "constraint_names": (), "tangent_pattern": [(0, 0)], "constraint_pattern": (), "method": "bdf", "solver": None}),
    "Dae options": (lambda **k: dae(**k).start(0, [1], [0]),
                    {"relative": 1e-6, "absolute": 1e-6, "absolute_velocity": 1e-6, "test_velocity": True, "max_order": 3, "order": 2, "step": 0.01,
                     "initial_step": 0.01, "min_step": 1e-12, "max_step": 0.1, "spectral_radius": 0.5, "hht_alpha": -0.1, "constraint_tolerance": 1e-9,
                     "max_newton": 5, "newton_tolerance": 1e-3, "allowed_position": 1.0, "allowed_velocity": 1.0}),
    "Dae returns": (lambda **k: dae(**{n: (lambda *_, v=v: v) for n, v in k.items()}).start(0, [1], [0]),
                    {"mass": np.eye(1), "force": np.zeros(1), "tangent": np.eye(1), "energy": (0, 0)}),
    "Dae.start": (lambda **k: dae().start(**k), {"t": 0.0, "q": [1.0], "v": [0.0]}),
    "Dae.integrate": (lambda **k: started().integrate(**k), {"end": 0.01, "observer": lambda t: None}),
    "Simulation": (esp.Simulation, {"model": cart(), "set": None, "until": 0.1, "quantities": ["cart.position.x"], "out": "", "restart": "",
                                    "accept_changes": False, "analyses": "", "frames": 0.05, "threads": 1}),
    "Simulation.run": (lambda **k: esp.Simulation(cart()).run(**k), {"observer": lambda s: None, "progress": False}),
    "Simulation.step_to": (lambda **k: esp.Simulation(cart()).step_to(**k), {"t": 0.01, "observer": lambda s: None}),
    "Simulation.step": (lambda **k: esp.Simulation(cart()).step(**k), {"dt": 0.01}),
    "Simulation.value": (lambda **k: esp.Simulation(cart()).value(**k), {"quantity": "cart.position.x"}),
    "Simulation.set_input": (lambda **k: esp.Simulation(cart()).set_input(**k), {"name": "push", "value": 1.0}),
    "Simulation.restore": (lambda **k: esp.Simulation(cart()).restore(**k), {"state": b""}),
    "Model": (lambda tree: esp.Simulation(esp.Model(tree)), {"tree": cart().tree}),
    "Model.load": (lambda path: esp.Simulation(esp.Model.load(path)), {"path": "/proc/none/model.toml"}),
    "Model.from_text": (lambda text: esp.Simulation(esp.Model.from_text(text)), {"text": cart().text}),
    "Model.body": (lambda **k: esp.Simulation((lambda m: (m.body("b", **k), m)[1])(cart())), {"type": "point", "mass": 1.0, "position": [0, 0, 0]}),
    "Model.run": (cart().run, {"until": 0.1, "observer": None, "progress": False, "quantities": "cart.position.x"}),
    "Model.harmonic": (cart().harmonic, {"loads": "inputs.push", "quantities": "cart.position.x", "frequencies": None, "between": (1, 2), "points": 3,
                                         "logarithmic": False, "tolerance": None, "loss_factor": None, "max_solves": None, "shapes_at": None,
                                         "set": None, "out": "", "progress": False, "threads": 1}),
    "Model.modes_over": (cart().modes_over, {"number": "bodies.cart.mass", "values": [1.0, 2.0], "count": 1, "set": None, "progress": False, "threads": 1}),
    "derivatives": (esp.derivatives, {"model": cart(), "parameters": ["bodies.cart.mass"], "set": None, "until": 0.1,
                                      "quantities": ["cart.position.x"], "method": "auto", "threads": 1}),
    "objective_gradient": (esp.objective_gradient,
                           {"model": cart(), "objective": lambda t, v: (1.0, 0 * v), "parameters": ["bodies.cart.mass"], "set": None, "until": 0.1,
                            "quantities": ["cart.position.x"]}),
    "gradient": (cart().gradient, {"quantity": "cart.position.x", "parameters": ["bodies.cart.mass"]}),
    "sweep": (esp.sweep, {"model": cart(), "parameters": {"bodies.cart.mass": [1, 2]}, "workers": 1}),
}


def said(call, arguments):
    """The exception, if one came, and what is wrong with it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call(**arguments)
    except Exception as error:  # noqa: BLE001 (that is what is looked at)
        text = str(error)
        slip = not isinstance(error, KINDS) or isinstance(error, SLIPS) and not isinstance(error, ValueError)
        return error, (slip or not text.strip() or FOREIGN.search(text))
    return None, None


def shown(value):
    return re.sub(r"0x[0-9a-f]+", "", repr(value))[:60]


@pytest.mark.parametrize("name", CALLS)
def test_good_arguments_are_taken(name):
    call, good = CALLS[name]
    if not any(isinstance(v, str) and v.startswith("/proc/none") for v in good.values()) and name not in ("Simulation.restore", "Changed.restore"):
        error, _ = said(call, good)
        assert error is None, error


@pytest.mark.parametrize("name", CALLS)
def test_wrong_arguments_are_said_in_words(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # what is a path may be made
    call, good = CALLS[name]
    bad = []
    for argument in good:
        for value in WRONG:
            error, slip = said(call, {**good, argument: value})
            if slip:
                bad.append(f"{argument} = {shown(value)}: {type(error).__name__}: {str(error)[:160]}")
    assert not bad, "\n" + "\n".join(bad)


@pytest.mark.parametrize("option", ["kind", "precision", "singular", "rescale"])
def test_the_types_of_options_have_the_words_of_the_library(option):
    """Its message lists all of them."""
    kinds = typing.get_type_hints(SolverOptions)[option]
    typed = {w for kind in (kinds, *typing.get_args(kinds)) if typing.get_origin(kind) is typing.Literal for w in typing.get_args(kind)}
    with pytest.raises((ValueError, esp.InvalidInputError)) as caught:
        esp.Solver(**{option: "no such word"})
    assert set(re.findall(r"\w+", str(caught.value).split("; give ")[1])) - {"or"} == typed
