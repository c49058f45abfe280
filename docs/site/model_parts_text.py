"""For model_parts.py: dimensions of keys, tables inside of parts, and the calls that add parts."""

# Of a key everywhere, of a key of a section, or of a key of one type.
DIMENSIONS = {
    "mass": "mass", "box": "length", "inertia": "mass length^2", "position": "length", "velocity": "length/time",
    "angular_velocity": "1/time", "gravity": "length/time^2", "young": "force/length^2", "density": "mass/length^3", "start": "length",
    "end": "length", "radius": "length", "axial": "force", "bending": "force length^2", "mass_per_length": "mass/length", "points": "length",
    "direction": "", "length": "length", "curvature": "1/length", "height": "length", "width": "length", "shear_y": "force",
    "shear_z": "force", "torsion": "force length^2", "bending_y": "force length^2", "bending_z": "force length^2", "section_normal": "force",
    "section_shear": "force", "inertia_y": "mass length", "inertia_z": "mass length", "origin": "length", "thickness": "length",
    "point": "length", "near": "length", "at": "length", "size": "length", "pitch": "length", "roller_radius": "length", "tip": "",
    "margin": "length", "overlap": "length", "penetration": "length", "stribeck_speed": "length/time", "slip_speed": "length/time",
    "torque": "force length", "pressure": "force/length^2", "rim": "length", "lengths": "length", "curvatures": "1/length",
    "position_tolerance": "length", "through": "length", "angular_stiffness": "force length", "angular_damping": "force length time",
    "lower": "length or radians", "upper": "length or radians", "frequency": "1/time", "frequencies": "1/time", "scale": "length",
    "tangential_stiffness": "force/length", "tangential_damping": "force time/length", "moment": "force length",
    ("forces", "stiffness"): "force/length", ("forces", "damping"): "force time/length", ("forces", "force"): "force",
    ("forces", "preload"): "force", ("forces", "actuator"): "force", ("forces", "rest"): "length", ("forces", "smoothing"): "length",
    ("forces", "rotational-spring", "stiffness"): "force length", ("forces", "rotational-spring", "damping"): "force length time",
    ("forces", "rotational-spring", "preload"): "force length", ("forces", "rotational-spring", "actuator"): "force length",
    ("forces", "rotational-spring", "rest"): "radians", ("forces", "guide", "direction"): "radians", ("contacts", "stiffness"): "force/length",
    ("contacts", "damping"): "force time/length", ("contacts", "smoothing"): "length", ("joints", "rotation-motor", "motion"): "radians",
    ("joints", "translation-motor", "motion"): "length", ("joints", "prescribed", "motion"): "length", ("bodies", "substructure", "mass"): "",
    ("events", "tolerance"): "time", ("surfaces", "divisions"): "", ("integrator", "start"): "time", ("integrator", "end"): "time",
    ("integrator", "step"): "time", ("integrator", "initial_step"): "time", ("integrator", "max_step"): "time",
    ("integrator", "min_step"): "time", ("statics", "time"): "time", ("Damping", "mass"): "1/time", ("Damping", "stiffness"): "time",
    ("Limits", "stiffness"): "force/length or force length", ("Friction", "preload"): "force", ("harmonic", "from"): "1/time",
    ("harmonic", "to"): "1/time", ("SteadyRotation", "speed"): "radians/time", ("Rotation", "angle"): "radians",
    ("harmonic", "points"): "", ("output", "csv_interval"): "time", ("output", "vtu_interval"): "time"}

# Ends of keys of parts that are meshed.
LENGTHS = ("radius", "length", "thickness", "inner", "outer", "lx", "ly", "lz", "shank_big", "shank_small", "waist", "lead", "web_big",
           "web_small", "web_neck", "module", "backlash", "tip_relief")

# Tables inside of parts, and sections of the top: what they are, their readers, and the keys if not all of them.
TABLES = {
    "Rotation": ("Of axes: {axis, angle} in radians, or {quaternion} = [w, x, y, z].", "rotation", "axis angle quaternion"),
    "Material": ("A material in line.", "read_material", ""),
    "Mesh": ("A mesh file, or a part that is meshed.", "read_mesh_source read_block read_rod read_link read_crank read_guide read_rotor"
             " read_tyre read_gear read_divisions", ""),
    "Damping": ("Of a flexible body.", "read_damping rayleigh_of_ratios", "mass stiffness ratio frequencies loss_factor frequency"),
    "Reduction": ("How a flexible body is reduced.", "read_reduction", ""),
    "MatrixFile": ("A matrix of a substructure.", "read_matrix", ""),
    "Node": ("Of a substructure.", "read_node", ""),
    "NodesFile": ("A file with GRID cards.", "read_matrix", "file"),
    "Bore": ("Outer faces on a cylinder.", "read_where", "point axis radius length"),
    "Frame": ("A marker in line.", "read_marker read_attach read_axes read_where",
              "same_as body global point axis x_axis rotation attach node near face nodes edge radius bore most_nodes"),
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
    ("surfaces", "surface", "", "Adds [surfaces.NAME], what a contact may touch, and returns the name."),
    ("contacts", "contact", "", "Adds [contacts.NAME] between surfaces and returns the name."),
    ("materials", "material", "", "Adds [materials.NAME] and returns the name."),
    ("markers", "marker", "", "Adds [markers.NAME], a place with axes, and returns the name."),
    ("splines", "spline", "", "Adds [splines.NAME], a function by points, which expressions call by its name; returns the name."),
    ("events", "event", "", "Adds [events.NAME] and returns the name: what happens when an expression passes through a limit."),
    ("sensors", "sensor", "self, name: str, /, value: Any", "Adds a quantity of its own to [sensors], a number or an expression of"
     " quantities, and returns the name."),
    ("inputs", "input", "self, name: str, /, value: Any = 0.0", "Adds a number to [inputs] that the program sets"
     " (Simulation.set_input), and returns the name."))
