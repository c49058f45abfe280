"""results.vtkhdf as VTK's own reader sees it. The truth: the .vtu files of the same run, quantities.csv, closed forms."""

import csv
import os
import pathlib
import random
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import espalier as esp

vtk = pytest.importorskip("vtk", reason="vtk is not installed")
from vtk.util.numpy_support import vtk_to_numpy  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[3]
PENDULUM = """gravity = [0, -9.81, 0]
[bodies.bob]
type = "rigid"
mass = 2
inertia = [0.1, 0.1, 0.1]
position = [1, 0, 0]
[joints.hinge]
type = "revolute"
bodies = ["ground", "bob"]
at = [0, 0, 0]
axis = [0, 0, 1]
[integrator]
max_step = 1e-3
end = 1
[output]
quantities = ["bob.position", "hinge.force"]
vtu_interval = 0.1
"""


class Reader:
    def __init__(self, path):
        self.errors = []
        self.reader = vtk.vtkHDFReader()
        self.reader.AddObserver("ErrorEvent", lambda *_: self.errors.append("error"))
        self.reader.SetFileName(str(path))
        self.reader.UpdateInformation()
        info = self.reader.GetOutputInformation(0)
        key = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
        self.times = [info.Get(key, k) for k in range(info.Length(key))]

    def grid(self, k):
        self.reader.SetStep(k)
        self.reader.Update()
        assert not self.errors
        grid = vtk.vtkUnstructuredGrid()
        grid.DeepCopy(self.reader.GetOutputDataObject(0))
        return grid


def arrays(data):
    return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}


def series(path):
    """Times and grids of a .pvd file."""
    import re
    rows = re.findall(r'timestep="([^"]+)"[^>]*file="([^"]+)"', path.read_text())
    grids = []
    for _, name in rows:
        reader = vtk.vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(path.parent / name))
        reader.Update()
        grids.append(reader.GetOutput())
    return [float(t) for t, _ in rows], grids


def same(one, other):
    """Frames of the two formats: places to 1e-9 of themselves, fields in single precision."""
    def cells(grid):
        return (vtk_to_numpy(grid.GetCells().GetConnectivityArray()), vtk_to_numpy(grid.GetCells().GetOffsetsArray()),
                [grid.GetCellType(k) for k in range(grid.GetNumberOfCells())])
    for a, b in zip(cells(one), cells(other)):
        assert list(a) == list(b)
    np.testing.assert_allclose(vtk_to_numpy(one.GetPoints().GetData()), vtk_to_numpy(other.GetPoints().GetData()), rtol=2e-10, atol=0)
    for get in ("GetPointData", "GetCellData"):
        a, b = arrays(getattr(one, get)()), arrays(getattr(other, get)())
        assert sorted(a) == sorted(b)
        for name in a:
            np.testing.assert_allclose(a[name], b[name], rtol=6e-8, atol=1e-40, err_msg=name)


def both(model, tmp_path, name="results", old="motion", settings=None, **more):
    for style in ("vtu", "vtkhdf"):
        esp.Simulation(model, out=tmp_path / style, set={**(settings or {}), "output.format": style}, **more).run()
    times, grids = series(tmp_path / "vtu" / f"{old}.pvd")
    reader = Reader(tmp_path / "vtkhdf" / f"{name}.vtkhdf")
    assert reader.times == times
    for k, grid in enumerate(grids):
        same(reader.grid(k), grid)
    for k in reversed(range(len(grids))):  # in any order
        same(reader.grid(k), grids[k])
    return reader


def test_an_engine_of_flexible_and_rigid_bodies_is_that_of_the_vtu_files(tmp_path):
    reader = both(ROOT / "models/engine.toml", tmp_path, until=4e-4, settings={"output.vtu_interval": 8e-6, "output.energies": False, "output.constraints": False})
    assert len(reader.times) == 51
    body = arrays(reader.grid(0).GetCellData())["body"]
    assert set(body) == set(range(int(body.max()) + 1)) and body.max() >= 2
    sizes = [sum(f.stat().st_size for f in (tmp_path / style).glob(pattern))
             for style, pattern in (("vtkhdf", "*.vtkhdf"), ("vtu", "*.vtu"))]
    assert sizes[0] < sizes[1] / 3, sizes
    assert not list((tmp_path / "vtkhdf").glob("*.vtu")) and not list((tmp_path / "vtkhdf").glob("*.part"))


def test_pressure_of_contacts_and_a_statics_run(tmp_path):
    (tmp_path / "falls.toml").write_text("""gravity = [0, 0, -10]
[bodies.block]
type = "solid"
mesh = { part = "block", lx = 0.2, ly = 0.1, lz = 0.1, divisions = [2, 1, 1] }
material = { young = 1e6, poisson = 0.3, density = 1000 }
position = [0, 0, 0.0001]
[bodies.ball]
type = "rigid"
mass = 1
inertia = [1e-3, 1e-3, 1e-3]
position = [0, 0, 1]
[surfaces.block]
body = "block"
shape = "faces"
[surfaces.floor]
body = "ground"
shape = "plane"
[surfaces.ball]
body = "ball"
shape = "sphere"
radius = 0.05
[contacts.floor]
surfaces = ["block", "floor"]
stiffness = 1e9
[integrator]
end = 0.02
""")
    reader = both(tmp_path / "falls.toml", tmp_path / "falls", settings={"output.vtu_interval": 4e-4})
    assert max(arrays(reader.grid(k).GetPointData())["contact_pressure"].max() for k in range(len(reader.times))) > 100
    model = """gravity = [0, 0, -10]
[bodies.beam]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.1, lz = 0.1, divisions = [6, 1, 1] }
material = { young = 1e8, poisson = 0.3, density = 1000 }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.05, 0.05] }
b = { body = "beam", face = "x0" }
[statics]
largest_step = 0.25
[output]
vtu_interval = 0
quantities = ["beam.position.z"]
"""
    (tmp_path / "beam.toml").write_text(model)
    reader = both(tmp_path / "beam.toml", tmp_path / "statics")
    assert reader.times[0] == 0 and reader.times[-1] == 1
    heights = [arrays(reader.grid(k).GetFieldData())["beam.position.z"][0] for k in range(len(reader.times))]
    assert heights == sorted(heights, reverse=True) and heights[0] > heights[-1]


def test_shapes_of_modes_and_responses(tmp_path):
    model = tmp_path / "rod.toml"
    model.write_text("""[bodies.rod]
type = "solid"
mesh = { part = "block", lx = 1.0, ly = 0.1, lz = 0.1, divisions = [6, 1, 1] }
material = { young = 1e8, poisson = 0.3, density = 1000 }
damping = { stiffness = 1e-4 }
[joints.wall]
type = "fixed"
a = { body = "ground", point = [0, 0.05, 0.05] }
b = { body = "rod", face = "x0" }
[forces.tip]
type = "load"
a = { body = "rod", face = "x1" }
force = [0, 0, 1]
[initial]
modes = 2
[integrator]
end = 1e-3
[harmonic]
from = 1
to = 20
points = 3
loads = ["tip"]
quantities = ["rod.position.z"]
shapes = [5]
""")
    reader = both(model, tmp_path, "modes", "modes")
    assert reader.times == [1, 2]
    reader = both(model, tmp_path / "more", "harmonic_tip", "harmonic_tip")
    assert len(reader.times) == 8


def test_quantities_at_the_frames_are_those_of_the_table(tmp_path):
    (tmp_path / "model.toml").write_text(PENDULUM + "exact_times = true\nenergies = false\n")
    esp.Simulation(tmp_path / "model.toml", out=tmp_path / "out").run()
    reader = Reader(tmp_path / "out/results.vtkhdf")
    with open(tmp_path / "out/quantities.csv", newline="") as file:
        rows = {round(float(row["time"]), 9): row for row in csv.DictReader(file)}
    assert len(reader.times) == 11
    for k, t in enumerate(reader.times):
        found, row = arrays(reader.grid(k).GetFieldData()), rows[round(t, 9)]
        assert set(row) - {"time"} == set(found) - {"Time"}
        for name, value in found.items():
            assert value.size == 1
            if name == "Time":  # of the reader
                continue
            if not name.startswith("constraints."):  # between the ends of steps they are those of the step
                assert value[0] == pytest.approx(float(row[name]), rel=1e-9, abs=1e-9), name


def test_many_frames(tmp_path):
    """More than fit into two levels of the index, each read by VTK."""
    (tmp_path / "model.toml").write_text(PENDULUM.replace("max_step = 1e-3\nend = 1", "max_step = 2e-4\nend = 0.9"))
    esp.Simulation(tmp_path / "model.toml", out=tmp_path / "out", set={"output.vtu_interval": 0}).run()
    reader = Reader(tmp_path / "out/results.vtkhdf")
    assert len(reader.times) > 64 * 64
    for k in [*range(0, 200, 9), *range(4080, 4120, 3), len(reader.times) - 1]:
        centre = vtk_to_numpy(reader.grid(k).GetPoints().GetData()).mean(axis=0)
        assert np.hypot(*centre[:2]) == pytest.approx(1, rel=1e-9)  # the corners of a box about its centre of mass
        found = arrays(reader.grid(k).GetFieldData())
        assert found["bob.position.x"][0] == pytest.approx(centre[0], rel=1e-9)


def started(model, out, *arguments):
    code = ("import sys, espalier as e\n"
            "e.Simulation(sys.argv[1], out=sys.argv[2], set=dict(a.split('=') for a in sys.argv[3:])).run()")
    return subprocess.Popen([sys.executable, "-c", code, str(model), str(out), *arguments], stdout=subprocess.DEVNULL,
                            stderr=subprocess.PIPE)


def test_killed_at_any_time_it_is_complete_up_to_its_last_frame(tmp_path):
    (tmp_path / "model.toml").write_text(PENDULUM.replace("end = 1", "end = 1e4"))
    rng, seen = random.Random(4), 0
    for k in range(int(os.environ.get("ESPALIER_KILLS", "4"))):
        out = tmp_path / f"out{k}"
        process = started(tmp_path / "model.toml", out, "output.vtu_interval=0")
        path = out / "results.vtkhdf"
        while not path.exists() and process.poll() is None:
            time.sleep(0.002)
        time.sleep(rng.uniform(0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stderr.close()
        reader = Reader(path)
        count = len(reader.times)
        assert count > 0 and reader.times == sorted(set(reader.times))
        for frame in {0, count // 2, max(0, count - 2), count - 1}:
            centre = vtk_to_numpy(reader.grid(frame).GetPoints().GetData()).mean(axis=0)
            assert np.hypot(*centre[:2]) == pytest.approx(1, rel=1e-9)
        with open(out / "quantities.csv") as file:
            rows = sum(1 for _ in file) - 1
        assert count >= rows - 4  # the table is written at once, frames by a thread of their own with two waiting
        seen += count
    assert seen > 100


def test_a_disk_that_is_full_and_a_folder_without_rights(tmp_path):
    (tmp_path / "model.toml").write_text(PENDULUM)
    code = ("import sys, signal, resource, espalier as e\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (300000, 300000))\n"
            "try: e.Simulation(sys.argv[1], out=sys.argv[2], page=False, set={'output.vtu_interval': 0, 'output.csv_interval': False}).run()\n"
            "except Exception as error: print(error)")
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "model.toml", tmp_path / "out"], capture_output=True, text=True, timeout=60)
    assert "results.vtkhdf: writing failed" in done.stdout and "is the disk full?" in done.stdout, done.stdout + done.stderr
    reader = Reader(tmp_path / "out/results.vtkhdf")  # what had room
    assert len(reader.times) > 10
    assert np.hypot(*vtk_to_numpy(reader.grid(len(reader.times) - 1).GetPoints().GetData()).mean(axis=0)[:2]) == pytest.approx(1)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken/results.vtkhdf.espalier.part").mkdir()
    with pytest.raises(Exception, match="results.vtkhdf.*Is a directory"):
        esp.Simulation(tmp_path / "model.toml", out=tmp_path / "taken").run()


def test_what_an_earlier_run_left_in_the_other_format_goes(tmp_path):
    (tmp_path / "model.toml").write_text(PENDULUM)
    for style, there, gone in (("vtu", "motion.pvd", "results.vtkhdf"), ("vtkhdf", "results.vtkhdf", "motion.pvd"), ("vtu", "motion.pvd", "results.vtkhdf")):
        esp.Simulation(tmp_path / "model.toml", out=tmp_path / "out", set={"output.format": style}).run()
        assert (tmp_path / "out" / there).exists() and not (tmp_path / "out" / gone).exists()
        assert any((tmp_path / "out").glob("*.vtu")) == (style == "vtu")
    with pytest.raises(Exception, match="did you mean|vtkhdf"):
        esp.Simulation(tmp_path / "model.toml", out=tmp_path / "out", set={"output.format": "vtk"})
