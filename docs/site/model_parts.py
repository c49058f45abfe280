#!/usr/bin/env python3
"""Signatures and lists of keys from the rows of model_keys.py, which are those of the readers of models.

    python3 docs/site/model_parts.py --write     writes python/espalier/_models/parts.py and .pyi, src/dynamics/model/check/part_keys.cpp
    python3 docs/site/model_parts.py --check     says which of them are stale; exit code 1

Which reader belongs to which type of a part stands here, and which keys of a reader with a switch; the tests hold that
against the readers themselves (python/tests/models/test_parts.py): each key of a type is known there, all others are not."""
import keyword
import re
import sys
import textwrap

import model_keys
from model_parts_text import METHODS, PATHS, TABLES

ROOT = model_keys.ROOT
MADE = "Made by docs/site/model_parts.py --write from the calls in the read_*.cpp below src/dynamics/model; do not edit."
_FLEXIBLE = "read_body read_motion read_body_damping "
_FRAMES = "read_frames read_axes"
_SPRING = ("read_spring", "")
_JOINT = "type a b bodies at rotation axis x_axis pull attach active "
_TWO = "type a b bodies at rotation axis x_axis active "
_SURFACE = "body shape "
_SURFACE_READERS = "read_surface read_surface_axes " + " ".join(f"read_{s}_surface" for s in (
    "plane", "sphere", "round", "box", "mesh", "faces", "sprocket", "line"))

# Section: {type: (readers, the keys of them that it has, or "" for all, keys that are needed)}. "" is the only type.
PARTS = {
    "bodies": {
        "rigid": ("read_body read_rigid read_rigid_of_surface read_rigid_motion",
                  "type mass inertia box mesh density position rotation velocity angular_velocity gravity", ""), "point": ("read_body read_point", "", "mass"),
        "solid": (_FLEXIBLE + "read_solid material read_sets", "", "mesh"),
        "cable": (_FLEXIBLE + "read_cable read_lines_of_file material", "", ""),
        "beam": (_FLEXIBLE + "read_axis read_beam read_lines_of_file material", "", ""),
        "shell": (_FLEXIBLE + "read_shell read_thickness read_shell_of_file material", "", ""),
        "substructure": (_FLEXIBLE + "read_substructure read_lines", "gravity type position rotation velocity angular_velocity damping"
                         " reduce stiffness mass nodes lines", "stiffness mass nodes")},
    "joints": {t: (f"read_joint {_FRAMES} read_attach read_distance read_prescribed read_joint_motion read_rolling read_joint_contacts", _JOINT + more, needed) for t, more, needed in (
        ("fixed", "", ""), ("revolute", "limits friction armature", ""), ("spherical", "", ""), ("universal", "", ""),
        ("cylindrical", "limits angle_limits friction", ""), ("prismatic", "limits friction armature", ""), ("planar", "", ""),
        ("point-on-line", "limits friction", ""), ("distance", "length", ""), ("revolute-spherical", "length", ""),
        ("rotation-motor", "motion from", "motion"), ("translation-motor", "motion from", "motion"),
        ("prescribed", "direction motion from", "direction motion"), ("rolling", "shape radius rim", "radius"), ("skate", "", ""))}
    | {t: (f"read_joint {_FRAMES} read_attach read_ratio read_pinion", f"type a b c d {more} pull attach active", f"a b c d {more}")
       for t, more in (("gear", "ratio"), ("rack-and-pinion", "radius"), ("coupled-slides", "ratio"))}
    | {t: (f"read_joint {_FRAMES} read_attach {readers} read_joint_contacts", _JOINT + more, needed) for t, readers, more, needed in (
        ("screw", "read_screw", "lead limits angle_limits friction", "lead"), ("constant-velocity", "", "limits", ""),
        ("parallel-axes", "", "limits friction", ""), ("in-plane", "", "friction", ""), ("in-line", "", "limits friction", ""),
        ("point-on-curve", "read_point_on_curve", "points file scale closed ends motion from limits friction", ""),
        ("point-on-surface", "read_point_on_surface read_sphere read_ellipsoid read_cylinder read_cone read_torus read_heights", "shape radius rim angle half_axes x y heights friction", "shape"),
        ("gear-pair", "read_gear_pair", "teeth inner pressure_angle friction", "teeth"), ("rack-pair", "read_rack_pair", "radius pressure_angle friction", ""),
        ("worm", "read_worm", "lead radius friction", "lead radius"))}
    | {"cable": ("read_joint read_through read_attach read_cable_joint", "type through length pull attach active", "through")},
    "forces": {
        **{t: (f"read_spring read_force {_FRAMES}", _TWO + "stiffness damping rest preload actuator", "")
           for t in ("spring", "axial-spring", "rotational-spring")},
        "bushing": (f"read_bushing read_force {_FRAMES}", _TWO + "stiffness damping angular_stiffness angular_damping", ""),
        "load": ("read_force read_frames read_load read_body_load", "type a force moment factor follower active body element_set acceleration"
                 " force_density angular_velocity point", ""),
        "line-load": ("read_force read_line_load read_where read_nodes read_along", "type body element_set node near face nodes along edge radius bore force moment factor follower active", "body"),
        "pressure": ("read_force read_pressure", "type body face pressure active", "body face pressure"),
        "guide": (f"read_force_guide read_force {_FRAMES}", _TWO + "stiffness damping friction slip_speed smoothing both_sides start direction"
                  " lengths curvatures", "stiffness smoothing lengths curvatures"),
        "cable": ("read_through read_cable_force read_force", "type through stiffness damping length friction slip_speed active", "through stiffness"),
        "torque-motor": (f"read_force read_torque_motor {_FRAMES}", _TWO + "torque", "torque"),
        "force-motor": (f"read_force read_force_motor {_FRAMES}", _TWO + "force", "force")},
    "surfaces": {t: (_SURFACE_READERS, _SURFACE + more, "body " + needed) for t, more, needed in (
        ("plane", "point normal rotation", ""), ("sphere", "point radius", "radius"),
        ("capsule", "point radius length axis rotation", "radius length"), ("cylinder", "point radius length axis rotation", "radius length"),
        ("box", "point size rotation", "size"), ("mesh", "point file scale rotation", "file"), ("faces", "set divisions", ""),
        ("sprocket", "point teeth pitch roller_radius width tip axis rotation", "pitch roller_radius width"),
        ("line", "radius divisions", "radius"))},
    "contacts": {"": ("read_contact read_contact_law", "", "surfaces stiffness")},
    "materials": {"": ("read_material", "", "young")},
    "markers": {"": ("read_marker read_attach read_axes read_where read_nodes read_weights read_along", "same_as body global point axis x_axis rotation attach node near face"
                     " nodes weights along edge radius bore most_nodes", "")},
    "supports": {"": ("read_where read_nodes read_along read_support read_hold read_rotations read_symmetry", "body node near face nodes along edge radius bore hold rotations symmetry"
                      " rotation motion", "body")},
    "equations": {"": ("read_equation", "", "terms")},
    "ties": {"": ("read_where read_nodes read_along read_tie", "body node near face nodes along edge radius bore to tolerance", "body to")},
    "splines": {"": ("read_spline CsvTable", "", "")},
    "events": {"": ("read_condition read_event", "", "when")},
    "controllers": {"": ("read_controller", "", "type file step")},
    "paths": {"": ("read_path", "", "")},
}
SECTIONS = {  # of the top, without names
    "": "read_whole read_bodies read_joints read_forces BodyMaterials read_surfaces read_events read_controllers read_splines read_supports read_equations",
    "integrator": "read_integrator read_bdf read_alpha", "statics": "read_statics read_statics_options", "initial": "read_initial",
    "harmonic": "read_harmonic read_range read_loads", "output": "read_output"}
TYPE_KEY = {"bodies": "type", "joints": "type", "forces": "type", "surfaces": "shape"}
WITHIN = {  # tables that Section and read_motion() of supports read in loops
    "rotation": {"axis": "list of three numbers", "angle": "number", "quaternion": "list of numbers"},
    "motion": {"x": "function of time", "y": "function of time", "z": "function of time"}}
OF_EXPANSION = ("parameters", "repeat")  # gone before the readers come


class Rows:
    """Keys with what is read, in the order of the sources."""

    def __init__(self):
        sections, self.complaints = model_keys.collect()
        self.by_reader = {}
        for (title, _, lines), (_, _, reader, *_) in zip(sections, model_keys.SECTIONS):
            name = "read_force_guide" if title == "Force guide" else reader.removeprefix("class ")
            self.by_reader.setdefault(name, []).extend(lines)
        for reader, keys in WITHIN.items():
            self.by_reader[reader] = [(model_keys.Key(name, kind, "", 0), None) for name, kind in keys.items()]

    def keys(self, readers, chosen=""):
        """{name: (Key, meaning)}, of the first reader that has it."""
        found = {}
        for reader in readers.split():
            for key, said in self.by_reader[reader]:
                found.setdefault(key.name, (key, said[0] if said else ""))
        if not chosen:
            return found
        for word in chosen.split():
            if word not in found:
                self.complaints.append(f"model_parts.py: no reader of {readers} knows '{word}'")
        return {word: found[word] for word in chosen.split() if word in found}


def type_of(section, kind, key):
    """What Python takes for a key."""
    special = {("forces", "force-motor", "force"): "Number", ("forces", "bushing", "stiffness"): "Vector",
               ("forces", "bushing", "damping"): "Vector"}
    by_name = {("bodies", "material"): "str | Material", ("bodies", "materials"): "Mapping[str, str | Material]", ("bodies", "nodes"): "NodesFile | Items[Node]", ("bodies", "mesh"): "Mesh", ("bodies", "thickness"): "Number | Numbers",
               ("bodies", "damping"): "Damping", ("bodies", "reduce"): "Reduction", ("bodies", "erosion"): "Erosion", ("markers", "bore"): "Bore", ("Frame", "bore"): "Bore", ("supports", "bore"): "Bore",
               ("supports", "motion"): "Displacements", ("supports", "symmetry"): "str | Vector", ("joints", "limits"): "Limits",
               ("joints", "angle_limits"): "Limits", ("joints", "friction"): "Friction", ("joints", "through"): "Items[str | Frame]", ("forces", "through"): "Items[str | Frame]", ("joints", "heights"): "Items[Numbers]", ("splines", "points"): "Points",
               ("splines", "x"): "Whole", ("splines", "y"): "Whole", ("events", "set"): "Mapping[str, Number]", ("Damping", "ratio"): "Number | Numbers",
               ("initial", "rotation"): "SteadyRotation", ("initial", "statics"): "bool | Statics", ("output", "paths"): "Mapping[str, Mapping[str, Any]]",
               ("harmonic", "loads"): "Texts | Mapping[str, Any]", ("Bore", "radius"): "Number", ("markers", "nodes"): "str | Items[Whole]", ("supports", "nodes"): "str | Items[Whole]", ("ties", "nodes"): "str | Items[Whole]", ("ties", "bore"): "Bore", ("forces", "nodes"): "str | Items[Whole]", ("forces", "bore"): "Bore", ("ties", "to"): "Mapping[str, Any]", ("equations", "terms"): "Items[Mapping[str, Any]]", ("Frame", "nodes"): "str | Items[Whole]", ("events", "when"): "str"}
    if (section, kind) == ("bodies", "substructure") and key.name in ("stiffness", "mass"):
        return "MatrixFile"
    if (section, kind, key.name) in special:
        return special[section, kind, key.name]
    if (section, key.name) in by_name:
        return by_name[section, key.name]
    if key.name == "file":
        return "str | PathLike[str]"
    if key.kind.startswith("one of"):
        return "Literal[" + ", ".join(f'"{n}"' for n in re.findall(r"`([^`]+)`", key.kind)) + "]"
    plain = {"number": "Number", "number > 0": "Number", "number >= 0": "Number", "function of time": "Number", "expression": "Number",
             'number, or "initial"': "Number", "time, 0 or false": "Number | bool", "whole number": "Whole", "true or false": "bool",
             "text": "str", "list of texts": "Texts", "list of numbers": "Numbers", "list of three numbers": "Vector",
             "three numbers or expressions": "Vector", "list of points": "Points", "three numbers, or a 3 x 3 matrix": "Numbers | Points",
             "rotation": "Vector | Rotation", "a marker's name or a table": "str | Frame"}
    return plain.get(key.kind, "Any")


def plain_words(text):
    """The first sentence of a meaning of the guide, without markup."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text.replace("\\|", "|").replace("`", ""))
    text = "" if text.startswith("below") else re.split(r"(?<=[a-z0-9)])\. (?=[A-Z])|; (?=\w+ \w+ \w+)", text)[0].rstrip(".")
    return text.replace("\\", "").replace('"""', "'")


def dimension_rows():
    """(tables, condition, keys, dimension) of units/key_dimensions.cpp."""
    text = (model_keys.MODEL / "units/key_dimensions.cpp").read_text()
    names = dict(re.findall(r'(k\w+) = "([^"]*)"', text))
    rows = re.findall(r'\{("[^"]*"|k\w+),\s*"([^"]*)",\s*"([^"]*)",\s*"([^"]*)"\}', text)
    return [(names.get(tables, tables.strip('"')), where, keys.split(), dimension) for tables, where, keys, dimension in rows]


def dimension_of(section, kind, name):
    """In words, "length^2 or 1/time"; "" for plain numbers, and where it depends on the type that is not said."""
    path = PATHS.get(section, f"{section}.*").split(".")
    found = []
    for tables, where, keys, dimension in dimension_rows():
        parts = tables.split(".")
        if name not in keys or len(parts) != len(path) or not all(p == "*" or p in given.split("|") for p, given in zip(path, parts)):
            continue
        if where and kind and kind not in where.partition("=")[2].split("|"):
            continue
        found += [d for d in dimension.split("|") if d not in found]
        if not where or kind:
            break
    return " or ".join(found).replace("*", " ") if found not in ([], ["1"], ["any"]) else ""


def told(section, kind, name, row, needed):
    """One key in a docstring."""
    key, meaning = row
    dimension = dimension_of(section, kind, name)
    default = key.default
    if default == "needed" and name not in needed:
        default = ""
    state = "needed" if name in needed else f"default {default}" if default not in ("", "needed") else ""
    words = type_words(section, kind, key)
    return f"{name}: " + ", ".join(w for w in (words + (f" [{dimension}]" if dimension else ""), state) if w) + (
        f". {plain_words(meaning)}" if plain_words(meaning) else "")


def type_words(section, kind, key):
    special = {"MatrixFile": "{file, name}", "Number": "number or expression"}
    if (section, kind, key.name) == ("forces", "force-motor", "force") or (section, kind) == ("bodies", "substructure") and key.name in ("stiffness", "mass"):
        return special[type_of(section, kind, key)]
    names = {"str | Material": "a name of [materials] or {young, poisson, density, law}", "Points": "list of points",
             "NodesFile | Items[Node]": "list of {label, position, components}, or {file}", "Whole": "name or number of a column", "str | Items[Whole]": "a name or a list of labels",
             "Mapping[str, Number]": "{input: value}", "Displacements": "{x, y, z}"}
    said = type_of(section, kind, key)
    if said in TABLES:
        return "{" + ", ".join(TABLES[said][2].split() or ["..."]) + "}"
    if key.kind in ("", "table"):
        return names.get(said, "table")
    return key.kind.replace("`", "")


def wrapped(lines, indent):
    return "\n".join(textwrap.fill(line, 118, initial_indent=indent, subsequent_indent=indent + "    ", break_long_words=False,
                                   break_on_hyphens=False) for line in lines)


def parameters(section, kind, keys, needed):
    """Keywords of a signature; `from`, `global` and `self` are written `from_`, `global_`, `self_`."""
    out = []
    for name, (key, _) in keys.items():
        if name == TYPE_KEY.get(section):
            continue
        python = name + "_" if keyword.iskeyword(name) or name == "self" else name
        out.append(f"{python}: {type_of(section, kind, key)}" + ("" if name in needed else " = ..."))
    return sorted(out, key=lambda p: p.endswith("= ..."))


def signature(method, head, words, indent="    "):
    flat = f"{indent}def {method}({', '.join([*head, *words])}) -> str:"
    if len(flat) <= 118:
        return flat
    return f"{indent}def {method}(\n" + textwrap.fill(", ".join([*head, *words]), 118, initial_indent=indent * 2, subsequent_indent=indent * 2,
                                                 break_long_words=False, break_on_hyphens=False) + f"\n{indent}) -> str:"


def typed_dict(rows, name):
    meaning, readers, chosen = TABLES[name]
    keys = rows.keys(readers, chosen)
    section = {"Integrator": "integrator", "Statics": "statics", "Initial": "initial", "Output": "output", "HarmonicKeys": "harmonic"}.get(name, name)
    members = {n: type_of(section, "", row[0]) for n, row in keys.items()}
    doc = wrapped([meaning, *(told(section, "", n, row, ()) for n, row in keys.items())], "    ")
    if any(keyword.iskeyword(n) for n in members):
        return f'{name} = TypedDict("{name}", {{' + ", ".join(f'"{n}": {t}' for n, t in members.items()) + f'}}, total=False)\n"""{doc.lstrip()}"""\n'
    return f'class {name}(TypedDict, total=False):\n    """' + doc.lstrip() + '\n    """\n\n' + "".join(f"    {n}: {t}\n" for n, t in members.items())


def stub(rows):
    out = [f'"""{MADE}"""\n', (ROOT / "docs/site/model_parts_head.txt").read_text()]
    out += [typed_dict(rows, name) + "\n" for name in TABLES]
    out.append("class Parts:")
    out.append("    def part(self, section: str, name: str, /, keys: Any) -> str: ...")
    for section, method, head, _ in METHODS:
        if section not in PARTS:
            out.append(f"    def {method}({head}) -> str: ...")
            continue
        several = len(PARTS[section]) > 1
        for kind, (readers, chosen, needed) in PARTS[section].items():
            keys = rows.keys(readers, chosen)
            words = parameters(section, kind, keys, needed.split())
            first = ["self", "name: str", "/"]
            if several:
                given = f'{TYPE_KEY[section]}: Literal["{kind}"]' + (" = ..." if kind == "rigid" else "")
                words = [given, "*", *words]
                out.append("    @overload")
            else:
                words = ["*", *words]
            out.append(signature(method, first, words))
            lines = [told(section, kind, n, row, needed.split()) for n, row in keys.items() if n != TYPE_KEY.get(section)]
            title = f"Adds [{section}.NAME]" + (f", {TYPE_KEY[section]} \"{kind}\"" if several else "") + ", and returns the name."
            out.append('        """' + title + "\n\n" + wrapped(lines, "        ") + '\n        """')
    return "\n".join(out) + "\n"


def runtime(rows):
    out = [f'"""{MADE}"""\n', "from typing import Any\n\n",
           "class Parts:", '    """The calls that add a named part to a model; signatures by type stand in parts.pyi."""\n',
           "    def part(self, section: str, name: str, /, keys: Any) -> str:", "        \"\"\"See Model.part().\"\"\"\n        raise NotImplementedError\n"]
    for section, method, head, words in METHODS:
        several = section in TYPE_KEY
        lines = []
        for kind, (readers, chosen, needed) in PARTS.get(section, {}).items():
            keys = rows.keys(readers, chosen)
            told_keys = [told(section, kind, n, row, needed.split()) for n, row in keys.items() if n != TYPE_KEY.get(section)]
            if several:
                known = [line for line in told_keys if line not in lines]
                old = [line.partition(":")[0] for line in told_keys if line in lines]
                lines += ["", f'{TYPE_KEY[section]} "{kind}"' + (f" ({', '.join(old)} as above)" if old else "") + ":" * bool(known), *known]
            else:
                lines += ["", *told_keys]
        body = wrapped_text(words, lines)
        name = {"bodies": 'type: str = "rigid"', "joints": "type: str", "forces": "type: str", "surfaces": "shape: str"}.get(section)
        if section not in PARTS:
            out.append(f'    def {method}({head}) -> str:\n        """{words}"""\n        return self.part("{section}", name, value)\n')
            continue
        given = ", ".join(["self", "name: str", "/", *([name] if name else []), "**keys: Any"])
        content = f'{{"{TYPE_KEY[section]}": {TYPE_KEY[section]}, **keys}}' if several else "keys"
        out.append(f'    def {method}({given}) -> str:\n        """{body}\n        """\n        return self.part("{section}", name, {content})\n')
    return "\n".join(out).rstrip() + "\n"


def wrapped_text(words, lines):
    head = textwrap.fill(words, 112, subsequent_indent="        ")
    return head + "\n" + "\n".join("" if not line else wrapped([line], "        ") for line in lines)


def table(rows):
    """part_keys.cpp."""
    found = []
    for section, readers in SECTIONS.items():
        found.append((section, "", " ".join([*rows.keys(readers), *(OF_EXPANSION + ("solver",) if not section else ())])))
    for section, kinds in PARTS.items():
        for kind, (readers, chosen, _) in kinds.items():
            found.append((section, kind, " ".join(rows.keys(readers, chosen))))
    out = [f"// {MADE}", "// clang-format off", '#include "dynamics/model/check/part_keys.hpp"', "", "namespace espalier::dynamics::model {", "",
           "std::span<const PartKeys> all_part_keys() {", "  static constexpr PartKeys kPartKeys[] = {"]
    for section, kind, keys in found:
        words = list(dict.fromkeys(keys.split()))
        text = textwrap.wrap(" ".join(words), 100)
        out.append(f'      {{"{section}", "{kind}",')
        out += [f'       "{line}{" " if k + 1 < len(text) else ""}"' for k, line in enumerate(text)]
        out[-1] += "},"
    out += ["  };", "  return kPartKeys;", "}", "", "}  // namespace espalier::dynamics::model", ""]
    return "\n".join(out)


def collect():
    """({path: content}, complaints)."""
    rows = Rows()
    made = {"python/espalier/_models/parts.pyi": stub(rows), "python/espalier/_models/parts.py": runtime(rows),
            "src/dynamics/model/check/part_keys.cpp": table(rows)}
    for section, kinds in PARTS.items():
        known = {name for readers, chosen, _ in kinds.values() for name in rows.keys(readers, chosen)}
        for reader in {r for readers, _, _ in kinds.values() for r in readers.split()}:
            for key, _ in rows.by_reader[reader]:
                if key.name not in known and (section, reader, key.name) not in NESTED:
                    rows.complaints.append(f"model_parts.py: to which type of [{section}] does '{key.name}' of {reader} belong?")
    return made, rows.complaints


# Keys of a table inside, whose reader is that of the part.
NESTED = {("markers", "read_marker", "name"), ("bodies", "read_substructure", "file"), ("markers", "read_where", "length"), ("supports", "read_where", "length"),
          ("supports", "read_where", "point"), ("supports", "read_where", "axis"), ("ties", "read_where", "length"),
          ("ties", "read_where", "point"), ("ties", "read_where", "axis"), ("ties", "read_tie", "face"),
          ("forces", "read_frames", "c"), ("forces", "read_frames", "d")}


def stale():
    """What is wrong, and which of the made files are not what would be made."""
    made, complaints = collect()
    return complaints + [f"{path} is not what the readers have: python3 docs/site/model_parts.py --write" for path, content in made.items()
                         if not (ROOT / path).exists() or (ROOT / path).read_text() != content]


def main():
    if "--write" in sys.argv:
        for path, content in collect()[0].items():
            (ROOT / path).write_text(content)
    complaints = stale()
    for c in complaints:
        print(c, file=sys.stderr)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
