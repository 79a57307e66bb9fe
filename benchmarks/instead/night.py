"""A dinner for Cycles by the light of three candles: glass, wine, silver and plaster, with a shallow depth of field."""

import math

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = 128, 72

world = bpy.data.worlds.new("night")
world.use_nodes = True
world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.3, 0.4, 0.7, 1)
world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.004
scene.world = world


def material(name, colour, roughness, **others):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value, inputs["Roughness"].default_value = (*colour, 1), roughness
    for key, value in others.items():
        inputs[key.replace("_", " ")].default_value = value
    return made


def put(looks, smooth=True):
    made = bpy.context.object
    made.data.materials.append(looks)
    if smooth:
        bpy.ops.object.shade_smooth()
    return made


plaster = material("plaster", (0.55, 0.5, 0.45), 0.9)
linen = material("linen", (0.6, 0.55, 0.5), 1.0)
silver = material("silver", (0.9, 0.88, 0.85), 0.15, Metallic=1.0)
glass = material("glass", (1, 1, 1), 0.0, Transmission_Weight=1.0, IOR=1.5)
wine = material("wine", (0.35, 0.01, 0.03), 0.0, Transmission_Weight=1.0, IOR=1.34)
wax = material("wax", (0.85, 0.8, 0.7), 0.5)
flame = material("flame", (0, 0, 0), 1.0, Emission_Color=(1, 0.55, 0.2, 1), Emission_Strength=400)

# A weave of the cloth, a few pixels wide
weave = linen.node_tree.nodes.new("ShaderNodeTexChecker")
weave.inputs["Scale"].default_value = 160
weave.inputs["Color1"].default_value, weave.inputs["Color2"].default_value = (0.62, 0.57, 0.52, 1), (0.42, 0.38, 0.34, 1)
linen.node_tree.links.new(weave.outputs[0], linen.node_tree.nodes["Principled BSDF"].inputs["Base Color"])

for at, size in [((0, 1.8, 1.2), (6, 0.1, 2.6)), ((-2.6, 0, 1.2), (0.1, 4, 2.6)), ((0, 0, 2.5), (6, 4, 0.1))]:
    bpy.ops.mesh.primitive_cube_add(size=1, location=at)
    put(plaster, smooth=False).scale = size
bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0.2, -0.05))
put(linen, smooth=False).scale = (2.4, 1.6, 0.1)
for x, y, height in [(-0.35, 0.25, 0.32), (0.05, 0.5, 0.42), (0.5, 0.3, 0.26)]:
    bpy.ops.mesh.primitive_cylinder_add(radius=0.028, depth=height, location=(x, y, height / 2))
    put(wax)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.07, depth=0.02, location=(x, y, 0.01))
    put(silver)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=12, radius=0.011, location=(x, y, height + 0.03))
    put(flame).scale = (1, 1, 2.2)
for x, y in [(-0.2, -0.15), (0.3, -0.05)]:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=32, radius=0.075, location=(x, y, 0.19))
    put(glass)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=32, radius=0.06, location=(x, y, 0.185))
    put(wine).scale = (1, 1, 0.8)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.007, depth=0.11, location=(x, y, 0.06))
    put(glass)
    bpy.ops.mesh.primitive_cylinder_add(radius=0.055, depth=0.008, location=(x, y, 0.004))
    put(glass)
bpy.ops.mesh.primitive_torus_add(major_radius=0.16, minor_radius=0.012, location=(0.05, -0.3, 0.012))
put(silver)

camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.angle = math.radians(38)
camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 1.55, 1.8
camera.location, camera.rotation_euler = (0.1, -1.6, 0.55), (math.radians(78), 0, math.radians(2))
scene.collection.objects.link(camera)
scene.camera = camera
