"""Serves Cycles (bpy, Blender as a module) to noisefloor-cycles.

A scene is a .blend file; scripts inside are not run. Or it is a .py file, which is run, and builds the scene. No options.

The file that is run begins with addon/noisefloor_addon/sampling.py, which says what samples are: see src/lib.rs.
"""

import contextlib
import math
import os
import runpy
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import host


# What Cycles can compute on beside the processor, best first
KINDS = ["OPTIX", "CUDA", "HIP", "ONEAPI", "METAL"]
# Settings of the scene that samples of a session are not taken by, and those of `adaptive` are
OWN = [
    "pixel_filter_type",
    "filter_width",
    "sample_clamp_direct",
    "sample_clamp_indirect",
    "light_sampling_threshold",
    "use_guiding",
    "sampling_pattern",
    "auto_scrambling_distance",
    "scrambling_distance",
    "adaptive_min_samples",
    "samples",
]


class Cycles:
    def __init__(self, init):
        import bpy
        import numpy

        # Blender reports every render on standard output; what goes wrong goes to standard error
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)

        self.bpy, self.np, self.seed = bpy, numpy, init["seed"]
        path = init["scene"]
        if path.endswith(".py"):
            runpy.run_path(path)
        else:
            bpy.ops.wm.open_mainfile(filepath=path, load_ui=False, use_scripts=False)
        self.scene = bpy.context.scene
        if init.get("frame") is not None:
            # Also switches to the camera that a marker binds to the frame
            self.scene.frame_set(init["frame"])
        if self.scene.camera is None:
            raise ValueError(f"{path} has no camera")
        self.memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
        # What the file says is the default: a GPU that is not there renders on the processor, as in Blender
        wanted = init.get("device") or ("auto" if self.scene.cycles.device == "GPU" else "cpu")
        warnings = self._configure(init)
        gpu = host.pick(wanted, self.gpus, warnings, self._use)
        if gpu is None:
            self.scene.cycles.device = "CPU"
        self.info = {
            "name": f"Cycles {bpy.app.version_string}{f' ({gpu[0]}, {gpu[1]})' if gpu else ''}",
            "width": self.scene.render.resolution_x,
            "height": self.scene.render.resolution_y,
            "unit": "samples-per-pixel",
            # A GPU adds the samples of a pixel in any order
            "repeats": "nothing" if gpu else "samples",
            "stratified": True,
            "warnings": warnings,
        }

    @staticmethod
    def gpus():
        import bpy

        own, found = bpy.context.preferences.addons["cycles"].preferences, []
        there = {kind for kind, *_ in own.get_device_types(bpy.context)}
        for kind in KINDS:
            if kind in there:
                found += [(kind, each.name, each.id) for each in own.get_devices_for_type(kind) if each.type == kind]
        return found, "Cycles finds no device of OptiX, CUDA, HIP, oneAPI or Metal"

    def _use(self, gpu):
        """Has this GPU alone render; raises if it cannot. The first picture may wait for kernels that are compiled."""
        own = self.bpy.context.preferences.addons["cycles"].preferences
        own.compute_device_type = gpu[0]
        for each in own.get_devices_for_type(gpu[0]):
            each.use = each.id == gpu[2]
        self.scene.cycles.device = "GPU"
        self._mean((0, 0, 1, 1), 0, 0, 1)

    def _configure(self, init):
        """Makes the scene render plain samples; returns warnings."""
        render, cycles = self.scene.render, self.scene.cycles
        warnings = []
        if render.engine != "CYCLES":
            warnings.append(f"the scene was made for {render.engine}; Cycles renders it")
            render.engine = "CYCLES"
        render.use_persistent_data = True
        if init.get("threads"):
            render.threads_mode, render.threads = "FIXED", init["threads"]

        # Size, in pixels, of which every render does a part
        for side, axis in [("width", "x"), ("height", "y")]:
            own = getattr(render, f"resolution_{axis}") * render.resolution_percentage // 100
            setattr(render, f"resolution_{axis}", init.get(side) or own)
        render.resolution_percentage = 100

        # What `adaptive` renders with is the user's own
        self.own = {name: getattr(cycles, name) for name in OWN if hasattr(cycles, name)}

        # Every sample counts in only one pixel, and in full
        cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.light_sampling_threshold = 0.0
        independent(cycles)

        depth = init.get("max_depth")
        if depth is not None:
            # Cycles counts bounces; even with none, light comes by a lit surface
            if depth < 2:
                raise ValueError("Cycles cannot render only directly seen light: max_depth must be at least 2")
            for kind in ["max", "diffuse", "glossy", "transmission", "volume"]:
                setattr(cycles, f"{kind}_bounces", depth - 2)

        # Radiance as it is, without what Blender does to pictures afterwards
        render.use_compositing = render.use_sequencer = render.use_multiview = False
        settings = render.image_settings
        settings.file_format, settings.color_mode = "OPEN_EXR", "RGB"
        settings.color_depth, settings.exr_codec = "32", "NONE"
        return warnings

    def sample(self, tiles):
        answers = [None] * len(tiles)
        for region, (sequence, point, samples), members in host.rectangles(tiles, ["sequence", "point", "samples"]):
            mean = self._mean(region, sequence, point, samples)
            for member in members:
                t = tiles[member]
                x, y = t["x"] - region[0], t["y"] - region[1]
                answers[member] = samples, mean[y : y + t["height"], x : x + t["width"]]
        return answers

    def adaptive(self, threshold, samples, seed, part):
        """The picture, or a part of it, as Cycles renders it by the settings of the scene, until this noise threshold; not denoised. Its pixel
        filter is sampled, so that the noise of neighbours stays independent. With the samples of its pixels, and their limits."""
        cycles, render = self.scene.cycles, self.scene.render
        before = {name: getattr(cycles, name) for name in [*self.own, "use_adaptive_sampling"]}
        layer = next(layer for layer in self.scene.view_layers if layer.use)
        counted = layer.cycles.pass_debug_sample_count
        try:
            for name, value in self.own.items():
                setattr(cycles, name, value)
            adapt(cycles, seed, threshold, samples or cycles.samples)
            # Of this picture, and of one that is as good as two where samples follow the threshold
            fewest = [least(cycles.adaptive_min_samples, each, cycles.samples) for each in (threshold, threshold / math.sqrt(2))]
            limits = cycles.adaptive_min_samples, threshold, cycles.samples
            layer.cycles.pass_debug_sample_count = True
            size = render.resolution_x, render.resolution_y
            region = tuple(part or (0, 0, *size))
            aim(render, size, region)
            self.shape = (*region[:1:-1], 3)
            with self._composited(layer) as (tree, node, out):
                colours, together = (tree.nodes.new(f"CompositorNode{name}Color") for name in ("Separate", "Combine"))
                tree.links.new(node.outputs["Image"], colours.inputs[0])
                for channel in range(3):
                    tree.links.new(colours.outputs[channel], together.inputs[channel])
                # The count takes the place of alpha, so that one file has both
                tree.links.new(node.outputs["Debug Sample Count"], together.inputs[3])
                tree.links.new(together.outputs[0], out.inputs[0])
                picture, shares = self._render(alpha=True)
            taken = counts(shares.astype(self.np.float32), *limits)
            return picture, self.np.repeat(taken, 3, axis=2), (*fewest, cycles.samples)
        finally:
            layer.cycles.pass_debug_sample_count = counted
            for name, value in before.items():
                setattr(cycles, name, value)

    @contextlib.contextmanager
    def _composited(self, layer):
        """A compositor, whose output is the picture: its tree, the node of a layer, and the last. Only that makes a pass the picture."""
        scene, groups = self.scene, self.bpy.data.node_groups
        tree = groups.new("noisefloor", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        node, out = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("NodeGroupOutput")
        node.scene, node.layer = scene, layer.name
        scene.compositing_node_group, scene.render.use_compositing = tree, True
        try:
            yield tree, node, out
        finally:
            scene.compositing_node_group, scene.render.use_compositing = None, False
            groups.remove(tree)

    def first_hits(self, index, samples):
        """Albedo and normals as Cycles gives them to its own denoisers: where a mirror or glass is hit, of what is seen in it."""
        cycles = self.scene.cycles
        layer = next(layer for layer in self.scene.view_layers if layer.use)
        before = cycles.diffuse_bounces, layer.cycles.denoising_store_passes
        # Paths need go no further than to the first surface that is no mirror
        cycles.diffuse_bounces, layer.cycles.denoising_store_passes = 0, True
        region = (0, 0, self.info["width"], self.info["height"])
        try:
            pictures = []
            with self._composited(layer) as (tree, node, out):
                for name in ["Denoising Albedo", "Denoising Normal"]:
                    tree.links.clear()
                    tree.links.new(node.outputs[name], out.inputs[0])
                    pictures.append(self._mean(region, 0, 0, samples, f" first hits {index}"))
        finally:
            cycles.diffuse_bounces, layer.cycles.denoising_store_passes = before
        albedo, normal = pictures
        # A lamp's albedo is its radiance
        return self.np.clip(albedo, 0, 1), normal

    def _mean(self, region, sequence, point, samples, stream=""):
        """Mean of samples of a sequence from a point on, of a region, pattern by pattern."""
        render = self.scene.render
        aim(render, (render.resolution_x, render.resolution_y), region)
        self.shape = (*region[:1:-1], 3)
        total, done = 0.0, 0
        while done < samples:
            whole = longest(self.scene.cycles)
            length = min(whole - (point + done) % whole, samples - done)
            choose(self.scene.cycles, self.seed, sequence, point + done, length, stream)
            total = total + self._render() * length
            done += length
        return total / samples

    def _render(self, alpha=False):
        """Mean of the samples chosen, rows from the top, as float64; and alpha, if it is wanted."""
        images = self.bpy.data.images
        self.scene.render.image_settings.color_mode = "RGBA" if alpha else "RGB"
        self.bpy.ops.render.render()
        # The pixels of a render result are out of a script's reach: only a file has them. It is there for milliseconds, because
        # a process whose parent is gone ends at once and cleans nothing up
        with tempfile.TemporaryDirectory(prefix="noisefloor-", dir=self.memory) as folder:
            path = os.path.join(folder, "part.exr")
            images["Render Result"].save_render(path)
            image = images.load(path, check_existing=False)
            image.colorspace_settings.name = "Non-Color"
            pixels = self.np.empty(len(image.pixels), self.np.float32)
            image.pixels.foreach_get(pixels)
        width, height = image.size
        every = pixels.reshape(height, width, image.channels)[::-1]
        picture = every[..., :3]
        images.remove(image)
        if picture.shape != self.shape:
            raise RuntimeError(f"a region of {self.shape} came back as {picture.shape}")
        picture = picture.astype(self.np.float64)
        return (picture, every[..., 3:]) if alpha else picture


if __name__ == "__main__":
    host.serve(Cycles)
