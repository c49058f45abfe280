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
    path = mjcf(tmp_path, f'<default><joint damping="1" armature="0.3"/></default><worldbody><body name="f"><joint type="free"/>{BOB}</body></worldbody>')
    notices = " ".join(esp.Model.from_mjcf(path).notices)
    assert "1 armature of ball and free joints" in notices and "1 damping and springs of free joints" in notices


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


def test_floating_joint_begins_at_its_origin(tmp_path):
    path = urdf(tmp_path, BASE + link("mid") + link("free") + joint("up", "base", "mid", "fixed", at="0 0 5") + joint("go", "mid", "free", "floating", at="1 2 3"))
    assert np.allclose(esp.Model.from_urdf(path).tree["bodies"]["free"]["position"], [1, 2, 8 - LENGTH])


def test_couplings_in_any_order(tmp_path):
    body = '<body name="{0}"><joint name="{0}" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    path = mjcf(tmp_path, "<worldbody>" + "".join(body.format(k) for k in "abc") + '</worldbody><equality><joint joint1="c" joint2="b" polycoef="0 2 0 0 0"/>'
                '<joint joint1="b" joint2="a" polycoef="0.1 3 0 0 0"/></equality>')
    tree = esp.Model.from_mjcf(path, positions={"a": 0.5}).tree["bodies"]
    assert [tree[k]["position"][0] for k in "abc"] == pytest.approx([0.5, 1.6, 3.2])
