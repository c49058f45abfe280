"""Triangles and lines as pixels, by a buffer of depths. NumPy alone: no window, no graphics card, no library of VTK."""

from typing import Any

BATCH = 4_000_000  # pixels that are looked at together


class Raster:
    """A picture of `width` x `height` pixels. What is nearer hides what is farther; depth grows towards the eye."""

    def __init__(self, width: int, height: int) -> None:
        import numpy as np

        self.width, self.height = width, height
        self.depth = np.full(width * height, -np.inf)
        self.rgb = np.full((width * height, 3), np.nan)

    def triangles(self, xy: Any, depth: Any, corners: Any, colour: Any) -> None:
        """xy: (points, 2) in pixels, y down; depth: (points,); corners: (n, 3). colour(triangle, weights) gives (m, 3) for
        m pixels: which triangle each belongs to, and how much of its corners it has, (m, 3)."""
        import numpy as np

        p = xy[corners]
        with np.errstate(invalid="ignore"):
            low = np.maximum(np.ceil(p.min(axis=1) - 0.5), 0)
            high = np.minimum(np.floor(p.max(axis=1) - 0.5), [self.width - 1, self.height - 1])
            area = _cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
            seen = np.flatnonzero((high >= low).all(axis=1) & (np.abs(area) > 1e-12) & np.isfinite(depth[corners]).all(axis=1))
        p, corners, low = p[seen], corners[seen], low[seen].astype(np.int64)
        wide, tall = (high[seen] - low + 1).astype(np.int64).T
        # Weights of the corners are linear in x and y: 1 at a corner, 0 on the side across.
        slope, start = [], []
        for i in range(3):
            a, b = p[:, (i + 1) % 3], p[:, (i + 2) % 3]
            slope.append(np.stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]]) / area[seen])
            start.append(_cross(a, b) / area[seen] + 0.5 * slope[i].sum(axis=0))
        of_depth = depth[corners].T
        ends = np.cumsum(wide * tall)
        first = 0
        while first < len(seen):
            before = ends[first - 1] if first else 0
            last = max(first + 1, int(np.searchsorted(ends, before + BATCH, "right")))
            which = np.repeat(np.arange(first, last), (wide * tall)[first:last])
            inside = np.arange(len(which)) - np.repeat(ends[first:last] - before - (wide * tall)[first:last], (wide * tall)[first:last])
            row = inside // wide[which]
            x, y = low[which, 0] + inside - row * wide[which], low[which, 1] + row
            weights = [start[i][which] + slope[i][0][which] * x + slope[i][1][which] * y for i in range(2)]
            kept = np.flatnonzero((weights[0] >= -1e-9) & (weights[1] >= -1e-9) & (weights[0] + weights[1] <= 1 + 1e-9))
            which, pixel = which[kept], (y * self.width + x)[kept]
            w = np.stack([weights[0][kept], weights[1][kept], 1 - weights[0][kept] - weights[1][kept]], axis=1)
            d = sum(of_depth[i][which] * w[:, i] for i in range(3))
            self._put(pixel, d, lambda k, which=which, w=w: colour(seen[which[k]], w[k]))
            first = last

    def _put(self, pixel: Any, d: Any, colour: Any) -> None:
        import numpy as np

        k = np.flatnonzero(d > self.depth[pixel])
        k = k[np.argsort(d[k], kind="stable")]  # of several at a pixel the last one stays, the nearest
        last = np.full(self.width * self.height, -1)
        last[pixel[k]] = k
        k = last[last >= 0]
        self.depth[pixel[k]] = d[k]
        self.rgb[pixel[k]] = colour(k)

    def lines(self, a: Any, b: Any, depth_a: Any, depth_b: Any, rgb: Any, strength: float, slack: float = 0.0,
              width: int = 1, covers: bool = False) -> None:
        """Segments between a and b, (n, 2) each, where nothing is nearer by more than `slack`: mixed into what is there,
        or (covers) hiding what is behind them."""
        import numpy as np

        good = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1) & np.isfinite(depth_a + depth_b)
        a, b, depth_a, depth_b = a[good], b[good], depth_a[good], depth_b[good]
        steps = np.minimum(np.ceil(np.abs(b - a).max(axis=1, initial=0)).astype(np.int64), 4 * (self.width + self.height)) + 1
        which = np.repeat(np.arange(len(a)), steps)
        share = (np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)) / np.maximum(steps[which] - 1, 1)
        at = np.floor(a[which] + share[:, None] * (b - a)[which]).astype(np.int64)
        d = depth_a[which] + share * (depth_b - depth_a)[which] + slack
        for i in range(width):
            for j in range(width):
                x, y = at[:, 0] + i - width // 2, at[:, 1] + j - width // 2
                inside = (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
                pixel = (y * self.width + x)[inside]
                if covers:
                    self._put(pixel, d[inside], lambda k: np.broadcast_to(rgb, (len(k), 3)))
                    continue
                pixel = np.unique(pixel[d[inside] > self.depth[pixel]])
                under = np.where(np.isnan(self.rgb[pixel]), 1.0, self.rgb[pixel])
                self.rgb[pixel] = (1 - strength) * under + strength * np.asarray(rgb)

    def image(self, background: float = 1.0) -> Any:
        """(height, width, 3) in [0, 1]."""
        import numpy as np

        return np.where(np.isnan(self.rgb), background, self.rgb).reshape(self.height, self.width, 3)


def _cross(a: Any, b: Any) -> Any:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def creased_normals(points: Any, triangles: Any, degrees: float = 35.0) -> Any:
    """Normals at the corners of triangles, (n, 3, 3): of each the mean over the triangles at its point that lie at less
    than so many degrees to its own, so that round faces look round and edges stay edges."""
    import numpy as np

    n = len(triangles)
    p = points[triangles]
    own = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(own, axis=1, keepdims=True)
    unit = np.divide(own, length, out=np.zeros_like(own), where=length > 0)
    at = triangles.ravel()
    order = np.argsort(at, kind="stable")  # corners by their points
    count = np.bincount(at, minlength=len(points))
    if (count.astype(np.int64) ** 2).sum() > 40_000_000:
        return np.broadcast_to(unit[:, None], (n, 3, 3))
    start = np.cumsum(count) - count
    many = count[at]
    corner = np.repeat(np.arange(3 * n), many)  # each with each corner at its point
    other = order[np.repeat(start[at], many) + np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)]
    near = (unit[corner // 3] * unit[other // 3]).sum(axis=1) > np.cos(np.radians(degrees))
    total = np.stack([np.bincount(corner[near], own[other[near] // 3, i], 3 * n) for i in range(3)], axis=1).astype(float)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, size, out=np.zeros_like(total), where=size > 0).reshape(n, 3, 3)
