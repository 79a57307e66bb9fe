#!/usr/bin/env python3
"""Random scenes in Mitsuba's format, for measuring what nobody has tuned: `random_scenes.py OUT [COUNT]` writes COUNT (8) of each
family to OUT/FAMILY-NUMBER/scene.xml, with their textures. The same number gives the same scene. Needs numpy.

Families: rooms (a lamp, a panel or a window; furniture of all finishes), glass (the same with balls, blocks and panes of glass, and
mirrors), outside (houses in sun and sky), leaves (hundreds of leaves before walls and sky, or in a room)."""
import pathlib
import struct
import sys
import zlib

import numpy as np

EDGE = 256


def png(path, picture):
    """Writes a picture of values in [0, 1]."""
    rows = np.clip(picture * 255 + 0.5, 0, 255).astype(np.uint8)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", rows.shape[1], rows.shape[0], 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def spots(rng, stretch=(1, 1)):
    """Noise of many scales in [0, 1], stretched along an axis."""
    sum_, weight = np.zeros((EDGE, EDGE)), 0.0
    for power in range(2, 8):
        cells = (max(2, 2**power // stretch[0]), max(2, 2**power // stretch[1]))
        grid = rng.random(cells)
        y, x = (np.linspace(0, n, EDGE, endpoint=False) for n in cells)
        at = lambda v, n: (v.astype(int) % n, (v.astype(int) + 1) % n, v % 1)
        (y0, y1, fy), (x0, x1, fx) = at(y, cells[0]), at(x, cells[1])
        mix = lambda a, b, f: a + (b - a) * f
        fy, fx = fy[:, None], fx[None, :]
        layer = mix(mix(grid[np.ix_(y0, x0)], grid[np.ix_(y0, x1)], fx), mix(grid[np.ix_(y1, x0)], grid[np.ix_(y1, x1)], fx), fy)
        strength = 0.7**power
        sum_, weight = sum_ + strength * layer, weight + strength
    return np.clip((sum_ / weight - 0.5) * 2.2 + 0.5, 0, 1)


def texture(rng, path):
    """A wooden, brick, speckled, striped or tiled surface."""
    dark, light = np.sort(rng.uniform(0.05, 0.85, (2, 3)), axis=0)
    kind = rng.choice(["wood", "brick", "speckles", "stripes", "tiles"])
    y, x = np.mgrid[0:EDGE, 0:EDGE]
    if kind == "wood":
        share = spots(rng, (8, 1))
    elif kind == "speckles":
        share = rng.random((EDGE, EDGE)) ** 2 * 0.6 + 0.4 * spots(rng)
    elif kind == "stripes":
        share = ((x // rng.integers(4, 24)) % 2) * 0.8 + 0.2 * spots(rng)
    else:
        rows, columns, joint = (16, 32, 2) if kind == "brick" else (32, 32, 3)
        shifted = x + (y // rows % 2) * columns // 2 * (kind == "brick")
        tint = rng.random((EDGE // rows + 1, EDGE // columns + 2))
        share = tint[y // rows, shifted // columns % (EDGE // columns)] * 0.5 + 0.3 + 0.2 * spots(rng)
        share = np.where((y % rows < joint) | (shifted % columns < joint), 0.05, share)
    png(path, dark + (light - dark) * share[..., None])


class Scene:
    def __init__(self, folder, rng):
        self.folder, self.rng, self.parts, self.textures = folder, rng, [], 0

    def colour(self, low=0.1, high=0.85):
        grey = self.rng.uniform(low, high)
        return np.clip(grey + self.rng.uniform(-0.2, 0.2, 3) * self.rng.integers(0, 2), 0.02, 0.9)

    def reflectance(self, tag="reflectance", plain=0.55, repeat=None):
        if self.rng.random() < plain:
            return f'<rgb name="{tag}" value="{" ".join(f"{c:.3f}" for c in self.colour())}"/>'
        name = f"texture-{self.textures}.png"
        self.textures += 1
        texture(self.rng, self.folder / name)
        repeat = repeat or self.rng.choice([1, 2, 4])
        return (f'<texture name="{tag}" type="bitmap"><string name="filename" value="{name}"/>'
                f'<float name="uscale" value="{repeat}"/><float name="vscale" value="{repeat}"/></texture>')

    def surface(self, plain=0.55, diffuse=0.6):
        """Diffuse, coated or metal."""
        draw = self.rng.random()
        if draw < diffuse:
            return f'<bsdf type="twosided"><bsdf type="diffuse">{self.reflectance(plain=plain)}</bsdf></bsdf>'
        alpha = self.rng.choice([0.05, 0.1, 0.2, 0.4])
        if draw < diffuse + (1 - diffuse) * 0.6:
            inside = f'<float name="alpha" value="{alpha}"/>{self.reflectance("diffuseReflectance", plain)}'
            return f'<bsdf type="twosided"><bsdf type="roughplastic">{inside}</bsdf></bsdf>'
        metal = self.rng.choice(["Cu", "Au", "Al"])
        inside = f'<float name="alpha" value="{alpha}"/><string name="material" value="{metal}"/>'
        return f'<bsdf type="twosided"><bsdf type="roughconductor">{inside}</bsdf></bsdf>'

    def clear(self):
        """Glass or a mirror."""
        draw = self.rng.random()
        if draw < 0.55:
            return '<bsdf type="dielectric"><float name="intIOR" value="1.5"/></bsdf>'
        if draw < 0.7:
            return '<bsdf type="roughdielectric"><float name="alpha" value="0.1"/><float name="intIOR" value="1.5"/></bsdf>'
        return '<bsdf type="twosided"><bsdf type="conductor"><string name="material" value="Ag"/></bsdf></bsdf>'

    def shape(self, kind, bsdf, scale, at, turn=(0, 0, 0), light=None):
        steps = "".join(f'<rotate {axis}="1" angle="{angle:.2f}"/>' for axis, angle in zip("xyz", turn) if angle)
        emitter = f'<emitter type="area"><rgb name="radiance" value="{light[0]:.3f} {light[1]:.3f} {light[2]:.3f}"/></emitter>' if light is not None else ""
        self.parts.append(
            f'<shape type="{kind}"><transform name="toWorld"><scale x="{scale[0]:.4f}" y="{scale[1]:.4f}" z="{scale[2]:.4f}"/>{steps}'
            f'<translate x="{at[0]:.4f}" y="{at[1]:.4f}" z="{at[2]:.4f}"/></transform>{bsdf}{emitter}</shape>')

    def camera(self, origin, target, angle):
        text = lambda v: ", ".join(f"{c:.4f}" for c in v)
        self.parts.append(
            f'<sensor type="perspective"><float name="fov" value="{angle:.2f}"/><transform name="toWorld">'
            f'<lookat origin="{text(origin)}" target="{text(target)}" up="0, 1, 0"/></transform>'
            '<film type="hdrfilm"><integer name="width" value="128"/><integer name="height" value="128"/>'
            '<rfilter type="box"/></film></sensor>')

    def sky(self, strength=1.0, sun=None):
        warm = self.rng.uniform(0.6, 1.1, 3) * strength
        self.parts.append(f'<emitter type="constant"><rgb name="radiance" value="{warm[0]:.3f} {warm[1]:.3f} {warm[2]:.3f}"/></emitter>')
        if sun is not None:
            direction, radiance = sun
            self.parts.append(
                f'<emitter type="directional"><vector name="direction" x="{direction[0]:.3f}" y="{direction[1]:.3f}" z="{direction[2]:.3f}"/>'
                f'<rgb name="irradiance" value="{radiance} {0.93 * radiance:.3f} {0.8 * radiance:.3f}"/></emitter>')

    def write(self):
        text = "\n".join(self.parts)
        (self.folder / "scene.xml").write_text(
            f'<scene version="0.6.0">\n<integrator type="path"><integer name="maxDepth" value="33"/></integrator>\n{text}\n</scene>\n')


def shell(scene):
    """Floor, ceiling and walls with a light; returns width, height and depth."""
    rng = scene.rng
    w, h, d = rng.uniform(3, 6), rng.uniform(2.4, 3.4), rng.uniform(4, 7)
    flat = lambda **more: scene.surface(diffuse=0.8, **more)
    scene.shape("rectangle", flat(plain=0.2), (w / 2, d / 2, 1), (0, 0, 0), (-90, 0, 0))
    scene.shape("rectangle", flat(plain=0.8), (w / 2, h / 2, 1), (0, h / 2, -d / 2))
    scene.shape("rectangle", flat(plain=0.7), (d / 2, h / 2, 1), (w / 2, h / 2, 0), (0, -90, 0))
    scene.shape("rectangle", flat(), (w / 2, h / 2, 1), (0, h / 2, d / 2), (0, 180, 0))
    scene.shape("rectangle", flat(plain=1.0), (w / 2, d / 2, 1), (0, h, 0), (90, 0, 0))
    light, white = rng.choice(["panel", "lamps", "window"]), '<bsdf type="diffuse"/>'
    left = lambda low, high, near, far: scene.shape(
        "rectangle", flat(plain=0.8), ((far - near) / 2, (high - low) / 2, 1), (-w / 2, (low + high) / 2, (near + far) / 2), (0, 90, 0))
    if light == "window":
        sill, top, near, far = 0.9, h - 0.4, rng.uniform(-d / 2 + 0.3, -0.6), rng.uniform(0, d / 2 - 1)
        left(0, sill, -d / 2, d / 2), left(top, h, -d / 2, d / 2), left(sill, top, -d / 2, near), left(sill, top, far, d / 2)
        scene.sky(rng.uniform(2, 6), ((1, -rng.uniform(0.4, 1.2), rng.uniform(-0.6, 0.6)), 25) if rng.random() < 0.5 else None)
    else:
        left(0, h, -d / 2, d / 2)
        tint = rng.uniform(0.7, 1, 3)
        if light == "panel":
            size = rng.uniform(0.2, 0.8)
            scene.shape("rectangle", white, (size, size, 1), (rng.uniform(-0.5, 0.5), h - 0.02, rng.uniform(-1, 1)), (90, 0, 0), 9 / size * tint)
        else:
            for _ in range(rng.integers(1, 4)):
                r = rng.uniform(0.04, 0.12)
                at = (rng.uniform(-w / 3, w / 3), rng.uniform(1.4, h - 0.4), rng.uniform(-d / 2 + 0.5, d / 4))
                scene.shape("sphere", white, (r, r, r), at, light=0.5 / r**2 * tint)
    scene.camera((rng.uniform(-w / 4, w / 4), rng.uniform(1.2, 1.8), d / 2 - 0.3), (rng.uniform(-0.6, 0.6), 0.9, -d / 4), rng.uniform(42, 62))
    return w, h, d


def furnish(scene, size, count, finish):
    (w, _, d), rng = size, scene.rng
    for _ in range(count):
        x, z, turn = rng.uniform(-w / 2 + 0.5, w / 2 - 0.5), rng.uniform(-d / 2 + 0.5, d / 4), rng.uniform(0, 90)
        base = 0.0
        if rng.random() < 0.6:
            base = rng.uniform(0.2, 1.1)
            scene.shape("cube", scene.surface(), (rng.uniform(0.15, 0.6), base / 2, rng.uniform(0.15, 0.5)), (x, base / 2, z), (0, turn, 0))
        r = rng.uniform(0.1, 0.4)
        if rng.random() < 0.6:
            scene.shape("sphere", finish(), (r, r, r), (x, base + r + 1e-3, z))
        else:
            scene.shape("cube", finish(), (r, r * rng.uniform(0.5, 1.5), r), (x, base + 1.6 * r, z), (0, turn + 20, 0))


def rooms(scene):
    furnish(scene, shell(scene), scene.rng.integers(5, 12), scene.surface)


def glass(scene):
    size = shell(scene)
    furnish(scene, size, scene.rng.integers(3, 6), scene.surface)
    furnish(scene, size, scene.rng.integers(3, 7), scene.clear)
    if scene.rng.random() < 0.5:
        pane = '<bsdf type="thindielectric"/>'
        scene.shape("rectangle", pane, (0.6, 0.7, 1), (scene.rng.uniform(-0.5, 0.5), 1.0, scene.rng.uniform(0, size[2] / 4)), (0, scene.rng.uniform(-30, 30), 0))


def ground(scene):
    scene.shape("rectangle", scene.surface(plain=0.1, diffuse=1.0), (40, 40, 1), (0, 0, 0), (-90, 0, 0))
    low = scene.rng.uniform(0.4, 1.4)
    sun = ((scene.rng.uniform(-1, 1), -low, -scene.rng.uniform(0.2, 1)), scene.rng.choice([3, 6, 10]))
    scene.sky(1.0, sun if scene.rng.random() < 0.75 else None)


def outside(scene):
    rng = scene.rng
    ground(scene)
    for _ in range(rng.integers(5, 14)):
        w, h, d = rng.uniform(0.8, 3), rng.uniform(0.6, 4), rng.uniform(0.8, 3)
        at = (rng.uniform(-8, 8), h, rng.uniform(-14, 0))
        scene.shape("cube", scene.surface(plain=0.3, diffuse=0.85), (w, h, d), at, (0, rng.uniform(0, 90), 0))
    for _ in range(rng.integers(2, 8)):
        r = rng.uniform(0.2, 1.0)
        scene.shape("sphere", scene.surface(), (r, r, r), (rng.uniform(-5, 5), r, rng.uniform(-5, 3)))
    scene.camera((rng.uniform(-3, 3), rng.uniform(1.4, 4), 8), (0, 1.4, -3), rng.uniform(40, 60))


def leaves(scene):
    rng = scene.rng
    inside = rng.random() < 0.4
    if inside:
        size = shell(scene)
        middles = [(rng.uniform(-size[0] / 4, size[0] / 4), rng.uniform(0.6, 1.2), rng.uniform(-size[2] / 3, 0.5)) for _ in range(3)]
        spread, leaf = 0.45, (0.03, 0.07)
    else:
        ground(scene)
        middles = [(rng.uniform(-3.5, 3.5), rng.uniform(1, 2.5), rng.uniform(-4, 2)) for _ in range(6)]
        spread, leaf = 0.9, (0.05, 0.14)
        scene.shape("cube", scene.surface(plain=0.3, diffuse=1.0), (5, 2, 1), (rng.uniform(-2, 2), 2, -7))
        scene.camera((rng.uniform(-1, 1), rng.uniform(1.4, 2.2), 6.5), (0, 1.5, -2), rng.uniform(38, 55))
    greens = [(rng.uniform(0.05, 0.25), rng.uniform(0.2, 0.5), rng.uniform(0.03, 0.15)) for _ in range(4)]
    for x, y, z in middles:
        scene.shape("cube", scene.surface(), (0.03, y / 2, 0.03), (x, y / 2, z))
        for _ in range(90):
            away = rng.normal(size=3) * spread * 0.5
            green = greens[rng.integers(4)]
            paint = f'<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="{green[0]:.3f} {green[1]:.3f} {green[2]:.3f}"/></bsdf></bsdf>'
            across = rng.uniform(*leaf)
            at = (x + away[0], max(y + away[1], 0.1), z + away[2])
            scene.shape("disk", paint, (across, across * rng.uniform(0.3, 0.6), 1), at, tuple(rng.uniform(0, 180, 3)))


FAMILIES = {"rooms": rooms, "glass": glass, "outside": outside, "leaves": leaves}


def main():
    out, count = pathlib.Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 8
    for place, (name, family) in enumerate(FAMILIES.items()):
        for number in range(1, count + 1):
            folder = out / f"{name}-{number}"
            folder.mkdir(parents=True, exist_ok=True)
            scene = Scene(folder, np.random.default_rng([place, number]))
            family(scene)
            scene.write()


main()
