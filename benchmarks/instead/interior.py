"""A room for Cycles: daylight through one window, a lamp, a tiled floor, wood, metal and glass."""

import math

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.resolution_x = scene.render.resolution_y = 128

world = bpy.data.worlds.new("sky")
world.use_nodes = True
sky = world.node_tree.nodes["Background"]
sky.inputs["Color"].default_value, sky.inputs["Strength"].default_value = (0.6, 0.75, 1, 1), 3
scene.world = world

sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy, sun.data.angle = 8, math.radians(1)
sun.rotation_euler = (math.radians(40), math.radians(48), 0)
scene.collection.objects.link(sun)

lamp = bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT"))
lamp.data.energy, lamp.data.shadow_soft_size, lamp.data.color = 25, 0.12, (1, 0.75, 0.5)
lamp.location = (1.4, 4.2, 1.7)
scene.collection.objects.link(lamp)


def material(name, colour, roughness, **others):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value, inputs["Roughness"].default_value = (*colour, 1), roughness
    for key, value in others.items():
        inputs[key].default_value = value
    return made


def box(name, at, size, looks, turn=0.0):
    bpy.ops.mesh.primitive_cube_add(size=1, location=at, rotation=(0, 0, turn))
    made = bpy.context.object
    made.name, made.scale = name, size
    made.data.materials.append(looks)


wall = material("wall", (0.75, 0.72, 0.68), 0.9)
wood = material("wood", (0.35, 0.18, 0.08), 0.35)
metal = material("metal", (0.7, 0.68, 0.62), 0.2, Metallic=1.0)
glass = material("glass", (1, 1, 1), 0.0, IOR=1.45)
glass.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
floor = material("floor", (0.3, 0.3, 0.3), 0.3)
tiles = floor.node_tree.nodes.new("ShaderNodeTexChecker")
tiles.inputs["Scale"].default_value = 12
tiles.inputs["Color1"].default_value, tiles.inputs["Color2"].default_value = (0.5, 0.45, 0.4, 1), (0.15, 0.1, 0.08, 1)
floor.node_tree.links.new(tiles.outputs[0], floor.node_tree.nodes["Principled BSDF"].inputs["Base Color"])

# Walls of 0.2; the left one is four boxes around a window
box("floor", (0, 2.5, -0.1), (4.4, 7.4, 0.2), floor)
box("ceiling", (0, 2.5, 2.8), (4.4, 7.4, 0.2), wall)
box("back", (0, 6.1, 1.35), (4.4, 0.2, 2.9), wall)
box("behind", (0, -1.1, 1.35), (4.4, 0.2, 2.9), wall)
box("right", (2.1, 2.5, 1.35), (0.2, 7.4, 2.9), wall)
box("left, before", (-2.1, 0.75, 1.35), (0.2, 3.9, 2.9), wall)
box("left, behind", (-2.1, 5.2, 1.35), (0.2, 2.0, 2.9), wall)
box("sill", (-2.1, 3.45, 0.4), (0.2, 1.5, 1.0), wall)
box("lintel", (-2.1, 3.45, 2.55), (0.2, 1.5, 0.5), wall)
box("table", (0.2, 3.7, 0.7), (1.5, 0.9, 0.06), wood)
for x in (-0.45, 0.85):
    for y in (3.35, 4.05):
        box("leg", (x, y, 0.35), (0.06, 0.06, 0.7), metal)
box("chest", (1.5, 5.4, 0.5), (0.9, 0.7, 1.0), wood, 0.3)
for name, at, radius, looks in [("ball", (0.5, 3.75, 0.88), 0.15, metal), ("glass", (-0.1, 3.6, 0.86), 0.13, glass)]:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=radius, location=at)
    bpy.context.object.name = name
    bpy.context.object.data.materials.append(looks)
    bpy.ops.object.shade_smooth()

camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.angle = math.radians(60)
camera.location, camera.rotation_euler = (0.3, -0.8, 1.4), (math.radians(84), 0, math.radians(2))
scene.collection.objects.link(camera)
scene.camera = camera
