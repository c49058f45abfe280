"""The scene of a page, for programs: what a browser draws, read from the page itself (docs/design/page.md)."""

import json
import re
from base64 import b64decode
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple
from zlib import decompress

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

FIELDS = {"von_mises": "von Mises stress, force/length²", "principal": "principal stress, force/length²", "strain": "principal strain, 1",
          "displacement": "displacement, length", "deformation": "deformation, length", "velocity": "velocity, length/time"}


class SurfaceFrame(NamedTuple):
    """The surfaces of the bodies at one time, as a page has them: numbers of 16 bits over their range. points,
    displacement (from the start): (points, 3); speed, von_mises, principal (the principal stress of the largest
    magnitude): (points,), means at the nodes, NaN where there is none. In the units of the model."""

    t: float
    points: "NDArray[np.floating[Any]]"
    displacement: "NDArray[np.floating[Any]]"
    speed: "NDArray[np.floating[Any]]"
    von_mises: "NDArray[np.floating[Any]]"
    principal: "NDArray[np.floating[Any]]"

    def __repr__(self) -> str:
        return f"<espalier.SurfaceFrame at t = {self.t:g}: {len(self.points)} points>"


class Body(NamedTuple):
    name: str
    kind: str
    rigid: bool
    first: int  # of its points
    count: int
    slot: int  # rigid: which of the rigid ones; else the first of its points among those of flexible bodies


def _unpacked(letters: str) -> bytes:
    return decompress(b64decode(letters), 31) if letters else b""


class Scene:
    """points: how many; triangles (n, 3), edges (n, 2): int32, of points; labels: (points,), numbers of nodes, 0 between
    nodes; body_of: (points,); times; marks, ground: as the page has them."""

    def __init__(self, page: str) -> None:
        import numpy as np

        self._page = page
        self._blocks = {m[1]: m.end() for m in re.finditer(r'<script type="[^"]*" id="(\w+)">', page)}
        self.data = json.loads(self._block("data"))
        self.scene = scene = self.data["scene"]
        self.points, self.marks, self.ground = scene["points"], scene["marks"], scene["ground"]
        self.times = [frame["t"] for frame in scene["frames"]]
        lists = np.frombuffer(_unpacked(self._piece(scene["lists"])), np.int32)
        corners, ends = 3 * scene["triangles"], 3 * scene["triangles"] + 2 * scene["edges"]
        self.triangles, self.edges = lists[:corners].reshape(-1, 3), lists[corners:ends].reshape(-1, 2)
        self.labels = lists[ends:]
        self.local = np.frombuffer(_unpacked(self._piece(scene["local"])), np.float32).reshape(-1, 3)
        self.body_of = np.zeros(self.points, np.int32)
        self.bodies, rigid, flexible = [], 0, 0
        for k, b in enumerate(scene["bodies"]):
            self.bodies.append(Body(b["name"], b["kind"], b["rigid"], b["first"], b["count"], rigid if b["rigid"] else flexible))
            self.body_of[b["first"]:b["first"] + b["count"]] = k
            rigid, flexible = rigid + b["rigid"], flexible + (0 if b["rigid"] else b["count"])
        self.rigid = np.array([b.rigid for b in self.bodies], bool)[self.body_of]
        self._owner = np.array([b.slot for b in self.bodies], np.int64)[self.body_of[self.rigid]]  # of the rows of `local`
        self._last_piece = (-1, b"")
        rest = np.frombuffer(_unpacked(self._piece(scene["rest"])), np.uint8)
        self.rest = self.place(self._rows(rest, scene["rest_ranges"], 7))

        self._measure()

    def _measure(self) -> None:
        """box: of everything in the run, from some of the frames; size: its longest side; up: against gravity, or z."""
        import numpy as np

        frames = range(0, len(self.times), max(1, len(self.times) // 16))
        seen = [self.rest] + [self.place(self.frame(k)) for k in frames]
        points = np.concatenate([x[np.isfinite(x).all(axis=1)] for x in seen])
        self.box = np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else np.array([[-1.0] * 3, [1.0] * 3])
        self.size = float((self.box[1] - self.box[0]).max()) or 1.0
        gravity = np.array(self.data["gravity"], float)
        weight = np.linalg.norm(gravity)
        self.up = -gravity / weight if 0 < weight < np.inf else np.array([0.0, 0.0, 1.0])

    def largest_force(self) -> float:
        """Of all marks in the run, from the ranges of the numbers."""
        k = [name for name, _ in self.scene["sections"]].index("force")
        return max((abs(x) for frame in self.scene["frames"] for x in frame["ranges"][2 * k:2 * k + 2]), default=0.0)

    def _block(self, name: str) -> str:
        start = self._blocks[name]
        return self._page[start:self._page.index("</script>", start)]

    def _piece(self, number: int) -> str:
        return self._block(f"piece{number}")

    def _rows(self, block: Any, ranges: "list[float]", count: int) -> "dict[str, Any]":
        """The first `count` sections of a block by name: all low bytes come first, then all high bytes; 65535 is NaN."""
        import numpy as np

        size = len(block) // 2
        numbers = block[:size].astype(np.int32) | (block[size:].astype(np.int32) << 8)
        out, start = {}, 0
        for (name, length), low, high in zip(self.scene["sections"][:count], ranges[::2], ranges[1::2]):
            part = numbers[start:start + length]
            out[name] = np.where(part == 65535, np.nan, low + part * ((high - low) / 65534))
            start += length
        return out

    def frame(self, number: int) -> "dict[str, Any]":
        """What a frame holds, by the names of its sections."""
        import numpy as np

        at = self.scene["frames"][number]
        if self._last_piece[0] != at["piece"]:
            self._last_piece = (at["piece"], _unpacked(self._piece(at["piece"])))
        size = 2 * sum(length for _, length in self.scene["sections"])
        block = np.frombuffer(self._last_piece[1], np.uint8)[size * at["place"]:size * (at["place"] + 1)]
        return self._rows(block, at["ranges"], len(self.scene["sections"]))

    def nearest(self, t: "float | None") -> int:
        """The frame next to a time; None: the last."""
        if not self.times:
            raise ValueError("the page has no pictures: nothing has run yet")
        return len(self.times) - 1 if t is None else min(range(len(self.times)), key=lambda k: abs(self.times[k] - t))

    def place(self, rows: "dict[str, Any]") -> Any:
        """Where all points are, (points, 3)."""
        import numpy as np

        out = np.empty((self.points, 3))
        out[~self.rigid] = np.stack([rows[name] for name in "xyz"], axis=1)
        q, r = rows["turn"].reshape(-1, 4)[self._owner], np.stack([rows[n] for n in ("px", "py", "pz")], axis=1)
        along = np.cross(q[:, :3], self.local)
        out[self.rigid] = self.local + 2 * (q[:, 3:] * along + np.cross(q[:, :3], along)) + r[self._owner]
        return out

    def _of_points(self, values: Any) -> Any:
        """Values of the points of flexible bodies at all points."""
        import numpy as np

        out = np.full(self.points, np.nan)
        if len(values):
            out[~self.rigid] = values
        return out

    def _speed(self, rows: "dict[str, Any]", points: Any) -> Any:
        import numpy as np

        out = self._of_points(rows["speed"])
        v, w = (rows[n].reshape(-1, 3)[self._owner] for n in ("velocity", "omega"))
        arm = points[self.rigid] - np.stack([rows[n] for n in ("px", "py", "pz")], axis=1)[self._owner]
        out[self.rigid] = np.linalg.norm(v + np.cross(w, arm), axis=1)
        return out

    def _deformation(self, points: Any) -> Any:
        """What is left of the displacements of flexible bodies without the best rigid motion (Kabsch)."""
        import numpy as np

        out = np.full(self.points, np.nan)
        for b in self.bodies:
            own = slice(b.first, b.first + b.count)
            if b.rigid or not b.count or not np.isfinite(points[own]).all():
                continue
            a, c = self.rest[own] - self.rest[own].mean(axis=0), points[own] - points[own].mean(axis=0)
            u, _, vt = np.linalg.svd(a.T @ c)
            u[:, 2] *= np.sign(np.linalg.det(u @ vt)) or 1
            out[own] = np.linalg.norm(c - a @ u @ vt, axis=1)
        return out

    def has(self, field: str) -> bool:
        """Whether a field is known at any point; "velocity" is that of `speed`."""
        lengths = dict(self.scene["sections"])
        return bool(self.points) and (lengths.get(field, 0) > 0 or field in ("displacement", "velocity") or
                                      (field == "deformation" and not self.rigid.all()))

    def values(self, field: str, rows: "dict[str, Any]", points: Any) -> Any:
        """A field at all points, NaN where there is none."""
        import numpy as np

        if field == "displacement":
            return np.linalg.norm(points - self.rest, axis=1)
        if field == "velocity":
            return self._speed(rows, points)
        return self._deformation(points) if field == "deformation" else self._of_points(rows.get(field, ()))

    def surface(self, number: int) -> SurfaceFrame:
        rows = self.frame(number)
        points = self.place(rows)
        return SurfaceFrame(self.times[number], points, points - self.rest, self._speed(rows, points),
                            self._of_points(rows["von_mises"]), self._of_points(rows["principal"]))


class Frames(Sequence):  # type: ignore[type-arg]
    """The frames of a page, each unpacked when it is asked for."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def __len__(self) -> int:
        return len(self._scene.times)

    def __getitem__(self, k: Any) -> Any:
        if isinstance(k, slice):
            return [self[i] for i in range(len(self))[k]]
        return self._scene.surface(range(len(self))[k])

    def __repr__(self) -> str:
        t = self._scene.times
        return f"<{len(t)} frames{f', t = {t[0]:.6g} to {t[-1]:.6g}' if t else ''}>"
