"""Mistakes that mypy must find, each in its line with these words (test_parts.py). Nobody runs this."""
import espalier as esp
model = esp.Model(gravty=1)  # wrong: gravity
model = esp.Model(integrator={"ende": 1.0})  # wrong: Integrator
model.body("bob", mas=1)  # wrong: did you mean "mass"?
model.body("bob", mass=[1, 2])  # wrong: No overload
model.body("bob", mass=1, bx=[1, 1, 1])  # wrong: did you mean "box"?
model.body("bob", mass=1, position=3)  # wrong: No overload
model.body("bob", "rgid", mass=1)  # wrong: No overload
model.body("bob", "point", mass=1, box=[1, 1, 1])  # wrong: No overload
model.body("s", "solid", mesh={"fil": "x"})  # wrong: No overload
model.joint("h", "revolute", bodies=["ground", "bob"], at=[0, 0, 0], limits={"lowr": 1})  # wrong: No overload
model.joint("h", "revolute", motion="t")  # wrong: No overload
model.joint("h", "rotation-motor", bodies=["ground", "bob"], at=[0, 0, 0])  # wrong: No overload
model.force("f", "spring", stifness=1)  # wrong: did you mean "stiffness"?
model.run(unti=3)  # wrong: did you mean "until"?
model.run(until="3")  # wrong: incompatible type
esp.Simulation(model, thread=1)  # wrong: did you mean "threads"?
esp.sweep(model, {"a": [1]}, frame=0.1)  # wrong: did you mean "frames"?
esp.derivatives(model, ["a"], metod="adjoint")  # wrong: did you mean "method"?
esp.Solver(None, kind="cholesky")  # wrong: incompatible type
model.surface("s", "box", body="ground", radius=1)  # wrong: No overload
model.contact("c", stiffness=1)  # wrong: Missing named argument "surfaces"
r = model.run()
r["a"].shap  # wrong: maybe "shape"?
esp.solve(None, None, thread=1)  # wrong: did you mean "threads"?
r.summry  # wrong: maybe "summary"?
