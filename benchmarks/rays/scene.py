#!/usr/bin/env python3
"""The triangles of a scene and some camera rays, for embree.c: `scene.py FOLDER scene.xml…` reads Mitsuba's scenes,
`scene.py FOLDER field` makes one of ten million triangles. Needs numpy, and mitsuba for scene files."""

import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

RAYS = 400_000


def camera_rays(to_world, x_fov, aspect, rng):
    """Origins and directions through random points of the picture."""
    x, y = rng.uniform(-1, 1, (2, RAYS)) * np.tan(np.radians(x_fov) / 2)
    local = np.stack([x, y / aspect, np.ones(RAYS)], 1)
    directions = local @ to_world[:3, :3].T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.concatenate([np.broadcast_to(to_world[:3, 3], (RAYS, 3)), directions], 1)


def from_mitsuba(path, rng):
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    mi.file_resolver().prepend(str(Path(path).resolve().parent))
    # Shapes without materials, some of which Mitsuba 3 no longer reads
    root = ElementTree.parse(path).getroot()
    for node in list(root):
        if node.tag not in ("default", "sensor", "shape"):
            root.remove(node)
        for part in list(node):
            left_out = ("bsdf", "emitter", "ref") if node.tag == "shape" else ("film", "sampler")
            if part.tag in left_out or "mooth" in part.get("name", ""):
                node.remove(part)
    scene = mi.load_string(ElementTree.tostring(root, "unicode"))
    parts = []
    for shape in scene.shapes():
        mesh = mi.traverse(shape)
        if "vertex_positions" not in mesh:
            continue
        corners = np.array(mesh["vertex_positions"], np.float32).reshape(-1, 3)
        parts.append(corners[np.array(mesh["faces"]).reshape(-1, 3)])
    camera = scene.sensors()[0]
    width, height = camera.film().size()
    to_world = np.array(camera.world_transform().matrix, float)
    return np.concatenate(parts), camera_rays(to_world, mi.traverse(camera)["x_fov"], width / height, rng)


def field(rng):
    """A rough ground of two million triangles, and eight thousand bushes of a thousand on it."""
    n = 1000
    x, y = np.meshgrid(np.linspace(-50, 50, n + 1), np.linspace(-50, 50, n + 1))
    z = np.sin(0.3 * x) * np.cos(0.2 * y) + rng.uniform(0, 0.05, x.shape)
    ground = np.stack([x, y, z], 2).astype(np.float32)
    a, b, c, d = ground[:-1, :-1], ground[:-1, 1:], ground[1:, :-1], ground[1:, 1:]
    parts = [np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([d, c, b], 2).reshape(-1, 3, 3)]
    count, leaves = 8000, 1000
    middle = np.concatenate([rng.uniform(-50, 50, (count, 2)), rng.uniform(-1, 2, (count, 1))], 1)
    at = middle[:, None] + rng.normal(0, 0.4, (count, leaves, 3))
    bushes = at[:, :, None] + rng.normal(0, 0.05, (count, leaves, 3, 3))
    parts.append(bushes.reshape(-1, 3, 3).astype(np.float32))
    to_world = np.array([[1, 0, 0, 0], [0, -0.3, 0.95, -40], [0, 0.95, -0.3, 8], [0, 0, 0, 1]], float)
    return np.concatenate(parts), camera_rays(to_world, 60, 1.5, rng)


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:]:
        rng = np.random.default_rng(1)
        triangles, rays = field(rng) if name == "field" else from_mitsuba(name, rng)
        stem = name if name == "field" else Path(name).resolve().parent.name
        triangles.astype(np.float32).tofile(folder / f"{stem}.triangles")
        rays.astype(np.float32).tofile(folder / f"{stem}.camera")
        print(f"{stem}: {len(triangles):,} triangles")


main()
