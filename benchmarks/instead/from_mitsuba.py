#!/usr/bin/env python3
"""Makes a .blend file of a scene for Mitsuba 0.6 (meshes as .obj, discs, rectangles, an environment): from_mitsuba.py
SCENE.xml OUT.blend

Enough for the scenes of benedikt-bitterli.me that the benchmarks name, and no more: diffuse surfaces, plastic, metal, glass and
masks become the Principled BSDF, fog is left out. Run it in an environment that has bpy (4.2 or later).
"""

import math
import pathlib
import sys
import xml.etree.ElementTree as tree

import bpy
from mathutils import Matrix

# Mitsuba's scenes have y up, Blender's z
UPRIGHT = Matrix.Rotation(math.pi / 2, 4, "X")


def child(element, name):
    return next((each for each in element if each.get("name") == name), None)


def number(element, name, default):
    found = child(element, name)
    return default if found is None else float(found.get("value"))


def colour(element, name, default):
    """Red, green and blue, or the path of a texture."""
    found = child(element, name)
    if found is None:
        return default
    if found.tag == "texture":
        return str(folder / child(found, "filename").get("value"))
    numbers = [float(part) for part in found.get("value").replace(",", " ").split()]
    return numbers * 3 if len(numbers) == 1 else numbers


def matrix(element):
    """How an object stands in Blender."""
    found = element.find("transform/matrix")
    if found is None:
        return UPRIGHT
    numbers = [float(part) for part in found.get("value").split()]
    return UPRIGHT @ Matrix([numbers[row * 4 : row * 4 + 4] for row in range(4)])


def material(bsdf, name, emitted=None):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    own = nodes["Principled BSDF"].inputs

    def put(socket, value):
        if isinstance(value, str):
            image = nodes.new("ShaderNodeTexImage")
            image.image = bpy.data.images.load(value, check_existing=True)
            links.new(image.outputs["Color"], own[socket])
        else:
            own[socket].default_value = (*value, 1)

    while bsdf is not None and bsdf.get("type") in ("twosided", "mask"):
        if bsdf.get("type") == "mask":
            opacity = nodes.new("ShaderNodeTexImage")
            opacity.image = bpy.data.images.load(colour(bsdf, "opacity", None), check_existing=True)
            opacity.image.colorspace_settings.name = "Non-Color"
            links.new(opacity.outputs["Color"], own["Alpha"])
        bsdf = bsdf.find("bsdf")
    kind = "diffuse" if bsdf is None else bsdf.get("type")
    rough = math.sqrt(number(bsdf, "alpha", 0.1)) if kind.startswith("rough") else 0.0
    own["Roughness"].default_value = 1.0 if kind == "diffuse" else rough
    if kind == "diffuse":
        own["Specular IOR Level"].default_value = 0.0
        put("Base Color", [0.5] * 3 if bsdf is None else colour(bsdf, "reflectance", [0.5] * 3))
    elif kind in ("plastic", "roughplastic"):
        put("Base Color", colour(bsdf, "diffuseReflectance", [0.5] * 3))
        own["IOR"].default_value = number(bsdf, "intIOR", 1.5)
    elif kind in ("conductor", "roughconductor"):
        own["Metallic"].default_value = 1.0
        eta, k = colour(bsdf, "eta", [0.0] * 3), colour(bsdf, "k", [1.0] * 3)
        # Fresnel's reflectance of a conductor, at normal incidence
        normal = [((n - 1) ** 2 + e**2) / ((n + 1) ** 2 + e**2) for n, e in zip(eta, k)]
        share = colour(bsdf, "specularReflectance", [1.0] * 3)
        put("Base Color", [a * b for a, b in zip(normal, share)])
    elif kind in ("dielectric", "roughdielectric", "thindielectric"):
        own["Transmission Weight"].default_value = 1.0
        own["IOR"].default_value = number(bsdf, "intIOR", 1.5)
        put("Base Color", [1.0] * 3)
    else:
        raise SystemExit(f"{name}: {kind} is not known here")
    if emitted:
        own["Emission Color"].default_value, own["Emission Strength"].default_value = (*emitted, 1), 1.0
    return made


def mesh(shape):
    kind = shape.get("type")
    if kind == "obj":
        path = folder / child(shape, "filename").get("value")
        bpy.ops.wm.obj_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    elif kind == "disk":
        bpy.ops.mesh.primitive_circle_add(radius=1, vertices=64, fill_type="NGON")
    elif kind == "rectangle":
        bpy.ops.mesh.primitive_plane_add(size=2)
    else:
        raise SystemExit(f"a {kind} is not known here")
    return bpy.context.selected_objects


def environment(emitter):
    world = scene.world = bpy.data.worlds.new("environment")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    image, turn, at = (nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord"))
    image.image = bpy.data.images.load(str(folder / child(emitter, "filename").get("value")))
    # Mitsuba's maps begin a quarter turn from Blender's
    whole = Matrix.Rotation(math.pi / 2, 4, "Z") @ UPRIGHT @ (matrix(emitter).inverted() @ UPRIGHT) @ UPRIGHT.inverted()
    turn.inputs["Rotation"].default_value = whole.to_euler()
    links.new(at.outputs["Generated"], turn.inputs["Vector"])
    links.new(turn.outputs["Vector"], image.inputs["Vector"])
    links.new(image.outputs["Color"], nodes["Background"].inputs["Color"])


path, out = sys.argv[1:]
folder = pathlib.Path(path).resolve().parent
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
root = tree.parse(path).getroot()
materials = {bsdf.get("id"): material(bsdf, bsdf.get("id")) for bsdf in root.findall("bsdf")}
for shape in root.findall("shape"):
    lamp = shape.find("emitter")
    own = shape.find("bsdf")
    named = shape.find("ref")
    look = materials.get(named.get("id")) if named is not None else None
    if look is None or lamp is not None:
        look = material(own, "own", colour(lamp, "radiance", None) if lamp is not None else None)
    for made in mesh(shape):
        made.matrix_world = matrix(shape)
        made.data.materials.clear()
        made.data.materials.append(look)
for emitter in root.findall("emitter"):
    environment(emitter)
sensor = root.find("sensor")
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.sensor_fit, camera.data.angle = "HORIZONTAL", math.radians(number(sensor, "fov", 45))
# Mitsuba looks along z, Blender against it
camera.matrix_world = matrix(sensor) @ Matrix.Rotation(math.pi, 4, "Y")
scene.collection.objects.link(camera)
scene.camera = camera
bpy.ops.file.pack_all()
bpy.ops.wm.save_as_mainfile(filepath=str(pathlib.Path(out).resolve()))
sys.stdout.flush()
