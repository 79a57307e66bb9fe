"""Eight small scenes for Cycles, which test_addon.py and benchmarks/tune.py render: SCENES[name]() makes one.

Each has what shots have and a cube on a plane has not. What a version of Blender lacks is left out."""

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


def camera(at, to, lens):
    data = bpy.data.cameras.new("camera")
    data.lens = lens
    bpy.context.scene.camera = aimed(data, at, to)
    return data


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
    if hasattr(made, "compositing_node_group"):
        tree = made.compositing_node_group = bpy.data.node_groups.new("over", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        end = tree.nodes.new("NodeGroupOutput")
    else:
        made.use_nodes = True
        tree, end = made.node_tree, made.node_tree.nodes["Composite"]
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
