"""A still life for Cycles: varnished wood, brushed metal, glass, cloth and wax under two soft lamps."""

import math
import random

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.resolution_x = scene.render.resolution_y = 128

for name, at, power, size, turn in [
    ("key", (-2.5, -2, 3.5), 160, 1.2, (40, 0, -50)),
    ("fill", (3, -2.5, 2), 40, 2.5, (60, 0, 50)),
]:
    lamp = bpy.data.objects.new(name, bpy.data.lights.new(name, "AREA"))
    lamp.data.energy, lamp.data.size, lamp.location = power, size, at
    lamp.rotation_euler = [math.radians(angle) for angle in turn]
    scene.collection.objects.link(lamp)


def material(name, colour, **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    own = made.node_tree.nodes["Principled BSDF"].inputs
    own["Base Color"].default_value = (*colour, 1)
    for key, value in inputs.items():
        own[key.replace("_", " ")].default_value = value
    return made


wood = material("wood", (0.3, 0.15, 0.06), Roughness=0.3, Coat_Weight=0.5)
rings = wood.node_tree.nodes.new("ShaderNodeTexWave")
rings.inputs["Scale"].default_value, rings.inputs["Distortion"].default_value = 3, 6
ramp = wood.node_tree.nodes.new("ShaderNodeValToRGB")
ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (
    (0.12, 0.05, 0.02, 1),
    (0.4, 0.22, 0.1, 1),
)
wood.node_tree.links.new(rings.outputs["Color"], ramp.inputs[0])
wood.node_tree.links.new(ramp.outputs[0], wood.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
paper = material("paper", (0.7, 0.68, 0.65), Roughness=0.95)
looks = [
    material("brass", (0.8, 0.6, 0.25), Metallic=1.0, Roughness=0.25),
    material("glass", (1, 1, 1), Roughness=0.02, Transmission_Weight=1.0, IOR=1.5),
    material("cloth", (0.15, 0.2, 0.5), Roughness=1.0, Sheen_Weight=1.0),
    material("wax", (0.9, 0.75, 0.55), Roughness=0.5, Subsurface_Weight=1.0),
]
for at, size, look in [((0, 0, -0.05), (6, 3, 0.1), wood), ((0, 1.6, 2), (8, 0.1, 4.2), paper)]:
    bpy.ops.mesh.primitive_cube_add(size=1, location=at)
    bpy.context.object.scale = size
    bpy.context.object.data.materials.append(look)
dice = random.Random(7)
for k in range(8):
    radius = dice.uniform(0.18, 0.38)
    at = (-1.6 + 0.46 * k, dice.uniform(-0.5, 0.8), radius)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=radius, location=at)
    bpy.context.object.data.materials.append(looks[k % 4])
    bpy.ops.object.shade_smooth()

camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.angle = math.radians(38)
camera.location, camera.rotation_euler = (0, -5, 1.9), (math.radians(75), 0, 0)
scene.collection.objects.link(camera)
scene.camera = camera
