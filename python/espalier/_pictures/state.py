"""What is drawn of a scene at one time: places, values of a field, arrows, and where the field is largest."""

from typing import Any, NamedTuple

from .scene import FIELDS, Scene

SIGNED_FIELDS = ("principal", "strain")


class State(NamedTuple):
    """What is drawn of one time."""

    t: float
    rows: "dict[str, Any]"
    points: Any
    values: Any  # of the field, or None
    arrows: "list[tuple[str, Any, Any]]"  # kind, from, to
    marks: Any  # places, (marks, 3)


class Peak(NamedTuple):
    """Where a field is largest in magnitude."""

    value: float
    body: str
    node: int  # 0: between nodes
    place: "tuple[float, float, float]"


def field_of(scene: Scene, wanted: "str | None") -> "str | None":
    """The field to be coloured; "auto": stress where there is one. None: the bodies have colours."""
    if wanted == "auto":
        return "von_mises" if scene.has("von_mises") else None
    if wanted in (None, "body"):
        return None
    if wanted not in FIELDS:
        raise ValueError(f"scalars={wanted!r}: there are {', '.join(FIELDS)}, body, auto")
    if not scene.has(wanted):
        raise ValueError(f"scalars={wanted!r}: no body of this model has it")
    return wanted


def state_of(scene: Scene, number: int, field: "str | None") -> State:
    import numpy as np

    rows = scene.frame(number)
    points = scene.place(rows)
    values = None if field is None else scene.values(field, rows, points)
    a, b, force = (rows[n].reshape(-1, 3) for n in ("a", "b", "force"))
    most, size, arrows = scene.largest_force(), scene.size, []
    centre = (scene.box[0] + scene.box[1]) / 2
    for k, mark in enumerate(scene.marks):
        length = float(np.linalg.norm(force[k]))
        at = b[k]
        if mark["what"] == "contact" and length > 0:  # it is a line that is known: its point next to the scene
            along = force[k] / length
            at = at + along * ((centre - at) @ along)
        if np.isfinite(at).all() and np.isfinite(length) and length > 0.02 * most > 0:
            arrows.append((mark["what"], at, at + force[k] * (0.2 * size / most)))
    return State(scene.times[number], rows, points, values, arrows, np.stack([a, b], axis=1))


def peak_of(scene: Scene, state: State) -> "Peak | None":
    import numpy as np

    if state.values is None or not np.isfinite(state.values).any():
        return None
    sizes = np.where(np.isfinite(state.values), np.abs(state.values), -1)
    at = int(np.argmax(sizes))
    # Points between nodes have no number: a node that is as high is named instead.
    same = np.flatnonzero((sizes >= sizes[at] * (1 - 1e-9)) & (scene.labels > 0))
    at = int(same[0]) if len(same) else at
    x, y, z = map(float, state.points[at])
    return Peak(float(state.values[at]), scene.bodies[scene.body_of[at]].name, int(scene.labels[at]), (x, y, z))


def limits_of(states: "list[State]", field: "str | None") -> "tuple[float, float]":
    """The whole range: nothing is clipped."""
    import numpy as np

    finite = [v[np.isfinite(v)] for v in (s.values for s in states) if v is not None]
    low = min((float(v.min()) for v in finite if len(v)), default=0.0)
    high = max((float(v.max()) for v in finite if len(v)), default=0.0)
    if field in SIGNED_FIELDS:
        high = max(abs(low), abs(high))
        return -high, high
    return min(low, 0.0), high
