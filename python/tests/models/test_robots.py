"""Robots of URDF and MJCF. Truth: closed forms of pendulums, sliders and loops, by hand; what public robots say stands in
bench/dynamics/robots_truth.py, beside MuJoCo."""

import math

import numpy as np
import pytest

import espalier as esp

MASS, LENGTH, INERTIA, G = 2.0, 0.5, 0.05, 9.81  # of a pendulum about its centre, which is LENGTH from the pin
PIN = INERTIA + MASS * LENGTH**2


def urdf(tmp_path, inside, name="robot.urdf", head='<robot name="arm">'):
    path = tmp_path / name
    path.write_text(f"{head}{inside}</robot>")
    return path


def link(name, mass=MASS, inertia=INERTIA, at="0 0 -0.5", more=""):
    return (f'<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}"/>'
            f"</inertial>{more}</link>")


def joint(name, parent, child, kind="continuous", axis="0 1 0", more="", at="0 0 0"):
    return (f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/><axis xyz="{axis}"/>{more}</joint>')


def pendulum(tmp_path, more=""):
    return urdf(tmp_path, '<link name="base"/>' + link("bob") + joint("hinge", "base", "bob", more=more))


def mjcf(tmp_path, inside, name="robot.xml"):
    path = tmp_path / name
    path.write_text(f'<mujoco model="m"><compiler angle="radian"/>{inside}</mujoco>')
    return path


BOB = '<inertial pos="0 0 -0.5" mass="2" diaginertia="0.05 0.05 0.05"/>'


def run(model, quantities, end=0.5, **keys):
    model.tree["integrator"] = {"end": end, "relative": 1e-9, "absolute": 1e-10, "absolute_velocity": 1e-9, **keys}
    model.tree["output"] = {"quantities": list(quantities), "csv_interval": False}
    simulation = esp.Simulation(model)
    summary = simulation.run(progress=False).summary
    return [simulation.value(q) for q in quantities], summary


def swing(angle, torque=lambda t, q, w: 0.0, inertia=PIN, end=0.5, speed=0.0):
    """The pendulum by steps of Runge and Kutta."""
    n = 4000
    h, x = end / n, np.array([angle, speed])
    f = lambda t, y: np.array([y[1], (torque(t, *y) - MASS * G * LENGTH * math.sin(y[0])) / inertia])  # noqa: E731
    for k in range(n):
        t = k * h
        a = f(t, x)
        b = f(t + h / 2, x + h / 2 * a)
        c = f(t + h / 2, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + f(t + h, x + h * c))
    return x


def test_pendulum_with_damping_and_start(tmp_path):
    model = esp.Model.from_urdf(pendulum(tmp_path, '<dynamics damping="0.4"/>'), positions={"hinge": 0.7}, velocities={"hinge": -0.3})
    (angle, speed), _ = run(model, ["hinge.angle", "hinge.angular_speed"])
    assert np.allclose([angle, speed], swing(0.7, lambda t, q, w: -0.4 * w, speed=-0.3), atol=1e-6)


def test_friction_loss_and_armature(tmp_path):
    path = mjcf(tmp_path, f'<worldbody><body name="bob"><joint name="hinge" axis="0 1 0" armature="0.3" frictionloss="0.5"/>{BOB}</body></worldbody>')
    (angle,), _ = run(esp.Model.from_mjcf(path, positions={"hinge": 1.0}), ["hinge.angle"])
    assert angle == pytest.approx(swing(1.0, lambda t, q, w: -0.5 * math.tanh(w / 1e-2), PIN + 0.3)[0], abs=2e-6)


def test_slide_with_armature_spring_and_ref(tmp_path):
    path = mjcf(tmp_path, '<option gravity="0 0 0"/><worldbody><body name="cart"><joint name="rail" type="slide" axis="1 0 0" stiffness="50" springref="0.2" ref="0.1" '
                'armature="1"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody>')
    (x, place), summary = run(esp.Model.from_mjcf(path), ["rail.displacement", "cart.position.x"])
    assert x == pytest.approx(0.2 - 0.1 * math.cos(math.sqrt(50 / 3) * 0.5), abs=1e-7)
    assert place == pytest.approx(x - 0.1, abs=1e-12)
    assert summary["energy"]["end"]["total"] == pytest.approx(summary["energy"]["begin"]["total"], abs=1e-7)


@pytest.mark.parametrize("kind, force", [("motor", lambda u, q, w: 3 * min(max(u, -1), 1)),
                                         ("position", lambda u, q, w: 3 * (40 * u - 40 * 3 * q - 2 * 3 * w)),
                                         ("velocity", lambda u, q, w: 3 * 2 * (u - 3 * w))])
def test_actuators(tmp_path, kind, force):
    keys = {"motor": 'ctrlrange="-1 1"', "position": 'kp="40" kv="2"', "velocity": 'kv="2"'}[kind]
    path = mjcf(tmp_path, f'<worldbody><body name="bob"><joint name="hinge" axis="0 1 0"/>{BOB}</body></worldbody>'
                f'<actuator><{kind} name="drive" joint="hinge" gear="3" {keys}/></actuator>'
                '<keyframe><key name="home" qpos="0.4" qvel="0.1" ctrl="1.7"/></keyframe>')
    (angle,), _ = run(esp.Model.from_mjcf(path, keyframe="home"), ["hinge.angle"])
    assert angle == pytest.approx(swing(0.4, lambda t, q, w: force(1.7, q, w), speed=0.1)[0], abs=1e-6)


def test_classes_includes_and_frames(tmp_path):
    (tmp_path / "defaults.xml").write_text('<mujoco><default><joint damping="0.4"/><default class="soft"><joint damping="0.1" axis="0 1 0"/></default></default></mujoco>')
    path = mjcf(tmp_path, '<include file="defaults.xml"/><worldbody><frame pos="0 0 3" euler="0 0 1.5707963267948966"><body name="bob" childclass="soft">'
                f'<joint name="hinge"/>{BOB}<site name="tip" pos="0 0 -1"/></body></frame></worldbody>')
    model = esp.Model.from_mjcf(path, positions={"hinge": 0.7})
    (angle, x, y, z), _ = run(model, ["hinge.angle", "tip.position.x", "tip.position.y", "tip.position.z"])
    assert angle == pytest.approx(swing(0.7, lambda t, q, w: -0.1 * w)[0], abs=1e-6)
    assert np.allclose([x, y, z], [0, -math.sin(angle), 3 - math.cos(angle)], atol=1e-9)


@pytest.mark.parametrize("shape, mass, inertia", [
    ('type="box" size="0.1 0.2 0.3"', 48, (48 * 0.13 / 3, 48 * 0.10 / 3, 48 * 0.05 / 3)),
    ('type="sphere" size="0.1"', 4000 * math.pi / 3 * 1e-3, 3 * (1600 * math.pi / 3 * 1e-5,)),
    ('type="capsule" size="0.1 0.2"', 1000 * math.pi * 0.01 * (0.4 + 0.4 / 3), None),
    ('type="cylinder" size="0.1 0.2"', 4 * math.pi, (4 * math.pi * (0.03 + 0.16) / 12, 4 * math.pi * 0.19 / 12, 4 * math.pi * 0.005)),
    ('type="ellipsoid" size="0.1 0.2 0.3"', 8 * math.pi, (8 * math.pi * 0.13 / 5, 8 * math.pi * 0.1 / 5, 8 * math.pi * 0.05 / 5))])
def test_masses_of_geoms(tmp_path, shape, mass, inertia):
    path = mjcf(tmp_path, f'<worldbody><body name="b" pos="1 2 3"><freejoint/><geom pos="0.3 0 0" euler="0 0 0.5" {shape}/></body></worldbody>')
    body = esp.Model.from_mjcf(path).tree["bodies"]["b"]
    assert body["mass"] == pytest.approx(mass, rel=1e-12)
    assert np.allclose(body["position"], [1.3, 2, 3])
    if inertia:
        assert np.allclose(np.linalg.eigvalsh(body["inertia"]), np.sort(inertia), rtol=1e-12)


def cube(path, side=0.2, outwards=True):
    corners = [(x, y, z) for x in (0, side) for y in (0, side) for z in (0, side)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) +
                    "".join("f " + " ".join(str(c + 1) for c in (q if outwards else q[::-1])) + "\n" for q in quads))


@pytest.mark.parametrize("scale", ["1 1 1", "2 1 1", "-1 1 1"])
def test_mesh_as_mass_and_shape(tmp_path, scale):
    (tmp_path / "meshes").mkdir()
    cube(tmp_path / "meshes" / "cube.obj")
    path = mjcf(tmp_path, f'<compiler meshdir="meshes"/><asset><mesh name="c" file="cube.obj" scale="{scale}" inertia="exact"/></asset>'
                '<worldbody><geom type="plane" size="1 1 1"/><body name="b" pos="0 0 1"><freejoint/><geom type="mesh" mesh="c"/></body></worldbody>')
    model = esp.Model.from_mjcf(path)
    x = float(scale.split()[0])
    assert model.tree["bodies"]["b"]["mass"] == pytest.approx(8 * abs(x))
    assert np.allclose(model.tree["bodies"]["b"]["position"], [0.1 * x, 0.1, 1.1])
    (z,), summary = run(model, ["b.position.z"], end=1.5, relative=1e-4, absolute=1e-5, absolute_velocity=1e-3)
    assert 0.09 < z < 0.1 and summary["energy"]["end"]["kinetic"] < 1e-2  # at rest on the plane, some mm deep at most


def test_mimic_of_two_fingers(tmp_path):
    fingers = link("left", 1, 0.1, "0 0 0") + link("right", 3, 0.1, "0 0 0")
    path = urdf(tmp_path, '<link name="base"/>' + fingers + joint("l", "base", "left", "prismatic", "1 0 0", '<limit lower="-9" upper="9"/>')
                + joint("r", "base", "right", "prismatic", "1 0 0", '<limit lower="-9" upper="9"/><mimic joint="l" multiplier="-2" offset="0.5"/>'))
    model = esp.Model.from_urdf(path, positions={"l": 0.1}, velocities={"l": 0.2})
    model.tree["forces"] = {"push": {"type": "load", "a": {"body": "left"}, "force": [26, 0, 0]}}
    (left, right), _ = run(model, ["l.displacement", "r.displacement"])
    assert left == pytest.approx(0.1 + 0.2 * 0.5 + 0.5 * 26 / (1 + 4 * 3) * 0.25, abs=1e-8)
    assert right == pytest.approx(0.5 - 2 * left, abs=1e-10)


def test_hinge_drives_slide(tmp_path):
    path = mjcf(tmp_path, '<option gravity="0 0 0"/><worldbody><body name="wheel"><joint name="turn" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body>'
                '<body name="rack" pos="0 1 0"><joint name="shift" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body></worldbody>'
                '<equality><joint joint1="shift" joint2="turn" polycoef="0.1 0.5 0 0 0"/></equality><actuator><motor name="m" joint="turn"/></actuator>'
                '<keyframe><key ctrl="5.5"/></keyframe>')
    (turn, shift), _ = run(esp.Model.from_mjcf(path, keyframe=0), ["turn.angle", "shift.displacement"], end=1.0)
    assert turn == pytest.approx(0.5 * 5.5 / (2 + 3 * 0.25), abs=1e-8)
    assert shift == pytest.approx(0.1 + 0.5 * turn, abs=1e-10)


def test_loop_is_a_parallelogram(tmp_path):
    """Two equal pendulums with a rod between their ends: the rod does not turn, so all is one pendulum."""
    arm = '<body name="{0}" pos="{1} 0 0"><joint name="{0}j" axis="0 1 0"/><inertial pos="0 0 -0.5" mass="1" diaginertia="0.05 0.05 0.05"/>{2}</body>'
    rod = '<body name="rod" pos="0 0 -1"><joint name="rodj" axis="0 1 0"/><inertial pos="0.5 0 0" mass="2" diaginertia="0.1 0.1 0.1"/></body>'
    path = mjcf(tmp_path, f'<worldbody>{arm.format("a", 0, rod)}{arm.format("b", 1, "")}</worldbody>'
                '<equality><connect body1="rod" body2="b" anchor="1 0 0"/></equality>')
    model = esp.Model.from_mjcf(path, positions={"aj": 0.3, "bj": 0.3, "rodj": -0.3})
    (a, b, c), _ = run(model, ["aj.angle", "bj.angle", "rodj.angle"])
    inertia, moment = 2 * (0.05 + 0.25) + 2, (1 + 2) * 1.0  # m l of all
    n, x = 4000, np.array([0.3, 0.0])
    f = lambda y: np.array([y[1], -moment * G * math.sin(y[0]) / inertia])  # noqa: E731
    for _ in range(n):
        h = 0.5 / n
        k1 = f(x)
        k2 = f(x + h / 2 * k1)
        k3 = f(x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(x + h * k3))
    assert np.allclose([a, b, c], [x[0], x[0], -x[0]], atol=1e-6)


def test_tendons(tmp_path):
    two = '<body name="{0}"><joint name="{0}j" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="{1}" diaginertia="1 1 1"/><site name="s{0}" pos="0 {2} 0"/></body>'
    path = mjcf(tmp_path, f'<option gravity="0 0 0"/><worldbody><site name="o" pos="-1 0 0"/>{two.format("a", 1, 0)}{two.format("b", 2, 0)}</worldbody>'
                '<tendon><fixed name="f" stiffness="8" springlength="0"><joint joint="aj" coef="2"/></fixed>'
                '<spatial name="s" stiffness="5" springlength="0.4"><site site="o"/><site site="sb"/></spatial></tendon>'
                '<actuator><motor name="m" tendon="s"/></actuator>')
    model = esp.Model.from_mjcf(path, positions={"aj": 0.1})
    (a, b), _ = run(model, ["aj.displacement", "bj.displacement"])
    assert a == pytest.approx(0.1 * math.cos(math.sqrt(8 * 4) * 0.5), abs=1e-7)
    assert b == pytest.approx(-0.6 + 0.6 * math.cos(math.sqrt(5 / 2) * 0.5), abs=1e-7)


def test_limit_stops_the_joint(tmp_path):
    path = urdf(tmp_path, '<link name="base"/>' + link("bob") + joint("hinge", "base", "bob", "revolute", more='<limit lower="-0.1" upper="1"/>'))
    (angle,), _ = run(esp.Model.from_urdf(path, positions={"hinge": 0.2}), ["hinge.angle"], end=2.0, relative=1e-5, absolute=1e-6, absolute_velocity=1e-4)
    assert -0.12 < angle < 0.2
    free = run(esp.Model.from_urdf(pendulum(tmp_path), positions={"hinge": 0.2}), ["hinge.angle"], end=0.6)[0][0]
    assert free < -0.15


def test_joints_one_after_the_other(tmp_path):
    """A planar body: two slides and a hinge. It falls freely, and turns as it did."""
    path = mjcf(tmp_path, '<worldbody><body name="b"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
                '<joint name="y" axis="0 1 0"/><inertial pos="0.1 0 0.2" mass="2" diaginertia="0.2 0.1 0.3"/></body></worldbody>')
    (x, z, y), _ = run(esp.Model.from_mjcf(path, velocities={"y": 2.0, "x": 1.0}), ["b.position.x", "b.position.z", "y.angle"])
    assert y == pytest.approx(1.0, abs=1e-8)
    assert x == pytest.approx(0.1 + (1 + 2 * 0.2) * 0.5, abs=1e-8)  # the centre moves on in a straight line
    assert z == pytest.approx(0.2 - 2 * 0.1 * 0.5 - G / 2 * 0.25, abs=1e-8)


def test_ball_and_free_joints(tmp_path):
    path = mjcf(tmp_path, '<worldbody><body name="top" pos="0 0 1"><joint type="ball" name="p" damping="0.3"/><inertial pos="0 0 0" mass="1" diaginertia="2 2 2"/></body>'
                '<body name="f" pos="1 0 0"><freejoint/><inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/></body></worldbody>'
                '<keyframe><key name="k" qpos="1 0 0 0  1 0 2  0.70710678118654752 0.70710678118654752 0 0" qvel="0 0 3  1 2 3  0 0 4"/></keyframe>')
    model = esp.Model.from_mjcf(path, keyframe="k")
    (spin, x, y, z), _ = run(model, ["top.angular_velocity.z", "f.position.x", "f.position.y", "f.position.z"])
    assert spin == pytest.approx(3 * math.exp(-0.3 / 2 * 0.5), abs=1e-7)
    # Its own z is -y of the world: the spin of 4 about it leaves the centre, 0.1 along it, where it is.
    assert np.allclose([x, y, z], [1.5, -0.1 + 1.0, 2 + 1.5 - G / 8], atol=1e-7)


def test_contacts_and_exclusions(tmp_path):
    body = '<body name="{0}" pos="{1} 0 1"><freejoint/><geom name="g{0}" size="0.1" {2}/></body>'
    path = mjcf(tmp_path, '<worldbody><geom name="floor" type="plane" size="1 1 1" friction="0.4"/>' + body.format("a", 0, "") + body.format("b", 1, 'contype="0" conaffinity="0"')
                + body.format("c", 2, "") + '</worldbody><contact><exclude body1="a" body2="c"/></contact>')
    contacts = esp.Model.from_mjcf(path).tree["contacts"].values()
    assert [(c["surfaces"], c["against"], c["friction"]) for c in contacts] == [(["floor"], ["ga", "gc"], 1)]
    assert "contacts" not in esp.Model.from_mjcf(path, geometry=False).tree


def test_transmission_is_an_input(tmp_path):
    path = urdf(tmp_path, '<link name="base"/>' + link("bob") + joint("hinge", "base", "bob", more='<limit effort="3"/>')
                + '<transmission name="t"><joint name="hinge"/></transmission><gazebo/>')
    model = esp.Model.from_urdf(path)
    model.tree["inputs"]["hinge_motor"] = 5.0  # more than the effort
    assert run(model, ["hinge.angle"])[0][0] == pytest.approx(swing(0, lambda t, q, w: 3)[0], abs=1e-6)
    assert any("1 <gazebo>" in n for n in model.notices)


def test_links_without_mass_between_joints(tmp_path):
    """A universal joint of two hinges with an empty link between them, as URDF writes it."""
    path = urdf(tmp_path, '<link name="base"/><link name="cross"/>' + link("bob") + joint("one", "base", "cross", axis="1 0 0") + joint("two", "cross", "bob"))
    model = esp.Model.from_urdf(path, positions={"two": 0.7})
    assert run(model, ["two.angle"])[0][0] == pytest.approx(swing(0.7)[0], abs=1e-6)
    assert any("no mass" in n for n in model.notices)


def test_free_base_and_packages(tmp_path):
    (tmp_path / "pkg" / "meshes").mkdir(parents=True)
    cube(tmp_path / "pkg" / "meshes" / "c.obj")
    shape = '<collision><geometry><mesh filename="package://my_robot/meshes/c.obj"/></geometry></collision>'
    path = urdf(tmp_path, link("body", more=shape))
    with pytest.raises(esp.InvalidInputError, match="my_robot.*packages"):
        esp.Model.from_urdf(path, free_base=True)
    model = esp.Model.from_urdf(path, free_base=True, packages={"my_robot": tmp_path / "pkg"})
    assert list(model.tree["surfaces"].values())[0]["file"].endswith("c.obj")
    assert run(model, ["body.position.z"])[0][0] == pytest.approx(-0.5 - G / 8, abs=1e-8)
    with pytest.raises(esp.InvalidInputError, match="nothing moves"):
        esp.Model.from_urdf(path, geometry=False)


BASE = '<link name="base"/>'


@pytest.mark.parametrize("text, message", [
    ('<robot xmlns:xacro="x"><xacro:macro name="m"/></robot>', "xacro"),
    ('<robot><link name="${p}"/></robot>', "xacro"),
    ("<robot>", "is no XML"),
    ("<robot/>", "no <link>"),
    ("<html/>", "neither URDF"),
    (f"<robot>{BASE}{BASE}</robot>", "a link of that name already"),
    (f'<robot>{BASE}{link("a")}{joint("j", "base", "a")}{joint("j", "base", "a")}</robot>', "a joint of that name already"),
    (f'<robot>{BASE}{link("a")}{joint("j", "base", "b")}</robot>', "no link 'b'"),
    (f'<robot>{BASE}{link("a")}{link("b")}{joint("i", "base", "a")}{joint("j", "base", "b")}{joint("k", "a", "b")}</robot>', "closes? the loop|close the loop"),
    (f'<robot>{link("a")}{link("b")}{joint("i", "a", "b")}{joint("j", "b", "a")}</robot>', "circle"),
    (f'<robot>{BASE}{link("a")}{link("b")}{joint("i", "a", "b")}{joint("j", "b", "a")}</robot>', "circle"),
    (f"<robot>{BASE}<link name='c'/></robot>", "one link is the root"),
    (f'<robot>{BASE}<link name="tool"/>{joint("j", "base", "tool")}</robot>', "has no mass"),
    (f'<robot>{BASE}{link("a", 1, 0)}{joint("j", "base", "a")}</robot>', "not positive"),
    (f'<robot>{BASE}{link("a", -1)}{joint("j", "base", "a")}</robot>', "must not be negative"),
    (f'<robot>{BASE}{link("a", "nan")}{joint("j", "base", "a")}</robot>', "must be numbers"),
    (f'<robot>{BASE}{link("a")}{joint("j", "base", "a", "screw")}</robot>', "no type of joint"),
    (f'<robot>{BASE}{link("a")}{joint("j", "base", "a", "revolute")}</robot>', "needs <limit>"),
    (f'<robot>{BASE}{link("a")}{joint("j", "base", "a", axis="0 0 0")}</robot>', "must not be zero"),
    (f'<robot>{BASE}{link("a")}{joint("j", "base", "a", more="<mimic joint=%sj%s/>" % (chr(34), chr(34)))}</robot>', "follows itself"),
    ("<robot>" + "<a>" * 300 + "</a>" * 300 + "</robot>", "nested"),
])
def test_wrong_urdf(tmp_path, text, message):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    with pytest.raises(esp.InvalidInputError, match=message) as caught:
        esp.Model.from_urdf(path)
    assert "robot.urdf" in str(caught.value)


WORLD = '<worldbody><body name="b"><joint name="j"/><inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/>{}</body></worldbody>'


@pytest.mark.parametrize("text, message", [
    ('<include file="robot.xml"/>', "includes itself"),
    ('<include file="none.xml"/>', "none.xml"),
    ("", "no <worldbody>"),
    (WORLD.format('<joint name="j"/>'), "a joint of that name already"),
    (WORLD.format('<body name="b"/>'), "a body of that name already"),
    (WORLD.format('<geom type="mesh" mesh="m"/>'), "no mesh 'm'"),
    ('<asset><mesh name="m" file="gone.stl"/></asset>' + WORLD.format('<geom type="mesh" mesh="m"/>'), "gone.stl"),
    (WORLD.format('<geom class="c"/>'), "no class of defaults 'c'"),
    (WORLD.format('<geom type="box" size="1 2"/>'), "needs 3 numbers"),
    (WORLD.format("") + '<actuator><motor joint="k"/></actuator>', "no joint 'k'"),
    (WORLD.format("") + '<equality><connect body1="b" body2="c" anchor="0 0 0"/></equality>', "no body 'c'"),
    ("<worldbody><body><joint/></body></worldbody>", "has no mass"),
    (WORLD.format("") + '<keyframe><key name="k" qpos="1 2"/></keyframe>', "needs? 1|need 1"),
])
def test_wrong_mjcf(tmp_path, text, message):
    with pytest.raises(esp.InvalidInputError, match=message):
        esp.Model.from_mjcf(mjcf(tmp_path, text), keyframe="k" if "keyframe" in text else None)


def test_entities_do_not_grow(tmp_path):
    path = tmp_path / "bomb.urdf"
    path.write_text('<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa">' + "".join(f'<!ENTITY {chr(98 + k)} "{("&" + chr(97 + k) + ";") * 10}">' for k in range(9))
                    + f']><robot name="&j;">{BASE}{link("a")}{joint("j", "base", "a")}</robot>')
    assert len(esp.Model.from_urdf(path).text) < 3000


def test_many_includes_end(tmp_path):
    (tmp_path / "a.xml").write_text("<mujoco>" + '<include file="b.xml"/>' * 40 + "</mujoco>")
    (tmp_path / "b.xml").write_text("<mujoco>" + '<include file="c.xml"/>' * 40 + "</mujoco>")
    (tmp_path / "c.xml").write_text("<mujoco/>")
    with pytest.raises(esp.InvalidInputError, match="1000"):
        esp.Model.from_mjcf(mjcf(tmp_path, '<include file="a.xml"/>' + WORLD.format("")))


def test_names_that_clash(tmp_path):
    path = mjcf(tmp_path, '<worldbody><body name="left leg"><joint name="left leg"/><inertial pos="0 0 1" mass="1" diaginertia="1 1 1"/><site name="left leg"/></body></worldbody>'
                '<actuator><motor name="left leg" joint="left leg"/></actuator>')
    tree = esp.Model.from_mjcf(path).tree
    assert [list(tree[k]) for k in ("bodies", "joints", "markers", "forces", "inputs")] == [
        ["left_leg"], ["left_leg_joint"], ["left_leg_site"], ["left_leg_motor"], ["left_leg"]]


def test_unknown_joint_and_keyframe(tmp_path):
    with pytest.raises(esp.InvalidInputError, match="hinge"):
        esp.Model.from_urdf(pendulum(tmp_path), positions={"hing": 1})
    with pytest.raises(esp.InvalidInputError, match="no keyframe 'away'"):
        esp.Model.from_mjcf(mjcf(tmp_path, WORLD.format("")), keyframe="away")


def test_names_of_actuators(tmp_path):
    """Inputs have letters, digits and _: an actuator of another name drives its joint by one that a notice names. Truth: the pendulum under
    the torque."""
    path = mjcf(tmp_path, '<worldbody><body name="a"><joint name="left-hip" axis="0 1 0"/>' + BOB + '</body><body name="b" pos="0 2 0">'
                '<joint name="2nd hip" axis="0 1 0"/>' + BOB + '</body></worldbody><actuator><motor name="left-wheel" joint="left-hip"/>'
                '<motor name="left_wheel" joint="2nd hip"/><motor name="2nd/ü" joint="2nd hip"/></actuator>')
    model = esp.Model.from_mjcf(path)
    assert list(model.tree["inputs"]) == ["left_wheel", "left_wheel_input", "2nd___"]
    assert any("left-wheel (left_wheel), left_wheel (left_wheel_input), 2nd/ü (2nd___)" in notice for notice in model.notices), model.notices
    for name, value in zip(model.tree["inputs"], (2.0, 0.5, 0.7)):
        model.tree["inputs"][name] = value
    (left, right), _ = run(model, ["left-hip.angle", "2nd_hip.angle"])
    assert left == pytest.approx(swing(0, lambda t, q, w: 2.0)[0], abs=1e-6)
    assert right == pytest.approx(swing(0, lambda t, q, w: 1.2)[0], abs=1e-6)
