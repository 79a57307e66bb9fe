"""Scenes for Cycles: SCENES[name]() makes one of eight small ones, which test_addon.py and benchmarks/tune.py render, and
LARGER[name]() one that benchmarks/tune.py alone does.

Each has what shots have and a cube on a plane has not. What a version of Blender lacks is left out."""

import math
import random

import bpy
from mathutils import Vector


def scene(view, working="Linear Rec.709", sky=(0.4, 0.5, 0.7), strength=0.3):
    """An empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if hasattr(bpy.data, "colorspace"):
        bpy.ops.wm.set_working_color_space(working_space=working, convert_colors=False)
    made = bpy.context.scene
    made.render.engine, made.view_settings.view_transform = "CYCLES", view
    made.render.resolution_x, made.render.resolution_y, made.render.resolution_percentage = 96, 64, 100
    if sky:
        made.world = bpy.data.worlds.new("sky")
        made.world.use_nodes = True
        back = made.world.node_tree.nodes["Background"].inputs
        back["Color"].default_value, back["Strength"].default_value = (*sky, 1), strength
    return made


def material(colour=(0.8, 0.8, 0.8), **inputs):
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    own = made.node_tree.nodes["Principled BSDF"].inputs
    for name, value in {"Base_Color": (*colour, 1), **inputs}.items():
        own[name.replace("_", " ")].default_value = value
    return made


def nodes(kind, out, **inputs):
    """A material of one node."""
    made = bpy.data.materials.new(kind)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    node, end = tree.nodes.new(kind), tree.nodes.new("ShaderNodeOutputMaterial")
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    tree.links.new(node.outputs[0], end.inputs[out])
    return made


def add(kind, look, at, scale=(1, 1, 1), **more):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(location=at, **more)
    made = bpy.context.object
    made.scale = scale
    made.data.materials.append(look)
    return made


def aimed(data, at, to):
    made = bpy.data.objects.new(data.name, data)
    made.location, made.rotation_euler = at, (Vector(to) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(made)
    return made


def lamp(kind, at, to, energy, colour=(1, 1, 1), **more):
    data = bpy.data.lights.new("lamp", kind)
    data.energy, data.color = energy, colour
    for name, value in more.items():
        setattr(data, name, value)
    return aimed(data, at, to)


def turned(made, *degrees):
    made.rotation_euler = [math.radians(angle) for angle in degrees]
    return made


def camera(at, to, lens):
    data = bpy.data.cameras.new("camera")
    data.lens = lens
    bpy.context.scene.camera = aimed(data, at, to)
    return data


def composited(made):
    """Gives a scene a compositor: its tree, and the node of what it makes."""
    if hasattr(made, "compositing_node_group"):
        tree = made.compositing_node_group = bpy.data.node_groups.new("after", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        return tree, tree.nodes.new("NodeGroupOutput")
    made.use_nodes = True
    return made.node_tree, made.node_tree.nodes["Composite"]


def window():
    """A room that is lit through a pane of glass."""
    made, wall = scene("AgX", sky=(0.5, 0.7, 1), strength=1.5), material((0.75, 0.72, 0.68), Roughness=0.9)
    for at, scale in [
        *(((0, 0, z), (4, 4, 0.05)) for z in (-0.05, 3.05)),
        *((at, size) for at, size in [((-4, 0, 1.5), (0.05, 4, 1.6)), ((0, 4, 1.5), (4, 0.05, 1.6)), ((0, -4, 1.5), (4, 0.05, 1.6))]),
        *(((4, 0, z), (0.05, 4, height)) for z, height in [(0.4, 0.4), (2.75, 0.3)]),
        *(((4, y, 1.5), (0.05, 1.2, 1.6)) for y in (-2.8, 2.8)),
    ]:
        add("cube", wall, at, scale)
    # As usual in rooms: the pane casts no shadow, and nobody waits for what it would focus
    made.cycles.caustics_refractive = made.cycles.caustics_reflective = False
    add("cube", material(Transmission_Weight=1.0, Roughness=0.0), (4, 0, 1.6), (0.01, 1.6, 0.9)).visible_shadow = False
    add("cube", material((0.1, 0.2, 0.35), Roughness=0.9), (-1.5, 1.5, 0.4), (1.3, 0.6, 0.4))
    add("uv_sphere", material(Metallic=1.0, Roughness=0.3), (0.6, 0.2, 0.4), (0.4, 0.4, 0.4))
    lamp("SUN", (0, 0, 0), (-1, 0.35, -0.8), 5, angle=0.01)
    portal = lamp("AREA", (3.9, 0, 1.6), (0, 0, 1.6), 1, shape="RECTANGLE", size=3.2, size_y=1.8)
    portal.data.cycles.is_portal, made.view_settings.exposure = True, 1
    camera((-0.8, -3.6, 1.6), (0.2, 1, 1), 20)
    return made


def hair():
    """Curves finer than a pixel."""
    made = scene("Filmic")
    ball = add("ico_sphere", material((0.5, 0.3, 0.2)), (0, 0, 1), subdivisions=3)
    ball.data.materials.append(nodes("ShaderNodeBsdfHairPrincipled", "Surface"))
    ball.modifiers.new("hair", "PARTICLE_SYSTEM")
    own = ball.particle_systems[0].settings
    own.type, own.count, own.hair_length, own.material = "HAIR", 800, 0.35, 2
    own.child_type, own.rendered_child_count = "INTERPOLATED", 4
    add("plane", material(), (0, 0, 0), size=20)
    lamp("AREA", (2.5, -2.5, 4), (0, 0, 1), 250, size=0.6)
    lamp("AREA", (-3, 2, 3), (0, 0, 1), 200, (0.7, 0.8, 1), size=0.4)
    camera((0, -4.6, 1.6), (0, 0, 1), 40)
    return made


def fog():
    """A spot in a volume, as Standard shows it."""
    made = scene("Standard", sky=(0.1, 0.15, 0.25), strength=0.2)
    made.cycles.volume_bounces = 1
    add("cube", nodes("ShaderNodeVolumePrincipled", "Volume", Density=0.08, Anisotropy=0.4), (0, 0, 5), size=12)
    add("plane", material((0.3, 0.25, 0.2)), (0, 0, 0), size=30)
    for i in range(5):
        add("cylinder", material((0.5, 0.5, 0.55)), ((i - 2) * 1.3, 1 + i % 2, 1.5), radius=0.2, depth=3)
    lamp("SPOT", (4, 4, 5), (-1, 0, 0.5), 2500, spot_size=0.6, shadow_soft_size=0.05)
    camera((0, -6, 1.7), (0, 0, 1.4), 32)
    return made


def film():
    """Three frames, two of them marked, with motion blur, depth of field and noise that is new in every frame."""
    made = scene("AgX")
    made.frame_start, made.frame_end, made.cycles.use_animated_seed = 1, 3, True
    made.render.use_motion_blur, made.noisefloor.frames = True, "markers"
    for frame in (1, 3):
        made.timeline_markers.new(f"mark {frame}", frame=frame)
    add("plane", material((0.4, 0.42, 0.45), Roughness=0.4), (0, 0, 0), size=20)
    runner = add("monkey", material((0.2, 0.5, 0.6), Metallic=0.6, Roughness=0.3), (-1, 0, 0.9))
    for frame, x in [(1, -1), (3, 1)]:
        runner.location.x = x
        runner.keyframe_insert("location", frame=frame)
    for i in range(6):
        add("cube", material((0.8, 0.3 + 0.1 * i, 0.1)), ((i - 2.5) * 1.1, 3 + i % 3, 0.3), size=0.6)
    lamp("AREA", (2, -2, 4), (0, 0, 0), 300, size=0.8)
    own = camera((0, -5, 1.8), (0, 0, 0.7), 50).dof
    own.use_dof, own.focus_distance, own.aperture_fstop = True, 5, 0.4
    return made


def layers():
    """Two layers over each other in the compositor, which makes them glow."""
    made = scene("AgX")
    made.render.film_transparent = True
    front, back = made.view_layers[0], made.view_layers.new("back")
    for name, layer in [("things", back), ("floor", front)]:
        made.collection.children.link(bpy.data.collections.new(name))
        layer.layer_collection.children[name].exclude = True
    for name, thing in [
        ("things", add("torus", material((1, 0.76, 0.33), Metallic=1.0, Roughness=0.25), (-0.9, 0, 0.4))),
        ("things", add("monkey", material((0.7, 0.05, 0.03), Coat_Weight=1.0), (1.2, -0.4, 0.8))),
        ("floor", add("plane", material((0.3, 0.35, 0.3)), (0, 0, 0), size=14)),
    ]:
        for own in thing.users_collection:
            own.objects.unlink(thing)
        made.collection.children[name].objects.link(thing)
    lamp("AREA", (3, -3, 5), (0, 0, 0), 400, size=1.5)
    camera((0, -6, 2.4), (0, 0, 0.6), 45)
    tree, end = composited(made)
    over, glow, ends = tree.nodes.new("CompositorNodeAlphaOver"), tree.nodes.new("CompositorNodeGlare"), []
    for layer in (back, front):
        ends.append(tree.nodes.new("CompositorNodeRLayers"))
        ends[-1].layer = layer.name
    pictures = [socket for socket in over.inputs if socket.type == "RGBA"]
    for socket, end_of in zip(pictures, ends):
        tree.links.new(end_of.outputs["Image"], socket)
    tree.links.new(over.outputs[0], glow.inputs[0])
    tree.links.new(glow.outputs[0], end.inputs[0])
    return made


def lights(view, working):
    """Saturated lights, whose colours lie outside of what Rec.709 has."""
    made = scene(view, working, strength=0.05)
    add("plane", material(), (0, 0, 0), size=20)
    for i in range(4):
        add("uv_sphere", material(Roughness=0.15 + 0.2 * i), ((i - 1.5) * 1.3, 0, 0.6), (0.6, 0.6, 0.6))
    for x, colour in [(-3, (1, 0.02, 0.02)), (0, (0.02, 1, 0.02)), (3, (0.02, 0.02, 1))]:
        lamp("AREA", (x, -1, 3), (x / 3, 0, 0.5), 120, colour, size=0.5)
    camera((0, -6, 2), (0, 0, 0.5), 40)
    return made


def leaves():
    """Translucent leaves that are cut out, as Standard shows them."""
    made, dice = scene("Standard", sky=(0.35, 0.55, 1), strength=0.6), random.Random(3)
    leaf = material((0.1, 0.3, 0.03), Subsurface_Weight=0.3)
    tree = leaf.node_tree
    where, far, cut = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "VectorMath", "Math"))
    far.operation, far.inputs[1].default_value = "DISTANCE", (0.5, 0.5, 0)
    cut.operation, cut.inputs[1].default_value = "LESS_THAN", 0.42
    tree.links.new(where.outputs["UV"], far.inputs[0])
    tree.links.new(far.outputs["Value"], cut.inputs[0])
    tree.links.new(cut.outputs[0], tree.nodes["Principled BSDF"].inputs["Alpha"])
    mesh = add("plane", leaf, (0, 0, -9), size=0.3).data
    for _ in range(400):
        made.collection.objects.link(one := bpy.data.objects.new("leaf", mesh))
        out = Vector([dice.gauss(0, 1) for _ in range(3)]).normalized() * dice.uniform(0.5, 1)
        one.location, one.rotation_euler = Vector((0, 0, 1.4)) + out, [dice.uniform(0, 6.3) for _ in range(3)]
    add("plane", material((0.15, 0.18, 0.05)), (0, 0, 0), size=30)
    lamp("SUN", (0, 0, 0), (0.6, 0.5, -0.9), 4, angle=0.01)
    camera((0, -5, 1.5), (0, 0, 1.2), 45)
    return made


def striped(look, kind, colours, **inputs):
    """Colours a material by a texture between two colours."""
    tree = look.node_tree
    texture, ramp = tree.nodes.new(kind), tree.nodes.new("ShaderNodeValToRGB")
    for name, value in inputs.items():
        texture.inputs[name].default_value = value
    for element, colour in zip(ramp.color_ramp.elements, colours):
        element.color = (*colour, 1)
    tree.links.new(texture.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return look


def outdoor():
    """A sun, a sky, a lawn and a few blocks."""
    made, dice = scene("AgX", sky=(0.45, 0.65, 1), strength=0.8), random.Random(4)
    turned(lamp("SUN", (0, 0, 0), (0, 0, -1), 4, (1, 0.93, 0.8), angle=math.radians(2)), 50, 0, 35)
    lawn = material((0.1, 0.2, 0.05), Roughness=1)
    add("plane", striped(lawn, "ShaderNodeTexNoise", [(0.02, 0.06, 0.01), (0.2, 0.35, 0.08)], Scale=30, Detail=8), (0, 0, 0), size=60)
    plaster, brick = material((0.8, 0.75, 0.65), Roughness=0.9), material((0.5, 0.2, 0.13), Roughness=0.8)
    looks = [plaster, brick, material((0.5, 0.5, 0.55), Roughness=0.25)]
    for k in range(9):
        height = dice.uniform(0.8, 3.5)
        at = ((k % 3 - 1) * 2.6 + dice.uniform(-0.4, 0.4), (k // 3) * 2.6, height / 2)
        add("cube", looks[k % 3], at, (1.3, 1.3, height), size=1, rotation=(0, 0, dice.uniform(0, 1.5)))
    camera((0.5, -8, 2.6), (0, 0, 0), 50).angle = math.radians(50)
    turned(made.camera, 83, 0, 0)
    return made


def shelf():
    """A still life: varnished wood, brushed metal, glass, cloth and wax under two soft lamps."""
    made, dice = scene("AgX", sky=None), random.Random(7)
    turned(lamp("AREA", (-2.5, -2, 3.5), (0, 0, 0), 160, size=1.2), 40, 0, -50)
    turned(lamp("AREA", (3, -2.5, 2), (0, 0, 0), 40, size=2.5), 60, 0, 50)
    wood = material((0.3, 0.15, 0.06), Roughness=0.3, Coat_Weight=0.5)
    striped(wood, "ShaderNodeTexWave", [(0.12, 0.05, 0.02), (0.4, 0.22, 0.1)], Scale=3, Distortion=6)
    add("cube", wood, (0, 0, -0.05), (6, 3, 0.1), size=1)
    add("cube", material((0.7, 0.68, 0.65), Roughness=0.95), (0, 1.6, 2), (8, 0.1, 4.2), size=1)
    looks = [
        material((0.8, 0.6, 0.25), Metallic=1.0, Roughness=0.25),
        material((1, 1, 1), Roughness=0.02, Transmission_Weight=1.0, IOR=1.5),
        material((0.15, 0.2, 0.5), Roughness=1.0, Sheen_Weight=1.0),
        material((0.9, 0.75, 0.55), Roughness=0.5, Subsurface_Weight=1.0),
    ]
    for k in range(8):
        radius = dice.uniform(0.18, 0.38)
        at = (-1.6 + 0.46 * k, dice.uniform(-0.5, 0.8), radius)
        add("uv_sphere", looks[k % 4], at, segments=48, ring_count=24, radius=radius)
        bpy.ops.object.shade_smooth()
    camera((0, -5, 1.9), (0, 0, 0), 50).angle = math.radians(38)
    turned(made.camera, 75, 0, 0)
    return made


def translucent(colour, through):
    """Leaves: two fifths of the light go through, with a colour of their own."""
    made = material(colour, Roughness=0.5)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    behind, mixed = nodes.new("ShaderNodeBsdfTranslucent"), nodes.new("ShaderNodeMixShader")
    behind.inputs["Color"].default_value, mixed.inputs[0].default_value = (*through, 1), 0.4
    links.new(nodes["Principled BSDF"].outputs[0], mixed.inputs[1])
    links.new(behind.outputs[0], mixed.inputs[2])
    links.new(mixed.outputs[0], nodes["Material Output"].inputs["Surface"])
    return made


def mesh(polygons, look):
    """Polygons of as many corners each, as one object."""
    made = bpy.data.meshes.new("mesh")
    corners = len(polygons[0])
    faces = [tuple(range(at, at + corners)) for at in range(0, corners * len(polygons), corners)]
    made.from_pydata([corner for polygon in polygons for corner in polygon], [], faces)
    made.materials.append(look)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("mesh", made))


def garden():
    """A lawn of blades, bushes of leaves that light shines through, and a ball that flies by, with motion blur and depth of
    field."""
    made, dice = scene("AgX", sky=(0.5, 0.68, 1), strength=0.7), random.Random(11)
    turned(lamp("SUN", (0, 0, 0), (0, 0, -1), 6, (1, 0.9, 0.75), angle=math.radians(0.6)), 55, 0, -40)
    add("plane", material((0.05, 0.035, 0.02), Roughness=1.0), (0, 0, 0), size=40)
    blades = []
    for _ in range(60000):
        x, y = dice.uniform(-4, 4), dice.uniform(-2, 7)
        turn, height, bend = dice.uniform(0, math.tau), dice.uniform(0.06, 0.14), dice.uniform(0.01, 0.06)
        along, across = (math.cos(turn), math.sin(turn)), (-math.sin(turn) * 0.005, math.cos(turn) * 0.005)
        ground = (x - across[0], y - across[1], 0), (x + across[0], y + across[1], 0)
        blades.append([*ground, (x + along[0] * bend, y + along[1] * bend, height)])
    mesh(blades, translucent((0.06, 0.14, 0.02), (0.15, 0.3, 0.03)))
    for middle, radius, colour in [((-1.5, 3.0, 0.8), 0.9, 0.0), ((0.4, 4.6, 0.9), 1.1, 0.04), ((2.2, 3.2, 0.6), 0.75, 0.02)]:
        bush = []
        for _ in range(9000):
            # Leaves are near the outside of a bush
            way = [dice.gauss(0, 1) for _ in range(3)]
            far = radius * dice.uniform(0.6, 1.0) / math.sqrt(sum(part**2 for part in way))
            at = [m + far * part for m, part in zip(middle, way)]
            if at[2] >= 0:
                one, other = ([dice.gauss(0, 0.03) for _ in range(3)] for _ in range(2))
                corners = ((-1, 0), (0, -1), (1, 0), (0, 1))
                bush.append([[x + a * p + b * q for x, p, q in zip(at, one, other)] for a, b in corners])
        mesh(bush, translucent((0.05 + colour, 0.13, 0.03), (0.2 + colour, 0.35, 0.04)))
    ball = add("uv_sphere", material((0.7, 0.08, 0.05), Roughness=0.4), (0, 0, 0), segments=48, ring_count=24, radius=0.16)
    bpy.ops.object.shade_smooth()
    for frame, ball.location in [(0, (-0.15, 1.0, 0.75)), (2, (0.55, 1.0, 0.9))]:
        ball.keyframe_insert("location", frame=frame)
    made.frame_set(1)
    made.render.use_motion_blur = True
    own = camera((0.2, -2.2, 0.8), (0, 0, 0), 50)
    own.angle, own.dof.use_dof, own.dof.focus_distance, own.dof.aperture_fstop = math.radians(50), True, 3.2, 0.8
    turned(made.camera, 85, 0, 0)
    return made


LARGER = {"outdoor": outdoor, "shelf": shelf, "garden": garden}
SCENES = {
    "window": window,
    "hair": hair,
    "fog": fog,
    "film": film,
    "layers": layers,
    "acescg": lambda: lights("ACES 2.0", "ACEScg"),
    "rec2020": lambda: lights("AgX", "Linear Rec.2020"),
    "leaves": leaves,
}
