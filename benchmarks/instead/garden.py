"""A garden for Cycles: a lawn of blades, bushes of leaves that light shines through, and a ball that flies by, with motion
blur and depth of field, under a sun and a sky."""

import math
import random

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = 128, 72
dice = random.Random(11)

world = bpy.data.worlds.new("sky")
world.use_nodes = True
sky = world.node_tree.nodes["Background"]
sky.inputs["Color"].default_value, sky.inputs["Strength"].default_value = (0.5, 0.68, 1, 1), 0.7
scene.world = world
sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy, sun.data.angle, sun.data.color = 6, math.radians(0.6), (1, 0.9, 0.75)
sun.rotation_euler = (math.radians(55), 0, math.radians(-40))
scene.collection.objects.link(sun)


def leaf(name, colour, through):
    """Half of the light goes through, with a colour of its own."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes["Principled BSDF"].inputs["Base Color"].default_value = (*colour, 1)
    nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.5
    behind, mixed = nodes.new("ShaderNodeBsdfTranslucent"), nodes.new("ShaderNodeMixShader")
    behind.inputs["Color"].default_value = (*through, 1)
    mixed.inputs[0].default_value = 0.4
    links.new(nodes["Principled BSDF"].outputs[0], mixed.inputs[1])
    links.new(behind.outputs[0], mixed.inputs[2])
    links.new(mixed.outputs[0], nodes["Material Output"].inputs["Surface"])
    return made


def mesh(name, points, faces, looks):
    made = bpy.data.meshes.new(name)
    made.from_pydata(points, [], faces)
    made.materials.append(looks)
    placed = bpy.data.objects.new(name, made)
    scene.collection.objects.link(placed)
    return placed


def plain(name, colour, roughness):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*colour, 1)
    made.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = roughness
    return made


bpy.ops.mesh.primitive_plane_add(size=40)
bpy.context.object.data.materials.append(plain("soil", (0.05, 0.035, 0.02), 1.0))
points, faces = [], []
for _ in range(60000):
    x, y = dice.uniform(-4, 4), dice.uniform(-2, 7)
    turn, height, bend = dice.uniform(0, math.tau), dice.uniform(0.06, 0.14), dice.uniform(0.01, 0.06)
    along, across = (math.cos(turn), math.sin(turn)), (-math.sin(turn) * 0.005, math.cos(turn) * 0.005)
    at = len(points)
    points += [(x - across[0], y - across[1], 0), (x + across[0], y + across[1], 0)]
    points.append((x + along[0] * bend, y + along[1] * bend, height))
    faces.append((at, at + 1, at + 2))
mesh("lawn", points, faces, leaf("grass", (0.06, 0.14, 0.02), (0.15, 0.3, 0.03)))
for middle, radius, colour in [((-1.5, 3.0, 0.8), 0.9, 0.0), ((0.4, 4.6, 0.9), 1.1, 0.04), ((2.2, 3.2, 0.6), 0.75, 0.02)]:
    points, faces = [], []
    for _ in range(9000):
        # Leaves are near the outside of a bush
        way = [dice.gauss(0, 1) for _ in range(3)]
        far = radius * dice.uniform(0.6, 1.0) / math.sqrt(sum(part**2 for part in way))
        x, y, z = (m + far * part for m, part in zip(middle, way))
        if z < 0:
            continue
        one, other = ([dice.gauss(0, 0.03) for _ in range(3)] for _ in range(2))
        at = len(points)
        points += [(x + a * p[0] + b * q[0], y + a * p[1] + b * q[1], z + a * p[2] + b * q[2])
                   for p, q in [(one, other)] for a, b in ((-1, 0), (0, -1), (1, 0), (0, 1))]  # fmt: skip
        faces.append((at, at + 1, at + 2, at + 3))
    mesh("bush", points, faces, leaf("leaves", (0.05 + colour, 0.13, 0.03), (0.2 + colour, 0.35, 0.04)))
bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=0.16)
ball = bpy.context.object
ball.data.materials.append(plain("rubber", (0.7, 0.08, 0.05), 0.4))
bpy.ops.object.shade_smooth()
for frame, at in [(0, (-0.15, 1.0, 0.75)), (2, (0.55, 1.0, 0.9))]:
    ball.location = at
    ball.keyframe_insert("location", frame=frame)
scene.frame_set(1)
scene.render.use_motion_blur = True

camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.angle = math.radians(50)
camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 3.2, 0.8
camera.location, camera.rotation_euler = (0.2, -2.2, 0.8), (math.radians(85), 0, 0)
scene.collection.objects.link(camera)
scene.camera = camera
