"""Models: trees of keys and values, made by calls, dictionaries or texts."""

import json
import os
import re
import shutil
from typing import TYPE_CHECKING, Any, Callable, Iterable, Mapping

from .. import _checks, _core
from .._errors import InvalidInputError, make_error
from .._pictures.page import Shown
from .parts import Parts
from .._progress import Asked, watching
from .result import Result
from .toml import _key, _value, toml_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from typing_extensions import Unpack

    from .fmu import Fmu
    from .._pencils.harmonic import ModelHarmonic
    from .._options import DerivativeOptions, GradientOptions, RunOptions, Sections, SolverOptions
    from .reduced import ReducedBody
    from .parts import HarmonicKeys, Initial, Integrator, Numbers, Output, Statics, Vector
    from .sensitivities import Derivatives
    from .simulation import Observer

_CALLS = {"bodies": "body", "joints": "joint", "forces": "force", "supports": "support", "equations": "equation", "ties": "tie", "surfaces": "surface", "contacts": "contact",
          "materials": "material", "markers": "marker", "splines": "spline", "events": "event",
          "controllers": "controller", "sensors": "sensor", "inputs": "input"}


_EXPRESSIONS = ("parameters", "sensors", "inputs", "set")  # tables whose keys are names of the user's


def _moved(tree: Any, before: str, after: str) -> Any:
    """A copy whose files, keys `file`, are the same seen from another folder."""
    if isinstance(tree, Mapping):
        return {k: os.path.relpath(os.path.join(before, v), after) if k == "file" and isinstance(v, (str, os.PathLike))
                and not os.path.isabs(v) else v if k in _EXPRESSIONS else _moved(v, before, after) for k, v in tree.items()}
    return [_moved(v, before, after) for v in tree] if isinstance(tree, list) else tree


class Model(Parts):
    """A model as a tree of keys and values, those of docs/guide/simulate.md.

    Model.load(path) and Model.from_text(text) read one; Model(dictionary) takes the same keys from Python; body(), joint()
    and so on add named parts, and check them at once: keys, kinds and ranges. What a part refers to is looked for by
    check(), or when something is run. Every model can be changed, and saved by save(path).
    """

    def __init__(self, tree: "Mapping[str, Any] | None" = None, *, title: "str | None" = None, units: "str | None" = None,
                 gravity: "Vector | None" = None,
                 parameters: "Mapping[str, float | str] | None" = None, integrator: "Integrator | None" = None,
                 statics: "Statics | None" = None, initial: "Initial | None" = None, harmonic: "HarmonicKeys | None" = None,
                 output: "Output | None" = None, solver: "SolverOptions | None" = None, **sections: "Unpack[Sections]") -> None:
        """tree: all of a model. The others are keys at its top, instead of those of the tree; sections: bodies={...} and the
        like, as a tree has them."""
        if isinstance(tree, (str, os.PathLike)):
            raise TypeError(f"tree is {tree!r}; it must be a dictionary. Model.load(path) reads a file, Model.from_text(text) a text")
        given = {"title": title, "units": units, "gravity": gravity, "parameters": parameters, "integrator": integrator, "statics": statics,
                 "initial": initial, "harmonic": harmonic, "output": output, "solver": solver, **sections}
        known = next(keys for section, _, keys in _core.model_part_keys() if not section)
        for key in sections:
            if key not in known:
                raise TypeError(f"Model(): there is no argument {key!r}{_checks.near(key, known)}")
        self._tree: "dict[str, Any] | None" = {**_checks.mapping(tree, "tree"), **{k: v for k, v in given.items() if v is not None}}
        self._name = "model"  # of the text in messages; its folder is where files are
        self._text: "str | None" = None  # that was read, with its tree as JSON, and as TOML since somebody has looked at it
        self._json = self._written = ""
        self.notices: "list[str]" = []  # what the reader of a robot passed over

    @classmethod
    def load(cls, path: "str | os.PathLike[str]") -> "Model":
        """Of a model file, which is read now; files that it names are looked for beside it. A deck (.inp, .bdf) is taken as it is."""
        path = _checks.path(path, "path")
        return cls._of(_core.read_text(path), path)

    @classmethod
    def from_text(cls, text: str) -> "Model":
        """Of a model text (TOML); files that it names are looked for in the current folder."""
        return cls._of(_checks.text(text, "text"), "model")

    @classmethod
    def from_urdf(cls, path: "str | os.PathLike[str]", *, free_base: bool = False, geometry: bool = True,
                  positions: "Mapping[str, float] | None" = None, velocities: "Mapping[str, float] | None" = None,
                  packages: "Mapping[str, str | os.PathLike[str]] | None" = None) -> "Model":
        """Of a robot of ROS (URDF). free_base: its root is let go; geometry: False reads no shapes; positions, velocities: of
        joints at the start, by name; packages: folders of package://NAME. What was passed over stands in notices (docs/guide/robots.md)."""
        return cls._robot(path, "", free_base, geometry, positions, velocities, packages)

    @classmethod
    def from_mjcf(cls, path: "str | os.PathLike[str]", *, keyframe: "str | int | None" = None, geometry: bool = True,
                  positions: "Mapping[str, float] | None" = None, velocities: "Mapping[str, float] | None" = None) -> "Model":
        """Of a robot of MuJoCo (MJCF). keyframe: name or number of the one that it begins with; geometry: False reads no shapes and
        makes no contacts; positions, velocities: of joints at the start, by name. What was passed over stands in notices (docs/guide/robots.md)."""
        return cls._robot(path, "" if keyframe is None else str(keyframe), False, geometry, positions, velocities, None)

    @classmethod
    def _robot(cls, path: Any, keyframe: str, free_base: bool, geometry: bool, positions: Any, velocities: Any, packages: Any) -> "Model":
        path = _checks.path(path, "path")
        numbers = [{k: _checks.real(v, f"{what}[{k!r}]") for k, v in _checks.mapping(given, what).items()}
                   for given, what in ((positions, "positions"), (velocities, "velocities"))]
        folders = {k: _checks.path(v, f"packages[{k!r}]") for k, v in _checks.mapping(packages, "packages").items()}
        text, notices = _core.robot_text(path, keyframe, _checks.flag(free_base, "free_base"), _checks.flag(geometry, "geometry"),
                                         *numbers, folders)
        model = cls._of(text, path)
        model.notices = notices
        return model

    @classmethod
    def _of(cls, text: str, name: str) -> "Model":
        model = cls()
        model._tree, model._name, model._text, model._json = None, name, text, _core.model_as_json(text, name)
        return model

    @property
    def tree(self) -> "dict[str, Any]":
        """The keys and values, to be looked at and changed."""
        if self._tree is None:
            self._tree = json.loads(self._json)
            self._written = toml_of(self._tree)
        return self._tree

    @tree.setter
    def tree(self, tree: "Mapping[str, Any]") -> None:
        self._tree = dict(_checks.mapping(tree, "tree"))

    @property
    def text(self) -> str:
        """As TOML; what was read and not changed stays as it was written."""
        if self._text is not None and self._tree is None:
            return self._text
        return self._as_read(toml_of(self.tree))

    def _as_read(self, written: str) -> str:
        return self._text if self._text is not None and written == self._written else written

    def save(self, path: "str | os.PathLike[str]") -> None:
        """Writes the model as a file. Paths of meshes and tables are written so that they lead to the same files from there.
        A model that was read and not changed keeps its comments, unless it names files and goes to another folder. What fails (a full disk) leaves a file that was
        there as it was."""
        path = _checks.path(path, "path")
        before, after = (os.path.dirname(os.path.abspath(p)) for p in (self._name, path))
        written = toml_of(self.tree if before == after else _moved(self.tree, before, after))
        path = os.path.realpath(path)
        part = f"{path}.{os.getpid()}.part"
        try:
            with open(part, "w", encoding="utf-8") as file:
                file.write(self._as_read(written))
            if os.path.exists(path):
                shutil.copymode(path, part)
            os.replace(part, path)
        finally:
            if os.path.exists(part):
                os.unlink(part)

    def check(self, *, set: "Mapping[str, Any] | None" = None) -> None:
        """Reads all of the model without assembling it: keys, kinds, ranges, names of parts. Raises InvalidInputError for what
        is wrong. Names of faces and of quantities are known when it is run."""
        self._raise(_core.check_model(self.text, self._name, _settings(set)))

    def _raise(self, status: "tuple[int, str, int]") -> None:
        """An error, without the lines of a text that nobody wrote."""
        code, message, row = status
        if code == 0:
            return
        message = message.replace("--set: harmonic.", "Model.harmonic(): ").replace("--set: harmonic: ", "Model.harmonic(): ").replace("--set: ", "set: ")
        if self._text is None or self.text != self._text:
            message = re.sub(rf"(^|: ){re.escape(self._name)}(:\d+)?: ", r"\1", re.sub(r" \(line \d+\)", "", message))
        raise make_error(code, message, row)

    def part(self, section: str, name: str, /, keys: Any) -> str:
        """Adds a part to a section by its name ("bodies"), as body() and the others do: for programs whose keys come from
        elsewhere. Returns the name."""
        call = f"Model.{_CALLS.get(section, section)}({name!r})"
        try:
            _checks.choice(section, "section", _CALLS)
            _checks.text(name, "the name")
            if isinstance(keys, Mapping):  # words of Python: from_, global_
                keys = {k.removesuffix("_"): v for k, v in _checks.mapping(keys, "keys").items() if v is not None}
            parts = dict(_checks.mapping(self.tree.get(section), section))
            if name in parts:
                raise ValueError(f"{section}.{name} is there already")
            self._check_part(section, name, keys)
        except (TypeError, ValueError) as error:
            if isinstance(error, InvalidInputError):
                raise
            raise type(error)(f"{call}: {error}") from None
        parts[name] = keys
        self.tree[section] = parts
        return name

    def _check_part(self, section: str, name: str, keys: Any) -> None:
        value = ("{" + ", ".join(f"{_key(k)} = {_value(v, k)}" for k, v in keys.items()) + "}" if isinstance(keys, Mapping)
                 else _value(keys, "value"))
        text = f"[{section}]\n{_key(name)} = {value}\n"
        text = toml_of({k: self.tree[k] for k in ("units", "parameters") if self.tree.get(k)}) + text
        code, message, row = _core.check_model_part(section, name, text, self._name)
        if code != 0:
            message = re.sub(r"^(\S+): unknown key", lambda m: f"unknown key {m[1]!r}", re.sub(rf"^{section}\.{re.escape(name)}(\.|: )", "", message))
            raise make_error(code, f"Model.{_CALLS.get(section, section)}({name!r}): {message}", row)

    def run(self, until: "float | None" = None, *, observer: "Observer | None" = None, progress: Asked = "auto",
            **options: "Unpack[RunOptions]") -> Result:
        """Simulation(model, until=until, **options).run(observer, progress). To go on after Ctrl-C, make the Simulation
        yourself."""
        from .simulation import Simulation

        return Simulation(self, until=until, **options).run(observer, progress=progress)

    def statics(self, *, linear: "bool | None" = None, load: "float | None" = None, tolerance: "float | None" = None,
                time: "float | None" = None, observer: "Observer | None" = None, progress: Asked = "auto",
                **options: "Unpack[RunOptions]") -> Result:
        """The equilibrium of the model, which needs no section for that: the run of [statics] in the place of [integrator].
        linear: small displacements, one solve; load: factor of the loads at the end (1); time: at which functions of time
        are taken; they stand instead of the same keys of [statics]. options: those of Simulation."""
        given = {"linear": linear, "load": load, "tolerance": tolerance, "time": time}
        keys = {**_checks.mapping(self.tree.get("statics"), "statics"), **{k: v for k, v in given.items() if v is not None}}
        initial = {k: v for k, v in _checks.mapping(self.tree.get("initial"), "initial").items() if k != "statics"}
        return self._with(statics=keys, integrator=None, initial=initial or None).run(observer=observer, progress=progress, **options)

    def _with(self, **sections: Any) -> "Model":
        """A copy with other sections; None: without it."""
        other = Model({k: v for k, v in {**self.tree, **sections}.items() if v is not None})
        other._name = self._name
        return other

    def modes(self, count: int = 6, *, set: "Mapping[str, Any] | None" = None, progress: Asked = "auto",
              **solver: "Unpack[SolverOptions]") -> "NDArray[np.void]":
        """Natural frequencies of the model, linearised about its start: at rest, in the equilibrium of [initial] statics or
        [statics], or about its steady motion. Nothing is run, and no section is needed. Returns a row for each mode, by
        rising modulus of the exponent, with the fields mode, frequency (cycles per unit of time), damping_ratio, growth, whirl and
        standing_frequency (docs/use/modes.md). set and solver: as for Simulation."""
        return self._modes("", [0.0], _checks.whole(count, "count", 1), set, progress, solver)

    def modes_over(self, number: str, values: "Iterable[float]", count: int = 0, *,
                   set: "Mapping[str, Any] | None" = None, progress: Asked = "auto",
                   **solver: "Unpack[SolverOptions]") -> "NDArray[np.void]":
        """modes() for each value of a number of the model. number: a path, "parameters.speed"; "initial.rotation.speed"
        makes a Campbell diagram, and changes the parameter that stands there, if one does. count: of modes; 0: as many
        as [initial] modes says, or 6. Returns a NumPy array with the fields value, mode, frequency, damping_ratio,
        growth, whirl and standing_frequency (docs/use/modes.md), a row for each mode. set and solver: as for Simulation.
        Raises what a Simulation raises. Nothing moves."""
        if not _checks.text(number, "number"):
            raise ValueError("number is empty; it must be a path, \"parameters.speed\"")
        return self._modes(number, _checks.reals(values, "values"), _checks.whole(count, "count"), set, progress, solver)

    def _modes(self, number: str, values: "list[float]", count: int, set: Any, progress: Asked, solver: Any) -> Any:
        import numpy as np

        names = ("value", "mode", "frequency", "damping_ratio", "growth", "whirl", "standing_frequency")
        options = _checks.options(solver)
        with watching(progress, "seeking modes"):
            status, rows, _ = _core.model_modes(self.text, self._name, number, values, count, _settings(set), options)
        self._raise(status)
        first = 0 if number else 1  # without the value that nobody gave
        return np.array([row[first:] for row in rows], dtype=[(n, np.int64 if n == "mode" else np.float64) for n in names[first:]])

    def reduce(self, body: str = "", *, interfaces: "Iterable[str]" = (), modes: "int | None" = None,
               frequency: "float | None" = None, first_node: int = 1, set: "Mapping[str, Any] | None" = None) -> "ReducedBody":
        """A flexible body as reduced matrices for other programs: an espalier.ReducedBody (docs/use/reduced_bodies.md).
        body may be left out where there is one alone. interfaces: markers, or frames of joints and forces as "hinge.b";
        none: all frames of joints and forces on it. modes: kept with the interfaces at rest (as `reduce` of the body says,
        or 20), or frequency: those below it, Hz. first_node: number of the first interface in files. set: as for
        Simulation. Raises what a Simulation raises."""
        from .reduced import reduce_body

        return reduce_body(self, body, interfaces, modes, frequency, first_node, _settings(set))

    def harmonic(self, *, loads: Any = None, quantities: "Iterable[str]" = (), frequencies: "Numbers | None" = None,
                 between: "tuple[float, float] | None" = None, points: "int | None" = None,
                 logarithmic: "bool | None" = None, tolerance: "float | None" = None,
                 loss_factor: "float | None" = None, max_solves: "int | None" = None, shapes_at: "Numbers | None" = None,
                 set: "Mapping[str, Any] | None" = None, out: "str | os.PathLike[str]" = "",
                 progress: Asked = "auto", **solver: "Unpack[SolverOptions]") -> "ModelHarmonic":
        """The frequency response of the model, linearised where it starts, in its equilibrium with [initial] statics or
        [statics]: an espalier.ModelHarmonic. What is given here stands instead of the same keys of its section
        [harmonic], which may be absent: loads, names of forces, motors or inputs, or a dictionary of load cases,
        {"turning": {"x": 1, "y": -1j}}, with real or complex amplitudes; quantities, names; frequencies, rising, or
        between, (lowest, highest), with points; the rest as for espalier.harmonic(). set, out and solver: as for
        Simulation. Nothing moves. Raises what a Simulation raises; warns with AccuracyWarning where some frequencies lie
        on a resonance without damping (NaN), or the tolerance was not reached."""
        from .._pencils.harmonic import model_harmonic

        low, high = (None, None) if between is None else _checks.interval(between, "between")
        keys = {"loads": loads, "quantities": _checks.texts(quantities, "quantities") or None,
                "frequencies": frequencies, "from": low, "to": high, "points": points, "logarithmic": logarithmic,
                "tolerance": tolerance, "loss_factor": loss_factor, "max_solves": max_solves, "shapes": shapes_at}
        return model_harmonic(self, {k: v for k, v in keys.items() if v is not None}, _checks.mapping(set, "set"),
                              _checks.path(out, "out"), progress, solver)

    def export_fmu(self, path: "str | os.PathLike[str]", *, version: int = 3, inputs: "Iterable[str]" = (),
                   outputs: "Iterable[str]" = (), parameters: "Iterable[str]" = (),
                   set: "Mapping[str, Any] | None" = None) -> "Fmu":
        """Writes the model as an FMU for other simulators (docs/guide/fmi.md): co-simulation, and model exchange where the
        model is an ordinary differential equation in minimal coordinates. It holds the model and its files, and needs no
        Python. path: ".fmu" is added where it is missing. version: of FMI, 2 or 3. inputs: of the model's [inputs] (all
        of them). outputs: quantities (those of [output]). parameters: names of [parameters], or paths of other numbers,
        "bodies.bob.mass" (all numbers of [parameters]). set: values to be replaced for good."""
        from .fmu import Fmu, FmuVariable

        status, written, size, variables, files, exchange, why_not = _core.export_fmu(
            self.text, self._name, _checks.path(path, "path"), _checks.whole(version, "version", 2, 3),
            _checks.texts(inputs, "inputs"), _checks.texts(outputs, "outputs"), _checks.texts(parameters, "parameters"),
            _settings(set))
        self._raise(status)
        return Fmu(written, size, tuple(FmuVariable(*v) for v in variables), tuple(files), exchange, why_not)

    def show(self, *, height: int = 640, until: "float | None" = None, **options: "Unpack[RunOptions]") -> Shown:
        """The assembled model before it runs, with its joints, as a page: in a notebook in the cell, else in a browser.
        options: those of Simulation."""
        from .simulation import Simulation

        options["out"] = ""
        return Simulation(self, until=until, **options).result().show(height=height)

    def derivatives(self, parameters: "Iterable[str] | Mapping[str, float]", **options: "Unpack[DerivativeOptions]") -> "Derivatives":
        """espalier.derivatives(model, parameters, **options): a run with the derivatives of its quantities."""
        from .sensitivities import derivatives

        return derivatives(self, parameters, **options)

    def gradient(self, quantity: "str | Callable[[Any, Any], tuple[float, Any]]", parameters: "Iterable[str] | Mapping[str, float]",
                 **options: "Unpack[GradientOptions]") -> "tuple[float, NDArray[np.float64]]":
        """A quantity at the end of a run and its gradient by parameters, (P,): what scipy.optimize.minimize takes with
        jac=True. options: those of espalier.derivatives(), set={path: value} among them. A function takes the place of
        the quantity where the number comes from the whole run: espalier.objective_gradient(model, function, ...)."""
        if callable(quantity):
            from .sensitivities import objective_gradient

            return objective_gradient(self, quantity, parameters, **options)
        options["quantities"] = [quantity]
        found = self.derivatives(parameters, **options)
        return found.value(quantity), found.gradient(quantity)

    def __repr__(self) -> str:
        counts = [f"{len(v)} {k}" for k, v in self.tree.items() if k in _CALLS and isinstance(v, Mapping)]
        title = self.tree.get("title") or (self._name if self._text is not None else "")
        return f"<espalier.Model{f' {title!r}' if title else ''}: {', '.join(counts) or 'empty'}>"


def _settings(given: "Mapping[str, Any] | None") -> "list[str]":
    """Values to be replaced, as the extension module takes them."""
    return [f"{k}={_value(v, k)}" for k, v in _checks.mapping(given, "set").items()]


def model_of(given: "Model | Mapping[str, Any] | str | os.PathLike[str]") -> Model:
    """A model, that of a dictionary, or that in a file."""
    if isinstance(given, Model):
        return given
    if isinstance(given, Mapping):
        return Model(given)
    return Model.load(_checks.path(given, "model"))
