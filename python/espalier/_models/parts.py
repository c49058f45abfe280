"""Made by docs/site/model_parts.py --write from the calls in the read_*.cpp below src/dynamics/model; do not edit."""

from typing import Any


class Parts:
    """The calls that add a named part to a model; signatures by type stand in parts.pyi."""

    def part(self, section: str, name: str, /, keys: Any) -> str:
        """See Model.part()."""
        raise NotImplementedError

    def body(self, name: str, /, type: str = "rigid", **keys: Any) -> str:
        """Adds [bodies.NAME] and returns the name. Keys are checked at once; numbers may be expressions of the parameters
        ("2*length"), lists may be arrays of NumPy. In brackets: dimensions, in the units of the model.

        type "rigid":
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

        type "point" (gravity, position, velocity as above):
        mass: number > 0 [mass], needed. > 0

        type "solid" (gravity, rotation, velocity, angular_velocity as above):
        position: list of three numbers [length], default [0, 0, 0]
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

        type "cable" (gravity, position, rotation, velocity, angular_velocity, damping, reduce, element_set, material
            as above):
        mesh: {...}
        radius: number > 0 [length]
        start: list of three numbers [length]
        end: list of three numbers [length]
        elements: whole number, default 10
        axial: number > 0 [force]
        bending: number [force length^2]
        mass_per_length: number > 0 [mass/length]

        type "beam" (gravity, position, rotation, velocity, angular_velocity, damping, reduce, mesh, radius, elements,
            element_set, material as above):
        points: list of points [length]. the smooth curve through the points (a cubic spline)
        start: list of three numbers [length]. straight
        end: list of three numbers [length]. straight
        direction: list of three numbers. constant curvature in radians per length, about the axes of the section: an
            arc, a helix, a twisted straight beam
        length: number > 0 [length]. constant curvature in radians per length, about the axes of the section: an arc,
            a helix, a twisted straight beam
        curvature: list of three numbers [angle/length or 1/length]. constant curvature in radians per length, about
            the axes of the section: an arc, a helix, a twisted straight beam
        y: list of three numbers
        height: number > 0 [length]
        width: number > 0 [length]
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

        type "shell" (gravity, position, rotation, velocity, angular_velocity, damping, reduce, mesh, element_set,
            material as above):
        origin: list of three numbers [length], default [0, 0, 0]
        x: list of three numbers [length]
        y: list of three numbers [length]
        curvature: number [1/length or angle/length], default 0
        nx: whole number, default 4
        ny: whole number, default 4
        offset: number [length], default 0
        thickness: number > 0 [length]

        type "substructure" (gravity, position, rotation, velocity, angular_velocity, damping, reduce as above):
        stiffness: {file, name}, needed. { file = "arm.op4", name = "KAA" }, path from the model's folder
        mass: {file, name}, needed. { file = "arm.op4", name = "KAA" }, path from the model's folder
        nodes: list of {label, position, components}, or {file}, needed. [{ label = 1, position = [x, y, z],
            components = 6 }, ...], or { file = "arm.bdf" } with GRID cards
        lines: list of numbers. labels of nodes, two for each line in pictures
        """
        return self.part("bodies", name, {"type": type, **keys})

    def joint(self, name: str, /, type: str, **keys: Any) -> str:
        """Adds [joints.NAME] and returns the name: frames a and b, or bodies, at and axis.

        type "fixed":
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

        type "revolute" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above):
        limits: {...}
        friction: {...}
        armature: number >= 0 [mass length^2], default 0. moment of inertia (prismatic: mass) of a rotor that moves
            with the joint's coordinate and is felt there alone: that of a motor times the square of its gear ratio

        type "spherical" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above)

        type "universal" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above)

        type "cylindrical" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits, friction as
            above):
        angle_limits: {...}

        type "prismatic" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits, friction as above):
        armature: number >= 0 [mass], default 0. moment of inertia (prismatic: mass) of a rotor that moves with the
            joint's coordinate and is felt there alone: that of a motor times the square of its gear ratio

        type "planar" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above)

        type "point-on-line" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits, friction as
            above)

        type "distance" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above):
        length: number, or "initial" [length]

        type "revolute-spherical" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, length as above)

        type "rotation-motor" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above):
        motion: function of time [angle], needed
        from: one of zero, initial, default zero

        type "translation-motor" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, from as above):
        motion: function of time [length], needed

        type "prescribed" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, motion, from as above):
        direction: one of x, y, z, needed

        type "rolling" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above):
        shape: one of wheel, ball, default wheel
        radius: number > 0 [length], needed
        rim: number > 0 [length]

        type "skate" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active as above)

        type "gear" (pull, attach, active as above):
        a: a marker's name or a table, needed
        b: a marker's name or a table, needed
        c: a marker's name or a table, needed
        d: a marker's name or a table, needed
        ratio: number, needed

        type "rack-and-pinion" (a, b, c, d, pull, attach, active as above):
        radius: number [length], needed

        type "coupled-slides" (a, b, c, d, ratio, pull, attach, active as above)

        type "screw" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits, angle_limits, friction
            as above):
        lead: number [length], needed. way of the thread for a turn of the worm, positive for right-handed ones

        type "constant-velocity" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits as above)

        type "parallel-axes" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits, friction as
            above)

        type "in-plane" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, friction as above)

        type "in-line" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits, friction as above)

        type "point-on-curve" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, limits, friction as
            above):
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

        type "point-on-surface" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, friction as above):
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

        type "gear-pair" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, friction as above):
        teeth: list of numbers, needed. of both wheels, or any two numbers in proportion to their radii, [20, 35]
        inner: one of none, a, b, default none. which wheel has inner teeth: "a", "b" or none
        pressure_angle: number [angle], default 0. of the teeth of a gear pair or a rack pair, in radians
            ("20*pi/180"): they press each wheel away from the pitch point by its tangent times the tooth force,
            whichever way this goes

        type "rack-pair" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, pressure_angle, friction as
            above):
        radius: number, or "initial" [length]. pitch radius of the pinion

        type "worm" (a, b, bodies, at, rotation, axis, x_axis, pull, attach, active, lead, friction as above):
        radius: number > 0 [length], needed. pitch radius of the pinion

        type "cable" (pull, attach, active as above):
        through: table, needed. the frames: where it begins, the rings, where it ends
        length: number, or "initial" [length]. of all; "initial": as it is at the start, or where an event switches it
            on
        """
        return self.part("joints", name, {"type": type, **keys})

    def force(self, name: str, /, type: str, **keys: Any) -> str:
        """Adds [forces.NAME] and returns the name.

        type "spring":
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

        type "axial-spring" (a, b, bodies, at, rotation, axis, x_axis, active, stiffness, damping, rest, preload,
            actuator as above)

        type "rotational-spring" (a, b, bodies, at, rotation, axis, x_axis, active as above):
        stiffness: number [force length/angle], default 0
        damping: number [force length time/angle], default 0
        rest: number, or "initial" [angle]
        preload: number [force length], default 0
        actuator: expression [force length]. added to stiffness and damping

        type "bushing" (a, b, bodies, at, rotation, axis, x_axis, active as above):
        stiffness: list of three numbers [force/length], default [0, 0, 0]
        damping: list of three numbers [force time/length], default [0, 0, 0]
        angular_stiffness: list of three numbers [force length/angle], default [0, 0, 0]
        angular_damping: list of three numbers [force length time/angle], default [0, 0, 0]

        type "load" (a, active as above):
        force: three numbers or expressions [force]. each component a number or an expression
        moment: three numbers or expressions [force length]. each component a number or an expression
        factor: expression. each component a number or an expression
        follower: true or false, default false
        body: text
        element_set: text
        acceleration: list of three numbers [length/time^2], default [0, 0, 0]
        force_density: list of three numbers [force/length^3], default [0, 0, 0]
        angular_velocity: list of three numbers [angle/time], default [0, 0, 0]
        point: list of three numbers [length], default [0, 0, 0]

        type "line-load" (element_set, factor, follower, active as above):
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
        force: list of three numbers [force/length], default [0, 0, 0]. each component a number or an expression
        moment: list of three numbers [force], default [0, 0, 0]. each component a number or an expression

        type "pressure" (body, active as above):
        face: text, needed
        pressure: expression [force/length^2], needed. on a face set of a solid, positive towards it

        type "guide" (a, b, bodies, at, rotation, axis, x_axis, active, damping as above):
        stiffness: number > 0 [force/length], needed
        friction: number, default 0
        slip_speed: number > 0 [length/time], default 1e-2
        smoothing: number > 0 [length], needed
        both_sides: true or false, default false
        start: list of three numbers [length], default [0, 0, 0]
        direction: number [angle], default 0
        lengths: list of numbers [length], needed
        curvatures: list of numbers [1/length or angle/length], needed

        type "cable" (active as above):
        through: table, needed. the frames: where it begins, the rings, where it ends
        stiffness: number > 0 [force/length], needed. force for the stretch of the whole, E A / length
        damping: number [force time/length], default 0. force for the rate of the stretch
        length: number, or "initial" [length]. of all; "initial": as it is at the start, or where an event switches it
            on
        friction: number, default 0. coefficient in the rings: over one in which the rope turns by theta the pull
            grows by exp(friction theta) the way that it slips (Eytelwein)
        slip_speed: number > 0 [length/time], default 1. where friction is 76 % developed

        type "torque-motor" (a, b, bodies, at, rotation, axis, x_axis, active as above):
        torque: expression [force length], needed. on b about z of a, the opposite on a

        type "force-motor" (a, b, bodies, at, rotation, axis, x_axis, active as above):
        force: number or expression [force], needed. each component a number or an expression
        """
        return self.part("forces", name, {"type": type, **keys})

    def support(self, name: str, /, **keys: Any) -> str:
        """Adds [supports.NAME] and returns the name: nodes of a flexible body that are held or led, by hold="all",
        symmetry="x" or motion={"z": 1e-3}.

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
        return self.part("supports", name, keys)

    def equation(self, name: str, /, **keys: Any) -> str:
        """Adds [equations.NAME] and returns the name: a linear equation between displacements of nodes of solids, exact,
        or held by a stiffness.

        body: text
        terms: table, needed
        value: number [length], default 0
        stiffness: number [force/length], default 0
        damping: number [force time/length], default 0
        """
        return self.part("equations", name, keys)

    def tie(self, name: str, /, **keys: Any) -> str:
        """Adds [ties.NAME] and returns the name: nodes of a solid that stay where they are on faces, to={"body": ...,
        "face": ...}.

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
        return self.part("ties", name, keys)

    def surface(self, name: str, /, shape: str, **keys: Any) -> str:
        """Adds [surfaces.NAME], what a contact may touch, and returns the name.

        shape "plane":
        body: text, needed. a rigid body or ground
        point: list of three numbers [length], default [0, 0, 0]. of the shape's origin: from the centre of mass, in
            body axes (ground: global)
        normal: list of three numbers. of a plane, instead of rotation: out of the half space
        rotation: rotation [angle]. of the shape's axes in those of the body

        shape "sphere" (body, point as above):
        radius: number > 0 [length], needed. of a sphere, capsule or cylinder

        shape "capsule" (body, point, radius, rotation as above):
        length: number > 0 [length], needed. of the axis: a capsule's has a half ball beyond each end, a cylinder's
            ends are flat
        axis: list of three numbers. of a capsule, cylinder or sprocket, instead of rotation

        shape "cylinder" (body, point, radius, length, axis, rotation as above)

        shape "box" (body, point, rotation as above):
        size: list of three numbers [length], needed. of a box: three edge lengths

        shape "mesh" (body, point, rotation as above):
        file: text, needed. of a mesh: .stl (text or binary), .obj, or a mesh file as for solids, of which the outer
            faces count; .gz too
        scale: number > 0, default 1. factor on the coordinates of the file, or a list of three, along x, y and z

        shape "faces" (body as above):
        set: text. of faces: a face set of the solid's mesh
        divisions: whole number, default 1. of a line: parts of each element (1 to 1000) with five points of
            integration each

        shape "sprocket" (body, point, axis, rotation as above):
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

        shape "line" (body, radius, divisions as above)
        """
        return self.part("surfaces", name, {"shape": shape, **keys})

    def contact(self, name: str, /, **keys: Any) -> str:
        """Adds [contacts.NAME] between surfaces and returns the name.

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
        return self.part("contacts", name, keys)

    def material(self, name: str, /, **keys: Any) -> str:
        """Adds [materials.NAME] and returns the name.

        law: one of st-venant-kirchhoff, neo-hookean, default st-venant-kirchhoff
        young: number > 0 [force/length^2], needed
        poisson: number, default 0
        density: number > 0 [mass/length^3]
        """
        return self.part("materials", name, keys)

    def marker(self, name: str, /, **keys: Any) -> str:
        """Adds [markers.NAME], a place with axes, and returns the name.

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
        return self.part("markers", name, keys)

    def spline(self, name: str, /, **keys: Any) -> str:
        """Adds [splines.NAME], a function by points, which expressions call by its name; returns the name.

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
        return self.part("splines", name, keys)

    def event(self, name: str, /, **keys: Any) -> str:
        """Adds [events.NAME] and returns the name: what happens when an expression passes through a limit.

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
        return self.part("events", name, keys)

    def controller(self, name: str, /, **keys: Any) -> str:
        """Adds [controllers.NAME], an FMU of another program that steps beside the run, and returns the name; expressions
        read what it tells as NAME.OUTPUT.

        type: one of fmu, needed. "fmu"
        file: text, needed. the FMU, FMI 2 or 3 with co-simulation
        step: number > 0, needed. time between two exchanges
        inputs: table. table: variable of the FMU = number or expression of quantities
        outputs: list of texts. names of variables, or a table: name in the model = variable of the FMU
        start: table. table: variable of the FMU = number, text or boolean, what it begins with
        """
        return self.part("controllers", name, keys)

    def sensor(self, name: str, /, value: Any) -> str:
        """Adds a quantity of its own to [sensors], a number or an expression of quantities, and returns the name."""
        return self.part("sensors", name, value)

    def input(self, name: str, /, value: Any = 0.0) -> str:
        """Adds a number to [inputs] that the program sets (Simulation.set_input), and returns the name."""
        return self.part("inputs", name, value)
