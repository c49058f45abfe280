#!/usr/bin/env python3
"""Motions of espalier beside MuJoCo's, Exudyn's and closed forms: a second program for what a simulator must not get wrong.

    python3 bench/dynamics/other_programs.py      (pip install mujoco exudyn; espalier with the defaults of a model)

Each line names the number that is compared, the truth (a closed form, or the other program with short steps) and how far
the programs are from it. It ends with 1 where espalier is further from the truth than the case allows.
"""
import math
import sys

import numpy as np

import espalier as esp

G = 9.81


def mujoco_run(text, end, site="tip"):
    import mujoco

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(round(end / model.opt.timestep)):
        mujoco.mj_step(model, data)
    mujoco.mj_kinematics(model, data)
    return np.array(data.site(site).xpos)


def double_pendulum():
    """Two bars in space, hinges about y and about the first bar's x; where the end of the second is after 2 s."""
    m = esp.Model(gravity=[0, 0, -G], integrator={"end": 2})
    m.body("upper", "rigid", mass=2, inertia=[0.01, 0.02, 0.03], position=[0.25, 0, 0])
    m.body("lower", "rigid", mass=1, inertia=[0.004, 0.006, 0.008], position=[0.5, 0, -0.2])
    m.joint("first", "revolute", bodies=["ground", "upper"], at=[0, 0, 0], axis=[0, 1, 0])
    m.joint("second", "revolute", bodies=["upper", "lower"], at=[0.5, 0, 0], axis=[1, 0, 0.3])
    m.marker("tip", body="lower", point=[0, 0.1, -0.2])
    run = m.run(quantities=["tip.position"])
    other = mujoco_run(f"""<mujoco><option timestep="1e-4" integrator="RK4" gravity="0 0 {-G}"/><worldbody>
      <body><joint type="hinge" axis="0 1 0"/><inertial pos="0.25 0 0" mass="2" diaginertia="0.01 0.02 0.03"/>
        <body pos="0.5 0 0"><joint type="hinge" axis="1 0 0.3"/><inertial pos="0 0 -0.2" mass="1"
          diaginertia="0.004 0.006 0.008"/><site name="tip" pos="0 0.1 -0.4"/></body></body></worldbody></mujoco>""", 2)
    yield "double pendulum, tip", other, {"espalier": run.values[-1][:3]}, 1e-3


def block_to_rest():
    """A block slides to rest: v^2 / (2 mu g)."""
    m = esp.Model(gravity=[0, 0, -G], integrator={"end": 1})
    m.body("block", "rigid", mass=1, box=[0.4, 0.4, 0.02], position=[0, 0, 0.01 - G / 4e7], velocity=[1, 0, 0])
    m._add("surfaces", "block", {"body": "block", "shape": "box", "size": [0.4, 0.4, 0.02]})
    m._add("surfaces", "floor", {"body": "ground", "shape": "plane"})
    m._add("contacts", "rub", {"surfaces": ["block", "floor"], "stiffness": 1e7, "friction": 0.2,
                               "tangential_damping": 1e3, "damping": 10})
    run = m.run(quantities=["block.position.x"])
    other = mujoco_run(f"""<mujoco><option timestep="1e-4" gravity="0 0 {-G}" cone="elliptic" impratio="100" integrator="implicitfast"/>
      <worldbody><geom type="plane" size="9 9 1" friction="0.2 0 0" solref="0.001 1" condim="3"/>
      <body pos="0 0 0.01"><freejoint/><geom type="box" size="0.2 0.2 0.01" mass="1" friction="0.2 0 0" solref="0.001 1" condim="3"/>
      <site name="tip"/></body></worldbody><keyframe><key qpos="0 0 0.01 1 0 0 0" qvel="1 0 0 0 0 0"/></keyframe></mujoco>""", 1)
    yield "block to rest, way", np.array([1 / (2 * 0.2 * G)]), {"espalier": run.values[-1], "MuJoCo": other[:1]}, 1e-4


def ball_begins_to_roll():
    """A ball that slips and then rolls: 5/7 of its speed from 2 v / (7 mu g) on."""
    v, mu, r, end = 3.0, 0.12, 0.11, 3.0
    m = esp.Model(gravity=[0, 0, -G], integrator={"end": end})
    m.body("ball", "rigid", mass=6, inertia=[0.4 * 6 * r * r] * 3, position=[0, 0, r - 6 * G / 1e7], velocity=[v, 0, 0])
    m._add("surfaces", "ball", {"body": "ball", "shape": "sphere", "radius": r})
    m._add("surfaces", "floor", {"body": "ground", "shape": "plane"})
    m._add("contacts", "rub", {"surfaces": ["ball", "floor"], "stiffness": 1e7, "friction": mu, "tangential_damping": 1e3})
    run = m.run(quantities=["ball.position.x"])
    other = mujoco_run(f"""<mujoco><option timestep="1e-4" gravity="0 0 {-G}" cone="elliptic" impratio="100" integrator="implicitfast"/>
      <worldbody><geom type="plane" size="9 9 1" friction="{mu} 0 0" solref="0.001 1" condim="3"/>
      <body pos="0 0 {r}"><freejoint/><geom type="sphere" size="{r}" mass="6" friction="{mu} 0 0" solref="0.001 1" condim="3"/>
      <site name="tip"/></body></worldbody><keyframe><key qpos="0 0 {r} 1 0 0 0" qvel="{v} 0 0 0 0 0"/></keyframe></mujoco>""", end)
    t = 2 * v / (7 * mu * G)
    truth = v * t - 0.5 * mu * G * t * t + 5 / 7 * v * (end - t)
    yield "ball begins to roll, way", np.array([truth]), {"espalier": run.values[-1], "MuJoCo": other[:1]}, 1e-3


def disc_rolls():
    """A thin disc that rolls and wobbles for a second: Exudyn's rolling joint, steps of 0.1 ms."""
    import exudyn as exu
    from exudyn.utilities import RigidBodyInertia

    r, mass, tilt, spin, end = 0.3, 2.0, 0.4, 12.0, 1.0
    across, along = mass * r * r / 4, mass * r * r / 2
    axle = np.array([0, math.cos(tilt), math.sin(tilt)])
    centre = np.array([0, 0, r * math.cos(tilt)])
    contact = np.array([0, r * math.sin(tilt), -r * math.cos(tilt)])  # from the centre, to the lowest point of the rim
    omega = spin * axle + np.array([0, 0, 0.5])
    velocity = -np.cross(omega, contact)
    m = esp.Model(gravity=[0, 0, -G], integrator={"end": end})
    m.body("disc", "rigid", mass=mass, inertia=[across, along, across], position=list(centre),
           rotation={"axis": [1, 0, 0], "angle": tilt}, velocity=list(velocity), angular_velocity=list(omega))
    m.joint("rolls", "rolling", a={"body": "ground", "axis": [0, 0, 1]}, b={"body": "disc", "axis": [0, 1, 0]}, radius=r)
    run = m.run(quantities=["disc.position"])

    system = exu.SystemContainer()
    mbs = system.AddSystem()
    ground = mbs.CreateGround()
    c, s = math.cos(tilt), math.sin(tilt)
    body = mbs.CreateRigidBody(inertia=RigidBodyInertia(mass, np.diag([across, along, across])), referencePosition=list(centre),
                               referenceRotationMatrix=np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
                               initialVelocity=list(velocity), initialAngularVelocity=list(omega), gravity=[0, 0, -G])
    mbs.CreateRollingDisc(bodyNumbers=[ground, body], axisPosition=[0, 0, 0], axisVector=[0, 1, 0], discRadius=r,
                          planePosition=[0, 0, 0], planeNormal=[0, 0, 1])
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = round(end / 1e-4), end
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.solutionSettings.writeSolutionToFile = False
    mbs.SolveDynamic(settings)
    other = np.array(mbs.GetObjectOutputBody(body, exu.OutputVariableType.Position))
    yield "disc rolls and wobbles, centre", other, {"espalier": run.values[-1][:3]}, 1e-3


def main():
    bad = 0
    for case in (double_pendulum, block_to_rest, ball_begins_to_roll, disc_rolls):
        try:
            for name, truth, found, allowed in case():
                errors = {who: float(np.max(np.abs(np.asarray(x, float)[:len(truth)] - truth))) for who, x in found.items()}
                ok = errors["espalier"] <= allowed
                bad += not ok
                print(f"{'ok ' if ok else 'BAD'} {name}: {np.array2string(truth, precision=6)}  " +
                      "  ".join(f"{who} off by {e:.1e}" for who, e in errors.items()))
        except ImportError as missing:
            print(f"left out: {case.__name__}: {missing}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
