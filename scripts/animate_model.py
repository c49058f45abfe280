#!/usr/bin/env python3
"""Makes an animated picture (WebP) of a result of `espalier simulate`, and a still one (PNG) of its first frame beside it.

    espalier simulate models/engine.toml --out results --set output.vtu_interval=0.0005
    python3 scripts/animate_model.py results --look engine --from 0.02 --to 0.04 --out engine.webp

The frames of results.vtkhdf (or motion.pvd) from --from (inclusive) to --to (exclusive) are drawn as scripts/draw_model.py draws them: for a
motion that repeats, one period makes a loop without a seam. --look takes view, colours and path of one of the models in
models/. Needs numpy, matplotlib, pillow, h5py (the group "pictures" of scripts/packages.txt).
"""
import argparse
import io
from dataclasses import replace
from pathlib import Path

import draw_model as draw
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image


def frames(folder, look, begin, end, width, height):
    """Pictures of width x height pixels without a ground, all in one window and with one scale of colours."""
    times, files = draw.read_series(folder)
    chosen = [k for k, t in enumerate(times) if begin - 1e-9 <= t < end - 1e-9]
    if not chosen:
        raise SystemExit(f"no frame lies between {begin:g} and {end:g}; there are {len(times)} from {times[0]:g} to {times[-1]:g}")
    shapes = [draw.polygons(draw.read_frame(files[k]), look) for k in chosen]
    most = look.most or float(np.nanpercentile(np.concatenate([s[1] for s in shapes]), 99.5)) or 1.0
    norm, colours = draw.Normalize(0, most, clip=True), plt.get_cmap("turbo")
    low, high = draw.limits(shapes)
    for shape in shapes:
        figure = plt.figure(figsize=(width / 100, height / 100), dpi=100, facecolor="none")
        axes = figure.add_axes((0, 0, 1, 1))
        draw.draw_frame(axes, shape, look, norm, colours)
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png")
        plt.close(figure)
        picture = Image.open(buffer).convert("RGBA")
        # Neighbouring polygons share their edge pixels, each half covered: what is nearly solid becomes solid.
        picture.putalpha(picture.getchannel("A").point(lambda a: min(255, int(1.6 * a))))
        yield picture


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("results", type=Path, help="folder of results")
    p.add_argument("--out", required=True, type=Path, help="the animation, .webp; the still picture gets .png")
    p.add_argument("--look", choices=sorted(draw.LOOKS), help="as one of our models is drawn")
    p.add_argument("--from", dest="begin", type=float, default=0.0, help="time of the first frame")
    p.add_argument("--to", dest="end", type=float, default=np.inf, help="time of the first frame that is left out")
    p.add_argument("--seconds", type=float, default=2.0, help="how long the animation lasts (default 2)")
    p.add_argument("--size", type=int, nargs=2, default=(560, 330), metavar=("WIDTH", "HEIGHT"), help="pixels")
    p.add_argument("--quality", type=int, default=60, help="of the compression, 0 to 100 (default 60)")
    a = p.parse_args()
    look = replace(draw.LOOKS.get(a.look, draw.Look()), mesh=0.2)
    pictures = list(frames(a.results, look, a.begin, a.end, *a.size))
    pictures[0].quantize(128, method=Image.Quantize.FASTOCTREE).save(a.out.with_suffix(".png"), optimize=True)
    pictures[0].save(a.out, save_all=True, append_images=pictures[1:], loop=0, quality=a.quality, alpha_quality=30, method=6,
                     duration=round(1000 * a.seconds / len(pictures)))
    print(f"{a.out}: {len(pictures)} frames, {a.out.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
