"""Good uses, with which mypy --strict must find nothing wrong (test_parts.py). Nobody runs this."""

from pathlib import Path
import numpy as np
import scipy.sparse as sp  # type: ignore[import-untyped]
import espalier as esp

model = esp.Model(title="x", gravity=[0, 0, -9.81], integrator={"end": 1.0, "relative": 1e-6}, parameters={"m": 2.0})
bob = model.body("bob", mass=2, box=(1, 1, 1), position=np.zeros(3))
p = [0.0, 1.0, 2.0]
model.body("b2", "rigid", mass=np.float64(3.0), inertia=[1, 1, 1], position=p)
model.body("b3", "rigid", mass="2*m", inertia=np.eye(3), rotation={"axis": [0, 0, 1], "angle": 1.0})
steel = model.material("steel", young=210e9, poisson=0.3, density=7850)
model.body("plate", "shell", x=[1, 0, 0], y=[0, 1, 0], nx=4, ny=4, thickness=1e-3, material=steel, damping={"ratio": 0.02})
model.body("solid", "solid", mesh={"file": Path("a.inp"), "scale": 1e-3}, material={"young": 1.0})
model.joint("hinge", "revolute", bodies=["ground", bob], at=[0, 0, 0], axis=[0, 0, 1], limits={"lower": 0, "upper": 1, "stiffness": 1e3, "smoothing": 1e-3})
model.joint("m", "rotation-motor", a={"body": "ground"}, b={"body": bob, "point": [0, 0, 1]}, motion="2*t", from_="initial")
model.force("push", "load", a={"body": bob}, force=["inputs.push", 0, 0])
model.force("p", "pressure", body="plate", face="top", pressure=100)
model.surface("floor", "plane", body="ground", normal=[0, 0, 1])
model.contact("c", surfaces=["floor"], stiffness=1e5)
model.spline("s", points=[[0, 0], [1, 1]])
model.marker("mk", body="bob", point=[0, 0, 0], global_=True)
model.support("clamp", body="plate", edge="x0", hold="all")
model.event("e", when="t > 1", stop=True, set={"push": 1})
model.sensor("s1", "bob.position.x")
model.input("push", 0)
result = model.run(until=1.0, quantities=["bob.position"], threads=1, device="cpu", progress=False)
x: float = result["bob.position.x"][-1]
n = result.t.shape
esp.Solver(sp.eye_array(3).tocsc(), threads=2, kind="ldlt").solve(np.ones(3)).shape
esp.solve(sp.eye_array(3).tocsc(), np.ones(3), symmetry="lower", threads=1, progress=False).sum()
model.statics(linear=True)
model.modes(4)["frequency"].max()
model.harmonic(loads="push", between=(1, 2), points=3, tolerance=1e-3)
sim = esp.Simulation(model, set={"a": 1}, threads=2)
esp.sweep(model, {"parameters.m": [1, 2]}, workers=1, until=0.1, threads=1)
esp.derivatives(model, ["parameters.m"], quantities="bob.position.x").gradient("x").sum()
for k in range(3):
    model.body(f"n{k}", "point", mass=k + 1.0, position=[k, 0.5, 0])
a = np.linspace(0, 1, 3)
model.body("q", "point", mass=1, position=a)
model.body("w", "cable", start=[0, 0, 0], end=[1, 0, a[0]], radius=0.1, material="steel")
model.body("i", mass=np.int64(3), inertia=np.array([1, 2, 3]), position=range(3))
model.spline("sp", points=np.zeros((4, 2)))
model.body("bm", "beam", points=np.zeros((4, 3)), radius=0.1, material={"young": 1e9, "density": 1.0})
