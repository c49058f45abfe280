#!/usr/bin/env python3
"""Public robots (URDF, MJCF) as espalier reads them, against MuJoCo: masses, inertias, joint axes, gravity torques, mass matrix and
bias forces, and one second of free motion.

    pip install mujoco; pip download --no-deps example-robot-data dm_control gymnasium gymnasium-robotics robosuite
    python3 bench/dynamics/robots_truth.py FOLDER [--motion] [--only PATTERN]

FOLDER holds the unpacked packages; robots that are not there are skipped, and counted. What is compared is the text of the model
(bodies and frames of joints), by this program's own recursion over the tree, at three random states; and, with --motion, what
espalier.Simulation makes of it: its difference, beside the error of MuJoCo's steps and by how much a change of the velocities at the start
has grown in the end. Exit code 1: a model differs by more than 1e-9, or no robot was found.
"""
import argparse
import re
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np

ROBOTS = [  # paths in the unpacked packages
    *(f"dm_control/dm_control/suite/{n}.xml" for n in (
        "acrobot", "cartpole", "cheetah", "finger", "fish", "hopper", "humanoid", "humanoid_CMU", "pendulum", "quadruped", "reacher", "swimmer",
        "walker", "dog", "stacker", "ball_in_cup", "point_mass")),
    *(f"gymnasium/gymnasium/envs/mujoco/assets/{n}.xml" for n in ("ant", "half_cheetah", "humanoid", "hopper", "walker2d_v5", "pusher_v5",
                                                                    "inverted_double_pendulum", "swimmer")),
    "gymnasium_robotics/gymnasium_robotics/envs/assets/fetch/reach.xml",
    "gymnasium_robotics/gymnasium_robotics/envs/assets/hand/reach.xml",
    "gymnasium_robotics/gymnasium_robotics/envs/assets/adroit_hand/adroit_door.xml",
    "dm_control/dm_control/third_party/kinova/jaco_arm.xml",
    "dm_control/dm_control/third_party/ant/ant.xml",
    "dm_control/dm_control/locomotion/walkers/assets/rodent.xml",
    *(f"robosuite/robosuite/models/assets/robots/{n}/robot.xml" for n in ("panda", "sawyer", "ur5e", "iiwa", "jaco", "kinova3", "baxter", "tiago", "spot", "gr1")),
]
URDF = "example_robot_data"
FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's mjtJoint


def rotation(q):
    w, x, y, z = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def about(axis, angle):
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


class Tree:
    """The model's bodies and joints; body k hangs on joint k of MuJoCo."""

    def __init__(self, tree, mj):
        names = list(tree["bodies"])
        assert len(names) == mj.njnt, f"{len(names)} bodies, {mj.njnt} joints"
        self.bodies, self.gravity, self.mj = [], np.array(tree["gravity"], float), mj
        first = {}
        for n, j in tree.get("joints", {}).items():  # the first that leads to a body is the tree's, others close loops
            if j["type"] in ("revolute", "prismatic", "spherical"):
                first.setdefault(j["b"]["body"], j)
        for k, name in enumerate(names):
            body = tree["bodies"][name]
            entry = {"mass": body["mass"], "inertia": np.array(body["inertia"], float), "joint": None, "parent": -1,
                     "start": (np.array(body["position"], float), rotation(body["rotation"]["quaternion"]))}
            if mj.jnt_type[k] == FREE:
                o, r = mj.qpos0[mj.jnt_qposadr[k]:][:3], rotation(mj.qpos0[mj.jnt_qposadr[k] + 3:][:4])
                entry["centre"] = entry["start"][1].T @ (entry["start"][0] - o)
                assert np.allclose(r, entry["start"][1], atol=1e-12)
            else:
                j = first[name]
                entry["joint"] = j
                entry["parent"] = -1 if j["a"]["body"] == "ground" else names.index(j["a"]["body"])
                entry["a"] = (np.array(j["a"]["point"], float), rotation(j["a"]["rotation"]["quaternion"]))
                entry["b"] = (np.array(j["b"]["point"], float), rotation(j["b"]["rotation"]["quaternion"]))
                entry["armature"] = j.get("armature", 0.0)
            self.bodies.append(entry)

    def evaluate(self, q, v):
        """Mass matrix and bias forces."""
        mj, nv = self.mj, self.mj.nv
        zero = np.zeros(3)
        m, bias, state = np.zeros((nv, nv)), np.zeros(nv), []
        for k, b in enumerate(self.bodies):
            qa, va = mj.jnt_qposadr[k], mj.jnt_dofadr[k]
            if b["parent"] >= 0:
                c, r, w, al, vc, ac, jv, jw = state[b["parent"]]
            else:
                c, r, w, al, vc, ac, jv, jw = zero, np.eye(3), zero, zero, zero, zero, np.zeros((3, nv)), np.zeros((3, nv))
            jv, jw = jv.copy(), jw.copy()
            if b["joint"] is None:
                r = rotation(q[qa + 3:qa + 7])
                arm = r @ b["centre"]
                c, w = q[qa:qa + 3] + arm, r @ v[va + 3:va + 6]
                al, ac = zero, np.cross(w, np.cross(w, arm))
                jv[:], jw[:] = 0, 0
                jv[:, va:va + 3] = np.eye(3)
                jw[:, va + 3:va + 6] = r
                for i in range(3):
                    jv[:, va + 3 + i] = np.cross(r[:, i], arm)
            else:
                pa, ra = b["a"]
                z = r @ ra[:, 2]
                s, kind = r @ pa, b["joint"]["type"]
                if kind == "prismatic":
                    s = s + z * q[qa]
                as_ = ac + np.cross(al, s) + np.cross(w, np.cross(w, s))
                jv = jv + np.array([np.cross(jw[:, i], s) for i in range(nv)]).T
                anchor = c + s
                if kind == "prismatic":
                    as_ = as_ + 2 * np.cross(w, z * v[va])
                    jv[:, va] = z
                    r = r @ ra @ b["b"][1].T
                elif kind == "revolute":
                    r = r @ ra @ about(np.array([0, 0, 1.0]), q[qa]) @ b["b"][1].T
                    al = al + np.cross(w, z * v[va])
                    w = w + z * v[va]
                    jw[:, va] = z
                else:
                    r = r @ ra @ rotation(q[qa:qa + 4]) @ b["b"][1].T
                    spin = r @ v[va:va + 3]
                    al = al + np.cross(w, spin)
                    w = w + spin
                    jw[:, va:va + 3] = r
                arm = -r @ b["b"][0]
                c = anchor + arm
                ac = as_ + np.cross(al, arm) + np.cross(w, np.cross(w, arm))
                jv = jv + np.array([np.cross(jw[:, i], arm) for i in range(nv)]).T
            state.append((c, r, w, al, None, ac, jv, jw))
            inertia = r @ b["inertia"] @ r.T
            m += b["mass"] * jv.T @ jv + jw.T @ inertia @ jw
            if b.get("armature"):
                m[va, va] += b["armature"]
            bias += jv.T @ (b["mass"] * (ac - self.gravity)) + jw.T @ (inertia @ al + np.cross(w, inertia @ w))
        return m, bias


def random_state(mj, generator):
    q, v = mj.qpos0.copy(), generator.uniform(-1, 1, mj.nv)
    for k in range(mj.njnt):
        a, kind = mj.jnt_qposadr[k], mj.jnt_type[k]
        if kind in (HINGE, SLIDE):
            q[a] += generator.uniform(-0.5, 0.5)
        else:
            at = a + (3 if kind == FREE else 0)
            turn = generator.normal(size=4)
            q[at:at + 4] = turn / np.linalg.norm(turn)
    return q, v


def truth_of(mj, q, v):
    data = mujoco.MjData(mj)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(mj, data)
    m = np.zeros((mj.nv, mj.nv))
    try:
        mujoco.mj_fullM(mj, m, data.qM)
    except (TypeError, AttributeError):
        mujoco.mj_fullM(mj, data, m)
    return m, data.qfrc_bias.copy()


def mujoco_of(path):
    """MuJoCo's model; of URDF without shapes, since it would give links without <inertial> masses of them."""
    if path.suffix == ".urdf":
        text = path.read_text()
        text = re.sub(r"<(visual|collision)\b[^>]*/>|<(visual|collision)\b.*?</\2>", "", text, flags=re.S)
        text = re.sub(r"(<robot\b[^>]*>)", r'\1<mujoco><compiler fusestatic="false" balanceinertia="false" inertiafromgeom="false"/></mujoco>', text, count=1)
        return mujoco.MjModel.from_xml_string(text)
    return mujoco.MjModel.from_xml_path(str(path))


def compare(path, espalier):
    mj = mujoco_of(path)
    mj.opt.density = mj.opt.viscosity = 0  # no fluid
    load = espalier.Model.from_urdf if path.suffix == ".urdf" else espalier.Model.from_mjcf
    model = load(path, geometry=False)
    tree = Tree(model.tree, mj)
    moving = [k for k in range(1, mj.nbody) if mj.body_weldid[k] > 0 and mj.body_mocapid[mj.body_weldid[k]] < 0]
    weight = 9.81 * mj.body_mass[moving].sum()
    generator, worst_m, worst_b = np.random.default_rng(1), 0.0, 0.0
    for _ in range(3):
        q, v = random_state(mj, generator)
        for speed in (0 * v, v):
            m, bias = tree.evaluate(q, speed)
            m0, bias0 = truth_of(mj, q, speed)
            size = np.sqrt(np.outer(np.diag(m0), np.diag(m0)))
            worst_m = max(worst_m, np.max(np.abs(m - m0) / size))
            worst_b = max(worst_b, np.max(np.abs(bias - bias0)) / max(np.max(np.abs(bias0)), 1e-3 * weight))
    mass = abs(sum(b["mass"] for b in tree.bodies) - mj.body_mass[moving].sum()) / mj.body_mass[moving].sum()
    return mj, model, mass, worst_m, worst_b


def places(mj, data):
    """Coordinates of hinges and slides; of other joints the centre of what is welded to their body, None where it has no mass."""
    found = []
    for k in range(mj.njnt):
        if mj.jnt_type[k] in (HINGE, SLIDE):
            found.append(data.qpos[mj.jnt_qposadr[k]].copy())
            continue
        group = [i for i in range(mj.nbody) if mj.body_weldid[i] == mj.jnt_bodyid[k]]
        mass = mj.body_mass[group]
        found.append((data.xipos[group] * mass[:, None]).sum(0) / mass.sum() if mass.sum() > 0 else None)
    return found


def difference(one, other):
    return max((float(np.max(np.abs(x - y))) for x, y in zip(one, other, strict=True) if x is not None and y is not None), default=0.0)


def combined(one, other, weight):
    """other + weight (other - one): without the leading error of the method."""
    return [None if x is None else y + weight * (y - x) for x, y in zip(one, other)]


def moved(mj, start, step, end, nudge=0.0):
    """After a free motion; None where MuJoCo says that it is unstable."""
    mj.opt.timestep = step
    data = mujoco.MjData(mj)
    data.qpos[:], data.qvel[:] = start
    data.qvel[:] += nudge * np.random.default_rng(5).choice([-1.0, 1.0], mj.nv)
    for _ in range(round(end / step)):
        mujoco.mj_step(mj, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number:
            return None
    mujoco.mj_forward(mj, data)
    return places(mj, data)


def truth_of_motion(mj, start, end):
    """MuJoCo's motion without the leading error of its steps, what is left of that, and by how much a change of the velocities at the
    start has grown in the end. Runge and Kutta's steps; where dampers are too stiff for them the implicit method, of first order."""
    mj.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    coarse, fine = (moved(mj, start, h, end) for h in (1e-4, 5e-5))
    nudge = 1e-9
    if coarse is not None and fine is not None:
        grown = moved(mj, start, 1e-4, end, nudge)
        return combined(coarse, fine, 1 / 15), difference(coarse, fine) / 15, difference(coarse, grown) / nudge, "rk4"
    mj.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT
    coarse, middle, fine = (moved(mj, start, h, end) for h in (4e-4, 2e-4, 1e-4))
    grown = moved(mj, start, 1e-4, end, nudge)
    one, two = combined(coarse, middle, 1), combined(middle, fine, 1)
    return combined(one, two, 1 / 3), difference(one, two), difference(fine, grown) / nudge, "implicit"


def motion(path, mj, espalier, relative=1e-10, end=1.0):
    """Difference of the coordinates after a free motion (no contacts, limits, friction loss, actuators, equalities, tendons), with what is
    unsure of MuJoCo's and the growth of a change."""
    generator = np.random.default_rng(2)
    hinges = [k for k in range(mj.njnt) if mj.jnt_type[k] in (HINGE, SLIDE)]
    data = mujoco.MjData(mj)
    names = {k: mj.joint(k).name for k in hinges}
    positions, velocities = {}, {}
    for k in hinges:
        if not names[k]:
            continue
        positions[names[k]] = data.qpos[mj.jnt_qposadr[k]] = mj.qpos0[mj.jnt_qposadr[k]] + generator.uniform(-0.2, 0.2)
        velocities[names[k]] = data.qvel[mj.jnt_dofadr[k]] = generator.uniform(-0.2, 0.2)
    load = espalier.Model.from_urdf if path.suffix == ".urdf" else espalier.Model.from_mjcf
    model = load(path, geometry=False, positions=positions, velocities=velocities)
    tree = model.tree
    if any(j["type"] in ("gear", "coupled-slides", "rack-and-pinion") for j in tree.get("joints", {}).values()):
        return None  # they begin where the coupling has them, MuJoCo's where they are put
    bodies = list(tree["bodies"])
    kept, first = {}, set()
    for n, j in tree.get("joints", {}).items():
        if j["type"] in ("revolute", "prismatic", "spherical") and j["b"]["body"] not in first:
            first.add(j["b"]["body"])
            j.pop("limits", None)
            kept[n] = j
    tree["joints"] = kept
    tree["forces"] = {n: f for n, f in tree.get("forces", {}).items() if n.endswith(("_spring", "_lift"))}
    for key in ("sensors", "inputs", "contacts", "surfaces", "markers"):
        tree.pop(key, None)
    tree["integrator"] = {"end": end, "relative": relative, "absolute": relative, "absolute_velocity": 10 * relative}
    of_joint = {j["b"]["body"]: (n, j["type"]) for n, j in kept.items()}
    wanted = [f"{of_joint[b][0]}.{'angle' if of_joint[b][1] == 'revolute' else 'displacement'}" if b in of_joint and of_joint[b][1] != "spherical"
              else f"{b}.position" for b in bodies]
    tree["output"] = {"quantities": wanted, "csv_interval": False}
    simulation = espalier.Simulation(model)
    simulation.run(progress=False)
    heaviest = max(body["mass"] for body in tree["bodies"].values())
    found = [simulation.value(q) if not q.endswith(".position")
             else None if tree["bodies"][b]["mass"] < 1e-9 * heaviest  # between two joints
             else np.array([simulation.value(f"{q}.{c}") for c in "xyz"]) for b, q in zip(bodies, wanted)]
    flags = mujoco.mjtDisableBit
    mj.opt.disableflags |= (flags.mjDSBL_CONTACT | flags.mjDSBL_LIMIT | flags.mjDSBL_FRICTIONLOSS | flags.mjDSBL_EQUALITY | flags.mjDSBL_ACTUATION)
    mj.tendon_stiffness[:], mj.tendon_damping[:] = 0, 0
    truth, unsure, growth, how = truth_of_motion(mj, (data.qpos.copy(), data.qvel.copy()), end)
    return difference(found, truth), unsure, growth, how


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--motion", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--relative", type=float, default=1e-10, help="tolerance of our motions")
    options = parser.parse_args()
    import espalier

    paths = [options.folder / r for r in ROBOTS] + sorted((options.folder / URDF).rglob("*.urdf"))
    paths = [p for p in paths if options.only in str(p)]
    found = good = same = sensitive = 0
    for path in paths:
        short = "/".join(path.parts[-3:])
        if not path.exists():
            print(f"skipped   {short}: not there")
            continue
        try:
            mj = mujoco_of(path)
        except Exception as error:  # MuJoCo does not read it: there is no truth
            print(f"skipped   {short}: MuJoCo: {str(error)[:90]!r}")
            continue
        if mj.nv == 0:
            print(f"skipped   {short}: nothing moves in it")
            continue
        found += 1
        try:
            mj, _, mass, m, bias = compare(path, espalier)
            fine = max(mass, m, bias) < 1e-9
            line = f"{short}: {mj.nv} velocities, mass {mass:.1e}, M {m:.1e}, bias {bias:.1e}"
            if options.motion and fine:
                result = motion(path, mj, espalier, options.relative)
                if result is None:
                    line += ", coupled joints: no free motion"
                else:
                    error, unsure, growth, how = result
                    equal = error < 1e-6
                    explained = not equal and error < 10 * (unsure + options.relative * growth)
                    same, sensitive = same + equal, sensitive + explained
                    line += f", motion {error:.1e} (MuJoCo's own {unsure:.1e}, {how}; a change grows {growth:.1e} times)"
                    line += "" if equal else ", within them" if explained else ", NOT EXPLAINED"
            good += fine
            print("equal    " if fine else "DIFFERENT", line, flush=True)
        except Exception as error:
            print(f"REFUSED   {short}: {type(error).__name__}: {str(error)[:300]}", flush=True)
    print(f"{good} of {found} robots equal to 1e-9" + (f", {same} motions to 1e-6, {sensitive} more as near as their sensitivity lets them" if options.motion else ""))
    return 0 if found and good == found else 1


if __name__ == "__main__":
    sys.exit(main())
