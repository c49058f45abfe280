#!/usr/bin/env python3
"""Draws section_constants.svg: what each stiffness of a beam's section works against.

    python3 docs/images/section_constants.py"""
import math
import os

LENGTH, HEIGHT, WIDTH = 3.0, 0.9, 0.5  # along x, y, z
CORNERS = [(0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5)]


def project(p):
    x, y, z = p
    return 40 * (0.92 * x - 0.55 * z), 40 * (-y + 0.30 * x * 0.55 + 0.42 * z)


def bend(s, k):
    """Position and slope angle after the length s of an arc of curvature k."""
    return (math.sin(k * s) / k, (1 - math.cos(k * s)) / k, k * s)


def straight(s, y, z):
    return s, y, z


def bending_z(s, y, z):
    x, up, a = bend(s, 0.32)
    return x - y * math.sin(a), up + y * math.cos(a), z


def bending_y(s, y, z):
    x, out, a = bend(s, 0.32)
    return x - z * math.sin(a), y, out + z * math.cos(a)


def torsion(s, y, z):
    a = 0.3 * s
    return s, y * math.cos(a) - z * math.sin(a), y * math.sin(a) + z * math.cos(a)


def swell(s, y, z):
    return s, 1.3 * y, 1.5 * z


def skew(s, y, z):
    return s, y + 0.45 * z, z + 0.25 * y


PANELS = [
    ('axial', 'E A: stretch along x', lambda s, y, z: (1.18 * s, y, z)),
    ('shear_y', 'k_y G A: sections slide along y', lambda s, y, z: (s, y + 0.22 * s, z)),
    ('shear_z', 'k_z G A: sections slide along z', lambda s, y, z: (s, y, z + 0.3 * s)),
    ('torsion', 'G J: twist about x', torsion),
    ('bending_y', 'E I_y: bending about y', bending_y),
    ('bending_z', 'E I_z: bending about z', bending_z),
    ('section_normal', 'the section itself swells', swell),
    ('section_shear', 'the section itself is sheared', skew),
]


def path(points, close=False):
    text = 'M' + ' L'.join(f'{x:.1f},{y:.1f}' for x, y in points)
    return text + (' Z' if close else '')


def bar(shape, style, sections=7, filled=False):
    steps = [LENGTH * k / 24 for k in range(25)]
    at = lambda s, c: project(shape(s, HEIGHT * c[0], WIDTH * c[1]))
    out = []
    for k in range(sections):
        s = LENGTH * k / (sections - 1)
        fill = ' fill="#cfe0f3"' if filled and k == sections - 1 else ' fill="none"'
        out.append(f'<path d="{path([at(s, c) for c in CORNERS], True)}" {style}{fill}/>')
    for c in CORNERS:
        out.append(f'<path d="{path([at(s, c) for s in steps])}" {style} fill="none"/>')
    return out


def arrow(a, b, colour='#444', width=1.4):
    angle = math.atan2(b[1] - a[1], b[0] - a[0])
    head = [(b[0] - 7 * math.cos(angle + t), b[1] - 7 * math.sin(angle + t)) for t in (0.4, -0.4)]
    return [f'<path d="{path([a, b])}" stroke="{colour}" stroke-width="{width}" fill="none"/>',
            f'<path d="{path([b] + head, True)}" fill="{colour}"/>']


def text(x, y, words, size=12, anchor='start', weight='normal', family='sans-serif'):
    return (f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" font-weight="{weight}" '
            f'font-family="{family}" fill="#222">{words}</text>')


def section_panel():
    """The section seen from the start of the beam, x away from the reader."""
    out = ['<rect x="-40" y="-72" width="80" height="144" fill="#cfe0f3" stroke="#1f4e86" stroke-width="1.6"/>']
    out += arrow((0, 0), (0, -100)) + arrow((0, 0), (85, 0))
    out += ['<circle cx="0" cy="0" r="6" fill="white" stroke="#444"/>',
            '<path d="M-4,-4 L4,4 M-4,4 L4,-4" stroke="#444" stroke-width="1.2"/>']
    out += [text(6, -96, 'y'), text(88, 4, 'z'), text(-14, 18, 'x')]
    out += arrow((-60, 0), (-60, -72), '#888', 1) + arrow((-60, 0), (-60, 72), '#888', 1)
    out += arrow((0, 90), (-40, 90), '#888', 1) + arrow((0, 90), (40, 90), '#888', 1)
    out += [text(-66, 4, 'height', 12, 'end'), text(0, 106, 'width', 12, 'middle')]
    return out


def main():
    grey = 'stroke="#bbbbbb" stroke-width="0.8" stroke-dasharray="3 2"'
    blue = 'stroke="#1f4e86" stroke-width="1.2"'
    width, height, left = 205, 165, 215
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left + 4 * width} {2 * height + 10}" '
           f'width="{left + 4 * width}" height="{2 * height + 10}">', '<rect width="100%" height="100%" fill="white"/>']
    out += ['<g transform="translate(110,150)">'] + section_panel() + ['</g>']
    out += [text(110, 290, 'the section, seen along the beam', 12, 'middle'),
            text(110, 306, 'x points away from the reader', 12, 'middle')]
    for k, (name, words, shape) in enumerate(PANELS):
        x, y = left + width * (k % 4), height * (k // 4)
        out.append(f'<g transform="translate({x + 40},{y + 60})">')
        out += bar(straight, grey) + bar(shape, blue, filled=True) + ['</g>']
        out += [text(x + 12, y + 138, name, 13, 'start', 'bold', 'monospace'), text(x + 12, y + 155, words, 12)]
    out.append('</svg>')
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), 'section_constants.svg'), 'w',
              encoding='utf-8') as f:
        f.write('\n'.join(out) + '\n')


if __name__ == '__main__':
    main()
