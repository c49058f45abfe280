"""What MuJoCo makes of attributes that files often have and manuals hardly mention. Truth: closed forms; each was seen in MuJoCo 4.0.0."""

import math

import numpy as np
import pytest

import espalier as esp
from test_robots import BASE, BOB, INERTIA, LENGTH, MASS, PIN, joint, link, mjcf, run, swing, urdf


def bodies(tmp_path, inside, settings=""):
    path = mjcf(tmp_path, f'{settings}<worldbody><body name="b"><joint name="j" axis="0 1 0"/>{inside}</body></worldbody>')
    return esp.Model.from_mjcf(path).tree["bodies"]["b"]


@pytest.mark.parametrize("kind, volume", [("box", 8 * 0.1**2 * 0.5), ("ellipsoid", 4 / 3 * math.pi * 0.1**2 * 0.5)])
def test_second_size_beside_fromto_says_nothing(tmp_path, kind, volume):
    body = bodies(tmp_path, f'<geom type="{kind}" fromto="0 0 0 0 0 1" size="0.1 0.02"/>')
    assert body["mass"] == pytest.approx(1000 * volume)


def test_size_in_part(tmp_path):
    body = bodies(tmp_path, '<geom size="0.2"/>', '<default><geom type="cylinder" size="0.1 0.3"/></default>')
    assert body["mass"] == pytest.approx(1000 * math.pi * 0.04 * 0.6)


def shell(kind, size):
    """Mass and principal moments at surface density 1, by integration over the surface."""
    n = 400
    g = (np.arange(n) + 0.5) / n
    points, weights = [], []
    if kind == "box":
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            u, v = np.meshgrid(size[i] * (2 * g - 1), size[j] * (2 * g - 1))
            for side in (-1, 1):
                p = np.empty((3, n * n))
                p[i], p[j], p[k] = u.ravel(), v.ravel(), side * size[k]
                points.append(p)
                weights.append(np.full(n * n, 4 * size[i] * size[j] / n**2))
    else:  # cylinder: its wall and two discs
        r, h = size
        t, z = np.meshgrid(2 * math.pi * g, h * (2 * g - 1))
        points.append(np.array([r * np.cos(t), r * np.sin(t), z]).reshape(3, -1))
        weights.append(np.full(n * n, 4 * math.pi * r * h / n**2))
        for side in (-1, 1):
            t, q = np.meshgrid(2 * math.pi * g, r * np.sqrt(g))
            points.append(np.array([q * np.cos(t), q * np.sin(t), side * h + 0 * q]).reshape(3, -1))
            weights.append(np.full(n * n, math.pi * r * r / n**2))
    p, w = np.hstack(points), np.hstack(weights)
    second = (w * p) @ p.T
    return w.sum(), np.sort(np.trace(second) - np.diag(second))


@pytest.mark.parametrize("kind, size", [("box", (0.1, 0.2, 0.3)), ("cylinder", (0.1, 0.2))])
def test_shells(tmp_path, kind, size):
    body = bodies(tmp_path, f'<geom type="{kind}" size="{" ".join(map(str, size))}" shellinertia="true" density="7"/>')
    mass, inertia = shell(kind, size)
    assert body["mass"] == pytest.approx(7 * mass, rel=1e-12)
    assert np.allclose(np.linalg.eigvalsh(body["inertia"]), 7 * inertia, rtol=1e-5)  # of the midpoint rule


def test_shell_of_a_box_in_closed_form(tmp_path):
    a, b, c = 0.1, 0.2, 0.3
    body = bodies(tmp_path, f'<geom type="box" size="{a} {b} {c}" shellinertia="true" density="1"/>')
    x2 = 8 * b * c * a**2 + 8 / 3 * a**3 * (b + c)  # integral of x^2
    y2 = 8 * a * c * b**2 + 8 / 3 * b**3 * (a + c)
    z2 = 8 * a * b * c**2 + 8 / 3 * c**3 * (a + b)
    assert np.allclose(body["inertia"], np.diag([y2 + z2, x2 + z2, x2 + y2]), rtol=1e-12, atol=1e-15)


def test_bounds(tmp_path):
    full = np.array([[0.02, 0.015, 0.001], [0.015, 0.03, 0.002], [0.001, 0.002, 0.04]])
    inertial = '<inertial pos="0 0 0.1" mass="1" fullinertia="0.02 0.03 0.04 0.015 0.001 0.002"/>'
    values, vectors = np.linalg.eigh(full)
    found = bodies(tmp_path, inertial, '<compiler boundinertia="0.02"/>')["inertia"]
    assert np.allclose(found, vectors @ np.diag(np.maximum(values, 0.02)) @ vectors.T, atol=1e-15)
    empty = bodies(tmp_path, inertial + '<body name="empty" pos="1 0 0"/>', '<compiler boundmass="0.5"/>')
    assert empty["mass"] == pytest.approx(1.5)


def test_ranges_that_do_not_rise_limit_nothing(tmp_path):
    path = mjcf(tmp_path, f'<default><joint range="0 1"/></default><worldbody><body name="bob"><joint name="hinge" axis="0 1 0" range="0 0"/>{BOB}</body></worldbody>'
                '<actuator><motor name="m" joint="hinge" ctrlrange="0 0" forcerange="0 0"/></actuator>')
    tree = esp.Model.from_mjcf(path).tree
    assert "limits" not in tree["joints"]["hinge"]
    assert "max" not in tree["forces"]["m"]["torque"]
    path = mjcf(tmp_path, f'<worldbody><body name="bob"><joint name="hinge" axis="0 1 0" range="0 0" limited="true"/>{BOB}</body></worldbody>')
    with pytest.raises(esp.InvalidInputError, match="must rise"):
        esp.Model.from_mjcf(path)


def test_range_inherited_by_a_class(tmp_path):
    path = mjcf(tmp_path, f'<default><position kp="40" inheritrange="0.5"/></default><worldbody><body name="bob"><joint name="hinge" axis="0 1 0" range="-1 3"/>{BOB}</body></worldbody>'
                '<actuator><position name="p" joint="hinge"/></actuator>')
    assert "min(max(inputs.p, 0), 2)" in esp.Model.from_mjcf(path).tree["forces"]["p"]["torque"]


def test_free_joints_say_what_they_lose(tmp_path):
    path = mjcf(tmp_path, f'<default><joint frictionloss="1" armature="0.3"/></default><worldbody><body name="f"><joint type="free"/>{BOB}</body>'
                f'<body name="g"><joint type="ball"/>{BOB}</body></worldbody>')
    notices = " ".join(esp.Model.from_mjcf(path).notices)
    assert "2 friction loss of ball and free joints" in notices and "1 armature of ball joints" in notices


def test_part_of_a_body_without_weight(tmp_path):
    path = mjcf(tmp_path, f'<worldbody><body name="bob"><joint name="hinge" axis="0 1 0"/>{BOB}<body name="balloon" pos="0.4 0 0" gravcomp="1"><inertial pos="0 0 0" mass="3" '
                'diaginertia="0.01 0.01 0.01"/></body></body></worldbody>')
    angle = run(esp.Model.from_mjcf(path, positions={"hinge": 0.7}), ["hinge.angle"])[0][0]
    assert angle == pytest.approx(swing(0.7, inertia=PIN + 0.01 + 3 * 0.16)[0], abs=1e-6)


def test_switched_off(tmp_path):
    flags = '<option><flag spring="disable" damper="disable" frictionloss="disable" limit="disable" equality="disable" actuation="disable"/></option>'
    path = mjcf(tmp_path, f'{flags}<worldbody><body name="bob"><joint name="hinge" axis="0 1 0" stiffness="3" damping="2" frictionloss="1" range="-0.1 0.1"/>{BOB}</body></worldbody>'
                '<equality><joint joint1="hinge" polycoef="0.2"/></equality><actuator><motor name="m" joint="hinge"/></actuator><keyframe><key ctrl="9"/></keyframe>')
    angle = run(esp.Model.from_mjcf(path, keyframe=0, positions={"hinge": 0.7}), ["hinge.angle"])[0][0]
    assert angle == pytest.approx(swing(0.7)[0], abs=1e-6)


def test_tendons_rest_where_the_springs_of_joints_do(tmp_path):
    path = mjcf(tmp_path, '<option gravity="0 0 0"/><worldbody><site name="o" pos="-1 0 0"/><body name="a"><joint name="j" type="slide" axis="1 0 0" springref="0.7" ref="0.2"/>'
                '<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><site name="s"/></body></worldbody>'
                '<tendon><fixed name="f" stiffness="5"><joint joint="j" coef="2"/></fixed><spatial name="t" stiffness="12"><site site="o"/><site site="s"/></spatial></tendon>')
    (x,), _ = run(esp.Model.from_mjcf(path), ["j.displacement"])
    assert x == pytest.approx(0.7 - 0.5 * math.cos(math.sqrt((5 * 4 + 12) / 2) * 0.5), abs=1e-7)


@pytest.mark.parametrize("springlength, rest", [("-0.05", -0.05), ("-0.3 -0.1", -0.1), ("-1", 0), ("-1 -1", 0), ("-1 -0.2", -0.2), ("0", 0), ("0.1 0.4", 0.1)])
def test_rest_of_fixed_tendons(tmp_path, springlength, rest):
    """Any number but -1 alone is a length, also below 0; between two of them the tendon does not pull."""
    path = mjcf(tmp_path, '<option gravity="0 0 0"/><worldbody><body name="a"><joint name="j" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody>'
                f'<tendon><fixed name="f" stiffness="5" springlength="{springlength}"><joint joint="j" coef="2"/></fixed></tendon>')
    (x,), _ = run(esp.Model.from_mjcf(path), ["j.displacement"])
    low, high = ([float(w) for w in springlength.split()] * 2)[:2]
    stays = low <= 0 <= high and springlength not in ("-1", "-1 -1")
    assert x == pytest.approx(0 if stays else rest / 2 * (1 - math.cos(math.sqrt(5 * 4 / 2) * 0.5)), abs=1e-7)


@pytest.mark.parametrize("actuators, told", [
    ('<motor name="a" joint="j"/>', False), ('<motor name="a" joint="j"/><motor name="b" joint="j"/>', True), ('<motor name="a" tendon="t"/>', True),
    ('<motor name="a" site="s" gear="1 0 0 0 0 0"/>', True), ("", False)])
def test_limits_of_the_sum_of_several_actuators(tmp_path, actuators, told):
    """MuJoCo bounds the sum of what drives a joint (mjModel.jnt_actfrcrange); seen there: two motors of 3 within 4 exert 4."""
    path = mjcf(tmp_path, '<worldbody><body name="a"><joint name="j" type="slide" axis="1 0 0" actuatorfrcrange="-4 4"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><site name="s"/></body>'
                f'</worldbody><tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon><actuator>{actuators}</actuator>')
    assert any("limits of the sum" in str(n) for n in esp.Model.from_mjcf(path).notices) == told


def test_springlength_that_falls_is_refused(tmp_path):
    path = mjcf(tmp_path, '<worldbody><body name="a"><joint name="j" type="slide"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody>'
                '<tendon><fixed stiffness="5" springlength="0.3 0.1"><joint joint="j" coef="2"/></fixed></tendon>')
    with pytest.raises(esp.InvalidInputError, match="springlength"):
        esp.Model.from_mjcf(path)


def test_floating_joint_begins_at_its_origin(tmp_path):
    path = urdf(tmp_path, BASE + link("mid") + link("free") + joint("up", "base", "mid", "fixed", at="0 0 5") + joint("go", "mid", "free", "floating", at="1 2 3"))
    assert np.allclose(esp.Model.from_urdf(path).tree["bodies"]["free"]["position"], [1, 2, 8 - LENGTH])


def test_couplings_in_any_order(tmp_path):
    body = '<body name="{0}"><joint name="{0}" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    path = mjcf(tmp_path, "<worldbody>" + "".join(body.format(k) for k in "abc") + '</worldbody><equality><joint joint1="c" joint2="b" polycoef="0 2 0 0 0"/>'
                '<joint joint1="b" joint2="a" polycoef="0.1 3 0 0 0"/></equality>')
    tree = esp.Model.from_mjcf(path, positions={"a": 0.5}).tree["bodies"]
    assert [tree[k]["position"][0] for k in "abc"] == pytest.approx([0.5, 1.6, 3.2])


def test_springdamper_of_one_joint(tmp_path):
    """x'' + 2/T x' + x/(T z)^2 = 0, whatever the inertia is."""
    time, ratio = 0.2, 0.4
    path = mjcf(tmp_path, '<option gravity="0 0 0"/><worldbody><body name="bob"><joint name="hinge" axis="0 1 0" damping="7" '
                f'springdamper="{time} {ratio}"/>{BOB}</body></worldbody>')
    (angle,), _ = run(esp.Model.from_mjcf(path, positions={"hinge": 0.3}), ["hinge.angle"])
    decay, rate = 1 / time, math.sqrt(1 / (time * ratio)**2 - 1 / time**2)
    assert angle == pytest.approx(0.3 * math.exp(-decay * 0.5) * (math.cos(rate * 0.5) + decay / rate * math.sin(rate * 0.5)), abs=1e-7)


def test_springdamper_feels_what_hangs_on_it(tmp_path):
    """Two sliders, one on the other: M = [[m + n, n], [n, n]]; the diagonal of its inverse is 1/m and (m + n)/(m n)."""
    m, n, time, ratio, armature = 2.0, 3.0, 0.1, 0.7, 0.5
    path = mjcf(tmp_path, '<worldbody><body name="a"><joint name="one" type="slide" axis="1 0 0" springdamper="0.1 0.7"/>'
                f'<inertial pos="0 0 0" mass="{m}" diaginertia="1 1 1"/><body name="b" pos="0 0 1" euler="0.3 0 0"><joint name="two" type="slide" '
                f'axis="1 0 0" springdamper="0.1 0.7" armature="{armature}"/><inertial pos="0 1 0" mass="{n}" diaginertia="1 1 1"/></body></body></worldbody>')
    forces = esp.Model.from_mjcf(path).tree["forces"]
    mass = np.array([[m + n, n], [n, n + armature]])
    for name, felt in zip(("one", "two"), 1 / np.diag(np.linalg.inv(mass)), strict=True):
        assert forces[f"{name}_spring"]["stiffness"] == pytest.approx(felt / (time * ratio)**2, rel=1e-12)
        assert forces[f"{name}_spring"]["damping"] == pytest.approx(2 * felt / time, rel=1e-12)


def test_armature_of_a_free_joint(tmp_path):
    """Kinetic energy a/2 v^2 + a/2 w^2 of the origin's velocity and the spin, and no weight: let go with its centre c beside the origin."""
    m, c, inertia, a, g = 2.0, 0.3, 0.05, 0.4, 9.81
    path = mjcf(tmp_path, f'<worldbody><body name="b"><joint type="free" armature="{a}"/><inertial pos="{c} 0 0" mass="{m}" '
                f'diaginertia="{inertia} {inertia} {inertia}"/></body></worldbody>')
    model = esp.Model.from_mjcf(path)
    assert not any("armature" in notice for notice in model.notices)
    model.tree["markers"] = {"origin": {"body": "b", "point": [-m * c / (m + a), 0, 0]}}
    (z, vz), _ = run(model, ["origin.position.z", "origin.velocity.z"], end=1e-3)
    lift, spin = np.linalg.solve([[m + a, -m * c], [-m * c, inertia + a + m * c**2]], [-m * g, m * g * c])
    assert vz == pytest.approx(lift * 1e-3, rel=1e-5) and z == pytest.approx(lift * 5e-7, rel=1e-5) and spin > 0


def test_spring_and_damping_of_a_free_joint(tmp_path):
    m, k, d, size = 2.0, 30.0, 1.5, 0.05
    path = mjcf(tmp_path, f'<option gravity="0 0 0"/><worldbody><body name="b" pos="1 2 3"><joint type="free" stiffness="{k}" damping="{d}"/>'
                f'<inertial pos="0 0 0" mass="{m}" diaginertia="{size} {size} {size}"/></body></worldbody>'
                f'<keyframe><key name="away" qpos="1.2 2 3 {math.cos(0.2)} 0 {math.sin(0.2)} 0"/></keyframe>')
    model = esp.Model.from_mjcf(path, keyframe="away")
    (x, y, turn), _ = run(model, ["b.position.x", "b.position.y", "b.angular_velocity.y"], end=0.5)

    def swung(start, mass, rate):
        decay = d / (2 * mass)
        w2 = k / mass - decay**2
        w = math.sqrt(w2)
        e = math.exp(-decay * 0.5)
        place = start * e * (math.cos(w * 0.5) + decay / w * math.sin(w * 0.5))
        return -start * e * (w + decay**2 / w) * math.sin(w * 0.5) if rate else place

    assert x - 1 == pytest.approx(swung(0.2, m, False), abs=1e-7) and y == pytest.approx(2, abs=1e-9)
    assert turn == pytest.approx(swung(0.4, size, True), abs=1e-6)


def test_replicate(tmp_path):
    """Names and places as MuJoCo 4.0.0 has them: the number goes behind the name, the inner one first; the angles are multiplied, and each copy
    stands in the axes of the one before. Who names a copied joint is copied, too."""
    path = mjcf(tmp_path, '<worldbody><replicate count="11" offset="0.1 0.2 0" euler="0 0 1.5707963267948966" sep="_"><body name="b" pos="1 0 0">'
                f'<joint name="h" axis="0 1 0"/>{BOB}</body></replicate><body name="arm"><joint name="a" axis="0 1 0"/>{BOB}'
                '<replicate count="3" offset="0 0 0.1" euler="0.17453292519943295 0 0.3490658503988659"><replicate count="2" offset="0.01 0 0" sep="_">'
                '<site name="z"/></replicate></replicate></body></worldbody><actuator><motor name="m" joint="h"/><motor name="n" joint="a"/></actuator>')
    model = esp.Model.from_mjcf(path)
    tree = model.tree
    assert [n for n in tree["bodies"] if n.startswith("b")] == [f"b_{k:02d}" for k in range(11)]
    assert np.allclose(tree["bodies"]["b_03"]["position"], [-0.2, -0.9, -0.5])
    assert np.allclose(tree["bodies"]["b_09"]["position"], [0.1, 1.2, -0.5])
    assert sorted(n for n in tree["markers"] if n.startswith("z")) == ["z_00", "z_01", "z_02", "z_10", "z_11", "z_12"]
    assert np.allclose(tree["markers"]["z_12"]["point"], [0.00766044, -0.01132459, 0.20067924 + 0.5], atol=1e-8)
    assert sorted(tree["inputs"]) == sorted([*(f"m_{k:02d}" for k in range(11)), "n"])
    assert tree["forces"]["m_07"]["type"] == "torque-motor" and "b_07" in str(tree["forces"]["m_07"])
    model.tree["inputs"]["m_07"] = 2.0
    (alone, driven), _ = run(model, ["h_00.angle", "h_07.angle"])
    assert alone == pytest.approx(0, abs=1e-12) and driven == pytest.approx(swing(0, lambda t, q, w: 2)[0], abs=1e-6)


@pytest.mark.parametrize("wrong, words", [('<replicate count="2.5"/>', "whole number"), ('<replicate/>', "'count' needs 1 numbers"),
                                          ('<replicate count="1e9"><replicate count="1e9"/></replicate>', "100,000 copies")])
def test_replicate_refused(tmp_path, wrong, words):
    path = mjcf(tmp_path, f'<worldbody>{wrong}<body name="bob"><joint name="h"/>{BOB}</body></worldbody>')
    with pytest.raises(esp.InvalidInputError, match=words):
        esp.Model.from_mjcf(path)


def test_macros_that_are_left_out_are_named(tmp_path):
    path = mjcf(tmp_path, f'<worldbody><composite type="cable" count="3 1 1"/>\n<flexcomp name="f"/><attach model="m"/><body name="bob"><joint name="h"/>{BOB}</body></worldbody>')
    notices = esp.Model.from_mjcf(path).notices
    for line, tag in ((1, "composite"), (2, "flexcomp"), (2, "attach")):
        assert any(f"robot.xml:{line}: <{tag}> and the bodies that it would make are left out" in n for n in notices)


def test_files_that_include_themselves_by_another_name(tmp_path):
    (tmp_path / "part.xml").write_text('<mujoco><include file="./part.xml"/></mujoco>')
    with pytest.raises(esp.InvalidInputError, match="includes itself"):
        esp.Model.from_mjcf(mjcf(tmp_path, '<include file="part.xml"/>'))
    (tmp_path / "one.xml").write_text('<mujoco><include file="../%s/robot.xml"/></mujoco>' % tmp_path.name)
    with pytest.raises(esp.InvalidInputError, match="robot.xml' includes itself"):
        esp.Model.from_mjcf(mjcf(tmp_path, '<include file="one.xml"/>'))


def test_a_rotor_that_is_heavy_beside_its_arm_keeps_the_given_velocity(tmp_path):
    """As of dm_control's jaco_arm: an armature of 4 kg m^2 at links of 1e-3."""
    light = '<inertial pos="0 0 -0.1" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'
    inner = f'<body name="c" pos="0 0 -0.2"><joint name="three" axis="0 1 0" armature="2"/>{light}</body>'
    path = mjcf(tmp_path, f'<worldbody><body name="a"><joint name="one" axis="0 1 0" armature="4"/>{light}<body name="b" pos="0 0 -0.2" '
                f'quat="0 0 -0.707107 0.707107"><joint name="two" armature="4"/>{light}{inner}</body></body></worldbody>')
    speeds = {"one": 0.17, "two": -0.13, "three": 0.11}
    model = esp.Model.from_mjcf(path, velocities=speeds)
    model.tree["output"] = {"quantities": [f"{n}.angular_speed" for n in speeds]}
    simulation = esp.Simulation(model)
    for name, speed in speeds.items():
        assert simulation.value(f"{name}.angular_speed") == pytest.approx(speed, abs=1e-12)
