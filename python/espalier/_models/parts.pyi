"""Made by docs/site/model_parts.py --write from the calls in the read_*.cpp below src/dynamics/model; do not edit."""

from os import PathLike
from typing import Any, Iterator, Literal, Mapping, Protocol, SupportsIndex, TypedDict, TypeVar, overload

import numpy as np

_T_co = TypeVar("_T_co", covariant=True)

class Items(Protocol[_T_co]):
    """A list, a tuple, an array of NumPy or another sequence, but no text."""

    def __getitem__(self, index: SupportsIndex, /) -> _T_co: ...
    def __contains__(self, value: object, /) -> bool: ...
    def __iter__(self) -> Iterator[_T_co]: ...
    def __len__(self) -> int: ...

Number = float | str | np.floating[Any] | np.integer[Any]
"""A number, or a text: with a unit ("3 mm"), or an expression of parameters (of time, of quantities where the guide says so)."""
Whole = int | str | np.integer[Any]
Texts = str | Items[str]
Numbers = Items[Number]
Vector = Numbers | str
"""Three numbers: a list, a tuple, an array of shape (3,), or a text with a unit, "[1, 0, 0] mm"."""
Points = Items[Vector]
"""A list of points, or an array of shape (n, 3)."""


class Rotation(TypedDict, total=False):
    """Of axes: {axis, angle} in radians, or {quaternion} = [w, x, y, z].
    axis: list of three numbers
    angle: number [angle]
    quaternion: list of numbers
    """

    axis: Vector
    angle: Number
    quaternion: Numbers


class Material(TypedDict, total=False):
    """A material in line.
    law: one of st-venant-kirchhoff, neo-hookean, default st-venant-kirchhoff
    young: number > 0 [force/length^2]
    poisson: number, default 0
    density: number > 0 [mass/length^3]
    """

    law: Literal["st-venant-kirchhoff", "neo-hookean"]
    young: Number
    poisson: Number
    density: Number


class Mesh(TypedDict, total=False):
    """A mesh file, or a part that is meshed.
    file: text
    scale: number > 0, default 1
    part: one of block, connecting-rod, chain-link, crank, guide, bladed-rotor, spur-gear, tyre
    unknowns: number > 0, default 1e4
    element: one of hex8, hex20, default hex8
    take: list of texts
    step: whole number, default 0
    of: text
    lx: number > 0 [length], default 1
    ly: number > 0 [length], default 1
    lz: number > 0 [length], default 1
    length: number > 0 [length], default 0.150
    big_inner: number > 0 [length], default 0.024
    big_outer: number > 0 [length], default 0.034
    small_inner: number > 0 [length], default 0.011
    small_outer: number > 0 [length], default 0.018
    shank_big: number > 0 [length], default 0.030
    shank_small: number > 0 [length], default 0.022
    thickness: number > 0 [length], default 0.020
    pitch: number > 0 [length], default 0.040
    inner: number > 0 [length], default 0.006
    outer: number > 0 [length], default 0.012
    waist: number > 0 [length], default 0.014
    throw_radius: number > 0 [length], default 0.060
    journal_radius: number > 0 [length], default 0.022
    pin_radius: number > 0 [length], default 0.020
    web_big: number > 0 [length], default 0.032
    web_small: number > 0 [length], default 0.026
    web_neck: number > 0 [length], default 0.046
    journal_length: number > 0 [length], default 0.040
    web_thickness: number > 0 [length], default 0.018
    pin_length: number > 0 [length], default 0.024
    lead: number > 0 [length], default 0.1
    radius: number > 0 [length], default 0.15
    angle: number > 0 [angle], default 1.5707963267948966
    height: number > 0 [length], default 0.01
    width: number > 0 [length], default 0.02
    blades: whole number, default 12
    bore_radius: number > 0 [length], default 0.010
    shaft_radius: number > 0 [length], default 0.020
    disc_radius: number > 0 [length], default 0.080
    tip_radius: number > 0 [length], default 0.150
    shaft_length: number > 0 [length], default 0.400
    disc_thickness: number > 0 [length], default 0.020
    bearing_length: number > 0 [length], default 0.020
    disc_position: number > 0, default 0.5
    blade_fraction: number > 0, default 0.35
    blade_taper: number, default 0.4
    blade_twist: number [angle], default 0.6
    section_radius: number > 0 [length], default 0.10
    opening: number > 0 [angle], default 0.7
    sectors: whole number, default 8
    teeth: whole number, default 20
    module: number > 0 [length], default 0.002
    pressure_angle: number > 0 [angle], default 0.3490658503988659
    backlash: number [length], default 0
    tip_relief: number [length], default 0
    divisions: list of three numbers
    """

    file: str | PathLike[str]
    scale: Number
    part: Literal["block", "connecting-rod", "chain-link", "crank", "guide", "bladed-rotor", "spur-gear", "tyre"]
    unknowns: Number
    element: Literal["hex8", "hex20"]
    take: Texts
    step: Whole
    of: str
    lx: Number
    ly: Number
    lz: Number
    length: Number
    big_inner: Number
    big_outer: Number
    small_inner: Number
    small_outer: Number
    shank_big: Number
    shank_small: Number
    thickness: Number
    pitch: Number
    inner: Number
    outer: Number
    waist: Number
    throw_radius: Number
    journal_radius: Number
    pin_radius: Number
    web_big: Number
    web_small: Number
    web_neck: Number
    journal_length: Number
    web_thickness: Number
    pin_length: Number
    lead: Number
    radius: Number
    angle: Number
    height: Number
    width: Number
    blades: Whole
    bore_radius: Number
    shaft_radius: Number
    disc_radius: Number
    tip_radius: Number
    shaft_length: Number
    disc_thickness: Number
    bearing_length: Number
    disc_position: Number
    blade_fraction: Number
    blade_taper: Number
    blade_twist: Number
    section_radius: Number
    opening: Number
    sectors: Whole
    teeth: Whole
    module: Number
    pressure_angle: Number
    backlash: Number
    tip_relief: Number
    divisions: Vector


class Damping(TypedDict, total=False):
    """Of a flexible body.
    mass: number [1/time], default 0. alpha and beta of Rayleigh's damping
    stiffness: number [time], default 0. alpha and beta of Rayleigh's damping
    ratio: number, default 0. of critical damping, in each mode of the model as it is supported
    frequencies: list of numbers [1/time]. two; then ratio (or a list of two) is that at these, by Rayleigh's damping
    loss_factor: number, default 0. eta of structural damping, in frequency responses and modes
    frequency: number > 0 [1/time]. where motions in time have viscous damping in the place of loss_factor
    """

    mass: Number
    stiffness: Number
    ratio: Number | Numbers
    frequencies: Numbers
    loss_factor: Number
    frequency: Number


class Erosion(TypedDict, total=False):
    """When elements of a solid fail.
    strain: number > 0. largest principal strain, logarithmic
    stress: number > 0 [force/length^2]. von Mises stress
    principal_stress: number > 0 [force/length^2]. largest principal stress
    """

    strain: Number
    stress: Number
    principal_stress: Number


class Reduction(TypedDict, total=False):
    """How a flexible body is reduced.
    modes: whole number, default 0. so many modes with the interfaces at rest are kept, beside the static shapes of
        the interfaces
    frequency: number > 0 [1/time]. only those below it, in cycles per unit of time
    damping: number, default 0. ratio of critical damping in the modes of the model, as damping = { ratio = ... } of
        the body (damping.md)
    """

    modes: Whole
    frequency: Number
    damping: Number


class MatrixFile(TypedDict, total=False):
    """A matrix of a substructure.
    file: text
    name: text
    """

    file: str | PathLike[str]
    name: str


class Node(TypedDict, total=False):
    """Of a substructure.
    label: whole number, default 1. of a node: its number, for markers and labels of the matrices; 6 (displacement and
        rotation) or 3
    position: list of three numbers [length]
    components: whole number, default 0. of a node: its number, for markers and labels of the matrices; 6
        (displacement and rotation) or 3
    """

    label: Whole
    position: Vector
    components: Whole


class NodesFile(TypedDict, total=False):
    """A file with GRID cards.
    file: text
    """

    file: str | PathLike[str]


class Bore(TypedDict, total=False):
    """Outer faces on a cylinder.
    point: list of three numbers [length]. rigid: from the centre of mass in body axes; ground: global; face: where
        the frame is to be instead of the mean of the face's nodes (below)
    axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body (mesh)
        axes
    radius: number > 0 [length]
    length: number > 0 [length]
    """

    point: Vector
    axis: Vector
    radius: Number
    length: Number


Frame = TypedDict("Frame", {"same_as": str, "name": str, "body": str, "global": bool, "point": Vector, "axis": Vector, "x_axis": Vector, "rotation": Vector | Rotation, "attach": Literal["mean", "rigid"], "node": Whole, "near": Vector, "face": str, "nodes": str | Items[Whole], "weights": Numbers, "along": Numbers, "edge": Texts, "radius": Number, "bore": Bore, "most_nodes": Whole}, total=False)
"""A marker in line.
    same_as: text. another marker's name, instead of all the rest
    name: text
    body: text. a body's name, or ground
    global: true or false, default false. point and axes are global, in the initial state
    point: list of three numbers [length], default [0, 0, 0]. rigid: from the centre of mass in body axes; ground:
        global; face: where the frame is to be instead of the mean of the face's nodes (below)
    axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body (mesh)
        axes
    x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
    rotation: rotation [angle]. of the axes, instead of axis
    attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint. rigid:
        all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and rotation are
        held, and the face may bend and warp
    node: whole number, default 0. flexible: one node by its label in the mesh file; beams, cables, shells: counted
        from 1, -1 the last
    near: list of three numbers [length]. flexible: the node nearest to this place (mesh coordinates)
    face: text. solids: a face set, held as attach says
    nodes: a name or a list of labels. flexible: several nodes, a node set by its name (of a shell "all") or a list of
        labels as of node: [31, 90]. The frame is at their mean
    weights: list of numbers. of nodes as a list of labels: how much each of them counts in the mean, [1, 2.5]
    along: list of numbers. beams and cables made by dimensions: the node nearest to this share of the length, 0 at
        the start, 1 at the end; two shares, [0.2, 0.5], are in supports and ties the nodes between them, in loads per
        length all that lies between
    edge: list of texts. solids: the nodes that faces have in common, ["x0", "z1"]; shells: "x0", "x1", "y0", "y1"
        (where s or t is 0 or 1), or ["x0", "y1"], a corner
    radius: number > 0 [length]
    bore: {point, axis, radius, length}. solids: { point, axis, radius, length }, the outer faces on a cylinder (mesh
        coordinates), for meshes without face sets
    most_nodes: whole number, default 240. of means: larger face sets are thinned out evenly, to about so many nodes;
        0: never"""


class Displacements(TypedDict, total=False):
    """Of a support: numbers or functions of time.
    x: function of time [length]
    y: function of time [length]
    z: function of time [length]
    """

    x: Number
    y: Number
    z: Number


class Limits(TypedDict, total=False):
    """Of the coordinate of a joint.
    lower: number [angle or length]. one or both
    upper: number [angle or length]. one or both
    stiffness: number > 0 [force length/angle or force/length]. elastic force N(p) of a penetration p: p^2 k / (2 e)
        up to e, then k (p - e/2)
    smoothing: number > 0 [angle or length]. elastic force N(p) of a penetration p: p^2 k / (2 e) up to e, then k (p -
        e/2)
    damping: number [time/angle or time/length], default 0. a: the force is N(p) (1 + a p'), never pulling (Hunt and
        Crossley 1975)
    """

    lower: Number
    upper: Number
    stiffness: Number
    smoothing: Number
    damping: Number


class Friction(TypedDict, total=False):
    """Of a joint.
    coefficient: number >= 0, default 0. of sliding and of breaking away
    static: number >= 0. of sliding and of breaking away
    slip_speed: number > 0 [length/time]. where friction is 76 % developed
    stribeck_speed: number > 0 [length/time]. where static has fallen off
    preload: number >= 0 [force], default 0. a force that presses always
    radius: number > 0 [length], default 1. of the pin, of the thread
    bending_arm: number > 0 [length]. lever arms
    torsion_arm: number > 0 [length]. lever arms
    collar_radius: number >= 0 [length], default 0. lever arms
    viscous: number >= 0 [force length time/angle], default 0. force per speed, moment per angular speed
    angular_viscous: number >= 0 [force length time/angle], default 0. force per speed, moment per angular speed
    """

    coefficient: Number
    static: Number
    slip_speed: Number
    stribeck_speed: Number
    preload: Number
    radius: Number
    bending_arm: Number
    torsion_arm: Number
    collar_radius: Number
    viscous: Number
    angular_viscous: Number


class SteadyRotation(TypedDict, total=False):
    """Of the whole model at the start.
    axis: list of three numbers
    point: list of three numbers [length], default [0, 0, 0]
    speed: number [angle/time]
    bodies: list of texts
    """

    axis: Vector
    point: Vector
    speed: Number
    bodies: Texts


class Integrator(TypedDict, total=False):
    """A run over time.
    start: number, default 0. times
    steps: whole number, default 0. the run ends after so many accepted steps, if end has not come before
    end: number. times
    method: one of bdf, generalized-alpha, default bdf. bdf: BDF on the over-determined equations
    relative: number > 0, default 1e-6. largest error of one step: of a position or angle q, relative |q| + absolute
    absolute: number > 0, default 1e-8. largest error of one step: of a position or angle q, relative |q| + absolute
    absolute_velocity: number > 0. largest error of one step: of a position or angle q, relative |q| + absolute
    test_velocity: true or false, default true. v takes part in the error test
    max_order: whole number, default 5. 1 to 5
    order: whole number, default 0. constant step (no error test), constant order
    initial_step: number > 0
    max_step: number > 0, default any
    min_step: number > 0
    step: number > 0. constant step (no error test), constant order
    constraint_tolerance: number > 0, default 1e-10. of the positions
    max_newton: whole number, default 12. iterations
    newton_tolerance: number > 0, default 0.01. iterations
    refactor_rate: number > 0, default 0.25. a slower convergence rate, or a larger change of the step, asks for a new
        factor
    refactor_step: number > 0, default 0.3. a slower convergence rate, or a larger change of the step, asks for a new
        factor
    iteration: one of reduced, full-matched, full-tangent, full-boolean, default reduced. reduced, or the references
        full-matched, full-tangent, full-boolean (dense)
    spectral_radius: number, default 0.8
    hht_alpha: number
    tolerance: number > 0, default 1e-8
    """

    start: Number
    steps: Whole
    end: Number
    method: Literal["bdf", "generalized-alpha"]
    relative: Number
    absolute: Number
    absolute_velocity: Number
    test_velocity: bool
    max_order: Whole
    order: Whole
    initial_step: Number
    max_step: Number
    min_step: Number
    step: Number
    constraint_tolerance: Number
    max_newton: Whole
    newton_tolerance: Number
    refactor_rate: Number
    refactor_step: Number
    iteration: Literal["reduced", "full-matched", "full-tangent", "full-boolean"]
    spectral_radius: Number
    hht_alpha: Number
    tolerance: Number


class Statics(TypedDict, total=False):
    """An equilibrium.
    time: number, default 0. at which functions of time are taken (as part of [initial]: the start of the motion)
    linear: true or false, default false. true: small displacements, below
    load: number, default 1. load factor at the end
    tolerance: number > 0, default 1e-9. of what is out of balance, sqrt(sum r^2 / m), relative to the largest of
        loads and reactions so far (m: the masses that belong to the coordinates)
    first_step: number > 0, default 0.1. of the load factor, as parts of load
    largest_step: number > 0, default 0.25. of the load factor, as parts of load
    smallest_step: number > 0, default 1e-6. of the load factor, as parts of load
    max_steps: whole number, default 1000. steps of the path (or of the relaxation)
    max_iterations: whole number, default 25. steps of the path (or of the relaxation)
    max_factorizations: whole number, default 5000. of the whole search, with those of steps taken back
    pseudo_time: number > 0. first step of the relaxation in time
    path: one of automatic, load-steps, relaxation, default automatic. automatic: load steps
    """

    time: Number
    linear: bool
    load: Number
    tolerance: Number
    first_step: Number
    largest_step: Number
    smallest_step: Number
    max_steps: Whole
    max_iterations: Whole
    max_factorizations: Whole
    pseudo_time: Number
    path: Literal["automatic", "load-steps", "relaxation"]


class Initial(TypedDict, total=False):
    """How a run begins.
    rotation: {...}. { axis, point, speed, bodies }: bodies (default all) begin turning about an axis through point
        (default the origin) with speed in radians per unit of time, in addition to their own velocities
    statics: true or false, default false. true: begin at rest in static equilibrium
    velocities: one of exact, project, default exact. exact: velocities that stand in the text stay as they are, all
        others follow from the joints, and a notice says which
    position_tolerance: number > 0, default any. largest change of the given positions that joints may need
    velocity_tolerance: number > 0, default 1e-3. for that, relative to the largest
    modes: whole number, default 0. report so many natural frequencies of the linearised system, of any size, about
        rest or a steady motion, and write their shapes (modes.vtkhdf of --out): modes.md
    """

    rotation: SteadyRotation
    statics: bool | Statics
    velocities: Literal["exact", "project"]
    position_tolerance: Number
    velocity_tolerance: Number
    modes: Whole


HarmonicKeys = TypedDict("HarmonicKeys", {"frequencies": Numbers, "from": Number, "to": Number, "points": Whole, "logarithmic": bool, "tolerance": Number, "max_solves": Whole, "loss_factor": Number, "quantities": Texts, "shapes": Numbers, "phases": Whole, "loads": Texts | Mapping[str, Any]}, total=False)
"""A frequency response.
    frequencies: list of numbers. a list, rising, instead of these four
    from: number. lowest and highest frequency, in cycles per unit of time
    to: number > 0. lowest and highest frequency, in cycles per unit of time
    points: whole number. so many frequencies, at equal steps or (true) ratios
    logarithmic: true or false, default false. so many frequencies, at equal steps or (true) ratios
    tolerance: number, default 0. above 0 (1e-8 to 0.1): solve at chosen frequencies alone, and interpolate with about
        this relative error
    max_solves: whole number. most frequencies that are solved for a tolerance
    loss_factor: number. eta of structural damping: all stiffness, K (1 + i eta), beside that of bodies
    quantities: list of texts. whose responses are wanted (names)
    shapes: list of numbers. frequencies at which the deformed bodies are written
    phases: whole number, default 8. pictures of each shape, over a period
    loads: list of texts. names of forces, motors or inputs, each a load of its own with the amplitude 1"""


class Output(TypedDict, total=False):
    """What is kept and written.
    quantities: list of texts. columns of quantities.csv, and values in the summary
    envelopes: list of texts. quantities whose extremes over the run, with time and place, are in the summary
        (stresses.md)
    csv_interval: time, 0 or false, default 0. 0: every step; false: none
    vtu_interval: time, 0 or false, default false. of pictures, in either format: evenly spaced frames, whatever the
        steps, by cubic interpolation of places and velocities within the step; 0: every step
    format: one of vtkhdf, vtu, default vtkhdf. of pictures: "vtkhdf", one file results.vtkhdf with the quantities in
        it, or "vtu", a series of files that motion.pvd lists
    restart_interval: time, 0 or false, default false. of state.restart (also at the end, on Ctrl-C, SIGTERM or
        SIGHUP, and when a run fails)
    energies: true or false, default true. columns of energies and constraint violations
    constraints: true or false, default true. columns of energies and constraint violations
    reactions: true or false, default false. forces and moments of all joints and supports
    step_data: true or false, default false. step size, order, Newton iterations, factorizations, error
    exact_times: true or false, default false. steps end at output times (at most 1e9)
    page: true or false, default true. index.html, the page that shows the run (see.md); also --no-page
    paths: tables by name. values along lines through bodies (stresses.md)
    """

    quantities: Texts
    envelopes: Texts
    csv_interval: Number | bool
    vtu_interval: Number | bool
    format: Literal["vtkhdf", "vtu"]
    restart_interval: Number | bool
    energies: bool
    constraints: bool
    reactions: bool
    step_data: bool
    exact_times: bool
    page: bool
    paths: Mapping[str, Mapping[str, Any]]


class Parts:
    def part(self, section: str, name: str, /, keys: Any) -> str: ...
    @overload
    def body(
        self, name: str, /, type: Literal["rigid"] = ..., *, mass: Number = ..., inertia: Numbers | Points = ..., box:
        Vector = ..., mesh: Mesh = ..., density: Number = ..., position: Vector = ..., rotation: Vector | Rotation =
        ..., velocity: Vector = ..., angular_velocity: Vector = ..., gravity: Vector = ...
    ) -> str:
        """Adds [bodies.NAME], type "rigid", and returns the name.

        mass: number > 0 [mass]. > 0
        inertia: three numbers, or a 3 x 3 matrix [mass length^2]. about the centre of mass in body axes: [Jx, Jy, Jz]
            or a 3 x 3 matrix
        box: list of three numbers [length]. edge lengths for pictures (and inertia)
        mesh: {...}. { file = "part.stl", scale = 1e-3 }: a uniform solid inside a closed surface, .stl (text or
            binary), .obj, or the outer faces of a mesh file
        density: number > 0 [mass/length^3]. with mesh, instead of mass
        position: list of three numbers [length], default [0, 0, 0]. of the centre of mass
        rotation: rotation [angle]
        velocity: list of three numbers [length/time], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        gravity: list of three numbers [length/time^2]
        """
    @overload
    def body(
        self, name: str, /, type: Literal["point"], *, mass: Number, gravity: Vector = ..., position: Vector = ...,
        velocity: Vector = ...
    ) -> str:
        """Adds [bodies.NAME], type "point", and returns the name.

        gravity: list of three numbers [length/time^2]
        mass: number > 0 [mass], needed. > 0
        position: list of three numbers [length], default [0, 0, 0]. of the centre of mass
        velocity: list of three numbers [length/time], default [0, 0, 0]
        """
    @overload
    def body(
        self, name: str, /, type: Literal["solid"], *, mesh: Mesh, gravity: Vector = ..., position: Vector = ...,
        rotation: Vector | Rotation = ..., velocity: Vector = ..., angular_velocity: Vector = ..., damping: Damping =
        ..., reduce: Reduction = ..., element_set: str = ..., hex8: Literal["full", "mean-dilatation", "enhanced",
        "shell"] = ..., reduced_hex20: bool = ..., erosion: Erosion = ..., material: str | Material = ..., materials:
        Mapping[str, str | Material] = ...
    ) -> str:
        """Adds [bodies.NAME], type "solid", and returns the name.

        gravity: list of three numbers [length/time^2]
        position: list of three numbers [length], default [0, 0, 0]
        rotation: rotation [angle]
        velocity: list of three numbers [length/time], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        damping: {mass, stiffness, ratio, frequencies, loss_factor, frequency}. { ratio = 0.02 } (of each mode), {
            mass = alpha, stiffness = beta } (Rayleigh), { loss_factor = 0.04 } (structural): damping.md
        reduce: {...}. { modes = 20 } or { frequency = 5e3 }: the body keeps a few shapes instead of all its nodes
            (reduced bodies)
        mesh: {...}, needed. { file = "rod.inp", scale = 1e-3 }: a mesh of Abaqus, Gmsh, Nastran, Ansys, VTK, MEDIT or
            MFEM (below), also .gz
        element_set: text. only these elements of the mesh
        hex8: one of full, mean-dilatation, enhanced, shell, default enhanced. enhanced: bends exactly
        reduced_hex20: true or false, default false. 2 x 2 x 2 integration points
        erosion: {...}. { strain = 0.2 }: elements that pass a limit fail and are gone (elements that fail)
        material: a name of [materials] or {young, poisson, density, law}. a name of [materials] or a table
        materials: table. of element sets: { LINER = "brass", BODY = { young = 210e9, poisson = 0.3, density = 7850 }
            }. They go before those of the file
        """
    @overload
    def body(
        self, name: str, /, type: Literal["cable"], *, gravity: Vector = ..., position: Vector = ..., rotation: Vector
        | Rotation = ..., velocity: Vector = ..., angular_velocity: Vector = ..., damping: Damping = ..., reduce:
        Reduction = ..., mesh: Mesh = ..., radius: Number = ..., start: Vector = ..., end: Vector = ..., elements:
        Whole = ..., axial: Number = ..., bending: Number = ..., mass_per_length: Number = ..., element_set: str =
        ..., material: str | Material = ...
    ) -> str:
        """Adds [bodies.NAME], type "cable", and returns the name.

        gravity: list of three numbers [length/time^2]
        position: list of three numbers [length], default [0, 0, 0]
        rotation: rotation [angle]
        velocity: list of three numbers [length/time], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        damping: {mass, stiffness, ratio, frequencies, loss_factor, frequency}. { ratio = 0.02 } (of each mode), {
            mass = alpha, stiffness = beta } (Rayleigh), { loss_factor = 0.04 } (structural): damping.md
        reduce: {...}. { modes = 20 } or { frequency = 5e3 }: the body keeps a few shapes instead of all its nodes
            (reduced bodies)
        mesh: {...}
        radius: number > 0 [length]
        start: list of three numbers [length]
        end: list of three numbers [length]
        elements: whole number, default 10
        axial: number > 0 [force]
        bending: number [force length^2]
        mass_per_length: number > 0 [mass/length]
        element_set: text. only these elements of the mesh
        material: a name of [materials] or {young, poisson, density, law}. a name of [materials] or a table
        """
    @overload
    def body(
        self, name: str, /, type: Literal["beam"], *, gravity: Vector = ..., position: Vector = ..., rotation: Vector
        | Rotation = ..., velocity: Vector = ..., angular_velocity: Vector = ..., damping: Damping = ..., reduce:
        Reduction = ..., points: Points = ..., start: Vector = ..., end: Vector = ..., direction: Vector = ...,
        length: Number = ..., curvature: Vector = ..., mesh: Mesh = ..., y: Vector = ..., radius: Number = ...,
        height: Number = ..., width: Number = ..., elements: Whole = ..., axial: Number = ..., shear_y: Number = ...,
        shear_z: Number = ..., torsion: Number = ..., bending_y: Number = ..., bending_z: Number = ...,
        section_normal: Number = ..., section_shear: Number = ..., mass_per_length: Number = ..., inertia_y: Number =
        ..., inertia_z: Number = ..., element_set: str = ..., material: str | Material = ...
    ) -> str:
        """Adds [bodies.NAME], type "beam", and returns the name.

        gravity: list of three numbers [length/time^2]
        position: list of three numbers [length], default [0, 0, 0]
        rotation: rotation [angle]
        velocity: list of three numbers [length/time], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        damping: {mass, stiffness, ratio, frequencies, loss_factor, frequency}. { ratio = 0.02 } (of each mode), {
            mass = alpha, stiffness = beta } (Rayleigh), { loss_factor = 0.04 } (structural): damping.md
        reduce: {...}. { modes = 20 } or { frequency = 5e3 }: the body keeps a few shapes instead of all its nodes
            (reduced bodies)
        points: list of points [length]. the smooth curve through the points (a cubic spline)
        start: list of three numbers [length]. straight
        end: list of three numbers [length]. straight
        direction: list of three numbers. constant curvature in radians per length, about the axes of the section: an
            arc, a helix, a twisted straight beam
        length: number > 0 [length]. constant curvature in radians per length, about the axes of the section: an arc,
            a helix, a twisted straight beam
        curvature: list of three numbers [angle/length or 1/length]. constant curvature in radians per length, about
            the axes of the section: an arc, a helix, a twisted straight beam
        mesh: {...}
        y: list of three numbers
        radius: number > 0 [length]
        height: number > 0 [length]
        width: number > 0 [length]
        elements: whole number, default 10
        axial: number > 0 [force]. E A
        shear_y: number > 0 [force]. k G A
        shear_z: number > 0 [force]. k G A
        torsion: number > 0 [force length^2]. G J
        bending_y: number > 0 [force length^2]. E Iy
        bending_z: number > 0 [force length^2]. E Iz
        section_normal: number > 0 [force]
        section_shear: number > 0 [force]
        mass_per_length: number > 0 [mass/length]. rho A
        inertia_y: number > 0 [mass length]. rho Iz, rho Iy
        inertia_z: number > 0 [mass length]. rho Iz, rho Iy
        element_set: text. only these elements of the mesh
        material: a name of [materials] or {young, poisson, density, law}. a name of [materials] or a table
        """
    @overload
    def body(
        self, name: str, /, type: Literal["shell"], *, gravity: Vector = ..., position: Vector = ..., rotation: Vector
        | Rotation = ..., velocity: Vector = ..., angular_velocity: Vector = ..., damping: Damping = ..., reduce:
        Reduction = ..., mesh: Mesh = ..., origin: Vector = ..., x: Vector = ..., y: Vector = ..., curvature: Number =
        ..., nx: Whole = ..., ny: Whole = ..., offset: Number = ..., thickness: Number | Numbers = ..., element_set:
        str = ..., material: str | Material = ...
    ) -> str:
        """Adds [bodies.NAME], type "shell", and returns the name.

        gravity: list of three numbers [length/time^2]
        position: list of three numbers [length], default [0, 0, 0]
        rotation: rotation [angle]
        velocity: list of three numbers [length/time], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        damping: {mass, stiffness, ratio, frequencies, loss_factor, frequency}. { ratio = 0.02 } (of each mode), {
            mass = alpha, stiffness = beta } (Rayleigh), { loss_factor = 0.04 } (structural): damping.md
        reduce: {...}. { modes = 20 } or { frequency = 5e3 }: the body keeps a few shapes instead of all its nodes
            (reduced bodies)
        mesh: {...}
        origin: list of three numbers [length], default [0, 0, 0]
        x: list of three numbers [length]
        y: list of three numbers [length]
        curvature: number [1/length or angle/length], default 0
        nx: whole number, default 4
        ny: whole number, default 4
        offset: number [length], default 0
        thickness: number > 0 [length]
        element_set: text. only these elements of the mesh
        material: a name of [materials] or {young, poisson, density, law}. a name of [materials] or a table
        """
    @overload
    def body(
        self, name: str, /, type: Literal["substructure"], *, stiffness: MatrixFile, mass: MatrixFile, nodes:
        NodesFile | Items[Node], gravity: Vector = ..., position: Vector = ..., rotation: Vector | Rotation = ...,
        velocity: Vector = ..., angular_velocity: Vector = ..., damping: Damping = ..., reduce: Reduction = ...,
        lines: Numbers = ...
    ) -> str:
        """Adds [bodies.NAME], type "substructure", and returns the name.

        gravity: list of three numbers [length/time^2]
        position: list of three numbers [length], default [0, 0, 0]
        rotation: rotation [angle]
        velocity: list of three numbers [length/time], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        damping: {mass, stiffness, ratio, frequencies, loss_factor, frequency}. { ratio = 0.02 } (of each mode), {
            mass = alpha, stiffness = beta } (Rayleigh), { loss_factor = 0.04 } (structural): damping.md
        reduce: {...}. { modes = 20 } or { frequency = 5e3 }: the body keeps a few shapes instead of all its nodes
            (reduced bodies)
        stiffness: {file, name}, needed. { file = "arm.op4", name = "KAA" }, path from the model's folder
        mass: {file, name}, needed. { file = "arm.op4", name = "KAA" }, path from the model's folder
        nodes: list of {label, position, components}, or {file}, needed. [{ label = 1, position = [x, y, z],
            components = 6 }, ...], or { file = "arm.bdf" } with GRID cards
        lines: list of numbers. labels of nodes, two for each line in pictures
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["fixed"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "fixed", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["revolute"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ..., friction: Friction =
        ..., armature: Number = ...
    ) -> str:
        """Adds [joints.NAME], type "revolute", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        limits: {...}
        friction: {...}
        armature: number >= 0 [mass length^2], default 0. moment of inertia (prismatic: mass) of a rotor that moves
            with the joint's coordinate and is felt there alone: that of a motor times the square of its gear ratio
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["spherical"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "spherical", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["universal"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "universal", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["cylindrical"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts
        = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull:
        bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ..., angle_limits:
        Limits = ..., friction: Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "cylindrical", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        limits: {...}
        angle_limits: {...}
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["prismatic"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ..., friction: Friction =
        ..., armature: Number = ...
    ) -> str:
        """Adds [joints.NAME], type "prismatic", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        limits: {...}
        friction: {...}
        armature: number >= 0 [mass], default 0. moment of inertia (prismatic: mass) of a rotor that moves with the
            joint's coordinate and is felt there alone: that of a motor times the square of its gear ratio
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["planar"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "planar", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["point-on-line"], *, a: str | Frame = ..., b: str | Frame = ..., bodies:
        Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ...,
        pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ..., friction:
        Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "point-on-line", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        limits: {...}
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["distance"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., length: Number = ...
    ) -> str:
        """Adds [joints.NAME], type "distance", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        length: number, or "initial" [length]
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["revolute-spherical"], *, a: str | Frame = ..., b: str | Frame = ...,
        bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector =
        ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., length: Number = ...
    ) -> str:
        """Adds [joints.NAME], type "revolute-spherical", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        length: number, or "initial" [length]
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["rotation-motor"], *, motion: Number, a: str | Frame = ..., b: str | Frame =
        ..., bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis:
        Vector = ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., from_:
        Literal["zero", "initial"] = ...
    ) -> str:
        """Adds [joints.NAME], type "rotation-motor", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        motion: function of time [angle], needed
        from: one of zero, initial, default zero
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["translation-motor"], *, motion: Number, a: str | Frame = ..., b: str |
        Frame = ..., bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ...,
        x_axis: Vector = ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., from_:
        Literal["zero", "initial"] = ...
    ) -> str:
        """Adds [joints.NAME], type "translation-motor", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        motion: function of time [length], needed
        from: one of zero, initial, default zero
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["prescribed"], *, direction: Literal["x", "y", "z"], motion: Number, a: str
        | Frame = ..., b: str | Frame = ..., bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ...,
        axis: Vector = ..., x_axis: Vector = ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active:
        bool = ..., from_: Literal["zero", "initial"] = ...
    ) -> str:
        """Adds [joints.NAME], type "prescribed", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        direction: one of x, y, z, needed
        motion: function of time [length], needed
        from: one of zero, initial, default zero
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["rolling"], *, radius: Number, a: str | Frame = ..., b: str | Frame = ...,
        bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector =
        ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., shape: Literal["wheel",
        "ball"] = ..., rim: Number = ...
    ) -> str:
        """Adds [joints.NAME], type "rolling", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        shape: one of wheel, ball, default wheel
        radius: number > 0 [length], needed
        rim: number > 0 [length]
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["skate"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "skate", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["gear"], *, a: str | Frame, b: str | Frame, c: str | Frame, d: str | Frame,
        ratio: Number, pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "gear", and returns the name.

        a: a marker's name or a table, needed
        b: a marker's name or a table, needed
        c: a marker's name or a table, needed
        d: a marker's name or a table, needed
        ratio: number, needed
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["rack-and-pinion"], *, a: str | Frame, b: str | Frame, c: str | Frame, d:
        str | Frame, radius: Number, pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "rack-and-pinion", and returns the name.

        a: a marker's name or a table, needed
        b: a marker's name or a table, needed
        c: a marker's name or a table, needed
        d: a marker's name or a table, needed
        radius: number [length], needed
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["coupled-slides"], *, a: str | Frame, b: str | Frame, c: str | Frame, d: str
        | Frame, ratio: Number, pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "coupled-slides", and returns the name.

        a: a marker's name or a table, needed
        b: a marker's name or a table, needed
        c: a marker's name or a table, needed
        d: a marker's name or a table, needed
        ratio: number, needed
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["screw"], *, lead: Number, a: str | Frame = ..., b: str | Frame = ...,
        bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector =
        ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ...,
        angle_limits: Limits = ..., friction: Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "screw", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        lead: number [length], needed. way of the thread for a turn of the worm, positive for right-handed ones
        limits: {...}
        angle_limits: {...}
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["constant-velocity"], *, a: str | Frame = ..., b: str | Frame = ..., bodies:
        Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ...,
        pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ...
    ) -> str:
        """Adds [joints.NAME], type "constant-velocity", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        limits: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["parallel-axes"], *, a: str | Frame = ..., b: str | Frame = ..., bodies:
        Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ...,
        pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ..., friction:
        Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "parallel-axes", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        limits: {...}
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["in-plane"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., friction: Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "in-plane", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["in-line"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., limits: Limits = ..., friction: Friction =
        ...
    ) -> str:
        """Adds [joints.NAME], type "in-line", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        limits: {...}
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["point-on-curve"], *, a: str | Frame = ..., b: str | Frame = ..., bodies:
        Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ...,
        pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., points: Points = ..., file: str
        | PathLike[str] = ..., scale: Number = ..., closed: bool = ..., ends: Literal["limits", "straight"] = ...,
        motion: Number = ..., from_: Literal["zero", "initial"] = ..., limits: Limits = ..., friction: Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "point-on-curve", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        points: list of points [length]. of the curve, in the axes of frame a: a cubic spline goes through them, twice
            differentiable
        file: text. the same from a text file, x, y, z in each line
        scale: number > 0, default 1. the same from a text file, x, y, z in each line
        closed: true or false, default false. the curve goes on from its last point to its first (which may stand
            there again)
        ends: one of limits, straight, default limits. of an open curve: "limits" stop the point, or it goes on along
            the "straight" tangents
        motion: function of time [length]. leads the point: its way along the curve as a function of time
        from: one of zero, initial, default zero. leads the point: its way along the curve as a function of time
        limits: {...}
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["point-on-surface"], *, shape: Literal["sphere", "ellipsoid", "cylinder",
        "cone", "torus", "heights"], a: str | Frame = ..., b: str | Frame = ..., bodies: Texts = ..., at: Vector =
        ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool = ..., attach:
        Literal["mean", "rigid"] = ..., active: bool = ..., radius: Number = ..., rim: Number = ..., angle: Number =
        ..., half_axes: Vector = ..., x: Numbers = ..., y: Numbers = ..., heights: Items[Numbers] = ..., friction:
        Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "point-on-surface", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        shape: one of sphere, ellipsoid, cylinder, cone, torus, heights, needed. sphere, cylinder (about z), torus
            (about z): with radius, the torus with rim for its tube; cone (about z, open to it, its apex at the
            origin) with angle
        radius: number > 0 [length]. of sphere, cylinder, or of the circle in the tube of a torus
        rim: number > 0 [length]. of sphere, cylinder, or of the circle in the tube of a torus
        angle: number > 0 [angle]. between the axis of a cone and its surface, in radians
        half_axes: list of three numbers [length]. of an ellipsoid along x, y, z
        x: list of numbers [length]. z = f(x, y): places of a grid along x and y, rising, and a row of heights for
            each x
        y: list of numbers [length]. z = f(x, y): places of a grid along x and y, rising, and a row of heights for
            each x
        heights: table [length]. z = f(x, y): places of a grid along x and y, rising, and a row of heights for each x
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["gear-pair"], *, teeth: Numbers, a: str | Frame = ..., b: str | Frame = ...,
        bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector =
        ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., inner: Literal["none", "a",
        "b"] = ..., pressure_angle: Number = ..., friction: Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "gear-pair", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        teeth: list of numbers, needed. of both wheels, or any two numbers in proportion to their radii, [20, 35]
        inner: one of none, a, b, default none. which wheel has inner teeth: "a", "b" or none
        pressure_angle: number [angle], default 0. of the teeth of a gear pair or a rack pair, in radians
            ("20*pi/180"): they press each wheel away from the pitch point by its tangent times the tooth force,
            whichever way this goes
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["rack-pair"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., pull: bool
        = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., radius: Number = ..., pressure_angle:
        Number = ..., friction: Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "rack-pair", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        radius: number, or "initial" [length]. pitch radius of the pinion
        pressure_angle: number [angle], default 0. of the teeth of a gear pair or a rack pair, in radians
            ("20*pi/180"): they press each wheel away from the pitch point by its tangent times the tooth force,
            whichever way this goes
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["worm"], *, lead: Number, radius: Number, a: str | Frame = ..., b: str |
        Frame = ..., bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ...,
        x_axis: Vector = ..., pull: bool = ..., attach: Literal["mean", "rigid"] = ..., active: bool = ..., friction:
        Friction = ...
    ) -> str:
        """Adds [joints.NAME], type "worm", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        lead: number [length], needed. way of the thread for a turn of the worm, positive for right-handed ones
        radius: number > 0 [length], needed. pitch radius of the pinion
        friction: {...}
        """
    @overload
    def joint(
        self, name: str, /, type: Literal["cable"], *, through: Items[str | Frame], length: Number = ..., pull: bool =
        ..., attach: Literal["mean", "rigid"] = ..., active: bool = ...
    ) -> str:
        """Adds [joints.NAME], type "cable", and returns the name.

        through: table, needed. the frames: where it begins, the rings, where it ends
        length: number, or "initial" [length]. of all; "initial": as it is at the start, or where an event switches it
            on
        pull: true or false, default false
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        active: true or false, default true
        """
    @overload
    def force(
        self, name: str, /, type: Literal["spring"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., active:
        bool = ..., stiffness: Number = ..., damping: Number = ..., rest: Number = ..., preload: Number = ...,
        actuator: Number = ...
    ) -> str:
        """Adds [forces.NAME], type "spring", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        active: true or false, default true
        stiffness: number [force/length], default 0
        damping: number [force time/length], default 0
        rest: number, or "initial" [length]
        preload: number [force], default 0
        actuator: expression [force]. added to stiffness and damping
        """
    @overload
    def force(
        self, name: str, /, type: Literal["axial-spring"], *, a: str | Frame = ..., b: str | Frame = ..., bodies:
        Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ...,
        active: bool = ..., stiffness: Number = ..., damping: Number = ..., rest: Number = ..., preload: Number = ...,
        actuator: Number = ...
    ) -> str:
        """Adds [forces.NAME], type "axial-spring", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        active: true or false, default true
        stiffness: number [force/length], default 0
        damping: number [force time/length], default 0
        rest: number, or "initial" [length]
        preload: number [force], default 0
        actuator: expression [force]. added to stiffness and damping
        """
    @overload
    def force(
        self, name: str, /, type: Literal["rotational-spring"], *, a: str | Frame = ..., b: str | Frame = ..., bodies:
        Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ...,
        active: bool = ..., stiffness: Number = ..., damping: Number = ..., rest: Number = ..., preload: Number = ...,
        actuator: Number = ...
    ) -> str:
        """Adds [forces.NAME], type "rotational-spring", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        active: true or false, default true
        stiffness: number [force length/angle], default 0
        damping: number [force length time/angle], default 0
        rest: number, or "initial" [angle]
        preload: number [force length], default 0
        actuator: expression [force length]. added to stiffness and damping
        """
    @overload
    def force(
        self, name: str, /, type: Literal["bushing"], *, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts =
        ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., active:
        bool = ..., stiffness: Vector = ..., damping: Vector = ..., angular_stiffness: Vector = ..., angular_damping:
        Vector = ...
    ) -> str:
        """Adds [forces.NAME], type "bushing", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        active: true or false, default true
        stiffness: list of three numbers [force/length], default [0, 0, 0]
        damping: list of three numbers [force time/length], default [0, 0, 0]
        angular_stiffness: list of three numbers [force length/angle], default [0, 0, 0]
        angular_damping: list of three numbers [force length time/angle], default [0, 0, 0]
        """
    @overload
    def force(
        self, name: str, /, type: Literal["load"], *, a: str | Frame = ..., force: Vector = ..., moment: Vector = ...,
        factor: Number = ..., follower: bool = ..., active: bool = ..., body: str = ..., element_set: str = ...,
        acceleration: Vector = ..., force_density: Vector = ..., angular_velocity: Vector = ..., point: Vector = ...
    ) -> str:
        """Adds [forces.NAME], type "load", and returns the name.

        a: a marker's name or a table
        force: three numbers or expressions [force]. each component a number or an expression
        moment: three numbers or expressions [force length]. each component a number or an expression
        factor: expression. each component a number or an expression
        follower: true or false, default false
        active: true or false, default true
        body: text
        element_set: text
        acceleration: list of three numbers [length/time^2], default [0, 0, 0]
        force_density: list of three numbers [force/length^3], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        point: list of three numbers [length], default [0, 0, 0]
        """
    @overload
    def force(
        self, name: str, /, type: Literal["line-load"], *, body: str, element_set: str = ..., node: Whole = ..., near:
        Vector = ..., face: str = ..., nodes: str | Items[Whole] = ..., along: Numbers = ..., edge: Texts = ...,
        radius: Number = ..., bore: Bore = ..., force: Vector = ..., moment: Vector = ..., factor: Number = ...,
        follower: bool = ..., active: bool = ...
    ) -> str:
        """Adds [forces.NAME], type "line-load", and returns the name.

        body: text, needed
        element_set: text
        node: whole number, default 0. flexible: one node by its label in the mesh file; beams, cables, shells:
            counted from 1, -1 the last
        near: list of three numbers [length]. flexible: the node nearest to this place (mesh coordinates)
        face: text. solids: a face set, held as attach says
        nodes: a name or a list of labels. flexible: several nodes, a node set by its name (of a shell "all") or a
            list of labels as of node: [31, 90]. The frame is at their mean
        along: list of numbers. beams and cables made by dimensions: the node nearest to this share of the length, 0
            at the start, 1 at the end; two shares, [0.2, 0.5], are in supports and ties the nodes between them, in
            loads per length all that lies between
        edge: list of texts. solids: the nodes that faces have in common, ["x0", "z1"]; shells: "x0", "x1", "y0", "y1"
            (where s or t is 0 or 1), or ["x0", "y1"], a corner
        radius: number > 0 [length]
        bore: {point, axis, radius, length}. solids: { point, axis, radius, length }, the outer faces on a cylinder
            (mesh coordinates), for meshes without face sets
        force: list of three numbers [force/length], default [0, 0, 0]. each component a number or an expression
        moment: list of three numbers [force], default [0, 0, 0]. each component a number or an expression
        factor: expression. each component a number or an expression
        follower: true or false, default false
        active: true or false, default true
        """
    @overload
    def force(
        self, name: str, /, type: Literal["pressure"], *, body: str, face: str, pressure: Number, active: bool = ...
    ) -> str:
        """Adds [forces.NAME], type "pressure", and returns the name.

        body: text, needed
        face: text, needed
        pressure: expression [force/length^2], needed. on a face set of a solid, positive towards it
        active: true or false, default true
        """
    @overload
    def force(
        self, name: str, /, type: Literal["guide"], *, stiffness: Number, smoothing: Number, lengths: Numbers,
        curvatures: Numbers, a: str | Frame = ..., b: str | Frame = ..., bodies: Texts = ..., at: Vector = ...,
        rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis: Vector = ..., active: bool = ..., damping:
        Number = ..., friction: Number = ..., slip_speed: Number = ..., both_sides: bool = ..., start: Vector = ...,
        direction: Number = ...
    ) -> str:
        """Adds [forces.NAME], type "guide", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        active: true or false, default true
        stiffness: number > 0 [force/length], needed
        damping: number [force time/length], default 0
        friction: number, default 0
        slip_speed: number > 0 [length/time], default 1e-2
        smoothing: number > 0 [length], needed
        both_sides: true or false, default false
        start: list of three numbers [length], default [0, 0, 0]
        direction: number [angle], default 0
        lengths: list of numbers [length], needed
        curvatures: list of numbers [1/length or angle/length], needed
        """
    @overload
    def force(
        self, name: str, /, type: Literal["cable"], *, through: Items[str | Frame], stiffness: Number, damping: Number
        = ..., length: Number = ..., friction: Number = ..., slip_speed: Number = ..., active: bool = ...
    ) -> str:
        """Adds [forces.NAME], type "cable", and returns the name.

        through: table, needed. the frames: where it begins, the rings, where it ends
        stiffness: number > 0 [force/length], needed. force for the stretch of the whole, E A / length
        damping: number [force time/length], default 0. force for the rate of the stretch
        length: number, or "initial" [length]. of all; "initial": as it is at the start, or where an event switches it
            on
        friction: number, default 0. coefficient in the rings: over one in which the rope turns by theta the pull
            grows by exp(friction theta) the way that it slips (Eytelwein)
        slip_speed: number > 0 [length/time], default 1. where friction is 76 % developed
        active: true or false, default true
        """
    @overload
    def force(
        self, name: str, /, type: Literal["torque-motor"], *, torque: Number, a: str | Frame = ..., b: str | Frame =
        ..., bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis:
        Vector = ..., active: bool = ...
    ) -> str:
        """Adds [forces.NAME], type "torque-motor", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        active: true or false, default true
        torque: expression [force length], needed. on b about z of a, the opposite on a
        """
    @overload
    def force(
        self, name: str, /, type: Literal["force-motor"], *, force: Number, a: str | Frame = ..., b: str | Frame =
        ..., bodies: Texts = ..., at: Vector = ..., rotation: Vector | Rotation = ..., axis: Vector = ..., x_axis:
        Vector = ..., active: bool = ...
    ) -> str:
        """Adds [forces.NAME], type "force-motor", and returns the name.

        a: a marker's name or a table
        b: a marker's name or a table
        bodies: list of texts
        at: list of three numbers [length]
        rotation: rotation [angle]. of the axes, instead of axis
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        active: true or false, default true
        force: number or expression [force], needed. each component a number or an expression
        """
    def support(
        self, name: str, /, *, body: str, node: Whole = ..., near: Vector = ..., face: str = ..., nodes: str |
        Items[Whole] = ..., along: Numbers = ..., edge: Texts = ..., radius: Number = ..., bore: Bore = ..., hold:
        Texts = ..., rotations: Texts = ..., symmetry: str | Vector = ..., rotation: Vector | Rotation = ..., motion:
        Displacements = ...
    ) -> str:
        """Adds [supports.NAME], and returns the name.

        body: text, needed. which nodes, as of a marker
        node: whole number, default 0. flexible: one node by its label in the mesh file; beams, cables, shells:
            counted from 1, -1 the last
        near: list of three numbers [length]. flexible: the node nearest to this place (mesh coordinates)
        face: text. solids: a face set, held as attach says
        nodes: a name or a list of labels. flexible: several nodes, a node set by its name (of a shell "all") or a
            list of labels as of node: [31, 90]. The frame is at their mean
        along: list of numbers. beams and cables made by dimensions: the node nearest to this share of the length, 0
            at the start, 1 at the end; two shares, [0.2, 0.5], are in supports and ties the nodes between them, in
            loads per length all that lies between
        edge: list of texts. solids: the nodes that faces have in common, ["x0", "z1"]; shells: "x0", "x1", "y0", "y1"
            (where s or t is 0 or 1), or ["x0", "y1"], a corner
        radius: number > 0 [length]
        bore: {point, axis, radius, length}. solids: { point, axis, radius, length }, the outer faces on a cylinder
            (mesh coordinates), for meshes without face sets
        hold: list of texts. "all": a clamp, with the directors of shells and the slopes of cables; or directions:
            "x", "yz", ["x", "z"]
        rotations: list of texts. of nodes of shells and beams: axes about which they do not turn, "x", "yz"
        symmetry: one of x, y, z. normal of a plane of symmetry, "x" or [1, 1, 0]: nodes stay in the plane, directors
            and slopes stay mirrored
        rotation: rotation [angle]. of the directions x, y, z, which are global ones, as of a body
        motion: {x, y, z}. { z = 1e-3 } or { z = "1e-3*sin(10*t)", x = "table(t)" }: displacements from the start,
            numbers or functions of time (also [splines])
        """
    def equation(
        self, name: str, /, *, terms: Items[Mapping[str, Any]], body: str = ..., value: Number = ..., stiffness:
        Number = ..., damping: Number = ...
    ) -> str:
        """Adds [equations.NAME], and returns the name.

        body: text
        terms: table, needed
        value: number [length], default 0
        stiffness: number [force/length], default 0
        damping: number [force time/length], default 0
        """
    def tie(
        self, name: str, /, *, body: str, to: Mapping[str, Any], node: Whole = ..., near: Vector = ..., face: str =
        ..., nodes: str | Items[Whole] = ..., along: Numbers = ..., edge: Texts = ..., radius: Number = ..., bore:
        Bore = ..., tolerance: Number = ...
    ) -> str:
        """Adds [ties.NAME], and returns the name.

        body: text, needed
        node: whole number, default 0. flexible: one node by its label in the mesh file; beams, cables, shells:
            counted from 1, -1 the last
        near: list of three numbers [length]. flexible: the node nearest to this place (mesh coordinates)
        face: text. solids: a face set, held as attach says
        nodes: a name or a list of labels. flexible: several nodes, a node set by its name (of a shell "all") or a
            list of labels as of node: [31, 90]. The frame is at their mean
        along: list of numbers. beams and cables made by dimensions: the node nearest to this share of the length, 0
            at the start, 1 at the end; two shares, [0.2, 0.5], are in supports and ties the nodes between them, in
            loads per length all that lies between
        edge: list of texts. solids: the nodes that faces have in common, ["x0", "z1"]; shells: "x0", "x1", "y0", "y1"
            (where s or t is 0 or 1), or ["x0", "y1"], a corner
        radius: number > 0 [length]
        bore: {point, axis, radius, length}. solids: { point, axis, radius, length }, the outer faces on a cylinder
            (mesh coordinates), for meshes without face sets
        to: table, needed
        tolerance: number > 0 [length]
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["plane"], *, body: str, point: Vector = ..., normal: Vector = ...,
        rotation: Vector | Rotation = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "plane", and returns the name.

        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        normal: list of three numbers. of a plane, instead of rotation: out of the half space
        rotation: rotation [angle]. of the shape's axes in those of the body
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["sphere"], *, body: str, radius: Number, point: Vector = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "sphere", and returns the name.

        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        radius: number > 0 [length], needed. of a sphere, capsule or cylinder
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["capsule"], *, body: str, radius: Number, length: Number, point: Vector =
        ..., axis: Vector = ..., rotation: Vector | Rotation = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "capsule", and returns the name.

        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        radius: number > 0 [length], needed. of a sphere, capsule or cylinder
        length: number > 0 [length], needed. of the axis: a capsule's has a half ball beyond each end, a cylinder's
            ends are flat
        axis: list of three numbers. of a capsule, cylinder or sprocket, instead of rotation
        rotation: rotation [angle]. of the shape's axes in those of the body
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["cylinder"], *, body: str, radius: Number, length: Number, point: Vector =
        ..., axis: Vector = ..., rotation: Vector | Rotation = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "cylinder", and returns the name.

        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        radius: number > 0 [length], needed. of a sphere, capsule or cylinder
        length: number > 0 [length], needed. of the axis: a capsule's has a half ball beyond each end, a cylinder's
            ends are flat
        axis: list of three numbers. of a capsule, cylinder or sprocket, instead of rotation
        rotation: rotation [angle]. of the shape's axes in those of the body
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["box"], *, body: str, size: Vector, point: Vector = ..., rotation: Vector |
        Rotation = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "box", and returns the name.

        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        size: list of three numbers [length], needed. of a box: three edge lengths
        rotation: rotation [angle]. of the shape's axes in those of the body
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["mesh"], *, body: str, file: str | PathLike[str], point: Vector = ...,
        scale: Number = ..., rotation: Vector | Rotation = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "mesh", and returns the name.

        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        file: text, needed. of a mesh: .stl (text or binary), .obj, or a mesh file as for solids, of which the outer
            faces count; .gz too
        scale: number > 0, default 1. factor on the coordinates of the file, or a list of three, along x, y and z
        rotation: rotation [angle]. of the shape's axes in those of the body
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["faces"], *, body: str, set: str = ..., divisions: Whole = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "faces", and returns the name.

        body: text, needed. a rigid body or ground
        set: text. of faces: a face set of the solid's mesh
        divisions: whole number, default 1. of a line: parts of each element (1 to 1000) with five points of
            integration each
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["sprocket"], *, body: str, pitch: Number, roller_radius: Number, width:
        Number, point: Vector = ..., teeth: Whole = ..., tip: Number = ..., axis: Vector = ..., rotation: Vector |
        Rotation = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "sprocket", and returns the name.

        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        teeth: whole number, default 17. of a sprocket for a roller chain: number of teeth (6 to 10,000), pitch of the
            chain, radius of its rollers, width along the axis, height of the tips over the pitch circle in roller
            diameters
        pitch: number > 0 [length], needed. of a sprocket for a roller chain: number of teeth (6 to 10,000), pitch of
            the chain, radius of its rollers, width along the axis, height of the tips over the pitch circle in roller
            diameters
        roller_radius: number > 0 [length], needed. of a sprocket for a roller chain: number of teeth (6 to 10,000),
            pitch of the chain, radius of its rollers, width along the axis, height of the tips over the pitch circle
            in roller diameters
        width: number > 0 [length], needed. of a sprocket for a roller chain: number of teeth (6 to 10,000), pitch of
            the chain, radius of its rollers, width along the axis, height of the tips over the pitch circle in roller
            diameters
        tip: number > 0, default 0.35. of a sprocket for a roller chain: number of teeth (6 to 10,000), pitch of the
            chain, radius of its rollers, width along the axis, height of the tips over the pitch circle in roller
            diameters
        axis: list of three numbers. of a capsule, cylinder or sprocket, instead of rotation
        rotation: rotation [angle]. of the shape's axes in those of the body
        """
    @overload
    def surface(
        self, name: str, /, shape: Literal["line"], *, body: str, radius: Number, divisions: Whole = ...
    ) -> str:
        """Adds [surfaces.NAME], shape "line", and returns the name.

        body: text, needed. a rigid body or ground
        radius: number > 0 [length], needed. of a sphere, capsule or cylinder
        divisions: whole number, default 1. of a line: parts of each element (1 to 1000) with five points of
            integration each
        """
    def contact(
        self, name: str, /, *, surfaces: Texts, stiffness: Number, active: bool = ..., against: Texts = ..., self_:
        bool = ..., margin: Number = ..., overlap: Number = ..., penetration: Number = ..., law: Literal["penalty",
        "impulse"] = ..., exponent: Number = ..., smoothing: Number = ..., damping: Number = ..., restitution: Number
        = ..., friction: Number = ..., static: Number = ..., stribeck_speed: Number = ..., tangential_stiffness:
        Number = ..., tangential_damping: Number = ...
    ) -> str:
        """Adds [contacts.NAME], and returns the name.

        active: true or false, default true. at the start
        surfaces: list of texts, needed. names of surfaces; * stands for any letters: ["ball*", "floor"]
        against: list of texts. names of a second group: each surface of surfaces may touch each of against, and no
            others
        self: true or false, default false. faces and sides of shells among surfaces touch themselves, too
        margin: number > 0 [length]. of the search: pairs of surfaces that are nearer than this are looked at
        overlap: number >= 0 [length]. how far surfaces may overlap at the start
        penetration: number > 0 [length]. of solids: the largest penetration that is allowed, kept by an augmented
            Lagrangian
        law: one of penalty, impulse, default penalty. penalty: forces; impulse: impacts that take no time, of rigid
            shapes
        stiffness: number > 0 [force/length^e or force/length^2/length^e or force/length/length^e], needed. k: force
            over penetration^e
        exponent: number > 0, default 1. e: 1, or 1.5 for spheres (Hertz)
        smoothing: number >= 0 [length]. with the exponent 1: penetration over which the stiffness builds up
        damping: number >= 0 [time/length]. a of Hunt and Crossley: forces are multiplied by 1 + a times the speed of
            penetration
        restitution: number >= 0. of rigid shapes, instead of damping: what meets with v parts with this part of v, at
            any v; above 0, with impulse from 0 on
        friction: number >= 0. Coulomb's coefficient, of what slides
        static: number >= 0. of what rests: at the slip speed s the coefficient is friction + (static - friction)
            exp(-(s / stribeck_speed)^2)
        stribeck_speed: number > 0 [length/time]. where static has fallen off
        tangential_stiffness: number > 0 [force/length or force/length^3 or force/length^2]. of the spring that holds
            until it slips: force (solids: stress) over length
        tangential_damping: number >= 0 [force time/length or force time/length^3 or force time/length^2]. of a damper
            beside it
        """
    def material(
        self, name: str, /, *, young: Number, law: Literal["st-venant-kirchhoff", "neo-hookean"] = ..., poisson:
        Number = ..., density: Number = ...
    ) -> str:
        """Adds [materials.NAME], and returns the name.

        law: one of st-venant-kirchhoff, neo-hookean, default st-venant-kirchhoff
        young: number > 0 [force/length^2], needed
        poisson: number, default 0
        density: number > 0 [mass/length^3]
        """
    def marker(
        self, name: str, /, *, same_as: str = ..., body: str = ..., global_: bool = ..., point: Vector = ..., axis:
        Vector = ..., x_axis: Vector = ..., rotation: Vector | Rotation = ..., attach: Literal["mean", "rigid"] = ...,
        node: Whole = ..., near: Vector = ..., face: str = ..., nodes: str | Items[Whole] = ..., weights: Numbers =
        ..., along: Numbers = ..., edge: Texts = ..., radius: Number = ..., bore: Bore = ..., most_nodes: Whole = ...
    ) -> str:
        """Adds [markers.NAME], and returns the name.

        same_as: text. another marker's name, instead of all the rest
        body: text. a body's name, or ground
        global: true or false, default false. point and axes are global, in the initial state
        point: list of three numbers [length], default [0, 0, 0]. rigid: from the centre of mass in body axes; ground:
            global; face: where the frame is to be instead of the mean of the face's nodes (below)
        axis: list of three numbers, default [0, 0, 1]. directions of the z axis and (nearly) the x axis, in body
            (mesh) axes
        x_axis: list of three numbers. directions of the z axis and (nearly) the x axis, in body (mesh) axes
        rotation: rotation [angle]. of the axes, instead of axis
        attach: one of mean, rigid. how a face, an edge, a bore or a node set is held, also as a key of the joint.
            rigid: all its nodes are one rigid piece (of a shell with its directors). mean: their mean position and
            rotation are held, and the face may bend and warp
        node: whole number, default 0. flexible: one node by its label in the mesh file; beams, cables, shells:
            counted from 1, -1 the last
        near: list of three numbers [length]. flexible: the node nearest to this place (mesh coordinates)
        face: text. solids: a face set, held as attach says
        nodes: a name or a list of labels. flexible: several nodes, a node set by its name (of a shell "all") or a
            list of labels as of node: [31, 90]. The frame is at their mean
        weights: list of numbers. of nodes as a list of labels: how much each of them counts in the mean, [1, 2.5]
        along: list of numbers. beams and cables made by dimensions: the node nearest to this share of the length, 0
            at the start, 1 at the end; two shares, [0.2, 0.5], are in supports and ties the nodes between them, in
            loads per length all that lies between
        edge: list of texts. solids: the nodes that faces have in common, ["x0", "z1"]; shells: "x0", "x1", "y0", "y1"
            (where s or t is 0 or 1), or ["x0", "y1"], a corner
        radius: number > 0 [length]
        bore: {point, axis, radius, length}. solids: { point, axis, radius, length }, the outer faces on a cylinder
            (mesh coordinates), for meshes without face sets
        most_nodes: whole number, default 240. of means: larger face sets are thinned out evenly, to about so many
            nodes; 0: never
        """
    def spline(
        self, name: str, /, *, kind: Literal["linear", "akima", "monotone", "cubic"] = ..., outside:
        Literal["constant", "linear", "error"] = ..., points: Points = ..., file: str | PathLike[str] = ..., x_scale:
        Number = ..., y_scale: Number = ..., separator: Literal["comma", "semicolon", "tab", "space"] = ..., x: Whole
        = ..., y: Whole = ...
    ) -> str:
        """Adds [splines.NAME], and returns the name.

        kind: one of linear, akima, monotone, cubic, default akima. linear; akima: cubic pieces with continuous
            slopes, quiet at corners; monotone (Fritsch and Butland): continuous slopes, never beyond its points;
            cubic: natural spline, continuous second derivatives (motions want them)
        outside: one of constant, linear, error, default error. of the points: constant, linear, error
        points: list of points. [[x, y], ...] instead of a file
        file: text. a CSV file and its columns. # begins a comment
        x_scale: number, default 1. factors on the columns
        y_scale: number, default 1. factors on the columns
        separator: one of comma, semicolon, tab, space, default by the file. comma, semicolon, tab, space
        x: name or number of a column. a CSV file and its columns. # begins a comment
        y: name or number of a column. a CSV file and its columns. # begins a comment
        """
    def event(
        self, name: str, /, *, when: str, contact: str = ..., stop: bool = ..., once: bool = ..., on: Texts = ...,
        off: Texts = ..., tolerance: Number = ..., position_tolerance: Number = ..., set: Mapping[str, Number] = ...
    ) -> str:
        """Adds [events.NAME], and returns the name.

        when: text, needed. one comparison with < or > of two expressions
        contact: text. instead of a comparison: the name of a contact, with when = "closes" or "opens"
        stop: true or false, default false. the run ends here, with status ok
        once: true or false, default false. only the first time
        on: list of texts. names of joints and forces that are switched on or off. active = false in a joint or force:
            off at the start
        off: list of texts. names of joints and forces that are switched on or off. active = false in a joint or
            force: off at the start
        tolerance: number > 0 [time]. of the time
        position_tolerance: number > 0 [length]. joints that are switched on must fit: largest change of positions
            that they may need
        set: {input: value}. { input = value }
        """
    def controller(
        self, name: str, /, *, type: Literal["fmu"], file: str | PathLike[str], step: Number, inputs: Any = ...,
        outputs: Texts = ..., start: Any = ...
    ) -> str:
        """Adds [controllers.NAME], and returns the name.

        type: one of fmu, needed. "fmu"
        file: text, needed. the FMU, FMI 2 or 3 with co-simulation
        step: number > 0, needed. time between two exchanges
        inputs: table. table: variable of the FMU = number or expression of quantities
        outputs: list of texts. names of variables, or a table: name in the model = variable of the FMU
        start: table. table: variable of the FMU = number, text or boolean, what it begins with
        """
    def sensor(self, name: str, /, value: Any) -> str: ...
    def input(self, name: str, /, value: Any = 0.0) -> str: ...
