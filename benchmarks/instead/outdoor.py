"""Outdoors for Cycles: a sun, a sky, a lawn and a few blocks."""

import math
import random

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.resolution_x = scene.render.resolution_y = 128

world = bpy.data.worlds.new("sky")
world.use_nodes = True
sky = world.node_tree.nodes["Background"]
sky.inputs["Color"].default_value, sky.inputs["Strength"].default_value = (0.45, 0.65, 1, 1), 0.8
scene.world = world

sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy, sun.data.angle, sun.data.color = 4, math.radians(2), (1, 0.93, 0.8)
sun.rotation_euler = (math.radians(50), 0, math.radians(35))
scene.collection.objects.link(sun)


def material(name, colour, roughness):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value, inputs["Roughness"].default_value = (*colour, 1), roughness
    return made


lawn = material("lawn", (0.1, 0.2, 0.05), 1)
grain = lawn.node_tree.nodes.new("ShaderNodeTexNoise")
grain.inputs["Scale"].default_value, grain.inputs["Detail"].default_value = 30, 8
ramp = lawn.node_tree.nodes.new("ShaderNodeValToRGB")
ramp.color_ramp.elements[0].color = (0.02, 0.06, 0.01, 1)
ramp.color_ramp.elements[1].color = (0.2, 0.35, 0.08, 1)
lawn.node_tree.links.new(grain.outputs[0], ramp.inputs[0])
lawn.node_tree.links.new(ramp.outputs[0], lawn.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
bpy.ops.mesh.primitive_plane_add(size=60)
bpy.context.object.data.materials.append(lawn)

looks = [material("plaster", (0.8, 0.75, 0.65), 0.9), material("brick", (0.5, 0.2, 0.13), 0.8)]
looks.append(material("steel", (0.5, 0.5, 0.55), 0.25))
dice = random.Random(4)
for k in range(9):
    height = dice.uniform(0.8, 3.5)
    at = ((k % 3 - 1) * 2.6 + dice.uniform(-0.4, 0.4), (k // 3) * 2.6, height / 2)
    bpy.ops.mesh.primitive_cube_add(size=1, location=at, rotation=(0, 0, dice.uniform(0, 1.5)))
    bpy.context.object.scale = (1.3, 1.3, height)
    bpy.context.object.data.materials.append(looks[k % 3])

camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.angle = math.radians(50)
camera.location, camera.rotation_euler = (0.5, -8, 2.6), (math.radians(83), 0, 0)
scene.collection.objects.link(camera)
scene.camera = camera
