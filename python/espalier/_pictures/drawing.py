"""Pictures of a scene without a window: NumPy draws the bodies, Pillow the letters, arrows and the bar of colours."""

from typing import Any

from .raster import Raster, creased_normals
from .scene import FIELDS, Scene
from .state import SIGNED_FIELDS, State, field_of, limits_of, peak_of, state_of

# As in the page: src/dynamics/page/browser/colours.js, marks.js.
MAP = [(48, 18, 59), (65, 69, 171), (70, 117, 237), (57, 162, 252), (27, 207, 212), (36, 236, 166), (97, 252, 108),
       (164, 252, 60), (209, 232, 52), (243, 198, 58), (254, 155, 45), (243, 99, 21), (217, 56, 6), (177, 25, 1), (122, 4, 2)]
SIGNED = [(33, 102, 172), (103, 169, 207), (209, 229, 240), (247, 247, 247), (253, 219, 199), (239, 138, 98), (178, 24, 43)]
BODIES = [(126, 148, 173), (196, 144, 92), (118, 164, 120), (176, 122, 152), (160, 152, 98), (104, 160, 172), (186, 118, 108),
          (134, 130, 186), (150, 150, 150), (98, 138, 128), (202, 170, 118), (148, 112, 96)]
NEUTRAL = (0.72, 0.74, 0.77)  # what has no value
MARKS = {"joint": (224, 161, 0), "support": (46, 158, 91), "force": (210, 54, 43), "contact": (138, 60, 255)}
INK, QUIET = (27, 31, 36), (91, 100, 112)


def _axes(scene: Scene, view: Any) -> Any:
    """Rows: right, up, and towards the eye."""
    import numpy as np

    up = scene.up
    if isinstance(view, str) and len(view) == 2 and set(view) <= set("xyz") and view[0] != view[1]:
        right, up = np.eye(3)["xyz".index(view[0])], np.eye(3)["xyz".index(view[1])]
        return np.array([right, up, np.cross(right, up)])
    if view is None:
        extent = scene.box[1] - scene.box[0]
        thin = int(np.argmin(extent))
        flat = extent[thin] < 0.25 * extent.max() and abs(up[thin]) < 0.5
        eye = (-1 if thin == 1 else 1) * np.eye(3)[thin] if flat else None
    elif isinstance(view, str) and view in ("iso", "corner"):
        eye = None
    else:
        try:
            eye = np.array(view, float)
        except (TypeError, ValueError):
            eye = np.zeros(0)
        if eye.shape != (3,) or not 0 < np.linalg.norm(eye) < np.inf:
            raise ValueError(f"view={view!r}: it must be 'xy' (x to the right, y up), 'xz', 'zy' ..., 'iso', "
                             "or the direction of the eye, three numbers")
    side = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    if eye is None:  # a corner of the page: 1, -1.6, 0.9 where z is up
        x = np.array([1.0, 0, 0]) if abs(up[0]) < 0.9 else np.array([0, 1.0, 0])
        x = x - (x @ up) * up
        x /= np.linalg.norm(x)
        eye = x - 1.6 * np.cross(up, x) + 0.9 * up
    eye = eye / np.linalg.norm(eye)
    right = np.cross(up, eye)
    right = side / np.linalg.norm(side) if np.linalg.norm(right) < 1e-6 else right / np.linalg.norm(right)
    return np.array([right, np.cross(eye, right), eye])


def _font(size: float) -> Any:
    from PIL import ImageFont

    try:
        return ImageFont.load_default(size)
    except TypeError:  # Pillow before 10.1
        return ImageFont.load_default()


class Camera:
    """Looks at all of some states, without perspective."""

    def __init__(self, scene: Scene, states: "list[State]", view: Any, size: "tuple[int, int]", bar: bool) -> None:
        import numpy as np

        self.axes = _axes(scene, view)
        self.size = size
        self.letters = float(np.clip(13 * (min(size[0] / 800, size[1] / 500)) ** 0.5, 8, 26))
        f = self.letters
        seen = [s.points for s in states] + [s.marks.reshape(-1, 3) for s in states]
        seen += [np.array([x for _, a, b in s.arrows for x in (a, b)]).reshape(-1, 3) for s in states]
        flat = np.concatenate(seen) @ self.axes[:2].T
        flat = flat[np.isfinite(flat).all(axis=1)]
        low, high = (flat.min(axis=0), flat.max(axis=0)) if len(flat) else (np.zeros(2), np.ones(2))
        self.left, right, top, bottom = 1.5 * f, (10 if bar else 1.5) * f, 3.2 * f, 4.2 * f
        wide, tall = max(8.0, size[0] - self.left - right), max(8.0, size[1] - top - bottom)
        span = np.maximum(high - low, 1e-9 * max(scene.size, 1e-300))
        self.scale = float(min(wide / span[0], tall / span[1]))
        if not np.isfinite(self.scale):
            self.scale = 1.0
        self.middle = (low + high) / 2
        self.centre = np.array([self.left + wide / 2, top + tall / 2])

    def flat(self, x: Any) -> Any:
        """Pixels, y down, of places (..., 3)."""
        import numpy as np

        return self.centre + self.scale * (x @ self.axes[:2].T - self.middle) * np.array([1.0, -1.0])


def _mapped(stops: Any, share: Any) -> Any:
    import numpy as np

    table = np.array(stops) / 255
    at = np.linspace(0, 1, len(table))
    return np.stack([np.interp(share, at, table[:, i]) for i in range(3)], axis=-1)


def bodies_drawn(scene: Scene, state: State, camera: Camera, field: "str | None", limits: "tuple[float, float]") -> Any:
    """The picture without letters, (height, width, 3), averaged over 2 x 2."""
    import numpy as np

    fine = 2 if camera.size[0] * camera.size[1] <= 1_500_000 else 1
    raster = Raster(fine * camera.size[0], fine * camera.size[1])
    xy, depth = fine * camera.flat(state.points), state.points @ camera.axes[2]
    span = (limits[1] - limits[0]) or 1.0
    own = np.array([BODIES[k % len(BODIES)] for k in range(max(1, len(scene.bodies)))]) / 255
    light = np.array([0.32, 0.56, 0.77]) @ camera.axes

    def shaded(rgb: Any, normal: Any) -> Any:
        normal = np.where((normal @ camera.axes[2])[:, None] < 0, -normal, normal)
        return np.minimum(rgb * (0.55 + 0.5 * np.maximum(0, normal @ light))[:, None], 1)

    def paint(triangles: Any, points: Any, places: Any, depths: Any, colour: Any) -> None:
        normals = creased_normals(points, triangles)
        raster.triangles(places, depths, triangles,
                         lambda t, w: shaded(colour(t, w), np.einsum("mc,mci->mi", w, normals[t])))

    def of_field(t: Any, w: Any) -> Any:
        corners = scene.triangles[t]
        if state.values is None:
            return own[scene.body_of[corners[:, 0]]]
        share = ((state.values[corners] * w).sum(axis=1) - limits[0]) / span
        return np.where(np.isnan(share)[:, None], NEUTRAL, _mapped(SIGNED if field in SIGNED_FIELDS else MAP, share))

    if len(scene.triangles):
        paint(scene.triangles, state.points, xy, depth, of_field)
    planes = []
    for shape in scene.ground:
        if "normal" in shape:
            planes.append((np.array(shape["point"]), np.array(shape["normal"])))
        elif shape["triangles"]:
            points = np.array(shape["points"]).reshape(-1, 3)
            paint(np.array(shape["triangles"]).reshape(-1, 3), points, fine * camera.flat(points), points @ camera.axes[2],
                  lambda t, w: np.broadcast_to((0.6, 0.64, 0.68), (len(t), 3)))
    slack = 2e-3 * scene.size
    faced = np.zeros(scene.points, bool)
    faced[scene.triangles] = True
    on_faces = faced[scene.edges].all(axis=1)
    for bare in (False, True):
        lines = scene.edges[on_faces != bare]
        if len(lines) and (bare or len(lines) < 20_000):
            raster.lines(xy[lines[:, 0]], xy[lines[:, 1]], depth[lines[:, 0]], depth[lines[:, 1]],
                         (0.36, 0.51, 0.71) if bare else (0.1, 0.12, 0.14), 0.3, slack, 2 * fine if bare else 1, bare)
    alone = ~faced
    alone[scene.edges] = False
    if alone.any():
        raster.lines(xy[alone], xy[alone], depth[alone], depth[alone], (0.82, 0.41, 0.12), 1, slack, 7 * fine, True)
    for a, b in _grids(scene, planes):
        raster.lines(fine * camera.flat(a), fine * camera.flat(b), a @ camera.axes[2], b @ camera.axes[2],
                     (0.5, 0.55, 0.62), 0.55 if planes else 0.3)
    image = raster.image()
    return image.reshape(camera.size[1], fine, camera.size[0], fine, 3).mean(axis=(1, 3))


def _grids(scene: Scene, planes: "list[tuple[Any, Any]]") -> Any:
    """Lines on the planes of the ground; without one, on a plane under everything."""
    import numpy as np

    centre = (scene.box[0] + scene.box[1]) / 2
    if not planes:
        corners = np.array([[scene.box[i >> k & 1][k] for k in range(3)] for i in range(8)])
        planes = [(scene.up * ((corners @ scene.up).min() - 0.02 * scene.size), scene.up)]
    for point, normal in planes:
        middle = centre + normal * ((point - centre) @ normal)
        u = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
        u /= np.linalg.norm(u)
        v, at, reach = np.cross(normal, u), np.linspace(-1.2, 1.2, 25)[:, None] * scene.size, 1.2 * scene.size
        for along, across in ((u, v), (v, u)):
            # In pieces, so that each is at its own depth where bodies hide it.
            yield middle + at * across - reach * along, middle + at * across + reach * along


def _number(x: float, digits: int = 4) -> str:
    return f"{x:.{digits}g}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")


def _fitting(draw: Any, text: str, font: Any, width: float) -> str:
    text = " ".join(text.split())
    if draw.textlength(text, font=font) <= width:
        return text
    while text and draw.textlength(text + "...", font=font) > width:
        text = text[:-1]
    return text + "..." if text else ""


def _arrow(draw: Any, a: Any, b: Any, colour: Any, thick: float) -> None:
    import numpy as np

    v = b - a
    length = float(np.hypot(*v))
    if not length > 2 * thick:
        return
    v, side = v / length, np.array([-v[1], v[0]]) / length
    neck = b - v * min(4.5 * thick, 0.6 * length)
    draw.line([tuple(a), tuple(neck)], fill=colour, width=max(1, round(thick)))
    draw.polygon([tuple(b), tuple(neck + 1.8 * thick * side), tuple(neck - 1.8 * thick * side)], fill=colour)


def _marks_drawn(draw: Any, scene: Scene, state: State, camera: Camera) -> None:
    import numpy as np

    crowd = min(1.0, (60 / max(1, len(scene.marks))) ** 0.5)
    r = 0.45 * camera.letters * crowd
    places = camera.flat(state.marks)
    for mark, (a, b) in zip(scene.marks, places):
        if not np.isfinite(b).all():
            continue
        colour, kind = MARKS.get(mark["what"], INK), mark["kind"]
        if any(k in kind for k in ("spring", "bushing", "distance", "link")) and np.isfinite(a).all() and np.hypot(*(a - b)) > 2 * r:
            draw.line([tuple(a), tuple(b)], fill=MARKS["force"], width=max(1, round(0.3 * r)))
        if mark["what"] == "support":
            draw.polygon([tuple(b), (b[0] - r, b[1] + 1.7 * r), (b[0] + r, b[1] + 1.7 * r)], fill=colour, outline=INK)
        elif mark["what"] == "joint":
            box = [b[0] - r, b[1] - r, b[0] + r, b[1] + r]
            square = any(k in kind for k in ("prismatic", "translation", "planar", "fixed"))
            (draw.rectangle if square else draw.ellipse)(box, fill=colour, outline=INK)
    for what, a, b in state.arrows:
        _arrow(draw, camera.flat(a), camera.flat(b), MARKS.get(what, MARKS["force"]), 0.22 * camera.letters * max(0.5, crowd))


def _triad_drawn(draw: Any, camera: Camera, font: Any) -> None:
    import numpy as np

    f = camera.letters
    at = np.array([2.6 * f, camera.size[1] - 2.6 * f])
    for k in np.argsort(camera.axes[2]):
        tip = camera.axes[:2, k] * [1, -1] * 1.6 * f
        colour = ((213, 69, 59), (58, 154, 75), (59, 118, 213))[k]
        if np.hypot(*tip) > 0.1 * f:
            draw.line([tuple(at), tuple(at + tip)], fill=colour, width=max(1, round(0.16 * f)))
            draw.text(tuple(at + 1.4 * tip), "xyz"[k], fill=colour, font=font, anchor="mm")


def _bar_drawn(draw: Any, camera: Camera, field: str, limits: "tuple[float, float]", font: Any) -> None:
    import numpy as np

    f, (width, height) = camera.letters, camera.size
    name, _, unit = FIELDS[field].partition(", ")
    x = width - 9 * f
    words, y = name.split(" "), 3.2 * f
    lines = [" ".join(words[:-1]), words[-1]] if len(words) > 1 and draw.textlength(name, font=font) > 8.8 * f else [name]
    for line in lines:
        draw.text((x, y), line, fill=INK, font=font)
        y += 1.3 * f
    draw.text((x, y), unit.replace("²", "^2"), fill=QUIET, font=font)  # which Pillow's own letters lack
    y += 1.9 * f
    tall = max(4.0, min(height - y - 3 * f, 24 * f))
    for k, rgb in enumerate(_mapped(SIGNED if field in SIGNED_FIELDS else MAP, np.linspace(1, 0, int(tall) + 1))):
        draw.line([(x, y + k), (x + 1.1 * f, y + k)], fill=tuple(int(255 * c) for c in rgb))
    count = max(2, min(5, int(tall / (1.6 * f))))
    for share in np.linspace(0, 1, count):
        draw.text((x + 1.6 * f, y + (1 - share) * tall), _number(limits[0] + share * (limits[1] - limits[0])), fill=INK, font=font,
                  anchor="lm")


def picture(scene: Scene, state: State, camera: Camera, field: "str | None", limits: "tuple[float, float]") -> Any:
    """An image of Pillow."""
    import numpy as np
    from PIL import Image, ImageDraw

    image = Image.fromarray(np.round(255 * bodies_drawn(scene, state, camera, field, limits)).astype(np.uint8))
    draw, f, (width, height) = ImageDraw.Draw(image), camera.letters, camera.size
    font, title_font = _font(f), _font(1.15 * f)
    _marks_drawn(draw, scene, state, camera)
    _triad_drawn(draw, camera, font)
    summary = scene.data["summary"]
    time = f"{'load factor' if 'statics' in summary['method'] else 't ='} {_number(state.t, 6)}"
    room = width - 2 * f - draw.textlength(time, font=title_font) - 2 * f
    draw.text((f, 0.7 * f), _fitting(draw, summary["title"] or scene.data["model"]["name"], title_font, room), fill=INK, font=title_font)
    draw.text((width - f, 0.7 * f), time, fill=INK, font=title_font, anchor="ra")
    if field is not None:
        _bar_drawn(draw, camera, field, limits, font)
        peak = peak_of(scene, state)
        text = "no value is a number"
        if peak is not None:
            node = f"node {peak.node} of {peak.body}" if peak.node else peak.body
            text = f"largest {_number(peak.value)} at {node} ({', '.join(_number(x) for x in peak.place)})"
            at = camera.flat(np.array(peak.place))
            draw.ellipse([*(at - 0.5 * f), *(at + 0.5 * f)], outline=(255, 255, 255), width=3)
            draw.ellipse([*(at - 0.5 * f), *(at + 0.5 * f)], outline=INK, width=1)
        draw.text((5.5 * f, height - 1.8 * f), _fitting(draw, text, font, width - 6.5 * f), fill=INK, font=font)
    return image


def _checked_size(size: Any) -> "tuple[int, int]":
    from .. import _checks

    width, height = (_checks.whole(x, "size", 40, 10_000) for x in _checks.items(size, "size"))
    return width, height


def _pillow() -> None:
    try:
        import PIL  # noqa: F401
    except ImportError as error:
        raise ImportError("pictures need Pillow: pip install pillow") from error


def still(scene: Scene, t: "float | None", scalars: "str | None", size: Any, view: Any, limits: Any) -> Any:
    """The frame nearest to t as an image of Pillow."""
    _pillow()
    size, field = _checked_size(size), field_of(scene, scalars)
    state = state_of(scene, scene.nearest(t), field)
    camera = Camera(scene, [state], view, size, field is not None)
    return picture(scene, state, camera, field, limits_of([state], field) if limits is None else limits)


def animation(scene: Scene, path: "str | None", seconds: float, between: "tuple[float, float] | None", scalars: "str | None",
              size: Any, view: Any, limits: Any) -> Any:
    """Frames of the run, 15 a second, with one camera and one scale; a path, or an image that notebooks show."""
    from tempfile import TemporaryDirectory

    _pillow()
    kind = "gif" if path is None else path.rpartition(".")[2].lower()
    if kind not in ("gif", "webp", "png"):
        raise ValueError(f"an animation is a file .gif, .webp or .png, not {path!r}")
    size, field = _checked_size(size), field_of(scene, scalars)
    low, high = between or (float("-inf"), float("inf"))
    numbers = [k for k, t in enumerate(scene.times) if low <= t <= high]
    if not numbers:
        raise ValueError(f"there is no frame between {low:g} and {high:g}")
    count = max(1, min(len(numbers), round(15 * seconds)))
    numbers = [numbers[round(k * (len(numbers) - 1) / max(1, count - 1))] for k in range(count)]
    states = [state_of(scene, k, field) for k in numbers]
    limits = limits_of(states, field) if limits is None else limits
    camera = Camera(scene, states, view, size, field is not None)
    pictures = [picture(scene, state, camera, field, limits) for state in states]
    options: "dict[str, Any]" = {"save_all": True, "append_images": pictures[1:], "loop": 0,
                                 "duration": max(20, round(1000 * seconds / len(pictures)))}
    if path is not None:
        pictures[0].save(path, **options)
        return path
    from IPython.display import Image as Shown  # type: ignore[import-not-found]

    with TemporaryDirectory() as folder:
        file = f"{folder}/animation.gif"
        pictures[0].save(file, **options)
        with open(file, "rb") as f:
            return Shown(f.read(), format="gif")


def png(scene: Scene, size: "tuple[int, int]") -> "bytes | None":
    """The last frame as a file; None without Pillow, or where it would take long."""
    from io import BytesIO

    if not scene.times or scene.points > 200_000:
        return None
    try:
        image = still(scene, None, "auto", size, None, None)
    except ImportError:
        return None
    file = BytesIO()
    image.save(file, format="PNG", optimize=True)
    return file.getvalue()
