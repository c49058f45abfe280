"""Bodies as meshes and frames. Truth: closed forms of the motion, and the files of a run."""

import pickle
from pathlib import Path

import numpy as np
import pytest

import espalier as esp

ROOT = Path(__file__).parents[3]


def falling():
    model = esp.Model(gravity=[0, 0, -10], integrator={"relative": 1e-9, "absolute": 1e-9, "end": 1.0})
    model.body("box", mass=2, box=[0.2, 0.4, 0.6], position=[1, 0, 0], velocity=[3, 0, 0])
    model.body("speck", "point", mass=1)
    return model


def cantilever(**keys):
    model = esp.Model(gravity=[0, 0, -10], statics={}, **keys)
    model.material("rubber", young=1e6, poisson=0.3, density=1000)
    model.body("beam", "beam", start=[0, 0, 0], end=[1, 0, 0], elements=4, radius=0.05, material="rubber")
    model.joint("clamp", "fixed", a={"body": "ground"}, b={"body": "beam", "node": 1})
    return model


def test_frames_are_evenly_spaced_and_true():
    result = falling().run(frames=0.1, quantities="box.position")
    t = np.array([f.t for f in result.frames])
    assert t == pytest.approx(np.linspace(0, 1, 11), abs=1e-12)
    assert result.cells.bodies == ["box", "speck"] and list(result.cells.types) == [12, 1]  # VTK's hexahedron, vertex
    assert list(result.cells.offsets) == [0, 8, 9] and list(result.cells.connectivity) == list(range(9))
    assert list(result.cells.body) == [0, 1]
    for frame in result.frames:
        fall = -5 * frame.t**2
        assert frame.points[:8].mean(axis=0) == pytest.approx([1 + 3 * frame.t, 0, fall], abs=1e-7)
        assert np.ptp(frame.points[:8], axis=0) == pytest.approx([0.2, 0.4, 0.6])
        assert frame.displacement[8] == pytest.approx([0, 0, fall], abs=1e-7)
        assert frame.velocity[8] == pytest.approx([0, 0, -10 * frame.t], abs=1e-6)
        assert (frame.von_mises == 0).all()
    again = pickle.loads(pickle.dumps(result))
    assert (again.frames[3].points == result.frames[3].points).all()


def test_every_step_the_present_state_and_states_restored():
    sim = esp.Simulation(falling(), frames=0)
    sim.step(0.25)
    saved = sim.save()
    sim.step(0.25)
    result = sim.result()
    assert [f.t for f in result.frames] == list(result.t)
    now = sim._core.frame()
    assert now[0] == 0.5 and (now[1] == result.frames[-1].points).all()
    sim.restore(saved)
    assert sim.result().frames[-1].t == 0.25
    sim.step(0.25)
    times = [f.t for f in sim.result().frames]
    assert times[-1] == 0.5 and times == sorted(set(times))
    assert esp.Simulation(falling(), page=False).run().frames == ()


def test_what_is_not_kept_is_told():
    result = falling().run(until=0.1, page=False)
    for call in (result.mesh, result.meshes, result.picture, result.animate):
        with pytest.raises(ValueError, match="page=False"):
            call()
    for frames in (-1, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="frames"):
            esp.Simulation(falling(), frames=frames)
    with pytest.raises(esp.InvalidInputError, match="more than 1e"):
        esp.Simulation(falling(), frames=1e-12)
    with pytest.raises((TypeError, ValueError)):
        esp.Simulation(falling(), frames="often")


def test_statics_have_load_factors():
    result = cantilever().run(frames=0, quantities="beam.position.z")
    assert [f.t for f in result.frames] == list(result.t) and result.frames[-1].t == 1
    assert result.frames[0].displacement.max() == 0 and result.frames[-1].displacement[-1, 2] < -0.01
    assert set(result.cells.types) == {3}  # VTK's line


def test_frames_are_those_of_the_files(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    result = esp.Simulation(ROOT / "models/chain.toml", set={"parameters.unknowns": 1000, "output.vtu_interval": 2e-4, "output.format": "vtu"},
                            until=1e-3, frames=2e-4, out=tmp_path).run()
    files = sorted(tmp_path.glob("motion*.vtu"))
    assert len(files) == len(result.frames) == 6
    for frame, file in zip(result.frames, files):
        grid = pyvista.read(file)
        assert (np.asarray(grid.points) == frame.points).all()
        assert (grid.cell_data["von_mises"] == frame.von_mises).all()
        assert (grid.point_data["displacement"] == frame.displacement).all()
        assert (grid.point_data["velocity"] == frame.velocity).all()
        mesh = result.mesh()
        assert (grid.cells == mesh.cells).all() and (grid.celltypes == mesh.celltypes).all()
    assert result.frames[-1].von_mises.max() > 0


def test_meshes_of_pyvista():
    pyvista = pytest.importorskip("pyvista")
    result = falling().run(frames=0.5)
    mesh = result.mesh(0.6)
    assert isinstance(mesh, pyvista.UnstructuredGrid) and mesh.n_cells == 2 and mesh.n_points == 9
    assert mesh.field_data["t"][0] == 0.5 and mesh.active_scalars_name == "von_mises"
    assert mesh.extract_cells(0).volume == pytest.approx(0.2 * 0.4 * 0.6)
    mesh.points[:] = 0  # a copy
    assert np.ptp(result.frames[1].points) > 0
    blocks = result.meshes()
    assert isinstance(blocks, pyvista.MultiBlock) and blocks.n_blocks == 3
    assert result.mesh().field_data["t"][0] == 1
    sim = esp.Simulation(falling())
    assert sim.mesh().points[:8].mean(axis=0) == pytest.approx([1, 0, 0])
    sim.step(1)
    assert sim.mesh().points[:8].mean(axis=0) == pytest.approx([4, 0, -5], abs=1e-6)
    surface = sim.result().mesh(0)  # of the page
    assert surface.extract_surface(algorithm=None).area == pytest.approx(2 * (0.08 + 0.12 + 0.24)) and surface.field_data["t"][0] == 0
    assert set(surface.point_data) == {"displacement", "speed", "von_mises", "principal"}


def test_without_pyvista(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(ImportError, match="pip install pyvista"):
        falling().run(frames=1).mesh()
