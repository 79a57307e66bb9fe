"""A Denoise node that follows in the compositor: what it will make of the picture is not judged."""

ADVICE = "a Denoise node follows: turn Denoise on, or noise is judged that it will remove"


def denoises(scene):
    """Whether the compositor of this scene will denoise what Cycles renders."""
    # Before Blender 5, a scene has its own tree, which is used or not
    tree = getattr(scene, "compositing_node_group", None) or (
        getattr(scene, "node_tree", None) if getattr(scene, "use_nodes", False) else None
    )
    return bool(scene.render.use_compositing and tree and _denoises(tree, set()))


def _denoises(tree, seen):
    if tree in seen:
        return False
    seen.add(tree)
    for node in tree.nodes:
        if node.mute:
            continue
        if node.bl_idname == "CompositorNodeDenoise" and any(socket.is_linked for socket in node.outputs):
            return True
        if node.bl_idname == "CompositorNodeGroup" and node.node_tree and _denoises(node.node_tree, seen):
            return True
    return False
