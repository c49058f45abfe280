"""For model_parts.py: tables inside of parts, and the calls that add parts."""

# Where a table stands, for its rows in units/key_dimensions.cpp.
PATHS = {"Rotation": "bodies.*.rotation", "Material": "materials.*", "Mesh": "bodies.*.mesh", "Damping": "bodies.*.damping",
         "Erosion": "bodies.*.erosion", "Reduction": "bodies.*.reduce", "Node": "bodies.*.nodes", "Bore": "markers.*.bore", "Frame": "markers.*",
         "Displacements": "supports.*.motion", "Limits": "joints.*.limits", "Friction": "joints.*.friction", "SteadyRotation": "initial.rotation",
         "Integrator": "integrator", "Statics": "statics", "Initial": "initial", "HarmonicKeys": "harmonic", "Output": "output"}

# Tables inside of parts, and sections of the top: what they are, their readers, and the keys if not all of them.
TABLES = {
    "Rotation": ("Of axes: {axis, angle} in radians, or {quaternion} = [w, x, y, z].", "rotation", "axis angle quaternion"),
    "Material": ("A material in line.", "read_material", ""),
    "Mesh": ("A mesh file, or a part that is meshed.", "read_mesh_source read_take read_block read_rod read_link read_crank read_guide read_rotor"
             " read_tyre read_gear read_divisions", ""),
    "Damping": ("Of a flexible body.", "read_damping rayleigh_of_ratios", "mass stiffness ratio frequencies loss_factor frequency"),
    "Erosion": ("When elements of a solid fail.", "read_erosion", ""),
    "Reduction": ("How a flexible body is reduced.", "read_reduction", ""),
    "MatrixFile": ("A matrix of a substructure.", "read_matrix", ""),
    "Node": ("Of a substructure.", "read_node", ""),
    "NodesFile": ("A file with GRID cards.", "read_matrix", "file"),
    "Bore": ("Outer faces on a cylinder.", "read_where", "point axis radius length"),
    "Frame": ("A marker in line.", "read_marker read_attach read_axes read_where read_nodes read_weights read_along",
              "same_as name body global point axis x_axis rotation attach node near face nodes weights along edge radius bore most_nodes"),
    "Displacements": ("Of a support: numbers or functions of time.", "motion", "x y z"),
    "Limits": ("Of the coordinate of a joint.", "read_limits", ""),
    "Friction": ("Of a joint.", "read_friction", ""),
    "SteadyRotation": ("Of the whole model at the start.", "read_rotation", ""),
    "Integrator": ("A run over time.", "read_integrator read_bdf read_alpha", ""),
    "Statics": ("An equilibrium.", "read_statics read_statics_options", ""),
    "Initial": ("How a run begins.", "read_initial", ""),
    "HarmonicKeys": ("A frequency response.", "read_range read_harmonic read_loads", ""),
    "Output": ("What is kept and written.", "read_output", "")}

# Section, method, its arguments where it has no keys, and what it does.
METHODS = (
    ("bodies", "body", "", "Adds [bodies.NAME] and returns the name. Keys are checked at once; numbers may be expressions of the"
     " parameters (\"2*length\"), lists may be arrays of NumPy. In brackets: dimensions, in the units of the model."),
    ("joints", "joint", "", "Adds [joints.NAME] and returns the name: frames a and b, or bodies, at and axis."),
    ("forces", "force", "", "Adds [forces.NAME] and returns the name."),
    ("supports", "support", "", "Adds [supports.NAME] and returns the name: nodes of a flexible body that are held or led, by"
     " hold=\"all\", symmetry=\"x\" or motion={\"z\": 1e-3}."),
    ("equations", "equation", "", "Adds [equations.NAME] and returns the name: a linear equation between displacements of nodes"
     " of solids, exact, or held by a stiffness."),
    ("ties", "tie", "", "Adds [ties.NAME] and returns the name: nodes of a solid that stay where they are on faces, to={\"body\": ...,"
     " \"face\": ...}."),
    ("surfaces", "surface", "", "Adds [surfaces.NAME], what a contact may touch, and returns the name."),
    ("contacts", "contact", "", "Adds [contacts.NAME] between surfaces and returns the name."),
    ("materials", "material", "", "Adds [materials.NAME] and returns the name."),
    ("markers", "marker", "", "Adds [markers.NAME], a place with axes, and returns the name."),
    ("splines", "spline", "", "Adds [splines.NAME], a function by points, which expressions call by its name; returns the name."),
    ("events", "event", "", "Adds [events.NAME] and returns the name: what happens when an expression passes through a limit."),
    ("controllers", "controller", "", "Adds [controllers.NAME], an FMU of another program that steps beside the run, and returns the name;"
     " expressions read what it tells as NAME.OUTPUT."),
    ("sensors", "sensor", "self, name: str, /, value: Any", "Adds a quantity of its own to [sensors], a number or an expression of"
     " quantities, and returns the name."),
    ("inputs", "input", "self, name: str, /, value: Any = 0.0", "Adds a number to [inputs] that the program sets"
     " (Simulation.set_input), and returns the name."))
